//! The stages of shape spaces (Cashman & Hormann 2012, section 5): frames to vectors and back.

use super::{Call, Stage, StageError, call, signal::Choice};
use crate::arrays::{Array, Bundle};
use crate::mesh::Connectivity;
use crate::mesh::measure::bounds;
use crate::mesh::vector::{norm, sub};
use crate::sequence::Sequence;
use crate::shape::halfway::halfway;
use crate::shape::{Space, SpaceKind, decode_all, encode_all, patches, prepare, prepare_for};

/// By space, encoding before decoding.
pub static STAGES: &[Stage] = &[
    Stage {
        name: "shape.gradient_encode",
        about: "deformation gradients: rotation vectors and stretches of every triangle (section 5; Sumner & Popovic 2004)",
        prepare: |inputs| encode(SpaceKind::Gradient, inputs),
    },
    Stage {
        name: "shape.gradient_decode",
        about: "frames from deformation gradients by one Poisson factorisation (section 5)",
        prepare: |inputs| decode(SpaceKind::Gradient, inputs),
    },
    Stage {
        name: "shape.lric_encode",
        about: "rotation-invariant coordinates: stretches of triangles, dihedral angles of edges (section 5; after Lipman et al. 2005)",
        prepare: |inputs| encode(SpaceKind::Lric, inputs),
    },
    Stage {
        name: "shape.lric_decode",
        about: "frames from rotation-invariant coordinates by two sparse systems (section 5)",
        prepare: |inputs| decode(SpaceKind::Lric, inputs),
    },
    Stage {
        name: "shape.lengths_encode",
        about: "lengths and dihedral angles of edges (section 5; Winkler et al. 2010, Froehlich & Botsch 2011)",
        prepare: |inputs| encode(SpaceKind::Lengths, inputs),
    },
    Stage {
        name: "shape.lengths_decode",
        about: "frames from lengths and dihedral angles by nonlinear least squares (section 5)",
        prepare: |inputs| decode(SpaceKind::Lengths, inputs),
    },
    Stage {
        name: "shape.patch_encode",
        about: "gradients against the mean rotations of patches, those against adjacent ones (section 5; Baran et al. 2009)",
        prepare: |inputs| encode(SpaceKind::Patch, inputs),
    },
    Stage {
        name: "shape.patch_decode",
        about: "frames from gradients in patches: rotations of patches, then one Poisson factorisation (section 5)",
        prepare: |inputs| decode(SpaceKind::Patch, inputs),
    },
    Stage {
        name: "shape.halfway",
        about: "halfway between two poses that no motion joins, in a shape space (section 5; beside as-rigid-as-possible deformations)",
        prepare: halfway_frame,
    },
];

/// Preparing the space (its reference, its factors) is not part of the work.
fn encode(kind: SpaceKind, inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let space = space(kind, inputs)?;
    let (shape, frames) = inputs.f64("frames", 3)?;
    let vertices = space.frame_len() / 3;
    if shape[1..] != [vertices, 3] {
        return Err(StageError::Failed(format!(
            "`frames` has shape {shape:?}, expected (n, {vertices}, 3)"
        )));
    }
    let frames = frames.to_vec();
    call(
        move || encode_all(&*space, &frames).map_err(StageError::from_error),
        |z| Bundle::from([("z", Array::columns(z.as_ref()))]),
    )
}

fn decode(kind: SpaceKind, inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let space = space(kind, inputs)?;
    let z = inputs.matrix("z")?;
    if z.nrows() != space.dimension() {
        return Err(StageError::Failed(format!(
            "`z` has {} numbers a frame, expected d = {}",
            z.nrows(),
            space.dimension()
        )));
    }
    let shape = vec![z.ncols(), space.frame_len() / 3, 3];
    call(
        move || decode_all(&*space, z.as_ref()).map_err(StageError::from_error),
        move |frames| {
            let data = frames.clone();
            let shape = shape.clone();
            Bundle::from([("frames", Array::F64 { shape, data })])
        },
    )
}

/// Between `start`, which is the reference too, and `end`, in the space that `space` names.
fn halfway_frame(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let kind = inputs.text("space")?.parse();
    let kind = kind.map_err(StageError::from_error)?;
    let faces = inputs.triangles("F")?;
    let (shape, start) = inputs.f64("start", 2)?;
    let (start, end) = (start.to_vec(), inputs.f64("end", 2)?.1.to_vec());
    let mesh = Connectivity::new(shape[0], faces).map_err(StageError::from_error)?;
    let both = [&start[..], &end].concat();
    let space = prepare_for(kind, &mesh.into(), &both).map_err(StageError::from_error)?;
    let shape = vec![start.len() / 3, 3];
    call(
        move || halfway(&*space, &start, &end).map_err(StageError::from_error),
        move |frame| {
            let (shape, data) = (shape.clone(), frame.clone());
            Bundle::from([("frame", Array::F64 { shape, data })])
        },
    )
}

