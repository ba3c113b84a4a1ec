//! Algorithms on deforming mesh sequences, verified and timed beside independent oracles.
//!
//! The map of the crate; imports point downwards in this list only.
//!
//! | module | what is there |
//! |---|---|
//! | [`arrays`] | typed arrays under names |
//! | [`mesh`] | connectivity, measures (area, volume, bounds), distance to a surface |
//! | [`linalg`] | what is thin over faer and nalgebra |
//! | [`sequence`] | deforming sequences, their file formats and the embedded `@name` sequences |
//! | [`shape`] | shape spaces: frames as vectors of numbers other than positions, and back |
//! | [`signal`] | Cashman & Hormann 2012: time, pose and shape signals |
//! | [`stages`] | the algorithms as named stages over typed arrays |
//! | [`exhibits`] | tables, charts and pictures that show what the algorithms do |
//! | [`harness`] | cases, engines, checks, verdicts, timing, records |
//! | [`report`] | plots and the HTML report |
//! | [`cmd`] | the command line, one file a verb |

pub mod arrays;
pub mod cmd;
pub mod exhibits;
pub mod harness;
pub mod linalg;
pub mod mesh;
pub mod report;
pub mod sequence;
pub mod shape;
pub mod signal;
pub mod stages;
