//! The provider `table` on output of LOWTRAN 7, MODTRAN, libRadtran and 6S.
//!
//! `tests/data/lowtran7_*.tp7` were printed by LOWTRAN 7. The other samples are made here: numbers of closed forms in
//! the layouts that the codes print, so that what is read is known exactly.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::sync::Arc;

use sunglint_atmosphere::{Atmosphere, AtmosphereError, BUILTIN, Column, Needs, Path, SkyState, Sun};
use sunglint_plugin::{Args, BindError, FileArg, SpectralValue, Value};
use sunglint_radiometry::{SpectralGrid, WorldDir};

const SUN: &str = include_str!("data/lowtran7_sun.tp7");
const DOWN: &str = include_str!("data/lowtran7_down.tp7");
const TWO_VIEWS: &str = include_str!("data/lowtran7_down_two_views.tp7");
const TRANSMITTANCE: &str = include_str!("data/lowtran7_transmittance.tp7");
const SKY: &str = include_str!("data/lowtran7_sky.tp7");

/// Zenith angle of the sun of all samples.
const ZENITH: f64 = 40.0;

fn grid() -> SpectralGrid {
    SpectralGrid::from_edges(&(0..=20).map(|i| 0.5 + 0.005 * f64::from(i)).collect::<Vec<_>>())
}

fn bytes(name: &str, bytes: &[u8]) -> Value {
    Value::File(FileArg { name: name.to_string(), bytes: bytes.into() })
}

fn constant(value: f64) -> Value {
    Value::Spectrum(SpectralValue::Constant(value))
}

fn bind(given: Vec<(&str, Value)>) -> Result<Arc<dyn Atmosphere>, BindError> {
    let model = BUILTIN.iter().find(|model| model.info.name == "table").unwrap();
    let args = Args::new(&model.info, given.into_iter().map(|(name, value)| (name.to_string(), value)));
    (model.bind)(&args, &grid())
}

fn files(given: &[(&str, &str)]) -> Result<Arc<dyn Atmosphere>, BindError> {
    bind(given.iter().map(|(param, text)| (*param, bytes(&format!("{param}.txt"), text.as_bytes()))).collect())
}

fn fault(given: &[(&str, &str)]) -> BindError {
    files(given).err().unwrap()
}

fn solve_for(provider: &Arc<dyn Atmosphere>, sun: Sun, needs: Needs) -> Result<Box<dyn SkyState>, AtmosphereError> {
    let column = Column { ground_albedo: vec![0.0; grid().len()], ..Column::default() };
    Ok(provider.solve(&column, &[sun], &grid(), &needs)?.remove(0))
}

const ALL: Needs =
    Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None };

fn sun() -> Sun {
    Sun::at(ZENITH.to_radians(), 1.0)
}

fn solve(provider: &Arc<dyn Atmosphere>) -> Box<dyn SkyState> {
    solve_for(provider, sun(), ALL).unwrap()
}

fn path(sky: &dyn SkyState, view_zenith_deg: f64, height: f64) -> (Vec<f64>, Vec<f64>) {
    let (mut tau, mut radiance) = (vec![0.0; grid().len()], vec![0.0; grid().len()]);
    let towards_sensor = WorldDir::from_zenith_azimuth(view_zenith_deg.to_radians(), 0.0);
    let path = Path { target_height: 0.0, sensor_height: height, length: height, towards_sensor };
    sky.path(&path, &mut tau, &mut radiance);
    (tau, radiance)
}

/// L_d towards a zenith angle and an azimuth from the sun's.
fn radiance(sky: &dyn SkyState, zenith_deg: f64, azimuth_deg: f64) -> Vec<f64> {
    let mut radiance = vec![0.0; grid().len()];
    let direction = WorldDir::from_zenith_azimuth(zenith_deg.to_radians(), 1.0 + azimuth_deg.to_radians());
    sky.sky_radiance(direction, &mut radiance);
    radiance
}

/// Every value within `tolerance` of the law at its wavelength, relatively.
fn follows(values: &[f64], tolerance: f64, law: impl Fn(f64) -> f64) {
    for (value, wavelength) in values.iter().zip(grid().wavelengths_um()) {
        let due = law(wavelength);
        assert!((value - due).abs() <= tolerance * due.abs().max(1e-9), "{value} but {due} at {wavelength} um");
    }
}

/// The made-up atmosphere: all smooth in λ [µm], so that straight lines over 2 nm err by less than 1e-4.
fn e_s(l: f64) -> f64 {
    1900.0 - 900.0 * (l - 0.5)
}
fn tau_1(l: f64) -> f64 {
    (-0.3 * (0.55 / l).powi(2)).exp()
}
fn tau_2(l: f64) -> f64 {
    (-0.2 * (0.55 / l).powi(2)).exp()
}
fn e_d(l: f64) -> f64 {
    300.0 * (0.5 / l).powi(3)
}
fn l_u(l: f64) -> f64 {
    40.0 * (0.5 / l).powi(4)
}
fn mu() -> f64 {
    ZENITH.to_radians().cos()
}

// ---- tape7 ----

