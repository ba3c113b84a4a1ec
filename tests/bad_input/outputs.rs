//! Places where nothing can be written.

use std::fs;
use std::os::unix::fs::FileTypeExt;
use std::process::Command;

use meshseq::sequence::format::write;

use super::common::{MESHSEQ, Scratch, sheet, text};
use super::{assert_refusal, good, refused};

/// Every verb that writes, to this place: with its other outputs good, which must not be written either.
#[track_caller]
fn every_verb(scratch: &Scratch, npz: &str, json: &str, words: &[&str]) {
    for arguments in verbs(scratch, npz, json) {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        refused(scratch.path(), &arguments, words);
    }
}

fn verbs(scratch: &Scratch, npz: &str, json: &str) -> Vec<Vec<String>> {
    let (good, rep) = (scratch.arg("good.npz"), scratch.arg("rep.npz"));
    let (fine_npz, fine_json) = (scratch.arg("fine.npz"), scratch.arg("fine.json"));
    let klm = ["--k", "6", "--l", "5", "--m", "3"];
    let fit = |npz: &str, json: &str| {
        let all = [
            &["signal", "fit", &good, "-o", npz, "--json", json],
            &klm[..],
        ]
        .concat();
        all.iter().map(|s| s.to_string()).collect()
    };
    let verb = |all: &[&str]| all.iter().map(|s| s.to_string()).collect();
    vec![
        verb(&["info", &good, "--json", json]),
        verb(&["info", &good, "--json", &fine_json, "--quality", json]),
        verb(&["convert", &good, npz]),
        verb(&["signal", "sample", &rep, "-o", npz]),
        fit(npz, &fine_json),
        fit(&fine_npz, json),
        fit(npz, json),
    ]
}

#[test]
fn folders_that_do_not_exist_or_are_files() {
    let scratch = good();
    let (npz, json) = (scratch.arg("none/a.npz"), scratch.arg("none/a.json"));
    every_verb(
        &scratch,
        &npz,
        &json,
        &["none", "does not exist", "create it"],
    );
    let (npz, json) = (
        scratch.arg("good.npz/a.npz"),
        scratch.arg("good.npz/a.json"),
    );
    every_verb(&scratch, &npz, &json, &["good.npz", "does not exist"]);
    for path in ["none/frames", "none/a.pc2"] {
        refused(
            scratch.path(),
            &["convert", &scratch.arg("good.npz"), &scratch.arg(path)],
            &["none", "does not exist"],
        );
    }
    every_verb(&scratch, "", "", &[""]);
}

#[test]
fn what_is_read_is_not_written_over() {
    let scratch = good();
    let [good, rep, edits] = ["good.npz", "rep.npz", "edits.toml"].map(|name| scratch.arg(name));
    fs::write(&edits, "[[edit]]\ndo = \"reverse\"\nframes = \"1..3\"\n").unwrap();
    let klm = ["--k", "6", "--l", "5", "--m", "3"];
    for arguments in [
        &["convert", &good, &good, "--frames", "1..2"][..],
        &["signal", "sample", &rep, "-o", &rep],
        &["signal", "edit", &rep, &edits, "-o", &rep],
        &[&["signal", "fit", &good, "-o", &good], &klm[..]].concat(),
    ] {
        refused(scratch.path(), arguments, &["it is what is read"]);
    }
    let frames = scratch.arg("frames");
    super::common::must(&["convert", &good, &frames]);
    for arguments in [
        &["convert", &good, &frames][..],
        &["signal", "sample", &rep, "-o", &frames],
    ] {
        refused(scratch.path(), arguments, &["frames: ", "not empty"]);
    }
    let onto_itself = ["convert", &frames, &frames, "--every", "2"];
    refused(scratch.path(), &onto_itself, &["it is what is read"]);
}

