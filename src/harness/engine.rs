//! Engines: what can run a stage. Rust and tobj run inside this process; an oracle is a program asked over the wire.

use std::collections::VecDeque;
use std::io::{BufReader, BufWriter, Read};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use super::registry::Oracle;
use super::wire::{WireError, read_message, write_message};
use crate::arrays::{Array, Bundle};
use crate::stages::Stage;

/// How much of a program's last words is kept.
const STDERR_LINES: usize = 12;
const STDERR_LINE: usize = 300;
/// How long a program that has closed its output may take to be gone, and one that is gone to be heard to the end.
const FAREWELL: Duration = Duration::from_secs(1);
/// Numbers beyond this overflow when they are squared, and are no answer.
const GREATEST: f64 = 1e150;

/// What an engine is asked.
pub struct Question<'a> {
    pub stage: &'static Stage,
    pub inputs: &'a Bundle,
    /// Timing samples to take, each the mean of `batch` calls.
    pub samples: usize,
    pub batch: usize,
    pub timeout: Duration,
}

/// What came back.
#[derive(Clone, Debug)]
pub enum Outcome {
    Answer { outputs: Bundle, seconds: Vec<f64> },
    Unsupported(String),
    Error(String),
    Timeout(String),
    Missing(String),
}

impl Outcome {
    /// Why there is no answer; empty where there is one.
    pub fn reason(&self) -> &str {
        match self {
            Self::Answer { .. } => "",
            Self::Unsupported(why) | Self::Error(why) | Self::Timeout(why) | Self::Missing(why) => {
                why
            }
        }
    }
}

/// Something that can run a stage.
pub trait Engine: Send {
    /// As in reports and in `--engine`.
    fn name(&self) -> &str;
    /// The stages it may be asked.
    fn stages(&self) -> Vec<String>;
    /// What makes it independent.
    fn descent(&self) -> &str;
    /// Its receipt. Without one: `Missing` where it cannot be started or ends at once, with what brings it here; `Timeout` or `Error` where it is
    /// here and misbehaves.
    fn version(&mut self) -> Result<String, Outcome>;
    /// Runs the stage. Never panics, never takes much longer than the timeout.
    fn ask(&mut self, question: &Question) -> Outcome;
}

/// Calls a prepared stage `samples` x `batch` times.
pub fn sample(question: &Question) -> Outcome {
    let mut call = match (question.stage.prepare)(question.inputs) {
        Ok(call) => call,
        Err(error) => return Outcome::Error(error.to_string()),
    };
    let mut seconds = Vec::new();
    for _ in 0..question.samples {
        let start = Instant::now();
        for _ in 0..question.batch {
            if let Err(error) = call.run() {
                return Outcome::Error(error.to_string());
            }
        }
        seconds.push(start.elapsed().as_secs_f64() / question.batch as f64);
    }
    checked(call.outputs(), seconds)
}

/// An answer with NaN, infinity or what soon becomes one in it is none.
fn checked(outputs: Bundle, seconds: Vec<f64>) -> Outcome {
    match outputs.first_beyond(GREATEST) {
        Some(place) => Outcome::Error(format!("the answer is not finite: {place}")),
        None => Outcome::Answer { outputs, seconds },
    }
}

/// This crate.
pub struct Rust;

impl Engine for Rust {
    fn name(&self) -> &str {
        "rust"
    }

    fn stages(&self) -> Vec<String> {
        crate::stages::all().map(|s| s.name.to_owned()).collect()
    }

    fn descent(&self) -> &str {
        "this crate"
    }

    fn version(&mut self) -> Result<String, Outcome> {
        Ok(format!(
            "meshseq {}, {} threads",
            env!("CARGO_PKG_VERSION"),
            rayon::current_num_threads()
        ))
    }

    fn ask(&mut self, question: &Question) -> Outcome {
        sample(question)
    }
}

/// A program of `oracles/`, started when first asked and again after it hung or crashed.
pub struct OracleProcess {
    oracle: Oracle,
    running: Option<Running>,
}

struct Running {
    child: Child,
    requests: Sender<Bundle>,
    replies: Receiver<Result<Bundle, WireError>>,
    last_words: Arc<Mutex<LastWords>>,
    /// Closed when standard error has been heard to its end.
    hearing: Receiver<()>,
}

