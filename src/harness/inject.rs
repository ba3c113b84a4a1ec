//! Fault injection: the Rust engine, wrong on purpose. A check that lets a fault through cannot fail where it should.

use crate::arrays::{Array, Bundle};

use super::engine::{Engine, Outcome, Question, Rust};

/// A way to be wrong.
pub struct Fault {
    pub name: &'static str,
    /// The stage that goes wrong.
    pub stage: &'static str,
    /// What is wrong.
    pub about: &'static str,
    alter: Alter,
}

enum Alter {
    /// The stage is given other inputs than the judge.
    Inputs(fn(&mut Bundle)),
    /// Its outputs are changed; the inputs are there to read.
    Outputs(fn(&Bundle, &mut Bundle)),
}

use Alter::{Inputs, Outputs};

const SLIGHT: f64 = 1e-6;

macro_rules! faults {
    ($($name:literal in $stage:literal: $about:literal, $alter:expr;)*) => {
        /// Every fault.
        pub static FAULTS: &[Fault] = &[$(Fault { name: $name, stage: $stage, about: $about, alter: $alter },)*];
    };
}

faults! {
    "read-missing-vertex" in "sequence.read": "one vertex fewer in the last frame",
        Outputs(|_, out| integers(out, "counts", |c| { let at = c.len() - 3; c[at] -= 1; }));
    "read-inside-out" in "sequence.read": "the sign of the volume",
        Outputs(|_, out| numbers(out, "measures", |m| m[1] = -m[1]));
    "read-wrong-frame" in "sequence.read": "the first two frames swapped",
        Outputs(|_, out| numbers(out, "measures", |m| swap_rows(m, 8, 0, 1)));
    "distance-relative" in "sequence.distance": "distances a millionth too long",
        Outputs(|_, out| numbers(out, "hausdorff", stretch));
    "distance-squared" in "sequence.distance": "mean of squared distances",
        Outputs(|_, out| numbers(out, "mean", |m| m.iter_mut().for_each(|x| *x *= *x)));
    "quality-relative" in "mesh.quality": "areas a millionth too large",
        Outputs(|_, out| numbers(out, "area", stretch));
    "quality-inside-out" in "mesh.quality": "the sign of the volumes",
        Outputs(|_, out| numbers(out, "volume", |v| v.iter_mut().for_each(|x| *x = -*x)));
    "quality-pair" in "mesh.quality": "one pair more in the last frame",
        Outputs(|_, out| integers(out, "intersections", |p| { let at = p.len() - 1; p[at] += 1; }));
    "quality-face" in "mesh.quality": "one triangle fewer in the frame where most meet",
        Outputs(|_, out| integers(out, "intersecting_faces", |f| if let Some(most) = f.iter_mut().max() { *most -= 1; }));
    "quality-wrong-frame" in "mesh.quality": "the first frame in place of the second",
        Inputs(|inputs| {
            let d = inputs.f64("frames", 3).map_or(0, |(shape, _)| 3 * shape[1]);
            numbers(inputs, "frames", |x| x.copy_within(..d, d));
        });
    "gradient-transposed" in "shape.gradient_encode": "rotations the other way round",
        Outputs(|inputs, out| each_triangle(inputs, out, |numbers| numbers[..3].iter_mut().for_each(|x| *x = -*x)));
    "gradient-relative" in "shape.gradient_encode": "stretches a millionth too large",
        Outputs(|inputs, out| each_triangle(inputs, out, |numbers| stretch(&mut numbers[3..])));
    "gradient-off-diagonal" in "shape.gradient_encode": "off-diagonal stretches without their square root of 2",
        Outputs(|inputs, out| each_triangle(inputs, out, |numbers| numbers[6..].iter_mut().for_each(|x| *x /= 2f64.sqrt())));
    "gradient-centre-dropped" in "shape.gradient_encode": "the centre of the last frame left at the origin",
        Outputs(|_, out| numbers(out, "z", |z| { let n = z.len(); z[n - 3..].fill(0.0) }));
    "poisson-weights" in "shape.gradient_decode": "the vertices a millionth too far out",
        Outputs(|_, out| numbers(out, "frames", stretch));
    "poisson-triangle-dropped" in "shape.gradient_decode": "the first triangle of the last frame as in the reference",
        Inputs(|inputs| last_frame(inputs, |z| z[..9].copy_from_slice(&[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])));
    "poisson-wrong-frame" in "shape.gradient_decode": "the first two frames swapped",
        Inputs(|inputs| { let d = row_length(inputs, "z"); numbers(inputs, "z", |z| swap_rows(z, d, 0, 1)) });
    "lric-relative" in "shape.lric_encode": "every number a millionth too large",
        Outputs(|_, out| numbers(out, "z", stretch));
    "lric-inside-out" in "shape.lric_encode": "the surface bent the other way: the sign of every angle",
        Outputs(|inputs, out| {
            let edges = crate::mesh::topology::Topology::new(&inputs.triangles("F").unwrap_or_default()).fans().count();
            let d = row_length(out, "z");
            numbers(out, "z", |z| z.chunks_mut(d).for_each(|row| row[..3 * edges].chunks_mut(3).for_each(|e| e[2] = -e[2])));
        });
    "lric-turn-dropped" in "shape.lric_encode": "components without their rotation",
        Outputs(|_, out| { let d = row_length(out, "z"); numbers(out, "z", |z| z.chunks_mut(d).for_each(|row| row[d - 6..d - 3].fill(0.0))) });
    "lric-bent" in "shape.lric_decode": "the edges of the last frame bent a millionth more",
        Inputs(|inputs| last_frame(inputs, |z| { let edges = z.len() / 3 - 2; z[..3 * edges].chunks_mut(3).for_each(|e| e[2] *= 1.0 + SLIGHT) }));
    "lric-wrong-frame" in "shape.lric_decode": "the first two frames swapped",
        Inputs(|inputs| { let d = row_length(inputs, "z"); numbers(inputs, "z", |z| swap_rows(z, d, 0, 1)) });
    "lric-frames" in "shape.lric_decode": "the vertices a millionth too far out",
        Outputs(|_, out| numbers(out, "frames", stretch));
    "lengths-relative" in "shape.lengths_encode": "every number a millionth too large",
        Outputs(|_, out| numbers(out, "z", stretch));
    "lengths-inside-out" in "shape.lengths_encode": "the surface bent the other way: the sign of every angle",
        Outputs(|inputs, out| {
            let edges = crate::mesh::topology::Topology::new(&inputs.triangles("F").unwrap_or_default()).fans().count();
            let d = row_length(out, "z");
            numbers(out, "z", |z| z.chunks_mut(d).for_each(|row| row[..2 * edges].chunks_mut(2).for_each(|e| e[1] = -e[1])));
        });
    "lengths-turn-dropped" in "shape.lengths_encode": "components without their rotation",
        Outputs(|_, out| { let d = row_length(out, "z"); numbers(out, "z", |z| z.chunks_mut(d).for_each(|row| row[d - 6..d - 3].fill(0.0))) });
    "lengths-bent" in "shape.lengths_decode": "the edges of the last frame bent a millionth more",
        Inputs(|inputs| last_frame(inputs, |z| { let edges = z.len() / 2 - 3; z[..2 * edges].chunks_mut(2).for_each(|e| e[1] *= 1.0 + SLIGHT) }));
    "lengths-wrong-frame" in "shape.lengths_decode": "the first two frames swapped",
        Inputs(|inputs| { let d = row_length(inputs, "z"); numbers(inputs, "z", |z| swap_rows(z, d, 0, 1)) });
    "lengths-frames" in "shape.lengths_decode": "the vertices a millionth too far out",
        Outputs(|_, out| numbers(out, "frames", stretch));
    "poisson-entry" in "shape.poisson_factor": "the last entry of the matrix twice",
        Inputs(|inputs| numbers(inputs, "values", |v| { let at = v.len() - 1; v[at] *= 2.0 }));
    "poisson-relative" in "shape.poisson_solve": "solutions a millionth too large",
        Outputs(|_, out| numbers(out, "x", stretch));
    "halfway-straight" in "shape.halfway": "the mean of positions",
        Outputs(|inputs, out| {
            let end = inputs.f64("end", 2).map(|(_, end)| end.to_vec()).unwrap_or_default();
            copy(inputs, "start", out, "frame");
            numbers(out, "frame", |x| x.iter_mut().zip(end).for_each(|(x, end)| *x = 0.5 * (*x + end)));
        });
    "patch-relative" in "shape.patch_encode": "stretches a millionth too large",
        Outputs(|inputs, out| each_triangle(inputs, out, |numbers| stretch(&mut numbers[3..])));
    "patch-backwards" in "shape.patch_encode": "rotations of adjacent patches the other way round",
        Outputs(|inputs, out| each_pair(inputs, out, "z", |z| z.iter_mut().for_each(|x| *x = -*x)));
    "patch-boundary" in "shape.patch_encode": "a triangle counted to the patch beside it",
        Inputs(|inputs| {
            let labels = inputs.integers("patches").unwrap_or_default().to_vec();
            let faces = inputs.triangles("F").unwrap_or_default();
            let pair = crate::mesh::topology::Topology::new(&faces).pairs().map(|p| [p.first, p.second].map(|h| h.triangle as usize))
                .find(|&[f, g]| labels[f] != labels[g]);
            if let Some([f, g]) = pair { integers(inputs, "patches", |p| p[f] = p[g]); }
        });
    "patch-turn-dropped" in "shape.patch_encode": "components without their rotation",
        Outputs(|_, out| { let d = row_length(out, "z"); numbers(out, "z", |z| z.chunks_mut(d).for_each(|row| row[d - 6..d - 3].fill(0.0))) });
    "patch-bent" in "shape.patch_decode": "adjacent patches turned a millionth more against each other",
        Inputs(|inputs| { let given = inputs.clone(); each_pair(&given, inputs, "z", stretch) });
    "patch-wrong-frame" in "shape.patch_decode": "the first two frames swapped",
        Inputs(|inputs| { let d = row_length(inputs, "z"); numbers(inputs, "z", |z| swap_rows(z, d, 0, 1)) });
    "patch-frames" in "shape.patch_decode": "the vertices a millionth too far out",
        Outputs(|_, out| numbers(out, "frames", stretch));
    "h-sign" in "signal.h": "first direction and its coordinates negated",
        Outputs(|inputs, out| {
            let d = row_length(inputs, "Z");
            numbers(out, "H", |h| h[..d].iter_mut().for_each(|x| *x = -*x));
            negate_column(out, "X", 0);
        });
    "h-swapped" in "signal.h": "first two coordinates of each frame swapped",
        Outputs(|_, out| {
            let m = row_length(out, "X");
            numbers(out, "X", |x| x.chunks_mut(m).for_each(|row| row.swap(0, 1)));
        });
    "h-relative" in "signal.h": "coordinates a millionth too long",
        Outputs(|_, out| numbers(out, "X", stretch));
    "h-offset" in "signal.h": "the first frame in place of the mean",
        Outputs(|inputs, out| {
            let d = row_length(inputs, "Z");
            let first = inputs.f64("Z", 2).map(|(_, z)| z[..d].to_vec()).unwrap_or_default();
            numbers(out, "h0", |h0| h0.copy_from_slice(&first));
        });
    "h-dimension-dropped" in "signal.h": "one dimension fewer than asked",
        Inputs(|inputs| integers(inputs, "m", |m| m[0] -= 1));
    "mds-unfinished" in "signal.mds": "the start returned as it is",
        Outputs(|inputs, out| copy(inputs, "start", out, "P"));
    "mds-relative" in "signal.mds": "the layout a millionth too large",
        Outputs(|_, out| numbers(out, "P", stretch));
    "mds-swapped" in "signal.mds": "two frames swapped",
        Outputs(|_, out| numbers(out, "P", |p| swap_rows(p, 2, 1, 2)));
    "mds-dimension-dropped" in "signal.mds": "dissimilarities without the last shape coordinate",
        Inputs(|inputs| zero_last_column(inputs, "X"));
    "pins-constraint-dropped" in "signal.mds_fixed": "the last pin forgotten",
        Inputs(|inputs| {
            shorten(inputs, "fixed", 1);
            shorten(inputs, "positions", 2);
        });
    "pins-moved" in "signal.mds_fixed": "pins a millionth off",
        Outputs(|_, out| numbers(out, "P", stretch));
    "pins-unfinished" in "signal.mds_fixed": "the start returned as it is",
        Outputs(|inputs, out| copy(inputs, "start", out, "P"));
    "layout-order-forgotten" in "signal.layout": "distances along the motion left out",
        Inputs(|inputs| numbers(inputs, "weight", |w| w[0] = 0.0));
    "layout-swapped" in "signal.layout": "two frames swapped",
        Outputs(|_, out| numbers(out, "P", |p| swap_rows(p, 2, 1, 2)));
    "layout-relative" in "signal.layout": "the layout a millionth too large",
        Outputs(|_, out| numbers(out, "P", stretch));
    "layout-step" in "signal.layout": "dissimilarities a millionth too large",
        Outputs(|_, out| numbers(out, "delta", stretch));
    "rbf-side-condition-dropped" in "signal.rbf": "one coefficient a millionth too large",
        Outputs(|_, out| { let m = row_length(out, "g"); numbers(out, "g", |g| stretch(&mut g[m..2 * m])) });
    "rbf-swapped" in "signal.rbf": "coefficients of the first two sites swapped",
        Outputs(|_, out| { let m = row_length(out, "g"); numbers(out, "g", |g| swap_rows(g, m, 1, 2)) });
    "rbf-affine-dropped" in "signal.rbf": "without the affine part G",
        Outputs(|_, out| {
            let m = row_length(out, "g");
            numbers(out, "g", |g| { let at = g.len() - 2 * m; g[at..].fill(0.0) });
        });
    "rbf-frame-dropped" in "signal.rbf": "the last frame left out of the least squares",
        Inputs(|inputs| {
            let m = row_length(inputs, "X");
            numbers(inputs, "X", |x| { let n = x.len() / m; x.copy_within((n - 2) * m..(n - 1) * m, (n - 1) * m) });
        });
    "sites-swapped" in "signal.sites": "fifth and sixth site swapped",
        Outputs(|_, out| integers(out, "order", |o| o.swap(4, 5)));
    "sites-start" in "signal.sites": "first and fourth site swapped",
        Outputs(|_, out| integers(out, "order", |o| o.swap(0, 3)));
    "sites-off-by-one" in "signal.sites": "indices counted from 1",
        Outputs(|_, out| integers(out, "order", |o| { let n = o.len() as i64; o.iter_mut().for_each(|i| *i = (*i + 1) % n) }));
    "sites-errors" in "signal.sites": "errors a millionth too large",
        Outputs(|_, out| numbers(out, "errors", stretch));
    "parameters-chordal" in "signal.parameters": "distances in place of their square roots",
        Outputs(|_, out| numbers(out, "t", |t| {
            let steps: Vec<f64> = t.windows(2).map(|w| (w[1] - w[0]).powi(2)).collect();
            for (i, step) in steps.iter().enumerate() { t[i + 1] = t[i] + step; }
        }));
    "parameters-relative" in "signal.parameters": "parameters a millionth too large",
        Outputs(|_, out| numbers(out, "t", stretch));
    "parameters-start" in "signal.parameters": "the first parameter is not 0",
        Outputs(|_, out| numbers(out, "t", |t| t.iter_mut().for_each(|x| *x += SLIGHT)));
    "knots-other-rule" in "signal.knots": "the other averaging rule",
        Inputs(other_rule);
    "knots-relative" in "signal.knots": "an interior knot a millionth off",
        Outputs(|_, out| numbers(out, "u", |u| u[3] *= 1.0 + SLIGHT));
    "knots-unclamped" in "signal.knots": "an end knot not repeated",
        Outputs(|_, out| numbers(out, "u", |u| { let n = u.len(); u[n - 3] = 0.5 * (u[n - 4] + u[n - 1]) }));
    "spline-swapped" in "signal.spline": "two control points swapped",
        Outputs(|_, out| numbers(out, "control", |c| swap_rows(c, 2, 1, 2)));
    "spline-relative" in "signal.spline": "values a millionth off",
        Outputs(|_, out| numbers(out, "values", stretch));
    "spline-constraint" in "signal.spline": "the first frame interpolated",
        Outputs(|inputs, out| {
            let first = inputs.points("P").map(|p| p[0]).unwrap_or_default();
            numbers(out, "control", |c| c[..2].copy_from_slice(&first));
            numbers(out, "values", |v| v[..2].copy_from_slice(&first));
        });
    "spline-frame-dropped" in "signal.spline": "the last frame left out of the least squares",
        Inputs(|inputs| numbers(inputs, "P", |p| { let n = p.len(); p.copy_within(n - 4..n - 2, n - 2) }));
    "rho-shifted" in "signal.rho": "values a millionth off",
        Outputs(|_, out| numbers(out, "values", stretch));
    "rho-end-slope" in "signal.rho": "a flat start",
        Outputs(|_, out| numbers(out, "slopes", |s| s[0] = 0.0));
    "psi-linear-rho" in "signal.psi": "parameters evenly spaced",
        Inputs(|inputs| numbers(inputs, "t", |t| {
            let (n, last) = (t.len() as f64 - 1.0, t[t.len() - 1]);
            t.iter_mut().enumerate().for_each(|(i, t)| *t = last * i as f64 / n);
        }));
    "psi-offset" in "signal.psi": "the offset h_0 a millionth too large",
        Inputs(|inputs| numbers(inputs, "h0", stretch));
    "psi-axes" in "signal.psi": "x and y of each vertex swapped",
        Outputs(|_, out| numbers(out, "Z", |z| z.chunks_mut(3).for_each(|v| v.swap(0, 1))));
    "psi-affine-dropped" in "signal.psi": "without the affine part of g",
        Inputs(|inputs| {
            let m = row_length(inputs, "g");
            numbers(inputs, "g", |g| { let at = g.len() - 2 * m; g[at..].fill(0.0) });
        });
    "insert-unblended" in "signal.insert_knots": "a control point of the old curve in place of a blended one",
        Outputs(|inputs, out| {
            let old = inputs.points("control").map(|c| c[1]).unwrap_or_default();
            numbers(out, "control", |c| c[2..4].copy_from_slice(&old));
        });
    "insert-dropped" in "signal.insert_knots": "the last new knot left out",
        Inputs(|inputs| shorten(inputs, "insert", 1));
    "insert-curve" in "signal.insert_knots": "control points of the curve moved a millionth",
        Inputs(|inputs| numbers(inputs, "control", stretch));
    "insert-off-by-one" in "signal.insert_knots": "the first two control points swapped",
        Outputs(|_, out| numbers(out, "control", |c| swap_rows(c, 2, 0, 1)));
    "transfer-relative" in "signal.transfer": "coordinates a millionth too long",
        Outputs(|_, out| numbers(out, "X", stretch));
    "transfer-wrong-example" in "signal.transfer": "the second and third example of the target swapped",
        Inputs(|inputs| { let d = row_length(inputs, "R"); numbers(inputs, "R", |r| swap_rows(r, d, 1, 2)) });
    "transfer-other-reference" in "signal.transfer": "the second example in place of the reference pose",
        Inputs(|inputs| { let d = row_length(inputs, "Q"); numbers(inputs, "Q", |q| q.copy_within(d..2 * d, 0)) });
    "transfer-example-dropped" in "signal.transfer": "the last example left out",
        Inputs(|inputs| { let (d, e) = (row_length(inputs, "Q"), row_length(inputs, "R")); shorten(inputs, "Q", d); shorten(inputs, "R", e) });
    "transfer-frames" in "signal.transfer": "frames a millionth too large",
        Outputs(|_, out| numbers(out, "W", stretch));
    "refine-unfinished" in "signal.refine": "the best g and h for the start's curve, which stays",
        Inputs(|inputs| integers(inputs, "iterations", |steps| steps[0] = 0));
    "refine-staged" in "signal.refine": "a site a thousandth off, g and h as they were",
        Outputs(|_, out| numbers(out, "sites", |s| s[0] *= 1.001));
    "refine-weights" in "signal.refine": "frames between frames weighted as frames",
        Inputs(|inputs| numbers(inputs, "w", |w| w.fill(1.0)));
    "refine-claim" in "signal.refine": "the error claimed a millionth too small",
        Outputs(|_, out| numbers(out, "error", |e| e[0] *= 1.0 - SLIGHT));
    "refine-dimension-dropped" in "signal.refine": "the last shape coordinate of g at 0",
        Outputs(|_, out| zero_last_column(out, "g"));
    "signal-other-knots" in "signal": "the other averaging rule",
        Inputs(other_rule);
    "signal-site-dropped" in "signal": "one site fewer",
        Inputs(|inputs| integers(inputs, "l", |l| l[0] -= 1));
    "signal-claim" in "signal": "error (2) claimed a millionth too small",
        Outputs(|_, out| numbers(out, "errors", |e| e[3] *= 1.0 - SLIGHT));
    "signal-frames" in "signal": "two frames swapped",
        Outputs(|_, out| { let d = row_length(out, "Z"); numbers(out, "Z", |z| swap_rows(z, d, 1, 2)) });
}

