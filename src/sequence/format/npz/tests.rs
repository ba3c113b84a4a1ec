use super::*;
use npyz::WriterBuilder;
use proptest::prelude::*;
use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

fn place() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    (folder, path)
}

/// Reads the arrays of an archive given as bytes.
fn read_bytes(bytes: &[u8]) -> Result<Vec<(String, Array)>, FormatError> {
    let (_folder, path) = place();
    fs::write(&path, bytes).unwrap();
    read_arrays(&path)
}

fn problem(bytes: &[u8]) -> NpzProblem {
    match read_bytes(bytes) {
        Err(FormatError::Npz { problem, .. }) => problem,
        other => panic!("expected an NPZ problem, found {other:?}"),
    }
}

/// An archive of one stored entry `a.npy`, with any contents.
fn stored(contents: &[u8]) -> Vec<u8> {
    let entry = zip_write::Entry {
        name: "a.npy".into(),
        length: contents.len() as u64,
        produce: Box::new(|sink| sink(contents)),
    };
    let mut bytes = Vec::new();
    zip_write::write(&mut bytes, &[entry]).unwrap();
    bytes
}

/// A header with any dictionary, and contents.
fn npy(dictionary: &str, contents: &[u8]) -> Vec<u8> {
    let length = (dictionary.len() as u16).to_le_bytes();
    [
        b"\x93NUMPY\x01\x00",
        &length[..],
        dictionary.as_bytes(),
        contents,
    ]
    .concat()
}

fn header(dtype: &str, fortran: &str, shape: &str) -> String {
    format!("{{'descr': '{dtype}', 'fortran_order': {fortran}, 'shape': {shape}, }}")
}

/// An archive that another writer (npyz, through the zip crate) made and deflated.
fn deflated(numbers: &[f64]) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut archive = npyz::npz::NpzWriter::new(&mut out);
    let array = archive.array("a", Default::default()).unwrap();
    let array = array.default_dtype().shape(&[numbers.len() as u64]);
    let mut writer = array.begin_nd().unwrap();
    writer.extend(numbers).unwrap();
    writer.finish().unwrap();
    archive.zip_writer().finish().unwrap();
    drop(archive);
    out.into_inner()
}

/// Where the directory says how many bytes the only entry unpacks to.
fn unpacked_field(bytes: &[u8]) -> usize {
    let at = bytes.windows(4).rposition(|w| w == b"PK\x01\x02").unwrap();
    at + 24
}

fn bits(array: &Array) -> Vec<u64> {
    match array {
        Array::F64 { data, .. } => data.iter().map(|x| x.to_bits()).collect(),
        Array::I64 { data, .. } => data.iter().map(|&x| x as u64).collect(),
        Array::Text(text) => text.chars().map(|c| u64::from(u32::from(c))).collect(),
    }
}

fn arrays() -> impl Strategy<Value = Vec<Array>> {
    let shapes = || prop::collection::vec(0usize..4, 0..4);
    let any_double = any::<u64>().prop_map(f64::from_bits);
    let any_double = prop::collection::vec(any_double, 64);
    let any_integer = prop::collection::vec(any::<i64>(), 64);
    let doubles = (shapes(), any_double).prop_map(|(shape, mut data)| {
        data.truncate(shape.iter().product());
        Array::F64 { shape, data }
    });
    let integers = (shapes(), any_integer).prop_map(|(shape, mut data)| {
        data.truncate(shape.iter().product());
        Array::I64 { shape, data }
    });
    let texts = any::<String>().prop_map(|t| Array::Text(t.trim_end_matches('\0').to_string()));
    prop::collection::vec(prop_oneof![doubles, integers, texts], 0..5)
}

