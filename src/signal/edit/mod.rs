//! Edits of the time signal (section 4.1): they change the curve near where they are made, and leave pose and shape signals alone.

mod loops;
mod spans;
#[cfg(test)]
mod tests;

use std::ops::RangeInclusive;

use thiserror::Error;

use super::Point;
use super::basis::Basis;
use super::f::Spline;
use super::insert::InsertError;
use super::psi::TimeSignal;
use super::sketch::SketchError;
use super::strand::Strand;
use crate::linalg::kernels::max_abs;

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
    /// A loop shorter than parameters can tell apart.
    #[error(
        "the loop is {length:.3e} long, too short for {control} control points beside a motion of this extent; take points farther away, or fewer control points"
    )]
    TooShort { length: f64, control: usize },
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
/// grid of [`super::parameters::Grid`] changes no bit. Fits, designs and what edits make of them are on it; a signal from elsewhere may not be, and
/// then keeps what [`Edited::kept`] says. O(n + k) an edit, and O(r k) more for r knots that it inserts.
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
        if i == 0 {
            check_curve(&strand.spline).map_err(edit_error)?;
        }
        strand = make(strand, edit).map_err(edit_error)?;
        check_curve(&strand.spline).map_err(edit_error)?;
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
        } => loops::looped(strand, *after, through, *frames, *control),
        Edit::Delete { frames, join } => spans::deleted(strand, frames, *join),
        Edit::Repeat {
            frames,
            times,
            join,
        } => spans::repeated(strand, frames, *times, *join),
        Edit::Reverse { frames, join } => spans::reversed(strand, frames, *join),
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

/// An error where the spline is none, or goes nowhere that could be told.
fn check_curve(spline: &Spline) -> Result<(), EditProblem> {
    spline.check().map_err(InsertError::from)?;
    let bad = |p: &&Point| !p.iter().all(|x| x.is_finite());
    match spline.control.iter().find(bad) {
        Some(&point) => Err(EditProblem::NotFinite(point)),
        None => Ok(()),
    }
}

/// The greatest coordinate of the control points; 1 where all are 0.
fn extent(strand: &Strand) -> f64 {
    match max_abs(strand.spline.control.as_flattened()) {
        0.0 => 1.0,
        extent => extent,
    }
}

fn check_place(point: Point, extent: f64) -> Result<(), EditProblem> {
    let most = max_abs(&point);
    if !point.iter().all(|x| x.is_finite()) {
        return Err(EditProblem::NotFinite(point));
    }
    match most > FAR * extent {
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
