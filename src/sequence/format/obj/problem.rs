//! What can be wrong with a line of an OBJ file.

use thiserror::Error;

use super::parse::MAX_LINE;

/// What is wrong at one place of an OBJ file. Vertices are counted from 0; texts are cut after 40 bytes.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ObjProblem {
    /// Something else where a number should be.
    #[error("expected a number, found '{text}'")]
    BadNumber { text: String },
    /// A coordinate that is NaN, infinite or too large for a double.
    #[error("coordinate {axis} of vertex {vertex} (0-based) is '{text}', expected a finite number")]
    NotFinite {
        vertex: u64,
        axis: char,
        text: String,
    },
    /// A vertex that is cut short.
    #[error("expected 3 coordinates after 'v', found {found}")]
    TooFewCoordinates { found: usize },
    /// More numbers than a vertex can have.
    #[error("expected at most 'v x y z' and four more numbers (weight or colour), found '{text}'")]
    TooManyCoordinates { text: String },
    /// Something else where a corner of a face should be.
    #[error("expected a corner such as 7, 7/2, 7//3, 7/2/3 or -1, found '{text}'")]
    BadCorner { text: String },
    /// OBJ counts from 1.
    #[error("vertex index 0; OBJ files count from 1")]
    IndexZero,
    /// A corner at a vertex that does not exist.
    #[error("vertex index {text} is out of range; there are {vertices} vertices")]
    IndexOutOfRange { text: String, vertices: u64 },
    /// A face that is cut short.
    #[error("expected at least 3 corners after 'f', found {found}")]
    TooFewCorners { found: usize },
    /// A line of absurd length.
    #[error(
        "the line is longer than {MAX_LINE} bytes; this is no OBJ file, or its line ends are lost"
    )]
    LineTooLong,
    /// A `\` that promises another line where the file ends.
    #[error("the file ends after a continued line ('\\'); it is cut off")]
    CutOff,
}
