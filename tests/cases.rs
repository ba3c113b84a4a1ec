//! The cases as data: every file is read, nothing in it is ambiguous, and what is malformed is refused by file and case.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use common::Scratch;
use meshseq::harness::case::{Case, CaseError, read_all, select};
use meshseq::sequence::synthetic::catalogue;
use meshseq::{harness::registry, stages};

fn home() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn cases() -> Vec<Case> {
    read_all(&home().join("bench/cases")).unwrap()
}

#[test]
fn every_stage_has_cases_that_need_no_data_and_one_that_is_timed() {
    let cases = cases();
    for stage in stages::all() {
        let of_stage = || cases.iter().filter(|case| case.stage == stage.name);
        let small = of_stage().filter(|case| case.dataset.ends_with("-small"));
        assert!(
            small.count() >= 2,
            "{} has fewer than two small cases",
            stage.name
        );
        assert!(
            of_stage().any(|case| case.measure),
            "nothing of {} is timed",
            stage.name
        );
    }
}

#[test]
fn names_are_unique_and_say_where_the_case_is() {
    let cases = cases();
    let names: BTreeSet<&str> = cases.iter().map(|case| case.name.as_str()).collect();
    assert_eq!(names.len(), cases.len());
    for case in &cases {
        let folder = case.stage.split('.').next().unwrap();
        assert!(
            case.name.starts_with(&format!("{folder}/")),
            "{} of {}",
            case.name,
            case.stage
        );
        assert_eq!(case.name.matches('/').count(), 2, "{}", case.name);
    }
}

#[test]
fn embedded_datasets_exist_and_have_the_frames_and_constants_asked_for() {
    let sizes: BTreeMap<&str, usize> = catalogue().iter().map(|e| (e.name, e.frames)).collect();
    if sizes.is_empty() {
        println!("skipped: no catalogue of embedded sequences");
        return;
    }
    for case in cases().iter().filter(|case| case.dataset.starts_with('@')) {
        let frames = sizes.get(case.dataset.as_str());
        let frames = frames.unwrap_or_else(|| panic!("{}: no {}", case.name, case.dataset));
        let n = case
            .frames
            .indices(*frames)
            .unwrap_or_else(|e| panic!("{}: {e}", case.name))
            .len();
        let c = &case.choice;
        assert!(
            (4..=n + 2).contains(&c.k),
            "{}: k = {} of {n} frames",
            case.name,
            c.k
        );
        assert!(
            (3..=n).contains(&c.l),
            "{}: l = {} of {n} frames",
            case.name,
            c.l
        );
        assert!(c.m < n, "{}: m = {} of {n} frames", case.name, c.m);
    }
}

#[test]
fn every_stage_has_an_oracle_and_every_oracle_a_stage() {
    let oracles = registry::read(home()).unwrap();
    for stage in stages::all() {
        assert!(
            oracles
                .iter()
                .any(|o| o.stages.iter().any(|s| s == stage.name)),
            "{}",
            stage.name
        );
    }
    let mut pairs = BTreeSet::new();
    for oracle in &oracles {
        for stage in &oracle.stages {
            assert!(stages::find(stage).is_some(), "{}: {stage}", oracle.engine);
            assert!(
                pairs.insert((stage, &oracle.engine)),
                "{} has {stage} twice",
                oracle.engine
            );
        }
        assert!(
            oracle.descent.len() > 10 && oracle.install.len() > 5,
            "{}",
            oracle.engine
        );
    }
}

#[test]
fn patterns_choose_cases() {
    let chosen = |patterns: &[&str]| {
        let patterns: Vec<String> = patterns.iter().map(|p| p.to_string()).collect();
        select(cases(), &patterns).map(|cases| cases.len())
    };
    assert_eq!(chosen(&[]).unwrap(), cases().len());
    assert_eq!(chosen(&["signal/h/gallop-small"]).unwrap(), 1);
    assert!(chosen(&["signal/h"]).unwrap() > 1);
    assert!(chosen(&["*-small"]).unwrap() > chosen(&["signal/*-small"]).unwrap());
    let none = chosen(&["signal/h", "signal/none"]).unwrap_err();
    assert!(matches!(&none, CaseError::NoMatch { pattern } if pattern == "signal/none"));
    assert!(none.to_string().contains("meshseq list"));
}

