//! Points on an ellipse.

use nalgebra::{Matrix2, Vector2};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, Poisson, StandardNormal};
use tercel_core::extended::{Ellipse, root};

use crate::SimulationError;

/// Points spread evenly over an ellipse, with the noise of the sensor on top, and a Poisson number of them.
///
/// ## Definition
/// ```text
/// n ~ Poisson(γ)                                    or, without empty scans, drawn again until n > 0
/// z = c + R(θ) diag(a, b) √u (cos φ, sin φ) + e     u, φ uniform, e ~ N(0, R) along the axes of the plane
/// ```
///
/// ```
/// use nalgebra::{Matrix2, vector};
/// use tercel_sim::Stream;
/// use tercel_sim::extended::Scatterers;
///
/// let lidar = Scatterers::new(20.0, Matrix2::identity() * 0.01)?;
/// let mut random = Stream::Noise { realisation: 0 }.of(1, 0);
/// let ellipse = tercel_core::extended::Ellipse { center: vector![5.0, 0.0], axes: vector![2.0, 1.0], angle: 0.0 };
/// assert!(lidar.points(&ellipse, 100, &mut random).all(|point| (point - ellipse.center).norm() < 3.0));
/// # Ok::<(), tercel_sim::SimulationError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatterers {
    counts: Poisson<f64>,
    mean: f64,
    empty: bool,
    noise: Matrix2<f64>,
    root: Matrix2<f64>,
}

impl Scatterers {
    /// On average `mean` points a scan, with this covariance of the sensor noise, m². Scans may be empty.
    ///
    /// # Errors
    /// When the mean is not positive or above 10⁶, or the noise is not finite or has a negative eigenvalue.
    pub fn new(mean: f64, noise: Matrix2<f64>) -> Result<Self, SimulationError> {
        let unless = SimulationError::unless;
        let expected = "it must be positive and at most a million";
        unless(mean > 0.0 && mean <= 1e6, "mean number of points", mean, expected)?;
        let least = tercel_core::extended::eigen(&noise).0.y;
        unless(least >= 0.0, "eigenvalue of the noise of points", least, "it must not be negative")?;
        let counts = Poisson::new(mean);
        let counts =
            counts.map_err(|_| SimulationError { what: "mean number of points", value: mean, expected })?;
        Ok(Scatterers { counts, mean, empty: true, noise, root: root(&noise) })
    }

    /// Every scan has a point at least.
    pub fn without_empty_scans(self) -> Self {
        Scatterers { empty: false, ..self }
    }

    /// The mean of the Poisson distribution.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Covariance of the sensor noise, m².
    pub fn noise(&self) -> Matrix2<f64> {
        self.noise
    }

    /// Draws how many points there are.
    pub fn count(&self, random: &mut impl Rng) -> usize {
        loop {
            let count: f64 = self.counts.sample(random);
            if self.empty || count > 0.0 {
                return count as usize;
            }
        }
    }

    /// Draws `count` points on an ellipse.
    pub fn points<'a>(
        &self,
        ellipse: &'a Ellipse,
        count: usize,
        random: &'a mut impl Rng,
    ) -> impl Iterator<Item = Vector2<f64>> {
        let (sine, cosine) = ellipse.angle.sin_cos();
        let root = self.root;
        (0..count).map(move |_| {
            let (radius, angle) =
                (random.random::<f64>().sqrt(), random.random::<f64>() * std::f64::consts::TAU);
            let (y, x) = angle.sin_cos();
            let (along, across) = (radius * x * ellipse.axes.x, radius * y * ellipse.axes.y);
            let noise = Vector2::from_fn(|_, _| StandardNormal.sample(random));
            ellipse.center
                + Vector2::new(cosine * along - sine * across, sine * along + cosine * across)
                + root * noise
        })
    }
}
