//! The stages of Cashman & Hormann 2012.

use faer::{Mat, MatRef};

use super::{Call, Stage, StageError, call};
use crate::arrays::{Array, Bundle};
use crate::sequence::Sequence;
use crate::shape::{SpaceKind, encode_examples, prepare_for};
use crate::signal::f::Spline;
use crate::signal::fit::{Fit, FitOptions, fit};
use crate::signal::g::PoseSignal;
use crate::signal::h::shape_signal;
use crate::signal::insert::insert_knots;
use crate::signal::knots::{KnotRule, knots};
use crate::signal::layout::{Distances, Layout};
use crate::signal::mds::{Dissimilarities, scale};
use crate::signal::parameters::{centripetal, distinct};
use crate::signal::pins::{Pin, principal_start, validate_pins};
use crate::signal::psi::{Representation, TimeSignal};
use crate::signal::refine::rows::Rows;
use crate::signal::refine::{RefineOptions, Signals, minimise};
use crate::signal::rho::Rho;
use crate::signal::sites::site_order;
use crate::signal::transfer::{ExampleBasis, frames_of_coordinates};

/// The most steps of a refinement that is judged, and the share below which steps gain nothing.
const STEPS: usize = 2000;
const EXACT: f64 = 1e-15;
/// What a refinement without a start says.
const NOTHING: &str = "there is nothing to refine: fewer than three sites, or functions that are dependent along the curve";

/// In the order of the paper.
pub static STAGES: &[Stage] = &[
    Stage {
        name: "signal.h",
        about: "shape signal: mean, basis, coordinates (section 3.1, error (3))",
        prepare: h,
    },
    Stage {
        name: "signal.mds",
        about: "pose-space positions by scaling (section 3.2.1, stress (6))",
        prepare: mds,
    },
    Stage {
        name: "signal.mds_fixed",
        about: "pose-space positions with some of them fixed (section 3.2.1)",
        prepare: mds_fixed,
    },
    Stage {
        name: "signal.layout",
        about: "pose-space positions by scaling distances mixed with those along the motion (section 6: free of pins)",
        prepare: layout,
    },
    Stage {
        name: "signal.rbf",
        about: "pose signal: thin-plate least squares with side conditions (sections 2.2, 3.2)",
        prepare: rbf,
    },
    Stage {
        name: "signal.sites",
        about: "greedy order of the sites (section 3.2.2, error (4))",
        prepare: sites,
    },
    Stage {
        name: "signal.parameters",
        about: "centripetal parameters (section 3.3)",
        prepare: parameters,
    },
    Stage {
        name: "signal.knots",
        about: "knots of the time signal (section 3.3)",
        prepare: knot_vector,
    },
    Stage {
        name: "signal.spline",
        about: "time signal: least-squares cubic spline (sections 2.3, 3.3, error (7))",
        prepare: spline,
    },
    Stage {
        name: "signal.rho",
        about: "monotone reparametrisation (section 2.3, Fritsch & Carlson 1980)",
        prepare: rho,
    },
    Stage {
        name: "signal.psi",
        about: "the representation at any times (equation (1))",
        prepare: psi,
    },
    Stage {
        name: "signal.insert_knots",
        about: "more knots, the same curve (section 4.1)",
        prepare: more_knots,
    },
    Stage {
        name: "signal.transfer",
        about: "frames of one mesh as frames of another, by examples (section 4.3)",
        prepare: transfer,
    },
    Stage {
        name: "signal.refine",
        about: "joint refinement: (2) over f, g and h at given sites (beyond section 3)",
        prepare: refine,
    },
    Stage {
        name: "signal",
        about: "the whole reconstruction (section 3, error (2))",
        prepare: pipeline,
    },
];

fn h(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let frames = inputs.matrix("Z")?;
    let m = inputs.integer("m")?;
    call(
        move || shape_signal(frames.as_ref(), m).map_err(StageError::from_error),
        |shape| {
            let m = shape.basis.ncols();
            Bundle::from([
                ("h0", Array::vector(&shape.offset)),
                ("H", Array::columns(shape.basis.as_ref())),
                ("X", Array::columns(shape.coordinates.as_ref())),
                ("sigma", Array::vector(&shape.singular_values[..m])),
            ])
        },
    )
}

/// Forming the dissimilarities is part of the work.
fn mds(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    scaling(inputs, Vec::new())
}

fn mds_fixed(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let positions = inputs.points("positions")?;
    let fixed = inputs.indices("fixed")?.into_iter();
    let pins: Vec<Pin> = fixed
        .zip(positions)
        .map(|(frame, position)| Pin { frame, position })
        .collect();
    scaling(inputs, pins)
}

