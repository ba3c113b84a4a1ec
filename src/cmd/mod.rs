//! The command line, one file a verb. Exit codes: 0 done, 1 checks differ, 2 bad usage or bad input.

mod compare;
mod convert;
mod data;
mod doctor;
mod info;
mod list;
mod output;
mod places;
mod report;
mod run;
mod signal;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use crate::harness::case::Frames;
use crate::sequence::Sequence;
use crate::sequence::dataset::{open, open_stream};
use crate::sequence::format::stream::FrameStream;

/// Anything that ends a verb with exit code 2.
type Failure = Box<dyn std::error::Error>;
/// Whether all checks held.
type Outcome = Result<bool, Failure>;

#[derive(Parser)]
#[command(name = "meshseq", version, about, max_term_width = 110)]
struct Cli {
    /// Threads to compute with; all cores if not given. Results do not depend on it
    #[arg(long, global = true, value_name = "N", allow_negative_numbers = true)]
    threads: Option<usize>,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Run cases on every engine and judge the answers; write a record and an HTML report
    #[command(after_help = "Example: meshseq verify signal/h --engine numpy")]
    Verify(run::Verify),
    /// Verify cases, then time every engine that agrees
    #[command(after_help = "Example: meshseq measure signal/h/gallop-small")]
    Measure(run::Measure),
    /// Two records side by side: what got worse, what got better
    #[command(
        after_help = "Example, in the folder of the project: meshseq compare results/2026-11-24.1 results/2026-11-24.2"
    )]
    Compare(compare::Compare),
    /// Make a record's HTML report again, or put its table into a README
    #[command(
        after_help = "Example, in the folder of the project: meshseq report results/2026-11-24.2"
    )]
    Report(report::Report),
    /// Cases, stages, engines or faults
    #[command(after_help = "Example: meshseq list signal")]
    List(list::List),
    /// What is installed, and how to get what is missing
    #[command(after_help = "Example: meshseq doctor")]
    Doctor,
    /// Embedded sequences, and real data where it lies
    #[command(after_help = "Example: meshseq data --data ~/meshes")]
    Data(data::Data),
    /// What a sequence is: counts, measures, defects
    #[command(
        after_help = "Example: meshseq info @gallop-small --json info.json --quality quality.csv"
    )]
    Info(info::Info),
    /// A sequence in another format
    #[command(after_help = "Example: meshseq convert @gallop-small gallop-frames.npz")]
    Convert(convert::Convert),
    /// Cashman & Hormann 2012: time, pose and shape signals
    #[command(subcommand)]
    Signal(signal::Signal),
}

impl Verb {
    fn run(self) -> Outcome {
        match self {
            Verb::Verify(verb) => verb.run(),
            Verb::Measure(verb) => verb.run(),
            Verb::Compare(verb) => verb.run(),
            Verb::Report(verb) => verb.run(),
            Verb::List(verb) => verb.run(),
            Verb::Doctor => doctor::run(),
            Verb::Data(verb) => verb.run(),
            Verb::Info(verb) => verb.run(),
            Verb::Convert(verb) => verb.run(),
            Verb::Signal(verb) => verb.run(),
        }
    }
}

/// More threads only wait for each other.
const MOST_THREADS: usize = 1024;

/// Frames of a sequence.
#[derive(Args, Clone)]
struct FrameChoice {
    /// Frames to take, 1-based, both ends in, such as 1..24
    #[arg(
        long,
        value_name = "A..B",
        default_value = "..",
        allow_hyphen_values = true
    )]
    frames: String,
    /// Take every S-th of them
    #[arg(long, value_name = "S", default_value_t = 1, allow_negative_numbers = true, value_parser = whole("1 or more"))]
    every: usize,
}

impl FrameChoice {
    /// Whether nothing was chosen.
    fn is_all(&self) -> bool {
        self.frames == ".." && self.every == 1
    }

    fn open(&self, argument: &str) -> Result<Sequence, Failure> {
        let frames = self.parsed()?;
        let sequence = open(argument)?;
        match self.indices(argument, frames, sequence.frame_count())? {
            Some(indices) => Ok(sequence.select(&indices)?),
            None => Ok(sequence),
        }
    }

    /// The same, to be read some frames at a time.
    fn stream(&self, argument: &str) -> Result<FrameStream, Failure> {
        let frames = self.parsed()?;
        let stream = open_stream(argument)?;
        match self.indices(argument, frames, stream.frame_count())? {
            Some(indices) => Ok(stream
                .select(&indices)
                .ok_or("--frames: expected ascending frames")?),
            None => Ok(stream),
        }
    }

    fn parsed(&self) -> Result<Frames, Failure> {
        let mut frames: Frames = self.frames.parse().map_err(|e| format!("--{e}"))?;
        if self.every == 0 {
            return Err("--every 0: expected at least 1".into());
        }
        frames.step = self.every;
        Ok(frames)
    }

    /// The 0-based frames of n; None for all of them.
    fn indices(
        &self,
        argument: &str,
        frames: Frames,
        n: usize,
    ) -> Result<Option<Vec<usize>>, Failure> {
        if self.frames == ".." && self.every == 1 {
            return Ok(None);
        }
        let indices = frames.indices(n);
        Ok(Some(indices.map_err(|e| format!("{argument}: --{e}"))?))
    }
}

/// Reads a whole number; what is none is told the range.
fn whole(range: &'static str) -> impl Fn(&str) -> Result<usize, String> + Clone + Send + Sync {
    move |text| {
        let number = text.parse();
        number.map_err(|_| format!("expected a whole number, {range}"))
    }
}

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    let Cli { threads, verb } = Cli::parse();
    if let Some(threads) = threads
        && !(1..=MOST_THREADS).contains(&threads)
    {
        eprintln!("meshseq: --threads {threads}: expected 1 to {MOST_THREADS}");
        return ExitCode::from(2);
    }
    // This thread is one of the pool: otherwise each piece of parallel work would wait for one of these to wake up. The pool is not made inside of a thread of
    // its own, since glibc gives back the memory of any thread but the first, and has it cleared again, at every large array.
    // A pool that stands already is the only failure, and then its size stands too.
    let _ = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or_else(default_threads))
        .use_current_thread()
        .build_global();
    conclude(verb.run())
}

/// 0, which is rayon's own choice, but for more threads than any machine has use for in its environment variable.
fn default_threads() -> usize {
    let asked = std::env::var("RAYON_NUM_THREADS").ok();
    let asked = asked.and_then(|threads| threads.parse().ok());
    asked
        .filter(|&threads: &usize| threads > MOST_THREADS)
        .map_or(0, |_| MOST_THREADS)
}

fn conclude(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(failure) => {
            eprintln!("meshseq: {failure}");
            ExitCode::from(2)
        }
    }
}

/// The checkout with `oracles/` and `bench/`: `MESHSEQ_HOME`, a folder above this one, or where this program was built.
fn home() -> PathBuf {
    let holds = |folder: &std::path::Path| folder.join("oracles/oracles.toml").is_file();
    if let Some(named) = std::env::var_os("MESHSEQ_HOME") {
        return named.into();
    }
    let here = std::env::current_dir().unwrap_or_default();
    let above = here.ancestors().find(|folder| holds(folder));
    above.map_or_else(
        || env!("CARGO_MANIFEST_DIR").into(),
        std::path::Path::to_owned,
    )
}
