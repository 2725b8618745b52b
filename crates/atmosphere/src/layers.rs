//! Optical depths and phase functions of layers from a file, with multiple scattering solved.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, FileArg, Model, ModelInfo, Param, SpectralValue};
use sunglint_radiometry::{Dimension, SpectralGrid};

use crate::column_sky::{self, ColumnAir, Settings};
use crate::interpolation::OntoGrid;
use crate::ladder::Ladder;
use crate::medium::{Layer, Medium, Strata};
use crate::none::{self, HSRS};
use crate::phase::Phase;
use crate::radiance::streams;
use crate::strata::EARTH;
use crate::{Atmosphere, AtmosphereError, Column, Needs, SkyState, Sun, coverage};

const MANUAL: &str = "\
A problem of radiative transfer as stated: homogeneous layers over a Lambertian ground, each with its optical depth,
single-scattering albedo and phase function. Multiple scattering is solved as by `layered`; nothing is added to the layers.

CSV table: `file`
`#` begins a comment line; then one header line; then rows, one for each layer, component and wavelength. Columns may stand
in any order; units are part of the name.

  column                     unit       range
  top, bottom                _m _km     0..1000 km above the site; bottom below top
  optical_depth              none       0..1e6, vertical, of extinction by this component in this layer
  single_scattering_albedo   none       0..1
  phase                      a word     rayleigh, hg, or a name in `phase_functions`; may be empty where nothing is scattered
  asymmetry                  none       -1 < g < 1, of `hg` alone, which needs it
  depolarisation             none       0..1, of `rayleigh` alone; 0 where empty
  component                  a word     (optional) tells components of one layer apart
  wavelength                 _nm _um    (optional) empty: at all wavelengths

Layers may stand in any order. Together they reach from the ground, bottom 0, to the highest top without gap or overlap; a
clear stretch is a layer of optical depth 0. Components of one layer add. The wavelengths of a component ascend. Between them
τ, ωτ and ωτP go by straight lines, so phase functions mix by what they scatter; every band that is used lies within them (M04).
At most 200 layers, 500 components of layers, 200 000 rows, and a scattering optical depth of the whole of 1000.

CSV table: `phase_functions`
  name                       a word
  order, moment              none       χ_l, l = 0, 1, 2 … without gap; χ_0 = 1, -1..1; those not given are 0
  scattering_angle           _deg       ascending from 0 to 180
  phase_function             none       not negative, at these angles; exponential between them; of any scale
A function has rows of moments or rows of angles. At most 200 000 rows.

  P(Θ) = Σ_l (2l+1) χ_l P_l(cos Θ),  (1/4π) ∫ P dω = 1      so χ_1 = g, the mean cosine
  rayleigh   P = 3/(4(1+2γ)) [(1+3γ) + (1-γ) cos²Θ],  γ = ρ/(2-ρ)          [Chandrasekhar1960, Bodhaine1999]
  hg         P = (1-g²)/(1+g²-2g cos Θ)^(3/2),  χ_l = g^l                  [Henyey1941]
Moments whose sum falls below -0.1 at some angle are no phase function (M05); a sum that falls less far below 0, as cut-off
series do, is taken as 0 there, and `plan` says so.

  streams            directions of the discrete-ordinate solution, up to the next of 4, 8, 16, 32, 64; auto: 16
  geometry           plane: parallel layers, as problems are mostly posed; spherical: shells on a round Earth
  accuracy           azimuthal orders are added until what is left of the source, by their fall, is less than
                     this share of it
  solar_irradiance   E_s at 1 au; unless given, the TSIS-1 Hybrid Solar Reference Spectrum, version 2 [Coddington2023]

Validity: as the problem is stated. Air does not bend rays here, so suns are best given by angles. Where the file has
wavelengths, radiances are solved at every wavelength of the grid, which takes its time. Of the site only the elevation is
used, for the radius of the Earth; the ground is that of the scene. Nothing of the weather is used.

