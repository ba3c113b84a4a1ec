//! The frame whose edge lengths and dihedral angles are nearest to given ones: a nonlinear least squares over the vertices (Froehlich & Botsch 2011,
//! their equation (3) without the term of volume and with weights 1).
//!
//! x minimises E(x) = sum over edges (|x_j - x_i| - l)^2 + sum over hinges (theta(x) - a)^2 + sum over triangles max(0, ln(A / area(x)))^2, differences
//! of angles modulo 2 pi. The last sum is ours: lengths and angles of no surface would flatten some triangle, at whose flat shape its angles jump, so
//! that E has no minimum there; A is the least area that the triangle keeps without a cost.
//!
//! A step solves (H + damping D) step = -J^T r, r the differences, J their derivatives and D the diagonal of J^T J, by a sparse factorisation whose
//! pattern is analysed once. H is the whole second derivative J^T J + sum r r'' (Newton) where that, damped, is positive definite, and J^T J
//! (Gauss-Newton) where it is not: vectors of no frame leave differences, and Gauss-Newton alone then creeps, the more slowly the larger these times the
//! curvature of the angles are. Damping follows how well E was predicted (Nielsen 1999). It also holds what E leaves free, the rigid motions of
//! components.

mod descent;
mod system;

use std::f64::consts::TAU;

pub use descent::Descent;
use descent::{LOWER, Work};
use system::{Second, System};

use super::ShapeError;
use super::pool::Pool;
use crate::linalg::kernels::dot;
use crate::linalg::sparse::Pattern;
use crate::mesh::dihedral::dihedral_angle;
use crate::mesh::vector::{Point, cross, norm, sub};

/// What a frame should have; see the energy above.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Of every edge.
    pub lengths: &'a [f64],
    /// Of every hinge, radians.
    pub angles: &'a [f64],
    /// Of every triangle the least area; 0 where there is none.
    pub areas: &'a [f64],
}

/// The terms of one mesh, and where they add to the second derivatives.
#[derive(Debug)]
pub struct Shell {
    vertices: usize,
    edges: Vec<Edge>,
    bends: Vec<Bend>,
    triangles: Vec<Triangle>,
    /// Pairs of different vertices of one term, the smaller first.
    couplings: Vec<[u32; 2]>,
    pattern: Pattern,
    work: Pool<Work>,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    /// The smaller vertex first.
    ends: [u32; 2],
    coupling: u32,
}

#[derive(Clone, Copy, Debug)]
struct Bend {
    corners: [u32; 4],
    /// Of the pairs of corners in [`PAIRS`]; any number for one vertex twice.
    couplings: [u32; 6],
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    corners: [u32; 3],
    /// Of the pairs of corners in [`SIDES`].
    couplings: [u32; 3],
}

const SIDES: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

impl Shell {
    /// Over edges (the smaller vertex first), hinges (see [`crate::mesh::dihedral`]) and triangles of vertices below `vertices`. Costs the analysis of a sparse
    /// system of three unknowns a vertex.
    pub fn new(
        vertices: usize,
        edges: &[[u32; 2]],
        hinges: &[[u32; 4]],
        triangles: &[[u32; 3]],
    ) -> Result<Self, ShapeError> {
        let ordered = |a: u32, b: u32| [a.min(b), a.max(b)];
        let at_hinges = hinges
            .iter()
            .flat_map(|c| PAIRS.map(|[p, q]| ordered(c[p], c[q])));
        let at_triangles = triangles
            .iter()
            .flat_map(|c| SIDES.map(|[p, q]| ordered(c[p], c[q])));
        let mut couplings: Vec<_> = edges
            .iter()
            .copied()
            .chain(at_hinges)
            .chain(at_triangles)
            .collect();
        couplings.retain(|[a, b]| a != b);
        couplings.sort_unstable();
        couplings.dedup();
        let find = |pair: [u32; 2]| couplings.binary_search(&pair).unwrap_or(0) as u32;
        let edges = edges.iter().map(|&ends| Edge {
            ends,
            coupling: find(ends),
        });
        let bends = hinges.iter().map(|&corners| Bend {
            corners,
            couplings: PAIRS.map(|[p, q]| find(ordered(corners[p], corners[q]))),
        });
        let triangles = triangles.iter().map(|&corners| Triangle {
            corners,
            couplings: SIDES.map(|[p, q]| find(ordered(corners[p], corners[q]))),
        });
        let (edges, bends, triangles) = (edges.collect(), bends.collect(), triangles.collect());
        let places: Vec<[u32; 2]> = (0..vertices as u32)
            .flat_map(|v| LOWER.map(|[r, c]| [3 * v + r as u32, 3 * v + c as u32]))
            .chain(
                couplings
                    .iter()
                    .flat_map(|&[a, b]| (0..9).map(move |i| [3 * a + i / 3, 3 * b + i % 3])),
            )
            .collect();
        Ok(Self {
            pattern: Pattern::new(3 * vertices, &places)?,
            vertices,
            edges,
            bends,
            triangles,
            couplings,
            work: Pool::default(),
        })
    }

