//! Accuracy: every quantity that the harness recomputed, a table a stage, engines side by side.

use std::collections::BTreeMap;

use super::format::{chosen, number};
use super::markup::{Cell, Group, Table, escape, name};
use super::order::{distinct, engines};
use super::verdicts::{badge, class, symbol};
use crate::harness::record::{AccuracyRow, Verdict};

type Index<'a> = BTreeMap<(&'a str, &'a str, &'a str), &'a AccuracyRow>;

/// One table a stage: quantities of each case down, engines across.
pub(super) fn tables(rows: &[AccuracyRow]) -> String {
    if rows.is_empty() {
        return "<p>This run recomputed no quantities.</p>\n".into();
    }
    let stages = distinct(rows.iter().map(|r| r.stage.as_str()));
    let tables: String = stages
        .iter()
        .map(|stage| {
            let of_stage: Vec<_> = rows.iter().filter(|r| r.stage == *stage).collect();
            table(stage, &of_stage)
        })
        .collect();
    format!("<div class=\"tables\">{tables}</div>\n")
}

fn table(stage: &str, rows: &[&AccuracyRow]) -> String {
    let across = engines(rows.iter().map(|r| r.engine.as_str()));
    let index: Index = rows
        .iter()
        .map(|r| {
            (
                (r.case.as_str(), r.quantity.as_str(), r.engine.as_str()),
                *r,
            )
        })
        .collect();
    let mut by_case: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for row in rows {
        by_case.entry(&row.case).or_default().push(&row.quantity);
    }
    let group = |case: &str| Group {
        heading: name(case),
        rows: distinct(by_case.get(case).into_iter().flatten().copied())
            .into_iter()
            .map(|quantity| line(&index, case, quantity, &across))
            .collect(),
    };
    let mut columns = vec![Cell::text("quantity"), Cell::number("tolerance")];
    columns.extend(across.iter().map(|e| Cell::number(name(e))));
    Table {
        caption: name(stage),
        columns,
        groups: distinct(rows.iter().map(|r| r.case.as_str()))
            .into_iter()
            .map(group)
            .collect(),
    }
    .html()
}

fn line(index: &Index, case: &str, quantity: &str, across: &[&str]) -> Vec<Cell> {
    let found: Vec<Option<&AccuracyRow>> = across
        .iter()
        .map(|&engine| index.get(&(case, quantity, engine)).copied())
        .collect();
    let mut cells = vec![Cell::text(escape(quantity)), tolerance(&found)];
    cells.extend(found.into_iter().map(value));
    cells
}

/// The tolerance that all engines share; each of them, where they do not.
fn tolerance(found: &[Option<&AccuracyRow>]) -> Cell {
    let held = found.iter().flatten().filter_map(|r| r.tolerance);
    let held: Vec<String> = held.map(chosen).collect();
    let unique = distinct(held.iter().map(String::as_str));
    match unique.is_empty() {
        true => Cell::classed("n faint", "reported only"),
        false => Cell::number(unique.join(", ")),
    }
}

fn value(row: Option<&AccuracyRow>) -> Cell {
    let Some(row) = row else {
        return Cell::classed("none", "<span aria-label=\"none\">·</span>");
    };
    let text = number(row.value);
    let cell = match row.verdict {
        Verdict::Agree => Cell::number(text),
        verdict => Cell::number(format!(
            "<span class=\"{}\" aria-label=\"{verdict}\">{}</span> {text}",
            class(verdict),
            symbol(verdict)
        )),
    };
    match row.tolerance {
        Some(t) => cell.titled(&format!("{}: {}, tolerance {t:e}", row.verdict, row.value)),
        None => cell.titled(&format!("{}", row.value)),
    }
}

/// What the signs beside a value mean.
pub(super) fn key() -> String {
    format!(
        "<p>Each number is computed by the harness from the arrays that the engine sent back: no engine grades itself. \
         A value outside its tolerance is marked {}.</p>\n",
        badge(Verdict::Differ)
    )
}
