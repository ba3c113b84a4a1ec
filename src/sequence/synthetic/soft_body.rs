//! An elastic body of tetrahedra on a lattice.
//!
//! Stable neo-Hookean elasticity by small-step extended position-based dynamics: two constraints a tetrahedron, one for its shape and one
//! for its volume (Macklin & Müller 2021, "A constraint-based formulation of stable neo-Hookean materials").

use nalgebra::{Matrix3, Vector3};

use super::implicit::Solid;

/// What the body is made of and where it lives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Material {
    /// Mass of a unit of volume.
    pub density: f64,
    /// First Lamé parameter lambda.
    pub bulk: f64,
    /// Second Lamé parameter mu.
    pub shear: f64,
    /// The part of its velocity that a node loses in a second.
    pub damping: f64,
    /// How much of its sliding a node keeps in a step on the floor.
    pub slip: f64,
}

struct Tetrahedron {
    nodes: [usize; 4],
    /// Inverse of the matrix whose columns are the three edges from the first node at rest.
    inverse_rest: Matrix3<f64>,
    volume: f64,
}

/// Nodes joined by tetrahedra, over a floor at y = 0.
pub(super) struct SoftBody {
    material: Material,
    tetrahedra: Vec<Tetrahedron>,
    rest: Vec<Vector3<f64>>,
    /// How far each node lies outside the solid at rest: it may sink so far below the floor.
    outside: Vec<f64>,
    points: Vec<Vector3<f64>>,
    velocities: Vec<Vector3<f64>>,
    inverse_masses: Vec<f64>,
}

impl SoftBody {
    /// Fills `solid` with cubes of side `spacing` and cuts each into five tetrahedra.
    pub fn new(solid: &Solid, spacing: f64, material: Material) -> Self {
        let lattice = fill(solid, spacing);
        let count = lattice.points.len();
        let mut body = Self {
            material,
            tetrahedra: Vec::new(),
            outside: lattice
                .points
                .iter()
                .map(|p| solid.value(p).max(0.0))
                .collect(),
            points: lattice.points.clone(),
            rest: lattice.points,
            velocities: vec![Vector3::zeros(); count],
            inverse_masses: vec![0.0; count],
        };
        for (corners, odd) in lattice.cubes {
            for tetrahedron in if odd { ODD } else { EVEN } {
                body.add(tetrahedron.map(|corner| corners[corner]));
            }
        }
        for mass in &mut body.inverse_masses {
            *mass = if *mass > 0.0 { 1.0 / *mass } else { 0.0 };
        }
        body
    }

    /// Adds a tetrahedron and, for the time being, its mass to `inverse_masses`.
    fn add(&mut self, nodes: [usize; 4]) {
        let edges = edges(&self.rest, nodes);
        let volume = edges.determinant() / 6.0;
        if let Some(inverse_rest) = edges.try_inverse() {
            for node in nodes {
                self.inverse_masses[node] += self.material.density * volume / 4.0;
            }
            self.tetrahedra.push(Tetrahedron {
                nodes,
                inverse_rest,
                volume,
            });
        }
    }

    /// Where the nodes are.
    pub fn points(&self) -> &[Vector3<f64>] {
        &self.points
    }

    /// Where the nodes are at rest.
    pub fn rest(&self) -> &[Vector3<f64>] {
        &self.rest
    }

    /// Advances by `step` seconds under `gravity`, the nodes of `held` going where it says.
    pub fn advance(&mut self, step: f64, gravity: f64, held: &[(usize, Vector3<f64>)]) {
        let free = self.inverse_masses.clone();
        let before = self.points.clone();
        let kept = 1.0 - self.material.damping * step;
        for (point, velocity) in self.points.iter_mut().zip(&self.velocities) {
            *point += (velocity * kept + Vector3::y() * (gravity * step)) * step;
        }
        for &(node, place) in held {
            self.points[node] = place;
            self.inverse_masses[node] = 0.0;
        }
        for tetrahedron in &self.tetrahedra {
            tetrahedron.restore(&mut self.points, &self.inverse_masses, &self.material, step);
        }
        self.rest_on_floor(&before);
        for (v, velocity) in self.velocities.iter_mut().enumerate() {
            *velocity = (self.points[v] - before[v]) / step;
        }
        self.inverse_masses = free;
    }

