//! `@trot`: a hound that trots in place, a quadruped of other proportions and other connectivity than the horse of `@gallop`.
//!
//! 32 frames are two cycles of 16 in which diagonal legs swing together (left hind with right fore, right hind with left fore), alike but
//! not equal, as in `@gallop`; after 32 frames the motion repeats. Bones and markers are those of the horse, so each animal can take every
//! pose of the other: see [`super::animals`].

use std::f64::consts::TAU;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::SyntheticError;
use super::animals::{Animal, Pose, posed};
use super::body::about;
use super::quadruped::{BONES, CHEST, HEAD, LEGS, NECK, TAIL, TORSO, about_z, bump};
use crate::sequence::Sequence;

/// Number of frames of `@trot` and of `@trot-small`: two cycles.
pub const FRAMES: usize = 32;
/// Number of frames of one cycle.
pub const CYCLE: usize = 16;

pub(super) fn build(animal: Animal) -> Result<Sequence, SyntheticError> {
    let poses: Vec<Pose> = (0..FRAMES).map(|i| pose(i as f64)).collect();
    posed(animal, &poses)
}

/// The pose of any quadruped `at` frames into the trot (0-based, and between frames too); it repeats after 32.
pub fn pose(at: f64) -> Pose {
    let drift = TAU * at / FRAMES as f64;
    let vigour = 1.0 + 0.1 * (drift + 0.4).sin();
    let phase = at / CYCLE as f64 + 0.015 * (drift + 1.0).sin();
    let twice = |lag: f64| (2.0 * TAU * (phase - lag)).cos();
    let mut pose = Pose::rest(BONES);

    let mut turn = |bone: usize, degrees: f64| pose.turns[bone] = about_z(vigour * degrees);
    turn(TORSO, 1.5 * twice(0.1));
    turn(CHEST, 2.5 * twice(0.2));
    turn(NECK, 8.0 + 5.0 * twice(0.3));
    turn(HEAD, -6.0 - 5.0 * twice(0.35));
    for (i, bone) in TAIL.into_iter().enumerate() {
        turn(bone, -8.0 + 6.0 * twice(0.1 + 0.08 * i as f64));
    }
    for (leg, first) in LEGS.into_iter().enumerate() {
        let at = phase - [0.0, 0.5, 0.52, 0.02][leg];
        let angles = if leg < 2 { hind_leg(at) } else { fore_leg(at) };
        for (i, degrees) in angles.into_iter().enumerate() {
            turn(first + i, degrees);
        }
    }
    sway(&mut pose.turns, vigour, phase);
    let bob = [0.015 * twice(0.3), -0.02 + 0.045 * vigour * twice(0.12)];
    // rump and chest swing to the same side, so the whole goes to the other
    let aside = -0.04 * vigour * (TAU * phase).cos();
    pose.root = Isometry3::translation(bob[0], bob[1], aside);
    pose
}

/// Swings rump and chest against each other, rolls a little towards the forward hind leg, wags the tail and keeps the head straight.
fn sway(turns: &mut [UnitQuaternion<f64>], vigour: f64, phase: f64) {
    let aside = [
        (TORSO, 4.0, 0.0),
        (CHEST, -8.0, 0.0),
        (NECK, 3.0, 0.05),
        (HEAD, 4.0, 0.1),
        (TAIL[0], 13.0, 0.2),
        (TAIL[1], 13.0, 0.3),
        (TAIL[2], 13.0, 0.4),
    ];
    for (bone, degrees, lag) in aside {
        let angle = vigour * degrees * (TAU * (phase - lag)).cos();
        turns[bone] = about(Vector3::y(), angle) * turns[bone];
    }
    turns[TORSO] *= about(Vector3::x(), 2.0 * (TAU * (phase - 0.2)).cos());
}

/// Degrees of thigh, shank, cannon and paw at `at` cycles after the leg reaches furthest forward.
fn hind_leg(at: f64) -> [f64; 4] {
    let swing = bump(at - 0.76);
    [
        -3.0 + 22.0 * (TAU * at).cos() + 8.0 * swing,
        -8.0 * (TAU * (at + 0.05)).cos() - 30.0 * swing,
        6.0 * (TAU * at).sin() + 44.0 * swing,
        14.0 * bump(at - 0.3) - 40.0 * bump(at - 0.66),
    ]
}

