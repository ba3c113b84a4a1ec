//! Windows of frames for long sequences (the limitation of section 6): each has signals of its own, and they are joined smoothly where they overlap.
//!
//! Neighbours have `overlap` = o frames in common, the last o of one and the first o of the next; no frame is in three. Let a be the first
//! of these frames (1-based). Over them psi passes from one window to the next,
//!
//! ```text
//! psi(t) = (1 - S(s)) psi_j(t) + S(s) psi_j+1(t),   s = (t - a) / (o - 1),   S(s) = 6 s^5 - 15 s^4 + 10 s^3
//! ```
//!
//! S rises from 0 to 1 with S' = S'' = 0 at both ends: the weights are C^2 in t, and the joined motion is as smooth at a join as the windows' own motions
//! are there, up to C^2. (A window's own motion, which is C^1 where rho passes from frame to frame, is not made smoother.) The weights are not negative and
//! sum to 1, so the squared error of a frame is at most the weighted mean of those of its windows.

use std::ops::Range;

use thiserror::Error;

use super::fit::FEWEST_FRAMES;

/// The shortest windows: a third of one is at least 2 frames of overlap.
pub const FEWEST_IN_WINDOW: usize = 6;

/// Why there are no such windows.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum PlanError {
    /// Shorter than two overlaps and what is between them.
    #[error("a window of {window} frames: expected at least {FEWEST_IN_WINDOW}")]
    TooShort { window: usize },
    /// An overlap that is none, or leaves too little of a window to itself.
    #[error(
        "an overlap of {overlap} frames: expected 2 to {most}, a third of a window of {window}"
    )]
    BadOverlap {
        overlap: usize,
        window: usize,
        most: usize,
    },
    /// Too few frames for one window's time signal.
    #[error("{frames} frames: expected at least {FEWEST_FRAMES}")]
    TooFewFrames { frames: usize },
    /// Windows that do not follow each other with this overlap, as a damaged file may have them.
    #[error(
        "window {window} (1-based) does not follow the one before by {overlap} common frames, or has fewer than twice as many"
    )]
    Astray { window: usize, overlap: usize },
}

/// Which frames go into which window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    windows: Vec<Range<usize>>,
    overlap: usize,
}

/// The overlap that serves where none is asked for: an eighth of a window.
pub fn usual_overlap(window: usize) -> usize {
    (window / 8).max(2)
}

impl Plan {
    /// As few windows of at most `window` frames as cover n frames with `overlap` frames in common, all of the same length to one frame. A single one
    /// where n is at most `window`.
    pub fn new(n: usize, window: usize, overlap: usize) -> Result<Self, PlanError> {
        if window < FEWEST_IN_WINDOW {
            return Err(PlanError::TooShort { window });
        }
        let most = window / 3;
        if !(2..=most).contains(&overlap) {
            return Err(PlanError::BadOverlap {
                overlap,
                window,
                most,
            });
        }
        if n < FEWEST_FRAMES {
            return Err(PlanError::TooFewFrames { frames: n });
        }
        let joins = n.saturating_sub(window).div_ceil(window - overlap);
        // What the windows have to themselves or share with the next one: n - overlap frames in parts as equal as can be.
        let part = |j: usize| j * (n - overlap) / (joins + 1);
        let windows = (0..=joins).map(|j| part(j)..part(j + 1) + overlap);
        Ok(match joins {
            0 => Self::single(n),
            _ => Self {
                windows: windows.collect(),
                overlap,
            },
        })
    }

    /// One window of all n frames.
    pub fn single(n: usize) -> Self {
        Self {
            windows: std::iter::once(0..n).collect(),
            overlap: 0,
        }
    }

    /// From ranges of 0-based frames, as a file holds them.
    pub fn from_windows(windows: Vec<Range<usize>>, overlap: usize) -> Result<Self, PlanError> {
        let astray = |j: usize| -> bool {
            let (w, alone) = (&windows[j], windows.len() == 1);
            let begins = match j {
                0 => w.start == 0,
                _ => w.start.checked_add(overlap) == Some(windows[j - 1].end),
            };
            let length = w.end.saturating_sub(w.start);
            let fewest = FEWEST_FRAMES.max(if alone { 0 } else { overlap.saturating_mul(2) });
            !begins || length < fewest || (!alone && overlap < 2)
        };
        if windows.is_empty() {
            return Err(PlanError::TooFewFrames { frames: 0 });
        }
        match (0..windows.len()).find(|&j| astray(j)) {
            Some(j) => Err(PlanError::Astray {
                window: j + 1,
                overlap,
            }),
            None => Ok(Self { windows, overlap }),
        }
    }

