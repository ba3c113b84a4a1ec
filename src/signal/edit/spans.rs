//! Spans of frames that are deleted, repeated or run backwards (section 4.1).

use std::ops::RangeInclusive;

use super::super::strand::{Piece, Seam, Strand, join};
use super::{EditProblem, room, within};

/// A span of frames with fewer control points of its own has no curve that could be taken along; it gets knots at its frames first.
const FEWEST_BEADS: usize = 4;

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

pub(super) fn deleted(
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

pub(super) fn repeated(
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

pub(super) fn reversed(
    strand: Strand,
    frames: &RangeInclusive<usize>,
    bridge: usize,
) -> Result<Strand, EditProblem> {
    let (first, last) = within(&strand, frames)?;
    if first == last && bridge == 0 {
        return Ok(strand); // one frame backwards is that frame
    }
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
