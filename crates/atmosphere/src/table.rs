//! An atmosphere from files: a CSV table, or what LOWTRAN 7, MODTRAN, libRadtran and 6S print.

mod gathering;
mod import;
mod sixs;
mod tape7;
mod uvspec;

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, FileArg, Model, ModelInfo, Param};
use sunglint_radiometry::{Curve, Dimension, Irradiance, Radiance, SpectralGrid, Spectrum, Transmittance, WorldDir};

use crate::{Atmosphere, AtmosphereError, Column, Needs, Path, SkyState, Sun, coverage};

const MANUAL: &str = "\
An atmosphere read from files: a CSV table, or what LOWTRAN 7, MODTRAN, libRadtran (uvspec) and 6S print. Nothing is
computed but straight lines between the values, and what is said below.

CSV table: `file`
`#` begins a comment line; then one header line; then rows. Each row has a wavelength, and a value in the cells of
the quantities that it speaks of; other cells stay empty. So a file may hold one row a wavelength, or further rows for
directions. Columns may stand in any order; units are part of the name.

  column                          unit                     may depend on
  wavelength                      _nm _um                  (required)
  solar_irradiance                _w_m2_um _w_m2_nm        wavelength (required)
  sun_transmittance               none, 0..1               wavelength, sun_zenith (required)
  diffuse_irradiance              _w_m2_um _w_m2_nm        wavelength, sun_zenith
  sky_radiance                    _w_m2_sr_um _w_m2_sr_nm  wavelength, sun_zenith, sky_zenith, sky_azimuth
  path_transmittance              none, 0..1               wavelength, view_zenith, sensor_height
  path_radiance                   _w_m2_sr_um _w_m2_sr_nm  wavelength, sun_zenith, view_zenith, sensor_height
  sun_zenith                      _deg                     key
  sky_zenith, sky_azimuth         _deg                     keys; sky_relative_azimuth_deg is counted from the sun's
  view_zenith                     _deg                     key: 0 where the sensor is straight above the target
  sensor_height                   _m _km                   key: above the site

Also _uw_cm2_nm for irradiance, _mw_cm2_sr_um and _uw_cm2_sr_nm for radiance.
A key counts for a quantity if it is filled in that quantity's rows: in all of them, or in none. The rows of a quantity
hold every combination of its keys (at sky_zenith 0 one azimuth, or none, is enough), each with wavelengths that ascend;
the same value may be said again, another may not. Values are never negative.

Between the values all goes by straight lines: in wavelength, in sun zenith, bilinearly in sky zenith and azimuth, and in
view zenith and sensor height. Beyond the first and last zenith of sky and view, and the first and last height, the end
values hold. Azimuth closes over 360 deg; relative azimuths that stay within 0..180 are taken for both sides.
A sun outside the tabulated ones is an error; below the horizon it gives no light. Without sun_zenith the table is taken
for the sun of the scene, whichever that is, and its sky shines with the sun down too.

  E_s as given: no Earth–Sun distance is applied        τ₁ = 0 with the sun below the horizon
  E_d = ∫ L_d cos θ dω in closed form of the bilinear sky; or diffuse_irradiance, for a sky alike from everywhere. If both
  are given they agree within 1 %, and the sky counts.  Neither: a black sky
  τ₂ = 1 and L_u = 0 where not given. They hold for the whole way from target to sensor, whatever its length

Output of other codes, held to the same checks
Several files, a CSV table and the stated spectra may stand together; each quantity comes from one of them. `plan` and
the manifest tell what each file gives, for which sun and view, what was derived, and what no file gives. What a plan
needs and none gives is an error: state it (`path_radiance 0 W/m2/sr/um`). A file is for its own sun: the scene's may
stand 0.5 deg from it; between suns, if the file holds several.

  tape7        path from target to sensor: runs of IEMSCT 2 (or 0, 1: τ₂ alone). τ₂ = TRANS, L_u = SOL SCAT (PATH in
               LOWTRAN 7). Several runs: view zeniths by card 3 (H1 over H2, ANGLE), unrefracted
  tape7_sun    path from target to sun: one run of IEMSCT 3 (E_s = SOLAR, τ₁ = TRANS) or IEMSCT 0 (τ₁)
  tape7_sky    runs of IEMSCT 2 from the ground, one a direction: ANGLE (card 3), IPARM 2 or 12, PARM1 and PARM2 (cards
               3A). L_d = SOL SCAT. The directions hold every combination of zenith and azimuth
               TAPE7 of LOWTRAN 7 and MODTRAN 3 to 6 (.tp7), and tape7.scn (.7sc) against cm⁻¹, µm or nm. At ν cm⁻¹
               1 W cm⁻² sr⁻¹/cm⁻¹ = ν² W m⁻² sr⁻¹ µm⁻¹. LOWTRAN 7 prints radiances in three digits
               E_d = (GRND − DRCT)/DRCT · E_s τ₁ cos θ_s, if the run's ground reflects, no sky is given and the sun is
               known (cards, another file, or `sun_zenith`). With TOA_SUN: E_s, and τ₁ = REF_SOL/(TOA_SUN τ₂)
  uvspec       output of libRadtran, beside its input `uvspec_input`, which says the columns (of disort and twostr, or
               output_user), umu, phi, phi0, zout, sza, albedo and output_quantity. `uvspec_units` are those of the
               solar spectrum of the run (transmittance and reflectivity have none). Level zout 0: τ₁ = edir/(E_s
               cos θ), E_d = edn, L_d = uu at umu < 0 (several phi, or none: the azimuthal mean). Level TOA: E_s =
               edir/cos θ. TOA and others: L_u = uu at umu > 0 if albedo is 0, for one phi or at nadir. No τ₂
  sixs         reports of 6S or 6SV, one a wavelength or band, one below the other in one file, wavelengths ascending:
               E_s = sol. spect (band: int. sol. spect / int. funct filter), τ₁ = direct solar irr./(E_s cos θ_s),
               E_d = atm. diffuse + environment irr., L_u = atm. intrin. + background rad.,
               τ₂ = upward global gas. trans. · exp(−optical depth/cos θ_v). Means of a band hold all over it
  E_s          where no file says it: the TSIS-1 spectrum at 1 au [Coddington2023]
  E_d and L_d  both printed: they agree within 5 %, and the sky counts

