//! How an estimate of a flight is scored.

use nalgebra::Vector4;
use tercel_core::belief::Gaussian;
use tercel_core::metric::{Consistency, Rmse, nees};

use super::{Recording, StepEstimate};
use crate::monte_carlo::Outcome;

/// The first steps of a flight are not scored: filters may find their feet.
pub const WARM_UP: usize = 10;

/// Name, unit and whether the printed table has it, of each metric of a flight.
///
/// | metric | meaning |
/// |---|---|
/// | `rmse_all` | root mean square over steps and the four components of the state (m and m/s mixed, as published) |
/// | `rmse_pos`, `rmse_vel` | the same over the two positions, or the two velocities |
/// | `rmse_pos_norm` | root mean square distance, √2 times `rmse_pos` |
/// | `accuracy` | percent of the steps at which the most probable manoeuvre is the true one |
/// | `nees` | mean normalised estimation error squared; 4 for a consistent filter |
/// | `coverage90` | share of the steps at which it lies in the region that should hold 90 % |
pub const METRICS: [(&str, &str, bool); 7] = [
    ("rmse_all", "", true),
    ("rmse_pos", "m", true),
    ("rmse_vel", "m/s", true),
    ("rmse_pos_norm", "m", true),
    ("accuracy", "%", true),
    ("nees", "", true),
    ("coverage90", "", false),
];

/// Scores the estimates of one flight. Curves are the squared errors of position and velocity at each step, per component.
///
/// # Errors
/// With a message, when an estimate is missing or not finite: what a method does not tell must be told at no step.
pub(super) fn score(recording: &Recording, estimates: &[StepEstimate]) -> Result<Outcome, String> {
    let truth = recording.flight.states();
    if estimates.len() != truth.len() {
        return Err(format!("{} estimates for {} steps", estimates.len(), truth.len()));
    }
    let told = Told::of(estimates);
    let mut scores = Scores::new(told)?;
    let mut squares = [Vec::with_capacity(truth.len()), Vec::with_capacity(truth.len())];
    for (step, (estimate, state)) in estimates.iter().zip(truth).enumerate() {
        told.check(step, estimate)?;
        let error = estimate.mean - state;
        squares[0].push(0.5 * (error.x * error.x + error.y * error.y));
        squares[1].push(0.5 * (error.z * error.z + error.w * error.w));
        if step >= WARM_UP {
            let manoeuvre = recording.flight.manoeuvres()[step].index();
            scores.take(step, estimate, state, manoeuvre)?;
        }
    }
    Ok(Outcome { metrics: scores.metrics(), curves: squares.to_vec() })
}

/// What a method tells besides positions.
#[derive(Clone, Copy)]
struct Told {
    velocity: bool,
    covariance: bool,
    manoeuvres: bool,
}

impl Told {
    fn of(estimates: &[StepEstimate]) -> Self {
        let any = |told: fn(&StepEstimate) -> bool| estimates.iter().any(told);
        Told {
            velocity: any(|estimate| !(estimate.mean.z.is_nan() && estimate.mean.w.is_nan())),
            covariance: any(|estimate| estimate.covariance.is_some()),
            manoeuvres: any(|estimate| estimate.manoeuvres.is_some()),
        }
    }

    fn check(self, step: usize, estimate: &StepEstimate) -> Result<(), String> {
        let components = if self.velocity { 4 } else { 2 };
        let whole = estimate.mean.iter().take(components).all(|value| value.is_finite())
            && estimate.covariance.is_some() == self.covariance
            && estimate.manoeuvres.is_some() == self.manoeuvres
            && estimate.manoeuvres.is_none_or(|chances| chances.iter().all(|chance| chance.is_finite()));
        if whole { Ok(()) } else { Err(format!("the estimate at step {step} is not finite or not complete")) }
    }
}

struct Scores {
    told: Told,
    rmse: Rmse<4>,
    consistency: Consistency,
    steps: u32,
    right: u32,
}

impl Scores {
    fn new(told: Told) -> Result<Self, String> {
        let consistency = Consistency::new(4).map_err(|error| error.to_string())?;
        Ok(Scores { told, rmse: Rmse::plane(), consistency, steps: 0, right: 0 })
    }

    fn take(
        &mut self,
        step: usize,
        estimate: &StepEstimate,
        truth: &Vector4<f64>,
        manoeuvre: usize,
    ) -> Result<(), String> {
        self.steps += 1;
        self.rmse.push(&(estimate.mean - truth));
        if let Some(covariance) = estimate.covariance {
            let belief = Gaussian { mean: estimate.mean, covariance };
            let value = nees(&belief, truth).map_err(|error| format!("step {step}: {error}"))?;
            self.consistency.push(value);
        }
        if let Some(chances) = estimate.manoeuvres {
            // The first of equal ones.
            let best =
                (1..chances.len()).fold(0, |best, i| if chances[i] > chances[best] { i } else { best });
            self.right += u32::from(best == manoeuvre);
        }
        Ok(())
    }

