//! Where the sun stands, when it rises and sets: NREL's solar position algorithm \[Reda2004\] with its refraction.
//! Times are Julian dates of UTC, which stands for UT1 (they differ by less than 0.9 s); ΔT is estimated.

use std::f64::consts::FRAC_PI_2;

use solar_positioning::{Location, SolarPositions, delta_t, time::JulianDate};
use sunglint_radiometry::WorldDir;

use crate::Sun;

/// A place on the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Geographic latitude, north positive, −π/2..π/2 \[rad\].
    pub latitude: f64,
    /// Longitude, east positive \[rad\].
    pub longitude: f64,
    /// Elevation above sea level \[m\].
    pub elevation: f64,
}

/// The sun at one time, seen from one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunPosition {
    /// Towards the refracted sun.
    pub apparent: WorldDir,
    /// Topocentric zenith angle without refraction \[rad\].
    pub true_zenith: f64,
    /// Topocentric zenith angle with refraction \[rad\].
    pub apparent_zenith: f64,
    /// Azimuth, clockwise from north, 0..2π \[rad\].
    pub azimuth: f64,
    /// Earth–Sun distance \[au\].
    pub distance_au: f64,
    /// Ordinal day of the year in UTC, 1 for the first of January.
    pub day_of_year: u16,
}

impl SunPosition {
    /// What the providers need of it.
    pub fn sun(&self) -> Sun {
        Sun {
            apparent: self.apparent,
            true_zenith: self.true_zenith,
            distance: self.distance_au,
            day_of_year: self.day_of_year,
        }
    }
}

impl Sun {
    /// The sun at a given place in the sky, zenith angle and azimuth (clockwise from north) \[rad\], at 1 au. The angles
    /// are those of the sun as seen: no refraction is added.
    pub fn at(zenith: f64, azimuth: f64) -> Self {
        let apparent = WorldDir::from_zenith_azimuth(zenith, azimuth);
        Self { apparent, true_zenith: zenith, distance: 1.0, day_of_year: 0 }
    }

    /// Whether the centre of the refracted sun stands above the horizon. Where it does not, τ₁ is 0.
    pub fn is_up(&self) -> bool {
        self.apparent.cos_zenith() > 0.0
    }
}

/// Why the sun has no position.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SunError {
    /// ΔT is known, or guessed, for the years −500 to 3000 alone.
    #[error("the sun's position is computed for the years -500 to 3000")]
    Time,
    /// Latitude beyond a pole, or a coordinate that is not finite.
    #[error("a latitude lies within -90 to 90 deg, and coordinates are finite")]
    Place,
}

/// Position of the sun at `utc_julian_day`. Refraction follows SPA eq. 42 with surface pressure \[hPa\] and temperature
/// \[K\]; it is applied down to a true altitude of −0.8334°, where the upper limb touches the horizon, and below that
/// the sun is left where it is.
///
/// # Errors
/// A time outside the years −500 to 3000, or a place that is none.
pub fn sun_position(
    place: &Place,
    utc_julian_day: f64,
    pressure_hpa: f64,
    temperature_k: f64,
) -> Result<SunPosition, SunError> {
    let (zenith, azimuth, distance_au) = topocentric(place, utc_julian_day)?;
    let apparent_zenith = zenith - refraction(FRAC_PI_2 - zenith, pressure_hpa, temperature_k);
    Ok(SunPosition {
        apparent: WorldDir::from_zenith_azimuth(apparent_zenith, azimuth),
        true_zenith: zenith,
        apparent_zenith,
        azimuth,
        distance_au,
        day_of_year: day_of_year(utc_julian_day),
    })
}

