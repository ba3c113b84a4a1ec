//! Rotations of triangles, or of patches, from their relative rotations across pairs.
//!
//! Given C_fg for pairs (f, g) and the rotation of one member of every connected part, the *root*, the matrices R minimise sum |R_g - R_f C_fg|_F^2, and
//! each is then replaced by its nearest rotation (after Lipman et al. 2005, whose frames these are). The rows of R decouple: 3 unknowns a member, three
//! right-hand sides.
//!
//! The C are first multiplied along a tree of pairs to rotations Q. With R = X Q the equations become X_g = X_f H with H = Q_f C_fg Q_g^T: the identity along
//! the tree, and everywhere where the C are consistent, as those of a frame are; X = I is the answer then. Otherwise the normal equations of X, 3 unknowns
//! a member and a pattern that depends on the pairs alone, are factored and refined once, so that their condition costs no accuracy.

use super::ShapeError;
use super::pool::Pool;
use crate::linalg::rotation::{IDENTITY, Matrix, nearest_rotation, times, times_transposed};
use crate::linalg::sparse::{Factor, Pattern};
use crate::mesh::topology::linked;

/// Pairs whose H are off the identity by no more are consistent: that much is rounding in thin triangles.
const CONSISTENT: f64 = 1e-12;
/// Solutions of the normal equations, each for what the ones before have left.
const SOLUTIONS: usize = 2;

/// The pairs of a set of members, prepared.
#[derive(Debug)]
pub struct Frames {
    pairs: Vec<[u32; 2]>,
    roots: Vec<u32>,
    tree: Vec<Step>,
    /// Of every member; that of roots is one past the last.
    unknowns: Vec<u32>,
    equations: Pattern,
    work: Pool<Work>,
}

/// From one end of a pair, which has its rotation, to the other.
#[derive(Clone, Copy, Debug)]
struct Step {
    pair: u32,
    /// To the second of the pair.
    forward: bool,
}

#[derive(Debug, Default)]
struct Work {
    /// H of every pair.
    loops: Vec<Matrix>,
    /// X of every unknown, and one more that stands for all roots.
    x: Vec<Matrix>,
    residual: Vec<Matrix>,
    values: Vec<f64>,
    factor: Option<Factor>,
    scratch: Vec<[f64; 4]>,
}

impl Frames {
    /// Prepares for pairs of different members, numbered from 0 and below `count`. Costs the analysis of a sparse
    /// system.
    pub fn new(count: usize, pairs: Vec<[u32; 2]>) -> Result<Self, ShapeError> {
        let (labels, parts) = linked(count, pairs.iter().copied());
        let mut roots = Vec::with_capacity(parts);
        let mut unknowns = vec![(count - parts) as u32; count];
        let mut next = 0..;
        for (member, &label) in labels.iter().enumerate() {
            if label as usize == roots.len() {
                roots.push(member as u32);
            } else if let Some(unknown) = next.next() {
                unknowns[member] = unknown;
            }
        }
        let free = count - parts;
        let places: Vec<[u32; 2]> = pairs
            .iter()
            .flat_map(|&pair| pair_coefficients(free, pair, &unknowns))
            .map(|(place, _)| place)
            .collect();
        Ok(Self {
            equations: Pattern::new(3 * free, &places)?,
            tree: tree(count, &pairs, &roots),
            pairs,
            roots,
            unknowns,
            work: Pool::default(),
        })
    }

    /// The lowest member of every part, ascending; a member of no pair is a part by itself.
    pub fn roots(&self) -> &[u32] {
        &self.roots
    }

    /// Fills in the rotation of every member, given those of the roots in `rotations` and the relative rotations, one a pair.
    ///
    /// Consistent rotations come back to rounding in O(P); others cost a sparse factorisation. An error where numbers beyond all bounds leave
    /// nothing to factor.
    pub fn solve(&self, relative: &[Matrix], rotations: &mut [Matrix]) -> Result<(), ShapeError> {
        self.follow_tree(relative, rotations);
        self.work.lend(|work| {
            work.loops.clear();
            let ends = |&[f, g]: &[u32; 2]| (&rotations[f as usize], &rotations[g as usize]);
            let both = self.pairs.iter().map(ends).zip(relative);
            work.loops
                .extend(both.map(|((f, g), c)| times_transposed(&times(f, c), g)));
            if work.loops.iter().all(is_consistent) {
                return Ok(());
            }
            self.least_squares(work)?;
            for (rotation, &unknown) in rotations.iter_mut().zip(&self.unknowns) {
                // That of roots is the identity.
                *rotation = nearest_rotation(&times(&work.x[unknown as usize], rotation));
            }
            Ok(())
        })
    }

