//! Numbers with which the step of the filter is computed.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A real number, plain or one that remembers how it was computed.
///
/// The step of the filter is written once over this trait. The run time computes with `f64`; a training computes with numbers
/// that record themselves, so that both are the same by construction.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Mul<f64, Output = Self>
    + Add<f64, Output = Self>
{
    /// A constant.
    fn of(value: f64) -> Self;
    /// The value alone.
    fn value(self) -> f64;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Exponential.
    fn exp(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Sine.
    fn sin(self) -> Self;
    /// Cosine.
    fn cos(self) -> Self;
    /// The angle of the vector `(x, self)`.
    fn atan2(self, x: Self) -> Self;
}

impl Number for f64 {
    #[inline]
    fn of(value: f64) -> Self {
        value
    }
    #[inline]
    fn value(self) -> f64 {
        self
    }
    #[inline]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline]
    fn exp(self) -> Self {
        f64::exp(self)
    }
    #[inline]
    fn ln(self) -> Self {
        f64::ln(self)
    }
    #[inline]
    fn tanh(self) -> Self {
        f64::tanh(self)
    }
    #[inline]
    fn sin(self) -> Self {
        f64::sin(self)
    }
    #[inline]
    fn cos(self) -> Self {
        f64::cos(self)
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
}

/// `x` near zero, and within `±limit` everywhere.
#[inline]
pub(in crate::filter) fn within<T: Number>(x: T, limit: f64) -> T {
    (x * (1.0 / limit)).tanh() * limit
}

/// `x`, or the nearest of the limits as a constant.
#[inline]
pub(super) fn clamped<T: Number>(x: T, low: f64, high: f64) -> T {
    match x.value() {
        value if value < low => T::of(low),
        value if value > high => T::of(high),
        _ => x,
    }
}

/// A symmetric matrix in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Symmetric<T> {
    /// First element of the diagonal.
    pub xx: T,
    /// The element beside it.
    pub xy: T,
    /// Second element of the diagonal.
    pub yy: T,
}

impl<T: Number> Symmetric<T> {
    /// `[a 0; b c] [a 0; b c]ᵀ`.
    pub fn of_factor(a: T, b: T, c: T) -> Self {
        Symmetric { xx: a * a, xy: a * b, yy: b * b + c * c }
    }

    /// The same matrix of numbers of another kind.
    pub fn constant(matrix: &Symmetric<f64>) -> Self {
        Symmetric { xx: T::of(matrix.xx), xy: T::of(matrix.xy), yy: T::of(matrix.yy) }
    }

    /// The sum of two.
    pub fn plus(&self, other: &Self) -> Self {
        Symmetric { xx: self.xx + other.xx, xy: self.xy + other.xy, yy: self.yy + other.yy }
    }

    /// This, scaled.
    pub fn scaled(&self, factor: T) -> Self {
        Symmetric { xx: self.xx * factor, xy: self.xy * factor, yy: self.yy * factor }
    }

    /// The determinant.
    pub fn determinant(&self) -> T {
        self.xx * self.yy - self.xy * self.xy
    }

    /// The inverse, without a test.
    pub fn inverse(&self) -> Self {
        let scale = T::of(1.0) / self.determinant();
        Symmetric { xx: self.yy * scale, xy: -self.xy * scale, yy: self.xx * scale }
    }

    /// The product with a vector.
    pub fn times(&self, v: [T; 2]) -> [T; 2] {
        [self.xx * v[0] + self.xy * v[1], self.xy * v[0] + self.yy * v[1]]
    }

    /// The form `uᵀ M v`.
    pub fn form(&self, u: [T; 2], v: [T; 2]) -> T {
        let product = self.times(v);
        u[0] * product[0] + u[1] * product[1]
    }

    /// `R M Rᵀ` with the rotation that takes the first axis to `(cosine, sine)`.
    pub fn turned(&self, [cosine, sine]: [T; 2]) -> Self {
        let (cc, ss, cs) = (cosine * cosine, sine * sine, cosine * sine);
        let twice = cs * self.xy * 2.0;
        Symmetric {
            xx: cc * self.xx + ss * self.yy - twice,
            xy: cs * (self.xx - self.yy) + (cc - ss) * self.xy,
            yy: ss * self.xx + cc * self.yy + twice,
        }
    }

    /// The symmetric root of a positive definite matrix.
    pub fn root(&self) -> Self {
        let determinant = self.determinant().sqrt();
        let length = (self.xx + self.yy + determinant * 2.0).sqrt();
        let scale = T::of(1.0) / length;
        Symmetric {
            xx: (self.xx + determinant) * scale,
            xy: self.xy * scale,
            yy: (self.yy + determinant) * scale,
        }
    }

    /// The product with another, row by row.
    pub(super) fn product(&self, other: &Self) -> [[T; 2]; 2] {
        let columns = [[other.xx, other.xy], [other.xy, other.yy]].map(|column| self.times(column));
        [[columns[0][0], columns[1][0]], [columns[0][1], columns[1][1]]]
    }

    /// `A M Aᵀ` with the rows of `A`.
    pub(super) fn between(&self, a: &[[T; 2]; 2]) -> Self {
        Symmetric { xx: self.form(a[0], a[0]), xy: self.form(a[0], a[1]), yy: self.form(a[1], a[1]) }
    }
}
