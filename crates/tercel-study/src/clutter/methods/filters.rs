//! The filters that the methods put into trackers.

use std::sync::Arc;

use nalgebra::{Matrix4, Vector4};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Extended, Imm, JumpMarkov, Kalman, Particle, Transition};
use tercel_core::motion::{ConstantVelocity, LinearMotion, Motion, Turn};
use tercel_core::sensor::Position;
use tercel_neural::filter::{BankNetwork, LiquidKalman, LiquidMotion, LiquidNetwork, NeuralImm};
use tercel_neural::shipped::Models;
use tercel_sim::clutter::Sensor;

use crate::error::StudyError;

/// Standard deviation of a new object's velocity, m/s per axis.
const SPEED: f64 = 20.0;

/// Spectral density of the one straight motion, m²/s³.
const STRAIGHT: f64 = 8.0;

/// Turn rates (degrees per second) and spectral densities (m²/s³) of our bank.
const BANK: [(f64, f64); 6] =
    [(0.0, 0.05), (5.0, 0.16), (-5.0, 0.16), (10.0, 0.16), (-10.0, 0.16), (0.0, 4.0)];

/// Probability of keeping the mode over a second.
const STAY: f64 = 0.95;

pub(super) fn straight(sensor: &Sensor) -> Result<Kalman<ConstantVelocity, Position<2>>, FilterError> {
    let motion = ConstantVelocity::new(STRAIGHT).with_speed(SPEED);
    Ok(Kalman::new(motion, Position::new(sensor.deviation)?))
}

/// Ours: the modes of [`BANK`]; it is not told what the scenes hold.
pub(super) fn bank(sensor: &Sensor) -> Result<Imm<Kalman<Turn, Position<2>>>, FilterError> {
    let radar = Position::new(sensor.deviation)?;
    let mode = |(rate, density): (f64, f64)| {
        Kalman::new(Turn::new(rate.to_radians(), density).with_speed(SPEED), radar)
    };
    Imm::new(BANK.map(mode), Transition::sticky(STAY).per(1.0))
}

/// Particles of an object, and those before its second measurement.
const PARTICLES: usize = 500;
const TENTATIVE: usize = 40;

/// The copies of resampling are spread a little, as the noise of calm modes is small.
fn particles<T>(motion: T, sensor: &Sensor) -> Result<Particle<T, Position<2>>, FilterError> {
    let filter = Particle::new(motion, Position::new(sensor.deviation)?, PARTICLES, 1)?;
    filter.with_smoothing(0.2)?.with_tentative(TENTATIVE)
}

/// The modes of [`BANK`] with particles that jump between them.
pub(super) fn cloud(sensor: &Sensor) -> Result<Particle<JumpMarkov<Turn>, Position<2>>, FilterError> {
    let mode = |(rate, density): (f64, f64)| Turn::new(rate.to_radians(), density).with_speed(SPEED);
    let motion = JumpMarkov::new(BANK.map(mode), Transition::sticky(STAY).per(1.0))?;
    particles(motion, sensor)
}

fn network(models: &Models, model: &str) -> Result<Arc<LiquidNetwork>, StudyError> {
    Ok(Arc::new(LiquidNetwork::from_model(&models.get(model)?)?))
}

/// A learned motion; one model serves all scenes.
pub(super) fn liquid(
    models: &Models,
    model: &str,
) -> Result<impl Fn(&Sensor) -> Result<LiquidKalman<Position<2>>, FilterError> + use<>, StudyError> {
    let network = network(models, model)?;
    Ok(move |sensor: &Sensor| {
        LiquidKalman::new(network.clone(), Position::new(sensor.deviation)?).with_speed(SPEED)
    })
}

/// A wide bank of turns whose estimate a network corrects.
pub(super) fn neural(
    models: &Models,
    model: &str,
) -> Result<impl Fn(&Sensor) -> Result<NeuralImm<Position<2>>, FilterError> + use<>, StudyError> {
    let network = Arc::new(BankNetwork::from_model(&models.get(model)?)?);
    Ok(move |sensor: &Sensor| NeuralImm::new(network.clone(), &[Position::new(sensor.deviation)?]))
}

/// A bank of turns alone.
type Turns = Imm<Extended<Turn, Position<2>>>;

/// The bank of [`neural`] without its network, which tells what the network adds.
pub(super) fn wide(
    models: &Models,
) -> Result<impl Fn(&Sensor) -> Result<Turns, FilterError> + use<>, StudyError> {
    let bank = BankNetwork::from_model(&models.get("neural-imm-position")?)?.hyper().bank()?;
    Ok(move |sensor: &Sensor| bank.filter(Position::new(sensor.deviation)?))
}

/// The motion of [`liquid`], of particles.
pub(super) fn liquid_cloud(
    models: &Models,
    model: &str,
) -> Result<impl Fn(&Sensor) -> Result<Particle<LiquidMotion, Position<2>>, FilterError> + use<>, StudyError>
{
    let network = network(models, model)?;
    Ok(move |sensor: &Sensor| {
        let motion = LiquidMotion::new(network.clone()).with_speed(SPEED)?;
        particles(motion, sensor)
    })
}

/// The published modes: straight, a turn to the left at 10 °/s, the acceleration of the second scene, with the published
/// noise and the transitions of the second scene.
pub(super) fn published(sensor: &Sensor) -> Result<Imm<Kalman<Printed, Position<2>>>, FilterError> {
    let radar = Position::new(sensor.deviation)?;
    let modes = [(0.0, 0.0), (10.0_f64.to_radians(), 0.0), (0.0, 1.0)];
    let modes = modes.map(|(rate, acceleration)| {
        Kalman::new(Printed { turn: Turn::new(rate, 0.0).with_speed(SPEED), acceleration }, radar)
    });
    let rows = [[0.4, 0.3, 0.3], [0.3, 0.4, 0.3], [0.3, 0.3, 0.4]];
    Imm::new(modes, Transition::from_rows(rows)?)
}

/// A turn, pushed by a known acceleration along both axes, with the published noise: variances of 10 m² and 5 m²/s² for each
/// second.
#[derive(Debug, Clone, Copy)]
pub(super) struct Printed {
    turn: Turn,
    acceleration: f64,
}

impl Motion<4> for Printed {
    fn transition(&self, state: &Vector4<f64>, dt: f64) -> Vector4<f64> {
        let (place, speed) = (0.5 * self.acceleration * dt * dt, self.acceleration * dt);
        self.turn.transition(state, dt) + Vector4::new(place, place, speed, speed)
    }

    fn jacobian(&self, state: &Vector4<f64>, dt: f64) -> Matrix4<f64> {
        self.turn.jacobian(state, dt)
    }

    fn noise(&self, _: &Vector4<f64>, dt: f64) -> Matrix4<f64> {
        Matrix4::from_diagonal(&(Vector4::new(10.0, 10.0, 5.0, 5.0) * dt.abs()))
    }

    fn prior(&self) -> Gaussian<4> {
        self.turn.prior()
    }
}

impl LinearMotion<4> for Printed {}
