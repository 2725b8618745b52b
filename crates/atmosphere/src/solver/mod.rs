//! Multiple scattering in a stack of homogeneous layers, plane-parallel, by the discrete-ordinate method with the layers
//! joined by adding.
//!
//! Each layer answers by its reflection r and transmission t, found from eigenvectors (`layer.rs`). From the ground up,
//!
//! ```text
//! R′ = r + t Z t,   Z = R (1 − r R)⁻¹            reflection of all that lies below [Grant1969; Plass1973]
//! S′ = s⁺ + t (S + Z g),   g = r S + s⁻           its emission, one vector a beam
//! ```
//!
//! and from the top down I⁻′ = M (t I⁻ + g), M = (1 − r R)⁻¹, I⁺ = R I⁻ + S. R, Z and M serve every beam, so that many suns
//! cost little more than one. The answer is the field's moments
//!
//! ```text
//! c_l^m(τ) = ½ ∫ Λ_l^m(μ) I^m(τ, μ) dμ           J^m(τ, μ) = Σ_l ω(2l+1)χ_l Λ_l^m(μ) c_l^m(τ)
//! ```
//!
//! from which the scattering source J has any direction, by the same sum that the quadrature itself uses. Orders m are added
//! until two in a row change J by less than a stated share anywhere.

mod layer;
mod legendre;
mod matrix;
mod quadrature;

use std::f64::consts::PI;

use layer::{Lit, Operator};
pub(crate) use legendre::normalised;
use matrix::{Eigen, Matrix, Sizes, Vector, apply_transposed, inverse, product, transpose};
use quadrature::{Order, Quadrature};

/// A layer as the solver takes it, delta-scaled.
#[derive(Clone, Debug)]
pub(crate) struct Scaled {
    /// Optical depth of one part.
    pub depth: f64,
    /// Equal parts that the layer is cut in.
    pub parts: usize,
    /// ω(2l+1)χ_l, l = 0 … one less than the streams.
    pub coupling: Vec<f64>,
}

/// A beam of unit irradiance at normal incidence above the stack.
#[derive(Clone, Debug)]
pub(crate) struct Beam {
    /// Cosine of the zenith angle of where it comes from; may be 0 or less where the Earth is round.
    pub cosine: f64,
    /// Its transmittance down to each edge of the parts, from the top down.
    pub transmittance: Vec<f64>,
}

/// The field under one beam, or over a ground that shines.
#[derive(Clone, Debug, Default)]
pub(crate) struct Field {
    /// c_l^m by order m, at the edges and middles of the parts from the top down: a row of `streams − m` values each.
    pub orders: Vec<Vec<f64>>,
    /// Diffuse irradiance on a level surface from above, at the same places; its beam is the scaled one.
    pub down: Vec<f64>,
    /// From below.
    pub up: Vec<f64>,
    /// The part that these begin with.
    pub first: usize,
}

impl Field {
    /// The sum of shares of fields, from a part down.
    pub fn mixed(fields: &[Field], shares: &[f64], first: usize) -> Self {
        let mut out = Self { first, ..Self::default() };
        for (field, share) in fields.iter().zip(shares) {
            let levels = field.down.len();
            let dropped = 2 * (first - field.first);
            for (m, rows) in field.orders.iter().enumerate() {
                let rows = &rows[dropped * rows.len() / levels..];
                if out.orders.len() <= m {
                    out.orders.push(vec![0.0; rows.len()]);
                }
                out.orders[m].iter_mut().zip(rows).for_each(|(sum, c)| *sum += share * c);
            }
            for (sum, flux) in [(&mut out.down, &field.down), (&mut out.up, &field.up)] {
                sum.resize(levels - dropped, 0.0);
                sum.iter_mut().zip(&flux[dropped..]).for_each(|(sum, flux)| *sum += share * flux);
            }
        }
        out
    }
}

/// The answer for one stack.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    /// One a beam, over a black ground.
    pub beams: Vec<Field>,
    /// Of a ground that shines with radiance 1, without any beam.
    pub ground: Field,
}

/// The numbers of streams that the solver knows.
pub(crate) const STREAMS: [usize; 5] = [4, 8, 16, 32, 64];

/// Solves a stack with one of [`STREAMS`]; with `fluxes_only` the order m = 0 alone.
pub(crate) fn solve(streams: usize, layers: &[Scaled], beams: &[Beam], fluxes_only: bool, accuracy: f64) -> Solution {
    match streams {
        4 => stack::<2>(layers, beams, fluxes_only, accuracy),
        8 => stack::<4>(layers, beams, fluxes_only, accuracy),
        16 => stack::<8>(layers, beams, fluxes_only, accuracy),
        32 => stack::<16>(layers, beams, fluxes_only, accuracy),
        _ => stack::<32>(layers, beams, fluxes_only, accuracy),
    }
}

