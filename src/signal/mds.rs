//! Pose-space positions by multidimensional scaling of the shape coordinates (section 3.2.1, the stress (6)), with or without fixed positions.
//!
//! Reading 6: raw stress, unit weights, no rescaling; majorisation first (SMACOF restricted to the free points), which stays in the basin of the
//! start, then a Newton method to a vanishing gradient, which makes the answer reproducible. Nothing of size n x n is formed in a step;
//! the dissimilarities themselves are kept.

use super::Point;
use super::dissimilarities::Dissimilarities;
use super::pins::Pin;
use super::stress::{Places, Problem, Slope};
use crate::linalg::kernels::{axpy, dot, norm_squared};

/// Majorisation ends when a step lowers the stress by less than this share of it. On 291 layouts of real sequences, whole and in parts, at m = 3, 7 and
/// 42, every value from 1e-3 to 1e-7 led to the minimum that majorisation alone reaches.
const MAJORISED: f64 = 3e-4;
const MAJORISATION_STEPS: usize = 3000;
/// The first Newton step is at most this many times as long as the next majorising one, which keeps it in the basin.
const FIRST_RADIUS: f64 = 3.0;
/// The gradient has vanished when its norm is below this share of the norm of the attraction n P.
pub(super) const VANISHED: f64 = 1e-13;
const NEWTON_STEPS: usize = 200;
/// Curvature below this share of n, the typical one, is rounding.
const FLAT: f64 = 1e-11;

/// How many steps a minimum took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Steps {
    /// Guttman transforms.
    pub majorising: usize,
    /// Newton steps.
    pub newton: usize,
    /// Products with the Hessian, inside the Newton steps.
    pub inner: usize,
}

/// Moves the free points of `positions`, whose order in the problem is `order`, to a minimum: by majorisation and then Newton's method.
pub(super) fn minimise(problem: &Problem, order: &[usize], positions: &mut [Point]) -> Steps {
    let mut steps = Steps::default();
    let layout = Places::of(order, positions);
    let (layout, slope) = majorisation(problem, layout, &mut steps);
    newton(problem, layout, slope, &mut steps).write(&order[..problem.free], positions);
    steps
}

/// The majorising step (Guttman transform): n p_i - sum_j p_j = pull_i for the free points. Without fixed points the centroid stays.
fn majorise(problem: &Problem, layout: &Places, slope: &Slope) -> Places {
    let (n, f) = (problem.delta.len(), problem.free);
    let all = layout.sum();
    let mut next = layout.clone();
    let pulls = slope.pull.split_at(f);
    let axes = [
        (&mut next.x, pulls.0, all[0]),
        (&mut next.y, pulls.1, all[1]),
    ];
    for (values, pulls, sum) in axes {
        let pull: f64 = pulls.iter().sum();
        let fixed: f64 = values[f..].iter().sum();
        let free = if f < n {
            (f as f64 * fixed + pull) / (n - f) as f64
        } else {
            sum
        };
        for (value, pull) in values[..f].iter_mut().zip(pulls) {
            *value = (free + fixed + pull) / n as f64;
        }
    }
    next
}

/// Majorises until a step lowers the stress by less than [`MAJORISED`] of it.
fn majorisation(problem: &Problem, mut layout: Places, steps: &mut Steps) -> (Places, Slope) {
    let mut slope = problem.slope(&layout);
    for _ in 0..MAJORISATION_STEPS {
        steps.majorising += 1;
        let next = majorise(problem, &layout, &slope);
        let next_slope = problem.slope(&next);
        let decrease = slope.stress - next_slope.stress;
        (layout, slope) = (next, next_slope);
        if decrease <= MAJORISED * slope.stress {
            break;
        }
    }
    (layout, slope)
}

