//! The quadrupeds, and any of them in any pose; `@gallop-poses` and `@trot-poses`.
//!
//! Two animals of different proportions and connectivity with the same bones and markers: a pose of one is a pose of the other, which makes the
//! example pairs of deformation transfer (Cashman & Hormann 2012, section 4.3), and the answer to compare a transfer with: the gallop given to
//! the hound is [`posed`]`(Animal::Hound, ..)` in the poses of [`gallop::pose`].

use nalgebra::Vector3;

use super::body::Body;
use super::horse::HORSE;
use super::hound::HOUND;
use super::quadruped::{Anatomy, BONES, quadruped};
use super::skin::Weights;
use super::surface_nets::Surface;
use super::{Marker, SyntheticError, assemble, body, gallop};
use crate::sequence::Sequence;

pub use body::Pose;

/// Whose body and skin it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Animal {
    /// The horse of `@gallop`.
    Horse,
    /// The horse of `@gallop-small`: stouter limbs, fewer vertices.
    SmallHorse,
    /// The hound of `@trot`.
    Hound,
    /// The hound of `@trot-small`: stouter limbs, fewer vertices.
    SmallHound,
}

/// How far along the skin a bone's pull fades into the next one's.
const REACH: f64 = 0.14;

impl Animal {
    /// Its anatomy, how stout its limbs are and the spacing of its vertices.
    fn build(self) -> (&'static Anatomy, f64, f64) {
        match self {
            Self::Horse => (&HORSE, 1.0, 0.046),
            Self::SmallHorse => (&HORSE, 2.0, 0.135),
            Self::Hound => (&HOUND, 1.0, 0.041),
            Self::SmallHound => (&HOUND, 1.9, 0.11),
        }
    }
}

/// The joint markers, in the order of the bones: the same names for every animal.
pub fn markers(animal: Animal) -> Vec<Marker> {
    let (anatomy, limb, spacing) = animal.build();
    let body = quadruped(anatomy, limb);
    let marked = body.marked(&body.skin(spacing).points).into_iter();
    marked
        .map(|(name, vertex)| Marker { name, vertex })
        .collect()
}

/// An animal that can take any pose.
pub(super) struct Puppet {
    body: Body,
    skin: Surface,
    weights: Weights,
    size: f64,
}

impl Puppet {
    pub(super) fn new(animal: Animal) -> Self {
        let (anatomy, limb, spacing) = animal.build();
        let body = quadruped(anatomy, limb);
        let skin = body.skin(spacing);
        Self {
            weights: Weights::new(&body, &skin, spacing, REACH),
            body,
            skin,
            size: anatomy.size,
        }
    }

    /// The faces of its skin.
    pub(super) fn faces(&self) -> &[[u32; 3]] {
        &self.skin.faces
    }

    /// The skin in a pose; how far the whole body moves follows from the length of its legs.
    pub(super) fn take(&self, pose: &Pose) -> Vec<Vector3<f64>> {
        let mut pose = pose.clone();
        pose.root.translation.vector *= self.size;
        self.weights
            .skin(&self.skin.points, &self.body.place(&pose))
    }
}

/// An animal in these poses, one a frame. At least one pose.
pub fn posed(animal: Animal, poses: &[Pose]) -> Result<Sequence, SyntheticError> {
    if poses.is_empty() {
        return Err(SyntheticError::NoFrames);
    }
    let puppet = Puppet::new(animal);
    let frames: Vec<_> = poses.iter().map(|pose| puppet.take(pose)).collect();
    assemble(puppet.skin.faces, &frames)
}

/// The frames of `@gallop` (0-based) that follow the animal at rest in `@gallop-poses`: seven phases of a cycle, taken from both cycles.
pub const KEY_FRAMES: [usize; 7] = [0, 3, 7, 10, 14, 17, 21];

/// The pose at rest, standing: the one that [`markers`] are taken in.
pub fn standing() -> Pose {
    Pose::rest(BONES)
}

