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
//! until what is left of J, by the fall of the last, is less than a stated share of its order 0. What the quadrature misses near
//! the horizon of thin air is added to the moments (`grazing.rs`).
//!
//! Where only the irradiance at the ground is wanted, the adjoint is solved: what light counts for there that leaves a layer
//! upwards or downwards. A beam is then one sum over the layers.

use std::f64::consts::PI;

mod grazing;
mod layer;
mod legendre;
mod matrix;
mod quadrature;

use grazing::Grazing;
use layer::{Lit, Operator, Slab, Source};
pub(crate) use legendre::normalised;
use matrix::{Eigen, Matrix, Sizes, Vector, apply_transposed, dot, inverse, product, transpose};
use quadrature::{Order, Quadrature};

use crate::wide::wide_too;

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
    /// c_l^m, order after order, at the edges and middles of the parts from the top down: a row of `streams − m` values each.
    moments: Vec<f64>,
    /// Where the orders end in these.
    ends: Vec<usize>,
    /// Edges and middles.
    pub levels: usize,
    /// The part that these begin with.
    pub first: usize,
    /// Diffuse irradiance on a level surface, upwards above the stack.
    pub leaves: f64,
    /// Downwards below it; the beam beside it is the scaled one.
    pub arrives: f64,
}

impl Field {
    /// The number of orders.
    pub fn orders(&self) -> usize {
        self.ends.len()
    }

    /// Those of one order.
    #[inline(always)]
    pub fn order(&self, m: usize) -> &[f64] {
        let start = if m == 0 { 0 } else { self.ends[m - 1] };
        &self.moments[start..self.ends[m]]
    }

    fn clear(&mut self) {
        self.moments.clear();
        self.ends.clear();
    }

    /// The sum of shares of fields, from a part down.
    pub fn mixed(fields: &[Field], shares: &[f64], first: usize) -> Self {
        let mut out = Self { first, ..Self::default() };
        for (field, share) in fields.iter().zip(shares) {
            out.leaves += share * field.leaves;
            out.arrives += share * field.arrives;
        }
        for m in 0..fields.iter().map(Field::orders).max().unwrap_or(0) {
            let start = out.moments.len();
            for (field, share) in fields.iter().zip(shares).filter(|(field, _)| m < field.orders()) {
                let dropped = 2 * (first - field.first);
                out.levels = field.levels - dropped;
                let rows = &field.order(m)[dropped * field.order(m).len() / field.levels..];
                out.moments.resize(start + rows.len(), 0.0);
                out.moments[start..].iter_mut().zip(rows).for_each(|(sum, c)| *sum += share * c);
            }
            out.ends.push(out.moments.len());
        }
        out
    }
}

/// The answer for one stack.
#[derive(Clone, Debug, Default)]
pub(crate) struct Solution {
    /// One a beam, over a black ground.
    pub beams: Vec<Field>,
    /// Of a ground that shines with radiance 1, without any beam.
    pub ground: Field,
}

impl Solution {
    /// Orders that any beam has.
    pub fn orders(&self) -> usize {
        self.beams.iter().map(Field::orders).max().unwrap_or(0).max(self.ground.orders())
    }
}

/// Diffuse irradiance on a level surface below a stack, over a black ground.
#[derive(Clone, Debug)]
pub(crate) struct Arriving {
    /// Of each beam.
    pub beams: Vec<f64>,
    /// What comes back of a ground of radiance 1.
    pub ground: f64,
}

/// The numbers of streams that the solver knows.
pub(crate) const STREAMS: [usize; 5] = [4, 8, 16, 32, 64];

wide_too! {
    /// Solves a stack with one of [`STREAMS`], in the place of an earlier solution.
    pub(crate) fn solve(streams: usize, layers: &[Scaled], beams: &[Beam], accuracy: f64, solution: &mut Solution) {
        match streams {
            4 => stack::<2>(layers, beams, accuracy, solution),
            8 => stack::<4>(layers, beams, accuracy, solution),
            16 => stack::<8>(layers, beams, accuracy, solution),
            32 => stack::<16>(layers, beams, accuracy, solution),
            _ => stack::<32>(layers, beams, accuracy, solution),
        }
    }
}

wide_too! {
    /// What arrives at the ground, of the order m = 0 alone.
    pub(crate) fn arriving(streams: usize, layers: &[Scaled], beams: &[Beam]) -> Arriving {
        match streams {
            4 => adjoint::<2>(layers, beams),
            8 => adjoint::<4>(layers, beams),
            16 => adjoint::<8>(layers, beams),
            32 => adjoint::<16>(layers, beams),
            _ => adjoint::<32>(layers, beams),
        }
    }
}

