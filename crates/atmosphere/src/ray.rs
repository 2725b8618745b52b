//! Rays through spherical shells of air, bent where its density changes.
//!
//! ```text
//! x = n r,   x sin θ = p                          along a ray [Born1999, eq. 3.2.7]
//! x = x₁ + x′ (r − r₁)                            within a shell
//! s = ∫ dr/cos θ = [√(x₂² − p²) − √(x₁² − p²)]/x′
//! γ = ∫ tan θ dr/r = (n/x′) [arcsin(p/x₁) − arcsin(p/x₂)]   the angle at the centre of the Earth
//! ψ = Σ γ + arcsin(p/r_top)                       zenith angle, at the start, of where the ray comes from outside the air
//! ```
//!
//! n is its mean in a shell in the factor n/x′ alone. On a flat Earth (plane geometry) s = Δh/cos θ, γ = 0 and nothing bends.
//! Where n falls so fast that rays would be trapped (x′ ≤ 0), x′ is held at a small positive value.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::medium::Strata;

/// Shells between the boundaries of a column; layer i lies between boundaries i and i + 1, from the top down.
#[derive(Clone, Debug)]
pub(crate) struct Shells {
    /// Heights of the boundaries \[m\], descending to 0.
    pub heights: Vec<f64>,
    /// Where the Earth is round.
    round: Option<Round>,
}

#[derive(Clone, Debug)]
struct Round {
    /// Radius of the ground \[m\].
    radius: f64,
    /// x at the boundaries.
    x: Vec<f64>,
    /// x′ of each layer.
    slope: Vec<f64>,
    /// n of each layer.
    index: Vec<f64>,
}

/// Least x′: air of less traps rays.
const LEAST_SLOPE: f64 = 0.02;

/// The flattest ray on a flat Earth: beyond it cos θ is held \[rad\].
const FLATTEST: f64 = FRAC_PI_2 - 1e-6;

/// A stretch of a ray within one layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stretch {
    /// Index of the layer.
    pub layer: usize,
    /// Heights of its lower and upper end \[m\].
    pub low: f64,
    pub high: f64,
    /// p of the ray \[m\]; sin θ on a flat Earth.
    impact: f64,
    /// Angle at the Earth's centre from the start of the ray to the lower end \[rad\].
    centre: f64,
}

impl Shells {
    pub fn new(strata: &Strata, spherical: bool) -> Self {
        let heights = strata.heights.clone();
        let round = spherical.then(|| {
            let n = heights.len() - 1;
            let at = |i: usize| (1.0 + strata.refractivity[i]) * (strata.radius + heights[i]);
            let (mut x, mut slope) = (vec![at(n); n + 1], vec![0.0; n]);
            for i in (0..n).rev() {
                let rise = heights[i] - heights[i + 1];
                slope[i] = ((at(i) - at(i + 1)) / rise).max(LEAST_SLOPE);
                x[i] = x[i + 1] + slope[i] * rise;
            }
            let index = strata.refractivity.windows(2).map(|n| 1.0 + 0.5 * (n[0] + n[1])).collect();
            Round { radius: strata.radius, x, slope, index }
        });
        Self { heights, round }
    }

    /// Angle at the Earth's centre \[rad\] between a point at z = 0 and where its level ray meets a height \[m\]; refraction
    /// adds a tenth at most.
    pub fn farthest(&self, height: f64) -> f64 {
        self.round.as_ref().map_or(0.0, |round| (round.radius / (round.radius + height.max(0.0))).acos())
    }

    /// Whether the Earth is round.
    pub fn is_round(&self) -> bool {
        self.round.is_some()
    }

    /// Height of the top \[m\].
    pub fn top(&self) -> f64 {
        self.heights[0]
    }

    /// The layer that holds a height; beyond the ends the nearest. On a boundary the one above it.
    pub fn layer_at(&self, height: f64) -> usize {
        self.heights.partition_point(|h| *h > height).clamp(1, self.heights.len() - 1) - 1
    }

