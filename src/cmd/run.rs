//! `verify` and `measure`: run cases, judge, record, report.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{progress, say};
use super::{Failure, Outcome, home};
use crate::exhibits::{self, Exhibit, Panel};
use crate::harness::case::{Case, read_all, select};
use crate::harness::inject::{self, FAULTS};
use crate::harness::record::{Record, Verdict};
use crate::harness::session::{Event, Options, Session, Timing};
use crate::harness::verify::Judged;
use crate::sequence::dataset::DataFolders;

/// What both verbs share.
#[derive(Args)]
struct Run {
    /// Cases or folders of cases, `*` for any characters; all if none is given
    #[arg(value_name = "CASE")]
    cases: Vec<String>,
    /// Folder of real data; MESHSEQ_DATA serves too
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Ask only this engine besides Rust; may be given again
    #[arg(long = "engine", value_name = "NAME")]
    engines: Vec<String>,
    /// Where the record goes; a new folder under target/meshseq if not given
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Keep the record in results/, as one that is meant to stay; without pictures of real data, which may not be passed on
    #[arg(long, conflicts_with = "out")]
    record: bool,
}

#[derive(Args)]
pub struct Verify {
    #[command(flatten)]
    run: Run,
    /// Fail where an engine is missing
    #[arg(long)]
    require_oracles: bool,
    /// Time the engines that agree, on the cases marked for it
    #[arg(long)]
    time: bool,
    /// Make the exhibits too: tables, charts and pictures of poses that show what the algorithms do
    #[arg(long)]
    exhibits: bool,
    /// Make a Rust stage wrong on purpose; exit code 1 says that it was caught. `list` names the faults
    #[arg(long, value_name = "FAULT")]
    inject: Option<String>,
}

#[derive(Args)]
pub struct Measure {
    #[command(flatten)]
    run: Run,
}

impl Verify {
    pub fn run(self) -> Outcome {
        let fault = match self.inject.as_deref() {
            Some("list") => {
                FAULTS.iter().for_each(|fault| say(fault.name));
                return Ok(true);
            }
            Some(name) => Some(inject::find(name).ok_or_else(|| {
                format!("no fault is called `{name}`; `meshseq verify --inject list` names them")
            })?),
            None => None,
        };
        let cases = select(read_all(&home().join("bench/cases"))?, &self.run.cases)?;
        if let Some(fault) = fault
            && !cases.iter().any(|case| case.stage == fault.stage)
        {
            return Err(format!(
                "--inject {}: its stage {} is not among the {} cases chosen; name cases that have it",
                fault.name, fault.stage, cases.len()
            )
            .into());
        }
        let timing = if self.time {
            Timing::Marked
        } else {
            Timing::None
        };
        let Done { record, failed } = self.run.execute(&cases, fault, timing, self.exhibits)?;
        let wrong = record.agreement.iter().filter(|row| {
            !matches!(
                row.verdict,
                Verdict::Agree | Verdict::Missing | Verdict::Unsupported
            )
        });
        let missing = record
            .agreement
            .iter()
            .any(|row| row.verdict == Verdict::Missing);
        if record.agreement.is_empty() {
            say("nothing was verified");
        }
        let some = !record.agreement.is_empty();
        Ok(some && wrong.count() == 0 && failed == 0 && !(self.require_oracles && missing))
    }
}

impl Measure {
    pub fn run(self) -> Outcome {
        let mut cases = select(read_all(&home().join("bench/cases"))?, &self.run.cases)?;
        if self.run.cases.is_empty() {
            cases.retain(|case| case.measure);
        }
        let done = self.run.execute(&cases, None, Timing::All, false)?;
        Ok(done
            .record
            .agreement
            .iter()
            .all(|row| row.verdict != Verdict::Differ))
    }
}

/// A run that came to its end.
struct Done {
    record: Record,
    /// Exhibits that could not be made though their data are there.
    failed: usize,
}

