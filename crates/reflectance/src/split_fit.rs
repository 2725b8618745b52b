//! From in-plane scans to R_d(θ_v) and R_s(θ_v), as the proposal derives them [Stark1993, sec. 4.1.3].
//!
//! ```text
//! R_d(t) = mean of BRF(i, v) over all illuminations i and both signs of v with |v| = t, without v = −i
//! R_s(t) = BRF(t, −t) − R_d(t), not below 0
//! ρ_s(t) = R_s(t) Ω_s cos t/π
//! ```
//!
//! The mean is unweighted, so the wings of a lobe count as diffuse, on purpose; what scatters about it is the part of the
//! BRF that depends on the illumination, which this method cannot hold. R_d and ρ_s run through the measured angles by
//! straight lines or monotone cubics; R_d and ρ_s hold their first value down to 0°, R_d its last one up to 90°, and ρ_s
//! goes on by the rule of [`Grazing`].
//!
//! # Uncertainty
//! The noise σ of a value is the standard error that its scan states (of values without one, the root mean square of those
//! of the band). Where a band states none, the pooled scatter of its values about R_d stands for σ, which is then an upper
//! bound:
//!
//! ```text
//! s²(t)   = Σ (BRF − R_d)²/(n − 1)                     the spread over illumination, noise in it
//! s_p²    = Σ_t (n_t − 1) s²(t)/Σ_t (n_t − 1)          pooled over the view angles of a band
//! u²(R_d) = Σ σ²/n²,  or s_p²/n                        standard error by noise
//! u²(R_s) = σ²(t, −t) + u²(R_d),  or s_p² (1 + 1/n)
//! ```
//!
//! u tells by how much the same scans taken again would differ; s(t)/√n by how much R_d would, had other illuminations
//! been taken.

use crate::grazing::{Excess, Grazing, Peak, Row, excesses, to_horizon};
use crate::interpolation::{Curve, Interpolation};
use crate::scans::{ScanBand, ScanFault, ScanFaults, Scans, rounded};
use crate::{AngularSpectra, Reading, SAME_ANGLE, SOLAR_DISK, Split};

/// What is left of the method to choose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SplitOptions {
    /// ρ_s beyond the last measured angle.
    pub grazing: Grazing,
    /// R_d and ρ_s between measured angles.
    pub interpolation: Interpolation,
}

/// Components by band.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitFit {
    /// Solid angle of the instrument's aperture \[sr\], over which R_s is a BRF.
    pub solid_angle: f64,
    /// How they were found.
    pub options: SplitOptions,
    /// In the order of the scans.
    pub bands: Vec<BandSplit>,
}

/// The components in a band.
#[derive(Clone, Debug, PartialEq)]
pub struct BandSplit {
    /// The band.
    pub band: ScanBand,
    /// Where the noise is from.
    pub noise: Noise,
    /// R_d where it was measured, by view angle.
    pub diffuse: Vec<DiffuseNode>,
    /// R_s where it was measured, by view angle.
    pub specular: Vec<SpecularNode>,
    /// Both at every degree from 0 to 90° and at the measured angles.
    pub rows: Vec<SplitRow>,
    /// Where they return more than they get: the model `split` refuses such a table.
    pub excesses: Vec<Excess>,
}

/// Where the noise of a band's values is from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// The scans state it.
    Stated,
    /// Their pooled scatter about R_d, spread over illumination included.
    Pooled(f64),
    /// No two values could be held against each other.
    Unknown,
}

/// R_d at a measured view angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseNode {
    /// View angle \[rad\].
    pub theta: f64,
    /// R_d.
    pub value: f64,
    /// How many values it is the mean of.
    pub count: usize,
    /// Standard error by noise.
    pub standard_error: Option<f64>,
    /// Standard deviation of the values, noise and dependence on illumination together; two values at least.
    pub spread: Option<f64>,
}

impl DiffuseNode {
    /// Standard error of the mean over the illuminations, spread/√n.
    pub fn spread_error(&self) -> Option<f64> {
        self.spread.map(|spread| spread / (self.count as f64).sqrt())
    }
}

