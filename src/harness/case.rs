//! Cases: a stage, a dataset, its parameters and its checks, as TOML in `bench/cases/`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Deserialize;
use thiserror::Error;

use super::tolerance::{self, Tolerance};
use crate::shape::SpaceKind;
use crate::signal::knots::KnotRule;
use crate::stages::{self, Stage, made::Made, signal::Choice};

/// One case, validated.
#[derive(Clone, Debug)]
pub struct Case {
    /// Folders, file and name: `signal/h/gallop-small`.
    pub name: String,
    pub stage: &'static str,
    /// `@name`, or a folder of real data.
    pub dataset: String,
    /// 1-based frames, first, last and step; none for all.
    pub frames: Frames,
    /// What is made of these frames, of which the stage's inputs are then taken.
    pub made: Made,
    pub choice: Choice,
    /// Expected quantities of the Rust answer, as printed: half a unit of the last digit is the tolerance.
    pub expect: BTreeMap<String, Printed>,
    /// Tolerances that differ from the table's, by quantity and engine; the empty engine is any.
    pub tolerances: BTreeMap<(String, String), Tolerance>,
    pub timeout: Duration,
    /// Whether `measure` times it when no case is named.
    pub measure: bool,
    /// Whether its fit is drawn in the report.
    pub draw: bool,
    /// The paper's time, in seconds, and where it stands.
    pub published: Option<(f64, String)>,
}

/// `first..last`, 1-based, both ends in, every `step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    pub first: usize,
    /// None: to the end.
    pub last: Option<usize>,
    pub step: usize,
}

/// A number as printed, which says how far it may be off.
#[derive(Clone, Debug, PartialEq)]
pub struct Printed {
    pub value: f64,
    pub half_unit: f64,
}

/// Why a case file is refused.
#[derive(Debug, Error)]
pub enum CaseError {
    /// A file or folder that cannot be read.
    #[error("{path}: {source}")]
    File {
        path: PathBuf,
        source: std::io::Error,
    },
    /// Not TOML, or not of this form.
    #[error("{path}: {source}")]
    Toml {
        path: PathBuf,
        source: Box<toml::de::Error>,
    },
    /// A case that cannot be right.
    #[error("{path}: case `{case}`: {what}")]
    Wrong {
        path: PathBuf,
        case: String,
        what: String,
    },
    /// A pattern that names no case.
    #[error("no case matches `{pattern}`; `meshseq list` shows them all")]
    NoMatch { pattern: String },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "case")]
    cases: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    stage: String,
    dataset: String,
    frames: Option<String>,
    #[serde(default = "one")]
    every: usize,
    k: Option<usize>,
    l: Option<usize>,
    m: Option<usize>,
    knots: Option<String>,
    space: Option<String>,
    #[serde(default)]
    resampled: bool,
    examples: Option<[String; 2]>,
    #[serde(default)]
    pins: usize,
    #[serde(default)]
    expect: BTreeMap<String, String>,
    #[serde(default)]
    check: Vec<Check>,
    #[serde(default = "two_minutes")]
    timeout_seconds: u64,
    #[serde(default)]
    measure: bool,
    #[serde(default)]
    draw: bool,
    #[serde(default = "yes")]
    means: bool,
    published: Option<Published>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Check {
    quantity: String,
    /// Only for this engine.
    #[serde(default)]
    engine: String,
    tolerance: f64,
    reason: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Published {
    milliseconds: f64,
    source: String,
}

fn one() -> usize {
    1
}

fn yes() -> bool {
    true
}

fn two_minutes() -> u64 {
    120
}

/// Reads every case below `folder`, by name.
pub fn read_all(folder: &Path) -> Result<Vec<Case>, CaseError> {
    let mut cases = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for path in entries(&next)? {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "toml") {
                cases.extend(read_file(folder, &path)?);
            }
        }
    }
    cases.sort_by(|a, b| (order(a.stage), &a.name).cmp(&(order(b.stage), &b.name)));
    Ok(cases)
}

