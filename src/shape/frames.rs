//! Rotations of triangles, or of patches, from their relative rotations across pairs.
//!
//! Given C_fg for pairs (f, g) and the rotation of one member of every connected part, the *root*, the matrices R minimise sum |R_g - R_f C_fg|_F^2, and
//! each is then replaced by its nearest rotation (after Lipman et al. 2005, whose frames these are). The rows of R decouple: 3 unknowns a member, three
//! right-hand sides.
//!
//! The C enter that system's matrix, which would have to be factored for every frame. Instead the C are multiplied along a tree of pairs to rotations Q, and
//! with R = X Q the equations become X_g = X_f H with H = Q_f C_fg Q_g^T: the identity along the tree, and everywhere where the C are consistent, so that
//! X = I is the answer already. What is left is found by conjugate gradients, preconditioned by the system for H = I: a graph's Laplacian of 1 unknown a
//! member, which depends on the pairs alone and is factored once.

use super::ShapeError;
use super::pool::Pool;
use crate::linalg::rotation::{IDENTITY, Matrix, nearest_rotation, times, times_transposed};
use crate::linalg::sparse::{Factor, Pattern};
use crate::mesh::topology::linked;

/// Conjugate gradients stop where the preconditioned residual, which is about the error that is left, is below this in every entry of X.
const TOLERANCE: f64 = 1e-13;

/// The pairs of a set of members, prepared.
#[derive(Debug)]
pub struct Frames {
    pairs: Vec<[u32; 2]>,
    roots: Vec<u32>,
    tree: Vec<Step>,
    /// Of every member; that of roots is one past the last.
    unknowns: Vec<u32>,
    laplacian: Factor,
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
    /// Of every unknown, and one more that stands for all roots.
    x: Vec<Matrix>,
    residual: Vec<Matrix>,
    preconditioned: Vec<Matrix>,
    direction: Vec<Matrix>,
    image: Vec<Matrix>,
    column: Vec<[f64; 3]>,
    scratch: Vec<[f64; 4]>,
}

impl Frames {
    /// Prepares for pairs of different members, numbered from 0 and below `count`. Costs a sparse factorisation.
    pub fn new(count: usize, pairs: Vec<[u32; 2]>) -> Result<Self, ShapeError> {
        let (labels, parts) = linked(count, pairs.iter().copied());
        let mut roots = Vec::with_capacity(parts);
        let mut unknowns = vec![(count - parts) as u32; count];
        let mut free = 0..;
        for (member, &label) in labels.iter().enumerate() {
            if label as usize == roots.len() {
                roots.push(member as u32);
            } else if let Some(unknown) = free.next() {
                unknowns[member] = unknown;
            }
        }
        let laplacian = laplacian(count - parts, &pairs, &unknowns)?;
        Ok(Self {
            tree: tree(count, &pairs, &roots),
            pairs,
            roots,
            unknowns,
            laplacian,
            work: Pool::default(),
        })
    }

    /// The lowest member of every part, ascending; a member of no pair is a part by itself.
    pub fn roots(&self) -> &[u32] {
        &self.roots
    }

