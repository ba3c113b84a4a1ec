//! What documents say of the program is what the program says.

use std::process::Command;

fn meshseq(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_meshseq"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_table_of_engines_is_current() {
    let readme = include_str!("../oracles/README.md");
    let table = meshseq(&["list", "--engines"]);
    assert!(
        readme.contains(table.trim()),
        "put the output of `meshseq list --engines` between the markers of oracles/README.md"
    );
}

/// The example that `--help` of each verb ends with.
fn example(verb: &[&str]) -> Option<String> {
    let mut arguments = verb.to_vec();
    arguments.push("--help");
    let help = meshseq(&arguments);
    help.split_once("Example: meshseq ")
        .map(|(_, rest)| rest.to_owned())
}

#[test]
fn examples_on_embedded_sequences_run_as_written() {
    let folder = tempfile::tempdir().unwrap();
    for verb in [
        vec!["info"],
        vec!["convert"],
        vec!["list"],
        vec!["signal", "fit"],
        vec!["signal", "sample"],
        vec!["signal", "leave-out"],
    ] {
        let example = example(&verb).unwrap_or_else(|| panic!("{verb:?} has no example"));
        // `sample` reads what the example of `fit` wrote.
        let output = Command::new(env!("CARGO_BIN_EXE_meshseq"))
            .args(example.split_whitespace())
            .current_dir(folder.path())
            .env("MESHSEQ_HOME", env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{example}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
}
