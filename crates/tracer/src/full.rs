//! The algorithm `full`: the radiance integral itself [Stark1993, eq. 3.9, with its cosine and its hemisphere], by path tracing.
//!
//! ```text
//! L_o(ω_o) = L_e + ∫ f(ω_i, ω_o) L_i(ω_i) cos θ_i dω_i
//! ```
//!
//! At every surface f is taken apart: f = ρ/π + f_rest, and a mirror. The Lambertian part sees the sun by a ray to a point of
//! its disk, and the sky by
//!
//! ```text
//! ∫ V L_d cos θ dω = α E_open + ∫ (V − α) L_d cos θ dω
//! ```
//!
//! with E_open in closed form and α = 1 where the sun is seen and 0 where something hides it: an open facet in the sun needs no
//! ray, and one in the shade does not miss the aureole that is hidden with the sun. The rest sees the sun by that ray and by
//! draws of its own, combined [Veach1995, power heuristic], and the sky by its draws.

use std::f64::consts::PI;
use std::sync::Arc;

use sunglint_atmosphere::Needs;
use sunglint_geometry::Hit;
use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Frame, LocalDir, REPLICATES, WorldDir};
use sunglint_reflectance::Lobes;

use crate::algorithm::{Algorithm, Draw, Lighting};
use crate::hemisphere::{above_horizon, below_horizon, hemisphere_direction, open_sky_view};
use crate::irradiance_cache::{Gathered, Place};
use crate::paths::{ONE, Paths, Room, Sample, Source, SpectrumId};
use crate::pixel::Term;
use crate::published::SPECTRAL;
use crate::sampler::concentric_disk;
use crate::{Scenery, Sight, Stream, Surface};

/// A path is played with Russian roulette where less than one over this is left of what it began with: what survives weighs
/// no more than that, and is not rare where it counts.
const ROULETTE: f64 = 4.0;
/// The same for what the sensor sees in mirrors alone.
const MIRROR_ROULETTE_FROM: u32 = 8;
/// Surfaces after which an unlimited path ends: between perfect reflectors roulette alone would not end it.
const DEPTH_LIMIT: u32 = 4096;
/// Mirrors in a row through which the sun is found without luck.
const IMAGED: u8 = 2;

#[derive(Clone, Copy, Debug)]
struct Full {
    /// Surfaces of a path; `None` is unlimited.
    depth: Option<u32>,
    sun_disk: bool,
    limb_darkening: bool,
    directional_sky: bool,
    band_means: bool,
    adjacency: bool,
    caustics: bool,
    cached: bool,
}

/// `full`: the exact integral.
pub const FULL: Model<dyn Algorithm> = Model {
    info: ModelInfo {
        name: "full",
        summary: "the radiance integral itself, by path tracing (Stark 1993, eq. 3.9)",
        manual: include_str!("../manual/full.md"),
        params: &[
            Param::count("depth", &["unlimited"], Default::Word("unlimited"), "surfaces of a path").within(1.0, 4096.0),
            Param::word("sun", &["disk", "point"], Default::Word("disk"), "the sun as a disk of 0.533° or a point"),
            Param::switch("limb_darkening", false, "the disk darkens towards its limb"),
            Param::word("sky", &["directional", "isotropic"], Default::Word("directional"), "L_d(θ, φ), or its mean"),
            SPECTRAL,
            Param::switch("adjacency", true, "the ground's albedo brightens the sky"),
            Param::word(
                "indirect",
                &["sampled", "cached"],
                Default::Word("sampled"),
                "sky and background over Lambertian surfaces: by every sample, or interpolated",
            ),
            Param::switch("caustics", true, "the sun by way of mirrors onto other surfaces"),
        ],
    },
    bind,
};

fn bind(args: &Args, _: &sunglint_radiometry::SpectralGrid) -> Result<Arc<dyn Algorithm>, BindError> {
    Ok(Arc::new(Full {
        depth: args.count("depth").map(|depth| depth as u32),
        sun_disk: args.word("sun") != Some("point"),
        limb_darkening: args.switch("limb_darkening").unwrap_or(false),
        directional_sky: args.word("sky") != Some("isotropic"),
        band_means: args.word("spectral") == Some("band"),
        adjacency: args.switch("adjacency").unwrap_or(true),
        caustics: args.switch("caustics").unwrap_or(true),
        cached: args.word("indirect") == Some("cached"),
    }))
}

