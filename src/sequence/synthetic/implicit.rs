//! A solid given by a function: rounded cones, blended smoothly.

use nalgebra::Vector3;

/// A rounded cone from `from` (radius `from_radius`) to `to` (radius `to_radius`).
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    pub from: Vector3<f64>,
    pub to: Vector3<f64>,
    pub from_radius: f64,
    pub to_radius: f64,
    /// The width of the section along z over that across it: below 1 the cone is flattened sideways.
    pub flatten: f64,
    /// How far the blend with the cones before this one reaches.
    pub blend: f64,
}

impl Cone {
    /// Negative inside, positive outside; near the surface about the distance to it.
    pub fn value(&self, point: &Vector3<f64>) -> f64 {
        let axis = self.to - self.from;
        let offset = point - self.from;
        let along = (offset.dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
        let mut across = offset - axis * along;
        across.z /= self.flatten;
        across.norm() - (self.from_radius + along * (self.to_radius - self.from_radius))
    }
}

/// The smooth union of cones, in their order; at least one before it is asked for anything.
#[derive(Clone, Debug, Default)]
pub(super) struct Solid {
    pub cones: Vec<Cone>,
}

impl Solid {
    /// Negative inside, positive outside.
    pub fn value(&self, point: &Vector3<f64>) -> f64 {
        self.cones.iter().fold(f64::INFINITY, |sum, cone| {
            smooth_minimum(sum, cone.value(point), cone.blend)
        })
    }

    /// The gradient of [`Solid::value`], by central differences over a distance far below any radius.
    pub fn gradient(&self, point: &Vector3<f64>) -> Vector3<f64> {
        const STEP: f64 = 1e-4;
        Vector3::from_fn(|axis, _| {
            let step = Vector3::ith(axis, STEP);
            (self.value(&(point + step)) - self.value(&(point - step))) / (2.0 * STEP)
        })
    }

    /// The point of the surface near `point`: Newton steps along the gradient.
    pub fn project(&self, mut point: Vector3<f64>, steps: usize) -> Vector3<f64> {
        for _ in 0..steps {
            let gradient = self.gradient(&point);
            let slope = gradient.norm_squared();
            if slope > 1e-6 {
                point -= gradient * (self.value(&point) / slope);
            }
        }
        point
    }

    /// A box that holds the whole surface.
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = -low;
        for cone in &self.cones {
            for (end, radius) in [(cone.from, cone.from_radius), (cone.to, cone.to_radius)] {
                let reach = Vector3::repeat(radius + cone.blend);
                low = low.inf(&(end - reach));
                high = high.sup(&(end + reach));
            }
        }
        [low, high]
    }
}

/// The minimum of a and b, rounded where they differ by less than `blend`.
pub(super) fn smooth_minimum(a: f64, b: f64, blend: f64) -> f64 {
    let overlap = (blend - (a - b).abs()).max(0.0);
    a.min(b) - overlap * overlap / (4.0 * blend)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn capsule() -> Cone {
        Cone {
            from: Vector3::zeros(),
            to: Vector3::x(),
            from_radius: 0.2,
            to_radius: 0.2,
            flatten: 1.0,
            blend: 0.1,
        }
    }

    #[test]
    fn a_capsule_is_a_distance() {
        let value = |x, y, z| capsule().value(&Vector3::new(x, y, z));
        assert!((value(0.5, 1.0, 0.0) - 0.8).abs() < 1e-15);
        assert!((value(4.0, 4.0, 0.0) - 4.8).abs() < 1e-15);
        assert!((value(0.3, 0.0, 0.0) + 0.2).abs() < 1e-15);
    }

    #[test]
    fn projection_reaches_the_surface() {
        let mut lower = capsule();
        lower.from.y = -0.3;
        let solid = Solid {
            cones: vec![capsule(), lower],
        };
        for start in [Vector3::new(0.4, 0.5, 0.1), Vector3::new(0.0, -0.1, 0.3)] {
            assert!(solid.value(&solid.project(start, 8)).abs() < 1e-9);
        }
    }

    #[test]
    fn a_blend_only_adds_material_and_only_nearby() {
        assert_eq!(smooth_minimum(1.0, 2.0, 0.5), 1.0);
        assert_eq!(smooth_minimum(1.0, 1.0, 0.4), 0.9);
        assert_eq!(smooth_minimum(f64::INFINITY, 1.0, 0.4), 1.0);
    }
}
