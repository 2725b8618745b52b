#![doc = include_str!("measured.md")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Column, Default, Model, ModelInfo, Param, Table, TableKey};
use sunglint_radiometry::{Curve, Dimension, LocalDir, SpectralGrid, gauss_legendre, relative_azimuth};

use crate::composite::{Composite, Energy, Nothing, Part};
use crate::microfacet::{Half, normal, reflected, trowbridge_reitz};
use crate::quadrature::Hemisphere;
use crate::sampling::{cosine_hemisphere, pick};
use crate::spectral::{covered, reflectance_on};
use crate::view_table::degrees;
use crate::{AngularSpectra, Bsdf, Split};

const VALUE: Column = Column { name: "brf", dimension: Dimension::Fraction, range: (0.0, f64::INFINITY) };
const INCIDENT: Column = Column { name: "incident_zenith", dimension: Dimension::Angle, range: (0.0, FRAC_PI_2) };
const FULL: &[Column] = &[
    INCIDENT,
    Column { name: "view_zenith", dimension: Dimension::Angle, range: (0.0, FRAC_PI_2) },
    Column { name: "relative_azimuth", dimension: Dimension::Angle, range: (0.0, PI) },
    VALUE,
];
const IN_PLANE: &[Column] =
    &[INCIDENT, Column { name: "view_zenith", dimension: Dimension::Angle, range: (-FRAC_PI_2, FRAC_PI_2) }, VALUE];

/// Measured bidirectional reflectance.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "measured",
        summary: "a table of measured bidirectional reflectance factors, full or in the plane of incidence",
        manual: include_str!("measured.md"),
        params: &[
            Param::table("table", FULL, Default::Absent, "BRF at incident and view zenith angle and relative azimuth")
                .excludes(&["in_plane", "extension"]),
            Param::table("in_plane", IN_PLANE, Default::Absent, "BRF in the plane of incidence, view < 0 forwards")
                .excludes(&["table"]),
            Param::word(
                "extension",
                &["half_angle", "cosine"],
                Default::Word("half_angle"),
                "what an in-plane table says beside its plane",
            )
            .excludes(&["table"]),
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let (param, table) = match (args.table("table"), args.table("in_plane")) {
        (Some(_), Some(_)) => {
            return Err(BindError::of_block("S05", "`table` and `in_plane` exclude each other"));
        }
        (Some(table), None) => ("table", table),
        (None, Some(table)) => ("in_plane", table),
        (None, None) => {
            return Err(BindError::of_block("S05", "`measured` needs a `table` or an `in_plane` table")
                .help("columns incident_zenith, view_zenith, relative_azimuth and brf"));
        }
    };
    let keyed = keyed(param, table)?;
    let shape = match param {
        "table" => Shape::Full(full(&keyed.rows[0])),
        _ => Shape::InPlane { lights: in_plane(&keyed.rows[0]), bivariate: args.word("extension") != Some("cosine") },
    };
    let mut scans = Scans { shape, spectra: spectra(param, &keyed, grid)? };
    if let (Some(true), Some(total)) = (args.switch("scaled"), args.spectral("reflectance")) {
        scale(&mut scans, &reflectance_on("reflectance", total, grid)?);
    }
    let body = Measured::new(scans, grid.len());
    let lights = body.scans.incident_angles();
    let model = Composite::new(body, Nothing, grid.len(), false, Energy::Looked);
    let mut rho = vec![0.0; grid.len()];
    for theta in lights.into_iter().filter(|theta| *theta < FRAC_PI_2) {
        model.albedo(LocalDir::from_polar(theta, 0.0), &mut rho);
        let most = rho.iter().copied().fold(0.0, f64::max);
        // What a measurement may err by.
        if most > 1.05 {
            let message = format!("light at {} deg leaves {most:.3} times as strong as it came", degrees(theta));
            return Err(
                BindError::new("M05", param, message).help("values are BRF, π times the BRDF: are they too large?")
            );
        }
    }
    Ok(Arc::new(model))
}

