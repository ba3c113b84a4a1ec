//! The pose signal g: a thin-plate approximation from the pose plane to shape coordinates (sections 2.2 and 3.2).

use faer::{Mat, MatRef};
use rayon::prelude::*;
use thiserror::Error;

use super::Point;
use super::thin_plate::{Frame, eight_points, kernels, kernels_of_eight};
use super::thin_plate_fit::{Design, ROWS, interpolant, least_squares};
use crate::linalg::dense::columns_mut;
use crate::linalg::entry::{Eight, Entry};
use crate::linalg::kernels::{LANES, combine_fused};
use crate::linalg::panels::{Panels, alone};

/// Sites closer than this share of their extent coincide.
const COINCIDENT: f64 = 1e-13;

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
    /// system, solved by another QR: O(n l (l + m)). With l = 3 sites an affine map; with l = n an interpolant, whose system is symmetric and positive
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
        let at = |i: usize| coordinates.col(i);
        let m = coordinates.nrows();
        let through = (sites.len() == points.len())
            .then(|| interpolant(&normalised, frame.affine, m, |j| at(sites[j])))
            .flatten();
        let plate = through.unwrap_or_else(|| {
            let queries: Vec<Point> = points.iter().map(|&p| frame.normalise(p)).collect();
            let design = Design::new(&normalised, frame.affine, &queries);
            least_squares(&design, &queries, m, at)
        });
        Ok(Self {
            coefficients: plate.in_given_units(&frame, &normalised),
            sites: chosen,
        })
    }

    /// l, the number of sites.
    pub fn site_count(&self) -> usize {
        self.sites.len()
    }

    /// Writes g(p), m numbers, over `x`. O(l m).
    pub fn evaluate_into(&self, p: Point, x: &mut [f64]) {
        let l = self.sites.len();
        let mut weights = vec![1.0; l + 3];
        kernels(p, &self.sites, &mut weights[1..=l]);
        weights[l + 1..].copy_from_slice(&p);
        x.fill(0.0);
        combine_fused(&weights, |j| self.coefficients.col_as_slice(j), x);
    }

    /// g at many points, m x q, with the same bits as one by one. O(l m q).
    pub fn evaluate(&self, points: &[Point]) -> Mat<f64> {
        let m = self.coefficients.nrows();
        let mut values = Mat::zeros(m, points.len());
        if m > 0 {
            let panels =
                Panels::<ROWS>::of_rows(m, self.sites.len() + 3, |j| self.coefficients.col(j));
            values
                .par_col_chunks_mut(LANES)
                .zip(points.par_chunks(LANES))
                .with_min_len(alone(LANES * m * panels.length()))
                .for_each_init(
                    || vec![Entry([1.0; LANES]); panels.length()],
                    |weights, (values, points)| {
                        self.weights(points, weights);
                        panels.products(weights, &mut columns_mut(values));
                    },
                );
        }
        values
    }

    /// What up to eight points make of 1, of the kernels, and of the plane, into l + 3 entries.
    fn weights(&self, points: &[Point], weights: &mut [Eight]) {
        let l = self.sites.len();
        let points = eight_points(points);
        kernels_of_eight(&points, &self.sites, &mut weights[1..=l]);
        weights[l + 1..].copy_from_slice(&points);
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
