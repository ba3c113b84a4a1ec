//! `list`: cases, stages, engines, faults.

use clap::Args;

use super::output::say;
use super::{Outcome, home};
use crate::harness::case::{read_all, select};
use crate::harness::inject::FAULTS;
use crate::harness::registry;
use crate::stages;

#[derive(Args)]
pub struct List {
    /// Cases or folders of cases; all if none is given
    #[arg(value_name = "CASE")]
    cases: Vec<String>,
    /// The stages, and which engines have them, as a Markdown table
    #[arg(long, conflicts_with = "cases")]
    engines: bool,
    /// The faults of `verify --inject`
    #[arg(long, conflicts_with_all = ["cases", "engines"])]
    faults: bool,
}

impl List {
    pub fn run(self) -> Outcome {
        if self.engines {
            return engines();
        }
        if self.faults {
            for fault in FAULTS {
                say(&format!(
                    "{:<28} {:<18} {}",
                    fault.name, fault.stage, fault.about
                ));
            }
            return Ok(true);
        }
        for case in select(read_all(&home().join("bench/cases"))?, &self.cases)? {
            let timed = if case.measure { "timed" } else { "" };
            say(&format!(
                "{:<34} {:<18} {:<16} {timed}",
                case.name, case.stage, case.dataset
            ));
        }
        Ok(true)
    }
}

fn engines() -> Outcome {
    let oracles = registry::read(&home())?;
    say("| stage | engines | what it does |\n|---|---|---|");
    for stage in stages::all() {
        let mut names = vec!["rust"];
        if stage.name == "sequence.read" {
            names.push("tobj");
        }
        let having = oracles
            .iter()
            .filter(|o| o.stages.iter().any(|s| s == stage.name));
        names.extend(having.map(|o| o.engine.as_str()));
        say(&format!(
            "| `{}` | {} | {} |",
            stage.name,
            names.join(", "),
            stage.about
        ));
    }
    Ok(true)
}
