//! The Gauss-Newton equations of the control points and sites, with g and h projected out (Golub & Pereyra 1973, in Kaufman's form of 1975).

use faer::{Accum, Mat, MatRef};

use super::projection::{Problem, Projection, Unknowns, scale_rows};
use crate::linalg::banded::BAND;
use crate::linalg::dense::{Cholesky, multiply};
use crate::linalg::entry::{Eight, Entry};
use crate::linalg::kernels::LANES;
use crate::signal::basis::Local;
use crate::signal::thin_plate::kernel_gradients;

/// A diagonal entry below this share of the greatest is damped like that one.
const LEAST_DIAGONAL: f64 = 1e-12;

/// J^T J and J^T E for the unknowns x of all control points, y of all control points and, unless they are held, x of all sites, y of all sites.
///
/// With P the projection on the columns of A, moving one unknown moves the residual by -(I - P) (dA) C H^T to first order: the rest is what g and h
/// make up for. All of it lies in the m dimensions of H. A site's functions keep the side conditions because its move is made up for by the least
/// change of all coefficients that does so.
pub(super) struct Normal {
    pub matrix: Mat<f64>,
    /// J^T E: minus half of the gradient of the error.
    pub descent: Mat<f64>,
}

impl Normal {
    /// O(R^2 (l + m) + R l^2), whatever the number of vertices.
    pub fn new(problem: &Problem, unknowns: &Unknowns, projection: &Projection) -> Self {
        let gradients = gradients(problem, unknowns, projection);
        let moves = Moves::new(problem, projection, gradients.as_ref());
        let k = unknowns.control.len();
        let l = match problem.sites_held {
            true => 0,
            false => unknowns.sites.len(),
        };
        let mut normal = Self {
            matrix: Mat::zeros(2 * (k + l), 2 * (k + l)),
            descent: Mat::zeros(2 * (k + l), 1),
        };
        normal.add_controls(problem, &moves, k);
        if !problem.sites_held {
            let shifts = Shifts::new(problem, projection, gradients.as_ref());
            normal.add_sites(&moves, &shifts, 2 * k);
            normal.add_mixed(problem, &moves, &shifts, 2 * k);
        }
        normal
    }

    fn add_controls(&mut self, problem: &Problem, moves: &Moves, k: usize) {
        for (a, b) in [(0, 0), (1, 0), (1, 1)] {
            let mut inner = product(moves.slopes[a].as_ref(), moves.slopes[b].transpose());
            for (column, outside) in inner.col_iter_mut().zip(moves.outside.col_iter()) {
                column
                    .iter_mut()
                    .zip(outside.iter())
                    .for_each(|(x, share)| *x *= share);
            }
            let half = gather_rows(&problem.splines, inner.as_ref(), k);
            let block = gather_rows(&problem.splines, half.transpose(), k);
            let mut place = self.matrix.get_mut(a * k..(a + 1) * k, b * k..(b + 1) * k);
            place.copy_from(block.transpose());
        }
        for a in 0..2 {
            let change = moves.slopes[a].row_iter().zip(moves.residual.row_iter());
            let change: Vec<f64> = change
                .map(|(slope, left)| slope * left.transpose())
                .collect();
            let gathered = gather_rows(
                &problem.splines,
                MatRef::from_column_major_slice(&change, change.len(), 1),
                k,
            );
            self.descent
                .get_mut(a * k..(a + 1) * k, ..)
                .copy_from(gathered);
        }
    }

    fn add_sites(&mut self, moves: &Moves, shifts: &Shifts, first: usize) {
        let l = moves.weights.nrows();
        let inner = product(shifts.outside.transpose(), shifts.outside.as_ref());
        let weights = product(moves.weights.as_ref(), moves.weights.transpose());
        for j in 0..2 * l {
            for i in 0..2 * l {
                self.matrix[(first + i, first + j)] = inner[(i, j)] * weights[(i % l, j % l)];
            }
        }
        let change = product(shifts.outside.transpose(), moves.residual_outside.as_ref());
        for i in 0..2 * l {
            self.descent[(first + i, 0)] = change.row(i) * moves.weights.row(i % l).transpose();
        }
    }

