use super::*;
use crate::filter::Kalman;
use crate::motion::ConstantVelocity;
use crate::sensor::{Measurement, Position};

type Plain = Kalman<ConstantVelocity, Position>;

fn filter(reliability: f64) -> Identified<Plain> {
    let motion = ConstantVelocity::new(0.01).with_speed(10.0);
    Identified::new(Kalman::new(motion, Position::new(5.0).unwrap()), reliability).unwrap()
}

fn report(x: f64, y: f64, name: Option<u32>) -> Named<Measurement<2>> {
    Named { measurement: [x, y].into(), identity: name.map(Identity) }
}

/// A belief that has followed a standing object with these names, a second apart.
fn followed(names: &[Option<u32>]) -> NamedBelief<Gaussian<4>> {
    let filter = filter(0.999);
    let mut belief = filter.birth(&report(0.0, 0.0, names[0])).unwrap();
    for name in &names[1..] {
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, &report(0.0, 0.0, *name)).unwrap();
    }
    belief
}

#[test]
fn without_names_it_is_the_inner_filter() {
    let (outer, inner) = (
        filter(0.999),
        Kalman::new(ConstantVelocity::new(0.01).with_speed(10.0), Position::new(5.0).unwrap()),
    );
    let mut named = outer.birth(&report(1.0, 2.0, None)).unwrap();
    let mut plain: Gaussian<4> = inner.birth(&[1.0, 2.0].into()).unwrap();
    for step in 0..50 {
        let x = f64::from(step) * 3.0;
        outer.predict(&mut named, 1.0);
        Filter::<4>::predict(&inner, &mut plain, 1.0);
        let with = outer.update(&mut named, &report(x, 2.0, None)).unwrap();
        let without = inner.update(&mut plain, &[x, 2.0].into()).unwrap();
        assert_eq!((with, named.belief), (without, plain));
    }
}

#[test]
fn the_same_name_is_evidence_for_and_another_against() {
    let (filter, belief) = (filter(0.999), followed(&[Some(1), Some(1), Some(1)]));
    let at = |name| filter.innovation(&belief, &report(4.0, 0.0, name)).unwrap();
    let (same, none, other) = (at(Some(1)), at(None), at(Some(2)));
    assert!((same.log_likelihood - none.log_likelihood - (0.999e6_f64).ln()).abs() < 0.1);
    assert!(other.log_likelihood < none.log_likelihood - 13.0, "{other:?}");
    assert!(same.nis < none.nis + 1e-12 && other.nis > none.nis + 13.8);
}

#[test]
fn an_object_that_was_never_named_takes_the_first_name() {
    let belief = followed(&[None, None, Some(9)]);
    assert_eq!(Filter::<4>::called(&filter(0.999), &belief), Some(Identity(9)));
    assert_eq!(Filter::<4>::called(&filter(0.999), &followed(&[None, None])), None);
}

#[test]
fn a_name_that_is_mostly_right_wins_over_a_wrong_one() {
    let filter = filter(0.7);
    let mut belief: NamedBelief<Gaussian<4>> = filter.birth(&report(0.0, 0.0, Some(1))).unwrap();
    for name in [1, 1, 2, 1, 1] {
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, &report(0.0, 0.0, Some(name))).unwrap();
    }
    assert_eq!(Filter::<4>::called(&filter, &belief), Some(Identity(1)));
}

#[test]
fn a_jump_within_the_speeds_of_its_kind_starts_the_object_anew() {
    let filter = filter(0.999);
    let mut belief = followed(&[Some(1); 60]);
    filter.predict(&mut belief, 20.0);
    // 250 m in 20 s: far outside the gate, and 12.5 m/s.
    let innovation = filter.update(&mut belief, &report(250.0, 0.0, Some(1))).unwrap();
    assert_eq!(innovation.nis, 0.0);
    assert!((belief.belief.mean[0] - 250.0).abs() < 1.0);
    assert_eq!(belief.identity().unwrap().0, Identity(1));
}

#[test]
fn two_objects_of_one_name_far_apart_stay_two() {
    let (filter, mut belief) = (filter(0.999), followed(&[Some(1); 60]));
    filter.predict(&mut belief, 10.0);
    let far = filter.innovation(&belief, &report(20_000.0, 0.0, Some(1))).unwrap();
    assert!(far.nis > 1000.0);
}

#[test]
fn objects_of_different_names_are_never_the_same() {
    let filter = filter(0.999);
    let (a, b, nameless) = (followed(&[Some(1)]), followed(&[Some(2)]), followed(&[None]));
    assert_eq!(filter.distance(&a, &b, 10.0), f64::INFINITY);
    assert_eq!(filter.distance(&a, &nameless, 10.0), 0.0);
}

#[test]
fn reliability_one_would_never_change_its_mind() {
    let inner = Kalman::new(ConstantVelocity::new(0.01), Position::new(5.0).unwrap());
    for reliability in [-0.1, 1.0, 1.5, f64::NAN] {
        assert!(Identified::<Plain>::new(inner, reliability).is_err(), "{reliability}");
    }
}
