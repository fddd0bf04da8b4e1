use super::*;
use crate::motion::{ConstantVelocity, Motion};
use nalgebra::vector;

/// Largest difference between the Jacobian and central differences of the expected reading.
fn jacobian_error<const N: usize, const M: usize>(sensor: &impl Sensor<N, M>, state: SVector<f64, N>) -> f64 {
    let jacobian = sensor.jacobian(&state);
    let mut worst: f64 = 0.0;
    for j in 0..N {
        let step = 1e-5 * (1.0 + state[j].abs());
        let (mut up, mut down) = (state, state);
        up[j] += step;
        down[j] -= step;
        let slope = sensor.difference(&sensor.expected(&up), &sensor.expected(&down)) / (2.0 * step);
        worst = worst.max((slope - jacobian.column(j)).amax());
    }
    worst
}

#[test]
fn jacobians_are_the_derivatives_of_the_expected_readings() {
    // The second state lies on the cut of the bearing.
    for state in [vector![300.0, 400.0, 12.0, -5.0], vector![-500.0, 0.0, 3.0, 9.0]] {
        let here = vector![20.0, 0.0];
        assert!(jacobian_error(&Position::<2>::new(1.0).unwrap().with_lag(2.0), state) < 1e-8);
        assert!(jacobian_error(&ConvertedPolar::new(1.0, 0.1).unwrap().at(here).with_lag(1.0), state) < 1e-8);
        assert!(jacobian_error(&RangeBearing::new(1.0, 0.1).unwrap().at(here), state) < 1e-8);
        assert!(jacobian_error(&BearingOnly::new(0.1).unwrap().at(here), state) < 1e-8);
        let doppler = RangeBearingRate::new(1.0, 0.1, 0.5).unwrap().at(here, vector![5.0, 1.0]);
        assert!(jacobian_error(&doppler, state) < 1e-8);
    }
}

#[test]
fn jacobians_of_aged_sensors_are_the_derivatives_of_their_expected_readings() {
    for state in [vector![300.0, 400.0, 12.0, -5.0], vector![-500.0, 0.0, 3.0, 9.0]] {
        let here = vector![20.0, 0.0];
        let position = Position::<2>::new(1.0).unwrap().with_lag(2.0);
        assert!(jacobian_error(&Aged::new(&position, 1.5), state) < 1e-8);
        assert_eq!(
            Aged::new(&position, 1.5).expected(&state),
            Sensor::<4, 2>::expected(&position.with_lag(3.5), &state)
        );
        let converted = ConvertedPolar::new(1.0, 0.1).unwrap().at(here).with_lag(1.0);
        assert!(jacobian_error(&Aged::new(&converted, 2.0), state) < 1e-8);
        let polar = RangeBearing::new(1.0, 0.1).unwrap().at(here);
        assert!(jacobian_error(&Aged::new(&polar, 3.0), state) < 1e-8);
        assert!(jacobian_error(&Aged::new(&BearingOnly::new(0.1).unwrap().at(here), 3.0), state) < 1e-8);
        let doppler = RangeBearingRate::new(1.0, 0.1, 0.5).unwrap().at(here, vector![5.0, 1.0]);
        assert!(jacobian_error(&Aged::new(&doppler, 4.0), state) < 1e-8);
        let space = vector![1.0, 2.0, 3.0, 40.0, 50.0, 60.0];
        let aged = Aged::new(&position, 2.0);
        assert!((Sensor::<4, 2>::jacobian(&aged, &state) * state - aged.expected(&state)).norm() < 1e-9);
        let position = Position::<3>::new(1.0).unwrap();
        assert!(jacobian_error(&Aged::new(&position, 0.5), space) < 1e-8);
        assert_eq!(Aged::new(&position, 0.5).expected(&space), vector![-19.0, -23.0, -27.0]);
        // Without velocities there is nothing to move.
        assert_eq!(Sensor::<2, 2>::expected(&Aged::new(&polar, 9.0), &vector![20.0, 7.0])[0], 7.0);
    }
}

