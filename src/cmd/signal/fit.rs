//! `signal fit`.

mod fitted;
mod windows;

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use faer::MatRef;

use self::fitted::{Fitted, How, MISSED, Refined, describe, missed, numbers};
use super::super::output::{draft_json, say};
use super::super::places::Places;
use super::super::{Failure, FrameChoice, Outcome, whole};
use super::tables::placed_frames;
use super::{check_between, check_representation_name};
use crate::mesh::measure::bounds;
use crate::sequence::Sequence;
use crate::shape::{Convergence, Space, SpaceKind, patches_for, prepare};
use crate::signal::fidelity::fit_to_error;
use crate::signal::file::save;
use crate::signal::fit::{Fit, FitError, FitOptions, fit};
use crate::signal::in_space::{
    SpaceFit, fit_in_space, fit_in_space_to_rms, fit_in_space_to_rms_refined, refine_in_space,
};
use crate::signal::layout::Layout;
use crate::signal::pins::{Pin, validate_pins};
use crate::signal::refine::tolerance::fit_to_error_refined;
use crate::signal::refine::{self, RefineOptions, Refinement};

pub const EXAMPLES: &str = "Examples:
  meshseq signal fit @gallop-small --k 16 --l 12 --m 7 --knots literal -o gallop.npz --json fit.json
  meshseq signal fit @roam-small:300 --tolerance 0.01 --window 120 --overlap 16 -o roam.npz

--window fits as few windows as hold N frames each, one after another, and joins them smoothly: for
sequences that are long, or larger than memory. `signal sample` and `signal info` read what it writes.

Printed: (3), (4), (7) and (2), the sums of squares of section 3 of the paper: of frames against h,
of shape coordinates against g, of pose-space positions against f, and of frames against all three,
in the units of the shape space, squared; the root mean square distance of vertices over the first
frame's diagonal; that of Karni & Gotsman 2004; and the in-betweens that leave the neighbourhood of
their frames by more than a quarter of a step.

--refine lowers (2). In other spaces than vertex space the distance of vertices may rise even so,
since (2) is then of the space; both distances are told where k, l and m are given.

The .npz holds h0 (d), H (m, d), sites (l, 2), g (l + 3, m), control (k, 2), u (k + 2), t (n), the
frames' places p (n, 2), F (F, 3), meta; but for vertex space, reference (V, 3); in patch space,
patches (F).";

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
    #[arg(long, value_name = "R", allow_negative_numbers = true, conflicts_with_all = ["k", "l", "m"])]
    tolerance: Option<f64>,
    /// Shape space: vertex, gradient, lric, lengths or patch
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
    #[arg(long, default_value_t = Layout::default().to_string(), value_name = "LAYOUT")]
    layout: String,
    /// CSV of pinned frames: frame (1-based), x, y in the units of the shape space, as `signal info --places` writes them; with a header line
    #[arg(long, value_name = "FILE")]
    pins: Option<PathBuf>,
    /// Lower the error of the whole chain jointly, from where its stages end
    #[arg(long)]
    refine: bool,
    /// With --refine: weight of the frames half-way between frames, beside 1 for a frame
    #[arg(long, value_name = "W", default_value_t = RefineOptions::default().between, requires = "refine", allow_negative_numbers = true)]
    between: f64,
    /// Fit windows of at most N frames, 6 or more, one after another: memory does not grow with the sequence
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole("6 or more"))]
    window: Option<usize>,
    /// With --window: frames that neighbouring windows have in common, 2 to a third of N; an eighth of N if not given
    #[arg(long, value_name = "M", requires = "window", allow_negative_numbers = true, value_parser = whole("2 to a third of the window"))]
    overlap: Option<usize>,
    /// Write the representation to this .npz
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The error that --tolerance allows: so many frames may each be off by its share of `size`.
#[derive(Clone, Copy)]
struct Allowed {
    size: f64,
    frames: f64,
}

