//! k, l and m from a tolerance (section 3.4).

use std::time::{Duration, Instant};

use faer::MatRef;

use super::fit::{Attempt, Base, FEWEST_FRAMES, Fit, FitError, check_magnitude, error_h, timed};
use super::h::{ShapeSignal, shape_signal};
use super::knots::KnotRule;
use super::layout::Layout;
use super::pins::{Pin, validate_pins};

/// Shares of the allowed error (2) that the shape signal may take, and of what then remains the pose signal; all pairs are tried.
const SHARES: [f64; 5] = [0.15, 0.3, 0.45, 0.6, 0.75];

/// The representation with the fewest stored numbers, of those tried, whose error (2) is at most `most`, in squared units of the frames.
///
/// For each share of the error given to h the least m is taken, for each share given to g the least l of the greedy order, and the least k by
/// bisection. Of a layout's weights the one whose interpolating signals have the best in-betweens is taken, for each m. One singular value
/// decomposition serves every m. The interpolating representation, whose error is rounding, is the last resort.
pub fn fit_to_error(
    frames: MatRef<'_, f64>,
    most: f64,
    rule: KnotRule,
    layout: Layout,
    pins: &[Pin],
) -> Result<Fit, FitError> {
    check(frames, most, layout, pins)?;
    choose(&Whole::new(frames)?, most, rule, layout, pins)
}

/// Frames (d x n) with their shape signal of all dimensions, and the time it took.
pub(super) struct Whole<'a> {
    pub frames: MatRef<'a, f64>,
    pub shape: ShapeSignal,
    pub time: Duration,
}

impl<'a> Whole<'a> {
    /// Of at least one frame.
    pub fn new(frames: MatRef<'a, f64>) -> Result<Self, FitError> {
        let start = Instant::now();
        let shape = shape_signal(frames, frames.ncols() - 1)?;
        Ok(Self {
            frames,
            shape,
            time: start.elapsed(),
        })
    }
}

pub(super) fn check(
    frames: MatRef<'_, f64>,
    most: f64,
    layout: Layout,
    pins: &[Pin],
) -> Result<(), FitError> {
    let n = frames.ncols();
    if n < FEWEST_FRAMES {
        return Err(FitError::TooFewFrames { found: n });
    }
    if most.is_nan() || most <= 0.0 {
        return Err(FitError::BadTolerance { value: most });
    }
    check_magnitude(frames)?;
    layout.check()?;
    Ok(validate_pins(pins, n)?)
}

/// [`fit_to_error`], given the shape signal of all dimensions.
pub(super) fn choose(
    whole: &Whole,
    most: f64,
    rule: KnotRule,
    layout: Layout,
    pins: &[Pin],
) -> Result<Fit, FitError> {
    let Whole {
        frames,
        shape: whole,
        time: h_time,
    } = whole;
    let (frames, h_time) = (*frames, *h_time);
    let mut dimensions: Vec<usize> = SHARES
        .iter()
        .map(|share| least_m(whole, share * most))
        .collect();
    dimensions.dedup();
    let mut best: Option<(usize, Fit)> = None;
    for m in dimensions.into_iter().rev() {
        let shape = leading(whole, m);
        let error = error_h(frames, &shape);
        let mut base = Base::from_shape(shape, error, h_time, layout, pins)?;
        base.settle(rule)?;
        if let Some(attempt) = least_l_and_k(&base, error, most, rule)? {
            let fit = base.finish(attempt);
            let numbers = fit.representation.stored_numbers();
            if best.as_ref().is_none_or(|(least, _)| numbers < *least) {
                best = Some((numbers, fit));
            }
        }
    }
    match best {
        Some((_, fit)) => Ok(fit),
        None => {
            let n = frames.ncols();
            let error = error_h(frames, whole);
            Base::from_shape(whole.clone(), error, h_time, layout, pins)?.fit(n + 2, n, rule)
        }
    }
}