/// R_s at a measured angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularNode {
    /// View angle \[rad\].
    pub theta: f64,
    /// The value in the mirror direction.
    pub brf: f64,
    /// R_s, a BRF.
    pub value: f64,
    /// What R_s would be below 0.
    pub clamped: Option<f64>,
    /// Standard error by noise.
    pub standard_error: Option<f64>,
    /// Whether R_d was measured at this angle; else it is the curve's.
    pub has_diffuse: bool,
}

/// What a row rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Both components were measured there.
    Measured,
    /// Between measured angles.
    Interpolated,
    /// Beyond them.
    Extended,
}

impl Support {
    /// As tables spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Interpolated => "interpolated",
            Self::Extended => "extended",
        }
    }
}

/// The components at a view angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitRow {
    /// View angle \[rad\].
    pub theta: f64,
    /// R_d.
    pub diffuse: f64,
    /// ρ_s, the reflectance of the lobe.
    pub specular: f64,
    /// R_s, the BRF of the lobe's peak; beyond 89°, where it has no bound, with the cosine of 89°.
    pub peak: f64,
    /// Standard error of R_d by noise; between measured angles a straight line, beyond them held.
    pub diffuse_error: Option<f64>,
    /// Standard error of ρ_s by noise, likewise; beyond the last measured angle it grows as ρ_s does.
    pub specular_error: Option<f64>,
    /// What the row rests on.
    pub support: Support,
}

/// What the column `specular` of a table holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpecularColumn {
    /// R_s, a bidirectional reflectance factor.
    #[default]
    Brf,
    /// ρ_s, a reflectance.
    Reflectance,
}

/// Splits scans into R_d and R_s.
///
/// # Errors
/// `S05` scans that do not say their aperture; `U05` an aperture below the sun's disk, which measures no BRF for the model
/// `split`; `M05` bands without a value in the mirror direction, or without another. All are told.
pub fn fit_split(scans: &Scans, options: SplitOptions) -> Result<SplitFit, ScanFaults> {
    let mut faults = ScanFaults::default();
    let fault = |code, message: String| ScanFault::new(code, None, message);
    let solid_angle = scans.solid_angle().unwrap_or_else(|| {
        faults.push(
            fault("S05", "the solid angle of the instrument's aperture is not stated".into())
                .help("without it a peak is no reflectance: give the scans a column `solid_angle_msr`"),
        );
        SOLAR_DISK
    });
    if solid_angle < SOLAR_DISK * (1.0 - 1e-3) {
        let message = format!("an aperture of {solid_angle} sr is smaller than the sun's disk (68 usr)");
        faults.push(fault("U05", message).help("is it in another unit?"));
    }
    let mut bands = Vec::new();
    for band in 0..scans.bands().len() {
        match band_split(scans, band, solid_angle, options) {
            Ok(split) => bands.push(split),
            Err(fault) => faults.push(fault),
        }
    }
    faults.into_result(|| SplitFit { solid_angle, options, bands })
}

