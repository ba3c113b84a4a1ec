//! Files that are no representation.

use std::fs;

use meshseq::arrays::{Array, Bundle};
use meshseq::signal::file::load;

use super::common::{Scratch, must};
use super::{bundle, changed, good, refused};

struct Bad {
    scratch: Scratch,
    good: Bundle,
}

impl Bad {
    fn new() -> Self {
        let scratch = good();
        let good = bundle(&scratch.at("rep.npz"));
        Self { scratch, good }
    }

    /// A good representation with something changed is refused with these words.
    #[track_caller]
    fn with(&self, change: impl FnOnce(&mut Bundle), words: &[&str]) {
        changed(&self.good, change, &self.scratch.at("bad.npz"));
        self.refused("bad.npz", words);
    }

    #[track_caller]
    fn refused(&self, name: &str, words: &[&str]) {
        let words = [words, &[name]].concat();
        for out in ["out.npz", "out.pc2", "out"] {
            let arguments = [
                "signal",
                "sample",
                &self.scratch.arg(name),
                "-o",
                &self.scratch.arg(out),
            ];
            refused(self.scratch.path(), &arguments, &words);
        }
    }
}

fn numbers(bundle: &mut Bundle, name: &str, change: impl FnOnce(&mut Vec<usize>, &mut Vec<f64>)) {
    match bundle.0.get_mut(name) {
        Some(Array::F64 { shape, data }) => change(shape, data),
        other => panic!("{name}: {other:?}"),
    }
}

const FLOATS: [&str; 8] = ["h0", "H", "g", "sites", "control", "u", "t", "p"];

#[test]
fn arrays_that_are_missing_or_of_another_kind() {
    let bad = Bad::new();
    for name in FLOATS.into_iter().chain(["F", "meta"]) {
        let named = format!("`{name}`");
        let words = [&named, "expected", "signal fit"];
        bad.with(|b| drop(b.0.remove(name)), &words);
        bad.with(|b| b.put(name, Array::integer(3)), &words);
    }
    for name in FLOATS {
        bad.with(|b| b.put(name, Array::Text("none".into())), &[name]);
        bad.with(
            |b| {
                b.put(
                    name,
                    Array::F64 {
                        shape: vec![1; 4],
                        data: vec![0.0],
                    },
                )
            },
            &[name],
        );
    }
    bad.with(|b| b.put("F", Array::vector(&[0.0, 1.0, 2.0])), &["`F`"]);
}

#[test]
fn arrays_that_do_not_fit_together() {
    let bad = Bad::new();
    for name in FLOATS {
        let shorter = |shape: &mut Vec<usize>, data: &mut Vec<f64>| {
            shape[0] -= 1;
            data.truncate(shape.iter().product());
        };
        bad.with(|b| numbers(b, name, shorter), &[&format!("`{name}`")]);
        let none = |shape: &mut Vec<usize>, data: &mut Vec<f64>| {
            shape[0] = 0;
            data.clear();
        };
        bad.with(|b| numbers(b, name, none), &[]);
    }
    let all_times = |b: &mut Bundle, n: usize| {
        numbers(b, "t", |shape, data| (shape[0], *data) = (n, vec![0.0; n]));
        numbers(b, "p", |shape, data| {
            (shape[0], *data) = (n, vec![0.0; 2 * n])
        });
    };
    bad.with(|b| all_times(b, 0), &["no frames"]);
    bad.with(|b| numbers(b, "t", |_, t| t.reverse()), &["`t`", "falls"]);
    bad.with(|b| numbers(b, "u", |_, u| u.reverse()), &["`u`", "knots"]);
    bad.with(|b| numbers(b, "u", |_, u| u.fill(1.0)), &["`u`", "knots"]);
    // 35 numbers are no vertices.
    bad.with(
        |b| {
            numbers(b, "h0", |shape, data| {
                shape[0] = 35;
                data.truncate(35)
            });
            numbers(b, "H", |shape, data| {
                shape[1] = 35;
                data.truncate(35 * shape[0])
            });
        },
        &["vertices"],
    );
    bad.with(
        |b| {
            b.put(
                "F",
                Array::I64 {
                    shape: vec![1, 3],
                    data: vec![0, 1, 12],
                },
            )
        },
        &["vertex 12", "only 12"],
    );
    bad.with(
        |b| {
            b.put(
                "F",
                Array::I64 {
                    shape: vec![1, 3],
                    data: vec![0, 1, -2],
                },
            )
        },
        &["`F`"],
    );
}

