//! An articulated quadruped: its bones and the solid around them.
//!
//! x is forward, y up, z to its right; the ground is y = 0. Limbs bend in planes of constant z: a positive angle about z swings a hanging
//! limb forward and lifts a nose.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::implicit::{Cone, Solid};
use super::surface_nets::{self, Surface};

/// A bone turns about its pivot relative to its parent; parents come before their children.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bone {
    pub parent: Option<usize>,
    pub pivot: Vector3<f64>,
}

/// Bones, the cones around them (each with its bone) and named places on the skin.
pub(super) struct Animal {
    pub bones: Vec<Bone>,
    pub solid: Solid,
    /// The bone of each cone of `solid`.
    pub owner: Vec<usize>,
    pub landmarks: Vec<Landmark>,
}

/// A named place of the skin at rest: where the ray from a point inside leaves the solid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Landmark {
    pub name: &'static str,
    inside: Vector3<f64>,
    towards: Vector3<f64>,
}

pub(super) const TORSO: usize = 0;
pub(super) const CHEST: usize = 1;
pub(super) const NECK: usize = 2;
pub(super) const HEAD: usize = 3;
pub(super) const TAIL: [usize; 3] = [4, 5, 6];
/// The first bone of each leg: left hind, right hind, left fore, right fore. Upper, middle, lower bone and hoof follow each other.
pub(super) const LEGS: [usize; 4] = [7, 11, 15, 19];

/// How stout the animal is: a factor of the radii of its limbs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Build {
    pub limb: f64,
}

fn sagittal(x: f64, y: f64) -> Vector3<f64> {
    Vector3::new(x, y, 0.0)
}

impl Animal {
    /// Assembles the animal at rest, standing.
    pub fn new(build: Build) -> Self {
        let solid = Solid { cones: Vec::new() };
        let mut animal = Self {
            bones: Vec::new(),
            solid,
            owner: Vec::new(),
            landmarks: Vec::new(),
        };
        animal.add_trunk();
        animal.add_head(0.5 + 0.5 * build.limb);
        animal.add_tail(0.5 + 0.5 * build.limb);
        for (side, names) in [(-1.0, HIND_NAMES[0]), (1.0, HIND_NAMES[1])] {
            animal.add_leg(TORSO, &HIND, side, build.limb, names);
        }
        for (side, names) in [(-1.0, FORE_NAMES[0]), (1.0, FORE_NAMES[1])] {
            animal.add_leg(CHEST, &FORE, side, build.limb, names);
        }
        animal
    }

    fn bone(&mut self, parent: Option<usize>, pivot: Vector3<f64>) -> usize {
        self.bones.push(Bone { parent, pivot });
        self.bones.len() - 1
    }

    fn cone(
        &mut self,
        bone: usize,
        ends: [Vector3<f64>; 2],
        radii: [f64; 2],
        [flatten, blend]: [f64; 2],
    ) {
        self.owner.push(bone);
        self.solid.cones.push(Cone {
            from: ends[0],
            to: ends[1],
            from_radius: radii[0],
            to_radius: radii[1],
            flatten,
            blend,
        });
    }

    fn add_trunk(&mut self) {
        let torso = self.bone(None, sagittal(-0.05, 1.18));
        let chest = self.bone(Some(torso), sagittal(0.0, 1.22));
        let (rump, loin, girth) = (
            sagittal(-0.56, 1.22),
            sagittal(-0.02, 1.17),
            sagittal(0.45, 1.18),
        );
        self.cone(torso, [rump, loin], [0.27, 0.265], [0.84, 0.15]);
        self.cone(chest, [loin, girth], [0.265, 0.28], [0.8, 0.15]);
        // withers and breast
        self.cone(
            chest,
            [sagittal(0.30, 1.36), sagittal(0.52, 1.36)],
            [0.12, 0.15],
            [0.8, 0.15],
        );
        self.cone(
            chest,
            [girth, sagittal(0.66, 1.16)],
            [0.24, 0.17],
            [0.85, 0.15],
        );
        let (up, down) = (Vector3::y(), -Vector3::y());
        self.landmark("croup", sagittal(-0.55, 1.2), up);
        self.landmark("loin", sagittal(-0.02, 1.2), up);
        self.landmark("withers", sagittal(0.4, 1.2), up);
        self.landmark("belly", sagittal(-0.02, 1.2), down);
        self.landmark("breast", sagittal(0.5, 1.16), Vector3::x());
    }

    fn add_head(&mut self, stout: f64) {
        let neck = self.bone(Some(CHEST), sagittal(0.55, 1.30));
        let head = self.bone(Some(neck), sagittal(1.05, 1.88));
        let (base, poll, nose) = (
            sagittal(0.58, 1.32),
            sagittal(1.03, 1.86),
            sagittal(1.42, 1.56),
        );
        self.cone(neck, [base, poll], [0.21, 0.115], [0.7, 0.12]);
        // crest: the neck is deeper than it is wide
        self.cone(
            neck,
            [sagittal(0.50, 1.46), sagittal(0.95, 1.92)],
            [0.09, 0.07],
            [0.6, 0.1],
        );
        self.cone(
            head,
            [sagittal(1.07, 1.84), nose],
            [0.135, 0.075].map(|r| r * stout),
            [0.75, 0.07],
        );
        self.cone(
            head,
            [sagittal(1.10, 1.74), sagittal(1.18, 1.68)],
            [0.10, 0.08].map(|r| r * stout),
            [0.7, 0.06],
        );
        for side in [-1.0, 1.0] {
            let ear = [
                Vector3::new(1.02, 1.93, 0.055 * side),
                Vector3::new(1.03, 2.08, 0.10 * side),
            ];
            self.cone(head, ear, [0.055, 0.042].map(|r| r * stout), [1.0, 0.04]);
        }
        self.landmark("poll", sagittal(1.05, 1.84), sagittal(-0.3, 1.0));
        self.landmark("nose", nose, nose - poll);
        self.landmark("throat", sagittal(1.0, 1.8), sagittal(0.4, -1.0));
    }

