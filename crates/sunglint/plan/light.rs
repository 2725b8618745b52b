//! The air of each time, and the light that it gives.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use sunglint_atmosphere::{Atmosphere, AtmosphereError, Cloud, Column, Needs, Sun};
use sunglint_dsl::scene::{self, Experiment, ModelUse, Weather};
use sunglint_dsl::{Diagnostic, Scene, Span, list};
use sunglint_geometry::{FacetId, MaterialId, World};
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
        let of_ground = format!(" {albedo:?}");
        let hashed = |parts: [&[u8]; 2]| {
            let mut hasher = blake3::Hasher::new();
            hasher.update(parts[0]).update(parts[1]).finalize()
        };
        let mut columns: Vec<(Column, blake3::Hash)> = Vec::new();
        let times = (moments.iter())
            .map(|(moment, air)| {
                let column = self.column(air);
                let met = columns.iter().position(|(known, _)| *known == column).unwrap_or_else(|| {
                    let hash = hashed([of_provider.as_bytes(), format!(" {column:?}").as_bytes()]);
                    columns.push((column, hash));
                    columns.len() - 1
                });
                let under = hashed([columns[met].1.as_bytes(), format!("{:?}", moment.sun).as_bytes()]);
                let sky = hashed([under.as_bytes(), of_ground.as_bytes()]);
                OfTime { column: met, sun: moment.sun, under, sky }
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
pub(crate) struct SkyOrder {
    provider: Arc<dyn Atmosphere>,
    use_: ModelUse,
    grid: SpectralGrid,
    needs: Needs,
    /// Of the ground, one value per entry of the grid.
    albedo: Vec<f64>,
    /// Each with the hash of all that its sky depends on beside the sun and the ground.
    columns: Vec<(Column, blake3::Hash)>,
    times: Vec<OfTime>,
}

/// What a run asks for one time.
struct OfTime {
    column: usize,
    sun: Option<Sun>,
    /// Of column and sun, over whatever ground: such skies are solved in one.
    under: blake3::Hash,
    /// Of all that the sky depends on.
    sky: blake3::Hash,
}

impl SkyOrder {
    /// Whether the same skies are asked for, time by time.
    pub fn is(&self, other: &Self) -> bool {
        self.times.iter().map(|time| time.sky).eq(other.times.iter().map(|time| time.sky))
    }

    /// By time the hashes of column and sun, and of the sky over the run's ground.
    pub fn skies(&self) -> impl Iterator<Item = (blake3::Hash, blake3::Hash)> {
        self.times.iter().map(|time| (time.under, time.sky))
    }

    /// About how many bytes a sky keeps, and the light that is made of it.
    pub fn sky_bytes(&self) -> usize {
        self.provider.sky_bytes(&self.grid, &self.needs) + 2 * size_of::<f64>() * self.grid.len()
    }
}

/// One column with all that is asked of it.
struct Ask<'o> {
    order: &'o SkyOrder,
    column: &'o Column,
    needs: Needs,
    albedos: Vec<&'o [f64]>,
    suns: Vec<Sun>,
    /// Ground and sun of each sky.
    wanted: Vec<(usize, usize)>,
}

/// All that is asked of the distinct columns.
#[derive(Default)]
struct Asks<'o> {
    asks: Vec<Ask<'o>>,
    columns: HashMap<blake3::Hash, usize>,
    suns: HashMap<blake3::Hash, usize>,
    /// Ask and place within it.
    skies: HashMap<blake3::Hash, (usize, usize)>,
}

impl<'o> Asks<'o> {
    /// Asks for some times of a run; gives for each the ask and the place of its sky there.
    fn add(&mut self, order: &'o SkyOrder, times: Range<usize>) -> Vec<(usize, usize)> {
        // Without a sun the column is solved for one below the horizon.
        let below = Sun::at(std::f64::consts::PI, 0.0);
        let Self { asks, columns, suns, skies } = self;
        let mut place = |time: &'o OfTime| {
            let (column, hash) = &order.columns[time.column];
            let at = *columns.entry(*hash).or_insert_with(|| {
                let (albedos, suns, wanted) = (Vec::new(), Vec::new(), Vec::new());
                asks.push(Ask { order, column, needs: order.needs, albedos, suns, wanted });
                asks.len() - 1
            });
            let ask = &mut asks[at];
            ask.needs = ask.needs.union(order.needs);
            *skies.entry(time.sky).or_insert_with(|| {
                let sun = *suns.entry(time.under).or_insert_with(|| {
                    ask.suns.push(time.sun.unwrap_or(below));
                    ask.suns.len() - 1
                });
                let ground = ask.albedos.iter().position(|known| *known == order.albedo).unwrap_or_else(|| {
                    ask.albedos.push(&order.albedo);
                    ask.albedos.len() - 1
                });
                ask.wanted.push((ground, sun));
                (at, ask.wanted.len() - 1)
            })
        };
        order.times[times].iter().map(&mut place).collect()
    }
}

