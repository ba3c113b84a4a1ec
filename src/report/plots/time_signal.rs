//! The time signal over the pose plane, as the right half of the paper's Figure 1.

use std::collections::HashSet;

use plotters::style::text_anchor::HPos;

use super::axis::Axis;
use super::canvas::{Canvas, FINE, Frame, LETTERS, Mark, Place, chart, text_width};
use super::{BLUE, GREEN, GREY, INK, PALE_VERMILION, Picture, PlotError, drawable, note_left_out};
use crate::harness::record::FitFigures;

/// Pixels of the picture's width, and those that its sides take from it.
const WIDTH: i32 = 520;
const SIDES: i32 = 90;
/// Pixels that legend and axis take from the height.
const ENDS: i32 = 112;
/// The plane is never flatter nor higher than this.
const HEIGHTS: (f64, f64) = (180.0, 480.0);
/// Frames that are numbered, at most.
const NUMBERED: usize = 16;

/// How far beyond the box of the positions the picture reaches at most, as a share of the box's longer side.
const BEYOND: f64 = 0.6;

/// A time signal over the pose plane.
#[derive(Clone, Copy, Debug)]
pub struct PosePlane<'a> {
    /// What is shown, for who cannot see it.
    pub name: &'a str,
    /// p_1 .. p_n.
    pub positions: &'a [[f64; 2]],
    /// f(i) at the frames.
    pub frame_points: &'a [[f64; 2]],
    /// f densely sampled.
    pub curve: &'a [[f64; 2]],
    /// Control points of f.
    pub control: &'a [[f64; 2]],
    /// Frames (0-based) that are sites of g.
    pub sites: &'a [usize],
}

impl<'a> From<&'a FitFigures> for PosePlane<'a> {
    fn from(figures: &'a FitFigures) -> Self {
        Self {
            name: &figures.case,
            positions: &figures.positions,
            frame_points: &figures.frame_points,
            curve: &figures.curve,
            control: &figures.control,
            sites: &figures.sites,
        }
    }
}

/// The curve f with f(i) at the frames, the positions p_i, the sites and the control polygon, as a whole `<svg>`.
pub fn pose_plane(plane: &PosePlane) -> Result<String, PlotError> {
    draw(plane, &Shown::new(plane))
}

/// The same of a fit on record.
pub(in crate::report) fn picture(figures: &FitFigures) -> Picture {
    let plane = &PosePlane::from(figures);
    let shown = Shown::new(plane);
    let all = shown.all();
    let total: usize = all.iter().map(|p| p.len()).sum();
    let kept: usize = all.iter().flat_map(|p| p.iter().flatten()).count();
    let given = [
        plane.curve,
        plane.frame_points,
        plane.positions,
        plane.control,
    ];
    let not_numbers = total - given.iter().map(|p| finite(p).count()).sum::<usize>();
    let beyond = total - kept - not_numbers;
    let note_beyond = (beyond > 0).then(|| {
        format!("{beyond} of {total} points lie far from every position and are left out; the curve is broken there.")
    });
    Picture {
        title: "Time signal over the pose plane".into(),
        look: "Look for the path of the motion: frames near each other here have similar shapes, a cycle closes on itself, and the line from a \
               diamond to its dot is what the time signal smooths away. The numbers count frames from 1."
            .into(),
        svg: draw(plane, &shown),
        notes: note_left_out(not_numbers, total, "points")
            .into_iter()
            .chain(note_beyond)
            .collect(),
    }
}

fn usable(p: [f64; 2]) -> bool {
    p.iter().all(|&x| drawable(x))
}

fn finite(points: &[[f64; 2]]) -> impl Iterator<Item = [f64; 2]> {
    points.iter().copied().filter(|&p| usable(p))
}

/// What is drawn: points in their order, none where one is not a number or far from every position.
struct Shown {
    curve: Vec<Option<[f64; 2]>>,
    frames: Vec<Option<[f64; 2]>>,
    positions: Vec<Option<[f64; 2]>>,
    control: Vec<Option<[f64; 2]>>,
}

