//! One table from several files: each quantity from one of them, and what waits for another.

use std::collections::BTreeMap;

use sunglint_plugin::{Args, BindError, FileArg, SpectralValue};
use sunglint_radiometry::Curve;

use super::import::{Fault, Import, Value};
use super::{
    DIFFUSE, Field, Gathered, KEYS, ONE_SUN, PATH_RADIANCE, PATH_TRANSMITTANCE, Place, QUANTITIES, SKY, SKY_AZIMUTH,
    SKY_ZENITH, SOLAR, SUN, SUN_ZENITH, Table, fault, field, plain, sixs, tape7, uvspec,
};
use crate::none::HSRS;

/// Deviation of E_d as printed from the integral of the sky as printed in directions, in units of the larger.
const SKY_AS_PRINTED: f64 = 0.05;

/// The quantities in symbols.
const SYMBOLS: [&str; QUANTITIES.len()] = ["E_s", "τ₁", "E_d", "L_d", "τ₂", "L_u"];

/// Quantities that a scene may state beside its files.
const STATED: [(&str, usize); 5] = [
    ("solar_irradiance", SOLAR),
    ("sun_transmittance", SUN),
    ("diffuse_irradiance", DIFFUSE),
    ("path_transmittance", PATH_TRANSMITTANCE),
    ("path_radiance", PATH_RADIANCE),
];

/// The table of a scene's block.
pub(super) fn table(args: &Args) -> Result<Table, BindError> {
    let file = args.file("file");
    let imports = ["tape7", "tape7_sun", "tape7_sky", "uvspec", "sixs"];
    let imported = imports.iter().any(|name| args.file(name).is_some());
    if file.is_none() && !imported {
        let message = "`table` needs a file";
        return Err(fault("S05", message.to_string()).help(format!("give `file`, {}", imports.join(", "))));
    }
    let alone = !imported && STATED.iter().all(|(name, _)| args.spectral(name).is_none());
    let mut table = match file {
        Some(file) => Table::read(file, alone)?,
        None => Table::empty(),
    };
    if alone {
        return Ok(table);
    }
    table.imported = imported;
    let mut gathering = Gathering { table, waiting: Vec::new(), of_sun: Vec::new() };
    for (name, quantity) in STATED {
        if let Some(value) = args.spectral(name) {
            gathering.put(quantity, stated(name, value)?, name, format!("`{name}`"))?;
        }
    }
    for (param, role) in
        [("tape7_sun", tape7::Role::Sun), ("tape7", tape7::Role::Path), ("tape7_sky", tape7::Role::Sky)]
    {
        if let Some(file) = args.file(param) {
            gathering.take(param, file, tape7::read(file, role).map_err(|fault| fault.of(param, &file.name))?)?;
        }
    }
    if let Some(output) = args.file("uvspec") {
        let Some(input) = args.file("uvspec_input") else {
            let message = "the output of uvspec does not say what it holds";
            return Err(BindError::new("S05", "uvspec", message).help("give its input as `uvspec_input`"));
        };
        let factor = match args.word("uvspec_units") {
            Some("w_m2_nm") => 1e3,
            _ => 1.0, // mW m⁻² nm⁻¹ = W m⁻² µm⁻¹
        };
        let import = uvspec::read(output, input, factor).map_err(|(of_input, fault)| match of_input {
            true => fault.of("uvspec_input", &input.name),
            false => fault.of("uvspec", &output.name),
        })?;
        gathering.take("uvspec", output, import)?;
    }
    if let Some(file) = args.file("sixs") {
        gathering.take("sixs", file, sixs::read(file).map_err(|fault| fault.of("sixs", &file.name))?)?;
    }
    gathering.finish(args.number("sun_zenith"))
}

