//! What is thin over faer and nalgebra.
