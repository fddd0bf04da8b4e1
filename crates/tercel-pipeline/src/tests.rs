//! Pipelines as a whole.

use crate::{Config, Pipeline, PipelineError};
use tercel_data::table::{Detection, Observation, Scan, Status};

/// A configuration with this motion, these filter and tracker sections and this `measures`.
fn config(motion: &str, sections: &str, measures: &str) -> Config {
    let text = format!(
        "[motion]\n{motion}\n{sections}\n[sensors.radar]\nmeasures = {measures}\n\
         clutter = {{ uniform = {{ density = 1e-7 }} }}\n"
    );
    Config::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

const STRAIGHT: &str = "constant_velocity = { acceleration_density = 0.5, speed = 15.0 }";
const POSITION: &str = "{ position = { deviation = 5.0 } }";

fn scan(time: f64, observations: &[Observation]) -> Scan {
    let detection = |(id, &observation): (u64, _)| Detection::new(id, observation);
    let detections = (time as u64 * 100..).zip(observations).map(detection).collect();
    Scan::new(time, "radar", detections)
}

/// What a sensor says of an object that moves straight past it.
fn observed(kind: &str, time: f64) -> Observation {
    let (x, y) = (-200.0 + 10.0 * time, 300.0);
    let range = f64::hypot(x, y);
    match kind {
        "position" => Observation::Position { x, y, z: None },
        "bearing" => Observation::Polar { range: None, bearing: y.atan2(x), range_rate: None, z: None },
        _ => Observation::Polar {
            range: Some(range),
            bearing: y.atan2(x),
            range_rate: Some(10.0 * x / range),
            z: None,
        },
    }
}

#[test]
fn every_motion_filter_and_sensor_tracks_a_plain_object() {
    let turn = "{ turn = { rate = 0.1, acceleration_density = 0.5 } }";
    let motions = [
        "random_walk = { density = 200.0 }".to_string(),
        STRAIGHT.to_string(),
        "constant_acceleration = { jerk_density = 0.1 }".to_string(),
        "singer = { time = 10.0, acceleration = 1.0 }".to_string(),
        "coordinated_turn = { acceleration_density = 0.5, rate_density = 1e-4 }".to_string(),
        "learned = { model = \"liquid\", speed = 15.0 }".to_string(),
        "learned = { model = \"neural-imm-position\" }".to_string(),
        format!("switching = {{ stay = 0.95, modes = [{{ {STRAIGHT} }}, {turn}] }}"),
        format!(
            "switching = {{ stay = 0.95, modes = [{{ {STRAIGHT} }}, {{ constant_acceleration = {{ jerk_density = 0.1 }} }}] }}"
        ),
    ];
    let sensors = [
        ("position", POSITION),
        ("polar", "{ polar = { range_deviation = 5.0, bearing_deviation = 0.01 } }"),
        ("polar", "{ polar = { range_deviation = 5.0, bearing_deviation = 0.01, convert = true } }"),
        (
            "polar",
            "{ polar = { range_deviation = 5.0, bearing_deviation = 0.01, range_rate_deviation = 1.0 } }",
        ),
    ];
    let names = ["nearest_neighbour", "phd", "multi_bernoulli", "jpda", "pmbm"];
    let trackers = names.map(|name| format!("[tracker.{name}]"));
    for motion in &motions {
        for (kind, measures) in sensors {
            for tracker in &trackers {
                // A random walk knows no velocity for a range rate to measure.
                if motion.starts_with("random_walk") && measures.contains("rate_deviation") {
                    continue;
                }
                let mut pipeline = Pipeline::new(&config(motion, tracker, measures)).unwrap();
                let mut rows = Vec::new();
                for second in 0..20 {
                    let time = f64::from(second);
                    rows = pipeline.push(scan(time, &[observed(kind, time)])).unwrap();
                }
                let confirmed: Vec<_> = rows.iter().filter(|row| row.status == Status::Confirmed).collect();
                assert_eq!(confirmed.len(), 1, "{motion} {measures} {tracker}");
                let state = &confirmed[0].state;
                assert!(
                    (state[0] + 10.0).hypot(state[1] - 300.0) < 25.0,
                    "{motion} {measures} {tracker}: {state:?}"
                );
                assert_eq!(state.len(), pipeline.labels().len());
                assert_eq!(confirmed[0].modes.len(), pipeline.modes().len());
            }
        }
    }
}

#[test]
fn unscented_filters_and_particles_are_chosen_by_name() {
    let polar = "{ polar = { range_deviation = 5.0, bearing_deviation = 0.01 } }";
    let mut ends = Vec::new();
    for estimator in ["extended", "unscented", "particle"] {
        let section = format!("[filter]\nestimator = \"{estimator}\"");
        let mut pipeline = Pipeline::new(&config(STRAIGHT, &section, polar)).unwrap();
        let mut rows = Vec::new();
        for second in 0..15 {
            rows = pipeline.push(scan(f64::from(second), &[observed("polar", f64::from(second))])).unwrap();
        }
        assert!((rows[0].state[0] + 60.0).hypot(rows[0].state[1] - 300.0) < 25.0, "{estimator}");
        ends.push(rows[0].state.clone());
    }
    assert!(ends[0] != ends[1] && ends[1] != ends[2], "three filters, three answers");
}

#[test]
fn a_model_that_is_no_motion_or_is_not_there_is_refused() {
    let refusal = |model: &str, sections: &str| {
        let text = format!("learned = {{ model = \"{model}\" }}");
        Pipeline::new(&config(&text, sections, POSITION)).err().unwrap().to_string()
    };
    let missing = refusal("mine.safetensors", "");
    assert!(missing.contains("`motion.learned.model`") && missing.contains("mine.safetensors"), "{missing}");
    assert!(missing.contains("neural-imm-position") && !missing.contains("rmmnet"), "{missing}");
    let other = refusal("rmmnet-vehicle", "");
    assert!(other.contains("of the kind `rmmnet`") && other.contains("`neural-imm`"), "{other}");
    let text = format!(
        "[motion]\nlearned = {{ model = \"liquid\" }}\n[filter]\nestimator = \"unscented\"\n\
         [sensors.radar]\nmeasures = {POSITION}\nclutter = {{ uniform = {{ density = 1e-7 }} }}"
    );
    assert!(Config::parse(&text).unwrap_err().to_string().contains("has a filter of its own"));
}

#[test]
fn files_of_models_are_found_from_the_folder_of_the_configuration() {
    let folder = std::path::Path::new("conf");
    let model = |name: &str| {
        let config = config(&format!("learned = {{ model = \"{name}\" }}"), "", POSITION).in_folder(folder);
        match config.motion {
            crate::config::MotionConfig::Learned(motion) => motion.model,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(model("liquid"), "liquid");
    assert_eq!(std::path::Path::new(&model("boats.safetensors")), folder.join("boats.safetensors"));
}

#[test]
fn a_learned_bank_names_its_turns() {
    let motion = "learned = { model = \"neural-imm-position\" }";
    let pipeline = Pipeline::new(&config(motion, "", POSITION)).unwrap();
    assert_eq!(pipeline.modes()[..3], ["straight", "left_2", "right_2"]);
    assert_eq!(pipeline.modes().len(), 13);
}

#[test]
fn late_scans_are_counted_or_sorted_in() {
    let times = [0.0, 2.0, 1.0, 3.0, 4.0];
    let run = |input: &str| {
        let mut pipeline = Pipeline::new(&config(STRAIGHT, input, POSITION)).unwrap();
        for time in times {
            pipeline.push(scan(time, &[observed("position", time)])).unwrap();
        }
        pipeline.finish().unwrap();
        let summary = pipeline.summary();
        (summary.scans, summary.late)
    };
    assert_eq!(run(""), (4, 1));
    assert_eq!(run("[input]\nout_of_order = \"buffer\"\ndelay = 1.5"), (5, 0));
}

#[test]
fn a_refused_scan_costs_no_tracks_of_others() {
    let buffer = "[input]\nout_of_order = \"buffer\"\ndelay = 1.5";
    let mut pipeline = Pipeline::new(&config(STRAIGHT, buffer, POSITION)).unwrap();
    let mut rows = Vec::new();
    for (time, kind) in [(0.0, "position"), (1.0, "polar"), (5.0, "position"), (6.0, "position")] {
        rows.extend(pipeline.push(scan(time, &[observed(kind, time)])).unwrap_or_default());
    }
    rows.extend(pipeline.finish().unwrap());
    let mut times: Vec<f64> = rows.iter().map(|row| row.time).collect();
    times.dedup();
    assert_eq!(times, [0.0, 5.0, 6.0]);
}

#[test]
fn every_detection_is_counted_once() {
    let mut pipeline = Pipeline::new(&config(STRAIGHT, "", POSITION)).unwrap();
    for second in 0..10 {
        let time = f64::from(second);
        let far = Observation::Position { x: 5e3, y: 900.0 * time, z: None };
        pipeline.push(scan(time, &[observed("position", time), far])).unwrap();
    }
    let summary = pipeline.summary();
    assert_eq!(summary.updates + summary.starts + summary.clutter, 20);
    assert_eq!(summary.confirmed, 1);
}

#[test]
fn scans_that_do_not_fit_are_named() {
    let mut pipeline = Pipeline::new(&config(STRAIGHT, "", POSITION)).unwrap();
    let polar = pipeline.push(scan(7.0, &[observed("polar", 0.0)])).unwrap_err().to_string();
    assert!(polar.contains("detection 700 of sensor `radar` at 7 s has no position"), "{polar}");
    let sonar = Scan { sensor: "sonar".into(), ..scan(8.0, &[]) };
    let error = pipeline.push(sonar).unwrap_err();
    assert!(matches!(&error, PipelineError::UnknownSensor { sensor, .. } if sensor == "sonar"));
    let broken = Observation::Position { x: f64::NAN, y: 0.0, z: None };
    assert!(pipeline.push(scan(9.0, &[broken])).unwrap_err().to_string().contains("not finite"));
}
