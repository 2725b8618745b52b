//! TAPE7 of LOWTRAN 7 and MODTRAN (`.tp7`), and the filtered `tape7.scn` (`.7sc`).
//!
//! A file holds runs. A run is: the cards that were read, a header that begins with `FREQ` or `WAVLEN` (MODTRAN prints
//! a second line below it for transmittances), rows, and `-9999.`. Spectral values are per cm⁻¹ where the first column
//! is a wavenumber ν, so with λ = 10⁴/ν µm and |dν/dλ| = ν²/10⁴
//!
//! ```text
//! 1 W cm⁻² sr⁻¹ (cm⁻¹)⁻¹ = 10⁴ · ν²/10⁴ W m⁻² sr⁻¹ µm⁻¹ = ν² W m⁻² sr⁻¹ µm⁻¹
//! ```
//!
//! per µm with `WAVLEN(MCRN)`, and µW per nm with `WAVLEN(NM)` \[Kneizys1988; Berk1999, card 4\].

use sunglint_plugin::FileArg;

use super::import::{Fault, Import, Value, degrees, lines, number, numbers, shown};
use super::{
    KEYS, PATH_RADIANCE, PATH_TRANSMITTANCE, SKY, SKY_AZIMUTH, SKY_ZENITH, SOLAR, SUN, SUN_ZENITH, VIEW_ZENITH,
};

/// What a file of runs is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    /// From the target to the sensor: τ₂ and L_u.
    Path,
    /// From the target to the sun: E_s and τ₁.
    Sun,
    /// From the target into the sky, a run a direction: L_d.
    Sky,
}

/// What the rows of a run hold.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// IEMSCT 0.
    Transmittance,
    /// IEMSCT 1, 2 and 4.
    Radiance,
    /// IEMSCT 3.
    Irradiance,
}

/// Unit of the first column.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Abscissa {
    Wavenumber,
    Micrometre,
    Nanometre,
}

impl Abscissa {
    /// Wavelength \[µm\], and the factor of spectral values to W m⁻² µm⁻¹.
    fn canonical(self, x: f64) -> (f64, f64) {
        match self {
            Self::Wavenumber => (1e4 / x, x * x),
            Self::Micrometre => (x, 1e4),
            Self::Nanometre => (1e-3 * x, 10.0),
        }
    }
}

/// Columns that are read, by the names of MODTRAN 5; LOWTRAN 7 and MODTRAN 6 have others for the same.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    line: usize,
    wavelength: f64,
    trans: f64,
    sol_scat: Option<f64>,
    grnd_rflt: Option<f64>,
    drct_rflt: Option<f64>,
    ref_sol: Option<f64>,
    toa_sun: Option<f64>,
}

/// Geometry by the cards above the header \[rad\].
#[derive(Clone, Copy, Debug)]
struct Cards {
    /// H1 and H2 \[km\], and the zenith angle of the path at H1.
    h1: f64,
    h2: f64,
    angle: f64,
    /// Sun by IPARM 2 or 12: azimuth from the line of sight, zenith.
    sun: Option<(f64, f64)>,
}

struct Run {
    /// Line of the header.
    line: usize,
    kind: Kind,
    cards: Option<Cards>,
    rows: Vec<Row>,
}

const NEEDS: [(Role, &str); 3] = [
    (Role::Path, "the path from target to sensor wants runs of IEMSCT 2 (radiance) or 0 (transmittance)"),
    (Role::Sun, "the path to the sun wants one run of IEMSCT 3 (solar irradiance) or 0 (transmittance)"),
    (Role::Sky, "the sky wants runs of IEMSCT 2, one a direction"),
];

/// Reads a TAPE7.
pub(super) fn read(file: &FileArg, role: Role) -> Result<Import, Fault> {
    let runs = runs(&lines(file)?)?;
    let Some(first) = runs.first() else {
        return Err(Fault::whole("no run: no line begins with FREQ or WAVLEN")
            .help("TAPE7 of LOWTRAN 7 or MODTRAN (.tp7), or tape7.scn (.7sc), is read"));
    };
    let wants = NEEDS.iter().find(|(of, _)| *of == role).map_or("", |(_, wants)| wants);
    for run in &runs {
        let suits = match role {
            Role::Path => run.kind != Kind::Irradiance,
            Role::Sun => run.kind != Kind::Radiance,
            Role::Sky => run.kind == Kind::Radiance,
        };
        if !suits {
            return Err(Fault::at(run.line, format!("a run of {}", run.kind.words())).code("S05").help(wants));
        }
    }
    match role {
        Role::Sun if runs.len() > 1 => {
            Err(Fault::at(runs[1].line, "a second run of the path to the sun").code("S05").help(wants))
        }
        Role::Sun => Ok(sun(first)),
        Role::Path => path(&runs),
        Role::Sky => sky(&runs),
    }
}

