#![doc = include_str!("mix.md")]

use std::cell::RefCell;
use std::f64::consts::TAU;
use std::sync::{Arc, OnceLock};

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{LocalDir, SpectralGrid};

use crate::{AngularSpectra, BUILTIN, Bsdf, Claims, Lobes, Sample, Separable, Split};

/// A weighted sum of other models.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "mix",
        summary: "a weighted sum of other models of the same material",
        manual: include_str!("mix.md"),
        params: &[Param::weights(
            "weights",
            Default::Required,
            "labels of the material's other models, each with its share",
        )],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let components = args.mixture("weights").unwrap_or_default();
    if components.is_empty() {
        return Err(BindError::new("S05", "weights", "`mix` needs the weights of other models")
            .help("`mix { weights [matt 0.7, gloss 0.3] }` beside models of these labels"));
    }
    let sum: f64 = components.iter().map(|component| component.weight).sum();
    if sum > 1.0 + 1e-9 || components.iter().any(|component| component.weight.is_nan() || component.weight < 0.0) {
        let message = format!("weights are not negative and sum to at most 1, not {sum}");
        return Err(BindError::new("M03", "weights", message));
    }
    let parts = (components.iter())
        .map(|component| {
            let model = BUILTIN.iter().find(|model| model.info.name == component.model).ok_or_else(|| {
                BindError::new("N01", "weights", format!("no reflectance model is called `{}`", component.model))
            })?;
            let bound = (model.bind)(&component.args, grid).map_err(|error| {
                let message = format!("its part `{}`: {}", component.model, error.message);
                BindError { param: Some("weights"), message, ..error }
            })?;
            Ok((component.weight, bound))
        })
        .collect::<Result<Vec<_>, BindError>>()?;
    Ok(Arc::new(Mix::new(parts, grid.len())))
}

struct Mix {
    /// Weights and models.
    parts: Vec<(f64, Arc<dyn Bsdf>)>,
    /// Chance with which each part is drawn.
    chances: Vec<f64>,
    n: usize,
    /// Coefficients of the separable form, and how many each part has.
    terms: Option<(Vec<Vec<f64>>, Vec<usize>)>,
    split: OnceLock<Split>,
}

thread_local! {
    /// What one part answers, before it is weighted.
    static ANSWER: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

impl Mix {
    fn new(parts: Vec<(f64, Arc<dyn Bsdf>)>, n: usize) -> Self {
        let incident = LocalDir::from_polar(0.5, 0.0);
        let mut rho = vec![0.0; n];
        let mut returned: Vec<f64> = (parts.iter())
            .map(|(weight, part)| {
                part.albedo(incident, &mut rho);
                let mut all: f64 = rho.iter().sum();
                part.transmittance(incident, &mut rho);
                all += rho.iter().sum::<f64>();
                if part.lobes() == Lobes::default() { 0.0 } else { weight * all }
            })
            .collect();
        let sum: f64 = returned.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        // What reflects at all is drawn at times.
        let share = |of: &f64| if *of > 0.0 { (of / sum).max(0.05) } else { 0.0 };
        returned = returned.iter().map(share).collect();
        let sum: f64 = returned.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let chances = returned.iter().map(|chance| chance / sum).collect();
        let separable: Option<Vec<&dyn Separable>> = parts.iter().map(|(_, part)| part.separable()).collect();
        let terms = separable.map(|separable| {
            let counts: Vec<usize> = separable.iter().map(|part| part.coefficients().len()).collect();
            let scaled = |(weight, part): (f64, &dyn Separable)| -> Vec<Vec<f64>> {
                part.coefficients().iter().map(|c| c.iter().map(|c| weight * c).collect()).collect()
            };
            let weights = parts.iter().map(|(weight, _)| *weight);
            (weights.zip(separable).flat_map(scaled).collect(), counts)
        });
        Self { parts, chances, n, terms, split: OnceLock::new() }
    }

    /// Fills `sum` with the weighted sum of what `ask` gets of each part.
    fn weighted(&self, sum: &mut [f64], ask: impl Fn(&dyn Bsdf, &mut [f64])) {
        sum.fill(0.0);
        // Taken out while it is used: a part may be a mixture itself.
        let mut answer = ANSWER.take();
        answer.resize(sum.len(), 0.0);
        for (weight, part) in &self.parts {
            ask(part.as_ref(), &mut answer);
            sum.iter_mut().zip(&answer).for_each(|(sum, answer)| *sum += weight * answer);
        }
        ANSWER.set(answer);
    }

    /// R_d, ρ_s and R_s as stated are weighted sums; Ω_s is that of the parts' lobes, weighted by what they reflect.
    fn make_split(&self) -> Split {
        let splits: Vec<(f64, &Split)> = self.parts.iter().map(|(weight, part)| (*weight, part.split())).collect();
        let angles = |of: &dyn Fn(&Split) -> Vec<f64>| {
            let mut angles: Vec<f64> = splits.iter().flat_map(|(_, split)| of(split)).collect();
            angles.sort_by(f64::total_cmp);
            angles.dedup();
            angles
        };
        let sum = |theta: f64, of: &dyn Fn(&Split) -> &AngularSpectra| {
            let (mut sum, mut own) = (vec![0.0; self.n], vec![0.0; self.n]);
            for (weight, split) in &splits {
                of(split).fill(theta, &mut own);
                sum.iter_mut().zip(&own).for_each(|(sum, own)| *sum += weight * own);
            }
            sum
        };
        let table = |angles: &[f64], of: &dyn Fn(&Split) -> &AngularSpectra| {
            AngularSpectra::new(angles.to_vec(), angles.iter().map(|theta| sum(*theta, of)).collect())
        };
        let views = angles(&|split| split.diffuse.angles().to_vec());
        let lobes = angles(&|split| [split.specular.angles(), split.printed.angles()].concat());
        let mirror = self.lobes().mirror;
        let solid_angle = |theta: &f64| {
            if mirror {
                return 0.0;
            }
            let (mut all, mut of) = (0.0, 0.0);
            for (weight, split) in &splits {
                let mut rho = vec![0.0; self.n];
                split.specular.fill(*theta, &mut rho);
                let rho = weight * rho.iter().sum::<f64>();
                (all, of) = (all + rho, of + rho * split.solid_angle_at(*theta));
            }
            if all > 0.0 { (of / all).min(TAU) } else { 0.0 }
        };
        Split {
            diffuse: table(&views, &|split| &split.diffuse),
            specular: table(&lobes, &|split| &split.specular),
            printed: table(&lobes, &|split| &split.printed),
            solid_angle: lobes.iter().map(solid_angle).collect(),
        }
    }
}

impl Separable for Mix {
    fn coefficients(&self) -> &[Vec<f64>] {
        self.terms.as_ref().map_or(&[], |(terms, _)| terms)
    }

    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]) {
        let Some((_, counts)) = &self.terms else { return shapes.fill(0.0) };
        let mut rest = shapes;
        for ((_, part), count) in self.parts.iter().zip(counts) {
            let (own, others) = std::mem::take(&mut rest).split_at_mut(*count);
            if let Some(separable) = part.separable() {
                separable.shapes(incident, outgoing, own);
            }
            rest = others;
        }
    }
}

