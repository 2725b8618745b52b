//! Lights the paths of a block for one time.

use std::cell::Cell;
use std::ops::Range;
use std::rc::Rc;
use std::sync::Arc;

use glam::DVec3;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use sunglint_radiometry::{Channels, Frame, LocalDir, REPLICATES, WorldDir};

use crate::gathered::{Glints, Kind, Patch, PixelLight, Run, Sums};
use crate::hemisphere::above_horizon;
use crate::lamp::{Lamp, OfKnot, Wants};
use crate::mirrors::{Image, Thrower, mirrored};
use crate::paths::{FacetGroup, Paths, RayCounts, Record, Source, SpectrumId};
use crate::pixel::{Parts, PixelRadiance};
use crate::render::Proofs;
use crate::sightline::{Knot, Lattice, Shares};
use crate::sun::{LastSun, Standing, Sun, SunLight, combined, glint};
use crate::unseen::unseen;
use crate::vectors::Four;
use crate::{Illumination, Lighting, Lights, Nodes, Scenery, limb};

/// What a block of pixels is lit with, whatever the time.
pub(crate) struct Block<'a> {
    pub scenery: &'a Scenery,
    pub paths: &'a Paths,
    pub channels: &'a Channels,
    pub nodes: &'a Nodes,
    /// Vertices by facet, and the group of each vertex.
    pub groups: Vec<FacetGroup>,
    pub of_vertices: Vec<u32>,
    /// Vertices of each pixel.
    pub pixels: Vec<Range<usize>>,
    /// What is proved of them.
    pub proofs: Proofs,
    lattice: &'a Lattice<'a>,
    has_caustics: bool,
    has_scatter: bool,
    /// What times have drawn so far, by vertex (each looks at the free sky by one record at most); NaN where none has yet, empty
    /// where one time alone is lit.
    disks: Vec<Cell<[f64; 2]>>,
    free: Vec<Cell<DVec3>>,
}

impl<'a> Block<'a> {
    pub fn new(
        scenery: &'a Scenery,
        paths: &'a Paths,
        pixels: Vec<Range<usize>>,
        (channels, nodes): (&'a Channels, &'a Nodes),
        lattice: &'a Lattice<'a>,
        n_times: usize,
        proofs: Proofs,
    ) -> Self {
        let (groups, of_vertices) = paths.facet_groups(&pixels, proofs);
        let has_caustics = paths.records.iter().any(|record| matches!(record.source, Source::Caustic { .. }));
        let has_scatter = paths.records.iter().any(|record| matches!(record.source, Source::Scatter { .. }));
        let n = if n_times > 1 { paths.vertices.len() } else { 0 };
        let (disks, free) = (vec![Cell::new([f64::NAN; 2]); n], vec![Cell::new(DVec3::NAN); n]);
        Self {
            scenery,
            paths,
            channels,
            nodes,
            groups,
            of_vertices,
            pixels,
            proofs,
            lattice,
            has_caustics,
            has_scatter,
            disks,
            free,
        }
    }

    /// Point of the sun's disk that a vertex sees, in disk radii.
    pub fn disk(&self, vertex: usize) -> [f64; 2] {
        let draw = || self.paths.vertices[vertex].disk();
        let Some(kept) = self.disks.get(vertex) else { return draw() };
        if kept.get()[0].is_nan() {
            kept.set(draw());
        }
        kept.get()
    }

    /// Where a vertex looks at the free part of a horizon.
    fn free(&self, vertex: usize, horizon: u32, place: [f64; 2]) -> WorldDir {
        let draw = || {
            let normal = self.paths.vertices[vertex].hit.normal;
            above_horizon(normal, self.paths.horizons.get(horizon).free(place))
        };
        let Some(kept) = self.free.get(vertex) else { return draw() };
        if kept.get().is_nan() {
            kept.set(draw().vec());
        }
        WorldDir::from_unit(kept.get())
    }

