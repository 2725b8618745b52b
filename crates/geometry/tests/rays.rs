//! What rays through a world must do, against closed forms and against every triangle tested on its own.

#[path = "../examples/leaks/scenes.rs"]
#[allow(dead_code)]
mod scenes;

use glam::{DAffine3, DVec3};

use scenes::LeakScene;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use sunglint_geometry::*;
use sunglint_radiometry::WorldDir;

const GREY: MaterialId = MaterialId(1);
const GRASS: MaterialId = MaterialId(9);
const OFFSETS: [DVec3; 3] =
    [DVec3::ZERO, DVec3::new(430_000.0, 5_100_000.0, 150.0), DVec3::new(5_100_000.0, -5_100_000.0, 0.1)];

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64) * 2f64.powi(-53)
    }
    fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.next()
    }
    fn point(&mut self, half: f64) -> DVec3 {
        DVec3::new(self.within(-half, half), self.within(-half, half), self.within(-half, half))
    }
    fn direction(&mut self) -> WorldDir {
        let (z, phi) = (self.within(-1.0, 1.0), TAU * self.next());
        let r = (1.0 - z * z).sqrt();
        WorldDir::new(DVec3::new(r * phi.cos(), r * phi.sin(), z))
    }
}

fn facet(corners: &[DVec3]) -> Facet {
    Facet::new(corners.to_vec(), GREY).expect("a facet")
}
fn rectangle(at: DVec3, right: DVec3, up: DVec3) -> Facet {
    facet(&[at, at + right, at + right + up, at + up])
}
fn instance(mesh: usize, pose: DAffine3, id: u32) -> Instance {
    Instance { mesh, pose, name: format!("object {id}"), id }
}
fn alone(facets: Vec<Facet>) -> World {
    World::new(vec![Mesh::from_facets(facets)], vec![instance(0, DAffine3::IDENTITY, 7)], None).expect("a world")
}
fn down(x: f64, y: f64) -> Ray {
    Ray::new(DVec3::new(x, y, 100.0), WorldDir::new(DVec3::NEG_Z))
}

/// A ray that starts inside a closed surface, or aims at its middle part from outside, hits, wherever the surface stands.
#[test]
fn no_ray_passes_between_facets_that_share_corners() {
    for offset in OFFSETS {
        let scene = LeakScene::sphere(4, offset);
        let world = scene.world();
        let mut leaks = 0;
        scene.rays(100_000, |ray| leaks += usize::from(world.closest(ray).is_none() || !world.occluded(ray)));
        assert_eq!(leaks, 0, "{}", scene.name);
    }
}

/// Rays at 0.05° to 1° along the rows, the columns and the diagonals of a level grid.
#[test]
fn no_grazing_ray_passes_through_an_aligned_grid() {
    for offset in OFFSETS {
        let scene = LeakScene::grid(offset);
        let world = scene.world();
        let mut leaks = 0;
        scene.rays(100_000, |ray| leaks += usize::from(world.closest(ray).is_none()));
        assert_eq!(leaks, 0, "{}", scene.name);
    }
}

/// A facet 10⁻⁵ m behind another is found by rays that leave the first, at 5×10⁶ m too; near the origin 10⁻⁹ m suffice.
#[test]
fn gaps_far_below_a_tenth_of_a_millimetre_are_resolved() {
    for (offset, gap) in [(OFFSETS[0], 1e-9), (OFFSETS[1], 1e-5), (OFFSETS[2], 1e-5)] {
        let (low, high) =
            (rectangle(offset, DVec3::X, DVec3::Y), rectangle(offset + DVec3::Z * gap, DVec3::X, DVec3::Y));
        let world = alone(vec![low, high]);
        let mut random = Random(3);
        for _ in 0..1_000 {
            let start = offset + DVec3::new(random.within(0.1, 0.9), random.within(0.1, 0.9), -1.0);
            let first = world.closest(&Ray::new(start, WorldDir::UP)).unwrap();
            assert_eq!((first.facet, first.front), (FacetId(0), false));
            let second = world.closest(&first.leave(WorldDir::UP)).unwrap();
            assert_eq!(second.facet, FacetId(1));
            assert!((second.point.z - first.point.z - gap).abs() < 2e-9);
            assert!(world.closest(&second.leave(WorldDir::UP)).is_none());
        }
    }
}

/// Coincident, nested and fanned boxes, on each of which a builder that pairs neighbours becomes quadratic.
#[test]
fn a_hundred_thousand_facets_in_one_place_are_built_and_hit() {
    let n = 100_000;
    // The same box, other facets: right triangles in a unit square, turned about by tiny amounts inside it.
    let same_box = (0..n).map(|i| {
        let e = 1e-6 * f64::from(i);
        facet(&[DVec3::ZERO, DVec3::new(1.0, e, 0.0), DVec3::new(1.0 - e, 1.0, 0.0)])
    });
    let nested = (1..=n).map(|i| {
        rectangle(
            DVec3::new(-1.0, -1.0, 0.0) * f64::from(i),
            DVec3::X * 2.0 * f64::from(i),
            DVec3::Y * 2.0 * f64::from(i),
        )
    });
    let fan = (0..n).map(|i| {
        let rim = |i: i32| {
            DVec3::new((TAU * f64::from(i) / f64::from(n)).cos(), (TAU * f64::from(i) / f64::from(n)).sin(), 0.0)
        };
        facet(&[DVec3::ZERO, rim(i), rim(i + 1)])
    });
    let copies = (0..n).map(|_| rectangle(DVec3::ZERO, DVec3::X, DVec3::Y));
    for facets in [same_box.collect::<Vec<_>>(), nested.collect(), fan.collect(), copies.collect()] {
        let world = alone(facets);
        assert_eq!(world.facet_count(), n as usize);
        assert!(world.closest(&down(0.4, 0.1)).is_some_and(|h| (h.t - 100.0).abs() < 1e-12 && h.front));
        assert!(world.occluded(&down(0.4, 0.1)));
    }
}

