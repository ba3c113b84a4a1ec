//! Cashman & Hormann 2012, *A continuous, editable representation for deforming mesh sequences with separate signals for time, pose and
//! shape*: psi = h o g o f (equation (1)).
//!
//! | paper | here |
//! |---|---|
//! | 2.1, 3.1 shape signal h | [`h`] |
//! | 3.2.1 pose-space positions, pins | [`mds`], [`pins`], [`repin`] |
//! | 2.2, 3.2 pose signal g | [`g`] |
//! | 3.2.2 site order | [`sites`] |
//! | 2.3, 3.3 time signal f: parameters, knots, spline, rho | [`parameters`], [`knots`], [`f`], [`rho`] |
//! | 2.4 the chain psi | [`psi`] |
//! | (readings 8, 10) repeated poses | [`poses`] |
//! | 3 the reconstruction, errors (2), (3), (4), (7) | [`fit`] |
//! | 3.4 k, l, m from a tolerance | [`fidelity`] |
//! | (6, beyond the paper) (2) minimised itself | [`refine`] |
//! | 4.1 edits of the time signal, knots that leave it as it is | [`edit`], [`insert`]; in files [`edits_toml`] |
//! | 4.2 times for other rates, slow and fast motion | [`resample`] |
//! | 4.3 transfer by examples | [`transfer`] |
//! | 4.4 poses placed by hand, a sketched curve | [`design`], [`sketch`] |
//! | 6 a layout that needs no pins | [`layout`] |
//! | 6 in-betweens: saddles, the leave-out test, what frames tell of them | [`saddles`], [`leave_out`], [`cubic`] |
//! | 6 long sequences: windows that are joined smoothly | [`windows`], [`windows_fit`]; in files [`windows_file`] |
//! | 5 signals in another shape space | [`in_space`], and [`crate::shape`] for the spaces |
//!
//! Frames are columns: shapes Z are d x n, coordinates X are m x n. Points of the pose plane are `[f64; 2]`. Where the paper is silent or its
//! text is off, `docs/READINGS.md` says how it is read; "reading r" below is its number r.

mod basis;
pub mod cubic;
pub mod design;
pub mod dissimilarities;
pub mod edit;
pub mod edits_toml;
pub mod f;
pub mod fidelity;
pub mod file;
pub mod fit;
pub mod g;
pub mod h;
pub mod in_space;
pub mod insert;
pub mod knots;
pub mod layout;
pub mod leave_out;
pub mod mds;
pub mod parameters;
pub mod pins;
pub mod poses;
pub mod psi;
pub mod refine;
pub mod repin;
pub mod resample;
pub mod rho;
pub mod saddles;
pub mod sites;
pub mod sketch;
mod strand;
pub mod stress;
pub mod thin_plate;
mod thin_plate_fit;
pub mod transfer;
pub mod windows;
pub mod windows_file;
pub mod windows_fit;

/// A point of the pose plane.
pub type Point = [f64; 2];

pub(crate) fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}
