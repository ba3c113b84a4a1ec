//! What `transfer` and `design` write: frames, and the representation that they were sampled from.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;

use super::super::Failure;
use super::super::output::{check_place, draft_json};
use super::sample::frames_at;
use crate::mesh::orientation::Orientation;
use crate::sequence::Sequence;
use crate::sequence::format::write;
use crate::signal::file::{Stored, save};

#[derive(Args)]
pub struct Outputs {
    /// Frames go here: .npz, .pc2 (with an .obj beside it), or a folder of OBJ frames
    #[arg(short, long, value_name = "OUT")]
    pub out: PathBuf,
    /// Write the representation to this .npz, for `signal sample` and `signal edit`
    #[arg(long, value_name = "FILE")]
    rep: Option<PathBuf>,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl Outputs {
    /// Refuses places that nothing could be written to; to be asked before long work.
    pub fn check(&self) -> Result<(), Failure> {
        if let Some(rep) = &self.rep {
            super::check_representation_place(rep)?;
            if rep == &self.out {
                let place = rep.display();
                return Err(format!(
                    "{place}: -o and --rep name one file; frames and representation are two"
                )
                .into());
            }
        }
        Ok(self.json.as_deref().map_or(Ok(()), check_place)?)
    }

    /// Writes everything; `numbers` are those of the verb, to which faces that are inside out are added, counted against `rest`.
    pub fn write(
        &self,
        stored: &Stored,
        rest: &[f64],
        mut numbers: Value,
    ) -> Result<Value, Failure> {
        let n = stored.representation.time.frame_count();
        let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
        let sequence = frames_at(stored, &times, Path::new("the new representation"))?;
        let turned = turned_faces(&sequence, rest);
        numbers["faces_turned"] = turned.iter().sum::<usize>().into();
        numbers["faces_turned_in_a_frame"] = turned.iter().max().copied().unwrap_or(0).into();
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

/// How many faces of each frame are inside out, beside a frame that is not.
fn turned_faces(sequence: &Sequence, rest: &[f64]) -> Vec<usize> {
    let orientation = Orientation::new(rest, sequence.connectivity().faces());
    let frames = 0..sequence.frame_count();
    frames
        .map(|i| orientation.turned(sequence.frame(i)).len())
        .collect()
}
