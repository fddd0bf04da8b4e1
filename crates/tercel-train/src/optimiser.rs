//! The optimiser: AdamW with a global clipping norm, and the schedule of its learning rate.

use serde::{Deserialize, Serialize};

use crate::backend::vector::vectorised;
use crate::check::{self, at_least, within};
use crate::{ParameterSet, TrainError};

/// The section `[optimiser]` of a recipe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OptimiserConfig {
    /// The learning rate at its highest.
    pub rate: f64,
    /// Weight decay, decoupled from the gradient; multiplied with the learning rate.
    pub weight_decay: f64,
    /// Decay of the mean of the gradients.
    pub beta1: f64,
    /// Decay of the mean of their squares.
    pub beta2: f64,
    /// Added to the root of the mean square.
    pub epsilon: f64,
    /// The norm of all gradients together is clipped to this; 0 clips nothing.
    pub clip: f64,
    /// Parameters that are treated differently. The first group that fits a name counts.
    pub group: Vec<Group>,
}

/// Parameters with a rate or decay of their own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// The names of the parameters begin with this.
    pub prefix: String,
    /// The learning rate of the group, as a multiple of the common one; 0 freezes it.
    #[serde(default = "one")]
    pub rate_factor: f64,
    /// Its weight decay, if not the common one.
    pub weight_decay: Option<f64>,
}

fn one() -> f64 {
    1.0
}

impl Default for OptimiserConfig {
    fn default() -> Self {
        Self {
            rate: 1e-3,
            weight_decay: 1e-2,
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
            clip: 1.0,
            group: Vec::new(),
        }
    }
}

impl OptimiserConfig {
    /// Checks the ranges of all values.
    ///
    /// # Errors
    ///
    /// If one is impossible; its key is named.
    pub fn validate(&self) -> Result<(), TrainError> {
        check::positive("optimiser.rate", self.rate)?;
        at_least("optimiser.weight_decay", self.weight_decay, 0.0)?;
        within("optimiser.beta1", self.beta1, 0.0..1.0)?;
        within("optimiser.beta2", self.beta2, 0.0..1.0)?;
        check::positive("optimiser.epsilon", self.epsilon)?;
        at_least("optimiser.clip", self.clip, 0.0)?;
        for group in &self.group {
            at_least("optimiser.group.rate_factor", group.rate_factor, 0.0)?;
            at_least("optimiser.group.weight_decay", group.weight_decay.unwrap_or(0.0), 0.0)?;
        }
        Ok(())
    }

    /// Checks that each group fits a parameter of the model: a prefix that fits none is a misprint.
    ///
    /// # Errors
    ///
    /// If one does not; it is named.
    pub fn validate_groups(&self, set: &ParameterSet) -> Result<(), TrainError> {
        match self.group.iter().find(|group| !set.iter().any(|entry| entry.name().starts_with(&group.prefix)))
        {
            None => Ok(()),
            Some(group) => Err(TrainError::Value {
                key: "optimiser.group.prefix".into(),
                value: format!("{:?}", group.prefix),
                expected: format!(
                    "no parameter of the model begins so; there are {}",
                    set.iter().map(|entry| entry.name()).collect::<Vec<_>>().join(", ")
                ),
            }),
        }
    }
}

/// Adam with decoupled weight decay.
///
/// ## Recursion
///
/// ```text
/// g <- g min(1, clip / |g|)                      |g| over all parameters together
/// m <- b1 m + (1 - b1) g        v <- b2 v + (1 - b2) g^2
/// w <- w (1 - rate decay) - rate m / (1 - b1^k) / (sqrt(v / (1 - b2^k)) + epsilon)
/// ```
///
/// ## Reference
///
/// I. Loshchilov, F. Hutter, "Decoupled weight decay regularization", ICLR 2019, algorithm 2, in the form of
/// PyTorch, whose decay is multiplied with the learning rate.
#[derive(Debug, Clone, PartialEq)]
pub struct AdamW {
    config: OptimiserConfig,
    /// Updates taken.
    pub(crate) updates: u64,
    /// Means of the gradients, for each parameter.
    pub(crate) first: Vec<Vec<f32>>,
    /// Means of their squares.
    pub(crate) second: Vec<Vec<f32>>,
}

impl AdamW {
    /// An optimiser for the parameters of a set, which has taken no step yet.
    pub fn new(config: OptimiserConfig, set: &ParameterSet) -> Self {
        let zeros: Vec<_> = set.iter().map(|entry| vec![0.0; entry.values().len()]).collect();
        Self { config, updates: 0, first: zeros.clone(), second: zeros }
    }

