//! Images against images: what differs, band by band and material by material.

mod figures;

use std::collections::BTreeMap;

use serde_json::{Value, json};

pub use self::figures::{before_after_picture, difference_picture, scatter_picture};
use crate::products::{Image, ImageBand};

/// Bands are the same by wavelength within this or half the wider one's width \[µm\].
const NEAR_UM: f64 = 0.010;
/// Points of a band that a scatter plot keeps.
const MOST_POINTS: usize = 20_000;

/// Why two images do not compare.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompareError {
    /// They differ in size.
    #[error("{what} has {} x {} pixels, A {} x {}", .of_b.0, .of_b.1, .of_a.0, .of_a.1)]
    Size {
        /// Which image is compared with A.
        what: &'static str,
        /// Pixels of A across and down.
        of_a: (u32, u32),
        /// Pixels of the other.
        of_b: (u32, u32),
    },
    /// Their bands do not pair.
    #[error("{0}")]
    Bands(String),
}

/// How the bands of two images were paired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairedBy {
    /// By their names, case aside.
    Name,
    /// By the nearest wavelength.
    Wavelength,
    /// By their order.
    Order,
}

impl PairedBy {
    /// In words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Name => "name",
            Self::Wavelength => "nearest wavelength",
            Self::Order => "order",
        }
    }
}

/// Which bands of A belong to which of B.
#[derive(Clone, Debug, PartialEq)]
pub struct Pairing {
    /// How.
    pub by: PairedBy,
    /// Indices of the bands of A and B.
    pub pairs: Vec<(usize, usize)>,
    /// Names of bands without a partner, of A and of B.
    pub single: (Vec<String>, Vec<String>),
}

/// Material codes by pixel, and their names where the truth map states them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Materials {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Codes, row by row; 0 where a pixel's middle meets nothing.
    pub codes: Vec<u32>,
    /// Names by code.
    pub names: BTreeMap<u32, String>,
}

impl Materials {
    /// The band `material_code` of a truth map, or the only band of an image, with the names of `sunglint:materials`.
    ///
    /// # Errors
    /// An image of several bands without `material_code`.
    pub fn of(image: &Image) -> Result<Self, CompareError> {
        let band = match (image.band("material_code"), image.bands.as_slice()) {
            (Some(band), _) | (None, [band]) => band,
            _ => return Err(CompareError::Bands("a truth map has a band `material_code`, or a single band".into())),
        };
        // What is no number is no material.
        let codes = band.samples.iter().map(|code| code.clamp(0.0, f64::from(u32::MAX)) as u32).collect();
        let names = (image.own_attribute("materials").unwrap_or_default().split("; "))
            .filter_map(|entry| {
                let (code, name) = entry.split_once(' ')?;
                Some((code.parse().ok()?, name.to_string()))
            })
            .collect();
        Ok(Self { width: image.width, height: image.height, codes, names })
    }

    /// Name of a code.
    pub fn name(&self, code: u32) -> String {
        match (self.names.get(&code), code) {
            (Some(name), _) => name.clone(),
            (None, 0) => "nothing".to_string(),
            (None, code) => format!("code {code}"),
        }
    }
}

/// The pixel that differs most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worst {
    /// Column.
    pub x: u32,
    /// Row.
    pub y: u32,
    /// Value of A.
    pub a: f64,
    /// Value of B.
    pub b: f64,
}

