//! Cubic splines through frames at whole times: what a motion does between its frames as far as the frames alone tell.
//!
//! The natural spline is the witness of in-betweens for layouts and saddles: of all curves through the frames it bends least, also at its ends. The
//! spline without knots next to its ends is the usual baseline of the leave-out test.

use faer::{Mat, MatRef};

/// What completes the equations of the second derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// No bend at the ends.
    Natural,
    /// The first two pieces are one cubic, and so are the last two (de Boor 2001, chapter IV). Three frames give the parabola, two a line.
    NotAKnot,
}

/// The cubic spline c with c(i) = x_i at times i = 1 .. n, in any number of dimensions.
#[derive(Clone, Debug)]
pub struct CubicSpline<'a> {
    values: MatRef<'a, f64>,
    /// c''(i), one column a frame.
    bends: Mat<f64>,
}

impl<'a> CubicSpline<'a> {
    /// Through the n columns of `values` (d x n). c''(i-1) + 4 c''(i) + c''(i+1) = 6 (x_{i-1} - 2 x_i + x_{i+1}), by elimination: O(d n).
    ///
    /// Without a knot at time 2, c''(1) = 2 c''(2) - c''(3) there, so that c''(2) is the second difference itself; the same at the other end. Between
    /// the ends so known the system is that of the natural spline.
    pub fn new(values: MatRef<'a, f64>, ends: Ends) -> Self {
        let (d, n) = values.shape();
        let mut bends = Mat::zeros(d, n);
        let second =
            |a: usize, i: usize| values[(a, i - 1)] - 2.0 * values[(a, i)] + values[(a, i + 1)];
        // The first and the last frame whose second derivative is known beforehand.
        let (first, last) = match ends {
            Ends::NotAKnot if n > 3 => (1, n - 2),
            Ends::NotAKnot if n == 3 => {
                let parabola = Mat::from_fn(d, n, |a, _| second(a, 1));
                return Self {
                    values,
                    bends: parabola,
                };
            }
            _ => (0, n.saturating_sub(1)),
        };
        if first > 0 {
            for a in 0..d {
                bends[(a, first)] = second(a, first);
                bends[(a, last)] = second(a, last);
            }
        }
        // Row i keeps 1 / its pivot; that of a known one is 0.
        let mut inverse = vec![0.0; n];
        for i in first + 1..last {
            inverse[i] = 1.0 / (4.0 - inverse[i - 1]);
            for a in 0..d {
                bends[(a, i)] = (6.0 * second(a, i) - bends[(a, i - 1)]) * inverse[i];
            }
        }
        for i in (first + 1..last).rev() {
            for a in 0..d {
                bends[(a, i)] -= inverse[i] * bends[(a, i + 1)];
            }
        }
        if first > 0 {
            for a in 0..d {
                bends[(a, 0)] = 2.0 * bends[(a, 1)] - bends[(a, 2)];
                bends[(a, n - 1)] = 2.0 * bends[(a, n - 2)] - bends[(a, n - 3)];
            }
        }
        Self { values, bends }
    }

    /// c(t) into `point` (d numbers) for a frame time t in [1, n]; beyond the ends the end frames hold, and for NaN the first.
    pub fn evaluate_into(&self, t: f64, point: &mut [f64]) {
        let n = self.values.ncols();
        let t = t.clamp(1.0, n.max(1) as f64).max(1.0);
        let i = (t.floor() as usize - 1).min(n.saturating_sub(2));
        let next = (i + 1).min(n.saturating_sub(1));
        let v = t - 1.0 - i as f64;
        let u = 1.0 - v;
        let bend = [u * u * u - u, v * v * v - v].map(|x| x / 6.0);
        for (a, x) in point.iter_mut().enumerate() {
            *x = u * self.values[(a, i)]
                + v * self.values[(a, next)]
                + bend[0] * self.bends[(a, i)]
                + bend[1] * self.bends[(a, next)];
        }
    }

