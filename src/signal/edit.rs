//! Edits of the time signal (section 4.1): they change the curve near where they are made, and leave pose and shape signals alone.

use std::ops::RangeInclusive;

use thiserror::Error;

use super::Point;
use super::basis::Basis;
use super::f::Spline;
use super::insert::InsertError;
use super::psi::TimeSignal;
use super::sketch::{Sketch, SketchError};
use super::strand::{Bead, Piece, Seam, Strand, join};
use crate::linalg::kernels::max_abs;

/// A span of frames with fewer control points of its own has no curve that could be taken along; it gets knots at its frames first.
const FEWEST_BEADS: usize = 4;
/// More frames or control points are a mistake.
const MOST: usize = 10_000_000;
/// Positions farther away than so many extents of the motion are a mistake.
const FAR: f64 = 1e6;

/// What to do with the time signal. Frames and control points are 0-based, ranges hold both ends.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// A control point goes somewhere else.
    Move { control: usize, target: Target },
    /// The motion leaves after a frame, runs through these points of the pose plane and comes back.
    Loop {
        after: usize,
        through: Vec<Point>,
        /// New frames; as many as keep the mean pace if not given.
        frames: Option<usize>,
        /// New control points; as many a frame as there are already if not given.
        control: Option<usize>,
    },
    /// Frames are left out; `join` new ones bridge the gap.
    Delete {
        frames: RangeInclusive<usize>,
        join: usize,
    },
    /// Frames come again, this many times, with `join` new frames at each seam.
    Repeat {
        frames: RangeInclusive<usize>,
        times: usize,
        join: usize,
    },
    /// Frames run backwards, with `join` new frames at each seam.
    Reverse {
        frames: RangeInclusive<usize>,
        join: usize,
    },
    /// Knots at these frames: the same curve, with more control points for edits to come.
    Refine { frames: RangeInclusive<usize> },
}

/// Where a control point goes, in the units of the pose plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    To(Point),
    By(Point),
}

/// Why an edit cannot be made.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("edit {edit} (1-based): {source}")]
pub struct EditError {
    /// Which of the edits, 1-based.
    pub edit: usize,
    pub source: EditProblem,
}

