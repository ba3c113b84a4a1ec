//! The thin-plate kernel and the affine frame of a set of sites (sections 2.2 and 3.2).

use nalgebra::{Matrix2, Vector2};

use super::Point;
use crate::linalg::entry::{Eight, Entry};
use crate::linalg::kernels::{LANES, fused, one_at_a_time};

/// ln x for a normal positive x, to less than one unit in the last place: fdlibm's reduction and polynomial, without branches and with products fused with
/// sums, so that a loop over it becomes vector instructions, and with the same bits on every machine.
#[inline(always)]
fn ln(x: f64) -> f64 {
    const LN2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
    const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    const ONE: u64 = 0x3ff0_0000_0000_0000;
    // x = 2^k (1 + f) with 1 + f between the square roots of 1/2 and 2; `biased` is k + 1023.
    let shifted = x.to_bits() + (ONE - SQRT_HALF);
    let biased = shifted >> 52;
    let f = f64::from_bits((shifted & (!0 >> 12)) + SQRT_HALF) - 1.0;
    // 2^52 + biased as the bits of a number: AVX2 cannot convert 64-bit integers.
    let k = f64::from_bits(biased | 0x4330_0000_0000_0000) - (4_503_599_627_370_496.0 + 1023.0);
    let s = f / (2.0 + f);
    let (z, half) = (s * s, 0.5 * f * f);
    let w = z * z;
    let even = 1.531_383_769_920_937_3e-1_f64
        .mul_add(w, 2.222_219_843_214_978_4e-1)
        .mul_add(w, 3.999_999_999_940_942e-1);
    let odd = 1.479_819_860_511_658_6e-1_f64
        .mul_add(w, 1.818_357_216_161_805e-1)
        .mul_add(w, 2.857_142_874_366_239e-1)
        .mul_add(w, 6.666_666_666_666_735e-1);
    let rest = even.mul_add(w, odd.mul_add(z, half));
    // The first two do not wait for the quotient.
    let (high, low) = (k.mul_add(LN2[0], f), k.mul_add(LN2[1], -half));
    high + s.mul_add(rest, low)
}

/// phi(r) = r^2 ln r as a function of r^2, with phi(0) = 0 (reading 4).
#[inline(always)]
pub fn kernel(r_squared: f64) -> f64 {
    if r_squared >= f64::MIN_POSITIVE {
        0.5 * r_squared * ln(r_squared)
    } else {
        0.0
    }
}

fused! {
    /// phi(||site - p||) for each point p, into `values`.
    pub fn kernels(site: Point, points: &[Point], values: &mut [f64]) {
        for (value, p) in values.iter_mut().zip(points) {
            let (x, y) = (site[0] - p[0], site[1] - p[1]);
            *value = kernel(x.mul_add(x, y * y));
        }
    }
}

/// Eight points, one axis after the other.
pub type EightPoints = [Eight; 2];

/// Up to eight points, the last of them as often as it takes to fill the eight.
pub fn eight_points(points: &[Point]) -> EightPoints {
    let last = points.len().saturating_sub(1);
    let along = |axis: usize| move |i: usize| points.get(i.min(last)).map_or(0.0, |p| p[axis]);
    [0, 1].map(|axis| Entry(std::array::from_fn(along(axis))))
}

fused! {
    /// phi(||site - p||) of eight points p for each site, with the bits of [`kernels`].
    pub fn kernels_of_eight(points: &EightPoints, sites: &[Point], values: &mut [Eight]) {
        let [px, py] = *points;
        for (value, s) in values.iter_mut().zip(sites) {
            one_at_a_time();
            for lane in 0..LANES {
                let (x, y) = (s[0] - px[lane], s[1] - py[lane]);
                value[lane] = x.mul_add(x, y * y);
            }
        }
        for value in Entry::flattened(values) {
            *value = kernel(*value);
        }
    }
}

fused! {
    /// The gradient with respect to the place p of phi(||site - p||) for each site, one axis after the other: (2 ln r + 1) (p - site), and 0 at a site.
    pub fn kernel_gradients(p: Point, sites: &[Point], x: &mut [f64], y: &mut [f64]) {
        for ((s, x), y) in sites.iter().zip(x).zip(y) {
            let d = [p[0] - s[0], p[1] - s[1]];
            let r_squared = d[0].mul_add(d[0], d[1] * d[1]);
            let factor = if r_squared >= f64::MIN_POSITIVE { ln(r_squared) + 1.0 } else { 0.0 };
            *x = factor * d[0];
            *y = factor * d[1];
        }
    }
}

/// Sites closer to a line than this share of their extent along it count as collinear.
const COLLINEAR: f64 = 1e-9;