#[test]
fn a_birth_from_an_aged_measurement_is_a_birth_then_and_a_prediction_since() {
    let prior: Gaussian<4> = ConstantVelocity::new(0.0).with_speed(20.0).prior();
    fn agrees<const M: usize>(
        sensor: &impl Sensor<4, M>,
        seen: [f64; M],
        prior: &Gaussian<4>,
    ) -> Result<(), FilterError> {
        let fresh = sensor.birth(&seen.into(), prior)?;
        let expected = ConstantVelocity::new(0.0).predict(&fresh, 2.5);
        let aged = sensor.birth(&Measurement::from(seen).with_age(2.5), prior)?;
        assert!((aged.mean - expected.mean).amax() < 1e-9 * expected.mean.amax());
        assert!((aged.covariance - expected.covariance).amax() < 1e-9 * expected.covariance.amax());
        assert!(aged.covariance[(0, 2)] > fresh.covariance[(0, 2)] + 300.0);
        let broken = sensor.birth(&Measurement::from(seen).with_age(f64::NAN), prior);
        assert_eq!(broken, Err(FilterError::NotFinite { what: "measurement" }));
        Ok(())
    }
    agrees(&Position::<2>::new(5.0).unwrap().with_lag(1.0), [40.0, 30.0], &prior).unwrap();
    agrees(&ConvertedPolar::new(5.0, 0.01).unwrap().with_lag(1.0), [400.0, 0.3], &prior).unwrap();
    agrees(&RangeBearing::new(5.0, 0.01).unwrap(), [400.0, 0.3], &prior).unwrap();
    agrees(&BearingOnly::new(0.01).unwrap().with_range(300.0, 50.0).unwrap(), [1.2], &prior).unwrap();
    agrees(&RangeBearingRate::new(5.0, 0.01, 50.0).unwrap(), [400.0, 0.3, 3.0], &prior).unwrap();
}

#[test]
fn bearings_differ_by_less_than_half_a_turn() {
    let radar = RangeBearing::new(1.0, 0.1).unwrap();
    let difference = Sensor::<4, 2>::difference(&radar, &vector![0.0, 3.1], &vector![0.0, -3.1]);
    assert!((difference[1] - (6.2 - TAU)).abs() < 1e-12);
    for angle in [-1e9, -7.0, -PI, 0.0, PI, 3.2, 1e9] {
        assert!(wrapped(angle).abs() <= PI);
        assert!(((wrapped(angle) - angle) / TAU - ((wrapped(angle) - angle) / TAU).round()).abs() < 1e-6);
    }
}

#[test]
fn a_birth_is_where_the_measurement_says() {
    let prior: Gaussian<4> = ConstantVelocity::new(1.0).with_speed(20.0).prior();
    let here = vector![100.0, -50.0];
    let object = vector![400.0, 350.0, 3.0, 4.0];
    let polar = RangeBearing::new(2.0, 0.01).unwrap().at(here);
    let seen = polar.expected(&object);
    let born = polar.birth(&seen.into(), &prior).unwrap();
    assert!((born.mean - vector![400.0, 350.0, 0.0, 0.0]).amax() < 1e-9);
    assert_eq!(born.covariance[(2, 2)], 400.0);
    let converted = ConvertedPolar::new(2.0, 0.01).unwrap().at(here);
    let born = converted.birth(&seen.into(), &prior).unwrap();
    assert!((born.mean - vector![400.0, 350.0, 0.0, 0.0]).amax() < 0.05);
    let blind = BearingOnly::new(0.01).unwrap().birth(&[0.3].into(), &prior);
    assert!(matches!(blind, Err(FilterError::NotInvertible { .. })));
    let not_finite = polar.birth(&[f64::NAN, 0.0].into(), &prior);
    assert_eq!(not_finite, Err(FilterError::NotFinite { what: "measurement" }));
}

#[test]
fn a_lag_couples_the_born_position_to_its_velocity() {
    let prior: Gaussian<4> = ConstantVelocity::new(1.0).with_speed(10.0).prior();
    let radar = Position::new(2.0).unwrap().with_lag(1.5);
    let born = radar.birth(&[0.0, 0.0].into(), &prior).unwrap();
    assert!((born.covariance[(0, 0)] - (4.0 + 2.25 * 100.0)).abs() < 1e-9);
    assert!((born.covariance[(0, 2)] - 150.0).abs() < 1e-9);
    // Whatever the velocity, the birth explains its measurement: the innovation covariance is 2 R.
    let h = radar.jacobian(&born.mean);
    let explained = h * born.covariance * h.transpose();
    assert!((explained - Matrix2x2::identity() * 4.0).amax() < 1e-9);
}

