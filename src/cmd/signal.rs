//! The verbs of `signal`, each in a file of its own.

mod design;
mod edit;
mod fit;
mod info;
mod leave_out;
mod result;
mod sample;
mod tables;
mod transfer;

use std::path::Path;

use clap::Subcommand;

use super::{Failure, Outcome};

#[derive(Subcommand)]
pub enum Signal {
    /// Fit time, pose and shape signals to a sequence
    #[command(after_help = fit::EXAMPLES)]
    Fit(fit::FitVerb),
    /// What a representation is: frames, mesh, space, and k, l and m of every window
    #[command(after_help = info::EXAMPLES)]
    Info(info::InfoVerb),
    /// Fit every second frame and predict the others
    #[command(after_help = leave_out::EXAMPLES)]
    LeaveOut(leave_out::LeaveOutVerb),
    /// Frames of a representation at any times: other rates, slow and fast motion
    #[command(after_help = sample::EXAMPLES)]
    Sample(sample::SampleVerb),
    /// Change the time signal: move control points, add loops, delete, repeat or reverse frames
    #[command(after_help = edit::EXAMPLES)]
    Edit(edit::EditVerb),
    /// Move a motion to another mesh by examples that pair the two
    #[command(after_help = transfer::EXAMPLES)]
    Transfer(transfer::TransferVerb),
    /// A sequence from poses placed in the plane and a curve sketched among them
    #[command(after_help = design::EXAMPLES)]
    Design(design::DesignVerb),
}

impl Signal {
    pub fn run(self) -> Outcome {
        match self {
            Self::Fit(verb) => verb.run(),
            Self::Info(verb) => verb.run(),
            Self::Sample(verb) => verb.run(),
            Self::LeaveOut(verb) => verb.run(),
            Self::Edit(verb) => verb.run(),
            Self::Transfer(verb) => verb.run(),
            Self::Design(verb) => verb.run(),
        }
    }
}

/// An error where a representation is not called what it is: one .npz file.
fn check_representation_name(path: &Path) -> Result<(), Failure> {
    match path.extension().is_some_and(|e| e == "npz") {
        true => Ok(()),
        false => {
            let place = path.display();
            Err(format!("{place}: a representation is one .npz file; name it so").into())
        }
    }
}

/// An error unless frames between frames can have this weight.
fn check_between(weight: f64) -> Result<(), Failure> {
    match weight >= 0.0 && weight.is_finite() {
        true => Ok(()),
        false => Err(format!("--between {weight}: expected a weight of 0 or more").into()),
    }
}

/// Nothing is nothing of anything, also of nothing.
fn ratio(value: f64, scale: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value / scale }
}
