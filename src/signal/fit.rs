//! Reconstruction from frames (section 3): each signal in turn minimises its own error.

mod base;

use std::time::{Duration, Instant};

use faer::{Mat, MatRef};
use thiserror::Error;

pub(super) use self::base::{Attempt, Base, error_h};

use super::Point;
use super::f::SplineError;
use super::g::PoseError;
use super::knots::{KnotError, KnotRule};
use super::layout::{Layout, LayoutError};
use super::mds::Steps;
use super::pins::{Pin, PinError, validate_pins};
use super::psi::Representation;
use super::sites::SiteOrder;
use crate::linalg::dense::FactorError;

/// Fewest frames that a time signal of four control points can follow.
pub const FEWEST_FRAMES: usize = 4;
/// What to fit with. Ranges: 4 <= k <= n + 2, 3 <= l <= n, 0 <= m <= n - 1 (section 3.4).
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// Control points of the time signal.
    pub k: usize,
    /// Sites of the pose signal.
    pub l: usize,
    /// Dimension of the shape subspace.
    pub m: usize,
    /// Knot rule of the time signal.
    pub knots: KnotRule,
    /// Which dissimilarities the pose-space positions come from.
    pub layout: Layout,
    /// Pose-space positions that the user fixes.
    pub pins: Vec<Pin>,
}

impl FitOptions {
    /// These constants, the default knot rule and layout, no pins.
    pub fn new(k: usize, l: usize, m: usize) -> Self {
        Self {
            k,
            l,
            m,
            knots: KnotRule::default(),
            layout: Layout::default(),
            pins: Vec::new(),
        }
    }
}

/// Why there is no fit.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FitError {
    /// Too short a sequence.
    #[error(
        "expected at least {FEWEST_FRAMES} frames, found {found}; a time signal has at least 4 control points"
    )]
    TooFewFrames { found: usize },
    /// k, l or m outside its range.
    #[error("{name} = {value}, expected {low} <= {name} <= {high} for {frames} frames")]
    OutOfRange {
        name: &'static str,
        value: usize,
        low: usize,
        high: usize,
        frames: usize,
    },
    /// See [`LayoutError`].
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// See [`PinError`].
    #[error(transparent)]
    Pins(#[from] PinError),
    /// See [`FactorError`].
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// See [`PoseError`].
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// See [`KnotError`].
    #[error(transparent)]
    Knots(#[from] KnotError),
    /// See [`SplineError`].
    #[error(transparent)]
    Spline(#[from] SplineError),
    /// Numbers whose squares are none.
    #[error(
        "the greatest number of the frames is {greatest:e}, expected one from {:e} to {:e}, so that squares and their sums can be told; scale the frames",
        MAGNITUDES[0], MAGNITUDES[1]
    )]
    Magnitude { greatest: f64 },
    /// A tolerance that is not a positive number.
    #[error("tolerance {value}, expected a positive relative RMS such as 0.01")]
    BadTolerance { value: f64 },
}

/// The sums of squares that section 3 minimises, in the units of the frames squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// (3): frames against their projections h(x_i).
    pub h: f64,
    /// (4): shape coordinates against g(p_i).
    pub g: f64,
    /// (7): pose-space positions against f(i).
    pub f: f64,
    /// (2): frames against psi(i).
    pub psi: f64,
}

/// Wall time of each stage, as Table 1 counts them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Timings {
    /// Shape signal.
    pub h: Duration,
    /// Pose-space positions.
    pub mds: Duration,
    /// One radial-basis approximation.
    pub rbf: Duration,
    /// The greedy search for the sites.
    pub g: Duration,
    /// Parameters, knots and spline.
    pub f: Duration,
}

/// A representation, how it was found and how well it fits.
#[derive(Clone, Debug)]
pub struct Fit {
    /// psi.
    pub representation: Representation,
    /// p_1 .. p_n.
    pub positions: Vec<Point>,
    /// How many steps the scaling took.
    pub steps: Steps,
    /// X, m x n.
    pub coordinates: Mat<f64>,
    /// Singular values of the centred frames.
    pub singular_values: Vec<f64>,
    /// Frames that became sites, 0-based, in order, with the error (4) of every l.
    pub sites: SiteOrder,
    /// Frames within this distance in pose space count as one pose; see [`fit`].
    pub same_pose: f64,
    /// Weight of distances along the motion in the layout; 0 is the paper's.
    pub layout_weight: f64,
    pub errors: Errors,
    pub timings: Timings,
}

impl Fit {
    /// k, l and m as used: m is cut to the rank, l to the poses that are apart, k to two more than the distinct parameters.
    pub fn klm(&self) -> (usize, usize, usize) {
        self.representation.klm()
    }
}

/// Runs something and takes its time.
pub(super) fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed())
}

