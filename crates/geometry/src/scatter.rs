//! Random members of a region: positions uniform in its volume or area, a least distance between them where asked,
//! leaf inclinations after the distributions of canopy models.
//!
//! Inclination θ is that of a leaf's normal against the vertical, 0 … π/2; g(θ) dθ is the share of leaf area, azimuths are
//! uniform. The six classes of de Wit in the trigonometric form of [Bunnik1978], the ones that [Goel1984] fits betas to:
//!
//! ```text
//! planophile   g = 2 (1 + cos 2θ)/π      erectophile    g = 2 (1 − cos 2θ)/π      uniform    g = 2/π
//! plagiophile  g = 2 (1 − cos 4θ)/π      extremophile   g = 2 (1 + cos 4θ)/π      spherical  g = sin θ
//! ```
//!
//! A member depends on (seed, key, its index) alone, by SplitMix64 [Steele2014] seeded with a hash of them; with a least
//! distance it depends on the members before it too. Circles and balls are cut out of squares and cubes, so that positions
//! take no function but the square root and are the same on every machine.

use crate::Pose;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use rustc_hash::FxHashMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// Where members lie, about the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// A ball.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
    /// An upright cylinder about its centre.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Height \[m\].
        height: f64,
    },
    /// A box about its centre.
    Box {
        /// Along x, y, z \[m\].
        size: DVec3,
    },
    /// A level rectangle.
    Rectangle {
        /// Along x and y \[m\].
        size: DVec2,
    },
}

/// Distribution of leaf inclinations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leaves {
    /// As the surface of a sphere.
    Spherical,
    /// Every inclination alike.
    Uniform,
    /// Mostly level.
    Planophile,
    /// Mostly upright.
    Erectophile,
    /// Mostly aslant.
    Plagiophile,
    /// Mostly level or upright.
    Extremophile,
}

/// What is scattered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// How many.
    pub count: u64,
    /// Where.
    pub region: Region,
    /// Least distance between members \[m\].
    pub spacing: Option<f64>,
    /// Scales, uniform between these.
    pub scale: (f64, f64),
    /// Headings \[rad\], uniform between these; not used where there are leaves.
    pub heading: (f64, f64),
    /// Inclinations: +z is a leaf's normal, +y runs down its slope.
    pub leaves: Option<Leaves>,
    /// Seed.
    pub seed: u64,
    /// Tells scatters of one seed apart.
    pub key: u64,
}

/// A region too crowded for the least distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crowded {
    /// How many found a place, or about how many would.
    pub fit: u64,
    /// Whether they were placed rather than estimated.
    pub tried: bool,
}

/// Tries for one member before the region counts as full.
const TRIES: u64 = 20_000;
/// Share of space that spheres and disks fill when thrown at random until none fits [Widom1966; Torquato2006].
const JAMMED: (f64, f64) = (0.384, 0.547);

/// Poses of the members in the region's frame.
///
/// # Errors
/// Where members cannot keep their distance.
pub fn scatter(what: &Scatter) -> Result<Vec<DAffine3>, Crowded> {
    let base = mix(mix(what.seed ^ 0x5ca7_7e20_0000_0000) ^ what.key);
    if let Some(spacing) = what.spacing {
        let most = what.region.jammed(spacing);
        if what.count as f64 > 1.2 * most + 100.0 {
            return Err(Crowded { fit: most as u64, tried: false });
        }
    }
    let mut members = Vec::with_capacity(what.count as usize);
    let mut neighbours = what.spacing.map(Neighbours::new);
    for index in 0..what.count {
        let mut random = Random(mix(base ^ index.wrapping_mul(0xd1b5_4a32_d192_ed03)));
        let between = |(low, high): (f64, f64), u: f64| if low == high { low } else { low + (high - low) * u };
        let scale = between(what.scale, random.unit());
        let turn = match what.leaves {
            Some(leaves) => leaves.turn(&mut random),
            None => {
                let heading = between(what.heading, random.unit());
                Pose { heading, ..Pose::default() }.matrix().matrix3
            }
        };
        let mut tries = 0;
        let at = loop {
            let at = what.region.point(&mut random);
            if neighbours.as_mut().is_none_or(|neighbours| neighbours.take(at, index as u32)) {
                break at;
            }
            tries += 1;
            if tries == TRIES {
                return Err(Crowded { fit: index, tried: true });
            }
        };
        members.push(DAffine3 { matrix3: turn * scale, translation: at });
    }
    Ok(members)
}

