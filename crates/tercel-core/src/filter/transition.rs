//! How an object changes between modes of motion.

use nalgebra::DMatrix;

use crate::error::FilterError;

/// How probable each change of mode is, over a step or over time.
///
/// ## Definition
/// A matrix `Π` whose row `i` holds the probabilities of the next mode when the last one was `i`. The form of the
/// literature is per step: one prediction is one step, however long. When scans come at irregular times, give rates, or an
/// interval with [`per`](Transition::per): then `Π(dt) = exp(G dt)`, and two predictions of `dt` change as many modes as one
/// of `2 dt`.
///
/// ```
/// use tercel_core::filter::Transition;
///
/// let paper = Transition::sticky(0.95);
/// let scans_every_three_seconds = Transition::sticky(0.95).per(3.0);
/// let asymmetric = Transition::from_rows([[0.97, 0.03], [0.10, 0.90]])?;
/// let manoeuvres = Transition::from_rates([[0.0, 0.01], [0.05, 0.0]])?; // every 100 s, for 20 s
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Transition {
    form: Form,
    interval: Option<f64>,
}

#[derive(Debug, Clone, PartialEq)]
enum Form {
    Sticky(f64),
    Rows(DMatrix<f64>),
    Rates(DMatrix<f64>),
}

/// How far a row of probabilities may be from the sum of one.
const ROW_TOLERANCE: f64 = 1e-9;

impl Transition {
    /// Stays in a mode with probability `stay` and changes to each other one alike. With a single mode, `stay` has no effect.
    ///
    /// Whether `stay` is a probability is checked when the filter is built.
    pub fn sticky(stay: f64) -> Self {
        Transition { form: Form::Sticky(stay), interval: None }
    }

    /// Any matrix of probabilities over one step, row by row.
    ///
    /// # Errors
    /// When the matrix is empty or not square, an entry is not a probability, or a row does not add up to one.
    pub fn from_rows<R: AsRef<[f64]>>(rows: impl IntoIterator<Item = R>) -> Result<Self, FilterError> {
        let mut matrix = square(rows)?;
        for mut row in matrix.row_iter_mut() {
            for &value in row.iter() {
                FilterError::probability("transition probability", value)?;
            }
            let sum = row.sum();
            if (sum - 1.0).abs() > ROW_TOLERANCE {
                let (parameter, expected) = ("sum of a row of transition probabilities", "must be 1");
                return Err(FilterError::Parameter { parameter, value: sum, expected });
            }
            row /= sum;
        }
        Ok(Transition { form: Form::Rows(matrix), interval: None })
    }

    /// Rates of change between modes, 1/s, row by row: an object in mode `i` changes to `j` about every `1 / rate` seconds.
    /// The diagonal is not read.
    ///
    /// # Errors
    /// When the matrix is empty or not square, or a rate is negative or not finite.
    pub fn from_rates<R: AsRef<[f64]>>(rows: impl IntoIterator<Item = R>) -> Result<Self, FilterError> {
        let mut matrix = square(rows)?;
        for i in 0..matrix.nrows() {
            matrix[(i, i)] = 0.0;
            for &value in matrix.row(i).iter() {
                if !(value >= 0.0 && value.is_finite()) {
                    let (parameter, expected) = ("transition rate", "must be finite and not negative, 1/s");
                    return Err(FilterError::Parameter { parameter, value, expected });
                }
            }
            matrix[(i, i)] = -matrix.row(i).sum();
        }
        Ok(Transition { form: Form::Rates(matrix), interval: None })
    }

    /// Says that the probabilities hold over `interval` seconds, so that they scale with the length of a step. Rates
    /// scale anyway, and stay as they are.
    ///
    /// Not every matrix belongs to a process in continuous time. That this one does is checked when the filter is built;
    /// every diagonal entry must exceed one half.
    pub fn per(self, interval: f64) -> Self {
        Transition { interval: Some(interval), ..self }
    }

    /// The chain over this many modes.
    pub(super) fn chain(&self, modes: usize) -> Result<Chain, FilterError> {
        let matrix = match &self.form {
            Form::Sticky(stay) => sticky(FilterError::probability("stay", *stay)?, modes),
            Form::Rows(matrix) | Form::Rates(matrix) => matrix.clone(),
        };
        if matrix.nrows() != modes {
            let (parameter, expected) = ("number of modes", "must be the size of the transition matrix");
            return Err(FilterError::Parameter { parameter, value: modes as f64, expected });
        }
        match (&self.form, self.interval) {
            (Form::Rates(_), _) => Ok(Chain::rates(&matrix)),
            (_, None) => Ok(Chain { modes, matrix: rows_of(&matrix), rate: None }),
            (_, Some(interval)) => {
                let interval = FilterError::positive("transition interval", interval)?;
                Ok(Chain::rates(&(generator(&matrix)? / interval)))
            }
        }
    }
}

/// Modes and the probabilities of their changes over any step.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chain {
    modes: usize,
    /// Row by row: probabilities of a step, or the generator divided by `rate`, plus the identity.
    matrix: Vec<f64>,
    rate: Option<f64>,
}

impl Chain {
    fn rates(generator: &DMatrix<f64>) -> Chain {
        let modes = generator.nrows();
        let rate = generator.diagonal().iter().fold(0.0_f64, |top, x| top.max(-x)).max(f64::MIN_POSITIVE);
        let jumps = DMatrix::identity(modes, modes) + generator / rate;
        Chain { modes, matrix: rows_of(&jumps), rate: Some(rate) }
    }

