//! Every registered model against the conformance suite, at several roughnesses and view angles of 0, 20, 40, 60, 75 and 85°.
//!
//! `SUNGLINT_SAMPLES=1000000 cargo test --release -p sunglint-reflectance --test conformance -- --nocapture` draws more than
//! the 100 000 directions that each chi-square test draws without it, and prints what was found.

mod given;

use std::f64::consts::TAU;

use given::{Given, STARK, WINDOW, bind, bind_on, constant, curve, grid, number, table, word};
use sunglint_plugin::{Args, Component, SpectralValue, Table, TableKey, Value};
use sunglint_radiometry::SpectralGrid;
use sunglint_reflectance::conformance::{Options, check, spectral_consistency};
use sunglint_reflectance::{BUILTIN, Category};

/// A spectrum that rises or falls over the grid.
fn ramp(name: &str, low: f64, high: f64) -> (String, Value) {
    curve(name, &[(0.5, low), (0.7, high)])
}

fn switch(name: &str, on: bool) -> (String, Value) {
    (name.to_string(), Value::Switch(on))
}

/// Aluminium, about.
fn metal() -> Given {
    vec![ramp("n", 0.77, 1.83), ramp("k", 6.08, 8.31)]
}

/// Glass or a clear coat.
fn coat() -> Given {
    vec![constant("n", 1.5)]
}

/// All but the last number of a row in radians.
fn degrees(row: Vec<f64>) -> Vec<f64> {
    let n = row.len() - 1;
    row.into_iter().enumerate().map(|(i, value)| if i < n { value.to_radians() } else { value }).collect()
}

fn with(base: &Given, more: Given) -> Given {
    [base.clone(), more].concat()
}

