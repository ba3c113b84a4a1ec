//! `@flag`: a cloth on a pole in a periodic wind.
//!
//! A mass-spring cloth under gravity, wind and small-step extended position-based dynamics (Macklin et al. 2019): weft, warp and both
//! diagonals of every quad are nearly inextensible, springs over two quads resist bending. The wind blows along +x, gusts sideways (z) with
//! a period of 25 frames and pushes along the normal of each triangle in proportion to the air's velocity relative to it. Recording starts
//! when the motion has settled, so the flag repeats itself nearly, but not exactly, once a gust. It may pass through itself.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::{SyntheticError, assemble, grid};
use crate::sequence::Sequence;

/// Width along x when flat, from the pole at x = 0; the height along y is half of it.
pub const WIDTH: f64 = 1.9;
/// Number of frames after which the wind repeats itself.
pub const GUST: usize = 25;

pub(super) struct Size {
    columns: usize,
    rows: usize,
    frames: usize,
}

pub(super) const FULL: Size = Size {
    columns: 76,
    rows: 38,
    frames: 100,
};
pub(super) const SMALL: Size = Size {
    columns: 16,
    rows: 8,
    frames: 40,
};

const FRAME_SECONDS: f64 = 1.0 / 30.0;
const SUBSTEPS: usize = 6;
const WARM_UP: usize = 2 * GUST;
/// Mass of a square metre of cloth.
const DENSITY: f64 = 0.12;
/// Pressure of the air for each unit of its velocity along the normal.
const DRAG: f64 = 1.0;
/// Pull of the air on a unit of area for each unit of its velocity.
const FRICTION: f64 = 0.45;
const GRAVITY: f64 = -9.81;
/// The part of its velocity that the cloth loses in a second.
const DAMPING: f64 = 0.6;

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let mut cloth = Cloth::new(size.columns, size.rows);
    let mut frames = Vec::with_capacity(size.frames);
    for frame in 0..WARM_UP + size.frames {
        if frame >= WARM_UP {
            frames.push(cloth.points.clone());
        }
        cloth.advance_frame(frame);
    }
    assemble(cloth.faces, &frames)
}

/// The flat cloth, column by column away from the pole.
fn flat(columns: usize, rows: usize) -> Vec<Vector3<f64>> {
    let spacing = WIDTH / columns as f64;
    let places = (0..=columns).flat_map(|c| (0..=rows).map(move |r| (c, r)));
    places
        .map(|(c, r)| Vector3::new(c as f64, r as f64, 0.0) * spacing)
        .collect()
}

/// The wind at time `t` (seconds) at place x along the flag.
fn wind(t: f64, x: f64) -> Vector3<f64> {
    let phase = TAU * (t / (GUST as f64 * FRAME_SECONDS) - x / 2.4);
    Vector3::new(
        7.0 + 0.8 * (phase + 1.0).sin(),
        0.9 + 0.5 * phase.sin(),
        3.0 * phase.sin() + 0.7 * (2.0 * phase + 0.4).sin(),
    )
}

/// Two vertices at a distance, with the compliance (metres per newton) that the distance yields by.
struct Spring {
    ends: [usize; 2],
    length: f64,
    compliance: f64,
}

struct Cloth {
    rows: usize,
    spacing: f64,
    faces: Vec<[u32; 3]>,
    points: Vec<Vector3<f64>>,
    velocities: Vec<Vector3<f64>>,
    inverse_masses: Vec<f64>,
    springs: Vec<Spring>,
}

impl Cloth {
    fn new(columns: usize, rows: usize) -> Self {
        let points = flat(columns, rows);
        let spacing = WIDTH / columns as f64;
        let inverse_mass = 1.0 / (DENSITY * spacing * spacing);
        let pinned = |v: usize| v <= rows;
        Self {
            rows,
            spacing,
            faces: grid::faces(columns, rows),
            velocities: vec![Vector3::zeros(); points.len()],
            inverse_masses: (0..points.len())
                .map(|v| if pinned(v) { 0.0 } else { inverse_mass })
                .collect(),
            springs: springs(columns, rows, &points),
            points,
        }
    }

    fn advance_frame(&mut self, frame: usize) {
        let step = FRAME_SECONDS / SUBSTEPS as f64;
        for substep in 0..SUBSTEPS {
            let t = frame as f64 * FRAME_SECONDS + substep as f64 * step;
            self.advance(t, step);
        }
    }

    fn advance(&mut self, t: f64, step: f64) {
        self.blow(t, step);
        let before = self.points.clone();
        let kept = 1.0 - DAMPING * step;
        for (v, point) in self.points.iter_mut().enumerate() {
            if self.inverse_masses[v] > 0.0 {
                self.velocities[v].y += GRAVITY * step;
                self.velocities[v] *= kept;
                *point += self.velocities[v] * step;
            }
        }
        self.keep_within_reach();
        // away from the pole and back, so that a pull crosses the whole cloth in one step
        for spring in self.springs.iter().chain(self.springs.iter().rev()) {
            spring.pull(&mut self.points, &self.inverse_masses, step);
        }
        for (v, velocity) in self.velocities.iter_mut().enumerate() {
            *velocity = (self.points[v] - before[v]) / step;
        }
    }