impl Run {
    fn execute(
        &self,
        cases: &[Case],
        fault: Option<&'static inject::Fault>,
        timing: Timing,
        with_exhibits: bool,
    ) -> Result<Done, Failure> {
        let options = Options {
            home: home(),
            data: DataFolders::new(self.data.as_deref()),
            engines: self.engines.clone(),
            fault,
            timing,
        };
        let mut session = Session::open(options, cases)?;
        let folder = self.folder()?;
        let bar = progress(cases.len());
        // Many cases lack the same data: how to get at it is told once, for the first of them.
        let mut told = HashSet::new();
        let mut record = session.run(cases, |event| {
            let line = match event {
                Event::Judged(case, judged) => line(case, judged),
                Event::Skipped(case, why) if told.insert(why.to_owned()) => {
                    format!("{:<34}  skipped: {why}", case.name)
                }
                Event::Skipped(case, _) => {
                    format!("{:<34}  skipped: no data for `{}`", case.name, case.dataset)
                }
            };
            bar.suspend(|| say(&line));
            bar.inc(1);
        });
        bar.finish_and_clear();
        let mut failed = 0;
        if with_exhibits {
            let data = DataFolders::new(self.data.as_deref());
            (record.exhibits, failed) = all_exhibits(exhibits::ALL, &data);
        }
        if self.record {
            // Pictures of real data are derived from geometry that may not be passed on; numbers may.
            record
                .figures
                .retain(|figure| figure.dataset.starts_with('@'));
            record
                .exhibits
                .iter_mut()
                .filter(|exhibit| exhibit.datasets.iter().any(|d| !d.starts_with('@')))
                .for_each(|exhibit| {
                    exhibit
                        .panels
                        .retain(|panel| !matches!(panel, Panel::Picture(_)))
                });
        }
        record.machine = machine();
        record.command = command();
        record.write(&folder)?;
        let page = folder.join("report.html");
        super::output::write_whole(&page, &super::report::page(&record)?)?;
        say(&summary(&record));
        if failed > 0 {
            say(&format!("exhibits failed: {failed}"));
        }
        say(&format!(
            "report: {}",
            std::path::absolute(&page)?.display()
        ));
        Ok(Done { record, failed })
    }

    /// The record's folder, made: as named, or the next free number of this day.
    fn folder(&self) -> Result<PathBuf, Failure> {
        let failed = |path: &Path, error: std::io::Error| -> Failure {
            format!(
                "{}: cannot make the folder of the record: {error}",
                path.display()
            )
            .into()
        };
        if let Some(out) = &self.out {
            std::fs::create_dir_all(out).map_err(|e| failed(out, e))?;
            return Ok(out.clone());
        }
        let root = home().join(if self.record {
            "results"
        } else {
            "target/meshseq"
        });
        std::fs::create_dir_all(&root).map_err(|e| failed(&root, e))?;
        let day = jiff::Timestamp::now()
            .to_zoned(jiff::tz::TimeZone::UTC)
            .date();
        for number in 1.. {
            let folder = root.join(format!("{day}.{number}"));
            match std::fs::create_dir(&folder) {
                Ok(()) => return Ok(folder),
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(failed(&folder, error)),
            }
        }
        Ok(root)
    }
}

/// Every exhibit whose data are there, and how many of them could not be made; what is not made is told.
fn all_exhibits(makers: &[(&str, exhibits::Make)], data: &DataFolders) -> (Vec<Exhibit>, usize) {
    let (mut made, mut failed) = (Vec::new(), 0);
    for (name, make) in makers {
        match make(data) {
            Ok(exhibit) => {
                say(&format!("exhibit {name}: {}", exhibit.title));
                made.push(exhibit);
            }
            Err(error) if error.is_absence() => {
                say(&format!("exhibit {name}: skipped: {error}"));
            }
            Err(error) => {
                say(&format!("exhibit {name}: failed: {error}"));
                failed += 1;
            }
        }
    }
    (made, failed)
}

/// One line a case: the engines by verdict, and the check nearest to its tolerance.
fn line(case: &Case, judged: &[Judged]) -> String {
    let mut parts = vec![format!("{:<34}", case.name)];
    for verdict in Verdict::ALL {
        let names: Vec<&str> = judged
            .iter()
            .filter(|j| j.row.verdict == verdict)
            .map(|j| j.row.engine.as_str())
            .collect();
        if !names.is_empty() {
            parts.push(format!("{verdict}: {}", names.join(" ")));
        }
    }
    let load = |j: &&Judged| match (j.row.value, j.row.tolerance) {
        (Some(value), Some(tolerance)) if tolerance > 0.0 => value / tolerance,
        _ => 0.0,
    };
    let nearest = judged.iter().max_by(|a, b| load(a).total_cmp(&load(b)));
    if let Some(nearest) = nearest
        && let (Some(quantity), Some(value), Some(tolerance)) = (
            &nearest.row.quantity,
            nearest.row.value,
            nearest.row.tolerance,
        )
    {
        let engine = &nearest.row.engine;
        parts.push(
            format!("({engine} {quantity} {value:.1e} <= {tolerance:.1e})")
                .replace("<=", if value <= tolerance { "<=" } else { "exceeds" }),
        );
    }
    for one in judged
        .iter()
        .filter(|j| !j.row.message.is_empty() && j.row.verdict != Verdict::Unsupported)
    {
        parts.push(format!("\n    {}: {}", one.row.engine, one.row.message));
    }
    parts.join("  ")
}

