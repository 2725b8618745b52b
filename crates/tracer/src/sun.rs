//! The sun at the surfaces of a block, and in what mirrors it.

use std::f64::consts::PI;
use std::rc::Rc;

use glam::DVec3;
use smallvec::SmallVec;
use sunglint_geometry::{Occluder, World};
use sunglint_radiometry::{Frame, LocalDir, WorldDir};

use crate::Illumination;
use crate::light::Block;
use crate::paths::{FacetGroup, GlintLaw, RayCounts};
use crate::render::Proofs;

/// Weight of a draw of density `own` where one of density `other` may find the same [Veach1995, power heuristic, β = 2]. In
/// proportion to the densities themselves a wide lobe would add a thousandth of its light by one draw in a thousand that meets
/// the disk: 3 % of noise a sample, and none where no draw meets it, so that the replicates would state no error.
pub(crate) fn combined(own: f64, other: f64) -> f64 {
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

/// How the sun stands to the points of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Standing {
    /// All are lit, at this cos θ_s.
    Lit(f64),
    /// None is: the facet is turned away, or the sun is down.
    Dark,
    /// None is: something hides all of the sun from each.
    Shaded,
    /// Each for itself.
    Mixed,
}

/// How the sun stands to the vertices of a block at one time.
pub(crate) struct SunLight {
    /// By group.
    pub groups: Vec<Standing>,
    /// I: 1 where the sun is seen, else 0. Of a disk one point is drawn per vertex.
    pub visible: Vec<f64>,
    /// cos θ_s, below 0 where light passes through the surface from behind, 0 where it is turned away.
    pub cos: Vec<f64>,
    /// Whether something hides the sun.
    pub shaded: Vec<bool>,
    /// Of a vertex whose group is mixed: whether nothing can hide any of the sun from the pixel's first surfaces there.
    pub whole: Vec<bool>,
}

/// The sun of one time as vertices see it.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Sun {
    pub middle: WorldDir,
    frame: Frame,
    /// Sine of the disk's radius; 0 for a point.
    radius: f64,
}

impl Sun {
    /// `None` where it is down.
    pub fn new(time: &Illumination, disk: bool) -> Option<Self> {
        let radius = if disk { time.sun_radius.sin() } else { 0.0 };
        time.sun.map(|middle| Self { middle, frame: Frame::about(middle.vec()), radius })
    }

    /// The point that a vertex sees: its middle, or a point of the disk.
    pub fn of(&self, block: &Block<'_>, vertex: usize) -> WorldDir {
        if self.radius == 0.0 {
            return self.middle;
        }
        let [x, y] = block.disk(vertex).map(|c| c * self.radius);
        self.frame.to_world(LocalDir::from_unit(DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())))
    }

    /// Whether all of the disk stands before a facet and above the horizon.
    fn is_before(&self, group: &FacetGroup) -> bool {
        group.normal.dot(self.middle.vec()) > self.radius && self.middle.cos_zenith() > self.radius
    }

    /// Whether it is proved that something hides the whole disk from all points of a group in a box.
    fn is_hidden(&self, world: &World, group: &FacetGroup, (lo, hi): (DVec3, DVec3), by: &Occluder) -> bool {
        // Points stand off their facet, and rays off the points, by the rounding of their place.
        let error = DVec3::splat(1e-12 * (1.0 + lo.abs().max(hi.abs()).max_element()));
        self.is_before(group) && world.is_hidden_by(by, (lo - error, hi + error), self.middle, self.radius.asin())
    }

    /// Whether it is proved that the whole disk shines on all points of a group in a box.
    pub fn is_whole(&self, world: &World, group: &FacetGroup, lo: DVec3, hi: DVec3) -> bool {
        self.is_before(group)
            && world.shaft_is_clear(lo, hi, group.anchor, group.normal, self.middle, self.radius.asin())
    }
}

/// The sun of the times that light a block one after another: experiments under different air may have one.
#[derive(Default)]
pub(crate) struct LastSun(Option<(Option<Sun>, Rc<SunLight>)>);

impl LastSun {
    /// How it stands to a block, that all times of this light, and the rays cast for it.
    pub fn light(&mut self, block: &Block<'_>, disk: Option<Sun>) -> (Rc<SunLight>, RayCounts) {
        if let Some((_, light)) = self.0.as_ref().filter(|(last, _)| *last == disk) {
            return (light.clone(), RayCounts::default());
        }
        let (light, rays) = sun_light(block, disk.as_ref());
        let light = Rc::new(light);
        self.0 = Some((disk, light.clone()));
        (light, rays)
    }
}

