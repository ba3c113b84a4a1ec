//! Figure 3: saddles of the pose surface beside the time signal, and a layout that has none there.

use faer::MatRef;
use rayon::prelude::*;

use super::render::{MARKED, View};
use super::signals::{curve, either, line, poses};
use super::{Chart, Exhibit, ExhibitError, Ground, Panel, Style, Table};
use crate::sequence::Sequence;
use crate::sequence::dataset::DataFolders;
use crate::signal::Point;
use crate::signal::dissimilarities::separation;
use crate::signal::fit::{Fit, FitOptions, fit};
use crate::signal::layout::Layout;
use crate::signal::saddles::{Place, gaussian_curvature, places};

const NAME: &str = "figure-3";
/// Cells across a plane.
const CELLS: usize = 120;
/// From one frame to the next, both with it.
const SHOWN: usize = 5;
/// How far around an in-between the plane is shown, in times its distance from the farther of the frames before and after its own two.
const AROUND: f64 = 1.6;
/// A patch the size of a step of the motion that turns by more than this is curved, by more than `STEEP` steeply.
const CURVED: f64 = 0.1;
const STEEP: f64 = 1.0;
const KINDS: [&str; 3] = ["saddle", "steep saddle", "dome"];

/// A fit in one layout, and what is between its frames.
struct Run {
    layout: Layout,
    fit: Fit,
    places: Vec<Place>,
}

pub fn exhibit(data: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let (dataset, sequence) = either(data, "cow", "@character")?;
    let paper = run(&sequence, Layout::Mds)?;
    let mended = run(&sequence, Layout::default())?;
    let worst = farthest(&paper.places);
    let mut panels = Vec::new();
    for run in [&paper, &mended] {
        panels.push(whole(run));
        panels.push(around(run, worst));
        panels.push(strip(run, worst, &sequence));
    }
    panels.push(Panel::Table(table(&[&paper, &mended], worst)));
    Ok(Exhibit {
        name: NAME.into(),
        title: "Figure 3: saddles of the pose surface beside the time signal".into(),
        look: format!(
            "Look for squares on amber ground: `mds` puts stretches of the motion side by side that are alike in the plane only, g has to bend between them, \
             and halfway from frame {} to the next the shape belongs to neither. `ordered` pulls the stretches apart, without pins, and the same in-between is \
             like both.",
            worst.floor()
        ),
        datasets: vec![dataset.into()],
        panels,
    })
}

fn run(sequence: &Sequence, layout: Layout) -> Result<Run, ExhibitError> {
    let n = sequence.frame_count();
    let z = MatRef::from_column_major_slice(sequence.positions(), sequence.dimension(), n);
    // Signals that interpolate: every frame is met, and what is wrong is wrong in between.
    let options = FitOptions {
        layout,
        ..FitOptions::new(n + 2, n, n - 1)
    };
    let fit = fit(z, &options).map_err(ExhibitError::of(NAME))?;
    Ok(Run {
        layout,
        places: places(&fit),
        fit,
    })
}

/// The time of the in-between that strays the most, the first of equals.
fn farthest(places: &[Place]) -> f64 {
    let farther = |a: &'_ Place, b: &'_ Place| b.stray > a.stray;
    let worst = places
        .iter()
        .reduce(|a, b| if farther(a, b) { b } else { a });
    worst.map_or(1.5, |place| place.time)
}

/// The whole curve, and where it is astray.
fn whole(run: &Run) -> Panel {
    let curve = curve(&run.fit.representation.time);
    let astray = run.places.iter().filter(|place| place.is_astray());
    let title = format!("{}: the pose plane", run.layout);
    let lines = vec![
        line(
            "in-betweens astray",
            Style::Squares,
            astray.map(|p| p.point).collect(),
        ),
        line("time signal f", Style::Line, curve.clone()),
    ];
    let [low, high] = extent(&curve);
    let margin = 0.04 * (high[0] - low[0]).max(high[1] - low[1]);
    let corners = [low.map(|x| x - margin), high.map(|x| x + margin)];
    plane(title, run, corners, lines)
}

/// The plane around one in-between.
fn around(run: &Run, time: f64) -> Panel {
    let signal = &run.fit.representation.time;
    let n = signal.frame_count() as f64;
    let middle = signal.evaluate(time);
    let beside = [time - 1.5, time + 1.5].map(|t| signal.evaluate(t.clamp(1.0, n)));
    let reach = beside.map(|p| crate::signal::distance(p, middle));
    let half = AROUND * reach[0].max(reach[1]);
    let corners = [middle.map(|x| x - half), middle.map(|x| x + half)];
    let frames = signal.curve(1);
    let shown = shown(time).map(|t| signal.evaluate(t));
    let title = format!("{}: around f({time})", run.layout);
    let lines = vec![
        line("shown below", Style::Squares, shown.to_vec()),
        line("time signal f", Style::Line, curve(signal)),
        line("f(i)", Style::Dots, frames),
    ];
    plane(title, run, corners, lines)
}

