//! The cubic spline under the time signal: f~ from parameters to the pose plane (sections 2.3 and 3.3).

use faer::Mat;
use thiserror::Error;

use super::Point;
use super::basis::{Basis, Local, apply, rows, values};
use crate::linalg::banded::{BAND, BandedLeastSquares, BandedNormal, Gather};
use crate::linalg::dense::{FactorError, thin_svd};
use crate::linalg::kernels::vectorised;

/// Pivots, or singular values, below this share of the largest count as 0: the data leave freedom there.
const DEFICIENT: f64 = 1e-11;
/// Pivots of the normal equations that are less than this share of their diagonal are left to rotations.
const LEAST_PIVOT: f64 = 1e-8;
/// So is what one step of refinement moves by more than this share.
const MOST_REFINED: f64 = 1e-8;
/// Control points this many times farther out than the data.
const FAR: f64 = 10.0;

fn reach(points: &[Point]) -> f64 {
    points
        .as_flattened()
        .iter()
        .fold(0.0, |reach, x| x.abs().max(reach))
}

/// f~(u) = sum_j B_j(u) f_j with cubic B-splines.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    /// f_1 .. f_k.
    pub control: Vec<Point>,
    /// u_0 .. u_{k+1}; the domain is [u_2, u_{k-1}] (reading 1).
    pub knots: Vec<f64>,
}

/// Why there is no spline.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SplineError {
    /// Too few knots or knots that decrease.
    #[error(
        "expected at least 6 non-decreasing finite knots with u_2 < u_(k-1), found {found} knots of which number {at} (0-based) breaks this"
    )]
    BadKnots { found: usize, at: usize },
    /// Another number of knots than the control points ask for.
    #[error("expected {expected} knots, two more than control points, found {found}")]
    KnotCount { found: usize, expected: usize },
    /// Another number of parameters than of points.
    #[error("expected a parameter for each of {points} points, found {parameters}")]
    LengthMismatch { parameters: usize, points: usize },
    /// A parameter outside the domain.
    #[error(
        "parameter {index} (0-based) is {value}, outside the domain [{low}, {high}] of the knots"
    )]
    OutsideDomain {
        index: usize,
        value: f64,
        low: f64,
        high: f64,
    },
    /// A dense factorisation failed.
    #[error(transparent)]
    Factor(#[from] FactorError),
}

impl Spline {
    /// Minimises (7) over all k control points for these knots (k + 2 of them); ends are not interpolated (reading 3).
    ///
    /// `parameters` are the n non-decreasing t_i. Where the data leave freedom because k exceeds the number of distinct parameters, the solution
    /// is the smoothest one, least in the integral of |f''|^2; at k = n + 2 with the parameters as knots it is the natural spline. Where k does not
    /// exceed it and the matrix is deficient all the same, the solution of least norm. O(n + k) for all but that last case, which takes an SVD.
    pub fn fit(parameters: &[f64], points: &[Point], knots: &[f64]) -> Result<Self, SplineError> {
        Ok(Self::fit_with_values(parameters, points, knots)?.0)
    }

    /// [`Spline::fit`], and the spline at the parameters, whose basis functions are at hand.
    pub fn fit_with_values(
        parameters: &[f64],
        points: &[Point],
        knots: &[f64],
    ) -> Result<(Self, Vec<Point>), SplineError> {
        let basis = Basis::new(knots)?;
        check_parameters(parameters, points, &basis)?;
        let rows = rows(knots, parameters);
        let freedom = basis.count().saturating_sub(count_distinct(parameters));
        let quick = || {
            (freedom == 0)
                .then(|| normal(&basis, &rows, points))
                .flatten()
        };
        let control = match quick().or_else(|| banded(&basis, &rows, points, freedom)) {
            Some(control) => control,
            None => dense(&basis, &rows, points, freedom)?,
        };
        let values = rows.iter().map(|row| apply(row, &control)).collect();
        let knots = knots.to_vec();
        Ok((Self { control, knots }, values))
    }

    /// Whether the knots are knots, and two more than the control points.
    pub fn check(&self) -> Result<(), SplineError> {
        let (found, expected) = (self.knots.len(), self.control.len() + 2);
        if found != expected {
            return Err(SplineError::KnotCount { found, expected });
        }
        Basis::new(&self.knots).map(|_| ())
    }

