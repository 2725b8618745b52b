//! The air of each time, and the light that it gives.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use sunglint_atmosphere::{Atmosphere, Cloud, Column, Needs, Sun};
use sunglint_dsl::scene::{self, Experiment, ModelUse, Weather};
use sunglint_dsl::{Diagnostic, Scene};
use sunglint_geometry::{FacetId, MaterialId, World};
use sunglint_radiometry::{LocalDir, SpectralGrid};
use sunglint_reflectance::Bsdf;
use sunglint_tracer::{Illumination, Scenery};

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

    /// Weather fields that the atmosphere does not use.
    pub(super) fn check_weather(
        &mut self,
        provider: &dyn Atmosphere,
        use_: &ModelUse,
        moments: &[(Moment, Air)],
    ) -> Vec<Skip> {
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
    pub(super) fn light(
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

    pub(super) fn column(&self, air: &Air, albedo: &[f64]) -> Column {
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
            aerosol: None,
            ground_albedo: albedo.to_vec(),
        }
    }
}

/// Skies that were solved, by everything that they depend on, so that runs share them.
#[derive(Default)]
pub(super) struct Solved {
    pub(super) skies: HashMap<String, Arc<Illumination>>,
    /// Surfaces by model, arguments and grid.
    pub(super) surfaces: HashMap<blake3::Hash, Arc<dyn Bsdf>>,
    pub(super) shared: usize,
}

/// The albedo that the atmosphere sees: the ground's, or without one the area-weighted mean of the facets that face up.
/// Bihemispherical, 2 ∫ ρ(θ) cos θ sin θ dθ, by the midpoints of equal steps of sin² θ.
pub(super) fn ground_albedo(scene: &Scene, world: &World, scenery: &Scenery, n: usize) -> Vec<f64> {
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