#[test]
fn an_object_is_expected_where_its_measurement_is_placed() {
    let (here, state) = (vector![100.0, -50.0], vector![400.0, 350.0, 3.0, 4.0]);
    fn agrees<const M: usize>(sensor: &impl Sensor<4, M>, state: &SVector<f64, 4>) {
        let seen = sensor.expected(state);
        let region = sensor.region(&seen, &SVector::repeat(1e-3)).unwrap();
        assert!((region.centre - sensor.place(&seen.into()).unwrap()).norm() < 1e-9);
        assert!(region.contains(&region.centre) && (region.high - region.low).max() < 2.0);
    }
    agrees(&Position::<2>::new(5.0).unwrap().with_lag(2.0), &state);
    agrees(&RangeBearing::new(2.0, 0.01).unwrap().at(here), &state);
    agrees(&RangeBearingRate::new(2.0, 0.01, 1.0).unwrap().at(here, vector![1.0, 1.0]), &state);
    // A converted measurement is a position already when it is compared.
    let converted = ConvertedPolar::new(2.0, 0.01).unwrap().at(here);
    let seen = Sensor::<4, 2>::expected(&RangeBearing::new(2.0, 0.01).unwrap().at(here), &state);
    let expected = converted.expected(&state);
    assert!((Sensor::<4, 2>::place(&converted, &seen.into()).unwrap() - expected).norm() < 0.1);
    let region = Sensor::<4, 2>::region(&converted, &expected, &vector![3.0, 4.0]).unwrap();
    assert_eq!((region.low, region.high), (expected - vector![3.0, 4.0], expected + vector![3.0, 4.0]));
}

type Matrix2x2 = SMatrix<f64, 2, 2>;

#[test]
fn doppler_says_something_of_the_velocity() {
    let prior: Gaussian<4> = ConstantVelocity::new(1.0).with_speed(30.0).prior();
    let radar = RangeBearingRate::new(5.0, 0.001, 0.5).unwrap();
    let born = radar.birth(&[1000.0, 0.0, -12.0].into(), &prior).unwrap();
    assert!((born.mean[2] + 12.0).abs() < 0.1);
    assert!(born.covariance[(2, 2)].sqrt() < 0.6 && born.covariance[(3, 3)].sqrt() > 29.0);
}

#[test]
fn an_unsure_velocity_of_the_sensor_widens_every_range_rate() {
    let radar = RangeBearingRate::new(5.0, 0.001, 0.5).unwrap().with_velocity_deviation(1.2).unwrap();
    let rate = |plot: Measurement<3>| Sensor::<4, 3>::read(&radar, &plot, None).unwrap().noise[(2, 2)].sqrt();
    let plot = Measurement::from([1000.0, 0.0, 3.0]);
    assert!((rate(plot) - 1.3).abs() < 1e-12);
    assert!((rate(plot.with_noise(SMatrix::identity() * 0.81)) - 1.5).abs() < 1e-12);
    assert!(radar.with_velocity_deviation(-1.0).is_err() && radar.with_velocity_deviation(f64::NAN).is_err());
}

#[test]
fn a_noise_that_is_no_covariance_is_refused_where_it_is_read() {
    let prior: Gaussian<4> = ConstantVelocity::new(1.0).prior();
    for noise in [Matrix2x2::zeros(), -Matrix2x2::identity(), Matrix2x2::repeat(f64::NAN)] {
        let plot = Measurement::from([100.0, 0.1]).with_noise(noise);
        let position = Position::<2>::new(1.0).unwrap();
        assert!(Sensor::<4, 2>::read(&position, &plot, None).is_err());
        assert!(position.birth(&plot, &prior).is_err());
        let converted = ConvertedPolar::new(1.0, 0.1).unwrap();
        assert!(Sensor::<4, 2>::read(&converted, &plot, Some(&vector![100.0, 5.0])).is_err());
        assert!(converted.birth(&plot, &prior).is_err());
        assert!(RangeBearing::new(1.0, 0.1).unwrap().birth(&plot, &prior).is_err());
    }
}

#[test]
fn the_area_under_a_unit_of_range_and_bearing_does_not_vanish_at_the_sensor() {
    let radar = RangeBearing::new(5.0, 0.02).unwrap();
    let area = |plot: Measurement<2>| Sensor::<4, 2>::area(&radar, &plot);
    assert_eq!([0.0, 3.0, 70.0].map(|range| area([range, 1.0].into())), [5.0, 5.0, 70.0]);
    assert_eq!(area(Measurement::from([0.0, 0.0]).with_noise(Matrix2x2::identity() * 81.0)), 9.0);
    let doppler = RangeBearingRate::new(5.0, 0.02, 1.0).unwrap().with_clutter_rates(50.0);
    assert_eq!(Sensor::<4, 3>::area(&doppler, &[0.0, 0.0, 2.0].into()), 0.1);
    let space = Position::<3>::new(5.0).unwrap().with_clutter_heights(500.0).unwrap();
    assert_eq!(Sensor::<6, 3>::area(&space, &[0.0; 3].into()), 1.0 / 500.0);
}

