//! The harness: cases, engines, checks, verdicts, timing and records. It knows stages and their arrays, no file format and no
//! algorithm's inside.

pub mod case;
pub mod compare;
pub mod engine;
pub mod figures;
pub mod inject;
pub mod judge;
pub mod measure;
pub mod peers;
pub mod record;
pub mod registry;
pub mod session;
pub mod stats;
pub mod tolerance;
pub mod verify;
pub mod wire;
