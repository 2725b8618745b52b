//! The algorithms `ideal` [Stark1993, eqs. 3.10, 3.11] and `split` [Stark1993, eq. 4.1].
//!
//! Both trace a target and what stands around it, and differ in how a material answers: `ideal` takes it as either
//! diffuse or specular, `split` as both. Everything that the printed equations approximate can be lifted by name.

use std::f64::consts::{FRAC_PI_6, PI};
use std::sync::Arc;

use glam::DVec3;
use sunglint_atmosphere::Needs;
use sunglint_geometry::Hit;
use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::WorldDir;
use sunglint_reflectance::{AngularSpectra, Split};

use crate::algorithm::{Algorithm, Draw, Lighting};
use crate::hemisphere::{above_horizon, below_horizon, hemisphere_direction, open_sky_view};
use crate::paths::{GlintLaw, ONE, Paths, Sample, Source, SpectrumId};
use crate::pixel::Term;
use crate::sun::half_angle;
use crate::{Scenery, Sight, Stream, Surface};

/// Surfaces after which an unlimited path is played with Russian roulette.
const ROULETTE_FROM: u32 = 8;
/// Surfaces after which an unlimited path ends: between perfect reflectors roulette alone would not end it.
const DEPTH_LIMIT: u32 = 4096;

/// Every approximation of the published equations, each of which can be lifted alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approximations {
    /// The radiometrically consistent form (else the printed one).
    pub corrected: bool,
    /// The sky behind F is directional (else isotropic).
    pub directional_sky: bool,
    /// F follows from the tilt alone (else from rays, with the closed form where nothing obstructs).
    pub slope_sky_view: bool,
    /// The background is the average of what the hemisphere rays hit (else the first of them).
    pub average_background: bool,
    /// The background has its own F (else the target's).
    pub own_background_sky: bool,
    /// The background reflects at its actual view angle (else at 30°).
    pub actual_background_angle: bool,
    /// The background reflects with all its lobes (else diffusely).
    pub all_background_lobes: bool,
    /// The specular lobe's overlap with the sun's disk conserves energy (else a flag).
    pub conserving_glint: bool,
    /// The sun is a disk (else a point).
    pub sun_disk: bool,
    /// Surfaces of a path; `None` is unlimited.
    pub depth: Option<u32>,
    /// Quantities are averaged over bands before they are multiplied.
    pub band_means: bool,
    /// The ground's albedo brightens the sky.
    pub adjacency: bool,
    /// Hemisphere rays a sample.
    pub rays: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Treatment {
    /// Either diffuse or specular.
    Ideal,
    /// Both.
    Split,
}

struct Published {
    treatment: Treatment,
    with: Approximations,
}

const fn choice(
    name: &'static str,
    words: &'static [&'static str],
    default: &'static str,
    help: &'static str,
) -> Param {
    Param::word(name, words, Default::Word(default), help)
}

const READING: Param =
    choice("reading", &["published", "corrected"], "published", "equations as printed, or radiometrically consistent");
const SKY: Param = choice("sky", &["isotropic", "directional"], "isotropic", "sky behind F: its mean, or L_d(θ, φ)");
const SKY_VIEW: Param =
    choice("sky_view", &["rays", "slope"], "rays", "F by hemisphere rays, or (1 + cos β)/2 whatever stands around");
const BACKGROUND: Param =
    choice("background", &["point", "average"], "point", "one background point a sample, or the mean of all hit");
const BACKGROUND_SKY: Param =
    choice("background_sky", &["target", "own"], "target", "F of the background: the target's, or its own");
const BACKGROUND_LOBES: Param =
    choice("background_lobes", &["diffuse", "all"], "diffuse", "how the background reflects");
const GLINT: Param = choice(
    "glint",
    &["published", "conserving"],
    "published",
    "sun in the specular lobe: a flag, or the overlap with the disk",
);
const SUN: Param = choice("sun", &["point", "disk"], "point", "the sun as a point or a disk of 0.533°");
const DEPTH: Param =
    Param::count("depth", &["unlimited"], Default::Count(2), "surfaces of a path; 2 is target and background")
        .within(1.0, 4096.0);
pub(crate) const SPECTRAL: Param =
    choice("spectral", &["wavelength", "band"], "wavelength", "products per wavelength, or of band means");
