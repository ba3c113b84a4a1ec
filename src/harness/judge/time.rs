//! The time signal: parameters, knots, spline and rho, each by its definition.

use faer::Mat;

use super::{Measured, diagonal, error_gap, greatest, shaped, share, square};
use crate::arrays::{ArrayError, Bundle};
use crate::linalg::dense::thin_svd;

pub fn parameters_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let p = inputs.points("P")?;
    let t = shaped(outputs, "t", &[p.len()])?;
    let steps = p
        .windows(2)
        .map(|w| (w[0][0] - w[1][0]).hypot(w[0][1] - w[1][1]));
    let missed = t
        .windows(2)
        .zip(steps)
        .map(|(w, step)| ((w[1] - w[0]).powi(2) - step).abs());
    Ok(vec![
        ("first", t.first().map_or(0.0, |t| t.abs())),
        (
            "steps",
            share(missed.fold(0.0, f64::max), diagonal(p.as_flattened(), 2)),
        ),
    ])
}

pub fn parameters_against(
    _: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (ours.vector("t")?, theirs.vector("t")?);
    Ok(vec![(
        "t_difference",
        share(greatest(a, b), a.last().copied().unwrap_or(0.0)),
    )])
}

pub fn knots_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let t = inputs.vector("t")?;
    let (n, k) = (t.len(), inputs.integer("k")?);
    let u = shaped(outputs, "u", &[k + 2])?;
    let length = t[n - 1] - t[0];
    let ends = u[..3].iter().map(|u| (u - t[0]).abs());
    let ends = ends.chain(u[k - 1..].iter().map(|u| (u - t[n - 1]).abs()));
    let falling = u.windows(2).map(|w| w[0] - w[1]).fold(0.0, f64::max);
    let symmetric = inputs.text("rule")? == "symmetric";
    Ok(vec![
        ("ends", share(ends.fold(0.0, f64::max), length)),
        ("falling", share(falling, length)),
        ("averages", share(averages(t, u, k, symmetric), length)),
    ])
}

/// The greatest distance of an interior knot from the average that reading 2 asks for.
fn averages(t: &[f64], u: &[f64], k: usize, symmetric: bool) -> f64 {
    let expected = interior(t, k, symmetric);
    greatest(&u[3..k - 1], &expected)
}

/// The k - 4 interior knots of reading 2, by the piecewise linear function t(x), 1-based.
fn interior(t: &[f64], k: usize, symmetric: bool) -> Vec<f64> {
    let n = t.len();
    let along = |x: f64| {
        let i = (x.floor() as usize).clamp(1, n - 1);
        let a = x - i as f64;
        (1.0 - a) * t[i - 1] + a * t[i]
    };
    (1..k - 3)
        .map(|j| {
            let x = match (k == n + 2, symmetric) {
                (true, _) => (j + 1) as f64,
                (false, false) => j as f64 * n as f64 / (k - 3) as f64,
                (false, true) => 1.0 + j as f64 * (n - 1) as f64 / (k - 3) as f64,
            };
            along(x)
        })
        .collect()
}

/// A step shorter than this share of the layout's diameter is a held pose.
const HELD: f64 = 1e-9;

