//! The probabilities of changes between modes over any step.

use nalgebra::DMatrix;

/// Modes and the probabilities of their changes over any step: the Kronecker product of independent links.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::filter) struct Chain {
    pub(super) modes: usize,
    links: Vec<Link>,
    /// The product itself, row by row, when it is the same for every step.
    fixed: Option<Vec<f64>>,
}

impl Chain {
    pub(super) fn new(modes: usize, links: Vec<Link>) -> Chain {
        let mut chain = Chain { modes, links, fixed: None };
        if chain.links.iter().all(|link| link.rate.is_none()) {
            let mut work = Vec::new();
            chain.fixed = Some(chain.over(0.0, &mut work).to_vec());
        }
        chain
    }

    /// The probabilities of changes over `dt`, row by row. `work` is overwritten and holds them when they had to be computed.
    pub fn over<'a>(&'a self, dt: f64, work: &'a mut Vec<f64>) -> &'a [f64] {
        if let Some(fixed) = &self.fixed {
            return fixed;
        }
        let size = self.modes * self.modes;
        let largest = self.links.iter().map(|link| link.modes * link.modes).max().unwrap_or(0);
        work.clear();
        work.resize(size + 3 * largest, 0.0);
        let (whole, work) = work.split_at_mut(size);
        whole[0] = 1.0;
        let mut modes = 1;
        for link in &self.links {
            kronecker(whole, modes, link.over(dt, work), link.modes);
            modes *= link.modes;
        }
        whole
    }
}

/// Multiplies the `n` x `n` matrix at the beginning of `whole` by one of `m` x `m`, in place.
fn kronecker(whole: &mut [f64], n: usize, factor: &[f64], m: usize) {
    // From the end: an entry is read before any of those that come from it is written over it.
    for (i, k) in (0..n).rev().flat_map(|i| (0..m).rev().map(move |k| (i, k))) {
        for j in (0..n).rev() {
            let (value, start) = (whole[i * n + j], ((i * m + k) * n + j) * m);
            for l in (0..m).rev() {
                whole[start + l] = value * factor[k * m + l];
            }
        }
    }
}

/// A chain that is not made of others.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Link {
    modes: usize,
    /// Row by row: probabilities of a step, or the generator divided by `rate`, plus the identity.
    matrix: Vec<f64>,
    rate: Option<f64>,
    /// An interval and the probabilities over it, as they were stated: most scans come at this interval.
    stated: Option<(f64, Vec<f64>)>,
}

impl Link {
    /// The same probabilities over every step.
    pub fn steps(matrix: &DMatrix<f64>) -> Link {
        Link { modes: matrix.nrows(), matrix: rows_of(matrix), rate: None, stated: None }
    }

    /// A process in continuous time.
    pub fn rates(generator: &DMatrix<f64>) -> Link {
        let modes = generator.nrows();
        let rate = generator.diagonal().iter().fold(0.0_f64, |top, x| top.max(-x)).max(f64::MIN_POSITIVE);
        let jumps = DMatrix::identity(modes, modes) + generator / rate;
        Link { modes, matrix: rows_of(&jumps), rate: Some(rate), stated: None }
    }

    /// The same with the probabilities over `interval` as they were stated.
    pub fn stated(self, matrix: &DMatrix<f64>, interval: f64) -> Link {
        Link { stated: Some((interval, rows_of(matrix))), ..self }
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