fn band_split(scans: &Scans, band: usize, solid_angle: f64, options: SplitOptions) -> Result<BandSplit, ScanFault> {
    let of = &scans.bands()[band];
    let lacks = |what: &str, why: &str| {
        let message = format!("the scans{} have no value {what}: {why}", of.of());
        Err(ScanFault::new("M05", None, message))
    };
    let (mirror, others): (Vec<&Reading>, Vec<&Reading>) =
        scans.of_band(band).iter().partition(|reading| scans.is_specular(reading));
    if mirror.is_empty() {
        return lacks("in the mirror direction, v = -i", "R_s cannot be told");
    }
    if others.is_empty() {
        return lacks("outside the mirror direction", "R_d cannot be told");
    }
    let stated = Stated::of(scans.of_band(band));
    let mut diffuse = diffuse_nodes(scans, others, &stated);
    let noise = match (&stated, pooled(&diffuse)) {
        (Stated { substitute: Some(_) }, _) => Noise::Stated,
        (_, Some(scatter)) => Noise::Pooled(scatter),
        (_, None) => Noise::Unknown,
    };
    if let Noise::Pooled(scatter) = noise {
        diffuse.iter_mut().for_each(|node| node.standard_error = Some(scatter / (node.count as f64).sqrt()));
    }
    let curve_of = |value: &dyn Fn(&DiffuseNode) -> f64, interpolation| {
        Curve::through(&diffuse.iter().map(|node| (node.theta, value(node))).collect::<Vec<_>>(), interpolation)
    };
    let r_d = curve_of(&|node| node.value, options.interpolation);
    let known_error = diffuse.iter().all(|node| node.standard_error.is_some());
    let r_d_error = curve_of(&|node| node.standard_error.unwrap_or(0.0), Interpolation::Linear);
    let mut specular: Vec<SpecularNode> = (mirror.into_iter())
        .map(|reading| {
            let theta = scans.illuminations()[reading.illumination];
            let node = diffuse.iter().find(|node| (node.theta - theta).abs() < SAME_ANGLE);
            let (r_d, error) = node.map_or_else(
                || (r_d.at(theta), known_error.then(|| r_d_error.at(theta))),
                |node| (node.value, node.standard_error),
            );
            let raw = reading.brf - r_d;
            // What rounding leaves of a Lambertian sample is no peak below 0.
            let clamped = (raw < -1e-12 * r_d.abs().max(reading.brf.abs())).then_some(raw);
            let sigma = match noise {
                Noise::Stated => stated.sigma(reading),
                Noise::Pooled(scatter) => Some(scatter),
                Noise::Unknown => None,
            };
            SpecularNode {
                theta,
                brf: reading.brf,
                value: raw.max(0.0),
                clamped,
                standard_error: sigma.zip(error).map(|(sigma, error)| sigma.hypot(error)),
                has_diffuse: node.is_some(),
            }
        })
        .collect();
    specular.sort_by(|a, b| a.theta.total_cmp(&b.theta));
    let peak = Peak::Brf(solid_angle);
    let rows = rows(&diffuse, &specular, &r_d, peak, options);
    let excesses = excesses(&rows);
    let rows = supported(rows, &diffuse, &specular, known_error.then_some(&r_d_error), peak);
    Ok(BandSplit { band: of.clone(), noise, diffuse, specular, rows, excesses })
}

/// The standard errors that a band's values state.
struct Stated {
    /// For values without one: the root mean square of those that have.
    substitute: Option<f64>,
}

impl Stated {
    fn of(readings: &[Reading]) -> Self {
        let stated: Vec<f64> = readings.iter().filter_map(|reading| reading.stddev).collect();
        let mean_square = stated.iter().map(|stddev| stddev * stddev).sum::<f64>() / stated.len() as f64;
        Self { substitute: (!stated.is_empty()).then(|| mean_square.sqrt()) }
    }

    fn sigma(&self, reading: &Reading) -> Option<f64> {
        reading.stddev.or(self.substitute)
    }
}

/// R_d(t) for each |v| = t.
fn diffuse_nodes(scans: &Scans, readings: Vec<&Reading>, stated: &Stated) -> Vec<DiffuseNode> {
    let mut by_angle: Vec<(f64, &Reading)> =
        readings.into_iter().map(|reading| (scans.views()[reading.view].abs(), reading)).collect();
    by_angle.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut nodes = Vec::new();
    let mut rest = &by_angle[..];
    while let Some((theta, first)) = rest.first() {
        let (here, further) = rest.split_at(rest.partition_point(|(angle, _)| angle - theta < SAME_ANGLE));
        rest = further;
        // About the first value, so that equal values have their own as mean.
        let n = here.len() as f64;
        let value = first.brf + here.iter().map(|(_, reading)| reading.brf - first.brf).sum::<f64>() / n;
        let squares = here.iter().map(|(_, reading)| (reading.brf - value).powi(2)).sum::<f64>();
        let variances: Option<f64> = here.iter().map(|(_, reading)| stated.sigma(reading).map(|s| s * s)).sum();
        nodes.push(DiffuseNode {
            theta: *theta,
            value,
            count: here.len(),
            standard_error: variances.map(|sum| sum.sqrt() / n),
            spread: (here.len() > 1).then(|| (squares / (n - 1.0)).sqrt()),
        });
    }
    nodes
}

/// s_p of the nodes that have a spread.
fn pooled(nodes: &[DiffuseNode]) -> Option<f64> {
    let with = nodes.iter().filter_map(|node| Some((node.count as f64 - 1.0, node.spread?)));
    let (freedom, squares) = with.fold((0.0, 0.0), |sum, (freedom, s)| (sum.0 + freedom, sum.1 + freedom * s * s));
    (freedom > 0.0).then(|| (squares / freedom).sqrt())
}

