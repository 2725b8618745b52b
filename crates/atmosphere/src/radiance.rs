//! From a solved column to radiance along any line of sight.
//!
//! ```text
//! L = ∫ [J₁ + J] e^(−τ′) dτ′                     along the ray, from where it is seen [Chandrasekhar1960, I eq. 64]
//! J₁ dτ′ = Σ_c β_c P_c(Θ) E T′_sun ds/4π          single scattering, exact phase functions [Nakajima1988, TMS]
//! J = Σ_m cos mΔφ Σ_l ω′(2l+1)χ′_l Λ_l^m(μ) c_l^m  light scattered before, from the moments of the solved field
//! J₂ dτ′ = β_t K(Θ) ½ (q_sun + q_ray) E T′_sun ds/4π   what delta-M loses of light scattered twice
//! K = Σ_{l≥N} (2l+1) [(χ_l − f)² − f²] P_l(cos Θ) − f² Σ_{l<N} (2l+1) P_l(cos Θ)
//! f = χ_N,  τ′ = (1 − ωf) τ,  χ′_l = (χ_l − f)/(1 − f)   delta-M, N streams [Wiscombe1977, eqs. 17, 20]
//! ```
//!
//! K is the second order of the tail χ_l − f, l ≥ N, less the light that it leaves in its direction. One of the two
//! scatterings turns the light little, so that q, the scattering optical depth of the peaked scatterers (β_t a metre), is
//! counted along the sun's ray and along the line of sight, half of each. Towards the sun this is the IMS of [Nakajima1988],
//! eq. 63; it holds at every angle, upwards too, and takes two thirds of the error of 16 streams.
//!
//! On a round Earth the ray's zenith angle, the sun's and so T′_sun change along the ray. The field is solved plane-parallel
//! under a beam of spherical path lengths, for the sun's zenith angle at the site and 4° to both sides, and interpolated
//! to the sun of each point [Dahlback1991 for the beam; Spurr2001 for the line of sight].

use std::f64::consts::PI;
use std::sync::Arc;

use crate::medium::Medium;
use crate::phase::Phase;
use crate::ray::{Shells, Stretch};
use crate::solver::{Beam, Field, STREAMS, Scaled, Solution, normalised, solve};

/// A column at one entry, as the solver and the line of sight take it.
#[derive(Clone, Debug)]
pub(crate) struct Optics {
    /// Extinction of each layer \[m⁻¹\].
    pub extinction: Vec<f64>,
    /// Delta-scaled extinction \[m⁻¹\].
    pub scaled: Vec<f64>,
    /// Scattering of each layer by phase function \[m⁻¹\], layer by layer.
    scattering: Vec<f64>,
    pub phases: Vec<Arc<Phase>>,
    pub layers: Vec<Scaled>,
    /// Scattering by peaked scatterers \[m⁻¹\], and what it does twice.
    tail: Vec<f64>,
    twice: Option<Tail>,
    /// Moments kept by the solver.
    streams: usize,
}

/// Largest scaled optical depth of a part, within which J is taken as a parabola.
fn thickest(streams: usize) -> f64 {
    (12.8 / (streams * streams) as f64).clamp(0.006, 0.1)
}
/// Where a layer scatters less than this share of its extinction, its parts are thicker in proportion: J counts for less.
const PALE: f64 = 0.2;
/// Parts a layer is cut in at most.
const MOST_PARTS: usize = 800;

impl Optics {
    pub fn new(medium: &Medium, shells: &Shells, streams: usize) -> Self {
        let moments: Vec<_> = medium.phases.iter().map(|phase| phase.moments(streams)).collect();
        let n = medium.layers.len();
        let mut optics = Self {
            extinction: Vec::with_capacity(n),
            scaled: Vec::with_capacity(n),
            scattering: Vec::with_capacity(n * moments.len()),
            phases: medium.phases.clone(),
            layers: Vec::with_capacity(n),
            tail: Vec::with_capacity(n),
            twice: None,
            streams,
        };
        let peaked: Vec<bool> = moments.iter().map(|chi| chi[streams].abs() > PEAKED).collect();
        let mut tails = vec![0.0; moments.len()];
        for (i, layer) in medium.layers.iter().enumerate() {
            let per_metre = 1.0 / (shells.heights[i] - shells.heights[i + 1]);
            let scattering: f64 = layer.scattering.iter().sum();
            let mean = |l: usize| layer.scattering.iter().zip(&moments).map(|(s, chi)| s * chi[l]).sum::<f64>();
            // What of the scattering stays in the forward peak.
            let peak = mean(streams).clamp(0.0, 0.999_999 * scattering);
            let depth = layer.absorption + scattering - peak;
            let coupling = match depth > 0.0 {
                true => (0..streams).map(|l| (2.0 * l as f64 + 1.0) * (mean(l) - peak) / depth).collect(),
                false => vec![0.0; streams],
            };
            let worth = depth.min((scattering - peak) / PALE);
            let parts = ((worth / thickest(streams)).ceil() as usize).clamp(1, MOST_PARTS);
            optics.extinction.push(layer.extinction() * per_metre);
            optics.scaled.push(depth * per_metre);
            optics.scattering.extend(layer.scattering.iter().map(|s| s * per_metre));
            optics.layers.push(Scaled { depth: depth / parts as f64, parts, coupling });
            let of_peaked = |c: usize| if peaked[c] { layer.scattering[c] } else { 0.0 };
            optics.tail.push((0..moments.len()).map(of_peaked).sum::<f64>() * per_metre);
            tails.iter_mut().enumerate().for_each(|(c, sum)| *sum += of_peaked(c));
        }
        optics.twice = Tail::new(&medium.phases, &tails, streams);
        optics
    }

