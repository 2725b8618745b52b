//! How many samples each pixel takes: its first ones tell, of it and of those around.

use glam::{DVec2, DVec4};
use smallvec::SmallVec;
use sunglint_geometry::{FacetId, MaterialId};
use sunglint_radiometry::{REPLICATES, estimate};

use crate::Accuracy;
use crate::even::{Even, Rest};
use crate::paths::{Paths, RayCounts};
use crate::pixel::{Parts, PixelRadiance};
use crate::render::{
    BLOCK, Draws, Lightable, PixelPaths, Proofs, SkyView, Tile, View, Watch, block_at, pixels_of, trace_pixel,
};
use crate::sightline::Lattice;
use crate::sun::LastSun;
use crate::unseen::{missed, replicates_of};

/// The first samples of a block's pixels, one a replicate, lit at every time.
pub(crate) struct First {
    /// By time and pixel.
    pub times: Vec<Vec<PixelRadiance>>,
    /// F of each pixel.
    pub sky_views: Vec<SkyView>,
    /// Material and facet that each replicate of each pixel met.
    materials: Vec<[Option<MaterialId>; REPLICATES]>,
    facets: Vec<[Option<FacetId>; REPLICATES]>,
    /// Places of the pixels within the tile, and whether each is proved to see one facet alone.
    block: Vec<((u32, u32), bool)>,
}

impl First {
    /// Traces and lights them.
    pub fn of_block(
        view: &View<'_>,
        lattice: &Lattice<'_>,
        tile: Tile,
        block: &[Rest],
        paths: &mut Paths,
        watch: &mut Watch<'_>,
    ) -> Self {
        let trace = |(i, Rest { place: (x, y), sole, .. }): (usize, &Rest)| {
            let pixel = (tile.x + x, tile.y + y);
            trace_pixel(view, (pixel, sole.as_ref()), i, ([Draws::all(1); 2], 0), &mut *paths)
        };
        let traced: Vec<PixelPaths> = block.iter().enumerate().map(trace).collect();
        let hit = |sample: usize| Some(&paths.vertices[paths.samples[sample].vertex? as usize].hit);
        let material = |sample: usize| Some(hit(sample)?.material);
        let facet = |sample: usize| Some(hit(sample)?.facet);
        let materials = traced.iter().map(|pixel| std::array::from_fn(|r| material(pixel.samples.start + r))).collect();
        let facets = traced.iter().map(|pixel| std::array::from_fn(|r| facet(pixel.samples.start + r))).collect();
        let sky_views = traced.iter().map(|pixel| SkyView::of(paths, pixel)).collect();
        let mut rays = RayCounts::default();
        if let Some(cache) = &mut paths.cache {
            let clock = watch.clock;
            cache.light(std::slice::from_ref(view), lattice, Parts::Whole, clock, |_, t, own, begun| {
                rays += own;
                watch.add(t, begun);
            });
        }
        let lightable =
            Lightable::new(std::slice::from_ref(view), &traced, lattice, paths, Parts::Looked, Proofs::Together);
        let mut last = LastSun::default();
        let times = (view.times.iter().enumerate())
            .map(|(t, time)| {
                let begun = (watch.clock)();
                let mut of_time = Vec::with_capacity(traced.len());
                rays += lightable.light(view, time, &mut last, Some((0, t)), |_, radiance| of_time.push(radiance));
                watch.add(t, begun);
                of_time
            })
            .collect();
        paths.rays += rays;
        paths.clear();
        let block = block.iter().map(|pixel| (pixel.place, pixel.sole.is_some())).collect();
        Self { times, sky_views, materials, facets, block }
    }

