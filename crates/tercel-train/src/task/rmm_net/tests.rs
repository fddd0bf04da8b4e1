use nalgebra::Vector4;
use tercel_core::belief::Gaussian;
use tercel_core::extended::Points;
use tercel_core::filter::Filter;
use tercel_neural::filter::rmm_net::{Kinematics, Symmetric, Track, View};
use tercel_neural::filter::{RmmNet, RmmNetBelief, RmmNetwork};

use super::operations::{Given, Pool, Step};
use super::rows::{TRACK, numbers};
use super::*;
use crate::Initial;
use crate::backend::{constant, values};
use crate::task::repository;

const RECIPE: &str = "
version = 1
kind = \"rmmnet\"
name = \"small\"
seed = 3
[data]
training = 8
validation = 4
steps = 1001
interval = 1.0
points = 12.0
noise = [1.0, 0.64]
empty = 0.1
born = 0.5
[data.source]
kind = \"vehicles\"
generators = [\"smooth\", \"reject\"]
mixed = 0.5
[model]
interval = 1.0
memory = 7
[model.form]
kind = \"aligned\"
hidden = 6
encoder = 5
identification = { order = 4 }
[loss]
window = 4
";

/// The task of a recipe, with parameters that have a say.
fn task(text: &str) -> (RmmNetTask, ParameterSet) {
    let recipe = Recipe::<RmmNetKind>::parse(text).unwrap();
    let (task, mut set) = RmmNetTask::new(&recipe, None).unwrap();
    for (name, values) in set.values_mut() {
        if name.contains("output") {
            values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.1 * (i as f32 * 1.3).sin());
        }
    }
    (task, set)
}

fn draw(samples: &[u64]) -> Draw<'_> {
    Draw { split: Split::Training, epoch: 0, seed: 3, samples }
}

#[test]
fn the_filter_does_what_was_trained() {
    let (task, set) = task(RECIPE);
    agree(&task, &set, 1000);
}

/// The same recipe in the form of the publication.
fn published(options: &str) -> String {
    let start = RECIPE.find("[model.form]").unwrap();
    let end = RECIPE.find("[loss]").unwrap();
    let form = format!("[model.form]\nkind = \"published\"\n{options}\n");
    format!("{}{form}[loss]\nsquares = 1.0\nwindow = 4\n", &RECIPE[..start]).replace("1001", "401")
        + &RECIPE[end..end]
}

#[test]
fn the_filter_of_the_publication_does_what_was_trained_whatever_blocks_it_has() {
    for options in [
        "",
        "blocks = { memory = false }",
        "blocks = { prediction = false }\ntransition = \"keeping\"",
        "blocks = { update = false }",
        "transition = \"turning\"\ndistorted = true\nprinted = false",
    ] {
        let (task, set) = task(&published(options));
        agree(&task, &set, 400);
    }
}

#[test]
fn the_shipped_models_do_what_was_trained() {
    for (model, text) in repository::models(RmmNetKind::NAME) {
        let mut recipe = Recipe::<RmmNetKind>::parse(&text).unwrap();
        // A crossing is over after 40 steps.
        if !matches!(recipe.data.source, Source::Crossings) {
            recipe.data.steps = 1001;
        }
        let (task, mut set) = RmmNetTask::new(&recipe, Some(repository::turning_flights(1001))).unwrap();
        repository::fill(&mut set, &model);
        agree(&task, &set, recipe.data.steps - 1);
    }
}

/// Compares the differentiable model and the filter over some steps of three objects.
fn agree(task: &RmmNetTask, set: &ParameterSet, steps: usize) {
    let rides = task.batch(draw(&[1, 2, 3])).unwrap();
    let model = Model::new(task.card(), set.tensors()).unwrap();
    let scattering = task.data.scattering().unwrap();
    let filter = RmmNet::new(Arc::new(RmmNetwork::from_model(&model).unwrap()), scattering);
    let begin = |member: usize| -> RmmNetBelief {
        let mut belief = filter.birth(&rides.scans[0][member]).unwrap();
        filter.set_state(&mut belief, &gaussian(&rides.births[member].0));
        belief
    };
    let mut beliefs: Vec<_> = (0..3).map(begin).collect();
    let weights = Weights::frozen(set);
    let mut state = task.first(&rides);
    for step in 1..=steps {
        let row;
        (state, row) = task.step(&weights, &rides, state, step);
        let found = values(&row);
        for (member, belief) in beliefs.iter_mut().enumerate() {
            filter.predict(belief, task.data.interval);
            filter.update(belief, &rides.scans[step][member]).unwrap();
            let width = task.layout().width();
            let row: Vec<f64> = found[member * width..][..width].iter().map(|x| f64::from(*x)).collect();
            let said = task.layout().read(&row);
            let (mut ran, trained) = (filter.state(belief), gaussian(&said.motion));
            // Relative to the origin, which is near.
            (0..2).for_each(|i| ran.mean[i] -= state.origins[member][i]);
            for i in 0..4 {
                let error = (trained.mean[i] - ran.mean[i]).abs();
                // Relative to the length of the vector: its direction is anybody's.
                let pair = i / 2 * 2;
                let scale = ran.mean[pair].hypot(ran.mean[pair + 1]).max(10.0) + ran.deviations()[i];
                assert!(error < 1e-4 * scale, "step {step}, member {member}, {i}: {error}");
            }
            let off = (trained.covariance - ran.covariance).norm() / ran.covariance.norm();
            assert!(off < 1e-3, "step {step}, member {member}: {off}");
            let extent = filter.extent(belief).unwrap();
            let trained =
                nalgebra::Matrix2::new(said.extent.xx, said.extent.xy, said.extent.xy, said.extent.yy);
            let off = (trained - extent.mean()).norm() / extent.mean().norm();
            assert!(off < 1e-3, "step {step}, member {member}: {off}");
            let off = (said.ln_weight.exp() / extent.weight() - 1.0).abs();
            assert!(off < 1e-3, "step {step}, member {member}: weight {off}");
        }
    }
}

