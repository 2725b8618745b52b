//! Samples. A sample depends on (seed, view, pixel, replicate, index) and on nothing else: no thread, no tile, no order.

/// SplitMix64's finaliser [Steele, Lea & Flood 2014]: every input bit reaches every output bit.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A pair of numbers of a sample that is not drawn yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    key: u64,
    index: u32,
    pair: u32,
}

impl Pair {
    /// The point of [0, 1)²: of the first two dimensions of Sobol's sequence, which put one point into each cell of every division
    /// of the plane into 2^a × 2^b by 2^(a+b) points, in an order and with digits scrambled after Owen [Burley2020].
    pub fn draw(self) -> [f64; 2] {
        let seed = mix(self.key ^ u64::from(self.pair));
        let seeds = [seed as u32, (seed >> 32) as u32, (seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as u32];
        let place = scrambled(self.index.reverse_bits(), seeds[0]).reverse_bits();
        // With digits from the last to the first, the sequence's first dimension is the place itself, and digit j of the second
        // the sum of those of the place whose number holds all bits of j: Pascal's triangle modulo 2.
        let mut second = place;
        second ^= (second >> 1) & 0x5555_5555;
        second ^= (second >> 2) & 0x3333_3333;
        second ^= (second >> 4) & 0x0f0f_0f0f;
        second ^= (second >> 8) & 0x00ff_00ff;
        second ^= second >> 16;
        [scrambled(place, seeds[1]), scrambled(second, seeds[2])]
            .map(|digits| f64::from(digits.reverse_bits()) * 2f64.powi(-32))
    }
}

/// Each bit flipped by a hash of those below it [LaineKarras2011, with the constants of Vegdahl2021]: Owen's scrambling of
/// digits that run from the last to the first.
const fn scrambled(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// The numbers of one sample, drawn in order, in pairs: each pair is scrambled independently for every (seed, view, pixel,
/// replicate). Further dimensions of Sobol's sequence fill planes worse than chance does (2 numbers of the second four by 16
/// samples: 1.9 times the variance).
#[derive(Clone, Debug)]
pub struct Stream {
    key: u64,
    index: u32,
    pair: u32,
    /// The other number of a pair.
    left: Option<f64>,
}

impl Stream {
    /// The stream of sample `index` of a replicate.
    pub fn new(seed: u64, view: u64, pixel: u64, replicate: u32, index: u32) -> Self {
        let key = [view, pixel, u64::from(replicate)].iter().fold(mix(seed ^ 0x9e37_79b9_7f4a_7c15), |key, part| {
            mix(key ^ mix(part.wrapping_add(0x9e37_79b9_7f4a_7c15)))
        });
        Self { key, index, pair: 0, left: None }
    }

    /// That of another sample of the same replicate, from its first number on.
    pub const fn at(&self, index: u32) -> Self {
        Self { key: self.key, index, pair: 0, left: None }
    }

    /// The next number of [0, 1).
    pub fn next1(&mut self) -> f64 {
        self.left.take().unwrap_or_else(|| {
            let [first, second] = self.next2();
            self.left = Some(second);
            first
        })
    }

    /// The next point of [0, 1)².
    pub fn next2(&mut self) -> [f64; 2] {
        self.later().draw()
    }

    /// The next point of [0, 1)², to be drawn where it is needed.
    pub(crate) fn later(&mut self) -> Pair {
        self.pair += 1;
        Pair { key: self.key, index: self.index, pair: self.pair }
    }
}

/// A cosine-weighted direction of the hemisphere about +z, from two numbers of [0, 1): Malley's method over the
/// concentric map [Shirley & Chiu 1997], which keeps strata together.
pub(crate) fn cosine_hemisphere(u: [f64; 2]) -> glam::DVec3 {
    let [x, y] = concentric_disk(u);
    glam::DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// A uniform point of the unit disk.
pub(crate) fn concentric_disk(u: [f64; 2]) -> [f64; 2] {
    use std::f64::consts::FRAC_PI_4;
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0, 0.0];
    }
    let across = a.abs() > b.abs();
    let (r, angle) = if across { (a, FRAC_PI_4 * b / a) } else { (b, FRAC_PI_4 * a / b) };
    let [sin, cos] = sine_and_cosine(angle);
    if across { [r * cos, r * sin] } else { [r * sin, r * cos] }
}

/// Of an angle of up to π/4, to a rounding: their power series, whose next terms are 5e-17.
fn sine_and_cosine(angle: f64) -> [f64; 2] {
    let q = angle * angle;
    let series = |first: u32| {
        let mut sum = 1.0;
        let mut k = first;
        while k > 1 {
            sum = 1.0 - q * (1.0 / f64::from(k * (k - 1))) * sum;
            k -= 2;
        }
        sum
    };
    [angle * series(15), series(16)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// E[cos θ] over a cosine-weighted hemisphere is 2/3, E[x] = 0: within 4 standard errors of plain sampling, which
    /// a low-discrepancy sequence stays well inside.
    #[test]
    fn directions_are_cosine_weighted() {
        let n = 4096;
        let (mut cos, mut x) = (0.0, 0.0);
        for index in 0..n {
            let d = cosine_hemisphere(Stream::new(1, 2, 3, 4, index).next2());
            cos += d.z;
            x += d.x;
        }
        let n = f64::from(n);
        // Var[cos] = 1/2 − 4/9 = 1/18; Var[x] = 1/4
        assert!((cos / n - 2.0 / 3.0).abs() < 4.0 * (1.0 / 18.0 / n).sqrt());
        assert!((x / n).abs() < 4.0 * (0.25 / n).sqrt());
    }

    #[test]
    fn sines_and_cosines_are_those_of_the_library() {
        for i in -100..=100 {
            let angle = f64::from(i) * std::f64::consts::FRAC_PI_4 / 100.0;
            let [sin, cos] = sine_and_cosine(angle);
            assert!((sin - angle.sin()).abs() < 2e-16 && (cos - angle.cos()).abs() < 2e-16, "{angle}");
        }
    }

    #[test]
    fn every_part_of_the_key_changes_the_numbers() {
        let first = |s: u64, v: u64, p: u64, r: u32, i: u32| Stream::new(s, v, p, r, i).next1();
        let base = first(1, 1, 1, 1, 1);
        for other in [
            first(2, 1, 1, 1, 1),
            first(1, 2, 1, 1, 1),
            first(1, 1, 2, 1, 1),
            first(1, 1, 1, 2, 1),
            first(1, 1, 1, 1, 2),
        ] {
            assert_ne!(base, other);
        }
        assert_eq!(base, first(1, 1, 1, 1, 1));
    }

    /// Each successive pair of the first 64 numbers is stratified: 64 samples put one point into each of 8 × 8 cells, where chance
    /// leaves 23 of them empty.
    #[test]
    fn every_pair_of_numbers_fills_its_plane_evenly() {
        for replicate in 0..16 {
            let mut counts = [[0_u8; 64]; 32];
            for index in 0..64 {
                let mut stream = Stream::new(1, 2, 3, replicate, index);
                for cells in &mut counts {
                    let [x, y] = stream.next2().map(|u| (8.0 * u) as usize);
                    cells[8 * y + x] += 1;
                }
            }
            assert!(counts.iter().flatten().all(|n| *n == 1), "{replicate}: {counts:?}");
        }
    }

    #[test]
    fn late_dimensions_stay_in_the_unit_interval_and_differ() {
        let mut stream = Stream::new(7, 0, 0, 0, 3);
        let draws: Vec<f64> = (0..200).map(|_| stream.next1()).collect();
        assert!(draws.iter().all(|u| (0.0..1.0).contains(u)));
        assert!(draws.windows(2).all(|w| w[0] != w[1]));
    }
}