    /// The probabilities of changes over `dt`, row by row. `work` is overwritten and holds them when they had to be computed.
    pub fn over<'a>(&'a self, dt: f64, work: &'a mut Vec<f64>) -> &'a [f64] {
        let Some(rate) = self.rate else {
            return &self.matrix;
        };
        let size = self.modes * self.modes;
        work.clear();
        work.resize(3 * size, 0.0);
        let (sum, rest) = work.split_at_mut(size);
        let (power, next) = rest.split_at_mut(size);
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
        &work[..size]
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

fn sticky(stay: f64, modes: usize) -> DMatrix<f64> {
    if modes == 1 {
        return DMatrix::identity(1, 1);
    }
    let change = (1.0 - stay) / (modes as f64 - 1.0);
    DMatrix::from_fn(modes, modes, |i, j| if i == j { stay } else { change })
}

fn square<R: AsRef<[f64]>>(rows: impl IntoIterator<Item = R>) -> Result<DMatrix<f64>, FilterError> {
    let rows: Vec<R> = rows.into_iter().collect();
    let size = rows.len();
    let error = |value: usize| FilterError::Parameter {
        parameter: "length of a row of the transition matrix",
        value: value as f64,
        expected: "must be the number of rows, at least 1",
    };
    match rows.iter().map(|row| row.as_ref().len()).find(|&length| length != size) {
        Some(length) => Err(error(length)),
        None if size == 0 => Err(error(0)),
        None => Ok(DMatrix::from_fn(size, size, |i, j| rows[i].as_ref()[j])),
    }
}

/// The logarithm of a matrix of probabilities, when it generates a process in continuous time.
fn generator(matrix: &DMatrix<f64>) -> Result<DMatrix<f64>, FilterError> {
    let size = matrix.nrows();
    let stay = matrix.diagonal().min();
    let (parameter, expected) = (
        "smallest probability to stay in a mode over the interval",
        "must exceed 1/2, and the matrix must belong to a process in continuous time: shorten the interval",
    );
    let refused = FilterError::Parameter { parameter, value: stay, expected };
    if stay <= 0.5 {
        return Err(refused);
    }
    // ln Π = Σ (-1)ⁿ⁺¹ (Π - I)ⁿ / n, which converges because all eigenvalues of Π - I are shorter than 1.
    let difference = matrix - DMatrix::identity(size, size);
    let (mut power, mut sum) = (difference.clone(), difference.clone());
    for n in 2..100_000 {
        power = -&power * &difference;
        let term = &power / f64::from(n);
        sum += &term;
        if term.amax() < 1e-17 {
            break;
        }
    }
    for i in 0..size {
        for j in (0..size).filter(|&j| j != i) {
            if sum[(i, j)] < -1e-12 {
                return Err(refused);
            }
            sum[(i, j)] = sum[(i, j)].max(0.0);
        }
        sum[(i, i)] = 0.0;
        sum[(i, i)] = -sum.row(i).sum();
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn over(chain: &Chain, dt: f64) -> DMatrix<f64> {
        let mut work = Vec::new();
        DMatrix::from_row_slice(chain.modes, chain.modes, chain.over(dt, &mut work))
    }

    #[test]
    fn an_interval_gives_the_stated_probabilities_back_and_scales_between() {
        let rows = [[0.9, 0.08, 0.02], [0.05, 0.9, 0.05], [0.01, 0.04, 0.95]];
        let chain = Transition::from_rows(rows).unwrap().per(3.0).chain(3).unwrap();
        let stated = DMatrix::from_fn(3, 3, |i, j| rows[i][j]);
        assert!((over(&chain, 3.0) - &stated).amax() < 1e-14);
        assert!((over(&chain, 6.0) - &stated * &stated).amax() < 1e-14);
        assert!((over(&chain, 1.3) * over(&chain, 1.7) - &stated).amax() < 1e-14);
        assert_eq!(over(&chain, 0.0), DMatrix::identity(3, 3));
    }

    #[test]
    fn rates_of_two_modes_agree_with_the_closed_form() {
        let (out, back) = (0.02, 0.3);
        let chain = Transition::from_rates([[0.0, out], [back, 0.0]]).unwrap().chain(2).unwrap();
        for dt in [1e-3, 1.0, 7.0, 1e3, 1e9] {
            let change = out / (out + back) * -f64::exp_m1(-(out + back) * dt);
            assert!((over(&chain, dt)[(0, 1)] - change).abs() < 1e-14, "{dt}");
        }
    }

    #[test]
    fn a_step_is_a_step_however_long() {
        let chain = Transition::sticky(0.9).chain(3).unwrap();
        assert_eq!(over(&chain, 0.1), over(&chain, 10.0));
        assert!((over(&chain, 1.0)[(0, 1)] - 0.05).abs() < 1e-16);
    }

    #[test]
    fn what_is_not_a_transition_is_refused() {
        assert!(Transition::from_rows([[0.9, 0.2], [0.1, 0.9]]).is_err());
        assert!(Transition::from_rows([[1.1, -0.1], [0.1, 0.9]]).is_err());
        assert!(Transition::from_rows([vec![1.0], vec![0.5, 0.5]]).is_err());
        assert!(Transition::from_rows(Vec::<Vec<f64>>::new()).is_err());
        assert!(Transition::from_rates([[0.0, -1.0], [1.0, 0.0]]).is_err());
        assert!(Transition::sticky(1.2).chain(2).is_err());
        assert!(Transition::sticky(0.4).per(1.0).chain(2).is_err());
        assert!(Transition::from_rows([[0.9, 0.1], [0.1, 0.9]]).unwrap().chain(3).is_err());
        // A cycle that only turns one way skips a mode faster than any process in continuous time could.
        let cycle = [[0.8, 0.2, 0.0], [0.0, 0.8, 0.2], [0.2, 0.0, 0.8]];
        assert!(Transition::from_rows(cycle).unwrap().per(1.0).chain(3).is_err());
    }
}
