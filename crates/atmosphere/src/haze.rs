//! The aerosol over a site: from meteorological range or optical depth to an extinction at the surface, a column, and
//! its spread over height, by the profiles of LOWTRAN 7 \[Kneizys1988\].

use std::sync::LazyLock;

use crate::embedded;
use crate::vertical::Vertical;

/// Koschmieder's constant: ln 50, contrast 2 %.
const KOSCHMIEDER: f64 = 3.912;

/// Meteorological range of a scene that names none \[m\].
pub(crate) const DEFAULT_VISIBILITY: f64 = 23_000.0;

/// Extinction of the aerosol at 0.55 µm at the surface \[m⁻¹\], from meteorological range \[m\] and the Rayleigh
/// extinction there \[m⁻¹\]: β = 3.912/V − β_R, and 0 where the range exceeds that of pure air.
pub(crate) fn surface_extinction(visibility: f64, rayleigh: f64) -> f64 {
    (KOSCHMIEDER / visibility.max(1.0) - rayleigh).max(0.0)
}

/// Aerosol over a site.
#[derive(Clone, Debug)]
pub(crate) struct Haze {
    /// Optical depth at 0.55 µm.
    pub optical_depth: f64,
    /// Its spread over height.
    pub vertical: Vertical,
}

impl Haze {
    /// From extinction at the surface \[m⁻¹\] and the site's elevation \[m\].
    pub fn from_extinction(surface: f64, elevation: f64) -> Self {
        let (vertical, optical_depth) = Vertical::new(&levels(1e3 * surface, elevation));
        Self { optical_depth, vertical }
    }

    /// From optical depth at 0.55 µm: that surface extinction whose profile has it. Where the profile without any
    /// haze near the ground has more already, its shape is kept.
    pub fn from_optical_depth(optical_depth: f64, elevation: f64) -> Self {
        let (mut low, mut high) = (0.0, 1e-3);
        while Self::from_extinction(high, elevation).optical_depth < optical_depth && high < 1e3 {
            high *= 4.0;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if Self::from_extinction(middle, elevation).optical_depth < optical_depth {
                low = middle
            } else {
                high = middle
            }
        }
        Self { optical_depth, ..Self::from_extinction(high, elevation) }
    }
}

/// A level of LOWTRAN's table: altitude \[km\] and the extinction \[km⁻¹\] against that at the surface, ascending.
struct TableLevel {
    z: f64,
    extinction: Vec<f64>,
}

struct LowtranProfile {
    /// Extinction at the surface of each column \[km⁻¹\], ascending: 50, 23, 10, 5, 2 km.
    surface: Vec<f64>,
    levels: Vec<TableLevel>,
}

/// Boundary layer to 2 km, spring–summer troposphere to 10 km, background stratosphere to 30 km, normal upper air.
static TABLE: LazyLock<LowtranProfile> = LazyLock::new(|| {
    const RANGES: std::ops::RangeInclusive<usize> = 1..=5;
    const TROPOSPHERE_50: usize = 8;
    const TROPOSPHERE_23: usize = 9;
    const STRATOSPHERE: usize = 14;
    const UPPER: usize = 18;
    let rows = embedded::rows(include_str!("../data/aerosol_profiles_lowtran7.csv"));
    let levels = (rows.iter())
        .map(|row| {
            let extinction = match row[0] {
                z if z <= 2.0 => row[RANGES].to_vec(),
                // From 23 km downwards the range says nothing about the air above 2 km.
                z if z <= 10.0 => std::iter::once(row[TROPOSPHERE_50]).chain([row[TROPOSPHERE_23]; 4]).collect(),
                z if z <= 30.0 => vec![row[STRATOSPHERE]; 5],
                _ => vec![row[UPPER]; 5],
            };
            TableLevel { z: row[0], extinction }
        })
        .collect();
    LowtranProfile { surface: rows[0][RANGES].to_vec(), levels }
});

/// Below this altitude \[km\] the profile is squeezed onto a site above the sea.
const SQUEEZED: f64 = 6.0;

/// The altitude in LOWTRAN's table \[km\] of a height above the site \[m\].
pub(crate) fn table_altitude(height: f64, elevation: f64) -> f64 {
    let (altitude, elevation) = (1e-3 * (height + elevation), 1e-3 * elevation);
    if altitude < SQUEEZED && elevation < SQUEEZED {
        (altitude - elevation) * SQUEEZED / (SQUEEZED - elevation)
    } else {
        altitude
    }
}

