//! `signal transfer` (section 4.3).

use std::path::Path;

use clap::Args;
use faer::{Mat, MatRef};
use serde_json::{Value, json};

use super::super::output::say;
use super::super::places::Places;
use super::super::{Failure, FrameChoice, Outcome, whole};
use super::result::Outputs;
use crate::harness::case::Frames;
use crate::sequence::Sequence;
use crate::sequence::dataset::open;
use crate::sequence::format::npz;
use crate::shape::{Space, SpaceKind, encode_examples, patches_for, prepare};
use crate::signal::Point;
use crate::signal::file::{Stored, load};
use crate::signal::knots::KnotRule;
use crate::signal::psi::Representation;
use crate::signal::transfer::{ExampleBasis, encode_motion, replace_shape};

pub const EXAMPLES: &str = "Examples:
  meshseq signal fit @gallop-small --tolerance 0.01 -o gallop.npz
  meshseq signal transfer gallop.npz --examples @gallop-small @gallop-small \\
    --example-frames 1..8 -o galloping
  meshseq signal transfer @gallop-small --examples @gallop-small @gallop-small \\
    --example-frames 1..8 --space gradient -o galloping.npz --json transfer.json

Examples pair frame by frame; the first shows both meshes in a reference pose. What they miss is the
share of the motion's spread about its mean that no mixture of them shows: near 0% the transfer
is faithful, and where it is large more examples help, from other moments of the motion.

The frames of a sequence are laid out by the paper's scaling, as by `--layout mds` of `signal fit`;
for another layout fit the sequence first and give its representation.";

#[derive(Args)]
pub struct TransferVerb {
    /// The motion: a representation, whose pose and time signals stay, or a sequence, to which they are fitted
    source: String,
    /// Examples of the source's mesh and the same ones of the target's
    #[arg(long, num_args = 2, value_names = ["A_SEQ", "B_SEQ"], required = true)]
    examples: Vec<String>,
    /// Reference poses of both meshes, one OBJ each, put before the examples
    #[arg(long, num_args = 2, value_names = ["A_OBJ", "B_OBJ"])]
    rest: Option<Vec<String>>,
    /// Examples to take, 1-based, both ends in, such as 1..7 or 2..5,8..10
    #[arg(
        long,
        value_name = "A..B",
        default_value = "..",
        allow_hyphen_values = true
    )]
    example_frames: String,
    /// Shape space of both meshes: vertex, gradient, lric, lengths or patch; that of the representation if not given, vertex for a sequence
    #[arg(long, value_name = "SPACE")]
    space: Option<String>,
    /// Control points of the time signal of a sequence, 4 to n + 2; n + 2 if not given
    #[arg(long, allow_negative_numbers = true, value_parser = whole("4 to n + 2 for n frames"))]
    k: Option<usize>,
    /// Sites of the pose signal of a sequence, 3 to n; n if not given
    #[arg(long, allow_negative_numbers = true, value_parser = whole("3 to n for n frames"))]
    l: Option<usize>,
    /// How knots average parameters in the time signal of a sequence: symmetric, which is the default, or literal
    #[arg(long, value_name = "RULE")]
    knots: Option<String>,
    #[command(flatten)]
    frames: FrameChoice,
    #[command(flatten)]
    outputs: Outputs,
}

/// Examples of one mesh, the reference pose first.
struct Examples {
    sequence: Sequence,
    z: Mat<f64>,
    space: Box<dyn Space>,
    patches: Vec<i64>,
}

/// The motion over the source's examples.
struct Motion {
    over_examples: Representation,
    positions: Vec<Point>,
    /// The share of its spread in S that the examples cannot show.
    missed: f64,
    rank: usize,
}

impl TransferVerb {
    pub fn run(self) -> Outcome {
        let knots = self.knots.as_deref().map(str::parse).transpose()?;
        self.outputs.check(self.reads())?;
        let path = Path::new(&self.source);
        let stored = is_representation(path).then(|| load(path)).transpose()?;
        stored.as_ref().map_or(Ok(()), |s| self.check_kept(s))?;
        let (a, b) = self.pairs(stored.as_ref())?;
        let motion = self.motion(stored.as_ref(), &a, knots.unwrap_or_default())?;
        let (moved, numbers) = moved(motion, &b)?;
        let numbers = self
            .outputs
            .write(&moved, b.sequence.positions(), numbers)?;
        say(&format!(
            "{}: {} frames of V = {} in {} space by {} examples, which miss {:.2}% of the motion; {}",
            self.outputs.out.display(),
            numbers["n"],
            numbers["V"],
            moved.space.name(),
            moved.representation.basis.ncols() + 1,
            100.0 * numbers["missed"].as_f64().unwrap_or(f64::NAN),
            super::result::inside_out(&numbers, moved.space),
        ));
        Ok(true)
    }