/// LOWTRAN 7's sun is of the 1980s and is printed at single wavenumbers, 500 cm⁻¹ apart: its mean over 0.5…0.6 µm
/// stays within 3 % of the TSIS-1 spectrum's at the distance of day 180, 1.0167 au. τ₁, τ₂, L_u and L_d are lines
/// between what stands in the files.
#[test]
fn lowtran_7_gives_sun_path_and_sky_in_three_files() {
    let provider = files(&[("tape7", DOWN), ("tape7_sun", SUN), ("tape7_sky", SKY)]).unwrap();
    let sky = solve(&provider);
    let none = BUILTIN.iter().find(|model| model.info.name == "none").unwrap();
    let bare = (none.bind)(&Args::new(&none.info, []), &grid()).unwrap();
    let bare = solve_for(&bare, Sun { distance: 1.0167, ..sun() }, ALL).unwrap();
    let mean = |sky: &dyn SkyState| sky.solar_irradiance().iter().sum::<f64>() / grid().len() as f64;
    let (e, tsis) = (mean(&*sky), mean(&*bare));
    assert!((e / tsis - 1.0).abs() < 0.03, "{e} {tsis}");
    // 18 000 and 18 500 cm⁻¹ enclose 0.55 µm; the rows are read here by eye.
    let at = |l: f64, (l0, a): (f64, f64), (l1, b): (f64, f64)| a + (b - a) * (l - l0) / (l1 - l0);
    let (l0, l1) = (1e4 / 18_500.0, 1e4 / 18_000.0);
    let inside: Vec<usize> =
        (0..grid().len()).filter(|i| (l0 + 0.005..l1 - 0.005).contains(&grid().wavelengths_um()[*i])).collect();
    assert!(!inside.is_empty());
    let (tau, up) = path(&*sky, 0.0, 1e5);
    for i in inside {
        let l = grid().wavelengths_um()[i];
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        near(tau[i], at(l, (l0, 0.6293), (l1, 0.6398)));
        near(sky.sun_transmittance()[i], at(l, (l0, 0.5464), (l1, 0.5584)));
        near(up[i], at(l, (l0, 1.49e-7 * 18_500.0 * 18_500.0), (l1, 1.57e-7 * 18_000.0 * 18_000.0)));
        near(
            radiance(&*sky, 0.0, 0.0)[i],
            at(l, (l0, 2.82e-7 * 18_500.0 * 18_500.0), (l1, 3.01e-7 * 18_000.0 * 18_000.0)),
        );
    }
    assert!(radiance(&*sky, 30.0, 0.0)[0] > radiance(&*sky, 30.0, 90.0)[0], "the sky is brighter under the sun");
    let (left, right) = (radiance(&*sky, 60.0, 70.0)[0], radiance(&*sky, 60.0, -70.0)[0]);
    assert!((left / right - 1.0).abs() < 1e-12, "both sides of the sun are alike");
    assert!(provider.has_directional_sky());
    let told = provider.report().join("\n");
    assert!(told.contains("L_d = SOL SCAT in 10 directions") && told.contains("view zenith 0 deg"), "{told}");
    assert!(told.contains("sun at zenith 40 deg"), "{told}");
}

/// The run over a ground of albedo 0.3 prints what sun and sky make of it: E_d = (GRND − DRCT)/DRCT · E_s τ₁ cos θ. The sky
/// that ten other runs print integrates to the same E_d within 5 %: straight lines between 30° (the sun's aureole among
/// them), three printed digits, and a flux of two streams against radiances along lines of sight.
#[test]
fn the_diffuse_irradiance_behind_the_ground_s_radiance_is_that_of_the_sky() {
    let provider = files(&[("tape7", DOWN), ("tape7_sun", SUN)]).unwrap();
    let sky = solve(&provider);
    assert!(provider.report().iter().any(|line| line.contains("E_d = (GRND − DRCT)/DRCT")), "{:?}", provider.report());
    let integral = solve(&files(&[("tape7", DOWN), ("tape7_sun", SUN), ("tape7_sky", SKY)]).unwrap());
    for (a, b) in sky.diffuse_irradiance().iter().zip(integral.diffuse_irradiance().iter()) {
        assert!((a / b - 1.0).abs() < 0.05, "{a} {b}");
    }
    // By hand at 18 000 cm⁻¹: (2.28 − 1.48)/1.48 · 5.66e-6 · 18 000² · 0.5584 · cos 40°.
    let due = 0.80 / 1.48 * 5.66e-6 * 18_000.0 * 18_000.0 * 0.5584 * mu();
    let got = sky.diffuse_irradiance();
    assert!(got.iter().any(|e| (e / due - 1.0).abs() < 0.06), "{got:?} {due}");
}

#[test]
fn transmittance_runs_give_tau_and_the_sun_is_the_reference_spectrum() {
    let given = vec![
        ("tape7_sun", bytes("t.tp7", TRANSMITTANCE.as_bytes())),
        ("tape7", bytes("down.tp7", TRANSMITTANCE.as_bytes())),
        ("path_radiance", constant(3.0)),
        ("diffuse_irradiance", constant(200.0)),
    ];
    let provider = bind(given).unwrap();
    let sky = solve(&provider);
    assert!(sky.sun_transmittance().iter().all(|t| (0.5..0.65).contains(t)));
    let (tau, up) = path(&*sky, 40.0, 1e5);
    assert!(tau == *sky.sun_transmittance().iter().copied().collect::<Vec<_>>() && up.iter().all(|l| *l == 3.0));
    assert!(sky.diffuse_irradiance().iter().all(|e| (e - 200.0).abs() < 1e-9));
    assert!(provider.report().iter().any(|line| line.contains("TSIS-1 spectrum at 1 au")), "{:?}", provider.report());
}

/// ANGLE 150° at 100 km: sin θ = sin 150° · 6471/6371, so 30.5°; between nadir and it all goes by straight lines.
#[test]
fn several_views_of_a_tape7_are_keys() {
    let given = [("tape7", TWO_VIEWS), ("tape7_sun", SUN), ("tape7_sky", SKY)];
    let sky = solve(&files(&given).unwrap());
    let slant = (0.5_f64 * 6471.0 / 6371.0).asin().to_degrees();
    let [nadir, half, edge] = [0.0, 0.5 * slant, slant].map(|view| path(&*sky, view, 1e5).0[0]);
    assert!(nadir > edge && (half - 0.5 * (nadir + edge)).abs() < 1e-9, "{nadir} {half} {edge}");
}

