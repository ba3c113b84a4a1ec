//! `@flag`: a cloth on a pole in a periodic wind.
//!
//! The wind blows along +x and gusts sideways (z) with a period of 25 frames; each gust is a little stronger or weaker than the one before.
//! Recording starts when the cloth (see `cloth`) has settled into its motion, so the flag repeats itself nearly, but not exactly, once a
//! gust. It may pass through itself.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::cloth::{Cloth, Material};
use super::{SyntheticError, assemble};
use crate::sequence::Sequence;

/// Width along x when flat, from the pole at x = 0; the height along y is half of it.
pub const WIDTH: f64 = 1.9;
/// Number of frames after which the wind nearly repeats itself.
pub const GUST: usize = 25;

pub(super) struct Size {
    columns: usize,
    rows: usize,
    frames: usize,
}

pub(super) const FULL: Size = Size {
    columns: 76,
    rows: 38,
    frames: 100,
};
pub(super) const SMALL: Size = Size {
    columns: 16,
    rows: 8,
    frames: 40,
};

const FRAME_SECONDS: f64 = 1.0 / 30.0;
/// Steps of the cloth in a quarter of a frame, for each of which the wind is taken anew.
const STEPS: usize = 16;
const WARM_UP: usize = 2 * GUST;
const BUNTING: Material = Material {
    density: 0.12,
    gravity: -9.81,
    drag: 0.95,
    friction: 0.42,
    damping: 1.5,
};

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let spacing = WIDTH / size.columns as f64;
    let mut cloth = Cloth::new(size.columns, size.rows, spacing, BUNTING);
    let mut frames = Vec::with_capacity(size.frames);
    for frame in 0..WARM_UP + size.frames {
        if frame >= WARM_UP {
            frames.push(cloth.points());
        }
        for gust in 0..4 {
            let at = frame as f64 + f64::from(gust) / 4.0;
            cloth.advance(FRAME_SECONDS / 4.0, STEPS, |x| wind(at, x));
        }
    }
    assemble(cloth.faces, &frames)
}

/// The velocity of the air at time `at` (in frames) and place x along the flag: waves that travel away from the pole.
fn wind(at: f64, x: f64) -> Vector3<f64> {
    let phase = TAU * (at / GUST as f64 - x / 2.4);
    // 0.27 gusts: strengths do not repeat within the recording
    let strength = 1.0 + 0.12 * (0.27 * TAU * at / GUST as f64).sin();
    Vector3::new(
        7.0 + 0.8 * (phase + 1.0).sin(),
        0.9 + 0.5 * phase.sin(),
        strength * (2.7 * phase.sin() + 0.5 * (2.0 * phase + 0.4).sin()),
    )
}

#[cfg(test)]
mod tests {
    use super::super::cloth::flat;
    use super::super::{checks, embedded};
    use super::*;

    #[test]
    fn edges_hardly_stretch() {
        for (name, size) in [("@flag", FULL), ("@flag-small", SMALL)] {
            let sequence = embedded(name).unwrap();
            let stretch = checks::largest_stretch(
                &sequence,
                &flat(size.columns, size.rows, WIDTH / size.columns as f64),
            );
            assert!(stretch < 0.05, "{name}: {stretch}");
        }
    }

    #[test]
    fn the_pole_side_stays_and_the_rest_billows() {
        let sequence = embedded("@flag").unwrap();
        let rest = flat(FULL.columns, FULL.rows, WIDTH / FULL.columns as f64);
        for i in 0..FULL.frames {
            let points = checks::points(sequence.frame(i));
            assert!((0..=FULL.rows).all(|v| points[v] == rest[v]));
            let depth = |sign: f64| points.iter().map(|p| sign * p.z).fold(0.0, f64::max);
            assert!(depth(1.0) + depth(-1.0) > 0.15, "frame {i} is flat");
            assert!(points.iter().all(|p| p.norm() < 1.2 * WIDTH));
        }
    }

    #[test]
    fn the_motion_nearly_repeats_with_the_wind() {
        let sequence = embedded("@flag").unwrap();
        let distance = |i: usize, j: usize| checks::distance(&sequence, i, j);
        for i in 0..FULL.frames - GUST {
            assert!(
                distance(i, i + GUST) < 0.6 * distance(i, i + GUST / 2),
                "frame {i}"
            );
        }
    }

    #[test]
    fn it_is_one_open_sheet() {
        checks::assert_disc(&embedded("@flag").unwrap());
        checks::assert_disc(&embedded("@flag-small").unwrap());
    }
}