/// A command whose arguments with a dot or slash in them are files of the folder.
fn command(scratch: &Scratch, arguments: &str) -> Vec<String> {
    let words = arguments.split_whitespace();
    let is_file = |word: &str| word.contains(['.', '/']) && word.parse::<f64>().is_err();
    words
        .map(|word| match is_file(word) {
            true => scratch.arg(word),
            false => word.to_owned(),
        })
        .collect()
}

/// Everything that any verb reads.
fn inputs() -> Scratch {
    let scratch = good();
    for (name, text) in [
        (
            "edits.toml",
            "[[edit]]\ndo = \"reverse\"\nframes = \"1..3\"\n",
        ),
        ("pins.csv", "frame,x,y\n1,0,0\n"),
        ("poses.csv", "frame,x,y\n1,0,0\n3,1,0\n5,0,1\n"),
        ("curve.csv", "x,y\n0,0\n1,1\n2,0\n"),
        ("warp.csv", "frame,time\n1,1\n9,6\n"),
        ("times.txt", "1,2,3"),
    ] {
        fs::write(scratch.at(name), text).unwrap();
    }
    let good = scratch.arg("good.npz");
    for name in ["frames", "cache.pc2"] {
        super::common::must(&["convert", &good, &scratch.arg(name)]);
    }
    let rest = scratch.arg("rest.obj");
    super::common::must(&["convert", &good, &rest, "--frames", "1..1"]);
    scratch
}

#[test]
fn no_result_takes_the_place_of_an_input() {
    let scratch = inputs();
    let klm = "--k 6 --l 5 --m 3";
    let transfer = "signal transfer rep.npz --examples good.npz other.npz --rest rest.obj rest.obj";
    write(&sheet(6, 4, 3), &scratch.at("other.npz")).unwrap();
    for (arguments, option, input) in [
        ("info good.npz --json good.npz", "--json", "<SEQUENCE>"),
        (
            "info good.npz --quality good.npz",
            "--quality",
            "<SEQUENCE>",
        ),
        (
            "info frames/ --json frames/0002.obj",
            "--json",
            "<SEQUENCE>",
        ),
        (
            "info frames/000?.obj --quality frames/0006.obj",
            "--quality",
            "<SEQUENCE>",
        ),
        ("info cache.pc2 --json cache.obj", "--json", "<SEQUENCE>"),
        ("convert rest.obj rest.pc2", "<OUT>", "<SEQUENCE>"),
        (
            "signal fit frames/ KLM -o new.npz --json frames/0001.obj",
            "--json",
            "<SEQUENCE>",
        ),
        (
            "signal fit good.npz KLM --window 6 --json good.npz",
            "--json",
            "<SEQUENCE>",
        ),
        (
            "signal fit good.npz KLM --pins pins.csv --json pins.csv",
            "--json",
            "--pins",
        ),
        (
            "signal fit good.npz KLM --space gradient --reference rest.obj --json rest.obj",
            "--json",
            "--reference",
        ),
        (
            "signal fit good.npz KLM --space gradient --reference other.npz -o other.npz",
            "-o",
            "--reference",
        ),
        (
            "signal info rep.npz --json rep.npz",
            "--json",
            "<REPRESENTATION>",
        ),
        (
            "signal info rep.npz --places rep.npz",
            "--places",
            "<REPRESENTATION>",
        ),
        (
            "signal info rep.npz --plot rep.npz",
            "--plot",
            "<REPRESENTATION>",
        ),
        (
            "signal leave-out good.npz --json good.npz",
            "--json",
            "<SEQUENCE>",
        ),
        (
            "signal sample rep.npz -o new.npz --json rep.npz",
            "--json",
            "<REPRESENTATION>",
        ),
        (
            "signal sample rep.npz --warp warp.csv -o new.npz --json warp.csv",
            "--json",
            "--warp",
        ),
        (
            "signal sample rep.npz --times times.txt -o new.npz --json times.txt",
            "--json",
            "--times",
        ),
        (
            "signal edit rep.npz edits.toml -o new.npz --json rep.npz",
            "--json",
            "<REPRESENTATION>",
        ),
        (
            "signal edit rep.npz edits.toml -o new.npz --json edits.toml",
            "--json",
            "<EDITS>",
        ),
        ("TRANSFER -o new.npz --json rep.npz", "--json", "<SOURCE>"),
        (
            "TRANSFER -o new.npz --json other.npz",
            "--json",
            "--examples",
        ),
        ("TRANSFER -o new.npz --rep other.npz", "--rep", "--examples"),
        ("TRANSFER -o rest.obj", "-o", "--rest"),
        (
            "signal design poses.csv curve.csv good.npz -o new.npz --json poses.csv",
            "--json",
            "<POSES>",
        ),
        (
            "signal design poses.csv curve.csv good.npz -o new.npz --json curve.csv",
            "--json",
            "<CURVE>",
        ),
        (
            "signal design poses.csv curve.csv good.npz -o new.npz --rep good.npz",
            "--rep",
            "<SEQ>",
        ),
    ] {
        let arguments = arguments.replace("KLM", klm).replace("TRANSFER", transfer);
        let arguments = command(&scratch, &arguments);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let begins = format!("meshseq: {option} ");
        let words = [&begins, "it is what is read", input, "another place"];
        refused(scratch.path(), &arguments, &words);
    }
}

