//! Knots of the time signal (section 3.3, Piegl & Tiller section 9.4.1).

use std::str::FromStr;

use thiserror::Error;

/// How interior knots average the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KnotRule {
    /// Piegl & Tiller's (9.68), (9.69) as printed: what the rows of the paper's Table 1 are compared with. Near k = n its system is singular to
    /// rounding (condition 1e20 on the cow).
    Literal,
    /// The variant that treats both ends alike. The default: it degenerates to interpolation by itself and its system is well conditioned for every k
    /// (reading 2); against the literal rule (2) is halved on the cow and 1 to 5% higher on horse and samba.
    #[default]
    Symmetric,
}

/// Why there are no such knots.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum KnotError {
    /// k outside what the parameters allow.
    #[error(
        "k = {k} control points, expected 4 <= k <= {most} (two more than the {parameters} distinct parameters)"
    )]
    OutOfRange {
        k: usize,
        most: usize,
        parameters: usize,
    },
}

/// A knot rule that does not exist.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("unknown knot rule `{name}`, expected `literal` or `symmetric`")]
pub struct UnknownRule {
    pub name: String,
}

impl FromStr for KnotRule {
    type Err = UnknownRule;

    fn from_str(name: &str) -> Result<Self, UnknownRule> {
        match name {
            "literal" => Ok(Self::Literal),
            "symmetric" => Ok(Self::Symmetric),
            _ => Err(UnknownRule { name: name.into() }),
        }
    }
}

impl std::fmt::Display for KnotRule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Literal => "literal",
            Self::Symmetric => "symmetric",
        })
    }
}

/// The k + 2 knots u_0 .. u_{k+1} for strictly increasing parameters t_1 .. t_n.
///
/// Ends are clamped, u_0 = u_1 = u_2 = t_1 and u_{k-1} = u_k = u_{k+1} = t_n; the two outermost knots of the usual k + 4 change nothing and are dropped
/// (reading 1). Between them k - 4 interior knots average neighbouring parameters (reading 2); k = n + 2 is the interpolation u_{i+1} = t_i.
pub fn knots(parameters: &[f64], k: usize, rule: KnotRule) -> Result<Vec<f64>, KnotError> {
    let n = parameters.len();
    let most = n + 2;
    if k < 4 || k > most {
        return Err(KnotError::OutOfRange {
            k,
            most,
            parameters: n,
        });
    }
    let interior = (1..k - 3).map(|j| {
        if k == most {
            return parameters[j];
        }
        let (data, shift) = match rule {
            KnotRule::Literal => (n, 0),
            KnotRule::Symmetric => (n - 1, 1),
        };
        // jd = i + a with d = data / (k - 3), in whole numbers so that i is exact; t is 1-based in the reading.
        let i = j * data / (k - 3) + shift;
        let a = (j * data % (k - 3)) as f64 / (k - 3) as f64;
        (1.0 - a) * parameters[i - 1] + a * parameters[i]
    });
    let (first, last) = (parameters[0], parameters[n - 1]);
    Ok([first; 3]
        .into_iter()
        .chain(interior)
        .chain([last; 3])
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_interpolating_configuration_repeats_the_parameters() {
        let t = [0.0, 1.0, 3.0, 4.5, 5.0];
        for rule in [KnotRule::Literal, KnotRule::Symmetric] {
            assert_eq!(
                knots(&t, 7, rule).unwrap(),
                [0.0, 0.0, 0.0, 1.0, 3.0, 4.5, 5.0, 5.0, 5.0]
            );
            assert_eq!(knots(&t, 4, rule).unwrap(), [0.0, 0.0, 0.0, 5.0, 5.0, 5.0]);
            assert!(knots(&t, 3, rule).is_err() && knots(&t, 8, rule).is_err());
        }
    }

    #[test]
    fn the_printed_rule_is_taken_literally() {
        // n = 6, k = 6: d = 2, so u_3 = t_2 and u_4 = t_4.
        let t = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0];
        assert_eq!(knots(&t, 6, KnotRule::Literal).unwrap()[3..5], [1.0, 4.0]);
        // symmetric: d = 5/3, u_3 = t_2 + 2/3 (t_3 - t_2), u_4 = t_4 + 1/3 (t_5 - t_4).
        let u = knots(&t, 6, KnotRule::Symmetric).unwrap();
        assert!((u[3] - 5.0 / 3.0).abs() < 1e-15 && (u[4] - 16.0 / 3.0).abs() < 1e-14);
    }

    proptest! {
        #[test]
        fn knots_do_not_decrease(steps in prop::collection::vec(0.01f64..5.0, 4..40), share in 0.0f64..1.0) {
            let t: Vec<f64> = steps.iter().scan(0.0, |s, x| { *s += x; Some(*s) }).collect();
            let k = 4 + ((t.len() - 2) as f64 * share) as usize;
            for rule in [KnotRule::Literal, KnotRule::Symmetric] {
                let u = knots(&t, k, rule).unwrap();
                prop_assert_eq!(u.len(), k + 2);
                prop_assert!(u.windows(2).all(|w| w[0] <= w[1]));
            }
        }
    }
}
