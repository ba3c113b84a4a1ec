//! Rust libraries that serve as oracles inside this process.

use std::path::PathBuf;
use std::time::Instant;

use super::engine::{Engine, Outcome, Question};
use crate::mesh::measure::measure;
use crate::mesh::topology::Topology;
use crate::sequence::format::peer_tobj::{PeerFrame, read_with_tobj};
use crate::stages::sequence::measured;

/// The tobj crate: an independent reader of the same OBJ files, which renumbers vertices and holds f32.
pub struct Tobj;

impl Engine for Tobj {
    fn name(&self) -> &str {
        "tobj"
    }

    fn stages(&self) -> Vec<String> {
        vec!["sequence.read".into()]
    }

    fn descent(&self) -> &str {
        "the tobj crate's OBJ reader, f32; vertices no face uses are dropped"
    }

    fn version(&mut self) -> Result<String, Outcome> {
        Ok("tobj 4, in this process".into())
    }

    fn ask(&mut self, question: &Question) -> Outcome {
        let paths: Vec<PathBuf> = match question.inputs.text("paths") {
            Ok(paths) => paths.lines().map(PathBuf::from).collect(),
            Err(error) => return Outcome::Error(error.to_string()),
        };
        let mut frames = Vec::new();
        let mut seconds = Vec::new();
        for _ in 0..question.samples {
            let start = Instant::now();
            for _ in 0..question.batch {
                frames = match read_with_tobj(&paths) {
                    Ok(frames) => frames,
                    Err(error) => return Outcome::Error(error.to_string()),
                };
            }
            seconds.push(start.elapsed().as_secs_f64() / question.batch as f64);
        }
        let (counts, measures): (Vec<_>, Vec<_>) = frames.iter().map(measure_frame).unzip();
        Outcome::Answer {
            outputs: measured(&counts, &measures),
            seconds,
        }
    }
}

fn measure_frame(frame: &PeerFrame) -> ([usize; 3], crate::mesh::measure::Measures) {
    let positions: Vec<f64> = frame.positions.iter().map(|&x| f64::from(x)).collect();
    let boundary = Topology::new(&frame.triangles).boundary().count();
    (
        [frame.vertex_count(), frame.triangles.len(), boundary],
        measure(&positions, &frame.triangles),
    )
}
