//! Faces that a deformation has turned inside out.
//!
//! A triangle in space has no inside of its own; its surroundings give it one. The rotation that best takes a face's neighbourhood from the reference
//! to the frame says where its normal should point, and a normal that points to the other side is turned. Two neighbourhoods are asked: the vertices
//! that share an edge with a corner, and those around these. Within a fold the smaller one goes along with it and may take the wrong side for the right
//! one; where a surface is rolled up tightly the larger one is not a rotation of the reference. So a face is turned where both say so, and clear of it
//! where neither does.

use rayon::prelude::*;

use super::vector::{Point, cross, dot, point, sub};
use crate::linalg::rotation::{Matrix, apply, nearest_rotation};

/// A reference and the neighbourhood of every face; to be asked of many frames.
pub struct Orientation<'a> {
    reference: &'a [f64],
    faces: &'a [[u32; 3]],
    /// Where each vertex's neighbours start in `neighbours`.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

impl<'a> Orientation<'a> {
    /// For 3V positions and faces in range. O(V + F log F).
    pub fn new(reference: &'a [f64], faces: &'a [[u32; 3]]) -> Self {
        let mut pairs: Vec<[u32; 2]> = faces
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, a], [b, c], [c, b], [c, a], [a, c]])
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut starts = vec![0u32; reference.len() / 3 + 1];
        for pair in &pairs {
            starts[pair[0] as usize + 1] += 1;
        }
        for v in 1..starts.len() {
            starts[v] += starts[v - 1];
        }
        Self {
            reference,
            faces,
            starts,
            neighbours: pairs.iter().map(|pair| pair[1]).collect(),
        }
    }

    /// The 0-based faces of a frame (3V positions), ascending, whose normal is more than a right angle from the reference's turned as both of their
    /// neighbourhoods have turned (the rotation nearest to their covariance). Faces without a normal are none of them. O(V + F).
    pub fn turned(&self, frame: &[f64]) -> Vec<u32> {
        self.faces_where(frame, |[near, far]| near && far)
    }

    /// Faces that either neighbourhood takes to be turned in any of these frames (3V positions each), ascending, each once.
    pub fn not_clear(&self, frames: &[f64]) -> Vec<u32> {
        let each = frames.chunks_exact(self.reference.len().max(1));
        let mut faces: Vec<u32> = each
            .flat_map(|frame| self.faces_where(frame, |[near, far]| near || far))
            .collect();
        faces.sort_unstable();
        faces.dedup();
        faces
    }

    /// Of each frame (3V positions) the faces that are turned in it and not among `before`, which ascend.
    pub fn newly_turned(&self, frames: &[f64], before: &[u32]) -> Vec<Vec<u32>> {
        let newly = |frame: &[f64]| {
            let mut turned = self.turned(frame);
            turned.retain(|face| before.binary_search(face).is_err());
            turned
        };
        let each = frames.chunks_exact(self.reference.len().max(1));
        each.map(newly).collect()
    }

    /// Faces for which `is` holds of what the smaller and the larger neighbourhood say.
    fn faces_where(&self, frame: &[f64], is: impl Fn([bool; 2]) -> bool + Sync) -> Vec<u32> {
        let holds = |f: &usize| {
            let face = self.faces[*f];
            let (expected, found) = (normal(self.reference, face), normal(frame, face));
            let turned = |around: &[u32]| {
                let rotation = self.rotation(around, frame);
                dot(found, apply(&rotation, expected)) < 0.0
            };
            let near = self.around(&face);
            is([turned(&near), turned(&self.around(&near))])
        };
        let faces = (0..self.faces.len()).into_par_iter();
        faces.filter(holds).map(|f| f as u32).collect()
    }

    /// These vertices and their neighbours, ascending.
    fn around(&self, vertices: &[u32]) -> Vec<u32> {
        let mut around = vertices.to_vec();
        for &v in vertices {
            let range = self.starts[v as usize]..self.starts[v as usize + 1];
            around.extend(&self.neighbours[range.start as usize..range.end as usize]);
        }
        around.sort_unstable();
        around.dedup();
        around
    }

    /// The rotation nearest to what takes these vertices of the reference to those of the frame.
    fn rotation(&self, around: &[u32], frame: &[f64]) -> Matrix {
        let (from, to) = (mean(self.reference, around), mean(frame, around));
        let mut covariance = [[0.0; 3]; 3];
        for &v in around {
            let (x, y) = (
                sub(point(self.reference, v), from),
                sub(point(frame, v), to),
            );
            for j in 0..3 {
                for i in 0..3 {
                    covariance[j][i] += y[i] * x[j];
                }
            }
        }
        nearest_rotation(&covariance)
    }
}

