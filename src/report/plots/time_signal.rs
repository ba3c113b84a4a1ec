//! The time signal over the pose plane, as the right half of the paper's Figure 1.

use std::collections::HashSet;

use plotters::style::text_anchor::HPos;

use super::axis::Axis;
use super::canvas::{Canvas, FINE, Frame, LETTERS, Mark, Place, chart, text_width};
use super::{BLUE, GREEN, GREY, INK, PALE_VERMILION, Picture, PlotError, drawable, note_left_out};
use crate::harness::record::FitFigures;

/// Pixels of the picture's width, and those that its sides take from it.
const WIDTH: i32 = 620;
const SIDES: i32 = 90;
/// Pixels that legend and axis take from the height.
const ENDS: i32 = 112;
/// The plane is never flatter nor higher than this.
const HEIGHTS: (f64, f64) = (200.0, 560.0);
/// Frames that are numbered, at most.
const NUMBERED: usize = 16;

/// The curve f with f(i) at the frames, the positions p_i, the sites and the control polygon.
pub(in crate::report) fn picture(figures: &FitFigures) -> Picture {
    let all = [
        &figures.curve,
        &figures.frame_points,
        &figures.positions,
        &figures.control,
    ];
    let total: usize = all.iter().map(|p| p.len()).sum();
    let kept: usize = all.iter().map(|p| finite(p).count()).sum();
    Picture {
        title: "Time signal over the pose plane".into(),
        look: "Look for the path of the motion: frames near each other here have similar shapes, a cycle closes on itself, and the distance \
               from a diamond to its dot is what the time signal smooths away. Small numbers count frames from 1."
            .into(),
        svg: draw(figures),
        notes: note_left_out(total - kept, total, "points")
            .into_iter()
            .collect(),
    }
}

fn finite(points: &[[f64; 2]]) -> impl Iterator<Item = [f64; 2]> {
    let kept = points.iter().copied();
    kept.filter(|p| drawable(p[0]) && drawable(p[1]))
}

fn draw(figures: &FitFigures) -> Result<String, PlotError> {
    if finite(&figures.frame_points).next().is_none() && finite(&figures.curve).next().is_none() {
        return Err(PlotError::NothingToDraw("no points of a time signal"));
    }
    let (x, y, height) = equal_axes(figures);
    let label = format!(
        "Time signal of {}: a curve over the pose plane through {} frames, with {} sites",
        figures.case,
        figures.frame_points.len(),
        figures.sites.len()
    );
    let frame = Frame {
        size: (WIDTH, height),
        label: &label,
        x,
        y,
        x_title: "first pose coordinate, units of the mesh",
        y_title: "second pose coordinate",
        sides: (SIDES - 14, 0),
        legend: &[
            (Mark::Line, BLUE, "time signal f"),
            (Mark::Dot, BLUE, "f(i), frame i"),
            (Mark::Diamond, GREY, "position p(i)"),
            (Mark::Square, GREEN, "position that is a site"),
            (Mark::Dashes, PALE_VERMILION, "control polygon"),
        ],
    };
    chart(&frame, |canvas| {
        polygon(canvas, &figures.control)?;
        curve(canvas, &figures.curve)?;
        positions(canvas, figures)?;
        frames(canvas, &figures.frame_points)
    })
}

/// Axes on which a unit is as long across as up, and the height of the picture that they need.
fn equal_axes(figures: &FitFigures) -> (Axis, Axis, i32) {
    let points = || {
        finite(&figures.curve)
            .chain(finite(&figures.frame_points))
            .chain(finite(&figures.positions))
            .chain(finite(&figures.control))
    };
    let x = Axis::padded(points().map(|p| p[0]), 0.05, 6);
    let y = Axis::padded(points().map(|p| p[1]), 0.05, 6);
    let (wide, high) = (x.high() - x.low(), y.high() - y.low());
    let across = f64::from(WIDTH - SIDES);
    let up = (across * high / wide).clamp(HEIGHTS.0, HEIGHTS.1);
    let unit = (wide / across).max(high / up);
    let widen = |axis: &Axis, length: f64| {
        let middle = (axis.low() + axis.high()) / 2.0;
        Axis::between((middle - length / 2.0, middle + length / 2.0), 7)
    };
    let axes = (widen(&x, unit * across), widen(&y, unit * up));
    (axes.0, axes.1, up.round() as i32 + ENDS)
}

fn polygon(canvas: &Canvas, control: &[[f64; 2]]) -> Result<(), PlotError> {
    let places: Vec<Place> = finite(control).map(|p| canvas.at(p)).collect();
    if places.len() > 1 {
        canvas.dashes(places, PALE_VERMILION)?;
    }
    Ok(())
}