/// Both components at every degree and at the measured angles, from 0 to 90°.
fn rows(
    diffuse: &[DiffuseNode],
    specular: &[SpecularNode],
    r_d: &Curve,
    peak: Peak,
    options: SplitOptions,
) -> Vec<Row> {
    let nodes: Vec<(f64, f64)> =
        specular.iter().map(|node| (node.theta, peak.reflectance(node.value, node.theta))).collect();
    let rho_s = Curve::through(&nodes, options.interpolation);
    let mut angles: Vec<f64> = diffuse.iter().map(|node| node.theta).chain(nodes.iter().map(|node| node.0)).collect();
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|b, a| *b - *a < SAME_ANGLE);
    let (last, last_specular) = (angles[angles.len() - 1], nodes[nodes.len() - 1].0);
    let measured = angles.clone();
    let apart = |theta: &f64| !measured.iter().any(|node| (node - theta).abs() < SAME_ANGLE);
    angles.extend((0..90).map(|degree| f64::from(degree).to_radians()).filter(|theta| *theta < last).filter(apart));
    angles.sort_by(f64::total_cmp);
    let mut rows: Vec<Row> = (angles.into_iter())
        .map(|theta| {
            let specular = rho_s.at(theta);
            Row { theta, diffuse: r_d.at(theta), specular, printed: peak.stated(specular, theta) }
        })
        .collect();
    let known = rows.partition_point(|row| row.theta < last_specular + SAME_ANGLE);
    to_horizon(&mut rows, known, options.grazing, peak);
    rows
}

/// Rows with what they rest on.
fn supported(
    rows: Vec<Row>,
    diffuse: &[DiffuseNode],
    specular: &[SpecularNode],
    r_d_error: Option<&Curve>,
    peak: Peak,
) -> Vec<SplitRow> {
    let errors: Option<Vec<(f64, f64)>> =
        (specular.iter()).map(|node| Some((node.theta, peak.reflectance(node.standard_error?, node.theta)))).collect();
    let rho_s_error = errors.map(|nodes| Curve::through(&nodes, Interpolation::Linear));
    let ends = |first: f64, last: f64| (first - SAME_ANGLE, last + SAME_ANGLE);
    let of_diffuse = ends(diffuse[0].theta, diffuse[diffuse.len() - 1].theta);
    let of_specular = ends(specular[0].theta, specular[specular.len() - 1].theta);
    let inside = |(first, last): (f64, f64), theta: f64| (first..=last).contains(&theta);
    let at_last = rows.iter().rfind(|row| row.theta <= of_specular.1).map_or(0.0, |row| row.specular);
    let at = |theta: f64, node: f64| (theta - node).abs() < SAME_ANGLE;
    (rows.into_iter())
        .map(|row| {
            let Row { theta, diffuse: r_d, specular: rho_s, printed } = row;
            let both =
                diffuse.iter().any(|node| at(theta, node.theta)) && specular.iter().any(|node| at(theta, node.theta));
            let growth = if theta > of_specular.1 && at_last > 0.0 { rho_s / at_last } else { 1.0 };
            SplitRow {
                theta,
                diffuse: r_d,
                specular: rho_s,
                peak: printed,
                diffuse_error: r_d_error.map(|error| error.at(theta)),
                specular_error: rho_s_error.as_ref().map(|error| growth * error.at(theta)),
                support: match () {
                    () if both => Support::Measured,
                    () if inside(of_diffuse, theta) && inside(of_specular, theta) => Support::Interpolated,
                    () => Support::Extended,
                },
            }
        })
        .collect()
}

impl BandSplit {
    /// As components of one grid entry.
    pub fn split(&self, solid_angle: f64) -> Split {
        let spectra = |value: fn(&SplitRow) -> f64| {
            let theta = self.rows.iter().map(|row| row.theta).collect();
            AngularSpectra::new(theta, self.rows.iter().map(|row| vec![value(row)]).collect())
        };
        Split {
            diffuse: spectra(|row| row.diffuse),
            specular: spectra(|row| row.specular),
            printed: spectra(|row| row.peak),
            solid_angle: vec![solid_angle; self.rows.len()],
        }
    }
}

