//! A band model as a sum of exponentials: the k-distribution of two neighbouring intervals with common weights.
//!
//! ```text
//! minimise max |Σ_g w_g exp(−k_g W) − T(W)|,   w_g = e^(v_g)/Σ e^(v),  k_g = e^(κ_g)
//! ```
//!
//! Levenberg and Marquardt's method \[Marquardt1963\] on v and κ gives the least squares over a geometric row of W;
//! Lawson's weights \[Lawson1961\], u ← u |r|, lead on to the least maximum.

/// T(W) = Σ share exp(−(C W)^a), the mean transmission over the samples of an interval.
#[derive(Clone, Debug)]
pub(crate) struct Target {
    /// (share, C^a, a); the shares sum to 1.
    samples: Vec<(f64, f64, f64)>,
}

impl Target {
    /// From share, C and a of samples.
    pub fn new(samples: impl Iterator<Item = (f64, f64, f64)>) -> Self {
        let mut samples: Vec<(f64, f64, f64)> = samples.map(|(share, c, a)| (share, c.powf(a), a)).collect();
        let total: f64 = samples.iter().map(|sample| sample.0).sum();
        samples.iter_mut().for_each(|sample| sample.0 /= total);
        Self { samples }
    }

    /// T(W).
    pub fn transmittance(&self, w: f64) -> f64 {
        let (mut a, mut power) = (f64::NAN, 0.0);
        (self.samples.iter())
            .map(|sample| {
                if sample.2 != a {
                    a = sample.2;
                    power = w.powf(a);
                }
                sample.0 * (-sample.1 * power).exp()
            })
            .sum()
    }

    /// The W at which 1 − T is `loss`, at most `limit`.
    fn where_lost(&self, loss: f64, limit: f64) -> f64 {
        let (mut low, mut high) = ((limit * 1e-14).ln(), limit.ln());
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            if 1.0 - self.transmittance(middle.exp()) < loss { low = middle } else { high = middle }
        }
        (0.5 * (low + high)).exp()
    }
}

/// Common weights, and the k of either interval.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Terms {
    pub weights: Vec<f64>,
    pub k: [Vec<f64>; 2],
}

/// More terms than this are not tried.
const MOST: usize = 8;
/// Values of W at which the sum is held against the model.
const POINTS: usize = 36;
/// Rounds of Lawson's weights.
const ROUNDS: usize = 10;
/// The least squares are settled where a step takes less than this share off their sum.
const SETTLED: f64 = 1e-2;
/// Least squares that miss by more than this many tolerances are not worth Lawson's rounds.
const HOPELESS: f64 = 3.0;
/// Nor is it worth going on with them where the fourth still misses by this many.
const FAR: f64 = 1.4;
/// Between the points of W the sum may miss a little more than at them.
const MARGIN: f64 = 0.94;

/// The fewest terms that miss no target by more than `tolerance`, for W from 0 to `w_max`.
pub(crate) fn terms(targets: &[Target; 2], w_max: f64, tolerance: f64) -> Terms {
    let lost = targets.iter().map(|target| 1.0 - target.transmittance(w_max)).fold(0.0, f64::max);
    let mean = |target: &Target| -target.transmittance(0.3 * w_max).max(1e-300).ln() / (0.3 * w_max);
    if lost < tolerance {
        return Terms { weights: vec![1.0], k: [vec![mean(&targets[0])], vec![mean(&targets[1])]] };
    }
    let least = targets.iter().map(|target| target.where_lost(0.25 * tolerance, w_max)).fold(w_max, f64::min);
    let rise = (w_max / least).powf(1.0 / (POINTS - 1) as f64);
    let w: Vec<f64> = (0..POINTS).map(|i| least * rise.powi(i as i32)).collect();
    let due = [0, 1].map(|node: usize| w.iter().map(|w| targets[node].transmittance(*w)).collect::<Vec<f64>>());
    // Beer's law takes one term; no exponent a of the tables lets fewer do than these.
    let start = match lost {
        x if x < 0.25 => 2,
        x if x < 0.75 => 3,
        x if x < 0.98 => 4,
        _ => 5,
    };
    let mut best: Option<(f64, Fit)> = None;
    for n in (1..=1).chain(start..=MOST) {
        let mut fit = Fit::begin(targets, n, w_max, lost);
        let error = fit.refine(&w, &due, MARGIN * tolerance);
        let done = error <= MARGIN * tolerance
            && fit.largest_miss(targets, w[..POINTS - 1].iter().map(|w| w * rise.sqrt())) <= tolerance;
        if done || best.as_ref().is_none_or(|(least, _)| error < *least) {
            best = Some((error, fit));
        }
        if done {
            break;
        }
    }
    best.map(|(_, fit)| fit.terms()).expect("at least one number of terms is tried")
}

/// Parameters: v of all terms but the last, whose v is 0; then κ of node 0, then of node 1.
#[derive(Clone)]
struct Fit {
    n: usize,
    parameters: Vec<f64>,
}

