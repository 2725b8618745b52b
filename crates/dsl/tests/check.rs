//! Texts against a small catalogue: the scene they mean, and the one code that each fault has.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use glam::DVec3;
use sunglint_dsl::scene::{Accuracy, Bands, Crs, Facing, Optics, Projection, SensorPose, Shape, Snapshot, Times};
use sunglint_dsl::{Diagnostic, LoadError, Loaded, Loader, Scene, Severity, Sources, check, parse};
use sunglint_plugin::{Catalog, Column, Default, ModelInfo, Param, Role, SpectralValue, TableKey};
use sunglint_radiometry::Dimension;

const EXAMPLE: &str = r#"glint 1
site { latitude 43.084 deg, longitude -77.674 deg, elevation 168 m }
collect { at 1992-06-18 12:00 -04:00 }
weather { visibility 23 km }
material blacktop { ideal { diffuse 0.08 } }
material grey { ideal { diffuse 0.18 } }
facet blacktop (-20 -20 0) (20 -20 0) (20 20 0) (-20 20 0) m
panel grey size (2 1.4) m at (0 5 0.7) m facing roof
sensor roof {
  position (0 -25 15) m
  look_at (0 3 0) m
  field_of_view 30 deg
  pixels 320 x 240
  band red 600..750 nm
}
"#;

const SPLIT_TABLE: &[Column] = &[
    Column { name: "view_zenith", dimension: Dimension::Angle, range: (0.0, std::f64::consts::FRAC_PI_2) },
    Column { name: "diffuse", dimension: Dimension::Fraction, range: (0.0, 1.0) },
    Column { name: "specular", dimension: Dimension::Fraction, range: (0.0, 1e6) },
];
const IDEAL: &[Param] = &[
    Param::spectrum("diffuse", Dimension::Fraction, Default::Absent, "diffuse reflectance")
        .within(0.0, 1.0)
        .excludes(&["specular"]),
    Param::spectrum("specular", Dimension::Fraction, Default::Absent, "specular reflectance").within(0.0, 1.0),
];
const SPLIT: &[Param] = &[
    Param::word("category", &["highly_diffuse", "highly_specular"], Default::Absent, "a fallback"),
    Param::spectrum("total", Dimension::Fraction, Default::Absent, "total reflectance").within(0.0, 1.0),
    Param::table("table", SPLIT_TABLE, Default::Absent, "a split table").excludes(&["category"]),
    Param::quantity("solid_angle", Dimension::SolidAngle, Default::Number(6.8e-5), "acceptance"),
];
const PHONG: &[Param] = &[
    Param::spectrum("diffuse", Dimension::Fraction, Default::Required, "k_d").within(0.0, 1.0),
    Param::spectrum("specular", Dimension::Fraction, Default::Required, "k_s").within(0.0, 1.0),
    Param::quantity("exponent", Dimension::Fraction, Default::Required, "m").within(0.0, 1e6),
];
const APPROXIMATIONS: &[Param] = &[
    Param::word("reading", &["published", "corrected"], Default::Word("published"), "the equations"),
    Param::word("sky", &["isotropic", "directional"], Default::Word("isotropic"), "the sky"),
    Param::count("depth", &["unlimited"], Default::Count(2), "reflections"),
    Param::switch("adjacency", false, "light from beside"),
];
const PHASES: &[Column] = &[
    Column { name: "angle", dimension: Dimension::Angle, range: (0.0, std::f64::consts::PI) },
    Column { name: "phase", dimension: Dimension::Fraction, range: (0.0, 1e6) },
];
const DUST: &[Param] = &[
    Param::quantity("exponent", Dimension::Fraction, Default::Number(1.3), "of the optical depth").within(-1.0, 4.0),
    Param::spectrum("albedo", Dimension::Fraction, Default::Required, "of single scattering").within(0.0, 1.0),
    Param::spectrum("asymmetry", Dimension::Fraction, Default::Absent, "g").within(-1.0, 1.0).excludes(&["phase"]),
    Param::table("phase", PHASES, Default::Absent, "against angle"),
];

fn catalog() -> Catalog {
    let mut catalog = Catalog::default();
    let mut add = |role, name, params| catalog.add(role, ModelInfo { name, summary: "", manual: "", params });
    add(Role::Reflectance, "ideal", IDEAL);
    add(Role::Reflectance, "split", SPLIT);
    add(Role::Reflectance, "phong", PHONG);
    add(Role::Reflectance, "blend", const { &[Param::weights("weights", Default::Required, "labels and shares")] });
    add(Role::Reflectance, "matt", &[]);
    add(Role::Aerosol, "rural", &[]);
    add(Role::Aerosol, "urban", &[]);
    add(Role::Aerosol, "dust", DUST);
    add(Role::Atmosphere, "none", &[]);
    add(Role::Atmosphere, "layered", const { &[Param::count("streams", &["auto"], Default::Word("auto"), "")] });
    add(Role::Atmosphere, "spectrl2", &[]);
    add(Role::Atmosphere, "table", const { &[Param::file("file", Default::Required, "the table")] });
    add(
        Role::Algorithm,
        "ideal",
        const { &[Param::word("reading", &["published", "corrected"], Default::Word("published"), "")] },
    );
    add(Role::Algorithm, "split", APPROXIMATIONS);
    add(
        Role::Detector,
        "ccd",
        const {
            &[
                Param::quantity("pitch", Dimension::Length, Default::Absent, "").within(1e-8, 1.0),
                Param::quantity("exposure", Dimension::Time, Default::Absent, "").within(1e-9, 1e5),
                Param::quantity("f_number", Dimension::Fraction, Default::Absent, "").within(0.1, 1e4),
                Param::quantity("full_well", Dimension::Electrons, Default::Absent, "").within(1.0, 1e12),
                Param::quantity("gain", Dimension::Gain, Default::Absent, "").within(1e-6, 1e12),
                Param::spectrum("quantum_efficiency", Dimension::Fraction, Default::Absent, ""),
                Param::count("bits", &[], Default::Count(16), "").within(1.0, 24.0),
            ]
        },
    );
    catalog
}

/// Files in memory; every one that was opened is noted.
#[derive(Default)]
struct Memory {
    files: BTreeMap<String, Vec<u8>>,
    opened: Vec<String>,
}

impl Loader for Memory {
    fn read(&mut self, path: &str, _from: &str) -> Result<Loaded, LoadError> {
        self.opened.push(path.to_string());
        match self.files.get(path) {
            Some(bytes) => Ok(Loaded { path: path.to_string(), bytes: bytes.as_slice().into() }),
            None => {
                let nearest = sunglint_dsl::nearest(path, self.files.keys().map(String::as_str)).map(str::to_string);
                Err(LoadError { message: format!("there is no file {path}"), nearest })
            }
        }
    }

    fn list(&mut self, path: &str, _from: &str) -> Result<Vec<String>, LoadError> {
        let own = |file: &String| Some(file.strip_prefix(path)?.strip_prefix('/')?.to_string());
        let names: Vec<String> = self.files.keys().filter_map(own).collect();
        if names.is_empty() && path != "sunglint:materials" {
            return Err(LoadError { message: format!("there is no folder {path}"), nearest: None });
        }
        Ok(names)
    }
}

struct Outcome {
    scene: Option<Scene>,
    diagnostics: Vec<Diagnostic>,
    sources: Sources,
    opened: Vec<String>,
}

impl Outcome {
    fn codes(&self) -> Vec<&'static str> {
        self.diagnostics.iter().map(|fault| fault.code).collect()
    }
    fn shown(&self) -> String {
        let show = |fault: &Diagnostic| {
            let place = fault.span.map_or(String::new(), |span| format!(" at `{}`", self.sources.text(span)));
            format!(
                "{:?} {}: {}{place} [{}] {:?}\n",
                fault.severity, fault.code, fault.message, fault.label, fault.help
            )
        };
        self.diagnostics.iter().map(show).collect()
    }
}

