//! Digests of sequences, and how near two of them must be.

use insta::{Comparator, Snapshot};
use meshseq::mesh::measure::measure_frames;
use meshseq::sequence::Sequence;

/// Numbers may differ by this share of themselves; coordinates, areas and volumes, of the greatest number in their line.
const RELATIVE: f64 = 1e-7;
/// A number below this share of what it is measured against is rounding, and written as 0.
const ROUNDING: f64 = 1e-10;
/// Squares of rounding.
const SQUARED: f64 = 1e-18;
/// Vertices whose positions are kept.
const VERTICES: usize = 12;

/// Lines of a name and numbers. Counts are written as they are, numbers with nine significant digits and an exponent.
#[derive(Default)]
pub struct Digest(Vec<String>);

impl Digest {
    /// Whole numbers, which must be equal.
    pub fn counts(&mut self, counts: &[(&str, usize)]) {
        let parts: Vec<String> = counts
            .iter()
            .map(|(name, count)| format!("{name} {count}"))
            .collect();
        self.0.push(parts.join("  "));
    }

    /// Whole numbers under one name, which must be equal.
    pub fn list(&mut self, name: &str, items: impl Iterator<Item = usize>) {
        let items: Vec<String> = items.map(|i| i.to_string()).collect();
        self.0.push(format!("{name} {}", items.join(" ")));
    }

    /// A sum of squares beside that of the data.
    pub fn number(&mut self, name: &str, value: f64, data: f64) {
        self.0
            .push(format!("{name} {}", digits(value, SQUARED * data)));
    }

    /// Area, volume, box and a dozen vertices of each frame.
    pub fn frames(&mut self, sequence: &Sequence, times: &[f64]) {
        let mesh = sequence.connectivity();
        let measures = measure_frames(sequence.positions(), sequence.dimension(), mesh.faces());
        let step = mesh.vertex_count().div_ceil(VERTICES).max(1);
        for (i, (m, t)) in measures.iter().zip(times).enumerate() {
            let size = m.bounds.diagonal();
            self.0.push(format!("\nframe time {}", digits(*t, 0.0)));
            self.0
                .push(format!("area {}", digits(m.area, ROUNDING * size * size)));
            self.0.push(format!(
                "volume {}",
                digits(m.volume, ROUNDING * size.powi(3))
            ));
            let row = |name: &str, p: &[f64]| {
                let p: Vec<String> = p.iter().map(|&x| digits(x, ROUNDING * size)).collect();
                format!("{name} {}", p.join(" "))
            };
            self.0.push(row("least", &m.bounds.min));
            self.0.push(row("greatest", &m.bounds.max));
            for (v, p) in sequence.frame(i).chunks(3).enumerate().step_by(step) {
                self.0.push(row(&format!("vertex {v}"), p));
            }
        }
    }

    pub fn text(&self) -> String {
        self.0.join("\n")
    }
}

/// Nine significant digits; what is no more than `rounding` is 0.
fn digits(value: f64, rounding: f64) -> String {
    match value.abs() <= rounding {
        true => "0".into(),
        false => format!("{value:.8e}"),
    }
}

/// Lines with the same words and counts, and numbers within the tolerance.
#[derive(Clone)]
pub struct Close;

impl Comparator for Close {
    fn matches(&self, reference: &Snapshot, test: &Snapshot) -> bool {
        let (Some(before), Some(after)) = (reference.as_text(), test.as_text()) else {
            return false;
        };
        let found = difference(&before.to_string(), &after.to_string());
        if let Some(what) = &found {
            println!("golden: {what}");
        }
        found.is_none()
    }

    fn dyn_clone(&self) -> Box<dyn Comparator> {
        Box::new(self.clone())
    }
}

/// The first line that is not the same, and how.
fn difference(before: &str, after: &str) -> Option<String> {
    let (a, b): (Vec<&str>, Vec<&str>) = (
        before.trim().lines().collect(),
        after.trim().lines().collect(),
    );
    if a.len() != b.len() {
        return Some(format!("{} lines before, {} after", a.len(), b.len()));
    }
    let at = (0..a.len()).find(|&i| !same(a[i], b[i]))?;
    Some(format!(
        "line {}: `{}` before, `{}` after",
        at + 1,
        a[at],
        b[at]
    ))
}

fn same(before: &str, after: &str) -> bool {
    let (a, b): (Vec<&str>, Vec<&str>) = (
        before.split_whitespace().collect(),
        after.split_whitespace().collect(),
    );
    // Counts and names have no exponent.
    let number = |text: &str| -> Option<f64> {
        text.parse()
            .ok()
            .filter(|_| text == "0" || text.contains('e'))
    };
    let greatest = a
        .iter()
        .chain(&b)
        .filter_map(|t| number(t))
        .map(f64::abs)
        .fold(0.0, f64::max);
    let near = |(a, b): (&&str, &&str)| {
        let numbers = number(a).zip(number(b));
        a == b || numbers.is_some_and(|(a, b)| (a - b).abs() <= RELATIVE * greatest)
    };
    a.len() == b.len() && a.iter().zip(&b).all(near)
}

#[test]
fn rounding_agrees_and_change_does_not() {
    let line = "vertex 3 1.00000000e0 -2.50000000e-1 0";
    assert!(same(
        line,
        "vertex 3 1.00000005e0 -2.50000000e-1 1.00000000e-9"
    ));
    assert!(!same(line, "vertex 3 1.00000030e0 -2.50000000e-1 0"));
    assert!(!same(line, "vertex 4 1.00000000e0 -2.50000000e-1 0"));
    assert!(!same(line, "vertex 3 1.00000000e0 -2.50000000e-1"));
    assert!(!same(line, "vertex 3 1.00000000e0 2.50000000e-1 0"));
    assert!(!same(line, "vertex 3 NaN -2.50000000e-1 0"));
    assert!(!same("k 16", "k 17") && !same("sites 1 4 9", "sites 1 9 4"));
    assert!(same("error_h 3.81630000e1", "error_h 3.81630010e1"));
    assert!(!same("error_f 0", "error_f 1.00000000e-30"));
    assert_eq!(digits(1.0 / 3.0, 0.0), "3.33333333e-1");
    assert_eq!(
        (digits(-1e-20, 1e-19), digits(0.0, 0.0)),
        ("0".into(), "0".into())
    );
    assert_eq!(
        difference("a 1\nb 2", "a 1\nb 3").as_deref(),
        Some("line 2: `b 2` before, `b 3` after")
    );
    assert_eq!(difference("a 1\n", "a 1"), None);
}
