//! The commands that show one quantity at a time, and their plots, as a user runs them.

mod program;

use std::f64::consts::PI;
use std::path::Path;

use program::{json, number, refusal, stdout, text};
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("{value} is no array")).iter().map(number).collect()
}

/// The same number but for the rounding of one who reads its decimals.
fn assert_same(a: f64, b: f64) {
    assert!((a - b).abs() <= 2.0 * f64::EPSILON * b.abs(), "{a} {b}");
}

/// A scene without air, or with an air of one's choice, whose materials answer in closed form.
fn bench(folder: &Path, atmosphere: &str) -> String {
    let path = folder.join("bench.glint");
    let scene = format!(
        "glint 1
site {{ latitude 43 deg, longitude -77 deg }}
collect {{ at 1992-06-18 12:00 -04:00 }}
atmosphere {atmosphere}
material grey {{ ideal {{ diffuse 0.18 }} }}
material tinted {{ ideal {{ diffuse [400 nm 0.1, 1000 nm 0.7] }} }}
material banded {{ ideal {{ diffuse [red 0.3, nir 0.5] }} }}
material mirror {{ ideal {{ specular 0.85 }} }}
material glossy {{ ideal {{ diffuse 0.2 }}, phong shiny {{ diffuse 0.2, specular 0.3, exponent 50 }} }}
material spare {{ ideal {{ diffuse 0.4 }} }}
facet grey (-20 -20 0) (20 -20 0) (20 20 0) (-20 20 0) m
panel tinted size (1 1) m at (0 0 1) m
panel banded size (1 1) m at (2 0 1) m
panel mirror size (1 1) m at (4 0 1) m
panel glossy size (1 1) m at (6 0 1) m
sensor roof {{
  position (0 -25 15) m, look_at (0 -10 0) m, field_of_view 10 deg, pixels 8 x 6
  band red 600..700 nm, band nir 800..900 nm
}}
"
    );
    std::fs::write(&path, scene).expect("a scene");
    text(&path).to_string()
}

/// No air: τ₁ = τ₂ = 1 and L_u = 0 at every wavelength, L_d = L₀ in every direction and E_d = π L₀.
#[test]
fn without_air_nothing_is_lost_and_the_sky_is_uniform() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "none { solar_irradiance 1500 W/m2/um, sky_radiance 7 W/m2/sr/um }");
    let directions = folder.path().join("sky.csv");
    std::fs::write(&directions, "zenith_deg,azimuth_deg\n0,0\n60,135\n89,350.5\n").expect("a table");
    let found = json(&["atmosphere", &scene, "--directions", text(&directions), "--json"]);
    let wavelengths = numbers(&found["wavelength_um"]);
    assert!(wavelengths.len() > 40 && wavelengths.windows(2).all(|w| w[0] < w[1]));
    let n = wavelengths.len();
    assert_eq!(numbers(&found["sun_transmittance"]), vec![1.0; n]);
    // 18 June: the Earth is 1.016 au from the sun.
    assert!(
        numbers(&found["solar_irradiance_w_m2_um"]).iter().all(|e| (e * 1.016 * 1.016 / 1500.0 - 1.0).abs() < 1e-3)
    );
    assert!(numbers(&found["diffuse_irradiance_w_m2_um"]).iter().all(|e| (e - 7.0 * PI).abs() < 1e-12));
    let sky = found["sky"].as_array().expect("directions");
    let angles: Vec<(f64, f64)> =
        sky.iter().map(|row| (number(&row["zenith_deg"]), number(&row["azimuth_deg"]))).collect();
    assert_eq!(angles, [(0.0, 0.0), (60.0, 135.0), (89.0, 350.5)]);
    for row in sky {
        assert_eq!(numbers(&row["radiance_w_m2_sr_um"]), vec![7.0; n]);
    }
    let path = &found["path"][0];
    assert_eq!(path["sensor"], "roof");
    assert_eq!(numbers(&path["transmittance"]), vec![1.0; n]);
    assert_eq!(numbers(&path["radiance_w_m2_sr_um"]), vec![0.0; n]);
    // From (0, −10, 0) up to (0, −25, 15): 45° from the zenith, towards the south.
    assert!((number(&path["view_zenith_deg"]) - 45.0).abs() < 1e-6);
    let beside = (number(&found["sun_azimuth_deg"]) - 180.0).abs();
    assert!((number(&path["relative_azimuth_deg"]) - beside).abs() < 1e-6);
    let bands = found["bands"].as_array().expect("bands");
    assert_eq!(bands.iter().map(|band| band["name"].as_str()).collect::<Vec<_>>(), [Some("red"), Some("nir")]);
    for band in bands {
        assert!((number(&band["sun_transmittance"]) - 1.0).abs() < 1e-12);
        assert!((number(&band["sky"][1]["radiance_w_m2_sr_um"]) - 7.0).abs() < 1e-12);
        assert!((number(&band["path"][0]["transmittance"]) - 1.0).abs() < 1e-12);
    }
}