    /// Ranges of 0-based frames, in order.
    pub fn windows(&self) -> &[Range<usize>] {
        &self.windows
    }

    /// Frames that neighbours have in common; 0 for a single window.
    pub fn overlap(&self) -> usize {
        self.overlap
    }

    /// n.
    pub fn frame_count(&self) -> usize {
        self.windows.last().map_or(0, |w| w.end)
    }

    /// The 0-based frames of a window that none after it is part of.
    pub fn settled(&self, window: usize) -> Range<usize> {
        let Range { start, end } = self.windows[window];
        let next = self.windows.get(window + 1);
        start..next.map_or(end, |next| next.start)
    }

    /// The sum of a window's weights over the frames. Those of all windows sum to n.
    pub fn share(&self, window: usize) -> f64 {
        let joins = usize::from(window > 0) + usize::from(window + 1 < self.windows.len());
        self.windows[window].len() as f64 - joins as f64 * self.overlap as f64 / 2.0
    }

    /// The one or two windows that have a part in frame time t, in [1, n], and their weights, which sum to 1. O(log windows).
    pub fn weights(&self, t: f64) -> impl Iterator<Item = (usize, f64)> + use<> {
        let begun = |w: &Range<usize>| w.start as f64 + 1.0 <= t;
        let last = self.windows.partition_point(begun).saturating_sub(1);
        let rise = match (last, self.overlap) {
            (0, _) | (_, 0 | 1) => 1.0,
            (_, overlap) => {
                let first = self.windows[last].start as f64 + 1.0;
                smooth_step((t - first) / (overlap - 1) as f64)
            }
        };
        let parts = [(last.saturating_sub(1), 1.0 - rise), (last, rise)];
        parts.into_iter().filter(|part| part.1 > 0.0)
    }
}

