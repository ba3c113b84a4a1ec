//! Medians, spreads and paired ratios of timing samples.

/// The median; the mean of the middle two for an even number. NaN for no values.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => (sorted[n / 2 - 1] + sorted[n / 2]) / 2.0,
    }
}

/// The median absolute deviation from the median.
pub fn mad(values: &[f64]) -> f64 {
    let middle = median(values);
    let deviations: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
    median(&deviations)
}

/// The median over rounds of `values` over `base`, taken pair by pair.
pub fn paired_ratio(values: &[f64], base: &[f64]) -> f64 {
    let ratios: Vec<f64> = values.iter().zip(base).map(|(v, b)| v / b).collect();
    median(&ratios)
}

/// The least value; NaN for none.
pub fn least(values: &[f64]) -> f64 {
    values.iter().copied().reduce(f64::min).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_even_and_none() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&[]).is_nan());
        // deviations from 3: 2, 1, 0, 1, 97
        assert_eq!(mad(&[1.0, 2.0, 3.0, 4.0, 100.0]), 1.0);
        assert_eq!(least(&[2.0, 1.0, 3.0]), 1.0);
    }

    #[test]
    fn ratios_pair_rounds_not_medians() {
        // Each round is twice as slow, though the machine's speed drifts tenfold.
        assert_eq!(paired_ratio(&[2.0, 20.0, 4.0], &[1.0, 10.0, 2.0]), 2.0);
    }
}
