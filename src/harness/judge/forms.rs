//! The first and second form of the `lric` space, put back together by their formulas.

use std::collections::BTreeMap;
use std::f64::consts::{SQRT_2, TAU};

use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector2, Vector3};

use super::Measured;
use super::encoding::{Mesh, Vertices, edges, paired_rows, placement_difference, rotation};
use crate::arrays::{ArrayError, Bundle};

/// Where the numbers of a mesh are in z.
struct Layout {
    /// Of each triangle's half-edges (a,b), (b,c), (c,a).
    halves: Vec<[usize; 3]>,
    /// Pairs: triangles f and g, the edge as f runs along it, whether g runs the same way, and the place of their angle.
    pairs: Vec<PairPlace>,
    /// Where the six numbers of the first component are.
    components: usize,
}

pub(super) struct PairPlace {
    pub triangles: [usize; 2],
    pub edge: [u32; 2],
    same_way: bool,
    pub place: usize,
}

impl PairPlace {
    /// Of two half-edges, as triangle and corner.
    pub fn new(faces: &[[u32; 3]], first: Half, other: Half, place: usize) -> Self {
        let side = |(f, corner): Half| [faces[f][corner], faces[f][(corner + 1) % 3]];
        Self {
            triangles: [first.0, other.0],
            edge: side(first),
            same_way: side(first) == side(other),
            place,
        }
    }
}

/// A triangle, and the corner from which one of its sides starts.
type Half = (usize, usize);

/// The edges, with their half-edges in the order of their triangles; a side from a vertex to itself is none.
pub(super) fn fans(faces: &[[u32; 3]]) -> BTreeMap<[u32; 2], Vec<Half>> {
    let mut fans: BTreeMap<[u32; 2], Vec<Half>> = BTreeMap::new();
    for (f, face) in faces.iter().enumerate() {
        for corner in 0..3 {
            let [a, b] = [face[corner], face[(corner + 1) % 3]];
            if a != b {
                fans.entry([a.min(b), a.max(b)])
                    .or_default()
                    .push((f, corner));
            }
        }
    }
    fans
}

/// The pairs of an edge: its lowest sound triangle (the lowest where none is) with each of the others; their angles are from `place` on.
pub(super) fn pairs_at(mesh: &Mesh, fan: &[Half], place: usize) -> Vec<PairPlace> {
    let hub = fan.iter().position(|&(f, _)| mesh.is_sound(&mesh.faces[f]));
    let hub = fan[hub.unwrap_or(0)];
    let others = fan.iter().filter(|half| **half != hub).zip(place..);
    others
        .map(|(other, place)| PairPlace::new(&mesh.faces, hub, *other, place))
        .collect()
}

impl Layout {
    fn new(mesh: &Mesh) -> Self {
        let faces = &mesh.faces;
        let mut layout = Self {
            halves: vec![[usize::MAX; 3]; faces.len()],
            pairs: Vec::new(),
            components: 0,
        };
        for fan in fans(faces).values() {
            let start = layout.components;
            for (i, &(f, corner)) in fan.iter().enumerate() {
                layout.halves[f][corner] = start + i;
            }
            let pairs = pairs_at(mesh, fan, start + fan.len());
            layout.pairs.extend(pairs);
            layout.components += (2 * fan.len() - 1).max(3);
        }
        layout
    }
}

/// The edges of a reference triangle in its plane, first axis along e1.
pub(super) fn in_plane(e: [Vector3<f64>; 2]) -> Matrix2<f64> {
    let first = e[0].normalize();
    let second = e[0].cross(&e[1]).cross(&e[0]).normalize();
    Matrix2::new(e[0].dot(&first), e[1].dot(&first), 0.0, e[1].dot(&second))
}

/// The reference triangle's axes in space, 3 x 2.
fn axes(e: [Vector3<f64>; 2]) -> Matrix3x2<f64> {
    let second = e[0].cross(&e[1]).cross(&e[0]).normalize();
    Matrix3x2::from_columns(&[e[0].normalize(), second])
}

fn form(z: &[f64], halves: &[usize; 3]) -> Matrix2<f64> {
    let [xx, yy, xy] = halves.map(|place| z.get(place).copied().unwrap_or(f64::NAN));
    Matrix2::new(xx, xy / SQRT_2, xy / SQRT_2, yy)
}

/// How far the triangle's three sides, mapped by U, are from the lengths in the frame.
fn length_gap(u: Matrix2<f64>, rest: Matrix2<f64>, now: [Vector3<f64>; 2]) -> f64 {
    let mapped = u * rest;
    let [a, b]: [Vector2<f64>; 2] = [mapped.column(0).into(), mapped.column(1).into()];
    let gaps = [
        a.norm() - now[0].norm(),
        b.norm() - now[1].norm(),
        (b - a).norm() - (now[1] - now[0]).norm(),
    ];
    gaps.into_iter().map(f64::abs).fold(0.0, f64::max)
}

pub(super) fn dihedral(frame: Vertices, faces: &[[u32; 3]], pair: &PairPlace) -> f64 {
    let normal = |f: usize| {
        let [a, b] = edges(frame, &faces[f]);
        a.cross(&b).normalize()
    };
    let [f, mut g] = pair.triangles.map(normal);
    if pair.same_way {
        g = -g;
    }
    let [a, b] = pair.edge.map(|v| Vector3::from(frame[v as usize]));
    f.cross(&g).dot(&(b - a).normalize()).atan2(f.dot(&g))
}

