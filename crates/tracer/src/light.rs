//! Lights the paths of a block for one time.

use std::f64::consts::PI;
use std::ops::Range;

use glam::DVec3;
use rustc_hash::FxHashMap;
use sunglint_atmosphere::Path;
use sunglint_radiometry::{Channels, Frame, LocalDir, REPLICATES, WorldDir};

use crate::paths::{ChainId, FacetGroup, GlintLaw, Paths, RayCounts, Record, Source, Vertex};
use crate::sightline::Shares;
use crate::{Illumination, Lighting, Scenery};

/// Where a part of a pixel's radiance comes from, as `explain` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Term {
    /// Sun, diffusely reflected by the target.
    DiffuseSun,
    /// Sky, diffusely reflected by the target.
    DiffuseSky,
    /// Surfaces around, diffusely reflected by the target.
    DiffuseBackground,
    /// Sun in the target's specular lobe.
    SpecularSun,
    /// Sky in the mirror direction.
    SpecularSky,
    /// A surface in the mirror direction.
    SpecularBackground,
    /// Emitted by the target.
    Emission,
    /// Sky or sun looked at directly.
    SkyDirect,
}

impl Term {
    /// All terms, in order of output.
    pub const ALL: [Term; 8] = [
        Term::DiffuseSun,
        Term::DiffuseSky,
        Term::DiffuseBackground,
        Term::SpecularSun,
        Term::SpecularSky,
        Term::SpecularBackground,
        Term::Emission,
        Term::SkyDirect,
    ];

    /// Name in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DiffuseSun => "diffuse_sun",
            Self::DiffuseSky => "diffuse_sky",
            Self::DiffuseBackground => "diffuse_background",
            Self::SpecularSun => "specular_sun",
            Self::SpecularSky => "specular_sky",
            Self::SpecularBackground => "specular_background",
            Self::Emission => "emission",
            Self::SkyDirect => "sky_direct",
        }
    }
}

/// How the sun stands to the vertices of a block at one time.
pub(crate) struct SunLight {
    /// I: 1 where the sun is seen, else 0. Of a disk one point is drawn per vertex.
    pub visible: Vec<f64>,
    /// cos θ_s, 0 where the surface is turned away.
    pub cos: Vec<f64>,
}

/// Casts the sun rays of a block, save those that are proved unnecessary.
pub(crate) fn sun_light(
    scenery: &Scenery,
    paths: &Paths,
    groups: &[FacetGroup],
    time: &Illumination,
    disk: bool,
) -> (SunLight, RayCounts) {
    let n = paths.vertices.len();
    let (mut visible, mut cos) = (vec![0.0; n], vec![0.0; n]);
    let mut rays = RayCounts::default();
    let Some(sun) = time.sun else {
        rays.sun_turned_away += n as u64;
        return (SunLight { visible, cos }, rays);
    };
    let frame = Frame::about(sun.vec());
    let towards = |vertex: &Vertex| {
        if !disk {
            return sun;
        }
        let r = time.sun_radius.sin();
        let [x, y] = vertex.disk.map(|c| c * r);
        frame.to_world(LocalDir::from_unit(DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())))
    };
    let mut proved = vec![false; n];
    for group in groups {
        let spread = if disk { time.sun_radius } else { 0.0 };
        let lit_side = group.normal.dot(sun.vec()) > spread.sin();
        if lit_side
            && group.members.len() > 2
            && scenery.world.shaft_is_clear(group.lo, group.hi, group.anchor, group.normal, sun, spread)
        {
            group.members.iter().for_each(|i| proved[*i as usize] = true);
        }
    }
    for (i, vertex) in paths.vertices.iter().enumerate() {
        let direction = towards(vertex);
        let mu = vertex.hit.normal.dot(direction.vec());
        if mu <= 0.0 || direction.cos_zenith() <= 0.0 {
            rays.sun_turned_away += 1;
            continue;
        }
        cos[i] = mu;
        if proved[i] {
            rays.sun_proved_clear += 1;
            visible[i] = 1.0;
        } else {
            rays.sun += 1;
            visible[i] = f64::from(u8::from(!scenery.world.occluded(&vertex.hit.leave(direction))));
        }
    }
    (SunLight { visible, cos }, rays)
}