/// The step of the Newton model inside a disc of this radius, by conjugate gradients (Steihaug 1983), and the decrease it predicts.
fn newton_step(
    problem: &Problem,
    layout: &Places,
    gradient: &[f64],
    radius: f64,
    steps: &mut Steps,
) -> (Vec<f64>, f64) {
    let norm = norm_squared(gradient).sqrt();
    let relative = norm / problem.typical_gradient(layout);
    let target = norm * (1000.0 * relative).clamp(1e-4, 0.5);
    let mut step = vec![0.0; gradient.len()];
    let mut residual = gradient.to_vec();
    let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut square = norm_squared(&residual);
    let mut image = vec![0.0; gradient.len()];
    for _ in 0..2 * gradient.len() {
        steps.inner += 1;
        let product = problem.hessian_times(layout, &direction);
        let curvature = dot(&direction, &product);
        let rounding = FLAT * problem.delta.len() as f64 * norm_squared(&direction);
        if curvature.abs() <= rounding {
            break; // turning the whole layout costs nothing and gains nothing
        }
        let length = square / curvature;
        let mut next = step.clone();
        axpy(length, &direction, &mut next);
        if curvature < 0.0 || norm_squared(&next) > radius * radius {
            let to_edge = to_boundary(&step, &direction, radius);
            axpy(to_edge, &direction, &mut step);
            axpy(to_edge, &product, &mut image);
            break;
        }
        step = next;
        axpy(length, &product, &mut image);
        axpy(length, &product, &mut residual);
        let next_square = norm_squared(&residual);
        if next_square.sqrt() <= target {
            break;
        }
        for (d, r) in direction.iter_mut().zip(&residual) {
            *d = *d * (next_square / square) - r;
        }
        square = next_square;
    }
    let predicted = -dot(gradient, &step) - dot(&image, &step) / 2.0;
    (step, predicted)
}

/// The positive length at which step + length * direction leaves the disc.
fn to_boundary(step: &[f64], direction: &[f64], radius: f64) -> f64 {
    let a = norm_squared(direction);
    let b = dot(step, direction);
    let c = norm_squared(step) - radius * radius;
    (-b + (b * b - a * c).max(0.0).sqrt()) / a
}

/// Trust-region Newton until the gradient vanishes or rounding stops it.
fn newton(problem: &Problem, mut layout: Places, mut slope: Slope, steps: &mut Steps) -> Places {
    let scale = problem.typical_gradient(&layout);
    let mut radius =
        FIRST_RADIUS * norm_squared(&slope.gradient).sqrt() / problem.delta.len() as f64;
    for _ in 0..NEWTON_STEPS {
        let norm = norm_squared(&slope.gradient).sqrt();
        if norm <= VANISHED * scale {
            break;
        }
        steps.newton += 1;
        let (step, predicted) = newton_step(problem, &layout, &slope.gradient, radius, steps);
        let next = layout.moved(&step);
        let next_slope = problem.slope(&next);
        // Half the stress is what the model speaks of. Below rounding the gradient judges instead.
        let actual = (slope.stress - next_slope.stress) / 2.0;
        let next_norm = norm_squared(&next_slope.gradient).sqrt();
        let below_rounding = predicted <= 1e-11 * slope.stress;
        if below_rounding && next_norm >= norm {
            break;
        }
        let agreement = if below_rounding {
            1.0
        } else {
            actual / predicted
        };
        let length = norm_squared(&step).sqrt();
        if agreement < 0.25 {
            radius = length / 4.0;
        } else if agreement > 0.75 && length > 0.99 * radius {
            radius *= 2.0;
        }
        if agreement > 1e-4 {
            (layout, slope) = (next, next_slope);
        }
    }
    layout
}

/// Minimises the raw stress (6) over the points that are not pinned, from `start` (n points); pinned points come back exactly as pinned.
///
/// A local minimum is found: the one whose basin the start is in. O(n^2) a step; the steps read the dissimilarities and form nothing of their size.
/// Pins must be valid ([`super::pins::validate_pins`]) and `start` finite.
pub fn scale(delta: &Dissimilarities, start: &[Point], pins: &[Pin]) -> Vec<Point> {
    scale_counting(delta, start, pins).0
}

/// [`scale`], and how many steps it took.
pub fn scale_counting(
    delta: &Dissimilarities,
    start: &[Point],
    pins: &[Pin],
) -> (Vec<Point>, Steps) {
    let mut positions = start.to_vec();
    let mut pinned = vec![false; start.len()];
    for pin in pins {
        positions[pin.frame] = pin.position;
        pinned[pin.frame] = true;
    }
    let (order, free) = free_first(&pinned);
    let problem = Problem::new(delta.permuted(&order), free);
    let steps = minimise(&problem, &order, &mut positions);
    (positions, steps)
}