/// MODTRAN 4's layout (F8.2, F11.8, 8 E11.4, 2 E9.2, F8.3), with DISORT's empty THRML SCT; MODTRAN 5's, with TOA_SUN;
/// and the filtered file against µm and nm. All say the same air.
#[test]
fn modtran_layouts_give_the_same_air() {
    let cards = "MMF  2    2    2   -1    0    0    0    0    0    0    0    1    0   0.000   0.20\n".to_string()
        + "T   8F   0   380.00000\n"
        + "    1    0    0    0    0    0    23.000     0.000     0.000     0.000     0.000\n"
        + "   100.000     0.000   180.000     0.000     0.000     0.000    0\n"
        + "    2    2  180    0\n"
        + "     0.000    40.000     0.000     0.000     0.000     0.000     0.000     0.000\n"
        + "     15000     22000        20        20RW\n    0\n";
    let rho = 0.2;
    let row = |l: f64, unit: f64| {
        let (sun, diffuse) = (e_s(l) * tau_1(l) * mu(), e_d(l));
        let direct = rho * sun * tau_2(l) / PI;
        let ground = rho * (sun + diffuse) * tau_2(l) / PI;
        [l_u(l), ground, direct, l_u(l) + ground, e_s(l) * tau_1(l) * tau_2(l), e_s(l)].map(|v| v / unit)
    };
    // Fortran's 1PE11.4.
    let e = |value: f64, width: usize, digits: usize| {
        let text = format!("{value:.digits$E}");
        let (mantissa, exponent) = text.split_once('E').unwrap();
        let exponent: i32 = exponent.parse().unwrap();
        let text = format!("{mantissa}E{}{:02}", if exponent < 0 { '-' } else { '+' }, exponent.abs());
        format!("{text:>width$}")
    };
    let reflected = "  GRND_RFLT  DRCT_RFLT  TOTAL_RAD  REF_SOL  SOL@OBS   DEPTH";
    let last = " DIR_EM    TOA_SUN BBODY_T[K]\n";
    let path = "  TOT_TRANS  PTH_THRML  THRML_SCT  SURF_EMIS   SOL_SCAT  SING_SCAT";
    let path_6 = "  TOT_TRANS   THRML_EM  THRML_SCT  SURF_EMIS  MULT_SCAT  SING_SCAT";
    let mut four = format!("{cards}    FREQ{}\n", format!("{path}{reflected}").replace('_', " "));
    let mut five = format!("{cards}    FREQ{path}{reflected}{last}");
    let mut six = format!("{cards}    FREQ{path_6}{reflected}{last}");
    let mut sun = cards.replace("   180.000", "    40.000") + "    FREQ   TRANS     SOL TR  SOLAR\n";
    for step in 0..=350 {
        let nu = 15_000.0 + 20.0 * f64::from(step);
        let l = 1e4 / nu;
        let [scat, ground, direct, total, reflected, toa] = row(l, nu * nu);
        let depth = -tau_2(l).ln();
        let front = |blank: &str| format!("{nu:8.2}{:11.8}{}{blank}{}", tau_2(l), e(0.0, 11, 4), e(0.0, 11, 4));
        let rest = format!("{}{}{}", e(ground, 11, 4), e(direct, 11, 4), e(total, 11, 4));
        let tail = format!("{}{}{depth:8.3}", e(reflected, 9, 2), e(0.0, 9, 2));
        let fine = format!("{}{}{depth:8.3}", e(reflected, 13, 6), e(0.0, 9, 2));
        writeln!(four, "{}{}{}{rest}{tail}", front(&" ".repeat(11)), e(scat, 11, 4), e(0.3 * scat, 11, 4)).unwrap();
        let last = format!("{:7.3}{}{:11.3}", 0.8, e(toa, 11, 4), 250.0);
        let zero = e(0.0, 11, 4);
        writeln!(five, "{}{}{}{rest}{fine}{last}", front(&zero), e(scat, 11, 4), e(0.3 * scat, 11, 4)).unwrap();
        writeln!(six, "{}{}{}{rest}{fine}{last}", front(&zero), e(0.7 * scat, 11, 4), e(0.3 * scat, 11, 4)).unwrap();
        writeln!(
            sun,
            "{nu:8.2}{:8.4}{}{}{:>70}",
            tau_1(l),
            e(toa * tau_1(l), 9, 2),
            e(toa, 9, 2),
            e(-tau_1(l).ln(), 10, 3)
        )
        .unwrap();
    }
    let mut filtered = [String::new(), String::new()];
    for (text, (label, scale, unit)) in
        filtered.iter_mut().zip([("WAVLEN(MCRN)", 1.0, 1e4), ("  WAVLEN(NM)", 1e3, 10.0)])
    {
        *text = cards.clone() + label + &format!("{}{reflected}{last}", path.replace("  TOT_TRANS", "      TRAN"));
        for step in 0..=160 {
            let l = 0.47 + 0.001 * f64::from(step);
            let [scat, ground, direct, total, reflected, toa] = row(l, unit);
            let zeros = e(0.0, 11, 4).repeat(3);
            writeln!(
                text,
                "{:12.6}{:10.6}{zeros}{}{}{}{}{}{}{}{:8.3}{:7.3}{}{:11.3}",
                l * scale,
                tau_2(l),
                e(scat, 11, 4),
                e(0.3 * scat, 11, 4),
                e(ground, 11, 4),
                e(direct, 11, 4),
                e(total, 11, 4),
                e(reflected, 13, 6),
                e(0.0, 9, 2),
                -tau_2(l).ln(),
                0.8,
                e(toa, 11, 4),
                250.0
            )
            .unwrap();
        }
        *text += "     -9999.\n";
    }
    for text in [&mut four, &mut five, &mut six, &mut sun] {
        *text += " -9999.\n";
    }
    let [microns, nanometres] = &filtered;
    // 5 digits of E11.4 leave 5e-5 of a radiance; GRND − DRCT of the two leaves 3e-4; E9.2 leaves 5e-3 of E_s.
    for (name, text, alone) in
        [("4", &four, false), ("5", &five, true), ("6", &six, true), ("um", microns, true), ("nm", nanometres, true)]
    {
        let given: &[(&str, &str)] =
            if alone { &[("tape7", text.as_str())] } else { &[("tape7", text.as_str()), ("tape7_sun", sun.as_str())] };
        let provider = files(given).unwrap_or_else(|error| panic!("MODTRAN {name}: {error}"));
        let sky = solve(&provider);
        let coarse = if alone { 3e-4 } else { 6e-3 };
        follows(sky.solar_irradiance(), coarse, e_s);
        follows(sky.sun_transmittance(), 4e-4, tau_1);
        follows(sky.diffuse_irradiance(), coarse + 1e-3, e_d);
        let (tau, up) = crate::path(&*sky, 0.0, 7e5);
        follows(&tau, 1e-4, tau_2);
        follows(&up, 2e-4, l_u);
        assert_eq!(alone, provider.report().iter().any(|line| line.contains("E_s = TOA_SUN")), "{name}");
    }
    // A file of the path to the sun says E_s better than the path to the sensor does.
    let provider = files(&[("tape7", five.as_str()), ("tape7_sun", sun.as_str())]).unwrap();
    assert!(provider.report().iter().all(|line| !line.contains("E_s = TOA_SUN")));
    follows(solve(&provider).solar_irradiance(), 6e-3, e_s);
}

