//! Frames as surfaces: area and volume again, and pairs of triangles that meet, counted by separating axes with a margin for rounding.

use nalgebra::Vector3;

use super::{Measured, diagonal, greatest, shaped, share};
use crate::arrays::{Array, ArrayError, Bundle};

type Triangle = [Vector3<f64>; 3];

/// Frames in which pairs are counted again, where there are at most this many pairs of triangles.
const BRUTE_FORCE: usize = 2_000_000;
/// Triangles nearer to touching than this share of the diagonal are left to others to decide.
const MARGIN: f64 = 1e-9;
/// Cross products below this share of the diagonal squared are no axes: edges that are parallel.
const PARALLEL: f64 = 1e-12;

/// What an engine says; an array that its library has not got is none.
struct Answer<'a> {
    area: Option<&'a [f64]>,
    volume: Option<&'a [f64]>,
    pairs: Option<&'a [i64]>,
    faces: Option<&'a [i64]>,
}

impl<'a> Answer<'a> {
    fn new(inputs: &Bundle, outputs: &'a Bundle) -> Result<Self, ArrayError> {
        let n = inputs.f64("frames", 3)?.0[0];
        let there = |name: &str| outputs.get(name).is_ok();
        let numbers = |name: &str| there(name).then(|| shaped(outputs, name, &[n])).transpose();
        let counts = |name: &str| there(name).then(|| whole(outputs, name, n)).transpose();
        Ok(Self {
            area: numbers("area")?,
            volume: numbers("volume")?,
            pairs: counts("intersections")?,
            faces: counts("intersecting_faces")?,
        })
    }
}

fn whole<'a>(outputs: &'a Bundle, name: &str, n: usize) -> Result<&'a [i64], ArrayError> {
    match outputs.get(name)? {
        Array::I64 { shape, data } if shape == &[n] => Ok(data),
        _ => Err(ArrayError {
            name: name.into(),
            expected: format!("an i64 array of shape ({n})"),
            found: "another".into(),
        }),
    }
}

/// One frame's triangles and its diagonal.
struct Frame {
    triangles: Vec<Triangle>,
    size: f64,
}

fn frames(inputs: &Bundle) -> Result<Vec<Frame>, ArrayError> {
    let (shape, x) = inputs.f64("frames", 3)?;
    let faces = inputs.triangles("F")?;
    let corner = |frame: &[f64], v: u32| Vector3::from_row_slice(&frame[3 * v as usize..][..3]);
    let frame = |frame: &[f64]| Frame {
        triangles: faces.iter().map(|f| f.map(|v| corner(frame, v))).collect(),
        size: diagonal(frame, 3),
    };
    Ok(x.chunks(3 * shape[1]).map(frame).collect())
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let answer = Answer::new(inputs, outputs)?;
    let faces = inputs.triangles("F")?;
    let frames = frames(inputs)?;
    let mut measured = Vec::new();
    let worst = |found: &[f64], again: &dyn Fn(&Frame) -> f64, power: i32| {
        let gaps = frames.iter().zip(found);
        let gaps = gaps.map(|(f, x)| share((again(f) - x).abs(), f.size.powi(power)));
        gaps.fold(0.0, f64::max)
    };
    if let Some(area) = answer.area {
        measured.push(("area", worst(area, &area_again, 2)));
    }
    if let Some(volume) = answer.volume {
        measured.push(("volume", worst(volume, &volume_again, 3)));
    }
    if let Some(pairs) = answer.pairs {
        measured.push(("pairs", pairs.iter().sum::<i64>() as f64));
        let last = frames.len() - 1;
        let checked = match faces.len() * faces.len() / 2 <= BRUTE_FORCE {
            true => vec![0, last / 2, last],
            false => Vec::new(),
        };
        let off = checked
            .iter()
            .map(|&i| beyond(pairs[i], &frames[i], &faces));
        measured.push(("pairs_miscounted", off.fold(0.0, f64::max)));
    }
    if let (Some(pairs), Some(meeting)) = (answer.pairs, answer.faces) {
        measured.push(("faces", meeting.iter().sum::<i64>() as f64));
        let impossible = pairs.iter().zip(meeting).filter(|(pairs, meeting)| {
            // k triangles make at most k (k - 1) / 2 pairs, and one that meets does so with another.
            **meeting == 1
                || **meeting > faces.len() as i64
                || **pairs > *meeting * (*meeting - 1) / 2
        });
        measured.push(("impossible", impossible.count() as f64));
    }
    Ok(measured)
}

