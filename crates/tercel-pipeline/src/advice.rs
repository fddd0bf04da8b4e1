//! What a configuration says that cannot work with the data at hand.

use tercel_data::table::{Detection, Observation, Scan, Status};

use crate::config::{
    ClutterConfig, Config, DetectionConfig, InputConfig, JpdaConfig, ManagementConfig, Measures,
    MultiBernoulliConfig, NearestNeighbourConfig, OutOfOrder, PhdConfig, PmbmConfig, TrackerConfig,
};
use crate::{Pipeline, PipelineError};

/// Scans before the object of a trial appears, and scans in which it is seen.
const TRIAL: (u32, u32) = (10, 30);

/// Intervals that are tried when none is known, s.
const USUAL: [f64; 3] = [1.0, 3.0, 10.0];

/// How far from the sensors the object of a trial passes when nothing says where they look, m.
const DISTANCE: f64 = 1_000.0;

/// What the user of a configuration should know: that no track can start, and keys that have no effect. Each is a sentence with
/// the numbers that cause it. `interval` is the time between two scans of a sensor, s, if it is
/// known; if not, what starts at none of a few usual intervals is said.
///
/// Whether tracks start is tried: the tracker that the configuration describes gets one object, which appears after some empty
/// scans, moves as fast as new objects are expected to, and is seen in every scan, with no false detection around. What is not
/// confirmed then never is.
///
/// ```
/// use tercel_pipeline::{Config, advice};
///
/// let config = Config::parse(
///     r#"
///     [motion]
///     constant_velocity = { acceleration_density = 0.5, speed = 300.0 }
///     [sensors.radar]
///     measures = { position = { deviation = 5.0 } }
///     clutter = { uniform = { density = 1e-3 } }
///     "#,
/// )?;
/// assert!(advice(&config, Some(10.0))?[0].contains("no track can start"));
/// # Ok::<(), tercel_pipeline::PipelineError>(())
/// ```
///
/// # Errors
/// When the configuration makes no tracker.
pub fn advice(config: &Config, interval: Option<f64>) -> Result<Vec<String>, PipelineError> {
    let mut said = Vec::new();
    let known = interval.filter(|seconds| *seconds > 0.0).map(|seconds| [seconds]);
    let intervals = known.as_ref().map_or(&USUAL[..], |known| &known[..]);
    let mut starts = Vec::with_capacity(intervals.len());
    for seconds in intervals {
        starts.push(starts_within(config, *seconds)?);
    }
    if starts.iter().all(|starts| *starts == Some(false)) {
        said.push(no_start(config, intervals[0])?);
    }
    if let Some(seconds) = interval {
        said.extend(idle(config.tracker.management(), seconds));
    }
    Ok(said)
}

/// That no track can start, why, and which trackers could.
fn no_start(config: &Config, interval: f64) -> Result<String, PipelineError> {
    let mut others = Vec::new();
    for tracker in trackers().into_iter().filter(|other| other.name() != config.tracker.name()) {
        let other = Config { tracker, ..config.clone() };
        if starts_within(&other, interval)? == Some(true) {
            others.push(other.tracker.name());
        }
    }
    let sensors: Vec<String> = config
        .sensors
        .iter()
        .map(|(name, sensor)| {
            let (density, unit) = (
                density(&sensor.clutter),
                if matches!(sensor.measures, Measures::Bearing(_)) { "rad" } else { "m²" },
            );
            format!(
                "`{name}` with {density:e} false detections per {unit} and {}",
                accuracy(&sensor.measures)
            )
        })
        .collect();
    let speed =
        config.motion.speed().map_or_else(String::new, |speed| format!(", objects of {speed} m/s per axis"));
    let way_out = if others.is_empty() {
        "lower the clutter density or the speed of new objects, if they are less in truth, or raise births"
            .to_owned()
    } else {
        format!("use {} in [tracker]", others.join(" or "))
    };
    Ok(format!(
        "no track can start with {}: {}{speed} and a scan every {interval} s leave a new track less likely than clutter, however \
         often it is seen; {way_out}",
        config.tracker.name(),
        sensors.join(", "),
    ))
}

