//! Sequences through files and back, and every kind of file that must be refused.

mod refused;
mod written;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use meshseq::mesh::Connectivity;
use meshseq::mesh::measure;
use meshseq::sequence::Sequence;
use meshseq::sequence::format::npz::NpzProblem;
use meshseq::sequence::format::peer_tobj::read_with_tobj;
use meshseq::sequence::format::{FormatError, ObjProblem, frame_files, read, write};
use proptest::prelude::*;

fn sequence(vertices: usize, faces: Vec<[u32; 3]>, positions: Vec<f64>) -> Sequence {
    let connectivity = Connectivity::new(vertices, faces).unwrap();
    let frames = positions.len() / (vertices * 3);
    Sequence::new(Arc::new(connectivity), frames, positions).unwrap()
}

/// A sequence of `frames` frames in which every coordinate says where it belongs.
fn counting(frames: usize) -> Sequence {
    let positions = (0..frames * 12).map(|i| i as f64 + 0.1).collect();
    sequence(4, vec![[0, 1, 2], [2, 1, 3]], positions)
}

fn bits(sequence: &Sequence) -> Vec<u64> {
    sequence.positions().iter().map(|x| x.to_bits()).collect()
}

/// All files below `folder`, with their contents.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => found.extend(contents(&path)),
            false => _ = found.insert(path.clone(), fs::read(path).unwrap()),
        }
    }
    found
}