    /// The learning rate at its highest.
    pub fn top_rate(&self) -> f64 {
        self.config.rate
    }

    /// The number of updates taken so far.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Changes the parameters by one step. Gives the norm of the gradients before clipping, or `None` if it
    /// is not finite, in which case nothing was changed.
    pub fn step(&mut self, set: &mut ParameterSet, gradients: &[Vec<f32>], rate: f64) -> Option<f64> {
        let norm = norm(gradients);
        if !norm.is_finite() {
            return None;
        }
        self.updates += 1;
        let config = &self.config;
        let shrink = if config.clip > 0.0 && norm > config.clip { config.clip / norm } else { 1.0 };
        let correction = |beta: f64| 1.0 - beta.powf(self.updates as f64);
        let (first_correction, second_correction) = (correction(config.beta1), correction(config.beta2));
        let moments = self.first.iter_mut().zip(&mut self.second);
        for (((name, values), gradient), (first, second)) in set.values_mut().zip(gradients).zip(moments) {
            let group = config.group.iter().find(|group| name.starts_with(&group.prefix));
            let rate = rate * group.map_or(1.0, |group| group.rate_factor);
            let decay = group.and_then(|group| group.weight_decay).unwrap_or(config.weight_decay);
            let update = Update {
                shrink: shrink as f32,
                beta1: config.beta1 as f32,
                beta2: config.beta2 as f32,
                keep: (1.0 - rate * decay) as f32,
                length: (rate / first_correction) as f32,
                root: (1.0 / second_correction.sqrt()) as f32,
                epsilon: config.epsilon as f32,
            };
            change(&update, values, gradient, first, second);
        }
        Some(norm)
    }
}

struct Update {
    shrink: f32,
    beta1: f32,
    beta2: f32,
    keep: f32,
    length: f32,
    root: f32,
    epsilon: f32,
}

vectorised! {
    /// Changes values and moments.
    fn change<'a>(
        update: &'a Update,
        values: &'a mut [f32],
        gradient: &'a [f32],
        first: &'a mut [f32],
        second: &'a mut [f32],
    ) {
        let moments = first.iter_mut().zip(second);
        for ((value, gradient), (first, second)) in values.iter_mut().zip(gradient).zip(moments) {
            let gradient = gradient * update.shrink;
            *first = update.beta1 * *first + (1.0 - update.beta1) * gradient;
            *second = update.beta2 * *second + (1.0 - update.beta2) * gradient * gradient;
            let root = second.sqrt() * update.root + update.epsilon;
            *value = *value * update.keep - update.length * *first / root;
        }
    }
}

/// The Euclidean norm of all gradients together.
pub fn norm(gradients: &[Vec<f32>]) -> f64 {
    gradients.iter().flatten().map(|gradient| f64::from(*gradient).powi(2)).sum::<f64>().sqrt()
}

/// A learning rate that rises in a straight line and then falls along half a cosine.
///
/// ## Definition
///
/// ```text
/// rate(k) = top (k + 1) / w                                                        k < w
/// rate(k) = top (floor + (1 - floor) (1 + cos(pi (k - w) / (n - w))) / 2)          otherwise
/// ```
///
/// with updates `k` from 0, `w` of them to warm up, and `n` in all. Beyond them the rate stays at its floor.
///
/// ## Reference
///
/// I. Loshchilov, F. Hutter, "SGDR: stochastic gradient descent with warm restarts", ICLR 2017, Eq. (5),
/// without restarts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cosine {
    /// The highest rate.
    pub top: f64,
    /// The last rate, as a share of the highest.
    pub floor: f64,
    /// Updates to warm up.
    pub warm_up: u64,
    /// Updates in all.
    pub total: u64,
}