    fn reads(&self) -> Places {
        let reads = Places::default().reads_sequence("<SOURCE>", &self.source);
        let examples = self.examples.iter().map(|name| ("--examples", name));
        let rest = self.rest.iter().flatten().map(|name| ("--rest", name));
        let named = examples.chain(rest);
        named.fold(reads, |reads, (name, path)| {
            reads.reads_sequence(name, path)
        })
    }

    /// An error where options ask for a change of signals that stay as they are.
    fn check_kept(&self, stored: &Stored) -> Result<(), Failure> {
        let asked: Option<SpaceKind> = self.space.as_deref().map(str::parse).transpose()?;
        if let Some(asked) = asked.filter(|asked| *asked != stored.space) {
            return Err(format!(
                "--space {}: {} is in {} space; fit it in the other space first, or leave --space out",
                asked.name(),
                self.source,
                stored.space.name()
            )
            .into());
        }
        if self.k.or(self.l).is_some() {
            return Err(format!(
                "--k and --l: the signals of {} stay as they are; constants are for sequences",
                self.source
            )
            .into());
        }
        if let Some(rule) = &self.knots {
            return Err(format!(
                "--knots {rule}: the time signal of {} keeps its knots; leave --knots out, or give a sequence",
                self.source
            )
            .into());
        }
        if !self.frames.is_all() {
            return Err(format!(
                "--frames and --every: {} is transferred whole; edit or sample it first, or give a sequence",
                self.source
            )
            .into());
        }
        Ok(())
    }

    /// The examples of both sides, in the space of the representation where there is one, over its reference and patches.
    fn pairs(&self, stored: Option<&Stored>) -> Result<(Examples, Examples), Failure> {
        let kind = match (stored, &self.space) {
            (Some(stored), _) => stored.space,
            (None, Some(name)) => name.parse()?,
            (None, None) => SpaceKind::Vertex,
        };
        let (a, b) = (self.examples(0)?, self.examples(1)?);
        let [name_a, name_b] = [0, 1].map(|side| &self.examples[side]);
        if a.frame_count() != b.frame_count() {
            return Err(format!(
                "--examples: {} of {name_a} but {} of {name_b}; they pair frame by frame, so give as many of each",
                a.frame_count(),
                b.frame_count(),
            )
            .into());
        }
        let space = stored.map(|s| (s.reference.clone(), s.patches.clone()));
        let a = encoded(a, kind, space).map_err(|e| format!("--examples {name_a}: {e}"))?;
        let b = encoded(b, kind, None).map_err(|e| format!("--examples {name_b}: {e}"))?;
        Ok((a, b))
    }

    /// The motion over the examples of its own mesh.
    fn motion(
        &self,
        stored: Option<&Stored>,
        a: &Examples,
        knots: KnotRule,
    ) -> Result<Motion, Failure> {
        let basis = ExampleBasis::new(a.z.as_ref());
        let basis = basis.map_err(|e| format!("--examples {}: {e}", self.examples[0]))?;
        match stored {
            Some(stored) => self.kept(stored, a, &basis),
            None => self.fitted(a, &basis, knots),
        }
    }

    /// The examples of one side, the reference pose first.
    fn examples(&self, side: usize) -> Result<Sequence, Failure> {
        let name = &self.examples[side];
        let poses = open(name)?;
        let indices = chosen(&self.example_frames, poses.frame_count());
        let indices = indices.map_err(|e| format!("--examples {name}: --example-{e}"))?;
        let poses = poses.select(&indices)?;
        let Some(rest) = self.rest.as_ref().map(|rest| &rest[side]) else {
            return Ok(poses);
        };
        let first = open(rest)?;
        if first.connectivity() != poses.connectivity() {
            return Err(format!(
                "--rest {rest}: another mesh than {name}; expected the same faces in the same order"
            )
            .into());
        }
        let positions = [first.frame(0), poses.positions()].concat();
        Ok(Sequence::new(
            poses.connectivity().clone(),
            poses.frame_count() + 1,
            positions,
        )?)
    }

