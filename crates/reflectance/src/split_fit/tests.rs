use super::*;
use crate::scans::Measurement;
use crate::{BUILTIN, Bsdf};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;
use sunglint_plugin::{Args, BindError, Table, TableKey, Value};
use sunglint_radiometry::{Bin, LocalDir, SpectralGrid, Wavelength};

const ANGLES: [f64; 5] = [8.0, 30.0, 45.0, 60.0, 75.0];

/// The proposal's angles without the retro pairs, values by (band, i, v) in degrees.
fn scans_of(bands: &[ScanBand], brf: impl Fn(usize, f64, f64) -> f64, stddev: Option<f64>) -> Scans {
    let mut measurements = Vec::new();
    for (b, band) in bands.iter().enumerate() {
        for i in ANGLES {
            for v in ANGLES.into_iter().flat_map(|v| [v, -v]).filter(|v| *v != i) {
                let [illumination, view] = [i, v].map(f64::to_radians);
                let brf = brf(b, i, v);
                measurements.push(Measurement { band: band.clone(), illumination, view, brf, stddev, line: None });
            }
        }
    }
    Scans::new(measurements, Some(1.9e-3)).expect("scans")
}

/// Some sample whose lobe grows towards grazing and whose body depends on everything.
fn sample(band: usize, i: f64, v: f64) -> f64 {
    let body = 0.2 + 0.1 * band as f64 + 0.0005 * (i - 40.0) + 0.0007 * v.abs() + 0.0001 * v;
    let peak = if v == -i { 2.0 + 0.02 * i + (i / 30.0).powi(3) } else { 0.0 };
    body + peak
}

fn fit(scans: &Scans, options: SplitOptions) -> SplitFit {
    fit_split(scans, options).unwrap_or_else(|faults| panic!("{faults}"))
}

fn all() -> Vec<SplitOptions> {
    let rules = [Grazing::Fresnel, Grazing::Hold];
    let ways = [Interpolation::Linear, Interpolation::Pchip];
    rules.into_iter().flat_map(|grazing| ways.map(|interpolation| SplitOptions { grazing, interpolation })).collect()
}

/// Binds the table of a fit as a scene's reader would hand it over.
fn bound(fit: &SplitFit, column: SpecularColumn, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let text = fit.to_csv(column);
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let at = |name: &str| header.iter().position(|known| *known == name);
    let cells: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let number = |row: &[&str], name: &str| row[at(name).expect(name)].parse::<f64>().expect("a number");
    let key = match (at("band"), at("wavelength_nm")) {
        (Some(band), _) => TableKey::Band(cells.iter().map(|row| row[band].to_string()).collect()),
        (_, Some(_)) => TableKey::Wavelength(cells.iter().map(|row| number(row, "wavelength_nm") * 1e-3).collect()),
        _ => TableKey::None,
    };
    let rows = (cells.iter())
        .map(|row| vec![number(row, "view_zenith_deg").to_radians(), number(row, "diffuse"), number(row, "specular")]);
    let model = BUILTIN.iter().find(|model| model.info.name == "split").expect("a model");
    let grazing = if fit.options.grazing == Grazing::Hold { "hold" } else { "fresnel" };
    let specular = if column == SpecularColumn::Brf { "brf" } else { "reflectance" };
    let word = |name: &str, word: &str| (name.to_string(), Value::Word(word.to_string()));
    let args = [
        ("table".to_string(), Value::Table(Table { key, rows: rows.collect() })),
        ("solid_angle".to_string(), Value::Number(fit.solid_angle)),
        word("grazing", grazing),
        word("specular", specular),
    ];
    (model.bind)(&Args::new(&model.info, args), grid)
}