    /// The stretches of a ray that rises from a height at a zenith angle 0..π/2, lowest first, to the height `end`; those
    /// below the ground belong to the lowest layer.
    pub fn rising(&self, from: f64, zenith: f64, end: f64) -> Vec<Stretch> {
        let end = end.min(self.top());
        let mut stretches = Vec::new();
        if from >= end {
            return stretches;
        }
        let mut layer = self.layer_at(from);
        let (mut low, mut centre) = (from, 0.0);
        let impact = match &self.round {
            Some(round) => round.x_at(&self.heights, layer, from) * zenith.clamp(0.0, FRAC_PI_2).sin(),
            None => zenith.min(FLATTEST).sin(),
        };
        loop {
            let high = self.heights[layer].min(end);
            let stretch = Stretch { layer, low, high, impact, centre };
            stretches.push(stretch);
            centre += self.turn(&stretch, high);
            low = high;
            if layer == 0 || high >= end {
                return stretches;
            }
            layer -= 1;
        }
    }

    /// Path length from the lower end of a stretch to a height in it \[m\].
    pub fn length(&self, stretch: &Stretch, height: f64) -> f64 {
        match &self.round {
            // √(b² − p²) − √(a² − p²) without the difference of large numbers.
            Some(round) => {
                let at = |h: f64| round.x_at(&self.heights, stretch.layer, h);
                let (a, b) = (at(stretch.low), at(height));
                let root = |x: f64| ((x - stretch.impact) * (x + stretch.impact)).max(0.0).sqrt();
                let sum = root(a) + root(b);
                if sum > 0.0 { (height - stretch.low) * (a + b) / sum } else { 0.0 }
            }
            None => (height - stretch.low) / self.cosine(stretch, height),
        }
    }

    /// Cosine of the zenith angle of the ray at a height within a stretch.
    pub fn cosine(&self, stretch: &Stretch, height: f64) -> f64 {
        let sine = match &self.round {
            Some(round) => (stretch.impact / round.x_at(&self.heights, stretch.layer, height)).min(1.0),
            None => stretch.impact,
        };
        ((1.0 - sine) * (1.0 + sine)).max(0.0).sqrt()
    }

    /// Angle at the Earth's centre from the start of the ray to a height in a stretch \[rad\].
    pub fn centre(&self, stretch: &Stretch, height: f64) -> f64 {
        stretch.centre + self.turn(stretch, height)
    }

    fn turn(&self, stretch: &Stretch, height: f64) -> f64 {
        self.round.as_ref().map_or(0.0, |round| {
            let i = stretch.layer;
            let angle = |h: f64| (stretch.impact / round.x_at(&self.heights, i, h)).min(1.0).asin();
            round.index[i] / round.slope[i] * (angle(stretch.low) - angle(height))
        })
    }

    /// Path lengths in each layer \[m\] from a height to the top along a ray of an apparent zenith angle 0..π, added to
    /// `lengths`; and the true zenith angle it comes from. `None` where the ground is in the way.
    fn escape(&self, from: f64, apparent: f64, lengths: &mut [f64]) -> Option<f64> {
        let from = from.min(self.top());
        let Some(round) = &self.round else {
            // On a flat Earth the horizon hides all that is below it.
            let rising = (apparent <= FRAC_PI_2).then(|| self.rising(from, apparent, self.top()))?;
            rising.iter().for_each(|s| lengths[s.layer] += self.length(s, s.high));
            return Some(apparent);
        };
        let rises = |from: f64, zenith: f64, lengths: &mut [f64]| {
            let impact = round.x_at(&self.heights, self.layer_at(from), from) * zenith.sin();
            let centre = self.climb(round, from, impact, lengths);
            // Outside the air n = 1.
            let sine = impact / (round.radius + self.top());
            if from < self.top() { centre + sine.min(1.0).asin() } else { zenith }
        };
        if apparent <= FRAC_PI_2 {
            return Some(rises(from, apparent, lengths));
        }
        // Down to where the ray runs level, x = p, and up again on both sides.
        let layer = self.layer_at(from);
        let p = round.x_at(&self.heights, layer, from) * apparent.sin();
        let holds = (layer..self.heights.len() - 1).find(|i| round.x[i + 1] <= p);
        let lowest = holds.map(|i| (self.heights[i + 1] + (p - round.x[i + 1]) / round.slope[i]).min(from));
        let lowest = lowest?;
        let (mut near, mut centre) = (vec![0.0; lengths.len()], 0.0);
        for s in self.rising(lowest, FRAC_PI_2, from) {
            near[s.layer] += self.length(&s, s.high);
            centre = self.centre(&s, s.high);
        }
        let far = rises(lowest, FRAC_PI_2, lengths);
        lengths.iter_mut().zip(near).for_each(|(l, n)| *l += n);
        Some(far + centre)
    }

