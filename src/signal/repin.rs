//! Scaling again and again while pins move (section 3.2.1: "fast enough to give real-time feedback to the user").
//!
//! The dissimilarities, the last layout and a Cholesky factor of the Hessian there are kept. A pin that moves a little leaves a layout near the next minimum,
//! to which a few Newton steps lead, each solved by conjugate gradients with that factor as preconditioner. Where the way is too far for Newton's method,
//! majorisation comes first, as in [`super::mds`].

use faer::Mat;

use super::Point;
use super::dissimilarities::Dissimilarities;
use super::mds::{Steps, VANISHED, free_first, minimise};
use super::pins::{Pin, PinError, validate_pins};
use super::stress::{Places, Problem, Slope};
use crate::linalg::dense::Cholesky;
use crate::linalg::kernels::{axpy, dot, norm_squared};

/// Newton steps before the way counts as too far.
const NEWTON_STEPS: usize = 12;
/// Products with the Hessian for one step, after which its factor is too old.
const INNER_STEPS: usize = 40;
/// With more products than this for one minimum, the next one begins with a new factor.
const OLD: usize = 24;
/// Added to the Hessian's diagonal, as a share of n, its typical curvature: turning a layout with fewer than two pins costs nothing.
const SHIFT: f64 = 1e-9;

/// A layout whose pins can be moved; frames are 0-based.
pub struct Scaling {
    delta: Dissimilarities,
    positions: Vec<Point>,
    pins: Vec<Option<Point>>,
    prepared: Option<Prepared>,
    factor: Option<Cholesky>,
}

/// The problem for one choice of pinned frames.
struct Prepared {
    order: Vec<usize>,
    problem: Problem,
}

impl Scaling {
    /// From a start (n points; best one that [`super::mds::scale`] has minimised) and its pins. O(n^2) memory, once.
    pub fn new(delta: Dissimilarities, start: &[Point], pins: &[Pin]) -> Result<Self, PinError> {
        let n = delta.len().min(start.len());
        validate_pins(pins, n)?;
        let mut scaling = Self {
            positions: start.to_vec(),
            pins: vec![None; n],
            delta,
            prepared: None,
            factor: None,
        };
        pins.iter().try_for_each(|&pin| scaling.move_pin(pin))?;
        Ok(scaling)
    }

    /// The layout: a minimum after [`Self::solve`].
    pub fn positions(&self) -> &[Point] {
        &self.positions
    }

    /// Pins a frame, or moves its pin.
    pub fn move_pin(&mut self, pin: Pin) -> Result<(), PinError> {
        validate_pins(&[pin], self.pins.len())?;
        if self.pins[pin.frame].is_none() {
            (self.prepared, self.factor) = (None, None);
        }
        self.pins[pin.frame] = Some(pin.position);
        self.positions[pin.frame] = pin.position;
        Ok(())
    }

    /// Lets a frame go; nothing where it is not pinned.
    pub fn remove_pin(&mut self, frame: usize) {
        if let Some(pin) = self.pins.get_mut(frame).filter(|pin| pin.is_some()) {
            *pin = None;
            (self.prepared, self.factor) = (None, None);
        }
    }

    /// Minimises the stress (6) from the last layout, to a vanishing gradient, and says in how many steps. A step costs O(n^2), and O(n^3 / 3) more where
    /// a factor has to be made.
    pub fn solve(&mut self) -> Steps {
        let prepared = self.prepared.take().unwrap_or_else(|| self.prepare());
        let Prepared { order, problem } = &prepared;
        let mut steps = Steps::default();
        let layout = Places::of(order, &self.positions);
        match self.newton(problem, layout, &mut steps) {
            Some(layout) => layout.write(&order[..problem.free], &mut self.positions),
            None => {
                let more = minimise(problem, order, &mut self.positions);
                steps.majorising += more.majorising;
                steps.newton += more.newton;
                steps.inner += more.inner;
                self.factor = None;
            }
        }
        if steps.inner > OLD {
            self.factor = None;
        }
        self.prepared = Some(prepared);
        steps
    }

    fn prepare(&self) -> Prepared {
        let pinned: Vec<bool> = self.pins.iter().map(Option::is_some).collect();
        let (order, free) = free_first(&pinned);
        let problem = Problem::new(self.delta.permuted(&order), free);
        Prepared { order, problem }
    }

