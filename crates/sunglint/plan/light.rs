//! The air of each time, and the light that it gives.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use rayon::prelude::*;
use sunglint_atmosphere::{Atmosphere, AtmosphereError, BUILTIN, Cloud, Column, Needs, Sun};
use sunglint_dsl::scene::{self, Experiment, ModelUse, Weather};
use sunglint_dsl::{Diagnostic, Scene, Span, list};
use sunglint_geometry::{FacetId, MaterialId, World};
use sunglint_plugin::{Args, SpectralValue, Value};
use sunglint_radiometry::{LocalDir, SpectralGrid};
use sunglint_reflectance::Bsdf;
use sunglint_sensor::Camera;
use sunglint_tracer::Illumination;

use super::{Planner, Skip};
use crate::air::Air;
use crate::times::Moment;

impl Planner<'_, '_> {
    /// The weather of a collection set as an experiment sees it: the set's own, or the scene's, with the experiment's
    /// fields in place of single ones.
    pub(super) fn weather(&self, collect: usize, experiment: &Experiment) -> Weather {
        let base = match self.scene.collects[collect].weather {
            Some(named) => self.scene.weathers.get(named),
            None => self.scene.weathers.iter().find(|weather| weather.name.is_none()),
        };
        let weather = base.cloned().unwrap_or_default();
        experiment.weather.as_ref().map_or(weather.clone(), |over| weather.overridden(over))
    }

    /// Weather fields that the atmosphere does not use; all that are said are marked in `asked`.
    pub(super) fn check_weather(
        provider: &dyn Atmosphere,
        use_: &ModelUse,
        moments: &[(Moment, Air)],
        asked: &mut Asked,
    ) -> Vec<Skip> {
        let mut skips: Vec<Skip> = Vec::new();
        for (_, Air { weather, .. }) in moments {
            let record = weather.spans.get("observations").copied();
            for (field, span) in &weather.spans {
                let used = provider.uses().contains(field);
                let of_record = *field != "observations" && Some(*span) == record;
                let known = asked.entry((*span, *field)).or_insert_with(|| Field { of_record, ..Field::default() });
                known.used |= used;
                if used {
                    continue;
                }
                if !known.unused_by.iter().any(|(name, _)| *name == use_.name) {
                    known.unused_by.push((use_.name.clone(), provider.uses()));
                }
                let skip = Skip {
                    what: format!("`{field}` of the weather"),
                    why: format!("the atmosphere `{}` does not use it", use_.name),
                };
                if !skips.contains(&skip) {
                    skips.push(skip);
                }
            }
        }
        skips
    }

    /// What a run asks of its atmosphere.
    pub(super) fn sky_order(
        &self,
        experiment: &Experiment,
        provider: Arc<dyn Atmosphere>,
        moments: &[(Moment, Air)],
        grid: &SpectralGrid,
        needs: Needs,
        albedo: &[f64],
    ) -> SkyOrder {
        let use_ = &experiment.atmosphere;
        let of_provider = format!("{} {:?} {grid:?}", use_.name, use_.args);
        let mut columns: Vec<(Column, blake3::Hash)> = Vec::new();
        let times = (moments.iter())
            .map(|(moment, air)| {
                let column = self.column(air);
                let met = columns.iter().position(|(known, _)| *known == column).unwrap_or_else(|| {
                    let mut hasher = blake3::Hasher::new();
                    hasher.update(of_provider.as_bytes()).update(format!(" {column:?}").as_bytes());
                    columns.push((column, hasher.finalize()));
                    columns.len() - 1
                });
                (met, moment.sun)
            })
            .collect();
        SkyOrder { provider, use_: use_.clone(), grid: grid.clone(), needs, albedo: albedo.to_vec(), columns, times }
    }

    /// The column over a black ground of no entries.
    pub(super) fn column(&self, air: &Air) -> Column {
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
            aerosol: weather.aerosol.as_ref().map(|aerosol| (aerosol.name.clone(), aerosol.args.clone())),
            ground_albedo: Vec::new(),
        }
    }
}

/// Fields of the weather by place and name. A record gives its columns the place of the line that names it.
pub(super) type Asked = BTreeMap<(Span, &'static str), Field>;

/// What became of a field of the weather.
#[derive(Default)]
pub(super) struct Field {
    /// Whether it is a column of a station's record, which may well hold more than is asked.
    of_record: bool,
    used: bool,
    /// Atmospheres that it was put to in vain, with the fields that they use.
    unused_by: Vec<(String, &'static [&'static str])>,
}

