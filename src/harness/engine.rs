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

/// Something that can run a stage.
pub trait Engine: Send {
    /// As in reports and in `--engine`.
    fn name(&self) -> &str;
    /// The stages it may be asked.
    fn stages(&self) -> Vec<String>;
    /// What makes it independent.
    fn descent(&self) -> &str;
    /// Its receipt, or why it is missing and what brings it here.
    fn version(&mut self) -> Result<String, String>;
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

/// An answer with NaN or infinity in it is none.
fn checked(outputs: Bundle, seconds: Vec<f64>) -> Outcome {
    match outputs.first_not_finite() {
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

    fn version(&mut self) -> Result<String, String> {
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
    last_words: Arc<Mutex<VecDeque<String>>>,
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

    /// One request and its reply; a program that fails at it is stopped, so that the next question finds a fresh one.
    fn exchange(&mut self, request: Bundle, timeout: Duration) -> Result<Bundle, Outcome> {
        let install = self.oracle.install.clone();
        let running = self
            .start()
            .map_err(|why| Outcome::Missing(format!("{why}; to get it: {install}")))?;
        // A writer that is gone is noticed when the reply does not come.
        let _ = running.requests.send(request);
        let failure = match running.replies.recv_timeout(timeout) {
            Ok(Ok(reply)) => return Ok(reply),
            Ok(Err(error)) => {
                // A program that ended says why on its last line; give it a moment to arrive.
                thread::sleep(Duration::from_millis(50));
                Outcome::Error(format!("{error}{}", running.said()))
            }
            Err(RecvTimeoutError::Timeout) => {
                Outcome::Timeout(format!("no answer in {timeout:?}{}", running.said()))
            }
            Err(RecvTimeoutError::Disconnected) => Outcome::Error("its reader is gone".into()),
        };
        self.running = None;
        Err(failure)
    }
}

impl Running {
    fn said(&self) -> String {
        let Ok(lines) = self.last_words.lock() else {
            return String::new();
        };
        let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
        if lines.is_empty() {
            String::new()
        } else {
            format!("; it last said: {}", lines.join(" | "))
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
    let last_words = Arc::new(Mutex::new(VecDeque::new()));
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
    thread::spawn(move || keep_last_lines(stderr, &words));
    Ok(Running {
        child,
        requests,
        replies,
        last_words,
    })
}

/// Reads to the end in small pieces, so that a program which never ends a line takes no memory.
fn keep_last_lines(mut stream: impl Read, lines: &Mutex<VecDeque<String>>) {
    let mut buffer = [0; 4096];
    let mut line = String::new();
    while let Ok(count) = stream.read(&mut buffer) {
        if count == 0 {
            break;
        }
        for c in String::from_utf8_lossy(&buffer[..count]).chars() {
            if c != '\n' {
                if line.len() < STDERR_LINE {
                    line.push(c);
                }
                continue;
            }
            let Ok(mut lines) = lines.lock() else { return };
            if !line.trim().is_empty() {
                lines.push_back(std::mem::take(&mut line));
            }
            line.clear();
            if lines.len() > STDERR_LINES {
                lines.pop_front();
            }
        }
    }
    if let Ok(mut lines) = lines.lock()
        && !line.trim().is_empty()
    {
        lines.push_back(line);
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

    fn version(&mut self) -> Result<String, String> {
        let request = Bundle::from([("op", Array::Text("version".into()))]);
        let reply =
            self.exchange(request, Duration::from_secs(60))
                .map_err(|outcome| match outcome {
                    Outcome::Missing(why) => why,
                    Outcome::Error(why) | Outcome::Timeout(why) => {
                        format!("{why}; to get it: {}", self.oracle.install)
                    }
                    other => format!("{other:?}"),
                })?;
        reply
            .text("version")
            .map(str::to_owned)
            .map_err(|error| error.to_string())
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
        match self.exchange(request, question.timeout) {
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
    if seconds.len() != samples || seconds.iter().any(|&s| s.is_nan() || s <= 0.0) {
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
