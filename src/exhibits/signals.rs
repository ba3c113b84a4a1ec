//! What several exhibits show of a representation: its curve over the pose plane, and frames that it makes.

use super::render::{Pose, View, row};
use super::{Chart, Line, Panel, Style};
use crate::sequence::Sequence;
use crate::sequence::dataset::{DataFolders, DatasetError};
use crate::signal::fit::Fit;
use crate::signal::psi::{SMOOTH, TimeSignal};

/// The real dataset where it is, else the embedded one; with its name.
pub fn either(
    data: &DataFolders,
    real: &'static str,
    embedded: &'static str,
) -> Result<(&'static str, Sequence), DatasetError> {
    match present(data.sequence(real))? {
        Some(sequence) => Ok((real, sequence)),
        None => Ok((embedded, data.sequence(embedded)?)),
    }
}

/// What there is of a dataset, None where it is absent; damaged data stay an error.
pub fn present<T>(found: Result<T, DatasetError>) -> Result<Option<T>, DatasetError> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(DatasetError::Absent { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}

/// f over its frames, densely.
pub fn curve(time: &TimeSignal) -> Vec<[f64; 2]> {
    time.curve(SMOOTH)
}

/// A line of a chart.
pub fn line(name: &str, style: Style, points: Vec<[f64; 2]>) -> Line {
    Line {
        name: name.into(),
        style,
        points,
    }
}

/// The pose plane: these lines on axes of equal units.
pub fn plane(title: &str, lines: Vec<Line>) -> Panel {
    Panel::Chart(Chart {
        title: title.into(),
        x_title: "first pose coordinate".into(),
        y_title: "second pose coordinate".into(),
        equal: true,
        lines,
        ..Chart::default()
    })
}

/// The time signal of a fit, its sites, and the points at these times as red as the shapes shown beside.
pub fn time_signal(title: &str, fit: &Fit, shown: &[f64]) -> Panel {
    let time = &fit.representation.time;
    let at = |t: &f64| time.evaluate(*t);
    let frames: Vec<f64> = (1..=time.frame_count()).map(|i| i as f64).collect();
    plane(
        title,
        vec![
            line(
                "shown beside",
                Style::Squares,
                shown.iter().map(at).collect(),
            ),
            line("time signal f", Style::Line, curve(time)),
            line(
                "sites of g",
                Style::Squares,
                fit.representation.pose.sites.clone(),
            ),
            line("f(i)", Style::Dots, frames.iter().map(at).collect()),
        ],
    )
}

/// Frames (n x 3V positions of this mesh) side by side.
pub fn poses(
    title: &str,
    frames: &[f64],
    mesh: &Sequence,
    colour: [f64; 3],
    view: View,
    cell: [usize; 2],
) -> Panel {
    let poses: Vec<Pose> = frames
        .chunks_exact(mesh.dimension())
        .map(|positions| Pose {
            positions,
            faces: mesh.connectivity().faces(),
            colour,
        })
        .collect();
    Panel::Picture(row(title, &poses, view, cell))
}