/// Infinite and undefined coordinates, worlds too large, flattened objects and missing meshes are named, not traced.
#[test]
fn what_cannot_be_traced_is_refused() {
    let broken = |x: f64| {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::new(0.0, x, 0.0)];
        vec![Mesh::from_facets(vec![Facet { corners, normal: DVec3::Z, area: 1.0, material: GREY }])]
    };
    let one = || vec![instance(0, DAffine3::IDENTITY, 1)];
    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(matches!(World::new(broken(x), one(), None), Err(WorldError::NotFinite { .. })), "{x}");
        let ground = Some(Ground { height: x, material: GRASS });
        assert!(matches!(World::new(broken(1.0), one(), ground), Err(WorldError::NotFinite { .. })));
        let placed = vec![instance(0, DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)), 1)];
        assert!(matches!(World::new(broken(1.0), placed, None), Err(WorldError::NotFinite { .. })));
    }
    assert!(matches!(World::new(broken(1e10), one(), None), Err(WorldError::TooLarge { .. })));
    let flat = vec![instance(0, DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)), 1)];
    assert!(matches!(World::new(broken(1.0), flat, None), Err(WorldError::Flattened { .. })));
    assert!(matches!(World::new(vec![], one(), None), Err(WorldError::NoSuchMesh { mesh: 0, meshes: 0, .. })));
    let empty = World::new(vec![Mesh::from_facets(vec![])], one(), None).unwrap();
    assert!(empty.closest(&down(0.0, 0.0)).is_none() && empty.bounds().is_none());
    let nan = Ray::new(DVec3::NAN, WorldDir::from_unit(DVec3::NAN));
    assert!(alone(vec![rectangle(DVec3::ZERO, DVec3::X, DVec3::Y)]).closest(&nan).is_none());
}

/// A wall of 2 × 1 m at scale 3, heading 90°, at (100, 50, 5): its southern face, front to the south, looks west.
#[test]
fn an_instance_is_hit_where_scale_heading_and_position_put_it() {
    let wall = rectangle(DVec3::new(-1.0, 0.0, 0.0), DVec3::X * 2.0, DVec3::Z);
    let pose = Pose { at: DVec3::new(100.0, 50.0, 5.0), heading: FRAC_PI_2, scale: 3.0, ..Pose::default() };
    let other = Pose { at: DVec3::new(-500.0, 0.0, 0.0), ..Pose::default() };
    let instances = vec![instance(0, other.matrix(), 4), instance(0, pose.matrix(), 8)];
    let world = World::new(vec![Mesh::from_facets(vec![wall])], instances, None).unwrap();
    let hit = world.closest(&Ray::new(DVec3::new(0.0, 52.9, 7.9), WorldDir::new(DVec3::X))).unwrap();
    assert!((hit.t - 100.0).abs() < 1e-12 && (hit.normal - DVec3::NEG_X).length() < 1e-15);
    assert_eq!((hit.instance, hit.facet, hit.front, hit.material), (8, FacetId(1), true, GREY));
    assert!(world.closest(&Ray::new(DVec3::new(0.0, 53.1, 7.9), WorldDir::new(DVec3::X))).is_none());
    let facet = world.facet(hit.facet);
    assert!(
        (facet.area - 18.0).abs() < 1e-12
            && (facet.aspect() - 1.5 * PI).abs() < 1e-12
            && (facet.tilt() - FRAC_PI_2).abs() < 1e-12
    );
    let (lo, hi) = world.bounds().unwrap();
    assert!(
        (lo - DVec3::new(-501.0, 0.0, 0.0)).length() < 1e-12 && (hi - DVec3::new(100.0, 53.0, 8.0)).length() < 1e-12
    );
}

/// A mirrored instance keeps its front, and its corners still run counter-clockwise.
#[test]
fn a_mirrored_instance_keeps_its_front() {
    let mesh = Mesh::from_facets(vec![rectangle(DVec3::ZERO, DVec3::X, DVec3::Y)]);
    let world =
        World::new(vec![mesh], vec![instance(0, DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)), 1)], None).unwrap();
    assert!(world.closest(&down(-0.5, 0.5)).unwrap().front);
    let f = world.facet(FacetId(0));
    assert!((facet(&f.corners).normal - DVec3::Z).length() < 1e-15 && f.normal == DVec3::Z);
}

/// The ground is an analytic plane, hides what is below, gives way to a panel that lies on it, and is no facet's instance.
#[test]
fn the_ground_is_met_where_its_height_says() {
    let ground = Some(Ground { height: 2.0, material: GRASS });
    let panel = rectangle(DVec3::new(0.0, 0.0, 2.0), DVec3::X, DVec3::Y);
    let cellar = rectangle(DVec3::new(5.0, 0.0, 1.0), DVec3::X, DVec3::Y);
    let one = vec![instance(0, DAffine3::IDENTITY, 3)];
    let world = World::new(vec![Mesh::from_facets(vec![panel, cellar])], one, ground).unwrap();
    let slope = WorldDir::from_zenith_azimuth(PI - 1.5, 0.3);
    let hit = world.closest(&Ray::new(DVec3::new(-50.0, 0.0, 7.0), slope)).unwrap();
    assert!((hit.t - 5.0 / 1.5f64.cos()).abs() < 1e-10 && hit.point.z == 2.0 && hit.front);
    assert_eq!((hit.instance, hit.facet, hit.material), (GROUND_OBJECT, FacetId::GROUND, GRASS));
    assert_eq!(world.closest(&down(0.5, 0.5)).unwrap().facet, FacetId(0));
    assert_eq!(world.closest(&down(5.5, 0.5)).unwrap().facet, FacetId::GROUND);
    let below = Ray::new(DVec3::new(9.0, 9.0, 0.0), WorldDir::UP);
    assert!(world.closest(&below).is_some_and(|h| !h.front && h.normal == DVec3::NEG_Z));
    for (x, y) in [(0.5, 0.5), (0.0, 0.0), (1.0 + 1e-12, 0.3), (-3.0, 8.0)] {
        let hit = world.closest(&down(x, y)).unwrap();
        for zenith in [0.0, 1.0, FRAC_PI_2 - 1e-9] {
            assert!(!world.occluded(&hit.leave(WorldDir::from_zenith_azimuth(zenith, 1.0))), "{x} {y} {zenith}");
        }
        assert!(
            world.occluded(&Ray { t_max: 100.0, ..down(x, y) }) && !world.occluded(&Ray { t_max: 97.9, ..down(x, y) })
        );
    }
    assert_eq!(world.facet(FacetId::GROUND).normal, DVec3::Z);
}