fn stack<const N: usize>(layers: &[Scaled], beams: &[Beam], fluxes_only: bool, accuracy: f64) -> Solution
where
    Sizes: Eigen<N>,
{
    let quadrature = Quadrature::<N>::new();
    let mut solution = Solution { beams: vec![Field::default(); beams.len()], ground: Field::default() };
    // Each beam has its own end, whatever beams stand beside it.
    let mut open: Vec<Open> = beams.iter().map(|_| Open::default()).collect();
    for m in 0..if fluxes_only { 1 } else { 2 * N } {
        if m > 0 && open.iter().all(|beam| beam.done) {
            break;
        }
        let order = Order::new(m, &quadrature);
        one_order(&order, &quadrature, layers, beams, &mut solution, &mut open, accuracy);
    }
    solution
}

/// Whether a beam still wants orders.
#[derive(Clone, Copy, Debug, Default)]
struct Open {
    done: bool,
    /// The size of J at m = 0.
    scale: f64,
    /// Orders in a row that changed little.
    small: usize,
}

/// What the downward sweep keeps of a part.
struct Joined<const N: usize> {
    /// Index of the layer.
    layer: usize,
    /// R below it.
    below: Matrix<N>,
    /// (1 − r R)⁻¹, transposed, and Z; nothing where the layer is clear.
    inner: Option<(Matrix<N>, Matrix<N>)>,
}

/// Adds the order m to the fields of the beams that still want it.
fn one_order<const N: usize>(
    order: &Order<N>,
    quadrature: &Quadrature<N>,
    layers: &[Scaled],
    beams: &[Beam],
    solution: &mut Solution,
    open: &mut [Open],
    accuracy: f64,
) where
    Sizes: Eigen<N>,
{
    let operators: Vec<Operator<N>> =
        layers.iter().map(|layer| Operator::new(order, &layer.coupling, layer.depth)).collect();
    let parts: usize = layers.iter().map(|layer| layer.parts).sum();
    let mut joined: Vec<Joined<N>> = Vec::with_capacity(parts);
    let mut below = [[0.0; N]; N];
    let mut dark = true; // nothing scatters below
    for (i, layer) in layers.iter().enumerate().rev() {
        for _ in 0..layer.parts {
            match &operators[i] {
                Operator::Clear(t) => {
                    joined.push(Joined { layer: i, below, inner: None });
                    for (row, ti) in below.iter_mut().zip(t) {
                        row.iter_mut().zip(t).for_each(|(x, tj)| *x *= ti * tj);
                    }
                }
                Operator::Scattering(slab) if dark => {
                    let mut one = [[0.0; N]; N];
                    (0..N).for_each(|k| one[k][k] = 1.0);
                    joined.push(Joined { layer: i, below, inner: Some((one, below)) });
                    below = slab.reflection;
                    dark = false;
                }
                Operator::Scattering(slab) => {
                    let mut m = product(&slab.reflection, &below);
                    for (k, row) in m.iter_mut().enumerate() {
                        row.iter_mut().for_each(|x| *x = -*x);
                        row[k] += 1.0;
                    }
                    let m = inverse(&m);
                    let z = product(&below, &m);
                    let mut above = product(&product(&slab.transmission, &z), &slab.transmission);
                    for (row, r) in above.iter_mut().zip(&slab.reflection) {
                        row.iter_mut().zip(r).for_each(|(x, r)| *x += r);
                    }
                    joined.push(Joined { layer: i, below, inner: Some((transpose(&m), z)) });
                    below = above;
                }
            }
        }
    }
    joined.reverse(); // from the top down
    let stack = Stack { order, quadrature, layers, operators: &operators, joined: &joined, top: below };
    if order.m == 0 {
        let mut ground = [0.0; N];
        (0..N).for_each(|i| ground[i] = (quadrature.weights[i] * quadrature.cosines[i]).sqrt());
        stack.add(None, &ground, &mut solution.ground);
    }
    for ((beam, field), open) in beams.iter().zip(&mut solution.beams).zip(open).filter(|(_, open)| !open.done) {
        if dark && order.m > 0 {
            open.done = true;
            continue;
        }
        stack.add(Some(beam), &[0.0; N], field);
        let size = size(order.m, layers, field);
        if order.m == 0 {
            open.scale = size;
        } else {
            open.small = if size <= accuracy * open.scale { open.small + 1 } else { 0 };
            open.done = open.small == 2;
        }
    }
}