    /// Fills in the rotation of every member, given those of the roots in `rotations` and the relative rotations, one a pair. Returns the number of
    /// steps of conjugate gradients: 0 for consistent ones.
    ///
    /// Consistent rotations come back to rounding. O(P) and three triangular solves a step.
    pub fn solve(&self, relative: &[Matrix], rotations: &mut [Matrix]) -> usize {
        self.follow_tree(relative, rotations);
        self.work.lend(|work| {
            work.loops.clear();
            let ends = |&[f, g]: &[u32; 2]| (&rotations[f as usize], &rotations[g as usize]);
            let both = self.pairs.iter().map(ends).zip(relative);
            work.loops
                .extend(both.map(|((f, g), c)| times_transposed(&times(f, c), g)));
            let steps = self.conjugate_gradients(work);
            for (rotation, &unknown) in rotations.iter_mut().zip(&self.unknowns) {
                if (unknown as usize) < self.laplacian.size() {
                    *rotation = nearest_rotation(&times(&work.x[unknown as usize], rotation));
                }
            }
            steps
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

    /// Solves for X, from X = I; the rows of X are systems of their own and have their own step lengths.
    fn conjugate_gradients(&self, work: &mut Work) -> usize {
        let n = self.laplacian.size();
        let fields = [
            &mut work.x,
            &mut work.residual,
            &mut work.preconditioned,
            &mut work.direction,
            &mut work.image,
        ];
        for field in fields {
            field.clear();
            field.resize(n + 1, [[0.0; 3]; 3]);
        }
        work.x.fill(IDENTITY);
        self.multiply(&work.loops, &work.x, &mut work.residual);
        for r in work.residual.as_flattened_mut().as_flattened_mut() {
            *r = -*r;
        }
        let mut before = [1.0; 3];
        for step in 0.. {
            let error = self.precondition(work);
            if error <= TOLERANCE {
                add(&mut work.x, [1.0; 3], &work.preconditioned);
                return step;
            }
            let product = inner(&work.residual, &work.preconditioned);
            let ratio: [f64; 3] = std::array::from_fn(|i| product[i] / before[i]);
            for (p, z) in work.direction.iter_mut().zip(&work.preconditioned) {
                for j in 0..3 {
                    for i in 0..3 {
                        p[j][i] = z[j][i] + ratio[i] * p[j][i];
                    }
                }
            }
            self.multiply(&work.loops, &work.direction, &mut work.image);
            let energy = inner(&work.direction, &work.image);
            let length = std::array::from_fn(|i| {
                if energy[i] > 0.0 {
                    product[i] / energy[i]
                } else {
                    0.0
                }
            });
            add(&mut work.x, length, &work.direction);
            add(&mut work.residual, length.map(|l| -l), &work.image);
            before = product.map(|p| if p > 0.0 { p } else { 1.0 });
            if step > 20000 {
                return step;
            }
        }
        0
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
        out[self.laplacian.size()] = [[0.0; 3]; 3];
    }

    /// Solves with the Laplacian; the largest entry of the result.
    fn precondition(&self, work: &mut Work) -> f64 {
        let n = self.laplacian.size();
        let mut largest = 0.0f64;
        for j in 0..3 {
            work.column.clear();
            work.column.extend(work.residual[..n].iter().map(|r| r[j]));
            self.laplacian.solve3(&mut work.column, &mut work.scratch);
            for (z, solved) in work.preconditioned.iter_mut().zip(&work.column) {
                z[j] = *solved;
                largest = solved.iter().fold(largest, |most, x| most.max(x.abs()));
            }
        }
        largest
    }
}

/// y += a x, row by row.
fn add(y: &mut [Matrix], a: [f64; 3], x: &[Matrix]) {
    for (y, x) in y.iter_mut().zip(x) {
        for j in 0..3 {
            for i in 0..3 {
                y[j][i] += a[i] * x[j][i];
            }
        }
    }
}

/// The inner products of the rows.
fn inner(x: &[Matrix], y: &[Matrix]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (x, y) in x.iter().zip(y) {
        for i in 0..3 {
            sums[i] += (x[0][i] * y[0][i] + x[1][i] * y[1][i]) + x[2][i] * y[2][i];
        }
    }
    sums
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

fn laplacian(n: usize, pairs: &[[u32; 2]], unknowns: &[u32]) -> Result<Factor, ShapeError> {
    let (mut entries, mut values) = (Vec::new(), Vec::new());
    for pair in pairs {
        let [f, g] = pair.map(|m| unknowns[m as usize]);
        for (entry, value) in [([f, f], 1.0), ([g, g], 1.0), ([f, g], -1.0)] {
            if entry.iter().all(|&i| (i as usize) < n) {
                entries.push(entry);
                values.push(value);
            }
        }
    }
    Ok(Pattern::new(n, &entries)?.factor(&values)?)
}
