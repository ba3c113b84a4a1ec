//! `signal sample` (section 4.2).

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::super::output::{draft_json, progress, say};
use super::super::places::Places;
use super::super::{Failure, Outcome, whole};
use super::tables::{numbers, pairs, read_text};
use crate::sequence::Sequence;
use crate::sequence::format::{FormatError, FrameWriter};
use crate::shape::ShapeError;
use crate::signal::file::{AT_A_TIME, Stored};
use crate::signal::resample::{at_rate, check, evenly, warped};
use crate::signal::windows_file::WindowsFile;

pub const EXAMPLES: &str = "Examples:
  meshseq signal fit @gallop-small --tolerance 0.01 -o gallop.npz
  meshseq signal sample gallop.npz --rate 1.5 -o half-again-as-many
  printf 'frame,time\\n1,1\\n30,12\\n36,24\\n' > slow-then-fast.csv
  meshseq signal sample gallop.npz --warp slow-then-fast.csv -o warped.npz
  meshseq signal fit @roam-small:200 --k 60 --l 50 --m 20 --window 80 -o roam.npz
  meshseq signal sample roam.npz --rate 2 -o twice-as-many.pc2";

#[derive(Args)]
pub struct SampleVerb {
    /// A representation: what `signal fit` or `edit` wrote, or `transfer` or `design` with --rep
    representation: PathBuf,
    /// Number of frames, evenly spaced over [1, n]; as many as were fitted if not given
    #[arg(long, alias = "count", value_name = "N", allow_negative_numbers = true, value_parser = whole("1 or more"))]
    frames: Option<usize>,
    /// Frames in place of one: 1.5 for three in place of two, from frame 1 on at a step of 1/R, which may end before frame n
    #[arg(long, value_name = "R", allow_negative_numbers = true, conflicts_with_all = ["frames", "times", "warp"])]
    rate: Option<f64>,
    /// Frame times in [1, n] in any order: numbers separated by commas, or a file of them
    #[arg(
        long,
        value_name = "T,T,..|FILE",
        allow_hyphen_values = true,
        conflicts_with_all = ["frames", "warp"]
    )]
    times: Option<String>,
    /// CSV of slow and fast motion: frame (of the new sequence), time (of the old); with a header line
    #[arg(long, value_name = "FILE", conflicts_with = "frames")]
    warp: Option<PathBuf>,
    /// Where to: .npz, .pc2 (with an .obj beside it), or a new folder of OBJ frames
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl SampleVerb {
    pub fn run(self) -> Outcome {
        Places::default()
            .reads("<REPRESENTATION>", Some(&self.representation))
            .reads("--times", self.times.as_ref())
            .reads("--warp", self.warp.as_ref())
            .writes_sequence("-o", &self.out)
            .writes("--json", self.json.as_ref())
            .check()?;
        let mut file = WindowsFile::open(&self.representation)?;
        let n = file.plan().frame_count();
        let times = self.times(n)?;
        let mesh = file.connectivity().clone();
        let numbers = json!({
            "n": n, "frames": times.len(), "times": times,
            "V": mesh.vertex_count(), "F": mesh.faces().len(),
            "space": file.space().name(),
        });
        let mut writer = FrameWriter::create(&self.out, &mesh, times.len())?;
        let bar = progress(times.len());
        for some in times.chunks(AT_A_TIME) {
            let frames = file.sample(some)?;
            writer.push(&frames).map_err(|e| self.sampled(e))?;
            bar.inc(some.len() as u64);
        }
        bar.finish_and_clear();
        let json = self.json.as_ref().map(|path| draft_json(path, &numbers));
        let json = json.transpose()?;
        writer.finish()?;
        if let Some(json) = json {
            json.keep()?;
        }
        say(&format!("{}: {} frames", self.out.display(), times.len()));
        Ok(true)
    }

    /// Frames that are none are the fault of the representation.
    fn sampled(&self, error: FormatError) -> Failure {
        match error {
            FormatError::Sequence { source, .. } => {
                format!("{}: sampled, {source}", self.representation.display()).into()
            }
            other => other.into(),
        }
    }

    fn times(&self, n: usize) -> Result<Vec<f64>, Failure> {
        if let Some(rate) = self.rate {
            return Ok(at_rate(n, rate).map_err(|e| format!("--rate: {e}"))?);
        }
        if let Some(path) = &self.warp {
            let rows = pairs(path, "time warps", ["frame", "time"])?;
            return Ok(warped(&rows, n).map_err(|e| format!("{}: {e}", path.display()))?);
        }
        if let Some(given) = &self.times {
            let times = listed(given)?;
            check(&times, n).map_err(|e| format!("--times: {e}"))?;
            return Ok(times);
        }
        Ok(evenly(n, self.frames.unwrap_or(n)).map_err(|e| format!("--frames: {e}"))?)
    }
}

/// The times themselves, or those of a file.
fn listed(given: &str) -> Result<Vec<f64>, Failure> {
    let path = Path::new(given);
    let times = match numbers(given) {
        Ok(times) => times,
        Err(e) if !path.exists() => {
            return Err(format!(
                "--times: {e}, and there is no such file; expected numbers separated by commas"
            )
            .into());
        }
        Err(_) => numbers(&read_text(path, "times")?).map_err(|e| {
            format!("{given}: {e}; expected numbers separated by commas or line ends")
        })?,
    };
    match times.is_empty() {
        true => Err("--times: no times; expected at least one".into()),
        false => Ok(times),
    }
}

/// Frames of a representation at these times; `path` is where it came from.
pub fn frames_at(stored: &Stored, times: &[f64], path: &Path) -> Result<Sequence, Failure> {
    check_memory(times.len(), stored.representation.dimension())?;
    let frames = decoded(stored, times).map_err(|e| format!("{}: {e}", path.display()))?;
    let sequence = Sequence::new(stored.connectivity.clone(), times.len(), frames);
    Ok(sequence.map_err(|e| format!("{}: sampled, {e}", path.display()))?)
}

fn decoded(stored: &Stored, times: &[f64]) -> Result<Vec<f64>, ShapeError> {
    let space = stored.prepare()?;
    let bar = progress(times.len());
    let mut frames = Vec::with_capacity(times.len() * 3 * stored.connectivity.vertex_count());
    for some in times.chunks(AT_A_TIME) {
        frames.extend(stored.sample_in(space.as_deref(), some)?);
        bar.inc(some.len() as u64);
    }
    bar.finish_and_clear();
    Ok(frames)
}

/// An error where that many frames of d numbers do not fit into memory.
fn check_memory(frames: usize, d: usize) -> Result<(), Failure> {
    let numbers = frames.checked_mul(d);
    let fits = numbers.is_some_and(|count| Vec::<f64>::new().try_reserve_exact(count).is_ok());
    if fits {
        return Ok(());
    }
    let gigabytes = frames as f64 * d as f64 * 8e-9;
    Err(format!(
        "{frames} frames of {d} numbers, {gigabytes:.0} GB, do not fit into memory; sample fewer at a time with --times"
    )
    .into())
}
