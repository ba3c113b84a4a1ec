//! Halfway between a flat strip and the strip rolled by up to 700 degrees, in every shape space.

use super::render::{MARKED, PLAIN, Pose, View, row};
use super::{Chart, Exhibit, ExhibitError, Line, Panel, Style, Table};
use crate::mesh::topology::Topology;
use crate::mesh::vector::{norm, sub};
use crate::sequence::Sequence;
use crate::sequence::dataset::{DataFolders, open};
use crate::sequence::synthetic::roll::roll_angle;
use crate::shape::halfway::halfway;
use crate::shape::{SpaceKind, prepare_for};

const NAME: &str = "large-turns";
const STRIP: &str = "@roll";
/// Frames (0-based) in the table; each is rolled by 20 degrees more than the one before.
const TABLE: [usize; 7] = [0, 5, 9, 17, 18, 27, 35];
/// Frames between two points of the chart.
const STEP: usize = 5;

/// One space, what it makes of every halfway, and how far edge lengths are off there.
struct Run {
    kind: SpaceKind,
    frames: Vec<Vec<f64>>,
    errors: Vec<f64>,
}

/// A table of length errors, the same as a chart, and the strips halfway to the greatest roll.
pub fn exhibit(_: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let sequence = open(STRIP)?;
    let mut turns: Vec<usize> = (0..sequence.frame_count()).step_by(STEP).collect();
    turns.extend(TABLE);
    turns.sort_unstable();
    turns.dedup();
    let runs: Vec<Run> = SpaceKind::ALL
        .into_iter()
        .map(|kind| run(kind, &sequence, &turns))
        .collect::<Result<_, _>>()?;
    Ok(Exhibit {
        name: NAME.into(),
        title: "Large turns: halfway to a roll, in every shape space".into(),
        look: "Look for the strip that shrinks: positions averaged cut across the roll, and past half a turn nothing of it is left. Spaces of \
               lengths, angles and rotations bend it half as far at the same length, also past a whole turn, where a rotation alone does not tell \
               how often it went round."
            .into(),
        datasets: vec![STRIP.into()],
        panels: vec![
            Panel::Table(table(&runs, &turns)),
            Panel::Chart(chart(&runs, &turns)),
            picture(&runs, &sequence),
        ],
    })
}

fn run(kind: SpaceKind, sequence: &Sequence, turns: &[usize]) -> Result<Run, ExhibitError> {
    let flat = sequence.frame(0);
    let between = |&turn: &usize| {
        let both = [flat, sequence.frame(turn)].concat();
        let space = prepare_for(kind, sequence.connectivity(), &both)?;
        halfway(&*space, flat, sequence.frame(turn))
    };
    let frames: Result<Vec<_>, _> = turns.iter().map(between).collect();
    let frames = frames.map_err(ExhibitError::of(NAME))?;
    let topology = Topology::new(sequence.connectivity().faces());
    let error = |frame: &Vec<f64>| length_error(topology.edges(), frame, flat);
    Ok(Run {
        kind,
        errors: frames.iter().map(error).collect(),
        frames,
    })
}

/// The mean over the edges of |length - length in the flat strip| over the latter.
fn length_error(edges: &[[u32; 2]], frame: &[f64], flat: &[f64]) -> f64 {
    let length = |frame: &[f64], [a, b]: [u32; 2]| {
        let points = frame.as_chunks::<3>().0;
        norm(sub(points[a as usize], points[b as usize]))
    };
    let off = |&edge: &[u32; 2]| (length(frame, edge) / length(flat, edge) - 1.0).abs();
    edges.iter().map(off).sum::<f64>() / edges.len() as f64
}

fn degrees(turn: usize) -> f64 {
    roll_angle(turn).to_degrees().round()
}

fn table(runs: &[Run], turns: &[usize]) -> Table {
    let columns: Vec<usize> = TABLE
        .iter()
        .filter_map(|t| turns.iter().position(|u| u == t))
        .collect();
    let heads = columns.iter().map(|&c| format!("{}°", degrees(turns[c])));
    let row = |run: &Run| {
        let cells = columns.iter().map(|&c| format!("{:.1e}", run.errors[c]));
        [run.kind.name().to_owned()]
            .into_iter()
            .chain(cells)
            .collect()
    };
    Table {
        caption: "Mean relative change of an edge's length halfway to a roll by".into(),
        heads: ["space".to_owned()].into_iter().chain(heads).collect(),
        rows: runs.iter().map(row).collect(),
    }
}

fn chart(runs: &[Run], turns: &[usize]) -> Chart {
    let line = |run: &Run| Line {
        name: run.kind.name().into(),
        style: Style::Line,
        points: turns
            .iter()
            .zip(&run.errors)
            .map(|(&t, &e)| [degrees(t), 100.0 * e])
            .collect(),
    };
    Chart {
        title: "Length error against the roll".into(),
        x_title: "roll of the end pose, degrees".into(),
        y_title: "mean change of an edge's length halfway, %".into(),
        lines: runs.iter().map(line).collect(),
        ..Chart::default()
    }
}

fn picture(runs: &[Run], sequence: &Sequence) -> Panel {
    let faces = sequence.connectivity().faces();
    let last = sequence.frame(sequence.frame_count() - 1);
    let pose = |positions, colour| Pose {
        positions,
        faces,
        colour,
    };
    let mut poses = vec![pose(sequence.frame(0), PLAIN), pose(last, PLAIN)];
    let halfways = runs.iter().filter_map(|run| run.frames.last());
    poses.extend(halfways.map(|frame| pose(frame, MARKED)));
    let names: Vec<&str> = runs.iter().map(|run| run.kind.name()).collect();
    let title = format!(
        "From left to right: flat, rolled by {} degrees, and halfway between them in {}",
        degrees(sequence.frame_count() - 1),
        names.join(", ")
    );
    Panel::Picture(row(&title, &poses, View::around_y(25.0, 25.0), [170, 130]))
}
