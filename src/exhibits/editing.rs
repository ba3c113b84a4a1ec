//! Figure 5: a loop added to a time signal.

use faer::MatRef;

use super::render::{MARKED, View};
use super::signals::{curve, line, plane, poses};
use super::{Exhibit, ExhibitError, Style};
use crate::sequence::dataset::{DataFolders, open};
use crate::signal::edit::{Edit, edit};
use crate::signal::fit::{FitOptions, fit};
use crate::signal::layout::Layout;
use crate::signal::psi::Representation;

const NAME: &str = "figure-5";
const DATASET: &str = "@character";
/// The paper's constants, and what its loop adds.
const CONSTANTS: [usize; 3] = [82, 46, 19];
const NEW: (usize, usize) = (19, 15);
/// The frame (0-based) after which the motion leaves.
const AFTER: usize = 60;
/// Corners of the loop.
const CORNERS: usize = 7;

pub fn exhibit(_: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let sequence = open(DATASET)?;
    let n = sequence.frame_count();
    let z = MatRef::from_column_major_slice(sequence.positions(), sequence.dimension(), n);
    let [k, l, m] = CONSTANTS;
    let options = FitOptions {
        layout: Layout::Mds,
        ..FitOptions::new(k, l, m)
    };
    let found = fit(z, &options).map_err(ExhibitError::of(NAME))?;
    let time = &found.representation.time;
    let added = Edit::Loop {
        after: AFTER,
        through: round(time.evaluate(AFTER as f64 + 1.0), &found.positions),
        frames: Some(NEW.0),
        control: Some(NEW.1),
    };
    let edited = edit(time, &[added]).map_err(ExhibitError::of(NAME))?;
    let new = edited
        .sources
        .iter()
        .enumerate()
        .filter(|(_, s)| s.is_none());
    let new: Vec<f64> = new.map(|(i, _)| i as f64 + 1.0).collect();
    let kept = edited.kept.iter().filter(|&&kept| kept).count();
    let after = Representation {
        time: edited.time,
        ..found.representation.clone()
    };
    let (k_now, n_now) = (after.time.spline.control.len(), after.time.frame_count());
    let shown: Vec<f64> = new.iter().copied().step_by(3).collect();
    let made = after.evaluate(&shown);
    let at = |t: &f64| after.time.evaluate(*t);
    let before = time.curve(1);
    let strip = poses(
        "Every third of the new frames",
        &made,
        &sequence,
        MARKED,
        View::around_y(35.0, 10.0),
        [110, 160],
    );
    Ok(Exhibit {
        name: NAME.into(),
        title: "Figure 5: a loop added to a time signal".into(),
        look: format!(
            "Look for a curve that is the same but for the loop: (k, n) go from ({k}, {n}) to ({k_now}, {n_now}), {kept} of the {n} old frames keep every bit, \
             and the new ones are poses between those that were there."
        ),
        datasets: vec![DATASET.into()],
        panels: vec![
            plane(
                "Before",
                vec![
                    line("f(i)", Style::Dots, before),
                    line("time signal f", Style::Line, curve(time)),
                ],
            ),
            plane(
                "After",
                vec![
                    line("new frames", Style::Dots, new.iter().map(at).collect()),
                    line("time signal f", Style::Line, curve(&after.time)),
                ],
            ),
            strip,
        ],
    })
}

/// A round through the middle of the layout and back, from a point.
fn round(from: [f64; 2], layout: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let n = layout.len() as f64;
    let mean: [f64; 2] = std::array::from_fn(|a| layout.iter().map(|p| p[a]).sum::<f64>() / n);
    let centre: [f64; 2] = std::array::from_fn(|a| 0.5 * (from[a] + mean[a]));
    let arm: [f64; 2] = std::array::from_fn(|a| from[a] - centre[a]);
    let corner = |i: usize| {
        let (sin, cos) = (std::f64::consts::TAU * i as f64 / (CORNERS + 1) as f64).sin_cos();
        [
            centre[0] + cos * arm[0] - sin * arm[1],
            centre[1] + sin * arm[0] + cos * arm[1],
        ]
    };
    (1..=CORNERS).map(corner).collect()
}
