//! What every space promises: frames come back, rigid motions touch what they must, odd meshes follow the rules, large turns interpolate.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;

use super::{Space, SpaceKind, decode_all, encode_all, patches, prepare};
use crate::mesh::Connectivity;
use crate::mesh::measure::bounds;
use crate::sequence::synthetic::embedded;
use crate::sequence::synthetic::roll::{SMALL, roll_strip};

const KINDS: [SpaceKind; 4] = [
    SpaceKind::Gradient,
    SpaceKind::Lric,
    SpaceKind::Lengths,
    SpaceKind::Patch,
];

/// With patches by how these frames move.
fn space(
    kind: SpaceKind,
    connectivity: &Arc<Connectivity>,
    reference: &[f64],
    frames: &[f64],
) -> Box<dyn Space> {
    let labels = patches::choose(connectivity.clone(), reference, frames).unwrap();
    prepare(kind, connectivity.clone(), reference, &labels).unwrap()
}

fn mesh(vertices: usize, faces: &[[u32; 3]]) -> Arc<Connectivity> {
    Arc::new(Connectivity::new(vertices, faces.to_vec()).unwrap())
}

fn flat(points: &[Vector3<f64>]) -> Vec<f64> {
    points.iter().flat_map(|p| [p.x, p.y, p.z]).collect()
}

fn moved(frame: &[f64], turn: &Rotation3<f64>, by: Vector3<f64>) -> Vec<f64> {
    let points = frame.as_chunks::<3>().0.iter();
    flat(
        &points
            .map(|&p| turn * Vector3::from(p) + by)
            .collect::<Vec<_>>(),
    )
}