/// How a path came to where it stands.
#[derive(Clone, Copy)]
pub(crate) struct Past {
    /// By mirrors alone, or not at all: the sensor sees this surface.
    straight: bool,
    /// Mirrors in a row since the last surface that scatters.
    mirrors: u8,
    /// The first surface's mirror or lobe led here, not its Lambertian part.
    by_lobe: bool,
}

/// Where a path stands.
#[derive(Clone, Copy)]
pub(crate) struct Step {
    hit: Hit,
    /// Towards where the path came from.
    outgoing: WorldDir,
    /// Product of the reflectances so far, and what else it is weighed with.
    spectrum: SpectrumId,
    weight: f64,
    /// Largest |weight × spectrum| as the path left the last surface that the sensor sees, or as it came there; for Russian
    /// roulette.
    begun: f64,
    /// Surfaces so far, this one included.
    depth: u32,
    past: Past,
}

impl Past {
    /// Whether rays over a first surface led here.
    const fn is_looked(self) -> bool {
        !self.straight && !self.by_lobe
    }
}

impl Step {
    /// The term that light scattered here belongs to.
    fn term(&self, first: Term) -> Term {
        match (self.depth, self.past.by_lobe) {
            (1, _) => first,
            (_, true) => Term::SpecularBackground,
            (_, false) => Term::DiffuseBackground,
        }
    }
}

/// What a surface was found to do as its own light and the sun's were recorded.
struct Direct {
    vertex: u32,
    outgoing: LocalDir,
    /// Probability of a draw of the Lambertian part, and the path's spectrum after it, where there is one.
    even: f64,
    of_even: Option<SpectrumId>,
    /// Whether anything scatters beside it.
    has_rest: bool,
}

/// A path as it is traced.
struct Walk<'a> {
    scenery: &'a Scenery,
    sight: Sight<'a>,
    id: u32,
    /// See [`Draw`].
    looks: f64,
    room: Room,
}