/// Keys of the management that another one leaves without effect.
fn idle(management: &ManagementConfig, interval: f64) -> Option<String> {
    let coast = management.max_coast?.get();
    if coast < interval {
        return Some(format!(
            "max_coast = {coast} s gives up a track that one scan misses, since scans come every {interval} s; leave it out, or \
             let it be the time of several scans"
        ));
    }
    let misses = (coast / interval).floor();
    (misses < f64::from(management.max_misses)).then(|| {
        format!(
            "max_misses = {} has no effect: with a scan every {interval} s, max_coast = {coast} s is over after {misses} misses",
            management.max_misses
        )
    })
}

/// Whether a track of an object that is seen in every scan is confirmed, before one of the sensors at least; `None` where no
/// sensor sees or can place a new object, or where it cannot be said.
fn starts_within(config: &Config, interval: f64) -> Result<Option<bool>, PipelineError> {
    let used: Vec<_> =
        config.sensors.iter().filter(|(name, _)| !config.input.ignore.contains(name)).collect();
    let mut posts: Vec<[f64; 2]> = Vec::new();
    for (_, sensor) in &used {
        if !posts.contains(&sensor.position) {
            posts.push(sensor.position);
        }
    }
    for post in posts {
        if starts_before(config, interval, post)? {
            return Ok(Some(true));
        }
    }
    let can_place = |measures: &Measures| match measures {
        Measures::Position(_) | Measures::Polar(_) => true,
        Measures::Bearing(bearing) => bearing.start_range.is_some(),
    };
    Ok(used.iter().any(|(_, sensor)| can_place(&sensor.measures)).then_some(false))
}

/// Whether a track is confirmed of an object that passes in front of this place and is seen by every sensor.
fn starts_before(config: &Config, interval: f64, post: [f64; 2]) -> Result<bool, PipelineError> {
    let input = InputConfig {
        ignore: config.input.ignore.clone(),
        out_of_order: OutOfOrder::Drop,
        ..InputConfig::default()
    };
    let mut pipeline = Pipeline::new(&Config { input, ..config.clone() })?;
    let speed = config.motion.speed().unwrap_or(0.0);
    let distance = distance(config);
    let (empty, seen) = TRIAL;
    for step in 0..empty + seen {
        let time = f64::from(step) * interval;
        // In the middle of its way the object is nearest.
        let along = speed * (time - f64::from(empty + seen / 2) * interval);
        let place = [post[0] + along, post[1] + distance];
        for (name, sensor) in &config.sensors {
            let observation = observation(&sensor.measures, sensor.position, place);
            let detections =
                if step < empty { Vec::new() } else { vec![Detection::new(u64::from(step), observation)] };
            let rows = pipeline.push(Scan::new(time, name.as_str(), detections))?;
            if rows.iter().any(|row| row.status == Status::Confirmed) {
                return Ok(true);
            }
        }
    }
    // Plots of an antenna that turns are tracked when its turn is over.
    Ok(pipeline.finish()?.iter().any(|row| row.status == Status::Confirmed))
}

/// What a sensor at `from` says of an object at a place.
fn observation(measures: &Measures, from: [f64; 2], place: [f64; 2]) -> Observation {
    let [dx, dy] = [place[0] - from[0], place[1] - from[1]];
    match measures {
        Measures::Position(_) => Observation::Position { x: place[0], y: place[1], z: None },
        Measures::Polar(_) => Observation::Polar {
            range: Some(dx.hypot(dy)),
            bearing: dy.atan2(dx),
            range_rate: Some(0.0),
            z: None,
        },
        Measures::Bearing(_) => {
            Observation::Polar { range: None, bearing: dy.atan2(dx), range_rate: None, z: None }
        }
    }
}

/// Where every sensor sees best, as far as tables of detection and ranges of bearings say.
fn distance(config: &Config) -> f64 {
    let wanted = config.sensors.values().filter_map(|sensor| match (&sensor.measures, &sensor.detection) {
        (Measures::Bearing(bearing), _) if bearing.start_range.is_some() => {
            bearing.start_range.map(|range| range.get())
        }
        (_, Some(DetectionConfig::ByRange(table))) => table.first().map(|entry| 0.5 * entry.0.get()),
        (_, Some(DetectionConfig::Uniform(_)) | None) => None,
    });
    wanted.fold(DISTANCE, f64::min)
}

