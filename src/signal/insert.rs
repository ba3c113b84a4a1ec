//! More knots, the same curve (Boehm 1980, *Inserting new knots into B-spline curves*): what makes an edit of the time signal as local as is wanted
//! (section 4.1).

use thiserror::Error;

use super::Point;
use super::basis::Basis;
use super::f::{Spline, SplineError};

/// A knot that occurs more often would tear a cubic curve apart.
const MOST_EQUAL: usize = 3;

/// Why a knot cannot be inserted.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum InsertError {
    /// See [`SplineError`].
    #[error(transparent)]
    Spline(#[from] SplineError),
    /// Outside the open domain.
    #[error("knot {value}: expected a parameter strictly between {low} and {high}")]
    Outside { value: f64, low: f64, high: f64 },
    /// One that is there three times already.
    #[error("knot {value} is there {MOST_EQUAL} times already; once more would tear the curve")]
    TooMany { value: f64 },
}

/// The spline with these knots inserted, in any order: k grows by their number, the curve stays as it is up to rounding, and control points whose
/// basis functions do not meet the new knots keep their bits. Knots must lie strictly inside the domain, and none may then occur more than three
/// times. O(r k) for r new knots.
pub fn insert_knots(spline: &Spline, knots: &[f64]) -> Result<Spline, InsertError> {
    spline.check()?;
    let mut ascending = knots.to_vec();
    ascending.sort_by(f64::total_cmp);
    let mut refined = spline.clone();
    for u in ascending {
        insert(&mut refined, u)?;
    }
    Ok(refined)
}

fn insert(spline: &mut Spline, u: f64) -> Result<(), InsertError> {
    let basis = Basis {
        knots: &spline.knots,
    };
    let (low, high) = basis.domain();
    if !(low < u && u < high) {
        return Err(InsertError::Outside {
            value: u,
            low,
            high,
        });
    }
    if multiplicity(spline, u) >= MOST_EQUAL {
        return Err(InsertError::TooMany { value: u });
    }
    let s = basis.span(u);
    let c = &spline.control;
    let blended: [Point; 3] = std::array::from_fn(|q| {
        let i = s - 2 + q;
        let share = (u - basis.knot(i)) / (basis.knot(i + 3) - basis.knot(i));
        std::array::from_fn(|a| (1.0 - share) * c[i - 1][a] + share * c[i][a])
    });
    spline.control.splice(s - 2..s, blended);
    spline.knots.insert(s, u);
    Ok(())
}

/// How often a knot occurs.
pub fn multiplicity(spline: &Spline, u: f64) -> usize {
    spline.knots.iter().filter(|&&knot| knot == u).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spline() -> Spline {
        let control = (0..9).map(|j| [(j as f64).sin(), (1.7 * j as f64).cos()]);
        Spline {
            control: control.collect(),
            knots: vec![0.0, 0.0, 0.0, 1.0, 1.5, 3.0, 3.0, 4.0, 6.0, 6.0, 6.0],
        }
    }

    proptest! {
        #[test]
        fn the_curve_stays_and_far_control_points_keep_their_bits(new in prop::collection::vec(0.01f64..5.99, 0..12)) {
            let before = spline();
            let after = insert_knots(&before, &new).unwrap();
            prop_assert_eq!(after.control.len(), 9 + new.len());
            prop_assert!(after.check().is_ok());
            for q in 0..=600 {
                let u = q as f64 / 100.0;
                prop_assert!(super::super::distance(before.evaluate(u), after.evaluate(u)) < 1e-13);
            }
            if new.iter().all(|&u| u > 3.0) {
                prop_assert_eq!(&after.control[..3], &before.control[..3]);
            }
        }
    }

    #[test]
    fn a_triple_knot_puts_a_control_point_on_the_curve() {
        let (before, u) = (spline(), 2.0);
        let after = insert_knots(&before, &[u; 3]).unwrap();
        let at = before.evaluate(u);
        let nearest = after.control.iter().map(|&c| super::super::distance(c, at));
        assert!(nearest.fold(f64::INFINITY, f64::min) < 1e-14);
        assert_eq!(
            insert_knots(&after, &[u]),
            Err(InsertError::TooMany { value: u })
        );
        // 3 is there twice.
        assert!(insert_knots(&before, &[3.0]).is_ok() && insert_knots(&before, &[3.0; 2]).is_err());
    }

    #[test]
    fn knots_outside_are_named() {
        for value in [0.0, 6.0, -1.0, 7.0, f64::NAN, f64::INFINITY] {
            let found = insert_knots(&spline(), &[value]);
            assert!(matches!(found, Err(InsertError::Outside { .. })), "{value}");
        }
        let mut torn = spline();
        torn.knots.pop();
        assert!(matches!(
            insert_knots(&torn, &[2.0]),
            Err(InsertError::Spline(_))
        ));
    }
}
