//! Curves over time or over any other quantity.

use serde::Serialize;

use super::ReportError;
use super::number::Number;

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
    parts: Vec<(String, Vec<f64>)>,
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
        self.parts.push((name.into(), values));
        self
    }

    /// Name and values of each curve.
    pub fn parts(&self) -> impl Iterator<Item = (&str, &[f64])> {
        self.parts.iter().map(|(name, values)| (name.as_str(), values.as_slice()))
    }

    /// The data of the chart, with `start` subtracted from its abscissa.
    pub(super) fn data(&self, start: f64) -> Result<ChartData, ReportError> {
        let mut parts = Vec::with_capacity(self.parts.len());
        for (name, values) in &self.parts {
            if values.len() != self.x.len() {
                return Err(ReportError::ChartLength {
                    chart: self.title.clone(),
                    part: name.clone(),
                    found: values.len(),
                    expected: self.x.len(),
                });
            }
            let y = values.iter().map(|&value| Number::significant(value)).collect();
            parts.push(PartData { name: name.clone(), y });
        }
        Ok(ChartData {
            title: self.title.clone(),
            unit: self.unit.clone(),
            abscissa: self.abscissa.clone(),
            form: self.form,
            x: self.x.iter().map(|&x| Number::rounded(x - start, 6)).collect(),
            parts,
        })
    }
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
    y: Vec<Number>,
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
    fn a_part_of_another_length_is_an_error_that_names_it() {
        let chart = Chart::over_time("GOSPA", "m", vec![0.0, 1.0]).with_part("missed", vec![1.0]);
        let message = chart.data(0.0).unwrap_err().to_string();
        assert!(message.contains("missed") && message.contains("GOSPA"), "{message}");
    }
}
