//! A made-up record for the tests: what a run looks like, and what a hostile or broken one does.

use crate::exhibits::{Chart, Exhibit, Ground, Line, Panel, Picture, Style, Table as Sheet};
use crate::harness::record::{
    AccuracyRow, AgreementRow, EngineRow, FitFigures, Record, SampleRow, TimingRow, Verdict,
};

/// Stage, quantity, tolerance, reason and peers.
type Spec = (
    &'static str,
    &'static str,
    f64,
    &'static str,
    &'static [&'static str],
);

const STAGES: [Spec; 6] = [
    (
        "sequence.read",
        "vertex count",
        0.0,
        "a count is exact",
        &["trimesh", "pymeshlab", "tobj", "openmesh"],
    ),
    (
        "signal.h",
        "coordinates",
        1e-9,
        "relative to the norm of the data, up to the sign of a column",
        &["numpy", "sklearn", "r"],
    ),
    (
        "signal.mds",
        "stress",
        1e-6,
        "relative, both at a vanishing gradient",
        &["scipy", "sklearn"],
    ),
    (
        "signal.sites",
        "site order",
        0.0,
        "the gap of the argmax exceeds 1e-6, so the order is the same",
        &["numpy", "numpy-incremental"],
    ),
    (
        "signal.rho",
        "rho at 200 points",
        1e-12,
        "the same formula in the same order",
        &["scipy", "r"],
    ),
    (
        "signal",
        "relative RMS",
        1e-9,
        "the whole pipeline, relative to the diagonal",
        &["numpy"],
    ),
];
const DATASETS: [&str; 3] = ["@gallop-small", "@flag-small", "cow"];

/// A run with every verdict, every kind of row and every picture.
pub(super) fn record() -> Record {
    let mut record = Record {
        engines: engines(),
        figures: vec![gallop(), horse()],
        skipped: vec![
            "skipped: no data for signal/pipeline/samba: no folder samba in the data".into(),
        ],
        machine: "AMD EPYC, 2 cores, 24 GiB\nLinux 6.1\nrustc 1.95.0".into(),
        command: "meshseq measure --data data".into(),
        ..Record::default()
    };
    for (s, spec) in STAGES.iter().enumerate() {
        for (d, dataset) in DATASETS.iter().enumerate() {
            let engines = std::iter::once(&"rust").chain(spec.4);
            for (e, engine) in engines.enumerate() {
                add(&mut record, spec, dataset, engine, (s, d, e));
            }
        }
    }
    record
}

fn add(record: &mut Record, spec: &Spec, dataset: &str, engine: &str, seed: (usize, usize, usize)) {
    let (stage, quantity, tolerance, reason, _) = *spec;
    let (s, d, e) = seed;
    let case = format!(
        "{}/{}",
        stage.replace('.', "/"),
        dataset.trim_start_matches('@')
    );
    let verdict = match (engine, seed) {
        ("openmesh" | "r", _) => Verdict::Missing,
        ("sklearn", (2, 1, _)) => Verdict::Timeout,
        ("scipy", (4, 0, _)) => Verdict::Differ,
        ("numpy-incremental", (_, 2, _)) => Verdict::Error,
        ("tobj", (_, 2, _)) => Verdict::Unsupported,
        _ => Verdict::Agree,
    };
    let answered = matches!(verdict, Verdict::Agree | Verdict::Differ);
    let part = match verdict {
        Verdict::Differ => 12.4,
        _ => 10f64.powi(-(((s * 7 + d * 3 + e * 5) % 6) as i32)) * 0.43,
    };
    let value = part * tolerance;
    record.agreement.push(AgreementRow {
        case: case.clone(),
        stage: stage.into(),
        dataset: dataset.into(),
        engine: engine.into(),
        version: format!("{engine} 1.{e}.0"),
        verdict,
        quantity: answered.then(|| quantity.into()),
        value: answered.then_some(value),
        tolerance: answered.then_some(tolerance),
        reason: if answered {
            reason.into()
        } else {
            String::new()
        },
        message: message(verdict).into(),
    });
    if !answered {
        return;
    }
    for (quantity, value, tolerance) in [
        (quantity, value, Some(tolerance)),
        ("error (3)", 38.163 + 1e-12 * e as f64, Some(1e-10)),
        ("seconds per frame", 1e-3, None),
    ] {
        record.accuracy.push(AccuracyRow {
            case: case.clone(),
            stage: stage.into(),
            engine: engine.into(),
            quantity: quantity.into(),
            value,
            tolerance,
            verdict: if tolerance.is_some() {
                verdict
            } else {
                Verdict::Agree
            },
        });
    }
    if verdict == Verdict::Agree {
        time(record, &case, stage, engine, seed);
    }
}