fn numbers(bundle: &mut Bundle, name: &str, change: impl FnOnce(&mut [f64])) {
    if let Some(Array::F64 { data, .. }) = bundle.0.get_mut(name) {
        change(data);
    }
}

fn integers(bundle: &mut Bundle, name: &str, change: impl FnOnce(&mut [i64])) {
    if let Some(Array::I64 { data, .. }) = bundle.0.get_mut(name) {
        change(data);
    }
}

/// The nine numbers of every triangle of every frame of a gradient encoding.
fn each_triangle(inputs: &Bundle, out: &mut Bundle, change: impl Fn(&mut [f64])) {
    let triangles = inputs.triangles("F").map_or(0, |faces| faces.len());
    let d = row_length(out, "z");
    numbers(out, "z", |z| {
        let rows = z.chunks_mut(d);
        rows.for_each(|row| row[..9 * triangles].chunks_mut(9).for_each(&change));
    });
}

/// The rotation vectors of adjacent patches in every row of a one-component encoding.
fn each_pair(inputs: &Bundle, bundle: &mut Bundle, name: &str, change: impl Fn(&mut [f64])) {
    let triangles = inputs.triangles("F").map_or(0, |faces| faces.len());
    let d = row_length(bundle, name);
    numbers(bundle, name, |z| {
        z.chunks_mut(d)
            .for_each(|row| change(&mut row[9 * triangles..d - 6]));
    });
}

