//! A column cut in homogeneous layers.
//!
//! The air is the named profile, or the ascent grafted onto it, brought to the weather:
//!
//! ```text
//! T' = T + (T_s − T(0)) max(0, 1 − h/2 km)                    `temperature` T_s at the surface
//! p' = p (p_s/p(0)) exp[(g/R_d) ∫₀^h (1/T − 1/T') dh]         `pressure` p_s; the air weighs p_s whatever T_s
//! n' = n (p'/p)(T/T')                                         so its column goes with p_s alone
//! x' = x RH e_s(T_s)/(x(0) p_s), at most e_s(T')/p'           `humidity` RH over water [WMO2018, annex 4.B]
//! x' = x U/∫ x n dz                                           `water`, `ozone`, `no2`: the column U
//! ```
//!
//! All that a layer holds is integrated with exponentials between the levels, so that the layers sum to the columns.

use sunglint_plugin::Args;
use sunglint_radiometry::SpectralGrid;

use crate::aerosol::{self, AEROSOLS, Aerosol, AerosolOptics, REFERENCE};
use crate::gas::{self, Amounts, BinAbsorption};
use crate::haze::{self, DEFAULT_VISIBILITY, Haze, surface_extinction};
use crate::medium::{Layer, Medium, Strata};
use crate::phase::Phase;
use crate::profile::{LOSCHMIDT, Level, Profile, WATER_MOLECULE, saturation_pressure};
use crate::vertical::Vertical;
use crate::{AtmosphereError, Column, cloud, coverage, rayleigh};
use std::sync::Arc;

/// Heights of the boundaries above the site \[m\].
const HEIGHTS: [f64; 33] = [
    0.0, 50.0, 100.0, 200.0, 350.0, 500.0, 750.0, 1000.0, 1250.0, 1500.0, 2000.0, 2500.0, 3000.0, 3500.0, 4000.0,
    5000.0, 6000.0, 7000.0, 8000.0, 9000.0, 10_000.0, 12_000.0, 14_000.0, 16_000.0, 18_000.0, 20_000.0, 25_000.0,
    30_000.0, 35_000.0, 40_000.0, 50_000.0, 70_000.0, 100_000.0,
];
/// A change of the temperature at the surface fades out at this height \[m\].
const WARMED: f64 = 2000.0;
/// Levels are added at this distance where the temperature is changed \[m\].
const FINE: f64 = 250.0;
/// Mean radius of the Earth in LOWTRAN 7 and AFGL's temperate atmospheres \[m\] \[Kneizys1988\].
pub(crate) const EARTH: f64 = 6_371_230.0;
/// Above this altitude \[km\] vapour is not held against saturation over water.
const MOIST: f64 = 15.0;
/// g/R_d \[K m⁻¹\].
const KELVIN_PER_METRE: f64 = 9.806_65 / 287.04;
/// Share of oxygen in the air \[Anderson1986\].
const OXYGEN: f64 = 0.209;
/// Water makes particles swell up to this humidity, the highest of the tables.
const WETTEST: f64 = 0.99;

/// A column in layers, for any grid.
#[derive(Clone, Debug)]
pub(crate) struct Site {
    strata: Strata,
    /// What the layers hold, from the top down.
    gases: Vec<Amounts>,
    /// Molecules of air \[cm⁻²\].
    air: Vec<f64>,
    /// Aerosols that are present.
    regions: Vec<Region>,
    /// Optical depth of cloud at 0.55 µm; empty without clouds.
    cloud: Vec<f64>,
    notes: Vec<String>,
}

/// One aerosol at one humidity.
#[derive(Clone, Debug)]
struct Region {
    aerosol: Arc<dyn Aerosol>,
    humidity: f64,
    /// Optical depth of every layer at 0.55 µm.
    depth: Vec<f64>,
}

