//! Bytes in from a file whose size is known first, bytes out to a file or folder that appears whole or not at all.

use std::fs::{self, File, Permissions};
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::error::FormatError;

/// How many bytes a regular file holds; anything else is refused.
pub(super) fn size(path: &Path) -> Result<u64, FormatError> {
    let meta = fs::metadata(path).map_err(|e| FormatError::reading(path, e))?;
    match meta.is_file() {
        true => Ok(meta.len()),
        false => Err(FormatError::NotAFile {
            path: path.to_path_buf(),
        }),
    }
}

/// Opens a regular file and says how many bytes it holds.
pub(super) fn open(path: &Path) -> Result<(File, u64), FormatError> {
    // Looked at before it is opened: opening a named pipe would wait for a writer.
    let size = size(path)?;
    let file = File::open(path).map_err(|e| FormatError::reading(path, e))?;
    Ok((file, size))
}

/// Reads a whole regular file into `buffer`, whose memory is reused.
pub(super) fn read_into(path: &Path, buffer: &mut Vec<u8>) -> Result<(), FormatError> {
    let (file, bytes) = open(path)?;
    buffer.clear();
    usize::try_from(bytes)
        .ok()
        .and_then(|size| buffer.try_reserve(size.saturating_add(1)).ok())
        .ok_or_else(|| FormatError::OutOfMemory {
            path: path.to_path_buf(),
            bytes,
        })?;
    file.take(bytes)
        .read_to_end(buffer)
        .map_err(|e| FormatError::reading(path, e))?;
    Ok(())
}

/// A file written under a temporary name beside its destination; dropping it removes it.
pub(super) struct Draft {
    out: BufWriter<tempfile::NamedTempFile>,
    path: PathBuf,
}

impl Draft {
    /// An empty one. `path` is where it is to go in the end.
    pub(super) fn create(path: &Path) -> Result<Self, FormatError> {
        if path.exists() && !path.is_file() {
            return Err(FormatError::NotAFile {
                path: path.to_path_buf(),
            });
        }
        let parent = parent_of(path)?;
        let file = temporary(0o666).tempfile_in(parent);
        let file = file.map_err(|e| FormatError::writing(path, e))?;
        Ok(Self {
            out: BufWriter::with_capacity(1 << 16, file),
            path: path.to_path_buf(),
        })
    }

    /// Where it is to go in the end.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes what `fill` writes.
    pub(super) fn write(
        path: &Path,
        fill: impl FnOnce(&mut Self) -> io::Result<()>,
    ) -> Result<Self, FormatError> {
        let mut draft = Self::create(path)?;
        let filled = fill(&mut draft).and_then(|()| draft.flush());
        match filled {
            Ok(()) => Ok(draft),
            Err(e) => Err(FormatError::writing(path, e)),
        }
    }

    /// Moves the draft to its destination, replacing the file that was there.
    pub(super) fn keep(mut self) -> Result<(), FormatError> {
        let path = std::mem::take(&mut self.path);
        let failed = |e| FormatError::writing(&path, e);
        self.out.flush().map_err(failed)?;
        // Nothing is left in the buffer.
        let (file, _) = self.out.into_parts();
        match file.persist(&path) {
            Ok(_) => Ok(()),
            Err(e) => Err(failed(e.error)),
        }
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Seek for Draft {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.out.seek(to)
    }
}

/// A folder of frames under a temporary name beside its destination; dropping it removes it and all that it holds.
pub(super) struct FolderDraft {
    folder: tempfile::TempDir,
    path: PathBuf,
    /// The destination itself, where `path` is a link or a path such as `.`.
    target: PathBuf,
}

impl FolderDraft {
    /// An empty one. A folder that is at `path` already will be replaced, but only when it is empty.
    pub(super) fn create(path: &Path) -> Result<Self, FormatError> {
        let failed = |e| FormatError::writing(path, e);
        let there = path.exists();
        // A link or a path such as `.` is followed to the folder itself, which can be renamed.
        let target = match there {
            true => path.canonicalize().map_err(failed)?,
            false => path.to_path_buf(),
        };
        if there {
            refuse_full_folder(&target)?;
        }
        let parent = parent_of(&target)?;
        let folder = temporary(0o777).tempdir_in(&parent).map_err(failed)?;
        Ok(Self {
            folder,
            path: path.to_path_buf(),
            target,
        })
    }

    /// Where it is to go in the end.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The temporary folder, to put files into.
    pub(super) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Moves the draft to its destination, in place of an empty folder if there is one.
    pub(super) fn keep(self) -> Result<(), FormatError> {
        let failed = |e| FormatError::writing(&self.path, e);
        if self.target.exists() {
            refuse_full_folder(&self.target)?;
            fs::remove_dir(&self.target).map_err(failed)?;
        }
        fs::rename(self.folder.path(), &self.target).map_err(failed)?;
        let _ = self.folder.keep();
        Ok(())
    }
}

/// The folder that holds `path`, which must exist.
fn parent_of(path: &Path) -> Result<PathBuf, FormatError> {
    let parent = match path.parent() {
        Some(parent) if parent.as_os_str().is_empty() => Path::new("."),
        Some(parent) => parent,
        None => path,
    };
    match parent.is_dir() && path.file_name().is_some() {
        true => Ok(parent.to_path_buf()),
        false => Err(FormatError::ParentMissing {
            path: path.to_path_buf(),
            parent: parent.to_path_buf(),
        }),
    }
}

fn refuse_full_folder(path: &Path) -> Result<(), FormatError> {
    let refuse = |reason: String| FormatError::WouldOverwrite {
        path: path.to_path_buf(),
        reason,
    };
    if !path.is_dir() {
        return Err(refuse("it is a file, not a folder".into()));
    }
    let mut entries = fs::read_dir(path).map_err(|e| FormatError::writing(path, e))?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(refuse("it is not empty".into())),
    }
}

