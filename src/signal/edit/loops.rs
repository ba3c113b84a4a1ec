//! A loop inserted into the curve (section 4.1 and Figure 5): more frames and more control points.

use super::super::basis::Basis;
use super::super::f::Spline;
use super::super::sketch::Sketch;
use super::super::strand::{Bead, Piece, Seam, Strand, join};
use super::super::{Point, distance};
use super::{EditProblem, check_place, extent, room};

pub(super) fn looped(
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
    if !rises(&draft.spline.knots[first..first + control + 2]) {
        let length = path.length();
        return Err(EditProblem::TooShort { length, control });
    }
    Ok(with(&through_targets(&draft.spline, first, &targets))?)
}

/// Whether each knot is above the one before.
fn rises(knots: &[f64]) -> bool {
    knots.windows(2).all(|w| w[0] < w[1])
}

/// How many frames run this way at the mean pace of the curve.
fn at_mean_pace(strand: &Strand, length: f64) -> usize {
    let steps = (1..strand.len()).map(|i| distance(strand.at(i - 1), strand.at(i)));
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
