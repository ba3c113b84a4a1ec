//! Pose-space positions by multidimensional scaling of the shape coordinates (section 3.2.1, the stress (6)), with or without fixed positions.
//!
//! Reading 6: raw stress, unit weights, no rescaling; majorisation first (SMACOF restricted to the free points), which stays in the basin of the
//! start, then a Newton method to a vanishing gradient, which makes the answer reproducible. Nothing of size n x n is formed in a step;
//! the dissimilarities themselves are kept.

use std::ops::Range;

use faer::MatRef;
use rayon::prelude::*;

use super::Point;
use super::pins::Pin;
use crate::linalg::kernels::{LANES, axpy, dot, norm_squared, sum, total, vectorised};

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
/// Pairs that one thread sees through before another could begin to help.
const PAIRS_ALONE: usize = 60_000;
/// Sums over more pairs are made in this many parts, added up in a fixed order: the bits do not depend on the number of threads.
const PARTS: usize = 8;

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
            .with_min_len(PAIRS_ALONE / 8 / n.max(1) + 1)
            .enumerate()
            .for_each(|(i, row)| {
                for (j, delta) in row.iter_mut().enumerate() {
                    *delta = separation(x.col_as_slice(i), x.col_as_slice(j));
                }
            });
        Self { n, values }
    }

    /// delta_ij of every pair, which must be symmetric and 0 on the diagonal.
    pub(super) fn from_fn(n: usize, mut delta: impl FnMut(usize, usize) -> f64) -> Self {
        let mut values = Vec::with_capacity(n * n);
        for i in 0..n {
            values.extend((0..n).map(|j| delta(i, j)));
        }
        Self { n, values }
    }

    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// The greatest of them.
    pub(super) fn greatest(&self) -> f64 {
        self.values.iter().copied().fold(0.0, f64::max)
    }

    /// The sum of squares over all ordered pairs.
    pub(super) fn sum_of_squares(&self) -> f64 {
        norm_squared(&self.values)
    }

    /// delta, n x n.
    pub fn matrix(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.values, self.n, self.n)
    }

    /// delta_i1 .. delta_in.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.n..(i + 1) * self.n]
    }

    /// Rows and columns in another order.
    pub(super) fn permuted(&self, order: &[usize]) -> Self {
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
    /// Terms of the pairs of the point `at` and each of the others: (delta_j / d_j) (p - p_j) and (d_j - delta_j)^2. Coincident points exert no pull.
    pub fn pulls(at: Point, x: &[f64], y: &[f64], delta: &[f64], pull_x: &mut [f64], pull_y: &mut [f64], stress: &mut [f64]) {
        let n = delta.len();
        let (x, y, pull_x, pull_y, stress) = (&x[..n], &y[..n], &mut pull_x[..n], &mut pull_y[..n], &mut stress[..n]);
        for j in 0..n {
            let (ex, ey) = (at[0] - x[j], at[1] - y[j]);
            let d = (ex * ex + ey * ey).sqrt();
            let ratio = if d > 0.0 { delta[j] / d } else { 0.0 };
            pull_x[j] = ratio * ex;
            pull_y[j] = ratio * ey;
            stress[j] = (d - delta[j]) * (d - delta[j]);
        }
    }
}

vectorised! {
    /// Terms of the pairs of the point (x, y) = `at[..2]`, displaced by w = `at[2..]`, and each of the others in the Hessian of half the stress times the
    /// displacements: K_j (w - w_j) with K = (1 - delta/d) I + (delta/d^3) e e^T, e = p - p_j; K = I where the points coincide.
    pub fn gains(at: [f64; 4], x: &[f64], y: &[f64], u: &[f64], v: &[f64], delta: &[f64], gain: [&mut [f64]; 2]) {
        let n = delta.len();
        let (x, y, u, v) = (&x[..n], &y[..n], &u[..n], &v[..n]);
        let [gain_x, gain_y] = gain.map(|a| &mut a[..n]);
        for j in 0..n {
            let (ex, ey, du, dv) = (at[0] - x[j], at[1] - y[j], at[2] - u[j], at[3] - v[j]);
            let q = ex * ex + ey * ey;
            let inverse = if q >= f64::MIN_POSITIVE { 1.0 / q } else { 0.0 };
            let ratio = delta[j] * inverse.sqrt();
            let along = ratio * inverse * (ex * du + ey * dv);
            gain_x[j] = (1.0 - ratio) * du + along * ex;
            gain_y[j] = (1.0 - ratio) * dv + along * ey;
        }
    }
}

