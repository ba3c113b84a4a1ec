//! Figure 2: a time signal and its control points.

use super::signals::{curve, line, plane};
use super::{Exhibit, ExhibitError, Style};
use crate::sequence::dataset::{DataFolders, open};
use crate::signal::fit::{FitOptions, fit};
use crate::signal::layout::Layout;
use faer::MatRef;

const NAME: &str = "figure-2";
const DATASET: &str = "@gallop-small";
const FRAMES: usize = 8;

pub fn exhibit(_: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let sequence = open(DATASET)?;
    let d = sequence.dimension();
    let z = MatRef::from_column_major_slice(&sequence.positions()[..FRAMES * d], d, FRAMES);
    let options = FitOptions {
        layout: Layout::Mds,
        ..FitOptions::new(6, FRAMES, FRAMES - 1)
    };
    let fit = fit(z, &options).map_err(ExhibitError::of(NAME))?;
    let time = &fit.representation.time;
    let points = (1..=FRAMES).map(|i| time.evaluate(i as f64)).collect();
    let control = &time.spline.control;
    Ok(Exhibit {
        name: NAME.into(),
        title: "Figure 2: a time signal and its control points".into(),
        look: "Look for a smooth curve that follows its control polygon and ends on it: k = 6 control points carry n = 8 frames.".into(),
        datasets: vec![DATASET.into()],
        panels: vec![plane(
            "Six control points, eight frames",
            vec![
                line("f(i)", Style::Dots, points),
                line("control points", Style::Squares, control.clone()),
                line("", Style::Dashes, control.clone()),
                line("time signal f", Style::Line, curve(time)),
            ],
        )],
    })
}