/// Temporary names that are hidden, and permissions as for any new file (the umask applies).
fn temporary(mode: u32) -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".meshseq-").suffix(".part");
    #[cfg(unix)]
    builder.permissions(<Permissions as std::os::unix::fs::PermissionsExt>::from_mode(mode));
    builder
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::OpenOptions;

    fn write_file(
        path: &Path,
        fill: impl FnOnce(&mut Draft) -> io::Result<()>,
    ) -> Result<(), FormatError> {
        Draft::write(path, fill)?.keep()
    }

    /// Takes `room` bytes, then fails as a full disk does.
    struct Limited<W> {
        inner: W,
        room: usize,
    }

    impl<W: Write> Write for Limited<W> {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            match bytes.len() <= self.room {
                true => {
                    self.room -= bytes.len();
                    self.inner.write_all(bytes).map(|()| bytes.len())
                }
                false => Err(io::ErrorKind::StorageFull.into()),
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            self.inner.flush()
        }
    }

    fn entries(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name());
        names.map(|n| n.into_string().unwrap()).collect()
    }

    #[test]
    fn a_full_disk_leaves_what_was_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        fs::write(&path, "before").unwrap();
        for room in [0, 10, 100_000] {
            let error = write_file(&path, |inner| {
                let mut out = Limited { inner, room };
                (0..200).try_for_each(|_| out.write_all(&[7; 1000]))
            });
            assert!(
                matches!(error, Err(FormatError::DiskFull { .. })),
                "{error:?}"
            );
            assert_eq!(fs::read(&path).unwrap(), b"before");
            assert_eq!(entries(folder.path()), ["a.bin"]);
        }
    }

    /// The operating system's own error for a full disk, from the device that always gives it.
    #[cfg(target_os = "linux")]
    #[test]
    fn the_full_device_is_a_full_disk() {
        let folder = tempfile::tempdir().unwrap();
        let mut full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let error = write_file(&folder.path().join("a"), |_| full.write_all(b"x"));
        assert!(
            matches!(error, Err(FormatError::DiskFull { .. })),
            "{error:?}"
        );
        assert_eq!(entries(folder.path()), [""; 0]);
    }

    /// A socket stands for any device or pipe: should the guard fail, the test must not replace one of the machine's own.
    #[cfg(unix)]
    #[test]
    fn what_is_no_regular_file_is_not_replaced_by_one() {
        use std::os::unix::fs::FileTypeExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let error = write_file(&path, |out| out.write_all(b"x"));
        assert!(
            matches!(error, Err(FormatError::NotAFile { .. })),
            "{error:?}"
        );
        assert!(fs::metadata(&path).unwrap().file_type().is_socket());
        assert_eq!(entries(folder.path()), ["socket"]);
    }

    #[test]
    fn a_folder_whose_frames_fail_is_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames");
        for before in [0, 1] {
            let draft = FolderDraft::create(&path).unwrap();
            fs::write(draft.folder().join("0001.obj"), "v 0 0 0").unwrap();
            drop(draft);
            assert_eq!(entries(folder.path()).len(), before);
            fs::create_dir_all(&path).unwrap();
        }
        assert!(entries(&path).is_empty());
        // What comes to lie there meanwhile is not lost.
        let draft = FolderDraft::create(&path).unwrap();
        fs::write(path.join("7.obj"), "v 1 1 1").unwrap();
        assert!(draft.keep().is_err());
        assert_eq!(entries(&path), ["7.obj"]);
        assert_eq!(entries(folder.path()), ["frames"]);
    }

    #[test]
    fn refusals_of_the_system_keep_their_kind() {
        let error = FormatError::writing(Path::new("a"), io::ErrorKind::PermissionDenied.into());
        assert!(matches!(error, FormatError::NotWritable { .. }));
        let error = FormatError::writing(Path::new("a"), io::ErrorKind::ReadOnlyFilesystem.into());
        assert!(matches!(error, FormatError::NotWritable { .. }));
        let error = FormatError::reading(Path::new("a"), io::ErrorKind::NotFound.into());
        assert!(matches!(error, FormatError::Missing { .. }));
    }

    #[cfg(unix)]
    #[test]
    fn new_files_and_folders_have_the_permissions_of_new_files_and_folders() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let mode = |name: &str| {
            fs::metadata(folder.path().join(name))
                .unwrap()
                .permissions()
                .mode()
        };
        fs::write(folder.path().join("a"), "").unwrap();
        fs::create_dir(folder.path().join("b")).unwrap();
        write_file(&folder.path().join("c"), |_| Ok(())).unwrap();
        let folder_draft = FolderDraft::create(&folder.path().join("d")).unwrap();
        folder_draft.keep().unwrap();
        assert_eq!((mode("a"), mode("b")), (mode("c"), mode("d")));
    }
}
