//! `@face`: nine expressions of one face, the neutral one first, as in Cashman & Hormann 2012, Figure 8 (there is no motion between them).
//!
//! The face is the front of an ellipsoid with brows, eyes, a nose, cheeks, lips and a chin raised on it, one open sheet with an open mouth in
//! it. An expression is a sum of actions, each a few smooth pulls at places of the face, as muscles pull; most act on both sides alike, a
//! sneer does not. The jaw opens the mouth: what lies below it goes down, its corners stay.
//!
//! x is forward, y up, z the face's right. Lengths are those of a human face in metres.

use nalgebra::Vector3;

use super::{SyntheticError, assemble, grid, smoothstep};
use crate::sequence::Sequence;

/// The expressions in their order: the names of the frames.
pub fn names() -> [&'static str; 9] {
    EXPRESSIONS.map(|expression| expression.name)
}

/// Number of quads from ear to ear (a multiple of 8) and from chin to forehead (a multiple of 3).
pub(super) struct Size {
    columns: usize,
    rows: usize,
}

pub(super) const FULL: Size = Size {
    columns: 64,
    rows: 48,
};
pub(super) const SMALL: Size = Size {
    columns: 24,
    rows: 18,
};

/// Half axes of the ellipsoid, and how far its patch reaches to each side and up and down.
const HEAD: [f64; 3] = [0.10, 0.125, 0.08];
const LONGITUDE: f64 = 80.0;
const LATITUDE: f64 = 65.0;
/// The mouth is in the first third of the rows and in the middle quarter of the columns.
const MOUTH: f64 = -LATITUDE / 3.0;
const CORNER: f64 = LONGITUDE / 4.0;

/// A bell-shaped pull: at (y, z) of the ellipsoid, with radii along y and z, by (x, y, z); on the left mirrored.
#[derive(Clone, Copy)]
struct Pull {
    at: [f64; 2],
    radii: [f64; 2],
    by: [f64; 3],
}

const fn pull(at: [f64; 2], radii: [f64; 2], by: [f64; 3]) -> Pull {
    Pull { at, radii, by }
}

/// What is raised on the ellipsoid or sunk into it.
const FEATURES: &[Pull] = &[
    // sockets and eyeballs, brows
    pull([0.030, 0.033], [0.015, 0.020], [-0.013, 0.0, 0.0]),
    pull([0.029, 0.033], [0.009, 0.012], [0.009, 0.0, 0.0]),
    pull([0.050, 0.030], [0.009, 0.024], [0.006, 0.0, 0.0]),
    // bridge, tip and wings of the nose; what lies at z = 0 is pulled from both sides
    pull([0.022, 0.0], [0.024, 0.008], [0.006, 0.0, 0.0]),
    pull([-0.010, 0.0], [0.013, 0.011], [0.012, 0.0, 0.0]),
    pull([-0.015, 0.012], [0.008, 0.008], [0.008, 0.0, 0.0]),
    // cheekbones, lips, chin
    pull([-0.002, 0.046], [0.016, 0.018], [0.004, 0.0, 0.0]),
    pull([-0.039, 0.005], [0.006, 0.013], [0.003, 0.0, 0.0]),
    pull([-0.053, 0.0], [0.006, 0.016], [0.0035, 0.0, 0.0]),
    pull([-0.064, 0.0], [0.006, 0.02], [-0.002, 0.0, 0.0]),
    pull([-0.086, 0.0], [0.015, 0.020], [0.005, 0.0, 0.0]),
];

