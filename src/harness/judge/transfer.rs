//! Transfer by its definition: the residual of least squares is orthogonal to the examples, and frames are sums of examples.

use super::{Measured, greatest, shaped, share, square};
use crate::arrays::{ArrayError, Bundle};

/// Rows of an example matrix.
struct Rows<'a> {
    data: &'a [f64],
    width: usize,
}

impl<'a> Rows<'a> {
    fn new(bundle: &'a Bundle, name: &str) -> Result<Self, ArrayError> {
        let (shape, data) = bundle.f64(name, 2)?;
        let width = shape[1].max(1);
        Ok(Self { data, width })
    }

    fn iter(&self) -> std::slice::ChunksExact<'a, f64> {
        self.data.chunks_exact(self.width)
    }

    /// Each row but the first, less the first.
    fn differences(&self) -> Vec<Vec<f64>> {
        let less = |row: &[f64]| {
            row.iter()
                .zip(self.data)
                .map(|(x, first)| x - first)
                .collect()
        };
        self.iter().skip(1).map(less).collect()
    }

    /// first + sum_j x_j (row_j - first).
    fn combine(&self, x: &[f64], differences: &[Vec<f64>]) -> Vec<f64> {
        let mut sum = self.data[..self.width].to_vec();
        for (x, row) in x.iter().zip(differences) {
            sum.iter_mut().zip(row).for_each(|(sum, r)| *sum += x * r);
        }
        sum
    }
}

fn answer<'a>(inputs: &Bundle, outputs: &'a Bundle) -> Result<[&'a [f64]; 2], ArrayError> {
    let n = inputs.f64("Z", 2)?.0[0];
    let (m, width) = (inputs.f64("Q", 2)?.0[0] - 1, inputs.f64("R", 2)?.0[1]);
    Ok([
        shaped(outputs, "X", &[n, m])?,
        shaped(outputs, "W", &[n, width])?,
    ])
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let [x, w] = answer(inputs, outputs)?;
    let [z, q, r] = [
        Rows::new(inputs, "Z")?,
        Rows::new(inputs, "Q")?,
        Rows::new(inputs, "R")?,
    ];
    let (h, g) = (q.differences(), r.differences());
    let (basis, size) = (
        h.iter().map(|row| square(row)).sum::<f64>().sqrt(),
        reach(r.data),
    );
    let (mut stationarity, mut formula, mut examples) = (0.0f64, 0.0f64, 0.0f64);
    let rows = z
        .iter()
        .zip(x.chunks_exact(h.len()))
        .zip(w.chunks_exact(r.width));
    for ((z, x), w) in rows {
        let left: Vec<f64> = q.combine(x, &h).iter().zip(z).map(|(a, b)| b - a).collect();
        let data: Vec<f64> = z.iter().zip(q.data).map(|(z, q)| z - q).collect();
        for row in &h {
            let product: f64 = row.iter().zip(&left).map(|(a, b)| a * b).sum();
            stationarity = stationarity.max(share(product.abs(), basis * square(&data).sqrt()));
        }
        formula = formula.max(greatest(&r.combine(x, &g), w));
        // A frame that is an example becomes its partner.
        let partner = q.iter().zip(r.iter()).find(|(q, _)| *q == z);
        examples = examples.max(partner.map_or(0.0, |(_, r)| greatest(r, w)));
    }
    Ok(vec![
        ("stationarity", stationarity),
        ("formula", share(formula, size)),
        ("examples", share(examples, size)),
    ])
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let ([x, w], [y, v]) = (answer(inputs, ours)?, answer(inputs, theirs)?);
    Ok(vec![
        ("coordinate_difference", share(greatest(x, y), reach(x))),
        ("frame_difference", share(greatest(w, v), reach(w))),
    ])
}

/// The greatest magnitude.
fn reach(data: &[f64]) -> f64 {
    data.iter().fold(0.0, |reach, x| x.abs().max(reach))
}
