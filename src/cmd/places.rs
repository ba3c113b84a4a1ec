//! Where a verb reads and writes: no result takes the place of an input or of another result. Asked before any work is done.

use std::fs;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::output::{OutputError, check_parent, check_place};
use crate::sequence::format::{source_files, written_files};

/// Why a verb's results cannot go where they are to go.
#[derive(Debug, Error)]
pub enum PlaceError {
    /// What is read would be lost.
    #[error("{output} {}: cannot write, because it is what is read as {input}; name another place", .path.display())]
    IsInput {
        output: &'static str,
        path: PathBuf,
        input: &'static str,
    },
    /// One of two results would be lost.
    #[error("{output} {}: cannot write, because {other} goes to the same place; name two", .path.display())]
    Shared {
        output: &'static str,
        path: PathBuf,
        other: &'static str,
    },
    /// See [`OutputError`].
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// The files that a verb reads and those that it writes, under the names that its usage gives them.
#[derive(Default)]
pub struct Places {
    inputs: Vec<Input>,
    outputs: Vec<Output>,
}

struct Input {
    name: &'static str,
    files: Vec<PathBuf>,
}

struct Output {
    name: &'static str,
    path: PathBuf,
    files: Vec<PathBuf>,
    /// A file must not be a folder; a sequence may be one.
    is_file: bool,
}

impl Places {
    /// A file that is read, where there is one.
    pub fn reads<P: AsRef<Path>>(mut self, name: &'static str, path: Option<P>) -> Self {
        if let Some(path) = path {
            let files = vec![resolved(path.as_ref())];
            self.inputs.push(Input { name, files });
        }
        self
    }

    /// A sequence that is read: all of its files, and the folder that is named. An embedded one has none.
    pub fn reads_sequence(mut self, name: &'static str, argument: &str) -> Self {
        if !argument.starts_with('@') {
            let path = Path::new(argument);
            // What cannot be read is told when it is read.
            let files = source_files(path).unwrap_or_default();
            let files = files.iter().map(PathBuf::as_path).chain([path]);
            let files = files.map(resolved).collect();
            self.inputs.push(Input { name, files });
        }
        self
    }

    /// A file that is written, where it is asked for.
    pub fn writes<P: AsRef<Path>>(mut self, name: &'static str, path: Option<P>) -> Self {
        if let Some(path) = path {
            let path = path.as_ref();
            self.outputs.push(Output {
                name,
                path: path.into(),
                files: lasting([path]),
                is_file: true,
            });
        }
        self
    }

    /// A sequence that is written, with the mesh beside it in formats that have one there.
    pub fn writes_sequence(mut self, name: &'static str, path: &Path) -> Self {
        let files = written_files(path);
        self.outputs.push(Output {
            name,
            path: path.into(),
            files: lasting(files.iter().map(PathBuf::as_path)),
            is_file: false,
        });
        self
    }

    /// An error where a result could not be written, or where it would take the place of what is read or of another result.
    pub fn check(&self) -> Result<(), PlaceError> {
        for (i, output) in self.outputs.iter().enumerate() {
            match output.is_file {
                true => check_place(&output.path)?,
                false => check_parent(&output.path)?,
            }
            let same = |files: &[PathBuf]| files.iter().any(|file| output.files.contains(file));
            if let Some(input) = self.inputs.iter().find(|input| same(&input.files)) {
                return Err(PlaceError::IsInput {
                    output: output.name,
                    path: output.path.clone(),
                    input: input.name,
                });
            }
            if let Some(other) = self.outputs[..i].iter().find(|other| other.meets(output)) {
                return Err(PlaceError::Shared {
                    output: output.name,
                    path: output.path.clone(),
                    other: other.name,
                });
            }
        }
        Ok(())
    }
}

impl Output {
    /// Whether the two have a file in common, or one lies in the folder that the other is to become.
    fn meets(&self, other: &Self) -> bool {
        let both = |a: &PathBuf, b: &PathBuf| a.starts_with(b) || b.starts_with(a);
        let any = |a| other.files.iter().any(|b| both(a, b));
        self.files.iter().any(any)
    }
}

/// Those that can be lost: not devices and pipes, which take everything that is written to them.
fn lasting<'a>(files: impl IntoIterator<Item = &'a Path>) -> Vec<PathBuf> {
    let is_device = |path: &Path| path.exists() && !path.is_file() && !path.is_dir();
    let files = files.into_iter().filter(|file| !is_device(file));
    files.map(resolved).collect()
}

