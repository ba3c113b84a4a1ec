//! `signal fit` and `signal sample`; `signal leave-out` is in a file of its own.

use std::io::Read;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use faer::MatRef;
use serde_json::json;

use super::leave_out::LeaveOutVerb;
use super::output::{check_place, draft_json, say};
use super::{Failure, FrameChoice, Outcome, whole};
use crate::mesh::measure::bounds;
use crate::sequence::Sequence;
use crate::sequence::format::write;
use crate::shape::{SpaceKind, prepare};
use crate::signal::fidelity::fit_to_error;
use crate::signal::file::{Stored, load, save};
use crate::signal::fit::{FitError, FitOptions, fit};
use crate::signal::in_space::{SpaceFit, fit_in_space, fit_in_space_to_rms};
use crate::signal::knots::KnotRule;
use crate::signal::layout::Layout;
use crate::signal::pins::{Pin, validate_pins};
use crate::signal::saddles::{Place, places};

/// More frames are a mistake.
const MOST_FRAMES: usize = 10_000_000;
/// More pins than any plane of poses takes; a longer file is none of pins.
const LONGEST_PINS: u64 = 64 << 20;

#[derive(Subcommand)]
pub enum Signal {
    /// Fit time, pose and shape signals to a sequence
    #[command(
        after_help = "Example: meshseq signal fit @gallop-small --k 16 --l 12 --m 7 --knots literal -o gallop.npz --json fit.json"
    )]
    Fit(FitVerb),
    /// Frames of a representation at any times
    #[command(after_help = "Example: meshseq signal sample gallop.npz --count 48 -o twice-as-many")]
    Sample(SampleVerb),
    /// Fit every second frame and predict the others
    #[command(after_help = "Example: meshseq signal leave-out @gallop-small --json leave-out.json")]
    LeaveOut(LeaveOutVerb),
}

impl Signal {
    pub fn run(self) -> Outcome {
        match self {
            Self::Fit(verb) => verb.run(),
            Self::Sample(verb) => verb.run(),
            Self::LeaveOut(verb) => verb.run(),
        }
    }
}

