//! Records: what one run found, as CSV and JSON files that are read back without loss.
//!
//! | file | rows |
//! |---|---|
//! | `agreement.csv` | [`AgreementRow`]: one a case and engine |
//! | `accuracy.csv` | [`AccuracyRow`]: one a case, engine and quantity |
//! | `timing.csv` | [`TimingRow`]: one a case and engine that was timed |
//! | `raw/samples.csv` | [`SampleRow`]: every timing sample |
//! | `figures.json` | [`FitFigures`]: what the pictures of a fit are drawn from |
//! | `exhibits.json` | [`Exhibit`]: what the algorithms do, to look at; not in records from before there were any |
//! | `engines.csv` | [`EngineRow`]: each engine's receipt, or how to get it |
//! | `machine.txt`, `command.txt` | where and how it was run |
//! | `report.html` | made from the files above |

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use thiserror::Error;

use crate::exhibits::Exhibit;

/// What came of asking an engine for a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Every check holds.
    Agree,
    /// A check does not hold.
    Differ,
    /// The engine failed, crashed, or answered what is not an answer.
    Error,
    /// No answer in time.
    Timeout,
    /// The engine is not installed.
    Missing,
    /// The engine lacks the stage, or has it not for these inputs.
    Unsupported,
}

impl Verdict {
    /// Every verdict, in the order in which they are told.
    pub const ALL: [Self; 6] = [
        Self::Agree,
        Self::Differ,
        Self::Error,
        Self::Timeout,
        Self::Missing,
        Self::Unsupported,
    ];
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Agree => "agree",
            Self::Differ => "differ",
            Self::Error => "error",
            Self::Timeout => "timeout",
            Self::Missing => "missing",
            Self::Unsupported => "unsupported",
        })
    }
}

/// One engine's verdict on one case, with the check that came nearest to failing, or failed by most.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AgreementRow {
    /// Full name, such as `signal/h/gallop-small`.
    pub case: String,
    /// Such as `signal.h`.
    pub stage: String,
    /// Such as `@gallop-small` or `cow`.
    pub dataset: String,
    pub engine: String,
    /// The engine's receipt; empty where it gave none.
    pub version: String,
    pub verdict: Verdict,
    /// The quantity with the greatest value / tolerance.
    pub quantity: Option<String>,
    pub value: Option<f64>,
    pub tolerance: Option<f64>,
    /// Why the tolerance is what it is.
    pub reason: String,
    /// What an error, a timeout, a missing or unsupported engine said.
    pub message: String,
}

/// A quantity that the harness recomputed from an engine's arrays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AccuracyRow {
    pub case: String,
    pub stage: String,
    pub engine: String,
    pub quantity: String,
    pub value: f64,
    /// What it is held against; none for a quantity that is only reported.
    pub tolerance: Option<f64>,
    pub verdict: Verdict,
}

/// How long an engine took for a case; only for engines that agree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimingRow {
    pub case: String,
    pub stage: String,
    pub engine: String,
    /// Samples taken, each the mean of `batch` calls.
    pub samples: usize,
    pub batch: usize,
    pub median_seconds: f64,
    /// Median absolute deviation from the median.
    pub mad_seconds: f64,
    pub least_seconds: f64,
    /// Median over the samples of this engine's time over Rust's in the same round; 1 for Rust.
    pub ratio_to_rust: f64,
    /// The time that the paper gives, in seconds, and where.
    pub published_seconds: Option<f64>,
    pub published_source: String,
}

/// One timing sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleRow {
    pub case: String,
    pub engine: String,
    /// The round, in which every engine was timed once, in turn.
    pub round: usize,
    pub seconds: f64,
}

/// An engine and its receipt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EngineRow {
    pub engine: String,
    /// Stages it answers, separated by spaces.
    pub stages: String,
    /// What makes it independent.
    pub descent: String,
    /// Its receipt; empty where it is missing.
    pub version: String,
    /// Why it is missing and what brings it here; empty where it is not.
    pub missing: String,
}

/// What the pictures of one fit are drawn from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitFigures {
    pub case: String,
    pub dataset: String,
    /// The shape space that the signals are in; records from before there were others do not say so.
    #[serde(default = "vertex")]
    pub space: String,
    /// d, the numbers in one frame of that space.
    pub d: usize,
    /// As used: k, l, m and the number of frames.
    pub k: usize,
    pub l: usize,
    pub m: usize,
    pub frames: usize,
    /// p_1 .. p_n.
    pub positions: Vec<[f64; 2]>,
    /// f(i) at the frames.
    pub frame_points: Vec<[f64; 2]>,
    /// f densely sampled over [1, n].
    pub curve: Vec<[f64; 2]>,
    /// Control points of f.
    pub control: Vec<[f64; 2]>,
    /// Frames (0-based) that are sites of g.
    pub sites: Vec<usize>,
    /// RMS vertex distance of psi(i), decoded, from frame i over the first frame's diagonal.
    pub frame_errors: Vec<f64>,
    /// Singular values of the centred frames, decreasing.
    pub singular_values: Vec<f64>,
    /// The same over all frames against m, with k and l as they are; likewise l and k. Pairs (constant, error).
    pub error_by_m: Vec<(usize, f64)>,
    pub error_by_l: Vec<(usize, f64)>,
    pub error_by_k: Vec<(usize, f64)>,
    /// The sums (3), (4), (7), (2), in the units of the space squared.
    pub errors: [f64; 4],
}

