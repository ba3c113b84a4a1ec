//! A chart to draw on: plotters' axes and mesh around a plane, with the few marks that our pictures use.

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::{Axis, Edge};
use super::legend::{self, Entry};
use super::{GREY, INK, PALE, PlotError};
use crate::report::markup::escape;

/// plotters draws on whole pixels. Pictures are drawn this much larger and shown at their own size, so that curves are smooth.
pub(super) const FINE: i32 = 10;
/// Height of letters in pixels: large enough for a picture of 500 pixels to be read on a phone of 390.
pub(super) const LETTERS: i32 = 14;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<Axis, Axis>>;
/// A place in the fine pixels of the picture.
pub(super) type Place = (i32, i32);

/// The shape of a mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mark {
    Dot,
    Ring,
    Square,
    Diamond,
    Triangle,
    /// An open triangle that points out of the plane: for what stands on the edge of an axis.
    OnEdge(Edge),
    Line,
    Dashes,
}

/// What surrounds a picture.
pub(super) struct Frame<'a> {
    /// Width and height in pixels.
    pub size: (i32, i32),
    /// What a screen reader says; not escaped.
    pub label: &'a str,
    pub x: Axis,
    pub y: Axis,
    pub x_title: &'a str,
    /// Empty where the y axis has no ticks either.
    pub y_title: &'a str,
    /// Room for what stands to the left of the plane, and to its right, in pixels.
    pub sides: (i32, i32),
    pub legend: &'a [Entry<'a>],
}

/// The plane of a chart, in its own coordinates and in the picture's.
pub(super) struct Canvas<'a, 'b> {
    root: &'b Area<'a>,
    chart: Option<&'b Chart<'a>>,
}

fn failed<E: std::fmt::Display>(error: E) -> PlotError {
    PlotError::Backend(error.to_string())
}

/// Letters `height` pixels high.
fn letters(height: i32, colour: RGBColor) -> TextStyle<'static> {
    // plotters writes sizes 1.24 times smaller into the SVG than they are given.
    let size = f64::from(height * FINE) * 1.24;
    let mut style = TextStyle::from(("sans-serif", size).into_font());
    style.color = colour.to_backend_color();
    style
}

/// Draws a chart and, on it, what `draw` draws. The answer is one `<svg>` element, with its label as title.
pub(super) fn chart(
    frame: &Frame,
    draw: impl FnOnce(&Canvas) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    let (width, height) = (frame.size.0 * FINE, frame.size.1 * FINE);
    let mut svg = String::new();
    {
        let root =
            SVGBackend::with_string(&mut svg, (width as u32, height as u32)).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let top = legend::draw(
            &Canvas {
                root: &root,
                chart: None,
            },
            frame.legend,
            frame.size.0,
        )?;
        let chart = axes(&root, frame, top)?;
        draw(&Canvas {
            root: &root,
            chart: Some(&chart),
        })?;
        root.present().map_err(failed)?;
    }
    dress(&svg, frame)
}

/// The chart below `top` pixels of legend, with mesh, ticks and titles.
fn axes<'a>(root: &Area<'a>, frame: &Frame, top: i32) -> Result<Chart<'a>, PlotError> {
    let mut chart = ChartBuilder::on(root)
        .margin_top((top + 8) * FINE)
        .margin_left(8 * FINE)
        .margin_right(frame.sides.1.max(14) * FINE)
        .margin_bottom(8 * FINE)
        .x_label_area_size(48 * FINE)
        .y_label_area_size(frame.sides.0 * FINE)
        .build_cartesian_2d(frame.x.clone(), frame.y.clone())
        .map_err(failed)?;
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(frame.x_title)
        .y_desc(frame.y_title)
        .label_style(letters(LETTERS - 1, INK))
        .axis_desc_style(letters(LETTERS, INK))
        .axis_style(GREY.stroke_width(FINE as u32))
        .bold_line_style(PALE.stroke_width(FINE as u32))
        .light_line_style(TRANSPARENT)
        .max_light_lines(0)
        .set_all_tick_mark_size(4 * FINE);
    if frame.y_title.is_empty() {
        mesh.disable_y_mesh().disable_y_axis();
    }
    mesh.draw().map_err(failed)?;
    Ok(chart)
}

/// Gives the element its shown size and its label.
fn dress(svg: &str, frame: &Frame) -> Result<String, PlotError> {
    let (width, height) = frame.size;
    let (_, body) = svg
        .split_once('>')
        .ok_or_else(|| failed("an SVG without an element"))?;
    let label = escape(frame.label);
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {} {}\" role=\"img\" \
         aria-label=\"{label}\">\n<title>{label}</title>{body}",
        width * FINE,
        height * FINE
    ))
}

