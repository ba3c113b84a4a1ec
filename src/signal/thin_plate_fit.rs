//! Thin plates through points and near them (section 3.2): the functions that meet the side conditions, and the systems for their coefficients.

use faer::{ColRef, Mat, MatRef};
use nalgebra::Vector2;
use rayon::prelude::*;

use super::Point;
use super::thin_plate::{EightPoints, Frame, eight_points, kernels_of_eight};
use crate::linalg::dense::columns_mut;
use crate::linalg::entry::{Eight, Entry};
use crate::linalg::kernels::LANES;
use crate::linalg::panels::{Panels, alone};
use crate::linalg::reflections::{BlockReflection, Reflections};
use crate::linalg::tiles::subtract_gathered;
use crate::linalg::upper_triangular::UpperTriangular;

/// What a kernel takes, and its part in the side conditions, as products.
const KERNEL: usize = 40;

/// Functions that are found and evaluated together: what they are multiplied by, once loaded, serves two registers of AVX-512.
pub(super) const ROWS: usize = 16;

/// The l x affine matrix [1 s] of the side conditions, as Q R.
pub(super) struct Side {
    pub q: BlockReflection<4>,
    pub r: UpperTriangular,
}

impl Side {
    fn new(sites: &[Point], affine: usize) -> Self {
        let rows: Vec<[f64; 4]> = sites.iter().map(|s| [1.0, s[0], s[1], 0.0]).collect();
        let (q, r) = BlockReflection::of_few(&rows, affine);
        Self { q, r }
    }
}

/// The functions of the pose plane that meet the side conditions, for l sites that span an affine space of functions of dimension `affine`: 1, x
/// and y of it, and l - affine sums of kernels. Sites and points are in the coordinates of a [`Frame`].
pub(super) struct Design {
    pub side: Side,
    /// l vectors, an entry a point: Q^T times the kernels of the sites. From the vector `affine` on they are the sums that meet the conditions.
    pub sums: Panels,
    pub affine: usize,
}

impl Design {
    /// O(l points) kernels.
    pub fn new(sites: &[Point], affine: usize, points: &[Point]) -> Self {
        let side = Side::new(sites, affine);
        let kernels = each_panel(sites, points, |_, points, panel| {
            kernels_of_eight(points, sites, panel);
            side.q.apply_transpose(panel);
        });
        let sums = kernels.transposed();
        Self { side, sums, affine }
    }

    /// The functions at the points, a vector each.
    fn functions(&self, points: &[Point]) -> Panels {
        let mut functions = self.sums.clone();
        if let Some(panel) = functions.iter_mut().next() {
            for (entry, p) in panel.iter_mut().zip(points) {
                entry[..self.affine].copy_from_slice(&[1.0, p[0], p[1]][..self.affine]);
            }
        }
        functions
    }

    /// The functions at the points, one a column.
    pub fn matrix(&self, points: &[Point]) -> Mat<f64> {
        self.functions(points).transposed().rows_matrix()
    }

    /// Splits coefficients of the functions, l entries, into the affine part, which stays in the head, and the weights of the kernels.
    fn part(&self, coefficients: &mut [Entry<ROWS>]) -> [Entry<ROWS>; LANES] {
        let affine = take(coefficients, self.affine);
        self.side.q.apply(coefficients);
        affine
    }

    /// What coefficients of the functions, one a row, make of the kernels and the affine functions.
    pub fn plate(&self, coefficients: MatRef<'_, f64>) -> Plate {
        let (l, m) = coefficients.shape();
        let row = |j: usize| coefficients.row(j).transpose();
        Plate::new(l, m, l, row, |entries| self.part(&mut entries[..l]))
    }
}

/// The coefficients of m functions of the pose plane, in the coordinates of a [`Frame`].
pub(super) struct Plate {
    /// m vectors of which the first l entries are the weights of the kernels.
    pub weights: Panels<ROWS>,
    /// m vectors of the coefficients of 1, x and y, 0 for those that the sites do not tell apart.
    pub affine: Panels<ROWS>,
}