proptest::proptest! {
    #[test]
    fn the_region_of_a_polar_sensor_holds_every_place_within_and_touches_some(
        (range, bearing) in (0.0..500.0_f64, -7.0..7.0_f64),
        (along, around) in (0.0..300.0_f64, 0.0..4.0_f64),
    ) {
        let radar = RangeBearing::new(1.0, 0.1).unwrap().at(vector![30.0, -7.0]);
        let region = Sensor::<4, 2>::region(&radar, &vector![range, bearing], &vector![along, around]).unwrap();
        let (mut low, mut high) = (region.high, region.low);
        for i in 0..=200 {
            for j in 0..=4 {
                let share = |i: i32, n: f64| 2.0 * f64::from(i) / n - 1.0;
                let plot = [range + along * share(j, 4.0), bearing + around * share(i, 200.0)];
                let place = Sensor::<4, 2>::place(&radar, &plot.into()).unwrap();
                let inside = Region { low: region.low.add_scalar(-1e-9), high: region.high.add_scalar(1e-9), ..region };
                proptest::prop_assert!(inside.contains(&place), "{place} {region:?}");
                (low, high) = (low.inf(&place), high.sup(&place));
            }
        }
        // No wider than need be, unless the sector is most of a disc or reaches beyond the sensor.
        if along <= range && around <= 3.0 {
            proptest::prop_assert!((low - region.low).amax().max((high - region.high).amax()) < 0.5);
        }
    }
}

/// Mean and covariance of the conversion error over many draws, for a radar with a bearing error of 5 degrees.
fn conversion_error(radar: &ConvertedPolar) -> (Vector2<f64>, Matrix2x2, Matrix2x2) {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    let (range, bearing, deviation) = (10_000.0, 0.7, vector![50.0, 5.0f64.to_radians()]);
    let truth = range_bearing::cartesian(range, bearing);
    let mut generator = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let draws = 40_000;
    let (mut mean, mut square, mut stated) = (Vector2::zeros(), Matrix2x2::zeros(), Matrix2x2::zeros());
    for _ in 0..draws {
        let [a, b]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut generator));
        let measured = vector![range + a * deviation[0], bearing + b * deviation[1]];
        let reading = Sensor::<4, 2>::read(radar, &measured.into(), None).unwrap();
        let error = reading.value - truth;
        mean += error / draws as f64;
        square += error * error.transpose() / draws as f64;
        stated += reading.noise / draws as f64;
    }
    (mean, square, stated)
}

#[test]
fn the_covariance_of_a_conversion_at_an_object_is_that_of_its_errors() {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    let (range, bearing, deviation) = (10_000.0, 0.7, vector![50.0, 5.0f64.to_radians()]);
    let radar = ConvertedPolar::new(deviation[0], deviation[1]).unwrap();
    let truth = range_bearing::cartesian(range, bearing);
    let mut generator = rand_chacha::ChaCha8Rng::seed_from_u64(8);
    let mut square = Matrix2x2::zeros();
    for _ in 0..40_000 {
        let [a, b]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut generator));
        let measured = vector![range + a * deviation[0], bearing + b * deviation[1]];
        let error = Sensor::<4, 2>::read(&radar, &measured.into(), Some(&truth)).unwrap().value - truth;
        square += error * error.transpose() / 40_000.0;
    }
    let stated = Sensor::<4, 2>::read(&radar, &[9e3, 0.6].into(), Some(&truth)).unwrap().noise;
    assert_eq!(stated, Sensor::<4, 2>::noise(&radar, &truth));
    assert!((square - stated).norm() / square.norm() < 0.03, "{square} {stated}");
    // Along the line of sight alone, where the bow of the errors counts most.
    let sight = vector![bearing.cos(), bearing.sin()];
    let along = |m: &Matrix2x2| (sight.transpose() * m * sight)[0];
    assert!((along(&square) / along(&stated) - 1.0).abs() < 0.05, "{} {}", along(&square), along(&stated));
}

#[test]
fn debiasing_removes_the_mean_error_and_states_the_right_covariance() {
    let radar = ConvertedPolar::new(50.0, 5.0f64.to_radians()).unwrap();
    let (mean, covariance, stated) = conversion_error(&radar);
    let (biased_mean, ..) = conversion_error(&radar.biased());
    assert!(biased_mean.norm() > 30.0, "{biased_mean}");
    assert!(mean.norm() < 10.0, "{mean}");
    assert!((covariance - stated).norm() / covariance.norm() < 0.03, "{covariance} {stated}");
}
