//! Layout of the pose plane: which dissimilarities are scaled to positions.
//!
//! The paper scales distances between poses. A motion does not lie in a plane, and where stretches of it that are far apart come to lie side by side, g
//! forms a saddle beside the time signal (Figure 3), which the paper leaves to pins. `ordered` needs none: it mixes the distances between poses with
//! distances along the motion, so that frames keep their order and only what truly repeats may coincide.
//!
//! This departs from section 3.2.1. Distances along the motion are shortest paths through the frames, as in Isomap (Tenenbaum, de Silva & Langford
//! 2000) with neighbours in time (Jenkins & Mataric 2004); steps count by their square root, as in the centripetal parametrisation (Lee 1989).

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::fmt;
use std::str::FromStr;
use std::sync::OnceLock;

use faer::{Mat, MatRef};
use thiserror::Error;

use super::Point;
use super::dissimilarities::Dissimilarities;
use super::mds::{Steps, scale_counting};
use super::pins::{Pin, moved_onto, principal_start};
use crate::linalg::dense::{FactorError, symmetric_eigen};

/// Weights that `ordered` chooses from: in-betweens differ little from one to the next, and below 0.3 a layout is neither the one nor the other.
pub const WEIGHTS: [f64; 5] = [0.0, 0.3, 0.5, 0.7, 0.9];
/// A frame nearer to another stretch of the motion than this share of the steps there repeats it. In motion that does not repeat itself frames stay
/// farther than 0.6 of a step from other stretches (cow, samba, jelly), what repeats itself is at 0; merging from 0.1 on spoils in-betweens.
const REPEATED: f64 = 0.05;
/// Steps and gaps of less than this share of the greatest distance are none.
const HELD: f64 = 1e-9;
/// A second eigenvalue below this share of the first is rounding: all dissimilarities are those of points on a line.
const FLAT: f64 = 1e-12;

/// Which dissimilarities are scaled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Layout {
    /// The paper's: distances between poses (section 3.2.1).
    Mds,
    /// Distances between poses mixed with distances along the motion, the latter with this weight, 0 to 1 (0 is `Mds`); the best of [`WEIGHTS`] if not
    /// given, see [`super::fit::fit`].
    Ordered { weight: Option<f64> },
}

/// `ordered`: its in-betweens are better on every real sequence measured and below linear ones on all, and (2) at the paper's k, l, m is no worse. With as
/// many as 80% of n it gives up some of (2) for them (reading 14).
impl Default for Layout {
    fn default() -> Self {
        Self::Ordered { weight: None }
    }
}

/// A layout that there is not.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LayoutError {
    /// Another name.
    #[error(
        "there is no layout `{0}`; there are mds, ordered, and ordered:W with a weight W from 0 to 1"
    )]
    Unknown(String),
    /// A weight that is none.
    #[error("weight {0} of distances along the motion, expected 0 to 1")]
    Weight(f64),
}

impl Layout {
    /// The weights to try, the first of equals to be taken.
    pub fn weights(&self) -> Vec<f64> {
        match self {
            Self::Mds => vec![0.0],
            Self::Ordered { weight: Some(w) } => vec![*w],
            Self::Ordered { weight: None } => WEIGHTS.to_vec(),
        }
    }

    /// An error unless the weight is one.
    pub fn check(&self) -> Result<(), LayoutError> {
        let bad = |w: &f64| !(0.0..=1.0).contains(w);
        self.weights()
            .into_iter()
            .find(bad)
            .map_or(Ok(()), |w| Err(LayoutError::Weight(w)))
    }
}

impl FromStr for Layout {
    type Err = LayoutError;

    fn from_str(name: &str) -> Result<Self, LayoutError> {
        let unknown = || LayoutError::Unknown(name.into());
        let layout = match name.split_once(':') {
            None if name == "mds" => Self::Mds,
            None if name == "ordered" => Self::Ordered { weight: None },
            Some(("ordered", weight)) => Self::Ordered {
                weight: Some(weight.parse().map_err(|_| unknown())?),
            },
            _ => return Err(unknown()),
        };
        layout.check()?;
        Ok(layout)
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mds => f.write_str("mds"),
            Self::Ordered { weight: None } => f.write_str("ordered"),
            Self::Ordered { weight: Some(w) } => write!(f, "ordered:{w}"),
        }
    }
}

/// Distances between poses and along the motion, from which the dissimilarities of every weight are mixed.
pub struct Distances {
    poses: Dissimilarities,
    /// Found when a weight first needs them.
    along: OnceLock<Dissimilarities>,
}

impl Distances {
    /// Of coordinates X, m x n. O(n^2 m); where the motion repeats itself, shortest paths cost O(n e log n) more for e steps and repeats.
    pub fn new(coordinates: MatRef<'_, f64>) -> Self {
        Self {
            poses: Dissimilarities::new(coordinates),
            along: OnceLock::new(),
        }
    }