#[test]
fn a_faulty_tape7_is_refused_where_it_is_faulty() {
    let header = "  FREQ   TRANS     SOL TR  SOLAR\n";
    let row = " 15000.  0.5000 1.00E-06 2.00E-06   6.931E-01\n";
    for (text, code, words) in [
        ("nothing\n".to_string(), "F01", "no run"),
        (format!("{header}{row}"), "F01", "line 1: the run that begins here has no end"),
        (format!("{header} -9999.\n"), "F01", "line 1: the run that begins here has no rows"),
        (format!("{header}{row} 15500.  0.5o00 1.00E-06 2.00E-06   6.931E-01\n -9999.\n"), "F01", "line 3: `0.5o00`"),
        (format!("{header}{row} 15500.  0.5000 1.00E-06\n -9999.\n"), "F01", "line 3: 3 numbers below rows of 5"),
        (format!("{header} 15500.  0.5000\n -9999.\n"), "F01", "line 2: 2 numbers do not fit"),
        (
            format!("{header} 15000.  1.5000 1.00E-06 2.00E-06   1.0\n -9999.\n"),
            "U05",
            "line 2: sun_transmittance is 1.5",
        ),
        (format!("{header} 15000.  0.5 1.0E-06 -2.00E-06   1.0\n -9999.\n"), "U05", "line 2: solar_irradiance is -450"),
        (format!("{header} -5.  0.5 1.0E-06 2.00E-06   1.0\n -9999.\n"), "U05", "line 2: -5 is no wavenumber"),
        (
            format!("{header}{row} 15900.  0.5 1E-06 2E-06 1.0\n 15800.  0.5 1E-06 2E-06 1.0\n -9999.\n"),
            "M05",
            "line 3: wavelength 0.628931 um",
        ),
        (format!("{header}{row} -9999.\n{header}{row} -9999.\n"), "S05", "line 4: a second run"),
        ("  FREQ   THIS THAT\n -9999.\n".to_string(), "F01", "line 1: an unknown header"),
        ("    FREQ LOS  TOT_TRANS  TOTAL_RAD\n".to_string(), "F01", "line 1: several lines of sight"),
        (DOWN.to_string(), "S05", "line 11: a run of radiance"),
    ] {
        let error = fault(&[("tape7_sun", &text)]);
        assert_eq!(error.code, code, "{error}");
        assert!(error.message.contains(words), "{words} / {error}");
        assert!(error.message.starts_with("tape7_sun.txt"), "{error}");
    }
    assert!(fault(&[("tape7", SUN)]).message.contains("line 11: a run of solar irradiance"));
    let up = fault(&[("tape7", SKY), ("tape7_sun", SUN)]);
    assert!(up.code == "S05" && up.message.contains("line 11: this run looks up"), "{up}");
    let blind = SKY.replacen("    2    2  180    0", "    1    2  180    0", 1);
    let error = fault(&[("tape7", DOWN), ("tape7_sun", SUN), ("tape7_sky", &blind)]);
    assert!(error.message.contains("line 11") && error.message.contains("where the sun is"), "{error}");
    // Without the first run the zenith is missing, which is no fault; without the second a direction is.
    let run = |i: usize| SKY.lines().skip(25 * i).take(25).map(|line| format!("{line}\n")).collect::<String>();
    let holed: String = (0..10).filter(|i| *i != 2).map(run).collect();
    let error = fault(&[("tape7", DOWN), ("tape7_sun", SUN), ("tape7_sky", &holed)]);
    assert_eq!(error.code, "M05");
    assert!(
        error.message.contains("sky_radiance has no rows at sky_zenith 30.000000 deg, sky_azimuth 90.000000 deg"),
        "{error}"
    );
}

/// What a plan needs and no file gives is an error that says how to state it; the sun of the scene is that of the
/// files.
#[test]
fn what_the_files_lack_is_said() {
    let only_sun = files(&[("tape7_sun", SUN)]).unwrap();
    let beam = Needs { direct_beam: true, ..Needs::default() };
    assert!(solve_for(&only_sun, sun(), beam).is_ok());
    for (needs, words) in [
        (Needs { diffuse_irradiance: true, ..beam }, "tape7_sun.txt gives no E_d or L_d"),
        (Needs { path: true, ..beam }, "tape7_sun.txt gives no τ₂"),
    ] {
        let error = solve_for(&only_sun, sun(), needs).err().unwrap();
        assert_eq!(error.code, "A03");
        assert!(error.message.contains(words) && error.message.contains("or say"), "{error}");
    }
    assert!(only_sun.report().iter().any(|line| line.ends_with("no L_u")), "{:?}", only_sun.report());
    let error = solve_for(&only_sun, Sun::at(45f64.to_radians(), 0.0), beam).err().unwrap();
    assert!(error.message.contains("zenith 40.0000 deg; the sun stands at 45.0000 deg"), "{error}");
    let error = fault(&[("tape7", DOWN)]);
    assert!(error.code == "S05" && error.message.contains("no τ₁"), "{error}");
    let twice = bind(vec![("tape7_sun", bytes("sun.tp7", SUN.as_bytes())), ("sun_transmittance", constant(0.5))]);
    let error = twice.err().unwrap();
    assert!(
        error.code == "S05" && error.message.contains("τ₁ is given by `sun_transmittance` and by sun.tp7"),
        "{error}"
    );
    let csv = "wavelength_nm,diffuse_irradiance_w_m2_um,path_transmittance,path_radiance_w_m2_sr_um
400,90,0.8,7
700,90,0.8,7
";
    let sky = solve(&files(&[("tape7_sun", SUN), ("file", csv)]).unwrap());
    assert!((sky.diffuse_irradiance()[0] - 90.0).abs() < 1e-9 && (path(&*sky, 0.0, 1e3).1[0] - 7.0).abs() < 1e-9);
    let short = SUN
        .lines()
        .filter(|line| ![" 155", " 16"].iter().any(|of| line.starts_with(of) && line.len() > 40))
        .collect::<Vec<_>>()
        .join("\n");
    let error = solve_for(&files(&[("tape7_sun", &short)]).unwrap(), sun(), beam);
    let error = error.err().unwrap();
    assert!(error.code == "M04" && error.message.contains("of tape7_sun.txt speaks for"), "{error}");
}

