//! Archives and arrays that must be refused.

use super::*;

#[test]
fn a_shape_is_held_against_the_bytes_that_are_there() {
    for shape in [
        "(1000000000000, 3)",
        "(18446744073709551615, 18446744073709551615, 18446744073709551615)",
        "(4294967296, 4294967296, 1)",
        "(1,)",
        "(3,)",
    ] {
        let bytes = stored(&npy(&header("<f8", "False", shape), &[0; 16]));
        assert!(
            matches!(problem(&bytes), NpzProblem::Size { .. }),
            "{shape}: {}",
            problem(&bytes)
        );
    }
    let endless_text = stored(&npy(
        &header("<U4611686018427387904", "False", "()"),
        &[0; 16],
    ));
    assert!(matches!(
        problem(&endless_text),
        NpzProblem::Unsupported { .. }
    ));
    let long_text = stored(&npy(&header("<U1000000000000", "False", "()"), &[0; 16]));
    assert!(matches!(problem(&long_text), NpzProblem::Size { .. }));
}

#[test]
fn decompression_bombs_are_refused() {
    let mut bytes = deflated(&[0.0; 4000]);
    let at = unpacked_field(&bytes);
    bytes[at..at + 4].copy_from_slice(&4_000_000_000u32.to_le_bytes());
    assert!(matches!(
        problem(&bytes),
        NpzProblem::Bomb {
            unpacked: 4_000_000_000,
            ..
        }
    ));
}

#[test]
fn a_lie_about_the_unpacked_size_is_found_out() {
    // The header inside and the directory outside agree on 5 numbers; packed are 4, and the other way round.
    let dictionary = |n: usize| npy(&header("<f8", "False", &format!("({n},)")), &[]);
    for (claimed, given) in [(5, 4), (4, 5)] {
        let contents = [dictionary(claimed), vec![0; given * 8]].concat();
        let mut packer = flate2::write::DeflateEncoder::new(Vec::new(), Default::default());
        std::io::Write::write_all(&mut packer, &contents).unwrap();
        let packed = packer.finish().unwrap();
        let mut bytes = stored(&packed);
        let at = unpacked_field(&bytes);
        bytes[at - 14] = 8; // the compression method
        bytes[at..at + 4]
            .copy_from_slice(&((dictionary(claimed).len() + claimed * 8) as u32).to_le_bytes());
        assert!(
            matches!(problem(&bytes), NpzProblem::Damaged { .. }),
            "{claimed} {given}: {}",
            problem(&bytes)
        );
    }
}

#[test]
fn cut_off_at_every_length() {
    let (_folder, path) = place();
    let array = Array::I64 {
        shape: vec![2],
        data: vec![1, 2],
    };
    write_arrays(&path, &[("a", array.clone()), ("b", array)]).unwrap();
    let whole = fs::read(&path).unwrap();
    for length in 0..whole.len() {
        let problem = problem(&whole[..length]);
        match length {
            0..30 => assert!(
                matches!(problem, NpzProblem::NotAnArchive { .. }),
                "{length}: {problem}"
            ),
            _ => assert!(
                matches!(problem, NpzProblem::CutOff { expected, found, .. } if expected > found && found == length as u64),
                "{length}: {problem}"
            ),
        }
    }
    // The first entry needs its header (35 bytes), its NPY header and its 16 bytes.
    let NpzProblem::CutOff { what, expected, .. } = problem(&whole[..60]) else {
        unreachable!()
    };
    assert_eq!((what.as_str(), expected), ("entry a.npy", 35 + 128 + 16));
}

#[test]
fn other_refusals() {
    let flipped = |at_end: usize| {
        let mut bytes = stored(&npy(&header("<f8", "False", "(2,)"), &[0; 16]));
        let at = bytes.windows(4).position(|w| w == b"PK\x01\x02").unwrap() - at_end;
        bytes[at] ^= 1;
        bytes
    };
    assert!(matches!(problem(&flipped(1)), NpzProblem::Checksum { .. }));
    assert!(matches!(problem(b"PNG"), NpzProblem::NotAnArchive { .. }));
    assert!(matches!(
        problem(&stored(b"PNG")),
        NpzProblem::Damaged { .. }
    ));
    assert!(matches!(
        problem(&stored(b"PNG of some length")),
        NpzProblem::Header { .. }
    ));
    assert!(matches!(
        problem(&stored(b"\x93NUMPY\x02\x00\xff\xff\xff\xff")),
        NpzProblem::Header { .. }
    ));
    assert!(matches!(
        problem(&stored(&npy("{}", &[]))),
        NpzProblem::Header { .. }
    ));
    let object = npy(&header("|O", "False", "()"), &[0; 8]);
    assert!(matches!(
        problem(&stored(&object)),
        NpzProblem::Unsupported { .. }
    ));
    let unpaired = npy(&header("<U1", "False", "()"), &0xD800u32.to_le_bytes());
    assert!(matches!(
        problem(&stored(&unpaired)),
        NpzProblem::Character { code: 0xD800, .. }
    ));
    let huge = npy(
        &header("<u8", "False", "(2,)"),
        &[[0; 8], [255; 8]].concat(),
    );
    assert!(matches!(
        problem(&stored(&huge)),
        NpzProblem::Integer { at: 1, .. }
    ));
}

