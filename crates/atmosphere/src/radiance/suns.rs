//! What the suns give the points of a column: depths towards them, and the fields that are solved for them.

use std::f64::consts::PI;
use std::sync::Arc;

use super::optics::{Bundle, LANES, Lanes, Optics};
use super::projected::dot;
use super::sight::{Lattice, Point, Sight};
use crate::ray::Shells;
use crate::solver::{Beam, Field};
use crate::wide::{exp, wide_too};

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

/// Optical depth of lengths \[m\], each layer by its extinction \[m⁻¹\].
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
    pub(super) depths: Vec<Lanes>,
    /// Where in any lane nothing gets through.
    blocked: Vec<bool>,
    /// What comes through to each level, on a flat Earth, where all rays meet a level at one depth.
    pub(super) through: Vec<Lanes>,
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
    pub(super) fn at(&self, looked_up: &[SunAt]) -> Lanes {
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
    pub(super) fn tail_at(&self, point: &Point) -> Lanes {
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
        let edges = || lattice.levels.iter().step_by(2);
        let from_edges = |zenith: &f64| edges().map(|height| shells.towards_sun(*height, *zenith)).collect();
        let lengths = zeniths.iter().map(from_edges).collect();
        Self { zeniths, places, lengths }
    }

    pub(super) fn beams(&self, optics: &Optics) -> Vec<Beam> {
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

/// The sun over a point of a ray at a level of the lattice: the first of three suns beside it to which depths are known, and
/// their shares.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SunAt {
    shares: [f64; 3],
    pub(super) first: u32,
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
    pub(super) suns: Vec<SunAt>,
    pub(super) azimuths: usize,
    /// At each azimuth: for points of angles at the Earth's centre k `PLACE`.
    pub(super) fields: Vec<[FieldShares; PLACES]>,
}

/// Angles at the Earth's centre \[rad\] for which fields are looked up; light from between them is shared out to both.
const PLACE: f64 = 0.01;
pub(super) const PLACES: usize = 17;

/// The place before an angle at the Earth's centre \[rad\], and the share of the next.
pub(super) fn place(centre: f64) -> (usize, f64) {
    let x = (centre / PLACE).clamp(0.0, (PLACES - 1) as f64);
    let i = (x as usize).min(PLACES - 2);
    (i, x - i as f64)
}

impl Fan {
    /// Field and shares at an azimuth for light from an angle at the Earth's centre \[rad\].
    pub(super) fn mean(&self, azimuth: usize, centre: f64) -> FieldShares {
        let (i, t) = place(centre);
        let ((a, near), (b, far)) = (self.fields[azimuth][i], self.fields[azimuth][i + 1]);
        if a != b {
            return if t < 0.5 { (a, near) } else { (b, far) };
        }
        (a, std::array::from_fn(|k| near[k] + (far[k] - near[k]) * t))
    }

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

    /// For one sun whose field stands alone.
    pub fn alone(sight: &Sight, zenith: f64, depths: &SunDepths, azimuth: f64) -> Self {
        let fields = FieldSuns { zeniths: Vec::new(), places: Vec::new(), lengths: Vec::new() };
        Self::over(sight, zenith, (&depths.offsets, depths.from), &fields, 0, &[azimuth])
    }
}