    fn follow_tree(&self, relative: &[Matrix], rotations: &mut [Matrix]) {
        for &Step { pair, forward } in &self.tree {
            let [f, g] = self.pairs[pair as usize].map(|m| m as usize);
            let c = &relative[pair as usize];
            match forward {
                true => rotations[g] = times(&rotations[f], c),
                false => rotations[f] = times_transposed(&rotations[g], c),
            }
        }
    }

    /// X from X = I. A matrix is its columns, so that a list of them, flattened, is the unknowns with the rows of X side by side.
    fn least_squares(&self, work: &mut Work) -> Result<(), ShapeError> {
        let n = self.equations.size() / 3;
        work.values.clear();
        for (pair, h) in self.pairs.iter().zip(&work.loops) {
            let values = pair_coefficients(n, *pair, &self.unknowns).map(|(_, value)| value.of(h));
            work.values.extend(values);
        }
        match &mut work.factor {
            Some(factor) => factor.refactor(&work.values)?,
            none => *none = Some(self.equations.factor(&work.values)?),
        }
        work.x.clear();
        work.x.resize(n + 1, IDENTITY);
        work.residual.resize(n + 1, IDENTITY);
        for _ in 0..SOLUTIONS {
            self.multiply(&work.loops, &work.x, &mut work.residual);
            if let Some(factor) = &work.factor {
                factor.solve3(work.residual[..n].as_flattened_mut(), &mut work.scratch);
            }
            let steps = work.residual[..n].as_flattened().as_flattened();
            let x = work.x[..n].as_flattened_mut().as_flattened_mut();
            x.iter_mut().zip(steps).for_each(|(x, step)| *x -= step);
        }
        Ok(())
    }

    /// Half the derivative of sum |X_g - X_f H|^2 by the unknowns.
    fn multiply(&self, loops: &[Matrix], x: &[Matrix], out: &mut [Matrix]) {
        out.fill([[0.0; 3]; 3]);
        for ([f, g], h) in self.pairs.iter().zip(loops) {
            let [f, g] = [f, g].map(|&m| self.unknowns[m as usize] as usize);
            let carried = times(&x[f], h);
            let gap: Matrix =
                std::array::from_fn(|j| std::array::from_fn(|i| x[g][j][i] - carried[j][i]));
            let back = times_transposed(&gap, h);
            for j in 0..3 {
                for i in 0..3 {
                    out[g][j][i] += gap[j][i];
                    out[f][j][i] -= back[j][i];
                }
            }
        }
        // Roots stay.
        out[self.equations.size() / 3] = [[0.0; 3]; 3];
    }
}

fn is_consistent(h: &Matrix) -> bool {
    let gaps = h.as_flattened().iter().zip(IDENTITY.as_flattened());
    gaps.fold(true, |near, (a, b)| near & ((a - b).abs() <= CONSISTENT))
}

/// A coefficient of the normal equations, as H of its pair makes it.
enum Coefficient {
    One,
    /// -H[j][k].
    Minus([usize; 2]),
}

impl Coefficient {
    fn of(&self, h: &Matrix) -> f64 {
        match *self {
            Self::One => 1.0,
            Self::Minus([j, k]) => -h[j][k],
        }
    }
}

/// What a pair adds to the normal equations, and where: H is a rotation, so that both diagonal blocks are identities.
fn pair_coefficients(
    free: usize,
    pair: [u32; 2],
    unknowns: &[u32],
) -> impl Iterator<Item = ([u32; 2], Coefficient)> {
    let [f, g] = pair.map(|m| unknowns[m as usize]);
    let is_free = move |u: &u32| (*u as usize) < free;
    let diagonal = [f, g].into_iter().filter(is_free);
    let diagonal = diagonal.flat_map(|u| (0..3).map(move |j| ([3 * u + j; 2], Coefficient::One)));
    let both = is_free(&f) && is_free(&g);
    let across = (0..9).filter(move |_| both).map(move |i| {
        let [j, k] = [i / 3, i % 3];
        let place = [3 * g + j as u32, 3 * f + k as u32];
        (place, Coefficient::Minus([j, k]))
    });
    diagonal.chain(across)
}