    /// Newton's method while every step lowers the stress; None where one does not.
    fn newton(
        &mut self,
        problem: &Problem,
        mut layout: Places,
        steps: &mut Steps,
    ) -> Option<Places> {
        let mut slope = problem.slope(&layout);
        for _ in 0..NEWTON_STEPS {
            let norm = norm_squared(&slope.gradient).sqrt();
            let relative = norm / problem.typical_gradient(&layout);
            if norm == 0.0 || relative <= VANISHED {
                return Some(layout);
            }
            if self.factor.is_none() {
                self.factor = Cholesky::new(hessian(problem, &layout));
            }
            let factor = self.factor.as_ref()?;
            // Steps are exact where convergence is quadratic, and only good where it is not yet.
            let target = norm * relative.clamp(1e-6, 0.05);
            let step = step(problem, &layout, &slope, factor, target, steps)?;
            steps.newton += 1;
            let next = layout.moved(&step);
            let next_slope = problem.slope(&next);
            let lower = next_slope.stress < slope.stress;
            let level = next_slope.stress <= slope.stress * (1.0 + 1e-12);
            let next_norm = norm_squared(&next_slope.gradient).sqrt();
            match (lower, level && next_norm < norm) {
                (false, false) if relative <= 100.0 * VANISHED => return Some(layout),
                (false, false) => return None,
                _ => (layout, slope) = (next, next_slope),
            }
        }
        None
    }
}

/// The Newton step, by preconditioned conjugate gradients; None at a direction of negative curvature or where the factor does not help.
fn step(
    problem: &Problem,
    layout: &Places,
    slope: &Slope,
    factor: &Cholesky,
    target: f64,
    steps: &mut Steps,
) -> Option<Vec<f64>> {
    let mut step = vec![0.0; slope.gradient.len()];
    let mut residual: Vec<f64> = slope.gradient.iter().map(|g| -g).collect();
    let mut z = residual.clone();
    factor.solve(&mut z);
    let mut direction = z.clone();
    let mut rho = dot(&residual, &z);
    for _ in 0..INNER_STEPS {
        steps.inner += 1;
        let product = problem.hessian_times(layout, &direction);
        let curvature = dot(&direction, &product);
        if curvature <= 0.0 || rho <= 0.0 {
            return None;
        }
        let length = rho / curvature;
        axpy(length, &direction, &mut step);
        axpy(-length, &product, &mut residual);
        if norm_squared(&residual).sqrt() <= target {
            return Some(step);
        }
        z.copy_from_slice(&residual);
        factor.solve(&mut z);
        let next = dot(&residual, &z);
        for (d, z) in direction.iter_mut().zip(&z) {
            *d = *d * (next / rho) + z;
        }
        rho = next;
    }
    None
}

/// The lower triangle of the Hessian of half the stress, shifted; all x before all y. O(n^2).
fn hessian(problem: &Problem, layout: &Places) -> Mat<f64> {
    let (n, f) = (problem.delta.len(), problem.free);
    let mut h = Mat::zeros(2 * f, 2 * f);
    for i in 0..f {
        let delta = problem.delta.row(i);
        let [px, py] = layout.point(i);
        let mut diagonal = [SHIFT * n as f64, 0.0, SHIFT * n as f64];
        for j in (0..n).filter(|&j| j != i) {
            let (ex, ey) = (px - layout.x[j], py - layout.y[j]);
            let q = ex * ex + ey * ey;
            let inverse = if q >= f64::MIN_POSITIVE { 1.0 / q } else { 0.0 };
            let ratio = delta[j] * inverse.sqrt();
            let (turned, along) = (1.0 - ratio, ratio * inverse);
            let k = [
                turned + along * ex * ex,
                along * ex * ey,
                turned + along * ey * ey,
            ];
            (0..3).for_each(|c| diagonal[c] += k[c]);
            if j < f {
                if j < i {
                    h[(i, j)] = -k[0];
                    h[(f + i, f + j)] = -k[2];
                }
                h[(f + i, j)] = -k[1];
            }
        }
        h[(i, i)] = diagonal[0];
        h[(f + i, i)] = diagonal[1];
        h[(f + i, f + i)] = diagonal[2];
    }
    h
}

#[cfg(test)]
mod tests {
    use super::super::mds::scale;
    use super::super::pins::principal_start;
    use super::super::stress::stress;
    use super::*;
    use proptest::prelude::*;

    fn sample(n: usize) -> Mat<f64> {
        Mat::from_fn(5, n, |a, i| {
            ((i + 1) as f64 * (a as f64 + 0.4) * 0.1).sin() / (a + 1) as f64
        })
    }

