//! Oracles that hang, crash, write garbage or lie: each costs its own verdict, with the reason, and nothing else.
#![cfg(unix)]

#[path = "../common/mod.rs"]
mod common;

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

use common::{MESHSEQ, Scratch, text};
use meshseq::harness::case::read_all;
use meshseq::harness::record::{AgreementRow, Record, Verdict};
use meshseq::harness::session::{Event, Options, Session};

use Verdict::{Agree, Differ, Error, Missing, Timeout, Unsupported};

/// What an oracle does; its verdict on the first case, words of the reason, and its verdict on the second case.
const HOSTILE: &[(&str, Verdict, &[&str], Verdict)] = &[
    ("honest", Agree, &[], Agree),
    (
        "hangs",
        Timeout,
        &["no answer in 2s", "thinking hard"],
        Agree,
    ),
    (
        "floods-and-hangs",
        Timeout,
        &["no answer in 2s", "a line | xxx"],
        Agree,
    ),
    ("half-a-reply", Timeout, &["no answer in 2s"], Agree),
    ("breaks-off", Error, &["broke off", "out of ink"], Error),
    (
        "crashes",
        Error,
        &[
            "ended without an answer",
            "signal: 11",
            "stack overflow | second line",
        ],
        Agree,
    ),
    ("ends", Error, &["exit status: 7", "had enough"], Agree),
    ("closes-its-output", Error, &["closed its output"], Agree),
    (
        "hangs-at-version",
        Timeout,
        &["no answer in 5s", "downloading weather data"],
        Timeout,
    ),
    (
        "crashes-at-start",
        Missing,
        &[
            "exit status: 1",
            "No module named 'scipy'",
            "to get it: pray",
        ],
        Missing,
    ),
    ("garbage-at-version", Error, &["not a message"], Error),
    ("no-version", Error, &["version"], Error),
    (
        "absent",
        Missing,
        &["cannot start", "to get it: pray"],
        Missing,
    ),
    ("garbage", Error, &["not a message"], Error),
    ("chats", Error, &["not a message"], Error),
    (
        "trillion-numbers",
        Error,
        &["out.t", "[1000000000000]"],
        Error,
    ),
    ("million-records", Error, &["1000000 records"], Error),
    ("rank-200", Error, &["200 dimensions"], Error),
    (
        "same-name-twice",
        Error,
        &["two records named `out.t`"],
        Error,
    ),
    ("nan", Error, &["not finite", "t[3] = NaN"], Error),
    ("infinity", Error, &["not finite", "= inf"], Error),
    ("huge", Error, &["not finite", "t["], Error),
    (
        "wrong-shape",
        Error,
        &["array `t`", "expected shape"],
        Error,
    ),
    ("empty", Error, &["array `t`", "expected shape"], Error),
    (
        "text-for-numbers",
        Error,
        &["array `t`", "found text"],
        Error,
    ),
    (
        "lacks-an-array",
        Error,
        &["array `t`", "expected it to be there"],
        Error,
    ),
    ("no-status", Error, &["`status`"], Error),
    ("odd-status", Error, &["unknown status `fine`"], Error),
    ("no-time", Error, &["`seconds`"], Error),
    ("time-travels", Error, &["positive times", "-1"], Error),
    ("endless-time", Error, &["positive times", "inf"], Error),
    (
        "unsupported",
        Unsupported,
        &["only for even n"],
        Unsupported,
    ),
    ("fails", Error, &["singular matrix"], Error),
    ("differs", Differ, &[], Differ),
    ("answers-twice", Agree, &[], Error),
    ("floods", Agree, &[], Agree),
    ("honest-to-the-end", Agree, &[], Agree),
];

const CASES: &str = r#"
[[case]]
name = "first"
stage = "signal.parameters"
dataset = "@gallop-small"
k = 8
l = 6
m = 4
timeout_seconds = 2

