//! The reference frame of a shape space and what every space needs of its triangles and components.

use std::sync::Arc;

use super::{DIAGONALS, ShapeError};
use crate::linalg::kernels::{LANES, total, vectorised};
use crate::mesh::Connectivity;
use crate::mesh::measure::bounds;
use crate::mesh::topology::components;
use crate::mesh::vector::{Point, along, cross, dot, norm, point, sub};

/// A triangle with twice its area at most this share of its longest edge squared is degenerate. A frame comes back to rounding over the least such share of
/// the others, and from lengths to rounding over its square, which tell a height h of a triangle only to eps / h.
pub const DEGENERATE: f64 = 1e-5;

/// A triangle (a, b, c) of the reference, in its orthonormal frame: b - a = length u, c - a = foot u + height v; the normal is u x v.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    pub u: Point,
    pub v: Point,
    pub length: f64,
    pub foot: f64,
    pub height: f64,
}

impl Triangle {
    /// None for a degenerate triangle.
    pub fn new(corners: [Point; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        let (e1, e2, e3) = (sub(b, a), sub(c, a), sub(c, b));
        let normal = cross(e1, e2);
        let longest = dot(e1, e1).max(dot(e2, e2)).max(dot(e3, e3));
        let sound = norm(normal) > DEGENERATE * longest;
        if !sound {
            return None;
        }
        let length = norm(e1);
        let u = e1.map(|x| x / length);
        let foot = dot(e2, u);
        let upright = along(e2, -foot, u);
        // Once more, because a thin triangle leaves little of e2.
        let upright = along(upright, -dot(upright, u), u);
        let height = norm(upright);
        Some(Self {
            u,
            v: upright.map(|x| x / height),
            length,
            foot,
            height,
        })
    }

    /// Its area.
    pub fn area(&self) -> f64 {
        0.5 * self.length * self.height
    }

    /// The unit normal.
    pub fn normal(&self) -> Point {
        cross(self.u, self.v)
    }
}

/// A part of the mesh: vertices joined by triangles that are not degenerate, or one vertex of no such triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// Its lowest vertex; components are ordered by it.
    pub first_vertex: u32,
    /// How many vertices it has.
    pub vertices: usize,
    /// Its lowest triangle that is not degenerate; none for a vertex by itself.
    pub first_triangle: Option<u32>,
}

/// A frame that others are measured against.
#[derive(Clone, Debug)]
pub struct Reference {
    pub connectivity: Arc<Connectivity>,
    /// x0 y0 z0 x1 ..., 3V.
    pub positions: Vec<f64>,
    /// F; None for degenerate triangles.
    pub triangles: Vec<Option<Triangle>>,
    /// The component of each vertex.
    pub labels: Vec<u32>,
    /// C, by lowest vertex.
    pub components: Vec<Component>,
    /// The diagonal of the bounding box; 1 where that is 0, all vertices being in one place.
    pub diagonal: f64,
}

impl Reference {
    /// Measures a frame of 3V positions. O(V + F).
    pub fn new(connectivity: Arc<Connectivity>, positions: &[f64]) -> Result<Self, ShapeError> {
        check("reference", positions, 3 * connectivity.vertex_count())?;
        let diagonal = bounds(positions).diagonal();
        if diagonal > 0.0 && !(DIAGONALS[0]..=DIAGONALS[1]).contains(&diagonal) {
            let what = "reference";
            return Err(ShapeError::Magnitude { what, diagonal });
        }
        let faces = connectivity.faces();
        let triangles: Vec<_> = faces
            .iter()
            .map(|f| Triangle::new(f.map(|v| point(positions, v))))
            .collect();
        let (labels, components) = parts(&connectivity, &triangles);
        Ok(Self {
            connectivity,
            positions: positions.to_vec(),
            triangles,
            labels,
            components,
            diagonal: if diagonal > 0.0 { diagonal } else { 1.0 },
        })
    }

    /// V.
    pub fn vertex_count(&self) -> usize {
        self.connectivity.vertex_count()
    }

    /// Numbers of a frame, 3V.
    pub fn frame_len(&self) -> usize {
        3 * self.vertex_count()
    }

    /// The triangles, F x 3.
    pub fn faces(&self) -> &[[u32; 3]] {
        self.connectivity.faces()
    }