    /// No point can be further from the pole's point of its row than the cloth between them is long (Kim et al. 2012).
    fn keep_within_reach(&mut self) {
        let ring = self.rows + 1;
        for v in ring..self.points.len() {
            let (anchor, reach) = (self.points[v % ring], self.spacing * (v / ring) as f64);
            let along = self.points[v] - anchor;
            let length = along.norm();
            if length > reach {
                self.points[v] = anchor + along * (reach / length);
            }
        }
    }

    /// Adds what the wind does to the velocities in one step.
    fn blow(&mut self, t: f64, step: f64) {
        let old = self.velocities.clone();
        for face in &self.faces {
            let [a, b, c] = face.map(|v| v as usize);
            let area =
                0.5 * (self.points[b] - self.points[a]).cross(&(self.points[c] - self.points[a]));
            let centre_x = (self.points[a].x + self.points[b].x + self.points[c].x) / 3.0;
            let relative = wind(t, centre_x) - (old[a] + old[b] + old[c]) / 3.0;
            let size = area.norm().max(1e-12);
            let pressure = area * (DRAG * relative.dot(&area) / size);
            let impulse = (pressure + relative * (FRICTION * size)) * (step / 3.0);
            for v in [a, b, c] {
                self.velocities[v] += impulse * self.inverse_masses[v];
            }
        }
    }
}

impl Spring {
    /// Moves both ends towards the length, one iteration of XPBD.
    fn pull(&self, points: &mut [Vector3<f64>], inverse_masses: &[f64], step: f64) {
        let [a, b] = self.ends;
        let (wa, wb) = (inverse_masses[a], inverse_masses[b]);
        let along = points[b] - points[a];
        let length = along.norm();
        let yielding = wa + wb + self.compliance / (step * step);
        if length > 0.0 && wa + wb > 0.0 {
            let pull = along * ((length - self.length) / (length * yielding));
            points[a] += pull * wa;
            points[b] -= pull * wb;
        }
    }
}

/// All springs, ordered by their distance from the pole.
fn springs(columns: usize, rows: usize, rest: &[Vector3<f64>]) -> Vec<Spring> {
    const STIFF: f64 = 0.0;
    const SHEAR: f64 = 1e-5;
    const BENDING: f64 = 1e-2;
    // columns and rows from the first end to the second
    let kinds: [(usize, isize, f64); 6] = [
        (0, 1, STIFF),
        (1, 0, STIFF),
        (1, 1, SHEAR),
        (1, -1, SHEAR),
        (2, 0, BENDING),
        (0, 2, BENDING),
    ];
    let at = |column: usize, row: usize| column * (rows + 1) + row;
    let mut springs = Vec::new();
    for column in 0..=columns {
        for (over, up, compliance) in kinds {
            // every second one first: springs that share no vertex need not wait for each other
            for row in (0..=rows).step_by(2).chain((1..=rows).step_by(2)) {
                let other = row.checked_add_signed(up).filter(|&other| other <= rows);
                if let (Some(other), true) = (other, column + over <= columns) {
                    let ends = [at(column, row), at(column + over, other)];
                    let length = (rest[ends[0]] - rest[ends[1]]).norm();
                    springs.push(Spring {
                        ends,
                        length,
                        compliance,
                    });
                }
            }
        }
    }
    springs
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};
    use super::*;

    #[test]
    fn edges_hardly_stretch() {
        for (name, size) in [("@flag", FULL), ("@flag-small", SMALL)] {
            let sequence = embedded(name).unwrap();
            let stretch = checks::largest_stretch(&sequence, &flat(size.columns, size.rows));
            assert!(stretch < 0.05, "{name}: {stretch}");
        }
    }

    #[test]
    fn the_pole_side_stays_and_the_rest_billows() {
        let sequence = embedded("@flag").unwrap();
        let rest = flat(FULL.columns, FULL.rows);
        for i in 0..FULL.frames {
            let points = checks::points(sequence.frame(i));
            assert!((0..=FULL.rows).all(|v| points[v] == rest[v]));
            let depth = |sign: f64| points.iter().map(|p| sign * p.z).fold(0.0, f64::max);
            assert!(depth(1.0) + depth(-1.0) > 0.15, "frame {i} is flat");
            assert!(points.iter().all(|p| p.norm() < 1.2 * WIDTH));
        }
    }

    #[test]
    fn the_motion_nearly_repeats_with_the_wind() {
        let sequence = embedded("@flag").unwrap();
        let distance = |i: usize, j: usize| {
            let pairs = sequence.frame(i).iter().zip(sequence.frame(j));
            pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
        };
        for i in 0..FULL.frames - GUST {
            assert!(
                distance(i, i + GUST) < 0.6 * distance(i, i + GUST / 2),
                "frame {i}"
            );
        }
    }

    #[test]
    fn it_is_one_open_sheet() {
        checks::assert_disc(&embedded("@flag").unwrap());
        checks::assert_disc(&embedded("@flag-small").unwrap());
    }
}