/// The greatest difference of two lists of one length.
pub(super) fn worst(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

/// The greatest distance of a frame from what decoding its vector gives.
fn round_trip(space: &dyn Space, frame: &[f64]) -> f64 {
    let z = encode_all(space, frame).unwrap();
    worst(frame, &decode_all(space, z.as_ref()).unwrap())
}

#[test]
fn embedded_sequences_come_back() {
    for name in [
        "@bar-small",
        "@roll-small",
        "@flag-small",
        "@gallop-small",
        "@jelly-small",
    ] {
        let sequence = embedded(name).unwrap();
        let size = bounds(sequence.frame(0)).diagonal();
        for kind in KINDS {
            let mesh = sequence.connectivity();
            let space = space(kind, mesh, sequence.frame(0), sequence.positions());
            let z = encode_all(&*space, sequence.positions()).unwrap();
            let found = worst(
                sequence.positions(),
                &decode_all(&*space, z.as_ref()).unwrap(),
            );
            assert!(found < 1e-12 * size, "{name} {kind}: {found}");
        }
    }
}

/// Three pages at one edge, a triangle apart from them and one that hangs on it by a vertex, a vertex of no triangle, and a triangle of no area along a
/// page's side.
fn odd() -> (Vec<[u32; 3]>, Vec<f64>) {
    let points = [
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.5, 0.0],
        [-0.7, 0.4, 0.6],
        [-0.5, 0.5, -0.8],
        [3.0, 0.0, 0.0],
        [4.0, 0.0, 0.2],
        [3.0, 1.0, 0.1],
        [9.0, 9.0, 9.0],
        [0.0, 0.5, 0.0],
        [3.2, 2.0, 0.4],
        [2.5, 1.7, -0.3],
    ];
    let faces = vec![
        [0, 1, 2],
        [0, 1, 3],
        [1, 0, 4],
        [5, 6, 7],
        [0, 9, 1],
        [9, 2, 0],
        [7, 10, 11],
    ];
    (faces, points.as_flattened().to_vec())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    /// In whichever order its faces are named.
    #[test]
    fn odd_meshes_come_back(jitter in prop::collection::vec(-0.2f64..0.2, 36), order in Just((0..7).collect::<Vec<usize>>()).prop_shuffle()) {
        let (faces, reference) = odd();
        let faces: Vec<[u32; 3]> = order.iter().map(|&i| faces[i]).collect();
        let frame: Vec<f64> = reference.iter().zip(&jitter).map(|(x, j)| x + j).collect();
        for kind in KINDS {
            let space = space(kind, &mesh(12, &faces), &reference, &frame);
            // Three components; [0, 9, 1] has no area and no say, so only what its neighbours hold comes back.
            let found = round_trip(&*space, &frame);
            prop_assert!(found < 1e-12, "{kind}: {found}");
        }
    }

    /// A triangle of this height over its longest side, in the reference and in the frame: degenerate or not, the frame comes back.
    #[test]
    fn thin_triangles_come_back(height in -12.0f64..0.0, foot in 0.01f64..0.99, stretch in 0.8f64..1.2, jitter in prop::collection::vec(-0.2f64..0.2, 15)) {
        let height = 10f64.powf(height);
        let cap = |stretch: f64| vec![
            0.0, 0.0, 0.0, 1.0, 0.0, 0.0, foot, stretch * height, 0.0, 0.5, -1.0, 0.3, 0.4, 0.9, 0.2,
        ];
        let faces = [[0, 1, 2], [1, 0, 3], [1, 4, 2], [2, 4, 0]];
        let (reference, mut frame) = (cap(1.0), cap(stretch));
        for i in [0, 1, 3, 4].map(|v| 3 * v) {
            // The thin one keeps its height, the others move.
            let by = if i < 9 { 0.0 } else { 1.0 };
            (0..3).for_each(|a| frame[i + a] += by * jitter[i + a]);
        }
        for (kind, most) in [
            (SpaceKind::Gradient, 1e-10), (SpaceKind::Lric, 1e-10), (SpaceKind::Patch, 1e-10), (SpaceKind::Lengths, 1e-8),
        ] {
            let space = space(kind, &mesh(5, &faces), &reference, &frame);
            let found = round_trip(&*space, &frame);
            prop_assert!(found < most, "{kind} {height:e}: {found}");
        }
    }

    /// Whole frames that move rigidly leave the numbers of a further part as they are.
    #[test]
    fn a_part_that_hangs_on_a_vertex_turns_with_its_component(jitter in prop::collection::vec(-0.2f64..0.2, 36), axis in prop::array::uniform3(-1.0f64..1.0)) {
        let (faces, reference) = odd();
        let frame: Vec<f64> = reference.iter().zip(&jitter).map(|(x, j)| x + j).collect();
        let turn = Rotation3::new(Vector3::from(axis));
        let other = moved(&frame, &turn, Vector3::new(1.0, -2.0, 0.5));
        for kind in [SpaceKind::Lric, SpaceKind::Lengths] {
            let space = space(kind, &mesh(12, &faces), &reference, &frame);
            let [a, b] = [&frame, &other].map(|f| encode_all(&*space, f).unwrap());
            let part = space.dimension() - 3..space.dimension();
            let [a, b] = [&a, &b].map(|z| &z.col_as_slice(0)[part.clone()]);
            prop_assert!(worst(a, b) < 1e-12, "{kind}: {a:?} {b:?}");
        }
    }

    #[test]
    fn rigid_motions_touch_only_what_they_must(
        axis in prop::array::uniform3(-1.0f64..1.0), by in prop::array::uniform3(-5.0f64..5.0), pick in 0usize..24,
    ) {
        let sequence = embedded("@gallop-small").unwrap();
        let (reference, frame) = (sequence.frame(0), sequence.frame(pick));
        let turn = Rotation3::new(Vector3::from(axis) * 1.2);
        let other = moved(frame, &turn, Vector3::from(by));
        let faces = sequence.connectivity().faces();
        for kind in KINDS {
            let space = space(kind, sequence.connectivity(), reference, sequence.positions());
            let both = [frame, &other].map(|f| encode_all(&*space, f).unwrap());
            let [a, b] = [0, 1].map(|i| both[i].col_as_slice(0));
            match kind {
                SpaceKind::Gradient => {
                    let triangles = 9 * faces.len();
                    for (a, b) in a[..triangles].chunks(9).zip(b[..triangles].chunks(9)) {
                        prop_assert!(worst(&a[3..], &b[3..]) < 1e-12);
                        let [p, q] = [a, b].map(|z| Rotation3::new(Vector3::new(z[0], z[1], z[2])));
                        prop_assert!(((turn * p).matrix() - q.matrix()).amax() < 1e-12);
                    }
                }
                _ => {
                    let edges = a.len() - 6;
                    let gap = a[..edges].iter().zip(&b[..edges]).map(|(a, b)| {
                        let gap = (a - b).abs();
                        gap.min((TAU - gap).abs())
                    });
                    prop_assert!(gap.fold(0.0, f64::max) < 1e-11);
                    let [p, q] = [a, b].map(|z| Rotation3::new(Vector3::from_column_slice(&z[edges..edges + 3])));
                    prop_assert!(((turn * p).matrix() - q.matrix()).amax() < 1e-11);
                }
            }
        }
    }
}

/// A strip whose middle triangle, and a grid whose first, lie on a line in the frame.
#[test]
fn triangles_without_area_in_a_frame_come_back() {
    let strip = [
        0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.1, 2.0, 0.0, 0.3, 2.0, 1.0, 0.2,
    ];
    let faces = [[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]];
    let mut frame = strip.to_vec();
    for (v, to) in [
        (3, [2.0, -1.0, 0.0]),
        (4, [3.1, 0.2, 0.8]),
        (5, [2.9, 0.9, -0.4]),
    ] {
        frame[3 * v..3 * v + 3].copy_from_slice(&to);
    }
    for turn in [0.0, 1.0] {
        let frame = moved(
            &frame,
            &Rotation3::new(Vector3::new(0.3, -0.8, 0.5) * turn),
            Vector3::zeros(),
        );
        for order in [[0, 1, 2, 3], [1, 0, 2, 3], [3, 2, 1, 0]] {
            let faces = order.map(|i| faces[i]);
            for kind in [SpaceKind::Gradient, SpaceKind::Lric, SpaceKind::Patch] {
                let space = space(kind, &mesh(6, &faces), &strip, &frame);
                let found = round_trip(&*space, &frame);
                assert!(found < 1e-12, "{kind} {order:?} {turn}: {found}");
            }
        }
    }
}