/// A U of 3 × 3 with a notch of 1 × 2: rays through the notch pass, rays beside it hit the one facet.
#[test]
fn rays_pass_the_notch_of_a_concave_facet() {
    let u = [(0., 0.), (3., 0.), (3., 3.), (2., 3.), (2., 1.), (1., 1.), (1., 3.), (0., 3.)];
    let world = alone(vec![facet(&u.map(|(x, y)| DVec3::new(x, y, 0.0)))]);
    let mut random = Random(5);
    for _ in 0..10_000 {
        let (x, y) = (random.within(-0.5, 3.5), random.within(-0.5, 3.5));
        let notch = (1.0..2.0).contains(&x) && y > 1.0;
        let inside = (0.0..3.0).contains(&x) && (0.0..3.0).contains(&y) && !notch;
        assert_eq!(world.occluded(&down(x, y)), inside, "{x} {y}");
    }
}

/// Two panels back to back in one plane: each is seen from its own side, whatever their diagonals.
#[test]
fn of_facets_in_one_plane_the_one_facing_the_ray_is_seen() {
    for offset in OFFSETS {
        let tilted = panel_facets(GRASS, 2.0, 1.4, DVec3::new(0.3, -0.5, 0.8), offset);
        let mut back = panel_facets(GREY, 2.4, 1.6, DVec3::new(-0.3, 0.5, -0.8), offset);
        back.corners.rotate_left(1);
        for pair in [[&tilted, &back], [&back, &tilted]] {
            let world = alone(pair.map(Clone::clone).to_vec());
            let mut random = Random(11);
            for _ in 0..1_000 {
                let (edge_a, edge_b) = (tilted.corners[1] - tilted.corners[0], tilted.corners[2] - tilted.corners[1]);
                let target = offset + random.within(-0.45, 0.45) * edge_a + random.within(-0.45, 0.45) * edge_b;
                let from = offset + random.point(20.0);
                let side = (from - offset).dot(tilted.normal);
                if side.abs() > 0.5 {
                    let hit = world.closest(&Ray::new(from, WorldDir::new(target - from))).unwrap();
                    assert_eq!((hit.material, hit.front), (if side > 0.0 { GRASS } else { GREY }, true));
                }
            }
        }
    }
}

/// Rays that leave a hit on either side, grazing ones included, never meet the facet they leave; the point lies on it.
#[test]
fn a_ray_never_meets_the_facet_it_leaves() {
    let mut random = Random(17);
    for offset in OFFSETS {
        for round in 0..200 {
            let (a, b) = (random.direction().vec(), random.direction().vec());
            let (right, up) =
                (a * random.within(0.001, 1e3), (b - a * a.dot(b)).normalize() * random.within(0.001, 1e3));
            let pose = Pose {
                at: if round % 2 == 0 { offset } else { DVec3::ZERO },
                heading: random.within(0.0, TAU),
                pitch: random.within(-1.5, 1.5),
                roll: random.within(-3.0, 3.0),
                scale: random.within(0.01, 20.0),
            };
            let own = if round % 2 == 0 { random.point(100.0) } else { offset };
            let pose = if round % 3 == 0 { DAffine3::IDENTITY } else { pose.matrix() };
            let mesh = Mesh::from_facets(vec![rectangle(own, right, up)]);
            let Ok(world) = World::new(vec![mesh], vec![instance(0, pose, 1)], None) else { panic!("round {round}") };
            let facet = world.facet(FacetId(0));
            let (edge_a, edge_b) = (facet.corners[1] - facet.corners[0], facet.corners[3] - facet.corners[0]);
            for _ in 0..50 {
                let target = facet.corners[0] + edge_a * random.within(0.1, 0.9) + edge_b * random.within(0.1, 0.9);
                let toward = random.direction();
                let from = target - toward.vec() * [1.0, 1e3, 7e5][round % 3];
                let Some(hit) = world.closest(&Ray::new(from, toward)) else { continue };
                let off = facet.normal.dot(hit.point - facet.corners[0]);
                assert!(off.abs() <= 2.0 * hit.error, "{off} {}", hit.error);
                for grazing in [1.0, 1e-3, 1e-9, -1e-9, -1.0] {
                    let along =
                        edge_a.normalize() * random.within(-1.0, 1.0) + edge_b.normalize() * random.within(-1.0, 1.0);
                    // Beyond the error bound, it does so though nobody tells it where it starts.
                    let ray = hit.leave(WorldDir::new(along.normalize() + hit.normal * grazing));
                    for ray in [ray, Ray { left: Left::NONE, ..ray }] {
                        assert!(world.closest(&ray).is_none(), "round {round}, grazing {grazing}, error {}", hit.error);
                    }
                }
            }
        }
    }
}

