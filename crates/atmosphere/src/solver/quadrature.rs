//! Directions: double-Gauss quadrature, and the Legendre functions of each azimuthal order on it.

use super::legendre::normalised;
use super::matrix::Vector;
use crate::quadrature::gauss_legendre;

/// N nodes μ in each hemisphere, their weights summing to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quadrature<const N: usize> {
    pub cosines: Vector<N>,
    pub weights: Vector<N>,
}

impl<const N: usize> Quadrature<N> {
    pub fn new() -> Self {
        let mut nodes = gauss_legendre(N);
        nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut cosines, mut weights) = ([0.0; N], [0.0; N]);
        for (i, (x, w)) in nodes.iter().enumerate() {
            (cosines[i], weights[i]) = (0.5 * (1.0 + x), 0.5 * w);
        }
        Self { cosines, weights }
    }
}

/// An azimuthal order m on a quadrature.
pub(super) struct Order<const N: usize> {
    pub m: usize,
    pub cosines: Vector<N>,
    /// u_l = √(w/μ) Λ_l^m(μ), l = m … 2N − 1.
    pub scaled: Vec<Vector<N>>,
}

impl<const N: usize> Order<N> {
    pub fn new(m: usize, quadrature: &Quadrature<N>) -> Self {
        let mut scaled = vec![[0.0; N]; 2 * N - m];
        let mut column = vec![0.0; 2 * N - m];
        for i in 0..N {
            normalised(m, quadrature.cosines[i], &mut column);
            let weight = (quadrature.weights[i] / quadrature.cosines[i]).sqrt();
            scaled.iter_mut().zip(&column).for_each(|(u, value)| u[i] = weight * value);
        }
        Self { m, cosines: quadrature.cosines, scaled }
    }
}
