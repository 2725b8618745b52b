//! From the checked scene to geometry, cameras and bands.

use glam::{DAffine3, DQuat, DVec2, DVec3};
use sunglint_dsl::scene::{self, Bands, Facing, Optics, Projection, SensorPose, Shape};
use sunglint_dsl::{Diagnostic, Scene, Span};
use sunglint_geometry::{
    Facet, FacetError, Ground, Instance, MaterialId, Mesh, MeshBuilder, ObjError, ObjKind, ObjSkipped, Pose, Up, World,
};
use sunglint_radiometry::WorldDir;
use sunglint_sensor::{Band, BandResponse, Camera, FrameCamera, FramePose, Orthographic, Standoff};

/// Object id of facets that stand in the scene itself rather than in a placed object.
pub const SCENE_OBJECT: u32 = 1;

/// The geometry of a scene.
pub struct Built {
    /// Rays meet this.
    pub world: World,
    /// Names by object id, for truth maps.
    pub objects: Vec<(u32, String)>,
    /// Meshes that were not opened because nothing places them.
    pub unopened: Vec<String>,
}

/// Builds the geometry; every fault of every mesh and facet is reported.
pub fn build(scene: &Scene, sensors: &[DVec3], diagnostics: &mut Vec<Diagnostic>) -> Option<Built> {
    let mut builder =
        Builder { scene, sensors, diagnostics, meshes: Vec::new(), of_object: vec![None; scene.objects.len()] };
    let errors_before = builder.diagnostics.len();
    let own = builder.mesh(&scene.world, false);
    let mut instances = Vec::new();
    let mut objects = vec![(SCENE_OBJECT, "scene".to_string())];
    if own.facet_count() > 0 {
        builder.meshes.push(own);
        let mesh = builder.meshes.len() - 1;
        instances.push(Instance { mesh, pose: DAffine3::IDENTITY, name: "scene".into(), id: SCENE_OBJECT });
    }
    let mut next = SCENE_OBJECT + 1;
    for shape in &scene.world {
        if let Shape::Place { object, name, poses, .. } = shape {
            for (i, pose) in poses.iter().enumerate() {
                let base = name.clone().unwrap_or_else(|| scene.objects[*object].name.clone());
                let name = if poses.len() > 1 { format!("{base}.{}", i + 1) } else { base };
                objects.push((next, name.clone()));
                builder.place(*object, matrix(pose), &name, next, &mut instances);
                next += 1;
            }
        }
    }
    let placed: Vec<bool> = builder.of_object.iter().map(Option::is_some).collect();
    let unopened = (scene.objects.iter().zip(&placed))
        .filter(|(_, placed)| !**placed)
        .map(|(object, _)| object.name.clone())
        .collect();
    let meshes = std::mem::take(&mut builder.meshes);
    if diagnostics[errors_before..].iter().any(|d| d.severity == sunglint_dsl::Severity::Error) {
        return None;
    }
    let ground = scene.ground.map(|g| Ground { height: g.height, material: MaterialId(g.material as u32) });
    match World::new(meshes, instances, ground) {
        Ok(world) => Some(Built { world, objects, unopened }),
        Err(error) => {
            diagnostics.push(Diagnostic::whole("G05", error.to_string()));
            None
        }
    }
}

struct Builder<'a> {
    scene: &'a Scene,
    sensors: &'a [DVec3],
    diagnostics: &'a mut Vec<Diagnostic>,
    meshes: Vec<Mesh>,
    /// Index of the mesh of each object, once it was placed; an object without facets of its own has none.
    of_object: Vec<Option<Option<usize>>>,
}

fn matrix(pose: &scene::Pose) -> DAffine3 {
    Pose { at: pose.at, heading: pose.heading, pitch: pose.pitch, roll: pose.roll, scale: pose.scale }.matrix()
}

