//! The numbers on record for real sequences, where they are: MESHSEQ_DATA names their folder.

use std::path::PathBuf;
use std::process::Command;

fn data() -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("MESHSEQ_DATA")?);
    folder.is_dir().then_some(folder)
}

/// Verifies cases with Rust's own checks and expected numbers; oracles have their say in `scripts/verify`.
fn verify(needs: &str, cases: &[&str]) {
    let Some(folder) = data().filter(|folder| folder.join(needs).is_dir()) else {
        println!("skipped: no data, because MESHSEQ_DATA names no folder with `{needs}` in it");
        return;
    };
    let out = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_meshseq"))
        .arg("verify")
        .args(cases)
        .args(["--engine", "numpy"])
        .arg("--data")
        .arg(folder)
        .arg("--out")
        .arg(out.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    println!("{text}{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success());
    assert!(!text.contains("skipped"));
}

#[test]
fn horse() {
    verify("horse-gallop", &["signal/*/horse", "sequence/read/horse"]);
}

#[test]
fn repeated_poses_of_the_horse() {
    verify(
        "horse-gallop",
        &["signal/*/horse-twice", "signal/*/horse-odd"],
    );
}

#[test]
fn cow() {
    verify("cow", &["signal/*/cow", "signal/*/cow-symmetric"]);
}

#[test]
fn samba() {
    verify("samba", &["signal/*/samba"]);
}
