//! Sequences through files and back, and every kind of file that must be refused.

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
    assert!(run(3) == one);
}

/// Writes frames as `1.obj`, `2.obj`, ... and returns why they are refused.
fn refusal(frames: &[&str]) -> FormatError {
    let folder = tempfile::tempdir().unwrap();
    for (i, text) in frames.iter().enumerate() {
        fs::write(folder.path().join(format!("{}.obj", i + 1)), text).unwrap();
    }
    read(folder.path()).unwrap_err()
}

const GOOD: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

#[test]
fn obj_frames_that_are_refused() {
    assert!(matches!(refusal(&[]), FormatError::NoFrames { .. }));
    assert!(matches!(
        refusal(&[""]),
        FormatError::Empty { frame: 1, .. }
    ));
    assert!(matches!(
        refusal(&[GOOD, ""]),
        FormatError::Empty { frame: 2, .. }
    ));
    assert!(matches!(
        refusal(&["# nothing\n"]),
        FormatError::NoVertices { .. }
    ));
    assert!(matches!(
        refusal(&[GOOD, "vn 0 0 1\n# long enough to hold three\n"]),
        FormatError::NoVertices { .. }
    ));
    let problem = |text: &str| match refusal(&[GOOD, GOOD, text]) {
        FormatError::Obj {
            frame: 3,
            line,
            column,
            problem,
            path,
        } => {
            assert!(path.ends_with("3.obj"));
            (line, column, problem)
        }
        other => panic!("{other}"),
    };
    let replace = |from: &str, to: &str| GOOD.replace(from, to);
    assert_eq!(
        problem(&replace("f 1", "f 0")),
        (4, 3, ObjProblem::IndexZero)
    );
    assert!(matches!(
        problem(&replace("2 3", "2 4")),
        (4, 7, ObjProblem::IndexOutOfRange { vertices: 3, .. })
    ));
    assert!(matches!(
        problem(&replace("v 1 0", "v 1 NaN")),
        (
            2,
            5,
            ObjProblem::NotFinite {
                vertex: 1,
                axis: 'y',
                ..
            }
        )
    ));
    assert!(matches!(
        problem(&replace("v 1 0", "v 1 -Infinity")),
        (2, 5, ObjProblem::NotFinite { .. })
    ));
    assert!(matches!(
        problem(&replace("v 1 0 0", "v 1 o 0")),
        (2, 5, ObjProblem::BadNumber { .. })
    ));
    assert!(matches!(
        problem(&replace("v 1 0 0", "v 1 0   ")),
        (2, 9, ObjProblem::TooFewCoordinates { found: 2 })
    ));
    assert!(matches!(
        problem(&replace("1 2 3", "1 2")),
        (4, 6, ObjProblem::TooFewCorners { found: 2 })
    ));
    assert!(matches!(
        problem(&replace(" 3\n", "")),
        (4, 6, ObjProblem::TooFewCorners { found: 2 })
    ));
    let message = refusal(&[GOOD, &replace("v 1 0", "v 1 nan")]).to_string();
    for part in ["2.obj:2:5", "frame 2", "vertex 1", "'nan'"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn obj_frames_of_another_connectivity() {
    let more = format!("v 5 5 5\n{GOOD}");
    let error = refusal(&[GOOD, GOOD, &more]);
    assert!(
        matches!(
            error,
            FormatError::VertexCount {
                frame: 3,
                found: 4,
                expected: 3,
                ..
            }
        ),
        "{error}"
    );
    // Fewer bytes than the vertices of the first frame need: found before anything is reserved.
    let error = refusal(&[GOOD, "v 1 1 1\n"]);
    assert!(
        matches!(
            error,
            FormatError::VertexCount {
                frame: 2,
                found: 1,
                expected: 3,
                ..
            }
        ),
        "{error}"
    );
    let error = refusal(&[GOOD, &GOOD.replace("1 2 3", "1 3 2")]);
    assert!(
        matches!(
            error,
            FormatError::FaceDiffers {
                frame: 2,
                line: 4,
                face: 0,
                found: [0, 2, 1],
                expected: [0, 1, 2],
                ..
            }
        ),
        "{error}"
    );
    assert!(error.to_string().contains("2.obj:4"), "{error}");
    let error = refusal(&[GOOD, &format!("{GOOD}f 1 2 3\n")]);
    assert!(
        matches!(
            error,
            FormatError::FaceCount {
                frame: 2,
                found: 2,
                expected: 1,
                ..
            }
        ),
        "{error}"
    );
    let error = refusal(&[GOOD, "v 0 0 0\nv 1 0 0\nv 0 1 0\n"]);
    assert!(
        matches!(
            error,
            FormatError::FaceCount {
                frame: 2,
                found: 0,
                expected: 1,
                ..
            }
        ),
        "{error}"
    );
    assert!(error.to_string().contains("from triangle 0"), "{error}");
}

#[test]
fn of_several_faulty_frames_the_first_is_reported() {
    let frames: Vec<&str> = (0..40)
        .map(|i| {
            if i < 7 {
                GOOD
            } else {
                "v x\n# padding padding padding"
            }
        })
        .collect();
    for _ in 0..20 {
        assert!(matches!(
            refusal(&frames),
            FormatError::Obj { frame: 8, .. }
        ));
    }
}

#[test]
fn a_line_of_100_megabytes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("1.obj");
    fs::write(&path, "v 1 2 3\n").unwrap();
    // Zeros to the end, which take no room on disk.
    let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(100 << 20).unwrap();
    let error = read(&path).unwrap_err();
    assert!(
        matches!(
            error,
            FormatError::Obj {
                line: 2,
                problem: ObjProblem::LineTooLong,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn paths_that_name_no_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.ply"), "ply").unwrap();
    fs::create_dir(at("b.obj")).unwrap();
    for name in ["none", "none.obj", "none.npz", "none.pc2", "none/*.obj"] {
        assert!(
            matches!(read(&at(name)), Err(FormatError::Missing { .. })),
            "{name}"
        );
    }
    assert!(matches!(
        read(&at("a.ply")),
        Err(FormatError::Unsupported { .. })
    ));
    assert!(matches!(
        read(&at("b.obj")),
        Err(FormatError::NoFrames { .. })
    ));
    assert!(matches!(
        read(&at("*.obj")),
        Err(FormatError::NoFrames { .. })
    ));
}

#[cfg(unix)]
#[test]
fn links_that_lead_nowhere_and_devices() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("1.obj"), GOOD).unwrap();
    std::os::unix::fs::symlink("nowhere", folder.path().join("2.obj")).unwrap();
    assert!(
        matches!(read(folder.path()), Err(FormatError::Missing { path }) if path.ends_with("2.obj"))
    );
    fs::remove_file(folder.path().join("2.obj")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", folder.path().join("2.obj")).unwrap();
    assert!(
        matches!(read(folder.path()), Err(FormatError::NotAFile { path }) if path.ends_with("2.obj"))
    );
}

fn pc2(vertices: i32, frames: i32, floats: &[f32]) -> Vec<u8> {
    let mut bytes = b"POINTCACHE2\0".to_vec();
    for field in [1, vertices, 0, 0, frames] {
        bytes.extend(field.to_le_bytes());
    }
    bytes.extend(floats.iter().flat_map(|x| x.to_le_bytes()));
    bytes
}

#[test]
fn pc2_finds_its_faces() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cache.pc2");
    fs::write(&path, pc2(3, 2, &[0.5; 18])).unwrap();
    assert!(matches!(read(&path), Err(FormatError::Pc2 { .. })));
    fs::write(folder.path().join("only.obj"), GOOD).unwrap();
    assert_eq!(read(&path).unwrap().frame_count(), 2);
    fs::write(folder.path().join("other.obj"), GOOD).unwrap();
    assert!(matches!(read(&path), Err(FormatError::Pc2 { .. })));
    fs::write(
        folder.path().join("cache.obj"),
        GOOD.replace("1 2 3", "3 2 1"),
    )
    .unwrap();
    let sequence = read(&path).unwrap();
    assert_eq!(sequence.connectivity().faces(), [[2, 1, 0]]);
    assert_eq!(sequence.positions(), [0.5; 18]);
}

#[test]
fn pc2_files_that_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cache.pc2");
    fs::write(folder.path().join("cache.obj"), GOOD).unwrap();
    let refusal = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        read(&path).unwrap_err()
    };
    let good = pc2(3, 2, &[0.0; 18]);
    let error = refusal(&good[..good.len() - 1]);
    assert!(
        matches!(
            error,
            FormatError::Size {
                expected: 104,
                found: 103,
                ..
            }
        ),
        "{error}"
    );
    let error = refusal(&[&good[..], &[0]].concat());
    assert!(
        matches!(
            error,
            FormatError::Size {
                expected: 104,
                found: 105,
                ..
            }
        ),
        "{error}"
    );
    let error = refusal(&good[..20]);
    assert!(
        matches!(
            error,
            FormatError::Size {
                expected: 32,
                found: 20,
                ..
            }
        ),
        "{error}"
    );
    let error = refusal(&pc2(i32::MAX, i32::MAX, &[0.0; 18]));
    assert!(
        matches!(
            error,
            FormatError::Size {
                expected: 55340232169589047340,
                ..
            }
        ),
        "{error}"
    );
    for bytes in [
        pc2(-3, 2, &[]),
        pc2(3, 0, &[]),
        pc2(0, 3, &[]),
        vec![b'x'; 104],
    ] {
        assert!(matches!(refusal(&bytes), FormatError::Pc2 { .. }));
    }
    let error = refusal(&pc2(4, 1, &[0.0; 12]));
    assert!(
        matches!(
            error,
            FormatError::VertexCount {
                found: 4,
                expected: 3,
                ..
            }
        ),
        "{error}"
    );
    let mut holed = [0.0; 18];
    holed[9 + 5] = f32::INFINITY;
    let message = refusal(&pc2(3, 2, &holed)).to_string();
    assert!(
        message.contains("frame 2")
            && message.contains("vertex 1")
            && message.contains("coordinate z"),
        "{message}"
    );
}

