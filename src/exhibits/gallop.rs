//! Figure 1: a galloping horse and its three signals.

use super::render::{PLAIN, View};
use super::signals::{either, poses, time_signal};
use super::{Exhibit, ExhibitError, Panel};
use crate::sequence::dataset::DataFolders;
use crate::signal::fit::{FitOptions, fit};
use crate::signal::knots::KnotRule;
use crate::signal::layout::Layout;
use faer::MatRef;

const NAME: &str = "figure-1";
const FRAMES: usize = 24;
/// Frames (1-based) of the first of two cycles of twelve.
const SHOWN: [usize; 6] = [1, 3, 5, 7, 9, 11];

pub fn exhibit(data: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let (dataset, sequence) = either(data, "horse-gallop", "@gallop")?;
    let n = FRAMES.min(sequence.frame_count());
    let frames = &sequence.positions()[..n * sequence.dimension()];
    let options = FitOptions {
        knots: KnotRule::Literal,
        layout: Layout::Mds,
        ..FitOptions::new(16, 12, 7)
    };
    let z = MatRef::from_column_major_slice(frames, sequence.dimension(), n);
    let fit = fit(z, &options).map_err(ExhibitError::of(NAME))?;
    let cycle = |first: usize| -> Vec<f64> { SHOWN.map(|i| (first + i) as f64).to_vec() };
    let strip = |title: &str, times: &[f64]| -> Panel {
        let made = fit.representation.evaluate(times);
        let view = View::around_y(68.0, 12.0);
        poses(title, &made, &sequence, PLAIN, view, [150, 140])
    };
    let shown = [cycle(0), cycle(FRAMES / 2)].concat();
    Ok(Exhibit {
        name: NAME.into(),
        title: "Figure 1: a gallop as time, pose and shape signals".into(),
        look: "Look for two cycles on one loop: f(i) and f(i + 12) lie close together in pose space, and the shapes above each other are alike."
            .into(),
        datasets: vec![dataset.into()],
        panels: vec![
            time_signal("The time signal over the pose plane", &fit, &shown),
            strip("psi(i) of the first cycle, i = 1, 3, ..., 11", &cycle(0)),
            strip("psi(i) of the second, i = 13, 15, ..., 23", &cycle(FRAMES / 2)),
        ],
    })
}
