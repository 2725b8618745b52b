//! A reflectance model made of a body, which scatters smoothly into all directions, and a gloss, a lobe about the mirror
//! direction. Either says its f and how it is sampled; what the trait [`Bsdf`] asks beside follows here by quadrature.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::OnceLock;

use sunglint_radiometry::LocalDir;

use crate::quadrature::Hemisphere;
use crate::sampling::cosine_hemisphere;
use crate::{AngularSpectra, Bsdf, Claims, Lobes, Sample, Separable, Split};

/// What the coarse rule may err by.
const QUADRATURE: f64 = 1e-4;

/// Steps of view angle at which it is known how often each part is drawn.
const CHOICES: usize = 48;

/// Most terms of a separable part.
const MOST_TERMS: usize = 4;

/// What a part adds to f.
pub(crate) trait Part: Send + Sync {
    /// Whether it adds anything at all.
    fn is_present(&self) -> bool;

    /// Adds its f \[sr⁻¹\] at each entry; both directions are above the surface.
    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]);

    /// c_j(λ) of its separable form Σ_j c_j(λ) s_j(ω_i, ω_o), where it has one.
    fn terms(&self) -> Option<&[Vec<f64>]> {
        None
    }

    /// Fills s_j(ω_i, ω_o) of the separable form; both directions are above the surface.
    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]) {
        let _ = (incident, outgoing);
        shapes.fill(0.0);
    }

    /// ρ of a body whose f is ρ/π.
    fn lambertian(&self) -> Option<&[f64]> {
        None
    }

    /// An incident direction for a body; it may lie below the surface, and `None` is a draw without one.
    fn sample(&self, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir> {
        let _ = outgoing;
        Some(cosine_hemisphere(u))
    }

    /// Density of [`sample`](Self::sample) \[sr⁻¹\].
    fn density(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        let _ = outgoing;
        incident.cos() / PI
    }

    /// The split of a body that has a lobe of its own, on nodes of view angle \[rad\] with its reflectance there.
    fn split(&self, angles: &[f64], reflectance: &[Vec<f64>]) -> Option<Split> {
        let _ = (angles, reflectance);
        None
    }

    /// Adds its directional-hemispherical reflectance for light at `theta` \[rad\], where it knows it in closed form.
    fn add_albedo(&self, theta: f64, rho: &mut [f64]) -> bool {
        let _ = (theta, rho);
        false
    }
}

/// Adds Σ_j c_j s_j: what [`Part::add`] of a separable part is.
pub(crate) fn add_terms(part: &(impl Part + ?Sized), incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
    let terms = part.terms().unwrap_or_default();
    let mut shapes = [0.0; MOST_TERMS];
    part.shapes(incident, outgoing, &mut shapes[..terms.len()]);
    for (c, s) in terms.iter().zip(shapes) {
        f.iter_mut().zip(c).for_each(|(f, c)| *f += c * s);
    }
}

