//! A spectrum on the grid, tagged with what it is, so that arguments cannot be swapped at crate boundaries.

use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

use crate::{Curve, SpectralGrid};

/// Spectral radiance \[W m⁻² sr⁻¹ µm⁻¹\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Radiance {}
/// Spectral irradiance \[W m⁻² µm⁻¹\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Irradiance {}
/// Reflectance \[1\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reflectance {}
/// Transmittance \[1\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transmittance {}

/// Values of the quantity `Q`, one per entry of a [`SpectralGrid`].
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum<Q> {
    values: Vec<f64>,
    quantity: PhantomData<Q>,
}

impl<Q> Spectrum<Q> {
    /// From one value per grid entry.
    pub fn new(values: Vec<f64>) -> Self {
        Self { values, quantity: PhantomData }
    }
    /// The same value at every entry.
    pub fn constant(value: f64, grid: &SpectralGrid) -> Self {
        Self::new(vec![value; grid.len()])
    }
    /// A curve on a grid ([`Curve::on`]).
    pub fn from_curve(curve: &Curve, grid: &SpectralGrid) -> Self {
        Self::new(curve.on(grid))
    }
    /// The values, one per grid entry.
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }
}

impl<Q> Deref for Spectrum<Q> {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        &self.values
    }
}

impl<Q> DerefMut for Spectrum<Q> {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }
}