const ADJACENCY: Param = Param::switch("adjacency", true, "the ground's albedo brightens the sky");
const RAYS: Param =
    Param::count("rays", &[], Default::Count(1), "hemisphere rays a sample, where F has no closed form")
        .within(1.0, 1024.0);

/// `ideal`: each material either diffuse or specular.
pub const IDEAL: Model<dyn Algorithm> = Model {
    info: ModelInfo {
        name: "ideal",
        summary: "each material either diffuse or specular (Stark 1993, eqs. 3.10 and 3.11)",
        manual: include_str!("../manual/ideal.md"),
        params: &[
            READING,
            SKY,
            SKY_VIEW,
            BACKGROUND,
            BACKGROUND_SKY,
            choice(
                "background_angle",
                &["fixed", "actual"],
                "fixed",
                "background reflectance at 30°, or at its view angle",
            ),
            BACKGROUND_LOBES,
            GLINT,
            SUN,
            DEPTH,
            SPECTRAL,
            ADJACENCY,
            RAYS,
        ],
    },
    bind: |args, _| bind(Treatment::Ideal, args),
};

/// `split`: every material with both components.
pub const SPLIT: Model<dyn Algorithm> = Model {
    info: ModelInfo {
        name: "split",
        summary: "every material diffuse and specular by view angle (Stark 1993, eq. 4.1)",
        manual: include_str!("../manual/split.md"),
        params: &[
            READING,
            SKY,
            SKY_VIEW,
            BACKGROUND,
            BACKGROUND_SKY,
            choice(
                "background_angle",
                &["actual", "fixed"],
                "actual",
                "background reflectance at its view angle, or at 30°",
            ),
            BACKGROUND_LOBES,
            GLINT,
            SUN,
            DEPTH,
            SPECTRAL,
            ADJACENCY,
            RAYS,
        ],
    },
    bind: |args, _| bind(Treatment::Split, args),
};

fn bind(treatment: Treatment, args: &Args) -> Result<Arc<dyn Algorithm>, BindError> {
    let is = |name: &str, word: &str| args.word(name) == Some(word);
    let with = Approximations {
        corrected: is("reading", "corrected"),
        directional_sky: is("sky", "directional"),
        slope_sky_view: is("sky_view", "slope"),
        average_background: is("background", "average"),
        own_background_sky: is("background_sky", "own"),
        actual_background_angle: is("background_angle", "actual"),
        all_background_lobes: is("background_lobes", "all"),
        conserving_glint: is("glint", "conserving"),
        sun_disk: is("sun", "disk"),
        depth: args.count("depth").map(|depth| depth as u32),
        band_means: is("spectral", "band"),
        adjacency: args.switch("adjacency").unwrap_or(true),
        rays: args.count("rays").unwrap_or(1) as u32,
    };
    Ok(Arc::new(Published { treatment, with }))
}

/// How the sky seen from the target enters, for `background_sky target`.
#[derive(Clone, Copy)]
struct TargetSky {
    hit: Hit,
    /// F where it has a closed form.
    closed: Option<f64>,
}

/// Where a path stands.
#[derive(Clone, Copy)]
struct Step {
    hit: Hit,
    /// Towards where the path came from.
    outgoing: WorldDir,
    /// Product of the reflectances so far.
    spectrum: SpectrumId,
    weight: f64,
    /// Surfaces so far, this one included.
    depth: u32,
    /// The specular component of the target led here.
    by_mirror: bool,
}