/// The distance of two angles modulo 2 pi.
pub(super) fn turn_gap(a: f64, b: f64) -> f64 {
    let gap = (a - b).abs() % TAU;
    gap.min(TAU - gap)
}

/// How far a component's rotation and centre are from where its vertices are: the rotation takes its first sound triangle, stretched by its form, to the
/// frame, and is 0 where there is none.
pub(super) fn placement_gap(
    mesh: &Mesh,
    vertices: &[usize],
    frame: Vertices,
    numbers: &[f64],
    form: impl Fn(usize) -> Matrix2<f64>,
) -> f64 {
    let inside = |f: &[u32; 3]| mesh.is_sound(f) && vertices.contains(&(f[0] as usize));
    let turned = match mesh.faces.iter().position(inside) {
        Some(f) => turn_gap_of(mesh, f, frame, rotation(numbers), form(f)),
        None => numbers[..3].iter().map(|x| x.abs()).fold(0.0, f64::max),
    };
    turned.max(mesh.centre_gap(frame, vertices, &numbers[3..]))
}

/// How far a triangle that is stretched by its form and then turned is from where it is in the frame.
fn turn_gap_of(
    mesh: &Mesh,
    f: usize,
    frame: Vertices,
    turn: Matrix3<f64>,
    form: Matrix2<f64>,
) -> f64 {
    let [then, now] = [mesh.reference, frame].map(|at| edges(at, &mesh.faces[f]));
    let mapped = turn * axes(then) * form * in_plane(then);
    (mapped - Matrix3x2::from_columns(&now)).amax() / mesh.diagonal
}

/// The same of the further parts, whose rotations come after the six numbers of all components, against those of their components' lowest triangles.
pub(super) fn parts_gap(
    mesh: &Mesh,
    components: &[Vec<usize>],
    further: &[(usize, usize)],
    frame: Vertices,
    placed: &[f64],
    form: impl Fn(usize) -> Matrix2<f64>,
) -> f64 {
    let (six, parts) = placed.split_at(6 * components.len());
    let gap = |(&(f, lowest), vector): (&(usize, usize), &[f64])| {
        let own = mesh.faces[lowest][0] as usize;
        let component = components.iter().position(|c| c.contains(&own));
        let turn = rotation(&six[6 * component.unwrap_or(0)..]) * rotation(vector);
        turn_gap_of(mesh, f, frame, turn, form(f))
    };
    let parts = further.iter().zip(parts.chunks_exact(3)).map(gap);
    parts.fold(0.0, f64::max)
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let mesh = Mesh::new(inputs)?;
    let layout = Layout::new(&mesh);
    let (components, further) = (mesh.components(), mesh.further_parts());
    let d = layout.components + 6 * components.len() + 3 * further.len();
    let (mut lengths, mut angles, mut placed) = (0.0f64, 0.0f64, 0.0f64);
    for (frame, z) in mesh.rows(inputs, outputs, d)? {
        for (face, halves) in mesh.faces.iter().zip(&layout.halves) {
            let u = form(z, halves);
            lengths = lengths.max(match mesh.is_sound(face) {
                true => {
                    let rest = in_plane(edges(mesh.reference, face));
                    length_gap(u, rest, edges(frame, face)) / mesh.diagonal
                }
                false if halves.contains(&usize::MAX) => 0.0,
                false => (u - Matrix2::identity()).amax(),
            });
        }
        for pair in &layout.pairs {
            let sound = pair
                .triangles
                .iter()
                .all(|&f| mesh.is_sound(&mesh.faces[f]));
            let expected = if sound {
                dihedral(frame, &mesh.faces, pair)
            } else {
                0.0
            };
            angles = angles.max(turn_gap(z[pair.place], expected));
        }
        for (vertices, numbers) in components
            .iter()
            .zip(z[layout.components..].chunks_exact(6))
        {
            let form = |f: usize| form(z, &layout.halves[f]);
            placed = placed.max(placement_gap(&mesh, vertices, frame, numbers, form));
        }
        let form = |f: usize| form(z, &layout.halves[f]);
        let parts = &z[layout.components..];
        placed = placed.max(parts_gap(&mesh, &components, &further, frame, parts, form));
    }
    Ok(vec![
        ("first_form", lengths),
        ("second_form", angles),
        ("placement", placed),
    ])
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let mesh = Mesh::new(inputs)?;
    let (layout, components) = (Layout::new(&mesh), mesh.components().len());
    let mut is_angle = vec![false; layout.components];
    layout
        .pairs
        .iter()
        .for_each(|pair| is_angle[pair.place] = true);
    let (mut forms, mut angles, mut placed) = (0.0f64, 0.0f64, 0.0f64);
    for (a, b) in paired_rows(ours, theirs)? {
        for (i, &angle) in is_angle.iter().enumerate() {
            match angle {
                true => angles = angles.max(turn_gap(a[i], b[i])),
                false => forms = forms.max((a[i] - b[i]).abs()),
            }
        }
        let [a, b] = [a, b].map(|z| &z[layout.components..]);
        placed = placed.max(placement_difference(a, b, components));
    }
    Ok(vec![
        ("form_difference", forms),
        ("angle_difference", angles),
        ("placement_difference", placed),
    ])
}