/// What a run is told of its air before it is solved.
pub(super) struct Told {
    /// Columns that this run is the first to ask for.
    pub columns: usize,
    /// What was assumed or estimated.
    pub notes: Vec<String>,
}

/// Asks the providers whether they can solve all that the runs ask for: `None` where one cannot, which is told. With the number
/// of skies that a run found asked for before.
pub(super) fn check(orders: &[&SkyOrder], diagnostics: &mut Vec<Diagnostic>) -> (Vec<Option<Told>>, usize) {
    let mut asks = Asks::default();
    let mut places: Vec<(usize, Vec<(usize, usize)>)> = Vec::new();
    for order in orders {
        let before = asks.asks.len();
        let own = asks.add(order, 0..order.times.len());
        places.push((asks.asks.len() - before, own));
    }
    let n_times: usize = orders.iter().map(|order| order.times.len()).sum();
    let shared = n_times - asks.skies.len();
    let asks = asks.asks;
    let checked: Vec<Result<Vec<String>, AtmosphereError>> = (asks.par_iter())
        .map(|ask| {
            let mut notes = Vec::new();
            for albedo in &ask.albedos {
                let column = Column { ground_albedo: albedo.to_vec(), ..ask.column.clone() };
                notes = ask.order.provider.check(&column, &ask.suns, &ask.order.grid, &ask.needs)?;
            }
            Ok(notes)
        })
        .collect();
    for (ask, error) in asks.iter().zip(&checked).filter_map(|(ask, checked)| Some((ask, checked.as_ref().err()?))) {
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
    let told = |(columns, times): (usize, Vec<(usize, usize)>)| {
        let mut notes: Vec<String> = Vec::new();
        for (ask, _) in times {
            let fresh = checked[ask].as_ref().ok()?.iter().filter(|note| !notes.contains(note)).cloned();
            notes.extend(fresh.collect::<Vec<_>>());
        }
        Some(Told { columns, notes })
    };
    (places.into_iter().map(told).collect(), shared)
}

/// Solves some times of runs, each column once, for all suns, grounds and needs of all of them: the light by run and time.
///
/// # Panics
/// Where a provider refuses what passed [`check`].
pub(super) fn solve(asked: &[(&SkyOrder, Range<usize>)]) -> Vec<Vec<Arc<Illumination>>> {
    let mut asks = Asks::default();
    let places: Vec<Vec<(usize, usize)>> = asked.iter().map(|(order, times)| asks.add(order, times.clone())).collect();
    let solved: Vec<Vec<Arc<Illumination>>> = (asks.asks.par_iter())
        .map(|ask| {
            let Ask { order, column, needs, albedos, suns, wanted } = ask;
            let albedos: Vec<Vec<f64>> = albedos.iter().map(|albedo| albedo.to_vec()).collect();
            let skies = order.provider.solve_over(&albedos, column, suns, &order.grid, needs);
            let skies =
                skies.unwrap_or_else(|error| panic!("atmosphere `{}`, checked before: {error}", order.use_.name));
            let mut skies: Vec<Vec<Option<_>>> =
                skies.into_iter().map(|skies| skies.into_iter().map(Some).collect()).collect();
            let mut light = |(ground, sun): &(usize, usize)| {
                let sky = skies[*ground][*sun].take().expect("pairs are distinct");
                Arc::new(Illumination::new(sky, Some(&suns[*sun])))
            };
            wanted.iter().map(&mut light).collect()
        })
        .collect();
    let of_run = |times: Vec<(usize, usize)>| times.into_iter().map(|(ask, sky)| solved[ask][sky].clone()).collect();
    places.into_iter().map(of_run).collect()
}

/// Lowest and highest z of what a camera can see and of the camera itself on its whole flight \[m\].
pub(super) fn path_heights(world: &World, camera: &dyn Camera) -> (f64, f64) {
    let (width, height) = camera.pixels();
    let (w, h) = (f64::from(width), f64::from(height));
    // Origins of rays are linear in the pixel, on a slanted image plane as along a flight.
    let of_camera = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(x, y)| camera.ray(x, y).origin.z);
    let facets = world.bounds().into_iter().flat_map(|(low, high)| [low.z, high.z]);
    let heights = facets.chain(world.ground().map(|ground| ground.height)).chain(of_camera);
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
        let (low, high) = path_heights(&built.world, camera.as_ref());
        assert_eq!(low, -3.0);
        assert!((high - 120.0 - 50.0 * 0.5f64.sqrt()).abs() < 1e-9, "{high}");
    }
}
