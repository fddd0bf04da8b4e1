//! Activation functions over whole slices, in place.
//!
//! Each is a pass of its own over a slice: compilers turn such loops into vector instructions, and fail when several
//! functions share one. Errors are the largest against double precision, found over the whole range in the tests.
//!
//! | function | largest error | at the ends |
//! |---|---|---|
//! | [`exp`] | 2e-7 relative, where the result is normal | underflows gradually to 0, overflows to infinity |
//! | [`sigmoid`] | 1.5e-7 absolute | 0 within 2e-38, and 1 |
//! | [`tanh`] | 2e-7 relative | -1 and 1 |
//! | [`softplus`] | 3e-7 relative, above -87 | 0 within 2e-38, and `x` |
//! | [`silu`] | 3e-7 relative, above -87 | 0 within 4e-36, and `x` |
//!
//! What is not a number stays so.

use super::dispatch::{Arithmetic, Kernel, dispatch};

/// Replaces each number by `max(x, 0)`.
pub fn relu(values: &mut [f32]) {
    dispatch(Pass(values, Activation::Relu));
}

/// Replaces each number by `eˣ`.
pub fn exp(values: &mut [f32]) {
    dispatch(Pass(values, Activation::Exp));
}

/// Replaces each number by `1 / (1 + e⁻ˣ)`.
pub fn sigmoid(values: &mut [f32]) {
    dispatch(Pass(values, Activation::Sigmoid));
}

/// Replaces each number by its hyperbolic tangent.
pub fn tanh(values: &mut [f32]) {
    dispatch(Pass(values, Activation::Tanh));
}

/// Replaces each number by `ln(1 + eˣ)`.
pub fn softplus(values: &mut [f32]) {
    dispatch(Pass(values, Activation::Softplus));
}

/// Replaces each number by `x / (1 + e⁻ˣ)`.
pub fn silu(values: &mut [f32]) {
    dispatch(Pass(values, Activation::Silu));
}

/// Replaces each row of `width` numbers by `exp(xᵢ) / Σⱼ exp(xⱼ)`.
///
/// Rows may hold `-∞`, which gets no share; a row of nothing else has no shares and becomes not a number.
///
/// # Panics
/// When the slice is not made of rows of `width`.
pub fn softmax(width: usize, values: &mut [f32]) {
    assert!(width > 0 && values.len().is_multiple_of(width), "rows of {width} in {} values", values.len());
    for row in values.chunks_exact_mut(width) {
        let top = row.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        row.iter_mut().for_each(|x| *x -= top);
        exp(row);
        let sum: f32 = row.iter().sum();
        row.iter_mut().for_each(|x| *x /= sum);
    }
}

enum Activation {
    Relu,
    Exp,
    Sigmoid,
    Tanh,
    Softplus,
    Silu,
}

struct Pass<'a>(&'a mut [f32], Activation);

impl Kernel for Pass<'_> {
    #[inline(always)]
    fn run<A: Arithmetic>(self, _: A) {
        match self.1 {
            Activation::Relu => relu_pass(self.0),
            Activation::Exp => self.0.iter_mut().for_each(|x| *x = exp_of::<A>(*x)),
            Activation::Sigmoid => sigmoid_pass::<A>(self.0),
            Activation::Tanh => tanh_pass::<A>(self.0),
            Activation::Softplus => self.0.iter_mut().for_each(|x| *x = softplus_of::<A>(*x)),
            Activation::Silu => self.0.iter_mut().for_each(|x| *x = silu_of::<A>(*x)),
        }
    }
}

#[inline(always)]
pub(super) fn relu_pass(values: &mut [f32]) {
    // `f32::max` would turn what is not a number into zero, and an assignment in one of two branches becomes a masked store.
    for x in values {
        let keep = if *x < 0.0 { 0 } else { u32::MAX };
        *x = f32::from_bits(x.to_bits() & keep);
    }
}

#[inline(always)]
pub(super) fn sigmoid_pass<A: Arithmetic>(values: &mut [f32]) {
    values.iter_mut().for_each(|x| *x = 1.0 / (1.0 + exp_within::<A>(-*x)));
}

#[inline(always)]
pub(super) fn tanh_pass<A: Arithmetic>(values: &mut [f32]) {
    values.iter_mut().for_each(|x| *x = tanh_of::<A>(*x));
}

/// `1.5 2²³`: added to a number of moderate size it leaves the nearest integer in the low bits.
const ROUNDER: f32 = 12_582_912.0;

/// `ln 2` as a number with few digits, whose products with small integers are exact, and the rest.
const LN_2: (f32, f32) = (355.0 / 512.0, -2.121_944_4e-4);

