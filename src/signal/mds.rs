//! Pose-space positions by multidimensional scaling of the shape coordinates (section 3.2.1, the stress (6)), with or without fixed positions.
//!
//! Reading 6: raw stress, unit weights, no rescaling; majorisation first (SMACOF restricted to the free points), which stays in the basin of the
//! start, then a Newton method to a vanishing gradient, which makes the answer reproducible. Nothing of size n x n is formed in a step;
//! the dissimilarities themselves are kept.

use faer::MatRef;
use rayon::prelude::*;

use super::Point;
use crate::linalg::kernels::{LANES, total, vectorised};

use super::pins::Pin;

/// Majorisation ends when a step lowers the stress by less than this share of it.
const MAJORISED: f64 = 1e-7;
const MAJORISATION_STEPS: usize = 3000;
/// The gradient has vanished when its norm is below this share of the norm of the attraction n P.
const VANISHED: f64 = 1e-13;
const NEWTON_STEPS: usize = 200;
/// Curvature below this share of n, the typical one, is rounding.
const FLAT: f64 = 1e-11;
/// Rows a parallel task handles; below this many points one thread is faster.
const ROWS_PER_TASK: usize = 64;

/// The dissimilarities delta_ij = ||x_i - x_j||, n x n, kept whole so that rows are contiguous.
#[derive(Clone, Debug)]
pub struct Dissimilarities {
    n: usize,
    values: Vec<f64>,
}

impl Dissimilarities {
    /// From coordinates X, m x n. O(n^2 m).
    pub fn new(coordinates: MatRef<'_, f64>) -> Self {
        let n = coordinates.ncols();
        let x = coordinates.to_owned();
        let mut values = vec![0.0; n * n];
        values
            .par_chunks_mut(n.max(1))
            .enumerate()
            .for_each(|(i, row)| {
                for (j, delta) in row.iter_mut().enumerate() {
                    *delta = separation(x.col_as_slice(i), x.col_as_slice(j));
                }
            });
        Self { n, values }
    }

    fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.n..(i + 1) * self.n]
    }

    /// Rows and columns in another order.
    fn permuted(&self, order: &[usize]) -> Self {
        let rows = order.iter().map(|&i| self.row(i));
        let values = rows.flat_map(|row| order.iter().map(|&j| row[j])).collect();
        Self { n: self.n, values }
    }
}

vectorised! {
    /// The distance between two points of the same dimension; symmetric to the bit.
    pub fn separation(a: &[f64], b: &[f64]) -> f64 {
        let mut lanes = [0.0; LANES];
        let (a_chunks, a_rest) = a.as_chunks::<LANES>();
        let (b_chunks, b_rest) = b.as_chunks::<LANES>();
        for (x, y) in a_chunks.iter().zip(b_chunks) {
            for lane in 0..LANES {
                lanes[lane] += (x[lane] - y[lane]) * (x[lane] - y[lane]);
            }
        }
        for ((lane, x), y) in lanes.iter_mut().zip(a_rest).zip(b_rest) {
            *lane += (x - y) * (x - y);
        }
        total(lanes).sqrt()
    }
}

vectorised! {
    /// [pull x, pull y, stress] of point `at`: sum_j (delta_ij / d_ij) (p_i - p_j) and sum_j (d_ij - delta_ij)^2. Coincident points exert no pull.
    pub fn row_pull(at: Point, x: &[f64], y: &[f64], delta: &[f64]) -> [f64; 3] {
        let mut sums = [[0.0; LANES]; 3];
        let mut add = |lane: usize, x: f64, y: f64, delta: f64| {
            let (dx, dy) = (at[0] - x, at[1] - y);
            let d = (dx * dx + dy * dy).sqrt();
            let ratio = if d > 0.0 { delta / d } else { 0.0 };
            sums[0][lane] += ratio * dx;
            sums[1][lane] += ratio * dy;
            sums[2][lane] += (d - delta) * (d - delta);
        };
        let (x_chunks, x_rest) = x.as_chunks::<LANES>();
        let (y_chunks, y_rest) = y.as_chunks::<LANES>();
        let (delta_chunks, delta_rest) = delta.as_chunks::<LANES>();
        for ((x, y), delta) in x_chunks.iter().zip(y_chunks).zip(delta_chunks) {
            for lane in 0..LANES {
                add(lane, x[lane], y[lane], delta[lane]);
            }
        }
        for (lane, ((&x, &y), &delta)) in x_rest.iter().zip(y_rest).zip(delta_rest).enumerate() {
            add(lane, x, y, delta);
        }
        sums.map(total)
    }
}

