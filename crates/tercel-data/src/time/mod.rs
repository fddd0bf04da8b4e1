//! Times as files have them: numbers in some unit, dates in some form and zone, times of day.

mod clock;
mod moment;
mod unit;
mod zone;

pub(crate) use clock::Clock;
pub(crate) use moment::Moment;