/// How B differs from A over some pixels; values in the unit of the images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// Pixels compared: those with a number in both.
    pub n: u64,
    /// Pixels left out, because A or B has no number there.
    pub excluded: u64,
    /// Those of them where only one has none.
    pub excluded_in_one: u64,
    /// Mean of A.
    pub mean_a: f64,
    /// Mean of B.
    pub mean_b: f64,
    /// Mean of |A|, what relative numbers relate to.
    pub mean_abs_a: f64,
    /// Mean of B − A.
    pub bias: f64,
    /// √ mean (B − A)².
    pub rmse: f64,
    /// The value that 99 % of |B − A| do not exceed.
    pub p99: f64,
    /// Where |B − A| is largest; the first such pixel.
    pub worst: Option<Worst>,
    /// Slope of the least-squares line B = slope · A + offset; `None` where A does not vary.
    pub slope: Option<f64>,
    /// Its offset.
    pub offset: Option<f64>,
    /// Its coefficient of determination R²; `None` where A or B does not vary.
    pub r_squared: Option<f64>,
    /// Fraction of pixels with |B − A| ≤ 2 √(σ_A² + σ_B²), where standard errors are known; about 0.95 where the images
    /// differ by their noise alone.
    pub within_two_sigma: Option<f64>,
    /// Mean of (B − A)² / (σ_A² + σ_B²) over pixels with an error above 0; about 1 where noise alone differs.
    pub chi_square: Option<f64>,
}

impl Statistics {
    /// Bias over the mean of |A|.
    pub fn relative_bias(&self) -> Option<f64> {
        (self.mean_abs_a > 0.0).then(|| self.bias / self.mean_abs_a)
    }

    /// RMSE over the mean of |A|.
    pub fn relative_rmse(&self) -> Option<f64> {
        (self.mean_abs_a > 0.0).then(|| self.rmse / self.mean_abs_a)
    }

    /// Whether the RMSE exceeds `tolerance` (relative) of the mean of |A|, or a pixel has a number in one image only.
    pub fn exceeds(&self, tolerance: f64) -> bool {
        self.excluded_in_one > 0 || self.rmse > tolerance * self.mean_abs_a
    }

    /// With keys that name their quantities; values are in the unit of the images.
    pub fn to_json(&self) -> Value {
        json!({
            "n": self.n,
            "excluded": self.excluded,
            "excluded_in_one": self.excluded_in_one,
            "mean_a": self.mean_a,
            "mean_b": self.mean_b,
            "bias": self.bias,
            "rmse": self.rmse,
            "relative_bias": self.relative_bias(),
            "relative_rmse": self.relative_rmse(),
            "percentile_99": self.p99,
            "worst": self.worst.map(|worst| json!({
                "x_px": worst.x, "y_px": worst.y, "a": worst.a, "b": worst.b, "difference": worst.b - worst.a,
            })),
            "slope": self.slope,
            "offset": self.offset,
            "r_squared": self.r_squared,
            "within_two_sigma": self.within_two_sigma,
            "chi_square_per_pixel": self.chi_square,
        })
    }
}

/// Statistics of one material.
#[derive(Clone, Debug, PartialEq)]
pub struct OfMaterial {
    /// Its code.
    pub code: u32,
    /// Its name.
    pub name: String,
    /// Over its pixels.
    pub statistics: Statistics,
}

/// One band of A against one of B.
#[derive(Clone, Debug, PartialEq)]
pub struct BandComparison {
    /// Name in A.
    pub name_a: String,
    /// Name in B.
    pub name_b: String,
    /// Units in A and B, where they are stated.
    pub units: (Option<String>, Option<String>),
    /// Over all pixels.
    pub statistics: Statistics,
    /// Material by material, by code; empty without a truth map.
    pub materials: Vec<OfMaterial>,
    /// Values of A and B at pixels spread evenly over the image, at most 20 000, for plots.
    pub points: Vec<(f32, f32)>,
}

impl BandComparison {
    /// Whether the band or one of its materials exceeds a relative tolerance.
    pub fn exceeds(&self, tolerance: f64) -> bool {
        self.statistics.exceeds(tolerance) || self.materials.iter().any(|of| of.statistics.exceeds(tolerance))
    }

    /// With the statistics of every material.
    pub fn to_json(&self) -> Value {
        let materials: Vec<Value> = (self.materials.iter())
            .map(|of| json!({"code": of.code, "name": of.name, "statistics": of.statistics.to_json()}))
            .collect();
        json!({
            "band_a": self.name_a,
            "band_b": self.name_b,
            "unit_a": self.units.0,
            "unit_b": self.units.1,
            "statistics": self.statistics.to_json(),
            "materials": materials,
        })
    }
}