vectorised! {
    /// Row `at` of the Hessian of half the stress, times the displacement (u, v): sum_j K_ij (w_i - w_j) with
    /// K = (1 - delta/d) I + (delta/d^3) e e^T, e = p_i - p_j; K = I where delta is 0.
    pub fn row_hessian(at: Point, w: Point, plane: [&[f64]; 2], moved: [&[f64]; 2], delta: &[f64]) -> Point {
        let n = delta.len();
        let [x, y] = plane.map(|a| &a[..n]);
        let [u, v] = moved.map(|a| &a[..n]);
        let mut sums = [[0.0; LANES]; 2];
        let mut add = |lane: usize, j: usize| {
            let (dx, dy) = (at[0] - x[j], at[1] - y[j]);
            let (du, dv) = (w[0] - u[j], w[1] - v[j]);
            let q = dx * dx + dy * dy;
            let ratio = if q > 0.0 { delta[j] / q.sqrt() } else { 0.0 };
            let along = if q > 0.0 { ratio * (dx * du + dy * dv) / q } else { 0.0 };
            sums[0][lane] += (1.0 - ratio) * du + along * dx;
            sums[1][lane] += (1.0 - ratio) * dv + along * dy;
        };
        let whole = n / LANES * LANES;
        for first in (0..whole).step_by(LANES) {
            for lane in 0..LANES {
                add(lane, first + lane);
            }
        }
        for j in whole..n {
            add(j - whole, j);
        }
        sums.map(total)
    }
}

/// Runs `row` for each of the first `count` points, in parallel where it pays; the bits do not depend on the number of threads.
fn for_rows<T: Send>(count: usize, row: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if count < 2 * ROWS_PER_TASK {
        return (0..count).map(row).collect();
    }
    (0..count)
        .into_par_iter()
        .with_min_len(ROWS_PER_TASK)
        .map(row)
        .collect()
}

/// The scaling problem, free points first.
struct Problem {
    delta: Dissimilarities,
    free: usize,
}

/// Positions, one array a coordinate, for rows of vector arithmetic; free points first.
#[derive(Clone)]
struct Layout {
    x: Vec<f64>,
    y: Vec<f64>,
}

/// What one pass over the pairs gives at a layout.
struct Slope {
    /// sum_j (delta_ij / d_ij) (p_i - p_j) of each free point.
    pull: Vec<Point>,
    /// Half the gradient of the stress at each free point.
    gradient: Vec<Point>,
    /// The stress (6) of the pairs that involve a free point.
    stress: f64,
}

impl Layout {
    fn sum(&self) -> Point {
        [self.x.iter().sum(), self.y.iter().sum()]
    }

    fn point(&self, i: usize) -> Point {
        [self.x[i], self.y[i]]
    }

    fn moved(&self, step: &[Point]) -> Self {
        let mut moved = self.clone();
        for (i, s) in step.iter().enumerate() {
            moved.x[i] += s[0];
            moved.y[i] += s[1];
        }
        moved
    }
}

impl Problem {
    /// The norm of n P about its centroid: what pulls the points together, and pushes them apart at a minimum.
    fn typical_gradient(&self, layout: &Layout) -> f64 {
        let n = self.delta.n as f64;
        let centre = layout.sum().map(|sum| sum / n);
        let spread = |values: &[f64], c: f64| values.iter().map(|v| (v - c).powi(2)).sum::<f64>();
        n * (spread(&layout.x, centre[0]) + spread(&layout.y, centre[1])).sqrt()
    }

