//! Where the answers come from: engines and their receipts, what was skipped, the machine and the command.

use super::markup::{Cell, Group, Table, escape, name};
use super::order::RUST;
use super::verdicts::badge;
use crate::harness::record::{EngineRow, Record, Verdict};

/// Engines with their receipts, or with how to get them.
pub(super) fn table(rows: &[EngineRow]) -> String {
    if rows.is_empty() {
        return "<p>This run lists no engines.</p>\n".into();
    }
    let mut sorted: Vec<&EngineRow> = rows.iter().collect();
    sorted.sort_by_key(|r| (r.engine != RUST, !r.missing.is_empty(), r.engine.as_str()));
    Table {
        caption: "Engines".into(),
        columns: vec![
            Cell::text("engine"),
            Cell::text("receipt, or how to get it"),
            Cell::text("what makes it independent"),
            Cell::text("stages"),
        ],
        groups: vec![Group {
            heading: String::new(),
            rows: sorted.iter().map(|r| line(r)).collect(),
        }],
    }
    .html()
}

fn line(row: &EngineRow) -> Vec<Cell> {
    let receipt = match row.missing.is_empty() {
        true => escape(&row.version),
        false => format!("{} {}", badge(Verdict::Missing), escape(&row.missing)),
    };
    let stages: Vec<String> = row.stages.split_whitespace().map(name).collect();
    vec![
        Cell::text(escape(&row.engine)),
        Cell::classed("long", receipt),
        Cell::classed("long", escape(&row.descent)),
        Cell::classed("long", stages.join(", ")),
    ]
}

/// The cases that were skipped, with the reason.
pub(super) fn skipped(lines: &[String]) -> String {
    let items: String = lines
        .iter()
        .filter(|line| !line.trim().is_empty())
        .map(|line| format!("<li>{}</li>\n", escape(line)))
        .collect();
    match items.as_str() {
        "" => "<p>None.</p>\n".into(),
        _ => format!("<ul>\n{items}</ul>\n"),
    }
}

/// Where and how it was run.
pub(super) fn origin(record: &Record) -> String {
    let block = |heading: &str, text: &str| match text.trim() {
        "" => format!("<h3>{heading}</h3>\n<p>The record does not say.</p>\n"),
        text => format!("<h3>{heading}</h3>\n<pre>{}</pre>\n", escape(text)),
    };
    block("Machine", &record.machine) + &block("Command", &record.command)
}
