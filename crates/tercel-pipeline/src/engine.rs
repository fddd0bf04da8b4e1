//! A tracker and a filter whose types are chosen at run time.

use nalgebra::Vector2;
use tercel_core::error::FilterError;
use tercel_core::filter::{Filter, Identified, Named, NamedBelief, Transition};
use tercel_core::motion::{
    ConstantAcceleration, ConstantVelocity, CoordinatedTurn, Motion, RandomWalk, Singer, Turn,
};
use tercel_core::multi::{self, Jpda, MultiBernoulli, NearestNeighbour, Phd, Pmbm, Tracker, Use};
use tercel_core::sensor::{Measurement, Sensor};
use tercel_data::table::{self, Scan};

use crate::PipelineError;
use crate::config::{self, Config, Estimator, MotionConfig, TrackerConfig};
use crate::estimator::{Cloud, Mode, Recursion, Rule, Single, Switching};
use crate::learned::Learned;
use crate::names::Names;
use crate::numbered::Numbered;
use crate::sensors::{self, Kind, Station};
use crate::turns::Look;

/// What a scan led to.
pub(crate) struct Outcome {
    /// The tracks that the scan concerned: all of them, but for reports.
    pub rows: Vec<table::Track>,
    /// Where each detection lies in the plane, if it says so, and what became of it.
    pub uses: Vec<(Option<Vector2<f64>>, Use)>,
}

/// A tracker with its filter.
pub(crate) trait Engine {
    /// Takes in one scan of one sensor. Objects and detections have names.
    fn step(&mut self, station: &Station, look: &Look, names: &mut Names) -> Result<Outcome, PipelineError>;

    /// Names of the modes of a track; empty where there is one motion.
    fn modes(&self) -> Vec<String>;
}

/// The engine that a configuration describes.
pub(crate) fn engine(config: &Config) -> Result<Box<dyn Engine>, PipelineError> {
    let rule = match config.filter.estimator {
        Estimator::Auto => Rule::ByBend,
        Estimator::Unscented => Rule::Unscented,
        // Particles need no rule.
        Estimator::Kalman | Estimator::Extended | Estimator::Particle => Rule::Extended,
    };
    match (&config.motion, config.motion.labels().len()) {
        (MotionConfig::Switching(switching), 4) => {
            with_tracker(modes::<4>(switching, rule, velocity_motion)?, config)
        }
        (MotionConfig::Switching(switching), 5) => {
            with_tracker(modes::<5>(switching, rule, turn_motion)?, config)
        }
        (MotionConfig::Switching(switching), 6) => {
            with_tracker(modes::<6>(switching, rule, acceleration_motion)?, config)
        }
        (MotionConfig::Switching(_), _) => {
            Err(PipelineError::config("motion.switching.modes", "at least one mode must have velocities"))
        }
        (MotionConfig::Learned(motion), _) => match Learned::open(motion)? {
            Learned::Liquid(liquid) => with_tracker(liquid, config),
            Learned::Bank(bank) => with_tracker(bank, config),
        },
        (motion, 2) => with_single::<2>(position_motion(motion)?, rule, config),
        (motion, 4) => with_single::<4>(velocity_motion(motion)?, rule, config),
        (motion, 5) => with_single::<5>(turn_motion(motion)?, rule, config),
        (motion, _) => with_single::<6>(acceleration_motion(motion)?, rule, config),
    }
}

/// Particles of an object when the configuration does not say.
const DEFAULT_PARTICLES: usize = 1_000;

fn with_single<const N: usize>(
    motion: Box<dyn Motion<N>>,
    rule: Rule,
    config: &Config,
) -> Result<Box<dyn Engine>, PipelineError> {
    match config.filter.estimator {
        Estimator::Particle => {
            let count = config.filter.particles.map_or(DEFAULT_PARTICLES, |count| count.get() as usize);
            if count < 10 {
                return Err(PipelineError::config("filter.particles", "must be at least 10"));
            }
            with_tracker::<N, _>(Cloud { motion, count, seed: config.filter.seed }, config)
        }
        Estimator::Auto | Estimator::Kalman | Estimator::Extended | Estimator::Unscented => {
            with_tracker::<N, _>(Single { motion, rule }, config)
        }
    }
}