/// The scaling problem, free points first.
pub(super) struct Problem {
    pub delta: Dissimilarities,
    pub free: usize,
    /// Free points in ranges of about as many pairs each.
    parts: Vec<Range<usize>>,
}

/// Positions, one array a coordinate, for rows of vector arithmetic; free points first.
#[derive(Clone)]
pub(super) struct Layout {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
}

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

/// What one pass over the pairs gives at a layout. Vectors over the free points hold all x before all y.
pub(super) struct Slope {
    /// sum_j (delta_ij / d_ij) (p_i - p_j) of each free point.
    pull: Vec<f64>,
    /// Half the gradient of the stress at each free point.
    pub gradient: Vec<f64>,
    /// The stress (6) of the pairs that involve a free point.
    pub stress: f64,
}

/// Antisymmetric vectors of pairs summed at both their points, and a number of each pair.
struct Sums {
    x: Vec<f64>,
    y: Vec<f64>,
    number: f64,
}

/// The terms of the pairs of one point and a row of others: vectors and, where wanted, numbers.
struct Terms {
    x: Vec<f64>,
    y: Vec<f64>,
    number: Vec<f64>,
}

impl Sums {
    fn zero(n: usize) -> Self {
        Self {
            x: vec![0.0; n],
            y: vec![0.0; n],
            number: 0.0,
        }
    }

    fn add(mut self, other: Self) -> Self {
        axpy(1.0, &other.x, &mut self.x);
        axpy(1.0, &other.y, &mut self.y);
        self.number += other.number;
        self
    }

    /// Adds the terms of point i and `others`.
    fn add_terms(&mut self, i: usize, others: Range<usize>, terms: &Terms) {
        let count = others.len();
        for (sums, terms) in [(&mut self.x, &terms.x), (&mut self.y, &terms.y)] {
            axpy(-1.0, &terms[..count], &mut sums[others.clone()]);
            sums[i] += sum(&terms[..count]);
        }
        self.number += sum(&terms.number[..count.min(terms.number.len())]);
    }

    /// The vectors of the first points, all x before all y.
    fn first(&self, count: usize) -> Vec<f64> {
        [&self.x[..count], &self.y[..count]].concat()
    }
}

impl Layout {
    /// The positions in another order.
    pub fn of(order: &[usize], positions: &[Point]) -> Self {
        let axis = |a: usize| order.iter().map(|&i| positions[i][a]).collect();
        Self {
            x: axis(0),
            y: axis(1),
        }
    }

    /// Puts the first points where they belong.
    pub fn write(&self, order: &[usize], positions: &mut [Point]) {
        for (k, &i) in order.iter().enumerate() {
            positions[i] = self.point(k);
        }
    }

    fn sum(&self) -> Point {
        [self.x.iter().sum(), self.y.iter().sum()]
    }

    pub fn point(&self, i: usize) -> Point {
        [self.x[i], self.y[i]]
    }

    pub fn moved(&self, step: &[f64]) -> Self {
        let mut moved = self.clone();
        let (x, y) = step.split_at(step.len() / 2);
        axpy(1.0, x, &mut moved.x[..x.len()]);
        axpy(1.0, y, &mut moved.y[..y.len()]);
        moved
    }
}

impl Problem {
    pub fn new(delta: Dissimilarities, free: usize) -> Self {
        let fixed = delta.n - free;
        let pairs = |rows: usize| rows * rows / 2 + rows * fixed;
        let parts = if pairs(free) < PAIRS_ALONE { 1 } else { PARTS };
        let end = |part: usize| {
            (0..free)
                .find(|&rows| pairs(rows) >= part * pairs(free) / parts)
                .unwrap_or(free)
        };
        Self {
            parts: (0..parts)
                .map(|part| {
                    end(part)..if part + 1 == parts {
                        free
                    } else {
                        end(part + 1)
                    }
                })
                .collect(),
            delta,
            free,
        }
    }

    /// Sums the terms of every pair of two free points, and of a free and a fixed one, once each; `row(i, others, terms)` writes those of point i.
    fn over_pairs(
        &self,
        numbers: bool,
        row: impl Fn(usize, Range<usize>, &mut Terms) + Sync + Send,
    ) -> Sums {
        let n = self.delta.n;
        let part = |part: &Range<usize>| {
            let mut sums = Sums::zero(n);
            let mut terms = Terms {
                x: vec![0.0; n],
                y: vec![0.0; n],
                number: vec![0.0; if numbers { n } else { 0 }],
            };
            for i in part.clone() {
                for others in [0..i, self.free..n] {
                    if others.is_empty() {
                        continue;
                    }
                    row(i, others.clone(), &mut terms);
                    sums.add_terms(i, others, &terms);
                }
            }
            sums
        };
        if let [all] = self.parts.as_slice() {
            return part(all);
        }
        let parts: Vec<Sums> = self.parts.par_iter().map(part).collect();
        parts
            .into_iter()
            .reduce(Sums::add)
            .unwrap_or_else(|| Sums::zero(n))
    }

