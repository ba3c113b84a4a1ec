//! Tables, edits, examples and designs that cannot be used.

use std::fs;

use meshseq::sequence::format::write;

use super::common::{Scratch, must, sheet};
use super::{good, refused};

/// A verb of signals with these arguments, of which those with a dot in them are files of the folder.
#[track_caller]
fn bad(scratch: &Scratch, arguments: &str, words: &[&str]) {
    let arguments: Vec<String> = arguments
        .split_whitespace()
        .map(
            |a| match a.contains('.') && !a.contains("..") && !a.starts_with('@') {
                true => scratch.arg(a),
                false => a.to_owned(),
            },
        )
        .collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    refused(
        scratch.path(),
        &[&["signal"], &arguments[..]].concat(),
        words,
    );
}

#[track_caller]
fn edits(scratch: &Scratch, text: &str, words: &[&str]) {
    fs::write(scratch.at("edits.toml"), text).unwrap();
    let words = [words, &["edits.toml"]].concat();
    bad(
        scratch,
        "edit rep.npz edits.toml -o new.npz --json new.json",
        &words,
    );
}

#[test]
fn edits_that_cannot_be_made() {
    let scratch = good();
    edits(&scratch, "", &["edit", "--help"]);
    edits(&scratch, "edit = 1", &["--help"]);
    edits(&scratch, "[[edit]]\ndo = \"fly\"\n", &["fly", "--help"]);
    let one = |text: &str| format!("[[edit]]\ndo = {text}\n");
    edits(
        &scratch,
        &one("\"move\"\ncontrol = 7\nby = [0.1, 0.2]"),
        &["control point 7", "1 to 6"],
    );
    edits(
        &scratch,
        &one("\"move\"\ncontrol = 1\nto = [nan, 0.0]"),
        &["finite"],
    );
    edits(&scratch, &one("\"move\"\ncontrol = 1"), &["`to` or `by`"]);
    for far in ["1e200", "1e308", "-1e100"] {
        let words = ["edit 1", "farther", "pose plane"];
        let to = format!("\"move\"\ncontrol = 2\nto = [{far}, 1]");
        edits(&scratch, &one(&to), &words);
        let through = format!("\"loop\"\nafter = 2\nthrough = [[{far}, 1]]");
        edits(&scratch, &one(&through), &words);
    }
    let none = "\"loop\"\nafter = 2\nthrough = []";
    edits(&scratch, &one(none), &["edit 1", "at least 1 point"]);
    let negative = "\"delete\"\nframes = \"2..3\"\njoin = -1";
    edits(&scratch, &one(negative), &["line", "-1"]);
    edits(
        &scratch,
        &one("\"delete\"\nframes = \"1..5\""),
        &["at least 2 of 6"],
    );
    edits(
        &scratch,
        &one("\"reverse\"\nframes = \"5..7\""),
        &["5..7", "1..6"],
    );
    edits(
        &scratch,
        &one("\"repeat\"\nframes = \"2..3\"\ntimes = 0"),
        &["times"],
    );
    edits(
        &scratch,
        &one("\"repeat\"\nframes = \"2..3\"\ntimes = 999999999999"),
        &["more than"],
    );
    edits(
        &scratch,
        &one("\"repeat\"\nframes = \"2..3\"\ntimes = -1"),
        &["--help"],
    );
    edits(
        &scratch,
        &one("\"loop\"\nafter = 6\nthrough = [[1.0, 1.0]]"),
        &["after frame 6", "1 to 5"],
    );
    edits(
        &scratch,
        &one("\"loop\"\nafter = 2\nthrough = [[1.0, inf]]"),
        &["finite"],
    );
    edits(&scratch, &"#".repeat(65 << 20), &["bytes"]);
    bad(
        &scratch,
        "edit rep.npz none.toml -o new.npz",
        &["none.toml", "cannot read"],
    );
    bad(
        &scratch,
        "edit rep.npz edits.toml -o new.obj",
        &["new.obj", ".npz"],
    );
    bad(
        &scratch,
        "edit good.npz edits.toml -o new.npz",
        &["good.npz", "expected a representation"],
    );
}

