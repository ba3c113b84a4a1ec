//! Edits of a time signal as a TOML list, for people: frames and control points are counted from 1, as in the paper.
//!
//! ```toml
//! [[edit]]
//! do = "move"            # control point 5 goes `by` so much, or `to` a place
//! control = 5
//! by = [0.2, -0.1]
//!
//! [[edit]]
//! do = "loop"            # new frames after frame 40, through points of the pose plane
//! after = 40
//! through = [[1.0, 2.0], [3.0, 1.0]]
//! frames = 19            # as many as keep the pace if not given
//! control = 15           # in proportion if not given
//!
//! [[edit]]
//! do = "repeat"          # or "delete", "reverse", "refine"
//! frames = "1..12"
//! times = 2              # 1 if not given
//! join = 3               # new frames at each seam, 0 if not given
//! ```

use std::ops::RangeInclusive;

use serde::Deserialize;
use thiserror::Error;

use super::Point;
use super::edit::{Edit, Target};

/// Why a text holds no edits.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EditsError {
    /// No TOML, or not of this form.
    #[error("{0}")]
    Toml(String),
    /// What one edit lacks or has too much of.
    #[error("edit {edit} (1-based): {what}")]
    Edit { edit: usize, what: String },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wire {
    edit: Vec<WireEdit>,
}

#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
enum WireEdit {
    Move {
        control: usize,
        to: Option<Point>,
        by: Option<Point>,
    },
    Loop {
        after: usize,
        through: Vec<Point>,
        frames: Option<usize>,
        control: Option<usize>,
    },
    Delete {
        frames: String,
        #[serde(default)]
        join: usize,
    },
    Repeat {
        frames: String,
        #[serde(default = "once")]
        times: usize,
        #[serde(default)]
        join: usize,
    },
    Reverse {
        frames: String,
        #[serde(default)]
        join: usize,
    },
    Refine {
        frames: String,
    },
}

fn once() -> usize {
    1
}

/// The edits of a text.
pub fn parse(text: &str) -> Result<Vec<Edit>, EditsError> {
    let wire: Wire = toml::from_str(text).map_err(|e| EditsError::Toml(one_line(&e, text)))?;
    let edits = wire.edit.into_iter().enumerate();
    edits
        .map(|(i, wire)| edit(wire).map_err(|what| EditsError::Edit { edit: i + 1, what }))
        .collect()
}

/// The message without the picture of the text, which may be long, and its line.
fn one_line(error: &toml::de::Error, text: &str) -> String {
    let message: String = error.message().chars().take(200).collect();
    let message = message.replace('\n', " ");
    let start = error.span().map(|span| span.start);
    match start.and_then(|at| text.get(..at)) {
        Some(before) => format!("line {}: {message}", before.split('\n').count()),
        None => message,
    }
}

fn edit(wire: WireEdit) -> Result<Edit, String> {
    Ok(match wire {
        WireEdit::Move { control, to, by } => Edit::Move {
            control: index("control", control)?,
            target: match (to, by) {
                (Some(to), None) => Target::To(to),
                (None, Some(by)) => Target::By(by),
                _ => return Err("expected either `to` or `by`, a point [x, y]".into()),
            },
        },
        WireEdit::Loop {
            after,
            through,
            frames,
            control,
        } => Edit::Loop {
            after: index("after", after)?,
            through,
            frames,
            control,
        },
        WireEdit::Delete { frames, join } => Edit::Delete {
            frames: range(&frames)?,
            join,
        },
        WireEdit::Repeat {
            frames,
            times,
            join,
        } => Edit::Repeat {
            frames: range(&frames)?,
            times,
            join,
        },
        WireEdit::Reverse { frames, join } => Edit::Reverse {
            frames: range(&frames)?,
            join,
        },
        WireEdit::Refine { frames } => Edit::Refine {
            frames: range(&frames)?,
        },
    })
}

/// A 0-based index from one counted from 1.
fn index(name: &str, number: usize) -> Result<usize, String> {
    let counted = "is 0, but frames and control points are counted from 1";
    number.checked_sub(1).ok_or(format!("`{name}` {counted}"))
}

/// `A..B`, both ends in.
fn range(text: &str) -> Result<RangeInclusive<usize>, String> {
    let numbers = text.split_once("..").and_then(|(a, b)| {
        let number = |text: &str| text.trim().parse::<usize>().ok();
        Some((number(a)?, number(b)?))
    });
    let shown: String = text.chars().take(40).collect();
    let (first, last) = numbers.ok_or(format!(
        "`frames` is \"{shown}\"; expected \"A..B\", counted from 1 and both ends in"
    ))?;
    Ok(index("frames", first)?..=index("frames", last)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_edit_is_read() {
        let text = r#"
            [[edit]]
            do = "move"
            control = 5
            by = [0.5, 1]
            [[edit]]
            do = "loop"
            after = 3
            through = [[0, 1.5]]
            frames = 4
            [[edit]]
            do = "repeat"
            frames = "1..12"
            join = 2
            [[edit]]
            do = "delete"
            frames = "2..3"
            [[edit]]
            do = "reverse"
            frames = "4..4"
            [[edit]]
            do = "refine"
            frames = "4 .. 9"
        "#;
        let target = Target::By([0.5, 1.0]);
        let expected = [
            Edit::Move { control: 4, target },
            Edit::Loop {
                after: 2,
                through: vec![[0.0, 1.5]],
                frames: Some(4),
                control: None,
            },
            Edit::Repeat {
                frames: 0..=11,
                times: 1,
                join: 2,
            },
            Edit::Delete {
                frames: 1..=2,
                join: 0,
            },
            Edit::Reverse {
                frames: 3..=3,
                join: 0,
            },
            Edit::Refine { frames: 3..=8 },
        ];
        assert_eq!(parse(text).unwrap(), expected);
    }

    #[test]
    fn what_is_no_edit_is_said() {
        let of = |text: &str| parse(text).unwrap_err().to_string();
        let edit = |text: &str| of(&format!("[[edit]]\n{text}"));
        for text in ["", "edit = 3", "[[edits]]\ndo = \"move\"", "\0"] {
            assert!(!of(text).is_empty());
        }
        assert!(edit("do = \"turn\"").contains("turn"));
        assert!(edit("do = \"refine\"\nframes = \"1..2\"\njoin = 3").contains("join"));
        assert!(edit("do = \"move\"\ncontrol = 2").contains("either `to` or `by`"));
        assert!(edit("do = \"move\"\ncontrol = 0\nby = [1, 1]").contains("counted from 1"));
        assert!(edit("do = \"delete\"\nframes = \"0..2\"").contains("counted from 1"));
        assert!(edit("do = \"delete\"\nframes = \"2\"").contains("A..B"));
    }
}