    /// f~(u); beyond the domain the end points hold. Without control points for its knots, or without a domain, the spline is its first control
    /// point. O(log k).
    pub fn evaluate(&self, u: f64) -> Point {
        match self.basis() {
            Some(basis) => apply(&basis.values(u), &self.control),
            None => self.without_domain(),
        }
    }

    /// f~ at many parameters; O(1) each where they ascend.
    pub fn evaluate_all(&self, parameters: &[f64]) -> Vec<Point> {
        match self.basis() {
            Some(_) => values(&self.knots, &self.control, parameters),
            None => vec![self.without_domain(); parameters.len()],
        }
    }

    /// None without control points for the knots, or without a domain.
    fn basis(&self) -> Option<Basis<'_>> {
        let k = self.control.len();
        let whole = k >= BAND && self.knots.len() == k + 2 && self.knots[2] < self.knots[k - 1];
        whole.then_some(Basis { knots: &self.knots })
    }

    fn without_domain(&self) -> Point {
        self.control.first().copied().unwrap_or([0.0; 2])
    }
}

/// The number of distinct values of non-decreasing parameters.
fn count_distinct(parameters: &[f64]) -> usize {
    let steps = parameters.windows(2).filter(|pair| pair[0] != pair[1]);
    steps.count() + parameters.len().min(1)
}

fn check_parameters(
    parameters: &[f64],
    points: &[Point],
    basis: &Basis,
) -> Result<(), SplineError> {
    if parameters.len() != points.len() {
        return Err(SplineError::LengthMismatch {
            parameters: parameters.len(),
            points: points.len(),
        });
    }
    let (low, high) = basis.domain();
    let slack = 1e-12 * (high - low);
    let outside = parameters
        .iter()
        .position(|t| !(low - slack..=high + slack).contains(t));
    match outside {
        Some(index) => Err(SplineError::OutsideDomain {
            index,
            value: parameters[index],
            low,
            high,
        }),
        None => Ok(()),
    }
}

vectorised! {
    /// Adds A^T (b - A c) to `sum`; c is 0 where there are no control points yet.
    pub fn add_residuals(rows: &[Local], points: &[Point], control: Option<&[Point]>, sum: &mut [Point]) -> () {
        let mut gather = Gather::new(sum);
        for (row, p) in rows.iter().zip(points) {
            let value = control.map_or([0.0; 2], |c| apply(row, c));
            let left = [p[0] - value[0], p[1] - value[1]];
            gather.add(row.0, row.1.map(|weight| left.map(|b| weight * b)));
        }
        gather.finish();
    }
}

/// The solution by normal equations and one step of refinement; None where the step shows that they are not up to it.
fn normal(basis: &Basis, rows: &[Local], points: &[Point]) -> Option<Vec<Point>> {
    let system = BandedNormal::new(basis.count(), rows, LEAST_PIVOT)?;
    let mut control = vec![[0.0; 2]; basis.count()];
    add_residuals(rows, points, None, &mut control);
    system.solve_in_place(&mut control);
    let mut step = vec![[0.0; 2]; basis.count()];
    add_residuals(rows, points, Some(&control), &mut step);
    system.solve_in_place(&mut step);
    for (c, s) in control.iter_mut().zip(&step) {
        *c = [c[0] + s[0], c[1] + s[1]];
    }
    // Far control points are how deficiency shows that no pivot shows.
    let sound =
        reach(&step) <= MOST_REFINED * reach(&control) && reach(&control) <= FAR * reach(points);
    sound.then_some(control)
}

/// The banded solution: where there is freedom for one or two more equations, second derivatives at the ends complete the system, and the
/// two or one functions that vanish on the data are then used to make the curve smoothest. None where the system is deficient.
fn banded(basis: &Basis, rows: &[Local], points: &[Point], freedom: usize) -> Option<Vec<Point>> {
    let ends = end_rows(basis, freedom)?;
    let solve = |data: &dyn Fn(usize) -> Point, end: [Point; 2]| {
        let mut system = BandedLeastSquares::new(basis.count());
        for (i, (first, row)) in rows.iter().enumerate() {
            system.add(*first, *row, data(i));
        }
        for ((first, row), b) in ends.iter().zip(end) {
            system.add(*first, *row, b);
        }
        if system.pivot_ratio() <= DEFICIENT {
            return None;
        }
        let control = system.solve();
        // Near deficiency shows in control points far from the data; only then is the condition worth its price.
        let suspicious = reach(&control) > FAR * reach(points);
        (!suspicious || system.reciprocal_condition() > DEFICIENT).then_some(control)
    };
    let mut control = solve(&|i| points[i], [[0.0; 2]; 2])?;
    if freedom > 0 {
        let vanishing = solve(&|_| [0.0; 2], [[1.0, 0.0], [0.0, 1.0]])?;
        let null: Vec<Vec<f64>> = (0..freedom)
            .map(|f| vanishing.iter().map(|c| c[f]).collect())
            .collect();
        smooth(basis, &mut control, &null);
    }
    Some(control)
}

