//! Figure 8: a sequence designed from nine expressions of a face.

use super::render::{MARKED, PLAIN, View};
use super::signals::{curve, either, line, plane, poses};
use super::{Exhibit, ExhibitError, Style};
use crate::sequence::dataset::DataFolders;
use crate::signal::Point;
use crate::signal::design::{DesignOptions, design};
use faer::MatRef;

const NAME: &str = "figure-8";
/// Where each expression is put: the first, neutral, in the middle.
const PLACES: [Point; 9] = [
    [0.0, 0.0],
    [1.0, 0.0],
    [0.7, 0.75],
    [0.0, 1.0],
    [-0.75, 0.7],
    [-1.0, 0.0],
    [-0.7, -0.75],
    [0.0, -1.0],
    [0.75, -0.7],
];
/// From neutral three times through the second expression, then to the fourth.
const SKETCH: [Point; 12] = [
    [0.0, 0.0],
    [0.5, -0.25],
    [1.0, 0.0],
    [0.5, 0.25],
    [0.25, 0.0],
    [0.55, -0.2],
    [0.95, 0.02],
    [0.5, 0.22],
    [0.3, 0.0],
    [0.9, -0.02],
    [0.5, 0.6],
    [0.0, 1.0],
];
const FRAMES: usize = 48;
/// Frames shown.
const SHOWN: usize = 8;

pub fn exhibit(data: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let (dataset, sequence) = either(data, "face-poses", "@face")?;
    let count = PLACES.len().min(sequence.frame_count());
    let d = sequence.dimension();
    let z = MatRef::from_column_major_slice(&sequence.positions()[..count * d], d, count);
    let options = DesignOptions {
        frames: FRAMES,
        closed: false,
        sites: None,
        dimension: None,
    };
    let made = design(z, &PLACES[..count], &SKETCH, &options).map_err(ExhibitError::of(NAME))?;
    let shown: Vec<f64> = (0..SHOWN)
        .map(|i| 1.0 + (i * (FRAMES - 1)) as f64 / (SHOWN - 1) as f64)
        .collect();
    let frames = made.evaluate(&shown);
    let strip = |title: &str, frames: &[f64], colour| {
        poses(title, frames, &sequence, colour, View::FRONT, [100, 130])
    };
    let at = |t: &f64| made.time.evaluate(*t);
    Ok(Exhibit {
        name: NAME.into(),
        title: "Figure 8: a sequence designed from nine expressions".into(),
        look: "Look for a face that goes three times through one expression and ends in another: nothing was captured but the nine, and those far from the \
               curve do not appear."
            .into(),
        datasets: vec![dataset.into()],
        panels: vec![
            plane(
                "Expressions placed by hand, and the sketched curve",
                vec![
                    line("shown beside", Style::Dots, shown.iter().map(at).collect()),
                    line("time signal f", Style::Line, curve(&made.time)),
                    line("expressions", Style::Squares, PLACES[..count].to_vec()),
                ],
            ),
            strip("The expressions, 1 to 9", &sequence.positions()[..count * d], PLAIN),
            strip("The new sequence", &frames, MARKED),
        ],
    })
}