/// At least five of each model, rough and smooth.
fn cases(model: &str) -> Vec<Given> {
    let roughnesses = [0.02, 0.1, 0.3, 0.6, 1.0];
    match model {
        "ideal" => vec![
            vec![constant("diffuse", 1.0)],
            vec![ramp("reflectance", 0.1, 0.6)],
            vec![constant("diffuse", 0.0)],
            vec![ramp("specular", 0.2, 1.0)],
            vec![table("diffuse_table", TableKey::None, &[&[0.0, 0.9], &[60.0, 0.8], &[85.0, 0.3]])],
            vec![table("specular_table", TableKey::None, &[&[0.0, 0.04], &[60.0, 0.09], &[90.0, 1.0]])],
        ],
        "split" => {
            let window =
                |more| with(&vec![table("table", TableKey::None, &WINDOW), word("specular", "reflectance")], more);
            let mut cases = vec![
                vec![table("table", TableKey::None, &STARK), number("solid_angle", 1.9e-3)],
                vec![table("table", TableKey::None, &STARK), number("solid_angle", 0.3)],
                window(vec![]),
                window(vec![number("solid_angle", TAU)]),
                vec![
                    table("table", TableKey::None, &[&[0.0, 0.0, 1.0]]),
                    word("specular", "reflectance"),
                    word("grazing", "hold"),
                    number("solid_angle", 0.05),
                ],
                vec![word("category", "combination"), constant("total", 1.0), number("solid_angle", 0.02)],
                vec![word("category", "mostly_specular"), constant("total", 0.6), number("solid_angle", 2.0)],
            ];
            cases.extend(Category::NAMES.iter().map(|c| vec![word("category", c), ramp("reflectance", 0.05, 0.95)]));
            cases
        }
        "total_diffuse" => [0.0, 0.1, 0.4, 0.8, 1.0].map(|rho| vec![ramp("reflectance", rho, 0.5)]).to_vec(),
        "phong" | "blinn_phong" => {
            let mut cases = Vec::new();
            for exponent in [0.0, 1.0, 20.0, 1e3, 1e6] {
                let m = constant("exponent", exponent);
                cases.push(vec![constant("diffuse", 0.0), constant("specular", 1.0), m.clone()]);
                cases.push(vec![ramp("reflectance", 0.3, 0.9), constant("specular", 0.2), m]);
            }
            cases.push(vec![constant("diffuse", 0.1), ramp("specular", 0.5, 0.9), ramp("exponent", 10.0, 400.0)]);
            cases
        }
        "torrance_sparrow" => {
            let mut cases: Vec<Given> = (roughnesses.iter())
                .map(|m| with(&coat(), vec![constant("diffuse", 0.3), constant("roughness", *m)]))
                .collect();
            cases.push(with(&metal(), vec![ramp("roughness", 0.1, 0.5)]));
            cases
        }
        "cook_torrance" => {
            let mut cases: Vec<Given> = (roughnesses.iter())
                .map(|m| {
                    with(&coat(), vec![constant("diffuse", 0.9), constant("specular", 0.4), constant("roughness", *m)])
                })
                .collect();
            cases.push(with(&metal(), vec![constant("specular", 1.0), ramp("roughness", 0.1, 0.5)]));
            let printed = vec![constant("specular", 0.9), constant("roughness", 0.3), word("normalisation", "printed")];
            cases.push(with(&metal(), printed));
            cases
        }
        "he_torrance" => {
            // From a polished surface to one in its geometric limit.
            let pairs = [(0.02, 2.0), (0.08, 1.5), (0.2, 2.0), (0.5, 3.0), (2.0, 8.0), (5.0, 40.0)];
            let rough = |(height, correlation)| vec![constant("height", height), constant("correlation", correlation)];
            let mut cases: Vec<Given> = pairs.iter().map(|pair| with(&metal(), rough(*pair))).collect();
            cases.push(with(&coat(), with(&rough((0.1, 1.5)), vec![constant("diffuse", 0.5)])));
            cases
        }
        "maxwell_beard" => {
            let nef = |sigma: f64, more: Given| {
                let given = vec![
                    constant("bias", 0.6 * sigma),
                    constant("sigma", sigma),
                    constant("rho_d", 0.02),
                    constant("rho_v", 0.01),
                    constant("tau", 0.4),
                    constant("omega", 0.7),
                ];
                with(&with(&coat(), given), more)
            };
            let mut cases: Vec<Given> = [0.03, 0.1, 0.2, 0.4, 0.8].map(|sigma| nef(sigma, vec![])).to_vec();
            cases.push(nef(0.15, vec![switch("azimuth", true)]));
            let scan: [&[f64]; 5] = [
                &[0.0, 0.61, 0.01],
                &[5.0, 0.42, 0.01],
                &[10.0, 0.14, 0.01],
                &[20.0, 0.03, 0.01],
                &[40.0, 0.012, 0.01],
            ];
            cases.push(with(&coat(), vec![table("scan", TableKey::None, &scan)]));
            cases
        }
        "ward" => {
            let mut cases = Vec::new();
            for form in ["bounded", "ward", "duer"] {
                for alpha in roughnesses {
                    let given = vec![constant("specular", 0.6), constant("roughness", alpha), word("form", form)];
                    cases.push(with(&vec![ramp("diffuse", 0.1, 0.4)], given));
                }
            }
            cases.push(vec![constant("diffuse", 0.0), constant("specular", 1.0), ramp("roughness", 0.1, 0.5)]);
            cases
        }
        "ggx" | "rough_conductor" => {
            let forms: &[&str] = if model == "ggx" { &["correlated", "separable"] } else { &["separable", "walter"] };
            let mut cases: Vec<Given> =
                roughnesses.iter().map(|alpha| with(&metal(), vec![constant("roughness", *alpha)])).collect();
            let rough = |form: &str| vec![constant("roughness", 0.4), word("shadowing", form)];
            cases.extend(forms.iter().map(|form| with(&metal(), rough(form))));
            cases.push(with(&metal(), vec![constant("roughness", 0.7), switch("multiple", true)]));
            cases.push(with(&metal(), vec![ramp("roughness", 0.1, 0.5), switch("multiple", true)]));
            cases.push(with(&coat(), vec![constant("roughness", 0.2), ramp("diffuse", 0.2, 1.0)]));
            cases.push(with(&metal(), vec![constant("roughness", 0.0)]));
            // As good as no loss: nothing may come of rounding.
            let lossless = vec![constant("n", 0.01), constant("k", 100.0)];
            for alpha in [0.1, 0.5, 1.0] {
                cases.push(with(&lossless, vec![constant("roughness", alpha), switch("multiple", true)]));
            }
            cases.push(with(&coat(), vec![constant("roughness", 0.3), constant("diffuse", 1.0)]));
            cases.push(with(&coat(), vec![constant("roughness", 0.0), constant("diffuse", 0.5)]));
            cases
        }
        "oren_nayar" => {
            let mut cases =
                [0.0, 0.1, 0.3, 0.5, 1.0].map(|s| vec![ramp("diffuse", 0.2, 0.9), constant("roughness", s)]);
            cases[2].push(ramp("roughness", 0.2, 0.6));
            cases.to_vec()
        }
        "rpv" => {
            let four = |rho0, k, theta, rhoc| {
                vec![constant("rho0", rho0), constant("k", k), constant("theta", theta), constant("rhoc", rhoc)]
            };
            let mut cases =
                vec![vec![], four(0.02, 0.5, -0.3, 0.02), four(0.3, 1.2, 0.2, 0.1), four(0.2, 1.0, 0.0, 1.0)];
            cases.push(vec![ramp("rho0", 0.05, 0.3), ramp("k", 0.6, 0.9), ramp("theta", -0.2, 0.05)]);
            cases
        }
        "ross_li" => {
            let three = |iso, vol, geo| vec![constant("iso", iso), constant("vol", vol), constant("geo", geo)];
            let mut cases =
                vec![three(0.3, 0.0, 0.0), three(0.05, 0.03, 0.01), three(0.4, 0.2, 0.05), three(0.1, 0.0, 0.1)];
            let crowns = vec![constant("geo", 0.03), ramp("shape", 1.0, 1.5), constant("height", 1.5)];
            cases.push(with(&vec![ramp("iso", 0.1, 0.5), ramp("vol", 0.0, 0.1)], crowns));
            cases
        }
        "hapke" => {
            let of = |w, b, c, b0, h, slope| {
                let names = ["w", "b", "c", "b0", "h", "roughness"];
                names.into_iter().zip([w, b, c, b0, h, slope]).map(|(name, value)| constant(name, value)).collect()
            };
            vec![
                of(0.3, 0.2, 0.5, 0.0, 0.1, 0.0),
                of(0.9, 0.4, 0.7, 1.0, 0.05, 0.0),
                of(1.0, 0.1, 0.5, 0.5, 0.2, 0.2),
                of(0.6, 0.5, 1.0, 1.0, 0.1, 0.45),
                vec![ramp("w", 0.2, 0.8), ramp("roughness", 0.0, 0.4)],
            ]
        }
        "measured" => {
            let lobe = |i: f64, o: f64, phi: f64, width: f64| {
                let (a, b) = (i.to_radians(), o.to_radians());
                let cos = (a.cos() * b.cos() - a.sin() * b.sin() * phi.to_radians().cos()).clamp(-1.0, 1.0);
                0.2 + 0.8 * (-(cos.acos() / width).powi(2)).exp()
            };
            let full = |width: f64, step: f64| {
                let mut rows = Vec::new();
                let angles =
                    |most: f64, step: f64| (0..).map(move |k| step * f64::from(k)).take_while(move |a| *a <= most);
                for i in angles(80.0, step) {
                    for o in angles(80.0, step) {
                        rows.extend(angles(180.0, step).map(|phi| degrees(vec![i, o, phi, lobe(i, o, phi, width)])));
                    }
                }
                vec![("table".to_string(), Value::Table(Table { key: TableKey::None, rows }))]
            };
            let plane = |width: f64, extension: &str| {
                let mut rows = Vec::new();
                for i in [8.0, 30.0, 45.0, 60.0, 75.0] {
                    for v in [-75.0, -60.0, -45.0, -30.0, -8.0, 8.0, 30.0, 45.0, 60.0, 75.0_f64] {
                        let phi = if v < 0.0 { 180.0 } else { 0.0 };
                        rows.push(degrees(vec![i, v, lobe(i, v.abs(), phi, width)]));
                    }
                }
                let table = Value::Table(Table { key: TableKey::None, rows });
                vec![("in_plane".to_string(), table), word("extension", extension)]
            };
            let mut cases = vec![full(0.3, 10.0), full(0.8, 20.0)];
            cases.extend([0.2, 0.5].map(|width| plane(width, "half_angle")));
            cases.push(plane(0.4, "cosine"));
            cases
        }
        "mix" => {
            let part = |weight: f64, model: &str, given: Given| Component {
                weight,
                model: model.to_string(),
                args: Args::new(&given::model(model).info, given),
            };
            let matt = |weight| part(weight, "ideal", vec![constant("diffuse", 0.6)]);
            let gloss = |weight: f64, m: f64| {
                part(
                    weight,
                    "phong",
                    vec![constant("diffuse", 0.1), constant("specular", 0.6), constant("exponent", m)],
                )
            };
            let mirror = |weight| part(weight, "ideal", vec![constant("specular", 0.9)]);
            let metal = |weight: f64, m: f64| part(weight, "ggx", with(&metal(), vec![constant("roughness", m)]));
            let leaf = |weight| part(weight, "leaf", vec![constant("diffuse", 0.4), constant("transmittance", 0.4)]);
            let of = |parts: Vec<Component>| vec![("weights".to_string(), Value::Mixture(parts))];
            let nested = Component {
                weight: 0.4,
                model: "mix".into(),
                args: Args::new(&given::model("mix").info, of(vec![matt(0.3), mirror(0.7)])),
            };
            vec![
                of(vec![matt(0.5), gloss(0.5, 100.0)]),
                of(vec![mirror(0.2), matt(0.5), metal(0.3, 0.3)]),
                of(vec![leaf(0.7), gloss(0.2, 10.0)]),
                of(vec![metal(0.5, 0.05), metal(0.5, 0.5)]),
                of(vec![nested, matt(0.1), gloss(0.3, 1e4)]),
            ]
        }
        "leaf" => vec![
            vec![constant("diffuse", 0.5), constant("transmittance", 0.5)],
            vec![ramp("reflectance", 0.05, 0.45), ramp("transmittance", 0.02, 0.5)],
            vec![constant("diffuse", 0.4), constant("transmittance", 0.0)],
            vec![constant("diffuse", 0.0), constant("transmittance", 0.9)],
            vec![constant("diffuse", 0.9), constant("transmittance", 0.01)],
        ],
        other => panic!("no case for `{other}`"),
    }
}