/// Solid angle common to two cones about directions `apart` radians from each other, half-angles `a` and `b` \[sr\]. The
/// caps' overlap as circles of radius 2 sin(a/2) on the tangent plane (Lambert's equal-area chart), exact when one
/// holds the other and within (a + b)²/8 of it else.
fn cone_overlap(a: f64, b: f64, apart: f64) -> f64 {
    let (a, b, d) = (2.0 * (0.5 * a).sin(), 2.0 * (0.5 * b).sin(), 2.0 * (0.5 * apart).sin());
    if d >= a + b {
        return 0.0;
    }
    let small = a.min(b);
    if d <= (a - b).abs() {
        return PI * small * small;
    }
    let angle = |r: f64, s: f64| ((d * d + r * r - s * s) / (2.0 * d * r)).clamp(-1.0, 1.0).acos();
    let kite = ((-d + a + b) * (d + a - b) * (d - a + b) * (d + a + b)).max(0.0).sqrt();
    a * a * angle(a, b) + b * b * angle(b, a) - 0.5 * kite
}

/// Half-angle of a cone of solid angle Ω = 2π (1 − cos a) \[rad\].
pub(crate) fn half_angle(solid_angle: f64) -> f64 {
    2.0 * (solid_angle / (4.0 * PI)).clamp(0.0, 1.0).sqrt().asin()
}

/// What a specular component of reflectance 1 returns of E_n about a mirror direction: radiance per irradiance \[sr⁻¹\].
#[allow(clippy::too_many_arguments)]
fn glint(
    time: &Illumination,
    sun: WorldDir,
    mirror: WorldDir,
    escaped: bool,
    solid_angle: f64,
    half_angle: f64,
    law: GlintLaw,
    visible: f64,
    cos: f64,
) -> f64 {
    let omega_sun = time.sun_solid_angle();
    // Far from the lobe nothing is seen, and most mirror directions are far from the sun.
    let reach = half_angle + time.sun_radius;
    if reach < 1.0 && mirror.dot(sun) < 1.0 - 0.5 * reach * reach {
        return 0.0;
    }
    let apart = mirror.angle_to(sun);
    // A lobe no wider than the disk is a mirror: the ray itself finds the disk.
    let is_mirror = solid_angle <= omega_sun * (1.0 + 1e-9);
    let in_disk = apart <= time.sun_radius && escaped;
    match law {
        GlintLaw::Printed => {
            let inside = if is_mirror { in_disk } else { apart <= half_angle && visible > 0.0 };
            if inside { cos / PI } else { 0.0 }
        }
        GlintLaw::Lobe | GlintLaw::Conserving if is_mirror => {
            if in_disk {
                1.0 / omega_sun
            } else {
                0.0
            }
        }
        GlintLaw::Lobe => {
            if apart <= half_angle {
                visible / solid_angle
            } else {
                0.0
            }
        }
        GlintLaw::Conserving => visible * cone_overlap(half_angle, time.sun_radius, apart) / (solid_angle * omega_sun),
    }
}

/// A spectrum of light that chains multiply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Light {
    Own,
    Beam,
    MeanSky,
    SkyTerm(u32),
}

impl Light {
    fn index(self) -> usize {
        match self {
            Self::Own => 0,
            Self::Beam => 1,
            Self::MeanSky => 2,
            Self::SkyTerm(k) => 3 + k as usize,
        }
    }
}

/// No node of a line of sight: the light as it leaves the surface, or the sky itself.
const NO_PATH: u32 = u32::MAX;