/// What is wrong with one edit. Frames and control points are named 1-based, as the paper counts them.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EditProblem {
    /// No such control point.
    #[error("there is no control point {control}; expected 1 to {count}")]
    NoControlPoint { control: usize, count: usize },
    /// No such frames.
    #[error("there are no frames {first}..{last}; expected a range within 1..{count}")]
    NoFrames {
        first: usize,
        last: usize,
        count: usize,
    },
    /// A loop needs a frame before it and one behind it.
    #[error("a loop cannot come after frame {after}; expected 1 to {most}")]
    LoopAtEnd { after: usize, most: usize },
    /// A position that is NaN or infinite.
    #[error("a position is not finite: {0:?}")]
    NotFinite(Point),
    /// A position that no motion of this size has.
    #[error(
        "the position {point:?} is farther than {FAR:e} times the extent of the motion, {extent:.3e}; positions are in the units of the pose plane"
    )]
    TooFar { point: Point, extent: f64 },
    /// A loop through nothing.
    #[error("`through` is empty; expected at least 1 point [x, y]")]
    NoPoint,
    /// A count of 0.
    #[error("`{0}` is 0; expected at least 1")]
    Zero(&'static str),
    /// Nothing would be left to play.
    #[error("frames {first}..{last} are too many to delete; at least 2 of {count} must be left")]
    NothingLeft {
        first: usize,
        last: usize,
        count: usize,
    },
    /// More frames or control points than `MOST`.
    #[error("the sequence would have more than {MOST} frames or control points")]
    TooLong,
    /// See [`SketchError`].
    #[error(transparent)]
    Sketch(#[from] SketchError),
    /// See [`InsertError`].
    #[error(transparent)]
    Insert(#[from] InsertError),
}

/// A time signal after edits, and what has become of the frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Edited {
    pub time: TimeSignal,
    /// The frame before the edits that each frame is, 0-based; none for new ones.
    pub sources: Vec<Option<usize>>,
    /// Whether each frame is that frame bit for bit: knots and control points that it depends on are the same.
    pub kept: Vec<bool>,
}

impl Edited {
    /// p of the frames: where the frame was before, if it is the same still, and on the curve otherwise.
    pub fn positions(&self, before: &[Point]) -> Vec<Point> {
        let on_curve = self.time.spline.evaluate_all(&self.time.parameters);
        let place = |(i, p): (usize, Point)| match self.sources[i] {
            Some(source) if self.kept[i] => before.get(source).copied().unwrap_or(p),
            _ => p,
        };
        on_curve.into_iter().enumerate().map(place).collect()
    }
}

/// Makes the edits in their order, each to the outcome of those before it.
///
/// The signal changes within three knots of a seam or of a control point's own, and nowhere else; there parameters may only be shifted, which on the
/// grid of [`super::parameters::Grid`] changes no bit. O(edits (n + k)).
pub fn edit(time: &TimeSignal, edits: &[Edit]) -> Result<Edited, EditError> {
    let n = time.frame_count();
    let mut strand = Strand {
        spline: time.spline.clone(),
        frames: time
            .parameters
            .iter()
            .copied()
            .zip((0..n).map(Some))
            .collect(),
    };
    for (i, edit) in edits.iter().enumerate() {
        let edit_error = |source| EditError {
            edit: i + 1,
            source,
        };
        strand
            .spline
            .check()
            .map_err(|e| edit_error(InsertError::from(e).into()))?;
        strand = make(strand, edit).map_err(edit_error)?;
    }
    let (parameters, sources): (Vec<f64>, Vec<Option<usize>>) =
        strand.frames.iter().copied().unzip();
    let kept = |(&t, source): (&f64, &Option<usize>)| {
        source.is_some_and(|i| {
            stencil(&strand.spline, t) == stencil(&time.spline, time.parameters[i])
        })
    };
    Ok(Edited {
        kept: parameters.iter().zip(&sources).map(kept).collect(),
        time: TimeSignal::new(strand.spline, parameters),
        sources,
    })
}

/// Everything that f~ depends on at a parameter: control points, differences of knots, and knots from the parameter.
fn stencil(spline: &Spline, t: f64) -> ([Point; 4], [f64; 6], [f64; 6]) {
    let basis = Basis {
        knots: &spline.knots,
    };
    let (low, high) = basis.domain();
    let (s, t) = (basis.span(t), t.clamp(low, high));
    let u: [f64; 6] = std::array::from_fn(|i| basis.knot(s - 2 + i));
    let spread = [
        u[3] - u[1],
        u[4] - u[2],
        u[3] - u[0],
        u[4] - u[1],
        u[5] - u[2],
        u[3] - u[2],
    ];
    let control = std::array::from_fn(|j| spline.control[s - 3 + j]);
    (control, spread, u.map(|u| u - t))
}

fn make(strand: Strand, edit: &Edit) -> Result<Strand, EditProblem> {
    match edit {
        Edit::Move { control, target } => moved(strand, *control, *target),
        Edit::Loop {
            after,
            through,
            frames,
            control,
        } => looped(strand, *after, through, *frames, *control),
        Edit::Delete { frames, join } => deleted(strand, frames, *join),
        Edit::Repeat {
            frames,
            times,
            join,
        } => repeated(strand, frames, *times, *join),
        Edit::Reverse { frames, join } => reversed(strand, frames, *join),
        Edit::Refine { frames } => {
            let (first, last) = within(&strand, frames)?;
            Ok(strand.refined(first, last)?)
        }
    }
}

fn moved(mut strand: Strand, control: usize, target: Target) -> Result<Strand, EditProblem> {
    let (count, extent) = (strand.spline.control.len(), extent(&strand));
    let Some(point) = strand.spline.control.get_mut(control) else {
        let control = control + 1;
        return Err(EditProblem::NoControlPoint { control, count });
    };
    *point = match target {
        Target::To(to) => to,
        Target::By(by) => [point[0] + by[0], point[1] + by[1]],
    };
    check_place(*point, extent)?;
    Ok(strand)
}

/// The greatest coordinate of the control points.
fn extent(strand: &Strand) -> f64 {
    max_abs(strand.spline.control.as_flattened())
}

fn check_place(point: Point, extent: f64) -> Result<(), EditProblem> {
    let most = max_abs(&point);
    if !point.iter().all(|x| x.is_finite()) {
        return Err(EditProblem::NotFinite(point));
    }
    match most > FAR * extent && extent > 0.0 {
        true => Err(EditProblem::TooFar { point, extent }),
        false => Ok(()),
    }
}

/// The ends of a range that is not empty and has these frames.
fn within(strand: &Strand, frames: &RangeInclusive<usize>) -> Result<(usize, usize), EditProblem> {
    let (first, last, count) = (*frames.start(), *frames.end(), strand.len());
    if first <= last && last < count {
        return Ok((first, last));
    }
    let [first, last] = [first, last].map(|i| i.saturating_add(1));
    Err(EditProblem::NoFrames { first, last, count })
}

/// An error where so many more are too many.
fn room(strand: &Strand, frames: usize, control: usize) -> Result<(), EditProblem> {
    let fits = |have: usize, more: usize| have.checked_add(more).is_some_and(|sum| sum <= MOST);
    match fits(strand.len(), frames) && fits(strand.spline.control.len(), control) {
        true => Ok(()),
        false => Err(EditProblem::TooLong),
    }
}

/// The strand with enough knots in a span of frames to take its curve along.
fn with_own_knots(strand: Strand, first: usize, last: usize) -> Result<Strand, EditProblem> {
    match strand.piece(first, last).bead_count() < FEWEST_BEADS {
        true => Ok(strand.refined(first, last)?),
        false => Ok(strand),
    }
}

/// The frames behind a span, if any.
fn rest(strand: &Strand, last: usize) -> Option<Piece> {
    (last + 1 < strand.len()).then(|| strand.piece(last + 1, strand.len() - 1))
}

fn deleted(
    strand: Strand,
    frames: &RangeInclusive<usize>,
    bridge: usize,
) -> Result<Strand, EditProblem> {
    let (first, last) = within(&strand, frames)?;
    let count = strand.len();
    if count - (last - first + 1) < 2 {
        let (first, last) = (first + 1, last + 1);
        return Err(EditProblem::NothingLeft { first, last, count });
    }
    room(&strand, bridge, 0)?;
    let seam = Seam::Across { frames: bridge };
    let before = (first > 0).then(|| strand.piece(0, first - 1));
    Ok(match (before, rest(&strand, last)) {
        (Some(before), behind) => {
            let behind = behind.map(|piece| (seam, piece));
            join(&strand, before, behind.into_iter().collect())?
        }
        (None, Some(behind)) => join(&strand, behind, Vec::new())?,
        (None, None) => strand,
    })
}

fn repeated(
    strand: Strand,
    frames: &RangeInclusive<usize>,
    times: usize,
    bridge: usize,
) -> Result<Strand, EditProblem> {
    let (first, last) = within(&strand, frames)?;
    if times == 0 {
        return Err(EditProblem::Zero("times"));
    }
    let strand = with_own_knots(strand, first, last)?;
    let again = strand.piece(first, last);
    let more = |count: usize| count.saturating_mul(times);
    let each = (last - first + 1).saturating_add(bridge);
    room(
        &strand,
        more(each).saturating_add(bridge),
        more(again.bead_count()),
    )?;
    let seam = Seam::Across { frames: bridge };
    let mut pieces = vec![(seam, again); times];
    pieces.extend(rest(&strand, last).map(|piece| (seam, piece)));
    Ok(join(&strand, strand.piece(0, last), pieces)?)
}

fn reversed(
    strand: Strand,
    frames: &RangeInclusive<usize>,
    bridge: usize,
) -> Result<Strand, EditProblem> {
    let (first, last) = within(&strand, frames)?;
    room(&strand, bridge.saturating_mul(2), 0)?;
    let strand = with_own_knots(strand, first, last)?;
    let seam = Seam::Across { frames: bridge };
    let turned = strand.piece(first, last).reversed();
    let behind = rest(&strand, last).map(|piece| (seam, piece));
    Ok(match first {
        0 => join(&strand, turned, behind.into_iter().collect())?,
        _ => {
            let pieces = [(seam, turned)].into_iter().chain(behind);
            join(&strand, strand.piece(0, first - 1), pieces.collect())?
        }
    })
}

fn looped(
    strand: Strand,
    after: usize,
    through: &[Point],
    frames: Option<usize>,
    control: Option<usize>,
) -> Result<Strand, EditProblem> {
    let n = strand.len();
    if after.saturating_add(1) >= n {
        let (after, most) = (after.saturating_add(1), n.saturating_sub(1));
        return Err(EditProblem::LoopAtEnd { after, most });
    }
    if through.is_empty() {
        return Err(EditProblem::NoPoint);
    }
    let extent = extent(&strand);
    through.iter().try_for_each(|&p| check_place(p, extent))?;
    if frames == Some(0) {
        return Err(EditProblem::Zero("frames"));
    }
    if control == Some(0) {
        return Err(EditProblem::Zero("control"));
    }
    let (before, behind) = (strand.piece(0, after), strand.piece(after + 1, n - 1));
    let leave = strand.spline.evaluate(strand.cut(after + 1).0);
    let path = Sketch::new(&[&[leave], through, &[leave]].concat(), false)?;
    let frames = frames.unwrap_or_else(|| at_mean_pace(&strand, path.length()));
    let share = strand.spline.control.len() as f64 / n as f64;
    let control = control.unwrap_or((frames as f64 * share).round() as usize);
    let control = control.max(1);
    room(&strand, frames, control)?;
    // Centripetal: each of the equal steps adds its square root.
    let length = (path.length() * frames as f64).sqrt();
    let place = |i: usize| (i as f64 + 0.5) / control as f64;
    let on_path = |share: f64| path.spline().evaluate(path.parameter(share));
    let targets: Vec<Point> = (0..control).map(|i| on_path(place(i))).collect();
    let beads = |points: &[Point]| -> Vec<Bead> {
        let bead = |(i, &p): (usize, &Point)| (length * place(i), p);
        points.iter().enumerate().map(bead).collect()
    };
    let poses = [0.5, frames as f64 - 0.5].map(|j| on_path(j / frames as f64));
    let with = |points: &[Point]| {
        let piece = Piece::new(length, beads(points), frames, poses);
        let pieces = vec![(Seam::Flush, piece), (Seam::Flush, behind.clone())];
        join(&strand, before.clone(), pieces)
    };
    let draft = with(&targets)?;
    let first = before.bead_count();
    Ok(with(&through_targets(&draft.spline, first, &targets))?)
}

/// How many frames run this way at the mean pace of the curve.
fn at_mean_pace(strand: &Strand, length: f64) -> usize {
    let steps = (1..strand.len()).map(|i| super::distance(strand.at(i - 1), strand.at(i)));
    let mean = steps.sum::<f64>() / (strand.len() - 1) as f64;
    let frames = (length / mean).round();
    if frames.is_finite() {
        (frames as usize).max(1)
    } else {
        1
    }
}

/// Control points from `first` on with which the spline takes the targets at their middle knots; the others stay. The system is tridiagonal and
/// totally positive, so that elimination needs no pivots (de Boor & Pinkus 1977).
fn through_targets(spline: &Spline, first: usize, targets: &[Point]) -> Vec<Point> {
    let basis = Basis {
        knots: &spline.knots,
    };
    let count = targets.len();
    let mut rows = Vec::with_capacity(count);
    for (i, &target) in targets.iter().enumerate() {
        let j = first + i;
        // At a knot three functions do not vanish; the span to its right has them first.
        let (start, values) = basis.values(spline.knots[j + 1]);
        let weight = |c: usize| c.checked_sub(start).and_then(|at| values.get(at)).copied();
        let weight = |c: usize| weight(c).unwrap_or(0.0);
        let (below, middle, above) = (weight(j - 1), weight(j), weight(j + 1));
        let mut right = target;
        for a in 0..2 {
            if i == 0 {
                right[a] -= below * spline.control[j - 1][a];
            }
            if i + 1 == count {
                right[a] -= above * spline.control[j + 1][a];
            }
        }
        rows.push((below, middle, above, right));
    }
    for i in 1..count {
        let (_, pivot, above, upper) = rows[i - 1];
        let factor = rows[i].0 / pivot;
        rows[i].1 -= factor * above;
        for a in 0..2 {
            rows[i].3[a] -= factor * upper[a];
        }
    }
    let mut solved = vec![[0.0; 2]; count];
    for i in (0..count).rev() {
        let (_, pivot, above, right) = rows[i];
        for a in 0..2 {
            let next = if i + 1 < count {
                above * solved[i + 1][a]
            } else {
                0.0
            };
            solved[i][a] = (right[a] - next) / pivot;
        }
    }
    solved
}

#[cfg(test)]
mod tests {
    use super::super::distance;
    use super::super::fit::{FitOptions, fit};
    use super::*;
    use faer::Mat;
    use proptest::prelude::*;

    use super::super::psi::Representation;

    /// Frames of a motion that comes round.
    fn fitted(n: usize, k: usize) -> Representation {
        let z = Mat::from_fn(12, n, |a, i| {
            let t = i as f64 * 0.4;
            (t + a as f64).sin() + 0.3 * (0.5 * t * (1.0 + a as f64 * 0.1)).cos()
        });
        let options = FitOptions::new(k, n / 2, 5);
        fit(z.as_ref(), &options).unwrap().representation
    }

    fn frames_of(r: &Representation, time: &TimeSignal) -> Vec<Vec<u64>> {
        let r = Representation {
            time: time.clone(),
            ..r.clone()
        };
        let times: Vec<f64> = (1..=time.frame_count()).map(|i| i as f64).collect();
        let frames = r.evaluate(&times);
        let bits = |frame: &[f64]| frame.iter().map(|x| x.to_bits()).collect();
        frames.chunks(r.dimension()).map(bits).collect()
    }

    /// Frames that are said to be kept are the same bits, whole frames and not poses only.
    #[track_caller]
    fn assert_kept(r: &Representation, edited: &Edited) -> usize {
        let (before, after) = (frames_of(r, &r.time), frames_of(r, &edited.time));
        assert_eq!(after.len(), edited.sources.len());
        for (i, frame) in after.iter().enumerate() {
            if edited.kept[i] {
                assert!(*frame == before[edited.sources[i].unwrap()], "frame {i}");
            }
        }
        assert!(edited.time.parameters.windows(2).all(|w| w[0] <= w[1]));
        assert!(edited.time.spline.check().is_ok());
        edited.kept.iter().filter(|&&kept| kept).count()
    }

    /// Frames outside the support of the basis functions that an edit touches: those farther than this many spans of knots from it.
    fn far(time: &TimeSignal, from: f64, to: f64) -> Vec<usize> {
        let basis = Basis {
            knots: &time.spline.knots,
        };
        let (a, b) = (basis.span(from), basis.span(to));
        (0..time.frame_count())
            .filter(|&i| {
                let s = basis.span(time.parameters[i]);
                s + 3 <= a || s >= b + 3
            })
            .collect()
    }

    #[test]
    fn a_moved_control_point_changes_only_where_its_basis_function_is() {
        let r = fitted(40, 30);
        for control in [0, 1, 13, 28, 29] {
            let target = Target::By([0.3, -0.1]);
            let edited = edit(&r.time, &[Edit::Move { control, target }]).unwrap();
            assert_kept(&r, &edited);
            let u = |i: usize| r.time.spline.knots[i.clamp(1, 32) - 1];
            // B_j lives on [T_j, T_(j+4)].
            for (i, &t) in r.time.parameters.iter().enumerate() {
                let outside = t < u(control) || t >= u(control + 4);
                assert!(!outside || edited.kept[i] || t == u(32), "{control} {i}");
            }
            assert!(edited.kept.iter().any(|k| !k));
        }
    }

    #[test]
    fn a_loop_adds_frames_and_control_points_and_leaves_the_rest() {
        let r = fitted(99, 82);
        let leave = r.time.evaluate(40.5);
        let through = vec![
            [leave[0] + 2.0, leave[1] + 1.0],
            [leave[0] + 1.0, leave[1] + 3.0],
            [leave[0] - 1.0, leave[1] + 1.0],
        ];
        let edits = [Edit::Loop {
            after: 39,
            through: through.clone(),
            frames: Some(19),
            control: Some(15),
        }];
        let edited = edit(&r.time, &edits).unwrap();
        // Figure 5: (k, n) = (82, 99) and then (97, 118).
        assert_eq!(edited.time.spline.control.len(), 97);
        assert_eq!(edited.time.frame_count(), 118);
        let cut = 0.5 * (r.time.parameters[39] + r.time.parameters[40]);
        let kept = assert_kept(&r, &edited);
        for i in far(&r.time, cut, cut) {
            assert!(edited.kept[if i <= 39 { i } else { i + 19 }], "frame {i}");
        }
        assert!(kept >= 88, "{kept}");
        // The curve comes near the points asked for, and frames step evenly.
        let curve: Vec<Point> = (0..=4000)
            .map(|q| edited.time.evaluate(1.0 + q as f64 * 117.0 / 4000.0))
            .collect();
        for p in through {
            let nearest = curve
                .iter()
                .map(|&c| distance(c, p))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.1, "{nearest}");
        }
        let steps: Vec<f64> = (40..58)
            .map(|i| {
                distance(
                    edited.time.evaluate(i as f64 + 1.0),
                    edited.time.evaluate(i as f64 + 2.0),
                )
            })
            .collect();
        let (least, most) = steps
            .iter()
            .fold((f64::INFINITY, 0.0f64), |(a, b), &s| (a.min(s), b.max(s)));
        assert!(most < 2.0 * least, "{steps:?}");
    }

    #[test]
    fn repeated_frames_are_the_frames_again() {
        let r = fitted(60, 50);
        let edits = [Edit::Repeat {
            frames: 10..=40,
            times: 2,
            join: 3,
        }];
        let edited = edit(&r.time, &edits).unwrap();
        assert_eq!(edited.time.frame_count(), 60 + 2 * 31 + 3 * 3);
        assert_kept(&r, &edited);
        let times_kept = |i: usize| {
            (0..edited.kept.len())
                .filter(|&j| edited.sources[j] == Some(i) && edited.kept[j])
                .count()
        };
        for i in 17..34 {
            assert_eq!(times_kept(i), 3, "frame {i}");
        }
        for i in (0..4).chain(48..60) {
            assert_eq!(times_kept(i), 1, "frame {i}");
        }
    }

    #[test]
    fn deleted_frames_are_gone_and_the_ends_are_cut_exactly() {
        let r = fitted(60, 50);
        let delete = |frames| edit(&r.time, &[Edit::Delete { frames, join: 0 }]).unwrap();
        let middle = delete(20..=29);
        assert_eq!(middle.time.frame_count(), 50);
        assert!(
            middle
                .sources
                .iter()
                .flatten()
                .all(|i| !(20..=29).contains(i))
        );
        assert!(assert_kept(&r, &middle) >= 38);
        for (edited, first) in [(delete(0..=9), 10), (delete(50..=59), 0)] {
            assert_eq!(edited.time.frame_count(), 50);
            assert!(assert_kept(&r, &edited) >= 44);
            for i in 0..=490 {
                let t = 1.0 + i as f64 / 10.0;
                let (a, b) = (edited.time.evaluate(t), r.time.evaluate(t + first as f64));
                // Between frames rho differs beside a new end.
                if t.fract() == 0.0 || (3.0..48.0).contains(&t) {
                    assert!(distance(a, b) < 1e-12, "{t}: {a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn all_of_it_backwards_and_back_again_is_the_signal() {
        let r = fitted(30, 24);
        let all = Edit::Reverse {
            frames: 0..=29,
            join: 0,
        };
        let once = edit(&r.time, std::slice::from_ref(&all)).unwrap();
        let twice = edit(&r.time, &[all.clone(), all]).unwrap();
        for i in 0..30 {
            let (a, b) = (
                r.time.evaluate(i as f64 + 1.0),
                once.time.evaluate(30.0 - i as f64),
            );
            assert!(distance(a, b) < 1e-12);
        }
        assert_eq!(twice.kept, vec![true; 30]);
        let part = edit(
            &r.time,
            &[Edit::Reverse {
                frames: 8..=21,
                join: 2,
            }],
        )
        .unwrap();
        assert_eq!(part.time.frame_count(), 34);
        assert_kept(&r, &part);
        let (a, b) = (
            r.time.evaluate(16.0),
            part.time
                .evaluate(part.sources.iter().position(|&s| s == Some(15)).unwrap() as f64 + 1.0),
        );
        assert!(distance(a, b) < 1e-9);
        for frames in [0..=14, 15..=29] {
            let edited = edit(&r.time, &[Edit::Reverse { frames, join: 0 }]).unwrap();
            assert_eq!(edited.time.frame_count(), 30);
            assert_kept(&r, &edited);
        }
    }

    #[test]
    fn refining_leaves_the_curve() {
        let r = fitted(40, 20);
        let edited = edit(&r.time, &[Edit::Refine { frames: 10..=20 }]).unwrap();
        assert_eq!(edited.time.spline.control.len(), 31);
        for i in 0..=390 {
            let t = 1.0 + i as f64 / 10.0;
            assert!(distance(edited.time.evaluate(t), r.time.evaluate(t)) < 1e-13);
        }
    }

    #[test]
    fn edits_that_cannot_be_made_are_named() {
        let r = fitted(10, 8);
        let problem = |e: Edit| edit(&r.time, &[Edit::Refine { frames: 2..=3 }, e]).unwrap_err();
        let target = Target::To([f64::NAN, 0.0]);
        for (bad, words) in [
            (
                Edit::Move {
                    control: 10,
                    target: Target::By([0.0; 2]),
                },
                "control point 11; expected 1 to 10",
            ),
            (Edit::Move { control: 1, target }, "not finite"),
            (
                Edit::Delete {
                    frames: 0..=8,
                    join: 0,
                },
                "at least 2 of 10",
            ),
            (
                Edit::Delete {
                    frames: 8..=10,
                    join: 0,
                },
                "frames 9..11; expected a range within 1..10",
            ),
            (
                Edit::Repeat {
                    frames: 3..=5,
                    times: 0,
                    join: 0,
                },
                "`times` is 0",
            ),
            (
                Edit::Repeat {
                    frames: 3..=5,
                    times: usize::MAX,
                    join: 0,
                },
                "more than",
            ),
            (
                Edit::Reverse {
                    frames: std::ops::RangeInclusive::new(5, 4),
                    join: 0,
                },
                "frames 6..5",
            ),
            (
                Edit::Loop {
                    after: 9,
                    through: vec![[0.0; 2]],
                    frames: None,
                    control: None,
                },
                "after frame 10; expected 1 to 9",
            ),
            (
                Edit::Loop {
                    after: 3,
                    through: vec![],
                    frames: None,
                    control: None,
                },
                "at least 1 point",
            ),
            (
                Edit::Loop {
                    after: 3,
                    through: vec![[9.0; 2]],
                    frames: Some(0),
                    control: None,
                },
                "`frames` is 0",
            ),
        ] {
            let found = problem(bad).to_string();
            assert!(found.contains(words) && found.contains("edit 2"), "{found}");
        }
    }

    fn any_edit() -> impl Strategy<Value = Edit> {
        let range = (0usize..14, 0usize..14).prop_map(|(a, b)| a.min(b)..=a.max(b));
        prop_oneof![
            (0usize..14, -1.0f64..1.0).prop_map(|(control, x)| Edit::Move {
                control,
                target: Target::By([x, 0.1])
            }),
            (
                0usize..12,
                prop::collection::vec((-2.0f64..2.0, -2.0f64..2.0), 1..4),
                1usize..9,
                1usize..9
            )
                .prop_map(|(after, p, frames, control)| {
                    let through = p.into_iter().map(|(x, y)| [x, y]).collect();
                    Edit::Loop {
                        after,
                        through,
                        frames: Some(frames),
                        control: Some(control),
                    }
                }),
            (range.clone(), 0usize..3).prop_map(|(frames, join)| Edit::Delete { frames, join }),
            (range.clone(), 1usize..3, 0usize..3).prop_map(|(frames, times, join)| Edit::Repeat {
                frames,
                times,
                join
            }),
            (range.clone(), 0usize..3).prop_map(|(frames, join)| Edit::Reverse { frames, join }),
            range.prop_map(|frames| Edit::Refine { frames }),
        ]
    }

    proptest! {
        /// Any edits in any order: a signal comes out, and frames that are said to be kept are kept.
        #[test]
        fn any_edits_give_a_signal(edits in prop::collection::vec(any_edit(), 1..5), k in 4usize..18) {
            let r = fitted(16, k);
            if let Ok(edited) = edit(&r.time, &edits) {
                assert_kept(&r, &edited);
                let n = edited.time.frame_count();
                let finite = |i: usize| edited.time.evaluate(1.0 + i as f64 * 0.5).iter().all(|x| x.is_finite());
                prop_assert!((0..2 * n).all(finite));
                let positions = edited.positions(&vec![[0.0; 2]; 16]);
                prop_assert_eq!(positions.len(), n);
            }
        }
    }
}
