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
//! under beams of spherical path lengths, for a fixed row of the sun's zenith angles, and interpolated to the sun of each
//! point [Dahlback1991 for the beam; Spurr2002 for the line of sight].

use std::f64::consts::PI;
use std::sync::{Arc, LazyLock};

use crate::medium::Medium;
use crate::phase::Phase;
use crate::ray::{Shells, Stretch};
use crate::solver::{Arriving, Beam, Cut, Field, STREAMS, Scaled, Solution, arriving, normalised, solve};
use crate::wide::{exp, wide_too};

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
    /// Which of them delta-M takes a peak from.
    peaked: Vec<bool>,
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
/// Parts of less than this share of it have J as a straight line between their edges.
const THIN: f64 = 0.2;
/// Where a layer scatters less than this share of its extinction, its parts are thicker in proportion: J counts for less.
const PALE: f64 = 0.2;
/// Parts a layer is cut in at most.
const MOST_PARTS: usize = 800;

impl Optics {
    /// With `whole` layers where only fluxes at the ground are wanted.
    pub fn new(medium: &Medium, shells: &Shells, streams: usize, whole: bool) -> Self {
        Self::cut(medium, shells, streams, whole, None)
    }

    /// With layers cut as given.
    pub fn with_cuts(medium: &Medium, shells: &Shells, streams: usize, cuts: &[Cut]) -> Self {
        Self::cut(medium, shells, streams, false, Some(cuts))
    }

    /// Cuts that serve columns of no more scattering than this one.
    pub fn cuts(&self) -> Vec<Cut> {
        self.layers.iter().map(|layer| layer.cut).collect()
    }

    fn cut(medium: &Medium, shells: &Shells, streams: usize, whole: bool, given: Option<&[Cut]>) -> Self {
        let moments: Vec<_> = medium.phases.iter().map(|phase| phase.moments(streams)).collect();
        let n = medium.layers.len();
        let mut optics = Self {
            extinction: Vec::with_capacity(n),
            scaled: Vec::with_capacity(n),
            scattering: Vec::with_capacity(n * moments.len()),
            phases: medium.phases.clone(),
            peaked: Vec::new(),
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
            let parts = ((worth / thickest(streams)).ceil() as usize).clamp(1, if whole { 1 } else { MOST_PARTS });
            let middles = !whole && worth > THIN * thickest(streams) * parts as f64;
            let cut = given.map_or(Cut { parts, middles }, |given| given[i]);
            optics.extinction.push(layer.extinction() * per_metre);
            optics.scaled.push(depth * per_metre);
            optics.scattering.extend(layer.scattering.iter().map(|s| s * per_metre));
            optics.layers.push(Scaled { depth: depth / cut.parts as f64, cut, coupling });
            let of_peaked = |c: usize| if peaked[c] { layer.scattering[c] } else { 0.0 };
            optics.tail.push((0..moments.len()).map(of_peaked).sum::<f64>() * per_metre);
            tails.iter_mut().enumerate().for_each(|(c, sum)| *sum += of_peaked(c));
        }
        optics.peaked = peaked;
        optics.twice = if whole { None } else { Tail::new(&medium.phases, &tails, streams) };
        optics
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

/// Columns gathered side by side.
pub(crate) const LANES: usize = 4;
/// What each of them has.
pub(crate) type Lanes = [f64; LANES];

/// Up to so many columns cut alike, side by side; what lanes beyond them have is 0.
#[derive(Clone, Debug)]
pub(crate) struct Bundle {
    pub columns: Vec<Optics>,
    /// Of each layer \[m⁻¹\]: delta-scaled extinction, and scattering by peaked scatterers.
    scaled: Vec<Lanes>,
    tail: Vec<Lanes>,
    /// Scattering of each layer by phase function \[m⁻¹\], layer by layer.
    scattering: Vec<Lanes>,
    phases: usize,
    /// 1 where delta-M takes a peak from a phase function, 0 elsewhere.
    peaked: Vec<Lanes>,
    /// Whether any has a tail.
    twice: bool,
}

impl Bundle {
    pub fn new(columns: Vec<Optics>) -> Self {
        let phases = columns.iter().map(|column| column.phases.len()).max().unwrap_or(0);
        let layers = columns.first().map_or(0, |column| column.layers.len());
        let mut bundle = Self {
            scaled: vec![[0.0; LANES]; layers],
            tail: vec![[0.0; LANES]; layers],
            scattering: vec![[0.0; LANES]; layers * phases],
            phases,
            peaked: vec![[0.0; LANES]; phases],
            twice: columns.iter().any(|column| column.twice.is_some()),
            columns: Vec::new(),
        };
        for (lane, column) in columns.iter().enumerate() {
            for layer in 0..layers {
                bundle.scaled[layer][lane] = column.scaled[layer];
                bundle.tail[layer][lane] = column.tail[layer];
                let to = bundle.scattering[layer * phases..].iter_mut();
                to.zip(column.scattering(layer)).for_each(|(to, beta)| to[lane] = *beta);
            }
            for (to, _) in bundle.peaked.iter_mut().zip(&column.peaked).filter(|(_, peaked)| **peaked) {
                to[lane] = 1.0;
            }
        }
        bundle.columns = columns;
        bundle
    }

    /// Bundles of columns one after another, each of one place: that of its lattice.
    pub fn of(columns: Vec<Optics>, places: &[usize]) -> Vec<(usize, Self)> {
        let mut columns = columns.into_iter();
        let alike = places.chunk_by(|a, b| a == b).flat_map(|alike| alike.chunks(LANES));
        alike.map(|some| (some[0], Self::new(columns.by_ref().take(some.len()).collect()))).collect()
    }

    /// What each column has of something.
    pub fn each(&self, mut of: impl FnMut(&Optics) -> f64) -> Lanes {
        let mut lanes = [0.0; LANES];
        lanes.iter_mut().zip(&self.columns).for_each(|(lane, column)| *lane = of(column));
        lanes
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
        // P_l at the angles, row by row of l; the terms fall to nothing with χ.
        static POLYNOMIALS: LazyLock<Vec<Vec<f64>>> = LazyLock::new(|| {
            let cosines: Vec<f64> =
                (0..=Tail::STEPS).map(|i| (PI * (i as f64 / Tail::STEPS as f64).powi(2)).cos()).collect();
            let mut rows = vec![vec![1.0; cosines.len()], cosines.clone()];
            for l in 1..Tail::MOMENTS {
                let k = l as f64;
                let next = (cosines.iter().zip(&rows[l]).zip(&rows[l - 1]))
                    .map(|((cos, now), before)| ((2.0 * k + 1.0) * cos * now - k * before) / (k + 1.0));
                let next = next.collect();
                rows.push(next);
            }
            rows
        });
        let last = terms.iter().rposition(|term| term.abs() > 1e-12).unwrap_or(0);
        let mut values = vec![0.0; Self::STEPS + 1];
        for (term, row) in terms[..=last].iter().zip(POLYNOMIALS.iter()) {
            values.iter_mut().zip(row).for_each(|(sum, p)| *sum += term * p);
        }
        Some(Self { values })
    }

    /// Where a scattering angle stands among the values.
    fn place(cos: f64) -> f64 {
        (cos.clamp(-1.0, 1.0).acos() / PI).sqrt() * Self::STEPS as f64
    }

    fn at(&self, place: f64) -> f64 {
        let i = (place as usize).min(Self::STEPS - 1);
        self.values[i] + (self.values[i + 1] - self.values[i]) * (place - i as f64)
    }
}

/// A direction of light: cos Θ of the scattering angle and cos Δφ of the azimuth between it and that of the beam.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn {
    pub cos_scattering: f64,
    cos_azimuth: f64,
    /// In a [`Tail`].
    place: f64,
}

impl Turn {
    pub fn new(cos_scattering: f64, azimuth: f64) -> Self {
        Self { cos_scattering, cos_azimuth: azimuth.cos(), place: Tail::place(cos_scattering) }
    }
}

/// The parts of each layer, and where the solver knows the field.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    /// Heights of edges and middles \[m\], from the top down: what the parts see of the sun.
    pub levels: Vec<f64>,
    /// Layer of each part.
    layer_of: Vec<usize>,
    /// The row of the field at each edge; a part whose middle has one between its edges' skips one.
    rows: Vec<usize>,
    /// First part of each layer.
    first: Vec<usize>,
}

impl Lattice {
    pub fn new(shells: &Shells, optics: &Optics) -> Self {
        let mut lattice = Self { levels: vec![shells.top()], layer_of: Vec::new(), rows: vec![0], first: Vec::new() };
        for (i, layer) in optics.layers.iter().enumerate() {
            lattice.first.push(lattice.layer_of.len());
            let (top, bottom) = (shells.heights[i], shells.heights[i + 1]);
            let Cut { parts, middles } = layer.cut;
            for part in 0..parts {
                let at = |half: usize| top + (bottom - top) * half as f64 / (2 * parts) as f64;
                lattice.levels.extend([at(2 * part + 1), at(2 * part + 2)]);
                lattice.rows.push(lattice.rows[lattice.layer_of.len()] + 1 + usize::from(middles));
                lattice.layer_of.push(i);
            }
        }
        lattice
    }

