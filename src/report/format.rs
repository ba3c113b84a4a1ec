//! Numbers as people read them: three significant digits, and a unit that keeps them short.

/// Rounds to three significant digits; what is not finite stays as it is.
fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

/// The decimal exponent of `x` once rounded to three digits; 0 for 0.
fn exponent(x: f64) -> i32 {
    let text = format!("{x:.2e}");
    let digits = text.split('e').nth(1);
    digits.and_then(|e| e.parse().ok()).unwrap_or(0)
}

/// Three significant digits: `0.00312`, `12.3`, `45600`, and `1.23e-9` below 0.001 and from 1e6 on.
pub(super) fn number(x: f64) -> String {
    if x.is_nan() {
        return "NaN".into();
    }
    if x.is_infinite() {
        return if x > 0.0 { "∞" } else { "-∞" }.into();
    }
    if x == 0.0 {
        return "0".into();
    }
    match exponent(x) {
        e @ -3..=5 => format!("{:.*}", (2 - e).max(0) as usize, rounded(x)),
        _ => format!("{x:.2e}"),
    }
}

/// As [`number`], without idle zeros: `1e-9`, `0.43`. For tolerances, which people chose.
pub(super) fn chosen(x: f64) -> String {
    let text = number(x);
    let (digits, power) = text.split_at(text.find('e').unwrap_or(text.len()));
    match digits.contains('.') {
        true => format!(
            "{}{power}",
            digits.trim_end_matches('0').trim_end_matches('.')
        ),
        false => text,
    }
}

/// Three significant digits and a unit: `845 ns`, `1.23 ms`, `75.0 s`.
pub(super) fn seconds(x: f64) -> String {
    let x = rounded(x);
    let (unit, name) = match x.abs() {
        0.0 => (1.0, "s"),
        a if a < 1e-6 => (1e9, "ns"),
        a if a < 1e-3 => (1e6, "µs"),
        a if a < 1.0 => (1e3, "ms"),
        _ => (1.0, "s"),
    };
    format!("{} {name}", number(x * unit))
}

/// How many times as much: `12.3×`.
pub(super) fn times(x: f64) -> String {
    format!("{}×", number(x))
}

/// A count with its noun: `1 case`, `3 cases`.
pub(super) fn count(n: usize, noun: &str) -> String {
    match (n, noun.strip_suffix('y')) {
        (1, _) => format!("1 {noun}"),
        (_, Some(stem)) => format!("{n} {stem}ies"),
        _ => format!("{n} {noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        let cases = [
            (0.0, "0"),
            (-0.0, "0"),
            (0.00312, "0.00312"),
            (0.000_999_9, "0.00100"),
            (0.000_312, "3.12e-4"),
            (12.345, "12.3"),
            (999.96, "1000"),
            (45_612.0, "45600"),
            (4.5e7, "4.50e7"),
            (-2.5, "-2.50"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "∞"),
            (f64::NEG_INFINITY, "-∞"),
            (5e-324, "4.94e-324"),
        ];
        for (x, expected) in cases {
            assert_eq!(number(x), expected);
        }
    }

    #[test]
    fn tolerances_have_no_idle_zeros() {
        let cases = [
            (1e-9, "1e-9"),
            (0.43, "0.43"),
            (2.0, "2"),
            (200.0, "200"),
            (1.5e-6, "1.5e-6"),
            (0.0, "0"),
        ];
        for (x, expected) in cases {
            assert_eq!(chosen(x), expected);
        }
    }

    #[test]
    fn seconds_choose_a_unit_after_rounding() {
        let cases = [
            (8.45e-7, "845 ns"),
            (0.000_999_96, "1.00 ms"),
            (0.001_234, "1.23 ms"),
            (0.166, "166 ms"),
            (75.0, "75.0 s"),
            (0.0, "0 s"),
            (f64::NAN, "NaN s"),
            (f64::INFINITY, "∞ s"),
        ];
        for (x, expected) in cases {
            assert_eq!(seconds(x), expected);
        }
    }

    #[test]
    fn nouns_follow_their_count() {
        assert_eq!(count(1, "case"), "1 case");
        assert_eq!(count(0, "case"), "0 cases");
        assert_eq!(count(2, "quantity"), "2 quantities");
    }
}
