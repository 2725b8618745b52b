//! The checked scene: plain data, names resolved to indices, canonical units (m, µm, rad, K, hPa, W m⁻² sr⁻¹ µm⁻¹).

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use sunglint_plugin::{Args, SpectralValue};

use crate::{FileId, Span};

/// A checked scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Title.
    pub title: Option<String>,
    /// Where it is.
    pub site: Option<Site>,
    /// What x and y are, where the site says it.
    pub crs: Option<Crs>,
    /// Collection sets, at least one.
    pub collects: Vec<Collect>,
    /// The weather that holds where a collection names none; first the unnamed one.
    pub weathers: Vec<Weather>,
    /// The scene's atmosphere.
    pub atmosphere: ModelUse,
    /// Materials, in order of declaration.
    pub materials: Vec<Material>,
    /// Objects, placed by [`Shape::Place`].
    pub objects: Vec<Object>,
    /// Geometry in the world frame.
    pub world: Vec<Shape>,
    /// The surface over a grid of heights.
    pub terrain: Option<Terrain>,
    /// The endless plane.
    pub ground: Option<Ground>,
    /// Sensors, at least one.
    pub sensors: Vec<Sensor>,
    /// Experiments that see the text's own constants, a run of a sweep each (`default` where the scene has none).
    pub experiments: Vec<Experiment>,
    /// What `test` renders.
    pub snapshot: Snapshot,
    /// The same text under the constants of its experiments: one scene for each set that differs from the text's own, with
    /// the experiments that see it. These have no variants, and then [`Scene::experiments`] may be empty.
    pub variants: Vec<Scene>,
}

impl Scene {
    /// What the text means under each set of constants: the scene itself, then its variants.
    pub fn worlds(&self) -> impl Iterator<Item = &Scene> {
        std::iter::once(self).chain(&self.variants)
    }

    /// All experiments with the scene that each sees, in the order of the text.
    pub fn runs(&self) -> Vec<(&Scene, &Experiment)> {
        let mut runs: Vec<_> =
            self.worlds().flat_map(|scene| scene.experiments.iter().map(move |run| (scene, run))).collect();
        runs.sort_by_key(|(_, run)| run.order);
        runs
    }
}

/// Where the scene is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// North positive \[rad\].
    pub latitude: f64,
    /// East positive \[rad\].
    pub longitude: f64,
    /// Of z = 0 above sea level \[m\].
    pub elevation: f64,
    /// Azimuth of grid north (+y), east of true north \[rad\].
    pub convergence: f64,
    /// Where it is said.
    pub span: Span,
}

/// The coordinate reference system whose easting and northing \[m\] x and y are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Crs {
    /// WGS 84 / UTM.
    Utm {
        /// 1..60.
        zone: u8,
        /// Whether of the southern hemisphere, with its false northing.
        south: bool,
    },
    /// Well-known text of a projected system in metres.
    Wkt(String),
}

/// A calendar date.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Date {
    /// Year.
    pub year: i32,
    /// Month, 1..12.
    pub month: u8,
    /// Day, 1..31.
    pub day: u8,
}

/// UTC as seconds since 1970-01-01T00:00:00Z, leap seconds not counted.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Utc(pub f64);

impl Utc {
    /// Julian date (UTC).
    pub fn julian_date(self) -> f64 {
        2_440_587.5 + self.0 / 86_400.0
    }
}

/// A time of day.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// Seconds after local midnight.
    Time(f64),
    /// Sunrise, and an offset \[s\].
    Sunrise(f64),
    /// Sunset, and an offset \[s\].
    Sunset(f64),
    /// The sun's highest point, and an offset \[s\].
    SolarNoon(f64),
}

