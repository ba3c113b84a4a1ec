//! The frame whose edge lengths and dihedral angles are nearest to given ones: a nonlinear least squares over the vertices (Froehlich & Botsch 2011, their
//! equation (3) without the term of volume and with weights 1).
//!
//! x minimises E(x) = sum over edges (|x_j - x_i| - l)^2 + sum over hinges (theta(x) - a)^2 + sum over triangles max(0, ln(A / area(x)))^2, differences of
//! angles modulo 2 pi. The last sum is ours: lengths and angles of no surface would flatten some triangle, at whose flat shape its angles jump, so that E has
//! no minimum there; A is the least area that the triangle keeps without a cost. A step solves
//! (H + damping D) step = -J^T r, r the differences, J their derivatives and D the diagonal of J^T J, by a sparse factorisation whose pattern is analysed
//! once. H is the whole
//! second derivative J^T J + sum r r'' (Newton) where that, damped, is positive definite, and J^T J (Gauss-Newton) where it is not: vectors of no frame
//! leave differences, and Gauss-Newton alone then creeps, as slowly as these times the curvature of the angles are large. Damping follows how well E was predicted
//! (Nielsen 1999). It also holds what E leaves free, the rigid motions of components.

use std::f64::consts::TAU;

use super::ShapeError;
use super::pool::Pool;
use super::reference::check;
use crate::linalg::kernels::dot as product;
use crate::linalg::sparse::{Factor, FactorError, Pattern};
use crate::mesh::dihedral::{Block, Lean, dihedral_angle};
use crate::mesh::vector::{Point, cross, dot, norm, sub};

/// The most factorisations.
const FACTORISATIONS: usize = 100;
/// See [`weight`].
const LEAST_WEIGHT: f64 = 1e-6;
/// The damping to start with, and the least.
const DAMPING: f64 = 1e-6;
const LEAST_DAMPING: f64 = 1e-12;
/// The damping at which a descent has no step left to take, as where E falls towards a triangle without height, at which its angles jump.
const MOST_DAMPING: f64 = 1e4;
/// Differences of so much, root mean square, are rounding.
const ROUNDING: f64 = 1e-12;
/// A step taken lowers E by at least this share of what was predicted.
const GAIN: f64 = 1e-4;
/// E cannot tell steps that lower it by less than this share of itself.
const UNTOLD: f64 = 1e-14;
/// See [`Descent::imbalance`].
const STATIONARY: f64 = 1e-9;

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

/// How a descent ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descent {
    /// E.
    pub energy: f64,
    /// The greatest cosine between the differences and their derivatives by one coordinate: 0 at a stationary frame, and where all differences are rounding.
    pub imbalance: f64,
    /// Sparse factorisations made.
    pub factorisations: usize,
}

impl Descent {
    /// Whether the frame is a stationary one of E, as nearly as rounding lets tell.
    pub fn is_stationary(&self) -> bool {
        self.imbalance <= 1e3 * STATIONARY
    }
}

#[derive(Debug, Default)]
struct Work {
    /// Of edges, of hinges, then of triangles.
    differences: Vec<f64>,
    trial: Vec<Point>,
    trial_differences: Vec<f64>,
    system: System,
    values: Vec<f64>,
    factor: Option<Factor>,
    step: Vec<f64>,
    scratch: Vec<[f64; 1]>,
}

/// Half the derivatives of E.
#[derive(Debug, Default)]
struct System {
    /// J^T r.
    gradient: Vec<Point>,
    /// The diagonal of J^T J.
    squares: Vec<Point>,
    /// H, of every vertex with itself, then of couplings, rows of the smaller vertex.
    blocks: Vec<Block>,
}