impl Builder<'_> {
    /// An object and all that it places, at `pose`; meshes are shared by all placements.
    fn place(&mut self, object: usize, pose: DAffine3, name: &str, id: u32, instances: &mut Vec<Instance>) {
        let shapes = &self.scene.objects[object].shapes;
        let mesh = match self.of_object[object] {
            Some(mesh) => mesh,
            None => {
                let built = self.mesh(shapes, true);
                let mesh = (built.facet_count() > 0).then(|| {
                    self.meshes.push(built);
                    self.meshes.len() - 1
                });
                self.of_object[object] = Some(mesh);
                mesh
            }
        };
        if let Some(mesh) = mesh {
            instances.push(Instance { mesh, pose, name: name.to_string(), id });
        }
        for shape in shapes {
            if let Shape::Place { object, poses, .. } = shape {
                for inner in poses {
                    self.place(*object, pose * matrix(inner), name, id, instances);
                }
            }
        }
    }

    /// The facets of some shapes, placements left out.
    fn mesh(&mut self, shapes: &[Shape], in_object: bool) -> Mesh {
        let mut built = MeshBuilder::new();
        for shape in shapes {
            match shape {
                Shape::Facets { material, polygons } => {
                    for (corners, span) in polygons {
                        self.facet(corners, *material, *span, &mut built);
                    }
                }
                Shape::Panel { material, size, facing, pose, span } => {
                    if let Some(facet) = self.panel(*material, *size, facing, pose, *span, in_object) {
                        built.add(&facet);
                    }
                }
                Shape::Box { material, size, pose, .. } => {
                    let transform = matrix(pose);
                    let sides = sunglint_geometry::box_facets(MaterialId(*material as u32), *size);
                    sides.iter().for_each(|side| built.add(&side.transformed(&transform)));
                }
                Shape::Mesh { file, unit, y_up, pose, maps } => self.obj(file, *unit, *y_up, pose, maps, &mut built),
                Shape::Place { .. } => {}
            }
        }
        built.finish()
    }

    /// A panel. Facing a direction or a slope it turns with its pose; facing a point or a sensor it does not.
    fn panel(
        &mut self,
        material: usize,
        size: DVec2,
        facing: &Facing,
        pose: &scene::Pose,
        span: Span,
        in_object: bool,
    ) -> Option<Facet> {
        let at_origin = |towards| {
            sunglint_geometry::panel_facets(MaterialId(material as u32), size.x, size.y, towards, DVec3::ZERO)
        };
        let target = match facing {
            Facing::Direction(direction) => return Some(at_origin(*direction).transformed(&matrix(pose))),
            Facing::Slope { slope, aspect } => {
                let normal = WorldDir::from_zenith_azimuth(*slope, *aspect).vec();
                return Some(at_origin(normal).transformed(&matrix(pose)));
            }
            Facing::Point(point) => *point,
            Facing::Sensor(_) if in_object => {
                self.diagnostics.push(
                    Diagnostic::error(
                        "G04",
                        span,
                        "a panel of an object cannot face a sensor: its placements share it",
                    )
                    .help("stand the panel in the scene itself"),
                );
                return None;
            }
            Facing::Sensor(sensor) => self.sensors[*sensor],
        };
        let Some(towards) = (target - pose.at).try_normalize() else {
            self.diagnostics.push(
                Diagnostic::error("G01", span, "the panel stands on the very point it faces")
                    .help("move it, or say `facing up`"),
            );
            return None;
        };
        let place = DAffine3::from_scale_rotation_translation(DVec3::splat(pose.scale), DQuat::IDENTITY, pose.at);
        Some(at_origin(towards).transformed(&place))
    }

    fn facet(&mut self, corners: &[DVec3], material: usize, span: Span, built: &mut MeshBuilder) {
        match built.push(corners, MaterialId(material as u32)) {
            Ok(()) => {}
            Err(FacetError::ZeroArea) => self.diagnostics.push(
                Diagnostic::warning("G01", span, "a facet without area is dropped").label("all corners lie on a line"),
            ),
            Err(error) => {
                let code = if matches!(error, FacetError::NotPlanar { .. }) { "G02" } else { "G01" };
                self.diagnostics.push(Diagnostic::error(code, span, error.to_string()));
            }
        }
    }

    fn obj(
        &mut self,
        file: &scene::SceneFile,
        unit: f64,
        y_up: bool,
        pose: &scene::Pose,
        maps: &[(String, usize, Span)],
        built: &mut MeshBuilder,
    ) {
        let mut used = vec![false; maps.len()];
        let mut find = |name: &str| {
            let found = maps.iter().position(|(pattern, _, _)| pattern == "*" || pattern == name)?;
            used[found] = true;
            Some(MaterialId(maps[found].1 as u32))
        };
        let up = if y_up { Up::Y } else { Up::Z };
        match sunglint_geometry::read_obj(&file.bytes, unit, up, &mut find) {
            Ok(mesh) => {
                built.append(mesh.mesh, &matrix(pose));
                if mesh.dropped_zero_area > 0 {
                    let n = mesh.dropped_zero_area;
                    self.diagnostics.push(Diagnostic::warning(
                        "G01",
                        file.span,
                        format!("`{}`: {n} face{} without area left out", file.path, if n == 1 { "" } else { "s" }),
                    ));
                }
                for skipped in &mesh.skipped {
                    self.diagnostics.push(left_out(file, skipped));
                }
                for ((pattern, _, span), _) in maps.iter().zip(&used).filter(|(_, used)| !**used) {
                    self.diagnostics.push(
                        Diagnostic::warning(
                            "G03",
                            *span,
                            format!("no face of `{}` has the material `{pattern}`", file.path),
                        )
                        .help(format!("it has: {}", mesh.materials_found.join(", "))),
                    );
                }
            }
            Err(ObjError::Unmapped(names)) => {
                for name in names {
                    let what = if name.is_empty() {
                        "faces before any `usemtl` are".to_string()
                    } else {
                        format!("its material `{name}` is")
                    };
                    let mut fault =
                        Diagnostic::error("G03", file.span, format!("`{}`: {what} mapped to no material", file.path))
                            .help("add a line `map \"…\" to MATERIAL`, or `map \"*\" to MATERIAL` for all the rest");
                    let near = sunglint_dsl::nearest(&name, maps.iter().map(|(pattern, ..)| pattern.as_str()));
                    if let Some((_, _, span)) = maps.iter().find(|(pattern, ..)| Some(pattern.as_str()) == near) {
                        fault = fault.note(*span, format!("`map \"{name}\"`?"));
                    }
                    self.diagnostics.push(fault);
                }
            }
            Err(ObjError::Malformed(faults)) => {
                for fault in faults {
                    let message = format!("{}:{}:{}: {}", file.path, fault.line, fault.column, fault.message);
                    self.diagnostics.push(Diagnostic::error("F01", file.span, message));
                }
            }
        }
    }
}

