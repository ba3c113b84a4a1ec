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

/// Equal springs, no two of which share a vertex.
struct Band {
    /// The first end of the first spring.
    first: usize,
    /// From the first end of a spring to the second.
    offset: usize,
    count: usize,
    /// Whether a spring begins right after the second end of the one before, rather than right after its first end.
    in_file: bool,
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
        let axes = self.points.iter_mut().zip(&self.velocities);
        for ((points, velocities), pulls) in axes.zip(accelerations) {
            let free = points.iter_mut().zip(velocities).zip(pulls).skip(self.ring);
            for ((point, velocity), pull) in free {
                *point += (velocity * kept + pull * step) * step;
            }
        }
        // towards the pole, where the pull is strongest
        for band in self.bands.iter().rev() {
            band.pull(&mut self.points, self.inverse_mass, step);
        }
        let axes = self.velocities.iter_mut().zip(&self.points);
        for ((velocities, now), before) in axes.zip(&before) {
            for ((velocity, now), before) in velocities.iter_mut().zip(now).zip(before) {
                *velocity = (now - before) / step;
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
    fn pull(&self, points: &mut Coordinates, inverse_mass: f64, step: f64) {
        let first_mass = if self.pinned { 0.0 } else { inverse_mass };
        let yielding = first_mass + inverse_mass + self.compliance / (step * step);
        let pull = Pull {
            square: self.length * self.length,
            shares: [first_mass / yielding, inverse_mass / yielding],
        };
        if self.in_file {
            pull.in_file(points, self);
        } else {
            let second = self.first + self.offset;
            let [(xa, xb), (ya, yb), (za, zb)] = points.each_mut().map(|axis| {
                let (low, high) = axis.split_at_mut(second);
                (
                    &mut low[self.first..][..self.count],
                    &mut high[..self.count],
                )
            });
            pull.abreast(xa, ya, za, xb, yb, zb);
        }
    }
}

/// The square of the length to pull to, and the shares of the two ends in each correction.
struct Pull {
    square: f64,
    shares: [f64; 2],
}

impl Pull {
    /// Springs whose first ends follow each other in memory, and whose second ends do: the processor takes several at once, provided that
    /// the compiler knows that the slices are apart, which it does only of the arguments of a function.
    #[inline(never)]
    fn abreast(
        &self,
        xa: &mut [f64],
        ya: &mut [f64],
        za: &mut [f64],
        xb: &mut [f64],
        yb: &mut [f64],
        zb: &mut [f64],
    ) {
        let n = xa.len();
        let (ya, za) = (&mut ya[..n], &mut za[..n]);
        let (xb, yb, zb) = (&mut xb[..n], &mut yb[..n], &mut zb[..n]);
        for i in 0..n {
            let [x, y, z] = [xb[i] - xa[i], yb[i] - ya[i], zb[i] - za[i]];
            let [ka, kb] = self.factors([x, y, z]);
            xa[i] += ka * x;
            ya[i] += ka * y;
            za[i] += ka * z;
            xb[i] -= kb * x;
            yb[i] -= kb * y;
            zb[i] -= kb * z;
        }
    }

    /// Springs one behind the other.
    fn in_file(&self, points: &mut Coordinates, band: &Band) {
        let springs = points.each_mut().map(|axis| {
            let from = axis[band.first..].chunks_exact_mut(band.offset + 1);
            from.take(band.count)
        });
        let [xs, ys, zs] = springs;
        for ((x, y), z) in xs.zip(ys).zip(zs) {
            if let ([xa, .., xb], [ya, .., yb], [za, .., zb]) = (x, y, z) {
                let [x, y, z] = [*xb - *xa, *yb - *ya, *zb - *za];
                let [ka, kb] = self.factors([x, y, z]);
                *xa += ka * x;
                *ya += ka * y;
                *za += ka * z;
                *xb -= kb * x;
                *yb -= kb * y;
                *zb -= kb * z;
            }
        }
    }

    /// The parts of the vector from the first end to the second by which the ends move towards each other.
    ///
    /// 1 - r / l with l replaced by its first-order expansion (r^2 + l^2) / 2 r about rest (Jakobsen 2001): no root, no division by 0.
    #[inline(always)]
    fn factors(&self, [x, y, z]: [f64; 3]) -> [f64; 2] {
        let square = x * x + y * y + z * z;
        let excess = (square - self.square) / (square + self.square);
        [self.shares[0] * excess, self.shares[1] * excess]
    }
}

const STIFF: f64 = 0.0;
const SHEAR: f64 = 1e-5;
const BENDING: f64 = 3e-3;

/// All springs, ordered by their distance from the pole.
fn bands(columns: usize, rows: usize, spacing: f64) -> Vec<Band> {
    let mut bands = Vec::new();
    for column in 0..=columns {
        let ranks = |kinds: &[(usize, isize, f64)]| -> Vec<Band> {
            let fits = kinds.iter().filter(|&&(over, ..)| column + over <= columns);
            fits.map(|&(over, up, compliance)| rank(column, over, up, rows, compliance))
                .collect()
        };
        let files = |up: usize, compliance: f64| {
            (0..=up).filter_map(move |low| file(column, low, up, rows, compliance))
        };
        bands.extend(ranks(&[(2, 0, BENDING)]));
        bands.extend(files(2, BENDING));
        bands.extend(ranks(&[(1, 1, SHEAR), (1, -1, SHEAR)]));
        bands.extend(files(1, STIFF));
        bands.extend(ranks(&[(1, 0, STIFF)]));
    }
    for band in &mut bands {
        band.length *= spacing;
    }
    bands
}

/// Springs of unit spacing from each vertex of a column to the one `over` columns and `up` rows away, where there is one.
fn rank(column: usize, over: usize, up: isize, rows: usize, compliance: f64) -> Band {
    let ring = rows + 1;
    Band {
        first: column * ring + usize::from(up < 0),
        offset: (over * ring).wrapping_add_signed(up),
        count: ring - up.unsigned_abs(),
        in_file: false,
        length: (over as f64).hypot(up as f64),
        compliance,
        pinned: column == 0,
    }
}

/// Springs of unit spacing over `up` rows one behind the other along a column, from row `low`; none on the pole.
fn file(column: usize, low: usize, up: usize, rows: usize, compliance: f64) -> Option<Band> {
    let count = (rows + 1).saturating_sub(low) / (up + 1);
    (column > 0 && count > 0).then(|| Band {
        first: column * (rows + 1) + low,
        offset: up,
        count,
        in_file: true,
        length: up as f64,
        compliance,
        pinned: false,
    })
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
    fn a_cloth_in_a_breath_of_wind_hangs_down_in_the_end() {
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
            cloth.advance(0.05, 10, |_| Vector3::z() * 0.3);
        }
        let low = cloth.points().iter().map(|p| p.y).fold(0.0, f64::min);
        let wide = cloth.points().iter().map(|p| p.x).fold(0.0, f64::max);
        assert!(low < -0.3 && wide < 0.5, "{low} {wide}");
    }
}
