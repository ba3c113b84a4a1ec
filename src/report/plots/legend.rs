//! What the marks of a picture mean, in rows above it.

use plotters::style::RGBColor;
use plotters::style::text_anchor::HPos;

use super::canvas::{Canvas, FINE, LETTERS, Mark, text_width};
use super::{INK, PlotError};

/// A mark, its colour and what it means.
pub(super) type Entry<'a> = (Mark, RGBColor, &'a str);

const ROW: i32 = 20;
/// Pixels before an entry's words.
const INDENT: i32 = 26;
/// Pixels between entries.
const GAP: i32 = 16;

/// Draws the entries in as many rows as they need and answers their height in pixels.
pub(super) fn draw(canvas: &Canvas, entries: &[Entry], width: i32) -> Result<i32, PlotError> {
    let places = places(entries, width);
    for ((mark, colour, words), &(x, y)) in entries.iter().zip(&places) {
        canvas.mark(*mark, ((x + 10) * FINE, y * FINE), 4.5, *colour)?;
        let at = ((x + INDENT) * FINE, y * FINE);
        canvas.text(words, at, HPos::Left, LETTERS - 1, INK)?;
    }
    Ok(places.last().map_or(0, |&(_, y)| y + ROW / 2))
}

/// Left ends and middles of the entries, in pixels.
fn places(entries: &[Entry], width: i32) -> Vec<(i32, i32)> {
    let (mut x, mut y) = (GAP / 2, ROW * 3 / 4);
    let mut places = Vec::with_capacity(entries.len());
    for (_, _, words) in entries {
        let needed = INDENT + text_width(words, LETTERS - 1);
        if x + needed > width && x > GAP {
            (x, y) = (GAP / 2, y + ROW);
        }
        places.push((x, y));
        x += needed + GAP;
    }
    places
}