    fn kept(&self, stored: &Stored, a: &Examples, basis: &ExampleBasis) -> Result<Motion, Failure> {
        if stored.connectivity != *a.sequence.connectivity() {
            return Err(self.other_mesh());
        }
        let n = stored.representation.time.frame_count();
        let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
        let z = stored.representation.evaluate(&times);
        let z = MatRef::from_column_major_slice(&z, stored.representation.dimension(), n);
        Ok(Motion {
            over_examples: basis.express(&stored.representation)?,
            positions: stored.positions.clone(),
            missed: basis.missed(z)?,
            rank: basis.rank(),
        })
    }

    fn fitted(
        &self,
        a: &Examples,
        basis: &ExampleBasis,
        knots: KnotRule,
    ) -> Result<Motion, Failure> {
        let sequence = self.frames.open(&self.source)?;
        if sequence.connectivity() != a.sequence.connectivity() {
            return Err(self.other_mesh());
        }
        let n = sequence.frame_count();
        let rest = a.sequence.frame(0);
        let of_source = |e| format!("{}: {e}", self.source);
        let z = encode_motion(&*a.space, rest, basis, sequence.positions()).map_err(of_source)?;
        let (k, l) = (self.k.unwrap_or(n + 2), self.l.unwrap_or(n));
        let fit = basis.fit(z.as_ref(), k, l, knots, &[]).map_err(of_source)?;
        Ok(Motion {
            over_examples: fit.representation,
            positions: fit.positions,
            missed: basis.missed(z.as_ref())?,
            rank: basis.rank(),
        })
    }

    fn other_mesh(&self) -> Failure {
        format!(
            "{} and its examples {} are of two meshes; expected the same faces in the same order",
            self.source, self.examples[0]
        )
        .into()
    }
}

/// The motion with the target's examples in place of the source's, and what `--json` holds of it.
fn moved(motion: Motion, b: &Examples) -> Result<(Stored, Value), Failure> {
    let mesh = b.sequence.connectivity();
    let kind = b.space.kind();
    let representation = replace_shape(motion.over_examples, b.z.as_ref())?;
    let numbers = json!({
        "n": representation.time.frame_count(), "m": representation.basis.ncols(), "rank": motion.rank,
        "k": representation.time.spline.control.len(), "l": representation.pose.site_count(),
        "V": mesh.vertex_count(), "F": mesh.faces().len(),
        "space": kind.name(), "missed": motion.missed,
    });
    let stored = Stored {
        representation,
        positions: motion.positions,
        connectivity: mesh.clone(),
        space: kind,
        reference: match kind {
            SpaceKind::Vertex => Vec::new(),
            _ => b.sequence.frame(0).to_vec(),
        },
        patches: b.patches.clone(),
    };
    Ok((stored, numbers))
}

/// Over the reference and patches given, or over the first of the examples.
fn encoded(
    sequence: Sequence,
    kind: SpaceKind,
    given: Option<(Vec<f64>, Vec<i64>)>,
) -> Result<Examples, Failure> {
    let mesh = sequence.connectivity();
    let (reference, patches): (Vec<f64>, Vec<i64>) = match given {
        Some(given) => given,
        None => {
            let rest = sequence.frame(0);
            let patches = patches_for(kind, mesh, rest, sequence.positions())?;
            (rest.to_vec(), patches)
        }
    };
    let space = prepare(kind, mesh.clone(), &reference, &patches)?;
    Ok(Examples {
        patches,
        z: encode_examples(&*space, sequence.positions())?,
        sequence,
        space,
    })
}

/// The 0-based frames of ranges `A..B` with commas between them.
fn chosen(ranges: &str, count: usize) -> Result<Vec<usize>, Failure> {
    let mut indices = Vec::new();
    for range in ranges.split(',') {
        let frames: Frames = range.parse()?;
        indices.extend(frames.indices(count)?);
    }
    Ok(indices)
}

/// Whether a file holds a representation, and not a sequence or nothing that can be read.
fn is_representation(path: &Path) -> bool {
    let npz = path.extension().is_some_and(|e| e == "npz") && path.is_file();
    let ours = |name: &str| ["h0", "windows"].contains(&name);
    npz && npz::Archive::open(path).is_ok_and(|archive| archive.names().any(ours))
}
