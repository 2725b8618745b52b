//! What runs, what is skipped, and why. The last place where a scene can fail: after it only writing can.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use glam::DVec3;
use sunglint_atmosphere::{Atmosphere, Column, Needs, Sun};
use sunglint_dsl::scene::{self, Accuracy, Experiment, ModelUse, Sensor, Weather};
use sunglint_dsl::{Diagnostic, Scene, Severity, Sources};
use sunglint_geometry::{FacetId, MaterialId, World};
use sunglint_plugin::{Args, BindError, SpectralValue, TableKey, Value};
use sunglint_radiometry::{Channels, LocalDir, SpectralGrid};
use sunglint_reflectance::Bsdf;
use sunglint_sensor::{Band, Camera};
use sunglint_tracer::{Algorithm, Illumination, Scenery, Surface};

use crate::times::Moment;
use crate::{Checked, Refused, grid, scenery, times};

/// Most samples a pixel under `error`.
const MOST_SAMPLES: u32 = 4096;

/// What a user may change without touching the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Pixels in place of every sensor's own: the same view, coarser or finer.
    pub pixels: Option<(u32, u32)>,
    /// Samples a pixel in place of every experiment's accuracy.
    pub samples: Option<u32>,
    /// Experiments to keep; all where empty.
    pub experiments: Vec<String>,
    /// Frame labels to keep (`1992-06-18T160000Z`); all where empty.
    pub times: Vec<String>,
}

/// Something that will not be computed, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Skip {
    /// What.
    pub what: String,
    /// Why.
    pub why: String,
}

/// One experiment with one sensor: a view with all its times.
pub struct Run {
    /// Name of the experiment.
    pub experiment: String,
    /// Name of the sensor.
    pub sensor: String,
    /// Where its pixels look.
    pub camera: Arc<dyn Camera>,
    /// Pixels across and down.
    pub pixels: (u32, u32),
    /// The times.
    pub moments: Vec<Moment>,
    /// The spectral grid.
    pub grid: SpectralGrid,
    /// Output channels.
    pub channels: Channels,
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
    /// How accurate.
    pub accuracy: sunglint_tracer::Accuracy,
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
    /// Names by object id.
    pub objects: Vec<(u32, String)>,
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
    /// Facets of the world, instances counted each.
    pub facets: usize,
    /// Bytes of the acceleration structure and geometry.
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
            Planner { scene: &scene, options, diagnostics: &mut diagnostics, hashes: &hashes }.plan()
        });
        match planned {
            Some((runs, skips, world, title)) if !has_error(&diagnostics) => Ok(Self {
                runs,
                title,
                warnings: diagnostics,
                sources,
                files: files.hashes().clone(),
                materials,
                skips,
                facets: world.facet_count(),
                geometry_bytes: world.memory_bytes(),
            }),
            _ => Err(Refused { sources, diagnostics }),
        }
    }

    /// The runs, experiment by experiment and sensor by sensor.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// The run of an experiment and sensor.
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

struct Planner<'a> {
    scene: &'a Scene,
    options: &'a Options,
    diagnostics: &'a mut Vec<Diagnostic>,
    hashes: &'a BTreeMap<String, String>,
}

type Planned = (Vec<Run>, Vec<Skip>, Arc<World>, Option<String>);

