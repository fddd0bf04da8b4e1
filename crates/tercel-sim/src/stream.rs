//! Streams of random numbers that depend on names, not on the order of calls.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What random numbers are drawn for. Each purpose has a stream of its own for every seed and run.
///
/// ```
/// use rand::RngExt;
/// use tercel_sim::Stream;
///
/// let (mut truth, mut noise) = (Stream::Truth.of(7, 17), Stream::Noise { realisation: 0 }.of(7, 17));
/// assert_ne!(truth.random::<u64>(), noise.random::<u64>());
/// assert_eq!(Stream::Truth.of(7, 17), Stream::Truth.of(7, 17));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stream {
    /// What happens.
    Truth,
    /// How measurements err. Another `realisation` measures the same truth anew.
    Noise {
        /// Number of the measurement campaign; 0 is the usual one.
        realisation: u64,
    },
    /// Which objects are detected. Apart from the noise, so that a lower detection probability takes detections away and
    /// leaves the others as they were.
    Detection {
        /// Number of the measurement campaign; 0 is the usual one.
        realisation: u64,
    },
    /// Measurements of nothing: how many there are in each scan, and where.
    Clutter {
        /// Number of the measurement campaign; 0 is the usual one.
        realisation: u64,
    },
}

impl Stream {
    /// The generator of this purpose for a seed and the number of a run.
    pub fn of(self, seed: u64, run: u64) -> ChaCha8Rng {
        let (purpose, realisation): (u64, u64) = match self {
            Stream::Truth => (1, 0),
            Stream::Noise { realisation } => (2, realisation),
            Stream::Detection { realisation } => (3, realisation),
            Stream::Clutter { realisation } => (4, realisation),
        };
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..16].copy_from_slice(&purpose.to_le_bytes());
        key[16..24].copy_from_slice(&realisation.to_le_bytes());
        let mut random = ChaCha8Rng::from_seed(key);
        random.set_stream(run);
        random
    }
}
