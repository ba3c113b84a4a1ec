//! `signal fit --window`: long sequences, a window at a time.

use std::time::Instant;

use serde_json::{Value, json};

use super::super::ratio;
use super::fitted::{Fitted, How, astray, refine_numbers, stage_times};
use super::{Allowed, FitVerb};
use crate::cmd::output::{draft_json, progress, say};
use crate::cmd::{Failure, Outcome};
use crate::mesh::measure::bounds;
use crate::sequence::Sequence;
use crate::signal::file::Stored;
use crate::signal::windows::{Plan, usual_overlap};
use crate::signal::windows_file::WindowsWriter;
use crate::signal::windows_fit::{Joined, fit_windows};

/// What the first frame of the sequence gives to all windows.
struct First {
    size: f64,
    reference: Vec<f64>,
}

pub fn run(verb: &FitVerb, window: usize, how: How) -> Outcome {
    if verb.pins.is_some() {
        return Err(
            "--pins: each window has a pose plane of its own; leave out --pins, or --window".into(),
        );
    }
    let start = Instant::now();
    let mut stream = verb.frames.stream(&verb.sequence)?;
    let mesh = stream.connectivity().clone();
    let overlap = verb.overlap.unwrap_or(usual_overlap(window));
    let plan = Plan::new(stream.frame_count(), window, overlap);
    let plan = plan.map_err(|e| format!("{}: --window {window}: {e}", verb.sequence))?;
    let writer = verb.out.as_ref();
    let writer = writer.map(|out| WindowsWriter::create(out, &plan, &mesh, how.space));
    let mut writer = writer.transpose()?;
    let mut first = None;
    let mut told = Vec::new();
    let bar = progress(plan.windows().len());
    let mut fit_window = |frames: &Sequence, j: usize| -> Result<Stored, Failure> {
        if first.is_none() {
            first = Some(First {
                size: bounds(frames.frame(0)).diagonal(),
                reference: verb.reference(frames, how.space)?,
            });
        }
        let Some(First { size, reference }) = &first else {
            return Err("no frames".into());
        };
        let allowed = Allowed {
            size: *size,
            frames: plan.share(j),
        };
        let fitted = verb.fit(frames, reference, how, Vec::new(), allowed)?;
        told.push(window_numbers(&plan, j, &fitted, *size));
        Ok(fitted.stored(frames, how.space, reference.clone()))
    };
    let named = |frames: &Sequence, j: usize| -> Result<Stored, Failure> {
        let (from, to) = (plan.windows()[j].start + 1, plan.windows()[j].end);
        let place = format!("{}: window {}, frames {from} to {to}", verb.sequence, j + 1);
        let fitted = fit_window(frames, j).map_err(|e| format!("{place}: {e}"))?;
        bar.inc(1);
        Ok(fitted)
    };
    let keep = |stored: &Stored| -> Result<(), Failure> {
        Ok(writer.as_mut().map_or(Ok(()), |w| w.add(stored))?)
    };
    let joined = fit_windows::<Failure>(&mut stream, &plan, named, keep)?;
    bar.finish_and_clear();
    let size = first.map_or(f64::NAN, |first| first.size);
    let mut numbers = numbers(&plan, &joined, mesh.vertex_count(), size, how, told);
    numbers["F"] = mesh.faces().len().into();
    numbers["elapsed_ms"] = (start.elapsed().as_secs_f64() * 1e3).into();
    // Whatever can fail comes before the first file gets its name.
    let json = verb.json.as_ref().map(|path| draft_json(path, &numbers));
    let json = json.transpose()?;
    writer.map_or(Ok(()), WindowsWriter::finish)?;
    if let Some(json) = json {
        json.keep()?;
    }
    say(&describe(&verb.sequence, &numbers));
    Ok(true)
}

/// What `--json` holds of a window.
fn window_numbers(plan: &Plan, window: usize, fitted: &Fitted, size: f64) -> Value {
    let fit = &fitted.found.fit;
    let (k, l, m) = fit.klm();
    let range = &plan.windows()[window];
    let mut numbers = json!({
        "first": range.start + 1, "last": range.end, "d": fit.representation.dimension(), "k": k, "l": l, "m": m,
        "layout_weight": fit.layout_weight,
        "error_h": fit.errors.h, "error_g": fit.errors.g, "error_f": fit.errors.f, "error_psi": fit.errors.psi,
        "rms_relative": ratio(fitted.found.rms, size),
        "stored_numbers": fit.representation.stored_numbers(),
        "astray": astray(fit, range.start),
        "time_ms": stage_times(fit),
    });
    if let Some(refined) = &fitted.refined {
        numbers["refine"] = refine_numbers(refined, size);
    }
    numbers
}

/// Everything that `--json` holds of the whole; errors are those of the joined motion.
fn numbers(
    plan: &Plan,
    joined: &Joined,
    vertices: usize,
    size: f64,
    how: How,
    windows: Vec<Value>,
) -> Value {
    let n = plan.frame_count();
    let rms = (joined.error / (n * vertices) as f64).sqrt();
    let stored = windows.iter().filter_map(|w| w["stored_numbers"].as_u64());
    let mut numbers = json!({
        "n": n, "V": vertices, "space": how.space.name(),
        "knots": how.knots.to_string(), "layout": how.layout.to_string(),
        "overlap": plan.overlap(),
        "error": joined.error, "rms_relative": ratio(rms, size),
        "kg_percent": 100.0 * ratio(joined.error.sqrt(), joined.spread.sqrt()),
        "stored_numbers": stored.sum::<u64>(),
        "windows": windows,
    });
    // In patch space each window has patches, and so a dimension, of its own.
    let windows = numbers["windows"].as_array().map_or(&[][..], Vec::as_slice);
    let d = windows.first().map(|w| w["d"].clone());
    if let Some(d) = d.filter(|d| windows.iter().all(|w| w["d"] == *d)) {
        numbers["d"] = d;
    }
    numbers
}

fn describe(name: &str, v: &Value) -> String {
    let number = |v: &Value, key: &str| v[key].as_f64().unwrap_or(f64::NAN);
    let windows = v["windows"].as_array().map_or(&[][..], Vec::as_slice);
    let astray = windows
        .iter()
        .map(|w| w["astray"].as_array().map_or(0, Vec::len));
    let mut text = format!(
        "{name}: {} space, n = {} in {} windows with {} frames in common, {} knots, {} layout\n\
         joined: squared distances of vertices {:.5}, relative RMS {:.4}%, Karni-Gotsman {:.4}%, {} numbers in h, g and f for {} given\n\
         in-betweens astray: {}; {:.0} ms",
        v["space"].as_str().unwrap_or(""),
        v["n"],
        windows.len(),
        v["overlap"],
        v["knots"].as_str().unwrap_or(""),
        v["layout"].as_str().unwrap_or(""),
        number(v, "error"),
        100.0 * number(v, "rms_relative"),
        number(v, "kg_percent"),
        v["stored_numbers"],
        3 * v["n"].as_u64().unwrap_or(0) * v["V"].as_u64().unwrap_or(0),
        astray.sum::<usize>(),
        number(v, "elapsed_ms"),
    );
    for w in windows {
        text += &format!(
            "\nframes {} to {}: k = {}, l = {}, m = {}, (2) {:.5}, relative RMS {:.4}%",
            w["first"],
            w["last"],
            w["k"],
            w["l"],
            w["m"],
            number(w, "error_psi"),
            100.0 * number(w, "rms_relative"),
        );
    }
    text
}
