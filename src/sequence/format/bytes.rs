//! Bytes in from a file whose size is known first, bytes out to a file or folder that appears whole or not at all.

use std::fs::{self, File, Permissions};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use super::error::FormatError;
use super::files;

/// Opens a regular file and says how many bytes it holds.
pub(super) fn open(path: &Path) -> Result<(File, u64), FormatError> {
    let failed = |e| FormatError::reading(path, e);
    // Looked at before it is opened: opening a named pipe would wait for a writer.
    let meta = fs::metadata(path).map_err(failed)?;
    if !meta.is_file() {
        return Err(FormatError::NotAFile {
            path: path.to_path_buf(),
        });
    }
    Ok((File::open(path).map_err(failed)?, meta.len()))
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
    file: tempfile::NamedTempFile,
    path: PathBuf,
}

impl Draft {
    /// Writes what `fill` writes. `path` is where it is to go in the end.
    pub(super) fn write(
        path: &Path,
        fill: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
    ) -> Result<Self, FormatError> {
        let failed = |e| FormatError::writing(path, e);
        if path.exists() && !path.is_file() {
            return Err(FormatError::NotAFile {
                path: path.to_path_buf(),
            });
        }
        let parent = parent_of(path)?;
        let mut file = temporary(0o666).tempfile_in(parent).map_err(failed)?;
        let mut writer = BufWriter::with_capacity(1 << 16, file.as_file_mut());
        let filled = fill(&mut writer).and_then(|()| writer.flush());
        // Unwritten bytes of a failed draft are dropped with it, not tried again.
        let _ = writer.into_parts();
        filled.map_err(failed)?;
        Ok(Self {
            file,
            path: path.to_path_buf(),
        })
    }

    /// Moves the draft to its destination, replacing the file that was there.
    pub(super) fn keep(self) -> Result<(), FormatError> {
        match self.file.persist(&self.path) {
            Ok(_) => Ok(()),
            Err(e) => Err(FormatError::writing(&self.path, e.error)),
        }
    }
}

/// Writes a file whole or not at all: under a temporary name in the same folder, then renamed.
pub(super) fn write_file(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> Result<(), FormatError> {
    Draft::write(path, fill)?.keep()
}

/// Writes a folder of frames whole or not at all: `fill` fills a temporary folder beside it, which is then renamed.
///
/// A folder that is there already is replaced only when all it holds are OBJ files.
pub(super) fn write_folder(
    path: &Path,
    fill: impl FnOnce(&Path) -> Result<(), FormatError>,
) -> Result<(), FormatError> {
    let failed = |e| FormatError::writing(path, e);
    let there = path.exists();
    // A link or a path such as `.` is followed to the folder itself, which can be renamed.
    let target = match there {
        true => path.canonicalize().map_err(failed)?,
        false => path.to_path_buf(),
    };
    if there {
        refuse_foreign_folder(&target)?;
    }
    let parent = parent_of(&target)?;
    let draft = temporary(0o777).tempdir_in(&parent).map_err(failed)?;
    fill(draft.path())?;
    if there {
        swap_in(draft.path(), &target, &parent).map_err(failed)?;
    } else {
        fs::rename(draft.path(), &target).map_err(failed)?;
    }
    let _ = draft.keep();
    Ok(())
}

/// Puts `draft` in the place of `target`, whose contents are deleted once that is done; on failure they are put back.
fn swap_in(draft: &Path, target: &Path, parent: &Path) -> io::Result<()> {
    let old = temporary(0o777).tempdir_in(parent)?;
    fs::rename(target, old.path())?;
    fs::rename(draft, target).inspect_err(|_| {
        let aside = old.keep();
        let _ = fs::rename(aside, target);
    })
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

fn refuse_foreign_folder(path: &Path) -> Result<(), FormatError> {
    let refuse = |reason: String| FormatError::WouldOverwrite {
        path: path.to_path_buf(),
        reason,
    };
    if !path.is_dir() {
        return Err(refuse("it is a file, not a folder".into()));
    }
    for entry in fs::read_dir(path).map_err(|e| FormatError::writing(path, e))? {
        let entry = entry.map_err(|e| FormatError::writing(path, e))?;
        if !files::is_frame(&entry) {
            let name = entry.file_name();
            let reason = format!("it holds {}, which is not an OBJ frame", name.display());
            return Err(refuse(reason));
        }
    }
    Ok(())
}

/// Temporary names that are hidden, and permissions as for any new file (the umask applies).
fn temporary(mode: u32) -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".meshseq-").suffix(".part");
    #[cfg(unix)]
    builder.permissions(<Permissions as std::os::unix::fs::PermissionsExt>::from_mode(mode));
    builder
}
