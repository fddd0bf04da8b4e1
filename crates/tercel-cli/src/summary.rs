//! Figures as a person reads them.

use std::fmt::Write;

use tercel_study::evaluate::Evaluation;

/// Names and values in two columns, in groups with headings.
#[derive(Debug, Default)]
pub struct Table {
    lines: Vec<Line>,
}

#[derive(Debug)]
enum Line {
    Heading(String),
    Figure(String, String),
}

impl Table {
    /// Begins a group.
    pub fn heading(&mut self, text: impl Into<String>) {
        self.lines.push(Line::Heading(text.into()));
    }

    /// Adds a figure.
    pub fn figure(&mut self, name: impl Into<String>, value: impl Into<String>) {
        self.lines.push(Line::Figure(name.into(), value.into()));
    }

    /// Adds the scores of an evaluation with their units.
    pub fn scores(&mut self, evaluation: &Evaluation) {
        for (name, value) in &evaluation.means {
            self.figure(*name, score(name, *value));
        }
    }

    /// The table as text.
    pub fn render(&self) -> String {
        let length = |line: &Line| match line {
            Line::Heading(_) => 0,
            Line::Figure(name, _) => name.chars().count(),
        };
        let width = self.lines.iter().map(length).max().unwrap_or(0) + 2;
        let mut text = String::new();
        for line in &self.lines {
            // Writing to a string cannot fail.
            let _ = match line {
                Line::Heading(heading) if text.is_empty() => writeln!(text, "{heading}"),
                Line::Heading(heading) => writeln!(text, "\n{heading}"),
                Line::Figure(name, value) => writeln!(text, "{name:width$}{value}"),
            };
        }
        text
    }
}

/// A score with its unit; a mean over nothing is a dash.
pub fn score(name: &str, value: f64) -> String {
    let counted = matches!(name, "switches" | "tgospa_switches");
    let plain = matches!(name, "covered" | "false_tracks" | "false_tracks_near" | "cardinality_error");
    match name {
        _ if !value.is_finite() => "-".to_owned(),
        _ if counted && value.fract() == 0.0 => format!("{value}"),
        _ if counted || plain => format!("{value:.3}"),
        _ => format!("{value:.2} m"),
    }
}

/// A whole number with its thousands apart.
pub fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A number and what it counts: `1 scan`, `2 scans`.
pub fn counted(number: u64, what: &str) -> String {
    format!("{} {what}{}", count(number), if number == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_apart() {
        assert_eq!([0, 999, 1000, 1_234_567].map(count), ["0", "999", "1,000", "1,234,567"]);
    }

    #[test]
    fn a_mean_over_nothing_is_a_dash() {
        assert_eq!(score("covered", f64::NAN), "-");
        assert_eq!(score("gospa", 19.349), "19.35 m");
        assert_eq!(score("switches", 2.0), "2");
    }
}
