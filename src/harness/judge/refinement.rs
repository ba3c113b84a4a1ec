//! Joint refinement at given sites: the error recomputed from the signals, the best g and h for their curve found again, and the gradient there.

use faer::{Mat, MatRef};

use super::{Measured, diagonal, greatest, pose, shaped, share, time};
use crate::arrays::{ArrayError, Bundle};
use crate::linalg::dense::{Qr, thin_svd};

/// The signals of a start or of an answer.
struct Signals {
    control: Vec<[f64; 2]>,
    sites: Vec<[f64; 2]>,
    /// m x (l + 3).
    g: Mat<f64>,
    /// r x m.
    h: Mat<f64>,
    h0: Vec<f64>,
}

impl Signals {
    fn new(bundle: &Bundle) -> Result<Self, ArrayError> {
        Ok(Self {
            control: bundle.points("control")?,
            sites: bundle.points("sites")?,
            g: bundle.matrix("g")?,
            h: bundle.matrix("H")?,
            h0: bundle.vector("h0")?.to_vec(),
        })
    }
}

/// What the signals are measured against.
struct Rows<'a> {
    /// r x R.
    targets: MatRef<'a, f64>,
    weights: &'a [f64],
    parameters: &'a [f64],
    knots: &'a [f64],
}

impl<'a> Rows<'a> {
    fn new(inputs: &'a Bundle) -> Result<Self, ArrayError> {
        let targets = inputs.columns("Y")?;
        let count = targets.ncols();
        Ok(Self {
            targets,
            weights: shaped(inputs, "w", &[count])?,
            parameters: shaped(inputs, "t", &[count])?,
            knots: inputs.vector("u")?,
        })
    }

    fn curve(&self, control: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let at = |&t: &f64| time::curve(self.knots, control, t);
        self.parameters.iter().map(at).collect()
    }

    /// r x R: targets less h(g(f(t))).
    fn residual(&self, s: &Signals) -> Mat<f64> {
        let curve = self.curve(&s.control);
        let mut left = self.targets.to_owned();
        for (i, &p) in curve.iter().enumerate() {
            let x = pose::evaluate(s.g.as_ref(), &s.sites, p);
            for a in 0..left.nrows() {
                let model: f64 = (0..x.len()).map(|j| s.h[(a, j)] * x[j]).sum();
                left[(a, i)] -= s.h0[a] + model;
            }
        }
        left
    }

    fn error(&self, s: &Signals) -> f64 {
        let left = self.residual(s);
        let row = |i: usize| self.weights[i] * left.col(i).squared_norm_l2();
        (0..self.weights.len()).map(row).sum()
    }

    /// The least error for this curve and these sites over every g and every h of m dimensions; None where an SVD fails.
    fn least(&self, s: &Signals) -> Option<f64> {
        let (r, count) = self.targets.shape();
        let total: f64 = self.weights.iter().sum();
        let mean = |a: usize| {
            (0..count)
                .map(|i| self.weights[i] * self.targets[(a, i)])
                .sum::<f64>()
                / total
        };
        let mean: Vec<f64> = (0..r).map(mean).collect();
        let mut targets = Mat::from_fn(count, r, |i, a| {
            self.weights[i].sqrt() * (self.targets[(a, i)] - mean[a])
        });
        let space = pose::space(&self.curve(&s.control), &s.sites)?;
        let width = space.ncols().min(count);
        let qr = Qr::new(Mat::from_fn(count, space.ncols(), |i, j| {
            self.weights[i].sqrt() * space[(i, j)]
        }));
        qr.apply_transpose(&mut targets);
        let svd = thin_svd(targets.get(..width, ..)).ok()?;
        let dropped: f64 = svd.s.iter().skip(s.h.ncols()).map(|x| x * x).sum();
        Some(targets.get(width.., ..).squared_norm_l2() + dropped)
    }