// ---- uvspec ----

const INPUT: &str = "# made for a test
atmosphere_file afglus.dat
source solar atlas_plus_modtran   # mW m-2 nm-1
sza 40
phi0 30
rte_solver disort
albedo 0
wavelength 490 610
";

/// L_d of the made-up sky: bilinear in zenith angle and azimuth from the sun's, on the nodes of the runs.
fn l_d(l: f64, zenith_deg: f64, azimuth_deg: f64) -> f64 {
    let folded = azimuth_deg.rem_euclid(360.0).min(360.0 - azimuth_deg.rem_euclid(360.0));
    60.0 * (0.5 / l).powi(3) * (1.0 + zenith_deg / 180.0 * (1.0 - folded / 180.0))
}

const SKY_ZENITHS: [f64; 4] = [80.0, 60.0, 30.0, 0.0];
const PHIS: [f64; 5] = [30.0, 75.0, 120.0, 165.0, 210.0];

/// ∫ L_d cos θ dω of the bilinear sky above by midpoints.
fn sky_integral(l: f64) -> f64 {
    let (n, mut sum) = (400, 0.0);
    for i in 0..n {
        let zenith = (f64::from(i) + 0.5) * 90.0 / f64::from(n);
        let (sin, cos) = zenith.to_radians().sin_cos();
        // Held beyond 80°; azimuth enters linearly, so its mean is that of 90°.
        sum += l_d(l, zenith.min(80.0), 90.0) * sin * cos;
    }
    sum * 2.0 * PI * 0.5 * PI / f64::from(n)
}

fn uvspec(input: &str, output: &str, more: Vec<(&str, Value)>) -> Result<Arc<dyn Atmosphere>, BindError> {
    let mut given =
        vec![("uvspec_input", bytes("run.inp", input.as_bytes())), ("uvspec", bytes("run.out", output.as_bytes()))];
    given.extend(more);
    bind(given)
}

fn stated() -> Vec<(&'static str, Value)> {
    vec![("path_transmittance", constant(1.0)), ("path_radiance", constant(0.0))]
}

/// Columns of disort with a block of radiance below each row, at the ground and at the top: E_s from the top, τ₁ from
/// both, and directions that travel to umu and phi come from zenith arccos(−umu) and azimuth phi − phi0.
#[test]
fn uvspec_blocks_give_sun_sky_and_path() {
    let umu: Vec<f64> = SKY_ZENITHS.iter().map(|z| -(z.to_radians().cos())).rev().chain([0.5, 1.0]).collect();
    let list = |values: &[f64]| values.iter().map(|v| format!("{v:.9}")).collect::<Vec<_>>().join(" ");
    let input = format!("{INPUT}umu {}\nphi {}\nzout 0 TOA\n", list(&umu), list(&PHIS));
    let mut output = String::new();
    for step in 0..=120 {
        let nm = 490.0 + f64::from(step);
        let l = 1e-3 * nm;
        for top in [false, true] {
            let edir = if top { e_s(l) * mu() } else { e_s(l) * tau_1(l) * mu() };
            let edn = if top { 1e-9 } else { sky_integral(l) };
            writeln!(
                output,
                "{nm:9.3} {edir:13.6e} {edn:13.6e} {:13.6e} {:13.6e} {:13.6e} {:13.6e} ",
                0.0, 0.0, 0.0, 0.0
            )
            .unwrap();
            let line: String = PHIS.iter().map(|phi| format!("{phi:18.3}")).collect();
            writeln!(output, "          {line}").unwrap();
            for umu in &umu {
                let of = |phi: f64| match (*umu < 0.0, top) {
                    (true, false) => l_d(l, (-umu).min(1.0).acos().to_degrees(), phi - 30.0),
                    (false, true) => l_u(l),
                    _ => -1e-9,
                };
                let line: String = PHIS.iter().map(|phi| format!(" {:16.9e} ", of(*phi))).collect();
                writeln!(output, "{umu:8.4} {:16.9e} {line}", 0.0).unwrap();
            }
        }
    }
    let provider = uvspec(&input, &output, vec![("path_transmittance", constant(0.8))]).unwrap();
    let sky = solve(&provider);
    follows(sky.solar_irradiance(), 1e-5, e_s);
    follows(sky.sun_transmittance(), 1e-5, tau_1);
    follows(sky.diffuse_irradiance(), 1e-5, sky_integral);
    for (zenith, azimuth) in [(0.0, 10.0), (30.0, 45.0), (45.0, 90.0), (60.0, -135.0), (80.0, 180.0), (85.0, 0.0)] {
        follows(&radiance(&*sky, zenith, azimuth), 1e-4, |l| l_d(l, zenith.min(80.0), azimuth));
    }
    follows(&path(&*sky, 0.0, 7e5).1, 1e-4, l_u);
    let told = provider.report().join("\n");
    assert!(told.contains("L_u over a black ground for view zenith 0 deg"), "{told}");
    // A ground that reflects has its light in what goes up.
    let over_grey = input.replace("albedo 0", "albedo 0.2");
    let provider = uvspec(&over_grey, &output, vec![("path_transmittance", constant(0.8))]).unwrap();
    assert!(provider.report().iter().any(|line| line.contains("over a ground that reflects is no L_u")));
    assert!(solve_for(&provider, sun(), ALL).err().unwrap().message.contains("no L_u"));
    // A diffuse irradiance of the sky's directions by half: one of the two is wrong.
    let halved: String = output
        .lines()
        .map(|line| match line.split_whitespace().collect::<Vec<_>>().as_slice() {
            // Rows and lines of radiance both have seven cells; wavelengths are the ones beyond 1.
            [nm, edir, edn, rest @ ..] if rest.len() == 4 && nm.parse::<f64>().unwrap() > 1.0 => {
                format!("{nm} {edir} {} {}\n", 0.5 * edn.parse::<f64>().unwrap(), rest.join(" "))
            }
            _ => format!("{line}\n"),
        })
        .collect();
    let error = uvspec(&input.replace("albedo 0", "albedo 0.2"), &halved, stated()).err().unwrap();
    assert!(error.code == "M05" && error.message.contains("but the sky in directions gives"), "{error}");
}