    pub fn streams(&self) -> usize {
        self.streams
    }

    /// Scattering of a layer \[m⁻¹\].
    pub fn scattered(&self, layer: usize) -> f64 {
        self.scattering(layer).iter().sum()
    }

    /// Scattering of a layer by phase function \[m⁻¹\].
    fn scattering(&self, layer: usize) -> &[f64] {
        let n = self.phases.len();
        &self.scattering[layer * n..(layer + 1) * n]
    }
}

/// Scatterers whose moment χ_N is less have no tail worth a second order.
const PEAKED: f64 = 1e-5;

/// K of the peaked scatterers of a column, mixed as the column has them.
#[derive(Clone, Debug)]
struct Tail {
    /// At scattering angles π (i/n)², i = 0 … n.
    values: Vec<f64>,
}

impl Tail {
    const STEPS: usize = 240;
    const MOMENTS: usize = 500;

    fn new(phases: &[Arc<Phase>], amounts: &[f64], streams: usize) -> Option<Self> {
        let total: f64 = amounts.iter().sum();
        if total <= 0.0 {
            return None;
        }
        let mut chi = vec![0.0; Self::MOMENTS + 1];
        for (phase, amount) in phases.iter().zip(amounts).filter(|(_, amount)| **amount > 0.0) {
            let share = amount / total;
            chi.iter_mut().zip(phase.moments(Self::MOMENTS).iter()).for_each(|(sum, chi)| *sum += share * chi);
        }
        let f = chi[streams];
        let terms: Vec<f64> = (chi.iter().enumerate())
            .map(|(l, chi)| (2.0 * l as f64 + 1.0) * if l < streams { -f * f } else { (chi - f).powi(2) - f * f })
            .collect();
        let values = (0..=Self::STEPS)
            .map(|i| {
                let cos = (PI * (i as f64 / Self::STEPS as f64).powi(2)).cos();
                let (mut p0, mut p1, mut sum) = (1.0, cos, terms[0]);
                for (l, term) in terms.iter().enumerate().skip(1) {
                    let k = l as f64;
                    sum += term * p1;
                    (p0, p1) = (p1, ((2.0 * k + 1.0) * cos * p1 - k * p0) / (k + 1.0));
                }
                sum
            })
            .collect();
        Some(Self { values })
    }

    fn value(&self, cos: f64) -> f64 {
        let x = (cos.clamp(-1.0, 1.0).acos() / PI).sqrt() * Self::STEPS as f64;
        let i = (x as usize).min(Self::STEPS - 1);
        self.values[i] + (self.values[i + 1] - self.values[i]) * (x - i as f64)
    }
}

/// Where the solver knows the field: the edges and middles of the parts of each layer.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    /// Heights of edges and middles \[m\], from the top down.
    pub levels: Vec<f64>,
    /// Layer of each part.
    layer_of: Vec<usize>,
    /// First part of each layer.
    first: Vec<usize>,
}

impl Lattice {
    pub fn new(shells: &Shells, optics: &Optics) -> Self {
        let mut lattice = Self { levels: vec![shells.top()], layer_of: Vec::new(), first: Vec::new() };
        for (i, layer) in optics.layers.iter().enumerate() {
            lattice.first.push(lattice.layer_of.len());
            let (top, bottom) = (shells.heights[i], shells.heights[i + 1]);
            for part in 0..layer.parts {
                let at = |half: usize| top + (bottom - top) * half as f64 / (2 * layer.parts) as f64;
                lattice.levels.extend([at(2 * part + 1), at(2 * part + 2)]);
                lattice.layer_of.push(i);
            }
        }
        lattice
    }

