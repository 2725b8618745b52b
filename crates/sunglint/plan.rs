//! What runs, what is skipped, and why. The last place where a scene can fail: after it only writing can.

mod light;
mod parts;
mod sharing;
mod skips;
mod spectra;
mod view;

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use sunglint_atmosphere::Needs;
use sunglint_dsl::scene::{self, Accuracy, Experiment, ModelUse, Sensor};
use sunglint_dsl::{Diagnostic, Scene, Severity, Sources};
use sunglint_geometry::World;
use sunglint_plugin::{BindError, SpectralValue, Value};
use sunglint_radiometry::{Channels, SpectralGrid};
use sunglint_reflectance::Bsdf;
use sunglint_sensor::{Band, Camera, Ccd};
use sunglint_tracer::{
    Algorithm, BandMeans, Illumination, Lighting, Nodes, Scenery, Surface, Tile, spectra_of, tile_side,
};

use crate::air::Air;
use crate::lit::{Light, Lit};
use crate::products::MapProjection;
use crate::selection::{Crop, is_experiment, is_time, wanted};
use crate::times::Moment;
use crate::{Checked, Readout, Refused, grid, scenery, times};

pub(crate) use self::sharing::traced_together;
pub use self::sharing::{BandShare, Sharing};
pub(crate) use self::skips::dark_skip;

use self::light::{Asked, SkyOrder, Told, ground_albedo, in_vain, path_heights};
use self::skips::{run_skips, scene_skips};
use self::spectra::{corners_of, is_per_band};
use self::view::{map_of, scan_note, unknown};

/// Most samples a pixel under `error`.
const MOST_SAMPLES: u32 = 4096;
/// Least samples a pixel under `time`.
pub(crate) const LEAST_SAMPLES: u32 = 16;
/// Bytes of solved light, and of the tiles that it makes, that are kept at a time.
const LIGHT_AT_ONCE: usize = 1 << 30;
/// Tiles that threads have in work at a time, near enough.
const TILES_AT_ONCE: usize = 8;

/// What a user may change without touching the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Pixels in place of every sensor's own: the same view, coarser or finer.
    pub pixels: Option<(u32, u32)>,
    /// Samples a pixel in place of every experiment's accuracy.
    pub samples: Option<u32>,
    /// Experiments to keep: a name with all runs of its sweeps, a run's name (`haze/visibility=5km,seed=1`), or a name with
    /// some of its values (`haze/seed=1`); all where empty.
    pub experiments: Vec<String>,
    /// Frames to keep, by label (`1992-06-18T160000Z`), instant or beginning of a label; all where empty.
    pub times: Vec<String>,
    /// Sensors to keep; all where empty.
    pub sensors: Vec<String>,
    /// Bands to keep; all where empty. The others' bins leave the spectral grid, those that remain are the same.
    pub bands: Vec<String>,
    /// A rectangle of every view in place of the whole: its pixels are those of the whole view to the bit.
    pub crop: Option<Crop>,
    /// Factor on every sensor's own pixels, where `pixels` says nothing.
    pub scale: Option<f64>,
    /// The air is solved for all that it can tell, not only for what the algorithm asks.
    pub whole_sky: bool,
    /// Bytes of solved light that are kept at a time, 1 GiB where nothing is said. A plan whose light is more is rendered in
    /// parts; with 0 no air is solved before it is needed.
    pub light_at_once: Option<usize>,
}

/// Something that will not be computed, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Skip {
    /// What.
    pub what: String,
    /// Why.
    pub why: String,
}

/// What a selection leaves out of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Bands of the sensor.
    pub bands: usize,
    /// Times of its collections.
    pub times: usize,
}

/// One experiment with one sensor: a view with all its times.
pub struct Run {
    /// Name of the experiment's run: `haze/reflectance=phong,visibility=5km`, or `haze` where it sweeps nothing.
    pub experiment: String,
    /// Swept values by name.
    pub sweep: Vec<(String, String)>,
    /// Constants that the experiment gives another value, as written.
    pub constants: Vec<(String, String)>,
    /// Name of the sensor.
    pub sensor: String,
    /// Where its pixels look.
    pub camera: Arc<dyn Camera>,
    /// Pixels across and down that are rendered: those of the window.
    pub pixels: (u32, u32),
    /// Where they lie in the whole view, which has the camera's pixels.
    pub window: Tile,
    /// The part of the bands and times that is left out.
    pub left_out: LeftOut,
    /// The times.
    pub moments: Vec<Moment>,
    /// The spectral grid.
    pub grid: SpectralGrid,
    /// Output channels.
    pub channels: Channels,
    /// What the tracer folds spectra into: the output channels and then, where counts are asked for, one for each band that
    /// the detector's photons weigh.
    pub traced: Channels,
    /// The detector, where counts are asked for.
    pub readout: Option<Readout>,
    /// Where pixels lie on the map, of a sensor that looks straight down.
    pub map: Option<MapProjection>,
    /// Azimuth of +y, east of true north \[rad\].
    pub convergence: f64,
    /// Geometry and surfaces.
    pub scenery: Scenery,
    /// The wavelengths that stand for each channel.
    pub nodes: Nodes,
    /// By material id, the model that it takes, on the spectral grid.
    pub bsdfs: Vec<Option<Arc<dyn Bsdf>>>,
    /// The radiance algorithm.
    pub algorithm: Arc<dyn Algorithm>,
    /// Its name.
    pub algorithm_name: String,
    /// Name of the atmosphere.
    pub atmosphere_name: String,
    /// What is asked of its atmosphere.
    sky: SkyOrder,
    /// The light of all times, where it is kept.
    kept: Option<Arc<Light>>,
    /// The plan's parts that it stands in, each with its times there.
    parts: Vec<(usize, Range<usize>)>,
    /// How accurate; under `time` the least, [`Lit::samples_within`] gives what fits.
    pub accuracy: sunglint_tracer::Accuracy,
    /// Seconds that rendering may take, under `time`.
    pub budget: Option<f64>,
    /// Seed of the experiment.
    pub seed: u64,
    /// Products.
    pub products: scene::Products,
    /// For each material in use, the model that it takes.
    pub models: BTreeMap<String, String>,
    /// Columns of air that were solved for it, but for those that an earlier run asks for too.
    pub columns_solved: usize,
    /// What is skipped.
    pub skips: Vec<Skip>,
    /// Estimators of the algorithm.
    pub estimators: Vec<String>,
    /// What was assumed or estimated in solving its columns of air.
    pub air_notes: Vec<String>,
    /// What object ids mean, ascending.
    pub objects: Vec<scenery::ObjectIds>,
    /// Names by code of the materials in use, ascending.
    pub materials: Vec<(u16, String)>,
    /// Hash of everything that the frames depend on.
    pub key: String,
    /// Tells sensors apart in the sampler.
    pub view_id: u64,
}

