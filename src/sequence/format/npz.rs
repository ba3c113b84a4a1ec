//! NPZ files: named numpy arrays in one ZIP archive. The format of sequences, and building blocks for other files.
//!
//! Reading and writing are done here, without an NPZ library: those at hand reserve memory on the word of a header
//! (as many directory entries as the archive claims; a 4 GiB NPY header), multiply shapes without seeing that they
//! overflow, and stamp the time into what they write. One of them (npyz) is the second reader in the tests.

mod archive;
mod elements;
mod npy;
mod problem;
mod zip_read;
mod zip_write;

use std::path::Path;
use std::sync::Arc;

use super::bytes;
use super::error::FormatError;
use crate::arrays::Array;
use crate::mesh::Connectivity;
use crate::sequence::Sequence;
pub use archive::Archive;
pub use problem::NpzProblem;

/// An [`Array`] that is only looked at, to be written without a copy.
#[derive(Clone, Copy, Debug)]
pub enum ArrayView<'a> {
    /// See [`Array::F64`].
    F64 { shape: &'a [usize], data: &'a [f64] },
    /// See [`Array::I64`].
    I64 { shape: &'a [usize], data: &'a [i64] },
    /// See [`Array::Text`].
    Text(&'a str),
}

impl<'a> From<&'a Array> for ArrayView<'a> {
    fn from(array: &'a Array) -> Self {
        match array {
            Array::F64 { shape, data } => Self::F64 { shape, data },
            Array::I64 { shape, data } => Self::I64 { shape, data },
            Array::Text(text) => Self::Text(text),
        }
    }
}

impl<'a> ArrayView<'a> {
    fn shape(&self) -> &'a [usize] {
        match *self {
            Self::F64 { shape, .. } | Self::I64 { shape, .. } => shape,
            Self::Text(_) => &[],
        }
    }
}

/// Reads all arrays of an NPZ file, in the order of the file. See [`Archive`] for what is understood.
///
/// What [`write_arrays`] wrote comes back bit for bit, NaN payloads and signed zeros included.
pub fn read_arrays(path: &Path) -> Result<Vec<(String, Array)>, FormatError> {
    let mut archive = Archive::open(path)?;
    let names: Vec<String> = archive.names().map(str::to_string).collect();
    let read = |name: String| Ok((name.clone(), archive.read(&name)?));
    names.into_iter().map(read).collect()
}

/// Writes named arrays to one NPZ file that numpy opens without pickle.
///
/// Entries are stored, not packed, and carry no time, so equal arrays give equal bytes. Names must be distinct and not
/// empty. The file appears whole or not at all. Costs two passes over the data, of which one computes the checksum.
pub fn write_arrays(path: &Path, arrays: &[(&str, Array)]) -> Result<(), FormatError> {
    let views: Vec<_> = arrays
        .iter()
        .map(|(name, array)| (*name, array.into()))
        .collect();
    write_views(path, &views)
}

/// [`write_arrays`] without owning the arrays.
pub fn write_views(path: &Path, arrays: &[(&str, ArrayView)]) -> Result<(), FormatError> {
    for (at, (name, array)) in arrays.iter().enumerate() {
        let repeated = arrays[..at].iter().any(|(other, _)| other == name);
        if let Some(reason) = obstacle(name, array, repeated) {
            return Err(refuse(
                path,
                NpzProblem::CannotWrite {
                    array: name.to_string(),
                    reason,
                },
            ));
        }
    }
    bytes::write_file(path, |out| {
        let mut archive = zip_write::Archive::new(out);
        for (name, array) in arrays {
            archive.add(&entry(name, *array))?;
        }
        archive.finish()
    })
}

fn entry<'a>(name: &str, array: ArrayView<'a>) -> zip_write::Entry<'a> {
    let header = npy::header(&elements::dtype(&array), array.shape());
    zip_write::Entry {
        name: format!("{name}.npy"),
        length: (header.len() + elements::length(&array)) as u64,
        produce: Box::new(move |sink| {
            sink(&header)?;
            elements::produce(&array, sink)
        }),
    }
}

fn refuse(path: &Path, problem: NpzProblem) -> FormatError {
    FormatError::Npz {
        path: path.to_path_buf(),
        problem,
    }
}