    /// Whether another column is cut alike.
    pub fn serves(&self, optics: &Optics) -> bool {
        let ends = self.first.iter().skip(1).copied().chain([self.layer_of.len()]);
        self.first.len() == optics.layers.len()
            && self.first.iter().zip(ends).zip(&optics.layers).all(|((a, b), layer)| b - a == layer.parts)
    }

    /// The first part that reaches below a height, from the top down.
    pub fn first_below(&self, height: f64) -> usize {
        let edges = self.levels.len() / 2;
        (0..edges - 1).rev().find(|part| self.levels[2 * part] >= height).unwrap_or(0)
    }

    /// Parts of a layer, lowest first.
    fn parts(&self, layer: usize) -> impl Iterator<Item = usize> {
        let end = self.first.get(layer + 1).copied().unwrap_or(self.layer_of.len());
        (self.first[layer]..end).rev()
    }
}

/// How far from the site's sun the local sun is looked up \[deg\]: between these, a parabola.
#[derive(Clone, Debug)]
struct Offsets {
    step: f64,
    /// Nodes to each side.
    reach: usize,
}

/// A field is solved for the sun of the site and this far to both sides \[deg\].
const FIELD_STEP: f64 = 4.0;

/// Path lengths from every level of a lattice to the sun, and to suns beside it.
#[derive(Clone, Debug)]
pub(crate) struct SunRays {
    /// True zenith angle at the site \[rad\].
    pub zenith: f64,
    offsets: Offsets,
    /// By level and offset: lengths in the layers \[m\], or nothing where the Earth is in the way.
    lengths: Vec<Option<Vec<f64>>>,
}

impl SunRays {
    pub fn new(shells: &Shells, lattice: &Lattice, zenith: f64, spherical: bool) -> Self {
        let offsets = match spherical {
            false => Offsets { step: 1.0, reach: 0 },
            true if zenith < 70f64.to_radians() => Offsets { step: 2.0, reach: 4 },
            true => Offsets { step: 1.0, reach: 9 },
        };
        let mut lengths = Vec::with_capacity(lattice.levels.len() * offsets.count());
        for height in &lattice.levels {
            for offset in offsets.all() {
                let angle = (zenith + offset.to_radians()).abs().min(PI);
                lengths.push(shells.towards_sun(*height, angle));
            }
        }
        Self { zenith, offsets, lengths }
    }

    /// Scaled optical depths towards the sun, by level and offset.
    pub fn depths(&self, optics: &Optics) -> SunDepths {
        let depths = (self.lengths.iter())
            .map(|lengths| match lengths {
                Some(lengths) => lengths.iter().zip(&optics.scaled).map(|(s, beta)| s * beta).sum(),
                None => BLOCKED,
            })
            .collect();
        SunDepths { offsets: self.offsets.clone(), from: 0, depths }
    }

    /// Scattering optical depths of the peaked scatterers towards the sun, by level.
    fn tail(&self, optics: &Optics) -> Vec<f64> {
        (self.lengths.chunks(self.offsets.count()))
            .map(|row| match &row[self.offsets.reach] {
                Some(lengths) => lengths.iter().zip(&optics.tail).map(|(s, beta)| s * beta).sum(),
                None => 0.0,
            })
            .collect()
    }

    /// Offsets of the fields that are solved \[deg\].
    pub fn fields(&self) -> &'static [f64] {
        if self.offsets.reach == 0 { &[0.0] } else { &[-FIELD_STEP, 0.0, FIELD_STEP] }
    }

    /// Cosine of the zenith angle of the sun `offset` degrees beside this one.
    pub fn cosine(&self, offset: f64) -> f64 {
        (self.zenith + offset.to_radians()).cos()
    }
}

impl Offsets {
    fn count(&self) -> usize {
        2 * self.reach + 1
    }
    fn all(&self) -> impl Iterator<Item = f64> {
        let (step, reach) = (self.step, self.reach as i32);
        (-reach..=reach).map(move |i| step * f64::from(i))
    }
}

/// An optical depth that nothing gets through.
const BLOCKED: f64 = 1e4;

/// Scaled optical depths from the levels of a lattice to the sun.
#[derive(Clone, Debug)]
pub(crate) struct SunDepths {
    offsets: Offsets,
    /// Of the levels from this one down.
    from: usize,
    depths: Vec<f64>,
}

