//! Grids of numbers: heights or class codes, from CSV, ESRI ASCII and GeoTIFF files. The first row is the northernmost,
//! values run from west to east; a value stands for the post in the middle of its cell.

mod geotiff;
mod text;

use glam::DVec2;

/// The most posts of a grid: 2²⁵, for example 5792 × 5792.
pub const MOST_POSTS: u64 = 1 << 25;
/// What a post of a terrain takes in memory, two facets with their share of the tree \[bytes\].
const BYTES_PER_POST: u64 = 260;
/// The most faults that are told of one file.
pub(crate) const MOST_FAULTS: usize = 10;

/// What the numbers of a grid are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RasterKind {
    /// Heights above z = 0 \[m\].
    Heights,
    /// Whole numbers that name classes.
    Classes,
}

impl RasterKind {
    /// Lowest and highest value: deepest and highest point of the Earth with room to spare, or what 32 bits number.
    fn range(self) -> (f64, f64) {
        match self {
            Self::Heights => (-12_000.0, 20_000.0),
            Self::Classes => (0.0, u32::MAX as f64),
        }
    }

    /// Why a number is none of this kind.
    pub(crate) fn refuse(self, value: f64) -> Option<String> {
        let (low, high) = self.range();
        match self {
            Self::Classes if value.fract() != 0.0 => Some(format!("`{value}` is no whole number, as classes are")),
            Self::Classes if !(low..=high).contains(&value) => Some(format!("class {value} is beyond 0..{high}")),
            Self::Heights if !(low..=high).contains(&value) => {
                Some(format!("a height of {value} m is beyond {low}..{high} m: does it stand for no data?"))
            }
            _ => None,
        }
    }
}

/// A grid of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Posts from west to east.
    pub columns: usize,
    /// Posts from north to south.
    pub rows: usize,
    /// Row by row, the northernmost first; NaN where there is no data.
    pub values: Vec<f64>,
    /// Where the file says that the posts stand.
    pub place: Option<RasterPlace>,
}

/// Where the posts of a grid stand \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RasterPlace {
    /// The first post of the last row.
    pub south_west: DVec2,
    /// Between neighbours, along x and y.
    pub spacing: DVec2,
}

/// One thing wrong with the file of a grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RasterFault {
    /// Whether columns are missing, rather than the format broken.
    pub columns: bool,
    /// Line, from 1; none in a binary file.
    pub line: Option<u64>,
    /// Character in the line, from 1.
    pub column: Option<u64>,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: Option<String>,
}

impl RasterFault {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), ..Self::default() }
    }
    pub(crate) fn at(self, line: usize, column: usize) -> Self {
        Self { line: Some(line as u64), column: Some(column as u64), ..self }
    }
    pub(crate) fn help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }
}

/// Why a file gives no grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RasterError {
    /// Not the format that it seems to be.
    #[error("{}", .0.first().map_or("the grid is malformed", |fault| fault.message.as_str()))]
    Malformed(Vec<RasterFault>),
    /// More posts than [`MOST_POSTS`]; nothing was allocated for them.
    #[error("{columns} x {rows} posts need about {} GB; at most {MOST_POSTS} posts are read", bytes.div_ceil(1_000_000_000))]
    TooLarge {
        /// Posts from west to east.
        columns: u64,
        /// Posts from north to south.
        rows: u64,
        /// What their terrain would take.
        bytes: u64,
    },
}

impl From<RasterFault> for RasterError {
    fn from(fault: RasterFault) -> Self {
        Self::Malformed(vec![fault])
    }
}

/// Reads a grid, whose content tells the format: TIFF by its first bytes, ESRI ASCII by its first word, else CSV.
///
/// * CSV: rows of numbers parted by commas or blanks, or columns `x_m`, `y_m` and `z_m` (`class`) on a regular grid in any
///   order. `#` begins a comment line. An empty cell or `nan` is no data.
/// * ESRI ASCII: `ncols`, `nrows`, `xllcorner` or `xllcenter`, `yllcorner` or `yllcenter`, `cellsize` (or `dx`, `dy`),
///   `nodata_value` in any order and case, then the rows.
/// * GeoTIFF: one band of integers or floats, stripped or tiled, plain, LZW, deflate or PackBits; ModelPixelScale with a
///   ModelTiepoint or a ModelTransformation without turn; PixelIsArea and PixelIsPoint; GDAL_NODATA. Projected and
///   vertical units of metres or feet become metres; degrees do not, and such a grid has no place.
///
/// # Errors
/// See [`RasterError`].
pub fn read_raster(bytes: &[u8], kind: RasterKind) -> Result<Raster, RasterError> {
    let tiff = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| bytes.starts_with(*magic));
    let raster = if tiff { geotiff::read(bytes, kind)? } else { text::read(bytes, kind)? };
    if raster.values.iter().all(|value| value.is_nan()) {
        return Err(RasterFault::new("the grid holds no data").into());
    }
    Ok(raster)
}

/// Refuses what memory cannot hold, before anything is allocated.
fn fits(columns: u64, rows: u64) -> Result<(), RasterError> {
    let posts = columns.saturating_mul(rows);
    if posts > MOST_POSTS {
        return Err(RasterError::TooLarge { columns, rows, bytes: posts.saturating_mul(BYTES_PER_POST) });
    }
    Ok(())
}
