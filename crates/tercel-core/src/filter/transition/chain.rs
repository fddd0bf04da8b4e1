//! The probabilities of changes between modes over any step.

use nalgebra::DMatrix;

/// Modes and the probabilities of their changes over any step: the Kronecker product of independent links, the first of which
/// changes slowest along the modes.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::filter) struct Chain {
    pub(super) modes: usize,
    links: Vec<Link>,
}

/// A link over one step.
#[derive(Debug, Clone, Copy)]
pub(in crate::filter) struct Leap<'a> {
    /// Values that the link has.
    pub modes: usize,
    /// From one of its values to the next, in modes of the chain.
    pub stride: usize,
    /// Probabilities of changes, row by row.
    pub probabilities: &'a [f64],
    /// The probability to stay and that of each other value, when they are the same for all values.
    pub even: Option<[f64; 2]>,
}

impl Chain {
    pub(super) fn new(modes: usize, links: Vec<Link>) -> Chain {
        Chain { modes, links }
    }

    /// Calls `work` with each link over `dt` that changes anything. `room` is overwritten.
    pub fn leap(&self, dt: f64, room: &mut Vec<f64>, mut work: impl FnMut(Leap<'_>)) {
        let largest =
            self.links.iter().filter(|link| link.rate.is_some()).map(|link| link.modes.pow(2)).max();
        room.resize(3 * largest.unwrap_or(0), 0.0);
        let mut stride = self.modes;
        for link in &self.links {
            stride /= link.modes;
            let probabilities = link.over(dt, room);
            let even = link.even.then(|| [probabilities[0], *probabilities.get(1).unwrap_or(&0.0)]);
            if link.modes > 1 && even != Some([1.0, 0.0]) {
                work(Leap { modes: link.modes, stride, probabilities, even });
            }
        }
    }
}

impl Leap<'_> {
    /// The sets of modes of a chain of `modes` modes that differ in this link alone: the first of each set.
    pub fn groups(&self, modes: usize) -> impl Iterator<Item = usize> + use<> {
        let (stride, size) = (self.stride, self.stride * self.modes);
        (0..modes / size).flat_map(move |outer| (0..stride).map(move |inner| outer * size + inner))
    }
}

/// A chain that is not made of others.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Link {
    modes: usize,
    /// Row by row: probabilities of a step, or the generator divided by `rate`, plus the identity.
    matrix: Vec<f64>,
    rate: Option<f64>,
    /// Whether staying is equally probable in all modes, and so are all changes. It then is over any step.
    even: bool,
    /// An interval and the probabilities over it, as they were stated: most scans come at this interval.
    stated: Option<(f64, Vec<f64>)>,
}

impl Link {
    /// The same probabilities over every step.
    pub fn steps(matrix: &DMatrix<f64>) -> Link {
        Link { modes: matrix.nrows(), matrix: rows_of(matrix), rate: None, even: even(matrix), stated: None }
    }

    /// A process in continuous time.
    pub fn rates(generator: &DMatrix<f64>) -> Link {
        let modes = generator.nrows();
        let rate = generator.diagonal().iter().fold(0.0_f64, |top, x| top.max(-x)).max(f64::MIN_POSITIVE);
        let jumps = DMatrix::identity(modes, modes) + generator / rate;
        Link { modes, matrix: rows_of(&jumps), rate: Some(rate), even: even(&jumps), stated: None }
    }

    /// The same with the probabilities over `interval` as they were stated.
    pub fn stated(self, matrix: &DMatrix<f64>, interval: f64) -> Link {
        Link { stated: Some((interval, rows_of(matrix))), even: self.even && even(matrix), ..self }
    }

    /// The probabilities of changes over `dt`, row by row, in the matrix itself or in `work`, of three times its size.
    fn over<'a>(&'a self, dt: f64, work: &'a mut [f64]) -> &'a [f64] {
        let Some(rate) = self.rate else {
            return &self.matrix;
        };
        if let Some((_, stated)) = self.stated.as_ref().filter(|(interval, _)| *interval == dt) {
            return stated;
        }
        let size = self.modes * self.modes;
        let (sum, rest) = work.split_at_mut(size);
        let (power, rest) = rest.split_at_mut(size);
        let next = &mut rest[..size];
        sum.fill(0.0);
        power.fill(0.0);
        // exp(G t) = Σ e^(-λt) (λt)ⁿ / n! Jⁿ with the jump matrix J = I + G / λ: a sum of probabilities, so nothing
        // cancels. Long steps are halved until the series is short, and squared back.
        let halvings = if rate * dt > 1.0 { (rate * dt).log2().ceil().min(60.0) as i32 } else { 0 };
        let jumps = rate * dt * 0.5_f64.powi(halvings);
        let mut weight = (-jumps).exp();
        for i in 0..self.modes {
            power[i * self.modes + i] = 1.0;
            sum[i * self.modes + i] = weight;
        }
        for n in 1..24 {
            product(self.modes, power, &self.matrix, next);
            power.copy_from_slice(next);
            weight *= jumps / f64::from(n);
            for (total, value) in sum.iter_mut().zip(power.iter()) {
                *total += weight * value;
            }
            if weight < 1e-18 {
                break;
            }
        }
        for _ in 0..halvings {
            product(self.modes, sum, sum, next);
            sum.copy_from_slice(next);
            // Squaring doubles what rounding added to a row; dividing by its sum keeps it a row of probabilities.
            for row in sum.chunks_exact_mut(self.modes) {
                let total: f64 = row.iter().sum();
                row.iter_mut().for_each(|value| *value /= total);
            }
        }
        sum
    }
}

fn even(matrix: &DMatrix<f64>) -> bool {
    let change = if matrix.nrows() > 1 { matrix[(0, 1)] } else { 0.0 };
    let expected = |i, j| if i == j { matrix[(0, 0)] } else { change };
    let places = (0..matrix.nrows()).flat_map(|i| (0..matrix.nrows()).map(move |j| (i, j)));
    // What a logarithm leaves of equal numbers may differ in its last digits.
    places.into_iter().all(|(i, j)| (matrix[(i, j)] - expected(i, j)).abs() <= 1e-14)
}

fn product(n: usize, a: &[f64], b: &[f64], out: &mut [f64]) {
    for i in 0..n {
        for j in 0..n {
            out[i * n + j] = (0..n).map(|k| a[i * n + k] * b[k * n + j]).sum();
        }
    }
}

fn rows_of(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}
