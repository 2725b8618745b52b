//! What reaches a circular aperture from a surface that is lit from one direction.
//!
//! The aperture is a cone about the view direction whose half-angle a obeys π sin² a = Ω, so that its projected solid angle
//! about its own axis is Ω. Clear of the horizon a surface at angle θ_v to it then has
//!
//! ```text
//! P(θ_v) = ∫ cos θ_o dω_o = Ω cos θ_v        exactly; the cone's own solid angle is less by Ω/4π of itself
//! ```
//!
//! and where the horizon cuts the cone, P and every integral take the part above.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use sunglint_radiometry::{Frame, LocalDir};

use crate::{Bsdf, TopHat};

/// A change of a cell's integral by less than this share of the whole ends its subdivision.
const PRECISION: f64 = 1e-9;
const DEEPEST: u32 = 11;

/// A circular aperture seen from the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aperture {
    axis: LocalDir,
    half_angle: f64,
    projected: f64,
}

impl Aperture {
    /// About a view direction above the surface; Ω \[sr\] above 0 and at most π.
    pub fn about(axis: LocalDir, solid_angle: f64) -> Self {
        let sin_a = (solid_angle / PI).sqrt().min(1.0);
        // 1 − cos a without cancellation.
        let versine = sin_a * sin_a / (1.0 + (1.0 - sin_a * sin_a).max(0.0).sqrt());
        let cone = TopHat::new(TAU * versine);
        Self { axis, half_angle: sin_a.asin(), projected: cone.projected(axis.theta()) }
    }

    /// Adds to `brf` the reflectance factor (directional-conical) for light along `incident`, per grid entry [Nicodemus1977]:
    ///
    /// ```text
    /// BRF = π ∫_Ω f cos θ_o dω_o / ∫_Ω cos θ_o dω_o + π ρ/∫_Ω cos θ_o dω_o [the mirror direction is in Ω]
    /// ```
    ///
    /// ρ is the reflectance of the Dirac lobe: a mirror reads π ρ/(Ω cos θ).
    pub fn add_brf(&self, bsdf: &dyn Bsdf, incident: LocalDir, brf: &mut [f64]) {
        let n = brf.len();
        let mirror = incident.mirrored();
        let lobes = bsdf.lobes();
        let apart = angle(mirror, self.axis);
        let mut f = vec![0.0; n];
        if lobes.mirror && apart <= self.half_angle * (1.0 + 1e-12) {
            bsdf.mirror(mirror, &mut f);
            brf.iter_mut().zip(&f).for_each(|(brf, rho)| *brf += PI * rho / self.projected);
        }
        if !(lobes.diffuse || lobes.glossy) {
            return;
        }
        // The integral is that of the departure from one value, so that an even surface reads that value.
        let mut base = vec![0.0; n];
        bsdf.eval(incident, self.quiet(mirror), &mut base);
        let departure = self.integral(bsdf, incident, mirror, apart, &base);
        for ((brf, base), departure) in brf.iter_mut().zip(&base).zip(departure) {
            *brf += PI * (base + departure / self.projected);
        }
    }

    /// A direction of the aperture far from the mirror direction.
    fn quiet(&self, mirror: LocalDir) -> LocalDir {
        let frame = Frame::about(self.axis.vec());
        let on_rim =
            |beta: f64| LocalDir::from_unit(frame.to_world(LocalDir::from_polar(0.999 * self.half_angle, beta)).vec());
        let above = |direction: &LocalDir| direction.cos() > 1e-3;
        let rim = (0..12).map(|k| on_rim(TAU * f64::from(k) / 12.0)).filter(above);
        rim.max_by(|a, b| angle(*a, mirror).total_cmp(&angle(*b, mirror))).unwrap_or(self.axis)
    }