/// A band's τ₁ is ⟨E_s τ₁⟩/⟨E_s⟩: the same as from the spectra that the command prints, to the rounding of their sums.
#[test]
fn a_bands_transmittance_is_that_of_sunlight() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "spectrl2");
    let csv = folder.path().join("air.csv");
    let found = json(&["atmosphere", &scene, "--csv", text(&csv), "--json"]);
    let (wavelength, e, tau) = (
        numbers(&found["wavelength_um"]),
        numbers(&found["solar_irradiance_w_m2_um"]),
        numbers(&found["sun_transmittance"]),
    );
    // The two Gauss nodes of a bin lie width/√3 apart, and weigh alike.
    let red: Vec<usize> = (0..wavelength.len()).filter(|i| wavelength[*i] < 0.75).collect();
    let (mut products, mut sum) = (0.0, 0.0);
    for pair in red.chunks(2) {
        let width = (wavelength[pair[1]] - wavelength[pair[0]]) * 3f64.sqrt();
        pair.iter().for_each(|i| (products, sum) = (products + width * e[*i] * tau[*i], sum + width * e[*i]));
    }
    assert!((number(&found["bands"][0]["sun_transmittance"]) / (products / sum) - 1.0).abs() < 1e-9);
    // What was written as CSV is what was printed as JSON, to what reading decimals rounds.
    let table = std::fs::read_to_string(&csv).expect("a table");
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    assert_eq!(header[..3], ["wavelength_um", "solar_irradiance_w_m2_um", "sun_transmittance"]);
    assert!(header.contains(&"path_radiance_roof_w_m2_sr_um"), "{header:?}");
    for (i, line) in lines.enumerate() {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        for (a, b) in [(cells[0], wavelength[i]), (cells[1], e[i]), (cells[2], tau[i])] {
            assert_same(a, b);
        }
    }
}

/// An instant that the scene does not collect takes the place of its times.
#[test]
fn the_air_of_any_instant_can_be_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "none");
    let found = json(&["atmosphere", &scene, "--at", "1992-12-21T17:00:00Z", "--json"]);
    assert_eq!(found["time_utc"], "1992-12-21T17:00:00Z");
    // Winter solstice near local noon at 43° north: 43 + 23.44 deg from the zenith.
    assert!((number(&found["sun_apparent_zenith_deg"]) - 66.4).abs() < 0.2);
    let told = refusal(&["atmosphere", &scene, "--at", "noon"]);
    assert!(told.contains("`noon` is no instant"), "{told}");
}