fn gaussian(motion: &Kinematics<f64>) -> Gaussian<4> {
    let Kinematics { place, velocity, place_covariance: pp, cross: c, velocity_covariance: vv } = motion;
    Gaussian {
        mean: Vector4::new(place[0], place[1], velocity[0], velocity[1]),
        covariance: nalgebra::Matrix4::new(
            pp.xx, pp.xy, c[0][0], c[0][1], //
            pp.xy, pp.yy, c[1][0], c[1][1], //
            c[0][0], c[1][0], vv.xx, vv.xy, //
            c[0][1], c[1][1], vv.xy, vv.yy,
        ),
    }
}

#[test]
fn the_gradients_of_a_step_and_its_cost_are_their_slopes() {
    let (mut task, _) = task(RECIPE);
    // In the score of the extent its mean counts as given.
    task.costs.score = 0.0;
    let rides = task.batch(draw(&[1, 2, 5])).unwrap();
    let Net::Aligned(net) = &task.net else { panic!("another form") };
    let (options, sizes) = (&net.options, net.options.sizes());
    let step = (1..200).find(|step| rides.scans[*step].iter().any(Points::is_empty)).unwrap();
    let mut tracks = Vec::new();
    let mut given = Vec::new();
    for member in 0..3 {
        let truth = rides.truth[step][member].state;
        let root =
            nalgebra::Matrix4::from_fn(
                |i, j| {
                    if i == j { 1.5 } else { 0.5 * ((i * 4 + j + member) as f64).sin() }
                },
            );
        let p = root * root.transpose();
        let block = |i: usize| Symmetric { xx: p[(i, i)], xy: p[(i, i + 1)], yy: p[(i + 1, i + 1)] };
        let motion = Kinematics {
            place: [truth[0] - truth[2] + 0.4, truth[1] - truth[3] - 0.3],
            velocity: [truth[2] + 0.2, truth[3] + 0.3],
            place_covariance: block(0),
            cross: [[p[(0, 2)], p[(0, 3)]], [p[(1, 2)], p[(1, 3)]]],
            velocity_covariance: block(2),
        };
        let track = Track { motion, axes: [1.6, 0.3], worth: 9.0 };
        let points = &rides.scans[step][member];
        let scattering = (0.25, &net.scattering.noise());
        let view = (!points.is_empty()).then(|| View::new(options, &track, 0.3, points, scattering));
        tracks.extend(numbers(&track).map(|x| x as f32));
        let velocities = (0..5).map(|i| [f64::from(i).sin(), 2.0 * f64::from(i).cos()]).collect();
        let (heading, expected, shift) = ([0.6, 0.8], [1.5, -0.5], [0.0; 2]);
        given.push(Given { heading, velocities, expected, held: 0.3, view, shift });
    }
    let operation = Step { options: Arc::clone(options), length: net.length, given: Arc::new(given) };
    let judge =
        Judge { costs: task.costs, layout: task.layout(), truth: Arc::new(rides.truth[step].clone()) };
    let mut set = ParameterSet::new(1);
    set.add("tracks", &[3, TRACK], Initial::Values(tracks)).unwrap();
    for (name, width) in
        [("motion", sizes.motion_said), ("scan", sizes.scan_said), ("extent", sizes.extent_said)]
    {
        let values = (0..3 * width).map(|i| 0.5 * (i as f32 * 1.3).sin()).collect();
        set.add(name, &[3, width], Initial::Values(values)).unwrap();
    }
    let value = |weights: &Weights| {
        let inputs = [0, 1, 2, 3].map(|place| weights.tensors()[place].clone());
        let row = apply(operation.clone(), inputs);
        apply(judge.clone(), [row]).sum().reshape([1, 1])
    };
    let trainable = Weights::trainable(&set);
    let found = trainable.gradients(&value(&trainable));
    for (place, gradients) in found.iter().enumerate() {
        for (index, gradient) in gradients.iter().enumerate() {
            // What weights expect and the last velocity count as given.
            if place == 0 && (2..4).contains(&(index % TRACK)) {
                continue;
            }
            let moved = |by: f32| {
                let mut set = set.clone();
                set.values_mut().nth(place).unwrap().1[index] += by;
                f64::from(values(&value(&Weights::frozen(&set)))[0])
            };
            let slope = (moved(5e-3) - moved(-5e-3)) / 1e-2;
            let error = (slope - f64::from(*gradient)).abs();
            assert!(error < 5e-3 + 0.02 * slope.abs(), "{place} {index}: {gradient} for {slope}");
        }
    }
    assert!(found.iter().all(|of| of.iter().any(|gradient| gradient.abs() > 1e-2)));
}

