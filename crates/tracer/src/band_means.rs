//! A surface by the means of its reflectance over each channel, for algorithms that multiply means (`spectral band`).

use std::cell::RefCell;
use std::sync::Arc;

use sunglint_radiometry::{Channels, LocalDir};
use sunglint_reflectance::{Bsdf, Claims, Lobes, Sample, Split};

use crate::{Nodes, split_at};

/// A model whose values are means over channels: f and every reflectance, one value a channel. Directions are drawn as the
/// model itself draws them.
pub struct BandMeans {
    model: Arc<dyn Bsdf>,
    split: Split,
    n_nodes: usize,
    /// By channel: a node of the model, and its weight in the mean.
    weights: Vec<Vec<(usize, f64)>>,
}

impl BandMeans {
    /// Means over `channels` of a model that is bound to `nodes`; `of_grid` is the split of the same model on their grid.
    pub fn new(model: Arc<dyn Bsdf>, nodes: &Nodes, channels: &Channels, of_grid: &Split) -> Self {
        let mut all = vec![0.0; nodes.n_weights()];
        nodes.weigh(&channels.shares(), &mut all);
        let mut rest = all.into_iter();
        let weights = (0..channels.len()).map(|c| nodes.of_channel(c).zip(rest.by_ref()).collect()).collect();
        Self { model, split: split_at(&Nodes::means(channels), channels, of_grid), n_nodes: nodes.len(), weights }
    }

    /// Lets the model fill its nodes, and fills `out` with the means.
    fn mean<T>(&self, out: &mut [f64], fill: impl FnOnce(&mut [f64]) -> T) -> T {
        thread_local!(static AT_NODES: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) });
        AT_NODES.with_borrow_mut(|at_nodes| {
            at_nodes.resize(self.n_nodes, 0.0);
            let answer = fill(at_nodes);
            for (mean, weights) in out.iter_mut().zip(&self.weights) {
                *mean = weights.iter().map(|(q, weight)| weight * at_nodes[*q]).sum();
            }
            answer
        })
    }
}

impl Bsdf for BandMeans {
    fn lobes(&self) -> Lobes {
        self.model.lobes()
    }
    fn claims(&self) -> Claims {
        self.model.claims()
    }
    fn split(&self) -> &Split {
        &self.split
    }
    fn eval(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        self.mean(f, |f| self.model.eval(incident, outgoing, f));
    }
    fn mirror(&self, outgoing: LocalDir, rho: &mut [f64]) {
        self.mean(rho, |rho| self.model.mirror(outgoing, rho));
    }
    fn sample(&self, outgoing: LocalDir, u: [f64; 3]) -> Option<Sample> {
        self.model.sample(outgoing, u)
    }
    fn mirror_probability(&self, outgoing: LocalDir) -> f64 {
        self.model.mirror_probability(outgoing)
    }
    fn lambertian(&self, outgoing: LocalDir, rho: &mut [f64]) -> f64 {
        self.mean(rho, |rho| self.model.lambertian(outgoing, rho))
    }
    fn rest(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) -> f64 {
        self.mean(f, |f| self.model.rest(incident, outgoing, f))
    }
    fn is_lambertian_at(&self, incident: LocalDir, outgoing: LocalDir) -> bool {
        self.model.is_lambertian_at(incident, outgoing)
    }
    fn pdf(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        self.model.pdf(incident, outgoing)
    }
    fn albedo(&self, incident: LocalDir, rho: &mut [f64]) {
        self.mean(rho, |rho| self.model.albedo(incident, rho));
    }
    fn transmittance(&self, incident: LocalDir, tau: &mut [f64]) {
        self.mean(tau, |tau| self.model.transmittance(incident, tau));
    }
}
