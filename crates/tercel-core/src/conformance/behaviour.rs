//! Checks of the behaviour: errors, copies, order, time. They hold for every filter.

use super::world::{Held, Seen, apart, bits, is_sound, look, moving, tracked};
use super::{Problem, Subject};
use crate::association::{Gate, Search};
use crate::filter::{Filter, Innovation};

/// A prediction over no time leaves the state as it is.
pub fn no_time_changes_nothing<const N: usize, S: Subject<N>>(subject: &S) {
    let (filter, mut belief, _) = tracked(subject, 10, 8);
    let before = filter.state(&belief);
    filter.predict(&mut belief, 0.0);
    let difference = apart(&filter.state(&belief), &before);
    assert!(difference < 1e-9, "no time moves the state by {difference:e} deviations");
}

/// Without measurements a belief only widens, and takes the next measurement as if nothing had been missing.
pub fn a_missing_measurement_is_a_prediction<const N: usize, S: Subject<N>>(subject: &S) {
    let (filter, mut belief, mut world) = tracked(subject, 11, 10);
    let mut last = moving(&filter.state(&belief)).deviations();
    for step in 0..20 {
        world.step(1.0);
        filter.predict(&mut belief, 1.0);
        let state = filter.state(&belief);
        assert!(is_sound(&state), "{step} measurements missing: {}", state.covariance);
        let deviations = moving(&state).deviations();
        assert!(
            (0..2).all(|i| deviations[i] > 0.99 * last[i]),
            "position became more certain without a measurement, from {last} to {deviations}"
        );
        last = deviations;
    }
    filter.update(&mut belief, &look(subject, &mut world)).expect("the next measurement updates");
    let after = moving(&filter.state(&belief)).deviations();
    assert!(after[0] < last[0] && after[1] < last[1], "a measurement after a gap says nothing: {after}");
}

/// Two objects may be updated in any order.
pub fn objects_are_independent<const N: usize, S: Subject<N>>(subject: &S) {
    let (filter, first, mut here) = tracked(subject, 12, 5);
    let (_, second, mut there) = tracked(subject, 13, 5);
    let (a, b) = (look(subject, &mut here), look(subject, &mut there));
    let advance = |belief: &Held<N, S>, seen: &Seen<N, S>| {
        let mut belief = belief.clone();
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, seen).unwrap();
        bits(&filter, &belief)
    };
    let forwards = (advance(&first, &a), advance(&second, &b));
    let backwards = (advance(&second, &b), advance(&first, &a));
    assert!(forwards.0 == backwards.1 && forwards.1 == backwards.0, "the order of two objects matters");
}

/// What happens to a copy does not happen to the original, and neither to the copy what happens to the original.
pub fn a_copy_is_independent<const N: usize, S: Subject<N>>(subject: &S) {
    let (filter, mut belief, mut world) = tracked(subject, 14, 5);
    let (mut copy, before) = (belief.clone(), bits(&filter, &belief));
    world.step(1.0);
    let seen = look(subject, &mut world);
    filter.predict(&mut copy, 1.0);
    filter.update(&mut copy, &seen).unwrap();
    assert!(bits(&filter, &belief) == before, "updating a copy changed the original");
    filter.predict(&mut belief, 1.0);
    filter.update(&mut belief, &seen).unwrap();
    assert!(bits(&filter, &copy) == bits(&filter, &belief), "a copy behaves differently from the original");
    let (_, mut reused, _) = tracked(subject, 15, 2);
    reused.clone_from(&belief);
    let held = bits(&filter, &reused);
    assert!(held == bits(&filter, &belief), "a belief copied over another differs from the original");
    filter.predict(&mut belief, 1.0);
    assert!(
        bits(&filter, &reused) == held,
        "a belief copied over another shares something with the original"
    );
}

/// Numbers that are not finite, and noise that is no covariance, give an error, and the belief goes on as if they had
/// never come.
pub fn a_failed_update_changes_nothing<const N: usize, S: Subject<N>>(subject: &S) {
    let (filter, mut belief, mut world) = tracked(subject, 16, 5);
    let mut twin = belief.clone();
    for (index, unusable) in subject.unusable().iter().enumerate() {
        let before = bits(&filter, &belief);
        assert!(filter.innovation(&belief, unusable).is_err(), "measurement {index} was compared");
        assert!(filter.update(&mut belief, unusable).is_err(), "measurement {index} was accepted");
        assert!(bits(&filter, &belief) == before, "measurement {index} failed and changed the belief");
    }
    for _ in 0..5 {
        world.step(1.0);
        let seen = look(subject, &mut world);
        for belief in [&mut belief, &mut twin] {
            filter.predict(belief, 1.0);
            filter.update(belief, &seen).unwrap();
        }
    }
    assert!(bits(&filter, &belief) == bits(&filter, &twin), "failed updates left a trace");
}

