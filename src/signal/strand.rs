//! A time signal as a strand of knots and control points that can be cut and joined (section 4.1).
//!
//! Each control point of a cubic B-spline goes with the middle knot of its basis function. A cut between two frames parts these pairs in two, and
//! joining pieces is joining their lists: the curve is then as smooth across the seam as it is anywhere, it blends within three knots of the seam,
//! and beyond that it is the curve of the pieces. Pieces move along the parameter by sums that are exact on the grid of
//! [`super::parameters::Grid`], on which new beads and frames are put too, so that frames away from a seam keep their bits, also in edits to come.

use std::ops::Range;

use super::Point;
use super::basis::Basis;
use super::f::Spline;
use super::insert::{InsertError, insert_knots, multiplicity};
use super::parameters::Grid;

/// Knots beyond a cut on which the curve up to the cut depends.
const MARGIN: usize = 3;

/// A control point and the middle knot of its basis function.
pub(super) type Bead = (f64, Point);

/// A frame's parameter, and which frame of the original it is.
pub(super) type FrameMark = (f64, Option<usize>);

/// A spline and the frames on it.
#[derive(Clone, Debug)]
pub(super) struct Strand {
    pub spline: Spline,
    /// Never empty; parameters do not decrease.
    pub frames: Vec<FrameMark>,
}

/// What lies between two cuts.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Parameters of the cuts.
    from: f64,
    to: f64,
    beads: Vec<Bead>,
    frames: Vec<FrameMark>,
    /// The poses of the first and the last frame.
    poses: [Point; 2],
    /// What the curve depends on at the cut before, and at the cut behind.
    margins: [Margin; 2],
}

/// Beyond a cut.
#[derive(Clone, Debug, Default)]
struct Margin {
    /// In ascending order.
    beads: Vec<Bead>,
    /// The knot beyond the last of them.
    outer: f64,
    /// Whether the strand goes on, so that this is a cut and no end.
    open: bool,
}

/// How two pieces meet.
#[derive(Clone, Copy, Debug)]
pub(super) enum Seam {
    /// At their cuts.
    Flush,
    /// With a step from the last pose to the first, and frames on the way.
    Across { frames: usize },
}

impl Strand {
    /// f~ at a frame.
    pub fn at(&self, frame: usize) -> Point {
        self.spline.evaluate(self.frames[frame].0)
    }

    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// The mean step of the parameter from frame to frame; 1 where nothing moves.
    pub fn mean_step(&self) -> f64 {
        let n = self.len();
        let step = (self.frames[n - 1].0 - self.frames[0].0) / (n - 1).max(1) as f64;
        if step > 0.0 { step } else { 1.0 }
    }

    /// Where a cut before frame `i` (0 to n) goes: its parameter, and how many beads come before it.
    pub fn cut(&self, i: usize) -> (f64, usize) {
        let basis = Basis {
            knots: &self.spline.knots,
        };
        let (low, high) = basis.domain();
        if i == 0 {
            return (low.min(self.frames[0].0), 0);
        }
        if i == self.len() {
            return (high.max(self.frames[i - 1].0), basis.count());
        }
        let u = 0.5 * (self.frames[i - 1].0 + self.frames[i].0);
        (u, basis.span(u) - 1)
    }

    /// Frames `first` to `last`, both in, from the cut before to the cut behind.
    pub fn piece(&self, first: usize, last: usize) -> Piece {
        let ((from, a), (to, b)) = (self.cut(first), self.cut(last + 1));
        let (u, control) = (&self.spline.knots, &self.spline.control);
        let beads = |range: Range<usize>| range.map(|j| (u[j + 1], control[j])).collect();
        let (left, right) = (a.saturating_sub(MARGIN), control.len().min(b + MARGIN));
        let before = Margin {
            beads: beads(left..a),
            outer: u[left],
            open: first > 0,
        };
        let behind = Margin {
            beads: beads(b..right),
            outer: u[right + 1],
            open: last + 1 < self.len(),
        };
        Piece {
            from,
            to,
            beads: beads(a..b),
            frames: self.frames[first..=last].to_vec(),
            poses: [self.at(first), self.at(last)],
            margins: [before, behind],
        }
    }

