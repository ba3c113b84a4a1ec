//! `info SEQ`: counts, measures and defects.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::output::{check_place, draft_json, say};
use super::{FrameChoice, Outcome};
use crate::mesh::measure::{bounds, counts, measure_frames};

#[derive(Args)]
pub struct Info {
    /// A folder or pattern of OBJ frames, an .npz, a .pc2, or @name
    sequence: String,
    #[command(flatten)]
    frames: FrameChoice,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl Info {
    pub fn run(self) -> Outcome {
        self.json.as_deref().map_or(Ok(()), check_place)?;
        let sequence = self.frames.open(&self.sequence)?;
        let mesh = sequence.connectivity();
        let c = counts(mesh.vertex_count(), mesh.faces());
        let measures = measure_frames(sequence.positions(), sequence.dimension(), mesh.faces());
        let range = |of: fn(&crate::mesh::measure::Measures) -> f64| {
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
            "components": c.components, "euler": c.euler(),
            "area": area, "volume": volume,
            "bounds": {"min": first.min, "max": first.max}, "diagonal": first.diagonal(),
        });
        if let Some(path) = &self.json {
            draft_json(path, &value)?.keep()?;
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
        Ok(true)
    }
}
