//! What every surface scattering model must hold, as one suite. The built-in models pass it; the author of another
//! runs it too:
//!
//! ```
//! # use sunglint_plugin::{Args, SpectralValue, Value};
//! # use sunglint_radiometry::SpectralGrid;
//! use sunglint_reflectance::{BUILTIN, conformance};
//!
//! let grid = SpectralGrid::from_edges(&[0.5, 0.6]);
//! let args = Args::new(&BUILTIN[0].info, [("diffuse".to_string(), Value::Spectrum(SpectralValue::Constant(0.5)))]);
//! let model = (BUILTIN[0].bind)(&args, &grid).unwrap();
//! let report = conformance::check(&*model, grid.len(), &conformance::Options::default());
//! assert!(report.passed(), "{report}");
//! ```

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;
use std::sync::Arc;

use sunglint_radiometry::{Frame, LocalDir, SpectralGrid, WorldDir};

use crate::sampling::cosine_hemisphere;
use crate::{Bsdf, TopHat};

/// How hard to look.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// View angles \[rad\] of the integrals and of the chi-square tests; 89.99° and finer steps are looked at besides.
    pub angles: Vec<f64>,
    /// Draws of each chi-square test.
    pub samples: usize,
    /// Chance that a faultless family of models fails a chi-square test.
    pub significance: f64,
    /// How many models make up that family; each brings one test an angle (Šidák's correction).
    pub models: usize,
    /// Seed of the draws.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        let angles = [0.0_f64, 20.0, 40.0, 60.0, 75.0, 85.0].map(f64::to_radians).to_vec();
        Self { angles, samples: 100_000, significance: 0.01, models: 1, seed: 1993 }
    }
}

/// One property and the worst that was seen of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The property.
    pub property: &'static str,
    /// Worst value seen.
    pub worst: f64,
    /// What it may be at most; infinite where the model does not claim the property.
    pub limit: f64,
    /// Where it was seen.
    pub at: String,
}

impl Finding {
    /// Whether the property holds.
    pub fn passed(&self) -> bool {
        self.worst <= self.limit
    }
}

/// All findings on one model.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// One for each property that applies.
    pub findings: Vec<Finding>,
}

impl Report {
    /// Whether every property holds.
    pub fn passed(&self) -> bool {
        self.findings.iter().all(Finding::passed)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for finding in &self.findings {
            let Finding { property, worst, limit, at } = finding;
            match limit.is_finite() {
                true => {
                    let mark = if finding.passed() { "holds" } else { "FAILS" };
                    writeln!(f, "{mark}  {property}: {worst:.3e}, limit {limit:.1e}{at}")?;
                }
                false => {
                    writeln!(f, "told   {property}: {worst:.3e}{at}; the model does not claim to conserve energy")?
                }
            }
        }
        Ok(())
    }
}

/// Holds a model bound to a grid of `n_entries` against the suite. It never panics on what a model answers.
pub fn check(model: &dyn Bsdf, n_entries: usize, options: &Options) -> Report {
    let suite = Suite { model, n_entries, options };
    let mut findings = vec![suite.split(), suite.values(), suite.below(), suite.lambertian()];
    if model.separable().is_some() {
        findings.push(suite.separable());
    }
    if model.claims().reciprocal {
        findings.push(suite.reciprocity());
    }
    let mut energy = suite.energy();
    if !model.claims().conserves_energy {
        // By construction: told, not asked.
        energy.iter_mut().for_each(|finding| finding.limit = f64::INFINITY);
    }
    findings.extend(energy);
    findings.extend([suite.albedo(), suite.draws(), suite.chi_square()]);
    Report { findings }
}

