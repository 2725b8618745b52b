//! Scanners and detectors through the whole path, against closed forms.

use std::f64::consts::PI;

use sunglint::{Frames, Options, Plan};

use crate::pose::{assert_exact, pixels, scene, text};

/// Sun at 30° from the zenith in the south, no air, E₀ = 1850 W m⁻² µm⁻¹.
const BARE: &str = "collect { sun zenith 30 deg azimuth 180 deg }
    atmosphere none { solar_irradiance 1850 W/m2/um }
    experiment e { samples 16 }\n";

/// L = ρ E₀ cos 30°/π.
fn lambert(rho: f64) -> f64 {
    rho * 1850.0 * 30f64.to_radians().cos() / PI
}

/// A truth map, by pixel.
fn truth(frames: &Frames, map: usize, x: u32, y: u32) -> f64 {
    f64::from(frames.truth[map][(y * frames.width + x) as usize])
}

/// Whatever a scanner is and however it looks, a level Lambert plane returns ρ E₀ cos θ/π in every pixel of every line.
#[test]
fn a_lambert_plane_is_uniform_under_a_moving_scanner() {
    for looking in [
        "projection pushbroom, heading 37 deg",
        "projection pushbroom, heading 200 deg, depression 60 deg, roll 5 deg",
        "projection whiskbroom, depression 110 deg",
    ] {
        let plan = text(&format!(
            "{BARE} material grey {{ ideal {{ diffuse 0.35 }} }}\nground grey
            sensor eye {{ {looking}, position (100 50 800) m, speed 70 m/s, line_rate 20 Hz, field_of_view 40 deg,
                        pixels 40 x 70, band b 500..600 nm }}"
        ));
        let frames = plan.runs()[0].render();
        assert_exact(looking, pixels(&frames, 0).into_iter().map(|(l, _)| (l, lambert(0.35))));
    }
}

/// In hazy air too every line of a level flight over level ground is the first line again: τ₂ and L_u follow the sensor. The
/// flight is 40 times as long as it is high, so that paths to the first position would be far too long.
#[test]
fn path_terms_follow_the_sensor() {
    let plan = text(
        "site { latitude 43.084 deg, longitude -77.674 deg, elevation 168 m }
        collect { at 1992-06-18 12:00 -04:00 }
        weather { visibility 8 km }
        material grey { ideal { diffuse 0.2 } }
        ground grey
        sensor eye { projection pushbroom, position (0 0 2000) m, speed 100 m/s, line_rate 0.1 Hz, field_of_view 30 deg,
                   pixels 24 x 80, band b 450..500 nm }
        experiment e { samples 16 }",
    );
    let run = &plan.runs()[0];
    let frames = run.render();
    let image = &frames.frames[0].radiance[0];
    // Samples of a pixel fall elsewhere in each line: over 0.022 rad the path varies by far less than this.
    let pairs = (24..24 * 80).map(|i| (f64::from(image[i]), f64::from(image[i % 24])));
    for (found, first) in pairs {
        assert!((found / first - 1.0).abs() < 2e-3, "{found} {first}");
    }
    for (x, y) in [(0, 0), (23, 79), (11, 40)] {
        let theta = ((f64::from(x) + 0.5 - 12.0) / 12.0 * 15f64.to_radians().tan()).atan();
        assert!((truth(&frames, 6, x, y) / (2000.0 / theta.cos()) - 1.0).abs() < 1e-6, "range of {x},{y}");
    }
    assert!(run.estimators.iter().any(|line| line.contains("80 lines") && line.contains("the sun moves by")));
}

