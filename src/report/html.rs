//! The page.

use super::format::count;
use super::markup::{section, strip_tags};
use super::order::{RUST, distinct};
use super::verdicts::{badge, class, counts, meaning, symbol};
use super::{
    PublishedRow, accuracy, engines, exhibits, pictures, summary, table1, timing, verdicts,
};
use crate::harness::record::{AgreementRow, Record, Verdict};

const STYLE: &str = include_str!("style.css");

/// One self-contained page that tells what a run found: UTF-8, style and pictures inline, no scripts, nothing fetched.
///
/// `published` are the paper's times to set beside the fits of the same size (see [`PublishedRow::table_1`]). Everything that comes from the
/// record is escaped. Costs one pass over the record for each section.
pub fn html(record: &Record, published: &[PublishedRow]) -> String {
    let sections = sections(record, published);
    let links: String = sections
        .iter()
        .map(|(id, heading, _)| format!("<li><a href=\"#{id}\">{heading}</a></li>"))
        .collect();
    let body: String = sections
        .iter()
        .map(|(id, heading, body)| section(id, heading, body))
        .collect();
    let headline = headline(&record.agreement);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>meshseq report: {}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <header>\n<h1>meshseq report</h1>\n{headline}{}{}</header>\n\
         <nav aria-label=\"Sections\"><ul>{links}</ul></nav>\n<main>\n{body}</main>\n</body>\n</html>\n",
        strip_tags(&headline).trim(),
        tally(&record.agreement),
        how_to_read(),
    )
}

/// Anchor, heading and body of every section, in order.
fn sections(
    record: &Record,
    published: &[PublishedRow],
) -> Vec<(&'static str, &'static str, String)> {
    vec![
        ("glance", "At a glance", summary::table(record)),
        (
            "verdicts",
            "Verdicts",
            verdicts::matrices(&record.agreement) + &verdicts::tolerances(&record.agreement),
        ),
        (
            "messages",
            "What did not agree, and why",
            verdicts::messages(&record.agreement),
        ),
        (
            "accuracy",
            "Accuracy, stage by stage",
            accuracy::key() + &accuracy::tables(&record.accuracy),
        ),
        (
            "timing",
            "Timing, beside every engine",
            timing::sections(record) + &timing::sources(&record.timing),
        ),
        (
            "table1",
            "Timing, beside the paper",
            table1::table(record, published),
        ),
        (
            "exhibits",
            "What the algorithms do",
            exhibits::all(&record.exhibits),
        ),
        (
            "pictures",
            "Pictures of the fits",
            pictures::fits(&record.figures),
        ),
        (
            "engines",
            "Engines and their receipts",
            engines::table(&record.engines),
        ),
        (
            "skipped",
            "Skipped cases",
            engines::skipped(&record.skipped),
        ),
        (
            "origin",
            "Where and how this was run",
            engines::origin(record),
        ),
    ]
}

/// The run in one sentence.
fn headline(rows: &[AgreementRow]) -> String {
    let [agree, differ, error, timeout, missing, _] = counts(rows);
    let peers = distinct(
        rows.iter()
            .filter(|r| matches!(r.verdict, Verdict::Agree | Verdict::Differ))
            .map(|r| r.engine.as_str()),
    );
    let peers = peers.iter().filter(|&&e| e != RUST).count();
    let cases = distinct(rows.iter().map(|r| r.case.as_str())).len();
    let (verdict, text) = match (differ + error + timeout, agree, missing) {
        (0, 0, 0) => (Verdict::Missing, "This run checked nothing".to_owned()),
        (0, 0, n) => (
            Verdict::Missing,
            format!("Nothing was checked: {} for want of an engine", tell(n)),
        ),
        (0, n, 0) => (Verdict::Agree, format!("All {n} answers agree")),
        (0, n, m) => (
            Verdict::Agree,
            format!(
                "All {n} answers agree; {} for want of an engine",
                unchecked(m)
            ),
        ),
        (bad, n, _) => (
            Verdict::Differ,
            format!("{bad} of {} answers do not agree", n + bad),
        ),
    };
    format!(
        "<p class=\"headline {}\"><span class=\"sign\" aria-hidden=\"true\">{}</span> {text}: {}, {} beside ours</p>\n",
        class(verdict),
        symbol(verdict),
        count(cases, "case"),
        count(peers, "engine")
    )
}

fn tell(n: usize) -> String {
    match n {
        1 => "1 was left out".into(),
        n => format!("{n} were left out"),
    }
}

fn unchecked(n: usize) -> String {
    match n {
        1 => "1 could not be asked".into(),
        n => format!("{n} could not be asked"),
    }
}

/// How many answers have each verdict, with what it means.
fn tally(rows: &[AgreementRow]) -> String {
    let items: String = Verdict::ALL
        .iter()
        .zip(counts(rows))
        .map(|(&verdict, n)| {
            let quiet = if n == 0 { " class=\"zero\"" } else { "" };
            format!(
                "<li{quiet}><b>{n}</b> {} <span class=\"faint\">{}</span></li>\n",
                badge(verdict),
                meaning(verdict)
            )
        })
        .collect();
    format!("<ul class=\"tally\" aria-label=\"Verdicts\">\n{items}</ul>\n")
}

fn how_to_read() -> &'static str {
    "<h2 class=\"how\">How to read this page</h2>\n<ol class=\"how\">\n\
     <li>Each <b>case</b> gives one stage of the algorithm one input; every <b>engine</b> - ours is <b>rust</b>, the others are independent \
     programs - answers it, and a <b>verdict</b> says whether the answer holds every check.</li>\n\
     <li>The <b>number beneath a verdict</b> is the worst difference over its tolerance: at most 1 agrees, 0.001 is a thousand times nearer \
     than it has to be. Hover over it, or look under the matrices, for what was measured and why that tolerance.</li>\n\
     <li><b>Times</b> are medians over rounds in which each engine ran in turn; a <b>ratio</b> is an engine's time over rust's: 12× means that \
     rust is twelve times as fast.</li>\n</ol>\n"
}
