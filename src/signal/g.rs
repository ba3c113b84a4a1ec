//! The pose signal g: a thin-plate approximation from the pose plane to shape coordinates (sections 2.2 and 3.2).

use faer::{Accum, Mat, MatMut, MatRef, unzip, zip};
use rayon::prelude::*;
use thiserror::Error;

use super::Point;
use super::thin_plate::{Frame, kernels};
use crate::linalg::dense::{Cholesky, Qr, columns_mut, multiply};
use crate::linalg::kernels::{axpy, combine_fused, dot};
use crate::linalg::panels::{self, Panels};

/// Sites closer than this share of their extent coincide.
const COINCIDENT: f64 = 1e-13;

/// Points evaluated by one thread before another could begin to help, as terms of the sum.
const ALONE: usize = 60_000;

/// g(p) = g_0 + sum_j phi(||s_j - p||) g_j + G p, with phi(r) = r^2 ln r, in the units of the pose-space positions.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseSignal {
    /// s_1 .. s_l.
    pub sites: Vec<Point>,
    /// m x (l + 3): the columns are g_0, g_1 .. g_l, and the two columns of G.
    pub coefficients: Mat<f64>,
}

/// Why there is no pose signal for these sites.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum PoseError {
    /// No site at all.
    #[error("a pose signal needs at least one site, found none")]
    NoSites,
    /// A site that is not one of the points.
    #[error("site {site} (0-based) is index {index}, but there are {points} points")]
    OutOfRange {
        site: usize,
        index: usize,
        points: usize,
    },
    /// Two sites at one place, which makes the system singular.
    #[error(
        "sites {first} and {second} (0-based, of the list of sites) coincide in pose space; keep one of them"
    )]
    Coincident { first: usize, second: usize },
}

impl PoseSignal {
    /// Minimises (4) over all frames for sites at `points[sites[j]]`, under the side conditions sum_j g_j = 0 and sum_j g_j s_j^T = 0 (reading 4).
    ///
    /// `coordinates` is m x n with a column for each of the n points. Through the QR of the l x 3 matrix [1 s], whose null space leaves an n x l
    /// system, solved by another QR: O(n l^2). With l = 3 sites an affine map; with l = n an interpolant, whose system is symmetric and positive
    /// definite there: a quarter of the work. Where the sites do not span the plane (collinear or coincident), g is constant across them.
    pub fn fit(
        points: &[Point],
        coordinates: MatRef<'_, f64>,
        sites: &[usize],
    ) -> Result<Self, PoseError> {
        let chosen = choose(points, sites)?;
        let frame = Frame::new(&chosen);
        let normalised: Vec<Point> = chosen.iter().map(|&p| frame.normalise(p)).collect();
        check_apart(&normalised)?;
        let interpolated = (sites.len() == points.len())
            .then(|| interpolant(&normalised, frame.affine, coordinates, sites))
            .flatten();
        let (weights, affine_part) = interpolated.unwrap_or_else(|| {
            let queries: Vec<Point> = points.iter().map(|&p| frame.normalise(p)).collect();
            let design = Design::new(&normalised, frame.affine, &queries);
            let mut right = coordinates.transpose().to_owned();
            let qr = Qr::new(design.matrix(&queries));
            qr.apply_transpose(&mut right);
            design.parts(&qr.solve_upper(&right))
        });
        Ok(Self {
            coefficients: in_given_units(&frame, &normalised, &weights, affine_part.as_ref()),
            sites: chosen,
        })
    }

    /// l, the number of sites.
    pub fn site_count(&self) -> usize {
        self.sites.len()
    }

    /// Adds nothing to `x` but g(p): `x` holds m numbers and is overwritten. O(l m).
    pub fn evaluate_into(&self, p: Point, x: &mut [f64]) {
        let l = self.sites.len();
        x.copy_from_slice(self.coefficients.col_as_slice(0));
        let mut bends = vec![0.0; l];
        kernels(p, &self.sites, &mut bends);
        combine_fused(&bends, |j| self.coefficients.col_as_slice(j + 1), x);
        axpy(p[0], self.coefficients.col_as_slice(l + 1), x);
        axpy(p[1], self.coefficients.col_as_slice(l + 2), x);
    }

