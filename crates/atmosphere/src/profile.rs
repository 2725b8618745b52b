//! The named profiles of pressure, temperature and gases \[Anderson1986\], above a site.

use std::sync::LazyLock;

use crate::embedded;
use crate::vertical::Vertical;

/// Air at levels of altitude: a model atmosphere of AFGL-TR-86-0110, or a radiosonde's ascent grafted onto one.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    levels: Vec<Level>,
}

/// One level of a [`Profile`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Altitude above sea level \[km\].
    pub z: f64,
    /// Pressure \[hPa\].
    pub p: f64,
    /// Temperature \[K\].
    pub t: f64,
    /// Air \[molecules cm⁻³\].
    pub n: f64,
    /// Volume mixing ratio of water \[ppmv\].
    pub h2o: f64,
    /// Volume mixing ratio of ozone \[ppmv\].
    pub o3: f64,
}

/// Loschmidt's number \[cm⁻³ atm⁻¹\] at 273.15 K.
pub(crate) const LOSCHMIDT: f64 = 2.686_780e19;
/// Grams of water in a molecule.
pub(crate) const WATER_MOLECULE: f64 = 18.015_28 / 6.022_140_76e23;

/// The names a scene may use, in the order of the report.
pub(crate) const NAMES: [&str; 6] =
    ["tropical", "midlatitude_summer", "midlatitude_winter", "subarctic_summer", "subarctic_winter", "us_standard"];

static PROFILES: LazyLock<[Profile; 6]> = LazyLock::new(|| {
    [
        include_str!("../data/profile_afgl1986_tropical.csv"),
        include_str!("../data/profile_afgl1986_midlatitude_summer.csv"),
        include_str!("../data/profile_afgl1986_midlatitude_winter.csv"),
        include_str!("../data/profile_afgl1986_subarctic_summer.csv"),
        include_str!("../data/profile_afgl1986_subarctic_winter.csv"),
        include_str!("../data/profile_afgl1986_us_standard_1976.csv"),
    ]
    .map(|text| Profile {
        levels: (embedded::rows(text).iter())
            .map(|row| Level { z: row[0], p: row[1], t: row[2], n: row[3], h2o: row[4], o3: row[5] })
            .collect(),
    })
});

impl Profile {
    /// The profile of a name.
    pub fn named(name: &str) -> Option<&'static Self> {
        NAMES.iter().position(|known| *known == name).map(|i| &PROFILES[i])
    }

    /// From levels whose altitudes ascend, two at least.
    pub(crate) fn new(levels: Vec<Level>) -> Self {
        Self { levels }
    }

    /// The levels, ascending.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Everything at an altitude \[m\]: temperature straight between levels, the rest exponential; beyond the levels the
    /// mixing ratios of the end.
    pub(crate) fn at(&self, altitude: f64) -> Level {
        let (a, b, t) = self.around(altitude);
        let inside = t.clamp(0.0, 1.0);
        let power = |a: f64, b: f64, t: f64| if a > 0.0 && b > 0.0 { a * (b / a).powf(t) } else { a + (b - a) * t };
        Level {
            z: 1e-3 * altitude,
            p: power(a.p, b.p, t),
            t: a.t + (b.t - a.t) * t.min(1.0),
            n: power(a.n, b.n, t),
            h2o: power(a.h2o, b.h2o, inside),
            o3: power(a.o3, b.o3, inside),
        }
    }

    /// Pressure \[hPa\] at an altitude \[m\], exponential between levels and beyond them.
    pub fn pressure(&self, altitude: f64) -> f64 {
        let (a, b, t) = self.around(altitude);
        a.p * (b.p / a.p).powf(t)
    }

    /// Temperature \[K\] at an altitude \[m\], straight between levels; the lowest lapse rate goes on below them.
    pub fn temperature(&self, altitude: f64) -> f64 {
        let (a, b, t) = self.around(altitude);
        a.t + (b.t - a.t) * t.min(1.0)
    }

    /// Pressure of water vapour \[hPa\] at an altitude \[m\].
    pub fn vapour_pressure(&self, altitude: f64) -> f64 {
        let (a, b, t) = self.around(altitude);
        let ppmv = a.h2o * (b.h2o / a.h2o).powf(t);
        1e-6 * ppmv * self.pressure(altitude)
    }

    /// Air above an altitude \[m\], and its column \[molecules cm⁻²\].
    pub(crate) fn air(&self, altitude: f64) -> (Vertical, f64) {
        self.vertical(altitude, |level| level.n * 100.0)
    }

    /// Precipitable water above an altitude \[m\], ∫ ρ_v dz \[g cm⁻²\].
    pub fn precipitable_water(&self, altitude: f64) -> f64 {
        self.water(altitude).1
    }

    /// Water above an altitude \[m\], and its column \[g cm⁻²\].
    pub(crate) fn water(&self, altitude: f64) -> (Vertical, f64) {
        self.vertical(altitude, |level| 1e-6 * level.h2o * level.n * 100.0 * WATER_MOLECULE)
    }

    /// Ozone above an altitude \[m\], and its column \[atm-cm\].
    pub(crate) fn ozone(&self, altitude: f64) -> (Vertical, f64) {
        self.vertical(altitude, |level| 1e-6 * level.o3 * level.n * 100.0 / LOSCHMIDT)
    }

    /// A constituent above an altitude \[m\] from its amount per metre, and its column.
    pub(crate) fn vertical(&self, altitude: f64, per_metre: impl Fn(&Level) -> f64) -> (Vertical, f64) {
        let levels: Vec<(f64, f64)> =
            self.levels.iter().map(|level| (1000.0 * level.z - altitude, per_metre(level))).collect();
        Vertical::new(&levels)
    }

    /// The same air with other amounts of water and ozone.
    pub(crate) fn scaled(mut self, water: f64, ozone: f64) -> Self {
        self.levels.iter_mut().for_each(|level| {
            level.h2o *= water;
            level.o3 *= ozone;
        });
        self
    }

    /// Volume mixing ratio of nitrogen dioxide \[ppmv\] at an altitude \[km\], the same in all six atmospheres.
    pub(crate) fn nitrogen_dioxide(altitude: f64) -> f64 {
        static RATIO: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| {
            let text = include_str!("../data/profile_afgl1986_us_standard_1976.csv");
            embedded::rows(text).iter().map(|row| (row[0], row[6])).collect()
        });
        let i = RATIO.partition_point(|(z, _)| *z <= altitude).clamp(1, RATIO.len() - 1);
        let ((a, below), (b, above)) = (RATIO[i - 1], RATIO[i]);
        below * (above / below).powf(((altitude - a) / (b - a)).clamp(0.0, 1.0))
    }

    /// The levels about an altitude \[m\] and the place between them, 0..1; outside that where the profile ends.
    fn around(&self, altitude: f64) -> (Level, Level, f64) {
        let z = 1e-3 * altitude.clamp(-5000.0, 1e6);
        let i = self.levels.partition_point(|level| level.z <= z).clamp(1, self.levels.len() - 1);
        let (a, b) = (self.levels[i - 1], self.levels[i]);
        (a, b, (z - a.z) / (b.z - a.z))
    }
}

