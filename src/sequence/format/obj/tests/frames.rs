//! Several frames over one connectivity.

use super::*;

fn files(texts: &[String]) -> (tempfile::TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<_> = (0..texts.len())
        .map(|i| folder.path().join(format!("{i}.obj")))
        .collect();
    for (path, text) in paths.iter().zip(texts) {
        std::fs::write(path, text).unwrap();
    }
    (folder, paths)
}

/// The frame's positions in closed form: `i` everywhere.
fn frame(i: usize, faces: &str) -> String {
    format!("v {i} {i} {i}\n").repeat(4) + faces
}

#[test]
fn frames_may_write_the_same_faces_in_other_ways() {
    let ways = [
        "f 1 2 3\nf 2 4 3\n",
        "f 1 2 3\nf 2 4 3\n",
        "f 1 2 3\r\nf 2 4 3",
        "f -4 -3 -2\nf -3 -1 -2\n",
        "g x\nf 1/1 2 3\n# f\nf 2 4 3\n",
        "f 1 2 3\n\nf 1 2 3\nf 2 4 3\n",
    ];
    let texts: Vec<_> = ways[..5]
        .iter()
        .enumerate()
        .map(|(i, faces)| frame(i, faces))
        .collect();
    let (_folder, paths) = files(&texts);
    let sequence = read(&paths).unwrap();
    assert_eq!(sequence.connectivity().faces(), [[0, 1, 2], [1, 3, 2]]);
    (0..5).for_each(|i| assert_eq!(sequence.frame(i), [i as f64; 12]));
    // The text of the first frame's faces ends this one too, but a face stands before it.
    let (_folder, paths) = files(&[frame(0, ways[0]), frame(1, ways[5])]);
    let error = read(&paths).unwrap_err();
    assert!(
        matches!(
            error,
            FormatError::FaceDiffers {
                face: 1,
                line: 7,
                frame: 2,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn the_fast_path_is_taken_only_where_it_means_the_same() {
    let tail = "f 1 2 3\n";
    let first = |text: String| {
        let (_folder, paths) = files(&[text]);
        First::read(&paths[0]).unwrap().0
    };
    let plain = first(frame(0, tail));
    let mut out = [0.0; 12];
    assert!(plain.ends_alike(frame(7, tail).as_bytes(), &mut out));
    assert_eq!(out, [7.0; 12]);
    for other in [
        frame(1, "f 1 2 3"),
        frame(1, "# \nv 1 1 1\nf 1 2 3\n"),
        frame(1, "#f 1 2 3\n"),
        frame(1, "f 2 1 3\nf 1 2 3\n"),
        "f 1 2 3\n".into(),
        frame(1, "v 1 2 3 \\\nf 1 2 3\n"),
        frame(1, "v 1 2 x\nf 1 2 3\n"),
    ] {
        assert!(!plain.ends_alike(other.as_bytes(), &mut out), "{other}");
    }
    assert_eq!(first(frame(0, "f -1 -2 -3\n")).faces_text, None);
    assert_eq!(first(frame(0, "f 1 2 3\nv 0 0 0\n")).faces_text, None);
    assert_eq!(first(frame(0, "")).faces_text, None);
}
