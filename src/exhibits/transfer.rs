//! Figure 7: a gallop moved to another animal by eight examples, in two shape spaces.

use super::render::{MARKED, PLAIN, View};
use super::signals::{poses, present};
use super::{Exhibit, ExhibitError, Panel, Table};
use crate::mesh::measure::bounds;
use crate::mesh::orientation::Orientation;
use crate::sequence::Sequence;
use crate::sequence::dataset::{DataFolders, open};
use crate::shape::{Space, SpaceKind, prepare_for};
use crate::signal::in_space::sample_in_space;
use crate::signal::knots::KnotRule;
use crate::signal::transfer::transfer_motion;

const NAME: &str = "figure-7";
/// Frames of the gallop, control points and sites, as in the paper.
const FRAMES: usize = 24;
const CONTROL: usize = 16;
const SITES: usize = 12;
/// Examples, the reference pose among them.
const EXAMPLES: usize = 8;
/// Frames (1-based) of the motion, as far as it has them.
const SHOWN: [usize; 6] = [1, 3, 5, 7, 9, 11];

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
    let shown = SHOWN.iter().filter(|&&i| i <= n);
    let shown: Vec<f64> = shown
        .flat_map(|&i| given.motion.frame(i - 1).to_vec())
        .collect();
    let strip = |title: String, frames: &[f64], mesh: &Sequence, colour| {
        poses(&title, frames, mesh, colour, view, [150, 140])
    };
    let mut panels = vec![strip("The motion".into(), &shown, &given.motion, PLAIN)];
    let mut rows = Vec::new();
    let mut worst: f64 = 0.0;
    for kind in [SpaceKind::Vertex, SpaceKind::Gradient] {
        let moved = moved(&given, n, kind)?;
        worst = worst.max(moved.example_error);
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
        caption: format!(
            "The {} examples of the source, fitted with time and pose signals that interpolate and moved, are those of the target within {worst:.1e} of the \
             diagonal; beside it, all frames of the new motion",
            given.source.frame_count()
        ),
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
    let mut all = true;
    for name in real {
        all &= present(data.files(name))?.is_some();
    }
    if !all {
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
    let shown = SHOWN.iter().filter(|&&i| i <= n).map(|&i| i as f64);
    Ok(Moved {
        shown: sample(&shown.collect::<Vec<_>>())?,
        example_error: example_error(given, &*from, &*to)?,
        turned: newly.iter().map(Vec::len).sum(),
    })
}

/// The examples of the source, fitted with signals that interpolate and moved to the target: how far they are from the target's, over the diagonal.
///
/// k = n + 2 control points and l = n sites for n examples, whose own n - 1 differences span them: psi(i) is example i, and so is psi'(i).
fn example_error(given: &Given, from: &dyn Space, to: &dyn Space) -> Result<f64, ExhibitError> {
    let n = given.source.frame_count();
    let (source, target) = (given.source.positions(), given.target.positions());
    let constants = (n + 2, n);
    let rule = KnotRule::Symmetric;
    let over = transfer_motion(source, [from, to], [source, target], constants, rule);
    let over = over.map_err(ExhibitError::of(NAME))?;
    let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
    let frames = sample_in_space(to, &over, &times).map_err(ExhibitError::of(NAME))?;
    let gaps = frames.iter().zip(target).map(|(a, b)| (a - b).abs());
    let diagonal = bounds(given.target.frame(0)).diagonal();
    Ok(gaps.fold(0.0, f64::max) / diagonal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::format::write;

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
    #[test]
    fn a_short_motion_shows_the_frames_it_has() {
        let data = tempfile::tempdir().unwrap();
        let gallop = open("@gallop-small").unwrap();
        let some = |name: &str, frames: &[usize]| {
            write(&gallop.select(frames).unwrap(), &data.path().join(name)).unwrap();
        };
        some("horse-gallop", &[0, 1, 2, 3, 4]);
        for name in ["horse-poses", "elephant-poses"] {
            some(name, &[1, 2, 3, 4, 5, 6, 7]);
        }
        some("rest-poses", &[0]);
        let exhibit = exhibit(&DataFolders(vec![data.path().into()])).unwrap();
        assert_eq!(exhibit.datasets[0], "horse-gallop");
    }
}