/// What a ray meets is the same whether or not it is told which facet it leaves: in a crowd of instances, alone and joined.
#[test]
fn a_ray_meets_the_same_whether_or_not_it_knows_what_it_leaves() {
    let mut random = Random(91);
    let mut met = 0;
    for (seed, offset) in OFFSETS.into_iter().enumerate() {
        let world = crowd(seed as u64, offset, seed == 0);
        for _ in 0..4_000 {
            let from = offset + random.point(40.0);
            let Some(hit) = world.closest(&Ray::new(from, random.direction())) else { continue };
            let told = hit.leave(random.direction());
            let untold = Ray { left: Left::NONE, ..told };
            assert_eq!(world.closest(&told), world.closest(&untold));
            assert_eq!(world.occluded(&told), world.occluded(&untold));
            met += usize::from(world.occluded(&told));
        }
    }
    assert!(met > 1_000, "{met}");
}

/// Corners typed to the millimetre bend a roof of 10 m a little. Its triangles are hit where they are, each by its own
/// normal, and what leaves one of them upwards passes.
#[test]
fn a_bent_facet_is_traced_as_its_triangles() {
    let corners = [[0., 0., 0.], [10., 0., 0.], [10., 7., 3.0009], [0., 7., 3.]].map(DVec3::from_array);
    let world = alone(vec![facet(&corners)]);
    let halves = [corners[0], corners[1], corners[2], corners[3]];
    let height = |x: f64, y: f64| {
        let plane = |[a, b, c]: [DVec3; 3]| {
            let n = (b - a).cross(c - a);
            a.z - (n.x * (x - a.x) + n.y * (y - a.y)) / n.z
        };
        // either diagonal, so within the bend of the truth
        [
            plane([halves[0], halves[1], halves[2]]),
            plane([halves[0], halves[2], halves[3]]),
            plane([halves[0], halves[1], halves[3]]),
            plane([halves[1], halves[2], halves[3]]),
        ]
    };
    let mut random = Random(29);
    for _ in 0..2_000 {
        let (x, y) = (random.within(0.1, 9.9), random.within(0.1, 6.9));
        let hit = world.closest(&down(x, y)).unwrap();
        assert!(height(x, y).iter().any(|z| (hit.point.z - z).abs() < 1e-13));
        assert!((100.0 - hit.t - hit.point.z).abs() < 1e-12);
        assert!(!world.occluded(&hit.leave(WorldDir::new(hit.normal + random.direction().vec() * 0.99))));
    }
}

/// A 1 km × 1 mm sliver is hit on its whole length and nowhere beside it.
#[test]
fn slivers_are_hit_where_they_are() {
    for offset in OFFSETS {
        let world = alone(vec![rectangle(offset, DVec3::X * 1e3, DVec3::Y * 1e-3)]);
        let mut random = Random(23);
        for _ in 0..10_000 {
            let y = random.within(-1e-3, 2e-3);
            let from = offset + DVec3::new(random.within(1.0, 999.0), y, 50.0);
            if (y - 1e-3).abs() > 1e-8 && y.abs() > 1e-8 {
                assert_eq!(world.occluded(&Ray::new(from, WorldDir::new(DVec3::NEG_Z))), (0.0..1e-3).contains(&y));
            }
        }
    }
}

/// A crowd of turned, scaled and stretched objects: small boxes, panels, triangles, and one large slab. Those of odd seeds are
/// mirrored here and there, so that they are not joined to one mesh.
fn crowd(seed: u64, offset: DVec3, ground: bool) -> World {
    let mut random = Random(seed);
    let soup = (0..30).filter_map(|_| {
        let at = random.point(3.0);
        Facet::new(vec![at, at + random.point(1.0), at + random.point(1.0)], GREY).ok()
    });
    let meshes = vec![
        Mesh::from_facets(soup.collect()),
        Mesh::from_facets(box_facets(GREY, DVec3::new(2.0, 3.0, 4.0))),
        Mesh::from_facets(vec![panel_facets(GREY, 1.0, 2.0, DVec3::new(1.0, 0.2, 0.4), DVec3::ZERO)]),
        Mesh::from_facets(vec![rectangle(
            DVec3::new(-60.0, -60.0, -12.0),
            DVec3::X * 120.0,
            DVec3::new(0.0, 120.0, 3.0),
        )]),
    ];
    let mut instances: Vec<Instance> = (0..60)
        .map(|i| {
            let pose = Pose {
                at: offset + random.point(20.0),
                heading: random.within(0.0, TAU),
                pitch: random.within(-1.0, 1.0),
                roll: random.within(-1.0, 1.0),
                scale: random.within(0.2, 2.0),
            };
            let mirrored = if seed % 2 == 1 { -0.6 } else { 0.6 };
            let stretch = if i % 5 == 0 { DVec3::new(1.0, mirrored, 1.4) } else { DVec3::ONE };
            instance((i % 3) as usize, pose.matrix() * DAffine3::from_scale(stretch), i)
        })
        .collect();
    instances.push(instance(3, DAffine3::from_translation(offset), 99));
    World::new(meshes, instances, ground.then_some(Ground { height: offset.z - 15.0, material: GRASS }))
        .expect("a world")
}

