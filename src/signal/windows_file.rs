//! Representations in windows on disk: one `.npz`, written and read a window at a time.
//!
//! | array | shape | |
//! |---|---|---|
//! | `meta` | text | JSON: `format`, `space` |
//! | `windows` | (W, 2) | first frame of each window, 0-based, and the frame after its last |
//! | `overlap` | | frames that neighbours have in common; see [`super::windows`] |
//! | `F` | (F, 3) | triangles, 0-based |
//! | `reference` | (V, 3) | the shape space's reference frame; not in vertex space |
//! | `0/h0`, `0/H`, ... `0/p` | | the signals of window 0 (0-based), as in [`super::file`]; with `0/patches` in the space of patches |

use std::path::Path;
use std::sync::Arc;

use super::file::{
    OWN, RepresentationError, Stored, WINDOWS_FORMAT as FORMAT, inconsistent, load, mesh, meta,
    named_format, over, own, own_arrays, space_of,
};
use super::windows::{Plan, blend};
use crate::arrays::{Array, ArrayError, Bundle};
use crate::mesh::Connectivity;
use crate::sequence::format::npz::{Archive, Writer};
use crate::shape::{ShapeError, Space, SpaceKind};
use thiserror::Error;

/// A window and the one that follows it.
const HELD: usize = 2;

/// A file of windows that has not got its name yet; dropping it removes it.
pub struct WindowsWriter {
    out: Writer,
    next: usize,
    windows: usize,
}

impl WindowsWriter {
    /// A file that is to go to `path` in the end, of windows that are still to be fitted.
    pub fn create(
        path: &Path,
        plan: &Plan,
        connectivity: &Connectivity,
        space: SpaceKind,
    ) -> Result<Self, RepresentationError> {
        let mut out = Writer::create(path)?;
        let ranges = plan.windows().iter();
        let ranges = ranges
            .flat_map(|w| [w.start as i64, w.end as i64])
            .collect();
        let windows = Array::I64 {
            shape: vec![plan.windows().len(), 2],
            data: ranges,
        };
        for (name, array) in [
            ("meta", Array::Text(meta(FORMAT, space))),
            ("windows", windows),
            ("overlap", Array::integer(plan.overlap())),
            ("F", Array::triangles(connectivity.faces())),
        ] {
            out.add(name, (&array).into())?;
        }
        Ok(Self {
            out,
            next: 0,
            windows: plan.windows().len(),
        })
    }

    /// The next window, over the same mesh, space and reference as the ones before.
    pub fn add(&mut self, stored: &Stored) -> Result<(), RepresentationError> {
        if self.next == 0 && stored.space != SpaceKind::Vertex {
            let reference = Array::vertices(&stored.reference);
            self.out.add("reference", (&reference).into())?;
        }
        let mut arrays = own_arrays(stored);
        if stored.space == SpaceKind::Patch {
            arrays.push(("patches", Array::integers(&stored.patches)));
        }
        for (name, array) in arrays {
            self.out.add(&place(self.next, name), (&array).into())?;
        }
        self.next += 1;
        Ok(())
    }

    /// Gives the file its name, once every window is there.
    pub fn finish(self) -> Result<(), RepresentationError> {
        if self.next != self.windows {
            let what = format!("{} windows of {}", self.next, self.windows);
            return Err(inconsistent(&self.out.path().display().to_string(), what));
        }
        Ok(self.out.finish()?)
    }
}

fn place(window: usize, name: &str) -> String {
    format!("{window}/{name}")
}

