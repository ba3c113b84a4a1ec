//! The harness: cases, engines, checks, verdicts, timing and records. It knows stages and their arrays, no file format and no
//! algorithm's inside.

pub mod record;
