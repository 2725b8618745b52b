//! The models against closed forms, and what they refuse.

mod given;

use std::f64::consts::PI;
use std::sync::Arc;

use given::{STARK, WINDOW, bind, bind_on, constant, curve, grid, number, table, word};
use sunglint_plugin::{SpectralValue, TableKey, Value};
use sunglint_radiometry::{Bin, LocalDir, SpectralGrid};
use sunglint_reflectance::conformance::{Options, check};
use sunglint_reflectance::{BUILTIN, Bsdf, SOLAR_DISK};

/// A model that lies about its density, its albedo, its reciprocity or its energy must not pass: the suite has teeth.
#[test]
fn the_suite_finds_a_model_that_breaks_its_word() {
    use sunglint_reflectance::{Lobes, Sample, Split};
    /// Lambert, and in the arguments what is wrong with it.
    struct Faulty {
        inner: Arc<dyn Bsdf>,
        gain: f64,
        tilt: f64,
        density: f64,
    }
    impl Bsdf for Faulty {
        fn lobes(&self) -> Lobes {
            self.inner.lobes()
        }
        fn split(&self) -> &Split {
            self.inner.split()
        }
        fn eval(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
            self.inner.eval(incident, outgoing, f);
            f.iter_mut().for_each(|f| *f *= self.gain * (1.0 + self.tilt * outgoing.cos()));
        }
        fn sample(&self, outgoing: LocalDir, u: [f64; 3]) -> Option<Sample> {
            let u = [u[0].powf(self.density), u[1], u[2]];
            self.inner.sample(outgoing, u)
        }
        fn pdf(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
            self.inner.pdf(incident, outgoing)
        }
        fn albedo(&self, incident: LocalDir, rho: &mut [f64]) {
            self.inner.albedo(incident, rho);
        }
    }
    let failing = |gain, tilt, density| {
        let inner = bind("ideal", vec![constant("diffuse", 0.9)]).unwrap();
        let report = check(&Faulty { inner, gain, tilt, density }, grid().len(), &Options::default());
        let names: Vec<&str> = report.findings.iter().filter(|f| !f.passed()).map(|f| f.property).collect();
        names.join("; ")
    };
    assert_eq!(failing(1.0, 0.0, 1.0), "");
    assert!(failing(1.2, 0.0, 1.0).contains("hemispherical-directional"));
    assert!(failing(0.99, 0.0, 1.0).contains("albedo"));
    assert!(failing(0.9, 0.01, 1.0).contains("reciprocal"));
    assert!(failing(1.0, 0.0, 1.02).contains("chi-square"));
}

#[test]
fn a_lambertian_surface_has_f_equal_to_rho_over_pi() {
    let model = bind("ideal", vec![constant("diffuse", 0.18)]).unwrap();
    let mut f = [0.0; 4];
    model.eval(LocalDir::from_polar(1.0, 0.3), LocalDir::from_polar(0.2, 2.0), &mut f);
    assert!(f.iter().all(|f| (f - 0.18 / PI).abs() < 1e-16));
    assert!(model.claims().reciprocal);
    assert_eq!(model.split().diffuse.at(1.2, 0), 0.18);
    assert!(model.split().specular.is_zero());
}

#[test]
fn a_mirror_has_a_dirac_lobe_of_its_reflectance_and_no_other() {
    let model = bind("ideal", vec![constant("specular", 0.85)]).unwrap();
    assert!(model.lobes().mirror && !model.lobes().diffuse && !model.lobes().glossy);
    let (outgoing, mut rho) = (LocalDir::from_polar(1.1, 0.3), [0.0; 4]);
    model.mirror(outgoing, &mut rho);
    assert_eq!(rho, [0.85; 4]);
    let sample = model.sample(outgoing, [0.1, 0.7, 0.3]).unwrap();
    assert!(sample.mirror && sample.pdf == 1.0 && sample.incident == outgoing.mirrored());
    assert_eq!(model.split().solid_angle, [0.0]);
}

