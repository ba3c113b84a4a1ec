//! `@scraps`: all that a mesh of triangles may be and a surface is not, in motion: the rules of the shape spaces at work.
//!
//! Three pages meet at one spine, and a triangle without an area, named before all others, lies along it. A fan hangs on a corner of the first page by one
//! vertex and spins. A flap hangs on the rim of the second by a triangle a ten millionth as high as it is long, which is as good as none, and swings.
//! Beside them a scrap of two triangles folds as it drifts, and a vertex of no triangle goes round.

use std::f64::consts::{PI, TAU};

use nalgebra::{Rotation3, Unit, Vector3};

use super::{SyntheticError, assemble, grid};
use crate::sequence::Sequence;

/// Number of frames of `@scraps` and of `@scraps-small`.
pub const FRAMES: usize = 30;

/// How finely the pages are cut.
pub(super) struct Size {
    columns: usize,
    rows: usize,
}

pub(super) const FULL: Size = Size {
    columns: 14,
    rows: 18,
};
pub(super) const SMALL: Size = Size {
    columns: 4,
    rows: 5,
};

const PAGES: usize = 3;
/// Triangles of the fan that spins.
const BLADES: usize = 5;
/// The height of the thin triangle over its length.
const THIN: f64 = 1e-7;
/// Degrees by which the fan turns, in all.
const SPIN: f64 = 500.0;

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let share = |i: usize| i as f64 / (FRAMES - 1) as f64;
    let frames: Vec<_> = (0..FRAMES).map(|i| points(share(i), size)).collect();
    assemble(faces(size), &frames)
}

/// The spine from -z to +z, the pages column by column outward, the blades' tips, the flap's near and far vertex, the scrap, the vertex by itself.
fn points(at: f64, size: &Size) -> Vec<Vector3<f64>> {
    let along = |row: usize| 1.4 * (row as f64 / size.rows as f64 - 0.5);
    let line = |[x, y]: [f64; 2]| (0..=size.rows).map(move |row| Vector3::new(x, y, along(row)));
    let pages = (0..PAGES).flat_map(|page| section(page, at, size));
    let mut points: Vec<_> = line([0.0, 0.0]).chain(pages.flat_map(line)).collect();
    let hung = points[corner(0, size) as usize];
    points.extend((0..=BLADES).map(|blade| hung + blade_tip(blade, at)));
    let [p, q] = [0, 1].map(|i| points[(corner(1, size) + i) as usize]);
    let out = (p - points[corner(1, size) as usize - size.rows - 1]).normalize();
    let edge = q - p;
    points.push(p + 0.4 * edge + THIN * edge.norm() * out);
    let swing = Rotation3::from_axis_angle(&Unit::new_normalize(edge), 1.8 * (TAU * at).sin());
    points.push(p + 0.5 * edge + swing * (0.3 * out));
    let fold = 0.4 + 2.4 * at;
    let drift = Vector3::new(1.6 + 0.3 * at, 0.2 + 0.5 * (PI * at).sin(), 0.0);
    let turn = Rotation3::from_euler_angles(0.5 * at, 2.0 * at, -at);
    let scrap = [
        [0.0, 0.0, -0.3],
        [0.0, 0.0, 0.3],
        [0.5, 0.0, 0.1],
        [-0.5 * fold.cos(), 0.5 * fold.sin(), 0.0],
    ];
    points.extend(scrap.map(|p| drift + turn * Vector3::from(p)));
    let (sin, cos) = (TAU * at).sin_cos();
    points.push(Vector3::new(0.8 * cos, 1.2, 0.8 * sin));
    points
}

/// The section of a page by the plane z = 0, without the spine.
fn section(page: usize, at: f64, size: &Size) -> Vec<[f64; 2]> {
    let phase = TAU * (at + page as f64 / PAGES as f64);
    let spine = PI * (0.15 + 0.35 * page as f64) + 0.25 * phase.sin();
    let mut end = [0.0, 0.0];
    let columns = (0..size.columns).map(|column| {
        let outward = (column as f64 + 0.5) / size.columns as f64;
        let (sin, cos) = (spine + 0.9 * outward * phase.cos()).sin_cos();
        let step = 1.0 / size.columns as f64;
        end = [end[0] + step * cos, end[1] + step * sin];
        end
    });
    columns.collect()
}

/// A tip of the fan from its hub.
fn blade_tip(blade: usize, at: f64) -> Vector3<f64> {
    let axis = Unit::new_normalize(Vector3::new(1.0, 0.4, 0.2));
    let angle = (SPIN * at).to_radians();
    let (sin, cos) = (1.5 * PI * blade as f64 / BLADES as f64).sin_cos();
    Rotation3::from_axis_angle(&axis, angle) * Vector3::new(0.12, 0.3 * cos, 0.3 * sin)
}

/// The first vertex of a page's outermost column.
fn corner(page: usize, size: &Size) -> u32 {
    (size.rows + 1 + ((page + 1) * size.columns - 1) * (size.rows + 1)) as u32
}

/// The flat triangle along the spine, the thin one, the pages, the fan, the flap, the scrap.
fn faces(size: &Size) -> Vec<[u32; 3]> {
    let ring = size.rows + 1;
    let tips = ((1 + PAGES * size.columns) * ring) as u32;
    let (near, far) = (tips + BLADES as u32 + 1, tips + BLADES as u32 + 2);
    let [p, q] = [0, 1].map(|i| corner(1, size) + i);
    let mut faces = vec![[0, 1, 2], [p, q, near]];
    for page in 0..PAGES {
        let shift = (page * size.columns * ring) as u32;
        let own = |v: u32| if v < ring as u32 { v } else { v + shift };
        faces.extend(
            grid::faces(size.columns, size.rows)
                .iter()
                .map(|f| f.map(own)),
        );
    }
    let hub = corner(0, size);
    faces.extend((0..BLADES as u32).map(|blade| [hub, tips + blade, tips + blade + 1]));
    faces.extend([[p, near, far], [near, q, far]]);
    let scrap = far + 1;
    faces.extend([[scrap, scrap + 1, scrap + 2], [scrap + 1, scrap, scrap + 3]]);
    faces
}

#[cfg(test)]
mod tests {
    use super::super::embedded;
    use crate::mesh::topology::Topology;
    use crate::shape::reference::Reference;

    /// What it is for is there, in the reference of its shape spaces.
    #[test]
    fn it_has_what_surfaces_have_not() {
        for name in ["@scraps", "@scraps-small"] {
            let scraps = embedded(name).unwrap();
            let mesh = scraps.connectivity();
            let reference = Reference::new(mesh.clone(), scraps.frame(0)).unwrap();
            let degenerate = reference.triangles.iter().take_while(|t| t.is_none());
            assert_eq!(degenerate.count(), 2, "named first");
            assert!(reference.triangles[2..].iter().all(Option::is_some));
            let topology = Topology::new(mesh.faces());
            let along_spine = topology.non_manifold().filter(|[a, b]| b - a == 1);
            assert!(along_spine.count() >= 5);
            // The pages with what hangs on them, the scrap, the vertex of no triangle; its vertex next to the rim belongs to the flap.
            assert_eq!(reference.components.len(), 3);
            assert_eq!(reference.components[2].first_triangle, None);
        }
    }
}
