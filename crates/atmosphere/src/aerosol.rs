//! Aerosol models behind one trait: those of Shettle & Fenn as LOWTRAN 7 tabulates them, and one given by the user.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use sunglint_plugin::{
    Args, BindError, Column as TableColumn, Default, Model, ModelInfo, Param, SpectralValue, Table, TableKey,
};
use sunglint_radiometry::{Curve, Dimension, SpectralGrid};

use crate::phase::Phase;

/// An aerosol: its optical properties at any wavelength and humidity. How much of it the air holds, and where, the
/// weather says.
pub trait Aerosol: Send + Sync + std::fmt::Debug {
    /// Properties at a wavelength \[µm\] in air of a relative humidity 0..1, which shapes the particles.
    fn optics(&self, wavelength: f64, humidity: f64) -> AerosolOptics;

    /// Whether it is the aerosol of the whole column, as the sun's photometers see it; otherwise it fills the boundary
    /// layer.
    fn fills_column(&self) -> bool {
        false
    }

    /// Wavelengths it speaks for \[µm\].
    fn domain(&self) -> (f64, f64);
}

/// Optical properties of an aerosol at one wavelength.
#[derive(Clone, Debug)]
pub struct AerosolOptics {
    /// Extinction over that at 0.55 µm.
    pub extinction: f64,
    /// Single-scattering albedo ω.
    pub albedo: f64,
    /// Phase function.
    pub(crate) phase: Arc<Phase>,
}

/// The aerosols this build knows.
pub const AEROSOLS: &[Model<dyn Aerosol>] = &[RURAL, URBAN, MARITIME, TROPOSPHERIC, ANGSTROM];

/// The aerosol of a scene that names none.
pub(crate) const DEFAULT: &str = "rural";

macro_rules! manual {
    ($head:literal) => {
        concat!(
            $head,
            "
Extinction and absorption against the extinction at 0.55 µm, and asymmetry g, stand at 10 wavelengths from 0.2 to
2.5 µm and relative humidities of 0, 70, 80 and 99 %, as LOWTRAN 7 has them [Shettle1979, Kneizys1988].
  ln of a value is straight in ln λ, and in ln(100 − RH) between humidities as in LOWTRAN 7; above 99 % it is held
  ω = 1 − absorption/extinction
  P: the model's classes of LOWTRAN 7 (34 angles, exponential between them, normalised here); the two whose asymmetry
     encloses g are mixed so that the mixture has g. Within 2° of the sun the peak is coarse.

The model fills the air to 2 km above the site. Above it stand, as in LOWTRAN 7, tropospheric aerosol to 10 km,
background stratospheric to 30 km and meteoric dust; between regions one gives way to the next over 1 km, and over
5 km at 30 km. Each region has one humidity, the mean over its aerosol. How much there is the weather says: `aod` or `visibility`.

Validity: averages over a kind of air, not over a day.

In a scene
  weather { aerosol rural, visibility 23 km }
"
        )
    };
}

const RURAL_MANUAL: &str = manual!(
    "Rural aerosol: 70 % water-soluble and 30 % dust-like particles, two lognormal sizes that grow with humidity.\n"
);
const URBAN_MANUAL: &str =
    manual!("Urban aerosol: the rural one, 80 %, with 20 % of soot-like particles of the same sizes.\n");
const MARITIME_MANUAL: &str = manual!(
    "Maritime aerosol: sea salt that grows with humidity, and the rural aerosol without its large particles.\n"
);
const TROPOSPHERIC_MANUAL: &str = manual!(
    "Tropospheric aerosol: the rural one without its large particles, for very clear air (visibility beyond 50 km).\n"
);

const RURAL: Model<dyn Aerosol> = Model {
    info: ModelInfo {
        name: "rural",
        summary: "continental air away from towns: water-soluble and dust-like particles",
        manual: RURAL_MANUAL,
        params: &[],
    },
    bind: |_: &Args, _: &SpectralGrid| Ok(tabulated("rural")),
};