fn message(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Agree => "",
        Verdict::Differ => "worst at point 17 of 200",
        Verdict::Error => {
            "Traceback (most recent call last):\n  File \"signal_sites.py\", line 61, in run\n    q, r = qr_insert(q, r, \
                           column)\nnumpy.linalg.LinAlgError: Matrix is singular\nthe process ended with code 1"
        }
        Verdict::Timeout => "no answer within 60 s; the process was ended",
        Verdict::Missing => {
            "not installed: apt-get install libopenmesh-dev r-base-core, then scripts/verify"
        }
        Verdict::Unsupported => {
            "tobj renumbers vertices, so it has no answer for faces in the file's order"
        }
    }
}

fn time(record: &mut Record, case: &str, stage: &str, engine: &str, seed: (usize, usize, usize)) {
    let (s, d, e) = seed;
    let ratio = if e == 0 { 1.0 } else { 3.7f64.powi(e as i32) };
    let rust = 2.1e-5 * 9f64.powi(d as i32) * (1.0 + s as f64);
    let median = rust * ratio;
    // As in a session: the paper's time stands with our own row alone.
    let paper = (case == "signal/h/cow" && engine == "rust").then_some(5.127);
    record.timing.push(TimingRow {
        case: case.into(),
        stage: stage.into(),
        engine: engine.into(),
        samples: 9,
        batch: 4,
        median_seconds: median,
        mad_seconds: median * 0.03,
        least_seconds: median * 0.94,
        ratio_to_rust: ratio,
        published_seconds: paper,
        published_source: paper.map_or(String::new(), |_| "Table 1, Figure 6".into()),
    });
    for round in 0..9 {
        record.samples.push(SampleRow {
            case: case.into(),
            engine: engine.into(),
            round,
            seconds: median * (0.94 + 0.02 * ((round * 7 + e) % 9) as f64),
        });
    }
}

fn engines() -> Vec<EngineRow> {
    let row = |engine: &str, stages: &str, descent: &str, version: &str, missing: &str| EngineRow {
        engine: engine.into(),
        stages: stages.into(),
        descent: descent.into(),
        version: version.into(),
        missing: missing.into(),
    };
    vec![
        row(
            "sklearn",
            "signal.h signal.mds",
            "PCA and SMACOF of its own",
            "scikit-learn 1.8.0",
            "",
        ),
        row(
            "numpy",
            "signal.h signal.sites signal",
            "LAPACK's dense SVD and QR",
            "numpy 2.4.0, OpenBLAS 0.3.30",
            "",
        ),
        row("rust", "all", "this crate", "meshseq 0.1.0", ""),
        row(
            "openmesh",
            "sequence.read",
            "a C++ library of another lineage",
            "",
            "no program oracles/cpp/build/openmesh; bring it with: apt-get install libopenmesh-dev && scripts/verify",
        ),
    ]
}