/// That what a model answers at a wavelength does not depend on which others are asked for: bound to a grid it gives the
/// same as bound to each bin alone.
///
/// # Errors
/// Those of `bind`.
pub fn spectral_consistency<E>(
    grid: &SpectralGrid,
    bind: impl Fn(&SpectralGrid) -> Result<Arc<dyn Bsdf>, E>,
) -> Result<Finding, E> {
    let mut worst = Worst::of("f and albedo at a wavelength do not depend on the others", 1e-12);
    let together = bind(grid)?;
    let mut random = Random(0x0b1d);
    let directions: Vec<[LocalDir; 2]> = (0..50)
        .map(|_| [(); 2].map(|()| cosine_hemisphere([random.next(), random.next()])))
        .chain([20.0_f64, 70.0].map(|degree| {
            let o = LocalDir::from_polar(degree.to_radians(), 0.4);
            [o.mirrored(), o]
        }))
        .collect();
    for (bin, edges) in grid.bins().iter().enumerate() {
        let alone = bind(&SpectralGrid::from_edges(&[edges.lower, edges.upper]))?;
        let mut all = vec![0.0; grid.len()];
        let mut own = [0.0; 2];
        let mut compare = |all: &[f64], own: &[f64], at: String| {
            for (a, b) in all[2 * bin..2 * bin + 2].iter().zip(own) {
                worst.see((a - b).abs() / a.abs().max(b.abs()).max(1e-12), || at.clone());
            }
        };
        for [incident, outgoing] in &directions {
            together.eval(*incident, *outgoing, &mut all);
            alone.eval(*incident, *outgoing, &mut own);
            compare(&all, &own, pair(*incident, *outgoing));
        }
        let incident = LocalDir::from_polar(0.8, 0.0);
        together.albedo(incident, &mut all);
        alone.albedo(incident, &mut own);
        compare(&all, &own, angle(0.8));
    }
    Ok(worst.finding())
}

struct Suite<'a> {
    model: &'a dyn Bsdf,
    n_entries: usize,
    options: &'a Options,
}

/// Keeps the worst of what it is shown; a number that is not finite is worse than any.
struct Worst {
    property: &'static str,
    limit: f64,
    worst: f64,
    at: String,
}

impl Worst {
    fn of(property: &'static str, limit: f64) -> Self {
        Self { property, limit, worst: f64::NEG_INFINITY, at: String::new() }
    }
    fn see(&mut self, value: f64, at: impl FnOnce() -> String) {
        let value = if value.is_nan() { f64::INFINITY } else { value };
        if value > self.worst {
            (self.worst, self.at) = (value, format!(" at {}", at()));
        }
    }
    fn finding(self) -> Finding {
        let Self { property, limit, worst, at } = self;
        Finding { property, worst, limit, at }
    }
}

fn below(d: LocalDir) -> LocalDir {
    LocalDir::from_unit(d.vec() * glam::DVec3::new(1.0, 1.0, -1.0))
}

fn angle(theta: f64) -> String {
    format!("{:.2} deg", theta.to_degrees())
}

fn pair(incident: LocalDir, outgoing: LocalDir) -> String {
    format!("incident {}, outgoing {}", angle(incident.theta()), angle(outgoing.theta()))
}

