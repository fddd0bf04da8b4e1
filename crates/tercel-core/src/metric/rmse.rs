//! Root mean square errors of one object's state.

use std::ops::Range;

use nalgebra::SVector;

/// Collects the errors of a state of `N` components and gives their root mean squares.
///
/// ## Definition
/// Two readings of "RMSE" are in use, and differ by a factor `sqrt(2)` in the plane. Over steps `t = 1..T` and the
/// components `i` of a set `S`:
/// ```text
/// element   = sqrt( 1/(T |S|) Σ_t Σ_(i∈S) e_i(t)² )
/// Euclidean = sqrt( 1/T       Σ_t Σ_(i∈S) e_i(t)² )
/// ```
/// States are ordered as in [`Gaussian`](crate::belief::Gaussian): positions, then velocities, then the rest.
///
/// | name in tables | method |
/// |---|---|
/// | `rmse_all` | [`all`](Rmse::all): element, all components |
/// | `rmse_pos` | [`position`](Rmse::position): element, positions |
/// | `rmse_vel` | [`velocity`](Rmse::velocity): element, velocities |
/// | `rmse_pos_norm` | [`position_norm`](Rmse::position_norm): Euclidean, positions |
///
/// ## Use it when
/// one object is followed and its identity is known. A study takes one value per run and averages the values; merging the
/// accumulators of all runs instead gives the root of the mean over all, which is larger.
///
/// ```
/// use tercel_core::metric::Rmse;
/// use nalgebra::vector;
///
/// let mut rmse = Rmse::<4>::plane();
/// rmse.push(&vector![3.0, 4.0, 0.0, 1.0]);
/// assert_eq!(rmse.position_norm(), Some(5.0));
/// assert_eq!(rmse.position(), Some(12.5_f64.sqrt()));
/// assert_eq!(rmse.velocity(), Some(0.5_f64.sqrt()));
/// assert_eq!(rmse.all(), Some(6.5_f64.sqrt()));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rmse<const N: usize> {
    space: usize,
    count: u64,
    squares: SVector<f64, N>,
}

impl<const N: usize> Rmse<N> {
    /// No errors yet; `x, y, vx, vy, ..` in the plane.
    pub fn plane() -> Self {
        const { assert!(N >= 4, "a state in the plane has two positions and two velocities") };
        Rmse { space: 2, count: 0, squares: SVector::zeros() }
    }

    /// No errors yet; `x, y, z, vx, vy, vz, ..` in space.
    pub fn space() -> Self {
        const { assert!(N >= 6, "a state in space has three positions and three velocities") };
        Rmse { space: 3, count: 0, squares: SVector::zeros() }
    }

    /// Takes one more error: estimate minus truth, or the reverse.
    pub fn push(&mut self, error: &SVector<f64, N>) {
        self.count += 1;
        self.squares += error.component_mul(error);
    }

    /// Takes all errors of another accumulator.
    pub fn merge(&mut self, other: &Rmse<N>) {
        self.count += other.count;
        self.squares += other.squares;
    }

    /// How many errors were taken.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Element mean over all components; `None` before the first error.
    pub fn all(&self) -> Option<f64> {
        self.element(0..N)
    }

    /// Element mean over the positions (m); `None` before the first error.
    pub fn position(&self) -> Option<f64> {
        self.element(0..self.space)
    }

    /// Element mean over the velocities (m/s); `None` before the first error.
    pub fn velocity(&self) -> Option<f64> {
        self.element(self.space..2 * self.space)
    }

    /// Euclidean position error (m); `None` before the first error.
    pub fn position_norm(&self) -> Option<f64> {
        self.euclidean(0..self.space)
    }

    /// Element mean over some components; `None` before the first error, or when no such components exist.
    pub fn element(&self, components: Range<usize>) -> Option<f64> {
        let width = components.len() as f64;
        Some((self.mean_square(components)? / width).sqrt())
    }

    /// Euclidean error over some components; `None` before the first error, or when no such components exist.
    pub fn euclidean(&self, components: Range<usize>) -> Option<f64> {
        self.mean_square(components).map(f64::sqrt)
    }

    fn mean_square(&self, components: Range<usize>) -> Option<f64> {
        let squares = self.squares.as_slice().get(components).filter(|part| !part.is_empty())?;
        (self.count > 0).then(|| squares.iter().sum::<f64>() / self.count as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    #[test]
    fn merged_runs_are_one_long_run() {
        let errors =
            [vector![1.0, 2.0, 3.0, 4.0], vector![-2.0, 0.5, 0.0, 1.0], vector![0.1, 0.2, -7.0, 1.0]];
        let (mut whole, mut first, mut rest) = (Rmse::<4>::plane(), Rmse::plane(), Rmse::plane());
        errors.iter().for_each(|error| whole.push(error));
        first.push(&errors[0]);
        errors[1..].iter().for_each(|error| rest.push(error));
        first.merge(&rest);
        assert_eq!(first.count(), 3);
        assert!((first.all().unwrap() - whole.all().unwrap()).abs() < 1e-15);
    }

    #[test]
    fn the_euclidean_error_is_the_element_error_times_the_root_of_the_width() {
        let mut rmse = Rmse::<9>::space();
        rmse.push(&SVector::from_fn(|i, _| i as f64));
        assert!((rmse.position_norm().unwrap() - rmse.position().unwrap() * 3f64.sqrt()).abs() < 1e-15);
        assert_eq!(rmse.velocity(), Some((50.0f64 / 3.0).sqrt()));
    }

    #[test]
    fn nothing_has_no_mean() {
        let mut rmse = Rmse::<4>::plane();
        assert_eq!(rmse.all(), None);
        rmse.push(&vector![1.0, 1.0, 1.0, 1.0]);
        assert_eq!(rmse.element(2..5), None);
        assert_eq!(rmse.element(1..1), None);
    }
}
