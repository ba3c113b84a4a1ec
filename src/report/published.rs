//! The times that Cashman & Hormann 2012 give in their Table 1.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Our copy of the paper's Table 1 (an Intel Core i7 at 2.67 GHz).
pub const TABLE_1: &str = include_str!("../../bench/published/cashman_hormann_table1.csv");

/// One row of Table 1: an example, its constants and its times in milliseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PublishedRow {
    /// The paper's figure, such as `1` or `7c`.
    pub figure: String,
    /// The shape space: `vertex` or `gradient`.
    pub space: String,
    /// Numbers in one frame: 3V in vertex space, 9F + 3 in gradient space.
    pub d: usize,
    /// Control points of the time signal.
    pub k: usize,
    /// Sites of the pose signal.
    pub l: usize,
    /// Dimensions of the shape signal.
    pub m: usize,
    /// Frames.
    pub n: usize,
    /// Time signal.
    pub f_ms: f64,
    /// One radial-basis approximation, on average.
    pub rbf_ms: f64,
    /// Pose signal: the whole greedy search.
    pub g_ms: f64,
    /// Shape signal.
    pub h_ms: f64,
}

/// Why a table of published times could not be read.
#[derive(Debug, Error)]
pub enum PublishedError {
    /// A row that is not as expected; the message names its line.
    #[error(
        "published times: {0}; expected the columns figure,space,d,k,l,m,n,f_ms,rbf_ms,g_ms,h_ms"
    )]
    Row(#[from] csv::Error),
    /// A time that cannot be one.
    #[error(
        "published times, line {line}: {column} is {value}, expected milliseconds, finite and not below 0"
    )]
    Time {
        line: usize,
        column: &'static str,
        value: f64,
    },
}

impl PublishedRow {
    /// Reads rows from CSV text with a header.
    pub fn parse(text: &str) -> Result<Vec<Self>, PublishedError> {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let rows: Vec<Self> = reader.deserialize().collect::<Result<_, _>>()?;
        for (index, row) in rows.iter().enumerate() {
            row.check(index + 2)?;
        }
        Ok(rows)
    }

    /// The rows of the paper's Table 1.
    pub fn table_1() -> Result<Vec<Self>, PublishedError> {
        Self::parse(TABLE_1)
    }

    fn check(&self, line: usize) -> Result<(), PublishedError> {
        let columns = [
            ("f_ms", self.f_ms),
            ("rbf_ms", self.rbf_ms),
            ("g_ms", self.g_ms),
            ("h_ms", self.h_ms),
        ];
        match columns.into_iter().find(|(_, x)| !(0.0..1e12).contains(x)) {
            Some((column, value)) => Err(PublishedError::Time {
                line,
                column,
                value,
            }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_copy_of_table_1_holds_the_horse_and_the_cow() {
        let rows = PublishedRow::table_1().unwrap();
        assert_eq!(rows.len(), 5);
        let horse = &rows[0];
        assert_eq!(
            (horse.figure.as_str(), horse.d, horse.n, horse.h_ms),
            ("1", 25293, 24, 166.0)
        );
        let cow = rows.iter().find(|r| r.n == 204).unwrap();
        assert_eq!((cow.d, cow.k, cow.l, cow.m), (8712, 155, 144, 42));
        assert_eq!(
            (cow.f_ms, cow.rbf_ms, cow.g_ms, cow.h_ms),
            (239.0, 39.0, 5626.0, 5127.0)
        );
    }

    #[test]
    fn a_row_that_is_wrong_names_its_line() {
        let header = TABLE_1.lines().next().unwrap();
        let short = format!("{header}\n1,vertex,3\n");
        assert!(
            PublishedRow::parse(&short)
                .unwrap_err()
                .to_string()
                .contains("line: 2")
        );
        let nan = format!("{header}\n1,vertex,3,4,3,0,4,1,1,NaN,1\n");
        let error = PublishedRow::parse(&nan).unwrap_err().to_string();
        assert!(
            error.contains("line 2") && error.contains("g_ms"),
            "{error}"
        );
        assert!(PublishedRow::parse("").unwrap().is_empty());
    }
}