#[test]
fn numbers_that_are_none() {
    let bad = Bad::new();
    for name in FLOATS {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            bad.with(
                |b| numbers(b, name, |_, data| data[1] = value),
                &["bad.npz"],
            );
        }
    }
    // Finite each, and too large together.
    bad.with(
        |b| {
            numbers(b, "h0", |_, data| data.fill(1.7e308));
            numbers(b, "g", |_, data| data.fill(1e300));
            numbers(b, "H", |_, data| data.fill(1e300));
        },
        &["bad.npz", "frame 1", "finite"],
    );
}

#[test]
fn files_of_another_kind() {
    let bad = Bad::new();
    bad.with(
        |b| b.put("meta", Array::Text("{}".into())),
        &["`meta`", "format", "meshseq signal 1"],
    );
    bad.with(
        |b| b.put("meta", Array::Text("meshseq".into())),
        &["`meta`", "format"],
    );
    let later = r#"{"format": "meshseq signal 2", "space": "vertex"}"#;
    bad.with(
        |b| b.put("meta", Array::Text(later.into())),
        &["meshseq signal 2", "meshseq signal 1"],
    );
    let unknown = r#"{"format": "meshseq signal 1", "space": "curvature"}"#;
    bad.with(
        |b| b.put("meta", Array::Text(unknown.into())),
        &["space", "curvature", "vertex"],
    );
    let gradient = r#"{"format": "meshseq signal 1", "space": "gradient"}"#;
    bad.with(
        |b| b.put("meta", Array::Text(gradient.into())),
        &["bad.npz", "`reference`", "expected it to be there"],
    );
    bad.refused("good.npz", &["expected", "signal fit"]);
    bad.refused("none.npz", &["no such file"]);
    fs::write(bad.scratch.at("text.npz"), "frame,x,y\n").unwrap();
    bad.refused("text.npz", &["not an NPZ file"]);
    let bytes = fs::read(bad.scratch.at("rep.npz")).unwrap();
    for length in [0, 1, bytes.len() / 2, bytes.len() - 1] {
        fs::write(bad.scratch.at("cut.npz"), &bytes[..length]).unwrap();
        bad.refused("cut.npz", &[]);
    }
}

#[test]
fn patches_that_are_none() {
    let mut bad = Bad::new();
    let fit = "--k 6 --l 5 --m 3 --space patch".split_whitespace();
    let (from, to) = (bad.scratch.arg("good.npz"), bad.scratch.arg("patch.npz"));
    let places = [from.as_str(), "-o", to.as_str()];
    let arguments: Vec<&str> = ["signal", "fit"]
        .into_iter()
        .chain(fit)
        .chain(places)
        .collect();
    must(&arguments);
    bad.good = bundle(&bad.scratch.at("patch.npz"));
    let labels = bad.good.integers("patches").unwrap().to_vec();
    let with = |change: fn(&mut Vec<i64>), words: &[&str]| {
        let mut labels = labels.clone();
        change(&mut labels);
        bad.with(|b| b.put("patches", Array::integers(&labels)), words);
    };
    bad.with(
        |b| drop(b.0.remove("patches")),
        &["`patches`", "expected it to be there"],
    );
    bad.with(
        |b| b.put("patches", Array::vector(&[0.0; 12])),
        &["`patches`", "an i64 array of rank 1"],
    );
    with(
        |p| {
            p.pop();
        },
        &["11 patch labels for 12 triangles"],
    );
    with(|p| p[3] = -1, &["triangle 3", "label -1"]);
    with(
        |p| p[3] = i64::MAX,
        &["triangle 3", "label 9223372036854775807"],
    );
    with(|p| p.fill(1), &["no triangle has the patch label 0"]);
    // Labels of another division: another number of pairs.
    with(
        |p| (0..).zip(p).for_each(|(i, p)| *p = i),
        &["representation", "numbers"],
    );
}

/// Whatever byte is damaged, loading says so: every byte that matters is under a checksum or compared.
#[test]
fn damage_is_never_a_panic() {
    let bad = Bad::new();
    let bytes = fs::read(bad.scratch.at("rep.npz")).unwrap();
    let path = bad.scratch.at("damaged.npz");
    let whole = load(&bad.scratch.at("rep.npz")).unwrap();
    for at in (0..bytes.len()).step_by(13) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x41;
        fs::write(&path, damaged).unwrap();
        if let Ok(loaded) = load(&path) {
            assert_eq!(loaded, whole, "byte {at}");
        }
    }
}
