//! Joint refinement: (2) itself minimised over f, the sites, g and h, from where section 3 leaves them.
//!
//! The paper minimises (3), (6), (4) and (7) one after the other because (2) is "very expensive" to minimise directly. It is not, for three reasons.
//! All frames lie in the span of themselves, at most n - 1 dimensions, so the number of vertices does not matter. For given f and sites the best g
//! and h are a reduced-rank regression, in closed form (`projection`). And what is left, 2k + 2l numbers, is a small nonlinear least squares
//! (`normal`, `descent`).
//!
//! (2) alone says nothing of psi between the frames, and the more of it goes, the wilder psi swings there. So frames half-way between neighbours
//! count too, with a small weight ([`rows`]); the weight 0 is the paper's (2).

mod descent;
mod normal;
mod projection;
pub mod rows;
#[cfg(test)]
mod tests;
pub mod tolerance;

use std::time::{Duration, Instant};

use faer::{Mat, MatRef};

use self::descent::{Descent, descend};
use self::projection::{Problem, Unknowns};
use self::rows::Rows;
use super::Point;
use super::f::Spline;
use super::fit::{Errors, Fit, FitError};
use super::g::PoseSignal;
use super::h::{ShapeSignal, shape_signal};
use super::psi::{Representation, TimeSignal};
use super::thin_plate::Frame;
use crate::linalg::pca::orient;

/// Each weight tried is this share of the one before, where (2) did not fall.
const LIGHTER: f64 = 0.1;
/// How many weights are tried.
const WEIGHTS: usize = 3;

/// How to refine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefineOptions {
    /// Weight of the frames half-way between neighbours, beside 1 for a frame; 0 for (2) alone.
    pub between: f64,
    /// The most steps.
    pub iterations: usize,
    /// Steps that lower the error by less than this share end the descent.
    pub tolerance: f64,
    /// Whether the sites stay where they are. The error over f, g and h has a minimum then; with sites that move it often has none: they run
    /// together, and coefficients grow without bound.
    pub hold_sites: bool,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            between: 0.5,
            iterations: 200,
            tolerance: 1e-3,
            hold_sites: false,
        }
    }
}

/// What a refinement did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// (2) before and after.
    pub before: f64,
    pub after: f64,
    /// Steps taken, in all attempts.
    pub iterations: usize,
    /// The norm of the gradient of the weighted error with respect to control points and, unless held, sites, over that error, where the sites'
    /// greatest distance from their centroid was 1 at the start.
    pub gradient: f64,
    /// The weight that the frames between frames had.
    pub between: f64,
    pub elapsed: Duration,
}

impl Refinement {
    /// Of a fit that stays as it is.
    pub fn none(fit: &Fit, options: &RefineOptions) -> Self {
        Self {
            before: fit.errors.psi,
            after: fit.errors.psi,
            iterations: 0,
            gradient: f64::NAN,
            between: options.between,
            elapsed: Duration::ZERO,
        }
    }
}

/// f, g and h in r dimensions.
#[derive(Clone, Debug, PartialEq)]
pub struct Signals {
    pub spline: Spline,
    pub pose: PoseSignal,
    /// h_0, r numbers.
    pub offset: Vec<f64>,
    /// H: r x m with orthonormal columns, the one along which g varies most first.
    pub basis: Mat<f64>,
}

/// Signals that minimise the weighted error, and how the descent to them ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Minimum {
    pub signals: Signals,
    /// sum of weight times squared distance over all rows.
    pub error: f64,
    pub iterations: usize,
    /// See [`Refinement::gradient`].
    pub gradient: f64,
}

impl Signals {
    /// h(g(f(t))) at many parameters, r x q.
    pub fn evaluate(&self, parameters: &[f64]) -> Mat<f64> {
        let x = self.pose.evaluate(&self.spline.evaluate_all(parameters));
        let mut z = &self.basis * x;
        for column in z.col_iter_mut() {
            column
                .iter_mut()
                .zip(&self.offset)
                .for_each(|(z, offset)| *z += offset);
        }
        z
    }

    /// The weighted sum of squares that these signals leave of the rows.
    pub fn error(&self, rows: &Rows) -> f64 {
        let found = self.evaluate(&rows.parameters);
        let row = |i: usize| {
            rows.weights[i] * (rows.targets.row(i).transpose() - found.col(i)).squared_norm_l2()
        };
        (0..rows.weights.len()).map(row).sum()
    }
}

/// Minimises the weighted error of the rows over the control points of `spline`, the `sites` unless held, g and h of at most m dimensions, downhill
/// from the given spline and sites; knots and parameters stay. None where there is nothing to refine: fewer than three sites, sites in a line, thin-plate
/// functions that are dependent along the curve, or fewer rows than sites.
///
/// A step costs O(R^2 (l + m) + R l (l + r) + (k + l)^3) for R rows in r dimensions; every arithmetic operation has its place in a fixed order.
pub fn minimise(
    rows: &Rows,
    spline: &Spline,
    sites: &[Point],
    m: usize,
    options: &RefineOptions,
) -> Option<Minimum> {
    minimise_until(rows, spline, sites, m, options, 0.0)
}

