//! The joint optimum over g and h, in closed form, where f and the sites are given.

use faer::{Mat, MatRef};

use super::rows::Rows;
use crate::linalg::dense::{Qr, ThinSvd, thin_svd};
use crate::signal::Point;
use crate::signal::basis::{Local, apply, rows};
use crate::signal::thin_plate_fit::Design;

/// Columns of the design closer to dependent than this are none to divide by: sites have run into one another.
const INDEPENDENT: f64 = 1e-10;

/// The nonlinear unknowns, in the coordinates of a frame of the plane.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unknowns {
    /// f_1 .. f_k.
    pub control: Vec<Point>,
    /// s_1 .. s_l.
    pub sites: Vec<Point>,
}

/// What stays the same while the unknowns move.
pub(super) struct Problem {
    /// The B-splines at each row's parameter.
    pub splines: Vec<Local>,
    /// Square roots of the weights.
    pub roots: Vec<f64>,
    /// The weighted mean of the targets: h_0.
    pub mean: Vec<f64>,
    /// R x r: targets less their mean, times the square root of their weight.
    pub targets: Mat<f64>,
    /// The greatest dimension of the shape subspace.
    pub m: usize,
    /// Whether the sites stay, and the control points alone move.
    pub sites_held: bool,
}

impl Problem {
    /// With sites that move.
    pub fn new(given: &Rows, knots: &[f64], m: usize) -> Self {
        let weight: f64 = given.weights.iter().sum();
        let mean: Vec<f64> = (0..given.targets.ncols())
            .map(|a| {
                let column = given.targets.col(a).iter().zip(&given.weights);
                column.map(|(y, w)| w * y).sum::<f64>() / weight
            })
            .collect();
        let roots: Vec<f64> = given.weights.iter().map(|w| w.sqrt()).collect();
        let (count, r) = given.targets.shape();
        Self {
            splines: rows(knots, &given.parameters),
            targets: Mat::from_fn(count, r, |i, a| {
                roots[i] * (given.targets[(i, a)] - mean[a])
            }),
            roots,
            mean,
            m,
            sites_held: false,
        }
    }
}

/// The best g and h for some unknowns, and what they leave.
///
/// With A the R x l matrix of the thin-plate functions at the curve, its rows and those of the targets Y times the square roots of the weights,
/// the model is A C H^T: of rank m, in the column space of A. The least squares is the projection of Y on that space, cut to rank m by its singular
/// value decomposition (reduced-rank regression, Izenman 1975). Y has no weighted mean, so h_0 is that mean.
pub(super) struct Projection {
    pub curve: Vec<Point>,
    pub design: Design,
    /// Of A.
    pub qr: Qr,
    /// (R - l) x r: Y in an orthonormal basis of the complement of A.
    pub rest: Mat<f64>,
    /// Of Y in an orthonormal basis of A, l x r.
    pub svd: ThinSvd,
    /// min(m, r, l - 1), the rank that is kept.
    pub rank: usize,
    /// The weighted sum of squares that is left.
    pub error: f64,
}

impl Projection {
    /// None where the functions are dependent at the curve's points, or the unknowns are no numbers. O(R l (l + r) + l r min(l, r)).
    pub fn new(problem: &Problem, unknowns: &Unknowns) -> Option<Self> {
        let curve: Vec<Point> = problem
            .splines
            .iter()
            .map(|row| apply(row, &unknowns.control))
            .collect();
        let l = unknowns.sites.len();
        let design = Design::new(&unknowns.sites, 3, &curve);
        let mut matrix = design.matrix(&curve);
        scale_rows(&mut matrix, &problem.roots);
        let qr = Qr::new(matrix);
        if !independent(&qr, l) {
            return None;
        }
        let mut targets = problem.targets.clone();
        qr.apply_transpose(&mut targets);
        let svd = thin_svd(targets.get(..l, ..)).ok()?;
        let rest = targets.get(l.., ..).to_owned();
        let rank = problem.m.min(svd.s.len()).min(l - 1);
        let dropped: f64 = svd.s[rank..].iter().map(|s| s * s).sum();
        Some(Self {
            error: rest.squared_norm_l2() + dropped,
            curve,
            design,
            qr,
            rest,
            svd,
            rank,
        })
    }

    /// H: r x rank, orthonormal.
    pub fn basis(&self) -> MatRef<'_, f64> {
        self.svd.v.get(.., ..self.rank)
    }

    /// l x rank: the coefficients of the functions of the design, g_0 and G first.
    pub fn coefficients(&self) -> Mat<f64> {
        let scores = Mat::from_fn(self.svd.u.nrows(), self.rank, |i, j| {
            self.svd.u[(i, j)] * self.svd.s[j]
        });
        self.qr.solve_upper(&scores)
    }
}

pub(super) fn scale_rows(matrix: &mut Mat<f64>, factors: &[f64]) {
    for column in matrix.col_iter_mut() {
        for (x, factor) in column.iter_mut().zip(factors) {
            *x *= factor;
        }
    }
}

fn independent(qr: &Qr, columns: usize) -> bool {
    let diagonal = || (0..columns).map(|j| qr.r(j, j).abs());
    let most = diagonal().fold(0.0, f64::max);
    most.is_finite() && diagonal().all(|r| r > INDEPENDENT * most)
}
