use super::*;
use crate::scans::Reading;
use crate::two_component::TwoComponent;
use crate::{AngularSpectra, BUILTIN, Lobes, Sample, Split, SplitFit, SplitOptions, TopHat, fit_split};
use std::sync::Arc;
use sunglint_plugin::{Args, SpectralValue, Value};
use sunglint_radiometry::SpectralGrid;

fn band() -> GoniometerBand {
    GoniometerBand { band: ScanBand::All, weights: vec![(0, 1.0)] }
}

fn surface(diffuse: f64, specular: f64, solid_angle: f64) -> TwoComponent {
    let [diffuse, specular] = [diffuse, specular].map(|value| AngularSpectra::constant(vec![value]));
    TwoComponent::new(Split { diffuse, printed: specular.clone(), specular, solid_angle: vec![solid_angle] })
}

fn scan(goniometer: &Goniometer, bsdf: &dyn Bsdf) -> Scans {
    goniometer.scan(bsdf, 1, &[band()]).unwrap_or_else(|faults| panic!("{faults}"))
}

fn fit(scans: &Scans) -> SplitFit {
    fit_split(scans, SplitOptions::default()).unwrap_or_else(|faults| panic!("{faults}"))
}

fn phong(diffuse: f64, specular: f64, exponent: f64) -> Arc<dyn Bsdf> {
    let model = BUILTIN.iter().find(|model| model.info.name == "phong").expect("a model");
    let constant = |name: &str, value| (name.to_string(), Value::Spectrum(SpectralValue::Constant(value)));
    let exponent = constant("exponent", exponent);
    let args = Args::new(&model.info, [constant("diffuse", diffuse), constant("specular", specular), exponent]);
    (model.bind)(&args, &SpectralGrid::from_edges(&[0.5, 0.6])).unwrap_or_else(|error| panic!("{error:?}"))
}

/// A Lambertian sample reads ρ at every angle, through any aperture and from any source, so R_d = ρ and R_s = 0 to the last
/// bit, and nothing is clamped.
#[test]
fn a_lambertian_sample_has_r_d_equal_to_rho_and_no_r_s() {
    for (solid_angle, source_radius) in [(1.9e-3, 0.0), (0.3, 0.0), (PI, 0.0), (0.05, 0.03)] {
        for rho in [0.18, 0.7, 1.0 / 3.0] {
            let goniometer = Goniometer { solid_angle, source_radius, retro: true, ..Goniometer::default() };
            let split = fit(&scan(&goniometer, &surface(rho, 0.0, 0.0)));
            let band = &split.bands[0];
            let read = band.diffuse[0].value;
            assert!((read / rho - 1.0).abs() < 1e-14, "{rho} {read}");
            for row in &band.rows {
                assert!((row.diffuse / read - 1.0).abs() < 1e-14 && row.specular == 0.0 && row.peak == 0.0, "{row:?}");
            }
            assert!(band.specular.iter().all(|node| node.clamped.is_none() && node.value < 1e-14));
            assert!(solid_angle > 0.1 || source_radius > 0.0 || read == rho, "{rho} {read}");
        }
    }
}

/// A mirror reads π ρ/(Ω cos θ) in its direction and 0 elsewhere: ρ_s = ρ.
#[test]
fn a_mirror_reads_its_reflectance_over_the_projected_aperture() {
    let goniometer = Goniometer { solid_angle: 4e-3, ..Goniometer::default() };
    let scans = scan(&goniometer, &surface(0.0, 0.85, 0.0));
    for reading in scans.readings() {
        let theta = scans.illuminations()[reading.illumination];
        let expected = if scans.is_specular(reading) { PI * 0.85 / (4e-3 * theta.cos()) } else { 0.0 };
        assert!((reading.brf - expected).abs() <= 1e-12 * expected, "{reading:?} {expected}");
    }
    let rows = &fit(&scans).bands[0].rows;
    assert!(rows.iter().filter(|row| row.theta < 1.31).all(|row| (row.specular / 0.85 - 1.0).abs() < 1e-12));
}