/// `innovation` returns what `update` would, and changes nothing.
pub fn innovation_foretells_update<const N: usize, S: Subject<N>>(subject: &S) {
    let (filter, mut belief, mut world) = tracked(subject, 17, 5);
    for _ in 0..10 {
        world.step(1.0);
        filter.predict(&mut belief, 1.0);
        let (seen, before) = (look(subject, &mut world), bits(&filter, &belief));
        let foretold = filter.innovation(&belief, &seen).unwrap();
        assert!(bits(&filter, &belief) == before, "comparing changed the belief");
        let told = filter.update(&mut belief, &seen).unwrap();
        assert!(same(&foretold, &told), "{foretold:?} was foretold, {told:?} came");
        assert!(told.log_likelihood.is_finite() && told.nis >= 0.0 && told.dof() > 0, "{told:?}");
    }
}

fn same(a: &Innovation, b: &Innovation) -> bool {
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (1.0 + a.abs());
    close(a.log_likelihood, b.log_likelihood)
        && close(a.nis, b.nis)
        && a.dof() == b.dof()
        && a.residual().iter().zip(b.residual()).all(|(a, b)| close(*a, *b))
}

/// The same steps give the same belief, bit by bit, also in a filter that was built anew.
pub fn the_same_steps_give_the_same_belief<const N: usize, S: Subject<N>>(subject: &S) {
    let (filter, belief, _) = tracked(subject, 18, 20);
    let (again, other, _) = tracked(subject, 18, 20);
    assert!(bits(&filter, &belief) == bits(&again, &other), "two runs of the same steps differ");
}

/// Measurements of the object lie within the reach of its belief, which is what gates search, and so does every one that the
/// gate takes.
pub fn the_reach_covers_the_measurements<const N: usize, S: Subject<N>>(subject: &S) {
    let (filter, mut belief, mut world) = tracked(subject, 19, 5);
    let (mut inside, mut count) = (0, 0);
    let gate = Gate::new(0.99).unwrap();
    for _ in 0..200 {
        world.step(1.0);
        filter.predict(&mut belief, 1.0);
        let seen = look(subject, &mut world);
        let mut search = Search::new(gate);
        filter.widen(&mut search, &seen);
        let (Some(region), Some(place)) = (filter.reach(&belief, &search), filter.place(&seen)) else {
            return;
        };
        let found = region.contains(&place);
        let gated = filter.innovation(&belief, &seen).is_ok_and(|innovation| gate.contains(&innovation));
        assert!(
            found || !gated,
            "a measurement inside the gate at {place} is not searched for in {region:?}"
        );
        inside += usize::from(found);
        count += 1;
        assert!(filter.area(&seen) > 0.0, "a unit of measurement covers no area");
        filter.update(&mut belief, &seen).unwrap();
    }
    // 99 % of 200 is 198; six standard deviations below it is 189.
    assert!(inside >= 189, "{inside} of {count} measurements lie within the 99 % reach");
}

/// Behind a pointer to `dyn Filter` the filter is the same.
pub fn a_boxed_filter_is_the_filter<const N: usize, S: Subject<N>>(subject: &S) {
    type Boxed<'a, const N: usize, B, Z> = Box<dyn Filter<N, Belief = B, Measurement = Z> + 'a>;
    let (filter, belief, mut world) = tracked(subject, 20, 5);
    let boxed: Boxed<'_, N, Held<N, S>, Seen<N, S>> = Box::new(subject.filter(&Problem::ORDINARY));
    let (mut plain, mut behind) = (belief.clone(), belief);
    for _ in 0..5 {
        world.step(1.0);
        let seen = look(subject, &mut world);
        filter.predict_all(&mut [&mut plain], 1.0);
        boxed.predict_all(&mut [&mut behind], 1.0);
        filter.update(&mut plain, &seen).unwrap();
        boxed.update(&mut behind, &seen).unwrap();
        assert!(bits(&filter, &plain) == bits(&*boxed, &behind), "a boxed filter differs");
        assert_eq!(
            filter.distance(&plain, &behind, 9.0),
            boxed.distance(&plain, &behind, 9.0),
            "a boxed filter measures distance differently"
        );
    }
}
