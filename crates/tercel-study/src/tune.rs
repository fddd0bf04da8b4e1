//! Tuning of a configuration by coordinate descent.

use rayon::prelude::*;
use tercel_pipeline::Config;
use toml::{Table, Value};

/// A number of a configuration and the values that may be tried for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knob {
    /// Key, with dots; a number is the index of an array.
    pub key: &'static str,
    /// Values, rising.
    pub values: &'static [f64],
}

/// Changes one knob after the other to the value with the lowest cost, until no change helps or `rounds` rounds are over.
/// Each knob moves at most three places a round. Values that make no configuration are passed over.
///
/// A choice is judged by the mean of its cost and of the costs with all knobs off by 7 %, in two ways: few data have lucky
/// combinations of numbers, which do not outlive a change of the scene.
///
/// The result depends on nothing but the arguments: the order of the knobs is the order given, and of equal costs the first
/// counts.
pub fn descend(start: &Table, knobs: &[Knob], rounds: usize, cost: impl Fn(&Config) -> f64 + Sync) -> Table {
    let single = |table: &Table| match Config::parse(&table.to_string()) {
        Ok(config) => cost(&config),
        Err(_) => f64::INFINITY,
    };
    let price = |table: &Table| {
        let off = [0, 1].map(|way| single(&moved(table, knobs, way)));
        (single(table) + off[0] + off[1]) / 3.0
    };
    let mut best = start.clone();
    let mut least = price(&best);
    for _ in 0..rounds {
        let before = least;
        for knob in knobs {
            let tries: Vec<Table> =
                near(&best, knob).into_iter().map(|value| set(&best, knob.key, value)).collect();
            let costs: Vec<f64> = tries.par_iter().map(price).collect();
            let cheapest = costs.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
            if let Some((index, &cost)) = cheapest.filter(|(_, cost)| **cost < least) {
                least = cost;
                best = tries[index].clone();
            }
        }
        if least == before {
            break;
        }
    }
    best
}

/// By how much numbers are wrong when a choice is judged, as a share.
const OFF: f64 = 0.07;

/// A copy with all knobs off, every other one to the other side. Of what lies near one, the distance from one changes.
fn moved(table: &Table, knobs: &[Knob], way: usize) -> Table {
    knobs.iter().enumerate().fold(table.clone(), |table, (number, knob)| {
        let factor = if number % 2 == way { 1.0 + OFF } else { 1.0 - OFF };
        match get(&table, knob.key) {
            Some(now) if (0.5..1.0).contains(&now) => set(&table, knob.key, 1.0 - (1.0 - now) * factor),
            Some(now) => set(&table, knob.key, now * factor),
            None => table,
        }
    })
}

/// The values of a knob around the one that it has.
fn near(table: &Table, knob: &Knob) -> Vec<f64> {
    let now = get(table, knob.key).unwrap_or(f64::NAN);
    let at = knob.values.partition_point(|&value| value < now);
    let range = at.saturating_sub(3)..(at + 4).min(knob.values.len());
    knob.values[range].iter().copied().filter(|&value| value != now).collect()
}

fn get(table: &Table, key: &str) -> Option<f64> {
    let mut parts = key.split('.');
    let mut value = table.get(parts.next()?)?;
    for part in parts {
        value = match value {
            Value::Table(table) => table.get(part)?,
            Value::Array(array) => array.get(part.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

/// A copy of the table in which the number at `key` is `number`; unchanged when there is no such key.
fn set(table: &Table, key: &str, number: f64) -> Table {
    let mut copy = Value::Table(table.clone());
    let mut place = Some(&mut copy);
    for part in key.split('.') {
        place = match place {
            Some(Value::Table(table)) => table.get_mut(part),
            Some(Value::Array(array)) => part.parse().ok().and_then(|index: usize| array.get_mut(index)),
            _ => None,
        };
    }
    if let Some(value) = place {
        *value = if value.is_integer() { Value::Integer(number as i64) } else { Value::Float(number) };
    }
    match copy {
        Value::Table(table) => table,
        _ => table.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tercel_pipeline::config::presets;

    #[test]
    fn the_descent_finds_the_least_cost_of_a_plain_valley() {
        let start: Table = presets::get("harbour").unwrap().parse().unwrap();
        let knobs = [
            Knob { key: "sensors.radar.measures.position.lag", values: &[0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5] },
            Knob { key: "tracker.nearest_neighbour.management.max_misses", values: &[2.0, 5.0, 10.0, 20.0] },
            Knob { key: "sensors.lidar.detection.0.1", values: &[0.1, 0.2, 0.4] },
        ];
        let lag = |table: &Table| get(table, knobs[0].key).unwrap();
        let cost = |config: &Config| {
            let table: Table = config.to_toml().parse().unwrap();
            (lag(&table) - 2.6).abs()
                + get(&table, knobs[1].key).unwrap()
                + get(&table, knobs[2].key).unwrap()
        };
        let best = descend(&start, &knobs, 5, cost);
        assert_eq!(
            (lag(&best), get(&best, knobs[1].key), get(&best, knobs[2].key)),
            (2.5, Some(2.0), Some(0.1))
        );
    }
}