    /// Whether another column is cut alike.
    pub fn serves(&self, optics: &Optics) -> bool {
        let ends = self.first.iter().skip(1).copied().chain([self.layer_of.len()]);
        self.first.len() == optics.layers.len()
            && (self.first.iter().zip(ends).zip(&optics.layers))
                .all(|((a, b), layer)| Cut { parts: b - a, middles: self.has_middle(*a) } == layer.cut)
    }

    /// Whether the field is known in the middle of a part.
    fn has_middle(&self, part: usize) -> bool {
        self.rows[part + 1] - self.rows[part] == 2
    }

    /// Where a part begins: its first level, and its first row of the field.
    pub fn starts_at(&self, part: usize) -> (usize, usize) {
        (2 * part, self.rows[part])
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

/// Suns beside the site's, to which depths are known from every level: between these, a parabola. The higher a level, the
/// farther from the site a ray meets it.
#[derive(Debug)]
struct Offsets {
    /// \[deg\]
    step: f64,
    /// By level: where its row begins, and its suns to each side of the site's own.
    rows: Vec<(usize, usize)>,
}

impl Offsets {
    fn new(shells: &Shells, lattice: &Lattice, zenith: f64) -> Self {
        let step = if zenith < 70f64.to_radians() { 2.0 } else { 1.0 };
        let mut rows = Vec::with_capacity(lattice.levels.len() + 1);
        let mut start = 0;
        for height in &lattice.levels {
            let farthest = shells.farthest(*height).to_degrees();
            let reach = if shells.is_round() { (1.05 * farthest / step).ceil() as usize + 1 } else { 0 };
            rows.push((start, reach));
            start += 2 * reach + 1;
        }
        Self { step, rows }
    }

    /// Of a level: steps from the site's own sun.
    fn of(&self, level: usize) -> impl Iterator<Item = f64> + use<> {
        let (reach, step) = (self.rows[level].1 as i32, self.step);
        (-reach..=reach).map(move |i| step * f64::from(i))
    }

    /// Where the site's own sun stands.
    fn own(&self, level: usize) -> usize {
        self.rows[level].0 + self.rows[level].1
    }
}

/// Path lengths from every level of a lattice to the sun, and to suns beside it.
#[derive(Clone, Debug)]
pub(crate) struct SunRays {
    /// True zenith angle at the site \[rad\].
    pub zenith: f64,
    offsets: Arc<Offsets>,
    /// By level and offset: lengths in the layers \[m\], or nothing where the Earth is in the way.
    lengths: Vec<Option<Vec<f64>>>,
}

/// Lengths to the sun from each level, its zenith angle being \[rad\].
fn to_sun(shells: &Shells, lattice: &Lattice, zenith: f64) -> Vec<Option<Vec<f64>>> {
    lattice.levels.iter().map(|height| shells.towards_sun(*height, zenith)).collect()
}

/// Optical depth of those lengths, each layer by its extinction \[m⁻¹\].
#[inline(always)]
fn depth_along(lengths: &Option<Vec<f64>>, extinction: &[f64]) -> f64 {
    lengths.as_ref().map_or(BLOCKED, |lengths| dot(lengths, extinction))
}

wide_too! {
    /// From each of several places.
    fn depths_along(lengths: &[Option<Vec<f64>>], extinction: &[f64]) -> Vec<f64> {
        let mut depths = Vec::with_capacity(lengths.len());
        for lengths in lengths {
            depths.push(depth_along(lengths, extinction));
        }
        depths
    }
}

wide_too! {
    /// The same of several columns.
    fn depths_abreast(lengths: &[Option<&[f64]>], extinction: &[Lanes]) -> Vec<Lanes> {
        let mut depths = Vec::with_capacity(lengths.len());
        for lengths in lengths {
            let Some(lengths) = lengths else {
                depths.push([BLOCKED; LANES]);
                continue;
            };
            // Two sums side by side.
            let mut sums = [[0.0; LANES]; 2];
            for (lengths, extinction) in lengths.chunks(2).zip(extinction.chunks(2)) {
                for (sum, (length, extinction)) in sums.iter_mut().zip(lengths.iter().zip(extinction)) {
                    for lane in 0..LANES {
                        sum[lane] += length * extinction[lane];
                    }
                }
            }
            depths.push(std::array::from_fn(|lane| sums[0][lane] + sums[1][lane]));
        }
        depths
    }
}

impl SunRays {
    pub fn new(shells: &Shells, lattice: &Lattice, zenith: f64) -> Self {
        let offsets = Offsets::new(shells, lattice, zenith);
        let mut lengths = Vec::new();
        for (level, height) in lattice.levels.iter().enumerate() {
            let mut lift = 0.0;
            for offset in offsets.of(level) {
                let zenith = (zenith + offset.to_radians()).abs().min(PI);
                let mut towards = shells.towards_sun_lifted(*height, zenith, &mut lift);
                if let Some(lengths) = &mut towards {
                    // Layers below the ray.
                    let crossed = lengths.iter().rposition(|length| *length > 0.0).map_or(0, |last| last + 1);
                    lengths.truncate(crossed);
                }
                lengths.push(towards);
            }
        }
        Self { zenith, offsets: Arc::new(offsets), lengths }
    }

    /// Transmittance of the beam to the ground, by an extinction per layer \[m⁻¹\].
    pub fn to_ground(&self, extinction: &[f64]) -> f64 {
        let ground = self.offsets.rows.len() - 1;
        (-depth_along(&self.lengths[self.offsets.own(ground)], extinction)).exp()
    }

    /// Scaled optical depths towards the sun, and those of the peaked scatterers.
    pub fn depths(&self, bundle: &Bundle) -> SunDepths {
        let mut tail = Vec::new();
        if bundle.twice {
            let own = |level| self.lengths[self.offsets.own(level)].as_deref();
            tail = depths_abreast(&(0..self.offsets.rows.len()).map(own).collect::<Vec<_>>(), &bundle.tail);
            tail.as_flattened_mut().iter_mut().for_each(|depth| *depth = depth.min(1e3));
        }
        let all: Vec<_> = self.lengths.iter().map(Option::as_deref).collect();
        let depths = depths_abreast(&all, &bundle.scaled);
        let flat = depths.len() == self.offsets.rows.len();
        let through =
            if flat { depths.iter().map(|lanes| lanes.map(|depth| exp(-depth))).collect() } else { Vec::new() };
        let blocked = depths.iter().map(|lanes| lanes.iter().any(|depth| *depth >= BLOCKED)).collect();
        SunDepths { offsets: Arc::clone(&self.offsets), from: 0, depths, blocked, through, tail }
    }
}

/// An optical depth that nothing gets through.
const BLOCKED: f64 = 1e4;

/// Scaled optical depths from the levels of a lattice to the sun.
#[derive(Clone, Debug)]
pub(crate) struct SunDepths {
    offsets: Arc<Offsets>,
    /// Of the levels from this one down.
    from: usize,
    depths: Vec<Lanes>,
    /// Where in any lane nothing gets through.
    blocked: Vec<bool>,
    /// What comes through to each level, on a flat Earth, where all rays meet a level at one depth.
    through: Vec<Lanes>,
    /// Scattering optical depths of the peaked scatterers, by level; empty without.
    tail: Vec<Lanes>,
}

impl SunDepths {
    /// Those of the levels from one down.
    pub fn below(&self, level: usize) -> Self {
        Self {
            offsets: Arc::clone(&self.offsets),
            from: level,
            depths: self.depths[self.offsets.rows[level].0..].to_vec(),
            blocked: self.blocked[self.offsets.rows[level].0..].to_vec(),
            through: self.through.iter().skip(level).copied().collect(),
            tail: self.tail.iter().skip(level).copied().collect(),
        }
    }

    /// At a point of a ray for the sun that stands over it: by a parabola between the suns of each level.
    #[inline(always)]
    fn at(&self, looked_up: &[SunAt]) -> Lanes {
        let mut sum = [0.0; LANES];
        let last = self.depths.len() - 1;
        for sun in looked_up {
            let places = [0, 1, 2].map(|i| (sun.first as usize + i).min(last));
            let [a, b, c] = places.map(|place| &self.depths[place]);
            if places.iter().any(|place| self.blocked[*place]) {
                // Beside the shadow of the Earth: the nearest.
                let nearest = &self.depths[places[usize::from(sun.nearest)]];
                for lane in 0..LANES {
                    let between = sun.shares[0] * a[lane] + sun.shares[1] * b[lane] + sun.shares[2] * c[lane];
                    let lit = a[lane].max(b[lane]).max(c[lane]) < BLOCKED;
                    sum[lane] += if lit { between } else { sun.level_share * nearest[lane] };
                }
                continue;
            }
            for lane in 0..LANES {
                sum[lane] += sun.shares[0] * a[lane] + sun.shares[1] * b[lane] + sun.shares[2] * c[lane];
            }
        }
        for depth in &mut sum {
            *depth = if *depth > 0.0 { *depth } else { 0.0 };
        }
        sum
    }

    #[inline(always)]
    fn tail_at(&self, point: &Point) -> Lanes {
        let mut sum = [0.0; LANES];
        for (level, share) in point.levels.iter() {
            let tail = &self.tail[level.saturating_sub(self.from)];
            for lane in 0..LANES {
                sum[lane] += share * tail[lane];
            }
        }
        sum
    }
}

/// Zenith angles of the suns that fields are solved for \[deg\]: on a round Earth a fixed row of them, so that an answer
/// does not depend on what other suns were asked for; on a flat one each sun's own.
fn field_zenith(i: usize) -> f64 {
    match i {
        0..=2 => 5.0 * i as f64,
        3..=6 => 10.0 + 10.0 * (i - 2) as f64,
        7..=9 => 50.0 + 5.0 * (i - 6) as f64,
        _ => 65.0 + 2.5 * (i - 9) as f64,
    }
}
const FIELD_ZENITHS: usize = 26;
/// Fields are looked up for suns at most this far from the site's \[deg\].
const FIELD_REACH: f64 = 4.0;

/// First of four nodes about a zenith angle \[deg\], and their shares in a cubic.
fn field_shares(zenith: f64) -> (usize, [f64; 4]) {
    let above = (0..FIELD_ZENITHS).find(|i| field_zenith(*i) > zenith).unwrap_or(FIELD_ZENITHS - 1);
    let first = above.clamp(2, FIELD_ZENITHS - 2) - 2;
    let nodes: [f64; 4] = std::array::from_fn(|k| field_zenith(first + k));
    let share =
        |k: usize| -> f64 { (0..4).filter(|j| *j != k).map(|j| (zenith - nodes[j]) / (nodes[k] - nodes[j])).product() };
    (first, std::array::from_fn(share))
}

/// The suns that fields are solved for under some suns, and their rays on a lattice.
#[derive(Clone, Debug)]
pub(crate) struct FieldSuns {
    /// Zenith angles \[rad\].
    zeniths: Vec<f64>,
    /// Place of a node of the fixed row among these.
    places: Vec<Option<usize>>,
    /// Lengths from the edges of the parts.
    lengths: Vec<Vec<Option<Vec<f64>>>>,
}

impl FieldSuns {
    /// On a flat Earth, or where `exact`, the suns themselves.
    pub fn new(shells: &Shells, lattice: &Lattice, suns: &[f64], exact: bool) -> Self {
        let mut places = vec![None; FIELD_ZENITHS];
        let zeniths: Vec<f64> = match shells.is_round() && !exact {
            true => {
                let mut wanted = [false; FIELD_ZENITHS];
                for sun in suns {
                    let (from, _) = field_shares((sun.to_degrees() - FIELD_REACH).max(0.0));
                    let (to, _) = field_shares(sun.to_degrees() + FIELD_REACH);
                    wanted[from..to + 4].fill(true);
                }
                let nodes = (0..FIELD_ZENITHS).filter(|i| wanted[*i]);
                nodes.clone().enumerate().for_each(|(place, node)| places[node] = Some(place));
                nodes.map(|i| field_zenith(i).to_radians()).collect()
            }
            false => suns.to_vec(),
        };
        let edges = Lattice { levels: lattice.levels.iter().step_by(2).copied().collect(), ..lattice.clone() };
        let lengths = zeniths.iter().map(|zenith| to_sun(shells, &edges, *zenith)).collect();
        Self { zeniths, places, lengths }
    }

    fn beams(&self, optics: &Optics) -> Vec<Beam> {
        let transmittance =
            |lengths: &Vec<_>| depths_along(lengths, &optics.scaled).into_iter().map(|depth| exp(-depth)).collect();
        let beams = self.zeniths.iter().zip(&self.lengths);
        beams.map(|(zenith, l)| Beam { cosine: zenith.cos(), transmittance: transmittance(l) }).collect()
    }

    /// Whether fields stand for suns of a fixed row, not for the site's own.
    fn are_spread(&self) -> bool {
        self.places.iter().any(Option::is_some)
    }

    /// Whether the fields change along a ray by more than that of one place can stand for.
    pub fn draws_by_place(&self, sight: &Sight) -> bool {
        self.are_spread() && sight.is_flat()
    }

    /// T′ of each beam at the ground.
    pub fn to_ground(&self, optics: &Optics) -> Vec<f64> {
        let last = |lengths: &Vec<Option<Vec<f64>>>| (-depth_along(&lengths[lengths.len() - 1], &optics.scaled)).exp();
        self.lengths.iter().map(last).collect()
    }

    /// First field and shares for a sun of zenith angle \[rad\], the `index`th of the site, seen `offset` \[deg\] beside it.
    fn shares(&self, index: usize, zenith: f64, offset: f64) -> (usize, [f64; 4]) {
        if !self.are_spread() {
            return (index, [1.0, 0.0, 0.0, 0.0]);
        }
        let at = (zenith.to_degrees() + offset.clamp(-FIELD_REACH, FIELD_REACH)).max(0.0);
        let (node, shares) = field_shares(at);
        (self.places[node].expect("nodes about every sun were chosen"), shares)
    }

    /// The diffuse irradiance at the ground of a sun of the site itself.
    pub fn ground_flux(&self, fields: &[Field], index: usize, zenith: f64) -> f64 {
        let (from, shares) = self.shares(index, zenith, 0.0);
        fields[from..].iter().zip(shares).map(|(field, share)| share * field.arrives).sum::<f64>().max(0.0)
    }

    /// The field of a sun of the site itself from a row down, from those that were solved.
    pub fn field_of(&self, fields: &[Field], index: usize, zenith: f64, row: usize) -> Field {
        let (from, shares) = self.shares(index, zenith, 0.0);
        let used = &fields[from..(from + 4).min(fields.len())];
        Field::mixed(used, &shares[..used.len()], row)
    }
}

/// Up to three places in a row and their shares.
#[derive(Clone, Copy, Debug, Default)]
struct Among {
    places: [(usize, f64); 3],
    used: usize,
}

impl Among {
    /// `at` beyond the first of a row, by a parabola through three or a straight line between two.
    fn new(first: usize, at: f64, parabola: bool) -> Self {
        let nearest = at.round();
        if (at - nearest).abs() < 1e-9 {
            return Self { places: [(first + nearest as usize, 1.0), (0, 0.0), (0, 0.0)], used: 1 };
        }
        if !parabola {
            return Self { places: [(first, 1.0 - at), (first + 1, at), (0, 0.0)], used: 2 };
        }
        let t = at - 1.0;
        let shares = [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)];
        Self { places: std::array::from_fn(|k| (first + k, shares[k])), used: 3 }
    }

    fn iter(&self) -> impl Iterator<Item = (usize, f64)> {
        self.places[..self.used].iter().copied()
    }
}

/// A point of a ray.
#[derive(Clone, Debug)]
struct Point {
    /// Among the levels of the lattice.
    levels: Among,
    /// Among the rows of the field; none where the ends of the piece tell J.
    rows: Among,
    /// Cosine of the ray's zenith angle.
    cosine: f64,
    /// Angle at the Earth's centre from the site \[rad\].
    centre: f64,
}

/// Which end of a ray looks at the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// From the lower end: light comes down.
    Up,
    /// From the upper end: light goes up.
    Down,
}