/// A lobe about the mirror direction.
pub(crate) trait Gloss: Part {
    /// An incident direction; it may lie below the surface, and `None` is a draw without one.
    fn draw(&self, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir>;

    /// Density of [`draw`](Self::draw) \[sr⁻¹\].
    fn drawn_with(&self, incident: LocalDir, outgoing: LocalDir) -> f64;

    /// The slope tan θ_h of the half vector within which most of the lobe lies at an entry, for integrals.
    fn slope(&self, entry: usize) -> f64;

    /// Angles θ_h \[rad\], ascending, at which the lobe has corners, for integrals.
    fn corners(&self) -> &[f64] {
        &[]
    }

    /// Whether draws reach all of the lobe; where not, some are drawn over the whole hemisphere.
    fn covers(&self) -> bool {
        true
    }

    /// Adds the reflectance of the Dirac lobe that comes with it, seen at `theta` \[rad\].
    fn add_mirror(&self, theta: f64, rho: &mut [f64]) {
        let _ = (theta, rho);
    }

    /// Whether [`add_mirror`](Self::add_mirror) adds anything.
    fn has_mirror(&self) -> bool {
        false
    }
}

/// No body, or no gloss.
pub(crate) struct Nothing;

impl Part for Nothing {
    fn is_present(&self) -> bool {
        false
    }
    fn add(&self, _: LocalDir, _: LocalDir, _: &mut [f64]) {}
    fn terms(&self) -> Option<&[Vec<f64>]> {
        Some(&[])
    }
}

impl Gloss for Nothing {
    fn draw(&self, _: LocalDir, _: [f64; 2]) -> Option<LocalDir> {
        None
    }
    fn drawn_with(&self, _: LocalDir, _: LocalDir) -> f64 {
        0.0
    }
    fn slope(&self, _: usize) -> f64 {
        1.0
    }
}

/// Lambert's law, f = ρ/π.
pub(crate) struct Lambert {
    terms: [Vec<f64>; 1],
}

impl Lambert {
    /// From ρ per grid entry.
    pub fn new(rho: Vec<f64>) -> Self {
        Self { terms: [rho] }
    }
}

impl Part for Lambert {
    fn is_present(&self) -> bool {
        self.terms[0].iter().any(|rho| *rho > 0.0)
    }
    fn add(&self, _: LocalDir, _: LocalDir, f: &mut [f64]) {
        f.iter_mut().zip(&self.terms[0]).for_each(|(f, rho)| *f += rho / PI);
    }
    fn lambertian(&self) -> Option<&[f64]> {
        Some(&self.terms[0])
    }
    fn terms(&self) -> Option<&[Vec<f64>]> {
        Some(&self.terms)
    }
    fn shapes(&self, _: LocalDir, _: LocalDir, shapes: &mut [f64]) {
        shapes[0] = 1.0 / PI;
    }
    fn add_albedo(&self, _: f64, rho: &mut [f64]) -> bool {
        rho.iter_mut().zip(&self.terms[0]).for_each(|(rho, own)| *rho += own);
        true
    }
}

/// What a model of this form claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Energy {
    /// No parameters make it return more than it gets.
    Conserved,
    /// Some do: looked at, angle by angle, once it is asked.
    Looked,
}

/// A body and a gloss.
pub(crate) struct Composite<B, G> {
    body: B,
    gloss: G,
    n: usize,
    lobes: Lobes,
    reciprocal: bool,
    energy: Energy,
    terms: Option<Vec<Vec<f64>>>,
    split: OnceLock<Split>,
    /// Largest reflectance over angles and entries.
    highest: OnceLock<f64>,
    /// Probability with which body, gloss and mirror are drawn, at view angles in even steps of √(1 − cos θ).
    choice: OnceLock<Vec<[f64; 3]>>,
}

impl<B: Part, G: Gloss> Composite<B, G> {
    /// On a grid of `n` entries.
    pub fn new(body: B, gloss: G, n: usize, reciprocal: bool, energy: Energy) -> Self {
        let lobes = Lobes {
            diffuse: body.is_present(),
            mirror: gloss.has_mirror(),
            glossy: gloss.is_present(),
            transmission: false,
        };
        let terms = match (body.terms(), gloss.terms()) {
            (Some(body), Some(gloss)) if !lobes.mirror => Some([body, gloss].concat()),
            _ => None,
        };
        let (split, highest, choice) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
        Self { body, gloss, n, lobes, reciprocal, energy, terms, split, highest, choice }
    }

    /// ∫ f cos θ over the outgoing hemisphere of body and gloss for light at `theta`, or over the incident one for a view at
    /// `theta`.
    fn hemispherical(&self, way: Way, theta: f64, rule: &Hemisphere) -> [Vec<f64>; 2] {
        // A closed form is that of the light's angle.
        let way = if self.reciprocal { Way::Leaving } else { way };
        [
            body_reflectance(&self.body, self.n, way, theta, rule),
            gloss_reflectance(&self.gloss, self.n, way, theta, rule),
        ]
    }