    /// Each pair of free points is seen from both its ends, a pair with a fixed point from one.
    fn slope(&self, layout: &Layout) -> Slope {
        let (n, f, sum) = (self.delta.n as f64, self.free, layout.sum());
        let rows = for_rows(f, |i| {
            let (at, delta) = (layout.point(i), self.delta.row(i));
            let free = row_pull(at, &layout.x[..f], &layout.y[..f], &delta[..f]);
            let fixed = row_pull(at, &layout.x[f..], &layout.y[f..], &delta[f..]);
            let pull = [free[0] + fixed[0], free[1] + fixed[1]];
            let gradient = [0, 1].map(|a| n * at[a] - sum[a] - pull[a]);
            (pull, gradient, free[2] / 2.0 + fixed[2])
        });
        Slope {
            pull: rows.iter().map(|r| r.0).collect(),
            gradient: rows.iter().map(|r| r.1).collect(),
            stress: rows.iter().map(|r| r.2).sum(),
        }
    }

    /// The majorising step (Guttman transform): n p_i - sum_j p_j = pull_i for the free points. Without fixed points the centroid stays.
    fn majorise(&self, layout: &Layout, slope: &Slope) -> Layout {
        let (n, f) = (self.delta.n, self.free);
        let all = layout.sum();
        let mut next = layout.clone();
        for (axis, values) in [&mut next.x, &mut next.y].into_iter().enumerate() {
            let pull: f64 = slope.pull.iter().map(|p| p[axis]).sum();
            let fixed: f64 = values[f..].iter().sum();
            let free = if f < n {
                (f as f64 * fixed + pull) / (n - f) as f64
            } else {
                all[axis]
            };
            for (value, pull) in values[..f].iter_mut().zip(&slope.pull) {
                *value = (free + fixed + pull[axis]) / n as f64;
            }
        }
        next
    }

    /// The Hessian of half the stress times a displacement of the free points.
    fn hessian_times(&self, layout: &Layout, step: &[Point]) -> Vec<Point> {
        let n = self.delta.n;
        let mut moved = [vec![0.0; n], vec![0.0; n]];
        for (i, s) in step.iter().enumerate() {
            moved[0][i] = s[0];
            moved[1][i] = s[1];
        }
        let [u, v] = &moved;
        for_rows(self.free, |i| {
            row_hessian(
                layout.point(i),
                step[i],
                [&layout.x, &layout.y],
                [u, v],
                self.delta.row(i),
            )
        })
    }
}

fn inner(a: &[Point], b: &[Point]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| a[0] * b[0] + a[1] * b[1])
        .sum()
}

fn add_scaled(a: &mut [Point], factor: f64, b: &[Point]) {
    for (a, b) in a.iter_mut().zip(b) {
        a[0] += factor * b[0];
        a[1] += factor * b[1];
    }
}