/// Whether instances are joined to one mesh or not, facets, their numbers and their objects are those of the scene.
#[test]
fn facets_and_objects_keep_their_numbers_in_a_joined_mesh() {
    let meshes = vec![
        Mesh::from_facets(box_facets(GREY, DVec3::new(2.0, 3.0, 4.0))),
        Mesh::from_facets(box_facets(GRASS, DVec3::ONE)),
        Mesh::from_facets(vec![panel_facets(GRASS, 1.0, 2.0, DVec3::new(1.0, 0.2, 0.4), DVec3::ZERO)]),
    ];
    let turned = Pose { at: DVec3::new(9.0, 1.0, 0.0), heading: 0.7, pitch: 0.2, roll: -0.4, scale: 1.5 }.matrix();
    let mirrored = DAffine3::from_translation(DVec3::X * -9.0) * DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0));
    let far = DAffine3::from_translation(DVec3::new(0.0, 20.0, 0.0));
    // The second mesh has a mirrored instance and stays by itself, between two that are joined.
    let instances = vec![
        instance(0, DAffine3::IDENTITY, 10),
        instance(1, mirrored, 11),
        instance(2, far, 12),
        instance(0, turned, 13),
        instance(1, DAffine3::from_translation(DVec3::Y * -9.0), 14),
    ];
    let world = World::new(meshes.clone(), instances.clone(), None).expect("a world");
    let mut id = 0;
    for placed in &instances {
        for facet in meshes[placed.mesh].facets() {
            let found = world.facet(FacetId(id));
            let due: Vec<DVec3> = facet.corners.iter().map(|c| placed.pose.transform_point3(*c)).collect();
            let has = |c: &DVec3| found.corners.iter().any(|own| own.distance(*c) < 1e-12);
            assert!(found.corners.len() == due.len() && due.iter().all(has), "facet {id}");
            let outwards = found.centre() + 0.01 * found.normal;
            let hit = world.closest(&Ray::new(outwards, WorldDir::new(-found.normal))).expect("the facet is hit");
            assert_eq!((hit.facet, hit.instance, hit.front), (FacetId(id), placed.id, true));
            assert_eq!(hit.material, facet.material);
            assert!(hit.normal.distance(found.normal) < 1e-12 && (hit.t - 0.01).abs() < 1e-12);
            id += 1;
        }
    }
    assert_eq!(world.facet_count() as u32, id);
    assert_eq!((world.meshes().len(), world.instances().len()), (3, 5));
}

/// All triangles of the world, each tested on its own [Moeller1997]: nearest distance, and the least distance of the ray
/// from an edge in barycentric terms, below which rounding may decide either way.
struct Brute(Vec<(FacetId, [DVec3; 3])>);

impl Brute {
    fn new(world: &World) -> Self {
        let mut all = Vec::new();
        for id in (0..world.facet_count() as u32).map(FacetId) {
            let c = world.facet(id).corners;
            assert!(c.len() <= 4);
            all.push((id, [c[0], c[1], c[2]]));
            if let [a, _, c, d] = c[..] {
                all.push((id, [a, c, d]));
            }
        }
        Self(all)
    }
    fn closest(&self, ray: &Ray) -> (f64, f64) {
        let (mut nearest, mut margin) = (f64::INFINITY, f64::INFINITY);
        let d = ray.direction.vec();
        for (_, [a, b, c]) in &self.0 {
            let (e, f, s) = (*b - *a, *c - *a, ray.origin - *a);
            let p = d.cross(f);
            let det = e.dot(p);
            let q = s.cross(e);
            let (u, v, t) = (s.dot(p) / det, d.dot(q) / det, f.dot(q) / det);
            let inside = u.min(v).min(1.0 - u - v);
            if t > 0.0 && inside > 0.0 {
                nearest = nearest.min(t);
            }
            if t > -1e-6 {
                margin = margin.min(inside.abs());
            }
        }
        (nearest, margin)
    }
}

#[test]
fn hits_are_those_of_testing_every_facet() {
    let mut compared = 0;
    for (seed, offset) in (0..12).zip(OFFSETS.into_iter().cycle()) {
        let world = crowd(seed, offset, false);
        let brute = Brute::new(&world);
        let mut random = Random(seed + 100);
        let mut last = Occluder::default();
        for i in 0..3_000 {
            let far = [30.0, 1e3, 7e5][i % 3];
            let target = offset + random.point(20.0);
            let ray = if i % 2 == 0 {
                Ray::new(target, random.direction())
            } else {
                let d = random.direction();
                Ray::new(target - d.vec() * far, d)
            };
            let (t, margin) = brute.closest(&ray);
            if margin < 1e-6 {
                continue;
            }
            compared += 1;
            let hit = world.closest(&ray);
            assert_eq!(hit.is_some(), t.is_finite(), "{ray:?}");
            assert_eq!(world.occluded(&ray), t.is_finite());
            // What stopped another ray, and then this one, changes nothing.
            assert_eq!(world.occluded_by(&ray, &mut last), t.is_finite());
            assert_eq!(world.occluded_by(&ray, &mut last), t.is_finite());
            if let Some(hit) = hit {
                let short = Ray { t_max: hit.t * (1.0 - 1e-9) - 1e-6, ..ray };
                assert!(!world.occluded_by(&short, &mut last));
                let near = Ray::new(ray.origin, WorldDir::new(ray.direction.vec() + 1e-3 * random.direction().vec()));
                assert_eq!(world.occluded_by(&near, &mut last), world.occluded(&near));
                // rounding of coordinates along the ray, which grows where it grazes
                let tolerance = 1e-14 * (far + offset.length()) / hit.normal.dot(ray.direction.vec()).abs() + 1e-12;
                assert!((hit.t - t).abs() < 20.0 * tolerance, "{} {t}", hit.t);
                let facet = world.facet(hit.facet);
                assert!(facet.normal.dot(hit.point - facet.corners[0]).abs() <= 2.0 * hit.error);
                assert_eq!(hit.front, facet.normal.dot(ray.direction.vec()) <= 0.0);
                assert!(!world.occluded(&Ray { t_max: hit.t * (1.0 - 1e-9) - 1e-6, ..ray }));
                assert!(world.occluded(&Ray { t_max: hit.t * (1.0 + 1e-9) + 1e-6, ..ray }));
            }
        }
    }
    assert!(compared > 30_000, "{compared}");
}

