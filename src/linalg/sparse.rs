//! Sparse symmetric positive definite systems: a pattern is analysed once, numbers are factored often, right-hand sides are solved often.
//!
//! P A P^T = L L^T, with a fill-reducing order P by approximate minimum degree and L kept in supernodes (runs of columns with one pattern of rows,
//! stored as dense column-major blocks), both by faer. The triangular solves are our own: right-hand sides are kept side by side, so that every
//! entry of L is read once a sweep for all of them.

use std::sync::Arc;

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::SymbolicSupernodalParams;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{simplicial, supernodal};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use thiserror::Error;

use super::kernels::{clear_upper_halves, vectorised};

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

/// Where a symmetric matrix has entries, analysed.
#[derive(Clone, Debug)]
pub struct Pattern(Arc<Analysis>);

#[derive(Debug)]
struct Analysis {
    n: usize,
    /// The lower triangle of P A P^T.
    lower: Compressed,
    /// `order[i]` is the given index of the unknown eliminated as number i.
    order: Vec<u32>,
    symbolic: supernodal::SymbolicSupernodalCholesky<u32>,
}

/// L for one set of values.
#[derive(Clone, Debug)]
pub struct Factor {
    analysis: Arc<Analysis>,
    values: Vec<f64>,
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
        let (order, position) =
            minimum_degree(&Compressed::new(n, entries, |[r, c]| [r.min(c), r.max(c)]))?;
        let moved = |[r, c]: [u32; 2]| [position[r as usize], position[c as usize]];
        let upper = Compressed::new(n, entries, |e| {
            let [r, c] = moved(e);
            [r.min(c), r.max(c)]
        });
        let lower = Compressed::new(n, entries, |e| {
            let [r, c] = moved(e);
            [r.max(c), r.min(c)]
        });
        let symbolic = supernodes(&upper)?;
        Ok(Self(Arc::new(Analysis {
            n,
            lower,
            order,
            symbolic,
        })))
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.0.n
    }

    /// Numbers kept for L, the zeros in its dense blocks included.
    pub fn factor_len(&self) -> usize {
        self.0.symbolic.len_val()
    }

    /// Factors the matrix with these values, in the order of the entries.
    pub fn factor(&self, values: &[f64]) -> Result<Factor, FactorError> {
        let mut factor = Factor {
            analysis: self.0.clone(),
            values: vec![0.0; self.factor_len()],
        };
        factor.refactor(values)?;
        Ok(factor)
    }
}

impl Factor {
    /// Factors again with other values, in the memory of this factor. After an error the factor is of no use.
    pub fn refactor(&mut self, values: &[f64]) -> Result<(), FactorError> {
        let Analysis {
            n, lower, symbolic, ..
        } = &*self.analysis;
        let n = *n;
        if values.len() != lower.slots.len() {
            return Err(FactorError::WrongLength {
                expected: lower.slots.len(),
                found: values.len(),
            });
        }
        let numbers = lower.gather(values);
        let scratch = supernodal::factorize_supernodal_numeric_llt_scratch::<u32, f64>(
            symbolic,
            Par::Seq,
            Default::default(),
        );
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| FactorError::TooLarge { n })?;
        let factored = supernodal::factorize_supernodal_numeric_llt(
            &mut self.values,
            SparseColMatRef::new(lower.pattern(n), &numbers),
            Default::default(),
            symbolic,
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        clear_upper_halves();
        match factored {
            Ok(_) => Ok(()),
            Err(LltError::NonPositivePivot { index }) => {
                Err(FactorError::NotPositiveDefinite { pivot: index, n })
            }
        }
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
            solve_four,
        );
    }

    /// Replaces one right-hand side by its solution.
    pub fn solve1(&self, x: &mut [f64], scratch: &mut Vec<[f64; 1]>) {
        self.permuted(x, scratch, |a| [a], |[a]| a, solve_one);
    }

    fn permuted<T: Copy, L: Copy>(
        &self,
        x: &mut [T],
        scratch: &mut Vec<L>,
        widen: impl Fn(T) -> L,
        narrow: impl Fn(L) -> T,
        solve: impl Fn(&Analysis, &[f64], &mut [L]),
    ) {
        let order = &self.analysis.order;
        scratch.clear();
        scratch.extend(order.iter().map(|&i| widen(x[i as usize])));
        solve(&self.analysis, &self.values, scratch);
        for (&i, &solved) in order.iter().zip(scratch.iter()) {
            x[i as usize] = narrow(solved);
        }
    }
}

vectorised! {
    /// Four right-hand sides.
    fn solve_four(analysis: &Analysis, values: &[f64], x: &mut [[f64; 4]]) {
        forward(analysis, values, x);
        backward(analysis, values, x);
    }
}

