//! Representations on disk: one `.npz` that numpy opens, with its metadata, and that loads back bit for bit.
//!
//! | array | shape | |
//! |---|---|---|
//! | `h0` | (d) | offset of the shape signal |
//! | `H` | (m, d) | basis of the shape signal, one vector a row |
//! | `g` | (l + 3, m) | g_0, g_1 .. g_l and the two columns of G, one a row |
//! | `sites` | (l, 2) | sites of the pose signal |
//! | `control` | (k, 2) | control points of the time signal |
//! | `u` | (k + 2) | knots |
//! | `t` | (n) | parameters of the frames |
//! | `p` | (n, 2) | pose-space positions of the frames |
//! | `F` | (F, 3) | triangles, 0-based |
//! | `meta` | text | JSON: `format`, `space` |

use std::path::Path;
use std::sync::Arc;

use faer::{Mat, MatRef};
use thiserror::Error;

use super::Point;
use super::f::{Spline, SplineError};
use super::g::PoseSignal;
use super::psi::{Representation, TimeSignal};
use crate::arrays::{Array, ArrayError, Bundle};
use crate::mesh::{Connectivity, ConnectivityError};
use crate::sequence::format::{FormatError, npz};

const FORMAT: &str = "meshseq signal 1";
const SPACE: &str = "vertex";

/// A representation and the mesh it deforms.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    pub representation: Representation,
    /// p_1 .. p_n, where scaling or the user put the frames.
    pub positions: Vec<Point>,
    pub connectivity: Arc<Connectivity>,
}

/// Why a file is no representation.
#[derive(Debug, Error)]
pub enum RepresentationError {
    /// See [`FormatError`].
    #[error(transparent)]
    Format(#[from] FormatError),
    /// An array is missing or of another kind.
    #[error("{path}: {source}; expected a representation as `meshseq signal fit` writes it")]
    Arrays { path: String, source: ArrayError },
    /// See [`ConnectivityError`].
    #[error("{path}: {source}")]
    Connectivity {
        path: String,
        source: ConnectivityError,
    },
    /// See [`SplineError`].
    #[error("{path}: `u` and `control` are no time signal: {source}")]
    Spline { path: String, source: SplineError },
    /// Arrays that do not fit together.
    #[error("{path}: {what}; expected a representation as `meshseq signal fit` writes it")]
    Inconsistent { path: String, what: String },
}

/// Writes the representation; the file appears whole or not at all.
pub fn save(stored: &Stored, path: &Path) -> Result<(), RepresentationError> {
    let r = &stored.representation;
    let meta = serde_json::json!({"format": FORMAT, "space": SPACE}).to_string();
    let arrays = [
        ("h0", Array::vector(&r.offset)),
        ("H", Array::columns(r.basis.as_ref())),
        ("g", Array::columns(r.pose.coefficients.as_ref())),
        ("sites", Array::points(&r.pose.sites)),
        ("control", Array::points(&r.time.spline.control)),
        ("u", Array::vector(&r.time.spline.knots)),
        ("t", Array::vector(&r.time.parameters)),
        ("p", Array::points(&stored.positions)),
        ("F", Array::triangles(stored.connectivity.faces())),
        ("meta", Array::Text(meta)),
    ];
    Ok(npz::write_arrays(path, &arrays)?)
}

/// Reads a representation back.
pub fn load(path: &Path) -> Result<Stored, RepresentationError> {
    let bundle = Bundle(npz::read_arrays(path)?.into_iter().collect());
    let place = path.display().to_string();
    let stored = read(&bundle).map_err(|source| RepresentationError::Arrays {
        path: place.clone(),
        source,
    })?;
    let faces = bundle
        .triangles("F")
        .map_err(|source| RepresentationError::Arrays {
            path: place.clone(),
            source,
        })?;
    let (representation, positions, meta) = stored;
    let what = mismatch(&representation, &positions)
        .or_else(|| foreign(&meta))
        .or_else(|| {
            bundle
                .first_not_finite()
                .map(|found| format!("{found} is not finite"))
        });
    if let Some(what) = what {
        return Err(RepresentationError::Inconsistent { path: place, what });
    }
    let spline = representation.time.spline.check();
    spline.map_err(|source| RepresentationError::Spline {
        path: place.clone(),
        source,
    })?;
    let connectivity =
        Connectivity::new(representation.dimension() / 3, faces).map_err(|source| {
            RepresentationError::Connectivity {
                path: place,
                source,
            }
        })?;
    Ok(Stored {
        representation,
        positions,
        connectivity: Arc::new(connectivity),
    })
}

fn read(bundle: &Bundle) -> Result<(Representation, Vec<Point>, String), ArrayError> {
    let spline = Spline {
        control: bundle.points("control")?,
        knots: bundle.vector("u")?.to_vec(),
    };
    let representation = Representation {
        time: TimeSignal::new(spline, bundle.vector("t")?.to_vec()),
        pose: PoseSignal {
            sites: bundle.points("sites")?,
            coefficients: transposed(bundle, "g")?,
        },
        offset: bundle.vector("h0")?.to_vec(),
        basis: transposed(bundle, "H")?,
    };
    Ok((
        representation,
        bundle.points("p")?,
        bundle.text("meta")?.to_owned(),
    ))
}

fn transposed(bundle: &Bundle, name: &str) -> Result<Mat<f64>, ArrayError> {
    let (shape, data) = bundle.f64(name, 2)?;
    Ok(MatRef::from_column_major_slice(data, shape[1], shape[0]).to_owned())
}

/// What does not fit together.
fn mismatch(r: &Representation, positions: &[Point]) -> Option<String> {
    let (d, m) = r.basis.shape();
    let t = &r.time.parameters;
    let pairs = [
        ("length of `h0`", r.offset.len(), "columns of `H`", d),
        (
            "columns of `g`",
            r.pose.coefficients.nrows(),
            "rows of `H`",
            m,
        ),
        (
            "rows of `g`",
            r.pose.coefficients.ncols(),
            "rows of `sites` + 3",
            r.pose.sites.len() + 3,
        ),
        ("rows of `p`", positions.len(), "length of `t`", t.len()),
    ];
    if let Some((a, x, b, y)) = pairs.into_iter().find(|(_, x, _, y)| x != y) {
        return Some(format!("{a} is {x} but {b} is {y}"));
    }
    if d % 3 != 0 || d == 0 || t.is_empty() {
        return Some("it has no vertices or no frames".into());
    }
    let falls = (1..t.len()).find(|&i| t[i] < t[i - 1])?;
    Some(format!("`t` falls at {falls} (0-based)"))
}

/// What says that the arrays mean something else.
fn foreign(meta: &str) -> Option<String> {
    let meta: serde_json::Value = serde_json::from_str(meta).unwrap_or_default();
    [("format", FORMAT), ("space", SPACE)]
        .into_iter()
        .find(|(key, expected)| meta[key] != *expected)
        .map(|(key, expected)| {
            format!(
                "`meta` has the {key} {}, expected \"{expected}\"",
                meta[key]
            )
        })
}