    fn scaling(n: usize, pinned: &[usize]) -> (Scaling, Dissimilarities) {
        let x = sample(n);
        let delta = Dissimilarities::new(x.as_ref());
        let free = scale(&delta, &principal_start(x.as_ref(), &[]), &[]);
        let pins: Vec<Pin> = pinned
            .iter()
            .map(|&frame| Pin {
                frame,
                position: free[frame],
            })
            .collect();
        (Scaling::new(delta.clone(), &free, &pins).unwrap(), delta)
    }

    #[test]
    fn pins_that_are_dragged_lead_along_minima() {
        for pinned in [&[3][..], &[3, 40], &[3, 40, 77]] {
            let (mut scaling, delta) = scaling(100, pinned);
            let start = scaling.positions()[3];
            for i in 0..30 {
                let angle = i as f64 * 0.2;
                let position = [
                    start[0] + 0.03 * i as f64 * angle.cos(),
                    start[1] + 0.2 * angle.sin(),
                ];
                let pin = Pin { frame: 3, position };
                scaling.move_pin(pin).unwrap();
                let before = scaling.positions().to_vec();
                let steps = scaling.solve();
                let found = scaling.positions().to_vec();
                assert_eq!(found[3], position);
                assert!(stress(&delta, &found) <= stress(&delta, &before) * (1.0 + 1e-12));
                // The long way, from the same layout, ends there too.
                let pins: Vec<Pin> = pinned
                    .iter()
                    .map(|&frame| Pin {
                        frame,
                        position: found[frame],
                    })
                    .collect();
                let again = scale(&delta, &found, &pins);
                let moved = found
                    .iter()
                    .zip(&again)
                    .map(|(a, b)| super::super::distance(*a, *b));
                assert!(moved.fold(0.0, f64::max) < 1e-9, "{i}: {steps:?}");
            }
        }
    }

    #[test]
    fn a_small_move_takes_few_steps() {
        let (mut scaling, _) = scaling(120, &[5, 60]);
        scaling.solve();
        let mut p = scaling.positions()[60];
        for _ in 0..5 {
            p[0] += 0.01;
            scaling
                .move_pin(Pin {
                    frame: 60,
                    position: p,
                })
                .unwrap();
            let steps = scaling.solve();
            assert!(steps.majorising == 0 && steps.newton <= 4, "{steps:?}");
        }
    }

    #[test]
    fn pins_come_and_go() {
        let (mut scaling, delta) = scaling(50, &[]);
        let free = stress(&delta, scaling.positions());
        let mut away = scaling.positions()[7];
        away[1] += 1.0;
        scaling
            .move_pin(Pin {
                frame: 7,
                position: away,
            })
            .unwrap();
        scaling
            .move_pin(Pin {
                frame: 9,
                position: [0.0, 0.0],
            })
            .unwrap();
        scaling.solve();
        assert!(stress(&delta, scaling.positions()) > free);
        scaling.remove_pin(7);
        scaling.remove_pin(9);
        scaling.remove_pin(1000);
        scaling.solve();
        assert!((stress(&delta, scaling.positions()) - free).abs() < 1e-9 * free);
        assert!(
            scaling
                .move_pin(Pin {
                    frame: 50,
                    position: [0.0; 2]
                })
                .is_err()
        );
        assert!(
            scaling
                .move_pin(Pin {
                    frame: 5,
                    position: [f64::NAN; 2]
                })
                .is_err()
        );
    }

    #[test]
    fn the_factored_hessian_is_the_one_that_is_multiplied_with() {
        let (scaling, _) = scaling(20, &[2, 11, 12]);
        let Prepared { order, problem } = scaling.prepare();
        let layout = Places::of(&order, scaling.positions());
        let h = hessian(&problem, &layout);
        let size = 2 * problem.free;
        for c in 0..size {
            let mut unit = vec![0.0; size];
            unit[c] = 1.0;
            let product = problem.hessian_times(&layout, &unit);
            for r in 0..size {
                let entry = h[(r.max(c), r.min(c))];
                assert!((entry - product[r]).abs() < 1e-6, "({r}, {c})");
            }
        }
    }

    proptest! {
        /// Wherever pins go, points stay finite and the gradient vanishes or the stress has not risen.
        #[test]
        fn any_pins(moves in prop::collection::vec((0usize..12, -9.0f64..9.0, -9.0f64..9.0), 1..12)) {
            let (mut scaling, delta) = scaling(12, &[]);
            for (frame, x, y) in moves {
                scaling.move_pin(Pin { frame, position: [x, y] }).unwrap();
                let before = stress(&delta, scaling.positions());
                scaling.solve();
                prop_assert!(scaling.positions().iter().flatten().all(|v| v.is_finite()));
                prop_assert!(stress(&delta, scaling.positions()) <= before * (1.0 + 1e-12));
            }
        }
    }
}