const URBAN: Model<dyn Aerosol> = Model {
    info: ModelInfo {
        name: "urban",
        summary: "rural air with a fifth of soot-like particles",
        manual: URBAN_MANUAL,
        params: &[],
    },
    bind: |_: &Args, _: &SpectralGrid| Ok(tabulated("urban")),
};

const MARITIME: Model<dyn Aerosol> = Model {
    info: ModelInfo {
        name: "maritime",
        summary: "air of the oceans: sea salt and a continental background",
        manual: MARITIME_MANUAL,
        params: &[],
    },
    bind: |_: &Args, _: &SpectralGrid| Ok(tabulated("maritime")),
};

const TROPOSPHERIC: Model<dyn Aerosol> = Model {
    info: ModelInfo {
        name: "tropospheric",
        summary: "clean air: rural without its large particles",
        manual: TROPOSPHERIC_MANUAL,
        params: &[],
    },
    bind: |_: &Args, _: &SpectralGrid| Ok(tabulated("tropospheric")),
};

const ANGSTROM_MANUAL: &str = "\
An aerosol by numbers, the same at all heights and humidities.

  extinction(λ)/extinction(0.55 µm) = (λ/0.55 µm)^(−α)                              [Angstrom1929]
  ω(λ)  `single_scattering_albedo`
  P     Henyey–Greenstein's of `asymmetry` g(λ) [Henyey1941]; or `phase`, a table against scattering angle

The table may hold a column `wavelength_nm`: then P is straight in wavelength between those given and held beyond them.
Its values may have any scale; P is exponential between angles, constant beyond them, and normalised. The optical
depth of the column follows α exactly, as a sun photometer reports it, so this aerosol also fills the stratosphere;
its spread over height is that of LOWTRAN 7.

Validity: α, ω and g of one day from AERONET or a nephelometer serve as they stand. Henyey–Greenstein's P is too low
beyond 150°.

In a scene
  weather { aod 0.12, aerosol angstrom { exponent 1.5, single_scattering_albedo 0.92 } }
";

const ANGSTROM: Model<dyn Aerosol> = Model {
    info: ModelInfo {
        name: "angstrom",
        summary: "an aerosol by numbers: Ångström's exponent, ω, and g or a phase function",
        manual: ANGSTROM_MANUAL,
        params: &[
            Param::quantity("exponent", Dimension::Fraction, Default::Number(1.3), "Ångström's exponent α")
                .within(-1.0, 4.0),
            Param::spectrum(
                "single_scattering_albedo",
                Dimension::Fraction,
                Default::Number(0.93),
                "single-scattering albedo ω",
            )
            .within(0.0, 1.0),
            Param::spectrum("asymmetry", Dimension::Fraction, Default::Number(0.65), "asymmetry g").within(-0.95, 0.95),
            Param::table(
                "phase",
                &[
                    TableColumn {
                        name: "scattering_angle",
                        dimension: Dimension::Angle,
                        range: (0.0, std::f64::consts::PI),
                    },
                    TableColumn { name: "phase", dimension: Dimension::Fraction, range: (0.0, 1e12) },
                ],
                Default::Absent,
                "phase function against scattering angle, of any scale",
            )
            .excludes(&["asymmetry"]),
        ],
    },
    bind: |args: &Args, _: &SpectralGrid| -> Result<Arc<dyn Aerosol>, BindError> {
        let spectrum = |name: &'static str, unsaid: f64| match args.spectral(name) {
            None => Ok(Curve::constant(unsaid)),
            Some(SpectralValue::Constant(value)) => Ok(Curve::constant(*value)),
            Some(SpectralValue::Curve(curve)) => Ok(curve.clone()),
            Some(SpectralValue::PerBand(_)) => {
                Err(BindError::new("M04", name, format!("`{name}` of an aerosol belongs to wavelengths, not to bands"))
                    .help("give one number, or a table against wavelength"))
            }
        };
        let phase = match args.table("phase") {
            None => Angular::HenyeyGreenstein(spectrum("asymmetry", 0.65)?),
            Some(table) => Angular::Tables(phase_tables(table)?),
        };
        Ok(Arc::new(Angstrom {
            exponent: args.number("exponent").unwrap_or(1.3),
            albedo: spectrum("single_scattering_albedo", 0.93)?,
            phase,
        }))
    },
};

