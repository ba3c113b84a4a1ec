//! Times of a stage: a bar for each engine, with the spread of its samples.

use std::collections::BTreeMap;

use plotters::style::text_anchor::HPos;
use plotters::style::{RGBColor, WHITE};

use super::axis::Axis;
use super::canvas::{Canvas, FINE, Frame, LETTERS, Mark, chart, text_width};
use super::legend::Entry;
use super::{BLUE, INK, PURPLE, Picture, PlotError, VERMILION, drawable, drawable_positive};
use crate::harness::record::{SampleRow, TimingRow};
use crate::report::format::{seconds, times};
use crate::report::order::{RUST, distinct};

/// Rows that a picture has at most; the table has them all.
const MOST_ROWS: usize = 60;
const ROW: i32 = 24;
/// Letters of a name before it is cut.
const NAME: usize = 24;

const LEGEND: [Entry; 3] = [
    (Mark::Dot, VERMILION, "rust, median"),
    (Mark::Square, BLUE, "peer, median"),
    (Mark::Diamond, PURPLE, "published"),
];

/// One row of the picture.
enum Row {
    Case(String),
    Engine {
        name: String,
        median: f64,
        spread: (f64, f64),
        ratio: f64,
    },
    Paper(f64),
}

/// The times of one stage; `samples` give the spread, and where there are none the median absolute deviation does.
pub(in crate::report) fn picture(
    stage: &str,
    rows: &[&TimingRow],
    samples: &[&SampleRow],
) -> Picture {
    let drawn: Vec<&TimingRow> = rows
        .iter()
        .copied()
        .filter(|r| drawable_positive(r.median_seconds))
        .collect();
    let left_out = rows.len() - drawn.len();
    let mut lines = lines(&drawn, &spreads(samples));
    let cut = lines.len().saturating_sub(MOST_ROWS);
    lines.truncate(MOST_ROWS);
    let mut notes = Vec::new();
    if left_out > 0 {
        notes.push(format!(
            "{left_out} of {} medians are not positive numbers and are left out.",
            rows.len()
        ));
    }
    if cut > 0 {
        notes.push(format!("{cut} more rows are in the table only."));
    }
    Picture {
        title: format!("Times of {stage}"),
        look: "Look at the gap between rust and its nearest peer, against the length of the whiskers, which run from the least to the greatest \
               sample. The axis is logarithmic: a step is a factor of ten."
            .into(),
        svg: draw(stage, &lines),
        notes,
    }
}

/// Least and greatest sample of each case and engine.
fn spreads<'a>(samples: &[&'a SampleRow]) -> BTreeMap<(&'a str, &'a str), (f64, f64)> {
    let mut spreads = BTreeMap::new();
    for s in samples.iter().filter(|s| drawable_positive(s.seconds)) {
        let (low, high) = spreads
            .entry((s.case.as_str(), s.engine.as_str()))
            .or_insert((s.seconds, s.seconds));
        *low = s.seconds.min(*low);
        *high = s.seconds.max(*high);
    }
    spreads
}

fn lines(rows: &[&TimingRow], spreads: &BTreeMap<(&str, &str), (f64, f64)>) -> Vec<Row> {
    let mut lines = Vec::new();
    for case in distinct(rows.iter().map(|r| r.case.as_str())) {
        let mut of_case: Vec<_> = rows.iter().filter(|r| r.case == case).collect();
        of_case.sort_by(|a, b| {
            let ours_first = (a.engine != RUST).cmp(&(b.engine != RUST));
            ours_first
                .then(a.median_seconds.total_cmp(&b.median_seconds))
                .then(a.engine.cmp(&b.engine))
        });
        lines.push(Row::Case(shortened(case, NAME + 20)));
        lines.extend(of_case.iter().map(|r| engine(r, spreads)));
        let paper = of_case.iter().find_map(|r| r.published_seconds);
        lines.extend(paper.filter(|&p| drawable_positive(p)).map(Row::Paper));
    }
    lines
}

fn engine(row: &TimingRow, spreads: &BTreeMap<(&str, &str), (f64, f64)>) -> Row {
    let deviation = if drawable(row.mad_seconds) {
        row.mad_seconds
    } else {
        0.0
    };
    let median = row.median_seconds;
    let from_samples = spreads.get(&(row.case.as_str(), row.engine.as_str()));
    Row::Engine {
        name: shortened(&row.engine, NAME),
        median,
        spread: *from_samples.unwrap_or(&(median - deviation, median + deviation)),
        ratio: row.ratio_to_rust,
    }
}

