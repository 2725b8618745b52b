//! Clouds of water drops: effective radius 10 µm, effective variance 0.1 \[Hansen1974\], by Mie's theory.

use std::sync::{Arc, LazyLock};

use crate::aerosol::{AerosolOptics, between};
use crate::phase::Phase;

/// The table, by ascending wavelength.
struct Drops {
    /// λ \[µm\], extinction over that at 0.55 µm, ω.
    rows: Vec<[f64; 3]>,
    phases: Vec<(f64, Arc<Phase>)>,
}

static DROPS: LazyLock<Drops> = LazyLock::new(|| {
    let mut lines = include_str!("../data/cloud_water_10um.csv").lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().expect("a header").split(',').skip(4);
    let number = |cell: &str| cell.trim().parse::<f64>().expect("the table holds numbers");
    let angles: Vec<f64> = header.map(|name| number(name.trim_start_matches("p_")).to_radians()).collect();
    let (rows, phases) = lines
        .map(|line| {
            let cells: Vec<f64> = line.split(',').map(number).collect();
            ([cells[0], cells[1], cells[2]], (cells[0], Arc::new(Phase::table(&angles, &cells[4..]))))
        })
        .unzip();
    Drops { rows, phases }
});

/// Properties at a wavelength \[µm\], straight between those of the table: 1 − ω in its logarithm, since it spans
/// three orders of magnitude.
pub(crate) fn optics(wavelength: f64) -> AerosolOptics {
    let rows = &DROPS.rows;
    let i = rows.partition_point(|row| row[0] <= wavelength).clamp(1, rows.len() - 1);
    let (a, b) = (&rows[i - 1], &rows[i]);
    let t = ((wavelength - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0);
    AerosolOptics {
        extinction: a[1] + t * (b[1] - a[1]),
        albedo: 1.0 - (1.0 - a[2]) * ((1.0 - b[2]) / (1.0 - a[2])).powf(t),
        phase: between(&DROPS.phases, wavelength),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// g and 1 − ω of water clouds of 10 µm by Slingo 1989, J. Atmos. Sci. 46, 1419, table 1: 0.854 and 1.6e-6 for
    /// 0.25–0.69 µm, 0.836 and 2.3e-4 for 0.69–1.19 µm, whose far end absorbs most. His distributions of size differ.
    #[test]
    fn drops_scatter_forward_and_hardly_absorb() {
        for (wavelength, g, most) in [(0.55, 0.854, 3e-6), (0.9, 0.836, 2.3e-4)] {
            let optics = optics(wavelength);
            let chi = optics.phase.moments(8);
            assert!((chi[0] - 1.0).abs() < 1e-9 && (chi[1] - g).abs() < 0.025, "{wavelength}: {}", chi[1]);
            assert!(optics.albedo < 1.0 && 1.0 - optics.albedo < most, "{wavelength}: {}", optics.albedo);
        }
        assert_eq!(optics(0.55).extinction, 1.0);
        // The rainbow at 138° to 143° outshines 120°.
        let at = |degrees: f64| optics(0.7).phase.value(degrees.to_radians().cos());
        assert!(at(141.0) > 2.0 * at(120.0));
    }
}
