//! Verdicts: their words and symbols, the matrix of cases and engines, and what was said where something is wrong.

use std::collections::BTreeMap;

use super::format::{chosen, count, number};
use super::markup::{Cell, Group, Table, escape, name};
use super::order::{distinct, engines};
use crate::harness::record::{AgreementRow, Verdict};

/// A sign beside the word and the colour, for who cannot tell the colours apart.
pub(super) fn symbol(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Agree => "✓",
        Verdict::Differ => "≠",
        Verdict::Error => "!",
        Verdict::Timeout => "…",
        Verdict::Missing => "○",
        Verdict::Unsupported => "–",
    }
}

/// What a verdict means, in words.
pub(super) fn meaning(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Agree => "every check holds",
        Verdict::Differ => "a check does not hold",
        Verdict::Error => "the engine failed, crashed or answered garbage",
        Verdict::Timeout => "no answer in time",
        Verdict::Missing => "the engine is not installed",
        Verdict::Unsupported => "the engine does not do this",
    }
}

/// The class that colours a verdict.
pub(super) fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Agree => "v agree",
        Verdict::Differ => "v differ",
        Verdict::Error => "v error",
        Verdict::Timeout => "v timeout",
        Verdict::Missing => "v missing",
        Verdict::Unsupported => "v unsupported",
    }
}

/// Symbol and word in the verdict's colour.
pub(super) fn badge(verdict: Verdict) -> String {
    format!(
        "<span class=\"{}\"><span aria-hidden=\"true\">{}</span> {verdict}</span>",
        class(verdict),
        symbol(verdict)
    )
}

/// How many rows have each verdict, in the order of [`Verdict::ALL`].
pub(super) fn counts(rows: &[AgreementRow]) -> [usize; 6] {
    Verdict::ALL.map(|v| rows.iter().filter(|r| r.verdict == v).count())
}

/// A row's worst difference over its tolerance; a tolerance of 0 allows 0 only.
pub(super) fn margin(row: &AgreementRow) -> Option<f64> {
    let (value, tolerance) = (row.value?, row.tolerance?);
    Some(match value.abs() {
        0.0 => 0.0,
        size => size / tolerance,
    })
}

/// One table a stage: cases down, engines across.
pub(super) fn matrices(rows: &[AgreementRow]) -> String {
    if rows.is_empty() {
        return "<p>This run gave no verdicts.</p>\n".into();
    }
    let stages = distinct(rows.iter().map(|r| r.stage.as_str()));
    let tables: String = stages
        .iter()
        .map(|stage| {
            let of_stage: Vec<_> = rows.iter().filter(|r| r.stage == *stage).collect();
            matrix(stage, &of_stage)
        })
        .collect();
    format!("<div class=\"tables\">{tables}</div>\n")
}

fn matrix(stage: &str, rows: &[&AgreementRow]) -> String {
    let across = engines(rows.iter().map(|r| r.engine.as_str()));
    let mut at: BTreeMap<(&str, &str), Vec<&AgreementRow>> = BTreeMap::new();
    for row in rows {
        at.entry((&row.case, &row.engine)).or_default().push(row);
    }
    let line = |case: &str| {
        let mut cells = vec![Cell::text(name(case))];
        cells.extend(across.iter().map(|&engine| match at.get(&(case, engine)) {
            Some(rows) => verdict_cell(rows),
            None => Cell::classed("none", "<span aria-label=\"not asked\">·</span>"),
        }));
        cells
    };
    let mut columns = vec![Cell::text("case")];
    columns.extend(across.iter().map(|e| Cell::text(name(e))));
    Table {
        caption: name(stage),
        columns,
        groups: vec![Group {
            heading: String::new(),
            rows: distinct(rows.iter().map(|r| r.case.as_str()))
                .into_iter()
                .map(line)
                .collect(),
        }],
    }
    .html()
}

fn verdict_cell(rows: &[&AgreementRow]) -> Cell {
    let one = |row: &&AgreementRow| {
        let margin = margin(row).map_or(String::new(), |m| {
            format!("<span class=\"margin\">{}</span>", number(m))
        });
        format!("{}{margin}", badge(row.verdict))
    };
    let html: Vec<String> = rows.iter().map(one).collect();
    let title: Vec<String> = rows.iter().map(|r| explanation(r)).collect();
    Cell::classed("verdict", html.join("<br>")).titled(&title.join("\n"))
}

