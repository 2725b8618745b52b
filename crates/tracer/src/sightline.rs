//! Lines of sight from targets to the sensor: where τ₂ and L_u are solved, and how pixels share them.
//!
//! A provider solves a path for all wavelengths at once, which costs as much as lighting a pixel. So the samples of a
//! pixel whose ranges agree share one line of sight, and pixels of a block that see the same facet take theirs from the
//! block's four corners, bilinearly: τ₂ and L_u enter a pixel's radiance linearly, so the interpolation is done on channel
//! values. What does not lie on one facet, or reaches too far, is solved by itself.

use std::collections::HashMap;
use std::ops::Range;

use glam::DVec3;
use smallvec::SmallVec;
use sunglint_atmosphere::Path;
use sunglint_geometry::{FacetId, Ray};
use sunglint_radiometry::WorldDir;

use crate::paths::Paths;

/// Samples of a pixel share a line of sight where their ranges agree within this factor: the error is of second order
/// in the extinction over the difference.
const CLUSTER_RATIO: f64 = 1.1;
/// Pixels interpolate between a block's corners where the corners' ranges agree within this factor: at an optical depth
/// of 1 along the path the error is below (0.06)²/8 = 5e-4.
const CORNER_RATIO: f64 = 1.06;
/// Fewest clusters that are worth four corners.
const WORTH_CORNERS: usize = 6;

/// The line of sight of a cluster of samples.
#[derive(Clone, Debug)]
pub(crate) struct Sightline {
    pub path: Path,
    /// The facet that all its samples hit, and its plane (normal, point).
    facet: Option<(FacetId, DVec3, DVec3)>,
}

fn path_to(sensor: DVec3, target: DVec3, length: f64, away: WorldDir) -> Path {
    let towards = (sensor - target).try_normalize().map_or(away, WorldDir::from_unit);
    Path { target_height: target.z, sensor_height: sensor.z, length, towards_sensor: towards }
}

/// Groups a pixel's samples by range and marks each with its group; returns the line of sight of each group, from its
/// mean hit to the origin of the pixel's middle ray, and `None` for the samples that leave the scene.
pub(crate) fn cluster(paths: &mut Paths, samples: Range<usize>, middle: &Ray) -> Vec<Option<Sightline>> {
    const MOST: usize = u8::MAX as usize - 1;
    let mut order: Vec<usize> = samples.clone().filter(|i| paths.samples[*i].vertex.is_some()).collect();
    let ranges = order.iter().map(|i| paths.samples[*i].range);
    let (near, far) = ranges.fold((f64::INFINITY, 0.0), |(near, far), r| (f64::min(near, r), f64::max(far, r)));
    if far > near * CLUSTER_RATIO {
        order.sort_by(|a, b| paths.samples[*a].range.total_cmp(&paths.samples[*b].range));
    } else if let Some(nearest) = order.iter().position(|i| paths.samples[*i].range == near) {
        // One group holds them all, whatever their order, if the nearest stands first.
        order.swap(0, nearest);
    }
    let mut sights: Vec<Option<Sightline>> = Vec::new();
    let mut rest = order.as_slice();
    while let Some(first) = rest.first() {
        let reach = if sights.len() == MOST { f64::INFINITY } else { paths.samples[*first].range * CLUSTER_RATIO };
        let (group, later) = rest.split_at(rest.partition_point(|i| paths.samples[*i].range <= reach).max(1));
        rest = later;
        let (mut point, mut range) = (DVec3::ZERO, 0.0);
        let mut facet = None;
        let mut one_facet = true;
        for i in group {
            let sample = &mut paths.samples[*i];
            sample.cluster = sights.len() as u8;
            range += sample.range;
            let hit = &paths.vertices[sample.vertex.expect("only hits are ordered") as usize].hit;
            point += hit.point;
            let (id, _, _) = *facet.get_or_insert((hit.facet, hit.normal, hit.point));
            one_facet &= id == hit.facet;
        }
        let n = group.len() as f64;
        let path = path_to(middle.origin, point / n, range / n, -middle.direction);
        sights.push(Some(Sightline { path, facet: facet.filter(|_| one_facet) }));
    }
    if order.len() < samples.len() {
        for sample in paths.samples[samples].iter_mut().filter(|sample| sample.vertex.is_none()) {
            sample.cluster = sights.len() as u8;
        }
        sights.push(None);
    }
    sights
}

