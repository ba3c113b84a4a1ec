//! Figure 6: fast and slow motion by sampling the same curve at other times.

use std::f64::consts::TAU;

use super::render::{MARKED, PLAIN, View};
use super::signals::{curve, either, line, plane, poses};
use super::{Chart, Exhibit, ExhibitError, Panel, Style};
use crate::sequence::dataset::DataFolders;
use crate::signal::fit::{FitOptions, fit};
use crate::signal::layout::Layout;
use faer::MatRef;

const NAME: &str = "figure-6";
/// Slow and fast spells, and how far the speed departs from 1 in them.
const SPELLS: f64 = 4.0;
const DEPTH: f64 = 0.85;
/// Frames shown of each.
const SHOWN: usize = 8;

pub fn exhibit(data: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let (dataset, sequence) = either(data, "cow", "@jelly")?;
    let n = sequence.frame_count();
    let z = MatRef::from_column_major_slice(sequence.positions(), sequence.dimension(), n);
    // The paper's constants where the sequence is the paper's, and the same shares of n elsewhere.
    let share = |of: usize| of * n / 204;
    let options = FitOptions {
        layout: Layout::Mds,
        ..FitOptions::new(share(155).max(4), share(144).max(3), share(42))
    };
    let fit = fit(z, &options).map_err(ExhibitError::of(NAME))?;
    let time = &fit.representation.time;
    let uniform: Vec<f64> = (1..=n).map(|i| i as f64).collect();
    let warped: Vec<f64> = uniform.iter().map(|&i| warp(i, n)).collect();
    let at = |times: &[f64]| times.iter().map(|&t| time.evaluate(t)).collect();
    let title = |what: &str| format!("f at {what} times");
    let on_curve = |what: &str, times: &[f64]| {
        let dots = line(&title(what), Style::Dots, at(times));
        plane(
            &title(what),
            vec![dots, line("time signal f", Style::Line, curve(time))],
        )
    };
    let (first, step) = (n / 3, (n / 60).max(1));
    let strip = |what: &str, times: &[f64], colour| {
        // Fewer where the sequence ends before.
        let chosen = times.iter().skip(first).step_by(step).take(SHOWN);
        let chosen: Vec<f64> = chosen.copied().collect();
        let made = fit.representation.evaluate(&chosen);
        let title = format!("Frames {}, {}, ..., {what}", first + 1, first + 1 + step);
        let view = View::around_y(60.0, 15.0);
        poses(&title, &made, &sequence, colour, view, [120, 110])
    };
    let pairs = |times: &[f64]| uniform.iter().zip(times).map(|(&i, &t)| [i, t]).collect();
    Ok(Exhibit {
        name: NAME.into(),
        title: "Figure 6: fast and slow motion on the same curve".into(),
        look: "Look for dots that crowd where the motion is slow and thin out where it is fast: the curve stays, only the times at which it is sampled change."
            .into(),
        datasets: vec![dataset.into()],
        panels: vec![
            on_curve("uniform", &uniform),
            on_curve("warped", &warped),
            Panel::Chart(Chart {
                title: "Times of the new frames".into(),
                x_title: "new frame".into(),
                y_title: "time in the old sequence, frames".into(),
                lines: vec![
                    line("fast and slow", Style::Line, pairs(&warped)),
                    line("uniform", Style::Dashes, pairs(&uniform)),
                ],
                ..Chart::default()
            }),
            strip("as it was", &uniform, PLAIN),
            strip("fast and slow", &warped, MARKED),
        ],
    })
}

/// A time of its own for every frame, rising, with the same ends.
fn warp(i: f64, n: usize) -> f64 {
    let span = (n - 1) as f64;
    let u = (i - 1.0) / span;
    1.0 + span * (u - DEPTH * (TAU * SPELLS * u).sin() / (TAU * SPELLS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::dataset::open;
    use crate::sequence::format::write;

    #[test]
    fn short_sequences_show_the_frames_they_have() {
        let jelly = open("@jelly-small").unwrap();
        for n in [4, 7, 11] {
            let data = tempfile::tempdir().unwrap();
            let frames: Vec<usize> = (0..n).collect();
            write(&jelly.select(&frames).unwrap(), &data.path().join("cow")).unwrap();
            let exhibit = exhibit(&DataFolders(vec![data.path().into()])).unwrap();
            assert_eq!(exhibit.datasets, ["cow"]);
        }
    }
}
