//! What the tests of the embedded sequences measure.

use std::collections::HashMap;

use nalgebra::Vector3;

use crate::mesh::topology::{self, HalfEdge, Topology, linked};
use crate::sequence::Sequence;

/// The vertices of one frame.
pub(super) fn points(frame: &[f64]) -> Vec<Vector3<f64>> {
    frame
        .chunks_exact(3)
        .map(Vector3::from_column_slice)
        .collect()
}

/// How often each directed edge occurs.
fn directed_edges(sequence: &Sequence) -> HashMap<(u32, u32), usize> {
    let mut edges = HashMap::new();
    for &[a, b, c] in sequence.connectivity().faces() {
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_insert(0) += 1;
        }
    }
    edges
}

/// What a connected manifold without unused vertices is like.
pub(super) struct Manifold {
    /// V - E + F.
    pub characteristic: isize,
    /// Number of edges with one triangle.
    pub boundary: usize,
    /// Whether its triangles can be turned round so that they all face the same side.
    pub orientable: bool,
}

/// Panics when the triangles are no connected manifold or leave a vertex out.
pub(super) fn manifold(sequence: &Sequence) -> Manifold {
    let mesh = sequence.connectivity();
    let (vertices, faces) = (mesh.vertex_count(), mesh.faces());
    let topology = Topology::new(faces);
    assert_eq!(topology.non_manifold().count(), 0);
    assert_eq!(components(sequence), 1);
    assert_eq!(
        fans(&topology, faces),
        vertices,
        "two fans of triangles meet at one vertex only"
    );
    Manifold {
        characteristic: vertices as isize - topology.edges().len() as isize + faces.len() as isize,
        boundary: topology.boundary().count(),
        orientable: sides(&topology, faces.len()) == 2,
    }
}

/// How many fans of triangles there are: corners of one vertex hang together where their triangles share an edge.
fn fans(topology: &Topology, faces: &[[u32; 3]]) -> usize {
    let corner = |half: HalfEdge, vertex: u32| {
        let own = faces[half.triangle as usize]
            .iter()
            .position(|&v| v == vertex);
        3 * half.triangle + own.unwrap() as u32
    };
    let links = topology.pairs().flat_map(|pair| {
        let ends = topology.edges()[pair.edge as usize];
        ends.map(|v| [corner(pair.first, v), corner(pair.second, v)])
    });
    linked(3 * faces.len(), links).1
}

/// How many sides a connected surface has: each triangle has two, and neighbours are glued side to side.
fn sides(topology: &Topology, faces: usize) -> usize {
    let links = topology.pairs().flat_map(|pair| {
        let flips = u32::from(pair.first.ascending == pair.second.ascending);
        let (a, b) = (2 * pair.first.triangle, 2 * pair.second.triangle);
        [[a, b + flips], [a + 1, b + 1 - flips]]
    });
    linked(2 * faces, links).1
}

/// V - E + F and the number of boundary edges of a connected, oriented manifold without unused vertices; panics when it is none.
fn euler(sequence: &Sequence) -> (isize, usize) {
    assert!(
        directed_edges(sequence).values().all(|&n| n == 1),
        "an edge is used twice in one direction"
    );
    let found = manifold(sequence);
    (found.characteristic, found.boundary)
}

/// Asserts a closed, connected, oriented manifold of genus 0 that faces outward and has no zero-area face in any frame.
pub(super) fn assert_sphere(sequence: &Sequence) {
    assert_eq!(euler(sequence), (2, 0));
    for i in 0..sequence.frame_count() {
        assert!(volume(sequence, i) > 0.0, "frame {i}");
        assert!(smallest_area(sequence, i) > 0.0, "frame {i}");
    }
}

/// Asserts a connected, oriented manifold with one boundary and no handle.
pub(super) fn assert_disc(sequence: &Sequence) {
    let (characteristic, boundary) = euler(sequence);
    assert_eq!(characteristic, 1);
    assert!(boundary > 0);
}

/// How many parts hang together by triangles.
pub(super) fn components(sequence: &Sequence) -> usize {
    let mesh = sequence.connectivity();
    topology::components(mesh.vertex_count(), mesh.faces()).1
}

/// The volume enclosed in a frame, positive when the faces look outward.
pub(super) fn volume(sequence: &Sequence, frame: usize) -> f64 {
    triangles(sequence, frame)
        .map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0)
        .sum()
}

/// The sum of the area vectors of a frame.
pub(super) fn area_vector(sequence: &Sequence, frame: usize) -> Vector3<f64> {
    triangles(sequence, frame)
        .map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)))
        .sum()
}

fn smallest_area(sequence: &Sequence, frame: usize) -> f64 {
    triangles(sequence, frame)
        .map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)).norm())
        .fold(f64::INFINITY, f64::min)
}

/// The least quality of a triangle of a frame: area over the sum of its squared sides, 1 when equilateral and 0 when degenerate.
pub(super) fn thinnest(sequence: &Sequence, frame: usize) -> f64 {
    let quality = |[a, b, c]: [Vector3<f64>; 3]| {
        let squares = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
        12.0_f64.sqrt() * (b - a).cross(&(c - a)).norm() / squares
    };
    triangles(sequence, frame)
        .map(quality)
        .fold(f64::INFINITY, f64::min)
}

fn triangles(sequence: &Sequence, frame: usize) -> impl Iterator<Item = [Vector3<f64>; 3]> {
    let points = points(sequence.frame(frame));
    let faces = sequence.connectivity().faces().iter();
    faces.map(move |face| face.map(|v| points[v as usize]))
}

/// The largest |length / rest length - 1| over all edges and frames.
pub(super) fn largest_stretch(sequence: &Sequence, rest: &[Vector3<f64>]) -> f64 {
    let edges = directed_edges(sequence);
    let mut worst: f64 = 0.0;
    for i in 0..sequence.frame_count() {
        let now = points(sequence.frame(i));
        for &(a, b) in edges.keys() {
            let length = |p: &[Vector3<f64>]| (p[a as usize] - p[b as usize]).norm();
            worst = worst.max((length(&now) / length(rest) - 1.0).abs());
        }
    }
    worst
}

/// The root of the sum of squared distances between the vertices of two frames.
pub(super) fn distance(sequence: &Sequence, i: usize, j: usize) -> f64 {
    let pairs = sequence.frame(i).iter().zip(sequence.frame(j));
    pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// How far the fastest vertex moves from frame `frame - 1` to `frame`.
pub(super) fn largest_step(sequence: &Sequence, frame: usize) -> f64 {
    let (before, after) = (
        points(sequence.frame(frame - 1)),
        points(sequence.frame(frame)),
    );
    before
        .iter()
        .zip(&after)
        .map(|(p, q)| (p - q).norm())
        .fold(0.0, f64::max)
}

/// The diagonal of the bounding box of a frame.
pub(super) fn diagonal(frame: &[f64]) -> f64 {
    let points = points(frame);
    let low = points.iter().fold(points[0], |a, b| a.inf(b));
    let high = points.iter().fold(points[0], |a, b| a.sup(b));
    (high - low).norm()
}