    /// The norm of n P about its centroid: what pulls the points together, and pushes them apart at a minimum.
    pub fn typical_gradient(&self, layout: &Layout) -> f64 {
        let n = self.delta.n as f64;
        let centre = layout.sum().map(|sum| sum / n);
        let spread = |values: &[f64], c: f64| values.iter().map(|v| (v - c).powi(2)).sum::<f64>();
        n * (spread(&layout.x, centre[0]) + spread(&layout.y, centre[1])).sqrt()
    }

    pub fn slope(&self, layout: &Layout) -> Slope {
        let sums = self.over_pairs(true, |i, others, terms| {
            let (x, y) = (&layout.x[others.clone()], &layout.y[others.clone()]);
            let delta = &self.delta.row(i)[others];
            let Terms {
                x: pull_x,
                y: pull_y,
                number,
            } = terms;
            pulls(layout.point(i), x, y, delta, pull_x, pull_y, number);
        });
        let (n, f, all) = (self.delta.n as f64, self.free, layout.sum());
        let pull = sums.first(f);
        let attraction = |values: &[f64], sum: f64| -> Vec<f64> {
            values[..f].iter().map(|v| n * v - sum).collect()
        };
        let mut gradient = attraction(&layout.x, all[0]);
        gradient.extend(attraction(&layout.y, all[1]));
        axpy(-1.0, &pull, &mut gradient);
        Slope {
            pull,
            gradient,
            stress: sums.number,
        }
    }

    /// The majorising step (Guttman transform): n p_i - sum_j p_j = pull_i for the free points. Without fixed points the centroid stays.
    fn majorise(&self, layout: &Layout, slope: &Slope) -> Layout {
        let (n, f) = (self.delta.n, self.free);
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

    /// Moves the free points of `positions`, whose order in the problem is `order`, to a minimum: by majorisation and then Newton's method.
    pub fn minimise(&self, order: &[usize], positions: &mut [Point]) -> Steps {
        let mut steps = Steps::default();
        let layout = Layout::of(order, positions);
        let (layout, slope) = majorisation(self, layout, &mut steps);
        newton(self, layout, slope, &mut steps).write(&order[..self.free], positions);
        steps
    }

    /// The Hessian of half the stress times a displacement of the free points.
    pub fn hessian_times(&self, layout: &Layout, step: &[f64]) -> Vec<f64> {
        let n = self.delta.n;
        let (mut u, mut v) = (vec![0.0; n], vec![0.0; n]);
        u[..self.free].copy_from_slice(&step[..self.free]);
        v[..self.free].copy_from_slice(&step[self.free..]);
        let sums = self.over_pairs(false, |i, others, terms| {
            let [x, y, u, v] = [&layout.x, &layout.y, &u, &v].map(|a| &a[others.clone()]);
            let at = [layout.x[i], layout.y[i], step[i], step[self.free + i]];
            let delta = &self.delta.row(i)[others.clone()];
            gains(at, x, y, u, v, delta, [&mut terms.x, &mut terms.y]);
        });
        sums.first(self.free)
    }
}

/// Majorises until a step lowers the stress by less than [`MAJORISED`] of it.
fn majorisation(problem: &Problem, mut layout: Layout, steps: &mut Steps) -> (Layout, Slope) {
    let mut slope = problem.slope(&layout);
    for _ in 0..MAJORISATION_STEPS {
        steps.majorising += 1;
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
        let rounding = FLAT * problem.delta.n as f64 * norm_squared(&direction);
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
fn newton(problem: &Problem, mut layout: Layout, mut slope: Slope, steps: &mut Steps) -> Layout {
    let scale = problem.typical_gradient(&layout);
    let mut radius = FIRST_RADIUS * norm_squared(&slope.gradient).sqrt() / problem.delta.n as f64;
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
    let steps = problem.minimise(&order, &mut positions);
    (positions, steps)
}

/// The order of the points in which those not pinned come first, and how many these are.
pub(super) fn free_first(pinned: &[bool]) -> (Vec<usize>, usize) {
    let (mut order, fixed): (Vec<usize>, Vec<usize>) = (0..pinned.len()).partition(|&i| !pinned[i]);
    let free = order.len();
    order.extend(fixed);
    (order, free)
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