/// Scales measured values so that 2 ∫ ρ(θ) cos θ sin θ dθ is `total` at each entry.
fn scale(scans: &mut Scans, total: &[f64]) {
    let n = total.len();
    let mut mean = vec![0.0; n];
    let rule = Hemisphere::coarse();
    for (x, weight) in gauss_legendre(8) {
        // Equal shares of cos² θ.
        let incident = LocalDir::from_polar((0.5 + 0.5 * x).sqrt().acos(), 0.0);
        rule.even(incident.theta(), |outgoing, projected| {
            scans.rows(incident, outgoing, |row, share| {
                let factor = 0.5 * weight * projected * share;
                mean.iter_mut().zip(&scans.spectra[row]).for_each(|(mean, f)| *mean += factor * f);
            });
        });
    }
    for spectrum in &mut scans.spectra {
        for ((f, mean), total) in spectrum.iter_mut().zip(&mean).zip(total) {
            *f = if *mean > 0.0 { *f * total / mean } else { total / PI };
        }
    }
}

/// Nodes of one angle, ascending, each with what hangs on it.
type Nodes<T> = Vec<(f64, T)>;

enum Shape {
    /// θ_i, θ_o, φ, and the row.
    Full(Nodes<Nodes<Nodes<usize>>>),
    /// θ_i, signed view angle, and the row.
    InPlane { lights: Nodes<Nodes<usize>>, bivariate: bool },
}

struct Scans {
    shape: Shape,
    /// f \[sr⁻¹\] of each row on the grid.
    spectra: Vec<Vec<f64>>,
}

/// The rows of one key alone, in their order, which is that of all keys.
struct Keyed {
    keys: Vec<Key>,
    /// Rows of each key by angles.
    rows: Vec<Vec<Vec<f64>>>,
}

#[derive(Clone, PartialEq)]
enum Key {
    All,
    Band(String),
    Wavelength(f64),
}

impl Key {
    fn shown(&self) -> String {
        match self {
            Self::All => String::new(),
            Self::Band(band) => format!(" of band `{band}`"),
            Self::Wavelength(um) => format!(" at {} nm", (um * 1e6).round() / 1e3),
        }
    }
}