/// R_d is the mean of the nine values that are not the mirror's (eight, the pair against the light blocked), R_s what the
/// mirror's value has above it.
#[test]
fn the_components_are_the_means_and_what_the_peak_has_above_them() {
    let scans = scans_of(&[ScanBand::All], sample, None);
    for options in all() {
        let band = &fit(&scans, options).bands[0];
        assert_eq!((band.diffuse.len(), band.specular.len()), (5, 5));
        for ((node, peak), t) in band.diffuse.iter().zip(&band.specular).zip(ANGLES) {
            let places = ANGLES.into_iter().flat_map(|i| [(i, t), (i, -t)]).filter(|(i, _)| *i != t);
            let values: Vec<f64> = places.map(|(i, v)| sample(0, i, v)).collect();
            assert_eq!((values.len(), node.count), (8, 8));
            assert!((node.value - values.iter().sum::<f64>() / 8.0).abs() < 1e-15);
            let spread = values.iter().map(|value| (value - node.value).powi(2)).sum::<f64>() / 7.0;
            assert!((node.spread.expect("a spread") - spread.sqrt()).abs() < 1e-15);
            assert!((node.value + peak.value - sample(0, t, -t)).abs() < 1e-14 && peak.has_diffuse);
            let row = band.rows.iter().find(|row| row.support == Support::Measured && row.theta == node.theta);
            let row = row.expect("a row at each measured angle");
            assert_eq!(row.diffuse, node.value);
            assert!((row.peak / peak.value - 1.0).abs() < 1e-14);
            assert!((row.specular / (peak.value * 1.9e-3 * node.theta.cos() / PI) - 1.0).abs() < 1e-14);
        }
        let degrees: Vec<f64> = band.rows.iter().map(|row| rounded(row.theta.to_degrees())).collect();
        assert_eq!(degrees, (0..=90).map(f64::from).collect::<Vec<_>>());
        assert_eq!(band.rows.iter().filter(|row| row.support == Support::Measured).count(), 5);
        // Down to 0° the first values of R_d and ρ_s hold.
        assert_eq!((band.rows[0].diffuse, band.rows[0].specular), (band.rows[8].diffuse, band.rows[8].specular));
    }
}

/// The value against the light is the ninth where it is there.
#[test]
fn the_pair_against_the_light_counts_where_it_is_seen() {
    let mut measurements: Vec<Measurement> = scans_of(&[ScanBand::All], sample, None).measurements().collect();
    measurements.push(Measurement { view: 30f64.to_radians(), brf: 9.2, ..measurements[8].clone() });
    assert_eq!(measurements.last().map(|m| m.illumination), Some(8f64.to_radians()));
    measurements.last_mut().expect("one").illumination = 30f64.to_radians();
    let scans = Scans::new(measurements, Some(1.9e-3)).expect("scans");
    assert_eq!(scans.report().retro.len(), 1);
    let node = fit(&scans, SplitOptions::default()).bands[0].diffuse[1];
    assert!(node.count == 9 && node.value > 1.2);
}

/// Twice the reflectance factors, twice both components.
#[test]
fn components_scale_with_the_scans() {
    let once = fit(&scans_of(&[ScanBand::All], sample, None), SplitOptions::default());
    let twice = fit(&scans_of(&[ScanBand::All], |b, i, v| 2.0 * sample(b, i, v), None), SplitOptions::default());
    for (a, b) in once.bands[0].rows.iter().zip(&twice.bands[0].rows).filter(|(a, _)| a.theta < 1.31) {
        assert!((b.diffuse / a.diffuse - 2.0).abs() < 1e-14 && (b.peak / a.peak - 2.0).abs() < 1e-14);
    }
}

