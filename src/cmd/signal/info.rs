//! `signal info`: what a representation is.

use std::ops::Range;
use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::super::output::{Draft, draft_json, say};
use super::super::places::Places;
use super::super::{Failure, Outcome};
use crate::report::{PlotError, PosePlane, pose_plane};
use crate::signal::file::Stored;
use crate::signal::psi::SMOOTH;
use crate::signal::windows_file::WindowsFile;

pub const EXAMPLES: &str = "Examples:
  meshseq signal fit @roam-small:200 --k 60 --l 50 --m 20 --window 80 -o roam.npz
  meshseq signal info roam.npz --json roam.json
  meshseq signal fit @gallop-small --tolerance 0.01 -o gallop.npz
  meshseq signal info gallop.npz --places gallop.csv --plot gallop.svg";

#[derive(Args)]
pub struct InfoVerb {
    /// A representation: what `signal fit` or `edit` wrote, or `transfer` or `design` with --rep
    representation: PathBuf,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write where the frames are in the pose plane to this CSV, in the form of `signal fit --pins`
    #[arg(long, value_name = "FILE")]
    places: Option<PathBuf>,
    /// Draw the time signal over the pose plane into this SVG, of a representation without windows
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

/// What is known of a representation once all of its windows were read.
#[derive(Default)]
struct Known {
    windows: Vec<Value>,
    stored_numbers: usize,
    /// Rows `frame,x,y`.
    places: String,
}

impl Known {
    fn add(&mut self, frames: &Range<usize>, window: &Stored) {
        let representation = &window.representation;
        let first = frames.start + 1;
        let (k, l, m) = representation.klm();
        let stored = representation.stored_numbers();
        self.stored_numbers += stored;
        for (frame, [x, y]) in (first..).zip(&window.positions) {
            self.places.push_str(&format!("{frame},{x},{y}\n"));
        }
        self.windows.push(json!({
            "first": first, "last": frames.end, "k": k, "l": l, "m": m, "stored_numbers": stored,
            "places": window.positions, "sites": representation.pose.sites,
            "control": representation.time.spline.control, "knots": representation.time.spline.knots,
            "parameters": representation.time.parameters,
        }));
    }
}

impl InfoVerb {
    pub fn run(self) -> Outcome {
        Places::default()
            .reads("<REPRESENTATION>", Some(&self.representation))
            .writes("--json", self.json.as_ref())
            .writes("--places", self.places.as_ref())
            .writes("--plot", self.plot.as_ref())
            .check()?;
        let mut file = WindowsFile::open(&self.representation)?;
        let plan = file.plan().clone();
        self.check_plot(plan.windows().len())?;
        let mut known = Known::default();
        for (j, range) in plan.windows().iter().enumerate() {
            known.add(range, file.window(j)?);
        }
        let mesh = file.connectivity();
        let numbers = json!({
            "n": plan.frame_count(), "V": mesh.vertex_count(), "F": mesh.faces().len(), "space": file.space().name(),
            "overlap": plan.overlap(), "windows": known.windows, "stored_numbers": known.stored_numbers,
        });
        self.write(&mut file, &known.places, &numbers)?;
        say(&describe(
            &self.representation.display().to_string(),
            &numbers,
        ));
        Ok(true)
    }

    fn check_plot(&self, windows: usize) -> Result<(), Failure> {
        match self.plot.is_some() && windows > 1 {
            true => Err(format!(
                "--plot: {} is in {windows} windows, each with a pose plane of its own; fit it without --window",
                self.representation.display()
            )
            .into()),
            false => Ok(()),
        }
    }

    /// All files that are asked for, or none.
    fn write(&self, file: &mut WindowsFile, places: &str, numbers: &Value) -> Result<(), Failure> {
        let mut drafts = Vec::new();
        if let Some(path) = &self.places {
            drafts.push(Draft::new(path, &format!("frame,x,y\n{places}"))?);
        }
        if let Some(path) = &self.plot {
            let svg = plot(&self.representation.display().to_string(), file.window(0)?)?;
            drafts.push(Draft::new(path, &svg)?);
        }
        if let Some(path) = &self.json {
            drafts.push(draft_json(path, numbers)?);
        }
        for draft in drafts {
            draft.keep()?;
        }
        Ok(())
    }
}

fn describe(name: &str, v: &Value) -> String {
    let windows = v["windows"].as_array().map_or(&[][..], Vec::as_slice);
    let mut text = format!(
        "{name}: {} space, n = {}, V = {}, F = {}, {} numbers in h, g and f for {} given{}",
        v["space"].as_str().unwrap_or(""),
        v["n"],
        v["V"],
        v["F"],
        v["stored_numbers"],
        3 * v["n"].as_u64().unwrap_or(0) * v["V"].as_u64().unwrap_or(0),
        match windows.len() {
            1 => String::new(),
            count => format!(", {count} windows with {} frames in common", v["overlap"]),
        }
    );
    for w in windows {
        text += &format!(
            "\nframes {} to {}: k = {}, l = {}, m = {}, {} numbers",
            w["first"], w["last"], w["k"], w["l"], w["m"], w["stored_numbers"]
        );
    }
    text
}

/// The time signal over the pose plane, as SVG. Sites that are no frames, as those of a refined fit, are not marked.
fn plot(name: &str, stored: &Stored) -> Result<String, PlotError> {
    let (time, sites) = (
        &stored.representation.time,
        &stored.representation.pose.sites,
    );
    let is_site = |&i: &usize| sites.contains(&stored.positions[i]);
    let sites: Vec<usize> = (0..stored.positions.len()).filter(is_site).collect();
    pose_plane(&PosePlane {
        name,
        positions: &stored.positions,
        frame_points: &time.curve(1),
        curve: &time.curve(SMOOTH),
        control: &time.spline.control,
        sites: &sites,
    })
}
