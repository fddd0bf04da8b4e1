//! Filters agree with reference vectors that an independent implementation computed (see `vectors/SOURCE.md`).

#![allow(clippy::unwrap_used)]

use nalgebra::{Matrix4, SMatrix, SVector, Vector2, Vector4};
use serde_json::Value;
use tercel_core::association::Region;
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Filter, Imm, Kalman, SigmaPoints, Transition, Unscented};
use tercel_core::motion::{ConstantVelocity, Motion};
use tercel_core::sensor::{Measurement, Position, RangeBearing, Sensor};

const TOLERANCE: f64 = 1e-9;

/// Where our `x, y, vx, vy` stand in the `x, vx, y, vy` of the files.
const ORDER: [usize; 4] = [0, 2, 1, 3];

/// A model for the state order of the files. Sigma points lie along the columns of a Cholesky factor, which depends on it.
struct Interleaved<T>(T);

fn ours(theirs: &Vector4<f64>) -> Vector4<f64> {
    Vector4::from_fn(|i, _| theirs[ORDER[i]])
}

impl<T: Motion<4>> Motion<4> for Interleaved<T> {
    fn transition(&self, state: &Vector4<f64>, dt: f64) -> Vector4<f64> {
        // The permutation is its own inverse.
        ours(&self.0.transition(&ours(state), dt))
    }
    fn jacobian(&self, state: &Vector4<f64>, dt: f64) -> Matrix4<f64> {
        let jacobian = self.0.jacobian(&ours(state), dt);
        Matrix4::from_fn(|i, j| jacobian[(ORDER[i], ORDER[j])])
    }
    fn noise(&self, state: &Vector4<f64>, dt: f64) -> Matrix4<f64> {
        let noise = self.0.noise(&ours(state), dt);
        Matrix4::from_fn(|i, j| noise[(ORDER[i], ORDER[j])])
    }
    fn prior(&self) -> Gaussian<4> {
        self.0.prior()
    }
}

impl<S: Sensor<4, 2>> Sensor<4, 2> for Interleaved<S> {
    fn expected(&self, state: &Vector4<f64>) -> Vector2<f64> {
        self.0.expected(&ours(state))
    }
    fn jacobian(&self, state: &Vector4<f64>) -> SMatrix<f64, 2, 4> {
        let jacobian = self.0.jacobian(&ours(state));
        SMatrix::from_fn(|i, j| jacobian[(i, ORDER[j])])
    }
    fn noise(&self, expected: &Vector2<f64>) -> SMatrix<f64, 2, 2> {
        self.0.noise(expected)
    }
    fn periodic(&self) -> [bool; 2] {
        self.0.periodic()
    }
    fn birth(&self, seen: &Measurement<2>, prior: &Gaussian<4>) -> Result<Gaussian<4>, FilterError> {
        self.0.birth(seen, prior)
    }
    fn place(&self, seen: &Measurement<2>) -> Option<Vector2<f64>> {
        self.0.place(seen)
    }
    fn region(&self, expected: &Vector2<f64>, half: &Vector2<f64>) -> Option<Region> {
        self.0.region(expected, half)
    }
}

