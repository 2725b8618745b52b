//! What the quadrature misses of light near the horizon.
//!
//! Within an optical depth t of the top or the bottom of the air, the radiance near the horizon changes over cosines of t,
//! which the nodes do not resolve where t is small. Of light with a source J that changes little over that depth,
//!
//! ```text
//! I(τ, μ) = J(τ, 0) (1 − e^(−t/μ))
//! ½ ∫₀¹ Λ_l I dμ − ½ Σ w Λ_l I ≈ −½ Λ_l(0) J(τ, 0) e(t)       e(t) = E₂(t) − Σ w e^(−t/μ)
//! ```
//!
//! with t the depth of what the light comes through. Light from a ground of radiance 1, e^(−t/μ), is missed with the opposite
//! sign.

use super::Scaled;
use super::quadrature::Quadrature;

/// e(t) at the levels of a stack from the top down, such that a parabola through the edges and the middle of a part has the
/// integral of e over it, and a straight line where there is no middle, though e may swing within.
#[derive(Debug, Default)]
pub(super) struct Grazing {
    /// Of what comes down.
    pub down: Vec<f64>,
    /// Of what goes up.
    pub up: Vec<f64>,
}

/// At larger depths every quadrature is exact.
const DEEP: f64 = 6.0;
/// Parts so thin take the mean of their edges.
const THIN: f64 = 1e-7;

impl Grazing {
    #[inline(always)]
    pub fn new<const N: usize>(quadrature: &Quadrature<N>, layers: &[Scaled]) -> Self {
        let parts = || layers.iter().flat_map(|layer| std::iter::repeat_n(layer, layer.cut.parts));
        let mut edges = vec![0.0]; // depths, from the top down
        edges.extend(parts().scan(0.0, |depth, part| {
            *depth += part.depth;
            Some(*depth)
        }));
        let whole = edges[edges.len() - 1];
        // e, and its integral from 0.
        let missed = |t: f64| {
            if t <= 0.0 || t > DEEP {
                return [0.0; 2];
            }
            let nodes = quadrature.cosines.iter().zip(&quadrature.weights);
            let [e2, e3] = exponential_integrals(t);
            nodes.fold([e2, -e3], |[of_t, integral], (mu, w)| {
                let passes = w * (-t / mu).exp();
                [of_t - passes, integral + mu * passes]
            })
        };
        let levels = |depths: Vec<f64>| {
            let at_edges: Vec<[f64; 2]> = depths.iter().map(|depth| missed(*depth)).collect();
            let means = depths.windows(2).zip(at_edges.windows(2)).map(|(t, e)| {
                let (part, [a, from], [b, to]) = (t[1] - t[0], e[0], e[1]);
                let resolved = part.abs() > THIN && t[0].max(t[1]) <= DEEP;
                if resolved { (to - from) / part } else { 0.5 * (a + b) }
            });
            let means: Vec<f64> = means.collect();
            // What a straight line lacks of the mean of a part without a middle, its edges have more.
            let mut edges: Vec<f64> = at_edges.iter().map(|[e, _]| *e).collect();
            for ((i, mean), layer) in means.iter().enumerate().zip(parts()) {
                if !layer.cut.middles {
                    let lacks = mean - 0.5 * (at_edges[i][0] + at_edges[i + 1][0]);
                    edges[i] += if i == 0 { lacks } else { 0.5 * lacks };
                    edges[i + 1] += if i + 1 == means.len() { lacks } else { 0.5 * lacks };
                }
            }
            let mut levels = vec![edges[0]];
            for ((ends, mean), layer) in edges.windows(2).zip(means).zip(parts()) {
                levels.extend(layer.cut.middles.then_some(1.5 * mean - 0.25 * (ends[0] + ends[1])));
                levels.push(ends[1]);
            }
            levels
        };
        Self { up: levels(edges.iter().map(|depth| whole - depth).collect()), down: levels(edges) }
    }
}

/// E₂ and E₃ at t > 0 [Abramowitz1964, eqs. 5.1.11, 5.1.14, 5.1.22].
fn exponential_integrals(t: f64) -> [f64; 2] {
    const EULER: f64 = 0.577_215_664_901_532_9;
    let passes = (-t).exp();
    let e2 = if t < 1.5 {
        let (mut e1, mut power) = (-EULER - t.ln(), -1.0);
        for n in 1..24 {
            let n = f64::from(n);
            power *= -t / n;
            e1 += power / n;
        }
        passes - t * e1
    } else {
        // e^(−t) (1/(t+2) − 1·2/(t+4) − 2·3/(t+6) − …), from its end.
        let fraction = (1..40).rev().fold(t + 80.0, |rest, n| {
            let n = f64::from(n);
            t + 2.0 * n - n * (n + 1.0) / rest
        });
        passes / fraction
    };
    [e2, 0.5 * (passes - t * e2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::Cut;

    /// From below a stack the levels are those from above it, whatever its parts: one, and three alike.
    #[test]
    fn up_mirrors_down() {
        for cut in [1, 3].into_iter().flat_map(|parts| [false, true].map(|middles| Cut { parts, middles })) {
            let layers = [Scaled { depth: 0.02, cut, coupling: vec![1.0; 16] }];
            let Grazing { down, up } = Grazing::new(&Quadrature::<8>::new(), &layers);
            assert_eq!(down.len(), cut.levels() + 1);
            assert!(!cut.middles || (down[0], up[cut.levels()]) == (0.0, 0.0));
            assert!(down.iter().zip(up.iter().rev()).all(|(a, b)| (a - b).abs() < 1e-12), "{down:?} {up:?}");
        }
    }

    /// Through the levels of a part, e has its integral by a straight line as by a parabola.
    #[test]
    fn a_part_has_the_integral_of_e() {
        let of = |middles| {
            let layers = [Scaled { depth: 0.02, cut: Cut { parts: 1, middles }, coupling: vec![1.0; 16] }];
            Grazing::new(&Quadrature::<8>::new(), &layers).down
        };
        let (two, three) = (of(false), of(true));
        let (line, parabola) = (0.5 * (two[0] + two[1]), (three[0] + 4.0 * three[1] + three[2]) / 6.0);
        assert!(parabola.abs() > 1e-3 && (line - parabola).abs() < 1e-14, "{line} {parabola}");
    }

    /// [Abramowitz1964, table 5.4], and t → 0.
    #[test]
    fn the_exponential_integral_is_that_of_the_tables() {
        for (t, due) in
            [(0.0001f64, 0.0), (0.1, 0.722_545_0), (0.5, 0.326_643_9), (1.0, 0.148_495_5), (2.0, 0.037_534_3)]
        {
            let due = if t < 1e-3 { 1.0 + t * (t.ln() + 0.577_215_7 - 1.0) } else { due };
            let found = exponential_integrals(t)[0];
            assert!((found - due).abs() < 1e-7, "{t}: {found} {due}");
        }
        let (below, above) = (exponential_integrals(1.5 - 1e-13)[1], exponential_integrals(1.5)[1]);
        assert!((below / above - 1.0).abs() < 1e-11, "{below} {above}");
    }
}