fn with_tracker<const N: usize, R>(recursion: R, config: &Config) -> Result<Box<dyn Engine>, PipelineError>
where
    R: Recursion<N> + 'static,
{
    let key = |error| PipelineError::parameter("tracker", &error);
    Ok(match &config.tracker {
        TrackerConfig::NearestNeighbour(settings) => {
            let tracker =
                settings.build().and_then(NearestNeighbour::<NamedBelief<R::Belief>>::new).map_err(key)?;
            Box::new(Runner { recursion, tracker })
        }
        TrackerConfig::Phd(settings) => {
            let tracker = settings.build().and_then(Phd::<NamedBelief<R::Belief>>::new).map_err(key)?;
            Box::new(Runner { recursion, tracker })
        }
        TrackerConfig::MultiBernoulli(settings) => {
            let tracker =
                settings.build().and_then(MultiBernoulli::<NamedBelief<R::Belief>>::new).map_err(key)?;
            Box::new(Runner { recursion, tracker })
        }
        TrackerConfig::Jpda(settings) => {
            let tracker = settings.build().and_then(Jpda::<NamedBelief<R::Belief>>::new).map_err(key)?;
            Box::new(Runner { recursion, tracker })
        }
        TrackerConfig::Pmbm(settings) => {
            let tracker = settings.build().and_then(Pmbm::<NamedBelief<R::Belief>>::new).map_err(key)?;
            Box::new(Runner { recursion, tracker })
        }
    })
}

struct Runner<R, T, const N: usize> {
    recursion: R,
    tracker: T,
}

impl<R, T, const N: usize> Runner<R, T, N>
where
    R: Recursion<N>,
    T: Tracker<Belief = NamedBelief<R::Belief>>,
{
    fn run<const M: usize>(
        &mut self,
        sensor: &dyn Sensor<N, M>,
        bent: bool,
        measurements: &[Measurement<M>],
        (station, look, names): (&Station, &Look, &mut Names),
    ) -> Result<Outcome, PipelineError> {
        let tracker = &mut self.tracker;
        let named = |(number, detection): (usize, &table::Detection)| {
            let identity = detection.identity.as_ref().map(|name| names.number(name));
            Named { measurement: number, identity }
        };
        let numbers: Vec<Named<usize>> = look.scan.detections.iter().enumerate().map(named).collect();
        let unusable = |error| PipelineError::parameter("motion", &error);
        self.recursion
            .with(sensor, bent, |filter| {
                let filter = Identified::new(Numbered { filter, measurements }, station.reliability)
                    .map_err(unusable)?;
                follow(tracker, &filter, (station, look, names), &numbers)
            })
            .map_err(unusable)?
    }
}

/// Whether, of ranges and bearings, one is bent: over an error of the bearing the arc of its range leaves the tangent by as much
/// as an error of the range, and a first-order filter takes the one for the other.
fn bent<const N: usize, const M: usize>(sensor: &dyn Sensor<N, M>, seen: &[Measurement<M>]) -> bool {
    seen.iter().any(|measurement| {
        let noise = measurement.noise.unwrap_or_else(|| sensor.noise(&measurement.value));
        measurement.value[0] * noise[(1, 1)] > noise[(0, 0)].sqrt()
    })
}

/// A filter whose measurements are those of one scan, by number and name.
type Followed<'a, B, const N: usize> =
    dyn Filter<N, Belief = NamedBelief<B>, Measurement = Named<usize>> + 'a;

/// Takes in one scan.
fn follow<T, B, const N: usize>(
    tracker: &mut T,
    filter: &Followed<'_, B, N>,
    (station, look, names): (&Station, &Look, &Names),
    numbers: &[Named<usize>],
) -> Result<Outcome, PipelineError>
where
    B: Clone,
    T: Tracker<Belief = NamedBelief<B>>,
{
    let scan = &look.scan;
    let seen = multi::Scan {
        time: scan.time,
        measurements: numbers,
        detection: &station.looking(look.sector),
        clutter: &station.clutter,
    };
    let refused = |source| PipelineError::Tracker { sensor: scan.sensor.to_string(), source };
    tracker.step(filter, &seen).map_err(refused)?;
    let places = numbers.iter().map(|number| filter.place(number));
    let uses = places.zip(tracker.uses().iter().copied()).collect();
    let row = |track: &multi::Track<NamedBelief<B>>| row(filter, track, scan, names);
    let rows = match tracker.active() {
        Some(active) => active.iter().map(|&at| row(&tracker.tracks()[at])).collect::<Result<_, _>>()?,
        None => tracker.tracks().iter().map(row).collect::<Result<_, _>>()?,
    };
    Ok(Outcome { rows, uses })
}

impl<R, T, const N: usize> Engine for Runner<R, T, N>
where
    R: Recursion<N>,
    T: Tracker<Belief = NamedBelief<R::Belief>>,
{
    fn step(&mut self, station: &Station, look: &Look, names: &mut Names) -> Result<Outcome, PipelineError> {
        let scan = &look.scan;
        let with = (station, look, names);
        match &station.kind {
            Kind::Position(sensor) => self.run(sensor, false, &sensors::positions(scan)?, with),
            Kind::Converted(sensor) => self.run(sensor, false, &sensors::ranges(station, scan)?, with),
            Kind::RangeBearing(sensor) => {
                let seen = sensors::ranges(station, scan)?;
                self.run(sensor, bent::<N, 2>(sensor, &seen), &seen, with)
            }
            Kind::RangeBearingRate(sensor) => {
                let seen = sensors::range_rates(station, scan)?;
                self.run(sensor, bent::<N, 3>(sensor, &seen), &seen, with)
            }
            Kind::Bearing(sensor) => self.run(sensor, true, &sensors::bearings(scan)?, with),
        }
    }

    fn modes(&self) -> Vec<String> {
        self.recursion.modes()
    }
}

