//! Phase functions: how a scatterer spreads light over angle.
//!
//! ```text
//! P(Θ) = Σ_l (2l+1) χ_l P_l(cos Θ),  χ_0 = 1       (1/4π) ∫ P dω = 1
//! Rayleigh           P = 3/(4(1+2γ)) [(1+3γ) + (1−γ) cos²Θ],  γ = ρ/(2−ρ)          [Chandrasekhar1960, Bodhaine1999]
//! Henyey–Greenstein  P = (1−g²)/(1+g²−2g cos Θ)^(3/2),  χ_l = g^l                  [Henyey1941]
//! ```

use std::f64::consts::PI;
use std::sync::{Arc, LazyLock, Mutex};

use sunglint_radiometry::gauss_legendre;

/// A phase function, normalised so that its mean over the sphere is 1.
#[derive(Debug)]
pub(crate) struct Phase {
    law: Law,
    /// χ_0, χ_1, … as far as they were asked for.
    moments: Mutex<Arc<Vec<f64>>>,
}

#[derive(Clone, Debug)]
enum Law {
    Rayleigh {
        gamma: f64,
    },
    HenyeyGreenstein {
        g: f64,
    },
    Moments(Vec<f64>),
    /// Scattering angles \[rad\] ascending from 0 to π, and ln P there, straight between them.
    Table {
        angles: Vec<f64>,
        logs: Vec<f64>,
    },
    Mix(Vec<(f64, Arc<Phase>)>),
}

/// Moments that are taken of a table.
const MOST_MOMENTS: usize = 500;
/// Nodes of a panel of its quadrature.
const PANEL: usize = 32;

impl Phase {
    /// Molecules of depolarisation ρ.
    pub fn rayleigh(depolarisation: f64) -> Self {
        Self::of(Law::Rayleigh { gamma: depolarisation / (2.0 - depolarisation) })
    }

    /// Of asymmetry g, −1 < g < 1.
    pub fn henyey_greenstein(g: f64) -> Self {
        Self::of(Law::HenyeyGreenstein { g })
    }

    /// From χ_0 = 1, χ_1, …; those beyond the last are 0.
    pub fn from_moments(moments: Vec<f64>) -> Self {
        Self::of(Law::Moments(moments))
    }

    /// From values at scattering angles \[rad\], at least two, ascending within 0..π; exponential between them, constant
    /// beyond them, and normalised here whatever their scale.
    pub fn table(angles: &[f64], values: &[f64]) -> Self {
        let (mut angles, mut logs): (Vec<f64>, Vec<f64>) =
            angles.iter().zip(values).map(|(a, v)| (*a, v.max(1e-300).ln())).unzip();
        if angles[0] > 0.0 {
            angles.insert(0, 0.0);
            logs.insert(0, logs[0]);
        }
        if angles[angles.len() - 1] < PI {
            angles.push(PI);
            logs.push(logs[logs.len() - 1]);
        }
        let raw = Law::Table { angles, logs };
        let total = raw.project(0)[0];
        let Law::Table { angles, mut logs } = raw else { unreachable!("made above") };
        logs.iter_mut().for_each(|log| *log -= total.ln());
        Self::of(Law::Table { angles, logs })
    }

    /// A mixture; the shares are brought to a sum of 1.
    pub fn mix(parts: Vec<(f64, Arc<Phase>)>) -> Self {
        let total: f64 = parts.iter().map(|(share, _)| share).sum();
        Self::of(Law::Mix(parts.into_iter().map(|(share, phase)| (share / total, phase)).collect()))
    }

    fn of(law: Law) -> Self {
        Self { law, moments: Mutex::default() }
    }

    /// P at the cosine of a scattering angle.
    pub fn value(&self, cos: f64) -> f64 {
        self.law.value(cos)
    }

    /// The phase functions that it mixes, and their shares; itself where it mixes none.
    pub fn parts(self: &Arc<Self>) -> Vec<(f64, Arc<Self>)> {
        match &self.law {
            Law::Mix(parts) => {
                let of = |(share, phase): &(f64, Arc<Self>)| {
                    let share = *share;
                    phase.parts().into_iter().map(move |(own, phase)| (share * own, phase))
                };
                parts.iter().flat_map(of).collect()
            }
            _ => vec![(1.0, Arc::clone(self))],
        }
    }

    /// Whether it is looked up in a table.
    pub fn is_table(&self) -> bool {
        matches!(self.law, Law::Table { .. })
    }

    /// χ_1.
    pub fn asymmetry(&self) -> f64 {
        match &self.law {
            Law::Table { .. } => self.law.project(1)[1],
            _ => self.moments(1)[1],
        }
    }

    /// χ_0 … χ_n at least.
    pub fn moments(&self, n: usize) -> Arc<Vec<f64>> {
        let mut kept = self.moments.lock().expect("no holder of this lock panics");
        if kept.len() <= n {
            *kept = Arc::new(self.law.moments(n));
        }
        Arc::clone(&kept)
    }
}

