//! A radiosonde's ascent, grafted onto a named profile.
//!
//! ```text
//! e    = e_s(T_d),  RH e_s(T),  or  w p/(0.62198 + w)        e_s over water [WMO2018, annex 4.B]
//! n    = p/(k T)                                             x_H2O = e/p
//! W    = ∫ ρ_v dz = m_w ∫ x n dz                             exponential between levels
//! z₂ − z₁ = (R_d/g) ∫ T_v d ln(1/p),  T_v = T (1 + 0.378 e/p)  heights and pressures agree [WMO2018]
//! ```
//!
//! Empty cells of temperature are straight, of pressure exponential, of moisture exponential in mixing ratio between
//! their neighbours in altitude. Above its highest level the ascent is continued by the named profile, pressure and density in
//! proportion so that pressure is continuous; above its highest moisture, by the profile's mixing ratio, and ozone is the profile's
//! throughout. A site below the lowest level lies in air of 6.5 K/km and the lowest mixing ratio, hydrostatically.
//! Altitudes are taken as they stand; geopotential metres are 0.05 % short of metres at 3 km.

use crate::AtmosphereError;
use crate::column::named;
use crate::profile::{Level, Profile, saturation_pressure};

/// What a level says of its moisture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moisture {
    /// Relative humidity over water, 0..1.
    RelativeHumidity(f64),
    /// Dew point \[K\].
    DewPoint(f64),
    /// Mass of vapour over mass of dry air.
    MixingRatio(f64),
}

/// One level of an ascent; `None` is a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoundingLevel {
    /// Pressure \[hPa\].
    pub pressure: Option<f64>,
    /// Above sea level \[m\].
    pub altitude: Option<f64>,
    /// Temperature \[K\].
    pub temperature: Option<f64>,
    /// Moisture.
    pub moisture: Option<Moisture>,
}

/// An ascent over a profile.
#[derive(Clone, Debug, PartialEq)]
pub struct Grafted {
    /// The levels, from the site or below it to the top of the named profile.
    pub profile: Profile,
    /// What was filled, left out or found doubtful, in words.
    pub notes: Vec<String>,
}

const BOLTZMANN: f64 = 1.380_649e-23;
/// R_d/g \[m K⁻¹\].
const METRES_PER_KELVIN: f64 = 287.04 / 9.80665;
/// Lapse of the standard atmosphere \[K m⁻¹\].
const STANDARD_LAPSE: f64 = 0.0065;
/// A site further below the lowest level than this \[m\] is told.
const FAR_BELOW: f64 = 500.0;
/// An ascent that ends below this level \[hPa\] misses part of the water.
const HIGH_ENOUGH: f64 = 300.0;
/// Share by which heights and hydrostatic heights may differ.
const HYDROSTATIC: f64 = 0.03;

