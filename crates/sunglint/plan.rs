//! What runs, what is skipped, and why. The last place where a scene can fail: after it only writing can.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use glam::DVec3;
use sunglint_atmosphere::{Atmosphere, Cloud, Column, Needs, Sun};
use sunglint_dsl::scene::{self, Accuracy, Experiment, ModelUse, Sensor, Weather};
use sunglint_dsl::{Diagnostic, Scene, Severity, Sources, list, nearest};
use sunglint_geometry::{FacetId, MaterialId, World};
use sunglint_plugin::{Args, BindError, SpectralValue, TableKey, Value};
use sunglint_radiometry::{Channels, LocalDir, SpectralGrid};
use sunglint_reflectance::Bsdf;
use sunglint_sensor::{Band, Camera, Ccd};
use sunglint_tracer::{Algorithm, Illumination, Scenery, Surface, Tile};

use crate::air::Air;
use crate::products::MapProjection;
use crate::selection::{Crop, is_experiment, is_time, wanted};
use crate::times::Moment;
use crate::{Checked, Readout, Refused, grid, scenery, times};

/// Most samples a pixel under `error`.
const MOST_SAMPLES: u32 = 4096;
/// Least samples a pixel under `time`.
pub(crate) const LEAST_SAMPLES: u32 = 16;

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
    /// The radiance algorithm.
    pub algorithm: Arc<dyn Algorithm>,
    /// Its name.
    pub algorithm_name: String,
    /// Name of the atmosphere.
    pub atmosphere_name: String,
    /// The light of each time.
    pub light: Vec<Arc<Illumination>>,
    /// How accurate; under `time` the least, [`Run::samples_within`] gives what fits.
    pub accuracy: sunglint_tracer::Accuracy,
    /// Seconds that rendering may take, under `time`.
    pub budget: Option<f64>,
    /// Seed of the experiment.
    pub seed: u64,
    /// Products.
    pub products: scene::Products,
    /// For each material in use, the model that it takes.
    pub models: BTreeMap<String, String>,
    /// Columns of air that were solved.
    pub columns_solved: usize,
    /// What is skipped.
    pub skips: Vec<Skip>,
    /// Estimators of the algorithm.
    pub estimators: Vec<String>,
    /// What object ids mean, ascending.
    pub objects: Vec<scenery::ObjectIds>,
    /// Names by code of the materials in use, ascending.
    pub materials: Vec<(u16, String)>,
    /// Hash of everything that the frames depend on.
    pub key: String,
    /// Tells sensors apart in the sampler.
    pub view_id: u64,
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
            Some(Planned { runs, skips, facets, geometry_bytes, title }) if !has_error(&diagnostics) => Ok(Self {
                runs,
                title,
                warnings: diagnostics,
                sources,
                files: files.hashes().clone(),
                materials,
                skips,
                facets,
                geometry_bytes,
            }),
            _ => Err(Refused { sources, diagnostics }),
        }
    }

    /// The runs, experiment by experiment and sensor by sensor.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// The run of an experiment and sensor, by their full names.
    pub fn run(&self, experiment: &str, sensor: &str) -> Option<&Run> {
        self.runs.iter().find(|run| run.experiment == experiment && run.sensor == sensor)
    }
}