    fn metrics(&self) -> Vec<f64> {
        let accuracy = 100.0 * f64::from(self.right) / f64::from(self.steps);
        // A sum over velocities that were not told is not a number already.
        let metrics = [
            self.rmse.all(),
            self.rmse.position(),
            self.rmse.velocity(),
            self.rmse.position_norm(),
            self.told.manoeuvres.then_some(accuracy),
            self.consistency.mean(),
            self.consistency.coverage90(),
        ];
        metrics.map(|metric| metric.unwrap_or(f64::NAN)).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, vector};
    use tercel_sim::air_traffic::AirTraffic;

    use super::*;

    /// Estimates that are off by the same error at every step, from a recording of 50 steps.
    fn off_by(error: Vector4<f64>, chances: Option<[f64; 3]>) -> (Recording, Vec<StepEstimate>) {
        let recording = Recording::new(&AirTraffic::test().with_steps(50).unwrap(), 1, 0);
        let estimate = |state: &Vector4<f64>| StepEstimate {
            mean: state + error,
            covariance: Some(Matrix4::identity() * 4.0),
            manoeuvres: chances,
        };
        let estimates = recording.flight.states().iter().map(estimate).collect();
        (recording, estimates)
    }

    #[test]
    fn a_constant_error_has_the_figures_of_its_definition() {
        let (recording, estimates) = off_by(vector![3.0, 4.0, 0.0, 1.0], None);
        let outcome = score(&recording, &estimates).unwrap();
        let expected = [6.5_f64.sqrt(), 12.5_f64.sqrt(), 0.5_f64.sqrt(), 5.0, f64::NAN, 6.5, 1.0];
        for (found, expected) in outcome.metrics.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9 || (found.is_nan() && expected.is_nan()), "{outcome:?}");
        }
        assert_eq!(outcome.curves[0].len(), 50);
        assert!((outcome.curves[0][0] - 12.5).abs() < 1e-9, "curves have the first steps, too");
    }

    #[test]
    fn the_first_ten_steps_do_not_count() {
        let (recording, mut estimates) = off_by(Vector4::zeros(), None);
        for estimate in &mut estimates[..WARM_UP] {
            estimate.mean.x += 1e6;
        }
        assert_eq!(score(&recording, &estimates).unwrap().metrics[0], 0.0);
        estimates[WARM_UP].mean.x += 1.0;
        assert!(score(&recording, &estimates).unwrap().metrics[0] > 0.0);
    }

    #[test]
    fn accuracy_is_the_share_of_right_guesses_and_a_tie_goes_to_the_first() {
        let (recording, estimates) = off_by(Vector4::zeros(), Some([1.0 / 3.0; 3]));
        let straight = recording.flight.manoeuvres()[WARM_UP..].iter().filter(|m| m.index() == 0).count();
        let accuracy = score(&recording, &estimates).unwrap().metrics[4];
        assert_eq!(accuracy, 100.0 * straight as f64 / 40.0);
    }

    #[test]
    fn velocities_that_are_never_told_have_no_figure_and_a_gap_is_a_failure() {
        let (recording, mut estimates) = off_by(Vector4::zeros(), None);
        for estimate in &mut estimates {
            (estimate.mean.z, estimate.mean.w) = (f64::NAN, f64::NAN);
            estimate.covariance = None;
        }
        let metrics = score(&recording, &estimates).unwrap().metrics;
        assert!(metrics[0].is_nan() && metrics[1] == 0.0 && metrics[2].is_nan() && metrics[5].is_nan());
        estimates[20].mean.z = 0.0;
        let message = score(&recording, &estimates).unwrap_err();
        assert!(message.contains("step 0"), "{message}");
    }

    #[test]
    fn an_estimate_that_is_not_finite_fails_and_names_its_step() {
        let (recording, estimates) = off_by(Vector4::zeros(), Some([1.0, 0.0, 0.0]));
        let broken = |change: &dyn Fn(&mut StepEstimate)| {
            let mut estimates = estimates.clone();
            change(&mut estimates[30]);
            score(&recording, &estimates).unwrap_err()
        };
        assert!(broken(&|estimate| estimate.mean.x = f64::NAN).contains("step 30"));
        assert!(broken(&|estimate| estimate.mean.w = f64::INFINITY).contains("step 30"));
        assert!(broken(&|estimate| estimate.manoeuvres = Some([f64::NAN; 3])).contains("step 30"));
        assert!(broken(&|estimate| estimate.covariance = None).contains("step 30"));
        assert!(broken(&|estimate| estimate.covariance = Some(-Matrix4::identity())).contains("step 30"));
        assert!(score(&recording, &estimates[1..]).unwrap_err().contains("49 estimates"));
    }
}
