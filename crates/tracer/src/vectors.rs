//! Sums over wavelengths, terms of the sky and replicates, four or more side by side with the vectors that the machine has. No
//! product is fused with a sum, and what is added to what does not depend on how many lie side by side: all machines give the
//! same bits.

use std::sync::LazyLock;

use fearless_simd::{Level, dispatch, f64x4, prelude::*};
use sunglint_radiometry::REPLICATES;

/// Numbers side by side.
pub(crate) type Four = [f64; 4];
/// Numbers of all replicates.
pub(crate) type OfReplicates = [f64; REPLICATES];

/// What this machine has.
pub(crate) fn level() -> Level {
    static LEVEL: LazyLock<Level> = LazyLock::new(Level::new);
    *LEVEL
}

/// How many fours hold `n` numbers.
pub(crate) const fn fours(n: usize) -> usize {
    n.div_ceil(4)
}

/// Appends a row of numbers in fours, filled up with zeros.
pub(crate) fn extend_fours(out: &mut Vec<Four>, row: impl Iterator<Item = f64>) {
    let start = out.len();
    for (i, value) in row.enumerate() {
        if i % 4 == 0 {
            out.push([0.0; 4]);
        }
        out[start + i / 4][i % 4] = value;
    }
}

#[inline(always)]
fn sum_of_four<S: Simd>(four: f64x4<S>) -> f64 {
    let [a, b, c, d] = four.to_array();
    (a + c) + (b + d)
}

/// Σ_q a_q row_q, of rows of W fours.
#[inline(always)]
fn sum_of_rows<S: Simd, const W: usize>(simd: S, a: &[f64], rows: &[Four]) -> [f64x4<S>; W] {
    // Even and odd rows apart, so that none waits for the one before.
    let mut sums = [[f64x4::splat(simd, 0.0); W]; 2];
    let (rows, _) = rows.as_chunks::<W>();
    let ((pairs, last), (row_pairs, last_row)) = (a.as_chunks::<2>(), rows.as_chunks::<2>());
    for (pair, rows) in pairs.iter().zip(row_pairs) {
        for i in 0..2 {
            for w in 0..W {
                sums[i][w] += f64x4::load_array_ref(simd, &rows[i][w]) * pair[i];
            }
        }
    }
    for (a, row) in last.iter().zip(last_row) {
        for w in 0..W {
            sums[0][w] += f64x4::load_array_ref(simd, &row[w]) * *a;
        }
    }
    std::array::from_fn(
        #[inline(always)]
        |w| sums[0][w] + sums[1][w],
    )
}

/// Σ_q Σ_m left_q M_qm right_m, the rows of M being W fours.
#[inline(always)]
fn bilinear_of<S: Simd, const W: usize>(simd: S, left: &[f64], matrix: &[Four], right: &[Four; W]) -> f64 {
    let sums = sum_of_rows::<S, W>(simd, left, matrix);
    let mut sum = f64x4::splat(simd, 0.0);
    for w in 0..W {
        sum += sums[w] * f64x4::load_array_ref(simd, &right[w]);
    }
    sum_of_four(sum)
}

/// Σ_q Σ_m left_q M_qm right_m, the rows of M being as many fours as `right`.
#[inline(always)]
pub(crate) fn bilinear<S: Simd>(simd: S, left: &[f64], matrix: &[Four], right: &[Four]) -> f64 {
    match right {
        [] => 0.0,
        [a] => bilinear_of(simd, left, matrix, &[*a]),
        [a, b] => bilinear_of(simd, left, matrix, &[*a, *b]),
        [a, b, c] => bilinear_of(simd, left, matrix, &[*a, *b, *c]),
        _ => (left.iter().zip(matrix.chunks_exact(right.len())))
            .map(
                #[inline(always)]
                |(left, row)| left * product(simd, row, right),
            )
            .sum(),
    }
}

/// Σ_m a_m b_m.
#[inline(always)]
fn product<S: Simd>(simd: S, a: &[Four], b: &[Four]) -> f64 {
    let mut sum = f64x4::splat(simd, 0.0);
    for (a, b) in a.iter().zip(b) {
        sum += f64x4::load_array_ref(simd, a) * f64x4::load_array_ref(simd, b);
    }
    sum_of_four(sum)
}

/// out_q = Σ_m M_qm right_m.
pub(crate) fn times(matrix: &[Four], right: &[Four], out: &mut [f64]) {
    #[inline(always)]
    fn on<S: Simd>(simd: S, matrix: &[Four], right: &[Four], out: &mut [f64]) {
        for (row, out) in matrix.chunks_exact(right.len()).zip(out) {
            *out = product(simd, row, right);
        }
    }
    if right.is_empty() {
        return out.fill(0.0);
    }
    dispatch!(level(), simd => on(simd, matrix, right, out));
}

/// out = Σ_k a_k row_k, of weights (k, a_k) and rows of `table` as long as `out`.
#[inline(always)]
pub(crate) fn mix_fours<S: Simd>(simd: S, weights: &[(u32, f64)], table: &[Four], out: &mut [Four]) {
    #[inline(always)]
    fn on<S: Simd, const N: usize>(
        simd: S,
        weights: &[(u32, f64)],
        (table, width, start): (&[Four], usize, usize),
        out: &mut [Four; N],
    ) {
        let mut sums = [f64x4::splat(simd, 0.0); N];
        for (k, a) in weights {
            for (sum, value) in sums.iter_mut().zip(&table[*k as usize * width + start..][..N]) {
                *sum += f64x4::load_array_ref(simd, value) * *a;
            }
        }
        for (out, sum) in out.iter_mut().zip(sums) {
            *out = sum.to_array();
        }
    }
    let width = out.len();
    let (threes, rest) = out.as_chunks_mut::<3>();
    let n = 3 * threes.len();
    for (i, out) in threes.iter_mut().enumerate() {
        on(simd, weights, (table, width, 3 * i), out);
    }
    for (i, out) in rest.as_chunks_mut::<1>().0.iter_mut().enumerate() {
        on(simd, weights, (table, width, n + i), out);
    }
}

