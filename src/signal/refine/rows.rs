//! What a refinement is measured against: the frames, and with a small weight frames between them.

use faer::{Mat, MatRef};

use crate::signal::rho::Rho;

/// Weighted points that the curve should pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// The parameter of each of the R rows.
    pub parameters: Vec<f64>,
    /// R x r: the points, one a row.
    pub targets: Mat<f64>,
    /// One non-negative weight a row.
    pub weights: Vec<f64>,
}

/// A parameter, a weight, and the frames that make the target with their shares.
type Row = (f64, f64, Vec<(usize, f64)>);

impl Rows {
    /// The n frames (`frames` is r x n) at their non-decreasing parameters, with weight 1. Where `between` is positive, so are the frames half-way
    /// between neighbours, with that weight, at the parameter rho(i + 1/2): cubic interpolation of the four frames around, (-1, 9, 9, -1) / 16, and
    /// quadratic of three, (3, 6, -1) / 8, at the ends. There is none where the parameter stands still. Rows ascend in time.
    pub fn of_frames(frames: MatRef<'_, f64>, parameters: &[f64], between: f64) -> Self {
        let n = parameters.len();
        let rho = Rho::new(parameters);
        let moves = |i: usize| i + 1 < n && between > 0.0 && parameters[i] < parameters[i + 1];
        let mut rows: Vec<Row> = Vec::with_capacity(2 * n);
        for i in 0..n {
            rows.push((parameters[i], 1.0, vec![(i, 1.0)]));
            if moves(i) {
                rows.push((rho.evaluate(i as f64 + 1.5), between, half_way(i, n)));
            }
        }
        Self {
            targets: Mat::from_fn(rows.len(), frames.nrows(), |row, a| {
                rows[row].2.iter().map(|&(i, c)| c * frames[(a, i)]).sum()
            }),
            parameters: rows.iter().map(|row| row.0).collect(),
            weights: rows.iter().map(|row| row.1).collect(),
        }
    }
}

/// Frames around i + 1/2 (i 0-based, of n frames) and their share in it.
fn half_way(i: usize, n: usize) -> Vec<(usize, f64)> {
    let eighths = |shares: &[(usize, f64)]| shares.iter().map(|&(j, c)| (j, c / 8.0)).collect();
    match (i, n - 1 - i) {
        (0, 1) => eighths(&[(0, 4.0), (1, 4.0)]),
        (0, _) => eighths(&[(0, 3.0), (1, 6.0), (2, -1.0)]),
        (_, 1) => eighths(&[(i - 1, -1.0), (i, 6.0), (i + 1, 3.0)]),
        _ => eighths(&[(i - 1, -0.5), (i, 4.5), (i + 1, 4.5), (i + 2, -0.5)]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_between_are_exact_on_a_parabola_and_missing_where_it_holds() {
        let square = Mat::from_fn(1, 6, |_, i| (i as f64).powi(2));
        let parameters = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        let rows = Rows::of_frames(square.as_ref(), &parameters, 0.5);
        assert_eq!(rows.parameters.len(), 11);
        for i in 0..11 {
            let t = i as f64 / 2.0;
            assert_eq!(rows.parameters[i], t);
            assert_eq!(rows.weights[i], if i % 2 == 0 { 1.0 } else { 0.5 });
            assert!((rows.targets[(i, 0)] - t * t).abs() < 1e-14);
        }
        let held = [0.0, 1.0, 1.0, 2.0, 3.0, 4.0];
        assert_eq!(
            Rows::of_frames(square.as_ref(), &held, 0.5).weights.len(),
            10
        );
        assert_eq!(
            Rows::of_frames(square.as_ref(), &held, 0.0).weights,
            [1.0; 6]
        );
    }
}
