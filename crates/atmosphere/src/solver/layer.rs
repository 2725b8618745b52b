//! One homogeneous layer at one azimuthal order: its reflection and transmission, and what a beam in it gives, by the
//! eigenvectors of the discrete-ordinate equation in its symmetric form.
//!
//! ```text
//! x = I⁺ + I⁻,  y = I⁺ − I⁻,  both times √(wμ) at the nodes μ of a double-Gauss quadrature, τ from the top down
//! dx/dτ = B y + b,   dy/dτ = A x + a                                    [Stamnes1981, eq. 11; Nakajima1986, eq. 11]
//! A = 1/μ − Σ_even c_l u_l u_lᵀ,  B = 1/μ − Σ_odd c_l u_l u_lᵀ          c_l = ω(2l+1)χ_l,  u_l = √(w/μ) Λ_l^m(μ)
//! B = L Lᵀ,  Lᵀ A L = U k² Uᵀ,  F = L U,  G = L⁻ᵀ U                     x = F ξ,  y = G η
//! ξ′ = η + β,  η′ = k² ξ + α,   α = Fᵀ a,  β = Gᵀ b                     one pair of equations a mode
//! r + t = 2 (1 + D_s)⁻¹ − 1,  D_s = G [k tanh kh] Gᵀ                    light that enters alike from both sides
//! r − t = 2 (1 + D_a)⁻¹ − 1,  D_a = G [k coth kh] Gᵀ                    and with opposite sign;  h half the depth
//! ```
//!
//! "Even" and "odd" are the parities of l + m. Nothing grows with depth, ω = 1 is no exception (k = 0 is the limit of every
//! function here), and no term of it depends on the sun.

use std::f64::consts::PI;

use super::Scaled;
use super::matrix::{
    Eigen, Matrix, Sizes, Vector, apply_to_each, apply_transposed, cholesky, inverse_definite, inverse_lower, product,
    transpose,
};
use super::quadrature::{Moments, Order};

/// A layer at one order.
pub(super) enum Operator<const N: usize> {
    /// It does not scatter at this order: e^(−Δ/μ).
    Clear(Vector<N>),
    /// It does.
    Scattering(Box<Slab<N>>),
}

/// Operators of a layer that scatters.
pub(super) struct Slab<const N: usize> {
    pub reflection: Matrix<N>,
    pub transmission: Matrix<N>,
    pub g: Matrix<N>,
    /// c_l from ξ and η.
    pub moments: Moments<N>,
    /// −(2 − δ_m0)/2π c_l Fᵀ u_l for even l + m, by which Λ_l of a beam gives α; the same with Gᵀ for odd ones and β.
    to_alpha: Matrix<N>,
    to_beta: Matrix<N>,
    /// ½ (1 + D_s)⁻¹ G and ½ (1 + D_a)⁻¹ G, transposed.
    even: Matrix<N>,
    odd: Matrix<N>,
    modes: Modes<N>,
    depth: f64,
    /// Whether the field in its middle is wanted.
    pub middles: bool,
}

/// α and β of a beam of transmittance 1.
#[derive(Clone, Copy)]
pub(super) struct Source<const N: usize> {
    alpha: Vector<N>,
    beta: Vector<N>,
    /// The last response that was wanted, and the depth x that it is for: equal parts of a flat layer have one.
    response: Response<N>,
    depth: f64,
}

impl<const N: usize> Default for Source<N> {
    fn default() -> Self {
        Self { alpha: [0.0; N], beta: [0.0; N], response: Response::default(), depth: f64::NAN }
    }
}

/// The eigenvalues and their functions of the layer's depth Δ = 2h.
#[derive(Clone, Copy, Debug)]
struct Modes<const N: usize> {
    /// (kΔ)².
    z: Vector<N>,
    /// kΔ coth kΔ.
    coth: Vector<N>,
    /// kΔ / sinh kΔ.
    csch: Vector<N>,
    /// 1 / cosh kh.
    sech_half: Vector<N>,
    /// kh / sinh kh.
    csch_half: Vector<N>,
    /// How many have a small kΔ.
    thin: usize,
}

/// Below this depth a layer that should scatter is taken as clear.
const THINNEST: f64 = 1e-13;