In a scene
  atmosphere layers { file \"slab.csv\", streams 32, solar_irradiance 1 W/m2/um }
  atmosphere layers { file \"haze.csv\", phase_functions \"dust.csv\", geometry spherical }
with, for example, in haze.csv
  top_km,bottom_km,component,wavelength_nm,optical_depth,single_scattering_albedo,phase,asymmetry
  100,2,air,,0.08,1,rayleigh,
  2,0,air,,0.02,1,rayleigh,
  2,0,haze,400,0.35,0.92,dust,
  2,0,haze,1000,0.15,0.88,hg,0.62
and in dust.csv
  name,scattering_angle_deg,phase_function
  dust,0,40
  dust,30,2
  dust,90,0.2
  dust,180,0.3
";

/// Layers from a file.
pub const MODEL: Model<dyn Atmosphere> = Model {
    info: ModelInfo {
        name: "layers",
        summary: "layers of given optical depth, single-scattering albedo and phase function, multiple scattering solved",
        manual: MANUAL,
        params: &[
            Param::file("file", Default::Required, "a CSV table of layers; `sunglint models layers` has its columns"),
            Param::file("phase_functions", Default::Absent, "a CSV table of moments or values of phase functions"),
            Param::count("streams", &["auto"], Default::Word("auto"), "directions of the discrete-ordinate solution")
                .within(4.0, 64.0),
            Param::word("geometry", &["plane", "spherical"], Default::Word("plane"), "shape of the layers"),
            Param::quantity(
                "accuracy",
                Dimension::Fraction,
                Default::Number(1e-3),
                "azimuthal orders that change the source by less are left out",
            )
            .within(1e-9, 0.1),
            Param::spectrum(
                "solar_irradiance",
                Dimension::Irradiance,
                Default::Absent,
                "at 1 au, normal incidence; the TSIS-1 HSRS spectrum unless given",
            )
            .within(0.0, 1e12),
        ],
    },
    bind: |args: &Args, _grid: &SpectralGrid| -> Result<Arc<dyn Atmosphere>, BindError> {
        let Some(file) = args.file("file") else {
            return Err(BindError::new("S05", "file", "layers need a file"));
        };
        let mut functions = Functions::default();
        if let Some(file) = args.file("phase_functions") {
            functions.read(file)?;
        }
        let (bounds, components) = stack(file, &mut functions)?;
        let settings = Settings {
            streams: args.count("streams").map_or(AUTOMATIC, streams),
            spherical: args.word("geometry") == Some("spherical"),
            accuracy: args.number("accuracy").unwrap_or(1e-3),
        };
        Ok(Arc::new(Layers {
            name: file.name.clone(),
            bounds,
            components,
            phases: functions.phases,
            notes: functions.notes,
            solar: args.spectral("solar_irradiance").cloned(),
            settings,
        }))
    },
};

/// Streams where none are asked for.
const AUTOMATIC: usize = 16;
const MOST_LAYERS: usize = 200;
const MOST_COMPONENTS: usize = 500;
const MOST_ROWS: usize = 200_000;
/// Highest top \[m\].
const HIGHEST: f64 = 1e6;
/// Bounds nearer than this are one \[m\]; no layer is thinner.
const ONE_BOUND: f64 = 1e-3;
/// Largest scattering optical depth of the whole.
const THICKEST: f64 = 1e3;
/// What a sum of moments may fall below 0.
const DEEPEST: f64 = -0.1;

/// A CSV table with named columns.
struct Sheet<'a> {
    param: &'static str,
    name: &'a str,
    columns: Vec<String>,
    records: Vec<csv::StringRecord>,
}

/// A column and its factor to canonical units.
#[derive(Clone, Copy)]
struct Source {
    column: usize,
    factor: f64,
}

const METRES: &[(&str, f64)] = &[("_m", 1.0), ("_km", 1e3)];
const MICROMETRES: &[(&str, f64)] = &[("_nm", 1e-3), ("_um", 1.0)];
const RADIANS: &[(&str, f64)] = &[("_deg", PI / 180.0)];
const PLAIN: &[(&str, f64)] = &[("", 1.0)];

impl<'a> Sheet<'a> {
    fn read(param: &'static str, file: &'a FileArg) -> Result<Self, BindError> {
        let bytes = file.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&file.bytes);
        let mut reader =
            csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).flexible(true).from_reader(bytes);
        let malformed = |error: &csv::Error| {
            let line = error.position().map_or(1, csv::Position::line);
            BindError::new("F01", param, format!("{}, line {line}: not a CSV table of UTF-8 text", file.name))
        };
        let columns = reader.headers().map_err(|error| malformed(&error))?.iter().map(str::to_string).collect();
        let mut sheet = Self { param, name: &file.name, columns, records: Vec::new() };
        for record in reader.records() {
            let record = record.map_err(|error| malformed(&error))?;
            let (found, due) = (record.len(), sheet.columns.len());
            if found != due {
                return Err(sheet.at(&record, "F01", &format!("{found} cells under a header of {due}")));
            }
            if sheet.records.len() == MOST_ROWS {
                return Err(sheet.at(&record, "F01", &format!("there are more than {MOST_ROWS} rows")));
            }
            sheet.records.push(record);
        }
        if sheet.records.is_empty() {
            return Err(sheet.fault("F01", format!("{} has no rows", file.name)));
        }
        Ok(sheet)
    }

    fn fault(&self, code: &'static str, message: String) -> BindError {
        BindError::new(code, self.param, message)
    }

    fn at(&self, record: &csv::StringRecord, code: &'static str, what: &str) -> BindError {
        let line = record.position().map_or(0, csv::Position::line);
        self.fault(code, format!("{}, line {line}: {what}", self.name))
    }

    /// The columns of the names, which are all that there may be.
    fn find<const N: usize>(&self, known: [(&str, &[(&str, f64)]); N]) -> Result<[Option<Source>; N], BindError> {
        let mut found = [None; N];
        for (column, text) in self.columns.iter().enumerate() {
            let place = known.iter().enumerate().find_map(|(i, (name, units))| {
                let unit = units.iter().find(|(suffix, _)| text.strip_prefix(name) == Some(suffix))?;
                Some((i, unit.1))
            });
            let Some((i, factor)) = place else {
                let names = |(name, units): &(&str, &[(&str, f64)])| {
                    units.iter().map(|(suffix, _)| format!("{name}{suffix}")).collect::<Vec<_>>().join(" or ")
                };
                let all = known.iter().map(names).collect::<Vec<_>>().join(", ");
                let message = format!("{}: there is no column `{text}`", self.name);
                return Err(self.fault("F02", message).help(format!("it may have {all}")));
            };
            if found[i].replace(Source { column, factor }).is_some() {
                let message = format!("{} has two columns for {}", self.name, known[i].0);
                return Err(self.fault("F02", message).help("keep one of them"));
            }
        }
        Ok(found)
    }

    fn lacks(&self, column: &str) -> BindError {
        let message = format!("{} has no column {column}", self.name);
        self.fault("F02", message).help(format!("the columns are {}", self.columns.join(", ")))
    }

    fn text<'r>(&self, record: &'r csv::StringRecord, source: Option<Source>) -> &'r str {
        source.map_or("", |source| &record[source.column])
    }

    /// A number within a range in the unit of the file, in canonical units; `None` where the cell is empty.
    fn number(
        &self,
        record: &csv::StringRecord,
        source: Option<Source>,
        (low, high): (f64, f64),
    ) -> Result<Option<f64>, BindError> {
        let Some(source) = source.filter(|source| !record[source.column].is_empty()) else { return Ok(None) };
        let (text, column) = (&record[source.column], &self.columns[source.column]);
        let value: f64 = (text.parse().ok())
            .filter(|value: &f64| value.is_finite())
            .ok_or_else(|| self.at(record, "F01", &format!("{column}: `{text}` is no number")))?;
        if !(low..=high).contains(&value) {
            let range = format!("{column} is {text}, but it must be within {low} and {high}");
            return Err(self.at(record, "U05", &range));
        }
        Ok(Some(value * source.factor + 0.0)) // −0 becomes 0
    }

    /// A number that a row must have.
    fn needed(&self, record: &csv::StringRecord, source: Source, range: (f64, f64)) -> Result<f64, BindError> {
        let lacking = || self.at(record, "F01", &format!("a row needs {}", self.columns[source.column]));
        self.number(record, Some(source), range)?.ok_or_else(lacking)
    }
}