impl Fit {
    /// k between those at the two ends of W, the wider apart the higher.
    fn begin(targets: &[Target; 2], n: usize, w_max: f64, lost: f64) -> Self {
        let first = 0.5 * 0.4f64.powi(n as i32 - 1) * lost;
        let mut kappa = Vec::with_capacity(2 * n);
        for target in targets {
            let here = 1.0 - target.transmittance(w_max);
            let end = target.where_lost((0.99f64).min(here.max(1e-9)), w_max);
            let slope = |w: f64| (target.transmittance(0.9 * w) / target.transmittance(w)).ln() / (0.1 * w);
            let low = slope(end).max(1e-12 / w_max);
            let high = (1.0 / target.where_lost(first.min(0.5 * here).max(1e-9), w_max)).max(4.0 * low);
            for g in 0..n {
                let t = if n == 1 { 0.3 } else { g as f64 / (n - 1) as f64 };
                kappa.push(low.ln() + (high / low).ln() * t.powf(1.4));
            }
        }
        let v = (0..n).map(|g| -0.5 * (kappa[g] - kappa[n - 1]));
        Self { n, parameters: v.take(n - 1).chain(kappa.iter().copied()).collect() }
    }

    fn weights(&self) -> Vec<f64> {
        let v = |g: usize| if g + 1 == self.n { 0.0 } else { self.parameters[g] };
        let top = (0..self.n).map(v).fold(f64::NEG_INFINITY, f64::max);
        let raw: Vec<f64> = (0..self.n).map(|g| (v(g) - top).exp()).collect();
        let total: f64 = raw.iter().sum();
        raw.iter().map(|w| w / total).collect()
    }

    fn k(&self, node: usize) -> impl Iterator<Item = f64> {
        let from = self.n - 1 + node * self.n;
        self.parameters[from..from + self.n].iter().map(|kappa| kappa.exp())
    }

    fn terms(&self) -> Terms {
        Terms { weights: self.weights(), k: [self.k(0).collect(), self.k(1).collect()] }
    }

    /// Brings the largest miss down, and returns it.
    fn refine(&mut self, w: &[f64], due: &[Vec<f64>; 2], tolerance: f64) -> f64 {
        let mut u = vec![1.0; 2 * w.len()];
        let (mut best, mut least) = (self.clone(), f64::INFINITY);
        for round in 0..ROUNDS {
            let misses = self.least_squares(w, due, &u, if round == 0 { 20 } else { 3 });
            let largest = misses.iter().fold(0.0f64, |top, r| top.max(r.abs()));
            if largest < least {
                (least, best) = (largest, self.clone());
            }
            // Far from the goal more terms are cheaper than more rounds.
            if least <= tolerance
                || (round == 0 && least > HOPELESS * tolerance)
                || (round == 3 && least > FAR * tolerance)
            {
                break;
            }
            u.iter_mut().zip(&misses).for_each(|(u, r)| *u *= r.abs() / largest + 0.02);
            let total: f64 = u.iter().sum();
            u.iter_mut().for_each(|u| *u *= (2 * w.len()) as f64 / total);
        }
        *self = best;
        least
    }

    fn largest_miss(&self, targets: &[Target; 2], w: impl Iterator<Item = f64>) -> f64 {
        let Terms { weights, k } = self.terms();
        w.flat_map(|w| [0, 1].map(|node| (node, w)))
            .map(|(node, w)| {
                let sum: f64 = weights.iter().zip(&k[node]).map(|(share, k)| share * (-k * w).exp()).sum();
                (sum - targets[node].transmittance(w)).abs()
            })
            .fold(0.0, f64::max)
    }

    /// e^(−k_g W) of both nodes and all W, term by term, and by how much their sums miss.
    fn evaluate(&self, w: &[f64], due: &[Vec<f64>; 2]) -> (Vec<f64>, Vec<f64>) {
        let weights = self.weights();
        let (mut terms, mut misses) = (Vec::with_capacity(2 * w.len() * self.n), Vec::with_capacity(2 * w.len()));
        for (node, due) in due.iter().enumerate() {
            let k: Vec<f64> = self.k(node).collect();
            for (w, due) in w.iter().zip(due) {
                let from = terms.len();
                terms.extend(k.iter().map(|k| (-k * w).exp()));
                misses.push(terms[from..].iter().zip(&weights).map(|(term, share)| term * share).sum::<f64>() - due);
            }
        }
        (terms, misses)
    }