/// A track as a row of the table.
fn row<B: Clone, const N: usize>(
    filter: &Followed<'_, B, N>,
    track: &multi::Track<NamedBelief<B>>,
    scan: &Scan,
    names: &Names,
) -> Result<table::Track, PipelineError> {
    let estimate = filter.estimate(&track.belief);
    if !estimate.mean.iter().chain(&estimate.covariance).all(|number| number.is_finite()) {
        return Err(PipelineError::Estimate { time: scan.time, track: track.id });
    }
    let upper = (0..N).flat_map(|i| (i..N).map(move |j| (i, j)));
    Ok(table::Track {
        time: scan.time,
        sensor: scan.sensor.clone(),
        track: track.id,
        status: track.status,
        existence: track.existence,
        state: estimate.mean.iter().copied().collect(),
        covariance: upper.map(|index| estimate.covariance[index]).collect(),
        modes: estimate.modes,
        extent: None,
        altitude: None,
        identity: filter.called(&track.belief).and_then(|identity| names.name(identity)).cloned(),
        detection: track.measurement.map(|number| scan.detections[number].id),
    })
}

fn modes<const N: usize>(
    switching: &config::Switching,
    rule: Rule,
    whole: impl Fn(&MotionConfig) -> Result<Box<dyn Motion<N>>, PipelineError>,
) -> Result<Switching<N>, PipelineError> {
    let mode = |motion: &MotionConfig| {
        Ok(match motion.labels().len() {
            length if length == N => Mode::Whole(whole(motion)?),
            2 => Mode::Positions(position_motion(motion)?),
            _ => Mode::Velocities(velocity_motion(motion)?),
        })
    };
    let modes: Vec<Mode<N>> = switching.modes.iter().map(mode).collect::<Result<_, PipelineError>>()?;
    // What a smaller mode lacks is as large as the larger ones expect of a new object.
    let missing = modes.iter().find_map(|mode| match mode {
        Mode::Whole(motion) => Some(motion.prior().deviations()[N - 1]),
        _ => None,
    });
    let transition = Transition::sticky(switching.stay.get()).per(1.0);
    let switching =
        Switching { modes, names: switching.mode_names(), rule, transition, missing: missing.unwrap_or(1.0) };
    // Building the filter once, for any sensor, finds what is wrong with it before the first scan.
    let probe: tercel_core::sensor::Position<2> = tercel_core::sensor::Position::new(1.0)
        .map_err(|error| PipelineError::parameter("motion.switching", &error))?;
    switching.filter(&probe, false).map_err(|error| PipelineError::parameter("motion.switching", &error))?;
    Ok(switching)
}

fn position_motion(config: &MotionConfig) -> Result<Box<dyn Motion<2>>, PipelineError> {
    match config {
        MotionConfig::RandomWalk { density } => Ok(Box::new(RandomWalk::new(density.get()))),
        other => Err(wrong_state(other)),
    }
}

fn velocity_motion(config: &MotionConfig) -> Result<Box<dyn Motion<4>>, PipelineError> {
    Ok(match config {
        MotionConfig::ConstantVelocity(model) => {
            Box::new(ConstantVelocity::new(model.acceleration_density.get()).with_speed(model.speed.get()))
        }
        MotionConfig::Turn(turn) => {
            Box::new(Turn::new(turn.rate, turn.acceleration_density.get()).with_speed(turn.speed.get()))
        }
        other => return Err(wrong_state(other)),
    })
}

fn turn_motion(config: &MotionConfig) -> Result<Box<dyn Motion<5>>, PipelineError> {
    match config {
        MotionConfig::CoordinatedTurn { acceleration_density, rate_density, speed, rate } => Ok(Box::new(
            CoordinatedTurn::new(acceleration_density.get(), rate_density.get())
                .with_speed(speed.get())
                .with_rate(rate.get()),
        )),
        other => Err(wrong_state(other)),
    }
}

fn acceleration_motion(config: &MotionConfig) -> Result<Box<dyn Motion<6>>, PipelineError> {
    Ok(match config {
        MotionConfig::ConstantAcceleration { jerk_density, speed, acceleration } => Box::new(
            ConstantAcceleration::new(jerk_density.get())
                .with_speed(speed.get())
                .with_acceleration(acceleration.get()),
        ),
        MotionConfig::Singer(model) => Box::new(
            Singer::new(model.time.get(), model.acceleration.get())
                .map_err(|error: FilterError| PipelineError::parameter("motion.singer", &error))?
                .with_speed(model.speed.get()),
        ),
        other => return Err(wrong_state(other)),
    })
}

fn wrong_state(config: &MotionConfig) -> PipelineError {
    PipelineError::config("motion", &format!("`{}` does not fit the state of the other modes", config.name()))
}