    /// c half way between frames, d x (n - 1): column i is c(i + 3/2), i counted from 0.
    pub fn midpoints(&self) -> Mat<f64> {
        let (d, n) = self.values.shape();
        let (x, b) = (&self.values, &self.bends);
        Mat::from_fn(d, n.saturating_sub(1), |a, i| {
            (x[(a, i)] + x[(a, i + 1)]) / 2.0 - (b[(a, i)] + b[(a, i + 1)]) / 16.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(spline: &CubicSpline, t: f64) -> f64 {
        let mut x = [0.0];
        spline.evaluate_into(t, &mut x);
        x[0]
    }

    #[test]
    fn through_a_peak_as_computed_by_hand() {
        // 0, 1, 0: c''(2) = -3, so c(1.5) = 1/2 + 3/16.
        let x = Mat::from_fn(1, 3, |_, i| if i == 1 { 1.0 } else { 0.0 });
        let spline = CubicSpline::new(x.as_ref(), Ends::Natural);
        assert!((at(&spline, 1.5) - 0.6875).abs() < 1e-15);
        assert!((spline.midpoints()[(0, 1)] - 0.6875).abs() < 1e-15);
    }

    #[test]
    fn without_knots_next_to_the_ends_cubics_come_back() {
        let cubic = |t: f64| 1.0 - 2.0 * t + 0.5 * t * t * (t - 3.0);
        for n in 4..10 {
            let x = Mat::from_fn(1, n, |_, i| cubic((i + 1) as f64));
            let spline = CubicSpline::new(x.as_ref(), Ends::NotAKnot);
            for q in 0..=10 * (n - 1) {
                let t = 1.0 + q as f64 / 10.0;
                assert!((at(&spline, t) - cubic(t)).abs() < 1e-11, "{n}: {t}");
            }
        }
        let x = Mat::from_fn(1, 3, |_, i| (i * i) as f64);
        let parabola = CubicSpline::new(x.as_ref(), Ends::NotAKnot);
        assert!((at(&parabola, 1.5) - 0.25).abs() < 1e-15);
        let line = CubicSpline::new(x.get(.., ..2), Ends::NotAKnot);
        assert_eq!(at(&line, 1.5), 0.5);
    }

    #[test]
    fn one_and_two_frames_are_a_point_and_a_line() {
        let x = Mat::from_fn(1, 2, |_, i| 2.0 * i as f64);
        assert_eq!(at(&CubicSpline::new(x.as_ref(), Ends::Natural), 1.25), 0.5);
        assert_eq!(
            at(&CubicSpline::new(x.get(.., ..1), Ends::Natural), 7.0),
            0.0
        );
    }

    proptest! {
        /// Interpolating, with continuous first and second derivatives; the natural one without bend at the ends.
        #[test]
        fn smooth(x in prop::collection::vec(-5.0f64..5.0, 3..20), natural: bool) {
            let n = x.len();
            let x = Mat::from_fn(1, n, |_, i| x[i]);
            let ends = if natural { Ends::Natural } else { Ends::NotAKnot };
            let spline = CubicSpline::new(x.as_ref(), ends);
            let h = 1e-4;
            for i in 0..n {
                let t = (i + 1) as f64;
                prop_assert!((at(&spline, t) - x[(0, i)]).abs() < 1e-14);
                if i > 0 && i + 1 < n {
                    let slope = |a: f64, b: f64| (at(&spline, b) - at(&spline, a)) / (b - a);
                    prop_assert!((slope(t - h, t) - slope(t, t + h)).abs() < 1e-2);
                    let bend = |s: f64| at(&spline, t + s * h) - 2.0 * at(&spline, t + 2.0 * s * h) + at(&spline, t + 3.0 * s * h);
                    prop_assert!((bend(1.0) - bend(-1.0)).abs() < 2e-2 * h);
                }
            }
            let middle = spline.midpoints();
            for i in 0..n - 1 {
                prop_assert!((at(&spline, i as f64 + 1.5) - middle[(0, i)]).abs() < 1e-12);
            }
            if natural {
                prop_assert_eq!(spline.bends[(0, 0)], 0.0);
                prop_assert_eq!(spline.bends[(0, n - 1)], 0.0);
            }
        }
    }
}
