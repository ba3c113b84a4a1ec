//! The whole chain psi = h o g o f (equation (1), section 2.4): the representation of a deforming mesh sequence.

use faer::Mat;
use rayon::prelude::*;

use super::Point;
use super::f::Spline;
use super::g::PoseSignal;
use super::rho::Rho;
use crate::linalg::kernels::combine;

/// So many points of [`TimeSignal::curve`] a frame look smooth when drawn.
pub const SMOOTH: usize = 12;
/// Numbers of a frame worked on at a time, so that they stay in cache while H is read once.
const BLOCK: usize = 512;

/// The time signal f = f~ o rho (section 2.3).
#[derive(Clone, Debug, PartialEq)]
pub struct TimeSignal {
    /// f~: control points and knots.
    pub spline: Spline,
    /// t_1 .. t_n, the parameters of the frames.
    pub parameters: Vec<f64>,
    rho: Rho,
}

impl TimeSignal {
    /// Joins a spline and the frames' non-decreasing parameters.
    pub fn new(spline: Spline, parameters: Vec<f64>) -> Self {
        Self {
            rho: Rho::new(&parameters),
            spline,
            parameters,
        }
    }

    /// f(t) for a frame time t in [1, n]; beyond the ends the end poses hold.
    pub fn evaluate(&self, t: f64) -> Point {
        self.spline.evaluate(self.rho.evaluate(t))
    }

    /// f at many frame times.
    pub fn evaluate_all(&self, times: &[f64]) -> Vec<Point> {
        let parameters: Vec<f64> = times.iter().map(|&t| self.rho.evaluate(t)).collect();
        self.spline.evaluate_all(&parameters)
    }

    /// f at the n frames and at `between` - 1 times between every two of them, in order: `between` (n - 1) + 1 points, those of the frames for 1.
    pub fn curve(&self, between: usize) -> Vec<Point> {
        let last = self.frame_count().saturating_sub(1) * between;
        let times = (0..=last).map(|i| 1.0 + i as f64 / between as f64);
        times.map(|t| self.evaluate(t)).collect()
    }

    /// n, the number of frames represented.
    pub fn frame_count(&self) -> usize {
        self.parameters.len()
    }
}

/// Separate signals for time, pose and shape; `evaluate` is psi.
#[derive(Clone, Debug, PartialEq)]
pub struct Representation {
    /// f, in time: [1, n] -> R^2.
    pub time: TimeSignal,
    /// g, in pose: R^2 -> R^m.
    pub pose: PoseSignal,
    /// h_0, d numbers.
    pub offset: Vec<f64>,
    /// H, d x m: h(x) = h_0 + H x.
    pub basis: Mat<f64>,
}

impl Representation {
    /// k, l and m: control points, sites, dimension of the shape subspace.
    pub fn klm(&self) -> (usize, usize, usize) {
        (
            self.time.spline.control.len(),
            self.pose.site_count(),
            self.basis.ncols(),
        )
    }

    /// d, the numbers in a frame.
    pub fn dimension(&self) -> usize {
        self.offset.len()
    }

    /// h(x) into `frame` (d numbers), reading H once. O(d m).
    pub fn shape_into(&self, x: &[f64], frame: &mut [f64]) {
        let blocks = frame.par_chunks_mut(BLOCK).with_min_len(4);
        blocks
            .enumerate()
            .for_each(|(b, rows)| self.shape_block(x, b, rows));
    }

    /// Block `b` of h(x).
    fn shape_block(&self, x: &[f64], b: usize, rows: &mut [f64]) {
        let place = b * BLOCK..b * BLOCK + rows.len();
        rows.copy_from_slice(&self.offset[place.clone()]);
        combine(x, |j| &self.basis.col_as_slice(j)[place.clone()], rows);
    }

    /// psi(t) into `frame` (d numbers), for a frame time t in [1, n]. O(l m + d m).
    pub fn evaluate_into(&self, t: f64, frame: &mut [f64]) {
        let mut x = vec![0.0; self.basis.ncols()];
        self.pose.evaluate_into(self.time.evaluate(t), &mut x);
        self.shape_into(&x, frame);
    }

    /// psi at many times, d numbers a time. The bits of a frame are those of [`Self::evaluate_into`], whatever the other times.
    ///
    /// A block of rows of H stays in cache for all times, so that memory gives H once.
    pub fn evaluate(&self, times: &[f64]) -> Vec<f64> {
        let d = self.dimension();
        let coordinates = self.pose.evaluate(&self.time.evaluate_all(times));
        let mut frames = vec![0.0; d * times.len()];
        let mut blocks: Vec<Vec<&mut [f64]>> = (0..d.div_ceil(BLOCK)).map(|_| Vec::new()).collect();
        for frame in frames.chunks_mut(d.max(1)) {
            for (block, rows) in blocks.iter_mut().zip(frame.chunks_mut(BLOCK)) {
                block.push(rows);
            }
        }
        blocks.into_par_iter().enumerate().for_each(|(b, block)| {
            for (i, rows) in block.into_iter().enumerate() {
                self.shape_block(coordinates.col_as_slice(i), b, rows);
            }
        });
        frames
    }

    /// How many numbers the representation stores: signals, knots and parameters.
    pub fn stored_numbers(&self) -> usize {
        let (d, m) = self.basis.shape();
        let (k, l, _) = self.klm();
        d * (m + 1) + m * (l + 3) + 2 * l + 2 * k + (k + 2) + self.time.frame_count()
    }
}
