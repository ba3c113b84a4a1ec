//! Every frame into every shape space and back (section 5): how far it comes back from where it was.

use rayon::prelude::*;

use super::signals::present;
use super::{Exhibit, ExhibitError, Panel, Table};
use crate::mesh::measure::bounds;
use crate::sequence::Sequence;
use crate::sequence::dataset::{DataFolders, open};
use crate::shape::{ShapeError, SpaceKind, encode_all, prepare_for};

const NAME: &str = "round-trip";
/// Shown always, and shown where there is the data.
const EMBEDDED: [&str; 3] = ["@gallop", "@flag", "@face"];
const REAL: [&str; 5] = ["horse-gallop", "cow", "samba", "face-poses", "cat-poses"];

/// A table over sequences and spaces.
pub fn exhibit(data: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let mut sequences = Vec::new();
    for name in EMBEDDED {
        sequences.push((name, open(name)?));
    }
    for name in REAL {
        let found = present(data.sequence(name))?;
        sequences.extend(found.map(|sequence| (name, sequence)));
    }
    let rows: Result<Vec<_>, _> = sequences.iter().map(|(name, s)| row(name, s)).collect();
    Ok(Exhibit {
        name: NAME.into(),
        title: "There and back: every frame through every shape space".into(),
        look: "Look at the exponents: a space that decodes what it encoded loses nothing but rounding, which thin triangles magnify. Asked for are 1e-11 \
               in `gradient` and `lric`, 1e-8 in `lengths` and `patch`."
            .into(),
        datasets: sequences.iter().map(|(name, _)| (*name).into()).collect(),
        panels: vec![Panel::Table(table(rows.map_err(ExhibitError::of(NAME))?))],
    })
}

fn row(name: &str, sequence: &Sequence) -> Result<Vec<String>, ShapeError> {
    let mut cells = vec![name.to_owned(), sequence.frame_count().to_string()];
    for kind in SpaceKind::ALL {
        cells.push(format!("{:.1e}", greatest(kind, sequence)?));
    }
    Ok(cells)
}

/// The greatest difference of a coordinate over all frames, over the diagonal of the first. Holds one frame a thread beside what is encoded.
fn greatest(kind: SpaceKind, sequence: &Sequence) -> Result<f64, ShapeError> {
    let space = prepare_for(kind, sequence.connectivity(), sequence.positions())?;
    let z = encode_all(&*space, sequence.positions())?;
    let gaps: Result<Vec<f64>, ShapeError> = (0..sequence.frame_count())
        .into_par_iter()
        .map(|i| {
            let mut back = vec![0.0; space.frame_len()];
            space.decode(z.col_as_slice(i), &mut back)?;
            let both = back.iter().zip(sequence.frame(i));
            Ok(both.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max))
        })
        .collect();
    let most = gaps?.into_iter().fold(0.0, f64::max);
    Ok(most / bounds(sequence.frame(0)).diagonal())
}

fn table(rows: Vec<Vec<String>>) -> Table {
    let spaces = SpaceKind::ALL.iter().map(|kind| kind.to_string());
    Table {
        caption: "Greatest difference of a coordinate from where it was, over the diagonal of the first frame".into(),
        heads: ["sequence".into(), "frames".into()].into_iter().chain(spaces).collect(),
        rows,
    }
}