impl OracleProcess {
    /// Nothing is started yet.
    pub fn new(oracle: Oracle) -> Self {
        Self {
            oracle,
            running: None,
        }
    }

    fn start(&mut self) -> Result<&mut Running, String> {
        if self.running.is_none() {
            self.running = Some(start(&self.oracle)?);
        }
        self.running.as_mut().ok_or_else(|| "not started".into())
    }

    /// One request and its reply; a program that fails at it is stopped, so that the next question finds a fresh one. `ended` is what it means
    /// when the program ends instead.
    fn exchange(
        &mut self,
        request: Bundle,
        timeout: Duration,
        ended: fn(String) -> Outcome,
    ) -> Result<Bundle, Outcome> {
        let running = self.start().map_err(Outcome::Missing)?;
        let failure = match running.replies.try_recv() {
            Ok(Ok(_)) => (
                Outcome::Error as fn(String) -> Outcome,
                "it wrote a message that nobody asked for".into(),
            ),
            // It may have ended since its last answer.
            Ok(Err(error)) => (ended, error.to_string()),
            Err(_) => {
                // A writer that is gone is noticed when the reply does not come.
                let _ = running.requests.send(request);
                match running.replies.recv_timeout(timeout) {
                    Ok(Ok(reply)) => return Ok(reply),
                    Ok(Err(WireError::End)) => (ended, running.end()),
                    Ok(Err(error)) => (Outcome::Error as _, error.to_string()),
                    Err(RecvTimeoutError::Timeout) => {
                        (Outcome::Timeout as _, format!("no answer in {timeout:?}"))
                    }
                    Err(RecvTimeoutError::Disconnected) => {
                        (Outcome::Error as _, "its reader is gone".into())
                    }
                }
            }
        };
        let (outcome, what) = failure;
        let said = running.stop();
        self.running = None;
        Err(outcome(format!("{what}{said}")))
    }
}

impl Running {
    /// How the program ended, after it has closed its output.
    fn end(&mut self) -> String {
        let deadline = Instant::now() + FAREWELL;
        while Instant::now() < deadline {
            if let Ok(Some(status)) = self.child.try_wait() {
                return format!("it ended without an answer ({status})");
            }
            thread::sleep(Duration::from_millis(5));
        }
        "it closed its output without an answer".into()
    }

