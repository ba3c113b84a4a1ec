//! A skin that follows the bones under it.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use super::body::Body;
use super::surface_nets::Surface;

/// How much each vertex follows each bone, V x bones row-major; each row sums to 1.
pub(super) struct Weights {
    bones: usize,
    values: Vec<f64>,
}

impl Weights {
    /// Starts from the nearest cone's bone and lets the weights diffuse along the surface over about `reach`.
    ///
    /// As they travel along the surface and not through space, one leg never drags the other along.
    pub fn new(body: &Body, skin: &Surface, spacing: f64, reach: f64) -> Self {
        let bones = body.bones.len();
        let mut values = vec![0.0; skin.points.len() * bones];
        for (row, point) in values.chunks_exact_mut(bones).zip(&skin.points) {
            row[body.nearest_bone(point)] = 1.0;
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

type DualQuaternion = (Quaternion<f64>, Quaternion<f64>);

fn dual_quaternion(motion: &Isometry3<f64>) -> DualQuaternion {
    let rotation = motion.rotation.into_inner();
    let dual = Quaternion::from_imag(motion.translation.vector) * rotation * 0.5;
    (rotation, dual)
}

/// The weighted mean of motions, applied to a point.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_motions_blend_to_themselves() {
        let turn = UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0);
        let motion = Isometry3::from_parts(Vector3::new(1.0, 2.0, -3.0).into(), turn);
        let mut motions = vec![dual_quaternion(&motion); 2];
        // the same motion, written with the opposite sign
        motions[1] = (-motions[1].0, -motions[1].1);
        let point = Vector3::new(0.5, -0.2, 4.0);
        let blended = blend(&[0.3, 0.7], &motions, &point);
        assert!((blended - (turn * point + motion.translation.vector)).norm() < 1e-14);
    }
}