    /// g at many points, m x q, with the same bits as one by one. O(l m q).
    pub fn evaluate(&self, points: &[Point]) -> Mat<f64> {
        let (l, m) = (self.sites.len(), self.coefficients.nrows());
        let mut values = Mat::zeros(m, points.len());
        if m > 0 {
            let panels = Panels::new(self.coefficients.get(.., 1..l + 1));
            let together = panels::TOGETHER;
            let alone = ALONE / (together * m * (l + 1)) + 1;
            values
                .par_col_chunks_mut(together)
                .zip(points.par_chunks(together))
                .with_min_len(alone)
                .for_each_init(
                    || vec![0.0; l * together],
                    |bends, (values, points)| {
                        self.evaluate_together(&panels, points, bends, values);
                    },
                );
        }
        values
    }

    /// g at a few points, one a column. `bends` has room for the kernels of all.
    fn evaluate_together(
        &self,
        panels: &Panels,
        points: &[Point],
        bends: &mut [f64],
        values: MatMut<'_, f64>,
    ) {
        let l = self.sites.len();
        let mut columns = columns_mut(values);
        for (i, (x, &p)) in columns.iter_mut().zip(points).enumerate() {
            kernels(p, &self.sites, &mut bends[i * l..(i + 1) * l]);
            x.copy_from_slice(self.coefficients.col_as_slice(0));
        }
        let weights = |i: usize| &bends[i * l..(i + 1) * l];
        match columns.as_mut_slice().as_mut_array() {
            Some(all) => panels.combine(std::array::from_fn(weights), all),
            None => columns.iter_mut().enumerate().for_each(|(i, x)| {
                combine_fused(weights(i), |j| self.coefficients.col_as_slice(j + 1), x);
            }),
        }
        for (&p, x) in points.iter().zip(columns) {
            axpy(p[0], self.coefficients.col_as_slice(l + 1), x);
            axpy(p[1], self.coefficients.col_as_slice(l + 2), x);
        }
    }
}

/// The weights of the kernels and the affine part, one a row, of the g that takes each site to its point's coordinates, or None where rounding leaves
/// its matrix indefinite: kernels are positive definite on the weights that meet the side conditions.
fn interpolant(
    sites: &[Point],
    affine: usize,
    coordinates: MatRef<'_, f64>,
    places: &[usize],
) -> Option<(Mat<f64>, Mat<f64>)> {
    let design = Design::new(sites, affine, sites);
    // Q^T Phi Q, by the symmetry of Phi.
    let mut conditioned = design.bends.transpose().to_owned();
    design.side.apply_transpose(&mut conditioned);
    let mut right = Mat::from_fn(sites.len(), coordinates.nrows(), |j, a| {
        coordinates[(a, places[j])]
    });
    design.side.apply_transpose(&mut right);
    let factor = Cholesky::new(conditioned.get(affine.., affine..).to_owned())?;
    let (mut head, mut weights) = right.split_at_row_mut(affine);
    factor.solve_many(weights.as_mut());
    multiply(
        head.as_mut(),
        Accum::Add,
        (-conditioned.get(..affine, affine..)).as_ref(),
        weights.as_ref(),
    );
    let affine_part = design.side.solve_upper(&head.to_owned());
    Some((design.kernel_weights(&right), affine_part))
}

/// The functions of the pose plane that meet the side conditions, for l sites that span an affine space of functions of dimension `affine`: 1, x
/// and y of it, and l - affine sums of kernels. Sites and points are in the coordinates of a [`Frame`].
pub(super) struct Design {
    /// Of the l x affine matrix [1 s].
    pub side: Qr,
    /// The kernels (a site a row, a point a column) after Q^T of `side`: below the first `affine` rows are the sums that meet the conditions.
    pub bends: Mat<f64>,
    pub affine: usize,
}

impl Design {
    /// O(l points) kernels.
    pub fn new(sites: &[Point], affine: usize, points: &[Point]) -> Self {
        let side = Qr::new(Mat::from_fn(sites.len(), affine, |j, a| {
            [1.0, sites[j][0], sites[j][1]][a]
        }));
        let mut bends = Mat::zeros(sites.len(), points.len());
        for (i, &q) in points.iter().enumerate() {
            kernels(q, sites, bends.col_as_slice_mut(i));
        }
        side.apply_transpose(&mut bends);
        Self {
            side,
            bends,
            affine,
        }
    }