/// A ray through a lattice, from whoever looks.
#[derive(Clone, Debug)]
pub(crate) struct Sight {
    /// What it crosses of the parts.
    pieces: Vec<Piece>,
    /// Between the points \[m\].
    lengths: Vec<f64>,
    points: Vec<Point>,
    /// Λ_l^m of the light's direction at each point, orders one after another; one set where the ray is straight.
    legendre: Vec<Vec<f64>>,
    streams: usize,
}

/// What a ray crosses of one part.
#[derive(Clone, Copy, Debug)]
struct Piece {
    layer: usize,
    /// Its points: this one, and as many more as it has steps, one or two. Two meet in its middle.
    first: usize,
    steps: usize,
    /// Whether J is a parabola within, not a straight line.
    parabola: bool,
}

impl Piece {
    fn last(&self) -> usize {
        self.first + self.steps
    }
}

/// Cosines that differ by less count as one.
const STRAIGHT: f64 = 1e-4;

impl Sight {
    /// A ray that rises from a height at a zenith angle 0..π/2 to a height or a length \[m\], whichever comes first; with the
    /// Legendre functions of so many orders.
    pub fn new(
        shells: &Shells,
        lattice: &Lattice,
        look: Look,
        (from, zenith): (f64, f64),
        (end, longest): (f64, f64),
        streams: usize,
        orders: usize,
    ) -> Self {
        let (mut pieces, mut lengths, mut points) = (Vec::<Piece>::new(), Vec::new(), Vec::<Point>::new());
        let mut rest = longest;
        'ray: for stretch in shells.rising(from, zenith, end) {
            for part in lattice.parts(stretch.layer) {
                let (top, bottom) = (lattice.levels[2 * part], lattice.levels[2 * part + 2]);
                let parabola = lattice.has_middle(part);
                let lowest = part + 1 == lattice.layer_of.len(); // goes on below the ground
                let low = if lowest { stretch.low } else { stretch.low.max(bottom) };
                let mut high = stretch.high.min(top);
                if high <= low {
                    continue;
                }
                let whole = shells.length(&stretch, high) - shells.length(&stretch, low);
                if whole > rest {
                    // Where the length runs out, to first order in what is left.
                    high = low + (high - low) * rest / whole;
                }
                // On a flat Earth the middle tells nothing of the sun that the ends do not.
                let steps = if parabola || shells.is_round() { 2 } else { 1 };
                let at = |step: usize| low + (high - low) * (step as f64 / steps as f64);
                for step in usize::from(!points.is_empty())..=steps {
                    let mut point = Point::new(shells, &stretch, lattice, part, at(step));
                    if step == 1 && steps == 2 && !parabola {
                        point.rows = Among::default();
                    }
                    points.push(point);
                }
                pieces.push(Piece { layer: stretch.layer, first: 0, steps, parabola });
                let along = (0..=steps).map(|step| shells.length(&stretch, at(step))).collect::<Vec<f64>>();
                lengths.extend(along.windows(2).map(|ends| ends[1] - ends[0]));
                rest -= whole;
                if rest <= 0.0 {
                    break 'ray;
                }
            }
        }
        if look == Look::Down {
            pieces.reverse();
            lengths.reverse();
            points.reverse();
        }
        let mut first = 0;
        for piece in &mut pieces {
            (piece.first, first) = (first, first + piece.steps);
        }
        let table = |cosine: f64| {
            let mu = if look == Look::Up { -cosine } else { cosine };
            let mut rows = Vec::with_capacity(orders * streams);
            for m in 0..orders {
                let from = rows.len();
                rows.resize(from + streams - m, 0.0);
                normalised(m, mu, &mut rows[from..]);
            }
            rows
        };
        let cosines = || points.iter().map(|point| point.cosine);
        let (low, high) = cosines().fold((f64::INFINITY, 0.0), |(a, b), c| (f64::min(a, c), f64::max(b, c)));
        let legendre = match high - low < STRAIGHT {
            true => vec![table(0.5 * (low + high))],
            false => cosines().map(table).collect(),
        };
        Self { pieces, lengths, points, legendre, streams }
    }

    /// Whether the sun changes along the ray by more than the sun of one place can stand for.
    pub fn is_flat(&self) -> bool {
        self.points.first().is_some_and(|point| point.cosine < FLAT)
    }

    fn legendre(&self, point: usize) -> &[f64] {
        if self.legendre.len() == 1 { &self.legendre[0] } else { &self.legendre[point] }
    }
}

