//! Paths without light: what is kept of a block of pixels so that any time can light it.

use std::ops::Range;
use std::rc::Rc;

use glam::DVec3;
use rustc_hash::FxHashMap;
use sunglint_geometry::{FacetId, Hit, Ray, SoleFacet, World};
use sunglint_radiometry::{LocalDir, WorldDir};

use crate::hemisphere::Horizons;
use crate::irradiance_cache::{IrradianceCache, Taken};
use crate::pixel::Term;
use crate::render::Proofs;
use crate::sampler::{Pair, concentric_disk};

/// Index of a spectrum of [`Paths`]: a product of reflectances at the nodes. 0 is 1 throughout.
pub(crate) type SpectrumId = u32;
/// The spectrum 1.
pub(crate) const ONE: SpectrumId = 0;

/// Where the light of a record comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Source {
    /// E_n cos θ_s I at a vertex; the record's weight holds the 1/π.
    Sun { vertex: u32 },
    /// E_n cos θ_s I f at a vertex, f being what a surface's lobes scatter beside its Lambertian part.
    Scatter { vertex: u32, outgoing: LocalDir },
    /// The sun in one or two planar mirrors, scattered at a vertex by all that is not itself a mirror.
    Caustic { vertex: u32, outgoing: LocalDir, bounces: u8 },
    /// The sun's image about a mirror direction at a vertex.
    Glint { vertex: u32, mirror: WorldDir, escaped: bool, solid_angle: f64, half_angle: f64, law: GlintLaw },
    /// L_d(ω). Where `seen` names a vertex and whether ω is free there, only what [`OpenSky`](Self::OpenSky) with that vertex
    /// leaves: V − α of it.
    Sky { direction: WorldDir, seen: Option<(u32, bool)> },
    /// L_d(ω) where something hides the sun from a vertex, ω in the free part of a horizon at a place of the unit square.
    FreeSky { vertex: u32, horizon: u32, place: [f64; 2] },
    /// The sun's disk, looked into along a direction; `density` \[sr⁻¹\] is that of the draw that led there, infinite where
    /// none but this ray can find the disk.
    Disk { direction: WorldDir, density: f64 },
    /// L_dsky = E_d / π.
    MeanSky,
    /// ∫ L_d cos θ dω / π over what a facet with this normal sees of the sky when nothing but the horizon obstructs it; times α
    /// where a vertex is named: 0 where something hides the sun from it, else 1.
    OpenSky { normal: DVec3, unless: Option<u32> },
    /// The spectrum's own light (emission).
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
    /// Chooses the point of the sun's disk.
    disk: Pair,
}

impl Vertex {
    /// Point of the sun's disk, in disk radii.
    pub fn disk(&self) -> [f64; 2] {
        concentric_disk(self.disk.draw())
    }
}

/// A contribution: weight × spectrum × source.
#[derive(Clone, Debug)]
pub(crate) struct Record {
    pub sample: u32,
    pub spectrum: SpectrumId,
    pub source: Source,
    pub weight: f64,
    pub term: Term,
    /// Whether rays over a first surface found it; see [`Draw`](crate::Draw).
    pub looked: bool,
}

impl Record {
    /// Whether both look at the sky with the same spectrum, as parts of one sample.
    pub fn looks_with(&self, other: &Self) -> bool {
        let looks = |record: &Self| matches!(record.source, Source::Sky { .. } | Source::FreeSky { .. });
        (self.sample, self.spectrum, self.term) == (other.sample, other.spectrum, other.term)
            && looks(self)
            && looks(other)
    }
}

/// A sample of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub replicate: u8,
    /// Index of the first vertex; `None` where the line of sight leaves the scene.
    pub vertex: Option<u32>,
    /// Length of the line of sight \[m\].
    pub range: f64,
    /// Fraction of the sky seen from the target's facet, as this sample estimates it; NaN where others look for it.
    pub sky_view: f64,
    /// Share of that for which rays looked: below 0 where one met something, 0 where none was cast.
    pub sky_ray: f64,
    /// Which of the pixel's ranges of line of sight the sample belongs to; set once the pixel is traced.
    pub cluster: u8,
    /// For how many of its replicate's samples it stands, and for how many of those that are traced it looks.
    pub weight: f64,
    pub looks: f64,
}

