//! Curves over time or over any other quantity.

use serde::Serialize;

use super::ReportError;
use super::number::Number;

/// More points than this are drawn as means of neighbours: a screen has fewer columns.
const DRAWN_POINTS: usize = 4_000;

/// Curves that share an abscissa: parts of a metric over time, an error over the noise, ...
///
/// ```
/// use tercel_study::report::{Chart, Form};
///
/// let gospa = Chart::over_time("GOSPA", "m", vec![0.0, 1.0, 2.0])
///     .with_form(Form::Stacked)
///     .with_part("localisation", vec![3.0, 2.5, 2.0])
///     .with_part("missed", vec![20.0, 0.0, 0.0]);
/// assert_eq!(gospa.parts().count(), 2);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    title: String,
    unit: String,
    abscissa: String,
    form: Form,
    x: Vec<f64>,
    parts: Vec<Part>,
}

/// A curve.
#[derive(Debug, Clone, PartialEq)]
struct Part {
    name: String,
    /// Its colour is the one of this number.
    place: usize,
    values: Vec<f64>,
    /// Lower and upper edge of the band around it.
    band: Option<[Vec<f64>; 2]>,
}

/// How the parts of a chart are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// Lines from point to point.
    #[default]
    Lines,
    /// Values that hold until the next point: counts.
    Steps,
    /// Areas on top of each other: parts of a whole.
    Stacked,
}

impl Chart {
    /// Curves over the time of a recording: `time` in s, in the epoch of the detections; values in `unit`, which
    /// may be empty.
    pub fn over_time(title: impl Into<String>, unit: impl Into<String>, time: Vec<f64>) -> Chart {
        Chart::over(title, unit, "Time, s", time)
    }

    /// Curves over any quantity; `abscissa` is its label with its unit, as in `"Noise, m"`.
    pub fn over(
        title: impl Into<String>,
        unit: impl Into<String>,
        abscissa: impl Into<String>,
        x: Vec<f64>,
    ) -> Chart {
        Chart {
            title: title.into(),
            unit: unit.into(),
            abscissa: abscissa.into(),
            form: Form::default(),
            x,
            parts: Vec::new(),
        }
    }

    /// Chooses how the parts are drawn.
    pub fn with_form(self, form: Form) -> Chart {
        Chart { form, ..self }
    }

    /// Adds a curve: one value for each point of the abscissa. NaN leaves a gap.
    pub fn with_part(mut self, name: impl Into<String>, values: Vec<f64>) -> Chart {
        let place = self.parts.len();
        self.parts.push(Part { name: name.into(), place, values, band: None });
        self
    }

    /// Adds a curve with a band around it, such as an interval of confidence: three values for each point of the abscissa.
    /// Bands are drawn around lines, not around steps or areas.
    pub fn with_banded_part(
        mut self,
        name: impl Into<String>,
        values: Vec<f64>,
        low: Vec<f64>,
        high: Vec<f64>,
    ) -> Chart {
        let place = self.parts.len();
        self.parts.push(Part { name: name.into(), place, values, band: Some([low, high]) });
        self
    }

    /// Draws the last curve in the colour of this number, counted from 0, so that a name has the same colour in all charts of a
    /// report, even where others before it are missing.
    pub fn in_place(mut self, place: usize) -> Chart {
        if let Some(part) = self.parts.last_mut() {
            part.place = place;
        }
        self
    }

    /// Name and values of each curve.
    pub fn parts(&self) -> impl Iterator<Item = (&str, &[f64])> {
        self.parts.iter().map(|part| (part.name.as_str(), part.values.as_slice()))
    }

