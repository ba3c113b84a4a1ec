//! Windows that cannot be, and files of windows that are none.

use meshseq::arrays::{Array, Bundle};

use super::common::{Scratch, must};
use super::{bundle, changed, good, refused};

const FIT: [&str; 6] = ["--k", "4", "--l", "3", "--m", "2"];

#[track_caller]
fn fit(scratch: &Scratch, sequence: &str, choice: &[&str], words: &[&str]) {
    let [out, json] = ["new.npz", "new.json"].map(|name| scratch.arg(name));
    let start = ["signal", "fit", sequence];
    let end = ["-o", &out, "--json", &json];
    refused(
        scratch.path(),
        &[&start, &FIT[..], choice, &end].concat(),
        words,
    );
}

#[test]
fn windows_that_cannot_be() {
    let scratch = good();
    let long = "@roam-small:30";
    for window in ["0", "1", "5"] {
        fit(
            &scratch,
            long,
            &["--window", window],
            &["at least 6", window],
        );
    }
    for window in ["-3", "many", "1e3", "", "99999999999999999999"] {
        fit(
            &scratch,
            long,
            &["--window", window],
            &["--window", "6 or more"],
        );
    }
    for overlap in ["0", "1", "5", "12", "13", "18446744073709551615"] {
        let choice = ["--window", "12", "--overlap", overlap];
        fit(&scratch, long, &choice, &["overlap", overlap, "2 to 4"]);
    }
    fit(&scratch, long, &["--overlap", "3"], &["--window"]);
    let pins = scratch.arg("pins.csv");
    std::fs::write(&pins, "frame,x,y\n1,0,0\n").unwrap();
    let choice = ["--window", "12", "--pins", &pins];
    fit(&scratch, long, &choice, &["--pins", "leave out"]);
    let choice = ["--window", "12", "--frames", "1..3"];
    fit(&scratch, long, &choice, &["3 frames", "at least 4"]);
    let choice = ["--window", "12", "--frames", "1..31"];
    fit(&scratch, long, &choice, &["1..31", "1..30"]);
    // One for the window that k does not fit, by its number and its frames.
    let choice = ["--window", "12", "--overlap", "2"];
    let out = scratch.arg("new.npz");
    let start = ["signal", "fit", long, "--k", "15", "--l", "3", "--m", "2"];
    refused(
        scratch.path(),
        &[&start[..], &choice, &["-o", &out]].concat(),
        &["@roam-small:30: window 1, frames 1 to", "k = 15", "<= k <="],
    );
    for name in ["@roam-small:0", "@roam-small:x", "@gallop:100"] {
        fit(
            &scratch,
            name,
            &["--window", "12"],
            &["1 to 1000000", "@roam"],
        );
    }
    let choice = ["--window", "12"];
    fit(&scratch, &scratch.arg("none"), &choice, &["no such file"]);
}

#[test]
fn frames_that_are_bad_in_a_later_window() {
    let scratch = good();
    let long = |bundle: &mut Bundle| {
        let Some(Array::F64 { shape, data }) = bundle.0.get_mut("V") else {
            panic!()
        };
        let frame = data[..data.len() / 6].to_vec();
        *data = (0..40)
            .flat_map(|i| frame.iter().map(move |x| x * (1.0 + 0.01 * f64::from(i))))
            .collect();
        shape[0] = 40;
        let at = data.len() - frame.len() + 4;
        data[at] = f64::NAN;
    };
    changed(
        &bundle(&scratch.at("good.npz")),
        long,
        &scratch.at("late.npz"),
    );
    let late = scratch.arg("late.npz");
    let words = ["late.npz", "frame 40 (1-based), vertex 1", "finite"];
    fit(&scratch, &late, &["--window", "12"], &words);
    // The checksum of a stream is looked at when its end is reached.
    let mut bytes = std::fs::read(&late).unwrap();
    let byte = bytes.len() / 2;
    bytes[byte] ^= 1;
    std::fs::write(&late, bytes).unwrap();
    fit(&scratch, &late, &["--window", "12"], &["late.npz"]);
}

struct Bad {
    scratch: Scratch,
    good: Bundle,
}

impl Bad {
    fn new(space: &str) -> Self {
        let scratch = Scratch::new();
        let rep = scratch.arg("windows.npz");
        let fit = ["signal", "fit", "@roam-small:20", "--window", "12"];
        let space = ["--space", space, "-o", &rep];
        must(&[&fit, &FIT[..], &space].concat());
        let good = bundle(&scratch.at("windows.npz"));
        Self { scratch, good }
    }