impl Site {
    /// Cuts a column.
    ///
    /// # Errors
    /// `A01` for an unknown profile or aerosol, or a cloud whose top is not above its base; and what the aerosol makes of
    /// its arguments.
    pub fn new(column: &Column) -> Result<Self, AtmosphereError> {
        let mut notes = Vec::new();
        let air = weathered(column, &mut notes)?;
        let heights = boundaries(column)?;
        let elevation = column.elevation;
        let spread = |per_metre: &dyn Fn(&Level) -> f64| spread(&air, elevation, &heights, per_metre);

        let molecules = spread(&|level| 100.0 * level.n);
        let gases = gases(&air, elevation, &heights, column, &mut notes);
        let aerosol = chosen(column)?;
        let surface = air.at(elevation);
        let rayleigh = rayleigh::cross_section(REFERENCE) * surface.n * 100.0;
        let haze = match column.aod {
            Some(aod) => Haze::from_optical_depth(aod.max(0.0), elevation),
            None => {
                let visibility = column.visibility.unwrap_or(DEFAULT_VISIBILITY);
                Haze::from_extinction(surface_extinction(visibility, rayleigh), elevation)
            }
        };
        let regions = regions(&haze, &air, elevation, &heights, aerosol);
        let parts = regions.iter().map(|region| {
            let depth: f64 = region.depth.iter().sum();
            format!("{depth:.4} at a relative humidity of {:.0} %", 100.0 * region.humidity)
        });
        let parts = parts.collect::<Vec<String>>().join(", ");
        notes.push(format!("aerosol optical depth at 550 nm: {:.4} ({parts})", haze.optical_depth).replace(" ()", ""));
        let cloud = clouds(column, &heights);
        let refractivity = (heights.iter())
            .map(|height| {
                let level = air.at(elevation + height);
                rayleigh::refractivity(REFERENCE, level.p, 1e-6 * level.h2o * level.p, level.t)
            })
            .collect();
        let strata = Strata { heights, refractivity, radius: EARTH + elevation };
        Ok(Self { strata, gases, air: molecules, regions, cloud, notes })
    }

    /// Boundaries, refractivity and radius.
    pub fn strata(&self) -> Strata {
        self.strata.clone()
    }

    /// What was made of the weather, in words: for the plan.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Whether the tables speak for a grid.
    ///
    /// # Errors
    /// `M04` where they do not.
    pub fn check(&self, grid: &SpectralGrid) -> Result<(), AtmosphereError> {
        coverage::check("the band model of LOWTRAN 7", gas::COVERED, grid)?;
        for region in &self.regions {
            coverage::check("the aerosol", region.aerosol.domain(), grid)?;
        }
        Ok(())
    }

    /// The column at every entry of a grid.
    ///
    /// # Errors
    /// `M04` where the tables of gases or of the aerosol do not speak for the grid.
    pub fn media(&self, grid: &SpectralGrid) -> Result<Vec<Medium>, AtmosphereError> {
        self.check(grid)?;
        let mut media = Vec::with_capacity(grid.len());
        // Terms g of one node share all but the lines.
        let mut shared: Option<(u32, f64, Scatterers, Arc<BinAbsorption>)> = None;
        for entry in grid.entries() {
            let wavelength = entry.wavelength.um();
            let bin = grid.bin_of(entry);
            let node = usize::from(wavelength > bin.centre());
            let same = shared.as_ref().is_some_and(|(bin, at, ..)| *bin == entry.bin && *at == wavelength);
            if !same {
                let gas = BinAbsorption::of(bin);
                let mut scatterers = self.scatterers(wavelength);
                for (layer, amounts) in scatterers.layers.iter_mut().zip(&self.gases) {
                    layer.absorption += gas.smooth(node, amounts);
                }
                shared = Some((entry.bin, wavelength, scatterers, gas));
            }
            let Some((_, _, scatterers, gas)) = &shared else { unreachable!("set above") };
            let layers = (scatterers.layers.iter().zip(&self.gases))
                .map(|(layer, amounts)| Layer {
                    absorption: layer.absorption + gas.lines(node, usize::from(entry.g), amounts),
                    scattering: layer.scattering.clone(),
                })
                .collect();
            media.push(Medium { layers, phases: scatterers.phases.clone() });
        }
        Ok(media)
    }

    /// Absorption optical depths of the column in lines and continuum of water and in lines of oxygen, at every entry of a
    /// grid.
    pub fn absorbed(&self, grid: &SpectralGrid) -> Vec<[f64; 2]> {
        (grid.entries().iter())
            .map(|entry| {
                let bin = grid.bin_of(entry);
                let node = usize::from(entry.wavelength.um() > bin.centre());
                let gas = BinAbsorption::of(bin);
                let mut sums = [0.0; 2];
                for amounts in &self.gases {
                    let own = gas.water_and_oxygen(node, usize::from(entry.g), amounts);
                    sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
                }
                sums
            })
            .collect()
    }

    /// The column at a wavelength \[µm\] with given absorption optical depths of water and oxygen in place of its own.
    pub fn absorbing(&self, wavelength: f64, absorbed: [f64; 2]) -> Medium {
        let scatterers = self.scatterers(wavelength);
        let [water, oxygen] = absorbed;
        let band = gas::water_band(wavelength);
        let total = |of: &dyn Fn(&Amounts) -> f64| self.gases.iter().map(of).sum::<f64>().max(1e-300);
        let (all_water, all_oxygen) = (total(&|a| a.water[band]), total(&|a| a.oxygen));
        let layers = (scatterers.layers.into_iter().zip(&self.gases))
            .map(|(layer, amounts)| Layer {
                absorption: layer.absorption
                    + gas::grey(wavelength, amounts)
                    + water * amounts.water[band] / all_water
                    + oxygen * amounts.oxygen / all_oxygen,
                scattering: layer.scattering,
            })
            .collect();
        Medium { layers, phases: scatterers.phases }
    }