    /// Whether light passes through the surface of a group.
    pub fn passes(&self, group: &FacetGroup) -> bool {
        if !self.has_scatter {
            return false;
        }
        let hit = &self.paths.vertices[group.first as usize].hit;
        self.scenery.surface(hit.material).bsdf.lobes().transmission
    }
}

/// Lights a block for one time.
pub(crate) struct BlockLight<'a> {
    block: &'a Block<'a>,
    lighting: Lighting,
    lights: &'a Lights,
    time: &'a Illumination,
    disk: Option<Sun>,
    sun: Rc<SunLight>,
    /// Cosine of an angle beyond which a direction surely misses the disk.
    off_disk: f64,
    /// By group; empty where there are none.
    throwers: Vec<Vec<Thrower>>,
    /// Of the knots that the block's lines of sight take from.
    knots: FxHashMap<Knot, Arc<OfKnot>>,
    rays: RayCounts,
    work: Work,
}

/// What a pixel's points on one facet have in common at one time; `None` where they differ.
#[derive(Clone, Copy)]
struct Alike {
    /// I cos θ_s.
    sun: Option<f64>,
    /// α = 1: nothing hides the sun.
    open: Option<bool>,
}

/// Room for one pixel and one record.
#[derive(Default)]
struct Work {
    /// By cluster of samples: its lamp, and L_u by channel, empty where there is no path.
    lamps: Vec<(Lamp, Vec<f64>)>,
    alike: Vec<Alike>,
    weights: Vec<(u32, f64)>,
    /// Weights of the sky's terms along directions that are looked along together.
    looks: Vec<(u32, f64)>,
    amounts: Vec<Four>,
    values: Vec<f64>,
    lamp: Vec<f64>,
    f: Vec<f64>,
    spectrum: Vec<f64>,
}

impl<'a> BlockLight<'a> {
    pub fn new(block: &'a Block<'a>, lighting: Lighting, lights: &'a Lights, last: &mut LastSun) -> Self {
        let time = &*lights.illumination;
        let disk = Sun::new(time, lighting.sun_disk);
        let (sun, rays) = last.light(block, disk);
        let throwers = throwers(block, time, lighting.sun_disk);
        let off_disk = time.sun_radius.cos() - 1e-12;
        let (knots, work) = (FxHashMap::default(), Work::default());
        Self { block, lighting, lights, time, disk, sun, off_disk, throwers, knots, rays, work }
    }

    /// Rays cast so far.
    pub const fn rays(&self) -> RayCounts {
        self.rays
    }

    /// Whether the sun is proved to stand alike to all of the points of a vertex's group, and no mirror to throw it there.
    pub fn is_proved(&self, vertex: usize) -> bool {
        let group = self.block.of_vertices[vertex] as usize;
        self.sun.groups[group] != Standing::Mixed && self.throwers.get(group).is_none_or(Vec::is_empty)
    }

    /// The lamp and L_u of a cluster; without τ₂ where there is no path.
    fn light_cluster(&mut self, shares: Option<&Shares>, wants: Wants, (lamp, l_u): &mut (Lamp, Vec<f64>)) {
        let bare = self.lights.bare();
        l_u.clear();
        let Some(shares) = shares else { return lamp.copy(bare) };
        let Block { lattice, channels, nodes, .. } = self.block;
        l_u.resize(channels.len(), 0.0);
        let mut at = |knot| {
            let of_knot = self.knots.entry(knot).or_insert_with(|| self.lights.at(knot, lattice, channels, nodes));
            of_knot.clone()
        };
        let ends: SmallVec<[_; 4]> = shares.iter().map(|share| (at(share.low), at(share.high))).collect();
        if ends.iter().all(|(low, high)| low.is_clear && high.is_clear) {
            return lamp.copy(bare);
        }
        lamp.clear(bare, wants);
        self.lights.add(shares, &ends, (nodes, wants), lamp, l_u);
    }

