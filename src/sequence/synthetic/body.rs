//! A body with bones: a solid of rounded cones, each of which goes with a bone.
//!
//! x is forward, y up, z to its right; the ground is y = 0.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::implicit::{Cone, Solid};
use super::surface_nets::{self, Surface};

/// A bone turns about its pivot relative to its parent; parents come before their children.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bone {
    pub parent: Option<usize>,
    pub pivot: Vector3<f64>,
}

/// Bones, the cones around them and named places on the skin.
#[derive(Default)]
pub(super) struct Body {
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
    pub inside: Vector3<f64>,
    pub towards: Vector3<f64>,
}

/// How a body stands: what carries it, and how each bone is turned. At rest all of it is the identity.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// The motion of the whole body.
    pub(super) root: Isometry3<f64>,
    /// The rotation of each bone about its pivot, relative to its parent.
    pub(super) turns: Vec<UnitQuaternion<f64>>,
}

impl Pose {
    pub(super) fn rest(bones: usize) -> Self {
        Self {
            root: Isometry3::identity(),
            turns: vec![UnitQuaternion::identity(); bones],
        }
    }
}

impl Body {
    /// Adds a bone and returns its index.
    pub fn bone(&mut self, parent: Option<usize>, pivot: Vector3<f64>) -> usize {
        self.bones.push(Bone { parent, pivot });
        self.bones.len() - 1
    }

    /// Adds a cone to the solid, to go with `bone`.
    pub fn cone(&mut self, bone: usize, cone: Cone) {
        self.owner.push(bone);
        self.solid.cones.push(cone);
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
        let towards = mark.towards.normalize();
        let along = (0..200).map(|i| mark.inside + towards * (0.005 * f64::from(i)));
        let mut outside = along.skip_while(|place| self.solid.value(place) < 0.0);
        outside.next().unwrap_or(mark.inside)
    }

    /// Where each bone is in a pose.
    pub fn place(&self, pose: &Pose) -> Vec<Isometry3<f64>> {
        let mut placed: Vec<Isometry3<f64>> = Vec::with_capacity(self.bones.len());
        for (bone, rotation) in self.bones.iter().zip(&pose.turns) {
            let there = Translation3::from(bone.pivot);
            let local = there * *rotation * there.inverse();
            placed.push(bone.parent.map_or(pose.root, |parent| placed[parent]) * local);
        }
        placed
    }
}

/// The rotation about a unit vector.
pub(super) fn about(axis: Vector3<f64>, degrees: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::new(axis * degrees.to_radians())
}