/// A Lambertian surface: f = ρ/π whatever the angles; its curve is read at the wavelength itself.
#[test]
fn a_lambertian_brdf_is_rho_over_pi() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "none");
    let angles = folder.path().join("angles.csv");
    std::fs::write(
        &angles,
        "incident_zenith_deg,view_zenith_deg,relative_azimuth_deg\n0,0,0\n30,60,180\n75,12.5,-90\n",
    )
    .expect("a table");
    let args = ["reflectance", &scene, "tinted", "--geometry", text(&angles), "--wavelength", "0.55,0.4,1.0"];
    let found = json(&[&args[..], &["--json"]].concat());
    let rows = found["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 9);
    let keys = ["incident_zenith_deg", "view_zenith_deg", "relative_azimuth_deg", "wavelength_um"];
    assert_eq!(keys.map(|key| number(&rows[3][key])), [30.0, 60.0, 180.0, 0.55]);
    for row in rows {
        // The line from 0.1 at 0.4 µm to 0.7 at 1 µm; at its ends the bin of 0.02 nm lies to one side.
        let rho = 0.1 + (number(&row["wavelength_um"]) - 0.4);
        assert!((number(&row["brdf_per_sr"]) * PI - rho).abs() < 1.1e-5, "{row}");
        assert!((number(&row["diffuse"]) - rho).abs() < 1.1e-5 && number(&row["specular"]) == 0.0, "{row}");
    }
    // The CSV holds the same numbers.
    let table = stdout(&[&args[..], &["--csv"]].concat());
    let mut lines = table.lines();
    assert_eq!(
        lines.next(),
        Some("incident_zenith_deg,view_zenith_deg,relative_azimuth_deg,wavelength_um,brdf_per_sr,diffuse,specular")
    );
    for (line, row) in lines.zip(rows) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        assert_same(cells[3], number(&row["wavelength_um"]));
        assert_same(cells[4], number(&row["brdf_per_sr"]));
    }
}

/// A mirror has no finite BRDF: 0 stands for its smooth lobes, `specular` has its reflectance, and the table says so.
#[test]
fn a_mirror_says_that_it_has_no_brdf() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "none");
    let found = json(&["reflectance", &scene, "mirror", "--json"]);
    assert_eq!(found["has_mirror_lobe"], true);
    let rows = found["rows"].as_array().expect("rows");
    assert!(
        rows.iter().all(|row| number(&row["brdf_per_sr"]) == 0.0 && (number(&row["specular"]) - 0.85).abs() < 1e-12)
    );
    assert!(stdout(&["reflectance", &scene, "mirror"]).contains("mirror lobe, of which brdf_per_sr tells nothing"));
}

/// Per-band values are read in the band that holds the wavelength; a model is chosen by its label; a material that no
/// facet uses is read too; a shipped one needs no scene.
#[test]
fn materials_are_found_wherever_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "none");
    let diffuse = |args: &[&str]| number(&json(&[&["reflectance"], args, &["--json"]].concat())["rows"][0]["diffuse"]);
    assert!((diffuse(&[&scene, "banded", "--wavelength", "0.65"]) - 0.3).abs() < 1e-12);
    assert!((diffuse(&[&scene, "banded", "--wavelength", "0.85"]) - 0.5).abs() < 1e-12);
    assert!((diffuse(&[&scene, "spare"]) - 0.4).abs() < 1e-12);
    let shiny = json(&["reflectance", &scene, "glossy", "--model", "shiny", "--json"]);
    assert_eq!(shiny["model"], "phong shiny");
    let told = refusal(&["reflectance", &scene, "banded", "--wavelength", "0.75"]);
    assert!(told.contains("lies in none of red 600..700 nm, nir 800..900 nm"), "{told}");
    // Row 0.55 µm of the shipped table.
    let table = include_str!("../crates/reflectance/data/reflectance/asphalt_road_old.csv");
    let row = table.lines().find_map(|line| line.strip_prefix("550,")).expect("a row at 550 nm");
    let rho: f64 = row.parse().expect("a number");
    let shipped = diffuse(&["--material", "asphalt_road_old", "--model", "ideal"]);
    assert!((shipped - rho).abs() < 1e-5, "{shipped} {rho}");
}

