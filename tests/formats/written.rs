//! What writing replaces, and what it leaves alone.

use super::*;

#[test]
fn where_nothing_can_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("file"), "").unwrap();
    fs::create_dir(at("c.npz")).unwrap();
    fs::create_dir(at("full")).unwrap();
    fs::write(at("full/notes.txt"), "mine").unwrap();
    fs::create_dir(at("nested")).unwrap();
    fs::create_dir(at("nested/1.obj")).unwrap();
    let before = contents(folder.path());
    let refusal = |name: &str| write(&counting(3), &at(name)).unwrap_err();
    for name in [
        "no/a",
        "no/a.npz",
        "no/a.pc2",
        "no/a.obj",
        "file/a",
        "file/a.npz",
    ] {
        let error = match name {
            "no/a.obj" => write(&counting(1), &at(name)).unwrap_err(),
            _ => refusal(name),
        };
        assert!(
            matches!(error, FormatError::ParentMissing { .. }),
            "{name}: {error}"
        );
    }
    assert!(matches!(refusal("c.npz"), FormatError::NotAFile { .. }));
    for name in ["full", "nested", "file"] {
        assert!(
            matches!(refusal(name), FormatError::WouldOverwrite { .. }),
            "{name}"
        );
    }
    assert!(matches!(refusal("a.obj"), FormatError::CannotHold { .. }));
    assert!(matches!(refusal("a.ply"), FormatError::Unsupported { .. }));
    assert_eq!(contents(folder.path()), before);
}

#[test]
fn what_is_replaced_and_what_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("frames")).unwrap();
    write(&counting(3), &at("frames")).unwrap();
    // What lies in a folder is never lost.
    let error = write(&counting(2), &at("frames")).unwrap_err();
    assert!(
        matches!(error, FormatError::WouldOverwrite { .. }),
        "{error}"
    );
    assert_eq!(read(&at("frames")).unwrap().frame_count(), 3);
    for frames in [5, 3] {
        for name in ["a.npz", "b.pc2"] {
            write(&counting(frames), &at(name)).unwrap();
            assert_eq!(read(&at(name)).unwrap().frame_count(), frames, "{name}");
        }
    }
    assert_eq!(contents(folder.path()).len(), 3 + 1 + 2);
    // An OBJ of another mesh beside a cache is not ours to replace.
    fs::write(at("b.obj"), GOOD).unwrap();
    let error = write(&counting(3), &at("b.pc2")).unwrap_err();
    assert!(
        matches!(error, FormatError::WouldOverwrite { .. }),
        "{error}"
    );
    assert_eq!(fs::read_to_string(at("b.obj")).unwrap(), GOOD);
    write(&counting(1), &at("one.obj")).unwrap();
    assert_eq!(
        read(&at("one.obj")).unwrap().positions(),
        counting(1).positions()
    );
}

#[cfg(unix)]
#[test]
fn a_folder_without_permission() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let closed = folder.path().join("closed");
    fs::create_dir(&closed).unwrap();
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o555)).unwrap();
    // The superuser may write anywhere; then only the mapping of the error is tested (beside `bytes.rs`).
    let superuser = fs::write(closed.join("probe"), "").is_ok();
    for name in ["a", "a.npz", "a.pc2"] {
        let result = write(&counting(2), &closed.join(name));
        assert!(
            superuser || matches!(result, Err(FormatError::NotWritable { .. })),
            "{name}: {result:?}"
        );
    }
}