    /// The strand with new knots at the parameters of these frames (both ends in) where there is none; the curve stays.
    pub fn refined(&self, first: usize, last: usize) -> Result<Self, InsertError> {
        let spline = &self.spline;
        let (low, high) = Basis {
            knots: &spline.knots,
        }
        .domain();
        let mut new: Vec<f64> = self.frames[first..=last].iter().map(|f| f.0).collect();
        new.retain(|&t| low < t && t < high && multiplicity(spline, t) == 0);
        new.dedup();
        Ok(Self {
            spline: insert_knots(spline, &new)?,
            frames: self.frames.clone(),
        })
    }

    /// The strand from its first to its last frame, where `start` or `end` say that it goes on beyond; the curve between stays.
    fn trimmed(mut self, start: bool, end: bool) -> Result<Self, InsertError> {
        let (x, y) = (self.frames[0].0, self.frames[self.len() - 1].0);
        if x >= y {
            return Ok(self);
        }
        if start && self.clamp(x)? {
            // With a triple knot at x, the middle of which is the middle of a basis function, the curve is at that control point.
            let at = self.spline.knots.partition_point(|&u| u < x);
            self.spline.knots.drain(..at);
            self.spline.control.drain(..at);
        }
        if end && self.clamp(y)? {
            let at = self.spline.knots.partition_point(|&u| u <= y);
            self.spline.knots.truncate(at);
            self.spline.control.truncate(at - 2);
        }
        Ok(self)
    }

    /// Makes a knot triple; false where that is no place inside the domain.
    fn clamp(&mut self, u: f64) -> Result<bool, InsertError> {
        let (low, high) = Basis {
            knots: &self.spline.knots,
        }
        .domain();
        if !(low < u && u < high) {
            return Ok(false);
        }
        let missing = 3usize.saturating_sub(multiplicity(&self.spline, u));
        self.spline = insert_knots(&self.spline, &vec![u; missing])?;
        Ok(true)
    }
}

impl Piece {
    /// New frames on new beads, evenly spread over this length of parameter; `poses` are those of the first and last frame.
    pub fn new(length: f64, beads: Vec<Bead>, frames: usize, poses: [Point; 2]) -> Self {
        let place = |j: usize| length * (j as f64 + 0.5) / frames as f64;
        Self {
            from: 0.0,
            to: length,
            beads,
            frames: (0..frames).map(|j| (place(j), None)).collect(),
            poses,
            margins: [Margin::default(), Margin::default()],
        }
    }

    /// How many control points go with it.
    pub fn bead_count(&self) -> usize {
        self.beads.len()
    }

    /// The same, run through backwards.
    pub fn reversed(mut self) -> Self {
        let sum = self.from + self.to;
        let [before, behind] = &mut self.margins;
        for beads in [&mut self.beads, &mut before.beads, &mut behind.beads] {
            beads.reverse();
            beads.iter_mut().for_each(|bead| bead.0 = sum - bead.0);
        }
        self.frames.reverse();
        self.frames
            .iter_mut()
            .for_each(|mark| mark.0 = sum - mark.0);
        for margin in &mut self.margins {
            margin.outer = sum - margin.outer;
        }
        self.margins.reverse();
        self.poses.reverse();
        self
    }

    /// With every parameter x at `to(x)`, which must not decrease.
    fn placed(mut self, to: impl Fn(f64) -> f64) -> Self {
        let [before, behind] = &mut self.margins;
        for beads in [&mut self.beads, &mut before.beads, &mut behind.beads] {
            beads.iter_mut().for_each(|bead| bead.0 = to(bead.0));
        }
        self.frames.iter_mut().for_each(|mark| mark.0 = to(mark.0));
        for margin in &mut self.margins {
            margin.outer = to(margin.outer);
        }
        (self.from, self.to) = (to(self.from), to(self.to));
        self
    }