/// The curve, without the points that would fall onto the ones before.
fn curve(canvas: &Canvas, points: &[[f64; 2]]) -> Result<(), PlotError> {
    let mut places: Vec<Place> = finite(points).map(|p| canvas.at(p)).collect();
    let last = places.last().copied();
    let mut before = None;
    places.retain(|&place| {
        let far = before.is_none_or(|b| reach(b, place) >= FINE * 3 / 4);
        if far {
            before = Some(place);
        }
        far
    });
    places.extend(last);
    match places.len() {
        0 | 1 => Ok(()),
        _ => canvas.line(places, BLUE, 2.0),
    }
}

/// How far apart two places are, the longer of across and down.
fn reach(a: Place, b: Place) -> i32 {
    (a.0 - b.0).abs().max((a.1 - b.1).abs())
}

/// Positions, each tied to its frame's point on the curve.
fn positions(canvas: &Canvas, figures: &FitFigures) -> Result<(), PlotError> {
    let sites: HashSet<usize> = figures.sites.iter().copied().collect();
    let size = size(figures.positions.len());
    for (i, &p) in figures.positions.iter().enumerate() {
        if finite(&[p]).next().is_none() {
            continue;
        }
        let at = canvas.at(p);
        let on_curve = figures.frame_points.get(i).map(std::slice::from_ref);
        if let Some(f) = on_curve.and_then(|f| finite(f).next()) {
            canvas.line(vec![at, canvas.at(f)], GREY, 0.8)?;
        }
        match sites.contains(&i) {
            true => canvas.mark(Mark::Square, at, size + 0.8, GREEN)?,
            false => canvas.mark(Mark::Diamond, at, size, GREY)?,
        }
    }
    Ok(())
}

fn size(points: usize) -> f64 {
    match points {
        0..=60 => 4.2,
        61..=150 => 3.2,
        _ => 2.4,
    }
}

fn frames(canvas: &Canvas, points: &[[f64; 2]]) -> Result<(), PlotError> {
    let numbered: Vec<(usize, Place)> = points
        .iter()
        .enumerate()
        .filter(|(_, p)| finite(&[**p]).next().is_some())
        .map(|(i, p)| (i, canvas.at(*p)))
        .collect();
    for &(_, at) in &numbered {
        canvas.mark(Mark::Dot, at, size(points.len()), BLUE)?;
    }
    let places: Vec<Place> = numbered.iter().map(|n| n.1).collect();
    for (i, at) in labels(&numbered, &places, points.len(), canvas.plane()) {
        canvas.text(&(i + 1).to_string(), at, HPos::Center, LETTERS - 1, INK)?;
    }
    Ok(())
}

/// Where to write the numbers of some frames, so that no two overlap and none hides a point; frames without such a place stay unnumbered.
fn labels(
    numbered: &[(usize, Place)],
    points: &[Place],
    frames: usize,
    [left, right, top, bottom]: [i32; 4],
) -> Vec<(usize, Place)> {
    let every = frames.div_ceil(NUMBERED).max(1);
    let mut written: Vec<(usize, Place)> = Vec::new();
    for &(i, at) in numbered {
        if i % every != 0 && i + 1 != frames {
            continue;
        }
        let half = (
            text_width(&(i + 1).to_string(), LETTERS) * FINE / 2,
            7 * FINE,
        );
        let within = |p: &Place| {
            p.0 - half.0 > left
                && p.0 + half.0 < right
                && p.1 - half.1 > top
                && p.1 + half.1 < bottom
        };
        let free = |p: &Place| {
            let clear = |q: &Place, margin: i32| {
                (p.0 - q.0).abs() > half.0 + margin || (p.1 - q.1).abs() > half.1 + margin
            };
            points.iter().all(|q| clear(q, 3 * FINE))
                && written.iter().all(|(_, q)| clear(q, 10 * FINE))
        };
        let place = around(at).into_iter().find(|p| within(p) && free(p));
        written.extend(place.map(|p| (i, p)));
    }
    written
}

/// Sixteen places around a point, near ones first.
fn around((x, y): Place) -> Vec<Place> {
    let directions = [
        (1, -1),
        (-1, -1),
        (1, 1),
        (-1, 1),
        (0, -1),
        (0, 1),
        (1, 0),
        (-1, 0),
    ];
    let at = |distance: i32| {
        directions.map(|(dx, dy)| (x + dx * distance * FINE, y + dy * distance * FINE))
    };
    [at(12), at(17)].concat()
}
