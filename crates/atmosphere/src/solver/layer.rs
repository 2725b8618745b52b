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

use super::matrix::{
    Eigen, Matrix, Sizes, Vector, apply_transposed, cholesky, inverse_definite, inverse_lower, product, transpose,
};
use super::quadrature::Order;

/// A layer at one order.
pub(super) enum Operator<const N: usize> {
    /// It does not scatter at this order: e^(−Δ/μ).
    Clear(Vector<N>),
    /// It does.
    Scattering(Box<Slab<N>>),
}

/// Operators of a layer that scatters.
pub(super) struct Slab<const N: usize> {
    /// (1 + D_s)⁻¹.
    even: Matrix<N>,
    /// (1 + D_a)⁻¹.
    odd: Matrix<N>,
    pub reflection: Matrix<N>,
    pub transmission: Matrix<N>,
    f: Matrix<N>,
    g: Matrix<N>,
    /// Fᵀ and Gᵀ.
    ft: Matrix<N>,
    gt: Matrix<N>,
    modes: [Mode; N],
    depth: f64,
}

/// One eigenvalue and its functions of the layer's depth Δ = 2h.
#[derive(Clone, Copy, Debug, Default)]
struct Mode {
    /// (kΔ)².
    z: f64,
    /// kΔ coth kΔ.
    coth: f64,
    /// kΔ / sinh kΔ.
    csch: f64,
    /// 1 / cosh kh.
    sech_half: f64,
    /// kh / sinh kh.
    csch_half: f64,
}

/// Below this depth a layer that should scatter is taken as clear.
const THINNEST: f64 = 1e-13;

impl<const N: usize> Operator<N>
where
    Sizes: Eigen<N>,
{
    /// From c_l, l = 0, 1, …, and the depth Δ.
    pub fn new(order: &Order<N>, coupling: &[f64], depth: f64) -> Self {
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
        let modes = squares.map(|k2| Mode::new(k2.max(0.0).sqrt() * depth));
        let gt = transpose(&g);
        let function = |of: fn(&Mode) -> f64| {
            let mut scaled = gt;
            for (row, mode) in scaled.iter_mut().zip(&modes) {
                let value = of(mode) / depth;
                row.iter_mut().for_each(|x| *x *= value);
            }
            let mut d = product(&g, &scaled);
            (0..N).for_each(|i| d[i][i] += 1.0);
            inverse_definite(&d)
        };
        let even = function(Mode::tanh_half);
        let odd = function(Mode::coth_half);
        let (mut reflection, mut transmission) = ([[0.0; N]; N], [[0.0; N]; N]);
        for i in 0..N {
            for j in 0..N {
                reflection[i][j] = even[i][j] + odd[i][j];
                transmission[i][j] = even[i][j] - odd[i][j];
            }
            reflection[i][i] -= 1.0;
        }
        Self::Scattering(Box::new(Slab {
            even,
            odd,
            reflection,
            transmission,
            ft: transpose(&f),
            f,
            g,
            gt,
            modes,
            depth,
        }))
    }
}

/// What a beam leaves in a layer that no other light enters: what comes out above and below, and the modes inside.
pub(super) struct Lit<const N: usize> {
    /// Upwards at the top.
    pub up: Vector<N>,
    /// Downwards at the bottom.
    pub down: Vector<N>,
    /// ξ and η in the middle of the layer, of the response that is 0 in ξ at both edges.
    xi: Vector<N>,
    eta: Vector<N>,
}

impl<const N: usize> Slab<N> {
    /// The sources of a beam of transmittance `top` at the upper edge and `bottom` at the lower: `a` and `b` are those of a
    /// beam of transmittance 1.
    pub fn lit(&self, a: &Vector<N>, b: &Vector<N>, top: f64, bottom: f64) -> Lit<N> {
        let alpha = apply_transposed(&self.f, a);
        let beta = apply_transposed(&self.g, b);
        // e^(−λ s) between the edges; a beam that all but ends within the layer keeps a finite λ.
        let fall = (bottom / top).max(1e-300);
        let x = -fall.ln();
        let lambda = x / self.depth;
        let half = fall.sqrt();
        let (mut top_flux, mut bottom_flux, mut xi, mut eta) = ([0.0; N], [0.0; N], [0.0; N], [0.0; N]);
        for j in 0..N {
            let source = top * (alpha[j] - lambda * beta[j]);
            let response = self.modes[j].response(x, fall, half);
            top_flux[j] = source * self.depth * response.top - top * beta[j];
            bottom_flux[j] = source * self.depth * response.bottom - top * fall * beta[j];
            xi[j] = source * self.depth * self.depth * response.middle;
            eta[j] = source * self.depth * response.middle_slope - top * half * beta[j];
        }
        let (above, below) = (apply_transposed(&self.gt, &top_flux), apply_transposed(&self.gt, &bottom_flux));
        // The light that has to enter so that none does: half of y above, minus half of it below.
        let (mut sum, mut difference) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            sum[i] = 0.5 * (above[i] - below[i]);
            difference[i] = 0.5 * (above[i] + below[i]);
        }
        let (even, odd) = (apply_transposed(&self.even, &sum), apply_transposed(&self.odd, &difference));
        let (mut up, mut down) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            up[i] = even[i] + odd[i];
            down[i] = even[i] - odd[i];
        }
        Lit { up, down, xi, eta }
    }

    /// x and y in the middle of the layer, from x at its edges and what a beam adds.
    pub fn middle(&self, above: &Vector<N>, below: &Vector<N>, lit: Option<&Lit<N>>) -> (Vector<N>, Vector<N>) {
        let (above, below) = (apply_transposed(&self.g, above), apply_transposed(&self.g, below));
        let (mut xi, mut eta) = lit.map_or(([0.0; N], [0.0; N]), |lit| (lit.xi, lit.eta));
        for (j, mode) in self.modes.iter().enumerate() {
            xi[j] += 0.5 * mode.sech_half * (above[j] + below[j]);
            eta[j] += mode.csch_half * (below[j] - above[j]) / self.depth;
        }
        (apply_transposed(&self.ft, &xi), apply_transposed(&self.gt, &eta))
    }
}

