//! The wire protocol of `oracles/PROTOCOL.md`.

use std::io::{self, Read, Write};

use thiserror::Error;

use crate::arrays::{Array, Bundle};

const MAGIC: &[u8; 4] = b"MSEQ";
/// No message holds more bytes than this; what claims to is garbage.
const LONGEST: u64 = 4 << 30;
const MOST_RECORDS: u32 = 1000;
const MOST_DIMENSIONS: u8 = 8;
/// Memory is taken as bytes arrive, this many at a time, never because a header asks for it.
const STEP: usize = 1 << 20;

/// Why bytes are not a message.
#[derive(Debug, Error)]
pub enum WireError {
    /// The stream ended between messages.
    #[error("the stream ended")]
    End,
    /// The stream failed or ended inside a message.
    #[error("the stream broke off: {0}")]
    Io(#[from] io::Error),
    /// Bytes that no message has.
    #[error("not a message: {0}")]
    Garbage(String),
}

/// Writes the arrays as one message.
pub fn write_message(out: &mut impl Write, arrays: &Bundle) -> io::Result<()> {
    out.write_all(MAGIC)?;
    out.write_all(&(arrays.0.len() as u32).to_le_bytes())?;
    for (name, array) in &arrays.0 {
        out.write_all(&(name.len() as u16).to_le_bytes())?;
        out.write_all(name.as_bytes())?;
        match array {
            Array::F64 { shape, data } => {
                write_header(out, 1, shape)?;
                write_numbers(out, data, |x| x.to_le_bytes())?;
            }
            Array::I64 { shape, data } => {
                write_header(out, 2, shape)?;
                write_numbers(out, data, |x| x.to_le_bytes())?;
            }
            Array::Text(text) => {
                write_header(out, 3, &[text.len()])?;
                out.write_all(text.as_bytes())?;
            }
        }
    }
    out.flush()
}

fn write_header(out: &mut impl Write, dtype: u8, shape: &[usize]) -> io::Result<()> {
    out.write_all(&[dtype, shape.len() as u8])?;
    for &extent in shape {
        out.write_all(&(extent as u64).to_le_bytes())?;
    }
    Ok(())
}

fn write_numbers<T: Copy>(
    out: &mut impl Write,
    data: &[T],
    bytes: impl Fn(T) -> [u8; 8],
) -> io::Result<()> {
    for chunk in data.chunks(STEP / 8) {
        let block: Vec<u8> = chunk.iter().flat_map(|&x| bytes(x)).collect();
        out.write_all(&block)?;
    }
    Ok(())
}

/// Reads the next message.
pub fn read_message(stream: &mut impl Read) -> Result<Bundle, WireError> {
    read_bounded(stream, LONGEST)
}

/// `left` are the bytes that the message's arrays may hold.
fn read_bounded(stream: &mut impl Read, mut left: u64) -> Result<Bundle, WireError> {
    let mut magic = [0; 4];
    let first = stream.read(&mut magic[..1])?;
    if first == 0 {
        return Err(WireError::End);
    }
    stream.read_exact(&mut magic[1..])?;
    if &magic != MAGIC {
        return Err(WireError::Garbage(format!(
            "it starts with {magic:?}, expected {MAGIC:?}"
        )));
    }
    let count = u32::from_le_bytes(read(stream)?);
    if count > MOST_RECORDS {
        return Err(WireError::Garbage(format!(
            "{count} records, at most {MOST_RECORDS}"
        )));
    }
    let mut bundle = Bundle::default();
    for _ in 0..count {
        let (name, array) = read_record(stream, &mut left)?;
        if bundle.0.contains_key(&name) {
            return Err(WireError::Garbage(format!("two records named `{name}`")));
        }
        bundle.0.insert(name, array);
    }
    Ok(bundle)
}

fn read<const N: usize>(stream: &mut impl Read) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    stream.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// `left` are the bytes that the message may still hold.
fn read_record(stream: &mut impl Read, left: &mut u64) -> Result<(String, Array), WireError> {
    let length = u16::from_le_bytes(read(stream)?);
    let name = text(read_bytes(stream, length.into())?)?;
    let [dtype, rank] = read(stream)?;
    if rank > MOST_DIMENSIONS {
        return Err(WireError::Garbage(format!(
            "`{name}` has {rank} dimensions"
        )));
    }
    let shape = (0..rank)
        .map(|_| Ok(u64::from_le_bytes(read(stream)?)))
        .collect::<io::Result<Vec<u64>>>()?;
    let width = if dtype == 3 { 1 } else { 8 };
    let bytes = shape
        .iter()
        .try_fold(width, |size: u64, &extent| size.checked_mul(extent))
        .filter(|size| size <= left)
        .ok_or_else(|| WireError::Garbage(format!("`{name}` claims the shape {shape:?}")))?;
    *left -= bytes;
    let payload = read_bytes(stream, bytes as usize)?;
    let shape = shape.iter().map(|&extent| extent as usize).collect();
    let array = match dtype {
        1 => Array::F64 {
            shape,
            data: numbers(&payload, f64::from_le_bytes),
        },
        2 => Array::I64 {
            shape,
            data: numbers(&payload, i64::from_le_bytes),
        },
        3 => Array::Text(text(payload)?),
        _ => {
            return Err(WireError::Garbage(format!(
                "`{name}` has the unknown dtype {dtype}"
            )));
        }
    };
    Ok((name, array))
}

fn numbers<T>(payload: &[u8], number: impl Fn([u8; 8]) -> T) -> Vec<T> {
    payload
        .as_chunks::<8>()
        .0
        .iter()
        .map(|&b| number(b))
        .collect()
}

fn text(bytes: Vec<u8>) -> Result<String, WireError> {
    String::from_utf8(bytes).map_err(|_| WireError::Garbage("a text that is not UTF-8".into()))
}

fn read_bytes(stream: &mut impl Read, count: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    while bytes.len() < count {
        let start = bytes.len();
        bytes.resize(count.min(start + STEP.max(start)), 0);
        stream.read_exact(&mut bytes[start..])?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bytes(bundle: &Bundle) -> Vec<u8> {
        let mut out = Vec::new();
        write_message(&mut out, bundle).unwrap();
        out
    }

    #[test]
    fn messages_come_back_as_they_went() {
        let bundle = Bundle::from([
            (
                "Z",
                Array::F64 {
                    shape: vec![2, 3],
                    data: vec![1.0, -2.0, 0.1, f64::MIN_POSITIVE, 4.0, 5.0],
                },
            ),
            (
                "none",
                Array::F64 {
                    shape: vec![0, 3],
                    data: vec![],
                },
            ),
            ("k", Array::integer(7)),
            ("rule", Array::Text("literal".into())),
        ]);
        assert_eq!(read_message(&mut &bytes(&bundle)[..]).unwrap(), bundle);
    }

    #[test]
    fn a_header_of_a_trillion_numbers_takes_no_memory() {
        let mut message = b"MSEQ\x01\0\0\0\x01\0Z\x01\x01".to_vec();
        message.extend(1_000_000_000_000u64.to_le_bytes());
        assert!(matches!(
            read_message(&mut &message[..]),
            Err(WireError::Garbage(_))
        ));
        assert!(matches!(read_message(&mut &b""[..]), Err(WireError::End)));
        assert!(matches!(
            read_message(&mut &b"hello world"[..]),
            Err(WireError::Garbage(_))
        ));
    }

    #[test]
    fn the_bytes_of_all_records_count() {
        let one = Array::vector(&[1.0; 10]);
        let message = bytes(&Bundle::from([("a", one.clone()), ("b", one)]));
        assert!(read_bounded(&mut &message[..], 160).is_ok());
        assert!(matches!(
            read_bounded(&mut &message[..], 159),
            Err(WireError::Garbage(what)) if what.contains("`b` claims")
        ));
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(start in 0usize..60, noise in prop::collection::vec(any::<u8>(), 0..200)) {
            let good = bytes(&Bundle::from([("Z", Array::vector(&[1.0; 4])), ("k", Array::integer(3))]));
            let mut message = good[..start.min(good.len())].to_vec();
            message.extend(noise);
            let _ = read_message(&mut &message[..]);
        }
    }
}
