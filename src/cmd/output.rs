//! Writing results: under a temporary name, then renamed; progress only where somebody looks.

use std::fs::{self, File};
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use tempfile::NamedTempFile;
use thiserror::Error;

use super::Failure;

/// Why a result was not written.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The folder in which to write does not exist.
    #[error("{}: cannot write, because the folder {} does not exist; create it first", .path.display(), .folder.display())]
    NoFolder { path: PathBuf, folder: PathBuf },
    /// The name of a folder where that of a file is needed.
    #[error("{}: cannot write, because it is a folder; name a file", .path.display())]
    IsFolder { path: PathBuf },
    /// The operating system refused: no room, no permission.
    #[error("{}: cannot write: {source}; nothing was written, make room or choose another place and repeat", .path.display())]
    Refused { path: PathBuf, source: io::Error },
}

/// An error where a file could not be written because of where it is to go; to be asked before long work.
pub fn check_place(path: &Path) -> Result<(), OutputError> {
    if path.is_dir() {
        return Err(OutputError::IsFolder { path: path.into() });
    }
    check_parent(path)
}

/// An error where nothing could be written because the folder above does not exist.
pub fn check_parent(path: &Path) -> Result<(), OutputError> {
    let parent = path.parent().unwrap_or(path);
    let folder = match parent.as_os_str().is_empty() {
        true => Path::new("."),
        false => parent,
    };
    if !folder.is_dir() {
        let (path, folder) = (path.into(), folder.into());
        return Err(OutputError::NoFolder { path, folder });
    }
    Ok(())
}

/// A text on disk that has not got its name yet; dropping it removes it.
pub struct Draft {
    /// None where the text has gone to a device or pipe, which cannot be replaced.
    file: Option<NamedTempFile>,
    path: PathBuf,
}

impl Draft {
    /// Writes the text under a temporary name beside its destination. A link is followed, a device or pipe is written to at once.
    pub fn new(path: &Path, text: &str) -> Result<Self, OutputError> {
        check_place(path)?;
        let refused = |source| OutputError::Refused {
            path: path.into(),
            source,
        };
        if path.exists() && !path.is_file() {
            let mut device = File::options().write(true).open(path).map_err(refused)?;
            device.write_all(text.as_bytes()).map_err(refused)?;
            let (file, path) = (None, path.into());
            return Ok(Self { file, path });
        }
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.into());
        let mut file = temporary(&path).map_err(refused)?;
        file.write_all(text.as_bytes()).map_err(refused)?;
        let file = Some(file);
        Ok(Self { file, path })
    }

    /// Gives the text its name, in place of the file that had it.
    pub fn keep(self) -> Result<(), OutputError> {
        let Some(file) = self.file else { return Ok(()) };
        match file.persist(&self.path) {
            Ok(_) => Ok(()),
            Err(error) => Err(OutputError::Refused {
                path: self.path,
                source: error.error,
            }),
        }
    }
}

/// A hidden file beside `path`, with the permissions of any new file.
fn temporary(path: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".meshseq-").suffix(".part");
    #[cfg(unix)]
    builder.permissions(<fs::Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666));
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    builder.tempfile_in(folder.unwrap_or(Path::new(".")))
}

/// Writes a whole file or none.
pub fn write_whole(path: &Path, text: &str) -> Result<(), OutputError> {
    Draft::new(path, text)?.keep()
}

/// Numbers as JSON, for `--json`, to be kept when all else is written.
pub fn draft_json(path: &Path, value: &serde_json::Value) -> Result<Draft, Failure> {
    let text = format!("{}\n", serde_json::to_string_pretty(value)?);
    Ok(Draft::new(path, &text)?)
}

/// A bar on standard error while standard output is a terminal; nothing otherwise. It goes away where it ends, also by an error.
pub fn progress(steps: usize) -> ProgressBar {
    if !std::io::stdout().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(steps as u64).with_finish(ProgressFinish::AndClear);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}") {
        bar.set_style(style);
    }
    bar
}

/// Text on standard output; a reader that has gone away ends the program quietly.
pub fn say(text: &str) {
    if writeln!(std::io::stdout(), "{text}").is_err() {
        std::process::exit(0);
    }
}