#[test]
fn times_and_warps_that_cannot_be_sampled() {
    let scratch = good();
    let sample = |arguments: &str, words: &[&str]| {
        bad(
            &scratch,
            &format!("sample rep.npz -o out.npz {arguments}"),
            words,
        );
    };
    sample("--rate 0", &["rate 0", "positive"]);
    sample("--rate -1", &["rate -1", "positive"]);
    sample("--rate nan", &["NaN", "positive"]);
    sample("--rate 1e300", &["frames", "1 to"]);
    sample("--frames 0", &["--frames", "1 to"]);
    sample("--frames 5 --rate 2", &["--frames", "--rate"]);
    sample("--times 1,7", &["time 2", "7", "1 to 6"]);
    sample("--times 1,x", &["`x`", "numbers"]);
    sample("--times ,", &["no times"]);
    fs::write(scratch.at("times.txt"), "1\n2\nthree\n").unwrap();
    sample("--times times.txt", &["times.txt", "three"]);
    let warp = |text: &str, words: &[&str]| {
        fs::write(scratch.at("warp.csv"), text).unwrap();
        sample("--warp warp.csv", &[words, &["warp.csv"]].concat());
    };
    warp("", &["frame,time"]);
    warp("frame,time\n1,1\n", &["at least 2 rows"]);
    warp("frame,time\n1,1\n1,2\n", &["row 2", "greater"]);
    warp("frame,time\n1,1\n5,6.5\n", &["6.5", "1 to 6"]);
    warp("frame,time\n1,1\n5,inf\n", &["line 3", "finite"]);
    warp("frame,time\n1,1\n1e300,2\n", &["frames", "1 to"]);
}

#[test]
fn frames_that_cannot_be_left_out() {
    let scratch = good();
    let short = ["good.npz: ", "at least 7 frames", "found 6"];
    bad(&scratch, "leave-out good.npz --json new.json", &short);
    write(&sheet(9, 4, 3), &scratch.at("long.npz")).unwrap();
    let refuse = |choice: &str, words: &[&str]| {
        bad(
            &scratch,
            &format!("leave-out long.npz --json new.json {choice}"),
            words,
        );
    };
    refuse("--shares=2", &["--shares 2", "at most 1"]);
    refuse("--knots even", &["`even`", "literal"]);
    refuse("--layout flat", &["flat"]);
    refuse("--refine --between=-1", &["--between", "0 or more"]);
}