/// Two images compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// How bands were paired, and which were not.
    pub pairing: Pairing,
    /// One entry a pair of bands.
    pub bands: Vec<BandComparison>,
}

/// What is known beside two images.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside<'a> {
    /// Standard errors of A, in bands as A's.
    pub error_a: Option<&'a Image>,
    /// Standard errors of B, in bands as B's.
    pub error_b: Option<&'a Image>,
    /// Materials.
    pub materials: Option<&'a Materials>,
}

/// Compares two images of one size; `only` keeps bands of A by name, all where empty.
///
/// # Errors
/// Sizes that differ, among the images or what stands beside them; bands that do not pair.
pub fn compare_images(a: &Image, b: &Image, beside: Beside<'_>, only: &[String]) -> Result<Comparison, CompareError> {
    let size = |image: &Image| (image.width, image.height);
    let others = [
        ("B", Some(size(b))),
        ("the error of A", beside.error_a.map(size)),
        ("the error of B", beside.error_b.map(size)),
        ("the truth map", beside.materials.map(|map| (map.width, map.height))),
    ];
    for (what, other) in others {
        if let Some(of_b) = other.filter(|other| *other != size(a)) {
            return Err(CompareError::Size { what, of_a: size(a), of_b });
        }
    }
    let pairing = pair_bands(&a.bands, &b.bands, only)?;
    let bands = (pairing.pairs.iter())
        .map(|&(i, j)| {
            compare_bands(&a.bands[i], &b.bands[j], &errors(beside, a, b, (i, j)), beside.materials, a.width)
        })
        .collect();
    Ok(Comparison { pairing, bands })
}

/// Bands of standard errors that belong to a band of A and one of B.
fn errors<'a>(beside: Beside<'a>, a: &Image, b: &Image, (i, j): (usize, usize)) -> Vec<&'a ImageBand> {
    let of = |errors: Option<&'a Image>, image: &Image, k: usize| {
        let errors = errors?;
        let alike = errors.bands.len() == image.bands.len();
        errors.band(&image.bands[k].name).or_else(|| errors.bands.get(k).filter(|_| alike))
    };
    of(beside.error_a, a, i).into_iter().chain(of(beside.error_b, b, j)).collect()
}

