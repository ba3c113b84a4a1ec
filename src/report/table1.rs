//! The paper's Table 1 beside this run: the timed cases that say which of its rows they are, each beside the paper's time and numpy's or scipy's.

use super::PublishedRow;
use super::format::{seconds, times};
use super::markup::{Cell, Group, Table, escape};
use super::order::RUST;
use crate::harness::record::{Record, TimingRow};

/// A column of the paper's table: what it times, the stage that does it, and the paper's milliseconds.
type Column = (&'static str, &'static str, fn(&PublishedRow) -> f64);

const COLUMNS: [Column; 4] = [
    ("f, time signal", "signal.spline", |row| row.f_ms),
    ("one radial-basis approximation", "signal.rbf", |row| {
        row.rbf_ms
    }),
    ("g, the whole greedy search", "signal.sites", |row| row.g_ms),
    ("h, shape signal", "signal.h", |row| row.h_ms),
];
/// Engines that are numpy or scipy, by how their names begin.
const PEERS: [&str; 2] = ["numpy", "scipy"];

/// One time of Table 1.
struct Time<'a> {
    signal: &'static str,
    /// Seconds.
    paper: f64,
    ours: Option<&'a TimingRow>,
    /// The faster of numpy and scipy.
    peer: Option<&'a TimingRow>,
}

/// A row of Table 1 and its times in this run.
type Row<'a, 'p> = (&'p PublishedRow, [Time<'a>; 4]);

/// What a case of this row of Table 1 gives as the source of its published time.
pub fn source(row: &PublishedRow) -> String {
    format!("Table 1, Figure {}", row.figure)
}

fn time<'a>(record: &'a Record, row: &PublishedRow, column: &Column) -> Time<'a> {
    let &(signal, stage, milliseconds) = column;
    let source = source(row);
    let is_ours =
        |t: &&TimingRow| t.engine == RUST && t.stage == stage && t.published_source == source;
    let ours = record.timing.iter().find(is_ours);
    // The paper's time stands with our row alone; other engines are of the same case.
    let is_peer = |t: &&TimingRow| {
        ours.is_some_and(|ours| ours.case == t.case)
            && PEERS.iter().any(|p| t.engine.starts_with(p))
    };
    let peers = record.timing.iter().filter(is_peer);
    Time {
        signal,
        paper: milliseconds(row) / 1e3,
        ours,
        peer: peers.min_by(|a, b| a.ratio_to_rust.total_cmp(&b.ratio_to_rust)),
    }
}

impl Time<'_> {
    /// Signal, this run, paper, paper over this run, numpy or scipy, that over this run; not escaped.
    fn words(&self) -> [String; 6] {
        let ours = self.ours.map(|t| t.median_seconds);
        let over = |ours: f64| match ours > 0.0 {
            true => times(self.paper / ours),
            false => "no time to compare".into(),
        };
        let peer = |t: &TimingRow| format!("{} {}", t.engine, seconds(t.median_seconds));
        [
            self.signal.into(),
            ours.map_or("not timed".into(), seconds),
            seconds(self.paper),
            ours.map_or(String::new(), over),
            self.peer.map_or(String::new(), peer),
            self.peer.map_or(String::new(), |t| times(t.ratio_to_rust)),
        ]
    }
}

/// Times of every row of Table 1 that has any in this record, and the rows that have none.
fn rows<'a, 'p>(
    record: &'a Record,
    published: &'p [PublishedRow],
) -> (Vec<Row<'a, 'p>>, Vec<&'p PublishedRow>) {
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for row in published {
        let times = COLUMNS.map(|column| time(record, row, &column));
        match times.iter().any(|t| t.ours.is_some()) {
            true => with.push((row, times)),
            false => without.push(row),
        }
    }
    (with, without)
}

fn heading(row: &PublishedRow) -> String {
    format!(
        "Figure {} ({} space; n = {}, d = {}, k = {}, l = {}, m = {})",
        row.figure, row.space, row.n, row.d, row.k, row.l, row.m
    )
}

const HEADS: [&str; 6] = [
    "signal",
    "this run",
    "paper",
    "paper / this run",
    "numpy or scipy",
    "numpy or scipy / this run",
];

/// The table, and which rows of Table 1 no case of this run times.
pub(super) fn table(record: &Record, published: &[PublishedRow]) -> String {
    if published.is_empty() {
        return "<p>No published times were given to compare with.</p>\n".into();
    }
    let (with, without) = rows(record, published);
    let beside = match with.is_empty() {
        true => "<p>Nothing that Table 1 times was timed in this run; <code>meshseq verify --time</code> does, and with \
                 <code>--data DIR</code> on the real horse and cow too.</p>\n"
            .into(),
        false => compared(&with),
    };
    beside + &unmatched(&without)
}

fn compared(rows: &[Row]) -> String {
    let cells = |time: &Time| {
        let [signal, ours, rest @ ..] = time.words().map(|word| escape(&word));
        let ours = match time.ours {
            Some(row) => Cell::number(ours).titled(&row.case),
            None => Cell::number(ours),
        };
        let mut cells = vec![Cell::text(signal), ours];
        cells.extend(rest.map(Cell::number));
        cells
    };
    let [first, rest @ ..] = HEADS;
    let mut columns = vec![Cell::text(first)];
    columns.extend(rest.map(Cell::number));
    let table = Table {
        caption: "Cashman &amp; Hormann 2012, Table 1, beside this run".into(),
        columns,
        groups: rows
            .iter()
            .map(|(row, times)| Group {
                heading: escape(&heading(row)),
                rows: times.iter().map(cells).collect(),
            })
            .collect(),
    };
    format!(
        "<p>Medians. The paper's machine was an Intel Core i7 at 2.67 GHz of 2012 or before, and its times are whole milliseconds: the ratio tells \
         of both the machine and the method, and a time of 1 ms may be anything up to 1.5. Figures 4 and 5 stand for embedded sequences of the \
         same d and n, on which times depend, not for the paper's own.</p>\n{}",
        table.html()
    )
}

fn unmatched(rows: &[&PublishedRow]) -> String {
    let rest: Vec<String> = rows.iter().map(|row| escape(&heading(row))).collect();
    match rest.is_empty() {
        true => String::new(),
        false => format!(
            "<p class=\"faint\">Rows of Table 1 that this run does not time: {}.</p>\n",
            rest.join("; ")
        ),
    }
}

/// The table as lines for a terminal, empty where nothing of it was timed.
pub fn table_1_text(record: &Record, published: &[PublishedRow]) -> String {
    let (with, _) = rows(record, published);
    let lines = with.iter().flat_map(|(row, times)| {
        let mut lines = vec![heading(row)];
        lines.extend(times.iter().map(|t| line(&t.words())));
        lines
    });
    let lines: Vec<String> = lines.collect();
    match lines.is_empty() {
        true => String::new(),
        false => format!(
            "Table 1\n{}\n{}",
            line(&HEADS.map(String::from)),
            lines.join("\n")
        ),
    }
}

fn line([signal, ours, paper, over, peer, ratio]: &[String; 6]) -> String {
    format!("  {signal:<32}{ours:>10}{paper:>10}{over:>18}{peer:>20}{ratio:>28}")
}