fn scaling(inputs: &Bundle, pins: Vec<Pin>) -> Result<Box<dyn Call>, StageError> {
    let x = inputs.matrix("X")?;
    let start = inputs.points("start")?;
    same_count("start", start.len(), x.ncols())?;
    validate_pins(&pins, x.ncols()).map_err(StageError::from_error)?;
    call(
        move || Ok(scale(&Dissimilarities::new(x.as_ref()), &start, &pins)),
        |positions| Bundle::from([("P", Array::points(positions))]),
    )
}

/// Forming the dissimilarities is part of the work.
fn layout(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let x = inputs.matrix("X")?;
    let weight = match inputs.vector("weight")? {
        [weight] => *weight,
        other => {
            return Err(StageError::Failed(format!(
                "`weight` has {} numbers, expected 1",
                other.len()
            )));
        }
    };
    let ordered = Layout::Ordered {
        weight: Some(weight),
    };
    ordered.check().map_err(StageError::from_error)?;
    call(
        move || {
            let distances = Distances::new(x.as_ref());
            let positions = distances.positions(x.as_ref(), weight, &[]);
            let (positions, _) = positions.map_err(StageError::from_error)?;
            Ok((distances.mixed(weight), positions))
        },
        |(delta, positions)| {
            Bundle::from([
                ("delta", Array::columns(delta.matrix())),
                ("P", Array::points(positions)),
            ])
        },
    )
}

fn same_count(name: &str, found: usize, expected: usize) -> Result<(), StageError> {
    if found == expected {
        return Ok(());
    }
    Err(StageError::Failed(format!(
        "`{name}` has {found} rows, expected {expected}, one a frame"
    )))
}

fn rbf(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let points = inputs.points("P")?;
    let x = inputs.matrix("X")?;
    let sites = inputs.indices("sites")?;
    let query = inputs.points("query")?;
    same_count("P", points.len(), x.ncols())?;
    call(
        move || {
            let pose = PoseSignal::fit(&points, x.as_ref(), &sites);
            let pose = pose.map_err(StageError::from_error)?;
            let values = [pose.evaluate(&points), pose.evaluate(&query)];
            Ok((pose, values))
        },
        |(pose, [values, query_values])| {
            Bundle::from([
                ("g", Array::columns(pose.coefficients.as_ref())),
                ("values", Array::columns(values.as_ref())),
                ("query_values", Array::columns(query_values.as_ref())),
            ])
        },
    )
}

fn sites(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let points = inputs.points("P")?;
    let x = inputs.matrix("X")?;
    let count = inputs.integer("count")?;
    same_count("P", points.len(), x.ncols())?;
    call(
        move || {
            let all = vec![true; points.len()];
            site_order(&points, x.as_ref(), count, &all).map_err(StageError::from_error)
        },
        |found| {
            Bundle::from([
                ("order", Array::indices(&found.order)),
                ("errors", Array::vector(&found.errors)),
            ])
        },
    )
}

fn parameters(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let points = inputs.points("P")?;
    call(
        move || Ok(centripetal(&points)),
        |t| Bundle::from([("t", Array::vector(t))]),
    )
}

fn knot_vector(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let t = inputs.vector("t")?.to_vec();
    let k = inputs.integer("k")?;
    let rule: KnotRule = rule(inputs)?;
    call(
        move || knots(&t, k, rule).map_err(StageError::from_error),
        |u| Bundle::from([("u", Array::vector(u))]),
    )
}

fn rule(inputs: &Bundle) -> Result<KnotRule, StageError> {
    inputs.text("rule")?.parse().map_err(StageError::from_error)
}

fn spline(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let t = inputs.vector("t")?.to_vec();
    let u = inputs.vector("u")?.to_vec();
    let points = inputs.points("P")?;
    let query = inputs.vector("query")?.to_vec();
    call(
        move || {
            let fitted = Spline::fit_with_values(&t, &points, &u);
            let (spline, values) = fitted.map_err(StageError::from_error)?;
            let query_values = spline.evaluate_all(&query);
            Ok((spline, [values, query_values]))
        },
        |(spline, [values, query_values])| {
            Bundle::from([
                ("control", Array::points(&spline.control)),
                ("values", Array::points(values)),
                ("query_values", Array::points(query_values)),
            ])
        },
    )
}

fn rho(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let t = inputs.vector("t")?.to_vec();
    let query = inputs.vector("query")?.to_vec();
    call(
        move || {
            let rho = Rho::new(&t);
            let values: Vec<f64> = query.iter().map(|&q| rho.evaluate(q)).collect();
            Ok((rho, values))
        },
        |(rho, values)| {
            Bundle::from([
                ("values", Array::vector(values)),
                ("slopes", Array::vector(rho.slopes())),
            ])
        },
    )
}