/// Pairs bands: by name where any is shared, else by wavelength where both have them, else by order where they are equally
/// many.
///
/// # Errors
/// A name of `only` that A does not have, or bands that pair in no way.
pub fn pair_bands(a: &[ImageBand], b: &[ImageBand], only: &[String]) -> Result<Pairing, CompareError> {
    let names = |bands: &[ImageBand]| bands.iter().map(|band| band.name.clone()).collect::<Vec<_>>();
    let listed = |names: &[String]| sunglint_dsl::list(names.iter().map(String::as_str));
    for name in only {
        if !a.iter().any(|band| band.name == *name) {
            let known = names(a);
            let near = sunglint_dsl::nearest(name, known.iter().map(String::as_str));
            let near = near.map_or(String::new(), |near| format!("; `{near}`?"));
            return Err(CompareError::Bands(format!("A has no band `{name}`{near} (it has {})", listed(&known))));
        }
    }
    let wanted: Vec<usize> =
        (0..a.len()).filter(|i| only.is_empty() || only.iter().any(|name| *name == a[*i].name)).collect();
    let same = |i: usize, j: usize| a[i].name.eq_ignore_ascii_case(&b[j].name);
    let by_name: Vec<(usize, usize)> = (wanted.iter())
        .filter_map(|&i| {
            // The very name goes before one that differs in case.
            let exact = (0..b.len()).find(|j| a[i].name == b[*j].name);
            Some((i, exact.or_else(|| (0..b.len()).find(|j| same(i, *j)))?))
        })
        .collect();
    let complete = |bands: &[ImageBand]| bands.iter().all(|band| band.wavelength_um.is_some());
    let (by, pairs) = if !by_name.is_empty() {
        (PairedBy::Name, by_name)
    } else if complete(a) && complete(b) {
        (PairedBy::Wavelength, by_wavelength(&wanted, a, b))
    } else if a.len() == b.len() {
        (PairedBy::Order, wanted.iter().map(|i| (*i, *i)).collect())
    } else {
        (PairedBy::Order, Vec::new())
    };
    if pairs.is_empty() {
        return Err(CompareError::Bands(format!(
            "no band of A ({}) has one of B ({}) with its name or within {:.0} nm of it, and they are not equally many",
            listed(&names(a)),
            listed(&names(b)),
            NEAR_UM * 1e3
        )));
    }
    let single = |bands: &[ImageBand], paired: Vec<usize>, wanted: &dyn Fn(usize) -> bool| -> Vec<String> {
        (0..bands.len()).filter(|i| !paired.contains(i) && wanted(*i)).map(|i| bands[i].name.clone()).collect()
    };
    let single_a = single(a, pairs.iter().map(|pair| pair.0).collect(), &|i| wanted.contains(&i));
    let single_b = single(b, pairs.iter().map(|pair| pair.1).collect(), &|_| only.is_empty());
    Ok(Pairing { by, pairs, single: (single_a, single_b) })
}

fn by_wavelength(wanted: &[usize], a: &[ImageBand], b: &[ImageBand]) -> Vec<(usize, usize)> {
    let distance = |i: usize, j: usize| Some((a[i].wavelength_um? - b[j].wavelength_um?).abs());
    (wanted.iter())
        .filter_map(|&i| {
            let (j, far) =
                (0..b.len()).filter_map(|j| Some((j, distance(i, j)?))).min_by(|x, y| x.1.total_cmp(&y.1))?;
            let width = a[i].fwhm_um.unwrap_or(0.0).max(b[j].fwhm_um.unwrap_or(0.0));
            (far <= NEAR_UM.max(0.5 * width) + 1e-9).then_some((i, j))
        })
        .collect()
}

/// Sums about the means, for the pixels of one group.
#[derive(Clone, Default)]
struct Sums {
    n: u64,
    excluded: u64,
    excluded_in_one: u64,
    mean_a: f64,
    mean_b: f64,
    abs_a: f64,
    saa: f64,
    sbb: f64,
    sab: f64,
    squares: f64,
    worst: Option<(f64, Worst)>,
    with_error: u64,
    within: u64,
    chi_square: f64,
    n_chi: u64,
}

impl Sums {
    /// The first pass: means.
    fn count(&mut self, a: f64, b: f64) {
        match (a.is_finite(), b.is_finite()) {
            (true, true) => {
                self.n += 1;
                self.mean_a += a;
                self.mean_b += b;
                self.abs_a += a.abs();
            }
            (false, false) => self.excluded += 1,
            _ => {
                self.excluded += 1;
                self.excluded_in_one += 1;
            }
        }
    }

    fn close_means(&mut self) {
        let n = (self.n as f64).max(1.0);
        self.mean_a /= n;
        self.mean_b /= n;
        self.abs_a /= n;
    }

    /// The second pass: sums of squares about the means.
    fn add(&mut self, worst: Worst, variance: Option<f64>) {
        let (a, b) = (worst.a, worst.b);
        let difference = b - a;
        let (da, db) = (a - self.mean_a, b - self.mean_b);
        self.saa += da * da;
        self.sbb += db * db;
        self.sab += da * db;
        self.squares += difference * difference;
        if self.worst.is_none_or(|(most, _)| difference.abs() > most) {
            self.worst = Some((difference.abs(), worst));
        }
        if let Some(variance) = variance.filter(|variance| variance.is_finite()) {
            self.with_error += 1;
            self.within += u64::from(difference * difference <= 4.0 * variance);
            if variance > 0.0 {
                self.chi_square += difference * difference / variance;
                self.n_chi += 1;
            }
        }
    }

