//! Products of several vectors with several: as many sums at a time as there are registers for, each in the order of the entries.

use std::borrow::Borrow;
use std::ops::Range;

use super::entry::{Eight, Entry};
use super::kernels::{LANES, fused, has_avx512, one_at_a_time};

fused! {
    /// sums_p += sum_i w_ip x_i over the entries of P vectors w, a multiple of four, and L vectors x, in order, each product fused with the sum: W^T X.
    pub fn gather[W: Borrow<[f64; P]>, const P: usize, const L: usize](w: &[W], x: &[Entry<L>], sums: &mut [Entry<L>; P]) {
        in_tiles(|w, x, sum| w.mul_add(x, sum), w, x, sums);
    }
}

fused! {
    /// The products W^T X of eight vectors w and L vectors x, of which there are as many as places, into these places of a slice for each w.
    pub fn write_products[const L: usize](w: &[Eight], x: &[Entry<L>], places: Range<usize>, into: &mut [&mut [f64]]) {
        let mut sums = [Entry::ZERO; LANES];
        in_tiles(|w, x, sum| w.mul_add(x, sum), w, x, &mut sums);
        for (sum, into) in sums.iter().zip(into) {
            write(&mut into[places.clone()], sum);
        }
    }
}

fused! {
    /// sums_p -= sum_i w_ip x_i, as [`gather`] adds it.
    pub fn subtract_gathered[W: Borrow<[f64; P]>, const P: usize, const L: usize](w: &[W], x: &[Entry<L>], sums: &mut [Entry<L>; P]) {
        in_tiles(|w, x, sum| (-w).mul_add(x, sum), w, x, sums);
    }
}

/// All sums, as many at a time as there are registers for: AVX-512 has 32 of eight numbers, AVX2 16 of four.
#[inline(always)]
fn in_tiles<W: Borrow<[f64; P]>, const P: usize, const L: usize>(
    add: impl Fn(f64, f64, f64) -> f64,
    w: &[W],
    x: &[Entry<L>],
    sums: &mut [Entry<L>; P],
) {
    const { assert!(P.is_multiple_of(4) && L.is_multiple_of(8)) };
    let (many, sixteens) = (has_avx512(), L.is_multiple_of(16));
    if many && sixteens && P.is_multiple_of(8) {
        for p in (0..P).step_by(8) {
            for lane in (0..L).step_by(16) {
                two_tiles::<_, P, L>(&add, w, x, sums, [p, lane]);
            }
        }
    } else if many && sixteens {
        tiles::<_, P, L, 4, 16>(add, w, x, sums);
    } else if many && P.is_multiple_of(8) {
        tiles::<_, P, L, 8, 8>(add, w, x, sums);
    } else {
        tiles::<_, P, L, 4, 8>(add, w, x, sums);
    }
}

/// All sums, those for Q vectors w and T vectors x at a time.
#[inline(always)]
fn tiles<W: Borrow<[f64; P]>, const P: usize, const L: usize, const Q: usize, const T: usize>(
    add: impl Fn(f64, f64, f64) -> f64,
    w: &[W],
    x: &[Entry<L>],
    sums: &mut [Entry<L>; P],
) {
    for p in (0..P).step_by(Q) {
        for lane in (0..L).step_by(T) {
            let mut own: [[f64; T]; Q] = own(sums, [p, lane]);
            for (w, x) in w.iter().zip(x) {
                add_to(&mut own, &w.borrow()[p..p + Q], &x[lane..lane + T], &add);
            }
            keep(&own, sums, [p, lane]);
        }
    }
}

/// Two tiles of four by sixteen in one pass over x: as one, their loop would be too long for the compiler to unroll, and they would not stay in registers.
#[inline(always)]
fn two_tiles<W: Borrow<[f64; P]>, const P: usize, const L: usize>(
    add: impl Fn(f64, f64, f64) -> f64,
    w: &[W],
    x: &[Entry<L>],
    sums: &mut [Entry<L>; P],
    [p, lane]: [usize; 2],
) {
    let mut first: [[f64; 16]; 4] = own(sums, [p, lane]);
    let mut second: [[f64; 16]; 4] = own(sums, [p + 4, lane]);
    for (w, x) in w.iter().zip(x) {
        let (w, x) = (w.borrow(), &x[lane..lane + 16]);
        add_to(&mut first, &w[p..p + 4], x, &add);
        add_to(&mut second, &w[p + 4..p + 8], x, &add);
    }
    keep(&first, sums, [p, lane]);
    keep(&second, sums, [p + 4, lane]);
}