/// The same hits to the last bit from trees built by one thread and by several.
#[test]
fn hits_do_not_depend_on_the_number_of_threads() {
    let scene = LeakScene::sphere(5, OFFSETS[1]);
    let built =
        |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| scene.world());
    let (one, four) = (built(1), built(4));
    scene.rays(5_000, |ray| assert_eq!(one.closest(ray), four.closest(ray)));
}

/// A shaft that is proven clear lets every ray of it pass; and many shafts are proven, or the proof is of no use.
#[test]
fn no_ray_of_a_clear_shaft_is_blocked() {
    let (mut proven, mut free, mut tried) = (0, 0, 0);
    for (seed, offset) in (0..12).zip(OFFSETS.into_iter().cycle()) {
        let world = crowd(seed, offset, seed % 2 == 0);
        let mut random = Random(seed + 200);
        for i in 0..1_500 {
            let Some(first) = world.closest(&Ray::new(offset + random.point(25.0), random.direction())) else {
                continue;
            };
            let size = [1e-3, 0.05, 0.5][i % 3];
            let spread = [0.0, 0.004_65, 0.05][i / 3 % 3];
            let d = random.direction().vec();
            let direction = WorldDir::new(if d.dot(first.normal) < 0.0 { -d } else { d });
            // points of the facet's plane, and their box
            let (t, b) =
                (first.normal.any_orthonormal_vector(), first.normal.cross(first.normal.any_orthonormal_vector()));
            let points: Vec<DVec3> = (0..6)
                .map(|_| first.point + (t * random.within(-1.0, 1.0) + b * random.within(-1.0, 1.0)) * size)
                .collect();
            let (lo, hi) = points.iter().fold((points[0], points[0]), |(lo, hi), &p| (lo.min(p), hi.max(p)));
            let clear = world.shaft_is_clear(lo, hi, first.point, first.normal, direction, spread);
            let mut blocked = false;
            for point in points {
                for _ in 0..20 {
                    let axis = direction.vec();
                    let aside = axis.any_orthonormal_vector() * random.within(-1.0, 1.0)
                        + axis.cross(axis.any_orthonormal_vector()) * random.within(-1.0, 1.0);
                    let aside = if aside.length() > 1.0 { DVec3::ZERO } else { aside };
                    let ray = Hit { point, ..first }.leave(WorldDir::new(axis + aside * spread.tan()));
                    blocked |= world.occluded(&ray);
                }
            }
            assert!(!(clear && blocked), "seed {seed}, case {i}");
            (proven, free, tried) = (proven + usize::from(clear), free + usize::from(!blocked), tried + 1);
        }
    }
    assert!(tried > 8_000 && 10 * proven > 8 * free, "{proven} proven of {free} free of {tried}");
}

/// What is proven to be hidden by the facet that stopped one ray is reached by none; and much of what is hidden so is proven.
#[test]
fn no_ray_reaches_what_a_facet_is_proven_to_hide() {
    let (mut proven, mut hidden, mut tried) = (0, 0, 0);
    for (seed, offset) in (0..12).zip(OFFSETS.into_iter().cycle()) {
        let world = crowd(seed, offset, seed % 2 == 0);
        let mut random = Random(seed + 300);
        for i in 0..1_500 {
            let size = [1e-3, 0.05, 0.3][i % 3];
            let spread = [0.0, 0.004_65, 0.05][i / 3 % 3];
            let middle = offset + random.point(15.0);
            let direction = random.direction();
            let half = DVec3::new(random.within(0.0, size), random.within(0.0, size), random.within(0.0, size));
            let mut occluder = Occluder::default();
            if !world.occluded_by(&Ray::new(middle, direction), &mut occluder) {
                continue;
            }
            let claimed = world.is_hidden_by(&occluder, (middle - half, middle + half), direction, spread);
            let axis = direction.vec();
            let (u, v) = axis.any_orthonormal_pair();
            let mut stopped = true;
            for _ in 0..60 {
                let point = middle
                    + half * DVec3::new(random.within(-1.0, 1.0), random.within(-1.0, 1.0), random.within(-1.0, 1.0));
                let (r, turn) = (random.within(0.0, 1.0).sqrt() * spread.tan(), random.within(0.0, TAU));
                let ray = Ray::new(point, WorldDir::new(axis + r * (turn.cos() * u + turn.sin() * v)));
                stopped &= world.occluded(&ray);
            }
            assert!(stopped || !claimed, "seed {seed}, case {i}");
            (proven, hidden, tried) = (proven + usize::from(claimed), hidden + usize::from(stopped), tried + 1);
        }
        assert!(!world.is_hidden_by(&Occluder::default(), (offset, offset), WorldDir::UP, 0.0));
    }
    assert!(tried > 3_000 && 5 * proven > 2 * hidden, "{proven} proven of {hidden} hidden of {tried}");
}

/// A flat roof of many coplanar facets under a low sun, far from the origin: none of its parts shades another.
#[test]
fn coplanar_facets_do_not_block_a_shaft() {
    for offset in OFFSETS {
        let slope = DVec3::new(0.0, 0.8, 0.6);
        let tile = |i: i32, j: i32| rectangle(offset + DVec3::X * f64::from(i) + slope * f64::from(j), DVec3::X, slope);
        let world = alone((0..400).map(|k| tile(k % 20, k / 20)).collect());
        let (lo, hi) = (offset + DVec3::new(3.1, 3.1 * 0.8, 3.1 * 0.6), offset + DVec3::new(3.9, 3.9 * 0.8, 3.9 * 0.6));
        let normal = DVec3::X.cross(slope);
        for elevation in [0.02, 0.3, 1.0] {
            let sun = WorldDir::new(normal * f64::sin(elevation) + DVec3::X * f64::cos(elevation));
            assert!(world.shaft_is_clear(lo, hi, lo, normal, sun, 0.004_65), "{elevation} at {offset}");
            // from 0.1 m below, not
            let below = 0.1 * normal;
            assert!(elevation < 0.1 || !world.shaft_is_clear(lo - below, hi - below, lo - below, normal, sun, 0.0));
        }
        assert!(world.is_open(FacetId(37), true) && world.is_open(FacetId(37), false));
    }
}