impl Region {
    fn point(&self, random: &mut Random) -> DVec3 {
        match *self {
            Self::Sphere { radius } => loop {
                let p = DVec3::new(random.signed(), random.signed(), random.signed());
                if p.length_squared() <= 1.0 {
                    break p * radius;
                }
            },
            Self::Cylinder { radius, height } => {
                let p = random.disk() * radius;
                p.extend(0.5 * height * random.signed())
            }
            Self::Box { size } => 0.5 * size * DVec3::new(random.signed(), random.signed(), random.signed()),
            Self::Rectangle { size } => (0.5 * size * DVec2::new(random.signed(), random.signed())).extend(0.0),
        }
    }

    /// About how many members find a place at random: their own balls or disks fill the region widened by half a distance.
    fn jammed(&self, spacing: f64) -> f64 {
        let s = spacing;
        let ball = PI * s * s * s / 6.0;
        match *self {
            Self::Sphere { radius } => JAMMED.0 * (2.0 * radius / s + 1.0).powi(3),
            Self::Cylinder { radius, height } => JAMMED.0 * PI * (radius + 0.5 * s).powi(2) * (height + s) / ball,
            Self::Box { size } => JAMMED.0 * (size + s).element_product() / ball,
            Self::Rectangle { size } => JAMMED.1 * (size + s).element_product() / (PI * s * s / 4.0),
        }
    }
}

impl Leaves {
    /// Sine and cosine of an inclination.
    fn inclination(self, random: &mut Random) -> (f64, f64) {
        if self == Self::Spherical {
            let cos = random.unit();
            return ((1.0 - cos * cos).sqrt(), cos);
        }
        loop {
            let (sin, cos) = (FRAC_PI_2 * random.unit()).sin_cos();
            let share = match self {
                Self::Planophile => cos * cos,
                Self::Erectophile => sin * sin,
                Self::Plagiophile => 4.0 * sin * sin * cos * cos,
                Self::Extremophile => (cos * cos - sin * sin).powi(2),
                Self::Uniform | Self::Spherical => break (sin, cos),
            };
            if random.unit() < share {
                break (sin, cos);
            }
        }
    }

    fn turn(self, random: &mut Random) -> DMat3 {
        let (sin, cos) = self.inclination(random);
        let down_slope = loop {
            let p = random.disk();
            if p.length_squared() > 1e-6 {
                break p.normalize();
            }
        };
        DMat3::from_cols(
            DVec3::new(down_slope.y, -down_slope.x, 0.0),
            (down_slope * cos).extend(-sin),
            (down_slope * sin).extend(cos),
        )
    }
}

/// Members by cells of one least distance, so that those too near lie in the cells about.
struct Neighbours {
    spacing: f64,
    latest: FxHashMap<[i64; 3], u32>,
    /// Position, and the member before it in its cell.
    members: Vec<(DVec3, u32)>,
}

impl Neighbours {
    fn new(spacing: f64) -> Self {
        Self { spacing, latest: FxHashMap::default(), members: Vec::new() }
    }

    /// Whether a member has its distance; if so it is kept.
    fn take(&mut self, at: DVec3, index: u32) -> bool {
        let cell = (at / self.spacing).floor().to_array().map(|x| x as i64);
        let level = if at.z == 0.0 { 0..=0 } else { -1..=1 };
        for dz in level {
            for (dy, dx) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dy, dx))) {
                let mut next = self.latest.get(&[cell[0] + dx, cell[1] + dy, cell[2] + dz]).copied();
                while let Some(&(other, before)) = next.and_then(|i| self.members.get(i as usize)) {
                    if other.distance_squared(at) < self.spacing * self.spacing {
                        return false;
                    }
                    next = Some(before);
                }
            }
        }
        let before = self.latest.insert(cell, index).unwrap_or(u32::MAX);
        self.members.push((at, before));
        true
    }
}

