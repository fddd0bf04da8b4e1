//! Checks of the numbers: agreement, consistency, definiteness, moments.

use nalgebra::Vector2;

use super::world::{World, apart, is_sound, look, moving, tracked};
use super::{Problem, Subject};
use crate::belief::Gaussian;
use crate::filter::{Filter, Kalman};
use crate::sensor::Measurement;

/// Position and velocity equal those of the Kalman filter, with irregular steps and missing measurements.
pub fn equals_the_kalman_filter<const N: usize, S: Subject<N>>(subject: &S) {
    let Some(tolerance) = subject.expectations().kalman else { return };
    const STEPS: usize = 300;
    let problem = Problem::ORDINARY;
    let (filter, exact) = (subject.filter(&problem), Kalman::new(problem.motion(), problem.sensor()));
    let mut world = World::new(problem, 1);
    let error = world.normal();
    let plain = |position: Vector2<f64>, error: &Vector2<f64>| -> Measurement<2> {
        (position + problem.deviations.component_mul(error)).into()
    };
    let mut belief = filter.birth(&subject.measurement(&problem, &world.position(), &error)).unwrap();
    let mut reference: Gaussian<4> = exact.birth(&plain(world.position(), &error)).unwrap();
    let mut squares = 0.0;
    for _ in 0..STEPS {
        let dt = world.interval();
        world.step(dt);
        filter.predict(&mut belief, dt);
        exact.predict(&mut reference, dt);
        if world.chance(0.8) {
            let error = world.normal();
            filter.update(&mut belief, &subject.measurement(&problem, &world.position(), &error)).unwrap();
            exact.update(&mut reference, &plain(world.position(), &error)).unwrap();
        }
        squares += apart(&moving(&filter.state(&belief)), &reference).powi(2);
    }
    let difference = (squares / STEPS as f64).sqrt();
    assert!(difference <= tolerance, "differs from the Kalman filter by {difference:e} deviations");
}

/// The normalised error squared of position and velocity, averaged over many objects, lies inside its 99 % bounds.
pub fn errors_match_the_covariance<const N: usize, S: Subject<N>>(subject: &S) {
    let Some(runs) = subject.expectations().consistent else { return };
    const TIMES: [usize; 3] = [0, 5, 30];
    let mut sums = [0.0; TIMES.len()];
    for run in 0..runs {
        let (filter, mut belief, mut world) = tracked(subject, 1000 + run, TIMES[0]);
        for (index, sum) in sums.iter_mut().enumerate() {
            let since = if index == 0 { TIMES[0] } else { TIMES[index - 1] };
            for _ in since..TIMES[index] {
                world.step(1.0);
                filter.predict(&mut belief, 1.0);
                filter.update(&mut belief, &look(subject, &mut world)).unwrap();
            }
            *sum += moving(&filter.state(&belief)).mahalanobis(&world.truth).unwrap();
        }
    }
    let runs = runs as f64;
    let [low, high] = [-2.5758, 2.5758].map(|normal| chi_square(4.0 * runs, normal) / runs);
    for (sum, time) in sums.iter().zip(TIMES) {
        let mean = sum / runs;
        assert!(low < mean && mean < high, "NEES {mean:.2} outside {low:.2} to {high:.2} after {time} steps");
    }
}

/// Quantile of the chi-square distribution at a quantile of the normal one, by Wilson and Hilferty (1931). With hundreds of
/// degrees of freedom its error is below 1e-4 of the value.
pub fn chi_square(dof: f64, normal: f64) -> f64 {
    let spread = 2.0 / (9.0 * dof);
    dof * (1.0 - spread + normal * spread.sqrt()).powi(3)
}

