//! Growth of the stages of Cashman & Hormann 2012 with n, V, k, l and m. For local work; `bench/METHODOLOGY.md` says what judges changes.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use faer::{Mat, MatRef};
use meshseq::sequence::dataset::DataFolders;
use meshseq::signal::Point;
use meshseq::signal::dissimilarities::Dissimilarities;
use meshseq::signal::f::Spline;
use meshseq::signal::fit::{FitOptions, fit};
use meshseq::signal::g::PoseSignal;
use meshseq::signal::h::shape_signal;
use meshseq::signal::knots::{KnotRule, knots};
use meshseq::signal::layout::Layout;
use meshseq::signal::mds::scale;
use meshseq::signal::parameters::centripetal;
use meshseq::signal::pins::{Pin, principal_start};
use meshseq::signal::refine::{RefineOptions, refine};
use meshseq::signal::repin::Scaling;
use meshseq::signal::sites::site_order;
use rayon::prelude::*;

/// Frames whose singular values fall off like those of captured motion: waves of rising frequency and falling size. d x n.
fn frames(d: usize, n: usize) -> Mat<f64> {
    let waves = 60.min(n);
    let shapes = Mat::from_fn(d, waves, |a, w| ((a * (2 * w + 3)) as f64 * 0.37).sin());
    let times = Mat::from_fn(waves, n, |w, i| {
        (i as f64 * (w + 1) as f64 * 0.11 + w as f64).cos() / (w + 1) as f64
    });
    shapes * times
}

/// Shape coordinates and pose-space positions of such frames.
fn poses(n: usize, m: usize) -> (Mat<f64>, Vec<Point>) {
    let shape = shape_signal(frames(900, n).as_ref(), m).unwrap();
    let x = shape.coordinates;
    let start = principal_start(x.as_ref(), &[]);
    let positions = scale(&Dissimilarities::new(x.as_ref()), &start, &[]);
    (x, positions)
}

fn h(c: &mut Criterion) {
    let mut group = c.benchmark_group("h");
    for n in [24, 100, 204, 500, 1000, 2000] {
        let z = frames(3000, n);
        group.bench_function(BenchmarkId::new("frames, V = 1000", n), |b| {
            b.iter(|| shape_signal(z.as_ref(), 40.min(n - 1)).unwrap());
        });
    }
    for vertices in [1_000, 10_000, 50_000, 200_000] {
        let z = frames(3 * vertices, 50);
        group.bench_function(BenchmarkId::new("vertices, n = 50", vertices), |b| {
            b.iter(|| shape_signal(z.as_ref(), 20).unwrap());
        });
    }
}

fn mds(c: &mut Criterion) {
    let mut group = c.benchmark_group("mds");
    for n in [24, 100, 204, 500, 1000, 2000] {
        let x = shape_signal(frames(900, n).as_ref(), 20.min(n - 1))
            .unwrap()
            .coordinates;
        let start = principal_start(x.as_ref(), &[]);
        group.bench_function(BenchmarkId::new("frames", n), |b| {
            b.iter(|| scale(&Dissimilarities::new(x.as_ref()), &start, &[]));
        });
    }
}

/// One pin is dragged back and forth by 2% of the layout, and the layout follows from where it was; how many steps that takes is said once.
fn repin(c: &mut Criterion) {
    let mut group = c.benchmark_group("repin");
    let made_up = [24, 100, 204, 500, 1000].map(|n| ("made up", poses(n, 20.min(n - 1)).0));
    let real = cow().map(|x| ("cow", x));
    for (name, x) in made_up.into_iter().chain(real) {
        let n = x.ncols();
        let delta = Dissimilarities::new(x.as_ref());
        let start = principal_start(x.as_ref(), &[]);
        let positions = scale(&delta, &start, &[]);
        let pins = [0, n / 3, 2 * n / 3].map(|frame| Pin {
            frame,
            position: positions[frame],
        });
        let mut scaling = Scaling::new(delta, &positions, &pins).unwrap();
        scaling.solve();
        let reach = positions
            .iter()
            .flatten()
            .fold(0.0f64, |r, x| r.max(x.abs()));
        let mut side = 0.02 * reach;
        let mut drag = || {
            let mut pin = pins[1];
            pin.position[0] += side;
            side = -side;
            scaling.move_pin(pin).unwrap();
            scaling.solve()
        };
        for _ in 0..2 {
            println!("repin, {name}, n = {n}: {:?}", drag());
        }
        group.bench_function(
            BenchmarkId::new(format!("a pin moves, {name}, frames"), n),
            |b| {
                b.iter(&mut drag);
            },
        );
    }
}

/// Shape coordinates of the cow (n = 204, m = 42, as in Table 1), where MESHSEQ_DATA has it.
fn cow() -> Option<Mat<f64>> {
    let sequence = DataFolders::new(None).sequence("cow").ok()?;
    let (d, n) = (sequence.dimension(), sequence.frame_count());
    let z = MatRef::from_column_major_slice(sequence.positions(), d, n);
    Some(shape_signal(z, 42).ok()?.coordinates)
}

