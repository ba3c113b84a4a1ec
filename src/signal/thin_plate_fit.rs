//! Thin plates through points and near them (section 3.2): the functions that meet the side conditions, and the systems for their coefficients.

use faer::{ColRef, Mat, MatRef};
use nalgebra::Vector2;
use rayon::prelude::*;

use super::Point;
use super::thin_plate::{Frame, eight_points, kernels_of_eight};
use crate::linalg::dense::columns_mut;
use crate::linalg::kernels::LANES;
use crate::linalg::panels::{Eight, Panels, alone, extend_by_rows, subtract_gathered};
use crate::linalg::reflections::Reflections;
use crate::linalg::upper_triangular::UpperTriangular;

/// What a kernel takes, and its part in the side conditions, as products.
const KERNEL: usize = 40;

/// The functions of the pose plane that meet the side conditions, for l sites that span an affine space of functions of dimension `affine`: 1, x
/// and y of it, and l - affine sums of kernels. Sites and points are in the coordinates of a [`Frame`].
pub(super) struct Design {
    /// Of the l x affine matrix [1 s].
    pub side: Reflections<3>,
    /// l vectors, an entry a point: Q^T of `side` times the kernels of the sites. From the vector `affine` on they are the sums that meet the conditions.
    pub sums: Panels,
    pub affine: usize,
}

impl Design {
    /// O(l points) kernels.
    pub fn new(sites: &[Point], affine: usize, points: &[Point]) -> Self {
        let conditions: Vec<[f64; 3]> = sites.iter().map(|s| [1.0, s[0], s[1]]).collect();
        let side = Reflections::of_few(&conditions, affine);
        let mut kernels = Panels::zeros(points.len(), sites.len());
        kernels
            .par_iter_mut()
            .zip(points.par_chunks(LANES))
            .with_min_len(alone(KERNEL * LANES * sites.len()))
            .for_each(|(panel, points)| {
                kernels_of_eight(&eight_points(points), sites, panel);
                side.apply_transpose(panel);
            });
        Self {
            side,
            sums: kernels.transposed(),
            affine,
        }
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
    fn part(&self, coefficients: &mut [Eight]) -> [Eight; LANES] {
        let affine = take(coefficients, self.affine);
        self.side.apply(coefficients);
        affine
    }

    /// What coefficients of the functions, one a row, make of the kernels and the affine functions.
    pub fn plate(&self, coefficients: MatRef<'_, f64>) -> Plate {
        let (l, m) = coefficients.shape();
        let row = |j: usize| coefficients.row(j).transpose();
        Plate::new(l, m, l, row, |entries| self.part(entries))
    }
}

/// The coefficients of m functions of the pose plane, in the coordinates of a [`Frame`].
pub(super) struct Plate {
    /// m vectors of the l weights of the kernels.
    pub weights: Panels,
    /// m vectors of the coefficients of 1, x and y, 0 for those that the sites do not tell apart.
    pub affine: Panels,
}

impl Plate {
    /// Eight functions after eight, from the m x n matrix of what they are to be, which is given by its columns: for eight of its rows, `solve` puts
    /// l weights first, and gives the affine part.
    fn new<'a>(
        l: usize,
        m: usize,
        n: usize,
        column: impl Fn(usize) -> ColRef<'a, f64> + Sync,
        solve: impl Fn(&mut Vec<Eight>) -> [Eight; LANES] + Sync,
    ) -> Self {
        let mut weights = Panels::zeros(m, l);
        let mut affine = Panels::zeros(m, 3);
        weights
            .par_iter_mut()
            .zip(affine.par_iter_mut())
            .enumerate()
            .with_min_len(alone(LANES * l * n))
            .for_each_init(Vec::new, |work, (panel, (weights, affine))| {
                work.clear();
                extend_by_rows(work, LANES * panel, n, &column);
                let head = solve(work);
                weights.copy_from_slice(&work[..l]);
                affine.copy_from_slice(&head[..3]);
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
        for (first, (weights, affine)) in (0..m).step_by(LANES).zip(panels) {
            let mut spread = [0.0; LANES];
            for (weight, s) in weights.iter().zip(sites) {
                let square = s[0] * s[0] + s[1] * s[1];
                for lane in 0..LANES {
                    spread[lane] += weight[lane] * square;
                }
            }
            for (lane, a) in (first..m.min(first + LANES)).enumerate() {
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
        qr.apply_transpose(b);
        b.resize(l.next_multiple_of(LANES), [0.0; LANES]);
        qr.r().solve(b);
        design.part(&mut b[..l])
    })
}

/// The plate through the sites, for a design whose points are the sites; None where rounding leaves its matrix indefinite. Kernels are positive
/// definite on the weights that meet the side conditions, so this is a Cholesky factorisation: O(l^3 / 3 + l^2 m).
pub(super) fn interpolant<'a>(
    mut design: Design,
    m: usize,
    coordinates: impl Fn(usize) -> ColRef<'a, f64> + Sync,
) -> Option<Plate> {
    let l = design.sums.vectors();
    // Q^T Phi Q, by the symmetry of Phi.
    for panel in design.sums.iter_mut() {
        design.side.apply_transpose(panel);
    }
    let beside = part_off(&mut design.sums, design.affine);
    let factor = UpperTriangular::cholesky(&design.sums)?;
    Some(Plate::new(l, m, l, coordinates, |b| {
        design.side.apply_transpose(b);
        let mut affine = take(b, design.affine);
        b.resize(l.next_multiple_of(LANES), [0.0; LANES]);
        factor.solve_transposed(b);
        factor.solve(b);
        subtract_gathered(&beside, b, &mut affine);
        design.side.r().solve(&mut affine);
        design.side.apply(&mut b[..l]);
        affine
    }))
}

/// The first entries, filled up with zeros, which also take their place.
fn take(entries: &mut [Eight], count: usize) -> [Eight; LANES] {
    let mut head = [[0.0; LANES]; LANES];
    for (head, entry) in head.iter_mut().zip(&mut entries[..count]) {
        *head = std::mem::replace(entry, [0.0; LANES]);
    }
    head
}

/// Puts those of the identity in the place of the first rows and columns of a symmetric matrix, and gives what was to the right of these columns in
/// these rows, as vectors.
fn part_off(matrix: &mut Panels, count: usize) -> Vec<Eight> {
    let columns = matrix.iter_mut().map(|panel| &mut panel[..count]);
    columns.for_each(|columns| columns.fill([0.0; LANES]));
    let Some(rows) = matrix.iter_mut().next() else {
        return Vec::new();
    };
    let mut beside = rows.to_vec();
    beside.iter_mut().for_each(|entry| entry[count..].fill(0.0));
    rows.iter_mut().for_each(|entry| entry[..count].fill(0.0));
    (0..count).for_each(|i| rows[i][i] = 1.0);
    beside
}