/// [`standing`], for the reference pose, and seven poses of the gallop: as many examples as in Cashman & Hormann 2012, Figure 7 (m = 7).
pub fn key_poses() -> Vec<Pose> {
    let gallop = KEY_FRAMES.map(|frame| gallop::pose(frame as f64));
    [vec![standing()], gallop.to_vec()].concat()
}

pub(super) fn build_poses(animal: Animal) -> Result<Sequence, SyntheticError> {
    posed(animal, &key_poses())
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded, markers as markers_of, trot};
    use super::*;

    #[test]
    fn the_poses_of_the_horse_are_frames_of_the_gallop() {
        for (poses, film) in [
            ("@gallop-poses", "@gallop"),
            ("@gallop-poses-small", "@gallop-small"),
        ] {
            let (poses, film) = (embedded(poses).unwrap(), embedded(film).unwrap());
            assert_eq!(poses.connectivity(), film.connectivity());
            for (j, frame) in KEY_FRAMES.into_iter().enumerate() {
                assert_eq!(poses.frame(j + 1), film.frame(frame));
            }
        }
    }

    #[test]
    fn the_hound_has_another_mesh_with_the_same_connectivity_in_trot_and_poses() {
        for (a, b) in [("", ""), ("-small", "-small")] {
            let [trot, poses, horse] = [
                format!("@trot{a}"),
                format!("@trot-poses{b}"),
                format!("@gallop{a}"),
            ]
            .map(|name| embedded(&name).unwrap());
            assert_eq!(trot.connectivity(), poses.connectivity());
            let count = |s: &Sequence| s.connectivity().vertex_count();
            assert_ne!(count(&trot), count(&horse));
            checks::assert_sphere(&poses);
        }
        assert_eq!(
            markers_of("@trot-poses").unwrap(),
            markers_of("@trot").unwrap()
        );
    }

    /// Lines between joints turn alike in both animals: the same poses.
    #[test]
    fn limbs_of_both_animals_turn_alike_from_rest() {
        let (horse, hound) = (
            embedded("@gallop-poses").unwrap(),
            embedded("@trot-poses").unwrap(),
        );
        let line = |sequence: &Sequence, marks: &[Marker], i: usize, names: [&str; 2]| {
            let points = checks::points(sequence.frame(i));
            let [a, b] = names.map(|name| {
                let mark = marks.iter().find(|m| m.name == name).unwrap();
                points[mark.vertex as usize].xy()
            });
            (b - a).normalize()
        };
        let (first, second) = (markers(Animal::Horse), markers(Animal::Hound));
        for names in [
            ["left_stifle", "left_hock"],
            ["right_elbow", "right_knee"],
            ["right_stifle", "right_hock"],
            ["left_elbow", "left_knee"],
        ] {
            for i in 1..8 {
                let turn = |sequence, marks| {
                    let rest = line(sequence, marks, 0, names);
                    let now = line(sequence, marks, i, names);
                    rest.perp(&now).atan2(rest.dot(&now)).to_degrees()
                };
                let (a, b) = (turn(&horse, &first), turn(&hound, &second));
                assert!((a - b).abs() < 15.0, "{names:?} pose {i}: {a} {b}");
            }
        }
    }

    /// What a deformation transfer of the gallop to the hound should give.
    #[test]
    fn each_animal_takes_every_pose_of_the_other() {
        let poses: Vec<Pose> = (0..4)
            .flat_map(|i| {
                [
                    gallop::pose(5.5 * f64::from(i)),
                    trot::pose(7.3 * f64::from(i)),
                ]
            })
            .collect();
        for animal in [Animal::SmallHorse, Animal::SmallHound] {
            let sequence = posed(animal, &poses).unwrap();
            checks::assert_sphere(&sequence);
            let first = checks::volume(&sequence, 0);
            for i in 0..poses.len() {
                let ratio = checks::volume(&sequence, i) / first;
                assert!((ratio - 1.0).abs() < 0.12, "{animal:?} {i}: {ratio}");
            }
        }
        let none = posed(Animal::SmallHound, &[]);
        assert_eq!(none.unwrap_err(), SyntheticError::NoFrames);
    }
}
