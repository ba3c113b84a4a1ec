//! The numbers on record for real sequences, where they are: MESHSEQ_DATA names their folder.

use std::path::PathBuf;
use std::process::Command;

use meshseq::exhibits::{Panel, transfer};
use meshseq::sequence::dataset::DataFolders;

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

/// One face of 84,638 turns, in 3 of 24 frames: the examples fold it over against its neighbour by up to 170 degrees. Branches that spread breadth first
/// turned 1,497.
#[test]
fn a_gallop_on_the_elephant() {
    let needs = [
        "horse-gallop",
        "horse-poses",
        "elephant-poses",
        "rest-poses",
    ];
    let Some(folder) = data().filter(|folder| needs.iter().all(|n| folder.join(n).is_dir())) else {
        println!("skipped: no data, because MESHSEQ_DATA names no folder with {needs:?} in it");
        return;
    };
    let exhibit = transfer::exhibit(&DataFolders::new(Some(&folder))).unwrap();
    let tables = exhibit.panels.iter().filter_map(|panel| match panel {
        Panel::Table(table) => Some(&table.rows),
        _ => None,
    });
    let gradient = tables.flatten().find(|row| row[0] == "gradient").unwrap();
    assert!(gradient[1].parse::<f64>().unwrap() < 1e-9, "{gradient:?}");
    assert!(gradient[2].parse::<usize>().unwrap() <= 3, "{gradient:?}");
}