/// What the model `split` makes of the table is the fit itself: R_d and ρ_s at every angle from 0 to 90°, R_d + R_s as f in
/// the mirror direction, whatever the rule, the curve, the column and the key.
#[test]
fn the_table_read_back_is_the_fit() {
    let bin = |lower, upper, band| Bin { lower, upper, band };
    let named = |name: &str| ScanBand::Named(name.to_string());
    let wavelength = |um| ScanBand::Wavelength(Wavelength::from_um(um));
    let cases = [
        (vec![ScanBand::All], SpectralGrid::new(vec![bin(0.5, 0.6, None)], vec![])),
        (
            vec![named("red"), named("nir")],
            SpectralGrid::new(
                vec![bin(0.6, 0.7, Some(0)), bin(0.7, 0.9, Some(1))],
                vec!["red".to_string(), "nir".to_string()],
            ),
        ),
        // A straight line between the two wavelengths, seen close to each.
        (
            vec![wavelength(0.5), wavelength(0.9)],
            SpectralGrid::new(vec![bin(0.5, 0.5 + 1e-13, None), bin(0.9 - 1e-13, 0.9, None)], vec![]),
        ),
    ];
    let mut worst = [0.0f64; 2];
    for (bands, grid) in cases {
        let scans = scans_of(&bands, sample, Some(0.001));
        for options in all() {
            let fit = fit(&scans, options);
            assert!(fit.is_sound());
            for column in [SpecularColumn::Brf, SpecularColumn::Reflectance] {
                let model = bound(&fit, column, &grid).unwrap_or_else(|error| panic!("{error:?}"));
                let split = model.split();
                for (b, band) in fit.bands.iter().enumerate() {
                    let entry = 2 * b;
                    for row in &band.rows {
                        let [r_d, rho_s, r_s] =
                            [&split.diffuse, &split.specular, &split.printed].map(|of| of.at(row.theta, entry));
                        let stated = if column == SpecularColumn::Brf { row.peak } else { row.specular };
                        for (a, b) in [(r_d, row.diffuse), (rho_s, row.specular), (r_s, stated)] {
                            worst[0] = worst[0].max((a / b - 1.0).abs());
                        }
                    }
                    for (node, t) in band.specular.iter().zip(ANGLES) {
                        let outgoing = LocalDir::from_polar(t.to_radians(), 0.7);
                        let mut f = vec![0.0; grid.len()];
                        model.eval(outgoing.mirrored(), outgoing, &mut f);
                        worst[1] = worst[1].max((PI * f[entry] / node.brf - 1.0).abs());
                        assert!((node.brf / sample(b, t, -t) - 1.0).abs() < 1e-14);
                    }
                }
            }
        }
    }
    println!("worst relative departure: components {:.1e}, f in the mirror direction {:.1e}", worst[0], worst[1]);
    assert!(worst.iter().all(|worst| *worst < 1e-12), "{worst:?}");
}

/// By hand: σ of 0.01 at eight values gives R_d 0.01/√8, and R_s √(1 + 1/8) 0.01; unstated, the pooled scatter stands for it.
#[test]
fn the_stated_errors_are_those_of_the_definitions() {
    let stated = &fit(&scans_of(&[ScanBand::All], sample, Some(0.01)), SplitOptions::default()).bands[0];
    assert_eq!(stated.noise, Noise::Stated);
    for (d, s) in stated.diffuse.iter().zip(&stated.specular) {
        assert!((d.standard_error.expect("one") - 0.01 / 8f64.sqrt()).abs() < 1e-15);
        assert!((s.standard_error.expect("one") - 0.01 * 1.125f64.sqrt()).abs() < 1e-15);
        assert!((d.spread_error().expect("one") - d.spread.expect("one") / 8f64.sqrt()).abs() < 1e-15);
    }
    let row = &stated.rows[52];
    assert!((row.diffuse_error.expect("one") - 0.01 / 8f64.sqrt()).abs() < 1e-15);
    let unstated = &fit(&scans_of(&[ScanBand::All], sample, None), SplitOptions::default()).bands[0];
    let mean_square = unstated.diffuse.iter().map(|node| node.spread.expect("one").powi(2)).sum::<f64>() / 5.0;
    let Noise::Pooled(scatter) = unstated.noise else { panic!("{:?}", unstated.noise) };
    assert!((scatter - mean_square.sqrt()).abs() < 1e-15);
    assert!((unstated.specular[2].standard_error.expect("one") - scatter * 1.125f64.sqrt()).abs() < 1e-15);
    // One value at each angle: nothing to hold against each other.
    let few: Vec<Measurement> = scans_of(&[ScanBand::All], sample, None)
        .measurements()
        .filter(|m| m.illumination < 0.2 && m.view < 0.0)
        .collect();
    let few = &fit(&Scans::new(few, Some(1.9e-3)).expect("scans"), SplitOptions::default()).bands[0];
    assert_eq!((few.noise, few.diffuse.len(), few.specular.len()), (Noise::Unknown, 4, 1));
    assert!(few.rows.iter().all(|row| row.diffuse_error.is_none()));
    // R_d at 8° is the curve's, held from 30°; ρ_s goes from 8° on by the rule, R_d where it was measured.
    assert!(!few.specular[0].has_diffuse && (few.rows[8].diffuse - sample(0, 8.0, -30.0)).abs() < 1e-15);
    assert!((few.rows[60].diffuse - sample(0, 8.0, -60.0)).abs() < 1e-15);
    let fresnel = |degree: f64| crate::fresnel_dielectric(1.5, degree.to_radians().cos());
    assert!((few.rows[60].specular / few.rows[8].specular / (fresnel(60.0) / fresnel(8.0)) - 1.0).abs() < 1e-12);
}

