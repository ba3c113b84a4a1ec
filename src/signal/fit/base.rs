//! What k and l do not change in a fit, and attempts with some k and some sites over it.

use std::time::Duration;

use faer::{Mat, MatRef};
use rayon::prelude::*;

use super::{Errors, Fit, FitError, Timings, timed};
use crate::linalg::dense::FactorError;
use crate::signal::cubic::{CubicSpline, Ends};
use crate::signal::f::Spline;
use crate::signal::g::PoseSignal;
use crate::signal::h::{ShapeSignal, shape_signal};
use crate::signal::knots::{KnotRule, knots};
use crate::signal::layout::{Distances, Layout};
use crate::signal::mds::Steps;
use crate::signal::parameters::{Grid, distinct, frame_parameters};
use crate::signal::pins::{Pin, check_distance};
use crate::signal::poses::{diameter, first_of_each};
use crate::signal::psi::{Representation, TimeSignal};
use crate::signal::sites::{SiteOrder, site_order};
use crate::signal::{Point, distance};

/// Frames closer than this share of the layout's diameter are one pose, whose first frame is its candidate site (reading 10).
const SAME_POSE: f64 = 1e-4;
/// Where (2) exceeds this many times (3) + (4), sites are so close that g swings between them.
const UNSTABLE: f64 = 8.0;
/// Wider poses tried then, as shares of the diameter.
const WIDER_POSES: [f64; 9] = [1e-4, 1e-3, 0.005, 0.01, 0.02, 0.04, 0.07, 0.1, 0.15];

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
pub(in crate::signal) struct Base {
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
    pub(in crate::signal) fn new(
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
    pub(in crate::signal) fn from_shape(
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

    /// Makes an attempt in every plane and stays in the one whose attempt has the least sum of (2) and of what its in-betweens stray; see [`super::fit`].
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
    pub(in crate::signal) fn settle(&mut self, rule: KnotRule) -> Result<(), FitError> {
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
    pub(in crate::signal) fn parameters(&self) -> &[f64] {
        &self.plane().parameters
    }

    /// m.
    pub(in crate::signal) fn dimension(&self) -> usize {
        self.shape.basis.ncols()
    }

    /// The greatest k that the distinct parameters allow.
    pub(in crate::signal) fn most_control_points(&self) -> usize {
        distinct(&self.plane().parameters).len() + 2
    }

    /// At most `count` sites, the first frames of poses before the others.
    pub(in crate::signal) fn order(&self, count: usize) -> Result<SiteOrder, FactorError> {
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

    pub(in crate::signal) fn fit(
        mut self,
        k: usize,
        l: usize,
        rule: KnotRule,
    ) -> Result<Fit, FitError> {
        let best = self.choose(|base| base.best_attempt(k, l, rule))?;
        Ok(self.finish(best))
    }

    /// The attempt with the least (2) on the ladder of poses; see [`super::fit`].
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
    pub(in crate::signal) fn signals(
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
        let gap = |(a, b): (&Point, &Point)| distance(*a, *b).powi(2);
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

    pub(in crate::signal) fn finish(mut self, attempt: Attempt) -> Fit {
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
pub(in crate::signal) struct Attempt {
    pub(in crate::signal) pose: PoseSignal,
    pub(in crate::signal) spline: Spline,
    pub(in crate::signal) errors: Errors,
    pub(in crate::signal) sites: SiteOrder,
    same_pose: f64,
    timings: Timings,
}

impl Attempt {
    /// The same, said to have the first l sites of a search that took this long.
    pub(in crate::signal) fn searched(mut self, search: &SiteOrder, l: usize, g: Duration) -> Self {
        self.sites = SiteOrder {
            order: search.order[..l].to_vec(),
            errors: search.errors.clone(),
        };
        self.timings.g = g;
        self
    }
}

/// (3), frame by frame from the frames themselves. O(n d m).
pub(in crate::signal) fn error_h(frames: MatRef<'_, f64>, shape: &ShapeSignal) -> f64 {
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
