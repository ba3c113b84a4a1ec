//! Timing: a picture and a table a stage, beside every engine and beside the published time.

use super::format::{number, seconds, times};
use super::markup::{Cell, Group, Table, escape, name};
use super::order::{RUST, distinct};
use super::pictures;
use super::plots;
use crate::harness::record::{Record, SampleRow, TimingRow};

/// Pictures and tables of every stage that was timed.
pub(super) fn sections(record: &Record) -> String {
    if record.timing.is_empty() {
        return "<p>This run timed nothing; <code>meshseq measure</code> does.</p>\n".into();
    }
    let stages = distinct(record.timing.iter().map(|r| r.stage.as_str()));
    stages.iter().map(|s| section(record, s)).collect()
}

fn section(record: &Record, stage: &str) -> String {
    let rows: Vec<&TimingRow> = record.timing.iter().filter(|r| r.stage == stage).collect();
    let cases = distinct(rows.iter().map(|r| r.case.as_str()));
    let samples: Vec<&SampleRow> = record
        .samples
        .iter()
        .filter(|s| cases.contains(&s.case.as_str()))
        .collect();
    let picture = pictures::figure(&plots::timing::picture(stage, &rows, &samples));
    format!(
        "<div class=\"stage\">\n<h3>{}</h3>\n<div class=\"pair\">{picture}{}</div></div>\n",
        name(stage),
        table(stage, &rows, &cases)
    )
}

fn table(stage: &str, rows: &[&TimingRow], cases: &[&str]) -> String {
    let published = rows.iter().any(|r| r.published_seconds.is_some());
    let mut columns = vec![
        Cell::text("engine"),
        Cell::number("median"),
        Cell::number("MAD"),
        Cell::number("ratio to rust"),
        Cell::number("samples × calls"),
    ];
    if published {
        columns.push(Cell::number("published"));
        columns.push(Cell::number("published / median"));
    }
    Table {
        caption: format!("{}: times", name(stage)),
        columns,
        groups: cases
            .iter()
            .map(|case| group(case, rows, published))
            .collect(),
    }
    .html()
}

fn group(case: &str, rows: &[&TimingRow], published: bool) -> Group {
    let mut of_case: Vec<_> = rows.iter().filter(|r| r.case == case).collect();
    of_case.sort_by(|a, b| {
        let ours_first = (a.engine != RUST).cmp(&(b.engine != RUST));
        ours_first
            .then(a.median_seconds.total_cmp(&b.median_seconds))
            .then(a.engine.cmp(&b.engine))
    });
    Group {
        heading: name(case),
        rows: of_case.iter().map(|r| line(r, published)).collect(),
    }
}

fn line(row: &TimingRow, published: bool) -> Vec<Cell> {
    let mut cells = vec![
        Cell::text(escape(&row.engine)),
        Cell::number(seconds(row.median_seconds)),
        Cell::number(seconds(row.mad_seconds)),
        Cell::number(times(row.ratio_to_rust)),
        Cell::number(format!("{} × {}", row.samples, row.batch)),
    ];
    if published {
        cells.extend(published_cells(row));
    }
    cells
}

fn published_cells(row: &TimingRow) -> [Cell; 2] {
    let Some(paper) = row.published_seconds else {
        return [Cell::number(""), Cell::number("")];
    };
    let ratio = match row.median_seconds {
        ours if ours > 0.0 => times(paper / ours),
        ours => format!("not over {}", number(ours)),
    };
    [
        Cell::number(seconds(paper)).titled(&row.published_source),
        Cell::number(ratio),
    ]
}

/// Where the published times come from, each source once.
pub(super) fn sources(rows: &[TimingRow]) -> String {
    let given = rows.iter().filter(|r| r.published_seconds.is_some());
    let sources: Vec<String> = distinct(given.map(|r| r.published_source.as_str()))
        .into_iter()
        .filter(|s| !s.is_empty())
        .map(escape)
        .collect();
    match sources.is_empty() {
        true => String::new(),
        false => format!("<p>Published times: {}.</p>\n", sources.join("; ")),
    }
}