/// When.
#[derive(Clone, Debug, PartialEq)]
pub enum Times {
    /// Instants, ascending.
    At(Vec<Utc>),
    /// On each date from one clock to another; the plan resolves sunrise and sunset.
    Series {
        /// Dates.
        dates: Vec<Date>,
        /// First.
        from: Clock,
        /// Last, included.
        to: Option<Clock>,
        /// Step \[s\]; only without `to` is there none.
        every: Option<f64>,
        /// Local time minus UTC \[s\].
        zone: f64,
    },
    /// The sun at apparent angles \[rad\], Earth–Sun distance 1 au.
    Sun {
        /// Zenith angle.
        zenith: f64,
        /// Azimuth.
        azimuth: f64,
    },
    /// No sun.
    NoSun,
}

/// A collection set.
#[derive(Clone, Debug, PartialEq)]
pub struct Collect {
    /// Name.
    pub name: Option<String>,
    /// When.
    pub times: Times,
    /// Index of its weather in [`Scene::weathers`], where it names one.
    pub weather: Option<usize>,
    /// Where it is said.
    pub span: Span,
}

/// What a level of a sounding says of its moisture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moisture {
    /// Relative humidity over water, 0..1.
    RelativeHumidity(f64),
    /// Dew point \[K\].
    DewPoint(f64),
    /// Mass of vapour over mass of dry air.
    MixingRatio(f64),
}

/// One level of a sounding. `None`: an empty cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoundingLevel {
    /// Pressure \[hPa\].
    pub pressure: Option<f64>,
    /// Above sea level \[m\].
    pub altitude: Option<f64>,
    /// Temperature \[K\].
    pub temperature: Option<f64>,
    /// Moisture.
    pub moisture: Option<Moisture>,
}

/// A radiosonde's ascent, lowest level first.
#[derive(Clone, Debug, PartialEq)]
pub struct Sounding {
    /// Path of the file as shown in messages.
    pub path: String,
    /// The levels: known pressures descend, known altitudes ascend.
    pub levels: Vec<SoundingLevel>,
}

/// A station's record: for each field that it has, values against time.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Path of the file as shown in messages.
    pub path: String,
    /// Field of the weather block, and its values \[canonical unit\] at times that ascend.
    pub series: Vec<(&'static str, Vec<(Utc, f64)>)>,
}

/// What a record says of a field at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Observed {
    /// The value between the two readings about the time.
    Value {
        /// The value \[canonical unit\].
        value: f64,
        /// The readings that it was interpolated from, where they are further apart than [`Record::LONGEST_GAP`].
        across: Option<(Utc, Utc)>,
    },
    /// The time lies outside the readings, the first and last of which are given.
    Beyond(Utc, Utc),
}

impl Record {
    /// Readings further apart than this \[s\] leave a gap.
    pub const LONGEST_GAP: f64 = 3.0 * 3600.0;

    /// A field at a time, straight between the readings about it; `None` where the record does not have the field.
    pub fn at(&self, field: &str, time: Utc) -> Option<Observed> {
        let (_, series) = self.series.iter().find(|(name, _)| *name == field)?;
        let (first, last) = (series.first()?, series.last()?);
        if time < first.0 || time > last.0 {
            return Some(Observed::Beyond(first.0, last.0));
        }
        let after = series.partition_point(|(t, _)| *t < time);
        let (b, y) = series[after];
        if b == time {
            return Some(Observed::Value { value: y, across: None });
        }
        let (a, x) = series[after - 1];
        let step = b.0 - a.0;
        let value = x + (y - x) * (time.0 - a.0) / step;
        Some(Observed::Value { value, across: (step > Self::LONGEST_GAP).then_some((a, b)) })
    }
}

/// A layer of cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cloud {
    /// Optical depth at 550 nm, vertically.
    pub optical_depth: f64,
    /// Height of its base above the site's elevation \[m\].
    pub base: f64,
    /// Height of its top above the site's elevation \[m\].
    pub top: f64,
}