/// A loop that is run through twice, as the horse's.
fn horse() -> FitFigures {
    let n = 24;
    let point = |t: f64| {
        let angle = t * std::f64::consts::TAU / 12.0;
        let drift = 0.02 * t / 24.0;
        [
            1.6 * angle.cos() + 0.3 * (2.0 * angle).cos() + drift,
            0.9 * angle.sin() + drift,
        ]
    };
    let moved = |i: usize, [x, y]: [f64; 2]| {
        let turn = i as f64 * 2.4;
        [x + 0.05 * turn.cos(), y + 0.05 * turn.sin()]
    };
    let frame_points: Vec<_> = (0..n).map(|i| point(i as f64)).collect();
    FitFigures {
        case: "signal/pipeline/horse".into(),
        dataset: "horse".into(),
        space: "vertex".into(),
        d: 25293,
        k: 16,
        l: 12,
        m: 7,
        frames: n,
        positions: frame_points
            .iter()
            .enumerate()
            .map(|(i, &p)| moved(i, p))
            .collect(),
        curve: (0..=460).map(|i| point(f64::from(i) / 20.0)).collect(),
        control: (0..16)
            .map(|i| point(f64::from(i) * 23.0 / 15.0).map(|x| 1.12 * x))
            .collect(),
        frame_points,
        sites: vec![0, 6, 3, 9, 14, 20, 1, 11, 17, 8, 22, 5],
        frame_errors: (0..n)
            .map(|i| 0.008 + 0.004 * ((i * 5) as f64).sin())
            .collect(),
        singular_values: (0..n)
            .map(|i| {
                if i == 23 {
                    0.0
                } else {
                    60.0 * 0.62f64.powi(i as i32)
                }
            })
            .collect(),
        error_by_m: (0..n)
            .map(|m| (m, 0.1 * 0.6f64.powi(m as i32).max(0.08)))
            .collect(),
        error_by_l: (3..=n)
            .map(|l| (l, 0.0083 + 0.03 * 0.7f64.powi(l as i32)))
            .collect(),
        error_by_k: (4..=n + 2)
            .map(|k| (k, 0.0078 + 0.2 * 0.7f64.powi(k as i32)))
            .collect(),
        errors: [38.163, 44.868, 4.1230, 90.799],
    }
}

fn gallop() -> FitFigures {
    FitFigures {
        case: "signal/pipeline/gallop-small".into(),
        dataset: "@gallop-small".into(),
        d: 1200,
        ..horse()
    }
}

/// Words that would break a page that does not escape them.
pub(super) const HOSTILE: &str =
    "<script>alert('x')</script> & \"quoted\" | `tick` --> \u{0}\u{1b}[31m";

/// Every string hostile, every number NaN, infinite, negative or absent.
pub(super) fn broken() -> Record {
    let mut record = record();
    let bad = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        -1.0,
        0.0,
        1e300,
        5e-324,
    ];
    for (i, row) in record.agreement.iter_mut().enumerate() {
        let case = format!("{HOSTILE} {}", row.case);
        (row.case, row.engine) = (case, format!("{HOSTILE} {}", row.engine));
        (row.stage, row.reason) = (format!("{HOSTILE}{}", row.stage), HOSTILE.into());
        (row.message, row.version) = (HOSTILE.into(), HOSTILE.into());
        row.quantity = Some(HOSTILE.into());
        row.value = Some(bad[i % bad.len()]);
        row.tolerance = Some(bad[(i / 2) % bad.len()]);
    }
    for (i, row) in record.accuracy.iter_mut().enumerate() {
        (row.case, row.quantity) = (format!("{HOSTILE} {}", row.case), HOSTILE.into());
        (row.stage, row.engine) = (format!("{HOSTILE}{}", row.stage), HOSTILE.into());
        row.value = bad[i % bad.len()];
    }
    for (i, row) in record.timing.iter_mut().enumerate() {
        (row.case, row.stage) = (format!("{HOSTILE} {}", row.case), HOSTILE.into());
        (row.published_source, row.published_seconds) = (HOSTILE.into(), Some(bad[i % bad.len()]));
        row.median_seconds = bad[(i + 3) % bad.len()];
        row.mad_seconds = bad[(i + 1) % bad.len()];
        row.ratio_to_rust = bad[(i + 2) % bad.len()];
    }
    for (i, sample) in record.samples.iter_mut().enumerate() {
        sample.seconds = bad[i % bad.len()];
    }
    record.figures = figures(&bad);
    for row in &mut record.engines {
        (row.version, row.descent, row.stages) = (HOSTILE.into(), HOSTILE.into(), HOSTILE.into());
    }
    record.exhibits = vec![hostile_exhibit(&bad)];
    record.skipped = vec![HOSTILE.into(), String::new()];
    (record.machine, record.command) = (HOSTILE.into(), HOSTILE.into());
    record
}