impl Kind {
    fn words(self) -> &'static str {
        match self {
            Self::Transmittance => "transmittance (IEMSCT 0)",
            Self::Radiance => "radiance (IEMSCT 1 or 2)",
            Self::Irradiance => "solar irradiance (IEMSCT 3)",
        }
    }
}

fn value(quantity: usize, row: &Row, value: f64) -> Value {
    Value { quantity, keys: [None; KEYS.len()], wavelength: row.wavelength, value, line: row.line }
}

fn sun(run: &Run) -> Import {
    // The cards of IEMSCT 3 and 0 say the line of sight, which is the sun's.
    let zenith = run.cards.and_then(Cards::zenith_at_target);
    let mut import = Import { sun: zenith, ..Import::default() };
    for row in &run.rows {
        let mut push = |quantity: usize, v: f64| {
            let mut value = value(quantity, row, v);
            value.keys[SUN_ZENITH] = zenith;
            import.values.push(value);
        };
        push(SUN, row.trans);
        if let Some(solar) = row.toa_sun {
            push(SOLAR, solar);
        }
    }
    let at = degrees(zenith.into_iter()).map_or_else(String::new, |at| format!(" at zenith {at}"));
    import.notes.push(match run.kind {
        Kind::Irradiance => format!("E_s (3 digits as printed) and τ₁ to the sun{at}"),
        _ => format!("τ₁ to the sun{at}"),
    });
    import
}

fn path(runs: &[Run]) -> Result<Import, Fault> {
    let mut import = Import::default();
    let several = runs.len() > 1;
    for run in runs {
        if run.kind == Kind::Radiance && run.cards.is_some_and(|cards| cards.looks_up()) {
            let message = "this run looks up (card 3): what it sees is the sky, no path to a target";
            return Err(Fault::at(run.line, message).code("S05").help("give runs that look up as `tape7_sky`"));
        }
        let view = run.cards.and_then(Cards::zenith_at_target);
        if several && view.is_none() {
            let message = "several runs, but the cards above this one say no zenith angle of the sensor";
            return Err(Fault::at(run.line, message).help("give one run, or H1 above H2 and ANGLE above 90 (card 3)"));
        }
        let sun =
            run.cards.and_then(|cards| cards.sun).map(|(_, zenith)| zenith).filter(|_| run.kind == Kind::Radiance);
        for row in &run.rows {
            let mut push = |quantity: usize, v: f64| {
                let mut value = value(quantity, row, v);
                value.keys[VIEW_ZENITH] = view;
                value.keys[SUN_ZENITH] = sun;
                import.values.push(value);
            };
            push(PATH_TRANSMITTANCE, row.trans);
            if let Some(scattered) = row.sol_scat {
                push(PATH_RADIANCE, scattered);
            }
        }
    }
    let views = degrees(runs.iter().filter_map(|run| run.cards.and_then(Cards::zenith_at_target)));
    let view = views.map_or_else(|| "the one line of sight of its run".to_string(), |at| format!("view zenith {at}"));
    let run = &runs[0];
    if run.rows.iter().all(|row| row.sol_scat.is_none()) {
        import.notes.push(format!("τ₂ for {view}"));
        return Ok(import);
    }
    let azimuths =
        degrees(runs.iter().filter_map(|run| run.cards.and_then(|cards| cards.sun)).map(|(azimuth, _)| azimuth));
    let azimuth = azimuths.map_or_else(String::new, |at| format!(", azimuth between line of sight and sun {at}"));
    import.notes.push(format!(
        "τ₂ and L_u for {view}{azimuth}; L_u is SOL SCAT: scattered sunlight, that of the run's ground \
         included, without thermal emission"
    ));
    if several {
        return Ok(import);
    }
    import.sun = run.cards.and_then(|cards| cards.sun).map(|(_, zenith)| zenith);
    // GRND = ρ (E_dir + E_d) τ₂/π and DRCT = ρ E_dir τ₂/π over the Lambertian ground of the run.
    let ground: Vec<_> = (run.rows.iter())
        .filter_map(|row| Some((row, row.grnd_rflt?, row.drct_rflt?)))
        .filter(|(_, _, direct)| *direct > 0.0)
        .collect();
    if ground.iter().any(|(_, all, direct)| all > direct) {
        import.diffuse_over_direct =
            ground.iter().map(|(row, all, direct)| (row.wavelength, (all / direct - 1.0).max(0.0))).collect();
    }
    // REF SOL = E_s τ₁ τ₂.
    if run.rows.iter().all(|row| row.toa_sun.is_some() && row.ref_sol.is_some()) {
        for row in &run.rows {
            let (solar, reflected) = (row.toa_sun.unwrap_or(0.0), row.ref_sol.unwrap_or(0.0));
            let through = solar * row.trans;
            // Three digits are printed: their rounding may pass 1 by 1 %.
            let ratio = if through > 0.0 { reflected / through } else { 0.0 };
            let ratio = if ratio < 1.01 { ratio.min(1.0) } else { ratio };
            import.spare.extend([value(SOLAR, row, solar), value(SUN, row, ratio)]);
        }
        import.spare_note = "E_s = TOA_SUN and τ₁ = REF_SOL/(TOA_SUN τ₂), where no other file gives them".to_string();
    }
    Ok(import)
}