/// Casts the sun rays of a block, save those that are proved unnecessary.
fn sun_light(block: &Block<'_>, disk: Option<&Sun>) -> (SunLight, RayCounts) {
    let Block { scenery, paths, groups, .. } = block;
    let n = paths.vertices.len();
    let mut light = SunLight {
        groups: vec![Standing::Mixed; groups.len()],
        visible: vec![0.0; n],
        cos: vec![0.0; n],
        shaded: vec![false; n],
        whole: vec![false; n],
    };
    let mut rays = RayCounts::default();
    let Some(disk) = disk else {
        rays.sun_turned_away += n as u64;
        light.groups.fill(Standing::Dark);
        return (light, rays);
    };
    let sun = disk.middle;
    // Pixels that are proved each by itself mostly see one facet: one proof may serve them all.
    let hit = |group: &FacetGroup| &paths.vertices[group.first as usize].hit;
    let is_alike = |a: &FacetGroup, b: &FacetGroup| {
        block.proofs == Proofs::Alone && (hit(a).facet, hit(a).front) == (hit(b).facet, hit(b).front)
    };
    let mut standings = light.groups.iter_mut();
    for run in groups.chunk_by(is_alike) {
        let (lo, hi) = run.iter().fold((run[0].lo, run[0].hi), |(lo, hi), own| (lo.min(own.lo), hi.max(own.hi)));
        let all = run.len() > 1 && disk.is_whole(&scenery.world, &run[0], lo, hi);
        let mut occluder = Occluder::default();
        for (group, standing) in run.iter().zip(&mut standings) {
            let through = block.passes(group);
            let mu = group.normal.dot(sun.vec());
            let bounds = (group.lo, group.hi);
            if mu <= -disk.radius && !through {
                rays.sun_turned_away += u64::from(group.count);
                *standing = Standing::Dark;
            } else if group.count > 2 {
                let mut is_shaded = !all && disk.is_hidden(&scenery.world, group, bounds, &occluder);
                if !is_shaded && (all || disk.is_whole(&scenery.world, group, group.lo, group.hi)) {
                    // The whole disk shines on the facet: its irradiance is E_n cos θ_s.
                    rays.sun_proved_clear += u64::from(group.count);
                    *standing = Standing::Lit(mu);
                    continue;
                }
                if !is_shaded && disk.is_before(group) {
                    rays.sun += 1;
                    is_shaded = scenery.world.occluded_by(&hit(group).leave(sun), &mut occluder)
                        && disk.is_hidden(&scenery.world, group, bounds, &occluder);
                }
                if is_shaded {
                    rays.sun_proved_shaded += u64::from(group.count);
                    *standing = Standing::Shaded;
                }
            }
        }
    }
    // Groups of first surfaces that the pixel has met: what its first point tells may be proved of the others.
    let mut runs: SmallVec<[(u32, Standing); 8]> = SmallVec::new();
    // What stopped the last ray from a group: most of one facet's points in the shade lie in one shade.
    let mut occluders = vec![Occluder::default(); groups.len()];
    let mut pixel = 0;
    for ((i, vertex), group) in paths.vertices.iter().enumerate().zip(&block.of_vertices) {
        match light.groups[*group as usize] {
            Standing::Dark => continue,
            Standing::Lit(mu) => {
                (light.visible[i], light.cos[i]) = (1.0, mu);
                continue;
            }
            Standing::Shaded => {
                light.shaded[i] = true;
                continue;
            }
            Standing::Mixed if block.proofs == Proofs::Alone => continue,
            Standing::Mixed => {}
        }
        while block.pixels[pixel].end <= i {
            pixel += 1;
            runs.clear();
        }
        let run = runs.iter().find(|(of, _)| of == group);
        match run {
            Some((_, Standing::Lit(mu))) => {
                (light.visible[i], light.cos[i], light.whole[i]) = (1.0, *mu, true);
                rays.sun_proved_clear += 1;
                continue;
            }
            Some((_, Standing::Shaded)) => {
                light.shaded[i] = true;
                rays.sun_proved_shaded += 1;
                continue;
            }
            _ => {}
        }
        let direction = disk.of(block, i);
        let mu = vertex.hit.normal.dot(direction.vec());
        let turned_away = mu <= 0.0 && !block.passes(&groups[*group as usize]);
        if turned_away || direction.cos_zenith() <= 0.0 {
            rays.sun_turned_away += 1;
            continue;
        }
        light.cos[i] = mu;
        rays.sun += 1;
        light.shaded[i] = scenery.world.occluded_by(&vertex.hit.leave(direction), &mut occluders[*group as usize]);
        light.visible[i] = f64::from(u8::from(!light.shaded[i]));
        if vertex.first && run.is_none() {
            let is_own = |j: &usize| block.of_vertices[*j] == *group;
            let points = (i..block.pixels[pixel].end).filter(is_own).map(|j| paths.vertices[j].hit.point);
            let group_of = &groups[*group as usize];
            let (lo, hi) = points.fold((vertex.hit.point, vertex.hit.point), |(lo, hi), p| (lo.min(p), hi.max(p)));
            let standing = match light.shaded[i] {
                true if disk.is_hidden(&scenery.world, group_of, (lo, hi), &occluders[*group as usize]) => {
                    Standing::Shaded
                }
                false if disk.is_whole(&scenery.world, group_of, lo, hi) => {
                    let mu = group_of.normal.dot(sun.vec());
                    (light.cos[i], light.whole[i]) = (mu, true);
                    Standing::Lit(mu)
                }
                _ => Standing::Mixed,
            };
            runs.push((*group, standing));
        }
    }
    (light, rays)
}