/// Phase functions by wavelength \[µm\], ascending.
fn phase_tables(table: &Table) -> Result<Phases, BindError> {
    let fault = |message: String| BindError::new("M05", "phase", message);
    let mut parts: BTreeMap<u64, Vec<(f64, f64)>> = BTreeMap::new();
    for (i, row) in table.rows.iter().enumerate() {
        let key = match &table.key {
            TableKey::None => 0.55,
            TableKey::Wavelength(wavelengths) => wavelengths[i],
            TableKey::Band(_) => {
                return Err(fault("a phase function belongs to wavelengths, not to bands".to_string())
                    .help("use a column `wavelength_nm`"));
            }
        };
        // Positive numbers are ordered as their bits are.
        parts.entry(key.max(0.0).to_bits()).or_default().push((row[0], row[1]));
    }
    if parts.is_empty() {
        return Err(fault("the phase function has no rows".to_string()));
    }
    (parts.into_iter())
        .map(|(bits, rows)| {
            let (angles, values): (Vec<f64>, Vec<f64>) = rows.iter().copied().unzip();
            if angles.len() < 2 || angles.windows(2).any(|pair| pair[1] <= pair[0]) {
                return Err(fault("scattering angles must ascend, two at least".to_string()));
            }
            if values.iter().all(|value| *value <= 0.0) {
                return Err(fault("the phase function is 0 at every angle".to_string()));
            }
            Ok((f64::from_bits(bits), Arc::new(Phase::table(&angles, &values))))
        })
        .collect()
}

#[derive(Debug)]
enum Angular {
    HenyeyGreenstein(Curve),
    Tables(Phases),
}

#[derive(Debug)]
struct Angstrom {
    exponent: f64,
    albedo: Curve,
    phase: Angular,
}

impl Aerosol for Angstrom {
    fn optics(&self, wavelength: f64, _humidity: f64) -> AerosolOptics {
        let phase = match &self.phase {
            Angular::HenyeyGreenstein(g) => Arc::new(Phase::henyey_greenstein(g.at(wavelength).clamp(-0.95, 0.95))),
            Angular::Tables(tables) => between(tables, wavelength),
        };
        AerosolOptics {
            extinction: (wavelength / REFERENCE).powf(-self.exponent),
            albedo: self.albedo.at(wavelength).clamp(0.0, 1.0),
            phase,
        }
    }

    fn fills_column(&self) -> bool {
        true
    }

    fn domain(&self) -> (f64, f64) {
        let of = |curve: &Curve| match curve.covers(0.0, 1e3) {
            true => (0.0, f64::INFINITY),
            false => curve.domain(),
        };
        let (first, last) = of(&self.albedo);
        match &self.phase {
            Angular::HenyeyGreenstein(g) => (first.max(of(g).0), last.min(of(g).1)),
            Angular::Tables(_) => (first, last),
        }
    }
}

/// The wavelength of optical depths and visibilities \[µm\].
pub(crate) const REFERENCE: f64 = 0.55;

/// The mixture at `x` of phase functions in ascending order of x, held beyond the ends.
pub(crate) fn between(phases: &[(f64, Arc<Phase>)], x: f64) -> Arc<Phase> {
    let i = phases.partition_point(|(at, _)| *at <= x);
    if i == 0 || i == phases.len() {
        return Arc::clone(&phases[i.saturating_sub(1)].1);
    }
    let ((a, below), (b, above)) = (&phases[i - 1], &phases[i]);
    let t = (x - a) / (b - a);
    Arc::new(Phase::mix(vec![(1.0 - t, Arc::clone(below)), (t, Arc::clone(above))]))
}

