//! Where in-betweens go astray: places along the time signal at which the pose surface forms a saddle, the defect of Figure 3 whose detection section 6
//! leaves to future work.
//!
//! Two signs are taken, half way between every two frames: how far g(f(t)) is from the natural cubic spline through the shape coordinates, in steps of
//! the motion, which is the damage itself; and the Gaussian curvature of the surface g, which is negative at saddles.

use super::cubic::{CubicSpline, Ends};
use super::fit::Fit;
use super::g::PoseSignal;
use super::{Point, distance};
use crate::linalg::kernels::{axpy, dot};

/// In-betweens farther than this share of a step from the cubic spline have left the neighbourhood of their neighbours. Half way along an arc of 60
/// degrees a step the chord is off by 0.13 of a step, and motion sampled more coarsely than that tells little of its in-betweens.
pub const ASTRAY: f64 = 0.25;
/// Where a motion stands still or nearly so, this share of its mean step is what its in-betweens are measured by.
const STILL: f64 = 0.1;
/// A step of less than this share of the mean step is none.
const HELD: f64 = 1e-9;
/// Where the tangents of g are nearer than this to parallel (the square of a sine), the surface has no tangent plane to speak of.
const PARALLEL: f64 = 1e-12;

/// What is found half way between frame i and the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Frame time i + 1/2, frames counted from 1.
    pub time: f64,
    /// f(time).
    pub point: Point,
    /// Distance in shape coordinates of g(f(time)) from the cubic spline (from the frame where two are equal), less the greater of the errors of g(f(i)) and g(f(i + 1)), over the mean
    /// length of the steps from i - 1 to i + 2, or a tenth of all steps' mean where that is more. What a fit of few sites smooths away at the frames does not count; 0 is the least.
    pub stray: f64,
    /// Gaussian curvature of the surface g at f(time), times the square of that mean length, which leaves no unit: how much a patch the size of a
    /// step turns. None where g has no tangent plane, as on a collinear layout.
    pub curvature: Option<f64>,
}

impl Place {
    /// Whether the in-between leaves the neighbourhood of its neighbours.
    pub fn is_astray(&self) -> bool {
        self.stray > ASTRAY
    }

    /// Whether the surface is a saddle there.
    pub fn is_saddle(&self) -> bool {
        self.curvature.is_some_and(|k| k < 0.0)
    }
}

/// The n - 1 places half way between frames. O(n l m).
pub fn places(fit: &Fit) -> Vec<Place> {
    let x = fit.coordinates.as_ref();
    let (m, n) = x.shape();
    let frames: Vec<&[f64]> = (0..n).map(|i| fit.coordinates.col_as_slice(i)).collect();
    let steps: Vec<f64> = frames
        .windows(2)
        .map(|w| super::dissimilarities::separation(w[0], w[1]))
        .collect();
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    let witness = CubicSpline::new(x, Ends::Natural).midpoints();
    let mut value = vec![0.0; m];
    // Distance of g(f(time)) from this point.
    let mut away = |time: f64, from: &[f64]| {
        let point = fit.representation.time.evaluate(time);
        fit.representation.pose.evaluate_into(point, &mut value);
        super::dissimilarities::separation(&value, from)
    };
    let errors: Vec<f64> = (0..n).map(|i| away((i + 1) as f64, frames[i])).collect();
    (0..steps.len())
        .map(|i| {
            let time = i as f64 + 1.5;
            let point = fit.representation.time.evaluate(time);
            let beside = &steps[i.saturating_sub(1)..(i + 2).min(steps.len())];
            let step = beside.iter().sum::<f64>() / beside.len() as f64;
            // Between two frames of one pose there is that pose, whatever a cubic makes of the steps around.
            let held = steps[i] <= HELD * mean;
            let expected = if held {
                frames[i]
            } else {
                witness.col_as_slice(i)
            };
            let beyond = away(time, expected) - errors[i].max(errors[i + 1]);
            let scale = step.max(STILL * mean);
            Place {
                time,
                point,
                stray: if scale > 0.0 {
                    beyond.max(0.0) / scale
                } else {
                    0.0
                },
                curvature: gaussian_curvature(&fit.representation.pose, point)
                    .map(|k| k * step * step),
            }
        })
        .collect()
}