impl Law {
    fn value(&self, cos: f64) -> f64 {
        match self {
            Self::Rayleigh { gamma } => 0.75 / (1.0 + 2.0 * gamma) * ((1.0 + 3.0 * gamma) + (1.0 - gamma) * cos * cos),
            Self::HenyeyGreenstein { g } => {
                // 1 + g² − 2g cos Θ without cancellation near the peak.
                let d = (1.0 - g).powi(2) + 2.0 * g * (1.0 - cos);
                let d = if *g < 0.0 { (1.0 + g).powi(2) - 2.0 * g * (1.0 + cos) } else { d };
                (1.0 - g * g) / (d * d.sqrt())
            }
            Self::Moments(chi) => {
                let (mut p0, mut p1, mut sum) = (1.0, cos, chi[0]);
                for (l, chi) in chi.iter().enumerate().skip(1) {
                    let k = l as f64;
                    sum += (2.0 * k + 1.0) * chi * p1;
                    (p0, p1) = (p1, ((2.0 * k + 1.0) * cos * p1 - k * p0) / (k + 1.0));
                }
                sum.max(0.0)
            }
            Self::Table { angles, logs } => {
                let angle = cos.clamp(-1.0, 1.0).acos();
                let i = angles.partition_point(|a| *a <= angle).clamp(1, angles.len() - 1);
                let t = (angle - angles[i - 1]) / (angles[i] - angles[i - 1]);
                (logs[i - 1] + (logs[i] - logs[i - 1]) * t).exp()
            }
            Self::Mix(parts) => parts.iter().map(|(share, phase)| share * phase.value(cos)).sum(),
        }
    }

    fn moments(&self, n: usize) -> Vec<f64> {
        let mut chi = match self {
            Self::Rayleigh { gamma } => vec![1.0, 0.0, 0.1 * (1.0 - gamma) / (1.0 + 2.0 * gamma)],
            Self::HenyeyGreenstein { g } => (0..=n as i32).map(|l| g.powi(l)).collect(),
            Self::Moments(chi) => chi.clone(),
            // As many whatever is asked for: their last digits depend on it.
            Self::Table { .. } => self.project(n.max(MOST_MOMENTS)),
            Self::Mix(parts) => {
                let mut sum = vec![0.0; n + 1];
                for (share, phase) in parts {
                    sum.iter_mut().zip(phase.moments(n).iter()).for_each(|(sum, chi)| *sum += share * chi);
                }
                sum
            }
        };
        if chi.len() <= n {
            chi.resize(n + 1, 0.0);
        }
        chi
    }

    /// χ_l = ½ ∫ P P_l d(cos Θ), by Gauss–Legendre between the angles of a table.
    fn project(&self, n: usize) -> Vec<f64> {
        let Self::Table { angles, .. } = self else { unreachable!("only tables are projected") };
        static NODES: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss_legendre(PANEL));
        let mut chi = vec![0.0; n + 1];
        let steps: Vec<(f64, f64)> =
            (0..=n).map(|k| k as f64).map(|k| ((2.0 * k + 1.0) / (k + 1.0), k / (k + 1.0))).collect();
        for pair in angles.windows(2) {
            // A panel holds at most half a wave of the highest polynomial.
            let panels = ((pair[1] - pair[0]) * n as f64 / (8.0 * PI)).ceil().max(1.0) as usize;
            let width = (pair[1] - pair[0]) / panels as f64;
            for panel in 0..panels {
                // Weight × P_l at the nodes of the panel, side by side.
                let (mut cosines, mut before, mut now) = ([0.0; PANEL], [0.0; PANEL], [0.0; PANEL]);
                for (i, (x, w)) in NODES.iter().enumerate() {
                    let angle = pair[0] + width * (panel as f64 + 0.5 * (1.0 + x));
                    cosines[i] = angle.cos();
                    now[i] = 0.25 * w * width * angle.sin() * self.value(cosines[i]);
                }
                for (chi, (up, down)) in chi.iter_mut().zip(&steps) {
                    let mut sums = [0.0; 4];
                    for i in 0..PANEL {
                        sums[i % 4] += now[i];
                        let next = up * cosines[i] * now[i] - down * before[i];
                        (before[i], now[i]) = (now[i], next);
                    }
                    *chi += (sums[0] + sums[1]) + (sums[2] + sums[3]);
                }
            }
        }
        chi
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Σ (2l+1) χ_l P_l against the closed form, and a table of it against both.
    #[test]
    fn henyey_greenstein_is_the_sum_of_its_moments_and_of_its_table() {
        let g = 0.7;
        let closed = Phase::henyey_greenstein(g);
        let summed = Phase::from_moments(closed.moments(150)[..=150].to_vec());
        let angles: Vec<f64> = (0..=1800).map(|i| f64::from(i) * PI / 1800.0).collect();
        let values: Vec<f64> = angles.iter().map(|a| 7.0 * closed.value(a.cos())).collect();
        let table = Phase::table(&angles, &values);
        for degrees in [0.0f64, 5.0, 40.0, 90.0, 179.0] {
            let cos = degrees.to_radians().cos();
            assert!((summed.value(cos) / closed.value(cos) - 1.0).abs() < 1e-9, "{degrees}");
            assert!((table.value(cos) / closed.value(cos) - 1.0).abs() < 1e-5, "{degrees}");
        }
        for l in 0..40 {
            assert!((table.moments(40)[l] - g.powi(l as i32)).abs() < 1e-5, "{l}");
        }
    }

    /// Bodhaine's air, ρ = 0.0279 at 0.55 µm; ½ ∫ P d(cos Θ) = 1 and χ_2 = (1−γ)/(10(1+2γ)).
    #[test]
    fn rayleigh_is_normalised_and_has_two_moments() {
        let phase = Phase::rayleigh(0.0279);
        let of = |l: u32| -> f64 {
            (gauss_legendre(8).iter())
                .map(|(x, w)| 0.5 * w * phase.value(*x) * if l == 0 { 1.0 } else { 1.5 * x * x - 0.5 })
                .sum()
        };
        assert!((of(0) - 1.0).abs() < 1e-14);
        assert!((of(2) - phase.moments(4)[2]).abs() < 1e-15 && phase.moments(4)[4] == 0.0);
    }
}