Nothing of the weather is used.

In a scene
  atmosphere table { file \"modtran.csv\" }
  atmosphere table { tape7 \"down.tp7\", tape7_sun \"sun.tp7\", tape7_sky \"sky.tp7\" }
  atmosphere table { uvspec \"sky.out\", uvspec_input \"sky.inp\", path_transmittance 1, path_radiance 0 W/m2/sr/um }
  atmosphere table { sixs \"visible.txt\" }
with, for example, in modtran.csv
  wavelength_nm,solar_irradiance_w_m2_um,sun_transmittance,diffuse_irradiance_w_m2_um,path_radiance_w_m2_sr_um
  400,1650,0.55,420,31
  1000,745,0.88,60,3
";

/// A tabulated atmosphere.
pub const MODEL: Model<dyn Atmosphere> = Model {
    info: ModelInfo {
        name: "table",
        summary: "E_s, τ₁, τ₂, L_d and L_u from a CSV file, or from output of LOWTRAN 7, MODTRAN, libRadtran or 6S",
        manual: MANUAL,
        params: &[
            Param::file("file", Default::Absent, "a CSV table; `sunglint models table` has its columns"),
            Param::file("tape7", Default::Absent, "TAPE7 of LOWTRAN 7 or MODTRAN, from target to sensor: τ₂ and L_u"),
            Param::file("tape7_sun", Default::Absent, "TAPE7 from target to sun: E_s and τ₁"),
            Param::file("tape7_sky", Default::Absent, "TAPE7 of runs into the sky, one a direction: L_d"),
            Param::file("uvspec", Default::Absent, "output of libRadtran's uvspec"),
            Param::file("uvspec_input", Default::Absent, "the input that `uvspec` was made with"),
            Param::word(
                "uvspec_units",
                &["mw_m2_nm", "w_m2_nm", "w_m2_um"],
                Default::Word("mw_m2_nm"),
                "irradiance of `uvspec`, as its solar spectrum has it",
            ),
            Param::file("sixs", Default::Absent, "reports of 6S, wavelengths ascending"),
            Param::quantity(
                "sun_zenith",
                Dimension::Angle,
                Default::Absent,
                "of the sun that the files are for, where they do not say it",
            )
            .within(0.0, FRAC_PI_2),
            Param::spectrum("solar_irradiance", Dimension::Irradiance, Default::Absent, "E_s, where no file says it")
                .within(0.0, BRIGHTEST),
            Param::spectrum("sun_transmittance", Dimension::Fraction, Default::Absent, "τ₁, where no file says it")
                .within(0.0, 1.0),
            Param::spectrum("diffuse_irradiance", Dimension::Irradiance, Default::Absent, "E_d, where no file says it")
                .within(0.0, BRIGHTEST),
            Param::spectrum("path_transmittance", Dimension::Fraction, Default::Absent, "τ₂, where no file says it")
                .within(0.0, 1.0),
            Param::spectrum("path_radiance", Dimension::Radiance, Default::Absent, "L_u, where no file says it")
                .within(0.0, BRIGHTEST),
        ],
    },
    bind: |args: &Args, _grid: &SpectralGrid| -> Result<Arc<dyn Atmosphere>, BindError> {
        Ok(Arc::new(gathering::table(args)?))
    },
};

/// The quantities, in the order of [`QUANTITIES`].
const SOLAR: usize = 0;
const SUN: usize = 1;
const DIFFUSE: usize = 2;
const SKY: usize = 3;
const PATH_TRANSMITTANCE: usize = 4;
const PATH_RADIANCE: usize = 5;

struct Quantity {
    name: &'static str,
    units: &'static [(&'static str, f64)],
    largest: f64,
    /// The keys it may depend on, as indices into [`KEYS`].
    keys: [Option<usize>; 3],
}

const IRRADIANCE: &[(&str, f64)] = &[("_w_m2_um", 1.0), ("_w_m2_nm", 1e3), ("_uw_cm2_nm", 10.0)];
const RADIANCE: &[(&str, f64)] =
    &[("_w_m2_sr_um", 1.0), ("_w_m2_sr_nm", 1e3), ("_mw_cm2_sr_um", 10.0), ("_uw_cm2_sr_nm", 10.0)];
const PLAIN: &[(&str, f64)] = &[("", 1.0)];

/// Largest radiance or irradiance of a table, in its own unit: what is beyond is no light, and sums of it are no numbers.
const BRIGHTEST: f64 = 1e12;

const QUANTITIES: [Quantity; 6] = [
    Quantity { name: "solar_irradiance", units: IRRADIANCE, largest: BRIGHTEST, keys: [None; 3] },
    Quantity { name: "sun_transmittance", units: PLAIN, largest: 1.0, keys: [Some(0), None, None] },
    Quantity { name: "diffuse_irradiance", units: IRRADIANCE, largest: BRIGHTEST, keys: [Some(0), None, None] },
    Quantity { name: "sky_radiance", units: RADIANCE, largest: BRIGHTEST, keys: [Some(0), Some(1), Some(2)] },
    Quantity { name: "path_transmittance", units: PLAIN, largest: 1.0, keys: [None, Some(3), Some(4)] },
    Quantity { name: "path_radiance", units: RADIANCE, largest: BRIGHTEST, keys: [Some(0), Some(3), Some(4)] },
];

struct Key {
    name: &'static str,
    units: &'static [(&'static str, f64)],
    /// Largest value in the unit of the file.
    largest: f64,
}

