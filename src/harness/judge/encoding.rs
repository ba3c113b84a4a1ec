//! Shape spaces: encodings put back together by their formulas, compared up to the branches of their angles; frames decoded beside where they
//! came from.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::{Measured, diagonal, greatest, shaped, share};
use crate::arrays::{ArrayError, Bundle};

/// Reference triangles no higher than this over their longest edge, squared, are degenerate (PROTOCOL.md).
const DEGENERATE: f64 = 1e-5;

/// A frame's vertices.
pub(super) type Vertices<'a> = &'a [[f64; 3]];

pub(super) struct Mesh<'a> {
    pub reference: Vertices<'a>,
    pub faces: Vec<[u32; 3]>,
    pub diagonal: f64,
}

impl<'a> Mesh<'a> {
    pub fn new(inputs: &'a Bundle) -> Result<Self, ArrayError> {
        let (shape, reference) = inputs.f64("reference", 2)?;
        shaped(inputs, "reference", &[shape[0], 3])?;
        Ok(Self {
            reference: reference.as_chunks().0,
            faces: inputs.triangles("F")?,
            diagonal: diagonal(reference, 3),
        })
    }

    /// Whether the reference's triangle has a gradient.
    pub fn is_sound(&self, face: &[u32; 3]) -> bool {
        let e = edges(self.reference, face);
        let longest = [e[0], e[1], e[1] - e[0]].map(|e| e.norm_squared());
        e[0].cross(&e[1]).norm() > DEGENERATE * longest.into_iter().fold(0.0, f64::max)
    }

    /// Rows of d numbers of an encoding, with their frames.
    pub fn rows<'b>(
        &self,
        inputs: &'b Bundle,
        outputs: &'b Bundle,
        d: usize,
    ) -> Result<Vec<(Vertices<'b>, &'b [f64])>, ArrayError> {
        let vertices = self.reference.len();
        let n = inputs.f64("frames", 3)?.0[0];
        let frames = shaped(inputs, "frames", &[n, vertices, 3])?;
        let z = shaped(outputs, "z", &[n, d])?;
        let frames = frames.chunks_exact((3 * vertices).max(1));
        let frames = frames.map(|f| f.as_chunks().0);
        Ok(frames.zip(z.chunks_exact(d.max(1))).collect())
    }

    /// How far three numbers are from the mean of these vertices over the diagonal.
    pub fn centre_gap(&self, frame: Vertices, vertices: &[usize], found: &[f64]) -> f64 {
        let sum: Vector3<f64> = vertices.iter().map(|&v| Vector3::from(frame[v])).sum();
        let centre = sum / (vertices.len() as f64 * self.diagonal);
        (centre - Vector3::from_column_slice(found)).amax()
    }

    /// The lowest member that each is joined to by these groups: labels sink along groups until none changes.
    pub fn lowest_joined(count: usize, groups: &[Vec<usize>]) -> Vec<usize> {
        let mut label: Vec<usize> = (0..count).collect();
        let mut changed = true;
        while changed {
            changed = false;
            for group in groups.iter().chain(groups.iter().rev()) {
                let least = group.iter().map(|&v| label[v]).min().unwrap_or(0);
                for &v in group {
                    changed |= label[v] != least;
                    label[v] = least;
                }
            }
        }
        label
    }

    /// The further parts, each as its lowest triangle and that of its component: parts are sound triangles that edges join.
    pub fn further_parts(&self) -> Vec<(usize, usize)> {
        let sound = |f: &usize| self.is_sound(&self.faces[*f]);
        let mut at: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        for f in (0..self.faces.len()).filter(sound) {
            let [a, b, c] = self.faces[f];
            for [a, b] in [[a, b], [b, c], [c, a]] {
                at.entry([a.min(b), a.max(b)]).or_default().push(f);
            }
        }
        let edges: Vec<Vec<usize>> = at.into_values().collect();
        let parts = Self::lowest_joined(self.faces.len(), &edges);
        let components = self.components();
        let lowest = |f: usize| {
            let own = self.faces[f][0] as usize;
            let vertices = components.iter().find(|vertices| vertices.contains(&own));
            let inside =
                |g: &usize| vertices.is_some_and(|v| v.contains(&(self.faces[*g][0] as usize)));
            (0..self.faces.len()).filter(sound).find(inside)
        };
        (0..self.faces.len())
            .filter(sound)
            .filter(|&f| parts[f] == f)
            .filter_map(|f| Some((f, lowest(f)?)))
            .filter(|(f, lowest)| f != lowest)
            .collect()
    }

    /// The vertices of each component, by lowest vertex: components are joined by sound triangles.
    pub fn components(&self) -> Vec<Vec<usize>> {
        let sound = self.faces.iter().filter(|f| self.is_sound(f));
        let groups: Vec<Vec<usize>> = sound.map(|f| f.map(|v| v as usize).to_vec()).collect();
        let label = Self::lowest_joined(self.reference.len(), &groups);
        let mut components: Vec<Vec<usize>> = vec![Vec::new(); label.len()];
        for (v, &lowest) in label.iter().enumerate() {
            components[lowest].push(v);
        }
        components.retain(|vertices| !vertices.is_empty());
        components
    }
}

pub(super) fn edges(vertices: Vertices, face: &[u32; 3]) -> [Vector3<f64>; 2] {
    let [a, b, c] = face.map(|v| Vector3::from(vertices[v as usize]));
    [b - a, c - a]
}