proptest! {
    #[test]
    fn arrays_come_back_bit_for_bit_and_equal_arrays_give_equal_bytes(arrays in arrays()) {
        let names: Vec<String> = (0..arrays.len()).map(|i| format!("näme {i}")).collect();
        let named: Vec<_> = names.iter().map(String::as_str).zip(arrays.iter().cloned()).collect();
        let (_folder, path) = place();
        write_arrays(&path, &named).unwrap();
        let (first, read) = (fs::read(&path).unwrap(), read_arrays(&path).unwrap());
        write_arrays(&path, &named).unwrap();
        prop_assert_eq!(first, fs::read(&path).unwrap());
        prop_assert_eq!(read.len(), arrays.len());
        for ((name, array), (wanted_name, wanted)) in read.iter().zip(&named) {
            prop_assert_eq!(name, wanted_name);
            prop_assert_eq!(array.view().shape(), wanted.view().shape());
            prop_assert_eq!(std::mem::discriminant(array), std::mem::discriminant(wanted));
            prop_assert_eq!(bits(array), bits(wanted));
        }
    }

    /// Damage anywhere gives an error or, where it does no harm, an answer; never a panic, never a large reservation.
    #[test]
    fn damaged_archives_do_not_panic(
        packed in any::<bool>(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let numbers: Vec<f64> = (0..50).map(f64::from).collect();
        let contents = npy(&header("<f8", "False", "(50,)"), &numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
        let mut bytes = if packed { deflated(&numbers) } else { stored(&contents) };
        for (at, value) in damage {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok(arrays) = read_bytes(&bytes) {
            for (_, array) in arrays.iter().filter(|(name, _)| name == "a") {
                let all = array.view().shape().iter().product::<usize>();
                prop_assert_eq!(bits(array).len(), all);
            }
        }
    }
}

#[test]
fn what_numpy_writes_in_other_ways() {
    let le = |values: &[i16]| {
        values
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect::<Vec<u8>>()
    };
    let be = |values: &[f32]| {
        values
            .iter()
            .flat_map(|v| v.to_be_bytes())
            .collect::<Vec<u8>>()
    };
    let floats = |shape: &[usize], data: &[f64]| Array::F64 {
        shape: shape.into(),
        data: data.into(),
    };
    let integers = |shape: &[usize], data: &[i64]| Array::I64 {
        shape: shape.into(),
        data: data.into(),
    };
    for (dtype, fortran, shape, contents, expected) in [
        (
            "<i2",
            "False",
            "(2, 2)",
            le(&[-1, 2, -3, 4]),
            integers(&[2, 2], &[-1, 2, -3, 4]),
        ),
        (
            "<i2",
            "True",
            "(2, 2)",
            le(&[-1, 2, -3, 4]),
            integers(&[2, 2], &[-1, -3, 2, 4]),
        ),
        (
            "<i2",
            "True",
            "(1, 2, 3)",
            le(&[0, 1, 2, 3, 4, 5]),
            integers(&[1, 2, 3], &[0, 2, 4, 1, 3, 5]),
        ),
        (
            ">f4",
            "False",
            "(2,)",
            be(&[0.1, -2.0]),
            floats(&[2], &[0.1f32.into(), -2.0]),
        ),
        (
            "|u1",
            "False",
            "(3,)",
            vec![0, 127, 255],
            integers(&[3], &[0, 127, 255]),
        ),
        ("|b1", "False", "(2,)", vec![1, 0], integers(&[2], &[1, 0])),
        (
            ">u4",
            "False",
            "()",
            vec![255; 4],
            integers(&[], &[u32::MAX.into()]),
        ),
        (
            "<f8",
            "True",
            "(0, 18446744073709551615)",
            vec![],
            floats(&[0, usize::MAX], &[]),
        ),
        (
            ">U2",
            "False",
            "()",
            vec![0, 0, 0, b'a', 0, 0, 0, 0],
            Array::Text("a".into()),
        ),
        ("<U0", "False", "()", vec![], Array::Text(String::new())),
    ] {
        let bytes = stored(&npy(&header(dtype, fortran, shape), &contents));
        assert_eq!(
            read_bytes(&bytes).unwrap(),
            [("a".to_string(), expected)],
            "{dtype} {shape}"
        );
    }
    let numbers: Vec<f64> = (0..5000).map(|i| f64::from(i).sqrt()).collect();
    assert_eq!(
        read_bytes(&deflated(&numbers)).unwrap()[0].1,
        floats(&[5000], &numbers)
    );
}

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
