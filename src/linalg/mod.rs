//! What is thin over faer and nalgebra. Every routine here has a fixed order of operations, so that the same input gives the same bits, whatever the number
//! of threads. But for [`pca`], each runs on one; callers run independent pieces in parallel.

pub mod appended_qr;
pub mod banded;
pub mod compressed;
pub mod dense;
pub mod elimination;
pub mod entry;
pub mod gram;
pub mod kernels;
pub mod panels;
pub mod pca;
pub mod reflections;
pub mod rotation;
pub mod sparse;
pub mod sweeps;
pub mod tiles;
pub mod upper_triangular;