/// SplitMix64.
struct Random(u64);

impl Random {
    /// In 0 … 1, 1 excluded.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix(self.0) >> 11) as f64 * 2f64.powi(-53)
    }
    fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }
    fn disk(&mut self) -> DVec2 {
        loop {
            let p = DVec2::new(self.signed(), self.signed());
            if p.length_squared() <= 1.0 {
                return p;
            }
        }
    }
}

/// The finaliser of SplitMix64: a bijection of 64 bits.
fn mix(x: u64) -> u64 {
    let z = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Scatter = Scatter {
        count: 40_000,
        region: Region::Rectangle { size: DVec2::new(4.0, 2.0) },
        spacing: None,
        scale: (1.0, 1.0),
        heading: (0.0, 0.0),
        leaves: None,
        seed: 1,
        key: 7,
    };

    /// Kolmogorov–Smirnov: √n D < 1.95 but for one sample in a thousand.
    fn assert_follows(name: &str, mut found: Vec<f64>, cdf: impl Fn(f64) -> f64) {
        found.sort_by(f64::total_cmp);
        let n = found.len() as f64;
        let off = |(i, x): (usize, &f64)| (cdf(*x) - i as f64 / n).abs().max((cdf(*x) - (i + 1) as f64 / n).abs());
        let d = found.iter().enumerate().map(off).fold(0.0, f64::max);
        assert!(d * n.sqrt() < 1.95, "{name}: √n D = {}", d * n.sqrt());
    }

    #[test]
    fn members_are_uniform_in_the_volume_of_their_region() {
        let points = |region| -> Vec<DVec3> {
            scatter(&Scatter { region, ..PLAIN }).unwrap().iter().map(|m| m.translation).collect()
        };
        let ball = points(Region::Sphere { radius: 3.0 });
        assert_follows("ball, r", ball.iter().map(|p| p.length()).collect(), |r| (r / 3.0).powi(3));
        assert_follows("ball, cos θ", ball.iter().map(|p| p.z / p.length()).collect(), |c| 0.5 * (c + 1.0));
        assert_follows("ball, φ", ball.iter().map(|p| p.y.atan2(p.x)).collect(), |phi| 0.5 + 0.5 * phi / PI);
        let drum = points(Region::Cylinder { radius: 2.0, height: 5.0 });
        assert_follows("drum, r", drum.iter().map(|p| p.truncate().length()).collect(), |r| r * r / 4.0);
        assert_follows("drum, z", drum.iter().map(|p| p.z).collect(), |z| z / 5.0 + 0.5);
        let size = DVec3::new(1.0, 4.0, 9.0);
        let crate_ = points(Region::Box { size });
        for a in 0..3 {
            assert_follows("box", crate_.iter().map(|p| p[a]).collect(), |x| x / size[a] + 0.5);
        }
        let field = points(PLAIN.region);
        assert!(field.iter().all(|p| p.z == 0.0 && p.x.abs() <= 2.0 && p.y.abs() <= 1.0));
        // 8 × 8 cells of 625 expected: χ² of 63 degrees of freedom, 103.4 but for one in a thousand
        let mut cells = [0_f64; 64];
        for p in &field {
            cells[((p.x + 2.0) * 2.0) as usize + 8 * ((p.y + 1.0) * 4.0) as usize] += 1.0;
        }
        let chi_square: f64 = cells.iter().map(|n| (n - 625.0).powi(2) / 625.0).sum();
        assert!(chi_square < 103.4 && chi_square > 33.0, "{chi_square}");
    }

    #[test]
    fn leaves_follow_their_inclination_densities_at_uniform_azimuth() {
        type Cdf = fn(f64) -> f64;
        let classes: [(Leaves, Cdf); 6] = [
            (Leaves::Spherical, |t| 1.0 - t.cos()),
            (Leaves::Uniform, |t| t / FRAC_PI_2),
            (Leaves::Planophile, |t| (2.0 * t + (2.0 * t).sin()) / PI),
            (Leaves::Erectophile, |t| (2.0 * t - (2.0 * t).sin()) / PI),
            (Leaves::Plagiophile, |t| (2.0 * t - 0.5 * (4.0 * t).sin()) / PI),
            (Leaves::Extremophile, |t| (2.0 * t + 0.5 * (4.0 * t).sin()) / PI),
        ];
        for (leaves, cdf) in classes {
            let members = scatter(&Scatter { leaves: Some(leaves), ..PLAIN }).unwrap();
            let normals: Vec<DVec3> = members.iter().map(|m| m.matrix3 * DVec3::Z).collect();
            assert_follows(&format!("{leaves:?}"), normals.iter().map(|n| n.z.acos()).collect(), cdf);
            let azimuths = normals.iter().map(|n| n.x.atan2(n.y)).collect();
            assert_follows(&format!("{leaves:?}, azimuth"), azimuths, |phi| 0.5 + 0.5 * phi / PI);
            for m in &members[..100] {
                let m3 = m.matrix3;
                assert!(
                    (m3.determinant() - 1.0).abs() < 1e-12
                        && (m3 * m3.transpose() - DMat3::IDENTITY).abs().x_axis.x < 1e-12
                );
                assert!((m3 * DVec3::Y).z <= 0.0, "a leaf's tip hangs");
            }
        }
    }

    #[test]
    fn scales_and_headings_are_uniform_in_their_ranges() {
        let members = scatter(&Scatter { scale: (0.8, 1.2), heading: (0.5, 2.5), ..PLAIN }).unwrap();
        assert_follows("scale", members.iter().map(|m| (m.matrix3 * DVec3::Z).z).collect(), |s| (s - 0.8) / 0.4);
        let heading = |m: &DAffine3| {
            let ahead = m.matrix3 * DVec3::Y;
            ahead.x.atan2(ahead.y)
        };
        assert_follows("heading", members.iter().map(heading).collect(), |h| (h - 0.5) / 2.0);
    }

    /// 55 % of what random throwing can hold goes in; twice of it does not, and the answer says how many do.
    #[test]
    fn members_keep_their_distance_or_it_is_said_how_many_fit() {
        let regions = [
            (Region::Rectangle { size: DVec2::new(20.0, 10.0) }, 1.0),
            (Region::Sphere { radius: 3.0 }, 0.8),
            (Region::Box { size: DVec3::new(10.0, 10.0, 0.1) }, 0.7),
            (Region::Cylinder { radius: 2.0, height: 4.0 }, 0.6),
        ];
        for (region, spacing) in regions {
            let most = region.jammed(spacing);
            let fits = Scatter { count: (0.55 * most) as u64, region, spacing: Some(spacing), ..PLAIN };
            let members = scatter(&fits).unwrap();
            for (i, a) in members.iter().enumerate() {
                assert!(members[..i].iter().all(|b| b.translation.distance(a.translation) >= spacing));
            }
            let full = scatter(&Scatter { count: (1.15 * most) as u64 + 90, ..fits }).unwrap_err();
            assert!(full.tried && (full.fit as f64 / most - 1.0).abs() < 0.25, "{region:?}: {full:?} of {most}");
            let absurd = scatter(&Scatter { count: 10_000_000, ..fits }).unwrap_err();
            assert!(!absurd.tried && absurd.fit == most as u64);
        }
    }

    /// The numbers themselves, so that a change of the generator is seen: they hold on every machine.
    #[test]
    fn members_depend_on_seed_key_and_index_alone() {
        let members = |what: Scatter| scatter(&what).unwrap();
        let first = members(Scatter { count: 5, ..PLAIN });
        assert_eq!(first, members(PLAIN)[..5]);
        assert_ne!(first, members(Scatter { count: 5, seed: 2, ..PLAIN }));
        assert_ne!(first, members(Scatter { count: 5, key: 8, ..PLAIN }));
    }
}
