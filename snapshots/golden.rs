//! Golden sequences: what is generated, as a numeric digest that a reviewer can read, compared by tolerance.
//!
//! The digests lie beside this file as `NAME.snap`. After a change that is meant, accept the new ones with
//! `INSTA_UPDATE=always cargo test --release --test golden` and review the difference in git.

mod digest;

use faer::MatRef;
use insta::{Settings, assert_snapshot};
use meshseq::sequence::Sequence;
use meshseq::sequence::dataset::open;
use meshseq::signal::fidelity::fit_to_error;
use meshseq::signal::fit::{Fit, FitOptions, fit};
use meshseq::signal::knots::KnotRule;
use meshseq::signal::layout::Layout;

use digest::{Close, Digest};

/// Compares a digest with the one on record under this name.
fn golden(name: &str, digest: Digest) {
    let mut settings = Settings::clone_current();
    settings.set_snapshot_path(".");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.set_comparator(Box::new(Close));
    settings.bind(|| assert_snapshot!(name, digest.text()));
}

fn frames(sequence: &Sequence) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(
        sequence.positions(),
        sequence.dimension(),
        sequence.frame_count(),
    )
}

fn fitted(sequence: &Sequence, [k, l, m]: [usize; 3], knots: KnotRule) -> Fit {
    let pins = Vec::new();
    let options = FitOptions {
        k,
        l,
        m,
        knots,
        layout: Layout::Mds,
        pins,
    };
    fit(frames(sequence), &options).unwrap()
}

/// The fit's constants, sites and errors, and psi at these frame times.
fn fit_digest(sequence: &Sequence, fit: &Fit, times: &[f64]) -> Digest {
    let mut digest = Digest::default();
    let (k, l, m) = fit.klm();
    digest.counts(&[
        ("n", sequence.frame_count()),
        ("d", sequence.dimension()),
        ("k", k),
        ("l", l),
        ("m", m),
    ]);
    digest.list("sites", fit.sites.order.iter().map(|i| i + 1));
    let data = frames(sequence).squared_norm_l2();
    let e = fit.errors;
    for (name, error) in [
        ("error_h", e.h),
        ("error_g", e.g),
        ("error_f", e.f),
        ("error_psi", e.psi),
    ] {
        digest.number(name, error, data);
    }
    let sampled = fit.representation.evaluate(times);
    let sampled = Sequence::new(sequence.connectivity().clone(), times.len(), sampled).unwrap();
    digest.frames(&sampled, times);
    digest
}

/// Frame times a third and two thirds of the way between every fourth pair of frames.
fn between(n: usize) -> Vec<f64> {
    (1..n)
        .step_by(4)
        .flat_map(|i| [i as f64 + 1.0 / 3.0, i as f64 + 2.0 / 3.0])
        .collect()
}

fn every_third(n: usize) -> Vec<f64> {
    (1..=n).step_by(3).map(|i| i as f64).collect()
}

#[test]
fn embedded_sequences() {
    for name in [
        "@gallop-small",
        "@roll-small",
        "@bar-small",
        "@book-small",
        "@klein-small",
        "@character-small",
        "@trot-small",
        "@trot-poses-small",
        "@face-small",
        "@loop-small",
    ] {
        let sequence = open(name).unwrap();
        let n = sequence.frame_count();
        let mut digest = Digest::default();
        digest.counts(&[
            ("n", n),
            ("V", sequence.connectivity().vertex_count()),
            ("F", sequence.connectivity().faces().len()),
        ]);
        let times = every_third(n);
        let chosen: Vec<usize> = times.iter().map(|&t| t as usize - 1).collect();
        digest.frames(&sequence.select(&chosen).unwrap(), &times);
        golden(&format!("embedded-{}", &name[1..]), digest);
    }
}

#[test]
fn a_gallop_as_in_figure_1() {
    let gallop = open("@gallop-small").unwrap();
    let fit = fitted(&gallop, [16, 12, 7], KnotRule::Literal);
    golden(
        "gallop-16-12-7",
        fit_digest(&gallop, &fit, &every_third(gallop.frame_count())),
    );
}

#[test]
fn a_gallop_resampled_between_its_frames() {
    let gallop = open("@gallop-small").unwrap();
    let fit = fitted(&gallop, [20, 16, 10], KnotRule::Symmetric);
    golden(
        "gallop-resampled",
        fit_digest(&gallop, &fit, &between(gallop.frame_count())),
    );
}

#[test]
fn a_gallop_to_a_tolerance() {
    let gallop = open("@gallop-small").unwrap();
    for (name, share) in [("coarse", 1e-2), ("fine", 1e-4)] {
        let spread = fitted(&gallop, [4, 3, 0], KnotRule::Literal).errors.psi;
        let fit = fit_to_error(
            frames(&gallop),
            share * spread,
            KnotRule::Literal,
            Layout::Mds,
            &[],
        )
        .unwrap();
        assert!(fit.errors.psi <= share * spread);
        let times = every_third(gallop.frame_count());
        golden(&format!("gallop-{name}"), fit_digest(&gallop, &fit, &times));
    }
}

#[test]
fn a_roll_and_its_interpolation() {
    let roll = open("@roll-small").unwrap();
    let n = roll.frame_count();
    let fit = fitted(&roll, [12, 10, 6], KnotRule::Literal);
    golden("roll-12-10-6", fit_digest(&roll, &fit, &between(n)));
    // The roll has 12 dimensions above rounding.
    let whole = fitted(&roll, [n + 2, n, 12], KnotRule::Literal);
    golden(
        "roll-interpolated",
        fit_digest(&roll, &whole, &every_third(n)),
    );
}