impl Allowed {
    /// For a whole sequence.
    fn of(sequence: &Sequence) -> Self {
        Self {
            size: bounds(sequence.frame(0)).diagonal(),
            frames: sequence.frame_count() as f64,
        }
    }

    /// The error (2) of V vertices at which the relative RMS is `relative`.
    fn error(&self, relative: f64, vertices: usize) -> f64 {
        let allowed = (relative * self.size).powi(2) * (self.frames * vertices as f64);
        // So small a tolerance, or a first frame of no size, leaves no error but 0.
        allowed.clamp(f64::MIN_POSITIVE, f64::MAX)
    }

    /// The RMS over n frames at which the relative RMS is `relative`.
    fn rms(&self, relative: f64, n: usize) -> f64 {
        let rms = relative * self.size * (self.frames / n as f64).sqrt();
        rms.max(f64::MIN_POSITIVE)
    }
}

impl FitVerb {
    pub fn run(self) -> Outcome {
        let how = self.how()?;
        self.check_constants()?;
        self.check_places()?;
        if let Some(value) = self.tolerance.filter(|t| !(*t > 0.0 && t.is_finite())) {
            return Err(FitError::BadTolerance { value }.into());
        }
        check_between(self.between)?;
        if let Some(window) = self.window {
            return windows::run(&self, window, how);
        }
        let sequence = self.frames.open(&self.sequence)?;
        let pins = match &self.pins {
            Some(path) => read_pins(path, sequence.frame_count())?,
            None => Vec::new(),
        };
        let reference = self.reference(&sequence, how.space)?;
        let fitted = self.fit(&sequence, &reference, how, pins, Allowed::of(&sequence));
        let fitted = fitted.map_err(|e| format!("{}: {e}", self.sequence))?;
        let mut numbers = numbers(&sequence, &fitted, how);
        let missed = self.tolerance.map(|r| missed(&numbers, r));
        if let Some(missed) = missed {
            numbers["tolerance_met"] = (!missed).into();
        }
        // Whatever can fail comes before the first file gets its name.
        let json = self.json.as_ref().map(|path| draft_json(path, &numbers));
        let json = json.transpose()?;
        if let Some(out) = &self.out {
            save(&fitted.stored(&sequence, how.space, reference), out)?;
        }
        if let Some(json) = json {
            json.keep()?;
        }
        say(&describe(&self.sequence, &numbers));
        if let Some(note) = self.cut(&numbers) {
            say(&note);
        }
        let missed = missed.unwrap_or(false);
        if missed {
            say(MISSED);
        }
        Ok(!missed)
    }

    fn check_places(&self) -> Result<(), Failure> {
        let out = self.out.as_deref();
        out.map_or(Ok(()), check_representation_name)?;
        Places::default()
            .reads_sequence("<SEQUENCE>", &self.sequence)
            .reads("--reference", self.reference.as_ref())
            .reads("--pins", self.pins.as_ref())
            .writes("-o", out)
            .writes("--json", self.json.as_ref())
            .check()?;
        Ok(())
    }

    /// An error unless something says how close the fit is to be, and nothing contradicts it.
    fn check_constants(&self) -> Result<(), Failure> {
        if self.k.is_none() && self.tolerance.is_none() {
            return Err("expected --tolerance R, such as 0.01, or --k, --l and --m".into());
        }
        if self.refine && self.pins.is_some() {
            return Err(
                "--refine moves all frames in the pose plane, pinned ones too; leave out --pins or --refine".into(),
            );
        }
        Ok(())
    }

    /// What became of k, l and m that the frames have no use for.
    fn cut(&self, numbers: &serde_json::Value) -> Option<String> {
        let asked = [("k", self.k?), ("l", self.l?), ("m", self.m?)];
        let less = |(name, value): &(&str, usize)| numbers[*name] != *value;
        let cut: Vec<String> = asked
            .iter()
            .filter(|constant| less(constant))
            .map(|(name, value)| format!("{name} = {} in place of {value}", numbers[*name]))
            .collect();
        let why = "the frames have no more poses that are apart, or dimensions";
        (!cut.is_empty()).then(|| format!("{}: {why}", cut.join(", ")))
    }