/// Why frames cannot be sampled.
#[derive(Debug, Error)]
pub enum SampleError {
    /// See [`RepresentationError`].
    #[error(transparent)]
    Representation(#[from] RepresentationError),
    /// See [`ShapeError`].
    #[error("{path}: {source}")]
    Shape { path: String, source: ShapeError },
}

/// A representation on disk, in windows or in one piece, that is sampled some frames at a time. At most two windows are in memory.
pub struct WindowsFile {
    place: String,
    plan: Plan,
    space: SpaceKind,
    connectivity: Arc<Connectivity>,
    /// `reference` where there is one; None for a representation in one piece, which stays in memory.
    file: Option<(Archive, Bundle)>,
    held: Vec<Held>,
}

/// A window in memory.
struct Held {
    window: usize,
    stored: Stored,
    space: Option<Box<dyn Space>>,
}

impl WindowsFile {
    /// Opens what [`WindowsWriter`] or [`super::file::save`] wrote; the latter is one window.
    pub fn open(path: &Path) -> Result<Self, SampleError> {
        let place = path.display().to_string();
        let mut archive = Archive::open(path).map_err(RepresentationError::from)?;
        if !is_windows(&mut archive) {
            return Self::whole(load(path)?, place);
        }
        let (plan, space, bundle) = head(&mut archive, &place)?;
        let numbers = match space {
            SpaceKind::Vertex => first_length(&mut archive)?,
            _ => over_length(&bundle, &place)?,
        };
        let connectivity = mesh(&bundle, numbers, &place)?;
        Ok(Self {
            place,
            plan,
            space,
            connectivity,
            file: Some((archive, bundle)),
            held: Vec::new(),
        })
    }

    fn whole(stored: Stored, place: String) -> Result<Self, SampleError> {
        let mut file = Self {
            plan: Plan::single(stored.representation.time.frame_count()),
            space: stored.space,
            connectivity: stored.connectivity.clone(),
            file: None,
            held: Vec::new(),
            place,
        };
        let held = file.prepared(0, stored)?;
        file.held.push(held);
        Ok(file)
    }

    /// Which frames are in which window.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The mesh that all windows deform.
    pub fn connectivity(&self) -> &Arc<Connectivity> {
        &self.connectivity
    }

    /// The shape space of all windows.
    pub fn space(&self) -> SpaceKind {
        self.space
    }

    /// The signals of a window, read where they are not in memory; panics where there is no such window, as a slice does.
    pub fn window(&mut self, window: usize) -> Result<&Stored, SampleError> {
        Ok(&self.hold(window)?.stored)
    }

    /// Frames of V vertices at these times, which must lie in [1, n]: times x 3V positions, windows blended as [`super::windows`] says. Every window is
    /// read at most once a call.
    pub fn sample(&mut self, times: &[f64]) -> Result<Vec<f64>, SampleError> {
        let plan = self.plan.clone();
        blend(&plan, times, |window, own| {
            let held = self.hold(window)?;
            let found = held.stored.sample_in(held.space.as_deref(), own);
            found.map_err(|source| self.shape(source))
        })
    }

    fn hold(&mut self, window: usize) -> Result<&Held, SampleError> {
        if let Some(at) = self.held.iter().position(|held| held.window == window) {
            return Ok(&self.held[at]);
        }
        if self.held.len() == HELD {
            self.held.remove(0);
        }
        let stored = self.read(window)?;
        let held = self.prepared(window, stored)?;
        self.held.push(held);
        Ok(&self.held[self.held.len() - 1])
    }

    fn prepared(&self, window: usize, stored: Stored) -> Result<Held, SampleError> {
        let space = stored.prepare().map_err(|source| self.shape(source))?;
        Ok(Held {
            window,
            stored,
            space,
        })
    }

    fn shape(&self, source: ShapeError) -> SampleError {
        let path = self.place.clone();
        SampleError::Shape { path, source }
    }

