//! `report`: the HTML page of a record, and the README's table and picture.

use std::path::PathBuf;

use clap::Args;

use super::output::{say, write_whole};
use super::{Failure, Outcome};
use crate::harness::record::Record;
use crate::report::{self, PublishedRow};

#[derive(Args)]
pub struct Report {
    /// A record: a folder that `verify` or `measure` wrote
    record: PathBuf,
    /// Put the record's table and picture into this README, between its markers
    #[arg(long, value_name = "FILE")]
    splice: Option<PathBuf>,
}

/// The page of a record.
pub fn page(record: &Record) -> Result<String, Failure> {
    Ok(report::html(record, &PublishedRow::table_1()?))
}

impl Report {
    pub fn run(self) -> Outcome {
        let record = Record::read(&self.record)?;
        let table = report::table_1_text(&record, &PublishedRow::table_1()?);
        if !table.is_empty() {
            say(&table);
        }
        let path = self.record.join("report.html");
        write_whole(&path, &page(&record)?)?;
        say(&format!(
            "report: {}",
            std::path::absolute(&path)?.display()
        ));
        if let Some(readme) = self.splice {
            let text = std::fs::read_to_string(&readme)
                .map_err(|e| format!("--splice {}: {e}", readme.display()))?;
            let text = report::splice(&text, "results", &report::readme_table(&record))?;
            write_whole(&readme, &text)?;
            if let Some(picture) = report::readme_picture(&record) {
                write_whole(
                    &readme.with_file_name("docs").join("time-signal.svg"),
                    &picture,
                )?;
            }
        }
        Ok(true)
    }
}