/// The vector, among those to decode, of the last frame that is known.
fn last_frame(inputs: &mut Bundle, change: impl FnOnce(&mut [f64])) {
    let (d, n) = (
        row_length(inputs, "z"),
        inputs.f64("truth", 3).map_or(1, |(shape, _)| shape[0]),
    );
    numbers(inputs, "z", |z| change(&mut z[(n - 1) * d..n * d]));
}

/// Drops the last row of an array.
fn shorten(bundle: &mut Bundle, name: &str, width: usize) {
    match bundle.0.get_mut(name) {
        Some(Array::F64 { shape, data }) => {
            shape[0] -= 1;
            data.truncate(shape[0] * width);
        }
        Some(Array::I64 { shape, data }) => {
            shape[0] -= 1;
            data.truncate(shape[0] * width);
        }
        _ => {}
    }
}

fn row_length(bundle: &Bundle, name: &str) -> usize {
    bundle.f64(name, 2).map_or(1, |(shape, _)| shape[1])
}

fn stretch(data: &mut [f64]) {
    data.iter_mut().for_each(|x| *x *= 1.0 + SLIGHT);
}

fn swap_rows(data: &mut [f64], width: usize, a: usize, b: usize) {
    for axis in 0..width {
        data.swap(a * width + axis, b * width + axis);
    }
}

