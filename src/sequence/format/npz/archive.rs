//! Named arrays from an NPZ file.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek};
use std::path::{Path, PathBuf};

use super::npy::{self, Header, Refusal};
use super::zip_read::{self, Contents, Entry, ZipError};
use super::{Array, NpzProblem, elements};
use crate::sequence::format::bytes;
use crate::sequence::format::error::FormatError;
use crate::sequence::format::stream::Source;

/// Deflate cannot pack better than this.
const DEFLATE_LIMIT: u64 = 1032;
/// Above this unpacked size, arrays must not be packed better than `PLAUSIBLE_RATIO`: positions never are.
const LARGE: u64 = 1 << 30;
const PLAUSIBLE_RATIO: u64 = 100;
/// More names than these are not listed.
const MOST_NAMES: usize = 20;

/// An open NPZ file, whose directory has been read and whose arrays are read on demand.
///
/// Arrays may be stored or deflated, of numpy's format 1.0 to 3.0, in either byte order and either axis order.
pub struct Archive {
    path: PathBuf,
    file: BufReader<File>,
    size: u64,
    entries: Vec<Entry>,
}

impl Archive {
    /// Opens the archive and reads its directory. Entries that are not arrays (not `*.npy`) are passed over.
    pub fn open(path: &Path) -> Result<Self, FormatError> {
        let (file, size) = bytes::open(path)?;
        let mut file = BufReader::with_capacity(1 << 16, file);
        let mut entries = zip_read::directory(&mut file, size).map_err(|e| explain(path, e))?;
        entries.retain_mut(|entry| match entry.name.strip_suffix(".npy") {
            Some(array) => {
                entry.name = array.to_string();
                true
            }
            None => false,
        });
        if let Some(name) = repeated(&entries) {
            let reason = format!("it holds two arrays named {name}");
            return Err(explain(path, NpzProblem::Damaged { reason }.into()));
        }
        Ok(Self {
            path: path.to_path_buf(),
            file,
            size,
            entries,
        })
    }

    /// The names of the arrays, in the order of the file.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|e| e.name.as_str())
    }

    /// Reads one array whole: `f4` and `f8` as f64, integers of any width and booleans as i64, a string scalar as text.
    ///
    /// The declared shape must need exactly the bytes that the archive holds, and these must have the right checksum.
    pub fn read(&mut self, array: &str) -> Result<Array, FormatError> {
        self.try_read(array).map_err(|e| explain(&self.path, e))
    }

    /// One array, to be read some rows at a time and only forward.
    pub(super) fn into_rows(self, array: &str) -> Result<Rows, FormatError> {
        let path = self.path.clone();
        self.try_into_rows(array).map_err(|e| explain(&path, e))
    }

    fn try_into_rows(self, array: &str) -> Result<Rows, ZipError> {
        let entry = self.entry(array)?.clone();
        refuse_bomb(&entry)?;
        let mut contents = Contents::open(self.file, self.size, &entry)?;
        let header = read_header(&mut contents, array).map_err(|e| damage(e, array));
        let (header, before) = header?;
        let count = element_count(&header, before, &entry)?;
        Ok(Rows {
            path: self.path,
            contents,
            entry,
            header,
            count,
            read: 0,
        })
    }

    fn entry(&self, array: &str) -> Result<&Entry, NpzProblem> {
        let found = self.entries.iter().find(|e| e.name == array);
        found.ok_or_else(|| {
            let mut found: Vec<_> = self.names().map(str::to_string).take(MOST_NAMES).collect();
            if self.entries.len() > MOST_NAMES {
                found.push("and more".into());
            }
            let array = array.to_string();
            NpzProblem::Missing { array, found }
        })
    }

    fn try_read(&mut self, array: &str) -> Result<Array, ZipError> {
        let entry = self.entry(array)?.clone();
        let entry = &entry;
        refuse_bomb(entry)?;
        let mut contents = Contents::open(&mut self.file, self.size, entry)?;
        read_array(&mut contents, entry).map_err(|error| damage(error, array))
    }
}

/// An array of floats that is read some rows at a time, forward.
pub(super) struct Rows {
    path: PathBuf,
    contents: Contents<BufReader<File>>,
    entry: Entry,
    header: Header,
    /// Elements there are, and have been read.
    count: usize,
    read: usize,
}

impl Rows {
    /// n and V of floats of shape (n, V, 3); None for any other array.
    pub(super) fn frames_of_points(&self) -> Option<(usize, usize)> {
        match self.header.shape[..] {
            [n, v, 3] if self.header.kind == npy::Kind::Float => Some((n as usize, v as usize)),
            _ => None,
        }
    }

    /// Whether rows are scattered over the whole array.
    pub(super) fn is_first_index_fastest(&self) -> bool {
        self.header.fortran
    }

    /// What this is, as [`Array::describe`] says it.
    pub(super) fn describe(&self) -> String {
        let kind = match self.header.kind {
            npy::Kind::Float => "f64",
            npy::Kind::Signed | npy::Kind::Unsigned => "i64",
            npy::Kind::Text => return "text".into(),
        };
        format!("{kind} {:?}", self.header.shape)
    }