impl Cosine {
    /// The rate of an update, counted from 0.
    pub fn rate(&self, update: u64) -> f64 {
        if update < self.warm_up {
            return self.top * (update + 1) as f64 / self.warm_up as f64;
        }
        let length = self.total.saturating_sub(self.warm_up).max(1) as f64;
        let share = ((update - self.warm_up) as f64 / length).min(1.0);
        self.top * (self.floor + (1.0 - self.floor) * (1.0 + (std::f64::consts::PI * share).cos()) / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Initial;

    fn set() -> ParameterSet {
        let mut set = ParameterSet::new(1);
        set.add("a.weight", &[2], Initial::Values(vec![1.0, -2.0])).unwrap();
        set.add("b.weight", &[1], Initial::Values(vec![0.5])).unwrap();
        set
    }

    fn values(set: &ParameterSet) -> Vec<f32> {
        set.iter().flat_map(|entry| entry.values().to_vec()).collect()
    }

    #[test]
    fn three_steps_equal_the_recursion_in_double_precision() {
        let config = OptimiserConfig { clip: 0.0, ..Default::default() };
        let (mut set, mut expected) = (set(), vec![1.0_f64, -2.0, 0.5]);
        let mut optimiser = AdamW::new(config.clone(), &set);
        let (mut m, mut v) = ([0.0_f64; 3], [0.0_f64; 3]);
        for k in 1..=3 {
            let gradient = [0.3 * f64::from(k), -1.0, 0.01];
            let given = [vec![gradient[0] as f32, gradient[1] as f32], vec![gradient[2] as f32]];
            optimiser.step(&mut set, &given, 0.1).unwrap();
            for i in 0..3 {
                m[i] = 0.9 * m[i] + 0.1 * gradient[i];
                v[i] = 0.999 * v[i] + 0.001 * gradient[i] * gradient[i];
                let (mh, vh) = (m[i] / (1.0 - 0.9_f64.powi(k)), v[i] / (1.0 - 0.999_f64.powi(k)));
                expected[i] = expected[i] * (1.0 - 0.1 * 0.01) - 0.1 * mh / (vh.sqrt() + 1e-8);
            }
        }
        for (found, expected) in values(&set).iter().zip(expected) {
            assert!((f64::from(*found) - expected).abs() < 1e-5, "{found} for {expected}");
        }
    }

    #[test]
    fn the_norm_of_all_gradients_together_is_clipped() {
        let config = OptimiserConfig { clip: 1.0, weight_decay: 0.0, ..Default::default() };
        let (mut set, mut optimiser) = (set(), AdamW::new(config, &set()));
        let norm = optimiser.step(&mut set, &[vec![3.0, 0.0], vec![4.0]], 0.1).unwrap();
        assert!((norm - 5.0).abs() < 1e-12);
        assert!((optimiser.first[0][0] - 0.06).abs() < 1e-7 && (optimiser.first[1][0] - 0.08).abs() < 1e-7);
    }

    #[test]
    fn gradients_that_are_not_finite_change_nothing() {
        let (mut set, before) = (set(), set());
        let mut optimiser = AdamW::new(OptimiserConfig::default(), &set);
        let fresh = optimiser.clone();
        for bad in [f32::NAN, f32::INFINITY] {
            assert_eq!(optimiser.step(&mut set, &[vec![0.0, bad], vec![0.0]], 0.1), None);
        }
        assert_eq!((&set, &optimiser), (&before, &fresh));
    }

    #[test]
    fn a_group_with_factor_zero_is_frozen() {
        let group = Group { prefix: "a.".into(), rate_factor: 0.0, weight_decay: None };
        let config = OptimiserConfig { group: vec![group], ..Default::default() };
        let mut set = set();
        config.validate_groups(&set).unwrap();
        AdamW::new(config, &set).step(&mut set, &[vec![1.0, 1.0], vec![1.0]], 0.1).unwrap();
        assert_eq!(values(&set)[..2], [1.0, -2.0]);
        assert!(values(&set)[2] < 0.5);
    }

    #[test]
    fn a_group_that_fits_nothing_and_impossible_values_are_refused_by_key() {
        let group = Group { prefix: "lstm".into(), rate_factor: 1.0, weight_decay: None };
        let config = OptimiserConfig { group: vec![group], ..Default::default() };
        assert!(config.validate_groups(&set()).unwrap_err().to_string().contains("a.weight, b.weight"));
        let bad = OptimiserConfig { beta2: 1.0, ..Default::default() };
        assert!(bad.validate().unwrap_err().to_string().contains("optimiser.beta2"));
        let bad = OptimiserConfig { rate: f64::NAN, ..Default::default() };
        assert!(bad.validate().unwrap_err().to_string().contains("optimiser.rate"));
    }

    #[test]
    fn the_rate_rises_to_its_top_and_falls_to_its_floor() {
        let cosine = Cosine { top: 2.0, floor: 0.1, warm_up: 4, total: 104 };
        assert_eq!(cosine.rate(0), 0.5);
        assert_eq!(cosine.rate(3), 2.0);
        assert_eq!(cosine.rate(4), 2.0);
        assert!((cosine.rate(54) - 1.1).abs() < 1e-12);
        assert!((cosine.rate(104) - 0.2).abs() < 1e-12 && (cosine.rate(9_000) - 0.2).abs() < 1e-12);
    }
}
