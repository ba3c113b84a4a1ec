//! The surface of an implicit solid as a triangle mesh.
//!
//! Surface nets (Gibson 1998): one vertex for each cell of a grid that the surface crosses, one quad for each crossed edge of the grid.
//! Two sheets of surface in one cell would pinch the mesh there, so nodes that are nearly on the surface change sides first until each cell
//! holds one sheet at most: the mesh is a closed manifold. Vertices then spread along the surface, so that triangles come out even, and are
//! projected back to it. The order of vertices is that of the cells.

use nalgebra::Vector3;

use super::grid;
use super::implicit::Solid;

/// A closed triangle mesh that faces outward.
pub(super) struct Surface {
    pub points: Vec<Vector3<f64>>,
    pub faces: Vec<[u32; 3]>,
}

impl Surface {
    /// Splits longest edges, each in its middle moved to the surface of `solid`, until there are `vertices` of them: O(F) each.
    pub fn refine(&mut self, solid: &Solid, vertices: usize) {
        while self.points.len() < vertices {
            self.split(self.longest_edge(), solid);
        }
    }

    /// The first edge of greatest length, in the order of the faces.
    fn longest_edge(&self) -> [u32; 2] {
        let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        let square =
            |[a, b]: [u32; 2]| (self.points[a as usize] - self.points[b as usize]).norm_squared();
        let longer = |best: ([u32; 2], f64), edge: [u32; 2]| match square(edge) > best.1 {
            true => (edge, square(edge)),
            false => best,
        };
        let edges = self.faces.iter().flat_map(sides);
        edges.fold(([0, 0], 0.0), longer).0
    }

    fn split(&mut self, [a, b]: [u32; 2], solid: &Solid) {
        let middle = self.points.len() as u32;
        let halfway = 0.5 * (self.points[a as usize] + self.points[b as usize]);
        self.points.push(solid.project(halfway, 2));
        for face in 0..self.faces.len() {
            let corners = self.faces[face];
            if corners.contains(&a) && corners.contains(&b) {
                let with = |old: u32| corners.map(|v| if v == old { middle } else { v });
                self.faces[face] = with(a);
                self.faces.push(with(b));
            }
        }
    }
}

const NONE: u32 = u32::MAX;
const RELAXATIONS: usize = 8;

/// Meshes `solid` on a grid of cells of side `spacing`.
pub(super) fn polygonise(solid: &Solid, spacing: f64) -> Surface {
    let lattice = Lattice::new(solid, spacing);
    let (cells, mut points) = lattice.vertices();
    let quads = lattice.quads(&cells);
    for _ in 0..RELAXATIONS {
        relax(solid, &triangulate(&quads, &points), &mut points);
    }
    let faces = triangulate(&quads, &points);
    Surface { points, faces }
}

/// Cuts each quad along its shorter diagonal.
fn triangulate(quads: &[[u32; 4]], points: &[Vector3<f64>]) -> Vec<[u32; 3]> {
    let split = |quad: &[u32; 4]| {
        let [a, b, c, d] = quad.map(|v| points[v as usize]);
        grid::split(*quad, (a - c).norm() <= (b - d).norm())
    };
    quads.iter().flat_map(split).collect()
}

/// The values of a solid at the nodes of a grid, x fastest.
struct Lattice {
    low: Vector3<f64>,
    spacing: f64,
    nodes: [usize; 3],
    values: Vec<f64>,
}

impl Lattice {
    fn new(solid: &Solid, spacing: f64) -> Self {
        let [low, high] = solid.bounds();
        let low = low - Vector3::repeat(1.5 * spacing);
        let size = (high - low) / spacing;
        let nodes = [size.x, size.y, size.z].map(|cells| cells.ceil() as usize + 3);
        let mut lattice = Self {
            low,
            spacing,
            nodes,
            values: Vec::new(),
        };
        lattice.values = (0..nodes.iter().product())
            .map(|index| solid.value(&lattice.place(lattice.unravel(index))))
            .collect();
        lattice.part_sheets();
        lattice
    }

    /// Moves nodes to the other side of the surface until each cell holds one sheet at most.
    fn part_sheets(&mut self) {
        const PASSES: usize = 20;
        for _ in 0..PASSES {
            let mut changed = false;
            for index in 0..self.values.len() {
                if self.has_cell(index) && !is_one_sheet(self.inside(index)) {
                    self.move_one_corner(index);
                    changed = true;
                }
            }
            if !changed {
                return;
            }
        }
    }

