//! Flights as positions with covariances, for a batch of filters.

use std::sync::Arc;

use nalgebra::Vector2;
use tercel_core::filter::{Extended, Filter};
use tercel_core::motion::ConstantVelocity;
use tercel_core::sensor::{ConvertedPolar, Sensor};

use crate::TrainError;
use crate::task::gaussians::{GAUSSIAN, Reading, push};
use crate::task::plots::Plots;
use crate::trainer::Draw;

/// A batch of flights. Positions are relative to the first reading of each.
#[derive(Debug)]
pub struct Flown {
    /// The number of flights.
    pub members: usize,
    /// First readings relative to the radar, `[members, 2]`.
    pub origins: Arc<Vec<f64>>,
    /// The first beliefs, `[members, 20]`.
    pub births: Vec<f32>,
    /// For each step, with the first.
    pub readings: Vec<Arc<Reading>>,
    /// True states, row `step * members + member`.
    pub truth: Vec<f32>,
}

impl Flown {
    /// The flights of a draw, as a filter with this sensor starts with and reads them.
    pub fn new(
        plots: &Plots,
        sensor: &ConvertedPolar,
        speed: f64,
        draw: Draw<'_>,
    ) -> Result<Self, TrainError> {
        let (members, steps) = (draw.samples.len(), plots.steps());
        let empty = Reading {
            places: vec![0.0; 2 * members],
            noises: vec![0.0; 4 * members],
            seen: vec![0.0; members],
        };
        let mut readings = vec![empty; steps];
        let mut births = Vec::with_capacity(GAUSSIAN * members);
        let (mut origins, mut truth) = (Vec::with_capacity(2 * members), vec![0.0; steps * members * 4]);
        let starter = Extended::new(ConstantVelocity::new(0.0).with_speed(speed), sensor);
        for (member, sample) in draw.samples.iter().enumerate() {
            let sighting = plots.sighting(draw, *sample)?;
            let birth = Filter::<4>::birth(&starter, sighting.first()?)
                .map_err(|error| TrainError::Data(format!("flight {sample}: {error}")))?;
            let origin: Vector2<f64> = birth.mean.xy();
            let mut mean = birth.mean;
            (mean[0], mean[1]) = (0.0, 0.0);
            push(&mut births, &mean, &birth.covariance);
            origins.extend(origin.iter());
            for (step, (plot, state)) in sighting.plots.iter().zip(&sighting.states).enumerate() {
                let place = state.xy() - origin;
                let state = [place.x, place.y, state[2], state[3]].map(|value| value as f32);
                truth[4 * (step * members + member)..][..4].copy_from_slice(&state);
                let Some(plot) = plot else { continue };
                let read = Sensor::<4, 2>::read(sensor, plot, None)
                    .map_err(|error| TrainError::Data(format!("flight {sample}: {error}")))?;
                let (place, reading) = (read.value - origin, &mut readings[step]);
                reading.seen[member] = 1.0;
                for i in 0..2 {
                    reading.places[2 * member + i] = place[i] as f32;
                    for j in 0..2 {
                        reading.noises[4 * member + 2 * i + j] = read.noise[(i, j)] as f32;
                    }
                }
            }
        }
        let readings = readings.into_iter().map(Arc::new).collect();
        Ok(Self { members, origins: Arc::new(origins), births, readings, truth })
    }
}