/// `n` and `eʳ` such that `eˣ = 2ⁿ eʳ` with `|r| <= ln 2 / 2`, for moderate `x`.
#[inline(always)]
fn split<A: Arithmetic>(x: f32) -> (i32, f32) {
    let shifted = A::fused(x, std::f32::consts::LOG2_E, ROUNDER);
    let n = shifted - ROUNDER;
    let r = A::fused(n, -LN_2.1, A::fused(n, -LN_2.0, x));
    // Minimax polynomial for (eʳ - 1 - r) / r².
    let mut p = 1.991_852_6e-4;
    p = A::fused(p, r, 1.394_617_7e-3);
    p = A::fused(p, r, 8.333_264e-3);
    p = A::fused(p, r, 4.166_627e-2);
    p = A::fused(p, r, 1.666_666_7e-1);
    p = A::fused(p, r, 0.5);
    let power = A::fused(p, r * r, r) + 1.0;
    (shifted.to_bits().wrapping_sub(ROUNDER.to_bits()) as i32, power)
}

/// `2ⁿ` for an exponent of a normal number.
#[inline(always)]
fn power_of_two(n: i32) -> f32 {
    f32::from_bits((n.wrapping_add(127) as u32) << 23)
}

/// `eˣ`, with `x` held within the range in which the result is a normal number.
#[inline(always)]
fn exp_within<A: Arithmetic>(x: f32) -> f32 {
    let (n, power) = split::<A>(x.clamp(-87.0, 87.0));
    power * power_of_two(n)
}

#[inline(always)]
fn exp_of<A: Arithmetic>(x: f32) -> f32 {
    let (n, power) = split::<A>(x.clamp(-106.0, 90.0));
    // In two factors, of which each is normal even when the result is not.
    let half = n >> 1;
    power * power_of_two(half) * power_of_two(n.wrapping_sub(half))
}

#[inline(always)]
fn tanh_of<A: Arithmetic>(x: f32) -> f32 {
    let size = x.abs();
    let large = 1.0 - 2.0 / (exp_within::<A>(2.0 * size) + 1.0);
    // Near zero the line above loses its digits. Minimax polynomial for (tanh x / x - 1) / x² in x².
    let square = size * size;
    let mut p = 2.147_753_8e-3;
    p = A::fused(p, square, -8.182_937e-3);
    p = A::fused(p, square, 2.170_308_8e-2);
    p = A::fused(p, square, -5.394_723e-2);
    p = A::fused(p, square, 1.333_321e-1);
    p = A::fused(p, square, -3.333_333e-1);
    let small = A::fused(p * square, size, size);
    (if size < 0.625 { small } else { large }).copysign(x)
}

#[inline(always)]
fn silu_of<A: Arithmetic>(x: f32) -> f32 {
    // Beyond the range of the exponential the product would grow again.
    x.max(-200.0) / (1.0 + exp_within::<A>(-x))
}

