//! Colours of series and of maps.

/// Red, green, blue.
pub(super) type Colour = [u8; 3];

pub(super) const BLACK: Colour = [0, 0, 0];
pub(super) const WHITE: Colour = [255; 3];
pub(super) const GREY: Colour = [0x80; 3];
pub(super) const GRID: Colour = [0xe2; 3];
/// Where there is no value.
pub(super) const NOTHING: Colour = [0xd0; 3];

/// The colours of [Okabe2008] but yellow, which white paper swallows.
const SERIES: [u32; 7] = [0x0072b2, 0xd55e00, 0x009e73, 0xcc79a7, 0xe69f00, 0x56b4e9, 0x000000];

/// Every 15th of the 256 colours of viridis [Smith2015] (CC0).
const VIRIDIS: [u32; 18] = [
    0x440154, 0x481769, 0x472a7a, 0x433d84, 0x3d4e8a, 0x355e8d, 0x2e6d8e, 0x297b8e, 0x23898e, 0x1f978b, 0x21a585,
    0x2eb37c, 0x46c06f, 0x65cb5e, 0x89d548, 0xb0dd2f, 0xd8e219, 0xfde725,
];
/// From the blue to the vermilion of [Okabe2008] over white.
const DIFFERENCE: [u32; 7] = [0x00304d, 0x0072b2, 0x8cc4e0, 0xf7f7f7, 0xf0b48a, 0xd55e00, 0x5c2600];

const fn rgb(code: u32) -> Colour {
    [(code >> 16) as u8, (code >> 8) as u8, code as u8]
}

/// The colour of series number `i`; they recur after 7, with other dashes and marks.
pub(super) fn of_series(i: usize) -> Colour {
    rgb(SERIES[i % SERIES.len()])
}

/// How often the colours have recurred before series number `i`.
pub(super) fn round_of(i: usize) -> usize {
    i / SERIES.len()
}

/// Colours for the values of a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourMap {
    /// Dark blue over green to yellow, even steps of lightness.
    #[default]
    Viridis,
    /// Blue below the middle, white there, vermilion above: for differences, with a range about 0.
    Difference,
    /// Black to white.
    Grey,
}

impl ColourMap {
    /// The colour of a value within 0..1; below and above are drawn as the ends.
    pub(super) fn colour(self, value: f64) -> Colour {
        let table: &[u32] = match self {
            Self::Viridis => &VIRIDIS,
            Self::Difference => &DIFFERENCE,
            Self::Grey => &[0x000000, 0xffffff],
        };
        if value.is_nan() {
            return NOTHING;
        }
        let at = value.clamp(0.0, 1.0) * (table.len() - 1) as f64;
        let i = (at as usize).min(table.len() - 2);
        let (a, b, t) = (rgb(table[i]), rgb(table[i + 1]), at - i as f64);
        std::array::from_fn(|k| (f64::from(a[k]) + t * (f64::from(b[k]) - f64::from(a[k]))).round() as u8)
    }
}
