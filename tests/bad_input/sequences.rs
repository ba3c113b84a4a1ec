//! Files that are no sequence.

use std::fs;
use std::io::Write;

use meshseq::arrays::Array;
use meshseq::sequence::format::{npz, write};

use super::common::{Scratch, sheet};
use super::refused;

/// Every verb that reads a sequence refuses it.
#[track_caller]
fn refused_by_all(scratch: &Scratch, sequence: &str, words: &[&str]) {
    let folder = scratch.path();
    let input = scratch.arg(sequence);
    let (npz, frames, json) = (
        scratch.arg("out.npz"),
        scratch.arg("out"),
        scratch.arg("out.json"),
    );
    refused(folder, &["info", &input, "--json", &json], words);
    refused(folder, &["convert", &input, &npz], words);
    refused(folder, &["convert", &input, &frames], words);
    let fit = ["signal", "fit", &input, "-o", &npz, "--json", &json];
    refused(
        folder,
        &[&fit[..], &["--k", "4", "--l", "3", "--m", "0"]].concat(),
        words,
    );
    refused(
        folder,
        &[&fit[..], &["--tolerance", "0.01"]].concat(),
        words,
    );
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A folder `frames` with these frames after four good ones.
fn frames(bad: &[&str]) -> Scratch {
    let scratch = Scratch::new();
    fs::create_dir(scratch.at("frames")).unwrap();
    for (i, text) in [TRIANGLE; 4].iter().chain(bad).enumerate() {
        fs::write(scratch.at("frames").join(format!("{}.obj", i + 1)), text).unwrap();
    }
    scratch
}

#[test]
fn nothing_there() {
    let scratch = Scratch::new();
    fs::create_dir(scratch.at("frames")).unwrap();
    refused_by_all(
        &scratch,
        "frames",
        &["frames", "no .obj files", "check the folder"],
    );
    refused_by_all(
        &scratch,
        "none",
        &["none", "no such file", "check the path"],
    );
    refused_by_all(&scratch, "none.npz", &["none.npz", "no such file"]);
    refused_by_all(&scratch, "frames/*.obj", &["no .obj files"]);
    fs::write(scratch.at("a.fbx"), "Kaydara").unwrap();
    refused_by_all(&scratch, "a.fbx", &["a.fbx", "not supported", ".npz"]);
}

#[test]
fn obj_frames() {
    let bad = |text: &str, words: &[&str]| {
        let words = [words, &["frames/5.obj", "frame 5"]].concat();
        refused_by_all(&frames(&[text]), "frames", &words);
    };
    let with = |from: &str, to: &str| TRIANGLE.replace(from, to);
    bad("", &["empty"]);
    bad(
        &format!("v 5 5 5\n{TRIANGLE}"),
        &["found 4 vertices", "expected 3", "1.obj"],
    );
    bad(&with("1 2 3", "1 3 2"), &["triangle 0", "1.obj"]);
    bad(
        &format!("{TRIANGLE}f 1 2 3\n"),
        &["found 2 triangles", "expected 1"],
    );
    bad(
        &with("v 1 0", "v 1 nan"),
        &["5.obj:2:5", "vertex 1", "nan", "finite"],
    );
    bad(
        &with("v 1 0", "v inf 0"),
        &["5.obj:2:3", "vertex 1", "inf", "finite"],
    );
    bad(&with("v 1 0", "v 1e999 0"), &["5.obj:2:3"]);
    bad(&with("1 2 3", "1 2 4"), &["5.obj:4:7", "4"]);
    bad(&with("1 2 3", "1 2 0"), &["5.obj:4:7", "0"]);
    bad(&with("1 2 3", "1 2 99999999999999999999"), &["5.obj:4:7"]);
    // Cut off in the last line, and in the middle of the vertices.
    bad(&TRIANGLE[..TRIANGLE.len() - 3], &["5.obj:4"]);
    bad(&TRIANGLE[..10], &["5.obj"]);
}

#[test]
fn a_line_of_100_megabytes() {
    let scratch = frames(&[]);
    let mut file = fs::File::create(scratch.at("frames/5.obj")).unwrap();
    file.write_all(b"v ").unwrap();
    for _ in 0..100 {
        file.write_all(&[b'7'; 1 << 20]).unwrap();
    }
    drop(file);
    refused_by_all(&scratch, "frames", &["frames/5.obj:1", "frame 5", "line"]);
    fs::rename(scratch.at("frames/5.obj"), scratch.at("long.npz")).unwrap();
    refused_by_all(&scratch, "long.npz", &["long.npz", "not an NPZ file"]);
    fs::rename(scratch.at("long.npz"), scratch.at("long.pc2")).unwrap();
    refused_by_all(&scratch, "long.pc2", &["long.pc2", "PC2"]);
}

#[test]
fn files_cut_off() {
    let scratch = Scratch::new();
    for name in ["a.npz", "a.pc2"] {
        write(&sheet(6, 4, 3), &scratch.at(name)).unwrap();
        let bytes = fs::read(scratch.at(name)).unwrap();
        for length in [0, 1, 7, 40, bytes.len() / 2, bytes.len() - 1] {
            let cut = format!("cut-{name}");
            fs::write(scratch.at(&cut), &bytes[..length]).unwrap();
            refused_by_all(&scratch, &cut, &[&cut]);
        }
    }
}

/// The shape in the header of an array of 12 vertices becomes one of a trillion.
#[test]
fn headers_that_promise_a_trillion_vertices() {
    let scratch = Scratch::new();
    write(&sheet(6, 4, 3), &scratch.at("a.npz")).unwrap();
    let mut bytes = fs::read(scratch.at("a.npz")).unwrap();
    let (honest, lie) = (b"(6, 12, 3), }         ", b"(6, 1000000000000, 3)}");
    let at = bytes
        .windows(honest.len())
        .position(|w| w == honest)
        .unwrap();
    bytes[at..at + lie.len()].copy_from_slice(lie);
    fs::write(scratch.at("a.npz"), &bytes).unwrap();
    refused_by_all(
        &scratch,
        "a.npz",
        &["a.npz", "array V", "1000000000000", "bytes"],
    );

    write(&sheet(6, 4, 3), &scratch.at("a.pc2")).unwrap();
    let mut bytes = fs::read(scratch.at("a.pc2")).unwrap();
    for at in [16, 28] {
        bytes[at..at + 4].copy_from_slice(&i32::MAX.to_le_bytes());
    }
    fs::write(scratch.at("a.pc2"), &bytes).unwrap();
    refused_by_all(
        &scratch,
        "a.pc2",
        &["a.pc2", "2147483647 vertices", "bytes"],
    );
}

#[test]
fn arrays_that_are_no_sequence() {
    let scratch = Scratch::new();
    let frames = |shape: &[usize], change: fn(&mut [f64])| {
        let mut data: Vec<f64> = (0..shape.iter().product())
            .map(|i| (i as f64).sin())
            .collect();
        change(&mut data);
        Array::F64 {
            shape: shape.to_vec(),
            data,
        }
    };
    let faces = |data: &[i64]| Array::I64 {
        shape: vec![data.len() / 3, 3],
        data: data.to_vec(),
    };
    let bad = |arrays: &[(&str, Array)], words: &[&str]| {
        npz::write_arrays(&scratch.at("a.npz"), arrays).unwrap();
        refused_by_all(&scratch, "a.npz", &[words, &["a.npz"]].concat());
    };
    let whole = || frames(&[5, 4, 3], |_| ());
    let good = || faces(&[0, 1, 2, 0, 2, 3]);
    bad(
        &[
            ("V", frames(&[5, 4, 3], |v| v[14] = f64::NAN)),
            ("F", good()),
        ],
        &["frame 2", "vertex 0", "NaN"],
    );
    bad(
        &[
            ("V", frames(&[5, 4, 3], |v| v[0] = f64::INFINITY)),
            ("F", good()),
        ],
        &["frame 1", "inf"],
    );
    bad(
        &[("V", whole()), ("F", faces(&[0, 1, 4]))],
        &["vertex 4", "only 4 vertices"],
    );
    bad(&[("V", whole()), ("F", faces(&[0, -1, 2]))], &["F", "-1"]);
    bad(&[("V", whole()), ("F", faces(&[0, 1 << 40, 2]))], &["F"]);
    bad(&[("V", frames(&[5, 12], |_| ())), ("F", good())], &["V"]);
    bad(
        &[("V", frames(&[0, 4, 3], |_| ())), ("F", good())],
        &["at least one frame"],
    );
    bad(
        &[("V", frames(&[5, 0, 3], |_| ())), ("F", faces(&[]))],
        &["vert"],
    );
    bad(&[("F", good())], &["V", "F"]);
    bad(&[("V", whole())], &["F"]);
    bad(&[("V", good()), ("F", whole())], &["array F"]);
}
