//! The report that 6S and 6SV print: a frame of stars, one wavelength or band a run. Reports of several runs in one
//! file make a spectrum.
//!
//! ```text
//! E_s  = sol. spect, or int. sol. spect / int. funct filter       at the date, as printed
//! τ₁   = direct solar irr. / (E_s cos θ_s)
//! E_d  = atm. diffuse irr. + environment irr.
//! τ₂   = (upward global gas. trans.) exp(−optical depth / cos θ_v)  of the air under the sensor
//! L_u  = atm. intrin. rad. + background rad.
//! ```
//!
//! \[Vermote1997\]: the environment's terms are light of the run's ground that the air sends down and up again.

use sunglint_plugin::FileArg;

use super::import::{Fault, Import, Value, degrees, lines, number, shown};
use super::{DIFFUSE, KEYS, PATH_RADIANCE, PATH_TRANSMITTANCE, SOLAR, SUN, SUN_ZENITH, VIEW_ZENITH};

/// What a report says, with the line that says it.
#[derive(Default)]
struct Report {
    /// Line where it begins.
    line: usize,
    sun_zenith: Option<(usize, f64)>,
    view_zenith: Option<(usize, f64)>,
    /// Azimuth between sun and sensor.
    azimuth: Option<(usize, f64)>,
    /// First and last wavelength \[µm\].
    wavelengths: Option<(usize, [f64; 2])>,
    irradiances: Option<(usize, [f64; 3])>,
    radiances: Option<(usize, [f64; 3])>,
    solar: Option<(usize, f64)>,
    depth: Option<(usize, [f64; 3])>,
    depth_under_plane: Option<(usize, [f64; 3])>,
    gas: Option<(usize, [f64; 3])>,
}

/// The numbers of a line of a report, words left out; overflown fields (`*****`) are an error.
fn values<const N: usize>(line: usize, text: &str) -> Result<[f64; N], Fault> {
    if text.contains("**") {
        return Err(Fault::at(line, "a number that did not fit its field: stars"));
    }
    let found: Vec<f64> = text.split(|c: char| c.is_whitespace() || c == ':' || c == '=').filter_map(number).collect();
    let message = || format!("{} numbers where {N} are due: {}", found.len(), shown(text.trim()));
    found.as_slice().try_into().map_err(|_| Fault::at(line, message()))
}

/// The number behind a label.
fn behind(line: usize, text: &str, label: &str) -> Result<f64, Fault> {
    let rest = text.split_once(label).map_or("", |(_, rest)| rest);
    let word = rest.trim_start_matches([' ', ':', '=']).split_whitespace().next().unwrap_or_default();
    number(word).ok_or_else(|| Fault::at(line, format!("`{}` behind `{label}` is no number", shown(word))))
}

/// Reads the reports of a file.
pub(super) fn read(file: &FileArg) -> Result<Import, Fault> {
    let lines: Vec<(usize, String)> = lines(file)?.iter().map(|(line, text)| (*line, unframed(text))).collect();
    let mut reports: Vec<Report> = Vec::new();
    for (i, (line, text)) in lines.iter().enumerate() {
        if text.contains("version") && text.contains("6s") {
            reports.push(Report { line: *line, ..Report::default() });
            continue;
        }
        if let Some(report) = reports.last_mut() {
            report.take(*line, text, lines.get(i + 1).map(|(line, text)| (*line, text.as_str())))?;
        }
    }
    if reports.is_empty() {
        return Err(Fault::whole("no report of 6S: no line with its version").help("the text that 6S prints is read"));
    }
    let mut import = Import::default();
    for report in &reports {
        report.put_values(&mut import.values)?;
    }
    let of = |quantity: usize, key: usize| {
        degrees(import.values.iter().filter(|v| v.quantity == quantity).filter_map(|v| v.keys[key])).unwrap_or_default()
    };
    let (suns, views) = (of(SUN, SUN_ZENITH), of(PATH_RADIANCE, VIEW_ZENITH));
    let azimuths = reports.iter().filter_map(|report| report.azimuth).map(|(_, angle)| angle.to_radians());
    let azimuth = degrees(azimuths).map_or_else(String::new, |at| format!(", azimuth difference {at}"));
    let n = reports.len();
    let note = format!(
        "{n} reports, the sun at zenith {suns}: E_s, τ₁ = direct/(E_s cos θ), E_d with the light of the run's ground"
    );
    let paths = format!(
        "L_u for view zenith {views}{azimuth}: intrinsic and background radiance, so with the light of the run's ground"
    );
    import.notes.extend([note, paths]);
    if import.values.iter().any(|v| v.quantity == PATH_TRANSMITTANCE) {
        import
            .notes
            .push("τ₂ = T_gas exp(−τ/cos θ), the direct transmittance, from the printed optical depth".to_string());
    }
    if reports.iter().any(|report| report.wavelengths.is_some_and(|(_, [a, b])| a < b)) {
        import.notes.push("means of a band hold all over it, and straight lines lie between bands".to_string());
    }
    Ok(import)
}

/// Without the frame, in lower case.
fn unframed(text: &str) -> String {
    let text = text.trim();
    let text = text.strip_prefix('*').unwrap_or(text);
    text.strip_suffix('*').unwrap_or(text).to_ascii_lowercase()
}