#[test]
fn no_two_results_go_to_one_place() {
    let scratch = inputs();
    let klm = "--k 6 --l 5 --m 3";
    let transfer = "signal transfer rep.npz --examples good.npz good.npz";
    let design = "signal design poses.csv curve.csv good.npz";
    for (arguments, first, second) in [
        (
            "info good.npz --json q.x --quality q.x",
            "--json",
            "--quality",
        ),
        (
            "signal fit good.npz KLM -o new.npz --json new.npz",
            "-o",
            "--json",
        ),
        (
            "signal fit good.npz KLM --window 6 -o new.npz --json new.npz",
            "-o",
            "--json",
        ),
        (
            "signal info rep.npz --json q.x --places q.x",
            "--json",
            "--places",
        ),
        (
            "signal info rep.npz --places q.x --plot ./q.x",
            "--places",
            "--plot",
        ),
        (
            "signal sample rep.npz -o new.npz --json new.npz",
            "-o",
            "--json",
        ),
        (
            "signal sample rep.npz -o new.pc2 --json new.obj",
            "-o",
            "--json",
        ),
        (
            "signal edit rep.npz edits.toml -o new.npz --json new.npz",
            "-o",
            "--json",
        ),
        ("TRANSFER -o new.npz --rep new.npz", "-o", "--rep"),
        ("TRANSFER -o new.npz --json new.npz", "-o", "--json"),
        (
            "TRANSFER -o fine.npz --rep new.npz --json new.npz",
            "--rep",
            "--json",
        ),
        ("DESIGN -o new.npz --rep new.npz", "-o", "--rep"),
        (
            "DESIGN -o fine.npz --rep new.npz --json new.npz",
            "--rep",
            "--json",
        ),
    ] {
        let arguments = arguments.replace("KLM", klm).replace("TRANSFER", transfer);
        let arguments = command(&scratch, &arguments.replace("DESIGN", design));
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let begins = format!("meshseq: {second} ");
        let words = [&begins, first, "same place", "name two"];
        refused(scratch.path(), &arguments, &words);
    }
}

#[test]
fn folders_in_the_place_of_files() {
    let scratch = good();
    for name in ["a.npz", "a.json"] {
        fs::create_dir(scratch.at(name)).unwrap();
        fs::write(scratch.at(name).join("keep.txt"), "mine").unwrap();
    }
    every_verb(
        &scratch,
        &scratch.arg("a.npz"),
        &scratch.arg("a.json"),
        &["a."],
    );
    // A folder of something else is not replaced by one of frames, nor is a file.
    for taken in ["a.json", "good.npz/"] {
        refused(
            scratch.path(),
            &["convert", &scratch.arg("good.npz"), &scratch.arg(taken)],
            &[],
        );
    }
}

