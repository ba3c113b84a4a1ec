//! Pictures, drawn with plotters into SVG text.
//!
//! Every picture stands on a white ground of its own, so that it reads the same in a dark page, and tells by shape and by word what it tells by
//! colour. What cannot be drawn - no data, NaN, a zero on a logarithmic axis - is left out or set on the edge, and a note says so.

mod axis;
mod canvas;
pub(super) mod constants;
pub(super) mod exhibit;
pub(super) mod frame_errors;
mod legend;
pub(super) mod singular_values;
pub(super) mod time_signal;
pub(super) mod timing;

use plotters::style::RGBColor;
use thiserror::Error;

/// Why there is no picture.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PlotError {
    /// No number that could be drawn.
    #[error("there are {0}")]
    NothingToDraw(&'static str),
    /// The drawing library gave up.
    #[error("the drawing library failed: {0}")]
    Backend(String),
}

/// A picture and what to look for in it; the texts are not escaped, the SVG is.
pub(super) struct Picture {
    pub title: String,
    /// One line that says what to look for.
    pub look: String,
    /// A whole `<svg>` element.
    pub svg: Result<String, PlotError>,
    /// What was left out or moved, and why.
    pub notes: Vec<String>,
}

/// Vermilion, blue, green, purple and greys that stay apart for the colour-blind (after Okabe and Ito) and on paper.
pub(super) const VERMILION: RGBColor = RGBColor(200, 80, 0);
/// For what should stay behind.
pub(super) const PALE_VERMILION: RGBColor = RGBColor(226, 160, 118);
pub(super) const BLUE: RGBColor = RGBColor(0, 98, 168);
pub(super) const GREEN: RGBColor = RGBColor(0, 128, 92);
pub(super) const PURPLE: RGBColor = RGBColor(138, 60, 120);
pub(super) const INK: RGBColor = RGBColor(32, 36, 42);
pub(super) const GREY: RGBColor = RGBColor(110, 118, 126);
pub(super) const PALE: RGBColor = RGBColor(226, 229, 232);

/// Whether a number can be drawn: finite, and far enough from overflow that differences and padding stay finite.
pub(super) fn drawable(x: f64) -> bool {
    x.is_finite() && x.abs() < 1e150
}

/// Whether a number has a place of its own on a logarithmic axis: drawable, and not zero or next to it.
pub(super) fn drawable_positive(x: f64) -> bool {
    drawable(x) && x > 1e-150
}

/// A note on numbers that could not be drawn; none when there were none.
pub(super) fn note_left_out(left_out: usize, of: usize, what: &str) -> Option<String> {
    (left_out > 0).then(|| {
        format!(
            "{left_out} of {of} {what} are not finite numbers that can be drawn, and are left out."
        )
    })
}

/// A note on numbers that a logarithmic axis has no place for; none when there were none.
pub(super) fn note_on_edge(on_edge: usize, what: &str) -> Option<String> {
    (on_edge > 0).then(|| {
        format!("Beyond the axis, drawn on its edge as open triangles: {on_edge} of the {what} (zero, negative, or too small or great).")
    })
}
