//! Numbers that record how they were computed, for the derivatives of a step that is written once for training and run time.
//!
//! Where a recursion consists of some hundred operations on single numbers, tensors cost more than the arithmetic. Such a step
//! is computed with [`Variable`] in the backward pass of an operation, one member of the batch after the other, on a [`Tape`]
//! that is used again.

use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

use tercel_neural::filter::rmm_net::Number;

/// What was computed, in order.
#[derive(Debug, Default)]
pub struct Tape {
    steps: RefCell<Vec<Step>>,
}

/// One operation: the places of its operands, and the derivatives with respect to them.
#[derive(Debug, Clone, Copy)]
struct Step {
    operands: [u32; 2],
    slopes: [f64; 2],
}

/// A number on a tape, or a constant.
#[derive(Debug, Clone, Copy)]
pub struct Variable<'t> {
    tape: Option<&'t Tape>,
    place: u32,
    value: f64,
}

impl Tape {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.steps.get_mut().clear();
    }

    /// A number of which derivatives are wanted.
    pub fn variable(&self, value: f64) -> Variable<'_> {
        self.push([0; 2], [0.0; 2], value)
    }

    fn push(&self, operands: [u32; 2], slopes: [f64; 2], value: f64) -> Variable<'_> {
        let mut steps = self.steps.borrow_mut();
        let place = steps.len() as u32;
        steps.push(Step { operands, slopes });
        Variable { tape: Some(self), place, value }
    }

    /// Derivatives of a weighted sum of numbers with respect to all that was computed, by place.
    pub fn slopes(&self, of: &[(Variable<'_>, f64)], slopes: &mut Vec<f64>) {
        let steps = self.steps.borrow();
        slopes.clear();
        slopes.resize(steps.len(), 0.0);
        for (variable, weight) in of.iter().filter(|(variable, _)| variable.tape.is_some()) {
            slopes[variable.place as usize] += weight;
        }
        for (place, step) in steps.iter().enumerate().rev() {
            let slope = slopes[place];
            if slope != 0.0 {
                for (operand, own) in step.operands.iter().zip(step.slopes) {
                    // A missing operand has no slope; what is not finite must not turn zero into it.
                    if own != 0.0 {
                        slopes[*operand as usize] += slope * own;
                    }
                }
            }
        }
    }
}

impl<'t> Variable<'t> {
    /// The place on the tape.
    pub fn place(&self) -> usize {
        self.place as usize
    }

    fn of_one(self, value: f64, slope: f64) -> Self {
        match self.tape {
            Some(tape) => tape.push([self.place, 0], [slope, 0.0], value),
            None => Variable::of(value),
        }
    }

    fn of_two(self, other: Self, value: f64, slopes: [f64; 2]) -> Self {
        match (self.tape, other.tape) {
            (Some(tape), Some(_)) => tape.push([self.place, other.place], slopes, value),
            (Some(_), None) => self.of_one(value, slopes[0]),
            (None, Some(_)) => other.of_one(value, slopes[1]),
            (None, None) => Variable::of(value),
        }
    }

    /// The logarithm of the gamma function of a positive number.
    pub fn ln_gamma(self) -> Self {
        // Stirling's series, from where it is accurate to 1e-10.
        let mut shift = Variable::of(1.0);
        let mut x = self;
        while x.value < 8.0 {
            shift = shift * x;
            x = x + 1.0;
        }
        let inverse = Variable::of(1.0) / x;
        let square = inverse * inverse;
        let series = inverse * ((square * (1.0 / 1260.0) + -1.0 / 360.0) * square + 1.0 / 12.0);
        (x + -0.5) * x.ln() + -x + series + 0.5 * std::f64::consts::TAU.ln() + -shift.ln()
    }
}

impl Add for Variable<'_> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.of_two(other, self.value + other.value, [1.0, 1.0])
    }
}

impl Sub for Variable<'_> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.of_two(other, self.value - other.value, [1.0, -1.0])
    }
}

impl Mul for Variable<'_> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.of_two(other, self.value * other.value, [other.value, self.value])
    }
}

impl Div for Variable<'_> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        self.of_two(other, value, [1.0 / other.value, -value / other.value])
    }
}

impl Neg for Variable<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        self.of_one(-self.value, -1.0)
    }
}

impl Mul<f64> for Variable<'_> {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        self.of_one(self.value * factor, factor)
    }
}

impl Add<f64> for Variable<'_> {
    type Output = Self;
    fn add(self, other: f64) -> Self {
        Variable { value: self.value + other, ..self }
    }
}

impl Number for Variable<'_> {
    fn of(value: f64) -> Self {
        Variable { tape: None, place: 0, value }
    }
    fn value(self) -> f64 {
        self.value
    }
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.of_one(root, 0.5 / root)
    }
    fn exp(self) -> Self {
        let value = self.value.exp();
        self.of_one(value, value)
    }
    fn ln(self) -> Self {
        self.of_one(self.value.ln(), 1.0 / self.value)
    }
    fn tanh(self) -> Self {
        let value = self.value.tanh();
        self.of_one(value, 1.0 - value * value)
    }
    fn sin(self) -> Self {
        let (sine, cosine) = self.value.sin_cos();
        self.of_one(sine, cosine)
    }
    fn cos(self) -> Self {
        let (sine, cosine) = self.value.sin_cos();
        self.of_one(cosine, -sine)
    }
    fn atan2(self, x: Self) -> Self {
        let square = (self.value * self.value + x.value * x.value).max(f64::MIN_POSITIVE);
        self.of_two(x, self.value.atan2(x.value), [x.value / square, -self.value / square])
    }
}
