//! `@jelly`: a soft animal that is lifted by its back, swung, dropped, squashed on the floor and pulled by its head.
//!
//! The body is elastic (stable neo-Hookean, simulated on a coarse lattice) under gravity over a floor at y = 0, and the skin rides on it
//! smoothly. Deformations are large, nothing repeats, and several modes ring and decay at once: hard in the way in which the cow of Cashman
//! & Hormann 2012, Figure 6, is. It may pass through itself.

use nalgebra::{UnitQuaternion, Vector3};

use super::implicit::{Cone, Solid};
use super::ride::Ride;
use super::soft_body::{Material, SoftBody};
use super::{SyntheticError, assemble, smoothstep, surface_nets};
use crate::sequence::Sequence;

pub(super) struct Size {
    spacing: f64,
    /// Every how many frames of the film one is kept.
    every: usize,
}

pub(super) const FULL: Size = Size {
    spacing: 0.065,
    every: 1,
};
pub(super) const SMALL: Size = Size {
    spacing: 0.115,
    every: 3,
};

/// Number of frames of the film, of which `@jelly` keeps all.
const FILM: usize = 120;
const FRAME_SECONDS: f64 = 1.0 / 30.0;
const SUBSTEPS: usize = 20;
const LATTICE: f64 = 0.14;
const GRAVITY: f64 = -9.81;
const FLESH: Material = Material {
    density: 1000.0,
    bulk: 8e4,
    shear: 1.3e4,
    damping: 0.5,
    slip: 0.6,
};

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let solid = animal();
    let skin = surface_nets::polygonise(&solid, size.spacing);
    let mut body = SoftBody::new(&solid, LATTICE, FLESH);
    let ride = Ride::new(&skin.points, body.rest(), 2.0 * LATTICE);
    let mut frames = Vec::new();
    let mut grip = Grip::none();
    for frame in 0..FILM {
        if frame % size.every == 0 {
            frames.push(ride.carry(body.points()));
        }
        for substep in 0..SUBSTEPS {
            let t = (frame as f64 + substep as f64 / SUBSTEPS as f64) * FRAME_SECONDS;
            grip.follow(t, &body);
            body.advance(FRAME_SECONDS / SUBSTEPS as f64, GRAVITY, &grip.places(t));
        }
    }
    assemble(skin.faces, &frames)
}

/// A stout animal that stands on four legs on y = 0, facing +x.
fn animal() -> Solid {
    let v = Vector3::new;
    let part = |from, to, radii: [f64; 2], blend| Cone {
        from,
        to,
        from_radius: radii[0],
        to_radius: radii[1],
        flatten: 1.0,
        blend,
    };
    let mut cones = vec![
        part(v(-0.36, 0.66, 0.0), v(0.34, 0.68, 0.0), [0.27, 0.26], 0.1),
        part(v(0.46, 0.82, 0.0), v(0.70, 0.98, 0.0), [0.17, 0.165], 0.16),
        part(v(0.72, 0.96, 0.0), v(0.95, 0.86, 0.0), [0.165, 0.12], 0.1),
        part(v(-0.58, 0.78, 0.0), v(-0.92, 0.70, 0.0), [0.10, 0.095], 0.1),
    ];
    for side in [-1.0, 1.0] {
        for x in [-0.42, 0.40] {
            let (hip, foot) = (v(x, 0.55, 0.2 * side), v(1.04 * x, 0.13, 0.24 * side));
            cones.push(part(hip, foot, [0.14, 0.12], 0.1));
        }
        let (root, tip) = (v(0.66, 1.08, 0.11 * side), v(0.60, 1.20, 0.30 * side));
        cones.push(part(root, tip, [0.105, 0.095], 0.08));
    }
    Solid { cones }
}

/// The nodes in the hand of whoever lifts the animal, and where they were when they were taken.
struct Grip {
    hold: usize,
    taken: Vec<(usize, Vector3<f64>)>,
}

/// One hold: from when to when, around which place of the body at rest, how far out.
struct Hold {
    from: f64,
    to: f64,
    place: [f64; 3],
    reach: f64,
}

const HOLDS: [Hold; 2] = [
    Hold {
        from: 0.1,
        to: 1.35,
        place: [0.1, 0.9, 0.0],
        reach: 0.2,
    },
    Hold {
        from: 2.35,
        to: 3.15,
        place: [0.9, 0.9, 0.0],
        reach: 0.2,
    },
];

