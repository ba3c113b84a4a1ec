//! The order in which things are shown: stages and cases as the record has them, engines with ours first.

use std::collections::HashSet;

/// The engine that is ours.
pub(super) const RUST: &str = "rust";

/// Each name once, in order of first appearance.
pub(super) fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = HashSet::new();
    names.filter(|&name| seen.insert(name)).collect()
}

/// Each engine once: `rust` first, then by name.
pub(super) fn engines<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut engines = distinct(names);
    engines.sort_by_key(|&name| (name != RUST, name));
    engines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_their_first_place_and_engines_are_sorted() {
        let names = ["scipy", "rust", "numpy", "scipy"];
        assert_eq!(distinct(names.into_iter()), ["scipy", "rust", "numpy"]);
        assert_eq!(engines(names.into_iter()), ["rust", "numpy", "scipy"]);
    }
}
