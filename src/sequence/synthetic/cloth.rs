//! A mass-spring cloth that hangs by one side, under gravity and wind.
//!
//! Small-step extended position-based dynamics (Macklin et al. 2019): warp and weft do not stretch, both diagonals of every quad hardly do,
//! springs over two quads resist bending. Cords over several quads, which resist only when they are taut, carry a pull across the cloth in
//! few steps (as the levels of Müller 2008, "Hierarchical position based dynamics", do).

use nalgebra::Vector3;

use super::grid;

/// What the cloth is made of and how the air takes hold of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Material {
    /// Mass of a unit of area.
    pub density: f64,
    /// Acceleration along y.
    pub gravity: f64,
    /// Pressure of the air for each unit of its relative velocity along the normal.
    pub drag: f64,
    /// Pull of the air on a unit of area for each unit of its relative velocity.
    pub friction: f64,
    /// The part of its velocity that a point loses in a second.
    pub damping: f64,
}

/// A rectangle of `columns` x `rows` quads; vertex (column, row) has the index `column (rows + 1) + row`, and column 0 does not move.
pub(super) struct Cloth {
    pub faces: Vec<[u32; 3]>,
    material: Material,
    /// Vertices in a column.
    ring: usize,
    inverse_mass: f64,
    points: Coordinates,
    velocities: Coordinates,
    bands: Vec<Band>,
}

/// All x, all y and all z, so that the processor can take several springs at once.
type Coordinates = [Vec<f64>; 3];

/// Equal springs from vertex `first + i step` to `first + i step + offset` for i below `count`, no two of which share a vertex.
struct Band {
    first: usize,
    step: usize,
    offset: usize,
    count: usize,
    length: f64,
    /// In metres per newton.
    compliance: f64,
    /// Whether the first ends are on the pole.
    pinned: bool,
}

/// The flat cloth in the plane z = 0, from the origin along +x and +y.
pub(super) fn flat(columns: usize, rows: usize, spacing: f64) -> Vec<Vector3<f64>> {
    let places = (0..=columns).flat_map(|c| (0..=rows).map(move |r| (c, r)));
    places
        .map(|(c, r)| Vector3::new(c as f64, r as f64, 0.0) * spacing)
        .collect()
}

impl Cloth {
    /// A flat cloth of quads of side `spacing`, at rest.
    pub fn new(columns: usize, rows: usize, spacing: f64, material: Material) -> Self {
        let points = flat(columns, rows, spacing);
        Self {
            faces: grid::faces(columns, rows),
            material,
            ring: rows + 1,
            inverse_mass: 1.0 / (material.density * spacing * spacing),
            velocities: std::array::from_fn(|_| vec![0.0; points.len()]),
            points: std::array::from_fn(|axis| points.iter().map(|p| p[axis]).collect()),
            bands: bands(columns, rows, spacing),
        }
    }

    /// Where the vertices are.
    pub fn points(&self) -> Vec<Vector3<f64>> {
        (0..self.points[0].len())
            .map(|v| at(&self.points, v))
            .collect()
    }

    /// Advances by `seconds` in so many steps, under the wind (given by the place along x) of their beginning.
    pub fn advance(&mut self, seconds: f64, steps: usize, wind: impl Fn(f64) -> Vector3<f64>) {
        let forces = self.accelerations(wind);
        for _ in 0..steps {
            self.step(seconds / steps as f64, &forces);
        }
    }

    fn step(&mut self, step: f64, accelerations: &Coordinates) {
        let kept = 1.0 - self.material.damping * step;
        let before = self.points.clone();
        for axis in 0..3 {
            let points = self.points[axis].iter_mut().zip(&self.velocities[axis]);
            for ((point, velocity), pull) in points.zip(&accelerations[axis]).skip(self.ring) {
                *point += (velocity * kept + pull * step) * step;
            }
        }
        // towards the pole, where the pull is strongest
        for band in self.bands.iter().rev() {
            band.pull(&mut self.points, self.inverse_mass, step);
        }
        for axis in 0..3 {
            let moved = self.points[axis].iter().zip(&before[axis]);
            for (velocity, (now, then)) in self.velocities[axis].iter_mut().zip(moved) {
                *velocity = (now - then) / step;
            }
        }
    }

    /// What gravity and the air do to each vertex.
    fn accelerations(&self, wind: impl Fn(f64) -> Vector3<f64>) -> Coordinates {
        let relative: Vec<Vector3<f64>> = (0..self.points[0].len())
            .map(|v| wind(self.points[0][v]) - at(&self.velocities, v))
            .collect();
        let mut sums = self.points.clone().map(|axis| vec![0.0; axis.len()]);
        sums[1].fill(self.material.gravity);
        for face in &self.faces {
            let corners = face.map(|v| v as usize);
            let [p, q, r] = corners.map(|v| at(&self.points, v));
            let area = 0.5 * (q - p).cross(&(r - p));
            let air = corners.iter().map(|&v| relative[v]).sum::<Vector3<f64>>() / 3.0;
            let size = area.norm().max(1e-12);
            let pressure = area * (self.material.drag * air.dot(&area) / size);
            let force = pressure + air * (self.material.friction * size);
            for v in corners {
                for axis in 0..3 {
                    sums[axis][v] += force[axis] * (self.inverse_mass / 3.0);
                }
            }
        }
        sums
    }
}

