//! Sparse symmetric positive definite systems: a pattern is analysed once, numbers are factored often, right-hand sides are solved often.
//!
//! P A P^T = L L^T, with a fill-reducing order P by approximate minimum degree and L (`elimination`), both by faer. The triangular solves are our own
//! (`sweeps`).

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::amd;
use thiserror::Error;

use super::compressed::Compressed;
use super::elimination::{Elimination, Unfactored};
use super::sweeps::Sweeps;

/// Why a sparse system has no factor.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum FactorError {
    /// A row or column that does not exist.
    #[error(
        "entry {entry} lies at ({row}, {column}), outside of a {n} x {n} matrix; rows and columns count from 0"
    )]
    OutOfRange {
        entry: usize,
        row: u32,
        column: u32,
        n: usize,
    },
    /// More or fewer values than the pattern has entries.
    #[error("expected {expected} values, one for each entry of the pattern, found {found}")]
    WrongLength { expected: usize, found: usize },
    /// A pivot that is not positive, or not a number.
    #[error(
        "the {n} x {n} matrix is not positive definite (pivot {pivot} in the order of elimination); \
         look for unknowns that nothing holds and for extreme values"
    )]
    NotPositiveDefinite { pivot: usize, n: usize },
    /// The factor needs more memory or larger indices than there are.
    #[error(
        "the factor of this {n} x {n} sparse matrix does not fit in memory or in 32-bit indices"
    )]
    TooLarge { n: usize },
}

impl FactorError {
    fn of(error: Unfactored, n: usize) -> Self {
        match error {
            Unfactored::TooLarge => Self::TooLarge { n },
            Unfactored::NotPositive { pivot } => Self::NotPositiveDefinite { pivot, n },
        }
    }
}

/// Where a symmetric matrix has entries, analysed.
#[derive(Clone, Debug)]
pub struct Pattern(Arc<Analysis>);

#[derive(Debug)]
struct Analysis {
    n: usize,
    /// `order[i]` is the given index of the unknown eliminated as number i.
    order: Vec<u32>,
    elimination: Elimination,
}

/// L for one set of values.
#[derive(Clone, Debug)]
pub struct Factor {
    analysis: Arc<Analysis>,
    /// L as it is factored, and as it is solved with.
    values: Vec<f64>,
    sweeps: Sweeps,
}

impl Pattern {
    /// Analyses an n x n symmetric matrix with these entries [row, column], 0-based. Each is given on one side of the diagonal only, either one; one
    /// that is given several times is the sum of its values. Costs an approximate minimum degree order, nearly linear for meshes.
    pub fn new(n: usize, entries: &[[u32; 2]]) -> Result<Self, FactorError> {
        let outside = |e: &[u32; 2]| e.iter().any(|&i| i as usize >= n);
        if let Some(entry) = entries.iter().position(outside) {
            let [row, column] = entries[entry];
            return Err(FactorError::OutOfRange {
                entry,
                row,
                column,
                n,
            });
        }
        if n.max(entries.len()) >= i32::MAX as usize {
            return Err(FactorError::TooLarge { n });
        }
        let given = Compressed::new(n, entries.iter().map(|&[r, c]| [r.min(c), r.max(c)]));
        let (order, position) = minimum_degree(&given)?;
        let moved = given.entries().map(|e| e.map(|i| position[i as usize]));
        let mut upper = Compressed::new(n, moved.map(|[r, c]| [r.min(c), r.max(c)]));
        let slots = given.slots.iter().map(|&s| upper.slots[s as usize]);
        upper.slots = slots.collect();
        let elimination = Elimination::new(upper);
        Ok(Self(Arc::new(Analysis {
            n,
            order,
            elimination: elimination.map_err(|e| FactorError::of(e, n))?,
        })))
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.0.n
    }

    /// Numbers kept for L, with the zeros in dense blocks where it has them.
    pub fn factor_len(&self) -> usize {
        self.0.elimination.factor_len()
    }

