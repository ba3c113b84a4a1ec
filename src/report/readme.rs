//! What the README shows of a record, and how it gets there.

use thiserror::Error;

use super::format::{number, seconds, times};
use super::plots::time_signal;
use super::summary::{Stage, stages};
use crate::harness::record::{FitFigures, Record};

/// Every stage in one line of a Markdown table: what is compared, beside which engines, how near to its tolerance, how fast.
///
/// The time is that of the stage's slowest case among those that a peer was timed on too, and the ratio is the peer's time over Rust's.
pub fn readme_table(record: &Record) -> String {
    let mut table = String::from(
        "| stage | what is compared | beside | worst difference / tolerance | rust, median | fastest peer |\n\
         |---|---|---|--:|--:|--:|\n",
    );
    for stage in stages(record) {
        table += &format!("| {} |\n", cells(&stage).map(|c| plain(&c)).join(" | "));
    }
    table
}

fn cells(stage: &Stage) -> [String; 6] {
    let worst = stage.worst.map_or(String::new(), number);
    let failed = match stage.failures {
        0 => String::new(),
        n => format!(" ({n} failed)"),
    };
    let (median, peer) = match &stage.time {
        None => Default::default(),
        Some(t) => (
            format!("{} ({})", seconds(t.rust_seconds), last_part(t.case)),
            t.peer
                .map_or(String::new(), |(e, r)| format!("{e}, {}", times(r))),
        ),
    };
    [
        stage.name.to_owned(),
        stage.compared_text(),
        stage.peers_text(),
        worst + &failed,
        median,
        peer,
    ]
}

/// What tells a case from the others of its stage: what stands after the last slash.
fn last_part(case: &str) -> &str {
    case.rsplit('/').next().unwrap_or(case)
}

/// Text that is nothing but text in a cell of a Markdown table.
fn plain(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '&' => safe.push_str("&amp;"),
            '|' | '\\' | '`' | '*' | '_' | '[' | ']' | '!' | '#' | '~' => safe.extend(['\\', c]),
            c if c.is_control() => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

/// The time signal of the horse where the record has it, else that of `@gallop` or its small variant, as one SVG file; none where there is none
/// of them or it cannot be drawn.
pub fn readme_picture(record: &Record) -> Option<String> {
    let wanted: [fn(&FitFigures) -> bool; 3] = [
        |f| f.dataset.starts_with("horse"),
        |f| f.dataset == "@gallop",
        |f| f.dataset.starts_with("@gallop"),
    ];
    let found = wanted
        .iter()
        .find_map(|is| record.figures.iter().find(|f| is(f)))?;
    time_signal::picture(found).svg.ok()
}

/// Why a text cannot be put between its markers.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum SpliceError {
    /// A marker that is not there.
    #[error("expected one line with {marker}, found none; add it where the generated text goes")]
    Missing { marker: String },
    /// A marker that is there more than once.
    #[error("expected one {marker}, found it again on line {line}; keep one")]
    Repeated { marker: String, line: usize },
    /// An end before its begin.
    #[error("{marker} on line {line} stands before its begin; put it after")]
    EndBeforeBegin { marker: String, line: usize },
    /// A text that would break the markers it is put between.
    #[error("the text to put in has {marker} of its own, which would end it early")]
    MarkerInText { marker: String },
}

/// Replaces what stands between `<!-- marker: begin -->` and `<!-- marker: end -->` by `text` on lines of its own. The rest stays as it is,
/// and splicing the same text again changes nothing.
pub fn splice(readme: &str, marker: &str, text: &str) -> Result<String, SpliceError> {
    let (begin, end) = (
        format!("<!-- {marker}: begin -->"),
        format!("<!-- {marker}: end -->"),
    );
    for mark in [&begin, &end] {
        if text.contains(mark.as_str()) {
            return Err(SpliceError::MarkerInText {
                marker: mark.clone(),
            });
        }
    }
    let from = only(readme, &begin)? + begin.len();
    let to = only(readme, &end)?;
    if to < from {
        return Err(SpliceError::EndBeforeBegin {
            marker: end,
            line: line_of(readme, to),
        });
    }
    let text = text.trim_matches('\n');
    Ok(format!("{}\n{text}\n{}", &readme[..from], &readme[to..]))
}

/// The byte at which the only `mark` begins.
fn only(readme: &str, mark: &str) -> Result<usize, SpliceError> {
    let mut places = readme.match_indices(mark).map(|(at, _)| at);
    let first = places.next().ok_or_else(|| SpliceError::Missing {
        marker: mark.to_owned(),
    })?;
    match places.next() {
        None => Ok(first),
        Some(again) => Err(SpliceError::Repeated {
            marker: mark.to_owned(),
            line: line_of(readme, again),
        }),
    }
}

/// The line, from 1, of a byte.
fn line_of(text: &str, byte: usize) -> usize {
    text.as_bytes()[..byte]
        .iter()
        .filter(|&&b| b == b'\n')
        .count()
        + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    const README: &str = "# Title\n\n<!-- t: begin -->\nold\n<!-- t: end -->\nrest | of it\n";

    #[test]
    fn splice_replaces_only_what_is_between_and_settles() {
        let once = splice(README, "t", "| a |\n|---|\n").unwrap();
        assert_eq!(
            once,
            "# Title\n\n<!-- t: begin -->\n| a |\n|---|\n<!-- t: end -->\nrest | of it\n"
        );
        assert_eq!(splice(&once, "t", "| a |\n|---|\n").unwrap(), once);
    }

    #[test]
    fn splice_says_what_is_wrong_with_the_markers() {
        let error = |readme: &str, text: &str| splice(readme, "t", text).unwrap_err();
        assert!(matches!(
            error("nothing", ""),
            SpliceError::Missing { marker } if marker == "<!-- t: begin -->"
        ));
        assert!(matches!(
            error("<!-- t: begin -->", ""),
            SpliceError::Missing { marker } if marker == "<!-- t: end -->"
        ));
        let twice = format!("{README}\n<!-- t: begin -->");
        assert!(matches!(
            error(&twice, ""),
            SpliceError::Repeated { line: 8, .. }
        ));
        let turned = "<!-- t: end -->\n<!-- t: begin -->";
        assert!(matches!(
            error(turned, ""),
            SpliceError::EndBeforeBegin { line: 1, .. }
        ));
        assert!(matches!(
            error(README, "x <!-- t: end --> y"),
            SpliceError::MarkerInText { .. }
        ));
    }

    #[test]
    fn a_cell_of_markdown_is_only_text() {
        assert_eq!(
            plain("a|b\n<!-- t: end --> `x`"),
            "a\\|b &lt;\\!-- t: end --&gt; \\`x\\`"
        );
    }
}