/// The least (7) that k control points and this rule leave at these positions (readings 1, 2, 3 and 8). None where the SVD fails.
pub fn least_error_f(p: &[[f64; 2]], k: usize, symmetric: bool) -> Option<f64> {
    let t = frame_parameters(p);
    let mut distinct = t.clone();
    distinct.dedup();
    let (n, k) = (distinct.len(), k.min(distinct.len() + 2));
    let mut full = vec![distinct[0]; 4];
    full.extend(interior(&distinct, k, symmetric));
    full.extend([distinct[n - 1]; 4]);
    let functions = Mat::from_fn(t.len(), k, |i, j| basis(&full, j, 3, t[i]));
    let svd = thin_svd(functions.as_ref()).ok()?;
    let points = Mat::from_fn(p.len(), 2, |i, axis| p[i][axis]);
    let rank = svd.s.iter().take_while(|&&s| s > 1e-11 * svd.s[0]).count();
    let range = svd.u.get(.., ..rank);
    Some((&points - range * (range.transpose() * &points)).squared_norm_l2())
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Centripetal parameters in which held poses repeat; the frames' numbers where nothing moves.
fn frame_parameters(p: &[[f64; 2]]) -> Vec<f64> {
    let diameter = p
        .iter()
        .flat_map(|&a| p.iter().map(move |&b| distance(a, b)))
        .fold(0.0, f64::max);
    let mut t = vec![0.0];
    let mut held = p[0];
    for &next in &p[1..] {
        let step = distance(held, next);
        let moved = step > HELD * diameter;
        t.push(t[t.len() - 1] + if moved { step.sqrt() } else { 0.0 });
        if moved {
            held = next;
        }
    }
    if t[t.len() - 1] > 0.0 {
        return t;
    }
    (0..p.len()).map(|i| i as f64).collect()
}

pub fn knots_against(
    _: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (ours.vector("u")?, theirs.vector("u")?);
    Ok(vec![(
        "u_difference",
        share(greatest(a, b), a.last().copied().unwrap_or(0.0)),
    )])
}

/// B_j(u) for j = 0..k by the recursion of Cox & de Boor, in its definition's form: slow and plain. `full` are the k + 4 knots.
pub fn basis(full: &[f64], j: usize, degree: usize, u: f64) -> f64 {
    if degree == 0 {
        let last = full[full.len() - 1];
        let closes = u == last && full[j] < last && full[j + 1] == last;
        return if (full[j] <= u && u < full[j + 1]) || closes {
            1.0
        } else {
            0.0
        };
    }
    let part = |from: usize, weight: f64, of: f64| {
        if of > 0.0 {
            weight / of * basis(full, from, degree - 1, u)
        } else {
            0.0
        }
    };
    part(j, u - full[j], full[j + degree] - full[j])
        + part(
            j + 1,
            full[j + degree + 1] - u,
            full[j + degree + 1] - full[j + 1],
        )
}

/// One more copy of each end knot.
pub fn full(u: &[f64]) -> Vec<f64> {
    let ends = (u.first().copied(), u.last().copied());
    ends.0
        .into_iter()
        .chain(u.iter().copied())
        .chain(ends.1)
        .collect()
}

/// f~(u) by the definition.
pub fn curve(u: &[f64], control: &[[f64; 2]], at: f64) -> [f64; 2] {
    let full = full(u);
    let mut point = [0.0; 2];
    for (j, c) in control.iter().enumerate() {
        let b = basis(&full, j, 3, at);
        point[0] += b * c[0];
        point[1] += b * c[1];
    }
    point
}

struct Spline<'a> {
    t: &'a [f64],
    u: &'a [f64],
    p: Vec<[f64; 2]>,
    control: Vec<[f64; 2]>,
    values: Vec<[f64; 2]>,
    size: f64,
}

fn spline<'a>(inputs: &'a Bundle, outputs: &Bundle) -> Result<Spline<'a>, ArrayError> {
    let (t, u, p) = (
        inputs.vector("t")?,
        inputs.vector("u")?,
        inputs.points("P")?,
    );
    shaped(outputs, "control", &[u.len() - 2, 2])?;
    shaped(outputs, "values", &[t.len(), 2])?;
    shaped(outputs, "query_values", &[inputs.vector("query")?.len(), 2])?;
    Ok(Spline {
        size: diagonal(p.as_flattened(), 2),
        control: outputs.points("control")?,
        values: outputs.points("values")?,
        t,
        u,
        p,
    })
}

fn error_f(s: &Spline) -> f64 {
    let left: Vec<f64> = s
        .values
        .as_flattened()
        .iter()
        .zip(s.p.as_flattened())
        .map(|(a, b)| a - b)
        .collect();
    square(&left)
}

pub fn spline_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let s = spline(inputs, outputs)?;
    let formula =
        s.t.iter()
            .zip(&s.values)
            .map(|(&t, v)| greatest(&curve(s.u, &s.control, t), v));
    Ok(vec![
        ("error_f", error_f(&s)),
        ("formula", share(formula.fold(0.0, f64::max), s.size)),
        ("stationarity", share(stationarity(&s), s.size)),
    ])
}

/// The least-squares residual is orthogonal to every basis function: the greatest inner product.
fn stationarity(s: &Spline) -> f64 {
    let full = full(s.u);
    let mut worst = 0.0f64;
    for j in 0..s.control.len() {
        let mut product = [0.0; 2];
        for (i, &t) in s.t.iter().enumerate() {
            let b = basis(&full, j, 3, t);
            for a in 0..2 {
                product[a] += b * (s.values[i][a] - s.p[i][a]);
            }
        }
        worst = worst.max(product[0].hypot(product[1]));
    }
    worst
}

pub fn spline_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (spline(inputs, ours)?, spline(inputs, theirs)?);
    let data = a.p.len() as f64 * a.size * a.size;
    let query = greatest(
        ours.points("query_values")?.as_flattened(),
        theirs.points("query_values")?.as_flattened(),
    );
    Ok(vec![
        (
            "error_f_difference",
            error_gap(error_f(&a), error_f(&b), data),
        ),
        (
            "value_difference",
            share(
                greatest(a.values.as_flattened(), b.values.as_flattened()),
                a.size,
            ),
        ),
        ("query_difference", share(query, a.size)),
    ])
}

struct Refined<'a> {
    u: &'a [f64],
    control: Vec<[f64; 2]>,
    values: Vec<[f64; 2]>,
    size: f64,
}