fn sky(runs: &[Run]) -> Result<Import, Fault> {
    let mut import = Import::default();
    for run in runs {
        let Some(cards) = run.cards.filter(|cards| cards.looks_up()) else {
            let message = "the cards above this run say no line of sight from the ground into the sky";
            return Err(Fault::at(run.line, message).help("card 3 says H1, H2 and an ANGLE of 0 to 90"));
        };
        let Some((azimuth, zenith)) = cards.sun else {
            let message = "the cards above this run do not say where the sun is";
            return Err(Fault::at(run.line, message).help("IPARM 2 or 12 (card 3A1), with PARM1 and PARM2 (card 3A2)"));
        };
        for row in &run.rows {
            let Some(radiance) = row.sol_scat else {
                return Err(Fault::at(row.line, "no scattered sunlight in this run").help("IEMSCT 2 is wanted"));
            };
            let mut value = value(SKY, row, radiance);
            value.keys[SUN_ZENITH] = Some(zenith);
            value.keys[SKY_ZENITH] = Some(cards.angle);
            value.keys[SKY_AZIMUTH] = Some(azimuth);
            import.values.push(value);
        }
    }
    let n = runs.len();
    import.notes.push(format!("L_d = SOL SCAT in {n} directions, azimuths from the sun's, both sides alike"));
    Ok(import)
}

impl Cards {
    fn looks_up(self) -> bool {
        self.angle < std::f64::consts::FRAC_PI_2
    }

    /// Zenith angle of the other end of the path as its lower end sees it \[rad\]: ANGLE of a path that goes up, and of
    /// one that goes down by the triangle with the Earth's centre (6371 km), unrefracted.
    fn zenith_at_target(self) -> Option<f64> {
        const EARTH: f64 = 6371.0;
        if self.looks_up() {
            return Some(self.angle);
        }
        let sin = self.angle.sin() * (EARTH + self.h1) / (EARTH + self.h2);
        (self.h1 > self.h2 && sin <= 1.0).then(|| sin.asin())
    }