/// The space over the bundle's `reference` and `F`, and its `patches` where the space has some.
fn space(kind: SpaceKind, inputs: &Bundle) -> Result<Box<dyn Space>, StageError> {
    let (shape, reference) = inputs.f64("reference", 2)?;
    if shape[1] != 3 {
        return Err(StageError::Failed(format!(
            "`reference` has shape {shape:?}, expected (V, 3)"
        )));
    }
    let connectivity =
        Connectivity::new(shape[0], inputs.triangles("F")?).map_err(StageError::from_error)?;
    let patches = match kind {
        SpaceKind::Patch => inputs.integers("patches")?,
        _ => &[],
    };
    prepare(kind, connectivity.into(), reference, patches).map_err(StageError::from_error)
}

/// Inputs made from a sequence, whose first frame is the reference and whose movement gives the patches. Vectors to decode are what Rust encodes, with the
/// frames they came from as `truth`, which only judges read; then the means of every two in a row, which are the vectors of no frame.
pub fn inputs(stage: &str, sequence: &Sequence, choice: &Choice) -> Result<Bundle, StageError> {
    if stage == "shape.halfway" {
        return halfway_inputs(sequence, choice.space);
    }
    let (n, d) = (sequence.frame_count(), sequence.dimension());
    let faces = sequence.connectivity().faces();
    let reference = Array::F64 {
        shape: vec![d / 3, 3],
        data: sequence.frame(0).to_vec(),
    };
    let frames = Array::F64 {
        shape: vec![n, d / 3, 3],
        data: sequence.positions().to_vec(),
    };
    let mut inputs = Bundle::from([("reference", reference), ("F", Array::triangles(faces))]);
    let Some((name, direction)) = stage
        .strip_prefix("shape.")
        .and_then(|rest| rest.rsplit_once('_'))
    else {
        return Err(StageError::Failed(format!("there is no stage `{stage}`")));
    };
    let kind: SpaceKind = name.parse().map_err(StageError::from_error)?;
    let mut labels = Vec::new();
    if kind == SpaceKind::Patch {
        let mesh = sequence.connectivity().clone();
        labels = patches::choose(mesh, sequence.frame(0), sequence.positions())
            .map_err(StageError::from_error)?;
        inputs.put("patches", Array::integers(&labels));
    }
    if direction == "encode" {
        inputs.put("frames", frames);
        return Ok(inputs);
    }
    let mesh = sequence.connectivity().clone();
    let space = prepare(kind, mesh, sequence.frame(0), &labels).map_err(StageError::from_error)?;
    let z = encode_all(&*space, sequence.positions());
    let z = z.map_err(StageError::from_error)?;
    let z = match choice.means {
        true => faer::concat![[&z, 0.5 * (z.subcols(0, n - 1) + z.subcols(1, n - 1))]],
        false => z,
    };
    inputs.put("z", Array::columns(z.as_ref()));
    inputs.put("truth", frames);
    Ok(inputs)
}

/// Vertices nearer to either end than this share of the diagonal are handles.
const HELD: f64 = 0.08;

/// From the first frame to the last. Handles, for engines that need some: the vertices around two that lie far apart in the first frame, held where
/// Rust puts them halfway.
fn halfway_inputs(sequence: &Sequence, kind: SpaceKind) -> Result<Bundle, StageError> {
    let (start, end) = (
        sequence.frame(0),
        sequence.frame(sequence.frame_count() - 1),
    );
    let space = prepare_for(kind, sequence.connectivity(), &[start, end].concat());
    let space = space.map_err(StageError::from_error)?;
    let between = halfway(&*space, start, end).map_err(StageError::from_error)?;
    let handles = ends(start);
    let targets: Vec<f64> = handles
        .iter()
        .flat_map(|&v| between[3 * v..3 * v + 3].to_vec())
        .collect();
    let points = |data: Vec<f64>| Array::F64 {
        shape: vec![data.len() / 3, 3],
        data,
    };
    Ok(Bundle::from([
        ("start", points(start.to_vec())),
        ("end", points(end.to_vec())),
        ("F", Array::triangles(sequence.connectivity().faces())),
        ("space", Array::Text(kind.to_string())),
        ("handles", Array::indices(&handles)),
        ("targets", points(targets)),
    ]))
}

/// The vertices around the one farthest from the first, and around the one farthest from that.
fn ends(frame: &[f64]) -> Vec<usize> {
    let points = frame.as_chunks::<3>().0;
    let distance = |a: usize, b: usize| norm(sub(points[a], points[b]));
    let farthest = |from: usize| {
        let by_distance = |&a: &usize, &b: &usize| distance(from, a).total_cmp(&distance(from, b));
        (0..points.len()).rev().max_by(by_distance).unwrap_or(0)
    };
    let one = farthest(0);
    let other = farthest(one);
    let near = HELD * bounds(frame).diagonal();
    (0..points.len())
        .filter(|&v| distance(v, one).min(distance(v, other)) <= near)
        .collect()
}