/// Weather fields that no atmosphere of the scene uses: nothing is silently ignored.
pub(super) fn in_vain(asked: &Asked) -> Vec<Diagnostic> {
    let unused = asked.iter().filter(|(_, field)| !field.used);
    let of_records = |span: &Span| asked.get(&(*span, "observations")).is_some_and(|record| !record.used);
    (unused.filter(|((span, _), field)| !(field.of_record && of_records(span))))
        .map(|((span, name), field)| {
            let names: Vec<String> = field.unused_by.iter().map(|(name, _)| format!("`{name}`")).collect();
            let message = match names.as_slice() {
                [one] => format!("the atmosphere {one} does not use `{name}`"),
                several => {
                    format!("none of the atmospheres {} uses `{name}`", list(several.iter().map(String::as_str)))
                }
            };
            let uses = |(name, fields): &(String, &[&str])| match fields {
                [] => format!("`{name}` uses no field of the weather"),
                fields => format!("`{name}` uses {}", list(fields.iter().copied())),
            };
            let told: Vec<String> = field.unused_by.iter().map(uses).collect();
            let help = format!("{}; `layered` uses them all", told.join("; "));
            match field.of_record {
                true => Diagnostic::warning("A01", *span, message).label("a column of this record"),
                false => Diagnostic::error("A01", *span, message).label("without effect"),
            }
            .help(help)
        })
        .collect()
}

/// What a run asks of its atmosphere: the sky over its columns of air at its times.
pub(super) struct SkyOrder {
    provider: Arc<dyn Atmosphere>,
    use_: ModelUse,
    grid: SpectralGrid,
    needs: Needs,
    /// Of the ground, one value per entry of the grid.
    albedo: Vec<f64>,
    /// Each with the hash of all that its sky depends on beside the sun and the ground.
    columns: Vec<(Column, blake3::Hash)>,
    /// Index of the column, and the sun.
    times: Vec<(usize, Option<Sun>)>,
}

/// The light of a run.
pub(super) struct Lit {
    /// Of each time.
    pub light: Vec<Arc<Illumination>>,
    /// Columns that this run is the first to ask for.
    pub columns: usize,
}

/// One column with all that is asked of it.
struct Ask<'o> {
    order: &'o SkyOrder,
    column: &'o Column,
    needs: Needs,
    albedos: Vec<Vec<f64>>,
    suns: Vec<Option<Sun>>,
    /// Pairs of ground and sun, the first of all that were asked for.
    wanted: Vec<(usize, usize)>,
}

/// The place of a value among those known, put there if it is new.
fn place_of<T: PartialEq + Clone>(known: &mut Vec<T>, value: &T) -> usize {
    known.iter().position(|known| known == value).unwrap_or_else(|| {
        known.push(value.clone());
        known.len() - 1
    })
}

/// Solves each column once, for all suns, grounds and needs of all runs; the lights are in the order of `orders`, `None` where
/// a column has no solution, which is told. With the number of skies that a run found solved for another. Where the lights
/// are not wanted, the providers only tell what they would refuse.
pub(super) fn solve(orders: &[&SkyOrder], unlit: bool, diagnostics: &mut Vec<Diagnostic>) -> (Vec<Option<Lit>>, usize) {
    let mut asks: Vec<Ask> = Vec::new();
    let mut known: HashMap<blake3::Hash, usize> = HashMap::new();
    let mut shared = 0;
    // For each run: the columns that are new, and for each time the ask and which of its pairs.
    let mut places: Vec<(usize, Vec<(usize, usize)>)> = Vec::new();
    for order in orders {
        let before = asks.len();
        let mut place = |(met, sun): &(usize, Option<Sun>)| {
            let (column, hash) = &order.columns[*met];
            let ask = *known.entry(*hash).or_insert_with(|| {
                let (albedos, suns, wanted) = (Vec::new(), Vec::new(), Vec::new());
                asks.push(Ask { order, column, needs: order.needs, albedos, suns, wanted });
                asks.len() - 1
            });
            let Ask { needs, albedos, suns, wanted, .. } = &mut asks[ask];
            *needs = needs.union(order.needs);
            let before = wanted.len();
            let pair = place_of(wanted, &(place_of(albedos, &order.albedo), place_of(suns, sun)));
            shared += usize::from(wanted.len() == before);
            (ask, pair)
        };
        let times = order.times.iter().map(&mut place).collect();
        places.push((asks.len() - before, times));
    }
    // Without a sun the column is solved for one below the horizon.
    let below = Sun::at(std::f64::consts::PI, 0.0);
    let solved: Vec<_> = (asks.par_iter())
        .map(|ask| {
            let suns: Vec<Sun> = ask.suns.iter().map(|sun| sun.unwrap_or(below)).collect();
            let (order, provider) = (ask.order, &ask.order.provider);
            let (column, grid, needs) = (ask.column, &order.grid, &ask.needs);
            let skies = if unlit {
                for albedo in &ask.albedos {
                    let column = Column { ground_albedo: albedo.clone(), ..column.clone() };
                    provider.check(&column, &suns, grid, needs)?;
                }
                darkness(grid)?.solve_over(&ask.albedos, column, &suns, grid, needs)?
            } else {
                provider.solve_over(&ask.albedos, column, &suns, grid, needs)?
            };
            let mut skies: Vec<Vec<Option<_>>> =
                skies.into_iter().map(|skies| skies.into_iter().map(Some).collect()).collect();
            let light = ask.wanted.iter().map(|(ground, sun)| {
                let sky = skies[*ground][*sun].take().expect("pairs are distinct");
                Arc::new(Illumination::new(sky, ask.suns[*sun].as_ref()))
            });
            Ok(light.collect::<Vec<Arc<Illumination>>>())
        })
        .collect::<Vec<Result<_, AtmosphereError>>>();
    for (ask, error) in asks.iter().zip(&solved).filter_map(|(ask, solved)| Some((ask, solved.as_ref().err()?))) {
        let use_ = &ask.order.use_;
        let message = format!("atmosphere `{}`: {error}", use_.name);
        let diagnostic = match use_.span {
            Some(span) => Diagnostic::error(error.code, span, message),
            None => Diagnostic::whole(error.code, message),
        };
        if !diagnostics.contains(&diagnostic) {
            diagnostics.push(diagnostic);
        }
    }
    let lit = places.into_iter().map(|(columns, times)| {
        let light = times.into_iter().map(|(ask, pair)| solved[ask].as_ref().ok().map(|lights| lights[pair].clone()));
        Some(Lit { light: light.collect::<Option<_>>()?, columns })
    });
    (lit.collect(), shared)
}

