//! `@book`: an open book, whose pages share one spine and turn over one after another.
//!
//! All pages meet in the same chain of edges along z, the spine, so those edges have as many triangles as there are pages: the mesh is
//! non-manifold there, and a disc elsewhere. Each page is flat facets hinged along lines parallel to the spine, so every triangle keeps its
//! shape while it turns, as in `@roll`; only the angles at the hinges and between the pages change. Pages keep their order and never touch
//! except at the spine.

use nalgebra::Vector3;

use super::{SyntheticError, assemble, grid, smoothstep};
use crate::sequence::Sequence;

/// Number of frames of `@book` and of `@book-small`.
pub const FRAMES: usize = 40;
/// Width of a page, from the spine to its free edge.
pub const WIDTH: f64 = 1.0;
/// Length of the spine, along z and centred.
pub const HEIGHT: f64 = 1.4;

/// How many pages there are and how finely they are cut.
pub(super) struct Size {
    pages: usize,
    columns: usize,
    rows: usize,
}

pub(super) const FULL: Size = Size {
    pages: 8,
    columns: 16,
    rows: 24,
};
pub(super) const SMALL: Size = Size {
    pages: 5,
    columns: 6,
    rows: 9,
};

/// Number of frames that a page takes to turn.
const TURN: f64 = 15.0;
/// Degrees above the table at which the lowest page of a stack lies, and between two pages that lie there.
const LOWEST: f64 = 4.0;
const APART: f64 = 4.0;
/// Degrees by which the free edge of a page hangs behind while it turns, and by which one that lies curls up.
const LAG: f64 = 55.0;
const CURL: f64 = 10.0;

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let frames: Vec<_> = (0..FRAMES).map(|i| points(i as f64, size)).collect();
    assemble(faces(size), &frames)
}

/// The spine from -z to +z, then page by page, column by column outward from the spine.
fn points(at: f64, size: &Size) -> Vec<Vector3<f64>> {
    let along = |row: usize| HEIGHT * (row as f64 / size.rows as f64 - 0.5);
    let line = |[x, y]: [f64; 2]| (0..=size.rows).map(move |row| Vector3::new(x, y, along(row)));
    let pages = (0..size.pages).flat_map(|page| section(page, at, size));
    line([0.0, 0.0]).chain(pages.flat_map(line)).collect()
}

/// The section of a page by the plane z = 0, without the spine: the free ends of its facets.
fn section(page: usize, at: f64, size: &Size) -> Vec<[f64; 2]> {
    let turned = turned(page, at, size);
    // the first page lies on top at the right and below the others at the left
    let right = LOWEST + APART * (size.pages - 1 - page) as f64;
    let left = 180.0 - LOWEST - APART * page as f64;
    let spine = right + (left - right) * turned;
    // behind in mid-turn, curled up at both ends
    let bend = CURL * (1.0 - 2.0 * turned) - LAG * 4.0 * turned * (1.0 - turned);
    let facet = WIDTH / size.columns as f64;
    let mut end = [0.0, 0.0];
    let facets = (0..size.columns).map(|column| {
        let outward = (column as f64 + 0.5) / size.columns as f64;
        let (sin, cos) = (spine + bend * outward * outward).to_radians().sin_cos();
        end = [end[0] + facet * cos, end[1] + facet * sin];
        end
    });
    facets.collect()
}

/// How far a page has turned at time `at` (in frames), from 0 to 1: each starts a little after the one before.
fn turned(page: usize, at: f64, size: &Size) -> f64 {
    let last_start = (FRAMES - 1) as f64 - TURN;
    let start = last_start * page as f64 / (size.pages - 1) as f64;
    smoothstep(start, start + TURN, at)
}

/// Page by page; every one faces the same way where it lies at the right: up.
fn faces(size: &Size) -> Vec<[u32; 3]> {
    let ring = size.rows + 1;
    let page = |page: usize| {
        // column 0 is the spine; the others follow those of the pages before
        let shift = (page * size.columns * ring) as u32;
        let own = move |v: u32| if v < ring as u32 { v } else { v + shift };
        let flat = grid::faces(size.columns, size.rows).into_iter();
        flat.map(move |[a, b, c]| [a, c, b].map(own))
    };
    (0..size.pages).flat_map(page).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};
    use super::*;
    use crate::mesh::topology::Topology;

    const SIZES: [(&str, Size); 2] = [("@book", FULL), ("@book-small", SMALL)];

    #[test]
    fn the_edges_of_the_spine_have_a_triangle_for_each_page() {
        for (name, size) in SIZES {
            let book = embedded(name).unwrap();
            let topology = Topology::new(book.connectivity().faces());
            let spine: Vec<_> = (0..size.rows as u32).map(|row| [row, row + 1]).collect();
            assert_eq!(topology.non_manifold().collect::<Vec<_>>(), spine);
            for (edge, fan) in topology.edges().iter().zip(topology.fans()) {
                if spine.contains(edge) {
                    assert_eq!(fan.len(), size.pages);
                    assert!(fan.iter().all(|half| half.ascending == fan[0].ascending));
                }
            }
            // each page is a disc: 2 columns + 1 row of its outline lie off the spine
            let outline = size.pages * (2 * size.columns + size.rows);
            assert_eq!(topology.boundary().count(), outline);
            assert_eq!(checks::components(&book), 1);
        }
    }

    #[test]
    fn every_edge_keeps_its_length() {
        for (name, _) in SIZES {
            let book = embedded(name).unwrap();
            let stretch = checks::largest_stretch(&book, &checks::points(book.frame(0)));
            assert!(stretch < 1e-12, "{name}: {stretch}");
        }
    }

    #[test]
    fn all_pages_go_from_the_right_to_the_left() {
        for (name, size) in SIZES {
            let book = embedded(name).unwrap();
            let free = |frame: usize| checks::points(book.frame(frame))[size.rows + 1..].to_vec();
            assert!(free(0).iter().all(|p| p.x > 0.0 && p.y > 0.0), "{name}");
            let last = free(FRAMES - 1);
            assert!(last.iter().all(|p| p.x < 0.0 && p.y > 0.0), "{name}");
        }
    }

    /// Two pages that follow each other meet nowhere but at the spine, and stay above the table.
    #[test]
    fn pages_never_touch() {
        let side = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        for (_, size) in SIZES {
            for frame in 0..8 * FRAMES {
                let sections: Vec<Vec<[f64; 2]>> = (0..size.pages)
                    .map(|page| section(page, frame as f64 / 8.0, &size))
                    .collect();
                for pair in sections.windows(2) {
                    // the page that turns first lies to the left of the other, facet by facet
                    assert!(side([0.0, 0.0], pair[1][0], pair[0][0]) > 0.0);
                    for first in pair[0].windows(2) {
                        for second in pair[1].windows(2) {
                            let [a, b, c, d] = [first[0], first[1], second[0], second[1]];
                            let cross = side(a, b, c) * side(a, b, d) <= 0.0
                                && side(c, d, a) * side(c, d, b) <= 0.0;
                            assert!(!cross, "time {frame} / 8");
                        }
                    }
                }
                assert!(sections.iter().flatten().all(|p| p[1] > 0.0));
            }
        }
    }
}
