//! The registry of oracles, `oracles/oracles.toml`.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;

/// An oracle program: which engine it is, and how it is started.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
#[serde(deny_unknown_fields)]
pub struct Oracle {
    pub engine: String,
    /// Stages it may be asked.
    pub stages: Vec<String>,
    /// Program and arguments, places filled in.
    pub command: Vec<String>,
    /// What makes it independent.
    pub descent: String,
    /// What brings it here.
    pub install: String,
    /// Threads of its linear algebra.
    #[serde(default = "one")]
    pub threads: usize,
    /// How long it may take to start and give its receipt.
    #[serde(default = "a_minute")]
    pub start_seconds: u64,
    /// Where it is started.
    #[serde(skip)]
    pub folder: PathBuf,
}

fn one() -> usize {
    1
}

fn a_minute() -> u64 {
    60
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Registry {
    #[serde(default)]
    oracle: Vec<Oracle>,
}

/// Why there is no registry.
#[derive(Debug, Error)]
pub enum RegistryError {
    /// The file cannot be read.
    #[error(
        "{path}: {source}; set MESHSEQ_HOME to a checkout of meshseq, which has oracles/oracles.toml"
    )]
    File {
        path: PathBuf,
        source: std::io::Error,
    },
    /// The file is not as expected.
    #[error("{path}: {source}")]
    Toml {
        path: PathBuf,
        source: Box<toml::de::Error>,
    },
    /// An entry with nothing to start.
    #[error("{path}: oracle `{engine}` has an empty command or no stages")]
    Empty { path: PathBuf, engine: String },
}

/// Reads the registry of the checkout at `home`; `{python}` and `{build}` become places under `target/oracles`.
pub fn read(home: &Path) -> Result<Vec<Oracle>, RegistryError> {
    let folder = home.join("oracles");
    let path = folder.join("oracles.toml");
    let text = std::fs::read_to_string(&path).map_err(|source| RegistryError::File {
        path: path.clone(),
        source,
    })?;
    let registry: Registry = toml::from_str(&text).map_err(|source| RegistryError::Toml {
        path: path.clone(),
        source: Box::new(source),
    })?;
    let mut oracles = registry.oracle;
    for oracle in &mut oracles {
        if oracle.command.is_empty() || oracle.stages.is_empty() {
            let engine = oracle.engine.clone();
            return Err(RegistryError::Empty { path, engine });
        }
        for part in &mut oracle.command {
            *part = fill(part, home);
        }
        oracle.folder.clone_from(&folder);
    }
    Ok(oracles)
}

fn fill(part: &str, home: &Path) -> String {
    let built = home.join("target/oracles");
    part.replace("{python}", &built.join("venv/bin/python").to_string_lossy())
        .replace("{build}", &built.join("cpp").to_string_lossy())
}