/// With `output_user` the columns are those that the input says; with transmittance and reflectivity E_s comes from
/// elsewhere.
#[test]
fn uvspec_columns_and_quantities_are_those_of_the_input() {
    let nodes: Vec<f64> = (0..=60).map(|i| 490.0 + 2.0 * f64::from(i)).collect();
    let columns = |of: &dyn Fn(f64) -> Vec<f64>| -> String {
        nodes
            .iter()
            .map(|nm| {
                let cells: String = of(1e-3 * nm).iter().map(|v| format!(" {v:.8e}")).collect();
                format!("{nm:.3}{cells}\n")
            })
            .collect()
    };
    let solar = || {
        let rows: Vec<(f64, f64)> = nodes.iter().map(|nm| (1e-3 * nm, e_s(1e-3 * nm))).collect();
        Value::Spectrum(SpectralValue::Curve(sunglint_radiometry::Curve::linear(&rows).unwrap()))
    };
    let quantities: [(&str, &str, f64); 4] = [
        ("", "w_m2_nm", 1e-3),
        ("", "w_m2_um", 1.0),
        ("output_quantity transmittance\n", "mw_m2_nm", 0.0),
        ("output_quantity reflectivity\n", "mw_m2_nm", 0.0),
    ];
    for (i, (line, unit, scale)) in quantities.into_iter().enumerate() {
        let over = |l: f64| match i {
            0 | 1 => 1.0 / scale,
            2 => e_s(l),
            _ => e_s(l) * mu(),
        };
        let output = columns(&|l| {
            let (direct, diffuse) = (e_s(l) * tau_1(l) * mu() / over(l), e_d(l) / over(l));
            vec![40.0, direct + diffuse, direct]
        });
        let input = format!("{INPUT}output_user lambda sza eglo edir\n{line}");
        let mut given = stated();
        given.extend([("solar_irradiance", solar()), ("uvspec_units", Value::Word(unit.to_string()))]);
        let sky = solve(&uvspec(&input, &output, given).unwrap());
        follows(sky.sun_transmittance(), 1e-4, tau_1);
        follows(sky.diffuse_irradiance(), 2e-4, e_d);
        follows(sky.solar_irradiance(), 1e-9, e_s);
    }
    // uu stands for umu by phi, phi first; radiance in units of E_s cos θ/π.
    let input = format!("{INPUT}umu -1 -0.5\nphi 30 210\noutput_user lambda uu edir\noutput_quantity reflectivity\n");
    let unit = |l: f64| e_s(l) * mu() / PI;
    let output = columns(&|l| {
        let mut row: Vec<f64> =
            [(0.0, 0.0), (0.0, 180.0), (60.0, 0.0), (60.0, 180.0)].map(|(z, a)| l_d(l, z, a) / unit(l)).into();
        row.push(tau_1(l));
        row
    });
    let mut given = stated();
    given.push(("solar_irradiance", solar()));
    let sky = solve(&uvspec(&input, &output, given).unwrap());
    follows(&radiance(&*sky, 60.0, 90.0), 2e-4, |l| l_d(l, 60.0, 90.0));
    follows(sky.sun_transmittance(), 1e-4, tau_1);
    // Without phi the azimuthal mean is a sky alike all round.
    let input = format!("{INPUT}umu -1 -0.5\n");
    let output: String = nodes
        .iter()
        .map(|nm| format!("{nm} {:e} {:e} 0 0 0 0\n -1.0 50.0\n -0.5 50.0\n", e_s(1e-3 * nm) * 0.6 * mu(), 50.0 * PI))
        .collect();
    let mut given = stated();
    given.push(("solar_irradiance", solar()));
    let sky = solve(&uvspec(&input, &output, given).unwrap());
    follows(sky.diffuse_irradiance(), 1e-9, |_| 50.0 * PI);
    follows(&radiance(&*sky, 20.0, 77.0), 1e-9, |_| 50.0);
}