/// Fits without data, with one point, with every point the same, and with numbers that cannot be drawn.
fn figures(bad: &[f64]) -> Vec<FitFigures> {
    let points: Vec<[f64; 2]> = bad
        .iter()
        .flat_map(|&x| bad.iter().map(move |&y| [x, y]))
        .collect();
    let pairs: Vec<(usize, f64)> = bad.iter().copied().enumerate().collect();
    let fit = |points: &[[f64; 2]], numbers: &[f64], pairs: &[(usize, f64)]| FitFigures {
        case: format!("{HOSTILE} {}", points.len()),
        dataset: HOSTILE.into(),
        positions: points.to_vec(),
        frame_points: points.to_vec(),
        curve: points.to_vec(),
        control: points.to_vec(),
        sites: vec![0, usize::MAX],
        frame_errors: numbers.to_vec(),
        singular_values: numbers.to_vec(),
        error_by_m: pairs.to_vec(),
        error_by_l: pairs.to_vec(),
        error_by_k: vec![(usize::MAX, 1.0), (0, 0.0)],
        frames: numbers.len(),
        errors: [f64::NAN; 4],
        ..horse()
    };
    let same = [[1.5, -2.0]; 9];
    vec![
        fit(&[], &[], &[]),
        fit(&[[0.0, 0.0]], &[0.0], &[(0, 0.0)]),
        fit(&same, &[1e-3; 9], &[(3, 1e-3); 9]),
        fit(&points, bad, &pairs),
    ]
}

/// Words and numbers that would break a page, in every kind of panel.
fn hostile_exhibit(bad: &[f64]) -> Exhibit {
    let points: Vec<[f64; 2]> = bad.iter().map(|&x| [x, -x]).collect();
    let line = |style| Line {
        name: HOSTILE.into(),
        style,
        points: points.clone(),
    };
    let ground = |across, low| Ground {
        corners: [[low; 2], [1.0; 2]],
        across,
        cells: format!("0123{HOSTILE}"),
        kinds: vec![HOSTILE.into(); 4],
    };
    let chart = |equal, logarithmic, ground, lines| {
        Panel::Chart(Chart {
            title: HOSTILE.into(),
            x_title: HOSTILE.into(),
            y_title: HOSTILE.into(),
            equal,
            logarithmic,
            ground,
            lines,
        })
    };
    let styles = [Style::Line, Style::Dashes, Style::Dots, Style::Squares];
    Exhibit {
        name: HOSTILE.into(),
        title: HOSTILE.into(),
        look: HOSTILE.into(),
        datasets: vec![HOSTILE.into()],
        panels: vec![
            Panel::Table(Sheet {
                caption: HOSTILE.into(),
                heads: vec![HOSTILE.into(); 3],
                rows: vec![vec![HOSTILE.into(); 2], Vec::new()],
            }),
            chart(true, false, None, styles.map(line).to_vec()),
            chart(false, true, None, styles.map(line).to_vec()),
            chart(true, true, None, Vec::new()),
            chart(true, false, Some(ground(1, 0.0)), styles.map(line).to_vec()),
            chart(false, true, Some(ground(0, 0.0)), styles.map(line).to_vec()),
            chart(
                true,
                false,
                Some(ground(1, f64::NAN)),
                styles.map(line).to_vec(),
            ),
            Panel::Picture(Picture {
                title: HOSTILE.into(),
                png: HOSTILE.into(),
                width: u32::MAX,
                height: 0,
            }),
        ],
    }
}
