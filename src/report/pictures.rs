//! Pictures with their captions.

use super::format::number;
use super::markup::{escape, name};
use super::plots::{Picture, constants, frame_errors, singular_values, time_signal};
use crate::harness::record::FitFigures;

/// The pictures of every fit.
pub(super) fn fits(figures: &[FitFigures]) -> String {
    if figures.is_empty() {
        return "<p>This run kept no fit to draw.</p>\n".into();
    }
    figures.iter().map(fit).collect()
}

fn fit(figures: &FitFigures) -> String {
    let [h, g, f, psi] = figures.errors.map(number);
    let pictures: String = [
        time_signal::picture(figures),
        frame_errors::picture(figures),
        constants::picture(figures),
        singular_values::picture(figures),
    ]
    .iter()
    .map(figure)
    .collect();
    format!(
        "<div class=\"stage\">\n<h3>{}</h3>\n<p>{}: n = {} frames of d = {} numbers; k = {} control points, l = {} sites, m = {} dimensions. \
         Sums of squares: (3) {h}, (4) {g}, (7) {f}, (2) {psi}.</p>\n<div class=\"gallery\">\n{pictures}</div></div>\n",
        name(&figures.case),
        escape(&figures.dataset),
        figures.frames,
        figures.d,
        figures.k,
        figures.l,
        figures.m,
    )
}

/// A picture with one line that says what to look for; where it could not be drawn, why.
pub(super) fn figure(picture: &Picture) -> String {
    let notes: String = picture
        .notes
        .iter()
        .map(|n| format!(" <span class=\"note\">{}</span>", escape(n)))
        .collect();
    let drawn = match &picture.svg {
        Ok(svg) => format!("<div class=\"picture\">{svg}</div>"),
        Err(reason) => format!(
            "<p class=\"undrawn\">Not drawn: {}.</p>",
            escape(&reason.to_string())
        ),
    };
    format!(
        "<figure>\n{drawn}\n<figcaption><b>{}.</b> {}{notes}</figcaption>\n</figure>\n",
        escape(&picture.title),
        escape(&picture.look)
    )
}
