use super::*;

fn faults(text: &str) -> String {
    Scans::read_csv(text).expect_err("these scans do not hold").to_string()
}

const HEADER: &str = "band,illumination_zenith_deg,view_zenith_deg,brf,brf_stddev,solid_angle_msr\n";

/// What is written is read again to the last bit, whatever the scans are for.
#[test]
fn written_scans_are_read_again() {
    for bands in [
        vec![ScanBand::All],
        vec![ScanBand::Named("red, wide".into()), ScanBand::Named("nir".into())],
        vec![ScanBand::Wavelength(Wavelength::from_um(0.55)), ScanBand::Wavelength(Wavelength::from_um(0.8512))],
    ] {
        for (stddev, solid_angle) in [(None, None), (Some(0.01 / 3.0), Some(1.9e-3))] {
            let values = bands.iter().flat_map(|band| {
                [8.0_f64, 30.0, 75.0].into_iter().flat_map(move |i| {
                    [-75.0_f64, -30.0, -8.0, 8.0, 47.123].into_iter().map(move |v| Measurement {
                        band: band.clone(),
                        illumination: i.to_radians(),
                        view: v.to_radians(),
                        brf: 0.1 + i / 7.0 + v / 1e3,
                        stddev,
                        line: None,
                    })
                })
            });
            let scans = Scans::new(values, solid_angle).expect("whole scans");
            assert_eq!(Scans::read_csv(&scans.to_csv()), Ok(scans));
        }
    }
}

#[test]
fn columns_are_found_in_any_order_and_unit() {
    let text = "# a comment\n\nbrf_percent,view_zenith_deg,sample,illumination_zenith_rad,wavelength_um,solid_angle_msr\n\
                12.5,-30,a,0.5235987755982988,0.55,1.9\n\n# another\n11,30,a,0.5235987755982988,0.55,1.9\n";
    let scans = Scans::read_csv(text).expect("scans");
    assert_eq!(scans.bands(), [ScanBand::Wavelength(Wavelength::from_um(0.55))]);
    assert_eq!(scans.readings().iter().map(|r| r.brf).collect::<Vec<_>>(), [0.125, 0.11]);
    assert!((scans.solid_angle().expect("one") - 1.9e-3).abs() < 1e-18);
    assert!(scans.is_specular(&scans.readings()[0]) && scans.is_retro(&scans.readings()[1]));
}

/// Every fault of a file is told in one go, with its line and a cure.
#[test]
fn all_faults_are_told_with_their_lines() {
    let rows = "red,30,10,0.2,,1.9\nred,30,10,0.2,,1.9\nred,95,10,0.2,,1.9\nred,-5,10,0.2,,1.9\n# a comment\n\
                red,30,-100,0.2,,1.9\nred,30,20,x,,1.9\nred,30,25,NaN,,1.9\nred,30,40,-0.2,0.01,1.9\n\
                red,30,45,-0.2,,1.9\nred,30,50,0.2,-1,1.9\nred,30,55,0.2,0.1,2.5\n,30,60,0.2,0.1,1.9\nred,30,65\n\
                red,,70,0.2,,\n";
    let told = faults(&format!("{HEADER}{rows}"));
    let expected = [
        "line 3: the value of band `red` at illumination 30 deg, view 10 deg stands twice, first in line 2; keep one",
        "line 4: light at 95 deg does not reach the sample",
        "line 5: an illumination angle of -5 deg is negative; the light stands at positive angles",
        "line 7: a view angle of -100 deg is behind the sample",
        "line 8: brf: `x` is no number",
        "line 9: brf: `NaN` is not a finite number",
        "line 10: a reflectance factor is not negative; it is -0.2; that is more than 5 standard errors",
        "line 11: a reflectance factor is not negative; it is -0.2; look at the dark signal, or state the noise",
        "line 12: a standard error is not negative",
        "line 13: an aperture of 0.0025 sr here and of 0.0019 sr in line 2",
        "line 14: the name of the band is missing",
        "line 15: 3 values under a header of 6 columns",
        "line 16: illumination_zenith_deg has no value here; leave the whole row out",
    ];
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), expected.len(), "{told}");
    for (line, expected) in lines.iter().zip(expected) {
        assert!(line.starts_with(expected), "{line}\n{expected}");
    }
}