#[test]
fn the_gradients_of_the_whole_loss_are_its_slopes_where_nothing_counts_as_given() {
    let (mut task, set) = task(RECIPE);
    task.costs.score = 0.0;
    let rides = task.batch(draw(&[1, 2, 3])).unwrap();
    let loss = |weights: &Weights| {
        let (state, row) = task.step(weights, &rides, task.first(&rides), 1);
        let own = rides.truth[1].iter().zip(&state.origins).map(|(truth, origin)| truth.from(*origin));
        let truth = Arc::new(own.collect());
        let judge = Judge { costs: task.costs, layout: task.layout(), truth };
        apply(judge, [row]).mean().reshape([1, 1])
    };
    let weights = Weights::trainable(&set);
    let found = weights.gradients(&loss(&weights));
    // What the last head says is seen by nothing else.
    for (place, entry) in set.iter().enumerate().filter(|(_, entry)| entry.name().starts_with("extent")) {
        for index in (0..found[place].len()).step_by(1 + found[place].len() / 20) {
            let moved = |by: f32| {
                let mut set = set.clone();
                set.values_mut().nth(place).unwrap().1[index] += by;
                f64::from(values(&loss(&Weights::frozen(&set)))[0])
            };
            let slope = (moved(1e-2) - moved(-1e-2)) / 2e-2;
            let error = (slope - f64::from(found[place][index])).abs();
            assert!(error < 2e-3 + 0.03 * slope.abs(), "{} {index}: {slope}", entry.name());
        }
    }
}

#[test]
fn a_recipe_that_makes_no_sense_is_refused_by_key() {
    let check = |text: &str| RmmNetTask::new(&Recipe::<RmmNetKind>::parse(text)?, None).map(drop);
    let changes = [
        ("steps = 1001", "steps = 1", "data.steps"),
        ("points = 12.0", "points = 0.0", "data.points"),
        ("noise = [1.0, 0.64]", "noise = [1.0, -0.64]", "data.noise[1]"),
        ("empty = 0.1", "empty = 1.0", "data.empty"),
        ("[\"smooth\", \"reject\"]", "[]", "generators"),
        ("\"smooth\"", "\"rough\"", "rough"),
        ("memory = 7", "memory = 0", "memory"),
        ("order = 4", "order = 100", "order"),
        ("hidden = 6", "hidden = 6\nchange = -1.0", "change"),
        ("window = 4", "window = 4\nshape = -1.0", "loss.shape"),
        ("interval = 1.0\nmemory", "interval = 2.0\nmemory", "model.interval"),
    ];
    repository::refuses(RECIPE, &changes, check);
}

#[test]
fn a_recipe_that_needs_tracks_says_how_they_are_named() {
    let tracks = "kind = \"tracks\"\naxes = [36.95, 32.4]\nfolds = 5\nfold = 0\n";
    let start = RECIPE.find("kind = \"vehicles\"").unwrap();
    let end = RECIPE.find("[model]").unwrap();
    let text = format!("{}{tracks}{}", &RECIPE[..start], &RECIPE[end..]);
    let error = RmmNetTask::new(&Recipe::<RmmNetKind>::parse(&text).unwrap(), None).unwrap_err();
    assert!(error.to_string().contains("--data"), "{error}");
}