    fn rest_on_floor(&mut self, before: &[Vector3<f64>]) {
        for (v, point) in self.points.iter_mut().enumerate() {
            let floor = -self.outside[v];
            if point.y < floor && self.inverse_masses[v] > 0.0 {
                let slip = self.material.slip;
                point.x = before[v].x + slip * (point.x - before[v].x);
                point.z = before[v].z + slip * (point.z - before[v].z);
                point.y = floor;
            }
        }
    }
}

fn edges(points: &[Vector3<f64>], [a, b, c, d]: [usize; 4]) -> Matrix3<f64> {
    let origin = points[a];
    Matrix3::from_columns(&[points[b] - origin, points[c] - origin, points[d] - origin])
}

impl Tetrahedron {
    /// One iteration of XPBD on the size of the deformation gradient and on its determinant, both at once: at rest, where the one pulls
    /// as the other pushes, nothing moves.
    fn restore(&self, points: &mut [Vector3<f64>], masses: &[f64], material: &Material, step: f64) {
        let f = edges(points, self.nodes) * self.inverse_rest;
        let (x, y, z) = (f.column(0), f.column(1), f.column(2));
        let size = f.norm().max(1e-9);
        let cofactors = Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)]);
        let shape = self.slopes(f / size);
        let volume = self.slopes(cofactors);
        let excess = f.determinant() - 1.0 - material.shear / material.bulk;

        let stiffness = self.volume * step * step;
        let masses = self.nodes.map(|node| masses[node]);
        let product = |a: &[Vector3<f64>; 4], b: &[Vector3<f64>; 4]| -> f64 {
            (0..4).map(|i| masses[i] * a[i].dot(&b[i])).sum()
        };
        let a = product(&shape, &shape) + 1.0 / (material.shear * stiffness);
        let b = product(&shape, &volume);
        let c = product(&volume, &volume) + 1.0 / (material.bulk * stiffness);
        let determinant = a * c - b * b;
        let along_shape = (b * excess - c * size) / determinant;
        let along_volume = (b * size - a * excess) / determinant;
        for i in 0..4 {
            let shift = shape[i] * along_shape + volume[i] * along_volume;
            points[self.nodes[i]] += shift * masses[i];
        }
    }

    /// The derivatives by the nodes of what has the derivative `slope` by the deformation gradient.
    fn slopes(&self, slope: Matrix3<f64>) -> [Vector3<f64>; 4] {
        let slopes = slope * self.inverse_rest.transpose();
        let [b, c, d] = [0, 1, 2].map(|i| slopes.column(i).into_owned());
        [-(b + c + d), b, c, d]
    }
}

/// Corners of a cube are numbered x + 2 y + 4 z; neighbours alternate between the two ways to cut one, so that diagonals meet.
const EVEN: [[usize; 4]; 5] = [
    [0, 1, 2, 4],
    [3, 2, 1, 7],
    [5, 4, 7, 1],
    [6, 7, 4, 2],
    [1, 4, 7, 2],
];
const ODD: [[usize; 4]; 5] = [
    [1, 3, 0, 5],
    [2, 0, 3, 6],
    [4, 0, 6, 5],
    [7, 5, 6, 3],
    [0, 3, 6, 5],
];

struct Filling {
    points: Vec<Vector3<f64>>,
    /// Corners, and whether the cube stands at an odd place.
    cubes: Vec<([usize; 8], bool)>,
}