    /// How the sun and what hides it stand to a run of a pixel's points, where to all alike.
    fn alike(&self, light: &PixelLight, run: &Run) -> Alike {
        match self.sun.groups[run.group as usize] {
            Standing::Lit(cos) => return Alike { sun: Some(cos), open: Some(true) },
            Standing::Dark => return Alike { sun: Some(0.0), open: Some(true) },
            Standing::Shaded => return Alike { sun: Some(0.0), open: Some(false) },
            Standing::Mixed => {}
        }
        let records = light.grouped[run.records.clone()].iter().map(|i| &self.block.paths.records[*i as usize]);
        let (mut sun, mut open) = (None, None);
        let (mut sun_differs, mut open_differs) = (false, false);
        for record in records {
            match record.source {
                Source::Sun { vertex } => {
                    let own = self.sun.visible[vertex as usize] * self.sun.cos[vertex as usize].max(0.0);
                    sun_differs |= *sun.get_or_insert(own) != own;
                }
                Source::OpenSky { unless: Some(vertex), .. } => {
                    let own = !self.sun.shaded[vertex as usize];
                    open_differs |= *open.get_or_insert(own) != own;
                }
                _ => {}
            }
        }
        // Each point of a disk that darkens towards its limb has its own light.
        let limb = self.lighting.sun_disk && self.lighting.limb_darkening;
        Alike { sun: sun.filter(|sun| !sun_differs && (*sun == 0.0 || !limb)), open: open.filter(|_| !open_differs) }
    }

    /// One pixel: its records, its samples, and what each of its clusters takes of the block's lines of sight.
    pub fn pixel(
        &mut self,
        light: &PixelLight,
        samples: Range<usize>,
        counts: &[u32; REPLICATES],
        sights: &[Option<Shares>],
        surface: bool,
        parts: Parts,
    ) -> PixelRadiance {
        let n = self.block.channels.len();
        let each = counts.map(|count| 1.0 / f64::from(count.max(1)));
        let mut work = std::mem::take(&mut self.work);
        work.lamps.resize_with(sights.len().max(work.lamps.len()), Default::default);
        sights
            .iter()
            .zip(&mut work.lamps)
            .for_each(|(shares, lamp)| self.light_cluster(shares.as_ref(), light.wants, lamp));
        work.alike.clear();
        work.alike.extend(light.runs.iter().map(|run| self.alike(light, run)));
        let lamps = std::mem::take(&mut work.lamps);
        let mut sums = Sums::new(self.block, each, parts);
        self.gather(light, |cluster| &lamps[cluster].0, &mut sums, &mut work);
        let leaving = if surface {
            let (mut leaving, bare) = (Sums::new(self.block, each, Parts::Whole), self.lights.bare());
            self.gather(light, |_| bare, &mut leaving, &mut work);
            leaving.radiance
        } else {
            Vec::new()
        };
        let Sums { mut radiance, looked, terms, .. } = sums;
        let mut upwelled = vec![0.0; n];
        for (q, (_, values)) in lamps[..sights.len()].iter().enumerate() {
            let mut shares = [0.0; REPLICATES];
            let samples = &self.block.paths.samples[samples.clone()];
            for sample in samples.iter().filter(|sample| usize::from(sample.cluster) == q) {
                shares[sample.replicate as usize] += sample.weight * each[sample.replicate as usize];
            }
            for (sums, value) in radiance.iter_mut().zip(values) {
                sums.iter_mut().zip(&shares).for_each(|(sum, share)| *sum += share * value);
            }
            let share = shares.iter().sum::<f64>() / REPLICATES as f64;
            upwelled.iter_mut().zip(values).for_each(|(sum, value)| *sum += share * value);
        }
        let (mut lit, mut looks) = ([0.0; REPLICATES], 0);
        let samples = &self.block.paths.samples[samples];
        for sample in samples {
            let visible = sample.vertex.map_or(0.0, |vertex| self.sun.visible[vertex as usize]);
            lit[sample.replicate as usize] += visible * sample.weight * each[sample.replicate as usize];
            looks += u32::from(!sample.sky_view.is_nan());
        }
        let unseen = unseen(self.block, (light, &self.sun), |cluster| &lamps[cluster].0, &self.lights.bare().mean_sky);
        work.lamps = lamps;
        self.work = work;
        PixelRadiance {
            radiance,
            surface: leaving,
            looked,
            terms,
            upwelled,
            lit,
            cache_noise: Vec::new(),
            unseen,
            samples: samples.len() as u32,
            looks,
        }
    }

