//! How an object changes between modes of motion.

mod chain;

use nalgebra::DMatrix;

use crate::error::FilterError;

use chain::Link;
pub(super) use chain::{Chain, Leap};

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
    Joint(Vec<(Transition, usize)>),
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

    /// Several things that change independently of each other, each with its number of modes: a mode of the whole is one mode
    /// of each part, and those of the last part run fastest. With turn rates `r0, r1` and noise levels `a, b, c` the modes are
    /// `r0 a, r0 b, r0 c, r1 a, r1 b, r1 c`.
    ///
    /// The matrix is the Kronecker product `Π₁ ⊗ Π₂ ⊗ ..` of those of the parts; for parts in continuous time, the exponential
    /// of the Kronecker sum of their generators. Parts per step and parts per time may stand side by side.
    ///
    /// Whether each part fits its number of modes is checked when the filter is built.
    ///
    /// An object that turns at one of three rates, seen by a radar whose accuracy is not known but stays as it is:
    ///
    /// ```
    /// use tercel_core::{filter::{Filter, Imm, Kalman, Transition}, motion::Turn, sensor::Position};
    ///
    /// let (rates, levels) = ([0.0, 0.1, -0.1], [2.0, 8.0, 32.0]);
    /// let mut bank = Vec::new();
    /// for rate in rates {
    ///     for level in levels {
    ///         bank.push(Kalman::new(Turn::new(rate, 0.1), Position::<2>::new(level)?));
    ///     }
    /// }
    /// let (turns, noise) = (Transition::sticky(0.95).per(1.0), Transition::sticky(1.0));
    /// let imm = Imm::new(bank, Transition::joint([(turns, rates.len()), (noise, levels.len())]))?;
    ///
    /// let mut belief = imm.birth(&[0.0, 0.0].into())?;
    /// for second in 1..=40 {
    ///     // A straight flight, with errors of about eight metres.
    ///     let error = [9.0, -4.0, 7.0, -11.0, 3.0, -8.0, 10.0][second % 7];
    ///     imm.predict(&mut belief, 1.0);
    ///     imm.update(&mut belief, &[50.0 * second as f64 + error, -error].into())?;
    /// }
    /// let modes = imm.mode_probabilities(&belief);
    /// let level = |l: usize| -> f64 { (0..rates.len()).map(|r| modes[r * levels.len() + l]).sum() };
    /// assert!(level(1) > 0.99, "{modes:?}");
    /// # Ok::<(), tercel_core::error::FilterError>(())
    /// ```
    pub fn joint(parts: impl IntoIterator<Item = (Transition, usize)>) -> Self {
        Transition { form: Form::Joint(parts.into_iter().collect()), interval: None }
    }

    /// Says that the probabilities hold over `interval` seconds, so that they scale with the length of a step. Rates
    /// scale anyway, and stay as they are. Of a [`joint`](Transition::joint) transition it says so of every part.
    ///
    /// Not every matrix belongs to a process in continuous time. That this one does is checked when the filter is built;
    /// every diagonal entry must exceed one half.
    pub fn per(self, interval: f64) -> Self {
        Transition { interval: Some(interval), ..self }
    }

    /// The chain over this many modes.
    pub(super) fn chain(&self, modes: usize) -> Result<Chain, FilterError> {
        let mut links = Vec::new();
        let size = self.link(modes, self.interval, &mut links)?;
        if size != modes {
            let (parameter, expected) = ("number of modes", "must be the size of the transition matrix");
            return Err(FilterError::Parameter { parameter, value: modes as f64, expected });
        }
        Ok(Chain::new(modes, links))
    }

    /// Appends the independent parts of this transition between `modes` modes, when their probabilities hold over `interval`,
    /// and returns the number of modes that they have together.
    fn link(&self, modes: usize, interval: Option<f64>, links: &mut Vec<Link>) -> Result<usize, FilterError> {
        let matrix = match &self.form {
            Form::Joint(parts) => {
                return parts.iter().try_fold(1_usize, |size, (part, modes)| {
                    let own = part.link(*modes, interval.or(part.interval), links)?;
                    if own != *modes {
                        let parameter = "number of modes of a part of a joint transition";
                        let expected = "must be the size of the part's transition matrix, at least 1";
                        return Err(FilterError::Parameter { parameter, value: *modes as f64, expected });
                    }
                    Ok(size.saturating_mul(own))
                });
            }
            Form::Sticky(stay) => sticky(FilterError::probability("stay", *stay)?, modes.max(1)),
            Form::Rows(matrix) | Form::Rates(matrix) => matrix.clone(),
        };
        links.push(match (&self.form, interval) {
            (Form::Rates(_), _) => Link::rates(&matrix),
            (_, None) => Link::steps(&matrix),
            (_, Some(interval)) => {
                let interval = FilterError::positive("transition interval", interval)?;
                Link::rates(&(generator(&matrix)? / interval)).stated(&matrix, interval)
            }
        });
        Ok(matrix.nrows())
    }
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
mod tests;