    /// Moves the corner nearest to the surface among those that leave one sheet, or among all where none does.
    fn move_one_corner(&mut self, lowest: usize) {
        let (corners, inside) = (self.corners(lowest), self.inside(lowest));
        let cost = |&corner: &usize| {
            let helps = is_one_sheet(inside ^ 1 << corner);
            (!helps, self.values[corners[corner]].abs())
        };
        let order = |a: &usize, b: &usize| {
            cost(a)
                .0
                .cmp(&cost(b).0)
                .then(cost(a).1.total_cmp(&cost(b).1))
        };
        if let Some(corner) = (0..8).min_by(order) {
            let value = &mut self.values[corners[corner]];
            // a node on the surface itself counts as outside
            *value = if *value == 0.0 {
                -f64::MIN_POSITIVE
            } else {
                -*value
            };
        }
    }

    /// Whether a cell has this lowest node: no node at the upper ends of the grid has one.
    fn has_cell(&self, lowest: usize) -> bool {
        let at = self.unravel(lowest);
        (0..3).all(|axis| at[axis] + 1 < self.nodes[axis])
    }

    /// The corners of a cell, number x + 2 y + 4 z.
    fn corners(&self, lowest: usize) -> [usize; 8] {
        let along = |corner: usize, axis: usize| (corner >> axis & 1) * self.stride(axis);
        std::array::from_fn(|corner| {
            lowest + along(corner, 0) + along(corner, 1) + along(corner, 2)
        })
    }

    /// One bit for each corner of a cell that is inside.
    fn inside(&self, lowest: usize) -> u8 {
        let corners = self.corners(lowest).into_iter().enumerate();
        corners.fold(0, |bits, (corner, node)| {
            bits | u8::from(self.values[node] < 0.0) << corner
        })
    }