#[inline(always)]
fn stack<const N: usize>(layers: &[Scaled], beams: &[Beam], accuracy: f64, solution: &mut Solution)
where
    Sizes: Eigen<N>,
{
    let quadrature = Quadrature::<N>::new();
    solution.beams.resize_with(beams.len(), Field::default);
    solution.beams.iter_mut().chain([&mut solution.ground]).for_each(Field::clear);
    // Each beam has its own end, whatever beams stand beside it.
    let mut open: Vec<Open> = beams.iter().map(|_| Open::default()).collect();
    let grazing = Grazing::new(&quadrature, layers);
    let mut scratch = Scratch::default();
    for m in 0..2 * N {
        if m > 0 && open.iter().all(|beam| beam.done) {
            break;
        }
        let order = Order::new(m, &quadrature);
        let operators = operators(&order, layers);
        let stack = Stack::new(&order, layers, &operators, &grazing);
        if m == 0 {
            stack.add(None, &mut scratch, &mut solution.ground);
        }
        for ((beam, field), open) in beams.iter().zip(&mut solution.beams).zip(&mut open) {
            if open.done {
                continue;
            }
            if m > 0 && stack.is_clear() {
                open.done = true;
                continue;
            }
            stack.add(Some(beam), &mut scratch, field);
            open.sized(size(m, layers, field), accuracy);
        }
    }
}

/// Whether a beam still wants orders.
#[derive(Clone, Debug, Default)]
struct Open {
    done: bool,
    /// Sizes of J by order.
    sizes: Vec<f64>,
}

impl Open {
    /// With the size of the next order. From one to the next they fall by about the same factor; two of them at least have
    /// to, for one alone may be small by its sign.
    fn sized(&mut self, size: f64, accuracy: f64) {
        self.sizes.push(size);
        let [scale, .., before, last, size] = self.sizes[..] else { return };
        let ratio = |a: f64, b: f64| if a > 0.0 { a / b } else { 0.0 };
        let falls = ratio(size, last).max(ratio(last, before));
        let rest = if falls < 1.0 { size * falls / (1.0 - falls) } else { f64::INFINITY };
        // What rounding leaves of a beam from the zenith does not fall.
        self.done = rest <= accuracy * scale || size.max(last) <= 1e-3 * accuracy * scale;
    }
}

/// How large J is in the moments of order m: the most of any layer.
#[inline(always)]
fn size(m: usize, layers: &[Scaled], field: &Field) -> f64 {
    let rows = field.order(m);
    let width = rows.len() / field.levels;
    let (mut k, mut most) = (0, 0.0f64);
    for layer in layers {
        let row = &rows[(k + 1) * width..(k + 2) * width];
        let sum: f64 = row.iter().zip(&layer.coupling[m..]).map(|(c, coupling)| (c * coupling).abs()).sum();
        most = most.max(sum * layer.depth.min(1.0));
        k += 2 * layer.parts;
    }
    most
}

#[inline(always)]
fn operators<const N: usize>(order: &Order<N>, layers: &[Scaled]) -> Vec<Operator<N>>
where
    Sizes: Eigen<N>,
{
    let mut operators = Vec::with_capacity(layers.len());
    for layer in layers {
        operators.push(Operator::new(order, &layer.coupling, layer.depth));
    }
    operators
}

/// What the sweeps keep of a part.
struct Joined<const N: usize> {
    /// Index of the layer.
    layer: usize,
    /// R below it.
    below: Matrix<N>,
    /// M = (1 − r R)⁻¹, transposed, and Z; nothing where the layer is clear.
    inner: Option<(Matrix<N>, Matrix<N>)>,
}

/// The layers at one order, joined.
struct Stack<'a, const N: usize> {
    order: &'a Order<N>,
    layers: &'a [Scaled],
    grazing: &'a Grazing,
    operators: &'a [Operator<N>],
    /// From the top down.
    joined: Vec<Joined<N>>,
}

