//! The multiplicative error model with particles for the angle: MEM-RBPF.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::orientation::ln_scatter;
use super::random_matrix::{centre, position_covariance};
use super::{Points, Scattering, congruent, rotation, scan_state};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::filter::{Comparison, Estimate, Filter, Innovation, predicted, resample, seed_of};
use crate::motion::Motion;
use crate::sensor::Sensor;

/// Estimates motion by a Kalman filter, the angle by particles, and for each particle the semi-axes.
///
/// ## Recursion
/// ```text
/// predict   x, P by the motion;   C_i ← C_i + dt Q_l;   θ_i ← θ_i + N(0, dt q) at the next update
/// update    x, P by the mean of the points, with noise (s X̂ + R)/n
///           w_i ∝ Π_j N(z_j; H x, H P Hᵀ/n.. + R(θ_i)(s diag l_i² + s C_i)R(θ_i)ᵀ + R)
///           l_i, C_i by the squares of R(-θ_i)(z_j - H x), point by point
///           systematic resampling in every step
/// X̂ = (Σ w_i R(θ_i) diag(l_i) R(θ_i)ᵀ)²
/// ```
/// The weights need only the count, mean and scatter of the points; the axes take them one by one.
///
/// ## Use it when
/// the angle is ambiguous for a while: an object that turns fast or is seen by few points. Ten particles
/// follow an angle that is roughly known, fifty find one.
///
/// ## Reference
/// Steuernagel and Baum (2025), "Extended object tracking by Rao-Blackwellized particle filtering for
/// orientation estimation", algorithm 1. Deviations: the covariance of the position may take part in the
/// weights ([`with_position`](MemRbpf::with_position)); axes stay above 1 % of their prior.
///
/// ```
/// use nalgebra::{Matrix2, vector};
/// use tercel_core::extended::{MemRbpf, Points, Scattering};
/// use tercel_core::{filter::Filter, motion::ConstantVelocity};
///
/// let lidar = Scattering::uniform(Matrix2::identity() * 0.01)?;
/// let filter = MemRbpf::new(ConstantVelocity::new(1.0), lidar, vector![2.5, 1.0], 10, 7)?.with_axes_variance(vector![0.2, 0.05])?;
/// let car = |x: f64| Points::from_iter([[x - 2.0, 0.5], [x + 2.0, 0.5], [x - 2.0, -0.5], [x + 2.0, -0.5]]);
/// let mut belief: tercel_core::extended::ShapeParticles<4> = filter.birth(&car(0.0))?;
/// filter.predict(&mut belief, 0.1);
/// filter.update(&mut belief, &car(1.0))?;
/// assert_eq!(belief.particles().len(), 10);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MemRbpf<T> {
    motion: T,
    scattering: Scattering,
    axes: Vector2<f64>,
    variance: Matrix2<f64>,
    growth: Matrix2<f64>,
    turning: f64,
    angle: Option<(f64, f64)>,
    position: bool,
    count: usize,
    seed: u64,
}

/// An angle with the semi-axes that go with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeParticle {
    /// Direction of the first semi-axis, rad.
    pub angle: f64,
    /// The semi-axes, m.
    pub axes: Vector2<f64>,
    /// Covariance of the semi-axes, m².
    pub covariance: Matrix2<f64>,
}

/// What [`MemRbpf`] holds of one object. The particles are equally probable.
#[derive(Debug, PartialEq)]
pub struct ShapeParticles<const N: usize> {
    /// The state of its centre.
    pub state: Gaussian<N>,
    particles: Vec<ShapeParticle>,
    /// Variance that the angles have gathered since they last moved, rad².
    gathered: f64,
    random: ChaCha8Rng,
    room: Vec<ShapeParticle>,
    weights: Vec<f64>,
}

impl<const N: usize> Clone for ShapeParticles<N> {
    fn clone(&self) -> Self {
        ShapeParticles {
            state: self.state,
            particles: self.particles.clone(),
            gathered: self.gathered,
            random: self.random.clone(),
            room: Vec::new(),
            weights: Vec::new(),
        }
    }

    // Trackers copy beliefs into buffers of the last scan; their room is used again.
    fn clone_from(&mut self, source: &Self) {
        self.state = source.state;
        self.particles.clone_from(&source.particles);
        self.gathered = source.gathered;
        self.random.clone_from(&source.random);
    }
}

impl<const N: usize> ShapeParticles<N> {
    /// The particles.
    pub fn particles(&self) -> &[ShapeParticle] {
        &self.particles
    }

    /// The square of the mean root of the particles' extents, m².
    pub fn extent(&self) -> Matrix2<f64> {
        let roots = self
            .particles
            .iter()
            .map(|particle| congruent(&rotation(particle.angle), &Matrix2::from_diagonal(&particle.axes)));
        let mean = roots.sum::<Matrix2<f64>>() / self.particles.len().max(1) as f64;
        congruent(&Matrix2::identity(), &(mean * mean))
    }
}

/// Smallest semi-axis, as a share of the prior one.
const THINNEST: f64 = 0.01;

