//! The steps of one object.

use tercel_core::error::FilterError;
use tercel_core::extended::{InverseWishart, Points, Scattering};

use super::belief::{RmmNetBelief, gaussian, kinematics};
use super::features::{Before, heading};
use super::hyper::LONGEST;
use super::layers::{AlignedLayers, PublishedLayers};
use super::number::Symmetric;
use super::published::{ESTIMATE_SEEN, Extended, Moments, PREDICTED, SAID, SCAN_SEEN};
use super::track::{Length, MOTION, Past};
use super::view::View;
use crate::filter::memory::Room;

/// Speed beyond which objects go straight, in units of a new object's: weights of past velocities may let a speed grow for as long
/// as nothing is measured.
const FASTEST: f64 = 1e3;

/// Most numbers that a head says.
const MOST: usize = MOTION + LONGEST;

/// Size beyond which nothing sensible is said.
const LOUDEST: f32 = 1e4;

/// Whether numbers can be heard: they are finite, and not as large as those of a network that overflows.
fn sensible(values: &[f32]) -> bool {
    values.iter().all(|value| value.abs() < LOUDEST)
}

/// What was said in double precision, or nothing where it is not to be heard.
fn heard(said: &[f32], sound: bool) -> [f64; MOST] {
    let mut wide = [0.0; MOST];
    if sound {
        wide.iter_mut().zip(said).for_each(|(to, from)| *to = f64::from(*from));
    }
    wide
}

impl AlignedLayers {
    pub fn predict(&self, belief: &mut RmmNetBelief, length: Length) {
        let (options, sizes) = (&self.options, self.options.sizes());
        let before = belief.track();
        let velocity = before.motion.velocity;
        belief.regression.take(&options.identification, options.change, velocity, belief.measured);
        let known = Before { regression: &belief.regression, ..belief.before() };
        let (next, scratch) = belief.memory.stage();
        let mut room = Room(scratch);
        let (seen, said) = (room.take(sizes.motion_seen), room.take(sizes.motion_said));
        options.see_motion(&before, &known, seen);
        self.say_motion(seen, next, room.0, said);
        let sound =
            sensible(said) && sensible(next) && velocity[0].hypot(velocity[1]) < FASTEST * options.speed;
        let said = &heard(said, sound)[..sizes.motion_said];
        if sound {
            belief.memory.commit();
        }
        let past = Past {
            heading: heading(options, velocity, belief.angle),
            velocities: belief.regression.past(),
            expected: belief.regression.expected(),
        };
        let prior = before.predict(options, &past, said, length);
        let report = prior.foresee(options, belief.angle, said);
        belief.state = gaussian(&prior.motion);
        // What cannot be saved is reported by the next update.
        let _ = belief.state.settle();
        belief.held = belief.angle;
        belief.report(&prior, &report);
        (belief.correction, belief.measured) = ([0.0; 4], false);
    }

    pub fn update(
        &self,
        belief: &mut RmmNetBelief,
        points: &Points,
        scattering: &Scattering,
    ) -> Result<(), FilterError> {
        let (options, sizes, count) = (&self.options, self.options.sizes(), points.count());
        let prior = belief.track();
        let noise = scattering.noise();
        let view = View::new(options, &prior, belief.held, points, (scattering.scale(), &noise));
        let needed = self.room(count);
        if belief.room.0.len() < needed {
            belief.room.0.resize(needed, 0.0);
        }
        let rows = &mut belief.room.0[..needed];
        view.see_points(&prior, points, &mut rows[..count * sizes.point]);
        let (memory, scratch) = belief.memory.stage();
        let mut room = Room(scratch);
        let (seen, hidden) = (room.take(sizes.scan_seen), room.take(options.hidden));
        let (said, seen_extent) = (room.take(sizes.scan_said), room.take(sizes.extent_seen));
        let said_extent = room.take(sizes.extent_said);
        options.see_scan(&prior, &view, seen);
        self.say_scan((rows, count), seen, memory, room.0, (hidden, said));
        let sound = sensible(said) && sensible(hidden);
        let mut after = prior.update(options, &view, &heard(said, sound)[..sizes.scan_said]);
        options.see_extent(&after, &view, seen_extent);
        self.say_extent(hidden, seen_extent, room.0, said_extent);
        let said = heard(said_extent, sensible(said_extent));
        let report = after.settle_extent(options, &view, &said[..sizes.extent_said]);
        let mut state = gaussian(&after.motion);
        state.settle()?;
        if !after.axes.iter().chain([&after.worth, &report.angle]).all(|value| value.is_finite()) {
            return Err(FilterError::NotFinite { what: "extent" });
        }
        for (i, correction) in belief.correction.iter_mut().enumerate() {
            *correction += state.mean[i] - belief.state.mean[i];
        }
        belief.state = state;
        belief.report(&after, &report);
        Ok(())
    }
}

impl RmmNetBelief {
    /// State and extent in the form of the publication.
    fn extended(&self) -> Extended<f64> {
        let squares = self.axes.map(|axis| (2.0 * axis).exp());
        let extent = Symmetric { xx: squares[0], xy: 0.0, yy: squares[1] };
        Extended {
            motion: kinematics(&self.state),
            extent: extent.turned([self.angle.cos(), self.angle.sin()]),
            weight: self.ln_weight.exp(),
        }
    }

    /// Takes over an extent, if it is one.
    fn take_extent(&mut self, found: &Extended<f64>) -> Result<(), FilterError> {
        let Symmetric { xx, xy, yy } = found.extent;
        let extent = InverseWishart::new(nalgebra::Matrix2::new(xx, xy, xy, yy), found.weight)?;
        self.set_extent(&extent);
        Ok(())
    }
}

impl PublishedLayers {
    pub fn predict(&self, belief: &mut RmmNetBelief, dt: f64) {
        let before = belief.extended();
        let (next, scratch) = belief.memory.stage();
        let mut room = Room(scratch);
        let (seen, said) = (room.take(ESTIMATE_SEEN), room.take(PREDICTED));
        self.options.see_estimate(&before, seen);
        self.say_prediction(seen, next, room.0, said);
        let sound = sensible(said) && sensible(next);
        let said = &heard(said, sound)[..PREDICTED];
        if sound {
            belief.memory.commit();
        }
        let prior = before.predict(&self.options, said, dt);
        belief.state = gaussian(&prior.motion);
        // What cannot be saved is reported by the next update. An extent that shrinks without measurements stays an extent.
        let _ = belief.state.settle();
        let _ = belief.take_extent(&prior);
        belief.measured = false;
    }

    pub fn update(
        &self,
        belief: &mut RmmNetBelief,
        points: &Points,
        scattering: &Scattering,
    ) -> Result<(), FilterError> {
        let prior = belief.extended();
        let moments = Moments::new(points, scattering.scale(), &scattering.noise());
        let (memory, scratch) = belief.memory.stage();
        let mut room = Room(scratch);
        let (seen, said) = (room.take(SCAN_SEEN), room.take(SAID[3]));
        self.options.see_scan(&prior, &moments, seen);
        self.say_update(seen, memory, room.0, said);
        let after = prior.update(&self.options, &moments, &heard(said, sensible(said))[..SAID[3]]);
        let mut state = gaussian(&after.motion);
        state.settle()?;
        belief.take_extent(&after)?;
        belief.state = state;
        Ok(())
    }
}