const DEG: &[(&str, f64)] = &[("_deg", PI / 180.0)];

/// Keys by place: sun zenith, sky zenith, sky azimuth, view zenith, sensor height.
const KEYS: [Key; 5] = [
    Key { name: "sun_zenith", units: DEG, largest: 180.0 },
    Key { name: "sky_zenith", units: DEG, largest: 90.0 },
    Key { name: "sky_azimuth", units: DEG, largest: 360.0 },
    Key { name: "view_zenith", units: DEG, largest: 180.0 },
    Key { name: "sensor_height", units: &[("_m", 1.0), ("_km", 1e3)], largest: f64::MAX },
];
const SUN_ZENITH: usize = 0;
const SKY_ZENITH: usize = 1;
const SKY_AZIMUTH: usize = 2;
const VIEW_ZENITH: usize = 3;
const SENSOR_HEIGHT: usize = 4;
const RELATIVE_AZIMUTH: &str = "sky_relative_azimuth";
const WAVELENGTH_UNITS: &[(&str, f64)] = &[("_nm", 1e-3), ("_um", 1.0)];

/// A column of the file: its place there and the factor to canonical units.
#[derive(Clone, Copy)]
struct Source {
    column: usize,
    factor: f64,
}

struct Header {
    names: Vec<String>,
    wavelength: Source,
    keys: [Option<Source>; KEYS.len()],
    relative: bool,
    quantities: [Option<Source>; QUANTITIES.len()],
}

fn fault(code: &'static str, message: String) -> BindError {
    BindError::new(code, "file", message)
}

impl Header {
    /// `alone`: no other file gives what the table must have.
    fn read(name: &str, record: &csv::StringRecord, alone: bool) -> Result<Self, BindError> {
        let names: Vec<String> = record.iter().map(str::to_string).collect();
        let there_are = format!("the columns are {}", names.join(", "));
        let mut taken = vec![false; names.len()];
        let mut find = |quantity: &str, units: &[(&str, f64)]| -> Result<Option<Source>, BindError> {
            let mut found = None;
            for (column, text) in names.iter().enumerate() {
                let Some((_, factor)) = units.iter().find(|(suffix, _)| text == &format!("{quantity}{suffix}")) else {
                    continue;
                };
                if found.replace(Source { column, factor: *factor }).is_some() {
                    return Err(fault("F02", format!("{name} has two columns for {quantity}")).help(there_are.clone()));
                }
                taken[column] = true;
            }
            Ok(found)
        };
        let wavelength = find("wavelength", WAVELENGTH_UNITS)?;
        let mut keys = [None; KEYS.len()];
        for (slot, key) in keys.iter_mut().zip(&KEYS) {
            *slot = find(key.name, key.units)?;
        }
        let from_sun = find(RELATIVE_AZIMUTH, DEG)?;
        let mut quantities = [None; QUANTITIES.len()];
        for (slot, quantity) in quantities.iter_mut().zip(&QUANTITIES) {
            *slot = find(quantity.name, quantity.units)?;
        }
        if let Some(column) = taken.iter().position(|taken| !taken) {
            let known = |name: &str, units: &[(&str, f64)]| {
                units.iter().map(|(suffix, _)| format!("{name}{suffix}")).collect::<Vec<_>>().join(" or ")
            };
            let mut all = vec![known("wavelength", WAVELENGTH_UNITS)];
            all.extend(QUANTITIES.iter().map(|quantity| known(quantity.name, quantity.units)));
            all.extend(KEYS.iter().map(|key| known(key.name, key.units)));
            all.push(known(RELATIVE_AZIMUTH, DEG));
            let message = format!("{name}: a table has no column `{}`", names[column]);
            return Err(fault("F02", message).help(format!("it may have {}", all.join(", "))));
        }
        let missing = |what: &str| fault("F02", format!("{name} has no column {what}")).help(there_are.clone());
        let wavelength = wavelength.ok_or_else(|| missing("wavelength_nm or wavelength_um"))?;
        if alone {
            quantities[SOLAR].ok_or_else(|| missing("solar_irradiance_w_m2_um"))?;
            quantities[SUN].ok_or_else(|| missing("sun_transmittance"))?;
        }
        if from_sun.is_some() && keys[SKY_AZIMUTH].is_some() {
            let both = "sky_azimuth_deg and sky_relative_azimuth_deg";
            return Err(fault("F02", format!("{name} has both {both}")).help("keep one of them"));
        }
        if (from_sun.is_some() || keys[SKY_AZIMUTH].is_some()) && keys[SKY_ZENITH].is_none() {
            return Err(missing("sky_zenith_deg beside the azimuth of the sky"));
        }
        keys[SKY_AZIMUTH] = keys[SKY_AZIMUTH].or(from_sun);
        Ok(Self { names, wavelength, keys, relative: from_sun.is_some(), quantities })
    }
}

