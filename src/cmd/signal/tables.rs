//! Small texts that users write: tables of numbers, lists of times, edits. They come from strangers: bounded, finite, named by their line.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::super::Failure;
use crate::signal::Point;
use crate::signal::pins::Pin;

/// A longer text is none of these.
const LONGEST: u64 = 64 << 20;

/// The whole text of a file that holds `what`.
pub fn read_text(path: &Path, what: &str) -> Result<String, Failure> {
    let place = path.display();
    let refused = |e| format!("{place}: cannot read {what}: {e}");
    let file = File::open(path).map_err(refused)?;
    // One byte more than allowed tells a file that is too long; a device never ends.
    let mut text = String::new();
    file.take(LONGEST + 1)
        .read_to_string(&mut text)
        .map_err(refused)?;
    if text.len() as u64 > LONGEST {
        return Err(format!("{place}: more than {LONGEST} bytes, which {what} never have").into());
    }
    Ok(text)
}

/// Rows of numbers below a header line with these names.
fn rows<const N: usize>(text: &str, names: [&str; N]) -> Result<Vec<csv::StringRecord>, Failure> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header = reader.headers()?;
    if header != names.as_slice() {
        let found: Vec<String> = header.iter().map(shortened).collect();
        return Err(format!("the first line is `{}`", found.join(",")).into());
    }
    Ok(reader.records().collect::<Result<_, _>>()?)
}

/// The beginning of what may be very long.
fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Rows `frame,x,y` of a file, with frames counted from 1.
pub fn placed_frames(path: &Path, what: &str) -> Result<Vec<Pin>, Failure> {
    let text = read_text(path, what)?;
    let parse = || -> Result<Vec<Pin>, Failure> {
        let rows = rows(&text, ["frame", "x", "y"])?;
        rows.iter()
            .map(|row| {
                let (frame, x, y): (usize, f64, f64) = row.deserialize(None)?;
                let frame = frame.checked_sub(1).ok_or("a row names frame 0")?;
                let position = [x, y];
                Ok(Pin { frame, position })
            })
            .collect()
    };
    parse().map_err(|e| {
        let form =
            "expected a line `frame,x,y` and then one such row a frame, frames counted from 1";
        format!("{}: {e}; {form}", path.display()).into()
    })
}

/// Two columns of finite numbers with these names.
pub fn pairs(path: &Path, what: &str, names: [&str; 2]) -> Result<Vec<Point>, Failure> {
    let text = read_text(path, what)?;
    let parse = || -> Result<Vec<Point>, Failure> {
        let rows = rows(&text, names)?;
        rows.iter()
            .map(|row| {
                let pair: (f64, f64) = row.deserialize(None)?;
                if !(pair.0.is_finite() && pair.1.is_finite()) {
                    let line = row.position().map_or(0, csv::Position::line);
                    return Err(format!("line {line} holds a number that is not finite").into());
                }
                Ok([pair.0, pair.1])
            })
            .collect()
    };
    parse().map_err(|e| {
        let [a, b] = names;
        let form = format!("expected a line `{a},{b}` and then rows of two numbers");
        format!("{}: {e}; {form}", path.display()).into()
    })
}

/// Numbers separated by commas, spaces or line ends; NaN and infinity are among them.
pub fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let words = text.split([',', ' ', '\t', '\r', '\n']);
    words
        .filter(|word| !word.is_empty())
        .map(|word| {
            let number = word.parse();
            number.map_err(|_| format!("`{}` is no number", shortened(word)))
        })
        .collect()
}