/// Levels, lowest first, over the profile of a name, for a site at `elevation` \[m\].
///
/// # Errors
/// `A01` for an unknown profile; `A02` where fewer than two levels are complete or the site lies above the ascent.
pub fn graft(levels: &[SoundingLevel], name: &str, elevation: f64) -> Result<Grafted, AtmosphereError> {
    let base = named(name)?;
    let fault = |message: String| AtmosphereError { code: "A02", message };
    let mut notes = Vec::new();
    let placed = placed(levels);
    let known: Vec<(f64, f64)> = placed.iter().filter_map(|(z, _, level)| Some((*z, level.temperature?))).collect();
    let mut filled = Tally::default();
    let mut lost = levels.len() - placed.len();
    let mut air: Vec<(f64, f64, f64, Option<Moisture>)> = Vec::with_capacity(placed.len());
    for (z, p, level) in &placed {
        let Some(t) = level.temperature.or_else(|| line(&known, *z)) else {
            lost += 1;
            continue;
        };
        if level.temperature.is_none() {
            filled.add(*p);
        }
        air.push((*z, *p, t, level.moisture));
    }
    if air.len() < 2 {
        return Err(fault(format!("the sounding has {} complete levels; two are needed", air.len())));
    }
    filled.tell("temperature", "straight lines between the neighbours", &mut notes);
    if lost > 0 {
        notes
            .push(format!("{lost} levels of the sounding are left out: they cannot be placed, or have no temperature"));
    }

    // Moisture: what is known, as the logarithm of the mixing ratio against altitude.
    let mut wet = Vec::new();
    let mut soaked = Tally::default();
    for (z, p, t, moisture) in &air {
        let Some(moisture) = moisture else { continue };
        let saturated = saturation_pressure(*t);
        let vapour = match *moisture {
            Moisture::RelativeHumidity(humidity) => humidity * saturated,
            Moisture::DewPoint(point) => {
                if point > t + 0.5 {
                    soaked.add(*p);
                }
                saturation_pressure(point.min(*t))
            }
            Moisture::MixingRatio(w) => w * p / (0.621_98 + w),
        };
        wet.push((*z, (1e6 * vapour / p).clamp(1e-6, 5e5).ln()));
    }
    soaked.tell("dew point lies above the temperature", "the air is taken as saturated", &mut notes);
    let mut gaps = Tally::default();
    let mut dry_from = None;
    let mut joined: Vec<Level> = Vec::with_capacity(air.len() + 50);
    for (z, p, t, moisture) in &air {
        let above = wet.last().is_none_or(|last| *z > last.0);
        let ratio = match wet.first() {
            Some(first) if *z <= first.0 => first.1.exp(),
            _ if above => base.at(*z).h2o,
            _ => line(&wet, *z).map_or(base.at(*z).h2o, f64::exp),
        };
        if moisture.is_none() {
            if above { _ = dry_from.get_or_insert(*p) } else { gaps.add(*p) }
        }
        joined.push(Level { z: 1e-3 * z, p: *p, t: *t, n: density(*p, *t), h2o: ratio, o3: base.at(*z).o3 });
    }
    gaps.tell("moisture", "mixing ratios between the neighbours", &mut notes);
    match dry_from {
        _ if wet.is_empty() => notes.push(format!("the sounding has no moisture: the water is that of `{name}`")),
        Some(p) if p > HIGH_ENOUGH => notes.push(format!("from {p} hPa up the water is that of `{name}`")),
        _ => {}
    }

    check_heights(&joined, &mut notes);
    let (lowest, highest) = (joined[0], joined[joined.len() - 1]);
    if elevation > 1e3 * highest.z {
        let top = 1e3 * highest.z;
        return Err(fault(format!("the site, at {elevation} m, lies above the sounding, which ends at {top:.0} m")));
    }
    if elevation < 1e3 * lowest.z {
        let drop = 1e3 * lowest.z - elevation;
        if drop > FAR_BELOW {
            notes.push(format!("the site lies {drop:.0} m below the sounding: standard air of 6.5 K/km between them"));
        }
        let t = lowest.t + STANDARD_LAPSE * drop;
        let p = lowest.p * (drop / (METRES_PER_KELVIN * virtual_temperature(0.5 * (t + lowest.t), lowest.h2o))).exp();
        joined.insert(0, Level { z: 1e-3 * elevation, p, t, n: density(p, t), ..lowest });
    }
    if highest.p > HIGH_ENOUGH {
        let (p, z) = (highest.p, 1e3 * highest.z);
        notes.push(format!("the sounding ends at {p} hPa ({z:.0} m); above, the air is that of `{name}`"));
    }
    let scale = highest.p / base.at(1e3 * highest.z).p;
    let above = base.levels().iter().filter(|level| level.z > highest.z + 0.1);
    joined.extend(above.map(|level| Level { p: level.p * scale, n: level.n * scale, ..*level }));
    Ok(Grafted { profile: Profile::new(joined), notes })
}

/// Levels of known altitude \[m\] and pressure \[hPa\], ascending; what is missing of the two is filled where it can be.
fn placed(levels: &[SoundingLevel]) -> Vec<(f64, f64, SoundingLevel)> {
    let both: Vec<(f64, f64)> =
        levels.iter().filter_map(|level| Some((level.altitude?, -level.pressure?.ln()))).collect();
    let turned: Vec<(f64, f64)> = both.iter().map(|(z, x)| (*x, *z)).collect();
    let mut out: Vec<(f64, f64, SoundingLevel)> = Vec::with_capacity(levels.len());
    for level in levels {
        let place = match (level.altitude, level.pressure) {
            (Some(z), Some(p)) => Some((z, p)),
            (Some(z), None) => line(&both, z).map(|x| (z, (-x).exp())),
            (None, Some(p)) => line(&turned, -p.ln()).map(|z| (z, p)),
            (None, None) => None,
        };
        let rises = |(z, p): &(f64, f64)| out.last().is_none_or(|(below, more, _)| z > below && p < more);
        if let Some((z, p)) = place.filter(rises) {
            out.push((z, p, *level));
        }
    }
    out
}

