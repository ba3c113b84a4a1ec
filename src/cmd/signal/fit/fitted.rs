//! A fit, and what is told of it.

use std::time::Duration;

use serde_json::json;

use super::super::ratio;
use crate::mesh::measure::bounds;
use crate::sequence::Sequence;
use crate::shape::{Convergence, SpaceKind};
use crate::signal::file::Stored;
use crate::signal::fit::Fit;
use crate::signal::in_space::SpaceFit;
use crate::signal::knots::KnotRule;
use crate::signal::layout::Layout;
use crate::signal::refine::Refinement;
use crate::signal::saddles::{Place, places};
use crate::signal::windows_fit::frame_spread;

/// How to fit, whatever to.
#[derive(Clone, Copy)]
pub struct How {
    pub knots: KnotRule,
    pub space: SpaceKind,
    pub layout: Layout,
}

/// A sequence or a window of one, fitted in some space.
pub struct Fitted {
    pub found: SpaceFit,
    pub refined: Option<Refined>,
    pub patches: Vec<i64>,
}

/// What refinement did.
pub struct Refined {
    pub told: Refinement,
    /// The RMS distance of vertices before, where a single fit was refined.
    pub rms_before: Option<f64>,
}

impl Fitted {
    pub fn stored(self, sequence: &Sequence, space: SpaceKind, reference: Vec<f64>) -> Stored {
        Stored {
            representation: self.found.fit.representation,
            positions: self.found.fit.positions,
            connectivity: sequence.connectivity().clone(),
            space,
            reference,
            patches: self.patches,
        }
    }
}

/// What `--json` holds of a refinement; `size` is what distances are relative to.
pub fn refine_numbers(refined: &Refined, size: f64) -> serde_json::Value {
    let told = &refined.told;
    let mut numbers = json!({
        "error_psi_before": told.before, "error_psi": told.after, "iterations": told.iterations,
        "gradient": told.gradient, "between": told.between, "time_ms": told.elapsed.as_secs_f64() * 1e3,
    });
    if let Some(rms) = refined.rms_before {
        numbers["rms_relative_before"] = ratio(rms, size).into();
    }
    numbers
}

/// Everything that `--json` holds.
pub fn numbers(sequence: &Sequence, fitted: &Fitted, how: How) -> serde_json::Value {
    let found = &fitted.found;
    let fit = &found.fit;
    let size = bounds(sequence.frame(0)).diagonal();
    let (k, l, m) = fit.klm();
    let (n, vertices) = (
        sequence.frame_count(),
        sequence.connectivity().vertex_count(),
    );
    let distance = found.rms * ((n * vertices) as f64).sqrt();
    let mut numbers = json!({
        "n": n, "d": fit.representation.dimension(), "k": k, "l": l, "m": m,
        "V": vertices, "F": sequence.connectivity().faces().len(),
        "space": how.space.name(), "knots": how.knots.to_string(),
        "layout": how.layout.to_string(), "layout_weight": fit.layout_weight,
        "error_h": fit.errors.h, "error_g": fit.errors.g, "error_f": fit.errors.f, "error_psi": fit.errors.psi,
        "rms_relative": ratio(found.rms, size),
        "kg_percent": 100.0 * ratio(distance, spread(sequence)),
        "stored_numbers": fit.representation.stored_numbers(),
        "mds_steps": {"majorising": fit.steps.majorising, "newton": fit.steps.newton, "inner": fit.steps.inner},
        "same_pose": fit.same_pose,
        "astray": astray(fit, 0),
        "time_ms": stage_times(fit),
    });
    if how.space != SpaceKind::Vertex {
        numbers["time_ms"]["decode"] = milliseconds(found.decoding).into();
    }
    let Convergence {
        frames,
        unsettled,
        imbalance,
    } = found.convergence;
    if frames > 0 {
        numbers["descent"] =
            json!({"frames": frames, "unsettled": unsettled, "imbalance": imbalance});
    }
    match &fitted.refined {
        Some(refined) => numbers["refine"] = refine_numbers(refined, size),
        // Refinement moves sites off the frames; `signal info --json` tells where they are.
        None => {
            let frames: Vec<usize> = fit.sites.order.iter().map(|i| i + 1).collect();
            numbers["sites"] = frames.into();
        }
    }
    numbers
}