/// The representation that the arrays of `signal.psi` describe.
pub fn representation(inputs: &Bundle) -> Result<Representation, StageError> {
    let knots = inputs.vector("u")?.to_vec();
    let control = inputs.points("control")?;
    let sites = inputs.points("sites")?;
    let coefficients = inputs.matrix("g")?;
    let basis = inputs.matrix("H")?;
    let offset = inputs.vector("h0")?.to_vec();
    same_count("u", knots.len(), control.len() + 2)?;
    same_count("g", coefficients.ncols(), sites.len() + 3)?;
    same_count("h0", offset.len(), basis.nrows())?;
    same_count("H", basis.ncols(), coefficients.nrows())?;
    Ok(Representation {
        time: TimeSignal::new(Spline { control, knots }, inputs.vector("t")?.to_vec()),
        pose: PoseSignal {
            sites,
            coefficients,
        },
        offset,
        basis,
    })
}

/// The arrays of `signal.psi` that describe a representation.
pub fn representation_arrays(r: &Representation) -> Bundle {
    Bundle::from([
        ("h0", Array::vector(&r.offset)),
        ("H", Array::columns(r.basis.as_ref())),
        ("sites", Array::points(&r.pose.sites)),
        ("g", Array::columns(r.pose.coefficients.as_ref())),
        ("control", Array::points(&r.time.spline.control)),
        ("u", Array::vector(&r.time.spline.knots)),
        ("t", Array::vector(&r.time.parameters)),
    ])
}

fn psi(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let representation = representation(inputs)?;
    let times = inputs.vector("tau")?.to_vec();
    let shape = [times.len(), representation.dimension()];
    call(
        move || Ok(representation.evaluate(&times)),
        move |frames| Bundle::from([("Z", frames_array(shape, frames))]),
    )
}

fn frames_array(shape: [usize; 2], frames: &[f64]) -> Array {
    Array::F64 {
        shape: shape.to_vec(),
        data: frames.to_vec(),
    }
}

fn more_knots(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let spline = Spline {
        control: inputs.points("control")?,
        knots: inputs.vector("u")?.to_vec(),
    };
    let insert = inputs.vector("insert")?.to_vec();
    let query = inputs.vector("query")?.to_vec();
    call(
        move || {
            let refined = insert_knots(&spline, &insert).map_err(StageError::from_error)?;
            let values = refined.evaluate_all(&query);
            Ok((refined, values))
        },
        |(refined, values)| {
            Bundle::from([
                ("u", Array::vector(&refined.knots)),
                ("control", Array::points(&refined.control)),
                ("values", Array::points(values)),
            ])
        },
    )
}

fn transfer(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let frames = inputs.matrix("Z")?;
    let source = inputs.matrix("Q")?;
    let target = inputs.matrix("R")?;
    call(
        move || {
            let basis = ExampleBasis::new(source.as_ref()).map_err(StageError::from_error)?;
            let x = basis.coordinates(frames.as_ref());
            let x = x.map_err(StageError::from_error)?;
            let moved = frames_of_coordinates(x.as_ref(), target.as_ref());
            Ok((x, moved.map_err(StageError::from_error)?))
        },
        |(x, moved)| {
            Bundle::from([
                ("X", Array::columns(x.as_ref())),
                ("W", Array::columns(moved.as_ref())),
            ])
        },
    )
}

/// Frames of a sequence, m + 1 of them as examples, and those again in the gradient space, which stands for another mesh.
pub fn transfer_inputs(sequence: &Sequence, choice: &Choice) -> Result<Bundle, StageError> {
    let (n, d) = (sequence.frame_count(), sequence.dimension());
    let count = (choice.m + 1).clamp(2, n.max(2));
    let chosen: Vec<usize> = (0..count.min(n)).map(|j| j * n / count).collect();
    let examples = sequence.select(&chosen).map_err(StageError::from_error)?;
    let (mesh, poses) = (examples.connectivity(), examples.positions());
    let space = prepare_for(SpaceKind::Gradient, mesh, poses);
    let space = space.map_err(StageError::from_error)?;
    let target = encode_examples(&*space, poses).map_err(StageError::from_error)?;
    let rows = |data: &[f64]| frames_array([data.len() / d, d], data);
    Ok(Bundle::from([
        ("Z", rows(sequence.positions())),
        ("Q", rows(examples.positions())),
        ("R", Array::columns(target.as_ref())),
    ]))
}