impl SunDepths {
    /// At a level and an offset \[deg\].
    fn at(&self, level: usize, offset: f64) -> f64 {
        let n = self.offsets.count();
        let row = &self.depths[(level - self.from) * n..(level + 1 - self.from) * n];
        if n == 1 {
            return row[0];
        }
        let x = (offset / self.offsets.step + self.offsets.reach as f64).clamp(0.0, (n - 1) as f64);
        let i = (x.round() as usize).clamp(1, n - 2);
        let t = x - i as f64;
        let (a, b, c) = (row[i - 1], row[i], row[i + 1]);
        if a.max(b).max(c) >= BLOCKED {
            // Beside the shadow of the Earth: the nearest node.
            return row[x.round() as usize];
        }
        (b + 0.5 * t * (c - a) + 0.5 * t * t * (a - 2.0 * b + c)).max(0.0)
    }

    /// A beam to the edges of the parts.
    pub fn beam(&self, cosine: f64, offset: f64) -> Beam {
        let levels = self.depths.len() / self.offsets.count();
        Beam { cosine, transmittance: (0..levels).step_by(2).map(|level| (-self.at(level, offset)).exp()).collect() }
    }
}

/// A part of the air that a ray crosses, from below: three points and the lengths between them.
#[derive(Clone, Debug)]
struct Step {
    part: usize,
    layer: usize,
    /// Place within the part, 0 at its top and 1 at its bottom, of the lower end, the middle and the upper end.
    places: [f64; 3],
    /// Between them \[m\].
    lengths: [f64; 2],
    /// Cosine of the ray's zenith angle there.
    cosines: [f64; 3],
    /// Angle at the Earth's centre from the site there \[deg\].
    centres: [f64; 3],
}

/// A rising ray through a lattice.
#[derive(Clone, Debug)]
pub(crate) struct Sight {
    steps: Vec<Step>,
    /// Λ_l^m of the rising ray at the three points of each step, of the orders that were asked for; one set where the
    /// ray is straight.
    legendre: Vec<Vec<f64>>,
    streams: usize,
    orders: usize,
}

/// Which end of a ray looks at the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// From the lower end: light comes down.
    Up,
    /// From the upper end: light goes up.
    Down,
}

/// Cosines that differ by less count as one.
const STRAIGHT: f64 = 1e-4;

impl Sight {
    /// A ray from a height at a zenith angle 0..π/2 to a height or a length \[m\], whichever comes first.
    pub fn new(
        shells: &Shells,
        lattice: &Lattice,
        (from, zenith): (f64, f64),
        (end, longest): (f64, f64),
        streams: usize,
        orders: usize,
    ) -> Self {
        let mut steps = Vec::new();
        let mut rest = longest;
        'ray: for stretch in shells.rising(from, zenith, end) {
            for part in lattice.parts(stretch.layer) {
                let (top, bottom) = (lattice.levels[2 * part], lattice.levels[2 * part + 2]);
                let lowest = part + 1 == lattice.layer_of.len(); // goes on below the ground
                let low = if lowest { stretch.low } else { stretch.low.max(bottom) };
                let mut high = stretch.high.min(top);
                if high <= low {
                    continue;
                }
                let at = |h: f64| shells.length(&stretch, h);
                let whole = at(high) - at(low);
                if whole > rest {
                    // Where the length runs out, to first order in what is left.
                    high = low + (high - low) * rest / whole;
                }
                steps.push(Step::new(shells, &stretch, part, (low, high), (top, bottom)));
                rest -= whole;
                if rest <= 0.0 {
                    break 'ray;
                }
            }
        }
        let mut sight = Self { steps, legendre: Vec::new(), streams, orders };
        sight.fill_legendre();
        sight
    }

    fn fill_legendre(&mut self) {
        let cosines = || self.steps.iter().flat_map(|step| step.cosines);
        let (low, high) = cosines().fold((f64::INFINITY, 0.0), |(a, b), c| (f64::min(a, c), f64::max(b, c)));
        let table = |mu: f64| {
            let mut rows = Vec::with_capacity(self.orders * self.streams);
            for m in 0..self.orders {
                let from = rows.len();
                rows.resize(from + self.streams - m, 0.0);
                normalised(m, mu, &mut rows[from..]);
            }
            rows
        };
        self.legendre = match high - low < STRAIGHT {
            true => vec![table(0.5 * (low + high))],
            false => cosines().map(table).collect(),
        };
    }

    fn legendre(&self, step: usize, point: usize) -> &[f64] {
        if self.legendre.len() == 1 { &self.legendre[0] } else { &self.legendre[3 * step + point] }
    }

    /// Optical depth of the whole ray by an extinction per layer \[m⁻¹\].
    pub fn depth(&self, extinction: &[f64]) -> f64 {
        self.steps.iter().map(|step| extinction[step.layer] * (step.lengths[0] + step.lengths[1])).sum()
    }
}