/// Covariances stay positive definite over 10,000 steps, at noises from a micrometre to a thousand kilometres, equal or
/// not between the axes, and steps from a millisecond to a quarter of an hour, mixed or not.
pub fn covariances_stay_positive_definite<const N: usize, S: Subject<N>>(subject: &S) {
    const STEPS: usize = 10_000;
    let sizes = [1e-6, 1.0, 1e6];
    let mixed = [(1e-6, 1e6), (1e6, 1e-3)];
    let cases: Vec<(f64, f64, f64)> = if subject.expectations().extremes {
        let axes = sizes.map(|size| (size, size)).into_iter().chain(mixed);
        axes.flat_map(|(a, b)| sizes.map(|size| (size * size, a, b))).collect()
    } else {
        vec![(0.5, 5.0, 8.0)]
    };
    for (density, a, b) in cases {
        let problem = Problem { density, deviations: Vector2::new(a, b) };
        let filter = subject.filter(&problem);
        if subject.expectations().extremes {
            survive(subject, &filter, problem, &[1e-3], STEPS);
            survive(subject, &filter, problem, &[1e3], STEPS);
            survive(subject, &filter, problem, &[1e-3, 1.0, 1e3, 0.1], STEPS);
        } else {
            survive(subject, &filter, problem, &[0.1, 1.0, 3.0], STEPS / 20);
        }
    }
}

fn survive<const N: usize, S: Subject<N>>(
    subject: &S,
    filter: &S::Filter,
    problem: Problem,
    times: &[f64],
    steps: usize,
) {
    let mut world = World::new(problem, 2);
    let mut belief = filter.birth(&look(subject, &mut world)).unwrap();
    for (step, dt) in (0..steps).zip(times.iter().cycle()) {
        filter.predict(&mut belief, *dt);
        let state = filter.state(&belief);
        assert!(is_sound(&state), "predicted, step {step} of {dt} s, {problem:?}: {}", state.covariance);
        // The object stays near where it is believed to be: at the longest steps a free one would soon be so far away
        // that its position has no digits left for the errors.
        let expected = Vector2::new(state.mean[0], state.mean[1]);
        let seen = subject.measurement(&problem, &expected, &world.normal());
        if let Err(error) = filter.update(&mut belief, &seen) {
            panic!("step {step} of {dt} s, {problem:?}: {error}");
        }
        let state = filter.state(&belief);
        assert!(is_sound(&state), "updated, step {step} of {dt} s, {problem:?}: {}", state.covariance);
    }
}

/// Two predictions equal one over the sum of the times.
pub fn predictions_compose<const N: usize, S: Subject<N>>(subject: &S) {
    let Some(tolerance) = subject.expectations().composes else { return };
    let (filter, belief, _) = tracked(subject, 3, 10);
    for (a, b) in [(1.0, 1.0), (0.01, 7.0), (30.0, 0.5)] {
        let (mut twice, mut once) = (belief.clone(), belief.clone());
        filter.predict(&mut twice, a);
        filter.predict(&mut twice, b);
        filter.predict(&mut once, a + b);
        let difference = apart(&moving(&filter.state(&twice)), &moving(&filter.state(&once)));
        assert!(
            difference <= tolerance,
            "{a} s and {b} s differ from their sum by {difference:e} deviations"
        );
    }
}

/// A merged belief has the moments of the two, and a replaced state is the one that was set.
pub fn beliefs_merge_to_their_moments<const N: usize, S: Subject<N>>(subject: &S) {
    let Some(tolerance) = subject.expectations().moments else { return };
    let (filter, belief, _) = tracked(subject, 4, 6);
    let (_, other, _) = tracked(subject, 5, 3);
    let (mut expected, addition) = (filter.state(&belief), filter.state(&other));
    expected.merge(0.7, &addition, 0.2);
    let mut merged = belief.clone();
    filter.merge(&mut merged, 0.7, &other, 0.2);
    let difference = apart(&filter.state(&merged), &expected);
    assert!(difference <= tolerance, "merging misses the moments by {difference:e} deviations");

    // Weights that vanish leave the belief as it is, and none of it is lost to a full one.
    let mut same = belief.clone();
    filter.merge(&mut same, 1.0, &other, 0.0);
    let difference = apart(&filter.state(&same), &filter.state(&belief));
    assert!(
        difference <= tolerance,
        "an addition of no weight moves the belief by {difference:e} deviations"
    );

    let mut moved = belief.clone();
    filter.set_state(&mut moved, &addition);
    let difference = apart(&moving(&filter.state(&moved)), &moving(&addition));
    assert!(difference <= tolerance, "the state is {difference:e} deviations away from the one that was set");
}
