//! The parameters of a model: named, ordered, and kept as plain numbers.
//!
//! Between the steps of a training the parameters are vectors in a [`ParameterSet`], and so are their
//! gradients. The optimiser, the checkpoints and the model files then are loops over numbers whose result
//! does not depend on a framework or on the number of threads. Each graph gets leaves of its own
//! ([`Weights`]), because graphs that share a leaf would share a lock. This is why the `Module` of burn,
//! which holds tensors, is not used.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};

use crate::TrainError;
use crate::backend::{self, Tape, Tensor};
use crate::hash::fnv1a;
use crate::store::Named;

/// Where the values of a parameter come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Initial {
    /// The same value everywhere.
    Constant(f32),
    /// Uniform in `[-bound, bound]`. PyTorch has `1 / sqrt(inputs)` for linear layers and `1 / sqrt(hidden)`
    /// for recurrent ones.
    Uniform {
        /// The largest magnitude.
        bound: f32,
    },
    /// Uniform between two limits.
    Between {
        /// The least value.
        low: f32,
        /// The greatest value.
        high: f32,
    },
    /// Values whose softplus `ln(1 + eˣ)` is uniform between two limits above 0: for what must be positive.
    Positive {
        /// The least softplus.
        low: f32,
        /// The greatest softplus.
        high: f32,
    },
    /// 1 or -1.
    Signs,
    /// Orthonormal rows or columns, in blocks of as many columns as there are rows if it is wide, times a
    /// gain.
    Orthogonal {
        /// The gain.
        gain: f32,
    },
    /// Given values.
    Values(Vec<f32>),
}

/// One parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    name: String,
    shape: Vec<usize>,
    values: Vec<f32>,
}

impl Parameter {
    /// The name under which files know it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// One dimension for a bias, `[inputs, outputs]` for a matrix.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// The values, row after row.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The parameter as a tensor of a file, with a prefix before its name.
    pub(crate) fn to_named(&self, prefix: &str) -> Named {
        (format!("{prefix}{}", self.name), self.shape.clone(), self.values.clone())
    }

    fn rows_and_columns(&self) -> [usize; 2] {
        match self.shape[..] {
            [rows, columns] => [rows, columns],
            _ => [1, self.values.len()],
        }
    }
}

/// A parameter of a set, by its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParameterId(usize);

/// All parameters of a model, in the order in which its layers added them.
///
/// The values with which a parameter starts depend on the seed and on its name alone, so a layer that is
/// added to a model leaves the others as they were.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterSet {
    seed: u64,
    entries: Vec<Parameter>,
}

impl ParameterSet {
    /// An empty set.
    pub fn new(seed: u64) -> Self {
        Self { seed, entries: Vec::new() }
    }

    /// Adds a parameter of one or two dimensions.
    ///
    /// # Errors
    ///
    /// If the name is taken, a dimension is zero, there are more than two, or given values do not fill the
    /// shape.
    pub fn add(&mut self, name: &str, shape: &[usize], initial: Initial) -> Result<ParameterId, TrainError> {
        let fault = |problem: String| Err(TrainError::Parameter { name: name.to_owned(), problem });
        if self.entries.iter().any(|entry| entry.name == name) {
            return fault("the name is taken".into());
        }
        if shape.is_empty() || shape.len() > 2 || shape.contains(&0) {
            return fault(format!(
                "its shape is {shape:?}, but one or two dimensions of at least 1 are needed"
            ));
        }
        let count = shape.iter().product();
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(fnv1a(name.as_bytes()));
        let values = match initial {
            Initial::Constant(value) => vec![value; count],
            Initial::Uniform { bound } => match between([-bound, bound], count, &mut random) {
                Some(values) => values,
                None => {
                    return fault(format!(
                        "the bound of its values is {bound}, but must be finite and positive"
                    ));
                }
            },
            Initial::Between { low, high } | Initial::Positive { low, high } => {
                let values = between([low, high], count, &mut random);
                match (values, matches!(initial, Initial::Positive { .. })) {
                    (Some(values), false) => values,
                    (Some(values), true) if low > 0.0 => {
                        values.iter().map(|value| value.exp_m1().ln()).collect()
                    }
                    _ => return fault(format!("its values cannot lie between {low} and {high}")),
                }
            }
            Initial::Signs => {
                let signs = between([-1.0, 1.0], count, &mut random).unwrap_or_default();
                signs.iter().map(|sign| sign.signum()).collect()
            }
            Initial::Orthogonal { gain } => orthogonal(shape, gain, &mut random),
            Initial::Values(values) if values.len() == count => values,
            Initial::Values(values) => {
                return fault(format!("{} values were given for the shape {shape:?}", values.len()));
            }
        };
        self.entries.push(Parameter { name: name.to_owned(), shape: shape.to_vec(), values });
        Ok(ParameterId(self.entries.len() - 1))
    }

