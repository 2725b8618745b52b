//! Posing a scene and weighing what it returns.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use sunglint::{Explanation, Frames, Options, Plan, Run};

/// Relative tolerance where nothing is sampled. Frames keep `f32`, whose rounding is 6e-8.
pub const EXACT: f64 = 1e-6;

/// A scene of `tests/scenes` or `examples`, checked and planned.
pub fn scene(path: &str, options: &Options) -> Plan {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    sunglint::open(path).and_then(|checked| Plan::new(checked, options)).unwrap_or_else(|refused| panic!("{refused}"))
}

/// A scene from its text, without the line `glint 1`.
pub fn text(text: &str) -> Plan {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("posed.glint");
    std::fs::write(&path, format!("glint 1\n{text}")).expect("the scene is written");
    scene(&path.to_string_lossy(), &Options::default())
}

/// The run of an experiment, with the scene's only sensor.
pub fn run<'a>(plan: &'a Plan, experiment: &str) -> &'a Run {
    let found = plan.runs().iter().find(|run| run.experiment == experiment);
    found.unwrap_or_else(|| panic!("the scene has an experiment `{experiment}`"))
}

/// A view straight down through a plane at height `z`: `nx` × `ny` pixels over `width` \[m\] about (`x`, `y`).
pub fn map(name: &str, [x, y, z]: [f64; 3], width: f64, [nx, ny]: [u32; 2]) -> String {
    let pose = format!("position ({x} {y} {z}) m, swath {width} m, pixels {nx} x {ny}");
    format!("sensor {name} {{ projection orthographic, {pose}, band b 500..600 nm }}\n")
}

/// No air, a sky of `l_0` and a sun of E₀ = 1500.
pub fn light(l_0: f64) -> String {
    format!("atmosphere none {{ solar_irradiance 1500 W/m2/um, sky_radiance {l_0} W/m2/sr/um }}\n")
}

/// No air, no sun, a uniform sky of `l_0`.
pub fn sky(l_0: f64) -> String {
    format!("atmosphere none {{ solar_irradiance 0 W/m2/um, sky_radiance {l_0} W/m2/sr/um }}\n")
}

/// A pixel of an image: radiance and standard error.
pub fn pixel(frames: &Frames, time: usize, channel: usize, index: usize) -> (f64, f64) {
    let frame = &frames.frames[time];
    (f64::from(frame.radiance[channel][index]), f64::from(frame.error[channel][index]))
}

/// All pixels of the first channel of a frame.
pub fn pixels(frames: &Frames, time: usize) -> Vec<(f64, f64)> {
    (0..frames.frames[time].radiance[0].len()).map(|i| pixel(frames, time, 0, i)).collect()
}

/// A term of `explain`, 0 where there is none.
pub fn term(explanation: &Explanation, band: usize, name: &str) -> f64 {
    let terms = &explanation.bands[band].terms;
    terms.iter().find(|(known, _)| *known == name).map_or(0.0, |(_, value)| *value)
}

/// Holds pairs (found, expected) to [`EXACT`] and prints the largest relative deviation.
pub fn assert_exact(claim: &str, pairs: impl IntoIterator<Item = (f64, f64)>) {
    let (mut worst, mut n) = (0.0, 0);
    for (found, expected) in pairs {
        let deviation = if found == expected { 0.0 } else { ((found - expected) / expected).abs() };
        assert!(deviation <= EXACT, "{claim}: found {found}, expected {expected} ({deviation:.2e} off)");
        worst = f64::max(worst, deviation);
        n += 1;
    }
    assert!(n > 0, "{claim}: nothing was compared");
    println!("exact   {claim}: {n} values, largest relative deviation {worst:.1e}");
}

/// What a comparison with samples allows beside the standard error, absolute.
#[derive(Clone, Copy, Default)]
pub struct Slack {
    /// What the closed form itself may be off.
    pub bound: f64,
    /// What one sample weighs: the least error that replicates which count samples can tell. Where all 16 count the
    /// same they state none.
    pub grain: f64,
}

/// Mean of an image's pixels with its standard error.
pub fn whole(pixels: &[(f64, f64)]) -> (f64, f64) {
    let n = pixels.len() as f64;
    (pixels.iter().map(|p| p.0).sum::<f64>() / n, pixels.iter().map(|p| p.1 * p.1).sum::<f64>().sqrt() / n)
}

