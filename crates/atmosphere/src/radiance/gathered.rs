//! Light gathered along rays, four columns side by side.

use std::f64::consts::PI;
use std::sync::Arc;

use super::optics::{Bundle, LANES, Lanes, Tail, Turn};
use super::projected::{Projected, dot};
use super::sight::Sight;
use super::suns::{Fan, SunDepths};
use super::weighed::Weighed;
use crate::phase::Phase;
use crate::solver::Field;
use crate::wide::{exp, wide_too};

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