impl Shown {
    fn new(plane: &PosePlane) -> Self {
        let sets = [plane.positions, plane.frame_points, plane.curve];
        let base = sets.iter().find(|p| finite(p).next().is_some());
        let limits = base.map(|points| limits(points));
        let within = |p: [f64; 2]| {
            let [low, high] = limits?;
            let inside = (0..2).all(|a| (low[a]..=high[a]).contains(&p[a]));
            (usable(p) && inside).then_some(p)
        };
        let shown = |points: &[[f64; 2]]| points.iter().map(|&p| within(p)).collect();
        Self {
            curve: shown(plane.curve),
            frames: shown(plane.frame_points),
            positions: shown(plane.positions),
            control: shown(plane.control),
        }
    }

    fn all(&self) -> [&[Option<[f64; 2]>]; 4] {
        [&self.curve, &self.frames, &self.positions, &self.control]
    }
}

/// The lower and the upper corner of what is shown around these points.
fn limits(points: &[[f64; 2]]) -> [[f64; 2]; 2] {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in finite(points) {
        for a in 0..2 {
            low[a] = low[a].min(p[a]);
            high[a] = high[a].max(p[a]);
        }
    }
    let side = (high[0] - low[0]).max(high[1] - low[1]);
    // All positions in one place: whatever is drawn, it is drawn around them.
    let reach = if side > 0.0 {
        BEYOND * side
    } else {
        f64::INFINITY
    };
    [low.map(|x| x - reach), high.map(|x| x + reach)]
}

/// The runs of points between those that are left out.
fn runs(canvas: &Canvas, points: &[Option<[f64; 2]>]) -> Vec<Vec<Place>> {
    points
        .split(|p| p.is_none())
        .map(|run| run.iter().flatten().map(|&p| canvas.at(p)).collect())
        .collect()
}

fn draw(plane: &PosePlane, shown: &Shown) -> Result<String, PlotError> {
    if shown
        .curve
        .iter()
        .chain(&shown.frames)
        .flatten()
        .next()
        .is_none()
    {
        return Err(PlotError::NothingToDraw("no points of a time signal"));
    }
    let (x, y, height) = equal_axes(shown);
    let label = format!(
        "Time signal of {}: a curve over the pose plane through {} frames, with {} sites",
        plane.name,
        plane.frame_points.len(),
        plane.sites.len()
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
        polygon(canvas, &shown.control)?;
        let on_curve = curve(canvas, &shown.curve)?;
        positions(canvas, shown, plane.sites)?;
        frames(canvas, &shown.frames, &on_curve)
    })
}

/// Axes on which a unit is as long across as up, and the height of the picture that they need.
fn equal_axes(shown: &Shown) -> (Axis, Axis, i32) {
    let along = |a: usize| {
        shown
            .all()
            .into_iter()
            .flatten()
            .flatten()
            .map(move |p| p[a])
    };
    let x = Axis::padded(along(0), 0.05, 6);
    let y = Axis::padded(along(1), 0.05, 6);
    let (x, y, up) = Axis::equal(&x, &y, f64::from(WIDTH - SIDES), HEIGHTS);
    (x, y, up.round() as i32 + ENDS)
}

fn polygon(canvas: &Canvas, control: &[Option<[f64; 2]>]) -> Result<(), PlotError> {
    for run in runs(canvas, control) {
        if run.len() > 1 {
            canvas.dashes(run, PALE_VERMILION)?;
        }
    }
    Ok(())
}

/// Draws the curve without the points that would fall onto the ones before, and answers those that remain.
fn curve(canvas: &Canvas, points: &[Option<[f64; 2]>]) -> Result<Vec<Place>, PlotError> {
    let mut drawn = Vec::new();
    for run in runs(canvas, points) {
        let run = thinned(run);
        drawn.extend_from_slice(&run);
        if run.len() > 1 {
            canvas.line(run, BLUE, 2.0)?;
        }
    }
    Ok(drawn)
}