/// A mirror value below R_d is clamped and told.
#[test]
fn a_peak_below_the_rest_is_clamped_and_told() {
    let shy = |b, i, v| if v == -45.0 && i == 45.0 { 0.1 } else { sample(b, i, v) };
    let scans = scans_of(&[ScanBand::All], shy, None);
    let node = fit(&scans, SplitOptions::default()).bands[0].specular[2];
    assert_eq!(node.value, 0.0);
    assert!(node.clamped.is_some_and(|below| below < -0.1));
    assert!(bound(&fit(&scans, all()[1]), SpecularColumn::Brf, &SpectralGrid::from_edges(&[0.5, 0.6])).is_ok());
}

/// A sample that returns more than it gets is told, with the angles; the model refuses its table.
#[test]
fn what_returns_more_than_it_gets_is_told() {
    let white = scans_of(&[ScanBand::All], |_, i, v| if v == -i { 1.3 } else { 0.9 + 0.002 * v.abs() }, None);
    let white = fit(&white, SplitOptions::default());
    assert!(!white.is_sound());
    assert!(white.bands[0].excesses.iter().all(|excess| excess.theta.to_degrees() > 49.9 && !excess.in_the_mean));
    assert!(bound(&white, SpecularColumn::Brf, &SpectralGrid::from_edges(&[0.5, 0.6])).is_err());
    let mirror = scans_of(&[ScanBand::All], |_, i, v| if v == -i { 1700.0 / (i / 57.3).cos() } else { 0.0 }, None);
    let mirror = fit(&mirror, SplitOptions::default());
    assert!(mirror.bands[0].excesses.iter().any(|excess| excess.to_string().contains("exceeds 1 by 0.02")));
}

#[test]
fn scans_that_cannot_be_split_are_told() {
    let scans = scans_of(&[ScanBand::Named("red".into()), ScanBand::Named("nir".into())], sample, None);
    let told = |keep: &dyn Fn(&Measurement) -> bool, solid_angle| {
        let scans = Scans::new(scans.measurements().filter(|m| keep(m)), solid_angle).expect("scans");
        fit_split(&scans, SplitOptions::default()).expect_err("no split").to_string()
    };
    assert!(told(&|_| true, None).contains("the solid angle of the instrument's aperture is not stated; without it"));
    assert!(told(&|_| true, Some(1e-5)).contains("smaller than the sun's disk"));
    let mirror = |m: &Measurement| m.view == -m.illumination;
    let both = told(&|m| !mirror(m), Some(1.9e-3));
    assert!(both.contains("of band `red` have no value in the mirror direction") && both.contains("of band `nir`"));
    assert!(told(&mirror, Some(1.9e-3)).contains("no value outside the mirror direction"));
    let one = told(&|m| !mirror(m) || m.band == ScanBand::Named("red".into()), Some(1.9e-3));
    assert_eq!(one.lines().count(), 1);
}

/// At 90° a BRF tells no reflectance: such a row of a table leaves ρ_s to the rule, and takes R_d.
#[test]
fn a_row_of_brf_at_ninety_degrees_leaves_the_lobe_to_the_rule() {
    let fit = fit(&scans_of(&[ScanBand::All], sample, None), SplitOptions::default());
    let last = fit.bands[0].rows.last().expect("rows");
    assert_eq!(last.theta, FRAC_PI_2);
    let growth = last.specular / fit.bands[0].rows[75].specular;
    // F(90°)/F(75°) = 1/0.25308 for index 1.5.
    assert!((growth - 1.0 / 0.253_08).abs() < 1e-3);
    let grid = SpectralGrid::from_edges(&[0.5, 0.6]);
    let model = bound(&fit, SpecularColumn::Brf, &grid).expect("a sound table");
    assert!((model.split().specular.at(FRAC_PI_2, 0) / last.specular - 1.0).abs() < 1e-12);
}
