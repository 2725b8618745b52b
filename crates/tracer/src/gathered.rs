//! The records of one pixel: what of them each time multiplies by one number or one sky, gathered once, and the rest.

use std::ops::Range;

use glam::{DVec2, DVec3};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use sunglint_radiometry::{Frame, LocalDir, REPLICATES, WorldDir};

use crate::lamp::Wants;
use crate::light::Block;
use crate::paths::{Record, Source};
use crate::pixel::{Parts, Term};
use crate::unseen::{Found, half_of};
use crate::vectors::{OfReplicates, of_replicates};
use crate::{Nodes, Paths};

/// Records of one pixel that lie together in all but the sample: their sums by replicate.
#[derive(Clone, Debug)]
pub(crate) struct Merged {
    /// Of samples.
    pub cluster: u8,
    pub term: Term,
    pub kind: Kind,
    /// Replicates that have such records, and Σ weight × spectrum of each at the nodes.
    replicates: SmallVec<[u8; REPLICATES]>,
    sums: Vec<f64>,
    /// Where these are many: all replicates at one node after another.
    by_node: Vec<OfReplicates>,
}

/// So many replicates cost as much one by one as all of them side by side.
const MANY_REPLICATES: usize = 5;

impl Merged {
    fn key(&self) -> Key {
        let (tag, numbers) = self.kind.key();
        (self.cluster, self.term, tag, numbers)
    }

    fn add(&mut self, replicate: u8, weight: f64, spectrum: &[f64]) {
        let n = spectrum.len();
        // Samples come replicate by replicate.
        let at = match self.replicates.last() {
            Some(last) if *last == replicate => self.replicates.len() - 1,
            _ => self.place_of(replicate, n),
        };
        self.sums[at * n..][..n].iter_mut().zip(spectrum).for_each(|(sum, t)| *sum += weight * t);
    }

    fn place_of(&mut self, replicate: u8, n: usize) -> usize {
        self.replicates.iter().position(|known| *known == replicate).unwrap_or_else(|| {
            if self.replicates.len() == 1 {
                // Most that have more than one have them all.
                self.sums.reserve_exact((REPLICATES - 1) * n);
            }
            self.replicates.push(replicate);
            self.sums.resize(self.sums.len() + n, 0.0);
            self.replicates.len() - 1
        })
    }

