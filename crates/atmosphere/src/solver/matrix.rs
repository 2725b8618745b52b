//! Small dense matrices of a size known to the compiler, row by row.

/// An N × N matrix.
pub(crate) type Matrix<const N: usize> = [[f64; N]; N];
/// A vector.
pub(crate) type Vector<const N: usize> = [f64; N];

/// A B.
#[inline(always)]
pub(crate) fn product<const N: usize>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    let mut out = [[0.0; N]; N];
    for (out, a) in out.iter_mut().zip(a) {
        for (a, b) in a.iter().zip(b) {
            for (out, b) in out.iter_mut().zip(b) {
                *out += a * b;
            }
        }
    }
    out
}

/// Aᵀ.
#[inline(always)]
pub(crate) fn transpose<const N: usize>(a: &Matrix<N>) -> Matrix<N> {
    let mut out = [[0.0; N]; N];
    for (i, row) in a.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            out[j][i] = *value;
        }
    }
    out
}

/// Aᵀ x, which for a symmetric A is A x: the form whose sums run side by side.
#[inline(always)]
pub(crate) fn apply_transposed<const N: usize>(a: &Matrix<N>, x: &Vector<N>) -> Vector<N> {
    let [out] = apply_to_each(a, &[*x]);
    out
}

/// The same of several x, side by side: each has the bits that it would have alone.
#[inline(always)]
pub(crate) fn apply_to_each<const N: usize, const B: usize>(a: &Matrix<N>, x: &[Vector<N>; B]) -> [Vector<N>; B] {
    /// Sums so many at a time stay in registers.
    const WIDTH: usize = 8;
    let mut out = [[0.0; N]; B];
    if N < WIDTH {
        for (i, row) in a.iter().enumerate() {
            for b in 0..B {
                for j in 0..N {
                    out[b][j] += row[j] * x[b][i];
                }
            }
        }
        return out;
    }
    for start in (0..N).step_by(WIDTH) {
        let mut sums = [[0.0; WIDTH]; B];
        for (i, row) in a.iter().enumerate() {
            let row: &[f64; WIDTH] = row[start..].first_chunk().expect("sizes are powers of two");
            for b in 0..B {
                for j in 0..WIDTH {
                    sums[b][j] += row[j] * x[b][i];
                }
            }
        }
        for (out, sums) in out.iter_mut().zip(&sums) {
            out[start..start + WIDTH].copy_from_slice(sums);
        }
    }
    out
}

/// Σ a b, in sums side by side.
#[inline(always)]
pub(crate) fn dot<const N: usize>(a: &Vector<N>, b: &Vector<N>) -> f64 {
    let mut sums = [0.0; 2];
    for (a, b) in a.chunks_exact(2).zip(b.chunks_exact(2)) {
        sums[0] += a[0] * b[0];
        sums[1] += a[1] * b[1];
    }
    sums[0] + sums[1]
}

/// The lower factor L of a positive definite A = L Lᵀ; a pivot that rounding leaves at or below 0 is lifted to a share of
/// 1e-15 of its diagonal.
#[inline(always)]
pub(crate) fn cholesky<const N: usize>(a: &Matrix<N>) -> Matrix<N> {
    let mut l = [[0.0; N]; N];
    for j in 0..N {
        let rest: f64 = l[j][..j].iter().map(|x| x * x).sum();
        let pivot = (a[j][j] - rest).max(1e-15 * a[j][j]).sqrt();
        l[j][j] = pivot;
        for i in j + 1..N {
            let dot: f64 = l[i][..j].iter().zip(&l[j][..j]).map(|(x, y)| x * y).sum();
            l[i][j] = (a[i][j] - dot) / pivot;
        }
    }
    l
}

/// L⁻¹ of a lower triangle.
#[inline(always)]
pub(crate) fn inverse_lower<const N: usize>(l: &Matrix<N>) -> Matrix<N> {
    let mut out = [[0.0; N]; N];
    for i in 0..N {
        let scale = 1.0 / l[i][i];
        let (done, rest) = out.split_at_mut(i);
        let row = &mut rest[0];
        for (l, done) in l[i][..i].iter().zip(done.iter()) {
            for (x, done) in row.iter_mut().zip(done) {
                *x -= l * done;
            }
        }
        row[i] = 1.0;
        row.iter_mut().for_each(|x| *x *= scale);
    }
    out
}

