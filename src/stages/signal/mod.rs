//! The stages of Cashman & Hormann 2012, a file for each section of the paper.

mod applications;
mod inputs;
mod pose;
mod psi;
mod refine;
mod shape;
mod time;

use faer::MatRef;

use super::{Stage, StageError};
use crate::arrays::{Array, Bundle};
use crate::shape::SpaceKind;
use crate::signal::f::Spline;
use crate::signal::fit::{Fit, FitOptions, fit};
use crate::signal::g::PoseSignal;
use crate::signal::knots::KnotRule;
use crate::signal::layout::Layout;
pub use applications::transfer_inputs;
pub use inputs::{at_frames, inputs};

/// In the order of the paper.
pub static STAGES: &[Stage] = &[
    Stage {
        name: "signal.h",
        about: "shape signal: mean, basis, coordinates (section 3.1, error (3))",
        prepare: shape::h,
    },
    Stage {
        name: "signal.mds",
        about: "pose-space positions by scaling (section 3.2.1, stress (6))",
        prepare: pose::mds,
    },
    Stage {
        name: "signal.mds_fixed",
        about: "pose-space positions with some of them fixed (section 3.2.1)",
        prepare: pose::mds_fixed,
    },
    Stage {
        name: "signal.layout",
        about: "pose-space positions by scaling distances mixed with those along the motion (section 6: free of pins)",
        prepare: pose::layout,
    },
    Stage {
        name: "signal.rbf",
        about: "pose signal: thin-plate least squares with side conditions (sections 2.2, 3.2)",
        prepare: pose::rbf,
    },
    Stage {
        name: "signal.sites",
        about: "greedy order of the sites (section 3.2.2, error (4))",
        prepare: pose::sites,
    },
    Stage {
        name: "signal.parameters",
        about: "centripetal parameters (section 3.3)",
        prepare: time::parameters,
    },
    Stage {
        name: "signal.knots",
        about: "knots of the time signal (section 3.3)",
        prepare: time::knot_vector,
    },
    Stage {
        name: "signal.spline",
        about: "time signal: least-squares cubic spline (sections 2.3, 3.3, error (7))",
        prepare: time::spline,
    },
    Stage {
        name: "signal.rho",
        about: "monotone reparametrisation (section 2.3, Fritsch & Carlson 1980)",
        prepare: time::rho,
    },
    Stage {
        name: "signal.psi",
        about: "the representation at any times (equation (1))",
        prepare: psi::psi,
    },
    Stage {
        name: "signal.insert_knots",
        about: "more knots, the same curve (section 4.1)",
        prepare: applications::more_knots,
    },
    Stage {
        name: "signal.transfer",
        about: "frames of one mesh as frames of another, by examples (section 4.3)",
        prepare: applications::transfer,
    },
    Stage {
        name: "signal.refine",
        about: "joint refinement: (2) over f, g and h at given sites (beyond section 3)",
        prepare: refine::refine,
    },
    Stage {
        name: "signal",
        about: "the whole reconstruction (section 3, error (2))",
        prepare: psi::pipeline,
    },
];

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

/// k, l and m, and what the paper says of the rest.
fn options_of_the_paper([k, l, m]: [usize; 3], knots: KnotRule) -> FitOptions {
    FitOptions {
        knots,
        layout: Layout::Mds,
        ..FitOptions::new(k, l, m)
    }
}

impl Choice {
    /// The paper's reconstruction with these constants.
    pub fn options(&self) -> FitOptions {
        options_of_the_paper([self.k, self.l, self.m], self.knots)
    }

    /// See [`Self::options`].
    pub fn fit(&self, frames: MatRef<'_, f64>) -> Result<Fit, StageError> {
        fit(frames, &self.options()).map_err(StageError::from_error)
    }
}

/// What describes h, g and f in every stage that has them.
fn signal_arrays(
    offset: &[f64],
    basis: MatRef<'_, f64>,
    pose: &PoseSignal,
    spline: &Spline,
) -> Bundle {
    Bundle::from([
        ("h0", Array::vector(offset)),
        ("H", Array::columns(basis)),
        ("sites", Array::points(&pose.sites)),
        ("g", Array::columns(pose.coefficients.as_ref())),
        ("control", Array::points(&spline.control)),
    ])
}

fn rule(inputs: &Bundle) -> Result<KnotRule, StageError> {
    inputs.text("rule")?.parse().map_err(StageError::from_error)
}

fn same_count(name: &str, found: usize, expected: usize) -> Result<(), StageError> {
    if found == expected {
        return Ok(());
    }
    Err(StageError::Failed(format!(
        "`{name}` has {found} rows, expected {expected}, one a frame"
    )))
}

fn frames_array(shape: [usize; 2], frames: &[f64]) -> Array {
    Array::F64 {
        shape: shape.to_vec(),
        data: frames.to_vec(),
    }
}