    /// Molecules, aerosols and cloud at a wavelength \[µm\].
    fn scatterers(&self, wavelength: f64) -> Scatterers {
        let cross_section = rayleigh::cross_section(wavelength);
        let mut phases = vec![Arc::new(Phase::rayleigh(rayleigh::depolarisation(wavelength)))];
        let mut layers: Vec<Layer> =
            self.air.iter().map(|air| Layer { absorption: 0.0, scattering: vec![cross_section * air] }).collect();
        let mut add = |optics: AerosolOptics, depths: &[f64]| {
            phases.push(optics.phase);
            for (layer, depth) in layers.iter_mut().zip(depths) {
                let extinction = optics.extinction * depth;
                layer.absorption += (1.0 - optics.albedo) * extinction;
                layer.scattering.push(optics.albedo * extinction);
            }
        };
        for region in &self.regions {
            add(region.aerosol.optics(wavelength, region.humidity), &region.depth);
        }
        if !self.cloud.is_empty() {
            add(cloud::optics(wavelength), &self.cloud);
        }
        Scatterers { layers, phases }
    }
}

struct Scatterers {
    layers: Vec<Layer>,
    phases: Vec<Arc<Phase>>,
}

/// The air over the site in the weather of the column.
fn weathered(column: &Column, notes: &mut Vec<String>) -> Result<Profile, AtmosphereError> {
    let profile = column.levels()?;
    let elevation = column.elevation;
    let surface = profile.at(elevation);
    let heavier = column.pressure.map_or(1.0, |pressure| pressure.max(0.1) / surface.p);
    let warmer = column.temperature.map_or(0.0, |temperature| temperature - surface.t);

    // From the site up, with its own level at the ground.
    let mut altitudes: Vec<f64> = (profile.levels().iter()).map(|level| 1e3 * level.z).collect();
    altitudes.push(elevation);
    if warmer != 0.0 {
        altitudes.extend((1..=(WARMED / FINE) as i32).map(|i| elevation + FINE * f64::from(i)));
    }
    altitudes.retain(|z| *z >= elevation);
    altitudes.sort_by(f64::total_cmp);
    altitudes.dedup_by(|a, b| *a - *b < 1e-3);

    let mut levels: Vec<Level> = Vec::with_capacity(altitudes.len());
    let mut lift = 0.0;
    let mut below: Option<(f64, f64)> = None;
    for z in altitudes {
        let level = profile.at(z);
        let t = level.t + warmer * (1.0 - (z - elevation) / WARMED).max(0.0);
        let buoyancy = KELVIN_PER_METRE * (1.0 / level.t - 1.0 / t);
        if let Some((under, there)) = below {
            lift += 0.5 * (there + buoyancy) * (z - under);
        }
        below = Some((z, buoyancy));
        let p = level.p * heavier * lift.exp();
        levels.push(Level { z: 1e-3 * z, p, t, n: level.n * p / level.p * level.t / t, ..level });
    }
    let ground = levels[0];
    if let (Some(humidity), None) = (column.humidity, column.water) {
        let wetter = humidity.max(0.0) * saturation_pressure(ground.t) / (1e-6 * ground.h2o * ground.p);
        levels.iter_mut().for_each(|level| level.h2o *= wetter);
    }
    let mut dried = 0;
    if column.water.is_none() && (column.humidity.is_some() || column.temperature.is_some()) {
        for level in &mut levels {
            let most = 1e6 * saturation_pressure(level.t) / level.p;
            if level.h2o > most * (1.0 + 1e-9) && level.z < MOIST {
                level.h2o = most;
                dried += 1;
            }
        }
    }
    if dried > 0 {
        notes.push(format!("{dried} levels of the air are held at saturation"));
    }
    let mut air = Profile::new(levels);
    if let Some(water) = column.water {
        let scale = water.max(0.0) / air.water(elevation).1;
        air = air.scaled(scale, 1.0);
        let humidity = |level: &Level| 1e-6 * level.h2o * level.p / saturation_pressure(level.t);
        let wettest = air.levels().iter().filter(|level| level.z < MOIST).map(humidity).fold(0.0, f64::max);
        if wettest > 1.0 {
            notes.push(format!("so much water makes {:.0} % of relative humidity somewhere", 100.0 * wettest));
        }
    }
    if let Some(ozone) = column.ozone {
        let scale = ozone.max(0.0) / air.ozone(elevation).1;
        air = air.scaled(1.0, scale);
    }
    notes.push(format!("precipitable water: {:.3} g/cm2", air.water(elevation).1));
    notes.push(format!("ozone: {:.1} DU", 1e3 * air.ozone(elevation).1));
    Ok(air)
}