    /// Path lengths in each layer \[m\] of a ray that rises from a height to the top, added to `lengths`; and the angle at the
    /// Earth's centre between its ends \[rad\]. The same as by its stretches, each boundary counted once.
    fn climb(&self, round: &Round, from: f64, impact: f64, lengths: &mut [f64]) -> f64 {
        let at = |layer: usize, height: f64| {
            let x = round.x_at(&self.heights, layer, height);
            let root = ((x - impact) * (x + impact)).max(0.0).sqrt();
            (height, x, root, (impact / x).min(1.0).asin())
        };
        let mut centre = 0.0;
        if from >= self.top() {
            return centre;
        }
        let lowest = self.layer_at(from);
        let (mut low, mut x_low, mut root_low, mut angle_low) = at(lowest, from);
        for layer in (0..=lowest).rev() {
            let (high, x, root, angle) = at(layer, self.heights[layer]);
            let sum = root_low + root;
            lengths[layer] += if sum > 0.0 { (high - low) * (x_low + x) / sum } else { 0.0 };
            centre += round.index[layer] / round.slope[layer] * (angle_low - angle);
            (low, x_low, root_low, angle_low) = (high, x, root, angle);
        }
        centre
    }

    /// Path lengths in each layer \[m\] from a height towards the sun at a *true* zenith angle; `None` where the ground
    /// hides it.
    pub fn towards_sun(&self, from: f64, true_zenith: f64) -> Option<Vec<f64>> {
        self.towards_sun_lifted(from, true_zenith, &mut 0.0)
    }

    /// The same for a sun lifted by about so much \[rad\]; takes what it is lifted by.
    pub fn towards_sun_lifted(&self, from: f64, true_zenith: f64, lift: &mut f64) -> Option<Vec<f64>> {
        let mut lengths = vec![0.0; self.heights.len() - 1];
        let horizon = match &self.round {
            Some(round) => {
                let sine = round.x[round.x.len() - 1] / round.x_at(&self.heights, self.layer_at(from), from);
                // Inwards by what rounding may take.
                if sine >= 1.0 { FRAC_PI_2 } else { PI - sine.asin() - 1e-9 }
            }
            None => FRAC_PI_2,
        };
        let mut apparent = (true_zenith - *lift).clamp(0.0, horizon);
        for _ in 0..12 {
            lengths.fill(0.0);
            let miss = true_zenith - self.escape(from, apparent, &mut lengths)?;
            if miss.abs() < 1e-8 {
                *lift = true_zenith - apparent;
                return Some(lengths);
            }
            if miss > 0.0 && apparent >= horizon {
                return None;
            }
            apparent = (apparent + miss).clamp(0.0, horizon);
        }
        Some(lengths)
    }

    /// Path lengths in each layer \[m\] from a height towards a sun *seen* at a zenith angle; `None` below the horizon.
    pub fn towards_apparent(&self, from: f64, apparent: f64) -> Option<Vec<f64>> {
        let mut lengths = vec![0.0; self.heights.len() - 1];
        self.escape(from, apparent.clamp(0.0, PI), &mut lengths)?;
        Some(lengths)
    }
}

