//! What `--json` of a fit holds.

mod common;

use common::{Scratch, must};
use serde_json::Value;

fn told(choice: &str) -> (Value, String) {
    let scratch = Scratch::new();
    let json = scratch.arg("told.json");
    let command = format!("signal fit @gallop-small {choice} --json {json}");
    let words: Vec<&str> = command.split_whitespace().collect();
    let said = must(&words);
    let bytes = std::fs::read(scratch.at("told.json")).unwrap();
    (serde_json::from_slice(&bytes).unwrap(), said)
}

#[test]
fn sites_are_frames_until_they_are_moved() {
    let choice = "--k 16 --l 12 --m 7";
    let (staged, _) = told(choice);
    let sites = staged["sites"].as_array().unwrap();
    assert_eq!(sites.len(), 12);
    let frame = |site: &Value| (1..=24).contains(&site.as_u64().unwrap());
    assert!(sites.iter().all(frame), "{sites:?}");
    let (refined, _) = told(&format!("{choice} --refine"));
    assert!(refined.get("sites").is_none() && refined["l"] == 12);
}

/// (2) falls in every space; distances of vertices are told before and after, for they need not.
#[test]
fn a_refinement_tells_the_distance_of_vertices_before() {
    for space in ["vertex", "gradient", "lengths"] {
        let choice = format!("--k 14 --l 10 --m 6 --space {space}");
        let (staged, _) = told(&choice);
        let (refined, said) = told(&format!("{choice} --refine"));
        let told = &refined["refine"];
        assert_eq!(
            told["rms_relative_before"], staged["rms_relative"],
            "{space}"
        );
        assert_eq!(told["error_psi_before"], staged["error_psi"], "{space}");
        assert!(refined["error_psi"].as_f64() < staged["error_psi"].as_f64());
        assert!(said.contains(", relative RMS from "), "{said}");
    }
    let (refined, _) = told("--tolerance 0.02 --refine");
    assert!(refined["refine"].get("rms_relative_before").is_none());
}
