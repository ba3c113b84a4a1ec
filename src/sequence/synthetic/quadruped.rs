//! An articulated quadruped: its bones, the solid around them, and the skin that follows them.
//!
//! x is forward, y up, z to its right; the ground is y = 0. Limbs bend in planes of constant z: a positive angle about z swings a hanging
//! limb forward and lifts a nose.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

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
    /// Names and places near the skin at rest.
    pub landmarks: Vec<(&'static str, Vector3<f64>)>,
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
        self.landmarks.extend([
            ("croup", sagittal(-0.55, 1.5)),
            ("loin", sagittal(-0.02, 1.45)),
            ("withers", sagittal(0.4, 1.52)),
            ("belly", sagittal(-0.02, 0.9)),
            ("breast", sagittal(0.83, 1.16)),
        ]);
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
            self.cone(head, ear, [0.05, 0.03].map(|r| r * stout), [1.0, 0.04]);
        }
        self.landmarks.extend([
            ("poll", sagittal(0.99, 2.0)),
            ("nose", sagittal(1.5, 1.5)),
            ("throat", sagittal(1.02, 1.68)),
        ]);
    }

    fn add_tail(&mut self, stout: f64) {
        let joints = [
            sagittal(-0.80, 1.36),
            sagittal(-0.98, 1.24),
            sagittal(-1.09, 0.96),
            sagittal(-1.14, 0.62),
        ];
        let radii = [0.055, 0.07, 0.08, 0.045].map(|r| r * stout);
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
        self.landmarks.extend([
            ("dock", joints[0] + sagittal(0.0, 0.1)),
            ("tail_tip", joints[3] - sagittal(0.0, 0.1)),
        ]);
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
        let outward = Vector3::z() * (0.3 * side);
        let places = joints.iter().map(|joint| joint + outward);
        self.landmarks.extend(names.into_iter().zip(places));
    }

    /// The skin at rest.
    pub fn skin(&self, spacing: f64) -> Surface {
        surface_nets::polygonise(&self.solid, spacing)
    }

    /// The index of the vertex nearest to each landmark; ties go to the lower index.
    pub fn marked(&self, points: &[Vector3<f64>]) -> Vec<(&'static str, u32)> {
        let nearest = |place: &Vector3<f64>| {
            let distance = |v: &usize| (points[*v] - place).norm_squared();
            (0..points.len())
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .unwrap_or(0)
        };
        self.landmarks
            .iter()
            .map(|(name, place)| (*name, nearest(place) as u32))
            .collect()
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
    radii: [0.20, 0.115, 0.062, 0.05, 0.065],
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
    radii: [0.16, 0.105, 0.065, 0.05, 0.065],
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

/// How much each vertex follows each bone, V x bones row-major; each row sums to 1.
pub(super) struct Weights {
    bones: usize,
    values: Vec<f64>,
}

impl Weights {
    /// Starts from the nearest cone's bone and lets the weights diffuse along the surface over about `reach`.
    ///
    /// As they travel along the surface and not through space, one leg never drags the other along.
    pub fn new(animal: &Animal, skin: &Surface, spacing: f64, reach: f64) -> Self {
        let bones = animal.bones.len();
        let mut values = vec![0.0; skin.points.len() * bones];
        for (row, point) in values.chunks_exact_mut(bones).zip(&skin.points) {
            row[nearest_bone(animal, point)] = 1.0;
        }
        let mut weights = Self { bones, values };
        for _ in 0..(reach / spacing).powi(2).ceil() as usize {
            weights.diffuse(&skin.faces);
        }
        weights
    }

    /// One step: half of each row stays, half is the mean over the neighbours.
    fn diffuse(&mut self, faces: &[[u32; 3]]) {
        let bones = self.bones;
        let mut sums = vec![0.0; self.values.len()];
        let mut counts = vec![0.0; self.values.len() / bones];
        for face in faces {
            for i in 0..3 {
                let (to, from) = (face[i] as usize, face[(i + 1) % 3] as usize);
                counts[to] += 1.0;
                for bone in 0..bones {
                    sums[to * bones + bone] += self.values[from * bones + bone];
                }
            }
        }
        for (i, value) in self.values.iter_mut().enumerate() {
            *value = 0.5 * (*value + sums[i] / counts[i / bones]);
        }
    }

    /// The skin moved by its bones: blended unit dual quaternions (Kavan et al. 2007), which keep limbs round at their joints.
    pub fn skin(&self, rest: &[Vector3<f64>], placed: &[Isometry3<f64>]) -> Vec<Vector3<f64>> {
        let motions: Vec<_> = placed.iter().map(dual_quaternion).collect();
        let rows = self.values.chunks_exact(self.bones);
        rows.zip(rest)
            .map(|(row, point)| blend(row, &motions, point))
            .collect()
    }
}

fn nearest_bone(animal: &Animal, point: &Vector3<f64>) -> usize {
    let values = animal.solid.cones.iter().map(|cone| cone.value(point));
    let nearest = values.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
    animal.owner[nearest.map_or(0, |(cone, _)| cone)]
}

type DualQuaternion = (Quaternion<f64>, Quaternion<f64>);

fn dual_quaternion(motion: &Isometry3<f64>) -> DualQuaternion {
    let rotation = motion.rotation.into_inner();
    let dual = Quaternion::from_imag(motion.translation.vector) * rotation * 0.5;
    (rotation, dual)
}

fn blend(weights: &[f64], motions: &[DualQuaternion], point: &Vector3<f64>) -> Vector3<f64> {
    let zero = Quaternion::from_imag(Vector3::zeros());
    let (mut real, mut dual) = (zero, zero);
    for (&weight, motion) in weights.iter().zip(motions) {
        let signed = if real.dot(&motion.0) < 0.0 {
            -weight
        } else {
            weight
        };
        real += motion.0 * signed;
        dual += motion.1 * signed;
    }
    let rotation = UnitQuaternion::new_normalize(real);
    let scale = 1.0 / real.norm();
    let shift = (dual * scale * rotation.into_inner().conjugate()).imag() * 2.0;
    rotation * point + shift
}
