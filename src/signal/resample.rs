//! Times at which to sample a representation (section 4.2): frame rates, numbers of frames, and slow and fast motion.

use thiserror::Error;

/// More frames are a mistake.
pub const MOST_FRAMES: usize = 10_000_000;

/// Why there are no such times.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum TimesError {
    /// Not a positive number.
    #[error(
        "rate {rate}: expected a positive number, such as 1.5 for three frames in place of two"
    )]
    BadRate { rate: f64 },
    /// None, or more than [`MOST_FRAMES`].
    #[error("{count} frames: expected 1 to {MOST_FRAMES}")]
    BadCount { count: u64 },
    /// A time that no frame and nothing between frames is at.
    #[error("time {index} (1-based) is {time}: expected frame times from 1 to {n}")]
    Outside { index: usize, time: f64, n: usize },
    /// Frames of a time warp that do not ascend.
    #[error(
        "row {row} (1-based) of the time warp is for frame {frame}: expected a greater number than in the row before"
    )]
    NotAscending { row: usize, frame: f64 },
    /// Fewer than two rows.
    #[error("a time warp needs at least 2 rows, found {found}")]
    TooFewRows { found: usize },
}

/// `count` times evenly spread over [1, n]; one is at 1.
pub fn evenly(n: usize, count: usize) -> Result<Vec<f64>, TimesError> {
    let last = n.max(1) as f64;
    if count == 0 || count > MOST_FRAMES {
        let count = count as u64;
        return Err(TimesError::BadCount { count });
    }
    let step = (last - 1.0) / (count.max(2) - 1) as f64;
    Ok((0..count)
        .map(|i| (1.0 + i as f64 * step).min(last))
        .collect())
}

/// tau_i = 1 + (i - 1) / rate up to n: frame-rate conversion, with `rate` frames in place of one.
pub fn at_rate(n: usize, rate: f64) -> Result<Vec<f64>, TimesError> {
    if !(rate > 0.0 && rate.is_finite()) {
        return Err(TimesError::BadRate { rate });
    }
    let last = n.max(1) as f64;
    // Rounding must not take the last frame away.
    let count = ((last - 1.0) * rate * (1.0 + 4.0 * f64::EPSILON)).floor() + 1.0;
    if count > MOST_FRAMES as f64 {
        let count = count as u64;
        return Err(TimesError::BadCount { count });
    }
    Ok((0..count as usize)
        .map(|i| (1.0 + i as f64 / rate).min(last))
        .collect())
}

/// An error where one of the times lies outside [1, n].
pub fn check(times: &[f64], n: usize) -> Result<(), TimesError> {
    let outside = times.iter().position(|t| !(1.0..=n as f64).contains(t));
    match outside {
        Some(at) => {
            let (index, time) = (at + 1, times[at]);
            Err(TimesError::Outside { index, time, n })
        }
        None => Ok(()),
    }
}

/// Slow and fast motion: rows say which frame of the new sequence shows which time of the old one, and a cubic that rises and falls only where the rows
/// do runs through them (Fritsch & Butland 1984), so that the speed has no jumps. Every whole frame from the first row's to the last one's.
pub fn warped(rows: &[[f64; 2]], n: usize) -> Result<Vec<f64>, TimesError> {
    if rows.len() < 2 {
        return Err(TimesError::TooFewRows { found: rows.len() });
    }
    let falls = (1..rows.len()).find(|&i| rows[i][0].is_nan() || rows[i][0] <= rows[i - 1][0]);
    if let Some(i) = falls.or_else(|| (!rows[0][0].is_finite()).then_some(0)) {
        let (row, frame) = (i + 1, rows[i][0]);
        return Err(TimesError::NotAscending { row, frame });
    }
    let values: Vec<f64> = rows.iter().map(|row| row[1]).collect();
    check(&values, n)?;
    let (first, last) = (rows[0][0].ceil(), rows[rows.len() - 1][0].floor());
    let count = last - first + 1.0;
    if !(1.0..=MOST_FRAMES as f64).contains(&count) {
        let count = count as u64;
        return Err(TimesError::BadCount { count });
    }
    let slopes = slopes(rows);
    let mut at = 0;
    let time = |j: usize| {
        let frame = first + j as f64;
        while at + 2 < rows.len() && rows[at + 1][0] <= frame {
            at += 1;
        }
        let ([x, a], [y, b]) = (rows[at], rows[at + 1]);
        let (h, s) = (y - x, (frame - x) / (y - x));
        let (da, db, rise) = (h * slopes[at], h * slopes[at + 1], b - a);
        let value = a + s * (da + s * ((3.0 * rise - 2.0 * da - db) + s * (da + db - 2.0 * rise)));
        value.clamp(1.0, n as f64)
    };
    Ok((0..count as usize).map(time).collect())
}

