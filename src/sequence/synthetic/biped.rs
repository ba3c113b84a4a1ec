//! A person: bones and the solid around them, standing with arms held out and legs a little apart.
//!
//! The right side is +z. The angles of a pose say how far they turn from there.

use nalgebra::Vector3;

use super::body::Body;
use super::implicit::Cone;

pub(super) const PELVIS: usize = 0;
pub(super) const CHEST: usize = 1;
pub(super) const HEAD: usize = 2;
/// The first bone of each arm, left then right: upper arm, forearm and hand follow each other.
pub(super) const ARMS: [usize; 2] = [3, 6];
/// The first bone of each leg, left then right: thigh, shank and foot follow each other.
pub(super) const LEGS: [usize; 2] = [9, 12];
/// Number of bones.
pub(super) const BONES: usize = 15;

/// Hip, knee, ankle and ball of the right foot.
pub(super) const LEG: [[f64; 3]; 4] = [
    [0.0, 0.93, 0.10],
    [0.01, 0.50, 0.165],
    [-0.02, 0.09, 0.22],
    [0.13, 0.045, 0.245],
];
const LEG_RADII: [[f64; 2]; 3] = [[0.095, 0.064], [0.064, 0.045], [0.05, 0.042]];

/// Shoulder, elbow, wrist and finger tips of the right arm.
const ARM: [[f64; 3]; 4] = [
    [-0.01, 1.39, 0.19],
    [-0.02, 1.39, 0.46],
    [-0.01, 1.39, 0.70],
    [0.0, 1.385, 0.84],
];
const ARM_RADII: [[f64; 2]; 3] = [[0.066, 0.05], [0.05, 0.037], [0.042, 0.036]];

/// A cone of the trunk or head in the plane z = 0: its bone, its ends, the radii there, its width over its depth, its blend.
type Part = (usize, [[f64; 2]; 2], [f64; 2], f64, f64);

const TRUNK: [Part; 5] = [
    (
        PELVIS,
        [[0.0, 0.94], [0.0, 1.02]],
        [0.115, 0.105],
        1.45,
        0.1,
    ),
    (
        CHEST,
        [[0.0, 1.08], [-0.005, 1.22]],
        [0.098, 0.115],
        1.4,
        0.1,
    ),
    (
        CHEST,
        [[-0.005, 1.22], [-0.01, 1.36]],
        [0.118, 0.105],
        1.6,
        0.1,
    ),
    // shoulders
    (
        CHEST,
        [[-0.01, 1.38], [-0.01, 1.41]],
        [0.075, 0.07],
        2.2,
        0.08,
    ),
    (
        HEAD,
        [[-0.005, 1.44], [0.015, 1.56]],
        [0.058, 0.055],
        1.0,
        0.06,
    ),
];
const SKULL: [Part; 3] = [
    (
        HEAD,
        [[0.02, 1.67], [0.03, 1.66]],
        [0.112, 0.11],
        0.86,
        0.05,
    ),
    // jaw and nose
    (
        HEAD,
        [[0.04, 1.62], [0.075, 1.58]],
        [0.075, 0.05],
        0.95,
        0.05,
    ),
    (
        HEAD,
        [[0.125, 1.655], [0.14, 1.635]],
        [0.016, 0.022],
        1.0,
        0.03,
    ),
];

/// Builds the person; `stout` is a factor of the radii of the limbs.
pub(super) fn biped(stout: f64) -> Body {
    let mut body = Body::default();
    let pelvis = body.bone(None, Vector3::new(0.0, 0.96, 0.0));
    let chest = body.bone(Some(pelvis), Vector3::new(-0.01, 1.08, 0.0));
    body.bone(Some(chest), Vector3::new(0.0, 1.47, 0.0));
    for part in &TRUNK {
        add_part(&mut body, part);
    }
    for part in &SKULL {
        add_part(&mut body, part);
    }
    for side in [-1.0, 1.0] {
        add_limb(&mut body, chest, &ARM, ARM_RADII, [side, stout]);
    }
    for side in [-1.0, 1.0] {
        add_limb(&mut body, pelvis, &LEG, LEG_RADII, [side, stout]);
    }
    body
}

fn add_part(body: &mut Body, &(bone, ends, radii, flatten, blend): &Part) {
    let [from, to] = ends.map(|[x, y]| Vector3::new(x, y, 0.0));
    let cone = Cone {
        from,
        to,
        from_radius: radii[0],
        to_radius: radii[1],
        flatten,
        blend,
    };
    body.cone(bone, cone);
}

fn add_limb(
    body: &mut Body,
    parent: usize,
    joints: &[[f64; 3]; 4],
    radii: [[f64; 2]; 3],
    [side, stout]: [f64; 2],
) {
    let apart = side * (1.0 + 0.2 * (stout - 1.0));
    let joints = joints.map(|[x, y, z]| Vector3::new(x, y, z * apart));
    let mut parent = parent;
    for i in 0..3 {
        parent = body.bone(Some(parent), joints[i]);
        let [from_radius, to_radius] = radii[i].map(|r| r * stout);
        let cone = Cone {
            from: joints[i],
            to: joints[i + 1],
            from_radius,
            to_radius,
            flatten: 1.0,
            blend: [0.06, 0.04, 0.03][i],
        };
        body.cone(parent, cone);
    }
}
