//! The same input gives the same bytes, whatever the number of threads and however often it is asked.

mod common;

use std::fs;
use std::path::Path;

use common::{Scratch, contents, must, sheet};
use faer::MatRef;
use meshseq::sequence::Sequence;
use meshseq::sequence::dataset::open;
use meshseq::sequence::format::write;
use meshseq::shape::SpaceKind;
use meshseq::signal::fidelity::fit_to_error;
use meshseq::signal::file::{Stored, load, save};
use meshseq::signal::fit::{Fit, FitOptions, fit};
use meshseq::signal::knots::KnotRule;
use meshseq::signal::layout::Layout;
use meshseq::signal::pins::Pin;

const THREADS: [&str; 4] = ["1", "2", "3", "7"];

/// Asserts that these arguments, with the last as the output, write the same bytes with any number of threads.
fn same_bytes(name: &str, arguments: impl Fn(&str) -> Vec<String>) {
    let mut first = None;
    for threads in THREADS {
        let scratch = Scratch::new();
        let mut all = arguments(&scratch.arg(name));
        all.extend(["--threads".into(), threads.into()]);
        let said = must(&all);
        let found: Vec<_> = contents(scratch.path())
            .into_iter()
            .map(|(path, bytes)| (path.strip_prefix(scratch.path()).unwrap().to_owned(), bytes))
            .collect();
        assert!(!found.is_empty());
        let first = first.get_or_insert_with(|| found.clone());
        assert!(
            *first == found,
            "{name}: {threads} threads write other bytes; {said}"
        );
    }
}

fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(String::from).collect()
}

#[test]
fn self_intersections_do_not_depend_on_threads() {
    for sequence in ["@klein-small", "@trot-small"] {
        same_bytes("quality.csv", |out| {
            words(&format!("info {sequence} --quality {out}"))
        });
    }
}

#[test]
fn fits_do_not_depend_on_threads() {
    for choice in [
        "@gallop-small --k 16 --l 12 --m 7",
        "@jelly-small --k 20 --l 15 --m 9 --knots symmetric",
        "@jelly-small --tolerance 0.01",
        "@gallop-small --frames 1..20 --every 2 --k 12 --l 10 --m 9",
        "@jelly-small --k 20 --l 15 --m 9 --space patch",
        "@roam-small:90 --k 20 --l 15 --m 9 --window 40 --overlap 9",
        "@roam-small:90 --tolerance 0.01 --window 40",
        "@roam-small --k 14 --l 10 --m 6 --window 25 --space patch",
    ] {
        same_bytes("rep.npz", |out| {
            words(&format!("signal fit {choice} -o {out}"))
        });
    }
}

#[test]
fn refined_fits_do_not_depend_on_threads() {
    for choice in [
        "@gallop-small --k 16 --l 12 --m 7 --refine",
        "@jelly-small --tolerance 0.02 --refine",
        "@gallop-small --k 14 --l 10 --m 6 --space gradient --refine --between 0",
        "@roam-small --k 14 --l 10 --m 6 --window 25 --refine",
    ] {
        same_bytes("rep.npz", |out| {
            words(&format!("signal fit {choice} -o {out}"))
        });
    }
}

/// Encoding and decoding, with factors and sums of their own, in every space.
#[test]
fn fits_and_samples_in_every_space_do_not_depend_on_threads() {
    for space in ["gradient", "lric", "lengths"] {
        let fit = format!("signal fit @gallop-small --k 14 --l 10 --m 6 --space {space}");
        same_bytes("rep.npz", |out| words(&format!("{fit} -o {out}")));
        let scratch = Scratch::new();
        let rep = scratch.arg("rep.npz");
        must(&words(&format!("{fit} -o {rep}")));
        same_bytes("frames.npz", |out| {
            words(&format!("signal sample {rep} --frames 31 -o {out}"))
        });
    }
}