impl Algorithm for Full {
    fn needs(&self, _: &Scenery) -> Needs {
        Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None }
    }

    fn lighting(&self) -> Lighting {
        Lighting {
            sun_disk: self.sun_disk,
            limb_darkening: self.limb_darkening,
            band_means: self.band_means,
            adjacency: self.adjacency,
        }
    }

    fn traced_by(&self) -> String {
        // These are said of its light.
        format!("{:?}", Self { limb_darkening: false, band_means: false, adjacency: false, ..*self })
    }

    fn skips(&self, scenery: &Scenery) -> Vec<String> {
        let mut skips = Vec::new();
        let (mirrors, normals) = scenery.mirror_counts();
        match (mirrors, self.caustics) {
            (0, _) => skips.push("no sun by way of mirrors: no facet is a mirror".to_string()),
            (_, false) => skips.push(format!(
                "no sun by way of mirrors onto other surfaces: `caustics off` ({mirrors} mirrors in {normals} planes)"
            )),
            _ => {}
        }
        if self.depth == Some(1) {
            skips.push("no background: depth 1".to_string());
        }
        skips
    }

    fn estimators(&self) -> Vec<String> {
        let depth = self.depth.map_or("any number of".to_string(), |depth| format!("up to {depth}"));
        vec![format!(
            "paths of {depth} surfaces; the sun by a ray from each, the sky over open facets in closed form, one ray a surface \
             and lobe for the rest, two below the horizon and above it where the sensor sees the surface"
        )]
    }

    fn trace(&self, scenery: &Scenery, sight: &Sight<'_>, draw: &Draw, stream: &mut Stream, paths: &mut Paths) {
        let Draw { replicate, hit, looks } = *draw;
        let id = paths.samples.len() as u32;
        let (line, sight) = (*sight, &sight.ray);
        let Some(hit) = hit else {
            paths.samples.push(Sample::new(replicate, None, 0.0, if looks > 0.0 { 0.0 } else { f64::NAN }));
            if self.directional_sky || sight.direction.cos_zenith() <= 0.0 {
                paths.look_out(id, sight.direction);
            } else {
                paths.record(id, ONE, Source::MeanSky, 1.0, Term::SkyDirect);
                let source = Source::Disk { direction: sight.direction, density: f64::INFINITY };
                paths.record(id, ONE, source, 1.0, Term::SkyDirect);
            }
            return;
        };
        let vertex = paths.vertices.len() as u32;
        paths.samples.push(Sample::new(replicate, Some(vertex), hit.t, f64::NAN));
        let past = Past { straight: true, mirrors: 0, by_lobe: false };
        let first = Step { hit, outgoing: -sight.direction, spectrum: ONE, weight: 1.0, begun: 1.0, depth: 1, past };
        let mut walk = Walk { scenery, sight: line, id, looks, room: std::mem::take(&mut paths.room) };
        walk.room.waiting.push(first);
        while let Some(step) = walk.room.waiting.pop() {
            paths.looked = step.past.is_looked();
            self.scatter(&mut walk, &step, stream, paths);
        }
        (paths.room, paths.looked) = (walk.room, false);
        let sample = &mut paths.samples[id as usize];
        if looks > 0.0 && sample.sky_view.is_nan() {
            // Nothing Lambertian looked at the sky from there: F is for the truth map alone.
            let direction = hemisphere_direction(&hit, stream);
            let up = direction.cos_zenith() > 0.0;
            paths.rays.hemisphere += u64::from(up);
            sample.sky_view = f64::from(u8::from(up && !scenery.world.occluded(&hit.leave(direction))));
        }
    }

    fn knows_even(&self) -> bool {
        self.cached
    }

    fn trace_even(
        &self,
        scenery: &Scenery,
        sight: &Sight<'_>,
        hit: &Hit,
        stream: &mut Stream,
        paths: &mut Paths,
    ) -> bool {
        let surface = scenery.surface(hit.material);
        if surface.bsdf.lobes() != (Lobes { diffuse: true, ..Lobes::default() }) {
            return false;
        }
        let outgoing = -sight.ray.direction;
        let mut room = std::mem::take(&mut paths.room);
        let even = surface.bsdf.lambertian(Frame::about(hit.normal).to_local(outgoing), &mut room.rho);
        let id = paths.samples.len() as u32;
        paths.samples.push(Sample::new(0, Some(paths.vertices.len() as u32), hit.t, 0.0));
        let past = Past { straight: true, mirrors: 0, by_lobe: false };
        let step = Step { hit: *hit, outgoing, spectrum: ONE, weight: 1.0, begun: 1.0, depth: 1, past };
        let mut walk = Walk { scenery, sight: *sight, id, looks: 1.0, room };
        let is_open = hit.normal.z == 1.0 && scenery.world.is_open(hit.facet, hit.front);
        let is_even = even == 1.0 && (is_open || self.between_points(&mut walk, &step, paths));
        if is_even {
            let direct = self.direct(&mut walk, &step, stream, paths);
            let of_even = direct.and_then(|direct| Some((direct.vertex, direct.of_even?)));
            if let Some((vertex, spectrum)) = of_even.filter(|_| is_open) {
                self.open(&mut walk, &step, vertex, spectrum, stream, paths);
            }
        } else {
            paths.samples.truncate(id as usize);
        }
        paths.room = walk.room;
        is_even
    }
}

impl Full {
    /// Whether a path of `depth` surfaces may meet another.
    fn goes_on(&self, depth: u32) -> bool {
        depth < self.depth.unwrap_or(DEPTH_LIMIT)
    }

    /// In how many mirrors in a row the sun is looked for from a surface of a path; `None` for none.
    fn caustic_bounces(&self, scenery: &Scenery, depth: u32) -> Option<u8> {
        let looks = self.caustics && self.goes_on(depth) && !scenery.mirrors.is_empty();
        looks.then(|| if self.goes_on(depth + 1) { IMAGED } else { 1 })
    }

