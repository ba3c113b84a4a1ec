//! `doctor`: each engine, what it answers, its version, and how to get what is missing.

use super::output::say;
use super::{Outcome, home};
use crate::harness::case::read_all;
use crate::harness::session::{Options, Session};

pub fn run() -> Outcome {
    let home = home();
    let cases = read_all(&home.join("bench/cases"))?;
    say(&format!("home: {}", home.display()));
    let options = Options {
        home,
        ..Options::default()
    };
    let session = Session::open(options, &cases)?;
    let rows = session.engines();
    let stages: Vec<String> = rows.iter().map(|row| brief(&row.stages)).collect();
    let width = stages.iter().map(String::len).max().unwrap_or(0);
    let mut missing = 0;
    for (row, stages) in rows.iter().zip(stages) {
        let found = row.missing.is_empty();
        missing += usize::from(!found);
        let (mark, text) = if found {
            ("ok", &row.version)
        } else {
            ("MISSING", &row.missing)
        };
        say(&format!(
            "{mark:<8} {:<14} {stages:<width$}  {text}",
            row.engine
        ));
    }
    if missing > 0 {
        say(&format!(
            "{missing} missing; `scripts/setup` brings all of them where it may install packages"
        ));
    }
    Ok(true)
}

/// The first of some stages, and how many more there are.
fn brief(stages: &str) -> String {
    let mut stages = stages.split_whitespace();
    let first = stages.next().unwrap_or("no stage");
    match stages.count() {
        0 => first.to_owned(),
        more => format!("{first} +{more}"),
    }
}