/// Pressure of saturated vapour over water \[hPa\] at a temperature \[K\]: Magnus' form with the constants of
/// \[WMO2018\], annex 4.B; for −45 to 60 °C.
pub(crate) fn saturation_pressure(temperature: f64) -> f64 {
    let t = (temperature - 273.15).max(-200.0);
    6.112 * (17.62 * t / (243.12 + t)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns above sea level of the same six atmospheres as MODTRAN 6 lists them (its manual, "Model atmosphere",
    /// table 1; H₂O and O₃ in atm-cm). It sums over other layers than ours, which makes 1.2 % of water and 1.7 % of ozone.
    #[test]
    fn the_columns_are_those_that_modtran_lists() {
        let listed = [
            (5119.4, 0.277_27),
            (3635.9, 0.331_76),
            (1059.7, 0.376_81),
            (2589.4, 0.344_92),
            (517.73, 0.375_5),
            (1762.3, 0.343_56),
        ];
        for (name, (water, ozone)) in NAMES.iter().zip(listed) {
            let profile = Profile::named(name).unwrap();
            let (w, o) = (profile.water(0.0).1, profile.ozone(0.0).1);
            assert!((w / (water * LOSCHMIDT * WATER_MOLECULE) - 1.0).abs() < 0.015, "{name}: water {w}");
            assert!((o / ozone - 1.0).abs() < 0.02, "{name}: ozone {o}");
        }
        assert!(Profile::named("venus").is_none());
    }

    /// Hydrostatics: the air above a site weighs its pressure, p = N m g; g varies by 0.3 % over a scale height.
    #[test]
    fn the_air_above_a_site_weighs_its_pressure() {
        for altitude in [-400.0, 0.0, 168.0, 2500.0, 8000.0] {
            let profile = Profile::named("us_standard").unwrap();
            let weight = profile.air(altitude).1 * 28.9644e-3 / 6.022_140_76e23 * 1e4 * 9.80665 * 1e-2;
            assert!((weight / profile.pressure(altitude) - 1.0).abs() < 0.006, "{altitude} m: {weight} hPa");
        }
    }

    #[test]
    fn saturated_air_at_twenty_degrees_holds_23_hectopascal() {
        // 23.39 hPa on Wexler's scale; Magnus' form keeps to 0.3 %.
        assert!((saturation_pressure(293.15) / 23.39 - 1.0).abs() < 0.003);
    }
}
