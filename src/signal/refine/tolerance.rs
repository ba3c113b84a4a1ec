//! k, l and m from a tolerance (section 3.4) where the fit is refined: fewer numbers do.

use std::time::Instant;

use faer::MatRef;

use super::rows::Rows;
use super::{RefineOptions, Refinement, minimise_until, refine_within};
use crate::signal::fidelity::{Whole, check, choose, leading, least, least_m};
use crate::signal::fit::{Attempt, Base, Fit, FitError, error_h, timed};
use crate::signal::h::ShapeSignal;
use crate::signal::knots::KnotRule;
use crate::signal::layout::Layout;
use crate::signal::pins::Pin;

/// The share of the allowed error (2) that h alone may leave.
const SHARE: f64 = 0.95;
/// Dimensions tried, from the least on: one more costs d numbers.
const DIMENSIONS: usize = 2;
/// The most steps, and the least gain of a step, while choosing.
const SEARCH: (usize, f64) = (25, 3e-3);

/// The representation with the fewest stored numbers, of those tried, whose error (2) is at most `most` once refined, in squared units of the
/// frames.
///
/// The least m whose (3) is within the error, and the next; for each the least l by bisection with as many control points as the parameters allow,
/// then the least k by bisection, both with short refinements. The choice is then refined in full, and kept short where that would raise (2) above
/// `most`, which frames between frames can do. What `fit_to_error` finds is the answer where it stores less.
pub fn fit_to_error_refined(
    frames: MatRef<'_, f64>,
    most: f64,
    rule: KnotRule,
    layout: Layout,
    pins: &[Pin],
    options: &RefineOptions,
) -> Result<(Fit, Refinement), FitError> {
    check(frames, most, layout, pins)?;
    let whole = Whole::new(frames)?;
    choose_refined(&whole, most, rule, layout, pins, options)
}

/// [`fit_to_error_refined`], given the shape signal of all dimensions.
pub(in crate::signal) fn choose_refined(
    whole: &Whole,
    most: f64,
    rule: KnotRule,
    layout: Layout,
    pins: &[Pin],
    options: &RefineOptions,
) -> Result<(Fit, Refinement), FitError> {
    let start = Instant::now();
    let staged = choose(whole, most, rule, layout, pins)?;
    let Whole {
        frames,
        shape: whole,
        time: h_time,
    } = whole;
    let (frames, h_time) = (*frames, *h_time);
    let least = least_m(whole, SHARE * most);
    let mut best = (staged.representation.stored_numbers(), staged);
    let mut found = None;
    for m in least..(least + DIMENSIONS).min(whole.basis.ncols() + 1) {
        let shape = leading(whole, m);
        let error = error_h(frames, &shape);
        let mut base = Base::from_shape(shape, error, h_time, layout, pins)?;
        base.settle(rule)?;
        let search = Search {
            base,
            whole,
            most,
            rule,
            options: RefineOptions {
                iterations: SEARCH.0,
                tolerance: SEARCH.1,
                ..*options
            },
        };
        let Some(attempt) = search.fewest()? else {
            continue;
        };
        let short = search.options;
        let fit = search.base.finish(attempt);
        let numbers = fit.representation.stored_numbers();
        if numbers < best.0 {
            best = (numbers, fit);
            found = Some(short);
        }
    }
    let (fit, short) = (best.1, found.unwrap_or(*options));
    let (refined, told) = refine_within(whole, fit.clone(), options, 0.0);
    let (refined, mut told) = match told.after <= most {
        true => (refined, told),
        false => refine_within(whole, fit, &short, most),
    };
    told.elapsed = h_time + start.elapsed();
    Ok((refined, told))
}

/// The search for l and k at one m.
struct Search<'a> {
    base: Base,
    whole: &'a ShapeSignal,
    most: f64,
    rule: KnotRule,
    options: RefineOptions,
}

impl Search<'_> {
    /// Of the greatest k the least l, and then the least k; None where no l will do.
    fn fewest(&self) -> Result<Option<Attempt>, FitError> {
        let (order, searching) = timed(|| self.base.order(usize::MAX));
        let order = order?;
        let most_k = self.base.most_control_points();
        let with = |k: usize, l: usize| self.attempt(k, &order.order[..l]);
        let fewest_sites = order.order.len().min(3);
        let Some((l, _)) = least(fewest_sites, order.order.len(), |l| with(most_k, l))? else {
            return Ok(None);
        };
        let found = least(4, most_k, |k| with(k, l))?;
        Ok(found.map(|(_, attempt)| attempt.searched(&order, l, searching)))
    }

    /// The signals as section 3 finds them, where refining takes them below the error.
    fn attempt(&self, k: usize, sites: &[usize]) -> Result<Option<Attempt>, FitError> {
        let attempt = self.base.signals(k, sites, self.rule)?;
        if attempt.errors.psi <= self.most {
            return Ok(Some(attempt));
        }
        let (x, t) = (self.whole.coordinates.as_ref(), self.base.parameters());
        let rows = Rows::of_frames(x, t, self.options.between);
        let (spline, sites) = (&attempt.spline, &attempt.pose.sites);
        let m = self.base.dimension();
        let refined = minimise_until(&rows, spline, sites, m, &self.options, self.most);
        let after = refined.map(|found| found.signals.error(&Rows::of_frames(x, t, 0.0)));
        Ok(after
            .is_some_and(|error| error <= self.most)
            .then_some(attempt))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::fidelity::fit_to_error;
    use faer::Mat;

    #[test]
    fn the_error_is_met_with_fewer_numbers_than_section_3_needs() {
        let z = Mat::from_fn(60, 30, |a, i| {
            let t = i as f64 * 0.4;
            ((a % 7 + 1) as f64 * 0.3 * t).sin() + (0.1 * a as f64 * t).cos()
        });
        let options = RefineOptions::default();
        for share in [1e-3, 1e-2, 0.1] {
            let most = share * z.squared_norm_l2();
            let rule = KnotRule::Symmetric;
            let staged = fit_to_error(z.as_ref(), most, rule, Layout::Mds, &[]).unwrap();
            let (fit, told) =
                fit_to_error_refined(z.as_ref(), most, rule, Layout::Mds, &[], &options).unwrap();
            assert!(fit.errors.psi <= most && told.after <= most, "{share}");
            let numbers = |fit: &Fit| fit.representation.stored_numbers();
            assert!(
                numbers(&fit) < numbers(&staged),
                "{share}: {:?} {:?}",
                fit.klm(),
                staged.klm()
            );
        }
        assert!(
            fit_to_error_refined(
                z.as_ref(),
                -1.0,
                KnotRule::Literal,
                Layout::Mds,
                &[],
                &options
            )
            .is_err()
        );
    }
}