impl Grip {
    fn none() -> Self {
        Self {
            hold: HOLDS.len(),
            taken: Vec::new(),
        }
    }

    /// Takes hold of the body, or lets it go, as time `t` says.
    fn follow(&mut self, t: f64, body: &SoftBody) {
        let hold = HOLDS
            .iter()
            .position(|hold| (hold.from..hold.to).contains(&t));
        let hold = hold.unwrap_or(HOLDS.len());
        if hold != self.hold {
            self.hold = hold;
            self.taken = HOLDS.get(hold).map_or(Vec::new(), |hold| {
                let place = Vector3::from(hold.place);
                let near = |v: &usize| (body.rest()[*v] - place).norm() < hold.reach;
                let nodes = (0..body.rest().len()).filter(near);
                nodes.map(|v| (v, body.points()[v])).collect()
            });
        }
    }

    /// Where the nodes in hand have to be at time `t`.
    fn places(&self, t: f64) -> Vec<(usize, Vector3<f64>)> {
        let Some(hold) = HOLDS.get(self.hold) else {
            return Vec::new();
        };
        let since = t - hold.from;
        let (shift, turn) = if self.hold == 0 {
            lift(since)
        } else {
            tug(since)
        };
        let count = self.taken.len().max(1) as f64;
        let centre = self.taken.iter().map(|(_, p)| p).sum::<Vector3<f64>>() / count;
        let moved = |&(v, p): &(usize, Vector3<f64>)| (v, centre + shift + turn * (p - centre));
        self.taken.iter().map(moved).collect()
    }
}

/// Up, swinging to both sides, leaning forward.
fn lift(since: f64) -> (Vector3<f64>, UnitQuaternion<f64>) {
    let raised = smoothstep(0.0, 0.9, since);
    let swing = smoothstep(0.1, 0.5, since) * (7.0 * since).sin();
    let shift = Vector3::new(0.15 * (5.0 * since).sin(), 1.05 * raised, 0.25 * swing);
    let turn = UnitQuaternion::from_euler_angles(0.7 * raised, 0.5 * raised, 0.5 * swing);
    (shift, turn)
}

/// Up and forward, twisting the neck.
fn tug(since: f64) -> (Vector3<f64>, UnitQuaternion<f64>) {
    let pulled = smoothstep(0.0, 0.7, since);
    let shift = Vector3::new(0.3 * pulled, 1.5 * pulled, -0.4 * pulled);
    (
        shift,
        UnitQuaternion::from_euler_angles(1.1 * pulled, 0.0, 0.0),
    )
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};
    use super::*;

    #[test]
    fn the_skin_is_a_closed_sphere_with_an_inside() {
        for name in ["@jelly", "@jelly-small"] {
            checks::assert_sphere(&embedded(name).unwrap());
        }
    }

    #[test]
    fn the_volume_stays_within_a_third() {
        let sequence = embedded("@jelly").unwrap();
        let first = checks::volume(&sequence, 0);
        for i in 0..FILM {
            let ratio = checks::volume(&sequence, i) / first;
            assert!((0.67..1.33).contains(&ratio), "frame {i}: {ratio}");
        }
    }

    #[test]
    fn it_deforms_much_and_never_returns() {
        let sequence = embedded("@jelly").unwrap();
        let rest = checks::points(sequence.frame(0));
        assert!(checks::largest_stretch(&sequence, &rest) > 0.3);
        let size = checks::diagonal(sequence.frame(0));
        for i in 0..FILM {
            for j in i + 1..FILM {
                let pairs = sequence.frame(i).iter().zip(sequence.frame(j));
                let square: f64 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
                let rms = (square / rest.len() as f64).sqrt();
                assert!(rms > 1e-3 * size, "frames {i} and {j} are alike");
            }
        }
    }

    #[test]
    fn it_leaves_the_floor_and_comes_back() {
        let sequence = embedded("@jelly").unwrap();
        let lowest = |i: usize| {
            let points = checks::points(sequence.frame(i));
            points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min)
        };
        assert!((0..FILM).all(|i| lowest(i) > -0.15));
        assert!(lowest(38) > 0.2, "{}", lowest(38));
        assert!(lowest(66) < 0.1 && lowest(FILM - 1) < 0.1);
    }
}
