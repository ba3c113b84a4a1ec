//! A surface that rides on the nodes of a coarse body.

use nalgebra::{Matrix4, Vector3, Vector4};

/// For each point of a surface the nodes it rides on and their weights.
pub(super) struct Ride {
    weights: Vec<Vec<(usize, f64)>>,
}

impl Ride {
    /// Moving least squares: weights fade smoothly with the distance and vanish at `reach`, and reproduce every affine motion exactly.
    pub fn new(points: &[Vector3<f64>], nodes: &[Vector3<f64>], reach: f64) -> Self {
        let weights = points
            .iter()
            .map(|p| moving_least_squares(p, nodes, reach))
            .collect();
        Self { weights }
    }

    /// Where the points of the surface go when the nodes are at `nodes`.
    pub fn carry(&self, nodes: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let carry_one =
            |row: &Vec<(usize, f64)>| row.iter().map(|&(node, weight)| nodes[node] * weight).sum();
        self.weights.iter().map(carry_one).collect()
    }
}

fn moving_least_squares(
    point: &Vector3<f64>,
    nodes: &[Vector3<f64>],
    reach: f64,
) -> Vec<(usize, f64)> {
    let kernel = |node: &Vector3<f64>| {
        (1.0 - (node - point).norm_squared() / (reach * reach))
            .max(0.0)
            .powi(3)
    };
    let basis = |node: &Vector3<f64>| (node - point).push(reach);
    let near: Vec<(usize, f64)> = (0..nodes.len())
        .map(|v| (v, kernel(&nodes[v])))
        .filter(|&(_, k)| k > 0.0)
        .collect();
    let mut moments = Matrix4::zeros();
    for &(v, k) in &near {
        moments += basis(&nodes[v]) * basis(&nodes[v]).transpose() * k;
    }
    let solution = moments.try_inverse().unwrap_or_else(Matrix4::zeros) * Vector4::w() * reach;
    near.iter()
        .map(|&(v, k)| (v, k * basis(&nodes[v]).dot(&solution)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ride_follows_affine_motions() {
        let lattice = |i: u8| f64::from(i) * 0.2 - 0.4;
        let nodes: Vec<Vector3<f64>> = (0..125)
            .map(|i| Vector3::new(i % 5, i / 5 % 5, i / 25).map(lattice))
            .collect();
        let points = [Vector3::new(0.1, 0.3, 0.2), Vector3::new(-0.43, 0.0, 0.41)];
        let ride = Ride::new(&points, &nodes, 0.4);
        let affine =
            |p: &Vector3<f64>| Vector3::new(2.0 * p.x - p.z + 1.0, p.y + 0.3 * p.x, 0.1 - p.z);
        let moved: Vec<_> = nodes.iter().map(affine).collect();
        for (p, q) in points.iter().zip(ride.carry(&moved)) {
            assert!((affine(p) - q).norm() < 1e-12);
        }
    }

    #[test]
    fn nodes_out_of_reach_have_no_say() {
        let weights =
            moving_least_squares(&Vector3::zeros(), &[Vector3::x(), Vector3::y() * 3.0], 2.0);
        assert!(weights.iter().all(|&(node, _)| node == 0));
    }
}