    fn add_mixed(&mut self, problem: &Problem, moves: &Moves, shifts: &Shifts, first: usize) {
        let (l, k) = (moves.weights.nrows(), first / 2);
        for a in 0..2 {
            let along = product(moves.slopes[a].as_ref(), moves.weights.transpose());
            let inner = Mat::from_fn(along.nrows(), 2 * l, |row, i| {
                along[(row, i % l)] * shifts.rows[(row, i)]
            });
            let block = gather_rows(&problem.splines, inner.as_ref(), k);
            let mut place = self.matrix.get_mut(first.., a * k..(a + 1) * k);
            place.copy_from(block.transpose());
        }
    }

    /// The step that J^T J, its diagonal enlarged by the share `damping`, asks for; None where it is not positive.
    pub fn step(&self, damping: f64) -> Option<Mat<f64>> {
        let n = self.matrix.nrows();
        let most = (0..n).map(|i| self.matrix[(i, i)]).fold(0.0, f64::max);
        let mut damped = self.matrix.clone();
        for i in 0..n {
            damped[(i, i)] += damping * self.matrix[(i, i)].max(LEAST_DIAGONAL * most);
        }
        let mut step = self.descent.clone();
        Cholesky::new(damped)?.solve(step.col_as_slice_mut(0));
        Some(step)
    }

    /// What the linearised problem promises a step to take off the error.
    pub fn promise(&self, step: &Mat<f64>) -> f64 {
        let n = self.matrix.nrows();
        let along = |i: usize| {
            let below: f64 = (0..i).map(|j| self.matrix[(i, j)] * step[(j, 0)]).sum();
            (2.0 * below + self.matrix[(i, i)] * step[(i, 0)]) * step[(i, 0)]
        };
        2.0 * (self.descent.transpose() * step)[(0, 0)] - (0..n).map(along).sum::<f64>()
    }

    /// The norm of the gradient of the error.
    pub fn gradient(&self) -> f64 {
        2.0 * self.descent.norm_l2()
    }
}

/// How the rows move with the control points, and what is left of them.
struct Moves {
    /// R x m, for x and y: g along the plane at each row.
    slopes: [Mat<f64>; 2],
    /// l x m: the weights g_j of the kernels.
    weights: Mat<f64>,
    /// I - P.
    outside: Mat<f64>,
    /// R x m: (I - P) Y H.
    residual: Mat<f64>,
    /// (R - l) x m: the same in an orthonormal basis of the complement of A.
    residual_outside: Mat<f64>,
}

impl Moves {
    fn new(problem: &Problem, projection: &Projection, gradients: MatRef<'_, f64>) -> Self {
        let coefficients = projection.coefficients();
        let plate = projection.design.plate(coefficients.as_ref());
        let (count, l) = (gradients.nrows(), gradients.ncols() / 2);
        let weights = plate
            .weights
            .rows_matrix()
            .get(.., ..l)
            .transpose()
            .to_owned();
        let slopes = [0, 1].map(|axis| {
            let kernels = gradients.get(.., axis * l..(axis + 1) * l);
            let mut slope = product(kernels, weights.as_ref());
            for (j, column) in slope.col_iter_mut().enumerate() {
                let flat = coefficients[(1 + axis, j)];
                column
                    .iter_mut()
                    .zip(&problem.roots)
                    .for_each(|(x, root)| *x += root * flat);
            }
            slope
        });
        let residual_outside = product(projection.rest.as_ref(), projection.basis());
        let complement = from_outside(projection, Mat::identity(count - l, count - l).as_ref());
        Self {
            slopes,
            weights,
            outside: product(complement.as_ref(), complement.transpose()),
            residual: from_outside(projection, residual_outside.as_ref()),
            residual_outside,
        }
    }
}

/// How the rows move with the sites.
struct Shifts {
    /// R x 2l: (I - P) times what a row gains, for a unit of g_j, from moving site j.
    rows: Mat<f64>,
    /// (R - l) x 2l: the same in an orthonormal basis of the complement of A.
    outside: Mat<f64>,
}

