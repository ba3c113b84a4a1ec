//! Figure 4: a flag in the wind, in the space of deformation gradients.

use super::render::{PLAIN, View};
use super::signals::{poses, time_signal};
use super::{Exhibit, ExhibitError};
use crate::sequence::dataset::{DataFolders, open};
use crate::shape::{SpaceKind, prepare_for};
use crate::signal::fit::FitOptions;
use crate::signal::in_space::{fit_in_space, sample_in_space};
use crate::signal::layout::Layout;

const NAME: &str = "figure-4";
const DATASET: &str = "@flag";
const SHOWN: [f64; 6] = [1.0, 20.0, 40.0, 60.0, 80.0, 100.0];

pub fn exhibit(_: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let sequence = open(DATASET)?;
    let (mesh, positions) = (sequence.connectivity(), sequence.positions());
    let space = prepare_for(SpaceKind::Gradient, mesh, positions);
    let space = space.map_err(ExhibitError::of(NAME))?;
    let options = FitOptions {
        layout: Layout::Mds,
        ..FitOptions::new(98, 100, 79)
    };
    let found = fit_in_space(&*space, sequence.positions(), &options);
    let fit = found.map_err(ExhibitError::of(NAME))?.fit;
    let made = sample_in_space(&*space, &fit.representation, &SHOWN);
    let made = made.map_err(ExhibitError::of(NAME))?;
    let view = View::around_y(30.0, 15.0);
    let title = "psi(i), decoded, i = 1, 20, 40, ..., 100";
    Ok(Exhibit {
        name: NAME.into(),
        title: "Figure 4: a flag, in the space of deformation gradients".into(),
        look: "Look for circles: the wind's repeated pull shows as rounds in pose space, though no two waves of the cloth are the same, which takes nearly \
               as many sites as frames."
            .into(),
        datasets: vec![DATASET.into()],
        panels: vec![
            time_signal("The time signal over the pose plane", &fit, &SHOWN),
            poses(title, &made, &sequence, PLAIN, view, [150, 130]),
        ],
    })
}
