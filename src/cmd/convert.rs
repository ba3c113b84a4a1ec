//! `convert SEQ OUT`: another format.

use std::path::PathBuf;

use clap::Args;

use super::output::say;
use super::places::Places;
use super::{FrameChoice, Outcome};
use crate::sequence::format::write;

#[derive(Args)]
pub struct Convert {
    /// A folder or pattern of OBJ frames, an .npz, a .pc2, or @name
    sequence: String,
    /// Where to: .npz, .pc2 (with an .obj beside it), or a new folder of OBJ frames
    out: PathBuf,
    #[command(flatten)]
    frames: FrameChoice,
}

impl Convert {
    pub fn run(self) -> Outcome {
        let places = Places::default().reads_sequence("<SEQUENCE>", &self.sequence);
        places.writes_sequence("<OUT>", &self.out).check()?;
        let sequence = self.frames.open(&self.sequence)?;
        write(&sequence, &self.out)?;
        say(&format!(
            "{}: {} frames",
            self.out.display(),
            sequence.frame_count()
        ));
        Ok(true)
    }
}