fn slopes(rows: &[[f64; 2]]) -> Vec<f64> {
    let secants: Vec<[f64; 2]> = rows
        .windows(2)
        .map(|w| {
            let h = w[1][0] - w[0][0];
            [h, (w[1][1] - w[0][1]) / h]
        })
        .collect();
    let inner = secants.windows(2).map(|w| {
        let ([h0, d0], [h1, d1]) = (w[0], w[1]);
        if d0 * d1 <= 0.0 {
            return 0.0;
        }
        let (a, b) = (2.0 * h1 + h0, h1 + 2.0 * h0);
        (a + b) / (a / d0 + b / d1)
    });
    let ends = [secants[0][1], secants[secants.len() - 1][1]];
    [ends[0]]
        .into_iter()
        .chain(inner)
        .chain([ends[1]])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn rates_and_counts() {
        assert_eq!(evenly(5, 3).unwrap(), [1.0, 3.0, 5.0]);
        assert_eq!(evenly(5, 1).unwrap(), [1.0]);
        assert_eq!(evenly(1, 3).unwrap(), [1.0; 3]);
        assert_eq!(at_rate(4, 1.0).unwrap(), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(at_rate(3, 1.5).unwrap().len(), 4);
        assert_eq!(at_rate(4, 0.5).unwrap(), [1.0, 3.0]);
        // 1/3 of a frame is no double; the last frame comes all the same.
        assert_eq!(*at_rate(100, 3.0).unwrap().last().unwrap(), 100.0);
        assert_eq!(at_rate(24, 1.0 / 23.0).unwrap().len(), 2);
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(at_rate(4, rate), Err(TimesError::BadRate { .. })));
        }
        assert!(at_rate(4, 1e9).is_err() && evenly(4, 0).is_err());
    }

    #[test]
    fn a_warp_without_a_change_of_speed_is_none() {
        let rows = [[1.0, 1.0], [4.0, 4.0], [11.0, 11.0]];
        let times = warped(&rows, 11).unwrap();
        for (i, t) in times.iter().enumerate() {
            assert!((t - (i + 1) as f64).abs() < 1e-14);
        }
        let back = warped(&[[1.0, 1.0], [5.0, 9.0], [7.0, 2.0]], 9).unwrap();
        assert_eq!((back[0], back[4], back[6]), (1.0, 9.0, 2.0));
    }

    #[test]
    fn warps_that_are_none_are_named() {
        let of = |rows: &[[f64; 2]]| warped(rows, 9).unwrap_err().to_string();
        assert!(of(&[[1.0, 1.0]]).contains("at least 2 rows"));
        assert!(of(&[[1.0, 1.0], [1.0, 2.0]]).contains("row 2"));
        assert!(of(&[[f64::NEG_INFINITY, 1.0], [1.0, 2.0]]).contains("row 1"));
        assert!(of(&[[1.0, 1.0], [f64::NAN, 2.0]]).contains("row 2"));
        assert!(of(&[[1.0, 1.0], [2.0, 10.0]]).contains("from 1 to 9"));
        assert!(of(&[[1.0, 1.0], [1e9, 9.0]]).contains("expected 1 to"));
        assert!(of(&[[1.1, 1.0], [1.9, 9.0]]).contains("expected 1 to"));
    }

    proptest! {
        #[test]
        fn times_rise_where_the_rows_do(steps in prop::collection::vec((0.5f64..9.0, 0.0f64..5.0), 2..9)) {
            let mut row = [1.0, 1.0];
            let mut rows = vec![row];
            for (x, y) in steps { row = [row[0] + x, row[1] + y]; rows.push(row); }
            let n = row[1].ceil() as usize;
            let times = warped(&rows, n).unwrap();
            prop_assert!(times.windows(2).all(|w| w[1] >= w[0] - 1e-12));
            prop_assert_eq!(times.len(), row[0].floor() as usize);
        }
    }
}
