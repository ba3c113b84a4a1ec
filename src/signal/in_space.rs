//! Reconstruction in a shape space (section 5): signals are fitted to the vectors z of the frames, and what counts in the end is how far the
//! vertices are off after decoding.

use std::time::{Duration, Instant};

use faer::{Mat, MatRef};
use thiserror::Error;

use super::fidelity::{Whole, check, choose};
use super::fit::{Fit, FitError, FitOptions, fit};
use super::knots::KnotRule;
use super::layout::Layout;
use super::pins::Pin;
use super::psi::Representation;
use super::refine::tolerance::choose_refined;
use super::refine::{RefineOptions, Refinement, refine};
use crate::shape::{Convergence, ShapeError, Space, decode_all_telling, encode_all};

/// Fits tried until the vertices are near enough.
const ATTEMPTS: usize = 12;
/// Each aims at this share of the error that the one before would need.
const AIM: f64 = 0.8;
/// A fit that uses this share of the tolerance is close enough to it.
const CLOSE: f64 = 0.8;

/// A fit in a shape space: errors (2) to (7) are in the units of S, squared.
#[derive(Clone, Debug)]
pub struct SpaceFit {
    pub fit: Fit,
    /// Root mean square distance of the vertices of psi(i), decoded, from those of frame i.
    pub rms: f64,
    /// How the decoding of psi(i) converged.
    pub convergence: Convergence,
    /// Wall time of decoding psi(i), i = 1 .. n.
    pub decoding: Duration,
}

impl SpaceFit {
    fn measured(space: &dyn Space, frames: &[f64], fit: Fit) -> Result<Self, ShapeError> {
        let start = Instant::now();
        let (rms, convergence) = rms_after_decoding(space, frames, &fit.representation)?;
        Ok(Self {
            fit,
            rms,
            convergence,
            decoding: start.elapsed(),
        })
    }
}

/// Why there is no fit in a shape space.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SpaceFitError {
    /// See [`ShapeError`].
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// See [`FitError`].
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Fits with these constants to n frames of 3V positions each. Costs encoding, the fit in d dimensions and decoding of n frames.
pub fn fit_in_space(
    space: &dyn Space,
    frames: &[f64],
    options: &FitOptions,
) -> Result<SpaceFit, SpaceFitError> {
    let z = encode_all(space, frames)?;
    let fit = fit(z.as_ref(), options)?;
    Ok(SpaceFit::measured(space, frames, fit)?)
}

/// Refines a fit to these frames. (2) in S does not rise; what that makes of the vertices is measured.
pub fn refine_in_space(
    space: &dyn Space,
    frames: &[f64],
    found: SpaceFit,
    options: &RefineOptions,
) -> Result<(SpaceFit, Refinement), SpaceFitError> {
    let z = encode_all(space, frames)?;
    let (fit, refinement) = refine(z.as_ref(), found.fit, options)?;
    Ok((SpaceFit::measured(space, frames, fit)?, refinement))
}

/// Chooses k, l and m (section 3.4) so that the vertices are off by at most `rms` after decoding.
///
/// The allowed error (2) in S starts at the share of the frames' spread in S that `rms` is of their spread in space, and is then moved by what the
/// decoded vertices show, until at least four fifths of `rms` are used. Of the fits that meet it the one of fewest numbers is kept; the interpolating
/// representation is the last resort.
pub fn fit_in_space_to_rms(
    space: &dyn Space,
    frames: &[f64],
    rms: f64,
    knots: KnotRule,
    layout: Layout,
    pins: &[Pin],
) -> Result<SpaceFit, SpaceFitError> {
    let staged = |whole: &Whole, most| Ok((choose(whole, most, knots, layout, pins)?, ()));
    let interpolating = |z: MatRef<'_, f64>| Ok((interpolate(z, knots, layout, pins)?, ()));
    Ok(to_rms(space, frames, rms, (layout, pins), staged, interpolating)?.0)
}

/// The same with what [`super::refine::tolerance::fit_to_error_refined`] chooses.
pub fn fit_in_space_to_rms_refined(
    space: &dyn Space,
    frames: &[f64],
    rms: f64,
    knots: KnotRule,
    layout: Layout,
    pins: &[Pin],
    options: &RefineOptions,
) -> Result<(SpaceFit, Refinement), SpaceFitError> {
    let refined = |whole: &Whole, most| choose_refined(whole, most, knots, layout, pins, options);
    let interpolating = |z: MatRef<'_, f64>| {
        let fit = interpolate(z, knots, layout, pins)?;
        let untouched = Refinement::none(&fit, options);
        Ok((fit, untouched))
    };
    let start = Instant::now();
    let mut found = to_rms(space, frames, rms, (layout, pins), refined, interpolating)?;
    found.1.elapsed = start.elapsed();
    Ok(found)
}

fn interpolate(
    z: MatRef<'_, f64>,
    knots: KnotRule,
    layout: Layout,
    pins: &[Pin],
) -> Result<Fit, FitError> {
    let n = z.ncols();
    let options = FitOptions {
        knots,
        layout,
        pins: pins.to_vec(),
        ..FitOptions::new(n + 2, n, n - 1)
    };
    fit(z, &options)
}