#[test]
fn npz_files_that_are_refused_keep_their_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    write(&counting(2), &path).unwrap();
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let error = read(&path).unwrap_err();
    let FormatError::Npz {
        problem: NpzProblem::CutOff {
            expected, found, ..
        },
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert!(
        found == whole.len() as u64 / 2 && expected > found,
        "{found} {expected}"
    );
}

#[test]
fn where_nothing_can_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("file"), "").unwrap();
    fs::create_dir(at("c.npz")).unwrap();
    fs::create_dir(at("full")).unwrap();
    fs::write(at("full/notes.txt"), "mine").unwrap();
    fs::create_dir(at("nested")).unwrap();
    fs::create_dir(at("nested/1.obj")).unwrap();
    let before = contents(folder.path());
    let refusal = |name: &str| write(&counting(3), &at(name)).unwrap_err();
    for name in [
        "no/a",
        "no/a.npz",
        "no/a.pc2",
        "no/a.obj",
        "file/a",
        "file/a.npz",
    ] {
        let error = match name {
            "no/a.obj" => write(&counting(1), &at(name)).unwrap_err(),
            _ => refusal(name),
        };
        assert!(
            matches!(error, FormatError::ParentMissing { .. }),
            "{name}: {error}"
        );
    }
    assert!(matches!(refusal("c.npz"), FormatError::NotAFile { .. }));
    for name in ["full", "nested", "file"] {
        assert!(
            matches!(refusal(name), FormatError::WouldOverwrite { .. }),
            "{name}"
        );
    }
    assert!(matches!(refusal("a.obj"), FormatError::CannotHold { .. }));
    assert!(matches!(refusal("a.ply"), FormatError::Unsupported { .. }));
    assert_eq!(contents(folder.path()), before);
}

