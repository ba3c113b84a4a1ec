//! `compare A B`: two records.

use std::path::PathBuf;

use clap::Args;

use super::Outcome;
use super::output::say;
use crate::harness::compare::compare;
use crate::harness::record::Record;

#[derive(Args)]
pub struct Compare {
    /// The earlier record
    before: PathBuf,
    /// The later record
    after: PathBuf,
}

impl Compare {
    pub fn run(self) -> Outcome {
        let changes = compare(&Record::read(&self.before)?, &Record::read(&self.after)?);
        for change in &changes {
            let mark = if change.worse { "worse" } else { "changed" };
            say(&format!(
                "{mark:<8} {:<34} {:<14} {}: {} -> {}",
                change.case, change.engine, change.what, change.before, change.after
            ));
        }
        let worse = changes.iter().filter(|c| c.worse).count();
        say(&format!("{} changes, {worse} worse", changes.len()));
        Ok(worse == 0)
    }
}