/// Why an array cannot be written so that it reads back the same, if so.
fn obstacle(name: &str, array: &ArrayView, repeated: bool) -> Option<String> {
    if name.is_empty() || name.len() > 1000 || name.contains('\0') {
        return Some("its name must have 1 to 1000 bytes and no NUL".into());
    }
    if repeated {
        return Some("another array has the same name".into());
    }
    match array {
        ArrayView::F64 { shape, data } => misfit(shape, data.len()),
        ArrayView::I64 { shape, data } => misfit(shape, data.len()),
        ArrayView::Text(text) => text.ends_with('\0').then(|| "the text ends in NUL".into()),
    }
}

fn misfit(shape: &[usize], length: usize) -> Option<String> {
    /// What numpy reads.
    const MAX_AXES: usize = 32;
    if shape.len() > MAX_AXES {
        return Some(format!("{} axes, expected at most {MAX_AXES}", shape.len()));
    }
    let product = shape
        .iter()
        .try_fold(1usize, |total, &n| total.checked_mul(n));
    (product != Some(length)).then(|| format!("{length} elements do not fill the shape {shape:?}"))
}

/// Reads a sequence from the arrays `V` (n, V, 3) of f64 or f32, which is widened, and `F` (F, 3) of 0-based integers.
/// Other arrays in the file are not looked at.
pub fn read(path: &Path) -> Result<Sequence, FormatError> {
    let mut archive = Archive::open(path)?;
    let faces = faces(path, archive.read("F")?)?;
    let (frames, vertices, positions) = match archive.read("V")? {
        Array::F64 { shape, data } if matches!(shape[..], [_, _, 3]) => (shape[0], shape[1], data),
        other => {
            return Err(wrong_kind(
                path,
                "V",
                "floats of shape (frames, vertices, 3)",
                &other,
            ));
        }
    };
    let connectivity =
        Connectivity::new(vertices, faces).map_err(|source| FormatError::Connectivity {
            path: path.to_path_buf(),
            source,
        })?;
    Sequence::new(Arc::new(connectivity), frames, positions).map_err(|source| {
        FormatError::Sequence {
            path: path.to_path_buf(),
            source,
        }
    })
}

fn wrong_kind(path: &Path, array: &str, expected: &'static str, found: &Array) -> FormatError {
    refuse(
        path,
        NpzProblem::Kind {
            array: array.to_string(),
            expected,
            found: found.describe(),
        },
    )
}

fn faces(path: &Path, array: Array) -> Result<Vec<[u32; 3]>, FormatError> {
    let data = match array {
        Array::I64 { shape, data } if matches!(shape[..], [_, 3]) => data,
        other => {
            return Err(wrong_kind(
                path,
                "F",
                "integers of shape (faces, 3)",
                &other,
            ));
        }
    };
    let index = |(at, &value): (usize, &i64)| {
        u32::try_from(value).map_err(|_| {
            refuse(
                path,
                NpzProblem::Integer {
                    array: "F".into(),
                    at,
                    value: value.to_string(),
                    expected: "a 0-based vertex index below 2^32",
                },
            )
        })
    };
    let flat: Vec<u32> = data
        .iter()
        .enumerate()
        .map(index)
        .collect::<Result<_, _>>()?;
    Ok(flat.as_chunks::<3>().0.to_vec())
}

/// Writes a sequence as `V` (n, V, 3) of f64 and `F` (F, 3) of int64, 0-based, bit for bit.
pub fn write(sequence: &Sequence, path: &Path) -> Result<(), FormatError> {
    let connectivity = sequence.connectivity();
    let faces: Vec<i64> = connectivity
        .faces()
        .as_flattened()
        .iter()
        .map(|&v| v.into())
        .collect();
    let positions = ArrayView::F64 {
        shape: &[sequence.frame_count(), connectivity.vertex_count(), 3],
        data: sequence.positions(),
    };
    let faces = ArrayView::I64 {
        shape: &[connectivity.faces().len(), 3],
        data: &faces,
    };
    write_views(path, &[("V", positions), ("F", faces)])
}

#[cfg(test)]
mod tests;