/// A weather block. `None`: unsaid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weather {
    /// Name.
    pub name: Option<String>,
    /// Named profile.
    pub profile: Option<String>,
    /// Meteorological range \[m\].
    pub visibility: Option<f64>,
    /// Aerosol optical depth at 550 nm.
    pub aod: Option<f64>,
    /// Aerosol model.
    pub aerosol: Option<ModelUse>,
    /// Surface pressure \[hPa\].
    pub pressure: Option<f64>,
    /// Surface temperature \[K\].
    pub temperature: Option<f64>,
    /// Relative humidity, 0..1.
    pub humidity: Option<f64>,
    /// Water column \[g cm⁻²\].
    pub water: Option<f64>,
    /// Ozone column \[atm-cm\].
    pub ozone: Option<f64>,
    /// NO₂ column \[atm-cm\].
    pub no2: Option<f64>,
    /// A radiosonde's ascent.
    pub radiosonde: Option<Arc<Sounding>>,
    /// A station's record.
    pub observations: Option<Arc<Record>>,
    /// Layers of cloud, lowest first; they do not overlap.
    pub clouds: Vec<Cloud>,
    /// Where each field is said.
    pub spans: BTreeMap<&'static str, Span>,
}

impl Weather {
    /// This weather with the fields that `over` says in place of its own; what they exclude goes too (visibility and
    /// aod, humidity and water).
    #[must_use]
    pub fn overridden(&self, over: &Weather) -> Weather {
        let mut out = self.clone();
        let mut drop = |fields: [&str; 2]| fields.map(|field| out.spans.remove(field));
        if over.visibility.is_some() || over.aod.is_some() {
            drop(["visibility", "aod"]);
            (out.visibility, out.aod) = (None, None);
        }
        if over.humidity.is_some() || over.water.is_some() {
            drop(["humidity", "water"]);
            (out.humidity, out.water) = (None, None);
        }
        out.profile = over.profile.clone().or(out.profile);
        out.aerosol = over.aerosol.clone().or(out.aerosol);
        out.visibility = over.visibility.or(out.visibility);
        out.aod = over.aod.or(out.aod);
        out.pressure = over.pressure.or(out.pressure);
        out.temperature = over.temperature.or(out.temperature);
        out.humidity = over.humidity.or(out.humidity);
        out.water = over.water.or(out.water);
        out.ozone = over.ozone.or(out.ozone);
        out.no2 = over.no2.or(out.no2);
        out.radiosonde = over.radiosonde.clone().or(out.radiosonde);
        out.observations = over.observations.clone().or(out.observations);
        if !over.clouds.is_empty() {
            out.clouds.clone_from(&over.clouds);
        }
        out.spans.extend(over.spans.iter().map(|(field, span)| (*field, *span)));
        out
    }

    /// This weather at a time: what it does not say itself is taken from its record. With what was asked of the record
    /// and found, field by field.
    pub fn observed(&self, time: Utc) -> (Self, Vec<(&'static str, Observed)>) {
        let mut out = self.clone();
        let Some(record) = &self.observations else { return (out, Vec::new()) };
        let (wet, hazy) = (self.humidity.or(self.water).is_some(), self.visibility.or(self.aod).is_some());
        let fields = [
            ("pressure", self.pressure.is_some(), &mut out.pressure),
            ("temperature", self.temperature.is_some(), &mut out.temperature),
            ("humidity", wet, &mut out.humidity),
            ("water", wet, &mut out.water),
            ("visibility", hazy, &mut out.visibility),
            ("aod", hazy, &mut out.aod),
            ("ozone", self.ozone.is_some(), &mut out.ozone),
            ("no2", self.no2.is_some(), &mut out.no2),
        ];
        let mut asked = Vec::new();
        for (field, said, value) in fields {
            let Some(observed) = record.at(field, time).filter(|_| !said) else { continue };
            if let Observed::Value { value: found, .. } = observed {
                *value = Some(found);
            }
            asked.push((field, observed));
        }
        // A column of water or an optical depth that was observed holds before a humidity or visibility beside it.
        if out.water.is_some() && !wet {
            out.humidity = None;
        }
        if out.aod.is_some() && !hazy {
            out.visibility = None;
        }
        if let Some(span) = self.spans.get("observations") {
            asked.iter().for_each(|(field, _)| _ = out.spans.entry(field).or_insert(*span));
        }
        (out, asked)
    }
}

/// One use of a model, its block held against what the model declares.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelUse {
    /// Name of the model.
    pub name: String,
    /// Label, by which experiments pick it.
    pub label: Option<String>,
    /// Arguments with defaults filled.
    pub args: Args,
    /// Where the model is named; `None` where it is a default of the language.
    pub span: Option<Span>,
    /// Where each given parameter's value stands.
    pub param_spans: BTreeMap<String, Span>,
}