    /// The parameters, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Parameter> {
        self.entries.iter()
    }

    /// The values of each parameter, to be changed in place.
    pub fn values_mut(&mut self) -> impl ExactSizeIterator<Item = (&str, &mut [f32])> {
        self.entries.iter_mut().map(|entry| (entry.name.as_str(), entry.values.as_mut_slice()))
    }

    /// The number of parameters, each a matrix or vector.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The number of numbers in them.
    pub fn count(&self) -> usize {
        self.entries.iter().map(|entry| entry.values.len()).sum()
    }

    /// The parameter of that name.
    pub fn get(&self, name: &str) -> Option<&Parameter> {
        self.entries.iter().find(|entry| entry.name == name)
    }

    /// The parameters as the tensors of a model.
    pub fn tensors(&self) -> BTreeMap<String, tercel_neural::Tensor> {
        let tensor = |entry: &Parameter| {
            let (shape, values) = (entry.shape.clone(), entry.values.clone());
            (entry.name.clone(), tercel_neural::Tensor { shape, values })
        };
        self.entries.iter().map(tensor).collect()
    }

    /// Takes over the values of tensors with the same names and shapes.
    ///
    /// # Errors
    ///
    /// If names or shapes differ; the first that does is named.
    pub(crate) fn assign(&mut self, values: &[Named]) -> Result<(), TrainError> {
        for entry in &self.entries {
            let fault = |problem| TrainError::Parameter { name: entry.name.clone(), problem };
            let (_, shape, _) = values
                .iter()
                .find(|(name, ..)| *name == entry.name)
                .ok_or_else(|| fault("it is missing".to_owned()))?;
            if *shape != entry.shape {
                return Err(fault(format!("its shape is {shape:?}, but the model has {:?}", entry.shape)));
            }
        }
        if let Some((name, ..)) = values.iter().find(|(name, ..)| self.get(name).is_none()) {
            return Err(TrainError::Parameter {
                name: name.clone(),
                problem: "the model has none of that name".into(),
            });
        }
        for entry in &mut self.entries {
            if let Some((.., new)) = values.iter().find(|(name, ..)| *name == entry.name) {
                entry.values.clone_from(new);
            }
        }
        Ok(())
    }
}

/// Uniform values between two limits, if that is possible.
fn between([low, high]: [f32; 2], count: usize, random: &mut ChaCha8Rng) -> Option<Vec<f32>> {
    let uniform = Uniform::new_inclusive(low, high).ok()?;
    Some(uniform.sample_iter(random).take(count).collect())
}

/// The columns of the Q factor of a Gaussian matrix are uniformly distributed over orthonormal frames, once
/// the signs are fixed by the diagonal of R (Mezzadri 2007).
fn orthogonal(shape: &[usize], gain: f32, random: &mut ChaCha8Rng) -> Vec<f32> {
    let [rows, columns] = match *shape {
        [rows, columns] => [rows, columns],
        _ => [1, shape[0]],
    };
    let mut values = vec![0.0; rows * columns];
    for start in (0..columns).step_by(rows.max(1)) {
        let width = rows.min(columns - start);
        let gaussian = DMatrix::<f64>::from_fn(rows, width, |_, _| StandardNormal.sample(random));
        let (q, r) = gaussian.qr().unpack();
        for row in 0..rows {
            for column in 0..width {
                let sign = if r[(column, column)] < 0.0 { -1.0 } else { 1.0 };
                values[row * columns + start + column] = gain * (q[(row, column)] * sign) as f32;
            }
        }
    }
    values
}

/// The parameters of a model as tensors of one graph.
#[derive(Debug, Clone)]
pub struct Weights {
    tensors: Vec<Tensor>,
}