#[inline(always)]
fn softplus_of<A: Arithmetic>(x: f32) -> f32 {
    // ln(1 + eˣ) = max(x, 0) + ln(1 + u), u = e^-|x|, and ln(1 + u) = 2 artanh s with s = u / (2 + u) up to 1/3.
    let u = exp_within::<A>(-x.abs());
    let s = u / (2.0 + u);
    let square = s * s;
    let mut p = 1.215_198_4e-1;
    p = A::fused(p, square, 1.071_355_5e-1);
    p = A::fused(p, square, 1.430_845_3e-1);
    p = A::fused(p, square, 1.999_944e-1);
    p = A::fused(p, square, 3.333_333_8e-1);
    let logarithm = 2.0 * A::fused(p * square, s, s);
    x.max(0.0) + logarithm
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layer::dispatch::plainly;

    /// Numbers of every magnitude and sign, and dense ones where the functions bend.
    fn everywhere() -> Vec<f32> {
        let dense = (-200_000..=200_000).map(|i| i as f32 * 6e-4);
        let magnitudes = (0..3800).flat_map(|i| {
            let size = 2.0_f32.powf(i as f32 * 0.07 - 140.0);
            [size, -size]
        });
        dense.chain(magnitudes).collect()
    }

    fn both(activation: fn() -> Activation, x: &[f32]) -> [Vec<f32>; 2] {
        let (mut wide, mut plain) = (x.to_vec(), x.to_vec());
        dispatch(Pass(&mut wide, activation()));
        plainly(Pass(&mut plain, activation()));
        [wide, plain]
    }

    /// The largest error against `exact`, each divided by `scale(x, exact)`.
    fn worst(
        activation: fn() -> Activation,
        exact: impl Fn(f64) -> f64,
        scale: impl Fn(f64, f64) -> f64,
    ) -> f64 {
        let x = everywhere();
        let mut worst: f64 = 0.0;
        for values in both(activation, &x) {
            for (x, y) in x.iter().zip(values) {
                let truth = exact(f64::from(*x));
                let error = (f64::from(y) - truth).abs() / scale(f64::from(*x), truth);
                assert!(!error.is_nan(), "{x}: {y} instead of {truth}");
                worst = worst.max(error);
            }
        }
        worst
    }

    #[test]
    fn errors_are_as_documented() {
        let relative = |_: f64, exact: f64| exact.abs().max(f64::from(f32::MIN_POSITIVE));
        // Results above the largest number of single precision are infinite in both.
        let limited = |x: f64| if x.exp() > f64::from(f32::MAX) { 1e300 } else { x.exp() };
        let x: Vec<f32> = everywhere().into_iter().filter(|x| *x < 88.7).collect();
        for values in both(|| Activation::Exp, &x) {
            for (x, y) in x.iter().zip(values) {
                let truth = limited(f64::from(*x));
                let error = (f64::from(y) - truth).abs() / relative(0.0, truth);
                assert!(error < 2e-7, "exp({x}) is {y}, not {truth}");
            }
        }
        let error = worst(|| Activation::Sigmoid, |x| 1.0 / (1.0 + (-x).exp()), |_, _| 1.0);
        assert!(error < 1.5e-7, "sigmoid: {error:e}");
        // Subnormal results of the hyperbolic tangent are the argument, rounded.
        let error = worst(|| Activation::Tanh, f64::tanh, relative);
        assert!(error < 2e-7, "tanh: {error:e}");
        let exact = |x: f64| x.max(0.0) + (-x.abs()).exp().ln_1p();
        let error = worst(|| Activation::Softplus, exact, |x, y| if x < -87.0 { 1e30 } else { y });
        assert!(error < 3e-7, "softplus: {error:e}");
        let exact = |x: f64| x / (1.0 + (-x).exp());
        let scale = |x: f64, y: f64| if x < -87.0 { 1e30 } else { y.abs().max(f64::from(f32::MIN_POSITIVE)) };
        let error = worst(|| Activation::Silu, exact, scale);
        assert!(error < 3e-7, "silu: {error:e}");
    }

    #[test]
    fn the_ends_saturate() {
        let ends = [f32::NEG_INFINITY, -1e30, -200.0, 200.0, 1e30, f32::INFINITY];
        let infinite = f32::INFINITY;
        for y in both(|| Activation::Exp, &ends) {
            assert_eq!(y, [0.0, 0.0, 0.0, infinite, infinite, infinite]);
        }
        for y in both(|| Activation::Tanh, &ends) {
            assert_eq!(y, [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]);
        }
        for y in both(|| Activation::Sigmoid, &ends) {
            assert!(y[..3].iter().all(|y| (0.0..2e-38).contains(y)) && y[3..] == [1.0; 3], "{y:?}");
        }
        for y in both(|| Activation::Softplus, &ends) {
            assert!(
                y[..3].iter().all(|y| (0.0..2e-38).contains(y)) && y[3..] == [200.0, 1e30, infinite],
                "{y:?}"
            );
        }
        for y in both(|| Activation::Silu, &ends) {
            assert!(
                y[..3].iter().all(|y| (-2e-35..=0.0).contains(y)) && y[3..] == [200.0, 1e30, infinite],
                "{y:?}"
            );
        }
        for y in both(|| Activation::Relu, &ends) {
            assert_eq!(y, [0.0, 0.0, 0.0, 200.0, 1e30, infinite]);
        }
    }

    #[test]
    fn what_is_not_a_number_stays_so() {
        let all: [fn() -> Activation; 6] = [
            || Activation::Relu,
            || Activation::Exp,
            || Activation::Sigmoid,
            || Activation::Tanh,
            || Activation::Softplus,
            || Activation::Silu,
        ];
        for activation in all {
            for y in both(activation, &[f32::NAN; 9]) {
                assert!(y.iter().all(|y| y.is_nan()));
            }
        }
    }

    #[test]
    fn shares_of_a_row_sum_to_one_and_ignore_its_offset() {
        let mut rows = [1.0, 2.0, 3.0, 1001.0, 1002.0, 1003.0, f32::NEG_INFINITY, 0.0, f32::NEG_INFINITY];
        softmax(3, &mut rows);
        for (near, far) in rows[..3].iter().zip(&rows[3..6]) {
            assert!((near - far).abs() < 1e-7);
        }
        assert!((rows[2] - 0.665_240_94).abs() < 2e-7);
        assert!((rows[..3].iter().sum::<f32>() - 1.0).abs() < 2e-7);
        assert_eq!(rows[6..], [0.0, 1.0, 0.0]);
    }
}