    /// Card 3 stands five lines above the header, then cards 3A1, 3A2, 4 and 5.
    fn read(above: &[(usize, &str)]) -> Option<Self> {
        let [.., card3, card3a1, card3a2, _, _] = above else { return None };
        // Fixed columns of ten, as both codes print them (6F10.3): neighbours may touch.
        let field = |text: &str, i: usize| number(text.get(10 * i..10 * (i + 1))?.trim());
        let in_range = |value: f64, most: f64| (0.0..=most).contains(&value).then_some(value);
        let h1 = field(card3.1, 0).filter(|h| h.abs() < 1e6)?;
        let h2 = field(card3.1, 1).filter(|h| h.abs() < 1e6)?;
        let angle = in_range(field(card3.1, 2)?, 180.0)?.to_radians();
        let iparm = card3a1.1.get(..5).and_then(|text| number(text.trim()));
        let sun = || {
            iparm.filter(|iparm| *iparm == 2.0 || *iparm == 12.0)?;
            let azimuth = field(card3a2.1, 0).filter(|azimuth| azimuth.abs() <= 360.0)?;
            let zenith = in_range(field(card3a2.1, 1)?, 180.0)?;
            let azimuth = azimuth.rem_euclid(360.0);
            Some((azimuth.min(360.0 - azimuth).to_radians(), zenith.to_radians()))
        };
        Some(Self { h1, h2, angle, sun: sun() })
    }
}

/// Labels of two words, made one.
const TWO_WORDS: [&str; 19] = [
    "TOT TRANS",
    "PTH THRML",
    "THRML SCT",
    "SURF EMIS",
    "SOL SCAT",
    "SING SCAT",
    "SNGL SCAT",
    "MULT SCAT",
    "GRND RFLT",
    "DRCT RFLT",
    "TOTAL RAD",
    "REF SOL",
    "SOL TR",
    "WAVLEN MCRN",
    "WAVLEN NM",
    "WAVLEN (uM)",
    "WAVLEN (UM)",
    "WAVLEN (NM)",
    "FREQ (CM-1)",
];

/// The header of a run.
struct Header {
    kind: Kind,
    abscissa: Abscissa,
    /// Labels and the columns where they end.
    labels: Vec<(String, usize)>,
    lowtran: bool,
}

impl Header {
    fn read(line: usize, text: &str) -> Result<Self, Fault> {
        let mut joined = text.to_string();
        for label in TWO_WORDS {
            joined = joined.replace(label, &label.replace(' ', "_"));
        }
        let labels: Vec<(String, usize)> =
            joined.split_whitespace().map(|label| (label.to_string(), end_of(&joined, label))).collect();
        let has = |name: &str| labels.iter().any(|(label, _)| label == name);
        let first = labels.first().map_or("", |(label, _)| label.as_str());
        let abscissa = if first.starts_with("FREQ") {
            Abscissa::Wavenumber
        } else if first.contains("NM") {
            Abscissa::Nanometre
        } else {
            Abscissa::Micrometre
        };
        if has("LOS") {
            return Err(Fault::at(line, "several lines of sight in one table").help("one line of sight a run is read"));
        }
        let lowtran = has("ATMOS");
        let kind = if has("SOL_TR") && has("SOLAR") {
            Kind::Irradiance
        } else if has("TOTAL_RAD") {
            Kind::Radiance
        } else if has("COMBIN") || (has("TOTAL") && has("H2O")) {
            Kind::Transmittance
        } else {
            return Err(Fault::at(line, format!("an unknown header: {}", shown(text.trim()))));
        };
        Ok(Self { kind, abscissa, labels, lowtran })
    }

    /// The labels of the words of a row. MODTRAN leaves columns blank, and right-aligns labels and numbers.
    fn assign(&self, line: usize, text: &str) -> Result<Vec<String>, Fault> {
        let words = text.split_whitespace().count();
        let fixed = |labels: &[&str]| Ok(labels.iter().map(|label| (*label).to_string()).collect());
        match (self.kind, self.lowtran, words) {
            (Kind::Irradiance, _, 4 | 5) => fixed(&["X", "TRANS", "SOL_TR", "SOLAR", "DEPTH"][..words]),
            (Kind::Transmittance, _, 3..) => {
                let mut labels = vec!["X".to_string(), "TRANS".to_string()];
                labels.resize(words, String::new());
                Ok(labels)
            }
            (Kind::Radiance, true, 11) => fixed(&[
                "X",
                "TRANS",
                "ATMOS",
                "SOL_SCAT",
                "SING_SCAT",
                "GRND_RFLT",
                "DRCT_RFLT",
                "TOTAL_RAD",
                "TEB1",
                "TEB2",
                "DEPTH",
            ]),
            (Kind::Radiance, true, 4) => fixed(&["X", "TRANS", "ATMOS", "DEPTH"]),
            (Kind::Radiance, false, 3..) if words == self.labels.len() => {
                Ok(self.labels.iter().map(|(label, _)| label.clone()).collect())
            }
            (Kind::Radiance, false, 3..) if words < self.labels.len() => {
                let mut labels = Vec::with_capacity(words);
                let mut next = 0;
                for word in text.split_whitespace() {
                    let end = end_of(text, word);
                    let ahead = self.labels.iter().enumerate().skip(next);
                    let nearest =
                        ahead.min_by_key(|(_, (_, of))| of.abs_diff(end)).filter(|(_, (_, of))| of.abs_diff(end) <= 3);
                    let Some((at, (label, _))) = nearest else {
                        return Err(Fault::at(line, format!("`{}` stands under no label", shown(word))));
                    };
                    labels.push(label.clone());
                    next = at + 1;
                }
                Ok(labels)
            }
            _ => Err(Fault::at(line, format!("{words} numbers do not fit the header"))),
        }
    }
}