impl<const N: usize> Operator<N>
where
    Sizes: Eigen<N>,
{
    /// Of one part of a layer.
    #[inline(always)]
    pub fn new(order: &Order<N>, layer: &Scaled) -> Self {
        let Scaled { depth, cut, ref coupling } = *layer;
        let scatters = coupling.iter().skip(order.m).any(|c| c.abs() * depth.min(1.0) > THINNEST);
        if !scatters || depth < THINNEST {
            return Self::Clear(order.cosines.map(|mu| (-depth / mu).exp()));
        }
        let (mut a, mut b) = ([[0.0; N]; N], [[0.0; N]; N]);
        for (i, mu) in order.cosines.iter().enumerate() {
            (a[i][i], b[i][i]) = (1.0 / mu, 1.0 / mu);
        }
        for (l, (u, c)) in order.scaled.iter().zip(&coupling[order.m..]).enumerate() {
            if *c != 0.0 {
                let target = if l % 2 == 0 { &mut a } else { &mut b };
                for (row, ui) in target.iter_mut().zip(u) {
                    let cu = c * ui;
                    row.iter_mut().zip(u).for_each(|(x, uj)| *x -= cu * uj);
                }
            }
        }
        let l = cholesky(&b);
        let lt = transpose(&l);
        let (squares, u) = Sizes::eigen(&product(&lt, &product(&a, &l)));
        let f = product(&l, &u);
        let g = product(&transpose(&inverse_lower(&l)), &u);
        let modes = Modes::new(&squares, depth);
        let gt = transpose(&g);
        let even = function(&g, &gt, &modes.tanh_half(), depth);
        let odd = function(&g, &gt, &modes.coth_half(), depth);
        let (mut reflection, mut transmission) = ([[0.0; N]; N], [[0.0; N]; N]);
        for i in 0..N {
            for j in 0..N {
                reflection[i][j] = even[i][j] + odd[i][j];
                transmission[i][j] = even[i][j] - odd[i][j];
            }
            reflection[i][i] -= 1.0;
        }
        let factor = if order.m == 0 { -0.5 / PI } else { -1.0 / PI };
        let mut to = [[[0.0; N]; N]; 2];
        let mut of_modes = Vec::with_capacity(order.scaled.len()); // Fᵀ u_l or Gᵀ u_l
        for (k, (scaled, c)) in order.scaled.iter().zip(&coupling[order.m..]).enumerate() {
            let row = apply_transposed(if k % 2 == 0 { &f } else { &g }, scaled);
            let c = factor * c;
            to[k % 2][k / 2].iter_mut().zip(&row).for_each(|(to, p)| *to = c * p);
            of_modes.push(row);
        }
        let [to_alpha, to_beta] = to;
        Self::Scattering(Box::new(Slab {
            reflection,
            transmission,
            g,
            moments: Moments::new(&of_modes),
            to_alpha,
            to_beta,
            even: half_product(&gt, &even),
            odd: half_product(&gt, &odd),
            modes,
            depth,
            middles: cut.middles,
        }))
    }
}

/// ½ A B.
#[inline(always)]
fn half_product<const N: usize>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    let mut out = product(a, b);
    out.iter_mut().flatten().for_each(|x| *x *= 0.5);
    out
}

/// (1 + G [values/Δ] Gᵀ)⁻¹.
#[inline(always)]
fn function<const N: usize>(g: &Matrix<N>, gt: &Matrix<N>, values: &Vector<N>, depth: f64) -> Matrix<N> {
    let mut scaled = *gt;
    for (row, value) in scaled.iter_mut().zip(values) {
        let value = value / depth;
        row.iter_mut().for_each(|x| *x *= value);
    }
    let mut d = product(g, &scaled);
    (0..N).for_each(|i| d[i][i] += 1.0);
    inverse_definite(&d)
}

/// ξ and η in the middle of a layer.
pub(super) struct Inside<const N: usize, const B: usize> {
    xi: [Vector<N>; B],
    eta: [Vector<N>; B],
}

impl<const N: usize, const B: usize> Default for Inside<N, B> {
    fn default() -> Self {
        Self { xi: [[0.0; N]; B], eta: [[0.0; N]; B] }
    }
}

/// What y that a lone layer would have at its edges counts for, mode by mode: above and below.
pub(super) struct Worth<const N: usize> {
    top: Vector<N>,
    bottom: Vector<N>,
}

