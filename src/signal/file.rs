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
//! | `reference` | (V, 3) | the shape space's reference frame; not in vertex space |
//! | `patches` | (F) | the patch of each triangle, -1 for degenerate ones; in the space of patches |
//! | `meta` | text | JSON: `format`, `space` |

use std::path::Path;
use std::sync::Arc;

use faer::{Mat, MatRef};
use thiserror::Error;

use super::Point;
use super::f::{Spline, SplineError};
use super::g::PoseSignal;
use super::in_space::sample_in_space;
use super::psi::{Representation, TimeSignal};
use super::windows::PlanError;
use crate::arrays::{Array, ArrayError, Bundle};
use crate::mesh::{Connectivity, ConnectivityError};
use crate::sequence::format::{FormatError, npz};
use crate::shape::reference::check_len;
use crate::shape::{ShapeError, Space, SpaceKind, UnknownSpace, prepare};

/// Frames whose vectors in the shape space are held at a time, for they are several times as long as positions.
pub const AT_A_TIME: usize = 32;
const FORMAT: &str = "meshseq signal 1";
/// The format of [`super::windows_file`].
pub(super) const WINDOWS_FORMAT: &str = "meshseq signal windows 1";

/// A representation and the mesh it deforms.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    pub representation: Representation,
    /// p_1 .. p_n, where scaling or the user put the frames.
    pub positions: Vec<Point>,
    pub connectivity: Arc<Connectivity>,
    /// What the numbers of a frame mean.
    pub space: SpaceKind,
    /// The shape space's reference frame, 3V positions; empty in vertex space.
    pub reference: Vec<f64>,
    /// The patch of each triangle, see [`crate::shape::patches::choose`]; empty in spaces without patches.
    pub patches: Vec<i64>,
}

impl Stored {
    /// Frames of V vertices at these times, n x 3V positions. Factors the space's systems; [`ShapeError::WrongLength`] where the representation is of
    /// another mesh than its reference.
    pub fn sample(&self, times: &[f64]) -> Result<Vec<f64>, ShapeError> {
        self.sample_in(self.prepare()?.as_deref(), times)
    }

    /// The same with what [`Self::prepare`] gave, for many calls.
    pub fn sample_in(
        &self,
        space: Option<&dyn Space>,
        times: &[f64],
    ) -> Result<Vec<f64>, ShapeError> {
        let Some(space) = space else {
            return Ok(self.representation.evaluate(times));
        };
        let mut frames = Vec::with_capacity(times.len() * space.frame_len());
        for some in times.chunks(AT_A_TIME) {
            frames.extend(sample_in_space(space, &self.representation, some)?);
        }
        Ok(frames)
    }

    /// The shape space with its factors; None for vertex space, which has none.
    pub fn prepare(&self) -> Result<Option<Box<dyn Space>>, ShapeError> {
        if self.space == SpaceKind::Vertex {
            return Ok(None);
        }
        let connectivity = self.connectivity.clone();
        let space = prepare(self.space, connectivity, &self.reference, &self.patches)?;
        check_len(
            "representation",
            &self.representation.offset,
            space.dimension(),
        )?;
        Ok(Some(space))
    }
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
    /// A file of windows where one representation of all frames is needed.
    #[error(
        "{path}: a representation in windows, which `meshseq signal sample` and `info` read; fit the sequence without --window for this"
    )]
    InWindows { path: String },
    /// See [`PlanError`].
    #[error("{path}: {source}; expected windows as `meshseq signal fit --window` writes them")]
    Plan { path: String, source: PlanError },
    /// Arrays that do not fit together.
    #[error("{path}: {what}; expected a representation as `meshseq signal fit` writes it")]
    Inconsistent { path: String, what: String },
}