/// A model of Shettle & Fenn, or one of those that know no humidity.
#[derive(Debug)]
pub(crate) struct ShettleFenn {
    /// One or four.
    humidities: Vec<Humid>,
    /// Distinct phase functions by ascending asymmetry.
    classes: Phases,
}

/// The table at one humidity.
#[derive(Debug, std::default::Default)]
struct Humid {
    /// ln(100 − RH), RH in percent; descending.
    dryness: f64,
    /// ln λ, extinction, absorption, g.
    rows: Vec<[f64; 4]>,
}

/// Phase functions, each with what it is ordered by.
type Phases = Vec<(f64, Arc<Phase>)>;

/// Distinct columns of the phase table by model, in order of asymmetry.
static CLASSES: LazyLock<Vec<(String, Phases)>> = LazyLock::new(|| {
    let text = include_str!("../data/aerosol_phase_lowtran7.csv");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().expect("a header").split(',').skip(1).collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|cell| cell.trim().parse().expect("numbers")).collect()).collect();
    let angles: Vec<f64> = rows.iter().map(|row| row[0].to_radians()).collect();
    let mut made: Vec<(Vec<f64>, f64, Arc<Phase>)> = Vec::new();
    let mut models: Vec<(String, Phases)> = Vec::new();
    for (i, name) in names.iter().enumerate() {
        let values: Vec<f64> = rows.iter().map(|row| row[i + 1]).collect();
        let (g, phase) = match made.iter().find(|(known, ..)| *known == values) {
            Some((_, g, phase)) => (*g, Arc::clone(phase)),
            None => {
                let phase = Arc::new(Phase::table(&angles, &values));
                let g = phase.asymmetry();
                made.push((values, g, Arc::clone(&phase)));
                (g, phase)
            }
        };
        let model = name.split(['@']).next().unwrap_or(name).split("_rh").next().unwrap_or(name);
        let at = models.iter().position(|(known, _)| known == model).unwrap_or_else(|| {
            models.push((model.to_string(), Vec::new()));
            models.len() - 1
        });
        if !models[at].1.iter().any(|(known, _)| *known == g) {
            models[at].1.push((g, phase));
        }
    }
    models.iter_mut().for_each(|(_, classes)| classes.sort_by(|a, b| a.0.total_cmp(&b.0)));
    models
});

static SHETTLE_FENN: LazyLock<Vec<(&'static str, Arc<ShettleFenn>)>> = LazyLock::new(|| {
    let mut models: Vec<(&'static str, ShettleFenn)> = Vec::new();
    let text = include_str!("../data/aerosol_shettle_fenn_lowtran7.csv");
    for line in text.lines().skip_while(|line| !line.starts_with("model")).skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].trim().parse::<f64>();
        let (humidity, wavelength) = (number(1).unwrap_or(0.0), number(2).expect("numbers"));
        let row =
            [wavelength.ln(), number(3).expect("numbers"), number(4).expect("numbers"), number(5).expect("numbers")];
        if models.last().is_none_or(|(name, _)| *name != cells[0]) {
            models.push((cells[0], ShettleFenn { humidities: Vec::new(), classes: classes(cells[0]) }));
        }
        let model = &mut models.last_mut().expect("one was pushed").1;
        let dryness = (100.0 - humidity).ln();
        if model.humidities.last().is_none_or(|last| last.dryness != dryness) {
            model.humidities.push(Humid { dryness, rows: Vec::new() });
        }
        model.humidities.last_mut().expect("one was pushed").rows.push(row);
    }
    models.into_iter().map(|(name, model)| (name, Arc::new(model))).collect()
});

