//! Ensembles that see the whole of a track before they say anything of it.

use std::sync::Arc;

use nalgebra::Vector2;
use tercel_core::error::FilterError;
use tercel_core::filter::{Estimate, Filter};
use tercel_core::motion::Motion;
use tercel_core::sensor::{LinearSensor, Measurement};

use super::features::Sight;
use super::{EnsKNets, EnsKNetsBelief, EnsembleNetwork, Normalisation};
use crate::error::ModelError;

/// Judges recorded tracks with an ensemble of KalmanNets whose inputs are normalised over the whole track, as
/// the publication does. It is no filter: an estimate depends on measurements that come later.
///
/// ## Definition
/// The KalmanNets and the attention of [`EnsKNets`] run as always. Then each component of what the branches
/// see is divided by its standard deviation over all measurements of the track, after its mean was taken from
/// it, and the branches run over the result. Corrections and probabilities are applied as by the filter,
/// without a measurement too.
///
/// ## Use it when
/// figures of the publication are to be compared. In a table it stands beside smoothers, not beside filters.
///
/// ## Reference
/// As [`EnsKNets`]; instance normalisation of Ulyanov et al. (2016), without its affine part.
#[derive(Debug, Clone, PartialEq)]
pub struct OfflineEnsKNets<S> {
    filter: EnsKNets<S>,
}

impl<S: Clone> OfflineEnsKNets<S> {
    /// Of networks with [`Normalisation::Sequence`] and a sensor that stands at the origin.
    ///
    /// # Errors
    /// When the network does not need the whole track, and should be an [`EnsKNets`].
    pub fn new(network: Arc<EnsembleNetwork>, sensor: S) -> Result<Self, ModelError> {
        if network.hyper().normalisation != Normalisation::Sequence {
            let reason = "`normalisation` is not `sequence`; `EnsKNets` is the filter for this model";
            return Err(ModelError::Hyper { file: network.file().clone(), reason: reason.into() });
        }
        Ok(OfflineEnsKNets { filter: EnsKNets::unchecked(network, sensor) })
    }

    /// Says where the sensor stands, m.
    pub fn seen_from(self, origin: Vector2<f64>) -> Self {
        OfflineEnsKNets { filter: self.filter.seen_from(origin) }
    }
}

impl<S: LinearSensor<4, 2>> OfflineEnsKNets<S> {
    /// The networks.
    pub fn network(&self) -> &Arc<EnsembleNetwork> {
        self.filter.network()
    }

    /// The estimates of a track that begins with this measurement: one for it, and one for each step after
    /// it, which is a time in seconds and perhaps a measurement at its end.
    ///
    /// # Errors
    /// As [`Filter::birth`] and [`Filter::update`].
    pub fn estimates(
        &self,
        first: &Measurement<2>,
        steps: impl IntoIterator<Item = (f64, Option<Measurement<2>>)>,
    ) -> Result<Vec<Estimate<4>>, FilterError> {
        let Recorded { mut beliefs, times, mut features } = self.record(first, steps)?;
        let width = self.network().hyper().inputs();
        if width > 0 {
            EnsembleNetwork::normalise_sequence(&mut features, width);
        }
        let mut rows = features.chunks_exact(width.max(1));
        let mut memory = beliefs[0].memory.clone();
        let mut outputs = vec![0.0; self.network().hyper().outputs()];
        let mut inputs = vec![0.0; width];
        for index in 1..beliefs.len() {
            let (before, rest) = beliefs.split_at_mut(index);
            let (before, belief) = (&before[index - 1], &mut rest[0]);
            let (dt, measured) = times[index - 1];
            if !measured {
                self.hold(belief, before, dt);
                continue;
            }
            let (next, scratch) = memory.stage();
            self.network().step(rows.next().unwrap_or_default(), next, scratch, &mut inputs, &mut outputs);
            memory.commit();
            // Corrections of these models are in the frame of the state.
            self.filter.answer(&outputs, &Sight::new(Vector2::zeros()), &mut belief.modes);
        }
        Ok(beliefs.iter().map(|belief| self.filter.estimate(belief)).collect())
    }

    fn record(
        &self,
        first: &Measurement<2>,
        steps: impl IntoIterator<Item = (f64, Option<Measurement<2>>)>,
    ) -> Result<Recorded, FilterError> {
        let mut belief = self.filter.birth(first)?;
        let mut recorded =
            Recorded { beliefs: vec![belief.clone()], times: Vec::new(), features: Vec::new() };
        for (dt, measurement) in steps {
            self.filter.predict(&mut belief, dt);
            if let Some(measurement) = &measurement {
                self.filter.update(&mut belief, measurement)?;
                recorded.features.extend_from_slice(&belief.features);
            }
            recorded.times.push((dt, measurement.is_some()));
            recorded.beliefs.push(belief.clone());
        }
        Ok(recorded)
    }

    /// Takes over what was thought a step before.
    fn hold(&self, belief: &mut EnsKNetsBelief, before: &EnsKNetsBelief, dt: f64) {
        let modes = belief.modes.iter_mut().zip(&before.modes).zip(&self.filter.motions);
        for ((mode, before), motion) in modes {
            mode.correction = motion.transition(&before.correction, dt);
            mode.probability = before.probability;
        }
    }
}

/// A track as the KalmanNets followed it.
struct Recorded {
    beliefs: Vec<EnsKNetsBelief>,
    /// Length of each step, and whether it ended with a measurement.
    times: Vec<(f64, bool)>,
    /// What the branches are to see, a row for each measurement after the first.
    features: Vec<f32>,
}
