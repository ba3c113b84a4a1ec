//! `@character`: a person who does two jumping jacks, bows and twists, and marches in place.
//!
//! As many vertices (3835) and frames (99) as the sequence of Cashman & Hormann 2012, Figure 5 and the third row of Table 1 (d = 11505).
//! A closed surface net has a quad for each crossed edge of its grid, an even number, so one of genus 0 never has an odd number of vertices:
//! the net of this body has 3828, and its seven longest edges are split. Arms turn by up to 150 degrees. The lower foot is on the ground,
//! but for the jumps.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector3};

use super::biped::{ARMS, BONES, CHEST, HEAD, LEG, LEGS, PELVIS, biped};
use super::body::{Body, Pose, about};
use super::implicit::smooth_minimum;
use super::skin::Weights;
use super::{SyntheticError, assemble, smoothstep};
use crate::sequence::Sequence;

pub(super) struct Size {
    spacing: f64,
    /// Number of vertices to refine the surface net to.
    vertices: usize,
    /// A factor of the radii of the limbs.
    limb: f64,
    /// Every how many frames of the film one is kept.
    every: usize,
}

pub(super) const FULL: Size = Size {
    spacing: 0.02707,
    vertices: 3835,
    limb: 1.0,
    every: 1,
};
pub(super) const SMALL: Size = Size {
    spacing: 0.072,
    vertices: 0,
    limb: 1.4,
    every: 3,
};

/// Number of frames of the film, of which `@character` keeps all.
const FILM: usize = 99;
/// How far along the skin a bone's pull fades into the next one's.
const REACH: f64 = 0.07;

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let body = biped(size.limb);
    let mut skin = body.skin(size.spacing);
    skin.refine(&body.solid, size.vertices);
    let weights = Weights::new(&body, &skin, size.spacing, REACH);
    let frames: Vec<_> = (0..FILM)
        .step_by(size.every)
        .map(|i| weights.skin(&skin.points, &body.place(&pose(i as f64, &body))))
        .collect();
    assemble(skin.faces, &frames)
}

/// Degrees that the joints of both sides turn by, and how high the person jumps.
#[derive(Default)]
struct Joints {
    /// Of the whole trunk about z (a bow is negative), of the chest about y.
    bow: f64,
    twist: f64,
    nod: f64,
    /// How far each arm is raised from hanging down (90: held out) and brought forward, and each elbow bent.
    raise: [f64; 2],
    reach: [f64; 2],
    elbow: [f64; 2],
    /// How far each leg is put out from rest and swung forward, and each knee bent.
    spread: f64,
    swing: [f64; 2],
    knee: [f64; 2],
    hop: f64,
}

/// The pose `at` frames into the film (0-based).
fn pose(at: f64, body: &Body) -> Pose {
    let mut joints = Joints {
        raise: [8.0; 2],
        elbow: [12.0; 2],
        spread: -5.0,
        ..sway(at)
    };
    jump(&mut joints, at / 26.0, window(0.0, 52.0, at));
    bow(&mut joints, (at - 50.0) / 26.0, window(50.0, 76.0, at));
    march(&mut joints, (at - 74.0) / 14.0, window(74.0, 98.0, at));
    ground(joints.pose(), joints.hop, body)
}

/// Shifts from foot to foot in no rhythm of the exercise, so that no frame is the copy of another.
fn sway(at: f64) -> Joints {
    Joints {
        bow: 2.0 * (0.137 * at).sin(),
        twist: 3.0 * (0.0911 * at + 1.0).sin(),
        nod: 2.0 * (0.213 * at).cos(),
        ..Joints::default()
    }
}

/// Fades in after `from` and out before `to`, over six frames each.
fn window(from: f64, to: f64, at: f64) -> f64 {
    smoothstep(from, from + 6.0, at) * (1.0 - smoothstep(to - 6.0, to, at))
}

/// Jumping jacks, one a cycle: arms overhead and legs apart in the middle of each, off the ground twice.
fn jump(joints: &mut Joints, cycle: f64, much: f64) {
    let open = much * 0.5 * (1.0 - (TAU * cycle).cos());
    joints.raise = joints.raise.map(|raise| raise + 150.0 * open);
    joints.spread += 26.0 * open;
    let air = (0.5 * (1.0 - (2.0 * TAU * cycle - 0.6).cos())).powi(2);
    joints.hop += 0.13 * much * air;
    for side in 0..2 {
        joints.swing[side] += 16.0 * much * (1.0 - air);
        joints.knee[side] += 32.0 * much * (1.0 - air);
    }
    joints.nod += 6.0 * open;
}

/// Bends the knees and bows with arms held out, twisting to the left, to the right and back.
fn bow(joints: &mut Joints, cycle: f64, much: f64) {
    let down = much * (0.5 * (1.0 - (TAU * cycle).cos()));
    let twist = much * (TAU * 1.5 * cycle).sin();
    joints.bow += 48.0 * down;
    joints.twist += 42.0 * twist;
    joints.nod -= 15.0 * down;
    joints.spread += 9.0 * much;
    for side in 0..2 {
        joints.raise[side] += 80.0 * much;
        joints.swing[side] += 52.0 * down;
        joints.knee[side] += 84.0 * down;
    }
}