/// The classes of a model, and beyond their asymmetries those of the tropospheric model below and of the maritime one
/// above, so that they enclose every g of its table.
fn classes(model: &str) -> Phases {
    let of = |model: &str| CLASSES.iter().find(|(name, _)| name == model).map(|(_, classes)| classes.clone());
    let model = if model == "background_stratospheric" { "stratospheric" } else { model };
    let mut own = of(model).unwrap_or_default();
    let (least, most) = (own.first().map_or(1.0, |own| own.0), own.last().map_or(-1.0, |own| own.0));
    own.extend(of("tropospheric").unwrap_or_default().into_iter().filter(|(g, _)| *g < least));
    own.extend(of("maritime").unwrap_or_default().into_iter().filter(|(g, _)| *g > most.max(least)));
    own.sort_by(|a, b| a.0.total_cmp(&b.0));
    own
}

/// A model of the table, by its name there.
///
/// # Panics
/// For a name that the table lacks: names are part of the program.
pub(crate) fn tabulated(name: &str) -> Arc<ShettleFenn> {
    let found = SHETTLE_FENN.iter().find(|(known, _)| *known == name);
    Arc::clone(&found.expect("the table holds every model that is named").1)
}

impl Aerosol for ShettleFenn {
    fn optics(&self, wavelength: f64, humidity: f64) -> AerosolOptics {
        let dryness = (100.0 * (1.0 - humidity.clamp(0.0, 0.99))).ln();
        let above = self.humidities.partition_point(|humid| humid.dryness >= dryness);
        let [extinction, absorption, g] = match above {
            0 => self.humidities[0].at(wavelength),
            i if i == self.humidities.len() => self.humidities[i - 1].at(wavelength),
            i => {
                let (dry, wet) = (&self.humidities[i - 1], &self.humidities[i]);
                let t = (dryness - dry.dryness) / (wet.dryness - dry.dryness);
                let (a, b) = (dry.at(wavelength), wet.at(wavelength));
                std::array::from_fn(|j| geometric(a[j], b[j], t))
            }
        };
        AerosolOptics { extinction, albedo: 1.0 - absorption / extinction, phase: between(&self.classes, g) }
    }

    fn domain(&self) -> (f64, f64) {
        let rows = &self.humidities[0].rows;
        (rows[0][0].exp(), rows[rows.len() - 1][0].exp())
    }
}

