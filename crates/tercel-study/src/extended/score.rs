//! How an estimate of an extended object is scored.

use nalgebra::{Matrix2, Vector2};
use tercel_core::belief::Gaussian;
use tercel_core::extended::Ellipse;
use tercel_core::metric::{Consistency, Rmse, intersection_over_union, nees, wasserstein};

use super::{Recording, StepEstimate};
use crate::monte_carlo::Outcome;

/// Name, unit and whether the printed table has it, of each metric. The first step, at which filters are told
/// the truth, does not count.
///
/// | metric | meaning |
/// |---|---|
/// | `rmse_pos`, `rmse_vel` | root mean square over steps and the two components, as published |
/// | `rmse_pos_norm`, `rmse_vel_norm` | root mean square distance, √2 times as much |
/// | `iou` | intersection over union of the estimated and the true ellipse, mean |
/// | `gwd` | squared Gaussian Wasserstein distance, mean |
/// | `gwd_position`, `gwd_shape` | its parts |
/// | `nees_pos`, `nees_vel` | mean normalised error squared of position and of velocity; 2 for a consistent filter |
/// | `coverage90` | share of the steps at which that of the position lies in the region that should hold 90 % |
/// | `lost` | 1 for a run in which the overlap stays below 0.1 for ten steps: the mean is the failure rate |
pub const METRICS: [(&str, &str, bool); 12] = [
    ("rmse_pos", "m", true),
    ("rmse_vel", "m/s", true),
    ("iou", "", true),
    ("gwd", "m²", true),
    ("gwd_shape", "m²", true),
    ("nees_pos", "", true),
    ("lost", "", true),
    ("gwd_position", "m²", false),
    ("rmse_pos_norm", "m", false),
    ("rmse_vel_norm", "m/s", false),
    ("nees_vel", "", false),
    ("coverage90", "", false),
];

/// Overlap below which an object is not followed.
const LOST: f64 = 0.1;

/// Steps in a row below it that count as a failure.
const LOST_STEPS: usize = 10;

/// Scores the estimates of one recording. Curves are the squared position error per component, the overlap
/// and the squared distance at each step.
///
/// # Errors
/// With a message, when an estimate is missing or not finite: what a method does not tell must be told at no
/// step.
pub(super) fn score(recording: &Recording, estimates: &[StepEstimate]) -> Result<Outcome, String> {
    let truth = recording.ride.states();
    if estimates.len() != truth.len() {
        return Err(format!("{} estimates for {} steps", estimates.len(), truth.len()));
    }
    let mut scores = Scores::new(estimates.iter().any(|estimate| estimate.mean.z.is_finite()))?;
    let mut curves = vec![Vec::new(); 3];
    for (step, estimate) in estimates.iter().enumerate() {
        let values = scores.take(recording, step, estimate).map_err(|why| format!("step {step}: {why}"))?;
        for (curve, value) in curves.iter_mut().zip(values) {
            curve.push(value);
        }
    }
    Ok(Outcome { metrics: scores.metrics(), curves })
}

struct Scores {
    moving: bool,
    rmse: Rmse<4>,
    position: Consistency,
    velocity: Consistency,
    overlap: f64,
    distance: (f64, f64),
    below: usize,
    lost: bool,
}

impl Scores {
    fn new(moving: bool) -> Result<Self, String> {
        let consistency = || Consistency::new(2).map_err(|error| error.to_string());
        Ok(Scores {
            moving,
            rmse: Rmse::plane(),
            position: consistency()?,
            velocity: consistency()?,
            overlap: 0.0,
            distance: (0.0, 0.0),
            below: 0,
            lost: false,
        })
    }

    fn take(
        &mut self,
        recording: &Recording,
        step: usize,
        estimate: &StepEstimate,
    ) -> Result<[f64; 3], String> {
        let truth = &recording.ride.states()[step];
        let told = estimate.mean.iter().take(if self.moving { 4 } else { 2 });
        if !told.chain(estimate.extent.iter()).all(|value| value.is_finite()) {
            return Err("the estimate is not finite or not complete".to_owned());
        }
        let error = estimate.mean - truth;
        let ellipse = recording.ride.ellipse(step);
        let centre = Vector2::new(estimate.mean.x, estimate.mean.y);
        let found = Ellipse::from_matrix(centre, &estimate.extent).map_err(|error| error.to_string())?;
        let overlap = intersection_over_union(&found, &ellipse);
        let distance = wasserstein(&centre, &estimate.extent, &ellipse.center, &ellipse.matrix());
        if step > 0 {
            self.rmse.push(&error);
            self.consistency(estimate, truth)?;
            self.overlap += overlap;
            self.distance.0 += distance.position;
            self.distance.1 += distance.shape;
            self.below = if overlap < LOST { self.below + 1 } else { 0 };
            self.lost |= self.below >= LOST_STEPS;
        }
        Ok([0.5 * (error.x * error.x + error.y * error.y), overlap, distance.total()])
    }