/// A fit by `to_error`, with the error (2) that the vertices ask for, or the last resort.
fn to_rms<T>(
    space: &dyn Space,
    frames: &[f64],
    rms: f64,
    (layout, pins): (Layout, &[Pin]),
    to_error: impl Fn(&Whole, f64) -> Result<(Fit, T), FitError>,
    last_resort: impl Fn(MatRef<'_, f64>) -> Result<(Fit, T), FitError>,
) -> Result<(SpaceFit, T), SpaceFitError> {
    if !(rms > 0.0 && rms.is_finite()) {
        return Err(FitError::BadTolerance { value: rms }.into());
    }
    let z = encode_all(space, frames)?;
    check(z.as_ref(), rms, layout, pins)?;
    let whole = Whole::new(z.as_ref())?;
    let given = MatRef::from_column_major_slice(frames, space.frame_len(), z.ncols());
    let allowed = rms * rms * frames.len() as f64 / 3.0;
    let mut most = spread(z.as_ref()) * (allowed / spread(given).max(f64::MIN_POSITIVE)).min(1.0);
    let mut best: Option<(SpaceFit, T)> = None;
    // The greatest error in S that met the tolerance, and the least that did not.
    let (mut met, mut missed) = (0.0, f64::INFINITY);
    for _ in 0..ATTEMPTS {
        let (fit, told) = to_error(&whole, most.max(f64::MIN_POSITIVE))?;
        let found = SpaceFit::measured(space, frames, fit)?;
        let off = found.rms;
        let estimate = AIM * most * (rms / off.max(f64::MIN_POSITIVE)).powi(2);
        if off > rms {
            missed = most;
        } else {
            met = most;
            let numbers = |fit: &Fit| fit.representation.stored_numbers();
            if best
                .as_ref()
                .is_none_or(|(b, _)| numbers(&found.fit) < numbers(&b.fit))
            {
                best = Some((found, told));
            }
            if off >= CLOSE * rms {
                break;
            }
        }
        most = match estimate > met && estimate < missed {
            true => estimate,
            false => (met * missed).sqrt(),
        };
        if !most.is_finite() || missed <= met / CLOSE {
            break;
        }
    }
    if let Some(best) = best {
        return Ok(best);
    }
    let (fit, told) = last_resort(z.as_ref())?;
    Ok((SpaceFit::measured(space, frames, fit)?, told))
}

/// psi at many times as frames of 3V positions, decoded.
pub fn sample_in_space(
    space: &dyn Space,
    representation: &Representation,
    times: &[f64],
) -> Result<Vec<f64>, ShapeError> {
    Ok(sample_telling(space, representation, times)?.0)
}

/// [`sample_in_space`], and how decoding converged.
fn sample_telling(
    space: &dyn Space,
    representation: &Representation,
    times: &[f64],
) -> Result<(Vec<f64>, Convergence), ShapeError> {
    let z = representation.evaluate(times);
    let d = representation.dimension();
    decode_all_telling(space, MatRef::from_column_major_slice(&z, d, times.len()))
}

/// The mean square distance of the vertices of psi(i), decoded, from those of frame i, of each of the n frames; and how decoding converged.
pub fn mean_squares(
    space: &dyn Space,
    frames: &[f64],
    representation: &Representation,
) -> Result<(Vec<f64>, Convergence), ShapeError> {
    let n = representation.time.frame_count();
    let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
    let (decoded, convergence) = sample_telling(space, representation, &times)?;
    let len = space.frame_len();
    let of_frame = |(a, b): (&[f64], &[f64])| {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>() / (len as f64 / 3.0)
    };
    let pairs = decoded.chunks(len).zip(frames.chunks(len));
    Ok((pairs.map(of_frame).collect(), convergence))
}

/// The root mean square distance of the vertices of all frames; and how decoding converged.
pub fn rms_after_decoding(
    space: &dyn Space,
    frames: &[f64],
    representation: &Representation,
) -> Result<(f64, Convergence), ShapeError> {
    let (each, convergence) = mean_squares(space, frames, representation)?;
    let mean = each.iter().sum::<f64>() / each.len() as f64;
    Ok((mean.sqrt(), convergence))
}

/// Sum of squared distances of the columns from their mean.
fn spread(z: MatRef<'_, f64>) -> f64 {
    let n = z.ncols() as f64;
    let mean: Mat<f64> = Mat::from_fn(z.nrows(), 1, |a, _| z.row(a).iter().sum::<f64>() / n);
    let column = |i: usize| {
        let pairs = z.col(i).iter().zip(mean.col(0).iter());
        pairs.map(|(x, mean)| (x - mean).powi(2)).sum::<f64>()
    };
    (0..z.ncols()).map(column).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::dataset::open;
    use crate::shape::{SpaceKind, prepare};

    #[test]
    fn interpolating_signals_in_gradient_space_give_the_frames_back() {
        let sequence = open("@gallop-small").unwrap();
        let n = sequence.frame_count();
        let space = prepare(
            SpaceKind::Gradient,
            sequence.connectivity().clone(),
            sequence.frame(0),
            &[],
        )
        .unwrap();
        let options = FitOptions::new(n + 2, n, n - 1);
        let found = fit_in_space(&*space, sequence.positions(), &options).unwrap();
        assert!(found.rms < 1e-9, "{}", found.rms);
    }

    #[test]
    fn the_tolerance_is_one_of_vertices() {
        let sequence = open("@gallop-small").unwrap();
        let space = prepare(
            SpaceKind::Gradient,
            sequence.connectivity().clone(),
            sequence.frame(0),
            &[],
        )
        .unwrap();
        let symmetric = KnotRule::Symmetric;
        let fit = |rms| {
            fit_in_space_to_rms(
                &*space,
                sequence.positions(),
                rms,
                symmetric,
                Layout::Mds,
                &[],
            )
        };
        let (fine, coarse) = (fit(0.005).unwrap(), fit(0.05).unwrap());
        assert!(fine.rms <= 0.005 && coarse.rms <= 0.05);
        // What is allowed is used.
        assert!(fine.rms > 0.5 * 0.005 && coarse.rms > 0.5 * 0.05);
        assert!(
            coarse.fit.representation.stored_numbers() < fine.fit.representation.stored_numbers()
        );
        assert!(fit(0.0).is_err() && fit(f64::NAN).is_err());
    }
}
