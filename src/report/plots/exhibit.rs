//! Charts of exhibits: a few named lines over a plane.

use plotters::style::RGBColor;

use super::axis::{Axis, power_label};
use super::canvas::{Canvas, Frame, Mark, Place, chart as draw_chart};
use super::{
    BLUE, GREEN, GREY, INK, PURPLE, Picture, PlotError, VERMILION, drawable, drawable_positive,
    note_left_out,
};
use crate::exhibits::{Chart, Line, Style};

const COLOURS: [RGBColor; 6] = [VERMILION, BLUE, GREEN, PURPLE, GREY, INK];
const SIZE: (i32, i32) = (520, 380);
/// What the sides, and what legend and axis, take from the picture.
const TAKEN: (i32, i32) = (94, 124);
const HEIGHTS: (f64, f64) = (160.0, 520.0);

/// A chart; what cannot be drawn is left out, and a note says so.
pub(in crate::report) fn picture(chart: &Chart) -> Picture {
    let all: usize = chart.lines.iter().map(|l| l.points.len()).sum();
    let kept: usize = chart.lines.iter().map(|l| usable(chart, l).count()).sum();
    Picture {
        title: chart.title.clone(),
        look: String::new(),
        svg: draw(chart),
        notes: note_left_out(all - kept, all, "points")
            .into_iter()
            .collect(),
    }
}

fn usable<'a>(chart: &'a Chart, line: &'a Line) -> impl Iterator<Item = [f64; 2]> + 'a {
    let fits = |&[x, y]: &[f64; 2]| {
        drawable(x)
            && if chart.logarithmic {
                drawable_positive(y)
            } else {
                drawable(y)
            }
    };
    line.points.iter().copied().filter(fits)
}

fn draw(chart: &Chart) -> Result<String, PlotError> {
    let along = |a: usize| {
        chart
            .lines
            .iter()
            .flat_map(move |l| usable(chart, l).map(move |p| p[a]))
    };
    if along(0).next().is_none() {
        return Err(PlotError::NothingToDraw("no points of this chart"));
    }
    let x = Axis::padded(along(0), 0.03, 8);
    let y = match chart.logarithmic {
        true => Axis::logarithmic(along(1), 7, power_label),
        false => Axis::padded(along(1), 0.05, 7),
    };
    let (x, y, height) = match chart.equal && !chart.logarithmic {
        true => {
            let across = f64::from(SIZE.0 - TAKEN.0);
            let (x, y, up) = Axis::equal(&x, &y, across, HEIGHTS);
            (x, y, up.round() as i32 + TAKEN.1)
        }
        false => (x, y, SIZE.1),
    };
    let named = chart
        .lines
        .iter()
        .enumerate()
        .filter(|(_, l)| !l.name.is_empty());
    let named: Vec<_> = named
        .map(|(i, line)| (i, line.style, printable(&line.name)))
        .collect();
    let legend: Vec<_> = named
        .iter()
        .map(|(i, style, name)| (mark(*style), colour(*i), name.as_str()))
        .collect();
    let [x_title, y_title] = [&chart.x_title, &chart.y_title].map(|t| printable(t));
    let frame = Frame {
        size: (SIZE.0, height),
        label: &chart.title,
        x,
        y,
        x_title: &x_title,
        y_title: &y_title,
        sides: (80, 0),
        legend: &legend,
    };
    draw_chart(&frame, |canvas| {
        let mut lines = chart.lines.iter().enumerate();
        lines.try_for_each(|(i, line)| {
            let places = usable(chart, line).map(|p| canvas.at(p)).collect();
            draw_line(canvas, line.style, places, colour(i))
        })
    })
}

/// Text without what an SVG may not hold; plotters escapes the rest.
fn printable(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect()
}

fn colour(i: usize) -> RGBColor {
    COLOURS[i % COLOURS.len()]
}

fn mark(style: Style) -> Mark {
    match style {
        Style::Line => Mark::Line,
        Style::Dashes => Mark::Dashes,
        Style::Dots => Mark::Dot,
        Style::Squares => Mark::Square,
    }
}

fn draw_line(
    canvas: &Canvas,
    style: Style,
    places: Vec<Place>,
    colour: RGBColor,
) -> Result<(), PlotError> {
    match style {
        Style::Line if places.len() > 1 => canvas.line(places, colour, 2.0),
        Style::Dashes if places.len() > 1 => canvas.dashes(places, colour),
        Style::Squares => places
            .into_iter()
            .try_for_each(|p| canvas.mark(Mark::Square, p, 4.0, colour)),
        _ => places
            .into_iter()
            .try_for_each(|p| canvas.mark(Mark::Dot, p, 3.0, colour)),
    }
}
