use super::*;
use npyz::WriterBuilder;
use proptest::prelude::*;
use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

mod refusals;

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
    let mut bytes = Cursor::new(Vec::new());
    let mut archive = zip_write::Archive::new(&mut bytes);
    archive
        .begin("a.npy".into(), contents.len() as u64)
        .unwrap();
    archive.part(contents).unwrap();
    archive.end().unwrap();
    archive.finish().unwrap();
    bytes.into_inner()
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
            prop_assert_eq!(array.shape(), wanted.shape());
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
                let all = array.shape().iter().product::<usize>();
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
