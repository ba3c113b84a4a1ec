//! Rotations of the plane and of space: polar decompositions, rotation vectors and their branches.
//!
//! A 3x3 matrix is its three columns: `m[j][i]` is entry (i, j), and `m[j]` the image of axis j. A rotation vector is axis times angle in
//! radians, counter-clockwise about the axis. But for [`nearest_branch`], the functions of rotation vectors have no branches and call no library function,
//! so that a loop over them compiles to vector instructions; they are exact to a few roundings. Entries must lie well inside the range of doubles (1e-150 to 1e150) where
//! nothing else is said; what is not finite stays so.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Three columns.
pub type Matrix = [[f64; 3]; 3];

/// No rotation.
pub const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A B.
#[inline(always)]
pub fn times(a: &Matrix, b: &Matrix) -> Matrix {
    b.map(|column| apply(a, column))
}

/// A^T B.
#[inline(always)]
pub fn transposed_times(a: &Matrix, b: &Matrix) -> Matrix {
    b.map(|column| a.map(|row| dot(row, column)))
}

/// A B^T.
#[inline(always)]
pub fn times_transposed(a: &Matrix, b: &Matrix) -> Matrix {
    times(a, &transposed(b))
}

/// A^T.
#[inline(always)]
pub fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|j| std::array::from_fn(|i| a[i][j]))
}

/// A x.
#[inline(always)]
pub fn apply(a: &Matrix, x: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[0][i] * x[0] + a[1][i] * x[1] + a[2][i] * x[2])
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// F = R U in the plane: R turns by the angle with cosine `turn[0]` and sine `turn[1]`, U = [[u_11, u_12], [u_12, u_22]] is symmetric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanePolar {
    pub turn: [f64; 2],
    /// u_11, u_22, u_12.
    pub stretch: [f64; 3],
}

/// The polar decomposition of a 2x2 matrix given by its columns. R is the rotation nearest to F, by R ~ F + cof F. U is positive semi-definite where
/// det F >= 0; where F has no nearest rotation (a reflection times a scale, or zero) R is the identity.
#[inline(always)]
pub fn plane_polar(f: [[f64; 2]; 2]) -> PlanePolar {
    let [[a, c], [b, d]] = f;
    let (x, y) = (a + d, c - b);
    let size = (x * x + y * y).sqrt();
    let (cos, sin) = if size > 0.0 {
        (x / size, y / size)
    } else {
        (1.0, 0.0)
    };
    PlanePolar {
        turn: [cos, sin],
        stretch: [
            cos * a + sin * c,
            cos * d - sin * b,
            0.5 * ((cos * b + sin * d) + (cos * c - sin * a)),
        ],
    }
}

/// Newton's iteration is trusted with a matrix whose determinant exceeds this when its Frobenius norm is that of a rotation.
const REGULAR: f64 = 0.1;
/// A step whose squared Frobenius norm is below this leaves an error of less than its square root squared: rounding.
const CONVERGED: f64 = 1e-16;

/// The rotation R (determinant +1) that minimises |R - M|_F. Where several do, one of them, always the same; the identity for M = 0.
///
/// Newton's iteration X <- (X + X^-T) / 2 (Higham 1986) for what is near a rotation, the greatest eigenvector of Horn's (1987) 4x4 matrix by
/// Jacobi's method for the rest. Any scale.
pub fn nearest_rotation(m: &Matrix) -> Matrix {
    if m.as_flattened().iter().all(|&x| x == 0.0) {
        return IDENTITY;
    }
    let largest = m
        .as_flattened()
        .iter()
        .fold(0.0f64, |most, x| x.abs().max(most));
    // In two steps, because 1 / largest can overflow.
    let unit = m.map(|column| column.map(|x| x / largest));
    let square: f64 = unit.as_flattened().iter().map(|x| x * x).sum();
    let scale = (3.0 / square).sqrt();
    let scaled = unit.map(|column| column.map(|x| x * scale));
    newton(scaled).unwrap_or_else(|| from_quaternion(greatest_eigenvector(horn(&scaled))))
}

