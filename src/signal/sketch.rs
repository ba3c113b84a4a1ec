//! A curve drawn through points of the pose plane, and equal ways along it (sections 4.1 and 4.4).

use thiserror::Error;

use super::Point;
use super::basis::{Basis, apply};
use super::f::{Spline, SplineError};
use super::knots::{KnotError, KnotRule, knots};
use super::parameters::{Grid, centripetal};

/// Points taken again on each side of a closed curve: the end conditions of an interpolating cubic spline fade at least by half from knot to knot.
const WRAPPED: usize = 44;
/// Parts of a span between knots, for the arc length.
const PARTS: usize = 8;
/// Nodes and weights of Gauss & Legendre on [-1, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

/// Why points make no curve.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SketchError {
    /// Fewer than two points apart, or three for a closed curve.
    #[error("a sketch needs at least {least} points apart from their neighbours, found {found}")]
    TooFew { least: usize, found: usize },
    /// NaN or infinite.
    #[error("point {point} (1-based) of the sketch is not finite: {position:?}")]
    NotFinite { point: usize, position: Point },
    /// See [`KnotError`].
    #[error(transparent)]
    Knots(#[from] KnotError),
    /// See [`SplineError`].
    #[error(transparent)]
    Spline(#[from] SplineError),
}

/// The interpolating cubic spline of a sketch, and its length along the way.
#[derive(Clone, Debug)]
pub struct Sketch {
    spline: Spline,
    /// Parameters at ascending places, and the length of the curve up to each.
    lengths: Vec<(f64, f64)>,
}

impl Sketch {
    /// The natural cubic spline through the points, or the periodic one where the curve closes, over centripetal parameters on their [`Grid`]. Points
    /// that these do not tell from the one before are left out, and so is a last point of a closed curve that repeats the first. O(points).
    pub fn new(points: &[Point], closed: bool) -> Result<Self, SketchError> {
        let bad = points.iter().position(|p| !p.iter().all(|x| x.is_finite()));
        if let Some(i) = bad {
            let (point, position) = (i + 1, points[i]);
            return Err(SketchError::NotFinite { point, position });
        }
        let mut points = points.to_vec();
        while closed && points.len() > 1 && points.first() == points.last() {
            points.pop();
        }
        let (points, parameters, period) = told_apart(&points, closed);
        let (least, found) = (if closed { 3 } else { 2 }, points.len());
        if found < least {
            return Err(SketchError::TooFew { least, found });
        }
        let spline = match closed {
            false => natural(&points, &parameters, &Grid::new(period))?,
            true => periodic(&points, &parameters, period)?,
        };
        Ok(Self {
            lengths: lengths(&spline),
            spline,
        })
    }

    /// The curve; its domain is the whole sketch.
    pub fn spline(&self) -> &Spline {
        &self.spline
    }

    /// The length of the curve in the plane.
    pub fn length(&self) -> f64 {
        self.lengths.last().map_or(0.0, |l| l.1)
    }

    /// The parameter at this share of the length, from 0 to 1. O(log points).
    pub fn parameter(&self, share: f64) -> f64 {
        let target = share * self.length();
        let i = self.lengths.partition_point(|l| l.1 < target);
        let (Some(&(b, _)), Some(&(a, before))) =
            (self.lengths.get(i), self.lengths.get(i.wrapping_sub(1)))
        else {
            let end = if i == 0 { 0 } else { self.lengths.len() - 1 };
            return self.lengths[end].0;
        };
        let arc = Arc::new(&self.spline, 0.5 * (a + b));
        let (mut low, mut high) = (a, b);
        // The length grows with the parameter; halving ends at neighbouring numbers.
        while low < high {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            match before + arc.length(a, middle) < target {
                true => low = middle,
                false => high = middle,
            }
        }
        high
    }
}

/// The points whose parameters on the grid differ from those before, these parameters, and the last one, where a closed curve is back at its first point.
fn told_apart(points: &[Point], closed: bool) -> (Vec<Point>, Vec<f64>, f64) {
    let mut around = points.to_vec();
    around.extend(points.first().filter(|_| closed));
    let mut t = centripetal(&around);
    Grid::of(&t).round_all(&mut t);
    let period = t.last().copied().unwrap_or(0.0);
    let apart = |i: &usize| (*i == 0 || t[*i] > t[*i - 1]) && (!closed || t[*i] < period);
    let kept: Vec<usize> = (0..points.len()).filter(apart).collect();
    let points = kept.iter().map(|&i| points[i]).collect();
    (points, kept.iter().map(|&i| t[i]).collect(), period)
}

fn natural(points: &[Point], t: &[f64], grid: &Grid) -> Result<Spline, SketchError> {
    let mut u = knots(t, t.len() + 2, KnotRule::Symmetric)?;
    grid.round_all(&mut u);
    Ok(Spline::fit(t, points, &u)?)
}

/// One period of the natural spline through many of them.
fn periodic(points: &[Point], t: &[f64], period: f64) -> Result<Spline, SketchError> {
    let n = points.len();
    let index = |i: usize| i + n * WRAPPED - WRAPPED;
    let count = n + 1 + 2 * WRAPPED;
    let many: Vec<Point> = (0..count).map(|i| points[index(i) % n]).collect();
    let first = index(0) / n;
    // Sums on the grid of one period, which are exact.
    let turns = |i: usize| (index(i) / n - first) as f64 * period;
    let parameters: Vec<f64> = (0..count).map(|i| t[index(i) % n] + turns(i)).collect();
    let start = parameters[0];
    let parameters: Vec<f64> = parameters.iter().map(|t| t - start).collect();
    let whole = natural(&many, &parameters, &Grid::new(period))?;
    let knots = &whole.knots[WRAPPED..WRAPPED + n + 5];
    Ok(Spline {
        control: whole.control[WRAPPED..WRAPPED + n + 3].to_vec(),
        knots: knots.iter().map(|u| u - knots[2]).collect(),
    })
}

/// A span of the curve between two knots: the ends and the second derivatives there.
struct Arc {
    from: f64,
    to: f64,
    ends: [Point; 2],
    bends: [Point; 2],
}

impl Arc {
    /// The span that holds u.
    fn new(spline: &Spline, u: f64) -> Self {
        let basis = Basis {
            knots: &spline.knots,
        };
        let s = basis.span(u);
        let (from, to) = (basis.knot(s), basis.knot(s + 1));
        let bend = |u| apply(&basis.second_derivatives(s, u), &spline.control);
        Self {
            from,
            to,
            ends: [spline.evaluate(from), spline.evaluate(to)],
            bends: [bend(from), bend(to)],
        }
    }

    fn speed(&self, u: f64) -> f64 {
        let h = self.to - self.from;
        let (left, right) = (self.to - u, u - self.from);
        let [x, y] = std::array::from_fn(|a| {
            let [p, q] = self.ends.map(|e| e[a]);
            let [m, n] = self.bends.map(|b| b[a]);
            (n * right * right - m * left * left) / (2.0 * h) + (q - p) / h - h * (n - m) / 6.0
        });
        x.hypot(y)
    }

    fn length(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let terms = GAUSS.map(|(x, weight)| weight * self.speed(middle + half * x));
        half * terms.iter().sum::<f64>()
    }
}

fn lengths(spline: &Spline) -> Vec<(f64, f64)> {
    let k = spline.control.len();
    let mut inner = spline.knots[2..k].to_vec();
    inner.dedup();
    let mut sum = 0.0;
    let mut found = vec![(inner[0], 0.0)];
    for pair in inner.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let arc = Arc::new(spline, 0.5 * (a + b));
        let at = |i: usize| a + (b - a) * i as f64 / PARTS as f64;
        for i in 1..=PARTS {
            let end = if i == PARTS { b } else { at(i) };
            sum += arc.length(at(i - 1), end);
            found.push((end, sum));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(n: usize) -> Vec<Point> {
        let turn = std::f64::consts::TAU / n as f64;
        (0..n)
            .map(|i| [3.0 * (i as f64 * turn).cos(), 3.0 * (i as f64 * turn).sin()])
            .collect()
    }

    #[test]
    fn a_line_is_run_along_evenly() {
        let line = Sketch::new(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [10.0, 0.0]], false).unwrap();
        assert!((line.length() - 10.0).abs() < 1e-12);
        for i in 0..=20 {
            let p = line.spline().evaluate(line.parameter(i as f64 / 20.0));
            assert!(
                (p[0] - 0.5 * i as f64).abs() < 1e-9 && p[1].abs() < 1e-12,
                "{p:?}"
            );
        }
    }

    #[test]
    fn a_closed_curve_is_as_smooth_where_it_closes() {
        for n in [3, 8, 32] {
            let points = circle(n);
            let closed = Sketch::new(&points, true).unwrap();
            let spline = closed.spline();
            let (a, b) = (spline.knots[2], spline.knots[spline.control.len() - 1]);
            let (start, end) = (Arc::new(spline, a), Arc::new(spline, b));
            assert!((start.speed(a) - end.speed(b)).abs() < 1e-9);
            assert!(super::super::distance(start.bends[0], end.bends[1]) < 1e-9);
            assert!(super::super::distance(start.ends[0], points[0]) < 1e-12);
            assert!(super::super::distance(end.ends[1], points[0]) < 1e-12);
        }
        let length = Sketch::new(&circle(64), true).unwrap().length();
        assert!((length - 6.0 * std::f64::consts::PI).abs() < 1e-4);
    }

    #[test]
    fn equal_shares_are_equal_ways() {
        let sketch =
            Sketch::new(&[[0.0, 0.0], [4.0, 1.0], [4.2, 3.0], [-3.0, 5.0]], false).unwrap();
        let dense = |from: f64, to: f64| {
            let p = |i: usize| {
                sketch
                    .spline()
                    .evaluate(from + (to - from) * i as f64 / 4000.0)
            };
            (0..4000)
                .map(|i| super::super::distance(p(i), p(i + 1)))
                .sum::<f64>()
        };
        for i in 0..7 {
            let [a, b] = [i, i + 1].map(|i| sketch.parameter(i as f64 / 7.0));
            assert!((dense(a, b) - sketch.length() / 7.0).abs() < 1e-5 * sketch.length());
        }
    }

    #[test]
    fn too_few_points_and_bad_ones_are_named() {
        let new = |points: &[Point], closed| Sketch::new(points, closed).err();
        let few = |least, found| Some(SketchError::TooFew { least, found });
        assert_eq!(new(&[], false), few(2, 0));
        assert_eq!(new(&[[1.0, 1.0]; 3], false), few(2, 1));
        assert_eq!(new(&[[0.0; 2], [1.0, 0.0], [0.0; 2]], true), few(3, 2));
        assert!(matches!(
            new(&[[0.0; 2], [f64::NAN, 0.0]], false),
            Some(SketchError::NotFinite { point: 2, .. })
        ));
    }
}