impl Suite<'_> {
    fn f(&self, incident: LocalDir, outgoing: LocalDir) -> Vec<f64> {
        let mut f = vec![f64::NAN; self.n_entries];
        self.model.eval(incident, outgoing, &mut f);
        f
    }

    fn mirror(&self, outgoing: LocalDir) -> Vec<f64> {
        let mut rho = vec![f64::NAN; self.n_entries];
        self.model.mirror(outgoing, &mut rho);
        rho
    }

    fn directional_hemispherical(&self, incident: LocalDir) -> Vec<f64> {
        let mut rho = vec![f64::NAN; self.n_entries];
        self.model.albedo(incident, &mut rho);
        rho
    }

    fn transmittance(&self, incident: LocalDir) -> Vec<f64> {
        let mut tau = vec![f64::NAN; self.n_entries];
        self.model.transmittance(incident, &mut tau);
        tau
    }

    /// First and last entry: the integrals look at these.
    fn entries(&self) -> Vec<usize> {
        let mut entries = vec![0, self.n_entries.saturating_sub(1)];
        entries.dedup();
        entries
    }

    /// The angles asked for, and normal and near-grazing ones.
    fn all_angles(&self) -> Vec<f64> {
        let steps = (0..90).map(f64::from).chain([89.5, 89.9, 89.99]).map(f64::to_radians);
        steps.chain(self.options.angles.iter().copied()).collect()
    }

    /// Pairs of directions: even over the hemisphere, drawn by the model, and among normal, grazing and glint.
    fn pairs(&self) -> Vec<(LocalDir, LocalDir)> {
        let mut random = Random(self.options.seed ^ 0x5eed);
        let mut pairs = Vec::new();
        for _ in 0..2000 {
            let outgoing = cosine_hemisphere([random.next(), random.next()]);
            pairs.push((cosine_hemisphere([random.next(), random.next()]), outgoing));
            if let Some(sample) = self.model.sample(outgoing, [random.next(), random.next(), random.next()]) {
                pairs.push((sample.incident, outgoing));
            }
        }
        let special = [0.0, 1e-8, 1.0, 89.9_f64.to_radians(), 89.99_f64.to_radians()];
        for i in special {
            for o in special {
                pairs.extend([0.0, 1.0, PI].map(|phi| (LocalDir::from_polar(i, phi), LocalDir::from_polar(o, 0.0))));
            }
        }
        pairs
    }

    fn split(&self) -> Finding {
        let mut worst = Worst::of("split: R_d ≥ 0, ρ_s ≥ 0, R_d + ρ_s ≤ 1, 0 ≤ Ω_s ≤ 2π", 1e-9);
        let split = self.model.split();
        for half_degree in 0..=180 {
            let theta = (0.5 * f64::from(half_degree)).to_radians();
            let solid_angle = split.solid_angle_at(theta);
            worst.see((-solid_angle).max(solid_angle - TAU), || angle(theta));
            for entry in 0..self.n_entries {
                let (r_d, rho_s) = (split.diffuse.at(theta, entry), split.specular.at(theta, entry));
                let printed = split.printed.at(theta, entry);
                let excess = (-r_d).max(-rho_s).max(r_d + rho_s - 1.0).max(-printed);
                worst.see(if printed.is_finite() { excess } else { f64::NAN }, || angle(theta));
            }
        }
        worst.finding()
    }

    fn values(&self) -> Finding {
        let mut worst = Worst::of("f is finite and not negative, from normal incidence to 89.99 deg", 0.0);
        for (incident, outgoing) in self.pairs() {
            let density = self.model.pdf(incident, outgoing);
            for f in self.f(incident, outgoing).into_iter().chain(self.mirror(outgoing)).chain([density]) {
                worst.see(if f.is_finite() { -f } else { f64::NAN }, || pair(incident, outgoing));
            }
        }
        worst.finding()
    }

    fn below(&self) -> Finding {
        let mut worst = Worst::of("f, its density and the mirror are 0 below the surface", 0.0);
        for (incident, outgoing) in self.pairs() {
            let above = |d: LocalDir| if d.cos() < 0.0 { below(d) } else { d };
            let (incident, through) = (above(incident), self.model.lobes().transmission);
            for (i, o) in [(below(incident), outgoing), (incident, below(outgoing)), (below(incident), below(outgoing))]
            {
                // What passes through comes from below, and is seen from above.
                if through && i.cos() < 0.0 && o.cos() > 0.0 {
                    continue;
                }
                worst.see(self.model.pdf(i, o).abs(), || pair(i, o));
                self.f(i, o).into_iter().for_each(|f| worst.see(f.abs(), || pair(i, o)));
            }
            let o = below(outgoing);
            self.mirror(o).into_iter().for_each(|rho| worst.see(rho.abs(), || pair(incident, o)));
        }
        worst.finding()
    }

    /// Σ_j c_j s_j against f, relative to f.
    fn separable(&self) -> Finding {
        let mut worst = Worst::of("the separable form is f", 1e-9);
        let Some(separable) = self.model.separable() else { return worst.finding() };
        let coefficients = separable.coefficients();
        let mut shapes = vec![0.0; coefficients.len()];
        for (incident, outgoing) in self.pairs() {
            separable.shapes(incident, outgoing, &mut shapes);
            for (entry, f) in self.f(incident, outgoing).into_iter().enumerate() {
                let sum: f64 = coefficients.iter().zip(&shapes).map(|(c, s)| c[entry] * s).sum();
                worst.see((sum - f).abs() / f.abs().max(1e-12), || pair(incident, outgoing));
            }
        }
        worst.finding()
    }

    /// What f and the density of draws differ by from the Lambertian part and the rest, relative to f and to the density, and what
    /// there is of a rest where the model says that there is none.
    fn lambertian(&self) -> Finding {
        let mut worst = Worst::of("f and the density are their Lambertian part and the rest", 1e-9);
        let (mut rho, mut rest) = (vec![0.0; self.n_entries], vec![0.0; self.n_entries]);
        for (incident, outgoing) in self.pairs() {
            let chance = self.model.lambertian(outgoing, &mut rho);
            let density = self.model.rest(incident, outgoing, &mut rest);
            let above = chance > 0.0 && incident.cos() > 0.0;
            let alone = above && self.model.is_lambertian_at(incident, outgoing);
            let differs = |whole: f64, even: f64, rest: f64| {
                let even = if above { even } else { 0.0 };
                let beyond = if alone { rest.abs() } else { (-rest).max(0.0) };
                (whole - even - rest).abs().max(beyond) / whole.abs().max(1e-300)
            };
            let of_f = (self.f(incident, outgoing).into_iter().zip(rho.iter().zip(&rest)))
                .map(|(f, (rho, rest))| differs(f, rho / PI, *rest))
                .fold(0.0, f64::max);
            let of_density = differs(self.model.pdf(incident, outgoing), chance * incident.cos() / PI, density);
            worst.see(of_f.max(of_density), || pair(incident, outgoing));
        }
        worst.finding()
    }

    /// f(ω_i, ω_o) against f(ω_o, ω_i), relative to the larger.
    fn reciprocity(&self) -> Finding {
        let mut worst = Worst::of("f is reciprocal", 1e-6);
        for (incident, outgoing) in self.pairs() {
            // Light that passes through goes back through the other side.
            let turned = if incident.cos() < 0.0 { [below(outgoing), below(incident)] } else { [outgoing, incident] };
            let (there, back) = (self.f(incident, outgoing), self.f(turned[0], turned[1]));
            for (a, b) in there.into_iter().zip(back) {
                worst.see((a - b).abs() / a.abs().max(b.abs()).max(1e-12), || pair(incident, outgoing));
            }
        }
        worst.finding()
    }

    /// What light along one direction leaves with, and what a furnace of radiance 1 shows.
    fn energy(&self) -> [Finding; 2] {
        let mut leaving = Worst::of("directional-hemispherical reflectance and transmittance less 1", 1e-9);
        for theta in self.all_angles() {
            let incident = LocalDir::from_polar(theta, 0.7);
            let through = self.transmittance(incident);
            for (rho, tau) in self.directional_hemispherical(incident).into_iter().zip(through) {
                leaving.see(rho + tau - 1.0, || angle(theta));
            }
        }
        // The integral's own error.
        let mut furnace = Worst::of("hemispherical-directional reflectance less 1", 1e-3);
        for &theta in &self.options.angles {
            let outgoing = LocalDir::from_polar(theta, 0.7);
            for entry in self.entries() {
                let shown =
                    self.integral(outgoing, |incident| self.f(incident, outgoing)[entry] * incident.cos().abs());
                furnace.see(shown + self.mirror(outgoing)[entry] - 1.0, || angle(theta));
            }
        }
        [leaving.finding(), furnace.finding()]
    }

    /// The model's albedo against the integral of its own f, and of its mirror (where θ_o = θ_i).
    fn albedo(&self) -> Finding {
        let mut worst = Worst::of("albedo against the integral of f", 1e-3);
        for &theta in &self.options.angles {
            let incident = LocalDir::from_polar(theta, 0.7);
            let albedo = self.directional_hemispherical(incident);
            let mirror = self.mirror(incident);
            let through = self.transmittance(below(incident));
            for entry in self.entries() {
                let smooth =
                    self.integral(incident, |outgoing| self.f(incident, outgoing)[entry] * outgoing.cos().max(0.0));
                worst.see((smooth + mirror[entry] - albedo[entry]).abs(), || angle(theta));
                if self.model.lobes().transmission {
                    let from_below = |outgoing| self.f(below(incident), outgoing)[entry] * outgoing.cos().max(0.0);
                    let passed = self.integral(incident, from_below);
                    worst.see((passed - through[entry]).abs(), || format!("{}, through", angle(theta)));
                }
            }
        }
        worst.finding()
    }

    /// Every draw carries the density that `pdf` states, or is the mirror direction; f is 0 where nothing is drawn.
    fn draws(&self) -> Finding {
        let mut worst = Worst::of("draws carry their density and reach all of f", 1e-9);
        let mut random = Random(self.options.seed ^ 0xd4a3);
        for theta in self.all_angles() {
            let outgoing = LocalDir::from_polar(theta, 0.7);
            for _ in 0..100 {
                let u = [random.next(), random.next(), random.next()];
                let Some(sample) = self.model.sample(outgoing, u) else { continue };
                let incident = sample.incident;
                worst.see((incident.vec().length() - 1.0).abs(), || pair(incident, outgoing));
                let upwards = if self.model.lobes().transmission { incident.cos().abs() } else { incident.cos() };
                worst.see(-upwards, || pair(incident, outgoing));
                if sample.mirror {
                    let off = (incident.vec() - outgoing.mirrored().vec()).length();
                    let chance = (-sample.pdf).max(sample.pdf - 1.0);
                    worst.see(off.max(chance), || pair(incident, outgoing));
                    let stated = self.model.mirror_probability(outgoing);
                    worst.see((sample.pdf / stated - 1.0).abs(), || pair(incident, outgoing));
                } else {
                    let density = self.model.pdf(incident, outgoing);
                    worst.see((sample.pdf / density - 1.0).abs(), || pair(incident, outgoing));
                }
            }
        }
        for (incident, outgoing) in self.pairs() {
            let reflects = self.f(incident, outgoing).into_iter().any(|f| f > 1e-12);
            let missed = reflects && self.model.pdf(incident, outgoing) <= 0.0;
            worst.see(if missed { 1.0 } else { 0.0 }, || pair(incident, outgoing));
        }
        worst.finding()
    }

    /// Pearson's test of draws against the density, in cells about the mirror direction. Draws of the mirror lobe and
    /// draws that fall below the surface are cells of their own.
    fn chi_square(&self) -> Finding {
        let tests = (self.options.models * self.options.angles.len()).max(1) as f64;
        let level = 1.0 - (1.0 - self.options.significance).powf(1.0 / tests);
        // Seen as 1 − p, so that larger is worse here too.
        let mut worst = Worst::of("1 − p of the chi-square test of draws", 1.0 - level);
        let n = self.options.samples;
        let mut random = Random(self.options.seed);
        for &theta in &self.options.angles {
            let outgoing = LocalDir::from_polar(theta, 0.7);
            let cells = self.cells(outgoing);
            let density = |incident: LocalDir| self.model.pdf(incident, outgoing);
            // A fifth of a draw a cell.
            let within = (0.2 / n as f64).min(TOLERANCE);
            let mut expected: Vec<f64> = cells.iter().map(|cell| n as f64 * cell.integral(&density, within)).collect();
            let mut counts = vec![0.0; cells.len() + 2];
            let mut choice = 0.0;
            for _ in 0..n {
                match self.model.sample(outgoing, [random.next(), random.next(), random.next()]) {
                    Some(sample) if sample.mirror => {
                        counts[cells.len()] += 1.0;
                        choice = sample.pdf;
                    }
                    Some(sample) => counts[cell_of(&cells, sample.incident)] += 1.0,
                    None => counts[cells.len() + 1] += 1.0,
                }
            }
            expected.push(n as f64 * choice);
            expected.push((n as f64 - expected.iter().sum::<f64>()).max(0.0));
            worst.see(1.0 - p_value(&counts, &expected), || angle(theta));
        }
        worst.finding()
    }

    /// Integral over the directions above the surface, and below it where light passes through, of a function that peaks
    /// about the mirror direction of `seen`.
    fn integral(&self, seen: LocalDir, f: impl Fn(LocalDir) -> f64) -> f64 {
        self.cells(seen).iter().map(|cell| cell.integral(&f, TOLERANCE)).sum()
    }

    /// Cells about the mirror direction, in rings that widen geometrically, with the edge of a top-hat lobe among them.
    fn cells(&self, outgoing: LocalDir) -> Vec<Cell> {
        let axis = Frame::about(outgoing.mirrored().vec());
        let mut edges: Vec<f64> = (0..=21).map(|k| 1e-5 * 10f64.powf(0.25 * f64::from(k))).collect();
        edges.extend([0.0, FRAC_PI_2, PI]);
        let solid_angle = self.model.split().solid_angle_at(outgoing.theta());
        if self.model.lobes().glossy && solid_angle > 0.0 && solid_angle < TAU {
            edges.push(TopHat::new(solid_angle).half_angle());
        }
        edges.sort_by(f64::total_cmp);
        edges.dedup();
        let whole = self.model.lobes().transmission;
        let sector = |k: usize| TAU * k as f64 / SECTORS as f64;
        (edges.windows(2))
            .flat_map(|ring| (0..SECTORS).map(move |k| (ring[0], ring[1], sector(k), sector(k + 1))))
            .map(|(a0, a1, b0, b1)| Cell { axis, alpha: [a0, a1], beta: [b0, b1], whole })
            .collect()
    }
}

