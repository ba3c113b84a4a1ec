//! Parameters of the frames along the time signal (section 3.3).

use super::Point;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_square_roots_of_distances() {
        let t = centripetal(&[[0.0, 0.0], [0.0, 4.0], [0.0, 4.0], [9.0, 4.0]]);
        assert_eq!(t, [0.0, 2.0, 2.0, 5.0]);
        assert_eq!(distinct(&t), [0.0, 2.0, 5.0]);
        assert!(centripetal(&[]).is_empty());
    }
}