/// Degrees of upper arm, forearm, cannon and paw at `at` cycles after the leg reaches furthest forward.
fn fore_leg(at: f64) -> [f64; 4] {
    let swing = bump(at - 0.74);
    [
        20.0 * (TAU * at).cos(),
        2.0 + 8.0 * (TAU * (at - 0.05)).cos() + 34.0 * swing,
        -2.0 - 72.0 * swing,
        14.0 * bump(at - 0.27) - 42.0 * bump(at - 0.68),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::animals::standing;
    use super::super::{checks, embedded, markers};
    use super::*;

    const NAMES: [&str; 2] = ["@trot", "@trot-small"];

    #[test]
    fn the_skin_is_a_closed_sphere_with_an_inside() {
        for name in NAMES {
            checks::assert_sphere(&embedded(name).unwrap());
        }
    }

    #[test]
    fn the_second_cycle_resembles_the_first_but_differs() {
        let sequence = embedded("@trot").unwrap();
        for i in 0..CYCLE {
            let across = checks::distance(&sequence, i, i + CYCLE);
            let along = checks::distance(&sequence, i, (i + CYCLE / 2) % FRAMES);
            assert!(across < 0.35 * along, "{i}: {across} {along}");
            assert!(across > 0.02 * along, "{i}: {across} {along}");
        }
    }

    #[test]
    fn it_trots_in_place_over_the_ground() {
        let sequence = embedded("@trot").unwrap();
        for i in 0..FRAMES {
            let points = checks::points(sequence.frame(i));
            let centre: Vector3<f64> = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
            assert!(centre.x.abs() < 0.2 && (0.5..0.9).contains(&centre.y));
            assert!(centre.z.abs() < 0.03, "frame {i}: {centre}");
            let lowest = points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
            assert!(lowest.abs() < 0.1, "frame {i}: {lowest}");
        }
    }

    /// The hooves of a diagonal go forward together, and the other diagonal goes back.
    #[test]
    fn diagonal_legs_swing_together() {
        let sequence = embedded("@trot").unwrap();
        let hoof = |name: &str| {
            let markers = markers("@trot").unwrap();
            let vertex = markers.iter().find(|m| m.name == name).unwrap().vertex as usize;
            let x: Vec<f64> = (0..FRAMES).map(|i| sequence.frame(i)[3 * vertex]).collect();
            let mean = x.iter().sum::<f64>() / FRAMES as f64;
            x.into_iter().map(|x| x - mean).collect::<Vec<_>>()
        };
        let hooves = [
            "left_hind_hoof",
            "right_fore_hoof",
            "right_hind_hoof",
            "left_fore_hoof",
        ]
        .map(hoof);
        let alike = |a: usize, b: usize| {
            let dot = |p: &[f64], q: &[f64]| p.iter().zip(q).map(|(p, q)| p * q).sum::<f64>();
            let (a, b) = (&hooves[a], &hooves[b]);
            dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
        };
        assert!(alike(0, 1) > 0.9 && alike(2, 3) > 0.9);
        assert!(alike(0, 2) < -0.8 && alike(1, 3) < -0.8);
    }

    #[test]
    fn markers_lie_on_their_sides_in_the_order_of_the_horse() {
        let names = |name: &str| {
            let markers = markers(name).unwrap().into_iter();
            markers.map(|m| m.name).collect::<Vec<_>>()
        };
        for name in NAMES {
            assert_eq!(names(name), names("@gallop"));
            let markers = markers(name).unwrap();
            let vertices: std::collections::HashSet<u32> =
                markers.iter().map(|m| m.vertex).collect();
            assert_eq!(vertices.len(), markers.len(), "{name}");
        }
        let rest = posed(Animal::Hound, &[standing()]).unwrap();
        let points = checks::points(rest.frame(0));
        for marker in markers("@trot").unwrap() {
            let z = points[marker.vertex as usize].z;
            match marker.name.split_once('_') {
                Some(("left", _)) => assert!(z < -0.1, "{}", marker.name),
                Some(("right", _)) => assert!(z > 0.1, "{}", marker.name),
                _ => assert!(z.abs() < 0.05, "{} {z}", marker.name),
            }
        }
    }
}
