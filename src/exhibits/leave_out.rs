//! The leave-out test: every second frame predicted from the others, by layout, staged and refined, beside linear and cubic interpolation.

use super::signals::present;
use super::{Chart, Exhibit, ExhibitError, Line, Panel, Style, Table};
use crate::mesh::measure::bounds;
use crate::sequence::Sequence;
use crate::sequence::dataset::{DataFolders, open};
use crate::shape::{SpaceKind, prepare_for};
use crate::signal::knots::KnotRule;
use crate::signal::layout::Layout;
use crate::signal::leave_out::{LeaveOut, LeaveOutError, Split, TradeOff};
use crate::signal::refine::RefineOptions;

const NAME: &str = "leave-out";
/// Shown always.
const EMBEDDED: [&str; 2] = ["@gallop", "@jelly"];
/// Shown where there is the data: the sequence and how many of its frames are taken.
const REAL: [(&str, usize); 3] = [("horse-gallop", 23), ("cow", 203), ("samba", usize::MAX)];
/// Sites and control points of the table's fits that do not interpolate, as a share of the frames kept.
const FEWER: f64 = 0.8;
/// Those of the chart.
const TRADE_OFF: [f64; 7] = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
const LAYOUTS: [Layout; 2] = [Layout::Mds, Layout::Ordered { weight: None }];

/// A table over sequences, spaces and fits, and the trade-off between sites and in-betweens.
pub fn exhibit(data: &DataFolders) -> Result<Exhibit, ExhibitError> {
    let mut sequences = Vec::new();
    for name in EMBEDDED {
        sequences.push((name, open(name)?));
    }
    // Before the work, so that damaged data are told of at once.
    sequences.extend(real(data)?);
    let mut panels = Vec::new();
    for (name, sequence) in &sequences[..EMBEDDED.len()] {
        panels.push(Panel::Chart(trade_off(name, sequence)?));
    }
    let mut rows = Vec::new();
    for (name, sequence) in &sequences {
        rows.extend(both(name, sequence)?);
    }
    panels.insert(0, Panel::Table(table(rows)));
    Ok(Exhibit {
        name: NAME.into(),
        title: "Left out: every second frame predicted from the others".into(),
        look: "Look for columns of `mds` above `linear`: the plane of plain scaling bends back on itself beside the time signal, and in-betweens stray \
               from their neighbours although every kept frame is met. `ordered` keeps frames in their order: interpolating or refined it stays below `linear`, \
               and refined it comes near `cubic` with fewer sites than frames."
            .into(),
        datasets: sequences.iter().map(|(name, _)| (*name).into()).collect(),
        panels,
    })
}

/// The sequences of [`REAL`] that there are.
fn real(data: &DataFolders) -> Result<Vec<(&'static str, Sequence)>, ExhibitError> {
    let mut found = Vec::new();
    for (name, count) in REAL {
        let Some(sequence) = present(data.sequence(name))? else {
            continue;
        };
        let count = count.min(sequence.frame_count());
        let some = sequence.select(&(0..count).collect::<Vec<_>>());
        found.push((name, some.map_err(ExhibitError::of(NAME))?));
    }
    Ok(found)
}

fn both(name: &str, sequence: &Sequence) -> Result<[Vec<String>; 2], ExhibitError> {
    let row = |kind| row(name, sequence, kind);
    Ok([row(SpaceKind::Vertex)?, row(SpaceKind::Gradient)?])
}

fn row(name: &str, sequence: &Sequence, kind: SpaceKind) -> Result<Vec<String>, ExhibitError> {
    let missed = tested(sequence, kind, |test| {
        let refinement = RefineOptions::default();
        let mut missed = vec![test.linear()?.rms, test.cubic()?.rms];
        for layout in LAYOUTS {
            let interpolating = test.trade_off(&[1.0], layout, KnotRule::Symmetric, None)?;
            let fewer = test.trade_off(&[FEWER], layout, KnotRule::Symmetric, Some(&refinement))?;
            missed.extend(interpolating.iter().chain(&fewer).map(|row| row.missed));
        }
        Ok(missed)
    })?;
    let size = bounds(sequence.frame(0)).diagonal();
    let cells = missed.iter().map(|m| format!("{:.3}%", 100.0 * m / size));
    Ok([format!("{name}, {}", kind.name())]
        .into_iter()
        .chain(cells)
        .collect())
}

fn tested<T>(
    sequence: &Sequence,
    kind: SpaceKind,
    ask: impl Fn(&LeaveOut) -> Result<T, LeaveOutError>,
) -> Result<T, ExhibitError> {
    let answer = || {
        let split = Split::new(sequence.positions(), sequence.dimension())?;
        let space = prepare_for(kind, sequence.connectivity(), &split.kept)?;
        ask(&LeaveOut::new(&*space, &split)?)
    };
    answer().map_err(ExhibitError::of(NAME))
}

fn table(rows: Vec<Vec<String>>) -> Table {
    let heads = [
        "sequence",
        "linear",
        "cubic",
        "mds, interpolating",
        "mds, 80%",
        "mds, 80% refined",
        "ordered, interpolating",
        "ordered, 80%",
        "ordered, 80% refined",
    ];
    Table {
        caption: "Vertex RMS distance of the predicted frames from those left out, over the first frame's diagonal; k and l are all frames kept, or 80% of them"
            .into(),
        heads: heads.map(str::to_owned).to_vec(),
        rows,
    }
}

/// What fewer sites and control points cost, by layout.
fn trade_off(name: &str, sequence: &Sequence) -> Result<Chart, ExhibitError> {
    let size = bounds(sequence.frame(0)).diagonal();
    let percent = |missed: f64| 100.0 * missed / size;
    let lines = tested(sequence, SpaceKind::Vertex, |test| {
        let level = |name: &str, missed: f64| Line {
            name: name.into(),
            style: Style::Dashes,
            points: [TRADE_OFF[0], 1.0]
                .map(|share| [100.0 * share, percent(missed)])
                .to_vec(),
        };
        let mut lines = vec![
            level("linear", test.linear()?.rms),
            level("cubic", test.cubic()?.rms),
        ];
        for layout in LAYOUTS {
            let rows = test.trade_off(&TRADE_OFF, layout, KnotRule::Symmetric, None)?;
            let point = |row: &TradeOff| [100.0 * row.share, percent(row.missed)];
            lines.push(Line {
                name: layout.to_string(),
                style: Style::Line,
                points: rows.iter().map(point).collect(),
            });
        }
        Ok(lines)
    })?;
    Ok(Chart {
        title: format!("{name}: sites against in-betweens"),
        x_title: "sites and control points, % of the frames kept".into(),
        y_title: "predicted frames off by, % of the diagonal".into(),
        lines,
        ..Chart::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damaged_data_are_an_error_and_no_absence() {
        let data = tempfile::tempdir().unwrap();
        let folders = DataFolders(vec![data.path().into()]);
        assert!(real(&folders).unwrap().is_empty());
        std::fs::create_dir(data.path().join("cow")).unwrap();
        std::fs::write(data.path().join("cow/1.obj"), "v 0 0\n").unwrap();
        for exhibit in [exhibit, super::super::round_trip::exhibit] {
            let error = exhibit(&folders).unwrap_err();
            assert!(
                !error.is_absence() && error.to_string().contains("cow"),
                "{error}"
            );
        }
    }
}
