//! How far the fit stays from each frame.

use super::axis::Axis;
use super::canvas::{Frame, LETTERS, Mark, chart};
use super::{BLUE, GREEN, Picture, PlotError, drawable, note_left_out};
use crate::harness::record::FitFigures;
use crate::report::format::number;
use plotters::style::text_anchor::HPos;

/// The distance of psi(i) from frame i, over the frames.
pub(in crate::report) fn picture(figures: &FitFigures) -> Picture {
    let errors = &figures.frame_errors;
    let kept: Vec<(usize, f64)> = errors
        .iter()
        .map(|e| e * 100.0)
        .enumerate()
        .filter(|(_, e)| drawable(*e))
        .collect();
    let left_out = errors.len() - kept.len();
    Picture {
        title: "Error in each frame".into(),
        look: "Look for frames that stand out: there the three signals together miss a pose. Frames that are \
               sites of the pose signal are squares."
            .into(),
        svg: draw(figures, &kept),
        notes: note_left_out(left_out, errors.len(), "errors")
            .into_iter()
            .collect(),
    }
}

fn draw(figures: &FitFigures, kept: &[(usize, f64)]) -> Result<String, PlotError> {
    if kept.is_empty() {
        return Err(PlotError::NothingToDraw("no errors of single frames"));
    }
    let (worst, high) =
        kept.iter()
            .fold((0, f64::NEG_INFINITY), |best, &(i, e)| match e > best.1 {
                true => (i, e),
                false => best,
            });
    let label = format!(
        "Error in each frame of {}: at most {}% of the diagonal, in frame {}",
        figures.case,
        number(high),
        worst + 1
    );
    let frame = Frame {
        size: (480, 350),
        label: &label,
        x: Axis::counts(1, figures.frame_errors.len(), 8),
        y: Axis::from_zero(kept.iter().map(|k| k.1 * 1.05), 6),
        x_title: "frame",
        y_title: "RMS distance / diagonal, %",
        sides: (72, 0),
        legend: &[
            (Mark::Dot, BLUE, "frame"),
            (Mark::Square, GREEN, "frame that is a site"),
        ],
    };
    let radius = if kept.len() > 80 { 2.2 } else { 3.8 };
    chart(&frame, |canvas| {
        let place = |&(i, e): &(usize, f64)| canvas.at([(i + 1) as f64, e]);
        canvas.line(kept.iter().map(place).collect(), BLUE, 1.2)?;
        for point in kept {
            match figures.sites.contains(&point.0) {
                true => canvas.mark(Mark::Square, place(point), radius + 0.6, GREEN)?,
                false => canvas.mark(Mark::Dot, place(point), radius, BLUE)?,
            }
        }
        let (x, y) = place(&(worst, high));
        let text = format!("frame {}: {}%", worst + 1, number(high));
        let [left, right, ..] = canvas.plane();
        let anchor = match (x - left) * 2 > right - left {
            true => HPos::Right,
            false => HPos::Left,
        };
        canvas.text(&text, (x, y - 140), anchor, LETTERS - 1, BLUE)
    })
}
