//! Signals fitted to a long sequence, a window at a time: memory is that of two windows, however long the sequence.

use super::file::{AT_A_TIME, Stored};
use super::windows::Plan;
use super::windows_file::blend;
use crate::sequence::stream::FrameStream;
use crate::sequence::{Sequence, SequenceError};
use crate::sequence::format::FormatError;
use crate::shape::{ShapeError, Space};

/// How far the joined windows are from the sequence, over all of its frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Joined {
    /// The sum of squared distances of the vertices of psi(i) from those of frame i; in vertex space the error (2).
    pub error: f64,
    /// The sum of squared distances of the vertices from the mean vertex of their frame.
    pub spread: f64,
}

/// A window that has been fitted.
struct Fitted {
    stored: Stored,
    space: Option<Box<dyn Space>>,
}

/// Fits the windows of a plan one after another to the frames of a stream, which has as many as the plan.
///
/// `fit` is given the frames of a window and its number (0-based) and makes its signals; `keep` is given them before the next window is fitted. Both end
/// everything by an error. The error of the joined motion is measured as soon as the windows that take part in it are there. Costs the fits, and to
/// evaluate psi at each frame.
pub fn fit_windows<E>(
    stream: &mut FrameStream,
    plan: &Plan,
    mut fit: impl FnMut(&Sequence, usize) -> Result<Stored, E>,
    mut keep: impl FnMut(&Stored) -> Result<(), E>,
) -> Result<Joined, E>
where
    E: From<FormatError> + From<SequenceError> + From<ShapeError>,
{
    let d = stream.dimension();
    let mut joined = Joined::default();
    let mut before: Option<Fitted> = None;
    let mut frames: Vec<f64> = Vec::new();
    for (window, range) in plan.windows().iter().enumerate() {
        frames.extend(stream.read(range.len() - frames.len() / d)?);
        let sequence = Sequence::new(stream.connectivity().clone(), range.len(), frames)?;
        let stored = fit(&sequence, window)?;
        keep(&stored)?;
        let space = stored.prepare()?;
        let now = Fitted { stored, space };
        joined.add(plan, window, &sequence, before.as_ref(), &now)?;
        let settled = plan.settled(window).len();
        frames = sequence.positions()[settled * d..].to_vec();
        before = Some(now);
    }
    Ok(joined)
}

impl Joined {
    /// Adds the frames that no later window is part of.
    fn add(
        &mut self,
        plan: &Plan,
        window: usize,
        sequence: &Sequence,
        before: Option<&Fitted>,
        now: &Fitted,
    ) -> Result<(), ShapeError> {
        let d = sequence.dimension();
        let settled: Vec<f64> = plan.settled(window).map(|i| i as f64 + 1.0).collect();
        let given = sequence.positions().chunks(AT_A_TIME * d);
        for (times, given) in settled.chunks(AT_A_TIME).zip(given) {
            let found = blend(plan, times, |which, own| {
                let fitted = if which == window { Some(now) } else { before };
                let fitted = fitted.ok_or(ShapeError::WrongLength {
                    what: "windows before this one",
                    expected: window,
                    found: 0,
                })?;
                fitted.stored.sample_in(fitted.space.as_deref(), own)
            })?;
            let gaps = found.iter().zip(given);
            self.error += gaps.map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            let frames = given.chunks(d).take(times.len());
            self.spread += frames.map(frame_spread).sum::<f64>();
        }
        Ok(())
    }
}

/// The sum of squared distances of the vertices of a frame (3V positions) from their mean.
pub fn frame_spread(frame: &[f64]) -> f64 {
    let axes = (0..3).map(|axis| {
        let values = || frame.iter().skip(axis).step_by(3);
        let mean = values().sum::<f64>() / (frame.len() / 3) as f64;
        values().map(|x| (x - mean).powi(2)).sum::<f64>()
    });
    axes.sum()
}
