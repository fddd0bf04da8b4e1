//! The widest vectors that the machine has, chosen when the program runs.

/// Multiplies and adds, rounding once or twice.
pub(crate) trait Arithmetic {
    /// `a b + c`.
    fn fused(a: f32, b: f32, c: f32) -> f32;
}

/// One rounding: a single instruction on machines that have it, and a slow library call on others.
pub(crate) struct Fused;

/// Two roundings, on any machine.
pub(crate) struct Plain;

impl Arithmetic for Fused {
    #[inline(always)]
    fn fused(a: f32, b: f32, c: f32) -> f32 {
        a.mul_add(b, c)
    }
}

impl Arithmetic for Plain {
    #[inline(always)]
    fn fused(a: f32, b: f32, c: f32) -> f32 {
        a * b + c
    }
}

/// A computation that is compiled once for each kind of machine.
///
/// Everything that `run` calls must be `#[inline(always)]`: what is not inlined is compiled for the oldest machine.
pub(crate) trait Kernel {
    fn run<A: Arithmetic>(self);
}

/// Runs a kernel with AVX2 and FMA where the machine has them, with NEON on Arm, and plainly elsewhere.
#[inline(always)]
pub(crate) fn dispatch<K: Kernel>(kernel: K) {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    if let pulp::Arch::V3(simd) = pulp::Arch::new() {
        return simd.vectorize(Wide(kernel));
    }
    // NEON and its fused arithmetic are part of every 64-bit Arm machine.
    if cfg!(target_arch = "aarch64") {
        return kernel.run::<Fused>();
    }
    kernel.run::<Plain>();
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
struct Wide<K>(K);

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
impl<K: Kernel> pulp::NullaryFnOnce for Wide<K> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.0.run::<Fused>();
    }
}

/// Runs a kernel as a machine without wide vectors does.
#[cfg(test)]
pub(crate) fn plainly<K: Kernel>(kernel: K) {
    kernel.run::<Plain>();
}