#[test]
fn what_is_misspelt_is_told_with_the_nearest_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "none");
    let rows = folder.path().join("rows.csv");
    std::fs::write(&rows, "incident_zenith_deg,view_zenith_deg,relative_azimuth_deg\n10,20,0\n10,x,0\n")
        .expect("a table");
    let far = folder.path().join("far.csv");
    std::fs::write(&far, "zenith_deg,azimuth_deg\n10,20\n100,0\n").expect("a table");
    let cases: [(&[&str], &str); 12] = [
        (&["reflectance", &scene, "gray"], "there is no material `gray`; did you mean `grey`?"),
        (&["reflectance", &scene, "grey", "--experiment", "defautl"], "did you mean `default`?"),
        (&["reflectance", &scene, "glossy", "--model", "shinny"], "did you mean `shiny`?"),
        (&["reflectance", &scene, "grey", "--geometry", text(&rows)], "rows.csv: line 3, column"),
        (&["reflectance", &scene, "grey", "--wavelength", "550"], "write micrometres"),
        (&["reflectance", &scene, "tinted", "--wavelength", "0.3"], "M04"),
        (&["reflectance", &scene, "grey", "--plot", "mpa=x.png"], "did you mean `map`?"),
        (&["reflectance", "--material", "asfalt_road_old"], "did you mean `asphalt_road_old`?"),
        (&["atmosphere", &scene, "--experiment", "nothing"], "there are: default"),
        (&["atmosphere", &scene, "--directions", text(&far)], "far.csv: line 3, column"),
        (&["atmosphere", &scene, "--fisheye", "sky.jpg"], ".svg or .png"),
        (&["materials", "search", "asfalt"], "did you mean `asphalt`?"),
    ];
    for (args, expected) in cases {
        let told = refusal(args);
        assert!(told.contains(expected), "{args:?}: {told}");
    }
    assert!(refusal(&["materials", "plot", "leaf_mapel", "-o", "x.svg"]).contains("did you mean `leaf_maple`?"));
    assert!(refusal(&["atmosphere", &scene, "--fisheye", "sky.png", "--band", "rde"]).contains("did you mean `red`?"));
    assert!(!Path::new("x.svg").exists() && !Path::new("sky.png").exists());
}

#[test]
fn the_database_is_listed_searched_and_shown() {
    let all = json(&["materials", "--json"]);
    let entries = all.as_array().expect("materials");
    assert!(entries.len() >= 22);
    for entry in entries {
        for key in ["name", "title", "source", "licence"] {
            assert!(entry[key].as_str().is_some_and(|text| !text.is_empty()), "{entry}");
        }
        assert!(
            number(&entry["shortest_wavelength_um"]) <= 0.4 && number(&entry["longest_wavelength_um"]) >= 1.0,
            "{entry}"
        );
        assert!(
            entry["fault"].is_null() && entry["models"].as_array().is_some_and(|models| !models.is_empty()),
            "{entry}"
        );
    }
    let asphalt = json(&["materials", "search", "ASPHALT", "--json"]);
    assert_eq!(asphalt[0]["name"], "asphalt_road_old");
    assert!(stdout(&["materials", "show", "leaf_maple"]).contains("U.S. public domain"));
    // A user's folder hides the shipped material of its name, and a file that does not hold is told, not hidden.
    let folder = tempfile::tempdir().expect("a folder");
    let own = "glint 1\nmaterial leaf_maple { title \"my maple\", ideal { diffuse 0.3 } }\n";
    std::fs::write(folder.path().join("leaf_maple.glint"), own).expect("a material");
    std::fs::write(folder.path().join("broken.glint"), "glint 1\nmaterial broken { ideal { diffuse 3 } }\n")
        .expect("one");
    let mine = json(&["materials", "--database", text(folder.path()), "--json"]);
    let find =
        |name: &str| mine.as_array().and_then(|all| all.iter().find(|e| e["name"] == name)).expect("an entry").clone();
    assert_eq!(find("leaf_maple")["title"], "my maple");
    assert!(
        find("broken")["fault"].as_str().is_some_and(|fault| fault.contains("broken.glint:2:")),
        "{}",
        find("broken")
    );
    let scene = bench(folder.path(), "none");
    let of_scene = json(&["materials", "--scene", &scene, "--json"]);
    let names: Vec<&str> = of_scene.as_array().expect("materials").iter().filter_map(|e| e["name"].as_str()).collect();
    assert_eq!(names, ["grey", "tinted", "banded", "mirror", "glossy", "spare"]);
    assert_eq!(of_scene[4]["models"], serde_json::json!(["ideal", "phong shiny"]));
}