/// Folded by a little more than half a turn one way and a little less the other: halfway is folded by half a turn, not flat.
#[test]
fn halfway_does_not_open_a_fold() {
    let faces = [[0, 1, 2], [1, 0, 3]];
    let fold = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.5, -cos, -sin]
    };
    let (start, end) = (fold(3.1), fold(-3.1));
    for kind in [SpaceKind::Lric, SpaceKind::Lengths] {
        let space = space(kind, &mesh(4, &faces), &fold(0.0), &start);
        let found = super::halfway::halfway(&*space, &start, &end).unwrap();
        let gap =
            Vector3::from_column_slice(&found[6..9]) - Vector3::from_column_slice(&found[9..]);
        assert!(gap.norm() < 1e-6, "{kind}: {found:?}");
    }
}

#[test]
fn a_moebius_band_comes_back() {
    let n = 24;
    let band = |width: f64| -> Vec<f64> {
        let rung = |i: usize| {
            let a = TAU * i as f64 / n as f64;
            let (sin, cos) = (a / 2.0).sin_cos();
            [-width, width].map(|w| {
                let r = 2.0 + w * cos;
                Vector3::new(r * a.cos(), r * a.sin(), w * sin)
            })
        };
        flat(&(0..n).flat_map(rung).collect::<Vec<_>>())
    };
    let mut faces = Vec::new();
    for i in 0..n as u32 {
        let (a, b) = (2 * i, 2 * i + 1);
        // The last rung meets the first upside down.
        let (c, d) = if i + 1 < n as u32 {
            (a + 2, b + 2)
        } else {
            (1, 0)
        };
        faces.extend([[a, c, b], [b, c, d]]);
    }
    for kind in KINDS {
        let space = space(kind, &mesh(2 * n, &faces), &band(0.5), &band(0.8));
        let found = round_trip(&*space, &band(0.8));
        assert!(found < 1e-12, "{kind}: {found}");
    }
}

/// A strip rolled by an angle, halfway to flat, is the strip rolled by half of it: its angles are known, and its lengths do not change.
#[test]
fn a_roll_rolls_by_half() {
    let flat_strip = flat(&roll_strip(0.0, &SMALL));
    let roll = embedded("@roll-small").unwrap();
    let size = bounds(&flat_strip).diagonal();
    for degrees in [90.0f64, 170.0, 350.0, 700.0] {
        let angle = degrees.to_radians();
        let frames = [flat_strip.clone(), flat(&roll_strip(angle, &SMALL))].concat();
        for kind in [SpaceKind::Lric, SpaceKind::Lengths, SpaceKind::Patch] {
            let space = space(kind, roll.connectivity(), &flat_strip, &frames);
            let z = encode_all(&*space, &frames).unwrap();
            let half: Vec<f64> = (0..z.nrows())
                .map(|a| 0.5 * (z[(a, 0)] + z[(a, 1)]))
                .collect();
            let mut found = vec![0.0; flat_strip.len()];
            space.decode(&half, &mut found).unwrap();
            let expected = flat(&roll_strip(angle / 2.0, &SMALL));
            // Up to a rigid motion: compare distances of all vertices from a few.
            let distances = |x: &[f64]| -> Vec<f64> {
                let points: Vec<Vector3<f64>> =
                    x.as_chunks::<3>().0.iter().map(|&p| p.into()).collect();
                let picks = [0, points.len() / 3, points.len() / 2, points.len() - 1];
                picks
                    .iter()
                    .flat_map(|&i| points.iter().map(move |p| (p, i)))
                    .map(|(p, i)| (p - points[i]).norm())
                    .collect()
            };
            let gap = worst(&distances(&found), &distances(&expected));
            assert!(gap < 1e-11 * size, "{kind} {degrees}: {gap}");
        }
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let (faces, reference) = odd();
    for kind in KINDS {
        let space = space(kind, &mesh(12, &faces), &reference, &[]);
        let mut z = vec![0.0; space.dimension()];
        assert!(space.encode(&reference[3..], &mut z).is_err());
        assert!(space.encode(&reference, &mut z[1..]).is_err());
        let mut frame = reference.clone();
        frame[4] = f64::NAN;
        assert!(space.encode(&frame, &mut z).is_err());
        z[2] = f64::INFINITY;
        assert!(space.decode(&z, &mut frame).is_err());
        // Any finite vector gives a finite frame, or is refused where numbers go beyond all bounds.
        for x in [3.7, -2e3, 1e17, 1e200, -1e308] {
            z.fill(x);
            let decoded = space.decode(&z, &mut frame);
            assert!(decoded.is_ok() || x.abs() > 1e10, "{kind} {x}: {decoded:?}");
            assert!(
                decoded.is_err() || frame.iter().all(|x| x.is_finite()),
                "{kind} {x}"
            );
        }
    }
}
