//! Long sequences (the limitation of section 6): windows of frames that overlap, each with signals of its own, joined smoothly.
//!
//! Where windows overlap, their frames are mixed by weights that sum to 1 and rise and fall with two continuous derivatives, so that the motion has no
//! seam that a derivative up to the second would show. A sequence is read, and a representation written, a window at a time: memory is that of two windows, however
//! long the sequence.

use std::borrow::Borrow;
use std::ops::Range;

use thiserror::Error;

use super::file::Stored;
use super::fit::FEWEST_FRAMES;
use crate::shape::ShapeError;

/// Why there are no such windows.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum PlanError {
    /// Shorter than a time signal can be.
    #[error("a window of {window} frames: expected at least {FEWEST_FRAMES}")]
    TooShort { window: usize },
    /// An overlap that leaves nothing to itself, or none.
    #[error("an overlap of {overlap} frames: expected 2 to {most}, half of a window of {window}")]
    BadOverlap {
        overlap: usize,
        window: usize,
        most: usize,
    },
    /// No frames.
    #[error("there are no frames to part into windows")]
    NoFrames,
}

/// Which frames go into which window.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    windows: Vec<Range<usize>>,
    overlap: usize,
}

impl Plan {
    /// As few windows of `window` frames as cover n frames with at least `overlap` frames in common, evenly spread; a single one where n is not more than that.
    pub fn new(n: usize, window: usize, overlap: usize) -> Result<Self, PlanError> {
        if n == 0 {
            return Err(PlanError::NoFrames);
        }
        if window < FEWEST_FRAMES {
            return Err(PlanError::TooShort { window });
        }
        let most = window / 2;
        if !(2..=most).contains(&overlap) {
            return Err(PlanError::BadOverlap {
                overlap,
                window,
                most,
            });
        }
        if n <= window {
            return Ok(Self::from_windows(vec![0..n], overlap));
        }
        let steps = (n - window).div_ceil(window - overlap);
        let start = |j: usize| j * (n - window) / steps;
        let windows = (0..=steps).map(|j| start(j)..start(j) + window).collect();
        Ok(Self::from_windows(windows, overlap))
    }

    /// From ranges of 0-based frames, whose starts and ends ascend, and the frames over which weights rise and fall.
    pub fn from_windows(windows: Vec<Range<usize>>, overlap: usize) -> Self {
        let overlap = overlap.max(2);
        Self { windows, overlap }
    }

    /// Ranges of 0-based frames, in order.
    pub fn windows(&self) -> &[Range<usize>] {
        &self.windows
    }

    /// Frames over which weights rise and fall.
    pub fn overlap(&self) -> usize {
        self.overlap
    }

    /// n.
    pub fn frame_count(&self) -> usize {
        self.windows.last().map_or(0, |w| w.end)
    }

    /// The windows that have a part in frame time t, in [1, n], and their weights, which sum to 1. O(windows).
    pub fn weights(&self, t: f64) -> Vec<(usize, f64)> {
        let last = self.windows.len().saturating_sub(1);
        let part = |(j, w): (usize, &Range<usize>)| {
            let (first, end) = (w.start as f64 + 1.0, w.end as f64);
            if !(first..=end).contains(&t) {
                return None;
            }
            let rise = |way: f64, is_end: bool| match is_end {
                true => 1.0,
                false => smooth_step(way / (self.overlap - 1) as f64),
            };
            let weight = rise(t - first, j == 0) * rise(end - t, j == last);
            (weight > 0.0).then_some((j, weight))
        };
        let mut parts: Vec<(usize, f64)> =
            self.windows.iter().enumerate().filter_map(part).collect();
        let sum: f64 = parts.iter().map(|p| p.1).sum();
        parts.iter_mut().for_each(|p| p.1 /= sum);
        parts
    }
}

