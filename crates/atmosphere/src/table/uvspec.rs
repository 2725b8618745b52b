//! Output of libRadtran's `uvspec`, read beside the input it was run with: the output has no header.
//!
//! Directions \[Emde2016, user's guide: `umu`, `phi`, `phi0`\]: `umu` is the cosine of the zenith angle that light
//! travels at, negative downwards; `phi` is the azimuth it travels to, clockwise from north, and `phi0` that of
//! sunlight. So the part of the sky that light of (umu < 0, phi) comes from has zenith angle arccos(−umu) and azimuth
//! phi − phi0 from the sun's.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use sunglint_plugin::FileArg;

use super::import::{Fault, Import, Value, degrees, lines, number, numbers, shown};
use super::{
    DIFFUSE, KEYS, PATH_RADIANCE, SENSOR_HEIGHT, SKY, SKY_AZIMUTH, SKY_ZENITH, SOLAR, SUN, SUN_ZENITH, VIEW_ZENITH,
};

/// What `output_quantity` made of irradiances and radiances.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Quantity {
    /// As they are.
    Absolute,
    /// Over E_s.
    Transmittance,
    /// Irradiance over E_s cos θ_s, radiance times π over it.
    Reflectivity,
}

/// The lines of the input that say what the output holds.
struct Input {
    columns: Vec<String>,
    /// Whether columns are those of the solver, with blocks of radiance below the rows.
    blocks: bool,
    quantity: Quantity,
    umu: Vec<f64>,
    phi: Vec<f64>,
    phi0: f64,
    /// Heights above the ground \[m\], one a level.
    levels: Vec<f64>,
    /// \[rad\]
    sun_zenith: f64,
    /// 0 where said; `None` where the ground reflects, or may.
    black: bool,
}

/// Keywords whose words are read; they stand once.
const READ: [&str; 10] =
    ["output_user", "output_quantity", "umu", "phi", "phi0", "sza", "zout", "albedo", "rte_solver", "mol_abs_param"];

/// Top of the atmosphere in files of libRadtran \[m\].
const TOP: f64 = 1.2e5;

fn one(line: usize, keyword: &str, words: &[&str]) -> Result<f64, Fault> {
    match words {
        [word] => number(word).ok_or_else(|| Fault::at(line, format!("`{}` of {keyword} is no number", shown(word)))),
        _ => Err(Fault::at(line, format!("{keyword} takes one number here"))),
    }
}

