//! Each stage in one line: what is compared, with whom, how near to its tolerance, how fast. The page and the README share it.

use super::format::{number, seconds, times};
use super::markup::{Cell, Group, Table, escape, name};
use super::order::{RUST, distinct, engines};
use super::verdicts::{badge, margin};
use crate::harness::record::{Record, TimingRow, Verdict};

/// Quantities named before the rest is only counted.
const NAMED: usize = 4;

/// A stage in one line.
pub(super) struct Stage<'a> {
    pub name: &'a str,
    /// Quantities that are held against a tolerance.
    pub compared: Vec<&'a str>,
    /// Engines beside ours that answered.
    pub peers: Vec<&'a str>,
    /// Engines that are missing.
    pub missing: Vec<&'a str>,
    /// How many verdicts are differ, error or timeout.
    pub failures: usize,
    /// How many are agree.
    pub agreements: usize,
    /// The greatest difference over its tolerance; NaN counts as the greatest.
    pub worst: Option<f64>,
    pub time: Option<StageTime<'a>>,
}

/// How fast a stage is on its slowest case that a peer was timed on too.
pub(super) struct StageTime<'a> {
    pub case: &'a str,
    pub rust_seconds: f64,
    /// The peer with the least time, and its time over ours.
    pub peer: Option<(&'a str, f64)>,
}

/// Every stage that has a verdict or a time, in the record's order.
pub(super) fn stages(record: &Record) -> Vec<Stage<'_>> {
    let with_verdict = record.agreement.iter().map(|r| r.stage.as_str());
    let with_time = record.timing.iter().map(|r| r.stage.as_str());
    distinct(with_verdict.chain(with_time))
        .into_iter()
        .map(|name| stage(record, name))
        .collect()
}

fn stage<'a>(record: &'a Record, name: &'a str) -> Stage<'a> {
    let rows: Vec<_> = record
        .agreement
        .iter()
        .filter(|r| r.stage == name)
        .collect();
    let having = |wanted: &[Verdict]| {
        let names = rows.iter().filter(|r| wanted.contains(&r.verdict));
        engines(names.map(|r| r.engine.as_str()))
    };
    let number_of =
        |wanted: &[Verdict]| rows.iter().filter(|r| wanted.contains(&r.verdict)).count();
    let mut peers = having(&[Verdict::Agree, Verdict::Differ]);
    peers.retain(|&e| e != RUST);
    Stage {
        name,
        compared: compared(record, name),
        peers,
        missing: having(&[Verdict::Missing]),
        failures: number_of(&[Verdict::Differ, Verdict::Error, Verdict::Timeout]),
        agreements: number_of(&[Verdict::Agree]),
        worst: rows.iter().filter_map(|r| margin(r)).reduce(worse),
        time: time(record, name),
    }
}

fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a >= b { a } else { b }
}

fn compared<'a>(record: &'a Record, stage: &str) -> Vec<&'a str> {
    let checked = record.accuracy.iter();
    let checked = checked.filter(|r| r.stage == stage && r.tolerance.is_some());
    let worst = record.agreement.iter().filter(|r| r.stage == stage);
    distinct(
        checked
            .map(|r| r.quantity.as_str())
            .chain(worst.filter_map(|r| r.quantity.as_deref())),
    )
}

fn time<'a>(record: &'a Record, stage: &str) -> Option<StageTime<'a>> {
    let rows: Vec<&TimingRow> = record.timing.iter().filter(|r| r.stage == stage).collect();
    let peer = |case: &str| {
        let others = rows.iter().filter(|r| r.case == case && r.engine != RUST);
        others
            .filter(|r| r.ratio_to_rust.is_finite())
            .min_by(|a, b| a.ratio_to_rust.total_cmp(&b.ratio_to_rust))
            .map(|r| (r.engine.as_str(), r.ratio_to_rust))
    };
    let ours = rows.iter().filter(|r| r.engine == RUST);
    let timed = ours.map(|r| StageTime {
        case: &r.case,
        rust_seconds: r.median_seconds,
        peer: peer(&r.case),
    });
    timed.max_by(|a, b| {
        let key = |t: &StageTime| (t.peer.is_some(), t.rust_seconds);
        let ((a_peer, a_time), (b_peer, b_time)) = (key(a), key(b));
        a_peer.cmp(&b_peer).then(a_time.total_cmp(&b_time))
    })
}

impl Stage<'_> {
    /// The first quantities by name, the rest as a number; not escaped.
    pub(super) fn compared_text(&self) -> String {
        let named = self.compared[..self.compared.len().min(NAMED)].join(", ");
        match self.compared.len().saturating_sub(NAMED) {
            0 => named,
            more => format!("{named} and {more} more"),
        }
    }

    /// The engines beside ours; not escaped.
    pub(super) fn peers_text(&self) -> String {
        let mut text = self.peers.join(", ");
        if !self.missing.is_empty() {
            let gap = if text.is_empty() { "" } else { " " };
            text += &format!("{gap}(missing: {})", self.missing.join(", "));
        }
        text
    }

    fn verdict_html(&self) -> String {
        match (self.failures, self.agreements) {
            (0, 0) => "<span class=\"faint\">not checked</span>".into(),
            (0, n) => format!("{} {n}", badge(Verdict::Agree)),
            (n, _) => format!(
                "<span class=\"v differ\"><span aria-hidden=\"true\">≠</span> {n} failed</span>"
            ),
        }
    }

    fn cells(&self) -> Vec<Cell> {
        let worst = self.worst.map_or(String::new(), number);
        let (median, peer, case) = match &self.time {
            None => Default::default(),
            Some(t) => (
                seconds(t.rust_seconds),
                t.peer.map_or(String::new(), |(engine, ratio)| {
                    format!("{} {}", escape(engine), times(ratio))
                }),
                name(t.case),
            ),
        };
        vec![
            Cell::text(name(self.name)),
            Cell::classed("verdict", self.verdict_html()),
            Cell::number(worst),
            Cell::classed("long", escape(&self.peers_text())),
            Cell::number(median),
            Cell::number(peer),
            Cell::text(case),
        ]
    }
}

/// The stages as a table.
pub(super) fn table(record: &Record) -> String {
    let stages = stages(record);
    if stages.is_empty() {
        return "<p>This run has no stages to tell of.</p>\n".into();
    }
    Table {
        caption: "Every stage in one line".into(),
        columns: vec![
            Cell::text("stage"),
            Cell::text("verdicts"),
            Cell::number("worst difference / tolerance"),
            Cell::text("beside"),
            Cell::number("rust, median"),
            Cell::number("fastest peer"),
            Cell::text("timed on"),
        ],
        groups: vec![Group {
            heading: String::new(),
            rows: stages.iter().map(Stage::cells).collect(),
        }],
    }
    .html()
}