impl Step {
    fn new(
        shells: &Shells,
        stretch: &Stretch,
        part: usize,
        (low, high): (f64, f64),
        (top, bottom): (f64, f64),
    ) -> Self {
        let heights = [low, 0.5 * (low + high), high];
        let along = heights.map(|h| shells.length(stretch, h));
        Self {
            part,
            layer: stretch.layer,
            places: heights.map(|h| ((top - h) / (top - bottom)).clamp(0.0, 1.0)),
            lengths: [along[1] - along[0], along[2] - along[1]],
            cosines: heights.map(|h| shells.cosine(stretch, h)),
            centres: heights.map(|h| shells.centre(stretch, h).to_degrees()),
        }
    }
}

/// A solved column at one entry under one sun of unit irradiance.
#[derive(Clone, Debug)]
pub(crate) struct Lit {
    pub depths: SunDepths,
    tail: Vec<f64>,
    /// Of the suns at the offsets of [`SunRays::fields`].
    pub fields: Vec<Field>,
}

/// What a ray gathers, by azimuth: light scattered once by each phase function without its P(Θ), and light scattered
/// before by each order without its cos mΔφ; and the second order of the peaked ones without its K(Θ).
#[derive(Clone, Debug, Default)]
pub(crate) struct Gathered {
    pub once: Vec<f64>,
    pub orders: Vec<f64>,
    pub twice: f64,
}

impl Gathered {
    /// L at a scattering angle Θ and an azimuth Δφ \[rad\] between the directions in which beam and light travel.
    pub fn radiance(&self, optics: &Optics, cos_scattering: f64, azimuth: f64) -> f64 {
        let once: f64 = self.once.iter().zip(&optics.phases).map(|(k, phase)| k * phase.value(cos_scattering)).sum();
        let orders = self.orders.iter().enumerate().map(|(m, l)| l * (m as f64 * azimuth).cos());
        let twice = optics.twice.as_ref().map_or(0.0, |tail| self.twice * tail.value(cos_scattering));
        (once + orders.sum::<f64>() + twice).max(0.0)
    }
}

impl Gathered {
    /// By a polynomial in cos Δφ through what was gathered at some azimuths.
    pub fn between(gathered: &[Gathered], azimuths: &[f64], azimuth: f64) -> Self {
        let x = azimuth.cos();
        let mut sum =
            Self { once: vec![0.0; gathered[0].once.len()], orders: vec![0.0; gathered[0].orders.len()], twice: 0.0 };
        for (i, (one, own)) in gathered.iter().zip(azimuths).enumerate() {
            let others = azimuths.iter().enumerate().filter(|(j, _)| *j != i);
            let share: f64 = others.map(|(_, a)| (x - a.cos()) / (own.cos() - a.cos())).product();
            sum.once.iter_mut().zip(&one.once).for_each(|(sum, k)| *sum += share * k);
            sum.orders.iter_mut().zip(&one.orders).for_each(|(sum, l)| *sum += share * l);
            sum.twice += share * one.twice;
        }
        sum
    }
}

impl Lit {
    /// T′ of the beam at the ground.
    pub fn direct(&self) -> f64 {
        let levels = self.depths.depths.len() / self.depths.offsets.count();
        (-self.depths.at(self.depths.from + levels - 1, 0.0)).exp()
    }

    /// What a ray through the parts from `first` down needs, under the sun of the site alone.
    pub fn centre(&self, first: usize) -> Self {
        let mut lit = Self {
            depths: self.depths.clone(),
            tail: self.tail[2 * first..].to_vec(),
            fields: vec![self.fields[self.fields.len() / 2].clone()],
        };
        lit.depths.from = 2 * first;
        lit.depths.depths.drain(..2 * first * lit.depths.offsets.count());
        lit.fields[0].keep_below(first);
        lit
    }