fn refined<'a>(inputs: &Bundle, outputs: &'a Bundle) -> Result<Refined<'a>, ArrayError> {
    let k = inputs.points("control")?.len() + inputs.vector("insert")?.len();
    shaped(outputs, "control", &[k, 2])?;
    shaped(outputs, "values", &[inputs.vector("query")?.len(), 2])?;
    Ok(Refined {
        u: shaped(outputs, "u", &[k + 2])?,
        control: outputs.points("control")?,
        values: outputs.points("values")?,
        size: diagonal(inputs.points("control")?.as_flattened(), 2),
    })
}

/// The knots are the old and the new ones, and the curve of the new control points is the old one.
pub fn more_knots_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let found = refined(inputs, outputs)?;
    let (u, control) = (inputs.vector("u")?, inputs.points("control")?);
    let mut merged = [u, inputs.vector("insert")?].concat();
    merged.sort_by(f64::total_cmp);
    let (mut formula, mut moved) = (0.0f64, 0.0f64);
    for (&at, value) in inputs.vector("query")?.iter().zip(&found.values) {
        formula = formula.max(greatest(&curve(found.u, &found.control, at), value));
        moved = moved.max(greatest(&curve(u, &control, at), value));
    }
    Ok(vec![
        ("knots", greatest(found.u, &merged)),
        ("formula", share(formula, found.size)),
        ("curve", share(moved, found.size)),
    ])
}

pub fn more_knots_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (refined(inputs, ours)?, refined(inputs, theirs)?);
    let gap = |a: &[[f64; 2]], b: &[[f64; 2]], size| {
        share(greatest(a.as_flattened(), b.as_flattened()), size)
    };
    Ok(vec![
        ("u_difference", greatest(a.u, b.u)),
        ("control_difference", gap(&a.control, &b.control, a.size)),
        ("value_difference", gap(&a.values, &b.values, a.size)),
    ])
}

/// rho(query) by the cubic Hermite formula from values and slopes.
pub fn hermite(t: &[f64], slopes: &[f64], at: f64) -> f64 {
    let n = t.len();
    let i = (at.floor() as usize).clamp(1, n - 1) - 1;
    let s = at - (i + 1) as f64;
    let (h00, h10) = ((1.0 + 2.0 * s) * (1.0 - s).powi(2), s * (1.0 - s).powi(2));
    let (h01, h11) = (s * s * (3.0 - 2.0 * s), s * s * (s - 1.0));
    h00 * t[i] + h10 * slopes[i] + h01 * t[i + 1] + h11 * slopes[i + 1]
}

/// Slopes by reading 7, written out.
pub fn slopes(t: &[f64]) -> Vec<f64> {
    let n = t.len();
    let secant: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let mut slopes: Vec<f64> = (0..n)
        .map(|i| match i {
            0 => secant[0],
            i if i == n - 1 => secant[n - 2],
            i => 0.5 * (secant[i - 1] + secant[i]),
        })
        .collect();
    for i in 0..n - 1 {
        if secant[i] == 0.0 {
            slopes[i] = 0.0;
            slopes[i + 1] = 0.0;
        }
    }
    for i in 0..n - 1 {
        if secant[i] != 0.0 {
            let (a, b) = (slopes[i] / secant[i], slopes[i + 1] / secant[i]);
            if a * a + b * b > 9.0 {
                let tau = 3.0 / (a * a + b * b).sqrt();
                slopes[i] = tau * a * secant[i];
                slopes[i + 1] = tau * b * secant[i];
            }
        }
    }
    slopes
}

pub fn rho_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let (t, query) = (inputs.vector("t")?, inputs.vector("query")?);
    let found = shaped(outputs, "slopes", &[t.len()])?;
    let values = shaped(outputs, "values", &[query.len()])?;
    let length = t[t.len() - 1] - t[0];
    let formula: Vec<f64> = query.iter().map(|&q| hermite(t, found, q)).collect();
    Ok(vec![
        ("formula", share(greatest(values, &formula), length)),
        ("slopes", share(greatest(found, &slopes(t)), length)),
        ("falling", share(falling(query, values), length)),
    ])
}

/// By how much the values fall anywhere, in the order of the query.
fn falling(query: &[f64], values: &[f64]) -> f64 {
    let mut pairs: Vec<(f64, f64)> = query.iter().copied().zip(values.iter().copied()).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs
        .windows(2)
        .map(|w| w[0].1 - w[1].1)
        .fold(0.0, f64::max)
}

pub fn rho_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let t = inputs.vector("t")?;
    let length = t[t.len() - 1] - t[0];
    let between = |name| -> Result<f64, ArrayError> {
        Ok(share(
            greatest(ours.vector(name)?, theirs.vector(name)?),
            length,
        ))
    };
    Ok(vec![
        ("value_difference", between("values")?),
        ("slope_difference", between("slopes")?),
    ])
}