/// From the frame before to the frame after.
fn shown(time: f64) -> [f64; SHOWN] {
    std::array::from_fn(|i| time - 0.5 + i as f64 / (SHOWN - 1) as f64)
}

fn strip(run: &Run, time: f64, sequence: &Sequence) -> Panel {
    let made = run.fit.representation.evaluate(&shown(time));
    let first = time.floor();
    let title = format!(
        "{}: psi(t) from frame {first} to frame {}, t = {first}, {}, ..., {}",
        run.layout,
        first + 1.0,
        first + 0.25,
        first + 1.0
    );
    let view = View::around_y(60.0, 15.0);
    poses(&title, &made, sequence, MARKED, view, [150, 130])
}

/// Lines over the curvature of g.
fn plane(title: String, run: &Run, corners: [Point; 2], lines: Vec<super::Line>) -> Panel {
    Panel::Chart(Chart {
        title,
        x_title: "first pose coordinate".into(),
        y_title: "second pose coordinate".into(),
        equal: true,
        ground: Some(ground(&run.fit, corners)),
        lines,
        ..Chart::default()
    })
}

/// The Gaussian curvature of g over a part of the plane, times the square of the mean step of the motion, in a few kinds.
fn ground(fit: &Fit, corners: [Point; 2]) -> Ground {
    let column = |i: usize| fit.coordinates.col_as_slice(i);
    let n = fit.coordinates.ncols();
    let steps = (1..n).map(|i| separation(column(i - 1), column(i)));
    let step = steps.sum::<f64>() / n.saturating_sub(1).max(1) as f64;
    let [low, high] = corners;
    let side = (high[0] - low[0]) / CELLS as f64;
    let rows = ((high[1] - low[1]) / side).round().max(1.0) as usize;
    let kind = |cell: usize| {
        let middle = [
            low[0] + (0.5 + (cell % CELLS) as f64) * side,
            low[1] + (0.5 + (cell / CELLS) as f64) * (high[1] - low[1]) / rows as f64,
        ];
        match gaussian_curvature(&fit.representation.pose, middle).map(|k| k * step * step) {
            Some(k) if k < -STEEP => '2',
            Some(k) if k < -CURVED => '1',
            Some(k) if k > CURVED => '3',
            _ => '0',
        }
    };
    let cells: Vec<char> = (0..CELLS * rows).into_par_iter().map(kind).collect();
    Ground {
        corners,
        across: CELLS,
        cells: cells.into_iter().collect(),
        kinds: KINDS.map(String::from).to_vec(),
    }
}

fn extent(points: &[Point]) -> [Point; 2] {
    let mut found = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for p in points {
        for a in 0..2 {
            found[0][a] = found[0][a].min(p[a]);
            found[1][a] = found[1][a].max(p[a]);
        }
    }
    found
}

fn table(runs: &[&Run], worst: f64) -> Table {
    let row = |run: &&Run| {
        let astray = || run.places.iter().filter(|place| place.is_astray());
        let most = run.places.iter().map(|p| p.stray).fold(0.0, f64::max);
        let there = run.places.iter().find(|p| p.time == worst);
        vec![
            run.layout.to_string(),
            astray().count().to_string(),
            astray()
                .filter(|place| place.is_saddle())
                .count()
                .to_string(),
            format!("{most:.2}"),
            format!("{:.2}", there.map_or(0.0, |place| place.stray)),
        ]
    };
    Table {
        caption: "In-betweens halfway between frames; astray is more than a quarter of a step away from the cubic spline through the frames".into(),
        heads: [
            "layout".to_owned(),
            "astray".to_owned(),
            "of them on saddles".to_owned(),
            "farthest off, steps".to_owned(),
            format!("at {worst}, steps"),
        ]
        .to_vec(),
        rows: runs.iter().map(row).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saddles_lie_beside_the_curve_of_the_papers_layout_alone() {
        let exhibit = exhibit(&DataFolders::new(Some("no data".as_ref()))).unwrap();
        let Some(Panel::Table(table)) = exhibit.panels.last() else {
            panic!("the last panel is no table");
        };
        let number = |row: usize, column: usize| table.rows[row][column].parse::<f64>().unwrap();
        // Astray, and on saddles; then the one that strays the most.
        assert!(
            number(0, 1) > 10.0 && number(0, 2) > 0.5 * number(0, 1),
            "{:?}",
            table.rows
        );
        assert!(number(1, 1) < 0.1 * number(0, 1), "{:?}", table.rows);
        assert!(
            number(0, 3) > 1.0 && number(1, 4) < 0.25,
            "{:?}",
            table.rows
        );
        let grounds = exhibit.panels.iter().filter_map(|panel| match panel {
            Panel::Chart(chart) => chart.ground.as_ref(),
            _ => None,
        });
        let steep: Vec<usize> = grounds
            .map(|ground| {
                assert_eq!(ground.cells.len() % ground.across, 0);
                ground.cells.matches('2').count()
            })
            .collect();
        assert!(steep[0] > 0 && steep[2] < steep[0], "{steep:?}");
    }
}