impl Input {
    fn read(file: &FileArg) -> Result<Self, Fault> {
        let mut said: BTreeMap<String, (usize, Vec<&str>)> = BTreeMap::new();
        let mut reflects = false;
        let mut process = Vec::new();
        let input = lines(file)?;
        for (line, text) in &input {
            let mut words = text.split('#').next().unwrap_or_default().split_whitespace();
            let Some(keyword) = words.next() else { continue };
            let (keyword, rest) = (keyword.to_ascii_lowercase(), words.collect::<Vec<_>>());
            match keyword.as_str() {
                "include" => {
                    return Err(Fault::at(*line, "an input with `include`").help("write the input as one file"));
                }
                "output_process" => process.push((*line, rest)),
                "output_format" | "output_file" | "mc_backward" | "zout_sea" | "sza_file" | "zout_interpolate" => {
                    return Err(Fault::at(*line, format!("an output made with `{keyword}` is not read")));
                }
                "source" if rest.first() != Some(&"solar") => {
                    return Err(Fault::at(*line, "a source that is not the sun").help("`source solar` is wanted"));
                }
                key if key.starts_with("brdf") || key.starts_with("albedo_") => reflects = true,
                key if READ.contains(&key) => {
                    let twice = said
                        .insert(keyword.clone(), (*line, rest))
                        .map(|_| Fault::at(*line, format!("{keyword} is said twice")));
                    twice.map_or(Ok(()), Err)?;
                }
                _ => {}
            }
        }
        let mut per_nm = false;
        for (line, words) in &process {
            match words.as_slice() {
                ["per_nm"] => per_nm = true,
                ["none"] => {}
                _ => return Err(Fault::at(*line, "`output_process` other than per_nm").help("a spectrum is read")),
            }
        }
        if let Some((line, words)) = said.get("mol_abs_param") {
            let word = words.first().map_or(String::new(), |word| word.to_ascii_lowercase());
            if !per_nm && ["kato", "fu", "avhrr"].iter().any(|sum| word.starts_with(sum)) {
                let message = format!("`mol_abs_param {}` prints sums over bands, no spectrum", shown(&word));
                return Err(Fault::at(*line, message).help("add `output_process per_nm`"));
            }
        }
        let all = |keyword: &str| -> Result<Vec<f64>, Fault> {
            let Some((line, words)) = said.get(keyword) else { return Ok(Vec::new()) };
            let of = |word: &&str| {
                number(word).ok_or_else(|| Fault::at(*line, format!("`{}` of {keyword} is no number", shown(word))))
            };
            words.iter().map(of).collect()
        };
        let single = |keyword: &str| -> Result<Option<f64>, Fault> {
            said.get(keyword).map(|(line, words)| one(*line, keyword, words)).transpose()
        };
        let (umu, phi) = (all("umu")?, all("phi")?);
        if let Some(wrong) = umu.iter().find(|umu| **umu == 0.0 || umu.abs() > 1.0) {
            return Err(Fault::at(said["umu"].0, format!("umu {wrong} is no cosine of a line of sight")));
        }
        let Some(sza) = single("sza")?.filter(|sza| (0.0..90.0).contains(sza)) else {
            let line = said.get("sza").map(|(line, _)| *line);
            return Err(Fault { line, ..Fault::whole("no `sza` from 0 to 90: where the sun was is not known") });
        };
        let mut levels = Vec::new();
        match said.get("zout") {
            None => levels.push(0.0),
            Some((line, words)) => {
                for word in words {
                    levels.push(match word.to_ascii_lowercase().as_str() {
                        "toa" => TOP,
                        "sur" | "surface" | "boa" => 0.0,
                        word => number(word)
                            .filter(|z| (0.0..=1e3).contains(z))
                            .map(|z| 1e3 * z)
                            .ok_or_else(|| Fault::at(*line, format!("`{}` of zout is no height in km", shown(word))))?,
                    });
                }
                if levels.is_empty() {
                    return Err(Fault::at(*line, "zout without a height"));
                }
            }
        }
        let quantity = match said.get("output_quantity") {
            None => Quantity::Absolute,
            Some((_, words)) if words.as_slice() == ["transmittance"] => Quantity::Transmittance,
            Some((_, words)) if words.as_slice() == ["reflectivity"] => Quantity::Reflectivity,
            Some((line, _)) => {
                return Err(Fault::at(*line, "`output_quantity` other than transmittance or reflectivity"));
            }
        };
        let (columns, blocks) = match said.get("output_user") {
            Some((line, words)) => {
                if !words.iter().any(|word| matches!(word.to_ascii_lowercase().as_str(), "lambda" | "wavelength")) {
                    return Err(Fault::at(*line, "`output_user` without lambda").help("wavelengths must be printed"));
                }
                (words.iter().map(|word| word.to_ascii_lowercase()).collect(), false)
            }
            None => (default_columns(said.get("rte_solver"))?, true),
        };
        let black = !reflects && single("albedo")?.is_none_or(|albedo| albedo == 0.0);
        Ok(Self {
            columns,
            blocks,
            quantity,
            umu,
            phi,
            phi0: single("phi0")?.unwrap_or(0.0),
            levels,
            sun_zenith: sza.to_radians(),
            black,
        })
    }
}

fn default_columns(solver: Option<&(usize, Vec<&str>)>) -> Result<Vec<String>, Fault> {
    let name = solver.and_then(|(_, words)| words.first().copied()).unwrap_or("disort");
    let columns: &[&str] = match name {
        "disort" | "disort2" | "cdisort" | "fdisort1" | "fdisort2" | "sdisort" | "spsdisort" => {
            &["lambda", "edir", "edn", "eup", "uavgdir", "uavgdn", "uavgup"]
        }
        "twostr" => &["lambda", "edir", "edn", "eup", "uavg"],
        _ => {
            let line = solver.map_or(1, |(line, _)| *line);
            let message = format!("the columns of solver `{}` are not known", shown(name));
            return Err(Fault::at(line, message).help("say them: `output_user lambda edir edn uu`"));
        }
    };
    Ok(columns.iter().map(|column| (*column).to_string()).collect())
}

/// One row with its radiances.
struct Row {
    line: usize,
    wavelength: f64,
    level: usize,
    edir: Option<f64>,
    edn: Option<f64>,
    /// Azimuthal means, one an umu.
    mean: Vec<f64>,
    /// umu by phi, phi running first.
    radiances: Vec<f64>,
}

/// Reads an output beside its input; absolute values times `factor` are W m⁻² µm⁻¹.
pub(super) fn read(output: &FileArg, input: &FileArg, factor: f64) -> Result<Import, (bool, Fault)> {
    let input = Input::read(input).map_err(|fault| (true, fault))?;
    let rows = lines(output).and_then(|lines| rows(&lines, &input)).map_err(|fault| (false, fault))?;
    Ok(import(&input, &rows, factor))
}