pub(super) fn rotation(vector: &[f64]) -> Matrix3<f64> {
    Rotation3::new(Vector3::new(vector[0], vector[1], vector[2])).into_inner()
}

/// S from S_xx, S_yy, S_zz, sqrt2 S_yz, sqrt2 S_xz, sqrt2 S_xy.
pub(super) fn stretch(numbers: &[f64]) -> Matrix3<f64> {
    let [yz, xz, xy] = [3, 4, 5].map(|i| numbers[i] * 0.5f64.sqrt());
    let [x, y, z] = [numbers[0], numbers[1], numbers[2]];
    Matrix3::new(x, xy, xz, xy, y, yz, xz, yz, z)
}

/// D = [e1 e2 (e1 x e2)/sqrt|e1 x e2|].
pub(super) fn frame_matrix(edges: [Vector3<f64>; 2]) -> Matrix3<f64> {
    let normal = edges[0].cross(&edges[1]);
    let length = normal.norm();
    let scaled = if length > 0.0 {
        normal / length.sqrt()
    } else {
        normal
    };
    Matrix3::from_columns(&[edges[0], edges[1], scaled])
}

pub fn gradient_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let mesh = Mesh::new(inputs)?;
    let components = mesh.components();
    let (mut formula, mut negative, mut centres) = (0.0f64, 0.0f64, 0.0f64);
    let d = 9 * mesh.faces.len() + 3 * components.len();
    for (frame, z) in mesh.rows(inputs, outputs, d)? {
        let (triangles, middle) = z.split_at(9 * mesh.faces.len());
        for (face, numbers) in mesh.faces.iter().zip(triangles.chunks_exact(9)) {
            let s = stretch(&numbers[3..]);
            let sound = mesh.is_sound(face);
            let gap = if sound {
                let mapped =
                    rotation(&numbers[..3]) * s * frame_matrix(edges(mesh.reference, face));
                (mapped - frame_matrix(edges(frame, face))).amax() / mesh.diagonal
            } else {
                (rotation(&numbers[..3]) - Matrix3::identity()).amax()
                    + (s - Matrix3::identity()).amax()
            };
            formula = formula.max(gap);
            negative = negative.max(-s.symmetric_eigenvalues().min() / s.amax().max(1.0));
        }
        for (vertices, found) in components.iter().zip(middle.chunks_exact(3)) {
            centres = centres.max(mesh.centre_gap(frame, vertices, found));
        }
    }
    Ok(vec![
        ("formula", formula),
        ("stretch", negative),
        ("centres", centres),
    ])
}

/// The z of two engines, row by row.
pub(super) fn paired_rows<'a>(
    ours: &'a Bundle,
    theirs: &'a Bundle,
) -> Result<impl Iterator<Item = (&'a [f64], &'a [f64])>, ArrayError> {
    let (shape, a) = ours.f64("z", 2)?;
    let b = shaped(theirs, "z", shape)?;
    let d = shape[1].max(1);
    Ok(a.chunks_exact(d).zip(b.chunks_exact(d)))
}

/// How far apart the rotations and centres of components are, six numbers each, and then the rotations of further parts, three each.
pub(super) fn placement_difference(a: &[f64], b: &[f64], components: usize) -> f64 {
    let turned = |a: &[f64], b: &[f64]| (rotation(&a[..3]) - rotation(&b[..3])).amax();
    let gap = |(a, b): (&[f64], &[f64])| turned(a, b).max(greatest(&a[3..], &b[3..]));
    let ((a, a_parts), (b, b_parts)) = (a.split_at(6 * components), b.split_at(6 * components));
    let placed = a.chunks_exact(6).zip(b.chunks_exact(6)).map(gap);
    let parts = a_parts.chunks_exact(3).zip(b_parts.chunks_exact(3));
    placed
        .chain(parts.map(|(a, b)| turned(a, b)))
        .fold(0.0, f64::max)
}

pub fn gradient_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let triangles = 9 * inputs.triangles("F")?.len();
    let (mut turned, mut numbers) = (0.0f64, 0.0f64);
    for (a, b) in paired_rows(ours, theirs)? {
        let both = a[..triangles]
            .chunks_exact(9)
            .zip(b[..triangles].chunks_exact(9));
        for (a, b) in both {
            turned = turned.max((rotation(&a[..3]) - rotation(&b[..3])).amax());
            numbers = numbers.max(greatest(&a[3..], &b[3..]));
        }
        numbers = numbers.max(greatest(&a[triangles..], &b[triangles..]));
    }
    Ok(vec![
        ("rotation_difference", turned),
        ("number_difference", numbers),
    ])
}

/// The first frames beside the frames that z came from; the others come of vectors of no frame.
pub fn decoded_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let (shape, truth) = inputs.f64("truth", 3)?;
    let n = inputs.f64("z", 2)?.0[0];
    let frames = shaped(outputs, "frames", &[n, shape[1], 3])?;
    let known = &frames[..truth.len().min(frames.len())];
    Ok(vec![("round_trip", gap(inputs, truth, known)?)])
}

pub fn decoded_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (shape, a) = ours.f64("frames", 3)?;
    let b = shaped(theirs, "frames", shape)?;
    Ok(vec![("frame_difference", gap(inputs, a, b)?)])
}

/// The greatest difference of coordinates over the reference's diagonal.
fn gap(inputs: &Bundle, a: &[f64], b: &[f64]) -> Result<f64, ArrayError> {
    let (_, reference) = inputs.f64("reference", 2)?;
    Ok(share(greatest(a, b), diagonal(reference, 3)))
}