    fn make_split(&self) -> Split {
        let rule = Hemisphere::coarse();
        let theta = nodes();
        let parts = on_all_threads(&theta, |t| self.hemispherical(Way::Arriving, *t, &rule));
        let (mut diffuse, mut specular): (Vec<_>, Vec<_>) =
            parts.into_iter().map(|[body, gloss]| (body, gloss)).unzip();
        if let Some(split) = self.body.split(&theta, &diffuse) {
            return split;
        }
        let mut printed = Vec::new();
        let mut solid_angle = Vec::new();
        for (node, t) in theta.iter().enumerate() {
            let outgoing = LocalDir::from_polar(*t, 0.0);
            let mut peak = vec![0.0; self.n];
            self.gloss.add(outgoing.mirrored(), outgoing, &mut peak);
            let mean = |values: &[f64]| values.iter().sum::<f64>() / self.n.max(1) as f64;
            let (rho_s, full) = (mean(&specular[node]), mean(&peak) * outgoing.cos());
            solid_angle.push(if rho_s < TAU * full { rho_s / full } else { TAU });
            printed.push(peak.iter().map(|f| PI * f).collect::<Vec<f64>>());
            if self.lobes.mirror {
                let glossy = mean(&specular[node]);
                self.gloss.add_mirror(*t, &mut specular[node]);
                // One lobe stands for both: that of the stronger.
                if mean(&specular[node]) > 2.0 * glossy {
                    printed[node].clone_from(&specular[node]);
                    solid_angle[node] = 0.0;
                }
            }
            // The published algorithms get no more than the light that came.
            for (r_d, rho_s) in diffuse[node].iter_mut().zip(&mut specular[node]) {
                *rho_s = rho_s.clamp(0.0, 1.0);
                *r_d = r_d.clamp(0.0, 1.0 - *rho_s);
            }
        }
        let constant = |rows: &[Vec<f64>]| rows.windows(2).all(|pair| pair[0] == pair[1]);
        let table = |rows: Vec<Vec<f64>>| match constant(&rows) {
            true => AngularSpectra::constant(rows.into_iter().next().unwrap_or_default()),
            false => AngularSpectra::new(theta.clone(), rows),
        };
        let diffuse = table(diffuse);
        if !self.lobes.glossy && !self.lobes.mirror {
            return Split::diffuse(diffuse, self.n);
        }
        // `solid_angle` stands on the nodes of `specular`.
        let specular = AngularSpectra::new(theta.clone(), specular);
        Split { diffuse, specular, printed: AngularSpectra::new(theta, printed), solid_angle }
    }

    /// ρ of a body that is a Lambertian part by itself.
    fn lambertian_body(&self, outgoing: LocalDir) -> Option<&[f64]> {
        // A lobe that its own draws do not reach needs those of the body.
        let apart = outgoing.cos() > 0.0 && self.body.is_present() && (!self.lobes.glossy || self.gloss.covers());
        self.body.lambertian().filter(|_| apart)
    }

    fn choice(&self, outgoing: LocalDir) -> [f64; 3] {
        let split = self.split();
        let table = self.choice.get_or_init(|| {
            let mut rho = vec![0.0; self.n];
            (0..=CHOICES)
                .map(|i| {
                    let theta = (1.0 - (i as f64 / CHOICES as f64).powi(2)).acos();
                    split.diffuse.fill(theta, &mut rho);
                    let body: f64 = rho.iter().sum();
                    rho.fill(0.0);
                    self.gloss.add_mirror(theta, &mut rho);
                    let mirror: f64 = rho.iter().sum();
                    split.specular.fill(theta, &mut rho);
                    let gloss = (rho.iter().sum::<f64>() - mirror).max(0.0);
                    // Each part that exists is drawn at times; a lobe that its draws do not reach needs the hemisphere's.
                    let all = (body + gloss + mirror).max(f64::MIN_POSITIVE);
                    let hemisphere = self.lobes.diffuse || (self.lobes.glossy && !self.gloss.covers());
                    let share = |exists: bool, of: f64| if exists { (of / all).max(0.1) } else { 0.0 };
                    let shares =
                        [share(hemisphere, body), share(self.lobes.glossy, gloss), share(self.lobes.mirror, mirror)];
                    let sum: f64 = shares.iter().sum();
                    shares.map(|share| share / sum)
                })
                .collect()
        });
        let x = (1.0 - outgoing.cos()).clamp(0.0, 1.0).sqrt() * CHOICES as f64;
        let i = (x as usize).min(CHOICES - 1);
        std::array::from_fn(|part| table[i][part] + (table[i + 1][part] - table[i][part]) * (x - i as f64))
    }

    fn density(&self, choice: [f64; 3], incident: LocalDir, outgoing: LocalDir) -> f64 {
        choice[0] * self.body.density(incident, outgoing) + self.gloss_density(choice, incident, outgoing)
    }

    fn gloss_density(&self, choice: [f64; 3], incident: LocalDir, outgoing: LocalDir) -> f64 {
        if choice[1] > 0.0 { choice[1] * self.gloss.drawn_with(incident, outgoing) } else { 0.0 }
    }
}

/// What `of` makes of each item, in their order, on threads of its own: those of a pool might take up work meanwhile that waits
/// for this very answer.
pub(crate) fn on_all_threads<T: Sync, R: Send>(items: &[T], of: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let of = &of;
    std::thread::scope(|scope| {
        let running: Vec<_> = (items.chunks(items.len().div_ceil(threads).max(1)))
            .map(|part| scope.spawn(move || part.iter().map(of).collect::<Vec<R>>()))
            .collect();
        running.into_iter().flat_map(|part| part.join().expect("no part panics")).collect()
    })
}