    /// What a surface emits and what it scatters of the sun; `None` where it scatters nothing.
    #[inline(always)]
    fn direct(&self, walk: &mut Walk<'_>, step: &Step, stream: &mut Stream, paths: &mut Paths) -> Option<Direct> {
        let (scenery, id) = (walk.scenery, walk.id);
        let Step { hit, spectrum, weight, depth, past, .. } = *step;
        let surface = scenery.surface(hit.material);
        if let Some(emission) = surface.emission.as_ref().filter(|_| hit.front) {
            let spectrum = paths.times(spectrum, |q| emission[q]);
            paths.record(id, spectrum, Source::Own, weight, step.term(Term::Emission));
        }
        let vertex = paths.vertex(hit, past.straight, stream.later());
        let lobes = surface.bsdf.lobes();
        if lobes == Lobes::default() {
            return None;
        }
        let outgoing = Frame::about(hit.normal).to_local(step.outgoing);
        let even = surface.bsdf.lambertian(outgoing, &mut walk.room.rho);
        let has_rest = lobes.glossy || lobes.transmission || lobes.diffuse && even == 0.0;
        let of_even = (even > 0.0).then(|| {
            let rho = &walk.room.rho;
            paths.times(spectrum, |q| rho[q])
        });
        if let Some(spectrum) = of_even {
            paths.record(id, spectrum, Source::Sun { vertex }, weight / PI, step.term(Term::DiffuseSun));
        }
        if has_rest {
            let source = Source::Scatter { vertex, outgoing };
            paths.record(id, spectrum, source, weight, step.term(Term::SpecularSun));
        }
        if let Some(bounces) = self.caustic_bounces(scenery, depth).filter(|_| of_even.is_some() || has_rest) {
            paths.record(id, spectrum, Source::Caustic { vertex, outgoing, bounces }, weight, Term::Caustic);
        }
        Some(Direct { vertex, outgoing, even, of_even, has_rest })
    }

    /// One surface: what it emits, what it scatters of the sun, and where the path goes on.
    fn scatter(&self, walk: &mut Walk<'_>, step: &Step, stream: &mut Stream, paths: &mut Paths) {
        let (scenery, id) = (walk.scenery, walk.id);
        let Step { hit, spectrum, weight, past, .. } = *step;
        let surface = scenery.surface(hit.material);
        let Some(direct) = self.direct(walk, step, stream, paths) else { return };
        let Direct { vertex, outgoing, even, of_even, has_rest } = direct;
        let lobes = surface.bsdf.lobes();
        if past.straight {
            if lobes.mirror {
                self.mirror(walk, step, surface, outgoing, 1.0, stream, paths);
            }
            if let Some(spectrum) = of_even
                && !(self.cached && self.between_points(walk, step, paths))
                && walk.looks > 0.0
            {
                let looking = Step { weight: step.weight * walk.looks, ..*step };
                paths.looked = true;
                self.open(walk, &looking, vertex, spectrum, stream, paths);
                paths.looked = false;
            }
            if has_rest {
                let [a, b] = stream.next2();
                let draw = [a, b, stream.next1() * (1.0 - even)];
                self.rest(walk, step, surface, outgoing, draw, 1.0 / (1.0 - even), stream, paths);
            }
            return;
        }
        let open = of_even.filter(|_| scenery.world.is_open(hit.facet, hit.front));
        if let Some(spectrum) = open {
            paths.rays.hemisphere_open += 1;
            let (source, share) = self.whole_sky(&hit);
            paths.record(id, spectrum, source, weight * share, step.term(Term::DiffuseSky));
        }
        let left = paths.peak(spectrum) * weight.abs() / step.begun * most_reflected(surface);
        let mut weight = weight;
        if !roulette(&mut weight, ROULETTE * left, stream) {
            return;
        }
        let choice = if even < 1.0 { stream.next1() } else { 1.0 };
        match of_even.filter(|_| choice >= 1.0 - even) {
            Some(spectrum) => {
                let share = if open.is_some() { 1.0 - open_sky_view(hit.normal) } else { 1.0 };
                if share > 0.0 {
                    let direction = match open {
                        Some(_) => below_horizon(hit.normal, stream.next2()),
                        None => hemisphere_direction(&hit, stream),
                    };
                    let next = Step { spectrum, weight: weight * share / even, ..*step };
                    let met = self.look(walk, &next, direction, past.by_lobe, stream, paths);
                    if met == Met::Sky {
                        self.record_sky(walk.id, &next, direction, step.term(Term::DiffuseSky), paths);
                    }
                }
            }
            None => {
                let [a, b] = stream.next2();
                self.rest(walk, &Step { weight, ..*step }, surface, outgoing, [a, b, choice], 1.0, stream, paths);
            }
        }
    }