/// Open means that no corner of another facet is above the plane, to rounding; never claimed where one is.
#[test]
fn a_facet_is_open_if_no_corner_rises_above_its_plane() {
    for (seed, offset) in (0..6).zip(OFFSETS.into_iter().cycle()) {
        let world = crowd(seed, offset, seed % 2 == 1);
        let corners: Vec<(FacetId, DVec3)> =
            Brute::new(&world).0.iter().flat_map(|(id, t)| t.map(|c| (*id, c))).collect();
        for id in (0..world.facet_count() as u32).map(FacetId) {
            let facet = world.facet(id);
            for front in [true, false] {
                let normal = if front { facet.normal } else { -facet.normal };
                let rise = corners
                    .iter()
                    .filter(|c| c.0 != id)
                    .map(|c| normal.dot(c.1 - facet.centre()))
                    .fold(f64::NEG_INFINITY, f64::max);
                let tolerance = 1e-8;
                let sunk =
                    world.ground().is_some_and(|g| facet.corners.iter().any(|c| c.z < g.height) && normal.z > 0.0);
                let answer = world.is_open(id, front);
                assert_eq!(answer, world.is_open(id, front));
                if rise > tolerance || sunk {
                    assert!(!answer, "{id:?} {rise}");
                } else if rise < -tolerance {
                    assert!(answer, "{id:?} {rise}");
                }
            }
        }
    }
    // A box on the ground: its roof is open, its walls are too (the ground does not count), its inner sides are not.
    let ground = Some(Ground { height: 0.0, material: GRASS });
    let shed = || Mesh::from_facets(box_facets(GREY, DVec3::new(3.0, 4.0, 2.5)));
    let world = World::new(vec![shed()], vec![instance(0, DAffine3::IDENTITY, 1)], ground).unwrap();
    assert!((0..6).all(|i| world.is_open(FacetId(i), true) && !world.is_open(FacetId(i), false)));
    assert!(!world.is_open(FacetId::GROUND, true) && world.is_open(FacetId::GROUND, false));
    assert!(World::new(vec![], vec![], ground).unwrap().is_open(FacetId::GROUND, true));
}

/// The direction at a point of the disk of a horizon: its chord stretched back to that above the world's horizon.
fn towards([strike, down]: [DVec3; 2], normal: DVec3, [x, v]: [f64; 2]) -> WorldDir {
    let rim = (1.0 - x * x).max(0.0).sqrt();
    let y = 0.5 * ((1.0 + normal.z) * v - (1.0 - normal.z) * rim);
    WorldDir::new(x * strike + y * down + (rim * rim - y * y).max(0.0).sqrt() * normal)
}
fn sides(normal: DVec3) -> [DVec3; 2] {
    let down = (normal.z * normal - DVec3::Z).try_normalize().unwrap_or(DVec3::X);
    [down.cross(normal), down]
}

/// What a horizon calls free is free from every point of its patch, over facets of any tilt; and over small patches most of what
/// is free is called so, though here all kinds of things float in the air.
#[test]
fn no_ray_into_the_free_part_of_a_horizon_is_blocked() {
    let (mut called_free, mut free, mut tried) = (0, 0, 0);
    for (seed, offset) in (0..12).zip(OFFSETS.into_iter().cycle()) {
        let world = crowd(seed, offset, seed % 2 == 0);
        let mut random = Random(seed + 300);
        for i in 0..400 {
            let Some(hit) = world.closest(&Ray::new(offset + random.point(25.0), random.direction())) else {
                continue;
            };
            if hit.normal.z < -0.999 {
                continue;
            }
            let half = [1e-3, 0.05, 0.5][i % 3];
            let sides = sides(hit.normal);
            let horizon = world.horizon(&Patch { middle: hit.point, half, sides, normal: hit.normal });
            let occluded = |random: &mut Random, place: [f64; 2]| {
                let [a, b] = sides.map(|side| side * (half * random.within(-1.0, 1.0)));
                world.occluded(&Hit { point: hit.point + a + b, ..hit }.leave(towards(sides, hit.normal, place)))
            };
            for _ in 0..60 {
                let place = horizon.free([random.next(), random.next()]);
                assert!(horizon.share() == 1.0 || !occluded(&mut random, place), "seed {seed}, case {i}");
            }
            if half == 1e-3 {
                let hidden = (0..200).filter(|_| {
                    let (r, phi) = (random.next().sqrt(), TAU * random.next());
                    occluded(&mut random, [r * phi.cos(), r * phi.sin()])
                });
                free += 200 - hidden.count();
                called_free += (200.0 * (1.0 - horizon.share())) as usize;
                tried += 200;
            }
        }
    }
    assert!(tried > 100_000 && 2 * called_free > free, "{called_free} called free of {free} free of {tried}");
}

/// An endless wall whose top is seen at elevation α, straight ahead, hides (1 − cos α)/2 of the sky of a level facet; what a
/// horizon adds to that, which takes the highest of each 5.6°, is a sixteenth.
#[test]
fn the_horizon_of_a_wall_has_its_view_factor() {
    for elevation in [0.02, 0.3, 1.2_f64] {
        let wall = rectangle(DVec3::new(-1e5, 10.0, 0.0), DVec3::X * 2e5, DVec3::Z * 10.0 * elevation.tan());
        let world = alone(vec![wall]);
        let patch = Patch { middle: DVec3::ZERO, half: 1e-6, sides: sides(DVec3::Z), normal: DVec3::Z };
        let due = 0.5 * (1.0 - elevation.cos());
        let share = world.horizon(&patch).share();
        assert!(share >= due && share < 1.07 * due, "{share} {due}");
    }
}