/// Lines 0.5 m apart, the first about y = 0: an edge at y = 50.25 m lies between lines 100 and 101; and flying north, x runs
/// to the west.
#[test]
fn an_edge_on_the_ground_lies_between_its_lines() {
    let plan = text(&format!(
        "{BARE} material dark {{ ideal {{ diffuse 0.1 }} }}\nmaterial light {{ ideal {{ diffuse 0.6 }} }}
        facet dark (-99 -99 0) (99 -99 0) (99 50.25 0) (-99 50.25 0) m
        facet light (-99 50.25 0) (99 50.25 0) (99 150 0) (-99 150 0) m
        sensor eye {{ projection pushbroom, position (0 0 500) m, speed 50 m/s, line_rate 100 Hz, field_of_view 10 deg,
                    pixels 8 x 200, band b 500..600 nm }}"
    ));
    let frames = plan.runs()[0].render();
    let expected = |i: usize| lambert(if i / 8 <= 100 { 0.1 } else { 0.6 });
    assert_exact("two tones", pixels(&frames, 0).into_iter().enumerate().map(|(i, (l, _))| (l, expected(i))));
    let step = 2.0 * 500.0 * 5f64.to_radians().tan() / 8.0;
    for (x, y) in [(0, 0), (7, 199), (3, 100)] {
        let (e, n) = (truth(&frames, 3, x, y), truth(&frames, 4, x, y));
        let expected = (-step * (f64::from(x) + 0.5 - 4.0), 0.5 * f64::from(y));
        assert!((e - expected.0).abs() < 1e-4 && (n - expected.1).abs() < 1e-4, "{x},{y}: {e} {n}");
    }
}

/// Equal scan angles: x = H tan θ, range H / cos θ, each line from its own place.
#[test]
fn a_whiskbroom_sees_equal_angles() {
    let plan = text(&format!(
        "{BARE} material grey {{ ideal {{ diffuse 0.35 }} }}\nground grey
        sensor eye {{ projection whiskbroom, heading 180 deg, position (0 0 3000) m, speed 60 m/s, line_rate 8 Hz,
                    ifov 20 mrad, pixels 60 x 9, band b 500..600 nm }}"
    ));
    let frames = plan.runs()[0].render();
    for (x, y) in [(0, 0), (59, 8), (30, 4), (12, 7)] {
        let theta = 0.02 * (f64::from(x) + 0.5 - 30.0);
        let expected = [3000.0 * theta.tan(), -7.5 * f64::from(y), 3000.0 / theta.cos()];
        for (map, expected) in [3, 4, 6].into_iter().zip(expected) {
            assert!((truth(&frames, map, x, y) - expected).abs() < 1e-3, "{x},{y}: map {map}");
        }
    }
}

/// Coarser pixels show the same ground: corners of the image agree through the truth maps of the middles about them.
#[test]
fn a_coarser_scan_keeps_its_swath_and_its_way() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("posed.glint");
    let said = format!(
        "glint 1\n{BARE} material grey {{ ideal {{ diffuse 0.35 }} }}\nground grey
        sensor eye {{ projection pushbroom, position (0 0 900) m, speed 50 m/s, line_rate 25 Hz, ifov 2 mrad,
                    pixels 64 x 48, band b 500..600 nm }}"
    );
    std::fs::write(&path, said).expect("the scene is written");
    let render = |pixels| {
        let plan = scene(&path.to_string_lossy(), &Options { pixels, ..Options::default() });
        plan.runs()[0].render()
    };
    let (own, coarse) = (render(None), render(Some((16, 12))));
    for (x, y) in [(0u32, 0u32), (15, 11), (7, 5)] {
        for map in [3, 4] {
            let around: f64 = [(0, 0), (3, 0), (0, 3), (3, 3)]
                .iter()
                .map(|(dx, dy)| truth(&own, map, 4 * x + dx, 4 * y + dy))
                .sum::<f64>()
                / 4.0;
            assert!((truth(&coarse, map, x, y) - around).abs() < 1e-4, "{x},{y}");
        }
    }
}

/// A grey plane before a detector of efficiency 0.2 at 500 nm to 0.8 at 600 nm.
fn counted(noise: &str, more: &str) -> Plan {
    text(&format!(
        "collect {{ sun zenith 30 deg azimuth 180 deg }}
        atmosphere none {{ solar_irradiance 1850 W/m2/um }}
        material grey {{ ideal {{ diffuse 0.35 }} }}\nground grey
        sensor eye {{
          projection orthographic, position (0 0 10) m, swath 10 m, pixels 64 x 64, band b 510..590 nm
          ccd {{
            quantum_efficiency [500 nm 0.2, 600 nm 0.8], f_number 4, exposure 0.5 ms, pitch 9.9 um, full_well 60000 e-
            bits 12, bias 64 DN, read_noise 20 e-, dark_current 5000 e-/s, noise {noise} {more}
          }}
        }}
        experiment e {{ samples 16, products [radiance, counts] }}"
    ))
}