fn shortened(name: &str, most: usize) -> String {
    match name.chars().count() > most {
        true => name.chars().take(most - 1).chain(['…']).collect(),
        false => name.to_owned(),
    }
}

fn draw(stage: &str, lines: &[Row]) -> Result<String, PlotError> {
    let all = || lines.iter().flat_map(Row::numbers);
    if all().next().is_none() {
        return Err(PlotError::NothingToDraw("no time above zero"));
    }
    let names = lines.iter().map(|l| text_width(l.name(), LETTERS - 1));
    let label = format!("Times of {stage}, by case and engine, on a logarithmic axis");
    let rows = lines.len() as f64;
    let frame = Frame {
        size: (500, lines.len() as i32 * ROW + 112),
        label: &label,
        x: Axis::logarithmic(all(), 6, tick),
        y: Axis::between((0.0, rows), 1),
        x_title: "time of one call",
        y_title: "",
        sides: (names.max().unwrap_or(0) + 12, 126),
        legend: if lines.iter().any(|l| matches!(l, Row::Paper(_))) {
            &LEGEND
        } else {
            &LEGEND[..2]
        },
    };
    chart(&frame, |canvas| {
        lines.iter().enumerate().try_for_each(|(i, line)| {
            let middle = rows - i as f64 - 0.5;
            line.draw(canvas, middle)
        })
    })
}

/// A tick such as `10 ms`.
fn tick(x: f64) -> String {
    seconds(x).replace(".00 ", " ").replace(".0 ", " ")
}

impl Row {
    fn name(&self) -> &str {
        match self {
            Self::Case(_) => "",
            Self::Engine { name, .. } => name,
            Self::Paper(_) => "published",
        }
    }

    fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Case(_) => Vec::new(),
            Self::Engine { median, spread, .. } => vec![*median, spread.0, spread.1],
            Self::Paper(time) => vec![*time],
        }
    }

    fn draw(&self, canvas: &Canvas, middle: f64) -> Result<(), PlotError> {
        let [left, right, ..] = canvas.plane();
        let (_, y) = canvas.at([1.0, middle]);
        let name = |colour| {
            canvas.text(
                self.name(),
                (left - 8 * FINE, y),
                HPos::Right,
                LETTERS - 1,
                colour,
            )
        };
        let told =
            |text: &str| canvas.text(text, (right + 10 * FINE, y), HPos::Left, LETTERS - 1, INK);
        match self {
            Self::Case(case) => {
                let wide = text_width(case, LETTERS - 1) * FINE;
                let (from, to) = ((left + FINE, y - 9 * FINE), (left + wide, y + 9 * FINE));
                canvas.bar(from, to, WHITE)?;
                canvas.text(case, (left, y), HPos::Left, LETTERS - 1, INK)
            }
            Self::Paper(time) => {
                name(PURPLE)?;
                let at = canvas.at([*time, middle]);
                canvas.mark(Mark::Diamond, at, 6.0, PURPLE)?;
                told(&seconds(*time))
            }
            Self::Engine {
                median,
                spread,
                ratio,
                ..
            } => {
                name(INK)?;
                self.bar(canvas, *median, *spread, middle)?;
                told(&format!("{}, {}", seconds(*median), times(*ratio)))
            }
        }
    }

    /// A pale bar to the median, whiskers over the spread, and the median's mark.
    fn bar(
        &self,
        canvas: &Canvas,
        median: f64,
        spread: (f64, f64),
        middle: f64,
    ) -> Result<(), PlotError> {
        let (mark, colour, pale) = match self.name() == RUST {
            true => (Mark::Dot, VERMILION, RGBColor(250, 222, 200)),
            false => (Mark::Square, BLUE, RGBColor(212, 228, 242)),
        };
        let [left, ..] = canvas.plane();
        let (x, y) = canvas.at([median, middle]);
        canvas.bar((left, y - 7 * FINE), (x, y + 7 * FINE), pale)?;
        let ends = [spread.0, spread.1].map(|s| canvas.at([s, middle]).0);
        canvas.line(vec![(ends[0], y), (ends[1], y)], colour, 1.8)?;
        for end in ends {
            canvas.line(vec![(end, y - 6 * FINE), (end, y + 6 * FINE)], colour, 1.8)?;
        }
        canvas.mark(mark, (x, y), 3.4, colour)
    }
}
