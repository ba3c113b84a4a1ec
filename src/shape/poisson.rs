//! The frame whose gradients are nearest to given ones: a Poisson equation with cotangent weights, factored once.
//!
//! x minimises sum_f A_f |grad x - G_f|_F^2 over the reference's triangles that are not degenerate, G_f a 3x2 gradient in the frame of triangle f and A_f
//! its area. One vertex a component is grounded, which leaves a positive definite system of V - C unknowns; then the component is moved to its centre.

use std::ops::Range;

use super::ShapeError;
use super::pool::Pool;
use super::reference::{Reference, Triangle};
use crate::linalg::sparse::{Factor, Pattern};

/// The images of the unit vectors u and v of a triangle of the reference.
pub type Gradient = [[f64; 3]; 2];

/// Triangles whose gradients are asked for at a time.
const BLOCK: usize = 64;

/// The system of one reference frame.
#[derive(Debug)]
pub struct Poisson {
    factor: Factor,
    /// The unknown of every vertex; that of grounded ones, one past the last, is 0.
    unknowns: Vec<u32>,
    /// The triangles: their unknowns and their weights.
    elements: Vec<Element>,
    work: Pool<Work>,
}

/// A triangle's share of the right-hand side: area times the gradients of the hat functions of its second and third corner, which are
/// (height, -foot) / 2 and (0, length) / 2. All 0 for a degenerate triangle.
#[derive(Clone, Copy, Debug)]
struct Element {
    unknowns: [u32; 3],
    second: [f64; 2],
    third: f64,
}

#[derive(Debug, Default)]
struct Work {
    x: Vec<[f64; 3]>,
    scratch: Vec<[f64; 4]>,
}

impl Poisson {
    /// Builds and factors the system.
    pub fn new(reference: &Reference) -> Result<Self, ShapeError> {
        let System {
            unknowns,
            entries,
            values,
            n,
        } = system(reference);
        let corners = |f: usize| reference.faces()[f].map(|v| unknowns[v as usize]);
        let triangles = reference.triangles.iter().enumerate();
        let elements = triangles
            .map(|(f, triangle)| Element::new(corners(f), triangle))
            .collect();
        Ok(Self {
            factor: Pattern::new(n, &entries)?.factor(&values)?,
            unknowns,
            elements,
            work: Pool::default(),
        })
    }

    /// The frame for gradients that `fill` writes, some triangles at a time (any value for degenerate ones), with the first vertex of every
    /// component in the origin.
    pub fn solve(
        &self,
        mut fill: impl FnMut(Range<usize>, &mut [Gradient]),
        positions: &mut [f64],
    ) {
        self.work.lend(|work| {
            let n = self.factor.size();
            work.x.clear();
            work.x.resize(n + 1, [0.0; 3]);
            let mut gradients = [[[0.0; 3]; 2]; BLOCK];
            for (block, elements) in self.elements.chunks(BLOCK).enumerate() {
                let first = block * BLOCK;
                let gradients = &mut gradients[..elements.len()];
                fill(first..first + elements.len(), gradients);
                for (element, gradient) in elements.iter().zip(gradients) {
                    element.add(gradient, &mut work.x);
                }
            }
            self.factor.solve3(&mut work.x[..n], &mut work.scratch);
            work.x[n] = [0.0; 3];
            for (p, &unknown) in positions
                .as_chunks_mut::<3>()
                .0
                .iter_mut()
                .zip(&self.unknowns)
            {
                *p = work.x[unknown as usize];
            }
        });
    }
}

impl Element {
    fn new(unknowns: [u32; 3], triangle: &Option<Triangle>) -> Self {
        let (second, third) = match triangle {
            Some(t) => ([0.5 * t.height, -0.5 * t.foot], 0.5 * t.length),
            None => ([0.0; 2], 0.0),
        };
        Self {
            unknowns,
            second,
            third,
        }
    }

    #[inline(always)]
    fn add(&self, &[u, v]: &Gradient, x: &mut [[f64; 3]]) {
        let [a, b, c] = self.unknowns.map(|i| i as usize);
        for k in 0..3 {
            let second = self.second[0] * u[k] + self.second[1] * v[k];
            let third = self.third * v[k];
            x[a][k] -= second + third;
            x[b][k] += second;
            x[c][k] += third;
        }
    }
}

/// The symmetric matrix of a reference.
#[derive(Debug)]
pub struct System {
    /// Number of unknowns, V - C.
    pub n: usize,
    /// The unknown of every vertex; that of grounded ones is n.
    pub unknowns: Vec<u32>,
    /// Places on one side of the diagonal, either one, some given more than once, and their values, which add up.
    pub entries: Vec<[u32; 2]>,
    pub values: Vec<f64>,
}

/// The matrix of the normal equations, from the stiffness of the triangles that are not degenerate. O(F).
pub fn system(reference: &Reference) -> System {
    let unknowns = unknowns(reference);
    let n = reference.vertex_count() - reference.components.len();
    let (mut entries, mut values) = (Vec::new(), Vec::new());
    for (face, triangle) in reference.faces().iter().zip(&reference.triangles) {
        let Some(triangle) = triangle else { continue };
        for (entry, value) in stiffness(face.map(|v| unknowns[v as usize]), triangle) {
            if entry.iter().all(|&i| (i as usize) < n) {
                entries.push(entry);
                values.push(value);
            }
        }
    }
    System {
        n,
        unknowns,
        entries,
        values,
    }
}

/// Numbers the vertices that are not the first of their component.
fn unknowns(reference: &Reference) -> Vec<u32> {
    let n = reference.vertex_count() - reference.components.len();
    let mut grounded = vec![false; reference.vertex_count()];
    for component in &reference.components {
        grounded[component.first_vertex as usize] = true;
    }
    let mut next = 0..n as u32;
    let number = |&grounded: &bool| match grounded {
        true => n as u32,
        false => next.next().unwrap_or(n as u32),
    };
    grounded.iter().map(number).collect()
}

/// A triangle's part of the matrix: its area times the products of the gradients of its hat functions.
fn stiffness([a, b, c]: [u32; 3], t: &Triangle) -> [([u32; 2], f64); 6] {
    let bb = (t.height * t.height + t.foot * t.foot) / (2.0 * t.length * t.height);
    let cc = t.length / (2.0 * t.height);
    let bc = -t.foot / (2.0 * t.height);
    let (ab, ac) = (-(bb + bc), -(cc + bc));
    [
        ([a, a], -(ab + ac)),
        ([b, b], bb),
        ([c, c], cc),
        ([a, b], ab),
        ([a, c], ac),
        ([b, c], bc),
    ]
}