/// The phase functions that a file of layers speaks of, each once.
#[derive(Default)]
struct Functions {
    phases: Vec<Arc<Phase>>,
    named: BTreeMap<String, usize>,
    /// By law and the bits of its parameter.
    laws: BTreeMap<(&'static str, u64), usize>,
    notes: Vec<String>,
}

/// Rows of one function.
enum Rows {
    Moments(Vec<f64>),
    /// Angles \[rad\] and values.
    Values(Vec<f64>, Vec<f64>),
}

impl Functions {
    fn read(&mut self, file: &FileArg) -> Result<(), BindError> {
        let sheet = Sheet::read("phase_functions", file)?;
        let [name, order, moment, angle, value] = sheet.find([
            ("name", PLAIN),
            ("order", PLAIN),
            ("moment", PLAIN),
            ("scattering_angle", RADIANS),
            ("phase_function", PLAIN),
        ])?;
        if name.is_none() {
            return Err(sheet.lacks("name"));
        }
        for (a, b, names) in
            [(order, moment, ["order", "moment"]), (angle, value, ["scattering_angle_deg", "phase_function"])]
        {
            if a.is_some() != b.is_some() {
                return Err(sheet.lacks(names[usize::from(a.is_some())]));
            }
        }
        let mut functions: BTreeMap<&str, Rows> = BTreeMap::new();
        for record in &sheet.records {
            let name = sheet.text(record, name);
            if name.is_empty() || LAWS.contains(&name) {
                return Err(sheet.at(record, "F01", &format!("`{name}` cannot be the name of a phase function")));
            }
            let order = sheet.number(record, order, (0.0, 1e6))?;
            let moment = sheet.number(record, moment, (-1.0, 1.0))?;
            let angle = sheet.number(record, angle, (0.0, 180.0))?;
            let value = sheet.number(record, value, (0.0, 1e12))?;
            match (order, moment, angle, value) {
                (Some(order), Some(moment), None, None) => {
                    let Rows::Moments(moments) = functions.entry(name).or_insert(Rows::Moments(Vec::new())) else {
                        return Err(sheet.at(
                            record,
                            "F01",
                            &format!("{name} has values at angles above, and here a moment"),
                        ));
                    };
                    if order != moments.len() as f64 {
                        let due = moments.len();
                        return Err(sheet.at(record, "M05", &format!("order {order} of {name} where {due} is due")));
                    }
                    if moments.is_empty() && (moment - 1.0).abs() > 1e-6 {
                        return Err(sheet.at(
                            record,
                            "M05",
                            &format!("moment 0 of {name} is {moment}, but it must be 1"),
                        ));
                    }
                    moments.push(moment);
                }
                (None, None, Some(angle), Some(value)) => {
                    let start = || Rows::Values(Vec::new(), Vec::new());
                    let Rows::Values(angles, values) = functions.entry(name).or_insert_with(start) else {
                        return Err(sheet.at(
                            record,
                            "F01",
                            &format!("{name} has moments above, and here a value at an angle"),
                        ));
                    };
                    if angles.last().is_some_and(|last| *last >= angle) {
                        return Err(sheet.at(record, "M05", &format!("the scattering angles of {name} do not ascend")));
                    }
                    angles.push(angle);
                    values.push(value);
                }
                _ => {
                    let what = "a row needs an order and a moment, or an angle and a value, and no more";
                    return Err(sheet.at(record, "F01", what));
                }
            }
        }
        for (name, rows) in functions {
            let phase = match rows {
                Rows::Moments(moments) => {
                    let least = least(&moments);
                    if least < DEEPEST {
                        let message =
                            format!("{}: the moments of {name} sum up to {least:.3} at some angle", sheet.name);
                        return Err(sheet.fault("M05", message).help("a phase function is not negative"));
                    }
                    if least < -1e-6 {
                        self.notes.push(format!(
                            "{}: the moments of {name} sum up to {least:.1e} at some angle; below 0 it is taken as 0",
                            sheet.name
                        ));
                    }
                    Phase::from_moments(moments)
                }
                Rows::Values(angles, values) => {
                    let whole = angles.len() > 1 && angles[0] == 0.0 && angles[angles.len() - 1] > PI - 1e-9;
                    if !whole {
                        let message = format!("{}: the angles of {name} must reach from 0 to 180 deg", sheet.name);
                        return Err(sheet.fault("M05", message));
                    }
                    // Its scale is that of its largest value, so that none is too small to be seen.
                    let largest = values.iter().copied().fold(0.0, f64::max);
                    if largest == 0.0 {
                        return Err(sheet.fault("M05", format!("{}: {name} is 0 at all angles", sheet.name)));
                    }
                    let values: Vec<f64> = values.iter().map(|value| (value / largest).max(DARKEST)).collect();
                    Phase::table(&angles, &values)
                }
            };
            self.named.insert(name.to_string(), self.phases.len());
            self.phases.push(Arc::new(phase));
        }
        Ok(())
    }