    fn consistency(&mut self, estimate: &StepEstimate, truth: &nalgebra::Vector4<f64>) -> Result<(), String> {
        let part = |at: usize| Gaussian {
            mean: Vector2::new(estimate.mean[at], estimate.mean[at + 1]),
            covariance: estimate.covariance.fixed_view::<2, 2>(at, at).into_owned() as Matrix2<f64>,
        };
        let value = |at: usize| {
            nees(&part(at), &Vector2::new(truth[at], truth[at + 1])).map_err(|error| error.to_string())
        };
        self.position.push(value(0)?);
        if self.moving {
            self.velocity.push(value(2)?);
        }
        Ok(())
    }

    fn metrics(&self) -> Vec<f64> {
        let steps = self.rmse.count() as f64;
        let (position, shape) = (self.distance.0 / steps, self.distance.1 / steps);
        let told = |value: Option<f64>| value.unwrap_or(f64::NAN);
        vec![
            told(self.rmse.position()),
            told(self.rmse.velocity()),
            self.overlap / steps,
            position + shape,
            shape,
            told(self.position.mean()),
            f64::from(u8::from(self.lost)),
            position,
            told(self.rmse.position_norm()),
            told(self.rmse.euclidean(2..4)),
            told(self.velocity.mean()),
            told(self.position.coverage90()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, vector};
    use tercel_sim::extended::{Generator, Vehicle};

    use super::*;
    use crate::extended::Scene;

    /// Estimates with the true extent that are off by the same error at every step but the first.
    fn off_by(error: nalgebra::Vector4<f64>) -> (Recording, Vec<StepEstimate>) {
        let vehicle = Vehicle::new(Generator::Smooth).with_steps(40).unwrap();
        let recording = Scene::Vehicle(vehicle).record(1, 0).unwrap();
        let estimate = |(step, state): (usize, &nalgebra::Vector4<f64>)| StepEstimate {
            mean: state + error * if step == 0 { 1e6 } else { 1.0 },
            covariance: Matrix4::identity() * 4.0,
            extent: recording.ride.ellipse(step).matrix(),
        };
        let estimates = recording.ride.states().iter().enumerate().map(estimate).collect();
        (recording, estimates)
    }

    #[test]
    fn a_constant_error_has_the_figures_of_its_definition_and_the_first_step_does_not_count() {
        let (recording, estimates) = off_by(vector![3.0, 4.0, 1.0, 0.0]);
        let outcome = score(&recording, &estimates).unwrap();
        let named = |name: &str| outcome.metrics[METRICS.iter().position(|metric| metric.0 == name).unwrap()];
        for (name, expected) in [
            ("rmse_pos", 12.5_f64.sqrt()),
            ("rmse_pos_norm", 5.0),
            ("rmse_vel", 0.5_f64.sqrt()),
            ("gwd", 25.0),
            ("gwd_position", 25.0),
            ("gwd_shape", 0.0),
            ("nees_pos", 6.25),
            ("nees_vel", 0.25),
            ("coverage90", 0.0),
        ] {
            assert!((named(name) - expected).abs() < 1e-9, "{name}: {}", named(name));
        }
        assert_eq!(outcome.curves[0].len(), 40);
    }

    #[test]
    fn an_object_without_overlap_for_ten_steps_is_lost() {
        let (recording, mut estimates) = off_by(nalgebra::Vector4::zeros());
        let lost = |estimates: &[StepEstimate]| score(&recording, estimates).unwrap().metrics[6];
        for estimate in &mut estimates[5..14] {
            estimate.mean.x += 100.0;
        }
        assert_eq!(lost(&estimates), 0.0);
        estimates[14].mean.x += 100.0;
        assert_eq!(lost(&estimates), 1.0);
    }

    #[test]
    fn an_estimate_that_is_not_finite_or_no_extent_fails_and_names_its_step() {
        let (recording, estimates) = off_by(nalgebra::Vector4::zeros());
        let broken = |change: &dyn Fn(&mut StepEstimate)| {
            let mut estimates = estimates.clone();
            change(&mut estimates[30]);
            score(&recording, &estimates).unwrap_err()
        };
        assert!(broken(&|estimate| estimate.mean.x = f64::NAN).contains("step 30"));
        assert!(broken(&|estimate| estimate.mean.w = f64::NAN).contains("step 30"));
        assert!(broken(&|estimate| estimate.extent.m11 = f64::NAN).contains("step 30"));
        assert!(broken(&|estimate| estimate.extent = -Matrix2::identity()).contains("step 30"));
        assert!(score(&recording, &estimates[1..]).unwrap_err().contains("39 estimates"));
    }
}