/// A material.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name.
    pub name: String,
    /// Code in truth maps.
    pub code: u16,
    /// Title.
    pub title: Option<String>,
    /// Where its numbers come from.
    pub source: Option<String>,
    /// Under which licence.
    pub licence: Option<String>,
    /// Total (hemispherical) reflectance.
    pub reflectance: Option<SpectralValue>,
    /// Radiance leaving the front \[W m⁻² sr⁻¹ µm⁻¹\].
    pub emission: Option<SpectralValue>,
    /// Models, in order; empty where no facet refers to the material (its files were not opened).
    pub models: Vec<ModelUse>,
    /// Whether a facet, a mesh map or the ground refers to it.
    pub used: bool,
    /// Where it is declared.
    pub span: Span,
    /// Where `reflectance` and `emission` are said.
    pub spans: BTreeMap<&'static str, Span>,
}

/// Where and how a thing stands: applied as scale, roll, pitch, heading, at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position \[m\]; where `on_surface`, z counts from the terrain, the ground or z = 0 there.
    pub at: DVec3,
    /// Whether it stands on what lies below or above it, as `at (x y)` says.
    pub on_surface: bool,
    /// Clockwise from north \[rad\].
    pub heading: f64,
    /// Nose up \[rad\].
    pub pitch: f64,
    /// Right side down \[rad\].
    pub roll: f64,
    /// Scale.
    pub scale: f64,
}

impl Default for Pose {
    fn default() -> Self {
        Self { at: DVec3::ZERO, on_surface: false, heading: 0.0, pitch: 0.0, roll: 0.0, scale: 1.0 }
    }
}

/// Where a panel faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Facing {
    /// A world direction.
    Direction(DVec3),
    /// A point.
    Point(DVec3),
    /// A sensor's position, by index in [`Scene::sensors`].
    Sensor(usize),
    /// Tilt from the level and azimuth of the downhill side \[rad\].
    Slope {
        /// Tilt.
        slope: f64,
        /// Azimuth of the normal.
        aspect: f64,
    },
}

/// A file named by a scene, read already.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// Path as shown in messages.
    pub path: String,
    /// Content.
    pub bytes: Arc<[u8]>,
    /// Where it is named.
    pub span: Span,
}

/// Planar polygons of one file, packed: 24 bytes a corner and 12 a polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygons {
    file: FileId,
    corners: Vec<DVec3>,
    /// For each polygon, where its corners end, and its place.
    ends: Vec<(u32, u32, u32)>,
}

impl Polygons {
    /// No polygons yet, of a file.
    pub fn new(file: FileId) -> Self {
        Self { file, corners: Vec::new(), ends: Vec::new() }
    }
    /// Makes room for so many polygons and corners more.
    pub fn reserve(&mut self, polygons: usize, corners: usize) {
        self.ends.reserve_exact(polygons);
        self.corners.reserve_exact(corners);
    }
    /// Adds a polygon \[m\] with its place in the file.
    pub fn push(&mut self, corners: &[DVec3], span: Span) {
        self.corners.extend_from_slice(corners);
        self.ends.push((self.corners.len() as u32, span.start, span.end));
    }
    /// Number of polygons.
    pub fn len(&self) -> usize {
        self.ends.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }
    /// Polygon `i`, which must be below [`Polygons::len`]: its corners \[m\] and its place.
    pub fn get(&self, i: usize) -> (&[DVec3], Span) {
        let first = if i == 0 { 0 } else { self.ends[i - 1].0 };
        let (end, from, to) = self.ends[i];
        (&self.corners[first as usize..end as usize], Span { file: self.file, start: from, end: to })
    }
    /// The polygons with their places.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&[DVec3], Span)> {
        (0..self.len()).map(|i| self.get(i))
    }
}