/// ξ of one mode with ξ = 0 at both edges under a source f e^(−λs), over f and powers of the depth: ξ′ at the edges, ξ and
/// ξ′ in the middle.
struct Response {
    top: f64,
    bottom: f64,
    middle: f64,
    middle_slope: f64,
}

impl Mode {
    /// From kΔ.
    fn new(k: f64) -> Self {
        let z = k * k;
        if k < 1e-3 {
            return Self {
                z,
                coth: 1.0 + z / 3.0 - z * z / 45.0,
                csch: 1.0 - z / 6.0 + 7.0 * z * z / 360.0,
                sech_half: 1.0 - z / 8.0 + 5.0 * z * z / 384.0,
                csch_half: 1.0 - z / 24.0 + 7.0 * z * z / 5760.0,
            };
        }
        let (e, half) = ((-k).exp(), (-0.5 * k).exp());
        Self {
            z,
            coth: k * (1.0 + e * e) / (1.0 - e * e),
            csch: 2.0 * k * e / (1.0 - e * e),
            sech_half: 2.0 * half / (1.0 + e),
            csch_half: k * half / (1.0 - e),
        }
    }

    /// kΔ tanh kh.
    fn tanh_half(&self) -> f64 {
        // tanh kh = coth kΔ − 1/sinh kΔ loses digits where both are large.
        let k = self.z.sqrt();
        if k < 1e-3 { 0.5 * self.z * (1.0 - self.z / 12.0) } else { k * (0.5 * k).tanh() }
    }

    /// kΔ coth kh.
    fn coth_half(&self) -> f64 {
        self.coth + self.csch
    }

    /// Response to a source that falls as e^(−x) over the layer; `fall` = e^(−x), `half` = e^(−x/2).
    fn response(&self, x: f64, fall: f64, half: f64) -> Response {
        let z = self.z;
        if z < 0.25 && x.abs() < 0.5 {
            return self.series(x, fall, half);
        }
        let gap = x * x - z;
        if gap.abs() > 2e-5 * z {
            return self.closed(x, fall, half);
        }
        // The beam falls as the mode does: a straight line across the removable singularity.
        let k = z.sqrt();
        let (low, high) = (k * (1.0 - 3e-5), k * (1.0 + 3e-5));
        let [a, b] = [low, high].map(|x| self.closed(x, (-x).exp(), (-0.5 * x).exp()));
        let t = (x - low) / (high - low);
        let mid = |a: f64, b: f64| a + (b - a) * t;
        Response {
            top: mid(a.top, b.top),
            bottom: mid(a.bottom, b.bottom),
            middle: mid(a.middle, b.middle),
            middle_slope: mid(a.middle_slope, b.middle_slope),
        }
    }

    fn closed(&self, x: f64, fall: f64, half: f64) -> Response {
        let per = 1.0 / (x * x - self.z);
        Response {
            top: (self.coth - x - fall * self.csch) * per,
            bottom: (self.csch - fall * (self.coth + x)) * per,
            middle: (half - 0.5 * (1.0 + fall) * self.sech_half) * per,
            middle_slope: ((1.0 - fall) * self.csch_half - x * half) * per,
        }
    }

    /// Thin layers: the same as divided differences, by their power series.
    fn series(&self, x: f64, fall: f64, half: f64) -> Response {
        let z = self.z;
        // Σ_n (∓1)ⁿ/n! h_{n−2}(x, k, −k), h the complete homogeneous polynomials.
        let (mut forth, mut back) = (0.0, 0.0);
        let (mut h, mut even, mut factorial) = (0.0, 1.0, 1.0);
        for n in 2..16 {
            h = x * h + if n % 2 == 0 { even } else { 0.0 };
            if n % 2 == 0 {
                even *= z;
            }
            factorial *= f64::from(n);
            let term = h / factorial;
            forth += if n % 2 == 0 { term } else { -term };
            back += term;
        }
        let (y, q) = (0.25 * x * x, 0.25 * z);
        let (mut cosh, mut sinh) = (0.0, 0.0);
        let (mut sum, mut power, mut factorial) = (1.0, 1.0, 1.0);
        for n in 1..8 {
            let n = f64::from(n);
            factorial *= (2.0 * n - 1.0) * 2.0 * n;
            cosh += sum / factorial;
            sinh += sum / (factorial * (2.0 * n + 1.0));
            power *= q;
            sum = y * sum + power;
        }
        Response {
            top: -self.csch * forth,
            bottom: fall * self.csch * back,
            middle: -0.25 * half * self.sech_half * cosh,
            middle_slope: 0.25 * half * x * self.csch_half * sinh,
        }
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
            let r = Mode::new(k).response(x, (-x).exp(), (-0.5 * x).exp());
            for (found, due) in [r.top, r.bottom, r.middle, r.middle_slope].into_iter().zip(by_steps(k, x)) {
                assert!((found - due).abs() < 2e-9, "k {k}, x {x}: {found} {due}");
            }
        }
    }
}
