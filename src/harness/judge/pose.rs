//! The pose signal: error (4), side conditions, stationarity, and the greedy order of the sites.

use faer::{Mat, MatRef};

use super::{Measured, diagonal, error_gap, greatest, shaped, share};
use crate::arrays::{ArrayError, Bundle};
use crate::linalg::dense::{Qr, thin_svd};

/// phi(r) = r^2 ln r.
pub fn phi(a: [f64; 2], b: [f64; 2]) -> f64 {
    let r = (a[0] - b[0]).hypot(a[1] - b[1]);
    if r > 0.0 { r * r * r.ln() } else { 0.0 }
}

/// g(p) by its formula; `g` is m x (l + 3).
pub fn evaluate(g: MatRef<'_, f64>, sites: &[[f64; 2]], p: [f64; 2]) -> Vec<f64> {
    let l = sites.len();
    (0..g.nrows())
        .map(|a| {
            let sum: f64 = (0..l).map(|j| phi(sites[j], p) * g[(a, j + 1)]).sum();
            g[(a, 0)] + sum + p[0] * g[(a, l + 1)] + p[1] * g[(a, l + 2)]
        })
        .collect()
}

struct Answer {
    p: Vec<[f64; 2]>,
    x: Mat<f64>,
    sites: Vec<[f64; 2]>,
    g: Mat<f64>,
    values: Mat<f64>,
}

fn answer(inputs: &Bundle, outputs: &Bundle) -> Result<Answer, ArrayError> {
    let x = inputs.matrix("X")?;
    let (m, n) = x.shape();
    let p = inputs.points("P")?;
    let indices = inputs.indices("sites")?;
    let queries = inputs.points("query")?.len();
    shaped(outputs, "g", &[indices.len() + 3, m])?;
    shaped(outputs, "values", &[n, m])?;
    shaped(outputs, "query_values", &[queries, m])?;
    Ok(Answer {
        sites: indices.iter().map(|&i| p[i]).collect(),
        g: outputs.matrix("g")?,
        values: outputs.matrix("values")?,
        p,
        x,
    })
}

pub fn rbf_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let a = answer(inputs, outputs)?;
    let size = a.x.norm_max();
    let residual = &a.values - &a.x;
    let recomputed: Vec<f64> =
        a.p.iter()
            .flat_map(|&p| evaluate(a.g.as_ref(), &a.sites, p))
            .collect();
    let values = outputs.f64("values", 2)?.1;
    let reach = diagonal(a.p.as_flattened(), 2);
    Ok(vec![
        ("error_g", residual.squared_norm_l2()),
        ("side_conditions", side_conditions(&a.g, &a.sites, reach)),
        ("formula", share(greatest(&recomputed, values), size)),
        ("stationarity", stationarity(&a, &residual)),
    ])
}

/// sum_j g_j and sum_j g_j s_j^T, as a share of the sums of magnitudes; sites about their first.
pub fn side_conditions(g: &Mat<f64>, sites: &[[f64; 2]], reach: f64) -> f64 {
    let l = sites.len();
    let mut worst = 0.0f64;
    for r in 0..g.nrows() {
        let total: f64 = (0..l).map(|j| g[(r, j + 1)].abs()).sum();
        let sum = |f: &dyn Fn(usize) -> f64| (0..l).map(|j| g[(r, j + 1)] * f(j)).sum::<f64>();
        worst = worst.max(share(sum(&|_| 1.0).abs(), total));
        for axis in 0..2 {
            let moment = sum(&|j| sites[j][axis] - sites[0][axis]).abs();
            worst = worst.max(share(moment, total * reach));
        }
    }
    worst
}

/// At the least-squares solution the residual is orthogonal to every function of the space: the greatest cosine between them.
fn stationarity(a: &Answer, residual: &Mat<f64>) -> f64 {
    let Some(space) = space(&a.p, &a.sites) else {
        return f64::INFINITY;
    };
    let size = a.x.norm_l2();
    let mut worst = 0.0f64;
    for j in 0..space.ncols() {
        let column = space.col(j);
        for r in 0..residual.nrows() {
            let product: f64 = (0..space.nrows())
                .map(|i| column[i] * residual[(r, i)])
                .sum();
            worst = worst.max(share(product.abs(), column.norm_l2() * size));
        }
    }
    worst
}