/// The order of the points in which those not pinned come first, and how many these are.
pub(super) fn free_first(pinned: &[bool]) -> (Vec<usize>, usize) {
    let (mut order, fixed): (Vec<usize>, Vec<usize>) = (0..pinned.len()).partition(|&i| !pinned[i]);
    let free = order.len();
    order.extend(fixed);
    (order, free)
}

#[cfg(test)]
mod tests {
    use super::super::stress::stress;
    use super::*;
    use faer::Mat;
    use proptest::prelude::*;

    fn sample(n: usize) -> Mat<f64> {
        Mat::from_fn(4, n, |a, i| {
            ((i + 1) as f64 * (a as f64 + 0.4)).sin() / (a + 1) as f64
        })
    }

    fn start(x: &Mat<f64>) -> Vec<Point> {
        super::super::pins::principal_start(x.as_ref(), &[])
    }

    /// Half the gradient of the stress, written out.
    fn gradient(delta: &Dissimilarities, p: &[Point], i: usize) -> Point {
        let mut g = [0.0; 2];
        for (j, q) in p.iter().enumerate() {
            let d = super::super::distance(p[i], *q);
            if j != i && d > 0.0 {
                for a in 0..2 {
                    g[a] += (1.0 - delta.row(i)[j] / d) * (p[i][a] - q[a]);
                }
            }
        }
        g
    }

    #[test]
    fn the_gradient_vanishes_at_the_free_points_and_pins_stay() {
        let x = sample(40);
        let delta = Dissimilarities::new(x.as_ref());
        let pins = [
            Pin {
                frame: 3,
                position: [1.5, 0.2],
            },
            Pin {
                frame: 17,
                position: [-0.4, -1.0],
            },
        ];
        for pins in [&pins[..0], &pins[..1], &pins] {
            let p = scale(&delta, &start(&x), pins);
            for i in 0..40 {
                if pins.iter().all(|pin| pin.frame != i) {
                    let g = gradient(&delta, &p, i);
                    assert!(g[0].hypot(g[1]) < 1e-10, "{i}: {g:?}");
                }
            }
            for pin in pins {
                assert_eq!(p[pin.frame], pin.position);
            }
            assert!(stress(&delta, &p) <= stress(&delta, &scale_start(&x, pins)));
        }
    }

    fn scale_start(x: &Mat<f64>, pins: &[Pin]) -> Vec<Point> {
        let mut start = start(x);
        for pin in pins {
            start[pin.frame] = pin.position;
        }
        start
    }

    #[test]
    fn planar_points_are_found_exactly() {
        let x = Mat::from_fn(2, 30, |a, i| ((i * (a + 2)) as f64).sin());
        let delta = Dissimilarities::new(x.as_ref());
        let shaken: Vec<Point> = (0..30)
            .map(|i| [x[(0, i)] + 0.1 * (i as f64).cos(), x[(1, i)]])
            .collect();
        assert!(stress(&delta, &scale(&delta, &shaken, &[])) < 1e-20);
    }

    #[test]
    fn repeated_points_stay_together() {
        let x = Mat::from_fn(3, 20, |a, i| ((i % 10 + 1) as f64 * (a as f64 + 0.4)).sin());
        let p = scale(&Dissimilarities::new(x.as_ref()), &start(&x), &[]);
        for i in 0..10 {
            assert!(super::super::distance(p[i], p[i + 10]) < 1e-9);
        }
    }

    proptest! {
        #[test]
        fn never_worse_than_the_start_and_always_finite(values in prop::collection::vec(-10.0f64..10.0, 3 * 9)) {
            let x = Mat::from_fn(3, 9, |a, i| values[i * 3 + a]);
            let delta = Dissimilarities::new(x.as_ref());
            let p = scale(&delta, &start(&x), &[]);
            prop_assert!(p.iter().flatten().all(|v| v.is_finite()));
            prop_assert!(stress(&delta, &p) <= stress(&delta, &start(&x)) * (1.0 + 1e-12));
        }
    }
}
