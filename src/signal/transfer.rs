//! Deformation transfer by examples (section 4.3): a shape signal spanned by examples of one mesh gives way to one spanned by the same examples of
//! another, and pose and time signals stay.

use faer::{Mat, MatRef};
use rayon::prelude::*;
use thiserror::Error;

use super::fit::{Base, Fit, FitError, check_ranges};
use super::h::ShapeSignal;
use super::knots::KnotRule;
use super::layout::Layout;
use super::pins::{Pin, validate_pins};
use super::psi::Representation;
use crate::linalg::dense::{FactorError, ThinSvd, thin_svd};
use crate::linalg::kernels::{axpy, combine, dot, norm_squared};
use crate::shape::{ShapeError, Space, encode_examples};

/// Singular values of the example differences up to this share of the greatest count as 0: examples that depend on the others.
const DEPENDENT: f64 = 1e-10;

/// Why examples transfer nothing.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TransferError {
    /// Other numbers of examples on both sides.
    #[error(
        "{source_examples} examples of the source but {target_examples} of the target; they pair frame by frame, so give as many of each"
    )]
    Unpaired {
        source_examples: usize,
        target_examples: usize,
    },
    /// Only the reference pose, or nothing.
    #[error(
        "expected at least 2 examples, of which the first shows the reference pose, found {found}"
    )]
    TooFewExamples { found: usize },
    /// Frames of another space or mesh than the examples.
    #[error(
        "the frames have {frames} numbers each but the source examples {examples}; both must be of one mesh and shape space"
    )]
    OtherSpace { frames: usize, examples: usize },
    /// See [`FactorError`].
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// See [`ShapeError`].
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// See [`FitError`].
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// A shape signal spanned by examples: h_0 = q_0 and h_j = q_j - q_0, which are not orthogonal.
pub struct ExampleBasis {
    /// q_0, d numbers.
    pub offset: Vec<f64>,
    /// d x m, the q_j - q_0.
    pub basis: Mat<f64>,
    factors: ThinSvd,
}

impl ExampleBasis {
    /// From m + 1 examples as the columns of a d x (m + 1) matrix, the reference pose first. O(d m^2).
    pub fn new(examples: MatRef<'_, f64>) -> Result<Self, TransferError> {
        let (offset, basis) = differences(examples)?;
        let factors = thin_svd(basis.as_ref())?;
        Ok(Self {
            offset,
            basis,
            factors,
        })
    }

    /// How many of the differences are independent.
    pub fn rank(&self) -> usize {
        let s = &self.factors.s;
        let least = DEPENDENT * s.first().copied().unwrap_or(0.0);
        s.iter().take_while(|&&s| s > least).count()
    }

    /// X, m x n: the least-squares coordinates of frames Z (d x n), H^T H X = H^T (Z - h_0). Solved through the singular value decomposition of H and not
    /// the normal equations, which would square its condition; of least norm where examples depend on each other. O(d m n).
    pub fn coordinates(&self, frames: MatRef<'_, f64>) -> Result<Mat<f64>, TransferError> {
        self.check(frames.nrows())?;
        let each: Vec<Vec<f64>> = (0..frames.ncols())
            .into_par_iter()
            .map(|i| {
                let z = frames.col(i);
                let left: Vec<f64> = z.iter().zip(&self.offset).map(|(z, h)| z - h).collect();
                self.solve(&left)
            })
            .collect();
        let m = self.basis.ncols();
        Ok(Mat::from_fn(m, each.len(), |j, i| each[i][j]))
    }

    /// The share of the spread of frames Z (d x n) about their mean that the basis leaves out: the root of a ratio of sums of squares.
    pub fn missed(&self, frames: MatRef<'_, f64>) -> Result<f64, TransferError> {
        let x = self.coordinates(frames)?;
        let (d, n) = frames.shape();
        let mut mean = vec![0.0; d];
        for frame in frames.col_iter() {
            mean.iter_mut().zip(frame.iter()).for_each(|(m, z)| *m += z);
        }
        mean.iter_mut().for_each(|m| *m /= n as f64);
        let sums: Vec<[f64; 2]> = (0..n)
            .into_par_iter()
            .map(|i| {
                let column = || frames.col(i).iter();
                let mut left: Vec<f64> = column().zip(&self.offset).map(|(z, h)| z - h).collect();
                for j in 0..x.nrows() {
                    axpy(-x[(j, i)], self.basis.col_as_slice(j), &mut left);
                }
                let spread = column().zip(&mean).map(|(z, m)| (z - m).powi(2)).sum();
                [norm_squared(&left), spread]
            })
            .collect();
        let [left, spread] = [0, 1].map(|c| sums.iter().map(|s| s[c]).sum::<f64>());
        Ok(if left == 0.0 {
            0.0
        } else {
            (left / spread).sqrt()
        })
    }

