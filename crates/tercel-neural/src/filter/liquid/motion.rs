//! The learned motion without the filter: for particles.

use std::sync::Arc;

use nalgebra::{Matrix4, Vector2, Vector4};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tercel_core::belief::{Cholesky, Gaussian};
use tercel_core::error::FilterError;
use tercel_core::motion::{ConstantVelocity, Motion, Sampled};

use super::form::{Cut, Moved, Seen, Span, widths};
use super::hyper::LiquidHyper;
use super::network::LiquidNetwork;

/// The learned motion of a [`LiquidKalman`](super::LiquidKalman), drawn particle by particle.
///
/// ## Definition
/// With the network `g`, which each particle has a memory `u` for:
/// ```text
/// d, Q, u' = g(v, last L ε, last ε, widths; u)        x' = F x + d + L ε,    L Lᵀ = Q,   ε standard normal
/// ```
/// What a measurement corrects in a Gaussian, it chooses among the noises of the last step in a cloud; so the noise of a particle
/// is to the network what correction and surprise are there. The widths are those of the cloud. The first steps after a birth are
/// straight.
///
/// ## Use it when
/// a [`Particle`](tercel_core::filter::Particle) filter, or a tracker with clouds of particles, is to follow manoeuvres by a learned
/// motion. A cloud of some hundred particles costs some hundred times a [`LiquidKalman`](super::LiquidKalman), which is as good
/// unless the sensor is far from linear.
///
/// ## Reference
/// Liu, Guo, Zeng, Yu, Li and Jin, "Hybrid liquid neural network-random finite set filtering for robust maneuvering object
/// tracking", eqs. 16 and 17. Their eq. 16 leaves out the process noise, without which copies of a particle stay copies.
/// Memory and learned noise are ours.
///
/// ```
/// use std::sync::Arc;
/// use tercel_core::{filter::{Filter, Particle}, sensor::Position};
/// use tercel_neural::filter::{LiquidMotion, LiquidNetwork};
/// use tercel_neural::shipped;
///
/// let network = Arc::new(LiquidNetwork::from_model(&shipped::model("liquid")?)?);
/// let filter = Particle::new(LiquidMotion::new(network), Position::<2>::new(5.0)?, 500, 1)?;
/// let mut belief = filter.birth(&[0.0, 0.0].into())?;
/// for second in 1..=20 {
///     filter.predict(&mut belief, 1.0);
///     filter.update(&mut belief, &[12.0 * second as f64, 0.0].into())?;
/// }
/// assert!((filter.state(&belief).mean[2] - 12.0).abs() < 5.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LiquidMotion {
    network: Arc<LiquidNetwork>,
    speed: f64,
}

/// What the network remembers of one particle.
#[derive(Debug, Clone, PartialEq)]
pub struct LiquidMemory {
    /// Copies of a particle share it until they move.
    memory: Arc<[f32]>,
    /// The noise of the last step, and that of its position in standard deviations.
    noise: Vector4<f64>,
    surprise: Vector2<f64>,
    /// Predictions since birth.
    age: u32,
}

impl LiquidMotion {
    /// The motion that this network has learned.
    pub fn new(network: Arc<LiquidNetwork>) -> Self {
        let speed = network.hyper().speed;
        LiquidMotion { network, speed }
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. That of the training is the default.
    ///
    /// # Errors
    /// Unless it is positive and finite.
    pub fn with_speed(self, speed: f64) -> Result<Self, FilterError> {
        Ok(LiquidMotion { speed: FilterError::positive("speed of a new object", speed)?, ..self })
    }

    /// The network.
    pub fn network(&self) -> &Arc<LiquidNetwork> {
        &self.network
    }
}

impl LiquidMemory {
    fn seen(&self, state: &Vector4<f64>, widths: [f64; 2]) -> Seen {
        Seen { mean: *state, correction: self.noise, measured: true, surprise: self.surprise, widths }
    }

    /// Moves the particle that this belongs to.
    fn go_on(&mut self, state: &mut Vector4<f64>, moved: &Moved, random: &mut ChaCha8Rng) {
        let normal: Vector4<f64> = Vector4::from_fn(|_, _| StandardNormal.sample(random));
        // Noise without extent in some direction has no factor, and is left out.
        let factor = Cholesky::new(&moved.noise, "process noise").ok();
        self.noise = factor.map_or_else(Vector4::zeros, |factor: Cholesky<4>| factor.lower() * normal);
        self.surprise = normal.xy();
        *state = moved.mean + self.noise;
        self.age = self.age.saturating_add(1);
    }
}

impl Sampled<4> for LiquidMotion {
    type Memory = LiquidMemory;

    fn prior(&self) -> Gaussian<4> {
        Motion::<4>::prior(&ConstantVelocity::new(0.0).with_speed(self.speed))
    }

    fn start(&self, _: &mut ChaCha8Rng) -> LiquidMemory {
        LiquidMemory {
            memory: vec![0.0; self.network.memory()].into(),
            noise: Vector4::zeros(),
            surprise: Vector2::zeros(),
            age: 0,
        }
    }

    fn sample(
        &self,
        states: &mut [Vector4<f64>],
        memories: &mut [LiquidMemory],
        dt: f64,
        random: &mut ChaCha8Rng,
    ) {
        let LiquidHyper { interval, form, .. } = self.network.hyper();
        let cut = Cut::new(dt, *interval);
        for _ in 0..cut.steps {
            self.step(states, memories, cut.each, random);
        }
        if cut.rest > 0.0 {
            let span = Span { dt: cut.rest, interval: *interval };
            for (state, memory) in states.iter_mut().zip(memories) {
                memory.go_on(state, &form.straight(state, span), random);
            }
        }
    }
}

impl LiquidMotion {
    /// A step of the time that the network has learned, or near it.
    fn step(
        &self,
        states: &mut [Vector4<f64>],
        memories: &mut [LiquidMemory],
        dt: f64,
        random: &mut ChaCha8Rng,
    ) {
        let hyper = self.network.hyper();
        let span = Span { dt, interval: hyper.interval };
        let widths = widths(&cloud(states));
        let asked = |memory: &LiquidMemory| memory.age >= hyper.warm_up;
        let count = memories.iter().filter(|memory| asked(memory)).count();
        let objects = states.iter().zip(&*memories).filter(|(_, memory)| asked(memory));
        let objects = objects.map(|(state, memory)| (memory.seen(state, widths), &*memory.memory));
        let mut room = Vec::new();
        let predictions = self.network.predict_means(count, objects, dt, &mut room);
        let mut number = 0;
        for (state, memory) in states.iter_mut().zip(memories) {
            let said =
                if asked(memory) { predictions.get(number, &memory.seen(state, widths)) } else { None };
            number += usize::from(asked(memory));
            match said {
                Some((moved, remembered)) => {
                    match Arc::get_mut(&mut memory.memory) {
                        Some(own) => own.copy_from_slice(remembered),
                        None => memory.memory = remembered.into(),
                    }
                    memory.go_on(state, &moved, random);
                }
                None => memory.go_on(state, &hyper.form.straight(state, span), random),
            }
        }
    }
}

/// Mean and covariance of particles of equal weight.
fn cloud(states: &[Vector4<f64>]) -> Gaussian<4> {
    let count = states.len().max(1) as f64;
    let mean = states.iter().sum::<Vector4<f64>>() / count;
    let square = |state: &Vector4<f64>| (state - mean) * (state - mean).transpose();
    let covariance = states.iter().map(square).sum::<Matrix4<f64>>() / count;
    Gaussian { mean, covariance }
}
