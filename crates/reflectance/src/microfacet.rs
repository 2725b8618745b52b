//! Facets: distributions of their normals, what they shade of each other, and how those that are seen are drawn.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use libm::{erf, erfc};
use sunglint_radiometry::LocalDir;

/// The half vector of two directions above a surface, from which no digit is lost near the normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Half {
    /// tan² of its angle to the normal.
    pub tan_squared: f64,
    /// Cosine of its angle to the normal.
    pub cos: f64,
    /// Cosine of the angle b between it and either direction.
    pub cos_b: f64,
}

impl Half {
    /// Of an incident and an outgoing direction.
    pub fn of(incident: LocalDir, outgoing: LocalDir) -> Self {
        let h = incident.vec() + outgoing.vec();
        let length = h.length();
        Self {
            tan_squared: h.truncate().length_squared() / (h.z * h.z),
            cos: h.z / length,
            // i·h = |i + o|/2 for unit vectors.
            cos_b: (0.5 * length).min(1.0),
        }
    }
}

/// Shadowing and masking by symmetric V-grooves [Torrance1967; Blinn1977, eq. 4]:
/// G = min{1, 2 (n·h)(n·o)/(o·h), 2 (n·h)(n·i)/(o·h)}.
pub(crate) fn v_groove(half: &Half, incident: LocalDir, outgoing: LocalDir) -> f64 {
    (2.0 * half.cos * incident.cos().min(outgoing.cos()) / half.cos_b).min(1.0)
}

/// Beckmann's distribution \[sr⁻¹\], ∫ D cos θ_h dω_h = 1 [Beckmann1963; Cook1982, eq. 13, with the 1/π that is missing
/// there]: D = exp(−tan² θ_h/m²)/(π m² cos⁴ θ_h).
pub(crate) fn beckmann(m: f64, half: &Half) -> f64 {
    let c2 = half.cos * half.cos;
    (-half.tan_squared / (m * m)).exp() / (PI * m * m * c2 * c2)
}

/// The distribution of Trowbridge & Reitz, GGX \[sr⁻¹\] [Walter2007, eq. 33]:
/// D = α²/(π cos⁴ θ_h (α² + tan² θ_h)²).
pub(crate) fn trowbridge_reitz(alpha: f64, half: &Half) -> f64 {
    let (a2, c2) = (alpha * alpha, half.cos * half.cos);
    let sum = c2 * (a2 + half.tan_squared);
    a2 / (PI * sum * sum)
}

/// Which facets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Facets {
    /// Gaussian slopes.
    Beckmann,
    /// Trowbridge and Reitz.
    Ggx,
}

/// How much facets shade and mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shadowing {
    /// Smith's, heights correlated [Heitz2014, eq. 99].
    Correlated,
    /// Smith's, either direction for itself.
    Separable,
    /// The same with the rational approximation of Λ for Gaussian slopes [Walter2007, eq. 27].
    Walter,
}

impl Facets {
    /// D \[sr⁻¹\].
    pub fn density(self, alpha: f64, half: &Half) -> f64 {
        match self {
            Self::Beckmann => beckmann(alpha, half),
            Self::Ggx => trowbridge_reitz(alpha, half),
        }
    }

    /// Smith's Λ [Heitz2014, eqs. 66, 72]: for Gaussian slopes [erf(a) − 1 + e^(−a²)/(a√π)]/2, for GGX
    /// [−1 + √(1 + 1/a²)]/2, with a = 1/(α tan θ).
    pub fn lambda(self, alpha: f64, direction: LocalDir) -> f64 {
        let (sine, cosine) = (direction.vec().truncate().length(), direction.cos());
        let slope = alpha * sine / cosine;
        if slope == 0.0 {
            return 0.0;
        }
        let a = 1.0 / slope;
        match self {
            Self::Beckmann => 0.5 * ((-a * a).exp() / (a * PI.sqrt()) - erfc(a)).max(0.0),
            // −1 + √(1 + x) = x/(1 + √(1 + x))
            Self::Ggx => 0.5 * slope * slope / (1.0 + slope.hypot(1.0)),
        }
    }

    /// G₁ with the rational approximation for Gaussian slopes, (3.535a + 2.181a²)/(1 + 2.276a + 2.577a²) below a = 1.6.
    fn walter(self, alpha: f64, direction: LocalDir) -> f64 {
        let (sine, cosine) = (direction.vec().truncate().length(), direction.cos());
        let a = cosine / (alpha * sine);
        match self {
            Self::Beckmann if a < 1.6 => (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a),
            Self::Beckmann => 1.0,
            Self::Ggx => 1.0 / (1.0 + self.lambda(alpha, direction)),
        }
    }