fn rows(lines: &[(usize, &str)], input: &Input) -> Result<Vec<Row>, Fault> {
    let find = |names: &[&str]| input.columns.iter().position(|column| names.contains(&column.as_str()));
    let lambda = find(&["lambda", "wavelength"]).unwrap_or(0);
    let (edir, edn, eglo, uu) = (find(&["edir"]), find(&["edn"]), find(&["eglo"]), find(&["uu"]));
    let directions = input.umu.len() * input.phi.len().max(1);
    // `uu` stands for all its directions.
    let wide = |column: usize| if uu.is_some_and(|uu| uu < column) { column + directions - 1 } else { column };
    if uu.is_some() && (input.umu.is_empty() || input.phi.is_empty()) {
        return Err(Fault::whole("`output_user` has uu, but the input has no umu and phi"));
    }
    let due = wide(input.columns.len());
    let mut seen: BTreeMap<u64, usize> = BTreeMap::new();
    let mut rows = Vec::new();
    let mut filled = lines.iter().filter(|(_, text)| !text.trim().is_empty() && !text.trim_start().starts_with('#'));
    while let Some((line, text)) = filled.next() {
        let cells = numbers(*line, text)?;
        if cells.len() != due {
            let columns = input.columns.join(" ");
            let message = format!("{} numbers where {due} are due ({columns})", cells.len());
            return Err(Fault::at(*line, message).help("the input says what the columns are"));
        }
        let wavelength = 1e-3 * cells[wide(lambda)];
        if wavelength <= 0.0 {
            return Err(Fault::at(*line, "a wavelength is positive").code("U05"));
        }
        let at = |column: Option<usize>| column.map(|column| cells[wide(column)]);
        let (edir, edn) = (at(edir), at(edn));
        let edn = edn.or_else(|| Some(at(eglo)? - edir?));
        let count = seen.entry(wavelength.to_bits()).or_default();
        let level = *count;
        *count += 1;
        if level >= input.levels.len() {
            let message = format!("wavelength {} nm more often than there are levels (zout)", cells[wide(lambda)]);
            return Err(Fault::at(*line, message).code("M05"));
        }
        let mut row = Row { line: *line, wavelength, level, edir, edn, mean: Vec::new(), radiances: Vec::new() };
        if let Some(uu) = uu {
            row.radiances = cells[uu..uu + directions].to_vec();
        }
        if input.blocks && !input.umu.is_empty() {
            block(&mut row, &mut filled, input)?;
        }
        rows.push(row);
    }
    if rows.is_empty() {
        return Err(Fault::whole("no rows"));
    }
    if let Some(row) = rows.iter().find(|row| seen[&row.wavelength.to_bits()] < input.levels.len()) {
        let message = format!("{} levels (zout) are due at this wavelength", input.levels.len());
        return Err(Fault::at(row.line, message).code("M05"));
    }
    Ok(rows)
}

/// The radiances below a row: the line of phi if there are any, then a line an umu.
fn block<'a>(
    row: &mut Row,
    filled: &mut impl Iterator<Item = &'a (usize, &'a str)>,
    input: &Input,
) -> Result<(), Fault> {
    let mut next = |what: &str, due: usize| -> Result<(usize, Vec<f64>), Fault> {
        let Some((line, text)) = filled.next() else {
            return Err(Fault::at(row.line, format!("the radiances below this row lack {what}")));
        };
        let cells = numbers(*line, text)?;
        match cells.len() == due {
            true => Ok((*line, cells)),
            false => Err(Fault::at(*line, format!("{} numbers where {due} are due ({what})", cells.len()))),
        }
    };
    if !input.phi.is_empty() {
        let (line, phi) = next("the line of phi", input.phi.len())?;
        if phi.iter().zip(&input.phi).any(|(a, b)| (a - b).abs() > 1e-3) {
            return Err(Fault::at(line, "these phi are not those of the input"));
        }
    }
    for umu in &input.umu {
        let (line, cells) = next("umu, the azimuthal mean and a radiance each phi", 2 + input.phi.len())?;
        if (cells[0] - umu).abs() > 1e-3 {
            return Err(Fault::at(line, format!("umu {} where {umu} is due by the input", cells[0])));
        }
        row.mean.push(cells[1]);
        row.radiances.extend_from_slice(&cells[2..]);
    }
    Ok(())
}

/// Fuzz of the solver about 0, over the largest value of the same quantity.
const FUZZ: f64 = 1e-6;

