//! What several tests need: a small sequence, and the program run with bounded memory and watched for what it leaves behind.
#![allow(dead_code)]

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

use meshseq::mesh::Connectivity;
use meshseq::sequence::Sequence;

/// The program under test.
pub const MESHSEQ: &str = env!("CARGO_BIN_EXE_meshseq");

/// Kilobytes of address space that a run may take: what a product of matrices reserves (1 GB, of which it touches little) and some, far less than
/// what a lying header asks for.
const MEMORY: &str = "1500000";

/// n frames of a waving sheet of w x h vertices; no two frames are alike.
pub fn sheet(n: usize, w: usize, h: usize) -> Sequence {
    let index = |x: usize, y: usize| (y * w + x) as u32;
    let corners = (0..h - 1).flat_map(|y| (0..w - 1).map(move |x| (x, y)));
    let faces = corners
        .flat_map(|(x, y)| {
            let [a, b, c, d] = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)];
            [[a, b, c], [a, c, d]].map(|f| f.map(|(x, y)| index(x, y)))
        })
        .collect();
    let connectivity = Connectivity::new(w * h, faces).unwrap();
    let mut positions = Vec::new();
    for i in 0..n {
        let t = i as f64 * 0.37;
        for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x as f64, y as f64))) {
            let height = (0.7 * x - t).sin() + 0.3 * (0.9 * y + 1.7 * t).cos() + 0.02 * t * t;
            positions.extend([x + 0.1 * (t + y).sin(), y + 0.05 * (x * t).cos(), height]);
        }
    }
    Sequence::new(Arc::new(connectivity), n, positions).unwrap()
}

/// Runs the program with little memory, so that it cannot reserve what a header asks for.
pub fn meshseq<S: AsRef<OsStr>>(arguments: &[S]) -> Output {
    let script = format!("ulimit -v {MEMORY} 2>/dev/null; exec \"$0\" \"$@\"");
    Command::new("sh")
        .args(["-c", &script, MESHSEQ])
        .args(arguments)
        .output()
        .unwrap()
}

/// Runs the program, with as much memory as there is; it must succeed.
pub fn must<S: AsRef<OsStr>>(arguments: &[S]) -> String {
    let output = Command::new(MESHSEQ).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout)
}

/// Bytes as text, whatever they are.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Every file below a folder and its bytes; folders have none.
pub fn contents(folder: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(contents(&path));
            found.insert(path, None);
        } else {
            let bytes = fs::read(&path).unwrap();
            found.insert(path, Some(bytes));
        }
    }
    found
}

/// A folder of our own, and paths in it.
pub struct Scratch(tempfile::TempDir);

impl Scratch {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    /// The path as an argument.
    pub fn arg(&self, name: &str) -> String {
        self.at(name).to_str().unwrap().to_owned()
    }
}