impl Canvas<'_, '_> {
    /// Where a point of the chart stands in the picture.
    pub(super) fn at(&self, point: [f64; 2]) -> Place {
        self.chart
            .map_or((0, 0), |c| c.backend_coord(&(point[0], point[1])))
    }

    /// Left, right, top and bottom of the plane.
    pub(super) fn plane(&self) -> [i32; 4] {
        let Some(chart) = self.chart else {
            return [0; 4];
        };
        let (xs, ys) = chart.plotting_area().get_pixel_range();
        [xs.start, xs.end, ys.start, ys.end]
    }

    /// A line through places, `width` pixels wide.
    pub(super) fn line(
        &self,
        places: Vec<Place>,
        colour: RGBColor,
        width: f64,
    ) -> Result<(), PlotError> {
        let style = colour.stroke_width((width * f64::from(FINE)) as u32);
        let line = PathElement::new(places, style);
        self.root.draw(&line).map_err(failed)
    }

    /// A dashed line through places.
    pub(super) fn dashes(&self, places: Vec<Place>, colour: RGBColor) -> Result<(), PlotError> {
        let style = colour.stroke_width(FINE as u32);
        let line = DashedPathElement::new(places, 5 * FINE as u32, 4 * FINE as u32, style);
        self.root.draw(&line).map_err(failed)
    }

    /// A filled rectangle between two places.
    pub(super) fn bar(&self, from: Place, to: Place, colour: RGBColor) -> Result<(), PlotError> {
        let bar = Rectangle::new([from, to], colour.filled());
        self.root.draw(&bar).map_err(failed)
    }

    /// A mark at a place, `size` pixels from its middle to its edge.
    pub(super) fn mark(
        &self,
        mark: Mark,
        at: Place,
        size: f64,
        colour: RGBColor,
    ) -> Result<(), PlotError> {
        let r = (size * f64::from(FINE)) as i32;
        match mark {
            Mark::Dot => self
                .root
                .draw(&Circle::new(at, r, colour.filled()))
                .map_err(failed),
            Mark::Ring => {
                let style = colour.stroke_width(3 * FINE as u32 / 2);
                self.root
                    .draw(&Circle::new(at, r, WHITE.filled()))
                    .map_err(failed)?;
                self.root.draw(&Circle::new(at, r, style)).map_err(failed)
            }
            Mark::OnEdge(_) => {
                let mut corners = corners(mark, at, r);
                self.root
                    .draw(&Polygon::new(corners.clone(), WHITE.filled()))
                    .map_err(failed)?;
                corners.push(corners[0]);
                self.line(corners, colour, 1.5)
            }
            Mark::Line => self.line(
                vec![(at.0 - 2 * r, at.1), (at.0 + 2 * r, at.1)],
                colour,
                2.5,
            ),
            Mark::Dashes => self.dashes(vec![(at.0 - 2 * r, at.1), (at.0 + 2 * r, at.1)], colour),
            Mark::Square | Mark::Diamond | Mark::Triangle => self
                .root
                .draw(&Polygon::new(corners(mark, at, r), colour.filled()))
                .map_err(failed),
        }
    }

    /// Text from, to or around a place, at half its height.
    pub(super) fn text(
        &self,
        text: &str,
        at: Place,
        anchor: HPos,
        height: i32,
        colour: RGBColor,
    ) -> Result<(), PlotError> {
        let style = letters(height, colour).pos(Pos::new(anchor, VPos::Center));
        self.root.draw_text(text, &style, at).map_err(failed)
    }
}

/// The corners of a mark that is a polygon.
fn corners(mark: Mark, (x, y): Place, r: i32) -> Vec<Place> {
    let w = r * 7 / 8;
    match mark {
        Mark::Square => vec![
            (x - w, y - w),
            (x + w, y - w),
            (x + w, y + w),
            (x - w, y + w),
        ],
        Mark::Triangle => vec![(x, y - r), (x + r, y + w), (x - r, y + w)],
        Mark::OnEdge(Edge::Low) => vec![(x, y), (x + w, y - r - w), (x - w, y - r - w)],
        Mark::OnEdge(Edge::High) => vec![(x, y), (x + w, y + r + w), (x - w, y + r + w)],
        _ => vec![(x, y - r), (x + r, y), (x, y + r), (x - r, y)],
    }
}

/// Roughly how many pixels wide a text is, in letters `height` pixels high.
pub(super) fn text_width(text: &str, height: i32) -> i32 {
    (text.chars().count() as f64 * f64::from(height) * 0.56).ceil() as i32
}
