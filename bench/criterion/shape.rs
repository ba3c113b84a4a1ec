//! Growth of the shape spaces with F. For local work; `bench/METHODOLOGY.md` says what judges changes.

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use meshseq::mesh::Connectivity;
use meshseq::shape::{Space, SpaceKind, prepare_for};

/// Faces of the meshes: some from a thousand to a million.
const FACES: [usize; 4] = [1_000, 10_000, 100_000, 1_000_000];
/// Faces of the largest mesh that is decoded by a nonlinear descent.
const MOST_NONLINEAR: usize = 10_000;

/// A wavy square sheet of about this many triangles, and the sheet with its waves moved on and turned over.
fn sheet(faces: usize) -> (Connectivity, [Vec<f64>; 2]) {
    let side = ((faces / 2) as f64).sqrt().round() as u32;
    let at = |i: u32, j: u32| i * (side + 1) + j;
    let squares = (0..side).flat_map(|i| (0..side).map(move |j| (i, j)));
    let triangles = squares.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    let triangles: Vec<[u32; 3]> = triangles.collect();
    let frame = |phase: f64, turn: f64| {
        let (sin, cos) = turn.sin_cos();
        let vertices = (0..=side).flat_map(|i| (0..=side).map(move |j| (i, j)));
        let positions = vertices.flat_map(|(i, j)| {
            let (x, y) = (
                f64::from(i) / f64::from(side),
                f64::from(j) / f64::from(side),
            );
            let z = 0.05 * (9.0 * x + phase).sin() * (7.0 * y - phase).cos();
            [x * cos - z * sin, y, x * sin + z * cos]
        });
        positions.collect()
    };
    let vertices = ((side + 1) * (side + 1)) as usize;
    let connectivity = Connectivity::new(vertices, triangles).expect("indices are in range");
    (connectivity, [frame(0.0, 0.0), frame(1.0, 2.0)])
}

fn space(kind: SpaceKind, connectivity: &Connectivity, frames: &[f64]) -> Box<dyn Space> {
    prepare_for(kind, &connectivity.clone().into(), frames).expect("a sheet is a sound reference")
}

fn spaces(c: &mut Criterion) {
    for kind in SpaceKind::ALL {
        let mut group = c.benchmark_group(kind.name());
        group
            .sample_size(10)
            .measurement_time(Duration::from_secs(3));
        for faces in FACES {
            let (connectivity, [reference, frame]) = sheet(faces);
            let both = [&reference[..], &frame].concat();
            group.bench_function(BenchmarkId::new("prepare", faces), |b| {
                b.iter(|| space(kind, &connectivity, &both));
            });
            let space = space(kind, &connectivity, &both);
            let mut z = vec![0.0; space.dimension()];
            group.bench_function(BenchmarkId::new("encode", faces), |b| {
                b.iter(|| space.encode(&frame, &mut z));
            });
            // Minutes each, and Criterion wants ten.
            if kind == SpaceKind::Lengths && faces > MOST_NONLINEAR {
                continue;
            }
            // Halfway to the reference, so that nothing is consistent.
            let mut other = z.clone();
            space
                .encode(&reference, &mut other)
                .expect("a frame of this space");
            space.encode(&frame, &mut z).expect("a frame of this space");
            z.iter_mut()
                .zip(&other)
                .for_each(|(z, other)| *z = 0.5 * (*z + other));
            let mut positions = vec![0.0; space.frame_len()];
            group.bench_function(BenchmarkId::new("decode halfway", faces), |b| {
                b.iter(|| space.decode(&z, &mut positions));
            });
        }
    }
}

criterion_group!(benches, spaces);
criterion_main!(benches);