const SMILE: &[Pull] = &[
    pull([-0.046, 0.028], [0.020, 0.018], [-0.005, 0.011, 0.009]),
    pull([-0.012, 0.042], [0.018, 0.018], [0.006, 0.006, 0.0]),
];
const FROWN: &[Pull] = &[
    pull([-0.046, 0.027], [0.014, 0.013], [-0.002, -0.011, 0.002]),
    pull([-0.076, 0.0], [0.012, 0.016], [0.002, 0.003, 0.0]),
];
const PUCKER: &[Pull] = &[
    pull([-0.046, 0.024], [0.016, 0.013], [0.004, 0.0, -0.011]),
    pull([-0.046, 0.0], [0.013, 0.014], [0.007, 0.0, 0.0]),
];
const STRETCH: &[Pull] = &[pull(
    [-0.046, 0.028],
    [0.016, 0.014],
    [-0.004, -0.002, 0.011],
)];
const OUTER_BROW: &[Pull] = &[pull([0.052, 0.042], [0.015, 0.018], [0.0, 0.012, 0.0])];
const INNER_BROW: &[Pull] = &[pull([0.052, 0.014], [0.015, 0.013], [0.001, 0.011, 0.0])];
const KNIT: &[Pull] = &[pull(
    [0.049, 0.018],
    [0.013, 0.015],
    [0.004, -0.010, -0.005],
)];
const WRINKLE: &[Pull] = &[
    pull([0.004, 0.012], [0.014, 0.009], [0.003, 0.006, 0.0]),
    pull([-0.034, 0.016], [0.014, 0.013], [0.002, 0.007, 0.002]),
];
const SQUINT: &[Pull] = &[
    pull([0.017, 0.033], [0.008, 0.018], [0.003, 0.006, 0.0]),
    pull([0.041, 0.033], [0.008, 0.018], [0.002, -0.004, 0.0]),
];
const WIDEN: &[Pull] = &[
    pull([0.040, 0.033], [0.009, 0.018], [-0.003, 0.006, 0.0]),
    pull([0.018, 0.033], [0.008, 0.018], [-0.002, -0.003, 0.0]),
];
const PUFF: &[Pull] = &[pull([-0.036, 0.042], [0.022, 0.018], [0.010, 0.0, 0.012])];

/// What makes an expression.
struct Expression {
    name: &'static str,
    /// Actions with their strengths on the left and on the right.
    actions: &'static [(&'static [Pull], [f64; 2])],
    /// How far the jaw goes down and the upper lip up in the middle, in metres.
    jaw: f64,
    lip: f64,
}

const EXPRESSIONS: [Expression; 9] = [
    Expression {
        name: "neutral",
        actions: &[],
        jaw: 0.0,
        lip: 0.0,
    },
    Expression {
        name: "smile",
        actions: &[(SMILE, [1.0, 1.0]), (SQUINT, [0.5, 0.5])],
        jaw: 0.0,
        lip: 0.001,
    },
    Expression {
        name: "laugh",
        actions: &[
            (SMILE, [1.0, 1.0]),
            (SQUINT, [0.9, 0.9]),
            (OUTER_BROW, [0.4, 0.4]),
        ],
        jaw: 0.022,
        lip: 0.005,
    },
    Expression {
        name: "frown",
        actions: &[
            (FROWN, [1.0, 1.0]),
            (INNER_BROW, [1.0, 1.0]),
            (KNIT, [0.3, 0.3]),
        ],
        jaw: 0.0,
        lip: 0.0,
    },
    Expression {
        name: "surprise",
        actions: &[
            (OUTER_BROW, [1.1, 1.1]),
            (INNER_BROW, [1.1, 1.1]),
            (WIDEN, [1.0, 1.0]),
            (PUCKER, [0.4, 0.4]),
        ],
        jaw: 0.030,
        lip: 0.003,
    },
    Expression {
        name: "anger",
        actions: &[
            (KNIT, [1.1, 1.1]),
            (WRINKLE, [0.6, 0.6]),
            (SQUINT, [0.5, 0.5]),
            (STRETCH, [0.9, 0.9]),
        ],
        jaw: 0.009,
        lip: 0.004,
    },
    Expression {
        name: "sneer",
        actions: &[
            (WRINKLE, [0.2, 1.2]),
            (KNIT, [0.2, 0.7]),
            (SQUINT, [0.2, 0.9]),
            (SMILE, [0.0, 0.5]),
            (FROWN, [0.6, 0.0]),
        ],
        jaw: 0.0,
        lip: 0.001,
    },
    Expression {
        name: "kiss",
        actions: &[(PUCKER, [1.2, 1.2]), (KNIT, [0.2, 0.2])],
        jaw: 0.001,
        lip: 0.001,
    },
    Expression {
        name: "puff",
        actions: &[
            (PUFF, [1.0, 1.0]),
            (PUCKER, [0.6, 0.6]),
            (OUTER_BROW, [0.5, 0.5]),
        ],
        jaw: 0.0,
        lip: 0.0,
    },
];