#[test]
fn transfers_do_not_depend_on_threads() {
    let scratch = Scratch::new();
    let rep = scratch.arg("rep.npz");
    must(&words(&format!(
        "signal fit @gallop-small --k 16 --l 12 --m 7 --space gradient -o {rep}"
    )));
    let examples = "--examples @gallop-small @gallop-small --example-frames 1..8";
    for choice in [
        format!("@gallop-small {examples}"),
        format!("@gallop-small {examples} --k 16 --l 12 --space gradient"),
        format!("{rep} {examples}"),
    ] {
        same_bytes("moved.npz", |out| {
            let told = out.replace("moved.npz", "told");
            words(&format!(
                "signal transfer {choice} -o {out} --rep {told}.npz --json {told}.json"
            ))
        });
    }
}

#[test]
fn edits_and_designs_do_not_depend_on_threads() {
    let scratch = Scratch::new();
    let [rep, edits, poses, curve] =
        ["rep.npz", "edits.toml", "poses.csv", "curve.csv"].map(|name| scratch.arg(name));
    must(&words(&format!(
        "signal fit @gallop-small --k 16 --l 12 --m 7 -o {rep}"
    )));
    let all = "[[edit]]\ndo = \"repeat\"\nframes = \"1..12\"\njoin = 3\n\
               [[edit]]\ndo = \"delete\"\nframes = \"3..5\"\njoin = 2\n\
               [[edit]]\ndo = \"reverse\"\nframes = \"6..9\"\njoin = 1\n\
               [[edit]]\ndo = \"move\"\ncontrol = 5\nby = [0.2, -0.1]\n";
    fs::write(&edits, all).unwrap();
    same_bytes("edited.npz", |out| {
        words(&format!(
            "signal edit {rep} {edits} -o {out} --json {out}.json"
        ))
    });
    fs::write(&poses, "frame,x,y\n1,0,0\n4,2,0\n7,2,2\n10,0,2\n").unwrap();
    fs::write(&curve, "x,y\n0,0\n1,-0.3\n2,0\n2.2,1\n2,2\n0,2\n").unwrap();
    for space in ["vertex", "gradient"] {
        same_bytes("designed.npz", |out| {
            words(&format!(
                "signal design {poses} {curve} @gallop-small --closed --space {space} -o {out} --rep {out}.rep.npz --json {out}.json"
            ))
        });
    }
}

#[test]
fn predictions_do_not_depend_on_threads() {
    for choice in ["", "--refine", "--space gradient --layout ordered"] {
        same_bytes("told.json", |out| {
            words(&format!(
                "signal leave-out @gallop-small {choice} --json {out}"
            ))
        });
    }
}

/// Long enough for the parallel ways of every stage.
#[test]
fn long_fits_do_not_depend_on_threads() {
    let scratch = Scratch::new();
    write(&sheet(150, 24, 20), &scratch.at("long.npz")).unwrap();
    let input = scratch.arg("long.npz");
    for choice in [
        "--k 90 --l 60 --m 20",
        "--k 152 --l 150 --m 40",
        "--tolerance 0.003",
    ] {
        same_bytes("rep.npz", |out| {
            words(&format!("signal fit {input} {choice} -o {out}"))
        });
    }
}

#[test]
fn conversions_and_samples_do_not_depend_on_threads() {
    let scratch = Scratch::new();
    let [rep, windows] = ["rep.npz", "windows.npz"].map(|name| scratch.arg(name));
    let fit = "signal fit @gallop-small --k 14 --l 12 --m 7 -o";
    must(&words(&format!("{fit} {rep}")));
    // Windows of 13 frames.
    must(&words(&format!("{fit} {windows} --window 18")));
    for name in ["a.npz", "a.pc2", "frames"] {
        same_bytes(name, |out| words(&format!("convert @jelly-small {out}")));
        for rep in [&rep, &windows] {
            same_bytes(name, |out| {
                words(&format!("signal sample {rep} --frames 61 -o {out}"))
            });
        }
    }
    same_bytes("info.json", |out| {
        words(&format!("info @jelly-small --json {out}"))
    });
}

fn small(name: &str) -> Sequence {
    open(name).unwrap()
}