    /// The whole sky over a facet that only the horizon obstructs.
    fn whole_sky(&self, hit: &Hit) -> (Source, f64) {
        match self.directional_sky {
            true => (Source::OpenSky { normal: hit.normal, unless: None }, 1.0),
            false => (Source::MeanSky, open_sky_view(hit.normal)),
        }
    }

    fn record_sky(&self, id: u32, step: &Step, direction: WorldDir, term: Term, paths: &mut Paths) {
        let source = if self.directional_sky { Source::Sky { direction, seen: None } } else { Source::MeanSky };
        paths.record(id, step.spectrum, source, step.weight, term);
    }

    /// What the Lambertian part of what the sensor sees takes of sky and background from points around it; false where it is to look
    /// for itself.
    fn between_points(&self, walk: &mut Walk<'_>, step: &Step, paths: &mut Paths) -> bool {
        let hit = &step.hit;
        let world = &walk.scenery.world;
        // Without a background nothing tells how near things are; over open level facets the sky has a closed form.
        let is_closed = hit.normal.z == 1.0 && world.is_open(hit.facet, hit.front);
        if step.depth > 1 || !self.goes_on(1) || is_closed {
            return false;
        }
        let Some(squares) = paths.horizons.squares(hit, step.outgoing) else { return false };
        let Some(mut cache) = paths.cache.take() else { return false };
        let gather = |place: &Place<'_>, of_points: &mut Paths| {
            let gathered = self.gather(walk.scenery, place, of_points);
            paths.rays += std::mem::take(&mut of_points.rays);
            gathered
        };
        let taken = cache.take(world, hit, (walk.id, squares, &walk.sight), gather);
        paths.cache = Some(cache);
        let Some((taken, sky_view)) = taken else { return false };
        paths.taken.push(taken);
        if walk.looks > 0.0 {
            paths.samples[walk.id as usize].sky_view = sky_view;
        }
        true
    }

    /// Looks from a point of a facet, for all that will be interpolated there.
    fn gather(&self, scenery: &Scenery, place: &Place<'_>, paths: &mut Paths) -> Gathered {
        let Place { hit, sight, numbers: [seed, view, stream], each } = *place;
        let past = Past { straight: true, mirrors: 0, by_lobe: false };
        let outgoing = -sight.ray.direction;
        let first = Step { hit, outgoing, spectrum: ONE, weight: 1.0, begun: 1.0, depth: 1, past };
        let mut walk = Walk { scenery, sight, id: 0, looks: 1.0, room: std::mem::take(&mut paths.room) };
        scenery.surface(hit.material).bsdf.lambertian(Frame::about(hit.normal).to_local(outgoing), &mut walk.room.rho);
        let rho = &walk.room.rho;
        let spectrum = paths.times(ONE, |q| rho[q]);
        let (mut gathered, n) = (Gathered::default(), REPLICATES as f64 * f64::from(each));
        // Replicates take their turns in one sequence: all together fill the hemisphere more evenly than each alone.
        let numbers = Stream::new(seed, view, stream, 0, 0);
        for replicate in 0..REPLICATES as u32 {
            for i in 0..each {
                let mut stream = numbers.at(replicate * each + i);
                walk.id = paths.samples.len() as u32;
                let vertex = paths.vertex(hit, true, stream.later());
                paths.samples.push(Sample::new(replicate as u8, Some(vertex), hit.t, 0.0));
                self.open(&mut walk, &first, vertex, spectrum, &mut stream, paths);
                gathered.sky_view += paths.samples[walk.id as usize].sky_view / n;
                // What was met waits to be scattered at.
                let near = walk.room.waiting.iter().map(|next| next.weight.abs() / next.hit.t).sum::<f64>();
                gathered.nearness += near / n;
                while let Some(step) = walk.room.waiting.pop() {
                    self.scatter(&mut walk, &step, &mut stream, paths);
                }
            }
        }
        paths.room = walk.room;
        gathered
    }

    /// The Lambertian part of a surface that the sensor sees: the sky above the horizon, and what stands before it or lies
    /// below.
    fn open(
        &self,
        walk: &mut Walk<'_>,
        step: &Step,
        vertex: u32,
        spectrum: SpectrumId,
        stream: &mut Stream,
        paths: &mut Paths,
    ) {
        let (hit, id) = (step.hit, walk.id);
        let term = step.term(Term::DiffuseSky);
        let share = open_sky_view(hit.normal);
        let is_open = walk.scenery.world.is_open(hit.facet, hit.front);
        let mut seen = share;
        if is_open {
            paths.rays.hemisphere_open += 1;
            let (source, share) = self.whole_sky(&hit);
            paths.record(id, spectrum, source, step.weight * share, term);
        } else if hit.normal.z > -1.0 {
            // Below the horizon of the patch a ray looks; what lies above is free.
            let place = stream.next2();
            let horizon = paths.horizons.at(&walk.scenery.world, &hit, step.outgoing);
            let hidden = horizon.map_or(1.0, |index| paths.horizons.get(index).share());
            if self.directional_sky {
                let whole = Source::OpenSky { normal: hit.normal, unless: Some(vertex) };
                paths.record(id, spectrum, whole, step.weight, term);
            }
            let source = match horizon {
                Some(horizon) if self.directional_sky => Source::FreeSky { vertex, horizon, place },
                _ => Source::MeanSky,
            };
            paths.record(id, spectrum, source, step.weight * share * (1.0 - hidden), term);
            seen = share * (1.0 - hidden);
            if hidden > 0.0 {
                let place = match horizon {
                    Some(index) => paths.horizons.get(index).hidden(place),
                    None => concentric_disk(place),
                };
                let direction = above_horizon(hit.normal, place);
                let above = Step { spectrum, weight: step.weight * share * hidden, ..*step };
                let escaped = self.look(walk, &above, direction, false, stream, paths) == Met::Sky;
                if step.depth == 1 {
                    paths.samples[id as usize].sky_ray = share * hidden * if escaped { 1.0 } else { -1.0 };
                }
                if self.directional_sky {
                    let source = Source::Sky { direction, seen: Some((vertex, escaped)) };
                    paths.record(id, spectrum, source, above.weight, term);
                } else if escaped {
                    paths.record(id, spectrum, Source::MeanSky, above.weight, term);
                }
                seen += if escaped { share * hidden } else { 0.0 };
            }
        }
        if step.depth == 1 {
            paths.samples[id as usize].sky_view = seen;
        }
        if share < 1.0 && self.goes_on(step.depth) {
            let direction = below_horizon(hit.normal, stream.next2());
            let below = Step { spectrum, weight: step.weight * (1.0 - share), ..*step };
            self.look(walk, &below, direction, false, stream, paths);
        }
    }

    /// The mirror, drawn with a probability.
    #[allow(clippy::too_many_arguments)]
    fn mirror(
        &self,
        walk: &mut Walk<'_>,
        step: &Step,
        surface: &Surface,
        outgoing: LocalDir,
        probability: f64,
        stream: &mut Stream,
        paths: &mut Paths,
    ) {
        surface.bsdf.mirror(outgoing, &mut walk.room.rho);
        let rho = &walk.room.rho;
        let spectrum = paths.times(step.spectrum, |q| rho[q]);
        let direction = Frame::about(step.hit.normal).to_world(outgoing.mirrored());
        let past = Past { mirrors: step.past.mirrors.saturating_add(1), ..step.past };
        let next = Step { spectrum, weight: step.weight / probability, past, ..*step };
        paths.rays.mirror += 1;
        let by_lobe = step.past.by_lobe || step.past.straight;
        if self.look_by(walk, &next, direction, by_lobe, past.straight, stream, paths) == Met::Sky {
            let term = step.term(Term::SpecularSky);
            self.record_sky(walk.id, &next, direction, term, paths);
            // A surface that scatters finds the sun in up to two mirrors by itself.
            if past.straight || self.sun_disk && self.caustics && past.mirrors > IMAGED {
                let source = Source::Disk { direction, density: f64::INFINITY };
                paths.record(walk.id, spectrum, source, next.weight, step.term(Term::SpecularSun));
            }
        }
    }

    /// A draw of the model that its Lambertian part does not answer; `scale` is how much denser such draws lie than the model
    /// says, where none goes to that part.
    #[allow(clippy::too_many_arguments)]
    fn rest(
        &self,
        walk: &mut Walk<'_>,
        step: &Step,
        surface: &Surface,
        outgoing: LocalDir,
        draw: [f64; 3],
        scale: f64,
        stream: &mut Stream,
        paths: &mut Paths,
    ) {
        let Some(sample) = surface.bsdf.sample(outgoing, draw) else { return };
        if sample.mirror {
            if !step.past.straight {
                self.mirror(walk, step, surface, outgoing, sample.pdf, stream, paths);
            }
            return;
        }
        let density = surface.bsdf.rest(sample.incident, outgoing, &mut walk.room.f);
        if density <= 0.0 {
            return;
        }
        let f = &walk.room.f;
        let spectrum = paths.times(step.spectrum, |q| f[q]);
        if paths.peak(spectrum) == 0.0 {
            return;
        }
        let direction = Frame::about(step.hit.normal).to_world(sample.incident);
        let weight = step.weight * sample.incident.cos().abs() / (density * scale);
        let past = Past { mirrors: 0, ..step.past };
        let next = Step { spectrum, weight, past, ..*step };
        let by_lobe = step.past.by_lobe || step.past.straight;
        if self.look(walk, &next, direction, by_lobe, stream, paths) == Met::Sky {
            self.record_sky(walk.id, &next, direction, step.term(Term::SpecularSky), paths);
            if self.sun_disk {
                let source = Source::Disk { direction, density };
                paths.record(walk.id, spectrum, source, weight, step.term(Term::SpecularSun));
            }
        }
    }

    /// Looks along a direction from a surface that scatters.
    fn look(
        &self,
        walk: &mut Walk<'_>,
        step: &Step,
        direction: WorldDir,
        by_lobe: bool,
        stream: &mut Stream,
        paths: &mut Paths,
    ) -> Met {
        paths.rays.hemisphere += 1;
        let past = Past { mirrors: 0, ..step.past };
        self.look_by(walk, &Step { past, ..*step }, direction, by_lobe, false, stream, paths)
    }

    /// Looks along a direction; what is met waits to be scattered at.
    #[allow(clippy::too_many_arguments)]
    fn look_by(
        &self,
        walk: &mut Walk<'_>,
        step: &Step,
        direction: WorldDir,
        by_lobe: bool,
        straight: bool,
        stream: &mut Stream,
        paths: &mut Paths,
    ) -> Met {
        let ray = step.hit.leave(direction);
        let world = &walk.scenery.world;
        let sky = || if direction.cos_zenith() > 0.0 { Met::Sky } else { Met::Nothing };
        if !self.goes_on(step.depth) {
            return if sky() == Met::Sky && !world.occluded(&ray) { Met::Sky } else { Met::Nothing };
        }
        let Some(hit) = world.closest(&ray) else { return sky() };
        let depth = step.depth + 1;
        let mut weight = step.weight;
        // No further surface where nothing is left, and fewer where little is.
        let left = paths.peak(step.spectrum) * weight.abs();
        if left == 0.0 {
            return Met::Surface;
        }
        if straight && depth > MIRROR_ROULETTE_FROM && !roulette(&mut weight, left / step.begun, stream) {
            return Met::Surface;
        }
        // A path begins where the sensor ceases to see it.
        let begun = if step.past.straight { left } else { step.begun };
        let past = Past { straight, mirrors: step.past.mirrors, by_lobe };
        let (spectrum, weight) = paths.balanced(step.spectrum, weight);
        walk.room.waiting.push(Step { hit, outgoing: -direction, spectrum, weight, begun, depth, past });
        Met::Surface
    }
}

/// Goes on with a chance, and then with as much more weight.
fn roulette(weight: &mut f64, chance: f64, stream: &mut Stream) -> bool {
    if chance < 1.0 {
        if stream.next1() >= chance {
            return false;
        }
        *weight /= chance;
    }
    true
}

/// The most that a surface scatters of what it receives, or 1 where its components do not tell.
fn most_reflected(surface: &Surface) -> f64 {
    let lobes = surface.bsdf.lobes();
    if lobes.mirror || lobes.glossy || lobes.transmission { 1.0 } else { surface.brightest.min(1.0) }
}

/// What a ray found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Met {
    Sky,
    Surface,
    /// The black below a scene without ground, or something beyond the last surface.
    Nothing,
}
