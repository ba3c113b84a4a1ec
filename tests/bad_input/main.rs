//! Bad input, asked of the program itself: exit code 2, one line that says what was expected and what to do, and nothing written.
#![cfg(unix)]

#[path = "../common/mod.rs"]
mod common;

mod arguments;
mod outputs;
mod pins;
mod representations;
mod sequences;
mod verbs;
mod windows;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Output;

use common::{Scratch, contents, meshseq, sheet, text};
use meshseq::arrays::Bundle;
use meshseq::sequence::format::{npz, write};

/// A refusal: exit code 2, one line on standard error that holds every one of these words, nothing on standard output, and the folder as it was.
#[track_caller]
fn refused(folder: &Path, arguments: &[&str], words: &[&str]) {
    let before = listing(folder);
    let output = meshseq(arguments);
    assert_refusal(&output, arguments, words);
    assert_eq!(
        listing(folder),
        before,
        "{arguments:?} left something behind"
    );
}

#[track_caller]
fn assert_refusal(output: &Output, arguments: &[&str], words: &[&str]) {
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    assert!(!said.contains("panicked"), "{arguments:?}: {said}");
    for word in words {
        assert!(said.contains(word), "{arguments:?}: no `{word}` in {said}");
    }
    // Usage errors come from the parser of the command line, which adds how the verb is used.
    let ours = said.starts_with("meshseq: ") && said.trim_end().lines().count() == 1;
    assert!(ours || said.starts_with("error: "), "{arguments:?}: {said}");
    assert!(said.len() < 1200, "{arguments:?}: {} bytes", said.len());
    assert_eq!(text(&output.stdout), "", "{arguments:?}");
}

/// What an NPZ file holds.
fn bundle(path: &Path) -> Bundle {
    Bundle(npz::read_arrays(path).unwrap().into_iter().collect())
}

/// Writes `bundle` with something changed.
fn changed(bundle: &Bundle, change: impl FnOnce(&mut Bundle), path: &Path) {
    let mut bundle = bundle.clone();
    change(&mut bundle);
    let arrays: Vec<_> = (bundle.0.iter())
        .map(|(name, a)| (name.as_str(), a.clone()))
        .collect();
    npz::write_arrays(path, &arrays).unwrap();
}

/// Names, sizes and times: what has changed shows, and large files need not be read.
fn listing(folder: &Path) -> BTreeMap<PathBuf, (u64, std::time::SystemTime)> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let meta = entry.metadata().unwrap();
        if meta.is_dir() {
            found.extend(listing(&entry.path()));
        }
        found.insert(entry.path(), (meta.len(), meta.modified().unwrap()));
    }
    found
}

/// A folder with `good.npz`, 6 frames of 12 vertices, and what was made of it with k = 6, l = 5, m = 3: `rep.npz`.
fn good() -> Scratch {
    let scratch = Scratch::new();
    write(&sheet(6, 4, 3), &scratch.at("good.npz")).unwrap();
    common::must(&[
        "signal",
        "fit",
        &scratch.arg("good.npz"),
        "--k",
        "6",
        "--l",
        "5",
        "--m",
        "3",
        "-o",
        &scratch.arg("rep.npz"),
    ]);
    scratch
}

#[test]
fn what_is_refused_here_works_when_it_is_good() {
    let scratch = good();
    let said = common::must(&[
        "info",
        &scratch.arg("good.npz"),
        "--json",
        &scratch.arg("i.json"),
    ]);
    assert!(said.contains("6 frames, V = 12"), "{said}");
    common::must(&["convert", &scratch.arg("good.npz"), &scratch.arg("frames")]);
    common::must(&[
        "signal",
        "sample",
        &scratch.arg("rep.npz"),
        "-o",
        &scratch.arg("a.pc2"),
    ]);
    let names = contents(scratch.path());
    assert_eq!(names.len(), 12, "{:?}", names.keys());
}