impl Humid {
    /// Extinction, absorption and g at a wavelength \[µm\].
    fn at(&self, wavelength: f64) -> [f64; 3] {
        let x = wavelength.ln();
        let i = self.rows.partition_point(|row| row[0] <= x).clamp(1, self.rows.len() - 1);
        let (a, b) = (&self.rows[i - 1], &self.rows[i]);
        let t = ((x - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0);
        std::array::from_fn(|j| geometric(a[j + 1], b[j + 1], t))
    }
}

/// Between two values, straight in the logarithm; straight in the value where one of them is 0.
fn geometric(a: f64, b: f64, t: f64) -> f64 {
    if a > 0.0 && b > 0.0 { a * (b / a).powf(t) } else { a + (b - a) * t }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_plugin::Value;

    /// Rows of the table itself, at its own wavelengths and humidities.
    #[test]
    fn a_model_gives_back_its_table() {
        for (name, wavelength, humidity, row) in [
            ("rural", 0.6943, 0.7, [0.753_16, 0.046_84, 0.6498]),
            ("rural", 0.55, 0.0, [1.0, 0.0, 0.6479]),
            ("maritime", 1.06, 0.99, [f64::NAN, f64::NAN, 0.8096]),
            ("tropospheric", 0.6943, 0.8, [f64::NAN, f64::NAN, 0.669]),
        ] {
            let optics = tabulated(name).optics(wavelength, humidity);
            let g = optics.phase.moments(1)[1];
            assert!((g - row[2]).abs() < 1e-6, "{name}: {g}");
            if row[1] > 0.0 {
                assert!((optics.extinction - row[0]).abs() < 1e-9);
                assert!((optics.albedo - (1.0 - row[1] / row[0])).abs() < 1e-9);
            }
        }
    }

    /// Between 80 and 99 % in ln(100 − RH): half way is at 100 − √(20·1) = 95.53 %.
    #[test]
    fn humidity_is_interpolated_in_the_dryness_of_the_air() {
        let model = tabulated("maritime");
        let at = |humidity: f64| model.optics(0.8, humidity).extinction;
        let half = 1.0 - (20.0f64).sqrt() / 100.0;
        assert!((at(half) / (at(0.8) * at(0.99)).sqrt() - 1.0).abs() < 1e-12);
        assert_eq!(at(1.0), at(0.99));
        assert!(at(0.99) > at(0.5));
    }

    #[test]
    fn every_aerosol_is_normalised_and_darker_than_white() {
        for model in AEROSOLS {
            let aerosol = (model.bind)(&Args::new(&model.info, []), &SpectralGrid::from_edges(&[])).unwrap();
            for wavelength in [0.4, 0.55, 0.7, 1.0] {
                let optics = aerosol.optics(wavelength, 0.6);
                assert!((0.4..=1.0).contains(&optics.albedo), "{} {}", model.info.name, optics.albedo);
                let chi = optics.phase.moments(4);
                assert!((chi[0] - 1.0).abs() < 1e-9 && (0.4..0.9).contains(&chi[1]), "{} {}", model.info.name, chi[1]);
            }
            assert!((aerosol.optics(0.55, 0.3).extinction - 1.0).abs() < 1e-9);
            assert!(model.info.manual.contains("In a scene") && !model.info.manual.contains("TODO"));
        }
    }

    fn angstrom(given: Vec<(&str, Value)>) -> Result<Arc<dyn Aerosol>, BindError> {
        let given = given.into_iter().map(|(name, value)| (name.to_string(), value));
        (ANGSTROM.bind)(&Args::new(&ANGSTROM.info, given), &SpectralGrid::from_edges(&[]))
    }

    /// A table of Henyey and Greenstein's function, a tenth of a degree apart, is that function.
    #[test]
    fn a_phase_table_stands_in_for_the_asymmetry() {
        let law = Phase::henyey_greenstein(0.6);
        let rows: Vec<Vec<f64>> = (0..=1800)
            .map(|i| f64::from(i) * std::f64::consts::PI / 1800.0)
            .map(|angle| vec![angle, 3.0 * law.value(angle.cos())])
            .collect();
        let both = [rows.clone(), rows.iter().map(|row| vec![row[0], 1.0]).collect()].concat();
        let keys = (0..both.len()).map(|i| if i < rows.len() { 0.4 } else { 0.8 }).collect();
        let table = Value::Table(Table { key: TableKey::Wavelength(keys), rows: both });
        let aerosol = angstrom(vec![("phase", table)]).unwrap();
        for (wavelength, g) in [(0.4, 0.6), (0.6, 0.3), (0.8, 0.0), (0.9, 0.0)] {
            let found = aerosol.optics(wavelength, 0.5).phase.moments(1)[1];
            assert!((found - g).abs() < 1e-4, "{wavelength}: {found}");
        }
    }

    #[test]
    fn what_makes_no_aerosol_is_told() {
        let per_band = Value::Spectrum(SpectralValue::PerBand(vec![("red".to_string(), 0.9)]));
        let code = |given| angstrom(given).err().map(|fault| fault.code);
        assert_eq!(code(vec![("single_scattering_albedo", per_band)]), Some("M04"));
        let table = |rows: Vec<Vec<f64>>| Value::Table(Table { key: TableKey::None, rows });
        assert_eq!(code(vec![("phase", table(vec![]))]), Some("M05"));
        assert_eq!(code(vec![("phase", table(vec![vec![0.1, 1.0], vec![0.1, 2.0]]))]), Some("M05"));
        assert_eq!(code(vec![("phase", table(vec![vec![0.1, 0.0], vec![0.2, 0.0]]))]), Some("M05"));
        let curve = Curve::linear(&[(0.5, 0.9), (0.6, 0.8)]).unwrap();
        let narrow = angstrom(vec![("asymmetry", Value::Spectrum(SpectralValue::Curve(curve)))]).unwrap();
        assert_eq!(narrow.domain(), (0.5, 0.6));
    }
}