    /// Factors the matrix with these values, in the order of the entries.
    pub fn factor(&self, values: &[f64]) -> Result<Factor, FactorError> {
        let mut factor = Factor {
            analysis: self.0.clone(),
            values: vec![0.0; self.factor_len()],
            sweeps: Sweeps::default(),
        };
        let supernodes = self.0.elimination.supernodes(&factor.values);
        factor.sweeps.reserve(supernodes);
        factor.refactor(values)?;
        Ok(factor)
    }
}

impl Factor {
    /// Factors again with other values, in the memory of this factor. After an error the factor is of no use.
    pub fn refactor(&mut self, values: &[f64]) -> Result<(), FactorError> {
        let Analysis { n, elimination, .. } = &*self.analysis;
        let (n, expected) = (*n, elimination.value_count());
        if values.len() != expected {
            let found = values.len();
            return Err(FactorError::WrongLength { expected, found });
        }
        let factored = elimination.factor(values, &mut self.values);
        factored.map_err(|e| FactorError::of(e, n))?;
        self.sweeps.clear();
        for supernode in elimination.supernodes(&self.values) {
            self.sweeps.push(supernode);
        }
        Ok(())
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.analysis.n
    }

    /// Replaces three right-hand sides, side by side, by their solutions; `x` has n rows. `scratch` may hold anything and is used as memory.
    pub fn solve3(&self, x: &mut [[f64; 3]], scratch: &mut Vec<[f64; 4]>) {
        self.permuted(
            x,
            scratch,
            |[a, b, c]| [a, b, c, 0.0],
            |[a, b, c, _]| [a, b, c],
            Sweeps::solve4,
        );
    }

    /// Replaces one right-hand side by its solution.
    pub fn solve1(&self, x: &mut [f64], scratch: &mut Vec<[f64; 1]>) {
        self.permuted(x, scratch, |a| [a], |[a]| a, Sweeps::solve1);
    }

    fn permuted<T: Copy, L: Copy>(
        &self,
        x: &mut [T],
        scratch: &mut Vec<L>,
        widen: impl Fn(T) -> L,
        narrow: impl Fn(L) -> T,
        solve: impl Fn(&Sweeps, &mut [L]),
    ) {
        let order = &self.analysis.order;
        scratch.clear();
        scratch.extend(order.iter().map(|&i| widen(x[i as usize])));
        solve(&self.sweeps, scratch);
        for (&i, &solved) in order.iter().zip(scratch.iter()) {
            x[i as usize] = narrow(solved);
        }
    }
}

