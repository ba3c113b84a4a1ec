//! Repeated and nearly repeated poses (reading 10).

use rayon::prelude::*;

use super::Point;

/// The greatest distance between two points. O(n^2).
pub fn diameter(points: &[Point]) -> f64 {
    let reach = |i: usize| {
        points[i + 1..]
            .iter()
            .map(|&q| super::distance(points[i], q))
            .fold(0.0, f64::max)
    };
    (0..points.len())
        .into_par_iter()
        .map(reach)
        .reduce(|| 0.0, f64::max)
}

/// Marks the first frame of each pose: a frame belongs to the first earlier pose whose first frame is within `tolerance` of it, and begins a
/// pose of its own where there is none. O(n poses).
pub fn first_of_each(points: &[Point], tolerance: f64) -> Vec<bool> {
    let mut firsts: Vec<Point> = Vec::new();
    points
        .iter()
        .map(|&p| {
            let new = firsts.iter().all(|&q| super::distance(p, q) > tolerance);
            if new {
                firsts.push(p);
            }
            new
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_frames_join_the_first_of_their_pose() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.05, 0.0], [1.0, 0.0], [5.0, 0.0]];
        assert_eq!(
            first_of_each(&points, 0.1),
            [true, true, false, false, true]
        );
        assert_eq!(first_of_each(&points, 0.0), [true, true, true, false, true]);
        assert_eq!(diameter(&points), 5.0);
        assert_eq!(diameter(&[]), 0.0);
    }
}