fn order(stage: &str) -> usize {
    stages::all()
        .position(|s| s.name == stage)
        .unwrap_or(usize::MAX)
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, CaseError> {
    let failed = |source| CaseError::File {
        path: folder.to_owned(),
        source,
    };
    let listing = std::fs::read_dir(folder).map_err(failed)?;
    listing
        .map(|entry| entry.map(|e| e.path()).map_err(failed))
        .collect()
}

fn read_file(root: &Path, path: &Path) -> Result<Vec<Case>, CaseError> {
    let text = std::fs::read_to_string(path).map_err(|source| CaseError::File {
        path: path.to_owned(),
        source,
    })?;
    let file: File = toml::from_str(&text).map_err(|source| CaseError::Toml {
        path: path.to_owned(),
        source: Box::new(source),
    })?;
    let stem = path.with_extension("");
    let prefix = stem
        .strip_prefix(root)
        .unwrap_or(&stem)
        .to_string_lossy()
        .into_owned();
    let mut names = BTreeSet::new();
    let case = |entry: Entry| {
        let name = entry.name.clone();
        let checked = match names.insert(name.clone()) {
            true => validate(entry, &prefix),
            false => Err("another case of this file has the same name".into()),
        };
        checked.map_err(|what| CaseError::Wrong {
            path: path.to_owned(),
            case: name,
            what,
        })
    };
    file.cases.into_iter().map(case).collect()
}

fn validate(entry: Entry, prefix: &str) -> Result<Case, String> {
    let fits = |c: char| c.is_ascii_alphanumeric() || c == '-';
    if entry.name.is_empty() || !entry.name.chars().all(fits) {
        return Err("a name has letters, digits and hyphens only".into());
    }
    let stage: &'static Stage = stages::find(&entry.stage).ok_or_else(|| {
        let known: Vec<&str> = stages::all().map(|s| s.name).collect();
        format!(
            "no stage `{}`; the stages are {}",
            entry.stage,
            known.join(", ")
        )
    })?;
    if entry.timeout_seconds == 0 {
        return Err("timeout_seconds = 0, expected at least 1".into());
    }
    Ok(Case {
        name: format!("{prefix}/{}", entry.name),
        stage: stage.name,
        frames: frames(entry.frames.as_deref(), entry.every)?,
        made: made(stage, entry.resampled, entry.examples)?,
        choice: Choice {
            k: entry.k.unwrap_or(4),
            l: entry.l.unwrap_or(3),
            m: entry.m.unwrap_or(0),
            knots: knots(entry.knots.as_deref())?,
            pins: entry.pins,
            space: space(entry.space.as_deref())?,
            means: entry.means,
        },
        expect: expectations(&entry.expect)?,
        tolerances: tolerances(stage.name, entry.check)?,
        timeout: Duration::from_secs(entry.timeout_seconds),
        measure: entry.measure,
        draw: entry.draw,
        published: entry.published.map(|p| (p.milliseconds / 1e3, p.source)),
        dataset: entry.dataset,
    })
}

fn made(stage: &Stage, resampled: bool, examples: Option<[String; 2]>) -> Result<Made, String> {
    let made = match (resampled, examples) {
        (true, Some(_)) => {
            return Err("resampled and transferred by examples; expected one of both".into());
        }
        (true, None) => Made::Resampled,
        (false, Some(examples)) => Made::Transferred { examples },
        (false, None) => Made::Nothing,
    };
    match stage.name == "sequence.read" && made != Made::Nothing {
        true => Err("sequence.read reads the files of its dataset; nothing is made of them".into()),
        false => Ok(made),
    }
}

fn knots(rule: Option<&str>) -> Result<KnotRule, String> {
    rule.map_or(Ok(KnotRule::default()), |rule| {
        rule.parse().map_err(|e| format!("{e}: `{rule}`"))
    })
}

fn space(name: Option<&str>) -> Result<SpaceKind, String> {
    name.map_or(Ok(SpaceKind::Vertex), |name| {
        name.parse().map_err(|e| format!("{e}"))
    })
}

fn expectations(texts: &BTreeMap<String, String>) -> Result<BTreeMap<String, Printed>, String> {
    texts
        .iter()
        .map(|(quantity, text)| {
            let printed = printed(text)
                .ok_or_else(|| format!("expect `{text}`: expected a decimal number in quotes"))?;
            Ok((quantity.clone(), printed))
        })
        .collect()
}

/// `90.799` allows 0.0005 either way.
fn printed(text: &str) -> Option<Printed> {
    let value: f64 = text.parse().ok().filter(|v: &f64| v.is_finite())?;
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let decimals = mantissa
        .split_once('.')
        .map_or(0, |(_, digits)| digits.len()) as i32;
    Some(Printed {
        value,
        half_unit: 0.5 * 10f64.powi(exponent - decimals),
    })
}

fn tolerances(
    stage: &str,
    checks: Vec<Check>,
) -> Result<BTreeMap<(String, String), Tolerance>, String> {
    let mut found = BTreeMap::new();
    for check in checks {
        if !tolerance::is_checked(stage, &check.quantity) {
            return Err(format!(
                "`{}` is no checked quantity of {stage}",
                check.quantity
            ));
        }
        if check.reason.trim().len() < 10 {
            return Err(format!(
                "the tolerance of `{}` needs a reason",
                check.quantity
            ));
        }
        if !(check.tolerance.is_finite() && check.tolerance >= 0.0) {
            return Err(format!(
                "the tolerance of `{}` is no positive number",
                check.quantity
            ));
        }
        let tolerance = Tolerance {
            value: check.tolerance,
            reason: check.reason,
        };
        found.insert((check.quantity, check.engine), tolerance);
    }
    Ok(found)
}