/// What halving a cell may change of an integral over it.
const TOLERANCE: f64 = 2e-6;

/// Cells of a ring.
const SECTORS: usize = 12;

/// Index of the cell that holds a direction.
fn cell_of(cells: &[Cell], direction: LocalDir) -> usize {
    let (axis, d) = (cells[0].axis, direction.vec());
    let alpha = 2.0 * (d - axis.normal()).length().atan2((d + axis.normal()).length());
    let local = axis.to_local(WorldDir::from_unit(d)).vec();
    let sector = local.y.atan2(local.x).rem_euclid(TAU) / TAU * SECTORS as f64;
    // The cells stand ring by ring, so those before the ring end within its inner edge.
    let first = cells.partition_point(|cell| cell.alpha[1] <= alpha).min(cells.len() - SECTORS);
    first + (sector as usize).min(SECTORS - 1)
}

/// A patch of the sphere in polar coordinates about an axis \[rad\].
#[derive(Clone, Copy)]
struct Cell {
    axis: Frame,
    alpha: [f64; 2],
    beta: [f64; 2],
    /// Below the surface too.
    whole: bool,
}

impl Cell {
    fn direction(&self, alpha: f64, beta: f64) -> LocalDir {
        LocalDir::from_unit(self.axis.to_world(LocalDir::from_polar(alpha, beta)).vec())
    }

