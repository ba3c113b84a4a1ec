//! A session: the engines of one run, started once, and the inputs of each case.

use std::path::{Path, PathBuf};

use tempfile::TempDir;
use thiserror::Error;

use super::case::Case;
use super::engine::{self, Engine, Outcome};
use super::inject::{Fault, Faulty};
use super::measure::measure;
use super::record::{EngineRow, FitFigures, Record, Verdict};
use super::registry::{self, RegistryError};
use super::verify::{Judged, refused, verify};
use crate::arrays::Bundle;
use crate::sequence::Sequence;
use crate::sequence::dataset::{DataFolders, DatasetError};
use crate::sequence::format::{FormatError, frame_files, write};
use crate::stages::made::{MadeError, make};
use crate::stages::{self, StageError};

/// What a run is to do.
#[derive(Default)]
pub struct Options {
    /// The checkout that holds `oracles/`.
    pub home: PathBuf,
    pub data: DataFolders,
    /// Engines to ask besides Rust; all where empty.
    pub engines: Vec<String>,
    pub fault: Option<&'static Fault>,
    pub timing: Timing,
}

/// Which cases are timed once their engines agree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Timing {
    #[default]
    None,
    /// Those that say so.
    Marked,
    All,
}

/// Why a run cannot go on.
#[derive(Debug, Error)]
pub enum SessionError {
    /// See [`RegistryError`].
    #[error(transparent)]
    Registry(#[from] RegistryError),
    /// An engine name that no entry of the registry has.
    #[error("no engine is called `{name}`; there are {known}")]
    UnknownEngine { name: String, known: String },
    /// No folder for temporary files.
    #[error("cannot make a temporary folder: {0}")]
    Scratch(#[from] std::io::Error),
    /// A case whose dataset cannot be had.
    #[error("case {case}: {source}")]
    Dataset {
        case: String,
        source: Box<DatasetError>,
    },
    /// A case whose dataset cannot be written for readers to read.
    #[error("case {case}: {source}")]
    Format {
        case: String,
        source: Box<FormatError>,
    },
    /// A case that asks for frames or constants that its dataset has not got.
    #[error("case {case}: {what}")]
    Inputs { case: String, what: String },
}

/// Engines, their receipts, and the dataset used last.
pub struct Session {
    engines: Vec<Box<dyn Engine>>,
    versions: Vec<Result<String, Outcome>>,
    options: Options,
    scratch: TempDir,
    last: Option<(String, Sequence)>,
}

/// One case's outcome, told as it comes.
pub enum Event<'a> {
    Judged(&'a Case, &'a [Judged]),
    Skipped(&'a Case, &'a str),
}

impl Session {
    /// Starts, side by side, the engines that these cases need.
    pub fn open(options: Options, cases: &[Case]) -> Result<Self, SessionError> {
        let oracles = registry::read(&options.home)?;
        let mut engines = engine::all(&oracles);
        check_names(&options.engines, &engines)?;
        let wanted = |engine: &dyn Engine| {
            let named =
                options.engines.is_empty() || options.engines.iter().any(|n| n == engine.name());
            let needed = engine
                .stages()
                .iter()
                .any(|s| cases.iter().any(|c| c.stage == s));
            needed && (named || engine.name() == "rust")
        };
        engines.retain(|engine| wanted(engine.as_ref()));
        if let Some(fault) = options.fault {
            engines[0] = Box::new(Faulty(fault));
        }
        let versions = std::thread::scope(|scope| {
            let asked: Vec<_> = engines
                .iter_mut()
                .map(|engine| scope.spawn(|| engine.version()))
                .collect();
            let answer = |thread: std::thread::ScopedJoinHandle<'_, _>| {
                thread
                    .join()
                    .unwrap_or_else(|_| Err(Outcome::Error("asking it failed".into())))
            };
            asked.into_iter().map(answer).collect()
        });
        Ok(Self {
            engines,
            versions,
            options,
            scratch: tempfile::tempdir()?,
            last: None,
        })
    }

    /// Every engine of the session, once a name.
    pub fn engines(&self) -> Vec<EngineRow> {
        let mut rows: Vec<EngineRow> = Vec::new();
        for (engine, version) in self.engines.iter().zip(&self.versions) {
            let stages = engine.stages().join(" ");
            rows.push(EngineRow {
                engine: engine.name().into(),
                stages,
                descent: engine.descent().into(),
                version: version.as_deref().unwrap_or_default().to_owned(),
                missing: version.as_ref().err().map_or("", Outcome::reason).into(),
            });
        }
        rows
    }

    /// Puts another fault, or none, in the place of the Rust engine.
    pub fn inject(&mut self, fault: Option<&'static Fault>) {
        self.engines[0] = match fault {
            Some(fault) => Box::new(Faulty(fault)),
            None => Box::new(engine::Rust),
        };
    }

