//! The simulated air traffic has the statistics that were published for it, and the same flight has the same number everywhere.

use nalgebra::Vector4;
use tercel_sim::air_traffic::{AirTraffic, Manoeuvre, NAMES, Radar};
use tercel_sim::{Interval, SimulationError};

const FLIGHTS: u64 = 2_000;

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
    (mean, variance.sqrt())
}

#[test]
fn a_flight_depends_on_its_seed_and_number_alone() {
    let scenario = AirTraffic::test();
    let (once, again) = (scenario.flight(3, 17), scenario.flight(3, 17));
    assert_eq!(once, again);
    assert_eq!(once.observe(&once.radar(), 3, 17), again.observe(&again.radar(), 3, 17));
    assert_ne!(once.states()[0], scenario.flight(3, 18).states()[0]);
    assert_ne!(once.states()[0], scenario.flight(4, 17).states()[0]);
}

/// The numbers of a flight, so that a change of the generator cannot go unnoticed: results would no longer compare.
#[test]
fn flights_stay_what_they_were() {
    let flight = AirTraffic::test().flight(1, 0);
    let last = flight.states()[199];
    let plots = flight.observe(&flight.radar(), 1, 0);
    let seen = plots[199].unwrap();
    let found = format!(
        "{:.3} {:.3} {:.3} {:.3} | {:.3} {:.6}",
        last[0], last[1], last[2], last[3], seen[0], seen[1]
    );
    assert_eq!(found, "-171359.050 76514.940 -401.844 270.490 | 187688.919 2.726088");
}

/// Published: guessing straight flight all the time is right in 33.25 % of the steps, with a spread of 30.72 % over the
/// validation flights. Legs whose manoeuvres may repeat give this spread; legs of equal length would give 25 %.
#[test]
fn the_share_of_straight_flight_is_as_published() {
    let scenario = AirTraffic::validation();
    let straight = |run| {
        let flight = scenario.flight(5, run);
        let count = flight.manoeuvres().iter().filter(|&&m| m == Manoeuvre::Straight).count();
        100.0 * count as f64 / flight.states().len() as f64
    };
    let shares: Vec<f64> = (0..FLIGHTS).map(straight).collect();
    let (mean, deviation) = mean_and_deviation(&shares);
    // Three standard errors of 2,000 flights: 2.1 for the mean, 1.5 for the spread.
    assert!((mean - 33.3).abs() < 2.1, "{mean}");
    assert!((deviation - 31.2).abs() < 1.5, "{deviation}");
}

#[test]
fn every_step_is_the_turn_of_its_leg_and_a_random_acceleration() {
    let (mut scaled, mut kinematic) = (Vec::new(), 0.0_f64);
    for run in 0..200 {
        let flight = AirTraffic::high_speed().flight(9, run);
        for (pair, rate) in flight.states().windows(2).zip(&flight.rates()[1..]) {
            let rest = pair[1] - moved(&pair[0], *rate);
            scaled.extend([rest[2] / flight.acceleration(), rest[3] / flight.acceleration()]);
            // The position error is half the velocity error: one acceleration over the step makes both.
            kinematic = kinematic.max((rest[0] - 0.5 * rest[2]).abs().max((rest[1] - 0.5 * rest[3]).abs()));
        }
        let told = flight.manoeuvres().iter().zip(flight.rates());
        assert!(told.clone().all(|(manoeuvre, rate)| *manoeuvre == Manoeuvre::of_rate(*rate)));
    }
    let (mean, deviation) = mean_and_deviation(&scaled);
    assert!(mean.abs() < 0.01 && (deviation - 1.0).abs() < 0.01, "{mean} {deviation}");
    assert!(kinematic < 1e-6, "{kinematic}");
}

/// A turn by one second, written from the integral of the velocity.
fn moved(state: &Vector4<f64>, rate: f64) -> Vector4<f64> {
    let (sine, cosine) = rate.sin_cos();
    let (along, across) = if rate == 0.0 { (1.0, 0.0) } else { (sine / rate, (1.0 - cosine) / rate) };
    let (vx, vy) = (state[2], state[3]);
    Vector4::new(
        state[0] + along * vx - across * vy,
        state[1] + across * vx + along * vy,
        cosine * vx - sine * vy,
        sine * vx + cosine * vy,
    )
}