    /// Elements from here on; the last ones end with a look at the checksum of all.
    fn next(&mut self, count: usize) -> Result<Vec<f64>, ZipError> {
        let count = count.min(self.count - self.read);
        let found = elements::floats(&mut self.contents, &self.header, count, &self.entry.name)?;
        self.read += count;
        if self.read == self.count && count > 0 {
            check_end(&mut self.contents, &self.entry)?;
        }
        Ok(found)
    }

    fn rows(&mut self, first: usize, count: usize) -> Result<Vec<f64>, ZipError> {
        let row = self.count / (self.header.shape[0].max(1) as usize);
        while self.read < first * row {
            let some = row.min(first * row - self.read);
            self.next(some)?;
        }
        self.next(count * row)
    }
}

impl Source for Rows {
    fn read(&mut self, first: usize, count: usize) -> Result<Vec<f64>, FormatError> {
        let found = self.rows(first, count);
        found.map_err(|e| explain(&self.path, damage(e, &self.entry.name)))
    }
}

fn repeated(entries: &[Entry]) -> Option<String> {
    let mut names: Vec<&str> = entries.iter().map(|e| e.name.as_str()).collect();
    names.sort_unstable();
    let pair = names.windows(2).find(|pair| pair[0] == pair[1])?;
    Some(pair[0].to_string())
}

fn explain(path: &Path, error: ZipError) -> FormatError {
    match error {
        ZipError::Io(source) => FormatError::reading(path, source),
        ZipError::Problem(problem) => FormatError::Npz {
            path: path.to_path_buf(),
            problem,
        },
    }
}

/// Packed bytes that end early or make no sense are the archive's fault, not the operating system's.
fn damage(error: ZipError, array: &str) -> ZipError {
    use io::ErrorKind::{InvalidData, InvalidInput, UnexpectedEof};
    match error {
        ZipError::Io(e) if matches!(e.kind(), InvalidData | InvalidInput | UnexpectedEof) => {
            let reason = format!("array {array} does not unpack ({e})");
            NpzProblem::Damaged { reason }.into()
        }
        other => other,
    }
}

fn refuse_bomb(entry: &Entry) -> Result<(), NpzProblem> {
    let possible = entry.packed.saturating_mul(DEFLATE_LIMIT);
    let plausible = entry.packed.saturating_mul(PLAUSIBLE_RATIO).max(LARGE);
    match entry.unpacked > possible.min(plausible) {
        true => Err(NpzProblem::Bomb {
            array: entry.name.clone(),
            packed: entry.packed,
            unpacked: entry.unpacked,
        }),
        false => Ok(()),
    }
}

fn read_array<F: Read + Seek>(
    contents: &mut Contents<F>,
    entry: &Entry,
) -> Result<Array, ZipError> {
    let (header, before) = read_header(contents, &entry.name)?;
    let count = element_count(&header, before, entry)?;
    let array = elements::read(contents, &header, count, &entry.name)?;
    check_end(contents, entry)?;
    Ok(array)
}

/// An error unless all has been read and has the right checksum.
fn check_end<F: Read + Seek>(contents: &mut Contents<F>, entry: &Entry) -> Result<(), ZipError> {
    if contents.read(&mut [0])? != 0 {
        let reason = format!("array {} unpacks to more bytes than declared", entry.name);
        return Err(NpzProblem::Damaged { reason }.into());
    }
    match contents.checksum() {
        found if found != entry.crc => Err(NpzProblem::Checksum {
            array: entry.name.clone(),
            expected: entry.crc,
            found,
        }
        .into()),
        _ => Ok(()),
    }
}

/// The header and how many bytes it took.
fn read_header(contents: &mut impl Read, array: &str) -> Result<(Header, usize), ZipError> {
    let refuse = |refusal| {
        let array = array.to_string();
        match refusal {
            Refusal::Malformed(reason) => NpzProblem::Header { array, reason },
            Refusal::Unsupported(what) => NpzProblem::Unsupported { array, what },
        }
    };
    let mut bytes = vec![0; 12];
    contents.read_exact(&mut bytes)?;
    let (length, before) = npy::text_length(&bytes).map_err(refuse)?;
    let end = before + length;
    if end < bytes.len() {
        return Err(refuse(Refusal::Malformed("it is too short".into())).into());
    }
    bytes.resize(end, 0);
    contents.read_exact(&mut bytes[12..])?;
    let header = npy::parse(&bytes[before..]).map_err(refuse)?;
    Ok((header, end))
}

/// The number of elements, having seen that they and the header need exactly the bytes of the entry.
fn element_count(header: &Header, before: usize, entry: &Entry) -> Result<usize, NpzProblem> {
    let product = |total: u128, n: &u64| total.checked_mul((*n).into());
    let count = header.shape.iter().try_fold(1, product);
    let bytes = count.and_then(|n| n.checked_mul(header.width as u128));
    let expected = bytes.and_then(|n| n.checked_add(before as u128));
    if expected == Some(entry.unpacked.into())
        && let Some(Ok(count)) = count.map(usize::try_from)
    {
        return Ok(count);
    }
    Err(NpzProblem::Size {
        array: entry.name.clone(),
        shape: header.shape.clone(),
        expected: expected.unwrap_or(u128::MAX),
        found: entry.unpacked,
    })
}