    /// Lays many replicates side by side, once all are there.
    fn finish(&mut self, n: usize) {
        if self.replicates.len() < MANY_REPLICATES {
            return self.sums.shrink_to_fit();
        }
        self.by_node = vec![[0.0; REPLICATES]; n];
        for (replicate, spectrum) in self.replicates.iter().zip(self.sums.chunks_exact(n)) {
            self.by_node.iter_mut().zip(spectrum).for_each(|(row, sum)| row[usize::from(*replicate)] = *sum);
        }
        self.sums = Vec::new();
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Own,
    MeanSky,
    OpenSky(DVec3),
    /// The sun on a run of points, where it stands to all alike.
    Sun {
        run: u32,
    },
    /// The open sky over such a run.
    Ambient {
        run: u32,
        normal: DVec3,
    },
    /// The sky in one direction of a patch.
    Patch {
        patch: u32,
        node: WorldDir,
    },
}

/// Records of sun and open sky at points of one group.
pub(crate) struct Run {
    pub group: u32,
    /// Of [`PixelLight::grouped`].
    pub records: Range<usize>,
}

/// Records that look at the sky along almost the same direction, as those of one plane mirror do: L_d is taken at four
/// directions and linearly between,
///
/// ```text
/// L_d(x, y) ≈ Σ_ij L_d(x_i, y_j) ½(1 ± √3 x/a) ½(1 ± √3 y/b)     x_i = ±a/√3, y_j = ±b/√3
/// ```
///
/// about the middle of a patch 2a × 2b. These are Gauss points: the mean over a patch evenly filled is exact for cubics, and
/// no direction is off by more than (a² |L_xx| + b² |L_yy|)/3. About the sun and the horizon L_d falls off no faster than
/// 1/χ², |L_xx| + |L_yy| ≤ 8 L/χ², so that beyond [`FROM_PEAKS`] half-widths from them that is 1e-4 of L.
pub(crate) struct Patch {
    /// Its middle, and the cosine of the angle from it within which the sun must not stand.
    pub middle: WorldDir,
    pub cos_near: f64,
    /// Of [`PixelLight::patched`].
    pub records: Range<usize>,
}

/// Half-widths of a patch that sun and horizon must be away from it: 8/3 of its inverse square is 1e-4.
const FROM_PEAKS: f64 = 164.0;
/// Directions of a patch lie within this angle of its first \[rad\].
const PATCH_ANGLE: f64 = 4e-3;
/// Fewer directions are looked up one by one.
const LEAST_OF_PATCH: usize = 6;
/// Patches of one pixel that are looked through for a direction.
const MOST_PATCHES: usize = 12;

/// Lobes about almost one mirror direction, in which the sun may be seen.
pub(crate) struct Glints {
    first: WorldDir,
    /// No lobe reaches farther from it \[rad\].
    angle: f64,
    pub records: Vec<u32>,
}

impl Glints {
    /// Whether some lobe may see a sun of this radius \[rad\].
    pub fn reach(&self, sun: WorldDir, radius: f64) -> bool {
        let angle = self.angle + radius;
        self.first.dot(sun) >= 1.0 - 0.5 * angle * angle
    }
}

/// What of a pixel's paths does not change with time, gathered once, and the rest.
pub(crate) struct PixelLight {
    /// What its records take of a lamp.
    pub wants: Wants,
    pub glints: Vec<Glints>,
    pub merged: Vec<Merged>,
    /// Those that count one by one where the sun does not stand to all points alike.
    pub runs: Vec<Run>,
    /// Of each half of the replicates in which all rays over first surfaces found the sky: a record of the sun there, and the share
    /// of the sky that a ray looked for.
    pub all_sky: [Option<(u32, f64)>; 2],
    pub patches: Vec<Patch>,
    /// Indices of the records of the runs and of the patches, and of all others that each time lights anew.
    pub grouped: Vec<u32>,
    pub patched: Vec<u32>,
    pub changing: Vec<u32>,
}

/// What tells merged records apart: cluster, term, and of the kind a tag and up to three numbers.
type Key = (u8, Term, u8, [u64; 3]);

impl Kind {
    /// Its tag and its numbers.
    fn key(self) -> (u8, [u64; 3]) {
        match self {
            Self::Own => (0, [0; 3]),
            Self::MeanSky => (1, [0; 3]),
            Self::OpenSky(normal) => (2, normal.to_array().map(f64::to_bits)),
            Self::Sun { run } => (3, [u64::from(run), 0, 0]),
            // Points of one group have one normal.
            Self::Ambient { run, .. } => (4, [u64::from(run), 0, 0]),
            Self::Patch { node, .. } => (5, node.vec().to_array().map(f64::to_bits)),
        }
    }
}

/// Merged records as they are found.
struct Gathering<'a> {
    paths: &'a Paths,
    parts: Parts,
    merged: Vec<Merged>,
    /// Where each is, once there are more than a [few](FEW_KEYS).
    found: FxHashMap<Key, usize>,
    /// The last of each tag: most records follow one of their own kind.
    last: [usize; 6],
}

impl<'a> Gathering<'a> {
    fn new(paths: &'a Paths, parts: Parts) -> Self {
        Self { paths, parts, merged: Vec::new(), found: FxHashMap::default(), last: [usize::MAX; 6] }
    }

