//! On which side points are, decided exactly for all finite coordinates.
//!
//! Shewchuk's adaptive predicates (1997; the crate `robust`) are exact as long as no product overflows or underflows. Where coordinates are too great
//! or too small for that, the determinant is summed in whole numbers.

use std::cmp::Ordering;
use std::ops::RangeInclusive;

use robust::{Coord, Coord3D, orient2d, orient3d};

use super::vector::Point;

/// Magnitudes, beside 0, for which Shewchuk proves his predicates exact: exponents from -142 to 201.
const PROVEN: RangeInclusive<f64> = 1.8e-43..=3.2e60;

/// The sign of det[a-c b-c]: whether a, b, c turn counter-clockwise (`Greater`), clockwise, or are in a line (`Equal`).
pub(super) fn side_of_line(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> Ordering {
    if [a, b, c].as_flattened().iter().all(proven) {
        let [a, b, c] = [a, b, c].map(|[x, y]| Coord { x, y });
        return sign(orient2d(a, b, c));
    }
    let mut sum = Sum::new();
    for (p, q) in [(a, b), (b, c), (c, a)] {
        sum.add([p[0], q[1], 1.0]);
        sum.add([-p[1], q[0], 1.0]);
    }
    sum.sign()
}

/// The sign of det[a-d b-d c-d]: on which side of the plane of a, b, c the point d is; `Equal` where the four are in a plane.
pub(super) fn side_of_plane(a: Point, b: Point, c: Point, d: Point) -> Ordering {
    if [a, b, c, d].as_flattened().iter().all(proven) {
        let [a, b, c, d] = [a, b, c, d].map(|[x, y, z]| Coord3D { x, y, z });
        return sign(orient3d(a, b, c, d));
    }
    let mut sum = Sum::new();
    for [p, q, r] in [[a, b, c], [b, d, c], [a, c, d], [b, a, d]] {
        for [x, y, z] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
            sum.add([p[x], q[y], r[z]]);
            sum.add([-p[x], q[z], r[y]]);
        }
    }
    sum.sign()
}

fn proven(x: &f64) -> bool {
    let size = x.abs();
    size == 0.0 || PROVEN.contains(&size)
}

fn sign(determinant: f64) -> Ordering {
    determinant.partial_cmp(&0.0).unwrap_or(Ordering::Equal)
}

/// Bits of a limb.
const LIMB: usize = 32;
/// The least bit of a product of three doubles is 2^-3222, the greatest below 2^3072.
const LEAST: i32 = -3 * 1074;
const LIMBS: usize = (3222 + 3072) / LIMB + 4;

/// A sum of products of three doubles without rounding: limb i counts units of 2^(`LEAST` + 32 i).
struct Sum([i64; LIMBS]);

impl Sum {
    fn new() -> Self {
        Self([0; LIMBS])
    }

    /// Adds the product. Up to 2^28 of them fit.
    fn add(&mut self, factors: [f64; 3]) {
        let [a, b, c] = factors.map(decode);
        let at = (a.exponent + b.exponent + c.exponent - LEAST) as usize;
        let negative = a.negative ^ b.negative ^ c.negative;
        let pair = u128::from(a.mantissa) * u128::from(b.mantissa);
        for i in 0..4 {
            let part = (pair >> (LIMB * i)) as u32;
            for j in 0..2 {
                let other = (c.mantissa >> (LIMB * j)) as u32;
                self.add_at(
                    at + LIMB * (i + j),
                    u64::from(part) * u64::from(other),
                    negative,
                );
            }
        }
    }

    fn add_at(&mut self, bit: usize, number: u64, negative: bool) {
        if number == 0 {
            return;
        }
        let shifted = u128::from(number) << (bit % LIMB);
        for i in 0..3 {
            let limb = i64::from((shifted >> (LIMB * i)) as u32);
            self.0[bit / LIMB + i] += if negative { -limb } else { limb };
        }
    }

    fn sign(mut self) -> Ordering {
        let mut carry = 0;
        for limb in &mut self.0 {
            let whole = *limb + carry;
            (*limb, carry) = (whole & 0xffff_ffff, whole >> LIMB);
        }
        match carry.cmp(&0) {
            Ordering::Equal if self.0.iter().any(|&limb| limb != 0) => Ordering::Greater,
            sign => sign,
        }
    }
}

/// mantissa 2^exponent.
struct Decoded {
    negative: bool,
    mantissa: u64,
    exponent: i32,
}

fn decode(x: f64) -> Decoded {
    let bits = x.to_bits();
    let (biased, fraction) = ((bits >> 52 & 0x7ff) as i32, bits & ((1 << 52) - 1));
    Decoded {
        negative: x.is_sign_negative(),
        mantissa: if biased == 0 {
            fraction
        } else {
            fraction | 1 << 52
        },
        exponent: biased.max(1) - 1075,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Scaled by a power of two out of the range that Shewchuk proves, so that whole numbers decide.
    fn far<const N: usize>(points: [[f64; N]; 4], power: i32) -> [[f64; N]; 4] {
        points.map(|p| p.map(|x| x * 2f64.powi(power)))
    }

    /// Coordinates in general position, on a coarse grid, and a few units in the last place off the grid.
    fn coordinate() -> impl Strategy<Value = f64> {
        let grid = (-3i32..=3).prop_map(f64::from);
        let near = ((-3i32..=3), (-2i64..=2)).prop_map(|(x, ulps)| {
            let x = f64::from(x) + 0.5;
            f64::from_bits((x.to_bits() as i64 + ulps) as u64)
        });
        prop_oneof![-1.0..1.0, grid, near]
    }

    proptest! {
        #[test]
        fn adaptive_predicates_and_whole_numbers_agree(
            points in prop::array::uniform4(prop::array::uniform3(coordinate())),
            power in prop_oneof![-900i32..-200, 300i32..1000],
        ) {
            let [a, b, c, d] = points;
            let [e, f, g, h] = far(points, power);
            prop_assert_eq!(side_of_plane(a, b, c, d), side_of_plane(e, f, g, h));
            let [a, b, c, d] = points.map(|p| [p[0], p[2]]);
            let [e, f, g, _] = far([a, b, c, d], power);
            prop_assert_eq!(side_of_line(a, b, c), side_of_line(e, f, g));
        }
    }

    #[test]
    fn the_least_and_the_greatest_double_decide() {
        let least = f64::from_bits(1);
        let [a, b, c] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
        assert_eq!(side_of_plane(a, b, c, [1.0, 1.0, 0.0]), Ordering::Equal);
        let above = side_of_plane(a, b, c, [1.0, 1.0, least]);
        let below = side_of_plane(a, b, c, [1.0, 1.0, -least]);
        assert_eq!([above, below], [Ordering::Less, Ordering::Greater]);
        assert_eq!(side_of_plane(a, b, c, [0.3, 0.1, 1.0]), above);
        let [a, b, c] = [a, b, c].map(|p| p.map(|x| if x > 0.0 { f64::MAX } else { least }));
        assert_eq!(side_of_plane(a, b, c, [1.0, 1.0, f64::MAX]), above);
        assert_eq!(side_of_plane(a, b, c, [1.0, 1.0, -f64::MAX]), below);
        let line = |y| side_of_line([0.0, 0.0], [f64::MAX, least], [f64::MAX / 2.0, y]);
        // The middle of the line is at half the least double, which is none.
        assert_eq!(
            [line(least), line(0.0)],
            [Ordering::Greater, Ordering::Less]
        );
    }
}
