//! The paper's Table 1 beside this run: the fits of a record that are fits of the paper too.

use super::PublishedRow;
use super::format::{seconds, times};
use super::markup::{Cell, Group, Table, escape, name};
use crate::harness::record::FitFigures;

/// Milliseconds of a fit, with the paper's where it gives one.
struct Pair {
    signal: &'static str,
    ours: f64,
    paper: Option<f64>,
}

/// The rows of Table 1 that this fit has the size and constants of: n, d, k, l and m.
fn matching<'a>(
    figures: &FitFigures,
    published: &'a [PublishedRow],
) -> impl Iterator<Item = &'a PublishedRow> {
    let ours = [figures.frames, figures.d, figures.k, figures.l, figures.m];
    published
        .iter()
        .filter(move |p| [p.n, p.d, p.k, p.l, p.m] == ours)
}

fn pairs(figures: &FitFigures, paper: &PublishedRow) -> [Pair; 5] {
    let [h, mds, rbf, g, f] = figures.milliseconds;
    let pair = |signal, ours, paper| Pair {
        signal,
        ours,
        paper,
    };
    [
        pair("h, shape signal", h, Some(paper.h_ms)),
        pair("p, scaling to the pose plane", mds, None),
        pair("one radial-basis fit, mean", rbf, Some(paper.rbf_ms)),
        pair("g, the whole greedy search", g, Some(paper.g_ms)),
        pair("f, time signal", f, Some(paper.f_ms)),
    ]
}

fn line(pair: &Pair) -> Vec<Cell> {
    let (paper, ratio) = match pair.paper {
        None => ("not given".into(), String::new()),
        Some(p) if pair.ours > 0.0 => (seconds(p / 1e3), times(p / pair.ours)),
        Some(p) => (seconds(p / 1e3), "no time to compare".into()),
    };
    vec![
        Cell::text(pair.signal),
        Cell::number(seconds(pair.ours / 1e3)),
        Cell::number(paper),
        Cell::number(ratio),
    ]
}

fn group(figures: &FitFigures, paper: &PublishedRow) -> Group {
    Group {
        heading: format!(
            "{} as in figure {} of the paper ({} space; n = {}, d = {}, k = {}, l = {}, m = {})",
            name(&figures.case),
            escape(&paper.figure),
            escape(&paper.space),
            paper.n,
            paper.d,
            paper.k,
            paper.l,
            paper.m
        ),
        rows: pairs(figures, paper).iter().map(line).collect(),
    }
}

/// The table, and which rows of Table 1 no fit of this run corresponds to.
pub(super) fn table(figures: &[FitFigures], published: &[PublishedRow]) -> String {
    if published.is_empty() {
        return "<p>No published times were given to compare with.</p>\n".into();
    }
    let groups: Vec<Group> = figures
        .iter()
        .flat_map(|f| matching(f, published).map(move |p| group(f, p)))
        .collect();
    let beside = match groups.is_empty() {
        true => "<p>No fit of this run has the size and the constants of a row of Table 1. The real horse and cow do: \
                 run with <code>--data DIR</code>, a folder that holds them.</p>\n"
            .into(),
        false => compared(groups),
    };
    beside + &unmatched(figures, published)
}

fn compared(groups: Vec<Group>) -> String {
    let table = Table {
        caption: "Cashman &amp; Hormann 2012, Table 1, beside this run".into(),
        columns: vec![
            Cell::text("signal"),
            Cell::number("this run"),
            Cell::number("paper"),
            Cell::number("paper / this run"),
        ],
        groups,
    };
    format!(
        "<p>The paper's machine was an Intel Core i7 at 2.67 GHz of 2012 or before, and its times are whole milliseconds: the ratio tells \
         of both the machine and the method, and a time of 1 ms may be anything up to 1.5.</p>\n{}",
        table.html()
    )
}

fn unmatched(figures: &[FitFigures], published: &[PublishedRow]) -> String {
    let has_fit = |p: &&PublishedRow| {
        !figures
            .iter()
            .any(|f| matching(f, published).any(|q| q == *p))
    };
    let rest: Vec<String> = published
        .iter()
        .filter(has_fit)
        .map(|p| {
            format!(
                "figure {} ({} space, n = {}, d = {})",
                escape(&p.figure),
                escape(&p.space),
                p.n,
                p.d
            )
        })
        .collect();
    match rest.is_empty() {
        true => String::new(),
        false => format!(
            "<p class=\"faint\">Rows of Table 1 without a fit in this run: {}.</p>\n",
            rest.join("; ")
        ),
    }
}