/// Heights of the boundaries, descending.
fn boundaries(column: &Column) -> Result<Vec<f64>, AtmosphereError> {
    // The top is 100 km above the sea, or a little below it over a mountain.
    let mut heights: Vec<f64> = HEIGHTS.to_vec();
    let top = 1e5 - column.elevation.clamp(0.0, 2e4);
    heights[HEIGHTS.len() - 1] = top;
    for cloud in &column.clouds {
        if !(cloud.top > cloud.base && cloud.base >= 0.0 && cloud.top < top) {
            return Err(AtmosphereError {
                code: "A01",
                message: format!(
                    "a cloud reaches from {} to {} m above the site; its top must lie above its base and below {top} m",
                    cloud.base, cloud.top
                ),
            });
        }
        heights.extend([cloud.base, cloud.top]);
    }
    heights.sort_by(|a, b| b.total_cmp(a));
    heights.dedup_by(|a, b| (*a - *b).abs() < 1e-3);
    Ok(heights)
}

/// What every layer holds of a constituent, from its amount per metre; the top layer also what lies above it.
fn spread(air: &Profile, elevation: f64, heights: &[f64], per_metre: &dyn Fn(&Level) -> f64) -> Vec<f64> {
    let (vertical, column) = air.vertical(elevation, per_metre);
    within(&vertical, column, heights)
}

fn within(vertical: &Vertical, column: f64, heights: &[f64]) -> Vec<f64> {
    (heights.windows(2).enumerate())
        .map(|(i, pair)| match i {
            0 => column * vertical.above(pair[1]),
            _ => column * vertical.mean(pair[1], pair[0]) * (pair[0] - pair[1]),
        })
        .collect()
}

fn gases(air: &Profile, elevation: f64, heights: &[f64], column: &Column, notes: &mut Vec<String>) -> Vec<Amounts> {
    let spread = |per_metre: &dyn Fn(&Level) -> f64| spread(air, elevation, heights, per_metre);
    let reduced = |law: &gas::BandLaw, level: &Level| (level.p / 1013.25).powf(law.n) * (273.15 / level.t).powf(law.m);
    let water_density = |level: &Level| 1e-6 * level.h2o * level.n / LOSCHMIDT;
    let (water_laws, oxygen_law) = &*gas::BANDS;
    let water = water_laws
        .map(|law| spread(&|level| 1e-6 * level.h2o * level.n * 100.0 * WATER_MOLECULE * reduced(&law, level)));
    let oxygen = spread(&|level| OXYGEN * level.n * 100.0 / LOSCHMIDT * reduced(oxygen_law, level));
    let water_self = spread(&|level| gas::CONTINUUM_DENSITY * water_density(level).powi(2));
    let cold = |level: &Level| ((368.0 - level.t) / 36.0).max(0.0);
    let water_self_cold = spread(&|level| gas::CONTINUUM_DENSITY * water_density(level).powi(2) * cold(level));
    let water_foreign =
        spread(&|level| gas::CONTINUUM_DENSITY * water_density(level) * (level.n / LOSCHMIDT - water_density(level)));
    let ozone = spread(&|level| 1e-6 * level.o3 * level.n * 100.0 / LOSCHMIDT);
    let oxygen_pairs = spread(&|level| (OXYGEN * level.n).powi(2) * 100.0);

    let [low, high] = gas::NITROGEN_DIOXIDE_AT;
    let warm = |level: &Level| ((level.t - low) / (high - low)).clamp(0.0, 1.0);
    let nitrogen_dioxide = |level: &Level| 1e-6 * Profile::nitrogen_dioxide(level.z) * level.n * 100.0;
    let (_, own) = air.vertical(elevation, nitrogen_dioxide);
    let scale = column.no2.map_or(1.0, |no2| no2.max(0.0) * LOSCHMIDT / own);
    notes.push(format!("nitrogen dioxide: {:.3} DU", 1e3 * own * scale / LOSCHMIDT));
    let no2 = spread(&|level| scale * nitrogen_dioxide(level));
    let no2_warm = spread(&|level| scale * nitrogen_dioxide(level) * warm(level));
    (0..heights.len() - 1)
        .map(|i| Amounts {
            water: std::array::from_fn(|band| water[band][i]),
            oxygen: oxygen[i],
            water_self: water_self[i],
            water_self_cold: water_self_cold[i],
            water_foreign: water_foreign[i],
            ozone: ozone[i],
            nitrogen_dioxide: no2[i],
            nitrogen_dioxide_warm: no2_warm[i],
            oxygen_pairs: oxygen_pairs[i],
        })
        .collect()
}