/// A broken line through points that ascend; `None` beyond its ends.
fn line(points: &[(f64, f64)], x: f64) -> Option<f64> {
    let (first, last) = (points.first()?, points.last()?);
    if x < first.0 || x > last.0 {
        return None;
    }
    let i = points.partition_point(|(at, _)| *at < x);
    let (b, y) = points[i];
    if b == x || i == 0 {
        return Some(y);
    }
    let (a, before) = points[i - 1];
    Some(before + (y - before) * (x - a) / (b - a))
}

/// n = p/(k T) \[cm⁻³\].
fn density(pressure: f64, temperature: f64) -> f64 {
    1e-6 * 100.0 * pressure / (BOLTZMANN * temperature)
}

fn virtual_temperature(temperature: f64, water_ppmv: f64) -> f64 {
    temperature * (1.0 + 0.378 * 1e-6 * water_ppmv)
}

/// Tells heights that the pressures contradict: feet for metres, kelvin for degrees.
fn check_heights(levels: &[Level], notes: &mut Vec<String>) {
    let layer = |pair: &[Level]| {
        let mean = 0.5 * pair.iter().map(|level| virtual_temperature(level.t, level.h2o)).sum::<f64>();
        METRES_PER_KELVIN * mean * (pair[0].p / pair[1].p).ln()
    };
    let due: f64 = levels.windows(2).map(layer).sum();
    let said = 1e3 * (levels[levels.len() - 1].z - levels[0].z);
    if (said - due).abs() > HYDROSTATIC * due && (said - due).abs() > 50.0 {
        notes.push(format!(
            "the sounding's heights span {said:.0} m, but its pressures and temperatures make {due:.0} m: are the units right?"
        ));
    }
}

/// Levels at fault, by their pressures.
#[derive(Default)]
struct Tally {
    count: usize,
    first: Vec<f64>,
}

impl Tally {
    fn add(&mut self, pressure: f64) {
        self.count += 1;
        if self.first.len() < 3 {
            self.first.push((pressure * 100.0).round() / 100.0);
        }
    }