    fn statistics(&self, p99: f64) -> Statistics {
        let n = (self.n as f64).max(1.0);
        let slope = (self.saa > 0.0).then(|| self.sab / self.saa);
        let ratio = |part: f64, count: u64| (count > 0).then(|| part / count as f64);
        Statistics {
            n: self.n,
            excluded: self.excluded,
            excluded_in_one: self.excluded_in_one,
            mean_a: self.mean_a,
            mean_b: self.mean_b,
            mean_abs_a: self.abs_a,
            bias: self.mean_b - self.mean_a,
            rmse: (self.squares / n).sqrt(),
            p99,
            worst: self.worst.map(|(_, worst)| worst),
            slope,
            offset: slope.map(|slope| self.mean_b - slope * self.mean_a),
            r_squared: (self.saa > 0.0 && self.sbb > 0.0).then(|| (self.sab / self.saa) * (self.sab / self.sbb)),
            within_two_sigma: ratio(self.within as f64, self.with_error),
            chi_square: ratio(self.chi_square, self.n_chi),
        }
    }
}

/// The value that 99 % of some do not exceed: the smallest with at least that many at or below it.
pub(crate) fn percentile_99(values: &mut [f32]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let rank = (0.99 * values.len() as f64).ceil() as usize;
    let (_, value, _) = values.select_nth_unstable_by(rank.clamp(1, values.len()) - 1, f32::total_cmp);
    f64::from(*value)
}

fn compare_bands(
    a: &ImageBand,
    b: &ImageBand,
    errors: &[&ImageBand],
    materials: Option<&Materials>,
    width: u32,
) -> BandComparison {
    let n = a.samples.len();
    let mut all = Sums::default();
    let mut of: BTreeMap<u32, (Sums, Vec<f32>)> = BTreeMap::new();
    for i in 0..n {
        let (a, b) = (a.samples.get(i), b.samples.get(i));
        all.count(a, b);
        if let Some(map) = materials {
            of.entry(map.codes[i]).or_default().0.count(a, b);
        }
    }
    all.close_means();
    of.values_mut().for_each(|(sums, _)| sums.close_means());
    let mut differences = Vec::with_capacity(all.n as usize);
    let mut points = Vec::new();
    let stride = n.div_ceil(MOST_POINTS).max(1);
    for i in 0..n {
        let (va, vb) = (a.samples.get(i), b.samples.get(i));
        if !va.is_finite() || !vb.is_finite() {
            continue;
        }
        let pixel = i as u64;
        let worst = Worst { x: (pixel % u64::from(width)) as u32, y: (pixel / u64::from(width)) as u32, a: va, b: vb };
        let variance = (!errors.is_empty()).then(|| errors.iter().map(|error| error.samples.get(i).powi(2)).sum());
        all.add(worst, variance);
        differences.push((vb - va).abs() as f32);
        if let Some((sums, differences)) = materials.and_then(|map| of.get_mut(&map.codes[i])) {
            sums.add(worst, variance);
            differences.push((vb - va).abs() as f32);
        }
        // A step that shares no factor with the width walks over all columns.
        if i % stride == (i / stride) % stride {
            points.push((va as f32, vb as f32));
        }
    }
    let materials = (of.into_iter())
        .map(|(code, (sums, mut differences))| OfMaterial {
            code,
            name: materials.map_or_else(String::new, |map| map.name(code)),
            statistics: sums.statistics(percentile_99(&mut differences)),
        })
        .collect();
    BandComparison {
        name_a: a.name.clone(),
        name_b: b.name.clone(),
        units: (a.unit.clone(), b.unit.clone()),
        statistics: all.statistics(percentile_99(&mut differences)),
        materials,
        points,
    }
}