/// The cubes of a lattice that `solid` reaches into.
fn fill(solid: &Solid, spacing: f64) -> Filling {
    let [low, high] = solid.bounds();
    let counts: Vec<usize> = ((high - low) / spacing)
        .iter()
        .map(|n| n.ceil() as usize)
        .collect();
    let place = |at: [usize; 3]| low + Vector3::from(at.map(|i| i as f64)) * spacing;
    let nodes = counts.iter().map(|n| n + 1);
    let mut index = vec![usize::MAX; nodes.product()];
    let mut filling = Filling {
        points: Vec::new(),
        cubes: Vec::new(),
    };
    for z in 0..counts[2] {
        for y in 0..counts[1] {
            for x in 0..counts[0] {
                if !reaches(solid, place([x, y, z]), spacing) {
                    continue;
                }
                let corners = std::array::from_fn(|corner| {
                    let at = [x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)];
                    let slot =
                        &mut index[at[0] + (counts[0] + 1) * (at[1] + (counts[1] + 1) * at[2])];
                    if *slot == usize::MAX {
                        *slot = filling.points.len();
                        filling.points.push(place(at));
                    }
                    *slot
                });
                filling.cubes.push((corners, (x + y + z) % 2 == 1));
            }
        }
    }
    filling
}

/// Whether one of 4 x 4 x 4 samples of a cube lies in the solid.
fn reaches(solid: &Solid, low: Vector3<f64>, spacing: f64) -> bool {
    (0..64).any(|i| {
        let at = Vector3::new(i % 4, i / 4 % 4, i / 16).map(|n| (f64::from(n) + 0.5) / 4.0);
        solid.value(&(low + at * spacing)) < 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::super::implicit::Cone;
    use super::*;

    const SOFT: Material = Material {
        density: 1000.0,
        bulk: 1e5,
        shear: 2e4,
        damping: 0.0,
        slip: 0.5,
    };

    fn ball() -> Solid {
        let end = Vector3::new(0.0, 1.0, 0.0);
        let cone = Cone {
            from: end,
            to: end + Vector3::x() * 0.1,
            from_radius: 0.4,
            to_radius: 0.4,
            flatten: 1.0,
            blend: 0.05,
        };
        Solid { cones: vec![cone] }
    }

    #[test]
    fn tetrahedra_fill_their_cubes() {
        let body = SoftBody::new(&ball(), 0.2, SOFT);
        let volume: f64 = body.tetrahedra.iter().map(|t| t.volume).sum();
        assert!(body.tetrahedra.iter().all(|t| t.volume > 0.0));
        let cubes = body.tetrahedra.len() as f64 / 5.0;
        assert!((volume / (cubes * 0.008) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_body_at_rest_stays_at_rest_and_a_falling_one_falls() {
        let mut body = SoftBody::new(&ball(), 0.2, SOFT);
        body.advance(1e-3, 0.0, &[]);
        let moved = body
            .points()
            .iter()
            .zip(body.rest())
            .map(|(p, q)| (p - q).norm());
        assert!(moved.fold(0.0, f64::max) < 1e-12);
        for _ in 0..100 {
            body.advance(1e-3, -10.0, &[]);
        }
        let fall = body.points()[0].y - body.rest()[0].y;
        assert!((fall + 0.05).abs() < 1e-3, "{fall}");
    }

    #[test]
    fn a_stretched_body_returns_and_keeps_its_momentum() {
        let mut body = SoftBody::new(&ball(), 0.2, SOFT);
        for point in &mut body.points {
            point.x *= 1.3;
        }
        let mean = |points: &[Vector3<f64>], masses: &[f64]| {
            let total: f64 = masses.iter().map(|w| 1.0 / w).sum();
            points
                .iter()
                .zip(masses)
                .map(|(p, w)| p / *w)
                .sum::<Vector3<f64>>()
                / total
        };
        let width = |p: &[Vector3<f64>]| p.iter().map(|p| p.x).fold(0.0, f64::max);
        let (before, wide) = (
            mean(&body.points, &body.inverse_masses),
            width(&body.points),
        );
        for _ in 0..20 {
            body.advance(1e-3, 0.0, &[]);
        }
        assert!(width(&body.points) < wide - 0.02);
        assert!((mean(&body.points, &body.inverse_masses) - before).norm() < 1e-12);
    }
}