impl<'a, const N: usize> Stack<'a, N>
where
    Sizes: Eigen<N>,
{
    #[inline(always)]
    fn new(order: &'a Order<N>, layers: &'a [Scaled], operators: &'a [Operator<N>], grazing: &'a Grazing) -> Self {
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
        joined.reverse();
        Self { order, layers, grazing, operators, joined }
    }

    /// Whether nothing scatters at this order.
    fn is_clear(&self) -> bool {
        self.joined.iter().all(|part| part.inner.is_none())
    }

    /// A part's operators; nothing where it is clear.
    #[inline(always)]
    fn slab(&self, part: &'a Joined<N>) -> Option<(&Slab<N>, &Matrix<N>, &Matrix<N>)> {
        match (&self.operators[part.layer], &part.inner) {
            (Operator::Scattering(slab), Some((m, z))) => Some((slab, m, z)),
            _ => None,
        }
    }

    /// What a clear part lets through.
    #[inline(always)]
    fn clear(&self, part: &Joined<N>) -> &Vector<N> {
        match &self.operators[part.layer] {
            Operator::Clear(t) => t,
            Operator::Scattering(_) => unreachable!("a part that scatters has been joined"),
        }
    }

    /// Solves for one beam, or for a ground of radiance 1 alone, and appends the order's moments.
    #[inline(always)]
    fn add(&'a self, beam: Option<&Beam>, scratch: &mut Scratch<N>, field: &mut Field) {
        let n = self.joined.len();
        let toward = beam.map(|beam| self.order.toward(-beam.cosine));
        let Scratch { lit, climbing, rows } = scratch;
        lit.clear();
        climbing.clear();
        rows.clear();
        // Upwards: S above each part, and g of it.
        let mut emission = if beam.is_some() { [0.0; N] } else { self.order.lambertian };
        let mut source = (usize::MAX, Source::default());
        for (i, part) in self.joined.iter().enumerate().rev() {
            let below = emission;
            let Some((slab, _, z)) = self.slab(part) else {
                emission.iter_mut().zip(self.clear(part)).for_each(|(e, t)| *e *= t);
                climbing.push((below, [0.0; N]));
                lit.push(None);
                continue;
            };
            let mut own = None;
            if let (Some(beam), Some(toward)) = (beam, &toward) {
                if source.0 != part.layer {
                    source = (part.layer, slab.source(toward));
                }
                let (top, bottom) = (beam.transmittance[i], beam.transmittance[i + 1]);
                if top > 1e-200 {
                    own = Some(slab.lit(&source.1, top, bottom));
                }
            }
            let mut g = apply_transposed(&slab.reflection, &below);
            if let Some(lit) = &own {
                g.iter_mut().zip(&lit.down).for_each(|(g, s)| *g += s);
            }
            let mut inside = apply_transposed(z, &g);
            inside.iter_mut().zip(&below).for_each(|(x, s)| *x += s);
            emission = apply_transposed(&slab.transmission, &inside);
            if let Some(lit) = &own {
                emission.iter_mut().zip(&lit.up).for_each(|(e, s)| *e += s);
            }
            climbing.push((below, g));
            lit.push(own);
        }

        // Downwards.
        field.levels = 2 * n + 1;
        let mut down = [0.0; N];
        let mut up = emission;
        let (mut x, mut y) = both(&up, &down);
        if self.order.m == 0 {
            field.leaves = self.order.flux(&up);
        }
        rows.push(self.order.moments_at_nodes.of(&x, &y));
        let mut above = (usize::MAX, [0.0; N]); // layer, Gᵀ x at the upper edge of the part
        for (i, part) in self.joined.iter().enumerate() {
            let (below, g) = &climbing[n - 1 - i]; // from the lowest part on
            match self.slab(part) {
                Some((slab, m, _)) => {
                    if above.0 != part.layer {
                        above = (part.layer, apply_transposed(&slab.g, &x));
                    }
                    let mut enters = apply_transposed(&slab.transmission, &down);
                    enters.iter_mut().zip(g).for_each(|(e, g)| *e += g);
                    down = apply_transposed(m, &enters);
                    up = apply_transposed(&part.below, &down);
                    up.iter_mut().zip(below).for_each(|(u, s)| *u += s);
                    (x, y) = both(&up, &down);
                    let lower = apply_transposed(&slab.g, &x);
                    let (xi, eta) = slab.middle(&above.1, &lower, lit[n - 1 - i].as_ref());
                    above.1 = lower;
                    rows.push(slab.moments.of(&xi, &eta));
                }
                None => {
                    let t = self.clear(part);
                    let half: Vector<N> = t.map(f64::sqrt);
                    up = apply_transposed(&part.below, &std::array::from_fn(|k| down[k] * t[k]));
                    up.iter_mut().zip(below).for_each(|(u, s)| *u += s);
                    let (x_mid, y_mid) =
                        both(&std::array::from_fn(|k| up[k] * half[k]), &std::array::from_fn(|k| down[k] * half[k]));
                    rows.push(self.order.moments_at_nodes.of(&x_mid, &y_mid));
                    down.iter_mut().zip(t).for_each(|(d, t)| *d *= t);
                    (x, y) = both(&up, &down);
                }
            }
            rows.push(self.order.moments_at_nodes.of(&x, &y));
        }
        if self.order.m == 0 {
            field.arrives = self.order.flux(&down);
        }
        self.mend(beam.zip(toward.as_ref().map(|toward| &toward[0])), rows);
        // Rows lie close; what each has too much the next overwrites.
        let width = 2 * N - self.order.m;
        let start = field.moments.len();
        field.moments.resize(start + field.levels * width + 2 * N, 0.0);
        for (k, [even, odd]) in rows.iter().enumerate() {
            let (pairs, _) = field.moments[start + k * width..][..2 * N].as_chunks_mut::<2>();
            for j in 0..N {
                pairs[j] = [even[j], odd[j]];
            }
        }
        field.moments.truncate(start + field.levels * width);
        field.ends.push(field.moments.len());
    }

    /// Λ_l(0) of each moment in J at the horizon, in the layer of a part, and J there of a beam of transmittance 1 whose even
    /// Λ_l are these.
    #[inline(always)]
    fn level_source(&self, part: usize, toward: &Vector<N>) -> (Vector<N>, f64) {
        let couplings = &self.layers[self.joined[part].layer].coupling[self.order.m..];
        let mut by_moment = [0.0; N];
        for ((to, own), coupling) in by_moment.iter_mut().zip(&self.order.level).zip(couplings.iter().step_by(2)) {
            *to = own * coupling;
        }
        let factor = if self.order.m == 0 { 0.25 / PI } else { 0.5 / PI };
        (by_moment, factor * dot(&by_moment, toward))
    }

    /// Adds to the moments of the order what the quadrature misses near the horizon.
    #[inline(always)]
    fn mend(&self, beam: Option<(&Beam, &Vector<N>)>, rows: &mut [[Vector<N>; 2]]) {
        let toward = beam.map_or(&[0.0; N], |(_, toward)| toward);
        let from_ground = if beam.is_some() { 0.0 } else { 1.0 };
        let parts = self.joined.len();
        let mut below = self.level_source(0, toward);
        let mut above = below;
        for (k, [even, _]) in rows.iter_mut().enumerate() {
            // The parts above a level and below it.
            let (upper, lower) = (k.saturating_sub(1) / 2, (k / 2).min(parts - 1));
            if k % 2 == 0 && k > 0 {
                above = below;
                if self.joined[upper].layer != self.joined[lower].layer {
                    below = self.level_source(lower, toward);
                }
            }
            let (down, up) = (self.grazing.down[k], self.grazing.up[k]);
            if down == 0.0 && up == 0.0 {
                continue;
            }
            let mut passes = 0.0;
            if let Some((beam, _)) = beam {
                passes = beam.transmittance[k / 2];
                if k % 2 == 1 {
                    passes = (passes * beam.transmittance[k / 2 + 1]).sqrt();
                }
            }
            let from_above = dot(&above.0, even) + above.1 * passes;
            let from_below = dot(&below.0, even) + below.1 * passes;
            let mended = 0.5 * (up * (from_ground - from_below) - down * from_above);
            even.iter_mut().zip(&self.order.level).for_each(|(c, own)| *c += mended * own);
        }
    }
}