/// Any finite sequences: up to 4 frames, 5 vertices and 6 faces, over all doubles.
fn sequences() -> impl Strategy<Value = Sequence> {
    let finite = any::<u64>()
        .prop_map(f64::from_bits)
        .prop_filter("finite", |x| x.is_finite());
    let number = prop_oneof![
        finite,
        -10.0..10.0,
        Just(-0.0),
        Just(5e-324),
        Just(f64::MAX)
    ];
    (1usize..5, 1usize..6).prop_flat_map(move |(frames, vertices)| {
        let face = prop::array::uniform3(0..vertices as u32);
        let positions = prop::collection::vec(number.clone(), frames * vertices * 3);
        (prop::collection::vec(face, 0..7), positions)
            .prop_map(move |(faces, positions)| sequence(vertices, faces, positions))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn obj_and_npz_keep_every_bit(original in sequences()) {
        let folder = tempfile::tempdir().unwrap();
        for name in ["frames", "frames.npz"] {
            let path = folder.path().join(name);
            write(&original, &path).unwrap();
            let read = read(&path).unwrap();
            prop_assert_eq!(bits(&read), bits(&original), "{}", name);
            prop_assert_eq!(read.connectivity(), original.connectivity(), "{}", name);
            prop_assert_eq!(read.frame_count(), original.frame_count(), "{}", name);
        }
    }

    #[test]
    fn pc2_rounds_to_f32(original in sequences()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cache.pc2");
        let rounded: Vec<f64> = original.positions().iter().map(|&x| f64::from(x as f32)).collect();
        match write(&original, &path) {
            Ok(()) => {
                let read = read(&path).unwrap();
                let expected: Vec<u64> = rounded.iter().map(|x| x.to_bits()).collect();
                prop_assert_eq!(bits(&read), expected);
                prop_assert_eq!(read.connectivity(), original.connectivity());
            }
            Err(error) => {
                prop_assert!(matches!(error, FormatError::CannotHold { .. }), "{}", error);
                prop_assert!(rounded.iter().any(|x| x.is_infinite()));
                prop_assert_eq!(contents(folder.path()).len(), 0);
            }
        }
    }

    /// tobj sees the same triangles in the same order, whatever it does to the vertices.
    #[test]
    fn tobj_sees_the_same_triangles(original in sequences()) {
        let small = original.positions().iter().map(|x| x.clamp(-1e30, 1e30)).collect();
        let original = sequence(original.connectivity().vertex_count(), original.connectivity().faces().to_vec(), small);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames");
        write(&original, &path).unwrap();
        let peers = read_with_tobj(&frame_files(&path).unwrap()).unwrap();
        prop_assert_eq!(peers.len(), original.frame_count());
        for (i, peer) in peers.iter().enumerate() {
            let points = original.frame(i).as_chunks::<3>().0;
            let ours = original.connectivity().faces().iter().map(|f| f.map(|v| points[v as usize].map(|x| x as f32)));
            prop_assert!(peer.corner_positions().eq(ours));
        }
    }

    #[test]
    fn damaged_files_do_not_panic(
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
        length in any::<prop::sample::Index>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.npz", "a.pc2", "a"] {
            let path = folder.path().join(name);
            write(&counting(3), &path).unwrap();
            let victim = if name == "a" { path.join("0002.obj") } else { path.clone() };
            let mut bytes = fs::read(&victim).unwrap();
            for (at, value) in &damage {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            fs::write(&victim, &bytes).unwrap();
            let _ = read(&path);
            let _ = frame_files(&path).map(|files| read_with_tobj(&files));
            bytes.truncate(length.index(bytes.len()));
            fs::write(&victim, &bytes).unwrap();
            // A frame without its last line end is still whole; the others are never whole when cut.
            prop_assert!(read(&path).is_err() || name == "a", "{} of {} bytes", name, bytes.len());
            fs::remove_file(folder.path().join("a.obj")).ok();
        }
    }
}

#[test]
fn frames_come_in_the_order_of_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = [100, 9, 1, 11, 10, 2];
    for number in numbers {
        let text = format!("v {number} 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
        fs::write(folder.path().join(format!("mesh_{number}.obj")), text).unwrap();
    }
    fs::write(folder.path().join("mesh_3.txt"), "no frame").unwrap();
    fs::write(folder.path().join("rest.mtl"), "no frame").unwrap();
    let first = |path: &Path| -> Vec<f64> {
        let sequence = read(path).unwrap();
        (0..sequence.frame_count())
            .map(|i| sequence.frame(i)[0])
            .collect()
    };
    assert_eq!(first(folder.path()), [1.0, 2.0, 9.0, 10.0, 11.0, 100.0]);
    assert_eq!(
        first(&folder.path().join("mesh_1*.obj")),
        [1.0, 10.0, 11.0, 100.0]
    );
    assert_eq!(first(&folder.path().join("mesh_??.*")), [10.0, 11.0]);
    assert_eq!(first(&folder.path().join("mesh_9.obj")), [9.0]);
}

#[test]
fn the_vertex_order_is_that_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    // Vertex 0 is used last and vertex 2 never: tobj renumbers the one and drops the other.
    fs::write(&path, "v 1 0 0\nv 2 0 0\nv 3 0 0\nv 4 1 0\nf 4 2 1\n").unwrap();
    let ours = read(&path).unwrap();
    assert_eq!(
        ours.positions(),
        [1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0, 0.0, 0.0, 4.0, 1.0, 0.0]
    );
    assert_eq!(ours.connectivity().faces(), [[3, 1, 0]]);
    let peer = &read_with_tobj(&[path]).unwrap()[0];
    assert_eq!(peer.vertex_count(), 3);
    assert_eq!(peer.triangles, [[0, 1, 2]]);
    let widened: Vec<f64> = peer.positions.iter().map(|&x| x.into()).collect();
    let (area, boundary) = (
        measure::area(&widened, &peer.triangles),
        measure::counts(3, &peer.triangles).boundary_edges,
    );
    assert_eq!(
        (area, boundary),
        (
            measure::area(ours.positions(), ours.connectivity().faces()),
            3
        )
    );
}

#[test]
fn the_same_sequence_gives_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let original = counting(25);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            for name in ["a", "a.npz", "b.pc2"] {
                write(&original, &folder.path().join(name)).unwrap();
            }
            (
                contents(folder.path()),
                bits(&read(&folder.path().join("a")).unwrap()),
            )
        })
    };
    let one = run(1);
    assert_eq!(one.0.len(), 25 + 1 + 2);
    assert!(one.0.contains_key(&folder.path().join("a/0025.obj")));
    fs::remove_dir_all(folder.path().join("a")).unwrap();
    assert!(run(3) == one);
}

/// A frame of one triangle.
const GOOD: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
