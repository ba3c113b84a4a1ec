//! Newton's way down to a frame where E is stationary, damped after Nielsen 1999.

use super::system::{Second, System};
use super::{Shell, Target};
use crate::linalg::kernels::dot;
use crate::linalg::sparse::{Factor, FactorError, Pattern};
use crate::mesh::vector::Point;
use crate::shape::ShapeError;
use crate::shape::reference::check;

/// The most factorisations.
const FACTORISATIONS: usize = 100;
/// See [`weight`].
const LEAST_WEIGHT: f64 = 1e-6;
/// The damping to start with, and the least.
const DAMPING: f64 = 1e-6;
const LEAST_DAMPING: f64 = 1e-12;
/// The damping at which a descent has no step left to take, as where E falls towards a triangle without height, at which its angles jump.
const MOST_DAMPING: f64 = 1e4;
/// Differences of so much, root mean square, are rounding.
const ROUNDING: f64 = 1e-12;
/// A step taken lowers E by at least this share of what was predicted.
const GAIN: f64 = 1e-4;
/// E cannot tell steps that lower it by less than this share of itself.
const UNTOLD: f64 = 1e-14;
/// The imbalance at which a descent ends, see [`Descent`]; the last step, which E cannot tell, may leave so many times more.
const STATIONARY: f64 = 1e-9;
const TOLD: f64 = 1e3;

/// How a descent ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descent {
    /// E.
    pub energy: f64,
    /// The greatest cosine between the differences and their derivatives by one coordinate: 0 at a stationary frame, and where all differences are rounding.
    pub imbalance: f64,
    /// Sparse factorisations made.
    pub factorisations: usize,
}

impl Descent {
    /// Whether the frame is a stationary one of E, as nearly as rounding lets tell.
    pub fn is_stationary(&self) -> bool {
        self.imbalance <= TOLD * STATIONARY
    }
}

#[derive(Debug, Default)]
pub(super) struct Work {
    /// Of edges, of hinges, then of triangles.
    differences: Vec<f64>,
    trial: Vec<Point>,
    trial_differences: Vec<f64>,
    system: System,
    solver: Solver,
    step: Vec<f64>,
}

#[derive(Debug, Default)]
struct Solver {
    values: Vec<f64>,
    factor: Option<Factor>,
    scratch: Vec<[f64; 1]>,
}

/// How far the second derivatives are believed.
struct Trust {
    damping: f64,
    growth: f64,
}

/// What became of the steps tried from one frame.
enum Advance {
    Taken,
    /// E cannot tell further steps.
    Last,
    /// No step lowers E.
    Stuck,
}

impl Shell {
    /// Descends from `x` towards the target. O(V) a step beside the factorisation.
    pub fn descend(&self, target: &Target, x: &mut [Point]) -> Result<Descent, ShapeError> {
        self.work.lend(|work| self.descend_with(work, target, x))
    }

    fn descend_with(
        &self,
        work: &mut Work,
        target: &Target,
        x: &mut [Point],
    ) -> Result<Descent, ShapeError> {
        let mut found = Descent {
            energy: self.differences(target, x, &mut work.differences),
            imbalance: 0.0,
            factorisations: 0,
        };
        check("frame decoded", x.as_flattened(), 3 * self.vertices)?;
        if !found.energy.is_finite() {
            // A triangle that should have an area has none: there is no way down from here.
            found.imbalance = f64::INFINITY;
            return Ok(found);
        }
        let rounding = ROUNDING * ROUNDING * work.differences.len() as f64;
        let mut trust = Trust {
            damping: DAMPING,
            growth: 2.0,
        };
        while found.energy > rounding {
            self.assemble(x, &work.differences, Second::Newton, &mut work.system);
            found.imbalance = work.system.imbalance(found.energy);
            if found.imbalance <= STATIONARY {
                return Ok(found);
            }
            match self.advance(work, target, x, &mut trust, &mut found)? {
                Advance::Taken => {}
                Advance::Stuck => return Ok(found),
                Advance::Last => {
                    self.assemble(x, &work.differences, Second::GaussNewton, &mut work.system);
                    found.imbalance = work.system.imbalance(found.energy);
                    return Ok(found);
                }
            }
        }
        found.imbalance = 0.0;
        Ok(found)
    }

