//! `signal design` (section 4.4).

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::super::output::say;
use super::super::places::Places;
use super::super::{Outcome, whole};
use super::result::Outputs;
use super::tables::{pairs, placed_frames};
use crate::sequence::dataset::open;
use crate::shape::{SpaceKind, encode_examples, patches_for, prepare};
use crate::signal::Point;
use crate::signal::design::{DesignOptions, design};
use crate::signal::file::Stored;
use crate::signal::pins::validate_pins;

pub const EXAMPLES: &str = "Example:
  printf 'frame,x,y\\n1,0,0\\n4,2,0\\n7,2,2\\n10,0,2\\n' > poses.csv
  printf 'x,y\\n0,0\\n1,-0.3\\n2,0\\n2.2,1\\n2,2\\n0,2\\n' > curve.csv
  meshseq signal design poses.csv curve.csv @gallop-small --closed -o designed";

#[derive(Args)]
pub struct DesignVerb {
    /// CSV of the poses to use and where they are: frame (1-based, of SEQ), x, y; with a header line
    poses: PathBuf,
    /// CSV of points that the curve runs through, in order: x, y; with a header line
    curve: PathBuf,
    #[arg(value_name = "SEQ")]
    /// Where the poses come from: a folder or pattern of OBJ frames, an .npz, a .pc2, or @name
    sequence: String,
    /// Frames of the new sequence, at equal ways along the curve
    #[arg(long, value_name = "N", default_value_t = 60, allow_negative_numbers = true, value_parser = whole("2 or more"))]
    frames: usize,
    /// Close the curve: after the last frame comes the first
    #[arg(long)]
    closed: bool,
    /// Sites of the pose signal, 3 to the number of poses; all of them if not given
    #[arg(long, allow_negative_numbers = true, value_parser = whole("3 to the number of poses"))]
    l: Option<usize>,
    /// Dimension of the shape subspace; all if not given
    #[arg(long, allow_negative_numbers = true, value_parser = whole("0 or more"))]
    m: Option<usize>,
    /// Shape space: vertex, gradient, lric, lengths or patch; its reference is the first frame of SEQ
    #[arg(long, default_value = "vertex", value_name = "SPACE")]
    space: String,
    #[command(flatten)]
    outputs: Outputs,
}

impl DesignVerb {
    pub fn run(self) -> Outcome {
        let kind: SpaceKind = self.space.parse()?;
        let reads = Places::default()
            .reads("<POSES>", Some(&self.poses))
            .reads("<CURVE>", Some(&self.curve))
            .reads_sequence("<SEQ>", &self.sequence);
        self.outputs.check(reads)?;
        let sequence = open(&self.sequence)?;
        let placed = placed_frames(&self.poses, "poses")?;
        validate_pins(&placed, sequence.frame_count())
            .map_err(|e| format!("{}: {e}", self.poses.display()))?;
        let curve = pairs(&self.curve, "curves", ["x", "y"])?;
        let places: Vec<Point> = placed.iter().map(|p| p.position).collect();
        let frames: Vec<usize> = placed.iter().map(|p| p.frame).collect();
        let rest = sequence.frame(0);
        // The reference comes first, so that branches of angles are chosen beside it.
        let poses = frames.iter().flat_map(|&i| sequence.frame(i));
        let poses: Vec<f64> = rest.iter().chain(poses).copied().collect();
        let mesh = sequence.connectivity();
        let of_sequence = |e| format!("{}: {e}", self.sequence);
        let patches = patches_for(kind, mesh, rest, &poses).map_err(of_sequence)?;
        let space = prepare(kind, mesh.clone(), rest, &patches).map_err(of_sequence)?;
        let z = encode_examples(&*space, &poses).map_err(of_sequence)?;
        let options = DesignOptions {
            frames: self.frames,
            closed: self.closed,
            sites: self.l,
            dimension: self.m,
        };
        let representation = design(z.get(.., 1..), &places, &curve, &options)
            .map_err(|e| format!("{} and {}: {e}", self.poses.display(), self.curve.display()))?;
        let time = &representation.time;
        let numbers = json!({
            "n": self.frames, "poses": places.len(), "closed": self.closed, "space": kind.name(),
            "k": time.spline.control.len(), "l": representation.pose.site_count(), "m": representation.basis.ncols(),
            "V": sequence.connectivity().vertex_count(), "F": sequence.connectivity().faces().len(),
        });
        let stored = Stored {
            positions: time.spline.evaluate_all(&time.parameters),
            representation,
            connectivity: sequence.connectivity().clone(),
            space: kind,
            reference: match kind {
                SpaceKind::Vertex => Vec::new(),
                _ => rest.to_vec(),
            },
            patches,
        };
        let numbers = self.outputs.write(&stored, &poses, numbers)?;
        say(&format!(
            "{}: {} frames from {} poses in {} space; {}",
            self.outputs.out.display(),
            self.frames,
            places.len(),
            kind.name(),
            super::result::inside_out(&numbers, kind),
        ));
        Ok(true)
    }
}
