//! Paths without light: what is kept of a block of pixels so that any time can light it.

use std::ops::Range;

use glam::DVec3;
use rustc_hash::FxHashMap;
use sunglint_geometry::{FacetId, Hit};
use sunglint_radiometry::WorldDir;

use crate::Scenery;
use crate::light::Term;

/// One factor of a chain: a component of a material's split at a node of view angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Factor {
    pub material: u32,
    pub component: Component,
    pub node: u16,
}

/// Which of a material's spectra a factor is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Component {
    Diffuse,
    Specular,
    Printed,
    Emission,
}

impl Factor {
    pub fn spectrum<'a>(&self, scenery: &'a Scenery) -> &'a [f64] {
        let surface = scenery.surfaces[self.material as usize].as_ref().expect("factors name bound materials");
        let split = surface.bsdf.split();
        match self.component {
            Component::Diffuse => split.diffuse.spectrum(self.node as usize),
            Component::Specular => split.specular.spectrum(self.node as usize),
            Component::Printed => split.printed.spectrum(self.node as usize),
            Component::Emission => surface.emission.as_deref().expect("an emission factor names an emitter"),
        }
    }
}

/// A chain of reflectances: a multiset of factors, interned. Chain 0 is empty.
pub(crate) type ChainId = u32;

/// Where the light of a record comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Source {
    /// E_n cos θ_s I at a vertex; the record's weight holds the 1/π.
    Sun { vertex: u32 },
    /// The sun's image about a mirror direction at a vertex.
    Glint { vertex: u32, mirror: WorldDir, escaped: bool, solid_angle: f64, half_angle: f64, law: GlintLaw },
    /// L_d(ω).
    Sky(WorldDir),
    /// The sun's disk, looked into along a direction.
    Disk(WorldDir),
    /// L_dsky = E_d / π.
    MeanSky,
    /// ∫ L_d cos θ dω / π over what a facet with this normal sees of the sky when nothing but the horizon obstructs it.
    OpenSky(DVec3),
    /// The chain's own spectrum (emission).
    Own,
}

/// How the specular component sees the sun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GlintLaw {
    /// As printed in eq. 4.1: (E/π) cos θ_s R_s where the sun lies in the predefined solid angle.
    Printed,
    /// ρ_s E_n / Ω_s where the sun's centre lies in Ω_s.
    Lobe,
    /// ρ_s E_n Ω(lobe ∩ disk) / (Ω_s Ω_sun).
    Conserving,
}

/// A lit point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    pub hit: Hit,
    /// First surface of the path, so that the block's points on one facet may be proved lit together.
    pub first: bool,
    /// Point of the sun's disk, in disk radii; (0, 0) for a point sun.
    pub disk: [f64; 2],
}

/// A contribution: Σ over `chains` of weight × chain spectrum × source.
#[derive(Clone, Debug)]
pub(crate) struct Record {
    pub sample: u32,
    pub chains: Range<u32>,
    pub source: Source,
    pub weight: f64,
    pub term: Term,
}

/// A sample of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub replicate: u8,
    /// Index of the first vertex; `None` where the line of sight leaves the scene.
    pub vertex: Option<u32>,
    /// Length of the line of sight \[m\].
    pub range: f64,
    /// Fraction of the sky seen from the target's facet, as this sample estimates it.
    pub sky_view: f64,
    /// Which of the pixel's ranges of line of sight the sample belongs to; set once the pixel is traced.
    pub cluster: u8,
}

/// Rays that were cast and rays that were proved unnecessary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// From the sensor.
    pub camera: u64,
    /// Over a facet's hemisphere, for the sky it sees and its background.
    pub hemisphere: u64,
    /// Along mirror directions.
    pub mirror: u64,
    /// To the sun.
    pub sun: u64,
    /// To the sun, not cast: the facet is turned away or the sun is down.
    pub sun_turned_away: u64,
    /// To the sun, not cast: nothing stands between the block's points on the facet and the sun.
    pub sun_proved_clear: u64,
    /// Over a hemisphere, not cast: nothing rises above the facet's plane.
    pub hemisphere_open: u64,
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.camera += other.camera;
        self.hemisphere += other.hemisphere;
        self.mirror += other.mirror;
        self.sun += other.sun;
        self.sun_turned_away += other.sun_turned_away;
        self.sun_proved_clear += other.sun_proved_clear;
        self.hemisphere_open += other.hemisphere_open;
    }
}