/// One geometry statement.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Planar polygons, corners counter-clockwise seen from the front.
    Facets {
        /// Index of the material.
        material: usize,
        /// The polygons.
        polygons: Polygons,
    },
    /// A rectangle about its centre, lower edge level.
    Panel {
        /// Index of the material.
        material: usize,
        /// Width and height \[m\].
        size: DVec2,
        /// Where it faces.
        facing: Facing,
        /// Pose; `at` is the centre.
        pose: Pose,
        /// Where it is said.
        span: Span,
    },
    /// A box on the centre of its base.
    Box {
        /// Index of the material.
        material: usize,
        /// Along x, y, z \[m\].
        size: DVec3,
        /// Pose.
        pose: Pose,
        /// Where it is said.
        span: Span,
    },
    /// A disk about its centre.
    Disk {
        /// Index of the material.
        material: usize,
        /// Radius \[m\].
        radius: f64,
        /// Sides of the polygon that stands for the circle.
        sides: u32,
        /// Where it faces.
        facing: Facing,
        /// Pose; `at` is the centre.
        pose: Pose,
        /// Where it is said.
        span: Span,
    },
    /// A cylinder or cone on the centre of its base, or a sphere about its centre.
    Solid {
        /// Index of the material.
        material: usize,
        /// What it is.
        form: Solid,
        /// Sides of the polygons that stand for circles.
        sides: u32,
        /// Pose.
        pose: Pose,
        /// Where it is said.
        span: Span,
    },
    /// A mesh from a file.
    Mesh {
        /// The OBJ file.
        file: SceneFile,
        /// Metres per unit of the file.
        unit: f64,
        /// Whether y is up in the file (else z).
        y_up: bool,
        /// Pose.
        pose: Pose,
        /// `usemtl` names (`*` any) to materials; the first match wins.
        maps: Vec<(String, usize, Span)>,
    },
    /// Placements of an object.
    Place {
        /// Index in [`Scene::objects`].
        object: usize,
        /// Name of the placement.
        name: Option<String>,
        /// One pose per member.
        poses: Vec<Pose>,
        /// Where it is said.
        span: Span,
    },
    /// Members of a region at random.
    Scatter(Scatter),
}

/// A round solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// Upright.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Height \[m\].
        height: f64,
    },
    /// Upright.
    Cone {
        /// Radius of the base \[m\].
        radius: f64,
        /// Height \[m\].
        height: f64,
    },
    /// About its centre.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
}

/// Members of a region at random.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Index in [`Scene::objects`].
    pub object: usize,
    /// How many.
    pub count: u64,
    /// Where, about the pose's `at`.
    pub region: Region,
    /// Pose of the whole; its scale is 1. Members of a rectangle that is `on_surface` stand there one by one.
    pub pose: Pose,
    /// Scales of the members, from and to.
    pub scale: (f64, f64),
    /// Headings of the members beside the pose's own, from and to \[rad\].
    pub heading: (f64, f64),
    /// Least distance between members \[m\].
    pub spacing: Option<f64>,
    /// Distribution of inclinations.
    pub leaves: Option<Leaves>,
    /// Seed.
    pub seed: u64,
    /// Where it is said.
    pub span: Span,
}

/// Where members lie, about a centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// A ball.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
    /// An upright cylinder.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Height \[m\].
        height: f64,
    },
    /// A box.
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

/// The surface over a grid of heights.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    /// Heights: CSV, ESRI ASCII or GeoTIFF.
    pub heights: SceneFile,
    /// Scene x, y of the south-west post \[m\]; `None`: the file's own coordinates.
    pub origin: Option<DVec2>,
    /// Between posts, both ways \[m\]; `None`: the file's own.
    pub spacing: Option<f64>,
    /// Index of the material where no class says another.
    pub material: usize,
    /// Classes of the posts, in a grid of the same size.
    pub classes: Option<SceneFile>,
    /// Classes to materials, each class once.
    pub maps: Vec<(u32, usize, Span)>,
    /// Where it is said.
    pub span: Span,
}

