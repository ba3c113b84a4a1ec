//! `info SEQ`: counts, measures and defects.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::output::{Draft, draft_json, say};
use super::places::Places;
use super::{FrameChoice, Outcome};
use crate::mesh::measure::{Measures, bounds, counts, measure_frames};
use crate::mesh::self_intersections::{SelfIntersections, self_intersections_of_frames};

#[derive(Args)]
pub struct Info {
    /// A folder or pattern of OBJ frames, an .npz, a .pc2, or @name
    sequence: String,
    #[command(flatten)]
    frames: FrameChoice,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Find where the surface meets itself, and write area, volume and self-intersections of every frame to this file
    #[arg(long, value_name = "FILE")]
    quality: Option<PathBuf>,
}

impl Info {
    pub fn run(self) -> Outcome {
        Places::default()
            .reads_sequence("<SEQUENCE>", &self.sequence)
            .writes("--json", self.json.as_ref())
            .writes("--quality", self.quality.as_ref())
            .check()?;
        let sequence = self.frames.open(&self.sequence)?;
        let mesh = sequence.connectivity();
        let c = counts(mesh.vertex_count(), mesh.faces());
        let measures = measure_frames(sequence.positions(), sequence.dimension(), mesh.faces());
        let range = |of: fn(&Measures) -> f64| {
            let values = || measures.iter().map(of);
            [
                values().fold(f64::INFINITY, f64::min),
                values().fold(f64::NEG_INFINITY, f64::max),
            ]
        };
        let (area, volume) = (range(|m| m.area), range(|m| m.volume));
        let first = bounds(sequence.frame(0));
        let value = json!({
            "frames": sequence.frame_count(),
            "V": c.vertices, "F": c.faces, "E": c.edges, "d": sequence.dimension(),
            "unreferenced_vertices": c.unreferenced,
            "boundary_edges": c.boundary_edges, "non_manifold_edges": c.non_manifold_edges,
            "disagreeing_edges": c.disagreeing_edges,
            "components": c.components, "euler": c.euler(),
            "area": area, "volume": volume,
            "bounds": {"min": first.min, "max": first.max}, "diagonal": first.diagonal(),
        });
        let (x, d) = (sequence.positions(), sequence.dimension());
        let quality = self.quality.as_deref();
        let quality = quality.map(|path| (path, self_intersections_of_frames(x, d, mesh.faces())));
        let json = self.json.as_deref().map(|path| draft_json(path, &value));
        let json = json.transpose()?;
        let rows = |(path, meetings): &(&Path, Vec<SelfIntersections>)| {
            Draft::new(path, &table(&measures, meetings))
        };
        let rows = quality.as_ref().map(rows).transpose()?;
        for draft in json.into_iter().chain(rows) {
            draft.keep()?;
        }
        say(&format!(
            "{}: {} frames, V = {}, F = {}, E = {}, d = {}",
            self.sequence,
            sequence.frame_count(),
            c.vertices,
            c.faces,
            c.edges,
            sequence.dimension()
        ));
        say(&format!(
            "components {}, Euler characteristic {}, boundary edges {}, non-manifold edges {}, unreferenced vertices {}",
            c.components,
            c.euler(),
            c.boundary_edges,
            c.non_manifold_edges,
            c.unreferenced
        ));
        if c.disagreeing_edges > 0 {
            say(&format!(
                "faces disagree in orientation at {} edges, so volumes mean little",
                c.disagreeing_edges
            ));
        }
        say(&format!(
            "area {:.6} to {:.6}, volume {:.6} to {:.6}",
            area[0], area[1], volume[0], volume[1]
        ));
        say(&format!(
            "first frame from {:?} to {:?}, diagonal {:.6}",
            first.min,
            first.max,
            first.diagonal()
        ));
        if let Some((_, meetings)) = &quality {
            say(&most_of(meetings));
        }
        Ok(true)
    }
}

const COLUMNS: &str =
    "frame,area,volume,self_intersections,intersecting_faces,faces_without_area\n";

/// A row a frame.
fn table(measures: &[Measures], meetings: &[SelfIntersections]) -> String {
    let rows = (1..).zip(measures.iter().zip(meetings));
    let rows = rows.map(|(frame, (m, at))| {
        let [pairs, faces, flat] = [at.pairs, at.faces.len(), at.without_area.len()];
        format!("{frame},{},{},{pairs},{faces},{flat}\n", m.area, m.volume)
    });
    COLUMNS.to_owned() + &rows.collect::<String>()
}

/// In how many frames the surface meets itself, and the first of those where most triangles do.
fn most_of(meetings: &[SelfIntersections]) -> String {
    let meeting = (1..).zip(meetings).filter(|(_, at)| !at.faces.is_empty());
    let frames = meeting.clone().count();
    match meeting.max_by_key(|(frame, at)| (at.faces.len(), std::cmp::Reverse(*frame))) {
        None => "the surface meets itself in no frame".to_owned(),
        Some((frame, at)) => format!(
            "the surface meets itself in {frames} frames, most in frame {frame}: {} triangles, {} pairs without a common vertex",
            at.faces.len(),
            at.pairs
        ),
    }
}