impl<T> MemRbpf<T> {
    /// A filter of `count` particles that starts with these semi-axes (m), with this seed for its random
    /// numbers. The axes are known and the angle gathers 0.1 rad² a second until told otherwise.
    ///
    /// # Errors
    /// When there is no particle or an axis is not positive.
    pub fn new(
        motion: T,
        scattering: Scattering,
        axes: Vector2<f64>,
        count: usize,
        seed: u64,
    ) -> Result<Self, FilterError> {
        for axis in axes.iter() {
            FilterError::positive("semi-axis", *axis)?;
        }
        if count == 0 {
            let (parameter, expected) = ("number of particles", "must be at least 1");
            return Err(FilterError::Parameter { parameter, value: 0.0, expected });
        }
        let (variance, growth) = (Matrix2::zeros(), Matrix2::zeros());
        let (turning, angle, position) = (0.1, None, false);
        Ok(MemRbpf { motion, scattering, axes, variance, growth, turning, angle, position, count, seed })
    }

    /// Sets the variances of the first semi-axes, m².
    ///
    /// # Errors
    /// When one is negative or not finite.
    pub fn with_axes_variance(self, variances: Vector2<f64>) -> Result<Self, FilterError> {
        Ok(MemRbpf { variance: diagonal("variance of a semi-axis", &variances)?, ..self })
    }

    /// Sets the variances that the semi-axes gather every second, m²/s. The default is 0.
    ///
    /// # Errors
    /// When one is negative or not finite.
    pub fn with_growth(self, variances: Vector2<f64>) -> Result<Self, FilterError> {
        Ok(MemRbpf { growth: diagonal("growth of the variance of a semi-axis", &variances)?, ..self })
    }

    /// Sets the variance that the angle gathers every second, rad²/s.
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn with_turning(self, variance: f64) -> Result<Self, FilterError> {
        diagonal("variance of the angle", &Vector2::new(variance, 0.0))?;
        Ok(MemRbpf { turning: variance, ..self })
    }

    /// Sets mean (rad) and deviation of the first angles. Without it, all angles are alike.
    pub fn with_angle(self, mean: f64, deviation: f64) -> Self {
        MemRbpf { angle: Some((mean, deviation)), ..self }
    }

    /// Lets the covariance of the position take part in the weights.
    pub fn with_position(self) -> Self {
        MemRbpf { position: true, ..self }
    }

    /// Moves the angles and weighs the particles by the points. Returns the mean likelihood of the scatter.
    fn weigh<const N: usize>(&self, belief: &mut ShapeParticles<N>, points: &Points) -> Option<f64> {
        let deviation = belief.gathered.sqrt();
        belief.gathered = 0.0;
        let state = &belief.state;
        let n = points.count() as f64;
        let residual = points.mean() - Vector2::new(state.mean[0], state.mean[1]);
        let position = if self.position { position_covariance(state) } else { Matrix2::zeros() };
        belief.weights.clear();
        let (mut top, mut scatter_top) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        let mut scatters = 0.0;
        for particle in &mut belief.particles {
            let step: f64 = StandardNormal.sample(&mut belief.random);
            particle.angle = (particle.angle + deviation * step).rem_euclid(TAU);
            let shape =
                Matrix2::from_diagonal(&particle.axes.component_mul(&particle.axes)) + particle.covariance;
            let spread = self.scattering.spread(&congruent(&rotation(particle.angle), &shape));
            let whole = spread + position * n;
            let square = residual.dot(&(super::symmetric::inverse(&whole) * residual)) * n;
            let scatter = ln_scatter(&spread, points);
            let ln = scatter - 0.5 * (square + whole.determinant().ln());
            belief.weights.push(ln);
            top = top.max(ln);
            if scatter > scatter_top {
                scatters = scatters * (scatter_top - scatter).exp() + 1.0;
                scatter_top = scatter;
            } else {
                scatters += (scatter - scatter_top).exp();
            }
        }
        if !top.is_finite() {
            return None;
        }
        belief.weights.iter_mut().for_each(|weight| *weight = (*weight - top).exp());
        Some(scatter_top + (scatters / self.count as f64).ln())
    }

    /// Conditions the axes of a particle on the squares of the points along and across it.
    fn shape(&self, particle: &mut ShapeParticle, place: &Vector2<f64>, points: &Points) {
        let back = rotation(-particle.angle);
        let noise = congruent(&back, &self.scattering.noise());
        let scale = self.scattering.scale();
        let least = self.axes * THINNEST;
        for point in points.points() {
            let offset = back * (point - place);
            let (axes, covariance) = (particle.axes, particle.covariance);
            let expected = Vector2::new(
                noise.m11 + scale * (covariance.m11 + axes.x * axes.x),
                noise.m22 + scale * (covariance.m22 + axes.y * axes.y),
            );
            let shared = 2.0 * noise.m12 * noise.m12;
            let squares =
                Matrix2::new(2.0 * expected.x * expected.x, shared, shared, 2.0 * expected.y * expected.y);
            let cross = Matrix2::from_diagonal(&Vector2::new(
                2.0 * scale * axes.x * covariance.m11,
                2.0 * scale * axes.y * covariance.m22,
            ));
            let gain = cross * super::symmetric::inverse(&squares);
            let after = axes + gain * (offset.component_mul(&offset) - expected);
            let left = congruent(&Matrix2::identity(), &(covariance - gain * cross.transpose()));
            if after.iter().chain(left.iter()).all(|x| x.is_finite()) && left.m11 >= 0.0 && left.m22 >= 0.0 {
                particle.axes = Vector2::new(after.x.max(least.x), after.y.max(least.y));
                particle.covariance = left;
            }
        }
    }
}