/// What a sweep keeps of each part, from the lowest up.
struct Scratch<const N: usize> {
    lit: Vec<Option<Lit<N>>>,
    /// S below the part, and g.
    climbing: Vec<(Vector<N>, Vector<N>)>,
    /// Moments of each level, from the top down.
    rows: Vec<[Vector<N>; 2]>,
}

impl<const N: usize> Default for Scratch<N> {
    fn default() -> Self {
        Self { lit: Vec::new(), climbing: Vec::new(), rows: Vec::new() }
    }
}

/// With b the weight of what comes down below a part, e that of what goes up above it, from the equations of the sweeps:
///
/// ```text
/// b above = t Mᵀ b                                 from the ground up, b of the ground the flux itself
/// γ = Mᵀ b + Zᵀ t e,   e below = t e + r γ          from the top down; γ that of g, e above the top 0
/// F = Σ parts e·s⁺ + γ·s⁻
/// ```
#[inline(always)]
fn adjoint<const N: usize>(layers: &[Scaled], beams: &[Beam]) -> Arriving
where
    Sizes: Eigen<N>,
{
    let quadrature = Quadrature::<N>::new();
    let order = Order::new(0, &quadrature);
    let operators = operators(&order, layers);
    let grazing = Grazing::default();
    let stack = Stack::new(&order, layers, &operators, &grazing);
    let mut weights: Vec<Vector<N>> = Vec::with_capacity(stack.joined.len()); // Mᵀ b
    let mut b = order.flux_weights;
    for part in stack.joined.iter().rev() {
        match stack.slab(part) {
            Some((slab, m, _)) => {
                let inner = apply_transposed(&transpose(m), &b);
                b = apply_transposed(&slab.transmission, &inner);
                weights.push(inner);
            }
            None => {
                weights.push(b);
                b.iter_mut().zip(stack.clear(part)).for_each(|(b, t)| *b *= t);
            }
        }
    }
    weights.reverse();
    let mut arriving = Arriving { beams: vec![0.0; beams.len()], ground: 0.0 };
    let towards: Vec<_> = beams.iter().map(|beam| order.toward(-beam.cosine)).collect();
    let mut sources = vec![Source::default(); beams.len()];
    let mut of_sources = usize::MAX;
    let mut e = [0.0; N];
    for (i, part) in stack.joined.iter().enumerate() {
        let Some((slab, _, z)) = stack.slab(part) else {
            e.iter_mut().zip(stack.clear(part)).for_each(|(e, t)| *e *= t);
            continue;
        };
        let passes = apply_transposed(&slab.transmission, &e);
        let mut gamma = apply_transposed(z, &passes);
        gamma.iter_mut().zip(&weights[i]).for_each(|(g, b)| *g += b);
        if of_sources != part.layer {
            of_sources = part.layer;
            for (source, toward) in sources.iter_mut().zip(&towards) {
                *source = slab.source(toward);
            }
        }
        let worth = slab.worth(&e, &gamma);
        for ((sum, beam), source) in arriving.beams.iter_mut().zip(beams).zip(&sources) {
            let (top, bottom) = (beam.transmittance[i], beam.transmittance[i + 1]);
            if top > 1e-200 {
                *sum += slab.lit_worth(&worth, source, top, bottom);
            }
        }
        e = apply_transposed(&slab.reflection, &gamma);
        e.iter_mut().zip(&passes).for_each(|(e, t)| *e += t);
    }
    arriving.ground = dot(&e, &order.lambertian);
    arriving
}