fn refine(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let rows = Rows {
        targets: inputs.columns("Y")?.transpose().to_owned(),
        parameters: inputs.vector("t")?.to_vec(),
        weights: inputs.vector("w")?.to_vec(),
    };
    let spline = Spline {
        control: inputs.points("control")?,
        knots: inputs.vector("u")?.to_vec(),
    };
    let sites = inputs.points("sites")?;
    let m = inputs.columns("H")?.ncols();
    same_count("t", rows.parameters.len(), rows.targets.nrows())?;
    same_count("w", rows.weights.len(), rows.targets.nrows())?;
    let options = RefineOptions {
        iterations: inputs.integer("iterations")?,
        tolerance: EXACT,
        hold_sites: true,
        ..RefineOptions::default()
    };
    call(
        move || {
            let found = minimise(&rows, &spline, &sites, m, &options);
            found.ok_or_else(|| StageError::Failed(NOTHING.into()))
        },
        |found| {
            let mut outputs = signal_arrays(&found.signals);
            outputs.put("error", Array::vector(&[found.error]));
            outputs
        },
    )
}

fn signal_arrays(s: &Signals) -> Bundle {
    Bundle::from([
        ("h0", Array::vector(&s.offset)),
        ("H", Array::columns(s.basis.as_ref())),
        ("sites", Array::points(&s.pose.sites)),
        ("g", Array::columns(s.pose.coefficients.as_ref())),
        ("control", Array::points(&s.spline.control)),
    ])
}

fn pipeline(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let frames: Mat<f64> = inputs.matrix("Z")?;
    let [k, l, m] = ["k", "l", "m"].map(|name| inputs.integer(name));
    let options = FitOptions {
        knots: rule(inputs)?,
        layout: Layout::Mds,
        ..FitOptions::new(k?, l?, m?)
    };
    let n = frames.ncols();
    call(
        move || fit(frames.as_ref(), &options).map_err(StageError::from_error),
        move |fit| {
            let e = fit.errors;
            let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
            let frames = fit.representation.evaluate(&times);
            let d = fit.representation.dimension();
            Bundle::from([
                ("errors", Array::vector(&[e.h, e.g, e.f, e.psi])),
                ("Z", frames_array([n, d], &frames)),
                ("P", Array::points(&fit.positions)),
                ("order", Array::indices(&fit.sites.order)),
            ])
        },
    )
}

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
        "signal.refine" => chain.refinement(frames),
        _ => chain.inputs(stage),
    }
}

/// psi(i) for every frame i of the fit: n times d numbers.
pub fn at_frames(frames: MatRef<'_, f64>, choice: &Choice) -> Result<Vec<f64>, StageError> {
    let fit = choice.fit(frames)?;
    let times: Vec<f64> = (1..=frames.ncols()).map(|i| i as f64).collect();
    Ok(fit.representation.evaluate(&times))
}

/// k, l, m, the knot rule, how many frames are pinned where a stage has pins, and the space that the signals are fitted in.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    pub k: usize,
    pub l: usize,
    pub m: usize,
    pub knots: KnotRule,
    pub pins: usize,
    pub space: SpaceKind,
    /// Whether a decode stage is given means of neighbouring frames too, which poses that no motion joins have none of.
    pub means: bool,
}

/// The reconstruction, from which the inputs of its stages are taken.
struct Chain<'a> {
    fit: Fit,
    start: Vec<[f64; 2]>,
    choice: &'a Choice,
    times: Vec<f64>,
}

impl Choice {
    /// The whole reconstruction with these constants.
    pub fn fit(&self, frames: MatRef<'_, f64>) -> Result<Fit, StageError> {
        let options = FitOptions {
            knots: self.knots,
            layout: Layout::Mds,
            ..FitOptions::new(self.k, self.l, self.m)
        };
        fit(frames, &options).map_err(StageError::from_error)
    }
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

    /// A fit in the coordinates of all principal components of the frames, refined already with its sites held, but not to the end: the error has
    /// several minima, and the one that two engines find must be the same.
    fn refinement(&self, frames: MatRef<'_, f64>) -> Result<Bundle, StageError> {
        let whole = shape_signal(frames, frames.ncols().saturating_sub(1))
            .map_err(StageError::from_error)?;
        let psi = &self.fit.representation;
        let between = RefineOptions::default().between;
        let rows = Rows::of_frames(whole.coordinates.as_ref(), &psi.time.parameters, between);
        let options = RefineOptions {
            hold_sites: true,
            ..RefineOptions::default()
        };
        let (spline, sites) = (&psi.time.spline, &psi.pose.sites);
        let near = minimise(&rows, spline, sites, self.choice.m, &options);
        let near = near
            .ok_or_else(|| StageError::Failed(NOTHING.into()))?
            .signals;
        let mut inputs = signal_arrays(&near);
        inputs.put("u", Array::vector(&near.spline.knots));
        inputs.put("Y", Array::columns(rows.targets.transpose()));
        inputs.put("t", Array::vector(&rows.parameters));
        inputs.put("w", Array::vector(&rows.weights));
        inputs.put("iterations", Array::integer(STEPS));
        Ok(inputs)
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
