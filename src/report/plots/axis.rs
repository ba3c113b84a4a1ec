//! Axes whose ends and ticks we choose, for plotters to draw.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use super::{drawable, drawable_positive};

/// Decades that a logarithmic axis shows at most; what is smaller stands on its lower edge.
const DECADES: f64 = 18.0;

/// A linear or logarithmic axis. Its ends are finite and apart, whatever it was made from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    logarithmic: bool,
    ticks: Vec<(f64, String)>,
}

/// Where a value beyond an axis stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edge {
    Low,
    High,
}

/// Least and greatest of what can be drawn.
fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|&x| drawable(x)).fold(None, |seen, x| {
        Some(seen.map_or((x, x), |(a, b): (f64, f64)| (a.min(x), b.max(x))))
    })
}

/// Pushes two ends apart that are equal, or too near for f64 to tell points between them apart.
fn apart((low, high): (f64, f64)) -> (f64, f64) {
    let size = low.abs().max(high.abs());
    match high - low > 1e-9 * size && high - low > 1e-150 {
        true => (low, high),
        false => {
            let half = if size > 1e-140 { 0.05 * size } else { 0.5 };
            (low - half, high + half)
        }
    }
}

/// 1, 2 or 5 times a power of ten, so that at most `most` steps cover `span`.
fn nice_step(span: f64, most: usize) -> f64 {
    let raw = span / most.max(1) as f64;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0].map(|f| f * power);
    step.into_iter()
        .find(|&s| s >= raw * 0.999_999)
        .unwrap_or(10.0 * power)
}

/// Multiples of `step` from `low` to `high`, never more than 64.
fn multiples(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (low / step - 1e-6).ceil();
    (0..64)
        .map(move |i| (first + f64::from(i)) * step)
        .take_while(move |&x| x <= high + 1e-6 * step)
}

/// A tick's number, with the digits that its step needs.
fn tick_label(x: f64, step: f64, size: f64) -> String {
    if x.abs() < 1e-9 * step {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&size) {
        let digits = (x.abs().log10().floor() - step.log10().floor()).max(0.0) as usize;
        return format!("{x:.*e}", digits.min(6));
    }
    format!("{x:.*}", (-step.log10().floor()).clamp(0.0, 9.0) as usize)
}

impl Axis {
    /// From the least to the greatest of `values` and a `share` of the length more on either side, with about `most` ticks; 0 to 1 without
    /// values.
    pub(super) fn padded(values: impl Iterator<Item = f64>, share: f64, most: usize) -> Self {
        let (low, high) = apart(extent(values).unwrap_or((0.0, 1.0)));
        let margin = share * (high - low);
        Self::between((low - margin, high + margin), most)
    }

    /// From 0 to the greatest of `values` and a little more.
    pub(super) fn from_zero(values: impl Iterator<Item = f64>, most: usize) -> Self {
        let high = extent(values).map_or(1.0, |(_, b)| b.max(0.0));
        let high = if high > 1e-150 { high * 1.08 } else { 1.0 };
        Self::between((0.0, high), most)
    }

    /// Between two ends that can be drawn.
    pub(super) fn between(ends: (f64, f64), most: usize) -> Self {
        let (low, high) = apart(ends);
        let step = nice_step(high - low, most);
        let size = low.abs().max(high.abs());
        let ticks = multiples(low, high, step).map(|x| (x, tick_label(x, step, size)));
        Self {
            low,
            high,
            logarithmic: false,
            ticks: ticks.collect(),
        }
    }

    /// Axes that hold `x` and `y`, on which a unit is as long across as up, for a plane `across` pixels wide; and the plane's height in pixels,
    /// between `heights`.
    pub(super) fn equal(x: &Self, y: &Self, across: f64, heights: (f64, f64)) -> (Self, Self, f64) {
        let (wide, high) = (x.high - x.low, y.high - y.low);
        let up = (across * high / wide).clamp(heights.0, heights.1);
        let unit = (wide / across).max(high / up);
        let widen = |axis: &Self, length: f64| {
            let middle = (axis.low + axis.high) / 2.0;
            Self::between((middle - length / 2.0, middle + length / 2.0), 7)
        };
        (widen(x, unit * across), widen(y, unit * up), up)
    }

    /// Counts from `first` to `last`, with ticks at whole numbers only and room for a point at either end.
    pub(super) fn counts(first: usize, last: usize, most: usize) -> Self {
        let (a, b) = (first as f64, last.max(first) as f64);
        let step = nice_step((b - a).max(1.0), most).max(1.0);
        let room = ((b - a) * 0.02).max(0.5);
        let mut ticks = vec![(a, format!("{first}"))];
        let later = multiples(a, b, step).filter(|x| x - a > 0.6 * step);
        ticks.extend(later.map(|x| (x, format!("{x:.0}"))));
        Self {
            low: a - room,
            high: b + room,
            logarithmic: false,
            ticks,
        }
    }

    /// A logarithmic axis over the positive of `values`, with a label for each tick; 1 to 10 without any.
    pub(super) fn logarithmic(
        values: impl Iterator<Item = f64>,
        most: usize,
        label: impl Fn(f64) -> String,
    ) -> Self {
        let positive = values.filter(|&x| drawable_positive(x));
        let (low, high) = extent(positive).unwrap_or((1.0, 10.0));
        let high = high.log10();
        let low = low.log10().max(high - DECADES);
        // Room for half a decade around one value, and for a twentieth of the length around many.
        let margin = (0.05 * (high - low)).max(0.25);
        let (low, high) = (low - margin, high + margin);
        let step = ((high - low) / most.max(1) as f64).ceil().max(1.0);
        let mut powers: Vec<f64> = multiples(low, high, step).map(|e| 10f64.powf(e)).collect();
        if powers.len() < 3 {
            powers = fine_ticks(low, high);
        }
        Self {
            low: 10f64.powf(low),
            high: 10f64.powf(high),
            logarithmic: true,
            ticks: powers.into_iter().map(|x| (x, label(x))).collect(),
        }
    }

