//! What the readers of other codes' output hand to the table.

use sunglint_plugin::{BindError, FileArg};

/// Why a file is not read, and where.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    /// Diagnostic code of `docs/LANGUAGE.md`.
    pub(super) code: &'static str,
    /// Line of the file, from 1; `None` where no line is at fault.
    pub(super) line: Option<usize>,
    pub(super) message: String,
    pub(super) help: Option<&'static str>,
}

impl Fault {
    /// Not the format, at a line.
    pub(super) fn at(line: usize, message: impl Into<String>) -> Self {
        Self { code: "F01", line: Some(line), message: message.into(), help: None }
    }

    /// Of the file as a whole.
    pub(super) fn whole(message: impl Into<String>) -> Self {
        Self { code: "F01", line: None, message: message.into(), help: None }
    }

    pub(super) fn code(mut self, code: &'static str) -> Self {
        self.code = code;
        self
    }

    pub(super) fn help(mut self, help: &'static str) -> Self {
        self.help = Some(help);
        self
    }

    /// As the scene's author is told it.
    pub(super) fn of(self, param: &'static str, file: &str) -> BindError {
        let place = self.line.map_or_else(|| file.to_string(), |line| format!("{file}, line {line}"));
        let error = BindError::new(self.code, param, format!("{place}: {}", self.message));
        match self.help {
            Some(help) => error.help(help),
            None => error,
        }
    }
}

/// One value, in canonical units.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Value {
    /// Index into [`super::QUANTITIES`].
    pub(super) quantity: usize,
    /// Values of [`super::KEYS`] that the file says.
    pub(super) keys: [Option<f64>; super::KEYS.len()],
    /// \[µm\]
    pub(super) wavelength: f64,
    pub(super) value: f64,
    pub(super) line: usize,
}

/// A ratio or a beam against wavelength \[µm\], ascending.
pub(super) type Rows = Vec<(f64, f64)>;

/// The content of a file of another code.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Import {
    pub(super) values: Vec<Value>,
    /// Values that count only where no other file gives their quantity, and how they were derived.
    pub(super) spare: Vec<Value>,
    pub(super) spare_note: String,
    /// Irradiances and radiances are in units of E_s.
    pub(super) of_sun: bool,
    /// E_s τ₁ \[W m⁻² µm⁻¹\], where the file does not part them.
    pub(super) beam: Rows,
    /// E_d over the direct irradiance on the level.
    pub(super) diffuse_over_direct: Rows,
    /// Zenith angle of the sun that `diffuse_over_direct` is for \[rad\], where the file says it.
    pub(super) sun: Option<f64>,
    /// What the values are for, and how they were derived.
    pub(super) notes: Vec<String>,
}

/// The lines of a text file with their numbers, from 1.
pub(super) fn lines(file: &FileArg) -> Result<Vec<(usize, &str)>, Fault> {
    let bytes = file.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&file.bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count();
        Fault::at(before + 1, "not UTF-8 text")
    })?;
    Ok(text.lines().enumerate().map(|(i, line)| (i + 1, line)).collect())
}

/// A Fortran or C number; Fortran leaves the E out before exponents of three digits (`1.79-121`), or writes D.
pub(super) fn number(text: &str) -> Option<f64> {
    let plain = |text: &str| text.parse::<f64>().ok().filter(|value| value.is_finite());
    if !text.bytes().all(|byte| byte.is_ascii_digit() || b"+-.eEdD".contains(&byte)) {
        return None;
    }
    plain(text).or_else(|| plain(&text.replace(['d', 'D'], "e"))).or_else(|| {
        let sign = text.rfind(['+', '-']).filter(|at| *at > 0)?;
        let (mantissa, exponent) = text.split_at(sign);
        plain(&format!("{mantissa}e{exponent}"))
    })
}

/// The numbers of a line, parted by white space.
pub(super) fn numbers(line: usize, text: &str) -> Result<Vec<f64>, Fault> {
    let of = |word: &str| number(word).ok_or_else(|| Fault::at(line, format!("`{}` is no number", shown(word))));
    text.split_whitespace().map(of).collect()
}

/// A piece of a file that is short enough to be shown.
pub(super) fn shown(text: &str) -> String {
    let mut short: String = text.chars().take(24).collect();
    if text.chars().nth(24).is_some() {
        short.push('…');
    }
    short
}

/// Angles of a file in words: `35.65 deg`, or `20 to 60 deg`.
pub(super) fn degrees(angles: impl Iterator<Item = f64>) -> Option<String> {
    let round = |angle: f64| (angle.to_degrees() * 1e4).round() / 1e4;
    let (least, most) =
        angles.map(round).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), angle| (a.min(angle), b.max(angle)));
    match least <= most {
        true if least == most => Some(format!("{least} deg")),
        true => Some(format!("{least} to {most} deg")),
        false => None,
    }
}
