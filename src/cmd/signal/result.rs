//! What `transfer` and `design` write: frames, and the representation that they were sampled from.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;

use super::super::Failure;
use super::super::output::draft_json;
use super::super::places::Places;
use super::sample::frames_at;
use crate::mesh::orientation::Orientation;
use crate::sequence::format::write;
use crate::shape::SpaceKind;
use crate::signal::file::{Stored, save};

#[derive(Args)]
pub struct Outputs {
    /// Frames go here: .npz, .pc2 (with an .obj beside it), or a new folder of OBJ frames
    #[arg(short, long, value_name = "OUT")]
    pub out: PathBuf,
    /// Write the representation to this .npz, for `signal sample` and `signal edit`
    #[arg(long, value_name = "FILE")]
    rep: Option<PathBuf>,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// How many faces are newly inside out, and what helps.
pub fn inside_out(numbers: &Value, kind: SpaceKind) -> String {
    let (faces, times) = (&numbers["faces_turned_distinct"], &numbers["faces_turned"]);
    match (times == 0, kind) {
        (true, _) => "no face newly inside out".to_owned(),
        (false, SpaceKind::Vertex) => format!(
            "{faces} faces newly inside out, {times} times in all frames; in gradient space there are often fewer"
        ),
        (false, _) => format!("{faces} faces newly inside out, {times} times in all frames"),
    }
}

impl Outputs {
    /// Refuses places that nothing could be written to, and those of what the verb reads; to be asked before long work.
    pub fn check(&self, reads: Places) -> Result<(), Failure> {
        let rep = self.rep.as_deref();
        rep.map_or(Ok(()), super::check_representation_name)?;
        reads
            .writes_sequence("-o", &self.out)
            .writes("--rep", rep)
            .writes("--json", self.json.as_ref())
            .check()?;
        Ok(())
    }

    /// Writes everything; `numbers` are those of the verb, to which faces are added that are inside out beside the first of `examples` (3V positions each)
    /// though they are not in any of the examples.
    pub fn write(
        &self,
        stored: &Stored,
        examples: &[f64],
        mut numbers: Value,
    ) -> Result<Value, Failure> {
        let n = stored.representation.time.frame_count();
        let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
        let sequence = frames_at(stored, &times, Path::new("the new representation"))?;
        let faces = sequence.connectivity().faces();
        let orientation = Orientation::new(&examples[..sequence.dimension()], faces);
        let before = orientation.not_clear(examples);
        let turned = orientation.newly_turned(sequence.positions(), &before);
        let mut faces: Vec<u32> = turned.iter().flatten().copied().collect();
        numbers["faces_turned"] = faces.len().into();
        faces.sort_unstable();
        faces.dedup();
        numbers["faces_turned_distinct"] = faces.len().into();
        numbers["faces_turned_in_examples"] = before.len().into();
        numbers["turned"] = turned.into();
        let json = self.json.as_ref().map(|path| draft_json(path, &numbers));
        let json = json.transpose()?;
        write(&sequence, &self.out)?;
        if let Some(rep) = &self.rep {
            save(stored, rep)?;
        }
        if let Some(json) = json {
            json.keep()?;
        }
        Ok(numbers)
    }
}
