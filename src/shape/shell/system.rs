//! The first and second derivatives of E, added up term by term.

use super::{Bend, Edge, PAIRS, SIDES, Triangle};
use crate::mesh::dihedral::{Block, Lean};
use crate::mesh::vector::{Point, cross, dot, norm, sub};

/// Half the derivatives of E.
#[derive(Debug, Default)]
pub struct System {
    /// J^T r.
    pub gradient: Vec<Point>,
    /// The diagonal of J^T J.
    pub squares: Vec<Point>,
    /// H, of every vertex with itself, then of couplings, rows of the smaller vertex.
    pub blocks: Vec<Block>,
}

/// Which second derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Second {
    Newton,
    GaussNewton,
}

impl System {
    pub fn clear(&mut self, vertices: usize, couplings: usize) {
        for points in [&mut self.gradient, &mut self.squares] {
            points.clear();
            points.resize(vertices, [0.0; 3]);
        }
        self.blocks.clear();
        self.blocks.resize(vertices + couplings, [[0.0; 3]; 3]);
    }

    /// See [`super::Descent::imbalance`].
    pub fn imbalance(&self, energy: f64) -> f64 {
        let both = self.gradient.as_flattened().iter();
        let both = both.zip(self.squares.as_flattened());
        let cosine = |(g, square): (&f64, &f64)| g.abs() / (square * energy).sqrt();
        both.map(cosine).fold(0.0, f64::max)
    }