impl Run {
    /// The light of one time.
    pub fn light(&self, time: usize) -> Arc<Illumination> {
        match &self.kept {
            Some(light) => light.of(time).clone(),
            None => light::solve(&[(&self.sky, time..time + 1)]).remove(0).remove(0),
        }
    }

    /// The run at all times; their light is solved where it is not kept, and takes what memory it needs.
    pub fn lit(&self) -> Lit<'_> {
        self.lit_at(0..self.moments.len())
    }

    /// The run in parts, each with no more light than is kept at a time: one where the plan's whole light is.
    pub fn lit_parts(&self) -> impl Iterator<Item = Lit<'_>> {
        self.parts().map(|times| self.lit_at(times))
    }

    /// The times of each part.
    pub fn parts(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.parts.iter().map(|(_, times)| times.clone())
    }

    /// A time, with those that its number of samples depends on.
    pub(crate) fn lit_about(&self, time: usize) -> Lit<'_> {
        let part = self
            .parts()
            .find(|times| times.contains(&time))
            .filter(|_| self.kept.is_some() || matches!(self.accuracy, sunglint_tracer::Accuracy::Error { .. }));
        self.lit_at(part.unwrap_or(time..time + 1))
    }

    /// The light of all times, where it is kept.
    pub(crate) fn kept(&self) -> Option<&Light> {
        self.kept.as_deref()
    }

    /// The run at some of its times.
    pub(crate) fn lit_at(&self, times: Range<usize>) -> Lit<'_> {
        let light = match &self.kept {
            Some(light) if times == (0..self.moments.len()) => light.clone(),
            _ => Arc::new(Light::new(self, light::solve(&[(&self.sky, times.clone())]).remove(0))),
        };
        Lit::new(self, times, light)
    }

    /// Bytes that it keeps for each time beside the sky: what [`Light`] makes of it, and images of the tiles in work.
    fn bytes_per_time(&self) -> usize {
        /// Of each channel, spectra that stand for the sky, and values of the amounts of them and of lines of sight.
        const SPECTRA: usize = 8;
        const AMOUNTS: usize = 4096;
        size_of::<f64>() * self.traced.len() * (SPECTRA * self.grid.len() + AMOUNTS)
            + TILES_AT_ONCE * (tile_side(self.camera.pixels()) as usize).pow(2) * self.tile_bytes()
    }
}

/// A checked scene, bound and ready to render.
pub struct Plan {
    runs: Vec<Run>,
    /// Title of the scene.
    pub title: Option<String>,
    /// Warnings of the check and of the plan.
    pub warnings: Vec<Diagnostic>,
    /// Files of the scene, for messages.
    pub sources: Sources,
    /// Files that were read, with their hashes.
    pub files: BTreeMap<String, String>,
    /// Names of the materials, by material id.
    pub materials: Vec<String>,
    /// What the scene as a whole skips.
    pub skips: Vec<Skip>,
    /// Facets of the largest world, instances counted each.
    pub facets: usize,
    /// Bytes of the acceleration structures and geometry of all distinct worlds.
    pub geometry_bytes: usize,
    /// Seconds in which the air of all runs was solved; of a plan in parts it is solved when they are rendered.
    pub air_seconds: f64,
}