    /// ∫ f dω over the cell, its part above the surface where nothing passes through: four by four Gauss points, halved until that changes
    /// less than `within`.
    fn integral(&self, f: &impl Fn(LocalDir) -> f64, within: f64) -> f64 {
        self.refined(f, self.gauss(f), within, if within < TOLERANCE { 10 } else { 7 })
    }

    fn refined(&self, f: &impl Fn(LocalDir) -> f64, whole: f64, within: f64, depth: u32) -> f64 {
        let middle = |[a, b]: [f64; 2]| 0.5 * (a + b);
        let (ma, mb) = (middle(self.alpha), middle(self.beta));
        let quarters = [[self.alpha[0], ma], [ma, self.alpha[1]]].into_iter().flat_map(|alpha| {
            [[self.beta[0], mb], [mb, self.beta[1]]].into_iter().map(move |beta| Cell { alpha, beta, ..*self })
        });
        let parts: Vec<(Cell, f64)> = quarters.map(|cell| (cell, cell.gauss(f))).collect();
        let sum: f64 = parts.iter().map(|(_, part)| part).sum();
        // Wide cells may be cut by the horizon where no point of theirs sees it.
        let wide = self.alpha[1] - self.alpha[0] > 0.2;
        if depth == 0 || (!wide && (sum - whole).abs() < within) || !sum.is_finite() {
            return sum;
        }
        parts.iter().map(|(cell, part)| cell.refined(f, *part, within, depth - 1)).sum()
    }