/// 0 up to 0, 1 from 1 on, and between them 6 s^5 - 15 s^4 + 10 s^3, whose first and second derivatives vanish at both ends.
fn smooth_step(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// Frames of 3V positions at these frame times, in [1, n]; `load` gives the representation of a window. Every window is asked for at most once, and held no
/// longer than its turn.
pub fn sample<S: Borrow<Stored>, E: From<ShapeError>>(
    plan: &Plan,
    times: &[f64],
    mut load: impl FnMut(usize) -> Result<S, E>,
) -> Result<Vec<f64>, E> {
    let mut shares: Vec<Vec<(usize, f64)>> = vec![Vec::new(); plan.windows.len()];
    for (i, &t) in times.iter().enumerate() {
        for (j, weight) in plan.weights(t) {
            shares[j].push((i, weight));
        }
    }
    let mut frames = Vec::new();
    for (j, share) in shares
        .iter()
        .enumerate()
        .filter(|(_, share)| !share.is_empty())
    {
        let stored = load(j)?;
        let start = plan.windows[j].start as f64;
        let own: Vec<f64> = share.iter().map(|&(i, _)| times[i] - start).collect();
        let sampled = stored.borrow().sample(&own)?;
        let d = sampled.len() / own.len();
        frames.resize(d * times.len(), 0.0);
        for (&(i, weight), frame) in share.iter().zip(sampled.chunks_exact(d)) {
            let sum = &mut frames[i * d..(i + 1) * d];
            sum.iter_mut()
                .zip(frame)
                .for_each(|(s, x)| *s += weight * x);
        }
    }
    Ok(frames)
}

/// The sum of squared distances of a window's frames from what is sampled there, for the frames that no later window has a part in.
///
/// `fitted` are the windows up to this one that matter, by number; frames are those of the window, n x 3V.
pub fn settled_error(
    plan: &Plan,
    window: usize,
    frames: &[f64],
    fitted: &[(usize, &Stored)],
) -> Result<f64, ShapeError> {
    let range = plan.windows[window].clone();
    let from = range.start;
    let next = plan.windows.get(window + 1).map_or(range.end, |w| w.start);
    let times: Vec<f64> = (from..next).map(|i| i as f64 + 1.0).collect();
    let found = sample(plan, &times, |j| {
        let known = fitted.iter().find(|(number, _)| *number == j);
        known
            .map(|(_, stored)| *stored)
            .ok_or(ShapeError::WrongLength {
                what: "windows before this one",
                expected: j,
                found: fitted.len(),
            })
    })?;
    let d = found.len() / times.len().max(1);
    let given = &frames[(from - range.start) * d..(next - range.start) * d];
    Ok(found.iter().zip(given).map(|(a, b)| (a - b).powi(2)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn weights_pass_from_one_window_to_the_next() {
        let plan = Plan::new(50, 20, 5).unwrap();
        assert_eq!(plan.windows(), [0..20, 15..35, 30..50]);
        assert_eq!(plan.weights(1.0), [(0, 1.0)]);
        assert_eq!(plan.weights(50.0), [(2, 1.0)]);
        assert_eq!(plan.weights(16.0), [(0, 1.0)]);
        let middle = plan.weights(18.0);
        assert_eq!(middle.len(), 2);
        assert!((middle[0].1 - 0.5).abs() < 1e-15);
        assert_eq!(Plan::new(12, 20, 5).unwrap().windows(), [0..12]);
    }

    #[test]
    fn windows_that_cannot_be_are_named() {
        assert_eq!(Plan::new(9, 3, 1), Err(PlanError::TooShort { window: 3 }));
        for overlap in [0, 1, 6, usize::MAX] {
            assert!(matches!(
                Plan::new(50, 10, overlap),
                Err(PlanError::BadOverlap { most: 5, .. })
            ));
        }
        assert_eq!(Plan::new(0, 10, 2), Err(PlanError::NoFrames));
    }

    proptest! {
        #[test]
        fn weights_are_a_smooth_partition_of_unity(n in 1usize..400, window in 4usize..60, share in 0.0f64..1.0) {
            let overlap = 2 + (share * (window / 2 - 2) as f64) as usize;
            let plan = Plan::new(n, window, overlap).unwrap();
            prop_assert_eq!(plan.frame_count(), n);
            prop_assert!(plan.windows().iter().all(|w| w.len() == window.min(n)));
            prop_assert!(plan.windows().windows(2).all(|w| w[0].end >= w[1].start + overlap));
            let steps = 4 * (n - 1);
            let weight = |q: usize, j: usize| {
                let t = 1.0 + q as f64 / 4.0;
                plan.weights(t).iter().find(|p| p.0 == j).map_or(0.0, |p| p.1)
            };
            for q in 0..=steps {
                let parts = plan.weights(1.0 + q as f64 / 4.0);
                prop_assert!((parts.iter().map(|p| p.1).sum::<f64>() - 1.0).abs() < 1e-12);
            }
            // The steepest that a weight rises is 15/8 over the overlap, twice that where two change at once.
            for j in 0..plan.windows().len().min(6) {
                for q in 1..=steps {
                    prop_assert!((weight(q, j) - weight(q - 1, j)).abs() <= 0.25 * 4.0 / (overlap - 1) as f64 + 1e-12);
                }
            }
        }
    }
}