    fn add_tail(&mut self, stout: f64) {
        let joints = [
            sagittal(-0.80, 1.36),
            sagittal(-0.98, 1.24),
            sagittal(-1.09, 0.96),
            sagittal(-1.14, 0.62),
        ];
        let radii = [0.055, 0.07, 0.08, 0.062].map(|r| r * stout);
        let mut parent = TORSO;
        for i in 0..3 {
            parent = self.bone(Some(parent), joints[i]);
            self.cone(
                parent,
                [joints[i], joints[i + 1]],
                [radii[i], radii[i + 1]],
                [0.9, 0.06],
            );
        }
        self.landmark("dock", joints[0], Vector3::y());
        self.landmark("tail_tip", joints[3], joints[3] - joints[2]);
    }

    fn add_leg(
        &mut self,
        parent: usize,
        leg: &Leg,
        side: f64,
        stout: f64,
        names: [&'static str; 5],
    ) {
        let joints: [Vector3<f64>; 5] = std::array::from_fn(|i| {
            let [x, y, z] = leg.joints[i];
            Vector3::new(x, y, z * side * (1.0 + 0.4 * (stout - 1.0)))
        });
        let mut parent = parent;
        for i in 0..4 {
            parent = self.bone(Some(parent), joints[i]);
            let radii =
                [leg.radii[i], leg.radii[i + 1]].map(|r| if i == 0 { r } else { r * stout });
            self.cone(
                parent,
                [joints[i], joints[i + 1]],
                radii,
                [0.85, leg.blends[i]],
            );
        }
        for (name, joint) in names.into_iter().zip(&joints[..4]) {
            self.landmark(name, *joint, Vector3::z() * side);
        }
        self.landmark(names[4], joints[4], joints[4] - joints[3]);
    }

    fn landmark(&mut self, name: &'static str, inside: Vector3<f64>, towards: Vector3<f64>) {
        self.landmarks.push(Landmark {
            name,
            inside,
            towards: towards.normalize(),
        });
    }

    /// The skin at rest.
    pub fn skin(&self, spacing: f64) -> Surface {
        surface_nets::polygonise(&self.solid, spacing)
    }

    /// The bone of the cone that is nearest to a point of the skin.
    pub fn nearest_bone(&self, point: &Vector3<f64>) -> usize {
        let values = self.solid.cones.iter().map(|cone| cone.value(point));
        let nearest = values.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        self.owner[nearest.map_or(0, |(cone, _)| cone)]
    }

    /// The index of the vertex nearest to each landmark; ties go to the lower index.
    pub fn marked(&self, points: &[Vector3<f64>]) -> Vec<(&'static str, u32)> {
        let nearest = |place: Vector3<f64>| {
            let distance = |v: &usize| (points[*v] - place).norm_squared();
            let nearer = |a: &usize, b: &usize| distance(a).total_cmp(&distance(b));
            (0..points.len()).min_by(nearer).unwrap_or(0)
        };
        let places = self
            .landmarks
            .iter()
            .map(|mark| (mark.name, self.surfacing(mark)));
        places
            .map(|(name, place)| (name, nearest(place) as u32))
            .collect()
    }

    /// Where the ray of a landmark leaves the solid, to half a centimetre.
    fn surfacing(&self, mark: &Landmark) -> Vector3<f64> {
        let along = (0..200).map(|i| mark.inside + mark.towards * (0.005 * f64::from(i)));
        let mut outside = along.skip_while(|place| self.solid.value(place) < 0.0);
        outside.next().unwrap_or(mark.inside)
    }

    /// Where each bone is, given its rotation relative to its parent and the motion of the root.
    pub fn place(
        &self,
        root: Isometry3<f64>,
        rotations: &[UnitQuaternion<f64>],
    ) -> Vec<Isometry3<f64>> {
        let mut placed: Vec<Isometry3<f64>> = Vec::with_capacity(self.bones.len());
        for (bone, rotation) in self.bones.iter().zip(rotations) {
            let there = Translation3::from(bone.pivot);
            let local = there * *rotation * there.inverse();
            placed.push(bone.parent.map_or(root, |parent| placed[parent]) * local);
        }
        placed
    }
}

struct Leg {
    joints: [[f64; 3]; 5],
    radii: [f64; 5],
    blends: [f64; 4],
}

const HIND: Leg = Leg {
    joints: [
        [-0.62, 1.12, 0.15],
        [-0.45, 0.80, 0.16],
        [-0.72, 0.50, 0.15],
        [-0.66, 0.16, 0.15],
        [-0.58, 0.05, 0.15],
    ],
    radii: [0.20, 0.115, 0.065, 0.055, 0.07],
    blends: [0.12, 0.08, 0.05, 0.04],
};
const FORE: Leg = Leg {
    joints: [
        [0.52, 1.05, 0.14],
        [0.44, 0.80, 0.15],
        [0.46, 0.46, 0.15],
        [0.45, 0.16, 0.15],
        [0.52, 0.05, 0.15],
    ],
    radii: [0.16, 0.105, 0.065, 0.055, 0.07],
    blends: [0.12, 0.08, 0.05, 0.04],
};
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