#[test]
fn endings_that_are_no_representation() {
    let scratch = good();
    let klm = ["--k", "6", "--l", "5", "--m", "3"];
    for name in ["rep", "rep.json", "frames/"] {
        let arguments = [
            "signal",
            "fit",
            &scratch.arg("good.npz"),
            "-o",
            &scratch.arg(name),
        ];
        refused(
            scratch.path(),
            &[&arguments[..], &klm].concat(),
            &["one .npz file"],
        );
    }
    refused(
        scratch.path(),
        &["convert", &scratch.arg("good.npz"), &scratch.arg("a.fbx")],
        &["a.fbx", "not supported"],
    );
    refused(
        scratch.path(),
        &["convert", &scratch.arg("good.npz"), &scratch.arg("a.obj")],
        &["a.obj", "one frame"],
    );
}

/// The device that is always full is written to, not replaced by a file.
#[test]
fn the_full_device() {
    let scratch = good();
    let is_device = || fs::metadata("/dev/full").is_ok_and(|m| m.file_type().is_char_device());
    if !is_device() {
        println!("skipped: no /dev/full");
        return;
    }
    let (good, npz) = (scratch.arg("good.npz"), scratch.arg("fine.npz"));
    let words = ["/dev/full", "No space left", "nothing was written"];
    refused(
        scratch.path(),
        &["info", &good, "--json", "/dev/full"],
        &words,
    );
    let json = scratch.arg("fine.json");
    refused(
        scratch.path(),
        &["info", &good, "--json", &json, "--quality", "/dev/full"],
        &words,
    );
    let fit = [
        "signal",
        "fit",
        &good,
        "-o",
        &npz,
        "--json",
        "/dev/full",
        "--tolerance",
        "0.01",
    ];
    refused(scratch.path(), &fit, &words);
    assert!(is_device());
    let said = super::common::must(&["info", &good, "--json", "/dev/stdout"]);
    assert!(said.contains("\"frames\": 6"), "{said}");
}

/// A file system of 64 kB, full already, that is there for one command only.
#[test]
fn a_full_disk() {
    let scratch = good();
    let disk = scratch.arg("disk");
    fs::create_dir(&disk).unwrap();
    let place = |name: &str| format!("{disk}/{name}");
    let mut runs = verbs(&scratch, &place("a.npz"), &place("a.json"));
    for name in ["frames", "a.pc2"] {
        runs.push(vec!["convert".into(), scratch.arg("good.npz"), place(name)]);
    }
    for arguments in runs {
        let script =
            "mount -t tmpfs -o size=64k tmpfs \"$1\" 2>/dev/null || exit 77; disk=$1; shift
            head -c 65536 /dev/zero > \"$disk/filler\" 2>/dev/null
            \"$0\" \"$@\"; code=$?; ls -A \"$disk\"; exit $code";
        let mut output = Command::new("unshare")
            .args([
                "--mount",
                "--map-root-user",
                "sh",
                "-c",
                script,
                MESHSEQ,
                &disk,
            ])
            .args(&arguments)
            .output()
            .unwrap();
        let unshared = !text(&output.stderr).starts_with("unshare");
        if output.status.code() == Some(77) || !unshared {
            println!("skipped: cannot mount a small file system");
            return;
        }
        assert_eq!(text(&output.stdout), "filler\n", "{arguments:?}");
        output.stdout.clear();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        assert_refusal(
            &output,
            &arguments,
            &["disk/", "No space left", "nothing was written"],
        );
    }
    let left: Vec<_> = super::listing(scratch.path()).into_keys().collect();
    assert_eq!(
        left,
        ["disk", "good.npz", "rep.npz"].map(|name| scratch.at(name))
    );
}
