//! The leave-out test: fit every second frame, predict the others. Reconstruction errors do not show what a saddle of the pose surface does beside
//! the time signal (section 3.2.1, Figure 3); this does.

use faer::{Mat, MatRef};
use rayon::prelude::*;
use thiserror::Error;

use super::cubic::{CubicSpline, Ends};
use super::fit::{Errors, Fit, FitError, FitOptions, fit};
use super::h::{ShapeSignal, shape_signal};
use super::in_space::SpaceFitError;
use super::knots::KnotRule;
use super::layout::Layout;
use super::refine::{RefineOptions, refine};
use crate::linalg::kernels::combine;
use crate::shape::{ShapeError, Space, encode_all};

/// Four frames are kept of seven.
pub const FEWEST_FRAMES: usize = 7;

/// The frames of a sequence, 3V numbers each, in two: of n frames the 1st, 3rd, 5th ... are kept, and the 2nd, 4th ... left out; a last frame that would
/// lie beyond the kept ones is dropped.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    pub kept: Vec<f64>,
    pub left_out: Vec<f64>,
}

impl Split {
    /// Splits frames of `len` numbers each.
    pub fn new(frames: &[f64], len: usize) -> Result<Self, LeaveOutError> {
        let len = len.max(1);
        let found = frames.len() / len;
        if found < FEWEST_FRAMES {
            return Err(LeaveOutError::TooFewFrames { found });
        }
        let odd = found - 1 + found % 2;
        let every_second = |first: usize| -> Vec<f64> {
            let chosen = frames.chunks_exact(len).take(odd).skip(first).step_by(2);
            chosen.flatten().copied().collect()
        };
        Ok(Self {
            kept: every_second(0),
            left_out: every_second(1),
        })
    }
}

/// The kept frames in a shape space, and those that are to be predicted.
///
/// Every prediction lies in the span of the kept frames, of fewer dimensions than there are frames, and is made there; only what is compared is made a
/// vector of the shape space, and decoded.
pub struct LeaveOut<'a> {
    space: &'a dyn Space,
    /// All of that span, with the coordinates of the kept frames.
    span: ShapeSignal,
    left_out: &'a [f64],
}

/// How far predictions are from the frames left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Missed {
    /// Root mean square distance of the vertices over all frames left out, in the units of the positions.
    pub rms: f64,
    /// The same of each frame left out, the 2nd, 4th ... of the sequence.
    pub each: Vec<f64>,
}

/// A fit to the kept frames and what it predicts.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOff {
    /// The share of the kept frames that k and l were asked to be; 1 interpolates.
    pub share: f64,
    /// Whether the fit was refined.
    pub refined: bool,
    /// k, l and m as used.
    pub klm: (usize, usize, usize),
    /// Weight of distances along the motion in the layout.
    pub weight: f64,
    /// Root mean square distance of the predicted vertices from those left out.
    pub missed: f64,
    /// Errors at the kept frames.
    pub errors: Errors,
}

/// Why there is no leave-out test.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LeaveOutError {
    /// Too short a sequence.
    #[error(
        "expected at least {FEWEST_FRAMES} frames, found {found}; a fit needs 4, and every second one is left out"
    )]
    TooFewFrames { found: usize },
    /// See [`SpaceFitError`].
    #[error(transparent)]
    Fit(#[from] SpaceFitError),
}

impl From<ShapeError> for LeaveOutError {
    fn from(error: ShapeError) -> Self {
        Self::Fit(error.into())
    }
}

impl From<FitError> for LeaveOutError {
    fn from(error: FitError) -> Self {
        Self::Fit(error.into())
    }
}

impl<'a> LeaveOut<'a> {
    /// Encodes the n kept frames; O(n^2 d). A space whose patches are chosen by frames should know the kept ones alone.
    pub fn new(space: &'a dyn Space, split: &'a Split) -> Result<Self, LeaveOutError> {
        let z = encode_all(space, &split.kept)?;
        let span = shape_signal(z.as_ref(), usize::MAX).map_err(FitError::from)?;
        Ok(Self {
            span,
            left_out: &split.left_out,
            space,
        })
    }