fn negate_column(bundle: &mut Bundle, name: &str, column: usize) {
    let width = row_length(bundle, name);
    numbers(bundle, name, |x| {
        x.chunks_mut(width)
            .for_each(|row| row[column] = -row[column])
    });
}

fn zero_last_column(bundle: &mut Bundle, name: &str) {
    let width = row_length(bundle, name);
    numbers(bundle, name, |x| {
        x.chunks_mut(width).for_each(|row| row[width - 1] = 0.0)
    });
}

fn copy(from: &Bundle, name: &str, to: &mut Bundle, target: &str) {
    if let Ok(array) = from.get(name) {
        to.put(target, array.clone());
    }
}

fn other_rule(inputs: &mut Bundle) {
    let other = if inputs.text("rule") == Ok("literal") {
        "symmetric"
    } else {
        "literal"
    };
    inputs.put("rule", Array::Text(other.into()));
}

/// The fault of this name.
pub fn find(name: &str) -> Option<&'static Fault> {
    FAULTS.iter().find(|fault| fault.name == name)
}

/// The Rust engine with one fault; other stages are as they should be.
pub struct Faulty(pub &'static Fault);

impl Engine for Faulty {
    fn name(&self) -> &str {
        Rust.name()
    }

    fn stages(&self) -> Vec<String> {
        Rust.stages()
    }

    fn descent(&self) -> &str {
        "this crate, with a fault"
    }

    fn version(&mut self) -> Result<String, Outcome> {
        Ok(format!(
            "{}, wrong on purpose: {}",
            Rust.version()?,
            self.0.about
        ))
    }

    fn ask(&mut self, question: &Question) -> Outcome {
        if question.stage.name != self.0.stage {
            return Rust.ask(question);
        }
        match self.0.alter {
            Inputs(change) => {
                let mut inputs = question.inputs.clone();
                change(&mut inputs);
                Rust.ask(&Question {
                    inputs: &inputs,
                    ..*question
                })
            }
            Outputs(change) => match Rust.ask(question) {
                Outcome::Answer {
                    mut outputs,
                    seconds,
                } => {
                    change(question.inputs, &mut outputs);
                    Outcome::Answer { outputs, seconds }
                }
                other => other,
            },
        }
    }
}