fn run_with(text: &[u8], files: &[(&str, &str)]) -> Outcome {
    let mut loader = Memory::default();
    loader.files.insert("main.glint".to_string(), text.to_vec());
    loader.files.extend(files.iter().map(|(path, text)| ((*path).to_string(), text.as_bytes().to_vec())));
    let (mut sources, mut diagnostics) = (Sources::default(), Vec::new());
    let ast = parse("main.glint", &mut loader, &mut sources, &mut diagnostics);
    loader.opened.clear();
    let scene = check(&ast, &mut sources, &catalog(), &mut loader, &mut diagnostics);
    Outcome { scene, diagnostics, sources, opened: loader.opened }
}

fn run(text: &str) -> Outcome {
    run_with(text.as_bytes(), &[])
}

fn good(text: &str) -> Scene {
    let out = run(text);
    assert!(out.diagnostics.is_empty(), "{text}\n{}", out.shown());
    out.scene.unwrap()
}

/// The example with one piece replaced.
fn edited(from: &str, to: &str) -> String {
    assert!(EXAMPLE.contains(from), "{from}");
    EXAMPLE.replacen(from, to, 1)
}

#[test]
fn the_first_example_means_its_scene() {
    let scene = good(EXAMPLE);
    let site = scene.site.unwrap();
    assert!((site.latitude - 43.084f64.to_radians()).abs() < 1e-15 && site.elevation == 168.0);
    // 1992-06-18 16:00 UTC is Julian date 2448792.16667.
    let Times::At(times) = &scene.collects[0].times else { panic!("{:?}", scene.collects) };
    assert!((times[0].julian_date() - 2_448_792.166_666_667).abs() < 1e-8);
    assert_eq!(scene.weathers[0].visibility, Some(23_000.0));
    assert_eq!(scene.materials.iter().map(|m| (m.code, m.used)).collect::<Vec<_>>(), [(1000, true), (1001, true)]);
    let ideal = &scene.materials[0].models[0];
    assert_eq!((ideal.name.as_str(), ideal.args.spectral("diffuse")), ("ideal", Some(&SpectralValue::Constant(0.08))));
    let [Shape::Facets { polygons, .. }, Shape::Panel { size, facing, pose, .. }] = scene.world.as_slice() else {
        panic!("{:?}", scene.world)
    };
    assert_eq!(polygons.get(0).0[2], DVec3::new(20.0, 20.0, 0.0));
    assert_eq!((size.x, size.y, *facing, pose.at), (2.0, 1.4, Facing::Sensor(0), DVec3::new(0.0, 5.0, 0.7)));
    let sensor = &scene.sensors[0];
    assert_eq!(sensor.pixels, (320, 240));
    assert!(matches!(sensor.pose, SensorPose::LookAt { position, .. } if position == DVec3::new(0.0, -25.0, 15.0)));
    assert!(matches!(sensor.optics, Optics::FieldOfView(angle) if (angle - 30f64.to_radians()).abs() < 1e-15));
    assert!(matches!(sensor.bands[0], Bands::Edges { lower, upper, .. } if lower == 0.6 && upper == 0.75));
    let experiment = &scene.experiments[0];
    assert_eq!((experiment.name.as_str(), experiment.algorithm.name.as_str()), ("default", "split"));
    assert_eq!((scene.atmosphere.name.as_str(), &experiment.models), ("layered", &vec![Some(0), Some(0)]));
    assert_eq!(experiment.accuracy, Accuracy::Error { relative: 0.01, floor: None, every_pixel: true });
    assert_eq!(experiment.algorithm.args.word("reading"), Some("published"));
}