impl<const N: usize> Slab<N> {
    /// Of beams of these Λ_l, even and odd.
    #[inline(always)]
    pub fn sources<const B: usize>(&self, toward: &[[Vector<N>; 2]; B]) -> [Source<N>; B] {
        let (mut even, mut odd) = ([[0.0; N]; B], [[0.0; N]; B]);
        for b in 0..B {
            [even[b], odd[b]] = toward[b];
        }
        let (alpha, beta) = (apply_to_each(&self.to_alpha, &even), apply_to_each(&self.to_beta, &odd));
        let mut sources = [Source::default(); B];
        for b in 0..B {
            (sources[b].alpha, sources[b].beta) = (alpha[b], beta[b]);
        }
        sources
    }

    /// What beams leave in it that no other light enters, each by its source and its fall: what comes out upwards at the
    /// top and downwards at the bottom, and the modes inside where they are wanted.
    #[inline(always)]
    pub fn lit<const B: usize>(
        &self,
        sources: &mut [Source<N>; B],
        falls: &[&Fall; B],
        inside: &mut Inside<N, B>,
    ) -> [[Vector<N>; B]; 2] {
        // The light that has to enter so that none does: half of y above, minus half of it below.
        let (mut sum, mut difference) = ([[0.0; N]; B], [[0.0; N]; B]);
        for b in 0..B {
            let fall = falls[b];
            if sources[b].depth != fall.depth {
                (sources[b].depth, sources[b].response) = (fall.depth, self.modes.response(fall, self.middles));
            }
            let Source { alpha, beta, response, .. } = &sources[b];
            let (top, lambda) = (fall.top, fall.depth / self.depth);
            for j in 0..N {
                let source = top * (alpha[j] - lambda * beta[j]) * self.depth;
                let above = source * response.top[j] - top * beta[j];
                let below = source * response.bottom[j] - top * fall.whole * beta[j];
                (sum[b][j], difference[b][j]) = (above - below, above + below);
            }
            if self.middles {
                for j in 0..N {
                    let source = top * (alpha[j] - lambda * beta[j]) * self.depth;
                    // Of the response that is 0 in ξ at both edges.
                    inside.xi[b][j] = source * self.depth * response.middle[j];
                    inside.eta[b][j] = source * response.middle_slope[j] - top * fall.half * beta[j];
                }
            }
        }
        let (even, odd) = (apply_to_each(&self.even, &sum), apply_to_each(&self.odd, &difference));
        let (mut up, mut down) = ([[0.0; N]; B], [[0.0; N]; B]);
        for b in 0..B {
            for i in 0..N {
                (up[b][i], down[b][i]) = (even[b][i] + odd[b][i], even[b][i] - odd[b][i]);
            }
        }
        [up, down]
    }

    /// What the layer's own light counts for, where that upwards at its top counts `up` and that downwards below `down`.
    #[inline(always)]
    pub fn worth(&self, up: &Vector<N>, down: &Vector<N>) -> Worth<N> {
        let (mut top, mut bottom) = ([0.0; N], [0.0; N]);
        for j in 0..N {
            let (mut even, mut odd) = (0.0, 0.0);
            for i in 0..N {
                even += self.even[j][i] * (up[i] + down[i]);
                odd += self.odd[j][i] * (up[i] - down[i]);
            }
            (top[j], bottom[j]) = (even + odd, odd - even);
        }
        Worth { top, bottom }
    }

    /// That of a beam.
    #[inline(always)]
    pub fn lit_worth(&self, worth: &Worth<N>, source: &Source<N>, fall: &Fall) -> f64 {
        let Source { alpha, beta, .. } = source;
        let lambda = fall.depth / self.depth;
        let response = self.modes.response(fall, false);
        let mut sums = [0.0; N];
        for j in 0..N {
            let source = (alpha[j] - lambda * beta[j]) * self.depth;
            let above = source * response.top[j] - beta[j];
            let below = source * response.bottom[j] - fall.whole * beta[j];
            sums[j] = above * worth.top[j] + below * worth.bottom[j];
        }
        fall.top * sums.iter().sum::<f64>()
    }

