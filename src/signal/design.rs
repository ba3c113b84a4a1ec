//! Sequences designed from scratch (section 4.4): poses placed in the plane by hand, and a curve sketched among them.

use faer::MatRef;
use thiserror::Error;

use super::Point;
use super::g::{PoseError, PoseSignal};
use super::h::shape_signal;
use super::parameters::Grid;
use super::psi::{Representation, TimeSignal};
use super::resample::MOST_FRAMES;
use super::sites::site_order;
use super::sketch::{Sketch, SketchError};
use crate::linalg::dense::FactorError;

/// What a design asks for, besides poses and curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignOptions {
    /// Frames of the new sequence.
    pub frames: usize,
    /// Whether the curve closes; the frame after the last would be the first.
    pub closed: bool,
    /// Sites of the pose signal, at most the poses; all of them if not given, so that each pose is met where it is placed.
    pub sites: Option<usize>,
    /// Dimension of the shape subspace; all if not given.
    pub dimension: Option<usize>,
}

/// Why there is no design.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DesignError {
    /// Too few poses to move between.
    #[error("a design needs at least 2 poses, found {found}")]
    TooFewPoses { found: usize },
    /// Another number of places than of poses.
    #[error("{places} places for {poses} poses; expected one each")]
    Unplaced { places: usize, poses: usize },
    /// A place that is NaN or infinite.
    #[error("pose {pose} (1-based, in the order given) has a place that is not finite: {place:?}")]
    NotFinite { pose: usize, place: Point },
    /// Two poses in one place.
    #[error(
        "poses {first} and {second} (1-based, in the order given) are at one place; move one of them"
    )]
    OnePlace { first: usize, second: usize },
    /// Sites out of range.
    #[error(
        "{found} sites, expected 3 to {most}, the poses (or fewer than 3 where there are no more poses)"
    )]
    BadSites { found: usize, most: usize },
    /// No frames, or too many.
    #[error("{found} frames: expected 2 to {MOST_FRAMES}")]
    BadFrames { found: usize },
    /// See [`SketchError`].
    #[error(transparent)]
    Sketch(#[from] SketchError),
    /// See [`PoseError`].
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// See [`FactorError`].
    #[error(transparent)]
    Factor(#[from] FactorError),
}

/// The representation of a design: `poses` are the columns of a d x p matrix and `places` where they are put; `sketch` are points that the curve runs
/// through.
///
/// Shape and pose signals are found as in the reconstruction, without scaling. The time signal is the cubic spline through the sketch, and its frames are
/// at equal ways along the curve. (The paper has uniform knots and parameters, with which the pace follows the spacing of the control points.)
pub fn design(
    poses: MatRef<'_, f64>,
    places: &[Point],
    sketch: &[Point],
    options: &DesignOptions,
) -> Result<Representation, DesignError> {
    check(poses.ncols(), places, options)?;
    let shape = shape_signal(poses, options.dimension.unwrap_or(usize::MAX))?;
    let x = shape.coordinates.as_ref();
    let all = places.len();
    let count = options.sites.unwrap_or(all);
    let sites = match count == all {
        true => (0..all).collect(),
        false => site_order(places, x, count, &vec![true; all], &[])?.order,
    };
    Ok(Representation {
        time: time_signal(&Sketch::new(sketch, options.closed)?, options),
        pose: PoseSignal::fit(places, x, &sites)?,
        offset: shape.offset,
        basis: shape.basis,
    })
}

fn check(poses: usize, places: &[Point], options: &DesignOptions) -> Result<(), DesignError> {
    if poses < 2 {
        return Err(DesignError::TooFewPoses { found: poses });
    }
    if places.len() != poses {
        let places = places.len();
        return Err(DesignError::Unplaced { places, poses });
    }
    let bad = places.iter().position(|p| !p.iter().all(|x| x.is_finite()));
    if let Some(i) = bad {
        let (pose, place) = (i + 1, places[i]);
        return Err(DesignError::NotFinite { pose, place });
    }
    for (i, p) in places.iter().enumerate() {
        if let Some(j) = places[..i].iter().position(|q| q == p) {
            let (first, second) = (j + 1, i + 1);
            return Err(DesignError::OnePlace { first, second });
        }
    }
    let most = poses;
    match options.sites {
        Some(found) if found > most || found < most.min(3) => {
            return Err(DesignError::BadSites { found, most });
        }
        _ => {}
    }
    let found = options.frames;
    match (2..=MOST_FRAMES).contains(&found) {
        true => Ok(()),
        false => Err(DesignError::BadFrames { found }),
    }
}

fn time_signal(sketch: &Sketch, options: &DesignOptions) -> TimeSignal {
    let steps = options.frames - usize::from(!options.closed);
    let spline = sketch.spline().clone();
    // On the grid of the knots, so that edits leave what is far from them as it is.
    let grid = Grid::of(&spline.knots);
    let at = |i: usize| grid.round(sketch.parameter(i as f64 / steps as f64));
    let parameters = (0..options.frames).map(at).collect();
    TimeSignal::new(spline, parameters)
}

#[cfg(test)]
mod tests {
    use super::super::distance;
    use super::*;
    use faer::Mat;

    const PLACES: [Point; 5] = [[0.0, 0.0], [2.0, 0.1], [2.2, 2.0], [0.1, 1.8], [1.0, 3.0]];
    const OPTIONS: DesignOptions = DesignOptions {
        frames: 41,
        closed: false,
        sites: None,
        dimension: None,
    };

    fn poses() -> Mat<f64> {
        Mat::from_fn(30, 5, |a, i| ((a + 1) as f64 * (i as f64 + 0.4)).sin())
    }

    #[test]
    fn a_curve_through_the_places_shows_the_poses_at_an_even_pace() {
        let z = poses();
        let r = design(z.as_ref(), &PLACES, &PLACES, &OPTIONS).unwrap();
        for (i, &place) in PLACES.iter().enumerate() {
            let x = r.pose.evaluate(&[place]);
            let mut frame = vec![0.0; 30];
            r.shape_into(x.col_as_slice(0), &mut frame);
            for a in 0..30 {
                assert!((frame[a] - z[(a, i)]).abs() < 1e-9);
            }
        }
        assert!(distance(r.time.evaluate(1.0), PLACES[0]) < 1e-12);
        assert!(distance(r.time.evaluate(41.0), PLACES[4]) < 1e-12);
        // Ways along the curve, which cut no corner.
        let way = |i: usize| {
            let (a, b) = (r.time.parameters[i - 1], r.time.parameters[i]);
            let at = |q: usize| r.time.spline.evaluate(a + (b - a) * q as f64 / 300.0);
            (0..300).map(|q| distance(at(q), at(q + 1))).sum::<f64>()
        };
        let ways: Vec<f64> = (1..41).map(way).collect();
        let mean = ways.iter().sum::<f64>() / 40.0;
        assert!(
            ways.iter().all(|w| (w / mean - 1.0).abs() < 1e-4),
            "{ways:?}"
        );
    }

    #[test]
    fn a_closed_design_goes_on_where_it_began() {
        let closed = DesignOptions {
            closed: true,
            ..OPTIONS
        };
        let r = design(poses().as_ref(), &PLACES, &PLACES, &closed).unwrap();
        let at = |i: usize| r.time.evaluate(i as f64);
        let step = distance(at(41), at(1));
        assert!((step / distance(at(1), at(2)) - 1.0).abs() < 0.02);
        assert!(distance(at(1), PLACES[0]) < 1e-12);
    }

    #[test]
    fn fewer_sites_and_dimensions_store_less() {
        let fewer = DesignOptions {
            sites: Some(4),
            dimension: Some(2),
            ..OPTIONS
        };
        let r = design(poses().as_ref(), &PLACES, &PLACES, &fewer).unwrap();
        assert_eq!((r.pose.site_count(), r.basis.ncols()), (4, 2));
    }

    #[test]
    fn designs_that_cannot_be_made_are_named() {
        let z = poses();
        let of = |places: &[Point], options| {
            let z = z.get(.., ..places.len().min(5));
            design(z, places, &PLACES, &options)
                .unwrap_err()
                .to_string()
        };
        assert!(of(&PLACES[..1], OPTIONS).contains("at least 2 poses"));
        let six = [&PLACES[..], &[[9.0, 9.0]]].concat();
        assert!(of(&six, OPTIONS).contains("6 places for 5 poses"));
        assert!(of(&[[0.0; 2], [1.0, 0.0], [0.0; 2]], OPTIONS).contains("poses 1 and 3"));
        assert!(of(&[[0.0; 2], [f64::NAN, 0.0]], OPTIONS).contains("pose 2"));
        for sites in [2, 6] {
            let options = DesignOptions {
                sites: Some(sites),
                ..OPTIONS
            };
            assert!(of(&PLACES, options).contains("expected 3 to 5"));
        }
        for frames in [0, 1, usize::MAX] {
            let options = DesignOptions { frames, ..OPTIONS };
            assert!(of(&PLACES, options).contains("frames"));
        }
    }
}
