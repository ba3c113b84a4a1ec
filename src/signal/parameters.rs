//! Parameters of the frames along the time signal (section 3.3).

use super::Point;

/// A step of less than this share of the diameter is no step: the square root of the centripetal rule would make 1e-16 of rounding 1e-8.
const HELD: f64 = 1e-9;

/// Centripetal parameters (Lee 1989, exponent 1/2): t_1 = 0, t_{i+1} = t_i + ||p_{i+1} - p_i||^(1/2). Held poses repeat a parameter.
pub fn centripetal(points: &[Point]) -> Vec<f64> {
    let mut t = 0.0;
    let steps = points
        .windows(2)
        .map(|w| super::distance(w[0], w[1]).sqrt());
    let mut parameters = vec![0.0; points.len().min(1)];
    parameters.extend(steps.map(|step| {
        t += step;
        t
    }));
    parameters
}

/// The distinct values of non-decreasing parameters: a run of equal frames is one parameter value (reading 8).
pub fn distinct(parameters: &[f64]) -> Vec<f64> {
    let mut distinct = parameters.to_vec();
    distinct.dedup();
    distinct
}

/// Parts of the length of a time signal, as a power of two, to which parameters and knots are rounded.
const GRID_BITS: i32 = 46;

/// The grid of parameters and knots: multiples of a power of two between 2^-46 and 2^-45 of the greatest.
///
/// Sums and differences of numbers on it are exact up to 128 times the greatest, so that a part of a time signal moves along the parameter without a
/// change in any bit of its curve ([`super::edit`]). The paper has no such rounding; it is far below what the fit itself rounds.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    quantum: f64,
}

impl Grid {
    /// The grid of signals whose parameters reach this far; one of no length leaves numbers as they are.
    pub fn new(greatest: f64) -> Self {
        let power = f64::from_bits(greatest.abs().to_bits() & (0x7ff << 52));
        Self {
            quantum: power * 0.5f64.powi(GRID_BITS - 1),
        }
    }

    /// The grid of a signal with these non-decreasing parameters.
    pub fn of(parameters: &[f64]) -> Self {
        Self::new(parameters.last().copied().unwrap_or(0.0))
    }

    /// What its numbers are multiples of.
    pub fn quantum(&self) -> f64 {
        self.quantum
    }

    /// The nearest number on the grid.
    pub fn round(&self, x: f64) -> f64 {
        if self.quantum < f64::MIN_POSITIVE || !self.quantum.is_finite() {
            return x;
        }
        (x / self.quantum).round() * self.quantum
    }

    /// All of them.
    pub fn round_all(&self, numbers: &mut [f64]) {
        numbers.iter_mut().for_each(|x| *x = self.round(*x));
    }
}

/// Centripetal parameters of positions whose held poses stand still exactly; where all poses coincide every parameter would be 0, and the
/// frame number serves instead.
pub(super) fn frame_parameters(positions: &[Point], diameter: f64) -> Vec<f64> {
    let mut still = positions.to_vec();
    for i in 1..still.len() {
        if super::distance(still[i], still[i - 1]) <= HELD * diameter {
            still[i] = still[i - 1];
        }
    }
    let mut t = centripetal(&still);
    Grid::of(&t).round_all(&mut t);
    if distinct(&t).len() > 1 {
        t
    } else {
        (0..positions.len()).map(|i| i as f64).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_on_the_grid_are_exact() {
        let grid = Grid::new(37.3);
        let t: Vec<f64> = (0..50)
            .map(|i| grid.round(37.3 * (i as f64 / 50.0).sqrt()))
            .collect();
        for shift in [1.0, 37.3, 500.1, 2000.7].map(|s| grid.round(s)) {
            for w in t.windows(2) {
                assert_eq!((w[1] + shift) - (w[0] + shift), w[1] - w[0]);
            }
        }
        assert!((grid.round(1.7) - 1.7).abs() <= 37.3 * 2f64.powi(-46));
        assert_eq!(Grid::new(0.0).round(0.1), 0.1);
        assert_eq!(Grid::new(f64::INFINITY).round(0.1), 0.1);
    }

    #[test]
    fn steps_are_square_roots_of_distances() {
        let t = centripetal(&[[0.0, 0.0], [0.0, 4.0], [0.0, 4.0], [9.0, 4.0]]);
        assert_eq!(t, [0.0, 2.0, 2.0, 5.0]);
        assert_eq!(distinct(&t), [0.0, 2.0, 5.0]);
        assert!(centripetal(&[]).is_empty());
    }
}
