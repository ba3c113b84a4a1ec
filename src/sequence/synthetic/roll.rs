//! `@roll`: a flat strip rolled up by a known angle, every triangle keeping its shape.
//!
//! The strip is made of flat facets, one a column, hinged along lines parallel to z. At angle theta each of the `columns - 1` hinges turns
//! by theta / columns, so the ends of the columns lie on a circle whose chords are as long as the facets: an exact isometry of the mesh,
//! not only of the smooth strip. Edge lengths are the same in all frames and dihedral angles are proportional to theta, hence blending
//! lengths and dihedral angles (or facets' relative rotations) of the rolls theta_0 and theta_1 with weights 1 - w and w gives, up to a
//! rigid motion, the roll (1 - w) theta_0 + w theta_1. The strip is slanted, so that its turns lie beside each other as in a coil.

use nalgebra::Vector3;

use super::{SyntheticError, assemble, grid};
use crate::sequence::Sequence;

/// Number of frames of `@roll` and of `@roll-small`.
pub const FRAMES: usize = 36;

/// A strip at rest: |x| <= length / 2, y = 0, |z - slant x| <= width / 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strip {
    /// Extent along x, in which it is rolled.
    pub length: f64,
    /// Extent along z, the axis of the roll.
    pub width: f64,
    /// How far z moves on with each unit of x.
    pub slant: f64,
    /// Number of quads along x, at least 1.
    pub columns: usize,
    /// Number of quads along z, at least 1.
    pub rows: usize,
}

/// The strip of `@roll`.
pub const FULL: Strip = Strip {
    length: 10.0,
    width: 1.0,
    slant: 0.3,
    columns: 120,
    rows: 10,
};

/// The strip of `@roll-small`.
pub const SMALL: Strip = Strip {
    columns: 40,
    rows: 3,
    ..FULL
};

/// The angle of frame `frame` (0-based), in radians: 20 degrees a frame, from 0 to 700 degrees.
pub fn roll_angle(frame: usize) -> f64 {
    roll_degrees(frame).to_radians()
}

fn roll_degrees(frame: usize) -> f64 {
    20.0 * frame as f64
}

/// The strip rolled by `angle` (radians, any sign) in all; vertex (column, row) has the index `column (rows + 1) + row`.
///
/// With s in [-1/2, 1/2] along the strip, c its number of columns and R = length / (2 c sin(angle / (2 c))):
/// x = R sin(s angle), y = R (1 - cos(s angle)), z = slant length s + width times the place across. The middle stays at the origin, with
/// its tangent along x; a positive angle rolls towards +y. Needs |angle| < 2 pi c.
pub fn roll_strip(angle: f64, strip: &Strip) -> Vec<Vector3<f64>> {
    let mut points = Vec::with_capacity((strip.columns + 1) * (strip.rows + 1));
    for column in 0..=strip.columns {
        let s = column as f64 / strip.columns as f64 - 0.5;
        let [x, y] = arc(angle, s, strip);
        for row in 0..=strip.rows {
            let across = row as f64 / strip.rows as f64 - 0.5;
            let z = strip.slant * strip.length * s + strip.width * across;
            points.push(Vector3::new(x, y, z));
        }
    }
    points
}

/// (R sin(s angle), R (1 - cos(s angle))), also where the angle vanishes.
fn arc(angle: f64, s: f64, strip: &Strip) -> [f64; 2] {
    let hinge = angle / strip.columns as f64;
    if hinge == 0.0 {
        return [strip.length * s, 0.0];
    }
    let radius = strip.length / strip.columns as f64 / (2.0 * (0.5 * hinge).sin());
    let half = 0.5 * s * angle;
    [
        radius * (s * angle).sin(),
        2.0 * radius * half.sin() * half.sin(),
    ]
}

/// One frame for each angle (degrees, any sign, in any order): the strip rolled by it in all, as by [`roll_strip`], faces up where it is flat.
///
/// `@roll` is `strip_rolled` of [`FULL`] by 0, 20, ... 700 degrees. Angles must be below a whole turn a column, and columns, rows and angles
/// at least one. O(V) each.
pub fn strip_rolled(strip: &Strip, degrees: &[f64]) -> Result<Sequence, SyntheticError> {
    let (columns, rows) = (strip.columns, strip.rows);
    if columns == 0 || rows == 0 {
        return Err(SyntheticError::NoQuads { columns, rows });
    }
    if degrees.is_empty() {
        return Err(SyntheticError::NoFrames);
    }
    let limit = 360.0 * columns as f64;
    if let Some(&degrees) = degrees.iter().find(|d| d.is_nan() || d.abs() >= limit) {
        return Err(SyntheticError::TooFar { degrees, limit });
    }
    let frames: Vec<_> = degrees
        .iter()
        .map(|d| roll_strip(d.to_radians(), strip))
        .collect();
    // columns run along x and rows along z, so y would be down: turn the triangles round
    let faces = grid::faces(columns, rows)
        .into_iter()
        .map(|[a, b, c]| [a, c, b])
        .collect();
    assemble(faces, &frames)
}