/// f''(start) and f''(end), scaled to unit length; None where more equations than those two are missing.
fn end_rows(basis: &Basis, freedom: usize) -> Option<Vec<Local>> {
    let k = basis.count();
    let (low, high) = basis.domain();
    let last = basis.span(high);
    let rows = [
        basis.second_derivatives(3, low),
        basis.second_derivatives(last.min(k - 1), high),
    ];
    let unit = |(first, row): Local| {
        let norm = row.iter().map(|x| x * x).sum::<f64>().sqrt();
        (first, row.map(|x| x / norm))
    };
    (freedom <= 2).then(|| rows.into_iter().take(freedom).map(unit).collect())
}

/// Adds the mixture of `null` functions (they vanish on the data) that makes the integral of |f''|^2 least.
fn smooth(basis: &Basis, control: &mut [Point], null: &[Vec<f64>]) {
    let rows = basis.energy_rows();
    let bend = |c: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let row = |(first, row): &Local| (0..BAND).map(|j| row[j] * c(first + j)).sum();
        rows.iter().map(row).collect()
    };
    let f = null.len();
    let bends: Vec<Vec<f64>> = null.iter().map(|z| bend(&|j| z[j])).collect();
    let system = Mat::from_fn(rows.len().max(f), f, |i, j| {
        bends[j].get(i).copied().unwrap_or(0.0)
    });
    let mut right = Mat::zeros(rows.len().max(f), 2);
    for axis in 0..2 {
        for (i, b) in bend(&|j| control[j][axis]).into_iter().enumerate() {
            right[(i, axis)] = -b;
        }
    }
    let qr = crate::linalg::dense::Qr::new(system);
    qr.apply_transpose(&mut right);
    let share = qr.solve_upper(&right);
    for (z, function) in null.iter().enumerate() {
        for (c, value) in control.iter_mut().zip(function) {
            for axis in 0..2 {
                c[axis] += share[(z, axis)] * value;
            }
        }
    }
}