    /// ξ and η in the middle of the layer, from Gᵀ x at its edges and what beams add.
    #[inline(always)]
    pub fn middle<const B: usize>(
        &self,
        above: &[Vector<N>; B],
        below: &[Vector<N>; B],
        inside: &Inside<N, B>,
    ) -> [[Vector<N>; B]; 2] {
        let Inside { mut xi, mut eta } = *inside;
        for b in 0..B {
            for j in 0..N {
                xi[b][j] += 0.5 * self.modes.sech_half[j] * (above[b][j] + below[b][j]);
                eta[b][j] += self.modes.csch_half[j] * (below[b][j] - above[b][j]) / self.depth;
            }
        }
        [xi, eta]
    }
}

/// How a beam falls over a layer: as e^(−x s), s = 0 … 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fall {
    /// Its transmittance above.
    top: f64,
    /// x.
    depth: f64,
    /// e^(−x) and e^(−x/2).
    whole: f64,
    half: f64,
}

impl Fall {
    /// From its transmittance above and below.
    pub fn new(top: f64, bottom: f64) -> Self {
        if top <= 1e-200 {
            return Self { top: 0.0, depth: 1.0, whole: 0.0, half: 0.0 };
        }
        // A beam that all but ends within the layer keeps a finite x.
        let whole = (bottom / top).max(1e-300);
        Self { top, depth: -whole.ln(), whole, half: whole.sqrt() }
    }

    /// As steep as another part's, where the two differ by rounding alone.
    pub fn as_steep_as(self, other: &Fall) -> Self {
        let alike = (self.depth - other.depth).abs() <= 1e-13;
        if alike { Self { top: self.top, ..*other } } else { self }
    }

    /// Whether there is a beam.
    pub fn is_lit(&self) -> bool {
        self.top > 0.0
    }
}

/// ξ of each mode with ξ = 0 at both edges under a source f e^(−xs), over f and powers of the depth: ξ′ at the edges, ξ and
/// ξ′ in the middle.
#[derive(Clone, Copy)]
struct Response<const N: usize> {
    top: Vector<N>,
    bottom: Vector<N>,
    middle: Vector<N>,
    middle_slope: Vector<N>,
}

impl<const N: usize> Default for Response<N> {
    fn default() -> Self {
        let nothing = [0.0; N];
        Self { top: nothing, bottom: nothing, middle: nothing, middle_slope: nothing }
    }
}

/// Where kΔ and x are smaller, their power series serve.
const THIN: (f64, f64) = (0.1, 0.1);
/// Where x² and (kΔ)² differ by a smaller share of either, the beam falls as the mode does.
const RESONANT: f64 = 2e-5;

/// 1/n!.
const INVERSE_FACTORIALS: [f64; 10] = {
    let mut values = [1.0; 10];
    let mut n = 1;
    while n < 10 {
        values[n] = values[n - 1] / n as f64;
        n += 1;
    }
    values
};

impl<const N: usize> Modes<N> {
    /// From k².
    fn new(squares: &Vector<N>, depth: f64) -> Self {
        let nothing = [0.0; N];
        let mut modes =
            Self { z: nothing, coth: nothing, csch: nothing, sech_half: nothing, csch_half: nothing, thin: 0 };
        for (j, square) in squares.iter().enumerate() {
            let k = square.max(0.0).sqrt() * depth;
            let z = k * k;
            let (e, half) = ((-k).exp(), (-0.5 * k).exp());
            let [coth, csch, sech_half, csch_half] = match k < 1e-3 {
                true => [
                    1.0 + z / 3.0 - z * z / 45.0,
                    1.0 - z / 6.0 + 7.0 * z * z / 360.0,
                    1.0 - z / 8.0 + 5.0 * z * z / 384.0,
                    1.0 - z / 24.0 + 7.0 * z * z / 5760.0,
                ],
                false => [
                    k * (1.0 + e * e) / (1.0 - e * e),
                    2.0 * k * e / (1.0 - e * e),
                    2.0 * half / (1.0 + e),
                    k * half / (1.0 - e),
                ],
            };
            modes.thin += usize::from(z < THIN.0 * THIN.0);
            (modes.z[j], modes.coth[j], modes.csch[j]) = (z, coth, csch);
            (modes.sech_half[j], modes.csch_half[j]) = (sech_half, csch_half);
        }
        modes
    }

