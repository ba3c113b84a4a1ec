//! Which files make up a sequence of OBJ frames.

use std::ffi::OsStr;
use std::fs::{self, DirEntry};
use std::path::{Path, PathBuf};

use super::error::FormatError;
use super::natural;

/// The OBJ files that `path` names, in natural order (see [`natural::compare`]).
///
/// `path` is a folder (all its `*.obj` files), one `.obj` file, or a pattern whose file name holds `*` or `?`
/// (those of its matches that end in `.obj`). The ending may be in capitals; hidden files (`.name`) and folders never
/// count. A file whose name itself holds `*` or `?` is taken literally when it exists. Reads names only, no contents.
pub fn frame_files(path: &Path) -> Result<Vec<PathBuf>, FormatError> {
    let path_buf = || path.to_path_buf();
    if path.is_dir() {
        return list(path, path, b"*");
    }
    if path.exists() {
        return match has_extension(path, "obj") {
            true => Ok(vec![path_buf()]),
            false => Err(FormatError::Unsupported { path: path_buf() }),
        };
    }
    match path.file_name().map(OsStr::as_encoded_bytes) {
        Some(pattern) if pattern.iter().any(|c| b"*?".contains(c)) => {
            list(path, path.parent().unwrap_or(Path::new("")), pattern)
        }
        _ => Err(FormatError::Missing { path: path_buf() }),
    }
}

/// Whether `path` ends in `.extension`, in capitals or not.
pub(super) fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

fn list(asked: &Path, folder: &Path, pattern: &[u8]) -> Result<Vec<PathBuf>, FormatError> {
    let here = Path::new(".");
    let place = if folder.as_os_str().is_empty() {
        here
    } else {
        folder
    };
    let failed = |e| FormatError::reading(place, e);
    let mut names = Vec::new();
    for entry in fs::read_dir(place).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name();
        if is_frame(&entry) && matches(pattern, name.as_encoded_bytes()) {
            names.push(name);
        }
    }
    if names.is_empty() {
        return Err(FormatError::NoFrames {
            path: asked.to_path_buf(),
        });
    }
    names.sort_by(|a, b| natural::compare(a.as_encoded_bytes(), b.as_encoded_bytes()));
    Ok(names.iter().map(|name| folder.join(name)).collect())
}

/// A visible `*.obj` that is not a folder. A dangling link counts, so that reading it fails instead of losing a frame.
pub(super) fn is_frame(entry: &DirEntry) -> bool {
    let path = entry.path();
    has_extension(&path, "obj")
        && !entry.file_name().as_encoded_bytes().starts_with(b".")
        && !path.is_dir()
}

/// Whether `name` matches a pattern of `*` (any bytes) and `?` (any one byte). Costs at most their product.
fn matches(pattern: &[u8], name: &[u8]) -> bool {
    let (mut p, mut n) = (0, 0);
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some(b'*') => {
                star = Some((p, n));
                p += 1;
            }
            Some(&c) if c == b'?' || c == name[n] => (p, n) = (p + 1, n + 1),
            _ => match star {
                Some((at, from)) => {
                    star = Some((at, from + 1));
                    (p, n) = (at + 1, from + 1);
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == b'*')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(paths: &[PathBuf]) -> Vec<&str> {
        paths
            .iter()
            .map(|p| p.file_name().unwrap().to_str().unwrap())
            .collect()
    }

    #[test]
    fn patterns() {
        for (pattern, name, expected) in [
            ("*", "", true),
            ("mesh_*.obj", "mesh_12.obj", true),
            ("mesh_*.obj", "mesh_12.objx", false),
            ("mesh_?.obj", "mesh_12.obj", false),
            ("mesh_??.obj", "mesh_12.obj", true),
            ("*a*b", "xaabxb", true),
            ("*a*b", "xaabx", false),
            ("a", "", false),
            ("?", "", false),
        ] {
            assert_eq!(
                matches(pattern.as_bytes(), name.as_bytes()),
                expected,
                "{pattern} {name}"
            );
        }
    }

    #[test]
    fn a_long_hopeless_pattern_ends() {
        let pattern = b"*a".repeat(200);
        assert!(!matches(&pattern, &b"a".repeat(199)));
    }

    #[test]
    fn folders_hidden_files_and_others_do_not_count() {
        let folder = tempfile::tempdir().unwrap();
        for name in [
            "10.obj",
            "9.obj",
            "2.OBJ",
            ".3.obj",
            "notes.txt",
            "4.obj.bak",
        ] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        fs::create_dir(folder.path().join("5.obj")).unwrap();
        let found = frame_files(folder.path()).unwrap();
        assert_eq!(names(&found), ["2.OBJ", "9.obj", "10.obj"]);
        let found = frame_files(&folder.path().join("?.obj")).unwrap();
        assert_eq!(names(&found), ["9.obj"]);
        let none = frame_files(&folder.path().join("z*"));
        assert!(
            matches!(none, Err(FormatError::NoFrames { .. })),
            "{none:?}"
        );
        let missing = frame_files(&folder.path().join("77.obj"));
        assert!(
            matches!(missing, Err(FormatError::Missing { .. })),
            "{missing:?}"
        );
        let missing = frame_files(&folder.path().join("no/*.obj"));
        assert!(
            matches!(missing, Err(FormatError::Missing { .. })),
            "{missing:?}"
        );
        let other = frame_files(&folder.path().join("notes.txt"));
        assert!(
            matches!(other, Err(FormatError::Unsupported { .. })),
            "{other:?}"
        );
    }
}