/// One name for a file however it is written, also where it does not exist yet.
fn resolved(path: &Path) -> PathBuf {
    if let Ok(there) = fs::canonicalize(path) {
        return there;
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = fs::canonicalize(folder.unwrap_or(Path::new(".")));
    match (folder, path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        folder
    }

    #[test]
    fn a_file_is_the_same_under_every_name() {
        let folder = folder(&["a.npz", "frames/1.obj"]);
        let at = |name: &str| folder.path().join(name);
        for (read, written) in [
            ("a.npz", "frames/../a.npz"),
            ("frames/1.obj", "frames/./1.obj"),
        ] {
            let places = Places::default().reads("SEQ", Some(at(read)));
            let found = places.writes("--json", Some(at(written))).check();
            assert!(
                matches!(found, Err(PlaceError::IsInput { input: "SEQ", .. })),
                "{written}: {found:?}"
            );
        }
        let places = Places::default().writes("--json", Some(at("new")));
        let found = places.writes("--plot", Some(at("./new"))).check();
        let Err(PlaceError::Shared { output, other, .. }) = found else {
            panic!("{found:?}")
        };
        assert_eq!([output, other], ["--plot", "--json"]);
    }

    #[test]
    fn the_files_of_a_sequence_count_and_what_lies_beside_them_does_not() {
        let folder = folder(&["frames/1.obj", "frames/2.obj", "a.pc2", "a.obj"]);
        let at = |name: &str| folder.path().join(name);
        let check = |read: &str, written: &str| {
            let read = at(read);
            let places = Places::default().reads_sequence("SEQ", read.to_str().unwrap());
            places.writes("--json", Some(at(written))).check()
        };
        for (read, written) in [
            ("frames", "frames/2.obj"),
            ("frames/*.obj", "frames/2.obj"),
            ("a.pc2", "a.pc2"),
            ("a.pc2", "a.obj"),
        ] {
            let found = check(read, written);
            assert!(
                matches!(found, Err(PlaceError::IsInput { .. })),
                "{read} {written}"
            );
        }
        for (read, written) in [
            ("frames", "frames/told.json"),
            ("frames/1.obj", "frames/2.obj"),
            ("a.pc2", "frames/1.obj"),
        ] {
            assert!(check(read, written).is_ok(), "{read} {written}");
        }
        let embedded = Places::default().reads_sequence("SEQ", "@gallop");
        assert!(embedded.writes("--json", Some("@gallop")).check().is_ok());
    }

    #[test]
    fn a_written_sequence_is_all_its_files() {
        let folder = folder(&["there.obj"]);
        let at = |name: &str| folder.path().join(name);
        for (sequence, json) in [
            ("new.pc2", "new.obj"),
            ("new.npz", "new.npz"),
            ("new", "new"),
        ] {
            let places = Places::default().writes_sequence("-o", &at(sequence));
            let found = places.writes("--json", Some(at(json))).check();
            assert!(matches!(found, Err(PlaceError::Shared { .. })), "{json}");
        }
        let mesh = at("there.obj");
        let places = Places::default().reads_sequence("SEQ", mesh.to_str().unwrap());
        let found = places.writes_sequence("-o", &at("there.pc2")).check();
        assert!(matches!(found, Err(PlaceError::IsInput { .. })));
    }

    #[test]
    #[cfg(unix)]
    fn a_device_takes_two_results() {
        let places = Places::default().writes("--json", Some("/dev/null"));
        assert!(places.writes("--plot", Some("/dev/null")).check().is_ok());
    }
}
