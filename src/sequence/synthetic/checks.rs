//! What the tests of the embedded sequences measure.

use std::collections::HashMap;

use nalgebra::Vector3;

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

/// V - E + F and the number of boundary edges of a connected, oriented manifold without unused vertices; panics when it is none.
fn euler(sequence: &Sequence) -> (isize, usize) {
    let mesh = sequence.connectivity();
    let edges = directed_edges(sequence);
    assert!(
        edges.values().all(|&n| n == 1),
        "an edge is used twice in one direction"
    );
    let boundary = edges
        .keys()
        .filter(|&&(a, b)| !edges.contains_key(&(b, a)))
        .count();
    let undirected = (edges.len() + boundary) / 2;
    assert_eq!(components(sequence), 1);
    assert!(
        fans_are_single(sequence),
        "two fans of triangles meet at one vertex only"
    );
    let (v, e, f) = (mesh.vertex_count(), undirected, mesh.faces().len());
    (v as isize - e as isize + f as isize, boundary)
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

fn components(sequence: &Sequence) -> usize {
    let mut root: Vec<usize> = (0..sequence.connectivity().vertex_count()).collect();
    for &[a, b, c] in sequence.connectivity().faces() {
        for (from, to) in [(a, b), (b, c)] {
            let (from, to) = (find(&mut root, from as usize), find(&mut root, to as usize));
            root[from] = to;
        }
    }
    (0..root.len()).filter(|&v| root[v] == v).count()
}

fn find(root: &mut [usize], mut v: usize) -> usize {
    while root[v] != v {
        root[v] = root[root[v]];
        v = root[v];
    }
    v
}

/// Whether the triangles at each vertex hang together by edges: one walk from a triangle reaches as many as there are.
fn fans_are_single(sequence: &Sequence) -> bool {
    let mut next = HashMap::new();
    let mut degree = vec![0; sequence.connectivity().vertex_count()];
    let mut start = vec![None; degree.len()];
    for &[a, b, c] in sequence.connectivity().faces() {
        for (v, from, to) in [(a, b, c), (b, c, a), (c, a, b)] {
            next.insert((v, from), to);
            degree[v as usize] += 1;
            start[v as usize] = start[v as usize].or(Some(from));
        }
    }
    let previous: HashMap<_, _> = next
        .iter()
        .map(|(&(v, from), &to)| ((v, to), from))
        .collect();
    (0..degree.len()).all(|v| {
        let Some(first) = start[v] else { return false };
        let mut head = first;
        while let Some(&before) = previous.get(&(v as u32, head)) {
            head = before;
            if head == first {
                break;
            }
        }
        let (mut at, mut count) = (head, 0);
        while let Some(&after) = next.get(&(v as u32, at)) {
            (at, count) = (after, count + 1);
            if at == head {
                break;
            }
        }
        count == degree[v]
    })
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