    /// Adds a share of a record to those of its kind.
    fn add(&mut self, record: &Record, share: f64, kind: Kind) {
        let sample = &self.paths.samples[record.sample as usize];
        let spectrum = self.paths.spectrum(record.spectrum);
        let (cluster, term) = (sample.cluster, self.parts.of(record));
        let (tag, numbers) = kind.key();
        let key = (cluster, term, tag, numbers);
        let last = &mut self.last[usize::from(tag)];
        if let Some(merged) = self.merged.get_mut(*last).filter(|merged| merged.key() == key) {
            return merged.add(sample.replicate, record.weight * share, spectrum);
        }
        let merged = &mut self.merged;
        if merged.len() == FEW_KEYS && self.found.is_empty() {
            self.found.extend(merged.iter().map(Merged::key).zip(0..));
        }
        let known = match merged.len() < FEW_KEYS {
            true => merged.iter().position(|merged| merged.key() == key),
            false => self.found.get(&key).copied(),
        };
        *last = known.unwrap_or_else(|| {
            if merged.len() >= FEW_KEYS {
                self.found.insert(key, merged.len());
            }
            let sums = Vec::with_capacity(spectrum.len());
            merged.push(Merged { cluster, term, kind, replicates: SmallVec::new(), sums, by_node: Vec::new() });
            merged.len() - 1
        });
        merged[*last].add(sample.replicate, record.weight * share, spectrum);
    }
}

impl PixelLight {
    /// Sorts the records of one pixel, with parts of the radiance kept apart.
    pub fn new(block: &Block<'_>, records: Range<usize>, parts: Parts) -> Self {
        let paths = block.paths;
        let record = |i: u32| &paths.records[i as usize];
        let (mut changing, mut grouped) = (Vec::new(), Vec::with_capacity(records.len()));
        let mut glints: Vec<Glints> = Vec::new();
        let mut bundles: Vec<(WorldDir, Vec<u32>)> = Vec::new();
        let mut gathering = Gathering::new(paths, parts);
        for i in records.start as u32..records.end as u32 {
            let own = record(i);
            match own.source {
                Source::Own => gathering.add(own, 1.0, Kind::Own),
                Source::MeanSky => gathering.add(own, 1.0, Kind::MeanSky),
                Source::OpenSky { normal, unless: None } => gathering.add(own, 1.0, Kind::OpenSky(normal)),
                Source::OpenSky { unless: Some(_), .. } | Source::Sun { .. } => grouped.push(i),
                Source::Sky { direction, seen: None } => {
                    match bundles.iter().position(|(first, _)| is_near(*first, direction)) {
                        Some(at) => bundles[at].1.push(i),
                        None if bundles.len() < MOST_PATCHES => bundles.push((direction, vec![i])),
                        None => changing.push(i),
                    }
                }
                Source::Glint { mirror, half_angle, .. } => {
                    // A chord of such a length spans an angle hardly longer.
                    let angle = 1.01 * PATCH_ANGLE + half_angle;
                    match glints.iter().position(|glints| is_near(glints.first, mirror)) {
                        Some(at) => {
                            glints[at].angle = glints[at].angle.max(angle);
                            glints[at].records.push(i);
                        }
                        None if glints.len() == MOST_PATCHES => changing.push(i),
                        None => glints.push(Glints { first: mirror, angle, records: vec![i] }),
                    }
                }
                _ => changing.push(i),
            }
        }
        let group_of = |i: &u32| match record(*i).source {
            Source::Sun { vertex } | Source::OpenSky { unless: Some(vertex), .. } => block.of_vertices[vertex as usize],
            _ => u32::MAX,
        };
        sort_by_few(&mut grouped, group_of);
        let mut runs: Vec<Run> = Vec::new();
        for own in grouped.chunk_by(|a, b| group_of(a) == group_of(b)) {
            let start = runs.last().map_or(0, |run| run.records.end);
            let run = runs.len() as u32;
            runs.push(Run { group: group_of(&own[0]), records: start..start + own.len() });
            for own in own.iter().map(|i| record(*i)) {
                let kind = match own.source {
                    Source::OpenSky { normal, .. } => Kind::Ambient { run, normal },
                    _ => Kind::Sun { run },
                };
                gathering.add(own, 1.0, kind);
            }
        }
        let mut looked = Found::default();
        for i in &grouped {
            let own = record(*i);
            let sample = &paths.samples[own.sample as usize];
            if matches!(own.source, Source::Sun { vertex } if sample.vertex == Some(vertex)) && sample.sky_ray != 0.0 {
                looked.note(half_of(sample.replicate), sample.sky_ray > 0.0, (*i, sample.sky_ray));
            }
        }
        let (mut patches, mut patched) = (Vec::new(), Vec::new());
        for (first, own) in bundles {
            match patch(first, &own, patches.len() as u32, &mut gathering) {
                Some((middle, cos_near)) => {
                    patches.push(Patch { middle, cos_near, records: patched.len()..patched.len() + own.len() });
                    patched.extend(own);
                }
                None => changing.extend(own),
            }
        }
        let mut merged = gathering.merged;
        merged.iter_mut().for_each(|merged| merged.finish(block.nodes.len()));
        let wants = |kind: fn(&Kind) -> bool| merged.iter().any(|merged| kind(&merged.kind));
        let looks_up =
            changing.iter().any(|i| matches!(record(*i).source, Source::Sky { .. } | Source::FreeSky { .. }));
        let wants = Wants {
            own: wants(|kind| *kind == Kind::Own),
            mean_sky: wants(|kind| *kind == Kind::MeanSky),
            sky: looks_up || wants(|kind| !matches!(kind, Kind::Own | Kind::MeanSky | Kind::Sun { .. })),
        };
        let all_sky = looked.agreeing();
        Self { wants, glints, merged, runs, all_sky, patches, grouped, patched, changing }
    }
}

