//! What a user should be told while tracking goes on.

use std::fmt;
use std::sync::Arc;

use tercel_data::table::Scan;

/// Something about the input that was not as the configuration has it. [`Display`](fmt::Display) says it in a sentence, with
/// what helps.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// A scan came too late and is left out.
    Late {
        /// Its time, s.
        time: f64,
        /// Its sensor.
        sensor: Arc<str>,
        /// Time of the last scan that was tracked, s.
        last: f64,
        /// For how long scans are held back, s.
        delay: f64,
    },
    /// A single scan is far ahead of those before and after it, and is left out.
    Ahead {
        /// Its time, s.
        time: f64,
        /// Its sensor.
        sensor: Arc<str>,
        /// Time of the last scan before it, s.
        last: f64,
    },
    /// The clock was set back: tracking starts anew, with new tracks.
    SetBack {
        /// Where the clock stands now, s.
        time: f64,
        /// Where it stood, s.
        last: f64,
    },
    /// The antenna of a sensor turns, and its plots are taken turn by turn.
    Turning {
        /// The sensor.
        sensor: Arc<str>,
        /// Seconds a turn.
        period: f64,
    },
    /// Each detection of a sensor has a time of its own and none shows a turn of an antenna: they are taken as reports.
    Reporting {
        /// The sensor.
        sensor: Arc<str>,
    },
}

impl Notice {
    pub(crate) fn late(scan: &Scan, last: f64, delay: f64) -> Self {
        Notice::Late { time: scan.time, sensor: Arc::clone(&scan.sensor), last, delay }
    }

    pub(crate) fn ahead(scan: &Scan, last: f64) -> Self {
        Notice::Ahead { time: scan.time, sensor: Arc::clone(&scan.sensor), last }
    }

    pub(crate) fn set_back(scan: &Scan, last: f64) -> Self {
        Notice::SetBack { time: scan.time, last }
    }

    /// True for what is left out; other notices say how the input was understood.
    pub fn is_warning(&self) -> bool {
        match self {
            Notice::Late { .. } | Notice::Ahead { .. } | Notice::SetBack { .. } => true,
            Notice::Turning { .. } | Notice::Reporting { .. } => false,
        }
    }
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Notice::Late { time, sensor, last, delay } => {
                let behind = last - time;
                write!(f, "the scan of `{sensor}` at {time} s is {behind} s too late and left out")?;
                if behind > 60.0_f64.max(10.0 * delay) {
                    write!(
                        f,
                        "; if the clock was set back, clock_set_back = \"restart\" in [input] starts anew"
                    )
                } else if *delay > 0.0 {
                    write!(f, "; a delay above {behind} s in [input] sorts it in (it is {delay} s)")
                } else {
                    write!(
                        f,
                        "; out_of_order = \"buffer\" and delay = {} in [input] sort such scans in",
                        behind.ceil()
                    )
                }
            }
            Notice::Ahead { time, sensor, last } => write!(
                f,
                "the scan of `{sensor}` at {time} s is {} s ahead of the one before and no other one confirms it: it is \
                 set aside (max_jump in [input])",
                time - last
            ),
            Notice::SetBack { time, last } => {
                write!(f, "the clock was set back from {last} s to {time} s: tracking starts anew")
            }
            Notice::Turning { sensor, period } => write!(
                f,
                "the plots of `{sensor}` have their own times, and its antenna turns once in {period:.3} s: they are \
                 tracked sector by sector (scans = {{ period = {period:.3} }} in [sensors.{sensor}])"
            ),
            Notice::Reporting { sensor } => write!(
                f,
                "the detections of `{sensor}` have their own times: each is taken as a report of one object, which says \
                 nothing of others (kind = \"reports\" in [sensors.{sensor}]; scans = {{ period = SECONDS }} for a radar \
                 that turns)"
            ),
        }
    }
}