impl Algorithm for Published {
    fn needs(&self, scenery: &Scenery) -> Needs {
        let _ = scenery;
        // Mirrors and lines of sight that leave the scene look into the sky itself, whatever stands behind F.
        Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None }
    }

    fn lighting(&self) -> Lighting {
        Lighting {
            sun_disk: self.with.sun_disk,
            limb_darkening: false,
            band_means: self.with.band_means,
            adjacency: self.with.adjacency,
        }
    }

    fn traced_by(&self) -> String {
        // These are said of its light.
        let traced = Approximations { sun_disk: false, band_means: false, adjacency: false, ..self.with };
        format!("{:?} {traced:?}", self.treatment)
    }

    fn skips(&self, scenery: &Scenery) -> Vec<String> {
        let mut skips = Vec::new();
        if !scenery.has_specular() {
            skips.push("no mirror rays: no material has a specular component (R_s = 0)".to_string());
        }
        if self.with.depth == Some(1) {
            skips.push("no background: depth 1".to_string());
        }
        if self.with.slope_sky_view {
            skips.push("no view-factor rays: `sky_view slope` takes F from the tilt".to_string());
        }
        if !self.with.directional_sky {
            skips.push("no sky directions behind F: `sky isotropic` takes the mean sky".to_string());
        }
        skips
    }

    fn estimators(&self) -> Vec<String> {
        let rays = self.with.rays;
        let points = if self.with.average_background { rays } else { 1 };
        vec![format!(
            "F and background by {rays} cosine-weighted ray{} a sample over what may hide the sky from the facet, {points} \
             background point{} a sample; closed forms where nothing rises above a facet's plane",
            if rays == 1 { "" } else { "s" },
            if points == 1 { "" } else { "s" },
        )]
    }

    fn trace(&self, scenery: &Scenery, sight: &Sight<'_>, draw: &Draw, stream: &mut Stream, paths: &mut Paths) {
        let (sight, Draw { replicate, hit, .. }) = (&sight.ray, *draw);
        let id = paths.samples.len() as u32;
        let Some(hit) = hit else {
            paths.samples.push(Sample::new(replicate, None, 0.0, 0.0));
            paths.look_out(id, sight.direction);
            return;
        };
        let vertex = self.vertex(hit, true, stream, paths);
        paths.samples.push(Sample::new(replicate, Some(vertex), hit.t, 0.0));
        let outgoing = -sight.direction;
        let step = Step { hit, outgoing, spectrum: ONE, weight: 1.0, depth: 1, by_mirror: false };
        self.target(scenery, id, vertex, &step, stream, paths);
    }
}

/// A spectrum times R(θ) of a component at a view angle.
fn times(paths: &mut Paths, spectrum: SpectrumId, table: &AngularSpectra, theta: f64) -> SpectrumId {
    let [(j, w), (k, v)] = table.weights(theta);
    let (a, b) = (table.spectrum(j), table.spectrum(k));
    paths.times(spectrum, |q| w * a[q] + v * b[q])
}

/// A spectrum times R_d(θ) + ρ_s(θ) of a surface.
fn times_total(paths: &mut Paths, spectrum: SpectrumId, surface: &Surface, theta: f64) -> SpectrumId {
    let Split { diffuse, specular, .. } = &surface.split;
    let ([(j, w), (k, v)], [(l, x), (m, y)]) = (diffuse.weights(theta), specular.weights(theta));
    let (a, b, c, d) = (diffuse.spectrum(j), diffuse.spectrum(k), specular.spectrum(l), specular.spectrum(m));
    paths.times(spectrum, |q| w * a[q] + v * b[q] + x * c[q] + y * d[q])
}

impl Published {
    fn vertex(&self, hit: Hit, first: bool, stream: &mut Stream, paths: &mut Paths) -> u32 {
        paths.vertex(hit, first, stream.later())
    }

    /// Whether a path of `depth` surfaces may meet another.
    fn goes_on(&self, depth: u32) -> bool {
        depth < self.with.depth.unwrap_or(DEPTH_LIMIT)
    }

    /// The first surface: both components, each with its sun, sky and background.
    fn target(&self, scenery: &Scenery, id: u32, vertex: u32, step: &Step, stream: &mut Stream, paths: &mut Paths) {
        let hit = &step.hit;
        let surface = scenery.surface(hit.material);
        let split = &surface.split;
        let theta = if surface.is_angular { angle(hit, step.outgoing) } else { 0.0 };
        if let Some(emission) = surface.emission.as_ref().filter(|_| hit.front) {
            let spectrum = paths.times(step.spectrum, |q| emission[q]);
            paths.record(id, spectrum, Source::Own, step.weight, Term::Emission);
        }
        let sky = self.sky_of(scenery, hit);
        paths.samples[id as usize].sky_view = sky.closed.unwrap_or(f64::NAN);

        // `ideal` is either, never both: the larger component at the nadir decides, and the total reflectance answers.
        let either = self.treatment == Treatment::Ideal;
        let printed = !self.with.corrected && !either;
        let has_specular = if either { surface.is_specular() } else { surface.has_specular };
        let has_diffuse = if either { !has_specular } else { surface.has_diffuse };
        if has_diffuse {
            let spectrum = match self.treatment {
                Treatment::Split => times(paths, step.spectrum, &split.diffuse, theta),
                Treatment::Ideal => {
                    let theta = if self.with.corrected { theta } else { 0.0 };
                    times_total(paths, step.spectrum, surface, theta)
                }
            };
            let step = Step { spectrum, ..*step };
            paths.record(id, spectrum, Source::Sun { vertex }, step.weight / PI, Term::DiffuseSun);
            self.hemisphere(scenery, id, &step, &sky, None, stream, paths);
        }
        if has_specular && surface.has_specular {
            let spectrum = match self.treatment {
                Treatment::Split if printed => times(paths, step.spectrum, &split.printed, theta),
                Treatment::Split => times(paths, step.spectrum, &split.specular, theta),
                Treatment::Ideal => times_total(paths, step.spectrum, surface, theta),
            };
            // The printed R_s may be a BRF; the overlap of lobe and disk takes the lobe's reflectance.
            let glint = match printed && self.with.conserving_glint {
                true => times(paths, step.spectrum, &split.specular, theta),
                false => spectrum,
            };
            let step = Step { spectrum, by_mirror: true, ..*step };
            self.mirror(scenery, id, vertex, &step, glint, split.lobe_solid_angle(theta), stream, paths);
        }
        if paths.samples[id as usize].sky_view.is_nan() {
            let seen = self.escape(scenery, hit, stream, paths).is_some();
            paths.samples[id as usize].sky_view = f64::from(u8::from(seen));
        }
    }