    /// delta_ij with delta_ij^2 proportional to (1 - w) ||x_i - x_j||^2 + w gamma_ij^2, gamma being the distances of [`along_the_motion`], of the same
    /// sum of squares as the distances between poses. Weight 0 gives those themselves. O(n^2).
    pub fn mixed(&self, weight: f64) -> Dissimilarities {
        if weight == 0.0 {
            return self.poses.clone();
        }
        let n = self.poses.len();
        let along = self.along.get_or_init(|| along_the_motion(&self.poses));
        let mix = |i: usize, j: usize| {
            let (d, s) = (self.poses.row(i)[j], along.row(i)[j]);
            ((1.0 - weight) * d * d + weight * s * s).sqrt()
        };
        let mixed = Dissimilarities::from_fn(n, mix);
        let size = (self.poses.sum_of_squares() / mixed.sum_of_squares()).sqrt();
        match size.is_finite() {
            true => Dissimilarities::from_fn(n, |i, j| size * mixed.row(i)[j]),
            false => mixed,
        }
    }

    /// Positions of the frames in the pose plane for this weight, pins held, and the steps that the scaling took.
    ///
    /// Scaling starts from classical scaling of the same dissimilarities, which for weight 0 is the first two principal coordinates (reading 6).
    /// `coordinates` are those that these distances are of. O(n^3) for classical scaling, then as [`super::mds::scale`].
    pub fn positions(
        &self,
        coordinates: MatRef<'_, f64>,
        weight: f64,
        pins: &[Pin],
    ) -> Result<(Vec<Point>, Steps), FactorError> {
        if weight == 0.0 {
            let start = principal_start(coordinates, pins);
            return Ok(scale_counting(&self.poses, &start, pins));
        }
        let delta = self.mixed(weight);
        let start = moved_onto(classical_scaling(&delta)?, pins);
        Ok(scale_counting(&delta, &start, pins))
    }
}

/// Distances gamma_ij along the motion, from the distances between its poses.
///
/// Frames are joined to the next: a step of length s, 0 where it is less than 1e-9 of the greatest distance, counts sqrt(s s') with s' the mean step, so
/// that fast stretches do not crowd out slow ones and held poses stay one. A frame that repeats another stretch, which is one within 0.05 of a
/// step of the segment between two others, is joined to both ends of that step by its shares of it. gamma_ij is the shortest path.
pub fn along_the_motion(poses: &Dissimilarities) -> Dissimilarities {
    let n = poses.len();
    let negligible = HELD * poses.greatest();
    let step = |i: usize| match poses.row(i)[i + 1] {
        s if s <= negligible => 0.0,
        s => s,
    };
    let steps: Vec<f64> = (0..n.saturating_sub(1)).map(step).collect();
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    let lengths: Vec<f64> = steps.iter().map(|s| (s * mean).sqrt()).collect();
    let repeats = repeats(poses, &steps, negligible);
    if repeats.is_empty() {
        let mut sum = 0.0;
        let mut places = vec![0.0];
        places.extend(lengths.iter().map(|length| {
            sum += length;
            sum
        }));
        return Dissimilarities::from_fn(n, |i, j| (places[i] - places[j]).abs());
    }
    let mut joined: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
    let mut join = |a: usize, b: usize, length: f64| {
        joined[a].push((b, length));
        joined[b].push((a, length));
    };
    for (i, &length) in lengths.iter().enumerate() {
        join(i, i + 1, length);
    }
    for repeat in repeats {
        let length = lengths[repeat.step];
        join(repeat.frame, repeat.step, repeat.share * length);
        join(repeat.frame, repeat.step + 1, (1.0 - repeat.share) * length);
    }
    let rows: Vec<Vec<f64>> = (0..n).map(|i| shortest_paths(&joined, i)).collect();
    Dissimilarities::from_fn(n, |i, j| rows[i.min(j)][i.max(j)])
}

/// A frame that lies on the step from `step` to `step + 1`, `share` of the way along it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Repeat {
    frame: usize,
    step: usize,
    share: f64,
}

/// Every frame on every step that it is not an end of. The bound is a share of the shorter of the step and the frame's own longer step. O(n^2).
fn repeats(poses: &Dissimilarities, steps: &[f64], negligible: f64) -> Vec<Repeat> {
    let own = |i: usize| {
        let before = i.checked_sub(1).map_or(0.0, |b| steps[b]);
        before.max(steps.get(i).copied().unwrap_or(0.0))
    };
    let mut found = Vec::new();
    for frame in 0..poses.len() {
        let row = poses.row(frame);
        for (step, &length) in steps.iter().enumerate() {
            if frame == step || frame == step + 1 {
                continue;
            }
            let (distance, share) = to_segment(row[step], row[step + 1], length);
            if distance <= (REPEATED * length.min(own(frame))).max(negligible) {
                found.push(Repeat { frame, step, share });
            }
        }
    }
    found
}