fn newton(mut x: Matrix) -> Option<Matrix> {
    for _ in 0..12 {
        let cofactors = [cross(x[1], x[2]), cross(x[2], x[0]), cross(x[0], x[1])];
        let determinant = dot(x[0], cofactors[0]);
        if determinant <= REGULAR || determinant.is_nan() {
            return None;
        }
        let half = 0.5 / determinant;
        let mut change = 0.0;
        for (x, cofactor) in x
            .as_flattened_mut()
            .iter_mut()
            .zip(cofactors.as_flattened())
        {
            let next = 0.5 * *x + half * cofactor;
            change += (next - *x) * (next - *x);
            *x = next;
        }
        if change < CONVERGED {
            return Some(x);
        }
    }
    None
}

/// The symmetric K with q^T K q = tr(R(q)^T M) for unit quaternions q = (w, x, y, z).
fn horn(m: &Matrix) -> [[f64; 4]; 4] {
    let [[a, d, g], [b, e, h], [c, f, i]] = *m;
    let (x, y, z) = (h - f, c - g, d - b);
    let (p, q, r) = (b + d, c + g, f + h);
    [
        [a + e + i, x, y, z],
        [x, a - e - i, p, q],
        [y, p, e - a - i, r],
        [z, q, r, i - a - e],
    ]
}

/// The unit eigenvector of the greatest eigenvalue, the first of equal ones.
fn greatest_eigenvector(mut k: [[f64; 4]; 4]) -> [f64; 4] {
    let mut vectors: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j)));
    for _sweep in 0..20 {
        let off: f64 = (0..4)
            .flat_map(|p| (p + 1..4).map(move |q| (p, q)))
            .map(|(p, q)| k[p][q] * k[p][q])
            .sum();
        if off < 1e-34 {
            break;
        }
        for p in 0..4 {
            for q in p + 1..4 {
                jacobi(&mut k, &mut vectors, p, q);
            }
        }
    }
    let best = (1..4).fold(0, |best, i| if k[i][i] > k[best][best] { i } else { best });
    let v = vectors[best];
    let size = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / size)
}

/// Turns axes p and q so that entry (p, q) vanishes; `vectors` are rows.
fn jacobi(k: &mut [[f64; 4]; 4], vectors: &mut [[f64; 4]; 4], p: usize, q: usize) {
    if k[p][q] == 0.0 {
        return;
    }
    let theta = (k[q][q] - k[p][p]) / (2.0 * k[p][q]);
    let t = 1.0f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for row in k.iter_mut() {
        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
    }
    for columns in [k, vectors] {
        for j in 0..4 {
            let (x, y) = (columns[p][j], columns[q][j]);
            (columns[p][j], columns[q][j]) = (c * x - s * y, s * x + c * y);
        }
    }
}

/// The rotation of a unit quaternion (w, x, y, z).
#[inline(always)]
fn from_quaternion([w, x, y, z]: [f64; 4]) -> Matrix {
    let (xx, yy, zz) = (2.0 * x * x, 2.0 * y * y, 2.0 * z * z);
    let (xy, xz, yz) = (2.0 * x * y, 2.0 * x * z, 2.0 * y * z);
    let (wx, wy, wz) = (2.0 * w * x, 2.0 * w * y, 2.0 * w * z);
    [
        [1.0 - (yy + zz), xy + wz, xz - wy],
        [xy - wz, 1.0 - (xx + zz), yz + wx],
        [xz + wy, yz - wx, 1.0 - (xx + yy)],
    ]
}

/// The rotation vector of a rotation, of angle 0 to pi. Exact to rounding near 0 and near pi (where either of two opposite vectors may come).
#[inline(always)]
pub fn log(r: &Matrix) -> [f64; 3] {
    let [[a, d, g], [b, e, h], [c, f, i]] = *r;
    // Four multiples of the quaternion (w, x, y, z), each by four times one of its entries; the multiple by the greatest is the most exact.
    let (x, y, z) = (h - f, c - g, d - b);
    let (p, q, s) = (b + d, c + g, f + h);
    let squares = [
        1.0 + a + e + i,
        1.0 + a - e - i,
        1.0 - a + e - i,
        1.0 - a - e + i,
    ];
    let mut best = [squares[0], x, y, z];
    let mut most = squares[0];
    for (square, multiple) in [
        (squares[1], [x, squares[1], p, q]),
        (squares[2], [y, p, squares[2], s]),
        (squares[3], [z, q, s, squares[3]]),
    ] {
        let greater = square > most;
        most = if greater { square } else { most };
        for k in 0..4 {
            best[k] = if greater { multiple[k] } else { best[k] };
        }
    }
    let [w, x, y, z] = best;
    let length = (x * x + y * y + z * z).sqrt();
    let half = quadrant_angle(length, w.abs());
    let tiny = length < 1e-150;
    let (angle, sine) = if tiny {
        (2.0, w.abs())
    } else {
        (2.0 * half, length)
    };
    let factor = angle / sine;
    let factor = if w < 0.0 { -factor } else { factor };
    [x * factor, y * factor, z * factor]
}