/// Which of the two directions an integral runs over.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// The outgoing one: directional-hemispherical.
    Leaving,
    /// The incident one: hemispherical-directional.
    Arriving,
}

impl Way {
    fn pair(self, fixed: LocalDir, other: LocalDir) -> (LocalDir, LocalDir) {
        match self {
            Self::Leaving => (fixed, other),
            Self::Arriving => (other, fixed),
        }
    }
}

fn body_reflectance(body: &impl Part, n: usize, way: Way, theta: f64, rule: &Hemisphere) -> Vec<f64> {
    let mut rho = vec![0.0; n];
    if !body.is_present() || (way == Way::Leaving && body.add_albedo(theta, &mut rho)) {
        return rho;
    }
    let mut sum = Sum::of(body, n, way, theta);
    rule.even(theta, |d, weight| sum.add(d, weight));
    sum.put(|_| true, &mut rho);
    rho
}

/// Reflectance of a lobe, by half vectors in steps of its own slope. Entries whose slopes differ are integrated apart, in
/// steps that are the same whatever the other entries are.
pub(crate) fn gloss_reflectance(gloss: &impl Gloss, n: usize, way: Way, theta: f64, rule: &Hemisphere) -> Vec<f64> {
    let mut rho = vec![0.0; n];
    if !gloss.is_present() || (way == Way::Leaving && gloss.add_albedo(theta, &mut rho)) {
        return rho;
    }
    let step = |entry: usize| (2.0 * gloss.slope(entry).log2()).round() as i32;
    let mut steps: Vec<i32> = (0..n).map(step).collect();
    steps.sort_unstable();
    steps.dedup();
    for wanted in steps {
        let mut sum = Sum::of(gloss, n, way, theta);
        rule.lobe(theta, (0.5 * f64::from(wanted)).exp2(), gloss.corners(), |d, weight| sum.add(d, weight));
        sum.put(|entry| step(entry) == wanted, &mut rho);
    }
    rho
}

/// A sum of a part's f over directions; of a separable part, of its shapes alone.
struct Sum<'a, P: Part> {
    part: &'a P,
    way: Way,
    fixed: LocalDir,
    shapes: [f64; MOST_TERMS],
    f: Vec<f64>,
    sum: Vec<f64>,
}

impl<'a, P: Part> Sum<'a, P> {
    fn of(part: &'a P, n: usize, way: Way, theta: f64) -> Self {
        let fixed = LocalDir::from_polar(theta, 0.0);
        Self { part, way, fixed, shapes: [0.0; MOST_TERMS], f: vec![0.0; n], sum: vec![0.0; n] }
    }

    fn add(&mut self, direction: LocalDir, weight: f64) {
        let (incident, outgoing) = self.way.pair(self.fixed, direction);
        if let Some(terms) = self.part.terms() {
            let mut shapes = [0.0; MOST_TERMS];
            self.part.shapes(incident, outgoing, &mut shapes[..terms.len()]);
            self.shapes.iter_mut().zip(shapes).for_each(|(sum, s)| *sum += weight * s);
        } else {
            self.f.fill(0.0);
            self.part.add(incident, outgoing, &mut self.f);
            self.sum.iter_mut().zip(&self.f).for_each(|(sum, f)| *sum += weight * f);
        }
    }

    fn put(&self, wanted: impl Fn(usize) -> bool, rho: &mut [f64]) {
        for (entry, rho) in rho.iter_mut().enumerate().filter(|(entry, _)| wanted(*entry)) {
            let terms = self.part.terms().unwrap_or_default().iter().zip(self.shapes);
            *rho = self.sum[entry] + terms.map(|(c, sum)| c[entry] * sum).sum::<f64>();
        }
    }
}

/// View angles of a split's nodes \[rad\]: every 2°, closer near the horizon, the last of which holds to 90°.
pub(crate) fn nodes() -> Vec<f64> {
    let degrees = (0..40).map(|i| 2.0 * f64::from(i)).chain((80..90).map(f64::from)).chain([89.5, 89.9]);
    degrees.map(f64::to_radians).collect()
}

impl<B: Part, G: Gloss> Separable for Composite<B, G> {
    fn coefficients(&self) -> &[Vec<f64>] {
        self.terms.as_deref().unwrap_or_default()
    }

    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]) {
        if incident.cos() <= 0.0 || outgoing.cos() <= 0.0 {
            return shapes.fill(0.0);
        }
        let (body, gloss) = shapes.split_at_mut(self.body.terms().map_or(0, <[_]>::len));
        self.body.shapes(incident, outgoing, body);
        self.gloss.shapes(incident, outgoing, gloss);
    }
}

