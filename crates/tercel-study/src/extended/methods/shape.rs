//! Filters of angle and semi-axes.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::extended::{MemEkf, MemRbpf, Scattering};
use tercel_core::motion::{AccelerationNoise, ConstantVelocity};

use super::matrix::{sensor, straight};
use super::{Method, Recording, Settings, StepEstimate};
use crate::extended::recording::follow;

/// The first angle: the direction in which the object is told to move at first.
fn heading(recording: &Recording) -> f64 {
    let start = recording.ride.states()[0];
    start.w.atan2(start.z)
}

fn paper_motion(settings: &Settings) -> ConstantVelocity {
    ConstantVelocity::with_noise(AccelerationNoise::Piecewise(settings.paper.acceleration))
}

/// MEM-EKF*.
pub(super) struct Linearised {
    pub settings: Settings,
    pub paper: bool,
}

/// Variance of the first angle, rad².
const ANGLE: f64 = 0.3;

impl Method for Linearised {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let settings = &self.settings;
        let interval = recording.ride.interval();
        if self.paper {
            let paper = &settings.paper;
            let axes = paper.axes;
            let covariance = Vector3::new(1.0, axes.x * axes.x, axes.y * axes.y);
            let shape = Gaussian {
                mean: Vector3::new(heading(recording), axes.x, axes.y),
                covariance: Matrix3::from_diagonal(&covariance),
            };
            let scattering = Scattering::uniform(Matrix2::from_diagonal_element(paper.noise))?;
            let growth = Vector3::from(paper.growth) / interval;
            let filter = MemEkf::new(paper_motion(settings), scattering, shape, growth)?;
            return follow::<4, _>(recording, &filter);
        }
        let (axes, shape) = (settings.axes, settings.mem_ekf);
        let variances = axes.component_mul(&axes) * (shape.axes * shape.axes);
        let prior = Gaussian {
            mean: Vector3::new(heading(recording), axes.x, axes.y),
            covariance: Matrix3::from_diagonal(&Vector3::new(ANGLE, variances.x, variances.y)),
        };
        let growth = variances * shape.growth;
        let noise = Vector3::new(shape.turning, growth.x, growth.y) / interval;
        let filter = MemEkf::new(straight(settings.jump), sensor(recording)?, prior, noise)?;
        follow::<4, _>(recording, &filter)
    }
}

/// MEM-RBPF.
pub(super) struct Sampled {
    pub settings: Settings,
    pub paper: bool,
}

/// Deviation of the first angle, rad.
const FIRST_ANGLE: f64 = 0.5;

impl Method for Sampled {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let settings = &self.settings;
        let (interval, sensor) = (recording.ride.interval(), sensor(recording)?);
        if self.paper {
            let (count, turning) = settings.paper.particles;
            let motion = paper_motion(settings);
            let filter = MemRbpf::new(motion, sensor, settings.paper.axes, count, recording.seed)?
                .with_axes_variance(Vector2::new(1.0, 1.0))?
                .with_turning(turning / interval)?
                .with_angle(heading(recording), FIRST_ANGLE);
            return follow::<4, _>(recording, &filter);
        }
        let shape = settings.mem_rbpf;
        let variances = settings.axes.component_mul(&settings.axes) * (shape.axes * shape.axes);
        let motion = straight(settings.jump);
        let filter = MemRbpf::new(motion, sensor, settings.axes, settings.particles, recording.seed)?
            .with_axes_variance(variances)?
            .with_growth(variances * (shape.growth / interval))?
            .with_turning(shape.turning / interval)?
            .with_angle(heading(recording), FIRST_ANGLE)
            .with_position();
        follow::<4, _>(recording, &filter)
    }
}