/// Adds Σ_k a_k row_k.
pub(crate) fn add_rows(out: &mut [f64], rows: &[(f64, &[f64])]) {
    #[inline(always)]
    fn on<S: Simd>(simd: S, out: &mut [f64], rows: &[(f64, &[f64])]) {
        let (fours, rest) = out.as_chunks_mut::<4>();
        let n = fours.len();
        for (i, out) in fours.iter_mut().enumerate() {
            let mut sum = f64x4::load_array_ref(simd, out);
            for (a, row) in rows {
                sum += f64x4::load_array_ref(simd, &row.as_chunks::<4>().0[i]) * *a;
            }
            *out = sum.to_array();
        }
        for (i, out) in rest.iter_mut().enumerate() {
            rows.iter().for_each(|(a, row)| *out += row[4 * n + i] * a);
        }
    }
    dispatch!(level(), simd => on(simd, out, rows));
}

/// Σ_q a_q row_q of all replicates.
pub(crate) fn of_replicates(a: &[f64], rows: &[OfReplicates]) -> OfReplicates {
    #[inline(always)]
    fn on<S: Simd>(simd: S, a: &[f64], rows: &[OfReplicates]) -> OfReplicates {
        let mut sums = [f64x4::splat(simd, 0.0); REPLICATES / 4];
        for (a, row) in a.iter().zip(rows) {
            for (sum, row) in sums.iter_mut().zip(row.as_chunks::<4>().0) {
                *sum += f64x4::load_array_ref(simd, row) * *a;
            }
        }
        let mut out = [0.0; REPLICATES];
        out.as_chunks_mut::<4>().0.iter_mut().zip(sums).for_each(|(out, sum)| *out = sum.to_array());
        out
    }
    dispatch!(level(), simd => on(simd, a, rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(n: usize, seed: usize) -> Vec<f64> {
        (0..n).map(|i| ((i * 7919 + seed * 104_729 + i * i * 31) % 10_007) as f64 / 10_007.0 - 0.3).collect()
    }

    fn in_fours(rows: &[Vec<f64>]) -> Vec<Four> {
        let mut out = Vec::new();
        rows.iter().for_each(|row| extend_fours(&mut out, row.iter().copied()));
        out
    }

    /// All sums are what they say, for all sizes that a kernel tells apart, and the vectors that every machine has give the bits
    /// of those that this one has.
    #[test]
    fn sums_are_what_they_say_on_any_vectors() {
        for (n, m) in [(1, 1), (2, 3), (5, 4), (16, 5), (17, 9), (26, 12), (7, 13), (3, 22), (0, 4), (4, 0)] {
            let (left, right) = (numbers(n, 1), numbers(m, 2));
            let matrix: Vec<Vec<f64>> = (0..n).map(|q| numbers(m, 3 + q)).collect();
            let (matrix_fours, right_fours) = (in_fours(&matrix), in_fours(std::slice::from_ref(&right)));
            let of_row = |row: &Vec<f64>| row.iter().zip(&right).map(|(a, b)| a * b).sum::<f64>();
            let due: f64 = left.iter().zip(&matrix).map(|(left, row)| left * of_row(row)).sum();
            let own = |level: Level| {
                let (left, matrix, right) = (left.as_slice(), matrix_fours.as_slice(), right_fours.as_slice());
                dispatch!(level, simd => bilinear(simd, left, matrix, right))
            };
            assert!((own(level()) - due).abs() < 1e-14 * (1 + n * m) as f64, "{n} {m}");
            assert_eq!(own(level()).to_bits(), own(Level::baseline()).to_bits(), "{n} {m}");

            let mut found = vec![0.0; n];
            times(&matrix_fours, &right_fours, &mut found);
            assert!(found.iter().zip(&matrix).all(|(found, row)| (found - of_row(row)).abs() < 1e-14 * (1 + m) as f64));

            let width = fours(m);
            let weights: Vec<(u32, f64)> = left.iter().enumerate().map(|(q, a)| (q as u32, *a)).collect();
            let mixed = |level: Level| {
                let mut out = vec![[9.0; 4]; width];
                dispatch!(level, simd => mix_fours(simd, &weights, &matrix_fours, &mut out));
                out
            };
            let sum = |i: usize| matrix.iter().zip(&left).map(|(row, a)| row[i] * a).sum::<f64>();
            let out = mixed(level());
            assert!((0..m).all(|i| (out.as_flattened()[i] - sum(i)).abs() < 1e-14 * (1 + n) as f64));
            assert_eq!(out, mixed(Level::baseline()));

            let mut added = right.clone();
            let rows: Vec<(f64, &[f64])> = left.iter().copied().zip(matrix.iter().map(Vec::as_slice)).collect();
            add_rows(&mut added, &rows);
            assert!((0..m).all(|i| (added[i] - right[i] - sum(i)).abs() < 1e-14 * (1 + n) as f64));

            let rows: Vec<OfReplicates> =
                (0..n).map(|q| std::array::from_fn(|r| numbers(REPLICATES, 50 + q)[r])).collect();
            let all = of_replicates(&left, &rows);
            let of = |r: usize| left.iter().zip(&rows).map(|(a, row)| a * row[r]).sum::<f64>();
            assert!((0..REPLICATES).all(|r| (all[r] - of(r)).abs() < 1e-14 * (1 + n) as f64));
        }
    }
}