/// The functions that meet the side conditions, at the points: [Phi N, 1, p], N the null space of [1 s]^T. None where the SVD fails.
pub fn space(p: &[[f64; 2]], sites: &[[f64; 2]]) -> Option<Mat<f64>> {
    let reach = diagonal(p.as_flattened(), 2);
    let reach = if reach > 0.0 { reach } else { 1.0 };
    let unit = |q: &[f64; 2]| [(q[0] - p[0][0]) / reach, (q[1] - p[0][1]) / reach];
    let (p, s): (Vec<_>, Vec<_>) = (
        p.iter().map(unit).collect(),
        sites.iter().map(unit).collect(),
    );
    let affine = |q: &[f64; 2]| [1.0, q[0], q[1]];
    let l = s.len();
    let side = Mat::from_fn(l, l, |j, a| if a < 3 { affine(&s[j])[a] } else { 0.0 });
    let svd = thin_svd(side.as_ref()).ok()?;
    let null = svd.u.get(.., 3.min(l)..);
    let kernels = Mat::from_fn(p.len(), l, |i, j| phi(p[i], s[j]));
    let bent = &kernels * null;
    Some(Mat::from_fn(p.len(), bent.ncols() + 3, |i, j| {
        if j < 3 {
            affine(&p[i])[j]
        } else {
            bent[(i, j - 3)]
        }
    }))
}

pub fn rbf_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (answer(inputs, ours)?, answer(inputs, theirs)?);
    let size = a.x.norm_max();
    let error = |a: &Answer| (&a.values - &a.x).squared_norm_l2();
    let between = |name| -> Result<f64, ArrayError> {
        Ok(share(
            greatest(ours.f64(name, 2)?.1, theirs.f64(name, 2)?.1),
            size,
        ))
    };
    Ok(vec![
        (
            "error_g_difference",
            error_gap(error(&a), error(&b), a.x.squared_norm_l2()),
        ),
        ("value_difference", between("values")?),
        ("query_difference", between("query_values")?),
    ])
}

/// `order`, frames below n of which none comes twice.
pub fn distinct_frames(outputs: &Bundle, n: usize) -> Result<Vec<usize>, ArrayError> {
    let order = outputs.indices("order")?;
    let mut seen = vec![false; n];
    for &i in &order {
        if i >= n || std::mem::replace(&mut seen[i], true) {
            return Err(ArrayError {
                name: "order".into(),
                expected: format!("distinct frames below {n}"),
                found: format!("{i} out of range or twice"),
            });
        }
    }
    Ok(order)
}

struct Order {
    p: Vec<[f64; 2]>,
    x: Mat<f64>,
    order: Vec<usize>,
    errors: Vec<f64>,
}

fn order(inputs: &Bundle, outputs: &Bundle) -> Result<Order, ArrayError> {
    let p = inputs.points("P")?;
    let order = distinct_frames(outputs, p.len())?;
    let count = inputs.integer("count")?;
    if order.len() > count || order.len() < 3 {
        return Err(ArrayError {
            name: "order".into(),
            expected: format!("3 to {count} sites"),
            found: format!("{} sites", order.len()),
        });
    }
    let errors = shaped(outputs, "errors", &[order.len() - 2])?.to_vec();
    Ok(Order {
        x: inputs.matrix("X")?,
        p,
        order,
        errors,
    })
}

/// What the least-squares fit to `x` (m x n) with sites at these of the n points leaves, n x m.
pub fn residual(p: &[[f64; 2]], x: &Mat<f64>, sites: &[usize]) -> Option<Mat<f64>> {
    let sites: Vec<[f64; 2]> = sites.iter().map(|&i| p[i]).collect();
    let space = space(p, &sites)?;
    let width = space.ncols().min(space.nrows());
    let qr = Qr::new(space);
    let mut rotated = x.transpose().to_owned();
    qr.apply_transpose(&mut rotated);
    for j in 0..rotated.ncols() {
        for i in 0..width {
            rotated[(i, j)] = 0.0;
        }
    }
    qr.apply(&mut rotated);
    Some(rotated)
}

