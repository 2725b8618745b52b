//! Directions: double-Gauss quadrature, and the Legendre functions of each azimuthal order on it.

use std::f64::consts::PI;

use sunglint_radiometry::gauss_legendre;

use super::legendre::normalised;
use super::matrix::{Matrix, Vector, apply_to_each, dot};

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
    /// c_l from x and y.
    pub moments_at_nodes: Moments<N>,
    /// Radiance 1 in every direction, times √(wμ).
    pub lambertian: Vector<N>,
    /// F = Σ 2π w μ I.
    pub flux_weights: Vector<N>,
    /// Λ_l^m(0) of even l + m; of odd ones it is 0.
    pub level: Vector<N>,
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
        let moments_at_nodes = Moments::new(&scaled);
        let lambertian = std::array::from_fn(|i| (quadrature.weights[i] * quadrature.cosines[i]).sqrt());
        let mut order = Self {
            m,
            cosines: quadrature.cosines,
            scaled,
            moments_at_nodes,
            lambertian,
            flux_weights: lambertian.map(|root| 2.0 * PI * root),
            level: [0.0; N],
        };
        order.level = order.toward(0.0)[0];
        order
    }

    /// Λ_l^m(μ) of the even l + m and of the odd ones.
    pub fn toward(&self, mu: f64) -> [Vector<N>; 2] {
        let mut row = [0.0; 64];
        let row = &mut row[..self.scaled.len()];
        normalised(self.m, mu, row);
        let mut halves = [[0.0; N]; 2];
        row.iter().enumerate().for_each(|(l, value)| halves[l % 2][l / 2] = *value);
        halves
    }

    /// Irradiance on the level of light times √(wμ).
    pub fn flux(&self, light: &Vector<N>) -> f64 {
        dot(&self.flux_weights, light)
    }
}

/// c_l = ½ p_l · x for even l + m, ½ p_l · y for odd ones.
pub(super) struct Moments<const N: usize> {
    /// ½ p_l as columns.
    even: Matrix<N>,
    odd: Matrix<N>,
}

impl<const N: usize> Moments<N> {
    /// From p_l, l = m, m + 1, …
    #[inline(always)]
    pub fn new(rows: &[Vector<N>]) -> Self {
        let mut halves = [[[0.0; N]; N]; 2];
        for (l, row) in rows.iter().enumerate() {
            for (column, p) in halves[l % 2].iter_mut().zip(row) {
                column[l / 2] = 0.5 * p;
            }
        }
        let [even, odd] = halves;
        Self { even, odd }
    }

    /// c_l, l = m, m + 2, …, and c_(l+1), of each x and y; zeros where there are no more.
    #[inline(always)]
    pub fn of<const B: usize>(&self, x: &[Vector<N>; B], y: &[Vector<N>; B]) -> [[Vector<N>; B]; 2] {
        [apply_to_each(&self.even, x), apply_to_each(&self.odd, y)]
    }
}