/// A copy of some sums, so that they stay in registers.
#[inline(always)]
fn own<const P: usize, const L: usize, const Q: usize, const T: usize>(
    sums: &[Entry<L>; P],
    [p, lane]: [usize; 2],
) -> [[f64; T]; Q] {
    std::array::from_fn(|i| std::array::from_fn(|j| sums[p + i][lane + j]))
}

/// Puts a copy back.
#[inline(always)]
fn keep<const P: usize, const L: usize, const Q: usize, const T: usize>(
    own: &[[f64; T]; Q],
    sums: &mut [Entry<L>; P],
    [p, lane]: [usize; 2],
) {
    for (sums, own) in sums[p..].iter_mut().zip(own) {
        sums[lane..lane + T].copy_from_slice(own);
    }
}

/// The products of one entry.
#[inline(always)]
fn add_to<const Q: usize, const T: usize>(
    own: &mut [[f64; T]; Q],
    w: &[f64],
    x: &[f64],
    add: impl Fn(f64, f64, f64) -> f64,
) {
    for (sums, w) in own.iter_mut().zip(w) {
        for (sum, x) in sums.iter_mut().zip(x) {
            *sum = add(*w, *x, *sum);
        }
    }
}

fused! {
    /// x_i -= sum_p w_ip y_p over the entries of P vectors w and L vectors x, in order, each product fused with the sum: X - W Y.
    pub fn subtract_spread[W: Borrow<[f64; P]>, const P: usize, const L: usize](w: &[W], y: &[Entry<L>; P], x: &mut [Entry<L>]) {
        let y = *y;
        for (w, x) in w.iter().zip(x) {
            one_at_a_time();
            for (w, y) in w.borrow().iter().zip(&y) {
                for lane in 0..L {
                    x[lane] = (-w).mul_add(y[lane], x[lane]);
                }
            }
        }
    }
}

/// Writes up to L numbers.
#[inline(always)]
fn write<const L: usize>(into: &mut [f64], numbers: &[f64; L]) {
    match into.as_mut_array() {
        Some(whole) => *whole = *numbers,
        None => into.copy_from_slice(&numbers[..into.len()]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_subtracted_is_the_product() {
        let entry = |i: usize, p: usize| ((5 * i + 3 * p) as f64).sin();
        let w: Vec<Eight> = (0..11)
            .map(|i| Entry(std::array::from_fn(|p| entry(i, p))))
            .collect();
        let y = std::array::from_fn(|p| Entry(std::array::from_fn(|lane| entry(p, lane + 40))));
        let mut x = vec![Entry([1.0; LANES]); 11];
        subtract_spread(&w, &y, &mut x);
        for (i, x) in x.iter().enumerate() {
            for (lane, x) in x.iter().enumerate() {
                let sum: f64 = (0..LANES).map(|p| w[i][p] * y[p][lane]).sum();
                assert!((1.0 - x - sum).abs() < 1e-14);
            }
        }
        let (mut added, mut subtracted) = ([Entry::ZERO; LANES], [Entry::ZERO; LANES]);
        gather(&w, &x, &mut added);
        subtract_gathered(&w, &x, &mut subtracted);
        assert_eq!(added, subtracted.map(|sums| Entry(sums.map(|x| -x))));
    }

    /// One after the other, whatever the tiles.
    fn sums_are_in_order<const P: usize, const L: usize>() {
        let entry = |i: usize, p: usize| ((7 * i + 3 * p) as f64).sin();
        let w: Vec<[f64; P]> = (0..13)
            .map(|i| std::array::from_fn(|p| entry(i, p)))
            .collect();
        let x: Vec<Entry<L>> = (0..13)
            .map(|i| Entry(std::array::from_fn(|lane| entry(i, lane + 50))))
            .collect();
        let given = std::array::from_fn(|p| Entry(std::array::from_fn(|lane| entry(p, lane))));
        let (mut added, mut subtracted) = (given, given);
        gather(&w, &x, &mut added);
        subtract_gathered(&w, &x, &mut subtracted);
        for p in 0..P {
            for lane in 0..L {
                let products = w.iter().zip(&x).map(|(w, x)| (w[p], x[lane]));
                let [mut plus, mut minus] = [given[p][lane]; 2];
                products.for_each(|(w, x)| {
                    plus = w.mul_add(x, plus);
                    minus = (-w).mul_add(x, minus);
                });
                assert_eq!([added[p][lane], subtracted[p][lane]], [plus, minus]);
            }
        }
    }

    #[test]
    fn sums_of_every_shape_are_in_order() {
        sums_are_in_order::<4, 8>();
        sums_are_in_order::<8, 8>();
        sums_are_in_order::<4, 16>();
        sums_are_in_order::<8, 16>();
        sums_are_in_order::<12, 24>();
    }
}