fn diagonal(parameter: &'static str, variances: &Vector2<f64>) -> Result<Matrix2<f64>, FilterError> {
    for value in variances.iter().copied() {
        if !(value >= 0.0 && value.is_finite()) {
            let expected = "must be finite and not negative";
            return Err(FilterError::Parameter { parameter, value, expected });
        }
    }
    Ok(Matrix2::from_diagonal(variances))
}

impl<const N: usize, T: Motion<N>> Filter<N> for MemRbpf<T> {
    type Belief = ShapeParticles<N>;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<ShapeParticles<N>, FilterError> {
        points.check_birth()?;
        let mut random = ChaCha8Rng::seed_from_u64(seed_of::<2>(self.seed, &points.mean().into()));
        let particles: Vec<_> = (0..self.count)
            .map(|_| {
                let angle = match self.angle {
                    None => random.random::<f64>() * PI,
                    Some((mean, deviation)) => {
                        let step: f64 = StandardNormal.sample(&mut random);
                        mean + deviation * step
                    }
                };
                ShapeParticle { angle, axes: self.axes, covariance: self.variance }
            })
            .collect();
        let room = Vec::with_capacity(self.count);
        let mut belief = ShapeParticles {
            state: Gaussian { mean: nalgebra::SVector::zeros(), covariance: nalgebra::SMatrix::identity() },
            particles,
            gathered: 0.0,
            random,
            room,
            weights: Vec::with_capacity(self.count),
        };
        let (sensor, mean) = centre(&self.scattering.spread(&belief.extent()), points)?;
        belief.state = sensor.birth(&mean, &self.motion.prior())?;
        Ok(belief)
    }

    fn predict(&self, belief: &mut ShapeParticles<N>, dt: f64) {
        belief.state = predicted(&self.motion, &belief.state, dt);
        belief.gathered += self.turning * dt.abs();
        for particle in &mut belief.particles {
            particle.covariance += self.growth * dt.abs();
        }
    }

    fn update(&self, belief: &mut ShapeParticles<N>, points: &Points) -> Result<Innovation, FilterError> {
        points.check()?;
        if points.is_empty() {
            return Ok(Innovation::new(&Vector2::zeros(), 0.0, 0.0));
        }
        let spread = self.scattering.spread(&belief.extent());
        let (sensor, mean) = centre(&spread, points)?;
        let comparison = Comparison::new(&sensor, &belief.state, &mean)?;
        comparison.condition(&sensor, &mut belief.state)?;
        let mut innovation = comparison.innovation;
        // Particles that all find the points impossible tell nothing of each other.
        let Some(ln_likelihood) = self.weigh(belief, points) else { return Ok(innovation) };
        innovation.log_likelihood += ln_likelihood;
        let place = Vector2::new(belief.state.mean[0], belief.state.mean[1]);
        for particle in &mut belief.particles {
            self.shape(particle, &place, points);
        }
        let total: f64 = belief.weights.iter().sum();
        let weighted = belief.weights.iter().map(|weight| weight / total).zip(&belief.particles);
        resample(weighted, belief.random.random(), self.count, &mut belief.room);
        std::mem::swap(&mut belief.particles, &mut belief.room);
        Ok(innovation)
    }

    /// Resamples both sets of particles as one.
    fn merge(
        &self,
        belief: &mut ShapeParticles<N>,
        weight: f64,
        other: &ShapeParticles<N>,
        other_weight: f64,
    ) {
        belief.state.merge(weight, &other.state, other_weight);
        let total = weight + other_weight;
        if total <= 0.0 || other_weight <= 0.0 {
            return;
        }
        let each =
            |weight: f64, particles: &[ShapeParticle]| weight / (total * particles.len().max(1) as f64);
        let (own, theirs) = (each(weight, &belief.particles), each(other_weight, &other.particles));
        let weighted = belief
            .particles
            .iter()
            .map(|particle| (own, particle))
            .chain(other.particles.iter().map(|particle| (theirs, particle)));
        resample(weighted, belief.random.random(), self.count, &mut belief.room);
        std::mem::swap(&mut belief.particles, &mut belief.room);
    }

    fn estimate(&self, belief: &ShapeParticles<N>) -> Estimate<N> {
        Estimate { extent: Some(belief.extent()), ..belief.state.into() }
    }

    fn reach(&self, belief: &ShapeParticles<N>, search: &Search) -> Option<Region> {
        let state = &belief.state;
        let spread = self.scattering.spread(&belief.extent());
        let place = Vector2::new(state.mean[0], state.mean[1]);
        Some(search.around(place, &(position_covariance(state) + spread)))
    }

    scan_state!();
}