/// Values of the three keys of a quantity as bits of numbers that are not negative, so that they sort.
type Place = [u64; 3];

/// The keys of a quantity that its rows fill, known from its first row.
#[derive(Default)]
struct Gathered {
    filled: Option<[bool; 3]>,
    groups: BTreeMap<Place, Vec<(f64, f64)>>,
}

/// One quantity: a curve at every combination of three keys. A key that it does not depend on has one value.
#[derive(Clone, Debug)]
struct Field {
    axes: [Vec<f64>; 3],
    curves: Vec<Curve>,
}

impl Field {
    fn curve(&self, i: usize, j: usize, k: usize) -> &Curve {
        &self.curves[(i * self.axes[1].len() + j) * self.axes[2].len() + k]
    }

    fn domain(&self) -> (f64, f64) {
        self.curves.iter().map(Curve::domain).fold((f64::MIN, f64::MAX), |a, b| (a.0.max(b.0), a.1.min(b.1)))
    }
}

/// The two values of an axis about `x` and their weights; the ends hold.
fn bracket(axis: &[f64], x: f64) -> [(usize, f64); 2] {
    let last = axis.len() - 1;
    if last == 0 || x.is_nan() {
        return [(0, 1.0), (0, 0.0)];
    }
    let i = axis.partition_point(|a| *a <= x).clamp(1, last);
    let t = ((x - axis[i - 1]) / (axis[i] - axis[i - 1])).clamp(0.0, 1.0);
    [(i - 1, 1.0 - t), (i, t)]
}

struct Table {
    /// Names of the files.
    name: String,
    fields: [Option<Field>; QUANTITIES.len()],
    /// What gave each field.
    sources: [String; QUANTITIES.len()],
    /// Whether the sky's azimuth counts from the sun's.
    relative: bool,
    /// Whether output of another code is among the files.
    imported: bool,
    /// The one sun that each file of another code is for: its name, and the zenith angle \[rad\].
    suns: Vec<(String, f64)>,
    notes: Vec<String>,
}

/// Nodes nearer than this are one \[µm\].
const ONE_NODE: f64 = 1e-8;

/// Files of other codes are for the sun of a scene that stands within this of theirs \[rad\]: the width of its disk.
const ONE_SUN: f64 = 0.5 * PI / 180.0;

impl Table {
    fn empty() -> Self {
        Self {
            name: String::new(),
            fields: std::default::Default::default(),
            sources: std::default::Default::default(),
            relative: false,
            imported: false,
            suns: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn read(file: &FileArg, alone: bool) -> Result<Self, BindError> {
        let name = &file.name;
        let bytes = file.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&file.bytes);
        let mut reader =
            csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).flexible(true).from_reader(bytes);
        let malformed = |error: &csv::Error| {
            let line = error.position().map_or(1, csv::Position::line);
            fault("F01", format!("{name}, line {line}: not a CSV table of UTF-8 text"))
        };
        let header = Header::read(name, reader.headers().map_err(|error| malformed(&error))?, alone)?;
        let mut gathered: [Gathered; QUANTITIES.len()] = std::default::Default::default();
        for record in reader.records() {
            let record = record.map_err(|error| malformed(&error))?;
            gather(name, &header, &record, &mut gathered)?;
        }
        let mut table = Self { name: name.clone(), relative: header.relative, ..Self::empty() };
        for (i, found) in gathered.into_iter().enumerate() {
            table.fields[i] = field(name, i, found)?;
            table.sources[i].clone_from(name);
            if table.fields[i].is_none() && i <= SUN && alone {
                return Err(fault("F01", format!("{name} has no value of {}", QUANTITIES[i].name)));
            }
        }
        table.check_diffuse(0.01)?;
        Ok(table)
    }

    /// A03 where a plan needs what no file gave: nothing of another code's run is filled in silently.
    fn suffices(&self, needs: &Needs) -> Result<(), AtmosphereError> {
        let sky = self.fields[SKY].is_some() || self.fields[DIFFUSE].is_some();
        let lacks = |quantity: usize| needs.path && self.fields[quantity].is_none();
        let (what, cure) = if (needs.diffuse_irradiance || needs.directional_sky) && !sky {
            ("E_d or L_d", "`diffuse_irradiance` (0 W/m2/um for a black sky)")
        } else if lacks(PATH_TRANSMITTANCE) {
            ("τ₂", "`path_transmittance` (1 for no loss)")
        } else if lacks(PATH_RADIANCE) {
            ("L_u", "`path_radiance` (0 W/m2/sr/um for none)")
        } else {
            return Ok(());
        };
        let message = format!("{} gives no {what}: add a file that does, or say {cure}", self.name);
        Err(AtmosphereError { code: "A03", message })
    }

