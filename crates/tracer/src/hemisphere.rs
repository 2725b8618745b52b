//! Directions over a facet.

use glam::DVec3;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use sunglint_geometry::{FacetId, Hit, Horizon, Patch, World};
use sunglint_radiometry::{Frame, LocalDir, WorldDir};

use crate::Stream;
use crate::sampler::{concentric_disk, cosine_hemisphere};
use crate::sightline::PixelWidth;

/// Sky fraction of an unobstructed facet of this normal: (1 + cos β)/2.
pub(crate) fn open_sky_view(normal: DVec3) -> f64 {
    0.5 * (1.0 + normal.z.clamp(-1.0, 1.0))
}

/// A cosine-weighted direction of the facet's hemisphere.
pub(crate) fn hemisphere_direction(hit: &Hit, stream: &mut Stream) -> WorldDir {
    Frame::about(hit.normal).to_world(LocalDir::from_unit(cosine_hemisphere(stream.next2())))
}

/// A cosine-weighted direction of the hemisphere of a facet that is not level, given that it points below the horizon, from a
/// point of [0, 1)².
///
/// Cosine-weighted directions are uniform in Nusselt's disk about the normal. The horizon is there the half-ellipse
/// y = cos β √(1 − x²), x along the strike and y downhill, so squeezing the disk's chords into what lies beyond it keeps
/// the points uniform.
pub(crate) fn below_horizon(normal: DVec3, u: [f64; 2]) -> WorldDir {
    let cos_tilt = normal.z.clamp(-1.0, 1.0);
    squeezed(normal, concentric_disk(u), |rim, chord| 0.5 * ((1.0 + cos_tilt) * rim + (1.0 - cos_tilt) * chord))
}

/// The direction above the horizon at a point (x, v) of the disk of [`Horizon`], which is uniform there where cosine-weighted
/// directions above the horizon are wanted.
pub(crate) fn above_horizon(normal: DVec3, place: [f64; 2]) -> WorldDir {
    let cos_tilt = normal.z.clamp(-1.0, 1.0);
    squeezed(normal, place, |rim, chord| 0.5 * ((cos_tilt - 1.0) * rim + (1.0 + cos_tilt) * chord))
}

/// The direction at (x, y) of Nusselt's disk, y = `place`(rim, chord) of a uniform point (x, chord), |chord| ≤ rim.
fn squeezed(normal: DVec3, [x, chord]: [f64; 2], place: impl Fn(f64, f64) -> f64) -> WorldDir {
    let rim = (1.0 - x * x).max(0.0).sqrt();
    let y = place(rim, chord);
    let z = (rim * rim - y * y).max(0.0).sqrt();
    let [strike, down] = sides(normal);
    WorldDir::new(x * strike + y * down + z * normal)
}

/// Unit vectors along a facet's strike and downhill.
fn sides(normal: DVec3) -> [DVec3; 2] {
    let down = (normal.z * normal - DVec3::Z).try_normalize().unwrap_or(DVec3::X);
    [down.cross(normal), down]
}

/// The largest whole number up to one, without a call where the processor of a portable build has no instruction for it. Beyond
/// 2⁶³ the nearest there is.
pub(crate) fn floor(x: f64) -> f64 {
    let whole = x as i64 as f64;
    if whole > x { whole - 1.0 } else { whole }
}

/// A facet's plane, divided into squares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Squares {
    /// Their side \[m\], a power of two.
    pub side: f64,
    /// Unit vectors along their sides.
    pub axes: [DVec3; 2],
    pub normal: DVec3,
    /// n·p of the plane.
    pub offset: f64,
}

impl Squares {
    /// The point at (u, v) sides from where the plane is nearest to the origin.
    pub fn point(&self, [u, v]: [f64; 2]) -> DVec3 {
        let [strike, down] = self.axes;
        self.side * (u * strike + v * down) + self.offset * self.normal
    }
}

/// A patch: facet and side, the power of two that its side is, and its place among those.
type PatchKey = (FacetId, bool, i32, i64, i64);

/// A patch that was asked for: its facet and side, its own side, its place among those along the facet's sides, and which
/// horizon it has.
struct Asked {
    of: (FacetId, bool),
    side: f64,
    axes: [DVec3; 2],
    place: [f64; 2],
    horizon: u32,
}

/// Horizons of patches of the facets that fill much of a block.
#[derive(Default)]
pub(crate) struct Horizons {
    /// Facets that they are made for, their side, and their planes.
    facets: SmallVec<[(FacetId, bool, DVec3, f64); 4]>,
    /// How wide pixels are.
    pixel: PixelWidth,
    all: Vec<Horizon>,
    known: FxHashMap<PatchKey, u32>,
    last: Option<Asked>,
}

/// Share of a block that a facet fills for which horizons are made: one costs about as much as 100 samples.
const WORTH_A_HORIZON: f64 = 0.25;
/// Least width of a patch, seen from above, in pixels.
const PATCH_WIDTH: f64 = 4.0;
/// Seen at a flatter angle than this sine, patches grow no longer.
const FLATTEST: f64 = 0.05;
/// Horizons that are kept.
const MOST_HORIZONS: usize = 2048;