    /// Ends the program, and what it last said.
    fn stop(&mut self) -> String {
        let _ = self.child.kill();
        let _ = self.child.wait();
        // Nothing is ever sent; the wait is for the sender to be dropped.
        let _ = self.hearing.recv_timeout(FAREWELL);
        match self.last_words.lock() {
            Ok(words) => words.text(),
            Err(_) => String::new(),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn start(oracle: &Oracle) -> Result<Running, String> {
    let (program, arguments) = oracle.command.split_first().ok_or("its command is empty")?;
    let mut child = Command::new(program)
        .args(arguments)
        .current_dir(&oracle.folder)
        .env("OPENBLAS_NUM_THREADS", oracle.threads.to_string())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| format!("cannot start {program}: {error}"))?;
    let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    let (Some(stdin), Some(stdout), Some(stderr)) = pipes else {
        return Err("its pipes could not be opened".into());
    };
    let (requests, inbox) = channel::<Bundle>();
    let (outbox, replies) = channel();
    let (heard, hearing) = channel();
    let last_words = Arc::new(Mutex::new(LastWords::default()));
    thread::spawn(move || {
        let mut stdin = BufWriter::new(stdin);
        while let Ok(request) = inbox.recv() {
            if write_message(&mut stdin, &request).is_err() {
                break;
            }
        }
    });
    thread::spawn(move || {
        let mut stdout = BufReader::new(stdout);
        loop {
            let reply = read_message(&mut stdout);
            let over = reply.is_err();
            if outbox.send(reply).is_err() || over {
                break;
            }
        }
    });
    let words = last_words.clone();
    thread::spawn(move || {
        hear(stderr, &words);
        drop(heard);
    });
    Ok(Running {
        child,
        requests,
        replies,
        last_words,
        hearing,
    })
}

/// Reads to the end in small pieces, so that a program which never ends a line takes no memory.
fn hear(mut stream: impl Read, words: &Mutex<LastWords>) {
    let mut buffer = [0; 4096];
    while let Ok(count) = stream.read(&mut buffer) {
        let Ok(mut words) = words.lock() else { return };
        if count == 0 {
            break;
        }
        words.add(&String::from_utf8_lossy(&buffer[..count]));
    }
}

/// The beginnings of the last lines of a stream.
#[derive(Default)]
struct LastWords {
    lines: VecDeque<String>,
    /// The line that has not ended yet.
    line: String,
}

impl LastWords {
    fn add(&mut self, text: &str) {
        for c in text.chars() {
            if c == '\n' {
                self.end_line();
            } else if self.line.len() < STDERR_LINE {
                self.line.push(if c.is_control() { ' ' } else { c });
            }
        }
    }

    fn end_line(&mut self) {
        let line = std::mem::take(&mut self.line);
        if !line.trim().is_empty() {
            self.lines.push_back(line);
        }
        if self.lines.len() > STDERR_LINES {
            self.lines.pop_front();
        }
    }

    /// For the end of a message; empty where nothing was said.
    fn text(&self) -> String {
        let lines = self.lines.iter().chain([&self.line]);
        let lines: Vec<&str> = lines.map(|l| l.trim()).filter(|l| !l.is_empty()).collect();
        if lines.is_empty() {
            String::new()
        } else {
            format!("; it last said: {}", lines.join(" | "))
        }
    }
}

impl Engine for OracleProcess {
    fn name(&self) -> &str {
        &self.oracle.engine
    }

    fn stages(&self) -> Vec<String> {
        self.oracle.stages.clone()
    }

    fn descent(&self) -> &str {
        &self.oracle.descent
    }

    fn version(&mut self) -> Result<String, Outcome> {
        let request = Bundle::from([("op", Array::Text("version".into()))]);
        let timeout = Duration::from_secs(self.oracle.start_seconds);
        let receipt =
            self.exchange(request, timeout, Outcome::Missing)
                .and_then(|reply| match reply.text("version") {
                    Ok(version) => Ok(version.to_owned()),
                    Err(error) => Err(Outcome::Error(error.to_string())),
                });
        let install = &self.oracle.install;
        let advised = |why: String| format!("{why}; to get it: {install}");
        receipt.map_err(|outcome| match outcome {
            Outcome::Missing(why) => Outcome::Missing(advised(why)),
            other => other,
        })
    }

    fn ask(&mut self, question: &Question) -> Outcome {
        let mut request = Bundle::from([
            ("op", Array::Text("run".into())),
            ("stage", Array::Text(question.stage.name.into())),
            ("samples", Array::integer(question.samples)),
            ("batch", Array::integer(question.batch)),
        ]);
        for (name, array) in &question.inputs.0 {
            request.put(&format!("in.{name}"), array.clone());
        }
        match self.exchange(request, question.timeout, Outcome::Error) {
            Ok(reply) => read_reply(reply, question.samples),
            Err(outcome) => outcome,
        }
    }
}

fn read_reply(reply: Bundle, samples: usize) -> Outcome {
    let message = || {
        reply
            .text("message")
            .unwrap_or("it did not say why")
            .to_owned()
    };
    match reply.text("status") {
        Ok("ok") => {}
        Ok("unsupported") => return Outcome::Unsupported(message()),
        Ok("error") => return Outcome::Error(message()),
        Ok(other) => return Outcome::Error(format!("unknown status `{other}`")),
        Err(error) => return Outcome::Error(error.to_string()),
    }
    let seconds = match reply.vector("seconds") {
        Ok(seconds) => seconds.to_vec(),
        Err(error) => return Outcome::Error(error.to_string()),
    };
    if seconds.len() != samples || seconds.iter().any(|&s| !(s > 0.0 && s.is_finite())) {
        return Outcome::Error(format!(
            "expected {samples} positive times, found {seconds:?}"
        ));
    }
    let mut outputs = Bundle::default();
    for (name, array) in reply.0 {
        if let Some(name) = name.strip_prefix("out.") {
            outputs.put(name, array);
        }
    }
    checked(outputs, seconds)
}

/// Every engine: this crate, the in-process peers, and the oracles of the registry, started when first asked.
pub fn all(registry: &[Oracle]) -> Vec<Box<dyn Engine>> {
    let mut engines: Vec<Box<dyn Engine>> = vec![Box::new(Rust), Box::new(super::peers::Tobj)];
    for oracle in registry {
        engines.push(Box::new(OracleProcess::new(oracle.clone())));
    }
    engines
}