    fn suns_agree(&self, suns: &[Sun]) -> Result<(), AtmosphereError> {
        for (name, zenith) in &self.suns {
            if let Some(sun) = suns.iter().find(|sun| (sun.true_zenith - zenith).abs() > ONE_SUN) {
                let [run, scene] = [*zenith, sun.true_zenith].map(f64::to_degrees);
                let message = format!("{name} is for a sun at zenith {run:.4} deg; the sun stands at {scene:.4} deg");
                return Err(AtmosphereError { code: "A03", message });
            }
        }
        Ok(())
    }

    /// ∫ hat cos θ dω of every direction of the sky, in the order of its curves.
    fn solid_weights(&self, sky: &Field) -> Vec<f64> {
        let (zeniths, azimuths) = (zenith_weights(&sky.axes[1]), self.azimuths(sky).weights());
        zeniths.iter().flat_map(|z| azimuths.iter().map(move |a| z * a)).collect()
    }

    fn azimuths(&self, sky: &Field) -> Azimuths {
        Azimuths { axis: sky.axes[2].clone(), relative: self.relative }
    }

    /// Diffuse irradiance and sky must agree within `within` where both are given.
    fn check_diffuse(&self, within: f64) -> Result<(), BindError> {
        let (Some(sky), Some(diffuse)) = (&self.fields[SKY], &self.fields[DIFFUSE]) else { return Ok(()) };
        let solid = self.solid_weights(sky);
        let directions = solid.len();
        let largest = diffuse.curves.iter().map(|curve| curve.range().1).fold(0.0, f64::max);
        let (a, b) = (sky.domain(), diffuse.domain());
        let (first, last) = (a.0.max(b.0), a.1.min(b.1));
        for (i, zenith) in sky.axes[0].iter().enumerate() {
            let suns = bracket(&diffuse.axes[0], *zenith);
            for wavelength in diffuse.curves[0].nodes().iter().filter(|l| (first..=last).contains(*l)) {
                let at = |curves: &[Curve]| -> f64 {
                    curves.iter().zip(&solid).map(|(curve, w)| w * curve.at(*wavelength)).sum()
                };
                let integral = at(&sky.curves[i * directions..(i + 1) * directions]);
                let said: f64 = suns.iter().map(|(j, w)| w * diffuse.curve(*j, 0, 0).at(*wavelength)).sum();
                if (integral - said).abs() > within * said.max(integral) && integral.max(said) > 1e-6 * largest {
                    let nm = wavelength * 1e3;
                    let message = format!(
                        "{}: at {nm:.6} nm the diffuse irradiance is {said:.6} W/m2/um, but the sky in directions gives \
                         {integral:.6} W/m2/um",
                        self.name
                    );
                    let help = format!("leave out one of them, or let them agree within {} %", 100.0 * within);
                    return Err(fault("M05", message).help(help));
                }
            }
        }
        Ok(())
    }

    /// The suns of a quantity about one, with their weights.
    fn suns(&self, field: &Field, sun: &Sun) -> Result<Option<[(usize, f64); 2]>, AtmosphereError> {
        let (axis, zenith) = (&field.axes[0], sun.apparent.zenith());
        let (first, last) = (axis[0], axis[axis.len() - 1]);
        let slack = 1e-9;
        if first.is_nan() || (first - slack..=last + slack).contains(&zenith) {
            return Ok(Some(bracket(axis, zenith)));
        }
        if !sun.is_up() {
            return Ok(None);
        }
        let [first, last, zenith] = [first, last, zenith].map(f64::to_degrees);
        let message = format!(
            "{} holds suns at zenith angles from {first:.4} to {last:.4} deg; the sun stands at {zenith:.4} deg",
            self.name
        );
        Err(AtmosphereError { code: "A03", message })
    }

    /// A quantity at one sun and a pair of keys, on a grid; zeros where the sun gives none.
    fn on(
        &self,
        field: &Field,
        sun: &Sun,
        (j, k): (usize, usize),
        grid: &SpectralGrid,
    ) -> Result<Vec<f64>, AtmosphereError> {
        let mut sum = vec![0.0; grid.len()];
        for (i, weight) in self.suns(field, sun)?.into_iter().flatten() {
            if weight > 0.0 {
                sum.iter_mut().zip(field.curve(i, j, k).on(grid)).for_each(|(s, v)| *s += weight * v);
            }
        }
        Ok(sum)
    }