fn at(coordinates: &Coordinates, v: usize) -> Vector3<f64> {
    Vector3::new(coordinates[0][v], coordinates[1][v], coordinates[2][v])
}

impl Band {
    /// Moves both ends of each spring towards its length, one iteration of XPBD.
    fn pull(&self, [x, y, z]: &mut Coordinates, inverse_mass: f64, step: f64) {
        let first_mass = if self.pinned { 0.0 } else { inverse_mass };
        let yielding = first_mass + inverse_mass + self.compliance / (step * step);
        let shares = [first_mass / yielding, inverse_mass / yielding];
        let square = self.length * self.length;
        if self.step == 1 {
            let (first, second) = (self.first, self.first + self.offset);
            let halves = [x, y, z].map(|axis| {
                let (low, high) = axis.split_at_mut(second);
                (&mut low[first..first + self.count], &mut high[..self.count])
            });
            return pull_apart(halves, square, shares);
        }
        for i in 0..self.count {
            let a = self.first + i * self.step;
            let b = a + self.offset;
            let (dx, dy, dz) = (x[b] - x[a], y[b] - y[a], z[b] - z[a]);
            let excess = excess(dx * dx + dy * dy + dz * dz, square);
            let (ka, kb) = (shares[0] * excess, shares[1] * excess);
            x[a] += ka * dx;
            y[a] += ka * dy;
            z[a] += ka * dz;
            x[b] -= kb * dx;
            y[b] -= kb * dy;
            z[b] -= kb * dz;
        }
    }
}

/// The part of its length that a spring is too long, from the squares of its length and of that at rest.
///
/// 1 - r / l with the length replaced by its first-order expansion (r^2 + l^2) / 2 r about rest (Jakobsen 2001): no root, no division by 0.
fn excess(square: f64, rest: f64) -> f64 {
    (square - rest) / (square + rest)
}

/// The same for ends that lie apart in memory, several at once.
#[inline(never)]
fn pull_apart(halves: [(&mut [f64], &mut [f64]); 3], square: f64, shares: [f64; 2]) {
    let [(xa, xb), (ya, yb), (za, zb)] = halves;
    let n = xa.len();
    let (xb, ya, yb, za, zb) = (
        &mut xb[..n],
        &mut ya[..n],
        &mut yb[..n],
        &mut za[..n],
        &mut zb[..n],
    );
    for i in 0..n {
        let (dx, dy, dz) = (xb[i] - xa[i], yb[i] - ya[i], zb[i] - za[i]);
        let excess = excess(dx * dx + dy * dy + dz * dz, square);
        let (ka, kb) = (shares[0] * excess, shares[1] * excess);
        xa[i] += ka * dx;
        ya[i] += ka * dy;
        za[i] += ka * dz;
        xb[i] -= kb * dx;
        yb[i] -= kb * dy;
        zb[i] -= kb * dz;
    }
}

const STIFF: f64 = 0.0;
const SHEAR: f64 = 1e-5;
const BENDING: f64 = 3e-3;

/// All springs, ordered by their distance from the pole.
fn bands(columns: usize, rows: usize, spacing: f64) -> Vec<Band> {
    let ring = rows + 1;
    let mut bands = Vec::new();
    for column in 0..=columns {
        // from row `low` on, `count` springs over some columns and rows, every `step`-th row
        let mut add = |low: usize, step: usize, (over, up): (usize, isize), compliance: f64| {
            let high = if up > 0 { rows - up as usize } else { rows };
            if column + over <= columns && low <= high && (column > 0 || over > 0) {
                bands.push(Band {
                    first: column * ring + low,
                    step,
                    offset: (over * ring).wrapping_add_signed(up),
                    count: (high - low) / step + 1,
                    length: spacing * (over as f64).hypot(up as f64),
                    compliance,
                    pinned: column == 0,
                });
            }
        };
        add(0, 1, (2, 0), BENDING);
        for low in 0..4 {
            // rows 0, 4, 8, .. to 2, 6, 10, ..; then 1, 5, ..; and so on
            add(low, 4, (0, 2), BENDING);
        }
        add(0, 1, (1, 1), SHEAR);
        add(1, 1, (1, -1), SHEAR);
        add(0, 2, (0, 1), STIFF);
        add(1, 2, (0, 1), STIFF);
        add(0, 1, (1, 0), STIFF);
    }
    bands
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINEN: Material = Material {
        density: 0.2,
        gravity: -9.81,
        drag: 1.0,
        friction: 0.1,
        damping: 0.5,
    };

    #[test]
    fn a_still_cloth_without_wind_hangs_down_in_the_end() {
        let mut cloth = Cloth::new(
            8,
            4,
            0.1,
            Material {
                damping: 3.0,
                ..LINEN
            },
        );
        for _ in 0..200 {
            cloth.advance(0.05, 10, |_| Vector3::zeros());
        }
        let end = cloth.points().pop().unwrap();
        assert!(end.y < -0.1 && end.x < 0.6 && end.z.abs() < 1e-9, "{end:?}");
    }
}
