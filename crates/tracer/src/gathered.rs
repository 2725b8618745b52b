//! The records of one pixel: what of them does not change with time, and their sums.

use std::ops::Range;

use glam::DVec3;
use rustc_hash::FxHashMap;
use sunglint_radiometry::REPLICATES;

use crate::Nodes;
use crate::light::{Block, Term};
use crate::paths::Source;

/// Records of one pixel that lie together in all but the sample: their sums by replicate.
#[derive(Clone, Debug)]
pub(crate) struct Merged {
    pub cluster: u8,
    pub term: Term,
    pub kind: Kind,
    /// Σ weight × spectrum: replicates × nodes.
    pub sums: Vec<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Own,
    MeanSky,
    OpenSky(DVec3),
    /// The sun on a group of vertices, where it stands to all alike.
    Sun {
        group: u32,
    },
    /// The open sky over such a group.
    Ambient {
        group: u32,
        normal: DVec3,
    },
}

/// What of a pixel's paths does not change with time, gathered once, and the rest.
pub(crate) struct PixelLight {
    pub merged: Vec<Merged>,
    /// Records of sun and open sky by group: those that count one by one where the sun does not stand to the group alike.
    pub of_groups: Vec<(u32, Range<usize>)>,
    /// Indices of these records, and of all others that each time lights anew.
    pub grouped: Vec<u32>,
    pub changing: Vec<u32>,
}

impl PixelLight {
    /// Sorts the records of one pixel. With `by_term` the parts of the radiance are kept apart.
    pub fn new(block: &Block<'_>, records: Range<usize>, by_term: bool) -> Self {
        let paths = block.paths;
        let n = block.nodes.len();
        let mut merged: Vec<Merged> = Vec::new();
        let mut found: FxHashMap<(u8, u8, u8, [u64; 3]), usize> = FxHashMap::default();
        let (mut changing, mut grouped) = (Vec::new(), Vec::new());
        for (i, record) in records.clone().zip(&paths.records[records]) {
            let (kind, key) = match record.source {
                Source::Own => (Kind::Own, [0; 3]),
                Source::MeanSky => (Kind::MeanSky, [0; 3]),
                Source::OpenSky { normal, unless: None } => {
                    (Kind::OpenSky(normal), normal.to_array().map(f64::to_bits))
                }
                Source::OpenSky { normal, unless: Some(vertex) } => {
                    grouped.push(i as u32);
                    let group = block.of_vertices[vertex as usize];
                    (Kind::Ambient { group, normal }, [u64::from(group), 1, 0])
                }
                Source::Sun { vertex } => {
                    grouped.push(i as u32);
                    let group = block.of_vertices[vertex as usize];
                    (Kind::Sun { group }, [u64::from(group), 0, 0])
                }
                _ => {
                    changing.push(i as u32);
                    continue;
                }
            };
            let sample = &paths.samples[record.sample as usize];
            let term = term_of(record.term, by_term);
            let tag = match kind {
                Kind::Own => 0,
                Kind::MeanSky => 1,
                Kind::OpenSky(_) => 2,
                Kind::Sun { .. } | Kind::Ambient { .. } => 3,
            };
            let at = *found.entry((sample.cluster, term as u8, tag, key)).or_insert_with(|| {
                merged.push(Merged { cluster: sample.cluster, term, kind, sums: vec![0.0; REPLICATES * n] });
                merged.len() - 1
            });
            let row = &mut merged[at].sums[usize::from(sample.replicate) * n..][..n];
            row.iter_mut().zip(paths.spectrum(record.spectrum)).for_each(|(sum, t)| *sum += record.weight * t);
        }
        let group_of = |i: &u32| match paths.records[*i as usize].source {
            Source::Sun { vertex } | Source::OpenSky { unless: Some(vertex), .. } => block.of_vertices[vertex as usize],
            _ => u32::MAX,
        };
        grouped.sort_by_key(group_of);
        let mut of_groups = Vec::new();
        let mut start = 0;
        for run in grouped.chunk_by(|a, b| group_of(a) == group_of(b)) {
            of_groups.push((group_of(&run[0]), start..start + run.len()));
            start += run.len();
        }
        Self { merged, of_groups, grouped, changing }
    }
}

pub(crate) fn term_of(term: Term, by_term: bool) -> Term {
    if by_term { term } else { Term::DiffuseSun }
}

/// Radiances of one pixel as they are added up.
pub(crate) struct Sums<'a> {
    nodes: &'a Nodes,
    /// One over the samples of each replicate.
    each: [f64; REPLICATES],
    pub radiance: Vec<[f64; REPLICATES]>,
    pub terms: Vec<(Term, Vec<f64>)>,
    by_term: bool,
}

impl<'a> Sums<'a> {
    pub fn new(block: &Block<'a>, each: [f64; REPLICATES], by_term: bool) -> Self {
        let radiance = vec![[0.0; REPLICATES]; block.channels.len()];
        Self { nodes: block.nodes, each, radiance, terms: Vec::new(), by_term }
    }

    /// Adds scale × Σ_q spectrum_q weights_q to each channel.
    pub fn add(&mut self, replicate: usize, term: Term, spectrum: &[f64], weights: &[f64], scale: f64) {
        if scale == 0.0 {
            return;
        }
        let scale = scale * self.each[replicate];
        let mut of_term = match self.by_term {
            true => {
                let at = self.terms.iter().position(|(known, _)| *known == term).unwrap_or_else(|| {
                    self.terms.push((term, vec![0.0; self.radiance.len()]));
                    self.terms.len() - 1
                });
                Some(&mut self.terms[at].1)
            }
            false => None,
        };
        let mut start = 0;
        for (c, sums) in self.radiance.iter_mut().enumerate() {
            let spectrum = &spectrum[self.nodes.of_channel(c)];
            let value = scale * spectrum.iter().zip(&weights[start..]).map(|(t, w)| t * w).sum::<f64>();
            start += spectrum.len();
            sums[replicate] += value;
            if let Some(of_term) = &mut of_term {
                of_term[c] += value / REPLICATES as f64;
            }
        }
    }
}