/// The rotation of a rotation vector. To rounding for angles of up to a million radians; beyond, rounding in the angle tells less and less, and past 1e12
/// what comes out is no rotation.
#[inline(always)]
pub fn exp(v: [f64; 3]) -> Matrix {
    let angle = dot(v, v).sqrt();
    let (sin, cos) = half_turn(0.5 * angle);
    let factor = if angle > 1e-150 { sin / angle } else { 0.5 };
    from_quaternion([cos, v[0] * factor, v[1] * factor, v[2] * factor])
}

/// The branch of rotation vector `v` (its angle plus 2 pi times a whole number, about its axis) nearest to `to`; for the identity, of which every axis
/// is one, about the axis of `to`.
#[inline(always)]
pub fn nearest_branch(v: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    let gap = [to[0] - v[0], to[1] - v[1], to[2] - v[2]];
    if dot(gap, gap) <= PI * PI {
        return v;
    }
    farther_branch(v, to)
}

/// Below this angle a rotation is the identity up to rounding.
const STILL: f64 = 1e-15;

#[cold]
fn farther_branch(v: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    let angle = dot(v, v).sqrt();
    let (axis, angle) = if angle > STILL {
        (v.map(|x| x / angle), angle)
    } else {
        let length = dot(to, to).sqrt();
        (to.map(|x| x / length), 0.0)
    };
    let turns = ((dot(axis, to) - angle) / TAU).round();
    if turns == 0.0 {
        return v;
    }
    axis.map(|x| x * (angle + TAU * turns))
}

/// tan(pi / 8).
const EIGHTH: f64 = 0.414_213_562_373_095_03;

/// The angle of the point (x, y) of the first quadrant, 0 to pi/2: atan2 with the polynomial of fdlibm (Sun Microsystems 1993).
#[inline(always)]
fn quadrant_angle(y: f64, x: f64) -> f64 {
    let low = y <= EIGHTH * x;
    let high = x <= EIGHTH * y;
    let up = if low { y } else { y - x };
    let up = if high { -x } else { up };
    let right = if low { x } else { y + x };
    let right = if high { y } else { right };
    let from = if low { 0.0 } else { FRAC_PI_4 };
    let from = if high { FRAC_PI_2 } else { from };
    let t = up / right;
    let z = t * t;
    let w = z * z;
    let odd = z
        * (3.333_333_333_333_293e-1
            + w * (1.428_571_427_250_346_6e-1
                + w * (9.090_887_133_436_507e-2
                    + w * (6.661_073_137_387_531e-2
                        + w * (4.976_877_994_615_932e-2 + w * 1.628_582_011_536_578_2e-2)))));
    let even = w
        * (-1.999_999_999_987_648_3e-1
            + w * (-1.111_111_040_546_235_6e-1
                + w * (-7.691_876_205_044_83e-2
                    + w * (-5.833_570_133_790_573e-2 + w * -3.653_157_274_421_691_6e-2))));
    from + (t - t * (odd + even))
}

/// pi in two parts, the first with 20 trailing zeros so that small multiples of it are exact.
const PI_HEAD: f64 = 2.0 * 1.570_796_326_734_125_6;
const PI_TAIL: f64 = 2.0 * 6.077_100_506_506_192e-11;
/// Adding it rounds to whole numbers.
const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;

