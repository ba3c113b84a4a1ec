//! Timing: engines that agree, in turn, round by round, so that ratios hold while the machine's speed drifts.

use std::time::Duration;

use super::case::Case;
use super::engine::{Engine, Outcome, Question};
use super::record::{SampleRow, TimingRow};
use super::stats::{least, mad, median, paired_ratio};
use crate::arrays::Bundle;
use crate::stages::{self, Stage};

/// A sample lasts about this long or one call.
const SAMPLE_SECONDS: f64 = 2e-3;
const MOST_BATCH: f64 = 2000.0;
/// All rounds of one engine on one case last about this long, warming up apart.
const BUDGET_SECONDS: f64 = 2.0;
const ROUNDS: (usize, usize) = (5, 15);
/// Calls before a sample last up to this long, where one takes less. Threads of the engine before, OpenBLAS's above all, look for more work for 35 ms after
/// their last call, and the scheduler leaves two threads that wake up together on one core for up to 50 ms while the other idles.
const WARM_UP_SECONDS: f64 = 0.1;
/// An engine whose call takes longer has one sample, from before the first round.
const SLOW_SECONDS: f64 = 4.0;

/// Times the engines of these places in the list (those that agree) on a case. Every round asks each once; each answers after warm-up calls where these
/// are cheap.
pub fn measure(
    case: &Case,
    inputs: &Bundle,
    engines: &mut [Box<dyn Engine>],
    places: &[usize],
) -> (Vec<TimingRow>, Vec<SampleRow>) {
    let Some(stage) = stages::find(case.stage) else {
        return (Vec::new(), Vec::new());
    };
    let timed = |engine: &mut dyn Engine, batch: usize, before: usize| {
        ask(engine, stage, inputs, case.timeout, batch, before)
    };
    let mut runs: Vec<Run> = Vec::new();
    for &place in places {
        let engine = engines[place].as_mut();
        // The first call warms up; the second says how long one takes.
        if let Some(seconds) = timed(engine, 1, 1) {
            let batch = (SAMPLE_SECONDS / seconds).clamp(1.0, MOST_BATCH).ceil() as usize;
            runs.push(Run {
                place,
                batch,
                before: (WARM_UP_SECONDS / (seconds * batch as f64)) as usize,
                pilot: seconds,
                seconds: Vec::from_iter((seconds > SLOW_SECONDS).then_some(seconds)),
            });
        }
    }
    let slowest = runs
        .iter()
        .filter(|run| !run.slow())
        .map(|r| r.pilot * r.batch as f64)
        .fold(1e-6, f64::max);
    let rounds = ((BUDGET_SECONDS / slowest) as usize).clamp(ROUNDS.0, ROUNDS.1);
    for _ in 0..rounds {
        // An engine that fails now is asked no more and has no time.
        runs.retain_mut(|run| {
            if run.slow() {
                return true;
            }
            let seconds = timed(engines[run.place].as_mut(), run.batch, run.before);
            run.seconds.extend(seconds);
            seconds.is_some()
        });
    }
    rows(case, engines, &runs)
}

struct Run {
    place: usize,
    batch: usize,
    /// Samples of warming up.
    before: usize,
    pilot: f64,
    seconds: Vec<f64>,
}

impl Run {
    fn slow(&self) -> bool {
        self.pilot > SLOW_SECONDS
    }
}

fn ask(
    engine: &mut dyn Engine,
    stage: &'static Stage,
    inputs: &Bundle,
    timeout: Duration,
    batch: usize,
    before: usize,
) -> Option<f64> {
    let question = Question {
        stage,
        inputs,
        samples: before + 1,
        batch,
        timeout,
    };
    match engine.ask(&question) {
        Outcome::Answer { seconds, .. } => seconds.last().copied(),
        _ => None,
    }
}

fn rows(
    case: &Case,
    engines: &[Box<dyn Engine>],
    runs: &[Run],
) -> (Vec<TimingRow>, Vec<SampleRow>) {
    let rust = runs
        .iter()
        .find(|run| engines[run.place].name() == "rust")
        .map(|run| run.seconds.as_slice());
    let mut timing = Vec::new();
    let mut samples = Vec::new();
    for run in runs.iter().filter(|run| !run.seconds.is_empty()) {
        let engine = engines[run.place].name().to_owned();
        let published = case.published.as_ref().filter(|_| engine == "rust");
        timing.push(TimingRow {
            case: case.name.clone(),
            stage: case.stage.into(),
            samples: run.seconds.len(),
            batch: run.batch,
            median_seconds: median(&run.seconds),
            mad_seconds: mad(&run.seconds),
            least_seconds: least(&run.seconds),
            ratio_to_rust: rust.map_or(f64::NAN, |rust| paired_ratio(&run.seconds, rust)),
            published_seconds: published.map(|p| p.0),
            published_source: published.map(|p| p.1.clone()).unwrap_or_default(),
            engine: engine.clone(),
        });
        samples.extend(
            run.seconds
                .iter()
                .enumerate()
                .map(|(round, &seconds)| SampleRow {
                    case: case.name.clone(),
                    engine: engine.clone(),
                    round,
                    seconds,
                }),
        );
    }
    (timing, samples)
}