impl Plan {
    /// Binds a scene: opens meshes, builds geometry, resolves times, binds models, solves the air.
    ///
    /// # Errors
    /// Every fault that can be found in one go.
    pub fn new(checked: Checked, options: &Options) -> Result<Self, Refused> {
        let Checked { scene, sources, mut diagnostics, files } = checked;
        let materials = scene.iter().flat_map(|scene| &scene.materials).map(|material| material.name.clone()).collect();
        let planned = scene.filter(|_| !has_error(&diagnostics)).and_then(|scene| {
            let hashes = files.hashes().clone();
            plan_worlds(&scene, options, &mut diagnostics, &hashes)
        });
        once_each(&mut diagnostics);
        match planned {
            Some(Planned { runs, skips, facets, geometry_bytes, air_seconds, title }) if !has_error(&diagnostics) => {
                Ok(Self {
                    runs,
                    title,
                    warnings: diagnostics,
                    sources,
                    files: files.hashes().clone(),
                    materials,
                    skips,
                    facets,
                    geometry_bytes,
                    air_seconds,
                })
            }
            _ => Err(Refused { sources, diagnostics }),
        }
    }

    /// The runs, experiment by experiment and sensor by sensor.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// What is solved and rendered together: runs, by their places, each with some of its times. One part where the light of all
    /// is kept.
    pub fn parts(&self) -> Vec<Vec<(usize, Range<usize>)>> {
        let n = self.runs.iter().flat_map(|run| &run.parts).map(|(part, _)| part + 1).max().unwrap_or(0);
        let mut parts = vec![Vec::new(); n];
        for (i, run) in self.runs.iter().enumerate() {
            run.parts.iter().for_each(|(part, times)| parts[*part].push((i, times.clone())));
        }
        parts
    }

    /// Runs of a part under their light, each sky solved once.
    pub(crate) fn lit(&self, part: &[(usize, Range<usize>)]) -> Vec<Lit<'_>> {
        let runs = || part.iter().map(|(i, times)| (&self.runs[*i], times.clone()));
        let dark: Vec<_> = runs().filter(|(run, _)| run.kept.is_none()).collect();
        let mut solved =
            light::solve(&dark.iter().map(|(run, times)| (&run.sky, times.clone())).collect::<Vec<_>>()).into_iter();
        runs()
            .map(|(run, times)| match run.kept {
                Some(_) => run.lit_at(times),
                None => {
                    let light = solved.next().expect("light of each run that keeps none");
                    Lit::new(run, times, Arc::new(Light::new(run, light)))
                }
            })
            .collect()
    }

    /// The run of an experiment and sensor, by their full names.
    pub fn run(&self, experiment: &str, sensor: &str) -> Option<&Run> {
        self.runs.iter().find(|run| run.experiment == experiment && run.sensor == sensor)
    }
}

fn has_error(diagnostics: &[Diagnostic]) -> bool {
    diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error)
}

struct Planner<'s, 'd> {
    scene: &'s Scene,
    options: &'d Options,
    diagnostics: &'d mut Vec<Diagnostic>,
    hashes: &'d BTreeMap<String, String>,
}

struct Planned {
    runs: Vec<Run>,
    skips: Vec<Skip>,
    facets: usize,
    geometry_bytes: usize,
    air_seconds: f64,
    title: Option<String>,
}

/// What the runs of all worlds share, and what they come to.
#[derive(Default)]
struct Shared<'a> {
    /// Surfaces by model, arguments and grid.
    surfaces: HashMap<blake3::Hash, Arc<dyn Bsdf>>,
    geometries: Vec<Geometry<'a>>,
    /// Names of the frames of all runs, before the selection of times.
    labels: Vec<String>,
    /// Fields of the weather, and whether any atmosphere uses them.
    asked: Asked,
    /// Runs that fell before their atmosphere could say what it uses.
    unheard: usize,
    drafts: Vec<Draft>,
    skips: Vec<Skip>,
}

/// A run before its atmosphere is asked: what all runs ask of one column is known only when the last is drafted.
struct Draft {
    /// Place of its experiment among all of the scene.
    order: usize,
    run: Run,
}

/// Geometry that was built, with all that it depends on.
struct Geometry<'a> {
    scene: &'a Scene,
    /// Where the sensors stand; empty where no panel faces one.
    faced: Vec<DVec3>,
    world: Arc<World>,
    objects: Vec<scenery::ObjectIds>,
    unopened: Vec<String>,
    surface: scenery::Surface,
}

