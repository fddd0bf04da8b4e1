//! The two published scenes.

use nalgebra::Vector4;

use super::Manoeuvre::{self, Straight};
use super::{Object, Scene, Sensor};
use crate::Interval;

/// Scans of a published scene.
pub(super) const STEPS: usize = 100;

/// A stretch of a motion: up to which step, and what.
type Legs<'a> = &'a [(usize, Manoeuvre)];

const ALWAYS: usize = usize::MAX;

fn sensor(clutter: f64) -> Sensor {
    Sensor { deviation: 5.0, detection: 0.95, clutter }
}

fn scene(objects: &[([f64; 4], Legs<'_>)], region: [Interval; 2], clutter: f64) -> Scene {
    let object = |(start, legs): &([f64; 4], Legs<'_>)| {
        let doing = |step: usize| legs.iter().find(|leg| step < leg.0).map_or(Straight, |leg| leg.1);
        Object::moving(Vector4::from(*start), (0..STEPS - 1).map(doing), 0)
    };
    Scene::new(objects.iter().map(object).collect(), region, sensor(clutter), STEPS)
}

/// Nine objects, two of which change their motion.
pub(super) fn partial() -> Scene {
    let accelerate = Manoeuvre::accelerate;
    let turn = Manoeuvre::turn;
    let eighth =
        [(20, Straight), (40, turn(6.0)), (55, accelerate(0.5, -0.3)), (80, turn(-8.0)), (ALWAYS, Straight)];
    let ninth =
        [(25, Straight), (40, accelerate(-0.4, 0.5)), (55, turn(10.0)), (75, turn(-6.0)), (ALWAYS, Straight)];
    let objects: [([f64; 4], Legs<'_>); 9] = [
        ([-1200.0, -900.0, 14.0, 9.0], &[]),
        ([1200.0, -1000.0, -13.0, 11.0], &[]),
        ([-1300.0, 900.0, 15.0, -8.0], &[]),
        ([1300.0, 1000.0, -16.0, -9.0], &[]),
        ([-900.0, 200.0, 8.0, -6.0], &[(ALWAYS, accelerate(0.10, 0.15))]),
        ([700.0, -200.0, -12.0, 6.0], &[(ALWAYS, accelerate(-0.10, 0.12))]),
        ([-200.0, -900.0, 14.0, 8.0], &[(ALWAYS, turn(3.0))]),
        ([-600.0, -400.0, 15.0, 10.0], &eighth),
        ([500.0, 700.0, -14.0, -8.0], &ninth),
    ];
    scene(&objects, [Interval::fixed(-1500.0, 1500.0), Interval::fixed(-1250.0, 1250.0)], 40.0)
}

/// Six objects that change their motion at the same times.
pub(super) fn all() -> Scene {
    let (push, turn) = (Manoeuvre::accelerate(1.0, 1.0), Manoeuvre::turn(10.0));
    let legs = [(20, Straight), (40, push), (50, turn), (60, push), (80, turn), (ALWAYS, Straight)];
    let objects: [([f64; 4], Legs<'_>); 6] = [
        ([-500.0, 500.0, 15.0, -5.0], &legs),
        ([300.0, 400.0, -10.0, -10.0], &legs),
        ([400.0, -600.0, -10.0, 15.0], &legs),
        ([0.0, 0.0, 10.0, 10.0], &legs),
        ([-200.0, -500.0, -5.0, 10.0], &legs),
        ([600.0, 200.0, -10.0, 5.0], &legs),
    ];
    scene(&objects, [Interval::fixed(-1000.0, 1000.0), Interval::fixed(-1000.0, 1500.0)], 20.0)
}
