//! Texts against a small catalogue: the scene they mean, and the one code that each fault has.

use std::collections::BTreeMap;

use glam::DVec3;
use sunglint_dsl::scene::{Accuracy, Bands, Facing, Optics, SensorPose, Shape, Times};
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

fn catalog() -> Catalog {
    let mut catalog = Catalog::default();
    let mut add = |role, name, params| catalog.add(role, ModelInfo { name, summary: "", manual: "", params });
    add(Role::Reflectance, "ideal", IDEAL);
    add(Role::Reflectance, "split", SPLIT);
    add(Role::Reflectance, "phong", PHONG);
    add(Role::Atmosphere, "none", &[]);
    add(Role::Atmosphere, "spectrl2", &[]);
    add(Role::Atmosphere, "table", const { &[Param::file("file", Default::Required, "the table")] });
    add(
        Role::Algorithm,
        "ideal",
        const { &[Param::word("reading", &["published", "corrected"], Default::Word("published"), "")] },
    );
    add(Role::Algorithm, "split", APPROXIMATIONS);
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
    assert_eq!(polygons[0].0[2], DVec3::new(20.0, 20.0, 0.0));
    assert_eq!((size.x, size.y, *facing, pose.at), (2.0, 1.4, Facing::Sensor(0), DVec3::new(0.0, 5.0, 0.7)));
    let sensor = &scene.sensors[0];
    assert_eq!(sensor.pixels, (320, 240));
    assert!(matches!(sensor.pose, SensorPose::LookAt { position, .. } if position == DVec3::new(0.0, -25.0, 15.0)));
    assert!(matches!(sensor.optics, Optics::FieldOfView(angle) if (angle - 30f64.to_radians()).abs() < 1e-15));
    assert!(matches!(sensor.bands[0], Bands::Edges { lower, upper, .. } if lower == 0.6 && upper == 0.75));
    let experiment = &scene.experiments[0];
    assert_eq!((experiment.name.as_str(), experiment.algorithm.name.as_str()), ("default", "split"));
    assert_eq!((scene.atmosphere.name.as_str(), &experiment.models), ("spectrl2", &vec![Some(0), Some(0)]));
    assert_eq!(experiment.accuracy, Accuracy::Error { relative: 0.01, floor: None });
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
        ("X03", "material grey {", "experiment a { algorithm ideal { sky directional } }\nmaterial grey {"),
        ("X03", "material grey {", "experiment a { samples 64, time 60 s }\nmaterial grey {"),
        // files
        ("F01", "diffuse 0.18", "diffuse \"whit.csv\""),
        ("F01", "visibility 23 km", "radiosonde \"buf_12z.csv\""),
        ("F02", "visibility 23 km", "observations \"white.csv\""),
        ("A01", "visibility 23 km", "cloud { optical_depth 1, base 2 km, top 1 km }"),
        ("N01", "visibility 23 km", "aerosol rural { wet on }"),
        ("F02", "diffuse 0.18", "diffuse \"white.csv\" column nowhere"),
        // later versions
        ("L01", "material grey {", "atmosphere layered { streams 16 }\nmaterial grey {"),
        ("L01", "material grey {", "experiment a { algorithm full }\nmaterial grey {"),
        ("L01", "material grey {", "experiment a { reflectance rpv else ideal }\nmaterial grey {"),
        ("L01", "material grey {", "experiment a { time 60 s }\nmaterial grey {"),
        ("L01", "material grey {", "experiment a { weather { visibility sweep [5, 10] km } }\nmaterial grey {"),
        ("L01", "ideal { diffuse 0.18 }", "rpv { rho0 0.1 }"),
        ("L01", "material grey {", "sphere grey radius 1 m\nmaterial grey {"),
        ("L01", "material grey {", "material asphalt_road_old\nmaterial grey {"),
        ("L01", "material grey {", "plugin \"foam\"\nmaterial grey {"),
        ("L01", "field_of_view", "projection pushbroom\n  field_of_view"),
    ];
    let white = [("white.csv", "wavelength_nm,white\n400,0.8\n1000,0.82\n")];
    let mut wrong = String::new();
    for (code, from, to) in cases {
        let out = run_with(edited(from, to).as_bytes(), &white);
        if out.codes() != [*code] {
            wrong += &format!("{code} expected for {from:?} -> {to:?}, got\n{}\n", out.shown());
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
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
        ("L01", "field_of_view", "ccd { pitch 9.9 um }\n  field_of_view"),
        ("L01", "material grey {", "snapshot { pixels 32 x 24 }\nmaterial grey {"),
        ("L01", "material grey {", "experiment a { products [radiance, counts] }\nmaterial grey {"),
        ("G01", "material grey {", "facet grey (0 0 0) (1 0 0) (2 0 0) m\nmaterial grey {"),
        ("N05", "material grey {", "define rural 3 m\nweather w { aerosol rural }\nmaterial grey {"),
    ] {
        let out = run(&edited(from, to));
        assert_eq!(out.codes(), [code], "{}", out.shown());
        assert!(out.scene.is_some() && out.diagnostics[0].severity == Severity::Warning, "{}", out.shown());
    }
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
experiment one { algorithm split { depth unlimited, adjacency on }, sensor eyes, collect both, error 0.5 % floor 2 W/m2/sr/um, seed 18446744073709551615 }
"#,
    );
    let Shape::Box { pose, .. } = scene.world[0] else { panic!("{:?}", scene.world) };
    assert_eq!(pose.at, DVec3::new(5.0, 6.0, 2.0));
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
    assert_eq!(experiment.accuracy, Accuracy::Error { relative: 0.005, floor: Some(2.0) });
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