#[test]
fn faults_of_the_header_say_which_columns_there_are() {
    let cases = [
        ("", "the table is empty; it has the columns"),
        ("# nothing\n", "the table is empty"),
        (HEADER, "the table has no rows"),
        ("8,8,0.1\n", "line 1: the line that names the columns is missing"),
        ("illumination_zenith_deg;view_zenith_deg;brf\n8;8;0.1\n", "line 1: the columns are not parted by commas"),
        ("illumination_zenith_deg,brf\n8,0.1\n", "line 1: there is no column `view_zenith_deg`; the columns are"),
        (
            "illumination_zenith,view_zenith_deg,brf\n",
            "`illumination_zenith` does not say its unit; `illumination_zenith_UNIT`",
        ),
        (
            "illumination_zenith_deg,view_zenith_deg,view_zenith_rad,brf\n",
            "`view_zenith_deg` and `view_zenith_rad` say the same",
        ),
        ("band,wavelength_nm,illumination_zenith_deg,view_zenith_deg,brf\n", "not both: `band` and `wavelength_nm`"),
        ("illumination_zenith_deg,view_zenith_deg,brf\n8,90,0.1\n", "there is no value below 90 deg"),
        ("wavelength_nm,illumination_zenith_deg,view_zenith_deg,brf\n0.55,8,8,0.1\n", "beyond 100..100000 nm"),
        (
            "illumination_zenith_deg,view_zenith_deg,brf,solid_angle_sr\n8,8,0.1,0\n",
            "line 2: an aperture of 0 sr is none",
        ),
        ("illumination_zenith_deg,view_zenith_deg,brf\n8,8,1e999\n", "line 2: brf: `1e999` is not a finite number"),
    ];
    for (text, expected) in cases {
        let told = faults(text);
        assert!(told.contains(expected), "{text}: {told}");
    }
    let many = format!("{HEADER}{}", "red,30,10,x,,\n".repeat(500));
    assert!(faults(&many).ends_with("and 480 more"));
}

/// A matrix of 2 × 3 with one gap, one mirror value missing, a value at 90° and one against the light.
#[test]
fn the_report_tells_gaps_and_what_does_not_belong() {
    let text = "illumination_zenith_deg,view_zenith_deg,brf,brf_stddev\n\
                30,-30,0.5,0.1\n30,10,0.2,0.1\n30,60,-0.1,0.1\n30,90,0.7,0.1\n60,-30,0.2,0.1\n60,60,0.3,0.1\n30,30,0.3,0.1\n";
    let report = Scans::read_csv(text).expect("scans").report();
    assert_eq!((report.size, report.count), ([1, 2, 4], 6));
    let views = |places: &[Place]| places.iter().map(|place| degrees(place.view)).collect::<Vec<_>>();
    assert_eq!((report.gaps.count, views(&report.gaps.first)), (2, vec![10.0, 30.0]));
    assert_eq!(views(&report.no_specular), [-60.0]);
    assert_eq!(views(&report.impossible), [90.0]);
    assert_eq!(views(&report.retro), [30.0, 60.0]);
    assert_eq!(views(&report.negative), [60.0]);
    let text = report.to_string();
    assert!(text.contains("6 values: 1 band, 2 illuminations, 4 views\n"), "{text}");
    assert!(text.contains(
        "no specular value (v = -i is missing: no R_s at that angle):\n  illumination 60 deg, view -60 deg\n"
    ));
}

/// Any damage to a file is told or read, without a panic.
#[test]
fn damaged_files_are_told() {
    let whole = format!("{HEADER}red,30,10,0.2,,1.9\nred,30,-30,0.4,0.1,1.9\n");
    for at in 0..whole.len() {
        for damage in ["", ",", "\n", "\"", "-", "9e9", "\u{b5}", "\0"] {
            let text = format!("{}{damage}{}", &whole[..at], &whole[at + 1..]);
            if let Ok(scans) = Scans::read_csv(&text) {
                let _ = scans.report().to_string();
            }
        }
    }
}