    #[track_caller]
    fn with(&self, change: impl FnOnce(&mut Bundle), words: &[&str]) {
        changed(&self.good, change, &self.scratch.at("bad.npz"));
        let words = [words, &["bad.npz"]].concat();
        let [bad, out] = ["bad.npz", "out"].map(|name| self.scratch.arg(name));
        for out in [out.clone() + ".npz", out.clone() + ".pc2", out] {
            let arguments = ["signal", "sample", &bad, "-o", &out];
            refused(self.scratch.path(), &arguments, &words);
        }
        refused(self.scratch.path(), &["signal", "info", &bad], &words);
    }
}

#[test]
fn files_of_windows_that_are_none() {
    let bad = Bad::new("vertex");
    for name in [
        "meta", "windows", "overlap", "F", "0/h0", "1/H", "1/p", "0/u",
    ] {
        bad.with(|b| drop(b.0.remove(name)), &[name]);
        bad.with(|b| b.put(name, Array::vector(&[1.0, 2.0])), &[]);
    }
    let windows = |shape: [usize; 2], data: &[i64]| {
        let (shape, data) = (shape.to_vec(), data.to_vec());
        move |b: &mut Bundle| b.put("windows", Array::I64 { shape, data })
    };
    bad.with(windows([1, 4], &[0, 11, 9, 20]), &["`windows`", "(W, 2)"]);
    bad.with(windows([2, 2], &[0, 11, -9, 20]), &["`windows`"]);
    bad.with(windows([0, 2], &[]), &["at least 4"]);
    bad.with(windows([2, 2], &[0, 11, 10, 20]), &["window 2"]);
    bad.with(windows([2, 2], &[1, 11, 9, 20]), &["window 1"]);
    bad.with(windows([2, 2], &[0, 11, 9, 7]), &["window 2"]);
    bad.with(
        windows([2, 2], &[0, 11, 9, 21]),
        &["window 2 (1-based)", "11 frames"],
    );
    bad.with(
        windows([2, 2], &[0, 12, 10, 20]),
        &["window 1 (1-based)", "frames"],
    );
    bad.with(|b| b.put("overlap", Array::integer(3)), &["window 2"]);
    let later = r#"{"format": "meshseq signal windows 2", "space": "vertex"}"#;
    bad.with(
        |b| b.put("meta", Array::Text(later.into())),
        &["windows 2", "windows 1"],
    );
    let nan = |b: &mut Bundle| {
        if let Some(Array::F64 { data, .. }) = b.0.get_mut("1/g") {
            data[0] = f64::NAN;
        }
    };
    bad.with(nan, &["window 2", "not finite"]);
    let other_mesh = |b: &mut Bundle| {
        if let Some(Array::F64 { shape, data }) = b.0.get_mut("1/h0") {
            (shape[0], *data) = (3, vec![0.0; 3]);
        }
    };
    bad.with(other_mesh, &["window 2", "`h0`"]);
    let bad = Bad::new("patch");
    bad.with(|b| drop(b.0.remove("reference")), &["reference"]);
    bad.with(|b| drop(b.0.remove("1/patches")), &["1/patches"]);
    let one_patch = |b: &mut Bundle| {
        if let Some(Array::I64 { data, .. }) = b.0.get_mut("1/patches") {
            data.clear();
            b.put("1/patches", Array::integers(&[]));
        }
    };
    bad.with(one_patch, &["patch"]);
}

#[test]
fn verbs_that_need_one_representation_of_all_frames() {
    let scratch = Bad::new("vertex").scratch;
    let [windows, edits, out] =
        ["windows.npz", "edits.toml", "out.npz"].map(|name| scratch.arg(name));
    std::fs::write(&edits, "[[edit]]\ndo = \"reverse\"\nframes = \"1..5\"\n").unwrap();
    let words = ["windows.npz", "in windows", "without --window"];
    let edit = ["signal", "edit", &windows, &edits, "-o", &out];
    refused(scratch.path(), &edit, &words);
    let transfer = ["signal", "transfer", &windows, "-o", &out, "--examples"];
    let examples = ["@gallop-poses-small", "@trot-poses-small"];
    refused(scratch.path(), &[&transfer[..], &examples].concat(), &words);
}