/// Holds triples (found, standard error, expected) to their standard errors and prints the largest deviation in them:
/// one value to 4, many to the Šidák-corrected factor of the same false alarm, and their mean to 4.
pub fn assert_sampled(claim: &str, slack: Slack, triples: impl IntoIterator<Item = (f64, f64, f64)>) {
    let Slack { bound, grain } = slack;
    let triples: Vec<(f64, f64, f64)> = triples.into_iter().map(|(l, s, e)| (l, f64::max(s, grain), e)).collect();
    let n = triples.len();
    assert!(n > 0, "{claim}: nothing was sampled");
    let limit = student_limit(n);
    let (mut worst, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for (found, s, expected) in &triples {
        let off = ((found - expected).abs() - bound).max(0.0);
        assert!(*s > 0.0, "{claim}: {found} has no error");
        assert!(off <= limit * s, "{claim}: found {found} ± {s}, expected {expected}; {:.2} s allowed", limit);
        worst = f64::max(worst, off / s);
        sum += found - expected;
        squares += s * s;
    }
    let pooled = (sum.abs() - bound * n as f64).max(0.0) / squares.sqrt();
    assert!(pooled <= 4.0, "{claim}: the mean over {n} values is {pooled:.2} standard errors off");
    let precision = squares.sqrt() / triples.iter().map(|(_, _, expected)| expected.abs()).sum::<f64>();
    println!(
        "sampled {claim}: {n} values, largest {worst:.2} s of {limit:.2} allowed, mean {pooled:.2} s, \
         s of the mean {precision:.1e}"
    );
}

/// How many standard errors of 16 replicates one of `n` values may be off, so that all of them together give as many
/// false alarms as one value held to 4 (one in 860).
pub fn student_limit(n: usize) -> f64 {
    let one = 1.0 - inside(4.0);
    let each = 1.0 - (1.0 - one).powf(1.0 / n as f64);
    let (mut low, mut high) = (4.0, 1e3);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if 1.0 - inside(middle) > each { low = middle } else { high = middle }
    }
    high
}

/// P(|T| ≤ t) of Student's t with 15 degrees of freedom [Abramowitz & Stegun 1964, 26.7.3].
fn inside(t: f64) -> f64 {
    let theta = (t / 15f64.sqrt()).atan();
    let (s, c) = theta.sin_cos();
    let (mut term, mut sum) = (c, 0.0);
    for k in 0..7 {
        sum += term;
        let k = f64::from(k);
        term *= (2.0 * k + 2.0) / (2.0 * k + 3.0) * c * c;
    }
    theta / FRAC_PI_2 + s * sum / FRAC_PI_2
}

/// Mean over a ≤ u ≤ b of the fraction of a uniform disk beyond a chord at offset u, (arccos u − u √(1−u²))/π; outside
/// ±1 it is 1 and 0.
pub fn beyond_chord(a: f64, b: f64) -> f64 {
    let primitive = |u: f64| {
        let v = u.clamp(-1.0, 1.0);
        let w = 1.0 - v * v;
        let inside = (v * v.acos() - w.sqrt() + w.powf(1.5) / 3.0) / PI;
        inside + if u < -1.0 { u + 1.0 } else { 0.0 }
    };
    (primitive(b) - primitive(a)) / (b - a)
}

/// A chain of straight lines through (wavelength \[nm\], value).
pub struct Lines(pub Vec<(f64, f64)>);

impl Lines {
    pub fn at(&self, x: f64) -> f64 {
        let i = self.0.partition_point(|row| row.0 <= x).clamp(1, self.0.len() - 1);
        let ((a, u), (b, v)) = (self.0[i - 1], self.0[i]);
        u + (x - a) / (b - a) * (v - u)
    }
}

/// Mean over a band of a product of chains: three Gauss nodes between neighbouring corners are exact up to the fifth
/// power of wavelength.
pub fn mean_of_product(factors: &[&Lines], (lower, upper): (f64, f64)) -> f64 {
    let mut cuts: Vec<f64> = factors.iter().flat_map(|f| f.0.iter().map(|row| row.0)).collect();
    cuts.extend([lower, upper]);
    cuts.retain(|x| (lower..=upper).contains(x));
    cuts.sort_by(f64::total_cmp);
    let product = |x: f64| factors.iter().map(|f| f.at(x)).product::<f64>();
    let piece = |a: f64, b: f64| {
        let (m, h) = (0.5 * (a + b), 0.5 * (b - a));
        let node = 0.6f64.sqrt() * h;
        h * (5.0 * product(m - node) + 8.0 * product(m) + 5.0 * product(m + node)) / 9.0
    };
    cuts.windows(2).map(|w| piece(w[0], w[1])).sum::<f64>() / (upper - lower)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tabulated two-sided 5 % point of Student's t with 15 degrees of freedom is 2.131.
    #[test]
    fn the_limits_are_those_of_student() {
        assert!((inside(sunglint::radiometry::STUDENT_T_95) - 0.95).abs() < 1e-12);
        assert!((student_limit(1) - 4.0).abs() < 1e-9 && student_limit(100) > 6.0);
    }

    #[test]
    fn a_chord_through_the_middle_halves_the_disk() {
        assert!((beyond_chord(-1.0, 1.0) - 0.5).abs() < 1e-15);
        let eps = 1e-6;
        assert!((beyond_chord(0.3 - eps, 0.3 + eps) - (0.3f64.acos() - 0.3 * 0.91f64.sqrt()) / PI).abs() < 1e-9);
        assert!((beyond_chord(-3.0, -2.0) - 1.0).abs() < 1e-15 && beyond_chord(1.5, 2.0) == 0.0);
    }
}