/// Lambert and a top-hat lobe of the aperture's own solid angle come back: the whole lobe is in the aperture, whose
/// projected solid angle is Ω cos θ. Through a smaller aperture the lobe's height is read, R_s, at which ρ_s is that of the
/// aperture and not of the lobe.
#[test]
fn a_mixture_of_known_components_comes_back() {
    let mut worst = 0.0f64;
    for solid_angle in [3e-4, 1.9e-3, 0.02] {
        let goniometer = Goniometer { solid_angle, ..Goniometer::default() };
        let sample = surface(0.3, 0.2, solid_angle);
        for row in &fit(&scan(&goniometer, &sample)).bands[0].rows {
            assert!((row.diffuse - 0.3).abs() < 1e-9, "{solid_angle} {row:?}");
            let expected = if row.theta < 1.31 { 0.2 } else { row.specular };
            assert!((row.specular - expected).abs() < 1e-9, "{solid_angle} {row:?}");
        }
        let narrow = Goniometer { solid_angle: 0.25 * solid_angle, ..Goniometer::default() };
        for node in &fit(&scan(&narrow, &sample)).bands[0].specular {
            // f cos θ_o is even over the lobe, f is not: the mean of 1/cos θ_o over the cone differs by its square.
            let expected = 0.2 * PI / (solid_angle * node.theta.cos());
            worst = worst.max((node.value / expected - 1.0).abs() / solid_angle);
            assert!((node.value / expected - 1.0).abs() < 0.1 * solid_angle, "{solid_angle} {node:?}");
        }
    }
    println!("worst departure of a height, of the lobe's solid angle: {worst:.1e}");
}

/// An aperture whose cone of half-angle a stands off the cone A of the lobe by δ sees the share of it that two caps of a
/// sphere have in common, here for small caps: the lens of two circles in the plane.
#[test]
fn a_sharp_edge_across_the_aperture_is_integrated() {
    let (lobe, solid_angle) = (3e-3, 2e-3);
    let (a, big) = ((solid_angle / PI).sqrt().asin(), TopHat::new(lobe).half_angle());
    let sample = surface(0.0, 0.5, lobe);
    let mut worst = 0.0f64;
    for offset in [0.0, 0.1, 0.4, 0.9, 1.2, 1.7, 2.5] {
        let delta = offset * a;
        let view = -(0.4 + delta);
        let goniometer =
            Goniometer { illuminations: vec![0.4], views: vec![view], solid_angle, ..Goniometer::default() };
        let read = scan(&goniometer, &sample).readings()[0].brf;
        let lens = match () {
            () if delta >= a + big => 0.0,
            () if delta <= big - a => PI * a * a,
            () => {
                let part = |r: f64, s: f64| {
                    let x = (delta * delta + r * r - s * s) / (2.0 * delta);
                    r * r * (x / r).acos() - x * (r * r - x * x).sqrt()
                };
                part(a, big) + part(big, a)
            }
        };
        // f cos θ_o = ρ_s/Ω_lobe over the lobe, clear of the horizon.
        let expected = PI * 0.5 / lobe * lens / (PI * a * a * view.cos());
        worst = worst.max((read - expected).abs() / (PI * 0.5 / lobe));
        assert!((read - expected).abs() < 2e-3 * (PI * 0.5 / lobe), "{offset}: {read} {expected}");
    }
    println!("worst departure of a cut lobe, of the whole: {worst:.1e}");
}