/// How large J is in the moments of order m: the most of any layer.
fn size(m: usize, layers: &[Scaled], field: &Field) -> f64 {
    let rows = &field.orders[m];
    let width = rows.len() / field.down.len();
    let (mut k, mut most) = (0, 0.0f64);
    for layer in layers {
        let row = &rows[(k + 1) * width..(k + 2) * width];
        let sum: f64 = row.iter().zip(&layer.coupling[m..]).map(|(c, coupling)| (c * coupling).abs()).sum();
        most = most.max(sum * layer.depth.min(1.0));
        k += 2 * layer.parts;
    }
    most
}

struct Stack<'a, const N: usize> {
    order: &'a Order<N>,
    quadrature: &'a Quadrature<N>,
    layers: &'a [Scaled],
    operators: &'a [Operator<N>],
    joined: &'a [Joined<N>],
    /// R of the whole.
    top: Matrix<N>,
}

impl<const N: usize> Stack<'_, N>
where
    Sizes: Eigen<N>,
{
    /// Solves for one beam, or for light `from_ground` alone, and appends the order's moments (and at m = 0 the fluxes).
    fn add(&self, beam: Option<&Beam>, from_ground: &Vector<N>, field: &mut Field) {
        let n = self.joined.len();
        let sources = beam.map(|beam| self.sources(beam));
        // Upwards: S above each part, and g of it.
        let mut emission = *from_ground;
        let mut lit: Vec<Option<Lit<N>>> = Vec::with_capacity(n);
        let mut climbing: Vec<(Vector<N>, Vector<N>)> = Vec::with_capacity(n); // S below the part, g
        for (i, part) in self.joined.iter().enumerate().rev() {
            let own = match (&self.operators[part.layer], beam, &sources) {
                (Operator::Scattering(slab), Some(beam), Some(sources)) => {
                    let (top, bottom) = (beam.transmittance[i], beam.transmittance[i + 1]);
                    let (a, b) = &sources[part.layer];
                    (top > 1e-200).then(|| slab.lit(a, b, top, bottom))
                }
                _ => None,
            };
            let below = emission;
            let mut g = [0.0; N];
            match (&self.operators[part.layer], &part.inner) {
                (Operator::Scattering(slab), Some((_, z))) => {
                    g = apply_transposed(&slab.reflection, &below);
                    if let Some(lit) = &own {
                        g.iter_mut().zip(lit.down).for_each(|(g, s)| *g += s);
                    }
                    let mut inside = apply_transposed(z, &g);
                    inside.iter_mut().zip(below).for_each(|(x, s)| *x += s);
                    emission = apply_transposed(&slab.transmission, &inside);
                    if let Some(lit) = &own {
                        emission.iter_mut().zip(lit.up).for_each(|(e, s)| *e += s);
                    }
                }
                (Operator::Clear(t), _) => emission.iter_mut().zip(t).for_each(|(e, t)| *e *= t),
                (Operator::Scattering(_), None) => unreachable!("a part that scatters has been joined"),
            }
            climbing.push((below, g));
            lit.push(own);
        }
        climbing.reverse();
        lit.reverse();

        // Downwards.
        let streams = 2 * N - self.order.m;
        let mut moments = Vec::with_capacity((2 * n + 1) * streams);
        let mut down = [0.0; N];
        let mut up = emission;
        up.iter_mut().zip(apply_transposed(&self.top, &down)).for_each(|(u, r)| *u += r);
        let (mut x, mut y) = both(&up, &down);
        self.record(&x, &y, &mut moments, field);
        for (i, part) in self.joined.iter().enumerate() {
            let above = x;
            match (&self.operators[part.layer], &part.inner) {
                (Operator::Scattering(slab), Some((m, _))) => {
                    let mut enters = apply_transposed(&slab.transmission, &down);
                    enters.iter_mut().zip(climbing[i].1).for_each(|(e, g)| *e += g);
                    down = apply_transposed(m, &enters);
                    up = apply_transposed(&part.below, &down);
                    up.iter_mut().zip(climbing[i].0).for_each(|(u, s)| *u += s);
                    (x, y) = both(&up, &down);
                    let (x_mid, y_mid) = slab.middle(&above, &x, lit[i].as_ref());
                    self.record(&x_mid, &y_mid, &mut moments, field);
                }
                (Operator::Clear(t), _) => {
                    let half: Vector<N> = t.map(f64::sqrt);
                    let mut below = apply_transposed(&part.below, &std::array::from_fn(|k| down[k] * t[k]));
                    below.iter_mut().zip(climbing[i].0).for_each(|(u, s)| *u += s);
                    let (x_mid, y_mid) =
                        both(&std::array::from_fn(|k| below[k] * half[k]), &std::array::from_fn(|k| down[k] * half[k]));
                    self.record(&x_mid, &y_mid, &mut moments, field);
                    down.iter_mut().zip(t).for_each(|(d, t)| *d *= t);
                    up = below;
                    (x, y) = both(&up, &down);
                }
                (Operator::Scattering(_), None) => unreachable!("a part that scatters has been joined"),
            }
            self.record(&x, &y, &mut moments, field);
        }
        field.orders.push(moments);
    }

    /// a and b of each layer under a beam of transmittance 1.
    fn sources(&self, beam: &Beam) -> Vec<(Vector<N>, Vector<N>)> {
        let m = self.order.m;
        let mut toward = vec![0.0; 2 * N - m];
        normalised(m, -beam.cosine, &mut toward);
        let factor = if m == 0 { -0.5 / PI } else { -1.0 / PI };
        (self.layers.iter())
            .map(|layer| {
                let (mut a, mut b) = ([0.0; N], [0.0; N]);
                for (l, (u, toward)) in self.order.scaled.iter().zip(&toward).enumerate() {
                    let c = factor * layer.coupling[m + l] * toward;
                    let target = if l % 2 == 0 { &mut a } else { &mut b };
                    target.iter_mut().zip(u).for_each(|(x, u)| *x += c * u);
                }
                (a, b)
            })
            .collect()
    }

    /// Appends c_l = ½ u_l · (x or y), and at m = 0 the fluxes 2π Σ w μ I.
    fn record(&self, x: &Vector<N>, y: &Vector<N>, moments: &mut Vec<f64>, field: &mut Field) {
        for (l, u) in self.order.scaled.iter().enumerate() {
            moments.push(0.5 * dot(u, if l % 2 == 0 { x } else { y }));
        }
        if self.order.m == 0 {
            let (mut up, mut down) = (0.0, 0.0);
            for i in 0..N {
                let root = (self.quadrature.weights[i] * self.quadrature.cosines[i]).sqrt();
                up += root * 0.5 * (x[i] + y[i]);
                down += root * 0.5 * (x[i] - y[i]);
            }
            field.up.push(2.0 * PI * up);
            field.down.push(2.0 * PI * down);
        }
    }
}