/// Writes the representation; the file appears whole or not at all.
pub fn save(stored: &Stored, path: &Path) -> Result<(), RepresentationError> {
    let mut arrays = own_arrays(stored);
    arrays.push(("F", Array::triangles(stored.connectivity.faces())));
    arrays.push(("meta", Array::Text(meta(FORMAT, stored.space))));
    if stored.space != SpaceKind::Vertex {
        arrays.push(("reference", Array::vertices(&stored.reference)));
    }
    if stored.space == SpaceKind::Patch {
        arrays.push(("patches", Array::integers(&stored.patches)));
    }
    Ok(npz::write_arrays(path, &arrays)?)
}

/// The signals and where the frames are, which every window of a long sequence has of its own.
pub(super) fn own_arrays(stored: &Stored) -> Vec<(&'static str, Array)> {
    let r = &stored.representation;
    vec![
        ("h0", Array::vector(&r.offset)),
        ("H", Array::columns(r.basis.as_ref())),
        ("g", Array::columns(r.pose.coefficients.as_ref())),
        ("sites", Array::points(&r.pose.sites)),
        ("control", Array::points(&r.time.spline.control)),
        ("u", Array::vector(&r.time.spline.knots)),
        ("t", Array::vector(&r.time.parameters)),
        ("p", Array::points(&stored.positions)),
    ]
}

/// The names of [`own_arrays`].
pub(super) const OWN: [&str; 8] = ["h0", "H", "g", "sites", "control", "u", "t", "p"];

pub(super) fn meta(format: &str, space: SpaceKind) -> String {
    serde_json::json!({"format": format, "space": space.name()}).to_string()
}

/// Reads a representation back.
pub fn load(path: &Path) -> Result<Stored, RepresentationError> {
    let place = path.display().to_string();
    let bundle = Bundle(npz::read_arrays(path)?.into_iter().collect());
    let text = bundle.text("meta").map_err(|e| arrays(&place, e))?;
    if named_format(text) == Some(WINDOWS_FORMAT) {
        return Err(RepresentationError::InWindows { path: place });
    }
    let space = space_of(text, FORMAT).map_err(|what| inconsistent(&place, what))?;
    let (representation, positions) = own(&bundle, &place)?;
    let (reference, patches) = over(&bundle, space, &place)?;
    let numbers = match space {
        SpaceKind::Vertex => representation.dimension(),
        _ => reference.len(),
    };
    let connectivity = mesh(&bundle, numbers, &place)?;
    Ok(Stored {
        representation,
        positions,
        connectivity,
        space,
        reference,
        patches,
    })
}

fn arrays(place: &str, source: ArrayError) -> RepresentationError {
    let path = place.to_owned();
    RepresentationError::Arrays { path, source }
}

pub(super) fn inconsistent(place: &str, what: String) -> RepresentationError {
    let path = place.to_owned();
    RepresentationError::Inconsistent { path, what }
}

/// The arrays of [`own_arrays`] back; every number of the bundle is finite then.
pub(super) fn own(
    bundle: &Bundle,
    place: &str,
) -> Result<(Representation, Vec<Point>), RepresentationError> {
    let (representation, positions) = signals(bundle).map_err(|e| arrays(place, e))?;
    let not_finite = || {
        let found = bundle.first_not_finite()?;
        Some(format!("{found} is not finite"))
    };
    if let Some(what) = mismatch(&representation, &positions).or_else(not_finite) {
        return Err(inconsistent(place, what));
    }
    match representation.time.spline.check() {
        Ok(()) => Ok((representation, positions)),
        Err(source) => Err(RepresentationError::Spline {
            path: place.to_owned(),
            source,
        }),
    }
}

/// The reference frame and patches that a space needs.
pub(super) fn over(
    bundle: &Bundle,
    space: SpaceKind,
    place: &str,
) -> Result<(Vec<f64>, Vec<i64>), RepresentationError> {
    let arrays = |source| arrays(place, source);
    let reference = match space {
        SpaceKind::Vertex => Vec::new(),
        _ => bundle.f64("reference", 2).map_err(arrays)?.1.to_vec(),
    };
    let patches = match space {
        SpaceKind::Patch => bundle.integers("patches").map_err(arrays)?.to_vec(),
        _ => Vec::new(),
    };
    Ok((reference, patches))
}