    /// The data of the chart, with `start` subtracted from its abscissa. Of very many points, means of neighbours are drawn,
    /// and the title says so.
    pub(super) fn data(&self, start: f64) -> Result<ChartData, ReportError> {
        let joined = self.x.len().div_ceil(DRAWN_POINTS).max(1);
        let mut parts = Vec::with_capacity(self.parts.len());
        for part in &self.parts {
            let column = |values: &Vec<f64>| {
                if values.len() == self.x.len() {
                    return Ok(means(values, joined).map(Number::significant).collect());
                }
                Err(ReportError::ChartLength {
                    chart: self.title.clone(),
                    part: part.name.clone(),
                    found: values.len(),
                    expected: self.x.len(),
                })
            };
            let band = match &part.band {
                Some([low, high]) => Some([column(low)?, column(high)?]),
                None => None,
            };
            parts.push(PartData {
                name: part.name.clone(),
                place: part.place,
                y: column(&part.values)?,
                band,
            });
        }
        let title = match joined {
            1 => self.title.clone(),
            _ => format!("{} (each point is the mean of {joined})", self.title),
        };
        Ok(ChartData {
            title,
            unit: self.unit.clone(),
            abscissa: self.abscissa.clone(),
            form: self.form,
            x: means(&self.x, joined).map(|x| Number::rounded(x - start, 6)).collect(),
            parts,
        })
    }
}

/// Means of each `joined` neighbours; unknown values are left out.
fn means(values: &[f64], joined: usize) -> impl Iterator<Item = f64> {
    values.chunks(joined).map(move |chunk| {
        let (mut mean, mut count) = (0.0, 0.0);
        for &value in chunk.iter().filter(|value| joined == 1 || !value.is_nan()) {
            count += 1.0;
            mean += (value - mean) / count;
        }
        if count > 0.0 { mean } else { f64::NAN }
    })
}

/// A chart as the page reads it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct ChartData {
    title: String,
    unit: String,
    abscissa: String,
    form: Form,
    x: Vec<Number>,
    parts: Vec<PartData>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct PartData {
    name: String,
    place: usize,
    y: Vec<Number>,
    #[serde(skip_serializing_if = "Option::is_none")]
    band: Option<[Vec<Number>; 2]>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_counts_from_the_start_and_gaps_are_null() {
        let chart =
            Chart::over_time("RMSE", "m", vec![1e9, 1e9 + 0.5]).with_part("ours", vec![1.5, f64::NAN]);
        let json = serde_json::to_value(chart.data(1e9).unwrap()).unwrap();
        assert_eq!(json["x"], serde_json::json!([0, 0.5]));
        assert_eq!(json["parts"][0]["y"], serde_json::json!([1.5, null]));
    }

    #[test]
    fn a_band_has_a_lower_and_an_upper_edge_for_each_point() {
        let chart = |high: Vec<f64>| {
            Chart::over("RMSE", "m", "Noise, m", vec![1.0, 2.0]).with_banded_part(
                "ours",
                vec![3.0, 4.0],
                vec![2.5, 3.5],
                high,
            )
        };
        let json = serde_json::to_value(chart(vec![3.5, 4.5]).data(0.0).unwrap()).unwrap();
        assert_eq!(json["parts"][0]["band"], serde_json::json!([[2.5, 3.5], [3.5, 4.5]]));
        assert!(chart(vec![3.5]).data(0.0).unwrap_err().to_string().contains("1 values for 2 points"));
    }

    #[test]
    fn many_points_become_means_of_neighbours_and_the_title_says_so() {
        let x: Vec<f64> = (0..12_000).map(f64::from).collect();
        let mut y = vec![2.0; 12_000];
        (y[0], y[1]) = (8.0, f64::NAN);
        let json =
            serde_json::to_value(Chart::over_time("OSPA", "m", x).with_part("ours", y).data(0.0).unwrap())
                .unwrap();
        assert_eq!(json["title"], "OSPA (each point is the mean of 3)");
        assert_eq!(json["x"].as_array().unwrap().len(), 4_000);
        assert_eq!((&json["x"][0], &json["x"][3999]), (&serde_json::json!(1), &serde_json::json!(11_998)));
        assert_eq!(
            (&json["parts"][0]["y"][0], &json["parts"][0]["y"][1]),
            (&serde_json::json!(5), &serde_json::json!(2))
        );
    }

    #[test]
    fn a_part_of_another_length_is_an_error_that_names_it() {
        let chart = Chart::over_time("GOSPA", "m", vec![0.0, 1.0]).with_part("missed", vec![1.0]);
        let message = chart.data(0.0).unwrap_err().to_string();
        assert!(message.contains("missed") && message.contains("GOSPA"), "{message}");
    }
}