impl Point {
    fn new(shells: &Shells, stretch: &Stretch, lattice: &Lattice, part: usize, height: f64) -> Self {
        let (top, bottom) = (lattice.levels[2 * part], lattice.levels[2 * part + 2]);
        let place = (2.0 * (top - height) / (top - bottom)).clamp(0.0, 2.0);
        let levels = Among::new(2 * part, place, true);
        let rows = match lattice.has_middle(part) {
            true => Among::new(lattice.rows[part], place, true),
            false => Among::new(lattice.rows[part], 0.5 * place, false),
        };
        Self { levels, rows, cosine: shells.cosine(stretch, height), centre: shells.centre(stretch, height) }
    }
}

/// The sun over a point of a ray at a level of the lattice: the first of three suns beside it to which depths are known, and
/// their shares.
#[derive(Clone, Copy, Debug, Default)]
struct SunAt {
    shares: [f64; 3],
    first: u32,
    /// Which of the three is the nearest.
    nearest: u8,
    /// The share of the level, which those of the suns add up to.
    level_share: f64,
}

impl SunAt {
    /// For a sun `steps` beside the site's own, in depths from the level `from` down.
    fn new(offsets: &Offsets, from: usize, (level, level_share): (usize, f64), steps: f64) -> Self {
        let (start, reach) = offsets.rows[level.max(from)];
        let start = start - offsets.rows[from].0;
        if reach == 0 {
            return Self { first: start as u32, shares: [level_share, 0.0, 0.0], nearest: 0, level_share };
        }
        let middle = (steps.round() as i32).clamp(1 - reach as i32, reach as i32 - 1);
        let t = steps - f64::from(middle);
        let nearest = if t < -0.5 { 0 } else { 1 + u8::from(t > 0.5) };
        let shares = [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)].map(|share| level_share * share);
        Self { first: (start as i32 + reach as i32 + middle - 1) as u32, shares, nearest, level_share }
    }
}

/// Where a sun's fields stand, and their shares in a cubic.
type FieldShares = (usize, [f64; 4]);

/// The suns over the points of a ray at some azimuths from the sun's.
#[derive(Clone, Debug)]
pub(crate) struct Fan {
    /// By azimuth, point and level that a point draws on.
    suns: Vec<SunAt>,
    azimuths: usize,
    /// At each azimuth: for points of angles at the Earth's centre k `PLACE`.
    fields: Vec<[FieldShares; PLACES]>,
}

/// Angles at the Earth's centre \[rad\] for which fields are looked up; light from between them is shared out to both.
const PLACE: f64 = 0.01;
const PLACES: usize = 17;

/// The place before an angle at the Earth's centre \[rad\], and the share of the next.
fn place(centre: f64) -> (usize, f64) {
    let x = (centre / PLACE).clamp(0.0, (PLACES - 1) as f64);
    let i = (x as usize).min(PLACES - 2);
    (i, x - i as f64)
}

impl Fan {
    /// Field and shares at an azimuth for light from an angle at the Earth's centre \[rad\].
    fn mean(&self, azimuth: usize, centre: f64) -> FieldShares {
        let (i, t) = place(centre);
        let ((a, near), (b, far)) = (self.fields[azimuth][i], self.fields[azimuth][i + 1]);
        if a != b {
            return if t < 0.5 { (a, near) } else { (b, far) };
        }
        (a, std::array::from_fn(|k| near[k] + (far[k] - near[k]) * t))
    }
}

impl Fan {
    /// For the `index`th sun of the site, at azimuths of the rising ray from its own \[rad\]; 0 rises towards the sun.
    pub fn new(sight: &Sight, rays: &SunRays, fields: &FieldSuns, index: usize, azimuths: &[f64]) -> Self {
        Self::over(sight, rays.zenith, (&rays.offsets, 0), fields, index, azimuths)
    }

    fn over(
        sight: &Sight,
        zenith: f64,
        (offsets, from): (&Offsets, usize),
        fields: &FieldSuns,
        index: usize,
        azimuths: &[f64],
    ) -> Self {
        let (cos_sun, sin_sun) = (zenith.cos(), zenith.sin());
        let round = offsets.rows[0].1 > 0;
        let offset_at = |centre: f64, azimuth: f64| {
            if centre == 0.0 || !round {
                return 0.0;
            }
            let (sin, cos) = centre.sin_cos();
            let cosine = cos_sun * cos + sin_sun * sin * azimuth.cos();
            (cosine.clamp(-1.0, 1.0).acos() - zenith).to_degrees()
        };
        let mut fan = Self {
            suns: Vec::with_capacity(azimuths.len() * sight.points.len()),
            azimuths: azimuths.len(),
            fields: Vec::with_capacity(azimuths.len()),
        };
        for azimuth in azimuths {
            let at = |k: usize| fields.shares(index, zenith, offset_at(PLACE * k as f64, *azimuth));
            fan.fields.push(std::array::from_fn(at));
            for point in &sight.points {
                let steps = offset_at(point.centre, *azimuth) / offsets.step;
                fan.suns.extend(point.levels.iter().map(|level| SunAt::new(offsets, from, level, steps)));
            }
        }
        fan
    }
}

impl Fan {
    /// For one sun whose field stands alone.
    pub fn alone(sight: &Sight, zenith: f64, depths: &SunDepths, azimuth: f64) -> Self {
        let fields = FieldSuns { zeniths: Vec::new(), places: Vec::new(), lengths: Vec::new() };
        Self::over(sight, zenith, (&depths.offsets, depths.from), &fields, 0, &[azimuth])
    }
}