/// `A..B`, `A..`, `..B` or `A`.
fn frames(text: Option<&str>, step: usize) -> Result<Frames, String> {
    let range = text.unwrap_or("..");
    let wrong = || {
        format!("frames `{range}`: expected A..B with 1 <= A <= B, counted from 1, both ends in")
    };
    if step == 0 {
        return Err("every = 0: expected every S-th frame with S at least 1".into());
    }
    let number = |text: &str, absent: Option<usize>| match text {
        "" => Ok(absent),
        text => text.parse().map(Some).map_err(|_| wrong()),
    };
    let (first, last) = match range.split_once("..") {
        Some((first, last)) => (number(first, Some(1))?, number(last, None)?),
        None => (number(range, None)?, number(range, None)?),
    };
    let first = first.filter(|&f| f >= 1).ok_or_else(wrong)?;
    if last.is_some_and(|last| last < first) {
        return Err(wrong());
    }
    Ok(Frames { first, last, step })
}

impl Case {
    /// What a quantity is held against: this case's tolerance for the engine, for any engine, or the table's.
    pub fn tolerance(&self, quantity: &str, engine: &str) -> Option<Tolerance> {
        let own = |engine: &str| {
            self.tolerances
                .get(&(quantity.to_owned(), engine.to_owned()))
        };
        let own = own(engine).or_else(|| own(""));
        own.cloned()
            .or_else(|| tolerance::find(self.stage, quantity, engine))
    }
}

impl std::str::FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        frames(Some(text), 1)
    }
}

impl Frames {
    /// The 0-based frames of a sequence of n; an error where the range leaves it.
    pub fn indices(&self, n: usize) -> Result<Vec<usize>, String> {
        let last = self.last.unwrap_or(n);
        if self.first > n || last > n {
            let last = self.last.map_or(String::new(), |last| last.to_string());
            return Err(format!(
                "frames {}..{last}: the sequence has frames 1..{n}; choose among them",
                self.first
            ));
        }
        Ok((self.first - 1..last).step_by(self.step).collect())
    }
}

/// The cases whose names begin with, or match, any of the patterns (`*` for any characters); all for no patterns.
pub fn select(cases: Vec<Case>, patterns: &[String]) -> Result<Vec<Case>, CaseError> {
    for pattern in patterns {
        if !cases.iter().any(|case| matches(pattern, &case.name)) {
            return Err(CaseError::NoMatch {
                pattern: pattern.clone(),
            });
        }
    }
    let wanted =
        |case: &Case| patterns.is_empty() || patterns.iter().any(|p| matches(p, &case.name));
    Ok(cases.into_iter().filter(wanted).collect())
}

/// A pattern without `*` is a name or a folder of names.
fn matches(pattern: &str, name: &str) -> bool {
    let Some((head, tail)) = pattern.split_once('*') else {
        let rest = name.strip_prefix(pattern.trim_end_matches('/'));
        return rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'));
    };
    let Some(rest) = name.strip_prefix(head) else {
        return false;
    };
    if tail.is_empty() {
        return true;
    }
    (0..=rest.len())
        .filter(|&at| rest.is_char_boundary(at))
        .any(|at| {
            if tail.contains('*') {
                matches(tail, &rest[at..])
            } else {
                &rest[at..] == tail
            }
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_numbers_allow_half_a_unit() {
        let p = printed("90.799").unwrap();
        assert!((p.half_unit - 0.0005).abs() < 1e-12);
        assert!((printed("8.33e-3").unwrap().half_unit - 5e-6).abs() < 1e-12);
        assert!(printed("abc").is_none() && printed("inf").is_none());
    }

    #[test]
    fn frame_ranges() {
        let range = |text: &str, step| frames(Some(text), step).unwrap();
        assert_eq!(range("2..4", 1).indices(5).unwrap(), [1, 2, 3]);
        assert_eq!(range("..", 2).indices(5).unwrap(), [0, 2, 4]);
        assert_eq!(range("3", 1).indices(5).unwrap(), [2]);
        assert!(range("2..9", 1).indices(5).is_err());
        for bad in ["0..3", "4..2", "a..b", ""] {
            assert!(frames(Some(bad), 1).is_err() || bad.is_empty(), "{bad}");
        }
    }

    #[test]
    fn patterns_name_cases_and_folders() {
        assert!(matches("signal/h", "signal/h/cow"));
        assert!(!matches("signal/h", "signal/hh/cow"));
        assert!(matches("*/cow", "signal/h/cow"));
        assert!(matches("signal/*/cow*", "signal/h/cow-fast"));
        assert!(!matches("signal/*/cow", "signal/h/cow-fast"));
    }

    #[test]
    fn a_looser_tolerance_needs_a_reason() {
        let check = |reason: &str| Check {
            quantity: "formula".into(),
            engine: String::new(),
            tolerance: 1e-3,
            reason: reason.into(),
        };
        assert!(tolerances("signal.psi", vec![check("")]).is_err());
        assert!(tolerances("signal.psi", vec![check("a reason long enough")]).is_ok());
        assert!(tolerances("signal.h", vec![check("a reason long enough")]).is_err());
    }
}