#[test]
fn what_is_replaced_and_what_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("frames")).unwrap();
    for frames in [5, 3] {
        for name in ["frames", "a.npz", "b.pc2"] {
            write(&counting(frames), &at(name)).unwrap();
            assert_eq!(read(&at(name)).unwrap().frame_count(), frames, "{name}");
        }
    }
    assert_eq!(contents(folder.path()).len(), 3 + 1 + 2);
    // An OBJ of another mesh beside a cache is not ours to replace.
    fs::write(at("b.obj"), GOOD).unwrap();
    let error = write(&counting(3), &at("b.pc2")).unwrap_err();
    assert!(
        matches!(error, FormatError::WouldOverwrite { .. }),
        "{error}"
    );
    assert_eq!(fs::read_to_string(at("b.obj")).unwrap(), GOOD);
    write(&counting(1), &at("one.obj")).unwrap();
    assert_eq!(
        read(&at("one.obj")).unwrap().positions(),
        counting(1).positions()
    );
}

#[cfg(unix)]
#[test]
fn a_folder_without_permission() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let closed = folder.path().join("closed");
    fs::create_dir(&closed).unwrap();
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o555)).unwrap();
    // The superuser may write anywhere; then only the mapping of the error is tested (beside `bytes.rs`).
    let superuser = fs::write(closed.join("probe"), "").is_ok();
    for name in ["a", "a.npz", "a.pc2"] {
        let result = write(&counting(2), &closed.join(name));
        assert!(
            superuser || matches!(result, Err(FormatError::NotWritable { .. })),
            "{name}: {result:?}"
        );
    }
}
