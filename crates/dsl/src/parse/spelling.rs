//! ASCII spellings of what editors and papers write otherwise, and usual spellings of units.

use sunglint_radiometry::UNITS;

/// Words that join the parts of a statement; no name and no unit.
pub(crate) const CONNECTIVES: &[&str] =
    &["at", "to", "from", "every", "within", "as", "like", "for", "else", "only", "sweep", "on", "off", "none"];

/// The connectives after which a clause begins, so that an unknown word before one can only be a unit.
pub(super) const PREPOSITIONS: &[&str] = &["at", "to", "from", "every", "within", "as", "like", "for", "else", "only"];

/// Whether `word` is a unit of the language.
pub(crate) fn is_unit(word: &str) -> bool {
    UNITS.iter().any(|unit| unit.name == word)
}

/// The unit that is meant by a usual spelling that the language does not have: `degrees`, `metres`, `KM`.
pub(crate) fn meant_unit(word: &str) -> Option<&'static str> {
    const USUAL: &[(&str, &[&str])] = &[
        ("deg", &["degree", "degrees", "degs"]),
        ("rad", &["radian", "radians", "rads"]),
        ("m", &["metre", "metres", "meter", "meters"]),
        ("km", &["kilometre", "kilometres", "kilometer", "kilometers", "kms"]),
        ("cm", &["centimetre", "centimetres", "centimeter", "centimeters"]),
        ("mm", &["millimetre", "millimetres", "millimeter", "millimeters"]),
        ("um", &["micron", "microns", "micrometre", "micrometres", "micrometer", "micrometers", "mum"]),
        ("nm", &["nanometre", "nanometres", "nanometer", "nanometers"]),
        ("ft", &["foot", "feet"]),
        ("s", &["sec", "secs", "second", "seconds"]),
        ("ms", &["msec", "millisecond", "milliseconds"]),
        ("us", &["usec", "microsecond", "microseconds"]),
        ("min", &["mins", "minute", "minutes"]),
        ("h", &["hr", "hrs", "hour", "hours"]),
        ("day", &["days"]),
        ("%", &["percent", "pct"]),
        ("K", &["kelvin", "kelvins"]),
        ("degC", &["celsius", "centigrade"]),
        ("DU", &["dobson"]),
        ("mbar", &["mb", "millibar", "millibars"]),
        ("Hz", &["hertz"]),
        ("sr", &["steradian", "steradians"]),
        ("e-", &["electron", "electrons"]),
    ];
    let lower = word.to_ascii_lowercase();
    let usual = USUAL.iter().find(|(_, spellings)| spellings.contains(&lower.as_str())).map(|(unit, _)| *unit);
    usual.or_else(|| UNITS.iter().map(|unit| unit.name).find(|name| name.eq_ignore_ascii_case(word)))
}

/// The ASCII spelling of a character, if it has one.
pub(super) fn ascii(character: char) -> Option<&'static str> {
    Some(match character {
        'µ' | 'μ' => "u",
        '°' | 'º' | '˚' => "deg",
        '′' => "arcmin",
        '″' => "arcsec",
        '–' | '—' | '−' | '‐' | '‑' | '‒' | '―' | '﹣' | '－' => "-",
        '“' | '”' | '„' | '‟' | '«' | '»' | '＂' => "\"",
        '‘' | '’' | '‚' | '‹' | '›' => "'",
        '…' | '‥' => "..",
        '×' | '✕' | '✖' => "x",
        '÷' | '∕' | '⁄' => "/",
        '·' | '•' | '∙' | '⋅' => " ",
        '，' | '、' => ",",
        '；' => ";",
        '：' => ":",
        '（' => "(",
        '）' => ")",
        '＝' => "=",
        '→' | '⇒' => "->",
        '％' => "%",
        '⁻' => "-",
        '⁰' | '₀' => "0",
        '¹' | '₁' => "1",
        '²' | '₂' => "2",
        '³' | '₃' => "3",
        'Å' => "A",
        'ä' => "ae",
        'ö' => "oe",
        'ü' => "ue",
        'Ä' => "Ae",
        'Ö' => "Oe",
        'Ü' => "Ue",
        'ß' => "ss",
        'à' | 'á' | 'â' | 'ã' | 'å' => "a",
        'ç' => "c",
        'è' | 'é' | 'ê' | 'ë' => "e",
        'ì' | 'í' | 'î' | 'ï' => "i",
        'ñ' => "n",
        'ò' | 'ó' | 'ô' | 'õ' | 'ø' => "o",
        'ù' | 'ú' | 'û' => "u",
        'α' => "alpha",
        'β' => "beta",
        'γ' => "gamma",
        'θ' => "theta",
        'Θ' => "Theta",
        'λ' => "lambda",
        'ρ' => "rho",
        'σ' => "sigma",
        'τ' => "tau",
        'φ' | 'ϕ' => "phi",
        'ω' => "omega",
        'Δ' => "Delta",
        _ if character.is_whitespace() || is_invisible(character) => " ",
        _ => return None,
    })
}

/// How a character is shown in a message: itself, or its code point where nothing would be seen.
pub(super) fn shown(character: char) -> String {
    if character.is_whitespace() || character.is_control() || is_invisible(character) {
        format!("U+{:04X}", u32::from(character))
    } else {
        character.to_string()
    }
}

fn is_invisible(character: char) -> bool {
    matches!(character, '\u{200B}'..='\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2060}' | '\u{FEFF}' | '\u{AD}')
}