/// Marches in place, one step with each leg a cycle, arms against legs; each knee bends a little before its thigh comes up.
fn march(joints: &mut Joints, cycle: f64, much: f64) {
    for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
        let wave = |lead: f64| sign * (TAU * (cycle + lead)).sin();
        let lift = |lead: f64| much * (0.5 * (1.0 + wave(lead))).powi(2);
        joints.swing[side] += 72.0 * lift(0.0) - 6.0 * much;
        joints.knee[side] += 86.0 * lift(0.07);
        joints.reach[side] -= 46.0 * much * wave(0.0);
        joints.elbow[side] += 60.0 * much;
        joints.raise[side] += 6.0 * much;
    }
    joints.twist += 10.0 * much * (TAU * cycle).sin();
    joints.nod += 3.0 * much * (2.0 * TAU * cycle).cos();
}

impl Joints {
    fn pose(&self) -> Pose {
        let mut pose = Pose::rest(BONES);
        let mut turn = |bone: usize, rotation| pose.turns[bone] = rotation;
        // half of a bow is in the hips, which carry the legs along: these turn back
        turn(PELVIS, about(Vector3::z(), -0.5 * self.bow));
        let bend = about(Vector3::z(), -0.5 * self.bow);
        turn(CHEST, bend * about(Vector3::y(), self.twist));
        turn(
            HEAD,
            about(Vector3::z(), self.nod) * about(Vector3::y(), -0.4 * self.twist),
        );
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let [arm, leg] = [ARMS[side], LEGS[side]];
            let raise = about(Vector3::x(), sign * (90.0 - self.raise[side]));
            let reach = about(Vector3::z(), self.reach[side]);
            turn(arm, reach * raise);
            turn(arm + 1, about(Vector3::y(), sign * self.elbow[side]));
            turn(arm + 2, about(Vector3::y(), sign * 0.2 * self.elbow[side]));
            let spread = about(Vector3::x(), -sign * self.spread);
            let swing = about(Vector3::z(), self.swing[side] + 0.5 * self.bow);
            turn(leg, spread * swing);
            turn(leg + 1, about(Vector3::z(), -self.knee[side]));
            turn(
                leg + 2,
                about(Vector3::z(), self.knee[side] - self.swing[side]),
            );
        }
        pose
    }
}

/// Puts the lower foot on the ground, `hop` metres above it.
fn ground(mut pose: Pose, hop: f64, body: &Body) -> Pose {
    let placed = body.place(&pose);
    let rest = LEG[2][1];
    let [left, right] = [0, 1].map(|side| {
        let [x, y, z] = LEG[2];
        let ankle = Vector3::new(x, y, if side == 0 { -z } else { z });
        (placed[LEGS[side] + 2] * Point3::from(ankle)).y
    });
    let lower = smooth_minimum(left, right, 0.03);
    pose.root = Isometry3::translation(0.0, rest - lower + hop, 0.0);
    pose
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};
    use super::*;

    const NAMES: [&str; 2] = ["@character", "@character-small"];

    #[test]
    fn the_skin_is_a_closed_sphere_with_an_inside() {
        for name in NAMES {
            checks::assert_sphere(&embedded(name).unwrap());
        }
    }

    #[test]
    fn it_has_the_size_of_the_third_row_of_table_1() {
        let sequence = embedded("@character").unwrap();
        assert_eq!((sequence.frame_count(), sequence.dimension()), (99, 11505));
        let net = biped(FULL.limb).skin(FULL.spacing);
        assert_eq!(net.points.len(), 3828);
    }

    #[test]
    fn the_volume_hardly_changes() {
        for name in NAMES {
            let sequence = embedded(name).unwrap();
            let first = checks::volume(&sequence, 0);
            for i in 1..sequence.frame_count() {
                let ratio = checks::volume(&sequence, i) / first;
                assert!((ratio - 1.0).abs() < 0.08, "{name} frame {i}: {ratio}");
            }
        }
    }

    #[test]
    fn it_stands_on_the_ground_and_jumps_four_times() {
        let sequence = embedded("@character").unwrap();
        let lowest = |i: usize| {
            let points = checks::points(sequence.frame(i));
            points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min)
        };
        let heights: Vec<f64> = (0..FILM).map(lowest).collect();
        assert!(
            heights.iter().all(|h| (-0.05..0.2).contains(h)),
            "{heights:?}"
        );
        assert!(heights[54..].iter().all(|h| h.abs() < 0.05), "{heights:?}");
        let peak = |h: &&[f64]| h[1] > 0.06 && h[1] > h[0] && h[1] >= h[2];
        assert_eq!(heights.windows(3).filter(peak).count(), 4, "{heights:?}");
    }

    #[test]
    fn arms_go_from_hanging_to_overhead() {
        let body = biped(1.0);
        let heights = (0..FILM).map(|i| {
            let arm = body.place(&pose(i as f64, &body))[ARMS[1]];
            (arm.rotation * Vector3::z()).y
        });
        let heights: Vec<f64> = heights.collect();
        assert!(heights.iter().any(|&y| y > 0.9) && heights.iter().any(|&y| y < -0.9));
    }
}