/// S = t A π/(1 + 4N²) L/(hc) ∫ λ η dλ with η = 0.2 + 6 (λ − 0.5): photons, not watts, are weighed.
#[test]
fn counts_are_the_photon_integral_over_the_band() {
    let plan = counted("off", "");
    let run = &plan.runs()[0];
    let frames = run.render();
    let primitive = |l: f64| -2.8 * l * l / 2.0 + 6.0 * l.powi(3) / 3.0;
    let hc = 6.626_070_15e-34 * 299_792_458.0;
    let integral = (primitive(0.59) - primitive(0.51)) * 1e-6 / hc;
    let electrons = 5e-4 * 9.9e-6f64.powi(2) * PI / 65.0 * lambert(0.35) * integral;
    let readout = run.readout.as_ref().expect("counts are asked for");
    assert!((readout.electrons[0] * lambert(0.35) / electrons - 1.0).abs() < 1e-9);
    let gain = 60_000.0 / (4095.0 - 64.0);
    let expected = ((electrons + 2.5) / gain + 64.0).round();
    assert!(expected > 200.0 && expected < 4000.0, "{expected} tests no clip");
    assert!(frames.frames[0].counts[0].iter().all(|dn| f64::from(*dn) == expected), "{expected}");
    let (slope, intercept) = readout.calibration(0);
    assert!((slope * expected + intercept - lambert(0.35)).abs() <= 0.5 * slope * (1.0 + 1e-6));
}

/// The variance over the pixels is (r² + S + D t)/K² + 1/12 within four standard errors, √(2/4096) each; and a frame has the
/// same noise whatever is rendered beside it.
#[test]
fn counts_scatter_as_the_photon_transfer_curve() {
    let run = |more: &str| {
        let plan = counted("on", more);
        plan.runs()[0].render().frames[0].counts[0].clone()
    };
    let counts = run("");
    let n = counts.len() as f64;
    let mean = counts.iter().map(|dn| f64::from(*dn)).sum::<f64>() / n;
    let variance = counts.iter().map(|dn| (f64::from(*dn) - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let gain = 60_000.0 / (4095.0 - 64.0);
    let electrons = (mean - 64.0) * gain;
    let expected = (400.0 + electrons) / (gain * gain) + 1.0 / 12.0;
    assert!((variance / expected - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{variance} {expected}");
    assert_eq!(counts, run(""));
}

/// π L/(E₀ cos θ + E_d): the level plane's own ρ whatever the light; a slope of 30° to the sun, without a sky, cos 0/cos 30°
/// of it; nothing where the picture shows nothing.
#[test]
fn the_reflectance_factor_of_the_level_is_its_reflectance() {
    let posed = |sky: f64, ground: &str| {
        text(&format!(
            "collect {{ sun zenith 30 deg azimuth 180 deg }}
            atmosphere none {{ solar_irradiance 1850 W/m2/um, sky_radiance {sky} W/m2/sr/um }}
            material grey {{ ideal {{ diffuse 0.35 }} }}\n{ground}
            sensor eye {{ projection orthographic, position (0 0 10) m, swath 1 m, pixels 4 x 4, band b 500..600 nm }}
            experiment e {{ samples 16, products [radiance, reflectance_factor] }}"
        ))
    };
    let factor = |plan: &Plan| plan.runs()[0].render().frames[0].reflectance_factor[0].clone();
    for sky in [0.0, 90.0] {
        let level = factor(&posed(sky, "ground grey"));
        assert_exact("factor of the level", level.iter().map(|r| (f64::from(*r), 0.35)));
    }
    let slope = factor(&posed(0.0, "panel grey size (9 9) m slope 30 deg aspect 180 deg"));
    assert_exact("factor of a slope", slope.iter().map(|r| (f64::from(*r), 0.35 / 30f64.to_radians().cos())));
    let nothing = factor(&posed(0.0, "panel grey size (9 9) m at (50 50 0) m"));
    assert!(nothing.iter().all(|r| r.is_nan()));
}
