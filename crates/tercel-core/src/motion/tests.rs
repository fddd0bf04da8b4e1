use super::*;
use nalgebra::vector;

/// Largest difference between the Jacobian and central differences of the transition.
fn jacobian_error<const N: usize>(motion: &impl Motion<N>, state: SVector<f64, N>, dt: f64) -> f64 {
    let jacobian = motion.jacobian(&state, dt);
    let mut worst: f64 = 0.0;
    for j in 0..N {
        let step = 1e-6 * (1.0 + state[j].abs());
        let (mut up, mut down) = (state, state);
        up[j] += step;
        down[j] -= step;
        let slope = (motion.transition(&up, dt) - motion.transition(&down, dt)) / (2.0 * step);
        worst = worst.max((slope - jacobian.column(j)).amax());
    }
    worst
}

/// Difference between one step of `a + b` and a step of `a` followed by one of `b`, in mean and covariance.
fn composition_error<const N: usize>(
    motion: &impl Motion<N>,
    state: SVector<f64, N>,
    (a, b): (f64, f64),
) -> f64 {
    let start = Gaussian { mean: state, covariance: SMatrix::identity() };
    let twice = motion.predict(&motion.predict(&start, a), b);
    let once = motion.predict(&start, a + b);
    let scale = once.covariance.amax().max(1.0);
    (twice.mean - once.mean).amax().max((twice.covariance - once.covariance).amax() / scale)
}

#[test]
fn jacobians_are_the_derivatives_of_the_transitions() {
    let plane = vector![100.0, -50.0, 12.0, 7.0];
    let jerky = vector![100.0, -50.0, 12.0, 7.0, 0.5, -0.3];
    for dt in [0.0, 1e-4, 0.1, 1.0, 7.5] {
        assert!(jacobian_error(&ConstantVelocity::new(1.0), plane, dt) < 1e-6);
        assert!(jacobian_error(&RandomWalk::new(1.0), plane, dt) < 1e-6);
        assert!(jacobian_error(&ConstantAcceleration::new(1.0), jerky, dt) < 1e-6);
        assert!(jacobian_error(&Singer::new(5.0, 1.0).unwrap(), jerky, dt) < 1e-6);
        for rate in [0.0, 1e-9, 1e-4, 0.02, -0.3, 2.0] {
            assert!(jacobian_error(&Turn::new(rate, 1.0), plane, dt) < 1e-6);
            let state = vector![100.0, -50.0, 12.0, 7.0, rate];
            assert!(jacobian_error(&CoordinatedTurn::new(1.0, 0.1), state, dt) < 1e-5, "{rate} {dt}");
        }
    }
}

#[test]
fn two_short_steps_are_one_long_step() {
    let jerky = vector![100.0, -50.0, 12.0, 7.0, 0.5, -0.3];
    let plane = vector![100.0, -50.0, 12.0, 7.0];
    for cut in [(0.3, 0.9), (1.0, 1.0), (4.0, 0.001)] {
        assert!(composition_error(&RandomWalk::new(2.0), plane, cut) < 1e-12);
        assert!(composition_error(&ConstantVelocity::new(2.0), plane, cut) < 1e-12);
        assert!(composition_error(&ConstantAcceleration::new(2.0), jerky, cut) < 1e-12);
        assert!(composition_error(&Singer::new(3.0, 2.0).unwrap(), jerky, cut) < 1e-9, "{cut:?}");
        // A turn's noise is that of straight motion, so only its noiseless part composes.
        assert!(composition_error(&Turn::new(0.3, 0.0), plane, cut) < 1e-12);
    }
}

#[test]
fn the_short_cut_through_the_covariance_is_the_product() {
    let covariance =
        SMatrix::<f64, 6, 6>::from_fn(|i, j| if i == j { 3.0 + i as f64 } else { 0.1 * (i + j) as f64 });
    let start = Gaussian { mean: vector![1.0, 2.0, 3.0, 4.0, 5.0, 6.0], covariance };
    let motion = ConstantVelocity::with_noise(AccelerationNoise::Piecewise(0.7));
    let quick = motion.predict(&start, 1.7);
    let f = Motion::<6>::jacobian(&motion, &start.mean, 1.7);
    let plain = f * start.covariance * f.transpose() + Motion::<6>::noise(&motion, &start.mean, 1.7);
    assert!((quick.covariance - plain).amax() < 1e-12);

    let start: Gaussian<4> = start.leading();
    for (rate, dt) in [(0.0, 1.7), (0.3, 1.7), (-0.9, 4.0), (1e-8, 2.0), (0.2, 0.0)] {
        for noise in [AccelerationNoise::Piecewise(0.7), AccelerationNoise::White(0.4)] {
            let turn = Turn::with_noise(rate, noise);
            let (quick, f) = (turn.predict(&start, dt), turn.jacobian(&start.mean, dt));
            let plain = f * start.covariance * f.transpose() + turn.noise(&start.mean, dt);
            assert!((quick.covariance - plain).amax() < 1e-12 * plain.amax(), "{rate} {dt}");
            assert!((quick.mean - f * start.mean).amax() < 1e-12, "{rate} {dt}");
        }
    }
}

#[test]
fn singer_has_constant_velocity_and_constant_acceleration_as_its_limits() {
    let state = vector![1.0, 2.0, 0.5];
    let slow = Singer::new(1e6, 1.0).unwrap();
    let steady = ConstantAcceleration::new(2.0 / 1e6);
    assert!((slow.transition(&state, 2.0) - steady.transition(&state, 2.0)).amax() < 1e-5);
    let (a, b) = (Motion::<3>::noise(&slow, &state, 2.0), Motion::<3>::noise(&steady, &state, 2.0));
    assert!((a - b).amax() / b.amax() < 1e-5);
    // White acceleration of the same spectral density: 2 σ² τ.
    let quick = Singer::new(1e-3, 10.0).unwrap();
    let noise = Motion::<3>::noise(&quick, &state, 5.0);
    let (pp, pv, vv) = AccelerationNoise::White(2.0 * 100.0 * 1e-3).variances(5.0);
    for (got, expected) in [(noise[(0, 0)], pp), (noise[(0, 1)], pv), (noise[(1, 1)], vv)] {
        assert!((got / expected - 1.0).abs() < 2e-3, "{got} {expected}");
    }
}

#[test]
fn singer_noise_is_smooth_where_its_series_takes_over() {
    let motion = Singer::new(1.0, 1.0).unwrap();
    let state = vector![0.0, 0.0, 0.0];
    let below: SMatrix<f64, 3, 3> = motion.noise(&state, 0.009_999_999);
    let above: SMatrix<f64, 3, 3> = motion.noise(&state, 0.010_000_001);
    for (a, b) in below.iter().zip(above.iter()) {
        assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
    }
}

#[test]
fn a_full_circle_returns_to_its_start() {
    let state = vector![3.0, 4.0, 5.0, 6.0];
    let full = Turn::new(0.25, 1.0).transition(&state, std::f64::consts::TAU / 0.25);
    assert!((full - state).amax() < 1e-9);
}
