//! How reports of several extended objects are scored.

use tercel_core::extended::Ellipse;
use tercel_core::metric::{Gospa, intersection_over_union};
use tercel_sim::extended::Ride;

use super::methods::Report;
use crate::monte_carlo::Outcome;

/// Name and unit of each metric: means over the scans after the first five. `iou` is that of the pairs which
/// GOSPA makes.
pub const METRICS: [(&str, &str); 5] =
    [("gospa", "m"), ("gospa_localisation", "m"), ("gospa_missed", "m"), ("gospa_false", "m"), ("iou", "")];

/// Cut-off of GOSPA, m, of order 1.
const CUTOFF: f64 = 20.0;

/// The first scans are not scored: tracks need some to be confirmed.
const WARM_UP: usize = 5;

/// Scores the reports of one scene. Curves are GOSPA and the number of confirmed tracks.
///
/// # Errors
/// With a message, when a report is not finite.
pub(super) fn score(rides: &[Ride], reports: &[Vec<Report>]) -> Result<Outcome, String> {
    let gospa = Gospa::new(CUTOFF, 1.0).map_err(|error| error.to_string())?;
    let mut sums = [0.0; 4];
    let (mut overlap, mut pairs, mut scans) = (0.0, 0.0, 0.0);
    let mut curves = vec![Vec::new(); 2];
    for (step, found) in reports.iter().enumerate() {
        let truth: Vec<[f64; 2]> = rides.iter().map(|ride| ride.ellipse(step).center.into()).collect();
        let places: Vec<[f64; 2]> = found.iter().map(|report| report.place.into()).collect();
        let score = gospa.score(&truth, &places).map_err(|error| format!("step {step}: {error}"))?;
        curves[0].push(score.total);
        curves[1].push(found.len() as f64);
        if step < WARM_UP {
            continue;
        }
        scans += 1.0;
        let parts = [score.total, score.parts.localisation, score.parts.missed, score.parts.false_alarm];
        sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
        for (object, estimate) in score.pairs {
            let Some(extent) = found[estimate].extent else { continue };
            let ellipse = Ellipse::from_matrix(found[estimate].place, &extent);
            let ellipse = ellipse.map_err(|error| format!("step {step}: {error}"))?;
            overlap += intersection_over_union(&ellipse, &rides[object].ellipse(step));
            pairs += 1.0;
        }
    }
    let [total, localisation, missed, false_alarm] = sums.map(|sum| sum / scans);
    Ok(Outcome { metrics: vec![total, localisation, missed, false_alarm, overlap / pairs], curves })
}