/// Zenith angle and azimuth without refraction \[rad\], and the distance \[au\].
fn topocentric(place: &Place, utc_julian_day: f64) -> Result<(f64, f64, f64), SunError> {
    let turn = std::f64::consts::TAU;
    let longitude = (place.longitude + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
    let at = Location {
        latitude: place.latitude.to_degrees(),
        longitude: longitude.to_degrees().clamp(-180.0, 180.0), // the clamp keeps NaN, which SPA refuses
    };
    let year = 2000.0 + (utc_julian_day - 2_451_544.5) / 365.2425;
    let delta_t = delta_t::estimate(year).map_err(|_| SunError::Time)?;
    let time = JulianDate::new(utc_julian_day, delta_t).map_err(|_| SunError::Time)?;
    let sun = SolarPositions::new().for_time_from_julian(time).map_err(|_| SunError::Time)?;
    let seen = sun.at(at, place.elevation, None).map_err(|_| SunError::Place)?;
    let distance = sun.earth_radius_vector().unwrap_or(1.0);
    Ok((seen.zenith_angle().to_radians(), seen.azimuth().to_radians(), distance))
}

/// Lift of the sun \[rad\] at a true altitude \[rad\], SPA eq. 42.
fn refraction(altitude: f64, pressure_hpa: f64, temperature_k: f64) -> f64 {
    let e = altitude.to_degrees();
    if e < -(0.266_67 + 0.566_7) || pressure_hpa <= 0.0 || temperature_k <= 1.0 {
        return 0.0;
    }
    let air = (pressure_hpa / 1010.0) * (283.0 / (273.0 + (temperature_k - 273.15)));
    let lift = air * 1.02 / (60.0 * (e + 10.3 / (e + 5.11)).to_radians().tan());
    lift.max(0.0).to_radians() // the fit turns negative by some 0.1″ at the zenith
}

/// Ordinal day of a Julian date, in the Gregorian calendar.
fn day_of_year(julian_day: f64) -> u16 {
    // Days from the first of March of year 0, in cycles of 400 years (Richards 1998 and others).
    let days = (julian_day + 0.5).floor() as i64 - 1_721_120;
    let day_of_era = days.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let from_march = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let day = if from_march >= 306 {
        from_march - 305 // January and February belong to the year that begins two months earlier
    } else {
        let leap = year_of_era % 4 == 0 && (year_of_era % 100 != 0 || year_of_era == 0);
        from_march + 60 + i64::from(leap)
    };
    day as u16
}

/// What the sun does around one solar noon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Daylight {
    /// It is above the horizon for a part of the time.
    RisesOrSets,
    /// It does not set.
    PolarDay,
    /// It does not rise.
    PolarNight,
}

/// Sunrise, solar noon and sunset of one day, Julian dates of UTC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunEvents {
    /// The last rise within half a day before noon; none in the polar day and night, nor on some of the days between.
    /// Where the sun is down at noon, as it can be near the poles on a day when it sets, the one rise there is.
    pub sunrise: Option<f64>,
    /// The first set within half a day after noon, with the same exception.
    pub sunset: Option<f64>,
    /// Upper transit of the meridian.
    pub solar_noon: f64,
    /// Which of the three cases.
    pub daylight: Daylight,
}

/// Topocentric altitude of the sun's centre when its upper limb is seen at the horizon: 16′ of radius and 34′ of
/// refraction \[rad\].
const RISING_ALTITUDE: f64 = -0.8333 * std::f64::consts::PI / 180.0;

/// Sunrise and sunset about the solar noon of the day that runs from `start` to `end` (Julian dates of UTC of the local
/// midnights). The upper limb, standard refraction, a level horizon; good to the second. The day's light belongs to its
/// noon: where the day is counted in a far zone, sunrise may lie before `start` or sunset after `end`. Where no noon
/// falls in the day, the noon nearest its middle counts.
///
/// # Errors
/// As [`sun_position`].
pub fn sunrise_sunset(place: &Place, start: f64, end: f64) -> Result<SunEvents, SunError> {
    let solar_noon = noon(place, start, end)?;
    // Altitude above the rising altitude, sampled; extremes between samples are found, so that no grazing is missed.
    const HALF: usize = 24;
    let height = |t: f64| topocentric(place, t).map(|(zenith, ..)| FRAC_PI_2 - zenith - RISING_ALTITUDE);
    let mut knots = Vec::with_capacity(2 * HALF + 8);
    for i in 0..=2 * HALF {
        let t = solar_noon - 0.5 + i as f64 / (2 * HALF) as f64;
        knots.push((t, height(t)?));
    }
    let mut extremes = Vec::new();
    for k in knots.windows(3) {
        for sign in [1.0, -1.0] {
            if sign * k[1].1 >= sign * k[0].1 && sign * k[1].1 >= sign * k[2].1 {
                let t = maximum(k[0].0, k[2].0, |t| Ok(sign * height(t)?))?;
                extremes.push((t, height(t)?));
            }
        }
    }
    knots.extend(extremes);
    knots.push((solar_noon, height(solar_noon)?));
    knots.sort_by(|a, b| a.0.total_cmp(&b.0));

    let daylight = if knots.iter().all(|k| k.1 > 0.0) {
        Daylight::PolarDay
    } else if knots.iter().all(|k| k.1 <= 0.0) {
        Daylight::PolarNight
    } else {
        Daylight::RisesOrSets
    };
    let (mut rises, mut sets) = (Vec::new(), Vec::new());
    for k in knots.windows(2) {
        let (a, b) = (k[0], k[1]);
        if a.1 <= 0.0 && b.1 > 0.0 {
            rises.push(crossing(a.0, b.0, height)?);
        } else if a.1 > 0.0 && b.1 <= 0.0 {
            sets.push(crossing(b.0, a.0, height)?);
        }
    }
    let dark_noon = height(solar_noon)? <= 0.0;
    let rise_before = rises.iter().rev().find(|t| **t <= solar_noon);
    let set_after = sets.iter().find(|t| **t >= solar_noon);
    Ok(SunEvents {
        sunrise: rise_before.or(rises.first().filter(|_| dark_noon)).copied(),
        sunset: set_after.or(sets.last().filter(|_| dark_noon)).copied(),
        solar_noon,
        daylight,
    })
}

