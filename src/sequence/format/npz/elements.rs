//! Elements of arrays: from the bytes of an entry, and back.

use std::io::{self, Read};

use super::npy::{Header, Kind};
use super::zip_read::ZipError;
use super::zip_write::Sink;
use super::{Array, ArrayView, NpzProblem};

/// Bytes converted at a time; a multiple of every width.
const CHUNK: usize = 1 << 16;

/// Reads the `count` elements that follow `header`; both have been held against the size of the archive.
pub(super) fn read(
    source: &mut impl Read,
    header: &Header,
    count: usize,
    array: &str,
) -> Result<Array, ZipError> {
    let shape: Vec<usize> = header.shape.iter().map(|&n| n as usize).collect();
    match header.kind {
        Kind::Float => {
            let data = row_major(&shape, header, floats(source, header, count, array)?);
            Ok(Array::F64 { shape, data })
        }
        Kind::Signed | Kind::Unsigned => {
            let data = row_major(&shape, header, integers(source, header, count, array)?);
            Ok(Array::I64 { shape, data })
        }
        Kind::Text if shape.is_empty() => Ok(Array::Text(text(source, header, array)?)),
        Kind::Text => Err(NpzProblem::Unsupported {
            array: array.to_string(),
            what: format!("an array of texts, of shape {shape:?}"),
        }
        .into()),
    }
}

fn reserve<T>(count: usize, array: &str) -> Result<Vec<T>, NpzProblem> {
    let mut data = Vec::new();
    match data.try_reserve_exact(count) {
        Ok(()) => Ok(data),
        Err(_) => Err(NpzProblem::OutOfMemory {
            array: array.to_string(),
            bytes: count as u128 * size_of::<T>() as u128,
        }),
    }
}

/// Passes `length` bytes of `source` to `take`, a chunk at a time.
fn chunks(source: &mut impl Read, length: usize, mut take: impl FnMut(&[u8])) -> io::Result<()> {
    let mut chunk = vec![0; CHUNK.min(length)];
    let mut left = length;
    while left > 0 {
        let part = left.min(CHUNK);
        source.read_exact(&mut chunk[..part])?;
        take(&chunk[..part]);
        left -= part;
    }
    Ok(())
}

/// The next `count` floats, widened.
pub(super) fn floats(
    source: &mut impl Read,
    header: &Header,
    count: usize,
    array: &str,
) -> Result<Vec<f64>, ZipError> {
    let mut data = reserve(count, array)?;
    chunks(source, count * header.width, |bytes| {
        let (doubles, singles) = (bytes.as_chunks().0, bytes.as_chunks().0);
        match (header.width, header.big_endian) {
            (8, false) => data.extend(doubles.iter().map(|&w| f64::from_le_bytes(w))),
            (8, true) => data.extend(doubles.iter().map(|&w| f64::from_be_bytes(w))),
            (_, false) => data.extend(singles.iter().map(|&w| f64::from(f32::from_le_bytes(w)))),
            (_, true) => data.extend(singles.iter().map(|&w| f64::from(f32::from_be_bytes(w)))),
        }
    })?;
    Ok(data)
}

fn integers(
    source: &mut impl Read,
    header: &Header,
    count: usize,
    array: &str,
) -> Result<Vec<i64>, ZipError> {
    let mut data = reserve(count, array)?;
    let mut too_large = None;
    chunks(source, count * header.width, |bytes| {
        for word in bytes.chunks_exact(header.width) {
            let value = widen(word, header);
            if value.is_none() {
                too_large.get_or_insert((data.len(), word.to_vec()));
            }
            data.push(value.unwrap_or_default());
        }
    })?;
    match too_large {
        None => Ok(data),
        Some((at, word)) => Err(NpzProblem::Integer {
            array: array.to_string(),
            at,
            value: bits(&word, header).to_string(),
            expected: "at most 2^63 - 1",
        }
        .into()),
    }
}

