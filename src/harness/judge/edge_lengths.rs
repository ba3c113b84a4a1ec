//! Edge lengths and dihedral angles, measured again; frames decoded from them beside where they came from, and how nearly stationary they are.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector3};

use super::Measured;
use super::encoding::{Mesh, Vertices, decoded_own, edges, paired_rows, placement_difference};
use super::forms::{
    PairPlace, dihedral, fans, in_plane, pairs_at, parts_gap, placement_gap, turn_gap,
};
use crate::arrays::{ArrayError, Bundle};

/// Differences of so much, root mean square, are rounding and have no direction.
const ROUNDING: f64 = 1e-10;

/// The share of the area of the given lengths below which a triangle counts (PROTOCOL.md).
const LEAST_AREA: f64 = 0.1;

/// Where the numbers of a mesh are in z.
struct Layout {
    /// Edges with the place of their length.
    lengths: Vec<([u32; 2], usize)>,
    pairs: Vec<PairPlace>,
    /// The component of each vertex.
    owners: Vec<usize>,
    /// Where the six numbers of the first component are.
    components: usize,
}

impl Layout {
    fn new(mesh: &Mesh) -> Self {
        let mut owners = vec![0; mesh.reference.len()];
        for (i, vertices) in mesh.components().iter().enumerate() {
            vertices.iter().for_each(|&v| owners[v] = i);
        }
        let mut layout = Self {
            lengths: Vec::new(),
            pairs: Vec::new(),
            owners,
            components: 0,
        };
        for (edge, fan) in fans(&mesh.faces) {
            let start = layout.components;
            layout.lengths.push((edge, start));
            layout.pairs.extend(pairs_at(mesh, &fan, start + 1));
            layout.components += fan.len().max(2);
        }
        layout
    }

    /// The mean edge length of the reference.
    fn unit(&self, reference: Vertices) -> f64 {
        let lengths = self
            .lengths
            .iter()
            .map(|(ends, _)| chord(reference, *ends).norm());
        lengths.sum::<f64>() / self.lengths.len() as f64
    }

    /// Whether an edge is inside a component; others have no say in decoding.
    fn inside(&self, ends: &[u32; 2]) -> bool {
        let [a, b] = ends.map(|v| self.owners[v as usize]);
        a == b
    }

    /// The place of the length of an edge.
    fn place(&self, a: u32, b: u32) -> usize {
        let edge = [a.min(b), a.max(b)];
        let found = self.lengths.binary_search_by_key(&edge, |(edge, _)| *edge);
        found.map_or(usize::MAX, |at| self.lengths[at].1)
    }

    fn sound_pairs<'a>(&'a self, mesh: &'a Mesh) -> impl Iterator<Item = &'a PairPlace> {
        let sound = |f: usize| mesh.is_sound(&mesh.faces[f]);
        let pairs = self.pairs.iter();
        pairs.filter(move |pair| pair.triangles.into_iter().all(sound))
    }
}

fn chord(frame: Vertices, [a, b]: [u32; 2]) -> Vector3<f64> {
    Vector3::from(frame[b as usize]) - Vector3::from(frame[a as usize])
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let mesh = Mesh::new(inputs)?;
    let layout = Layout::new(&mesh);
    let (components, further) = (mesh.components(), mesh.further_parts());
    let unit = layout.unit(mesh.reference);
    let d = layout.components + 6 * components.len() + 3 * further.len();
    let (mut lengths, mut angles, mut placed) = (0.0f64, 0.0f64, 0.0f64);
    for (frame, z) in mesh.rows(inputs, outputs, d)? {
        // What no length and no angle of sound triangles takes is 0.
        let mut rest = z[..layout.components].to_vec();
        for &(ends, place) in &layout.lengths {
            let gap = (unit * z[place] - chord(frame, ends).norm()).abs();
            lengths = lengths.max(gap / mesh.diagonal);
            rest[place] = 0.0;
        }
        for pair in layout.sound_pairs(&mesh) {
            let expected = dihedral(frame, &mesh.faces, pair);
            angles = angles.max(turn_gap(z[pair.place], expected));
            rest[pair.place] = 0.0;
        }
        lengths = rest.iter().fold(lengths, |most, x| most.max(x.abs()));
        let six = z[layout.components..].chunks_exact(6);
        let form = |f: usize| {
            let [then, now] = [mesh.reference, frame].map(|at| edges(at, &mesh.faces[f]));
            root_of(in_plane(now) * inverse(in_plane(then)))
        };
        for (vertices, numbers) in components.iter().zip(six) {
            placed = placed.max(placement_gap(&mesh, vertices, frame, numbers, form));
        }
        let parts = &z[layout.components..];
        placed = placed.max(parts_gap(&mesh, &components, &further, frame, parts, form));
    }
    Ok(vec![
        ("lengths", lengths),
        ("angles", angles),
        ("placement", placed),
    ])
}

/// The area of a triangle with these sides, 0 where they make none.
fn heron([a, b, c]: [f64; 3]) -> f64 {
    let s = 0.5 * (a + b + c);
    (s * (s - a) * (s - b) * (s - c)).max(0.0).sqrt()
}

fn inverse(m: Matrix2<f64>) -> Matrix2<f64> {
    m.try_inverse().unwrap_or_else(Matrix2::identity)
}