    fn check(&self, frames: usize) -> Result<(), TransferError> {
        let examples = self.offset.len();
        match frames == examples {
            true => Ok(()),
            false => Err(TransferError::OtherSpace { frames, examples }),
        }
    }

    /// H^+ y.
    fn solve(&self, y: &[f64]) -> Vec<f64> {
        let ThinSvd { u, s, v } = &self.factors;
        let mut x = vec![0.0; v.nrows()];
        for c in 0..self.rank() {
            let weight = dot(u.col_as_slice(c), y) / s[c];
            for (x, v) in x.iter_mut().zip(v.col(c).iter()) {
                *x += weight * v;
            }
        }
        x
    }

    /// The same representation, nearest in least squares, over this basis: x' = H^+ (h_0' - q_0 + H' x) is linear in x, so that g changes its coefficients
    /// and nothing else, and pose and time signals stay as they are.
    pub fn express(&self, r: &Representation) -> Result<Representation, TransferError> {
        self.check(r.dimension())?;
        let m = self.basis.ncols();
        let columns: Vec<Vec<f64>> = (0..r.basis.ncols())
            .into_par_iter()
            .map(|j| self.solve(r.basis.col_as_slice(j)))
            .collect();
        let change = Mat::from_fn(m, columns.len(), |i, j| columns[j][i]);
        let left: Vec<f64> = r
            .offset
            .iter()
            .zip(&self.offset)
            .map(|(a, b)| a - b)
            .collect();
        let constant = self.solve(&left);
        let mut pose = r.pose.clone();
        pose.coefficients = &change * &r.pose.coefficients;
        for (i, c) in constant.iter().enumerate() {
            pose.coefficients[(i, 0)] += c;
        }
        Ok(Representation {
            time: r.time.clone(),
            pose,
            offset: self.offset.clone(),
            basis: self.basis.clone(),
        })
    }

    /// Signals found from frames Z (d x n) "in the usual way" from their coordinates in this basis: the paper's scaling, g with l sites, f with k control points. Errors
    /// (4) and (7) are those of coordinates and poses; (2) is that of coordinates too, and (3) is 0, for the basis is not orthonormal.
    pub fn fit(
        &self,
        frames: MatRef<'_, f64>,
        k: usize,
        l: usize,
        knots: KnotRule,
        pins: &[Pin],
    ) -> Result<Fit, TransferError> {
        let n = frames.ncols();
        check_ranges(n, &[("k", k, 4, n + 2), ("l", l, 3, n)])?;
        validate_pins(pins, n).map_err(FitError::from)?;
        let shape = ShapeSignal {
            offset: self.offset.clone(),
            basis: self.basis.clone(),
            coordinates: self.coordinates(frames)?,
            singular_values: self.factors.s.clone(),
        };
        let base = Base::from_shape(shape, 0.0, Default::default(), Layout::Mds, pins)?;
        Ok(base.fit(k, l, knots)?)
    }
}

/// The first column, and the others less it.
fn differences(examples: MatRef<'_, f64>) -> Result<(Vec<f64>, Mat<f64>), TransferError> {
    let (d, found) = examples.shape();
    if found < 2 || d == 0 {
        return Err(TransferError::TooFewExamples { found });
    }
    let offset: Vec<f64> = examples.col(0).iter().copied().collect();
    let basis = Mat::from_fn(d, found - 1, |i, j| examples[(i, j + 1)] - offset[i]);
    Ok((offset, basis))
}

fn paired(source_examples: usize, target_examples: usize) -> Result<(), TransferError> {
    match source_examples == target_examples {
        true => Ok(()),
        false => Err(TransferError::Unpaired {
            source_examples,
            target_examples,
        }),
    }
}