    fn under(&self, sun: &Sun, grid: &SpectralGrid, needs: &Needs) -> Result<TableSky, AtmosphereError> {
        let given = |quantity: usize, given: bool| match self.fields[quantity].as_ref().filter(|_| given) {
            Some(field) => self.on(field, sun, (0, 0), grid),
            None => Ok(vec![0.0; grid.len()]),
        };
        let solar = given(SOLAR, true)?;
        let mut transmittance = given(SUN, sun.is_up())?;
        transmittance.iter_mut().for_each(|t| *t = t.min(1.0));
        let mut diffuse = vec![0.0; grid.len()];
        let (mut terms, mut directions) = (Vec::new(), None);
        if needs.directional_sky || needs.diffuse_irradiance {
            match (&self.fields[SKY], &self.fields[DIFFUSE]) {
                (Some(sky), _) => {
                    let mut solid = self.solid_weights(sky).into_iter();
                    for j in 0..sky.axes[1].len() {
                        for k in 0..sky.axes[2].len() {
                            let radiance = self.on(sky, sun, (j, k), grid)?;
                            let weight = solid.next().unwrap_or(0.0);
                            diffuse.iter_mut().zip(&radiance).for_each(|(e, l)| *e += weight * l);
                            terms.push(Spectrum::new(radiance));
                        }
                    }
                    directions = Some((sky.axes[1].clone(), self.azimuths(sky)));
                }
                (None, Some(field)) => {
                    diffuse = self.on(field, sun, (0, 0), grid)?;
                    terms.push(Spectrum::new(diffuse.iter().map(|e| e / PI).collect()));
                }
                (None, None) => {}
            }
        }
        let path = |quantity: usize| -> Result<Option<PathField>, AtmosphereError> {
            let Some(field) = self.fields[quantity].as_ref().filter(|_| needs.path) else { return Ok(None) };
            let mut spectra = Vec::new();
            for j in 0..field.axes[1].len() {
                for k in 0..field.axes[2].len() {
                    spectra.push(self.on(field, sun, (j, k), grid)?);
                }
            }
            Ok(Some(PathField { views: field.axes[1].clone(), heights: field.axes[2].clone(), spectra }))
        };
        Ok(TableSky {
            solar: Spectrum::new(solar),
            transmittance: Spectrum::new(transmittance),
            diffuse: Spectrum::new(diffuse),
            terms,
            directions,
            sun_azimuth: sun.apparent.azimuth(),
            path_transmittance: path(PATH_TRANSMITTANCE)?,
            path_radiance: path(PATH_RADIANCE)?,
        })
    }
}

/// ∫ hat(θ) cos θ sin θ dθ over 0..π/2 of every zenith angle, the ends held.
pub(crate) fn zenith_weights(axis: &[f64]) -> Vec<f64> {
    let n = axis.len();
    if n == 1 {
        return vec![0.5];
    }
    let plain = |t: f64| -(2.0 * t).cos() / 4.0; // ∫ sin 2θ/2
    let moment = |t: f64| (2.0 * t).sin() / 8.0 - t * (2.0 * t).cos() / 4.0; // ∫ θ sin 2θ/2
    let mut weights = vec![0.0; n];
    weights[0] += plain(axis[0]) - plain(0.0);
    weights[n - 1] += plain(FRAC_PI_2) - plain(axis[n - 1]);
    for i in 1..n {
        let (a, b) = (axis[i - 1], axis[i]);
        let (zeroth, first) = (plain(b) - plain(a), moment(b) - moment(a));
        weights[i - 1] += (b * zeroth - first) / (b - a);
        weights[i] += (first - a * zeroth) / (b - a);
    }
    weights
}

/// Reads one row into the quantities that it speaks of.
fn gather(
    name: &str,
    header: &Header,
    record: &csv::StringRecord,
    gathered: &mut [Gathered; QUANTITIES.len()],
) -> Result<(), BindError> {
    let line = record.position().map_or(0, csv::Position::line);
    if record.len() != header.names.len() {
        let (found, due) = (record.len(), header.names.len());
        return Err(fault("F01", format!("{name}, line {line}: {found} cells under a header of {due}")));
    }
    let cell = |source: Source, largest: f64| -> Result<Option<f64>, BindError> {
        let (text, column) = (&record[source.column], &header.names[source.column]);
        if text.is_empty() {
            return Ok(None);
        }
        let value: f64 = text
            .parse()
            .ok()
            .filter(|value: &f64| value.is_finite())
            .ok_or_else(|| fault("F01", format!("{name}, line {line}, {column}: `{text}` is no number")))?;
        if value < 0.0 || value > largest {
            let range = if largest == f64::MAX {
                "not negative".to_string()
            } else {
                format!("within 0 and {}", plain(largest))
            };
            return Err(fault("U05", format!("{name}, line {line}: {column} is {text}, but it must be {range}")));
        }
        Ok(Some(value * source.factor + 0.0)) // −0 becomes 0
    };
    let wavelength = cell(header.wavelength, f64::MAX)?
        .filter(|wavelength| *wavelength > 0.0)
        .ok_or_else(|| fault("F01", format!("{name}, line {line}: a row needs a wavelength")))?;
    let mut keys = [None; KEYS.len()];
    for ((value, key), source) in keys.iter_mut().zip(&KEYS).zip(header.keys) {
        if let Some(source) = source {
            *value = cell(source, key.largest)?;
        }
    }
    for (quantity, (found, source)) in QUANTITIES.iter().zip(gathered.iter_mut().zip(header.quantities)) {
        let Some(source) = source else { continue };
        let Some(value) = cell(source, quantity.largest)? else { continue };
        let at_zenith = keys[SKY_ZENITH] == Some(0.0);
        let mut place: Place = [f64::NAN.to_bits(); 3];
        let filled = found.filled.get_or_insert_with(|| {
            let stands = |key: usize| keys[key].is_some() || (at_zenith && key == SKY_AZIMUTH);
            quantity.keys.map(|key| key.is_some_and(|key| header.keys[key].is_some() && stands(key)))
        });
        for (i, key) in quantity.keys.iter().enumerate() {
            let Some(key) = *key else { continue };
            if key == SKY_AZIMUTH && at_zenith && filled[i] {
                place[i] = 0; // all azimuths meet at the zenith
                continue;
            }
            match (keys[key], filled[i]) {
                (Some(value), true) => place[i] = value.to_bits(),
                (None, false) => {}
                _ => {
                    let what = if filled[i] { "lacks" } else { "has" };
                    let message = format!(
                        "{name}, line {line}: this row of {} {what} a {}, unlike those above",
                        quantity.name, KEYS[key].name
                    );
                    return Err(fault("F01", message));
                }
            }
        }
        let rows = found.groups.entry(place).or_default();
        match rows.last() {
            Some((last, _)) if wavelength <= *last => {
                let same = rows.binary_search_by(|row| row.0.total_cmp(&wavelength)).ok().map(|at| rows[at].1);
                if same != Some(value) {
                    let column = &header.names[source.column];
                    let what = if same.is_some() { "is said twice with different values" } else { "does not ascend" };
                    let message = format!(
                        "{name}, line {line}: wavelength {} of {column} {what}",
                        &record[header.wavelength.column]
                    );
                    return Err(fault("M05", message));
                }
            }
            _ => rows.push((wavelength, value)),
        }
    }
    Ok(())
}

