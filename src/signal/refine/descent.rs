//! Levenberg & Marquardt's steps down the error with g and h projected out.

use faer::Mat;

use super::RefineOptions;
use super::normal::Normal;
use super::projection::{Problem, Projection, Unknowns};
use crate::signal::Point;

/// The first damping, and the damping beyond which no step helps.
const DAMPING: [f64; 2] = [1e-3, 1e10];
/// A step that gives at least this share of what it promised lets damping fall, one that gives less than the second raises it.
const KEPT: [f64; 2] = [0.75, 0.25];
/// Steps in a row that gain too little before the descent ends.
const PATIENCE: usize = 3;
/// An error below this share of the squared targets is rounding.
const NEGLIGIBLE: f64 = 1e-24;

/// Where a descent ended.
pub(super) struct Descent {
    pub unknowns: Unknowns,
    pub projection: Projection,
    /// Steps taken.
    pub iterations: usize,
    /// The norm of the error's gradient with respect to the unknowns.
    pub gradient: f64,
}

/// Takes steps that lower the error until `PATIENCE` of them in a row gain less than the tolerance, the error is at most `enough`, or there have
/// been as many as allowed. None where the start has dependent functions.
pub(super) fn descend(
    problem: &Problem,
    start: Unknowns,
    options: &RefineOptions,
    enough: f64,
) -> Option<Descent> {
    let mut projection = Projection::new(problem, &start)?;
    let mut unknowns = start;
    let mut normal = Normal::new(problem, &unknowns, &projection);
    let enough = enough.max(NEGLIGIBLE * problem.targets.squared_norm_l2());
    let (mut damping, mut iterations, mut idle) = (DAMPING[0], 0, 0);
    while iterations < options.iterations && idle < PATIENCE && projection.error > enough {
        let Some((next, found, kept)) =
            lower(problem, &unknowns, &projection, &normal, &mut damping)
        else {
            break;
        };
        if kept > KEPT[0] {
            damping /= 5.0;
        } else if kept < KEPT[1] {
            damping *= 2.0;
        }
        let small = projection.error - found.error < options.tolerance * projection.error;
        idle = if small { idle + 1 } else { 0 };
        (unknowns, projection) = (next, found);
        normal = Normal::new(problem, &unknowns, &projection);
        iterations += 1;
    }
    Some(Descent {
        gradient: normal.gradient(),
        unknowns,
        projection,
        iterations,
    })
}

/// A step that lowers the error, what it gave of what it promised, and the damping it took; None where none does.
fn lower(
    problem: &Problem,
    unknowns: &Unknowns,
    projection: &Projection,
    normal: &Normal,
    damping: &mut f64,
) -> Option<(Unknowns, Projection, f64)> {
    while *damping < DAMPING[1] {
        if let Some(step) = normal.step(*damping) {
            let next = moved(unknowns, &step);
            let found = Projection::new(problem, &next);
            if let Some(found) = found.filter(|found| found.error < projection.error) {
                let kept = (projection.error - found.error) / normal.promise(&step);
                return Some((next, found, kept));
            }
        }
        *damping *= 4.0;
    }
    None
}

/// The unknowns after a step in the order of [`Normal`]; sites that it leaves out stay.
fn moved(unknowns: &Unknowns, step: &Mat<f64>) -> Unknowns {
    let mut next = unknowns.clone();
    let (control, sites) = step.col_as_slice(0).split_at(2 * next.control.len());
    shift(&mut next.control, control);
    shift(&mut next.sites, sites);
    next
}

/// Moves points by x of all of them, then y of all of them; not at all by nothing.
fn shift(points: &mut [Point], by: &[f64]) {
    let (x, y) = by.split_at(by.len() / 2);
    for (point, (x, y)) in points.iter_mut().zip(x.iter().zip(y)) {
        *point = [point[0] + x, point[1] + y];
    }
}