    /// The sky over a facet, with F where no ray is needed: by tilt where the scene asks for it, or where nothing but the
    /// ground rises above the facet's plane.
    fn sky_of(&self, scenery: &Scenery, hit: &Hit) -> TargetSky {
        let open = self.with.slope_sky_view || scenery.world.is_open(hit.facet, hit.front);
        TargetSky { hit: *hit, closed: open.then(|| open_sky_view(hit.normal)) }
    }

    /// The sky of a facet whose F has a closed form.
    fn closed_sky(&self, normal: DVec3, f: f64) -> (Source, f64) {
        if self.with.directional_sky { (Source::OpenSky { normal, unless: None }, 1.0) } else { (Source::MeanSky, f) }
    }

    /// The sky in a direction, or its mean, for which none is drawn.
    fn sky(&self, direction: impl FnOnce() -> WorldDir) -> Source {
        if self.with.directional_sky { Source::Sky { direction: direction(), seen: None } } else { Source::MeanSky }
    }

    /// A cosine-weighted ray from a facet; its direction where it meets nothing but sky.
    fn escape(&self, scenery: &Scenery, hit: &Hit, stream: &mut Stream, paths: &mut Paths) -> Option<WorldDir> {
        let direction = hemisphere_direction(hit, stream);
        if direction.cos_zenith() <= 0.0 {
            // Level or downwards: ground, or the black below a scene without one.
            return None;
        }
        paths.rays.hemisphere += 1;
        (!scenery.world.occluded(&hit.leave(direction))).then_some(direction)
    }

