//! From the checked scene to geometry, cameras and bands.

mod surface;

use glam::{DAffine3, DQuat, DVec3};
use sunglint_dsl::scene::{self, Bands, Facing, Optics, Projection, SensorPose, Shape, Solid};
use sunglint_dsl::{Diagnostic, Scene, Span};
use sunglint_geometry::{
    Facet, FacetError, Ground, Instance, Leaves, MaterialId, Mesh, MeshBuilder, ObjError, ObjKind, ObjSkipped, Pose,
    Region, Scatter, Up, World, cone_facets, cylinder_facets, scatter, sphere_facets,
};
use sunglint_radiometry::WorldDir;
use sunglint_sensor::{
    Band, BandResponse, Camera, Extent, Flight, FrameCamera, FramePose, Orthographic, Pushbroom, ScanPose, Standoff,
    Whiskbroom,
};

use self::surface::Off;
pub use self::surface::Surface;

/// Object id of facets that stand in the scene itself rather than in a placed object.
pub const SCENE_OBJECT: u32 = 1;

/// What geometry may take in memory \[bytes\], by the shares of a placement and of a triangle below.
const MOST_BYTES: u64 = 16_000_000_000;
const BYTES_PER_PLACEMENT: u64 = 500;
const BYTES_PER_TRIANGLE: u64 = 150;
/// What an object may hold of others in its own mesh even where instances would take less: rays are faster in one mesh.
const LITTLE: u64 = 100_000_000;
/// Members that are named one by one in truth maps; of a statement with more only the first is.
const MOST_NAMED: u32 = 1000;

/// The geometry of a scene.
pub struct Built {
    /// Rays meet this.
    pub world: World,
    /// What ids in truth maps mean, ascending.
    pub objects: Vec<ObjectIds>,
    /// Meshes that were not opened because nothing places them.
    pub unopened: Vec<String>,
    /// Heights on which things stand.
    pub surface: Surface,
}

/// Consecutive object ids: one object, or the members of a statement that has very many.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectIds {
    /// The first id.
    pub first: u32,
    /// How many.
    pub count: u32,
    /// Name of the object; members of a statement count on from `.1`.
    pub name: String,
}

impl ObjectIds {
    /// The name of an id, if it is one of these.
    pub fn name_of(&self, id: u32) -> Option<String> {
        let member = id.checked_sub(self.first).filter(|member| *member < self.count)?;
        Some(if self.count == 1 { self.name.clone() } else { format!("{}.{}", self.name, member + 1) })
    }
}

