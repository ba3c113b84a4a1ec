//! What can go wrong with a sequence on disk.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::npz::NpzProblem;
use super::obj::ObjProblem;
use crate::mesh::ConnectivityError;
use crate::sequence::SequenceError;

/// Why a sequence could not be read or written.
///
/// Frames are counted from 1, vertices and faces from 0, lines and columns (in bytes) from 1.
#[derive(Debug, Error)]
pub enum FormatError {
    /// The path names nothing.
    #[error("{}: there is no such file or folder; check the path", .path.display())]
    Missing { path: PathBuf },
    /// The path names something that is neither a file nor what was asked for: a folder, a device, a pipe.
    #[error("{}: expected a regular file, found something else; give the path of a file", .path.display())]
    NotAFile { path: PathBuf },
    /// A file of a kind that is not read or written here.
    #[error(
        "{}: this kind of file is not supported; give a folder of .obj files, one .obj, a pattern such as \
         'dir/mesh_*.obj', a .npz or a .pc2", .path.display()
    )]
    Unsupported { path: PathBuf },
    /// A folder or pattern without any OBJ file.
    #[error("{}: found no .obj files; check the folder or the pattern", .path.display())]
    NoFrames { path: PathBuf },
    /// The operating system refused to read or write.
    #[error("{}: cannot {action}: {source}", .path.display())]
    Io {
        action: &'static str,
        path: PathBuf,
        source: io::Error,
    },
    /// The file is larger than the memory that is left.
    #[error("{}: {bytes} bytes do not fit into memory; use a shorter sequence", .path.display())]
    OutOfMemory { path: PathBuf, bytes: u64 },
    /// The folder in which to write does not exist.
    #[error("{}: cannot write, because the folder {} does not exist; create it first", .path.display(), .parent.display())]
    ParentMissing { path: PathBuf, parent: PathBuf },
    /// No permission to write there.
    #[error("{}: not permitted to write: {source}; choose another place or change its permissions", .path.display())]
    NotWritable { path: PathBuf, source: io::Error },
    /// No room to write; nothing was left behind.
    #[error("{}: the disk is full: {source}; nothing was written, free some space and repeat", .path.display())]
    DiskFull { path: PathBuf, source: io::Error },
    /// What is there already is not ours to replace.
    #[error("{}: will not replace it: {reason}; remove it or choose another name", .path.display())]
    WouldOverwrite { path: PathBuf, reason: String },
    /// A file format that cannot hold this sequence.
    #[error("{}: {reason}", .path.display())]
    CannotHold { path: PathBuf, reason: String },
    /// A file without a single byte.
    #[error("{} (frame {frame}): the file is empty", .path.display())]
    Empty { path: PathBuf, frame: usize },
    /// An OBJ file without `v` lines.
    #[error("{} (frame {frame}): found no vertices; an OBJ file needs lines 'v x y z'", .path.display())]
    NoVertices { path: PathBuf, frame: usize },
    /// A line of an OBJ file that cannot be understood.
    #[error("{}:{line}:{column} (frame {frame}): {problem}", .path.display())]
    Obj {
        path: PathBuf,
        frame: usize,
        line: usize,
        column: usize,
        problem: ObjProblem,
    },
    /// A frame with another number of vertices than the first.
    #[error(
        "{} (frame {frame}): found {found} vertices, expected {expected} as in {}; \
         all frames must share one connectivity", .path.display(), .first.display()
    )]
    VertexCount {
        path: PathBuf,
        frame: usize,
        found: u64,
        expected: u64,
        first: PathBuf,
    },
    /// A frame with another number of triangles than the first; those that both have are the same.
    #[error(
        "{} (frame {frame}): found {found} triangles, expected {expected} as in {}: they differ from triangle {} \
         (0-based) on; all frames must share one connectivity", .path.display(), .first.display(), .found.min(.expected)
    )]
    FaceCount {
        path: PathBuf,
        frame: usize,
        found: usize,
        expected: usize,
        first: PathBuf,
    },
    /// A frame with another triangle than the first frame.
    #[error(
        "{}:{line} (frame {frame}): triangle {face} (0-based) is {found:?}, expected {expected:?} (0-based vertices) as in {}; \
         all frames must share one connectivity", .path.display(), .first.display()
    )]
    FaceDiffers {
        path: PathBuf,
        frame: usize,
        line: usize,
        face: usize,
        found: [u32; 3],
        expected: [u32; 3],
        first: PathBuf,
    },
    /// A file that holds fewer (or more) bytes than its own header says.
    #[error("{}: {what}: expected {expected} bytes, found {found}; the file is cut off or damaged", .path.display())]
    Size {
        path: PathBuf,
        what: String,
        expected: u128,
        found: u64,
    },
    /// A PC2 file that cannot be understood.
    #[error("{}: {reason}", .path.display())]
    Pc2 { path: PathBuf, reason: String },
    /// An NPZ file that cannot be understood.
    #[error("{}: {problem}", .path.display())]
    Npz { path: PathBuf, problem: NpzProblem },
    /// The faces do not fit the vertices.
    #[error("{}: {source}", .path.display())]
    Connectivity {
        path: PathBuf,
        source: ConnectivityError,
    },
    /// The positions do not make a sequence.
    #[error("{}: {source}", .path.display())]
    Sequence {
        path: PathBuf,
        source: SequenceError,
    },
}

impl FormatError {
    /// An operating system error met while reading `path`.
    pub(super) fn reading(path: &Path, source: io::Error) -> Self {
        let path = path.to_path_buf();
        match source.kind() {
            io::ErrorKind::NotFound => Self::Missing { path },
            _ => Self::Io {
                action: "read",
                path,
                source,
            },
        }
    }

    /// An operating system error met while writing `path`.
    pub(super) fn writing(path: &Path, source: io::Error) -> Self {
        use io::ErrorKind::*;
        let path = path.to_path_buf();
        match source.kind() {
            StorageFull | QuotaExceeded | FileTooLarge | WriteZero => {
                Self::DiskFull { path, source }
            }
            PermissionDenied | ReadOnlyFilesystem => Self::NotWritable { path, source },
            _ => Self::Io {
                action: "write",
                path,
                source,
            },
        }
    }
}