    /// Gathers light along a ray towards whoever looks, for a sun of zenith angle `zenith` \[rad\] whose azimuth is
    /// `azimuth` \[rad\] from that of the ray (0: the ray rises towards the sun).
    pub fn gather(&self, optics: &Optics, sight: &Sight, look: Look, zenith: f64, azimuth: f64) -> Gathered {
        let mut gathered =
            Gathered { once: vec![0.0; optics.phases.len()], orders: vec![0.0; sight.orders], twice: 0.0 };
        let mut tail_passed = 0.0;
        let mut passed = 0.0f64;
        let (cos_sun, sin_sun, along) = (zenith.cos(), zenith.sin(), azimuth.cos());
        let n_fields = self.fields.len();
        let mut values = vec![0.0; sight.orders];
        let order: &mut dyn Iterator<Item = usize> = match look {
            Look::Up => &mut (0..sight.steps.len()),
            Look::Down => &mut (0..sight.steps.len()).rev(),
        };
        for s in order {
            let step = &sight.steps[s];
            let near_first = |i: usize| if look == Look::Up { i } else { 2 - i };
            let beta = optics.scaled[step.layer];
            let lengths = if look == Look::Up { step.lengths } else { [step.lengths[1], step.lengths[0]] };
            // The sun of each point.
            let offsets: [f64; 3] = std::array::from_fn(|i| {
                let centre = step.centres[near_first(i)].to_radians();
                if centre == 0.0 {
                    return 0.0;
                }
                let cosine = cos_sun * centre.cos() + sin_sun * centre.sin() * along;
                (cosine.clamp(-1.0, 1.0).acos() - zenith).to_degrees()
            });
            let sun: [f64; 3] = std::array::from_fn(|i| self.sun_depth(step, near_first(i), offsets[i]));
            let scattering = optics.scattering(step.layer);
            let tail = optics.tail[step.layer];
            let tails: [f64; 3] = std::array::from_fn(|i| {
                let place = 2.0 * step.places[near_first(i)];
                let half = (place as usize).min(1);
                let at = |half: usize| self.tail[2 * step.part + half - self.depths.from];
                at(half) + (at(half + 1) - at(half)) * (place - half as f64)
            });
            let mut depth = 0.0;
            for half in 0..2 {
                if sun[half] < BLOCKED {
                    let gone = passed + depth + sun[half];
                    if gone < 700.0 {
                        let fall = beta * lengths[half] + sun[half + 1] - sun[half];
                        let light = (-gone).exp() * lengths[half] * decay(fall) / (4.0 * PI);
                        gathered.once.iter_mut().zip(scattering).for_each(|(k, b)| *k += b * light);
                        let q_sun = 0.5 * (tails[half] + tails[half + 1]);
                        let q_ray = tail_passed + tail * lengths[half] * (half as f64 + 0.5);
                        gathered.twice += tail * light * 0.5 * (q_sun + q_ray);
                    }
                }
                depth += beta * lengths[half];
            }
            if depth > 0.0 && passed < 700.0 {
                let split = lengths[0] / (lengths[0] + lengths[1]);
                let weights = parabola(depth, split);
                let transmitted = (-passed).exp() * depth;
                for i in 0..3 {
                    let weight = transmitted * weights[i];
                    let point = near_first(i);
                    let shares = if n_fields == 1 { [0.0, 1.0, 0.0] } else { lagrange(offsets[i] / FIELD_STEP) };
                    for (f, field) in self.fields.iter().enumerate() {
                        let share = if n_fields == 1 { 1.0 } else { shares[f] };
                        if share != 0.0 {
                            source(optics, sight, field, s, point, look, &mut values);
                            gathered.orders.iter_mut().zip(&values).for_each(|(o, v)| *o += weight * share * v);
                        }
                    }
                }
            }
            passed += depth;
            tail_passed += tail * (lengths[0] + lengths[1]);
        }
        gathered
    }

    fn sun_depth(&self, step: &Step, point: usize, offset: f64) -> f64 {
        let at = |half: usize| self.depths.at(2 * step.part + half, offset);
        let place = step.places[point];
        match place {
            0.0 => at(0),
            0.5 => at(1),
            1.0 => at(2),
            _ => {
                let (a, b) = if place < 0.5 { (at(0), at(1)) } else { (at(1), at(2)) };
                let t = if place < 0.5 { 2.0 * place } else { 2.0 * place - 1.0 };
                if a.max(b) >= BLOCKED { if t < 0.5 { a } else { b } } else { a + (b - a) * t }
            }
        }
    }
}

/// Light of a ground of radiance 1, gathered along a ray; it has no azimuth.
pub(crate) fn gather_ground(optics: &Optics, ground: &Field, sight: &Sight, look: Look) -> f64 {
    let (mut sum, mut passed) = (0.0, 0.0f64);
    let mut value = [0.0];
    let order: &mut dyn Iterator<Item = usize> = match look {
        Look::Up => &mut (0..sight.steps.len()),
        Look::Down => &mut (0..sight.steps.len()).rev(),
    };
    for s in order {
        let step = &sight.steps[s];
        let lengths = if look == Look::Up { step.lengths } else { [step.lengths[1], step.lengths[0]] };
        let depth = optics.scaled[step.layer] * (lengths[0] + lengths[1]);
        if depth > 0.0 && passed < 700.0 {
            let weights = parabola(depth, lengths[0] / (lengths[0] + lengths[1]));
            for (i, weight) in weights.into_iter().enumerate() {
                let point = if look == Look::Up { i } else { 2 - i };
                source(optics, sight, ground, s, point, look, &mut value);
                sum += (-passed).exp() * depth * weight * value[0];
            }
        }
        passed += depth;
    }
    sum
}