/// Rows sorted by angles, key by key; every key must have the same angles.
fn keyed(param: &'static str, table: &Table) -> Result<Keyed, BindError> {
    let fault = |message: String| Err(BindError::new("M05", param, message));
    let n_columns = if param == "table" { FULL.len() } else { IN_PLANE.len() };
    let mut keyed = Keyed { keys: Vec::new(), rows: Vec::new() };
    for (i, row) in table.rows.iter().enumerate() {
        let line = i + 1;
        if row.len() != n_columns || row.iter().any(|value| !value.is_finite()) {
            return fault(format!("row {line} of `{param}` does not hold {n_columns} finite numbers"));
        }
        if row[n_columns - 1] < 0.0 {
            return fault(format!("a BRF is not negative; row {line} of `{param}` has {}", row[n_columns - 1]));
        }
        let key = match &table.key {
            TableKey::None => Some(Key::All),
            TableKey::Band(bands) => bands.get(i).cloned().map(Key::Band),
            TableKey::Wavelength(um) => um.get(i).filter(|um| um.is_finite()).map(|um| Key::Wavelength(*um)),
        };
        let Some(key) = key else { return fault(format!("row {line} of `{param}` has no band or wavelength")) };
        match keyed.keys.iter().position(|known| *known == key) {
            Some(found) => keyed.rows[found].push(row.clone()),
            None => {
                keyed.keys.push(key);
                keyed.rows.push(vec![row.clone()]);
            }
        }
    }
    if keyed.keys.is_empty() {
        return fault(format!("`{param}` has no rows"));
    }
    let angles = |row: &[f64]| row[..n_columns - 1].to_vec();
    let order = |a: &Vec<f64>, b: &Vec<f64>| {
        let pairs = angles(a).into_iter().zip(angles(b));
        pairs.map(|(a, b)| a.total_cmp(&b)).find(|order| order.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
    };
    let shown = |row: &[f64]| {
        let each: Vec<String> = angles(row).iter().map(|angle| format!("{}", degrees(*angle))).collect();
        format!("({}) deg", each.join(", "))
    };
    keyed.rows.iter_mut().for_each(|rows| rows.sort_by(order));
    for (key, rows) in keyed.keys.iter().zip(&keyed.rows) {
        if let Some(pair) = rows.windows(2).find(|pair| order(&pair[0], &pair[1]).is_eq()) {
            return fault(format!("`{param}` has {} twice{}", shown(&pair[0]), key.shown()));
        }
        let all = &keyed.rows[0];
        let lacking = |rows: &[Vec<f64>], of: &[Vec<f64>]| {
            of.iter().find(|row| rows.binary_search_by(|other| order(other, row)).is_err()).map(|row| shown(row))
        };
        let first = &keyed.keys[0];
        for (missing, key) in [(lacking(rows, all), key), (lacking(all, rows), first)] {
            if let Some(angles) = missing {
                let message = format!("`{param}` lacks {angles}{}, which it has elsewhere", key.shown());
                return Err(BindError::new("M05", param, message).help("give every band or wavelength the same angles"));
            }
        }
    }
    Ok(keyed)
}

/// f of each row \[sr⁻¹\] on the grid.
fn spectra(param: &'static str, keyed: &Keyed, grid: &SpectralGrid) -> Result<Vec<Vec<f64>>, BindError> {
    let value = |key: usize, row: usize| keyed.rows[key][row].last().copied().unwrap_or(0.0) / PI;
    let n_rows = keyed.rows[0].len();
    match &keyed.keys[0] {
        Key::All => Ok((0..n_rows).map(|row| vec![value(0, row); grid.len()]).collect()),
        Key::Band(_) => {
            let of_entry: Result<Vec<usize>, BindError> = (grid.entries().iter())
                .map(|entry| {
                    let band = grid.band_of(entry).unwrap_or("(every band)");
                    keyed.keys.iter().position(|key| *key == Key::Band(band.to_string())).ok_or_else(|| {
                        let message = format!("`{param}` has no rows for band `{band}`");
                        BindError::new("M04", param, message).help("give rows for every band the material is seen in")
                    })
                })
                .collect();
            let of_entry = of_entry?;
            Ok((0..n_rows).map(|row| of_entry.iter().map(|key| value(*key, row)).collect()).collect())
        }
        Key::Wavelength(_) => {
            let wavelength = |key: &Key| if let Key::Wavelength(um) = key { *um } else { f64::NAN };
            let mut order: Vec<usize> = (0..keyed.keys.len()).collect();
            order.sort_by(|a, b| wavelength(&keyed.keys[*a]).total_cmp(&wavelength(&keyed.keys[*b])));
            (0..n_rows)
                .map(|row| {
                    let points: Vec<(f64, f64)> =
                        order.iter().map(|key| (wavelength(&keyed.keys[*key]), value(*key, row))).collect();
                    let curve = Curve::linear(&points).map_err(|_| {
                        BindError::new("M05", param, format!("the wavelengths of `{param}` do not ascend"))
                    })?;
                    covered(param, &curve, grid)?;
                    Ok(curve.on(grid).into_iter().map(|f| f.max(0.0)).collect())
                })
                .collect()
        }
    }
}

/// Rows grouped by their angle in a column.
fn grouped(rows: &[Vec<f64>], of: &[usize], column: usize) -> Nodes<Vec<usize>> {
    let mut nodes: Nodes<Vec<usize>> = Vec::new();
    for row in of {
        match nodes.last_mut() {
            Some((angle, rows_of)) if *angle == rows[*row][column] => rows_of.push(*row),
            _ => nodes.push((rows[*row][column], vec![*row])),
        }
    }
    nodes
}

fn full(rows: &[Vec<f64>]) -> Nodes<Nodes<Nodes<usize>>> {
    let all: Vec<usize> = (0..rows.len()).collect();
    let azimuths = |of: &[usize]| -> Nodes<usize> { of.iter().map(|row| (rows[*row][2], *row)).collect() };
    let views = |of: &[usize]| grouped(rows, of, 1).into_iter().map(|(t, of)| (t, azimuths(&of))).collect();
    grouped(rows, &all, 0).into_iter().map(|(t, of)| (t, views(&of))).collect()
}

fn in_plane(rows: &[Vec<f64>]) -> Nodes<Nodes<usize>> {
    let all: Vec<usize> = (0..rows.len()).collect();
    let views = |of: &[usize]| -> Nodes<usize> { of.iter().map(|row| (rows[*row][1], *row)).collect() };
    grouped(rows, &all, 0).into_iter().map(|(t, of)| (t, views(&of))).collect()
}

/// The nodes beside an angle and their weights; the end nodes hold.
fn beside<T>(nodes: &Nodes<T>, angle: f64) -> [(&(f64, T), f64); 2] {
    let above = nodes.partition_point(|node| node.0 <= angle);
    if above == 0 || above == nodes.len() {
        let end = &nodes[above.saturating_sub(1)];
        return [(end, 1.0), (end, 0.0)];
    }
    let (a, b) = (&nodes[above - 1], &nodes[above]);
    let t = (angle - a.0) / (b.0 - a.0);
    [(a, 1.0 - t), (b, t)]
}

/// The view angle of a scan at `theta_k` that corresponds to `view` at `theta`: mirror direction (−θ), retro direction (θ)
/// and horizon correspond, with straight lines between. So a ridge or a hot spot is not lost between two scans.
fn corresponding(view: f64, theta: f64, theta_k: f64) -> f64 {
    if theta >= FRAC_PI_2 || theta_k >= FRAC_PI_2 {
        return view;
    }
    let magnitude = view.abs();
    if magnitude > theta {
        let share = (magnitude - theta) / (FRAC_PI_2 - theta);
        return view.signum() * (theta_k + share * (FRAC_PI_2 - theta_k));
    }
    if theta > 0.0 { view * theta_k / theta } else { view }
}

impl Scans {
    fn incident_angles(&self) -> Vec<f64> {
        match &self.shape {
            Shape::Full(lights) => lights.iter().map(|light| light.0).collect(),
            Shape::InPlane { lights, .. } => lights.iter().map(|light| light.0).collect(),
        }
    }

    /// Calls `visit` with rows and weights that make up f.
    fn rows(&self, incident: LocalDir, outgoing: LocalDir, mut visit: impl FnMut(usize, f64)) {
        let (theta_i, theta_o) = (incident.theta(), outgoing.theta());
        match &self.shape {
            Shape::Full(lights) => {
                let phi = relative_azimuth(incident, outgoing);
                let mut azimuth = |phi: f64, weight: f64| {
                    for ((theta_k, views), w) in beside(lights, theta_i).map(|(light, w)| (light, w)) {
                        if w * weight == 0.0 {
                            continue;
                        }
                        for (view, v) in beside(views, corresponding(theta_o, theta_i, *theta_k)) {
                            beside(&view.1, phi).into_iter().for_each(|(node, u)| visit(node.1, weight * w * v * u));
                        }
                    }
                };
                // Light from the zenith knows no azimuth: towards it the first scan turns into its mean.
                let own = if theta_i < lights[0].0 { theta_i / lights[0].0 } else { 1.0 };
                azimuth(phi, own);
                for (phi, share) in [(0.0, 0.25), (FRAC_PI_2, 0.5), (PI, 0.25)] {
                    azimuth(phi, (1.0 - own) * share);
                }
            }
            Shape::InPlane { lights, bivariate } => {
                let mut side = |theta: f64, view: f64, weight: f64| {
                    for ((theta_k, views), w) in beside(lights, theta).map(|(light, w)| (light, w)) {
                        if w * weight == 0.0 {
                            continue;
                        }
                        for (node, v) in beside(views, corresponding(view, theta, *theta_k)) {
                            visit(node.1, weight * w * v);
                        }
                    }
                };
                let first = lights[0].0;
                let mut scan = |theta: f64, view: f64, weight: f64| {
                    // Light from the zenith knows no sides: towards it the first scan turns into its even part.
                    let own = if theta < first { 0.5 * (1.0 + theta / first) } else { 1.0 };
                    side(theta, view, weight * own);
                    side(theta, -view, weight * (1.0 - own));
                };
                if *bivariate {
                    for (theta, view, weight) in in_plane_equivalents(incident, outgoing) {
                        scan(theta, view, weight);
                    }
                } else {
                    let cos_phi = relative_azimuth(incident, outgoing).cos();
                    scan(theta_i, theta_o, 0.5 * (1.0 + cos_phi));
                    scan(theta_i, -theta_o, 0.5 * (1.0 - cos_phi));
                }
            }
        }
    }
}

/// The two in-plane geometries with the half vector's angle θ_h and the angle b between it and either direction the same
/// [Romeiro2008]: (b + θ_h, θ_h − b) and its exchange. In the plane the geometry itself has all the weight,
/// (1 ± cos φ_d)/2 with cos θ_i − cos θ_o = −2 sin θ_h sin b cos φ_d.
fn in_plane_equivalents(incident: LocalDir, outgoing: LocalDir) -> [(f64, f64, f64); 2] {
    let (sum, apart) = (incident.vec() + outgoing.vec(), incident.vec() - outgoing.vec());
    let theta_h = sum.truncate().length().atan2(sum.z);
    let b = (0.5 * apart.length()).min(1.0).asin();
    let sines = 2.0 * theta_h.sin() * b.sin();
    let cos_d = if sines > 1e-12 { ((outgoing.cos() - incident.cos()) / sines).clamp(-1.0, 1.0) } else { 0.0 };
    // A light beyond the zenith is one on this side, seen from the other.
    let geometry = |light: f64, view: f64| if light < 0.0 { (-light, -view) } else { (light, view) };
    let (a, c) = (geometry(b + theta_h, theta_h - b), geometry(b - theta_h, -theta_h - b));
    [(a.0, a.1, 0.5 * (1.0 + cos_d)), (c.0, c.1, 0.5 * (1.0 - cos_d))]
}

/// The tables, and how directions are drawn from them.
struct Measured {
    scans: Scans,
    n: usize,
    /// Slope of the lobe about the mirror direction, where there is one.
    lobe: Option<f64>,
}

impl Measured {
    fn new(scans: Scans, n: usize) -> Self {
        let mut measured = Self { scans, n, lobe: None };
        measured.lobe = measured.slope();
        measured
    }

    /// The tangent of the half vector's angle at which what a light at 30° shows in its plane has fallen half way from its
    /// peak at the mirror direction; `None` where there is no more than twice the value at the normal.
    fn slope(&self) -> Option<f64> {
        let incident = LocalDir::from_polar(30f64.to_radians(), 0.0);
        let at = |view: f64| {
            let mut f = vec![0.0; self.n];
            self.add(incident, LocalDir::from_polar(view.to_radians(), PI), &mut f);
            f.iter().sum::<f64>()
        };
        let (peak, base) = (at(30.0), at(0.0));
        if peak < 2.0 * base {
            return None;
        }
        let off = (1..60).map(|k| 0.5 * f64::from(k)).find(|off| at(30.0 - off) < 0.5 * (peak + base));
        off.map(|off| (0.5 * off).to_radians().tan().max(0.01))
    }
}

impl Part for Measured {
    fn is_present(&self) -> bool {
        self.scans.spectra.iter().flatten().any(|f| *f > 0.0)
    }

    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        self.scans.rows(incident, outgoing, |row, weight| {
            f.iter_mut().zip(&self.scans.spectra[row]).for_each(|(f, own)| *f += weight * own);
        });
    }

    /// Over the hemisphere, and as often half vectors of a long-tailed distribution as wide as the lobe.
    fn sample(&self, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir> {
        let Some(slope) = self.lobe else { return Some(cosine_hemisphere(u)) };
        match pick(2, u[1]) {
            (0, u1) => Some(cosine_hemisphere([u[0], u1])),
            (_, u1) => reflected(normal(slope * slope * u[0] / (1.0 - u[0]), u1), outgoing),
        }
    }

    fn density(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        let even = incident.cos() / PI;
        let Some(slope) = self.lobe else { return even };
        let half = Half::of(incident, outgoing);
        0.5 * (even + trowbridge_reitz(slope, &half) * half.cos / (4.0 * half.cos_b))
    }

    /// By the proposal's own way, as if a goniometer had scanned the table [Stark1993, sec. 4.1.3]: R_d is the mean over the
    /// illuminations 8, 30, 45, 60 and 75° and both half-planes, without the mirror direction; R_s what the mirror direction
    /// has above it; ρ_s what R_d lacks of the reflectance, hence Ω_s.
    fn split(&self, angles: &[f64], reflectance: &[Vec<f64>]) -> Option<Split> {
        const LIGHTS: [f64; 5] = [8.0, 30.0, 45.0, 60.0, 75.0];
        let mean = |values: &[f64]| values.iter().sum::<f64>() / self.n.max(1) as f64;
        let (mut diffuse, mut specular, mut printed, mut solid_angle) = (vec![], vec![], vec![], vec![]);
        for (theta, rho) in angles.iter().zip(reflectance) {
            let outgoing = LocalDir::from_polar(*theta, 0.0);
            let mut f = vec![0.0; self.n];
            let mut count = 0.0;
            for light in LIGHTS.map(f64::to_radians) {
                for turn in [0.0, PI] {
                    let mirror = turn == PI && (light - theta).abs() < 0.5_f64.to_radians();
                    if !mirror {
                        self.add(LocalDir::from_polar(light, turn), outgoing, &mut f);
                        count += 1.0;
                    }
                }
            }
            let mut peak = vec![0.0; self.n];
            self.add(outgoing.mirrored(), outgoing, &mut peak);
            let r_d: Vec<f64> = f.iter().zip(rho).map(|(f, rho)| (PI * f / count).min(*rho).clamp(0.0, 1.0)).collect();
            let r_s: Vec<f64> = peak.iter().zip(&r_d).map(|(peak, r_d)| (PI * peak - r_d).max(0.0)).collect();
            let rho_s: Vec<f64> = (rho.iter().zip(&r_d).zip(&r_s))
                .map(|((rho, r_d), r_s)| if *r_s > 0.0 { (rho - r_d).clamp(0.0, 1.0 - r_d) } else { 0.0 })
                .collect();
            // What no peak can carry stays diffuse.
            let r_d = rho.iter().zip(&rho_s).map(|(rho, rho_s)| (rho - rho_s).clamp(0.0, 1.0)).collect();
            let full = mean(&r_s) * outgoing.cos() / PI;
            let share = mean(&rho_s);
            solid_angle.push(if share < TAU * full { share / full } else { TAU });
            diffuse.push(r_d);
            specular.push(rho_s);
            printed.push(r_s);
        }
        let table = |rows| AngularSpectra::new(angles.to_vec(), rows);
        Some(Split { diffuse: table(diffuse), specular: table(specular), printed: table(printed), solid_angle })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: Vec<Vec<f64>>) -> Table {
        let n = rows[0].len() - 1;
        let radians =
            |row: Vec<f64>| row.iter().enumerate().map(|(i, v)| if i < n { v.to_radians() } else { *v }).collect();
        Table { key: TableKey::None, rows: rows.into_iter().map(radians).collect() }
    }

    fn grid() -> SpectralGrid {
        SpectralGrid::from_edges(&[0.5, 0.6])
    }

    fn in_plane_scans(given: &Table, bivariate: bool) -> Scans {
        let keyed = keyed("in_plane", given).unwrap();
        let shape = Shape::InPlane { lights: in_plane(&keyed.rows[0]), bivariate };
        Scans { shape, spectra: spectra("in_plane", &keyed, &grid()).unwrap() }
    }

    fn value(scans: &Scans, incident: LocalDir, outgoing: LocalDir) -> f64 {
        let mut f = 0.0;
        scans.rows(incident, outgoing, |row, weight| f += weight * scans.spectra[row][0]);
        f * PI
    }

    /// Every measured geometry comes back as it was measured, in and beside the plane.
    #[test]
    fn measured_values_come_back() {
        let mut rows = Vec::new();
        for (i, light) in [8.0, 30.0, 60.0].into_iter().enumerate() {
            for (j, view) in [-75.0, -60.0, -30.0, -8.0, 8.0, 45.0, 75.0].into_iter().enumerate() {
                rows.push(vec![light, view, 0.1 + 0.01 * (i * 7 + j) as f64]);
            }
        }
        let given = table(rows.clone());
        for bivariate in [true, false] {
            let scans = in_plane_scans(&given, bivariate);
            for row in &rows {
                let incident = LocalDir::from_polar(row[0].to_radians(), 0.3);
                let turn = if row[1] < 0.0 { PI } else { 0.0 };
                let outgoing = LocalDir::from_polar(row[1].abs().to_radians(), 0.3 + turn);
                let found = value(&scans, incident, outgoing);
                assert!((found - row[2]).abs() < 1e-6, "{bivariate} {row:?}: {found}");
            }
        }
        let mut rows = Vec::new();
        for (i, light) in [0.0, 40.0, 70.0].into_iter().enumerate() {
            for (j, view) in [0.0, 30.0, 60.0].into_iter().enumerate() {
                for (k, phi) in [0.0, 90.0, 180.0].into_iter().enumerate() {
                    rows.push(vec![light, view, phi, 0.2 + 0.01 * (9 * i + 3 * j + k) as f64]);
                }
            }
        }
        let given = table(rows.clone());
        let keyed = keyed("table", &given).unwrap();
        let scans =
            Scans { shape: Shape::Full(full(&keyed.rows[0])), spectra: spectra("table", &keyed, &grid()).unwrap() };
        for row in rows.iter().filter(|row| row[0] > 0.0 && row[1] > 0.0) {
            let incident = LocalDir::from_polar(row[0].to_radians(), -1.0);
            let outgoing = LocalDir::from_polar(row[1].to_radians(), -1.0 + row[2].to_radians());
            assert!((value(&scans, incident, outgoing) - row[3]).abs() < 1e-9, "{row:?}");
        }
    }

    /// A ridge along the mirror direction stays one between two scans.
    #[test]
    fn the_specular_ridge_is_kept_between_scans() {
        let mut rows = Vec::new();
        for light in [30.0_f64, 60.0] {
            for view in (-80..=80).step_by(5).map(f64::from) {
                let off = (view + light) / 5.0;
                rows.push(vec![light, view, 0.1 + (-off * off).exp()]);
            }
        }
        let given = table(rows);
        let scans = in_plane_scans(&given, true);
        let light = LocalDir::from_polar(45f64.to_radians(), 0.0);
        assert!((value(&scans, light, light.mirrored()) - 1.1).abs() < 1e-6);
    }

    /// Beside the plane the half-angle form depends on θ_h and b alone, so a lobe of either comes back whole.
    #[test]
    fn a_lobe_of_the_half_vector_is_extended_as_it_is() {
        let lobe = |theta_h: f64| (-(theta_h.tan() / 0.3).powi(2)).exp();
        let mut rows = Vec::new();
        for light in (0..=88).map(f64::from) {
            for view in (-88..=88).map(f64::from) {
                rows.push(vec![light, view, lobe((0.5 * (light + view)).abs().to_radians())]);
            }
        }
        let given = table(rows);
        let scans = in_plane_scans(&given, true);
        for (light, view, phi) in
            [(30.0_f64, 40.0_f64, 150.0_f64), (20.0, 20.0, 90.0), (50.0, 45.0, 170.0), (10.0, 35.0, 60.0)]
        {
            let incident = LocalDir::from_polar(light.to_radians(), 0.0);
            let outgoing = LocalDir::from_polar(view.to_radians(), phi.to_radians());
            let h = incident.vec() + outgoing.vec();
            let theta_h = h.truncate().length().atan2(h.z);
            let found = value(&scans, incident, outgoing);
            // Straight lines between nodes of 1°.
            assert!((found - lobe(theta_h)).abs() < 2e-3, "{light} {view} {phi}: {found} {}", lobe(theta_h));
        }
    }
}
