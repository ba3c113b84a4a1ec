//! The monotone reparametrisation rho from frame numbers to spline parameters (section 2.3).

/// The monotone cubic of Fritsch & Carlson 1980 through rho(i) = t_i at frames i = 1 .. n (reading 7: averaged secants inside, secant slopes at the
/// ends, the circle of radius 3 as limiter, swept from the first interval to the last after the slopes beside flat intervals are set to 0).
#[derive(Clone, Debug, PartialEq)]
pub struct Rho {
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Rho {
    /// For n non-decreasing values t_1 .. t_n. O(n).
    pub fn new(values: &[f64]) -> Self {
        let secants: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).collect();
        Self {
            slopes: limited_slopes(&secants, values.len()),
            values: values.to_vec(),
        }
    }

    /// rho'(i) at the frames.
    pub fn slopes(&self) -> &[f64] {
        &self.slopes
    }

    /// rho(t) for a frame time t in [1, n]; beyond the ends the end values hold, and for NaN the first.
    pub fn evaluate(&self, t: f64) -> f64 {
        let n = self.values.len();
        if n < 2 || t <= 1.0 || t.is_nan() {
            return self.values.first().copied().unwrap_or(0.0);
        }
        if t >= n as f64 {
            return self.values[n - 1];
        }
        let i = t.floor() as usize - 1;
        let s = t - t.floor();
        let (a, b) = (self.values[i], self.values[i + 1]);
        let (da, db) = (self.slopes[i], self.slopes[i + 1]);
        let rise = b - a;
        a + s * (da + s * ((3.0 * rise - 2.0 * da - db) + s * (da + db - 2.0 * rise)))
    }
}

fn limited_slopes(secants: &[f64], n: usize) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (secants.first(), secants.last()) else {
        return vec![0.0; n];
    };
    let mut slopes = vec![first];
    slopes.extend(secants.windows(2).map(|w| (w[0] + w[1]) / 2.0));
    slopes.push(last);
    for i in (0..secants.len()).filter(|&i| secants[i] == 0.0) {
        (slopes[i], slopes[i + 1]) = (0.0, 0.0);
    }
    for (i, &secant) in secants.iter().enumerate().filter(|(_, s)| **s != 0.0) {
        let length = (slopes[i] / secant).hypot(slopes[i + 1] / secant);
        if length > 3.0 {
            slopes[i] *= 3.0 / length;
            slopes[i + 1] *= 3.0 / length;
        }
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_line_is_a_line_and_a_step_stays_flat() {
        let line = Rho::new(&[0.0, 2.0, 4.0, 6.0]);
        assert!((line.evaluate(2.25) - 2.5).abs() < 1e-15);
        let held = Rho::new(&[0.0, 1.0, 1.0, 2.0]);
        assert_eq!(held.evaluate(2.5), 1.0);
        assert_eq!(Rho::new(&[5.0]).evaluate(1.0), 5.0);
    }

    proptest! {
        #[test]
        fn monotone_and_interpolating(steps in prop::collection::vec(0.0f64..5.0, 1..30)) {
            let t: Vec<f64> = steps.iter().scan(0.0, |s, x| { *s += x; Some(*s) }).collect();
            let rho = Rho::new(&t);
            for (i, v) in t.iter().enumerate() {
                prop_assert_eq!(rho.evaluate((i + 1) as f64), *v);
            }
            let mut last = f64::NEG_INFINITY;
            for q in 0..=10 * t.len() {
                let v = rho.evaluate(1.0 + q as f64 / 10.0);
                prop_assert!(v >= last - 1e-12);
                last = v;
            }
        }
    }
}