/// Keys of a pixel that are looked through for one.
const FEW_KEYS: usize = 16;

/// Sorts by a key and keeps the order of what has the same: in two passes where keys are few, as those of a pixel's facets are.
fn sort_by_few(values: &mut Vec<u32>, key: impl Fn(&u32) -> u32) {
    if values.windows(2).all(|own| key(&own[0]) == key(&own[1])) {
        return;
    }
    let mut keys: SmallVec<[(u32, usize); FEW_KEYS]> = SmallVec::new();
    let mut of_values = Vec::with_capacity(values.len());
    let mut last = 0;
    for own in values.iter().map(&key) {
        if keys.get(last).is_none_or(|(known, _)| *known != own) {
            last = keys.iter().position(|(known, _)| *known == own).unwrap_or(keys.len());
        }
        if last == FEW_KEYS {
            return values.sort_by_key(key);
        }
        if last == keys.len() {
            keys.push((own, 0));
        }
        keys[last].1 += 1;
        of_values.push(last as u8);
    }
    let mut order: SmallVec<[usize; FEW_KEYS]> = (0..keys.len()).collect();
    order.sort_by_key(|i| keys[*i].0);
    let mut start = 0;
    for i in order {
        start += std::mem::replace(&mut keys[i].1, start);
    }
    let mut sorted = vec![0; values.len()];
    for (value, of_value) in values.iter().zip(of_values) {
        let at = &mut keys[usize::from(of_value)].1;
        sorted[*at] = *value;
        *at += 1;
    }
    *values = sorted;
}

/// Whether two directions may lie in one bundle.
fn is_near(a: WorldDir, b: WorldDir) -> bool {
    (a.vec() - b.vec()).length_squared() <= PATCH_ANGLE * PATCH_ANGLE
}

/// Shares records that look at the sky about `first` between the directions of a patch: its middle and the cosine within
/// which no sun may stand; `None` where there are few, or the horizon is near.
fn patch(first: WorldDir, records: &[u32], patch: u32, gathering: &mut Gathering<'_>) -> Option<(WorldDir, f64)> {
    if records.len() < LEAST_OF_PATCH {
        return None;
    }
    let frame = Frame::about(first.vec());
    let paths = gathering.paths;
    let place = |i: &u32| match paths.records[*i as usize].source {
        Source::Sky { direction, .. } => {
            let local = frame.to_local(direction).vec();
            local.truncate() / local.z
        }
        _ => DVec2::ZERO,
    };
    let direction = |place: DVec2| frame.to_world(LocalDir::from_unit(place.extend(1.0).normalize()));
    let places: Vec<DVec2> = records.iter().map(place).collect();
    let low = places.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = places.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    let middle = 0.5 * (low + high);
    // Where all directions are one, the patch still has a width.
    let half = (0.5 * (high - low)).max(DVec2::splat(1e-7));
    let away = (FROM_PEAKS + 1.0) * half.max_element();
    let centre = direction(middle);
    if centre.cos_zenith() < away.sin() {
        return None;
    }
    let step = half / 3f64.sqrt();
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let side = DVec2::new(x, y);
        let kind = Kind::Patch { patch, node: direction(middle + side * step) };
        for (i, place) in records.iter().zip(&places) {
            let share = 0.5 * (DVec2::ONE + side * (*place - middle) / step);
            gathering.add(&paths.records[*i as usize], share.x * share.y, kind);
        }
    }
    Some((centre, away.cos()))
}