    /// How many samples each replicate of each half takes, the first included: chosen by the other half.
    pub fn draws(&self, view: &View<'_>) -> Vec<[Draws; 2]> {
        let mut draws = vec![[Draws::all(1); 2]; self.block.len()];
        let Accuracy::Error { relative, floor, most, .. } = view.accuracy else { return draws };
        let most = f64::from((most / REPLICATES as u32).max(1));
        for t in 0..self.times.len() {
            for c in 0..view.channels.len() {
                for (half, by) in [(0, 1), (1, 0)] {
                    let seen = self.heard(&self.seen(t, c, by), by);
                    let mean = seen.iter().map(|seen| seen.mean).sum::<f64>() / seen.len() as f64;
                    for (own, draws) in seen.iter().zip(&mut draws) {
                        let needed = match view.worth {
                            Some(worth) => {
                                let Price { floor, least } = worth.of[t * view.channels.len() + c];
                                let scale = REPLICATES as f64 * own.mean.max(floor).powi(2);
                                if scale > 0.0 { own.spread.worthwhile(scale * least) } else { Draws::all(1) }
                            }
                            None => {
                                let wanted = relative * own.mean.max(floor.unwrap_or(0.01 * mean));
                                let allowed = beside(REPLICATES as f64 * wanted * wanted, own.shared);
                                Draws::all(if allowed > 0.0 { needed(own, allowed).min(most).ceil() as u32 } else { 1 })
                            }
                        };
                        draws[half] = draws[half].max(needed.at_most(most as u32));
                    }
                }
            }
        }
        draws
    }

    /// What one half of the replicates tells of each pixel at one time in one channel.
    fn seen(&self, t: usize, c: usize, half: usize) -> Vec<Seen> {
        let replicates = replicates_of(half);
        let of_pixel = |(radiance, facets): (&PixelRadiance, &[Option<FacetId>; REPLICATES])| {
            let kinds = std::array::from_fn::<_, { REPLICATES / 2 }, _>(|r| {
                let r = replicates.start + r;
                (facets[r], radiance.lit[r] > 0.5)
            });
            let unseen = radiance.unseen[half][c].iter().sum();
            let values = &radiance.radiance[c][replicates.clone()];
            let looked = &radiance.looked[c][replicates.clone()];
            let Some(noise) = radiance.cache_noise.get(c).map(|noise| &noise[replicates.clone()]) else {
                return Seen { unseen, ..Seen::new(values, looked, &kinds) };
            };
            // More samples of a pixel do not lower the noise of points that others share.
            let own: SmallVec<[f64; REPLICATES]> =
                values.iter().zip(noise).map(|(value, noise)| value - noise).collect();
            let shared = estimate(noise).standard_error.powi(2) * noise.len() as f64;
            Seen { unseen, shared, ..Seen::new(&own, looked, &kinds) }
        };
        self.times[t].iter().zip(&self.facets).map(of_pixel).collect()
    }

    /// The same, with no less variance than the pixels around tell: between facets relative to what each is, since what lies in the
    /// dark beside a bright edge is seldom part of it, and none where one facet alone is seen.
    fn heard(&self, seen: &[Seen], half: usize) -> Vec<Seen> {
        let heard = |(i, own): (usize, &Seen)| {
            let of = |j: usize| {
                let Seen { mean, spread, .. } = seen[j];
                let darker = if mean > own.mean { (own.mean / mean).powi(2) } else { 1.0 };
                spread.of * DVec4::new(if self.block[i].1 { 0.0 } else { darker }, 1.0, 1.0, 1.0)
            };
            let spread = Spread { of: own.spread.of.max(self.around(i, half, of)), ..own.spread };
            Seen { spread, ..*own }
        };
        seen.iter().enumerate().map(heard).collect()
    }

    /// Mean over the pixels around one of which that half met a material that it met there too, itself among them: eight samples
    /// know their own variance badly, and may miss an edge that neighbours see.
    fn around(&self, i: usize, half: usize, value: impl Fn(usize) -> DVec4) -> DVec4 {
        let ((x, y), _) = self.block[i];
        let met = |j: usize| &self.materials[j][replicates_of(half)];
        let near = |j: &usize| {
            let ((u, v), _) = self.block[*j];
            x.abs_diff(u) <= 1 && y.abs_diff(v) <= 1 && met(*j).iter().any(|material| met(i).contains(material))
        };
        let (sum, n) =
            (0..self.block.len()).filter(near).fold((DVec4::ZERO, 0.0), |(sum, n), j| (sum + value(j), n + 1.0));
        sum / f64::max(n, 1.0)
    }
}