#[inline(always)]
fn both<const N: usize>(up: &Vector<N>, down: &Vector<N>) -> (Vector<N>, Vector<N>) {
    let (mut x, mut y) = ([0.0; N], [0.0; N]);
    for i in 0..N {
        (x[i], y[i]) = (up[i] + down[i], up[i] - down[i]);
    }
    (x, y)
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
                let mut solution = Solution::default();
                solve(streams, &layers, &[beam(mu, &layers)], 1e-2, &mut solution);
                let field = &solution.beams[0];
                let direct = mu * beam(mu, &layers).transmittance[5];
                let all = field.leaves + field.arrives + direct;
                assert!((all / mu - 1.0).abs() < 1e-9, "{streams} {mu}: {all}");
                let ground = &solution.ground;
                assert!(((ground.leaves + ground.arrives) / PI - 1.0).abs() < 1e-9);
            }
        }
    }

    /// The adjoint gives the irradiance that the field has, through clear and scattering layers, thick and thin.
    #[test]
    fn what_arrives_is_the_same_by_the_adjoint() {
        for streams in STREAMS {
            let layers = [
                layer(0.9, 0.0, 0.1, 1, streams),
                layer(0.0, 0.0, 0.3, 2, streams),
                layer(0.95, 0.75, 2.0, 3, streams),
                layer(1.0, -0.3, 6.0, 1, streams),
                layer(0.0, 0.0, 0.1, 1, streams),
                layer(0.5, 0.5, 1e-4, 1, streams),
            ];
            let beams = [0.9, 0.3, 0.02].map(|mu| beam(mu, &layers));
            let mut solution = Solution::default();
            solve(streams, &layers, &beams, 1e-2, &mut solution);
            let found = arriving(streams, &layers, &beams);
            for (field, found) in solution.beams.iter().zip(&found.beams) {
                assert!((found / field.arrives - 1.0).abs() < 1e-10, "{streams}: {found} {}", field.arrives);
            }
            assert!((found.ground / solution.ground.arrives - 1.0).abs() < 1e-10);
        }
    }
}
