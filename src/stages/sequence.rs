//! Stages on sequences as such: reading them, and distances between them.

use std::path::PathBuf;

use rayon::prelude::*;

use super::{Call, Stage, StageError, call};
use crate::arrays::{Array, Bundle};
use crate::mesh::Connectivity;
use crate::mesh::distance::vertex_to_surface;
use crate::mesh::measure::{Measures, measure_frames};
use crate::mesh::topology::Topology;
use crate::sequence::format::read_files;

/// Reading and measuring.
pub static STAGES: &[Stage] = &[
    Stage {
        name: "sequence.read",
        about: "OBJ frames read back: counts, area, volume, bounds",
        prepare: read,
    },
    Stage {
        name: "sequence.distance",
        about: "distance of each frame's vertices to another frame's surface: greatest and mean",
        prepare: distance,
    },
];

fn read(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let paths: Vec<PathBuf> = inputs.text("paths")?.lines().map(PathBuf::from).collect();
    call(
        move || read_files(&paths).map_err(StageError::from_error),
        |sequence| {
            let faces = sequence.connectivity().faces();
            let vertices = sequence.connectivity().vertex_count();
            let boundary = Topology::new(faces).boundary().count();
            let measures = measure_frames(sequence.positions(), sequence.dimension(), faces);
            measured(
                &vec![[vertices, faces.len(), boundary]; measures.len()],
                &measures,
            )
        },
    )
}

/// The outputs of `sequence.read`.
pub fn measured(counts: &[[usize; 3]], measures: &[Measures]) -> Bundle {
    let numbers = |m: &Measures| {
        let [min, max] = [m.bounds.min, m.bounds.max];
        [
            m.area, m.volume, min[0], min[1], min[2], max[0], max[1], max[2],
        ]
    };
    Bundle::from([
        (
            "counts",
            Array::I64 {
                shape: vec![counts.len(), 3],
                data: counts.as_flattened().iter().map(|&c| c as i64).collect(),
            },
        ),
        (
            "measures",
            Array::F64 {
                shape: vec![measures.len(), 8],
                data: measures.iter().flat_map(numbers).collect(),
            },
        ),
    ])
}

fn distance(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let (shape, a) = inputs.f64("A", 3)?;
    let (other, b) = inputs.f64("B", 3)?;
    if shape != other || shape[2] != 3 {
        return Err(StageError::Failed(format!(
            "`A` has shape {shape:?} and `B` {other:?}, expected the same (n, V, 3)"
        )));
    }
    let d = 3 * shape[1];
    let faces = inputs.triangles("F")?;
    Connectivity::new(shape[1], faces.clone()).map_err(StageError::from_error)?;
    let (a, b) = (a.to_vec(), b.to_vec());
    call(
        move || {
            let pairs = a.par_chunks(d).zip(b.par_chunks(d));
            Ok(pairs
                .map(|(a, b)| vertex_to_surface(a, b, &faces))
                .collect())
        },
        |found: &Vec<(f64, f64)>| {
            let list = |pick: fn(&(f64, f64)) -> f64| {
                Array::vector(&found.iter().map(pick).collect::<Vec<_>>())
            };
            Bundle::from([("hausdorff", list(|d| d.0)), ("mean", list(|d| d.1))])
        },
    )
}