/// Weights of one (cluster, term, chain, light) in each replicate.
#[derive(Clone, Debug)]
struct Weighted {
    chain: ChainId,
    light: Light,
    cluster: u8,
    term: Term,
    replicates: [f64; REPLICATES],
}

/// Weights of a pixel, found by what they weigh.
#[derive(Clone, Debug, Default)]
struct Weights {
    list: Vec<Weighted>,
    found: FxHashMap<u64, u32>,
}

impl Weights {
    fn clear(&mut self) {
        self.list.clear();
        self.found.clear();
    }

    fn add(&mut self, cluster: u8, replicate: u8, chain: ChainId, light: Light, term: Term, weight: f64) {
        if weight == 0.0 {
            return;
        }
        let key = (u64::from(chain) << 32) | ((light.index() as u64) << 16) | (u64::from(cluster) << 8) | term as u64;
        let fresh = self.list.len() as u32;
        let slot = *self.found.entry(key).or_insert(fresh);
        if slot == fresh {
            self.list.push(Weighted { chain, light, cluster, term, replicates: [0.0; REPLICATES] });
        }
        self.list[slot as usize].replicates[replicate as usize] += weight;
    }
}

/// What of a pixel's paths does not change with time: records whose weights hold for all times, gathered once, and the
/// others.
pub(crate) struct PixelLight {
    steady: Weights,
    /// Indices of the records that each time lights anew.
    changing: Vec<u32>,
}

impl PixelLight {
    /// Sorts the records of one pixel. With `by_term` the parts of the radiance are kept apart.
    pub fn new(paths: &Paths, records: Range<usize>, by_term: bool) -> Self {
        let mut steady = Weights::default();
        let mut changing = Vec::new();
        for (i, record) in records.clone().zip(&paths.records[records]) {
            let light = match record.source {
                Source::Own => Light::Own,
                Source::MeanSky => Light::MeanSky,
                _ => {
                    changing.push(i as u32);
                    continue;
                }
            };
            let sample = &paths.samples[record.sample as usize];
            for (chain, share) in chains(paths, record) {
                let term = term_of(record, by_term);
                steady.add(sample.cluster, sample.replicate, chain, light, term, record.weight * share);
            }
        }
        Self { steady, changing }
    }
}

fn chains<'a>(paths: &'a Paths, record: &Record) -> impl Iterator<Item = (ChainId, f64)> + use<'a> {
    paths.chain_list[record.chains.start as usize..record.chains.end as usize].iter().copied()
}

fn term_of(record: &Record, by_term: bool) -> Term {
    if by_term { record.term } else { Term::DiffuseSun }
}

/// One pixel's radiance at one time.
pub(crate) struct PixelRadiance {
    /// Per channel and replicate \[W m⁻² sr⁻¹ µm⁻¹\], channel-major.
    pub radiance: Vec<[f64; REPLICATES]>,
    /// The same before τ₂ and L_u; empty where not asked for.
    pub surface: Vec<[f64; REPLICATES]>,
    /// Mean per term and channel at the sensor; empty where not asked for.
    pub terms: Vec<(Term, Vec<f64>)>,
    /// L_u per channel.
    pub upwelled: Vec<f64>,
}

/// What a block of pixels is lit with, whatever the time.
pub(crate) struct Block<'a> {
    pub scenery: &'a Scenery,
    pub paths: &'a Paths,
    pub channels: &'a Channels,
    pub lighting: Lighting,
    /// Vertices by facet.
    pub groups: Vec<FacetGroup>,
    /// Where τ₂ and L_u are solved.
    pub nodes: &'a [Path],
}