/// What a cluster takes of the solved paths: node and share; `None` looks at the sky itself.
pub(crate) type Shares = Option<SmallVec<[(u32, f64); 4]>>;

/// Where paths are solved for a block of pixels.
#[derive(Debug, Default)]
pub(crate) struct Sightlines {
    pub nodes: Vec<Path>,
    /// By pixel and cluster.
    pub of_pixels: Vec<Vec<Shares>>,
}

impl Sightlines {
    pub fn new<'a>(
        pixels: impl Iterator<Item = ([f64; 2], &'a [Option<Sightline>])>,
        sight: &dyn Fn(f64, f64) -> Ray,
    ) -> Self {
        let pixels: Vec<_> = pixels.collect();
        let mut by_facet: HashMap<FacetId, usize> = HashMap::new();
        let facets = || pixels.iter().flat_map(|(_, sights)| sights.iter().flatten()).filter_map(|s| s.facet);
        facets().for_each(|(id, _, _)| *by_facet.entry(id).or_default() += 1);
        let bound =
            |axis: usize, start: f64, f: fn(f64, f64) -> f64| pixels.iter().map(|(m, _)| m[axis]).fold(start, f);
        let (x0, x1) = (bound(0, f64::INFINITY, f64::min), bound(0, 0.0, f64::max));
        let (y0, y1) = (bound(1, f64::INFINITY, f64::min), bound(1, 0.0, f64::max));
        let rays = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| sight(x, y));

        let mut out = Self::default();
        let mut corners: HashMap<FacetId, Option<u32>> = HashMap::new();
        for (middle, sights) in &pixels {
            let share = |a: f64, b: f64, x: f64| if b > a { (x - a) / (b - a) } else { 0.0 };
            let (u, v) = (share(x0, x1, middle[0]), share(y0, y1, middle[1]));
            let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
            let mut shares = Vec::new();
            for sight in *sights {
                let Some(sight) = sight else {
                    shares.push(None);
                    continue;
                };
                let plane = sight.facet.filter(|(id, _, _)| by_facet[id] >= WORTH_CORNERS);
                let first = plane.and_then(|(id, normal, point)| {
                    *corners.entry(id).or_insert_with(|| corner_nodes(&rays, normal, point, &mut out.nodes))
                });
                shares.push(Some(match first {
                    Some(first) => weights.iter().enumerate().map(|(i, w)| (first + i as u32, *w)).collect(),
                    None => {
                        out.nodes.push(sight.path);
                        SmallVec::from_slice(&[(out.nodes.len() as u32 - 1, 1.0)])
                    }
                }));
            }
            out.of_pixels.push(shares);
        }
        out
    }
}

/// Adds the paths where a block's corner rays meet a plane, if all do at about the same range; index of the first.
fn corner_nodes(rays: &[Ray; 4], normal: DVec3, point: DVec3, nodes: &mut Vec<Path>) -> Option<u32> {
    let ranges = rays.map(|ray| normal.dot(point - ray.origin) / normal.dot(ray.direction.vec()));
    let (near, far) =
        ranges.iter().fold((f64::INFINITY, 0.0), |(near, far), r| (f64::min(near, *r), f64::max(far, *r)));
    if !(near > 0.0 && far <= near * CORNER_RATIO) {
        return None;
    }
    let first = nodes.len() as u32;
    nodes.extend(rays.iter().zip(ranges).map(|(ray, r)| path_to(ray.origin, ray.at(r), r, -ray.direction)));
    Some(first)
}