/// Fits the representation to `frames` (d x n): h, then p by scaling, then g, then f, with (2) to (7) measured at the end.
///
/// Repeated and nearly repeated poses (reading 10). Frames within 1e-4 of the layout's diameter are one pose; the first frame of each pose is a
/// candidate site, and the others come after all candidates, so that l = n still interpolates. Where (2) then still exceeds 8 times (3) + (4), the
/// mark of sites so close that g swings between them, wider poses are tried, with one site each, on a fixed ladder, and the least (2) is kept.
///
/// A layout of several weights is fitted with each, and the fit is kept with the least sum of (2) and of the squared distances of the in-betweens
/// g(f(i + 1/2)) from the natural cubic spline through the x_i: frames alone do not tell what lies between them, and of smooth curves that one
/// bends least. Costs as many fits as there are weights, with one h.
pub fn fit(frames: MatRef<'_, f64>, options: &FitOptions) -> Result<Fit, FitError> {
    let n = frames.ncols();
    let most_m = n.saturating_sub(1);
    check_ranges(
        n,
        &[
            ("k", options.k, 4, n + 2),
            ("l", options.l, 3, n),
            ("m", options.m, 0, most_m),
        ],
    )?;
    check_magnitude(frames)?;
    validate_pins(&options.pins, n)?;
    options.layout.check()?;
    let base = Base::new(frames, options.m, options.layout, &options.pins)?;
    base.fit(options.k, options.l, options.knots)
}

/// Magnitudes of the greatest number of frames that are not all 0.
const MAGNITUDES: [f64; 2] = [1e-100, 1e100];

/// An error where squares of numbers would be infinite or 0. O(d n).
pub(super) fn check_magnitude(frames: MatRef<'_, f64>) -> Result<(), FitError> {
    let greatest = frames.norm_max();
    match greatest == 0.0 || (MAGNITUDES[0]..=MAGNITUDES[1]).contains(&greatest) {
        true => Ok(()),
        false => Err(FitError::Magnitude { greatest }),
    }
}

/// An error unless there are enough frames and each constant, by name, lies between its least and its greatest value.
pub(super) fn check_ranges(
    frames: usize,
    ranges: &[(&'static str, usize, usize, usize)],
) -> Result<(), FitError> {
    if frames < FEWEST_FRAMES {
        return Err(FitError::TooFewFrames { found: frames });
    }
    let outside = |&&(_, value, low, high): &&(_, usize, usize, usize)| value < low || value > high;
    match ranges.iter().find(outside) {
        None => Ok(()),
        Some(&(name, value, low, high)) => Err(FitError::OutOfRange {
            name,
            value,
            low,
            high,
            frames,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(n: usize) -> Mat<f64> {
        Mat::from_fn(30, n, |a, i| {
            let t = i as f64 * 0.5;
            ((a + 1) as f64 * 0.2 * t).sin() + (t + a as f64).cos() + 0.05 * a as f64
        })
    }

    fn options(k: usize, l: usize, m: usize) -> FitOptions {
        FitOptions {
            knots: KnotRule::Literal,
            layout: Layout::Mds,
            ..FitOptions::new(k, l, m)
        }
    }

    fn measured(frames: &Mat<f64>, fit: &Fit) -> f64 {
        let times: Vec<f64> = (1..=frames.ncols()).map(|i| i as f64).collect();
        let values = fit.representation.evaluate(&times);
        let rebuilt = MatRef::from_column_major_slice(&values, frames.nrows(), frames.ncols());
        (frames - rebuilt).squared_norm_l2()
    }

    #[test]
    fn interpolating_signals_reproduce_every_frame() {
        let z = frames(12);
        for knots in [KnotRule::Literal, KnotRule::Symmetric] {
            let fit = fit(
                z.as_ref(),
                &FitOptions {
                    knots,
                    ..options(14, 12, 11)
                },
            )
            .unwrap();
            assert!(
                fit.errors.psi < 1e-18 * z.squared_norm_l2(),
                "{:?}",
                fit.errors
            );
            assert!(measured(&z, &fit) < 1e-18 * z.squared_norm_l2());
        }
    }

    #[test]
    fn errors_are_what_the_representation_leaves() {
        let z = frames(20);
        for (k, l, m) in [
            (10, 8, 3),
            (4, 3, 0),
            (22, 20, 19),
            (21, 5, 1),
            (4, 3, 2),
            (22, 3, 0),
        ] {
            let fit = fit(z.as_ref(), &options(k, l, m)).unwrap();
            let found = measured(&z, &fit);
            let scale = 1e-10 * z.squared_norm_l2();
            assert!(
                (found - fit.errors.psi).abs() < scale,
                "{k} {l} {m}: {found} {:?}",
                fit.errors
            );
        }
    }

    #[test]
    fn repeated_frames_fit_as_well_as_single_ones() {
        let once = frames(12);
        let twice = Mat::from_fn(30, 24, |a, i| once[(a, i % 12)]);
        let held = Mat::from_fn(30, 24, |a, i| once[(a, i / 2)]);
        for z in [twice, held] {
            let fit = fit(z.as_ref(), &options(26, 24, 23)).unwrap();
            assert!(
                fit.errors.psi < 1e-9 * z.squared_norm_l2(),
                "{:?}",
                fit.errors
            );
        }
        let still = Mat::from_fn(30, 6, |a, _| a as f64);
        let fit = fit(still.as_ref(), &options(8, 6, 5)).unwrap();
        assert_eq!(fit.klm(), (8, 1, 0));
        assert!(fit.errors.psi < 1e-20);
    }

    #[test]
    fn ranges_are_checked_and_named() {
        let z = frames(8);
        for (o, name) in [
            (options(3, 4, 2), "k"),
            (options(11, 4, 2), "k"),
            (options(6, 2, 2), "l"),
            (options(6, 4, 8), "m"),
        ] {
            assert!(
                matches!(fit(z.as_ref(), &o), Err(FitError::OutOfRange { name: found, .. }) if found == name)
            );
        }
        assert_eq!(
            fit(frames(3).as_ref(), &options(4, 3, 0)).unwrap_err(),
            FitError::TooFewFrames { found: 3 }
        );
    }
}
