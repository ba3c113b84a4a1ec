//! Triangle meshes: validated connectivity and what is measured on it.

mod connectivity;
pub mod dihedral;
pub mod distance;
pub mod measure;
pub mod orientation;
mod predicates;
pub mod self_intersections;
pub mod topology;
mod tree;
mod triangle;
pub(crate) mod vector;

pub use connectivity::{Connectivity, ConnectivityError};