    /// The functions at the points, one a column.
    pub fn matrix(&self, points: &[Point]) -> Mat<f64> {
        Mat::from_fn(points.len(), self.bends.nrows(), |i, j| {
            if j < self.affine {
                [1.0, points[i][0], points[i][1]][j]
            } else {
                self.bends[(j, i)]
            }
        })
    }

    /// The weights of the l kernels and the affine part, one a row, from the coefficients of the functions.
    pub fn parts(&self, solution: &Mat<f64>) -> (Mat<f64>, Mat<f64>) {
        let affine_part = solution.get(..self.affine, ..).to_owned();
        (self.kernel_weights(solution), affine_part)
    }

    /// The weights of the l kernels, one a row, from the coefficients of the functions.
    pub fn kernel_weights(&self, solution: &Mat<f64>) -> Mat<f64> {
        let mut weights = Mat::from_fn(solution.nrows(), solution.ncols(), |j, a| {
            if j < self.affine {
                0.0
            } else {
                solution[(j, a)]
            }
        });
        self.side.apply(&mut weights);
        weights
    }
}

fn choose(points: &[Point], sites: &[usize]) -> Result<Vec<Point>, PoseError> {
    if sites.is_empty() {
        return Err(PoseError::NoSites);
    }
    let at = |(site, &index): (usize, &usize)| {
        points.get(index).copied().ok_or(PoseError::OutOfRange {
            site,
            index,
            points: points.len(),
        })
    };
    sites.iter().enumerate().map(at).collect()
}

/// Sorted along the longer axis, coincident sites are neighbours up to ties.
fn check_apart(normalised: &[Point]) -> Result<(), PoseError> {
    let mut order: Vec<usize> = (0..normalised.len()).collect();
    order.sort_by(|&a, &b| normalised[a][0].total_cmp(&normalised[b][0]));
    for (k, &a) in order.iter().enumerate() {
        let near = order[k + 1..]
            .iter()
            .take_while(|&&b| normalised[b][0] - normalised[a][0] <= COINCIDENT);
        for &b in near {
            if (normalised[a][1] - normalised[b][1]).abs() <= COINCIDENT {
                return Err(PoseError::Coincident {
                    first: a.min(b),
                    second: a.max(b),
                });
            }
        }
    }
    Ok(())
}