/// How far each lip is from the other's place in the middle of the neutral face, where the mouth is not quite shut.
const PARTED: f64 = 0.0012;

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let sheet = Sheet::new(size);
    let frames: Vec<_> = EXPRESSIONS
        .iter()
        .map(|expression| sheet.places.iter().map(|at| at.moved(expression)).collect())
        .collect();
    assemble(sheet.faces, &frames)
}

/// A place of the face: its point of the ellipsoid, and on which side of the mouth it is.
#[derive(Clone, Copy)]
struct Place {
    point: Vector3<f64>,
    below: bool,
}

struct Sheet {
    places: Vec<Place>,
    faces: Vec<[u32; 3]>,
}

impl Sheet {
    /// A grid, column by column from the face's right, upwards, whose vertices on the mouth between its corners are the upper lip; then those of
    /// the lower lip.
    fn new(size: &Size) -> Self {
        let (ring, mouth) = (size.rows + 1, size.rows / 3);
        let lip = 3 * size.columns / 8 + 1..5 * size.columns / 8;
        let place = |column: usize, row: usize, below: bool| {
            let across = 1.0 - 2.0 * column as f64 / size.columns as f64;
            let up = 2.0 * row as f64 / size.rows as f64 - 1.0;
            let point = ellipsoid(LATITUDE * up, LONGITUDE * across);
            Place { point, below }
        };
        let grid_places = (0..=size.columns)
            .flat_map(|column| (0..ring).map(move |row| place(column, row, row < mouth)));
        let lower = lip.clone().map(|column| place(column, mouth, true));
        let first = (ring * (size.columns + 1)) as u32;
        // triangles below the mouth have the lower lip in place of the upper one
        let own = |v: u32, below: bool| {
            let (column, row) = (v as usize / ring, v as usize % ring);
            match below && row == mouth && lip.contains(&column) {
                true => first + (column - lip.start) as u32,
                false => v,
            }
        };
        let faces = grid::faces(size.columns, size.rows).into_iter();
        let faces = faces.map(|face| {
            let below = face.iter().any(|&v| (v as usize % ring) < mouth);
            face.map(|v| own(v, below))
        });
        Self {
            places: grid_places.chain(lower).collect(),
            faces: faces.collect(),
        }
    }
}

fn ellipsoid(latitude: f64, longitude: f64) -> Vector3<f64> {
    let (up, level) = latitude.to_radians().sin_cos();
    let (side, front) = longitude.to_radians().sin_cos();
    Vector3::new(
        HEAD[0] * level * front,
        HEAD[1] * up,
        HEAD[2] * level * side,
    )
}

impl Place {
    /// Where this place of the face is in an expression.
    fn moved(&self, expression: &Expression) -> Vector3<f64> {
        let features = FEATURES.iter().map(|pull| self.pulled(pull, [1.0, 1.0]));
        let actions = expression.actions.iter();
        let actions = actions
            .flat_map(|&(pulls, sides)| pulls.iter().map(move |pull| self.pulled(pull, sides)));
        let shift: Vector3<f64> = features.chain(actions).sum();
        self.point + shift + self.parted(expression.jaw + PARTED, expression.lip + PARTED)
    }

    fn pulled(&self, pull: &Pull, [left, right]: [f64; 2]) -> Vector3<f64> {
        let from = |side: f64| {
            let y = (self.point.y - pull.at[0]) / pull.radii[0];
            let z = (self.point.z - side * pull.at[1]) / pull.radii[1];
            let [dx, dy, dz] = pull.by;
            Vector3::new(dx, dy, side * dz) * (-(y * y + z * z)).exp()
        };
        from(-1.0) * left + from(1.0) * right
    }

