//! `signal info`: what a representation is.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::super::Outcome;
use super::super::output::{Draft, check_place, draft_json, say};
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
    /// A representation that `signal fit` wrote
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

impl InfoVerb {
    pub fn run(self) -> Outcome {
        for path in self.json.iter().chain(&self.places).chain(&self.plot) {
            check_place(path)?;
        }
        let mut file = WindowsFile::open(&self.representation)?;
        let (plan, mesh) = (file.plan().clone(), file.connectivity().clone());
        let count = plan.windows().len();
        if self.plot.is_some() && count > 1 {
            return Err(format!(
                "--plot: {} is in {count} windows, each with a pose plane of its own; fit it without --window",
                self.representation.display()
            )
            .into());
        }
        let mut lines = Vec::new();
        let mut windows = Vec::new();
        let mut stored_numbers = 0;
        let mut table = String::from("frame,x,y\n");
        for (j, range) in plan.windows().iter().enumerate() {
            let window = file.window(j)?;
            let representation = &window.representation;
            let (first, last) = (range.start + 1, range.end);
            let (k, l, m) = representation.klm();
            let stored = representation.stored_numbers();
            stored_numbers += stored;
            for (frame, [x, y]) in (first..).zip(&window.positions) {
                table.push_str(&format!("{frame},{x},{y}\n"));
            }
            windows.push(json!({
                "first": first, "last": last, "k": k, "l": l, "m": m, "stored_numbers": stored,
                "places": window.positions, "sites": representation.pose.sites,
                "control": representation.time.spline.control, "knots": representation.time.spline.knots,
                "parameters": representation.time.parameters,
            }));
            lines.push(format!(
                "frames {first} to {last}: k = {k}, l = {l}, m = {m}, {stored} numbers"
            ));
        }
        let (n, vertices, faces) = (plan.frame_count(), mesh.vertex_count(), mesh.faces().len());
        let numbers = json!({
            "n": n, "V": vertices, "F": faces, "space": file.space().name(),
            "overlap": plan.overlap(), "windows": windows, "stored_numbers": stored_numbers,
        });
        let mut drafts = Vec::new();
        if let Some(path) = &self.places {
            drafts.push(Draft::new(path, &table)?);
        }
        if let Some(path) = &self.plot {
            let svg = plot(&self.representation.display().to_string(), file.window(0)?)?;
            drafts.push(Draft::new(path, &svg)?);
        }
        if let Some(path) = &self.json {
            draft_json(path, &numbers)?.keep()?;
        }
        for draft in drafts {
            draft.keep()?;
        }
        say(&format!(
            "{}: {} space, n = {n}, V = {vertices}, F = {faces}, {stored_numbers} numbers in h, g and f for {} given{}",
            self.representation.display(),
            file.space().name(),
            3 * n * vertices,
            match count {
                1 => String::new(),
                _ => format!(", {count} windows with {} frames in common", plan.overlap()),
            }
        ));
        lines.iter().for_each(|line| say(line));
        Ok(true)
    }
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