/// Builds the geometry; every fault of every mesh, grid and facet is reported.
pub fn build(scene: &Scene, sensors: &[DVec3], diagnostics: &mut Vec<Diagnostic>) -> Option<Built> {
    let errors_before = diagnostics.len();
    let (surface, relief) = Surface::read(scene, diagnostics);
    let of_object = (0..scene.objects.len()).map(|_| None).collect();
    let uses = uses(scene);
    let mut builder =
        Builder { scene, sensors, diagnostics, surface, meshes: Vec::new(), of_object, uses, bytes: 0, told: false };
    let own = builder.facets(&scene.world, false).finish();
    let mut instances = Vec::new();
    let mut objects = vec![ObjectIds { first: SCENE_OBJECT, count: 1, name: "scene".into() }];
    if own.facet_count() > 0 {
        builder.meshes.push(own);
        let mesh = builder.meshes.len() - 1;
        instances.push(Instance { mesh, pose: DAffine3::IDENTITY, name: "scene".into(), id: SCENE_OBJECT });
    }
    let mut next = SCENE_OBJECT + 1;
    for shape in &scene.world {
        let Some((object, name, members)) = builder.members(shape, false) else { continue };
        let base = name.unwrap_or_else(|| scene.objects[object].name.clone());
        let count = members.len() as u32;
        if count <= 1 || count > MOST_NAMED {
            objects.push(ObjectIds { first: next, count, name: base.clone() });
        }
        for (i, pose) in members.into_iter().enumerate() {
            let mut name = base.clone();
            if (2..=MOST_NAMED).contains(&count) {
                name = format!("{base}.{}", i + 1);
                objects.push(ObjectIds { first: next, count: 1, name: name.clone() });
            }
            builder.place(object, pose, &name, next, &mut instances);
            next += 1;
        }
    }
    if let Some(relief) = relief {
        builder.meshes.push(relief);
        let mesh = builder.meshes.len() - 1;
        instances.push(Instance { mesh, pose: DAffine3::IDENTITY, name: "terrain".into(), id: next });
        objects.push(ObjectIds { first: next, count: 1, name: "terrain".into() });
    }
    let unopened = (scene.objects.iter().zip(&builder.of_object))
        .filter(|(_, prepared)| prepared.is_none())
        .map(|(object, _)| object.name.clone())
        .collect();
    let Builder { meshes, surface, diagnostics, .. } = builder;
    if diagnostics[errors_before..].iter().any(|d| d.severity == sunglint_dsl::Severity::Error) {
        return None;
    }
    let ground = scene.ground.map(|g| Ground { height: g.height, material: MaterialId(g.material as u32) });
    match World::new(meshes, instances, ground) {
        Ok(world) => Some(Built { world, objects, unopened, surface }),
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
    surface: Surface,
    meshes: Vec<Mesh>,
    /// Each object, once it was placed.
    of_object: Vec<Option<Prepared>>,
    /// How often each object stands in the world.
    uses: Vec<u64>,
    /// What members take so far, and whether it was told that it is too much.
    bytes: u64,
    told: bool,
}

/// An object ready to be placed.
struct Prepared {
    /// Index of its mesh; none without facets.
    mesh: Option<usize>,
    /// Objects that it places and does not hold in its mesh.
    links: Vec<(usize, DAffine3)>,
    /// Instances that one placement makes.
    instances: u64,
}

fn matrix(pose: &scene::Pose) -> DAffine3 {
    Pose { at: pose.at, heading: pose.heading, pitch: pose.pitch, roll: pose.roll, scale: pose.scale }.matrix()
}

/// Which object a shape places, and how often.
fn placed(shape: &Shape) -> Option<(usize, u64)> {
    match shape {
        Shape::Place { object, poses, .. } => Some((*object, poses.len() as u64)),
        Shape::Scatter(scatter) => Some((scatter.object, scatter.count)),
        _ => None,
    }
}

/// How often each object stands in the world, at any depth. Objects do not place each other in circles.
fn uses(scene: &Scene) -> Vec<u64> {
    let mut uses = vec![0_u64; scene.objects.len()];
    let mut waits_for = vec![0_usize; uses.len()];
    for (inner, _) in scene.objects.iter().flat_map(|object| object.shapes.iter().filter_map(placed)) {
        waits_for[inner] += 1;
    }
    for (object, n) in scene.world.iter().filter_map(placed) {
        uses[object] = uses[object].saturating_add(n);
    }
    let mut ready: Vec<usize> = (0..uses.len()).filter(|object| waits_for[*object] == 0).collect();
    while let Some(object) = ready.pop() {
        for (inner, n) in scene.objects[object].shapes.iter().filter_map(placed) {
            uses[inner] = uses[inner].saturating_add(uses[object].saturating_mul(n));
            waits_for[inner] -= 1;
            if waits_for[inner] == 0 {
                ready.push(inner);
            }
        }
    }
    uses
}

impl Builder<'_> {
    /// An object and all that it places, at `pose`; meshes are shared by all placements.
    fn place(&mut self, object: usize, pose: DAffine3, name: &str, id: u32, instances: &mut Vec<Instance>) {
        self.prepare(object);
        let Some(prepared) = &self.of_object[object] else { return };
        if let Some(mesh) = prepared.mesh {
            instances.push(Instance { mesh, pose, name: name.to_string(), id });
        }
        for i in 0..prepared.links.len() {
            let Some(&(inner, at)) = self.of_object[object].as_ref().and_then(|own| own.links.get(i)) else { return };
            self.place(inner, pose * at, name, id, instances);
        }
    }

    /// Builds an object once. What it places goes into its own mesh where that takes little, or less memory than an instance
    /// for every member of every placement: ten thousand leaves become one crown, shared by all trees.
    fn prepare(&mut self, object: usize) {
        if self.of_object[object].is_some() {
            return;
        }
        let scene = self.scene;
        let shapes = &scene.objects[object].shapes;
        let mut built = self.facets(shapes, true);
        let mut links = Vec::new();
        let mut n_instances = 0_u64;
        for shape in shapes {
            let Some((inner, n)) = placed(shape) else { continue };
            self.prepare(inner);
            let Some(prepared) = &self.of_object[inner] else { continue };
            let (mesh, n_inner) = (prepared.mesh, prepared.instances);
            let whole = prepared.links.is_empty();
            let triangles = mesh.map_or(0, |mesh| self.meshes[mesh].triangle_count()) as u64;
            let held = n.saturating_mul(triangles).saturating_mul(BYTES_PER_TRIANGLE);
            let each = n.saturating_mul(n_inner);
            let linked = each.saturating_mul(self.uses[object]).saturating_mul(BYTES_PER_PLACEMENT);
            let hold = whole && held <= linked.max(LITTLE);
            if hold && !self.afford(held, shape) {
                continue;
            }
            let Some((_, _, members)) = self.members(shape, true) else { continue };
            if hold {
                let Some(mesh) = mesh else { continue };
                let inner: Vec<Facet> = self.meshes[mesh].facets().collect();
                let standing = members.iter().flat_map(|at| inner.iter().map(move |facet| facet.transformed(at)));
                standing.for_each(|facet| built.add(&facet));
            } else {
                n_instances = n_instances.saturating_add(each);
                links.extend(members.into_iter().map(|at| (inner, at)));
            }
        }
        let built = built.finish();
        let mesh = (built.facet_count() > 0).then(|| {
            self.meshes.push(built);
            self.meshes.len() - 1
        });
        let instances = n_instances.saturating_add(u64::from(mesh.is_some()));
        self.of_object[object] = Some(Prepared { mesh, links, instances });
    }

    /// Whether memory holds so much more; if not, that is told once.
    fn afford(&mut self, bytes: u64, shape: &Shape) -> bool {
        self.bytes = self.bytes.saturating_add(bytes);
        let span = match shape {
            Shape::Place { span, .. } => *span,
            Shape::Scatter(scatter) => scatter.span,
            _ => return true,
        };
        let good = self.bytes <= MOST_BYTES;
        if !good && !self.told {
            let message = format!("the members placed up to here need about {:.0} GB", self.bytes as f64 / 1e9);
            let most = MOST_BYTES as f64 / 1e9;
            self.diagnostics.push(Diagnostic::error("G05", span, message).label(format!("at most {most:.0} GB")));
            self.told = true;
        }
        good
    }

    /// The object that a shape places, its name, and where the members stand.
    fn members(&mut self, shape: &Shape, in_object: bool) -> Option<(usize, Option<String>, Vec<DAffine3>)> {
        let (object, n) = placed(shape)?;
        if !in_object {
            self.prepare(object);
            let each = self.of_object[object].as_ref().map_or(1, |prepared| prepared.instances);
            if !self.afford(n.saturating_mul(each).saturating_mul(BYTES_PER_PLACEMENT), shape) {
                return None;
            }
        }
        match shape {
            Shape::Place { name, poses, span, .. } => {
                let mut off = Off::default();
                let members = poses.iter().filter_map(|pose| {
                    let found = self.surface.on(pose);
                    off.note(found.is_none(), pose.at);
                    found.map(|pose| matrix(&pose))
                });
                let members = members.collect();
                off.tell(*span, poses.len(), &self.surface, self.diagnostics);
                Some((object, name.clone(), members))
            }
            Shape::Scatter(scatter) => Some((object, None, self.scattered(scatter)?)),
            _ => None,
        }
    }

    fn scattered(&mut self, said: &scene::Scatter) -> Option<Vec<DAffine3>> {
        use scene::{Leaves as Said, Region as In};
        let region = match said.region {
            In::Sphere { radius } => Region::Sphere { radius },
            In::Cylinder { radius, height } => Region::Cylinder { radius, height },
            In::Box { size } => Region::Box { size },
            In::Rectangle { size } => Region::Rectangle { size },
        };
        let leaves = said.leaves.map(|leaves| match leaves {
            Said::Spherical => Leaves::Spherical,
            Said::Uniform => Leaves::Uniform,
            Said::Planophile => Leaves::Planophile,
            Said::Erectophile => Leaves::Erectophile,
            Said::Plagiophile => Leaves::Plagiophile,
            Said::Extremophile => Leaves::Extremophile,
        });
        // FNV-1a of the object's name: scatters of two objects with one seed differ, and a new statement changes no other.
        let name = self.scene.objects[said.object].name.as_bytes();
        let key = name.iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
        let &scene::Scatter { count, spacing, scale, heading, seed, .. } = said;
        let members = match scatter(&Scatter { count, region, spacing, scale, heading, leaves, seed, key }) {
            Ok(members) => members,
            Err(crowded) => {
                let spacing = spacing.unwrap_or(0.0);
                let about = if crowded.tried { "only" } else { "only about" };
                let message = format!("{about} {} of {count} members find a place {spacing} m apart", crowded.fit);
                let fault = Diagnostic::error("G05", said.span, message);
                self.diagnostics.push(fault.label("fewer members, a smaller `spacing` or a larger region?"));
                return None;
            }
        };
        let whole = matrix(&said.pose);
        if !(said.pose.on_surface && matches!(region, Region::Rectangle { .. })) {
            let frame = matrix(&self.stand(&said.pose, said.span)?);
            return Some(members.into_iter().map(|member| frame * member).collect());
        }
        // Each stands on its own: only the heading turns the rectangle.
        let level = matrix(&scene::Pose { heading: said.pose.heading, ..scene::Pose::default() });
        let mut off = Off::default();
        let mut out = Vec::with_capacity(members.len());
        for member in members {
            let at = said.pose.at + level.transform_vector3(member.translation);
            let found = self.surface.height_at(at.x, at.y);
            off.note(found.is_none(), at);
            let translation = at.with_z(at.z + found.unwrap_or(0.0));
            out.push(DAffine3 { matrix3: whole.matrix3 * member.matrix3, translation });
        }
        off.tell(said.span, out.len(), &self.surface, self.diagnostics);
        Some(out)
    }

    /// A pose with its height; reports one that stands beside the terrain.
    fn stand(&mut self, pose: &scene::Pose, span: Span) -> Option<scene::Pose> {
        let found = self.surface.on(pose);
        let mut off = Off::default();
        off.note(found.is_none(), pose.at);
        off.tell(span, 1, &self.surface, self.diagnostics);
        found
    }

    /// The facets of some shapes, placements left out.
    fn facets(&mut self, shapes: &[Shape], in_object: bool) -> MeshBuilder {
        let mut built = MeshBuilder::new();
        for shape in shapes {
            match shape {
                Shape::Facets { material, polygons } => {
                    for (corners, span) in polygons.iter() {
                        self.facet(corners, *material, span, &mut built);
                    }
                }
                Shape::Panel { material, size, facing, pose, span } => {
                    let flat = |towards| {
                        let material = MaterialId(*material as u32);
                        sunglint_geometry::panel_facets(material, size.x, size.y, towards, DVec3::ZERO)
                    };
                    if let Some(facet) = self.flat(&flat, facing, pose, *span, in_object) {
                        built.add(&facet);
                    }
                }
                Shape::Disk { material, radius, sides, facing, pose, span } => {
                    let flat =
                        |towards| sunglint_geometry::disk_facet(MaterialId(*material as u32), *radius, *sides, towards);
                    if let Some(facet) = self.flat(&flat, facing, pose, *span, in_object) {
                        built.add(&facet);
                    }
                }
                Shape::Box { material, size, pose, span } => {
                    let sides = sunglint_geometry::box_facets(MaterialId(*material as u32), *size);
                    self.put(sides, pose, *span, &mut built);
                }
                Shape::Solid { material, form, sides, pose, span } => {
                    let material = MaterialId(*material as u32);
                    let solid = match *form {
                        Solid::Cylinder { radius, height } => cylinder_facets(material, radius, height, *sides),
                        Solid::Cone { radius, height } => cone_facets(material, radius, height, *sides),
                        Solid::Sphere { radius } => sphere_facets(material, radius, *sides),
                    };
                    self.put(solid, pose, *span, &mut built);
                }
                Shape::Mesh { file, unit, y_up, pose, maps } => {
                    if let Some(pose) = self.stand(pose, file.span) {
                        self.obj(file, *unit, *y_up, &pose, maps, &mut built);
                    }
                }
                Shape::Place { .. } | Shape::Scatter(_) => {}
            }
        }
        built
    }

    fn put(&mut self, own: Vec<Facet>, pose: &scene::Pose, span: Span, built: &mut MeshBuilder) {
        if let Some(pose) = self.stand(pose, span) {
            let transform = matrix(&pose);
            own.iter().for_each(|facet| built.add(&facet.transformed(&transform)));
        }
    }

    /// A panel or disk. Facing a direction or a slope it turns with its pose; facing a point or a sensor it does not.
    fn flat(
        &mut self,
        at_origin: &dyn Fn(DVec3) -> Facet,
        facing: &Facing,
        pose: &scene::Pose,
        span: Span,
        in_object: bool,
    ) -> Option<Facet> {
        let pose = &self.stand(pose, span)?;
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
                        "a panel or disk of an object cannot face a sensor: its placements share it",
                    )
                    .help("stand it in the scene itself"),
                );
                return None;
            }
            Facing::Sensor(sensor) => self.sensors[*sensor],
        };
        let Some(towards) = (target - pose.at).try_normalize() else {
            self.diagnostics.push(
                Diagnostic::error("G01", span, "this stands on the very point that it faces")
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

/// The camera of a sensor, `pixels` in place of its own where given: the same view, coarser or finer; of a scanner the same
/// swath and way.
pub fn camera(
    scene: &Scene,
    sensor: &scene::Sensor,
    pixels: Option<(u32, u32)>,
) -> Result<Box<dyn Camera>, Diagnostic> {
    let elevation = scene.site.map_or(0.0, |site| site.elevation);
    let size = pixels.unwrap_or(sensor.pixels);
    let coarser = f64::from(sensor.pixels.0) / f64::from(size.0);
    let refuse = |error: sunglint_sensor::CameraError| Diagnostic::error("V02", sensor.span, error.to_string());
    let standoff = |altitude: f64| Standoff::Height(altitude - elevation);
    let optics = match sensor.optics {
        Optics::FieldOfView(angle) => Ok(sunglint_sensor::Optics::FieldOfView(angle)),
        Optics::Ifov(angle) => Ok(sunglint_sensor::Optics::Ifov(angle)),
        Optics::FocalLength { focal_length, pitch } => Ok(sunglint_sensor::Optics::FocalLength { focal_length, pitch }),
        Optics::Swath(width) => Err(Extent::Swath(width)),
        Optics::GroundSample(width) => Err(Extent::GroundSample(width * coarser)),
    };
    let misfit = |what: &str| Err(Diagnostic::error("V01", sensor.span, what.to_string()));
    if sensor.projection.is_scanner() {
        let (Ok(optics), Some(flight)) = (optics, sensor.flight) else {
            return misfit("a scanner takes an angle or a focal length, a speed and a line rate");
        };
        let flight = Flight { heading: flight.heading, speed: flight.speed, line_rate: flight.line_rate };
        let pose = match sensor.pose {
            SensorPose::LookAt { position, look_at, .. } => ScanPose::LookAt { position, look_at },
            SensorPose::Attitude { position, depression, roll, .. } => {
                ScanPose::Attitude { position, depression, roll }
            }
            SensorPose::Target { look_at, altitude, view_zenith, view_azimuth } => {
                ScanPose::Target { look_at, standoff: standoff(altitude), view_zenith, view_azimuth }
            }
        };
        return Ok(match sensor.projection {
            Projection::Whiskbroom => {
                Box::new(Whiskbroom::new(pose, flight, optics, sensor.pixels).map_err(refuse)?.resampled(size))
            }
            _ => Box::new(Pushbroom::new(pose, flight, optics, sensor.pixels).map_err(refuse)?.resampled(size)),
        });
    }
    let pose = match sensor.pose {
        SensorPose::LookAt { position, look_at, roll } => FramePose::LookAt { position, look_at, roll },
        SensorPose::Attitude { position, heading, depression, roll } => {
            FramePose::Attitude { position, heading, depression, roll }
        }
        SensorPose::Target { look_at, altitude, view_zenith, view_azimuth } => {
            FramePose::Target { look_at, standoff: standoff(altitude), view_zenith, view_azimuth }
        }
    };
    Ok(match (sensor.projection, optics) {
        (Projection::Orthographic, Err(extent)) => Box::new(Orthographic::new(pose, extent, size).map_err(refuse)?),
        (Projection::Orthographic, Ok(_)) => return misfit("an orthographic sensor takes a swath or a ground sample"),
        (_, Err(_)) => return misfit("a swath or ground sample belongs to an orthographic sensor"),
        (_, Ok(optics)) => Box::new(FrameCamera::new(pose, optics, sensor.pixels).map_err(refuse)?.resampled(size)),
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
