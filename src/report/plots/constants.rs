//! What a change of k, l or m does to the error (2).

use super::axis::{Axis, power_label};
use super::canvas::{Canvas, Frame, Mark, chart};
use super::{
    BLUE, GREEN, INK, Picture, PlotError, VERMILION, drawable, drawable_positive, note_left_out,
    note_on_edge,
};
use crate::harness::record::FitFigures;
use plotters::style::RGBColor;

/// Per cent of the diagonal from which on an error tells nothing but that the fit failed; the axis is not stretched for it.
const NONSENSE: f64 = 1e4;

/// One constant: its values with their errors, the range it can have and the value it had.
struct Series<'a> {
    points: &'a [(usize, f64)],
    range: (usize, usize),
    chosen: usize,
    mark: Mark,
    colour: RGBColor,
}

impl Series<'_> {
    /// How far into its range a value is, in per cent.
    fn share(&self, value: usize) -> f64 {
        let (low, high) = self.range;
        let span = high.saturating_sub(low).max(1) as f64;
        (100.0 * (value as f64 - low as f64) / span).clamp(0.0, 100.0)
    }

    fn drawable(&self) -> impl Iterator<Item = (usize, f64)> {
        let per_cent = self.points.iter().map(|&(c, e)| (c, e * 100.0));
        per_cent.filter(|p| drawable(p.1))
    }
}

fn series(f: &FitFigures) -> [Series<'_>; 3] {
    let one = |points, range, chosen, mark, colour| Series {
        points,
        range,
        chosen,
        mark,
        colour,
    };
    let n = f.frames;
    [
        one(
            &f.error_by_k,
            (4, n.saturating_add(2)),
            f.k,
            Mark::Dot,
            BLUE,
        ),
        one(&f.error_by_l, (3, n), f.l, Mark::Triangle, GREEN),
        one(
            &f.error_by_m,
            (0, n.saturating_sub(1)),
            f.m,
            Mark::Square,
            VERMILION,
        ),
    ]
}

/// The relative RMS error against each constant while the other two keep their values.
pub(in crate::report) fn picture(figures: &FitFigures) -> Picture {
    let series = series(figures);
    let all: usize = series.iter().map(|s| s.points.len()).sum();
    let kept: usize = series.iter().map(|s| s.drawable().count()).sum();
    let (svg, on_edge) = draw(figures, &series);
    Picture {
        title: "Error against k, l and m".into(),
        look: format!(
            "Look for the flat ends: a constant whose line is flat beyond its ring has more than it needs, and the error comes from the \
             other two. Each runs over its own range, 4 to n+2 for k, 3 to n for l, 0 to n−1 for m; rings mark k = {}, l = {}, m = {}.",
            figures.k, figures.l, figures.m
        ),
        svg,
        notes: note_left_out(all - kept, all, "errors")
            .into_iter()
            .chain(note_on_edge(on_edge, "errors"))
            .collect(),
    }
}

fn draw(figures: &FitFigures, series: &[Series; 3]) -> (Result<String, PlotError>, usize) {
    let errors = || series.iter().flat_map(|s| s.drawable().map(|p| p.1));
    if !errors().any(drawable_positive) {
        let none = PlotError::NothingToDraw("no error above zero against k, l or m");
        return (Err(none), 0);
    }
    let sensible = || errors().filter(|&e| e < NONSENSE);
    let y = match sensible().any(drawable_positive) {
        true => Axis::logarithmic(sensible(), 7, power_label),
        false => Axis::logarithmic(errors(), 7, power_label),
    };
    let on_edge = errors().filter(|&e| y.edge(e).is_some()).count();
    let label = format!(
        "Relative error of {} against the constants k, l and m, each over its own range",
        figures.case
    );
    let frame = Frame {
        size: (480, 350),
        label: &label,
        x: Axis::between((-3.0, 103.0), 6),
        y: y.clone(),
        x_title: "place in the constant's own range, %",
        y_title: "relative RMS error (2), %",
        sides: (72, 0),
        legend: &[
            (Mark::Dot, BLUE, "k, control points"),
            (Mark::Triangle, GREEN, "l, sites"),
            (Mark::Square, VERMILION, "m, dimensions"),
            (Mark::Ring, INK, "as used"),
        ],
    };
    let svg = chart(&frame, |canvas| {
        series.iter().try_for_each(|s| draw_series(canvas, s, &y))
    });
    (svg, on_edge)
}

fn draw_series(canvas: &Canvas, series: &Series, y: &Axis) -> Result<(), PlotError> {
    let mut points: Vec<(usize, f64)> = series.drawable().collect();
    points.sort_by_key(|p| p.0);
    let place = |&(c, e): &(usize, f64)| canvas.at([series.share(c), e]);
    if points.len() > 1 {
        canvas.line(points.iter().map(place).collect(), series.colour, 1.6)?;
    }
    let chosen = points.iter().filter(|p| p.0 == series.chosen);
    for point in chosen {
        canvas.mark(Mark::Ring, place(point), 8.0, INK)?;
    }
    let size = if points.len() > 40 { 2.4 } else { 3.8 };
    for point in &points {
        let mark = y.edge(point.1).map_or(series.mark, Mark::OnEdge);
        canvas.mark(mark, place(point), size, series.colour)?;
    }
    Ok(())
}