/// A ray through a column at one entry: what the points count for, whatever the sun.
#[derive(Clone, Debug, Default)]
pub(crate) struct Weighed {
    /// Scaled optical depth to each point.
    passed: Vec<f64>,
    /// The first row of a field that it draws on, and how far along the ray each is: the angle at the Earth's centre \[rad\].
    first: usize,
    centres: Vec<f64>,
    /// What c_l^m counts for, by m, level and l, at the levels where fields have it; of so many orders.
    kernel: Vec<Vec<f64>>,
    orders: usize,
    /// Where light is told apart by the place it comes from: the place before each level, and the share of the next.
    places: Vec<(usize, f64)>,
    /// Between the points: half of what peaked scatterers scatter \[m⁻¹\], and q_ray.
    tail: (Vec<f64>, Vec<f64>),
}

impl Weighed {
    /// For fields that begin at these levels, order by order; with light told apart by place where wanted.
    pub fn new(optics: &Optics, sight: &Sight, starts: &[usize], by_place: bool) -> Self {
        let mut weighed = Self::default();
        weighed.weigh(optics, sight, starts, by_place);
        weighed
    }

    /// The same in the place of an earlier ray.
    pub fn weigh(&mut self, optics: &Optics, sight: &Sight, starts: &[usize], by_place: bool) {
        let n = sight.points.len();
        let streams = optics.streams; // no more than the ray has
        let Self { passed, tail, .. } = self;
        passed.clear();
        passed.resize(n, 0.0);
        // What c_l^m Λ_l^m counts for, by point and l.
        let mut coefficients = vec![0.0; n * streams];
        tail.0.clear();
        tail.1.clear();
        let mut tail_passed = 0.0;
        for piece in &sight.pieces {
            let Piece { layer, first, .. } = *piece;
            let mut depths = [0.0; 2];
            for (depth, step) in depths.iter_mut().zip(first..piece.last()) {
                let length = sight.lengths[step];
                *depth = length * optics.scaled[layer];
                passed[step + 1] = passed[step] + *depth;
                let own = optics.tail[layer] * length;
                tail.0.push(0.5 * optics.tail[layer]);
                tail.1.push(tail_passed + 0.5 * own);
                tail_passed += own;
            }
            let (so_far, depth) = (passed[first], depths[0] + depths[1]);
            if depth <= 0.0 || so_far > 700.0 {
                continue;
            }
            let transmitted = (-so_far).exp() * depth;
            let mut draw = |point: usize, weight: f64| {
                let row = &mut coefficients[point * streams..][..streams];
                row.iter_mut().zip(&optics.layers[layer].coupling).for_each(|(k, c)| *k += weight * transmitted * c);
            };
            let [near, middle, far] = parabola(depth, if piece.steps == 2 { depths[0] / depth } else { 0.5 });
            if piece.parabola {
                draw(first, near);
                draw(first + 1, middle);
                draw(piece.last(), far);
            } else {
                // Halfway between the ends in height J is their mean.
                draw(first, near + 0.5 * middle);
                draw(piece.last(), far + 0.5 * middle);
            }
        }
        let levels = || sight.points.iter().flat_map(|point| point.rows.iter()).map(|(level, _)| level);
        let (lowest, last) = levels().fold((usize::MAX, 0), |(a, b), level| (a.min(level), b.max(level)));
        let count = if n == 0 { 0 } else { last - lowest + 1 };
        self.first = lowest;
        self.centres.clear();
        self.centres.resize(count, 0.0);
        // The ray meets most levels once.
        let mut met = vec![false; count];
        let mut meetings = Vec::with_capacity(n);
        for (i, point) in sight.points.iter().enumerate() {
            for (level, share) in point.rows.iter() {
                let level = level - lowest;
                self.centres[level] = point.centre;
                meetings.push(Meeting { point: i, level, share, first: !std::mem::replace(&mut met[level], true) });
            }
        }
        let orders = sight.legendre.first().map_or(0, |rows| orders_in(rows.len(), sight.streams)).min(starts.len());
        self.orders = orders;
        self.kernel.resize_with(orders.max(self.kernel.len()), Vec::new);
        self.places.clear();
        if by_place {
            self.places.extend(self.centres.iter().map(|centre| place(*centre)));
        }
        let mut from = 0;
        for (m, kernel) in self.kernel[..orders].iter_mut().enumerate() {
            let width = streams - m;
            let start = starts[m].saturating_sub(lowest).min(count);
            kernel.resize(count * width, 0.0);
            for level in (start..count).filter(|level| !met[*level]) {
                kernel[level * width..][..width].fill(0.0);
            }
            weigh_order(kernel, &meetings, &coefficients, &Window { streams, m, from, start }, sight);
            from += sight.streams - m;
        }
    }

    /// How many of its first levels a field lacks at an order; the kernel and the moments at those that both have.
    #[inline(always)]
    fn beside<'a>(&'a self, field: &'a Field, m: usize) -> (usize, [&'a [f64]; 2]) {
        let (kernel, levels) = (&self.kernel[m], self.centres.len());
        let (first, rows) = field.order(m);
        let width = kernel.len() / levels.max(1);
        let lacks = first.saturating_sub(self.first).min(levels);
        let from = (self.first + lacks).saturating_sub(first);
        (lacks, [&kernel[lacks * width..], &rows[from * width..][..(levels - lacks) * width]])
    }

    /// Orders that both have.
    fn orders_of(&self, field: &Field) -> usize {
        field.orders().min(self.orders)
    }

    /// Scaled transmittance of the whole ray.
    pub fn transmittance(&self) -> f64 {
        self.passed.last().map_or(1.0, |depth| (-depth).exp())
    }
}

/// A point of a ray at a level of the lattice.
struct Meeting {
    point: usize,
    level: usize,
    share: f64,
    /// Whether no point before it meets the level.
    first: bool,
}

/// An order m of so many streams, whose Legendre functions begin here; fields have it from a level on.
struct Window {
    streams: usize,
    m: usize,
    from: usize,
    start: usize,
}

wide_too! {
    /// The kernel of one order, from what the points count for, by `streams` each.
    fn weigh_order(kernel: &mut [f64], meetings: &[Meeting], coefficients: &[f64], order: &Window, sight: &Sight) {
        let Window { streams, m, from, start } = *order;
        let width = streams - m;
        for meeting in meetings.iter().filter(|meeting| meeting.level >= start) {
            let row = &mut kernel[meeting.level * width..][..width];
            let coefficients = &coefficients[meeting.point * streams + m..][..width];
            let legendre = &sight.legendre(meeting.point)[from..][..width];
            if meeting.first {
                for l in 0..width {
                    row[l] = meeting.share * coefficients[l] * legendre[l];
                }
            } else {
                for l in 0..width {
                    row[l] += meeting.share * coefficients[l] * legendre[l];
                }
            }
        }
    }
}

wide_too! {
    /// What rays draw from the fields of the column in a lane, by ray and field, in the place of what they drew before;
    /// columns come in the order of their lanes.
    pub(crate) fn project(rays: &[Weighed], fields: &[Field], lane: usize, out: &mut Vec<Vec<Projected>>) {
        out.resize_with(rays.len(), Vec::new);
        for out in out.iter_mut() {
            out.resize_with(fields.len(), Projected::default);
            if lane == 0 {
                out.iter_mut().for_each(Projected::clear);
            }
        }
        let mut whole: Vec<usize> = Vec::with_capacity(rays.len());
        for (r, ray) in rays.iter().enumerate() {
            if ray.places.is_empty() {
                whole.push(r);
                continue;
            }
            for (fields, out) in fields.chunks(4).zip(out[r].chunks_mut(4)) {
                if let (Ok(fields), Ok(out)) = (<&[Field; 4]>::try_from(fields), <&mut [Projected; 4]>::try_from(&mut *out)) {
                    by_place(ray, fields.each_ref(), lane, out.each_mut());
                } else {
                    fields.iter().zip(out).for_each(|(field, out)| by_place(ray, [field], lane, [out]));
                }
            }
        }
        // Four rays and two fields at a time, which share what is read.
        for some in whole.chunks(4) {
            for (f, pair) in fields.chunks(2).enumerate() {
                match (some, pair) {
                    (&[a, b, c, d], [first, second]) => block([a, b, c, d], rays, [first, second], (2 * f, lane), out),
                    (&[a, b, c, d], [only]) => block([a, b, c, d], rays, [only], (2 * f, lane), out),
                    _ => some.iter().for_each(|r| {
                        (pair.iter().enumerate()).for_each(|(i, field)| block([*r], rays, [field], (2 * f + i, lane), out));
                    }),
                }
            }
        }
        for r in whole {
            for (fields, out) in fields.chunks(4).zip(out[r].chunks_mut(4)) {
                if let Ok(fields) = <&[Field; 4]>::try_from(fields) {
                    let centres = centres(&rays[r], fields.each_ref());
                    out.iter_mut().zip(centres).for_each(|(out, centre)| out.centre[lane] = centre);
                } else {
                    out.iter_mut().zip(fields).for_each(|(out, field)| [out.centre[lane]] = centres(&rays[r], [field]));
                }
            }
        }
    }
}