#[test]
fn an_imitation_begins_as_the_track_and_depends_on_its_past_as_that_does() {
    // A velocity that alternates around a mean.
    let mut random = Draw { split: Split::Training, epoch: 0, seed: 1, samples: &[] }.random(0);
    let mut place = nalgebra::Vector2::new(5.0, -3.0);
    let mut around = nalgebra::Vector2::new(20.0, 0.0);
    let mut track = Vec::new();
    for step in 0..4000_u32 {
        let velocity = nalgebra::Vector2::new(50.0, 10.0) + around;
        if step > 0 {
            place += velocity * 4.0;
        }
        track.push(Vector4::new(place.x, place.y, velocity.x, velocity.y));
        let mut push = || rand::RngExt::random_range(&mut random, -4.0..4.0);
        around = around * -0.9 + nalgebra::Vector2::new(push(), push());
    }
    let found = imitation::imitation(&track, 1, 4.0, &mut random).unwrap();
    assert_eq!((found.len(), found[0]), (track.len(), track[0]));
    let off = |step: usize| nalgebra::Vector2::new(found[step][2] - 50.0, found[step][3] - 10.0);
    let (mut product, mut square) = (0.0, 0.0);
    for step in 1..found.len() {
        let moved = (found[step].xy() - found[step - 1].xy()) / 4.0;
        assert!((moved - nalgebra::Vector2::new(found[step][2], found[step][3])).norm() < 1e-6);
        product += off(step).dot(&off(step - 1));
        square += off(step - 1).norm_squared();
    }
    assert!((product / square + 0.9).abs() < 0.05, "{}", product / square);
    // One that grows is tamed, and one that is too short is refused.
    let growing: Vec<_> = (0..200).map(|k| Vector4::new(0.0, 0.0, 1.1_f64.powi(k), 0.0)).collect();
    let tamed = imitation::imitation(&growing, 3, 4.0, &mut random).unwrap();
    assert!(tamed.iter().all(|state| state.iter().all(|x| x.is_finite())));
    assert!(imitation::imitation(&track[..20], 10, 4.0, &mut random).is_err());
}

#[test]
fn points_are_pooled_by_mean_and_maximum_whatever_their_order_and_however_many() {
    let rows = [3.0, -1.0, 1.0, 2.0, -2.0, 0.5];
    let pool = Pool { counts: Arc::new(vec![2, 0, 1]) };
    let pooled = values(&apply(pool.clone(), [constant(rows.to_vec(), [3, 2])]));
    assert_eq!(pooled, [2.0, 0.5, 3.0, 2.0, 0.0, 0.0, 0.0, 0.0, -2.0, 0.5, -2.0, 0.5]);
    let mut set = ParameterSet::new(1);
    set.add("rows", &[3, 2], Initial::Values(rows.to_vec())).unwrap();
    let factors = constant((0..12).map(|i| (i as f32).cos()).collect(), [3, 4]);
    let value = |weights: &Weights| {
        (apply(pool.clone(), [weights.tensors()[0].clone()]) * factors.clone()).sum().reshape([1, 1])
    };
    let trainable = Weights::trainable(&set);
    let found = trainable.gradients(&value(&trainable));
    for (index, gradient) in found[0].iter().enumerate() {
        let moved = |by: f32| {
            let mut set = set.clone();
            set.values_mut().next().unwrap().1[index] += by;
            f64::from(values(&value(&Weights::frozen(&set)))[0])
        };
        let slope = (moved(1e-2) - moved(-1e-2)) / 2e-2;
        assert!((slope - f64::from(*gradient)).abs() < 1e-3, "{index}: {gradient} for {slope}");
    }
}

#[test]
fn the_score_of_an_extent_sets_its_weight_alone() {
    let (mut task, _) = task(RECIPE);
    let rides = task.batch(draw(&[1])).unwrap();
    (task.costs.surprise, task.costs.error, task.costs.shape, task.costs.foresight) = (0.0, 0.0, 0.0, 0.0);
    task.costs.score = 1.0;
    let motion = rides.births[0].0;
    let mut row: Vec<f32> = motion.numbers().map(|x| x as f32).to_vec();
    row.extend([1.7, 0.3, 9.0, 0.4, 3.0, 0.4, 2.0, 1.7, 0.3]);
    let width = row.len();
    let mut set = ParameterSet::new(1);
    set.add("row", &[1, width], Initial::Values(row)).unwrap();
    let truth = Arc::new(vec![rides.truth[0][0]]);
    let judge = Judge { costs: task.costs, layout: task.layout(), truth };
    let value = |weights: &Weights| apply(judge.clone(), [weights.tensors()[0].clone()]);
    let trainable = Weights::trainable(&set);
    let found = trainable.gradients(&value(&trainable));
    for (index, gradient) in found[0].iter().enumerate() {
        let moved = |by: f32| {
            let mut set = set.clone();
            set.values_mut().next().unwrap().1[index] += by;
            f64::from(values(&value(&Weights::frozen(&set)))[0])
        };
        let slope = if index == TRACK + 1 { (moved(1e-2) - moved(-1e-2)) / 2e-2 } else { 0.0 };
        assert!((slope - f64::from(*gradient)).abs() < 5e-3 * (1.0 + slope.abs()), "{index}: {gradient}");
    }
    assert!(found[0][TRACK + 1].abs() > 0.1);
}