    /// The component of a triangle that is not degenerate.
    pub fn component_of(&self, face: usize) -> usize {
        self.labels[self.faces()[face][0] as usize] as usize
    }

    /// Whether a triangle is not degenerate.
    pub fn is_sound(&self, face: u32) -> bool {
        self.triangles[face as usize].is_some()
    }

    /// The area of each triangle over the squared diagonal, F; 0 for degenerate ones.
    pub fn area_shares(&self) -> Vec<f64> {
        let share = |t: &Triangle| 0.5 * (t.length / self.diagonal) * (t.height / self.diagonal);
        let triangles = self.triangles.iter();
        triangles.map(|t| t.as_ref().map_or(0.0, share)).collect()
    }

    /// Writes the centre of each component of a frame over the diagonal, 3 numbers each.
    pub fn centres(&self, positions: &[f64], out: &mut [f64]) {
        self.means(positions, out);
        out.iter_mut().for_each(|x| *x /= self.diagonal);
    }

    /// Moves each component of a frame so that its centre over the diagonal is the one given.
    pub fn place(&self, centres: &[f64], positions: &mut [f64]) {
        let mut shifts = vec![0.0; centres.len()];
        self.means(positions, &mut shifts);
        for (shift, centre) in shifts.iter_mut().zip(centres) {
            *shift = centre * self.diagonal - *shift;
        }
        let shifts = shifts.as_chunks::<3>().0;
        for (p, &label) in positions
            .as_chunks_mut::<3>()
            .0
            .iter_mut()
            .zip(&self.labels)
        {
            let shift = shifts[label as usize];
            *p = [p[0] + shift[0], p[1] + shift[1], p[2] + shift[2]];
        }
    }

    fn means(&self, positions: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let sums = out.as_chunks_mut::<3>().0;
        for (p, &label) in positions.as_chunks::<3>().0.iter().zip(&self.labels) {
            let sum = &mut sums[label as usize];
            *sum = [sum[0] + p[0], sum[1] + p[1], sum[2] + p[2]];
        }
        for (sum, component) in sums.iter_mut().zip(&self.components) {
            *sum = sum.map(|x| x / component.vertices as f64);
        }
    }
}

fn parts(
    connectivity: &Connectivity,
    triangles: &[Option<Triangle>],
) -> (Vec<u32>, Vec<Component>) {
    let faces = connectivity.faces();
    let sound = |f: &usize| triangles[*f].is_some();
    let joining: Vec<[u32; 3]> = (0..faces.len()).filter(sound).map(|f| faces[f]).collect();
    let (labels, count) = components(connectivity.vertex_count(), &joining);
    let mut parts = vec![
        Component {
            first_vertex: u32::MAX,
            vertices: 0,
            first_triangle: None
        };
        count
    ];
    for (v, &label) in labels.iter().enumerate() {
        let part = &mut parts[label as usize];
        part.first_vertex = part.first_vertex.min(v as u32);
        part.vertices += 1;
    }
    for f in (0..faces.len()).filter(sound).rev() {
        parts[labels[faces[f][0] as usize] as usize].first_triangle = Some(f as u32);
    }
    (labels, parts)
}

/// Refuses a list of another length, or with numbers that are not finite.
pub fn check(what: &'static str, numbers: &[f64], expected: usize) -> Result<(), ShapeError> {
    check_len(what, numbers, expected)?;
    // The product with 0 is 0 or not a number: one sum to look at instead of a branch a number.
    if sum_of_zeros(numbers) == 0.0 {
        return Ok(());
    }
    match numbers.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(ShapeError::NotFinite { what, index }),
        None => Ok(()),
    }
}

/// Refuses a list of another length.
pub fn check_len(what: &'static str, numbers: &[f64], expected: usize) -> Result<(), ShapeError> {
    match numbers.len() == expected {
        true => Ok(()),
        false => Err(ShapeError::WrongLength {
            what,
            expected,
            found: numbers.len(),
        }),
    }
}

vectorised! {
    fn sum_of_zeros(numbers: &[f64]) -> f64 {
        let mut lanes = [0.0; LANES];
        let (chunks, rest) = numbers.as_chunks::<LANES>();
        for chunk in chunks {
            for lane in 0..LANES {
                lanes[lane] += chunk[lane] * 0.0;
            }
        }
        for (lane, x) in lanes.iter_mut().zip(rest) {
            *lane += x * 0.0;
        }
        total(lanes)
    }
}