/// Which second derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Second {
    Newton,
    GaussNewton,
}

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

    /// Descends from `x` towards the target. O(V) a step beside the factorisation.
    pub fn descend(&self, target: &Target, x: &mut [Point]) -> Result<Descent, ShapeError> {
        self.work.lend(|work| self.descend_with(work, target, x))
    }

    fn descend_with(
        &self,
        work: &mut Work,
        target: &Target,
        x: &mut [Point],
    ) -> Result<Descent, ShapeError> {
        let Work {
            differences,
            trial,
            trial_differences,
            ..
        } = work;
        let mut found = Descent {
            energy: self.differences(target, x, differences),
            imbalance: 0.0,
            factorisations: 0,
        };
        check("frame decoded", x.as_flattened(), 3 * self.vertices)?;
        if !found.energy.is_finite() {
            // A triangle that should have an area has none: there is no way down from here.
            found.imbalance = f64::INFINITY;
            return Ok(found);
        }
        let rounding = ROUNDING * ROUNDING * differences.len() as f64;
        let (mut damping, mut growth) = (DAMPING, 2.0);
        while found.energy > rounding {
            let mut second = Second::Newton;
            self.assemble(x, differences, second, &mut work.system);
            found.imbalance = work.system.imbalance(found.energy);
            if found.imbalance <= STATIONARY {
                return Ok(found);
            }
            // Until a step is taken.
            loop {
                if found.factorisations >= FACTORISATIONS {
                    return Ok(found);
                }
                found.factorisations += 1;
                let step = &mut work.step;
                if let Err(error) = self.step(
                    &work.system,
                    damping,
                    (&mut work.values, &mut work.factor, &mut work.scratch),
                    step,
                ) {
                    match (second, error) {
                        (Second::Newton, FactorError::NotPositiveDefinite { .. }) => {
                            second = Second::GaussNewton;
                            self.assemble(x, differences, second, &mut work.system);
                            continue;
                        }
                        _ => return Ok(found),
                    }
                }
                let gradient = work.system.gradient.as_flattened();
                let slope = product(gradient, step);
                let squares = work.system.squares.as_flattened().iter();
                let held = squares.zip(&*step);
                let square: f64 = held.map(|(s, step)| weight(*s) * step * step).sum();
                let predicted = damping * square - slope;
                trial.clear();
                trial.extend_from_slice(x);
                let moved = trial.as_flattened_mut().iter_mut();
                moved.zip(&*step).for_each(|(x, step)| *x += step);
                let energy = self.differences(target, trial, trial_differences);
                let gain = (found.energy - energy) / predicted;
                let last = predicted <= UNTOLD * found.energy;
                let taken = gain > GAIN || last && energy <= found.energy * (1.0 + UNTOLD);
                if taken {
                    x.copy_from_slice(trial);
                    std::mem::swap(differences, trial_differences);
                    found.energy = energy;
                    let shrink = (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(0.1, 2.0);
                    damping = (damping * shrink).max(LEAST_DAMPING);
                    growth = 2.0;
                }
                if last {
                    self.assemble(x, differences, Second::GaussNewton, &mut work.system);
                    found.imbalance = work.system.imbalance(found.energy);
                    return Ok(found);
                }
                if taken {
                    break;
                }
                damping *= growth;
                growth *= 2.0;
                if damping > MOST_DAMPING {
                    return Ok(found);
                }
            }
        }
        found.imbalance = 0.0;
        Ok(found)
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
        product(out, out)
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

    /// The step with this damping.
    fn step(
        &self,
        system: &System,
        damping: f64,
        (values, factor, scratch): (&mut Vec<f64>, &mut Option<Factor>, &mut Vec<[f64; 1]>),
        step: &mut Vec<f64>,
    ) -> Result<(), FactorError> {
        let (diagonal, others) = system.blocks.split_at(self.vertices);
        values.clear();
        let both = diagonal.iter().zip(&system.squares);
        values.extend(both.flat_map(|(block, squares)| {
            LOWER.map(|[r, c]| {
                block[r][c]
                    + match r == c {
                        true => damping * weight(squares[r]),
                        false => 0.0,
                    }
            })
        }));
        values.extend(others.iter().flat_map(|block| block.as_flattened()));
        match factor {
            Some(factor) => factor.refactor(values)?,
            None => *factor = Some(self.pattern.factor(values)?),
        }
        step.clear();
        step.extend(system.gradient.as_flattened().iter().map(|x| -x));
        if let Some(factor) = factor {
            factor.solve1(step, scratch);
        }
        Ok(())
    }
}

/// Rows and columns of the lower triangle of a block.
const LOWER: [[usize; 2]; 6] = [[0, 0], [1, 0], [1, 1], [2, 0], [2, 1], [2, 2]];

/// How much damping holds a coordinate beside another: as much as E does (Marquardt 1963), and a little where E does not.
fn weight(square: f64) -> f64 {
    square + LEAST_WEIGHT
}

impl System {
    fn clear(&mut self, vertices: usize, couplings: usize) {
        for points in [&mut self.gradient, &mut self.squares] {
            points.clear();
            points.resize(vertices, [0.0; 3]);
        }
        self.blocks.clear();
        self.blocks.resize(vertices + couplings, [[0.0; 3]; 3]);
    }

    /// See [`Descent::imbalance`].
    fn imbalance(&self, energy: f64) -> f64 {
        let both = self.gradient.as_flattened().iter();
        let both = both.zip(self.squares.as_flattened());
        let cosine = |(g, square): (&f64, &f64)| g.abs() / (square * energy).sqrt();
        both.map(cosine).fold(0.0, f64::max)
    }

    /// With the unit direction u: r' = (-u, u), r'' = (1 - u u^T) / length.
    #[inline]
    fn add_edge(&mut self, edge: &Edge, x: &[Point], r: f64, second: Second) {
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
    fn add_bend(&mut self, bend: &Bend, x: &[Point], r: f64, second: Second) {
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
    fn add_triangle(&mut self, triangle: &Triangle, x: &[Point], r: f64, second: Second) {
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
