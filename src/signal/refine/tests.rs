use faer::Mat;
use proptest::prelude::*;

use super::normal::Normal;
use super::projection::{Problem, Projection, Unknowns};
use super::rows::Rows;
use super::*;
use crate::signal::fit::{FitOptions, fit};
use crate::signal::knots::{KnotRule, knots};

/// Frames along a wavy path, d numbers each.
fn frames(d: usize, n: usize) -> Mat<f64> {
    Mat::from_fn(d, n, |a, i| {
        let t = i as f64 * 0.5;
        ((a % 7 + 1) as f64 * 0.2 * t).sin() + (t + a as f64).cos() + 0.05 * a as f64
    })
}

fn options(k: usize, l: usize, m: usize) -> FitOptions {
    FitOptions::new(k, l, m)
}

fn measured(frames: &Mat<f64>, fit: &Fit) -> f64 {
    let times: Vec<f64> = (1..=frames.ncols()).map(|i| i as f64).collect();
    let values = fit.representation.evaluate(&times);
    let rebuilt = MatRef::from_column_major_slice(&values, frames.nrows(), frames.ncols());
    (frames - rebuilt).squared_norm_l2()
}

/// A curve of 7 control points, 6 sites and rows that the curve does not pass.
fn sample() -> (Rows, Vec<f64>, Unknowns) {
    let t: Vec<f64> = (0..14).map(f64::from).collect();
    let u = knots(&t, 7, KnotRule::Symmetric).unwrap();
    let rows = Rows::of_frames(frames(5, 14).as_ref(), &t, 0.3);
    let point = |i: usize, s: f64| [(s * i as f64).cos(), (0.9 * s * i as f64 + 0.4).sin()];
    let unknowns = Unknowns {
        control: (0..7).map(|j| point(j, 0.8)).collect(),
        sites: (0..6).map(|j| point(j, 1.3)).collect(),
    };
    (rows, u, unknowns)
}

/// The unknown number i in the order of [`Normal`].
fn entry(unknowns: &mut Unknowns, i: usize) -> &mut f64 {
    let (k, l) = (unknowns.control.len(), unknowns.sites.len());
    match i {
        _ if i < 2 * k => &mut unknowns.control[i % k][i / k],
        _ => &mut unknowns.sites[(i - 2 * k) % l][(i - 2 * k) / l],
    }
}

fn error_at(problem: &Problem, unknowns: &Unknowns, moves: &[(usize, f64)]) -> f64 {
    let mut moved = unknowns.clone();
    for &(i, h) in moves {
        *entry(&mut moved, i) += h;
    }
    Projection::new(problem, &moved).unwrap().error
}

#[test]
fn the_gradient_is_that_of_the_error() {
    let (rows, u, unknowns) = sample();
    for m in [1, 3, 5] {
        let problem = Problem::new(&rows, &u, m);
        let projection = Projection::new(&problem, &unknowns).unwrap();
        let normal = Normal::new(&problem, &unknowns, &projection);
        let h = 1e-6;
        for i in 0..26 {
            let rise = error_at(&problem, &unknowns, &[(i, h)])
                - error_at(&problem, &unknowns, &[(i, -h)]);
            let expected = -rise / (4.0 * h);
            let found = normal.descent[(i, 0)];
            assert!(
                (found - expected).abs() < 1e-6 * (1.0 + expected.abs()),
                "{m} {i}: {found} {expected}"
            );
        }
    }
}

