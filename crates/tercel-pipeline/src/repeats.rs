//! Detections that stand in their scan more than once.

use std::collections::HashSet;

use tercel_data::table::{Detection, Observation, Scan};

/// All that a tracker uses of a detection, bit for bit. What is not given is a number that no file holds.
type Numbers<'a> = ([u64; 10], Option<&'a str>);

/// The scan without the detections that repeat one before them in every number and in their identity; `None` if there is none.
///
/// Two objects are never measured alike to the last bit, but a row is easily written twice. A tracker would take the second for
/// another object, for each object gives one detection, and the two would live side by side.
pub(crate) fn left_out(scan: &Scan) -> Option<Scan> {
    let mut seen = HashSet::with_capacity(scan.detections.len());
    let first: Vec<bool> = scan.detections.iter().map(|detection| seen.insert(numbers(detection))).collect();
    if first.iter().all(|first| *first) {
        return None;
    }
    let kept = scan.detections.iter().zip(first).filter(|(_, first)| *first);
    Some(Scan { detections: kept.map(|(detection, _)| detection.clone()).collect(), ..scan.clone() })
}

fn numbers(detection: &Detection) -> Numbers<'_> {
    let absent = f64::NAN;
    let [a, b, c] = match detection.observation {
        Observation::Position { x, y, z } => [x, y, z.unwrap_or(absent)],
        Observation::Polar { range, bearing, range_rate } => {
            [range.unwrap_or(absent), bearing, range_rate.unwrap_or(absent)]
        }
    };
    let noise = &detection.noise;
    let deviations = [noise.x, noise.y, noise.z, noise.range, noise.bearing, noise.range_rate];
    let [d, e, f, g, h, i] = deviations.map(|deviation| deviation.unwrap_or(absent));
    let time = detection.time.unwrap_or(absent);
    ([a, b, c, d, e, f, g, h, i, time].map(f64::to_bits), detection.identity.as_deref())
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
    fn what_differs_in_accuracy_or_identity_is_no_repeat() {
        let mut accurate = at(2, 5.0);
        accurate.noise.x = Some(1.0);
        let mut named = at(3, 5.0);
        named.identity = Some("A1".into());
        assert!(left_out(&Scan::new(0.0, "radar", vec![at(1, 5.0), accurate, named])).is_none());
    }
}