/// J of each order at a point of a step, without its cos mΔφ.
fn source(optics: &Optics, sight: &Sight, field: &Field, step: usize, point: usize, look: Look, out: &mut [f64]) {
    let Step { part, layer, places, .. } = &sight.steps[step];
    let coupling = &optics.layers[*layer].coupling;
    let legendre = sight.legendre(step, point);
    let place = places[point];
    // A parabola through the part's own three points, or one of them.
    let exact = (2.0 * place).round();
    let nodes: &[(usize, f64)] = if (2.0 * place - exact).abs() < 1e-9 {
        &[(exact as usize, 1.0)]
    } else {
        let [a, b, c] = lagrange(2.0 * place - 1.0);
        &[(0, a), (1, b), (2, c)]
    };
    let mut from = 0;
    for (m, out) in out.iter_mut().enumerate() {
        let width = sight.streams - m;
        *out = 0.0;
        if let Some(rows) = field.orders.get(m) {
            let rays = &legendre[from..from + width];
            for (node, share) in nodes {
                let place = 2 * (part - field.first) + node;
                let row = &rows[place * width..(place + 1) * width];
                // Light that comes down: Λ_l^m(−μ) = (−1)^(l+m) Λ_l^m(μ).
                let (mut even, mut odd) = (0.0, 0.0);
                for ((pair, c), ray) in coupling[m..].chunks(2).zip(row.chunks(2)).zip(rays.chunks(2)) {
                    even += pair[0] * c[0] * ray[0];
                    if pair.len() == 2 {
                        odd += pair[1] * c[1] * ray[1];
                    }
                }
                *out += share * if look == Look::Up { even - odd } else { even + odd };
            }
        }
        from += width;
    }
}

/// (1 − e^(−x))/x.
fn decay(x: f64) -> f64 {
    if x.abs() < 1e-5 { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
}

/// Shares of the nodes −1, 0, 1 in a parabola at t; beyond them that of the end.
fn lagrange(t: f64) -> [f64; 3] {
    let t = t.clamp(-1.0, 1.0);
    [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)]
}

/// Weights of J at u = 0, `split` and 1 in ∫₀¹ J(u) e^(−T u) du, J a parabola.
fn parabola(depth: f64, split: f64) -> [f64; 3] {
    let [m0, m1, m2] = falling_moments(depth);
    [
        (m2 - (1.0 + split) * m1 + split * m0) / split,
        (m1 - m2) / (split * (1.0 - split)),
        (m2 - split * m1) / (1.0 - split),
    ]
}

/// ∫₀¹ uⁿ e^(−T u) du, n = 0, 1, 2.
fn falling_moments(depth: f64) -> [f64; 3] {
    if depth < 0.7 {
        // Σ (−T)^k / (k! (n + k + 1))
        let mut sums = [0.0; 3];
        let mut term = 1.0;
        for k in 0..14 {
            let k = f64::from(k);
            sums.iter_mut().enumerate().for_each(|(n, sum)| *sum += term / (n as f64 + k + 1.0));
            term *= -depth / (k + 1.0);
        }
        return sums;
    }
    let e = (-depth).exp();
    let m0 = (1.0 - e) / depth;
    let m1 = (m0 - e) / depth;
    [m0, m1, (2.0 * m1 - e) / depth]
}

/// Solves a column at one entry for suns, and over a shining ground: the fields of each sun, and of the ground.
pub(crate) fn solve_entry(
    optics: &Optics,
    suns: &[Arc<SunRays>],
    fluxes_only: bool,
    accuracy: f64,
) -> (Vec<Lit>, Field) {
    let depths: Vec<SunDepths> = suns.iter().map(|sun| sun.depths(optics)).collect();
    let offsets = |sun: &SunRays| if fluxes_only { &[0.0][..] } else { sun.fields() };
    let beams: Vec<Beam> = (suns.iter().zip(&depths))
        .flat_map(|(sun, depths)| offsets(sun).iter().map(|o| depths.beam(sun.cosine(*o), *o)))
        .collect();
    let Solution { beams: fields, ground } = solve(optics.streams, &optics.layers, &beams, fluxes_only, accuracy);
    let mut fields = fields.into_iter();
    let lit = (suns.iter().zip(depths))
        .map(|(sun, depths)| Lit {
            depths,
            tail: sun.tail(optics),
            fields: fields.by_ref().take(offsets(sun).len()).collect(),
        })
        .collect();
    (lit, ground)
}

