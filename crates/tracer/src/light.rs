//! Lights the paths of a block for one time.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::Range;

use glam::DVec3;
use sunglint_atmosphere::Path;
use sunglint_radiometry::{Channels, Frame, LocalDir, REPLICATES, WorldDir};

use crate::paths::{ChainId, GlintLaw, Paths, RayCounts, Source, Vertex};
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
pub(crate) fn sun_light(scenery: &Scenery, paths: &Paths, time: &Illumination, disk: bool) -> (SunLight, RayCounts) {
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
    for group in paths.facet_groups() {
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
fn half_angle(solid_angle: f64) -> f64 {
    2.0 * (solid_angle / (4.0 * PI)).clamp(0.0, 1.0).sqrt().asin()
}

/// What a specular component of reflectance 1 returns of E_n about a mirror direction: radiance per irradiance \[sr⁻¹\].
fn glint(
    time: &Illumination,
    sun: WorldDir,
    mirror: WorldDir,
    escaped: bool,
    solid_angle: f64,
    law: GlintLaw,
    visible: f64,
    cos: f64,
) -> f64 {
    let apart = mirror.angle_to(sun);
    let omega_sun = time.sun_solid_angle();
    // A lobe no wider than the disk is a mirror: the ray itself finds the disk.
    let is_mirror = solid_angle <= omega_sun * (1.0 + 1e-9);
    let in_disk = apart <= time.sun_radius && escaped;
    match law {
        GlintLaw::Printed => {
            let inside = if is_mirror { in_disk } else { apart <= half_angle(solid_angle) && visible > 0.0 };
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
            if apart <= half_angle(solid_angle) {
                visible / solid_angle
            } else {
                0.0
            }
        }
        GlintLaw::Conserving => {
            visible * cone_overlap(half_angle(solid_angle), time.sun_radius, apart) / (solid_angle * omega_sun)
        }
    }
}

/// A spectrum of light that chains multiply.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Light {
    Beam,
    MeanSky,
    SkyTerm(u32),
    Own,
}

impl Light {
    fn code(self) -> u64 {
        match self {
            Self::Own => 0,
            Self::Beam => 1,
            Self::MeanSky => 2,
            Self::SkyTerm(k) => 3 + u64::from(k),
        }
    }
}

/// No node of a line of sight: the light as it leaves the surface, or the sky itself.
const NO_PATH: u32 = u32::MAX;

/// Weights of one (cluster, term, chain, light) in each replicate.
struct Weighted {
    key: u64,
    chain: ChainId,
    light: Light,
    cluster: u8,
    term: Term,
    replicates: [f64; REPLICATES],
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

/// Lights a block for one time; spectra of chains are made once and shared by its pixels.
pub(crate) struct BlockLight<'a> {
    scenery: &'a Scenery,
    paths: &'a Paths,
    time: &'a Illumination,
    channels: &'a Channels,
    lighting: Lighting,
    sun: SunLight,
    /// τ₂ of each node of the block's lines of sight, per grid entry.
    tau_2: Vec<Vec<f64>>,
    /// L_u of each node, per channel.
    upwelled: Vec<Vec<f64>>,
    /// Spectrum of chain × light, by chain and light, made when first met.
    products: HashMap<(ChainId, u64), Vec<f64>>,
    /// Channel values of chain × light × τ₂ at a node, made when first met; `NO_PATH` is without τ₂.
    values: HashMap<(ChainId, u64, u32), Vec<f64>>,
    sky_weights: Vec<(u32, f64)>,
    weighted: Vec<Weighted>,
}

impl<'a> BlockLight<'a> {
    pub fn new(
        scenery: &'a Scenery,
        paths: &'a Paths,
        time: &'a Illumination,
        channels: &'a Channels,
        lighting: Lighting,
        nodes: &[Path],
    ) -> (Self, RayCounts) {
        let (sun, rays) = sun_light(scenery, paths, time, lighting.sun_disk);
        let n = time.beam.len();
        let mut l_u = vec![0.0; n];
        let (mut tau_2, mut upwelled) = (Vec::new(), Vec::new());
        for path in nodes {
            let mut transmittance = vec![0.0; n];
            time.sky.path(path, &mut transmittance, &mut l_u);
            let mut folded = vec![0.0; channels.len()];
            channels.fold(&l_u, &mut folded);
            tau_2.push(transmittance);
            upwelled.push(folded);
        }
        let light = Self {
            scenery,
            paths,
            time,
            channels,
            lighting,
            sun,
            tau_2,
            upwelled,
            products: HashMap::new(),
            values: HashMap::new(),
            sky_weights: Vec::new(),
            weighted: Vec::new(),
        };
        (light, rays)
    }

    /// I_t over the first vertices among samples: the sun-lit fraction.
    pub fn lit_fraction(&self, samples: Range<usize>) -> f64 {
        let n = samples.len() as f64;
        let lit = |sample: &crate::paths::Sample| sample.vertex.map_or(0.0, |v| self.sun.visible[v as usize]);
        self.paths.samples[samples].iter().map(lit).sum::<f64>() / n
    }

    fn add(&mut self, sample: usize, chain: ChainId, light: Light, term: Term, weight: f64, by_term: bool) {
        if weight == 0.0 {
            return;
        }
        let sample = &self.paths.samples[sample];
        let term = if by_term { term } else { Term::DiffuseSun };
        let key = (u64::from(chain) << 32) | (light.code() << 16) | (u64::from(sample.cluster) << 8) | term as u64;
        let slot = match self.weighted.iter().rposition(|w| w.key == key) {
            Some(slot) => slot,
            None => {
                let cluster = sample.cluster;
                self.weighted.push(Weighted { key, chain, light, cluster, term, replicates: [0.0; REPLICATES] });
                self.weighted.len() - 1
            }
        };
        self.weighted[slot].replicates[sample.replicate as usize] += weight;
    }

    /// Gathers the records of one pixel into weights of (chain, light).
    fn gather(&mut self, records: Range<usize>, by_term: bool) {
        self.weighted.clear();
        let (paths, time) = (self.paths, self.time);
        for record in &paths.records[records] {
            let sample = record.sample as usize;
            let mut lights = std::mem::take(&mut self.sky_weights);
            let light = match record.source {
                Source::Own => Some((Light::Own, 1.0)),
                Source::MeanSky => Some((Light::MeanSky, 1.0)),
                Source::Sun { vertex } => {
                    let i = vertex as usize;
                    Some((Light::Beam, self.sun.visible[i] * self.sun.cos[i]))
                }
                Source::Glint { vertex, mirror, escaped, solid_angle, law } => time.sun.map(|sun| {
                    let i = vertex as usize;
                    let (visible, cos) = (self.sun.visible[i], self.sun.cos[i]);
                    (Light::Beam, glint(time, sun, mirror, escaped, solid_angle, law, visible, cos))
                }),
                Source::Disk(direction) => time.sun.map(|sun| {
                    let seen = direction.angle_to(sun) <= time.sun_radius;
                    (Light::Beam, if seen { 1.0 / time.sun_solid_angle() } else { 0.0 })
                }),
                Source::Sky(direction) => {
                    time.sky.sky_weights(direction, &mut lights);
                    None
                }
                Source::OpenSky(normal) => {
                    lights.clear();
                    time.open_sky(normal, |k, w| lights.push((k, w)));
                    None
                }
            };
            let directional = matches!(record.source, Source::Sky(_) | Source::OpenSky(_));
            for c in record.chains.clone() {
                let (chain, share) = paths.chain_list[c as usize];
                let weight = share * record.weight;
                if let Some((light, value)) = light {
                    self.add(sample, chain, light, record.term, weight * value, by_term);
                }
                if directional {
                    for (k, shape) in &lights {
                        self.add(sample, chain, Light::SkyTerm(*k), record.term, weight * shape, by_term);
                    }
                }
            }
            self.sky_weights = lights;
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
        let key = (chain, light.code(), node);
        if !self.values.contains_key(&key) {
            let values = if self.lighting.band_means {
                self.values_of_means(chain, light, node)
            } else {
                self.values_of_products(chain, light, node)
            };
            self.values.insert(key, values);
        }
        &self.values[&key]
    }

    fn values_of_products(&mut self, chain: ChainId, light: Light, node: u32) -> Vec<f64> {
        let (scenery, source, n) = (self.scenery, self.spectrum_of(light), self.time.beam.len());
        let factors = self.paths.chains.factors(chain);
        let product = self.products.entry((chain, light.code())).or_insert_with(|| {
            let mut product = source.map_or_else(|| vec![1.0; n], <[f64]>::to_vec);
            for factor in factors {
                product.iter_mut().zip(factor.spectrum(scenery)).for_each(|(p, f)| *p *= f);
            }
            product
        });
        let mut out = vec![0.0; self.channels.len()];
        match self.tau_2.get(node as usize) {
            Some(tau_2) => self.channels.fold_product(product, tau_2, &mut out),
            None => self.channels.fold(product, &mut out),
        }
        out
    }

    fn values_of_means(&self, chain: ChainId, light: Light, node: u32) -> Vec<f64> {
        let mut out = vec![1.0; self.channels.len()];
        let mut means = out.clone();
        let mut multiply = |spectrum: &[f64]| {
            self.channels.fold(spectrum, &mut means);
            out.iter_mut().zip(&means).for_each(|(out, mean)| *out *= mean);
        };
        self.paths.chains.factors(chain).iter().for_each(|factor| multiply(factor.spectrum(self.scenery)));
        match light {
            Light::Own => {}
            Light::Beam => {
                multiply(self.time.sky.solar_irradiance());
                multiply(self.time.sky.sun_transmittance());
            }
            Light::MeanSky | Light::SkyTerm(_) => self.spectrum_of(light).into_iter().for_each(&mut multiply),
        }
        self.tau_2.get(node as usize).into_iter().for_each(|tau_2| multiply(tau_2));
        out
    }

    /// One pixel: its records, its samples, and what each of its clusters takes of the block's lines of sight.
    pub fn pixel(
        &mut self,
        records: Range<usize>,
        samples: Range<usize>,
        sights: &[Shares],
        surface: bool,
        by_term: bool,
    ) -> PixelRadiance {
        let n = self.channels.len();
        let per_replicate = samples.len() as f64 / REPLICATES as f64;
        self.gather(records, by_term);
        let mut radiance = vec![[0.0; REPLICATES]; n];
        let mut leaving = if surface { radiance.clone() } else { Vec::new() };
        let mut terms: Vec<(Term, Vec<f64>)> = Vec::new();
        let weighted = std::mem::take(&mut self.weighted);
        let mut values = vec![0.0; n];
        let spread = |values: &[f64], replicates: &[f64; REPLICATES], out: &mut [[f64; REPLICATES]]| {
            for (sums, value) in out.iter_mut().zip(values) {
                sums.iter_mut().zip(replicates).for_each(|(sum, w)| *sum += w * value / per_replicate);
            }
        };
        for entry in &weighted {
            match &sights[entry.cluster as usize] {
                None => values.copy_from_slice(self.channel_values(entry.chain, entry.light, NO_PATH)),
                Some(shares) => {
                    values.fill(0.0);
                    for (node, share) in shares {
                        let at_node = self.channel_values(entry.chain, entry.light, *node);
                        values.iter_mut().zip(at_node).for_each(|(value, v)| *value += share * v);
                    }
                }
            }
            spread(&values, &entry.replicates, &mut radiance);
            if by_term {
                let mean = entry.replicates.iter().sum::<f64>() / samples.len() as f64;
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
        self.weighted = weighted;
        let mut upwelled = vec![0.0; n];
        for (q, shares) in sights.iter().enumerate() {
            let Some(shares) = shares else { continue };
            values.fill(0.0);
            for (node, share) in shares {
                let at_node = &self.upwelled[*node as usize];
                values.iter_mut().zip(at_node).for_each(|(value, l_u)| *value += share * l_u);
            }
            let mut counts = [0.0; REPLICATES];
            for sample in self.paths.samples[samples.clone()].iter().filter(|sample| usize::from(sample.cluster) == q) {
                counts[sample.replicate as usize] += 1.0;
            }
            spread(&values, &counts, &mut radiance);
            let share = counts.iter().sum::<f64>() / samples.len() as f64;
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