/// Differences from our counts, over all frames: pairs as a number, triangles as a share of those in the frame where either meets most.
pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (Answer::new(inputs, ours)?, Answer::new(inputs, theirs)?);
    let frames = frames(inputs)?;
    let size = frames.first().map_or(1.0, |frame| frame.size);
    let mut measured = Vec::new();
    if let (Some(a), Some(b)) = (a.area, b.area) {
        let whole = a.iter().copied().fold(0.0, f64::max);
        measured.push(("area_difference", share(greatest(a, b), whole)));
    }
    if let (Some(a), Some(b)) = (a.volume, b.volume) {
        measured.push(("volume_difference", share(greatest(a, b), size.powi(3))));
    }
    if let (Some(a), Some(b)) = (a.pairs, b.pairs) {
        measured.push(("pairs_difference", gap(a, b)));
    }
    if let (Some(a), Some(b)) = (a.faces, b.faces) {
        let all: i64 = a.iter().chain(b).sum();
        measured.push(("faces_difference", share(gap(a, b), 0.5 * all as f64)));
    }
    Ok(measured)
}

fn gap(a: &[i64], b: &[i64]) -> f64 {
    let gaps = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    gaps.sum::<i64>() as f64
}

/// By Heron's formula in Kahan's form, the longest side first.
fn area_again(frame: &Frame) -> f64 {
    let area = |[a, b, c]: &Triangle| {
        let mut sides = [(a - b).norm(), (b - c).norm(), (c - a).norm()];
        sides.sort_by(|x, y| y.total_cmp(x));
        let [x, y, z] = sides;
        let product = (x + (y + z)) * (z - (x - y)) * (z + (x - y)) * (x + (y - z));
        0.25 * product.max(0.0).sqrt()
    };
    frame.triangles.iter().map(area).sum()
}

fn volume_again(frame: &Frame) -> f64 {
    let six = |[a, b, c]: &Triangle| nalgebra::Matrix3::from_columns(&[*a, *b, *c]).determinant();
    frame.triangles.iter().map(six).sum::<f64>() / 6.0
}

/// By how many pairs a count is off what it can be, of the triangles without a common vertex: those surely apart do not meet, those surely deep in one another do.
fn beyond(found: i64, frame: &Frame, faces: &[[u32; 3]]) -> f64 {
    let (mut sure, mut possible) = (0, 0);
    for f in 0..faces.len() {
        for g in 0..f {
            if faces[f].iter().any(|v| faces[g].contains(v)) {
                continue;
            }
            let apart = parting(&frame.triangles[f], &frame.triangles[g], frame.size);
            possible += i64::from(apart <= MARGIN * frame.size);
            sure += i64::from(apart < -MARGIN * frame.size);
        }
    }
    (sure - found).max(found - possible).max(0) as f64
}

/// The greatest gap between two triangles along any of their separating axes; negative where all of them show an overlap.
fn parting(a: &Triangle, b: &Triangle, size: f64) -> f64 {
    let gap = |axis: Vector3<f64>| {
        let along = |t: &Triangle| t.map(|p| p.dot(&axis));
        let (a, b) = (along(a), along(b));
        let low = |t: [f64; 3]| t.into_iter().fold(f64::INFINITY, f64::min);
        let high = |t: [f64; 3]| t.into_iter().fold(f64::NEG_INFINITY, f64::max);
        (low(a) - high(b)).max(low(b) - high(a))
    };
    let boxes = [Vector3::x(), Vector3::y(), Vector3::z()].map(gap);
    let worst = boxes.into_iter().fold(f64::NEG_INFINITY, f64::max);
    if worst > MARGIN * size {
        return worst;
    }
    let edges = |t: &Triangle| [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
    let (of_a, of_b) = (edges(a), edges(b));
    let normals = [of_a[0].cross(&of_a[1]), of_b[0].cross(&of_b[1])];
    let crossed = of_a.iter().flat_map(|e| of_b.map(|f| e.cross(&f)));
    let beside = [(of_a, normals[0]), (of_b, normals[1])];
    let beside = beside.into_iter().flat_map(|(edges, normal)| {
        let unit = normal.try_normalize(PARALLEL * size * size);
        unit.into_iter()
            .flat_map(move |n| edges.map(|e| n.cross(&e) * size))
    });
    let axes = normals.into_iter().chain(crossed).chain(beside);
    let units = axes.filter_map(|axis| axis.try_normalize(PARALLEL * size * size));
    units.map(gap).fold(worst, f64::max)
}
