//! Pins that cannot be used.

use std::fs;

use super::common::Scratch;
use super::{good, refused};

#[track_caller]
fn bad(scratch: &Scratch, pins: &str, words: &[&str]) {
    fs::write(scratch.at("pins.csv"), pins).unwrap();
    let paths = ["good.npz", "pins.csv", "out.npz", "out.json"].map(|name| scratch.arg(name));
    let [input, pins, out, json] = paths.each_ref().map(String::as_str);
    let words = [words, &["pins.csv"]].concat();
    let fit = [
        "signal", "fit", input, "--pins", pins, "-o", out, "--json", json,
    ];
    refused(
        scratch.path(),
        &[&fit[..], &["--k", "6", "--l", "5", "--m", "3"]].concat(),
        &words,
    );
    refused(
        scratch.path(),
        &[&fit[..], &["--tolerance", "0.01"]].concat(),
        &words,
    );
}

#[test]
fn pins_that_contradict_each_other_or_name_no_frame() {
    let scratch = good();
    bad(
        &scratch,
        "frame,x,y\n2,0,0\n4,1,1\n2,0,1\n",
        &["frame 2", "twice", "keep one"],
    );
    bad(&scratch, "frame,x,y\n7,0,0\n", &["frame 7", "1 to 6"]);
    bad(
        &scratch,
        "frame,x,y\n0,0,0\n",
        &["frame 0", "counted from 1"],
    );
    bad(
        &scratch,
        "frame,x,y\n-1,0,0\n",
        &["frame,x,y", "counted from 1"],
    );
    bad(&scratch, "frame,x,y\n2,nan,0\n", &["frame 2", "finite"]);
    bad(&scratch, "frame,x,y\n2,0,inf\n", &["frame 2", "finite"]);
}

#[test]
fn pins_farther_than_any_pose() {
    let scratch = good();
    let [input, pins, out] = ["good.npz", "pins.csv", "out.npz"].map(|name| scratch.arg(name));
    for far in ["1e9", "1e160", "-1e300"] {
        fs::write(&pins, format!("frame,x,y\n1,{far},0\n3,0,0\n")).unwrap();
        let fit = ["signal", "fit", &input, "--pins", &pins, "-o", &out];
        let words = ["pin of frame 1", "farther", "shape coordinates"];
        let klm = ["--k", "6", "--l", "5", "--m", "3"];
        refused(scratch.path(), &[&fit[..], &klm].concat(), &words);
        let tolerance = ["--tolerance", "0.01"];
        refused(scratch.path(), &[&fit[..], &tolerance].concat(), &words);
    }
    fs::write(&pins, "frame,x,y\n1,0,0\n").unwrap();
    let fit = ["signal", "fit", &input, "--pins", &pins, "-o", &out];
    let refine = ["--tolerance", "0.01", "--refine"];
    let words = ["--refine", "--pins", "leave out"];
    refused(scratch.path(), &[&fit[..], &refine].concat(), &words);
}

#[test]
fn files_that_hold_no_pins() {
    let scratch = good();
    for text in [
        "",
        "2,0,0\n",
        "x,y,frame\n0,0,2\n",
        "frame,x\n2,0\n",
        "\0\0\0\n",
    ] {
        bad(&scratch, text, &["first line", "frame,x,y"]);
    }
    bad(&scratch, "frame,x,y\n2,0\n", &["line: 2", "frame,x,y"]);
    bad(&scratch, "frame,x,y\n2,0,0,0\n", &["line: 2", "frame,x,y"]);
    bad(&scratch, "frame,x,y\n1.5,0,0\n", &["line: 2", "frame,x,y"]);
    bad(&scratch, "frame,x,y\n2,a,0\n", &["line: 2", "frame,x,y"]);
    bad(
        &scratch,
        &format!("frame,x,y\n2,{},0\n", "7".repeat(100 << 20)),
        &["bytes"],
    );
    let mut header = "7".repeat(50 << 20);
    header.push('\n');
    bad(&scratch, &header, &["first line", "frame,x,y"]);
    fs::remove_file(scratch.at("pins.csv")).unwrap();
    let (input, none) = (scratch.arg("good.npz"), scratch.arg("pins.csv"));
    for (path, words) in [
        (none.as_str(), ["pins.csv", "cannot read"]),
        ("/dev/zero", ["/dev/zero", "bytes"]),
    ] {
        refused(
            scratch.path(),
            &[
                "signal",
                "fit",
                &input,
                "--pins",
                path,
                "--tolerance",
                "0.1",
            ],
            &words,
        );
    }
}

#[test]
fn the_same_pin_twice_is_one_pin() {
    let scratch = good();
    fs::write(
        scratch.at("pins.csv"),
        "frame, x, y\n2, 0, 0\n2, 0, 0\n5, 1, -1\n",
    )
    .unwrap();
    let arguments = [
        "signal",
        "fit",
        &scratch.arg("good.npz"),
        "--pins",
        &scratch.arg("pins.csv"),
    ];
    super::common::must(&[&arguments[..], &["--k", "6", "--l", "5", "--m", "3"]].concat());
}