fn normal(positions: &[f64], [a, b, c]: [u32; 3]) -> Point {
    let [a, b, c] = [a, b, c].map(|v| point(positions, v));
    cross(sub(b, a), sub(c, a))
}

fn mean(positions: &[f64], vertices: &[u32]) -> Point {
    let mut sum = [0.0; 3];
    for &v in vertices {
        let p = point(positions, v);
        (0..3).for_each(|a| sum[a] += p[a]);
    }
    sum.map(|x| x / vertices.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::rotation::exp;

    /// A bumpy sheet of w x w vertices.
    fn sheet(w: usize) -> (Vec<f64>, Vec<[u32; 3]>) {
        let positions = (0..w * w)
            .flat_map(|i| {
                let (x, y) = ((i % w) as f64, (i / w) as f64);
                [x, y, 0.4 * (1.3 * x).sin() * (0.9 * y).cos()]
            })
            .collect();
        let index = |x: usize, y: usize| (y * w + x) as u32;
        let cells = (0..w - 1).flat_map(|y| (0..w - 1).map(move |x| (x, y)));
        let faces = cells.flat_map(|(x, y)| {
            let [a, b] = [index(x, y), index(x + 1, y)];
            let [c, d] = [index(x + 1, y + 1), index(x, y + 1)];
            [[a, b, c], [a, c, d]]
        });
        (positions, faces.collect())
    }

    fn mapped(positions: &[f64], map: impl Fn(Point) -> Point) -> Vec<f64> {
        positions
            .as_chunks()
            .0
            .iter()
            .flat_map(|&p| map(p))
            .collect()
    }

    #[test]
    fn motions_and_bends_turn_nothing() {
        let (rest, faces) = sheet(8);
        let orientation = Orientation::new(&rest, &faces);
        let turn = exp([1.9, -2.1, 0.7]);
        assert!(
            orientation
                .turned(&mapped(&rest, |p| apply(&turn, p)))
                .is_empty()
        );
        // Rolled up twice around a cylinder: half of the sheet faces the other way, and none of it is inside out.
        let rolled = mapped(&rest, |[x, y, z]| {
            let (angle, radius) = (1.8 * x, 0.6 + 0.1 * z);
            [radius * angle.sin(), y, radius * angle.cos()]
        });
        assert!(orientation.turned(&rolled).is_empty());
    }

    #[test]
    fn a_vertex_pushed_through_its_ring_turns_the_faces_that_fold() {
        let (rest, faces) = sheet(8);
        let orientation = Orientation::new(&rest, &faces);
        let mut frame = rest.clone();
        // Vertex (3, 3) goes beyond its neighbour (4, 3).
        frame[3 * (3 * 8 + 3)] += 1.7;
        let turned = orientation.turned(&frame);
        assert!(!turned.is_empty() && turned.len() <= 4, "{turned:?}");
        for f in turned {
            assert!(faces[f as usize].contains(&(3 * 8 + 3)));
        }
    }

    /// A sheet folded over along a crease: the half that is laid over is no more inside out than the other.
    #[test]
    fn only_faces_beside_a_fold_are_in_doubt() {
        let (rest, faces) = sheet(8);
        let orientation = Orientation::new(&rest, &faces);
        let folded = mapped(&rest, |[x, y, z]| match x > 3.5 {
            true => [7.0 - x, y, -z - 0.01],
            false => [x, y, z],
        });
        let (turned, doubtful) = (orientation.turned(&folded), orientation.not_clear(&folded));
        assert!(turned.iter().all(|f| doubtful.contains(f)));
        let beside = |f: &u32| {
            let across = faces[*f as usize].map(|v| v % 8);
            across.iter().all(|x| (1..=6).contains(x))
        };
        assert!(doubtful.iter().all(beside), "{doubtful:?}");
    }
}