    fn read(&mut self, window: usize) -> Result<Stored, SampleError> {
        let place = format!("{}: window {} (1-based)", self.place, window + 1);
        let length = self.plan.windows()[window].len();
        let Some((archive, shared)) = &mut self.file else {
            let what = "it is not in memory".to_owned();
            return Err(inconsistent(&place, what).into());
        };
        let mut bundle = Bundle::default();
        let patches = (self.space == SpaceKind::Patch).then_some("patches");
        for name in OWN.into_iter().chain(patches) {
            let array = archive.read(&self::place(window, name));
            bundle.put(name, array.map_err(RepresentationError::from)?);
        }
        if let Some(reference) = shared.0.get("reference") {
            bundle.put("reference", reference.clone());
        }
        let (representation, positions) = own(&bundle, &place)?;
        let (reference, patches) = over(&bundle, self.space, &place)?;
        let numbers = self.connectivity.vertex_count() * 3;
        let what = match self.space {
            _ if positions.len() != length => {
                Some(format!("{} frames, expected {length}", positions.len()))
            }
            SpaceKind::Vertex if representation.dimension() != numbers => Some(format!(
                "length of `h0` is {} but the first window's is {numbers}",
                representation.dimension()
            )),
            _ => None,
        };
        match what {
            Some(what) => Err(inconsistent(&place, what).into()),
            None => Ok(Stored {
                representation,
                positions,
                connectivity: self.connectivity.clone(),
                space: self.space,
                reference,
                patches,
            }),
        }
    }
}

/// Whether a file has windows or says that it has.
fn is_windows(archive: &mut Archive) -> bool {
    let meta = archive.read("meta");
    let says =
        |meta: &Array| matches!(meta, Array::Text(text) if named_format(text) == Some(FORMAT));
    archive.names().any(|name| name == "windows") || meta.is_ok_and(|meta| says(&meta))
}

/// What a file of windows holds beside them.
fn head(archive: &mut Archive, place: &str) -> Result<(Plan, SpaceKind, Bundle), SampleError> {
    let mut bundle = Bundle::default();
    for name in ["meta", "windows", "overlap", "F"] {
        let array = archive.read(name).map_err(RepresentationError::from)?;
        bundle.put(name, array);
    }
    let arrays = |source| RepresentationError::Arrays {
        path: place.to_owned(),
        source,
    };
    let space = space_of(bundle.text("meta").map_err(arrays)?, FORMAT);
    let space = space.map_err(|what| inconsistent(place, what))?;
    if space != SpaceKind::Vertex {
        let reference = archive
            .read("reference")
            .map_err(RepresentationError::from)?;
        bundle.put("reference", reference);
    }
    let ranges = ranges(&bundle).map_err(arrays)?;
    let overlap = bundle.integer("overlap").map_err(arrays)?;
    let plan = Plan::from_windows(ranges, overlap).map_err(|source| RepresentationError::Plan {
        path: place.to_owned(),
        source,
    })?;
    Ok((plan, space, bundle))
}

fn ranges(bundle: &Bundle) -> Result<Vec<std::ops::Range<usize>>, ArrayError> {
    let wrong = |found: &Array| ArrayError {
        name: "windows".into(),
        expected: "an i64 array of shape (W, 2), of at least 0".into(),
        found: found.describe(),
    };
    match bundle.get("windows")? {
        Array::I64 { shape, data }
            if matches!(shape[..], [_, 2]) && data.iter().all(|&x| x >= 0) =>
        {
            let pairs = data.chunks_exact(2);
            Ok(pairs
                .map(|pair| pair[0] as usize..pair[1] as usize)
                .collect())
        }
        other => Err(wrong(other)),
    }
}

/// The coordinates of a frame in vertex space.
fn first_length(archive: &mut Archive) -> Result<usize, RepresentationError> {
    let offset = archive.read(&place(0, "h0"))?;
    Ok(match offset {
        Array::F64 { data, .. } => data.len(),
        _ => 0,
    })
}

/// The coordinates of the reference frame.
fn over_length(bundle: &Bundle, place: &str) -> Result<usize, RepresentationError> {
    let path = || place.to_owned();
    let reference = bundle.f64("reference", 2);
    let (_, data) = reference.map_err(|source| RepresentationError::Arrays {
        path: path(),
        source,
    })?;
    Ok(data.len())
}
