//! Reconstruction from frames (section 3): each signal in turn minimises its own error.

use std::time::{Duration, Instant};

use faer::{Mat, MatRef};
use rayon::prelude::*;
use thiserror::Error;

use super::Point;
use super::cubic::{CubicSpline, Ends};
use super::f::{Spline, SplineError};
use super::g::{PoseError, PoseSignal};
use super::h::{ShapeSignal, shape_signal};
use super::knots::{KnotError, KnotRule, knots};
use super::layout::{Distances, Layout, LayoutError};
use super::mds::Steps;
use super::parameters::{Grid, distinct, frame_parameters};
use super::pins::{Pin, PinError, check_distance, validate_pins};
use super::poses::{diameter, first_of_each};
use super::psi::{Representation, TimeSignal};
use super::sites::{SiteOrder, site_order};
use crate::linalg::dense::FactorError;

/// Fewest frames that a time signal of four control points can follow.
pub const FEWEST_FRAMES: usize = 4;
/// Frames closer than this share of the layout's diameter are one pose, whose first frame is its candidate site (reading 10).
const SAME_POSE: f64 = 1e-4;
/// Where (2) exceeds this many times (3) + (4), sites are so close that g swings between them.
const UNSTABLE: f64 = 8.0;
/// Wider poses tried then, as shares of the diameter.
const WIDER_POSES: [f64; 9] = [1e-4, 1e-3, 0.005, 0.01, 0.02, 0.04, 0.07, 0.1, 0.15];

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

/// Positions of one weight of the layout, and what follows from them alone.
struct Plane {
    weight: f64,
    positions: Vec<Point>,
    steps: Steps,
    diameter: f64,
    parameters: Vec<f64>,
}

impl Plane {
    fn new(weight: f64, positions: Vec<Point>, steps: Steps) -> Self {
        let diameter = diameter(&positions);
        Self {
            parameters: frame_parameters(&positions, diameter),
            weight,
            positions,
            steps,
            diameter,
        }
    }
}

/// What k and l do not change: the shape signal and the pose-space positions, of every weight that the layout may have.
pub(super) struct Base {
    shape: ShapeSignal,
    planes: Vec<Plane>,
    /// Which plane is fitted to.
    at: usize,
    error_h: f64,
    /// An error (2) that is rounding.
    negligible: f64,
    timings: Timings,
}

impl Base {
    pub(super) fn new(
        frames: MatRef<'_, f64>,
        m: usize,
        layout: Layout,
        pins: &[Pin],
    ) -> Result<Self, FitError> {
        let (shape, h) = timed(|| shape_signal(frames, m));
        let shape = shape?;
        let error_h = error_h(frames, &shape);
        Self::from_shape(shape, error_h, h, layout, pins)
    }

    /// From a shape signal already found, with its error (3).
    pub(super) fn from_shape(
        shape: ShapeSignal,
        error_h: f64,
        h: Duration,
        layout: Layout,
        pins: &[Pin],
    ) -> Result<Self, FitError> {
        let x = shape.coordinates.as_ref();
        check_distance(pins, x)?;
        let (planes, mds) = timed(|| {
            let distances = Distances::new(x);
            let plane = |weight| -> Result<Plane, FactorError> {
                let (positions, steps) = distances.positions(x, weight, pins)?;
                Ok(Plane::new(weight, positions, steps))
            };
            let weights = layout.weights().into_par_iter();
            weights.map(plane).collect::<Result<Vec<_>, _>>()
        });
        Ok(Self {
            planes: planes?,
            at: 0,
            negligible: 1e-12 * shape.coordinates.squared_norm_l2(),
            shape,
            error_h,
            timings: Timings {
                h,
                mds,
                ..Timings::default()
            },
        })
    }

    fn plane(&self) -> &Plane {
        &self.planes[self.at]
    }