[[case]]
name = "second"
stage = "signal.parameters"
dataset = "@gallop-small"
k = 8
l = 6
m = 5
"#;

/// A checkout with these oracles and two cases.
fn home(modes: &[&str]) -> Scratch {
    let home = Scratch::new();
    fs::create_dir_all(home.at("oracles")).unwrap();
    fs::create_dir_all(home.at("bench/cases")).unwrap();
    fs::write(home.at("bench/cases/hostile.toml"), CASES).unwrap();
    fs::write(home.at("oracles/hostile.py"), include_str!("hostile.py")).unwrap();
    let entry = |mode: &&str| {
        let program = if *mode == "absent" {
            "no-such-program"
        } else {
            "python3"
        };
        let memory = home.arg(&format!("has-been-{mode}"));
        let seconds = if *mode == "hangs-at-version" { 5 } else { 60 };
        format!(
            "[[oracle]]\nengine = \"{mode}\"\nstages = [\"signal.parameters\"]\ndescent = \"none\"\ninstall = \"pray\"\n\
             command = [\"{program}\", \"hostile.py\", \"{mode}\", \"{memory}\"]\nstart_seconds = {seconds}\n"
        )
    };
    let registry: String = modes.iter().map(entry).collect();
    fs::write(home.at("oracles/oracles.toml"), registry).unwrap();
    home
}

fn has_python() -> bool {
    let found = Command::new("python3").arg("--version").output().is_ok();
    if !found {
        println!("skipped oracles: no python3");
    }
    found
}

/// Processes whose command line holds this text, and our own children that nobody has waited for.
fn processes(of: &str) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let read = |name: &str| fs::read(entry.path().join(name)).unwrap_or_default();
        let (command, stat) = (text(&read("cmdline")), text(&read("stat")));
        let after_name: Vec<&str> = stat.rsplit(") ").next().unwrap_or("").split(' ').collect();
        let zombie = after_name.starts_with(&["Z", &std::process::id().to_string()]);
        if command.contains(of) || zombie {
            found.push(format!("{command} {stat}"));
        }
    }
    found
}

/// None of them is left, now or in a moment: other tests of this program wait for children of their own.
#[track_caller]
fn assert_gone(of: &str) {
    let deadline = Instant::now() + Duration::from_secs(5);
    while !processes(of).is_empty() && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(processes(of), [""; 0]);
}

#[test]
fn each_costs_one_verdict_and_never_the_run() {
    if !has_python() {
        return;
    }
    let modes: Vec<&str> = HOSTILE.iter().map(|h| h.0).collect();
    let home = home(&modes);
    let cases = read_all(&home.at("bench/cases")).unwrap();
    let options = Options {
        home: home.path().to_owned(),
        ..Options::default()
    };
    let mut session = Session::open(options, &cases).unwrap();
    let mut told = 0;
    let record = session.run(&cases, |event| {
        if let Event::Judged(_, judged) = event {
            told += judged.len();
        }
    });
    assert_eq!(told, 2 * (1 + HOSTILE.len()));
    assert_eq!(record.agreement.len(), told);
    let rows = |case: &str| -> BTreeMap<&str, &AgreementRow> {
        let of_case = record.agreement.iter().filter(|row| row.case == case);
        of_case.map(|row| (row.engine.as_str(), row)).collect()
    };
    let (first, second) = (rows("hostile/first"), rows("hostile/second"));
    assert_eq!(
        (first["rust"].verdict, second["rust"].verdict),
        (Agree, Agree)
    );
    for (mode, on_first, words, on_second) in HOSTILE {
        let row = first[mode];
        println!("{mode:<20} {:<12} {}", row.verdict, row.message);
        assert_eq!(row.verdict, *on_first, "{mode}: {}", row.message);
        for word in *words {
            assert!(
                row.message.contains(word),
                "{mode}: no `{word}` in {}",
                row.message
            );
        }
        assert!(
            row.message.chars().count() < 1000,
            "{mode}: {}",
            row.message
        );
        assert!(!row.message.contains('\u{1b}'), "{mode}: {}", row.message);
        let row = second[mode];
        assert_eq!(
            row.verdict, *on_second,
            "{mode}, second case: {}",
            row.message
        );
    }
    assert!(second["answers-twice"].message.contains("nobody asked for"));
    // What differs says by how much.
    assert_eq!(first["differs"].quantity.as_deref(), Some("t_difference"));
    drop(session);
    assert_gone(&home.arg(""));
}