    /// Tries steps from `x`, each damped more than the one before it, until one is taken.
    fn advance(
        &self,
        work: &mut Work,
        target: &Target,
        x: &mut [Point],
        trust: &mut Trust,
        found: &mut Descent,
    ) -> Result<Advance, ShapeError> {
        let mut second = Second::Newton;
        while found.factorisations < FACTORISATIONS && trust.damping <= MOST_DAMPING {
            found.factorisations += 1;
            let solved =
                (work.solver).solve(&self.pattern, &work.system, trust.damping, &mut work.step);
            match (solved, second) {
                (Ok(()), _) => {}
                (Err(FactorError::NotPositiveDefinite { .. }), Second::Newton) => {
                    second = Second::GaussNewton;
                    self.assemble(x, &work.differences, second, &mut work.system);
                    continue;
                }
                (Err(FactorError::NotPositiveDefinite { .. }), Second::GaussNewton) => {
                    return Ok(Advance::Stuck);
                }
                (Err(error), _) => return Err(error.into()),
            }
            work.trial.clear();
            work.trial.extend_from_slice(x);
            let moved = work.trial.as_flattened_mut().iter_mut();
            moved.zip(&work.step).for_each(|(x, step)| *x += step);
            let energy = self.differences(target, &work.trial, &mut work.trial_differences);
            let predicted = work.system.predicted(&work.step, trust.damping);
            let gain = (found.energy - energy) / predicted;
            let last = predicted <= UNTOLD * found.energy;
            let taken = gain > GAIN || last && energy <= found.energy * (1.0 + UNTOLD);
            if taken {
                x.copy_from_slice(&work.trial);
                std::mem::swap(&mut work.differences, &mut work.trial_differences);
                found.energy = energy;
                trust.rise(gain);
            }
            match (last, taken) {
                (true, _) => return Ok(Advance::Last),
                (false, true) => return Ok(Advance::Taken),
                (false, false) => trust.fall(),
            }
        }
        Ok(Advance::Stuck)
    }
}

impl Trust {
    /// After a step that lowered E by this share of what was predicted.
    fn rise(&mut self, gain: f64) {
        let shrink = (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(0.1, 2.0);
        self.damping = (self.damping * shrink).max(LEAST_DAMPING);
        self.growth = 2.0;
    }

    fn fall(&mut self) {
        self.damping *= self.growth;
        self.growth *= 2.0;
    }
}

impl System {
    /// How much lower E should be after a step with this damping.
    fn predicted(&self, step: &[f64], damping: f64) -> f64 {
        let slope = dot(self.gradient.as_flattened(), step);
        let held = self.squares.as_flattened().iter().zip(step);
        let square: f64 = held.map(|(s, step)| weight(*s) * step * step).sum();
        damping * square - slope
    }
}

impl Solver {
    /// (H + damping D) step = -J^T r.
    fn solve(
        &mut self,
        pattern: &Pattern,
        system: &System,
        damping: f64,
        step: &mut Vec<f64>,
    ) -> Result<(), FactorError> {
        let (diagonal, others) = system.blocks.split_at(system.squares.len());
        let values = &mut self.values;
        values.clear();
        for (block, squares) in diagonal.iter().zip(&system.squares) {
            values.extend(LOWER.map(|[r, c]| {
                let held = if r == c {
                    damping * weight(squares[r])
                } else {
                    0.0
                };
                block[r][c] + held
            }));
        }
        values.extend(others.iter().flat_map(|block| block.as_flattened()));
        match &mut self.factor {
            Some(factor) => factor.refactor(values)?,
            none => *none = Some(pattern.factor(values)?),
        }
        step.clear();
        step.extend(system.gradient.as_flattened().iter().map(|x| -x));
        if let Some(factor) = &self.factor {
            factor.solve1(step, &mut self.scratch);
        }
        Ok(())
    }
}

/// Rows and columns of the lower triangle of a block.
pub(super) const LOWER: [[usize; 2]; 6] = [[0, 0], [1, 0], [1, 1], [2, 0], [2, 1], [2, 2]];

/// How much damping holds a coordinate beside another: as much as E does (Marquardt 1963), and a little where E does not.
fn weight(square: f64) -> f64 {
    square + LEAST_WEIGHT
}