#[derive(Args)]
pub struct FitVerb {
    /// A folder or pattern of OBJ frames, an .npz, a .pc2, or @name
    sequence: String,
    #[command(flatten)]
    frames: FrameChoice,
    /// Control points of the time signal, 4 to n + 2
    #[arg(long, requires_all = ["l", "m"], allow_negative_numbers = true, value_parser = whole("4 to n + 2 for n frames"))]
    k: Option<usize>,
    /// Sites of the pose signal, 3 to n
    #[arg(long, requires_all = ["k", "m"], allow_negative_numbers = true, value_parser = whole("3 to n for n frames"))]
    l: Option<usize>,
    /// Dimension of the shape subspace, 0 to n - 1
    #[arg(long, requires_all = ["k", "l"], allow_negative_numbers = true, value_parser = whole("0 to n - 1 for n frames"))]
    m: Option<usize>,
    /// Choose k, l, m for this relative RMS error, such as 0.01
    #[arg(long, value_name = "R", allow_negative_numbers = true, conflicts_with_all = ["k", "l", "m"], required_unless_present = "k")]
    tolerance: Option<f64>,
    /// Shape space: vertex, gradient or lric
    #[arg(long, default_value = "vertex", value_name = "SPACE")]
    space: String,
    /// The shape space's reference frame, one OBJ of the same mesh; the first frame if not given
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// How knots average parameters: symmetric, or literal as printed in the paper's source (Table 1)
    #[arg(long, default_value = "symmetric", value_name = "RULE")]
    knots: String,
    /// Layout of the pose plane: ordered (by distances between poses mixed with distances along the motion, which needs no pins), ordered:W with
    /// a weight W from 0 to 1 for the latter, or mds (the paper's, by distances between poses)
    #[arg(long, default_value = "ordered", value_name = "LAYOUT")]
    layout: String,
    /// CSV of pinned frames: frame (1-based), x, y; with a header line
    #[arg(long, value_name = "FILE")]
    pins: Option<PathBuf>,
    /// Write the representation to this .npz
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl FitVerb {
    pub fn run(self) -> Outcome {
        let knots: KnotRule = self
            .knots
            .parse()
            .map_err(|e| format!("{e}, found `{}`", self.knots))?;
        let space: SpaceKind = self.space.parse()?;
        let layout: Layout = self.layout.parse()?;
        if let Some(out) = self
            .out
            .as_ref()
            .filter(|out| out.extension().is_none_or(|e| e != "npz"))
        {
            return Err(format!(
                "{}: a representation is one .npz file; name it so",
                out.display()
            )
            .into());
        }
        for path in self.out.iter().chain(&self.json) {
            check_place(path)?;
        }
        if let Some(value) = self.tolerance.filter(|t| !(*t > 0.0 && t.is_finite())) {
            return Err(FitError::BadTolerance { value }.into());
        }
        let sequence = self.frames.open(&self.sequence)?;
        let pins = match &self.pins {
            Some(path) => read_pins(path, sequence.frame_count())?,
            None => Vec::new(),
        };
        let reference = self.reference(&sequence, space)?;
        let fitted = self.fit(&sequence, space, &reference, knots, layout, pins)?;
        let numbers = numbers(&sequence, &fitted, space, knots, layout);
        // Whatever can fail comes before the first file gets its name.
        let json = self.json.as_ref().map(|path| draft_json(path, &numbers));
        let json = json.transpose()?;
        if let Some(out) = &self.out {
            let stored = Stored {
                representation: fitted.fit.representation,
                positions: fitted.fit.positions,
                connectivity: sequence.connectivity().clone(),
                space,
                reference,
            };
            save(&stored, out)?;
        }
        if let Some(json) = json {
            json.keep()?;
        }
        say(&describe(&self.sequence, &numbers));
        Ok(true)
    }

    /// The reference frame that is asked for; none in vertex space.
    fn reference(&self, sequence: &Sequence, space: SpaceKind) -> Result<Vec<f64>, Failure> {
        match &self.reference {
            Some(path) if space == SpaceKind::Vertex => Err(format!(
                "--reference {}: vertex space has no reference frame; choose another --space",
                path.display()
            )
            .into()),
            Some(path) => {
                let found = crate::sequence::format::read(path)?;
                if found.connectivity() != sequence.connectivity() {
                    return Err(format!(
                        "--reference {}: another mesh than {}; expected the same faces in the same order",
                        path.display(),
                        self.sequence
                    )
                    .into());
                }
                Ok(found.frame(0).to_vec())
            }
            None if space == SpaceKind::Vertex => Ok(Vec::new()),
            None => Ok(sequence.frame(0).to_vec()),
        }
    }

    fn fit(
        &self,
        sequence: &Sequence,
        space: SpaceKind,
        reference: &[f64],
        knots: KnotRule,
        layout: Layout,
        pins: Vec<Pin>,
    ) -> Result<SpaceFit, Failure> {
        let constants = match (self.k, self.l, self.m) {
            (Some(k), Some(l), Some(m)) => Some(FitOptions {
                k,
                l,
                m,
                knots,
                layout,
                pins: pins.clone(),
            }),
            _ => None,
        };
        let tolerance = self.tolerance.unwrap_or(f64::NAN);
        if space == SpaceKind::Vertex {
            let (d, n) = (sequence.dimension(), sequence.frame_count());
            let frames = MatRef::from_column_major_slice(sequence.positions(), d, n);
            let fit = match &constants {
                Some(options) => fit(frames, options)?,
                None => {
                    let most = allowed_error(sequence, tolerance);
                    fit_to_error(frames, most, knots, layout, &pins)?
                }
            };
            let rms = (fit.errors.psi / (n * d / 3) as f64).sqrt();
            return Ok(SpaceFit { fit, rms });
        }
        let prepared = prepare(space, sequence.connectivity().clone(), reference)?;
        let frames = sequence.positions();
        Ok(match &constants {
            Some(options) => fit_in_space(&*prepared, frames, options)?,
            None => {
                let size = bounds(sequence.frame(0)).diagonal();
                let rms = (tolerance * size).max(f64::MIN_POSITIVE);
                fit_in_space_to_rms(&*prepared, frames, rms, knots, layout, &pins)?
            }
        })
    }
}

/// The error (2) at which the relative RMS is `relative`.
fn allowed_error(sequence: &Sequence, relative: f64) -> f64 {
    let size = bounds(sequence.frame(0)).diagonal();
    let vertices = sequence.frame_count() * sequence.connectivity().vertex_count();
    let allowed = (relative * size).powi(2) * vertices as f64;
    // So small a tolerance, or a first frame of no size, leaves no error but 0.
    allowed.clamp(f64::MIN_POSITIVE, f64::MAX)
}

/// Everything that `--json` holds.
fn numbers(
    sequence: &Sequence,
    found: &SpaceFit,
    space: SpaceKind,
    knots: KnotRule,
    layout: Layout,
) -> serde_json::Value {
    let fit = &found.fit;
    let (k, l, m) = fit.klm();
    let (n, vertices) = (
        sequence.frame_count(),
        sequence.connectivity().vertex_count(),
    );
    let distance = found.rms * ((n * vertices) as f64).sqrt();
    let ms = |d: std::time::Duration| d.as_secs_f64() * 1e3;
    let t = fit.timings;
    let astray: Vec<_> = places(fit)
        .into_iter()
        .filter(Place::is_astray)
        .map(|p| json!({"time": p.time, "stray": p.stray, "curvature": p.curvature}))
        .collect();
    json!({
        "n": n, "d": fit.representation.dimension(), "k": k, "l": l, "m": m,
        "V": vertices, "F": sequence.connectivity().faces().len(),
        "space": space.name(), "knots": knots.to_string(),
        "layout": layout.to_string(), "layout_weight": fit.layout_weight,
        "error_h": fit.errors.h, "error_g": fit.errors.g, "error_f": fit.errors.f, "error_psi": fit.errors.psi,
        "rms_relative": ratio(found.rms, bounds(sequence.frame(0)).diagonal()),
        "kg_percent": 100.0 * ratio(distance, spread(sequence)),
        "stored_numbers": fit.representation.stored_numbers(),
        "same_pose": fit.same_pose,
        "astray": astray,
        "sites": fit.sites.order.iter().map(|i| i + 1).collect::<Vec<_>>(),
        "time_ms": {"h": ms(t.h), "mds": ms(t.mds), "rbf": ms(t.rbf), "g": ms(t.g), "f": ms(t.f)},
    })
}

fn ratio(value: f64, scale: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value / scale }
}