/// The solution of least norm by an SVD; where k exceeds the distinct parameters then the smoothest.
fn dense(
    basis: &Basis,
    rows: &[Local],
    points: &[Point],
    freedom: usize,
) -> Result<Vec<Point>, SplineError> {
    let k = basis.count();
    // Padded to at least k rows so that the SVD spans the null space too.
    let mut matrix = Mat::zeros(rows.len().max(k), k);
    for (i, (first, row)) in rows.iter().enumerate() {
        for j in 0..BAND {
            matrix[(i, first + j)] = row[j];
        }
    }
    let svd = thin_svd(matrix.as_ref())?;
    let rank = svd
        .s
        .iter()
        .take_while(|&&s| s > DEFICIENT * svd.s[0])
        .count();
    let mut control = vec![[0.0; 2]; k];
    for r in 0..rank {
        for axis in 0..2 {
            let share: f64 = (0..rows.len())
                .map(|i| svd.u[(i, r)] * points[i][axis])
                .sum();
            for j in 0..k {
                control[j][axis] += svd.v[(j, r)] * share / svd.s[r];
            }
        }
    }
    if freedom > 0 {
        let null: Vec<Vec<f64>> = (rank..k).map(|r| svd.v.col_as_slice(r).to_vec()).collect();
        smooth(basis, &mut control, &null);
    }
    Ok(control)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::knots::{KnotRule, knots};
    use proptest::prelude::*;

    fn parameters(n: usize) -> Vec<f64> {
        (0..n).map(|i| i as f64 + 0.3 * (i as f64).sin()).collect()
    }

    fn cubic(u: f64) -> Point {
        [1.0 - u + 0.02 * u * u * u, 0.3 * u * u]
    }

    fn error(spline: &Spline, t: &[f64], p: &[Point]) -> f64 {
        let d = |(q, p): (Point, &Point)| super::super::distance(q, *p);
        spline
            .evaluate_all(t)
            .into_iter()
            .zip(p)
            .map(d)
            .fold(0.0, f64::max)
    }

    #[test]
    fn cubics_are_reproduced_for_every_number_of_control_points() {
        let t = parameters(15);
        let p: Vec<Point> = t.iter().map(|&u| cubic(u)).collect();
        for k in 4..=15 {
            let u = knots(&t, k, KnotRule::Symmetric).unwrap();
            let spline = Spline::fit(&t, &p, &u).unwrap();
            for q in 0..=100 {
                let u = t[0] + (t[14] - t[0]) * q as f64 / 100.0;
                assert!(
                    super::super::distance(spline.evaluate(u), cubic(u)) < 1e-10,
                    "k = {k}"
                );
            }
        }
    }

    #[test]
    fn two_control_points_more_than_frames_give_the_natural_spline() {
        let t = parameters(9);
        let p: Vec<Point> = t.iter().map(|&u| [u.sin(), (2.0 * u).cos()]).collect();
        for k in [10, 11] {
            let u = knots(&t, k, KnotRule::Literal).unwrap();
            let spline = Spline::fit(&t, &p, &u).unwrap();
            assert!(error(&spline, &t, &p) < 1e-12, "k = {k}");
            if k == 11 {
                let basis = Basis::new(&u).unwrap();
                for row in end_rows(&basis, 2).unwrap() {
                    let bend = apply(&row, &spline.control);
                    assert!(bend[0].abs() < 1e-10 && bend[1].abs() < 1e-10);
                }
            }
        }
    }

    #[test]
    fn banded_and_dense_routes_agree_on_the_smoothest_curve() {
        let t = parameters(9);
        let p: Vec<Point> = t.iter().map(|&u| [u.sin(), (2.0 * u).cos()]).collect();
        for k in [7, 10, 11] {
            let u = knots(&t, k, KnotRule::Literal).unwrap();
            let basis = Basis::new(&u).unwrap();
            let rows: Vec<Local> = t.iter().map(|&t| basis.values(t)).collect();
            let freedom = k.saturating_sub(9);
            let a = banded(&basis, &rows, &p, freedom).unwrap();
            let b = dense(&basis, &rows, &p, freedom).unwrap();
            for (a, b) in a.iter().zip(&b) {
                assert!(super::super::distance(*a, *b) < 1e-9, "k = {k}");
            }
        }
    }

    #[test]
    fn a_span_without_data_takes_the_least_norm() {
        let t = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 9.0, 10.0];
        let u = [0.0, 0.0, 0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 10.0, 10.0];
        let p: Vec<Point> = t.iter().map(|&u| cubic(u)).collect();
        let spline = Spline::fit(&t, &p, &u).unwrap();
        assert!(spline.control.iter().flatten().all(|x| x.abs() < 1e3));
        assert!(error(&spline, &t, &p) < 1.0);
    }

    #[test]
    fn bad_knots_and_parameters_are_named() {
        let p = [[0.0; 2]; 3];
        let t = [0.0, 1.0, 2.0];
        assert!(matches!(
            Spline::fit(&t, &p, &[0.0; 6]),
            Err(SplineError::BadKnots { .. })
        ));
        assert!(matches!(
            Spline::fit(&t, &p, &[0.0; 3]),
            Err(SplineError::BadKnots { .. })
        ));
        let u = [0.0, 0.0, 0.0, 1.5, 1.5, 1.5];
        assert!(matches!(
            Spline::fit(&t, &p, &u),
            Err(SplineError::OutsideDomain { index: 2, .. })
        ));
        assert!(matches!(
            Spline::fit(&t, &p[..2], &u),
            Err(SplineError::LengthMismatch { .. })
        ));
    }

    proptest! {
        /// Basis functions are a partition of unity wherever the knots are.
        #[test]
        fn partition_of_unity(inner in prop::collection::vec(0.0f64..1.0, 0..8), u in 0.0f64..1.0) {
            let mut inner = inner;
            inner.sort_by(f64::total_cmp);
            let knots: Vec<f64> = [0.0; 3].into_iter().chain(inner).chain([1.0; 3]).collect();
            let (_, b) = Basis::new(&knots).unwrap().values(u);
            prop_assert!((b.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            prop_assert!(b.iter().all(|&x| x >= -1e-15));
        }
    }
}