/// Column where a word that is part of `text` ends.
fn end_of(text: &str, word: &str) -> usize {
    word.as_ptr() as usize - text.as_ptr() as usize + word.len()
}

fn runs(lines: &[(usize, &str)]) -> Result<Vec<Run>, Fault> {
    let mut runs = Vec::new();
    let mut from = 0;
    while let Some(at) = lines[from..].iter().position(|(_, text)| is_header(text)).map(|at| from + at) {
        let (line, text) = lines[at];
        let header = Header::read(line, text)?;
        let cards = Cards::read(&lines[from..at]);
        let mut rows = Vec::new();
        let mut labels: Option<Vec<String>> = None;
        let mut ended = false;
        from = at + 1;
        for (line, text) in &lines[at + 1..] {
            from += 1;
            let words = text.trim();
            if words.is_empty() || (rows.is_empty() && words.starts_with("CM-1")) {
                continue; // the second line of the header
            }
            if words.starts_with("-9999") {
                ended = true;
                break;
            }
            let numbers = numbers(*line, text)?;
            let labels = match &labels {
                Some(labels) if labels.len() == numbers.len() => labels,
                Some(labels) => {
                    let message = format!("{} numbers below rows of {}", numbers.len(), labels.len());
                    return Err(Fault::at(*line, message));
                }
                None => labels.insert(header.assign(*line, text)?),
            };
            rows.push(header.row(*line, labels, &numbers)?);
        }
        if !ended {
            return Err(Fault::at(line, "the run that begins here has no end").help("a run ends with a line -9999."));
        }
        if rows.is_empty() {
            return Err(Fault::at(line, "the run that begins here has no rows"));
        }
        // Wavenumbers ascend in both codes, so wavelengths come last first.
        if rows[0].wavelength > rows[rows.len() - 1].wavelength {
            rows.reverse();
        }
        runs.push(Run { line, kind: header.kind, cards, rows });
    }
    Ok(runs)
}

fn is_header(text: &str) -> bool {
    let text = text.trim_start();
    text.starts_with("FREQ") || text.starts_with("WAVLEN")
}

impl Header {
    fn row(&self, line: usize, labels: &[String], numbers: &[f64]) -> Result<Row, Fault> {
        let x = numbers[0];
        if x <= 0.0 {
            return Err(Fault::at(line, format!("{x} is no wavenumber or wavelength of light")).code("U05"));
        }
        let (wavelength, factor) = self.abscissa.canonical(x);
        let find = |names: &[&str]| {
            let at = labels.iter().position(|label| names.contains(&label.as_str()))?;
            numbers.get(at).copied()
        };
        let spectral = |name: &str| find(&[name]).map(|value| value * factor);
        let trans = find(&["TRANS", "TOT_TRANS", "TRAN"]).ok_or_else(|| Fault::at(line, "no transmittance"))?;
        let scattered = match (spectral("MULT_SCAT"), spectral("SING_SCAT")) {
            (Some(multiple), Some(single)) => Some(multiple + single), // MODTRAN 6 parts them
            _ => spectral("SOL_SCAT"),
        };
        Ok(Row {
            line,
            wavelength,
            trans,
            sol_scat: scattered,
            grnd_rflt: spectral("GRND_RFLT"),
            drct_rflt: spectral("DRCT_RFLT"),
            ref_sol: spectral("REF_SOL"),
            toa_sun: spectral("SOLAR").or_else(|| spectral("TOA_SUN")),
        })
    }
}
