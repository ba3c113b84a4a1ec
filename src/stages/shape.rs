//! The stages of shape spaces (Cashman & Hormann 2012, section 5): frames to vectors and back.

use super::{Call, Stage, StageError, call};
use crate::arrays::{Array, Bundle};
use crate::mesh::Connectivity;
use crate::sequence::Sequence;
use crate::shape::{Space, SpaceKind, decode_all, encode_all, patches, prepare};

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
        name: "shape.patch_encode",
        about: "gradients against the mean rotations of patches, those against adjacent ones (section 5; Baran et al. 2009)",
        prepare: |inputs| encode(SpaceKind::Patch, inputs),
    },
    Stage {
        name: "shape.patch_decode",
        about: "frames from gradients in patches: rotations of patches, then one Poisson factorisation (section 5)",
        prepare: |inputs| decode(SpaceKind::Patch, inputs),
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
pub fn inputs(stage: &str, sequence: &Sequence) -> Result<Bundle, StageError> {
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
    let between = z.subcols(0, n - 1) + z.subcols(1, n - 1);
    let z = faer::concat![[z, 0.5 * between]];
    inputs.put("z", Array::columns(z.as_ref()));
    inputs.put("truth", frames);
    Ok(inputs)
}