/// Each fault alone in an otherwise correct scene gives its code, once, and nothing else.
#[test]
fn one_fault_gives_one_message_with_its_code() {
    let cases: &[(&str, &str, &str)] = &[
        // shape
        ("S03", "look_at (0 3 0) m\n  field_of_view", "look_at (0 3 0) m field_of_view"),
        ("S03", "ideal { diffuse 0.18 }", "reflectance 0.2 ideal"),
        ("S03", "field_of_view 30 deg\n", "field_of_view 30 deg 40 deg\n"),
        ("S05", "pixels 320 x 240\n", "pixels 320 x 240\n  pixels 320 x 200\n"),
        ("S05", "pixels 320 x 240\n", ""),
        ("S05", "  band red 600..750 nm\n", ""),
        ("S05", "visibility 23 km", "visibility 23 km, aod 0.2"),
        ("S05", "visibility 23 km", "humidity 60 %, water 2 g/cm2"),
        ("S05", "ideal { diffuse 0.18 }", "ideal { diffuse 0.18, specular 0.1 }"),
        ("S05", "ideal { diffuse 0.18 }", "phong { diffuse 0.18, exponent 20 }"),
        ("S05", "{ ideal { diffuse 0.18 } }", "{ title \"grey\" }"),
        ("S05", "field_of_view 30 deg", "field_of_view"),
        ("S05", "size (2 1.4) m ", ""),
        ("S05", "facing roof", "slope 10 deg"),
        ("S05", "facing roof", "facing roof slope 10 deg aspect 0 deg"),
        ("S02", "pixels 320 x 240", "pixels 320 x 240 { }"),
        // units
        ("U01", "30 deg", "30 degres"),
        ("U01", "30 deg", "30 degrees"),
        ("U01", "30 deg", "30 deg m"),
        ("U01", "diffuse 0.18", "diffuse 0.18 m"),
        ("U02", "30 deg", "30"),
        ("U02", "(0 3 0) m", "(0 3 0)"),
        ("U02", "visibility 23 km", "humidity 60"),
        ("U03", "23 km", "23 min"),
        ("U03", "(0 5 0.7) m", "(0 5 0.7) deg"),
        ("U04", "(0 3 0) m", "(0 3) m"),
        ("U04", "(20 20 0)", "(20 20)"),
        ("U04", "30 deg", "\"wide\""),
        ("U05", "latitude 43.084 deg", "latitude 93.084 deg"),
        ("U05", "diffuse 0.18", "diffuse 18"),
        ("U05", "600..750 nm", "750..600 nm"),
        ("U05", "600..750 nm", "600..750 um"),
        ("U05", "320 x 240", "0 x 240"),
        // names
        ("N01", "pixels 320", "pixel 320"),
        ("N01", "band red", "fov 3 deg\n  band red"),
        ("N01", "facing roof", "fasing roof"),
        ("N01", "ideal { diffuse 0.18 }", "idel { diffuse 0.18 }"),
        ("N01", "diffuse 0.18", "difuse 0.18"),
        ("N01", "visibility 23 km", "aerosol rurl"),
        ("N01", "visibility 23 km", "aerosol spectrl2"),
        ("N01", "visibility 23 km", "aerosol rural { exponent 1 }"),
        ("N01", "visibility 23 km", "aerosol dust { albedo 0.9, exponnt 1 }"),
        ("S05", "visibility 23 km", "aerosol dust"),
        ("S05", "visibility 23 km", "aerosol"),
        ("S05", "visibility 23 km", "aerosol dust { albedo 0.9, asymmetry 0.6, phase \"white.csv\" }"),
        ("S03", "visibility 23 km", "aerosol rural 2"),
        ("U05", "visibility 23 km", "aerosol dust { albedo 1.2 }"),
        ("N05", "visibility 23 km", "aerosol much }\ndefine much 3 m\nweather w {"),
        ("N01", "weather {", "atmosphere spectrl3\nweather {"),
        ("N02", "facing roof", "facing rof"),
        ("N02", "facet blacktop", "facet blaktop"),
        ("N02", "facet blacktop", "facet roof"),
        ("N02", "30 deg", "wide"),
        ("N03", "material grey {", "material blacktop { ideal }\nmaterial grey {"),
        ("N03", "material grey {", "material km { ideal }\nmaterial grey {"),
        ("N03", "material grey {", "define at 3 m\nmaterial grey {"),
        ("N04", "material grey {", "define a b\ndefine b a\nmaterial grey {"),
        ("N04", "material grey {", "material x like y\nmaterial y like x\nmaterial grey {"),
        ("N04", "material grey {", "object a { place b }\nobject b { place a }\nmaterial grey {"),
        (
            "N05",
            "material grey {",
            "define height 15 m\nsensor other like roof { field_of_view height }\nmaterial grey {",
        ),
        ("N05", "visibility 23 km", "visibility path }\ndefine path \"x.csv\"\nweather w {"),
        // time
        ("T01", "collect { at 1992-06-18 12:00 -04:00 }\n", ""),
        ("T01", "1992-06-18", "2023-02-29"),
        ("T01", "12:00", "25:00"),
        ("T01", "-04:00 }", "-19:00 }"),
        ("T01", "site { latitude 43.084 deg, longitude -77.674 deg, elevation 168 m }\n", ""),
        ("T01", "at 1992-06-18 12:00 -04:00", "zone -04:00"),
        ("T02", "at 1992-06-18 12:00 -04:00", "at [1992-06-18 12:00 -04:00, 1992-06-18 11:00 -04:00]"),
        ("T02", "at 1992-06-18 12:00 -04:00", "on 1992-06-18 from 12:00 to 11:00 every 30 min"),
        ("T02", "at 1992-06-18 12:00 -04:00", "on 1992-06-18 from 11:00 to 12:00 every 10 ms"),
        ("T02", "at 1992-06-18 12:00 -04:00", "at []"),
        ("S05", "at 1992-06-18 12:00 -04:00", "on 1992-06-18 from 11:00 to 12:00"),
        ("S05", "at 1992-06-18 12:00 -04:00", "at 1992-06-18 12:00 -04:00, sun none"),
        // materials
        ("M01", "material grey {", "material a code 7 { ideal }\nmaterial b code 7 { ideal }\nmaterial grey {"),
        ("M02", "material grey {", "experiment lobes { reflectance phong }\nmaterial grey {"),
        ("M03", "ideal { diffuse 0.18 }", "ideal { diffuse 0.18 }, ideal { diffuse 0.2 }"),
        (
            "M03",
            "ideal { diffuse 0.18 }",
            "ideal dry { diffuse 0.18 }, phong dry { diffuse 0.1, specular 0, exponent 3 }",
        ),
        ("M05", "ideal { diffuse 0.18 }", "reflectance 1.2, ideal"),
        ("M05", "diffuse 0.18", "diffuse [500 nm 0.1, 450 nm 0.2]"),
        ("M05", "ideal { diffuse 0.18 }", "split { table [30 deg 0.1 0.2, 10 deg 0.1 0.2] }"),
        ("U04", "ideal { diffuse 0.18 }", "split { table [30 deg 0.1] }"),
        // geometry
        ("G01", "(20 20 0) (-20 20 0)", "(20 -20 0) (-20 -20 0)"),
        ("G01", "(20 20 0) (-20 20 0)", "(-20 20 0) (20 20 0)"),
        ("G02", "(20 20 0) (-20 20 0)", "(20 20 1) (-20 20 0)"),
        ("G04", "size (2 1.4) m at (0 5 0.7) m", "size (2 0) m at (0 5 0.7) m"),
        ("G04", "facing roof", "facing roof scale 0"),
        ("G03", "material grey {", "mesh \"a.obj\" unit m\nmaterial grey {"),
        // sensors
        ("V01", "position (0 -25 15) m\n", ""),
        ("V01", "field_of_view 30 deg\n", ""),
        ("V01", "field_of_view 30 deg\n", "field_of_view 30 deg, ifov 1 mrad\n"),
        ("V01", "field_of_view 30 deg\n", "swath 30 m\n"),
        ("V01", "field_of_view 30 deg\n", "focal_length 50 mm\n"),
        ("V01", "look_at (0 3 0) m\n", "look_at (0 3 0) m\n  heading 30 deg\n"),
        ("V01", "field_of_view 30 deg\n", "field_of_view 30 deg, line_rate 10 Hz\n"),
        ("V02", "look_at (0 3 0) m", "look_at (0 -25 15) m"),
        ("V02", "position (0 -25 15) m", "altitude 150 m, view_zenith 0 deg, view_azimuth 0 deg"),
        ("V03", "band red 600..750 nm", "band red 600..750 nm, band red 500..600 nm"),
        // experiments
        ("X01", "material grey {", "experiment a { products [radiance, trut] }\nmaterial grey {"),
        ("X01", "material grey {", "experiment a { sensor [] }\nmaterial grey {"),
        ("X02", "23 km", "sweep [5, 23] km"),
        ("X02", "material grey {", "experiment a { seed sweep [] }\nmaterial grey {"),
        ("X02", "material grey {", "experiment a { seed sweep 3 }\nmaterial grey {"),
        ("X02", "material grey {", "experiment a { weather { visibility sweep [5 km, 5000 m] } }\nmaterial grey {"),
        ("X02", "material grey {", "experiment a { weather { visibility sweep [5 km, \"far\"] } }\nmaterial grey {"),
        ("X02", "material grey {", "experiment a { seed sweep [1 2, 3] }\nmaterial grey {"),
        ("U03", "material grey {", "experiment a { weather { visibility sweep [5 km, 5 min] } }\nmaterial grey {"),
        ("N02", "material grey {", "define tone 0.1\nexperiment a { define tine 0.2 }\nmaterial grey {"),
        ("S05", "material grey {", "define t 1\nexperiment a { define t 2, define t 3 }\nmaterial grey {"),
        (
            "N05",
            "diffuse 0.18",
            "diffuse tone } }\ndefine tone 0.1\nexperiment a { define tone 3 m }\nmaterial b { ideal { diffuse 0",
        ),
        ("N04", "material grey {", "define a 1\ndefine b a\nexperiment e { define a b }\nmaterial grey {"),
        ("U03", "material grey {", "experiment a { time 60 m }\nmaterial grey {"),
        ("U05", "material grey {", "experiment a { time 0 s }\nmaterial grey {"),
        // databases
        ("N02", "material grey {", "material asfalt\nmaterial grey {"),
        ("N02", "material grey {", "material b like lawns\nmaterial grey {"),
        ("N02", "facet blacktop", "facet lawn"),
        ("F01", "material grey {", "database \"stone\"\nmaterial broken\nmaterial grey {"),
        ("F01", "material grey {", "database \"stone\"\nmaterial empty\nmaterial grey {"),
        ("F01", "material grey {", "database \"stone\"\nmaterial coded\nmaterial grey {"),
        ("F01", "material grey {", "database \"nowhere\"\nmaterial grey {"),
        ("M03", "ideal { diffuse 0.18 }", "blend { weights [blend 1] }"),
        ("M03", "ideal { diffuse 0.18 }", "ideal { diffuse 0.18 }, blend { weights [shine 0.5] }"),
        ("X03", "material grey {", "experiment a { algorithm ideal { sky directional } }\nmaterial grey {"),
        ("X03", "material grey {", "experiment a { samples 64, time 60 s }\nmaterial grey {"),
        // files
        ("F01", "diffuse 0.18", "diffuse \"whit.csv\""),
        ("F02", "diffuse 0.18", "diffuse \"white.csv\" column nowhere"),
        // later versions
        ("L01", "material grey {", "experiment a { algorithm radiosity }\nmaterial grey {"),
        ("F01", "visibility 23 km", "radiosonde \"buf_12z.csv\""),
        ("L01", "material grey {", "periodic (0 0) (9 9) m\nmaterial grey {"),
        ("L01", "material grey {", "plugin \"foam\"\nmaterial grey {"),
        // scanners, detectors, coordinate systems
        ("V01", "field_of_view", "projection pushbroom\n  field_of_view"),
        ("V01", "field_of_view", "projection pushbroom, speed 50 m/s\n  field_of_view"),
        ("V01", "field_of_view", "line_rate 100 Hz\n  field_of_view"),
        ("V01", "field_of_view", "heading 20 deg\n  field_of_view"),
        ("V01", "field_of_view", "projection pushbroom, speed 50 m/s, line_rate 100 Hz, roll 2 deg\n  field_of_view"),
        (
            "V01",
            "field_of_view",
            "projection whiskbroom, speed 50 m/s, line_rate 100 Hz, ccd { exposure 1 ms }\n  field_of_view",
        ),
        ("V01", "field_of_view 30 deg", "projection whiskbroom, speed 50 m/s, line_rate 100 Hz, swath 30 m"),
        ("S05", "field_of_view", "ccd\n  field_of_view"),
        ("N01", "field_of_view", "ccd { pich 9.9 um }\n  field_of_view"),
        ("U03", "field_of_view 30 deg", "focal_length 50 mm, ccd { pitch 9.9 deg }"),
        ("N02", "elevation 168 m", "elevation 168 m, crs \"EPSG:3857\""),
        ("N02", "elevation 168 m", "elevation 168 m, crs \"UTM 18\""),
        ("N02", "elevation 168 m", "elevation 168 m, crs \"PROJCS[\\\"a\\\",UNIT[\\\"metre\\\",1]\""),
        ("U03", "elevation 168 m", "elevation 168 m, crs \"PROJCS[\\\"a\\\",UNIT[\\\"foot\\\",0.3048]]\""),
        ("U03", "elevation 168 m", "elevation 168 m, crs \"GEOGCS[\\\"WGS 84\\\"]\""),
        ("U05", "elevation 168 m", "elevation 168 m, crs \"EPSG:32633\""),
    ];
    let white = [
        ("white.csv", "wavelength_nm,white\n400,0.8\n1000,0.82\n"),
        ("sunglint:materials/lawn.glint", "glint 1\nmaterial lawn { ideal { diffuse 0.1 } }\n"),
        ("stone/broken.glint", "glint 1\nmaterial broken { ideal { diffuse 0.1 }\n"),
        ("stone/empty.glint", "glint 1\n"),
        ("stone/coded.glint", "glint 1\nmaterial coded code 3 { ideal }\n"),
    ];
    let mut wrong = String::new();
    for (code, from, to) in cases {
        let out = run_with(edited(from, to).as_bytes(), &white);
        if out.codes() != [*code] {
            wrong += &format!("{code} expected for {from:?} -> {to:?}, got\n{}\n", out.shown());
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// A scanner's heading is where it flies; beside what it looks at it is no second pose. What a sensor says goes before what
/// it has by `like`.
#[test]
fn a_scanner_flies_along_its_heading_whatever_it_looks_at() {
    let moving = "projection pushbroom, heading 90 deg, speed 50 m/s, line_rate 100 Hz\n  field_of_view";
    let scene = good(&edited("field_of_view", moving));
    let sensor = &scene.sensors[0];
    assert_eq!(sensor.projection, Projection::Pushbroom);
    let flight = sensor.flight.unwrap();
    assert_eq!((flight.heading, flight.speed, flight.line_rate), (FRAC_PI_2, 50.0, 100.0));
    assert!(matches!(sensor.pose, SensorPose::LookAt { .. }));
    let back = "sensor back like roof { projection pushbroom, depression 120 deg, speed 1 m/s, line_rate 2 Hz }\nmaterial grey {";
    let scene = good(&edited("material grey {", back));
    assert!(matches!(scene.sensors[0].pose, SensorPose::Attitude { depression, .. } if depression > FRAC_PI_2));
    let turned = "sensor turned like roof { heading 90 deg, depression 30 deg }\nmaterial grey {";
    let scene = good(&edited("material grey {", turned));
    assert!(matches!(scene.sensors[0].pose, SensorPose::Attitude { heading, .. } if heading == FRAC_PI_2));
}

/// East of the central meridian grid north lies east of true north: atan(tan Δλ sin φ), here Δλ = −2.674° and φ = 43.084°.
#[test]
fn a_utm_zone_brings_its_own_convergence() {
    let crs = |said: &str| good(&edited("elevation 168 m", &format!("elevation 168 m, {said}")));
    let scene = crs("crs \"EPSG:32618\"");
    assert_eq!(scene.crs, Some(Crs::Utm { zone: 18, south: false }));
    let expected = ((-2.674f64).to_radians().tan() * 43.084f64.to_radians().sin()).atan();
    assert!((scene.site.unwrap().convergence - expected).abs() < 1e-12);
    let scene = crs("crs \"epsg:32718\", convergence 1 deg");
    assert_eq!(scene.crs, Some(Crs::Utm { zone: 18, south: true }));
    assert!((scene.site.unwrap().convergence - 1f64.to_radians()).abs() < 1e-15);
    let scene = crs(r#"crs "PROJCS[\"a, b\",GEOGCS[\"x\",UNIT[\"degree\",0.0174532925199433]],UNIT[\"metre\",1]]""#);
    assert!(matches!(scene.crs, Some(Crs::Wkt(text)) if text.starts_with("PROJCS[\"a, b\"")));
    assert_eq!(scene.site.unwrap().convergence, 0.0);
}

/// Language page, section 6.
#[test]
fn messages_read_as_the_language_page_shows_them() {
    let fault = |from, to| run(&edited(from, to)).diagnostics.remove(0);
    let unitless = fault("30 deg", "30");
    assert_eq!(unitless.message, "a field of view is an angle; `30` has no unit");
    assert_eq!(unitless.label, "30 deg? (rad mrad urad arcmin arcsec)");
    let minutes = fault("23 km", "23 min");
    assert_eq!(minutes.message, "visibility is a length; `min` is a unit of time");
    assert_eq!(minutes.label, "23 km? (nm um mm cm m ft)");
    assert_eq!(fault("diffuse 0.18", "diffuse 18").label, "18 %?");
    assert_eq!(fault("600..750 nm", "0.6..0.75 nm").label, "0.6 um?");
    assert_eq!(fault("pixels 320", "pixel 320").label, "`pixels`?");
    assert_eq!(fault("diffuse 0.18", "diffuse \"whit.csv\"").message, "there is no file whit.csv");
}

#[test]
fn warnings_leave_the_scene_standing() {
    for (code, from, to) in [
        ("G01", "material grey {", "facet grey (0 0 0) (1 0 0) (2 0 0) m\nmaterial grey {"),
        ("N05", "material grey {", "define rural 3 m\nweather w { aerosol rural }\nmaterial grey {"),
    ] {
        let out = run(&edited(from, to));
        assert_eq!(out.codes(), [code], "{}", out.shown());
        assert!(out.scene.is_some() && out.diagnostics[0].severity == Severity::Warning, "{}", out.shown());
    }
}

#[test]
fn a_snapshot_is_small_unless_the_scene_says_otherwise() {
    assert_eq!(good(EXAMPLE).snapshot, Snapshot::default());
    let text = EXAMPLE.to_string()
        + "experiment haze { }\nexperiment clear { }\n\
           snapshot { pixels 32 x 24, tolerance 2 %, experiment [clear, haze] }\n";
    let Snapshot { pixels, tolerance, experiments, span } = good(&text).snapshot;
    assert_eq!((pixels, tolerance, span.is_some()), ((32, 24), 0.02, true));
    assert_eq!(experiments, ["clear", "haze"]);
    let unknown = run(&text.replace("[clear, haze]", "[claer]"));
    assert_eq!(unknown.codes(), ["N02"], "{}", unknown.shown());
}

#[test]
fn several_faults_are_reported_in_one_run() {
    let text = edited("30 deg", "30")
        .replace("visibility 23 km", "visibility 23 min")
        .replace("facet blacktop", "facet blaktop");
    let mut codes = run(&text).codes();
    codes.sort_unstable();
    assert_eq!(codes, ["N02", "U02", "U03"]);
}

#[test]
fn experiments_choose_models_as_section_4_says() {
    let text = EXAMPLE.to_string()
        + "material both { phong { diffuse 0.1, specular 0.1, exponent 20 }, ideal wet { diffuse 0.3 } }\n\
           facets both [(0 0 1) (1 0 1) (1 1 1), (2 0 1) (3 0 1) (3 1 1)] m\n\
           experiment first { }\n\
           experiment lobes { reflectance phong else ideal, reflectance wet for both }\n\
           experiment again like lobes { samples 16, weather { aod 0.2 } }\n\
           experiment other like again { weather { visibility 5 km }, reflectance phong else ideal for [both] }\n";
    let scene = good(&text);
    let models = |i: usize| scene.experiments[i].models.clone();
    assert_eq!(models(0), [Some(0), Some(0), Some(0)]);
    assert_eq!(models(1), [Some(0), Some(0), Some(1)]);
    assert_eq!(models(2), [Some(0), Some(0), Some(1)]);
    assert_eq!(models(3), [Some(0), Some(0), Some(0)]);
    assert_eq!(scene.experiments[2].accuracy, Accuracy::Samples(16));
    assert_eq!(scene.experiments[3].accuracy, Accuracy::Samples(16));
    let over = scene.experiments[3].weather.clone().unwrap();
    assert_eq!((over.visibility, over.aod), (Some(5000.0), None));
    let Shape::Facets { polygons, .. } = &scene.world[2] else { panic!("{:?}", scene.world[2]) };
    assert_eq!(polygons.len(), 2);
}

/// Weights reach a model as the models that their labels stand for, mixtures of mixtures too, in any order.
#[test]
fn a_mixture_holds_the_models_of_its_labels() {
    let text = EXAMPLE.to_string()
        + "material both {\n  blend { weights [inner 0.5, ideal 0.25] }\n  ideal { diffuse 0.3 }\n\
           blend inner { weights [ideal 1] }\n}\n\
           facet both (0 0 1) (1 0 1) (1 1 1) m\n";
    let scene = good(&text);
    let model = &scene.materials.iter().find(|material| material.name == "both").unwrap().models[0];
    let parts = model.args.mixture("weights").unwrap();
    assert_eq!(
        parts.iter().map(|part| (part.model.as_str(), part.weight)).collect::<Vec<_>>(),
        [("blend", 0.5), ("ideal", 0.25)]
    );
    let inner = parts[0].args.mixture("weights").unwrap();
    assert_eq!(
        (inner[0].model.as_str(), inner[0].args.spectral("diffuse")),
        ("ideal", Some(&SpectralValue::Constant(0.3)))
    );
}

/// A model without parameters is every material's that states its reflectance, after its own; a model taken over by `like`
/// beside a reflectance of the material's own is to be scaled.
#[test]
fn a_model_without_parameters_needs_not_be_said() {
    let text = EXAMPLE.to_string()
        + "material shining { reflectance 0.4, ideal }\n\
           material dim like shining { reflectance 0.2 }\n\
           facets shining [(0 0 1) (1 0 1) (1 1 1)] m\nfacets dim [(2 0 1) (3 0 1) (3 1 1)] m\n\
           experiment crude { reflectance matt else ideal }\n";
    let scene = good(&text);
    let of = |name: &str| scene.materials.iter().position(|material| material.name == name).unwrap();
    let chosen = |name: &str| {
        let material = &scene.materials[of(name)];
        material.models[scene.experiments[0].models[of(name)].unwrap()].clone()
    };
    assert_eq!((chosen("shining").name.as_str(), chosen("grey").name.as_str()), ("matt", "ideal"));
    assert_eq!(chosen("dim").args.spectral("reflectance"), Some(&SpectralValue::Constant(0.2)));
    let scaled = |name: &str| scene.materials[of(name)].models[0].args.switch("scaled");
    assert_eq!((scaled("shining"), scaled("dim")), (None, Some(true)));
}

/// The arguments are those of the model, defaults filled; what an experiment says of the aerosol replaces all of it.
#[test]
fn an_aerosol_is_a_model_with_a_block_of_its_own() {
    let dusty = "aerosol dust { albedo [400 nm 0.8, 1000 nm 0.95], asymmetry 0.7 }, visibility 23 km";
    let text = edited("visibility 23 km", dusty)
        + "experiment as_said { seed 2 }\n\
           experiment clear { weather { aerosol rural, aod 0.1 } }\n\
           experiment kinds { weather { aerosol sweep [rural, urban] } }\n\
           experiment sizes { weather { aerosol dust { albedo 0.9, exponent sweep [0.5, 2] } } }\n";
    let scene = good(&text);
    let aerosol = scene.weathers[0].aerosol.clone().unwrap();
    assert_eq!(aerosol.name, "dust");
    assert!(aerosol.span.is_some() && aerosol.param_spans.contains_key("albedo"));
    assert_eq!(aerosol.args.number("exponent"), Some(1.3));
    assert!(matches!(aerosol.args.spectral("albedo"), Some(SpectralValue::Curve(_))));
    let seen = |run: &str| {
        let run = scene.experiments.iter().find(|known| known.name == run).unwrap_or_else(|| panic!("{run}"));
        let over = run.weather.clone().unwrap_or_default();
        let weather = scene.weathers[0].overridden(&over);
        let aerosol = weather.aerosol.clone().unwrap();
        (aerosol.name.clone(), aerosol.args.number("exponent"), weather)
    };
    assert_eq!(seen("as_said").0, "dust");
    let (name, exponent, weather) = seen("clear");
    assert_eq!((name.as_str(), exponent, weather.visibility, weather.aod), ("rural", None, None, Some(0.1)));
    // What is gone is said nowhere any more.
    assert!(weather.spans.contains_key("aod") && !weather.spans.contains_key("visibility"));
    assert_eq!(seen("kinds/aerosol=rural").0, "rural");
    assert_eq!(seen("kinds/aerosol=urban").0, "urban");
    assert_eq!(seen("sizes/exponent=0.5").1, Some(0.5));
    assert_eq!(seen("sizes/exponent=2").1, Some(2.0));
}

#[test]
fn files_of_what_nothing_uses_stay_closed() {
    let text = EXAMPLE.to_string()
        + "material unused { reflectance \"unused.csv\", ideal }\n\
           material seen { reflectance \"white.csv\" column white extrapolate hold, ideal }\n\
           object never { mesh \"never.obj\" unit cm { map \"*\" to unused } }\n\
           object car { mesh \"car.obj\" unit cm { map \"Glass\" to seen, map \"*\" to seen } }\n\
           object pair { place car at [(0 0 0), (3 0 0)] m }\n\
           place pair as cars at (9 14 0) m heading 65 deg\n\
           place pair grid 3 x 2 spacing (10 20) m at (100 0 0) m\n";
    let files = [("white.csv", "wavelength_nm,white\n400,0.8\n1000,0.82\n"), ("car.obj", "o car\n")];
    let out = run_with(text.as_bytes(), &files);
    assert!(out.diagnostics.is_empty(), "{}", out.shown());
    assert_eq!(out.opened, ["car.obj", "white.csv"]);
    let scene = out.scene.unwrap();
    let used: Vec<bool> = scene.materials.iter().map(|material| material.used).collect();
    assert_eq!(used, [true, true, false, true]);
    assert!(scene.materials[2].models.is_empty() && scene.objects[0].shapes.is_empty());
    assert!(matches!(scene.materials[3].models[0].args.spectral("reflectance"), Some(SpectralValue::Curve(_))));
    let Shape::Mesh { file, unit, .. } = &scene.objects[1].shapes[0] else { panic!() };
    assert_eq!((&file.bytes[..], *unit), (&b"o car\n"[..], 0.01));
    let Shape::Place { poses, .. } = &scene.world[3] else { panic!("{:?}", scene.world) };
    assert_eq!(
        poses.iter().map(|pose| pose.at.truncate().to_array()).collect::<Vec<_>>(),
        [[100.0, 0.0], [110.0, 0.0], [120.0, 0.0], [100.0, 20.0], [110.0, 20.0], [120.0, 20.0],]
    );
}

#[test]
fn like_takes_over_and_what_is_said_again_replaces() {
    let text = EXAMPLE.to_string()
        + "material dark like grey { ideal { diffuse 0.05 } }\n\
           material twin code 3 like dark\n\
           facet twin (0 0 1) (1 0 1) (1 1 1) m\n\
           facet dark (0 0 2) (1 0 2) (1 1 2) m\n\
           sensor plane like roof { look_at (0 0 0) m, altitude 1200 m, view_zenith 20 deg, view_azimuth 90 deg, band nir 760..900 nm }\n\
           sensor down like roof { heading 90 deg, ifov 1 mrad, band red 640..660 nm }\n";
    let scene = good(&text);
    assert_eq!(scene.materials[3].code, 3);
    for material in &scene.materials[2..] {
        assert_eq!(material.models[0].args.spectral("diffuse"), Some(&SpectralValue::Constant(0.05)));
    }
    assert!(
        matches!(scene.sensors[1].pose, SensorPose::Target { altitude: 1200.0, .. }),
        "{:?}",
        scene.sensors[1].pose
    );
    assert_eq!(scene.sensors[1].bands.len(), 2);
    assert!(matches!(scene.sensors[2].pose, SensorPose::Attitude { .. }));
    assert!(matches!(scene.sensors[2].optics, Optics::Ifov(_)));
    assert!(matches!(&scene.sensors[2].bands[..], [Bands::Edges { lower, .. }] if *lower == 0.64));
}

#[test]
fn constants_stand_for_values_and_poses_may_stand_in_braces() {
    let scene = good(
        r#"glint 1
define wide 30 deg
define here (0 0 5) m
define tone [400 nm 0.1, 900 nm 0.3]
define both [noon, dusk]
define eyes cam
site { latitude 10 deg, longitude 20 deg }
collect noon { on 1992-06-18 from sunrise +30 min to 12:30 every 15 min, zone +05:30 }
collect dusk { sun zenith 80 deg azimuth 270 deg }
collect dark { sun none }
material grey { reflectance tone, split { table [blue 0 deg 0.1 0.2, blue 60 deg 0.1 0.3], solid_angle 2 msr } }
ground grey height 2 m
box grey {
  size (1 2 3) m
  at (5 6) m
  heading 30 deg
}
panel grey size (1 1) m at here slope 10 deg aspect 180 deg
sensor cam {
  projection orthographic
  position here
  heading wide
  swath 20 m
  pixels 10 x 10
  bands 400..900 nm every 5 nm fwhm 6 nm
  band b centre 450 nm fwhm 20 nm
}
experiment one { algorithm split { depth unlimited, adjacency on }, sensor eyes, collect both, error 0.5 % floor 2 W/m2/sr/um over image, seed 18446744073709551615 }
"#,
    );
    let Shape::Box { pose, .. } = scene.world[0] else { panic!("{:?}", scene.world) };
    assert_eq!((pose.at, pose.on_surface), (DVec3::new(5.0, 6.0, 0.0), true));
    assert!((pose.heading - 30f64.to_radians()).abs() < 1e-15);
    let split = &scene.materials[0].models[0].args;
    let table = split.table("table").unwrap();
    assert_eq!(table.key, TableKey::Band(vec!["blue".into(), "blue".into()]));
    assert!((table.rows[1][0] - 60f64.to_radians()).abs() < 1e-15 && table.rows[1][1..] == [0.1, 0.3]);
    assert_eq!(split.number("solid_angle"), Some(0.002));
    assert!(matches!(split.spectral("reflectance"), Some(SpectralValue::Curve(curve)) if curve.domain() == (0.4, 0.9)));
    assert!(matches!(scene.collects[0].times, Times::Series { every: Some(900.0), zone: 19_800.0, .. }));
    let experiment = &scene.experiments[0];
    assert_eq!((&experiment.collects, experiment.seed), (&vec![0, 1], u64::MAX));
    assert_eq!(experiment.accuracy, Accuracy::Error { relative: 0.005, floor: Some(2.0), every_pixel: false });
    assert_eq!(
        (experiment.algorithm.args.word("depth"), experiment.algorithm.args.switch("adjacency")),
        (Some("unlimited"), Some(true))
    );
}

/// A fault in an included table points into the table.
#[test]
fn a_malformed_table_is_shown_with_its_line() {
    let files = [("white.csv", "wavelength_nm,white\n400,0.8\n500,many\n")];
    let out = run_with(edited("diffuse 0.18", "diffuse \"white.csv\"").as_bytes(), &files);
    assert_eq!(out.codes(), ["F01"], "{}", out.shown());
    let fault = &out.diagnostics[0];
    assert!(fault.message.contains("white.csv:3"), "{}", fault.message);
    assert_eq!(out.sources.text(fault.notes[0].0), "500,many");
}

/// DESIGN section 10: no input makes the program panic. Bytes of scenes are overwritten, deleted, doubled and spliced.
#[test]
fn no_mutation_of_a_scene_makes_the_checker_panic() {
    let bad = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/bad");
    let mut texts = vec![EXAMPLE.as_bytes().to_vec()];
    for entry in std::fs::read_dir(&bad).into_iter().flatten().flatten() {
        texts.extend(std::fs::read(entry.path()));
    }
    texts.sort();
    let mut state = 0x9E37_79B9_7F4A_7C15u64;
    let mut random = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as usize % below.max(1)
    };
    let words: [&[u8]; 14] = [
        b"}",
        b"{",
        b"[",
        b"]",
        b"(0 0 0) m",
        b" like grey ",
        b"-1e300",
        b" at ",
        b" sweep ",
        b"\n",
        b"\"",
        b" 5 %",
        b" 9 x 9 ",
        b",",
    ];
    for round in 0..20_000 {
        let mut text = texts[round % texts.len()].clone();
        for _ in 0..1 + random(4) {
            let at = random(text.len());
            match random(5) {
                0 if !text.is_empty() => text[at] = random(256) as u8,
                1 => drop(text.drain(at..(at + random(12)).min(text.len()))),
                2 => drop(text.splice(at..at, words[random(words.len())].iter().copied())),
                3 => {
                    let from = random(text.len());
                    let piece = text[from..(from + random(60)).min(text.len())].to_vec();
                    drop(text.splice(at..at, piece));
                }
                _ => {
                    let other = &texts[random(texts.len())];
                    let from = random(other.len());
                    let piece = other[from..(from + random(80)).min(other.len())].to_vec();
                    drop(text.splice(at..(at + random(20)).min(text.len()), piece));
                }
            }
        }
        let out = run_with(&text, &[("white.csv", "wavelength_nm,white\n400,0.8\n1000,0.82\n")]);
        let failed = out.diagnostics.iter().any(|fault| fault.severity == Severity::Error);
        assert_eq!(out.scene.is_none(), failed);
    }
}

/// The example with panels whose tone and height are constants.
fn study(experiments: &str) -> String {
    edited("panel grey size (2 1.4) m at (0 5 0.7) m facing roof", "panel grey size (2 1.4) m at here facing roof")
        .replace("diffuse 0.18", "diffuse tone")
        .replace("position (0 -25 15) m", "position aloft")
        + "define tone 0.18\ndefine here (0 5 0.7) m\ndefine aloft (0 -25 15) m\n"
        + experiments
}

fn names(scene: &Scene) -> Vec<String> {
    scene.runs().iter().map(|(_, run)| run.name.clone()).collect()
}

/// Language page, section 4: one run an item, several sweeps multiply, the last of the block varies fastest.
#[test]
fn sweeps_multiply_in_the_order_of_the_block() {
    let scene = good(
        &(EXAMPLE.to_string()
            + "experiment haze { algorithm sweep [split, ideal], weather { visibility sweep [5, 10, 23] km }, seed 3 }\n\
               experiment clear { }\n\
               experiment few { samples sweep [16, 64], weather { humidity sweep [10, 60] % } }\n"),
    );
    assert_eq!(
        names(&scene),
        [
            "haze/algorithm=split,visibility=5km",
            "haze/algorithm=split,visibility=10km",
            "haze/algorithm=split,visibility=23km",
            "haze/algorithm=ideal,visibility=5km",
            "haze/algorithm=ideal,visibility=10km",
            "haze/algorithm=ideal,visibility=23km",
            "clear",
            "few/samples=16,humidity=10%",
            "few/samples=16,humidity=60%",
            "few/samples=64,humidity=10%",
            "few/samples=64,humidity=60%",
        ]
    );
    assert!(scene.variants.is_empty());
    let run = &scene.experiments[4];
    assert_eq!((run.algorithm.name.as_str(), run.base.as_str(), run.seed), ("ideal", "haze", 3));
    assert_eq!(run.weather.as_ref().unwrap().visibility, Some(10_000.0));
    assert_eq!(run.sweep, [("algorithm".into(), "ideal".into()), ("visibility".into(), "10km".into())]);
    assert_eq!(scene.experiments[9].accuracy, Accuracy::Samples(64));
}

/// `exact like haze` runs all of haze's sweeps, unless it says the field again or says what excludes it.
#[test]
fn a_child_inherits_sweeps_that_it_does_not_say_again() {
    let scene = good(
        &(EXAMPLE.to_string()
            + "experiment haze { seed sweep [1, 2], weather { visibility sweep [5, 10] km, humidity 60 % } }\n\
               experiment exact like haze { error 0.2 % }\n\
               experiment one like haze { seed 7 }\n\
               experiment dusty like haze { weather { aod 0.3 } }\n\
               experiment wide like one { weather { visibility sweep [40, 80] km } }\n"),
    );
    let of = |base: &str| -> Vec<String> {
        names(&scene).into_iter().filter_map(|name| Some(name.strip_prefix(base)?.to_string())).collect()
    };
    assert_eq!(
        of("exact/"),
        ["seed=1,visibility=5km", "seed=1,visibility=10km", "seed=2,visibility=5km", "seed=2,visibility=10km"]
    );
    assert_eq!(of("one/"), ["visibility=5km", "visibility=10km"]);
    assert_eq!(of("dusty/"), ["seed=1", "seed=2"]);
    assert_eq!(of("wide/"), ["visibility=40km", "visibility=80km"]);
    let dusty = scene.experiments.iter().find(|run| run.base == "dusty").unwrap().weather.clone().unwrap();
    assert_eq!((dusty.visibility, dusty.aod, dusty.humidity), (None, Some(0.3), Some(0.6)));
}

/// A sweep of materials' models, of sensors and behind `else`; names say what varies, values are safe in a folder.
#[test]
fn names_of_runs_are_safe_in_folders() {
    let text = EXAMPLE.to_string()
        + "sensor plane like roof { look_at (0 0 0) m, altitude 1200 m, view_zenith 20 deg, view_azimuth 90 deg }\n\
           define far 40 km\n\
           define spot (0 0 0) m\n\
           experiment a { sensor sweep [roof, plane], weather { visibility sweep [far, 5 km] } }\n\
           experiment b { define spot sweep [(0 0 1), (0 0 2)] m, error 1 % floor sweep [1, 2] W/m2/sr/um }\n";
    let scene = good(&text);
    assert_eq!(
        names(&scene),
        [
            "a/sensor=roof,visibility=far",
            "a/sensor=roof,visibility=5km",
            "a/sensor=plane,visibility=far",
            "a/sensor=plane,visibility=5km",
            "b/spot=0_0_1m,floor=1Wperm2persrperum",
            "b/spot=0_0_1m,floor=2Wperm2persrperum",
            "b/spot=0_0_2m,floor=1Wperm2persrperum",
            "b/spot=0_0_2m,floor=2Wperm2persrperum",
        ]
    );
}

/// One scene for each set of constants, shared by all runs that see it; the order of the runs is that of the text.
#[test]
fn a_constant_of_an_experiment_changes_its_scene_alone() {
    let scene = good(&study(
        "experiment dark { define tone 0.05 }\n\
         experiment own { }\n\
         experiment same { define tone 0.18 }\n\
         experiment high like dark { define aloft sweep [(0 -25 15), (0 -25 90)] m }\n",
    ));
    assert_eq!(names(&scene), ["dark", "own", "same", "high/aloft=0_-25_15m", "high/aloft=0_-25_90m"]);
    assert_eq!(scene.experiments.iter().map(|run| run.name.as_str()).collect::<Vec<_>>(), ["own", "same"]);
    let of = |scene: &Scene| {
        let diffuse = scene.materials[1].models[0].args.spectral("diffuse").cloned();
        let SensorPose::LookAt { position, .. } = scene.sensors[0].pose else { panic!("{:?}", scene.sensors[0].pose) };
        (diffuse, position.z)
    };
    let tone = |value| Some(SpectralValue::Constant(value));
    assert_eq!(of(&scene), (tone(0.18), 15.0));
    // dark and the first of high see the same set.
    assert_eq!(scene.variants.len(), 2);
    assert_eq!((of(&scene.variants[0]), scene.variants[0].experiments.len()), ((tone(0.05), 15.0), 2));
    assert_eq!((of(&scene.variants[1]), scene.variants[1].experiments.len()), ((tone(0.05), 90.0), 1));
    let high = &scene.variants[1].experiments[0];
    let constants: Vec<(&str, &str)> = high.constants.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
    assert_eq!(constants, [("tone", "0.05"), ("aloft", "(0 -25 90) m")]);
}

/// A fault that only an experiment's constants bring names the place of use, and notes the definition.
#[test]
fn a_constant_that_fits_in_the_scene_may_not_fit_in_an_experiment() {
    let out = run(&study("experiment dark { define tone sweep [0.05, 1.5] }\n"));
    assert_eq!(out.codes(), ["U05"], "{}", out.shown());
    let fault = &out.diagnostics[0];
    assert_eq!(out.sources.text(fault.span.unwrap()), "tone");
    assert_eq!(out.sources.text(fault.notes[0].0), "1.5");
    let out = run(&study("experiment low { define aloft (0 3 0) m }\n"));
    assert_eq!(out.codes(), ["V02"], "{}", out.shown());
    let last = out.diagnostics[0].notes.last().unwrap().0;
    assert_eq!(out.sources.text(last), "define aloft (0 3 0) m");
}

/// Sweeps multiply fast: many runs are asked about, too many are refused before they take memory.
#[test]
fn too_many_runs_are_refused() {
    let list = |n: usize| (0..n).map(|i| i.to_string()).collect::<Vec<_>>().join(", ");
    let text = |n: usize| {
        let values = list(n);
        EXAMPLE.to_string()
            + &format!("experiment a {{ seed sweep [{values}], weather {{ visibility sweep [{values}] km }} }}\n")
    };
    // 0 km is no visibility, so that the lists here begin at 1.
    let text = |n: usize| text(n).replace("[0, ", "[");
    let some = run(&text(34));
    assert_eq!((some.codes(), some.scene.map(|scene| scene.experiments.len())), (vec!["X02"], Some(33 * 33)));
    let many = run(&text(2000));
    assert_eq!((many.codes(), many.diagnostics[0].severity), (vec!["X02"], Severity::Error), "{}", many.shown());
}

#[test]
fn time_is_an_accuracy() {
    let scene = good(&(EXAMPLE.to_string() + "experiment a { time 2 min }\n"));
    assert_eq!(scene.experiments[0].accuracy, Accuracy::Time { seconds: 120.0 });
}

/// Folders in their order, then the shipped one; relative files count from the file of the database.
#[test]
fn materials_come_from_databases() {
    let files = [
        (
            "mine/lawn.glint",
            "glint 1\nmaterial lawn { title \"mine\", source \"me\", licence \"CC0\", ideal { diffuse 0.3 } }\n",
        ),
        ("theirs/lawn.glint", "glint 1\nmaterial lawn { ideal { diffuse 0.4 } }\n"),
        ("theirs/moss.glint", "glint 1\nmaterial moss like peat { title \"moss\" }\n"),
        ("sunglint:materials/peat.glint", "glint 1\nmaterial peat { ideal { diffuse 0.05 } }\n"),
    ];
    let text = EXAMPLE.to_string()
        + "database \"mine\"\ndatabase \"theirs\"\n\
           material lawn code 9\nmaterial moss\nmaterial dry like peat { title \"dry\" }\n\
           facet lawn (0 0 1) (1 0 1) (1 1 1) m\nfacet moss (0 0 2) (1 0 2) (1 1 2) m\nfacet dry (0 0 3) (1 0 3) (1 1 3) m\n";
    let out = run_with(text.as_bytes(), &files);
    assert!(out.diagnostics.is_empty(), "{}", out.shown());
    let scene = out.scene.unwrap();
    assert_eq!(scene.materials.len(), 5, "what others are only like is no material of the scene");
    let of = |i: usize| {
        let material = &scene.materials[i];
        (material.name.as_str(), material.title.as_deref(), material.models[0].args.spectral("diffuse").cloned())
    };
    let tone = |value| Some(SpectralValue::Constant(value));
    assert_eq!(of(2), ("lawn", Some("mine"), tone(0.3)));
    assert_eq!(of(3), ("moss", Some("moss"), tone(0.05)));
    assert_eq!(of(4), ("dry", Some("dry"), tone(0.05)));
    assert_eq!((scene.materials[2].code, scene.materials[2].licence.as_deref()), (9, Some("CC0")));
    let circle = [("mine/a.glint", "glint 1\nmaterial a like b\n"), ("mine/b.glint", "glint 1\nmaterial b like a\n")];
    let out = run_with((EXAMPLE.to_string() + "database \"mine\"\nmaterial c like a\n").as_bytes(), &circle);
    assert_eq!(out.codes(), ["N04"], "{}", out.shown());
}

/// Facets in one list, in a line each, and in lists of one: the same polygons, and the same findings at the same places.
#[test]
fn packed_facets_mean_what_single_ones_do() {
    let rows = [
        "(0 0 0) (1 0 0) (1 1 0)",
        "(0 0 0) (100 0 0) (100 100 0) (0 100 0) cm",
        "(0 0 0) (0 0 0) (2 0 0) (2 2 0) (0 0 0)",
        "(0 0 0) (1 0 0) (2 0 0)",
        "(0 0 0) (1 0 0) (1 1 0.5) (0 1 0)",
        "(0 0 0) (1 1 0) (1 0 0) (0 1 0)",
        "(0 0 0) (1 0 0)",
        "(0 0 0) (1 0 2e9) (1 1 0)",
        "(0 0 0) (1 0 0) (1 1 0) deg",
        "(0 0 0) (1 0 0) # not the end\n (1 1 0)",
    ];
    let told = |text: &str| -> Vec<(String, String)> {
        let out = run(&(EXAMPLE.to_string() + text));
        let place = |fault: &Diagnostic| fault.span.map_or(String::new(), |span| out.sources.text(span).to_string());
        let mut all: Vec<_> =
            out.diagnostics.iter().map(|fault| (format!("{} {}", fault.code, fault.message), place(fault))).collect();
        all.sort();
        all
    };
    let lines = |rows: &[&str], apart: &str| -> String {
        let unit = |row: &str| if row.ends_with(')') { " m" } else { "" };
        rows.iter().map(|row| format!("facet grey {row}{}\n{apart}", unit(row))).collect()
    };
    // A statement of another key between them keeps them apart.
    let single = told(&lines(&rows, "box grey size (1 1 1) m\n"));
    assert_eq!(told(&lines(&rows, "")), single);
    assert_eq!(single.iter().filter(|(code, _)| code.starts_with('G')).count(), 4, "{single:#?}");
    let listed = told(&format!("facets grey [\n{}\n] m\n", rows[..9].join("\n")));
    let whole: Vec<String> = single.iter().map(|(message, _)| message.clone()).collect();
    assert_eq!(listed.iter().map(|(message, _)| message.clone()).collect::<Vec<_>>(), whole);
    // Where the material is unknown, or stands for another, each line is told of, or read, for itself.
    let unknown = lines(&rows[..2], "").replace("grey", "gray");
    assert_eq!(run(&(EXAMPLE.to_string() + &unknown)).codes(), ["N02", "N02"]);
    let scene = good(&(EXAMPLE.to_string() + "define wall grey\n" + &lines(&rows[..3], "").replace("grey", "wall")));
    assert_eq!(scene.world.len(), 5);
    let packed = good(&(EXAMPLE.to_string() + &lines(&rows[..3], "")));
    let polygons = |shape: &Shape| -> Vec<Vec<DVec3>> {
        let Shape::Facets { polygons, .. } = shape else { panic!("{shape:?}") };
        polygons.iter().map(|(corners, _)| corners.to_vec()).collect()
    };
    let apart: Vec<_> = scene.world[2..].iter().flat_map(polygons).collect();
    assert_eq!((packed.world.len(), polygons(&packed.world[2])), (3, apart));
}

/// 10⁶ corners of one polygon are refused without pairing its edges, and 10⁵ faulty facets are not all listed.
#[test]
fn excess_is_refused_quickly_and_briefly() {
    let corners: String = (0..1_000_000).map(|i| format!("({i} {} 0)", i % 7)).collect();
    for text in [format!("facet grey {corners} m\n"), format!("facets grey [{corners}] m\n")] {
        let out = run(&(EXAMPLE.to_string() + &text));
        assert_eq!(out.codes(), ["G05"]);
    }
    let bent = "(0 0 0) (1 0 0) (1 1 0.5) (0 1 0)\n".repeat(100_000);
    let out = run(&(EXAMPLE.to_string() + "facets grey [\n" + &bent + "] m\n"));
    assert!(out.codes().iter().all(|code| *code == "G02") && out.diagnostics.len() == 500, "{}", out.diagnostics.len());
    let flat = "facet grey (0 0 0) (1 0 0) (2 0 0) m\n".repeat(100_000);
    let out = run(&(EXAMPLE.to_string() + &flat));
    assert!(out.scene.is_some() && out.diagnostics.len() == 100, "{}", out.diagnostics.len());
}
