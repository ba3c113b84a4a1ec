//! `doctor`: each engine, its version, and how to get what is missing.

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
    let mut missing = 0;
    for row in session.engines() {
        let found = row.missing.is_empty();
        missing += usize::from(!found);
        let (mark, text) = if found {
            ("ok", &row.version)
        } else {
            ("MISSING", &row.missing)
        };
        say(&format!(
            "{mark:<8} {:<14} {:<30} {text}",
            row.engine,
            row.stages
                .replace("signal", "s")
                .replace("sequence", "q")
                .chars()
                .take(30)
                .collect::<String>()
        ));
    }
    if missing > 0 {
        say(&format!(
            "{missing} missing; `scripts/setup` brings all of them where it may install packages"
        ));
    }
    Ok(true)
}
