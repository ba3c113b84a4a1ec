//! What can be wrong with an NPZ file.

use thiserror::Error;

/// What is wrong with an NPZ archive or one of its arrays.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum NpzProblem {
    /// Not a ZIP archive, or one that was cut off before its directory.
    #[error("not an NPZ file: {reason}; write it with numpy.savez or this program")]
    NotAnArchive { reason: String },
    /// The archive's own records contradict each other or the file.
    #[error("the archive is damaged: {reason}")]
    Damaged { reason: String },
    /// The file ends before something that it must hold.
    #[error(
        "the file is cut off: {what} needs {expected} bytes of file, found {found}; copy it again"
    )]
    CutOff {
        what: String,
        expected: u64,
        found: u64,
    },
    /// Something of ZIP or NPY that is not read here.
    #[error("array {array}: {what} is not supported; save it with numpy.savez and without pickle")]
    Unsupported { array: String, what: String },
    /// An NPY header that cannot be understood.
    #[error("array {array}: cannot understand its NPY header: {reason}")]
    Header { array: String, reason: String },
    /// The shape promises more or fewer bytes than the archive holds for this array.
    #[error(
        "array {array}: its shape {shape:?} needs {expected} bytes with its header, the archive holds {found}"
    )]
    Size {
        array: String,
        shape: Vec<u64>,
        expected: u128,
        found: u64,
    },
    /// A few packed bytes that claim to unpack to far more than measured data ever does.
    #[error(
        "array {array}: {packed} bytes claim to unpack to {unpacked}; refused as a decompression bomb"
    )]
    Bomb {
        array: String,
        packed: u64,
        unpacked: u64,
    },
    /// An array that does not fit into memory.
    #[error("array {array}: {bytes} bytes do not fit into memory")]
    OutOfMemory { array: String, bytes: u128 },
    /// The bytes are not those that were written.
    #[error(
        "array {array}: its checksum is {found:08x}, expected {expected:08x}; the file is damaged, copy it again"
    )]
    Checksum {
        array: String,
        expected: u32,
        found: u32,
    },
    /// An array that is needed and not there.
    #[error("no array {array}; the file holds {}{}", .found.join(", "), hint(.found))]
    Missing { array: String, found: Vec<String> },
    /// An array of another kind than needed.
    #[error("array {array}: expected {expected}, found {found}")]
    Kind {
        array: String,
        expected: &'static str,
        found: String,
    },
    /// An integer too large (or negative) for its purpose.
    #[error("array {array}: element {at} (0-based, row-major) is {value}, expected {expected}")]
    Integer {
        array: String,
        at: usize,
        value: String,
        expected: &'static str,
    },
    /// A character code that is none.
    #[error("array {array}: {code:#x} is no Unicode character")]
    Character { array: String, code: u32 },
    /// Something that cannot be written so that it reads back the same.
    #[error("array {array}: cannot be written: {reason}")]
    CannotWrite { array: String, reason: String },
}

/// What a file may be that is no sequence.
fn hint(found: &[String]) -> &'static str {
    let holds = |name: &str| found.iter().any(|found| found == name);
    match holds("h0") || holds("windows") {
        true => "; it is a representation, of which `meshseq signal sample` makes frames",
        false => "",
    }
}