/// An atmosphere without air, for a plan that nobody renders.
fn darkness(grid: &SpectralGrid) -> Result<Arc<dyn Atmosphere>, AtmosphereError> {
    let none = BUILTIN.iter().find(|model| model.info.name == "none").expect("the model `none` is always there");
    let dark = [("solar_irradiance".to_string(), Value::Spectrum(SpectralValue::Constant(0.0)))];
    (none.bind)(&Args::new(&none.info, dark), grid)
        .map_err(|fault| AtmosphereError { code: fault.code, message: fault.message })
}

/// Lowest and highest z of what a camera can see and of the camera itself on its whole flight, and of `level` \[m\].
pub(super) fn path_heights(world: &World, camera: &dyn Camera, level: Option<f64>) -> (f64, f64) {
    let (width, height) = camera.pixels();
    let (w, h) = (f64::from(width), f64::from(height));
    // Origins of rays are linear in the pixel, on a slanted image plane as along a flight.
    let of_camera = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(x, y)| camera.ray(x, y).origin.z);
    let facets = world.bounds().into_iter().flat_map(|(low, high)| [low.z, high.z]);
    let heights = facets.chain(world.ground().map(|ground| ground.height)).chain(of_camera).chain(level);
    heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)))
}

/// The albedo that the atmosphere sees: the ground's, or without one the area-weighted mean of the facets that face up.
/// Bihemispherical, 2 ∫ ρ(θ) cos θ sin θ dθ, by the midpoints of equal steps of sin² θ.
pub(super) fn ground_albedo(scene: &Scene, world: &World, bsdfs: &[Option<Arc<dyn Bsdf>>], n: usize) -> Vec<f64> {
    const STEPS: usize = 16;
    let of_material = |material: MaterialId| {
        let bsdf = bsdfs[material.0 as usize].as_ref().expect("every material in use is bound");
        let at = |i: usize| {
            let theta = ((i as f64 + 0.5) / STEPS as f64).sqrt().asin();
            let mut rho = vec![0.0; n];
            bsdf.albedo(LocalDir::from_polar(theta, 0.0), &mut rho);
            rho
        };
        let mut albedo = vec![0.0; n];
        for rho in (0..STEPS).into_par_iter().map(at).collect::<Vec<_>>() {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{check_text, scenery};

    /// The ground lies lowest; of a slanted image plane the upper edge is the highest, 50 m · sin 45° above its middle.
    #[test]
    fn paths_run_between_the_lowest_that_is_seen_and_the_highest_place_of_the_camera() {
        let checked = check_text(
            "scene.glint",
            "glint 1\ncollect { sun zenith 30 deg azimuth 180 deg }\nmaterial grey { ideal { diffuse 0.5 } }\n\
             ground grey height -3 m\nbox grey size (2 2 5) m\n\
             sensor slanted { projection orthographic, position (0 -100 120) m, heading 0 deg, depression 45 deg, swath 100 m\n\
             pixels 10 x 10, band red 600..700 nm }\n",
        );
        let scene = checked.scene.unwrap_or_else(|| panic!("{:?}", checked.diagnostics));
        let built = scenery::build(&scene, &[], &mut Vec::new()).expect("a world");
        let camera =
            scenery::camera(&scene, &scene.sensors[0], Some((10, 10))).unwrap_or_else(|fault| panic!("{fault:?}"));
        let (low, high) = path_heights(&built.world, camera.as_ref(), None);
        assert_eq!(low, -3.0);
        assert!((high - 120.0 - 50.0 * 0.5f64.sqrt()).abs() < 1e-9, "{high}");
        assert_eq!(path_heights(&built.world, camera.as_ref(), Some(-7.0)).0, -7.0);
    }
}