/// Coefficients in the units of the points: with q = (p - c) / s, phi(r / s) = (phi(r) - r^2 ln s) / s^2, and the side conditions turn
/// sum_j c_j ||p - s_j||^2 into the constant sum_j c_j ||s_j - c||^2.
pub(super) fn in_given_units(
    frame: &Frame,
    normalised: &[Point],
    weights: &Mat<f64>,
    affine: MatRef<'_, f64>,
) -> Mat<f64> {
    let (l, m) = weights.shape();
    let s = frame.size;
    let squares: Vec<f64> = normalised
        .iter()
        .map(|p| p[0] * p[0] + p[1] * p[1])
        .collect();
    let mut out = Mat::zeros(m, l + 3);
    let per_area = 1.0 / (s * s);
    zip!(out.get_mut(.., 1..l + 1), weights.transpose())
        .for_each(|unzip!(out, weight)| *out = weight * per_area);
    for a in 0..m {
        let along = |axis: usize| {
            if axis + 1 < frame.affine {
                affine[(axis + 1, a)]
            } else {
                0.0
            }
        };
        let gradient = frame.axes * nalgebra::Vector2::new(along(0), along(1)) / s;
        let spread = dot(weights.col_as_slice(a), &squares);
        out[(a, 0)] = affine[(0, a)] - gradient.dot(&frame.centre) - spread * s.ln();
        out[(a, l + 1)] = gradient[0];
        out[(a, l + 2)] = gradient[1];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points(n: usize) -> Vec<Point> {
        (0..n)
            .map(|i| {
                [
                    30.0 * (i as f64 * 1.3).sin() + 100.0,
                    20.0 * (i as f64 * 0.7).cos(),
                ]
            })
            .collect()
    }

    fn shapes(n: usize) -> Mat<f64> {
        Mat::from_fn(3, n, |a, i| ((i * (a + 2)) as f64 * 0.3).sin())
    }

    #[test]
    fn all_sites_interpolate_and_keep_the_side_conditions() {
        let (p, x) = (points(15), shapes(15));
        let g = PoseSignal::fit(&p, x.as_ref(), &(0..15).collect::<Vec<_>>()).unwrap();
        assert!((g.evaluate(&p) - &x).norm_max() < 1e-9);
        for a in 0..3 {
            let sum = |f: &dyn Fn(usize) -> f64| {
                (0..15)
                    .map(|j| g.coefficients[(a, j + 1)] * f(j))
                    .sum::<f64>()
            };
            let size = g.coefficients.norm_max() * 100.0;
            assert!(sum(&|_| 1.0).abs() < 1e-12 * size);
            assert!(sum(&|j| p[j][0]).abs() < 1e-12 * size * 100.0);
            assert!(sum(&|j| p[j][1]).abs() < 1e-12 * size * 100.0);
        }
    }

    #[test]
    fn many_points_have_the_bits_of_each_by_itself() {
        let (p, x) = (points(90), shapes(90));
        let g = PoseSignal::fit(&p, x.as_ref(), &(0..70).collect::<Vec<_>>()).unwrap();
        let all = g.evaluate(&p);
        let mut one = [0.0; 3];
        for (i, &p) in p.iter().enumerate() {
            g.evaluate_into(p, &mut one);
            assert_eq!(one[..], *all.col_as_slice(i));
        }
        let none = PoseSignal {
            sites: Vec::new(),
            coefficients: Mat::ones(2, 3),
        };
        assert_eq!(none.evaluate(&[[2.0, 3.0]]), Mat::full(2, 1, 6.0));
    }

    #[test]
    fn three_sites_give_the_affine_fit() {
        let p = points(10);
        let x = Mat::from_fn(2, 10, |a, i| {
            1.0 + p[i][0] * 0.3 - p[i][1] * (a as f64 + 0.1)
        });
        let g = PoseSignal::fit(&p, x.as_ref(), &[0, 4, 7]).unwrap();
        assert!((g.evaluate(&p) - &x).norm_max() < 1e-11);
    }

    #[test]
    fn collinear_and_coincident_points_are_handled() {
        let line: Vec<Point> = (0..6).map(|i| [i as f64, 2.0 * i as f64]).collect();
        let x = shapes(6);
        let g = PoseSignal::fit(&line, x.as_ref(), &[0, 1, 2, 3, 4, 5]).unwrap();
        assert!((g.evaluate(&line) - &x).norm_max() < 1e-9);
        let one = PoseSignal::fit(&[[1.0, 1.0]; 6], x.as_ref(), &[2]).unwrap();
        let mean = (0..6).map(|i| x[(0, i)]).sum::<f64>() / 6.0;
        assert!((one.evaluate(&[[1.0, 1.0]])[(0, 0)] - mean).abs() < 1e-12);
        assert_eq!(
            PoseSignal::fit(
                &[[1.0, 1.0], [0.0, 0.0], [1.0, 1.0]],
                shapes(3).as_ref(),
                &[0, 1, 2]
            ),
            Err(PoseError::Coincident {
                first: 0,
                second: 2
            })
        );
    }

    proptest! {
        /// Scale and place do not matter: g(s p + c) of moved positions is g(p).
        #[test]
        fn equivariant_under_similarity(s in 1e-3f64..1e3, cx in -5.0f64..5.0, cy in -5.0f64..5.0, turn in 0.0f64..6.0) {
            let (p, x) = (points(14), shapes(14));
            let moved: Vec<Point> = p.iter().map(|q| [
                s * (turn.cos() * q[0] - turn.sin() * q[1] + cx),
                s * (turn.sin() * q[0] + turn.cos() * q[1] + cy),
            ]).collect();
            let sites = [0, 3, 5, 6, 9, 11, 13];
            let a = PoseSignal::fit(&p, x.as_ref(), &sites).unwrap();
            let b = PoseSignal::fit(&moved, x.as_ref(), &sites).unwrap();
            prop_assert!((a.evaluate(&p) - b.evaluate(&moved)).norm_max() < 1e-8);
        }
    }
}
