//! What rays draw from fields.

use super::optics::{LANES, Lanes};
use super::suns::PLACES;
use super::weighed::Weighed;
use crate::solver::Field;
use crate::wide::wide_too;

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

/// What a ray draws from one field of each column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Projected {
    /// By order.
    pub(super) orders: Vec<Lanes>,
    /// By order and place, where that was wanted instead; so many places have light.
    pub(super) places: Vec<[Lanes; PLACES]>,
    pub(super) reach: usize,
    /// Mean angle at the Earth's centre of where the light comes from \[rad\].
    pub(super) centre: Lanes,
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
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let [[sum]] = dots([a], [b]);
    sum
}