/// Lights a block for one time; spectra of chains are made once and shared by its pixels.
pub(crate) struct BlockLight<'a> {
    block: &'a Block<'a>,
    time: &'a Illumination,
    sun: SunLight,
    /// τ₂ of each node of the block's lines of sight, per grid entry.
    tau_2: Vec<Vec<f64>>,
    /// L_u of each node, per channel.
    upwelled: Vec<Vec<f64>>,
    /// Number of lights: [`Light::index`] stays below it.
    n_lights: usize,
    /// Light × τ₂ at a node (the last is without τ₂), summed over g, and the factors of chains: each made when first met.
    /// No factor depends on g.
    lights: Vec<Option<Vec<f64>>>,
    chains: Vec<Option<Vec<f64>>>,
    /// Channel values of chain × light × τ₂ at a node (the last is without τ₂), made when first met: places in `pool`,
    /// 0 where not yet made.
    places: Vec<u32>,
    pool: Vec<f64>,
    sky_weights: Vec<(u32, f64)>,
    weights: Weights,
}

impl<'a> BlockLight<'a> {
    pub fn new(block: &'a Block<'a>, time: &'a Illumination) -> (Self, RayCounts) {
        let Block { scenery, paths, channels, lighting, groups, nodes } = block;
        let (sun, rays) = sun_light(scenery, paths, groups, time, lighting.sun_disk);
        let n = time.beam.len();
        let mut l_u = vec![0.0; n];
        let (mut tau_2, mut upwelled) = (Vec::new(), Vec::new());
        for path in *nodes {
            let mut transmittance = vec![0.0; n];
            time.sky.path(path, &mut transmittance, &mut l_u);
            let mut folded = vec![0.0; channels.len()];
            channels.fold(&l_u, &mut folded);
            tau_2.push(transmittance);
            upwelled.push(folded);
        }
        let n_lights = 3 + time.sky.sky_terms().len();
        let n_products = paths.chains.len() * n_lights;
        let light = Self {
            block,
            time,
            sun,
            places: vec![0; n_products * (tau_2.len() + 1)],
            pool: vec![0.0; channels.len()],
            lights: vec![None; n_lights * (tau_2.len() + 1)],
            tau_2,
            upwelled,
            n_lights,
            chains: vec![None; paths.chains.len()],
            sky_weights: Vec::new(),
            weights: Weights::default(),
        };
        (light, rays)
    }

    /// I_t over the first vertices among samples: the sun-lit fraction.
    pub fn lit_fraction(&self, samples: Range<usize>) -> f64 {
        let n = samples.len() as f64;
        let lit = |sample: &crate::paths::Sample| sample.vertex.map_or(0.0, |v| self.sun.visible[v as usize]);
        self.block.paths.samples[samples].iter().map(lit).sum::<f64>() / n
    }

    /// Gathers the records of one pixel that change with time into weights of (chain, light).
    fn gather(&mut self, records: &[u32], by_term: bool) {
        self.weights.clear();
        let (paths, time) = (self.block.paths, self.time);
        for record in records.iter().map(|i| &paths.records[*i as usize]) {
            let sample = &paths.samples[record.sample as usize];
            self.sky_weights.clear();
            let (light, value) = match record.source {
                // Gathered once for all times.
                Source::Own | Source::MeanSky => continue,
                Source::Sun { vertex } => {
                    let i = vertex as usize;
                    (Light::Beam, self.sun.visible[i] * self.sun.cos[i])
                }
                Source::Glint { vertex, mirror, escaped, solid_angle, half_angle, law } => {
                    let Some(sun) = time.sun else { continue };
                    let i = vertex as usize;
                    let (visible, cos) = (self.sun.visible[i], self.sun.cos[i]);
                    (Light::Beam, glint(time, sun, mirror, escaped, solid_angle, half_angle, law, visible, cos))
                }
                Source::Disk(direction) => {
                    let seen = time.sun.is_some_and(|sun| direction.angle_to(sun) <= time.sun_radius);
                    (Light::Beam, if seen { 1.0 / time.sun_solid_angle() } else { 0.0 })
                }
                Source::Sky(direction) => {
                    time.sky.sky_weights(direction, &mut self.sky_weights);
                    (Light::Beam, 0.0)
                }
                Source::OpenSky(normal) => {
                    time.open_sky(normal, |k, w| self.sky_weights.push((k, w)));
                    (Light::Beam, 0.0)
                }
            };
            let term = term_of(record, by_term);
            for (chain, share) in chains(paths, record) {
                let weight = share * record.weight;
                self.weights.add(sample.cluster, sample.replicate, chain, light, term, weight * value);
                for (k, shape) in &self.sky_weights {
                    let light = Light::SkyTerm(*k);
                    self.weights.add(sample.cluster, sample.replicate, chain, light, term, weight * shape);
                }
            }
        }
    }