/// Geometry in its own frame, +y ahead.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Name.
    pub name: String,
    /// Its geometry; may place other objects. Empty where the object is never placed (its files were not opened).
    pub shapes: Vec<Shape>,
    /// Where it is declared.
    pub span: Span,
}

/// The endless level plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Index of the material.
    pub material: usize,
    /// Height \[m\].
    pub height: f64,
    /// Where it is said.
    pub span: Span,
}

/// How a sensor projects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// Pinhole.
    Perspective,
    /// Parallel.
    Orthographic,
    /// Perspective across, lines carried along.
    Pushbroom,
    /// Equal angles across, lines carried along.
    Whiskbroom,
}

impl Projection {
    /// Whether the image is made line by line from a moving sensor.
    pub fn is_scanner(self) -> bool {
        matches!(self, Self::Pushbroom | Self::Whiskbroom)
    }
}

/// How a scanner moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Clockwise from north \[rad\].
    pub heading: f64,
    /// \[m/s\]
    pub speed: f64,
    /// Lines a second \[Hz\].
    pub line_rate: f64,
}

/// Where a sensor stands and looks; of a scanner, at its first line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SensorPose {
    /// Position and a point it looks at.
    LookAt {
        /// Position \[m\].
        position: DVec3,
        /// The point \[m\].
        look_at: DVec3,
        /// Roll about the line of sight \[rad\].
        roll: f64,
    },
    /// Position and attitude.
    Attitude {
        /// Position \[m\].
        position: DVec3,
        /// Clockwise from north \[rad\].
        heading: f64,
        /// Below the horizontal \[rad\]; of a scanner up to π: beyond π/2 it looks back.
        depression: f64,
        /// Roll about the line of sight, of a scanner about its heading \[rad\].
        roll: f64,
    },
    /// A point and the view angles from it.
    Target {
        /// The point \[m\].
        look_at: DVec3,
        /// Height of the sensor above sea level \[m\].
        altitude: f64,
        /// Zenith angle, target to sensor \[rad\].
        view_zenith: f64,
        /// Azimuth, target to sensor \[rad\].
        view_azimuth: f64,
    },
}

/// The scale of a sensor's image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Optics {
    /// Across the image \[rad\].
    FieldOfView(f64),
    /// Of one pixel \[rad\].
    Ifov(f64),
    /// Focal length and pixel pitch \[m\].
    FocalLength {
        /// Focal length.
        focal_length: f64,
        /// Pixel pitch.
        pitch: f64,
    },
    /// Width on the ground across \[m\].
    Swath(f64),
    /// Width of one pixel on the ground \[m\].
    GroundSample(f64),
}

/// Bands of a sensor, as said.
#[derive(Clone, Debug, PartialEq)]
pub enum Bands {
    /// `band NAME lower..upper` \[µm\]
    Edges {
        /// Name.
        name: String,
        /// Lower edge.
        lower: f64,
        /// Upper edge.
        upper: f64,
        /// Where it is said.
        span: Span,
    },
    /// `band NAME centre … fwhm …` \[µm\]
    Gaussian {
        /// Name.
        name: String,
        /// Centre.
        centre: f64,
        /// Full width at half maximum.
        fwhm: f64,
        /// Where it is said.
        span: Span,
    },
    /// `band NAME response FILE`
    Response {
        /// Name.
        name: String,
        /// Table of relative response.
        file: SceneFile,
        /// Where it is said.
        span: Span,
    },
    /// `bands SET only …`, a shipped set by name.
    Set {
        /// Name of the set.
        set: String,
        /// The bands wanted; all where `None`.
        only: Option<Vec<String>>,
        /// Where it is said.
        span: Span,
    },
    /// `bands FILE only …`
    FileSet {
        /// Table of relative responses.
        file: SceneFile,
        /// The bands wanted; all where `None`.
        only: Option<Vec<String>>,
        /// Where it is said.
        span: Span,
    },
    /// `bands lower..upper every step fwhm width` \[µm\]
    Series {
        /// First centre.
        lower: f64,
        /// Last centre.
        upper: f64,
        /// Step.
        every: f64,
        /// Full width at half maximum of each.
        fwhm: f64,
        /// Where it is said.
        span: Span,
    },
}