/// The streams that serve a number asked for: the next that the solver has.
pub(crate) fn streams(asked: u64) -> usize {
    STREAMS.into_iter().find(|known| *known as u64 >= asked).unwrap_or(STREAMS[STREAMS.len() - 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embedded;
    use crate::medium::{Layer, Strata};

    struct Problem {
        id: String,
        g: f64,
        medium: Medium,
        mu0: f64,
        albedo: f64,
    }

    fn records(text: &str) -> Vec<Vec<String>> {
        let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
        reader.records().map(|r| r.unwrap().iter().map(str::to_string).collect()).collect()
    }

    fn problems() -> Vec<Problem> {
        let number = |x: &str| x.parse::<f64>().unwrap();
        let rows = records(include_str!("../tests/data/plane_parallel_problems.csv"));
        (records(include_str!("../tests/data/plane_parallel_suns.csv")).iter())
            .map(|sun| {
                let mut medium = Medium { layers: Vec::new(), phases: Vec::new() };
                for row in rows.iter().filter(|row| row[0] == sun[0]) {
                    let layer: usize = row[1].parse().unwrap();
                    if medium.layers.len() <= layer {
                        medium.layers.push(Layer { absorption: number(&row[2]), scattering: Vec::new() });
                    }
                    let phase = match row[3].as_str() {
                        "rayleigh" => Phase::rayleigh(0.0),
                        _ => Phase::henyey_greenstein(number(&row[4])),
                    };
                    medium.phases.push(Arc::new(phase));
                    let n = medium.phases.len();
                    medium.layers[layer].scattering.resize(n - 1, 0.0);
                    medium.layers[layer].scattering.push(number(&row[5]));
                }
                let n = medium.phases.len();
                medium.layers.iter_mut().for_each(|layer| layer.scattering.resize(n, 0.0));
                let g = rows.iter().filter(|r| r[0] == sun[0] && r[3] == "hg").map(|r| number(&r[4])).fold(0.0, f64::max);
                Problem { id: sun[0].clone(), g, medium, mu0: number(&sun[1]), albedo: number(&sun[2]) }
            })
            .collect()
    }

    fn worst(streams: usize, most_g: f64) -> (f64, String) {
        let radiances = records(include_str!("../tests/data/plane_parallel.csv"));
        let mut worst = (0.0, String::new());
        for problem in problems() {
            if problem.g > most_g {
                continue;
            }
            let n = problem.medium.layers.len();
            let strata = Strata {
                heights: (0..=n).rev().map(|i| 1000.0 * i as f64).collect(),
                refractivity: vec![0.0; n + 1],
                radius: 6.371e6,
            };
            let shells = Shells::new(&strata, false);
            let optics = Optics::new(&problem.medium, &shells, streams);
            let lattice = Lattice::new(&shells, &optics);
            let sun = Arc::new(SunRays::new(&shells, &lattice, problem.mu0.acos(), false));
            let (lit, ground) = solve_entry(&optics, &[sun.clone()], false, 1e-9);
            let last = lattice.levels.len() - 1;
            let s = ground.down[last] / PI;
            let direct = problem.mu0 * (-lit[0].depths.at(last, 0.0)).exp();
            let shining = problem.albedo / PI * (direct + lit[0].fields[0].down[last]) / (1.0 - problem.albedo * s);
            for row in radiances.iter().filter(|row| row[0] == problem.id) {
                let number = |i: usize| row[i].parse::<f64>().unwrap();
                let (up, mu, dphi, cos) = (row[3] == "up", number(4), number(5), number(6));
                let look = if up { Look::Down } else { Look::Up };
                let (from, to) = match (row[1].as_str(), up) {
                    ("middle", _) => continue,
                    _ => (0.0, shells.top()),
                };
                if cos > 20f64.to_radians().cos() {
                    continue;
                }
                let sight = Sight::new(&shells, &lattice, (from, mu.acos()), (to, f64::INFINITY), streams, streams);
                let azimuth = if up { PI - dphi.to_radians() } else { dphi.to_radians() };
                let gathered = lit[0].gather(&optics, &sight, look, sun.zenith, azimuth);
                let mut found = gathered.radiance(&optics, cos, dphi.to_radians());
                found += shining * gather_ground(&optics, &ground, &sight, look);
                if up {
                    found += shining * (-sight.depth(&optics.scaled)).exp();
                }
                let due = number(7);
                let error = (found / due - 1.0).abs();
                if error > worst.0 {
                    worst = (error, format!("{row:?}: {found}"));
                }
            }
        }
        worst
    }

    #[test]
    fn radiances_are_those_of_disort() {
        for (streams, g) in [(8, 0.7), (16, 0.7), (32, 0.9), (64, 0.9)] {
            let (error, place) = worst(streams, g);
            eprintln!("{streams} streams, g to {g}: {error:.2e} at {place}");
        }
        _ = embedded::rows;
    }
}