/// Milliseconds of each stage.
pub fn stage_times(fit: &Fit) -> serde_json::Value {
    let (ms, t) = (milliseconds, fit.timings);
    json!({"h": ms(t.h), "mds": ms(t.mds), "rbf": ms(t.rbf), "g": ms(t.g), "f": ms(t.f)})
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// The in-betweens that go astray, in frame times of the sequence in which `before` frames come before those of the fit.
pub fn astray(fit: &Fit, before: usize) -> Vec<serde_json::Value> {
    let places = places(fit).into_iter().filter(Place::is_astray);
    let time = |p: &Place| p.time + before as f64;
    places
        .map(|p| json!({"time": time(&p), "stray": p.stray, "curvature": p.curvature}))
        .collect()
}

/// Rounding of a relative error, as a share of it and as such.
const ROUNDING: [f64; 2] = [1e-6, 1e-12];
pub const MISSED: &str = "the tolerance is not met: this is as near as signals through every frame come. Pins that hold frames in one place keep them from it, \
                      and so do frames that do not come back from the shape space";

/// Whether a fit is farther off than was allowed.
pub fn missed(numbers: &serde_json::Value, tolerance: f64) -> bool {
    let found = numbers["rms_relative"].as_f64().unwrap_or(f64::NAN);
    found.is_nan() || found > tolerance * (1.0 + ROUNDING[0]) + ROUNDING[1]
}

/// ||A - E(A)|| of Karni & Gotsman 2004: E(A) puts every vertex at the mean vertex of its frame.
fn spread(sequence: &Sequence) -> f64 {
    let frames = sequence.positions().chunks(sequence.dimension());
    frames.map(frame_spread).sum::<f64>().sqrt()
}

pub fn describe(name: &str, v: &serde_json::Value) -> String {
    let number = |key: &str| v[key].as_f64().unwrap_or(f64::NAN);
    let t = |key: &str| v["time_ms"][key].as_f64().unwrap_or(f64::NAN);
    let refined = v.get("refine").map_or(String::new(), |r| {
        let number = |key: &str| r[key].as_f64().unwrap_or(f64::NAN);
        let rms = r["rms_relative_before"].as_f64();
        let rms = rms.map(|rms| format!(", relative RMS from {:.4}%", 100.0 * rms));
        format!(
            "\nrefined: (2) from {:.5}{} in {} steps and {:.0} ms",
            number("error_psi_before"),
            rms.unwrap_or_default(),
            r["iterations"],
            number("time_ms")
        )
    });
    let decode = v["time_ms"]
        .get("decode")
        .and_then(serde_json::Value::as_f64);
    let decode = decode.map_or(String::new(), |ms| format!(", decoding all frames {ms:.3}"));
    let descent = v.get("descent").map_or(String::new(), |d| {
        let imbalance = d["imbalance"].as_f64().unwrap_or(f64::NAN);
        format!(
            "\ndecoded by descent: {} of {} frames come to a stationary one, the worst is off by a cosine of {imbalance:.1e}",
            d["frames"].as_u64().unwrap_or(0) - d["unsettled"].as_u64().unwrap_or(0),
            d["frames"],
        )
    });
    format!(
        "{name}: {} space, n = {}, k = {}, l = {}, m = {}, {} knots, {} layout (weight {})\n\
         errors: (3) {:.5}, (4) {:.5}, (7) {:.5}, (2) {:.5}\n\
         {}\n\
         relative RMS {:.4}%, Karni-Gotsman {:.4}%, {} numbers in h, g and f for {} given\n\
         ms: h {:.3}, mds {:.3} ({} majorising steps, {} of Newton), rbf {:.3}, g {:.3}, f {:.3}{decode}{refined}{descent}",
        v["space"].as_str().unwrap_or(""),
        v["n"],
        v["k"],
        v["l"],
        v["m"],
        v["knots"].as_str().unwrap_or(""),
        v["layout"].as_str().unwrap_or(""),
        v["layout_weight"],
        number("error_h"),
        number("error_g"),
        number("error_f"),
        number("error_psi"),
        astray_line(&v["astray"]),
        100.0 * number("rms_relative"),
        number("kg_percent"),
        v["stored_numbers"],
        3 * v["n"].as_u64().unwrap_or(0) * v["V"].as_u64().unwrap_or(0),
        t("h"),
        t("mds"),
        v["mds_steps"]["majorising"],
        v["mds_steps"]["newton"],
        t("rbf"),
        t("g"),
        t("f"),
    )
}

/// How many in-betweens go astray, and which the most.
fn astray_line(places: &serde_json::Value) -> String {
    let stray = |p: &serde_json::Value| p["stray"].as_f64().unwrap_or(0.0);
    let places = places.as_array().map_or(&[][..], Vec::as_slice);
    let farther = |a, b| if stray(b) > stray(a) { b } else { a };
    match places.iter().reduce(farther) {
        Some(worst) => format!(
            "in-betweens astray: {}, the farthest at t = {}, {:.2} steps off",
            places.len(),
            worst["time"],
            stray(worst)
        ),
        None => "in-betweens astray: none".into(),
    }
}
