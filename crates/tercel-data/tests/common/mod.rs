//! Arbitrary tables.

use std::f64::consts::PI;
use std::sync::Arc;

use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use tercel_data::table::{
    Description, Detection, Detections, Metric, Metrics, Noise, Observation, Origin, Scan, SensorDescription,
    Status, Track, Tracks, Truth, Truths,
};

/// Any finite number, subnormal ones and both zeros included.
pub fn finite() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |number| number.is_finite())
}

fn positive() -> impl Strategy<Value = f64> {
    finite().prop_map(f64::abs).prop_filter("positive", |number| *number > 0.0)
}

fn angle() -> impl Strategy<Value = f64> {
    prop_oneof![-PI..=PI, Just(PI), Just(-PI), Just(-0.0)]
}

/// Any name, with quotes, commas, line ends and blanks; only the empty one stands for no name.
fn name() -> impl Strategy<Value = Arc<str>> {
    prop_oneof!["[a-z]{1,6}", "\\PC{1,8}", "[ ,\"'#\\r\\n\\ta]{1,5}"].prop_map(Arc::from)
}

fn origin() -> impl Strategy<Value = Option<Origin>> {
    let origin = (-PI / 2.0..=PI / 2.0, -PI..=PI, finite())
        .prop_map(|(latitude, longitude, altitude)| Origin { latitude, longitude, altitude });
    option::of(origin)
}

fn observation() -> impl Strategy<Value = Observation> {
    prop_oneof![
        (finite(), finite(), option::of(finite())).prop_map(|(x, y, z)| Observation::Position { x, y, z }),
        (option::of(positive()), angle(), option::of(finite()), option::of(finite()))
            .prop_map(|(range, bearing, range_rate, z)| Observation::Polar { range, bearing, range_rate, z }),
    ]
}

fn noise() -> impl Strategy<Value = Noise> {
    proptest::array::uniform6(option::of(positive()))
        .prop_map(|[x, y, z, range, bearing, range_rate]| Noise { x, y, z, range, bearing, range_rate })
}

fn scan() -> impl Strategy<Value = Scan> {
    let detection = (observation(), noise(), option::of(name()), option::of(name())).prop_map(
        |(observation, noise, identity, truth)| Detection {
            noise,
            identity,
            truth,
            ..Detection::new(0, observation)
        },
    );
    let triple = || option::of(proptest::array::uniform3(finite()));
    // The time of a scan is that of its last detection, so one has none of its own.
    let ages = vec(option::of(1.0..10.0), 3);
    (-1e9..1e9, name(), triple(), triple(), vec(detection, 0..4), ages).prop_map(
        |(time, sensor, position, velocity, mut detections, ages)| {
            for (detection, age) in detections.iter_mut().skip(1).zip(ages) {
                detection.time = age.map(|age: f64| time - age);
            }
            Scan { time, sensor, position, velocity, detections }
        },
    )
}

fn description() -> impl Strategy<Value = Description> {
    let sensor = (any::<bool>(), any::<bool>(), option::of(positive()))
        .prop_map(|(reports, identity, interval)| SensorDescription { reports, identity, interval });
    let sensors = proptest::collection::btree_map(name().prop_map(|name| name.to_string()), sensor, 0..3);
    let source = option::of(name().prop_map(|name| name.to_string()));
    (source, sensors).prop_map(|(source, sensors)| Description { source, sensors })
}

pub fn detections() -> impl Strategy<Value = Detections> {
    let head = (origin(), description());
    (head, vec(scan(), 0..6), any::<u32>(), 1..1000_u64).prop_map(|(head, mut scans, first, step)| {
        let (origin, description) = head;
        scans.sort_by(|one, next| one.time.total_cmp(&next.time));
        let detections = scans.iter_mut().flat_map(|scan| &mut scan.detections);
        detections.enumerate().for_each(|(i, detection)| detection.id = u64::from(first) + i as u64 * step);
        Detections { origin, scans, description }
    })
}

pub fn truths() -> impl Strategy<Value = Truths> {
    let extent = (positive(), positive(), finite()).prop_map(|(a, b, angle)| [a, b, angle]);
    let row = (
        finite(),
        name(),
        proptest::array::uniform2(finite()),
        option::of(finite()),
        option::of(proptest::array::uniform2(finite())),
        option::of(extent),
    )
        .prop_map(|(time, object, position, z, velocity, extent)| Truth {
            time,
            object,
            position,
            z,
            velocity,
            extent,
        });
    (origin(), vec(row, 0..6)).prop_map(|(origin, rows)| Truths { origin, rows })
}

const STATES: [&[&str]; 3] = [&["x", "y"], &["x", "y", "vx", "vy"], &["x", "y", "vx", "vy", "turn_rate"]];

fn track(n: usize, modes: usize, on_earth: bool) -> impl Strategy<Value = Track> {
    let extent = (positive(), positive(), finite()).prop_map(|(a, b, angle)| [a, b, angle]);
    let status = proptest::sample::select(vec![
        Status::Tentative,
        Status::Confirmed,
        Status::Coasted,
        Status::Deleted,
    ]);
    let covariance = prop_oneof![Just(Vec::new()), vec(finite(), n * (n + 1) / 2)];
    let head = (finite(), prop_oneof![name(), Just("".into())], any::<u64>(), status, 0.0..=1.0);
    let state = (vec(finite(), n), covariance, vec(0.0..=1.0, modes));
    let altitude = option::of(finite()).prop_map(move |altitude| altitude.filter(|_| on_earth));
    let name = option::of(name());
    (head, state, option::of(extent), (altitude, name), option::of(any::<u64>())).prop_map(
        |(
            (time, sensor, track, status, existence),
            (state, covariance, modes),
            extent,
            (altitude, identity),
            detection,
        )| Track {
            time,
            sensor,
            track,
            status,
            existence,
            state,
            covariance,
            modes,
            extent,
            altitude,
            identity,
            detection,
        },
    )
}

pub fn tracks() -> impl Strategy<Value = Tracks> {
    (origin(), 0..3_usize, 0..3_usize).prop_flat_map(|(origin, state, modes)| {
        let labels: Vec<String> = STATES[state].iter().map(|label| (*label).to_owned()).collect();
        let modes: Vec<String> =
            ["straight", "turn, \"left\" "][..modes].iter().map(|m| (*m).to_owned()).collect();
        vec(track(labels.len(), modes.len(), origin.is_some()), 0..5).prop_map(move |rows| Tracks {
            origin,
            labels: labels.clone(),
            modes: modes.clone(),
            rows,
        })
    })
}

pub fn metrics() -> impl Strategy<Value = Metrics> {
    let text = || prop_oneof![name().prop_map(|name| name.to_string()), Just(String::new())];
    let value = prop_oneof![finite(), Just(f64::INFINITY), Just(f64::NEG_INFINITY)];
    let row = (text(), text(), text(), name(), text(), value).prop_map(
        |(study, method, run, metric, component, value)| Metric {
            study,
            method,
            run,
            metric: metric.to_string(),
            component,
            value,
        },
    );
    vec(row, 0..6).prop_map(|rows| Metrics { rows })
}
