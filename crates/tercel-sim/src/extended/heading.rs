//! Where the nose of an aircraft points on a recorded track.

use nalgebra::{Vector2, Vector4};
use rand_distr::{Distribution, StandardNormal};

use crate::Stream;

/// How the direction of an aircraft follows from its track.
///
/// ## Definition
/// With the course `χ = atan2(vy, vx)`, held where the aircraft stands still:
///
/// | heading | direction |
/// |---|---|
/// | `Course` | `χ` of the recorded velocity |
/// | `Smoothed` | `χ` of the mean of the velocities of 7 steps, 3 to either side |
/// | `Crab` | the smoothed one, turned into a wind that is constant over the track: `sin(θ - χ) = -w_across / V` |
///
/// The wind of a track is drawn with a deviation of 8 m/s on each axis of the plane. `V` is the speed, at
/// least the wind's.
///
/// ```
/// use nalgebra::vector;
/// use tercel_sim::extended::Heading;
///
/// let north = vec![vector![0.0, 0.0, 0.0, 100.0]; 10];
/// assert!(Heading::Course.angles(&north, 1, 0).iter().all(|angle| (angle - 1.5708).abs() < 1e-4));
/// let turned = Heading::Crab.angles(&north, 1, 0)[0] - 1.5708;
/// assert!(turned.abs() > 1e-4 && turned.abs() < 0.4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Heading {
    /// Along the recorded velocity.
    Course,
    /// Along the velocity, smoothed.
    Smoothed,
    /// Into the wind.
    Crab,
}

/// Steps to either side over which velocities are averaged.
const SIDE: usize = 3;

/// Standard deviation of the wind, m/s per axis.
const WIND: f64 = 8.0;

/// Speed below which an aircraft keeps its direction, m/s.
const STANDING: f64 = 0.3;

impl Heading {
    /// The direction at each state `x, y, vx, vy`, rad. The wind depends on the seed and the number of the
    /// run.
    pub fn angles(self, states: &[Vector4<f64>], seed: u64, run: u64) -> Vec<f64> {
        let mut random = Stream::Truth.of(seed, run);
        let wind = Vector2::from_fn(|_, _| -> f64 { StandardNormal.sample(&mut random) }) * WIND;
        let mut last = 0.0;
        (0..states.len())
            .map(|step| {
                let side = if self == Heading::Course { 0 } else { SIDE };
                let around = &states[step.saturating_sub(side)..(step + side + 1).min(states.len())];
                let velocity =
                    around.iter().map(|state| Vector2::new(state.z, state.w)).sum::<Vector2<f64>>()
                        / around.len() as f64;
                let speed = velocity.norm();
                if speed >= STANDING {
                    last = velocity.y.atan2(velocity.x);
                    if self == Heading::Crab {
                        let across = (velocity.x * wind.y - velocity.y * wind.x) / speed;
                        last -= (across / speed.max(wind.norm())).asin();
                    }
                }
                last
            })
            .collect()
    }
}