/// The aerosol that the column names.
fn chosen(column: &Column) -> Result<Arc<dyn Aerosol>, AtmosphereError> {
    let unsaid = (aerosol::DEFAULT.to_string(), Args::default());
    let (name, args) = column.aerosol.as_ref().unwrap_or(&unsaid);
    let model = AEROSOLS.iter().find(|model| model.info.name == name).ok_or_else(|| {
        let names: Vec<&str> = AEROSOLS.iter().map(|model| model.info.name).collect();
        AtmosphereError {
            code: "A01",
            message: format!("no aerosol is named `{name}`; there are {}", names.join(", ")),
        }
    })?;
    (model.bind)(args, &SpectralGrid::from_edges(&[]))
        .map_err(|fault| AtmosphereError { code: fault.code, message: format!("aerosol `{name}`: {}", fault.message) })
}

/// Shares the haze out among the aerosols of the boundary layer, troposphere, stratosphere and upper air.
fn regions(haze: &Haze, air: &Profile, elevation: f64, heights: &[f64], aerosol: Arc<dyn Aerosol>) -> Vec<Region> {
    /// Points of a layer at which the shares are taken.
    const PARTS: u32 = 8;
    let depth = within(&haze.vertical, haze.optical_depth, heights);
    if haze.optical_depth <= 0.0 {
        return Vec::new();
    }
    let middle: Vec<f64> = heights.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let humidity: Vec<f64> = (middle.iter())
        .map(|height| {
            let level = air.at(elevation + height);
            (1e-6 * level.h2o * level.p / saturation_pressure(level.t)).clamp(0.0, WETTEST)
        })
        .collect();
    let aerosols: Vec<(Arc<dyn Aerosol>, [f64; 4])> = if aerosol.fills_column() {
        vec![(aerosol, [1.0; 4])]
    } else {
        vec![
            (aerosol, [1.0, 0.0, 0.0, 0.0]),
            (aerosol::tabulated("tropospheric"), [0.0, 1.0, 0.0, 0.0]),
            (aerosol::tabulated("background_stratospheric"), [0.0, 0.0, 1.0, 0.0]),
            (aerosol::tabulated("meteoric_dust"), [0.0, 0.0, 0.0, 1.0]),
        ]
    };
    (aerosols.into_iter())
        .map(|(aerosol, of)| {
            let depth: Vec<f64> = (heights.windows(2).zip(&depth))
                .map(|(pair, depth)| {
                    let share: f64 = (0..PARTS)
                        .map(|i| pair[1] + (pair[0] - pair[1]) * (f64::from(i) + 0.5) / f64::from(PARTS))
                        .map(|height| haze::shares(haze::table_altitude(height, elevation)))
                        .map(|shares| shares.iter().zip(of).map(|(share, of)| share * of).sum::<f64>())
                        .sum();
                    depth * share / f64::from(PARTS)
                })
                .collect();
            let total: f64 = depth.iter().sum();
            let wet: f64 = depth.iter().zip(&humidity).map(|(depth, humidity)| depth * humidity).sum();
            Region { aerosol, humidity: if total > 0.0 { wet / total } else { 0.0 }, depth }
        })
        .filter(|region| region.depth.iter().any(|depth| *depth > 0.0))
        .collect()
}