    /// Takes the next piece at its end.
    fn extend(&mut self, next: Piece, seam: Seam, shifts: &Shifts) {
        let left = self.frames.last().map_or(self.to, |mark| mark.0);
        let right = next.frames.first().map_or(next.from, |mark| mark.0);
        let brought = (self.to - left) + (right - next.from);
        let wanted = match seam {
            Seam::Flush => brought,
            Seam::Across { frames } => {
                let way = super::distance(self.poses[1], next.poses[0]);
                (way * (frames + 1) as f64).sqrt().max(brought)
            }
        };
        let gap = if wanted > 0.0 { wanted } else { shifts.mean };
        let shift = shifts.up(self.to + (gap - brought) - next.from);
        let next = next.placed(|x| shifts.round(x + shift));
        if let Seam::Across { frames } = seam {
            let right = next.frames.first().map_or(next.from, |mark| mark.0);
            let step = (right - left) / (frames + 1) as f64;
            let between = (1..=frames).map(|j| (shifts.round(left + j as f64 * step), None));
            self.frames.extend(between);
        }
        self.frames.extend(next.frames);
        self.beads.extend(next.beads);
        self.to = next.to;
        self.poses[1] = next.poses[1];
        let [_, behind] = next.margins;
        self.margins[1] = behind;
    }

    /// The strand that this piece is on its own.
    fn strand(self) -> Result<Strand, InsertError> {
        let [before, behind] = self.margins;
        let (start, end) = (before.open, behind.open);
        let beads = [before.beads, self.beads, behind.beads].concat();
        let mut knots = vec![before.outer];
        knots.extend(beads.iter().map(|bead| bead.0));
        knots.push(behind.outer);
        let control = beads.into_iter().map(|bead| bead.1).collect();
        let spline = Spline { control, knots };
        let frames = self.frames;
        Strand { spline, frames }.trimmed(start, end)
    }
}

/// How far pieces are moved.
struct Shifts {
    /// Where the centripetal rule gives nothing.
    mean: f64,
    /// Sums of multiples of this are exact.
    quantum: f64,
}

impl Shifts {
    fn new(strand: &Strand) -> Self {
        let parameters = strand.frames.iter().map(|mark| mark.0);
        let all = strand.spline.knots.iter().copied().chain(parameters);
        let greatest = all.clone().fold(0.0, |most: f64, x| most.max(x.abs()));
        // New parameters have room between the old ones, whatever bits these happen to need.
        let finest = Grid::new(greatest).quantum();
        Self {
            mean: strand.mean_step(),
            quantum: all.map(lowest_bit).fold(finest, f64::min),
        }
    }

    /// The multiple of the quantum at or above x; x itself where numbers have more bits than that.
    fn up(&self, x: f64) -> f64 {
        self.whole(x, f64::ceil)
    }

    /// The nearest multiple of the quantum, likewise.
    fn round(&self, x: f64) -> f64 {
        self.whole(x, f64::round)
    }

    fn whole(&self, x: f64, to_whole: fn(f64) -> f64) -> f64 {
        let units = x / self.quantum;
        if units.abs() < 2f64.powi(52) {
            to_whole(units) * self.quantum
        } else {
            x
        }
    }
}

/// The value of the lowest bit that is set; infinity for 0.
fn lowest_bit(x: f64) -> f64 {
    if x == 0.0 {
        return f64::INFINITY;
    }
    let mantissa = (x.to_bits() & (!0 >> 12)) | (1 << 52);
    let unit = f64::from_bits(x.to_bits() & (0x7ff << 52)) * f64::EPSILON;
    unit * (1u64 << mantissa.trailing_zeros()) as f64
}

/// Joins pieces of `whole`, and new ones, in this order; each but the first comes with the seam before it.
///
/// Across a seam the parameter grows by the centripetal rule for the step from pose to pose, or by what the pieces bring along if that is more. The
/// joined strand begins with its first frame and ends with its last.
pub(super) fn join(
    whole: &Strand,
    first: Piece,
    rest: Vec<(Seam, Piece)>,
) -> Result<Strand, InsertError> {
    let shifts = Shifts::new(whole);
    let mut joined = first;
    for (seam, piece) in rest {
        joined.extend(piece, seam, &shifts);
    }
    joined.strand()
}
