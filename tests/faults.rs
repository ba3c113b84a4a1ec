//! Every fault is caught by a check, and without a fault every check holds.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use meshseq::harness::case::{Case, read_all};
use meshseq::harness::inject::FAULTS;
use meshseq::harness::record::{AgreementRow, Verdict};
use meshseq::harness::session::{Options, Session};
use meshseq::stages;

fn home() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

/// The cases on small embedded sequences, which need no data and little time.
fn small_cases() -> Vec<Case> {
    let mut cases = read_all(&home().join("bench/cases")).unwrap();
    cases.retain(|case| case.dataset.starts_with('@') && case.dataset.ends_with("-small"));
    cases
}

/// All engines where they are installed, Rust's own checks alone where they are not.
fn open(cases: &[Case]) -> Session {
    let installed = home().join("target/oracles/venv/bin/python").is_file();
    let engines = match installed {
        true => Vec::new(),
        false => {
            println!(
                "skipped oracles: target/oracles/venv is not there; `scripts/setup python` makes it"
            );
            vec!["tobj".into()]
        }
    };
    let options = Options {
        home: home(),
        engines,
        ..Options::default()
    };
    Session::open(options, cases).unwrap()
}

fn failed(row: &AgreementRow) -> bool {
    matches!(
        row.verdict,
        Verdict::Differ | Verdict::Error | Verdict::Timeout
    )
}

/// The engine and the check that failed by most.
fn describe(row: &AgreementRow) -> String {
    let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.1e}"));
    let quantity = row.quantity.as_deref().unwrap_or("");
    let (value, tolerance) = (number(row.value), number(row.tolerance));
    format!(
        "{} {} {}: {quantity} {value} > {tolerance} {}",
        row.case, row.engine, row.verdict, row.message
    )
}

#[test]
fn there_are_at_least_25_faults_and_every_stage_has_one() {
    assert!(FAULTS.len() >= 25, "{}", FAULTS.len());
    for stage in stages::all() {
        assert!(
            FAULTS.iter().any(|f| f.stage == stage.name),
            "no fault in {}",
            stage.name
        );
    }
    let mut names: Vec<&str> = FAULTS.iter().map(|f| f.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), FAULTS.len());
    for fault in FAULTS {
        assert!(
            stages::find(fault.stage).is_some(),
            "{}: no stage {}",
            fault.name,
            fault.stage
        );
    }
}

/// One session for everything: engines are started once, and each fault takes the place of Rust's own engine in turn.
#[test]
fn every_fault_is_caught_and_nothing_else_is() {
    let cases = small_cases();
    let mut session = open(&cases);
    let record = session.run(&cases, |_| ());
    let wrong: Vec<String> = record
        .agreement
        .iter()
        .filter(|r| failed(r))
        .map(describe)
        .collect();
    assert!(wrong.is_empty(), "without a fault:\n{}", wrong.join("\n"));
    let asked = record.agreement.len();
    let missing = record
        .agreement
        .iter()
        .filter(|r| r.verdict == Verdict::Missing)
        .count();
    println!("{asked} verdicts without a fault, {missing} of them missing");

    let mut let_through = Vec::new();
    let mut witnesses: BTreeMap<&str, usize> = BTreeMap::new();
    for fault in FAULTS {
        session.inject(Some(fault));
        let of_stage = cases.iter().filter(|case| case.stage == fault.stage);
        let caught = of_stage.into_iter().find_map(|case| {
            let record = session.run(std::slice::from_ref(case), |_| ());
            let by_rust = record
                .agreement
                .iter()
                .find(|r| failed(r) && r.engine == "rust");
            by_rust
                .or(record.agreement.iter().find(|r| failed(r)))
                .cloned()
        });
        match caught {
            Some(row) => {
                println!("{:<28} {}", fault.name, describe(&row));
                let witness = if row.engine == "rust" {
                    "own checks"
                } else {
                    "oracles only"
                };
                *witnesses.entry(witness).or_default() += 1;
            }
            None => let_through.push(format!("{} ({}: {})", fault.name, fault.stage, fault.about)),
        }
    }
    println!(
        "{} faults: {witnesses:?}, let through: {let_through:?}",
        FAULTS.len()
    );
    assert!(let_through.is_empty(), "let through: {let_through:#?}");

    session.inject(None);
    let record = session.run(&cases[..1], |_| ());
    assert!(!record.agreement.iter().any(failed), "a fault stayed");
}