/// Why a file `sub/bad.toml` with this text is refused.
fn refusal(text: &str) -> String {
    let scratch = Scratch::new();
    fs::create_dir(scratch.at("sub")).unwrap();
    fs::write(scratch.at("sub/bad.toml"), text).unwrap();
    let error = read_all(scratch.path()).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("sub/bad.toml"), "{message}");
    if !matches!(error, CaseError::Toml { .. } | CaseError::File { .. }) {
        assert!(message.contains("case `wave`"), "{message}");
    }
    message
}

const GOOD: &str = "[[case]]\nname = \"wave\"\nstage = \"signal.h\"\ndataset = \"@gallop-small\"\n";

#[test]
fn a_good_case_is_read() {
    let scratch = Scratch::new();
    fs::create_dir(scratch.at("sub")).unwrap();
    fs::write(scratch.at("sub/good.toml"), GOOD).unwrap();
    fs::write(scratch.at("sub/README.md"), "not a case").unwrap();
    let cases = read_all(scratch.path()).unwrap();
    assert_eq!(cases.len(), 1);
    assert_eq!(
        (cases[0].name.as_str(), cases[0].stage),
        ("sub/good/wave", "signal.h")
    );
    assert_eq!(cases[0].frames.indices(3).unwrap(), [0, 1, 2]);
}

#[test]
fn malformed_cases_are_refused_by_file_and_case() {
    let with = |more: &str| refusal(&format!("{GOOD}{more}\n"));
    let check = |tolerance: &str, reason: &str| {
        with(&format!(
            "[[case.check]]\nquantity = \"mean\"\ntolerance = {tolerance}\nreason = \"{reason}\""
        ))
    };
    let says = |message: String, words: &[&str]| {
        for word in words {
            assert!(message.contains(word), "no `{word}` in {message}");
        }
    };
    says(refusal("case = 3"), &["line 1"]);
    says(refusal(""), &["missing field `case`"]);
    says(
        refusal("[[case]]\nname = \"wave\"\n"),
        &["missing field `stage`"],
    );
    says(with("k = \"many\""), &["line 5", "k = \"many\""]);
    says(with("k = -1"), &["line 5", "k = -1"]);
    says(with("speed = 3"), &["line 5", "unknown field `speed`"]);
    says(refusal(&format!("{GOOD}{GOOD}")), &["same name"]);
    says(
        refusal(&GOOD.replace("signal.h", "signal.g")),
        &["no stage `signal.g`", "signal.rbf"],
    );
    says(with("frames = \"4..2\""), &["frames `4..2`", "A..B"]);
    says(with("every = 0"), &["every = 0"]);
    let examples = "examples = [\"@gallop-poses\", \"@trot-poses\"]";
    says(
        with("examples = [\"@gallop-poses\"]"),
        &["line 5", "examples"],
    );
    says(
        with(&format!("resampled = true\n{examples}")),
        &["resampled", "transferred"],
    );
    let read = GOOD.replace("signal.h", "sequence.read");
    says(
        refusal(&format!("{read}resampled = true\n")),
        &["sequence.read", "files"],
    );
    says(with("knots = \"even\""), &["literal", "symmetric", "even"]);
    says(with("timeout_seconds = 0"), &["timeout_seconds = 0"]);
    says(
        with("[case.expect]\nerror_h = \"about 3\""),
        &["about 3", "decimal number"],
    );
    says(
        with("[case.expect]\nerror_h = \"nan\""),
        &["nan", "decimal number"],
    );
    says(check("1e-3", "because"), &["`mean`", "reason"]);
    says(
        check("-1.0", "a reason of some length"),
        &["`mean`", "positive"],
    );
    says(
        check("nan", "a reason of some length"),
        &["`mean`", "positive"],
    );
    let unknown = "[[case.check]]\nquantity = \"beauty\"\ntolerance = 1.0\nreason = \"a reason of some length\"";
    says(with(unknown), &["`beauty`", "signal.h"]);
    let scratch = Scratch::new();
    fs::create_dir(scratch.at("sub")).unwrap();
    fs::write(scratch.at("sub/bad.toml"), [0xff, 0xfe]).unwrap();
    assert!(
        matches!(read_all(scratch.path()), Err(CaseError::File { path, .. }) if path.ends_with("sub/bad.toml"))
    );
    assert!(
        matches!(read_all(&scratch.at("none")), Err(CaseError::File { path, .. }) if path.ends_with("none"))
    );
    for name in ["", "two words", "a/b", "\\u0000"] {
        let text = GOOD.replace("wave", name);
        fs::write(scratch.at("sub/bad.toml"), text).unwrap();
        let error = read_all(scratch.path()).unwrap_err().to_string();
        assert!(error.contains("letters, digits and hyphens"), "{error}");
    }
}
