//! The quadrupeds, and any of them in any pose.
//!
//! Two animals of different proportions and connectivity with the same bones and markers: a pose of one is a pose of the other, which makes the
//! example pairs of deformation transfer (Cashman & Hormann 2012, section 4.3), and the true answer to compare a transfer with.

use super::horse::HORSE;
use super::quadruped::{Anatomy, quadruped};
use super::skin::Weights;
use super::{Marker, SyntheticError, assemble, body};
use crate::sequence::Sequence;

pub use body::Pose;

/// Whose body and skin it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Animal {
    /// The horse of `@gallop`.
    Horse,
    /// The horse of `@gallop-small`: stouter limbs, fewer vertices.
    SmallHorse,
}

/// How far along the skin a bone's pull fades into the next one's.
const REACH: f64 = 0.14;

impl Animal {
    /// Its anatomy, how stout its limbs are and the spacing of its vertices.
    fn build(self) -> (&'static Anatomy, f64, f64) {
        match self {
            Self::Horse => (&HORSE, 1.0, 0.046),
            Self::SmallHorse => (&HORSE, 2.0, 0.135),
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

/// An animal in these poses, one a frame; how far the whole body moves follows from the length of its legs.
pub fn posed(animal: Animal, poses: &[Pose]) -> Result<Sequence, SyntheticError> {
    let (anatomy, limb, spacing) = animal.build();
    let body = quadruped(anatomy, limb);
    let skin = body.skin(spacing);
    let weights = Weights::new(&body, &skin, spacing, REACH);
    let frame = |pose: &Pose| {
        let mut pose = pose.clone();
        pose.root.translation.vector *= anatomy.size;
        weights.skin(&skin.points, &body.place(&pose))
    };
    let frames: Vec<_> = poses.iter().map(frame).collect();
    assemble(skin.faces, &frames)
}
