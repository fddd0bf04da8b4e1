//! Tracks that move like a recorded one and are not it.

use nalgebra::{DMatrix, DVector, Vector2, Vector4};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::TrainError;

/// Standard deviation of what the weights leave open of a velocity, m/s per axis: that of the publication.
const RESIDUAL: f64 = 3.162_277_660_168_379_5;

/// By how much weights shrink, as often as is needed until the motion is stable.
const SHRINK: f64 = 0.98;

/// A track of the same length as a recorded one, whose velocities around their mean depend on the velocities before.
///
/// ## Definition
/// With the mean `m` of the velocities, which are differences backwards in time, and weights `a` by least squares, the same for
/// both axes:
/// ```text
/// v(k) - m = Σ_i a_i (v(k-i) - m) + ε(k),   ε ~ N(0, 10 I₂),      p(k) = p(k-1) + T v(k)
/// ```
/// from the first velocities and the first position of the recorded track. Weights of a motion that is not stable shrink, the
/// later ones more.
///
/// ## Reference
/// RMMNet paper, section IV.B and eq. 43.
pub fn imitation(
    track: &[Vector4<f64>],
    order: usize,
    interval: f64,
    random: &mut ChaCha8Rng,
) -> Result<Vec<Vector4<f64>>, TrainError> {
    if track.len() <= 2 * order + 1 {
        let found = track.len();
        return Err(TrainError::Data(format!(
            "a track of {found} steps is too short to find {order} weights in it"
        )));
    }
    let velocities: Vec<Vector2<f64>> = track.iter().map(|state| Vector2::new(state[2], state[3])).collect();
    let mean = velocities.iter().sum::<Vector2<f64>>() / velocities.len() as f64;
    let around: Vec<Vector2<f64>> = velocities.iter().map(|velocity| velocity - mean).collect();
    let weights = fitted(&around, order)?;
    let mut around = around[..order].to_vec();
    let mut place = Vector2::new(track[0][0], track[0][1]);
    let mut states = Vec::with_capacity(track.len());
    for step in 0..track.len() {
        if step >= order {
            let pull: Vector2<f64> = weights.iter().zip(around.iter().rev()).map(|(a, v)| v * *a).sum();
            around.push(pull + Vector2::from_fn(|_, _| StandardNormal.sample(random)) * RESIDUAL);
        }
        let velocity = mean + around[step];
        if step > 0 {
            place += velocity * interval;
        }
        states.push(Vector4::new(place.x, place.y, velocity.x, velocity.y));
    }
    Ok(states)
}

/// The weights with the least squares, of a stable motion.
fn fitted(around: &[Vector2<f64>], order: usize) -> Result<Vec<f64>, TrainError> {
    let mut squares = DMatrix::<f64>::zeros(order, order);
    let mut products = DVector::<f64>::zeros(order);
    for step in order..around.len() {
        for i in 0..order {
            products[i] += around[step].dot(&around[step - 1 - i]);
            for j in 0..order {
                squares[(i, j)] += around[step - 1 - i].dot(&around[step - 1 - j]);
            }
        }
    }
    // A track that does not move has no weights; the least of all ridges makes them zero.
    let ridge = 1e-9 * squares.trace() + f64::MIN_POSITIVE;
    (0..order).for_each(|i| squares[(i, i)] += ridge);
    let solved = squares.cholesky().map(|factor| factor.solve(&products));
    let Some(solved) = solved.filter(|weights| weights.iter().all(|weight| weight.is_finite())) else {
        return Err(TrainError::Data("the velocities of a track determine no weights".to_owned()));
    };
    let mut weights: Vec<f64> = solved.iter().copied().collect();
    while !tercel_sim::extended::is_stable(&weights) {
        let mut factor = 1.0;
        for weight in &mut weights {
            factor *= SHRINK;
            *weight *= factor;
        }
    }
    Ok(weights)
}
