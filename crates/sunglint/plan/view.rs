//! What the sensors see, and what a selection keeps of it.

use std::sync::Arc;

use glam::DVec3;
use sunglint_dsl::scene::{self, Sensor};
use sunglint_dsl::{Diagnostic, Scene, list, nearest};
use sunglint_geometry::{FacetId, World};
use sunglint_sensor::{Band, Camera};

use super::Planner;
use crate::air::Air;
use crate::products::MapProjection;
use crate::selection::wanted;
use crate::times::Moment;
use crate::{scenery, times};

impl Planner<'_, '_> {
    /// Names of the selection that the scene does not have, and a crop beyond a view.
    pub(super) fn check_selection(&mut self, bands: &[Vec<Band>], cameras: &[Option<Arc<dyn Camera>>]) {
        let (scene, options) = (self.scene, self.options);
        let mut known_bands: Vec<&str> = Vec::new();
        for (sensor, bands) in scene.sensors.iter().zip(bands) {
            for band in bands.iter().filter(|_| wanted(&options.sensors, |name| name == sensor.name)) {
                if !known_bands.contains(&band.name.as_str()) {
                    known_bands.push(&band.name);
                }
            }
        }
        let sensors: Vec<&str> = scene.sensors.iter().map(|sensor| sensor.name.as_str()).collect();
        let named = |wanted: &str, name: &str| wanted == name;
        self.diagnostics.extend(unknown("sensor", &options.sensors, &sensors, named));
        self.diagnostics.extend(unknown("band", &options.bands, &known_bands, named));
        let Some(crop) = options.crop else { return };
        for (sensor, camera) in scene.sensors.iter().zip(cameras) {
            let Some(camera) = camera.as_ref().filter(|_| wanted(&options.sensors, |name| name == sensor.name)) else {
                continue;
            };
            if crop.within(camera.pixels()).is_none() {
                let (width, height) = camera.pixels();
                self.diagnostics.push(
                    Diagnostic::whole(
                        "X01",
                        format!("crop {crop} reaches beyond sensor `{}`, {width} x {height} pixels", sensor.name),
                    )
                    .help(
                        "a crop is X,Y,WxH in pixels of the whole view as it is rendered, after `scale` and `--pixels`",
                    ),
                );
            }
        }
    }

    pub(super) fn warn_of_view(
        &mut self,
        sensor: &Sensor,
        camera: &dyn Camera,
        world: &World,
        surface: &scenery::Surface,
    ) {
        let (w, h) = camera.pixels();
        if let Some(ground) = world.ground()
            && camera.position().z < ground.height
        {
            let depth = ground.height - camera.position().z;
            self.diagnostics.push(
                Diagnostic::warning(
                    "V02",
                    sensor.span,
                    format!("sensor `{}` stands {depth:.3} m below the ground", sensor.name),
                )
                .help("heights count from z = 0 of the scene, not from sea level"),
            );
        } else if let Some(object) = encloses(world, camera.position()) {
            self.diagnostics.push(
                Diagnostic::warning("V02", sensor.span, format!("sensor `{}` stands inside {object}", sensor.name))
                    .label("it sees the backs of facets all round")
                    .help("move the sensor, or the object"),
            );
        }
        let position = camera.position();
        if let Some(height) = surface.terrain.as_ref().and_then(|terrain| terrain.height_at(position.x, position.y))
            && position.z < height
        {
            let message = format!("sensor `{}` stands {:.1} m below the terrain", sensor.name, height - position.z);
            self.diagnostics.push(
                Diagnostic::warning("V02", sensor.span, message)
                    .label(format!("z above {height:.1} m?"))
                    .help("heights of a terrain count from z = 0, not from the terrain itself"),
            );
        }
        let (w, h) = (f64::from(w), f64::from(h));
        let sees = (0..=16).any(|i| {
            (0..=16).any(|j| {
                let ray = camera.ray(w * f64::from(i) / 16.0, h * f64::from(j) / 16.0);
                world.closest(&sunglint_geometry::Ray::new(ray.origin, ray.direction)).is_some()
            })
        });
        if !sees {
            self.diagnostics.push(
                Diagnostic::warning(
                    "V02",
                    sensor.span,
                    format!("sensor `{}` seems to see nothing of the scene", sensor.name),
                )
                .label("none of 289 lines of sight meets a facet")
                .help("check where it stands and looks, and its field of view"),
            );
        }
    }
}

