//! Passes over long vectors, with the widest instructions that the machine has.
//!
//! The functions are plain loops that the compiler turns into vector instructions; `pulp` chooses at run time
//! between the versions for different machines. Products and sums are not contracted, so that every machine
//! gives the same numbers.

use pulp::{Arch, NullaryFnOnce};

/// What is compiled once for each kind of machine. Made by [`vectorised`].
pub trait Kernel {
    /// Runs it.
    fn run(self);
}

/// Runs a kernel in the version for this machine.
#[inline(always)]
pub fn dispatch(kernel: impl Kernel) {
    Arch::new().dispatch(Call(kernel));
}

struct Call<K>(K);

impl<K: Kernel> NullaryFnOnce for Call<K> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.0.run();
    }
}

/// Makes a function a [`Kernel`] and calls it through [`dispatch`].
///
/// What its body calls must be `#[inline(always)]`: what is not inlined is compiled for the oldest machine.
/// Closures and functions that are passed as values cannot promise that, methods of a trait can; hence the
/// macro.
macro_rules! vectorised {
    (
        $(#[$doc:meta])*
        $view:vis fn $name:ident<$life:lifetime>($($argument:ident: $type:ty),* $(,)?) $body:block
    ) => {
        $(#[$doc])*
        $view fn $name<$life>($($argument: $type),*) {
            struct Arguments<$life> {
                $($argument: $type),*
            }
            impl<$life> $crate::backend::vector::Kernel for Arguments<$life> {
                #[inline(always)]
                fn run(self) {
                    let Self { $($argument),* } = self;
                    $body
                }
            }
            $crate::backend::vector::dispatch(Arguments { $($argument),* });
        }
    };
}

pub(crate) use vectorised;

/// `exp(x)` to about 1e-7 relative, for x held within +-87: 2^n times a polynomial in the remainder.
#[inline(always)]
fn exponential(x: f32) -> f32 {
    // Added to a float of this size, the fraction is rounded away and the integer is left in the low bits.
    const ROUND: f32 = 12_582_912.0;
    // ln 2 in two parts: the first has few bits, so that its product with n is exact.
    const LN_2_HIGH: f32 = 355.0 / 512.0;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let x = x.clamp(-87.0, 87.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = x - n * LN_2_HIGH - n * LN_2_LOW;
    // Taylor series of (exp(r) - 1 - r) / r^2; |r| <= ln 2 / 2, so the first term left out is below 1e-8.
    let p = 1.0 / 5040.0;
    let p = p * r + 1.0 / 720.0;
    let p = p * r + 1.0 / 120.0;
    let p = p * r + 1.0 / 24.0;
    let p = p * r + 1.0 / 6.0;
    let p = p * r + 0.5;
    let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(0x3f80_0000));
    (p * r * r + r + 1.0) * power
}

/// The logistic function.
#[inline(always)]
pub fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exponential(-x))
}

/// The hyperbolic tangent, to 2e-7 absolute.
#[inline(always)]
pub fn tanh(x: f32) -> f32 {
    1.0 - 2.0 / (exponential(2.0 * x) + 1.0)
}

/// Sums the rows of a matrix: the gradient of a bias.
pub fn sum_rows(values: &[f32], columns: usize) -> Vec<f32> {
    let mut sums = vec![0.0; columns];
    add_rows(&mut sums, values);
    sums
}

vectorised! {
    fn add_rows<'a>(sums: &'a mut [f32], values: &'a [f32]) {
        for row in values.chunks_exact(sums.len()) {
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum += value;
            }
        }
    }
}

vectorised! {
    /// Adds numbers to others.
    pub fn add<'a>(out: &'a mut [f32], values: &'a [f32]) {
        for (out, value) in out.iter_mut().zip(values) {
            *out += value;
        }
    }
}

/// Copies a row into each row of a matrix: a bias, before products are added to it.
pub fn repeat_row(row: &[f32], rows: usize) -> Vec<f32> {
    row.repeat(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn activations_equal_those_of_the_standard_library() {
        for step in -4_000..=4_000 {
            let x = step as f32 * 0.01;
            let wide = f64::from(x);
            assert!((f64::from(sigmoid(x)) - 1.0 / (1.0 + (-wide).exp())).abs() < 2e-7, "sigmoid({x})");
            assert!((f64::from(tanh(x)) - wide.tanh()).abs() < 2e-7, "tanh({x})");
        }
    }

    #[test]
    fn activations_of_extremes_are_finite_and_not_a_number_stays_so() {
        for x in [f32::MAX, f32::MIN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!((0.0..=1.0).contains(&sigmoid(x)));
            assert!(tanh(x).abs() <= 1.0);
        }
        assert!(sigmoid(f32::NAN).is_nan() && tanh(f32::NAN).is_nan());
    }
}
