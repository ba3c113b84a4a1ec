//! Long sequences on the command line: fitted in windows, sampled, told of.

mod common;

use std::fs;

use common::{Scratch, must};
use meshseq::sequence::dataset::open;
use meshseq::sequence::format::{read, write};

fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(String::from).collect()
}

fn numbers(scratch: &Scratch, command: &str) -> serde_json::Value {
    must(&words(command));
    serde_json::from_slice(&fs::read(scratch.at("told.json")).unwrap()).unwrap()
}

fn number(value: &serde_json::Value, key: &str) -> f64 {
    value[key].as_f64().unwrap()
}

#[test]
fn the_tolerance_holds_over_the_whole_sequence() {
    let scratch = Scratch::new();
    let json = scratch.arg("told.json");
    for (name, choice) in [
        ("@roam-small:120", "--window 50"),
        (
            "@roam-small:120",
            "--window 50 --overlap 16 --layout mds --knots literal",
        ),
        ("@roam-small:60", "--window 35 --refine"),
        ("@roam-small:45", "--window 25 --space gradient"),
        ("@roam-small:45", "--window 25 --space patch"),
    ] {
        let fit = format!("signal fit {name} --tolerance 0.01 --json {json}");
        let joined = numbers(&scratch, &format!("{fit} {choice}"));
        let windows = joined["windows"].as_array().unwrap();
        assert!(windows.len() > 1);
        let rms = number(&joined, "rms_relative");
        assert!(0.001 < rms && rms <= 0.01, "{choice}: {rms}");
        for (w, next) in windows.iter().zip(&windows[1..]) {
            let common = number(w, "last") - number(next, "first") + 1.0;
            assert_eq!(common, number(&joined, "overlap"));
            assert!(["k", "l", "m"].iter().all(|key| number(w, key) >= 3.0));
        }
    }
}

#[test]
fn times_and_dimensions_are_told_of_the_whole_and_of_each_window() {
    let scratch = Scratch::new();
    let json = scratch.arg("told.json");
    let fit = "signal fit @roam-small:30 --k 10 --l 8 --m 5 --window 18 --json";
    for space in ["vertex", "gradient"] {
        let told = numbers(&scratch, &format!("{fit} {json} --space {space}"));
        assert!(number(&told, "elapsed_ms") > 0.0 && told.get("time_ms").is_none());
        let windows = told["windows"].as_array().unwrap();
        for window in windows {
            assert_eq!(window["d"], told["d"]);
            for stage in ["h", "mds", "rbf", "g", "f"] {
                assert!(number(&window["time_ms"], stage) >= 0.0);
            }
        }
        let d = number(&told, "d");
        let of_frames = 3.0 * number(&told, "V");
        assert!(if space == "vertex" {
            d == of_frames
        } else {
            d > of_frames
        });
    }
}

/// Windows see all the frames, in every format, and a choice of them; nothing else changes what they are.
#[test]
fn the_frames_matter_and_not_where_they_are_read_from() {
    let scratch = Scratch::new();
    let sequence = open("@roam-small:60").unwrap();
    let choice = "--k 16 --l 12 --m 8 --window 24 --overlap 5";
    let fitted = |source: &str| {
        let rep = scratch.arg("rep.npz");
        must(&words(&format!("signal fit {source} {choice} -o {rep}")));
        fs::read(scratch.at("rep.npz")).unwrap()
    };
    let expected = fitted("@roam-small:60");
    for name in ["all.npz", "all"] {
        write(&sequence, &scratch.at(name)).unwrap();
        assert!(fitted(&scratch.arg(name)) == expected, "{name}");
    }
    write(&sequence, &scratch.at("all.pc2")).unwrap();
    let rounded = read(&scratch.at("all.pc2")).unwrap();
    write(&rounded, &scratch.at("rounded.npz")).unwrap();
    assert!(fitted(&scratch.arg("all.pc2")) == fitted(&scratch.arg("rounded.npz")));
    let longer = "@roam-small:70 --frames ..60";
    assert!(fitted(longer) == expected);
    let indices: Vec<usize> = (4..60).step_by(2).collect();
    let some = sequence.select(&indices).unwrap();
    write(&some, &scratch.at("some.npz")).unwrap();
    assert!(fitted("@roam-small:60 --frames 5.. --every 2") == fitted(&scratch.arg("some.npz")));
}

#[test]
fn one_window_samples_as_the_plain_fit_does() {
    let scratch = Scratch::new();
    for space in ["vertex", "gradient", "patch"] {
        let fit = format!("signal fit @gallop-small --k 20 --l 15 --m 8 --space {space}");
        let sampled = |choice: &str| {
            let (rep, out) = (scratch.arg("rep.npz"), scratch.arg("out.npz"));
            must(&words(&format!("{fit} {choice} -o {rep}")));
            must(&words(&format!("signal sample {rep} --rate 2.5 -o {out}")));
            fs::read(scratch.at("out.npz")).unwrap()
        };
        assert!(sampled("") == sampled("--window 24"), "{space}");
    }
}

#[test]
fn samples_come_in_every_format_and_order_and_info_tells_of_windows() {
    let scratch = Scratch::new();
    let rep = scratch.arg("rep.npz");
    let fit = "signal fit @roam-small:100 --k 20 --l 15 --m 8 --window 40 --overlap 10";
    must(&words(&format!("{fit} -o {rep}")));
    let sampled = |times: &str, name: &str| {
        let out = scratch.arg(name);
        must(&words(&format!("signal sample {rep} {times} -o {out}")));
        read(&scratch.at(name)).unwrap()
    };
    let all = sampled("--frames 199", "all.npz");
    assert_eq!(all.positions(), sampled("--frames 199", "all").positions());
    let rounded = sampled("--frames 199", "all.pc2");
    let mut gaps = rounded.positions().iter().zip(all.positions());
    assert!(gaps.all(|(a, b)| *a == f64::from(*b as f32)));
    let some = sampled("--times 100,1,50.5,2,36,37.5", "some.npz");
    let expected = all.select(&[198, 0, 99, 2, 70, 73]).unwrap();
    assert_eq!(some.positions(), expected.positions());
    let json = scratch.arg("told.json");
    let told = numbers(&scratch, &format!("signal info {rep} --json {json}"));
    assert_eq!(told["n"], 100);
    assert_eq!(told["windows"].as_array().unwrap().len(), 3);
    assert_eq!(told["windows"][2]["last"], 100);
    assert_eq!(told["windows"][1]["k"], 20);
}