/// A⁻¹ of a positive definite A.
#[inline(always)]
pub(crate) fn inverse_definite<const N: usize>(a: &Matrix<N>) -> Matrix<N> {
    let half = inverse_lower(&cholesky(a));
    product(&transpose(&half), &half)
}

/// A⁻¹ by Gauss–Jordan elimination with partial pivoting.
#[inline(always)]
pub(crate) fn inverse<const N: usize>(a: &Matrix<N>) -> Matrix<N> {
    let mut a = *a;
    let mut out = [[0.0; N]; N];
    (0..N).for_each(|i| out[i][i] = 1.0);
    for column in 0..N {
        let mut pivot = column;
        for i in column + 1..N {
            if a[i][column].abs() > a[pivot][column].abs() {
                pivot = i;
            }
        }
        a.swap(column, pivot);
        out.swap(column, pivot);
        let scale = 1.0 / a[column][column];
        a[column].iter_mut().chain(&mut out[column]).for_each(|x| *x *= scale);
        let (row, other) = (a[column], out[column]);
        for i in (0..N).filter(|i| *i != column) {
            let factor = a[i][column];
            for j in 0..N {
                a[i][j] -= factor * row[j];
                out[i][j] -= factor * other[j];
            }
        }
    }
    out
}

/// A size of matrix for which eigenvalues can be had.
pub(crate) trait Eigen<const N: usize> {
    /// Eigenvalues of a symmetric matrix, and its eigenvectors as columns.
    fn eigen(a: &Matrix<N>) -> (Vector<N>, Matrix<N>);
}

/// Gives [`Eigen`] its sizes.
pub(crate) struct Sizes;

macro_rules! eigen_of {
    ($($n:literal)*) => {$(
        impl Eigen<$n> for Sizes {
            fn eigen(a: &Matrix<$n>) -> (Vector<$n>, Matrix<$n>) {
                // Columns for rows: the matrix is symmetric.
                let found = nalgebra::SMatrix::<f64, $n, $n>::from(*a).symmetric_eigen();
                (found.eigenvalues.data.0[0], transpose(&found.eigenvectors.data.0))
            }
        }
    )*};
}
eigen_of!(2 4 8 16 32);

#[cfg(test)]
mod tests {
    use super::*;

    fn sample<const N: usize>(seed: f64) -> Matrix<N> {
        let mut a = [[0.0; N]; N];
        for (i, row) in a.iter_mut().enumerate() {
            for (j, x) in row.iter_mut().enumerate() {
                *x = (seed * (1.0 + i as f64) * (2.0 + j as f64)).sin();
            }
        }
        a
    }

    #[test]
    fn inverses_undo_and_eigenvectors_diagonalise() {
        let a = sample::<8>(0.7);
        let mut definite = product(&a, &transpose(&a));
        (0..8).for_each(|i| definite[i][i] += 0.1);
        let close = |x: &Matrix<8>, y: &Matrix<8>| {
            x.iter().flatten().zip(y.iter().flatten()).all(|(x, y)| (x - y).abs() < 1e-9)
        };
        let mut one = [[0.0; 8]; 8];
        (0..8).for_each(|i| one[i][i] = 1.0);
        assert!(close(&product(&inverse_definite(&definite), &definite), &one));
        let mut general = a;
        (0..8).for_each(|i| general[i][i] += 2.0);
        assert!(close(&product(&inverse(&general), &general), &one));
        let (values, vectors) = Sizes::eigen(&definite);
        let mut scaled = vectors;
        scaled.iter_mut().for_each(|row| row.iter_mut().zip(values).for_each(|(x, v)| *x *= v));
        assert!(close(&product(&scaled, &transpose(&vectors)), &definite));
    }
}