/// What counts, by verdict, and the tables.
fn summary(record: &Record) -> String {
    let mut counts = Vec::new();
    for verdict in Verdict::ALL {
        let count = record
            .agreement
            .iter()
            .filter(|row| row.verdict == verdict)
            .count();
        if count > 0 || verdict == Verdict::Agree || verdict == Verdict::Differ {
            counts.push(format!("{count} {verdict}"));
        }
    }
    let mut text = format!("\n{}", table(record));
    text += &format!("verdicts: {}", counts.join(", "));
    if !record.skipped.is_empty() {
        text += &format!("; {} cases skipped: no data", record.skipped.len());
    }
    text
}

/// Stage by stage: cases, engines, the worst check, and where timed the fastest peer.
fn table(record: &Record) -> String {
    let mut rows = vec![format!(
        "{:<20} {:>5} {:>7}  {:<44} {:>10}  {}",
        "stage", "cases", "engines", "worst difference / tolerance", "rust", "fastest peer"
    )];
    for stage in crate::stages::all() {
        let agreement: Vec<_> = record
            .agreement
            .iter()
            .filter(|r| r.stage == stage.name)
            .collect();
        if agreement.is_empty() {
            continue;
        }
        let distinct = |of: fn(&crate::harness::record::AgreementRow) -> &str| {
            let mut names: Vec<&str> = agreement.iter().map(|r| of(r)).collect();
            names.sort_unstable();
            names.dedup();
            names.len()
        };
        let load = |r: &&&crate::harness::record::AgreementRow| match (r.value, r.tolerance) {
            (Some(v), Some(t)) if t > 0.0 => v / t,
            _ => 0.0,
        };
        let worst = agreement.iter().max_by(|a, b| load(a).total_cmp(&load(b)));
        let worst = worst.map_or(String::new(), |r| {
            let (value, tolerance) = (r.value.unwrap_or(0.0), r.tolerance.unwrap_or(0.0));
            format!(
                "{} {value:.1e} / {tolerance:.0e}",
                r.quantity.as_deref().unwrap_or("")
            )
        });
        let (rust, peer) = times(record, stage.name);
        rows.push(format!(
            "{:<20} {:>5} {:>7}  {worst:<44} {rust:>10}  {peer}",
            stage.name,
            distinct(|r| &r.case),
            distinct(|r| &r.engine)
        ));
    }
    rows.join("\n") + "\n"
}

/// Rust's time on the stage's slowest case and the fastest peer's ratio there.
fn times(record: &Record, stage: &str) -> (String, String) {
    let rust = record
        .timing
        .iter()
        .filter(|r| r.stage == stage && r.engine == "rust")
        .max_by(|a, b| a.median_seconds.total_cmp(&b.median_seconds));
    let Some(rust) = rust else {
        return (String::new(), String::new());
    };
    let peer = record
        .timing
        .iter()
        .filter(|r| r.case == rust.case && r.engine != "rust")
        .min_by(|a, b| a.ratio_to_rust.total_cmp(&b.ratio_to_rust));
    let peer = peer.map_or(String::new(), |p| {
        format!("{} x{:.3}", p.engine, p.ratio_to_rust)
    });
    (format!("{:.3} ms", rust.median_seconds * 1e3), peer)
}

fn command() -> String {
    let arguments: Vec<String> = std::env::args().collect();
    arguments.join(" ")
}

/// Processor, memory, system, threads, revision.
fn machine() -> String {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let field = |text: &str, key: &str| {
        let line = text.lines().find(|line| line.starts_with(key));
        line.and_then(|line| line.split_once(':'))
            .map_or("unknown".into(), |(_, v)| v.trim().to_owned())
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    [
        format!("processor: {}", field(&read("/proc/cpuinfo"), "model name")),
        format!(
            "threads: {threads} available, {} used",
            rayon::current_num_threads()
        ),
        format!("memory: {}", field(&read("/proc/meminfo"), "MemTotal")),
        format!("system: {}", read("/proc/sys/kernel/osrelease").trim()),
        format!("load: {}", read("/proc/loadavg").trim()),
        format!("revision: {}", env!("MESHSEQ_REVISION")),
        format!(
            "time: {}",
            jiff::Timestamp::now()
                .round(jiff::Unit::Second)
                .unwrap_or_default()
        ),
    ]
    .join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exhibits::ExhibitError;

    #[test]
    fn only_absent_data_skip_an_exhibit() {
        let makers: [(&str, exhibits::Make); 4] = [
            ("made", |_| {
                Ok(Exhibit {
                    name: "made".into(),
                    title: String::new(),
                    look: String::new(),
                    datasets: Vec::new(),
                    panels: Vec::new(),
                })
            }),
            ("absent", |data| {
                Err(data.sequence("no such data").unwrap_err().into())
            }),
            ("damaged", |data| {
                Err(data.sequence("@no-such-name").unwrap_err().into())
            }),
            ("refused", |_| {
                Err(ExhibitError::of("refused")(std::fmt::Error))
            }),
        ];
        let (made, failed) = all_exhibits(&makers, &DataFolders::default());
        assert_eq!((made.len(), failed), (1, 2));
    }
}