/// Points of the square go to both parts of the disk in proportion to area: together they have the moments of the disk.
#[test]
fn both_parts_of_a_horizon_are_filled_evenly() {
    let world = crowd(5, DVec3::ZERO, true);
    let normal = DVec3::new(0.3, -0.2, 0.9).normalize();
    let patch = Patch { middle: DVec3::new(1.0, 2.0, 8.0), half: 0.3, sides: sides(normal), normal };
    let horizon = world.horizon(&patch);
    assert!(horizon.share() > 0.05 && horizon.share() < 0.95, "{}", horizon.share());
    let n = 2000;
    let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
    for i in 0..n * n {
        let u = [(f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n)];
        for (share, [x, y]) in [(horizon.share(), horizon.hidden(u)), (1.0 - horizon.share(), horizon.free(u))] {
            assert!(x * x + y * y <= 1.0 + 1e-12);
            sum += share * DVec3::new(x, y, x * y);
            squares += share * DVec3::new(x * x, y * y, (x * x + y * y).powi(2));
        }
    }
    let (mean, squares) = (sum / f64::from(n * n), squares / f64::from(n * n));
    assert!(mean.abs().max_element() < 2e-4, "{mean}");
    assert!((squares - DVec3::new(0.25, 0.25, 1.0 / 3.0)).abs().max_element() < 2e-4, "{squares}");
}

/// A facet that is proven to be all that a bundle of rays sees is what each of them meets, where it meets it; and many bundles
/// that see one facet are proven, though here things stand behind the eye too.
#[test]
fn the_sole_facet_of_a_bundle_is_what_its_rays_meet() {
    let (mut proven, mut alike) = (0, 0);
    for (seed, offset) in (0..12).zip(OFFSETS.into_iter().cycle()) {
        let world = crowd(seed, offset, seed % 2 == 0);
        let mut random = Random(seed + 400);
        for i in 0..600 {
            let eye = offset + random.point(25.0);
            let axis = random.direction().vec();
            let (right, up) = (axis.any_orthonormal_vector(), axis.cross(axis.any_orthonormal_vector()));
            let half = [1e-3, 0.01, 0.1][i % 3];
            let ray = |x: f64, y: f64| Ray::new(eye, WorldDir::new(axis + half * (x * right + y * up)));
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| ray(x, y));
            let sole = SoleFacet::of(&world, &corners);
            let mut facets = Vec::new();
            for _ in 0..60 {
                let ray = ray(random.within(-1.3, 1.3), random.within(-1.3, 1.3));
                let found = world.closest(&ray);
                facets.push(found.map(|hit| (hit.facet, hit.front)));
                let Some(claimed) = sole.as_ref().and_then(|sole| sole.meet(&ray)) else { continue };
                let hit = found.expect("a hit");
                assert_eq!(
                    (hit.facet, hit.front, hit.material, hit.instance),
                    (claimed.facet, claimed.front, claimed.material, claimed.instance)
                );
                // Along the plane points differ by what the ray's start and direction are rounded by.
                let cos = hit.normal.dot(ray.direction.vec()).abs();
                let rounding = hit.error + claimed.error + 8.0 * f64::EPSILON * (eye.length() + hit.t);
                assert!(hit.normal.dot(hit.point - claimed.point).abs() <= hit.error + claimed.error);
                assert!(
                    hit.point.distance(claimed.point) <= rounding / cos,
                    "{} {rounding} {cos}",
                    hit.point.distance(claimed.point)
                );
            }
            let is_one = facets[0].is_some() && facets.iter().all(|f| *f == facets[0]);
            (proven, alike) = (proven + usize::from(sole.is_some()), alike + usize::from(is_one));
        }
    }
    assert!(alike > 1_000 && 3 * proven > alike, "{proven} proven of {alike}");
}

/// A decal in the ground's own plane, or a facet beside its like, is seen, so that nothing is proven about it.
#[test]
fn a_facet_within_the_plane_of_another_is_not_overlooked() {
    let decal = rectangle(DVec3::new(-0.1, -0.1, 0.0), DVec3::X * 0.2, DVec3::Y * 0.2);
    let ground = Some(Ground { height: 0.0, material: GRASS });
    let one = || vec![instance(0, DAffine3::IDENTITY, 1)];
    let world = World::new(vec![Mesh::from_facets(vec![decal])], one(), ground).unwrap();
    let bundle = |x: f64, half: f64| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(u, v)| {
            let to = DVec3::new(x + half * u, half * v, 0.0);
            Ray::new(DVec3::new(0.0, 0.0, 10.0), WorldDir::new(to - DVec3::Z * 10.0))
        })
    };
    assert!(SoleFacet::of(&world, &bundle(0.0, 1.0)).is_none());
    let beside = SoleFacet::of(&world, &bundle(3.0, 1.0)).expect("ground alone");
    let down = |x: f64| Ray::new(DVec3::new(0.0, 0.0, 10.0), WorldDir::new(DVec3::new(x, 0.0, -10.0)));
    assert_eq!(beside.meet(&down(2.5)).map(|hit| hit.facet), Some(FacetId::GROUND));
    assert!(beside.meet(&down(0.0)).is_none());
    assert!(SoleFacet::of(&world, &bundle(0.0, 0.05)).is_some_and(|sole| sole.meet(&down(0.01)).is_some()));
}