/// Quantity, value, tolerance and reason in one sentence, not yet escaped; the message where there is no quantity.
fn explanation(row: &AgreementRow) -> String {
    let mut text = row.quantity.clone().unwrap_or_default();
    if let Some(value) = row.value {
        text += &format!(" = {}", number(value));
    }
    if let Some(tolerance) = row.tolerance {
        text += &format!(", tolerance {}", chosen(tolerance));
    }
    if !row.reason.is_empty() {
        text += &format!(" ({})", row.reason);
    }
    match text.trim() {
        "" => row.message.clone(),
        text => text.to_owned(),
    }
}

/// What stands behind every verdict that is not agree, in full; those that said the same are told once.
pub(super) fn messages(rows: &[AgreementRow]) -> String {
    let mut items = String::new();
    for verdict in Verdict::ALL {
        let told = |r: &&AgreementRow| {
            r.verdict == verdict && (verdict != Verdict::Agree || !r.message.is_empty())
        };
        items += &messages_of(verdict, rows.iter().filter(told));
    }
    match items.as_str() {
        "" if rows.is_empty() => "<p>Nothing was asked.</p>\n".into(),
        "" => "<p>Nothing: every engine that was asked agreed.</p>\n".into(),
        _ => format!("<dl class=\"messages\">\n{items}</dl>\n"),
    }
}

fn messages_of<'a>(verdict: Verdict, rows: impl Iterator<Item = &'a AgreementRow>) -> String {
    let mut order: Vec<(&str, String)> = Vec::new();
    let mut cases: BTreeMap<(&str, String), Vec<&str>> = BTreeMap::new();
    for row in rows {
        let key = (row.engine.as_str(), said(row));
        let list = cases.entry(key.clone()).or_default();
        if list.is_empty() {
            order.push(key);
        }
        list.push(&row.case);
    }
    order
        .into_iter()
        .map(|key| {
            let (engine, text) = (escape(key.0), escape(&key.1));
            let names = cases.get(&key).map_or(&[][..], Vec::as_slice);
            let list: Vec<String> = names.iter().map(|c| name(c)).collect();
            format!(
                "<div><dt>{} <b>{engine}</b> <span class=\"faint\">on {}:</span> {}</dt><dd><pre>{text}</pre></dd></div>\n",
                badge(verdict),
                count(names.len(), "case"),
                list.join(", ")
            )
        })
        .collect()
}

/// What a row says of itself, not yet escaped.
fn said(row: &AgreementRow) -> String {
    let mut parts = Vec::new();
    if row.quantity.is_some() || row.value.is_some() {
        parts.push(explanation(row));
    }
    if !row.message.trim().is_empty() {
        parts.push(row.message.trim().to_owned());
    }
    match parts.is_empty() {
        true => format!("{}; it gave no message", meaning(row.verdict)),
        false => parts.join("\n"),
    }
}

/// Every tolerance that a worst check was held against, with its reason, as the matrix only shows them where a pointer hovers.
pub(super) fn tolerances(rows: &[AgreementRow]) -> String {
    let key = |r: &AgreementRow| {
        let (quantity, tolerance) = (r.quantity.as_ref()?, r.tolerance?);
        Some([
            r.stage.clone(),
            quantity.clone(),
            chosen(tolerance),
            r.reason.clone(),
        ])
    };
    let mut seen = std::collections::HashSet::new();
    let unique: Vec<_> = rows
        .iter()
        .filter_map(key)
        .filter(|k| seen.insert(k.clone()))
        .collect();
    if unique.is_empty() {
        return String::new();
    }
    let group = |stage: &str| Group {
        heading: name(stage),
        rows: unique
            .iter()
            .filter(|k| k[0] == stage)
            .map(|[_, quantity, tolerance, reason]| {
                vec![
                    Cell::text(escape(quantity)),
                    Cell::number(tolerance.clone()),
                    Cell::classed("long", escape(reason)),
                ]
            })
            .collect(),
    };
    Table {
        caption: "Tolerances of the checks nearest to failing, and why they are what they are"
            .into(),
        columns: vec![
            Cell::text("quantity"),
            Cell::number("tolerance"),
            Cell::text("reason"),
        ],
        groups: distinct(unique.iter().map(|k| k[0].as_str()))
            .into_iter()
            .map(group)
            .collect(),
    }
    .html()
}