impl SplitFit {
    /// Whether the model `split` takes the table: no band returns more than it gets.
    pub fn is_sound(&self) -> bool {
        self.bands.iter().all(|band| band.excesses.is_empty())
    }

    /// What a scene says to take the table: `split { table "FILE", … }`.
    pub fn in_a_scene(&self, file: &str, column: SpecularColumn) -> String {
        let rest = match (column, self.options.grazing) {
            (SpecularColumn::Reflectance, _) => ", specular reflectance",
            (SpecularColumn::Brf, Grazing::Hold) => ", grazing hold",
            (SpecularColumn::Brf, Grazing::Fresnel) => "",
        };
        format!("split {{ table \"{file}\", solid_angle {} sr{rest} }}", self.solid_angle)
    }

    /// The table that the model `split` takes, `band`, or `wavelength_nm` where there are several, `view_zenith_deg`,
    /// `diffuse`, `specular`, from 0 to 90° at every degree and at the measured angles, with columns behind that say what
    /// each row rests on. In a table of BRF the row at 90°, where ρ_s > 0 has no finite one, states R_s with the cosine of
    /// 89°, and the model takes ρ_s from its rule, `grazing`.
    pub fn to_csv(&self, column: SpecularColumn) -> String {
        let mut out = csv::Writer::from_writer(Vec::new());
        let mut write = |cells: Vec<String>| {
            // Writing to memory does not fail.
            let _ = out.write_record(cells);
        };
        let exact = |band: &BandSplit| match &band.band {
            ScanBand::Wavelength(wavelength) => rounded(wavelength.nm()) * 1e-3 == wavelength.um(),
            ScanBand::All | ScanBand::Named(_) => true,
        };
        let in_nm = self.bands.iter().all(exact);
        // One wavelength alone would speak for no band.
        let alone = self.bands.len() == 1;
        let key = |band: &ScanBand| match band {
            ScanBand::All => None,
            ScanBand::Wavelength(_) if alone => None,
            ScanBand::Named(name) => Some(("band", name.clone())),
            ScanBand::Wavelength(w) if in_nm => Some(("wavelength_nm", rounded(w.nm()).to_string())),
            ScanBand::Wavelength(w) => Some(("wavelength_um", w.um().to_string())),
        };
        let columns = [
            "view_zenith_deg",
            "diffuse",
            "specular",
            "diffuse_standard_error",
            "specular_standard_error",
            "diffuse_spread",
            "row",
        ];
        let named = self.bands.first().and_then(|band| key(&band.band)).map(|(name, _)| name);
        write(named.into_iter().chain(columns).map(str::to_string).collect());
        let peak = match column {
            SpecularColumn::Brf => Peak::Brf(self.solid_angle),
            SpecularColumn::Reflectance => Peak::Reflectance,
        };
        let optional = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        for band in &self.bands {
            for row in &band.rows {
                let error = row.specular_error.map(|error| peak.stated(error, row.theta));
                let node = band.diffuse.iter().find(|node| (node.theta - row.theta).abs() < SAME_ANGLE);
                let numbers = [
                    rounded(row.theta.to_degrees()).to_string(),
                    row.diffuse.to_string(),
                    peak.stated(row.specular, row.theta).to_string(),
                    optional(row.diffuse_error),
                    optional(error),
                    optional(node.and_then(|node| node.spread)),
                    row.support.name().to_string(),
                ];
                write(key(&band.band).map(|(_, key)| key).into_iter().chain(numbers).collect());
            }
        }
        let what = match column {
            SpecularColumn::Brf => format!("R_s, a BRF over {} sr", self.solid_angle),
            SpecularColumn::Reflectance => "rho_s, a reflectance".to_string(),
        };
        let table = out.into_inner().ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default();
        let of = match &self.bands[..] {
            [BandSplit { band: band @ ScanBand::Wavelength(_), .. }] => {
                format!("# measured at {band}, here for all wavelengths\n")
            }
            _ => String::new(),
        };
        format!(
            "# diffuse: R_d; specular: {what}; errors by noise, spread over illumination\n{of}# in a scene: {}\n{table}",
            self.in_a_scene("this file", column)
        )
    }
}

#[cfg(test)]
mod tests;
