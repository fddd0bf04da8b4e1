//! One flight, drawn with what every method made of it.

use tercel_data::table::{Detections, Observation, Tracks};

use super::{Recording, StepEstimate, tables};
use crate::StudyError;
use crate::monte_carlo::Example;
use crate::report::{Chart, Form, Picture};

/// Draws a flight: the plan with one track per method, errors over time, and the manoeuvres that each method tells.
pub(super) fn draw(
    recording: &Recording,
    title: String,
    followed: &[(&str, Vec<StepEstimate>)],
) -> Result<Example, StudyError> {
    let detections = tables::detections(recording);
    let truths = tables::truths(recording);
    let mut all = Tracks { labels: ["x", "y"].map(str::to_owned).to_vec(), ..Tracks::default() };
    let mut tracks = Vec::with_capacity(followed.len());
    for (number, (name, estimates)) in (1..).zip(followed) {
        let table = tables::tracks(recording, estimates, number);
        all.rows.extend(table.rows.iter().map(|row| {
            let mut row = row.clone();
            // Methods differ in what they tell; the picture shows what all of them have.
            row.covariance = position_part(&row.covariance, row.state.len());
            row.state.truncate(2);
            row.modes.clear();
            row
        }));
        tracks.push(((*name).to_owned(), table));
    }
    let mut picture = Picture::new(&without_radar(&detections), &all, Some(&truths), &[])?.without_counts();
    for (number, (name, _)) in (1..).zip(followed) {
        picture = picture.with_track_name(number, *name);
    }
    for chart in charts(recording, followed) {
        picture = picture.with_chart(chart);
    }
    Ok(Example { title, picture, detections, truths, tracks })
}

/// The plots as positions. The radar is so far away that a plan with it would hardly show the flight.
fn without_radar(detections: &Detections) -> Detections {
    let mut plots = detections.clone();
    for scan in &mut plots.scans {
        scan.position = None;
        for detection in &mut scan.detections {
            if let Observation::Polar { range: Some(range), bearing, .. } = detection.observation {
                let (sine, cosine) = bearing.sin_cos();
                detection.observation = Observation::Position { x: range * cosine, y: range * sine, z: None };
            }
        }
    }
    plots
}

/// The upper triangle of the positions, out of that of the whole state.
fn position_part(covariance: &[f64], size: usize) -> Vec<f64> {
    match covariance {
        [xx, xy, ..] => [Some(xx), Some(xy), covariance.get(size)].into_iter().flatten().copied().collect(),
        _ => Vec::new(),
    }
}

fn charts(recording: &Recording, followed: &[(&str, Vec<StepEstimate>)]) -> Vec<Chart> {
    let states = recording.flight.states();
    let times: Vec<f64> = (0..states.len()).map(|step| step as f64 * recording.flight.interval()).collect();
    let mut error = Chart::over_time("Distance from the truth", "m", times.clone());
    for (name, estimates) in followed {
        let distances = estimates
            .iter()
            .zip(states)
            .map(|(estimate, state)| (estimate.mean.x - state.x).hypot(estimate.mean.y - state.y));
        error = error.with_part(*name, distances.collect());
    }
    let stacked = |title: String, chance: &dyn Fn(usize, usize) -> f64| {
        let chart = Chart::over_time(title, "", times.clone()).with_form(Form::Stacked);
        tables::MANOEUVRES.iter().enumerate().fold(chart, |chart, (place, name)| {
            chart.with_part(*name, (0..times.len()).map(|step| chance(step, place)).collect())
        })
    };
    let manoeuvres = recording.flight.manoeuvres();
    let truth =
        stacked("True manoeuvre".to_owned(), &|step, place| f64::from(manoeuvres[step].index() == place));
    let mut charts = vec![error, truth];
    for (name, estimates) in followed {
        if estimates.iter().all(|estimate| estimate.manoeuvres.is_some()) {
            charts.push(stacked(format!("Probabilities of the manoeuvres: {name}"), &|step, place| {
                estimates[step].manoeuvres.map_or(f64::NAN, |chances| chances[place])
            }));
        }
    }
    charts
}