/// Rays that were cast and rays that were proved unnecessary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// From the sensor.
    pub camera: u64,
    /// From the sensor, not cast: nothing stands before the one facet that the block's lines of sight meet.
    pub camera_proved: u64,
    /// Over a facet's hemisphere, for the sky it sees and its background.
    pub hemisphere: u64,
    /// Along mirror directions.
    pub mirror: u64,
    /// To the sun.
    pub sun: u64,
    /// To the sun's images in planar mirrors, on to the next mirror, and from the last to the sun.
    pub caustic: u64,
    /// To the sun, not cast: the facet is turned away or the sun is down.
    pub sun_turned_away: u64,
    /// To the sun, not cast: nothing stands between the block's points on the facet and the sun.
    pub sun_proved_clear: u64,
    /// To the sun, not cast: one facet hides all of it from the block's or the pixel's points on the facet.
    pub sun_proved_shaded: u64,
    /// Over a hemisphere, not cast: nothing rises above the facet's plane.
    pub hemisphere_open: u64,
}

impl RayCounts {
    /// All rays that were cast.
    pub const fn cast(&self) -> u64 {
        self.camera + self.hemisphere + self.mirror + self.sun + self.caustic
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.camera += other.camera;
        self.camera_proved += other.camera_proved;
        self.hemisphere += other.hemisphere;
        self.mirror += other.mirror;
        self.sun += other.sun;
        self.caustic += other.caustic;
        self.sun_turned_away += other.sun_turned_away;
        self.sun_proved_clear += other.sun_proved_clear;
        self.sun_proved_shaded += other.sun_proved_shaded;
        self.hemisphere_open += other.hemisphere_open;
    }
}

impl Sample {
    /// One whose line of sight meets a vertex after a range, or leaves the scene.
    pub fn new(replicate: u8, vertex: Option<u32>, range: f64, sky_view: f64) -> Self {
        Self { replicate, vertex, range, sky_view, sky_ray: 0.0, cluster: 0, weight: 1.0, looks: 1.0 }
    }
}

/// The paths of a block of pixels.
pub struct Paths {
    pub(crate) samples: Vec<Sample>,
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) records: Vec<Record>,
    pub(crate) rays: RayCounts,
    /// Whether what is recorded now was found by rays over a first surface.
    pub(crate) looked: bool,
    /// For how many samples the one that is traced stands.
    pub(crate) weight: f64,
    /// What samples take of points of the cache, in the order of the samples.
    pub(crate) taken: Vec<Taken>,
    pub(crate) cache: Option<Box<IrradianceCache>>,
    /// Room for steps of a path that wait, and for two spectra.
    pub(crate) room: Room,
    /// The facet that the lines of sight of the block or pixel that is traced meet, where it is one.
    pub(crate) sole: Option<Rc<SoleFacet>>,
    /// Whether the block sees few facets, as far as rays spread over it tell.
    pub(crate) sees_few: bool,
    pub(crate) horizons: Horizons,
    /// Spectra at the nodes, one after another.
    spectra: Vec<f64>,
    n_nodes: usize,
}

/// Room that a path takes while it is traced.
#[derive(Default)]
pub(crate) struct Room {
    pub waiting: Vec<crate::full::Step>,
    pub rho: Vec<f64>,
    pub f: Vec<f64>,
}