/// What some rays draw from some fields of the column in a lane, of which the first is the `f`th.
#[inline(always)]
fn block<const R: usize, const F: usize>(
    of: [usize; R],
    rays: &[Weighed],
    fields: [&Field; F],
    (f, lane): (usize, usize),
    out: &mut [Vec<Projected>],
) {
    let orders = |r: usize, field: &Field| rays[of[r]].orders_of(field);
    let most = (0..R).flat_map(|r| fields.iter().map(move |field| orders(r, field))).max().unwrap_or(0);
    let like = |r: usize| (rays[of[r]].first, rays[of[r]].centres.len(), rays[of[r]].orders);
    let alike = (0..R).all(|r| like(r) == like(0));
    for m in 0..most {
        if alike && alike_at(&rays[of[0]], &fields, m) {
            let kernels = std::array::from_fn(|r| rays[of[r]].beside(fields[0], m).1[0]);
            let sums: [[f64; F]; R] = dots(kernels, fields.map(|field| rays[of[0]].beside(field, m).1[1]));
            for (sums, r) in sums.iter().zip(of) {
                sums.iter().enumerate().for_each(|(i, sum)| *out[r][f + i].order(m, lane) = *sum);
            }
            continue;
        }
        for r in 0..R {
            for (i, field) in fields.iter().enumerate().filter(|(_, field)| m < orders(r, field)) {
                let (_, [kernel, rows]) = rays[of[r]].beside(field, m);
                *out[of[r]][f + i].order(m, lane) = dot(kernel, rows);
            }
        }
    }
}

/// What a ray draws from some fields at an order, level by level.
#[inline(always)]
fn by_level<const F: usize>(ray: &Weighed, fields: [&Field; F], m: usize, mut each: impl FnMut(usize, [f64; F])) {
    let beside = fields.map(|field| ray.beside(field, m));
    let width = fields[0].order_width(m);
    let (lacks, [kernel, _]) = beside[0];
    for (level, kernel) in kernel.chunks_exact(width).enumerate() {
        let rows = beside.map(|(_, [_, rows])| &rows[level * width..][..width]);
        let [lights] = dots([kernel], rows);
        each(lacks + level, lights);
    }
}

/// Whether some fields have an order at the same levels.
#[inline(always)]
fn alike_at(ray: &Weighed, fields: &[&Field], m: usize) -> bool {
    fields.iter().all(|field| m < ray.orders_of(field) && field.order(m).0 == fields[0].order(m).0)
}

/// What a ray draws from some fields by order and place.
#[inline(always)]
fn by_place<const F: usize>(ray: &Weighed, fields: [&Field; F], lane: usize, mut out: [&mut Projected; F]) {
    let orders = fields.map(|field| ray.orders_of(field));
    let reach = ray.places.iter().map(|(place, _)| place + 2).max().unwrap_or(0);
    for (out, orders) in out.iter_mut().zip(orders) {
        out.reach = out.reach.max(reach);
        out.places.resize(orders.max(out.places.len()), [[0.0; LANES]; PLACES]);
    }
    for m in 0..orders.into_iter().max().unwrap_or(0) {
        if !alike_at(ray, &fields, m) {
            for f in (0..F).filter(|f| m < orders[*f]) {
                place_order(ray, [fields[f]], (m, lane), [&mut *out[f]]);
            }
            continue;
        }
        place_order(ray, fields, (m, lane), out.each_mut().map(|out| &mut **out));
    }
}

/// One order of it.
#[inline(always)]
fn place_order<const F: usize>(
    ray: &Weighed,
    fields: [&Field; F],
    (m, lane): (usize, usize),
    out: [&mut Projected; F],
) {
    let mut sums = [[0.0; F]; PLACES];
    by_level(ray, fields, m, |level, lights| {
        let (place, share) = ray.places[level];
        for f in 0..F {
            sums[place][f] += (1.0 - share) * lights[f];
            sums[place + 1][f] += share * lights[f];
        }
    });
    for (f, out) in out.into_iter().enumerate() {
        out.places[m].iter_mut().zip(&sums).for_each(|(place, sums)| place[lane] = sums[f]);
    }
}

/// Mean angle at the Earth's centre of where a ray draws light of the order 0 of each field from \[rad\].
#[inline(always)]
fn centres<const F: usize>(ray: &Weighed, fields: [&Field; F]) -> [f64; F] {
    let (mut light, mut moment) = ([0.0; F], [0.0; F]);
    if alike_at(ray, &fields, 0) && ray.centres.iter().any(|centre| *centre > 0.0) {
        by_level(ray, fields, 0, |level, lights| {
            for f in 0..F {
                light[f] += lights[f].abs();
                moment[f] += lights[f].abs() * ray.centres[level];
            }
        });
    }
    std::array::from_fn(|f| if light[f] > 0.0 { moment[f] / light[f] } else { 0.0 })
}

/// Orders of which a row of Legendre functions holds all degrees.
fn orders_in(length: usize, streams: usize) -> usize {
    (0..=streams).find(|m| (0..*m).map(|k| streams - k).sum::<usize>() >= length).unwrap_or(0)
}

/// What a ray draws from one field of each column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Projected {
    /// By order.
    orders: Vec<Lanes>,
    /// By order and place, where that was wanted instead; so many places have light.
    places: Vec<[Lanes; PLACES]>,
    reach: usize,
    /// Mean angle at the Earth's centre of where the light comes from \[rad\].
    centre: Lanes,
}

impl Projected {
    fn clear(&mut self) {
        self.orders.clear();
        self.places.clear();
        self.reach = 0;
        self.centre = [0.0; LANES];
    }

    /// That of an order.
    #[inline(always)]
    fn order(&mut self, m: usize, lane: usize) -> &mut f64 {
        if m >= self.orders.len() {
            self.orders.resize(m + 1, [0.0; LANES]);
        }
        &mut self.orders[m][lane]
    }
}

/// A ray flatter than this sees the sun change along its way \[cosine\]; for others the sun of the mean place serves.
const FLAT: f64 = 0.2;

/// Σ a b of each row of one kind with each of another, all of one length: every sum as four side by side.
#[inline(always)]
fn dots<const R: usize, const F: usize>(a: [&[f64]; R], b: [&[f64]; F]) -> [[f64; F]; R] {
    let n = a.iter().chain(&b).map(|row| row.len()).min().unwrap_or(0);
    let (a, b) = (a.map(|row| row[..n].as_chunks::<4>()), b.map(|row| row[..n].as_chunks::<4>()));
    let mut sums = [[[0.0; 4]; F]; R];
    for i in 0..n / 4 {
        for r in 0..R {
            let [w, x, y, z] = a[r].0[i];
            for f in 0..F {
                let (sum, b) = (&mut sums[r][f], b[f].0[i]);
                *sum = [sum[0] + w * b[0], sum[1] + x * b[1], sum[2] + y * b[2], sum[3] + z * b[3]];
            }
        }
    }
    let rest = |r: usize, f: usize| -> f64 { a[r].1.iter().zip(b[f].1).map(|(a, b)| a * b).sum() };
    std::array::from_fn(|r| {
        std::array::from_fn(|f| {
            let [w, x, y, z] = sums[r][f];
            (w + y) + (x + z) + rest(r, f)
        })
    })
}

/// Σ a b.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let [[sum]] = dots([a], [b]);
    sum
}

/// What a ray gathers at one azimuth: light scattered once by each phase function without its P(Θ), and light scattered
/// before by each order without its cos mΔφ; and the second order of the peaked ones without its K(Θ).
#[derive(Clone, Debug, Default)]
pub(crate) struct Gathered {
    pub once: Vec<Lanes>,
    pub orders: Vec<Lanes>,
    pub twice: Lanes,
}

impl Gathered {
    /// L at a scattering angle Θ and an azimuth Δφ \[rad\] between the directions in which beam and light travel.
    pub fn radiance(&self, bundle: &Bundle, cos_scattering: f64, azimuth: f64) -> Lanes {
        let [smooth, peaked] = self.parts(bundle, cos_scattering, azimuth);
        std::array::from_fn(|lane| (smooth[lane] + peaked[lane]).max(0.0))
    }

    /// L in two parts: what varies slowly over the sky, and what peaked scatterers make of the beam.
    pub fn parts(&self, bundle: &Bundle, cos_scattering: f64, azimuth: f64) -> [Lanes; 2] {
        let value = |phase: usize| {
            bundle.each(|column| column.phases.get(phase).map_or(0.0, |phase| phase.value(cos_scattering)))
        };
        self.parts_of(bundle, value, &Turn::new(cos_scattering, azimuth))
    }