/// Breadth first, so that paths are short and their errors small.
fn tree(count: usize, pairs: &[[u32; 2]], roots: &[u32]) -> Vec<Step> {
    let mut starts = vec![0usize; count + 1];
    for &member in pairs.as_flattened() {
        starts[member as usize] += 1;
    }
    let mut end = 0;
    for start in &mut starts {
        end += *start;
        *start = end;
    }
    let mut steps = vec![
        Step {
            pair: 0,
            forward: true
        };
        end
    ];
    for (pair, ends) in pairs.iter().enumerate().rev() {
        for (&member, forward) in ends.iter().zip([true, false]) {
            let start = &mut starts[member as usize];
            *start -= 1;
            steps[*start] = Step {
                pair: pair as u32,
                forward,
            };
        }
    }
    let mut reached = vec![false; count];
    for &root in roots {
        reached[root as usize] = true;
    }
    let mut queue = roots.to_vec();
    let mut tree = Vec::with_capacity(count - roots.len());
    let mut next = 0;
    while let Some(&member) = queue.get(next) {
        next += 1;
        for &step in &steps[starts[member as usize]..starts[member as usize + 1]] {
            let other = pairs[step.pair as usize][usize::from(step.forward)];
            if !std::mem::replace(&mut reached[other as usize], true) {
                tree.push(step);
                queue.push(other);
            }
        }
    }
    tree
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::rotation::exp;
    use nalgebra::{DMatrix, Matrix3};
    use proptest::prelude::*;

    /// Two triangles of pairs with a bridge, and a member by itself.
    const PAIRS: [[u32; 2]; 8] = [
        [0, 1],
        [1, 2],
        [0, 2],
        [2, 3],
        [3, 4],
        [4, 5],
        [3, 5],
        [1, 4],
    ];

    fn plain(m: &Matrix) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| m[j][i])
    }

    /// The normal equations of the whole system, root held, by a dense factorisation.
    fn dense(relative: &[Matrix], root: &Matrix) -> Vec<Matrix> {
        let mut system = DMatrix::zeros(3 * PAIRS.len(), 15);
        let mut right = DMatrix::zeros(3 * PAIRS.len(), 3);
        for (row, ([f, g], c)) in PAIRS.iter().zip(relative).enumerate() {
            // Transposed: R_g^T - C^T R_f^T.
            let c = plain(c).transpose();
            let root = plain(root).transpose();
            for (member, block) in [(*g, Matrix3::identity()), (*f, -c)] {
                match member {
                    0 => right
                        .view_mut((3 * row, 0), (3, 3))
                        .copy_from(&(-(block * root))),
                    m => system
                        .view_mut((3 * row, 3 * (m as usize - 1)), (3, 3))
                        .copy_from(&block),
                }
            }
        }
        let x = (system.transpose() * &system)
            .cholesky()
            .unwrap()
            .solve(&(system.transpose() * right));
        let block = |m: usize| -> Matrix {
            std::array::from_fn(|j| std::array::from_fn(|i| x[(3 * m + j, i)]))
        };
        (0..5).map(|m| nearest_rotation(&block(m))).collect()
    }

    proptest! {
        #[test]
        fn rotations_that_disagree_are_the_least_squares(vectors in prop::collection::vec(prop::array::uniform3(-0.6f64..0.6), 9)) {
            let frames = Frames::new(7, PAIRS.to_vec()).unwrap();
            prop_assert_eq!(frames.roots(), [0, 6]);
            let relative: Vec<Matrix> = vectors[..8].iter().map(|&v| exp(v)).collect();
            let mut found = vec![exp(vectors[8]); 7];
            frames.solve(&relative, &mut found).unwrap();
            for (found, expected) in found[1..].iter().zip(dense(&relative, &exp(vectors[8]))) {
                prop_assert!((plain(found) - plain(&expected)).amax() < 1e-10);
            }
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        let frames = Frames::new(7, PAIRS.to_vec()).unwrap();
        let refused = frames.solve(&[[[f64::NAN; 3]; 3]; 8], &mut [IDENTITY; 7]);
        assert!(matches!(refused, Err(ShapeError::Factor(_))), "{refused:?}");
    }
}
