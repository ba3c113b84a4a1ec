//! The report: one self-contained HTML page made from a record, and the table and picture that the README shows.
//!
//! | file | what it makes |
//! |---|---|
//! | `html` | the page |
//! | `exhibits`, `verdicts`, `accuracy`, `timing`, `table1`, `engines`, `pictures` | its sections |
//! | `summary` | every stage in one line, for the page and for the README |
//! | `plots` | pictures, as SVG text |
//! | `readme` | the README's table and picture, and [`splice`] |
//! | `published` | the times of the paper's Table 1 |
//! | `markup`, `format`, `order` | escaping and tables, numbers, the order of things |
//!
//! Nothing here reads or writes files, and the same record makes the same text.

mod accuracy;
mod engines;
#[cfg(test)]
mod example;
mod exhibits;
mod format;
mod html;
mod markup;
mod order;
mod pictures;
mod plots;
mod published;
mod readme;
mod summary;
mod table1;
#[cfg(test)]
mod tests;
mod timing;
mod verdicts;

pub use html::html;
pub use plots::PlotError;
pub use plots::time_signal::{PosePlane, pose_plane};
pub use published::{PublishedError, PublishedRow, TABLE_1};
pub use readme::{SpliceError, readme_picture, readme_table, splice};
pub use table1::table_1_text;
