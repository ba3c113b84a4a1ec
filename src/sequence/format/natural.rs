//! Natural order of names: `mesh_9` before `mesh_10`, whether padded or not.

use std::cmp::Ordering;

/// Compares two names as people read them: runs of digits by their value, everything else byte by byte.
///
/// Numbers may be of any length. Names that differ only in leading zeros fall back on byte order, so the order is total
/// and does not depend on how a folder happens to list its files. Costs one pass over both names.
pub fn compare(a: &[u8], b: &[u8]) -> Ordering {
    by_runs(a, b).then_with(|| a.cmp(b))
}

fn by_runs(mut a: &[u8], mut b: &[u8]) -> Ordering {
    loop {
        let (x, y) = match (a.first(), b.first()) {
            (Some(x), Some(y)) => (*x, *y),
            _ => return a.len().cmp(&b.len()),
        };
        let order = if x.is_ascii_digit() && y.is_ascii_digit() {
            let (number_a, number_b);
            (number_a, a) = split_number(a);
            (number_b, b) = split_number(b);
            compare_numbers(number_a, number_b)
        } else {
            (a, b) = (&a[1..], &b[1..]);
            x.cmp(&y)
        };
        if order.is_ne() {
            return order;
        }
    }
}

/// The digits at the start of `name` without leading zeros, and what follows them.
fn split_number(name: &[u8]) -> (&[u8], &[u8]) {
    let digits = name.iter().take_while(|c| c.is_ascii_digit()).count();
    let zeros = name.iter().take_while(|&&c| c == b'0').count();
    (&name[zeros..digits], &name[digits..])
}

fn compare_numbers(a: &[u8], b: &[u8]) -> Ordering {
    a.len().cmp(&b.len()).then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sorted(names: &[&str]) -> Vec<String> {
        let mut names: Vec<String> = names.iter().map(|s| s.to_string()).collect();
        names.sort_by(|a, b| compare(a.as_bytes(), b.as_bytes()));
        names
    }

    #[test]
    fn numbers_count_not_digits() {
        assert_eq!(
            sorted(&["10.obj", "9.obj", "2.obj", "100.obj"]),
            ["2.obj", "9.obj", "10.obj", "100.obj"]
        );
        assert_eq!(
            sorted(&["mesh_10.obj", "mesh_9.obj"]),
            ["mesh_9.obj", "mesh_10.obj"]
        );
        assert_eq!(
            sorted(&["b1_f10", "b1_f9", "a2_f1"]),
            ["a2_f1", "b1_f9", "b1_f10"]
        );
    }

    #[test]
    fn padding_does_not_matter_and_ties_are_settled() {
        assert_eq!(sorted(&["010", "9", "0011"]), ["9", "010", "0011"]);
        assert_eq!(sorted(&["1", "01"]), ["01", "1"]);
    }

    #[test]
    fn numbers_longer_than_any_integer() {
        let (long, longer) = ("1".repeat(60), format!("1{}", "0".repeat(60)));
        assert_eq!(compare(long.as_bytes(), longer.as_bytes()), Ordering::Less);
    }

    proptest! {
        #[test]
        fn order_of_numbers(a in 0u64.., b in 0u64..) {
            let (x, y) = (format!("f{a}.obj"), format!("f{b}.obj"));
            prop_assert_eq!(compare(x.as_bytes(), y.as_bytes()), a.cmp(&b));
        }

        #[test]
        fn a_total_order(mut names in prop::collection::vec("[a01]{0,4}", 0..12)) {
            names.sort_by(|a, b| compare(a.as_bytes(), b.as_bytes()));
            for (i, a) in names.iter().enumerate() {
                for b in &names[i..] {
                    prop_assert_ne!(compare(a.as_bytes(), b.as_bytes()), Ordering::Greater);
                    prop_assert_eq!(compare(a.as_bytes(), b.as_bytes()).is_eq(), a == b);
                }
            }
        }
    }
}