    /// Verifies, and where asked times, every case. Cases without data are skipped, visibly; a case that cannot be run costs one verdict.
    pub fn run(&mut self, cases: &[Case], mut tell: impl FnMut(Event)) -> Record {
        let mut record = Record {
            engines: self.engines(),
            ..Record::default()
        };
        for case in cases {
            match self.run_case(case, &mut record) {
                Ok(judged) => tell(Event::Judged(case, &judged)),
                Err(SessionError::Dataset { source, .. })
                    if matches!(*source, DatasetError::Absent { .. }) =>
                {
                    let why = source.to_string();
                    record.skipped.push(format!("{}: {why}", case.name));
                    tell(Event::Skipped(case, &why));
                }
                Err(error) => {
                    let judged = [refused(case, error.to_string())];
                    record.agreement.push(judged[0].row.clone());
                    tell(Event::Judged(case, &judged));
                }
            }
        }
        record
    }

    fn run_case(&mut self, case: &Case, record: &mut Record) -> Result<Vec<Judged>, SessionError> {
        let inputs = self.inputs(case)?;
        let judged = verify(case, &inputs, &mut self.engines, &self.versions);
        for one in &judged {
            record.agreement.push(one.row.clone());
            record.accuracy.extend(one.quantities.iter().cloned());
        }
        let timed = match self.options.timing {
            Timing::None => false,
            Timing::Marked => case.measure,
            Timing::All => true,
        };
        if timed {
            let agreeing = self.agreeing(case, &judged);
            let (timing, samples) = measure(case, &inputs, &mut self.engines, &agreeing);
            record.timing.extend(timing);
            record.samples.extend(samples);
        }
        if case.draw {
            record.figures.push(self.figures(case)?);
        }
        Ok(judged)
    }

    /// Places in the list of the engines that agreed.
    fn agreeing(&self, case: &Case, judged: &[Judged]) -> Vec<usize> {
        let asked = (0..self.engines.len())
            .filter(|&place| self.engines[place].stages().iter().any(|s| s == case.stage));
        asked
            .zip(judged)
            .filter(|(_, judged)| judged.row.verdict == Verdict::Agree)
            .map(|(place, _)| place)
            .collect()
    }

    /// The case's inputs: its frames, through the Rust stages before its own.
    pub fn inputs(&mut self, case: &Case) -> Result<Bundle, SessionError> {
        let wrong = |what: String| SessionError::Inputs {
            case: case.name.clone(),
            what,
        };
        let sequence = self.sequence(case)?;
        let indices = case.frames.indices(sequence.frame_count()).map_err(wrong)?;
        let files = if case.stage == "sequence.read" {
            self.files(case, &sequence, &indices)?
        } else {
            Vec::new()
        };
        let chosen = sequence
            .select(&indices)
            .map_err(|e| wrong(e.to_string()))?;
        let made = make(&case.made, chosen, &case.choice, &self.options.data);
        let chosen = made.map_err(|error| match error {
            MadeError::Dataset(source) => SessionError::Dataset {
                case: case.name.clone(),
                source: Box::new(source),
            },
            other => wrong(other.to_string()),
        })?;
        stages::inputs(case.stage, &chosen, &files, &case.choice)
            .map_err(|e: StageError| wrong(e.to_string()))
    }

    fn sequence(&mut self, case: &Case) -> Result<Sequence, SessionError> {
        if let Some((name, sequence)) = &self.last
            && *name == case.dataset
        {
            return Ok(sequence.clone());
        }
        let sequence = self
            .options
            .data
            .sequence(&case.dataset)
            .map_err(|source| SessionError::Dataset {
                case: case.name.clone(),
                source: Box::new(source),
            })?;
        self.last = Some((case.dataset.clone(), sequence.clone()));
        Ok(sequence)
    }

    /// The files behind the chosen frames; an embedded sequence is written out for readers to read.
    fn files(
        &self,
        case: &Case,
        sequence: &Sequence,
        indices: &[usize],
    ) -> Result<Vec<PathBuf>, SessionError> {
        let failed = |source| SessionError::Format {
            case: case.name.clone(),
            source: Box::new(source),
        };
        let all = if case.dataset.starts_with('@') {
            let folder = self.scratch.path().join(&case.dataset[1..]);
            if !folder.exists() {
                write(sequence, &folder).map_err(failed)?;
            }
            frame_files(&folder).map_err(failed)?
        } else {
            self.options
                .data
                .files(&case.dataset)
                .map_err(|source| SessionError::Dataset {
                    case: case.name.clone(),
                    source: Box::new(source),
                })?
        };
        let absolute = |path: &Path| std::path::absolute(path);
        indices.iter().map(|&i| Ok(absolute(&all[i])?)).collect()
    }

    fn figures(&mut self, case: &Case) -> Result<FitFigures, SessionError> {
        let wrong = |what: String| SessionError::Inputs {
            case: case.name.clone(),
            what,
        };
        let sequence = self.sequence(case)?;
        let indices = case.frames.indices(sequence.frame_count()).map_err(wrong)?;
        let chosen = sequence
            .select(&indices)
            .map_err(|e| wrong(e.to_string()))?;
        super::figures::draw(case, &chosen).map_err(|e| wrong(e.to_string()))
    }
}

fn check_names(names: &[String], engines: &[Box<dyn Engine>]) -> Result<(), SessionError> {
    for name in names {
        if !engines.iter().any(|engine| engine.name() == name) {
            let mut known: Vec<&str> = engines.iter().map(|e| e.name()).collect();
            known.sort_unstable();
            known.dedup();
            return Err(SessionError::UnknownEngine {
                name: name.clone(),
                known: known.join(", "),
            });
        }
    }
    Ok(())
}
