//! Stages on the meshes of a sequence as such.

use std::sync::Arc;

use super::{Call, Stage, StageError, call};
use crate::arrays::{Array, Bundle};
use crate::mesh::Connectivity;
use crate::mesh::measure::{Measures, measure_frames};
use crate::mesh::self_intersections::{SelfIntersections, self_intersections_of_frames};
use crate::sequence::Sequence;

/// Measuring.
pub static STAGES: &[Stage] = &[Stage {
    name: "mesh.quality",
    about: "what a sequence is as surfaces: area, volume, self-intersections of every frame",
    prepare: quality,
}];

/// The inputs of `mesh.quality`.
pub fn inputs(sequence: &Sequence) -> Bundle {
    let (n, vertices) = (sequence.frame_count(), sequence.dimension() / 3);
    Bundle::from([
        (
            "frames",
            Array::F64 {
                shape: vec![n, vertices, 3],
                data: sequence.positions().to_vec(),
            },
        ),
        ("F", Array::triangles(sequence.connectivity().faces())),
    ])
}

fn quality(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let (shape, frames) = inputs.f64("frames", 3)?;
    if shape[2] != 3 {
        return Err(StageError::Failed(format!(
            "`frames` has shape {shape:?}, expected (n, V, 3)"
        )));
    }
    let mesh = Connectivity::new(shape[1], inputs.triangles("F")?);
    let mesh = mesh.map_err(StageError::from_error)?;
    let sequence = Sequence::new(Arc::new(mesh), shape[0], frames.to_vec());
    let sequence = sequence.map_err(StageError::from_error)?;
    call(
        move || {
            let (x, d) = (sequence.positions(), sequence.dimension());
            let faces = sequence.connectivity().faces();
            let meetings = self_intersections_of_frames(x, d, faces);
            all_have_area(&meetings)?;
            Ok((measure_frames(x, d, faces), meetings))
        },
        |(measures, meetings)| {
            let numbers = |of: fn(&Measures) -> f64| {
                Array::vector(&measures.iter().map(of).collect::<Vec<_>>())
            };
            let counts = |of: fn(&SelfIntersections) -> usize| {
                Array::indices(&meetings.iter().map(of).collect::<Vec<_>>())
            };
            Bundle::from([
                ("area", numbers(|m| m.area)),
                ("volume", numbers(|m| m.volume)),
                ("intersections", counts(|m| m.pairs)),
                ("intersecting_faces", counts(|m| m.faces.len())),
            ])
        },
    )
}

fn all_have_area(meetings: &[SelfIntersections]) -> Result<(), StageError> {
    let flat = (1..)
        .zip(meetings)
        .find_map(|(i, m)| Some((i, m.without_area.first()?)));
    match flat {
        Some((frame, face)) => Err(StageError::Failed(format!(
            "frame {frame} (1-based): face {face} (0-based) has no area; self-intersections are those of triangles that have one"
        ))),
        None => Ok(()),
    }
}
