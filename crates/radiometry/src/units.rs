//! Units of the scene language and of table headers, and the canonical unit of each dimension.

use std::f64::consts::PI;

/// What a number measures. The canonical unit behind the parser stands with each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// A plain number, or a fraction (`%`).
    Fraction,
    /// m
    Length,
    /// µm
    Wavelength,
    /// rad
    Angle,
    /// sr
    SolidAngle,
    /// s
    Time,
    /// m/s
    Speed,
    /// Hz
    Rate,
    /// 1/m
    Extinction,
    /// hPa
    Pressure,
    /// K
    Temperature,
    /// atm-cm (1000 DU)
    GasColumn,
    /// g/cm²
    WaterColumn,
    /// W m⁻² sr⁻¹ µm⁻¹
    Radiance,
    /// W m⁻² µm⁻¹
    Irradiance,
    /// electrons
    Electrons,
    /// electrons per second
    DarkCurrent,
    /// electrons per digital number
    Gain,
    /// digital numbers
    Counts,
    /// pixels
    Pixels,
}

impl Dimension {
    /// The dimension in words, with its article: "an angle".
    pub const fn noun(self) -> &'static str {
        match self {
            Self::Fraction => "a plain number",
            Self::Length => "a length",
            Self::Wavelength => "a wavelength",
            Self::Angle => "an angle",
            Self::SolidAngle => "a solid angle",
            Self::Time => "a time",
            Self::Speed => "a speed",
            Self::Rate => "a rate",
            Self::Extinction => "an extinction",
            Self::Pressure => "a pressure",
            Self::Temperature => "a temperature",
            Self::GasColumn => "a gas column",
            Self::WaterColumn => "a column of water",
            Self::Radiance => "a radiance",
            Self::Irradiance => "an irradiance",
            Self::Electrons => "a number of electrons",
            Self::DarkCurrent => "a dark current",
            Self::Gain => "a gain",
            Self::Counts => "a digital number",
            Self::Pixels => "a number of pixels",
        }
    }
    /// Name of the canonical unit, as printed and as JSON keys end.
    pub const fn canonical(self) -> &'static str {
        match self {
            Self::Fraction => "",
            Self::Length => "m",
            Self::Wavelength => "um",
            Self::Angle => "rad",
            Self::SolidAngle => "sr",
            Self::Time => "s",
            Self::Speed => "m/s",
            Self::Rate => "Hz",
            Self::Extinction => "/m",
            Self::Pressure => "hPa",
            Self::Temperature => "K",
            Self::GasColumn => "atm-cm",
            Self::WaterColumn => "g/cm2",
            Self::Radiance => "W/m2/sr/um",
            Self::Irradiance => "W/m2/um",
            Self::Electrons => "e-",
            Self::DarkCurrent => "e-/s",
            Self::Gain => "e-/DN",
            Self::Counts => "DN",
            Self::Pixels => "px",
        }
    }
}

/// A unit of one dimension: canonical value = `factor` × value + `offset`. `nm` and `um` are units of length and of
/// wavelength; they stand once for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Spelling in a scene.
    pub name: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    /// Multiplier to the canonical unit.
    pub factor: f64,
    /// Added after multiplying (temperatures).
    pub offset: f64,
}

const fn u(name: &'static str, dimension: Dimension, factor: f64) -> Unit {
    Unit { name, dimension, factor, offset: 0.0 }
}

