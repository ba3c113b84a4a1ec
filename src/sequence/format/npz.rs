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

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use super::bytes::Draft;
use super::error::FormatError;
use crate::arrays::Array;
use crate::mesh::Connectivity;
use crate::sequence::Sequence;
use crate::sequence::format::stream::FrameStream;
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
/// empty. The file appears whole or not at all. Costs one pass over the data.
pub fn write_arrays(path: &Path, arrays: &[(&str, Array)]) -> Result<(), FormatError> {
    let views: Vec<_> = arrays
        .iter()
        .map(|(name, array)| (*name, array.into()))
        .collect();
    write_views(path, &views)
}

/// [`write_arrays`] without owning the arrays.
pub fn write_views(path: &Path, arrays: &[(&str, ArrayView)]) -> Result<(), FormatError> {
    let mut writer = Writer::create(path)?;
    for &(name, array) in arrays {
        writer.add(name, array)?;
    }
    writer.finish()
}

/// An NPZ file written an array at a time, and an array in parts: for what does not fit into memory.
///
/// The bytes are those of [`write_arrays`]. The file has no name until [`Self::finish`]; dropped before, it is gone.
pub struct Writer {
    archive: zip_write::Archive<Draft>,
    names: HashSet<String>,
    /// The array that is being written in parts, and how many of its elements are to come.
    open: Option<(String, usize)>,
}

impl Writer {
    /// An empty file that is to go to `path` in the end.
    pub fn create(path: &Path) -> Result<Self, FormatError> {
        Ok(Self {
            archive: zip_write::Archive::new(Draft::create(path)?),
            names: HashSet::new(),
            open: None,
        })
    }

    /// Where the file is to go in the end.
    pub fn path(&self) -> &Path {
        self.archive.out().path()
    }

    /// Writes an array whole.
    pub fn add(&mut self, name: &str, array: ArrayView) -> Result<(), FormatError> {
        if let Some(reason) = misfit(&array) {
            return Err(self.refuse(name, reason));
        }
        self.start(name, &array, elements::length(&array))?;
        let archive = &mut self.archive;
        let written = elements::produce(&array, &mut |part| archive.part(part));
        let written = written.and_then(|()| archive.end());
        written.map_err(|e| self.failed(e))
    }

    /// Begins an f64 array of this shape, whose elements come by [`Self::extend`], row-major.
    pub fn begin(&mut self, name: &str, shape: &[usize]) -> Result<(), FormatError> {
        let bytes = product(shape).and_then(|count| Some((count, count.checked_mul(8)?)));
        let Some((count, bytes)) = bytes.filter(|_| shape.len() <= MAX_AXES) else {
            let reason = format!("the shape {shape:?} is too large");
            return Err(self.refuse(name, reason));
        };
        let none = ArrayView::F64 { shape, data: &[] };
        self.start(name, &none, bytes)?;
        self.open = Some((name.to_owned(), count));
        self.close_if_full()
    }

    /// The next elements of the array begun.
    pub fn extend(&mut self, data: &[f64]) -> Result<(), FormatError> {
        match &mut self.open {
            Some((_, left)) if data.len() <= *left => *left -= data.len(),
            _ => return Err(self.unfinished(data.len())),
        }
        let shape = &[data.len()];
        let archive = &mut self.archive;
        let part = ArrayView::F64 { shape, data };
        let written = elements::produce(&part, &mut |part| archive.part(part));
        written.map_err(|e| self.failed(e))?;
        self.close_if_full()
    }

    fn close_if_full(&mut self) -> Result<(), FormatError> {
        if !matches!(self.open, Some((_, 0))) {
            return Ok(());
        }
        self.open = None;
        self.archive.end().map_err(|e| self.failed(e))
    }

    /// Gives the file its name.
    pub fn finish(self) -> Result<(), FormatError> {
        if self.open.is_some() {
            return Err(self.unfinished(0));
        }
        let path = self.path().to_path_buf();
        let draft = self.archive.finish();
        draft.map_err(|e| FormatError::writing(&path, e))?.keep()
    }

    /// Everything of an entry before the elements; only the kind and shape of `array` are looked at.
    fn start(&mut self, name: &str, array: &ArrayView, bytes: usize) -> Result<(), FormatError> {
        if self.open.is_some() {
            return Err(self.unfinished(0));
        }
        if let Some(reason) = self.bad_name(name) {
            return Err(self.refuse(name, reason));
        }
        self.names.insert(name.to_owned());
        let header = npy::header(&elements::dtype(array), array.shape());
        let length = header.len() as u64 + bytes as u64;
        let begun = self.archive.begin(format!("{name}.npy"), length);
        let begun = begun.and_then(|()| self.archive.part(&header));
        begun.map_err(|e| self.failed(e))
    }

