//! Verification: every engine on the same input, every quantity recomputed, a verdict for each.

use std::collections::BTreeMap;

use super::case::Case;
use super::engine::{Engine, Outcome, Question};
use super::judge::{self, Measured};
use super::record::{AccuracyRow, AgreementRow, Verdict};
use super::tolerance::Tolerance;
use crate::arrays::Bundle;
use crate::stages::{self, Stage};

/// What one engine made of one case.
pub struct Judged {
    pub row: AgreementRow,
    pub quantities: Vec<AccuracyRow>,
}

/// Asks every engine that has the stage, Rust first, and judges the answers.
///
/// `versions` holds the receipts of the engines, by place in the list; an engine without one is not asked.
pub fn verify(
    case: &Case,
    inputs: &Bundle,
    engines: &mut [Box<dyn Engine>],
    versions: &[Result<String, Outcome>],
) -> Vec<Judged> {
    let Some(stage) = stages::find(case.stage) else {
        return Vec::new();
    };
    let mut ours = None;
    let mut judged = Vec::new();
    for (engine, version) in engines.iter_mut().zip(versions) {
        if !engine.stages().iter().any(|name| name == case.stage) {
            continue;
        }
        let outcome = match version {
            Ok(_) => engine.ask(&question(case, stage, inputs)),
            Err(outcome) => outcome.clone(),
        };
        let receipt = version.as_deref().unwrap_or_default().to_owned();
        let result = judge_one(case, engine.name(), receipt, inputs, outcome, &mut ours);
        judged.push(result);
    }
    judged
}

fn question<'a>(case: &Case, stage: &'static Stage, inputs: &'a Bundle) -> Question<'a> {
    Question {
        stage,
        inputs,
        samples: 1,
        batch: 1,
        timeout: case.timeout,
    }
}

fn judge_one(
    case: &Case,
    engine: &str,
    version: String,
    inputs: &Bundle,
    outcome: Outcome,
    ours: &mut Option<Bundle>,
) -> Judged {
    let (verdict, message) = match outcome {
        Outcome::Answer { outputs, .. } => {
            let found = measured(case, engine, inputs, &outputs, ours.as_ref());
            if engine == "rust" {
                *ours = Some(outputs);
            }
            match found {
                Ok(measured) => return settle(case, engine, version, measured, ours.is_some()),
                Err(what) => (Verdict::Error, what),
            }
        }
        Outcome::Unsupported(what) => (Verdict::Unsupported, what),
        Outcome::Error(what) => (Verdict::Error, what),
        Outcome::Timeout(what) => (Verdict::Timeout, what),
        Outcome::Missing(what) => (Verdict::Missing, what),
    };
    Judged {
        row: row(case, engine, version, verdict, message),
        quantities: Vec::new(),
    }
}

fn measured(
    case: &Case,
    engine: &str,
    inputs: &Bundle,
    outputs: &Bundle,
    ours: Option<&Bundle>,
) -> Result<Vec<Measured>, String> {
    let mut found = judge::own(case.stage, inputs, outputs).map_err(|e| e.to_string())?;
    if let (Some(ours), true) = (ours, engine != "rust") {
        let differences = judge::against(case.stage, inputs, ours, outputs);
        found.extend(differences.map_err(|e| e.to_string())?);
    }
    Ok(found)
}

/// A case whose inputs cannot be made.
pub fn refused(case: &Case, message: String) -> Judged {
    Judged {
        row: row(case, "rust", String::new(), Verdict::Error, message),
        quantities: Vec::new(),
    }
}

fn row(
    case: &Case,
    engine: &str,
    version: String,
    verdict: Verdict,
    message: String,
) -> AgreementRow {
    AgreementRow {
        case: case.name.clone(),
        stage: case.stage.into(),
        dataset: case.dataset.clone(),
        engine: engine.into(),
        version,
        verdict,
        quantity: None,
        value: None,
        tolerance: None,
        reason: String::new(),
        message,
    }
}

/// One quantity held against its tolerance.
struct Held {
    quantity: String,
    value: f64,
    tolerance: Option<Tolerance>,
}

impl Held {
    /// Value over tolerance: above 1 is a failure, and so is NaN.
    fn load(&self) -> f64 {
        match &self.tolerance {
            None => 0.0,
            Some(_) if self.value == 0.0 => 0.0,
            Some(t) if self.value.is_finite() => self.value / t.value,
            Some(_) => f64::INFINITY,
        }
    }
}

fn settle(
    case: &Case,
    engine: &str,
    version: String,
    measured: Vec<Measured>,
    compared: bool,
) -> Judged {
    let values: BTreeMap<&str, f64> = measured.iter().copied().collect();
    let mut held: Vec<Held> = measured
        .iter()
        .map(|&(quantity, value)| Held {
            quantity: quantity.into(),
            value,
            tolerance: case.tolerance(quantity, engine),
        })
        .collect();
    if engine == "rust" {
        held.extend(case.expect.iter().map(|(quantity, printed)| {
            Held {
                quantity: format!("{quantity} expected {}", printed.value),
                value: values
                    .get(quantity.as_str())
                    .map_or(f64::NAN, |v| (v - printed.value).abs()),
                tolerance: Some(Tolerance {
                    value: printed.half_unit * (1.0 + 1e-9),
                    reason: "half a unit of the last digit of the number on record".into(),
                }),
            }
        }));
    }
    let mut row = row(case, engine, version, Verdict::Agree, String::new());
    if !compared {
        row.message = "Rust gave no answer to compare with".into();
    }
    let checked = held.iter().filter(|h| h.tolerance.is_some());
    if let Some(worst) = checked.max_by(|a, b| a.load().total_cmp(&b.load())) {
        row.quantity = Some(worst.quantity.clone());
        row.value = Some(worst.value);
        row.tolerance = worst.tolerance.as_ref().map(|t| t.value);
        row.reason = worst
            .tolerance
            .as_ref()
            .map(|t| t.reason.clone())
            .unwrap_or_default();
        if worst.load() > 1.0 || worst.value.is_nan() {
            row.verdict = Verdict::Differ;
        }
    }
    let quantities = held
        .iter()
        .map(|h| AccuracyRow {
            case: case.name.clone(),
            stage: case.stage.into(),
            engine: engine.into(),
            quantity: h.quantity.clone(),
            value: h.value,
            tolerance: h.tolerance.as_ref().map(|t| t.value),
            verdict: if h.load() > 1.0 {
                Verdict::Differ
            } else {
                Verdict::Agree
            },
        })
        .collect();
    Judged { row, quantities }
}