    /// Adds up the records of one pixel under the lamps of its clusters.
    fn gather<'l>(
        &mut self,
        light: &PixelLight,
        lamp_of: impl Fn(usize) -> &'l Lamp + Copy,
        sums: &mut Sums<'_>,
        work: &mut Work,
    ) {
        let sun = self.time.sun;
        let is_near = |patch: &Patch| sun.is_some_and(|sun| sun.dot(patch.middle) > patch.cos_near);
        for merged in &light.merged {
            let lamp = lamp_of(merged.cluster.into());
            let (weights, scale) = match merged.kind {
                Kind::Own => (&lamp.own, 1.0),
                Kind::MeanSky => (&lamp.mean_sky, 1.0),
                Kind::Sun { run } => match work.alike[run as usize].sun {
                    Some(scale) if scale != 0.0 => (&lamp.beam, scale),
                    _ => continue,
                },
                Kind::Ambient { run, .. } if work.alike[run as usize].open != Some(true) => continue,
                Kind::OpenSky(normal) | Kind::Ambient { normal, .. } => {
                    let amounts = self.lights.open_sky(normal);
                    self.lights.of_sky(lamp, self.block.nodes, &amounts, &mut work.lamp);
                    (&work.lamp, 1.0)
                }
                Kind::Patch { patch, .. } if is_near(&light.patches[patch as usize]) => continue,
                Kind::Patch { node, .. } => {
                    if !self.lights.sky(node, &mut work.weights, &mut work.amounts) {
                        continue;
                    }
                    self.lights.of_sky(lamp, self.block.nodes, &work.amounts, &mut work.lamp);
                    (&work.lamp, 1.0)
                }
            };
            sums.add_merged(merged, weights, scale);
        }
        let paths = self.block.paths;
        for (run, alike) in light.runs.iter().zip(&work.alike) {
            if alike.sun.is_some() && alike.open.is_some() {
                continue;
            }
            for record in light.grouped[run.records.clone()].iter().map(|i| &paths.records[*i as usize]) {
                let sample = &paths.samples[record.sample as usize];
                let (replicate, term) = (usize::from(sample.replicate), sums.parts.of(record));
                let lamp = lamp_of(sample.cluster.into());
                let spectrum = paths.spectrum(record.spectrum);
                match record.source {
                    Source::Sun { vertex } if alike.sun.is_none() => {
                        let i = vertex as usize;
                        let scale = record.weight * self.sun.visible[i] * self.sun.cos[i].max(0.0);
                        if scale == 0.0 {
                            continue;
                        }
                        match self.limb_of(i, spectrum) {
                            Some(limb) => sums.add(replicate, term, &limb, &lamp.beam, scale),
                            None => sums.add(replicate, term, spectrum, &lamp.beam, scale),
                        }
                    }
                    Source::OpenSky { normal, unless: Some(vertex) }
                        if alike.open.is_none() && !self.sun.shaded[vertex as usize] =>
                    {
                        let amounts = self.lights.open_sky(normal);
                        self.lights.by_sky(lamp, self.block.nodes, spectrum, &amounts, &mut work.values);
                        sums.add_values(replicate, term, work.values.iter().copied(), record.weight);
                    }
                    _ => {}
                }
            }
        }
        let near = light.patches.iter().filter(|patch| is_near(patch));
        let patched = near.flat_map(|patch| &light.patched[patch.records.clone()]);
        // Far from the sun no lobe sees it, and most mirror directions are far from the sun.
        let sees = |glints: &&Glints| sun.is_some_and(|sun| glints.reach(sun, self.time.sun_radius));
        let glints = light.glints.iter().filter(sees).flat_map(|glints| &glints.records);
        work.looks.clear();
        let mut looking: Option<&Record> = None;
        for record in patched.chain(glints).chain(&light.changing).map(|i| &paths.records[*i as usize]) {
            // What one path sees of the sky from one surface meets the sky's spectra once.
            if let Some(first) = looking.take_if(|first| !record.looks_with(first)) {
                self.look(first, lamp_of, sums, work);
            }
            let sample = &paths.samples[record.sample as usize];
            let (replicate, term) = (usize::from(sample.replicate), sums.parts.of(record));
            let lamp = lamp_of(sample.cluster.into());
            let spectrum = paths.spectrum(record.spectrum);
            match record.source {
                Source::Own | Source::MeanSky | Source::OpenSky { .. } | Source::Sun { .. } => {}
                Source::Sky { .. } | Source::FreeSky { .. } => {
                    let Some((direction, share)) = self.looks_at(&record.source) else { continue };
                    self.time.sky.sky_weights(direction, &mut work.weights);
                    let scale = share * record.weight;
                    work.looks.extend(work.weights.iter().map(|(k, weight)| (*k, scale * weight)));
                    looking.get_or_insert(record);
                }
                Source::Glint { vertex, mirror, escaped, solid_angle, half_angle, law } => {
                    let Some(sun) = self.time.sun else { continue };
                    let i = vertex as usize;
                    let (visible, cos) = (self.sun.visible[i], self.sun.cos[i].max(0.0));
                    let value = glint(self.time, sun, mirror, escaped, solid_angle, half_angle, law, visible, cos);
                    sums.add(replicate, term, spectrum, &lamp.beam, record.weight * value);
                }
                Source::Disk { direction, density } => {
                    let Some((value, r)) = self.disk(direction, density) else { continue };
                    match self.darkened(r, spectrum) {
                        Some(spectrum) => sums.add(replicate, term, &spectrum, &lamp.beam, record.weight * value),
                        None => sums.add(replicate, term, spectrum, &lamp.beam, record.weight * value),
                    }
                }
                Source::Scatter { vertex, outgoing } => {
                    if let Some(scale) = self.scattered(vertex, outgoing, record.spectrum, work) {
                        sums.add(replicate, term, &work.spectrum, &lamp.beam, record.weight * scale);
                    }
                }
                Source::Caustic { vertex, outgoing, bounces } => {
                    let group = self.block.of_vertices[vertex as usize];
                    let point = paths.vertices[vertex as usize].hit.point;
                    let mut last = None;
                    for i in 0..self.throwers.get(group as usize).map_or(0, Vec::len) {
                        let thrower = self.throwers[group as usize][i];
                        let image = thrower.image;
                        // Several mirrors of one plane show one image.
                        if last == Some(image) || image.second.is_some() && bounces < 2 || !thrower.reaches(point) {
                            continue;
                        }
                        last = Some(image);
                        if let Some(scale) = self.imaged(vertex, outgoing, image, record.spectrum, work) {
                            sums.add(replicate, term, &work.spectrum, &lamp.beam, record.weight * scale);
                        }
                    }
                }
            }
        }
        if let Some(first) = looking {
            self.look(first, lamp_of, sums, work);
        }
    }

    /// Adds what a path sees of the sky from a surface: `work.looks`, by a record of it.
    fn look<'l>(&self, record: &Record, lamp_of: impl Fn(usize) -> &'l Lamp, sums: &mut Sums<'_>, work: &mut Work) {
        let paths = self.block.paths;
        let sample = &paths.samples[record.sample as usize];
        let (lamp, spectrum) = (lamp_of(sample.cluster.into()), paths.spectrum(record.spectrum));
        self.lights.mix(&work.looks, &mut work.amounts);
        work.looks.clear();
        self.lights.by_sky(lamp, self.block.nodes, spectrum, &work.amounts, &mut work.values);
        let term = sums.parts.of(record);
        sums.add_values(sample.replicate.into(), term, work.values.iter().copied(), 1.0);
    }

    /// Where a record looks at the sky, and with what share: V − α of a vertex where there is one, α = 1 unless something hides
    /// the sun from it. `None` where that is 0.
    fn looks_at(&self, source: &Source) -> Option<(WorldDir, f64)> {
        let alpha = |vertex: u32| f64::from(u8::from(!self.sun.shaded[vertex as usize]));
        match *source {
            Source::Sky { direction, seen: None } => Some((direction, 1.0)),
            Source::Sky { direction, seen: Some((vertex, free)) } => {
                Some((direction, f64::from(u8::from(free)) - alpha(vertex))).filter(|(_, share)| *share != 0.0)
            }
            Source::FreeSky { vertex, horizon, place } if alpha(vertex) == 0.0 => {
                Some((self.block.free(vertex as usize, horizon, place), 1.0))
            }
            _ => None,
        }
    }

    /// What a ray that leaves the scene finds of the sun's disk, per irradiance E_n \[sr⁻¹\], and how far from its middle in disk
    /// radii: weighed against the draw of a point of the disk where that too finds it.
    fn disk(&self, direction: WorldDir, density: f64) -> Option<(f64, f64)> {
        let sun = self.time.sun.filter(|sun| direction.dot(*sun) >= self.off_disk)?;
        let apart = direction.angle_to(sun);
        let drawn = 1.0 / self.time.sun_solid_angle();
        let share = if density.is_finite() { combined(density, drawn) } else { 1.0 };
        (apart <= self.time.sun_radius).then(|| (share * drawn, apart.sin() / self.time.sun_radius.sin()))
    }

    /// A spectrum times the disk's radiance over its mean, where the disk darkens towards its limb.
    fn darkened(&self, r: f64, spectrum: &[f64]) -> Option<Vec<f64>> {
        let wavelengths = self.block.nodes.wavelengths_um();
        let limb = self.lighting.limb_darkening.then(|| limb::profile(wavelengths, r))?;
        Some(spectrum.iter().zip(limb).map(|(t, l)| t * l).collect())
    }

    /// The same at the point of the disk that a vertex sees.
    fn limb_of(&self, vertex: usize, spectrum: &[f64]) -> Option<Vec<f64>> {
        let Lighting { sun_disk, limb_darkening, .. } = self.lighting;
        if !(sun_disk && limb_darkening) {
            return None;
        }
        let [x, y] = self.block.disk(vertex);
        self.darkened(x.hypot(y), spectrum)
    }

    /// The sun at a vertex by all but the Lambertian part: fills `work.spectrum`, and gives what is left to multiply by E_n.
    fn scattered(&self, vertex: u32, outgoing: LocalDir, spectrum: SpectrumId, work: &mut Work) -> Option<f64> {
        let i = vertex as usize;
        let sun = self.disk.as_ref().filter(|_| self.sun.visible[i] * self.sun.cos[i] != 0.0)?;
        let vertex = &self.block.paths.vertices[i];
        let incident = Frame::about(vertex.hit.normal).to_local(sun.of(self.block, i));
        let bsdf = &self.block.scenery.surface(vertex.hit.material).bsdf;
        if bsdf.is_lambertian_at(incident, outgoing) {
            return None;
        }
        work.f.resize(self.block.nodes.len(), 0.0);
        let density = bsdf.rest(incident, outgoing, &mut work.f);
        if !self.times_f(spectrum, work) {
            return None;
        }
        if let Some(limb) = self.limb_of(i, &work.spectrum) {
            work.spectrum = limb;
        }
        let drawn = 1.0 / self.time.sun_solid_angle();
        let share = if self.lighting.sun_disk { combined(drawn, density) } else { 1.0 };
        Some(self.sun.visible[i] * incident.cos().abs() * share)
    }

    /// Fills `work.spectrum` with spectrum × `work.f`. Whether it is more than black.
    fn times_f(&self, spectrum: SpectrumId, work: &mut Work) -> bool {
        work.spectrum.clear();
        work.spectrum.extend(self.block.paths.spectrum(spectrum).iter().zip(&work.f).map(|(t, f)| t * f));
        work.spectrum.iter().any(|t| *t != 0.0)
    }

    /// The sun in mirrors at a vertex: fills `work.spectrum`, and gives what is left to multiply by E_n.
    fn imaged(
        &mut self,
        vertex: u32,
        outgoing: LocalDir,
        image: Image,
        spectrum: SpectrumId,
        work: &mut Work,
    ) -> Option<f64> {
        let scenery = self.block.scenery;
        let mirrors = &scenery.mirrors;
        let i = vertex as usize;
        let vertex = &self.block.paths.vertices[i];
        let point = self.disk.as_ref()?.of(self.block, i);
        if point.cos_zenith() <= 0.0 {
            return None;
        }
        let second = image.second.map(|axis| mirrors.axis(axis));
        let after_first = second.map_or(point.vec(), |axis| mirrored(point.vec(), axis));
        let direction = WorldDir::new(mirrored(after_first, mirrors.axis(image.first)));
        let incident = Frame::about(vertex.hit.normal).to_local(direction);
        let passes = scenery.surface(vertex.hit.material).bsdf.lobes().transmission;
        if incident.cos() <= 0.0 && !passes {
            return None;
        }
        // The ray itself finds the mirrors.
        let mut hits = [None; 2];
        let (mut from, mut along) = (vertex.hit, direction);
        let turns = [Some((image.first, after_first)), image.second.map(|axis| (axis, point.vec()))];
        for (hit, (axis, next)) in hits.iter_mut().zip(turns.into_iter().flatten()) {
            self.rays.caustic += 1;
            let met = scenery.world.closest(&from.leave(along)).filter(|met| mirrors.axis_of(met) == Some(axis))?;
            *hit = Some((met, -along));
            (from, along) = (met, WorldDir::from_unit(next));
            // Behind the mirror there is nothing to be seen in it.
            if along.vec().dot(met.normal) <= 0.0 {
                return None;
            }
        }
        self.rays.caustic += 1;
        if scenery.world.occluded(&from.leave(along)) {
            return None;
        }
        work.f.resize(self.block.nodes.len(), 0.0);
        scenery.surface(vertex.hit.material).bsdf.eval(incident, outgoing, &mut work.f);
        if !self.times_f(spectrum, work) {
            return None;
        }
        for (hit, outgoing) in hits.into_iter().flatten() {
            let local = Frame::about(hit.normal).to_local(outgoing);
            scenery.surface(hit.material).bsdf.mirror(local, &mut work.f);
            work.spectrum.iter_mut().zip(&work.f).for_each(|(t, rho)| *t *= rho);
        }
        if let Some(limb) = self.limb_of(i, &work.spectrum) {
            work.spectrum = limb;
        }
        Some(incident.cos().abs())
    }
}

/// The planar mirrors in which each group may see the sun.
fn throwers(block: &Block<'_>, time: &Illumination, sun_disk: bool) -> Vec<Vec<Thrower>> {
    let mirrors = &block.scenery.mirrors;
    let Some(sun) = time.sun.filter(|_| block.has_caustics && !mirrors.is_empty()) else { return Vec::new() };
    let spread = if sun_disk { time.sun_radius } else { 0.0 };
    block.groups.iter().map(|group| mirrors.throwers(group.lo, group.hi, sun.vec(), spread)).collect()
}