/// S: 0 up to 0, 1 from 1 on, and between them 6 s^5 - 15 s^4 + 10 s^3, whose first and second derivatives vanish at both ends.
fn smooth_step(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// Frames at times in [1, n], 3V positions each, of which `sample` gives those of a window at times of its own. Asks for every window at most once, in
/// ascending order.
pub(super) fn blend<E>(
    plan: &Plan,
    times: &[f64],
    mut sample: impl FnMut(usize, &[f64]) -> Result<Vec<f64>, E>,
) -> Result<Vec<f64>, E> {
    let mut parts: Vec<(usize, usize, f64)> = Vec::new();
    for (i, &t) in times.iter().enumerate() {
        parts.extend(plan.weights(t).map(|(window, weight)| (window, i, weight)));
    }
    parts.sort_by_key(|&(window, i, _)| (window, i));
    let mut frames = Vec::new();
    for part in parts.chunk_by(|a, b| a.0 == b.0) {
        let start = plan.windows()[part[0].0].start as f64;
        let own: Vec<f64> = part.iter().map(|&(_, i, _)| times[i] - start).collect();
        let sampled = sample(part[0].0, &own)?;
        let d = sampled.len() / own.len();
        if frames.is_empty() && own.len() == times.len() && part.iter().all(|p| p.2 == 1.0) {
            return Ok(sampled);
        }
        frames.resize(d * times.len(), 0.0);
        for (&(_, i, weight), frame) in part.iter().zip(sampled.chunks_exact(d.max(1))) {
            let sum = &mut frames[i * d..(i + 1) * d];
            let terms = sum.iter_mut().zip(frame);
            terms.for_each(|(s, x)| *s += weight * x);
        }
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn weights(plan: &Plan, t: f64) -> Vec<(usize, f64)> {
        plan.weights(t).collect()
    }

    #[test]
    fn weights_pass_from_one_window_to_the_next() {
        let plan = Plan::new(50, 20, 5).unwrap();
        assert_eq!(plan.windows(), [0..20, 15..35, 30..50]);
        assert_eq!(weights(&plan, 1.0), [(0, 1.0)]);
        assert_eq!(weights(&plan, 50.0), [(2, 1.0)]);
        assert_eq!(weights(&plan, 16.0), [(0, 1.0)]);
        assert_eq!(weights(&plan, 18.0), [(0, 0.5), (1, 0.5)]);
        assert_eq!(weights(&plan, 20.0), [(1, 1.0)]);
        assert_eq!(plan.settled(1), 15..30);
        assert_eq!(Plan::new(12, 20, 5).unwrap(), Plan::single(12));
        assert_eq!(weights(&Plan::single(12), 7.5), [(0, 1.0)]);
        let lengths = |n| -> Vec<usize> {
            let plan = Plan::new(n, 20, 5).unwrap();
            plan.windows().iter().map(Range::len).collect()
        };
        assert_eq!((lengths(21), lengths(37)), (vec![13, 13], vec![15, 16, 16]));
    }

    #[test]
    fn windows_that_cannot_be_are_named() {
        for window in [0, 1, 5] {
            let refused = Plan::new(9, window, 2);
            assert_eq!(refused, Err(PlanError::TooShort { window }));
        }
        for overlap in [0, 1, 4, 10, usize::MAX] {
            assert!(matches!(
                Plan::new(50, 10, overlap),
                Err(PlanError::BadOverlap { most: 3, .. })
            ));
        }
        let frames = 3;
        assert_eq!(Plan::new(3, 10, 2), Err(PlanError::TooFewFrames { frames }));
        let read = |windows: &[[usize; 2]], overlap| {
            let windows = windows.iter().map(|&[start, end]| Range { start, end });
            Plan::from_windows(windows.collect(), overlap).map_err(|e| match e {
                PlanError::Astray { window, .. } => window,
                _ => 0,
            })
        };
        assert_eq!(read(&[], 2), Err(0));
        for (windows, overlap, window) in [
            (&[[1, 9]][..], 0, 1),
            (&[[0, 9], [8, 20]], 1, 1),
            (&[[0, 9], [6, 20]], 2, 2),
            (&[[0, 9], [7, 10]], 2, 2),
            (&[[0, 9], [7, 2]], 2, 2),
            (&[[0, 9], [usize::MAX, 2]], 2, 2),
            (&[[0, 9], [9, 20]], 0, 1),
        ] {
            assert_eq!(read(windows, overlap), Err(window), "{windows:?}");
        }
    }

    /// Second derivatives of the weights do not jump: their differences over a step vanish with the step.
    #[test]
    fn weights_have_two_continuous_derivatives() {
        let plan = Plan::new(100, 30, 7).unwrap();
        let h = 1e-3;
        for (j, window) in plan.windows().iter().enumerate() {
            let weight = |t: f64| {
                let own = plan.weights(t).find(|part| part.0 == j);
                own.map_or(0.0, |part| part.1)
            };
            let bend = |t: f64| (weight(t - h) - 2.0 * weight(t) + weight(t + h)) / (h * h);
            let (from, to) = (window.start as f64 + 1.0, window.end as f64);
            let times = (0..).map(|i| from - 2.0 + 0.01 * i as f64);
            let inside = times.take_while(|t| *t < to + 2.0);
            for t in inside.filter(|t| (2.0..99.0).contains(t)) {
                let jump = (bend(t + 0.01) - bend(t)).abs();
                // |S'''| is at most 60, over (o - 1)^3; what remains is rounding.
                assert!(jump < 60.0 / 216.0 * 0.012 + 1e-8, "{j} {t}: {jump}");
            }
        }
    }

    proptest! {
        #[test]
        fn windows_cover_the_frames_and_weights_are_a_partition_of_unity(
            n in 4usize..400, window in 6usize..60, share in 0.0f64..1.0
        ) {
            let overlap = 2 + (share * (window / 3 - 2) as f64).round() as usize;
            let plan = Plan::new(n, window, overlap).unwrap();
            prop_assert_eq!(plan.frame_count(), n);
            let ranges = plan.windows().to_vec();
            let lengths: Vec<usize> = ranges.iter().map(Range::len).collect();
            let (least, most) = (*lengths.iter().min().unwrap(), *lengths.iter().max().unwrap());
            prop_assert!(most <= window && most - least <= 1);
            // One window less would not do.
            let fewer = ranges.len() - 1;
            prop_assert!(fewer == 0 || fewer * (window - overlap) + overlap < n);
            prop_assert_eq!(&Plan::from_windows(ranges.clone(), plan.overlap()).unwrap(), &plan);
            let settled: Vec<usize> = (0..ranges.len()).flat_map(|j| plan.settled(j)).collect();
            prop_assert_eq!(settled, (0..n).collect::<Vec<_>>());
            let mut shares = vec![0.0; ranges.len()];
            for q in 0..4 * (n - 1) + 1 {
                let t = 1.0 + q as f64 / 4.0;
                let parts = weights(&plan, t);
                prop_assert!((parts.iter().map(|p| p.1).sum::<f64>() - 1.0).abs() < 1e-15);
                for (j, weight) in parts {
                    let range = &ranges[j];
                    prop_assert!((range.start as f64 + 1.0..=range.end as f64).contains(&t));
                    if q % 4 == 0 { shares[j] += weight; }
                }
            }
            for (j, share) in shares.iter().enumerate() {
                prop_assert!((share - plan.share(j)).abs() < 1e-9);
            }
        }
    }
}
