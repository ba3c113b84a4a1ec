//! What the pictures of a fit are drawn from.

use faer::MatRef;

use super::case::Case;
use super::record::FitFigures;
use crate::signal::fit::Fit;
use crate::stages::StageError;
use crate::stages::signal::Choice;

/// Points of f drawn between two frames.
const PER_FRAME: usize = 12;
/// Values tried of each of k, l and m.
const STEPS: usize = 10;

/// Fits the case's constants, and neighbours of each of them, to the frames (d x n).
pub fn draw(case: &Case, frames: MatRef<'_, f64>) -> Result<FitFigures, StageError> {
    let fit = case.choice.fit(frames)?;
    let n = frames.ncols();
    let (k, l, m) = fit.klm();
    let time = &fit.representation.time;
    let dense = (0..=(n - 1) * PER_FRAME).map(|i| 1.0 + i as f64 / PER_FRAME as f64);
    let size = diagonal(frames);
    let relative = |psi: f64| (psi / (n * frames.nrows() / 3) as f64).sqrt() / size;
    let sweep = |low: usize, high: usize, with: &dyn Fn(usize) -> Choice| {
        let values = steps(low, high);
        let error = |v: usize| Ok((v, relative(with(v).fit(frames)?.errors.psi)));
        values
            .into_iter()
            .map(error)
            .collect::<Result<Vec<_>, StageError>>()
    };
    let base = &case.choice;
    Ok(FitFigures {
        case: case.name.clone(),
        dataset: case.dataset.clone(),
        k,
        l,
        m,
        d: frames.nrows(),
        frames: n,
        positions: fit.positions.clone(),
        frame_points: (1..=n).map(|i| time.evaluate(i as f64)).collect(),
        curve: dense.map(|t| time.evaluate(t)).collect(),
        control: time.spline.control.clone(),
        sites: fit.sites.order.clone(),
        frame_errors: frame_errors(&fit, frames, size),
        singular_values: fit.singular_values.clone(),
        error_by_m: sweep(0, n - 1, &|m| Choice { m, ..base.clone() })?,
        error_by_l: sweep(3, n, &|l| Choice { l, ..base.clone() })?,
        error_by_k: sweep(4, n + 2, &|k| Choice { k, ..base.clone() })?,
        errors: [fit.errors.h, fit.errors.g, fit.errors.f, fit.errors.psi],
        milliseconds: milliseconds(&fit),
    })
}

fn milliseconds(fit: &Fit) -> [f64; 5] {
    let t = fit.timings;
    [t.h, t.mds, t.rbf, t.g, t.f].map(|d| d.as_secs_f64() * 1e3)
}

/// Distinct values from low to high, both in.
fn steps(low: usize, high: usize) -> Vec<usize> {
    let mut values: Vec<usize> = (0..=STEPS)
        .map(|i| low + (high - low) * i / STEPS)
        .collect();
    values.dedup();
    values
}

fn diagonal(frames: MatRef<'_, f64>) -> f64 {
    let first: Vec<f64> = frames.col(0).iter().copied().collect();
    crate::mesh::measure::bounds(&first).diagonal()
}

fn frame_errors(fit: &Fit, frames: MatRef<'_, f64>, size: f64) -> Vec<f64> {
    let d = frames.nrows();
    let mut frame = vec![0.0; d];
    (0..frames.ncols())
        .map(|i| {
            fit.representation.evaluate_into((i + 1) as f64, &mut frame);
            let square: f64 = (0..d).map(|a| (frame[a] - frames[(a, i)]).powi(2)).sum();
            (square / (d / 3) as f64).sqrt() / size
        })
        .collect()
}