/// A quantity's curves at every combination of its keys; `None` without any row.
fn field(name: &str, quantity: usize, gathered: Gathered) -> Result<Option<Field>, BindError> {
    let mut groups = gathered.groups;
    if groups.is_empty() {
        return Ok(None);
    }
    let axis = |i: usize, groups: &BTreeMap<Place, Vec<(f64, f64)>>, but_zenith: bool| -> Vec<u64> {
        let mut values: Vec<u64> =
            groups.keys().filter(|place| !(but_zenith && place[1] == 0)).map(|place| place[i]).collect();
        values.sort_unstable();
        values.dedup();
        values
    };
    let azimuthal = quantity == SKY && gathered.filled.is_some_and(|filled| filled[2]);
    let mut axes = [0, 1, 2].map(|i| axis(i, &groups, azimuthal && i == 2));
    // Before anything is made for a combination: a file that leaves one out could name more than memory holds.
    for &i in &axes[0] {
        for &j in axes[1].iter().filter(|j| !(azimuthal && **j == 0)) {
            for &k in &axes[2] {
                let place = [i, j, k];
                groups.contains_key(&place).then_some(()).ok_or_else(|| missing(name, quantity, place))?;
            }
        }
    }
    if azimuthal {
        if axes[2].is_empty() {
            axes[2] = vec![0];
        }
        // The zenith is one direction: it stands for every azimuth.
        let zeniths: Vec<(Place, Vec<(f64, f64)>)> =
            groups.iter().filter(|(place, _)| place[1] == 0).map(|(place, rows)| (*place, rows.clone())).collect();
        groups.retain(|place, _| place[1] != 0);
        for (place, rows) in zeniths {
            groups.extend(axes[2].iter().map(|azimuth| ([place[0], 0, *azimuth], rows.clone())));
        }
    }
    let mut curves = Vec::with_capacity(groups.len());
    for &i in &axes[0] {
        for &j in &axes[1] {
            for &k in &axes[2] {
                let place = [i, j, k];
                let rows = groups.get(&place).ok_or_else(|| missing(name, quantity, place))?;
                curves.push(Curve::linear(rows).map_err(|_| {
                    fault("M05", format!("{name}: wavelengths of {} do not ascend", QUANTITIES[quantity].name))
                })?);
            }
        }
    }
    Ok(Some(Field { axes: axes.map(|axis| axis.into_iter().map(f64::from_bits).collect()), curves }))
}

/// The rows of a quantity leave out a combination of its keys.
fn missing(name: &str, quantity: usize, place: Place) -> BindError {
    let quantity = &QUANTITIES[quantity];
    let said: Vec<String> = (place.iter().zip(quantity.keys))
        .filter_map(|(bits, key)| Some((f64::from_bits(*bits), &KEYS[key?])))
        .filter(|(value, _)| !value.is_nan())
        .map(|(value, key)| format!("{} {:.6}{}", key.name, value / key.units[0].1, key.units[0].0.replace('_', " ")))
        .collect();
    let message = format!("{name}: {} has no rows at {}", quantity.name, said.join(", "));
    fault("M05", message).help("its rows must hold every combination of its keys")
}

impl Atmosphere for Table {
    fn nodes(&self) -> Vec<f64> {
        let curves = self.fields.iter().flatten().flat_map(|field| &field.curves).filter(|curve| !curve.is_constant());
        let mut nodes: Vec<f64> = curves.flat_map(|curve| curve.nodes().iter().copied()).collect();
        nodes.sort_by(f64::total_cmp);
        nodes.dedup_by(|b, a| *b - *a <= ONE_NODE);
        nodes
    }

    fn uses(&self) -> &'static [&'static str] {
        &[]
    }

    fn has_directional_sky(&self) -> bool {
        self.fields[SKY].is_some()
    }

    fn report(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn sky_bytes(&self, grid: &SpectralGrid, _: &Needs) -> usize {
        let spectra = |field: &Field| field.axes[1].len() * field.axes[2].len();
        size_of::<f64>() * grid.len() * self.fields.iter().flatten().map(spectra).sum::<usize>()
    }

    fn solve(
        &self,
        _column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        needs: &Needs,
    ) -> Result<Vec<Box<dyn SkyState>>, AtmosphereError> {
        for ((field, quantity), source) in self.fields.iter().zip(&QUANTITIES).zip(&self.sources) {
            if let Some(field) =
                field.as_ref().filter(|field| !field.curves.iter().all(|curve| curve.covers(0.0, f64::MAX)))
            {
                coverage::check(&format!("{} of {source}", quantity.name), field.domain(), grid)?;
            }
        }
        if self.imported {
            self.suffices(needs)?;
            self.suns_agree(suns)?;
        }
        suns.iter().map(|sun| Ok(Box::new(self.under(sun, grid, needs)?) as Box<dyn SkyState>)).collect()
    }
}