/// A fill-reducing order of the unknowns, and its inverse.
fn minimum_degree(upper: &Compressed) -> Result<(Vec<u32>, Vec<u32>), FactorError> {
    let n = upper.starts.len() - 1;
    let (mut order, mut position) = (vec![0; n], vec![0; n]);
    let scratch = amd::order_scratch::<u32>(n, upper.rows.len());
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| FactorError::TooLarge { n })?;
    amd::order(
        &mut order,
        &mut position,
        upper.pattern(n),
        Default::default(),
        MemStack::new(&mut memory),
    )
    .map_err(|_| FactorError::TooLarge { n })?;
    Ok((order, position))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A grid's Laplacian plus a share of the identity, entries split in two where they can be.
    fn grid(side: usize) -> (usize, Vec<[u32; 2]>, Vec<f64>) {
        let at = |x: usize, y: usize| (y * side + x) as u32;
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
            entries.extend([[at(x, y); 2]; 2]);
            values.extend([4.0, 0.01]);
            for other in [(x + 1, y), (x, y + 1)] {
                if other.0 < side && other.1 < side {
                    entries.push([at(x, y), at(other.0, other.1)]);
                    values.push(-1.0);
                }
            }
        }
        (side * side, entries, values)
    }

    fn times(entries: &[[u32; 2]], values: &[f64], x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; x.len()];
        for (&[r, c], v) in entries.iter().zip(values) {
            let (r, c) = (r as usize, c as usize);
            y[r] += v * x[c];
            if r != c {
                y[c] += v * x[r];
            }
        }
        y
    }

    #[test]
    fn grids_of_every_size() {
        for side in (0..24).chain([110]) {
            let (n, entries, values) = grid(side);
            let factor = Pattern::new(n, &entries).unwrap().factor(&values).unwrap();
            let columns: [Vec<f64>; 3] =
                std::array::from_fn(|k| (0..n).map(|i| ((i * (k + 3)) as f64).sin()).collect());
            let products = columns.each_ref().map(|x| times(&entries, &values, x));
            let mut three: Vec<[f64; 3]> =
                (0..n).map(|i| [0, 1, 2].map(|k| products[k][i])).collect();
            factor.solve3(&mut three, &mut Vec::new());
            for k in 0..3 {
                let mut one = products[k].clone();
                factor.solve1(&mut one, &mut Vec::new());
                for i in 0..n {
                    assert!(
                        (three[i][k] - columns[k][i]).abs() < 1e-12,
                        "{side} {i} {k}"
                    );
                    assert!((one[i] - columns[k][i]).abs() < 1e-12, "{side} {i} {k}");
                }
            }
        }
    }

    #[test]
    fn refusals_name_what_is_wrong() {
        let outside = Pattern::new(2, &[[0, 0], [2, 1]]).unwrap_err();
        assert_eq!(
            outside,
            FactorError::OutOfRange {
                entry: 1,
                row: 2,
                column: 1,
                n: 2
            }
        );
        let pattern = Pattern::new(2, &[[0, 0], [1, 0], [1, 1]]).unwrap();
        assert_eq!(
            pattern.factor(&[1.0]).unwrap_err(),
            FactorError::WrongLength {
                expected: 3,
                found: 1
            }
        );
        for singular in [
            [1.0, 1.0, 1.0],
            [1.0, 2.0, 1.0],
            [-1.0, 0.0, 1.0],
            [f64::NAN, 0.0, 1.0],
        ] {
            let found = pattern.factor(&singular).unwrap_err();
            assert!(
                matches!(found, FactorError::NotPositiveDefinite { n: 2, .. }),
                "{singular:?}: {found}"
            );
        }
        assert!(Pattern::new(2, &[[0, 0]]).unwrap().factor(&[1.0]).is_err());
    }

    proptest! {
        /// Random sparse matrices made positive definite by their diagonal, in any order of entries; the residual is small.
        #[test]
        fn the_residual_vanishes(
            n in 1usize..40,
            off in prop::collection::vec((0u32..40, 0u32..40, -1.0f64..1.0), 0..120),
            seed in 0u64..1000,
        ) {
            let off: Vec<_> = off.into_iter().filter(|&(r, c, _)| (r as usize) < n && (c as usize) < n && r != c).collect();
            let mut entries: Vec<[u32; 2]> = off.iter().map(|&(r, c, _)| [r, c]).collect();
            let mut values: Vec<f64> = off.iter().map(|&(_, _, v)| v).collect();
            for i in 0..n as u32 {
                let row: f64 = off.iter().filter(|&&(r, c, _)| r == i || c == i).map(|&(_, _, v)| v.abs()).sum();
                entries.push([i, i]);
                values.push(row + 0.1);
            }
            let x: Vec<f64> = (0..n).map(|i| ((i as u64 * 7 + seed) as f64).cos()).collect();
            let b = times(&entries, &values, &x);
            let factor = Pattern::new(n, &entries).unwrap().factor(&values).unwrap();
            let mut found = b.clone();
            factor.solve1(&mut found, &mut Vec::new());
            for (r, s) in times(&entries, &values, &found).iter().zip(&b) {
                prop_assert!((r - s).abs() < 1e-13 * 40.0);
            }
        }
    }
}