/// psi' : I -> S', the representation over an [`ExampleBasis`] with the examples of the other mesh in its place, as the columns of a d' x (m + 1) matrix.
/// Where psi shows example j of the source, psi' shows example j of the target. O(d' m).
pub fn replace_shape(
    over_examples: Representation,
    target: MatRef<'_, f64>,
) -> Result<Representation, TransferError> {
    paired(over_examples.basis.ncols() + 1, target.ncols())?;
    let (offset, basis) = differences(target)?;
    Ok(Representation {
        offset,
        basis,
        ..over_examples
    })
}

/// Rows of examples that are combined for all frames before the next: those of some examples stay in a core's cache.
const ROWS: usize = 1024;
/// Frames written by one task.
const FRAMES: usize = 16;

/// W = r_0 + sum_j x_j (r_j - r_0) for coordinates X (m x n), d' numbers a frame, frame after frame: transfer of frames, with signals that interpolate.
/// O(d' m n), and each of the numbers is written once.
pub fn frames_of_coordinates(
    coordinates: MatRef<'_, f64>,
    target: MatRef<'_, f64>,
) -> Result<Vec<f64>, TransferError> {
    let (offset, basis) = differences(target)?;
    paired(coordinates.nrows() + 1, target.ncols())?;
    let d = offset.len();
    let weights: Vec<Vec<f64>> = coordinates
        .col_iter()
        .map(|x| x.iter().copied().collect())
        .collect();
    let mut frames = vec![0.0; d * weights.len()];
    let tasks = frames.par_chunks_mut(d * FRAMES);
    tasks.zip(weights.par_chunks(FRAMES)).for_each(|(w, x)| {
        for first in (0..d).step_by(ROWS) {
            let rows = first..(first + ROWS).min(d);
            for (frame, x) in w.chunks_exact_mut(d).zip(x) {
                let frame = &mut frame[rows.clone()];
                frame.copy_from_slice(&offset[rows.clone()]);
                combine(x, |j| &basis.col_as_slice(j)[rows.clone()], frame);
            }
        }
    });
    Ok(frames)
}

/// A motion (n x 3V positions) on another mesh: its signals, k control points and l sites, fitted over examples of its own mesh, and then over those of
/// the other. Both are 3V positions each, frame by frame the same poses, the reference pose first.
pub fn transfer_motion(
    motion: &[f64],
    [from, to]: [&dyn Space; 2],
    [source, target]: [&[f64]; 2],
    (k, l): (usize, usize),
    knots: KnotRule,
) -> Result<Representation, TransferError> {
    let (q, r) = (encode_examples(from, source)?, encode_examples(to, target)?);
    let basis = ExampleBasis::new(q.as_ref())?;
    let z = encode_motion(from, &source[..from.frame_len()], &basis, motion)?;
    let fit = basis.fit(z.as_ref(), k, l, knots, &[])?;
    replace_shape(fit.representation, r.as_ref())
}

/// Rounds in which the branches of the angles follow what the examples show.
const ROUNDS: usize = 3;

/// Frames (n x 3V positions) as the columns of a d x n matrix, for transfer by these examples, of which `rest` (3V positions) is the first.
///
/// The branches of angles are at first those nearest to the reference pose and then those nearest to the least-squares combination of the examples. So a
/// frame that is an example has the example's vector, and a motion that turns far has no jumps where a principal branch would have them.
pub fn encode_motion(
    space: &dyn Space,
    rest: &[f64],
    basis: &ExampleBasis,
    frames: &[f64],
) -> Result<Mat<f64>, TransferError> {
    let z = encode_examples(space, &[rest, frames].concat())?;
    let mut z = z.get(.., 1..).to_owned();
    for _ in 0..ROUNDS {
        let x = basis.coordinates(z.as_ref())?;
        for i in 0..z.ncols() {
            let mut nearest = basis.offset.clone();
            combine(
                x.col_as_slice(i),
                |j| basis.basis.col_as_slice(j),
                &mut nearest,
            );
            space.unwrap(&nearest, z.col_as_slice_mut(i));
        }
    }
    Ok(z)
}

#[cfg(test)]
mod tests {
    use super::super::fit::{FitOptions, fit};
    use super::*;
    use proptest::prelude::*;