fn hold(model: &str) {
    let all: usize = BUILTIN.iter().map(|model| cases(model.info.name).len()).sum();
    let samples = std::env::var("SUNGLINT_SAMPLES").ok().and_then(|n| n.parse().ok()).unwrap_or(100_000);
    let options = Options { models: all, samples, ..Options::default() };
    let mut faults = Vec::new();
    for given in cases(model) {
        let label = format!("{model} {given:?}");
        let bound = bind(model, given.clone()).unwrap_or_else(|error| panic!("{label}: {error}"));
        let mut report = check(&*bound, grid().len(), &options);
        let finer = SpectralGrid::from_edges(&[0.5, 0.57, 0.6, 0.7]);
        report.findings.extend(spectral_consistency(&finer, |grid| bind_on(model, given.clone(), grid)));
        println!("{label}\n{:?}\n{report}", bound.claims());
        if !report.passed() {
            faults.push(format!("{label}\n{:?}\n{report}", bound.claims()));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

macro_rules! models {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            hold(stringify!($name));
        })*

        #[test]
        fn every_registered_model_is_held() {
            let held = [$(stringify!($name)),*];
            for model in BUILTIN {
                assert!(held.contains(&model.info.name), "{}", model.info.name);
            }
        }
    };
}

models! {
    ideal split total_diffuse phong blinn_phong torrance_sparrow cook_torrance he_torrance maxwell_beard ward ggx
    rough_conductor oren_nayar rpv ross_li hapke measured leaf mix
}

/// A value for one band only is a value.
#[test]
fn a_per_band_value_binds() {
    let per_band = SpectralValue::PerBand(vec![("red".to_string(), 0.2)]);
    let bin = sunglint_radiometry::Bin { lower: 0.6, upper: 0.7, band: Some(0) };
    let grid = SpectralGrid::new(vec![bin], vec!["red".to_string()]);
    let given =
        vec![constant("diffuse", 0.1), constant("specular", 0.1), ("exponent".to_string(), Value::Spectrum(per_band))];
    assert!(bind_on("phong", given, &grid).is_ok());
}