/// Σ a b, in sums side by side.
fn dot<const N: usize>(a: &Vector<N>, b: &Vector<N>) -> f64 {
    let mut sums = [0.0; 2];
    for (a, b) in a.chunks_exact(2).zip(b.chunks_exact(2)) {
        sums[0] += a[0] * b[0];
        sums[1] += a[1] * b[1];
    }
    sums[0] + sums[1]
}

fn both<const N: usize>(up: &Vector<N>, down: &Vector<N>) -> (Vector<N>, Vector<N>) {
    (std::array::from_fn(|i| up[i] + down[i]), std::array::from_fn(|i| up[i] - down[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(omega: f64, g: f64, depth: f64, parts: usize, streams: usize) -> Scaled {
        let f = g.powi(streams as i32);
        let coupling = (0..streams)
            .map(|l| {
                omega * (1.0 - f) / (1.0 - omega * f) * (2.0 * l as f64 + 1.0) * (g.powi(l as i32) - f) / (1.0 - f)
            })
            .collect();
        Scaled { depth: (1.0 - omega * f) * depth / parts as f64, parts, coupling }
    }

    fn beam(mu: f64, layers: &[Scaled]) -> Beam {
        let mut transmittance = vec![1.0];
        let mut depth = 0.0;
        for layer in layers {
            for _ in 0..layer.parts {
                depth += layer.depth;
                transmittance.push((-depth / mu).exp());
            }
        }
        Beam { cosine: mu, transmittance }
    }

    /// ω = 1: what enters leaves, μ₀ = F↑(top) + F↓(bottom) + μ₀ T, for three layers of three kinds.
    #[test]
    fn energy_is_conserved_where_nothing_absorbs() {
        for streams in STREAMS {
            let layers = [
                layer(1.0, 0.0, 0.1, 1, streams),
                layer(1.0, 0.75, 2.0, 3, streams),
                layer(1.0, -0.3, 30.0, 1, streams),
            ];
            for mu in [1.0, 0.5, 0.05] {
                let solution = solve(streams, &layers, &[beam(mu, &layers)], true, 1e-6);
                let field = &solution.beams[0];
                let (top, bottom) = (field.up[0], field.down[field.down.len() - 1]);
                let direct = mu * beam(mu, &layers).transmittance[5];
                assert!(((top + bottom + direct) / mu - 1.0).abs() < 1e-9, "{streams} {mu}: {}", top + bottom + direct);
                let ground = &solution.ground;
                assert!(((ground.up[0] + ground.down[ground.down.len() - 1]) / PI - 1.0).abs() < 1e-9);
            }
        }
    }
}