/// Where nothing is left, Gauss and Newton's matrix is half of the second derivatives.
#[test]
fn the_matrix_is_the_curvature_where_the_rows_are_met() {
    let (mut rows, u, unknowns) = sample();
    let weights: Vec<f64> = rows.weights.clone();
    let problem = Problem::new(&rows, &u, 3);
    let projection = Projection::new(&problem, &unknowns).unwrap();
    let model = projection.design.matrix(&projection.curve)
        * projection.coefficients()
        * projection.basis().transpose();
    rows.targets = model;
    rows.weights = weights;
    let problem = Problem::new(&rows, &u, 3);
    let projection = Projection::new(&problem, &unknowns).unwrap();
    assert!(projection.error < 1e-20);
    let normal = Normal::new(&problem, &unknowns, &projection);
    let h = 1e-4;
    for i in 0..26 {
        for j in 0..i {
            let at = |a: f64, b: f64| error_at(&problem, &unknowns, &[(i, a), (j, b)]);
            let mixed = (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (8.0 * h * h);
            let found = normal.matrix[(i, j)];
            assert!(
                (found - mixed).abs() < 1e-4 * normal.matrix[(i, i)].max(normal.matrix[(j, j)]),
                "{i} {j}: {found} {mixed}"
            );
        }
    }
}

#[test]
fn g_and_h_are_the_best_for_their_curve_and_sites() {
    let (rows, u, unknowns) = sample();
    let spline = Spline {
        control: unknowns.control.clone(),
        knots: u,
    };
    let none = RefineOptions {
        iterations: 0,
        ..RefineOptions::default()
    };
    let found = minimise(&rows, &spline, &unknowns.sites, 2, &none).unwrap();
    let signals = &found.signals;
    assert!((signals.error(&rows) - found.error).abs() < 1e-12 * found.error);
    // No coefficient and no direction of the basis can be moved for the better.
    for a in 0..2 {
        // Coefficients of kernels could only be moved together, under their side conditions.
        for (j, row) in [(0, 0), (7, 3)] {
            for h in [-1e-4, 1e-4] {
                let mut other = signals.clone();
                other.pose.coefficients[(a, j)] += h;
                other.basis[(row, a)] += 0.3 * h;
                assert!(other.error(&rows) > found.error);
            }
        }
    }
}

/// Rows that some curve and sites meet exactly, and a start that is a little off.
#[test]
fn a_descent_comes_down_to_what_meets_every_row() {
    let (mut rows, u, unknowns) = sample();
    let problem = Problem::new(&rows, &u, 3);
    let projection = Projection::new(&problem, &unknowns).unwrap();
    rows.targets = projection.design.matrix(&projection.curve)
        * projection.coefficients()
        * projection.basis().transpose();
    let mut start = unknowns.clone();
    (0..26).for_each(|i| *entry(&mut start, i) += 0.005 * (3.1 * i as f64).sin());
    let spline = Spline {
        control: start.control,
        knots: u,
    };
    let after = |iterations| {
        let options = RefineOptions {
            iterations,
            tolerance: 1e-14,
            ..RefineOptions::default()
        };
        minimise(&rows, &spline, &start.sites, 3, &options).unwrap()
    };
    let (before, found) = (after(0).error, after(500));
    assert!(found.error < 1e-12 * before, "{before} {found:?}");
}

/// The least error over the control points is flat there, and no site moves.
#[test]
fn a_descent_with_sites_held_ends_where_the_error_is_flat() {
    let (rows, u, unknowns) = sample();
    for m in [1, 3, 5] {
        let spline = Spline {
            control: unknowns.control.clone(),
            knots: u.clone(),
        };
        let held = RefineOptions {
            iterations: 2000,
            tolerance: 1e-14,
            hold_sites: true,
            ..RefineOptions::default()
        };
        let found = minimise(&rows, &spline, &unknowns.sites, m, &held).unwrap();
        assert_eq!(found.signals.pose.sites, unknowns.sites);
        // The gradient is -2 J^T r: beside |r| and the size of what J is made of. Rounding in |r|^2 hides smaller ones.
        let data = rows.targets.squared_norm_l2();
        let flat = found.gradient * (found.error / data).sqrt();
        assert!(
            flat < 1e-6 && found.iterations < 2000,
            "{m}: {flat} {found:?}"
        );
        let start = minimise(
            &rows,
            &spline,
            &unknowns.sites,
            m,
            &RefineOptions {
                iterations: 0,
                ..held
            },
        );
        assert!(found.error < start.unwrap().error);
        assert!((found.signals.error(&rows) - found.error).abs() < 1e-11 * found.error);
    }
}

#[test]
fn a_refined_fit_is_what_its_errors_say() {
    let z = frames(30, 24);
    for (k, l, m) in [(10, 8, 3), (14, 12, 6), (4, 3, 2), (20, 5, 1), (26, 24, 23)] {
        let staged = fit(z.as_ref(), &options(k, l, m)).unwrap();
        let before = staged.errors.psi;
        let (refined, told) = refine(z.as_ref(), staged, &RefineOptions::default()).unwrap();
        assert!(told.before == before && told.after <= before);
        let found = measured(&z, &refined);
        assert!(
            (found - refined.errors.psi).abs() < 1e-10 * z.squared_norm_l2(),
            "{k} {l} {m}"
        );
        assert!((refined.errors.psi - told.after).abs() < 1e-10 * z.squared_norm_l2());
        let basis = &refined.representation.basis;
        let gram = basis.transpose() * basis;
        assert!((gram - Mat::<f64>::identity(basis.ncols(), basis.ncols())).norm_max() < 1e-9);
    }
}

#[test]
fn what_cannot_be_refined_comes_back() {
    let line = Mat::from_fn(30, 9, |a, i| a as f64 + i as f64);
    let still = Mat::from_fn(30, 9, |a, _| a as f64);
    for z in [line, still] {
        let staged = fit(z.as_ref(), &options(5, 4, 2)).unwrap();
        let (refined, told) =
            refine(z.as_ref(), staged.clone(), &RefineOptions::default()).unwrap();
        assert!(refined.errors.psi <= staged.errors.psi && told.after <= told.before);
    }
    let (rows, u, unknowns) = sample();
    let spline = Spline {
        control: unknowns.control,
        knots: u,
    };
    let default = RefineOptions::default();
    assert!(minimise(&rows, &spline, &[[0.0, 0.0]; 6], 2, &default).is_none());
    assert!(minimise(&rows, &spline, &unknowns.sites[..2], 2, &default).is_none());
    let mut twice = unknowns.sites.clone();
    twice[0] = twice[1];
    assert!(minimise(&rows, &spline, &twice, 2, &default).is_none());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// The pose plane has no scale and no place of its own.
    #[test]
    fn equivariant_under_similarity(s in 1e-2f64..1e2, cx in -5.0f64..5.0, turn in 0.0f64..6.0) {
        let (rows, u, unknowns) = sample();
        let moved = |points: &[Point]| points.iter().map(|q| [
            s * (turn.cos() * q[0] - turn.sin() * q[1] + cx),
            s * (turn.sin() * q[0] + turn.cos() * q[1]),
        ]).collect::<Vec<Point>>();
        let few = RefineOptions { iterations: 4, ..RefineOptions::default() };
        let spline = Spline { control: unknowns.control.clone(), knots: u.clone() };
        let a = minimise(&rows, &spline, &unknowns.sites, 3, &few).unwrap();
        let other = Spline { control: moved(&unknowns.control), knots: u };
        let b = minimise(&rows, &other, &moved(&unknowns.sites), 3, &few).unwrap();
        // Damping follows the axes, so the paths differ a little; neither may stop short of where the other gets.
        prop_assert!((a.error - b.error).abs() < 0.05 * a.error, "{} {}", a.error, b.error);
        prop_assert!((b.signals.error(&rows) - b.error).abs() < 1e-9 * b.error);
    }
}