impl Report {
    fn take(&mut self, line: usize, text: &str, next: Option<(usize, &str)>) -> Result<(), Fault> {
        fn set<T>(slot: &mut Option<(usize, T)>, line: usize, value: T) {
            *slot = Some((line, value));
        }
        let below = || next.ok_or_else(|| Fault::at(line, "the numbers below this line are missing"));
        if text.contains("solar zenith angle:") {
            set(&mut self.sun_zenith, line, behind(line, text, "solar zenith angle:")?);
        } else if text.contains("view zenith angle:") {
            set(&mut self.view_zenith, line, behind(line, text, "view zenith angle:")?);
        } else if text.contains("azimuthal angle difference:") {
            set(&mut self.azimuth, line, behind(line, text, "azimuthal angle difference:")?);
        } else if text.contains("monochromatic calculation at wl") {
            let wavelength = behind(line, text, "at wl")?;
            set(&mut self.wavelengths, line, [wavelength; 2]);
        } else if text.contains("wl inf=") {
            set(&mut self.wavelengths, line, [behind(line, text, "wl inf=")?, behind(line, text, "wl sup=")?]);
        } else if text.contains("direct solar irr.") {
            let (line, text) = below()?;
            set(&mut self.irradiances, line, values(line, text)?);
        } else if text.contains("atm. intrin. rad.") {
            let (line, text) = below()?;
            set(&mut self.radiances, line, values(line, text)?);
        } else if text.contains("int. funct filter") {
            let (line, text) = below()?;
            let [filter, solar] = values(line, text)?;
            if filter <= 0.0 {
                return Err(Fault::at(line, "a filter without width"));
            }
            set(&mut self.solar, line, solar / filter);
        } else if text.contains("sol. spect (in w/m2/mic)") {
            let (line, text) = below()?;
            let [solar] = values(line, text)?;
            set(&mut self.solar, line, solar);
        } else if text.contains("optical depth total") {
            set(&mut self.depth, line, values(line, text)?);
        } else if text.contains("optical depth plane") {
            set(&mut self.depth_under_plane, line, values(line, text)?);
        } else if text.contains("global gas. trans.") {
            set(&mut self.gas, line, values(line, text)?);
        }
        Ok(())
    }

    fn put_values(&self, to: &mut Vec<Value>) -> Result<(), Fault> {
        let lacks = |what: &str| Fault::at(self.line, format!("the report that begins here lacks its {what}"));
        let angle = |of: Option<(usize, f64)>, what: &str| -> Result<f64, Fault> {
            let (line, angle) = of.ok_or_else(|| lacks(what))?;
            match (0.0..90.0).contains(&angle) {
                true => Ok(angle.to_radians()),
                false => Err(Fault::at(line, format!("{what} {angle} deg is not between 0 and 90")).code("U05")),
            }
        };
        let sun = angle(self.sun_zenith, "solar zenith angle")?;
        let view = angle(self.view_zenith, "view zenith angle")?;
        let (wl_line, [first, last]) = self.wavelengths.ok_or_else(|| lacks("wavelength"))?;
        if !(first > 0.0 && first <= last && last < 1e3) {
            return Err(Fault::at(wl_line, format!("no wavelengths of light: {first} to {last} mic")).code("U05"));
        }
        let (solar_line, solar) = self.solar.ok_or_else(|| lacks("solar spectrum"))?;
        let (e_line, [direct, diffuse, environment]) =
            self.irradiances.ok_or_else(|| lacks("irradiances at ground level"))?;
        let (l_line, [intrinsic, background, _]) = self.radiances.ok_or_else(|| lacks("radiances at the sensor"))?;
        if solar <= 0.0 {
            return Err(Fault::at(solar_line, "the solar spectrum is not positive").code("U05"));
        }
        // Means of touching bands are a step: the ends draw in by far less than any bin is wide.
        let draw = 1e-9 * (last - first);
        let ends = if first < last { vec![first + draw, last - draw] } else { vec![first] };
        for wavelength in ends {
            let mut push = |line: usize, quantity: usize, value: f64| {
                let mut keys = [None; KEYS.len()];
                if quantity != SOLAR && quantity != PATH_TRANSMITTANCE {
                    keys[SUN_ZENITH] = Some(sun);
                }
                if matches!(quantity, PATH_RADIANCE | PATH_TRANSMITTANCE) {
                    keys[VIEW_ZENITH] = Some(view);
                }
                to.push(Value { quantity, keys, wavelength, value, line });
            };
            push(solar_line, SOLAR, solar);
            push(e_line, SUN, rounded_to_one(direct / (solar * sun.cos())));
            push(e_line, DIFFUSE, diffuse + environment);
            push(l_line, PATH_RADIANCE, intrinsic + background);
            if let (Some((line, [_, upward, _])), Some((_, depth))) = (self.gas, self.depth_under_plane.or(self.depth))
            {
                push(line, PATH_TRANSMITTANCE, upward * (-depth[2] / view.cos()).exp());
            }
        }
        Ok(())
    }
}

/// Rounding of what is printed may pass 1 by a thousandth.
fn rounded_to_one(ratio: f64) -> f64 {
    if ratio < 1.001 { ratio.min(1.0) } else { ratio }
}
