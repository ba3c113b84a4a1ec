//! The greedy order in which frames become sites of the pose signal (section 3.2.2).

use faer::{Mat, MatRef};

use super::Point;
use super::thin_plate::{Frame, kernels};
use crate::linalg::appended_qr::AppendedQr;
use crate::linalg::dense::{FactorError, symmetric_eigen};
use crate::linalg::kernels::{axpy, norm_squared, sum};

/// Errors smaller than this share of the data's norm count as 0 (reading 5).
const NEGLIGIBLE: f64 = 1e-12;
/// Frames closer than this share of the poses' extent are at one place, which makes one site.
const COINCIDENT: f64 = 1e-12;
/// The corners of the reference triangle must be at least this far from collinear, as a share of the extent.
const FLAT: f64 = 1e-6;

/// The order of the sites and what each number of them costs.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteOrder {
    /// 0-based frames, the first site first. Shorter than asked where too few frames are apart.
    pub order: Vec<usize>,
    /// `errors[j]` is the error (4) of the least-squares fit with the first j + 3 sites.
    pub errors: Vec<f64>,
}

/// Chooses `count` sites: the four frames farthest from the best-fit plane, then again and again the frame with the greatest error of the fit with
/// the sites so far.
///
/// `points` are the n pose-space positions and `coordinates` (m x n) the shape coordinates. Frames that are no `candidates` wait until all
/// candidates are chosen (reading 10); a frame at the same place as a chosen site is never chosen. Ties go to the lower index (reading 5). Up to four
/// candidates that are `first` (0-based frames, by their index) come before all others, which the paper has not; those that are not there are passed over.
///
/// The fits are one QR that grows by a column a site: the spaces are nested once the side conditions are met by subtracting, from each site's
/// kernel, the kernels of three fixed sites with the site's barycentric weights. O(n^2) kernels, then O(n (l + m)) a site.
pub fn site_order(
    points: &[Point],
    coordinates: MatRef<'_, f64>,
    count: usize,
    candidates: &[bool],
    first: &[usize],
) -> Result<SiteOrder, FactorError> {
    let mut search = Search::new(points, coordinates, candidates);
    let mut distances = plane_distances(coordinates)?;
    for &frame in first {
        if let Some(distance) = distances.get_mut(frame) {
            *distance = f64::INFINITY;
        }
    }
    for _ in 0..count.min(4) {
        let Some(next) = search.farthest(&distances) else {
            break;
        };
        search.choose(next);
    }
    search.begin();
    while search.order.len() < count {
        let Some(next) = search.farthest(&search.residual_norms()) else {
            break;
        };
        search.choose(next);
        search.extend(next);
    }
    Ok(SiteOrder {
        errors: search.errors(),
        order: search.order,
    })
}

struct Search<'a> {
    /// Normalised positions.
    points: Vec<Point>,
    order: Vec<usize>,
    /// Frames that may still become sites, the candidates before the others.
    open: Vec<bool>,
    candidates: &'a [bool],
    /// Up to three sites that span the plane, by which the others meet the side conditions.
    reference: Vec<usize>,
    /// The kernels of the reference sites at every frame.
    reference_kernels: Vec<Vec<f64>>,
    fit: AppendedQr,
    residual_squares: Vec<f64>,
    coordinates: MatRef<'a, f64>,
    /// Errors up to this are equal to 0.
    negligible: f64,
}

impl<'a> Search<'a> {
    fn new(points: &[Point], coordinates: MatRef<'a, f64>, candidates: &'a [bool]) -> Self {
        let frame = Frame::new(points);
        Self {
            points: points.iter().map(|&p| frame.normalise(p)).collect(),
            order: Vec::new(),
            open: vec![true; points.len()],
            candidates,
            reference: Vec::new(),
            reference_kernels: Vec::new(),
            negligible: NEGLIGIBLE * coordinates.norm_l2(),
            fit: AppendedQr::new(coordinates.transpose()),
            residual_squares: Vec::new(),
            coordinates,
        }
    }

    /// The open frame with the greatest value, a candidate if there is one; the lowest index of equals, and what is negligible is equal to 0.
    fn farthest(&self, values: &[f64]) -> Option<usize> {
        let value = |i: usize| {
            if values[i] <= self.negligible {
                0.0
            } else {
                values[i]
            }
        };
        let worst = |candidate: bool| {
            (0..values.len())
                .filter(|&i| self.open[i] && self.candidates[i] == candidate)
                .reduce(|best, i| if value(i) > value(best) { i } else { best })
        };
        worst(true).or_else(|| worst(false))
    }

    fn choose(&mut self, site: usize) {
        self.order.push(site);
        let [x, y] = self.points[site];
        for (open, p) in self.open.iter_mut().zip(&self.points) {
            let apart = (p[0] - x).powi(2) + (p[1] - y).powi(2) > COINCIDENT * COINCIDENT;
            *open = *open && apart;
        }
    }