/// The object that shows its back to a point on all sides; what is below is not asked, since a house may have no floor.
fn encloses(world: &World, point: DVec3) -> Option<String> {
    let sides = [
        [0.1, 0.2, 1.0],
        [1.0, 0.1, 0.05],
        [-1.0, 0.2, 0.1],
        [0.2, 1.0, 0.05],
        [-0.1, -1.0, 0.1],
        [0.7, 0.6, 0.5],
        [-0.6, -0.7, 0.5],
    ];
    let mut object = None;
    for side in sides {
        let direction = sunglint_radiometry::WorldDir::from_unit(DVec3::from_array(side).normalize());
        let hit = world.closest(&sunglint_geometry::Ray::new(point, direction))?;
        if hit.front || hit.facet == FacetId::GROUND {
            return None;
        }
        object.get_or_insert(hit.instance);
    }
    match object? {
        scenery::SCENE_OBJECT => Some("a closed body of the scene".to_string()),
        placed => world.instances().iter().find(|i| i.id == placed).map(|i| format!("`{}`", i.name)),
    }
}

/// What of a selection names nothing.
pub(super) fn unknown(
    kind: &str,
    wanted: &[String],
    known: &[&str],
    is: impl Fn(&str, &str) -> bool,
) -> Vec<Diagnostic> {
    (wanted.iter())
        .filter(|wanted| !known.iter().any(|name| is(wanted, name)))
        .map(|wanted| {
            let near = nearest(wanted, known.iter().copied()).map_or(String::new(), |near| format!("`{near}`? "));
            let message = match kind {
                "time" => format!("no frame of the selection is at time `{wanted}`"),
                kind => format!("no {kind} of the scene is called `{wanted}`"),
            };
            Diagnostic::whole("X01", message).help(format!("{near}there are {}", list(known.iter().copied())))
        })
        .collect()
}

/// The map that an image is, if its sensor looks straight down: of the level plane at the height of what it looks at, else
/// of the ground, else of what its middle meets.
pub(super) fn map_of(scene: &Scene, sensor: &Sensor, camera: &dyn Camera, world: &World) -> Option<MapProjection> {
    let height = match sensor.pose {
        scene::SensorPose::LookAt { look_at, .. } | scene::SensorPose::Target { look_at, .. } => Some(look_at.z),
        scene::SensorPose::Attitude { .. } => None,
    };
    let met = || {
        let (w, h) = camera.pixels();
        let middle = camera.ray(0.5 * f64::from(w), 0.5 * f64::from(h));
        world.closest(&sunglint_geometry::Ray::new(middle.origin, middle.direction)).map(|hit| hit.point.z)
    };
    let height = height.or(world.ground().map(|ground| ground.height)).or_else(met).unwrap_or(0.0);
    let ground = camera.ground(height)?;
    Some(MapProjection::new(&ground, scene.site.as_ref(), scene.crs.as_ref()))
}

/// Duration of a scan, and how far the sun moves in it: it is lit as at its first line throughout.
pub(super) fn scan_note(scene: &Scene, sensor: &Sensor, moments: &[(Moment, Air)]) -> Option<String> {
    let flight = sensor.flight?;
    let lines = f64::from(sensor.pixels.1);
    let (seconds, metres) = (lines / flight.line_rate, lines * flight.speed / flight.line_rate);
    let moves = |(moment, air): &(Moment, Air)| {
        let (site, utc) = (scene.site.as_ref()?, moment.utc?);
        let (pressure, temperature) = air.at_site(utc);
        let at = |t: f64| times::sun_at(site, scene::Utc(t), pressure, temperature).ok();
        Some(at(utc.0)?.apparent.angle_to(at(utc.0 + seconds)?.apparent).to_degrees())
    };
    let most =
        moments.iter().filter_map(moves).fold(None, |most: Option<f64>, angle| Some(most.unwrap_or(0.0).max(angle)));
    let moved = most.map_or(String::new(), |angle| format!("; the sun moves by {angle:.3} deg meanwhile"));
    Some(format!(
        "scan: {lines} lines over {metres:.1} m in {seconds:.2} s, lit by sun and sky of the first line throughout{moved}"
    ))
}