    /// The gradient of the error with respect to the control points over the error, for a plane in which the sites' box has the diagonal 1.
    fn gradient(&self, s: &Signals) -> f64 {
        let (left, curve) = (self.residual(s), self.curve(&s.control));
        let pulled = s.h.transpose() * &left;
        let pull = |i: usize, a: usize| self.weights[i] * pulled[(a, i)];
        let full = time::full(self.knots);
        let mut square = 0.0;
        for j in 0..s.control.len() {
            let mut force = [0.0; 2];
            for (i, &p) in curve.iter().enumerate() {
                let share = time::basis(&full, j, 3, self.parameters[i]);
                if share == 0.0 {
                    continue;
                }
                for a in 0..s.g.nrows() {
                    let slope = slope(s, a, p);
                    for axis in 0..2 {
                        force[axis] += 2.0 * pull(i, a) * share * slope[axis];
                    }
                }
            }
            square += force[0] * force[0] + force[1] * force[1];
        }
        share(
            square.sqrt() * diagonal(s.sites.as_flattened(), 2),
            self.error(s),
        )
    }
}

/// The gradient at p of phi(||p - site||).
fn kernel_slope(p: [f64; 2], site: [f64; 2]) -> [f64; 2] {
    let d = [p[0] - site[0], p[1] - site[1]];
    let r = d[0].hypot(d[1]);
    d.map(|x| {
        if r > 0.0 {
            x * (2.0 * r.ln() + 1.0)
        } else {
            0.0
        }
    })
}

/// The gradient of coordinate a of g at p.
fn slope(s: &Signals, a: usize, p: [f64; 2]) -> [f64; 2] {
    let l = s.sites.len();
    let mut slope = [s.g[(a, l + 1)], s.g[(a, l + 2)]];
    for (j, &site) in s.sites.iter().enumerate() {
        let along = kernel_slope(p, site);
        slope[0] += s.g[(a, j + 1)] * along[0];
        slope[1] += s.g[(a, j + 1)] * along[1];
    }
    slope
}

fn answer<'a>(
    inputs: &'a Bundle,
    outputs: &Bundle,
) -> Result<(Rows<'a>, Signals, f64), ArrayError> {
    let rows = Rows::new(inputs)?;
    let (r, m) = (rows.targets.nrows(), inputs.columns("H")?.ncols());
    let (k, l) = (
        inputs.points("control")?.len(),
        inputs.points("sites")?.len(),
    );
    let kept = outputs.columns("H")?.ncols();
    shaped(outputs, "control", &[k, 2])?;
    shaped(outputs, "sites", &[l, 2])?;
    shaped(outputs, "g", &[l + 3, kept])?;
    shaped(outputs, "H", &[kept.min(m), r])?;
    shaped(outputs, "h0", &[r])?;
    let claimed = shaped(outputs, "error", &[1])?[0];
    Ok((rows, Signals::new(outputs)?, claimed))
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let (rows, found, claimed) = answer(inputs, outputs)?;
    let start = Signals::new(inputs)?;
    let (before, error) = (rows.error(&start), rows.error(&found));
    let least = rows.least(&found).unwrap_or(f64::NEG_INFINITY);
    let gram = found.h.transpose() * &found.h;
    let m = gram.nrows();
    let (given, sites) = (start.sites.as_flattened(), found.sites.as_flattened());
    let reach = diagonal(given, 2);
    Ok(vec![
        ("error_before", before),
        ("error", error),
        ("claimed_error", share((error - claimed).abs(), error)),
        ("above_start", share((error - before).max(0.0), before)),
        ("above_least", share(error - least, error).max(0.0)),
        ("sites_moved", share(greatest(given, sites), reach)),
        ("slope", rows.gradient(&found)),
        (
            "side_conditions",
            pose::side_conditions(&found.g, &found.sites, reach),
        ),
        (
            "orthonormality",
            (gram - Mat::<f64>::identity(m, m)).norm_max(),
        ),
    ])
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (rows, a, _) = answer(inputs, ours)?;
    let (_, b, _) = answer(inputs, theirs)?;
    let (a, b) = (rows.error(&a), rows.error(&b));
    Ok(vec![("error_difference", share((a - b).abs(), a.max(b)))])
}