/// The object that shows its back to a point on all sides; what is below is not asked, since a house may have no floor.
fn encloses(world: &World, point: DVec3) -> Option<String> {
    let sides = [
        [0.1, 0.2, 1.0],
        [1.0, 0.1, 0.05],
        [-1.0, 0.2, 0.1],
        [0.2, 1.0, 0.05],
        [-0.1, -1.0, 0.1],
        [0.7, 0.6, 0.5],
        [-0.6, -0.7, 0.5],
    ];
    let mut object = None;
    for side in sides {
        let direction = sunglint_radiometry::WorldDir::from_unit(DVec3::from_array(side).normalize());
        let hit = world.closest(&sunglint_geometry::Ray::new(point, direction))?;
        if hit.front || hit.facet == FacetId::GROUND {
            return None;
        }
        object.get_or_insert(hit.instance);
    }
    match object? {
        scenery::SCENE_OBJECT => Some("a closed body of the scene".to_string()),
        placed => world.instances().iter().find(|i| i.id == placed).map(|i| format!("`{}`", i.name)),
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
    title: Option<String>,
}

/// What the runs of all worlds share, and what they come to.
#[derive(Default)]
struct Shared<'a> {
    solved: Solved,
    geometries: Vec<Geometry<'a>>,
    /// Names of the frames of all runs, before the selection of times.
    labels: Vec<String>,
    /// With their place among all runs of the scene.
    runs: Vec<(usize, Run)>,
    skips: Vec<Skip>,
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
    let Shared { solved, geometries, mut labels, mut runs, mut skips } = shared;
    if !has_error(diagnostics) {
        labels.sort_unstable();
        labels.dedup();
        let known: Vec<&str> = labels.iter().map(String::as_str).collect();
        diagnostics.extend(unknown("time", &options.times, &known, is_time));
    }
    if solved.shared > 0 {
        skips.push(Skip {
            what: format!("{} solves of the air", solved.shared),
            why: "another run has the same column, suns and grid".into(),
        });
    }
    if runs.is_empty() && !has_error(diagnostics) {
        diagnostics.push(
            Diagnostic::whole("X01", "nothing is left to render: no experiment, sensor and time go together")
                .help("see the `sensor` and `collect` lines of the experiments and sensors"),
        );
    }
    runs.sort_by_key(|(order, _)| *order);
    complete.then(|| Planned {
        runs: runs.into_iter().map(|(_, run)| run).collect(),
        skips,
        facets: geometries.iter().map(|known| known.world.facet_count()).max().unwrap_or(0),
        geometry_bytes: geometries.iter().map(|known| known.world.memory_bytes()).sum(),
        title: scene.title.clone(),
    })
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
                let (solved, labels) = (&mut shared.solved, &mut shared.labels);
                if let Some(run) = self.run(experiment, s, camera, &bands[s], &world, &objects, solved, labels) {
                    shared.runs.push((experiment.order, run));
                }
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

    /// Names of the selection that the scene does not have, and a crop beyond a view.
    fn check_selection(&mut self, bands: &[Vec<Band>], cameras: &[Option<Arc<dyn Camera>>]) {
        let (scene, options) = (self.scene, self.options);
        let mut known_bands: Vec<&str> = Vec::new();
        for (sensor, bands) in scene.sensors.iter().zip(bands) {
            for band in bands.iter().filter(|_| wanted(&options.sensors, |name| name == sensor.name)) {
                if !known_bands.contains(&band.name.as_str()) {
                    known_bands.push(&band.name);
                }
            }
        }
        let sensors: Vec<&str> = scene.sensors.iter().map(|sensor| sensor.name.as_str()).collect();
        let named = |wanted: &str, name: &str| wanted == name;
        self.diagnostics.extend(unknown("sensor", &options.sensors, &sensors, named));
        self.diagnostics.extend(unknown("band", &options.bands, &known_bands, named));
        let Some(crop) = options.crop else { return };
        for (sensor, camera) in scene.sensors.iter().zip(cameras) {
            let Some(camera) = camera.as_ref().filter(|_| wanted(&options.sensors, |name| name == sensor.name)) else {
                continue;
            };
            if crop.within(camera.pixels()).is_none() {
                let (width, height) = camera.pixels();
                self.diagnostics.push(
                    Diagnostic::whole(
                        "X01",
                        format!("crop {crop} reaches beyond sensor `{}`, {width} x {height} pixels", sensor.name),
                    )
                    .help(
                        "a crop is X,Y,WxH in pixels of the whole view as it is rendered, after `scale` and `--pixels`",
                    ),
                );
            }
        }
    }

    fn warn_of_view(&mut self, sensor: &Sensor, camera: &dyn Camera, world: &World, surface: &scenery::Surface) {
        let (w, h) = camera.pixels();
        if let Some(ground) = world.ground()
            && camera.position().z < ground.height
        {
            let depth = ground.height - camera.position().z;
            self.diagnostics.push(
                Diagnostic::warning(
                    "V02",
                    sensor.span,
                    format!("sensor `{}` stands {depth:.3} m below the ground", sensor.name),
                )
                .help("heights count from z = 0 of the scene, not from sea level"),
            );
        } else if let Some(object) = encloses(world, camera.position()) {
            self.diagnostics.push(
                Diagnostic::warning("V02", sensor.span, format!("sensor `{}` stands inside {object}", sensor.name))
                    .label("it sees the backs of facets all round")
                    .help("move the sensor, or the object"),
            );
        }
        let position = camera.position();
        if let Some(height) = surface.terrain.as_ref().and_then(|terrain| terrain.height_at(position.x, position.y))
            && position.z < height
        {
            let message = format!("sensor `{}` stands {:.1} m below the terrain", sensor.name, height - position.z);
            self.diagnostics.push(
                Diagnostic::warning("V02", sensor.span, message)
                    .label(format!("z above {height:.1} m?"))
                    .help("heights of a terrain count from z = 0, not from the terrain itself"),
            );
        }
        let (w, h) = (f64::from(w), f64::from(h));
        let sees = (0..=16).any(|i| {
            (0..=16).any(|j| {
                let ray = camera.ray(w * f64::from(i) / 16.0, h * f64::from(j) / 16.0);
                world.closest(&sunglint_geometry::Ray::new(ray.origin, ray.direction)).is_some()
            })
        });
        if !sees {
            self.diagnostics.push(
                Diagnostic::warning(
                    "V02",
                    sensor.span,
                    format!("sensor `{}` seems to see nothing of the scene", sensor.name),
                )
                .label("none of 289 lines of sight meets a facet")
                .help("check where it stands and looks, and its field of view"),
            );
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn run(
        &mut self,
        experiment: &Experiment,
        sensor_index: usize,
        camera: Arc<dyn Camera>,
        bands: &[Band],
        world: &Arc<World>,
        objects: &[scenery::ObjectIds],
        solved: &mut Solved,
        labels: &mut Vec<String>,
    ) -> Option<Run> {
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
            labels.extend(moments.iter().map(|(moment, _)| moment.label.clone()));
            moments.retain(|(moment, _)| wanted(&self.options.times, |time| is_time(time, &moment.label)));
        }
        for (moment, air) in &mut moments {
            *air = air.at(moment.utc, self.diagnostics);
        }
        if moments.is_empty() {
            return None;
        }
        let before = self.diagnostics.len();

        // A provisional grid tells what nodes and g-points the provider wants.
        let mut uses = Self::model_uses(scene, experiment);
        uses.push((None, &experiment.atmosphere));
        let detector = sensor.ccd.as_ref().filter(|_| experiment.products.counts);
        let args = || uses.iter().map(|(_, use_)| &use_.args).chain(detector.map(|use_| &use_.args));
        let corners: Vec<Vec<f64>> = args().flat_map(corners_of).collect();
        let owned = args().any(is_per_band)
            || scene.materials.iter().any(|m| m.used && matches!(m.emission, Some(SpectralValue::PerBand(_))));
        let (provisional, names) = grid::bins(bands, &corners, owned);
        let provisional = SpectralGrid::new(provisional, names);
        self.cover(&uses, bands);
        if has_error(&self.diagnostics[before..]) {
            return None;
        }
        let provider = self.bind(&experiment.atmosphere, sunglint_atmosphere::BUILTIN, &provisional)?;
        let mut corners = corners;
        corners.push(provider.nodes());
        let (bins, names) = grid::bins(bands, &corners, owned);
        // What is left out takes its bins along; the cuts stay, so that no value of what remains depends on it.
        let n_bands = bands.len();
        let kept: Vec<Band> =
            bands.iter().filter(|band| wanted(&self.options.bands, |name| name == band.name)).cloned().collect();
        let bands = kept.as_slice();
        let bins = grid::bins_of(bins, &names, bands);
        let grid = SpectralGrid::with_g(bins, names, |bin| provider.g_weights(bin));
        let provider = self.bind(&experiment.atmosphere, sunglint_atmosphere::BUILTIN, &grid)?;
        let algorithm = self.bind(&experiment.algorithm, sunglint_tracer::BUILTIN, &grid)?;
        let channels = grid::channels(&grid, bands);
        let (traced, readout) = match experiment.products.counts {
            true => {
                let (electrons, readout) = self.readout(experiment, sensor_index, bands, &grid)?;
                (channels.clone().joined(electrons), Some(readout))
            }
            false => (channels.clone(), None),
        };

        let scenery = self.surfaces(experiment, &grid, world, solved);
        if has_error(&self.diagnostics[before..]) {
            return None;
        }
        let scenery = scenery?;
        let needs = match self.options.whole_sky {
            true => Needs {
                direct_beam: true,
                diffuse_irradiance: true,
                directional_sky: provider.has_directional_sky(),
                path: true,
            },
            false => algorithm.needs(&scenery),
        };
        let albedo = match algorithm.lighting().adjacency {
            true => ground_albedo(scene, world, &scenery, grid.len()),
            false => vec![0.0; grid.len()],
        };
        let unused = self.check_weather(provider.as_ref(), &experiment.atmosphere, &moments);
        let (light, columns_solved) =
            self.light(experiment, provider.as_ref(), &moments, &grid, &needs, &albedo, solved)?;

        let (width, height) = camera.pixels();
        let whole = Tile { x: 0, y: 0, width, height };
        let window = self.options.crop.map_or(Some(whole), |crop| crop.within(camera.pixels()))?;
        let mut estimators = algorithm.estimators();
        estimators.extend(provider.report());
        estimators.extend(scan_note(scene, sensor, &moments));
        let map = map_of(scene, sensor, camera.as_ref(), world).map(|map| map.of_window(window.x, window.y));
        let mut skips = run_skips(algorithm.as_ref(), &scenery, bands, &grid, &light);
        skips.extend(unused);
        let accuracy = match (self.options.samples, experiment.accuracy) {
            (Some(samples), _) => sunglint_tracer::Accuracy::Samples(samples),
            (None, Accuracy::Samples(samples)) => sunglint_tracer::Accuracy::Samples(samples),
            (None, Accuracy::Error { relative, floor }) => {
                sunglint_tracer::Accuracy::Error { relative, floor, most: MOST_SAMPLES }
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
        Some(Run {
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
            algorithm,
            algorithm_name: experiment.algorithm.name.clone(),
            atmosphere_name: experiment.atmosphere.name.clone(),
            light,
            accuracy,
            budget,
            seed: experiment.seed,
            products: experiment.products,
            models,
            columns_solved,
            skips,
            estimators,
            objects: objects.to_vec(),
            materials: material_codes(scene),
            view_id: sensor_index as u64,
        })
    }

    /// The weather of a collection set as an experiment sees it: the set's own, or the scene's, with the experiment's
    /// fields in place of single ones.
    fn weather(&self, collect: usize, experiment: &Experiment) -> Weather {
        let base = match self.scene.collects[collect].weather {
            Some(named) => self.scene.weathers.get(named),
            None => self.scene.weathers.iter().find(|weather| weather.name.is_none()),
        };
        let weather = base.cloned().unwrap_or_default();
        experiment.weather.as_ref().map_or(weather.clone(), |over| weather.overridden(over))
    }

    /// The models that an experiment uses of materials (with their index).
    fn model_uses<'m>(scene: &'m Scene, experiment: &Experiment) -> Vec<(Option<usize>, &'m ModelUse)> {
        (experiment.models.iter().enumerate())
            .filter_map(|(m, chosen)| chosen.map(|i| (Some(m), &scene.materials[m].models[i])))
            .filter(|(m, _)| m.is_none_or(|m| scene.materials[m].used))
            .collect()
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

    /// Spectra that do not cover a band they are used in.
    fn cover(&mut self, uses: &[(Option<usize>, &ModelUse)], bands: &[Band]) {
        let scene = self.scene;
        for (material, use_) in uses.iter().copied() {
            for (name, value) in use_.args.iter() {
                let place = use_.param_spans.get(name).copied().or(use_.span);
                let place = match (name, material) {
                    ("reflectance", Some(m)) => scene.materials[m].spans.get("reflectance").copied().or(place),
                    _ => place,
                };
                let Some(place) = place else { continue };
                let Value::Spectrum(value) = value else { continue };
                self.cover_value(value, bands, place, name, "M04");
            }
        }
        for material in scene.materials.iter().filter(|material| material.used) {
            if let Some(value) = &material.emission {
                let place = material.spans.get("emission").copied().unwrap_or(material.span);
                self.cover_value(value, bands, place, "emission", "M04");
            }
        }
    }

    fn cover_value(
        &mut self,
        value: &SpectralValue,
        bands: &[Band],
        place: sunglint_dsl::Span,
        name: &str,
        code: &'static str,
    ) {
        for band in bands {
            let (lower, upper) = band.support();
            let message = match value {
                SpectralValue::Constant(_) => continue,
                SpectralValue::Curve(curve) if curve.covers(lower, upper) => continue,
                SpectralValue::Curve(curve) => {
                    let (first, last) = curve.domain();
                    let gap = |a: f64, b: f64| format!("{:.0}..{:.0} nm", a * 1e3, b * 1e3);
                    let gaps: Vec<String> = [(lower, first.min(upper)), (last.max(lower), upper)]
                        .into_iter()
                        .filter(|(a, b)| b > a)
                        .map(|(a, b)| gap(a, b))
                        .collect();
                    format!("`{name}` does not cover band `{}`: it lacks {}", band.name, gaps.join(" and "))
                }
                SpectralValue::PerBand(values) if values.iter().any(|(name, _)| *name == band.name) => continue,
                SpectralValue::PerBand(_) => format!("`{name}` has no value for band `{}`", band.name),
            };
            let help = match value {
                SpectralValue::PerBand(_) if code == "V03" => "give a value for every band of the sensor",
                SpectralValue::PerBand(_) => "give a value for every band in which it is used",
                _ => "widen the table, or say `extrapolate hold` behind it",
            };
            let known = self.diagnostics.iter().any(|d| d.span == Some(place) && d.message == message);
            if !known {
                self.diagnostics.push(Diagnostic::error(code, place, message).help(help));
            }
        }
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

    fn surfaces(
        &mut self,
        experiment: &Experiment,
        grid: &SpectralGrid,
        world: &Arc<World>,
        solved: &mut Solved,
    ) -> Option<Scenery> {
        let scene = self.scene;
        let grid_key = blake3::hash(format!("{grid:?}").as_bytes());
        let mut surfaces = Vec::new();
        for (m, material) in scene.materials.iter().enumerate() {
            let Some(chosen) = experiment.models[m].filter(|_| material.used) else {
                surfaces.push(None);
                continue;
            };
            let use_ = &material.models[chosen];
            let key = blake3::hash(format!("{} {:?} {grid_key}", use_.name, use_.args).as_bytes());
            let bound = match solved.surfaces.get(&key) {
                Some(known) => Some(known.clone()),
                None => self.bind(use_, sunglint_reflectance::BUILTIN, grid),
            };
            solved.surfaces.extend(bound.iter().map(|bound| (key, bound.clone())));
            let emission = match material.emission.as_ref().filter(|value| !value.is_zero()).map(|value| value.on(grid))
            {
                Some(Ok(values)) => Some(values.into()),
                _ => None,
            };
            surfaces.push(bound.map(|bsdf| Surface::new(bsdf, emission, material.code)));
        }
        let complete = (scene.materials.iter().zip(&surfaces)).all(|(m, surface)| !m.used || surface.is_some());
        complete.then(|| Scenery { world: world.clone(), surfaces })
    }

    /// Weather fields that the atmosphere does not use.
    fn check_weather(&mut self, provider: &dyn Atmosphere, use_: &ModelUse, moments: &[(Moment, Air)]) -> Vec<Skip> {
        let mut told = Vec::new();
        let mut skips: Vec<Skip> = Vec::new();
        for (_, Air { weather, .. }) in moments {
            for (field, span) in &weather.spans {
                let known = *field == "aerosol" && weather.aerosol.as_deref() == Some("rural");
                if provider.uses().contains(field) || known || told.contains(span) {
                    continue;
                }
                told.push(*span);
                let skip = Skip {
                    what: format!("`{field}` of the weather"),
                    why: format!("the atmosphere `{}` does not use it", use_.name),
                };
                if !skips.contains(&skip) {
                    skips.push(skip);
                }
                let diagnostic =
                    Diagnostic::warning("A01", *span, format!("the atmosphere `{}` does not use `{field}`", use_.name))
                        .help(match provider.uses() {
                            [] => format!("`{}` uses no field of the weather", use_.name),
                            uses => format!("`{}` uses {}", use_.name, uses.join(", ")),
                        });
                if !self.diagnostics.contains(&diagnostic) {
                    self.diagnostics.push(diagnostic);
                }
            }
        }
        skips
    }

    #[allow(clippy::too_many_arguments)]
    fn light(
        &mut self,
        experiment: &Experiment,
        provider: &dyn Atmosphere,
        moments: &[(Moment, Air)],
        grid: &SpectralGrid,
        needs: &Needs,
        albedo: &[f64],
        solved: &mut Solved,
    ) -> Option<(Vec<Arc<Illumination>>, usize)> {
        let use_ = &experiment.atmosphere;
        let mut hasher = blake3::Hasher::new();
        hasher.update(format!("{} {:?} {needs:?} {grid:?}", use_.name, use_.args).as_bytes());
        let provider_key = hasher.finalize().to_hex().to_string();
        // Without a sun the column is solved for one below the horizon.
        let below = Sun::at(std::f64::consts::PI, 0.0);
        // Times under one column are solved in one call; what another run has solved is not solved again.
        let mut columns_met: Vec<(Column, String)> = Vec::new();
        let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
        let mut keys = Vec::new();
        for (i, (moment, air)) in moments.iter().enumerate() {
            let column = self.column(air, albedo);
            let met = columns_met.iter().position(|(known, _)| *known == column).unwrap_or_else(|| {
                let key = format!("{provider_key} {column:?}");
                columns_met.push((column, key));
                columns_met.len() - 1
            });
            keys.push(format!("{} {:?}", columns_met[met].1, moment.sun));
            if solved.skies.contains_key(&keys[i]) {
                solved.shared += 1;
                continue;
            }
            match groups.iter_mut().find(|(known, _)| *known == met) {
                Some((_, members)) => members.push(i),
                None => groups.push((met, vec![i])),
            }
        }
        let columns = groups.len();
        for (met, members) in groups {
            let column = &columns_met[met].0;
            let suns: Vec<Sun> = members.iter().map(|i| moments[*i].0.sun.unwrap_or(below)).collect();
            match provider.solve(column, &suns, grid, needs) {
                Ok(skies) => {
                    for (i, sky) in members.iter().zip(skies) {
                        let light = Illumination::new(sky, moments[*i].0.sun.as_ref());
                        solved.skies.insert(keys[*i].clone(), Arc::new(light));
                    }
                }
                Err(error) => {
                    let message = format!("atmosphere `{}`: {error}", use_.name);
                    let diagnostic = match use_.span {
                        Some(span) => Diagnostic::error(error.code, span, message),
                        None => Diagnostic::whole(error.code, message),
                    };
                    if !self.diagnostics.contains(&diagnostic) {
                        self.diagnostics.push(diagnostic);
                    }
                    return None;
                }
            }
        }
        Some((keys.iter().map(|key| solved.skies[key].clone()).collect(), columns))
    }

    fn column(&self, air: &Air, albedo: &[f64]) -> Column {
        let weather = &air.weather;
        let cloud =
            |cloud: &scene::Cloud| Cloud { optical_depth: cloud.optical_depth, base: cloud.base, top: cloud.top };
        Column {
            profile: air.profile().into(),
            sounding: air.sounding.clone(),
            clouds: weather.clouds.iter().map(cloud).collect(),
            elevation: self.scene.site.map_or(0.0, |site| site.elevation),
            pressure: weather.pressure,
            temperature: weather.temperature,
            humidity: weather.humidity,
            water: weather.water,
            ozone: weather.ozone,
            no2: weather.no2,
            visibility: weather.visibility,
            aod: weather.aod,
            ground_albedo: albedo.to_vec(),
        }
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

/// What of a selection names nothing.
fn unknown(kind: &str, wanted: &[String], known: &[&str], is: impl Fn(&str, &str) -> bool) -> Vec<Diagnostic> {
    (wanted.iter())
        .filter(|wanted| !known.iter().any(|name| is(wanted, name)))
        .map(|wanted| {
            let near = nearest(wanted, known.iter().copied()).map_or(String::new(), |near| format!("`{near}`? "));
            let message = match kind {
                "time" => format!("no frame of the selection is at time `{wanted}`"),
                kind => format!("no {kind} of the scene is called `{wanted}`"),
            };
            Diagnostic::whole("X01", message).help(format!("{near}there are {}", list(known.iter().copied())))
        })
        .collect()
}

/// Names by code of the materials in use, ascending.
fn material_codes(scene: &Scene) -> Vec<(u16, String)> {
    let mut codes: Vec<(u16, String)> =
        scene.materials.iter().filter(|material| material.used).map(|m| (m.code, m.name.clone())).collect();
    codes.sort();
    codes
}

/// Skies that were solved, by everything that they depend on, so that runs share them.
#[derive(Default)]
struct Solved {
    skies: HashMap<String, Arc<Illumination>>,
    /// Surfaces by model, arguments and grid.
    surfaces: HashMap<blake3::Hash, Arc<dyn Bsdf>>,
    shared: usize,
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

/// Duration of a scan, and how far the sun moves in it: it is lit as at its first line throughout.
fn scan_note(scene: &Scene, sensor: &Sensor, moments: &[(Moment, Air)]) -> Option<String> {
    let flight = sensor.flight?;
    let lines = f64::from(sensor.pixels.1);
    let (seconds, metres) = (lines / flight.line_rate, lines * flight.speed / flight.line_rate);
    let moves = |(moment, air): &(Moment, Air)| {
        let (site, utc) = (scene.site.as_ref()?, moment.utc?);
        let (pressure, temperature) = air.at_site(utc);
        let at = |t: f64| times::sun_at(site, scene::Utc(t), pressure, temperature).ok();
        Some(at(utc.0)?.apparent.angle_to(at(utc.0 + seconds)?.apparent).to_degrees())
    };
    let most =
        moments.iter().filter_map(moves).fold(None, |most: Option<f64>, angle| Some(most.unwrap_or(0.0).max(angle)));
    let moved = most.map_or(String::new(), |angle| format!("; the sun moves by {angle:.3} deg meanwhile"));
    Some(format!(
        "scan: {lines} lines over {metres:.1} m in {seconds:.2} s, lit by sun and sky of the first line throughout{moved}"
    ))
}

/// The map that an image is, if its sensor looks straight down: of the level plane at the height of what it looks at, else
/// of the ground, else of what its middle meets.
fn map_of(scene: &Scene, sensor: &Sensor, camera: &dyn Camera, world: &World) -> Option<MapProjection> {
    let height = match sensor.pose {
        scene::SensorPose::LookAt { look_at, .. } | scene::SensorPose::Target { look_at, .. } => Some(look_at.z),
        scene::SensorPose::Attitude { .. } => None,
    };
    let met = || {
        let (w, h) = camera.pixels();
        let middle = camera.ray(0.5 * f64::from(w), 0.5 * f64::from(h));
        world.closest(&sunglint_geometry::Ray::new(middle.origin, middle.direction)).map(|hit| hit.point.z)
    };
    let height = height.or(world.ground().map(|ground| ground.height)).or_else(met).unwrap_or(0.0);
    let ground = camera.ground(height)?;
    Some(MapProjection::new(&ground, scene.site.as_ref(), scene.crs.as_ref()))
}

fn corners_of(args: &Args) -> Vec<Vec<f64>> {
    args.iter()
        .filter_map(|(_, value)| match value {
            Value::Spectrum(value) => Some(grid::corners(value)),
            Value::Table(table) => match &table.key {
                TableKey::Wavelength(wavelengths) => {
                    let mut nodes = wavelengths.clone();
                    nodes.sort_by(f64::total_cmp);
                    nodes.dedup();
                    Some(nodes)
                }
                _ => None,
            },
            _ => None,
        })
        .collect()
}

fn is_per_band(args: &Args) -> bool {
    args.iter().any(|(_, value)| match value {
        Value::Spectrum(SpectralValue::PerBand(_)) => true,
        Value::Table(table) => matches!(table.key, TableKey::Band(_)),
        _ => false,
    })
}

/// The albedo that the atmosphere sees: the ground's, or without one the area-weighted mean of the facets that face up.
/// Bihemispherical, 2 ∫ ρ(θ) cos θ sin θ dθ, by the midpoints of equal steps of sin² θ.
fn ground_albedo(scene: &Scene, world: &World, scenery: &Scenery, n: usize) -> Vec<f64> {
    const STEPS: usize = 16;
    let mut rho = vec![0.0; n];
    let mut of_material = |material: MaterialId| {
        let mut albedo = vec![0.0; n];
        for i in 0..STEPS {
            let theta = ((i as f64 + 0.5) / STEPS as f64).sqrt().asin();
            scenery.surface(material).bsdf.albedo(LocalDir::from_polar(theta, 0.0), &mut rho);
            albedo.iter_mut().zip(&rho).for_each(|(sum, rho)| *sum += rho / STEPS as f64);
        }
        albedo
    };
    if let Some(ground) = scene.ground {
        return of_material(MaterialId(ground.material as u32));
    }
    let mut areas: BTreeMap<u32, f64> = BTreeMap::new();
    for id in 0..world.facet_count() as u32 {
        let facet = world.facet(FacetId(id));
        if facet.normal.z > 0.0 {
            *areas.entry(facet.material.0).or_default() += facet.area * facet.normal.z;
        }
    }
    let total: f64 = areas.values().sum();
    let mut albedo = vec![0.0; n];
    for (material, area) in areas.into_iter().filter(|_| total > 0.0) {
        let own = of_material(MaterialId(material));
        albedo.iter_mut().zip(&own).for_each(|(sum, own)| *sum += own * area / total);
    }
    albedo
}

fn scene_skips(scene: &Scene, unopened: &[String], world: &World) -> Vec<Skip> {
    let mut skips = Vec::new();
    for material in scene.materials.iter().filter(|material| !material.used) {
        skips.push(Skip {
            what: format!("material `{}`", material.name),
            why: "no facet refers to it; its files were not opened".into(),
        });
    }
    for object in unopened {
        skips.push(Skip {
            what: format!("object `{object}`"),
            why: "nothing places it; its meshes were not opened".into(),
        });
    }
    if world.ground().is_none() {
        skips.push(Skip {
            what: "lines of sight below the horizon that meet no facet".into(),
            why: "the scene has no `ground`: they find black".into(),
        });
    }
    skips
}

fn run_skips(
    algorithm: &dyn Algorithm,
    scenery: &Scenery,
    bands: &[Band],
    grid: &SpectralGrid,
    light: &[Arc<Illumination>],
) -> Vec<Skip> {
    let mut skips: Vec<Skip> = (algorithm.skips(scenery).into_iter())
        .map(|line| match line.split_once(": ") {
            Some((what, why)) => Skip { what: what.into(), why: why.into() },
            None => Skip { what: line, why: String::new() },
        })
        .collect();
    let span = |f: fn(f64, f64) -> f64, start: f64, pick: fn(&Band) -> f64| bands.iter().map(pick).fold(start, f);
    let (lower, upper) = (span(f64::min, f64::INFINITY, |b| b.support().0), span(f64::max, 0.0, |b| b.support().1));
    let covered: f64 = grid.bins().iter().map(|bin| bin.width()).sum();
    skips.push(Skip {
        what: format!(
            "wavelengths below {:.0} nm, above {:.0} nm{}",
            lower * 1e3,
            upper * 1e3,
            if covered < upper - lower - 1e-9 { " and between the bands" } else { "" }
        ),
        why: format!("no band responds there; {} grid entries remain", grid.len()),
    });
    let dark = light.iter().filter(|time| time.is_dark()).count();
    if dark > 0 {
        skips.push(Skip {
            what: format!("sun and sky at {dark} of {} times", light.len()),
            why: "the sun is below the horizon".into(),
        });
    }
    skips.push(Skip {
        what: "sun rays from surfaces that are turned away from the sun, or with nothing between them and it".into(),
        why: "proved per block of 8 x 8 pixels and facet; the manifest counts them".into(),
    });
    let black =
        scenery.surfaces.iter().flatten().filter(|surface| !surface.has_diffuse && !surface.has_specular).count();
    if black > 0 {
        skips.push(Skip {
            what: "light that black surfaces return".into(),
            why: format!("{black} materials reflect nothing"),
        });
    }
    let world = &scenery.world;
    let n = world.facet_count().min(100_000) as u32;
    let open = (0..n).filter(|id| world.is_open(FacetId(*id), true)).count();
    if open > 0 {
        skips.push(Skip {
            what: format!("view-factor rays on {open} of {} facets", world.facet_count()),
            why: "nothing but the ground rises above their plane: F = (1 + cos β)/2".into(),
        });
    }
    skips
}