    /// The kept frames as coordinates in their span, r x n.
    fn coordinates(&self) -> MatRef<'_, f64> {
        self.span.coordinates.as_ref()
    }

    /// The number of frames that are kept, the n of a fit to them.
    pub fn kept(&self) -> usize {
        self.coordinates().ncols()
    }

    /// By the means of the two frames beside each, in the shape space.
    pub fn linear(&self) -> Result<Missed, LeaveOutError> {
        let x = self.coordinates();
        let middle = |a, i| (x[(a, i)] + x[(a, i + 1)]) / 2.0;
        self.missed(Mat::from_fn(x.nrows(), x.ncols() - 1, middle).as_ref())
    }

    /// By the cubic spline through the kept frames at uniform times, without knots next to its ends, in the shape space.
    pub fn cubic(&self) -> Result<Missed, LeaveOutError> {
        let middle = CubicSpline::new(self.coordinates(), Ends::NotAKnot).midpoints();
        self.missed(middle.as_ref())
    }

    /// Options of a fit to the kept frames: with share 1 time and pose signals interpolate, k = n + 2 and l = n; with a lower share k and l are that
    /// share of n. m = n - 1 throughout.
    pub fn options(&self, share: f64, layout: Layout, knots: KnotRule) -> FitOptions {
        let n = self.kept();
        let part = |fewest: usize| ((share * n as f64).round() as usize).clamp(fewest, n);
        let (k, l) = match share >= 1.0 {
            true => (n + 2, n),
            false => (part(4), part(3)),
        };
        FitOptions {
            knots,
            layout,
            ..FitOptions::new(k, l, n - 1)
        }
    }

    /// The trade-off between sites and in-betweens: the test at each share of sites and control points; with a refinement once more, of the same fit
    /// refined.
    pub fn trade_off(
        &self,
        shares: &[f64],
        layout: Layout,
        knots: KnotRule,
        refinement: Option<&RefineOptions>,
    ) -> Result<Vec<TradeOff>, LeaveOutError> {
        let kept = self.coordinates();
        let mut rows = Vec::new();
        for &share in shares {
            let staged = fit(kept, &self.options(share, layout, knots))?;
            rows.push(self.row(share, false, &staged)?);
            if let Some(how) = refinement {
                let (refined, _) = refine(kept, staged, how)?;
                rows.push(self.row(share, true, &refined)?);
            }
        }
        Ok(rows)
    }

    fn row(&self, share: f64, refined: bool, fit: &Fit) -> Result<TradeOff, LeaveOutError> {
        Ok(TradeOff {
            share,
            refined,
            klm: fit.klm(),
            weight: fit.layout_weight,
            missed: self.signals(fit)?.rms,
            errors: fit.errors,
        })
    }

    /// By signals that were fitted to the coordinates of the kept frames.
    fn signals(&self, fit: &Fit) -> Result<Missed, LeaveOutError> {
        let times: Vec<f64> = (1..self.kept()).map(|i| i as f64 + 0.5).collect();
        let x = fit.representation.evaluate(&times);
        let r = self.coordinates().nrows();
        self.missed(MatRef::from_column_major_slice(&x, r, times.len()))
    }

    /// How far the frames of these coordinates (r x frames left out) are from the frames left out.
    fn missed(&self, x: MatRef<'_, f64>) -> Result<Missed, LeaveOutError> {
        let len = self.space.frame_len();
        let square = |i: usize| -> Result<f64, ShapeError> {
            let x: Vec<f64> = x.col(i).iter().copied().collect();
            let mut z = self.span.offset.clone();
            combine(&x, |j| self.span.basis.col_as_slice(j), &mut z);
            let mut predicted = vec![0.0; len];
            self.space.decode(&z, &mut predicted)?;
            let pairs = predicted.iter().zip(&self.left_out[i * len..]);
            let square: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
            Ok(square / (len as f64 / 3.0))
        };
        let squares: Vec<_> = (0..x.ncols()).into_par_iter().map(square).collect();
        let squares: Vec<f64> = squares.into_iter().collect::<Result<_, _>>()?;
        Ok(Missed {
            rms: (squares.iter().sum::<f64>() / squares.len() as f64).sqrt(),
            each: squares.into_iter().map(f64::sqrt).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::dataset::open;
    use crate::shape::vertex::VertexSpace;
    use crate::shape::{SpaceKind, prepare_for};

    /// One vertex on the curve (t, t^2, 0) at t = 0, 1, 2 ...
    fn parabola(n: usize) -> Vec<f64> {
        (0..n)
            .flat_map(|i| [i as f64, (i * i) as f64, 0.0])
            .collect()
    }

    #[test]
    fn means_of_neighbours_miss_a_parabola_by_one() {
        let space = VertexSpace::new(1);
        for n in [9, 10] {
            let split = Split::new(&parabola(n), 3).unwrap();
            let test = LeaveOut::new(&space, &split).unwrap();
            assert_eq!(test.kept(), 5);
            let missed = test.linear().unwrap();
            assert!(missed.each.len() == 4 && missed.each.iter().all(|x| (x - 1.0).abs() < 1e-12));
            assert!((missed.rms - 1.0).abs() < 1e-12);
            assert!(test.cubic().unwrap().rms < 1e-12);
        }
    }

    #[test]
    fn a_line_is_predicted_exactly_by_everything() {
        let frames: Vec<f64> = (0..9)
            .flat_map(|i| [i as f64, 2.0 * i as f64, -1.0])
            .collect();
        let space = VertexSpace::new(1);
        let split = Split::new(&frames, 3).unwrap();
        let test = LeaveOut::new(&space, &split).unwrap();
        let options = test.options(1.0, Layout::Mds, KnotRule::Symmetric);
        let missed = test
            .signals(&fit(test.coordinates(), &options).unwrap())
            .unwrap();
        for missed in [missed, test.linear().unwrap(), test.cubic().unwrap()] {
            assert!(missed.rms < 1e-12, "{missed:?}");
        }
    }

    #[test]
    fn spaces_decode_before_anything_is_measured() {
        let of = |name, kind| {
            let sequence = open(name).unwrap();
            let split = Split::new(sequence.positions(), sequence.dimension()).unwrap();
            let space = prepare_for(kind, sequence.connectivity(), &split.kept).unwrap();
            let test = LeaveOut::new(&*space, &split).unwrap();
            (test.linear().unwrap().rms, test.cubic().unwrap().rms)
        };
        let both = |name| [SpaceKind::Vertex, SpaceKind::Gradient].map(|kind| of(name, kind));
        let [vertex, gradient] = both("@gallop-small");
        assert!(vertex.1 < vertex.0 && gradient.1 < gradient.0);
        // A strip that rolls up turns evenly, which is a straight line of gradients.
        let [vertex, gradient] = both("@roll-small");
        assert!(gradient.0 < 0.5 * vertex.0, "{vertex:?} {gradient:?}");
    }

    #[test]
    fn order_keeps_in_betweens_that_plain_scaling_spoils() {
        let sequence = open("@jelly-small").unwrap();
        let space = VertexSpace::new(sequence.connectivity().vertex_count());
        let split = Split::new(sequence.positions(), sequence.dimension()).unwrap();
        let test = LeaveOut::new(&space, &split).unwrap();
        let rows = |layout| {
            test.trade_off(&[1.0, 0.8], layout, KnotRule::Symmetric, None)
                .unwrap()
        };
        let linear = test.linear().unwrap().rms;
        let (mds, ordered) = (rows(Layout::Mds), rows(Layout::Ordered { weight: None }));
        for (mds, ordered) in mds.iter().zip(&ordered) {
            assert_eq!(mds.klm, ordered.klm);
            assert!(ordered.missed < mds.missed && ordered.missed < linear);
            assert!(ordered.weight > 0.0 && mds.weight == 0.0);
        }
    }

    #[test]
    fn short_sequences_are_refused() {
        assert!(matches!(
            Split::new(&parabola(6), 3),
            Err(LeaveOutError::TooFewFrames { found: 6 })
        ));
    }
}
