//! Triangle meshes: validated connectivity and what is measured on it.

mod connectivity;
pub mod distance;
pub mod edges;
pub mod measure;
mod triangle;
pub(crate) mod vector;

pub use connectivity::{Connectivity, ConnectivityError};