/// Distance of a point from a segment of this length, and how far along it the nearest point is (0 to 1), from its distances to both ends.
fn to_segment(first: f64, second: f64, length: f64) -> (f64, f64) {
    if length == 0.0 {
        return (first, 0.0);
    }
    let along = (first * first - second * second + length * length) / (2.0 * length * length);
    match along {
        u if u <= 0.0 => (first, 0.0),
        u if u >= 1.0 => (second, 1.0),
        u => ((first * first - (u * length).powi(2)).max(0.0).sqrt(), u),
    }
}

/// A frame and its distance so far; the nearest is the greatest, so that the heap gives it first.
#[derive(PartialEq)]
struct Reached(f64, usize);

impl Eq for Reached {}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Lengths of the shortest paths from one frame (Dijkstra 1959).
fn shortest_paths(joined: &[Vec<(usize, f64)>], from: usize) -> Vec<f64> {
    let mut distances = vec![f64::INFINITY; joined.len()];
    let mut heap = BinaryHeap::from([Reached(0.0, from)]);
    distances[from] = 0.0;
    while let Some(Reached(distance, frame)) = heap.pop() {
        if distance > distances[frame] {
            continue;
        }
        for &(next, length) in &joined[frame] {
            let through = distance + length;
            if through < distances[next] {
                distances[next] = through;
                heap.push(Reached(through, next));
            }
        }
    }
    distances
}