    /// With the unit direction u: r' = (-u, u), r'' = (1 - u u^T) / length.
    #[inline]
    pub fn add_edge(&mut self, edge: &Edge, x: &[Point], r: f64, second: Second) {
        let ends = edge.ends.map(|v| v as usize);
        let [a, b] = ends.map(|v| x[v]);
        let e = sub(b, a);
        let length = norm(e);
        // An edge of no length has no direction.
        if !(length > 0.0 && length.is_finite()) {
            return;
        }
        let u = e.map(|x| x / length);
        let bent = match second {
            Second::Newton => r / length,
            Second::GaussNewton => 0.0,
        };
        let block: Block = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let identity = if i == j { 1.0 } else { 0.0 };
                u[i] * u[j] + bent * (identity - u[i] * u[j])
            })
        });
        for (&v, sign) in ends.iter().zip([-1.0, 1.0]) {
            for i in 0..3 {
                self.gradient[v][i] += sign * r * u[i];
                self.squares[v][i] += u[i] * u[i];
            }
            add(&mut self.blocks[v], &block, 1.0);
        }
        let coupling = self.gradient.len() + edge.coupling as usize;
        add(&mut self.blocks[coupling], &block, -1.0);
    }

    #[inline]
    pub fn add_bend(&mut self, bend: &Bend, x: &[Point], r: f64, second: Second) {
        let corners = bend.corners.map(|v| v as usize);
        let [i, j, k, l] = corners.map(|v| x[v]);
        let (Some(f), Some(g)) = (Lean::new([i, j, k]), Lean::new([j, i, l])) else {
            // Without a normal there is no angle to bend.
            return;
        };
        let sum = |a: Point, b: Point| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let first = [
            sum(f.first[0], g.first[1]),
            sum(f.first[1], g.first[0]),
            f.first[2],
            g.first[2],
        ];
        let whole = second == Second::Newton;
        let block = |p: usize, q: usize| -> Block {
            let mut block = first[p].map(|a| first[q].map(|b| a * b));
            if whole {
                for (lean, places) in [(&f, OF_FIRST), (&g, OF_SECOND)] {
                    if let [Some(p), Some(q)] = [places[p], places[q]] {
                        add(&mut block, &lean.second[p][q], r);
                    }
                }
            }
            block
        };
        for (p, &v) in corners.iter().enumerate() {
            for i in 0..3 {
                self.gradient[v][i] += r * first[p][i];
                self.squares[v][i] += first[p][i] * first[p][i];
            }
            add(&mut self.blocks[v], &block(p, p), 1.0);
        }
        let vertices = self.gradient.len();
        for (&[p, q], &coupling) in PAIRS.iter().zip(&bend.couplings) {
            let (a, b) = (corners[p], corners[q]);
            let coupling = vertices + coupling as usize;
            match a.cmp(&b) {
                std::cmp::Ordering::Less => add(&mut self.blocks[coupling], &block(p, q), 1.0),
                std::cmp::Ordering::Greater => add(&mut self.blocks[coupling], &block(q, p), 1.0),
                // Two triangles with the same corners: the vertex across is one.
                std::cmp::Ordering::Equal => {
                    add(&mut self.blocks[a], &block(p, q), 1.0);
                    add(&mut self.blocks[a], &block(q, p), 1.0);
                }
            }
        }
    }

    /// r = ln A - ln area, area = |N| / 2, N = e x p with e = j - i and p = k - i, and n its direction: r' = -n . N' / |N|, and
    /// r'' = -(N'^T (1 - 2 n n^T) N' / |N|^2 + n . N'' / |N|).
    pub fn add_triangle(&mut self, triangle: &Triangle, x: &[Point], r: f64, second: Second) {
        let corners = triangle.corners.map(|v| v as usize);
        let [i, j, k] = corners.map(|v| x[v]);
        let (e, p) = (sub(j, i), sub(k, i));
        let normal = cross(e, p);
        let size = norm(normal);
        let n = normal.map(|x| x / size);
        let by_j = cross(p, n).map(|x| -x / size);
        let by_k = cross(n, e).map(|x| -x / size);
        let first = [[0, 1, 2].map(|i| -(by_j[i] + by_k[i])), by_j, by_k];
        // Of N by each coordinate of i, j and k.
        let turned: [[Point; 3]; 3] = std::array::from_fn(|corner| {
            std::array::from_fn(|axis| {
                let mut d = [0.0; 3];
                d[axis] = 1.0;
                match corner {
                    0 => cross(d, sub(j, k)),
                    1 => cross(d, p),
                    _ => cross(e, d),
                }
            })
        });
        // n . N'' of two corners: N is the sum of i x j, j x k and k x i.
        let skew: Block = [[0.0, n[2], -n[1]], [-n[2], 0.0, n[0]], [n[1], -n[0], 0.0]];
        let block = |a: usize, b: usize| -> Block {
            let sign = match (3 + b - a) % 3 {
                0 => 0.0,
                1 => 1.0,
                _ => -1.0,
            };
            std::array::from_fn(|row| {
                std::array::from_fn(|column| {
                    let (u, v) = (turned[a][row], turned[b][column]);
                    let bent = (dot(u, v) - 2.0 * dot(u, n) * dot(v, n)) / (size * size)
                        + sign * skew[row][column] / size;
                    let whole = match second {
                        Second::Newton => -r * bent,
                        Second::GaussNewton => 0.0,
                    };
                    first[a][row] * first[b][column] + whole
                })
            })
        };
        for (corner, &v) in corners.iter().enumerate() {
            for axis in 0..3 {
                self.gradient[v][axis] += r * first[corner][axis];
                self.squares[v][axis] += first[corner][axis] * first[corner][axis];
            }
            add(&mut self.blocks[v], &block(corner, corner), 1.0);
        }
        let vertices = self.gradient.len();
        for (&[a, b], &coupling) in SIDES.iter().zip(&triangle.couplings) {
            let ascending = corners[a] < corners[b];
            let block = if ascending { block(a, b) } else { block(b, a) };
            add(&mut self.blocks[vertices + coupling as usize], &block, 1.0);
        }
    }
}

/// Which corner of the first triangle (i, j, k), and of the second (j, i, l), each corner of a hinge is.
const OF_FIRST: [Option<usize>; 4] = [Some(0), Some(1), Some(2), None];
const OF_SECOND: [Option<usize>; 4] = [Some(1), Some(0), None, Some(2)];

#[inline]
fn add(sum: &mut Block, block: &Block, factor: f64) {
    let sum = sum.as_flattened_mut().iter_mut();
    sum.zip(block.as_flattened())
        .for_each(|(sum, x)| *sum += factor * x);
}