/// A sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Name.
    pub name: String,
    /// Projection.
    pub projection: Projection,
    /// Where it stands and looks.
    pub pose: SensorPose,
    /// Scale.
    pub optics: Optics,
    /// Across, down.
    pub pixels: (u32, u32),
    /// Motion, of a scanner.
    pub flight: Option<Flight>,
    /// Its detector.
    pub ccd: Option<ModelUse>,
    /// Bands, in order.
    pub bands: Vec<Bands>,
    /// Indices of the collection sets it takes part in.
    pub collects: Vec<usize>,
    /// Where it is declared.
    pub span: Span,
}

/// How accurate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Accuracy {
    /// Samples a pixel.
    Samples(u32),
    /// Relative standard error of a pixel, 0..1, against the larger of the pixel and a floor \[W m⁻² sr⁻¹ µm⁻¹\].
    Error {
        /// Relative error.
        relative: f64,
        /// Floor.
        floor: Option<f64>,
        /// Of every pixel; else of the root mean square over the image.
        every_pixel: bool,
    },
    /// As many samples as fit into a time of rendering \[s\], the same for every pixel.
    Time {
        /// Wall-clock seconds.
        seconds: f64,
    },
}

/// The small picture of a study that `test` renders and compares.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Across, down, in place of every sensor's own.
    pub pixels: (u32, u32),
    /// Largest relative difference that is no difference, 0..1.
    pub tolerance: f64,
    /// Names of the experiments; all where empty. The name of an experiment stands for all runs of its sweeps.
    pub experiments: Vec<String>,
    /// Where it is said; `None` where the scene says nothing.
    pub span: Option<Span>,
}

impl Default for Snapshot {
    fn default() -> Self {
        Self { pixels: (64, 48), tolerance: 1e-3, experiments: Vec::new(), span: None }
    }
}

/// What an experiment writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Products {
    /// radiance.exr, radiance.img, error.exr
    pub radiance: bool,
    /// truth.exr and the sun-lit fraction.
    pub truth: bool,
    /// Preview PNGs.
    pub preview: bool,
    /// The radiance that leaves the surface, before τ₂ and L_u.
    pub surface_radiance: bool,
    /// Digital numbers of the sensor's detector.
    pub counts: bool,
    /// π times that radiance over the irradiance of the open level ground.
    pub reflectance_factor: bool,
}

impl Products {
    /// None of them.
    pub const NOTHING: Self = Self {
        radiance: false,
        truth: false,
        preview: false,
        surface_radiance: false,
        counts: false,
        reflectance_factor: false,
    };
}

/// An experiment, or one run of an experiment that sweeps.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Name of the run: `haze`, or with its swept values `haze/reflectance=phong,visibility=5km`.
    pub name: String,
    /// Name of the experiment in the text: `haze`.
    pub base: String,
    /// Swept values by name, in the order of the text.
    pub sweep: Vec<(String, String)>,
    /// Constants that it gives another value, as written.
    pub constants: Vec<(String, String)>,
    /// Position among all runs of the scene.
    pub order: usize,
    /// Radiance algorithm.
    pub algorithm: ModelUse,
    /// Atmosphere.
    pub atmosphere: ModelUse,
    /// Fields of the weather that it replaces.
    pub weather: Option<Weather>,
    /// For each material, the index of the model that it takes; `None` for an unused material.
    pub models: Vec<Option<usize>>,
    /// Indices of its sensors.
    pub sensors: Vec<usize>,
    /// Indices of its collection sets.
    pub collects: Vec<usize>,
    /// How accurate.
    pub accuracy: Accuracy,
    /// Seed.
    pub seed: u64,
    /// What is written.
    pub products: Products,
    /// Where it is declared; `None` for `default`.
    pub span: Option<Span>,
}