    /// Makes an attempt in every plane and stays in the one whose attempt has the least sum of (2) and of what its in-betweens stray; see [`fit`].
    fn choose(
        &mut self,
        attempt: impl Fn(&Self) -> Result<Attempt, FitError>,
    ) -> Result<Attempt, FitError> {
        let mut best = attempt(self)?;
        if self.planes.len() == 1 {
            return Ok(best);
        }
        let witness = CubicSpline::new(self.shape.coordinates.as_ref(), Ends::Natural).midpoints();
        let score = |base: &Self, attempt: &Attempt| {
            let between = base.between(attempt) - &witness;
            attempt.errors.psi + between.squared_norm_l2()
        };
        let (mut least, mut chosen) = (score(self, &best), self.at);
        for at in 1..self.planes.len() {
            self.at = at;
            let next = attempt(self)?;
            let found = score(self, &next);
            if found < least {
                (least, chosen, best) = (found, at, next);
            }
        }
        self.at = chosen;
        Ok(best)
    }

    /// Chooses the plane by interpolating signals, for searches over k and l.
    pub(super) fn settle(&mut self, rule: KnotRule) -> Result<(), FitError> {
        if self.planes.len() > 1 {
            let interpolate = |base: &Self| {
                let k = base.most_control_points();
                base.attempt(k, rule, SAME_POSE * base.plane().diameter, || {
                    base.order(usize::MAX)
                })
            };
            self.choose(interpolate)?;
        }
        Ok(())
    }

    /// g(f(i + 1/2)), m x (n - 1).
    fn between(&self, attempt: &Attempt) -> Mat<f64> {
        let parameters = &self.plane().parameters;
        let time = TimeSignal::new(attempt.spline.clone(), parameters.clone());
        let times: Vec<f64> = (1..parameters.len()).map(|i| i as f64 + 0.5).collect();
        attempt.pose.evaluate(&time.evaluate_all(&times))
    }

    /// t_1 .. t_n.
    pub(super) fn parameters(&self) -> &[f64] {
        &self.plane().parameters
    }

    /// m.
    pub(super) fn dimension(&self) -> usize {
        self.shape.basis.ncols()
    }

    /// The greatest k that the distinct parameters allow.
    pub(super) fn most_control_points(&self) -> usize {
        distinct(&self.plane().parameters).len() + 2
    }

    /// At most `count` sites, the first frames of poses before the others.
    pub(super) fn order(&self, count: usize) -> Result<SiteOrder, FactorError> {
        let plane = self.plane();
        let candidates = first_of_each(&plane.positions, SAME_POSE * plane.diameter);
        self.order_among(count, &candidates)
    }

    /// At most `count` sites, one a pose.
    fn order_of_poses(&self, count: usize, same_pose: f64) -> Result<SiteOrder, FactorError> {
        let candidates = first_of_each(&self.plane().positions, same_pose);
        let poses = candidates.iter().filter(|&&first| first).count();
        self.order_among(count.min(poses), &candidates)
    }

    fn order_among(&self, count: usize, candidates: &[bool]) -> Result<SiteOrder, FactorError> {
        let (plane, x) = (self.plane(), self.shape.coordinates.as_ref());
        // g is least held at the ends of a motion. The paper's layout has the paper's order.
        let ends = [0, x.ncols().saturating_sub(1)];
        let first = if plane.weight > 0.0 { &ends[..] } else { &[] };
        site_order(&plane.positions, x, count, candidates, first)
    }

    pub(super) fn fit(mut self, k: usize, l: usize, rule: KnotRule) -> Result<Fit, FitError> {
        let best = self.choose(|base| base.best_attempt(k, l, rule))?;
        Ok(self.finish(best))
    }

    /// The attempt with the least (2) on the ladder of poses; see [`fit`].
    fn best_attempt(&self, k: usize, l: usize, rule: KnotRule) -> Result<Attempt, FitError> {
        let diameter = self.plane().diameter;
        let mut best = self.attempt(k, rule, SAME_POSE * diameter, || self.order(l))?;
        if best.errors.psi > UNSTABLE * (best.errors.h + best.errors.g)
            && best.errors.psi > self.negligible
        {
            for share in WIDER_POSES {
                let same_pose = share * diameter;
                let next =
                    self.attempt(k, rule, same_pose, || self.order_of_poses(l, same_pose))?;
                if next.errors.psi < best.errors.psi {
                    best = next;
                }
            }
        }
        Ok(best)
    }