    /// The jaw down and a little back, the upper lip up: nothing at the corners of the mouth, more towards its middle and towards the chin.
    fn parted(&self, jaw: f64, lip: f64) -> Vector3<f64> {
        let corner = ellipsoid(MOUTH, CORNER);
        let off = (self.point.y - corner.y).abs();
        let across = self.point.z / corner.z;
        let middle = (1.0 - across * across).max(0.0);
        if self.below {
            let chin = smoothstep(0.0, 0.03, off);
            let side = (-(self.point.z / 0.06).powi(2)).exp();
            Vector3::new(-0.35, -1.0, 0.0) * (jaw * side * (middle + (1.0 - middle) * chin))
        } else {
            let near = (-(off / 0.010).powi(2)).exp();
            Vector3::new(0.1, 1.0, 0.0) * (lip * middle * near)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};
    use super::*;

    const SIZES: [(&str, Size); 2] = [("@face", FULL), ("@face-small", SMALL)];

    #[test]
    fn it_is_one_sheet_with_an_open_mouth_that_faces_forward() {
        for (name, size) in SIZES {
            let face = embedded(name).unwrap();
            let shape = checks::manifold(&face);
            assert_eq!(shape.characteristic, 0, "{name}");
            let outline = 2 * (size.columns + size.rows);
            assert_eq!(shape.boundary, outline + size.columns / 2, "{name}");
            assert!(shape.orientable, "{name}");
            for i in 0..EXPRESSIONS.len() {
                assert!(checks::area_vector(&face, i).x > 0.02, "{name} {i}");
                assert!(checks::thinnest(&face, i) > 0.1, "{name} {i}");
            }
        }
    }

    /// No fold: every triangle stays within a right angle of its neutral self.
    #[test]
    fn no_expression_turns_a_triangle_over() {
        for (name, _) in SIZES {
            let face = embedded(name).unwrap();
            let normals = |i: usize| {
                let points = checks::points(face.frame(i));
                let faces = face.connectivity().faces().iter();
                let normal = |f: &[u32; 3]| {
                    let [a, b, c] = f.map(|v| points[v as usize]);
                    (b - a).cross(&(c - a)).normalize()
                };
                faces.map(normal).collect::<Vec<_>>()
            };
            let neutral = normals(0);
            for i in 1..EXPRESSIONS.len() {
                let turns = neutral.iter().zip(normals(i)).map(|(a, b)| a.dot(&b));
                let worst = turns.fold(1.0, f64::min);
                assert!(worst > 0.0, "{name} {}: {worst}", EXPRESSIONS[i].name);
            }
        }
    }

    #[test]
    fn expressions_differ_and_all_but_the_sneer_are_symmetric() {
        let face = embedded("@face").unwrap();
        let ring = FULL.rows + 1;
        for (i, expression) in EXPRESSIONS.iter().enumerate() {
            for j in 0..i {
                let rms = checks::distance(&face, i, j) / (face.dimension() as f64 / 3.0).sqrt();
                assert!(rms > 1e-3, "{} and frame {j}: {rms}", expression.name);
            }
            let points = checks::points(face.frame(i));
            let grid = 0..ring * (FULL.columns + 1);
            let lopsided = grid.map(|v| {
                let (column, row) = (v / ring, v % ring);
                let mut mirror = points[(FULL.columns - column) * ring + row];
                mirror.z = -mirror.z;
                (points[v] - mirror).norm()
            });
            let lopsided = lopsided.fold(0.0, f64::max);
            match expression.name {
                "sneer" => assert!(lopsided > 0.005),
                _ => assert!(lopsided < 1e-14, "{} {lopsided}", expression.name),
            }
        }
    }

    #[test]
    fn the_jaw_opens_the_mouth() {
        let face = embedded("@face").unwrap();
        let upper = FULL.columns / 2 * (FULL.rows + 1) + FULL.rows / 3;
        let lower = face.connectivity().vertex_count() - FULL.columns / 8;
        for (i, expression) in EXPRESSIONS.iter().enumerate() {
            let points = checks::points(face.frame(i));
            let gap = points[upper].y - points[lower].y;
            let expected = expression.jaw + expression.lip + 2.0 * PARTED;
            assert!((gap - expected).abs() < 1e-12, "{}", expression.name);
        }
        assert_eq!(names()[4], "surprise");
    }
}
