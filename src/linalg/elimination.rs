//! The factor of a sparse symmetric matrix whose unknowns are in the order of elimination, by faer, in one of two ways.
//!
//! Column by column, or in supernodes (runs of columns with one pattern of rows, as dense blocks) where a number of L costs enough arithmetic for blocks to pay
//! (Chen, Davis, Hager & Rajamanickam 2008, section 3.3).

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::SymbolicSupernodalParams;
use faer::sparse::linalg::cholesky::{simplicial, supernodal};

use super::compressed::Compressed;
use super::kernels::clear_upper_halves;
use super::sweeps::Supernode;

/// From so many multiplications a number of L on, blocks are used: as CHOLMOD decides it.
const BLOCKS_PAY: f64 = 40.0;

/// Why there is no factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfactored {
    /// No memory for it, or no indices.
    TooLarge,
    /// The pivot, in the order of elimination, that is not positive.
    NotPositive { pivot: usize },
}

/// Where L has entries, and how its numbers are found.
#[derive(Debug)]
pub struct Elimination {
    /// The triangle of the matrix that `way` reads.
    matrix: Compressed,
    way: Way,
}

#[derive(Debug)]
enum Way {
    /// With the first column of each run of columns with one pattern, and one past the last. Reads the upper triangle.
    Columns(simplicial::SymbolicSimplicialCholesky<u32>, Vec<u32>),
    /// Reads the lower triangle.
    Blocks(supernodal::SymbolicSupernodalCholesky<u32>),
}

impl Elimination {
    /// Of a matrix with this upper triangle, n x n. An error where the factor does not fit in memory.
    pub fn new(upper: Compressed) -> Result<Self, Unfactored> {
        let n = upper.starts.len() - 1;
        let scratch = StackReq::any_of(&[
            simplicial::prefactorize_symbolic_cholesky_scratch::<u32>(n, upper.rows.len()),
            simplicial::factorize_simplicial_symbolic_cholesky_scratch::<u32>(n),
            supernodal::factorize_supernodal_symbolic_cholesky_scratch::<u32>(n),
        ]);
        let mut memory = buffer(scratch)?;
        let stack = MemStack::new(&mut memory);
        let (mut tree, mut counts) = (vec![0; n], vec![0; n]);
        let pattern = upper.pattern(n);
        let tree = simplicial::prefactorize_symbolic_cholesky::<u32>(
            &mut tree,
            &mut counts,
            pattern,
            stack,
        );
        let sum = |term: fn(f64) -> f64| counts.iter().map(|&c| term(f64::from(c))).sum::<f64>();
        if sum(|count| count * count) < BLOCKS_PAY * sum(|count| count) {
            let symbolic =
                simplicial::factorize_simplicial_symbolic_cholesky(pattern, tree, &counts, stack)
                    .map_err(|_| Unfactored::TooLarge)?;
            let runs = runs(symbolic.col_ptr(), symbolic.row_idx());
            return Ok(Self {
                matrix: upper,
                way: Way::Columns(symbolic, runs),
            });
        }
        let symbolic = supernodal::factorize_supernodal_symbolic_cholesky(
            pattern,
            tree,
            &counts,
            stack,
            SymbolicSupernodalParams::default(),
        );
        Ok(Self {
            way: Way::Blocks(symbolic.map_err(|_| Unfactored::TooLarge)?),
            matrix: upper.transpose(),
        })
    }

    /// Numbers kept for L.
    pub fn factor_len(&self) -> usize {
        match &self.way {
            Way::Columns(symbolic, _) => symbolic.len_val(),
            Way::Blocks(symbolic) => symbolic.len_val(),
        }
    }

    /// How many values the matrix is given by.
    pub fn value_count(&self) -> usize {
        self.matrix.slots.len()
    }

    /// Writes L, `factor_len` numbers, for values in the order of the entries that the matrix was compressed from.
    pub fn factor(&self, values: &[f64], l: &mut [f64]) -> Result<(), Unfactored> {
        let n = self.matrix.starts.len() - 1;
        let numbers = self.matrix.gather(values);
        let a = SparseColMatRef::new(self.matrix.pattern(n), &numbers);
        let factored = match &self.way {
            Way::Columns(symbolic, _) => {
                let scratch = simplicial::factorize_simplicial_numeric_llt_scratch::<u32, f64>(n);
                simplicial::factorize_simplicial_numeric_llt(
                    l,
                    a,
                    Default::default(),
                    symbolic,
                    MemStack::new(&mut buffer(scratch)?),
                )
            }
            Way::Blocks(symbolic) => {
                let scratch = supernodal::factorize_supernodal_numeric_llt_scratch::<u32, f64>(
                    symbolic,
                    Par::Seq,
                    Default::default(),
                );
                supernodal::factorize_supernodal_numeric_llt(
                    l,
                    a,
                    Default::default(),
                    symbolic,
                    Par::Seq,
                    MemStack::new(&mut buffer(scratch)?),
                    Default::default(),
                )
            }
        };
        clear_upper_halves();
        factored
            .map(|_| ())
            .map_err(
                |LltError::NonPositivePivot { index: pivot }| Unfactored::NotPositive { pivot },
            )
    }

    /// The runs of columns of L with one pattern, in the order of elimination.
    pub fn supernodes<'a>(&'a self, l: &'a [f64]) -> impl Iterator<Item = Supernode<'a>> {
        let count = match &self.way {
            Way::Columns(_, runs) => runs.len() - 1,
            Way::Blocks(symbolic) => symbolic.n_supernodes(),
        };
        (0..count).map(move |s| match &self.way {
            Way::Columns(symbolic, runs) => {
                let [first, end] = [runs[s] as usize, runs[s + 1] as usize];
                let starts = |column: usize| symbolic.col_ptr()[column] as usize;
                Supernode {
                    first,
                    columns: end - first,
                    pattern: &symbolic.row_idx()[starts(end - 1) + 1..starts(end)],
                    values: &l[starts(first)..starts(end)],
                    packed: true,
                }
            }
            Way::Blocks(symbolic) => {
                let first = symbolic.supernode_begin()[s] as usize;
                let between = |starts: &[u32]| starts[s] as usize..starts[s + 1] as usize;
                Supernode {
                    first,
                    columns: symbolic.supernode_end()[s] as usize - first,
                    pattern: &symbolic.row_idx()[between(symbolic.col_ptr_for_row_idx())],
                    values: &l[between(symbolic.col_ptr_for_val())],
                    packed: false,
                }
            }
        })
    }
}

/// Where runs of columns begin of which each has the rows of the one before without its first, and the number of columns.
fn runs(starts: &[u32], rows: &[u32]) -> Vec<u32> {
    let n = starts.len() - 1;
    let height = |j: usize| starts[j + 1] - starts[j];
    let goes_on =
        |j: usize| height(j) + 1 == height(j - 1) && rows[starts[j - 1] as usize + 1] as usize == j;
    let begins = (0..n).filter(|&j| j == 0 || !goes_on(j));
    begins.chain([n]).map(|j| j as u32).collect()
}

fn buffer(scratch: StackReq) -> Result<MemBuffer, Unfactored> {
    MemBuffer::try_new(scratch).map_err(|_| Unfactored::TooLarge)
}
