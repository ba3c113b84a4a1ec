//! Files and paths that are no sequence.

use super::*;

/// Writes frames as `1.obj`, `2.obj`, ... and returns why they are refused.
fn refusal(frames: &[&str]) -> FormatError {
    let folder = tempfile::tempdir().unwrap();
    for (i, text) in frames.iter().enumerate() {
        fs::write(folder.path().join(format!("{}.obj", i + 1)), text).unwrap();
    }
    read(folder.path()).unwrap_err()
}

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
