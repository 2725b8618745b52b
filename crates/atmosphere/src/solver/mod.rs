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
use layer::{Fall, Inside, Operator, Slab, Source};
pub(crate) use legendre::normalised;
use matrix::{Eigen, Matrix, Sizes, Vector, apply_to_each, apply_transposed, dot, inverse, product, transpose};
use quadrature::{Order, Quadrature};

use crate::wide::wide_too;

/// A layer as the solver takes it, delta-scaled.
#[derive(Clone, Debug)]
pub(crate) struct Scaled {
    /// Optical depth of one part.
    pub depth: f64,
    pub cut: Cut,
    /// ω(2l+1)χ_l, l = 0 … one less than the streams.
    pub coupling: Vec<f64>,
}

/// How a layer is cut, and where its field is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cut {
    /// Equal parts.
    pub parts: usize,
    /// Whether the field is wanted in the middle of each part beside its edges.
    pub middles: bool,
}

impl Cut {
    /// Levels at which the field is known, but for the upper edge of the layer.
    pub fn levels(self) -> usize {
        if self.middles { 2 * self.parts } else { self.parts }
    }

    /// One that has what either has.
    pub fn and(self, other: Self) -> Self {
        Self { parts: self.parts.max(other.parts), middles: self.middles | other.middles }
    }
}

impl Scaled {
    /// Whether it scatters at an azimuthal order, beside what it scatters at the order 0.
    fn counts_at(&self, m: usize, accuracy: f64) -> bool {
        let least = 0.1 * accuracy * self.coupling[0].abs();
        self.depth > 0.0 && self.coupling[m..].iter().any(|coupling| coupling.abs() > least)
    }
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
    /// c_l^m, order after order, at the levels of the stack from the top down: a row of `streams − m` values each.
    moments: Vec<f64>,
    orders: Vec<Rows>,
    streams: usize,
    /// Diffuse irradiance on a level surface, upwards above the stack.
    pub leaves: f64,
    /// Downwards below it; the beam beside it is the scaled one.
    pub arrives: f64,
}

/// Where an order's rows stand.
#[derive(Clone, Copy, Debug)]
struct Rows {
    /// The first level that has one: nothing scatters above it at this order, or it was not kept.
    first: usize,
    /// Where they end.
    end: usize,
}

impl Field {
    /// The number of orders.
    pub fn orders(&self) -> usize {
        self.orders.len()
    }

    /// Of one order: the first level that has a row, and the rows.
    #[inline(always)]
    pub fn order(&self, m: usize) -> (usize, &[f64]) {
        let start = if m == 0 { 0 } else { self.orders[m - 1].end };
        (self.orders[m].first, &self.moments[start..self.orders[m].end])
    }

    /// Values in a row of an order.
    #[inline(always)]
    pub fn order_width(&self, m: usize) -> usize {
        self.streams - m
    }

    /// The first level that has a row, by order.
    pub fn starts(&self) -> Vec<usize> {
        self.orders.iter().map(|rows| rows.first).collect()
    }

    fn clear(&mut self) {
        self.moments.clear();
        self.orders.clear();
    }

