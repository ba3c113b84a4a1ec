//! How much each dimension of the shape subspace carries.

use plotters::style::text_anchor::HPos;

use super::axis::{Axis, power_label};
use super::canvas::{Frame, LETTERS, Mark, chart};
use super::{
    BLUE, GREY, Picture, PlotError, VERMILION, drawable, drawable_positive, note_left_out,
    note_on_edge,
};
use crate::harness::record::FitFigures;

/// The singular values of the centred frames, with the m that were kept.
pub(in crate::report) fn picture(figures: &FitFigures) -> Picture {
    let values = &figures.singular_values;
    let kept: Vec<(usize, f64)> = values
        .iter()
        .copied()
        .enumerate()
        .filter(|(_, s)| drawable(*s))
        .collect();
    let left_out = note_left_out(values.len() - kept.len(), values.len(), "singular values");
    let (svg, on_edge) = draw(figures, &kept);
    let on_edge = note_on_edge(on_edge, "singular values");
    Picture {
        title: "Singular values of the centred frames".into(),
        look: format!(
            "Look for where they drop: what lies right of the dashed line is what m = {} dimensions leave out, which is the error (3).",
            figures.m
        ),
        svg,
        notes: left_out.into_iter().chain(on_edge).collect(),
    }
}

fn draw(figures: &FitFigures, kept: &[(usize, f64)]) -> (Result<String, PlotError>, usize) {
    if !kept.iter().any(|k| drawable_positive(k.1)) {
        let none = Err(PlotError::NothingToDraw("no singular value above zero"));
        return (none, 0);
    }
    let y = Axis::logarithmic(kept.iter().map(|k| k.1), 7, power_label);
    let on_edge = kept.iter().filter(|k| y.edge(k.1).is_some()).count();
    let label = format!(
        "Singular values of {}, falling over {} dimensions, of which {} are kept",
        figures.case,
        figures.singular_values.len(),
        figures.m
    );
    let frame = Frame {
        size: (480, 350),
        label: &label,
        x: Axis::counts(1, figures.singular_values.len(), 8),
        y: y.clone(),
        x_title: "dimension",
        y_title: "singular value, units of the mesh",
        sides: (72, 0),
        legend: &[(Mark::Dot, BLUE, "kept"), (Mark::Ring, GREY, "left out")],
    };
    let radius = if kept.len() > 80 { 2.0 } else { 3.6 };
    let svg = chart(&frame, |canvas| {
        let [left, right, top, bottom] = canvas.plane();
        let cut = canvas.at([figures.m as f64 + 0.5, y.low()]).0;
        canvas.dashes(vec![(cut, top), (cut, bottom)], VERMILION)?;
        for &(i, s) in kept {
            let at = canvas.at([(i + 1) as f64, s]);
            match (y.edge(s), i < figures.m) {
                (Some(edge), _) => canvas.mark(Mark::OnEdge(edge), at, radius, GREY)?,
                (_, true) => canvas.mark(Mark::Dot, at, radius, BLUE)?,
                (_, false) => canvas.mark(Mark::Ring, at, radius, GREY)?,
            }
        }
        let (shift, anchor) = match (cut - left) * 2 > right - left {
            true => (-60, HPos::Right),
            false => (60, HPos::Left),
        };
        let text = format!("m = {}", figures.m);
        canvas.text(&text, (cut + shift, top + 120), anchor, LETTERS, VERMILION)
    });
    (svg, on_edge)
}