    fn bad_name(&self, name: &str) -> Option<String> {
        if name.is_empty() || name.len() > 1000 || name.contains('\0') {
            return Some("its name must have 1 to 1000 bytes and no NUL".into());
        }
        let repeated = self.names.contains(name);
        repeated.then(|| "another array has the same name".into())
    }

    fn unfinished(&self, found: usize) -> FormatError {
        let (name, left) = self.open.as_ref().map_or(("", 0), |(n, left)| (n, *left));
        let reason = format!("{left} of its elements are to come, found {found}");
        self.refuse(name, reason)
    }

    fn refuse(&self, array: &str, reason: String) -> FormatError {
        let array = array.to_owned();
        let problem = NpzProblem::CannotWrite { array, reason };
        refuse(self.path(), problem)
    }

    fn failed(&self, source: std::io::Error) -> FormatError {
        FormatError::writing(self.path(), source)
    }
}

fn refuse(path: &Path, problem: NpzProblem) -> FormatError {
    FormatError::Npz {
        path: path.to_path_buf(),
        problem,
    }
}

/// The most axes that numpy reads.
const MAX_AXES: usize = 32;

/// Why an array cannot be written so that it reads back the same, if so.
fn misfit(array: &ArrayView) -> Option<String> {
    let (shape, length) = match array {
        ArrayView::F64 { shape, data } => (shape, data.len()),
        ArrayView::I64 { shape, data } => (shape, data.len()),
        ArrayView::Text(text) => {
            return text.ends_with('\0').then(|| "the text ends in NUL".into());
        }
    };
    if shape.len() > MAX_AXES {
        return Some(format!("{} axes, expected at most {MAX_AXES}", shape.len()));
    }
    let fits = product(shape) == Some(length);
    (!fits).then(|| format!("{length} elements do not fill the shape {shape:?}"))
}

fn product(shape: &[usize]) -> Option<usize> {
    let times = |total: usize, &n: &usize| total.checked_mul(n);
    shape.iter().try_fold(1, times)
}

/// Reads a sequence from the arrays `V` (n, V, 3) of f64 or f32, which is widened, and `F` (F, 3) of 0-based integers.
/// Other arrays in the file are not looked at.
pub fn read(path: &Path) -> Result<Sequence, FormatError> {
    let mut archive = Archive::open(path)?;
    let faces = faces(path, archive.read("F")?)?;
    let (frames, vertices, positions) = match archive.read("V")? {
        Array::F64 { shape, data } if matches!(shape[..], [_, _, 3]) => (shape[0], shape[1], data),
        other => return Err(wrong_kind(path, "V", POSITIONS, other.describe())),
    };
    let connectivity = connectivity(path, vertices, faces)?;
    Sequence::new(connectivity, frames, positions).map_err(|source| FormatError::Sequence {
        path: path.to_path_buf(),
        source,
    })
}

/// Opens what [`read`] reads, to be read some frames at a time. Memory holds those only, unless `V` is stored first index fastest: that must be
/// read whole.
pub(super) fn stream(path: &Path) -> Result<FrameStream, FormatError> {
    let mut archive = Archive::open(path)?;
    let faces = faces(path, archive.read("F")?)?;
    let array = archive.into_rows("V")?;
    let Some((frames, vertices)) = array.frames_of_points() else {
        return Err(wrong_kind(path, "V", POSITIONS, array.describe()));
    };
    if array.is_first_index_fastest() {
        return Ok(FrameStream::held(path, read(path)?));
    }
    let connectivity = connectivity(path, vertices, faces)?;
    FrameStream::new(path, connectivity, frames, Box::new(array))
}

const POSITIONS: &str = "floats of shape (frames, vertices, 3)";

fn connectivity(
    path: &Path,
    vertices: usize,
    faces: Vec<[u32; 3]>,
) -> Result<Arc<Connectivity>, FormatError> {
    match Connectivity::new(vertices, faces) {
        Ok(connectivity) => Ok(Arc::new(connectivity)),
        Err(source) => Err(FormatError::Connectivity {
            path: path.to_path_buf(),
            source,
        }),
    }
}

fn wrong_kind(path: &Path, array: &str, expected: &'static str, found: String) -> FormatError {
    refuse(
        path,
        NpzProblem::Kind {
            array: array.to_string(),
            expected,
            found,
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
                other.describe(),
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

#[cfg(test)]
mod tests;
