//! True objects as columns.

use std::collections::BTreeMap;

use serde::Serialize;
use tercel_data::table::{Truth, Truths};

use super::budget::{keep_longest, stride};
use crate::report::number::Number;

/// One true object, in the order of time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct TruthColumns {
    name: String,
    t: Vec<Number>,
    x: Vec<Number>,
    y: Vec<Number>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    vx: Vec<Number>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    vy: Vec<Number>,
}

/// Splits the table into objects, in the order of their names, and takes an even share of the rows of each when there are more
/// than `limit`.
pub(super) fn columns_of_truths(
    truths: &Truths,
    start: f64,
    limit: usize,
    remarks: &mut Vec<String>,
) -> Vec<TruthColumns> {
    let mut objects: BTreeMap<&str, Vec<&Truth>> = BTreeMap::new();
    for row in truths.rows.iter().filter(|row| row.time.is_finite()) {
        objects.entry(&row.object).or_default().push(row);
    }
    keep_longest(&mut objects, "true objects", remarks);
    let stride = stride(truths.rows.len(), limit);
    if stride > 1 {
        remarks.push(format!("One in {stride} of {} rows of the truth is drawn.", truths.rows.len()));
    }
    objects.into_iter().map(|(name, rows)| columns(name, rows, start, stride)).collect()
}

fn columns(name: &str, mut rows: Vec<&Truth>, start: f64, stride: usize) -> TruthColumns {
    rows.sort_by(|a, b| a.time.total_cmp(&b.time));
    let last = rows.len() - 1;
    let drawn: Vec<&Truth> =
        rows.iter().enumerate().filter(|(i, _)| i % stride == 0 || *i == last).map(|(_, row)| *row).collect();
    let column = |value: &dyn Fn(&Truth) -> f64| drawn.iter().map(|row| Number::milli(value(row))).collect();
    let moving = drawn.iter().any(|row| row.velocity.is_some());
    let speed = |axis: usize| match moving {
        true => column(&|row| row.velocity.map_or(f64::NAN, |velocity| velocity[axis])),
        false => Vec::new(),
    };
    TruthColumns {
        name: name.to_owned(),
        t: column(&|row| row.time - start),
        x: column(&|row| row.position[0]),
        y: column(&|row| row.position[1]),
        vx: speed(0),
        vy: speed(1),
    }
}

/// How many true objects are there at each time: an object is there from its first row to its last.
pub(super) fn count_objects(times: &[f64], truths: &Truths) -> Vec<f64> {
    let mut lives: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for row in truths.rows.iter().filter(|row| row.time.is_finite()) {
        let life = lives.entry(&row.object).or_insert((row.time, row.time));
        *life = (life.0.min(row.time), life.1.max(row.time));
    }
    // Births less deaths before each time.
    let mut changes = vec![0.0; times.len() + 1];
    for (first, last) in lives.into_values() {
        changes[times.partition_point(|time| *time < first)] += 1.0;
        changes[times.partition_point(|time| *time <= last)] -= 1.0;
    }
    let alive = changes[..times.len()].iter().scan(0.0, |alive, change| {
        *alive += change;
        Some(*alive)
    });
    alive.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: impl IntoIterator<Item = (f64, String)>) -> Truths {
        let row = |(time, object): (f64, String)| Truth {
            time,
            object: object.into(),
            position: [time, 0.0],
            z: None,
            velocity: None,
            extent: None,
        };
        Truths { rows: rows.into_iter().map(row).collect(), ..Truths::default() }
    }

    #[test]
    fn objects_are_counted_from_their_first_row_to_their_last() {
        let rows =
            [(1.0, "a"), (3.0, "a"), (2.0, "b"), (2.5, "c")].map(|(time, name)| (time, name.to_owned()));
        assert_eq!(
            count_objects(&[0.0, 1.0, 2.0, 2.7, 3.0, 4.0], &table(rows)),
            [0.0, 1.0, 2.0, 1.0, 1.0, 0.0]
        );
    }

    #[test]
    fn too_many_rows_are_thinned_to_an_even_share_with_both_ends() {
        let mut remarks = Vec::new();
        let truths = table((0..10).map(|k| (f64::from(k), "a".to_owned())));
        let columns = columns_of_truths(&truths, 0.0, 3, &mut remarks);
        assert_eq!(serde_json::to_value(&columns[0]).unwrap()["t"], serde_json::json!([0, 4, 8, 9]));
        assert_eq!(remarks, ["One in 4 of 10 rows of the truth is drawn."]);
    }
}