/// Sine and cosine of `angle` >= 0, both with the same sign changed where a half turn or three are left out: a quaternion does not care.
/// The polynomials are fdlibm's, on a quarter of a turn.
#[inline(always)]
fn half_turn(angle: f64) -> (f64, f64) {
    let halves = (angle * (1.0 / PI) + WHOLE) - WHOLE;
    let x = 0.5 * ((angle - halves * PI_HEAD) - halves * PI_TAIL);
    let z = x * x;
    let sin = x + x
        * z
        * (-1.666_666_666_666_663_2e-1
            + z * (8.333_333_333_322_49e-3
                + z * (-1.984_126_982_985_795e-4
                    + z * (2.755_731_370_707_006_8e-6
                        + z * (-2.505_076_025_340_686_3e-8 + z * 1.589_690_995_211_55e-10)))));
    let cos = 1.0 - 0.5 * z
        + z * z
            * (4.166_666_666_666_66e-2
                + z * (-1.388_888_888_887_411e-3
                    + z * (2.480_158_728_947_673e-5
                        + z * (-2.755_731_435_139_066_3e-7
                            + z * (2.087_572_321_298_175e-9 + z * -1.135_964_755_778_819_5e-11)))));
    (2.0 * sin * cos, 1.0 - 2.0 * sin * sin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Rotation3, Vector3};
    use proptest::prelude::*;

    fn plain(m: &Matrix) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| m[j][i])
    }

    fn arrays(m: Matrix3<f64>) -> Matrix {
        std::array::from_fn(|j| std::array::from_fn(|i| m[(i, j)]))
    }

    fn gap(a: &Matrix, b: &Matrix) -> f64 {
        (plain(a) - plain(b)).norm()
    }

    fn vector() -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3(-1.0f64..1.0)
    }

    fn matrix() -> impl Strategy<Value = Matrix> {
        prop::array::uniform3(vector())
    }

    fn is_rotation(r: &Matrix) -> bool {
        gap(&transposed_times(r, r), &IDENTITY) < 4e-15 && plain(r).determinant() > 0.9
    }

    /// Rodrigues' formula with the library's sine and cosine.
    fn rodrigues(axis: [f64; 3], angle: f64) -> Matrix {
        arrays(
            Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(Vector3::from(axis)), angle)
                .into_inner(),
        )
    }

    #[test]
    fn closed_forms() {
        assert_eq!(exp([0.0; 3]), IDENTITY);
        assert_eq!(log(&IDENTITY), [0.0; 3]);
        let quarter = exp([0.0, 0.0, FRAC_PI_2]);
        assert!(
            gap(
                &quarter,
                &[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
            ) < 4e-16
        );
        for axis in 0..3 {
            let half: Matrix = std::array::from_fn(|j| {
                std::array::from_fn(|i| {
                    if i != j {
                        0.0
                    } else if i == axis {
                        1.0
                    } else {
                        -1.0
                    }
                })
            });
            let v = log(&half);
            assert!((v[axis].abs() - PI).abs() < 1e-15, "{v:?}");
        }
    }

    #[test]
    fn singular_matrices_have_a_rotation() {
        assert_eq!(nearest_rotation(&[[0.0; 3]; 3]), IDENTITY);
        let e = |i: usize, x: f64| -> [f64; 3] {
            std::array::from_fn(|k| if k == i { x } else { 0.0 })
        };
        for m in [
            [e(0, 1.0), [0.0; 3], [0.0; 3]],
            [e(1, 1e-200), e(2, 2e-200), [0.0; 3]],
            [e(0, -1.0), e(1, -1.0), e(2, -1.0)],
            [e(0, 1.0), e(1, 1.0), e(2, -1.0)],
            [e(0, 1e300), e(0, 1e300), e(1, 1.0)],
            [[1.0; 3]; 3],
        ] {
            let r = nearest_rotation(&m);
            assert!(is_rotation(&r), "{m:?}: {r:?}");
        }
        assert!(nearest_rotation(&[[f64::NAN; 3]; 3])[0][0].is_nan());
    }

    #[test]
    fn the_branch_follows_a_wheel() {
        let axis = [0.6, 0.0, 0.8];
        let mut before = [0.0; 3];
        for step in 0..200 {
            let angle = f64::from(step) * 0.31;
            let v = nearest_branch(log(&exp(axis.map(|x| x * angle))), before);
            for i in 0..3 {
                assert!((v[i] - axis[i] * angle).abs() < 1e-13, "{step}");
            }
            before = v;
        }
        for step in 0..100 {
            let angle = TAU * f64::from(step - 50);
            let v = nearest_branch([0.0; 3], axis.map(|x| x * angle));
            assert!((dot(v, axis) - angle).abs() < 1e-13);
        }
    }

    proptest! {
        #[test]
        fn exp_is_rodrigues(axis in vector(), size in -18i32..3) {
            let angle = 10f64.powi(size) * 3.3;
            let length = dot(axis, axis).sqrt();
            prop_assume!(length > 1e-3);
            let r = exp(axis.map(|x| x / length * angle));
            prop_assert!(is_rotation(&r));
            prop_assert!(gap(&r, &rodrigues(axis, angle)) < 4e-15 * angle.max(1.0));
        }

        /// Near 0, near pi and between: the vector comes back, and its rotation too.
        #[test]
        fn log_undoes_exp(axis in vector(), share in 0.0f64..1.0, size in 0i32..17, near_pi in any::<bool>()) {
            let length = dot(axis, axis).sqrt();
            prop_assume!(length > 1e-3);
            let small = share * PI * 10f64.powi(-size);
            let angle = if near_pi { PI - small } else { small };
            let r = rodrigues(axis, angle);
            let v = log(&r);
            prop_assert!(dot(v, v).sqrt() <= PI + 1e-15);
            prop_assert!(gap(&exp(v), &r) < 4e-15);
            let expected = axis.map(|x| x / length * angle);
            let distance = |sign: f64| (0..3).map(|i| (v[i] - sign * expected[i]).abs()).fold(0.0, f64::max);
            prop_assert!(distance(1.0).min(if PI - angle < 1e-15 { distance(-1.0) } else { 1.0 }) < 4e-15, "{v:?} {expected:?}");
        }

        /// Against the singular value decomposition with the last direction turned where that is needed.
        #[test]
        fn nearest_rotation_is_the_best(m in matrix(), scale in -100i32..100) {
            let svd = plain(&m).svd(true, true);
            let (u, v) = (svd.u.unwrap(), svd.v_t.unwrap());
            let sign = (u * v).determinant().signum();
            let mut s = svd.singular_values;
            let expected = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v;
            s[2] *= sign;
            prop_assume!(s[1] + s[2] > 1e-4);
            let scaled = m.map(|c| c.map(|x| x * 10f64.powi(scale)));
            let r = nearest_rotation(&scaled);
            prop_assert!(is_rotation(&r));
            // The rotation's condition is that of the gap between the greatest eigenvalues of Horn's matrix.
            let tolerance = 1e-14 * (s[0] / (s[1] + s[2])).max(1.0);
            prop_assert!(gap(&r, &arrays(expected)) < tolerance, "{} {tolerance}", gap(&r, &arrays(expected)));
            // What is left of the matrix is symmetric: a polar decomposition.
            let left = transposed_times(&r, &scaled);
            let transposed: Matrix = std::array::from_fn(|j| std::array::from_fn(|i| left[i][j]));
            prop_assert!(gap(&transposed, &left) < 2e-14 * (s[0] / (s[1] + s[2])).max(1.0) * 10f64.powi(scale));
        }

        #[test]
        fn both_ways_of_nearest_rotation_agree(m in matrix()) {
            let scale = (3.0 / plain(&m).norm_squared()).sqrt();
            let scaled = m.map(|c| c.map(|x| x * scale));
            if let Some(r) = newton(scaled) {
                let s = from_quaternion(greatest_eigenvector(horn(&scaled)));
                prop_assert!(gap(&r, &s) < 3e-14, "{}", gap(&r, &s));
            }
        }

        #[test]
        fn the_plane(angle in -PI..PI, p in 0.0f64..3.0, q in 0.01f64..3.0, turn in -PI..PI) {
            let (s, c) = turn.sin_cos();
            let (u, w, x) = (c * c * p + s * s * q, s * s * p + c * c * q, c * s * (p - q));
            let (s, c) = angle.sin_cos();
            let found = plane_polar([[c * u - s * x, s * u + c * x], [c * x - s * w, s * x + c * w]]);
            for (a, b) in found.turn.iter().chain(&found.stretch).zip([c, s, u, w, x]) {
                prop_assert!((a - b).abs() < 1e-14 * (1.0 + 1.0 / q));
            }
        }

        #[test]
        fn branches_are_the_same_rotation_and_the_nearest(axis in vector(), angle in 0.0f64..PI, to in prop::array::uniform3(-20.0f64..20.0)) {
            let length = dot(axis, axis).sqrt();
            prop_assume!(length > 1e-3 && angle > 1e-9);
            let v = axis.map(|x| x / length * angle);
            let found = nearest_branch(v, to);
            prop_assert!(gap(&exp(v), &exp(found)) < 3e-14);
            let distance = |v: [f64; 3]| (0..3).map(|i| (v[i] - to[i]).powi(2)).sum::<f64>();
            for turns in -8..9 {
                let other = axis.map(|x| x / length * (angle + TAU * f64::from(turns)));
                prop_assert!(distance(found) <= distance(other) + 1e-9);
            }
        }
    }
}
