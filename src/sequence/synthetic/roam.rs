//! `@roam`: a quadruped that goes on for ever, in place, and never repeats.
//!
//! Its gait drifts between the gallop of [`super::gallop`] and the trot of [`super::trot`], in a rhythm that now hurries and now dawdles. The
//! periods of the drift, of the rhythm, of the gallop (24 frames) and of the trot (32) have no common multiple, as their ratios are
//! irrational, so no frame is another one, however long it goes on:
//!
//! ```text
//! w = (1 + sin(2 pi at / 61 sqrt 2)) / 2                  the share of the trot
//! t = at + 2.4 sin(2 pi at / 37 sqrt 3)                   how far the gait has got, in frames
//! ```
//!
//! Every bone turns by the shortest arc from its gallop at t towards its trot at t, by the share w; the root moves along the line between both.

use std::f64::consts::TAU;

use nalgebra::Isometry3;

use super::animals::{Animal, Pose, Puppet};
use super::motion::Motion;
use super::{SyntheticError, gallop, trot};

/// Number of frames of `@roam`, where none is asked for.
pub const FRAMES: usize = 240;
/// Number of frames of `@roam-small`, where none is asked for.
pub const SMALL_FRAMES: usize = 40;

pub(super) fn motion(animal: Animal) -> Result<Motion, SyntheticError> {
    let puppet = Puppet::new(animal);
    let faces = puppet.faces().to_vec();
    Motion::new(&faces, move |frame| puppet.take(&pose(frame as f64)))
}

/// The pose of any quadruped `at` frames into the motion (0-based, and between frames too).
pub fn pose(at: f64) -> Pose {
    let share = 0.5 + 0.5 * (TAU * at / (61.0 * 2f64.sqrt())).sin();
    let beat = at + 2.4 * (TAU * at / (37.0 * 3f64.sqrt())).sin();
    let (mut pose, other) = (gallop::pose(beat), trot::pose(beat));
    for (turn, to) in pose.turns.iter_mut().zip(&other.turns) {
        // Both are far less than a half turn from each other, so that there is a shortest arc.
        *turn = turn.slerp(to, share);
    }
    let (from, to) = (pose.root.translation.vector, other.root.translation.vector);
    let between = from.lerp(&to, share);
    pose.root = Isometry3::translation(between.x, between.y, between.z);
    pose
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};

    #[test]
    fn the_skin_is_a_closed_sphere_with_an_inside() {
        for name in ["@roam", "@roam-small"] {
            checks::assert_sphere(&embedded(name).unwrap());
        }
    }

    #[test]
    fn no_frame_is_another_one_however_long_it_goes_on() {
        let roam = embedded("@roam-small:1500").unwrap();
        let scale = checks::diagonal(roam.frame(0)) * (roam.dimension() as f64 / 3.0).sqrt();
        for i in 0..roam.frame_count() {
            for j in (0..i).filter(|j| (i - j) % 24 < 2 || (i - j) % 32 < 2) {
                let apart = checks::distance(&roam, i, j) / scale;
                assert!(apart > 1e-4, "{i} {j}: {apart}");
            }
        }
    }
}