    /// The fit of the first sites: the affine functions, then the kernels of what is not a corner of the reference triangle.
    fn begin(&mut self) {
        for site in reference_sites(&self.points, &self.order) {
            self.refer(site);
        }
        self.append(self.points.iter().map(|_| 1.0).collect());
        for axis in 0..self.reference.len().saturating_sub(1) {
            self.append(self.points.iter().map(|p| p[axis]).collect());
        }
        self.record();
        let rest: Vec<usize> = self
            .order
            .iter()
            .copied()
            .filter(|s| !self.reference.contains(s))
            .collect();
        for site in rest {
            self.extend(site);
        }
    }

    /// Adds the function that site `site` brings.
    fn extend(&mut self, site: usize) {
        let completes = self.reference.len() < 3 && !self.spanned(site);
        if completes {
            let axis = self.reference.len() - 1;
            self.refer(site);
            self.append(self.points.iter().map(|p| p[axis]).collect());
        } else {
            self.append(self.kernel_column(site));
        }
        self.record();
    }

    fn refer(&mut self, site: usize) {
        self.reference.push(site);
        self.reference_kernels.push(self.kernels(site));
    }

    fn kernels(&self, site: usize) -> Vec<f64> {
        let mut values = vec![0.0; self.points.len()];
        kernels(self.points[site], &self.points, &mut values);
        values
    }

    fn spanned(&self, site: usize) -> bool {
        let mut corners = self.reference.clone();
        corners.push(site);
        spread(&self.points, &corners) <= FLAT
    }

    /// phi(s - p) less the barycentric mixture of the reference kernels, at every frame.
    fn kernel_column(&self, site: usize) -> Vec<f64> {
        let mut column = self.kernels(site);
        let weights = barycentric(&self.points, &self.reference, self.points[site]);
        for (weight, kernels) in weights.iter().zip(&self.reference_kernels) {
            axpy(-weight, kernels, &mut column);
        }
        column
    }

    fn append(&mut self, column: Vec<f64>) {
        self.fit.append(column);
    }

    fn record(&mut self) {
        self.residual_squares.push(sum(self.fit.row_squares()));
    }

    /// The error of each frame.
    fn residual_norms(&self) -> Vec<f64> {
        let squares = self.fit.row_squares().iter();
        squares.map(|square| square.sqrt()).collect()
    }

    /// Error (4) from three sites on; where the reference is not a triangle the spaces begin smaller and the entries before are dropped.
    fn errors(&self) -> Vec<f64> {
        let total: f64 = self.coordinates.squared_norm_l2();
        let wanted = self.order.len().saturating_sub(2).max(1);
        let surplus = self.residual_squares.len().saturating_sub(wanted);
        self.residual_squares[surplus..]
            .iter()
            .map(|&e| if e <= NEGLIGIBLE * total { 0.0 } else { e })
            .collect()
    }
}

/// Distances of the columns of X to the best-fit plane, which passes through their centroid (reading 5). O(n m^2).
fn plane_distances(coordinates: MatRef<'_, f64>) -> Result<Vec<f64>, FactorError> {
    let (m, n) = coordinates.shape();
    let mean: Vec<f64> = (0..m)
        .map(|a| (0..n).map(|i| coordinates[(a, i)]).sum::<f64>() / n as f64)
        .collect();
    let centred = Mat::from_fn(m, n, |a, i| coordinates[(a, i)] - mean[a]);
    let axes = symmetric_eigen((&centred * centred.transpose()).as_ref())?.vectors;
    let across = axes.get(.., 2.min(m)..).transpose() * &centred;
    Ok((0..n)
        .map(|i| norm_squared(across.col_as_slice(i)).sqrt())
        .collect())
}

/// Twice the area of three points, the distance of two, 1 for one.
fn spread(points: &[Point], corners: &[usize]) -> f64 {
    match *corners {
        [a, b] => super::distance(points[a], points[b]),
        [a, b, c] => area(points[a], points[b], points[c]).abs(),
        _ => 1.0,
    }
}

