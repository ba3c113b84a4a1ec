//! The part of the ZIP format that NPZ files use: a directory of stored or deflated entries, also beyond 4 GiB (ZIP64).
//!
//! Every offset and length is held against the size of the file before anything is read or reserved for it. (The APPNOTE
//! of PKWARE, sections 4.3.7 to 4.3.16 and 4.5.3, defines the records.)

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Take};

use flate2::Crc;
use flate2::read::DeflateDecoder;

use super::NpzProblem;

/// One entry of the directory.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) packed: u64,
    pub(super) unpacked: u64,
    pub(super) crc: u32,
    method: u16,
    encrypted: bool,
    at: u64,
}

/// Either what the operating system says or what is wrong with the archive.
pub(super) enum ZipError {
    Io(io::Error),
    Problem(NpzProblem),
}

impl From<io::Error> for ZipError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<NpzProblem> for ZipError {
    fn from(problem: NpzProblem) -> Self {
        Self::Problem(problem)
    }
}

/// The end record is at least this long, and a comment of up to 65535 bytes may follow it.
const END: u64 = 22;

pub(super) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from(u16_at(bytes, at)) | u32::from(u16_at(bytes, at + 2)) << 16
}

pub(super) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}

fn damaged(reason: &str) -> NpzProblem {
    NpzProblem::Damaged {
        reason: reason.to_string(),
    }
}

/// Where the directory lies: its entries, its offset and its size.
struct Directory {
    entries: u64,
    at: u64,
    size: u64,
}

/// Reads the directory of an archive of `size` bytes.
pub(super) fn directory(file: &mut BufReader<File>, size: u64) -> Result<Vec<Entry>, ZipError> {
    let tail_at = size.saturating_sub(END + 65_535);
    let tail = read_at(file, tail_at, size - tail_at)?;
    let Some(end) = find_end(&tail) else {
        return Err(diagnose(file, size)?.into());
    };
    let end_at = tail_at + end as u64;
    let directory = locate(file, &tail[end..], end_at)?;
    if directory
        .at
        .checked_add(directory.size)
        .is_none_or(|to| to > end_at)
    {
        return Err(damaged("its directory lies outside the file").into());
    }
    let bytes = read_at(file, directory.at, directory.size)?;
    let entries = parse_directory(&bytes)?;
    match entries.len() as u64 == directory.entries {
        true => Ok(entries),
        false => {
            Err(damaged("its directory has another number of entries than its end says").into())
        }
    }
}

fn read_at(file: &mut (impl Read + Seek), at: u64, length: u64) -> io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(at))?;
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes)?;
    match bytes.len() as u64 == length {
        true => Ok(bytes),
        false => Err(io::ErrorKind::UnexpectedEof.into()),
    }
}

/// The last end record whose comment reaches exactly to the end of the file.
fn find_end(tail: &[u8]) -> Option<usize> {
    let starts = (0..(tail.len() + 1).saturating_sub(END as usize)).rev();
    starts.into_iter().find(|&at| {
        let record = &tail[at..];
        record.starts_with(b"PK\x05\x06") && record.len() == 22 + usize::from(u16_at(record, 20))
    })
}

/// Reads the directory's place from the end record (at least 22 bytes), or from the ZIP64 record that stands in for it.
fn locate(file: &mut BufReader<File>, end: &[u8], end_at: u64) -> Result<Directory, ZipError> {
    let small = Directory {
        entries: u16_at(end, 10).into(),
        size: u32_at(end, 12).into(),
        at: u32_at(end, 16).into(),
    };
    let overflows = small.entries == 0xFFFF || small.size == 0xFFFF_FFFF || small.at == 0xFFFF_FFFF;
    if !overflows || end_at < 20 {
        return Ok(small);
    }
    let locator = read_at(file, end_at - 20, 20)?;
    if !locator.starts_with(b"PK\x06\x07") {
        return Ok(small);
    }
    let at = u64_at(&locator, 8);
    if at.checked_add(56).is_none_or(|to| to > end_at) {
        return Err(damaged("its ZIP64 end lies outside the file").into());
    }
    let record = read_at(file, at, 56)?;
    if !record.starts_with(b"PK\x06\x06") {
        return Err(damaged("its ZIP64 end is missing").into());
    }
    Ok(Directory {
        entries: u64_at(&record, 32),
        size: u64_at(&record, 40),
        at: u64_at(&record, 48),
    })
}

fn parse_directory(mut bytes: &[u8]) -> Result<Vec<Entry>, NpzProblem> {
    let mut entries = Vec::new();
    while !bytes.is_empty() {
        if bytes.len() < 46 || !bytes.starts_with(b"PK\x01\x02") {
            return Err(damaged("an entry of its directory is cut off"));
        }
        let lengths = [28, 30, 32].map(|at| usize::from(u16_at(bytes, at)));
        let (fixed, rest) = bytes.split_at(46);
        if rest.len() < lengths.iter().sum() {
            return Err(damaged("an entry of its directory is cut off"));
        }
        let (name, rest) = rest.split_at(lengths[0]);
        let (extra, rest) = rest.split_at(lengths[1]);
        entries.push(parse_entry(fixed, name, extra));
        bytes = &rest[lengths[2]..];
    }
    Ok(entries)
}

