//! The shape signal h(x) = h_0 + H x (sections 2.1 and 3.1).

use faer::{Mat, MatRef};

use crate::linalg::dense::FactorError;
use crate::linalg::pca::pca;

/// The shape signal and the frames' coordinates in it.
#[derive(Clone, Debug)]
pub struct ShapeSignal {
    /// h_0: the mean frame, d numbers.
    pub offset: Vec<f64>,
    /// H: d x m, orthonormal columns by decreasing singular value; each column's entry of largest magnitude is positive (reading 9).
    pub basis: Mat<f64>,
    /// X: m x n, column i is x_i = H^T (z_i - h_0).
    pub coordinates: Mat<f64>,
    /// Singular values of the centred frames, at least m of them.
    pub singular_values: Vec<f64>,
}

/// Minimises (3) over all offset linear shape subspaces of dimension m; m is cut to the rank of the centred frames (reading 9).
///
/// `frames` is d x n. Costs one product of the data with itself, n^2 d flops, and n d m more for H.
pub fn shape_signal(frames: MatRef<'_, f64>, m: usize) -> Result<ShapeSignal, FactorError> {
    let pca = pca(frames, m)?;
    Ok(ShapeSignal {
        offset: pca.mean,
        basis: pca.basis,
        coordinates: pca.coordinates,
        singular_values: pca.singular_values,
    })
}