/// Text of the elements of an SVG; panics where the file is not well-formed XML: every tag closed in its order, no stray
/// `<` or `&`, attributes quoted.
fn svg_texts(svg: &str) -> Vec<String> {
    let mut open: Vec<String> = Vec::new();
    let mut texts = Vec::new();
    let mut text = String::new();
    let mut rest = svg;
    while let Some(at) = rest.find('<') {
        let between = &rest[..at];
        for part in between.split('&').skip(1) {
            assert!(["amp;", "lt;", "gt;", "quot;"].iter().any(|entity| part.starts_with(entity)), "{part}");
        }
        if open.iter().any(|tag| tag == "text") {
            text.push_str(between);
        } else {
            assert!(between.trim().is_empty() || open.last().is_some_and(|tag| tag == "title"), "{between}");
        }
        let end = at + rest[at..].find('>').expect("a tag is closed");
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name));
            if name == "text" {
                texts.push(std::mem::take(&mut text));
            }
            continue;
        }
        let name: String = tag.chars().take_while(|c| c.is_alphabetic()).collect();
        assert!(!name.is_empty() && tag.matches('"').count().is_multiple_of(2), "<{tag}>");
        for attribute in tag.split("=\"").skip(1).map(|a| a.split('"').nth(1).unwrap_or("")) {
            assert!(attribute.is_empty() || attribute.starts_with([' ', '/']), "<{tag}>");
        }
        if !tag.ends_with('/') {
            open.push(name);
        }
    }
    assert!(open.is_empty() && rest.trim().is_empty());
    texts
}

/// Width and height in the header of a PNG.
fn png_size(bytes: &[u8]) -> (u32, u32) {
    assert_eq!(bytes[..8], *b"\x89PNG\r\n\x1a\n");
    let number = |at: usize| u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    (number(16), number(20))
}

/// Every kind of plot in both formats: well-formed, with captions and units, twice as many pixels as units, and the same
/// bytes every time.
#[test]
fn plots_are_whole_and_labelled_and_the_same_each_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "spectrl2");
    let file = |name: &str| text(&folder.path().join(name)).to_string();
    let plot = |kind: &str, name: &str| format!("{kind}={}", file(name));
    let kinds = [
        ("components", ["view zenith angle θv [°]", "reflectance"]),
        ("brdf", ["BRDF f [sr⁻¹]", "forward, φ = 180° →"]),
        ("map", ["BRDF f [sr⁻¹]", "light"]),
        ("albedo", ["incident zenith angle θi [°]", "0.55 µm"]),
        ("spectra", ["wavelength λ [µm]", "reflectance"]),
    ];
    let run = |suffix: &str| {
        let mut args: Vec<String> = ["reflectance", &scene, "glossy", "--model", "shiny"].map(String::from).to_vec();
        for (kind, _) in kinds {
            args.extend(["--plot".into(), plot(kind, &format!("{kind}{suffix}.svg"))]);
        }
        args.extend(["--plot".into(), plot("brdf", &format!("brdf{suffix}.png"))]);
        stdout(&args.iter().map(String::as_str).collect::<Vec<_>>());
        stdout(&[
            "atmosphere",
            &scene,
            "--plot",
            &file(&format!("air{suffix}.svg")),
            "--fisheye",
            &file(&format!("sky{suffix}.svg")),
        ]);
        stdout(&["materials", "plot", "leaf_maple", "snow_melting", "-o", &file(&format!("spectra_of{suffix}.svg"))]);
    };
    run("");
    run("_again");
    let read = |name: &str| std::fs::read_to_string(file(name)).expect("a plot");
    let labelled = kinds.iter().copied().chain([
        ("air", ["irradiance on the level [W m⁻² µm⁻¹]", "wavelength λ [µm]"]),
        ("sky", ["sky radiance Ld [W m⁻² sr⁻¹ µm⁻¹]", "sun"]),
        ("spectra_of", ["leaf_maple", "reflectance ρ"]),
    ]);
    for (name, labels) in labelled {
        let svg = read(&format!("{name}.svg"));
        assert_eq!(svg, read(&format!("{name}_again.svg")), "{name}");
        let texts: Vec<String> = svg_texts(&svg);
        for label in labels {
            assert!(texts.iter().any(|text| text == label), "{name} lacks {label}: {texts:?}");
        }
    }
    let svg = read("brdf.svg");
    let size = |key: &str| -> u32 {
        svg.split(&format!("{key}=\""))
            .nth(1)
            .and_then(|s| s.split('"').next())
            .and_then(|s| s.parse().ok())
            .expect("a size")
    };
    let png = std::fs::read(file("brdf.png")).expect("a plot");
    assert_eq!(png_size(&png), (2 * size("width"), 2 * size("height")));
    assert_eq!(png, std::fs::read(file("brdf_again.png")).expect("a plot"));
}

