//! `@gallop`: a quadruped that gallops in place.
//!
//! 24 frames are two cycles of 12 in a transverse gallop (left hind, right hind, left fore, right fore, flight), alike but not equal: a
//! stride's strength and timing drift over both cycles and close after 24 frames, like the horse of Cashman & Hormann 2012, Figure 1. The
//! root does not travel; it bobs, surges and pitches. The skin is closed and of genus 0.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::SyntheticError;
use super::animals::{Animal, Pose, posed};
use super::quadruped::{BONES, CHEST, HEAD, LEGS, NECK, TAIL, TORSO, about_z, bump};
use crate::sequence::Sequence;

/// Number of frames of `@gallop` and of `@gallop-small`: two cycles.
pub const FRAMES: usize = 24;
/// Number of frames of one cycle.
pub const CYCLE: usize = 12;

pub(super) fn build(animal: Animal) -> Result<Sequence, SyntheticError> {
    let poses: Vec<Pose> = (0..FRAMES).map(|i| pose(i as f64)).collect();
    posed(animal, &poses)
}

/// The pose of any quadruped `at` frames into the gallop (0-based, and between frames too); it repeats after 24.
pub fn pose(at: f64) -> Pose {
    let drift = TAU * at / FRAMES as f64;
    let vigour = 1.0 + 0.09 * (drift + 0.7).sin();
    let phase = at / CYCLE as f64 + 0.018 * (drift + 2.0).sin();
    let wave = |lag: f64| (TAU * (phase - lag)).cos();
    let mut pose = Pose::rest(BONES);

    let mut turn = |bone: usize, degrees: f64| pose.turns[bone] = about_z(vigour * degrees);
    turn(TORSO, -6.0 * wave(0.62));
    turn(CHEST, 9.0 * wave(0.12));
    turn(NECK, -9.0 * wave(0.60) - 8.0);
    turn(HEAD, 7.0 * wave(0.72) + 4.0);
    for (i, bone) in TAIL.into_iter().enumerate() {
        let lift = [-20.0, -6.0, -2.0][i];
        turn(bone, lift + 11.0 * wave(0.2 + 0.14 * i as f64));
    }
    for (leg, first) in LEGS.into_iter().enumerate() {
        let at = phase - [0.0, 0.12, 0.42, 0.56][leg];
        let angles = if leg < 2 { hind_leg(at) } else { fore_leg(at) };
        for (i, degrees) in angles.into_iter().enumerate() {
            turn(first + i, degrees);
        }
    }
    sway(&mut pose.turns, drift, phase);
    let bob = Vector3::new(0.025 * wave(0.4), 0.02 + 0.06 * vigour * wave(0.92), 0.0);
    pose.root = Isometry3::translation(bob.x, bob.y, bob.z);
    pose
}

/// Turns tail and neck a little to the sides.
fn sway(rotations: &mut [UnitQuaternion<f64>], drift: f64, phase: f64) {
    for (bone, degrees) in [(NECK, 2.0), (TAIL[0], 7.0), (TAIL[1], 6.0), (TAIL[2], 6.0)] {
        let angle = degrees * ((TAU * phase - 0.5 * bone as f64).sin() + 0.5 * drift.cos());
        let aside = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle.to_radians());
        rotations[bone] = aside * rotations[bone];
    }
}

/// Degrees of thigh, shank, cannon and hoof at `at` cycles after the leg reaches furthest forward.
fn hind_leg(at: f64) -> [f64; 4] {
    let swing = bump(at - 0.77);
    [
        -6.0 + 36.0 * (TAU * at).cos() + 14.0 * bump(at - 0.84),
        2.0 - 16.0 * (TAU * (at + 0.05)).cos() - 38.0 * swing,
        -6.0 + 8.0 * (TAU * at).sin() + 58.0 * swing,
        14.0 * bump(at - 0.3) - 45.0 * bump(at - 0.68),
    ]
}

/// Degrees of upper arm, forearm, cannon and hoof at `at` cycles after the leg reaches furthest forward.
fn fore_leg(at: f64) -> [f64; 4] {
    let swing = bump(at - 0.72);
    [
        2.0 + 26.0 * (TAU * at).cos(),
        4.0 + 12.0 * (TAU * (at - 0.05)).cos() + 38.0 * swing,
        -2.0 - 88.0 * swing,
        16.0 * bump(at - 0.25) - 48.0 * bump(at - 0.70),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded, markers};
    use super::{CYCLE, FRAMES, Vector3};

    #[test]
    fn the_skin_is_a_closed_sphere_with_an_inside() {
        for name in ["@gallop", "@gallop-small"] {
            checks::assert_sphere(&embedded(name).unwrap());
        }
    }

    #[test]
    fn the_second_cycle_resembles_the_first_but_differs() {
        let sequence = embedded("@gallop").unwrap();
        let distance = |i: usize, j: usize| checks::distance(&sequence, i, j);
        for i in 0..CYCLE {
            let (across, along) = (distance(i, i + CYCLE), distance(i, (i + 6) % FRAMES));
            assert!(across < 0.35 * along, "{i}: {across} {along}");
            assert!(across > 0.02 * along, "{i}: {across} {along}");
        }
    }

    #[test]
    fn it_gallops_in_place() {
        let sequence = embedded("@gallop").unwrap();
        for i in 0..FRAMES {
            let points = checks::points(sequence.frame(i));
            let centre: Vector3<f64> = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
            assert!(
                centre.x.abs() < 0.25 && (0.7..1.4).contains(&centre.y) && centre.z.abs() < 0.02
            );
            let lowest = points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
            assert!(lowest > -0.15, "frame {i}: {lowest}");
        }
    }

    #[test]
    fn the_volume_hardly_changes() {
        let sequence = embedded("@gallop").unwrap();
        let first = checks::volume(&sequence, 0);
        for i in 1..FRAMES {
            let ratio = checks::volume(&sequence, i) / first;
            assert!((ratio - 1.0).abs() < 0.08, "frame {i}: {ratio}");
        }
    }

    #[test]
    fn markers_are_distinct_vertices_with_the_same_names_in_both_sizes() {
        let (full, small) = (
            markers("@gallop").unwrap(),
            markers("@gallop-small").unwrap(),
        );
        assert!(full.iter().map(|m| m.name).eq(small.iter().map(|m| m.name)));
        for (name, markers) in [("@gallop", full), ("@gallop-small", small)] {
            let count = embedded(name).unwrap().connectivity().vertex_count();
            let mut vertices: Vec<u32> = markers.iter().map(|m| m.vertex).collect();
            assert!(vertices.iter().all(|&v| (v as usize) < count));
            vertices.sort_unstable();
            vertices.dedup();
            assert_eq!(vertices.len(), markers.len(), "{name}");
        }
    }

    #[test]
    fn markers_lie_on_their_sides() {
        let sequence = embedded("@gallop").unwrap();
        let points = checks::points(sequence.frame(0));
        for marker in markers("@gallop").unwrap() {
            let z = points[marker.vertex as usize].z;
            match marker.name.split_once('_') {
                Some(("left", _)) => assert!(z < -0.1, "{}", marker.name),
                Some(("right", _)) => assert!(z > 0.1, "{}", marker.name),
                _ => assert!(z.abs() < 0.1, "{}", marker.name),
            }
        }
    }
}