    /// Skylight that a facet reflects diffusely, and the light of what stands around it.
    ///
    /// With `other_sky`, the skylight is that of another facet (F of the target used for the background), and this
    /// facet's own rays look for surfaces only.
    #[allow(clippy::too_many_arguments)]
    fn hemisphere(
        &self,
        scenery: &Scenery,
        id: u32,
        step: &Step,
        own_sky: &TargetSky,
        other_sky: Option<&TargetSky>,
        stream: &mut Stream,
        paths: &mut Paths,
    ) {
        let first = step.depth == 1;
        let sky_term = if first { Term::DiffuseSky } else { background_term(step.by_mirror) };
        let looks_further = self.goes_on(step.depth);
        if let Some(other) = other_sky {
            match other.closed {
                Some(f) => {
                    let (source, weight) = self.closed_sky(other.hit.normal, f);
                    paths.record(id, step.spectrum, source, step.weight * weight, sky_term);
                }
                None => {
                    if let Some(direction) = self.escape(scenery, &other.hit, stream, paths) {
                        let source = self.sky(|| direction);
                        paths.record(id, step.spectrum, source, step.weight, sky_term);
                    }
                }
            }
        }
        let shows_sky = other_sky.is_none();
        if let Some(f) = own_sky.closed {
            paths.rays.hemisphere_open += 1;
            if shows_sky {
                let (source, weight) = self.closed_sky(own_sky.hit.normal, f);
                paths.record(id, step.spectrum, source, step.weight * weight, sky_term);
            }
            if looks_further && f < 1.0 {
                // All that is not sky lies below the horizon of the facet's hemisphere.
                let direction = below_horizon(step.hit.normal, stream.next2());
                paths.rays.hemisphere += 1;
                if let Some(hit) = scenery.world.closest(&step.hit.leave(direction)) {
                    self.background(scenery, id, step, hit, direction, step.weight * (1.0 - f), stream, paths);
                }
            }
            return;
        }
        if !shows_sky && !looks_further {
            return;
        }
        let rays = if first { self.with.rays } else { 1 };
        let normal = step.hit.normal;
        // What lies above the horizon of the patch is free; a ray looks for the rest.
        let horizon = first.then(|| paths.horizons.at(&scenery.world, &step.hit, step.outgoing)).flatten();
        let parts = horizon.map(|index| {
            let open = open_sky_view(normal);
            let hidden = open * paths.horizons.get(index).share();
            (index, hidden, if looks_further { 1.0 - open } else { 0.0 }, open - hidden)
        });
        let mut free = 0.0;
        let mut cast = 1.0;
        if let Some((index, hidden, below, above)) = parts {
            (free, cast) = (above, hidden + below);
            if free > 0.0 {
                let source = self.sky(|| above_horizon(normal, paths.horizons.get(index).free(stream.next2())));
                paths.record(id, step.spectrum, source, step.weight * free, sky_term);
            }
        }
        let share = step.weight * cast / f64::from(rays);
        let (mut seen, mut hits, mut point) = (0, 0, None);
        for _ in 0..if cast > 0.0 { rays } else { 0 } {
            let direction = match parts {
                Some((index, hidden, below, _)) => {
                    let place = stream.next2();
                    let is_below = below > 0.0 && stream.next1() * cast >= hidden;
                    match is_below {
                        true => below_horizon(normal, place),
                        false => above_horizon(normal, paths.horizons.get(index).hidden(place)),
                    }
                }
                None => hemisphere_direction(&step.hit, stream),
            };
            let ray = step.hit.leave(direction);
            paths.rays.hemisphere += 1;
            let met = if looks_further {
                scenery.world.closest(&ray)
            } else if scenery.world.occluded(&ray) {
                continue;
            } else {
                None
            };
            match met {
                Some(hit) if self.with.average_background => {
                    self.background(scenery, id, step, hit, direction, share, stream, paths);
                }
                Some(hit) => {
                    hits += 1;
                    point.get_or_insert((hit, direction));
                }
                None if direction.cos_zenith() > 0.0 => {
                    seen += 1;
                    if shows_sky {
                        let source = self.sky(|| direction);
                        paths.record(id, step.spectrum, source, share, sky_term);
                    }
                }
                None => {}
            }
        }
        if first {
            let sample = &mut paths.samples[id as usize];
            sample.sky_view = free + cast * f64::from(seen) / f64::from(rays);
            // One of the rays would change so much.
            sample.sky_ray = cast / f64::from(rays) * if seen == rays { 1.0 } else { -1.0 };
        }
        if let Some((hit, direction)) = point {
            self.background(scenery, id, step, hit, direction, share * f64::from(hits), stream, paths);
        }
    }

