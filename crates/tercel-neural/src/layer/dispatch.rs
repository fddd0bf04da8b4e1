//! The widest vectors that the machine has, chosen when the program runs.

/// Numbers that are computed with together.
pub(crate) const LANES: usize = 8;

/// What a kind of machine computes with.
pub(crate) trait Arithmetic: Copy {
    /// A vector of eight numbers. Compilers cut larger loops into such vectors by themselves, but not always well.
    type Vector: Copy;

    /// Eight times the same number.
    fn splat(self, x: f32) -> Self::Vector;

    /// `x w + sum`, number by number, rounded as [`fused`](Arithmetic::fused) does.
    fn gather(self, x: Self::Vector, weights: &[f32; LANES], sum: Self::Vector) -> Self::Vector;

    /// Eight numbers as a vector.
    fn load(self, numbers: &[f32; LANES]) -> Self::Vector;

    /// `a b`, number by number.
    fn times(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;

    /// The numbers of a vector.
    fn numbers(self, vector: Self::Vector) -> [f32; LANES];

    /// `a b + c`, rounded once or twice.
    fn fused(a: f32, b: f32, c: f32) -> f32;
}

/// Two roundings, on any machine.
#[derive(Clone, Copy)]
pub(crate) struct Plain;

/// One rounding, on machines where that is one instruction of the common set. On others it is a slow library call.
#[cfg(target_arch = "aarch64")]
#[derive(Clone, Copy)]
pub(crate) struct Fused;

macro_rules! arrays {
    ($machine:ty, $fused:expr) => {
        impl Arithmetic for $machine {
            type Vector = [f32; LANES];

            #[inline(always)]
            fn splat(self, x: f32) -> [f32; LANES] {
                [x; LANES]
            }

            #[inline(always)]
            fn gather(self, x: [f32; LANES], weights: &[f32; LANES], sum: [f32; LANES]) -> [f32; LANES] {
                std::array::from_fn(|i| Self::fused(x[i], weights[i], sum[i]))
            }

            #[inline(always)]
            fn load(self, numbers: &[f32; LANES]) -> [f32; LANES] {
                *numbers
            }

            #[inline(always)]
            fn times(self, a: [f32; LANES], b: [f32; LANES]) -> [f32; LANES] {
                std::array::from_fn(|i| a[i] * b[i])
            }

            #[inline(always)]
            fn numbers(self, vector: [f32; LANES]) -> [f32; LANES] {
                vector
            }

            #[inline(always)]
            fn fused(a: f32, b: f32, c: f32) -> f32 {
                $fused(a, b, c)
            }
        }
    };
}

arrays!(Plain, |a: f32, b: f32, c: f32| a * b + c);
#[cfg(target_arch = "aarch64")]
arrays!(Fused, f32::mul_add);

/// AVX2 with FMA.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
impl Arithmetic for pulp::x86::V3 {
    type Vector = pulp::f32x8;

    #[inline(always)]
    fn splat(self, x: f32) -> pulp::f32x8 {
        self.splat_f32x8(x)
    }

    #[inline(always)]
    fn gather(self, x: pulp::f32x8, weights: &[f32; LANES], sum: pulp::f32x8) -> pulp::f32x8 {
        self.mul_add_f32x8(x, pulp::cast(*weights), sum)
    }

    #[inline(always)]
    fn load(self, numbers: &[f32; LANES]) -> pulp::f32x8 {
        pulp::cast(*numbers)
    }

    #[inline(always)]
    fn times(self, a: pulp::f32x8, b: pulp::f32x8) -> pulp::f32x8 {
        self.mul_f32x8(a, b)
    }

    #[inline(always)]
    fn numbers(self, vector: pulp::f32x8) -> [f32; LANES] {
        pulp::cast(vector)
    }

    #[inline(always)]
    fn fused(a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }
}

/// A computation that is compiled once for each kind of machine.
///
/// Everything that `run` calls must be `#[inline(always)]`: what is not inlined is compiled for the oldest machine.
pub(crate) trait Kernel {
    fn run<A: Arithmetic>(self, machine: A);
}

/// Runs a kernel with AVX2 and FMA where the machine has them, with NEON on Arm, and plainly elsewhere.
#[inline(always)]
pub(crate) fn dispatch<K: Kernel>(kernel: K) {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    if let pulp::Arch::V3(simd) = pulp::Arch::new() {
        return simd.vectorize(Wide(simd, kernel));
    }
    // NEON and its fused arithmetic are part of every 64-bit Arm machine.
    #[cfg(target_arch = "aarch64")]
    kernel.run(Fused);
    #[cfg(not(target_arch = "aarch64"))]
    kernel.run(Plain);
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
struct Wide<K>(pulp::x86::V3, K);

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
impl<K: Kernel> pulp::NullaryFnOnce for Wide<K> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.1.run(self.0);
    }
}

/// Runs a kernel as a machine without wide vectors does.
#[cfg(test)]
pub(crate) fn plainly<K: Kernel>(kernel: K) {
    kernel.run(Plain);
}