impl Round {
    /// x at a height in a layer, or beyond it.
    fn x_at(&self, heights: &[f64], layer: usize, height: f64) -> f64 {
        self.x[layer + 1] + self.slope[layer] * (height - heights[layer + 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shells(refractivity: f64) -> Shells {
        let heights: Vec<f64> = (0..=400).rev().map(|i| 250.0 * f64::from(i)).collect();
        let refractivity = heights.iter().map(|h| refractivity * (-h / 8000.0).exp()).collect();
        Shells::new(&Strata { heights, refractivity, radius: 6_371_000.0 }, true)
    }

    /// Without refraction the shells add up to one: s = √(R²μ² + 2Rh + h²) − Rμ, from the zenith to the horizon and, from a
    /// height, to below it.
    #[test]
    fn straight_rays_have_the_length_of_one_shell() {
        let shells = shells(0.0);
        let (radius, top) = (6_371_000.0f64, 100_000.0f64);
        for degrees in [0.0f64, 40.0, 85.0, 89.9, 90.0] {
            let mu = degrees.to_radians().cos();
            let due = (radius * radius * mu * mu + 2.0 * radius * top + top * top).sqrt() - radius * mu;
            let found: f64 = shells.towards_sun(0.0, degrees.to_radians()).unwrap().iter().sum();
            assert!((found / due - 1.0).abs() < 1e-9, "{degrees}: {found} {due}");
        }
        // From 20 km at 94°: over the tangent point and out, √((R+H)² − q²) + √((R+h)² − q²).
        let (height, zenith) = (20_000.0, 94f64.to_radians());
        let q = (radius + height) * zenith.sin();
        let due = ((radius + top).powi(2) - q * q).sqrt() + ((radius + height).powi(2) - q * q).sqrt();
        let found: f64 = shells.towards_sun(height, zenith).unwrap().iter().sum();
        assert!((found / due - 1.0).abs() < 1e-9, "{found} {due}");
        assert!(shells.towards_sun(0.0, 90.1f64.to_radians()).is_none());
        assert!(shells.towards_sun(20_000.0, 95f64.to_radians()).is_none());
    }

    /// Refraction at the horizon of standard air is some 34′ [Meeus1998, ch. 16]; at 45° R = (n₀−1) tan θ (1 − H/R) − … = 57″.
    /// The sun is seen when it stands below the horizon.
    #[test]
    fn standard_air_lifts_the_sun_by_half_a_degree_at_the_horizon() {
        let shells = shells(2.77e-4);
        let lift = |apparent: f64| {
            let mut lengths = vec![0.0; 400];
            60.0 * (shells.escape(0.0, apparent, &mut lengths).unwrap() - apparent).to_degrees()
        };
        assert!((33.0..38.0).contains(&lift(FRAC_PI_2)), "{}", lift(FRAC_PI_2));
        assert!((60.0 * lift(45f64.to_radians()) - 57.0).abs() < 0.6, "{}", 60.0 * lift(45f64.to_radians()));
        assert!(shells.towards_sun(0.0, 90.4f64.to_radians()).is_some());
        assert!(shells.towards_sun(0.0, 90.8f64.to_radians()).is_none());
    }

    /// A rising ray of zenith 60° on a flat Earth is 2 h long; heights and layers follow one another.
    #[test]
    fn a_ray_on_a_flat_earth_is_a_straight_line() {
        let strata = Strata { heights: vec![3.0, 2.0, 1.0, 0.0], refractivity: vec![0.0; 4], radius: 1e6 };
        let shells = Shells::new(&strata, false);
        let path = shells.rising(0.5, FRAC_PI_2 / 1.5, 2.25);
        assert_eq!(path.iter().map(|s| s.layer).collect::<Vec<_>>(), [2, 1, 0]);
        let length: f64 = path.iter().map(|s| shells.length(s, s.high)).sum();
        assert!((length - 3.5).abs() < 1e-12);
    }
}
