//! Figure 7: a gallop moved to another animal by eight examples, in two shape spaces.

use faer::MatRef;

use super::render::{MARKED, PLAIN, View};
use super::signals::poses;
use super::{Exhibit, ExhibitError, Panel, Table};
use crate::mesh::measure::bounds;
use crate::mesh::orientation::Orientation;
use crate::sequence::Sequence;
use crate::sequence::dataset::{DataFolders, open};
use crate::shape::{Space, SpaceKind, decode_all, encode_examples, prepare_for};
use crate::signal::in_space::sample_in_space;
use crate::signal::knots::KnotRule;
use crate::signal::transfer::{ExampleBasis, frames_of_coordinates, transfer_motion};

const NAME: &str = "figure-7";
/// Frames of the gallop, control points and sites, as in the paper.
const FRAMES: usize = 24;
const CONTROL: usize = 16;
const SITES: usize = 12;
/// Examples, the reference pose among them.
const EXAMPLES: usize = 8;
const SHOWN: [f64; 6] = [1.0, 3.0, 5.0, 7.0, 9.0, 11.0];

/// A motion and the examples that pair its mesh with another.
struct Given {
    names: [&'static str; 3],
    motion: Sequence,
    source: Sequence,
    target: Sequence,
}

pub fn exhibit(data: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let given = given(data)?;
    let n = FRAMES.min(given.motion.frame_count());
    let view = View::around_y(68.0, 12.0);
    let shown: Vec<f64> = SHOWN
        .iter()
        .flat_map(|&i| given.motion.frame(i as usize - 1).to_vec())
        .collect();
    let strip = |title: String, frames: &[f64], mesh: &Sequence, colour| {
        poses(&title, frames, mesh, colour, view, [150, 140])
    };
    let mut panels = vec![strip("The motion".into(), &shown, &given.motion, PLAIN)];
    let mut rows = Vec::new();
    for kind in [SpaceKind::Vertex, SpaceKind::Gradient] {
        let moved = moved(&given, n, kind)?;
        panels.push(strip(
            format!("On the other mesh, in {kind} space"),
            &moved.shown,
            &given.target,
            MARKED,
        ));
        rows.push(vec![
            kind.to_string(),
            format!("{:.1e}", moved.example_error),
            moved.turned.to_string(),
        ]);
    }
    panels.push(Panel::Table(Table {
        caption: "The examples as the motion's signals show them, and all frames of the new motion"
            .into(),
        heads: [
            "space",
            "greatest error of an example / diagonal",
            "faces newly inside out, of all frames",
        ]
        .map(String::from)
        .to_vec(),
        rows,
    }));
    Ok(Exhibit {
        name: NAME.into(),
        title: "Figure 7: a gallop on another animal".into(),
        look: "Look at thin and bent limbs: positions mixed in straight lines shrink and shear them, deformation gradients turn them; the gait is the \
               same in both."
            .into(),
        datasets: given.names.map(String::from).to_vec(),
        panels,
    })
}

/// The real horse and elephant where they are, else the embedded animals.
fn given(data: &DataFolders) -> Result<Given, ExhibitError> {
    let real = [
        "horse-gallop",
        "horse-poses",
        "elephant-poses",
        "rest-poses",
    ];
    if !real.iter().all(|name| data.files(name).is_ok()) {
        return Ok(Given {
            names: ["@gallop", "@gallop-poses", "@trot-poses"],
            motion: open("@gallop")?,
            source: open("@gallop-poses")?,
            target: open("@trot-poses")?,
        });
    }
    Ok(Given {
        names: ["horse-gallop", "horse-poses", "elephant-poses"],
        motion: data.sequence("horse-gallop")?,
        source: data.examples("horse-poses", EXAMPLES)?,
        target: data.examples("elephant-poses", EXAMPLES)?,
    })
}

struct Moved {
    shown: Vec<f64>,
    example_error: f64,
    turned: usize,
}

fn moved(given: &Given, n: usize, kind: SpaceKind) -> Result<Moved, ExhibitError> {
    let prepared = |poses: &Sequence| {
        let space = prepare_for(kind, poses.connectivity(), poses.positions());
        space.map_err(ExhibitError::of(NAME))
    };
    let (from, to) = (prepared(&given.source)?, prepared(&given.target)?);
    let frames = &given.motion.positions()[..n * given.motion.dimension()];
    let over = transfer_motion(
        frames,
        [&*from, &*to],
        [given.source.positions(), given.target.positions()],
        (CONTROL.min(n + 2), SITES.min(n)),
        KnotRule::Literal,
    );
    let over = over.map_err(ExhibitError::of(NAME))?;
    let sample =
        |times: &[f64]| sample_in_space(&*to, &over, times).map_err(ExhibitError::of(NAME));
    let every: Vec<f64> = (1..=n).map(|i| i as f64).collect();
    let faces = given.target.connectivity().faces();
    let orientation = Orientation::new(given.target.frame(0), faces);
    let before = orientation.not_clear(given.target.positions());
    let newly = orientation.newly_turned(&sample(&every)?, &before);
    Ok(Moved {
        shown: sample(&SHOWN)?,
        example_error: example_error(given, &*from, &*to)?,
        turned: newly.iter().map(Vec::len).sum(),
    })
}

/// The examples of the source, as frames, moved to the target: how far vertices are from its examples, over the diagonal.
fn example_error(given: &Given, from: &dyn Space, to: &dyn Space) -> Result<f64, ExhibitError> {
    let examples = |space: &dyn Space, poses: &Sequence| {
        encode_examples(space, poses.positions()).map_err(ExhibitError::of(NAME))
    };
    let (q, r) = (examples(from, &given.source)?, examples(to, &given.target)?);
    let basis = ExampleBasis::new(q.as_ref()).map_err(ExhibitError::of(NAME))?;
    let x = basis
        .coordinates(q.as_ref())
        .map_err(ExhibitError::of(NAME))?;
    let moved = frames_of_coordinates(x.as_ref(), r.as_ref());
    let moved = moved.map_err(ExhibitError::of(NAME))?;
    let moved = MatRef::from_column_major_slice(&moved, r.nrows(), x.ncols());
    let frames = decode_all(to, moved).map_err(ExhibitError::of(NAME))?;
    let gaps = frames
        .iter()
        .zip(given.target.positions())
        .map(|(a, b)| (a - b).abs());
    let diagonal = bounds(given.target.frame(0)).diagonal();
    Ok(gaps.fold(0.0, f64::max) / diagonal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_turn_into_their_partners_and_no_face_inside_out() {
        let exhibit = exhibit(&DataFolders::new(Some("no data".as_ref()))).unwrap();
        let Some(Panel::Table(table)) = exhibit.panels.last() else {
            panic!("the last panel is no table");
        };
        for row in &table.rows {
            assert!(row[1].parse::<f64>().unwrap() < 1e-9, "{row:?}");
        }
        let gradient = table.rows.iter().find(|row| row[0] == "gradient").unwrap();
        assert_eq!(gradient[2], "0");
    }
}