fn import(input: &Input, rows: &[Row], factor: f64) -> Import {
    let relative = input.quantity != Quantity::Absolute;
    let mu = input.sun_zenith.cos();
    let (irradiance, radiance) = match input.quantity {
        Quantity::Absolute => (factor, factor),
        Quantity::Transmittance => (1.0, 1.0),
        Quantity::Reflectivity => (mu, mu / PI),
    };
    let mut import = Import { of_sun: relative, sun: Some(input.sun_zenith), ..Import::default() };
    let (n_phi, heights) = (input.phi.len(), input.levels.iter().filter(|z| **z > 0.0).count());
    let down: Vec<usize> = (0..input.umu.len()).filter(|i| input.umu[*i] < 0.0).collect();
    let up: Vec<usize> = (0..input.umu.len()).filter(|i| input.umu[*i] > 0.0).collect();
    let vertical = |i: usize| input.umu[i].abs() > 1.0 - 1e-9;
    // One azimuth is no sky, and L_u has no azimuth in a table.
    let all_round = n_phi == 0;
    let sky = all_round || n_phi > 1 || down.iter().all(|i| vertical(*i));
    let path = |i: usize| input.black && (n_phi == 1 || (n_phi > 1 && vertical(i)));
    let mut values: Vec<Value> = Vec::new();
    for row in rows {
        let height = input.levels[row.level];
        let mut push = |quantity: usize, keys: &[(usize, f64)], value: f64| {
            let mut all = [None; KEYS.len()];
            if quantity != SOLAR {
                all[SUN_ZENITH] = Some(input.sun_zenith);
            }
            keys.iter().for_each(|(key, at)| all[*key] = Some(*at));
            values.push(Value { quantity, keys: all, wavelength: row.wavelength, value, line: row.line });
        };
        let of = |i: usize, k: usize| match all_round {
            true => row.mean.get(i),
            false => row.radiances.get(i * n_phi + k),
        };
        if height == 0.0 {
            match (row.edir, relative) {
                (Some(edir), true) => push(SUN, &[], edir * irradiance / mu),
                (Some(edir), false) => import.beam.push((row.wavelength, edir * irradiance / mu)),
                (None, _) => {}
            }
            if let Some(edn) = row.edn {
                push(DIFFUSE, &[], edn * irradiance);
            }
            for &i in down.iter().filter(|_| sky) {
                for k in 0..if vertical(i) { 1 } else { n_phi.max(1) } {
                    let Some(value) = of(i, k) else { continue };
                    let mut keys = vec![(SKY_ZENITH, (-input.umu[i]).min(1.0).acos())];
                    if let Some(phi) = input.phi.get(k) {
                        let azimuth = (phi - input.phi0).rem_euclid(360.0);
                        keys.push((SKY_AZIMUTH, azimuth.to_radians()));
                    }
                    push(SKY, &keys, value * radiance);
                }
            }
        } else {
            if let (Some(edir), false) = (row.edir, relative || height < TOP) {
                push(SOLAR, &[], edir * irradiance / mu);
            }
            for &i in up.iter().filter(|i| path(**i)) {
                let Some(value) = of(i, 0) else { continue };
                let keys = [(VIEW_ZENITH, input.umu[i].min(1.0).acos()), (SENSOR_HEIGHT, height)];
                push(PATH_RADIANCE, &keys, value * radiance);
            }
        }
    }
    for quantity in [DIFFUSE, SKY, PATH_RADIANCE] {
        let largest = values.iter().filter(|v| v.quantity == quantity).map(|v| v.value).fold(0.0, f64::max);
        let fuzz = |v: &&mut Value| v.quantity == quantity && v.value < 0.0 && v.value >= -FUZZ * largest;
        values.iter_mut().filter(fuzz).for_each(|v| v.value = 0.0);
    }
    let said = degrees(std::iter::once(input.sun_zenith)).unwrap_or_default();
    let how = if relative { "in units of E_s" } else { "as printed" };
    import
        .notes
        .push(format!("the sun at zenith {said}, irradiances and radiances {how}; plane-parallel as the run was"));
    let has = |quantity: usize| values.iter().any(|v| v.quantity == quantity);
    if !has(DIFFUSE) && import.beam.is_empty() && !has(SUN) {
        import.notes.push("no level at the ground (zout 0): neither τ₁ nor E_d".to_string());
    }
    if !down.is_empty() && !sky {
        import.notes.push("radiance from above in one azimuth is no sky, and is not used".to_string());
    }
    if !up.is_empty() && heights > 0 && !has(PATH_RADIANCE) {
        let why = if input.black { "in several azimuths, not at nadir" } else { "over a ground that reflects" };
        import.notes.push(format!("radiance from below {why} is no L_u, and is not used"));
    }
    if has(PATH_RADIANCE) {
        let views = values.iter().filter(|v| v.quantity == PATH_RADIANCE).filter_map(|v| v.keys[VIEW_ZENITH]);
        let (views, phi0) = (degrees(views).unwrap_or_default(), input.phi0);
        let phi = input.phi.first().copied().unwrap_or(0.0);
        import.notes.push(format!("L_u over a black ground for view zenith {views}, phi {phi} (sun: phi0 {phi0})"));
    }
    import.values = values;
    import
}