    /// The same with the values of the phase functions.
    #[inline(always)]
    pub fn parts_of(&self, bundle: &Bundle, value: impl Fn(usize) -> Lanes, turn: &Turn) -> [Lanes; 2] {
        let mut parts = [[0.0; LANES]; 2];
        for (phase, (k, peaked)) in self.once.iter().zip(&bundle.peaked).enumerate() {
            let value = value(phase);
            for lane in 0..LANES {
                let light = k[lane] * value[lane];
                parts[0][lane] += (1.0 - peaked[lane]) * light;
                parts[1][lane] += peaked[lane] * light;
            }
        }
        if bundle.twice {
            for (lane, column) in bundle.columns.iter().enumerate() {
                parts[1][lane] += column.twice.as_ref().map_or(0.0, |tail| self.twice[lane] * tail.at(turn.place));
            }
        }
        // cos (m+1)φ = 2 cos φ cos mφ − cos (m−1)φ
        let cos = turn.cos_azimuth;
        let (mut before, mut now) = (cos, 1.0);
        for l in &self.orders {
            for lane in 0..LANES {
                parts[0][lane] += l[lane] * now;
            }
            (before, now) = (now, 2.0 * cos * now - before);
        }
        parts
    }

    /// What peaked scatterers of the first column make of the beam, over all that they gather, at a scattering angle.
    pub fn halo(&self, bundle: &Bundle, cos_scattering: f64) -> f64 {
        let all: f64 = self.of_peaked(bundle).map(|(k, _)| k).sum();
        let once: f64 = self.of_peaked(bundle).map(|(k, phase)| k * phase.value(cos_scattering)).sum();
        let tail = bundle.columns[0].twice.as_ref();
        let twice = tail.map_or(0.0, |tail| self.twice[0] * tail.at(Tail::place(cos_scattering)));
        if all > 0.0 { (once + twice).max(0.05 * once) / all } else { 0.0 }
    }

    /// What they gather, each its own.
    pub fn of_peaked(&self, bundle: &Bundle) -> impl Iterator<Item = (f64, Arc<Phase>)> {
        let column = &bundle.columns[0];
        let all = self.once.iter().zip(&column.phases).zip(&column.peaked);
        all.filter(|(_, peaked)| **peaked).map(|((k, phase), _)| (k[0], Arc::clone(phase)))
    }

    fn reset(&mut self, phases: usize, orders: usize) {
        self.once.clear();
        self.once.resize(phases, [0.0; LANES]);
        self.orders.clear();
        self.orders.resize(orders, [0.0; LANES]);
        self.twice = [0.0; LANES];
    }
}

wide_too! {
    /// What is gathered at an azimuth, as shares of what was at others.
    pub(crate) fn mix_azimuths(gathered: &[Gathered], shares: &[f64], mixed: &mut Gathered) {
        mixed.reset(gathered[0].once.len(), gathered[0].orders.len());
        for (one, share) in gathered.iter().zip(shares) {
            add_shares(&mut mixed.once, &one.once, *share);
            add_shares(&mut mixed.orders, &one.orders, *share);
            add_shares(std::slice::from_mut(&mut mixed.twice), std::slice::from_ref(&one.twice), *share);
        }
    }
}

#[inline(always)]
fn add_shares(sums: &mut [Lanes], values: &[Lanes], share: f64) {
    let sums = sums.as_flattened_mut().iter_mut();
    sums.zip(values.as_flattened()).for_each(|(sum, value)| *sum += share * value);
}

/// What a ray through columns crosses, whatever the sun.
#[derive(Clone, Debug, Default)]
pub(crate) struct Crossed {
    /// Scaled optical depth to each point, and what comes through from it.
    passed: Vec<[Lanes; 2]>,
    /// Between the points: half of what peaked scatterers scatter \[m⁻¹\], and q_ray.
    tail: Vec<[Lanes; 2]>,
}

impl Crossed {
    /// Takes the depths of the column in a lane; columns come in the order of their lanes.
    pub fn take(&mut self, weighed: &Weighed, lane: usize) {
        if lane == 0 {
            self.passed.clear();
            self.passed.resize(weighed.passed.len(), [[0.0; LANES]; 2]);
            self.tail.clear();
            self.tail.resize(weighed.tail.0.len(), [[0.0; LANES]; 2]);
        }
        for ([depth, through], passed) in self.passed.iter_mut().zip(&weighed.passed) {
            (depth[lane], through[lane]) = (*passed, exp(-passed));
        }
        for ([half, q], (own_half, own_q)) in self.tail.iter_mut().zip(weighed.tail.0.iter().zip(&weighed.tail.1)) {
            (half[lane], q[lane]) = (*own_half, *own_q);
        }
    }
}

/// What light is gathered with.
#[derive(Clone, Debug, Default)]
pub(crate) struct Basket {
    /// By azimuth.
    pub all: Vec<Gathered>,
    /// Of points: depth by way of each, sun and ray together, and what comes through.
    depth: Vec<Lanes>,
    light: Vec<Lanes>,
    /// Between points: what single scattering gathers a metre, and half of q along the ray and of q towards the sun.
    got: Vec<Lanes>,
    q: Vec<Lanes>,
}