pub(super) fn build(strip: &Strip, frames: usize) -> Result<Sequence, SyntheticError> {
    let degrees: Vec<f64> = (0..frames).map(roll_degrees).collect();
    strip_rolled(strip, &degrees)
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};
    use super::*;

    #[test]
    fn every_edge_keeps_its_length() {
        for name in ["@roll", "@roll-small"] {
            let sequence = embedded(name).unwrap();
            let stretch = checks::largest_stretch(&sequence, &checks::points(sequence.frame(0)));
            assert!(stretch < 1e-12, "{name}: {stretch}");
        }
    }

    #[test]
    fn the_ends_turn_by_the_angle() {
        let strip = &FULL;
        for frame in 0..FRAMES {
            let p = roll_strip(roll_angle(frame), strip);
            let ring = strip.rows + 1;
            let facet = |column: usize| {
                let edge = p[(column + 1) * ring] - p[column * ring];
                edge.y.atan2(edge.x)
            };
            // first to last facet: one hinge less than the columns
            let hinges = (strip.columns - 1) as f64 / strip.columns as f64;
            let turn = facet(strip.columns - 1) - facet(0) - roll_angle(frame) * hinges;
            let whole_turns = turn / std::f64::consts::TAU;
            assert!((whole_turns - whole_turns.round()).abs() < 1e-12, "{frame}");
        }
    }

    #[test]
    fn turns_of_the_coil_do_not_touch() {
        let full_turn = FULL.length * std::f64::consts::TAU / roll_angle(FRAMES - 1);
        assert!(FULL.slant * full_turn > 1.2 * FULL.width);
    }

    #[test]
    fn it_starts_flat_facing_up_and_is_one_open_sheet() {
        let sequence = embedded("@roll").unwrap();
        assert!(sequence.frame(0).chunks(3).all(|p| p[1] == 0.0));
        assert!(checks::area_vector(&sequence, 0).y > 9.99);
        checks::assert_disc(&sequence);
    }

    #[test]
    fn a_negative_angle_mirrors_and_a_tiny_one_is_nearly_flat() {
        let (a, b) = (roll_strip(2.0, &SMALL), roll_strip(-2.0, &SMALL));
        for (p, q) in a.iter().zip(&b) {
            assert!((p.x - q.x).abs() < 1e-14 && (p.y + q.y).abs() < 1e-14);
        }
        let (flat, tiny) = (roll_strip(0.0, &SMALL), roll_strip(1e-9, &SMALL));
        assert!(flat.iter().zip(&tiny).all(|(p, q)| (p - q).norm() < 1e-7));
    }
    #[test]
    fn any_angle_is_an_isometry_with_the_hinges_that_it_says() {
        let degrees = [0.0, 123.4, 700.0, -360.0];
        let sequence = strip_rolled(&SMALL, &degrees).unwrap();
        let stretch = checks::largest_stretch(&sequence, &roll_strip(0.0, &SMALL));
        assert!(stretch < 1e-12, "{stretch}");
        let ring = SMALL.rows + 1;
        for (i, degrees) in degrees.into_iter().enumerate() {
            let p = checks::points(sequence.frame(i));
            let along = |c: usize| (p[(c + 1) * ring] - p[c * ring]).xy();
            for column in 1..SMALL.columns {
                let (a, b) = (along(column - 1), along(column));
                let hinge = a.perp(&b).atan2(a.dot(&b)).to_degrees();
                let expected = degrees / SMALL.columns as f64;
                assert!((hinge - expected).abs() < 1e-9, "{degrees}: {hinge}");
            }
        }
        let roll = embedded("@roll-small").unwrap();
        assert_eq!(roll.frame(35), sequence.frame(2));
    }

    #[test]
    fn what_cannot_be_rolled_is_refused() {
        let none = Strip { rows: 0, ..SMALL };
        let refused = strip_rolled(&none, &[1.0]).unwrap_err().to_string();
        assert!(refused.contains("40 x 0"), "{refused}");
        for far in [14400.0, -14400.0, f64::INFINITY, f64::NAN] {
            let refused = strip_rolled(&SMALL, &[0.0, far]).unwrap_err().to_string();
            assert!(refused.contains(&far.to_string()), "{refused}");
            assert!(refused.contains("14400"), "{refused}");
        }
        assert!(strip_rolled(&SMALL, &[14399.0]).is_ok());
        let refused = strip_rolled(&SMALL, &[]).unwrap_err();
        assert_eq!(refused, SyntheticError::NoFrames);
    }
}
