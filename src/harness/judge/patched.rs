//! The space of patches, put back together by its formulas.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Matrix3;

use super::Measured;
use super::encoding::{Mesh, edges, frame_matrix, paired_rows, rotation, stretch};
use super::greatest;
use crate::arrays::{ArrayError, Bundle};

/// Where the numbers are in z.
struct Layout {
    /// -1 for degenerate triangles.
    labels: Vec<i64>,
    /// Patches that share an edge, p < q.
    pairs: Vec<[usize; 2]>,
    /// The component of every patch.
    components: Vec<usize>,
    /// The lowest patch of each set that pairs join, but that of its component's lowest patch.
    further: Vec<usize>,
}

impl Layout {
    fn new(mesh: &Mesh, inputs: &Bundle, parts: &[Vec<usize>]) -> Result<Self, ArrayError> {
        let labels = inputs.integers("patches")?.to_vec();
        let mut at: BTreeMap<[u32; 2], BTreeSet<usize>> = BTreeMap::new();
        let mut owners: BTreeMap<usize, u32> = BTreeMap::new();
        for (face, &label) in mesh.faces.iter().zip(&labels).filter(|(_, l)| **l >= 0) {
            owners.entry(label as usize).or_insert(face[0]);
            for corner in 0..3 {
                let [a, b] = [face[corner], face[(corner + 1) % 3]];
                at.entry([a.min(b), a.max(b)])
                    .or_default()
                    .insert(label as usize);
            }
        }
        let mut pairs = BTreeSet::new();
        for here in at.values() {
            pairs.extend(
                here.iter()
                    .flat_map(|&q| here.range(..q).map(move |&p| [p, q])),
            );
        }
        let component = |v: &u32| parts.iter().position(|part| part.contains(&(*v as usize)));
        let pairs: Vec<[usize; 2]> = pairs.into_iter().collect();
        let groups: Vec<Vec<usize>> = pairs.iter().map(|pair| pair.to_vec()).collect();
        let sets = Mesh::lowest_joined(owners.len(), &groups);
        let mut layout = Self {
            labels,
            pairs,
            components: owners.values().filter_map(component).collect(),
            further: Vec::new(),
        };
        let leads =
            |&p: &usize| sets[p] == p && layout.lowest_patch(layout.components[p]) != Some(p);
        layout.further = (0..layout.components.len()).filter(leads).collect();
        Ok(layout)
    }

    fn lowest_patch(&self, component: usize) -> Option<usize> {
        self.components.iter().position(|&c| c == component)
    }

