//! Exhibits: tables, charts and pictures of poses that show what the algorithms do, each with one line that says what to look for.
//!
//! | file | what it shows |
//! |---|---|
//! | [`gallop`], [`control`], [`saddle`], [`flag`] | Figures 1 to 4 |
//! | [`editing`], [`resampling`], [`transfer`], [`expressions`] | Figures 5 to 8 |
//! | [`round_trip`] | every frame through every shape space and back (section 5) |
//! | [`large_turns`] | halfway to a roll by up to 700 degrees, in every shape space (section 5) |
//! | [`leave_out`] | in-betweens by layout, staged and refined (section 6) |
//! | [`signals`] | curves and frames that several of them show |
//! | [`render`] | triangle meshes as pictures |

pub mod control;
pub mod editing;
pub mod expressions;
pub mod flag;
pub mod gallop;
pub mod large_turns;
pub mod leave_out;
pub mod render;
pub mod resampling;
pub mod round_trip;
pub mod saddle;
pub mod signals;
pub mod transfer;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::sequence::dataset::{DataFolders, DatasetError};

/// A thing to look at. Texts are plain, not escaped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exhibit {
    /// Letters, digits and hyphens; no two alike.
    pub name: String,
    pub title: String,
    /// One line that says what to look for.
    pub look: String,
    /// Datasets that it is derived from.
    pub datasets: Vec<String>,
    pub panels: Vec<Panel>,
}

/// A part of an exhibit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Panel {
    Table(Table),
    Chart(Chart),
    Picture(Picture),
}

/// Words and numbers in rows; the first column is words.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    pub caption: String,
    pub heads: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

/// Lines over a plane.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    pub title: String,
    pub x_title: String,
    pub y_title: String,
    /// Whether a unit is as long across as up.
    pub equal: bool,
    /// Whether y is logarithmic.
    pub logarithmic: bool,
    /// Drawn behind the lines, which are cut to it; all of them are shown where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground: Option<Ground>,
    pub lines: Vec<Line>,
}

/// Cells that cover the plane of a chart, each of one of a few kinds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ground {
    /// The lower left and the upper right corner.
    pub corners: [[f64; 2]; 2],
    /// Cells across.
    pub across: usize,
    /// Row by row from the lowest, a digit each: the kind, 0 for what is left white.
    pub cells: String,
    /// The kinds from 1 on.
    pub kinds: Vec<String>,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Style {
    Line,
    Dashes,
    Dots,
    Squares,
}

/// A line of a chart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    pub name: String,
    pub style: Style,
    pub points: Vec<[f64; 2]>,
}

/// A picture of meshes, as PNG in base 64.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    pub title: String,
    pub png: String,
    pub width: u32,
    pub height: u32,
}

/// Why there is no exhibit.
#[derive(Debug, Error)]
pub enum ExhibitError {
    /// A dataset that cannot be had.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The algorithm refused.
    #[error("{exhibit}: {source}")]
    Algorithm {
        exhibit: &'static str,
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl ExhibitError {
    /// What an algorithm said while making an exhibit.
    pub fn of<E: std::error::Error + Send + Sync + 'static>(
        exhibit: &'static str,
    ) -> impl Fn(E) -> Self {
        move |source| Self::Algorithm {
            exhibit,
            source: Box::new(source),
        }
    }

    /// Whether there is no exhibit because there is no data, and nothing is wrong.
    pub fn is_absence(&self) -> bool {
        matches!(self, Self::Dataset(DatasetError::Absent { .. }))
    }
}

/// Makes an exhibit from datasets.
pub type Make = fn(&DataFolders) -> Result<Exhibit, ExhibitError>;

/// Every exhibit's maker under its name, in the order of the page.
pub const ALL: &[(&str, Make)] = &[
    ("figure-1", gallop::exhibit),
    ("figure-2", control::exhibit),
    ("figure-3", saddle::exhibit),
    ("figure-4", flag::exhibit),
    ("figure-5", editing::exhibit),
    ("figure-6", resampling::exhibit),
    ("figure-7", transfer::exhibit),
    ("figure-8", expressions::exhibit),
    ("round-trip", round_trip::exhibit),
    ("large-turns", large_turns::exhibit),
    ("leave-out", leave_out::exhibit),
];