/// Spectra at view zenith angles and sensor heights.
struct PathField {
    views: Vec<f64>,
    heights: Vec<f64>,
    spectra: Vec<Vec<f64>>,
}

impl PathField {
    fn fill(&self, path: &Path, values: &mut [f64]) {
        values.fill(0.0);
        for (j, a) in bracket(&self.views, path.towards_sensor.zenith()) {
            for (k, b) in bracket(&self.heights, path.sensor_height) {
                if a * b > 0.0 {
                    let spectrum = &self.spectra[j * self.heights.len() + k];
                    values.iter_mut().zip(spectrum).for_each(|(value, s)| *value += a * b * s);
                }
            }
        }
    }
}

struct TableSky {
    solar: Spectrum<Irradiance>,
    transmittance: Spectrum<Transmittance>,
    diffuse: Spectrum<Irradiance>,
    /// One a direction, azimuths running first; or one for all of them.
    terms: Vec<Spectrum<Radiance>>,
    /// Zenith angles and azimuths of a sky in directions.
    directions: Option<(Vec<f64>, Azimuths)>,
    sun_azimuth: f64,
    path_transmittance: Option<PathField>,
    path_radiance: Option<PathField>,
}

impl SkyState for TableSky {
    fn solar_irradiance(&self) -> &Spectrum<Irradiance> {
        &self.solar
    }

    fn sun_transmittance(&self) -> &Spectrum<Transmittance> {
        &self.transmittance
    }

    fn diffuse_irradiance(&self) -> &Spectrum<Irradiance> {
        &self.diffuse
    }

    fn sky_terms(&self) -> &[Spectrum<Radiance>] {
        &self.terms
    }

    fn sky_weights(&self, direction: WorldDir, weights: &mut Vec<(u32, f64)>) {
        weights.clear();
        if direction.cos_zenith() < 0.0 || self.terms.is_empty() {
            return;
        }
        let Some((zeniths, azimuths)) = &self.directions else {
            weights.push((0, 1.0));
            return;
        };
        let about = azimuths.about(direction.azimuth(), self.sun_azimuth);
        for (j, a) in bracket(zeniths, direction.zenith()) {
            for (k, b) in about {
                if a * b > 0.0 {
                    weights.push(((j * azimuths.axis.len() + k) as u32, a * b));
                }
            }
        }
    }

    fn path(&self, path: &Path, transmittance: &mut [f64], radiance: &mut [f64]) {
        match &self.path_transmittance {
            Some(field) => field.fill(path, transmittance),
            None => transmittance.fill(1.0),
        }
        match &self.path_radiance {
            Some(field) => field.fill(path, radiance),
            None => radiance.fill(0.0),
        }
    }
}

/// The azimuths of a sky in directions.
#[derive(Clone, Debug)]
struct Azimuths {
    axis: Vec<f64>,
    /// Counted from the sun's azimuth.
    relative: bool,
}

impl Azimuths {
    /// Whether one side of the sun stands for both.
    fn mirrored(&self) -> bool {
        self.relative && self.axis.last().is_some_and(|last| *last <= PI + 1e-9)
    }

    /// From the last azimuth over north to the first.
    fn over_north(&self) -> f64 {
        self.axis[0] + TAU - self.axis[self.axis.len() - 1]
    }

    /// ∫ hat dφ over the full circle, of every azimuth.
    fn weights(&self) -> Vec<f64> {
        let (axis, n) = (&self.axis, self.axis.len());
        if n == 1 {
            return vec![TAU];
        }
        let gap = |i: usize| axis[i + 1] - axis[i];
        (0..n)
            .map(|i| {
                if self.mirrored() {
                    let before = if i == 0 { axis[0] } else { 0.5 * gap(i - 1) };
                    let after = if i + 1 == n { (PI - axis[i]).max(0.0) } else { 0.5 * gap(i) };
                    2.0 * (before + after)
                } else {
                    let before = if i == 0 { self.over_north() } else { gap(i - 1) };
                    let after = if i + 1 == n { self.over_north() } else { gap(i) };
                    0.5 * (before + after)
                }
            })
            .collect()
    }

    /// The azimuths about a direction, with their weights.
    fn about(&self, azimuth: f64, sun_azimuth: f64) -> [(usize, f64); 2] {
        let (axis, n) = (&self.axis, self.axis.len());
        if n == 1 {
            return [(0, 1.0), (0, 0.0)];
        }
        let azimuth = (if self.relative { azimuth - sun_azimuth } else { azimuth }).rem_euclid(TAU);
        if self.mirrored() {
            return bracket(axis, azimuth.min(TAU - azimuth));
        }
        let gap = self.over_north();
        if (axis[0]..=axis[n - 1]).contains(&azimuth) || gap <= 0.0 {
            return bracket(axis, azimuth);
        }
        let past = (azimuth - axis[n - 1]).rem_euclid(TAU);
        let t = (past / gap).clamp(0.0, 1.0);
        [(n - 1, 1.0 - t), (0, t)]
    }
}

fn plain(limit: f64) -> String {
    if limit >= 1e6 { format!("{limit:e}") } else { limit.to_string() }
}