    fn unravel(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.nodes;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    fn stride(&self, axis: usize) -> usize {
        self.nodes[..axis].iter().product()
    }

    fn place(&self, at: [usize; 3]) -> Vector3<f64> {
        self.low + Vector3::from(at.map(|i| i as f64)) * self.spacing
    }

    /// For each cell (by its lowest node) the index of its vertex or [`NONE`], and the vertices.
    fn vertices(&self) -> (Vec<u32>, Vec<Vector3<f64>>) {
        let mut cells = vec![NONE; self.values.len()];
        let mut points = Vec::new();
        for (index, cell) in cells.iter_mut().enumerate() {
            if self.has_cell(index)
                && let Some(point) = self.cell_vertex(index)
            {
                *cell = points.len() as u32;
                points.push(point);
            }
        }
        (cells, points)
    }

    /// The mean of the points where the surface crosses the edges of a cell.
    fn cell_vertex(&self, lowest: usize) -> Option<Vector3<f64>> {
        let (mut sum, mut count) = (Vector3::zeros(), 0);
        for axis in 0..3 {
            let (b, c) = (self.stride((axis + 1) % 3), self.stride((axis + 2) % 3));
            for node in [0, b, c, b + c].map(|offset| lowest + offset) {
                let (f, g) = (self.values[node], self.values[node + self.stride(axis)]);
                if (f < 0.0) != (g < 0.0) {
                    let step = Vector3::ith(axis, self.spacing * f / (f - g));
                    sum += self.place(self.unravel(node)) + step;
                    count += 1;
                }
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }

    /// One quad of four cells around each crossed edge, outward.
    fn quads(&self, cells: &[u32]) -> Vec<[u32; 4]> {
        let mut quads = Vec::new();
        for node in 0..self.values.len() {
            for axis in 0..3 {
                quads.extend(self.quad(cells, node, axis));
            }
        }
        quads
    }

    fn quad(&self, cells: &[u32], node: usize, axis: usize) -> Option<[u32; 4]> {
        let at = self.unravel(node);
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        if at[axis] + 1 >= self.nodes[axis] || at[b] == 0 || at[c] == 0 {
            return None;
        }
        let from_inside = self.values[node] < 0.0;
        if from_inside == (self.values[node + self.stride(axis)] < 0.0) {
            return None;
        }
        let (b, c) = (self.stride(b), self.stride(c));
        let mut quad = [node - b - c, node - c, node, node - b].map(|cell| cells[cell]);
        if !from_inside {
            quad.reverse();
        }
        Some(quad)
    }
}

/// Whether the corners inside hang together along edges of the cell, and those outside do too: then the surface in it is one disc at most.
fn is_one_sheet(inside: u8) -> bool {
    hangs_together(inside) && hangs_together(!inside)
}

fn hangs_together(corners: u8) -> bool {
    let mut reached = corners & corners.wrapping_neg();
    for _ in 0..8 {
        let x = (reached & 0x55) << 1 | (reached & 0xaa) >> 1;
        let y = (reached & 0x33) << 2 | (reached & 0xcc) >> 2;
        let z = reached.rotate_left(4);
        reached |= (x | y | z) & corners;
    }
    reached == corners
}

/// Moves each vertex half way towards the mean of its neighbours, along the surface.
fn relax(solid: &Solid, faces: &[[u32; 3]], points: &mut [Vector3<f64>]) {
    let mut sums = vec![(Vector3::zeros(), 0.0); points.len()];
    for face in faces {
        for i in 0..3 {
            let sum = &mut sums[face[i] as usize];
            *sum = (sum.0 + points[face[(i + 1) % 3] as usize], sum.1 + 1.0);
        }
    }
    for (point, (sum, count)) in points.iter_mut().zip(sums) {
        let normal = solid.gradient(point).normalize();
        let step = sum / count - *point;
        *point = solid.project(*point + 0.5 * (step - normal * normal.dot(&step)), 1);
    }
}

#[cfg(test)]
mod tests {
    use super::super::implicit::Cone;
    use super::*;

    #[test]
    fn cells_of_one_sheet_are_told_from_others() {
        let one = [
            0b0000_0000,
            0b1111_1111,
            0b0000_0001,
            0b0000_1111,
            0b0001_0111,
            0b1011_0001,
        ];
        let more = [
            0b0000_1001,
            0b1000_0001,
            0b0111_1110,
            0b1111_0110,
            0b1111_1001,
        ];
        assert!(one.into_iter().all(is_one_sheet));
        assert!(!more.into_iter().any(is_one_sheet));
        assert_eq!((0..=255).filter(|&bits| is_one_sheet(bits)).count(), 128);
    }

    fn ball(spacing: f64) -> (Solid, Surface) {
        let cone = Cone {
            from: Vector3::zeros(),
            to: Vector3::x() * 1e-3,
            from_radius: 1.0,
            to_radius: 1.0,
            flatten: 1.0,
            blend: 0.1,
        };
        let solid = Solid { cones: vec![cone] };
        let surface = polygonise(&solid, spacing);
        (solid, surface)
    }

    fn area(surface: &Surface) -> f64 {
        let area = |[a, b, c]: [Vector3<f64>; 3]| 0.5 * (b - a).cross(&(c - a)).norm();
        let triangles = surface
            .faces
            .iter()
            .map(|face| face.map(|v| surface.points[v as usize]));
        triangles.map(area).sum()
    }

    #[test]
    fn a_refined_ball_has_as_many_vertices_as_asked_for_and_stays_a_ball() {
        let (solid, mut surface) = ball(0.3);
        let (before, edge) = (surface.points.len(), surface.longest_edge());
        surface.refine(&solid, before);
        assert_eq!(surface.longest_edge(), edge);
        surface.refine(&solid, before + 50);
        assert_eq!(surface.points.len(), before + 50);
        assert_eq!(surface.faces.len(), 2 * surface.points.len() - 4);
        assert!(surface.points.iter().all(|p| solid.value(p).abs() < 1e-6));
        let outward = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| surface.points[v as usize]);
            (b - a).cross(&(c - a)).dot(&(a + b + c)) > 0.0
        };
        assert!(surface.faces.iter().all(outward));
        let grown = area(&surface) / area(&ball(0.3).1);
        assert!((1.0..1.05).contains(&grown), "{grown}");
    }

    #[test]
    fn a_ball_has_the_area_of_a_ball() {
        let total = area(&ball(0.1).1);
        assert!(
            (total / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.01,
            "{total}"
        );
    }
}