fn norms(residual: &Mat<f64>) -> Vec<f64> {
    (0..residual.nrows())
        .map(|i| residual.row(i).norm_l2())
        .collect()
}

/// The numbers of sites at which an order is recomputed from scratch.
fn probes(count: usize) -> Vec<usize> {
    let mut probes = vec![4, count / 3, count / 2, 3 * count / 4, count - 1];
    probes.retain(|&l| l >= 4 && l < count);
    probes.dedup();
    probes
}

pub fn sites_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let o = order(inputs, outputs)?;
    let data = o.x.squared_norm_l2();
    let (mut error, mut greedy) = (0.0f64, 0.0f64);
    for l in probes(o.order.len()) {
        let left = residual(&o.p, &o.x, &o.order[..l]);
        let Some(left) = left else {
            error = f64::INFINITY;
            continue;
        };
        error = error.max(share(
            (left.squared_norm_l2() - o.errors[l - 3]).abs(),
            data,
        ));
        greedy = greedy.max(shortfall(&norms(&left), &o.order, l, data.sqrt()));
    }
    let rising = o.errors.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
    Ok(vec![
        ("error_g_last", o.errors.last().copied().unwrap_or(0.0)),
        ("errors", error),
        ("greedy", greedy),
        ("start", start_shortfall(&o)),
        ("rising", share(rising, data)),
    ])
}

/// By what share the next site's error falls short of the greatest among frames not yet chosen; 0 where both are rounding.
fn shortfall(norms: &[f64], order: &[usize], l: usize, data: f64) -> f64 {
    let open = (0..norms.len()).filter(|i| !order[..l].contains(i));
    let worst = open.map(|i| norms[i]).fold(0.0, f64::max);
    if worst <= 1e-9 * data {
        return 0.0;
    }
    share(worst - norms[order[l]], worst)
}

/// The first four are the farthest from the best-fit plane, by decreasing distance.
fn start_shortfall(o: &Order) -> f64 {
    let (m, n) = o.x.shape();
    let mean: Vec<f64> = (0..m)
        .map(|a| (0..n).map(|i| o.x[(a, i)]).sum::<f64>() / n as f64)
        .collect();
    let centred = Mat::from_fn(n, m, |i, a| o.x[(a, i)] - mean[a]);
    let Ok(svd) = thin_svd(centred.as_ref()) else {
        return f64::INFINITY;
    };
    let plane = svd.v.get(.., ..2.min(svd.v.ncols()));
    let across = &centred - &centred * plane * plane.transpose();
    let distances = norms(&across);
    let data = o.x.norm_l2();
    (0..o.order.len().min(4))
        .map(|l| shortfall(&distances, &o.order, l, data))
        .fold(0.0, f64::max)
}

pub fn sites_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (order(inputs, ours)?, order(inputs, theirs)?);
    let data = a.x.squared_norm_l2();
    let same = a
        .order
        .iter()
        .zip(&b.order)
        .take_while(|(a, b)| a == b)
        .count();
    let compared = same
        .saturating_sub(2)
        .min(a.errors.len())
        .min(b.errors.len());
    let mut gap = 0.0;
    if same < a.order.len().min(b.order.len()) && same >= 4 {
        gap = match residual(&a.p, &a.x, &a.order[..same]) {
            Some(left) => {
                let norms = norms(&left);
                let (p, q) = (norms[a.order[same]], norms[b.order[same]]);
                if p.max(q) <= 1e-9 * data.sqrt() {
                    0.0
                } else {
                    share((p - q).abs(), p.max(q))
                }
            }
            None => f64::INFINITY,
        };
    }
    // Where the first four differ, `start` of both answers has already judged them.
    Ok(vec![
        ("order_gap", gap),
        (
            "errors_difference",
            share(greatest(&a.errors[..compared], &b.errors[..compared]), data),
        ),
        (
            "count_difference",
            a.order.len().abs_diff(b.order.len()) as f64,
        ),
    ])
}