vectorised! {
    /// One right-hand side.
    fn solve_one(analysis: &Analysis, values: &[f64], x: &mut [[f64; 1]]) {
        forward(analysis, values, x);
        backward(analysis, values, x);
    }
}

/// Columns of L taken together in a sweep.
const WIDTH: usize = 4;

/// L y = b.
#[inline(always)]
fn forward<const N: usize>(analysis: &Analysis, values: &[f64], x: &mut [[f64; N]]) {
    for s in 0..analysis.symbolic.n_supernodes() {
        let block = Block::new(analysis, values, s);
        for first in (0..block.columns).step_by(WIDTH) {
            let last = (first + WIDTH).min(block.columns);
            for j in first..last {
                let column = block.column(j);
                let pivot = 1.0 / column[j];
                x[block.start + j] = x[block.start + j].map(|v| v * pivot);
                let y = x[block.start + j];
                for i in j + 1..last {
                    minus(&mut x[block.start + i], column[i], y);
                }
            }
            match last - first {
                4 => block.push::<4, N>(first, x),
                3 => block.push::<3, N>(first, x),
                2 => block.push::<2, N>(first, x),
                _ => block.push::<1, N>(first, x),
            }
        }
    }
}

/// L^T x = y.
#[inline(always)]
fn backward<const N: usize>(analysis: &Analysis, values: &[f64], x: &mut [[f64; N]]) {
    for s in (0..analysis.symbolic.n_supernodes()).rev() {
        let block = Block::new(analysis, values, s);
        for first in (0..block.columns).step_by(WIDTH).rev() {
            let last = (first + WIDTH).min(block.columns);
            match last - first {
                4 => block.pull::<4, N>(first, x),
                3 => block.pull::<3, N>(first, x),
                2 => block.pull::<2, N>(first, x),
                _ => block.pull::<1, N>(first, x),
            }
            for j in (first..last).rev() {
                let column = block.column(j);
                let mut y = x[block.start + j];
                for i in j + 1..last {
                    minus(&mut y, column[i], x[block.start + i]);
                }
                let pivot = 1.0 / column[j];
                x[block.start + j] = y.map(|v| v * pivot);
            }
        }
    }
}

/// A supernode: `columns` columns of L from `start` on, each with the rows of the diagonal block and then those of `pattern`.
struct Block<'a> {
    start: usize,
    columns: usize,
    pattern: &'a [u32],
    values: &'a [f64],
}

impl<'a> Block<'a> {
    #[inline(always)]
    fn new(analysis: &'a Analysis, values: &'a [f64], s: usize) -> Self {
        let symbolic = &analysis.symbolic;
        let start = symbolic.supernode_begin()[s] as usize;
        let rows = symbolic.col_ptr_for_row_idx()[s] as usize
            ..symbolic.col_ptr_for_row_idx()[s + 1] as usize;
        let numbers =
            symbolic.col_ptr_for_val()[s] as usize..symbolic.col_ptr_for_val()[s + 1] as usize;
        Self {
            start,
            columns: symbolic.supernode_end()[s] as usize - start,
            pattern: &symbolic.row_idx()[rows],
            values: &values[numbers],
        }
    }

    #[inline(always)]
    fn column(&self, j: usize) -> &'a [f64] {
        let rows = self.columns + self.pattern.len();
        &self.values[j * rows..(j + 1) * rows]
    }

    /// Subtracts W solved columns from the rows below them.
    #[inline(always)]
    fn push<const W: usize, const N: usize>(&self, first: usize, x: &mut [[f64; N]]) {
        let y: [[f64; N]; W] = std::array::from_fn(|w| x[self.start + first + w]);
        let split = |w: usize| self.column(first + w).split_at(self.columns);
        let inside: [&[f64]; W] = std::array::from_fn(|w| split(w).0);
        let below: [&[f64]; W] = std::array::from_fn(|w| &split(w).1[..self.pattern.len()]);
        for i in first + W..self.columns {
            let target = &mut x[self.start + i];
            for w in 0..W {
                minus(target, inside[w][i], y[w]);
            }
        }
        for (i, &row) in self.pattern.iter().enumerate() {
            let target = &mut x[row as usize];
            for w in 0..W {
                minus(target, below[w][i], y[w]);
            }
        }
    }

    /// Subtracts the rows below W columns from their unknowns.
    #[inline(always)]
    fn pull<const W: usize, const N: usize>(&self, first: usize, x: &mut [[f64; N]]) {
        let mut y: [[f64; N]; W] = std::array::from_fn(|w| x[self.start + first + w]);
        let split = |w: usize| self.column(first + w).split_at(self.columns);
        let inside: [&[f64]; W] = std::array::from_fn(|w| split(w).0);
        let below: [&[f64]; W] = std::array::from_fn(|w| &split(w).1[..self.pattern.len()]);
        for i in first + W..self.columns {
            for w in 0..W {
                minus(&mut y[w], inside[w][i], x[self.start + i]);
            }
        }
        for (i, &row) in self.pattern.iter().enumerate() {
            let solved = x[row as usize];
            for w in 0..W {
                minus(&mut y[w], below[w][i], solved);
            }
        }
        x[self.start + first..self.start + first + W].copy_from_slice(&y);
    }
}

