//! Many objects that manoeuvre, seen by a sensor that misses some and sees others that are not there.

mod manoeuvre;
mod published;
mod random;
mod scene;

pub use manoeuvre::Manoeuvre;
pub use random::RandomScenes;
pub use scene::{Object, Plot, Scene, Sensor};

/// Names of the scenarios.
pub const NAMES: [&str; 3] = ["clutter-partial", "clutter-all", "clutter-random"];

/// Scenes of many objects in clutter.
///
/// ## Definition
/// Objects have states `x, y, vx, vy` (m, m/s) and move without noise: straight on, with a steady acceleration, or on a circle
/// ([`Manoeuvre`]). Once a second the sensor measures the position of each with normal errors, if it detects it, and adds
/// measurements of nothing: a Poisson number of them, uniform over the region.
///
/// - `clutter-partial`: nine objects in 3 by 2.5 km, of which seven keep one manoeuvre and two change theirs four times; 40
///   false measurements a scan.
/// - `clutter-all`: six objects in 2 by 2.5 km that all change between straight flight, a common acceleration and turns at
///   10 °/s at the same times, with jumps at 40 and 60 s; 20 false measurements a scan.
/// - `clutter-random`: 5 to 12 objects that appear and disappear, each with manoeuvres of its own; clutter and detection
///   probability are drawn for every scene. See [`RandomScenes`].
///
/// The first two have the same truth in every run, and differ in what is measured.
///
/// ## Use it when
/// trackers of many objects are compared. The first two scenes are published ones; whoever tunes or trains on them knows them
/// by heart, which is what the third is for.
///
/// ## Reference
/// Scenarios 1 and 2 of the LNN-RFS paper. It leaves open the states of the first (chosen here so that all stay inside and start
/// below 20 m/s), the origin of the regions (centred on x; in the second, y from -1000 m, so that no object leaves), and the
/// accuracy of the sensor (5 m per axis).
///
/// ```
/// use tercel_sim::clutter::Scenario;
///
/// let scene = Scenario::All.scene(7, 17); // seed and run
/// let scans = scene.observe(7, 17);
/// assert_eq!((scene.objects().len(), scans.len()), (6, 100));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub enum Scenario {
    /// `clutter-partial`.
    Partial,
    /// `clutter-all`.
    All,
    /// `clutter-random`.
    Random(RandomScenes),
}

impl Scenario {
    /// The scenario of that name, one of [`NAMES`].
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "clutter-partial" => Some(Scenario::Partial),
            "clutter-all" => Some(Scenario::All),
            "clutter-random" => Some(Scenario::Random(RandomScenes::default())),
            _ => None,
        }
    }

    /// The scene of this seed and run.
    pub fn scene(&self, seed: u64, run: u64) -> Scene {
        match self {
            Scenario::Partial => published::partial(),
            Scenario::All => published::all(),
            Scenario::Random(scenes) => scenes.scene(seed, run),
        }
    }

    /// Number of scans of a scene, one second apart.
    pub fn steps(&self) -> usize {
        match self {
            Scenario::Partial | Scenario::All => published::STEPS,
            Scenario::Random(scenes) => scenes.steps(),
        }
    }
}

#[cfg(test)]
mod tests;