fn parse_entry(fixed: &[u8], name: &[u8], extra: &[u8]) -> Entry {
    // In the ZIP64 field stand only those of the three that do not fit above, in this order.
    let mut large = zip64_field(extra).chunks_exact(8).map(|c| u64_at(c, 0));
    let mut wide = |at| match u32_at(fixed, at) {
        u32::MAX => large.next().unwrap_or(u32::MAX.into()),
        value => value.into(),
    };
    let (unpacked, packed, at) = (wide(24), wide(20), wide(42));
    Entry {
        name: String::from_utf8_lossy(name).into_owned(),
        packed,
        unpacked,
        crc: u32_at(fixed, 16),
        method: u16_at(fixed, 10),
        encrypted: u16_at(fixed, 8) & 1 != 0,
        at,
    }
}

/// The contents of the extra field 1, or nothing.
fn zip64_field(mut extra: &[u8]) -> &[u8] {
    while extra.len() >= 4 {
        let (kind, length) = (u16_at(extra, 0), usize::from(u16_at(extra, 2)));
        let contents = extra.get(4..4 + length).unwrap_or_default();
        if kind == 1 {
            return contents;
        }
        extra = extra.get(4 + length..).unwrap_or_default();
    }
    &[]
}

/// Why there is no end record: the file is no archive at all, or cut off (then its first entries say how much it needs).
fn diagnose(file: &mut BufReader<File>, size: u64) -> Result<NpzProblem, ZipError> {
    let mut at = 0;
    while size - at >= 30 {
        let fixed = read_at(file, at, 30)?;
        if !fixed.starts_with(b"PK\x03\x04") {
            break;
        }
        let [name, extra] = [26, 28].map(|field| u64::from(u16_at(&fixed, field)));
        let rest = read_at(file, at + 30, (size - at - 30).min(name + extra))?;
        let (name, extra) = rest.split_at(rest.len().min(name as usize));
        let packed = match u32_at(&fixed, 18) {
            u32::MAX => zip64_field(extra)
                .get(8..16)
                .map_or(0, |field| u64_at(field, 0)),
            packed => packed.into(),
        };
        let expected = (at + 30 + rest.len() as u64).saturating_add(packed);
        if expected > size {
            return Ok(NpzProblem::CutOff {
                what: format!("entry {}", name.escape_ascii()),
                expected,
                found: size,
            });
        }
        at = expected;
    }
    Ok(match at {
        0 => NpzProblem::NotAnArchive {
            reason: format!("found no ZIP directory in its {size} bytes"),
        },
        _ => NpzProblem::CutOff {
            what: "its directory".into(),
            expected: (at + END).max(size + 1),
            found: size,
        },
    })
}

/// The unpacked bytes of an entry of a file, with the checksum of what has been read so far.
pub(super) struct Contents<F> {
    source: Source<F>,
    crc: Crc,
}

enum Source<F> {
    Stored(Take<F>),
    Deflated(Box<DeflateDecoder<Take<F>>>),
}

impl<F: Read + Seek> Contents<F> {
    /// Goes to an entry of an archive of `size` bytes, having seen that all its packed bytes are there.
    pub(super) fn open(file: F, size: u64, entry: &Entry) -> Result<Self, ZipError> {
        let unsupported = |what: String| NpzProblem::Unsupported {
            array: entry.name.clone(),
            what,
        };
        if entry.encrypted {
            return Err(unsupported("encryption".into()).into());
        }
        let packed = packed_bytes(file, size, entry)?;
        let source = match entry.method {
            0 if entry.packed != entry.unpacked => {
                return Err(damaged("a stored entry has two different sizes").into());
            }
            0 => Source::Stored(packed),
            8 => Source::Deflated(Box::new(DeflateDecoder::new(packed))),
            method => return Err(unsupported(format!("ZIP compression method {method}")).into()),
        };
        Ok(Self {
            source,
            crc: Crc::new(),
        })
    }

    /// The checksum of the bytes read so far.
    pub(super) fn checksum(&self) -> u32 {
        self.crc.sum()
    }
}

fn packed_bytes<F: Read + Seek>(
    mut file: F,
    size: u64,
    entry: &Entry,
) -> Result<Take<F>, ZipError> {
    let cut_off = |expected| NpzProblem::CutOff {
        what: format!("entry {}", entry.name),
        expected,
        found: size,
    };
    let header_end = entry.at.saturating_add(30);
    if header_end > size {
        return Err(cut_off(header_end).into());
    }
    let fixed = read_at(&mut file, entry.at, 30)?;
    if !fixed.starts_with(b"PK\x03\x04") {
        return Err(damaged("an entry is not where its directory says").into());
    }
    let start = header_end + u64::from(u16_at(&fixed, 26)) + u64::from(u16_at(&fixed, 28));
    let end = start.saturating_add(entry.packed);
    if end > size {
        return Err(cut_off(end).into());
    }
    file.seek(SeekFrom::Start(start))?;
    Ok(file.take(entry.packed))
}

impl<F: Read> Read for Contents<F> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let length = match &mut self.source {
            Source::Stored(source) => source.read(buffer)?,
            Source::Deflated(source) => source.read(buffer)?,
        };
        self.crc.update(&buffer[..length]);
        Ok(length)
    }
}