/// U of F = R U: the root of F^T F, by Cayley & Hamilton.
fn root_of(f: Matrix2<f64>) -> Matrix2<f64> {
    let (square, det) = (f.transpose() * f, f.determinant().abs());
    (square + Matrix2::identity() * det) / (square.trace() + 2.0 * det).sqrt()
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let mesh = Mesh::new(inputs)?;
    let (layout, components) = (Layout::new(&mesh), mesh.components().len());
    let (mut lengths, mut angles, mut placed) = (0.0f64, 0.0f64, 0.0f64);
    for (a, b) in paired_rows(ours, theirs)? {
        for (_, place) in &layout.lengths {
            lengths = lengths.max((a[*place] - b[*place]).abs());
        }
        for pair in &layout.pairs {
            angles = angles.max(turn_gap(a[pair.place], b[pair.place]));
        }
        let [a, b] = [a, b].map(|z| &z[layout.components..]);
        placed = placed.max(placement_difference(a, b, components));
    }
    Ok(vec![
        ("length_difference", lengths),
        ("angle_difference", angles),
        ("placement_difference", placed),
    ])
}

/// The first frames are those that z came from; the others are stationary frames of the squared differences.
pub fn descended_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let mut found = decoded_own(inputs, outputs)?;
    let mesh = Mesh::new(inputs)?;
    let layout = Layout::new(&mesh);
    let (shape, z) = inputs.f64("z", 2)?;
    let frames = outputs.f64("frames", 3)?.1;
    let rows = z.chunks_exact(shape[1].max(1));
    let frames = frames.chunks_exact((3 * mesh.reference.len()).max(1));
    let (mut slope, mut left) = (0.0f64, 0.0f64);
    for (frame, z) in frames.zip(rows) {
        let [cosine, rms] = stationarity(&mesh, &layout, frame.as_chunks().0, z);
        slope = slope.max(cosine);
        left = left.max(rms);
    }
    found.push(("stationarity", slope));
    found.push(("difference_left", left));
    Ok(found)
}

/// The greatest cosine between the differences and their derivatives by one coordinate, in mean edge lengths and radians; and the differences' root mean
/// square.
fn stationarity(mesh: &Mesh, layout: &Layout, frame: Vertices, z: &[f64]) -> [f64; 2] {
    let unit = layout.unit(mesh.reference);
    let mut slopes = vec![[Vector3::zeros(); 2]; frame.len()];
    let (mut energy, mut count) = (0.0, 0.0);
    let mut add = |difference: f64, derivatives: &[(u32, Vector3<f64>)]| {
        energy += difference * difference;
        count += 1.0;
        for &(vertex, by) in derivatives {
            let [slope, square] = &mut slopes[vertex as usize];
            *slope += difference * by;
            *square += by.component_mul(&by);
        }
    };
    for &(ends, place) in layout
        .lengths
        .iter()
        .filter(|(ends, _)| layout.inside(ends))
    {
        let along = chord(frame, ends);
        let direction = along.normalize();
        add(
            along.norm() / unit - z[place],
            &[(ends[0], -direction), (ends[1], direction)],
        );
    }
    for pair in layout.sound_pairs(mesh) {
        let gap = dihedral(frame, &mesh.faces, pair) - z[pair.place];
        let [i, j] = pair.edge;
        let e = chord(frame, [i, j]) / unit;
        // The vertex across turns the angle by -1 over its height; the ends of the edge balance it.
        let part = |triangle: usize| {
            let across = mesh.faces[triangle]
                .iter()
                .copied()
                .find(|v| ![i, j].contains(v));
            let k = across.unwrap_or(i);
            let p = chord(frame, [i, k]) / unit;
            let (height, s) = (
                (p - e * (p.dot(&e) / e.norm_squared())).norm(),
                p.dot(&e) / e.norm_squared(),
            );
            (k, p, height, s)
        };
        let [f, g] = pair.triangles.map(part);
        let (up, down) = (
            e.cross(&f.1).normalize() / f.2,
            g.1.cross(&e).normalize() / g.2,
        );
        add(
            gap - TAU * (gap / TAU).round(),
            &[
                (f.0, -up),
                (g.0, -down),
                (i, up * (1.0 - f.3) + down * (1.0 - g.3)),
                (j, up * f.3 + down * g.3),
            ],
        );
    }
    for face in mesh.faces.iter().filter(|face| mesh.is_sound(face)) {
        let [a, b, c] = *face;
        let side = |a: u32, b: u32| z[layout.place(a, b)];
        let least = LEAST_AREA * heron([side(a, b), side(b, c), side(c, a)]);
        let [e, p] = edges(frame, face).map(|e| e / unit);
        let normal = e.cross(&p);
        let area = 0.5 * normal.norm();
        if area < least {
            // The area grows where a corner moves away from the side across.
            let away = |side: Vector3<f64>| normal.normalize().cross(&side) / (2.0 * area);
            add(
                (least / area).ln(),
                &[(a, -away(p - e)), (b, -away(-p)), (c, -away(e))],
            );
        }
    }
    let rms = (energy / f64::max(count, 1.0)).sqrt();
    if rms <= ROUNDING {
        return [0.0, rms];
    }
    // A triangle without an area has no derivatives: a frame that has one is not stationary.
    let cosine = |slope: f64, square: f64| {
        let cosine = slope.abs() / (square * energy).sqrt();
        if cosine.is_nan() {
            f64::INFINITY
        } else {
            cosine
        }
    };
    let all = slopes
        .iter()
        .flat_map(|[slope, square]| slope.iter().zip(square.iter()));
    let held = all.filter(|(_, square)| **square != 0.0);
    [
        held.map(|(slope, square)| cosine(*slope, *square))
            .fold(0.0, f64::max),
        rms,
    ]
}