    fn attempt(
        &self,
        k: usize,
        rule: KnotRule,
        same_pose: f64,
        order: impl FnOnce() -> Result<SiteOrder, FactorError>,
    ) -> Result<Attempt, FitError> {
        let (order, g) = timed(order);
        let order = order?;
        let mut attempt = self.signals(k, &order.order, rule)?;
        attempt.timings.g = g;
        attempt.sites = order;
        attempt.same_pose = same_pose;
        Ok(attempt)
    }

    /// g for these sites and f for k control points, with their errors.
    pub(super) fn signals(
        &self,
        k: usize,
        sites: &[usize],
        rule: KnotRule,
    ) -> Result<Attempt, FitError> {
        let x = self.shape.coordinates.as_ref();
        let positions = &self.plane().positions;
        let (pose, rbf) = timed(|| PoseSignal::fit(positions, x, sites));
        let pose = pose?;
        let (fitted, f) = timed(|| self.spline(k, rule));
        let (spline, curve) = fitted?;
        let gap = |(a, b): (&Point, &Point)| super::distance(*a, *b).powi(2);
        let errors = Errors {
            h: self.error_h,
            g: (pose.evaluate(positions) - x).squared_norm_l2(),
            f: positions.iter().zip(&curve).map(gap).sum(),
            // H is orthonormal and (3) the least, so what h leaves is orthogonal to what g and f leave.
            psi: self.error_h + (pose.evaluate(&curve) - x).squared_norm_l2(),
        };
        Ok(Attempt {
            pose,
            spline,
            errors,
            sites: SiteOrder {
                order: Vec::new(),
                errors: Vec::new(),
            },
            same_pose: SAME_POSE * self.plane().diameter,
            timings: Timings {
                rbf,
                f,
                ..self.timings
            },
        })
    }

    fn spline(&self, k: usize, rule: KnotRule) -> Result<(Spline, Vec<Point>), FitError> {
        let plane = self.plane();
        let t = distinct(&plane.parameters);
        let mut u = knots(&t, k.min(t.len() + 2), rule)?;
        Grid::of(&t).round_all(&mut u);
        let fitted = Spline::fit_with_values(&plane.parameters, &plane.positions, &u)?;
        Ok(fitted)
    }

    pub(super) fn finish(mut self, attempt: Attempt) -> Fit {
        let plane = self.planes.swap_remove(self.at);
        Fit {
            representation: Representation {
                time: TimeSignal::new(attempt.spline, plane.parameters),
                pose: attempt.pose,
                offset: self.shape.offset,
                basis: self.shape.basis,
            },
            positions: plane.positions,
            steps: plane.steps,
            layout_weight: plane.weight,
            coordinates: self.shape.coordinates,
            singular_values: self.shape.singular_values,
            sites: attempt.sites,
            same_pose: attempt.same_pose,
            errors: attempt.errors,
            timings: attempt.timings,
        }
    }
}

/// Signals for one choice of k and sites.
pub(super) struct Attempt {
    pub(super) pose: PoseSignal,
    pub(super) spline: Spline,
    pub(super) errors: Errors,
    pub(super) sites: SiteOrder,
    same_pose: f64,
    timings: Timings,
}

impl Attempt {
    /// The same, said to have the first l sites of a search that took this long.
    pub(super) fn searched(mut self, search: &SiteOrder, l: usize, g: Duration) -> Self {
        self.sites = SiteOrder {
            order: search.order[..l].to_vec(),
            errors: search.errors.clone(),
        };
        self.timings.g = g;
        self
    }
}

/// (3), frame by frame from the frames themselves. O(n d m).
pub(super) fn error_h(frames: MatRef<'_, f64>, shape: &ShapeSignal) -> f64 {
    let d = frames.nrows();
    let frame_error = |i: usize| {
        let mut left: Vec<f64> = (0..d).map(|a| frames[(a, i)] - shape.offset[a]).collect();
        let x: Vec<f64> = (0..shape.basis.ncols())
            .map(|j| -shape.coordinates[(j, i)])
            .collect();
        crate::linalg::kernels::combine(&x, |j| shape.basis.col_as_slice(j), &mut left);
        crate::linalg::kernels::norm_squared(&left)
    };
    let each: Vec<f64> = (0..frames.ncols())
        .into_par_iter()
        .map(frame_error)
        .collect();
    each.iter().sum()
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