#[test]
fn help_of_each_command_ends_with_an_example() {
    for command in ["atmosphere", "reflectance", "materials"] {
        let help = stdout(&[command, "--help"]);
        let last = help.trim_end().lines().last().unwrap_or_default();
        assert!(last.trim_start().starts_with(&format!("sunglint {command}")), "{command}: {last}");
    }
}

/// The flags stand for a scene of one point: what they give is what that scene gives, to the last bit.
#[test]
fn flags_give_what_the_scene_that_they_stand_for_gives() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("point.glint");
    std::fs::write(
        &scene,
        "glint 1
site { latitude 43.0846 deg, longitude -77.6743 deg, elevation 168 m }
collect { at 1992-06-18 12:00 -04:00 }
weather { profile midlatitude_summer, visibility 23 km, water 2 g/cm2, ozone 320 DU, pressure 990 hPa }
atmosphere spectrl2
material ground { ideal { diffuse [400 nm 0.1, 1100 nm 0.4] } }
ground ground
sensor sensor {
  look_at (0 0 0) m, altitude 3 km, view_zenith 40 deg, view_azimuth 100 deg, field_of_view 1 arcsec, pixels 1 x 1
  band red 600..700 nm
  bands 800..900 nm every 50 nm fwhm 20 nm
}
experiment air { samples 16 }
",
    )
    .expect("a scene");
    let directions = folder.path().join("sky.csv");
    std::fs::write(&directions, "zenith_deg,azimuth_deg\n0,0\n60,135\n").expect("a table");
    let rest = ["--directions", text(&directions), "--json"];
    let of_scene = json(&[&["atmosphere", text(&scene)], &rest[..]].concat());
    let flags = [
        "atmosphere --latitude 43.0846 --longitude -77.6743 --at 1992-06-18T12:00:00-04:00 --profile midlatitude_summer",
        "--model spectrl2 --view-zenith 40 --view-azimuth",
    ];
    let spoken = [
        ["--elevation", "168 m"],
        ["--visibility", "23 km"],
        ["--water", "2 g/cm2"],
        ["--ozone", "320 DU"],
        ["--pressure", "990 hPa"],
        ["--albedo", "[400 nm 0.1, 1100 nm 0.4]"],
        ["--sensor-altitude", "3 km"],
        ["--add-band", "red 600..700 nm"],
        ["--wavelengths", "800..900 nm every 50 nm fwhm 20 nm"],
    ];
    let flags = flags.iter().flat_map(|flags| flags.split(' ')).chain(["100 deg"]);
    let flags: Vec<&str> = flags.chain(spoken.into_iter().flatten()).chain(rest).collect();
    assert_eq!(json(&flags), of_scene);
}

/// Without air a level ground under a sun at zenith angle θ gets E_s cos θ, and every step of the range has its band.
#[test]
fn without_air_flags_need_no_more_than_a_sun() {
    let found =
        stdout(&["atmosphere", "--sun-zenith", "60", "--model", "none", "--set", "solar_irradiance=1000 W/m2/um"]);
    let row: Vec<f64> = found
        .lines()
        .find(|line| line.contains(" nm550 "))
        .expect("a band")
        .split_whitespace()
        .skip(2)
        .map(number_of)
        .collect();
    let [um, e_s, tau_1, e_b, _, tau_2, l_u] = row[..] else { panic!("{row:?}") };
    assert_eq!((um, e_s, tau_1, e_b, tau_2, l_u), (0.55, 1000.0, 1.0, 500.0, 1.0, 0.0));
    assert_eq!(found.lines().filter(|line| line.contains(" nm")).count(), 61);
    let steps = stdout(&["atmosphere", "--sun-zenith", "60 deg", "--wavelengths", "400..1000 nm every 5 nm"]);
    assert_eq!(steps.lines().filter(|line| line.contains(" nm")).count(), 121);
}