fn sites_and_rbf(c: &mut Criterion) {
    let mut group = c.benchmark_group("g");
    for n in [24, 100, 204, 500, 1000] {
        let (x, p) = poses(n, 20.min(n - 1));
        let all = vec![true; n];
        group.bench_function(BenchmarkId::new("whole greedy order, frames", n), |b| {
            b.iter(|| site_order(&p, x.as_ref(), n, &all, &[]).unwrap());
        });
        let sites = site_order(&p, x.as_ref(), n * 7 / 10, &all, &[])
            .unwrap()
            .order;
        group.bench_function(
            BenchmarkId::new("one approximation with 0.7 n sites, frames", n),
            |b| {
                b.iter(|| PoseSignal::fit(&p, x.as_ref(), &sites).unwrap());
            },
        );
    }
    for m in [5, 20, 50] {
        let (x, p) = poses(204, m);
        let all = vec![true; 204];
        group.bench_function(BenchmarkId::new("whole greedy order, m", m), |b| {
            b.iter(|| site_order(&p, x.as_ref(), 204, &all, &[]).unwrap());
        });
    }
}

fn f(c: &mut Criterion) {
    let mut group = c.benchmark_group("f");
    for n in [24, 204, 2000] {
        let p: Vec<Point> = (0..n)
            .map(|i| [(i as f64 * 0.3).sin(), (i as f64 * 0.2).cos()])
            .collect();
        for (name, k) in [("0.75 n", n * 3 / 4), ("n + 2", n + 2)] {
            group.bench_function(BenchmarkId::new(format!("k = {name}, frames"), n), |b| {
                b.iter(|| {
                    let t = centripetal(&p);
                    let u = knots(&t, k, KnotRule::Symmetric).unwrap();
                    Spline::fit(&t, &p, &u).unwrap()
                });
            });
        }
    }
}

/// psi(t) beside reading H once with the same threads.
fn psi(c: &mut Criterion) {
    let mut group = c.benchmark_group("psi");
    for vertices in [2_904, 10_000, 50_000, 200_000] {
        let z = frames(3 * vertices, 48);
        let options = FitOptions::new(40, 30, 42);
        let r = fit(z.as_ref(), &options).unwrap().representation;
        let mut frame = vec![0.0; r.dimension()];
        group.bench_function(BenchmarkId::new("psi(t), vertices", vertices), |b| {
            b.iter(|| r.evaluate_into(black_box(17.3), &mut frame));
        });
        let numbers: Vec<f64> = r.basis.col_iter().flat_map(|c| c.iter().copied()).collect();
        group.bench_function(
            BenchmarkId::new("reading H once, vertices", vertices),
            |b| {
                b.iter(|| read(black_box(&numbers)));
            },
        );
    }
}

/// The sum of all numbers, in lanes so that memory and not the adder is the limit.
fn read(numbers: &[f64]) -> f64 {
    let piece = |numbers: &[f64]| {
        let mut lanes = [0.0; 32];
        for chunk in numbers.as_chunks::<32>().0 {
            for (lane, x) in lanes.iter_mut().zip(chunk) {
                *lane += x;
            }
        }
        lanes.iter().sum::<f64>()
    };
    numbers.par_chunks(1 << 16).map(piece).sum()
}

/// The whole reconstruction with the paper's layout, and with the one that chooses among several.
fn whole(c: &mut Criterion) {
    let mut group = c.benchmark_group("fit");
    for n in [24, 204, 1000] {
        let z = frames(3000, n);
        let z: MatRef<'_, f64> = z.as_ref();
        for layout in [Layout::Mds, Layout::default()] {
            let options = FitOptions {
                layout,
                ..FitOptions::new(n * 3 / 4, n * 7 / 10, 40.min(n / 3))
            };
            let name = format!("{layout}, V = 1000, frames");
            group.bench_function(BenchmarkId::new(name, n), |b| {
                b.iter(|| fit(z, &options).unwrap());
            });
        }
    }
}

/// Steps of a refinement: in n with V fixed, and in V with n fixed, which must not matter beyond the shape signal.
fn refinement(c: &mut Criterion) {
    let mut group = c.benchmark_group("refine");
    let five = RefineOptions {
        iterations: 5,
        tolerance: 0.0,
        ..RefineOptions::default()
    };
    for (n, vertices) in [(24, 1000), (100, 1000), (204, 1000), (204, 10_000)] {
        let z = frames(3 * vertices, n);
        let options = FitOptions::new(n * 3 / 4, n * 7 / 10, 40.min(n / 3));
        let staged = fit(z.as_ref(), &options).unwrap();
        let name = format!("five steps, V = {vertices}, frames");
        group.bench_function(BenchmarkId::new(name, n), |b| {
            b.iter(|| refine(z.as_ref(), staged.clone(), &five).unwrap());
        });
    }
}

fn quick() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
}

criterion_group! {
    name = benches;
    config = quick();
    targets = h, mds, repin, sites_and_rbf, f, psi, whole, refinement
}
criterion_main!(benches);