    fn gauss(&self, f: &impl Fn(LocalDir) -> f64) -> f64 {
        const X: [f64; 4] =
            [-0.861_136_311_594_052_6, -0.339_981_043_584_856_3, 0.339_981_043_584_856_3, 0.861_136_311_594_052_6];
        const W: [f64; 4] =
            [0.347_854_845_137_453_9, 0.652_145_154_862_546_1, 0.652_145_154_862_546_1, 0.347_854_845_137_453_9];
        let point = |[a, b]: [f64; 2], x: f64| 0.5 * (a + b) + 0.5 * (b - a) * x;
        let mut sum = 0.0;
        for (x, w) in X.into_iter().zip(W) {
            let alpha = point(self.alpha, x);
            for beta in self.above(alpha) {
                let width = 0.5 * (beta[1] - beta[0]);
                for (y, v) in X.into_iter().zip(W) {
                    sum += w * v * width * alpha.sin() * f(self.direction(alpha, point(beta, y)));
                }
            }
        }
        0.5 * (self.alpha[1] - self.alpha[0]) * sum
    }

    /// The parts of the cell's azimuths at an angle to the axis that lie above the surface: z = A + B cos(β − β₀) > 0.
    fn above(&self, alpha: f64) -> impl Iterator<Item = [f64; 2]> {
        let z = |beta: f64| self.direction(alpha, beta).cos();
        let (ahead, behind) = (z(0.0), z(PI));
        let (a, x) = (0.5 * (ahead + behind), 0.5 * (ahead - behind));
        let y = z(FRAC_PI_2) - a;
        let b = x.hypot(y);
        let half = match () {
            () if self.whole || a >= b => f64::INFINITY,
            () if a <= -b => 0.0,
            () => (-a / b).clamp(-1.0, 1.0).acos(),
        };
        let (middle, [low, high]) = (y.atan2(x), self.beta);
        let turns: &[f64] = if half.is_finite() { &[-TAU, 0.0, TAU] } else { &[0.0] };
        turns
            .iter()
            .map(move |turn| [(middle + turn - half).max(low), (middle + turn + half).min(high)])
            .filter(|[a, b]| a < b)
    }
}

