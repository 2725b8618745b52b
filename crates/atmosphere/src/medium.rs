//! A column cut in homogeneous layers, as the solver takes it.

use std::sync::Arc;

use crate::phase::Phase;

/// What of a column does not depend on wavelength. Boundaries run from the top down; layer i lies between boundaries i
/// and i + 1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Strata {
    /// Heights of the boundaries above the site \[m\], descending; the last is 0, the ground.
    pub heights: Vec<f64>,
    /// Refractivity n − 1 of the air at the boundaries, 0.55 µm.
    pub refractivity: Vec<f64>,
    /// Distance of the ground from the centre of the Earth \[m\].
    pub radius: f64,
}

/// A column at one grid entry.
#[derive(Clone, Debug)]
pub(crate) struct Medium {
    /// The layers, from the top down.
    pub layers: Vec<Layer>,
    /// The phase functions that the layers mix.
    pub phases: Vec<Arc<Phase>>,
}

/// Vertical optical depths of one layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Layer {
    /// Of absorption.
    pub absorption: f64,
    /// Of scattering, by phase function of the [`Medium`]; one value each.
    pub scattering: Vec<f64>,
}

impl Layer {
    /// Extinction optical depth.
    pub fn extinction(&self) -> f64 {
        self.absorption + self.scattering.iter().sum::<f64>()
    }
}