    /// Where a phase function stands, put there if it is new.
    fn law(&mut self, law: &'static str, parameter: f64, make: fn(f64) -> Phase) -> usize {
        *self.laws.entry((law, parameter.to_bits())).or_insert_with(|| {
            self.phases.push(Arc::new(make(parameter)));
            self.phases.len() - 1
        })
    }
}

const RAYLEIGH: &str = "rayleigh";
const HG: &str = "hg";
/// Words of the column `phase` that are no names.
const LAWS: [&str; 2] = [RAYLEIGH, HG];

/// A phase function is straight in its logarithm, which 0 does not have: this share of its largest value stands for it.
const DARKEST: f64 = 1e-12;

/// Least Σ (2l+1) χ_l P_l(cos Θ) over scattering angles of half degrees.
fn least(moments: &[f64]) -> f64 {
    (0..=360)
        .map(|i| {
            let cos = (f64::from(i) * PI / 360.0).cos();
            let (mut p0, mut p1, mut sum) = (0.0, 1.0, 0.0); // P_{l−1}, P_l
            for (l, chi) in moments.iter().enumerate() {
                let k = l as f64;
                sum += (2.0 * k + 1.0) * chi * p1;
                (p0, p1) = (p1, ((2.0 * k + 1.0) * cos * p1 - k * p0) / (k + 1.0));
            }
            sum
        })
        .fold(f64::INFINITY, f64::min)
}

/// A component of a layer.
#[derive(Debug)]
struct Component {
    layer: usize,
    /// \[µm\], ascending; none where its one row holds at all of them.
    wavelengths: Vec<f64>,
    rows: Vec<Row>,
}

/// Vertical optical depths.
#[derive(Clone, Copy, Debug)]
struct Row {
    extinction: f64,
    scattering: f64,
    /// `None` where nothing is scattered.
    phase: Option<usize>,
}

/// Reads a file of layers: their bounds \[m\] from the top down, the last 0, and their components.
fn stack(file: &FileArg, functions: &mut Functions) -> Result<(Vec<f64>, Vec<Component>), BindError> {
    let sheet = Sheet::read("file", file)?;
    let [top, bottom, depth, albedo, phase, asymmetry, depolarisation, component, wavelength] = sheet.find([
        ("top", METRES),
        ("bottom", METRES),
        ("optical_depth", PLAIN),
        ("single_scattering_albedo", PLAIN),
        ("phase", PLAIN),
        ("asymmetry", PLAIN),
        ("depolarisation", PLAIN),
        ("component", PLAIN),
        ("wavelength", MICROMETRES),
    ])?;
    let needed = |source: Option<Source>, name: &str| source.ok_or_else(|| sheet.lacks(name));
    let (top, bottom) = (needed(top, "top_m or top_km")?, needed(bottom, "bottom_m or bottom_km")?);
    let (depth, albedo) = (needed(depth, "optical_depth")?, needed(albedo, "single_scattering_albedo")?);
    needed(phase, "phase")?;
    // By top and bottom, highest first, and name.
    type Key<'a> = (std::cmp::Reverse<(u64, u64)>, &'a str);
    let mut gathered: BTreeMap<Key, (Vec<f64>, Vec<Row>)> = BTreeMap::new();
    for record in &sheet.records {
        let [high, low] = [top, bottom].map(|source| sheet.needed(record, source, (0.0, HIGHEST / source.factor)));
        let (high, low) = (high?, low?);
        if high - low < ONE_BOUND {
            return Err(sheet.at(record, "M05", "the bottom of a layer lies below its top"));
        }
        let extinction = sheet.needed(record, depth, (0.0, 1e6))?;
        let scattering = extinction * sheet.needed(record, albedo, (0.0, 1.0))?;
        let g = sheet.number(record, asymmetry, (-1.0, 1.0))?;
        let rho = sheet.number(record, depolarisation, (0.0, 1.0))?;
        let law = sheet.text(record, phase);
        if g.is_some() && law != HG || rho.is_some() && law != RAYLEIGH {
            let (what, of) = if rho.is_some() { ("depolarisation", RAYLEIGH) } else { ("asymmetry", HG) };
            return Err(sheet.at(record, "F01", &format!("{what} belongs to {of}, but the phase is `{law}`")));
        }
        let phase = match (law, g) {
            ("", _) if scattering == 0.0 => None,
            ("", _) => return Err(sheet.at(record, "F01", "what scatters needs a phase")),
            (RAYLEIGH, _) => Some(functions.law(RAYLEIGH, rho.unwrap_or(0.0), Phase::rayleigh)),
            (HG, Some(g)) if g.abs() < 1.0 => Some(functions.law(HG, g, Phase::henyey_greenstein)),
            (HG, Some(_)) => {
                return Err(sheet.at(record, "U05", "asymmetry must lie between -1 and 1, and not reach them"));
            }
            (HG, None) => return Err(sheet.at(record, "F01", "hg needs an asymmetry")),
            (name, _) => match functions.named.get(name) {
                Some(place) => Some(*place),
                None => {
                    let known = LAWS.into_iter().chain(functions.named.keys().map(String::as_str));
                    let help = format!("there are {}", known.collect::<Vec<_>>().join(", "));
                    return Err(sheet.at(record, "N02", &format!("no phase function is named `{name}`")).help(help));
                }
            },
        };
        let name = sheet.text(record, component);
        let key = (std::cmp::Reverse((high.to_bits(), low.to_bits())), name);
        let (wavelengths, rows) = gathered.entry(key).or_default();
        let known = !rows.is_empty();
        match sheet.number(record, wavelength, (0.0, 1e9))? {
            None if known => {
                let what = "this layer and component stands above already: tell components apart by name, or rows by wavelength";
                return Err(sheet.at(record, "M05", what));
            }
            None => {}
            Some(_) if known && wavelengths.is_empty() => {
                let what = "this layer and component stands above without a wavelength, for all of them";
                return Err(sheet.at(record, "M05", what));
            }
            Some(wavelength) if wavelengths.last().is_some_and(|last| *last >= wavelength) => {
                let what = "the wavelengths of a layer and component ascend, each said once";
                return Err(sheet.at(record, "M05", what));
            }
            Some(wavelength) => wavelengths.push(wavelength),
        }
        rows.push(Row { extinction, scattering, phase });
    }
    if gathered.len() > MOST_COMPONENTS {
        let (name, found) = (sheet.name, gathered.len());
        return Err(
            sheet.fault("M05", format!("{name} has {found} components of layers; there may be {MOST_COMPONENTS}"))
        );
    }
    let (mut bounds, mut components): (Vec<f64>, Vec<Component>) = (Vec::new(), Vec::new());
    let mut layer: Option<(u64, u64)> = None;
    let mut thickness = 0.0;
    for ((std::cmp::Reverse(place), _), (wavelengths, rows)) in gathered {
        let (top, bottom) = (f64::from_bits(place.0), f64::from_bits(place.1));
        if layer != Some(place) {
            match bounds.last() {
                None => bounds.push(top),
                Some(above) if (above - top).abs() <= ONE_BOUND => {}
                Some(above) => {
                    let fault = if *above > top { "leave a gap" } else { "overlap" };
                    let message = format!("{}: layers {fault} between {above} m and {top} m", sheet.name);
                    return Err(sheet.fault("M05", message).help("a clear stretch is a layer of optical depth 0"));
                }
            }
            bounds.push(bottom);
            layer = Some(place);
        }
        thickness += rows.iter().map(|row| row.scattering).fold(0.0, f64::max);
        components.push(Component { layer: bounds.len() - 2, wavelengths, rows });
    }
    let last = bounds.len() - 1;
    if bounds[last] > ONE_BOUND {
        let message = format!("{}: the lowest layer ends at {} m, above the ground", sheet.name, bounds[last]);
        return Err(sheet
            .fault("M05", message)
            .help("the lowest bottom is 0; a clear stretch is a layer of optical depth 0"));
    }
    bounds[last] = 0.0;
    if last > MOST_LAYERS {
        return Err(sheet.fault("M05", format!("{} has {last} layers; there may be {MOST_LAYERS}", sheet.name)));
    }
    if thickness > THICKEST {
        let message =
            format!("{}: the layers scatter {thickness:.6} in optical depth; {THICKEST} is the most", sheet.name);
        return Err(sheet.fault("U05", message));
    }
    Ok((bounds, components))
}