/// Twice the signed area of a triangle.
fn area(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Of the first sites the three that span the largest triangle; two, or one, where all are collinear or coincide.
fn reference_sites(points: &[Point], sites: &[usize]) -> Vec<usize> {
    let subsets = |size: usize| {
        (0..1usize << sites.len()).filter(move |mask| mask.count_ones() as usize == size)
    };
    for size in [3, 2] {
        let corners = |mask: usize| -> Vec<usize> {
            let taken = sites
                .iter()
                .enumerate()
                .filter(|(bit, _)| mask >> bit & 1 == 1);
            taken.map(|(_, &site)| site).collect()
        };
        let best = subsets(size)
            .map(corners)
            .max_by(|a, b| spread(points, a).total_cmp(&spread(points, b)));
        if let Some(best) = best
            && spread(points, &best) > FLAT
        {
            return best;
        }
    }
    sites.iter().take(1).copied().collect()
}

/// Affine weights of the corners, summing to 1, whose mixture is nearest to p.
fn barycentric(points: &[Point], corners: &[usize], p: Point) -> Vec<f64> {
    match *corners {
        [a, b, c] => {
            let (a, b, c) = (points[a], points[b], points[c]);
            let whole = area(a, b, c);
            let (wb, wc) = (area(a, p, c) / whole, area(a, b, p) / whole);
            vec![1.0 - wb - wc, wb, wc]
        }
        [a, b] => {
            let (a, b) = (points[a], points[b]);
            let along = [b[0] - a[0], b[1] - a[1]];
            let w = ((p[0] - a[0]) * along[0] + (p[1] - a[1]) * along[1])
                / (along[0] * along[0] + along[1] * along[1]);
            vec![1.0 - w, w]
        }
        _ => vec![1.0; corners.len()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::g::PoseSignal;

    fn sample(n: usize) -> (Vec<Point>, Mat<f64>) {
        let points = (0..n)
            .map(|i| [(i as f64 * 1.7).sin() * 5.0, (i as f64 * 0.9).cos() * 3.0])
            .collect();
        let x = Mat::from_fn(5, n, |a, i| ((i + 1) as f64 * (a as f64 + 0.6)).sin());
        (points, x)
    }

    #[test]
    fn errors_are_those_of_fresh_fits_and_the_choice_is_the_worst_frame() {
        let (points, x) = sample(25);
        let found = site_order(&points, x.as_ref(), 25, &[true; 25], &[]).unwrap();
        assert_eq!(found.order.len(), 25);
        for l in 3..25 {
            let g = PoseSignal::fit(&points, x.as_ref(), &found.order[..l]).unwrap();
            let residual = g.evaluate(&points) - &x;
            let error = residual.squared_norm_l2();
            assert!(
                (error - found.errors[l - 3]).abs() < 1e-10 * x.squared_norm_l2(),
                "{l}"
            );
            if l >= 4 {
                let next = (0..25)
                    .filter(|i| !found.order[..l].contains(i))
                    .max_by(|&a, &b| {
                        residual
                            .col(a)
                            .norm_l2()
                            .total_cmp(&residual.col(b).norm_l2())
                    });
                assert_eq!(next, Some(found.order[l]));
            }
        }
        assert_eq!(found.errors.len(), 23);
        assert_eq!(found.errors[22], 0.0);
    }

    #[test]
    fn repeated_frames_make_one_site() {
        let (mut points, mut x) = sample(20);
        for i in 10..20 {
            points[i] = points[i - 10];
            for a in 0..5 {
                x[(a, i)] = x[(a, i - 10)];
            }
        }
        let found = site_order(&points, x.as_ref(), 20, &[true; 20], &[]).unwrap();
        assert_eq!(found.order.len(), 10);
        assert!(found.order.iter().all(|&i| i < 10));
    }

    #[test]
    fn candidates_come_first_and_the_others_after_them() {
        let (points, x) = sample(12);
        let candidates: Vec<bool> = (0..12).map(|i| i % 3 != 0).collect();
        let found = site_order(&points, x.as_ref(), 12, &candidates, &[]).unwrap();
        assert!(found.order[..8].iter().all(|i| i % 3 != 0));
        assert!(found.order[8..].iter().all(|i| i % 3 == 0));
    }

    #[test]
    fn the_first_come_first_where_they_are_candidates() {
        let (points, x) = sample(12);
        let given = site_order(&points, x.as_ref(), 12, &[true; 12], &[]).unwrap();
        let last = given.order[11];
        let candidates: Vec<bool> = (0..12).map(|i| i != given.order[10]).collect();
        let first = [last, given.order[10]];
        let found = site_order(&points, x.as_ref(), 12, &candidates, &first).unwrap();
        assert_eq!([found.order[0], found.order[11]], first);
    }

    #[test]
    fn degenerate_layouts_still_give_an_order() {
        let x = sample(8).1;
        let line: Vec<Point> = (0..8).map(|i| [i as f64, 0.0]).collect();
        assert_eq!(
            site_order(&line, x.as_ref(), 8, &[true; 8], &[])
                .unwrap()
                .order
                .len(),
            8
        );
        let one = site_order(&[[2.0, 1.0]; 8], x.as_ref(), 8, &[true; 8], &[]).unwrap();
        assert_eq!(one.order.len(), 1);
        let none = site_order(&line, Mat::zeros(0, 8).as_ref(), 8, &[true; 8], &[]).unwrap();
        assert_eq!(none.order, [0, 1, 2, 3, 4, 5, 6, 7]);
    }
}