/// Coordinates in which points are centred, of unit size and along their principal axes: in them the systems are formed, so that scale does not
/// matter (readings 4 and 10).
#[derive(Clone, Debug)]
pub struct Frame {
    pub centre: Vector2<f64>,
    /// Columns are the axes, the longer extent first.
    pub axes: Matrix2<f64>,
    pub size: f64,
    /// Dimension of the affine functions that the points tell apart: 1 (all coincide), 2 (collinear) or 3.
    pub affine: usize,
}

impl Frame {
    /// The frame of these points; size is the greatest distance from the centroid, or 1 where the points coincide.
    pub fn new(points: &[Point]) -> Self {
        let vectors = || points.iter().map(|&p| Vector2::from(p));
        let centre = vectors().sum::<Vector2<f64>>() / points.len().max(1) as f64;
        let scatter: Matrix2<f64> = vectors()
            .map(|p| (p - centre) * (p - centre).transpose())
            .sum();
        let eigen = scatter.symmetric_eigen();
        let order = if eigen.eigenvalues[0] >= eigen.eigenvalues[1] {
            [0, 1]
        } else {
            [1, 0]
        };
        let axes = Matrix2::from_columns(&order.map(|i| eigen.eigenvectors.column(i).into_owned()));
        let extent = |axis: usize| {
            vectors()
                .map(|p| axes.column(axis).dot(&(p - centre)).abs())
                .fold(0.0, f64::max)
        };
        let reach = vectors().map(|p| (p - centre).norm()).fold(0.0, f64::max);
        let rounding = 8.0 * f64::EPSILON * centre.norm();
        let affine = match (extent(0), extent(1)) {
            (along, _) if along <= rounding => 1,
            (along, across) if across <= (COLLINEAR * along).max(rounding) => 2,
            _ => 3,
        };
        Self {
            centre,
            axes,
            size: if affine > 1 { reach } else { 1.0 },
            affine,
        }
    }

    /// The point in this frame's coordinates.
    pub fn normalise(&self, p: Point) -> Point {
        (self.axes.transpose() * (Vector2::from(p) - self.centre) / self.size).into()
    }

    /// The point that [`Self::normalise`] takes to `q`.
    pub fn restore(&self, q: Point) -> Point {
        (self.axes * Vector2::from(q) * self.size + self.centre).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_affine_dimension_tells_points_lines_and_planes_apart() {
        let affine = |points: &[Point]| Frame::new(points).affine;
        assert_eq!(affine(&[[3.0, 1.0]; 4]), 1);
        assert_eq!(affine(&[[0.0, 1.0], [0.1, 1.2], [0.3, 1.6]]), 2);
        assert_eq!(affine(&[[0.0, 1.0], [0.1, 1.2], [0.3, 1.5]]), 3);
    }

    #[test]
    fn the_logarithm_is_that_of_the_standard_library() {
        let mut x = f64::MIN_POSITIVE;
        while x < 1e308 {
            assert!((ln(x) - x.ln()).abs() <= f64::EPSILON * x.ln().abs(), "{x}");
            x *= 1.0 + 1e-3;
        }
        for i in -1000..1000 {
            let x = 1.0 + f64::from(i) * 1e-9;
            assert!((ln(x) - x.ln()).abs() <= f64::EPSILON * x.ln().abs(), "{x}");
        }
    }

    #[test]
    fn phi_is_r_squared_ln_r() {
        assert_eq!(kernel(0.0), 0.0);
        let points = [[4.0, 6.0], [1.0, 2.0], [1.0, 3.0], [1.0, 1e-170], [0.0; 2]];
        let mut values = [1.0; 5];
        kernels([1.0, 2.0], &points, &mut values);
        assert!((values[0] - 25.0 * 5f64.ln()).abs() < 1e-12);
        assert_eq!(values[1..3], [0.0, 0.0]);
        kernels([1.0, 0.0], &points, &mut values);
        assert_eq!(values[3], 0.0);
    }
    #[test]
    fn gradients_are_those_of_the_kernel() {
        let sites = [[0.3, -0.2], [1.5, 2.0], [0.0, 0.0]];
        let (mut x, mut y) = ([0.0; 3], [0.0; 3]);
        kernel_gradients([0.0, 0.0], &sites, &mut x, &mut y);
        let at = |p: Point| {
            let mut values = [0.0; 3];
            kernels(p, &sites, &mut values);
            values
        };
        let h = 1e-6;
        for j in 0..2 {
            let along = |p: Point| (at(p)[j] - at([-p[0], -p[1]])[j]) / (2.0 * h);
            assert!((along([h, 0.0]) - x[j]).abs() < 1e-8);
            assert!((along([0.0, h]) - y[j]).abs() < 1e-8);
        }
        assert_eq!((x[2], y[2]), (0.0, 0.0));
    }
}
