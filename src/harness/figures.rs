//! What the pictures of a fit are drawn from.

use faer::Mat;

use super::case::Case;
use super::record::FitFigures;
use crate::mesh::measure::bounds;
use crate::sequence::Sequence;
use crate::shape::{Space, encode_all, prepare_for};
use crate::signal::fit::Fit;
use crate::signal::in_space::{mean_squares, rms_after_decoding};
use crate::signal::psi::SMOOTH;
use crate::stages::StageError;
use crate::stages::signal::Choice;

/// Values tried of each of k, l and m.
const STEPS: usize = 10;

/// Fits the case's constants, and neighbours of each of them, to a sequence whose first frame is the space's reference.
pub fn draw(case: &Case, sequence: &Sequence) -> Result<FitFigures, StageError> {
    let frames = Frames::new(case, sequence)?;
    let fit = case.choice.fit(frames.z.as_ref())?;
    let (k, l, m) = fit.klm();
    let n = sequence.frame_count();
    let time = &fit.representation.time;
    let base = &case.choice;
    Ok(FitFigures {
        case: case.name.clone(),
        dataset: case.dataset.clone(),
        space: base.space.to_string(),
        k,
        l,
        m,
        d: frames.z.nrows(),
        frames: n,
        positions: fit.positions.clone(),
        frame_points: time.curve(1),
        curve: time.curve(SMOOTH),
        control: time.spline.control.clone(),
        sites: fit.sites.order.clone(),
        frame_errors: frames.errors(&fit)?,
        singular_values: fit.singular_values.clone(),
        error_by_m: frames.sweep(0, n - 1, |m| Choice { m, ..base.clone() })?,
        error_by_l: frames.sweep(3, n, |l| Choice { l, ..base.clone() })?,
        error_by_k: frames.sweep(4, n + 2, |k| Choice { k, ..base.clone() })?,
        errors: [fit.errors.h, fit.errors.g, fit.errors.f, fit.errors.psi],
    })
}

/// The frames, as positions and in the space.
struct Frames<'a> {
    sequence: &'a Sequence,
    space: Box<dyn Space>,
    z: Mat<f64>,
    diagonal: f64,
}

impl<'a> Frames<'a> {
    fn new(case: &Case, sequence: &'a Sequence) -> Result<Self, StageError> {
        let (mesh, positions) = (sequence.connectivity(), sequence.positions());
        let space = prepare_for(case.choice.space, mesh, positions);
        let space = space.map_err(StageError::from_error)?;
        let z = encode_all(&*space, positions).map_err(StageError::from_error)?;
        Ok(Self {
            sequence,
            space,
            z,
            diagonal: bounds(sequence.frame(0)).diagonal(),
        })
    }

    /// Relative RMS vertex distance of each frame.
    fn errors(&self, fit: &Fit) -> Result<Vec<f64>, StageError> {
        let positions = self.sequence.positions();
        let squares = mean_squares(&*self.space, positions, &fit.representation);
        let (squares, _) = squares.map_err(StageError::from_error)?;
        Ok(squares.iter().map(|s| s.sqrt() / self.diagonal).collect())
    }

    /// Relative RMS vertex distance of all frames for values between low and high of one constant.
    fn sweep(
        &self,
        low: usize,
        high: usize,
        with: impl Fn(usize) -> Choice,
    ) -> Result<Vec<(usize, f64)>, StageError> {
        let error = |value: usize| {
            let fit = with(value).fit(self.z.as_ref())?;
            let positions = self.sequence.positions();
            let rms = rms_after_decoding(&*self.space, positions, &fit.representation);
            let (rms, _) = rms.map_err(StageError::from_error)?;
            Ok((value, rms / self.diagonal))
        };
        steps(low, high).into_iter().map(error).collect()
    }
}

/// Distinct values from low to high, both in.
fn steps(low: usize, high: usize) -> Vec<usize> {
    let mut values: Vec<usize> = (0..=STEPS)
        .map(|i| low + (high - low) * i / STEPS)
        .collect();
    values.dedup();
    values
}