/// Plans a scene under each of its sets of constants.
fn plan_worlds(
    scene: &Scene,
    options: &Options,
    diagnostics: &mut Vec<Diagnostic>,
    hashes: &BTreeMap<String, String>,
) -> Option<Planned> {
    let names: Vec<&str> = scene.runs().iter().map(|(_, run)| run.name.as_str()).collect();
    let mut bases: Vec<&str> = scene.runs().iter().map(|(_, run)| run.base.as_str()).collect();
    bases.dedup();
    let is_one = |wanted: &str, _: &str| names.iter().any(|name| is_experiment(wanted, name));
    diagnostics.extend(unknown("experiment", &options.experiments, &bases, is_one));
    let is_wanted = |run: &Experiment| wanted(&options.experiments, |name| is_experiment(name, &run.name));
    let mut shared = Shared::default();
    let mut complete = true;
    for world in scene.worlds().filter(|world| world.experiments.iter().any(is_wanted)) {
        complete &= Planner { scene: world, options, diagnostics, hashes }.plan(&is_wanted, &mut shared).is_some();
    }
    let Shared { geometries, mut labels, asked, unheard, drafts, mut skips, .. } = shared;
    // What is left out, or could not be bound, may use what the rest does not.
    if options.is_whole() && complete && unheard == 0 {
        diagnostics.extend(in_vain(&asked));
    }
    if !has_error(diagnostics) {
        labels.sort_unstable();
        labels.dedup();
        let known: Vec<&str> = labels.iter().map(String::as_str).collect();
        diagnostics.extend(unknown("time", &options.times, &known, is_time));
    }
    let orders: Vec<&SkyOrder> = drafts.iter().map(|draft| &draft.run.sky).collect();
    let (told, n_shared) = light::check(&orders, diagnostics);
    if n_shared > 0 {
        skips.push(Skip {
            what: format!("{n_shared} solves of the air"),
            why: "another run has the same column, suns and grid".into(),
        });
    }
    let mut drafts: Vec<Draft> = (drafts.into_iter().zip(told))
        .filter_map(|(mut draft, told)| {
            let Told { columns, notes } = told?;
            (draft.run.columns_solved, draft.run.air_notes) = (columns, notes);
            Some(draft)
        })
        .collect();
    drafts.sort_by_key(|draft| draft.order);
    let mut runs: Vec<Run> = drafts.into_iter().map(|draft| draft.run).collect();
    let solving = Instant::now();
    if !has_error(diagnostics) {
        divide(&mut runs, options.light_at_once.unwrap_or(LIGHT_AT_ONCE));
    }
    let air_seconds = solving.elapsed().as_secs_f64();
    if runs.is_empty() && !has_error(diagnostics) {
        diagnostics.push(
            Diagnostic::whole("X01", "nothing is left to render: no experiment, sensor and time go together")
                .help("see the `sensor` and `collect` lines of the experiments and sensors"),
        );
    }
    complete.then(|| Planned {
        runs,
        skips,
        facets: geometries.iter().map(|known| known.world.facet_count()).max().unwrap_or(0),
        geometry_bytes: geometries.iter().map(|known| known.world.memory_bytes()).sum(),
        air_seconds,
        title: scene.title.clone(),
    })
}

/// Solves the light of all runs and keeps it where it takes no more than `limit` bytes; else cuts the runs into parts.
fn divide(runs: &mut [Run], limit: usize) {
    let (mut unders, mut skies, mut bytes) = (HashMap::new(), HashMap::new(), Vec::new());
    let asked: Vec<parts::Asked> = (runs.iter())
        .map(|run| {
            let of_sky = run.sky.sky_bytes();
            let times = (run.sky.skies().zip(&run.moments))
                .map(|((under, sky), moment)| {
                    let sky = parts::numbered(&mut skies, sky);
                    bytes.resize(skies.len(), 0);
                    bytes[sky] = of_sky.max(bytes[sky]);
                    let at = moment.utc.map_or(0.0, |utc| utc.0);
                    parts::OfTime { at, under: parts::numbered(&mut unders, under), sky }
                })
                .collect();
            parts::Asked { times, own: run.bytes_per_time() }
        })
        .collect();
    for (part, of_part) in parts::parts(&asked, &bytes, limit).into_iter().enumerate() {
        of_part.into_iter().for_each(|(run, times)| runs[run].parts.push((part, times)));
    }
    if parts::whole(&asked, &bytes) <= limit {
        let all: Vec<_> = runs.iter().map(|run| (&run.sky, 0..run.moments.len())).collect();
        let solved = light::solve(&all);
        for (run, light) in runs.iter_mut().zip(solved) {
            let light = Light::new(run, light);
            run.skips.extend(dark_skip(light.dark(), run.moments.len()));
            run.kept = Some(Arc::new(light));
        }
    }
}

/// Leaves each finding once: runs and worlds that share a fault tell of it alike.
fn once_each(diagnostics: &mut Vec<Diagnostic>) {
    let mut seen = HashSet::new();
    diagnostics.retain(|fault| seen.insert((fault.code, fault.span, fault.message.clone())));
}

