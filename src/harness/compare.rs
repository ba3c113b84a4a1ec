//! Two records side by side: did it get worse?

use std::collections::BTreeMap;

use super::record::{Record, Verdict};

/// A change between two records.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    pub case: String,
    pub engine: String,
    /// A quantity, `verdict`, or `time over ENGINE`.
    pub what: String,
    pub before: String,
    pub after: String,
    pub worse: bool,
}

/// A ratio to a peer must move by this factor to count: wall-clock time is the second witness, not the judge.
const SLOWER: f64 = 1.5;
/// Accuracy may drift by rounding: growth counts above this share of the tolerance, or relative to itself where there is none.
const GROWN: f64 = 1e-6;

/// Changes of verdict, of accuracy past its tolerance, and of speed relative to the peers of the same run.
pub fn compare(before: &Record, after: &Record) -> Vec<Change> {
    let mut changes = verdicts(before, after);
    changes.extend(accuracy(before, after));
    changes.extend(speed(before, after));
    changes
}

type Key<'a> = (&'a str, &'a str, &'a str);

fn changed(key: Key, before: impl ToString, after: impl ToString, worse: bool) -> Change {
    Change {
        case: key.0.into(),
        engine: key.1.into(),
        what: key.2.into(),
        before: before.to_string(),
        after: after.to_string(),
        worse,
    }
}

/// Pairs the entries of two tables; the second of a pair is none where the entry is gone.
fn paired<'a, T: Copy>(
    before: &BTreeMap<Key<'a>, T>,
    after: &BTreeMap<Key<'a>, T>,
) -> Vec<(Key<'a>, T, Option<T>)> {
    before
        .iter()
        .map(|(&key, &b)| (key, b, after.get(&key).copied()))
        .collect()
}

fn verdicts(before: &Record, after: &Record) -> Vec<Change> {
    fn table(record: &Record) -> BTreeMap<Key<'_>, Verdict> {
        let rows = record.agreement.iter();
        rows.map(|r| ((r.case.as_str(), r.engine.as_str(), "verdict"), r.verdict))
            .collect()
    }
    paired(&table(before), &table(after))
        .into_iter()
        .filter(|(_, b, a)| *a != Some(*b))
        .map(|(key, b, a)| match a {
            Some(a) => changed(key, b, a, b == Verdict::Agree),
            None => changed(key, b, "not run", false),
        })
        .collect()
}

fn accuracy(before: &Record, after: &Record) -> Vec<Change> {
    type Value = (f64, Option<f64>);
    fn table(record: &Record) -> BTreeMap<Key<'_>, Value> {
        let rows = record.accuracy.iter();
        rows.map(|r| {
            (
                (r.case.as_str(), r.engine.as_str(), r.quantity.as_str()),
                (r.value, r.tolerance),
            )
        })
        .collect()
    }
    paired(&table(before), &table(after))
        .into_iter()
        .filter_map(|(key, (b, _), a)| {
            let (a, tolerance) = a?;
            let allowed = tolerance.unwrap_or(GROWN * b.abs().max(1e-12));
            ((a - b).abs() > allowed || a.is_nan() != b.is_nan()).then(|| {
                changed(
                    key,
                    format!("{b:.6e}"),
                    format!("{a:.6e}"),
                    a.is_nan() || a > b,
                )
            })
        })
        .collect()
}

fn speed(before: &Record, after: &Record) -> Vec<Change> {
    fn table(record: &Record) -> BTreeMap<Key<'_>, f64> {
        let rows = record.timing.iter().filter(|r| r.engine != "rust");
        rows.map(|r| {
            (
                (r.case.as_str(), r.engine.as_str(), "time over rust"),
                r.ratio_to_rust,
            )
        })
        .collect()
    }
    paired(&table(before), &table(after))
        .into_iter()
        .filter_map(|(key, b, a)| {
            let a = a?;
            let factor = b / a;
            (!(1.0 / SLOWER..=SLOWER).contains(&factor))
                .then(|| changed(key, format!("{b:.2}"), format!("{a:.2}"), factor > SLOWER))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::record::{AccuracyRow, TimingRow};
    use super::*;

    fn record(value: f64, ratio: f64) -> Record {
        Record {
            accuracy: vec![AccuracyRow {
                case: "c".into(),
                stage: "signal.h".into(),
                engine: "rust".into(),
                quantity: "error_h".into(),
                value,
                tolerance: None,
                verdict: Verdict::Agree,
            }],
            timing: vec![TimingRow {
                case: "c".into(),
                stage: "signal.h".into(),
                engine: "numpy".into(),
                samples: 3,
                batch: 1,
                median_seconds: 1.0,
                mad_seconds: 0.0,
                least_seconds: 1.0,
                ratio_to_rust: ratio,
                published_seconds: None,
                published_source: String::new(),
            }],
            ..Record::default()
        }
    }

    #[test]
    fn growth_is_worse_and_rounding_is_nothing() {
        assert!(compare(&record(1.0, 10.0), &record(1.0 + 1e-9, 11.0)).is_empty());
        let grown = compare(&record(1.0, 10.0), &record(1.1, 10.0));
        assert!(grown.len() == 1 && grown[0].worse);
        let better = compare(&record(1.1, 10.0), &record(1.0, 10.0));
        assert!(better.len() == 1 && !better[0].worse);
        let slower = compare(&record(1.0, 10.0), &record(1.0, 2.0));
        assert!(slower.len() == 1 && slower[0].worse);
    }
}
