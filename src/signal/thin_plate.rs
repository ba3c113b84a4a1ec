//! The thin-plate kernel and the affine frame of a set of sites (sections 2.2 and 3.2).

use nalgebra::{Matrix2, Vector2};

use super::Point;

/// phi(r) = r^2 ln r as a function of r^2, with phi(0) = 0 (reading 4).
pub fn kernel(r_squared: f64) -> f64 {
    if r_squared > 0.0 {
        0.5 * r_squared * r_squared.ln()
    } else {
        0.0
    }
}

/// phi(||a - b||).
pub fn between(a: Point, b: Point) -> f64 {
    let (x, y) = (a[0] - b[0], a[1] - b[1]);
    kernel(x * x + y * y)
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
    fn phi_is_r_squared_ln_r() {
        assert_eq!(kernel(0.0), 0.0);
        assert!((between([1.0, 2.0], [4.0, 6.0]) - 25.0 * 5f64.ln()).abs() < 1e-12);
    }
}