impl<'s> Planner<'s, '_> {
    /// Plans the wanted experiments of one world.
    fn plan(&mut self, is_wanted: &dyn Fn(&Experiment) -> bool, shared: &mut Shared<'s>) -> Option<()> {
        let scene = self.scene;
        let before = self.diagnostics.len();
        let mut cameras: Vec<Option<Arc<dyn Camera>>> = Vec::new();
        for sensor in &scene.sensors {
            match scenery::camera(scene, sensor, self.options.pixels_of(sensor.pixels)) {
                Ok(camera) => cameras.push(Some(camera.into())),
                Err(diagnostic) => {
                    self.diagnostics.push(diagnostic);
                    cameras.push(None);
                }
            }
        }
        let positions: Vec<DVec3> =
            cameras.iter().map(|camera| camera.as_ref().map_or(DVec3::ZERO, |camera| camera.position())).collect();
        let built = self.geometry(&positions, shared);
        let bands: Vec<Vec<Band>> =
            scene.sensors.iter().map(|sensor| scenery::bands(sensor, self.diagnostics)).collect();
        let built = built?;
        self.check_selection(&bands, &cameras);
        if has_error(&self.diagnostics[before..]) {
            return None;
        }
        let Geometry { world, objects, unopened, surface, .. } = &shared.geometries[built];
        let (world, objects) = (world.clone(), objects.clone());
        for ((sensor, camera), bands) in scene.sensors.iter().zip(&cameras).zip(&bands) {
            self.warn_of_view(sensor, camera.as_deref()?, &world, surface);
            self.check_detector(sensor, bands);
        }
        for skip in scene_skips(scene, unopened, &world) {
            if !shared.skips.contains(&skip) {
                shared.skips.push(skip);
            }
        }
        for experiment in scene.experiments.iter().filter(|run| is_wanted(run)) {
            for &s in &experiment.sensors {
                let keeps = |band: &Band| wanted(&self.options.bands, |name| name == band.name);
                if !wanted(&self.options.sensors, |name| name == scene.sensors[s].name) || !bands[s].iter().any(keeps) {
                    continue;
                }
                let camera = cameras[s].clone()?;
                let draft = self.draft(experiment, s, camera, &bands[s], &world, &objects, shared);
                shared.drafts.extend(draft);
            }
        }
        Some(())
    }

    /// The geometry of this world, built once for all worlds in which it is the same.
    fn geometry(&mut self, positions: &[DVec3], shared: &mut Shared<'s>) -> Option<usize> {
        let scene = self.scene;
        let faces =
            |shape: &scene::Shape| matches!(shape, scene::Shape::Panel { facing: scene::Facing::Sensor(_), .. });
        let faced = if scene.world.iter().any(faces) { positions.to_vec() } else { Vec::new() };
        let known = shared.geometries.iter().position(|known| {
            let same = known.scene;
            known.faced == faced
                && (same.ground, &same.terrain, &same.world, &same.objects)
                    == (scene.ground, &scene.terrain, &scene.world, &scene.objects)
        });
        if known.is_some() {
            return known;
        }
        let scenery::Built { world, objects, unopened, surface } = scenery::build(scene, positions, self.diagnostics)?;
        shared.geometries.push(Geometry { scene, faced, world: Arc::new(world), objects, unopened, surface });
        Some(shared.geometries.len() - 1)
    }

    #[allow(clippy::too_many_arguments)]
    fn draft(
        &mut self,
        experiment: &Experiment,
        sensor_index: usize,
        camera: Arc<dyn Camera>,
        bands: &[Band],
        world: &Arc<World>,
        objects: &[scenery::ObjectIds],
        shared: &mut Shared,
    ) -> Option<Draft> {
        let scene = self.scene;
        let sensor = &scene.sensors[sensor_index];
        let mut moments: Vec<(Moment, Air)> = Vec::new();
        let elevation = scene.site.map_or(0.0, |site| site.elevation);
        for c in experiment.collects.iter().filter(|c| sensor.collects.contains(c)) {
            let air = Air::new(self.weather(*c, experiment), elevation, self.diagnostics);
            let found = times::moments(scene, *c, &air, self.diagnostics);
            moments.extend(found.into_iter().map(|moment| (moment, air.clone())));
        }
        moments.sort_by(|a, b| a.0.utc.map(|t| t.0).unwrap_or(0.0).total_cmp(&b.0.utc.map(|t| t.0).unwrap_or(0.0)));
        make_labels_unique(scene, &mut moments);
        let n_times = moments.len();
        if !self.options.times.is_empty() {
            shared.labels.extend(moments.iter().map(|(moment, _)| moment.label.clone()));
            moments.retain(|(moment, _)| wanted(&self.options.times, |time| is_time(time, &moment.label)));
        }
        for (moment, air) in &mut moments {
            *air = air.at(moment.utc, self.diagnostics);
        }
        if moments.is_empty() {
            return None;
        }
        shared.unheard += 1;
        let before = self.diagnostics.len();

        // A provisional grid tells what nodes, g-points and aerosol the provider wants.
        let mut uses = Self::model_uses(scene, experiment);
        uses.push((None, &experiment.atmosphere));
        let detector = sensor.ccd.as_ref().filter(|_| experiment.products.counts);
        let spectra = |uses: &[(Option<usize>, &ModelUse)]| {
            let args = || uses.iter().map(|(_, use_)| &use_.args).chain(detector.map(|use_| &use_.args));
            let owned = args().any(is_per_band)
                || scene.materials.iter().any(|m| m.used && matches!(m.emission, Some(SpectralValue::PerBand(_))));
            (args().flat_map(corners_of).collect::<Vec<Vec<f64>>>(), owned)
        };
        let (corners, owned) = spectra(&uses);
        let (provisional, names) = grid::bins(bands, &corners, owned);
        let provisional = SpectralGrid::new(provisional, names);
        self.cover(&uses, bands);
        if has_error(&self.diagnostics[before..]) {
            return None;
        }
        let provider = self.bind(&experiment.atmosphere, sunglint_atmosphere::BUILTIN, &provisional)?;
        let unused = Self::check_weather(provider.as_ref(), &experiment.atmosphere, &moments, &mut shared.asked);
        shared.unheard -= 1;
        let mut aerosols: Vec<(Option<usize>, &ModelUse)> = Vec::new();
        if provider.uses().contains(&"aerosol") {
            for aerosol in moments.iter().filter_map(|(_, air)| air.weather.aerosol.as_ref()) {
                if !aerosols.iter().any(|(_, known)| *known == aerosol) {
                    aerosols.push((None, aerosol));
                }
            }
        }
        self.cover(&aerosols, bands);
        uses.extend(&aerosols);
        let (mut corners, owned) = spectra(&uses);
        corners.push(provider.nodes());
        let (bins, names) = grid::bins(bands, &corners, owned);
        // What is left out takes its bins along; the cuts stay, so that no value of what remains depends on it.
        let (all_bands, n_bands) = (bands, bands.len());
        let kept: Vec<Band> =
            bands.iter().filter(|band| wanted(&self.options.bands, |name| name == band.name)).cloned().collect();
        let bands = kept.as_slice();
        let whole_grid = SpectralGrid::with_g(bins.clone(), names.clone(), |bin| provider.g_weights(bin));
        let bins = grid::bins_of(bins, &names, bands);
        let grid = SpectralGrid::with_g(bins, names, |bin| provider.g_weights(bin));
        // The provider binds them itself, where nobody knows their place any more.
        for (_, aerosol) in &aerosols {
            self.bind(aerosol, sunglint_atmosphere::AEROSOLS, &grid);
        }
        let provider = self.bind(&experiment.atmosphere, sunglint_atmosphere::BUILTIN, &grid)?;
        let algorithm = self.bind(&experiment.algorithm, sunglint_tracer::BUILTIN, &grid)?;
        let channels = grid::channels(&grid, bands);
        let (traced, readout) = self.traced(experiment, sensor_index, bands, &grid)?;

        let bsdfs = self.bsdfs(experiment, &grid, &mut shared.surfaces);
        if has_error(&self.diagnostics[before..]) {
            return None;
        }
        let bsdfs = bsdfs?;
        // Surfaces are those of all bands, whatever is left out: lobes are drawn by what they return in all.
        let lighting = algorithm.lighting();
        let (nodes, scenery) = match bands.len() == n_bands {
            true => self.scenery(experiment, &lighting, &grid, &traced, &bsdfs, world, shared)?,
            false => {
                let (of_all, _) = self.traced(experiment, sensor_index, all_bands, &whole_grid)?;
                let all_bsdfs = self.bsdfs(experiment, &whole_grid, &mut shared.surfaces)?;
                let (nodes, scenery) =
                    self.scenery(experiment, &lighting, &whole_grid, &of_all, &all_bsdfs, world, shared)?;
                let place = |band: &Band| all_bands.iter().position(|all| all.name == band.name);
                let kept: Vec<usize> = (0..traced.len())
                    .filter_map(|c| Some(c / bands.len() * n_bands + place(&bands[c % bands.len()])?))
                    .collect();
                (nodes.of_some((&whole_grid, &of_all), &kept, (&grid, &traced)), scenery)
            }
        };
        let needs = match self.options.whole_sky {
            // Whoever reads it may ask for the paths of other sensors too, and from z = 0 where they meet nothing.
            true => Needs {
                direct_beam: true,
                diffuse_irradiance: true,
                directional_sky: provider.has_directional_sky(),
                path: true,
                path_heights: None,
            },
            false => {
                let needs = algorithm.needs(&scenery);
                Needs { path_heights: needs.path.then(|| path_heights(world, camera.as_ref())), ..needs }
            }
        };
        let albedo = match algorithm.lighting().adjacency {
            true => ground_albedo(scene, world, &bsdfs, grid.len()),
            false => vec![0.0; grid.len()],
        };
        let sky = self.sky_order(experiment, provider.clone(), &moments, &grid, needs, &albedo);

        let (width, height) = camera.pixels();
        let whole = Tile { x: 0, y: 0, width, height };
        let window = self.options.crop.map_or(Some(whole), |crop| crop.within(camera.pixels()))?;
        let mut estimators = algorithm.estimators();
        if nodes.are_means() {
            estimators.push("light and reflectances by their means over each band, multiplied: `spectral band`".into());
        } else {
            let n: usize = (0..traced.len()).map(|c| traced.runs(c).len()).sum();
            estimators.push(format!(
                "spectra of paths at {} wavelengths for {n} of all channels: means of a spectrum within 5e-5, of a product of two 2e-4",
                nodes.len()
            ));
        }
        estimators.extend(provider.report());
        estimators.extend(scan_note(scene, sensor, &moments));
        let map = map_of(scene, sensor, camera.as_ref(), world).map(|map| map.of_window(window.x, window.y));
        let accuracy = match (self.options.samples, experiment.accuracy) {
            (Some(samples), _) => sunglint_tracer::Accuracy::Samples(samples),
            (None, Accuracy::Samples(samples)) => sunglint_tracer::Accuracy::Samples(samples),
            (None, Accuracy::Error { relative, floor, every_pixel }) => {
                sunglint_tracer::Accuracy::Error { relative, floor, most: MOST_SAMPLES, every_pixel }
            }
            (None, Accuracy::Time { .. }) => sunglint_tracer::Accuracy::Samples(LEAST_SAMPLES),
        };
        let budget = match experiment.accuracy {
            Accuracy::Time { seconds } if self.options.samples.is_none() => Some(seconds),
            _ => None,
        };
        let models = (uses.iter())
            .filter_map(|(material, use_)| {
                let label = use_.label.as_ref().map_or(String::new(), |label| format!(" {label}"));
                material.map(|m| (scene.materials[m].name.clone(), format!("{}{label}", use_.name)))
            })
            .collect();
        let mut skips = run_skips(algorithm.as_ref(), &scenery, bands, &grid);
        skips.extend(unused);
        let run = Run {
            experiment: experiment.name.clone(),
            sweep: experiment.sweep.clone(),
            constants: experiment.constants.clone(),
            sensor: sensor.name.clone(),
            pixels: (window.width, window.height),
            window,
            left_out: LeftOut { bands: n_bands - bands.len(), times: n_times - moments.len() },
            key: self.key(experiment, sensor, camera.pixels(), window, &moments),
            camera,
            moments: moments.into_iter().map(|(moment, _)| moment).collect(),
            grid,
            channels,
            traced,
            readout,
            map,
            convergence: scene.site.map_or(0.0, |site| site.convergence),
            scenery,
            nodes,
            bsdfs,
            algorithm,
            algorithm_name: experiment.algorithm.name.clone(),
            atmosphere_name: experiment.atmosphere.name.clone(),
            sky,
            kept: None,
            parts: Vec::new(),
            accuracy,
            budget,
            seed: experiment.seed,
            products: experiment.products,
            models,
            columns_solved: 0,
            skips,
            estimators,
            air_notes: Vec::new(),
            objects: objects.to_vec(),
            materials: material_codes(scene),
            view_id: sensor_index as u64,
        };
        Some(Draft { order: experiment.order, run })
    }

    /// A detector's spectra: their values and the bands that they must cover.
    fn check_detector(&mut self, sensor: &Sensor, bands: &[Band]) {
        let Some(use_) = &sensor.ccd else { return };
        if let Err(error) = Ccd::check(&use_.args) {
            self.refuse(use_, &error);
        }
        for (name, value) in use_.args.iter() {
            if let (Value::Spectrum(value), Some(place)) = (value, use_.param_spans.get(name)) {
                self.cover_value(value, bands, *place, name, "V03");
            }
        }
    }

    /// What the tracer folds spectra into: the bands and, where counts are asked for, their electrons.
    fn traced(
        &mut self,
        experiment: &Experiment,
        sensor_index: usize,
        bands: &[Band],
        grid: &SpectralGrid,
    ) -> Option<(Channels, Option<Readout>)> {
        let channels = grid::channels(grid, bands);
        if !experiment.products.counts {
            return Some((channels, None));
        }
        let (electrons, readout) = self.readout(experiment, sensor_index, bands, grid)?;
        Some((channels.joined(electrons), Some(readout)))
    }

    /// The detector that an experiment's counts come from, and the channels of its electrons.
    fn readout(
        &mut self,
        experiment: &Experiment,
        sensor_index: usize,
        bands: &[Band],
        grid: &SpectralGrid,
    ) -> Option<(Channels, Readout)> {
        let sensor = &self.scene.sensors[sensor_index];
        let Some(use_) = &sensor.ccd else {
            let message = format!("`counts` need a detector, and sensor `{}` has none", sensor.name);
            let fault = Diagnostic::error("V01", sensor.span, message).label("`ccd { … }`?");
            return self.tell(fault.help("see `sunglint models ccd`; or leave `counts` out of the products"));
        };
        let ccd = self.bind(use_, sunglint_sensor::BUILTIN, grid)?;
        let place = use_.span.unwrap_or(sensor.span);
        if !ccd.missing.is_empty() {
            let lacks: Vec<String> = ccd.missing.iter().map(|name| format!("`{name}`")).collect();
            let fault = Diagnostic::error("S05", place, format!("`counts` need {} of this detector", lacks.join(", ")));
            return self.tell(fault.label(format!("{}?", lacks.join(", "))).help("see `sunglint models ccd`"));
        }
        match grid::electron_channels(grid, bands, &ccd.sensitivity) {
            Ok((channels, electrons)) => {
                let seeds = [experiment.seed, sensor_index as u64];
                Some((channels, Readout::new(ccd, electrons, sensor.projection, seeds)))
            }
            Err(band) => {
                let message = format!("this detector gives no electron in band `{}`", bands[band].name);
                let place = use_.param_spans.get("quantum_efficiency").copied().unwrap_or(place);
                self.tell(Diagnostic::error("V03", place, message).label("0 throughout the band"))
            }
        }
    }

    /// Reports a fault, once.
    fn tell<T>(&mut self, fault: Diagnostic) -> Option<T> {
        if !self.diagnostics.iter().any(|d| d.span == fault.span && d.message == fault.message) {
            self.diagnostics.push(fault);
        }
        None
    }

    /// Binds a model to a grid; a refusal points at the parameter.
    fn bind<T: ?Sized>(
        &mut self,
        use_: &ModelUse,
        known: &[sunglint_plugin::Model<T>],
        grid: &SpectralGrid,
    ) -> Option<Arc<T>> {
        let model = known.iter().find(|model| model.info.name == use_.name)?;
        match (model.bind)(&use_.args, grid) {
            Ok(bound) => Some(bound),
            Err(error) => {
                self.refuse(use_, &error);
                None
            }
        }
    }

    fn refuse(&mut self, use_: &ModelUse, error: &BindError) {
        let place = error.param.and_then(|param| use_.param_spans.get(param).copied()).or(use_.span);
        let mut diagnostic = match place {
            Some(place) => Diagnostic::error(error.code, place, format!("`{}`: {}", use_.name, error.message)),
            None => Diagnostic::whole(error.code, format!("`{}`: {}", use_.name, error.message)),
        };
        diagnostic.help = error.help.clone();
        if !self.diagnostics.contains(&diagnostic) {
            self.diagnostics.push(diagnostic);
        }
    }

    /// The models that an experiment uses, on a grid.
    fn bsdfs(
        &mut self,
        experiment: &Experiment,
        grid: &SpectralGrid,
        known: &mut HashMap<blake3::Hash, Arc<dyn Bsdf>>,
    ) -> Option<Vec<Option<Arc<dyn Bsdf>>>> {
        let scene = self.scene;
        let grid_key = blake3::hash(format!("{grid:?}").as_bytes());
        let mut bsdfs = Vec::new();
        for (m, material) in scene.materials.iter().enumerate() {
            let Some(chosen) = experiment.models[m].filter(|_| material.used) else {
                bsdfs.push(None);
                continue;
            };
            let use_ = &material.models[chosen];
            let key = blake3::hash(format!("{} {:?} {grid_key}", use_.name, use_.args).as_bytes());
            let bound = match known.get(&key) {
                Some(bound) => Some(bound.clone()),
                None => self.bind(use_, sunglint_reflectance::BUILTIN, grid),
            };
            known.extend(bound.iter().map(|bound| (key, bound.clone())));
            bsdfs.push(bound);
        }
        (scene.materials.iter().zip(&bsdfs)).all(|(m, bsdf)| !m.used || bsdf.is_some()).then_some(bsdfs)
    }

    /// The nodes for the models' spectra, and the world with the models bound there.
    #[allow(clippy::too_many_arguments)]
    fn scenery(
        &mut self,
        experiment: &Experiment,
        lighting: &Lighting,
        grid: &SpectralGrid,
        channels: &Channels,
        bsdfs: &[Option<Arc<dyn Bsdf>>],
        world: &Arc<World>,
        shared: &mut Shared,
    ) -> Option<(Nodes, Scenery)> {
        let scene = self.scene;
        let emissions: Vec<Option<Vec<f64>>> = (scene.materials.iter().zip(bsdfs))
            .map(|(material, bsdf)| {
                let emission = material.emission.as_ref().filter(|value| bsdf.is_some() && !value.is_zero())?;
                emission.on(grid).ok()
            })
            .collect();
        let mut spectra: Vec<Vec<f64>> = emissions.iter().flatten().cloned().collect();
        spectra.extend(bsdfs.iter().flatten().flat_map(|bsdf| spectra_of(bsdf.as_ref(), grid.len())));
        let few = Nodes::new(grid, channels, spectra.iter().map(Vec::as_slice));
        let at_nodes = self.bsdfs(experiment, &grid.picked(few.entries()), &mut shared.surfaces)?;
        let nodes = if lighting.band_means { Nodes::means(channels) } else { few.clone() };
        let surfaces = (scene.materials.iter().zip(bsdfs).zip(at_nodes).zip(emissions))
            .map(|(((material, bsdf), at_nodes), emission)| {
                let (at_nodes, of_grid) = (at_nodes?, bsdf.as_ref()?.split());
                let seen: Arc<dyn Bsdf> = match lighting.band_means {
                    true => Arc::new(BandMeans::new(at_nodes, &few, channels, of_grid)),
                    false => at_nodes,
                };
                let (split, emission) = (seen.split().clone(), emission.map(|l| nodes.of(channels, &l).into()));
                Some(Surface::new(seen, split, emission, material.code))
            })
            .collect();
        Some((nodes, Scenery::new(world.clone(), surfaces)))
    }

    /// Hash of everything that the frames of a run depend on: the program, every file, the options, the run's names.
    fn key(
        &self,
        experiment: &Experiment,
        sensor: &Sensor,
        pixels: (u32, u32),
        window: Tile,
        moments: &[(Moment, Air)],
    ) -> String {
        let mut hasher = blake3::Hasher::new();
        let mut feed = |part: &str| {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        };
        feed(env!("CARGO_PKG_VERSION"));
        feed(&experiment.name);
        feed(&sensor.name);
        feed(&format!("{pixels:?} {window:?} {:?} {:?}", self.options.samples, self.options.bands));
        moments.iter().for_each(|(moment, _)| feed(&moment.label));
        // Names of values may be cut; these are as written. Their order tells apart what is spelt alike.
        feed(&format!("{} {:?} {:?}", experiment.order, experiment.sweep, experiment.constants));
        for hash in self.hashes.values() {
            feed(hash);
        }
        hasher.finalize().to_hex().to_string()
    }
}

/// Names by code of the materials in use, ascending.
fn material_codes(scene: &Scene) -> Vec<(u16, String)> {
    let mut codes: Vec<(u16, String)> =
        scene.materials.iter().filter(|material| material.used).map(|m| (m.code, m.name.clone())).collect();
    codes.sort();
    codes
}

/// Frames of several collection sets may fall on one label: the set's name tells them apart.
fn make_labels_unique(scene: &Scene, moments: &mut [(Moment, Air)]) {
    let labels: Vec<String> = moments.iter().map(|(moment, _)| moment.label.clone()).collect();
    for (i, (moment, _)) in moments.iter_mut().enumerate() {
        if labels.iter().filter(|label| **label == labels[i]).count() > 1 {
            let set = &scene.collects[moment.collect];
            let name = set.name.clone().unwrap_or_else(|| format!("collect{}", moment.collect + 1));
            moment.label = format!("{}_{name}", labels[i]);
        }
    }
}