    /// Writes what a frame is off its target; E.
    fn differences(&self, target: &Target, x: &[Point], out: &mut Vec<f64>) -> f64 {
        let length = |edge: &Edge| {
            let [a, b] = edge.ends.map(|v| x[v as usize]);
            norm(sub(b, a))
        };
        let edges = self.edges.iter().zip(target.lengths);
        let bends = self.bends.iter().zip(target.angles);
        let triangles = self.triangles.iter().zip(target.areas);
        out.clear();
        out.extend(edges.map(|(edge, given)| length(edge) - given));
        out.extend(bends.map(|(bend, given)| {
            let gap = dihedral_angle(bend.corners.map(|v| x[v as usize])) - given;
            gap - TAU * (gap / TAU).round()
        }));
        out.extend(triangles.map(|(triangle, &least)| {
            let [a, b, c] = triangle.corners.map(|v| x[v as usize]);
            let area = 0.5 * norm(cross(sub(b, a), sub(c, a)));
            if area < least {
                (least / area).ln()
            } else {
                0.0
            }
        }));
        dot(out, out)
    }

    fn assemble(&self, x: &[Point], differences: &[f64], second: Second, system: &mut System) {
        system.clear(self.vertices, self.couplings.len());
        let (of_edges, others) = differences.split_at(self.edges.len());
        let (of_bends, of_triangles) = others.split_at(self.bends.len());
        for (edge, &r) in self.edges.iter().zip(of_edges) {
            system.add_edge(edge, x, r, second);
        }
        for (bend, &r) in self.bends.iter().zip(of_bends) {
            system.add_bend(bend, x, r, second);
        }
        for (triangle, &r) in self.triangles.iter().zip(of_triangles) {
            if r > 0.0 {
                system.add_triangle(triangle, x, r, second);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Two triangles at an edge and a third at both: three hinges, and one whose triangles have the same corners.
    const FACES: [[u32; 3]; 4] = [[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 1]];
    const EDGES: [[u32; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    const HINGES: [[u32; 4]; 4] = [[0, 1, 2, 3], [1, 2, 0, 3], [1, 3, 0, 2], [0, 1, 2, 2]];

    /// E of these vertices, and half its derivatives.
    fn energy(shell: &Shell, target: &Target, x: &[Point]) -> (f64, System) {
        let (mut differences, mut system) = (Vec::new(), System::default());
        let energy = shell.differences(target, x, &mut differences);
        shell.assemble(x, &differences, Second::Newton, &mut system);
        (energy, system)
    }

    /// Row `i`, column `j` of the second derivatives.
    fn second(shell: &Shell, system: &System, i: usize, j: usize) -> f64 {
        let [v, w] = [i, j].map(|i| (i / 3) as u32);
        if v == w {
            return system.blocks[v as usize][i % 3][j % 3];
        }
        let coupling = shell
            .couplings
            .binary_search(&[v.min(w), v.max(w)])
            .unwrap();
        let block = &system.blocks[shell.vertices + coupling];
        if v < w {
            block[i % 3][j % 3]
        } else {
            block[j % 3][i % 3]
        }
    }

    fn areas(x: &[Point]) -> [f64; 4] {
        FACES.map(|f| {
            let [a, b, c] = f.map(|v| x[v as usize]);
            0.5 * norm(cross(sub(b, a), sub(c, a)))
        })
    }

    proptest! {
        /// Against central differences, with two triangles smaller than they should be.
        #[test]
        fn derivatives(x in prop::array::uniform4(prop::array::uniform3(-1.0f64..1.0))) {
            let found = areas(&x);
            prop_assume!(found.iter().all(|a| *a > 0.15));
            let least = [1.7 * found[0], 0.3 * found[1], 2.5 * found[2], 0.0];
            let target = Target { lengths: &[0.7; 6], angles: &[0.4; 4], areas: &least };
            let shell = Shell::new(4, &EDGES, &HINGES, &FACES).unwrap();
            // The last hinge is folded back on itself: its angle is pi or -pi.
            let shell = Shell { bends: shell.bends[..3].to_vec(), ..shell };
            let (_, system) = energy(&shell, &target, &x);
            const STEP: f64 = 1e-5;
            for i in 0..12 {
                let [(after, next), (before, last)] = [STEP, -STEP].map(|by| {
                    let mut moved = x;
                    moved[i / 3][i % 3] += by;
                    energy(&shell, &target, &moved)
                });
                let slope = (after - before) / (4.0 * STEP);
                let found = system.gradient[i / 3][i % 3];
                prop_assert!((slope - found).abs() < 1e-5 * (1.0 + slope.abs()), "{i}: {slope} {found}");
                for j in 0..12 {
                    let slope = (next.gradient[j / 3][j % 3] - last.gradient[j / 3][j % 3]) / (2.0 * STEP);
                    let found = second(&shell, &system, j, i);
                    prop_assert!((slope - found).abs() < 1e-3 * (1.0 + slope.abs()), "{i} {j}: {slope} {found}");
                }
            }
        }

        /// Lengths and angles of a surface are met; others lead to a frame where E is stationary, and no triangle is flat there.
        #[test]
        fn descents_end_where_they_say(
            x in prop::array::uniform4(prop::array::uniform3(-1.0f64..1.0)), by in prop::collection::vec(0.6f64..1.6, 9),
        ) {
            let most = areas(&x);
            prop_assume!(most.iter().all(|a| *a > 0.15));
            let shell = Shell::new(4, &EDGES, &HINGES[..3], &FACES).unwrap();
            let mut here = Vec::new();
            let none = Target { lengths: &[0.0; 6], angles: &[0.0; 3], areas: &[0.0; 4] };
            shell.differences(&none, &x, &mut here);
            let exact = Target { lengths: &here[..6], angles: &here[6..9], areas: &[0.0; 4] };
            let mut start = x;
            let met = shell.descend(&exact, &mut start).unwrap();
            prop_assert!(met.factorisations == 0 && met.imbalance == 0.0 && start == x);
            let other: Vec<f64> = here.iter().zip(&by).map(|(x, by)| x * by).collect();
            let least = most.map(|a| 0.1 * a);
            let target = Target { lengths: &other[..6], angles: &other[6..], areas: &least };
            let (before, _) = energy(&shell, &target, &x);
            let found = shell.descend(&target, &mut start).unwrap();
            let (after, system) = energy(&shell, &target, &start);
            prop_assert!(after <= before && (after - found.energy).abs() <= 1e-12 * before);
            prop_assert!(areas(&start).iter().all(|a| *a > 0.0));
            if found.is_stationary() && found.energy > 1e-20 {
                prop_assert!(system.imbalance(after) <= 1e-5, "{found:?} {}", system.imbalance(after));
            }
        }
    }
}
