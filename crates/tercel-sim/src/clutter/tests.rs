use super::*;

fn extent(scene: &Scene, axis: usize) -> (f64, f64) {
    let states = scene.objects().iter().flat_map(Object::states);
    states.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), state| {
        (low.min(state[axis]), high.max(state[axis]))
    })
}

#[test]
fn the_published_motions_reach_where_they_should() {
    let scene = Scenario::All.scene(1, 0);
    let ((left, right), (bottom, top)) = (extent(&scene, 0), extent(&scene, 1));
    assert!((left + 870.0).abs() < 5.0 && (right - 670.0).abs() < 5.0, "{left} {right}");
    assert!((bottom + 600.0).abs() < 5.0 && (top - 1373.0).abs() < 5.0, "{bottom} {top}");
    let speeds = scene.objects().iter().flat_map(Object::states).map(|state| state[2].hypot(state[3]));
    assert!((speeds.fold(0.0, f64::max) - 43.0).abs() < 1.0);
    assert_eq!(scene, Scenario::All.scene(99, 5));
}

#[test]
fn no_object_leaves_the_region() {
    for (name, runs) in [("clutter-partial", 1), ("clutter-all", 1), ("clutter-random", 100)] {
        let scenario = Scenario::named(name).unwrap();
        for run in 0..runs {
            let scene = scenario.scene(3, run);
            for axis in 0..2 {
                let (low, high) = extent(&scene, axis);
                let side = scene.region()[axis];
                assert!(side.low() <= low && high <= side.high(), "{name} {run}: {low} {high}");
            }
        }
    }
}

#[test]
fn what_is_seen_has_the_stated_statistics() {
    let scene = Scenario::Partial.scene(1, 0);
    let (mut clutter, mut seen, mut square) = (0.0_f64, 0.0_f64, 0.0_f64);
    for run in 0..20 {
        for (step, plots) in scene.observe(5, run).iter().enumerate() {
            for plot in plots {
                match plot.object {
                    None => clutter += 1.0 / 2000.0,
                    Some(number) => {
                        let state = scene.objects()[number].at(step).unwrap();
                        seen += 1.0 / 18_000.0;
                        square += (plot.position - nalgebra::Vector2::new(state[0], state[1])).norm_squared();
                    }
                }
            }
        }
    }
    assert!((clutter - 40.0).abs() < 0.6, "{clutter}");
    assert!((seen - 0.95).abs() < 0.006, "{seen}");
    assert!((square / (seen * 36_000.0) - 25.0).abs() < 0.8, "{square}");
}

#[test]
fn random_scenes_come_and_go_and_differ() {
    let scenario = Scenario::named("clutter-random").unwrap();
    let scenes: Vec<Scene> = (0..50).map(|run| scenario.scene(7, run)).collect();
    assert!(scenes.iter().all(|scene| (5..=12).contains(&scene.objects().len())));
    let objects = || scenes.iter().flat_map(Scene::objects);
    assert!(objects().all(|object| object.states().len() >= 30));
    assert!(objects().any(|object| object.first() > 0));
    assert!(objects().any(|object| object.first() + object.states().len() < 100));
    assert_ne!(scenes[0], scenes[1]);
    assert_eq!(scenes[3], scenario.scene(7, 3));
    assert!(Scenario::named("clutter-none").is_none());
}
