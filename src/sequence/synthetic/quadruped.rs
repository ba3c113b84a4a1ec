//! An articulated quadruped: its bones, the solid around them and its joint markers, from a table of places.
//!
//! Limbs bend in planes of constant z: a positive angle about z swings a hanging limb forward and lifts a nose. All quadrupeds have the same
//! bones and the same markers, so what one does another can do.

use std::f64::consts::TAU;

use nalgebra::{UnitQuaternion, Vector3};

use super::body::{Body, Landmark};
use super::implicit::Cone;

pub(super) const TORSO: usize = 0;
pub(super) const CHEST: usize = 1;
pub(super) const NECK: usize = 2;
pub(super) const HEAD: usize = 3;
pub(super) const TAIL: [usize; 3] = [4, 5, 6];
/// The first bone of each leg: left hind, right hind, left fore, right fore. Upper, middle, lower bone and hoof follow each other.
pub(super) const LEGS: [usize; 4] = [7, 11, 15, 19];
/// Number of bones.
pub(super) const BONES: usize = 23;

/// Where everything is in an animal at rest, standing; places in the plane z = 0 have two coordinates.
pub(super) struct Anatomy {
    /// How long its legs are, those of the horse being 1: how far the whole body moves in a pose.
    pub size: f64,
    /// Pivots of torso, chest, neck and head.
    pub pivots: [[f64; 2]; 4],
    /// Trunk and neck.
    pub trunk: &'static [Part],
    pub head: &'static [Part],
    /// Root and tip of the right ear, and the radii there.
    pub ear: ([[f64; 3]; 2], [f64; 2]),
    pub tail: ([[f64; 2]; 4], [f64; 4]),
    pub hind: Leg,
    pub fore: Leg,
    /// A place inside and a direction for each marker of trunk and head.
    pub marks: [[[f64; 2]; 2]; 8],
}

/// A cone in the plane z = 0 and the bone that it goes with.
pub(super) struct Part {
    pub bone: usize,
    pub ends: [[f64; 2]; 2],
    pub radii: [f64; 2],
    pub flatten: f64,
    pub blend: f64,
}

pub(super) const fn part(
    bone: usize,
    ends: [[f64; 2]; 2],
    radii: [f64; 2],
    flatten: f64,
    blend: f64,
) -> Part {
    Part {
        bone,
        ends,
        radii,
        flatten,
        blend,
    }
}

/// A right leg: hip or shoulder, then joint by joint down to the hoof, and how far each bone's cone blends with the others.
pub(super) struct Leg {
    pub joints: [[f64; 3]; 5],
    pub radii: [f64; 5],
    pub blends: [f64; 4],
}

/// Builds an animal; `limb` is how stout its limbs are, a factor of their radii.
pub(super) fn quadruped(anatomy: &Anatomy, limb: f64) -> Body {
    let mut body = Body::default();
    let half = 0.5 + 0.5 * limb;
    add_trunk(&mut body, anatomy, half);
    add_tail(&mut body, anatomy, half);
    for (side, names) in [(-1.0, HIND_NAMES[0]), (1.0, HIND_NAMES[1])] {
        add_leg(&mut body, TORSO, &anatomy.hind, side, limb, names);
    }
    for (side, names) in [(-1.0, FORE_NAMES[0]), (1.0, FORE_NAMES[1])] {
        add_leg(&mut body, CHEST, &anatomy.fore, side, limb, names);
    }
    body
}

fn sagittal([x, y]: [f64; 2]) -> Vector3<f64> {
    Vector3::new(x, y, 0.0)
}

/// The cone of a bone from one place to another; `shape` is how flat it is sideways and how far it blends.
fn cone(
    ends: [Vector3<f64>; 2],
    [from_radius, to_radius]: [f64; 2],
    [flatten, blend]: [f64; 2],
) -> Cone {
    Cone {
        from: ends[0],
        to: ends[1],
        from_radius,
        to_radius,
        flatten,
        blend,
    }
}