    fn least_squares(&mut self, w: &[f64], due: &[Vec<f64>; 2], u: &[f64], rounds: usize) -> Vec<f64> {
        let size = self.parameters.len();
        let cost = |misses: &[f64]| -> f64 { misses.iter().zip(u).map(|(r, u)| u * r * r).sum() };
        let (mut terms, mut misses) = self.evaluate(w, due);
        let mut now = cost(&misses);
        let mut damping = 1e-3;
        for _ in 0..rounds {
            let (normal, gradient) = self.normal_equations(w, &terms, &misses, u);
            let before = now;
            for _ in 0..6 {
                let mut damped = normal.clone();
                (0..size).for_each(|i| damped[i * size + i] *= 1.0 + damping);
                let mut trial = self.clone();
                if let Some(step) = solve(damped, &gradient) {
                    trial.parameters.iter_mut().zip(step).for_each(|(p, step)| *p -= step.clamp(-1.5, 1.5));
                    let (new_terms, new_misses) = trial.evaluate(w, due);
                    let then = cost(&new_misses);
                    if then < now {
                        (*self, now, terms, misses) = (trial, then, new_terms, new_misses);
                        damping = (0.2 * damping).max(1e-10);
                        break;
                    }
                }
                damping *= 6.0;
            }
            if now >= before * (1.0 - SETTLED) {
                break;
            }
        }
        misses
    }

    /// JᵀuJ, its lower half, and Jᵀur.
    fn normal_equations(&self, w: &[f64], terms: &[f64], misses: &[f64], u: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (n, size) = (self.n, self.parameters.len());
        let weights = self.weights();
        let (mut normal, mut gradient) = (vec![0.0; size * size], vec![0.0; size]);
        // Row of J: v of all terms but the last, then κ of this node.
        let mut row = vec![0.0; 2 * n - 1];
        for node in 0..2 {
            let k: Vec<f64> = self.k(node).collect();
            let place = |i: usize| if i < n - 1 { i } else { i + node * n };
            for (j, w) in w.iter().enumerate() {
                let at = node * POINTS + j;
                let term = &terms[at * n..(at + 1) * n];
                let sum: f64 = term.iter().zip(&weights).map(|(term, share)| term * share).sum();
                for g in 0..n {
                    row[n - 1 + g] = -weights[g] * k[g] * w * term[g];
                    if g + 1 < n {
                        row[g] = weights[g] * (term[g] - sum);
                    }
                }
                for a in 0..row.len() {
                    let scaled = u[at] * row[a];
                    gradient[place(a)] += scaled * misses[at];
                    let line = place(a) * size;
                    for (b, value) in row[..=a].iter().enumerate() {
                        normal[line + place(b)] += scaled * value;
                    }
                }
            }
        }
        (normal, gradient)
    }
}

/// A x = b for a symmetric positive definite A of which the lower half is given, by Cholesky's method.
fn solve(mut a: Vec<f64>, b: &[f64]) -> Option<Vec<f64>> {
    let n = b.len();
    let mut x = b.to_vec();
    for i in 0..n {
        for j in 0..=i {
            let sum = a[i * n + j] - (0..j).map(|k| a[i * n + k] * a[j * n + k]).sum::<f64>();
            if i == j {
                if sum <= 0.0 || !sum.is_finite() {
                    return None;
                }
                a[i * n + i] = sum.sqrt();
            } else {
                a[i * n + j] = sum / a[j * n + j];
            }
        }
        x[i] = (x[i] - (0..i).map(|k| a[i * n + k] * x[k]).sum::<f64>()) / a[i * n + i];
    }
    for i in (0..n).rev() {
        x[i] = (x[i] - (i + 1..n).map(|k| a[k * n + i] * x[k]).sum::<f64>()) / a[i * n + i];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(c: f64, a: f64) -> Target {
        Target::new([(1.0, c, a)].into_iter())
    }

    #[test]
    fn beer_s_law_is_one_term_of_its_own_k() {
        let terms = terms(&[one(0.3, 1.0), one(0.7, 1.0)], 20.0, 1e-4);
        assert_eq!(terms.weights, [1.0]);
        assert!((terms.k[0][0] / 0.3 - 1.0).abs() < 1e-3 && (terms.k[1][0] / 0.7 - 1.0).abs() < 1e-3, "{terms:?}");
    }

    /// exp(−√x) = ∫ e^(−k x) e^(−1/(4k))/√(4π k³) dk.
    #[test]
    fn a_square_root_law_has_positive_terms_about_the_median_of_levy_s_density() {
        let terms = terms(&[one(1.0, 0.5), one(10.0, 0.5)], 1e4, 0.002);
        let mut sum = 0.0;
        // Half of Lévy's density, erfc(1/(2√k)) = ½, lies below k = 1/(4·0.476936²) = 1.0990.
        for (w, k) in terms.weights.iter().zip(&terms.k[0]) {
            assert!(*w > 0.0 && *k > 0.0);
            sum += if *k < 1.099 { *w } else { 0.0 };
        }
        assert!((0.35..0.75).contains(&sum), "{terms:?}");
        for i in 0..100 {
            let x = 10f64.powf(-6.0 + 0.1 * f64::from(i));
            for (node, c) in [1.0, 10.0].into_iter().enumerate() {
                let found: f64 = terms.weights.iter().zip(&terms.k[node]).map(|(w, k)| w * (-k * x).exp()).sum();
                assert!((found - (-(c * x).sqrt()).exp()).abs() < 0.002, "{x}");
            }
        }
    }
}