#[test]
fn what_would_not_read_back_is_not_written() {
    let (folder, path) = place();
    let text = |t: &str| Array::Text(t.to_string());
    let floats = |shape: Vec<usize>| Array::F64 {
        shape,
        data: vec![1.0],
    };
    for arrays in [
        vec![("a", text("NUL\0"))],
        vec![("a", text("")), ("a", text(""))],
        vec![("", text(""))],
        vec![("a\0", text(""))],
        vec![("a", floats(vec![2]))],
        vec![("a", floats(vec![usize::MAX, 2]))],
        vec![("a", floats(vec![1; 33]))],
    ] {
        let error = write_arrays(&path, &arrays).unwrap_err();
        assert!(
            matches!(
                error,
                FormatError::Npz {
                    problem: NpzProblem::CannotWrite { .. },
                    ..
                }
            ),
            "{error}"
        );
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn sequences_need_v_and_f_of_the_right_kind() {
    let (_folder, path) = place();
    let positions = |shape: &[usize], data: Vec<f64>| {
        (
            "V",
            Array::F64 {
                shape: shape.into(),
                data,
            },
        )
    };
    let faces = |shape: &[usize], data: Vec<i64>| {
        (
            "F",
            Array::I64 {
                shape: shape.into(),
                data,
            },
        )
    };
    let error = |arrays: &[(&str, Array)]| {
        write_arrays(&path, arrays).unwrap();
        read(&path).unwrap_err()
    };
    let problem = |arrays: &[(&str, Array)]| match error(arrays) {
        FormatError::Npz { problem, .. } => problem,
        other => panic!("{other}"),
    };
    let good = || {
        [
            positions(&[1, 3, 3], vec![0.0; 9]),
            faces(&[1, 3], vec![0, 1, 2]),
        ]
    };
    let [v, f] = good();
    write_arrays(&path, &good()).unwrap();
    assert_eq!(read(&path).unwrap().connectivity().faces(), [[0, 1, 2]]);
    assert!(
        matches!(problem(std::slice::from_ref(&f)), NpzProblem::Missing { array, .. } if array == "V")
    );
    assert!(
        matches!(problem(std::slice::from_ref(&v)), NpzProblem::Missing { array, .. } if array == "F")
    );
    assert!(matches!(
        problem(&[positions(&[3, 3], vec![0.0; 9]), f.clone()]),
        NpzProblem::Kind { .. }
    ));
    assert!(matches!(
        problem(&[v.clone(), faces(&[3], vec![0, 1, 2])]),
        NpzProblem::Kind { .. }
    ));
    assert!(matches!(
        problem(&[v.clone(), ("F", v.1.clone())]),
        NpzProblem::Kind { .. }
    ));
    assert!(matches!(
        problem(&[v.clone(), faces(&[1, 3], vec![0, -1, 2])]),
        NpzProblem::Integer { at: 1, .. }
    ));
    assert!(matches!(
        problem(&[v.clone(), faces(&[1, 3], vec![0, 1, 1 << 32])]),
        NpzProblem::Integer { at: 2, .. }
    ));
    assert!(matches!(
        error(&[v, faces(&[1, 3], vec![0, 1, 3])]),
        FormatError::Connectivity { .. }
    ));
    assert!(matches!(
        error(&[positions(&[0, 3, 3], vec![]), f.clone()]),
        FormatError::Sequence { .. }
    ));
    let mut holed = vec![0.0; 18];
    holed[9 + 4] = f64::NAN;
    let message = error(&[positions(&[2, 3, 3], holed), f]).to_string();
    assert!(
        message.contains("frame 2")
            && message.contains("vertex 1")
            && message.contains("coordinate y"),
        "{message}"
    );
}