/// The warning about statements of an OBJ file that give no facets.
fn left_out(file: &scene::SceneFile, skipped: &ObjSkipped) -> Diagnostic {
    let ObjSkipped { keyword, kind, count, line } = skipped;
    let times = if *count == 1 { format!("line {line}") } else { format!("{count} times, first on line {line}") };
    let (code, what, help) = match kind {
        ObjKind::PointOrLine => ("G01", "has no area and is left out", "only faces (`f`) can be seen"),
        ObjKind::FreeForm => ("F01", "is a free-form shape and is left out", "export it as faces"),
        ObjKind::Unknown => ("F01", "is no OBJ statement and is left out", "check the file where it stands"),
    };
    Diagnostic::warning(code, file.span, format!("`{}`: `{keyword}` ({times}) {what}", file.path)).help(help)
}

/// The camera of a sensor, `pixels` in place of its own where given: the same view, coarser or finer.
pub fn camera(
    scene: &Scene,
    sensor: &scene::Sensor,
    pixels: Option<(u32, u32)>,
) -> Result<Box<dyn Camera>, Diagnostic> {
    let elevation = scene.site.map_or(0.0, |site| site.elevation);
    let pose = match sensor.pose {
        SensorPose::LookAt { position, look_at, roll } => FramePose::LookAt { position, look_at, roll },
        SensorPose::Attitude { position, heading, depression, roll } => {
            FramePose::Attitude { position, heading, depression, roll }
        }
        SensorPose::Target { look_at, altitude, view_zenith, view_azimuth } => {
            FramePose::Target { look_at, standoff: Standoff::Height(altitude - elevation), view_zenith, view_azimuth }
        }
    };
    let size = pixels.unwrap_or(sensor.pixels);
    let coarser = f64::from(sensor.pixels.0) / f64::from(size.0);
    let refuse = |error: sunglint_sensor::CameraError| Diagnostic::error("V02", sensor.span, error.to_string());
    Ok(match (sensor.projection, sensor.optics) {
        (Projection::Perspective, optics) => {
            let optics = match optics {
                Optics::FieldOfView(angle) => sunglint_sensor::Optics::FieldOfView(angle),
                Optics::Ifov(angle) => sunglint_sensor::Optics::Ifov(angle * coarser),
                Optics::FocalLength { focal_length, pitch } => {
                    sunglint_sensor::Optics::FocalLength { focal_length, pitch: pitch * coarser }
                }
                Optics::Swath(_) | Optics::GroundSample(_) => {
                    return Err(Diagnostic::error(
                        "V01",
                        sensor.span,
                        "a swath or ground sample belongs to an orthographic sensor",
                    ));
                }
            };
            Box::new(FrameCamera::new(pose, optics, size).map_err(refuse)?)
        }
        (Projection::Orthographic, optics) => {
            let extent = match optics {
                Optics::Swath(width) => sunglint_sensor::Extent::Swath(width),
                Optics::GroundSample(width) => sunglint_sensor::Extent::GroundSample(width * coarser),
                _ => {
                    return Err(Diagnostic::error(
                        "V01",
                        sensor.span,
                        "an orthographic sensor takes a swath or a ground sample",
                    ));
                }
            };
            Box::new(Orthographic::new(pose, extent, size).map_err(refuse)?)
        }
    })
}

