//! Pins: pose-space positions that the user fixes (section 3.2.1), and the start that they ask for.

use faer::MatRef;
use nalgebra::{Matrix2, Vector2};
use thiserror::Error;

use super::Point;

/// A frame whose pose-space position the user chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pin {
    /// 0-based frame.
    pub frame: usize,
    /// Where it is held, in the units of the shape coordinates.
    pub position: Point,
}

/// Why the pins cannot be used.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum PinError {
    /// No such frame.
    #[error("pin names frame {frame}, but the frames are 1 to {frames}")]
    NoSuchFrame { frame: usize, frames: usize },
    /// A position that is NaN or infinite.
    #[error("pin of frame {frame} has a position that is not finite: {position:?}")]
    NotFinite { frame: usize, position: Point },
    /// A position that no motion of this size has.
    #[error(
        "pin of frame {frame} at {position:?} is farther than {FAR:e} times the extent of the shape coordinates, {extent:.3e}, in whose units pins are"
    )]
    TooFar {
        frame: usize,
        position: Point,
        extent: f64,
    },
    /// One frame pinned to two places.
    #[error("frame {frame} is pinned twice, to {first:?} and to {second:?}; keep one of them")]
    Contradiction {
        frame: usize,
        first: Point,
        second: Point,
    },
}

/// Pins farther away than so many extents of the shape coordinates are a mistake.
const FAR: f64 = 1e6;

/// An error where a pin is not among the shape coordinates (m x n), whose extent counts 1 where they are all 0. O(m n).
pub(super) fn check_distance(pins: &[Pin], coordinates: MatRef<'_, f64>) -> Result<(), PinError> {
    if pins.is_empty() {
        return Ok(());
    }
    let columns = coordinates.col_iter();
    let extent = match columns.map(|x| x.norm_l2()).fold(0.0, f64::max) {
        0.0 => 1.0,
        extent => extent,
    };
    let far = |pin: &&Pin| pin.position[0].hypot(pin.position[1]) > FAR * extent;
    match pins.iter().find(far) {
        Some(pin) => Err(PinError::TooFar {
            frame: pin.frame + 1,
            position: pin.position,
            extent,
        }),
        None => Ok(()),
    }
}

/// Frames are named 1-based in errors, as the paper counts them. The same pin given twice is one pin. O(pins + frames).
pub fn validate_pins(pins: &[Pin], frames: usize) -> Result<(), PinError> {
    let mut held = vec![None; frames];
    for pin in pins {
        let frame = pin.frame + 1;
        let position = pin.position;
        if pin.frame >= frames {
            return Err(PinError::NoSuchFrame { frame, frames });
        }
        if !position.iter().all(|x| x.is_finite()) {
            return Err(PinError::NotFinite { frame, position });
        }
        let first = *held[pin.frame].get_or_insert(position);
        if first != position {
            return Err(PinError::Contradiction {
                frame,
                first,
                second: position,
            });
        }
    }
    Ok(())
}

/// The start of the scaling (reading 6): the first two principal coordinates of X (m x n; missing ones are 0), moved by the best rigid motion,
/// reflections allowed, onto the pins, which then sit exactly where they are asked to.
pub fn principal_start(coordinates: MatRef<'_, f64>, pins: &[Pin]) -> Vec<Point> {
    let m = coordinates.nrows();
    let principal = |i: usize| -> Point {
        std::array::from_fn(|axis| {
            if axis < m {
                coordinates[(axis, i)]
            } else {
                0.0
            }
        })
    };
    moved_onto((0..coordinates.ncols()).map(principal).collect(), pins)
}

/// Points moved by the best rigid motion, reflections allowed, onto the pins, which then sit exactly where they are asked to.
pub(super) fn moved_onto(mut start: Vec<Point>, pins: &[Pin]) -> Vec<Point> {
    let Some((turn, from, to)) = rigid_motion(&start, pins) else {
        return start;
    };
    for p in &mut start {
        *p = (turn * (Vector2::from(*p) - from) + to).into();
    }
    for pin in pins {
        start[pin.frame] = pin.position;
    }
    start
}

/// The orthogonal matrix and the two centroids of the least-squares motion of the pinned points onto their pins; None without pins.
fn rigid_motion(
    points: &[Point],
    pins: &[Pin],
) -> Option<(Matrix2<f64>, Vector2<f64>, Vector2<f64>)> {
    let share = 1.0 / pins.len() as f64;
    let from: Vector2<f64> = pins.iter().map(|p| Vector2::from(points[p.frame])).sum();
    let to: Vector2<f64> = pins.iter().map(|p| Vector2::from(p.position)).sum();
    let (from, to) = (from * share, to * share);
    let covariance: Matrix2<f64> = pins
        .iter()
        .map(|p| {
            (Vector2::from(p.position) - to) * (Vector2::from(points[p.frame]) - from).transpose()
        })
        .sum();
    if pins.is_empty() {
        return None;
    }
    if covariance == Matrix2::zeros() {
        return Some((Matrix2::identity(), from, to));
    }
    let svd = covariance.svd(true, true);
    Some((svd.u? * svd.v_t?, from, to))
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::Mat;

    #[test]
    fn the_start_meets_pins_that_are_a_reflected_motion() {
        let x = Mat::from_fn(2, 5, |a, i| ((i * 3 + a) as f64).sin());
        let moved = |i: usize| [3.0 - x[(1, i)], x[(0, i)] + 1.0];
        let reflected = |i: usize| [3.0 + x[(1, i)], x[(0, i)] + 1.0];
        for motion in [&moved as &dyn Fn(usize) -> Point, &reflected] {
            let pins: Vec<Pin> = [0, 2, 3]
                .map(|frame| Pin {
                    frame,
                    position: motion(frame),
                })
                .into();
            for (i, p) in principal_start(x.as_ref(), &pins).iter().enumerate() {
                assert!(super::super::distance(*p, motion(i)) < 1e-12);
            }
        }
    }

    #[test]
    fn contradictions_are_found() {
        let pin = |frame, x| Pin {
            frame,
            position: [x, 0.0],
        };
        assert_eq!(validate_pins(&[pin(1, 0.0), pin(1, 0.0)], 4), Ok(()));
        assert!(matches!(
            validate_pins(&[pin(1, 0.0), pin(1, 1.0)], 4),
            Err(PinError::Contradiction { frame: 2, .. })
        ));
        assert!(matches!(
            validate_pins(&[pin(4, 0.0)], 4),
            Err(PinError::NoSuchFrame { .. })
        ));
        assert!(matches!(
            validate_pins(&[pin(0, f64::NAN)], 4),
            Err(PinError::NotFinite { .. })
        ));
    }
}
