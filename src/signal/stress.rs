//! The stress of a layout (section 3.2.1, equation (6)) with its gradient and Hessian, over the points that are free. Nothing of size n x n is formed.

use std::ops::Range;

use rayon::prelude::*;

use super::Point;
use super::dissimilarities::Dissimilarities;
use crate::linalg::kernels::{axpy, sum, vectorised};

/// Pairs that one thread sees through before another could begin to help.
const PAIRS_ALONE: usize = 60_000;
/// Sums over more pairs are made in this many parts, added up in a fixed order: the bits do not depend on the number of threads.
const PARTS: usize = 8;

/// The stress (6) of a layout: sum over pairs of (||p_i - p_j|| - delta_ij)^2. O(n^2).
pub fn stress(delta: &Dissimilarities, points: &[Point]) -> f64 {
    let pairs = |i: usize| {
        (0..i).map(move |j| (super::distance(points[i], points[j]) - delta.row(i)[j]).powi(2))
    };
    (0..points.len()).map(|i| pairs(i).sum::<f64>()).sum()
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
pub struct Problem {
    pub delta: Dissimilarities,
    pub free: usize,
    /// Free points in ranges of about as many pairs each.
    parts: Vec<Range<usize>>,
}

/// Positions, one array a coordinate, for rows of vector arithmetic; free points first.
#[derive(Clone)]
pub struct Places {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
}

/// What one pass over the pairs gives at a layout. Vectors over the free points hold all x before all y.
pub struct Slope {
    /// sum_j (delta_ij / d_ij) (p_i - p_j) of each free point.
    pub pull: Vec<f64>,
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

impl Places {
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

    pub fn sum(&self) -> Point {
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
        let fixed = delta.len() - free;
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
        let n = self.delta.len();
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
    pub fn typical_gradient(&self, layout: &Places) -> f64 {
        let n = self.delta.len() as f64;
        let centre = layout.sum().map(|sum| sum / n);
        let spread = |values: &[f64], c: f64| values.iter().map(|v| (v - c).powi(2)).sum::<f64>();
        n * (spread(&layout.x, centre[0]) + spread(&layout.y, centre[1])).sqrt()
    }

    pub fn slope(&self, layout: &Places) -> Slope {
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
        let (n, f, all) = (self.delta.len() as f64, self.free, layout.sum());
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

    /// The Hessian of half the stress times a displacement of the free points.
    pub fn hessian_times(&self, layout: &Places, step: &[f64]) -> Vec<f64> {
        let n = self.delta.len();
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