impl<B: Part, G: Gloss> Bsdf for Composite<B, G> {
    fn lobes(&self) -> Lobes {
        self.lobes
    }

    fn claims(&self) -> Claims {
        let conserves_energy = match self.energy {
            Energy::Conserved => true,
            Energy::Looked => {
                *self.highest.get_or_init(|| {
                    let rule = Hemisphere::coarse();
                    let mut highest = 0.0_f64;
                    for theta in nodes().into_iter().chain([89.99_f64.to_radians()]) {
                        for way in [Way::Leaving, Way::Arriving] {
                            let mut rho = vec![0.0; self.n];
                            self.gloss.add_mirror(theta, &mut rho);
                            for part in self.hemispherical(way, theta, &rule) {
                                rho.iter_mut().zip(part).for_each(|(rho, part)| *rho += part);
                            }
                            highest = rho.into_iter().fold(highest, f64::max);
                        }
                    }
                    highest
                }) <= 1.0 + QUADRATURE
            }
        };
        Claims { reciprocal: self.reciprocal, conserves_energy }
    }

    fn split(&self) -> &Split {
        self.split.get_or_init(|| self.make_split())
    }

    fn eval(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        f.fill(0.0);
        if incident.cos() > 0.0 && outgoing.cos() > 0.0 {
            self.body.add(incident, outgoing, f);
            self.gloss.add(incident, outgoing, f);
        }
    }

    fn separable(&self) -> Option<&dyn Separable> {
        self.terms.is_some().then_some(self as &dyn Separable)
    }

    fn mirror(&self, outgoing: LocalDir, rho: &mut [f64]) {
        rho.fill(0.0);
        if outgoing.cos() > 0.0 {
            self.gloss.add_mirror(outgoing.theta(), rho);
        }
    }

    fn sample(&self, outgoing: LocalDir, u: [f64; 3]) -> Option<Sample> {
        if outgoing.cos() <= 0.0 || self.lobes == Lobes::default() {
            return None;
        }
        let choice = self.choice(outgoing);
        let incident = if u[2] < choice[1] {
            self.gloss.draw(outgoing, [u[0], u[1]])?
        } else if u[2] < choice[1] + choice[2] {
            return Some(Sample { incident: outgoing.mirrored(), mirror: true, pdf: choice[2] });
        } else {
            self.body.sample(outgoing, [u[0], u[1]])?
        };
        let pdf = |incident| self.density(choice, incident, outgoing);
        (incident.cos() > 0.0).then(|| Sample { incident, mirror: false, pdf: pdf(incident) })
    }

    fn mirror_probability(&self, outgoing: LocalDir) -> f64 {
        if self.lobes.mirror && outgoing.cos() > 0.0 { self.choice(outgoing)[2] } else { 0.0 }
    }

    fn lambertian(&self, outgoing: LocalDir, rho: &mut [f64]) -> f64 {
        match self.lambertian_body(outgoing) {
            Some(of_body) => {
                rho.copy_from_slice(of_body);
                self.choice(outgoing)[0]
            }
            None => {
                rho.fill(0.0);
                0.0
            }
        }
    }

    fn rest(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) -> f64 {
        if self.lambertian_body(outgoing).is_none() {
            self.eval(incident, outgoing, f);
            return self.pdf(incident, outgoing);
        }
        f.fill(0.0);
        if incident.cos() <= 0.0 {
            return 0.0;
        }
        self.gloss.add(incident, outgoing, f);
        self.gloss_density(self.choice(outgoing), incident, outgoing)
    }

    fn pdf(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        if incident.cos() <= 0.0 || outgoing.cos() <= 0.0 || self.lobes == Lobes::default() {
            return 0.0;
        }
        self.density(self.choice(outgoing), incident, outgoing)
    }

    fn albedo(&self, incident: LocalDir, rho: &mut [f64]) {
        rho.fill(0.0);
        if incident.cos() <= 0.0 {
            return;
        }
        let (theta, rule) = (incident.theta().min(FRAC_PI_2), Hemisphere::fine());
        self.gloss.add_mirror(theta, rho);
        for part in self.hemispherical(Way::Leaving, theta, &rule) {
            rho.iter_mut().zip(part).for_each(|(rho, part)| *rho += part);
        }
    }
}