impl Plate {
    /// [`ROWS`] functions at a time, from the m x n matrix of what they are to be, which is given by its columns: for so many of its rows, and zeros up to
    /// a multiple of eight of l, `solve` puts l weights first, and gives the affine part.
    fn new<'a>(
        l: usize,
        m: usize,
        n: usize,
        column: impl Fn(usize) -> ColRef<'a, f64> + Sync,
        solve: impl Fn(&mut [Entry<ROWS>]) -> [Entry<ROWS>; LANES] + Sync,
    ) -> Self {
        let mut weights = Panels::zeros(m, n.max(l.next_multiple_of(LANES)));
        (0..n).for_each(|j| weights.set_entry(j, column(j)));
        let mut affine = Panels::zeros(m, 3);
        weights
            .par_iter_mut()
            .zip(affine.par_iter_mut())
            .with_min_len(alone(ROWS * l * n))
            .for_each(|(weights, affine)| {
                affine.copy_from_slice(&solve(weights)[..3]);
            });
        Self { weights, affine }
    }

    /// m x (l + 3) coefficients g_0, g_1 .. g_l and G in the units of the points. With q = (p - c) / s, phi(r / s) = (phi(r) - r^2 ln s) / s^2, and the
    /// side conditions turn sum_j c_j ||p - s_j||^2 into the constant sum_j c_j ||s_j - c||^2.
    pub fn in_given_units(&self, frame: &Frame, sites: &[Point]) -> Mat<f64> {
        let (m, l) = (self.weights.vectors(), sites.len());
        let mut out = Mat::zeros(m, l + 3);
        let mut columns = columns_mut(out.as_mut());
        let per_area = 1.0 / (frame.size * frame.size);
        self.weights.write_rows(per_area, &mut columns[1..=l]);
        let panels = self.weights.iter().zip(self.affine.iter());
        for (first, (weights, affine)) in (0..m).step_by(ROWS).zip(panels) {
            let mut spread = [0.0; ROWS];
            for (weight, s) in weights.iter().zip(sites) {
                let square = s[0] * s[0] + s[1] * s[1];
                for lane in 0..ROWS {
                    spread[lane] += weight[lane] * square;
                }
            }
            for (lane, a) in (first..m.min(first + ROWS)).enumerate() {
                let along = Vector2::new(affine[1][lane], affine[2][lane]);
                let gradient = frame.axes * along / frame.size;
                let constant = affine[0][lane] - gradient.dot(&frame.centre);
                columns[0][a] = constant - spread[lane] * frame.size.ln();
                columns[l + 1][a] = gradient[0];
                columns[l + 2][a] = gradient[1];
            }
        }
        out
    }
}

/// The least squares (4): by a QR factorisation of the functions at the points. `coordinates(i)` are those of point i, m numbers. O(n l (l + m)).
pub(super) fn least_squares<'a>(
    design: &Design,
    points: &[Point],
    m: usize,
    coordinates: impl Fn(usize) -> ColRef<'a, f64> + Sync,
) -> Plate {
    let (n, l) = (points.len(), design.sums.vectors());
    let qr = Reflections::new(design.functions(points));
    Plate::new(l, m, n, coordinates, |b| {
        qr.apply_transpose(&mut b[..n]);
        qr.r().solve(b);
        design.part(&mut b[..l])
    })
}

/// The plate through the sites; None where rounding leaves its matrix indefinite. Kernels are positive definite on the weights that meet the side
/// conditions, so this is a Cholesky factorisation: O(l^3 / 3 + l^2 m). `coordinates(j)` are those at site j, m numbers.
pub(super) fn interpolant<'a>(
    sites: &[Point],
    affine: usize,
    m: usize,
    coordinates: impl Fn(usize) -> ColRef<'a, f64> + Sync,
) -> Option<Plate> {
    let l = sites.len();
    let Side { q, r } = Side::new(sites, affine);
    let mut matrix = kernels_among(sites);
    q.conjugate(&mut matrix);
    let beside = part_off(&mut matrix, affine);
    let factor = UpperTriangular::cholesky(&matrix)?;
    Some(Plate::new(l, m, l, coordinates, |b| {
        q.apply_transpose(&mut b[..l]);
        let mut head = take(b, affine);
        factor.solve_transposed(b);
        factor.solve(b);
        subtract_gathered(&beside, b, &mut head);
        r.solve(&mut head);
        q.apply(&mut b[..l]);
        head
    }))
}

/// The symmetric kernels of sites among themselves.
fn kernels_among(sites: &[Point]) -> Panels {
    let mut kernels = each_panel(sites, sites, |first, points, panel| {
        kernels_of_eight(points, &sites[first..], &mut panel[first..]);
    });
    kernels.mirror();
    kernels
}

/// A vector for each point with an entry for each site: `write` has the number of the first of eight points, these, and their panel.
fn each_panel(
    sites: &[Point],
    points: &[Point],
    write: impl Fn(usize, &EightPoints, &mut [Eight]) + Sync,
) -> Panels {
    let mut panels = Panels::zeros(points.len(), sites.len());
    panels
        .par_iter_mut()
        .zip(points.par_chunks(LANES))
        .enumerate()
        .with_min_len(alone(KERNEL * LANES * sites.len()))
        .for_each(|(p, (panel, points))| {
            write(LANES * p, &eight_points(points), panel);
            let filled_up = panel.iter_mut().map(|entry| &mut entry[points.len()..]);
            filled_up.for_each(|lanes| lanes.fill(0.0));
        });
    panels
}

/// The first entries, filled up with zeros, which also take their place.
fn take<const L: usize>(entries: &mut [Entry<L>], count: usize) -> [Entry<L>; LANES] {
    let mut head = [Entry::ZERO; LANES];
    for (head, entry) in head.iter_mut().zip(&mut entries[..count]) {
        *head = std::mem::replace(entry, Entry::ZERO);
    }
    head
}

/// Puts those of the identity in the place of the first rows and columns of a symmetric matrix, and gives what was to the right of these columns in
/// these rows, as vectors.
fn part_off(matrix: &mut Panels, count: usize) -> Vec<Eight> {
    let columns = matrix.iter_mut().map(|panel| &mut panel[..count]);
    columns.for_each(|columns| columns.fill(Entry::ZERO));
    let Some(rows) = matrix.iter_mut().next() else {
        return Vec::new();
    };
    let mut beside = rows.to_vec();
    beside.iter_mut().for_each(|entry| entry[count..].fill(0.0));
    rows.iter_mut().for_each(|entry| entry[..count].fill(0.0));
    (0..count).for_each(|i| rows[i][i] = 1.0);
    beside
}