    /// Rotations of the patches along chains of pairs, from the lowest of each component and of each further set.
    fn rotations(&self, relative: &[f64], placed: &[f64]) -> Vec<Matrix3<f64>> {
        let mut found: Vec<Option<Matrix3<f64>>> = vec![None; self.components.len()];
        let mut start = Some(0).filter(|_| !found.is_empty());
        let parts = placed.len() - 3 * self.further.len();
        while let Some(patch) = start {
            let component = rotation(&placed[6 * self.components[patch]..]);
            found[patch] = Some(match self.further.iter().position(|&p| p == patch) {
                Some(i) => component * rotation(&placed[parts + 3 * i..]),
                None => component,
            });
            let mut changed = true;
            while changed {
                changed = false;
                for (&[p, q], c) in self.pairs.iter().zip(relative.chunks_exact(3)) {
                    match (found[p], found[q]) {
                        (Some(r), None) => found[q] = Some(r * rotation(c)),
                        (None, Some(r)) => found[p] = Some(r * rotation(c).transpose()),
                        _ => continue,
                    }
                    changed = true;
                }
            }
            start = found.iter().position(Option::is_none);
        }
        found.into_iter().flatten().collect()
    }
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let mesh = Mesh::new(inputs)?;
    let parts = mesh.components();
    let layout = Layout::new(&mesh, inputs, &parts)?;
    let (triangles, pairs) = (9 * mesh.faces.len(), 3 * layout.pairs.len());
    let areas: Vec<f64> = mesh.faces.iter().map(|f| area(&mesh, f)).collect();
    let (mut formula, mut negative, mut mean, mut joints, mut placed) =
        (0.0f64, 0.0f64, 0.0f64, 0.0f64, 0.0f64);
    let d = triangles + pairs + 6 * parts.len() + 3 * layout.further.len();
    for (frame, z) in mesh.rows(inputs, outputs, d)? {
        let (relative, six) = z[triangles..].split_at(pairs);
        let patches = layout.rotations(relative, six);
        let mut sums = vec![(Matrix3::zeros(), 0.0); patches.len()];
        for (f, (face, numbers)) in mesh.faces.iter().zip(z.chunks_exact(9)).enumerate() {
            let (r, s) = (rotation(&numbers[..3]), stretch(&numbers[3..]));
            negative = negative.max(-s.symmetric_eigenvalues().min() / s.amax().max(1.0));
            let Ok(p) = usize::try_from(layout.labels[f]) else {
                let identity = Matrix3::identity();
                formula = formula.max((r - identity).amax() + (s - identity).amax());
                continue;
            };
            let mapped = patches[p] * r * s * frame_matrix(edges(mesh.reference, face));
            let gap = (mapped - frame_matrix(edges(frame, face))).amax() / mesh.diagonal;
            formula = formula.max(gap);
            sums[p].0 += areas[f] * r;
            sums[p].1 += areas[f];
        }
        mean = sums
            .iter()
            .map(|(sum, area)| off_mean(&(sum / *area)))
            .fold(mean, f64::max);
        for (&[p, q], c) in layout.pairs.iter().zip(relative.chunks_exact(3)) {
            joints = joints.max((patches[p] * rotation(c) - patches[q]).amax());
        }
        for (component, (vertices, numbers)) in parts.iter().zip(six.chunks_exact(6)).enumerate() {
            placed = placed.max(mesh.centre_gap(frame, vertices, &numbers[3..]));
            if layout.lowest_patch(component).is_none() {
                placed = numbers[..3]
                    .iter()
                    .fold(placed, |most, x| most.max(x.abs()));
            }
        }
    }
    Ok(vec![
        ("formula", formula),
        ("stretch", negative),
        ("mean", mean),
        ("joints", joints),
        ("placement", placed),
    ])
}

fn area(mesh: &Mesh, face: &[u32; 3]) -> f64 {
    let [a, b] = edges(mesh.reference, face);
    0.5 * a.cross(&b).norm()
}

/// 0 where no rotation is nearer to a matrix than the identity: it is symmetric, and its two least eigenvalues have no negative sum.
fn off_mean(sum: &Matrix3<f64>) -> f64 {
    let eigenvalues = sum.symmetric_eigenvalues();
    let least = eigenvalues.sum() - eigenvalues.max();
    (sum - sum.transpose()).amax().max(-least)
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let mesh = Mesh::new(inputs)?;
    let components = mesh.components();
    let layout = Layout::new(&mesh, inputs, &components)?;
    let triangles = 9 * mesh.faces.len();
    let end = triangles + 3 * layout.pairs.len();
    let turn_gap = |a: &[f64], b: &[f64]| (rotation(a) - rotation(b)).amax();
    let (mut turned, mut patches, mut numbers) = (0.0f64, 0.0f64, 0.0f64);
    for (a, b) in paired_rows(ours, theirs)? {
        for (a, b) in a[..triangles].chunks_exact(9).zip(b.chunks_exact(9)) {
            turned = turned.max(turn_gap(a, b));
            numbers = numbers.max(greatest(&a[3..], &b[3..]));
        }
        for (a, b) in a[triangles..end]
            .chunks_exact(3)
            .zip(b[triangles..end].chunks_exact(3))
        {
            patches = patches.max(turn_gap(a, b));
        }
        let parts = end + 6 * components.len();
        for (a, b) in a[end..parts].chunks_exact(6).zip(b[end..].chunks_exact(6)) {
            patches = patches.max(turn_gap(a, b));
            numbers = numbers.max(greatest(&a[3..], &b[3..]));
        }
        for (a, b) in a[parts..].chunks_exact(3).zip(b[parts..].chunks_exact(3)) {
            patches = patches.max(turn_gap(a, b));
        }
    }
    Ok(vec![
        ("rotation_difference", turned),
        ("patch_difference", patches),
        ("number_difference", numbers),
    ])
}