    fn tell(&self, what: &str, cure: &str, notes: &mut Vec<String>) {
        if self.count > 0 {
            let first: Vec<String> = self.first.iter().map(f64::to_string).collect();
            let (plural, more) = (if self.count == 1 { "" } else { "s" }, if self.count > 3 { ", …" } else { "" });
            let verb = if what.contains(' ') { format!("the {what}") } else { format!("the {what} is missing") };
            notes.push(format!("at {} level{plural} ({}{more} hPa) {verb}: {cure}", self.count, first.join(", ")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Vec<SoundingLevel> {
        let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
        (reader.records())
            .map(|record| {
                let record = record.unwrap();
                let cell = |i: usize| record[i].parse::<f64>().ok();
                SoundingLevel {
                    pressure: cell(0),
                    altitude: cell(1),
                    temperature: cell(2).map(|t| t + 273.15),
                    moisture: cell(3).map(|t| Moisture::DewPoint(t + 273.15)),
                }
            })
            .collect()
    }

    const STORMY: &str = include_str!("../tests/data/buf_19890628_00z.csv");
    const DRY: &str = include_str!("../tests/data/buf_20060414_00z.csv");

    /// −(1/ρ_w g) ∫ q dp with MetPy 1.7.1's specific humidity, 45.865 and 12.307 mm, and ∫ ρ_v dz with Bolton's saturation pressure,
    /// 45.765 and 12.299 mm, both by trapezoids (`benches/peers/precipitable_water`). They differ by 0.2 %; trapezoids are up to 0.1 %
    /// above exponentials, and the profile adds less than 0.1 % above the highest dew point (268 hPa): 0.5 % covers these.
    /// MetPy's own precipitable_water, 46.296 and 12.357 mm, integrates the mixing ratio, larger than q by the vapour's share of air.
    #[test]
    fn the_water_of_two_ascents_is_what_metpy_and_a_sum_by_hand_make_of_them() {
        for (text, metpy, by_hand, elevation) in [(STORMY, 4.5865, 4.5765, 218.0), (DRY, 1.2307, 1.2299, 215.0)] {
            let air = graft(&read(text), "midlatitude_summer", elevation).unwrap();
            let water = air.profile.precipitable_water(elevation);
            assert!((water / metpy - 1.0).abs() < 0.005, "{water} against {metpy}");
            assert!((water / by_hand - 1.0).abs() < 0.005, "{water} against {by_hand}");
            assert!(air.notes.is_empty(), "{:?}", air.notes);
        }
    }

    /// Saturated isothermal air of scale height H in hydrostatic balance: e is the same everywhere, so W = ρ_v times the depth.
    #[test]
    fn saturated_air_of_one_temperature_holds_its_vapour_density_times_its_depth() {
        let (t, depth) = (283.15, 2000.0);
        let e = saturation_pressure(t);
        let scale = METRES_PER_KELVIN * t;
        let level = |z: f64| SoundingLevel {
            pressure: Some(1000.0 * (-z / scale).exp()),
            altitude: Some(z),
            temperature: Some(t),
            moisture: Some(Moisture::RelativeHumidity(1.0)),
        };
        let levels: Vec<SoundingLevel> = (0..=20).map(|i| level(depth / 20.0 * f64::from(i))).collect();
        let air = graft(&levels, "us_standard", 0.0).unwrap().profile;
        let density = 100.0 * e / (8.314_462_6 / 0.018_015_28 * t); // ρ_v = e/(R_v T) [kg m⁻³]
        let within = air.precipitable_water(0.0) - air.precipitable_water(depth);
        assert!((within / (0.1 * density * depth) - 1.0).abs() < 1e-4, "{within}");
    }

    #[test]
    fn pressure_goes_on_without_a_step_above_the_ascent_and_below_it() {
        let air = graft(&read(STORMY), "us_standard", 168.0).unwrap().profile;
        let levels = air.levels();
        assert!(levels.windows(2).all(|pair| pair[1].z > pair[0].z && pair[1].p < pair[0].p));
        // 50 m of air of 29 °C below 985 hPa weigh 5.6 hPa.
        assert!((air.pressure(168.0) - 990.5).abs() < 0.3, "{}", air.pressure(168.0));
        assert!((air.temperature(168.0) - (29.44 + 273.15 + 0.325)).abs() < 1e-9);
        let top = 16_566.0;
        let (below, above) = (air.pressure(top - 1.0), air.pressure(top + 1.0));
        assert!((below / above - 1.0).abs() < 5e-4 && levels.last().unwrap().z > 100.0);
    }

    #[test]
    fn gaps_are_filled_and_told_and_what_cannot_be_is_refused() {
        let mut levels = read(STORMY);
        let whole = graft(&levels, "us_standard", 218.0).unwrap().profile.precipitable_water(218.0);
        (levels[3].temperature, levels[5].moisture, levels[6].altitude, levels[7].pressure) = (None, None, None, None);
        let air = graft(&levels, "us_standard", 218.0).unwrap();
        assert_eq!(air.notes.len(), 2, "{:?}", air.notes);
        assert!((air.profile.precipitable_water(218.0) / whole - 1.0).abs() < 0.005);
        let feet: Vec<SoundingLevel> =
            read(DRY).iter().map(|l| SoundingLevel { altitude: l.altitude.map(|z| z / 0.3048), ..*l }).collect();
        assert!(graft(&feet, "us_standard", 700.0).unwrap().notes.iter().any(|note| note.contains("units")));
        let code = |levels: &[SoundingLevel], name: &str, z: f64| graft(levels, name, z).err().map(|e| e.code);
        assert_eq!(code(&levels, "mars", 0.0), Some("A01"));
        assert_eq!(code(&levels, "us_standard", 20_000.0), Some("A02"));
        assert_eq!(code(&levels[..1], "us_standard", 218.0), Some("A02"));
        assert_eq!(code(&[], "us_standard", 218.0), Some("A02"));
    }
}