impl Shifts {
    fn new(problem: &Problem, projection: &Projection, gradients: MatRef<'_, f64>) -> Self {
        let (count, l) = (gradients.nrows(), gradients.ncols() / 2);
        let corrections = corrections(problem, projection);
        let mut gains = Mat::from_fn(count, 2 * l, |row, i| {
            -gradients[(row, i)] - corrections[(row, i / l)]
        });
        projection.qr.apply_transpose(&mut gains);
        let outside = gains.get(l.., ..).to_owned();
        Self {
            rows: from_outside(projection, outside.as_ref()),
            outside,
        }
    }
}

/// The rows of which these are the coordinates in an orthonormal basis of the complement of A.
fn from_outside(projection: &Projection, outside: MatRef<'_, f64>) -> Mat<f64> {
    let (count, l) = (projection.curve.len(), projection.svd.u.nrows());
    let mut rows = Mat::zeros(count, outside.ncols());
    rows.get_mut(l.., ..).copy_from(outside);
    projection.qr.apply(&mut rows);
    rows
}

/// R x 2l: the gradients of the kernels at the curve, x and then y, times the square roots of the weights.
fn gradients(problem: &Problem, unknowns: &Unknowns, projection: &Projection) -> Mat<f64> {
    let (count, l) = (projection.curve.len(), unknowns.sites.len());
    let mut transposed = Mat::zeros(2 * l, count);
    for (i, &p) in projection.curve.iter().enumerate() {
        let (x, y) = transposed.col_as_slice_mut(i).split_at_mut(l);
        kernel_gradients(p, &unknowns.sites, x, y);
    }
    let mut gradients = transposed.transpose().to_owned();
    scale_rows(&mut gradients, &problem.roots);
    gradients
}

/// R x 2: with W = [1 s], what the coefficients -W (W^T W)^-1 e_x and e_y of the kernels take from each row: the least ones that make up, in the side
/// conditions, for a site moved along x or y by a unit whose kernel has the coefficient 1.
fn corrections(problem: &Problem, projection: &Projection) -> Mat<f64> {
    let design = &projection.design;
    // W = Q R, so W (W^T W)^-1 = Q R^-T, and the first three of the `sums` are Q^T times the kernels.
    let mut corrections = Mat::zeros(projection.curve.len(), 2);
    let Some(sums) = design.sums.iter().next() else {
        return corrections;
    };
    let rows = sums.chunks(LANES).zip(problem.roots.chunks(LANES));
    for (chunk, (sums, roots)) in rows.enumerate() {
        // z = R^-1 (Q^T kernels) of eight rows; its entries 1 and 2 belong to x and y.
        let head = |i: usize, row: usize| sums.get(row).filter(|_| i < 3).map_or(0.0, |sum| sum[i]);
        let mut z: [Eight; LANES] =
            std::array::from_fn(|i| Entry(std::array::from_fn(|row| head(i, row))));
        design.side.r.solve(&mut z);
        for (row, root) in roots.iter().enumerate() {
            corrections[(LANES * chunk + row, 0)] = root * z[1][row];
            corrections[(LANES * chunk + row, 1)] = root * z[2][row];
        }
    }
    corrections
}

fn product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut c = Mat::zeros(a.nrows(), b.ncols());
    multiply(c.as_mut(), Accum::Replace, a, b);
    c
}

/// B^T M for the R x k matrix B of the splines at the rows.
fn gather_rows(splines: &[Local], m: MatRef<'_, f64>, k: usize) -> Mat<f64> {
    let mut gathered = Mat::zeros(k, m.ncols());
    for (target, source) in (0..m.ncols()).zip(m.col_iter()) {
        let target = gathered.col_as_slice_mut(target);
        for ((first, values), x) in splines.iter().zip(source.iter()) {
            for (sum, value) in target[*first..first + BAND].iter_mut().zip(values) {
                *sum += x * value;
            }
        }
    }
    gathered
}
