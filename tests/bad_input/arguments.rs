//! Constants, frames and times out of range.

use meshseq::sequence::format::write;
use meshseq::sequence::synthetic::catalogue;

use super::common::{Scratch, sheet};
use super::{good, refused};

/// `signal fit good.npz` with these arguments besides `-o` and `--json`.
#[track_caller]
fn fit(scratch: &Scratch, arguments: &[&str], words: &[&str]) {
    let (input, out, json) = (
        scratch.arg("good.npz"),
        scratch.arg("out.npz"),
        scratch.arg("out.json"),
    );
    let all = [
        &["signal", "fit", &input, "-o", &out, "--json", &json],
        arguments,
    ]
    .concat();
    refused(scratch.path(), &all, words);
}

#[test]
fn constants_out_of_range_on_each_side() {
    let scratch = good();
    let klm = |k, l, m, words: &[&str]| fit(&scratch, &["--k", k, "--l", l, "--m", m], words);
    klm("3", "3", "2", &["k = 3", "4 <= k <= 8", "6 frames"]);
    klm("9", "3", "2", &["k = 9", "4 <= k <= 8"]);
    klm("4", "2", "2", &["good.npz: ", "l = 2", "3 <= l <= 6"]);
    klm("4", "7", "2", &["l = 7", "3 <= l <= 6"]);
    klm("4", "3", "6", &["m = 6", "0 <= m <= 5"]);
    klm("4", "3", "-1", &["--m", "-1", "0 to n - 1"]);
    klm("-4", "3", "2", &["--k", "-4", "4 to n + 2"]);
    klm("4", "99999999999999999999999", "2", &["--l", "3 to n"]);
    klm(
        "18446744073709551615",
        "3",
        "2",
        &["k = 18446744073709551615", "4 <= k <= 8"],
    );
    klm("four", "3", "2", &["--k", "four", "whole number"]);
    fit(&scratch, &["--k", "4"], &["--l", "--m"]);
    fit(&scratch, &[], &["--tolerance"]);
    fit(
        &scratch,
        &["--k", "4", "--l", "3", "--m", "0", "--knots", "even"],
        &["literal", "symmetric", "even"],
    );
}

#[test]
fn no_constants_at_all() {
    let scratch = good();
    fit(&scratch, &[], &["--tolerance R", "--k, --l and --m"]);
}

#[test]
fn fewer_than_four_frames() {
    let scratch = Scratch::new();
    for n in 1..4 {
        write(&sheet(n, 4, 3), &scratch.at("good.npz")).unwrap();
        let words = ["good.npz: ", "at least 4 frames", &format!("found {n}")];
        fit(&scratch, &["--k", "4", "--l", "3", "--m", "0"], &words);
        fit(&scratch, &["--tolerance", "0.01"], &words);
    }
    write(&sheet(6, 4, 3), &scratch.at("good.npz")).unwrap();
    fit(
        &scratch,
        &["--frames", "2..4", "--tolerance", "0.01"],
        &["at least 4 frames", "found 3"],
    );
}

#[test]
fn tolerances_that_are_none() {
    let scratch = good();
    for bad in ["nan", "NaN", "0", "-0", "-0.01", "inf", "-inf"] {
        fit(
            &scratch,
            &[&format!("--tolerance={bad}")],
            &["tolerance", "positive", "0.01"],
        );
    }
    fit(
        &scratch,
        &["--tolerance", "-1"],
        &["tolerance -1", "positive"],
    );
    fit(
        &scratch,
        &["--tolerance", "small"],
        &["--tolerance", "small"],
    );
    fit(
        &scratch,
        &["--tolerance", "0.1", "--k", "4", "--l", "3", "--m", "0"],
        &["--tolerance", "--k"],
    );
}

#[test]
fn frames_that_are_not_there() {
    let scratch = good();
    let folder = scratch.path();
    let (input, out, json) = (
        scratch.arg("good.npz"),
        scratch.arg("out.npz"),
        scratch.arg("out.json"),
    );
    let choices: [(&[&str], &[&str]); 12] = [
        (&["--frames", "0..3"], &["frames `0..3`", "A..B"]),
        (&["--frames", "5..2"], &["frames `5..2`", "A..B"]),
        (&["--frames", "a..b"], &["frames `a..b`", "A..B"]),
        (&["--frames", "1...4"], &["frames `1...4`", "A..B"]),
        (&["--frames", "-3..4"], &["frames `-3..4`", "A..B"]),
        (&["--frames", ""], &["frames ``", "A..B"]),
        (&["--frames", "1..999999999999999999999"], &["A..B"]),
        (
            &["--frames", "1..7"],
            &["good.npz", "frames 1..7", "1..6", "choose"],
        ),
        (
            &["--frames", "7.."],
            &["good.npz", "frames 7..", "1..6", "choose"],
        ),
        (&["--every", "0"], &["--every 0", "at least 1"]),
        (&["--every", "-1"], &["--every", "-1", "whole number"]),
        (&["--every", "1.5"], &["--every", "1.5", "whole number"]),
    ];
    for (choice, words) in choices {
        refused(
            folder,
            &[&["info", &input, "--json", &json], choice].concat(),
            words,
        );
        refused(
            folder,
            &[&["convert", &input, &out], choice].concat(),
            words,
        );
        fit(
            &scratch,
            &[choice, &["--tolerance", "0.01"]].concat(),
            words,
        );
    }
}

#[test]
fn times_and_counts_out_of_range() {
    let scratch = good();
    let (rep, out) = (scratch.arg("rep.npz"), scratch.arg("out.npz"));
    let sample = |arguments: &[&str], words: &[&str]| {
        let all = [&["signal", "sample", &rep, "-o", &out], arguments].concat();
        refused(scratch.path(), &all, words);
    };
    for bad in ["0.999", "6.001", "nan", "inf", "-1", "1,2,7"] {
        sample(&["--times", bad], &["--times", "from 1 to 6"]);
    }
    sample(&["--times", "1,soon"], &["--times", "soon"]);
    sample(&["--times", ""], &["--times"]);
    sample(
        &["--frames", "0"],
        &["--frames", "0 frames", "1 to 10000000"],
    );
    sample(
        &["--frames", "10000001"],
        &["--frames", "10000001 frames", "1 to 10000000"],
    );
    sample(&["--frames", "-5"], &["--frames", "-5", "whole number"]);
    sample(&["--frames", "3", "--times", "1"], &["--frames", "--times"]);
}

#[test]
fn names_and_threads() {
    let scratch = good();
    let folder = scratch.path();
    let input = scratch.arg("good.npz");
    for bad in ["0", "-1", "many", "1000000"] {
        refused(
            folder,
            &["info", &input, "--threads", bad],
            &["--threads", bad],
        );
    }
    refused(folder, &["inform", &input], &["inform"]);
    if !catalogue().is_empty() {
        refused(folder, &["info", "@horse"], &["@horse", "@gallop"]);
    }
    refused(
        folder,
        &["verify", "no/such/case"],
        &["no/such/case", "meshseq list"],
    );
    refused(
        folder,
        &["verify", "--inject", "nothing"],
        &["nothing", "--inject list"],
    );
    refused(
        folder,
        &[
            "verify",
            "--engine",
            "abacus",
            "--out",
            &scratch.arg("record"),
        ],
        &["abacus", "numpy"],
    );
    refused(
        folder,
        &["compare", &scratch.arg("a"), &scratch.arg("b")],
        &["agreement.csv", "record"],
    );
    refused(
        folder,
        &["report", &scratch.arg("a")],
        &["agreement.csv", "record"],
    );
}