#[test]
fn examples_that_pair_nothing() {
    let scratch = good();
    write(&sheet(5, 3, 3), &scratch.at("other.npz")).unwrap();
    let transfer = |arguments: &str, words: &[&str]| {
        bad(
            &scratch,
            &format!("transfer {arguments} -o out.npz --rep out-rep.npz --json out.json"),
            words,
        );
    };
    transfer(
        "rep.npz --examples good.npz other.npz",
        &["6 of", "5 of", "pair"],
    );
    transfer(
        "rep.npz --examples good.npz other.npz --example-frames 1..1",
        &["at least 2 examples"],
    );
    transfer(
        "rep.npz --examples good.npz other.npz --example-frames 4..9",
        &["4..9"],
    );
    transfer(
        "rep.npz --examples other.npz good.npz --example-frames 1..4",
        &["two meshes"],
    );
    transfer("other.npz --examples good.npz good.npz", &["two meshes"]);
    transfer(
        "rep.npz --examples good.npz good.npz --space gradient",
        &["vertex space"],
    );
    transfer(
        "rep.npz --examples good.npz good.npz --space flat",
        &["flat"],
    );
    transfer(
        "rep.npz --examples good.npz good.npz --k 5",
        &["--k", "stay"],
    );
    for rule in ["literal", "symmetric"] {
        let arguments = format!("rep.npz --examples good.npz good.npz --knots {rule}");
        transfer(&arguments, &["--knots", rule, "rep.npz keeps its knots"]);
    }
    transfer(
        "good.npz --examples good.npz good.npz --knots even",
        &["`even`", "literal", "symmetric"],
    );
    transfer(
        "good.npz --examples good.npz good.npz --k 99",
        &["good.npz: ", "k = 99", "4 <= k <= 8"],
    );
    transfer("good.npz --examples good.npz", &["2 values"]);
    for onto in ["rep.npz", "good.npz"] {
        let arguments = format!("transfer rep.npz --examples good.npz good.npz -o {onto}");
        bad(&scratch, &arguments, &["it is what is read"]);
    }
    for some in ["--frames 1..3", "--every 2"] {
        let arguments = format!("rep.npz --examples good.npz good.npz {some}");
        transfer(&arguments, &["rep.npz is transferred whole", "--frames"]);
    }
    transfer("none.npz --examples good.npz good.npz", &["none.npz"]);
    write(&sheet(1, 3, 3), &scratch.at("rest.obj")).unwrap();
    transfer(
        "rep.npz --examples good.npz good.npz --rest rest.obj rest.obj",
        &["rest.obj", "another mesh"],
    );
    let same = "transfer rep.npz --examples good.npz good.npz -o same.npz --rep same.npz";
    bad(&scratch, same, &["same.npz", "two"]);
}

#[test]
fn designs_that_cannot_be_made() {
    let scratch = good();
    let design = |poses: &str, curve: &str, arguments: &str, words: &[&str]| {
        fs::write(scratch.at("poses.csv"), poses).unwrap();
        fs::write(scratch.at("curve.csv"), curve).unwrap();
        bad(
            &scratch,
            &format!("design poses.csv curve.csv good.npz -o out.npz {arguments}"),
            words,
        );
    };
    let (poses, curve) = ("frame,x,y\n1,0,0\n3,1,0\n5,0,1\n", "x,y\n0,0\n1,1\n2,0\n");
    design("frame,x,y\n1,0,0\n", curve, "", &["at least 2 poses"]);
    design(
        "frame,x,y\n1,0,0\n9,1,0\n",
        curve,
        "",
        &["frame 9", "1 to 6"],
    );
    design(
        "frame,x,y\n1,0,0\n1,1,0\n",
        curve,
        "",
        &["frame 1", "twice"],
    );
    design(
        "frame,x,y\n1,0,0\n2,0,0\n",
        curve,
        "",
        &["1 and 2", "one place"],
    );
    design("x,y\n", curve, "", &["poses.csv", "frame,x,y"]);
    design(poses, "x,y\n0,0\n", "", &["at least 2 points", "found 1"]);
    design(poses, "x,y\n0,0\n1,0\n", "--closed", &["at least 3 points"]);
    design(poses, "a,b\n0,0\n", "", &["curve.csv", "x,y"]);
    design(poses, "x,y\n0,0\nnan,1\n", "", &["curve.csv", "line 3"]);
    design(poses, curve, "--l 2", &["expected 3 to 3"]);
    design(poses, curve, "--l 4", &["expected 3 to 3"]);
    design(poses, curve, "--frames 1", &["2 to"]);
    design(poses, curve, "--space none", &["none"]);
    fs::write(scratch.at("poses.csv"), poses).unwrap();
    fs::write(scratch.at("curve.csv"), curve).unwrap();
    let at = |name| scratch.arg(name);
    must(&[
        "signal",
        "design",
        &at("poses.csv"),
        &at("curve.csv"),
        &at("good.npz"),
        "-o",
        &at("fine.npz"),
        "--rep",
        &at("fine-rep.npz"),
    ]);
    must(&[
        "signal",
        "sample",
        &at("fine-rep.npz"),
        "--rate",
        "0.5",
        "-o",
        &at("half.npz"),
    ]);
}