    fn how(&self) -> Result<How, Failure> {
        Ok(How {
            knots: self.knots.parse()?,
            space: self.space.parse()?,
            layout: self.layout.parse()?,
        })
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
        reference: &[f64],
        how: How,
        pins: Vec<Pin>,
        allowed: Allowed,
    ) -> Result<Fitted, Failure> {
        let (mesh, frames) = (sequence.connectivity(), sequence.positions());
        let patches = patches_for(how.space, mesh, reference, frames)?;
        let space = match how.space {
            SpaceKind::Vertex => None,
            kind => Some(prepare(kind, mesh.clone(), reference, &patches)?),
        };
        let (found, refined) = self.fit_in(sequence, space.as_deref(), how, pins, allowed)?;
        Ok(Fitted {
            found,
            refined,
            patches,
        })
    }

    fn fit_in(
        &self,
        sequence: &Sequence,
        space: Option<&dyn Space>,
        how: How,
        pins: Vec<Pin>,
        allowed: Allowed,
    ) -> Result<(SpaceFit, Option<Refined>), Failure> {
        let How { knots, layout, .. } = how;
        let refine = self.refine.then(|| RefineOptions {
            between: self.between,
            ..RefineOptions::default()
        });
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
        let frames = sequence.positions();
        let (d, n) = (sequence.dimension(), sequence.frame_count());
        let Some(space) = space else {
            let frames = MatRef::from_column_major_slice(frames, d, n);
            let most = allowed.error(tolerance, d / 3);
            let rms_of = |fit: &Fit| (fit.errors.psi / (n * d / 3) as f64).sqrt();
            let (fit, told) = match (&constants, &refine) {
                (Some(options), None) => (fit(frames, options)?, None),
                (Some(options), Some(how)) => {
                    let staged = fit(frames, options)?;
                    let before = rms_of(&staged);
                    refined(refine::refine(frames, staged, how)?, Some(before))
                }
                (None, None) => (fit_to_error(frames, most, knots, layout, &pins)?, None),
                (None, Some(how)) => {
                    let found = fit_to_error_refined(frames, most, knots, layout, &pins, how)?;
                    refined(found, None)
                }
            };
            let rms = rms_of(&fit);
            let found = SpaceFit {
                fit,
                rms,
                convergence: Convergence::default(),
                decoding: Duration::ZERO,
            };
            return Ok((found, told));
        };
        let rms = allowed.rms(tolerance, n);
        Ok(match (&constants, &refine) {
            (Some(options), None) => (fit_in_space(space, frames, options)?, None),
            (Some(options), Some(how)) => {
                let staged = fit_in_space(space, frames, options)?;
                let before = staged.rms;
                refined(refine_in_space(space, frames, staged, how)?, Some(before))
            }
            (None, None) => {
                let fit = fit_in_space_to_rms(space, frames, rms, knots, layout, &pins)?;
                (fit, None)
            }
            (None, Some(how)) => {
                let found =
                    fit_in_space_to_rms_refined(space, frames, rms, knots, layout, &pins, how)?;
                refined(found, None)
            }
        })
    }
}

fn refined<T>((fit, told): (T, Refinement), rms_before: Option<f64>) -> (T, Option<Refined>) {
    (fit, Some(Refined { told, rms_before }))
}

/// Rows `frame,x,y` below a header line, with frames of 1 to n.
fn read_pins(path: &Path, n: usize) -> Result<Vec<Pin>, Failure> {
    let pins = placed_frames(path, "pins")?;
    if pins.is_empty() {
        return Err(format!("{}: no pins below the first line", path.display()).into());
    }
    validate_pins(&pins, n).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(pins)
}
