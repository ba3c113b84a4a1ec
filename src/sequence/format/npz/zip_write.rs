//! Archives of stored entries whose bytes depend on their contents only.

use std::io::{self, Seek, SeekFrom, Write};

use flate2::Crc;

/// 1 January 1980, the first date that ZIP knows: the same in every file.
const DATE: u16 = 0x21;
/// From here on, a size or an offset goes into a ZIP64 field.
const LARGE: u64 = u32::MAX as u64;

/// Takes a part of the contents.
pub(super) type Sink<'a> = &'a mut dyn FnMut(&[u8]) -> io::Result<()>;

/// Where the checksum stands in a local header.
const CRC_AT: u64 = 14;

struct Written {
    name: String,
    length: u64,
    crc: u32,
    at: u64,
}

/// An archive that grows by an entry at a time.
pub(super) struct Archive<W> {
    out: W,
    at: u64,
    entries: u64,
    directory: Vec<u8>,
    large: u64,
    /// The entry that is being written, and the checksum of its contents so far.
    open: Option<(Written, Crc)>,
}

impl<W: Write + Seek> Archive<W> {
    pub(super) fn new(out: W) -> Self {
        Self::with_threshold(out, LARGE)
    }

    fn with_threshold(out: W, large: u64) -> Self {
        Self {
            out,
            at: 0,
            entries: 0,
            directory: Vec::new(),
            large,
            open: None,
        }
    }

    /// What is written to.
    pub(super) fn out(&self) -> &W {
        &self.out
    }

    /// Begins an entry of so many bytes, which [`Self::part`] writes and [`Self::end`] ends.
    pub(super) fn begin(&mut self, name: String, length: u64) -> io::Result<()> {
        let written = Written {
            name,
            length,
            crc: 0,
            at: self.at,
        };
        let header = written.local_header(self.large);
        self.out.write_all(&header)?;
        self.at += header.len() as u64 + length;
        self.open = Some((written, Crc::new()));
        Ok(())
    }

    /// The next bytes of the entry.
    pub(super) fn part(&mut self, bytes: &[u8]) -> io::Result<()> {
        if let Some((_, crc)) = &mut self.open {
            crc.update(bytes);
        }
        self.out.write_all(bytes)
    }

    /// Goes back to put the checksum into the entry's header; nothing where no entry is open.
    pub(super) fn end(&mut self) -> io::Result<()> {
        let Some((mut written, crc)) = self.open.take() else {
            return Ok(());
        };
        written.crc = crc.sum();
        self.out.seek(SeekFrom::Start(written.at + CRC_AT))?;
        self.out.write_all(&written.crc.to_le_bytes())?;
        self.out.seek(SeekFrom::Start(self.at))?;
        self.entries += 1;
        self.directory.extend(written.directory_entry(self.large));
        Ok(())
    }

    /// Writes the directory.
    pub(super) fn finish(mut self) -> io::Result<W> {
        self.out.write_all(&self.directory)?;
        let size = self.directory.len() as u64;
        let end = end(self.entries, size, self.at, self.large);
        self.out.write_all(&end)?;
        Ok(self.out)
    }
}

impl Written {
    fn local_header(&self, large: u64) -> Vec<u8> {
        let extra = match self.length >= large {
            true => zip64(&[self.length, self.length]),
            false => Vec::new(),
        };
        let mut bytes = b"PK\x03\x04".to_vec();
        self.common(&mut bytes, &extra, large);
        bytes.extend(self.name.bytes());
        bytes.extend(extra);
        bytes
    }

    fn directory_entry(&self, large: u64) -> Vec<u8> {
        let mut wide = Vec::new();
        if self.length >= large {
            wide.extend([self.length, self.length]);
        }
        if self.at >= large {
            wide.push(self.at);
        }
        let extra = zip64(&wide);
        let mut bytes = b"PK\x01\x02".to_vec();
        bytes.extend(version(!extra.is_empty()).to_le_bytes());
        self.common(&mut bytes, &extra, large);
        // No comment, disk 0, no attributes.
        bytes.extend([0; 10]);
        bytes.extend(narrow(self.at, large).to_le_bytes());
        bytes.extend(self.name.bytes());
        bytes.extend(extra);
        bytes
    }

    /// What a local header and a directory entry share: version needed, flags, method, date, checksum, sizes, lengths.
    fn common(&self, bytes: &mut Vec<u8>, extra: &[u8], large: u64) {
        let utf8_name: u16 = if self.name.is_ascii() { 0 } else { 1 << 11 };
        for field in [version(!extra.is_empty()), utf8_name, 0, 0, DATE] {
            bytes.extend(field.to_le_bytes());
        }
        let length = narrow(self.length, large);
        for field in [self.crc, length, length] {
            bytes.extend(field.to_le_bytes());
        }
        for length in [self.name.len(), extra.len()] {
            bytes.extend((length as u16).to_le_bytes());
        }
    }
}

fn version(zip64: bool) -> u16 {
    if zip64 { 45 } else { 20 }
}

fn narrow(value: u64, large: u64) -> u32 {
    if value >= large {
        u32::MAX
    } else {
        value as u32
    }
}

/// The extra field of numbers beyond 32 bits; nothing when there are none.
fn zip64(values: &[u64]) -> Vec<u8> {
    if values.is_empty() {
        return Vec::new();
    }
    let mut bytes = 1u16.to_le_bytes().to_vec();
    bytes.extend((values.len() as u16 * 8).to_le_bytes());
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

fn end(entries: u64, size: u64, at: u64, large: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    if at >= large || size >= large || entries >= 0xFFFF {
        bytes.extend(b"PK\x06\x06");
        bytes.extend(44u64.to_le_bytes());
        bytes.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        for field in [entries, entries, size, at] {
            bytes.extend(field.to_le_bytes());
        }
        bytes.extend(b"PK\x06\x07\0\0\0\0");
        bytes.extend((at + size).to_le_bytes());
        bytes.extend(1u32.to_le_bytes());
    }
    let count = entries.min(0xFFFF) as u16;
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([count.to_le_bytes(), count.to_le_bytes()].concat());
    bytes.extend(narrow(size, large).to_le_bytes());
    bytes.extend(narrow(at, large).to_le_bytes());
    bytes.extend([0, 0]);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Another ZIP reader (npyz, through the zip crate) must read what we write, below and beyond the ZIP64 threshold.
    #[test]
    fn another_reader_agrees() {
        for large in [LARGE, 0, 100] {
            let array = [
                crate::sequence::format::npz::npy::header("<f8", &[2]),
                vec![0; 16],
            ]
            .concat();
            let mut bytes = Cursor::new(Vec::new());
            let mut archive = Archive::with_threshold(&mut bytes, large);
            for name in ["a.npy", "ä.npy"] {
                archive.begin(name.into(), array.len() as u64).unwrap();
                let (head, tail) = array.split_at(11);
                archive.part(head).unwrap();
                archive.part(tail).unwrap();
                archive.end().unwrap();
            }
            archive.finish().unwrap();
            bytes.set_position(0);
            let mut archive = npyz::npz::NpzArchive::new(bytes).unwrap();
            for name in ["a", "ä"] {
                let read = archive.by_name(name).unwrap().unwrap();
                assert_eq!(
                    read.into_vec::<f64>().unwrap(),
                    [0.0, 0.0],
                    "{large} {name}"
                );
            }
        }
    }
}
