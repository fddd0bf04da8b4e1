//! Measurements that are older than their scan: a radar that turns once in four seconds.

#![allow(clippy::unwrap_used)]

use nalgebra::{SMatrix, SVector, vector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use tercel_core::belief::Gaussian;
use tercel_core::filter::{Extended, Filter, Imm, Kalman, Padded, Particle, Transition, Unscented};
use tercel_core::filter::{RandomTurns, RaoBlackwellised, TurnBank};
use tercel_core::motion::{AccelerationNoise, ConstantAcceleration, ConstantVelocity, Turn};
use tercel_core::sensor::{ConvertedPolar, Measurement, Position, RangeBearing, RangeBearingRate, Sensor};

/// How a run is reported: with the ages, or as if every measurement had been taken at the time of its scan.
#[derive(Clone, Copy, PartialEq)]
enum Report {
    Exact,
    Aged,
    AgeWithheld,
}

/// Time between scans, s.
const PERIOD: f64 = 4.0;

/// Mean square error of the position and mean normalised square error of `x, y, vx, vy` over the later scans of many flights at
/// 250 m/s, with measurements that are up to a scan old.
fn errors<const N: usize, const M: usize, F>(
    filter: &F,
    sensor: &impl Sensor<4, M>,
    deviations: [f64; M],
    report: Report,
    runs: u64,
) -> (f64, f64)
where
    F: Filter<N, Measurement = Measurement<M>> + ?Sized,
{
    let (mut square, mut nees, mut count) = (0.0, 0.0, 0.0);
    for run in 0..runs {
        let mut random = ChaCha8Rng::seed_from_u64(run);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let heading = normal() * 3.0;
        let start: SVector<f64, 4> = vector![30e3, -20e3, 250.0 * heading.cos(), 250.0 * heading.sin()];
        let at = |time: f64| start + vector![start[2], start[3], 0.0, 0.0] * time;
        let ages: Vec<f64> = {
            let mut random = ChaCha8Rng::seed_from_u64(1000 + run);
            (0..40).map(|_| Uniform::new(0.0, PERIOD).unwrap().sample(&mut random)).collect()
        };
        let mut belief = None;
        for (scan, age) in ages.into_iter().enumerate() {
            let time = PERIOD * scan as f64;
            let seen = if report == Report::Exact { at(time) } else { at(time - age) };
            let noise = SVector::<f64, M>::from_fn(|i, _| deviations[i] * normal());
            let plot = Measurement::from(sensor.expected(&seen) + noise);
            let plot = if report == Report::Aged { plot.with_age(age) } else { plot };
            let Some(belief) = &mut belief else {
                belief = Some(filter.birth(&plot).unwrap());
                continue;
            };
            filter.predict(belief, PERIOD);
            filter.update(belief, &plot).unwrap();
            if scan >= 10 {
                let state: Gaussian<N> = filter.state(belief);
                let error: SVector<f64, 4> = SVector::from_fn(|i, _| state.mean[i] - at(time)[i]);
                let part: SMatrix<f64, 4, 4> = SMatrix::from_fn(|i, j| state.covariance[(i, j)]);
                square += error.xy().norm_squared();
                nees += Gaussian::new(SVector::zeros(), part).unwrap().mahalanobis(&error).unwrap();
                count += 1.0;
            }
        }
    }
    (square / count, nees / count)
}

/// Whether a filter errs with old measurements as it does with fresh ones and says so, and would not without their ages. Where
/// the velocity is unsure, a place of some seconds ago says less of that of now: `loss` is what this may cost.
fn is_as_good_as_with_exact_times<const N: usize, const M: usize, F>(
    filter: &F,
    sensor: &impl Sensor<4, M>,
    deviations: [f64; M],
    runs: u64,
    loss: f64,
) where
    F: Filter<N, Measurement = Measurement<M>> + ?Sized,
{
    let of = |report| errors(filter, sensor, deviations, report, runs);
    let (exact, aged, withheld) = (of(Report::Exact), of(Report::Aged), of(Report::AgeWithheld));
    assert!(aged.0 < loss * exact.0, "{exact:?} {aged:?}");
    assert!(aged.1 < exact.1 + 0.3 && aged.1 < 4.5, "{exact:?} {aged:?}");
    assert!(withheld.0 > 10.0 * aged.0, "{aged:?} {withheld:?}");
}

/// White acceleration that hardly matters: the flights are straight.
fn calm() -> ConstantVelocity {
    ConstantVelocity::new(1e-4).with_speed(250.0)
}

#[test]
fn a_kalman_filter_of_positions_is_as_good_with_old_measurements() {
    let radar = Position::<2>::new(30.0).unwrap();
    is_as_good_as_with_exact_times::<4, 2, _>(&Kalman::new(calm(), radar), &radar, [30.0; 2], 60, 1.2);
}

#[test]
fn polar_filters_are_as_good_with_old_measurements() {
    let deviations = [30.0, 0.002];
    let radar = RangeBearing::new(30.0, 0.002).unwrap();
    is_as_good_as_with_exact_times::<4, 2, _>(&Extended::new(calm(), radar), &radar, deviations, 60, 1.2);
    is_as_good_as_with_exact_times::<4, 2, _>(&Unscented::new(calm(), radar), &radar, deviations, 60, 1.2);
    let converted = ConvertedPolar::new(30.0, 0.002).unwrap();
    is_as_good_as_with_exact_times::<4, 2, _>(&Kalman::new(calm(), converted), &radar, deviations, 60, 1.2);
    let doppler = RangeBearingRate::new(30.0, 0.002, 1.0).unwrap();
    let filter = Unscented::<_, _, 3>::new(calm(), doppler);
    is_as_good_as_with_exact_times::<4, 3, _>(&filter, &doppler, [30.0, 0.002, 1.0], 60, 1.2);
}

#[test]
fn mixtures_are_as_good_with_old_measurements() {
    let radar = Position::<2>::new(30.0).unwrap();
    let modes = [0.0, 0.02, -0.02].map(|rate| Kalman::new(Turn::new(rate, 1e-4).with_speed(250.0), radar));
    let imm = Imm::new(modes, Transition::sticky(0.99).per(1.0)).unwrap();
    is_as_good_as_with_exact_times::<4, 2, _>(&imm, &radar, [30.0; 2], 60, 1.6);
    let bank = TurnBank::evenly(0.03, 2).unwrap().with_noise(AccelerationNoise::White(1e-4));
    let bank = bank.filter(radar).unwrap();
    is_as_good_as_with_exact_times::<4, 2, _>(&bank, &radar, [30.0; 2], 60, 1.6);

    type Mode = Box<dyn Filter<6, Belief = Gaussian<6>, Measurement = Measurement<2>>>;
    let straight: Mode = Box::new(Padded::<_, 4>::new(Kalman::new(calm(), radar), 0.1).unwrap());
    let bent: Mode = Box::new(Kalman::new(ConstantAcceleration::new(1e-4).with_speed(250.0), radar));
    let imm = Imm::new([straight, bent], Transition::sticky(0.95)).unwrap();
    is_as_good_as_with_exact_times::<6, 2, _>(&imm, &radar, [30.0; 2], 60, 1.6);
}

#[test]
fn filters_with_particles_are_as_good_with_old_measurements() {
    let radar = Position::<2>::new(30.0).unwrap();
    let rough = ConstantVelocity::new(4.0).with_speed(250.0);
    let cloud = Particle::new(rough, radar, 3000, 1).unwrap().with_smoothing(0.2).unwrap();
    is_as_good_as_with_exact_times::<4, 2, _>(&cloud, &radar, [30.0; 2], 6, 1.6);
    let turns = RandomTurns::new(1.0 / 400.0, 0.02, 0.5..=1.0).unwrap().with_speed(250.0).unwrap();
    let histories = RaoBlackwellised::new(turns, radar, 300, 1).unwrap();
    is_as_good_as_with_exact_times::<4, 2, _>(&histories, &radar, [30.0; 2], 6, 1.6);
}

#[test]
fn several_measurements_of_different_ages_are_compared_each_with_its_own() {
    let radar = RangeBearing::new(30.0, 0.01).unwrap();
    let filter = Extended::new(calm(), radar);
    let covariance = SMatrix::from_diagonal(&vector![1e4, 2e4, 900.0, 400.0]);
    let belief = Gaussian::new(vector![8e3, 3e3, 200.0, -100.0], covariance).unwrap();
    let plots = [0.0, 2.0, 2.0, 0.5, 0.0].map(|age| Measurement::from([8500.0, 0.36]).with_age(age));
    let mut found = Vec::new();
    filter.innovations(&belief, &plots.each_ref(), &mut found);
    for (plot, found) in plots.iter().zip(&found) {
        let (alone, found) = (filter.innovation(&belief, plot).unwrap(), found.as_ref().unwrap());
        assert!((alone.nis - found.nis).abs() < 1e-9 * alone.nis);
        assert_eq!(alone.residual(), found.residual());
    }
    assert!((found[0].as_ref().unwrap().nis - found[1].as_ref().unwrap().nis).abs() > 0.1);
    // Two of one age and one of another: the mixture of the three updates.
    let parts: Vec<_> = plots.iter().take(3).map(|plot| (0.25, plot)).collect();
    let (mut together, mut mixed) = (belief, None::<Gaussian<4>>);
    assert_eq!(filter.associate(&mut together, &parts, 0.25), 0.75);
    for (number, (weight, plot)) in parts.iter().enumerate() {
        let mut updated = belief;
        filter.update(&mut updated, plot).unwrap();
        match &mut mixed {
            Some(mixed) => mixed.merge(weight * number as f64, &updated, *weight),
            None => mixed = Some(updated),
        }
    }
    let mut mixed = mixed.unwrap();
    mixed.merge(0.75, &belief, 0.25);
    assert!((together.mean - mixed.mean).norm() < 1e-6);
    assert!((together.covariance - mixed.covariance).norm() < 1e-9 * mixed.covariance.norm());
}
