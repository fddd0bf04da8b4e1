//! The methods that the air-traffic studies compare.

use nalgebra::Vector4;
use tercel_core::error::FilterError;
use tercel_core::filter::{Filter, Kalman};
use tercel_core::motion::{AccelerationNoise, Turn};
use tercel_core::sensor::{ConvertedPolar, Measurement};
use tercel_sim::air_traffic::AirTraffic;

use super::{Method, Recording, StepEstimate};
use crate::error::StudyError;

/// Names of all methods, in the order in which they are best read.
pub const METHODS: [&str; 2] = ["measurement", "oracle"];

/// The method of that name, for a population.
///
/// # Errors
/// When there is no such method.
pub fn method(name: &str, _population: &AirTraffic) -> Result<Box<dyn Method>, StudyError> {
    Ok(match name {
        "measurement" => Box::new(Measured),
        "oracle" => Box::new(Oracle),
        _ => {
            let known = METHODS.join(", ");
            return Err(StudyError::UnknownMethod { study: "atc", name: name.to_string(), known });
        }
    })
}

struct Measured;

impl Method for Measured {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let mut mean = Vector4::repeat(f64::NAN);
        let estimate = |plot: &Option<nalgebra::Vector2<f64>>| {
            if let Some(plot) = plot {
                let (sine, cosine) = plot.y.sin_cos();
                mean = Vector4::new(plot.x * cosine, plot.x * sine, f64::NAN, f64::NAN);
            }
            StepEstimate { mean, covariance: None, manoeuvres: None }
        };
        Ok(recording.plots.iter().map(estimate).collect())
    }
}

struct Oracle;

impl Method for Oracle {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let flight = &recording.flight;
        let radar = ConvertedPolar::new(recording.radar.range(), recording.radar.bearing())?;
        let mut belief = None;
        let mut estimates = Vec::new();
        for (rate, plot) in flight.rates().iter().zip(&recording.plots) {
            let _ = AccelerationNoise::Piecewise(1.0);
            let filter =
                Kalman::new(Turn::new(*rate, flight.acceleration().powi(2)).with_speed(300.0), radar);
            if let Some(belief) = &mut belief {
                filter.predict(belief, flight.interval());
            }
            if let Some(plot) = plot {
                match &mut belief {
                    Some(belief) => drop(filter.update(belief, &Measurement::from(*plot))?),
                    None => belief = Some(filter.birth(&Measurement::from(*plot))?),
                }
            }
            let mut told = [0.0; 3];
            told[tercel_sim::air_traffic::Manoeuvre::of_rate(*rate).index()] = 1.0;
            estimates.extend(belief.map(|state: tercel_core::belief::Gaussian<4>| StepEstimate {
                mean: state.mean,
                covariance: Some(state.covariance),
                manoeuvres: Some(told),
            }));
        }
        Ok(estimates)
    }
}