    /// The sum of shares of fields of one stack, from a level down.
    pub fn mixed(fields: &[Field], shares: &[f64], from: usize) -> Self {
        let mut out = Self { streams: fields.first().map_or(0, |field| field.streams), ..Self::default() };
        for (field, share) in fields.iter().zip(shares) {
            out.leaves += share * field.leaves;
            out.arrives += share * field.arrives;
        }
        for m in 0..fields.iter().map(Field::orders).max().unwrap_or(0) {
            let (start, mut first) = (out.moments.len(), from);
            for (field, share) in fields.iter().zip(shares).filter(|(field, _)| m < field.orders()) {
                let (own, rows) = field.order(m);
                first = own.max(from);
                let rows = &rows[(first - own) * field.order_width(m)..];
                out.moments.resize(start + rows.len(), 0.0);
                out.moments[start..].iter_mut().zip(rows).for_each(|(sum, c)| *sum += share * c);
            }
            out.orders.push(Rows { first, end: out.moments.len() });
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
    /// The first level that has a row, by order, as far as any beam has orders.
    pub fn starts(&self) -> Vec<usize> {
        let fields = self.beams.iter().chain([&self.ground]);
        fields.max_by_key(|field| field.orders()).map_or_else(Vec::new, Field::starts)
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
    let falling: Vec<Falling> = beams.iter().map(|beam| Falling::new(beam, layers)).collect();
    let grazing = Grazing::new(&quadrature, layers);
    for m in 0..2 * N {
        // Layers from the top down that scatter nothing at this order neither send light nor return it.
        let scatters = |layer: &Scaled| m == 0 || layer.counts_at(m, accuracy);
        let Some(dark) = layers.iter().position(scatters) else { break };
        let above = Above {
            parts: layers[..dark].iter().map(|layer| layer.cut.parts).sum(),
            levels: layers[..dark].iter().map(|layer| layer.cut.levels()).sum(),
        };
        let order = Order::new(m, &quadrature);
        let operators = operators(&order, &layers[dark..]);
        let stack = Stack::new(&order, &layers[dark..], above, &operators, &grazing);
        if m == 0 {
            stack.add(None, [&mut solution.ground]);
        }
        let fields = falling.iter().zip(&mut solution.beams).zip(&open);
        let mut wanted = fields.filter(|(_, open)| !open.done).map(|(of, _)| of).collect::<Vec<_>>().into_iter();
        // So many at a time that a sweep keeps to the nearest memory.
        while N <= 4 && wanted.len() >= 4 {
            stack.add_next::<4>(&mut wanted);
        }
        while N <= 8 && wanted.len() >= 2 {
            stack.add_next::<2>(&mut wanted);
        }
        while wanted.len() > 0 {
            stack.add_next::<1>(&mut wanted);
        }
        for (field, open) in solution.beams.iter().zip(&mut open).filter(|(_, open)| !open.done) {
            open.sized(size(m, layers, field), accuracy);
        }
        if open.iter().all(|beam| beam.done) {
            break;
        }
    }
}

/// A beam, and its fall over every part.
struct Falling<'a> {
    beam: &'a Beam,
    falls: Vec<Fall>,
}

impl<'a> Falling<'a> {
    fn new(beam: &'a Beam, layers: &[Scaled]) -> Self {
        let mut edges = beam.transmittance.windows(2);
        let mut falls: Vec<Fall> = Vec::with_capacity(edges.len());
        for layer in layers {
            for (part, edges) in edges.by_ref().take(layer.cut.parts).enumerate() {
                let fall = Fall::new(edges[0], edges[1]);
                falls.push(if part == 0 { fall } else { fall.as_steep_as(&falls[falls.len() - 1]) });
            }
        }
        Self { beam, falls }
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
    let (first, rows) = field.order(m);
    let width = field.order_width(m);
    let (mut k, mut most) = (0, 0.0f64);
    for layer in layers {
        if k >= first {
            let row = &rows[(k + 1 - first) * width..(k + 2 - first) * width];
            let sum: f64 = row.iter().zip(&layer.coupling[m..]).map(|(c, coupling)| (c * coupling).abs()).sum();
            most = most.max(sum * layer.depth.min(1.0));
        }
        k += layer.cut.levels();
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
        operators.push(Operator::new(order, layer));
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

/// What stands above some layers of a stack.
#[derive(Clone, Copy, Default)]
struct Above {
    parts: usize,
    levels: usize,
}

/// The layers at one order, joined.
struct Stack<'a, const N: usize> {
    order: &'a Order<N>,
    layers: &'a [Scaled],
    above: Above,
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
    fn new(
        order: &'a Order<N>,
        layers: &'a [Scaled],
        above: Above,
        operators: &'a [Operator<N>],
        grazing: &'a Grazing,
    ) -> Self {
        let parts: usize = layers.iter().map(|layer| layer.cut.parts).sum();
        let mut joined: Vec<Joined<N>> = Vec::with_capacity(parts);
        let mut below = [[0.0; N]; N];
        let mut dark = true; // nothing scatters below
        for (i, layer) in layers.iter().enumerate().rev() {
            for _ in 0..layer.cut.parts {
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
        Self { order, layers, above, grazing, operators, joined }
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

    /// Solves for the next so many beams.
    #[inline(always)]
    fn add_next<'b, const B: usize>(&self, wanted: &mut impl Iterator<Item = (&'b Falling<'b>, &'b mut Field)>) {
        let some: [_; B] = std::array::from_fn(|_| wanted.next().expect("so many are left"));
        let beams = std::array::from_fn(|b| some[b].0);
        self.add(Some(beams), some.map(|(_, field)| field));
    }

    /// Solves for some beams, or for a ground of radiance 1 alone, and appends the order's moments to each field.
    #[inline(always)]
    fn add<const B: usize>(&self, beams: Option<[&Falling; B]>, mut fields: [&mut Field; B]) {
        let toward = beams.map(|beams| beams.map(|falling| self.order.toward(-falling.beam.cosine)));
        // From the lowest part up.
        let mut climbing: Vec<Climbing<N, B>> = Vec::with_capacity(self.joined.len());
        let mut emission = [if beams.is_some() { [0.0; N] } else { self.order.lambertian }; B];
        let mut source = (usize::MAX, [Source::default(); B]);
        for (i, part) in self.joined.iter().enumerate().rev() {
            climbing.push(Climbing { below: emission, g: [[0.0; N]; B], inside: Inside::default() });
            let Climbing { below, g, inside } = &mut climbing[self.joined.len() - 1 - i];
            let Some((slab, _, z)) = self.slab(part) else {
                let t = self.clear(part);
                emission.iter_mut().for_each(|emission| emission.iter_mut().zip(t).for_each(|(e, t)| *e *= t));
                continue;
            };
            *g = apply_to_each(&slab.reflection, below);
            let mut lit = [[0.0; N]; B];
            if let (Some(beams), Some(toward)) = (beams, &toward) {
                if source.0 != part.layer {
                    source.0 = part.layer;
                    source.1 = slab.sources(toward);
                }
                let falls = beams.map(|falling| &falling.falls[self.above.parts + i]);
                let [up, down] = slab.lit(&mut source.1, &falls, inside);
                add_to(g, &down);
                lit = up;
            }
            let mut enters = apply_to_each(z, g);
            add_to(&mut enters, below);
            emission = apply_to_each(&slab.transmission, &enters);
            add_to(&mut emission, &lit);
        }

        // From the top down: the moments of each level.
        let mut level = Level { stack: self, beams, edge: 0, at: 0, above: Default::default() };
        let levels: usize = 1 + self.layers.iter().map(|layer| layer.cut.levels()).sum::<usize>();
        for field in &mut fields {
            field.streams = 2 * N;
            field.moments.reserve(levels * (2 * N - self.order.m) + 2 * N);
        }
        let toward = toward.map_or([[0.0; N]; B], |toward| toward.map(|[even, _]| even));
        let mut down = [[0.0; N]; B];
        let mut up = emission;
        let mut own = self.level_source(0, &toward);
        let [mut x, mut y] = both(&up, &down);
        if self.order.m == 0 {
            fields.iter_mut().zip(&up).for_each(|(field, up)| field.leaves = self.order.flux(up));
        }
        if self.above.parts == 0 {
            level.above = own;
        }
        level.put_edge(self.order.moments_at_nodes.of(&x, &y), &own, &mut fields);
        let mut entering = (usize::MAX, [[0.0; N]; B]); // layer, Gᵀ x at the upper edge of the part
        for (i, (part, Climbing { below, g, inside })) in self.joined.iter().zip(climbing.iter().rev()).enumerate() {
            level.above = own;
            match self.slab(part) {
                Some((slab, m, _)) => {
                    if slab.middles && entering.0 != part.layer {
                        entering = (part.layer, apply_to_each(&slab.g, &x));
                    }
                    let mut enters = apply_to_each(&slab.transmission, &down);
                    add_to(&mut enters, g);
                    down = apply_to_each(m, &enters);
                    up = apply_to_each(&part.below, &down);
                    add_to(&mut up, below);
                    [x, y] = both(&up, &down);
                    if slab.middles {
                        let leaving = apply_to_each(&slab.g, &x);
                        let [xi, eta] = slab.middle(&entering.1, &leaving, inside);
                        entering.1 = leaving;
                        level.put_middle(slab.moments.of(&xi, &eta), &own, &mut fields);
                    }
                }
                None => {
                    if self.layers[part.layer].cut.middles {
                        level.skip(&mut fields);
                    }
                    let t = self.clear(part);
                    down.iter_mut().for_each(|down| down.iter_mut().zip(t).for_each(|(d, t)| *d *= t));
                    up = apply_to_each(&part.below, &down);
                    add_to(&mut up, below);
                    [x, y] = both(&up, &down);
                }
            }
            if self.joined.get(i + 1).is_some_and(|next| next.layer != part.layer) {
                own = self.level_source(i + 1, &toward);
            }
            level.put_edge(self.order.moments_at_nodes.of(&x, &y), &own, &mut fields);
        }
        for (field, down) in fields.into_iter().zip(&down) {
            field.orders.push(Rows { first: self.above.levels, end: field.moments.len() });
            if self.order.m == 0 {
                field.arrives = self.order.flux(down);
            }
        }
    }

    /// Light at the horizon in the layer of a part, under beams whose even Λ_l are these.
    #[inline(always)]
    fn level_source<const B: usize>(&self, part: usize, toward: &[Vector<N>; B]) -> LevelSource<N, B> {
        let couplings = &self.layers[self.joined[part].layer].coupling[self.order.m..];
        let mut by_moment = [0.0; N];
        for ((to, own), coupling) in by_moment.iter_mut().zip(&self.order.level).zip(couplings.iter().step_by(2)) {
            *to = own * coupling;
        }
        let factor = if self.order.m == 0 { 0.25 / PI } else { 0.5 / PI };
        LevelSource { by_beam: toward.map(|toward| factor * dot(&by_moment, &toward)), by_moment }
    }
}

/// J at the horizon.
#[derive(Clone, Copy)]
struct LevelSource<const N: usize, const B: usize> {
    /// Λ_l(0) of each even moment in it.
    by_moment: Vector<N>,
    /// Of beams of transmittance 1.
    by_beam: [f64; B],
}

impl<const N: usize, const B: usize> Default for LevelSource<N, B> {
    fn default() -> Self {
        Self { by_moment: [0.0; N], by_beam: [0.0; B] }
    }
}

/// The level whose moments come next.
struct Level<'a, const N: usize, const B: usize> {
    stack: &'a Stack<'a, N>,
    beams: Option<[&'a Falling<'a>; B]>,
    /// The edge that comes next, and the level, counted from the upper edge of the stack.
    edge: usize,
    at: usize,
    /// J at the horizon just above it.
    above: LevelSource<N, B>,
}

impl<const N: usize, const B: usize> Level<'_, N, B> {
    /// Puts c_l of even and odd l + m at an edge into the fields; `below` is J at the horizon just below it.
    #[inline(always)]
    fn put_edge(&mut self, moments: [[Vector<N>; B]; 2], below: &LevelSource<N, B>, fields: &mut [&mut Field; B]) {
        let edge = self.stack.above.parts + self.edge;
        self.put(moments, below, |transmittance| transmittance[edge], fields);
        self.edge += 1;
    }

    /// The same in the middle of a part.
    #[inline(always)]
    fn put_middle(&mut self, moments: [[Vector<N>; B]; 2], below: &LevelSource<N, B>, fields: &mut [&mut Field; B]) {
        let edge = self.stack.above.parts + self.edge;
        self.put(moments, below, |transmittance| (transmittance[edge - 1] * transmittance[edge]).sqrt(), fields);
    }

    /// The same where so much of a beam passes, with what the quadrature misses near the horizon.
    #[inline(always)]
    fn put(
        &mut self,
        moments: [[Vector<N>; B]; 2],
        below: &LevelSource<N, B>,
        passes: impl Fn(&[f64]) -> f64,
        fields: &mut [&mut Field; B],
    ) {
        let [mut even, odd] = moments;
        let Stack { order, grazing, above, .. } = *self.stack;
        let k = above.levels + self.at;
        let (down, up) = (grazing.down[k], grazing.up[k]);
        if down != 0.0 || up != 0.0 {
            let from_ground = if self.beams.is_some() { 0.0 } else { 1.0 };
            for b in 0..B {
                let passes = self.beams.map_or(0.0, |beams| passes(&beams[b].beam.transmittance));
                let from_above = dot(&self.above.by_moment, &even[b]) + self.above.by_beam[b] * passes;
                let from_below = dot(&below.by_moment, &even[b]) + below.by_beam[b] * passes;
                let mended = 0.5 * (up * (from_ground - from_below) - down * from_above);
                even[b].iter_mut().zip(&order.level).for_each(|(c, own)| *c += mended * own);
            }
        }
        for b in 0..B {
            let mut row = [[0.0; 2]; N];
            for j in 0..N {
                row[j] = [even[b][j], odd[b][j]];
            }
            // All of it, and what is too much taken back: a copy of a size known to the compiler.
            let moments = &mut fields[b].moments;
            moments.extend_from_slice(row.as_flattened());
            moments.truncate(moments.len() - order.m);
        }
        self.at += 1;
    }

    /// Leaves out a level at which nothing scatters.
    fn skip(&mut self, fields: &mut [&mut Field; B]) {
        for field in fields {
            let filled = field.moments.len() + 2 * N - self.stack.order.m;
            field.moments.resize(filled, 0.0);
        }
        self.at += 1;
    }
}

/// What a sweep upwards leaves at a part.
struct Climbing<const N: usize, const B: usize> {
    /// S below it.
    below: [Vector<N>; B],
    g: [Vector<N>; B],
    /// What the beams leave in it.
    inside: Inside<N, B>,
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
    let stack = Stack::new(&order, layers, Above::default(), &operators, &grazing);
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
                [*source] = slab.sources(&[*toward]);
            }
        }
        let worth = slab.worth(&e, &gamma);
        for ((sum, beam), source) in arriving.beams.iter_mut().zip(beams).zip(&sources) {
            let fall = Fall::new(beam.transmittance[i], beam.transmittance[i + 1]);
            if fall.is_lit() {
                *sum += slab.lit_worth(&worth, source, &fall);
            }
        }
        e = apply_transposed(&slab.reflection, &gamma);
        e.iter_mut().zip(&passes).for_each(|(e, t)| *e += t);
    }
    arriving.ground = dot(&e, &order.lambertian);
    arriving
}

/// x and y of each beam.
#[inline(always)]
fn both<const N: usize, const B: usize>(up: &[Vector<N>; B], down: &[Vector<N>; B]) -> [[Vector<N>; B]; 2] {
    let (mut x, mut y) = ([[0.0; N]; B], [[0.0; N]; B]);
    for b in 0..B {
        for i in 0..N {
            (x[b][i], y[b][i]) = (up[b][i] + down[b][i], up[b][i] - down[b][i]);
        }
    }
    [x, y]
}

#[inline(always)]
fn add_to<const N: usize, const B: usize>(sums: &mut [Vector<N>; B], more: &[Vector<N>; B]) {
    for b in 0..B {
        for i in 0..N {
            sums[b][i] += more[b][i];
        }
    }
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
        Scaled { depth: (1.0 - omega * f) * depth / parts as f64, cut: Cut { parts, middles: true }, coupling }
    }

    fn beam(mu: f64, layers: &[Scaled]) -> Beam {
        let mut transmittance = vec![1.0];
        let mut depth = 0.0;
        for layer in layers {
            for _ in 0..layer.cut.parts {
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