#[test]
fn parameters_fill_their_intervals() {
    let scenario = AirTraffic::test();
    let flights: Vec<_> = (0..FLIGHTS).map(|run| scenario.flight(11, run)).collect();
    let spans = |low: f64, high: f64, values: &mut dyn Iterator<Item = f64>| {
        let (bottom, top) = values.fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
        let room = 0.01 * (high - low);
        assert!(bottom >= low && bottom < low + room && top <= high && top > high - room, "{bottom} {top}");
    };
    spans(5.0, 20.0, &mut flights.iter().map(|f| f.acceleration()));
    spans(50e3, 150e3, &mut flights.iter().map(|f| f.states()[0].xy().norm()));
    spans(50.0, 400.0, &mut flights.iter().filter_map(|f| f.speeds().next()));
    spans(0.0, 12.0, &mut flights.iter().flat_map(|f| f.rates()).map(|rate| rate.abs().to_degrees()));
    for ten in 1..=10 {
        let of = |radar: Radar| (radar.range() - 10.0 * f64::from(ten)).abs() < 1e-9;
        let share = flights.iter().filter(|f| of(f.radar())).count() as f64 / FLIGHTS as f64;
        assert!((share - 0.1).abs() < 0.02, "{share}");
    }
}

#[test]
fn plots_err_as_the_radar_says() {
    let scenario = AirTraffic::test();
    let radar = Radar::new(50.0, 0.5_f64.to_radians()).unwrap();
    let (mut range, mut bearing) = (Vec::new(), Vec::new());
    for run in 0..100 {
        let flight = scenario.flight(13, run);
        for (state, plot) in flight.states().iter().zip(flight.observe(&radar, 13, run)) {
            let plot = plot.unwrap();
            assert!((-std::f64::consts::PI..=std::f64::consts::PI).contains(&plot[1]));
            range.push((plot[0] - state[0].hypot(state[1])) / 50.0);
            let angle = plot[1] - state[1].atan2(state[0]);
            bearing.push(angle.sin().atan2(angle.cos()).to_degrees() / 0.5);
        }
    }
    for errors in [range, bearing] {
        let (mean, deviation) = mean_and_deviation(&errors);
        assert!(mean.abs() < 0.025 && (deviation - 1.0).abs() < 0.02, "{mean} {deviation}");
    }
}

#[test]
fn a_lower_detection_probability_only_takes_plots_away() {
    let flight = AirTraffic::test().flight(2, 5);
    let all = flight.observe(&flight.radar(), 2, 5);
    let mut last = all.clone();
    for detection in [0.9, 0.65, 0.2, 0.0] {
        let some = flight.observe(&flight.radar().with_detection(detection).unwrap(), 2, 5);
        assert!(some.iter().zip(&last).all(|(some, last)| some.is_none() || some == last));
        let share = some.iter().flatten().count() as f64 / some.len() as f64;
        assert!((share - detection).abs() < 0.12, "{share} at {detection}");
        last = some;
    }
    assert!(last[0].is_some() && last[1..].iter().all(Option::is_none));
}

#[test]
fn another_realisation_measures_the_same_flight_anew() {
    let flight = AirTraffic::test().flight(2, 5);
    let first = flight.observe(&flight.radar(), 2, 5);
    let second = flight.observe(&flight.radar().with_realisation(1), 2, 5);
    assert!(first.iter().zip(&second).all(|(a, b)| a != b));
}

#[test]
fn every_published_population_has_its_name() {
    assert!(NAMES.iter().all(|name| AirTraffic::named(name).is_some()));
    assert_eq!(AirTraffic::named("atc"), None);
}

#[test]
fn impossible_numbers_are_refused_by_name() {
    let refused: [(Result<AirTraffic, SimulationError>, &str); 5] = [
        (AirTraffic::test().with_steps(6), "most switches"),
        (AirTraffic::test().with_interval(0.0), "time between steps"),
        (AirTraffic::test().with_switches(0..=200), "most switches"),
        (AirTraffic::test().with_radars(vec![], vec![0.1]), "range deviation"),
        (AirTraffic::test().with_speed(Interval::new(-1.0, 2.0).unwrap()), "speed"),
    ];
    for (result, expected) in refused {
        let message = result.unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    assert!(AirTraffic::test().with_switches(0..=0).unwrap().with_steps(1).is_ok());
}