fn fitted(sequence: &Sequence, k: usize, l: usize, m: usize) -> Fit {
    let frames = MatRef::from_column_major_slice(
        sequence.positions(),
        sequence.dimension(),
        sequence.frame_count(),
    );
    let pins = vec![Pin {
        frame: 2,
        position: [0.1, -0.2],
    }];
    let options = FitOptions {
        k,
        l,
        m,
        knots: KnotRule::Symmetric,
        layout: Layout::Ordered { weight: None },
        pins,
    };
    fit(frames, &options).unwrap()
}

/// Equal to the last bit: signed zeros count.
fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

fn all_bits(stored: &Stored) -> Vec<Vec<u64>> {
    let r = &stored.representation;
    let columns = |m: &faer::Mat<f64>| -> Vec<f64> {
        m.col_iter()
            .flat_map(|c| c.iter().copied().collect::<Vec<_>>())
            .collect()
    };
    vec![
        bits(&r.offset),
        bits(&columns(&r.basis)),
        bits(&columns(&r.pose.coefficients)),
        bits(r.pose.sites.as_flattened()),
        bits(r.time.spline.control.as_flattened()),
        bits(&r.time.spline.knots),
        bits(&r.time.parameters),
        bits(stored.positions.as_flattened()),
    ]
}

fn saved(stored: &Stored, path: &Path) -> (Vec<u8>, Stored) {
    save(stored, path).unwrap();
    (fs::read(path).unwrap(), load(path).unwrap())
}

#[test]
fn representations_load_back_bit_for_bit() {
    let scratch = Scratch::new();
    let gallop = small("@gallop-small");
    let n = gallop.frame_count();
    let times: Vec<f64> = (0..200)
        .map(|i| 1.0 + i as f64 * (n - 1) as f64 / 199.0)
        .collect();
    for (k, l, m) in [(16, 12, 7), (4, 3, 0), (n + 2, n, n - 1)] {
        let fit = fitted(&gallop, k, l, m);
        let stored = Stored {
            representation: fit.representation,
            positions: fit.positions,
            connectivity: gallop.connectivity().clone(),
            space: SpaceKind::Vertex,
            reference: Vec::new(),
            patches: Vec::new(),
        };
        let (bytes, loaded) = saved(&stored, &scratch.at("a.npz"));
        assert_eq!(all_bits(&stored), all_bits(&loaded));
        assert_eq!(stored.connectivity, loaded.connectivity);
        assert_eq!(bytes, saved(&loaded, &scratch.at("b.npz")).0);
        let (before, after) = (
            stored.representation.evaluate(&times),
            loaded.representation.evaluate(&times),
        );
        assert_eq!(bits(&before), bits(&after));
        // One frame at a time, in any order, is the same as all at once.
        let d = gallop.dimension();
        let mut frame = vec![0.0; d];
        for (i, &t) in times.iter().enumerate().rev() {
            loaded.representation.evaluate_into(t, &mut frame);
            assert_eq!(bits(&frame), bits(&before[i * d..(i + 1) * d]), "psi({t})");
        }
    }
}

#[test]
fn the_library_gives_the_same_bits_in_any_pool() {
    let jelly = small("@jelly-small");
    let frames =
        MatRef::from_column_major_slice(jelly.positions(), jelly.dimension(), jelly.frame_count());
    let times: Vec<f64> = (0..77).map(|i| 1.0 + i as f64 * 0.3).collect();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let fixed = fitted(&jelly, 20, 15, 9);
            let free = fit_to_error(
                frames,
                1e-3 * frames.squared_norm_l2(),
                KnotRule::Literal,
                Layout::Ordered { weight: None },
                &[],
            )
            .unwrap();
            let errors = |fit: &Fit| [fit.errors.h, fit.errors.g, fit.errors.f, fit.errors.psi];
            let all = [&fixed, &free].map(|fit| {
                let psi = fit.representation.evaluate(&times);
                [
                    bits(&psi),
                    bits(&errors(fit)),
                    bits(&fit.singular_values),
                    bits(&fit.sites.errors),
                ]
            });
            (all, fixed.sites.order, free.klm())
        })
    };
    let one = run(1);
    assert!(run(2) == one && run(5) == one && run(1) == one);
}