    /// ∫_Ω (f − base) cos θ_o dω_o in polar coordinates (α, β) about the mirror direction, where lobes are: a ring of α is
    /// in the aperture for |β| < φ(α), and the rings widen geometrically.
    fn integral(&self, bsdf: &dyn Bsdf, incident: LocalDir, mirror: LocalDir, apart: f64, base: &[f64]) -> Vec<f64> {
        let a = self.half_angle;
        let towards = self.axis.vec() - mirror.vec() * mirror.dot(self.axis);
        let e1 = if apart > 1e-9 { towards.normalize() } else { mirror.vec().any_orthonormal_vector() };
        let e2 = mirror.vec().cross(e1);
        let n = base.len();
        let add = |alpha: f64, beta: f64, weight: f64, sum: &mut [f64], f: &mut [f64]| {
            let ((sin_a, cos_a), (sin_b, cos_b)) = (alpha.sin_cos(), beta.sin_cos());
            let d: DVec3 = mirror.vec() * cos_a + (e1 * cos_b + e2 * sin_b) * sin_a;
            if d.z <= 0.0 {
                return;
            }
            bsdf.eval(incident, LocalDir::from_unit(d), f);
            let weight = weight * sin_a * d.z;
            sum.iter_mut().zip(f.iter().zip(base)).for_each(|(sum, (f, base))| *sum += weight * (f - base));
        };
        // Half-width of the ring α in the aperture: sin² φ/2 = (versine a − versine(δ − α))/(2 sin δ sin α).
        let versine = |angle: f64| 2.0 * (0.5 * angle).sin().powi(2);
        let width = |alpha: f64| {
            let share = (versine(a) - versine(apart - alpha)) / (2.0 * apart.sin() * alpha.sin()).max(1e-300);
            2.0 * share.clamp(0.0, 1.0).sqrt().asin()
        };
        let edges = edges(bsdf, mirror);
        let mut sum = vec![0.0; n];
        let mut f = vec![0.0; n];
        let scale = |base: &[f64]| base.iter().copied().fold(0.0, f64::max) * self.projected;
        // Rings that lie wholly in the aperture.
        let whole = a - apart;
        if whole > 0.0 {
            let cells = cells(0.0, whole, &edges, |alpha| alpha, [0.0, TAU], 6);
            let part = integrate(&cells, n, scale(base), |[alpha, beta], weight, sum| {
                add(alpha, beta, weight, sum, &mut f);
            });
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        // Rings that it cuts: α = middle − half cos ψ takes the roots off both ends.
        let (low, high) = (whole.abs(), (a + apart).min(PI));
        if apart > 1e-9 && high > low {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            let psi = |alpha: f64| ((middle - alpha) / half).clamp(-1.0, 1.0).acos();
            let cells = cells(low, high, &edges, psi, [-1.0, 1.0], 2);
            let part = integrate(&cells, n, scale(base), |[psi, u], weight, sum| {
                let alpha = middle - half * psi.cos();
                let phi = width(alpha);
                add(alpha, u * phi, weight * half * psi.sin() * phi, sum, &mut f);
            });
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        sum
    }
}

/// The mean of a function over a cone of directions about `axis` \[half-angle in rad\], weighted by their cosine, of those
/// above the surface: a source of even radiance. `add` adds the function times the weight that it is handed.
pub(crate) fn mean_over_source(
    axis: LocalDir,
    radius: f64,
    n: usize,
    mut add: impl FnMut(LocalDir, f64, &mut [f64]),
) -> Vec<f64> {
    let frame = Frame::about(axis.vec());
    let cells = cells(0.0, 1.0, &[], |r| r, [0.0, TAU], 6);
    // The last value counts the weight itself.
    let sums = integrate_to(1e-5, 5, &cells, n + 1, 0.0, |[r, beta], weight, sum| {
        let alpha = radius * r;
        let direction = LocalDir::from_unit(frame.to_world(LocalDir::from_polar(alpha, beta)).vec());
        if direction.cos() <= 0.0 {
            return;
        }
        let weight = weight * alpha.sin() * radius * direction.cos();
        add(direction, weight, &mut sum[..n]);
        sum[n] += weight;
    });
    sums[..n].iter().map(|sum| sum / sums[n].max(f64::MIN_POSITIVE)).collect()
}

/// Angle between two directions \[rad\], accurate when small.
pub(crate) fn angle(a: LocalDir, b: LocalDir) -> f64 {
    2.0 * (a.vec() - b.vec()).length().atan2((a.vec() + b.vec()).length())
}

/// Angles to the mirror direction at which a lobe changes: the edge of a top hat, and from 1e-5 rad on four a decade.
fn edges(bsdf: &dyn Bsdf, mirror: LocalDir) -> Vec<f64> {
    if !bsdf.lobes().glossy {
        return Vec::new();
    }
    let mut edges: Vec<f64> = (0..=21).map(|k| 1e-5 * 10f64.powf(0.25 * f64::from(k))).collect();
    let solid_angle = bsdf.split().solid_angle_at(mirror.theta().min(FRAC_PI_2));
    if solid_angle > 0.0 && solid_angle < TAU {
        edges.push(TopHat::new(solid_angle).half_angle());
    }
    edges.sort_by(f64::total_cmp);
    edges
}

/// A rectangle in two coordinates.
type Cell = [[f64; 2]; 2];

/// Cells between `low` and `high`, cut at `edges`, in a coordinate of that angle; `sectors` of the other coordinate.
fn cells(low: f64, high: f64, edges: &[f64], place: impl Fn(f64) -> f64, across: [f64; 2], sectors: u32) -> Vec<Cell> {
    let inside = edges.iter().copied().filter(|edge| *edge > low && *edge < high);
    let cuts: Vec<f64> = std::iter::once(low).chain(inside).chain([high]).map(place).collect();
    let sector = |k: u32| across[0] + (across[1] - across[0]) * f64::from(k) / f64::from(sectors);
    (cuts.windows(2))
        .filter(|cut| cut[1] > cut[0])
        .flat_map(|cut| (0..sectors).map(move |k| [[cut[0], cut[1]], [sector(k), sector(k + 1)]]))
        .collect()
}

fn integrate(cells: &[Cell], n: usize, scale: f64, add: impl FnMut([f64; 2], f64, &mut [f64])) -> Vec<f64> {
    integrate_to(PRECISION, DEEPEST, cells, n, scale, add)
}

/// Integrals of n functions over cells: four by four Gauss points, a cell quartered until that changes no integral by more
/// than a share of the largest (or of `scale`, where that is more). `add` adds the functions times a weight at a point.
fn integrate_to(
    precision: f64,
    deepest: u32,
    cells: &[Cell],
    n: usize,
    scale: f64,
    mut add: impl FnMut([f64; 2], f64, &mut [f64]),
) -> Vec<f64> {
    let mut gauss = |cell: &Cell| {
        let mut sum = vec![0.0; n];
        let [[a, b], [c, d]] = *cell;
        for (x, w) in GAUSS {
            for (y, v) in GAUSS {
                let point = [0.5 * (a + b) + 0.5 * (b - a) * x, 0.5 * (c + d) + 0.5 * (d - c) * y];
                add(point, 0.25 * (b - a) * (d - c) * w * v, &mut sum);
            }
        }
        sum
    };
    let mut left: Vec<(Cell, Vec<f64>, u32)> = cells.iter().map(|cell| (*cell, gauss(cell), 0)).collect();
    let largest = |sums: &mut dyn Iterator<Item = f64>| sums.fold(0.0, |a: f64, b| a.max(b.abs()));
    let mut whole = vec![0.0; n];
    left.iter().for_each(|(_, part, _)| whole.iter_mut().zip(part).for_each(|(whole, part)| *whole += part.abs()));
    let limit = precision * largest(&mut whole.iter().copied()).max(scale);
    let mut total = vec![0.0; n];
    while let Some((cell, before, depth)) = left.pop() {
        let middle = |[a, b]: [f64; 2]| 0.5 * (a + b);
        let ([a, b], [c, d]) = (cell[0], cell[1]);
        let (x, y) = (middle(cell[0]), middle(cell[1]));
        let quarters: [Cell; 4] = [[[a, x], [c, y]], [[a, x], [y, d]], [[x, b], [c, y]], [[x, b], [y, d]]];
        let parts = quarters.map(|quarter| (quarter, gauss(&quarter)));
        let mut change = before;
        parts.iter().for_each(|(_, part)| change.iter_mut().zip(part).for_each(|(change, part)| *change -= part));
        let changed = largest(&mut change.iter().copied());
        if depth + 1 >= deepest || changed <= limit || !changed.is_finite() {
            parts.iter().for_each(|(_, part)| total.iter_mut().zip(part).for_each(|(total, part)| *total += part));
        } else {
            left.extend(parts.map(|(quarter, part)| (quarter, part, depth + 1)));
        }
    }
    total
}

/// Points and weights of the Gauss–Legendre rule on −1..1 [Abramowitz1964, table 25.4].
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
];