/// The mesh of frames of so many coordinates.
pub(super) fn mesh(
    bundle: &Bundle,
    numbers: usize,
    place: &str,
) -> Result<Arc<Connectivity>, RepresentationError> {
    let faces = bundle.triangles("F").map_err(|e| arrays(place, e))?;
    if !numbers.is_multiple_of(3) {
        let what = format!("{numbers} coordinates are no whole number of vertices");
        return Err(inconsistent(place, what));
    }
    match Connectivity::new(numbers / 3, faces) {
        Ok(connectivity) => Ok(Arc::new(connectivity)),
        Err(source) => Err(RepresentationError::Connectivity {
            path: place.to_owned(),
            source,
        }),
    }
}

fn signals(bundle: &Bundle) -> Result<(Representation, Vec<Point>), ArrayError> {
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
    Ok((representation, bundle.points("p")?))
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
    if d == 0 || t.is_empty() {
        return Some("it has no vertices or no frames".into());
    }
    let falls = (1..t.len()).find(|&i| t[i] < t[i - 1])?;
    Some(format!("`t` falls at {falls} (0-based)"))
}

/// The format that `meta` names, where this program writes it.
pub(super) fn named_format(meta: &str) -> Option<&'static str> {
    let meta: serde_json::Value = serde_json::from_str(meta).unwrap_or_default();
    let ours = [FORMAT, WINDOWS_FORMAT];
    ours.into_iter().find(|format| meta["format"] == *format)
}

/// The space that `meta` names beside this format, or what is wrong with it.
pub(super) fn space_of(meta: &str, format: &str) -> Result<SpaceKind, String> {
    let meta: serde_json::Value = serde_json::from_str(meta).unwrap_or_default();
    if meta["format"] != format {
        return Err(format!(
            "`meta` has the format {}, expected \"{format}\"",
            meta["format"]
        ));
    }
    let name = meta["space"].as_str().unwrap_or_default();
    name.parse()
        .map_err(|unknown: UnknownSpace| format!("`meta`: {unknown}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::dataset::open;
    use crate::shape::patches;
    use crate::signal::fit::FitOptions;
    use crate::signal::in_space::fit_in_space;

    #[test]
    fn patches_are_stored_and_needed() {
        let sequence = open("@gallop-small").unwrap();
        let n = sequence.frame_count();
        let mesh = sequence.connectivity().clone();
        let labels = patches::choose(mesh.clone(), sequence.frame(0), sequence.positions());
        let labels = labels.unwrap();
        assert!(labels.contains(&1));
        let space = prepare(SpaceKind::Patch, mesh.clone(), sequence.frame(0), &labels);
        let options = FitOptions::new(n + 2, n, n - 1);
        let fit = fit_in_space(&*space.unwrap(), sequence.positions(), &options).unwrap();
        assert!(fit.rms < 1e-9, "{}", fit.rms);
        let mut stored = Stored {
            representation: fit.fit.representation,
            positions: fit.fit.positions,
            connectivity: mesh,
            space: SpaceKind::Patch,
            reference: sequence.frame(0).to_vec(),
            patches: labels,
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("patches.npz");
        save(&stored, &path).unwrap();
        let loaded = load(&path).unwrap();
        assert_eq!(loaded, stored);
        let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
        let frames = loaded.sample(&times).unwrap();
        let gaps = frames.iter().zip(sequence.positions());
        let worst = gaps.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-8, "{worst}");
        // One patch less is another space, no patches are none.
        stored.patches.iter_mut().for_each(|p| *p = 0);
        let refused = stored.sample(&times);
        assert!(
            matches!(refused, Err(ShapeError::WrongLength { .. })),
            "{refused:?}"
        );
        stored.patches.clear();
        assert!(matches!(stored.sample(&times), Err(ShapeError::Patch(_))));
    }
}