/// The bands of a sensor, in order.
pub fn bands(sensor: &scene::Sensor, diagnostics: &mut Vec<Diagnostic>) -> Vec<Band> {
    let mut bands: Vec<(Band, Span)> = Vec::new();
    for said in &sensor.bands {
        let (found, span): (Result<Vec<Band>, Diagnostic>, Span) = match said {
            Bands::Edges { name, lower, upper, span } => {
                (Band::edges(name, *lower, *upper).map(|band| vec![band]).map_err(|e| band_error(*span, &e)), *span)
            }
            Bands::Gaussian { name, centre, fwhm, span } => {
                (Band::gaussian(name, *centre, *fwhm).map(|band| vec![band]).map_err(|e| band_error(*span, &e)), *span)
            }
            Bands::Response { name, file, span } => (response(name, file), *span),
            Bands::Set { set, only, span } => (named_set(set, only.as_deref(), *span), *span),
            Bands::FileSet { file, only, span } => {
                (file_set(file).and_then(|bands| choose(bands, only.as_deref(), *span)), *span)
            }
            Bands::Series { lower, upper, every, fwhm, span } => (series(*lower, *upper, *every, *fwhm, *span), *span),
        };
        match found {
            Ok(found) => bands.extend(found.into_iter().map(|band| (band, span))),
            Err(diagnostic) => diagnostics.push(diagnostic),
        }
    }
    for (i, (band, span)) in bands.iter().enumerate() {
        if let Some((_, first)) = bands[..i].iter().find(|(other, _)| other.name == band.name) {
            diagnostics.push(
                Diagnostic::error(
                    "V03",
                    *span,
                    format!("two bands of sensor `{}` are called `{}`", sensor.name, band.name),
                )
                .note(*first, "first here"),
            );
        }
    }
    bands.into_iter().map(|(band, _)| band).collect()
}

fn band_error(span: Span, error: &sunglint_sensor::BandError) -> Diagnostic {
    Diagnostic::error("V03", span, error.to_string())
}

fn read_responses(file: &scene::SceneFile) -> Result<Vec<BandResponse>, Diagnostic> {
    let text = std::str::from_utf8(&file.bytes)
        .map_err(|_| Diagnostic::error("F01", file.span, format!("`{}` is not UTF-8 text", file.path)))?;
    sunglint_sensor::read_response_csv(text)
        .map_err(|error| Diagnostic::error("F01", file.span, format!("`{}`: {error}", file.path)))
}

fn response(name: &str, file: &scene::SceneFile) -> Result<Vec<Band>, Diagnostic> {
    let tables = read_responses(file)?;
    let rows = match tables.as_slice() {
        [(_, rows)] => rows,
        many => match many.iter().find(|(band, _)| band == name) {
            Some((_, rows)) => rows,
            None => {
                let names: Vec<&str> = many.iter().map(|(band, _)| band.as_str()).collect();
                return Err(Diagnostic::error("V03", file.span, format!("`{}` has no band `{name}`", file.path))
                    .help(format!("it has: {}", names.join(", "))));
            }
        },
    };
    Band::table(name, rows).map(|band| vec![band]).map_err(|error| band_error(file.span, &error))
}

fn file_set(file: &scene::SceneFile) -> Result<Vec<Band>, Diagnostic> {
    read_responses(file)?
        .into_iter()
        .map(|(name, rows)| Band::table(&name, &rows).map_err(|error| band_error(file.span, &error)))
        .collect()
}

fn named_set(set: &str, only: Option<&[String]>, span: Span) -> Result<Vec<Band>, Diagnostic> {
    let Some(bands) = sunglint_sensor::band_set(set) else {
        return Err(Diagnostic::error("V03", span, format!("no band set is called `{set}`"))
            .help(format!("the shipped sets are: {}", sunglint_sensor::band_sets().join(", "))));
    };
    choose(bands, only, span)
}

fn choose(bands: Vec<Band>, only: Option<&[String]>, span: Span) -> Result<Vec<Band>, Diagnostic> {
    let Some(only) = only else { return Ok(bands) };
    only.iter()
        .map(|name| {
            bands.iter().find(|band| band.name == *name).cloned().ok_or_else(|| {
                let names: Vec<&str> = bands.iter().map(|band| band.name.as_str()).collect();
                Diagnostic::error("V03", span, format!("the set has no band `{name}`"))
                    .help(format!("it has: {}", names.join(", ")))
            })
        })
        .collect()
}

fn series(lower: f64, upper: f64, every: f64, fwhm: f64, span: Span) -> Result<Vec<Band>, Diagnostic> {
    let n = ((upper - lower) / every + 1e-6).floor() as usize + 1;
    (0..n)
        .map(|i| {
            let centre = lower + i as f64 * every;
            let nm = (centre * 1e6).round() / 1e3;
            Band::gaussian(format!("nm{nm}"), centre, fwhm).map_err(|error| band_error(span, &error))
        })
        .collect()
}
