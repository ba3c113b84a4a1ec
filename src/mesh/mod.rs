//! Triangle meshes: validated connectivity and what is measured on it.

mod connectivity;

pub use connectivity::{Connectivity, ConnectivityError};