/// y -= a x.
#[inline(always)]
fn minus<const N: usize>(y: &mut [f64; N], a: f64, x: [f64; N]) {
    for lane in 0..N {
        y[lane] -= a * x[lane];
    }
}

/// Entries by columns, rows ascending.
#[derive(Debug)]
struct Compressed {
    starts: Vec<u32>,
    rows: Vec<u32>,
    /// Where the value of each given entry goes.
    slots: Vec<u32>,
}

impl Compressed {
    /// Sorts the entries [row, column] that `place` makes of the given ones, by counting; equal ones share a slot.
    fn new(n: usize, entries: &[[u32; 2]], place: impl Fn([u32; 2]) -> [u32; 2]) -> Self {
        let placed: Vec<[u32; 2]> = entries.iter().map(|&e| place(e)).collect();
        let given: Vec<u32> = (0..entries.len() as u32).collect();
        let by_row = counting_sort(n, &given, |e| placed[e as usize][0]);
        let sorted = counting_sort(n, &by_row, |e| placed[e as usize][1]);
        let mut starts = vec![0; n + 1];
        let mut rows = Vec::new();
        let mut slots = vec![0; entries.len()];
        let mut before = None;
        for &e in &sorted {
            let [row, column] = placed[e as usize];
            if before != Some([row, column]) {
                rows.push(row);
                starts[column as usize + 1] += 1;
                before = Some([row, column]);
            }
            slots[e as usize] = rows.len() as u32 - 1;
        }
        for j in 0..n {
            starts[j + 1] += starts[j];
        }
        Self {
            starts,
            rows,
            slots,
        }
    }

    fn pattern(&self, n: usize) -> SymbolicSparseColMatRef<'_, u32> {
        SymbolicSparseColMatRef::new_checked(n, n, &self.starts, None, &self.rows)
    }

    fn gather(&self, values: &[f64]) -> Vec<f64> {
        let mut gathered = vec![0.0; self.rows.len()];
        for (&slot, value) in self.slots.iter().zip(values) {
            gathered[slot as usize] += value;
        }
        gathered
    }
}

/// Items ordered by a key below n; equal keys keep their order.
fn counting_sort(n: usize, items: &[u32], key: impl Fn(u32) -> u32) -> Vec<u32> {
    let mut next = vec![0usize; n + 1];
    for &item in items {
        next[key(item) as usize + 1] += 1;
    }
    for k in 0..n {
        next[k + 1] += next[k];
    }
    let mut sorted = vec![0; items.len()];
    for &item in items {
        let place = &mut next[key(item) as usize];
        sorted[*place] = item;
        *place += 1;
    }
    sorted
}

/// A fill-reducing order of the unknowns, and its inverse.
fn minimum_degree(upper: &Compressed) -> Result<(Vec<u32>, Vec<u32>), FactorError> {
    let n = upper.starts.len() - 1;
    let (mut order, mut position) = (vec![0; n], vec![0; n]);
    let mut memory = buffer(n, amd::order_scratch::<u32>(n, upper.rows.len()))?;
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

/// The supernodes of L.
fn supernodes(
    upper: &Compressed,
) -> Result<supernodal::SymbolicSupernodalCholesky<u32>, FactorError> {
    let n = upper.starts.len() - 1;
    let scratch = StackReq::any_of(&[
        simplicial::prefactorize_symbolic_cholesky_scratch::<u32>(n, upper.rows.len()),
        supernodal::factorize_supernodal_symbolic_cholesky_scratch::<u32>(n),
    ]);
    let mut memory = buffer(n, scratch)?;
    let (mut tree, mut counts) = (vec![0; n], vec![0; n]);
    let tree = simplicial::prefactorize_symbolic_cholesky::<u32>(
        &mut tree,
        &mut counts,
        upper.pattern(n),
        MemStack::new(&mut memory),
    );
    supernodal::factorize_supernodal_symbolic_cholesky(
        upper.pattern(n),
        tree,
        &counts,
        MemStack::new(&mut memory),
        SymbolicSupernodalParams::default(),
    )
    .map_err(|_| FactorError::TooLarge { n })
}

fn buffer(n: usize, scratch: StackReq) -> Result<MemBuffer, FactorError> {
    MemBuffer::try_new(scratch).map_err(|_| FactorError::TooLarge { n })
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
        for side in 0..24 {
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