fn vertex() -> String {
    "vertex".into()
}

/// Everything one run found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    pub agreement: Vec<AgreementRow>,
    pub accuracy: Vec<AccuracyRow>,
    pub timing: Vec<TimingRow>,
    pub samples: Vec<SampleRow>,
    pub engines: Vec<EngineRow>,
    pub figures: Vec<FitFigures>,
    pub exhibits: Vec<Exhibit>,
    /// Lines such as `skipped: no data for signal/pipeline/cow: ...`.
    pub skipped: Vec<String>,
    pub machine: String,
    pub command: String,
}

/// Why a record could not be read or written.
#[derive(Debug, Error)]
pub enum RecordError {
    /// A file that cannot be opened, read or written.
    #[error(
        "{path}: {source}; a record is a folder as `meshseq verify` or `meshseq measure` writes it"
    )]
    File {
        path: PathBuf,
        source: std::io::Error,
    },
    /// A table whose rows are not as expected.
    #[error("{path}: {source}")]
    Table { path: PathBuf, source: csv::Error },
    /// Something else than a table.
    #[error("{path}: expected a table, found text without a row; was it cut off?")]
    NoRows { path: PathBuf },
    /// Figures that are not as expected.
    #[error("{path}: {source}")]
    Json {
        path: PathBuf,
        source: serde_json::Error,
    },
}

impl Record {
    /// Writes the record's files into an existing folder.
    pub fn write(&self, folder: &Path) -> Result<(), RecordError> {
        let raw = folder.join("raw");
        std::fs::create_dir_all(&raw).map_err(|source| RecordError::File { path: raw, source })?;
        write_table(&folder.join("agreement.csv"), &self.agreement)?;
        write_table(&folder.join("accuracy.csv"), &self.accuracy)?;
        write_table(&folder.join("timing.csv"), &self.timing)?;
        write_table(&folder.join("raw/samples.csv"), &self.samples)?;
        write_table(&folder.join("engines.csv"), &self.engines)?;
        write_json(&folder.join("figures.json"), &self.figures)?;
        write_json(&folder.join("exhibits.json"), &self.exhibits)?;
        write_text(&folder.join("skipped.txt"), &self.skipped.join("\n"))?;
        write_text(&folder.join("machine.txt"), &self.machine)?;
        write_text(&folder.join("command.txt"), &self.command)
    }

    /// Reads a record back.
    pub fn read(folder: &Path) -> Result<Self, RecordError> {
        let exhibits = folder.join("exhibits.json");
        Ok(Self {
            agreement: read_table(&folder.join("agreement.csv"))?,
            accuracy: read_table(&folder.join("accuracy.csv"))?,
            timing: read_table(&folder.join("timing.csv"))?,
            samples: read_table(&folder.join("raw/samples.csv"))?,
            engines: read_table(&folder.join("engines.csv"))?,
            figures: read_json(&folder.join("figures.json"))?,
            exhibits: match exhibits.exists() {
                true => read_json(&exhibits)?,
                false => Vec::new(),
            },
            skipped: read_text(&folder.join("skipped.txt"))?
                .lines()
                .map(String::from)
                .collect(),
            machine: read_text(&folder.join("machine.txt"))?,
            command: read_text(&folder.join("command.txt"))?,
        })
    }
}

fn write_text(path: &Path, text: &str) -> Result<(), RecordError> {
    std::fs::write(path, text).map_err(|source| RecordError::File {
        path: path.to_owned(),
        source,
    })
}

fn read_text(path: &Path) -> Result<String, RecordError> {
    std::fs::read_to_string(path).map_err(|source| RecordError::File {
        path: path.to_owned(),
        source,
    })
}

fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<(), RecordError> {
    let json = serde_json::to_string(value).map_err(|source| RecordError::Json {
        path: path.to_owned(),
        source,
    })?;
    write_text(path, &json)
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, RecordError> {
    serde_json::from_str(&read_text(path)?).map_err(|source| RecordError::Json {
        path: path.to_owned(),
        source,
    })
}

fn write_table<T: Serialize>(path: &Path, rows: &[T]) -> Result<(), RecordError> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let table = |source| RecordError::Table {
        path: path.to_owned(),
        source,
    };
    for row in rows {
        writer.serialize(row).map_err(table)?;
    }
    let bytes = writer
        .into_inner()
        .map_err(|e| table(e.into_error().into()))?;
    std::fs::write(path, bytes).map_err(|source| RecordError::File {
        path: path.to_owned(),
        source,
    })
}

fn read_table<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, RecordError> {
    let text = read_text(path)?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows = reader.deserialize().collect::<Result<Vec<T>, _>>();
    let rows = rows.map_err(|source| RecordError::Table {
        path: path.to_owned(),
        source,
    })?;
    // A table without rows is written as nothing at all.
    match rows.is_empty() && !text.trim().is_empty() {
        true => Err(RecordError::NoRows {
            path: path.to_owned(),
        }),
        false => Ok(rows),
    }
}