struct Layers {
    name: String,
    /// From the top down, the last 0 \[m\].
    bounds: Vec<f64>,
    components: Vec<Component>,
    phases: Vec<Arc<Phase>>,
    notes: Vec<String>,
    solar: Option<SpectralValue>,
    settings: Settings,
}

impl Layers {
    /// The layers at every entry of a grid.
    fn media(&self, grid: &SpectralGrid) -> Result<Vec<Medium>, AtmosphereError> {
        let mut tables: BTreeMap<Vec<u64>, OntoGrid> = BTreeMap::new();
        for component in self.components.iter().filter(|component| !component.wavelengths.is_empty()) {
            let wavelengths = &component.wavelengths;
            let (top, bottom) = (self.bounds[component.layer], self.bounds[component.layer + 1]);
            let name = format!("{} between {top} m and {bottom} m", self.name);
            coverage::check(&name, (wavelengths[0], wavelengths[wavelengths.len() - 1]), grid)?;
            tables.entry(bits(wavelengths)).or_insert_with(|| OntoGrid::new(wavelengths, grid));
        }
        let onto: Vec<Option<&OntoGrid>> =
            self.components.iter().map(|component| tables.get(&bits(&component.wavelengths))).collect();
        Ok((0..grid.len()).map(|entry| self.medium(&onto, entry)).collect())
    }