/// f at the mirror direction is (R_d + R_s)/π: what a goniometer of that aperture read.
#[test]
fn a_table_of_brf_returns_its_peak_in_the_mirror_direction() {
    let model = bind("split", vec![table("table", TableKey::None, &STARK), number("solid_angle", 1.9e-3)]).unwrap();
    for row in STARK {
        let outgoing = LocalDir::from_polar(row[0].to_radians(), 0.4);
        let mut f = [0.0; 4];
        model.eval(outgoing.mirrored(), outgoing, &mut f);
        assert!((f[0] * PI / (row[1] + row[2]) - 1.0).abs() < 1e-9);
        let beside = LocalDir::from_polar(row[0].to_radians() + 0.03, 0.4 + PI);
        model.eval(beside, outgoing, &mut f);
        assert!((f[0] * PI / row[1] - 1.0).abs() < 1e-12);
        // ρ_s = R_s Ω_s cos θ/π
        let rho_s = row[2] * 1.9e-3 * row[0].to_radians().cos() / PI;
        assert!((model.split().specular.at(row[0].to_radians(), 0) / rho_s - 1.0).abs() < 1e-12);
        assert!((model.split().printed.at(row[0].to_radians(), 0) / row[2] - 1.0).abs() < 1e-12);
    }
    let split = model.split();
    assert_eq!(split.diffuse.at(0.0, 0), 0.112);
    assert!((split.diffuse.at(90f64.to_radians(), 0) - 0.101).abs() < 1e-15);
    // Fresnel-shaped growth: F(90°)/F(75°) = 1/0.25308 for index 1.5.
    let growth = split.specular.at(90f64.to_radians(), 0) / split.specular.at(75f64.to_radians(), 0);
    assert!((growth - 1.0 / 0.253_08).abs() < 1e-3, "{growth}");
}

#[test]
fn the_lobe_of_a_held_table_stays_as_last_measured() {
    let given = vec![table("table", TableKey::None, &WINDOW), word("specular", "reflectance"), word("grazing", "hold")];
    let split = bind("split", given).unwrap();
    assert_eq!(split.split().specular.at(1.57, 0), 0.41);
    assert!(split.lobes().mirror, "the default solid angle is the sun's disk, a true mirror");
    assert_eq!(split.split().solid_angle[0], SOLAR_DISK);
}

#[test]
fn tables_per_band_and_per_wavelength_reach_their_entries() {
    let bin = |lower, upper, band| Bin { lower, upper, band: Some(band) };
    let bands =
        SpectralGrid::new(vec![bin(0.5, 0.6, 0), bin(0.55, 0.7, 1)], vec!["green".to_string(), "red".to_string()]);
    let key = TableKey::Band(["red", "red", "green"].map(str::to_string).to_vec());
    let rows: [&[f64]; 3] = [&[0.0, 0.5], &[60.0, 0.3], &[30.0, 0.1]];
    let model = bind_on("ideal", vec![table("diffuse_table", key, &rows)], &bands).unwrap();
    let at_30 = |entry| model.split().diffuse.at(30f64.to_radians(), entry);
    assert!((at_30(0) - 0.1).abs() < 1e-15 && (at_30(3) - 0.4).abs() < 1e-15);

    let key = TableKey::Wavelength(vec![0.7, 0.7, 0.5, 0.5]);
    let rows: [&[f64]; 4] = [&[0.0, 0.6], &[80.0, 0.6], &[0.0, 0.2], &[80.0, 0.2]];
    let model = bind("ideal", vec![table("diffuse_table", key, &rows)]).unwrap();
    for (entry, node) in grid().entries().iter().enumerate() {
        let expected = 0.2 + 0.4 * (node.wavelength.um() - 0.5) / 0.2;
        assert!((model.split().diffuse.at(1.0, entry) - expected).abs() < 1e-12);
    }
}

/// A table that is another material's is scaled to the reflectance of the material that takes it over; its own stays.
#[test]
fn a_split_taken_over_is_scaled_to_the_reflectance() {
    let given = |more: Vec<(String, Value)>| {
        [vec![table("table", TableKey::None, &STARK), number("solid_angle", 1.9e-3)], more].concat()
    };
    let scaled = ("scaled".to_string(), Value::Switch(true));
    let own = bind("split", given(vec![constant("reflectance", 0.3)])).unwrap();
    let over = bind("split", given(vec![constant("reflectance", 0.3), scaled])).unwrap();
    let total = |model: &dyn Bsdf| model.split().diffuse.hemispherical()[0] + model.split().specular.hemispherical()[0];
    assert!((total(&*over) - 0.3).abs() < 1e-9 && total(&*own) < 0.15, "{} {}", total(&*over), total(&*own));
    let at = |model: &dyn Bsdf, degree: f64| model.split().diffuse.at(degree.to_radians(), 0);
    assert!((at(&*over, 8.0) / at(&*over, 60.0) - 0.112 / 0.104).abs() < 1e-9);
    assert_eq!(at(&*own, 8.0), 0.112);

    let rows: [&[f64]; 4] = [&[10.0, -40.0, 0.3], &[10.0, 40.0, 0.2], &[60.0, -60.0, 0.9], &[60.0, 40.0, 0.2]];
    let in_plane = |rows: &[&[f64]]| {
        let radians = |row: &&[f64]| vec![row[0].to_radians(), row[1].to_radians(), row[2]];
        Value::Table(sunglint_plugin::Table { key: TableKey::None, rows: rows.iter().map(radians).collect() })
    };
    let scaled = ("scaled".to_string(), Value::Switch(true));
    let given = vec![("in_plane".to_string(), in_plane(&rows)), constant("reflectance", 0.15), scaled];
    let model = bind("measured", given).unwrap();
    let mean: f64 = (0..90)
        .map(|k| {
            let theta = (f64::from(k) + 0.5).to_radians();
            let mut rho = [0.0; 4];
            model.albedo(LocalDir::from_polar(theta, 0.0), &mut rho);
            2.0 * rho[0] * theta.sin() * theta.cos() * 1f64.to_radians()
        })
        .sum();
    assert!((mean - 0.15).abs() < 1e-3, "{mean}");
}