impl Bsdf for Mix {
    fn lobes(&self) -> Lobes {
        let present = self.parts.iter().filter(|(weight, _)| *weight > 0.0).map(|(_, part)| part.lobes());
        present.fold(Lobes::default(), |all, own| Lobes {
            diffuse: all.diffuse || own.diffuse,
            mirror: all.mirror || own.mirror,
            glossy: all.glossy || own.glossy,
            transmission: all.transmission || own.transmission,
        })
    }

    fn claims(&self) -> Claims {
        let claims = || self.parts.iter().map(|(_, part)| part.claims());
        Claims {
            reciprocal: claims().all(|claims| claims.reciprocal),
            conserves_energy: claims().all(|claims| claims.conserves_energy),
        }
    }

    fn split(&self) -> &Split {
        self.split.get_or_init(|| self.make_split())
    }

    fn eval(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        self.weighted(f, |part, answer| part.eval(incident, outgoing, answer));
    }

    fn separable(&self) -> Option<&dyn Separable> {
        self.terms.is_some().then_some(self as &dyn Separable)
    }

    fn mirror(&self, outgoing: LocalDir, rho: &mut [f64]) {
        self.weighted(rho, |part, answer| part.mirror(outgoing, answer));
    }

    fn sample(&self, outgoing: LocalDir, u: [f64; 3]) -> Option<Sample> {
        let mut left = u[2];
        let last = self.chances.iter().rposition(|chance| *chance > 0.0)?;
        for (i, ((_, part), chance)) in self.parts.iter().zip(&self.chances).enumerate() {
            if left < *chance || i == last {
                let own = (left / chance).clamp(0.0, 1.0 - f64::EPSILON);
                let drawn = part.sample(outgoing, [u[0], u[1], own])?;
                let pdf = match drawn.mirror {
                    true => self.mirror_probability(outgoing),
                    false => self.pdf(drawn.incident, outgoing),
                };
                return Some(Sample { pdf, ..drawn });
            }
            left -= chance;
        }
        None
    }

    fn mirror_probability(&self, outgoing: LocalDir) -> f64 {
        self.parts.iter().zip(&self.chances).map(|((_, part), chance)| chance * part.mirror_probability(outgoing)).sum()
    }

    fn pdf(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        self.parts.iter().zip(&self.chances).map(|((_, part), chance)| chance * part.pdf(incident, outgoing)).sum()
    }

    fn albedo(&self, incident: LocalDir, rho: &mut [f64]) {
        self.weighted(rho, |part, answer| part.albedo(incident, answer));
    }

    fn transmittance(&self, incident: LocalDir, tau: &mut [f64]) {
        self.weighted(tau, |part, answer| part.transmittance(incident, answer));
    }
}
