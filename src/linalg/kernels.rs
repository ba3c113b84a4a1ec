//! Inner products and updates of long vectors, compiled for the processor at hand.
//!
//! Sums run in eight fixed lanes, whatever the instruction set, so the bits do not depend on the machine's vector width.

/// Compiles a function body twice, for AVX2 and for the baseline, and picks one at run time. The arithmetic is the same in both: no
/// multiplication is fused with an addition unless the source says so.
macro_rules! vectorised {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        $(#[$doc])*
        #[inline]
        $vis fn $name($($arg: $type),*) $(-> $out)? {
            #[inline(always)]
            fn body($($arg: $type),*) $(-> $out)? $body
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn wide($($arg: $type),*) $(-> $out)? { body($($arg),*) }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has just been seen to have AVX2.
                    return unsafe { wide($($arg),*) };
                }
            }
            body($($arg),*)
        }
    };
}
pub(crate) use vectorised;

/// Compiles a body whose products are fused with sums (`f64::mul_add`, rounded once) for AVX-512, for AVX2, and for the baseline, where a function call
/// takes the place of the instruction: slow, but the same bits.
macro_rules! fused {
    ($(#[$doc:meta])* $vis:vis fn $name:ident $([$($generics:tt)*])? ($($arg:ident: $type:ty),* $(,)?) $body:block) => {
        $(#[$doc])*
        #[inline]
        $vis fn $name$(<$($generics)*>)?($($arg: $type),*) {
            #[inline(always)]
            fn body$(<$($generics)*>)?($($arg: $type),*) $body
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,fma")]
                fn wider$(<$($generics)*>)?($($arg: $type),*) { body($($arg),*) }
                #[target_feature(enable = "avx2,fma")]
                fn wide$(<$($generics)*>)?($($arg: $type),*) { body($($arg),*) }
                if $crate::linalg::kernels::has_avx512() {
                    // SAFETY: the processor has just been seen to have these instructions.
                    return unsafe { wider($($arg),*) };
                }
                if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
                    // SAFETY: as above.
                    return unsafe { wide($($arg),*) };
                }
            }
            body($($arg),*)
        }
    };
}
pub(crate) use fused;

/// Whether the processor has the instructions of AVX-512 that `fused` asks for.
#[inline(always)]
pub fn has_avx512() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::is_x86_feature_detected as has;
        has!("avx512f") && has!("avx512bw") && has!("avx512dq") && has!("avx512vl") && has!("fma")
    }
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Marks the upper halves of the vector registers as unused. faer's AVX-512 matrix product (private-gemm-x86 0.1.22) returns without doing so, and every
/// instruction of the baseline set is then several times slower, until something else does: call this after faer.
#[inline]
pub fn clear_upper_halves() {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the processor has just been seen to have AVX; no value is kept in the upper halves across a call.
        unsafe { std::arch::x86_64::_mm256_zeroupper() };
    }
}

/// Keeps the compiler from taking several rounds of a loop together, where each round by itself is a whole number of vector instructions: it would
/// gather each lane from memory.
#[inline(always)]
pub fn one_at_a_time() {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: no instruction at all.
    unsafe {
        std::arch::asm!("", options(nomem, nostack, preserves_flags))
    };
}

/// The number of lanes of a sum.
pub const LANES: usize = 8;

/// Adds up the lanes of a sum, in a fixed order.
#[inline(always)]
pub fn total(lanes: [f64; LANES]) -> f64 {
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

vectorised! {
    /// The inner product of two vectors of the same length.
    pub fn dot(a: &[f64], b: &[f64]) -> f64 {
        let mut lanes = [0.0; LANES];
        let (a_chunks, a_rest) = a.as_chunks::<LANES>();
        let (b_chunks, b_rest) = b.as_chunks::<LANES>();
        for (x, y) in a_chunks.iter().zip(b_chunks) {
            for lane in 0..LANES {
                lanes[lane] += x[lane] * y[lane];
            }
        }
        for ((lane, x), y) in lanes.iter_mut().zip(a_rest).zip(b_rest) {
            *lane += x * y;
        }
        total(lanes)
    }
}

vectorised! {
    /// The inner products of four vectors with one, reading that one once.
    pub fn dot4(a: [&[f64]; 4], b: &[f64]) -> [f64; 4] {
        let n = b.len();
        let a = a.map(|a| &a[..n]);
        let mut lanes = [[0.0; LANES]; 4];
        let whole = n / LANES * LANES;
        for first in (0..whole).step_by(LANES) {
            for (lanes, a) in lanes.iter_mut().zip(a) {
                for lane in 0..LANES {
                    lanes[lane] += a[first + lane] * b[first + lane];
                }
            }
        }
        for i in whole..n {
            for (lanes, a) in lanes.iter_mut().zip(a) {
                lanes[i - whole] += a[i] * b[i];
            }
        }
        lanes.map(total)
    }
}

vectorised! {
    /// y += a x; the sum of squares of what y becomes is added to `squares`, entry by entry.
    pub fn axpy_squares(a: f64, x: &[f64], y: &mut [f64], squares: &mut [f64]) {
        for ((y, x), square) in y.iter_mut().zip(x).zip(squares) {
            *y += a * x;
            *square += *y * *y;
        }
    }
}

vectorised! {
    /// y += a x.
    pub fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
        for (y, x) in y.iter_mut().zip(x) {
            *y += a * x;
        }
    }
}