wide_too! {
    /// Gathers light along a ray for one sun of unit irradiance, at every azimuth of the fan; `projected` is what the points
    /// give in each of the fields that the fan draws on, counted from its first.
    pub(crate) fn gather(
        bundle: &Bundle,
        sight: &Sight,
        crossed: &Crossed,
        fan: &Fan,
        depths: &SunDepths,
        projected: &[Projected],
        basket: &mut Basket
    ) {
        let n = sight.points.len();
        let orders = projected.iter().map(|p| p.orders.len().max(p.places.len())).max().unwrap_or(0);
        let Basket { all, depth, light, got, q } = basket;
        depth.resize(n, [0.0; LANES]);
        light.resize(n, [0.0; LANES]);
        got.resize(sight.lengths.len(), [0.0; LANES]);
        q.clear();
        if bundle.twice && n > 0 {
            let mut near = depths.tail_at(&sight.points[0]);
            for (point, [half, q_ray]) in sight.points[1..].iter().zip(&crossed.tail) {
                let far = depths.tail_at(point);
                let mut own = [0.0; LANES];
                for lane in 0..LANES {
                    own[lane] = half[lane] * (0.5 * (near[lane] + far[lane]) + q_ray[lane]);
                }
                q.push(own);
                near = far;
            }
        }
        all.resize_with(fan.azimuths, Gathered::default);
        for (azimuth, gathered) in all.iter_mut().enumerate() {
            let mut suns = &fan.suns[azimuth * (fan.suns.len() / fan.azimuths)..];
            gathered.reset(bundle.phases, orders);
            // Levels that are met as they are, by every azimuth alike.
            let flat = !depths.through.is_empty() && suns.len() == n && fan.azimuths == 1;
            for ((depth, light), (point, [passed, through])) in
                depth.iter_mut().zip(&mut *light).zip(sight.points.iter().zip(&crossed.passed))
            {
                let (own, rest) = suns.split_at(point.levels.used);
                suns = rest;
                if flat {
                    let place = (own[0].first as usize).min(depths.depths.len() - 1);
                    let (to_sun, from_sun) = (&depths.depths[place], &depths.through[place]);
                    for lane in 0..LANES {
                        depth[lane] = to_sun[lane] + passed[lane];
                        light[lane] = from_sun[lane] * through[lane];
                    }
                    continue;
                }
                let to_sun = depths.at(own);
                for lane in 0..LANES {
                    depth[lane] = to_sun[lane] + passed[lane];
                }
            }
            let depth = depth.as_flattened();
            if !flat {
                light.as_flattened_mut().iter_mut().zip(depth).for_each(|(light, depth)| *light = exp(-depth));
            }
            // The depth runs straight between the points: ∫ e^(−x), exact for one layer of a flat Earth.
            let (light, flat) = (light.as_flattened(), got.as_flattened_mut());
            for (i, got) in flat.iter_mut().enumerate() {
                let (fall, a, b) = (depth[i + LANES] - depth[i], light[i], light[i + LANES]);
                *got = if fall.abs() > 1e-4 { (a - b) / fall } else { a * (1.0 - 0.5 * fall) };
            }
            for (got, length) in got.iter_mut().zip(&sight.lengths) {
                let per = length * (0.25 / PI);
                got.iter_mut().for_each(|got| *got *= per);
            }
            let mut twice = [0.0; LANES];
            for (got, q) in got.iter().zip(&*q) {
                for lane in 0..LANES {
                    twice[lane] += got[lane] * q[lane];
                }
            }
            gathered.twice = twice;
            for (phase, once) in gathered.once.iter_mut().enumerate() {
                let mut sum = [0.0; LANES];
                for piece in &sight.pieces {
                    let beta = &bundle.scattering[piece.layer * bundle.phases + phase];
                    let mut own = got[piece.first];
                    if piece.steps == 2 {
                        for lane in 0..LANES {
                            own[lane] += got[piece.first + 1][lane];
                        }
                    }
                    for lane in 0..LANES {
                        sum[lane] += beta[lane] * own[lane];
                    }
                }
                *once = sum;
            }
            // Any field of the sun tells how the light was drawn, and where most of it comes from.
            let any = &projected[fan.fields[azimuth][0].0];
            if any.places.is_empty() {
                for lane in 0..bundle.columns.len() {
                    let (first, shares) = fan.mean(azimuth, any.centre[lane]);
                    for (field, share) in projected[first..].iter().zip(shares).filter(|(_, share)| *share != 0.0) {
                        let sums = gathered.orders.iter_mut().zip(&field.orders);
                        sums.for_each(|(sum, value)| sum[lane] += share * value[lane]);
                    }
                }
            } else {
                for (i, (first, shares)) in fan.fields[azimuth].into_iter().enumerate().take(any.reach) {
                    for (field, share) in projected[first..].iter().zip(shares).filter(|(_, share)| *share != 0.0) {
                        for (sum, places) in gathered.orders.iter_mut().zip(&field.places) {
                            for lane in 0..LANES {
                                sum[lane] += share * places[i][lane];
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Light of a ground of radiance 1, gathered along a ray; it has no azimuth.
pub(crate) fn gather_ground(weighed: &Weighed, ground: &Field) -> f64 {
    if weighed.orders_of(ground) == 0 {
        return 0.0;
    }
    let (_, [kernel, rows]) = weighed.beside(ground, 0);
    dot(kernel, rows).max(0.0)
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

/// Solves a column at one entry: the fields of some suns, and of a shining ground.
pub(crate) fn solve_entry(optics: &Optics, suns: &FieldSuns, accuracy: f64, solution: &mut Solution) {
    solve(optics.streams, &optics.layers, &suns.beams(optics), accuracy, solution);
}

/// The irradiances at the ground alone.
pub(crate) fn arriving_at(optics: &Optics, suns: &FieldSuns) -> Arriving {
    arriving(optics.streams, &optics.layers, &suns.beams(optics))
}

/// The streams that serve a number asked for: the next that the solver has.
pub(crate) fn streams(asked: u64) -> usize {
    STREAMS.into_iter().find(|known| *known as u64 >= asked).unwrap_or(STREAMS[STREAMS.len() - 1])
}

/// A column under one sun, for tests: along any ray from the ground to the top.
#[cfg(test)]
pub(crate) struct Probe {
    shells: Shells,
    pub bundle: Bundle,
    lattice: Lattice,
    rays: SunRays,
    fields: FieldSuns,
    depths: SunDepths,
    pub solution: Solution,
}

#[cfg(test)]
impl Probe {
    pub fn new(shells: Shells, medium: &Medium, streams: usize, sun: f64, accuracy: f64) -> Self {
        Self::with_fields(shells, medium, streams, sun, accuracy, false)
    }

    /// With the field of the sun itself where `exact`, not those of the row about it.
    pub fn with_fields(shells: Shells, medium: &Medium, streams: usize, sun: f64, accuracy: f64, exact: bool) -> Self {
        let optics = Optics::new(medium, &shells, streams, false);
        Self::of(shells, optics, sun, accuracy, exact)
    }

    pub fn of(shells: Shells, optics: Optics, sun: f64, accuracy: f64, exact: bool) -> Self {
        let lattice = Lattice::new(&shells, &optics);
        let rays = SunRays::new(&shells, &lattice, sun);
        let fields = FieldSuns::new(&shells, &lattice, &[sun], exact);
        let mut solution = Solution::default();
        solve_entry(&optics, &fields, accuracy, &mut solution);
        let bundle = Bundle::new(vec![optics]);
        Self { depths: rays.depths(&bundle), shells, bundle, lattice, rays, fields, solution }
    }

    /// T′ of the beam, E_d over a black ground as the solver has it, and S.
    pub fn fluxes(&self) -> (f64, f64, f64) {
        let down = self.fields.ground_flux(&self.solution.beams, 0, self.rays.zenith);
        (self.rays.to_ground(&self.bundle.columns[0].scaled), down, self.solution.ground.arrives / PI)
    }

    /// Light of the sun, `azimuth` from that of the rising ray, gathered along a ray of this zenith angle at the ground; that
    /// of a ground of radiance 1; and the scaled depth of the ray.
    pub fn gather(&self, look: Look, zenith: f64, azimuth: f64) -> (Gathered, f64, f64) {
        let optics = &self.bundle.columns[0];
        let (streams, all) = (optics.streams, (self.shells.top(), f64::INFINITY));
        let sight = Sight::new(&self.shells, &self.lattice, look, (0.0, zenith), all, streams, streams);
        let weighed = [Weighed::new(optics, &sight, &self.solution.starts(), self.fields.draws_by_place(&sight))];
        let fan = Fan::new(&sight, &self.rays, &self.fields, 0, &[azimuth]);
        let (mut projected, mut crossed, mut basket) = (Vec::new(), Crossed::default(), Basket::default());
        project(&weighed, &self.solution.beams, 0, &mut projected);
        let [weighed] = weighed;
        crossed.take(&weighed, 0);
        gather(&self.bundle, &sight, &crossed, &fan, &self.depths, &projected[0], &mut basket);
        let gathered = basket.all.remove(0);
        (gathered, gather_ground(&weighed, &self.solution.ground), weighed.passed[weighed.passed.len() - 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
                let g =
                    rows.iter().filter(|r| r[0] == sun[0] && r[3] == "hg").map(|r| number(&r[4])).fold(0.0, f64::max);
                Problem { id: sun[0].clone(), g, medium, mu0: number(&sun[1]), albedo: number(&sun[2]) }
            })
            .collect()
    }

    fn worst(streams: usize, serves: impl Fn(&Problem) -> bool) -> (f64, String) {
        let radiances = records(include_str!("../tests/data/plane_parallel.csv"));
        let mut worst = (0.0, String::new());
        for problem in problems() {
            if !serves(&problem) {
                continue;
            }
            let n = problem.medium.layers.len();
            let strata = Strata {
                heights: (0..=n).rev().map(|i| 1000.0 * i as f64).collect(),
                refractivity: vec![0.0; n + 1],
                radius: 6.371e6,
            };
            let shells = Shells::new(&strata, false);
            let probe = Probe::new(shells, &problem.medium, streams, problem.mu0.acos(), 1e-9);
            let (direct, down, s) = probe.fluxes();
            let shining = problem.albedo / PI * (problem.mu0 * direct + down) / (1.0 - problem.albedo * s);
            for row in radiances.iter().filter(|row| row[0] == problem.id) {
                let number = |i: usize| row[i].parse::<f64>().unwrap();
                let (up, mu, dphi, cos) = (row[3] == "up", number(4), number(5).to_radians(), number(6));
                let look = if up { Look::Down } else { Look::Up };
                if row[1] == "middle" || cos > 20f64.to_radians().cos() {
                    continue;
                }
                let (gathered, ground, depth) = probe.gather(look, mu.acos(), if up { PI - dphi } else { dphi });
                let mut found = gathered.radiance(&probe.bundle, cos, dphi)[0] + shining * ground;
                if up {
                    found += shining * (-depth).exp();
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

    /// At 20° and more from the beam. CDISORT's own 8 and 16 streams miss its 128 by 2.2e-2 and 1.35e-3 in the worst of these.
    #[test]
    fn radiances_are_those_of_disort() {
        let (eight, place) = worst(8, |problem| problem.g <= 0.7);
        assert!(eight < 0.015, "8 streams: {eight:.2e} at {place}");
        let (sixteen, place) = worst(16, |problem| problem.g <= 0.7);
        assert!(sixteen < 6.5e-4, "16 streams: {sixteen:.2e} at {place}");
        println!("8 streams: {eight:.2e}; 16: {sixteen:.2e}");
        let (peaked, place) = worst(32, |problem| problem.g > 0.7);
        assert!(peaked < 1e-3, "32 streams: {peaked:.2e} at {place}");
    }

    /// 64 streams, where parts are thin and the quadrature is fine.
    #[test]
    fn many_streams_agree_with_disort_to_1e_5() {
        let few = ["rayleigh_0.5_sun60_a0.0", "hg0.7_omega0.99_0.1_sun30_a0.0", "mixed_sun30_a0.0"];
        let (error, place) = worst(64, |problem| few.contains(&problem.id.as_str()));
        assert!(error < 1e-5, "{error:.2e} at {place}");
    }
}