fn without_tags(page: &str) -> String {
    let parts = page
        .split('<')
        .map(|part| part.split_once('>').map_or(part, |(_, text)| text));
    parts.collect()
}

/// `meshseq verify` in this home: its exit code, its record, and what it said.
fn verify(home: &Scratch, arguments: &[&str]) -> (Option<i32>, Record, String) {
    let out = home.at("record");
    let output = Command::new(MESHSEQ)
        .env("MESHSEQ_HOME", home.path())
        .args(["verify", "--out"])
        .arg(&out)
        .args(arguments)
        .output()
        .unwrap();
    let said = text(&output.stdout) + &text(&output.stderr);
    assert!(!said.contains("panicked"), "{said}");
    assert_gone(&home.arg(""));
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(without_tags(&page).contains("hostile/first"));
    (output.status.code(), Record::read(&out).unwrap(), said)
}

#[test]
fn the_program_ends_with_a_record_and_the_documented_exit_code() {
    if !has_python() {
        return;
    }
    let hostile = [
        "honest",
        "crashes",
        "hangs-at-version",
        "nan",
        "absent",
        "unsupported",
        "chats",
    ];
    let (code, record, said) = verify(&home(&hostile), &[]);
    assert_eq!(code, Some(1), "{said}");
    assert_eq!(record.agreement.len(), 2 * (1 + hostile.len()));
    for words in [
        "timeout: hangs-at-version",
        "missing: absent",
        "signal: 11",
        "t[3] = NaN",
    ] {
        assert!(said.contains(words), "no `{words}` in {said}");
    }
    // What is missing or lacks the stage is no failure, unless every oracle is asked for.
    let calm = [
        "honest",
        "crashes-at-start",
        "absent",
        "unsupported",
        "floods",
    ];
    assert_eq!(verify(&home(&calm), &[]).0, Some(0));
    assert_eq!(verify(&home(&calm), &["--require-oracles"]).0, Some(1));
    assert_eq!(
        verify(&home(&["honest"]), &["--require-oracles"]).0,
        Some(0)
    );
    assert_eq!(verify(&home(&["honest", "differs"]), &[]).0, Some(1));
}

#[test]
fn registries_that_are_none_are_refused() {
    let home = home(&["honest"]);
    let refusal = |registry: &str| {
        fs::write(home.at("oracles/oracles.toml"), registry).unwrap();
        let output = Command::new(MESHSEQ)
            .env("MESHSEQ_HOME", home.path())
            .arg("doctor")
            .output()
            .unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(
            said.contains("oracles.toml") && !said.contains("panicked"),
            "{said}"
        );
        said
    };
    assert!(refusal("[[oracle]]\nengine = 3\n").contains("expected a string"));
    assert!(refusal("not toml").contains("line 1"));
    let entry = "[[oracle]]\nengine = \"numpy\"\nstages = [\"signal.h\"]\ndescent = \"d\"\ninstall = \"i\"\n";
    assert!(refusal(&format!("{entry}command = []\n")).contains("`numpy` has an empty command"));
    assert!(
        refusal(&format!("{entry}command = [\"a\"]\nspeed = 1\n"))
            .contains("unknown field `speed`")
    );
    fs::remove_file(home.at("oracles/oracles.toml")).unwrap();
    let output = Command::new(MESHSEQ)
        .env("MESHSEQ_HOME", home.path())
        .arg("doctor")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("set MESHSEQ_HOME"));
}
