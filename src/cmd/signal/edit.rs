//! `signal edit` (section 4.1).

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::super::Outcome;
use super::super::output::{draft_json, say};
use super::super::places::Places;
use super::tables::read_text;
use crate::signal::edit::edit;
use crate::signal::edits_toml::parse;
use crate::signal::file::{Stored, load, save};
use crate::signal::psi::Representation;

pub const EXAMPLES: &str = "Examples:
  meshseq signal fit @gallop-small --tolerance 0.01 -o gallop.npz
  printf '[[edit]]\\ndo = \"repeat\"\\nframes = \"1..12\"\\ntimes = 2\\n' > edits.toml
  meshseq signal edit gallop.npz edits.toml -o longer.npz

An edit is a table [[edit]] with `do` and:
  do = \"move\"     control = 5, by = [0.2, -0.1] or to = [x, y] in pose space
  do = \"loop\"     after = 40, through = [[x, y], ..]; frames = 19, control = 15
  do = \"delete\"   frames = \"3..5\"; join = 2
  do = \"repeat\"   frames = \"1..12\"; times = 2, join = 3
  do = \"reverse\"  frames = \"1..12\"; join = 3
  do = \"refine\"   frames = \"3..5\": more control points there, the same curve
Frames and control points count from 1. What stands after `;` may be left out: `frames` is then as
many as keep the mean pace, `control` in proportion, `times` (in addition to the first) 1, `join`,
the new frames at each seam, 0. A loop runs through its points as nearly as its control points let
it: with fewer of them than it has turns it cuts corners. `signal info --places` and `--json` show where frames and control
points are.";

#[derive(Args)]
pub struct EditVerb {
    /// A representation: what `signal fit` or `edit` wrote, or `transfer` or `design` with --rep
    representation: PathBuf,
    /// The edits, in order
    edits: PathBuf,
    /// Write the new representation to this .npz
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl EditVerb {
    pub fn run(self) -> Outcome {
        super::check_representation_name(&self.out)?;
        Places::default()
            .reads("<REPRESENTATION>", Some(&self.representation))
            .reads("<EDITS>", Some(&self.edits))
            .writes("-o", Some(&self.out))
            .writes("--json", self.json.as_ref())
            .check()?;
        let stored = load(&self.representation)?;
        let place = self.edits.display();
        let edits = parse(&read_text(&self.edits, "edits")?);
        let edits = edits.map_err(|e| format!("{place}: {e}; see `meshseq signal edit --help`"))?;
        let time = &stored.representation.time;
        let edited = edit(time, &edits).map_err(|e| format!("{place}: {e}"))?;
        let (k, n) = (time.spline.control.len(), time.frame_count());
        let kept = edited.kept.iter().filter(|&&kept| kept).count();
        let (new_k, new_n) = (edited.time.spline.control.len(), edited.sources.len());
        let sources: Vec<Option<usize>> = edited.sources.iter().map(|s| s.map(|i| i + 1)).collect();
        let others = ranges(&edited.kept);
        let numbers = json!({
            "n_before": n, "k_before": k, "n": new_n, "k": new_k, "frames_kept": kept,
            "sources": sources, "kept": edited.kept,
        });
        let changed = Stored {
            positions: edited.positions(&stored.positions),
            representation: Representation {
                time: edited.time,
                ..stored.representation
            },
            ..stored
        };
        let json = self.json.as_ref().map(|path| draft_json(path, &numbers));
        let json = json.transpose()?;
        save(&changed, &self.out)?;
        if let Some(json) = json {
            json.keep()?;
        }
        say(&format!(
            "{}: (k, n) = ({k}, {n}) before and ({new_k}, {new_n}) now, {kept} frames as they were, bit for bit{}",
            self.out.display(),
            match others.is_empty() {
                true => String::new(),
                false => format!("; new or changed: {others}"),
            }
        ));
        Ok(true)
    }
}

/// The runs of frames that are not kept, from 1 on, such as `4..6, 9`.
fn ranges(kept: &[bool]) -> String {
    let mut frame = 1;
    let mut runs = Vec::new();
    for run in kept.chunk_by(|a, b| a == b) {
        let last = frame + run.len() - 1;
        match run {
            [true, ..] => {}
            [_] => runs.push(frame.to_string()),
            _ => runs.push(format!("{frame}..{last}")),
        }
        frame = last + 1;
    }
    runs.join(", ")
}