impl Planner<'_> {
    fn plan(&mut self) -> Option<Planned> {
        let scene = self.scene;
        let mut cameras: Vec<Option<Arc<dyn Camera>>> = Vec::new();
        for sensor in &scene.sensors {
            match scenery::camera(scene, sensor, self.options.pixels) {
                Ok(camera) => cameras.push(Some(camera.into())),
                Err(diagnostic) => {
                    self.diagnostics.push(diagnostic);
                    cameras.push(None);
                }
            }
        }
        let positions: Vec<DVec3> =
            cameras.iter().map(|camera| camera.as_ref().map_or(DVec3::ZERO, |camera| camera.position())).collect();
        let built = scenery::build(scene, &positions, self.diagnostics);
        let bands: Vec<Vec<Band>> =
            scene.sensors.iter().map(|sensor| scenery::bands(sensor, self.diagnostics)).collect();
        let built = built?;
        if has_error(self.diagnostics) {
            return None;
        }
        for (sensor, camera) in scene.sensors.iter().zip(&cameras) {
            self.warn_of_view(sensor, camera.as_deref()?, &built.world);
        }
        let world = Arc::new(built.world);
        let mut skips = scene_skips(scene, &built.unopened, &world);
        let mut runs = Vec::new();
        let mut solved = Solved::default();
        for experiment in &scene.experiments {
            let wanted = &self.options.experiments;
            if !wanted.is_empty() && !wanted.contains(&experiment.name) {
                continue;
            }
            for &s in &experiment.sensors {
                let camera = cameras[s].clone()?;
                if let Some(run) = self.run(experiment, s, camera, &bands[s], &world, &built.objects, &mut solved) {
                    runs.push(run);
                }
            }
        }
        if solved.shared > 0 {
            skips.push(Skip {
                what: format!("{} solves of the air", solved.shared),
                why: "another run has the same column, suns and grid".into(),
            });
        }
        if runs.is_empty() && !has_error(self.diagnostics) {
            self.diagnostics.push(
                Diagnostic::whole("X01", "nothing is left to render: no experiment, sensor and time go together")
                    .help("see the `sensor` and `collect` lines of the experiments and sensors"),
            );
        }
        Some((runs, skips, world, scene.title.clone()))
    }

    fn warn_of_view(&mut self, sensor: &Sensor, camera: &dyn Camera, world: &World) {
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
        objects: &[(u32, String)],
        solved: &mut Solved,
    ) -> Option<Run> {
        let scene = self.scene;
        let sensor = &scene.sensors[sensor_index];
        let mut moments: Vec<(Moment, Weather)> = Vec::new();
        for c in experiment.collects.iter().filter(|c| sensor.collects.contains(c)) {
            let weather = self.weather(*c, experiment);
            let found = times::moments(scene, *c, &weather, self.diagnostics);
            moments.extend(found.into_iter().map(|moment| (moment, weather.clone())));
        }
        moments.sort_by(|a, b| a.0.utc.map(|t| t.0).unwrap_or(0.0).total_cmp(&b.0.utc.map(|t| t.0).unwrap_or(0.0)));
        make_labels_unique(scene, &mut moments);
        if !self.options.times.is_empty() {
            moments.retain(|(moment, _)| self.options.times.contains(&moment.label));
        }
        if moments.is_empty() {
            return None;
        }
        let before = self.diagnostics.len();

        // A provisional grid tells what nodes and g-points the provider wants.
        let uses = Self::model_uses(scene, experiment);
        let corners: Vec<Vec<f64>> = uses.iter().flat_map(|(_, use_)| corners_of(&use_.args)).collect();
        let owned = uses.iter().any(|(_, use_)| is_per_band(&use_.args))
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
        let grid = SpectralGrid::with_g(bins, names, |bin| provider.g_weights(bin));
        let provider = self.bind(&experiment.atmosphere, sunglint_atmosphere::BUILTIN, &grid)?;
        let algorithm = self.bind(&experiment.algorithm, sunglint_tracer::BUILTIN, &grid)?;
        let channels = grid::channels(&grid, bands);

        let scenery = self.surfaces(experiment, &grid, world);
        if has_error(&self.diagnostics[before..]) {
            return None;
        }
        let scenery = scenery?;
        let needs = algorithm.needs(&scenery);
        let albedo = match algorithm.lighting().adjacency {
            true => ground_albedo(scene, world, &scenery, grid.len()),
            false => vec![0.0; grid.len()],
        };
        self.check_weather(provider.as_ref(), &experiment.atmosphere, &moments);
        let (light, columns_solved) =
            self.light(experiment, provider.as_ref(), &moments, &grid, &needs, &albedo, solved)?;

        let estimators = algorithm.estimators();
        let skips = run_skips(algorithm.as_ref(), &scenery, bands, &grid, &light);
        let accuracy = match (self.options.samples, experiment.accuracy) {
            (Some(samples), _) => sunglint_tracer::Accuracy::Samples(samples),
            (None, Accuracy::Samples(samples)) => sunglint_tracer::Accuracy::Samples(samples),
            (None, Accuracy::Error { relative, floor }) => {
                sunglint_tracer::Accuracy::Error { relative, floor, most: MOST_SAMPLES }
            }
        };
        let models = (uses.iter())
            .filter_map(|(material, use_)| {
                let label = use_.label.as_ref().map_or(String::new(), |label| format!(" {label}"));
                material.map(|m| (scene.materials[m].name.clone(), format!("{}{label}", use_.name)))
            })
            .collect();
        Some(Run {
            experiment: experiment.name.clone(),
            sensor: sensor.name.clone(),
            pixels: camera.pixels(),
            camera,
            key: self.key(experiment, sensor),
            moments: moments.into_iter().map(|(moment, _)| moment).collect(),
            grid,
            channels,
            scenery,
            algorithm,
            algorithm_name: experiment.algorithm.name.clone(),
            atmosphere_name: experiment.atmosphere.name.clone(),
            light,
            accuracy,
            seed: experiment.seed,
            products: experiment.products,
            models,
            columns_solved,
            skips,
            estimators,
            objects: objects.to_vec(),
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
    fn model_uses<'s>(scene: &'s Scene, experiment: &Experiment) -> Vec<(Option<usize>, &'s ModelUse)> {
        (experiment.models.iter().enumerate())
            .filter_map(|(m, chosen)| chosen.map(|i| (Some(m), &scene.materials[m].models[i])))
            .filter(|(m, _)| m.is_none_or(|m| scene.materials[m].used))
            .collect()
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
                self.cover_value(value, bands, place, name);
            }
        }
        for material in scene.materials.iter().filter(|material| material.used) {
            if let Some(value) = &material.emission {
                let place = material.spans.get("emission").copied().unwrap_or(material.span);
                self.cover_value(value, bands, place, "emission");
            }
        }
    }

    fn cover_value(&mut self, value: &SpectralValue, bands: &[Band], place: sunglint_dsl::Span, name: &str) {
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
                SpectralValue::PerBand(_) => "give a value for every band in which the material is seen",
                _ => "widen the table, or say `extrapolate hold` behind it",
            };
            let known = self.diagnostics.iter().any(|d| d.span == Some(place) && d.message == message);
            if !known {
                self.diagnostics.push(Diagnostic::error("M04", place, message).help(help));
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

    fn surfaces(&mut self, experiment: &Experiment, grid: &SpectralGrid, world: &Arc<World>) -> Option<Scenery> {
        let scene = self.scene;
        let mut surfaces = Vec::new();
        for (m, material) in scene.materials.iter().enumerate() {
            let Some(chosen) = experiment.models[m].filter(|_| material.used) else {
                surfaces.push(None);
                continue;
            };
            let bound: Option<Arc<dyn Bsdf>> = self.bind(&material.models[chosen], sunglint_reflectance::BUILTIN, grid);
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
    fn check_weather(&mut self, provider: &dyn Atmosphere, use_: &ModelUse, moments: &[(Moment, Weather)]) {
        let mut told = Vec::new();
        for (_, weather) in moments {
            for (field, span) in &weather.spans {
                let known = *field == "aerosol" && weather.aerosol.as_deref() == Some("rural");
                if provider.uses().contains(field) || known || told.contains(span) {
                    continue;
                }
                told.push(*span);
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
    }

    #[allow(clippy::too_many_arguments)]
    fn light(
        &mut self,
        experiment: &Experiment,
        provider: &dyn Atmosphere,
        moments: &[(Moment, Weather)],
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
        for (i, (moment, weather)) in moments.iter().enumerate() {
            let column = self.column(weather, albedo);
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

    fn column(&self, weather: &Weather, albedo: &[f64]) -> Column {
        Column {
            profile: weather.profile.clone().unwrap_or_else(|| "us_standard".into()),
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
    fn key(&self, experiment: &Experiment, sensor: &Sensor) -> String {
        let mut hasher = blake3::Hasher::new();
        let mut feed = |part: &str| {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        };
        feed(env!("CARGO_PKG_VERSION"));
        feed(&experiment.name);
        feed(&sensor.name);
        feed(&format!("{:?} {:?} {:?}", self.options.pixels, self.options.samples, self.options.times));
        for hash in self.hashes.values() {
            feed(hash);
        }
        hasher.finalize().to_hex().to_string()
    }
}

/// Skies that were solved, by everything that they depend on, so that runs share them.
#[derive(Default)]
struct Solved {
    skies: HashMap<String, Arc<Illumination>>,
    shared: usize,
}

/// Frames of several collection sets may fall on one label: the set's name tells them apart.
fn make_labels_unique(scene: &Scene, moments: &mut [(Moment, Weather)]) {
    let labels: Vec<String> = moments.iter().map(|(moment, _)| moment.label.clone()).collect();
    for (i, (moment, _)) in moments.iter_mut().enumerate() {
        if labels.iter().filter(|label| **label == labels[i]).count() > 1 {
            let set = &scene.collects[moment.collect];
            let name = set.name.clone().unwrap_or_else(|| format!("collect{}", moment.collect + 1));
            moment.label = format!("{}_{name}", labels[i]);
        }
    }
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