    fn spectrum_of(&self, light: Light) -> Option<&'a [f64]> {
        match light {
            Light::Own => None,
            Light::Beam => Some(&self.time.beam),
            Light::MeanSky => Some(&self.time.mean_sky),
            Light::SkyTerm(k) => Some(&self.time.sky.sky_terms()[k as usize]),
        }
    }

    /// Channel values of chain × light × τ₂ at a node (without τ₂ at `NO_PATH`): products per grid entry, averaged once,
    /// last; or by band means where the scene asks so.
    fn channel_values(&mut self, chain: ChainId, light: Light, node: u32) -> &[f64] {
        let n = self.block.channels.len();
        let node = (node as usize).min(self.tau_2.len());
        let product = chain as usize * self.n_lights + light.index();
        let place = product * (self.tau_2.len() + 1) + node;
        if self.places[place] == 0 {
            let values = if self.block.lighting.band_means {
                self.values_of_means(chain, light, node)
            } else {
                self.values_of_products(chain, light, node)
            };
            self.places[place] = (self.pool.len() / n) as u32;
            self.pool.extend(values);
        }
        let at = self.places[place] as usize * n;
        &self.pool[at..at + n]
    }

    fn values_of_products(&mut self, chain: ChainId, light: Light, node: usize) -> Vec<f64> {
        let Block { scenery, paths, channels, .. } = self.block;
        let source = self.spectrum_of(light);
        let chain = self.chains[chain as usize].get_or_insert_with(|| {
            let mut product = vec![1.0; self.time.beam.len()];
            for factor in paths.chains.factors(chain) {
                product.iter_mut().zip(factor.spectrum(scenery)).for_each(|(p, f)| *p *= f);
            }
            channels.at_wavelengths(&product)
        });
        let light = self.lights[light.index() * (self.tau_2.len() + 1) + node].get_or_insert_with(|| {
            let tau_2 = self.tau_2.get(node).map(Vec::as_slice);
            match source {
                Some(source) => channels.summed(source, tau_2),
                None => channels.summed(&vec![1.0; self.time.beam.len()], tau_2),
            }
        });
        let mut out = vec![0.0; channels.len()];
        channels.fold_summed(light, chain, &mut out);
        out
    }

    fn values_of_means(&self, chain: ChainId, light: Light, node: usize) -> Vec<f64> {
        let Block { scenery, paths, channels, .. } = self.block;
        let mut out = vec![1.0; channels.len()];
        let mut means = out.clone();
        let mut multiply = |spectrum: &[f64]| {
            channels.fold(spectrum, &mut means);
            out.iter_mut().zip(&means).for_each(|(out, mean)| *out *= mean);
        };
        paths.chains.factors(chain).iter().for_each(|factor| multiply(factor.spectrum(scenery)));
        match light {
            Light::Own => {}
            Light::Beam => {
                multiply(self.time.sky.solar_irradiance());
                multiply(self.time.sky.sun_transmittance());
            }
            Light::MeanSky | Light::SkyTerm(_) => self.spectrum_of(light).into_iter().for_each(&mut multiply),
        }
        self.tau_2.get(node).into_iter().for_each(|tau_2| multiply(tau_2));
        out
    }

    /// One pixel: its records, its samples, and what each of its clusters takes of the block's lines of sight.
    pub fn pixel(
        &mut self,
        light: &PixelLight,
        samples: Range<usize>,
        sights: &[Shares],
        surface: bool,
        by_term: bool,
    ) -> PixelRadiance {
        let n = self.block.channels.len();
        let n_samples = samples.len() as f64;
        self.gather(&light.changing, by_term);
        let mut radiance = vec![[0.0; REPLICATES]; n];
        let mut leaving = if surface { radiance.clone() } else { Vec::new() };
        let mut terms: Vec<(Term, Vec<f64>)> = Vec::new();
        let mut values = vec![0.0; n];
        let per_replicate = REPLICATES as f64 / n_samples;
        let spread = |values: &[f64], replicates: &[f64; REPLICATES], out: &mut [[f64; REPLICATES]]| {
            for (sums, value) in out.iter_mut().zip(values) {
                let value = value * per_replicate;
                sums.iter_mut().zip(replicates).for_each(|(sum, w)| *sum += w * value);
            }
        };
        let changing = std::mem::take(&mut self.weights);
        for entry in light.steady.list.iter().chain(&changing.list) {
            match &sights[entry.cluster as usize] {
                None => values.copy_from_slice(self.channel_values(entry.chain, entry.light, NO_PATH)),
                Some(shares) => {
                    values.fill(0.0);
                    for (node, share) in shares.iter().filter(|(_, share)| *share != 0.0) {
                        let at_node = self.channel_values(entry.chain, entry.light, *node);
                        values.iter_mut().zip(at_node).for_each(|(value, v)| *value += share * v);
                    }
                }
            }
            spread(&values, &entry.replicates, &mut radiance);
            if by_term {
                let mean = entry.replicates.iter().sum::<f64>() / n_samples;
                let at = terms.iter().position(|(term, _)| *term == entry.term).unwrap_or_else(|| {
                    terms.push((entry.term, vec![0.0; n]));
                    terms.len() - 1
                });
                terms[at].1.iter_mut().zip(&values).for_each(|(sum, value)| *sum += mean * value);
            }
            if surface {
                spread(self.channel_values(entry.chain, entry.light, NO_PATH), &entry.replicates, &mut leaving);
            }
        }
        self.weights = changing;
        let mut upwelled = vec![0.0; n];
        for (q, shares) in sights.iter().enumerate() {
            let Some(shares) = shares else { continue };
            values.fill(0.0);
            for (node, share) in shares {
                let at_node = &self.upwelled[*node as usize];
                values.iter_mut().zip(at_node).for_each(|(value, l_u)| *value += share * l_u);
            }
            let mut counts = [0.0; REPLICATES];
            let samples = &self.block.paths.samples[samples.clone()];
            for sample in samples.iter().filter(|sample| usize::from(sample.cluster) == q) {
                counts[sample.replicate as usize] += 1.0;
            }
            spread(&values, &counts, &mut radiance);
            let share = counts.iter().sum::<f64>() / n_samples;
            upwelled.iter_mut().zip(&values).for_each(|(sum, value)| *sum += share * value);
        }
        PixelRadiance { radiance, surface: leaving, terms, upwelled }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cones_that_do_not_meet_share_nothing_and_equal_cones_share_themselves() {
        let whole = |a: f64| 2.0 * PI * (1.0 - a.cos());
        assert_eq!(cone_overlap(0.1, 0.2, 0.31), 0.0);
        assert!((cone_overlap(0.1, 0.3, 0.05) / whole(0.1) - 1.0).abs() < 1e-12);
        assert!((half_angle(whole(0.3)) - 0.3).abs() < 1e-12);
    }

    /// Two equal small circles whose centres are one radius apart share 2π/3 − √3/2 of r².
    #[test]
    fn overlapping_cones_share_a_lens() {
        let r = 1e-3;
        let lens = (2.0 * PI / 3.0 - 3f64.sqrt() / 2.0) * r * r;
        assert!((cone_overlap(r, r, r) / lens - 1.0).abs() < 1e-5);
    }
}
