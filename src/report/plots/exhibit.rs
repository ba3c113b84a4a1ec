//! Charts of exhibits: a few named lines over a plane.

use plotters::style::RGBColor;

use super::axis::{Axis, power_label};
use super::canvas::{Canvas, Frame, Mark, Place, chart as draw_chart};
use super::{
    BLUE, GREEN, GREY, INK, PURPLE, Picture, PlotError, VERMILION, drawable, drawable_positive,
    note_left_out,
};
use crate::exhibits::{Chart, Ground, Line, Style};

const COLOURS: [RGBColor; 6] = [VERMILION, BLUE, GREEN, PURPLE, GREY, INK];
/// Of the kinds of a ground's cells: two of amber and one of green, pale enough for lines upon them.
const GROUNDS: [RGBColor; 3] = [
    RGBColor(255, 234, 184),
    RGBColor(245, 190, 90),
    RGBColor(196, 230, 214),
];
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
    let ground = chart.ground.as_ref().filter(|g| is_sound(g));
    let ends = |a: usize| ground.map(|g| (g.corners[0][a], g.corners[1][a]));
    let x = match ends(0) {
        Some(ends) => Axis::between(ends, 8),
        None => Axis::padded(along(0), 0.03, 8),
    };
    let y = match ends(1) {
        _ if chart.logarithmic => Axis::logarithmic(along(1), 7, power_label),
        Some(ends) => Axis::between(ends, 7),
        None => Axis::padded(along(1), 0.05, 7),
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
    let kinds: Vec<_> = ground.map_or(&[][..], |g| &g.kinds).iter().collect();
    let kinds: Vec<_> = kinds.into_iter().map(|kind| printable(kind)).collect();
    let of_ground = kinds.iter().zip(GROUNDS);
    let of_ground = of_ground.map(|(kind, colour)| (Mark::Square, colour, kind.as_str()));
    let legend: Vec<_> = named
        .iter()
        .map(|(i, style, name)| (mark(*style), colour(*i), name.as_str()))
        .chain(of_ground)
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
        if let Some(ground) = ground {
            draw_ground(canvas, ground)?;
        }
        // Marks stand on lines.
        let (lines, marks): (Vec<_>, Vec<_>) = chart
            .lines
            .iter()
            .enumerate()
            .partition(|(_, line)| matches!(line.style, Style::Line | Style::Dashes));
        lines.into_iter().chain(marks).try_for_each(|(i, line)| {
            let points: Vec<_> = usable(chart, line).collect();
            let inside = |p: &[f64; 2]| ground.is_none_or(|g| is_inside(g, *p));
            let mut parts = points.chunk_by(|a, b| inside(a) == inside(b));
            parts.try_for_each(|part| match inside(&part[0]) {
                true => {
                    let places = part.iter().map(|&p| canvas.at(p)).collect();
                    draw_line(canvas, line.style, places, colour(i))
                }
                false => Ok(()),
            })
        })
    })
}

/// Whether a ground has an extent and whole rows.
fn is_sound(ground: &Ground) -> bool {
    let [low, high] = ground.corners;
    let cells = ground.cells.len();
    (0..2).all(|a| drawable(low[a]) && drawable(high[a]) && low[a] < high[a])
        && cells > 0
        && cells.checked_rem(ground.across) == Some(0)
}

fn is_inside(ground: &Ground, p: [f64; 2]) -> bool {
    let [low, high] = ground.corners;
    (0..2).all(|a| (low[a]..=high[a]).contains(&p[a]))
}

/// Cells of a kind that lie side by side as one bar.
fn draw_ground(canvas: &Canvas, ground: &Ground) -> Result<(), PlotError> {
    let [low, high] = ground.corners;
    let rows = ground.cells.len() / ground.across;
    let corner = |x: usize, y: usize| {
        let along =
            |a: usize, i: usize, of: usize| low[a] + (high[a] - low[a]) * i as f64 / of as f64;
        canvas.at([along(0, x, ground.across), along(1, y, rows)])
    };
    for (y, row) in ground
        .cells
        .as_bytes()
        .chunks_exact(ground.across)
        .enumerate()
    {
        let mut x = 0;
        for part in row.chunk_by(|a, b| a == b) {
            let kind = usize::from(part[0].wrapping_sub(b'0'));
            if let Some(&colour) = kind.checked_sub(1).and_then(|kind| GROUNDS.get(kind)) {
                canvas.bar(corner(x, y), corner(x + part.len(), y + 1), colour)?;
            }
            x += part.len();
        }
    }
    Ok(())
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
