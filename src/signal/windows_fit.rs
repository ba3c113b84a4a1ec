//! Signals fitted to a long sequence, a window at a time: memory is that of two windows, however long the sequence.

use super::file::{AT_A_TIME, Stored};
use super::windows::{Plan, blend};
use crate::sequence::format::FormatError;
use crate::sequence::format::stream::FrameStream;
use crate::sequence::{Sequence, SequenceError};
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::dataset::{open, open_stream};
    use crate::shape::SpaceKind;
    use crate::signal::fit::{Fit, FitOptions, fit};
    use crate::signal::windows_file::{WindowsFile, WindowsWriter};
    use faer::MatRef;

    type Failure = Box<dyn std::error::Error>;

    fn plain(frames: &Sequence, [k, l, m]: [usize; 3]) -> Fit {
        let (d, n) = (frames.dimension(), frames.frame_count());
        let frames = MatRef::from_column_major_slice(frames.positions(), d, n);
        fit(frames, &FitOptions::new(k, l, m)).unwrap()
    }

    fn stored(frames: &Sequence, fit: Fit) -> Stored {
        Stored {
            representation: fit.representation,
            positions: fit.positions,
            connectivity: frames.connectivity().clone(),
            space: SpaceKind::Vertex,
            reference: Vec::new(),
            patches: Vec::new(),
        }
    }

    /// Windows with these constants, the error of the joined motion, and the sum of the windows' own errors.
    fn joined(name: &str, plan: &Plan, klm: [usize; 3]) -> (WindowsFile, Joined, f64) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("windows.npz");
        let mut stream = open_stream(name).unwrap();
        let space = SpaceKind::Vertex;
        let mesh = stream.connectivity().clone();
        let mut writer = WindowsWriter::create(&path, plan, &mesh, space).unwrap();
        let mut own = 0.0;
        let fit = |frames: &Sequence, _: usize| -> Result<Stored, Failure> {
            let fit = plain(frames, klm);
            own += fit.errors.psi;
            Ok(stored(frames, fit))
        };
        let joined = fit_windows(&mut stream, plan, fit, |s| Ok(writer.add(s)?)).unwrap();
        writer.finish().unwrap();
        // The file stays readable while it is open.
        (WindowsFile::open(&path).unwrap(), joined, own)
    }

    fn greatest(a: &[f64]) -> f64 {
        a.iter().fold(0.0, |most, x| x.abs().max(most))
    }

    fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
        a.iter().zip(b).map(|(a, b)| a - b).collect()
    }

    #[test]
    fn one_window_of_all_frames_is_the_plain_fit() {
        let sequence = open("@roam-small").unwrap();
        let n = sequence.frame_count();
        let klm = [25, 18, 9];
        let fit = plain(&sequence, klm);
        for window in [n, 10 * n] {
            let plan = Plan::new(n, window, 5).unwrap();
            let (mut file, joined, _) = joined("@roam-small", &plan, klm);
            let error = fit.errors.psi;
            assert!(
                (joined.error - error).abs() < 1e-9 * error,
                "{joined:?} {error}"
            );
            let whole = stored(&sequence, fit.clone());
            assert_eq!(*file.window(0).unwrap(), whole);
            let times: Vec<f64> = (0..300)
                .map(|i| 1.0 + i as f64 * (n - 1) as f64 / 299.0)
                .collect();
            let bits = |x: Vec<f64>| -> Vec<u64> { x.into_iter().map(f64::to_bits).collect() };
            assert_eq!(
                bits(file.sample(&times).unwrap()),
                bits(whole.sample(&times).unwrap())
            );
        }
    }

    #[test]
    fn errors_are_those_of_the_joined_frames_and_below_those_of_the_windows() {
        let name = "@roam-small:110";
        let sequence = open(name).unwrap();
        let plan = Plan::new(110, 45, 9).unwrap();
        assert_eq!(plan.windows().len(), 3);
        let (mut file, joined, own) = joined(name, &plan, [30, 22, 12]);
        let times: Vec<f64> = (1..=110).map(f64::from).collect();
        let frames = file.sample(&times).unwrap();
        let error: f64 = minus(&frames, sequence.positions())
            .iter()
            .map(|x| x * x)
            .sum();
        assert!(
            (joined.error - error).abs() < 1e-9 * error,
            "{joined:?} {error}"
        );
        assert!(joined.error < own, "{joined:?} {own}");
        let whole = plain(&sequence, [74, 54, 12]);
        assert!(error < 1.5 * whole.errors.psi, "{error} {:?}", whole.errors);
        // In any order and one at a time, frames are the same to the bit.
        let d = sequence.dimension();
        for i in [109, 0, 37, 40, 72, 36, 5] {
            assert_eq!(
                file.sample(&times[i..=i]).unwrap(),
                frames[i * d..(i + 1) * d]
            );
        }
    }

    /// Where an overlap begins and ends, the joined motion leaves a window's own by 10 s^3 of the gap between the two: three orders of contact, so that
    /// value, speed and acceleration are the window's. Between, it bends no more than the product rule allows.
    #[test]
    fn joins_are_smooth() {
        let name = "@roam-small:90";
        let plan = Plan::new(90, 50, 10).unwrap();
        let (mut file, ..) = joined(name, &plan, [30, 22, 12]);
        let (a, b) = (plan.windows()[0].clone(), plan.windows()[1].clone());
        let windows = [0, 1].map(|j| file.window(j).unwrap().clone());
        let own = |j: usize, t: f64| {
            let start = plan.windows()[j].start as f64;
            windows[j].sample(&[t - start]).unwrap()
        };
        let (from, to) = (b.start as f64 + 1.0, a.end as f64);
        let span = to - from;
        let gap = |t: f64| minus(&own(1, t), &own(0, t));
        let h = 0.125;
        for (step, j) in [(h, 0), (2.0 * h, 0), (-h, 1), (-2.0 * h, 1)] {
            let t = if j == 0 { from + step } else { to + step };
            let left = greatest(&minus(&file.sample(&[t]).unwrap(), &own(j, t)));
            let most = 10.0 * (f64::abs(step) / span).powi(3) * greatest(&gap(t));
            assert!(0.0 < left && left <= most, "{t}: {left} {most}");
        }
        let bend = |f: &mut dyn FnMut(f64) -> Vec<f64>, t: f64| {
            let (l, m, r) = (f(t - h), f(t), f(t + h));
            let terms = l.iter().zip(&m).zip(&r);
            greatest(&terms.map(|((l, m), r)| l - 2.0 * m + r).collect::<Vec<_>>())
        };
        let mut worst: f64 = 0.0;
        for i in 1..(span / h) as usize {
            let t = from + h * i as f64;
            let found = bend(&mut |t| file.sample(&[t]).unwrap(), t);
            let each = [0, 1].map(|j| bend(&mut |t| own(j, t), t));
            let gaps = [t - h, t, t + h].map(gap);
            let moves = [minus(&gaps[1], &gaps[0]), minus(&gaps[2], &gaps[1])];
            let moving = moves.iter().map(|m| greatest(m)).fold(0.0, f64::max);
            let apart = gaps.iter().map(|g| greatest(g)).fold(0.0, f64::max);
            // |S'| is at most 15/8 and |S''| at most 10/sqrt 3.
            let slope = 1.875 * h / span;
            let curve = 10.0 / 3f64.sqrt() * (h / span).powi(2);
            let most = each[0].max(each[1]) + 2.0 * slope * moving + curve * apart;
            assert!(found <= most * (1.0 + 1e-9), "{t}: {found} {most}");
            worst = worst.max(most);
        }
        // A switch in the middle would jump by the gap there.
        let jump = greatest(&gap((from + to) / 2.0));
        assert!(jump > 2.0 * worst, "{jump} {worst}");
    }
}