/// Optical depth of cloud in every layer at 0.55 µm, or nothing.
fn clouds(column: &Column, heights: &[f64]) -> Vec<f64> {
    if column.clouds.iter().all(|cloud| cloud.optical_depth <= 0.0) {
        return Vec::new();
    }
    (heights.windows(2))
        .map(|pair| {
            (column.clouds.iter())
                .map(|cloud| {
                    let inside = (cloud.top.min(pair[0]) - cloud.base.max(pair[1])).max(0.0);
                    cloud.optical_depth.max(0.0) * inside / (cloud.top - cloud.base)
                })
                .sum()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_plugin::Value;
    use sunglint_radiometry::Bin;

    fn column() -> Column {
        Column { ..Column::default() }
    }

    /// 5 nm from 0.4 to 1 µm, with the terms of the gases.
    fn grid() -> SpectralGrid {
        let bins = (0..120).map(|i| Bin {
            lower: 0.4 + 0.005 * f64::from(i),
            upper: 0.405 + 0.005 * f64::from(i),
            band: None,
        });
        SpectralGrid::with_g(bins.collect(), Vec::new(), gas::g_weights)
    }

    fn at(wavelength: f64) -> SpectralGrid {
        SpectralGrid::from_edges(&[wavelength - 1e-6, wavelength + 1e-6])
    }

    fn total(of: impl Fn(&Amounts) -> f64, site: &Site) -> f64 {
        site.gases.iter().map(of).sum()
    }

    fn scattered(medium: &Medium, phase: usize) -> f64 {
        medium.layers.iter().map(|layer| layer.scattering[phase]).sum()
    }

    /// The path through every layer over its thickness, for an apparent zenith angle at the ground: Bouguer's law,
    /// n r sin z = const.
    fn slant(strata: &Strata, zenith: f64) -> Vec<f64> {
        let n0 = 1.0 + strata.refractivity[strata.refractivity.len() - 1];
        let c = n0 * strata.radius * zenith.sin();
        (0..strata.heights.len() - 1)
            .map(|i| {
                let (top, bottom) = (strata.heights[i], strata.heights[i + 1]);
                let (above, below) = (strata.refractivity[i].max(1e-15), strata.refractivity[i + 1].max(1e-15));
                let steps = 200;
                let sum: f64 = (0..steps)
                    .map(|k| {
                        let t = (f64::from(k) + 0.5) / f64::from(steps);
                        let n = 1.0 + below * (above / below).powf(t);
                        1.0 / (1.0 - (c / (n * (strata.radius + bottom + t * (top - bottom)))).powi(2)).sqrt()
                    })
                    .sum();
                sum / f64::from(steps)
            })
            .collect()
    }

    /// Means over 5 nm of the direct beam's transmittance against LOWTRAN 7 itself, four profiles to air mass 9,
    /// component by component: within 0.003 to air mass 2 and 0.008 beyond. The terms account for 0.002; the
    /// continuum, one coefficient a half bin, for the rest where it is steep (0.007 at 930 nm, under lines that are
    /// black by then); else layers, LOWTRAN's 33 levels and single precision. O₂–O₂ and NO₂, which LOWTRAN 7 lacks
    /// here, are taken out.
    #[test]
    fn the_gases_transmit_what_lowtran_7_has() {
        let grid = grid();
        let rows: Vec<Vec<&str>> = (include_str!("../tests/data/lowtran7_transmittance.csv").lines())
            .filter(|line| !line.starts_with('#'))
            .skip(1)
            .map(|line| line.split(',').collect())
            .collect();
        // Columns of the file, and what of a layer's absorbers and scatterers makes them.
        type Keep = fn(&Amounts) -> Amounts;
        let all: Keep = |a| Amounts { nitrogen_dioxide: 0.0, nitrogen_dioxide_warm: 0.0, oxygen_pairs: 0.0, ..*a };
        let components: [(&str, usize, Keep, bool); 6] = [
            ("water's lines", 4, |a| Amounts { water: a.water, ..Amounts::default() }, false),
            (
                "water's continuum",
                5,
                |a| Amounts {
                    water_self: a.water_self,
                    water_self_cold: a.water_self_cold,
                    water_foreign: a.water_foreign,
                    ..Amounts::default()
                },
                false,
            ),
            ("oxygen", 6, |a| Amounts { oxygen: a.oxygen, ..Amounts::default() }, false),
            ("ozone", 7, |a| Amounts { ozone: a.ozone, ..Amounts::default() }, false),
            ("gases", 8, all, false),
            ("gases and molecules", 10, all, true),
        ];
        for (component, cell, keep, scattering) in components {
            let mut worst = [(0.0f64, "", "", ""); 2];
            for name in ["tropical", "midlatitude_summer", "subarctic_winter", "us_standard"] {
                let mut site = Site::new(&Column { profile: name.to_string(), aod: Some(0.0), ..column() }).unwrap();
                site.gases.iter_mut().for_each(|amounts| *amounts = keep(amounts));
                let media = site.media(&grid).unwrap();
                for zenith in ["0.0", "60.0", "78.5", "84.3"] {
                    let slant = slant(&site.strata, zenith.parse::<f64>().unwrap().to_radians());
                    let mut found = vec![0.0; 120];
                    for (entry, medium) in grid.entries().iter().zip(&media) {
                        let depth: f64 = (medium.layers.iter().zip(&slant))
                            .map(|(layer, slant)| {
                                slant * if scattering { layer.extinction() } else { layer.absorption }
                            })
                            .sum();
                        found[entry.bin as usize] += entry.weight * (-depth).exp();
                    }
                    let listed: Vec<_> =
                        rows.iter().filter(|row| row[0].starts_with(name) && row[1] == zenith).collect();
                    assert_eq!(listed.len(), 120);
                    for (row, found) in listed.into_iter().zip(found) {
                        let difference = found - row[cell].parse::<f64>().unwrap();
                        let worst = &mut worst[usize::from(zenith > "60.0")];
                        if difference.abs() > worst.0.abs() {
                            *worst = (difference, row[2], name, zenith);
                        }
                    }
                }
            }
            assert!(worst[0].0.abs() < 0.003 && worst[1].0.abs() < 0.008, "{component}: {worst:?}");
        }
    }

    #[test]
    fn layers_sum_to_the_columns() {
        for elevation in [-400.0, 0.0, 168.0, 2500.0, 8900.0] {
            let site = Site::new(&Column { elevation, ..column() }).unwrap();
            let profile = Profile::named("us_standard").unwrap();
            let rows = [
                (site.air.iter().sum::<f64>(), profile.air(elevation).1),
                (total(|a| a.ozone, &site), profile.ozone(elevation).1),
            ];
            for (sum, column) in rows {
                // Below the lowest level its mixing ratio is held.
                let within = if elevation < 0.0 { 1e-4 } else { 1e-10 };
                assert!((sum / column - 1.0).abs() < within, "{elevation}: {sum} {column}");
            }
            assert_eq!(site.strata.heights.len(), site.air.len() + 1);
            assert_eq!(site.strata.heights.last(), Some(&0.0));
            assert!(site.strata.heights.windows(2).all(|pair| pair[0] > pair[1]));
        }
    }

    /// Rayleigh and aerosol at 0.55 µm: the aerosols of all regions together have the optical depth that was asked for.
    #[test]
    fn optical_depth_of_the_aerosol_is_exactly_the_one_given() {
        let angstrom = AEROSOLS.iter().find(|model| model.info.name == "angstrom").unwrap();
        let by_numbers = Some(("angstrom".to_string(), Args::new(&angstrom.info, [])));
        let models =
            ["rural", "urban", "maritime", "tropospheric"].map(|name| Some((name.to_string(), Args::default())));
        for aerosol in models.into_iter().chain([None, by_numbers]) {
            for aod in [1e-3, 0.1, 0.5, 3.0] {
                let said = Column { aod: Some(aod), aerosol: aerosol.clone(), elevation: 168.0, ..column() };
                let site = Site::new(&said).unwrap();
                let sum: f64 = site.regions.iter().flat_map(|region| &region.depth).sum();
                assert!((sum / aod - 1.0).abs() < 1e-12, "{aerosol:?} {aod}: {sum}");
                let regions = site.regions.iter();
                let spectral: f64 = regions
                    .map(|region| {
                        region.depth.iter().sum::<f64>() * region.aerosol.optics(0.55, region.humidity).extinction
                    })
                    .sum();
                assert!((spectral / aod - 1.0).abs() < 1e-9, "{spectral}");
            }
        }
        let clean = Site::new(&Column { aod: Some(0.0), ..column() }).unwrap();
        assert_eq!(clean.media(&at(0.55)).unwrap()[0].phases.len(), 1);
    }

    #[test]
    fn an_angstrom_aerosol_has_its_exponent_and_albedo() {
        let model = AEROSOLS.iter().find(|model| model.info.name == "angstrom").unwrap();
        let given = [("exponent".to_string(), Value::Number(1.5))];
        let aerosol = Some(("angstrom".to_string(), Args::new(&model.info, given)));
        let site = Site::new(&Column { aod: Some(0.2), aerosol, ..column() }).unwrap();
        let media = site.media(&at(0.8)).unwrap();
        let scattered = scattered(&media[0], 1);
        let expected = 0.93 * 0.2 * (0.799_999_4f64 / 0.55).powf(-1.5);
        assert!((scattered / expected - 1.0).abs() < 1e-5, "{scattered} {expected}");
    }

    /// A warmer surface does not change what the air weighs, and so not its column; p' stays hydrostatic.
    #[test]
    fn weather_does_what_it_says_and_nothing_else() {
        let plain = Site::new(&column()).unwrap();
        let air = |site: &Site| site.air.iter().sum::<f64>();
        let water = |site: &Site| total(|a| a.water[1], site);
        let ozone = |site: &Site| total(|a| a.ozone, site);
        let no2 = |site: &Site| total(|a| a.nitrogen_dioxide, site);
        let with = |change: &dyn Fn(&mut Column)| {
            let mut said = column();
            change(&mut said);
            Site::new(&said).unwrap()
        };
        let ratio = |of: &dyn Fn(&Site) -> f64, site: &Site| of(site) / of(&plain);

        let deep = with(&|c| c.pressure = Some(1013.0 * 0.95));
        assert!((ratio(&air, &deep) - 0.95).abs() < 1e-9);
        let warm = with(&|c| c.temperature = Some(288.2 + 15.0));
        assert!((ratio(&air, &warm) - 1.0).abs() < 2e-3, "{}", ratio(&air, &warm));
        assert!(warm.strata.refractivity.last() < plain.strata.refractivity.last());
        let ozonic = with(&|c| c.ozone = Some(0.3));
        assert!((ozone(&ozonic) - 0.3).abs() < 1e-10 && (ratio(&water, &ozonic) - 1.0).abs() < 1e-12);
        let brown = with(&|c| c.no2 = Some(1e-3));
        assert!((no2(&brown) / LOSCHMIDT - 1e-3).abs() < 1e-12, "{}", no2(&brown) / LOSCHMIDT);
        let wet = with(&|c| c.water = Some(3.0));
        let profile = Profile::named("us_standard").unwrap();
        assert!((ratio(&water, &wet) - 3.0 / profile.precipitable_water(0.0)).abs() < 1e-9);
        let own = profile.vapour_pressure(0.0) / saturation_pressure(profile.temperature(0.0));
        let humid = with(&|c| c.humidity = Some(1.5 * own));
        assert!((ratio(&water, &humid) - 1.5).abs() < 1e-3, "{}", ratio(&water, &humid));
        let soaked = with(&|c| c.humidity = Some(1.0));
        assert!(ratio(&water, &soaked) < 1.0 / own);
        // The AFGL column of NO₂ is 0.2 DU.
        assert!((0.15e-3..0.25e-3).contains(&(no2(&plain) / LOSCHMIDT)), "{}", no2(&plain) / LOSCHMIDT);
    }

    /// The published vertical optical depths of O₂–O₂ over the sea, 0.005 to 0.015: 0.0439 n² H/2 of the peaks, H the
    /// scale height of air. LOWTRAN 7's continuum of water takes 7.25 % out of 935–940 nm.
    #[test]
    fn pairs_of_oxygen_and_the_continuum_absorb_as_published() {
        let site = Site::new(&Column { aod: Some(0.0), ..column() }).unwrap();
        let depth = |wavelength: f64, keep: &dyn Fn(&Amounts) -> Amounts| -> f64 {
            let bin = Bin { lower: wavelength - 2.5e-3, upper: wavelength + 2.5e-3, band: None };
            let absorption = BinAbsorption::of(&bin);
            site.gases
                .iter()
                .map(|amounts| 0.5 * (absorption.smooth(0, &keep(amounts)) + absorption.smooth(1, &keep(amounts))))
                .sum()
        };
        let pairs = |a: &Amounts| Amounts { oxygen_pairs: a.oxygen_pairs, ..Amounts::default() };
        for (wavelength, low, high) in [(0.4773, 0.006, 0.01), (0.5772, 0.011, 0.016), (0.63, 0.007, 0.011)] {
            let depth = depth(wavelength, &pairs);
            assert!((low..high).contains(&depth), "{wavelength}: {depth}");
        }
        let continuum = |a: &Amounts| Amounts {
            water_self: a.water_self,
            water_self_cold: a.water_self_cold,
            water_foreign: a.water_foreign,
            ..Amounts::default()
        };
        let lost = 1.0 - (-depth(0.9375, &continuum)).exp();
        assert!((lost - 0.0725).abs() < 0.002, "{lost}");
    }

    #[test]
    fn a_cloud_lies_between_its_base_and_top_with_its_optical_depth() {
        let cloud = crate::Cloud { optical_depth: 8.0, base: 830.0, top: 1430.0 };
        let site = Site::new(&Column { clouds: vec![cloud], ..column() }).unwrap();
        let medium = &site.media(&at(0.55)).unwrap()[0];
        let of: Vec<f64> = medium.layers.iter().map(|layer| *layer.scattering.last().unwrap()).collect();
        assert!((of.iter().sum::<f64>() / 8.0 - 1.0).abs() < 1e-4);
        for (pair, depth) in site.strata.heights.windows(2).zip(&of) {
            assert_eq!(*depth > 0.0, pair[0] <= 1430.0 && pair[1] >= 830.0, "{pair:?}");
        }
        let upside_down = crate::Cloud { base: 2000.0, ..cloud };
        let fault = Site::new(&Column { clouds: vec![upside_down], ..column() }).err().unwrap();
        assert_eq!(fault.code, "A01");
    }

    #[test]
    fn what_the_tables_do_not_know_is_an_error() {
        let code = |column: Column| Site::new(&column).err().map(|error| error.code);
        assert_eq!(code(Column { profile: "mars".to_string(), ..column() }), Some("A01"));
        assert_eq!(code(Column { aerosol: Some(("smoke".to_string(), Args::default())), ..column() }), Some("A01"));
        let site = Site::new(&column()).unwrap();
        assert_eq!(site.media(&at(1.2)).err().map(|error| error.code), Some("M04"));
        assert_eq!(site.media(&at(0.35)).err().map(|error| error.code), Some("M04"));
    }

    #[test]
    fn optical_depths_of_a_whole_spectrum_are_finite_and_not_negative() {
        let grid = grid();
        for (temperature, humidity, elevation) in [(240.0, 0.0, 0.0), (318.0, 1.0, -400.0), (270.0, 0.5, 8800.0)] {
            let weather = Column { temperature: Some(temperature), humidity: Some(humidity), elevation, ..column() };
            let site = Site::new(&weather).unwrap();
            for medium in site.media(&grid).unwrap() {
                for layer in &medium.layers {
                    assert_eq!(layer.scattering.len(), medium.phases.len());
                    let good = |depth: &f64| depth.is_finite() && *depth >= 0.0;
                    assert!(good(&layer.absorption) && layer.scattering.iter().all(good), "{layer:?}");
                }
            }
        }
    }
}
