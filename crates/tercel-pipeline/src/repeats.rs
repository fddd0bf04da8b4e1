//! Detections that stand in their scan more than once.

use std::collections::HashSet;
use std::sync::Arc;

use tercel_data::table::{Detection, Observation, Scan};

/// All that a tracker uses of a detection, bit for bit. What is not given is a number that no file holds.
type Numbers<'a> = ([u64; 11], Option<&'a str>);

/// The scan without the detections that repeat one before them in every number and in their identity; `None` if there is none.
///
/// Two objects are never measured alike to the last bit, but a row is easily written twice. A tracker would take the second for
/// another object, for each object gives one detection, and the two would live side by side.
pub(crate) fn left_out(scan: &Scan) -> Option<Scan> {
    if scan.detections.len() < 2 {
        return None;
    }
    let mut seen = HashSet::with_capacity(scan.detections.len());
    let first: Vec<bool> = scan.detections.iter().map(|detection| seen.insert(numbers(detection))).collect();
    if first.iter().all(|first| *first) {
        return None;
    }
    let kept = scan.detections.iter().zip(first).filter(|(_, first)| *first);
    Some(Scan { detections: kept.map(|(detection, _)| detection.clone()).collect(), ..scan.clone() })
}

/// The scan in two: each name once, and the detections whose names are there before. `None` if every name is there once.
pub(crate) fn named_again(scan: &Scan) -> Option<[Scan; 2]> {
    if scan.detections.len() < 2 {
        return None;
    }
    let mut seen = HashSet::with_capacity(scan.detections.len());
    let mut is_new =
        |detection: &Detection| detection.identity.clone().is_none_or(|identity| seen.insert(identity));
    let (first, again): (Vec<Detection>, Vec<Detection>) =
        scan.detections.iter().cloned().partition(|detection| is_new(detection));
    let part = |detections| Scan {
        position: scan.position,
        velocity: scan.velocity,
        ..Scan::new(scan.time, Arc::clone(&scan.sensor), detections)
    };
    (!again.is_empty()).then(|| [first, again].map(part))
}

fn numbers(detection: &Detection) -> Numbers<'_> {
    let absent = f64::NAN;
    let [a, b, c, height] = match detection.observation {
        Observation::Position { x, y, z } => [x, y, absent, z.unwrap_or(absent)],
        Observation::Polar { range, bearing, range_rate, z } => {
            [range.unwrap_or(absent), bearing, range_rate.unwrap_or(absent), z.unwrap_or(absent)]
        }
    };
    let noise = &detection.noise;
    let deviations = [noise.x, noise.y, noise.z, noise.range, noise.bearing, noise.range_rate];
    let [d, e, f, g, h, i] = deviations.map(|deviation| deviation.unwrap_or(absent));
    let time = detection.time.unwrap_or(absent);
    ([a, b, c, height, d, e, f, g, h, i, time].map(f64::to_bits), detection.identity.as_deref())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(id: u64, x: f64) -> Detection {
        Detection::new(id, Observation::Position { x, y: 0.0, z: None })
    }

    #[test]
    fn the_first_of_equal_detections_stays() {
        let scan = Scan::new(0.0, "radar", vec![at(1, 5.0), at(2, 7.0), at(3, 5.0), at(4, 5.0)]);
        let ids: Vec<u64> =
            left_out(&scan).unwrap().detections.iter().map(|detection| detection.id).collect();
        assert_eq!(ids, [1, 2]);
    }

    #[test]
    fn a_name_that_is_there_twice_is_for_a_second_scan() {
        let named = |id, name: &str| Detection { identity: Some(name.into()), ..at(id, id as f64) };
        let scan =
            Scan::new(0.0, "ais", vec![named(1, "a"), named(2, "b"), named(3, "a"), at(4, 0.0), at(5, 1.0)]);
        let ids: [Vec<u64>; 2] =
            named_again(&scan).unwrap().map(|scan| scan.detections.iter().map(|one| one.id).collect());
        assert_eq!(ids, [vec![1, 2, 4, 5], vec![3]]);
        assert_eq!(named_again(&Scan::new(0.0, "ais", vec![named(1, "a"), named(2, "b")])), None);
    }

    #[test]
    fn what_differs_in_accuracy_or_identity_is_no_repeat() {
        let mut accurate = at(2, 5.0);
        accurate.noise.x = Some(1.0);
        let mut named = at(3, 5.0);
        named.identity = Some("A1".into());
        assert!(left_out(&Scan::new(0.0, "radar", vec![at(1, 5.0), accurate, named])).is_none());
    }
}