    /// kΔ tanh kh.
    fn tanh_half(&self) -> Vector<N> {
        // tanh kh = coth kΔ − 1/sinh kΔ loses digits where both are large.
        self.z.map(|z| {
            let k = z.sqrt();
            if k < 1e-3 { 0.5 * z * (1.0 - z / 12.0) } else { k * (0.5 * k).tanh() }
        })
    }

    /// kΔ coth kh.
    fn coth_half(&self) -> Vector<N> {
        std::array::from_fn(|j| self.coth[j] + self.csch[j])
    }

    /// Responses to a source that falls as a beam does; in the middle where they are wanted.
    #[inline(always)]
    fn response(&self, fall: &Fall, middle: bool) -> Response<N> {
        let x = fall.depth;
        let thin = x.abs() < THIN.1 && self.thin > 0;
        if thin && self.thin == N {
            return self.series(fall, middle);
        }
        let mut response = self.closed(fall, middle);
        // Whether the beam falls as a mode does whose response is not taken by its series.
        let from = if thin { THIN.0 * THIN.0 } else { 0.0 };
        let resonant = |z: f64| ((x * x - z).abs() <= RESONANT * z) & (z >= from);
        let any_resonant = self.z.iter().fold(false, |any, z| any | resonant(*z));
        if thin {
            let series = self.series(fall, middle);
            for j in 0..N {
                let small = self.z[j] < from;
                response.top[j] = if small { series.top[j] } else { response.top[j] };
                response.bottom[j] = if small { series.bottom[j] } else { response.bottom[j] };
                response.middle[j] = if small { series.middle[j] } else { response.middle[j] };
                response.middle_slope[j] = if small { series.middle_slope[j] } else { response.middle_slope[j] };
            }
        }
        if any_resonant {
            for j in (0..N).filter(|j| resonant(self.z[*j])) {
                self.across(j, x, &mut response);
            }
        }
        response
    }

    #[inline(always)]
    fn closed(&self, fall: &Fall, middle: bool) -> Response<N> {
        let Fall { depth: x, whole, half, .. } = *fall;
        let mut response = Response::default();
        for j in 0..N {
            let per = 1.0 / (x * x - self.z[j]);
            response.top[j] = (self.coth[j] - x - whole * self.csch[j]) * per;
            response.bottom[j] = (self.csch[j] - whole * (self.coth[j] + x)) * per;
        }
        if !middle {
            return response;
        }
        for j in 0..N {
            let per = 1.0 / (x * x - self.z[j]);
            response.middle[j] = (half - 0.5 * (1.0 + whole) * self.sech_half[j]) * per;
            response.middle_slope[j] = ((1.0 - whole) * self.csch_half[j] - x * half) * per;
        }
        response
    }

    /// A straight line across the removable singularity of one mode.
    #[inline(never)]
    fn across(&self, j: usize, x: f64, response: &mut Response<N>) {
        let k = self.z[j].sqrt();
        let (low, high) = (k * (1.0 - 3e-5), k * (1.0 + 3e-5));
        let [a, b] = [low, high]
            .map(|x| self.closed(&Fall { top: 1.0, depth: x, whole: (-x).exp(), half: (-0.5 * x).exp() }, true));
        let t = (x - low) / (high - low);
        let mid = |a: f64, b: f64| a + (b - a) * t;
        response.top[j] = mid(a.top[j], b.top[j]);
        response.bottom[j] = mid(a.bottom[j], b.bottom[j]);
        response.middle[j] = mid(a.middle[j], b.middle[j]);
        response.middle_slope[j] = mid(a.middle_slope[j], b.middle_slope[j]);
    }

