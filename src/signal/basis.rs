//! Cubic B-splines on the paper's knots (section 2.3; reading 1): the functions B_j that do not vanish at a parameter, their second derivatives and the
//! integral of |f''|^2.

use super::Point;
use super::f::SplineError;
use crate::linalg::banded::BAND;
use crate::linalg::kernels::vectorised;

/// What a cubic basis needs of the knots. Indices here count one more copy of each end, as is usual; no formula touches those copies.
pub(super) struct Basis<'a> {
    pub knots: &'a [f64],
}

/// Four neighbouring basis functions (or derivatives) and the index of the first.
pub(super) type Local = (usize, [f64; BAND]);

impl<'a> Basis<'a> {
    pub fn new(knots: &'a [f64]) -> Result<Self, SplineError> {
        let found = knots.len();
        let bad = |at| SplineError::BadKnots { found, at };
        if found < 6 {
            return Err(bad(found));
        }
        if let Some(at) = (1..found).find(|&i| knots[i].is_nan() || knots[i] < knots[i - 1]) {
            return Err(bad(at));
        }
        if knots[2] >= knots[found - 3] || !knots[0].is_finite() || !knots[found - 1].is_finite() {
            return Err(bad(2));
        }
        Ok(Self { knots })
    }

    #[inline(always)]
    pub fn count(&self) -> usize {
        self.knots.len() - 2
    }

    #[inline(always)]
    pub fn domain(&self) -> (f64, f64) {
        (self.knots[2], self.knots[self.count() - 1])
    }

    /// Knot i, 1 <= i <= k + 2.
    #[inline(always)]
    pub fn knot(&self, i: usize) -> f64 {
        self.knots[i - 1]
    }

    /// The non-empty span that holds u, as the index of its left knot; u is clamped to the domain. O(log k).
    pub fn span(&self, u: f64) -> usize {
        let inner = &self.knots[2..self.count()];
        let (low, high) = self.domain();
        if u >= high {
            return inner.partition_point(|&x| x < high) + 2;
        }
        inner.partition_point(|&x| x <= u.max(low)) + 2
    }

    /// The same, looked for from the span before it.
    #[inline(always)]
    fn span_from(&self, before: usize, u: f64) -> usize {
        let mut s = before;
        while s < self.count() - 1 && u >= self.knot(s + 1) {
            s += 1;
        }
        if self.knot(s) <= u && u < self.knot(s + 1) {
            s
        } else {
            self.span(u)
        }
    }

    /// Values at u of the four functions that do not vanish on its span.
    pub fn values(&self, u: f64) -> Local {
        self.values_on(self.span(u), u)
    }

    /// Values at u of the four functions that do not vanish on the span s (Cox & de Boor).
    #[inline(always)]
    fn values_on(&self, s: usize, u: f64) -> Local {
        let (low, high) = self.domain();
        let u = u.clamp(low, high);
        let [t0, t1, t2, t3, t4, t5]: [f64; 6] = std::array::from_fn(|i| self.knots[s - 3 + i]);
        let spread = [t3 - t1, t4 - t2, t3 - t0, t4 - t1, t5 - t2, t3 - t2];
        let [a, b, c, d, e, share] = spread.map(|x| 1.0 / x);
        let (left, right) = ((t3 - u) * share * a, (u - t2) * share * b);
        let square = [
            (t3 - u) * left * c,
            ((u - t1) * left + (t4 - u) * right) * d,
            (u - t2) * right * e,
        ];
        let cubic = [
            (t3 - u) * square[0],
            (u - t0) * square[0] + (t4 - u) * square[1],
            (u - t1) * square[1] + (t5 - u) * square[2],
            (u - t2) * square[2],
        ];
        (s - 3, cubic)
    }

    /// Second derivatives, at u, of the four functions of the span s: linear B-splines of second differences of the coefficients.
    pub fn second_derivatives(&self, s: usize, u: f64) -> Local {
        let t = |i| self.knot(i);
        let hat = [(t(s + 1) - u), (u - t(s))].map(|x| x / (t(s + 1) - t(s)));
        let mut row = [0.0; BAND];
        for (q, weight) in hat.iter().enumerate() {
            // Coefficient q of the second derivative on this span takes coefficients s-3+q .. s-1+q.
            let i = s - 1 + q;
            let wide = [
                6.0 / (t(i + 2) - t(i)),
                1.0 / (t(i + 2) - t(i - 1)),
                1.0 / (t(i + 3) - t(i)),
            ];
            row[q] += weight * wide[0] * wide[1];
            row[q + 1] -= weight * wide[0] * (wide[1] + wide[2]);
            row[q + 2] += weight * wide[0] * wide[2];
        }
        (s - 3, row)
    }

    /// Rows whose squares sum to the integral of |f''|^2 over the domain: f'' is linear on each span.
    pub fn energy_rows(&self) -> Vec<Local> {
        let t = |i| self.knot(i);
        let spans = (3..self.count()).filter(|&s| t(s) < t(s + 1));
        spans
            .flat_map(|s| {
                let h = t(s + 1) - t(s);
                let (first, a) = self.second_derivatives(s, t(s));
                let (_, b) = self.second_derivatives(s, t(s + 1));
                let combine = |f: f64, sign: f64| std::array::from_fn(|j| f * (a[j] + sign * b[j]));
                [
                    (first, combine(h.sqrt() / 2.0, 1.0)),
                    (first, combine((h / 12.0).sqrt(), -1.0)),
                ]
            })
            .collect()
    }
}

#[inline(always)]
pub(super) fn apply(row: &Local, c: &[Point]) -> Point {
    let (first, values) = row;
    let c: &[Point] = &c[*first..first + BAND];
    std::array::from_fn(|a| (0..BAND).map(|j| values[j] * c[j][a]).sum())
}

vectorised! {
    /// The rows of the least squares: the four functions that do not vanish at each parameter.
    pub(super) fn rows(knots: &[f64], parameters: &[f64]) -> Vec<Local> {
        let basis = Basis { knots };
        let mut span = 3;
        let mut rows = Vec::with_capacity(parameters.len());
        for &t in parameters {
            span = basis.span_from(span, t);
            rows.push(basis.values_on(span, t));
        }
        rows
    }
}

vectorised! {
    /// The spline of these control points at each parameter.
    pub(super) fn values(knots: &[f64], control: &[Point], parameters: &[f64]) -> Vec<Point> {
        let basis = Basis { knots };
        let mut span = 3;
        let mut values = Vec::with_capacity(parameters.len());
        for &u in parameters {
            span = basis.span_from(span, u);
            values.push(apply(&basis.values_on(span, u), control));
        }
        values
    }
}