    /// Shadowing and masking of two directions above the surface.
    pub fn shadowing(self, kind: Shadowing, alpha: f64, incident: LocalDir, outgoing: LocalDir) -> f64 {
        if kind == Shadowing::Walter {
            return self.walter(alpha, incident) * self.walter(alpha, outgoing);
        }
        let (i, o) = (self.lambda(alpha, incident), self.lambda(alpha, outgoing));
        match kind {
            Shadowing::Correlated => 1.0 / (1.0 + i + o),
            _ => 1.0 / ((1.0 + i) * (1.0 + o)),
        }
    }

    /// A facet's normal h, drawn from those that `outgoing` sees.
    pub fn visible(self, alpha: f64, outgoing: LocalDir, u: [f64; 2]) -> DVec3 {
        let o = outgoing.vec();
        let stretched = DVec3::new(alpha * o.x, alpha * o.y, o.z).normalize();
        let h = match self {
            Self::Ggx => visible_of_hemisphere(stretched, u),
            Self::Beckmann => visible_of_gaussian(stretched, u),
        };
        DVec3::new(alpha * h.x, alpha * h.y, h.z.max(f64::MIN_POSITIVE)).normalize()
    }

    /// Density \[sr⁻¹\] of the incident directions that visible facets reflect to `outgoing`:
    /// G₁(o) D(h) (o·h)/cos θ_o / (4 o·h) [Heitz2018, eqs. 2, 17].
    pub fn visible_density(self, alpha: f64, half: &Half, outgoing: LocalDir) -> f64 {
        let g1 = 1.0 / (1.0 + self.lambda(alpha, outgoing));
        g1 * self.density(alpha, half) / (4.0 * outgoing.cos())
    }
}