vectorised! {
    /// y += a_0 x_0 + a_1 x_1 + a_2 x_2 + a_3 x_3, reading and writing y once.
    pub fn axpy4(a: [f64; 4], x: [&[f64]; 4], y: &mut [f64]) {
        let n = y.len();
        let [x0, x1, x2, x3] = x.map(|x| &x[..n]);
        for i in 0..n {
            y[i] += (a[0] * x0[i] + a[1] * x1[i]) + (a[2] * x2[i] + a[3] * x3[i]);
        }
    }
}

/// The inner products of the columns `x(j)`, j < count, of a matrix with y.
pub fn project<'a>(
    count: usize,
    x: impl Fn(usize) -> &'a [f64],
    y: &[f64],
    products: &mut Vec<f64>,
) {
    let whole = count / 4 * 4;
    products.clear();
    for j in (0..whole).step_by(4) {
        products.extend(dot4([x(j), x(j + 1), x(j + 2), x(j + 3)], y));
    }
    products.extend((whole..count).map(|j| dot(x(j), y)));
}

/// y += sum_j a_j x_j over the columns `x(j)` of a matrix.
pub fn combine<'a>(a: &[f64], x: impl Fn(usize) -> &'a [f64], y: &mut [f64]) {
    let whole = a.len() / 4 * 4;
    for j in (0..whole).step_by(4) {
        axpy4(
            [a[j], a[j + 1], a[j + 2], a[j + 3]],
            [x(j), x(j + 1), x(j + 2), x(j + 3)],
            y,
        );
    }
    for (j, &a) in a.iter().enumerate().skip(whole) {
        axpy(a, x(j), y);
    }
}

fused! {
    /// y += a_0 x_0 + a_1 x_1 + a_2 x_2 + a_3 x_3 in this order, each product fused with the sum.
    fn axpy4_fused(a: [f64; 4], x: [&[f64]; 4], y: &mut [f64]) {
        let n = y.len();
        let [x0, x1, x2, x3] = x.map(|x| &x[..n]);
        for i in 0..n {
            let first = a[1].mul_add(x1[i], a[0].mul_add(x0[i], y[i]));
            y[i] = a[3].mul_add(x3[i], a[2].mul_add(x2[i], first));
        }
    }
}

fused! {
    fn axpy_fused(a: f64, x: &[f64], y: &mut [f64]) {
        for (y, x) in y.iter_mut().zip(x) {
            *y = a.mul_add(*x, *y);
        }
    }
}

/// [`combine`] in the order of the columns, each product fused with the sum.
pub fn combine_fused<'a>(a: &[f64], x: impl Fn(usize) -> &'a [f64], y: &mut [f64]) {
    let (fours, rest) = a.as_chunks::<4>();
    for (i, &four) in fours.iter().enumerate() {
        axpy4_fused(four, std::array::from_fn(|p| x(4 * i + p)), y);
    }
    for (j, &a) in (4 * fours.len()..).zip(rest) {
        axpy_fused(a, x(j), y);
    }
}

vectorised! {
    /// The sum of all entries.
    pub fn sum(a: &[f64]) -> f64 {
        let mut lanes = [0.0; LANES];
        let (chunks, rest) = a.as_chunks::<LANES>();
        for x in chunks {
            for lane in 0..LANES {
                lanes[lane] += x[lane];
            }
        }
        for (lane, x) in lanes.iter_mut().zip(rest) {
            *lane += x;
        }
        total(lanes)
    }
}

vectorised! {
    /// z = x - y.
    pub fn subtract(x: &[f64], y: &[f64], z: &mut [f64]) {
        for ((z, x), y) in z.iter_mut().zip(x).zip(y) {
            *z = x - y;
        }
    }
}

vectorised! {
    /// The greatest magnitude.
    pub fn max_abs(a: &[f64]) -> f64 {
        let mut lanes = [0.0f64; LANES];
        let (chunks, rest) = a.as_chunks::<LANES>();
        for x in chunks {
            for lane in 0..LANES {
                lanes[lane] = if x[lane].abs() > lanes[lane] { x[lane].abs() } else { lanes[lane] };
            }
        }
        lanes.iter().chain(rest).fold(0.0, |most, x| x.abs().max(most))
    }
}

/// Sum of squares.
pub fn norm_squared(a: &[f64]) -> f64 {
    dot(a, a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dot_and_combine_match_plain_sums() {
        for n in [0, 1, 7, 8, 9, 31] {
            let columns: Vec<Vec<f64>> = (0..6)
                .map(|j| {
                    (0..n)
                        .map(|i| ((i * 7 + j * 3) % 11) as f64 - 4.0)
                        .collect()
                })
                .collect();
            let plain: f64 = columns[0].iter().zip(&columns[1]).map(|(a, b)| a * b).sum();
            assert_eq!(dot(&columns[0], &columns[1]), plain);
            let a = [1.0, -2.0, 3.0, 0.5, 4.0, -1.0];
            let mut y = vec![1.0; n];
            combine(&a, |j| &columns[j], &mut y);
            for i in 0..n {
                let expected: f64 = 1.0 + (0..6).map(|j| a[j] * columns[j][i]).sum::<f64>();
                assert_eq!(y[i], expected);
            }
        }
    }
}