/// What half of a pixel's first samples tell of it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    mean: f64,
    spread: Spread,
    /// Variance between replicates that points of the cache bring, whatever the number of samples.
    shared: f64,
    /// What none of them met where a ray might be stopped; see [`missed`].
    unseen: f64,
}

/// What a sample costs that tells what its line of sight meets, what it costs beside that where it is traced on, and what where it
/// looks: by counts of instructions, which hardly change what an image takes.
const COSTS: [f64; 3] = [1.0, 2.0, 4.0];

/// Variance of one sample, told apart by what lowers it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spread {
    /// Between facets; between the sun and the shade on a facet; on a facet in the sun or in the shade; what of the last rays
    /// found of sky and background.
    of: DVec4,
    /// Least samples a replicate that are traced, and that look: the first, and one on each facet.
    least: u32,
}

impl Spread {
    /// W and B: on facets in the sun or in the shade, and between these.
    fn whole(&self) -> DVec2 {
        DVec2::new(self.of.z, self.of.x + self.of.y)
    }

    /// Samples up to which what one more costs lowers what is [left](Self::left) by at least `least` for each that tells a facet.
    /// Samples tell how much of the pixel each facet fills, those that are traced how the sun lights it and those that look what
    /// is around: each as many as that alone is worth, or, where that were more than of those before, as both together.
    fn worthwhile(&self, least: f64) -> Draws {
        if self.of == DVec4::ZERO {
            return Draws::all(1);
        }
        let [between, suns, within, looked] = self.of.to_array();
        let levels = [DVec2::new(0.0, between), DVec2::new((within - looked).max(0.0), suns), DVec2::new(looked, 0.0)];
        // Some of the samples do not stand as evenly along the edge of a shadow as all.
        let is_edge = suns > 0.0;
        let mut pools: SmallVec<[(DVec2, f64, f64, usize); 3]> = SmallVec::new();
        for (k, (spread, cost)) in levels.into_iter().zip(COSTS).enumerate() {
            let of = |spread, cost, n| (spread, cost, worthwhile(spread, cost * least), n);
            let mut own = of(spread, cost, 1);
            while let Some(&(before, paid, number, n)) = pools.last()
                && (own.2 >= number || k == 1 && is_edge)
            {
                own = of(own.0 + before, own.1 + paid, own.3 + n);
                pools.pop();
            }
            pools.push(own);
        }
        let mut numbers = pools.iter().flat_map(|(_, _, number, n)| std::iter::repeat_n(number.round() as u32, *n));
        let mut next = |most: u32, least: u32| numbers.next().unwrap_or(1).max(least).min(most);
        let samples = next(u32::MAX, 1);
        let traced = next(samples, self.least);
        Draws { samples, traced, looks: next(traced, self.least) }
    }

    /// Variance of a replicate's mean, about.
    fn left(&self, draws: Draws) -> f64 {
        let [between, suns, within, looked] = self.of.to_array();
        let [samples, traced, looks] = [draws.samples, draws.traced, draws.looks].map(f64::from);
        let whole = DVec2::new(within - looked, suns);
        let of_traced = if traced < samples { whole.element_sum() / traced } else { left(whole, traced) };
        left(DVec2::new(0.0, between), samples) + of_traced + looked / looks
    }
}

impl Seen {
    /// Of a pixel that one sample tells.
    fn even(radiance: &PixelRadiance, c: usize) -> Self {
        let mean = radiance.estimate(c).mean;
        let noise = radiance.cache_noise.get(c).map_or(0.0, |noise| estimate(noise).standard_error);
        let spread = Spread { of: DVec4::ZERO, least: 1 };
        Self { mean, spread, shared: noise * noise * REPLICATES as f64, unseen: 0.0 }
    }