/// The paths of a block of pixels.
#[derive(Default)]
pub struct Paths {
    pub(crate) samples: Vec<Sample>,
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) records: Vec<Record>,
    pub(crate) chain_list: Vec<(ChainId, f64)>,
    pub(crate) chains: Chains,
    pub(crate) rays: RayCounts,
}

impl Paths {
    pub(crate) fn clear(&mut self) {
        self.samples.clear();
        self.vertices.clear();
        self.records.clear();
        self.chain_list.clear();
        self.chains.clear();
    }

    pub(crate) fn vertex(&mut self, hit: Hit, first: bool, disk: [f64; 2]) -> u32 {
        self.vertices.push(Vertex { hit, first, disk });
        self.vertices.len() as u32 - 1
    }

    /// Appends `factors` (with weights) to every chain of `chains`; drops what has no weight.
    pub(crate) fn extend(&mut self, chains: Range<u32>, factors: &[(Factor, f64)]) -> Range<u32> {
        let start = self.chain_list.len() as u32;
        for i in chains {
            let (chain, weight) = self.chain_list[i as usize];
            for (factor, w) in factors.iter().filter(|(_, w)| *w != 0.0) {
                let next = self.chains.append(chain, *factor);
                self.chain_list.push((next, weight * w));
            }
        }
        start..self.chain_list.len() as u32
    }

    /// The empty chain, weight 1.
    pub(crate) fn root(&mut self) -> Range<u32> {
        self.chain_list.push((0, 1.0));
        self.chain_list.len() as u32 - 1..self.chain_list.len() as u32
    }

    pub(crate) fn record(&mut self, sample: u32, chains: Range<u32>, source: Source, weight: f64, term: Term) {
        if weight != 0.0 && !chains.is_empty() {
            self.records.push(Record { sample, chains, source, weight, term });
        }
    }
}

/// Interned chains: equal multisets of factors are one chain, whatever their order.
#[derive(Default)]
pub(crate) struct Chains {
    factors: Vec<Vec<Factor>>,
    known: FxHashMap<Vec<Factor>, ChainId>,
    next: FxHashMap<(ChainId, Factor), ChainId>,
}

impl Chains {
    pub fn clear(&mut self) {
        self.factors.clear();
        self.known.clear();
        self.next.clear();
    }

    pub fn len(&self) -> usize {
        self.factors.len().max(1)
    }

    pub fn factors(&self, chain: ChainId) -> &[Factor] {
        self.factors.get(chain as usize).map_or(&[], Vec::as_slice)
    }

    pub fn append(&mut self, chain: ChainId, factor: Factor) -> ChainId {
        if self.factors.is_empty() {
            self.factors.push(Vec::new());
        }
        if let Some(next) = self.next.get(&(chain, factor)) {
            return *next;
        }
        let mut factors = self.factors[chain as usize].clone();
        let place = factors.partition_point(|f| *f <= factor);
        factors.insert(place, factor);
        let fresh = self.factors.len() as ChainId;
        let id = *self.known.entry(factors.clone()).or_insert(fresh);
        if id == fresh {
            self.factors.push(factors);
        }
        self.next.insert((chain, factor), id);
        id
    }
}

/// Points of a block that lie on one side of one facet.
pub(crate) struct FacetGroup {
    pub lo: DVec3,
    pub hi: DVec3,
    pub anchor: DVec3,
    pub normal: DVec3,
    pub members: Vec<u32>,
}

impl Paths {
    /// Vertices by facet and side, first surfaces of a path apart from later ones, in order of first appearance.
    pub(crate) fn facet_groups(&self) -> Vec<FacetGroup> {
        let mut index: FxHashMap<(FacetId, bool, bool), usize> = FxHashMap::default();
        let mut groups: Vec<FacetGroup> = Vec::new();
        for (i, vertex) in self.vertices.iter().enumerate() {
            let hit = &vertex.hit;
            let at = *index.entry((hit.facet, hit.front, vertex.first)).or_insert_with(|| {
                groups.push(FacetGroup {
                    lo: hit.point,
                    hi: hit.point,
                    anchor: hit.point,
                    normal: hit.normal,
                    members: Vec::new(),
                });
                groups.len() - 1
            });
            let group = &mut groups[at];
            group.lo = group.lo.min(hit.point);
            group.hi = group.hi.max(hit.point);
            group.members.push(i as u32);
        }
        groups
    }
}
