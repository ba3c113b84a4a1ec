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

/// The commands that `--help` of a verb ends with, as a script for a shell: a line after `Example:`, or indented lines below `Example:`.
fn examples(verb: &[&str]) -> String {
    let help = meshseq(&[verb, &["--help"]].concat());
    let (_, rest) = help
        .split_once("\nExample")
        .unwrap_or_else(|| panic!("{verb:?} has no example"));
    let (first, below) = rest.split_once('\n').unwrap_or((rest, ""));
    let inline = first.trim_start_matches('s').trim_start_matches(':').trim();
    let block = below.lines().take_while(|line| !line.trim().is_empty());
    if inline.is_empty() {
        return block.map(|line| format!("{line}\n")).collect();
    }
    // One command, which may be broken over lines where the terminal ends.
    block.fold(inline.to_owned(), |all, line| format!("{all} {line}"))
}

/// The verbs below a verb, or below none of them.
fn below(verb: &[&str]) -> Vec<String> {
    let help = meshseq(&[verb, &["--help"]].concat());
    let Some((_, commands)) = help.split_once("Commands:\n") else {
        return Vec::new();
    };
    let lines = commands.lines().take_while(|line| !line.is_empty());
    // Further lines of a long description are indented deeper.
    let named = lines.filter_map(|line| line.strip_prefix("  "));
    let named = named.filter(|line| !line.starts_with(' '));
    let verbs = named.filter_map(|line| line.split_whitespace().next());
    let verbs = verbs.filter(|name| *name != "help");
    verbs.map(str::to_owned).collect()
}

/// Also those that take too long to be run here.
#[test]
fn every_verb_has_an_example() {
    let mut leaves = 0;
    let mut verbs: Vec<Vec<String>> = below(&[]).into_iter().map(|verb| vec![verb]).collect();
    while let Some(verb) = verbs.pop() {
        let words: Vec<&str> = verb.iter().map(String::as_str).collect();
        let subverbs = below(&words);
        if subverbs.is_empty() {
            leaves += 1;
            let call = format!("meshseq {}", words.join(" "));
            let script = examples(&words);
            let calls = |line: &str| line == call || line.starts_with(&format!("{call} "));
            // Some say where before they say what.
            let said = script.lines().any(|line| {
                let from = line.find("meshseq ").unwrap_or(0);
                calls(line[from..].trim_end())
            });
            assert!(said, "no example of `{call}` in {script}");
        }
        verbs.extend(
            subverbs
                .into_iter()
                .map(|name| [verb.clone(), vec![name]].concat()),
        );
    }
    assert!(leaves >= 16, "{leaves}");
}

#[test]
fn examples_on_embedded_sequences_run_as_written() {
    let folder = tempfile::tempdir().unwrap();
    let program = std::path::Path::new(env!("CARGO_BIN_EXE_meshseq"));
    let mut path = std::ffi::OsString::from(program.parent().unwrap());
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    let signal = below(&["signal"]);
    assert!(signal.len() >= 5, "{signal:?}");
    let plain = ["info", "convert", "list"].map(|verb| vec![verb]);
    let signal = signal.iter().map(|verb| vec!["signal", verb.as_str()]);
    for verb in plain.into_iter().chain(signal) {
        let script = examples(&verb);
        assert!(script.contains("meshseq "), "{verb:?}: {script}");
        // Each in a folder of its own, so that none needs what another has left there.
        let own = folder.path().join(verb.join("-"));
        std::fs::create_dir(&own).unwrap();
        let output = Command::new("sh")
            .args(["-e", "-c", &script])
            .current_dir(own)
            .env("PATH", &path)
            .env("MESHSEQ_HOME", env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{script}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
}
