//! `data`: what sequences there are to work on.

use std::path::PathBuf;

use clap::Args;

use super::output::say;
use super::{Outcome, home};
use crate::harness::case::read_all;
use crate::sequence::dataset::DataFolders;
use crate::sequence::synthetic::catalogue;

#[derive(Args)]
pub struct Data {
    /// Folder of real data; MESHSEQ_DATA serves too
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

impl Data {
    pub fn run(self) -> Outcome {
        say("embedded, made when asked for:");
        for entry in catalogue() {
            let size = format!("n={} V={} F={}", entry.frames, entry.vertices, entry.faces);
            say(&format!(
                "  {:<20} {size:<24} {}",
                entry.name, entry.summary
            ));
        }
        let folders = DataFolders::new(self.data.as_deref());
        say("real, named by cases:");
        let mut names: Vec<String> = read_all(&home().join("bench/cases"))?
            .into_iter()
            .map(|case| case.dataset)
            .filter(|name| !name.starts_with('@'))
            .collect();
        names.sort();
        names.dedup();
        for name in names {
            match folders.files(&name) {
                Ok(files) => say(&format!(
                    "  {name:<14} {} files in {}",
                    files.len(),
                    place(&files)
                )),
                Err(why) => say(&format!("  {name:<14} {why}")),
            }
        }
        Ok(true)
    }
}

fn place(files: &[PathBuf]) -> String {
    let folder = files.first().and_then(|file| file.parent());
    folder.map_or_else(String::new, |folder| folder.display().to_string())
}