#[test]
fn a_faulty_uvspec_is_refused_where_it_is_faulty() {
    let row = "500 1.0e2 1.0e2 0 0 0 0\n";
    let plain = "500 1.0e2 1.0e2 0 0 0 0\n600 1.0e2 1.0e2 0 0 0 0\n";
    for (input, output, code, words) in [
        (INPUT.to_string(), String::new(), "F01", "run.out: no rows"),
        (INPUT.to_string(), "500 1 2\n".to_string(), "F01", "run.out, line 1: 3 numbers where 7 are due"),
        (INPUT.to_string(), format!("{row}501 1 x 0 0 0 0\n"), "F01", "run.out, line 2: `x` is no number"),
        (INPUT.to_string(), format!("{row}nan 1 0 0 0 0 0\n"), "F01", "run.out, line 2: `nan`"),
        (INPUT.to_string(), format!("{row}{row}"), "M05", "run.out, line 2: wavelength 500 nm more often"),
        (INPUT.to_string(), format!("{row}400 1 1 0 0 0 0\n"), "M05", "run.out, line 2: wavelength 0.400000 um"),
        (INPUT.to_string(), "500 100 -3 0 0 0 0\n".to_string(), "U05", "run.out, line 1: diffuse_irradiance is -3"),
        (format!("{INPUT}zout 0 5\n"), plain.to_string(), "M05", "run.out, line 1: 2 levels (zout) are due"),
        (format!("{INPUT}umu -0.5\n"), row.to_string(), "F01", "run.out, line 1: the radiances below this row lack"),
        (format!("{INPUT}umu -0.5\n"), format!("{row}-0.7 3\n"), "F01", "run.out, line 2: umu -0.7 where -0.5"),
        (format!("{INPUT}umu -0.5\nphi 0 9\n"), format!("{row} 0 8\n"), "F01", "run.out, line 2: these phi"),
        (format!("{INPUT}sza 30\n"), plain.to_string(), "F01", "run.inp, line 9: sza is said twice"),
        (INPUT.replace("sza 40", "sza x"), plain.to_string(), "F01", "run.inp, line 4: `x` of sza"),
        (INPUT.replace("sza 40", ""), plain.to_string(), "F01", "run.inp: no `sza`"),
        (INPUT.replace("source solar", "source thermal"), plain.to_string(), "F01", "run.inp, line 3: a source"),
        (
            INPUT.replace("disort", "mystic"),
            plain.to_string(),
            "F01",
            "run.inp, line 6: the columns of solver `mystic`",
        ),
        (format!("{INPUT}output_process sum\n"), plain.to_string(), "F01", "run.inp, line 9: `output_process`"),
        (format!("{INPUT}mol_abs_param kato2\n"), plain.to_string(), "F01", "run.inp, line 9: `mol_abs_param kato2`"),
        (
            format!("{INPUT}output_user edir\n"),
            plain.to_string(),
            "F01",
            "run.inp, line 9: `output_user` without lambda",
        ),
        (format!("{INPUT}umu 0\n"), plain.to_string(), "F01", "run.inp, line 9: umu 0"),
        (format!("{INPUT}include more.inp\n"), plain.to_string(), "F01", "run.inp, line 9: an input with `include`"),
        // 2000 W m⁻² nm⁻¹: not the sun.
        (INPUT.to_string(), "500 2e6 1 0 0 0 0\n600 2e6 1 0 0 0 0\n".to_string(), "M05", "the direct beam is"),
    ] {
        let error = uvspec(&input, &output, stated()).err().unwrap();
        assert_eq!(error.code, code, "{words}: {error}");
        assert!(error.message.contains(words), "{words} / {error}");
    }
    assert!(fault(&[("uvspec", plain)]).help.unwrap().contains("uvspec_input"));
}

// ---- 6S ----

/// A report in 6S's frame. Made up; the numbers are those of the closed forms above.
fn report(wavelengths: &str, filter: Option<f64>, l: f64, view_deg: f64) -> String {
    let mut text = format!("\n\n*{} 6SV version 1.1 {}*\n", "*".repeat(30), "*".repeat(29));
    let mut line = |inside: &str| writeln!(text, "*{inside:<77}*").unwrap();
    line("                       geometrical conditions identity");
    line("                       -------------------------------");
    line("   month:  7 day :  5");
    line(&format!("   solar zenith angle:  {ZENITH:6.2} deg  solar azimuthal angle:      100.00 deg"));
    line(&format!("   view zenith angle:   {view_deg:6.2} deg  view azimuthal angle:        50.00 deg"));
    line("   scattering angle:    159.14 deg  azimuthal angle difference:  50.00 deg");
    line("                       spectral condition");
    line(wavelengths);
    line("                        integrated values of  :");
    line("       apparent reflectance  0.1234567  appar. rad.(w/m2/sr/mic)   53.322");
    line("                   total gaseous transmittance  0.972");
    line("                      irr. at ground level (w/m2/mic)");
    line("     direct solar irr.    atm. diffuse irr.    environment  irr");
    let (direct, diffuse) = (e_s(l) * tau_1(l) * mu(), e_d(l));
    line(&format!("          {direct:10.3}          {:10.3}          {:10.3}", 0.9 * diffuse, 0.1 * diffuse));
    line("                      rad at satel. level (w/m2/sr/mic)");
    line("     atm. intrin. rad.    background  rad.    pixel  radiance");
    line(&format!("          {:10.3}          {:10.3}          {:10.3}", 0.8 * l_u(l), 0.2 * l_u(l), 12.3));
    match filter {
        None => {
            line("                      sol. spect (in w/m2/mic)");
            line(&format!("                              {:10.3}", e_s(l)));
        }
        Some(width) => {
            line("          int. funct filter (in mic)              int. sol. spect (in w/m2)");
            line(&format!("          {width:12.7}                              {:10.3}", width * e_s(l)));
        }
    }
    line("                                downward        upward          total");
    let depth = 0.15 * (0.55 / l).powi(2);
    line("      global gas. trans. :     0.98000        0.99000        0.97000");
    line("      total  sca.   \"    :     0.90000        0.95000        0.86000");
    line("                             rayleigh       aerosols         total");
    line("      spherical albedo   :     0.05410        0.05290        0.09268");
    line(&format!("      optical depth total:     0.00000        0.00000        {depth:.5}"));
    line(&format!("      optical depth plane:     0.00000        0.00000        {depth:.5}"));
    text
}

fn monochromatic(l: f64, view_deg: f64) -> String {
    report(&format!("           monochromatic calculation at wl :{l:6.3} micron"), None, l, view_deg)
}

