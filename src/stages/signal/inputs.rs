//! Inputs of the stages, each made by the Rust stages before it, so that errors do not pile up.

use faer::MatRef;

use super::super::StageError;
use super::psi::representation_arrays;
use super::{Choice, refine};
use crate::arrays::{Array, Bundle};
use crate::signal::fit::Fit;
use crate::signal::parameters::distinct;
use crate::signal::pins::principal_start;
use crate::signal::rho::Rho;

/// Inputs of every stage made from frames (d x n, of the choice's space) by the Rust stages before it, so that errors do not pile up.
pub fn inputs(stage: &str, frames: MatRef<'_, f64>, choice: &Choice) -> Result<Bundle, StageError> {
    let z = Array::columns(frames);
    let [k, l, m] = [choice.k, choice.l, choice.m].map(Array::integer);
    if stage == "signal.h" {
        return Ok(Bundle::from([("Z", z), ("m", m)]));
    }
    if stage == "signal" {
        let rule = Array::Text(choice.knots.to_string());
        return Ok(Bundle::from([
            ("Z", z),
            ("k", k),
            ("l", l),
            ("m", m),
            ("rule", rule),
            ("space", Array::Text(choice.space.to_string())),
        ]));
    }
    let chain = Chain::new(frames, choice)?;
    match stage {
        "signal.refine" => refine::inputs(frames, &chain.fit.representation, choice.m),
        _ => chain.inputs(stage),
    }
}

/// psi(i) for every frame i of the fit: n times d numbers.
pub fn at_frames(frames: MatRef<'_, f64>, choice: &Choice) -> Result<Vec<f64>, StageError> {
    let fit = choice.fit(frames)?;
    let times: Vec<f64> = (1..=frames.ncols()).map(|i| i as f64).collect();
    Ok(fit.representation.evaluate(&times))
}

/// The reconstruction, from which the inputs of its stages are taken.
struct Chain<'a> {
    fit: Fit,
    start: Vec<[f64; 2]>,
    choice: &'a Choice,
    times: Vec<f64>,
}

impl<'a> Chain<'a> {
    fn new(frames: MatRef<'_, f64>, choice: &'a Choice) -> Result<Self, StageError> {
        let fit = choice.fit(frames)?;
        Ok(Self {
            start: principal_start(fit.coordinates.as_ref(), &[]),
            times: between_frames(frames.ncols()),
            fit,
            choice,
        })
    }

    fn inputs(&self, stage: &str) -> Result<Bundle, StageError> {
        let time = &self.fit.representation.time;
        let x = || ("X", Array::columns(self.fit.coordinates.as_ref()));
        let p = || ("P", Array::points(&self.fit.positions));
        let t = || ("t", Array::vector(&time.parameters));
        Ok(match stage {
            "signal.mds" => Bundle::from([x(), ("start", Array::points(&self.start))]),
            "signal.mds_fixed" => self.pinned(),
            "signal.layout" => Bundle::from([x(), ("weight", Array::vector(&[LAYOUT_WEIGHT]))]),
            "signal.rbf" => Bundle::from([
                x(),
                p(),
                ("sites", Array::indices(&self.fit.sites.order)),
                ("query", Array::points(&self.curve())),
            ]),
            "signal.sites" => {
                let frames = self.fit.positions.len();
                Bundle::from([x(), p(), ("count", Array::integer(frames))])
            }
            "signal.parameters" => Bundle::from([p()]),
            "signal.knots" => Bundle::from([
                ("t", Array::vector(&distinct(&time.parameters))),
                ("k", Array::integer(time.spline.control.len())),
                ("rule", Array::Text(self.choice.knots.to_string())),
            ]),
            "signal.spline" => Bundle::from([
                t(),
                p(),
                ("u", Array::vector(&time.spline.knots)),
                ("query", Array::vector(&self.parameters())),
            ]),
            "signal.insert_knots" => Bundle::from([
                ("control", Array::points(&time.spline.control)),
                ("u", Array::vector(&time.spline.knots)),
                ("insert", Array::vector(&self.new_knots())),
                ("query", Array::vector(&self.parameters())),
            ]),
            "signal.rho" => Bundle::from([t(), ("query", Array::vector(&self.times))]),
            "signal.psi" => {
                let mut inputs = representation_arrays(&self.fit.representation);
                inputs.put("tau", Array::vector(&self.times));
                inputs
            }
            _ => {
                return Err(StageError::Failed(format!(
                    "there is no stage `{stage}` in signal"
                )));
            }
        })
    }

    /// The first frames pinned a little away from where scaling would put them.
    fn pinned(&self) -> Bundle {
        let n = self.start.len();
        let count = self.choice.pins.min(n);
        let fixed: Vec<usize> = (0..count).map(|i| i * n / count).collect();
        let mut start = self.start.clone();
        for &i in &fixed {
            start[i] = [
                1.1 * self.fit.positions[i][0],
                0.9 * self.fit.positions[i][1],
            ];
        }
        let positions: Vec<[f64; 2]> = fixed.iter().map(|&i| start[i]).collect();
        Bundle::from([
            ("X", Array::columns(self.fit.coordinates.as_ref())),
            ("start", Array::points(&start)),
            ("fixed", Array::indices(&fixed)),
            ("positions", Array::points(&positions)),
        ])
    }

    /// Parameters midway between some frames, one of them twice, and a knot that is there already.
    fn new_knots(&self) -> Vec<f64> {
        let time = &self.fit.representation.time;
        let (t, u) = (distinct(&time.parameters), &time.spline.knots);
        let step = (t.len() / 6).max(1);
        let mut new: Vec<f64> = t
            .windows(2)
            .step_by(step)
            .map(|w| 0.5 * (w[0] + w[1]))
            .collect();
        new.reverse();
        new.extend(new.first().copied());
        let inner = u
            .iter()
            .find(|&&x| x > t[0] && x < t[t.len() - 1] && !new.contains(&x));
        new.extend(inner);
        new
    }

    fn parameters(&self) -> Vec<f64> {
        let rho = Rho::new(&self.fit.representation.time.parameters);
        self.times.iter().map(|&t| rho.evaluate(t)).collect()
    }

    fn curve(&self) -> Vec<[f64; 2]> {
        let time = &self.fit.representation.time;
        self.times.iter().map(|&t| time.evaluate(t)).collect()
    }
}

/// A weight at which both kinds of distances matter.
const LAYOUT_WEIGHT: f64 = 0.5;

/// Frame times and times between them: 1, 1.3, 2, 2.3, ...; at most 64 pairs, spread evenly.
fn between_frames(n: usize) -> Vec<f64> {
    let step = n.div_ceil(64).max(1);
    (1..=n)
        .step_by(step)
        .flat_map(|i| [i as f64, (i as f64 + 0.3).min(n as f64)])
        .collect()
}