/// ||A - E(A)|| of Karni & Gotsman 2004: E(A) puts every vertex at the mean vertex of its frame.
fn spread(sequence: &Sequence) -> f64 {
    let frame_spread = |frame: &[f64]| -> f64 {
        (0..3)
            .map(|axis| {
                let values = || frame.iter().skip(axis).step_by(3);
                let mean = values().sum::<f64>() / (frame.len() / 3) as f64;
                values().map(|x| (x - mean).powi(2)).sum::<f64>()
            })
            .sum()
    };
    let frames = sequence.positions().chunks(sequence.dimension());
    frames.map(frame_spread).sum::<f64>().sqrt()
}

fn describe(name: &str, v: &serde_json::Value) -> String {
    let number = |key: &str| v[key].as_f64().unwrap_or(f64::NAN);
    let t = |key: &str| v["time_ms"][key].as_f64().unwrap_or(f64::NAN);
    format!(
        "{name}: {} space, n = {}, k = {}, l = {}, m = {}, {} knots, {} layout (weight {})\n\
         errors: (3) {:.5}, (4) {:.5}, (7) {:.5}, (2) {:.5}\n\
         {}
         relative RMS {:.4}%, Karni-Gotsman {:.4}%, {} numbers stored for {} given\n\
         ms: h {:.3}, mds {:.3}, rbf {:.3}, g {:.3}, f {:.3}",
        v["space"].as_str().unwrap_or(""),
        v["n"],
        v["k"],
        v["l"],
        v["m"],
        v["knots"].as_str().unwrap_or(""),
        v["layout"].as_str().unwrap_or(""),
        v["layout_weight"],
        number("error_h"),
        number("error_g"),
        number("error_f"),
        number("error_psi"),
        astray_line(&v["astray"]),
        100.0 * number("rms_relative"),
        number("kg_percent"),
        v["stored_numbers"],
        3 * v["n"].as_u64().unwrap_or(0) * v["V"].as_u64().unwrap_or(0),
        t("h"),
        t("mds"),
        t("rbf"),
        t("g"),
        t("f"),
    )
}