    /// What stands at `hit`, seen from the surface before it along `direction`.
    #[allow(clippy::too_many_arguments)]
    fn background(
        &self,
        scenery: &Scenery,
        id: u32,
        from: &Step,
        hit: Hit,
        direction: WorldDir,
        mut weight: f64,
        stream: &mut Stream,
        paths: &mut Paths,
    ) {
        let surface = scenery.surface(hit.material);
        let split = &surface.split;
        let depth = from.depth + 1;
        let mut before = from.spectrum;
        if depth.is_multiple_of(64) {
            (before, weight) = paths.balanced(before, weight);
        }
        let term = background_term(from.by_mirror);
        let outgoing = -direction;
        if let Some(emission) = surface.emission.as_ref().filter(|_| hit.front) {
            let spectrum = paths.times(before, |q| emission[q]);
            paths.record(id, spectrum, Source::Own, weight, term);
        }
        if depth > ROULETTE_FROM && self.with.depth.is_none() {
            let survival = surface.brightest.min(1.0);
            if stream.next1() >= survival {
                return;
            }
            weight /= survival;
        }
        // The diffuse part of the target sees R_b at a fixed angle where the equation says so; a mirror shows it at its own.
        let theta = match self.with.actual_background_angle || from.by_mirror {
            true if surface.is_angular => angle(&hit, outgoing),
            _ => FRAC_PI_6,
        };
        let mut share = 1.0;
        if self.with.all_background_lobes && self.goes_on(depth) && surface.has_specular {
            let (d, s) = surface.mean_components(theta);
            let specular = s / (s + d);
            if stream.next1() < specular {
                let spectrum = times(paths, before, &split.specular, theta);
                let vertex = self.vertex(hit, false, stream, paths);
                let weight = weight / specular;
                let step = Step { hit, outgoing, spectrum, weight, depth, by_mirror: from.by_mirror };
                self.mirror(scenery, id, vertex, &step, spectrum, split.lobe_solid_angle(theta), stream, paths);
                return;
            }
            share = 1.0 / (1.0 - specular);
        }
        let spectrum = match self.treatment {
            // `ideal` always takes the background as diffuse, whatever its label: its total reflectance answers.
            Treatment::Ideal => times_total(paths, before, surface, theta),
            Treatment::Split if surface.has_diffuse => times(paths, before, &split.diffuse, theta),
            Treatment::Split => return,
        };
        let vertex = self.vertex(hit, false, stream, paths);
        let weight = weight * share;
        paths.record(id, spectrum, Source::Sun { vertex }, weight / PI, term);
        let printed_mirror_without_sky = from.by_mirror && self.treatment == Treatment::Ideal && !self.with.corrected;
        let step = Step { hit, outgoing, spectrum, weight, depth, by_mirror: from.by_mirror };
        if printed_mirror_without_sky && !self.goes_on(depth) {
            // Eq. 3.11 gives the background of a mirror the sun alone.
            return;
        }
        let own = self.sky_of(scenery, &hit);
        let target = self.sky_of(scenery, &from.hit);
        let other = (!self.with.own_background_sky).then_some(&target);
        self.hemisphere(scenery, id, &step, &own, other, stream, paths);
    }

    /// The specular component: the sun (through the spectrum `glint`), the sky or a surface in the mirror direction.
    #[allow(clippy::too_many_arguments)]
    fn mirror(
        &self,
        scenery: &Scenery,
        id: u32,
        vertex: u32,
        step: &Step,
        glint: SpectrumId,
        solid_angle: f64,
        stream: &mut Stream,
        paths: &mut Paths,
    ) {
        let (normal, out) = (step.hit.normal, step.outgoing.vec());
        let direction = WorldDir::new(2.0 * normal.dot(out) * normal - out);
        paths.rays.mirror += 1;
        let met = scenery.world.closest(&step.hit.leave(direction));
        let first = step.depth == 1;
        let (sun_term, sky_term) =
            if first { (Term::SpecularSun, Term::SpecularSky) } else { [background_term(step.by_mirror); 2].into() };
        if self.treatment == Treatment::Ideal && !self.with.corrected && !self.with.conserving_glint {
            // Eq. 3.11: (E_s/π) I'_t τ₁ cos θ_s R(θ_v), without a test of the mirror direction.
            paths.record(id, step.spectrum, Source::Sun { vertex }, step.weight / PI, sun_term);
        } else {
            let law = match (self.with.corrected, self.with.conserving_glint) {
                (_, true) => GlintLaw::Conserving,
                (true, false) => GlintLaw::Lobe,
                (false, false) => GlintLaw::Printed,
            };
            let escaped = met.is_none() && direction.cos_zenith() > 0.0;
            let half_angle = half_angle(solid_angle);
            let source = Source::Glint { vertex, mirror: direction, escaped, solid_angle, half_angle, law };
            paths.record(id, glint, source, step.weight, sun_term);
        }
        match met {
            Some(hit) if self.goes_on(step.depth) => {
                self.background(scenery, id, step, hit, direction, step.weight, stream, paths);
            }
            None if direction.cos_zenith() > 0.0 => {
                paths.record(id, step.spectrum, Source::Sky { direction, seen: None }, step.weight, sky_term);
            }
            _ => {}
        }
    }
}

fn background_term(by_mirror: bool) -> Term {
    if by_mirror { Term::SpecularBackground } else { Term::DiffuseBackground }
}

/// Angle between a surface's normal and a direction that leaves it \[rad\].
fn angle(hit: &Hit, outgoing: WorldDir) -> f64 {
    hit.normal.dot(outgoing.vec()).clamp(0.0, 1.0).acos()
}