fn density(clutter: &ClutterConfig) -> f64 {
    match clutter {
        ClutterConfig::Uniform(uniform) => uniform.density.get(),
        ClutterConfig::Map(map) => map.background.get(),
    }
}

fn accuracy(measures: &Measures) -> String {
    match measures {
        Measures::Position(position) => format!("{} m of accuracy", position.deviation.get()),
        Measures::Polar(polar) => {
            format!("{} m and {} rad of accuracy", polar.range_deviation.get(), polar.bearing_deviation.get())
        }
        Measures::Bearing(bearing) => format!("{} rad of accuracy", bearing.deviation.get()),
    }
}

/// One of each tracker, with the settings that it has when nothing is said.
fn trackers() -> [TrackerConfig; 5] {
    [
        TrackerConfig::NearestNeighbour(NearestNeighbourConfig::default()),
        TrackerConfig::Jpda(JpdaConfig::default()),
        TrackerConfig::Pmbm(PmbmConfig::default()),
        TrackerConfig::Phd(PhdConfig::default()),
        TrackerConfig::MultiBernoulli(MultiBernoulliConfig::default()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::presets;

    fn config(tracker: &str, density: f64, speed: f64) -> Config {
        Config::parse(&format!(
            "[motion]\nconstant_velocity = {{ acceleration_density = 0.1, speed = {speed:?} }}\n[tracker.{tracker}]\n\
             [sensors.radar]\nmeasures = {{ position = {{ deviation = 5.0 }} }}\nclutter = {{ uniform = {{ density = {density:e} }} }}\n"
        ))
        .unwrap()
    }

    #[test]
    fn tracks_of_every_preset_can_start() {
        for name in presets::names() {
            let config = Config::parse(presets::get(name).unwrap()).unwrap();
            assert_eq!(advice(&config, None).unwrap(), Vec::<String>::new(), "{name}");
        }
    }

    #[test]
    fn what_starts_and_what_does_not_is_said_with_its_numbers() {
        assert!(advice(&config("nearest_neighbour", 6e-5, 15.0), Some(1.0)).unwrap().is_empty());
        let said = advice(&config("phd", 1e-3, 15.0), Some(1.0)).unwrap();
        assert!(said[0].contains("no track can start with phd") && said[0].contains("1e-3"), "{said:?}");
        assert!(said[0].contains("15 m/s") && said[0].contains("every 1 s"), "{said:?}");
    }

    #[test]
    fn stations_far_apart_see_one_object() {
        let station = |name: &str, x: f64| {
            format!(
                "[sensors.{name}]\nmeasures = {{ polar = {{ range_deviation = 5.0, bearing_deviation = 0.002 }} }}\n\
                 position = [{x:?}, 0.0]\nclutter = {{ uniform = {{ density = 1e-8 }} }}\n"
            )
        };
        let motion = "[motion]\nconstant_velocity = { acceleration_density = 0.1, speed = 15.0 }\n";
        let text = [motion, &station("north", 0.0), &station("south", 6_000.0)].concat();
        assert!(advice(&Config::parse(&text).unwrap(), Some(1.0)).unwrap().is_empty());
    }

    #[test]
    fn a_time_to_coast_that_is_shorter_than_a_scan_or_than_the_misses_is_said() {
        let with = |rule: &str| {
            let text = config("nearest_neighbour", 1e-6, 15.0).to_toml();
            let start = text.find("[tracker.nearest_neighbour.management]").unwrap();
            let (before, after) = text.split_at(start);
            let after = after.replacen("max_misses = 5", rule, 1);
            Config::parse(&format!("{before}{after}")).unwrap()
        };
        let said = advice(&with("max_misses = 20\nmax_coast = 15.0"), Some(1.0)).unwrap();
        assert!(said[0].contains("max_misses = 20 has no effect"), "{said:?}");
        let said = advice(&with("max_misses = 5\nmax_coast = 15.0"), Some(20.0)).unwrap();
        assert!(said[0].contains("one scan misses"), "{said:?}");
        assert!(advice(&with("max_misses = 5"), Some(20.0)).unwrap().is_empty());
    }
}