fn load(name: &str) -> Value {
    let path = format!("{}/tests/vectors/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn state(value: &Value) -> Vector4<f64> {
    Vector4::from_fn(|i, _| number(&value[ORDER[i]]))
}

fn covariance(value: &Value) -> SMatrix<f64, 4, 4> {
    SMatrix::from_fn(|i, j| number(&value[ORDER[i]][ORDER[j]]))
}

fn reading<const M: usize>(value: &Value) -> SVector<f64, M> {
    SVector::from_fn(|i, _| number(&value[i]))
}

/// Largest difference, relative to the size of the reference but at least absolute.
fn assert_close(ours: &[f64], theirs: &[f64], what: &str, step: usize) {
    for (a, b) in ours.iter().zip(theirs) {
        assert!((a - b).abs() <= TOLERANCE * b.abs().max(1.0), "{what} at step {step}: {a} against {b}");
    }
}

fn assert_belief(ours: &Gaussian<4>, mean: &Value, spread: &Value, step: usize) {
    assert_close(ours.mean.as_slice(), state(mean).as_slice(), "mean", step);
    assert_close(ours.covariance.as_slice(), covariance(spread).as_slice(), "covariance", step);
}

fn steps(vectors: &Value) -> impl Iterator<Item = (usize, &Value)> {
    vectors["steps"].as_array().unwrap().iter().enumerate()
}

#[test]
fn the_kalman_filter_agrees_with_filterpy() {
    let vectors = load("kf_cv2d");
    let noise = SMatrix::<f64, 2, 2>::from_fn(|i, j| number(&vectors["R"][i][j]));
    // The process noise of the file is that of a white acceleration of this density over a second.
    let motion = ConstantVelocity::new(number(&vectors["Q"][1][1]));
    let filter = Kalman::new(motion, Position::with_noise(noise).unwrap());
    let mut belief = Gaussian::new(state(&vectors["x0"]), covariance(&vectors["P0"])).unwrap();
    for (step, expected) in steps(&vectors) {
        filter.predict(&mut belief, 1.0);
        assert_belief(&belief, &expected["x_pred"], &expected["P_pred"], step);
        let innovation = filter.update(&mut belief, &reading::<2>(&expected["z"]).into()).unwrap();
        assert_belief(&belief, &expected["x"], &expected["P"], step);
        let likelihood = number(&expected["log_likelihood"]);
        assert_close(&[innovation.log_likelihood], &[likelihood], "log-likelihood", step);
    }
}

#[test]
fn the_unscented_filter_agrees_with_filterpy_when_it_keeps_its_points() {
    let vectors = load("ukf_polar");
    let deviation = |i: usize| number(&vectors["R"][i][i]).sqrt();
    let rule =
        SigmaPoints::new(number(&vectors["alpha"]), number(&vectors["beta"]), number(&vectors["kappa"]));
    let filter = Unscented::new(
        Interleaved(ConstantVelocity::new(number(&vectors["Q"][1][1]))),
        Interleaved(RangeBearing::new(deviation(0), deviation(1)).unwrap()),
    )
    .with_points(rule.unwrap());
    let start =
        Gaussian::new(reading::<4>(&vectors["x0"]), SMatrix::from_fn(|i, j| number(&vectors["P0"][i][j])))
            .unwrap();
    let (mut belief, mut redrawn) = (start, start);
    for (step, expected) in steps(&vectors) {
        let seen = reading::<2>(&expected["z"]).into();
        filter.step(&mut belief, 1.0, &seen).unwrap();
        let permuted = Gaussian {
            mean: ours(&belief.mean),
            covariance: SMatrix::from_fn(|i, j| belief.covariance[(ORDER[i], ORDER[j])]),
        };
        assert_belief(&permuted, &expected["x"], &expected["P"], step);
        filter.predict(&mut redrawn, 1.0);
        filter.update(&mut redrawn, &seen).unwrap();
    }
    // Points drawn anew see the process noise of the step; the estimates are near, not equal.
    let apart = belief.mahalanobis(&redrawn.mean).unwrap();
    assert!(apart > 1e-12 && apart < 0.1, "{apart}");
}

#[test]
fn interacting_models_agree_with_filterpy() {
    let vectors = load("imm_2cv");
    let noise = SMatrix::<f64, 2, 2>::from_fn(|i, j| number(&vectors["R"][i][j]));
    let radar: Position<2> = Position::with_noise(noise).unwrap();
    let modes = [0, 1].map(|i| Kalman::new(ConstantVelocity::new(number(&vectors["q"][i])), radar));
    let rows = [0, 1].map(|i| [0, 1].map(|j| number(&vectors["M"][i][j])));
    let initial: Vector2<f64> = reading(&vectors["mu0"]);
    let imm = Imm::new(modes, Transition::from_rows(rows).unwrap())
        .unwrap()
        .with_initial(initial.as_slice())
        .unwrap();
    let start = Gaussian::new(state(&vectors["x0"]), covariance(&vectors["P0"])).unwrap();
    let mut belief = imm.birth(&[0.0, 0.0].into()).unwrap();
    imm.set_state(&mut belief, &start);
    for (step, expected) in steps(&vectors) {
        imm.predict(&mut belief, 1.0);
        imm.update(&mut belief, &reading::<2>(&expected["z"]).into()).unwrap();
        let theirs: Vector2<f64> = reading(&expected["mu"]);
        assert_close(imm.mode_probabilities(&belief), theirs.as_slice(), "mode probabilities", step);
        assert_belief(&imm.state(&belief), &expected["x"], &expected["P"], step);
    }
}