/// Chance of a chi-square statistic at least this large. Cells that expect fewer than ten draws are put together, and two
/// more where the number of degrees of freedom would be odd: for an even number the tail is a finite sum.
fn p_value(counts: &[f64], expected: &[f64]) -> f64 {
    let mut cells: Vec<(f64, f64)> = expected.iter().copied().zip(counts.iter().copied()).collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let rare = cells.partition_point(|(expected, _)| *expected < 10.0);
    let pooled = cells.drain(..rare).fold((0.0, 0.0), |sum, cell| (sum.0 + cell.0, sum.1 + cell.1));
    let join = |cell: (f64, f64), cells: &mut Vec<(f64, f64)>| match cells.first_mut() {
        Some(first) => *first = (first.0 + cell.0, first.1 + cell.1),
        None => cells.push(cell),
    };
    if pooled.0 < 10.0 {
        join(pooled, &mut cells);
    } else {
        cells.insert(0, pooled);
    }
    if cells.len().is_multiple_of(2) && cells.len() > 1 {
        let cell = cells.remove(0);
        join(cell, &mut cells);
    }
    let statistic: f64 = cells.iter().map(|(e, n)| (n - e) * (n - e) / e.max(1e-9)).sum();
    let half_freedom = (cells.len() - 1) / 2;
    // Q(ν/2, x/2) = e^(−x/2) Σ_{j < ν/2} (x/2)^j / j!
    let x = 0.5 * statistic;
    let mut log_term = -x;
    let mut tail = 0.0;
    for j in 0..half_freedom {
        tail += log_term.exp();
        log_term += x.ln() - ((j + 1) as f64).ln();
    }
    if half_freedom == 0 { 1.0 } else { tail.min(1.0) }
}

/// SplitMix64 [Steele2014, OOPSLA]: numbers in 0..1, the same on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