#[test]
fn faults_of_a_scene_are_named_with_their_code() {
    let fault = |name, given| bind(name, given).err().map(|error| (error.code, error.message));
    let has = |name, given, code: &str, part: &str| {
        let (found, message) = fault(name, given).expect(part);
        assert!(found == code && message.contains(part), "{found} {message}");
    };
    has("ideal", vec![], "S05", "no reflectance");
    has("ideal", vec![constant("diffuse", 0.1), constant("specular", 0.1)], "S05", "exclude");
    has("ideal", vec![constant("diffuse", 1.2)], "M05", "1.2");
    has("ideal", vec![curve("diffuse", &[(0.55, 0.1), (0.7, 0.1)])], "M04", "550.0..700.0 nm");
    let per_band = SpectralValue::PerBand(vec![("blue".to_string(), 0.1)]);
    has("ideal", vec![("diffuse".to_string(), Value::Spectrum(per_band))], "M04", "band");
    has(
        "ideal",
        vec![table("diffuse_table", TableKey::None, &[&[60.0, 0.1], &[30.0, 0.1]])],
        "M05",
        "30 deg follows 60",
    );
    has("ideal", vec![table("diffuse_table", TableKey::None, &[&[95.0, 0.1]])], "M05", "95 deg");
    has("ideal", vec![table("diffuse_table", TableKey::None, &[])], "M05", "no rows");
    has("ideal", vec![table("diffuse_table", TableKey::None, &[&[0.0, f64::NAN]])], "M05", "finite");
    has("ideal", vec![table("diffuse_table", TableKey::Wavelength(vec![0.6]), &[&[0.0, 0.1]])], "M04", "600.0..600.0");
    has("ideal", vec![table("diffuse_table", TableKey::Band(vec![]), &[&[0.0, 0.1]])], "M05", "no band");
    has("split", vec![], "S05", "`table` or a `category`");
    has("split", vec![word("category", "shiny"), constant("total", 0.1)], "N01", "shiny");
    has("split", vec![word("category", "combination")], "S05", "total");
    has("split", vec![table("table", TableKey::None, &STARK), number("solid_angle", 1e-6)], "U05", "BRF");
    has("split", vec![table("table", TableKey::None, &STARK), number("solid_angle", 7.0)], "U05", "2 pi");
    has("split", vec![table("table", TableKey::None, &[&[0.0, 0.2, -0.1]])], "M05", "not negative");
    let too_much = |rows: &[&[f64]]| vec![table("table", TableKey::None, rows), word("specular", "reflectance")];
    has(
        "split",
        too_much(&[&[0.0, 0.2, 0.1], &[40.0, 0.7, 0.35]]),
        "M05",
        "at 40 deg: R_d + rho_s = 0.7000 + 0.3500 exceeds 1 by 0.0500",
    );
    // R_d + ρ_s = 1 everywhere, yet light along 85° leaves with 0.94 and more of the rest.
    has(
        "split",
        too_much(&[&[0.0, 0.9, 0.1], &[70.0, 0.9, 0.1], &[85.0, 0.1, 0.9]]),
        "M05",
        "the mean of R_d over the hemisphere",
    );
    has("phong", vec![constant("diffuse", 0.1), constant("exponent", 3.0)], "S05", "specular");
    has("phong", vec![constant("diffuse", 0.1), constant("specular", 0.1)], "S05", "exponent");
    has("phong", vec![constant("specular", 0.1), constant("exponent", 3.0)], "S05", "no diffuse part");
    has(
        "phong",
        vec![constant("diffuse", 0.8), constant("specular", 0.3), constant("exponent", 3.0)],
        "M05",
        "by 0.1000",
    );
    has(
        "phong",
        vec![constant("reflectance", 0.1), constant("specular", 0.3), constant("exponent", 3.0)],
        "M05",
        "by 0.2000",
    );
    has(
        "phong",
        vec![constant("diffuse", 0.8), constant("specular", 0.1), constant("exponent", 2e6)],
        "U05",
        "exponent",
    );
}

#[test]
fn every_model_documents_its_parameters() {
    for model in BUILTIN {
        for param in model.info.params {
            assert!(model.info.manual.contains(&format!("`{}`", param.name)), "{} {}", model.info.name, param.name);
            assert!(param.excludes.iter().all(|other| model.info.param(other).is_some()), "{}", param.name);
        }
        assert!(model.info.manual.contains("# In a scene") && model.info.manual.contains("# Validity"));
    }
}