/// A lobe eighty times narrower than the aperture is found whole: of Phong's, k (m+2)/2π cos^m α, ∫ f cos θ_o dω = k cos θ
/// about an axis at θ but for e^(−m a²/2) of it, 1e-14, beyond the aperture; so π k/Ω is read.
#[test]
fn a_narrow_lobe_is_found_whole() {
    let mut worst = 0.0f64;
    for exponent in [1e4, 1e5, 1e6] {
        let goniometer = Goniometer { solid_angle: 0.02, ..Goniometer::default() };
        let scans = goniometer.scan(&*phong(0.0, 0.4, exponent), 2, &[band()]).expect("scans");
        for reading in scans.readings().iter().filter(|reading| scans.is_specular(reading)) {
            let expected = PI * 0.4 / 0.02;
            worst = worst.max((reading.brf / expected - 1.0).abs());
            assert!((reading.brf / expected - 1.0).abs() < 1e-7, "{exponent} {} {expected}", reading.brf);
        }
        let beside = scans.readings().iter().filter(|reading| !scans.is_specular(reading));
        assert!(beside.map(|reading| reading.brf).fold(0.0, f64::max) < 1e-12);
    }
    println!("worst departure of a narrow lobe: {worst:.1e}");
}

/// A mirror shows the source's image: where its radius exceeds the aperture's, the aperture takes their share in area.
#[test]
fn a_wide_source_is_cut_by_the_aperture() {
    let goniometer = Goniometer {
        solid_angle: 1e-3,
        source_radius: 0.03,
        illuminations: vec![0.3, 1.0],
        views: vec![-0.3, -1.0],
        ..Goniometer::default()
    };
    let scans = scan(&goniometer, &surface(0.1, 0.5, 0.0));
    let image = PI * 0.03f64.sin().powi(2);
    let mut worst = 0.0f64;
    for reading in scans.readings().iter().filter(|reading| scans.is_specular(reading)) {
        let theta = scans.illuminations()[reading.illumination];
        let expected = 0.1 + PI * 0.5 / (image * theta.cos());
        // The edge of the aperture across the source's even radiance, by cells of 1/32: 1 % of what it lets through.
        worst = worst.max((reading.brf / expected - 1.0).abs());
        assert!((reading.brf / expected - 1.0).abs() < 0.01, "{} {expected}", reading.brf);
    }
    println!("worst departure of a cut image: {worst:.1e}");
}

/// Angles as the proposal has them: 5 × 10, with the five against the light blocked, and 90° left out.
#[test]
fn the_proposals_angle_set_is_scanned() {
    let scans = scan(&Goniometer::default(), &surface(0.2, 0.0, 0.0));
    assert_eq!((scans.illuminations().len(), scans.views().len(), scans.readings().len()), (5, 10, 45));
    let report = scans.report();
    assert_eq!((report.gaps.count, report.no_specular.len(), report.retro.len()), (0, 0, 0));
    let open = Goniometer { retro: true, ..Goniometer::default() };
    assert_eq!(scan(&open, &surface(0.2, 0.0, 0.0)).readings().len(), 50);
}

/// The stated uncertainty is honest: over many seeds R_d and R_s lie within two standard errors of what they are without
/// noise in 95.45 % of cases, as Gaussian errors do, to 3.5 standard deviations of the binomial count.
#[test]
fn two_standard_errors_hold_what_noise_does() {
    let clean = scan(&Goniometer::default(), &surface(0.3, 0.02, 1.9e-3));
    let truth = fit(&clean);
    for (relative, absolute, repeats) in [(0.01, 0.001, 1), (0.05, 0.0, 4), (0.0, 0.01, 1)] {
        let (mut inside, mut count) = ([0.0; 2], 0.0);
        for seed in 0..2000 {
            let noise = ReadingNoise { relative, absolute };
            let noisy = Goniometer { noise, repeats, seed, ..Goniometer::default() };
            let found = fit(&noisy.noisy(&clean).expect("scans"));
            let (truth, found) = (&truth.bands[0], &found.bands[0]);
            for k in 0..truth.diffuse.len() {
                let (d, s) = (&found.diffuse[k], &found.specular[k]);
                let errors = [
                    (d.value - truth.diffuse[k].value, d.standard_error),
                    (s.value - truth.specular[k].value, s.standard_error),
                ];
                for (inside, (error, u)) in inside.iter_mut().zip(errors) {
                    *inside += f64::from(u8::from(error.abs() <= 2.0 * u.expect("an error")));
                }
                count += 1.0;
            }
        }
        let gaussian = 0.954_499_7_f64;
        let deviation = 3.5 * (gaussian * (1.0 - gaussian) / count).sqrt();
        for inside in inside {
            let share: f64 = inside / count;
            println!("{relative} {absolute} {repeats}: {share}");
            assert!(share >= 0.95 && (share - gaussian).abs() < deviation, "{relative} {absolute}: {share}");
        }
    }
}