impl Paths {
    pub(crate) fn new(n_nodes: usize) -> Self {
        Self {
            samples: Vec::new(),
            vertices: Vec::new(),
            records: Vec::new(),
            rays: RayCounts::default(),
            looked: false,
            weight: 1.0,
            taken: Vec::new(),
            cache: None,
            room: Room { waiting: Vec::new(), rho: vec![0.0; n_nodes], f: vec![0.0; n_nodes] },
            sole: None,
            sees_few: false,
            horizons: Horizons::default(),
            spectra: vec![1.0; n_nodes],
            n_nodes,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.samples.clear();
        self.vertices.clear();
        self.records.clear();
        self.taken.clear();
        self.spectra.truncate(self.n_nodes);
    }

    /// Bytes that the paths take.
    pub(crate) fn size(&self) -> usize {
        size_of_val(&self.spectra[..])
            + size_of_val(&self.records[..])
            + size_of_val(&self.vertices[..])
            + size_of_val(&self.samples[..])
            + size_of_val(&self.taken[..])
    }

    /// What a line of sight meets.
    pub(crate) fn seen(&mut self, world: &World, sight: &Ray) -> Option<Hit> {
        if let Some(hit) = self.sole.as_ref().and_then(|sole| sole.meet(sight)) {
            self.rays.camera_proved += 1;
            return Some(hit);
        }
        self.rays.camera += 1;
        world.closest(sight)
    }

    pub(crate) fn vertex(&mut self, hit: Hit, first: bool, disk: Pair) -> u32 {
        self.vertices.push(Vertex { hit, first, disk });
        self.vertices.len() as u32 - 1
    }

    /// A spectrum at the nodes.
    pub(crate) fn spectrum(&self, id: SpectrumId) -> &[f64] {
        &self.spectra[id as usize * self.n_nodes..][..self.n_nodes]
    }

    /// Its largest value.
    pub(crate) fn peak(&self, id: SpectrumId) -> f64 {
        self.spectrum(id).iter().fold(0.0, |peak: f64, value| peak.max(value.abs()))
    }

    /// The same product with the spectrum's largest value 1, where it has become so small that the product's two parts would
    /// leave the range of numbers: between white lobes a path of a thousand surfaces divides by as many shares.
    pub(crate) fn balanced(&mut self, id: SpectrumId, weight: f64) -> (SpectrumId, f64) {
        let peak = self.peak(id);
        if peak > 1e-100 || peak == 0.0 { (id, weight) } else { (self.times(id, |_| 1.0 / peak), weight * peak) }
    }

    /// A spectrum times a factor at each node.
    pub(crate) fn times(&mut self, id: SpectrumId, factor: impl Fn(usize) -> f64) -> SpectrumId {
        let (from, n) = (id as usize * self.n_nodes, self.n_nodes);
        let fresh = self.spectra.len();
        self.spectra.resize(fresh + n, 0.0);
        let (known, new) = self.spectra.split_at_mut(fresh);
        new.iter_mut().zip(&known[from..from + n]).enumerate().for_each(|(q, (new, value))| *new = value * factor(q));
        (fresh / n.max(1)) as SpectrumId
    }

    /// What is seen where a line of sight leaves the scene: the sky, and the sun itself.
    pub(crate) fn look_out(&mut self, sample: u32, direction: WorldDir) {
        self.record(sample, ONE, Source::Sky { direction, seen: None }, 1.0, Term::SkyDirect);
        self.record(sample, ONE, Source::Disk { direction, density: f64::INFINITY }, 1.0, Term::SkyDirect);
    }

    pub(crate) fn record(&mut self, sample: u32, spectrum: SpectrumId, source: Source, weight: f64, term: Term) {
        if weight != 0.0 {
            let weight = weight * self.weight;
            self.records.push(Record { sample, spectrum, source, weight, term, looked: self.looked });
        }
    }
}

/// Points of a block that lie on one side of one facet.
pub(crate) struct FacetGroup {
    pub lo: DVec3,
    pub hi: DVec3,
    pub anchor: DVec3,
    pub normal: DVec3,
    /// Its first vertex, and how many it has.
    pub first: u32,
    pub count: u32,
}

impl Paths {
    /// Vertices by facet and side, first surfaces of a path apart from later ones, in order of first appearance; and the group
    /// of each vertex.
    pub(crate) fn facet_groups(&self, pixels: &[Range<usize>], proofs: Proofs) -> (Vec<FacetGroup>, Vec<u32>) {
        let mut index: FxHashMap<(FacetId, bool, bool, usize), usize> = FxHashMap::default();
        let mut groups: Vec<FacetGroup> = Vec::new();
        let mut of_vertices = Vec::with_capacity(self.vertices.len());
        // Most follow one of their own kind.
        let mut last = None;
        let of_pixels = pixels.iter().enumerate().flat_map(|(pixel, own)| own.clone().map(move |i| (pixel, i)));
        for (pixel, i) in of_pixels {
            let vertex = &self.vertices[i];
            let hit = &vertex.hit;
            let key = (hit.facet, hit.front, vertex.first, if proofs == Proofs::Together { 0 } else { pixel });
            let known = last.filter(|(last, _)| *last == key).map(|(_, at)| at);
            let at = known.unwrap_or_else(|| {
                *index.entry(key).or_insert_with(|| {
                    groups.push(FacetGroup {
                        lo: hit.point,
                        hi: hit.point,
                        anchor: hit.point,
                        normal: hit.normal,
                        first: i as u32,
                        count: 0,
                    });
                    groups.len() - 1
                })
            });
            last = Some((key, at));
            let group = &mut groups[at];
            group.lo = group.lo.min(hit.point);
            group.hi = group.hi.max(hit.point);
            group.count += 1;
            of_vertices.push(at as u32);
        }
        (groups, of_vertices)
    }
}