    fn medium(&self, onto: &[Option<&OntoGrid>], entry: usize) -> Medium {
        let n = self.bounds.len() - 1;
        let mut phases: Vec<Arc<Phase>> = Vec::new();
        // Places in `phases` of what was mixed already: phase functions and the bits of their shares.
        let mut mixed: BTreeMap<Vec<(usize, u64)>, usize> = BTreeMap::new();
        let mut found: Vec<(usize, usize, f64)> = Vec::new();
        let mut absorption = vec![0.0; n];
        for (component, onto) in self.components.iter().zip(onto) {
            let weights: Vec<(&Row, f64)> = match onto {
                Some(onto) => {
                    let rows = &component.rows[onto.nodes()];
                    onto.entry(entry).iter().map(|(node, weight)| (&rows[*node], *weight)).collect()
                }
                None => vec![(&component.rows[0], 1.0)],
            };
            let total = |of: fn(&Row) -> f64| weights.iter().map(|(row, w)| w * of(row)).sum::<f64>().max(0.0);
            let scattering = total(|row| row.scattering);
            absorption[component.layer] += total(|row| row.extinction - row.scattering);
            let mut parts: BTreeMap<usize, f64> = BTreeMap::new();
            for (row, weight) in &weights {
                if let Some(phase) = row.phase
                    && weight * row.scattering > 0.0
                {
                    *parts.entry(phase).or_default() += weight * row.scattering;
                }
            }
            let sum: f64 = parts.values().sum();
            if scattering <= 0.0 || sum <= 0.0 {
                continue;
            }
            let key: Vec<(usize, u64)> = parts.iter().map(|(phase, s)| (*phase, (s / sum).to_bits())).collect();
            let place = *mixed.entry(key).or_insert_with(|| {
                let shares: Vec<_> = parts.iter().map(|(phase, s)| (*s, Arc::clone(&self.phases[*phase]))).collect();
                phases.push(match shares.as_slice() {
                    [(_, phase)] => Arc::clone(phase),
                    _ => Arc::new(Phase::mix(shares)),
                });
                phases.len() - 1
            });
            found.push((component.layer, place, scattering));
        }
        let mut layers: Vec<Layer> = absorption
            .into_iter()
            .map(|absorption| Layer { absorption, scattering: vec![0.0; phases.len()] })
            .collect();
        found.into_iter().for_each(|(layer, place, scattering)| layers[layer].scattering[place] += scattering);
        Medium { layers, phases }
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

impl Atmosphere for Layers {
    fn nodes(&self) -> Vec<f64> {
        let mut nodes: Vec<f64> = self.components.iter().flat_map(|component| component.wavelengths.clone()).collect();
        nodes.sort_by(f64::total_cmp);
        nodes.dedup_by(|b, a| *b - *a <= 1e-8);
        nodes
    }

    fn uses(&self) -> &'static [&'static str] {
        &[]
    }

    fn has_directional_sky(&self) -> bool {
        true
    }

    fn sky_bytes(&self, grid: &SpectralGrid, needs: &Needs) -> usize {
        column_sky::sky_bytes(grid.len(), self.has_spectra(), needs)
    }

    fn check(
        &self,
        column: &Column,
        _: &[Sun],
        grid: &SpectralGrid,
        _: &Needs,
    ) -> Result<Vec<String>, AtmosphereError> {
        Ok(self.air(std::slice::from_ref(&column.ground_albedo), column, grid)?.notes)
    }

    fn solve(
        &self,
        column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        needs: &Needs,
    ) -> Result<Vec<Box<dyn SkyState>>, AtmosphereError> {
        let albedos = std::slice::from_ref(&column.ground_albedo);
        Ok(self.solve_over(albedos, column, suns, grid, needs)?.remove(0))
    }

    fn solve_over(
        &self,
        albedos: &[Vec<f64>],
        column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        needs: &Needs,
    ) -> Result<Vec<Vec<Box<dyn SkyState>>>, AtmosphereError> {
        Ok(column_sky::solve(self.air(albedos, column, grid)?, suns, needs, &self.settings))
    }
}

impl Layers {
    /// Whether anything changes with wavelength: radiances are solved everywhere then.
    fn has_spectra(&self) -> bool {
        self.components.iter().any(|component| !component.wavelengths.is_empty())
    }

    fn air(&self, albedos: &[Vec<f64>], column: &Column, grid: &SpectralGrid) -> Result<ColumnAir, AtmosphereError> {
        let solar = match &self.solar {
            Some(given) => none::on_grid("solar_irradiance", given, grid)?,
            None => {
                coverage::check("the TSIS-1 solar spectrum", HSRS.domain(), grid)?;
                HSRS.on(grid)
            }
        };
        coverage::albedos(albedos, grid)?;
        Ok(ColumnAir {
            strata: Strata {
                heights: self.bounds.clone(),
                refractivity: vec![0.0; self.bounds.len()],
                radius: EARTH + column.elevation,
            },
            media: self.media(grid)?,
            ladder: {
                let every = self.has_spectra();
                Box::new(
                    move |media| if every { Ladder::of_every(media, media[0].clone()) } else { Ladder::of_all(media) },
                )
            },
            solar,
            albedos: albedos.to_vec(),
            notes: self.notes.clone(),
        })
    }
}