/// The value of an integer of at most 8 bytes, unless it is unsigned and beyond `i64`.
fn widen(word: &[u8], header: &Header) -> Option<i64> {
    let value = bits(word, header);
    let unused = 64 - 8 * word.len();
    match header.kind {
        Kind::Signed => Some(((value << unused) as i64) >> unused),
        _ => i64::try_from(value).ok(),
    }
}

fn bits(word: &[u8], header: &Header) -> u64 {
    let add = |value, &byte: &u8| value << 8 | u64::from(byte);
    match header.big_endian {
        true => word.iter().fold(0, add),
        false => word.iter().rev().fold(0, add),
    }
}

/// The text of a numpy string scalar, without the zeros that pad it.
fn text(source: &mut impl Read, header: &Header, array: &str) -> Result<String, ZipError> {
    let mut codes: Vec<u32> = reserve(header.width / 4, array)?;
    chunks(source, header.width, |bytes| {
        codes.extend(bytes.chunks_exact(4).map(|w| bits(w, header) as u32));
    })?;
    let length = codes
        .iter()
        .rposition(|&c| c != 0)
        .map_or(0, |last| last + 1);
    let to_char = |&code: &u32| {
        char::from_u32(code).ok_or_else(|| NpzProblem::Character {
            array: array.to_string(),
            code,
        })
    };
    Ok(codes[..length]
        .iter()
        .map(to_char)
        .collect::<Result<_, _>>()?)
}

/// Puts elements that are stored first index fastest into row-major order.
fn row_major<T: Copy>(shape: &[usize], header: &Header, data: Vec<T>) -> Vec<T> {
    if !header.fortran || shape.len() < 2 || data.is_empty() {
        return data;
    }
    let mut ordered = Vec::with_capacity(data.len());
    let mut index = vec![0; shape.len()];
    for _ in 0..data.len() {
        let at = index
            .iter()
            .zip(shape)
            .rev()
            .fold(0, |at, (i, n)| at * n + i);
        ordered.push(data[at]);
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            if index[axis] < shape[axis] {
                break;
            }
            index[axis] = 0;
        }
    }
    ordered
}

/// How numpy names the type of these elements.
pub(super) fn dtype(array: &ArrayView) -> String {
    match array {
        ArrayView::F64 { .. } => "<f8".into(),
        ArrayView::I64 { .. } => "<i8".into(),
        // Like numpy, which has no empty string type: one zero.
        ArrayView::Text(text) => format!("<U{}", text.chars().count().max(1)),
    }
}

/// Bytes of all elements.
pub(super) fn length(array: &ArrayView) -> usize {
    match array {
        ArrayView::F64 { data, .. } => data.len() * 8,
        ArrayView::I64 { data, .. } => data.len() * 8,
        ArrayView::Text(text) => text.chars().count().max(1) * 4,
    }
}

/// Passes the little-endian bytes of all elements to `sink`, a chunk at a time.
pub(super) fn produce(array: &ArrayView, sink: Sink) -> io::Result<()> {
    match array {
        ArrayView::F64 { data, .. } => words(data, |x| x.to_le_bytes(), sink),
        ArrayView::I64 { data, .. } => words(data, |x| x.to_le_bytes(), sink),
        ArrayView::Text("") => sink(&[0; 4]),
        ArrayView::Text(text) => {
            let bytes = text.chars().flat_map(|c| u32::from(c).to_le_bytes());
            sink(&bytes.collect::<Vec<u8>>())
        }
    }
}

fn words<T: Copy>(data: &[T], bytes: impl Fn(T) -> [u8; 8], sink: Sink) -> io::Result<()> {
    let mut chunk = vec![[0; 8]; (CHUNK / 8).min(data.len())];
    for part in data.chunks(CHUNK / 8) {
        for (word, &x) in chunk.iter_mut().zip(part) {
            *word = bytes(x);
        }
        sink(chunk[..part.len()].as_flattened())?;
    }
    Ok(())
}