/// What the scene's block gives, gathered.
struct Gathering {
    table: Table,
    /// Imports with rows that other files' rows make values of.
    waiting: Vec<(&'static str, String, Import)>,
    /// Fields in units of E_s.
    of_sun: Vec<(usize, Field, &'static str)>,
}

fn stated(name: &'static str, value: &SpectralValue) -> Result<Field, BindError> {
    let curve = match value {
        SpectralValue::Constant(value) => Curve::constant(*value),
        SpectralValue::Curve(curve) => curve.clone(),
        SpectralValue::PerBand(_) => {
            let message = format!("`{name}` stands beside spectra here, and cannot go by bands");
            return Err(BindError::new("M04", name, message).help("give one number, or a table against wavelength"));
        }
    };
    Ok(Field::of(curve))
}

impl Field {
    /// A quantity that depends on wavelength alone.
    fn of(curve: Curve) -> Self {
        Self { axes: [vec![f64::NAN], vec![f64::NAN], vec![f64::NAN]], curves: vec![curve] }
    }

    /// Every curve combined with one against wavelength, exact at the nodes of both.
    fn with(&self, other: &Curve, combine: impl Fn(f64, f64) -> f64) -> Option<Self> {
        let curves = self.curves.iter().map(|curve| combined(curve, other, &combine)).collect::<Option<_>>()?;
        Some(Self { axes: self.axes.clone(), curves })
    }
}

/// Two curves made one over the wavelengths that both speak for; `None` where there are none.
fn combined(a: &Curve, b: &Curve, combine: impl Fn(f64, f64) -> f64) -> Option<Curve> {
    let span = |curve: &Curve| match curve.covers(0.0, f64::MAX) {
        true => (0.0, f64::MAX), // extrapolated: for all
        false => curve.domain(),
    };
    if a.is_constant() && b.is_constant() {
        return Some(Curve::constant(combine(a.at(1.0), b.at(1.0))));
    }
    let ((a0, a1), (b0, b1)) = (span(a), span(b));
    let (first, last) = (a0.max(b0), a1.min(b1));
    let mut nodes: Vec<f64> = a.nodes().iter().chain(b.nodes()).copied().collect();
    nodes.extend([first, last].into_iter().filter(|end| *end > 0.0 && *end < f64::MAX));
    nodes.retain(|node| (first..=last).contains(node));
    nodes.sort_by(f64::total_cmp);
    nodes.dedup();
    let rows: Vec<(f64, f64)> = nodes.iter().map(|node| (*node, combine(a.at(*node), b.at(*node)))).collect();
    Curve::linear(&rows).ok()
}

impl Gathering {
    /// A field given by `source`; a second one for the same quantity is an error.
    fn put(&mut self, quantity: usize, field: Field, param: &'static str, source: String) -> Result<(), BindError> {
        let table = &mut self.table;
        if table.fields[quantity].is_some() {
            let message = format!("{} is given by {} and by {source}", SYMBOLS[quantity], table.sources[quantity]);
            return Err(BindError::new("S05", param, message).help("keep one of them"));
        }
        table.fields[quantity] = Some(field);
        table.sources[quantity] = source;
        Ok(())
    }

    fn take(&mut self, param: &'static str, file: &FileArg, mut import: Import) -> Result<(), BindError> {
        let name = &file.name;
        if !self.table.name.split(", ").any(|other| other == name) {
            let gap = if self.table.name.is_empty() { "" } else { ", " };
            self.table.name = format!("{}{gap}{name}", self.table.name);
        }
        let spare = std::mem::take(&mut import.spare);
        let missing = |value: &Value| self.table.fields[value.quantity].is_none();
        let spare: Vec<Value> = spare.into_iter().filter(missing).collect();
        if !spare.is_empty() {
            import.notes.push(std::mem::take(&mut import.spare_note));
            import.values.extend(spare);
        }
        let given = fields(&import, name).map_err(|fault| fault.of(param, name))?;
        for (quantity, (field, sun)) in given {
            if let Some(sun) = sun.map(|sun| (name.clone(), sun)).filter(|sun| !self.table.suns.contains(sun)) {
                self.table.suns.push(sun);
            }
            if quantity == SKY {
                self.table.relative = true;
            }
            let in_units_of_sun = import.of_sun && matches!(quantity, DIFFUSE | SKY | PATH_RADIANCE);
            self.put(quantity, field, param, name.clone())?;
            if in_units_of_sun && let Some(field) = self.table.fields[quantity].take() {
                self.of_sun.push((quantity, field, param));
            }
        }
        let notes = std::mem::take(&mut import.notes);
        self.table.notes.extend(notes.into_iter().map(|note| format!("{name}: {note}")));
        import.values = Vec::new();
        self.waiting.push((param, name.clone(), import));
        Ok(())
    }

    /// What has to wait for E_s, and then for τ₁; the checks of the whole.
    fn finish(mut self, sun_zenith: Option<f64>) -> Result<Table, BindError> {
        let nothing =
            |param, name: &str| BindError::new("M04", param, format!("E_s and {name} have no wavelength in common"));
        if self.table.fields[SOLAR].is_none() {
            if !self.table.imported {
                let message = "no file gives E_s".to_string();
                return Err(fault("S05", message).help("say `solar_irradiance`"));
            }
            self.put(SOLAR, Field::of(HSRS.clone()), "solar_irradiance", "the TSIS-1 solar spectrum".to_string())?;
            let note =
                "E_s is the TSIS-1 spectrum at 1 au [Coddington2023]: neither a file nor `solar_irradiance` says it";
            self.table.notes.push(note.to_string());
        }
        let solar = self.table.fields[SOLAR].as_ref().map_or_else(|| HSRS.clone(), |field| field.curves[0].clone());
        for (quantity, field, param) in std::mem::take(&mut self.of_sun) {
            let name = self.table.sources[quantity].clone();
            let field = field.with(&solar, |ratio, e_s| ratio * e_s).ok_or_else(|| nothing(param, &name))?;
            self.put(quantity, field, param, name)?;
        }
        let waiting = std::mem::take(&mut self.waiting);
        for (param, name, import) in &waiting {
            if import.beam.is_empty() {
                continue;
            }
            let beam = Curve::linear(&import.beam).map_err(|_| descends(param, name))?;
            let ratio = |beam: f64, e_s: f64| if e_s > 0.0 { beam / e_s } else { 0.0 };
            let curve = combined(&beam, &solar, ratio).ok_or_else(|| nothing(param, name))?;
            let (least, most) = curve.range();
            // E_s and beam that are sampled apart, or rounded, may pass 1 a little.
            if !(least >= 0.0 && most <= 1.01) {
                let at = curve.nodes().iter().find(|node| !(0.0..=1.01).contains(&curve.at(**node)));
                let message = format!(
                    "{name}: at {:.6} nm the direct beam is {:.4} of E_s",
                    at.map_or(0.0, |at| at * 1e3),
                    at.map_or(0.0, |at| curve.at(*at))
                );
                let help = "E_s must be the one of the run: its spectrum, date and `uvspec_units`";
                return Err(BindError::new("M05", param, message).help(help));
            }
            let (param, name) = (*param, name.clone());
            self.table.notes.push(format!("{name}: τ₁ is the direct beam over E_s of {}", self.table.sources[SOLAR]));
            self.put(SUN, Field::of(curve), param, name)?;
        }
        self.diffuse_from_ground(&waiting, &solar, sun_zenith)?;
        if let Some(zenith) = sun_zenith {
            if let Some((name, said)) = self.table.suns.iter().find(|(_, said)| (said - zenith).abs() > ONE_SUN) {
                let message = format!("{name} says that the sun stood at zenith {:.4} deg", said.to_degrees());
                return Err(BindError::new("M05", "sun_zenith", message));
            }
            self.table.suns.push(("`sun_zenith`".to_string(), zenith));
        }
        let mut table = self.table;
        if table.fields[SUN].is_none() {
            let message = format!("{} gives no τ₁", table.name);
            return Err(BindError::of_block("S05", message)
                .help("add a file of the path to the sun (`tape7_sun`), or say `sun_transmittance`"));
        }
        table.check_diffuse(SKY_AS_PRINTED)?;
        for (symbol, quantity) in SYMBOLS.iter().zip(0..) {
            let sky = quantity == DIFFUSE && table.fields[SKY].is_some()
                || quantity == SKY && table.fields[DIFFUSE].is_some();
            if table.fields[quantity].is_none() && !sky && table.imported {
                table.notes.push(format!("{}: no {symbol}", table.name));
            }
        }
        Ok(table)
    }

    /// E_d = (GRND − DRCT)/DRCT · E_s τ₁ cos θ_s: the Lambertian ground of a tape7 run reflects light of sky and sun.
    fn diffuse_from_ground(
        &mut self,
        waiting: &[(&'static str, String, Import)],
        solar: &Curve,
        sun_zenith: Option<f64>,
    ) -> Result<(), BindError> {
        for (param, name, import) in waiting {
            let given = self.table.fields[DIFFUSE].is_some() || self.table.fields[SKY].is_some();
            if import.diffuse_over_direct.is_empty() || given {
                continue;
            }
            let said = import.sun.or_else(|| self.table.suns.first().map(|(_, zenith)| *zenith)).or(sun_zenith);
            let Some(zenith) = said else {
                let note = "E_d could be derived from GRND RFLT and DRCT RFLT if `sun_zenith` were said";
                self.table.notes.push(format!("{name}: {note}"));
                continue;
            };
            let Some(sun) = self.table.fields[SUN].as_ref() else { continue };
            let ratio = Curve::linear(&import.diffuse_over_direct).map_err(|_| descends(param, name))?;
            let beam = combined(solar, &sun.curves[0], |e_s, tau| e_s * tau * zenith.cos());
            let diffuse = beam.and_then(|beam| combined(&ratio, &beam, |ratio, beam| ratio * beam));
            let Some(diffuse) = diffuse else { continue };
            self.table.notes.push(format!(
                "{name}: E_d = (GRND − DRCT)/DRCT · E_s τ₁ cos θ over the Lambertian ground of the run, \
                 whose light it holds"
            ));
            self.put(DIFFUSE, Field::of(diffuse), param, name.clone())?;
        }
        Ok(())
    }
}

fn descends(param: &'static str, name: &str) -> BindError {
    BindError::new("M05", param, format!("{name}: wavelengths do not ascend"))
}

/// The fields of a file, each with the one sun that it is for if it says one.
type Given = BTreeMap<usize, (Field, Option<f64>)>;

/// Values into fields, held to what the rows of a CSV table are held to.
fn fields(import: &Import, name: &str) -> Result<Given, Fault> {
    let mut fields = Given::new();
    for (i, quantity) in QUANTITIES.iter().enumerate() {
        let values: Vec<&Value> = import.values.iter().filter(|value| value.quantity == i).collect();
        let Some(first) = values.first() else { continue };
        // A key of one value is what the file is for; directions of the sky are always keys.
        let several = |key: usize| values.iter().any(|value| value.keys[key] != first.keys[key]);
        let keyed =
            quantity.keys.map(|key| key.filter(|key| several(*key) || (i == SKY && first.keys[*key].is_some())));
        let keyed = keyed.map(|key| key.filter(|key| *key != SUN_ZENITH || several(*key)));
        let mut gathered = Gathered { filled: Some(keyed.map(|key| key.is_some())), ..Gathered::default() };
        for value in &values {
            let (column, line) = (quantity.name, value.line);
            if !(value.value >= 0.0 && value.value <= quantity.largest) {
                let message =
                    format!("{column} is {:.6}, but it must be within 0 and {}", value.value, plain(quantity.largest));
                return Err(Fault::at(line, message).code("U05"));
            }
            if !(value.wavelength > 0.0 && value.wavelength < f64::MAX) {
                return Err(Fault::at(line, format!("{} is no wavelength", value.wavelength)).code("U05"));
            }
            let mut place: Place = [f64::NAN.to_bits(); 3];
            for (slot, key) in place.iter_mut().zip(keyed) {
                let Some(key) = key else { continue };
                let at_zenith = i == SKY && key == SKY_AZIMUTH && value.keys[SKY_ZENITH] == Some(0.0);
                *slot = match value.keys[key] {
                    _ if at_zenith => 0,
                    Some(at) => (at + 0.0).to_bits(),
                    None => return Err(Fault::at(line, format!("this {column} lacks a {}", KEYS[key].name))),
                };
            }
            let rows = gathered.groups.entry(place).or_default();
            match rows.last() {
                Some((last, _)) if value.wavelength <= *last => {
                    let same =
                        rows.binary_search_by(|row| row.0.total_cmp(&value.wavelength)).ok().map(|at| rows[at].1);
                    if same != Some(value.value + 0.0) {
                        let what =
                            if same.is_some() { "is said twice with different values" } else { "does not ascend" };
                        let message = format!("wavelength {:.6} um of {column} {what}", value.wavelength);
                        return Err(Fault::at(line, message).code("M05"));
                    }
                }
                _ => rows.push((value.wavelength, value.value + 0.0)), // −0 becomes 0
            }
        }
        let found = field(name, i, gathered).map_err(|error| Fault::whole(error.message).code(error.code))?;
        let sun = first.keys[SUN_ZENITH].filter(|_| !several(SUN_ZENITH));
        if let Some(found) = found {
            fields.insert(i, (found, sun));
        }
    }
    Ok(fields)
}
