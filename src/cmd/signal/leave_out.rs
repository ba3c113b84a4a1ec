//! `signal leave-out`.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::{check_between, ratio};
use crate::cmd::output::{draft_json, progress, say};
use crate::cmd::places::Places;
use crate::cmd::{Failure, FrameChoice, Outcome};
use crate::mesh::measure::bounds;
use crate::sequence::Sequence;
use crate::shape::{SpaceKind, prepare_for};
use crate::signal::knots::KnotRule;
use crate::signal::layout::Layout;
use crate::signal::leave_out::{LeaveOut, Split, TradeOff};
use crate::signal::refine::RefineOptions;

pub const EXAMPLES: &str = "Example: meshseq signal leave-out @gallop-small --json leave-out.json";

#[derive(Args)]
pub struct LeaveOutVerb {
    /// A folder or pattern of OBJ frames, an .npz, a .pc2, or @name
    sequence: String,
    #[command(flatten)]
    frames: FrameChoice,
    /// Shape space: vertex, gradient, lric, lengths or patch; its reference is the first frame
    #[arg(long, default_value = "vertex", value_name = "SPACE")]
    space: String,
    /// How knots average parameters: symmetric or literal
    #[arg(long, default_value = "symmetric", value_name = "RULE")]
    knots: String,
    /// Layouts to compare, separated by commas
    #[arg(
        long,
        default_value = "mds,ordered",
        value_name = "LAYOUT,..",
        value_delimiter = ','
    )]
    layout: Vec<String>,
    /// Sites and control points as shares of the frames kept, separated by commas; 1 interpolates
    #[arg(
        long,
        default_value = "1,0.8",
        value_name = "S,..",
        value_delimiter = ',',
        allow_negative_numbers = true
    )]
    shares: Vec<f64>,
    /// Test each fit a second time, with the error of the whole chain lowered jointly
    #[arg(long)]
    refine: bool,
    /// With --refine: weight of the frames half-way between frames, beside 1 for a frame
    #[arg(long, value_name = "W", default_value_t = RefineOptions::default().between, requires = "refine", allow_negative_numbers = true)]
    between: f64,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What is compared, and in which space.
struct How {
    space: SpaceKind,
    knots: KnotRule,
    layouts: Vec<Layout>,
}

impl LeaveOutVerb {
    pub fn run(self) -> Outcome {
        let how = self.how()?;
        Places::default()
            .reads_sequence("<SEQUENCE>", &self.sequence)
            .writes("--json", self.json.as_ref())
            .check()?;
        let sequence = self.frames.open(&self.sequence)?;
        let numbers = self.compare(&sequence, &how);
        let numbers = numbers.map_err(|e| format!("{}: {e}", self.sequence))?;
        if let Some(path) = &self.json {
            draft_json(path, &numbers)?.keep()?;
        }
        say(&describe(&self.sequence, &numbers));
        Ok(true)
    }

    fn how(&self) -> Result<How, Failure> {
        if let Some(share) = self.shares.iter().find(|s| !(**s > 0.0 && **s <= 1.0)) {
            return Err(format!("--shares {share}: expected shares above 0, at most 1").into());
        }
        check_between(self.between)?;
        let layouts: Result<_, _> = self.layout.iter().map(|name| name.parse()).collect();
        Ok(How {
            space: self.space.parse()?,
            knots: self.knots.parse()?,
            layouts: layouts?,
        })
    }

    /// Everything that `--json` holds.
    fn compare(&self, sequence: &Sequence, how: &How) -> Result<Value, Failure> {
        let size = bounds(sequence.frame(0)).diagonal();
        let split = Split::new(sequence.positions(), sequence.dimension())?;
        let space = prepare_for(how.space, sequence.connectivity(), &split.kept)?;
        let test = LeaveOut::new(&*space, &split)?;
        let refinement = RefineOptions {
            between: self.between,
            ..RefineOptions::default()
        };
        let refinement = self.refine.then_some(&refinement);
        let bar = progress(how.layouts.len() * self.shares.len());
        let mut fits = Vec::new();
        for &layout in &how.layouts {
            let mut rows = Vec::new();
            for &share in &self.shares {
                rows.extend(test.trade_off(&[share], layout, how.knots, refinement)?);
                bar.inc(1);
            }
            rows.sort_by_key(|row| row.refined);
            fits.extend(rows.iter().map(|row| numbers(row, layout, size)));
        }
        bar.finish_and_clear();
        Ok(json!({
            "n": sequence.frame_count(), "kept": test.kept(), "space": how.space.name(), "knots": how.knots.to_string(),
            "linear": ratio(test.linear()?.rms, size),
            "cubic": ratio(test.cubic()?.rms, size),
            "signals": fits,
        }))
    }
}

fn numbers(row: &TradeOff, layout: Layout, size: f64) -> Value {
    let (k, l, m) = row.klm;
    json!({
        "layout": layout.to_string(), "layout_weight": row.weight, "refined": row.refined, "share": row.share, "k": k, "l": l, "m": m,
        "rms_relative": ratio(row.missed, size), "error_g": row.errors.g, "error_psi": row.errors.psi,
    })
}

fn describe(name: &str, v: &Value) -> String {
    let percent = |value: &Value| 100.0 * value.as_f64().unwrap_or(f64::NAN);
    // The last of an even number has no neighbour behind it.
    let alone = v["n"].as_u64().filter(|n| n % 2 == 0);
    let alone = alone.map_or(String::new(), |n| format!(", but not frame {n}"));
    let mut lines = vec![
        format!(
            "{name}: {} space, {} of {} frames kept, the others predicted{alone}; vertex RMS over the first frame's diagonal",
            v["space"].as_str().unwrap_or(""),
            v["kept"],
            v["n"],
        ),
        format!("{:12}{:8.3}%", "linear", percent(&v["linear"])),
        format!("{:12}{:8.3}%", "cubic", percent(&v["cubic"])),
    ];
    for fit in v["signals"].as_array().into_iter().flatten() {
        lines.push(format!(
            "{:12}{:8.3}%  {}k = {}, l = {}, m = {}, weight {}; (2) {:.5}",
            fit["layout"].as_str().unwrap_or(""),
            percent(&fit["rms_relative"]),
            if fit["refined"] == true {
                "refined, "
            } else {
                ""
            },
            fit["k"],
            fit["l"],
            fit["m"],
            fit["layout_weight"],
            fit["error_psi"].as_f64().unwrap_or(f64::NAN),
        ));
    }
    lines.join("\n")
}