    /// Thin layers: the same as divided differences, by their power series.
    #[inline(always)]
    fn series(&self, fall: &Fall, middle: bool) -> Response<N> {
        let Fall { depth: x, whole, half, .. } = *fall;
        // Σ_n (∓1)ⁿ/n! h_{n−2}(x, k, −k), h the complete homogeneous polynomials.
        let (mut forth, mut back, mut h, mut power) = ([0.0; N], [0.0; N], [0.0; N], [1.0; N]);
        for n in (2..10).step_by(2) {
            let (even, odd) = (INVERSE_FACTORIALS[n], INVERSE_FACTORIALS[n + 1]);
            for j in 0..N {
                h[j] = x * h[j] + power[j];
                let term = h[j] * even;
                (forth[j], back[j]) = (forth[j] + term, back[j] + term);
                power[j] *= self.z[j];
                h[j] *= x;
                let term = h[j] * odd;
                (forth[j], back[j]) = (forth[j] - term, back[j] + term);
            }
        }
        let mut response = Response { top: forth, bottom: back, ..Response::default() };
        for j in 0..N {
            response.top[j] *= -self.csch[j];
            response.bottom[j] *= whole * self.csch[j];
        }
        if !middle {
            return response;
        }
        // Σ_n 1/(2n)! Σ yⁱ qʲ, i + j = n − 1, and with 1/(2n + 1)!.
        let y = 0.25 * x * x;
        let (mut cosh, mut sinh, mut sum, mut power) = ([0.0; N], [0.0; N], [1.0; N], [1.0; N]);
        for n in 1..4 {
            let (even, odd) = (INVERSE_FACTORIALS[2 * n], INVERSE_FACTORIALS[2 * n + 1]);
            for j in 0..N {
                cosh[j] += sum[j] * even;
                sinh[j] += sum[j] * odd;
                power[j] *= 0.25 * self.z[j];
                sum[j] = y * sum[j] + power[j];
            }
        }
        for j in 0..N {
            response.middle[j] = cosh[j] * -0.25 * half * self.sech_half[j];
            response.middle_slope[j] = sinh[j] * 0.25 * half * x * self.csch_half[j];
        }
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ξ″ = k² ξ + e^(−x s) with ξ = 0 at both edges, by two thousand steps of a Numerov sweep.
    fn by_steps(k: f64, x: f64) -> [f64; 4] {
        let n = 4000usize;
        let h = 1.0 / n as f64;
        let source: Vec<f64> = (0..=n).map(|i| (-x * i as f64 * h).exp()).collect();
        // Numerov: (1 − k²h²/12)(ξ₊ + ξ₋) − (2 + 10 k²h²/12) ξ = h²/12 (s₊ + 10 s + s₋)
        let (off, diagonal) = (1.0 - k * k * h * h / 12.0, -(2.0 + 10.0 * k * k * h * h / 12.0));
        let (mut c, mut d) = (vec![0.0; n + 1], vec![0.0; n + 1]);
        for i in 1..n {
            let right = h * h / 12.0 * (source[i - 1] + 10.0 * source[i] + source[i + 1]);
            let pivot = diagonal - off * c[i - 1];
            c[i] = off / pivot;
            d[i] = (right - off * d[i - 1]) / pivot;
        }
        let mut xi = vec![0.0; n + 1];
        for i in (1..n).rev() {
            xi[i] = d[i] - c[i] * xi[i + 1];
        }
        let slope = |i: usize, s: f64| {
            let v = |j: usize| xi[(i as f64 + s * j as f64) as usize];
            s * (-25.0 / 12.0 * v(0) + 4.0 * v(1) - 3.0 * v(2) + 4.0 / 3.0 * v(3) - 0.25 * v(4)) / h
        };
        let m = n / 2;
        let middle = (xi[m - 2] - 8.0 * xi[m - 1] + 8.0 * xi[m + 1] - xi[m + 2]) / (12.0 * h);
        [slope(0, 1.0), slope(n, -1.0), xi[m], middle]
    }

    #[test]
    fn the_response_of_a_mode_solves_its_equation_thin_thick_and_at_resonance() {
        for (k, x) in [
            (0.0, 0.0),
            (0.0, 0.3),
            (0.3, 0.2),
            (0.49, -0.4),
            (0.7, 0.7),
            (2.0, 2.0),
            (2.0, 2.00001),
            (0.0, 3.0),
            (6.0, 1.0),
            (1.0, 6.0),
            (3.0, -1.0),
        ] {
            // Beside a mode of another kind.
            let modes = Modes::new(&[k * k, 1.3 * k * k + 0.1], 1.0);
            let r = modes.response(&Fall { top: 1.0, depth: x, whole: (-x).exp(), half: (-0.5 * x).exp() }, true);
            for (found, due) in
                [r.top, r.bottom, r.middle, r.middle_slope].map(|r| r[0]).into_iter().zip(by_steps(k, x))
            {
                assert!((found - due).abs() < 2e-9, "k {k}, x {x}: {found} {due}");
            }
        }
    }
}