/// The same, done once the error is at most `enough`.
pub(super) fn minimise_until(
    rows: &Rows,
    spline: &Spline,
    sites: &[Point],
    m: usize,
    options: &RefineOptions,
    enough: f64,
) -> Option<Minimum> {
    let frame = Frame::new(sites);
    if frame.affine < 3 || rows.weights.len() < sites.len() || spline.check().is_err() {
        return None;
    }
    let normalise = |points: &[Point]| points.iter().map(|&p| frame.normalise(p)).collect();
    let start = Unknowns {
        control: normalise(&spline.control),
        sites: normalise(sites),
    };
    let problem = Problem {
        sites_held: options.hold_sites,
        ..Problem::new(rows, &spline.knots, m)
    };
    let found = descend(&problem, start, options, enough)?;
    let error = found.projection.error;
    Some(Minimum {
        iterations: found.iterations,
        gradient: if error > 0.0 {
            found.gradient / error
        } else {
            0.0
        },
        error,
        signals: signals(problem, found, &frame, spline, sites),
    })
}

/// The signals in the units of the pose plane.
fn signals(
    problem: Problem,
    found: Descent,
    frame: &Frame,
    spline: &Spline,
    given: &[Point],
) -> Signals {
    let coefficients = found.projection.coefficients();
    let plate = found.projection.design.plate(coefficients.as_ref());
    let restore = |points: &[Point]| points.iter().map(|&q| frame.restore(q)).collect();
    let Unknowns { control, sites } = &found.unknowns;
    Signals {
        spline: Spline {
            control: restore(control),
            knots: spline.knots.clone(),
        },
        pose: PoseSignal {
            coefficients: plate.in_given_units(frame, sites),
            sites: match problem.sites_held {
                true => given.to_vec(),
                false => restore(sites),
            },
        },
        offset: problem.mean,
        basis: found.projection.basis().to_owned(),
    }
}

/// Refines a fit to `frames` (d x n). (2) never rises: where the weight of the frames between makes it, lighter ones are tried, and in the end the
/// fit comes back as it was.
///
/// The refined curve is where the frames are: p_i = f(i), and (7) is 0. Pins are where the fit starts from, no more. Costs a shape signal of all
/// n - 1 dimensions beside the descent.
pub fn refine(
    frames: MatRef<'_, f64>,
    fit: Fit,
    options: &RefineOptions,
) -> Result<(Fit, Refinement), FitError> {
    let start = Instant::now();
    let whole = shape_signal(frames, frames.ncols().saturating_sub(1))?;
    let (fit, mut refinement) = refine_within(&whole, fit, options, 0.0);
    refinement.elapsed = start.elapsed();
    Ok((fit, refinement))
}

/// The same, given the shape signal of all dimensions, and done once (2) is at most `enough`.
pub(super) fn refine_within(
    whole: &ShapeSignal,
    fit: Fit,
    options: &RefineOptions,
    enough: f64,
) -> (Fit, Refinement) {
    let start = Instant::now();
    let mut refinement = Refinement::none(&fit, options);
    let psi = &fit.representation;
    let (parameters, m) = (&psi.time.parameters, psi.basis.ncols());
    let frames = Rows::of_frames(whole.coordinates.as_ref(), parameters, 0.0);
    for attempt in 0..WEIGHTS {
        if attempt > 0 {
            refinement.between *= LIGHTER;
        }
        let rows = Rows::of_frames(whole.coordinates.as_ref(), parameters, refinement.between);
        let (spline, sites) = (&psi.time.spline, &psi.pose.sites);
        let Some(found) = minimise_until(&rows, spline, sites, m, options, enough) else {
            break;
        };
        refinement.iterations += found.iterations;
        refinement.gradient = found.gradient;
        let after = found.signals.error(&frames);
        if after < fit.errors.psi {
            refinement.after = after;
            refinement.elapsed = start.elapsed();
            return (refined(whole, fit, found.signals, &frames), refinement);
        }
    }
    refinement.elapsed = start.elapsed();
    (fit, refinement)
}

/// The fit with these signals, in the d dimensions of the frames.
fn refined(whole: &ShapeSignal, fit: Fit, mut signals: Signals, frames: &Rows) -> Fit {
    let mut basis = &whole.basis * &signals.basis;
    let signs = orient(&mut basis);
    for (j, sign) in signs.iter().enumerate() {
        signals.basis.col_mut(j).iter_mut().for_each(|x| *x *= sign);
        signals
            .pose
            .coefficients
            .row_mut(j)
            .iter_mut()
            .for_each(|x| *x *= sign);
    }
    let n = frames.weights.len();
    let centred = Mat::from_fn(signals.offset.len(), n, |a, i| {
        frames.targets[(i, a)] - signals.offset[a]
    });
    let coordinates = signals.basis.transpose() * &centred;
    let positions = signals.spline.evaluate_all(&frames.parameters);
    let error_h = (&centred - &signals.basis * &coordinates).squared_norm_l2();
    let error_g = (signals.pose.evaluate(&positions) - &coordinates).squared_norm_l2();
    let mut offset = whole.offset.clone();
    crate::linalg::kernels::combine(
        &signals.offset,
        |j| whole.basis.col_as_slice(j),
        &mut offset,
    );
    Fit {
        representation: Representation {
            time: TimeSignal::new(signals.spline, frames.parameters.clone()),
            pose: signals.pose,
            offset,
            basis,
        },
        positions,
        coordinates,
        errors: Errors {
            h: error_h,
            g: error_g,
            f: 0.0,
            // H is orthonormal, so what it leaves is orthogonal to what g leaves.
            psi: error_h + error_g,
        },
        ..fit
    }
}