impl Horizons {
    /// Makes ready for a block of such pixels, from what rays spread over it meet.
    pub fn begin(&mut self, world: &World, pixel: PixelWidth, hits: &[Option<Hit>]) {
        self.pixel = pixel;
        self.facets.clear();
        for hit in hits.iter().flatten() {
            let is_same = |other: &&Hit| other.facet == hit.facet && other.front == hit.front;
            let filled = hits.iter().flatten().filter(is_same).count();
            if (filled as f64) < WORTH_A_HORIZON * hits.len() as f64 || self.plane_of(hit).is_some() {
                continue;
            }
            let corners = world.facet(hit.facet).corners;
            let offset = corners.first().map_or(hit.normal.dot(hit.point), |corner| hit.normal.dot(*corner));
            let is_plane = corners.iter().all(|corner| (hit.normal.dot(*corner) - offset).abs() <= 16.0 * hit.error);
            if is_plane {
                self.facets.push((hit.facet, hit.front, hit.normal, offset));
            }
        }
        if self.all.len() > MOST_HORIZONS {
            self.all.clear();
            self.known.clear();
            self.last = None;
        }
    }

    /// n·p of the plane of a facet that horizons are made for.
    fn plane_of(&self, hit: &Hit) -> Option<f64> {
        let is_own = |(facet, front, normal, _): &&(FacetId, bool, DVec3, f64)| {
            (*facet, *front, *normal) == (hit.facet, hit.front, hit.normal)
        };
        self.facets.iter().find(is_own).map(|(.., offset)| *offset)
    }

    /// The squares that a facet is divided into where a hit is seen from `outgoing`: as wide as half a block there or up to
    /// twice that. `None` where the facet fills too little of the block to be worth any.
    pub fn squares(&self, hit: &Hit, outgoing: WorldDir) -> Option<Squares> {
        let offset = self.plane_of(hit)?;
        let width = PATCH_WIDTH * self.pixel.at(hit.t) / hit.normal.dot(outgoing.vec()).max(FLATTEST);
        // The power of two above it.
        let side = f64::from_bits(width.to_bits() >> 52 << 52) * 2.0;
        (1e-100..1e100).contains(&width).then(|| Squares { side, axes: sides(hit.normal), normal: hit.normal, offset })
    }

    /// That of the patch about a hit seen from `outgoing`; `None` where it would not be used often enough.
    pub fn at(&mut self, world: &World, hit: &Hit, outgoing: WorldDir) -> Option<u32> {
        let squares = self.squares(hit, outgoing)?;
        let Squares { side, axes, .. } = squares;
        let along = |axis: DVec3| axis.dot(hit.point) / side;
        if let Some(last) = &self.last
            && (last.of, last.side) == ((hit.facet, hit.front), side)
            && (0..2).all(|i| (last.place[i]..last.place[i] + 1.0).contains(&along(last.axes[i])))
        {
            return Some(last.horizon);
        }
        let place @ [u, v] = axes.map(|axis| floor(along(axis)));
        let key = (hit.facet, hit.front, (side.to_bits() >> 52) as i32, u as i64, v as i64);
        let horizon = *self.known.entry(key).or_insert_with(|| {
            let middle = squares.point([u + 0.5, v + 0.5]);
            self.all.push(world.horizon(&Patch { middle, half: 0.5 * side, sides: axes, normal: hit.normal }));
            self.all.len() as u32 - 1
        });
        self.last = Some(Asked { of: (hit.facet, hit.front), side, axes, place, horizon });
        Some(horizon)
    }

    /// One that was made for this block.
    pub fn get(&self, index: u32) -> &Horizon {
        &self.all[index as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};
    use sunglint_geometry::{FacetId, Left, MaterialId};

    /// Directions below the horizon of a facet tilted by β carry the mean cosine to the normal of that lune, and those above
    /// that of the rest: ∫ cos² dω / ∫ cos dω, here by brute-force rejection from the whole hemisphere, within 4 standard
    /// errors.
    #[test]
    fn the_parts_above_and_below_the_horizon_are_cosine_weighted() {
        for beta in [0.3, FRAC_PI_2, 2.5, PI] {
            let normal = DVec3::new(beta.sin() * 0.6, -beta.sin() * 0.8, beta.cos());
            let hit = Hit {
                t: 1.0,
                point: DVec3::ZERO,
                error: 0.0,
                normal,
                front: true,
                material: MaterialId(0),
                instance: 0,
                facet: FacetId(0),
                left: Left::NONE,
            };
            let n = 20_000;
            let moments = |draws: &[DVec3]| {
                let n = draws.len() as f64;
                let mean = draws.iter().map(|d| d.dot(normal)).sum::<f64>() / n;
                (mean, (draws.iter().map(|d| (d.dot(normal) - mean).powi(2)).sum::<f64>() / n / n).sqrt())
            };
            let all: Vec<DVec3> =
                (0..4 * n).map(|i| hemisphere_direction(&hit, &mut Stream::new(2, 0, 0, 0, i)).vec()).collect();
            let share = all.iter().filter(|d| d.z < 0.0).count() as f64 / f64::from(4 * n);
            assert!((share - 0.5 * (1.0 - beta.cos())).abs() < 0.01, "share of the lune at β = {beta}");
            for below in [true, false] {
                let part = |i| match below {
                    true => Some(below_horizon(normal, Stream::new(1, 0, 0, 0, i).next2())),
                    false => {
                        (beta < PI).then(|| above_horizon(normal, concentric_disk(Stream::new(1, 0, 0, 0, i).next2())))
                    }
                };
                let direct: Vec<DVec3> = (0..n).filter_map(part).map(WorldDir::vec).collect();
                let sign = if below { -1.0 } else { 1.0 };
                assert!(direct.iter().all(|d| sign * d.z >= -1e-9 && d.dot(normal) >= -1e-12));
                let rejected: Vec<DVec3> = all.iter().copied().filter(|d| (d.z < 0.0) == below).collect();
                if rejected.is_empty() {
                    continue;
                }
                let (a, b) = (moments(&direct), moments(&rejected));
                assert!((a.0 - b.0).abs() < 4.0 * a.1.hypot(b.1), "β = {beta}, below {below}: {a:?} {b:?}");
            }
        }
    }
}