    /// The lower end.
    pub(super) fn low(&self) -> f64 {
        self.low
    }

    /// The edge of a logarithmic axis that `x` is put on because it lies beyond; none where it lies within.
    pub(super) fn edge(&self, x: f64) -> Option<Edge> {
        match x {
            _ if !self.logarithmic => None,
            x if x < self.low => Some(Edge::Low),
            x if x > self.high => Some(Edge::High),
            _ => None,
        }
    }

    /// Where `x` stands between the ends, from 0 to 1; what is outside stands on the nearer end.
    fn share(&self, x: f64) -> f64 {
        let share = match self.logarithmic {
            false => (x - self.low) / (self.high - self.low),
            true if x <= self.low => 0.0,
            true => (x / self.low).log10() / (self.high / self.low).log10(),
        };
        if share.is_nan() {
            0.0
        } else {
            share.clamp(0.0, 1.0)
        }
    }
}

/// 1, 2 and 5 times each power of ten between two exponents that are not far apart.
fn fine_ticks(low: f64, high: f64) -> Vec<f64> {
    let decades = multiples(low - 1.0, high, 1.0);
    decades
        .flat_map(|e| [1.0, 2.0, 5.0].map(|f| f * 10f64.powf(e)))
        .filter(|x| (low..=high).contains(&x.log10()))
        .collect()
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let (from, to) = (f64::from(limit.0), f64::from(limit.1));
        (from + self.share(*value) * (to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.iter().map(|t| t.0).collect()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        let tick = self.ticks.iter().find(|t| t.0 == *value);
        tick.map_or(String::new(), |t| t.1.clone())
    }
}

/// A power of ten such as `10⁻⁴`; near 1, and for what is no power, a plain number such as `0.05` or `2e-5`.
pub(super) fn power_label(x: f64) -> String {
    let exponent = x.log10();
    if (-3.001..3.001).contains(&exponent) {
        let decimals = -(exponent + 1e-6).floor();
        return format!("{x:.*}", decimals.max(0.0) as usize);
    }
    let whole = exponent.round();
    match (exponent - whole).abs() < 1e-6 {
        true => format!("10{}", superscript(whole as i32)),
        false => format!("{x:.0e}"),
    }
}

fn superscript(n: i32) -> String {
    let digits = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    n.to_string()
        .chars()
        .map(|c| c.to_digit(10).map_or('⁻', |d| digits[d as usize]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|t| t.1.as_str()).collect()
    }

    #[test]
    fn linear_ticks_are_round_numbers_within_the_ends() {
        let axis = Axis::padded([0.13, 0.87].into_iter(), 0.0, 5);
        assert_eq!(ticks(&axis), ["0.2", "0.4", "0.6", "0.8"]);
        let axis = Axis::padded([-1500.0, 2500.0].into_iter(), 0.05, 5);
        assert_eq!(ticks(&axis), ["-1000", "0", "1000", "2000"]);
        assert_eq!(ticks(&Axis::counts(1, 24, 6)), ["1", "5", "10", "15", "20"]);
        assert_eq!(ticks(&Axis::counts(1, 1, 6)), ["1"]);
    }

    #[test]
    fn logarithmic_ticks_are_powers_or_finer() {
        let axis = Axis::logarithmic([1e-8, 1e2].into_iter(), 6, power_label);
        assert_eq!(ticks(&axis), ["10⁻⁸", "10⁻⁶", "10⁻⁴", "0.01", "1", "100"]);
        let axis = Axis::logarithmic([0.4, 0.9].into_iter(), 6, power_label);
        assert_eq!(ticks(&axis), ["0.5", "1"]);
    }

    #[test]
    fn zero_and_less_stand_on_the_lower_edge() {
        let axis = Axis::logarithmic([0.0, -1.0, 1e-300, 1e-3, 1.0].into_iter(), 6, power_label);
        assert_eq!(
            [0.0, -1.0, 1e-3, 1e9].map(|x| axis.edge(x)),
            [Some(Edge::Low), Some(Edge::Low), None, Some(Edge::High)]
        );
        assert_eq!(axis.map(&1e9, (0, 100)), 100);
        assert_eq!(axis.map(&0.0, (0, 100)), 0);
        assert!(axis.map(&1e-3, (0, 100)) > 0);
    }

    #[test]
    fn whatever_it_is_made_from_an_axis_is_finite_with_few_ticks() {
        let sets: [&[f64]; 8] = [
            &[],
            &[f64::NAN, f64::INFINITY],
            &[0.0],
            &[5.0, 5.0],
            &[1e149, -1e149],
            &[1e-320],
            &[1e10, 1e10 + 1e-6],
            &[1e-300, 1e140],
        ];
        for set in sets {
            let values = || set.iter().copied();
            for axis in [
                Axis::padded(values(), 0.0, 6),
                Axis::padded(values(), 0.1, 6),
                Axis::from_zero(values(), 6),
                Axis::logarithmic(values(), 6, power_label),
            ] {
                assert!(
                    axis.low.is_finite() && axis.low < axis.high,
                    "{set:?} {axis:?}"
                );
                assert!(axis.high.is_finite(), "{set:?} {axis:?}");
                assert!((1..=20).contains(&axis.ticks.len()), "{set:?} {axis:?}");
                for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0] {
                    assert!((0..=100).contains(&axis.map(&x, (0, 100))));
                }
            }
        }
    }
}