    fn new(values: &[f64], looked: &[f64], kinds: &[(Option<FacetId>, bool)]) -> Self {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let of_kinds: SmallVec<[Option<FacetId>; REPLICATES]> = kinds.iter().map(|(facet, _)| *facet).collect();
        let facets = (0..kinds.len()).filter(|i| !of_kinds[..*i].contains(&of_kinds[*i])).count();
        let (apart, whole) = (told_apart(values, &of_kinds), told_apart(values, kinds));
        let within = whole.x.min(apart.x);
        let of = DVec4::new(apart.y, apart.x - within, within, told_apart(looked, kinds).x);
        Self { mean, spread: Spread { of, least: 1 + facets as u32 }, shared: 0.0, unseen: 0.0 }
    }
}

/// W and B of values of one sample each.
fn told_apart<K: PartialEq>(values: &[f64], kinds: &[K]) -> DVec2 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let whole = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let (mut squares, mut groups) = (0.0, 0.0);
    for (i, kind) in kinds.iter().enumerate() {
        if kinds[..i].contains(kind) {
            continue;
        }
        let own = || values.iter().zip(kinds).filter(|(_, of)| *of == kind).map(|(value, _)| *value);
        let of_group = own().sum::<f64>() / own().count() as f64;
        squares += own().map(|value| (value - of_group).powi(2)).sum::<f64>();
        groups += 1.0;
    }
    // As many kinds as samples: nothing can be told of either.
    let within = if n - groups >= 3.0 { (squares / (n - groups)).min(whole) } else { whole };
    DVec2::new(within, whole - within)
}

/// What is left of an allowed variance beside one that samples do not lower: no less than a quarter, since more of them would be
/// spent in vain.
fn beside(allowed: f64, shared: f64) -> f64 {
    (allowed - shared).max(0.25 * allowed)
}

/// W/n + B/n^1.5, what n samples a replicate leave: scattered points average what varies on a facet, and the points of one
/// replicate, spread evenly over the pixel, do better on the area of a facet within it [Owen1997].
fn left(spread: DVec2, n: f64) -> f64 {
    spread.x / n + spread.y / (n * n.sqrt())
}