/// Majorises until a step lowers the stress by less than [`MAJORISED`] of it.
fn majorisation(problem: &Problem, mut layout: Layout) -> (Layout, Slope) {
    let mut slope = problem.slope(&layout);
    for _ in 0..MAJORISATION_STEPS {
        let next = problem.majorise(&layout, &slope);
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
    layout: &Layout,
    gradient: &[Point],
    radius: f64,
) -> (Vec<Point>, f64) {
    let norm = inner(gradient, gradient).sqrt();
    let relative = norm / problem.typical_gradient(layout);
    let target = norm * (10.0 * relative).clamp(1e-4, 0.05);
    let mut step = vec![[0.0; 2]; gradient.len()];
    let mut residual = gradient.to_vec();
    let mut direction: Vec<Point> = gradient.iter().map(|g| [-g[0], -g[1]]).collect();
    let mut square = inner(&residual, &residual);
    let mut image = vec![[0.0; 2]; gradient.len()];
    for _ in 0..4 * gradient.len() {
        let product = problem.hessian_times(layout, &direction);
        let curvature = inner(&direction, &product);
        let rounding = FLAT * problem.delta.n as f64 * inner(&direction, &direction);
        if curvature.abs() <= rounding {
            break; // turning the whole layout costs nothing and gains nothing
        }
        let length = square / curvature;
        let mut next = step.clone();
        add_scaled(&mut next, length, &direction);
        if curvature < 0.0 || inner(&next, &next) > radius * radius {
            let to_edge = to_boundary(&step, &direction, radius);
            add_scaled(&mut step, to_edge, &direction);
            add_scaled(&mut image, to_edge, &product);
            break;
        }
        step = next;
        add_scaled(&mut image, length, &product);
        add_scaled(&mut residual, length, &product);
        let next_square = inner(&residual, &residual);
        if next_square.sqrt() <= target {
            break;
        }
        for (d, r) in direction.iter_mut().zip(&residual) {
            *d = [0, 1].map(|a| d[a] * (next_square / square) - r[a]);
        }
        square = next_square;
    }
    let predicted = -inner(gradient, &step) - inner(&image, &step) / 2.0;
    (step, predicted)
}

/// The positive length at which step + length * direction leaves the disc.
fn to_boundary(step: &[Point], direction: &[Point], radius: f64) -> f64 {
    let a = inner(direction, direction);
    let b = inner(step, direction);
    let c = inner(step, step) - radius * radius;
    (-b + (b * b - a * c).max(0.0).sqrt()) / a
}

/// Trust-region Newton until the gradient vanishes or rounding stops it.
fn newton(problem: &Problem, mut layout: Layout, mut slope: Slope) -> Layout {
    let scale = problem.typical_gradient(&layout);
    let mut radius = scale / (10.0 * problem.delta.n as f64);
    for _ in 0..NEWTON_STEPS {
        let norm = inner(&slope.gradient, &slope.gradient).sqrt();
        if norm <= VANISHED * scale {
            break;
        }
        let (step, predicted) = newton_step(problem, &layout, &slope.gradient, radius);
        let next = layout.moved(&step);
        let next_slope = problem.slope(&next);
        // Half the stress is what the model speaks of. Below rounding the gradient judges instead.
        let actual = (slope.stress - next_slope.stress) / 2.0;
        let next_norm = inner(&next_slope.gradient, &next_slope.gradient).sqrt();
        let below_rounding = predicted <= 1e-11 * slope.stress;
        if below_rounding && next_norm >= norm {
            break;
        }
        let agreement = if below_rounding {
            1.0
        } else {
            actual / predicted
        };
        let length = inner(&step, &step).sqrt();
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
    let mut start = start.to_vec();
    let mut pinned = vec![false; start.len()];
    for pin in pins {
        start[pin.frame] = pin.position;
        pinned[pin.frame] = true;
    }
    let (mut order, fixed): (Vec<usize>, Vec<usize>) = (0..start.len()).partition(|&i| !pinned[i]);
    let free = order.len();
    order.extend(fixed);
    let problem = Problem {
        delta: delta.permuted(&order),
        free,
    };
    let layout = Layout {
        x: order.iter().map(|&i| start[i][0]).collect(),
        y: order.iter().map(|&i| start[i][1]).collect(),
    };
    let (layout, slope) = majorisation(&problem, layout);
    let layout = newton(&problem, layout, slope);
    for (k, &i) in order.iter().enumerate().take(free) {
        start[i] = layout.point(k);
    }
    start
}

/// The stress (6) of a layout: sum over pairs of (||p_i - p_j|| - delta_ij)^2. O(n^2).
pub fn stress(delta: &Dissimilarities, points: &[Point]) -> f64 {
    let pairs = |i: usize| {
        (0..i).map(move |j| (super::distance(points[i], points[j]) - delta.row(i)[j]).powi(2))
    };
    (0..points.len()).map(|i| pairs(i).sum::<f64>()).sum()
}

#[cfg(test)]
mod tests {
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