/// Upper transit in `start..end`: the sun passes from east to west of the meridian.
fn noon(place: &Place, start: f64, end: f64) -> Result<f64, SunError> {
    let middle = 0.5 * (start + end);
    let west = |t: f64| topocentric(place, t).map(|(zenith, azimuth, _)| -zenith.sin() * azimuth.sin());
    let near = |guess: f64| crossing(guess - 0.1, guess + 0.1, west); // the equation of time stays below 17 min
    // Mean noon: UT 12 h − longitude, a whole Julian day at Greenwich.
    let turns = place.longitude / std::f64::consts::TAU;
    let guess = (middle + turns).round() - turns;
    let found = near(guess)?;
    for other in [guess - 1.0, guess + 1.0] {
        if !(start..end).contains(&found) && (start - 0.1..end + 0.1).contains(&other) {
            let second = near(other)?;
            if (start..end).contains(&second) {
                return Ok(second);
            }
        }
    }
    Ok(found)
}

/// Where `f` passes from not positive at `low` to positive at `high` (either may be the earlier), to 1 ms.
fn crossing(mut low: f64, mut high: f64, f: impl Fn(f64) -> Result<f64, SunError>) -> Result<f64, SunError> {
    while (high - low).abs() > 1e-8 {
        let middle = 0.5 * (low + high);
        if f(middle)? > 0.0 { high = middle } else { low = middle }
    }
    Ok(0.5 * (low + high))
}

/// The time of the maximum of `f` between two times, by golden section, to a second.
fn maximum(mut a: f64, mut b: f64, f: impl Fn(f64) -> Result<f64, SunError>) -> Result<f64, SunError> {
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut c, mut d) = (b - ratio * (b - a), a + ratio * (b - a));
    let (mut fc, mut fd) = (f(c)?, f(d)?);
    while b - a > 1e-5 {
        if fc > fd {
            (b, d, fd) = (d, c, fc);
            c = b - ratio * (b - a);
            fc = f(c)?;
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + ratio * (b - a);
            fd = f(d)?;
        }
    }
    Ok(0.5 * (a + b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_of_the_year_follow_the_gregorian_calendar() {
        // 2000-01-01 12:00 is JD 2451545; 1900 was no leap year, 2000 was.
        assert_eq!(day_of_year(2_451_545.0), 1);
        assert_eq!(day_of_year(2_451_544.49), 365);
        assert_eq!(day_of_year(2_451_544.5 + 59.0), 60); // 29 February 2000
        assert_eq!(day_of_year(2_451_544.5 + 365.0), 366);
        assert_eq!(day_of_year(2_415_020.5 + 59.0), 60); // 1 March 1900
        assert_eq!(day_of_year(2_415_020.5 + 364.0), 365);
        assert_eq!(day_of_year(2_448_791.5), 170); // 18 June 1992
    }

    #[test]
    fn a_place_that_is_none_is_an_error() {
        let place = |latitude: f64, longitude: f64| Place { latitude, longitude, elevation: 0.0 };
        assert_eq!(sun_position(&place(1.6, 0.0), 2_451_545.0, 1013.0, 288.0), Err(SunError::Place));
        assert_eq!(sun_position(&place(0.0, f64::NAN), 2_451_545.0, 1013.0, 288.0), Err(SunError::Place));
        assert_eq!(sun_position(&place(0.0, 0.0), 1e9, 1013.0, 288.0), Err(SunError::Time));
        assert_eq!(sun_position(&place(0.0, 0.0), f64::NAN, 1013.0, 288.0), Err(SunError::Time));
        assert!(sun_position(&place(0.3, 5.0), 2_451_545.0, 0.0, 0.0).is_ok());
    }
}