/// The README's flags: every step of the range has its band, the first of which reaches down to 380 nm.
#[test]
fn a_sun_and_a_visibility_are_enough() {
    let found = stdout(&["atmosphere", "--sun-zenith", "30", "--visibility", "23 km"]);
    let rows: Vec<Vec<f64>> = (found.lines().filter(|line| line.contains(" nm")))
        .map(|line| line.split_whitespace().skip(2).map(number_of).collect())
        .collect();
    assert_eq!(rows.len(), 61);
    for row in &rows {
        assert!(row[2] > 0.1 && row[2] < 0.9 && row[3] > 0.0 && row[4] > 0.0 && row[6] > 0.0, "{row:?}");
    }
    // Rayleigh's and the haze's depth rise smoothly into the violet.
    assert!(rows.windows(2).take(4).all(|pair| pair[0][2] < pair[1][2]));
}

fn number_of(text: &str) -> f64 {
    text.parse().unwrap_or_else(|_| panic!("{text} is no number"))
}

/// A finding points at the flag, in the words of the language: its user never saw a scene.
#[test]
fn what_is_wrong_with_a_flag_is_told_at_the_flag() {
    let told = |flags: &[&str]| refusal(&[&["atmosphere", "--sun-zenith", "30"], flags].concat());
    let unitless = told(&["--visibility", "23"]);
    for part in [
        "error[U02]: visibility is a length; `23` has no unit",
        "command line:1:30",
        "1 | --sun-zenith 30 --visibility 23\n  |                              ^^ 23 km? (",
        "1 error on the command line",
    ] {
        assert!(unitless.contains(part), "{part}\n{unitless}");
    }
    let minutes = told(&["--visibility", "23 min"]);
    assert!(minutes.contains("error[U03]") && minutes.contains("--visibility \"23 min\""), "{minutes}");
    assert!(told(&["--set", "streems=16", "--model", "none"]).contains("`streems` is no parameter of `none`"));
    assert!(told(&["--model", "spectrl3"]).contains("`spectrl2`?"));
    assert!(told(&["--view-zenith", "95"]).contains("--view-zenith 95"));
    assert!(told(&["--wavelengths", "400..1000 nm every 5"]).contains("error[U02]"));
    assert!(told(&["--visibility", "23 km", "--aod", "0.2"]).contains("error[S05]"));
    // A field without effect is refused here as in a scene.
    let vain = told(&["--model", "none", "--ozone", "300 DU"]);
    assert!(vain.contains("error[A01]") && vain.contains("--ozone \"300 DU\""), "{vain}");
    for (value, why) in
        [("23 km }", "closes nothing"), ("23 km # far", "no comment"), ("23 km\nozone 1 DU", "one line")]
    {
        assert!(told(&["--visibility", value]).contains(why), "{value}");
    }
    assert!(refusal(&["atmosphere", "--visibility", "23 km"]).contains("--sun-zenith ANGLE, or --latitude"));
    assert!(refusal(&["atmosphere", "--at", "1992-06-18T16:00:00Z"]).contains("--at needs --latitude"));
    let both = refusal(&["atmosphere", "examples/minimal/minimal.glint", "--visibility", "23 km"]);
    assert!(both.contains("cannot be used with"), "{both}");
    assert!(told(&["--sensor", "roof"]).contains("choose from a scene"));
}

#[test]
fn flags_give_pictures_and_tables_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let (csv, plot, sky) = (folder.path().join("a.csv"), folder.path().join("a.svg"), folder.path().join("sky.png"));
    stdout(&[
        "atmosphere",
        "--sun-zenith",
        "30",
        "--sun-azimuth",
        "120",
        "--aod",
        "0.2",
        "--bands",
        "sentinel2a",
        "--band",
        "B3",
        "--csv",
        text(&csv),
        "--plot",
        text(&plot),
        "--fisheye",
        text(&sky),
    ]);
    assert!(std::fs::read_to_string(&csv).expect("a table").starts_with("wavelength_um,"));
    assert!(std::fs::read_to_string(&plot).expect("a plot").starts_with("<svg"));
    assert!(png_size(&std::fs::read(&sky).expect("a picture")).0 > 100);
}