/// Radiances of one pixel as they are added up.
pub(crate) struct Sums<'a> {
    nodes: &'a Nodes,
    /// One over the samples of each replicate.
    each: [f64; REPLICATES],
    pub radiance: Vec<OfReplicates>,
    /// What of it rays over first surfaces found, where it is kept apart.
    pub looked: Vec<OfReplicates>,
    pub terms: Vec<(Term, Vec<f64>)>,
    pub parts: Parts,
}

impl<'a> Sums<'a> {
    pub fn new(block: &Block<'a>, each: [f64; REPLICATES], parts: Parts) -> Self {
        let n = block.channels.len();
        let radiance = vec![[0.0; REPLICATES]; n];
        let looked = vec![[0.0; REPLICATES]; if parts == Parts::Looked { n } else { 0 }];
        Self { nodes: block.nodes, each, radiance, looked, terms: Vec::new(), parts }
    }

    /// Adds scale × Σ_q spectrum_q weights_q to each channel.
    pub fn add(&mut self, replicate: usize, term: Term, spectrum: &[f64], weights: &[f64], scale: f64) {
        if scale != 0.0 {
            self.add_values(replicate, term, self.nodes.products(spectrum, weights), scale);
        }
    }

    /// Adds scale × value to each channel.
    pub fn add_values(&mut self, replicate: usize, term: Term, values: impl Iterator<Item = f64>, scale: f64) {
        let scale = scale * self.each[replicate];
        self.at(term, |sums| {
            for (c, value) in values.enumerate() {
                sums.one(c, replicate, scale * value);
            }
        });
    }

    /// The same of merged records.
    pub fn add_merged(&mut self, merged: &Merged, weights: &[f64], scale: f64) {
        if merged.by_node.is_empty() {
            let n = self.nodes.len().max(1);
            for (replicate, spectrum) in merged.replicates.iter().zip(merged.sums.chunks_exact(n)) {
                self.add(usize::from(*replicate), merged.term, spectrum, weights, scale);
            }
            return;
        }
        let each = self.each.map(|each| scale * each);
        let (nodes, mut start) = (self.nodes, 0);
        self.at(merged.term, |sums| {
            for c in 0..sums.radiance.len() {
                let rows = &merged.by_node[nodes.of_channel(c)];
                let values = of_replicates(&weights[start..], rows);
                start += rows.len();
                for (replicate, (value, each)) in values.iter().zip(&each).enumerate() {
                    sums.one(c, replicate, each * value);
                }
            }
        });
    }

    /// Lets `add` add to the sums, and to those of a term where they are wanted.
    fn at(&mut self, term: Term, add: impl FnOnce(&mut Adding<'_>)) {
        let of_term = match self.parts {
            Parts::Terms => {
                let at = self.terms.iter().position(|(known, _)| *known == term).unwrap_or_else(|| {
                    self.terms.push((term, vec![0.0; self.radiance.len()]));
                    self.terms.len() - 1
                });
                Some(self.terms[at].1.as_mut_slice())
            }
            _ => None,
        };
        let looked = (self.parts == Parts::Looked && term == Parts::LOOKED).then_some(self.looked.as_mut_slice());
        add(&mut Adding { radiance: &mut self.radiance, looked, of_term });
    }
}

/// What a record is added to.
struct Adding<'a> {
    radiance: &'a mut [[f64; REPLICATES]],
    looked: Option<&'a mut [[f64; REPLICATES]]>,
    of_term: Option<&'a mut [f64]>,
}