/// The Gaussian curvature of the surface g: R^2 -> R^m at p, by the equation of Gauss: (II_xx . II_yy - |II_xy|^2) / (E G - F^2), II being the parts of the
/// second derivatives normal to the surface. None where the tangents are parallel or 0, and at a site, where second derivatives are infinite. O(l m).
pub fn gaussian_curvature(pose: &PoseSignal, p: Point) -> Option<f64> {
    if pose.sites.iter().any(|&s| distance(s, p) == 0.0) {
        return None;
    }
    let [x, y, xx, xy, yy] = derivatives(pose, p);
    let (e, f, g) = (dot(&x, &x), dot(&x, &y), dot(&y, &y));
    let area = e * g - f * f;
    if area.is_nan() || area <= PARALLEL * e * g {
        return None;
    }
    // a . b less the product of the tangential parts.
    let normal = |a: &[f64], b: &[f64]| {
        let (ax, ay, bx, by) = (dot(a, &x), dot(a, &y), dot(b, &x), dot(b, &y));
        dot(a, b) - (g * ax * bx - f * (ax * by + ay * bx) + e * ay * by) / area
    };
    Some((normal(&xx, &yy) - normal(&xy, &xy)) / area)
}

/// g_x, g_y, g_xx, g_xy and g_yy at p, which is no site. With q = r^2, phi = q ln(q) / 2.
fn derivatives(pose: &PoseSignal, p: Point) -> [Vec<f64>; 5] {
    let l = pose.sites.len();
    let column = |j: usize| pose.coefficients.col_as_slice(j);
    let zero = vec![0.0; pose.coefficients.nrows()];
    let mut sums = [
        column(l + 1).to_vec(),
        column(l + 2).to_vec(),
        zero.clone(),
        zero.clone(),
        zero,
    ];
    for (j, s) in pose.sites.iter().enumerate() {
        let (x, y) = (p[0] - s[0], p[1] - s[1]);
        let q = x * x + y * y;
        let log = q.ln() + 1.0;
        let terms = [
            x * log,
            y * log,
            log + 2.0 * x * x / q,
            2.0 * x * y / q,
            log + 2.0 * y * y / q,
        ];
        for (sum, term) in sums.iter_mut().zip(terms) {
            axpy(term, column(j + 1), sum);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::fit::{FitOptions, fit};
    use crate::signal::knots::KnotRule;
    use crate::signal::layout::Layout;
    use faer::Mat;

    fn grid() -> Vec<Point> {
        (0..81)
            .map(|i| [(i % 9) as f64 / 4.0 - 1.0, (i / 9) as f64 / 4.0 - 1.0])
            .collect()
    }

    /// g through the graph of a function over a grid.
    fn graph(height: impl Fn(Point) -> f64) -> PoseSignal {
        let p = grid();
        let x = Mat::from_fn(3, p.len(), |a, i| [p[i][0], p[i][1], height(p[i])][a]);
        PoseSignal::fit(&p, x.as_ref(), &(0..p.len()).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn derivatives_are_those_of_g() {
        let pose = graph(|p| (2.0 * p[0]).sin() * (1.0 + p[1] * p[1]));
        let (p, h) = ([0.13, -0.31], 1e-4);
        let at = |dx: f64, dy: f64| {
            let mut x = vec![0.0; 3];
            pose.evaluate_into([p[0] + h * dx, p[1] + h * dy], &mut x);
            x[2]
        };
        let d = derivatives(&pose, p);
        let expected = [
            (at(1.0, 0.0) - at(-1.0, 0.0)) / (2.0 * h),
            (at(0.0, 1.0) - at(0.0, -1.0)) / (2.0 * h),
            (at(1.0, 0.0) - 2.0 * at(0.0, 0.0) + at(-1.0, 0.0)) / (h * h),
            (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / (4.0 * h * h),
            (at(0.0, 1.0) - 2.0 * at(0.0, 0.0) + at(0.0, -1.0)) / (h * h),
        ];
        for (d, e) in d.iter().zip(expected) {
            assert!((d[2] - e).abs() < 1e-4 * (1.0 + e.abs()), "{} {e}", d[2]);
        }
    }

    #[test]
    fn bowls_are_positive_saddles_negative_and_planes_flat() {
        let at = |pose: &PoseSignal| gaussian_curvature(pose, [0.1, 0.12]).unwrap();
        // At the bottom of z = a x^2 + b y^2 the curvature is 4 a b.
        let bowl = at(&graph(|p| 0.3 * (p[0] * p[0] + p[1] * p[1])));
        let saddle = at(&graph(|p| 0.3 * (p[0] * p[0] - p[1] * p[1])));
        assert!((0.2..0.5).contains(&bowl), "{bowl}");
        assert!((-0.5..-0.2).contains(&saddle), "{saddle}");
        assert!(at(&graph(|p| 0.3 * p[0] - p[1])).abs() < 1e-9);
        let pose = graph(|p| p[0]);
        assert_eq!(gaussian_curvature(&pose, pose.sites[40]), None);
    }

    fn fitted(layout: Layout) -> Fit {
        // A helix that turns over: its turns lie on each other in the plane of the first two principal coordinates.
        let z = Mat::from_fn(4, 60, |a, i| {
            let t = i as f64 * 0.37;
            [
                10.0 * t.cos(),
                10.0 * (1.013 * t).sin(),
                6.0 * (0.21 * t).sin(),
                5.0 * (0.17 * t).cos(),
            ][a]
        });
        let options = FitOptions {
            k: 62,
            l: 60,
            m: 4,
            knots: KnotRule::Symmetric,
            layout,
            pins: Vec::new(),
        };
        fit(z.as_ref(), &options).unwrap()
    }

    #[test]
    fn stretches_side_by_side_in_the_plane_are_found_and_order_removes_them() {
        let astray = |layout| {
            let places = places(&fitted(layout));
            assert_eq!(places.len(), 59);
            assert_eq!(places[3].time, 4.5);
            places.iter().filter(|p| p.is_astray()).count()
        };
        let (mds, ordered) = (
            astray(Layout::Mds),
            astray(Layout::Ordered { weight: None }),
        );
        assert!(mds > 5 && ordered == 0, "{mds} {ordered}");
    }

    #[test]
    fn a_pose_held_for_some_frames_is_measured_by_the_motion_around_it() {
        let z = Mat::from_fn(3, 24, |a, i| {
            let t = 0.4
                * if i < 10 {
                    i
                } else {
                    i.saturating_sub(5).max(10)
                } as f64;
            [10.0 * t.cos(), 10.0 * t.sin(), 3.0 * (0.7 * t).sin()][a]
        });
        let found = places(&fit(z.as_ref(), &FitOptions::new(14, 10, 3)).unwrap());
        assert!(found.iter().all(|p| p.stray < 10.0), "{found:?}");
    }

    #[test]
    fn frames_that_stand_still_are_no_place_to_go_astray() {
        let z = Mat::from_fn(5, 8, |a, _| a as f64);
        let options = FitOptions {
            k: 8,
            l: 8,
            m: 5,
            knots: KnotRule::Symmetric,
            layout: Layout::Ordered { weight: None },
            pins: Vec::new(),
        };
        let found = places(&fit(z.as_ref(), &options).unwrap());
        assert!(
            found
                .iter()
                .all(|p| p.stray == 0.0 && p.curvature.is_none())
        );
    }
}