/// The first and the last place, and of those between only the ones that are not where the one before is.
fn thinned(mut places: Vec<Place>) -> Vec<Place> {
    let last = places.last().copied();
    let mut before = None;
    places.retain(|&place| {
        let far = before.is_none_or(|b| reach(b, place) >= FINE * 3 / 4);
        if far {
            before = Some(place);
        }
        far
    });
    places.extend(last.filter(|l| before != Some(*l)));
    places
}

/// How far apart two places are, the longer of across and down.
fn reach(a: Place, b: Place) -> i32 {
    (a.0 - b.0).abs().max((a.1 - b.1).abs())
}

/// Positions, each tied to its frame's point on the curve.
fn positions(canvas: &Canvas, shown: &Shown, sites: &[usize]) -> Result<(), PlotError> {
    let sites: HashSet<usize> = sites.iter().copied().collect();
    let size = size(shown.positions.len());
    for (i, position) in shown.positions.iter().enumerate() {
        let Some(at) = position.map(|p| canvas.at(p)) else {
            continue;
        };
        if let Some(f) = shown.frames.get(i).copied().flatten() {
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

fn frames(canvas: &Canvas, points: &[Option<[f64; 2]>], curve: &[Place]) -> Result<(), PlotError> {
    let places: Vec<(usize, Place)> = points
        .iter()
        .enumerate()
        .filter_map(|(i, p)| Some((i, canvas.at((*p)?))))
        .collect();
    for &(_, at) in &places {
        canvas.mark(Mark::Dot, at, size(points.len()), BLUE)?;
    }
    let every = points.len().div_ceil(NUMBERED).max(1);
    let is_numbered = |i: usize| i.is_multiple_of(every) || i + 1 == points.len();
    let mut desk = Desk {
        plane: canvas.plane(),
        points: places.iter().map(|p| p.1).collect(),
        curve,
        written: Vec::new(),
    };
    for (i, at) in places.into_iter().filter(|p| is_numbered(p.0)) {
        let number = (i + 1).to_string();
        if let Some(place) = desk.write(at, &number) {
            canvas.text(&number, place, HPos::Center, LETTERS - 1, INK)?;
        }
    }
    Ok(())
}

/// Where numbers can be written: none over another nor over a point, and off the curve where there is room.
struct Desk<'a> {
    plane: [i32; 4],
    points: Vec<Place>,
    curve: &'a [Place],
    written: Vec<Place>,
}

impl Desk<'_> {
    /// A place near `at` for a number, now taken; none where there is no room, and the frame stays unnumbered.
    fn write(&mut self, at: Place, number: &str) -> Option<Place> {
        let half = (text_width(number, LETTERS) * FINE / 2, 7 * FINE);
        let places: Vec<Place> = around(at)
            .into_iter()
            .filter(|&p| self.is_free(p, half))
            .collect();
        let clear = places
            .iter()
            .find(|&&p| self.curve.iter().all(|&q| apart(p, q, half, 0)));
        let place = clear.or(places.first()).copied();
        self.written.extend(place);
        place
    }

    fn is_free(&self, p: Place, half: (i32, i32)) -> bool {
        let [left, right, top, bottom] = self.plane;
        let inside = p.0 - half.0 > left
            && p.0 + half.0 < right
            && p.1 - half.1 > top
            && p.1 + half.1 < bottom;
        inside
            && self.points.iter().all(|&q| apart(p, q, half, 3 * FINE))
            && self.written.iter().all(|&q| apart(p, q, half, 10 * FINE))
    }
}

/// Whether a place lies outside the box of half sides `half` around another, by a margin.
fn apart(p: Place, q: Place, half: (i32, i32), margin: i32) -> bool {
    (p.0 - q.0).abs() > half.0 + margin || (p.1 - q.1).abs() > half.1 + margin
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