    fn matrix(d: usize, n: usize, seed: f64) -> Mat<f64> {
        Mat::from_fn(d, n, |a, i| {
            ((a + 2) as f64 * (i as f64 + seed)).sin() + 0.2 * ((a * i) as f64).cos()
        })
    }

    fn interpolating(z: &Mat<f64>) -> Representation {
        let n = z.ncols();
        let options = FitOptions::new(n + 2, n, n - 1);
        fit(z.as_ref(), &options).unwrap().representation
    }

    fn at_frames(r: &Representation) -> Mat<f64> {
        let n = r.time.frame_count();
        let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
        let frames = r.evaluate(&times);
        MatRef::from_column_major_slice(&frames, r.dimension(), n).to_owned()
    }

    #[test]
    fn examples_turn_into_their_partners() {
        let (q, r) = (matrix(50, 8, 0.3), matrix(71, 8, 1.1));
        let basis = ExampleBasis::new(q.as_ref()).unwrap();
        // From signals fitted before, and from signals fitted to the coordinates.
        let kept = basis.express(&interpolating(&q)).unwrap();
        let fitted = basis
            .fit(q.as_ref(), 10, 8, KnotRule::Symmetric, &[])
            .unwrap();
        for over in [kept, fitted.representation] {
            assert!((at_frames(&over) - &q).norm_max() < 1e-9);
            let other = replace_shape(over, r.as_ref()).unwrap();
            assert!((at_frames(&other) - &r).norm_max() < 1e-9);
        }
    }

    #[test]
    fn pose_and_time_signals_stay() {
        let (z, q, r) = (matrix(40, 12, 0.7), matrix(40, 5, 0.3), matrix(9, 5, 0.1));
        let source = interpolating(&z);
        let basis = ExampleBasis::new(q.as_ref()).unwrap();
        let over = basis.express(&source).unwrap();
        assert_eq!(over.time, source.time);
        assert_eq!(over.pose.sites, source.pose.sites);
        let other = replace_shape(over, r.as_ref()).unwrap();
        let x = basis.coordinates(z.as_ref()).unwrap();
        let w = frames_of_coordinates(x.as_ref(), r.as_ref()).unwrap();
        let w = MatRef::from_column_major_slice(&w, 9, 12);
        assert!((at_frames(&other) - w).norm_max() < 1e-8);
    }

    #[test]
    fn what_does_not_pair_is_named() {
        let (q, r) = (matrix(20, 4, 0.3), matrix(30, 5, 1.1));
        let basis = ExampleBasis::new(q.as_ref()).unwrap();
        let over = basis.express(&interpolating(&q)).unwrap();
        assert!(matches!(
            replace_shape(over, r.as_ref()),
            Err(TransferError::Unpaired {
                source_examples: 4,
                target_examples: 5
            })
        ));
        assert!(matches!(
            basis.coordinates(r.as_ref()),
            Err(TransferError::OtherSpace {
                frames: 30,
                examples: 20
            })
        ));
        let one = ExampleBasis::new(q.get(.., ..1)).err();
        assert!(matches!(
            one,
            Some(TransferError::TooFewExamples { found: 1 })
        ));
        let fit = |k, l| basis.fit(q.as_ref(), k, l, KnotRule::Symmetric, &[]);
        assert!(fit(7, 4).is_err() && fit(6, 5).is_err() && fit(6, 4).is_ok());
    }

    proptest! {
        /// The residual of least squares is orthogonal to the basis, whether examples are independent or not, and the norm is the least.
        #[test]
        fn least_squares_and_least_norm(repeat in any::<bool>(), seed in 0.0f64..3.0) {
            let mut q = matrix(30, 5, seed);
            if repeat {
                for a in 0..30 { q[(a, 4)] = q[(a, 3)]; }
            }
            let basis = ExampleBasis::new(q.as_ref()).unwrap();
            prop_assert_eq!(basis.rank(), if repeat { 3 } else { 4 });
            let z = matrix(30, 7, seed + 0.4);
            let x = basis.coordinates(z.as_ref()).unwrap();
            let left = Mat::from_fn(30, 7, |a, i| z[(a, i)] - basis.offset[a]) - &basis.basis * &x;
            prop_assert!((basis.basis.transpose() * left).norm_max() < 1e-10);
            if repeat {
                for i in 0..7 { prop_assert!((x[(2, i)] - x[(3, i)]).abs() < 1e-10); }
            }
        }
    }
}