/// Reports of 6S one below the other are a spectrum. Three decimals of a radiance of 20 leave 3e-5.
#[test]
fn reports_of_6s_are_a_spectrum() {
    let text: String = (0..=24).map(|i| monochromatic(0.49 + 0.005 * f64::from(i), 20.0)).collect();
    let provider = files(&[("sixs", &text)]).unwrap();
    let sky = solve(&provider);
    follows(sky.solar_irradiance(), 1e-5, e_s);
    follows(sky.sun_transmittance(), 2e-4, tau_1);
    follows(sky.diffuse_irradiance(), 5e-4, e_d);
    let (tau, up) = path(&*sky, 20.0, 7e5);
    follows(&up, 1e-3, l_u);
    follows(&tau, 2e-4, |l| 0.99 * (-0.15 * (0.55 / l).powi(2) / 20f64.to_radians().cos()).exp());
    let told = provider.report().join("\n");
    assert!(
        told.contains("25 reports, the sun at zenith 40 deg") && told.contains("L_u for view zenith 20 deg"),
        "{told}"
    );
    // Two views: between them straight lines.
    let two = text.clone() + &(0..=24).map(|i| monochromatic(0.49 + 0.005 * f64::from(i), 0.0)).collect::<String>();
    let sky = solve(&files(&[("sixs", &two)]).unwrap());
    let [a, b, c] = [0.0, 10.0, 20.0].map(|view| path(&*sky, view, 7e5).0[0]);
    assert!(a > c && (b - 0.5 * (a + c)).abs() < 1e-9);
}

/// Means of two bands that touch hold all over each.
#[test]
fn bands_of_6s_are_steps() {
    let band = |first: f64, last: f64| {
        report(
            &format!("               wl inf={first:6.3} mic   wl sup={last:6.3} mic"),
            Some(0.8 * (last - first)),
            0.5 * (first + last),
            0.0,
        )
    };
    let text = band(0.5, 0.55) + &band(0.55, 0.6);
    let sky = solve(&files(&[("sixs", &text)]).unwrap());
    for (i, l) in grid().wavelengths_um().iter().enumerate() {
        let centre = if *l < 0.55 { 0.525 } else { 0.575 };
        assert!((sky.solar_irradiance()[i] / e_s(centre) - 1.0).abs() < 2e-5);
        assert!((sky.diffuse_irradiance()[i] / e_d(centre) - 1.0).abs() < 1e-5);
    }
}

#[test]
fn a_faulty_report_of_6s_is_refused_where_it_is_faulty() {
    let good = monochromatic(0.5, 0.0);
    for (text, code, words) in [
        ("no report\n".to_string(), "F01", "no report of 6S"),
        (
            good.replace("direct solar irr.", "direct"),
            "F01",
            "line 3: the report that begins here lacks its irradiances",
        ),
        (good.replace("solar zenith angle:   40.00", "solar zenith angle:   4o.00"), "F01", "line 7: `4o.00`"),
        (
            good.replace("solar zenith angle:   40.00", "solar zenith angle:   95.00"),
            "U05",
            "line 7: solar zenith angle 95",
        ),
        (good.replace("0.500 micron", "-.500 micron"), "U05", "line 11: no wavelengths of light"),
        (good.replace("      12.300", "  **********"), "F01", "line 20: a number that did not fit"),
        (good.replace("      12.300", ""), "F01", "line 20: 2 numbers where 3 are due"),
        (
            good.replace(&format!("{:10.3}", e_s(0.5)), "     0.000"),
            "U05",
            "line 22: the solar spectrum is not positive",
        ),
        (good.replace(&format!("{:10.3}", e_s(0.5)), "   500.000"), "U05", "line 17: sun_transmittance is"),
        (good.clone() + &monochromatic(0.4, 0.0), "M05", "wavelength 0.400000 um of solar_irradiance does not ascend"),
    ] {
        let error = fault(&[("sixs", &text)]);
        assert_eq!(error.code, code, "{words}: {error}");
        assert!(error.message.contains(words), "{words} / {error}");
    }
    let beginning = &good[..good.find("rad at satel").unwrap()];
    assert!(fault(&[("sixs", beginning)]).message.contains("line 3: the report that begins here lacks its"));
}

/// Mutated and truncated files give a table or a fault, never a panic; a fault of a file names it.
#[test]
fn broken_files_of_other_codes_never_panic() {
    let mut seed = 7_u64;
    let mut random = |n: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % n
    };
    let input = format!("{INPUT}umu -1 -0.5 1\nphi 30 210\nzout 0 toa\n");
    let row = "0 0 0 0\n 30 210\n -1 5 5 5\n -0.5 5 5 5\n 1 5 5 5\n";
    let output: String = [500, 600].map(|nm| format!("{nm} 900 15 {row}{nm} 1400 0 {row}")).concat();
    let report = monochromatic(0.5, 0.0) + &monochromatic(0.6, 10.0);
    let cases: [&[(&str, &str)]; 4] = [
        &[("tape7", TWO_VIEWS), ("tape7_sun", SUN)],
        &[("tape7_sky", SKY), ("tape7_sun", TRANSMITTANCE)],
        &[("uvspec", &output), ("uvspec_input", &input)],
        &[("sixs", &report)],
    ];
    let mut refused = 0;
    for round in 0..4_000 {
        let case = cases[round % cases.len()];
        let broken = random(case.len());
        let mut given = Vec::new();
        for (i, (param, text)) in case.iter().enumerate() {
            let mut text = text.as_bytes().to_vec();
            if i == broken {
                for _ in 0..1 + random(4) {
                    let at = random(text.len().max(1)).min(text.len().saturating_sub(1));
                    match random(5) {
                        _ if text.is_empty() => {}
                        0 => text[at] = random(256) as u8,
                        1 => drop(text.remove(at)),
                        2 => text.truncate(at),
                        3 => drop(text.drain(at..(at + random(300)).min(text.len()))),
                        _ => text.insert(at, b"0123456789-.eE *\n\tFREQ9"[random(23)]),
                    }
                }
            }
            given.push((*param, bytes(&format!("{param}.txt"), &text)));
        }
        match bind(given) {
            Ok(provider) => drop(solve_for(&provider, sun(), ALL)),
            Err(error) => {
                refused += 1;
                assert!(!error.message.is_empty() && error.code.len() == 3, "{error}");
            }
        }
    }
    assert!(refused > 500, "{refused}");
    for (param, text) in [("tape7_sun", SUN), ("sixs", report.as_str())] {
        for end in (0..text.len()).filter(|end| text.is_char_boundary(*end) && end % 7 == 0) {
            let _ = files(&[(param, &text[..end])]);
        }
    }
}