impl Adding<'_> {
    fn one(&mut self, c: usize, replicate: usize, value: f64) {
        self.radiance[c][replicate] += value;
        if let Some(looked) = &mut self.looked {
            looked[c][replicate] += value;
        }
        if let Some(of_term) = &mut self.of_term {
            of_term[c] += value / REPLICATES as f64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_sorted_by_their_keys_and_else_keep_their_order() {
        for keys in [1, 3, FEW_KEYS as u32, 40] {
            let key = |value: &u32| (value * 7919 + 5) % keys;
            let mut values: Vec<u32> = (0..300).map(|i| i * 31 % 300).collect();
            let mut due = values.clone();
            due.sort_by_key(key);
            sort_by_few(&mut values, key);
            assert_eq!(values, due, "{keys}");
        }
    }
    use crate::paths::{ONE, Sample};

    /// Σ share × L over the directions of a patch, and over the records themselves, for 64 directions that fill a rectangle of
    /// 4 by 2 mrad about a direction 50° high.
    fn both(radiance: &dyn Fn(DVec3) -> f64) -> (f64, f64) {
        let mut paths = Paths::new(1);
        let middle = WorldDir::from_zenith_azimuth(40f64.to_radians(), 1.0);
        let frame = Frame::about(middle.vec());
        for i in 0..64_u32 {
            let replicate = (i % 16) as u8;
            paths.samples.push(Sample::new(replicate, None, 0.0, 0.0));
            let place = DVec2::new(4e-3, 2e-3) * (DVec2::new(f64::from(i % 8), f64::from(i / 8)) - 3.5) / 7.0;
            let direction = frame.to_world(LocalDir::from_unit(place.extend(1.0).normalize()));
            let weight = 0.5 + 0.01 * f64::from(i);
            paths.record(i, ONE, Source::Sky { direction, seen: None }, weight, Term::SpecularSky);
        }
        let records: Vec<u32> = (0..64).collect();
        let mut gathering = Gathering::new(&paths, Parts::Terms);
        let (centre, cos_near) = patch(middle, &records, 0, &mut gathering).expect("64 records far from the horizon");
        assert!(centre.dot(middle) > 1.0 - 1e-9 && cos_near < 1.0);
        let of_merged = |merged: &Merged| match merged.kind {
            Kind::Patch { node, .. } => merged.sums.iter().sum::<f64>() * radiance(node.vec()),
            _ => panic!("{:?}", merged.kind),
        };
        let of_record = |record: &Record| match record.source {
            Source::Sky { direction, .. } => record.weight * radiance(direction.vec()),
            _ => panic!("{:?}", record.source),
        };
        (gathering.merged.iter().map(of_merged).sum(), paths.records.iter().map(of_record).sum())
    }

    /// A sky that is even or linear over the patch comes back exactly, the steepest that it is for to 1e-4: 1/χ² about a sun as
    /// near as one may stand.
    #[test]
    fn a_patch_gives_the_sky_of_its_records() {
        let (found, due) = both(&|_| 3.0);
        assert!((found / due - 1.0).abs() < 1e-12);
        let (found, due) = both(&|d| 1.0 + d.x - 0.5 * d.y);
        assert!((found / due - 1.0).abs() < 5e-6);
        let middle = WorldDir::from_zenith_azimuth(40f64.to_radians(), 1.0).vec();
        let aside = middle.cross(DVec3::Z).normalize();
        let near = FROM_PEAKS * 2e-3;
        for side in [aside, -aside, middle.cross(aside)] {
            let sun = (middle * near.cos() + side * near.sin()).normalize();
            let (found, due) = both(&|d| d.angle_between(sun).powi(-2));
            assert!((found / due - 1.0).abs() < 1e-4, "{found} {due}");
            assert!(found != due);
        }
    }
}