/// Every unit, the usual one of each dimension first.
pub const UNITS: &[Unit] = &[
    u("%", Dimension::Fraction, 0.01),
    u("m", Dimension::Length, 1.0),
    u("km", Dimension::Length, 1e3),
    u("cm", Dimension::Length, 1e-2),
    u("mm", Dimension::Length, 1e-3),
    u("um", Dimension::Length, 1e-6),
    u("nm", Dimension::Length, 1e-9),
    u("ft", Dimension::Length, 0.3048),
    u("nm", Dimension::Wavelength, 1e-3),
    u("um", Dimension::Wavelength, 1.0),
    u("deg", Dimension::Angle, PI / 180.0),
    u("rad", Dimension::Angle, 1.0),
    u("mrad", Dimension::Angle, 1e-3),
    u("urad", Dimension::Angle, 1e-6),
    u("arcmin", Dimension::Angle, PI / 10_800.0),
    u("arcsec", Dimension::Angle, PI / 648_000.0),
    u("sr", Dimension::SolidAngle, 1.0),
    u("msr", Dimension::SolidAngle, 1e-3),
    u("usr", Dimension::SolidAngle, 1e-6),
    u("s", Dimension::Time, 1.0),
    u("us", Dimension::Time, 1e-6),
    u("ms", Dimension::Time, 1e-3),
    u("min", Dimension::Time, 60.0),
    u("h", Dimension::Time, 3600.0),
    u("day", Dimension::Time, 86_400.0),
    u("m/s", Dimension::Speed, 1.0),
    u("km/h", Dimension::Speed, 1.0 / 3.6),
    u("Hz", Dimension::Rate, 1.0),
    u("kHz", Dimension::Rate, 1e3),
    u("/m", Dimension::Extinction, 1.0),
    u("/km", Dimension::Extinction, 1e-3),
    u("hPa", Dimension::Pressure, 1.0),
    u("Pa", Dimension::Pressure, 1e-2),
    u("kPa", Dimension::Pressure, 10.0),
    u("mbar", Dimension::Pressure, 1.0),
    u("K", Dimension::Temperature, 1.0),
    Unit { name: "degC", dimension: Dimension::Temperature, factor: 1.0, offset: 273.15 },
    u("DU", Dimension::GasColumn, 1e-3),
    u("atm-cm", Dimension::GasColumn, 1.0),
    u("g/cm2", Dimension::WaterColumn, 1.0),
    u("kg/m2", Dimension::WaterColumn, 0.1),
    u("W/m2/sr/um", Dimension::Radiance, 1.0),
    u("W/m2/sr/nm", Dimension::Radiance, 1e3),
    u("mW/cm2/sr/um", Dimension::Radiance, 10.0),
    u("uW/cm2/sr/nm", Dimension::Radiance, 10.0),
    u("W/m2/um", Dimension::Irradiance, 1.0),
    u("W/m2/nm", Dimension::Irradiance, 1e3),
    u("uW/cm2/nm", Dimension::Irradiance, 10.0),
    u("e-", Dimension::Electrons, 1.0),
    u("e-/s", Dimension::DarkCurrent, 1.0),
    u("e-/DN", Dimension::Gain, 1.0),
    u("DN", Dimension::Counts, 1.0),
    u("px", Dimension::Pixels, 1.0),
];

/// The unit of that name in that dimension.
pub fn unit(name: &str, dimension: Dimension) -> Option<&'static Unit> {
    UNITS.iter().find(|unit| unit.name == name && unit.dimension == dimension)
}

/// The units of a dimension, the usual one first.
pub fn units_of(dimension: Dimension) -> impl Iterator<Item = &'static Unit> {
    UNITS.iter().filter(move |unit| unit.dimension == dimension)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_reach_their_canonical_value() {
        let convert = |value: f64, name, dimension| {
            let unit = unit(name, dimension).unwrap();
            value * unit.factor + unit.offset
        };
        assert!((convert(20.0, "degC", Dimension::Temperature) - 293.15).abs() < 1e-12);
        assert!((convert(320.0, "DU", Dimension::GasColumn) - 0.32).abs() < 1e-12);
        // 1 uW cm⁻² sr⁻¹ nm⁻¹ = 1e-6 W / (1e-4 m² · 1e-3 um) = 10 W m⁻² sr⁻¹ um⁻¹
        assert!((convert(1.0, "uW/cm2/sr/nm", Dimension::Radiance) - 10.0).abs() < 1e-12);
        assert!((convert(550.0, "nm", Dimension::Wavelength) - 0.55).abs() < 1e-15);
    }
}