/// Classical scaling (Torgerson 1952): the first two eigenvectors of -J delta^2 J / 2, J removing means, times the roots of their eigenvalues. The
/// entry of largest magnitude of each is positive; what is no positive eigenvalue, or rounding, gives 0. O(n^3).
fn classical_scaling(delta: &Dissimilarities) -> Result<Vec<Point>, FactorError> {
    let n = delta.len();
    let square = |i: usize, j: usize| delta.row(i)[j].powi(2);
    let means: Vec<f64> = (0..n)
        .map(|i| (0..n).map(|j| square(i, j)).sum::<f64>() / n as f64)
        .collect();
    let mean = means.iter().sum::<f64>() / n.max(1) as f64;
    let centred = Mat::from_fn(n, n, |i, j| {
        (means[i] + means[j] - mean - square(i, j)) / 2.0
    });
    let eigen = symmetric_eigen(centred.as_ref())?;
    let axis = |a: usize| -> Vec<f64> {
        let value = eigen.values.get(a).copied().unwrap_or(0.0);
        if value.is_nan() || value <= 0.0 || value <= FLAT * eigen.values[0] && a > 0 {
            return vec![0.0; n];
        }
        let vector = eigen.vectors.col_as_slice(a);
        let larger = |x: &f64, y: &f64| y.abs() > x.abs();
        let largest = vector
            .iter()
            .copied()
            .reduce(|x, y| if larger(&x, &y) { y } else { x });
        let size = value.sqrt() * largest.unwrap_or(1.0).signum();
        vector.iter().map(|x| size * x).collect()
    };
    let (x, y) = (axis(0), axis(1));
    Ok(x.into_iter().zip(y).map(|(x, y)| [x, y]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// n points of a curve in space at uniform parameters.
    fn curve(n: usize, at: impl Fn(f64) -> [f64; 3]) -> Mat<f64> {
        Mat::from_fn(3, n, |a, i| at(i as f64)[a])
    }

    fn along(x: &Mat<f64>) -> Dissimilarities {
        along_the_motion(&Dissimilarities::new(x.as_ref()))
    }

    #[test]
    fn steps_count_by_their_square_roots_and_held_poses_stay_one() {
        // Steps 1, 0, 4, 4: the mean is 9 / 4, so lengths are 1.5, 0, 3, 3.
        let x = curve(5, |t| [[0.0, 1.0, 1.0, 5.0, 9.0][t as usize], 0.0, 0.0]);
        let gamma = along(&x);
        for (i, j, expected) in [(0, 1, 1.5), (1, 2, 0.0), (0, 3, 4.5), (4, 0, 7.5)] {
            assert!((gamma.row(i)[j] - expected).abs() < 1e-14, "{i} {j}");
        }
    }

    #[test]
    fn a_second_turn_lies_on_the_first_in_and_out_of_phase() {
        for per_turn in [12.0, 24.5] {
            let turn = std::f64::consts::TAU / per_turn;
            let n = 2 * per_turn as usize + 1;
            let x = curve(n, |t| [(turn * t).cos(), (turn * t).sin(), 0.0]);
            let gamma = along(&x);
            let step = gamma.row(0)[1];
            for i in 0..n {
                for j in 0..n {
                    let apart = (i as f64 - j as f64).abs() % per_turn;
                    let round = apart.min(per_turn - apart) * step;
                    assert!(
                        (gamma.row(i)[j] - round).abs() < 0.6 * step,
                        "{per_turn}: {i} {j}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_only_looks_near_stays_apart() {
        // A helix whose turns are two steps apart does not repeat itself.
        let x = curve(40, |t| {
            [10.0 * (0.5 * t).cos(), 10.0 * (0.5 * t).sin(), 0.8 * t]
        });
        let gamma = along(&x);
        assert!((gamma.row(0)[39] / gamma.row(0)[1] - 39.0).abs() < 1e-9);
        let distances = Distances::new(x.as_ref());
        let gap = |weight: f64| {
            let p = distances.positions(x.as_ref(), weight, &[]).unwrap().0;
            let size = super::super::poses::diameter(&p);
            let pairs = (0..40usize).flat_map(|i| (0..i.saturating_sub(5)).map(move |j| (i, j)));
            pairs
                .map(|(i, j)| super::super::distance(p[i], p[j]) / size)
                .fold(1.0, f64::min)
        };
        // 0.154 and 0.108 of the extent.
        let (plain, ordered) = (gap(0.0), gap(0.9));
        assert!(ordered > 1.3 * plain, "{plain} {ordered}");
    }

    #[test]
    fn a_line_is_laid_out_as_a_line_and_a_point_as_a_point() {
        let line = curve(9, |t| [t, 2.0 * t, -t]);
        let p = Distances::new(line.as_ref())
            .positions(line.as_ref(), 0.7, &[])
            .unwrap()
            .0;
        let step = super::super::distance(p[0], p[1]);
        assert!((step - 6f64.sqrt()).abs() < 1e-9);
        assert!((super::super::distance(p[0], p[8]) - 8.0 * step).abs() < 1e-9);
        let point = curve(5, |_| [1.0; 3]);
        let p = Distances::new(point.as_ref())
            .positions(point.as_ref(), 0.7, &[])
            .unwrap()
            .0;
        assert_eq!(p, [[0.0; 2]; 5]);
    }

    #[test]
    fn pins_are_held() {
        let x = curve(20, |t| [(0.4 * t).sin(), (0.3 * t).cos(), 0.1 * t]);
        let pin = Pin {
            frame: 7,
            position: [3.0, -1.0],
        };
        let p = Distances::new(x.as_ref())
            .positions(x.as_ref(), 0.5, &[pin])
            .unwrap()
            .0;
        assert_eq!(p[7], pin.position);
    }

    #[test]
    fn names_round_and_bad_ones_are_refused() {
        for name in ["mds", "ordered", "ordered:0.25", "ordered:1"] {
            assert_eq!(name.parse::<Layout>().unwrap().to_string(), name);
        }
        for name in [
            "",
            "order",
            "ordered:",
            "ordered:x",
            "ordered:1.5",
            "ordered:-1",
            "ordered:NaN",
            "mds:1",
        ] {
            assert!(name.parse::<Layout>().is_err(), "{name}");
        }
    }

    proptest! {
        /// gamma is a metric of the steps, whatever repeats; turning X over changes nothing, and neither does time run backwards.
        #[test]
        fn a_metric(x in prop::collection::vec(prop::sample::select(vec![0.0, 1.0, 1.02, 3.0]), 4..25)) {
            let n = x.len();
            let forward = along(&Mat::from_fn(2, n, |a, i| if a == 0 { x[i] } else { x[(i * 7) % n] }));
            let backward = along(&Mat::from_fn(2, n, |a, i| if a == 0 { x[n - 1 - i] } else { x[((n - 1 - i) * 7) % n] }));
            for i in 0..n {
                prop_assert_eq!(forward.row(i)[i], 0.0);
                for j in 0..n {
                    prop_assert!(forward.row(i)[j] == forward.row(j)[i]);
                    prop_assert!((forward.row(i)[j] - backward.row(n - 1 - i)[n - 1 - j]).abs() < 1e-9);
                    for k in 0..n {
                        prop_assert!(forward.row(i)[j] <= forward.row(i)[k] + forward.row(k)[j] + 1e-9);
                    }
                }
            }
        }

        /// The point of a segment nearest to a point, from distances alone.
        #[test]
        fn nearest_on_a_segment(x in -3.0f64..3.0, y in -3.0f64..3.0, length in 0.1f64..2.0) {
            let (distance, share) = to_segment(x.hypot(y), (x - length).hypot(y), length);
            let nearest = x.clamp(0.0, length);
            prop_assert!((share * length - nearest).abs() < 1e-9);
            prop_assert!((distance - (x - nearest).hypot(y)).abs() < 1e-6);
        }
    }
}