/// The least m whose discarded singular values leave at most this error (3).
pub(super) fn least_m(shape: &ShapeSignal, most: f64) -> usize {
    let rank = shape.basis.ncols();
    let mut left = 0.0;
    for m in (0..rank).rev() {
        left += shape.singular_values[m].powi(2);
        if left > most {
            return m + 1;
        }
    }
    0
}

/// The first m dimensions of a shape signal.
pub(super) fn leading(shape: &ShapeSignal, m: usize) -> ShapeSignal {
    ShapeSignal {
        offset: shape.offset.clone(),
        basis: shape.basis.get(.., ..m).to_owned(),
        coordinates: shape.coordinates.get(..m, ..).to_owned(),
        singular_values: shape.singular_values.clone(),
    }
}

/// Of the pairs (l, k) within the error, the one of fewest numbers: a site costs m + 2 of them, a control point 3.
fn least_l_and_k(
    base: &Base,
    error_h: f64,
    most: f64,
    rule: KnotRule,
) -> Result<Option<Attempt>, FitError> {
    let (order, searching) = timed(|| base.order(usize::MAX));
    let order = order?;
    let mut best: Option<(usize, Attempt)> = None;
    let mut tried = 0;
    for share in SHARES {
        let allowed = share * (most - error_h);
        let found = order.errors.iter().position(|&e| e <= allowed);
        let l = found.map_or(order.order.len(), |at| (at + 3).min(order.order.len()));
        if l == tried {
            continue;
        }
        tried = l;
        if let Some((k, attempt)) = least_k(base, &order.order[..l], most, rule)? {
            let numbers = l * (base.dimension() + 2) + 3 * k;
            if best.as_ref().is_none_or(|(least, _)| numbers < *least) {
                best = Some((numbers, attempt.searched(&order, l, searching)));
            }
        }
    }
    Ok(best.map(|(_, attempt)| attempt))
}

/// The least k by bisection; (2) does not quite fall with k, so the answer is a k that holds whose half-way neighbours below did not.
fn least_k(
    base: &Base,
    sites: &[usize],
    most: f64,
    rule: KnotRule,
) -> Result<Option<(usize, Attempt)>, FitError> {
    least(4, base.most_control_points(), |k| {
        let attempt = base.signals(k, sites, rule)?;
        Ok((attempt.errors.psi <= most).then_some(attempt))
    })
}

/// The least number from `low` to `high` that will do, and what it gives, by bisection; None where `high` will not.
pub(super) fn least<T>(
    mut low: usize,
    mut high: usize,
    try_with: impl Fn(usize) -> Result<Option<T>, FitError>,
) -> Result<Option<(usize, T)>, FitError> {
    let Some(mut best) = try_with(high)? else {
        return Ok(None);
    };
    while low < high {
        let middle = (low + high) / 2;
        match try_with(middle)? {
            Some(found) => (high, best) = (middle, found),
            None => low = middle + 1,
        }
    }
    Ok(Some((high, best)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::Mat;

    #[test]
    fn the_error_is_met_and_a_looser_one_stores_less() {
        let z = Mat::from_fn(60, 30, |a, i| {
            let t = i as f64 * 0.4;
            ((a % 7 + 1) as f64 * 0.3 * t).sin() + (0.1 * a as f64 * t).cos()
        });
        let mut last = usize::MAX;
        for share in [1e-12, 1e-4, 1e-2, 0.3] {
            let most = share * z.squared_norm_l2();
            let fit =
                fit_to_error(z.as_ref(), most, KnotRule::Symmetric, Layout::Mds, &[]).unwrap();
            assert!(fit.errors.psi <= most, "{share}: {:?}", fit.errors);
            let numbers = fit.representation.stored_numbers();
            assert!(numbers <= last);
            last = numbers;
        }
        assert!(fit_to_error(z.as_ref(), f64::NAN, KnotRule::Literal, Layout::Mds, &[]).is_err());
    }
}