/// How many in-betweens go astray, and which the most.
fn astray_line(places: &serde_json::Value) -> String {
    let stray = |p: &serde_json::Value| p["stray"].as_f64().unwrap_or(0.0);
    let places = places.as_array().map_or(&[][..], Vec::as_slice);
    let farther = |a, b| if stray(b) > stray(a) { b } else { a };
    match places.iter().reduce(farther) {
        Some(worst) => format!(
            "in-betweens astray: {}, the farthest at t = {}, {:.2} steps off",
            places.len(),
            worst["time"],
            stray(worst)
        ),
        None => "in-betweens astray: none".into(),
    }
}

/// Rows `frame,x,y` below a header line, with frames of 1 to n.
fn read_pins(path: &Path, n: usize) -> Result<Vec<Pin>, Failure> {
    let place = path.display();
    let file = std::fs::File::open(path).map_err(|e| format!("{place}: cannot read pins: {e}"))?;
    // One byte more than allowed tells a file that is too long; a device never ends.
    let mut text = String::new();
    file.take(LONGEST_PINS + 1)
        .read_to_string(&mut text)
        .map_err(|e| format!("{place}: cannot read pins: {e}"))?;
    if text.len() as u64 > LONGEST_PINS {
        return Err(
            format!("{place}: more than {LONGEST_PINS} bytes, which pins never have").into(),
        );
    }
    let pins = parse_pins(&text).map_err(|e| {
        format!("{place}: {e}; expected a line `frame,x,y` and then one such row a pin, frames counted from 1")
    })?;
    validate_pins(&pins, n).map_err(|e| format!("{place}: {e}"))?;
    Ok(pins)
}

fn parse_pins(text: &str) -> Result<Vec<Pin>, Failure> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header = reader.headers()?;
    if header != ["frame", "x", "y"].as_slice() {
        let found: Vec<String> = header.iter().map(shortened).collect();
        return Err(format!("the first line is `{}`", found.join(",")).into());
    }
    let mut pins = Vec::new();
    for row in reader.deserialize() {
        let (frame, x, y): (usize, f64, f64) = row?;
        let frame = frame.checked_sub(1).ok_or("a pin names frame 0")?;
        pins.push(Pin {
            frame,
            position: [x, y],
        });
    }
    Ok(pins)
}

/// The beginning of what may be very long.
fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

#[derive(Args)]
pub struct SampleVerb {
    /// A representation that `signal fit` wrote
    representation: PathBuf,
    /// Number of frames, evenly spaced over [1, n]; as many as were fitted if not given
    #[arg(long, value_name = "N", conflicts_with = "times", allow_negative_numbers = true, value_parser = whole("1 or more"))]
    count: Option<usize>,
    /// Frame times in [1, n], separated by commas
    #[arg(
        long,
        value_name = "T,T,..",
        value_delimiter = ',',
        allow_negative_numbers = true
    )]
    times: Vec<f64>,
    /// Where to: .npz, .pc2 (with an .obj beside it), or a folder of OBJ frames
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,
}

impl SampleVerb {
    pub fn run(self) -> Outcome {
        let stored = load(&self.representation)?;
        let n = stored.representation.time.frame_count() as f64;
        let times = self.frame_times(n)?;
        check_memory(times.len(), stored.representation.dimension())?;
        let frames = stored.sample(&times);
        let frames = frames.map_err(|e| format!("{}: {e}", self.representation.display()))?;
        let sequence = Sequence::new(stored.connectivity, times.len(), frames)
            .map_err(|e| format!("{}: sampled, {e}", self.representation.display()))?;
        write(&sequence, &self.out)?;
        say(&format!("{}: {} frames", self.out.display(), times.len()));
        Ok(true)
    }

    fn frame_times(&self, n: f64) -> Result<Vec<f64>, Failure> {
        if let Some(t) = self.times.iter().find(|t| !(1.0..=n).contains(*t)) {
            return Err(format!("--times {t}: expected frame times from 1 to {n}").into());
        }
        if !self.times.is_empty() {
            return Ok(self.times.clone());
        }
        let count = self.count.unwrap_or(n as usize);
        if count == 0 || count > MOST_FRAMES {
            return Err(format!("--count {count}: expected 1 to {MOST_FRAMES}").into());
        }
        let step = if count > 1 {
            (n - 1.0) / (count - 1) as f64
        } else {
            0.0
        };
        Ok((0..count).map(|i| (1.0 + i as f64 * step).min(n)).collect())
    }
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