fn add_trunk(body: &mut Body, anatomy: &Anatomy, stout: f64) {
    let mut parent = None;
    for pivot in anatomy.pivots {
        parent = Some(body.bone(parent, sagittal(pivot)));
    }
    let mut add = |part: &Part, stout: f64| {
        let radii = part.radii.map(|r| r * stout);
        let shape = [part.flatten, part.blend];
        body.cone(part.bone, cone(part.ends.map(sagittal), radii, shape));
    };
    anatomy.trunk.iter().for_each(|part| add(part, 1.0));
    anatomy.head.iter().for_each(|part| add(part, stout));
    let (ends, radii) = anatomy.ear;
    for side in [-1.0, 1.0] {
        let ends = ends.map(|[x, y, z]| Vector3::new(x, y, z * side));
        body.cone(HEAD, cone(ends, radii.map(|r| r * stout), [1.0, 0.04]));
    }
    for (name, mark) in TRUNK_NAMES.into_iter().zip(anatomy.marks) {
        let [inside, towards] = mark.map(sagittal);
        add_landmark(body, name, inside, towards);
    }
}

fn add_tail(body: &mut Body, anatomy: &Anatomy, stout: f64) {
    let joints = anatomy.tail.0.map(sagittal);
    let radii = anatomy.tail.1.map(|r| r * stout);
    let mut parent = TORSO;
    for i in 0..3 {
        parent = body.bone(Some(parent), joints[i]);
        let ends = [joints[i], joints[i + 1]];
        body.cone(parent, cone(ends, [radii[i], radii[i + 1]], [0.9, 0.06]));
    }
    add_landmark(body, "dock", joints[0], Vector3::y());
    add_landmark(body, "tail_tip", joints[3], joints[3] - joints[2]);
}

fn add_leg(
    body: &mut Body,
    parent: usize,
    leg: &Leg,
    side: f64,
    stout: f64,
    names: [&'static str; 5],
) {
    let place = |[x, y, z]: [f64; 3]| Vector3::new(x, y, z * side * (1.0 + 0.4 * (stout - 1.0)));
    let joints = leg.joints.map(place);
    let mut parent = parent;
    for i in 0..4 {
        parent = body.bone(Some(parent), joints[i]);
        // the upper bone is in the flesh of the trunk, which stays as it is
        let stout = if i == 0 { 1.0 } else { stout };
        let radii = [leg.radii[i], leg.radii[i + 1]].map(|r| r * stout);
        let ends = [joints[i], joints[i + 1]];
        body.cone(parent, cone(ends, radii, [0.85, leg.blends[i]]));
    }
    for (name, joint) in names.into_iter().zip(&joints[..4]) {
        add_landmark(body, name, *joint, Vector3::z() * side);
    }
    add_landmark(body, names[4], joints[4], joints[4] - joints[3]);
}

fn add_landmark(body: &mut Body, name: &'static str, inside: Vector3<f64>, towards: Vector3<f64>) {
    body.landmarks.push(Landmark {
        name,
        inside,
        towards,
    });
}

/// A smooth bump of height 1 and of period 1, about a third of a period wide, at 0.
pub(super) fn bump(at: f64) -> f64 {
    (2.2 * ((TAU * at).cos() - 1.0)).exp()
}

/// The rotation of a bone in its plane of constant z.
pub(super) fn about_z(degrees: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), degrees.to_radians())
}

const TRUNK_NAMES: [&str; 8] = [
    "croup", "loin", "withers", "belly", "breast", "poll", "nose", "throat",
];
const HIND_NAMES: [[&str; 5]; 2] = [
    [
        "left_hip",
        "left_stifle",
        "left_hock",
        "left_hind_fetlock",
        "left_hind_hoof",
    ],
    [
        "right_hip",
        "right_stifle",
        "right_hock",
        "right_hind_fetlock",
        "right_hind_hoof",
    ],
];
const FORE_NAMES: [[&str; 5]; 2] = [
    [
        "left_shoulder",
        "left_elbow",
        "left_knee",
        "left_fore_fetlock",
        "left_fore_hoof",
    ],
    [
        "right_shoulder",
        "right_elbow",
        "right_knee",
        "right_fore_fetlock",
        "right_fore_hoof",
    ],
];