impl Weights {
    /// Leaves of a new graph, whose gradients can be asked for.
    pub fn trainable(set: &ParameterSet) -> Self {
        Self { tensors: tensors(set, backend::leaf) }
    }

    /// Constants, for the validation and for networks that are not trained any more.
    pub fn frozen(set: &ParameterSet) -> Self {
        Self { tensors: tensors(set, backend::constant) }
    }

    /// The tensor of a parameter: `[1, n]` if it has one dimension.
    pub fn get(&self, id: ParameterId) -> Tensor {
        self.tensors[id.0].clone()
    }

    /// All tensors, in the order of the set.
    pub fn tensors(&self) -> &[Tensor] {
        &self.tensors
    }

    /// The gradients of a loss with respect to all parameters, in the order of the set.
    ///
    /// Parameters that the loss does not depend on have a gradient of zero.
    pub fn gradients(&self, loss: &Tensor) -> Vec<Vec<f32>> {
        let mut tape = Tape::backward(loss);
        let mut gradient = |leaf: &Tensor| tape.as_mut().and_then(|tape| tape.gradient(leaf));
        let zeros = |leaf: &Tensor| vec![0.0; leaf.dims().iter().product()];
        self.tensors.iter().map(|leaf| gradient(leaf).unwrap_or_else(|| zeros(leaf))).collect()
    }
}

fn tensors(set: &ParameterSet, make: fn(Vec<f32>, [usize; 2]) -> Tensor) -> Vec<Tensor> {
    set.entries.iter().map(|entry| make(entry.values.clone(), entry.rows_and_columns())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_depend_on_seed_and_name_but_not_on_the_other_parameters() {
        let uniform = || Initial::Uniform { bound: 0.5 };
        let mut one = ParameterSet::new(3);
        one.add("a", &[4, 5], uniform()).unwrap();
        one.add("b", &[7], uniform()).unwrap();
        let mut other = ParameterSet::new(3);
        other.add("b", &[7], uniform()).unwrap();
        assert_eq!(one.get("b"), other.get("b"));
        let mut seeded = ParameterSet::new(4);
        seeded.add("b", &[7], uniform()).unwrap();
        assert_ne!(one.get("b"), seeded.get("b"));
        assert_eq!((one.len(), one.count()), (2, 27));
    }

    #[test]
    fn orthogonal_blocks_have_orthonormal_columns() {
        let mut set = ParameterSet::new(1);
        set.add("w", &[6, 18], Initial::Orthogonal { gain: 2.0 }).unwrap();
        let w = set.get("w").unwrap().values();
        for a in 0..6 {
            for b in 0..6 {
                let dot: f32 = (0..6).map(|row| w[row * 18 + 6 + a] * w[row * 18 + 6 + b]).sum();
                assert!((dot - if a == b { 4.0 } else { 0.0 }).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn impossible_parameters_are_refused_by_name() {
        let mut set = ParameterSet::new(1);
        set.add("w", &[2, 2], Initial::Constant(0.0)).unwrap();
        for (name, shape) in [("w", vec![2, 2]), ("x", vec![0, 3]), ("x", vec![]), ("x", vec![1, 1, 1])] {
            let error = set.add(name, &shape, Initial::Constant(0.0)).unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
        }
        assert!(set.add("y", &[2], Initial::Values(vec![1.0])).is_err());
        assert!(set.add("y", &[2], Initial::Uniform { bound: f32::NAN }).is_err());
    }

    #[test]
    fn only_values_of_the_same_layout_are_taken_over() {
        let mut set = ParameterSet::new(1);
        set.add("w", &[2], Initial::Constant(0.0)).unwrap();
        let named = |name: &str, shape: Vec<usize>| vec![(name.to_owned(), shape, vec![1.0, 2.0])];
        assert!(set.assign(&named("v", vec![2])).is_err());
        assert!(set.assign(&named("w", vec![1, 2])).is_err());
        let mut extra = named("w", vec![2]);
        extra.extend(named("v", vec![2]));
        assert!(set.assign(&extra).is_err());
        set.assign(&named("w", vec![2])).unwrap();
        assert_eq!(set.get("w").unwrap().values(), [1.0, 2.0]);
    }
}