/// A point of a hemisphere's half disk as seen from `v` [Heitz2018, JCGT 7(4), listing 1].
fn visible_of_hemisphere(v: DVec3, u: [f64; 2]) -> DVec3 {
    let across = v.truncate().length_squared();
    let t1 = if across > 0.0 { DVec3::new(-v.y, v.x, 0.0) / across.sqrt() } else { DVec3::X };
    let t2 = v.cross(t1);
    let (radius, (sin_p, cos_p)) = (u[0].sqrt(), (TAU * u[1]).sin_cos());
    let (p1, half) = (radius * cos_p, 0.5 * (1.0 + v.z));
    let p2 = (1.0 - half) * (1.0 - p1 * p1).max(0.0).sqrt() + half * radius * sin_p;
    p1 * t1 + p2 * t2 + (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt() * v
}

/// A normal of Gaussian slopes of unit α as seen from `v` [Heitz2014 (with d'Eon), sec. 3]. Along the view slopes x have density
/// (cos θ − x sin θ) e^(−x²)/√π up to x = cot θ, hence the distribution
/// F(x) = cos θ (1 + erf x)/2 + sin θ e^(−x²)/(2√π); across it they are Gaussian.
fn visible_of_gaussian(v: DVec3, u: [f64; 2]) -> DVec3 {
    let sine = v.truncate().length();
    let cosine = v.z;
    // Beyond ±6 lie 2e-17 of all slopes.
    let last = if sine > 0.0 { (cosine / sine).min(6.0) } else { 6.0 };
    let below = |x: f64| 0.5 * cosine * (1.0 + erf(x)) + sine * (-x * x).exp() / (2.0 * PI.sqrt());
    let slope = |x: f64| (cosine - x * sine) * (-x * x).exp() / PI.sqrt();
    let x = solved(below, slope, u[0] * below(last), -6.0, last);
    let y = solved(|y| 0.5 * (1.0 + erf(y)), |y| (-y * y).exp() / PI.sqrt(), u[1], -6.0, 6.0);
    let (cos_p, sin_p) = if sine > 0.0 { (v.x / sine, v.y / sine) } else { (1.0, 0.0) };
    DVec3::new(-(cos_p * x - sin_p * y), -(sin_p * x + cos_p * y), 1.0).normalize()
}

/// x in `low..high` with f(x) = `wanted`, f rising with derivative `slope`: Newton's steps, halvings where they leave the
/// bracket.
fn solved(f: impl Fn(f64) -> f64, slope: impl Fn(f64) -> f64, wanted: f64, mut low: f64, mut high: f64) -> f64 {
    let mut x = 0.0_f64.clamp(low, high);
    for _ in 0..60 {
        let off = f(x) - wanted;
        if off > 0.0 {
            high = x
        } else {
            low = x
        }
        let step = off / slope(x);
        let next = x - step;
        let inside = next > low && next < high;
        let next = if inside { next } else { 0.5 * (low + high) };
        if (next - x).abs() < 1e-13 * (1.0 + x.abs()) {
            return next;
        }
        x = next;
    }
    x
}

/// The incident direction that a facet of normal `h` reflects to `outgoing`; `None` where it looks away.
pub(crate) fn reflected(h: DVec3, outgoing: LocalDir) -> Option<LocalDir> {
    let cosine = h.dot(outgoing.vec());
    (cosine > 0.0).then(|| LocalDir::from_unit((2.0 * cosine * h - outgoing.vec()).normalize()))
}

/// A facet's normal at angle θ_h to the surface's, tan² θ_h given, at a random azimuth.
pub(crate) fn normal(tan_squared: f64, u: f64) -> DVec3 {
    let cosine = 1.0 / (1.0 + tan_squared).sqrt();
    let sine = (tan_squared / (1.0 + tan_squared)).sqrt();
    let (sin_p, cos_p) = (TAU * u).sin_cos();
    DVec3::new(sine * cos_p, sine * sin_p, cosine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn at(t: f64) -> Half {
        Half { tan_squared: t.tan().powi(2), cos: t.cos(), cos_b: 1.0 }
    }

    /// The facets' projections fill the surface once.
    #[test]
    fn distributions_are_normalised_over_projected_facets() {
        for alpha in [0.05, 0.3, 0.7, 1.0] {
            for facets in [Facets::Beckmann, Facets::Ggx] {
                // In steps of the slope, so that a narrow lobe is seen.
                let sum: f64 = crate::quadrature::tanh_sinh(0.0, FRAC_PI_2, |psi| {
                    let (t, d) =
                        ((alpha * psi.tan()).atan(), alpha / (psi.cos().powi(2) + (alpha * psi.sin()).powi(2)));
                    TAU * t.sin() * t.cos() * facets.density(alpha, &at(t)) * d
                });
                assert!((sum - 1.0).abs() < 1e-6, "{facets:?} {alpha}: {sum}");
            }
        }
    }

    /// Smith's condition [Heitz2014, eq. 24]: the facets that a direction sees fill what it sees of the surface,
    /// ∫ G₁ D max(0, o·h) dω_h = cos θ_o.
    #[test]
    fn visible_facets_fill_what_is_seen_of_the_surface() {
        for facets in [Facets::Beckmann, Facets::Ggx] {
            for (alpha, degree) in [(0.3, 30.0_f64), (0.5, 70.0), (1.0, 85.0)] {
                let o = LocalDir::from_polar(degree.to_radians(), 0.0);
                let n = 400;
                let mut sum = 0.0;
                for j in 0..n {
                    let psi = FRAC_PI_2 * (f64::from(j) + 0.5) / f64::from(n);
                    let t = (alpha * psi.tan()).atan();
                    let dt = alpha / (psi.cos().powi(2) + (alpha * psi.sin()).powi(2)) * FRAC_PI_2 / f64::from(n);
                    for k in 0..n {
                        let phi = TAU * (f64::from(k) + 0.5) / f64::from(n);
                        let h = LocalDir::from_polar(t, phi);
                        let seen = h.dot(o).max(0.0);
                        sum += facets.density(alpha, &at(t)) * seen * t.sin() * dt * TAU / f64::from(n);
                    }
                }
                let g1 = 1.0 / (1.0 + facets.lambda(alpha, o));
                assert!((g1 * sum / o.cos() - 1.0).abs() < 2e-4, "{facets:?} {alpha} {degree}: {}", g1 * sum / o.cos());
            }
        }
    }

    /// Walter's rational form stays within 0.35 % of Smith's G₁, as its authors say.
    #[test]
    fn the_rational_form_of_smiths_shadowing_is_near_it() {
        for degree in (1..90).map(f64::from) {
            let d = LocalDir::from_polar(degree.to_radians(), 0.3);
            for alpha in [0.1, 0.4, 0.9] {
                let exact = 1.0 / (1.0 + Facets::Beckmann.lambda(alpha, d));
                let near = Facets::Beckmann.walter(alpha, d);
                assert!((near / exact - 1.0).abs() < 4e-3, "{degree} {alpha}: {near} {exact}");
            }
        }
    }
}
