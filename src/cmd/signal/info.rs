//! `signal info`: what a representation is.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::super::Outcome;
use super::super::output::{check_place, draft_json, say};
use crate::signal::windows_file::WindowsFile;

pub const EXAMPLES: &str = "Examples:
  meshseq signal fit @roam-small:200 --k 60 --l 50 --m 20 --window 80 -o roam.npz
  meshseq signal info roam.npz --json roam.json";

#[derive(Args)]
pub struct InfoVerb {
    /// A representation that `signal fit` wrote
    representation: PathBuf,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl InfoVerb {
    pub fn run(self) -> Outcome {
        self.json.as_deref().map_or(Ok(()), check_place)?;
        let mut file = WindowsFile::open(&self.representation)?;
        let (plan, mesh) = (file.plan().clone(), file.connectivity().clone());
        let mut lines = Vec::new();
        let mut windows = Vec::new();
        let mut stored_numbers = 0;
        for (j, range) in plan.windows().iter().enumerate() {
            let representation = &file.window(j)?.representation;
            let (first, last) = (range.start + 1, range.end);
            let (k, l, m) = representation.klm();
            let stored = representation.stored_numbers();
            stored_numbers += stored;
            windows.push(json!({
                "first": first, "last": last, "k": k, "l": l, "m": m, "stored_numbers": stored,
            }));
            lines.push(format!(
                "frames {first} to {last}: k = {k}, l = {l}, m = {m}, {stored} numbers"
            ));
        }
        let (n, vertices, faces) = (plan.frame_count(), mesh.vertex_count(), mesh.faces().len());
        let numbers = json!({
            "n": n, "V": vertices, "F": faces, "space": file.space().name(),
            "overlap": plan.overlap(), "windows": windows, "stored_numbers": stored_numbers,
        });
        if let Some(path) = &self.json {
            draft_json(path, &numbers)?.keep()?;
        }
        say(&format!(
            "{}: {} space, n = {n}, V = {vertices}, F = {faces}, {stored_numbers} numbers stored for {} given, {} windows with {} frames in common",
            self.representation.display(),
            file.space().name(),
            3 * n * vertices,
            plan.windows().len(),
            plan.overlap(),
        ));
        lines.iter().for_each(|line| say(line));
        Ok(true)
    }
}