/// Samples a replicate that leave no more than `allowed`, stated for what may have been missed included.
fn needed(seen: &Seen, allowed: f64) -> f64 {
    let (whole, unseen) = (seen.spread.whole(), seen.unseen);
    let r = REPLICATES as f64;
    let all = |n: f64| left(whole, n) + r * missed(unseen, r * n) - allowed;
    if all(1.0) <= 0.0 {
        return 1.0;
    }
    // Between what either alone asks for and what all would if edges were no better.
    let (mut low, mut high) = (1.0, (whole.element_sum() + unseen) / allowed);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if all(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Samples a replicate up to which one more lowers what is [left] by at least `least`.
fn worthwhile(spread: DVec2, least: f64) -> f64 {
    let (within, between) = (spread.x, spread.y);
    let gain = |n: f64| within / (n * n) + 1.5 * between / (n * n * n.sqrt());
    if gain(1.0) <= least {
        return 1.0;
    }
    match (within > 0.0, between > 0.0) {
        (true, false) => return (within / least).sqrt(),
        (false, true) => return (1.5 * between / least).powf(0.4),
        _ => {}
    }
    // Between what either alone is worth and both together.
    halved((1.0, ((within + 1.5 * between) / least).sqrt()), 30, |n| gain(n) > least).1
}

/// Ends about where `is_low` ceases to hold, after so many halvings of their ratio.
fn halved((mut low, mut high): (f64, f64), times: u32, is_low: impl Fn(f64) -> bool) -> (f64, f64) {
    for _ in 0..times {
        let middle = (low * high).sqrt();
        if is_low(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low, high)
}

/// What a sample is worth in a view whose error is asked for over the image: the least by which one must lower the mean square of
/// the relative standard error, so that at last all samples are worth the same \[Neyman1934\].
#[derive(Clone, Debug, PartialEq)]
pub struct Worth {
    /// By time and channel.
    of: Vec<Price>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Price {
    /// Floor of a pixel's radiance.
    floor: f64,
    /// In relative variance a sample of each replicate.
    least: f64,
}

/// Blocks of the image from which it is told, and how many of their pixels, channels and times.
const TOLD_BLOCKS: u32 = 256;
const TOLD_PIXELS: usize = 1 << 15;

impl Worth {
    /// From the first samples of blocks spread over the image; `None` unless an error over the image is asked for.
    pub fn of(view: &View<'_>) -> Option<Self> {
        let Accuracy::Error { relative, floor, every_pixel: false, .. } = view.accuracy else { return None };
        let (across, down) = (view.pixels.0.div_ceil(BLOCK), view.pixels.1.div_ceil(BLOCK));
        let (n, most) = (u64::from(across) * u64::from(down), u64::from(TOLD_BLOCKS));
        // Multiples of the golden ratio, which keep their distances on a circle.
        let spread = |i: u64| ((i as f64 * 0.618_033_988_749_894_9).fract() * n as f64) as u64;
        let places: Vec<Tile> = (0..n.min(most))
            .map(|i| if n <= most { i } else { spread(i) })
            .map(|at| block_at(view.pixels, ((at % u64::from(across)) as u32, (at / u64::from(across)) as u32)))
            .collect();
        let pixels: usize = places.iter().map(|block| (block.width * block.height) as usize).sum();
        let n_channels = view.channels.len();
        let step = (pixels * view.times.len() * n_channels).div_ceil(TOLD_PIXELS).max(1);
        let (mut paths, lattice) = (Paths::new(view.nodes.len()), view.lattice());
        // By time and channel: what both halves tell of every `step`th pixel. No block's images outlive it.
        let mut seen: Vec<Vec<(Seen, Seen)>> = vec![Vec::new(); view.times.len() * n_channels];
        let mut before = 0;
        for tile in places {
            let block = pixels_of(tile);
            view.begin(tile, &lattice, &mut paths);
            // By time and channel, and pixel.
            let mut of_block = vec![vec![None; block.len()]; seen.len()];
            let tell = |pixel: &PixelPaths, (_, t): (usize, usize), radiance: PixelRadiance| {
                for c in 0..n_channels {
                    let own = Seen::even(&radiance, c);
                    of_block[t * n_channels + c][pixel.index] = Some((own, own));
                }
            };
            let (one, still) = (std::slice::from_ref(view), || 0.0);
            let even =
                Even::of_block((one, &lattice), (tile, &block), &mut paths, Parts::Whole, &still, tell, |_, _, _| {});
            if !even.rest.is_empty() {
                let mut watch = Watch::still(view.times.len());
                let first = First::of_block(view, &lattice, tile, &even.rest, &mut paths, &mut watch);
                let place = |pixel: &Rest| (pixel.place.1 * tile.width + pixel.place.0) as usize;
                for (at, of_block) in of_block.iter_mut().enumerate() {
                    let half = |half| first.seen(at / n_channels, at % n_channels, half);
                    for (pixel, own) in even.rest.iter().zip(first.heard(&half(0), 0).into_iter().zip(half(1))) {
                        of_block[place(pixel)].get_or_insert(own);
                    }
                }
            }
            for (seen, of_block) in seen.iter_mut().zip(of_block) {
                let told = (before..).zip(of_block).filter(|(i, _)| i % step == 0);
                seen.extend(told.filter_map(|(_, own)| own));
            }
            before += block.len();
        }
        let of = |seen: Vec<(Seen, Seen)>| {
            let mean = seen.iter().map(|(chooses, _)| chooses.mean).sum::<f64>() / seen.len().max(1) as f64;
            let floor = floor.unwrap_or(0.01 * mean);
            let scaled = |seen: &Seen| {
                let scale = REPLICATES as f64 * seen.mean.max(floor).powi(2);
                let each = if scale > 0.0 { 1.0 / scale } else { 0.0 };
                (Spread { of: each * seen.spread.of, ..seen.spread }, each * seen.shared)
            };
            let shared = seen.iter().map(|(_, tells)| scaled(tells).1).sum::<f64>() / seen.len().max(1) as f64;
            let pixels = seen.iter().map(|(chooses, tells)| (scaled(chooses).0, scaled(tells).0)).collect();
            Told { floor, shared, pixels }
        };
        let told: Vec<Told> = seen.into_iter().map(of).collect();
        let wanted = relative * relative;
        // What each channel of each time would pay alone, then all by the same factor less, since the worst of them chooses.
        let own: Vec<f64> = (told.iter())
            .map(|of| dearest(beside(wanted, of.shared), |least| of.left(|i| of.draws(i, least))))
            .collect();
        let factor = dearest(wanted, |factor| {
            let n_pixels = told.first().map_or(0, |of| of.pixels.len());
            let of_pixel = |i| {
                let of_told = told.iter().zip(&own).map(|(of, least)| of.draws(i, factor * least));
                of_told.fold(Draws::all(1), Draws::max)
            };
            let draws: Vec<Draws> = (0..n_pixels).map(of_pixel).collect();
            let left = |of: &Told| of.left(|i| draws[i]) * (wanted / beside(wanted, of.shared));
            told.iter().map(left).fold(0.0, f64::max)
        });
        let price = |(of, least): (&Told, &f64)| Price { floor: of.floor, least: factor * least };
        Some(Self { of: told.iter().zip(&own).map(price).collect() })
    }
}

/// What some pixels tell of one channel at one time.
struct Told {
    floor: f64,
    /// Mean square that samples do not lower.
    shared: f64,
    /// In relative variance, by what a pixel chooses, neighbours heard, and what the other half of its replicates tells.
    pixels: Vec<(Spread, Spread)>,
}

impl Told {
    fn draws(&self, i: usize, least: f64) -> Draws {
        self.pixels[i].0.worthwhile(least)
    }

    /// Mean square of the relative standard error that numbers of samples leave.
    fn left(&self, draws: impl Fn(usize) -> Draws) -> f64 {
        let of_pixel = |(i, (_, tells)): (usize, &(_, Spread))| tells.left(draws(i));
        self.pixels.iter().enumerate().map(of_pixel).sum::<f64>() / self.pixels.len().max(1) as f64
    }
}

/// The largest price at which no more than `wanted` is left.
fn dearest(wanted: f64, left: impl Fn(f64) -> f64) -> f64 {
    halved((1e-30, 1e15), 40, |price| left(price) <= wanted).0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two facets of 1 and 3, even on each: all variance is between them. One facet, half of it in the sun: all is between sun and
    /// shade. One facet in the sun: all is within.
    #[test]
    fn variance_is_told_apart_by_facets_and_shadows() {
        let values: Vec<f64> = (0..8).map(|i| if i < 4 { 1.0 } else { 3.0 }).collect();
        let of = |kind: &dyn Fn(u32) -> (Option<FacetId>, bool)| {
            let seen = Seen::new(&values, &[0.0; 8], &(0..8).map(kind).collect::<Vec<_>>());
            assert_eq!(seen.mean, 2.0);
            (seen.spread.of.to_array().map(|of| (of * 7.0).round()), seen.spread.least)
        };
        assert_eq!(of(&|i| (Some(FacetId(i / 4)), true)), ([8.0, 0.0, 0.0, 0.0], 3));
        assert_eq!(of(&|i| (Some(FacetId(7)), i < 4)), ([0.0, 8.0, 0.0, 0.0], 2));
        assert_eq!(of(&|_| (None, true)), ([0.0, 0.0, 8.0, 0.0], 2));
        // As many as samples: nothing is told apart.
        assert_eq!(of(&|i| (Some(FacetId(i)), true)), ([0.0, 0.0, 8.0, 0.0], 9));
    }

    /// With all variance on facets n = √(W/least), with all between them n = (1.5 B/least)^(2/5).
    #[test]
    fn samples_are_worthwhile_up_to_their_price() {
        let worthwhile = |w, b, least| worthwhile(DVec2::new(w, b), least);
        assert_eq!(worthwhile(1.0, 1.0, 3.0), 1.0);
        assert!((worthwhile(100.0, 0.0, 1.0) - 10.0).abs() < 1e-6);
        assert!((worthwhile(0.0, 1000.0, 1.0) - 1500f64.powf(0.4)).abs() < 1e-6);
        let n = worthwhile(10.0, 50.0, 1e-3);
        assert!((10.0 / (n * n) + 75.0 / n.powf(2.5) - 1e-3).abs() < 1e-9);
    }

    /// Where what tracing or looking finds varies little few do; where it holds all, all do, for what all cost; and at the edge of
    /// a shadow all are traced.
    #[test]
    fn as_many_samples_are_traced_and_look_as_is_worth_it() {
        let of = |of: [f64; 4]| {
            let Draws { samples, traced, looks } = Spread { of: of.into(), least: 2 }.worthwhile(1e-3);
            [samples, traced, looks]
        };
        let [camera, trace, look] = COSTS;
        let between = |b: f64, cost: f64| (1500.0 * b / cost).powf(0.4).round() as u32;
        let on = |w: f64, cost: f64| (1000.0 * w / cost).sqrt().round() as u32;
        assert_eq!(of([0.0; 4]), [1, 1, 1]);
        assert_eq!(of([1.0, 0.0, 0.0, 0.0]), [between(1.0, camera), 2, 2]);
        assert_eq!(of([1.0, 0.0, 0.05, 0.0]), [between(1.0, camera), on(0.05, trace), 2]);
        assert_eq!(
            of([0.0, 1.0, 0.0, 0.0]),
            [between(1.0, camera + trace); 2].into_iter().chain([2]).collect::<Vec<_>>()[..]
        );
        assert_eq!(of([1.0, 0.0, 0.05, 0.05]), [between(1.0, camera), on(0.05, trace + look), on(0.05, trace + look)]);
        assert_eq!(of([0.0, 0.0, 1.0, 1.0]), [on(1.0, camera + trace + look); 3]);
        let spread = Spread { of: DVec4::new(8.0, 2.0, 7.0, 3.0), least: 1 };
        let left = |samples, traced, looks| spread.left(Draws { samples, traced, looks });
        assert!((left(16, 4, 2) - (8.0 / 64.0 + 2.0 / 4.0 + 4.0 / 4.0 + 3.0 / 2.0)).abs() < 1e-12);
        assert!((left(4, 4, 2) - (8.0 / 8.0 + 2.0 / 8.0 + 4.0 / 4.0 + 3.0 / 2.0)).abs() < 1e-12);
    }

    #[test]
    fn as_many_samples_are_needed_as_bring_the_variance_down() {
        let needed = |within, between, unseen| {
            let spread = Spread { of: DVec4::new(between, 0.0, within, 0.0), least: 1 };
            needed(&Seen { mean: 1.0, spread, shared: 0.0, unseen }, 1.0)
        };
        assert_eq!(needed(0.5, 0.4, 0.0), 1.0);
        assert!((needed(100.0, 0.0, 0.0) - 100.0).abs() < 1e-6);
        assert!((needed(0.0, 1000.0, 0.0) - 100.0).abs() < 1e-6);
        // 12 U/((16 n + 1)(16 n + 2)) of one
        let n = needed(0.0, 0.0, 1e4);
        assert!((12e4 / ((16.0 * n + 1.0) * (16.0 * n + 2.0)) - 1.0).abs() < 1e-9);
        let n = needed(10.0, 50.0, 0.0);
        assert!((10.0 / n + 50.0 / n.powf(1.5) - 1.0).abs() < 1e-9);
    }
}
