//! Which runs, methods and conditions a study has.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Everything that decides the result of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Name of the study.
    pub study: String,
    /// Seed of its random numbers.
    pub seed: u64,
    /// Number of runs under each condition.
    pub runs: u64,
    /// What else was chosen, by name: the population of flights, ...
    pub options: BTreeMap<String, String>,
    /// What is changed from condition to condition; without it there is one condition.
    pub sweep: Option<Sweep>,
    /// The methods, in the order in which they are best read.
    pub methods: Vec<String>,
    /// What one run of one method gives a number for.
    pub metrics: Vec<Quantity>,
    /// What one run of one method gives a curve for.
    pub curves: Vec<Curve>,
}

impl Plan {
    /// `1 run`, `40 runs`.
    pub(crate) fn counted_runs(&self) -> String {
        format!("{} run{}", self.runs, if self.runs == 1 { "" } else { "s" })
    }

    /// In what two plans differ, in words: the first such thing.
    pub fn difference(&self, other: &Plan) -> Option<String> {
        let list = |options: &BTreeMap<String, String>| {
            options.iter().map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
        };
        let pairs = [
            ("studies", self.study.clone(), other.study.clone()),
            ("seeds", self.seed.to_string(), other.seed.to_string()),
            ("numbers of runs", self.runs.to_string(), other.runs.to_string()),
            ("methods", self.methods.join(", "), other.methods.join(", ")),
            ("options", list(&self.options), list(&other.options)),
        ];
        let named = pairs.into_iter().find(|(_, a, b)| a != b);
        let named = named.map(|(what, a, b)| format!("their {what} differ: `{a}` and `{b}`"));
        named.or_else(|| (self != other).then(|| "their conditions, metrics or curves differ".to_owned()))
    }
}

/// A quantity that takes several values in a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Its name in tables, with its unit where it is not SI.
    pub name: String,
    /// Its name and unit as an axis shows them.
    pub label: String,
    /// Its values, one per condition.
    pub values: Vec<f64>,
}

impl Sweep {
    /// Label and values as a chart shows them: logarithms, where the values are of different orders.
    pub(crate) fn abscissa(&self) -> (String, Vec<f64>) {
        let least = self.values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = self.values.iter().copied().fold(0.0, f64::max);
        if least > 0.0 && most >= 100.0 * least {
            let label = format!("{}, logarithm to base 10", self.label);
            return (label, self.values.iter().map(|value| value.log10()).collect());
        }
        (self.label.clone(), self.values.clone())
    }
}

/// A metric.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantity {
    /// Its name in tables.
    pub name: String,
    /// Its unit; empty for a pure number.
    pub unit: String,
    /// Whether the printed table shows it, and not the JSON form and the table of metrics alone.
    pub shown: bool,
}

/// Values at fixed points of an abscissa, averaged over the runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// Its name, as the title of a chart.
    pub title: String,
    /// Its unit.
    pub unit: String,
    /// Name and unit of the abscissa.
    pub abscissa: String,
    /// The points.
    pub x: Vec<f64>,
    /// Runs give squares, and the curve is the root of their mean.
    pub root: bool,
}

/// A share of the runs of a study: shard `index` of `count`, from 1, has the runs whose number leaves `index - 1` when
/// divided by `count`.
///
/// ```
/// use tercel_study::monte_carlo::Shard;
///
/// let shard: Shard = "2/3".parse()?;
/// assert_eq!(shard.runs(8).collect::<Vec<_>>(), [1, 4, 7]);
/// assert!("4/3".parse::<Shard>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    index: u64,
    count: u64,
}

impl Plan {
    /// Number of conditions.
    pub fn conditions(&self) -> usize {
        self.sweep.as_ref().map_or(1, |sweep| sweep.values.len())
    }

    /// Name and value of what is swept under a condition.
    pub fn at(&self, condition: usize) -> Option<(&str, f64)> {
        let sweep = self.sweep.as_ref()?;
        Some((&sweep.name, *sweep.values.get(condition)?))
    }
}

impl Quantity {
    /// Name and unit: `rmse_pos, m`.
    pub fn heading(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{}, {}", self.name, self.unit) }
    }
}

impl Shard {
    /// All runs.
    pub const WHOLE: Shard = Shard { index: 1, count: 1 };

    /// Number of this shard, from 1.
    pub fn index(&self) -> u64 {
        self.index
    }

    /// Number of shards.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Whether the numbers make a shard; what is read from a file may not.
    pub fn is_valid(&self) -> bool {
        (1..=self.count).contains(&self.index)
    }

    /// Its runs, of `runs` in all.
    pub fn runs(&self, runs: u64) -> impl Iterator<Item = u64> + use<> {
        let step = usize::try_from(self.count).unwrap_or(usize::MAX).max(1);
        (self.index.saturating_sub(1)..runs).step_by(step)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text.split_once('/').and_then(|(index, count)| {
            Some(Shard { index: index.trim().parse().ok()?, count: count.trim().parse().ok()? })
        });
        numbers
            .filter(Shard::is_valid)
            .ok_or_else(|| "expected the number of a shard and how many there are: 1/4 to 4/4".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_in_one_shard() {
        for (count, runs) in [(1, 5), (3, 10), (4, 3), (7, 0)] {
            let mut all: Vec<u64> = (1..=count).flat_map(|index| Shard { index, count }.runs(runs)).collect();
            all.sort_unstable();
            assert_eq!(all, (0..runs).collect::<Vec<_>>());
        }
    }

    #[test]
    fn what_is_no_share_is_refused() {
        for text in ["", "1", "0/3", "4/3", "1/0", "a/b", "-1/2", "1/2/3", "1.0/2"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }
}