/// The same seed gives the same noise whatever is scanned beside; another seed another.
#[test]
fn noise_belongs_to_a_seed_and_a_place() {
    let noise = ReadingNoise { relative: 0.01, absolute: 0.001 };
    let noisy = |seed| scan(&Goniometer { noise, seed, ..Goniometer::default() }, &surface(0.3, 0.0, 0.0));
    assert_eq!(noisy(1), noisy(1));
    assert_ne!(noisy(1), noisy(2));
    let values: Vec<f64> = noisy(7).readings().iter().map(|reading: &Reading| reading.brf).collect();
    assert!(values.windows(2).all(|pair| pair[0] != pair[1]));
    assert!(noisy(7).readings().iter().all(|r| (r.stddev.expect("an error") - 0.003f64.hypot(0.001)).abs() < 1e-12));
}

#[test]
fn what_no_instrument_does_is_told() {
    let cases = [
        (Goniometer { illuminations: vec![FRAC_PI_2], ..Goniometer::default() }, "below 90 deg"),
        (Goniometer { views: vec![f64::NAN], ..Goniometer::default() }, "within -90..90 deg"),
        (Goniometer { views: vec![], ..Goniometer::default() }, "needs angles"),
        (Goniometer { solid_angle: 4.0, ..Goniometer::default() }, "aperture of 4 sr"),
        (Goniometer { source_radius: -0.1, ..Goniometer::default() }, "radius -0.1"),
        (Goniometer { repeats: 0, ..Goniometer::default() }, "0 repeats"),
        (Goniometer { noise: ReadingNoise { relative: -0.1, absolute: 0.0 }, ..Goniometer::default() }, "noise"),
        (Goniometer { views: vec![0.1; 1_000_000], ..Goniometer::default() }, "at most 1000000"),
    ];
    for (goniometer, expected) in cases {
        let told = goniometer.scan(&surface(0.2, 0.0, 0.0), 1, &[band()]).expect_err(expected).to_string();
        assert!(told.contains(expected), "{told}");
    }
    let far = GoniometerBand { band: ScanBand::All, weights: vec![(3, 1.0)] };
    assert!(Goniometer::default().scan(&surface(0.2, 0.0, 0.0), 1, &[far]).is_err());
}

/// Directions in which a surface is asked lie above it, and a lobe that is not there costs no ring.
#[test]
fn a_surface_is_asked_above_its_horizon_only() {
    struct Watched(TwoComponent);
    impl Bsdf for Watched {
        fn lobes(&self) -> Lobes {
            self.0.lobes()
        }
        fn split(&self) -> &Split {
            self.0.split()
        }
        fn eval(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
            assert!(incident.cos() > 0.0 && outgoing.cos() > 0.0 && (outgoing.vec().length() - 1.0).abs() < 1e-12);
            self.0.eval(incident, outgoing, f);
        }
        fn sample(&self, outgoing: LocalDir, u: [f64; 3]) -> Option<Sample> {
            self.0.sample(outgoing, u)
        }
        fn pdf(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
            self.0.pdf(incident, outgoing)
        }
        fn albedo(&self, incident: LocalDir, rho: &mut [f64]) {
            self.0.albedo(incident, rho);
        }
    }
    for solid_angle in [1e-3, 1.0, PI] {
        for source_radius in [0.0, 0.4] {
            let illuminations = vec![0.0, 1.5];
            let views = vec![-1.57, -0.2, 0.0, 1.57];
            let goniometer =
                Goniometer { solid_angle, source_radius, illuminations, views, retro: true, ..Goniometer::default() };
            scan(&goniometer, &Watched(surface(0.2, 0.1, 0.0)));
        }
    }
}