/// Shares of the aerosol of the boundary layer, troposphere, stratosphere and upper air at an altitude of the table
/// \[km\]: each has its levels there, and between the last of one and the first of the next they change over.
pub(crate) fn shares(altitude: f64) -> [f64; 4] {
    const CHANGES: [(f64, f64); 3] = [(2.0, 3.0), (10.0, 11.0), (30.0, 35.0)];
    let passed = CHANGES.map(|(from, to)| ((altitude - from) / (to - from)).clamp(0.0, 1.0));
    [1.0 - passed[0], passed[0] - passed[1], passed[1] - passed[2], passed[2]]
}

/// Extinction \[m⁻¹\] at heights above the site \[m\]. The table is entered with the extinction at the surface, which is
/// straight in 1/V as LOWTRAN's interpolation is; below 6 km it is squeezed so that its ground is the site's.
fn levels(surface_per_km: f64, elevation: f64) -> Vec<(f64, f64)> {
    let table = &*TABLE;
    let i = table.surface.partition_point(|s| *s <= surface_per_km).clamp(1, table.surface.len() - 1);
    let t = (surface_per_km - table.surface[i - 1]) / (table.surface[i] - table.surface[i - 1]);
    let elevation = 1e-3 * elevation;
    let squeezed = |z: f64| {
        if z < SQUEEZED && elevation < SQUEEZED { elevation + z * (SQUEEZED - elevation) / SQUEEZED } else { z }
    };
    (table.levels.iter())
        .map(|level| {
            let (a, b) = (level.extinction[i - 1], level.extinction[i]);
            (1e3 * (squeezed(level.z) - elevation), 1e-3 * (a + t * (b - a)).max(0.0))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// LOWTRAN's own columns of extinction at the ground (0.0662 … 1.94 km⁻¹) belong to 50, 23, 10, 5 and 2 km: with the
    /// Rayleigh extinction of sea level, 0.0117 km⁻¹, Koschmieder's law returns them within their rounding.
    #[test]
    fn koschmieder_returns_the_extinctions_that_lowtran_tabulates() {
        for (visibility, tabulated) in [(50e3, 0.0662), (23e3, 0.158), (10e3, 0.379), (5e3, 0.77), (2e3, 1.94)] {
            let beta = 1e3 * surface_extinction(visibility, 0.0117e-3);
            assert!((beta - tabulated).abs() < 0.006 * tabulated, "{visibility} m: {beta}");
        }
        assert_eq!(surface_extinction(1e6, 0.0117e-3), 0.0);
    }

    /// The trapezoidal sum over the printed table for 23 km, spring–summer, is 0.369; layers that fall off
    /// exponentially hold less, by 2 % in the steepest.
    #[test]
    fn twenty_three_kilometres_of_range_mean_an_optical_depth_near_a_third() {
        let haze = Haze::from_extinction(0.158e-3, 0.0);
        assert!((0.32..0.369).contains(&haze.optical_depth), "{}", haze.optical_depth);
    }

    #[test]
    fn optical_depth_and_surface_extinction_are_two_names_for_one_haze() {
        for (beta, elevation) in [(0.05e-3, 0.0), (0.158e-3, 168.0), (0.7e-3, 2500.0), (5e-3, -300.0)] {
            let haze = Haze::from_extinction(beta, elevation);
            let back = Haze::from_optical_depth(haze.optical_depth, elevation);
            for height in [0.0, 500.0, 3000.0, 20_000.0] {
                assert!((back.vertical.above(height) - haze.vertical.above(height)).abs() < 1e-9);
            }
            let clear = Haze::from_optical_depth(1e-4, elevation);
            assert!((clear.vertical.above(0.0) - 1.0).abs() < 1e-12);
        }
    }

    /// A plateau at 3 km halves the layers below 6 km: LOWTRAN's compression, with the same extinction at the ground.
    #[test]
    fn a_high_site_has_the_same_haze_at_the_ground_and_less_of_it() {
        let (sea, plateau) = (Haze::from_extinction(0.158e-3, 0.0), Haze::from_extinction(0.158e-3, 3000.0));
        let low = sea.optical_depth * (1.0 - sea.vertical.above(6000.0));
        let high = sea.optical_depth * sea.vertical.above(6000.0);
        assert!((plateau.optical_depth - (0.5 * low + high)).abs() < 1e-12);
        let at_ground = plateau.vertical.mean(0.0, 0.0) * plateau.optical_depth;
        assert!((at_ground / 0.158e-3 - 1.0).abs() < 1e-12);
    }
}