/// Solid angle common to two cones about directions `apart` radians from each other, half-angles `a` and `b` \[sr\]. The
/// caps' overlap as circles of radius 2 sin(a/2) on the tangent plane (Lambert's equal-area chart), exact when one
/// holds the other and within (a + b)²/8 of it else.
fn cone_overlap(a: f64, b: f64, apart: f64) -> f64 {
    let (a, b, d) = (2.0 * (0.5 * a).sin(), 2.0 * (0.5 * b).sin(), 2.0 * (0.5 * apart).sin());
    if d >= a + b {
        return 0.0;
    }
    let small = a.min(b);
    if d <= (a - b).abs() {
        return PI * small * small;
    }
    let angle = |r: f64, s: f64| ((d * d + r * r - s * s) / (2.0 * d * r)).clamp(-1.0, 1.0).acos();
    let kite = ((-d + a + b) * (d + a - b) * (d - a + b) * (d + a + b)).max(0.0).sqrt();
    a * a * angle(a, b) + b * b * angle(b, a) - 0.5 * kite
}

/// Half-angle of a cone of solid angle Ω = 2π (1 − cos a) \[rad\].
pub(crate) fn half_angle(solid_angle: f64) -> f64 {
    2.0 * (solid_angle / (4.0 * PI)).clamp(0.0, 1.0).sqrt().asin()
}

/// What a specular component of reflectance 1 returns of E_n about a mirror direction: radiance per irradiance \[sr⁻¹\].
#[allow(clippy::too_many_arguments)]
pub(crate) fn glint(
    time: &Illumination,
    sun: WorldDir,
    mirror: WorldDir,
    escaped: bool,
    solid_angle: f64,
    half_angle: f64,
    law: GlintLaw,
    visible: f64,
    cos: f64,
) -> f64 {
    let omega_sun = time.sun_solid_angle();
    // Far from the lobe nothing is seen, and most mirror directions are far from the sun.
    let reach = half_angle + time.sun_radius;
    if reach < 1.0 && mirror.dot(sun) < 1.0 - 0.5 * reach * reach {
        return 0.0;
    }
    let apart = mirror.angle_to(sun);
    // A lobe no wider than the disk is a mirror: the ray itself finds the disk.
    let is_mirror = solid_angle <= omega_sun * (1.0 + 1e-9);
    let in_disk = apart <= time.sun_radius && escaped;
    match law {
        GlintLaw::Printed => {
            let inside = if is_mirror { in_disk } else { apart <= half_angle && visible > 0.0 };
            if inside { cos / PI } else { 0.0 }
        }
        GlintLaw::Lobe | GlintLaw::Conserving if is_mirror => {
            if in_disk {
                1.0 / omega_sun
            } else {
                0.0
            }
        }
        GlintLaw::Lobe => {
            if apart <= half_angle {
                visible / solid_angle
            } else {
                0.0
            }
        }
        GlintLaw::Conserving => visible * cone_overlap(half_angle, time.sun_radius, apart) / (solid_angle * omega_sun),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cones_that_do_not_meet_share_nothing_and_equal_cones_share_themselves() {
        let whole = |a: f64| 2.0 * PI * (1.0 - a.cos());
        assert_eq!(cone_overlap(0.1, 0.2, 0.31), 0.0);
        assert!((cone_overlap(0.1, 0.3, 0.05) / whole(0.1) - 1.0).abs() < 1e-12);
        assert!((half_angle(whole(0.3)) - 0.3).abs() < 1e-12);
    }

    /// Two equal small circles whose centres are one radius apart share 2π/3 − √3/2 of r².
    #[test]
    fn overlapping_cones_share_a_lens() {
        let r = 1e-3;
        let lens = (2.0 * PI / 3.0 - 3f64.sqrt() / 2.0) * r * r;
        assert!((cone_overlap(r, r, r) / lens - 1.0).abs() < 1e-5);
    }
}
