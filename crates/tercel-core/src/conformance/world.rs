//! Objects that move as the problem says, and what a filter believes of them.

use nalgebra::{SMatrix, Vector2, Vector4};
use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{Problem, SPEED, Subject};
use crate::belief::{Gaussian, positive};
use crate::filter::Filter;
use crate::motion::Motion;

/// A random object of a problem, and the chance that moves it and disturbs its measurements.
pub(super) struct World {
    problem: Problem,
    random: ChaCha8Rng,
    pub truth: Vector4<f64>,
}

impl World {
    pub fn new(problem: Problem, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = |deviation: f64| -> f64 {
            let value: f64 = StandardNormal.sample(&mut random);
            deviation * value
        };
        let truth =
            Vector4::new(4000.0 + normal(300.0), 3000.0 + normal(300.0), normal(SPEED), normal(SPEED));
        World { problem, random, truth }
    }

    pub fn normal<const D: usize>(&mut self) -> nalgebra::SVector<f64, D> {
        nalgebra::SVector::from_fn(|_, _| StandardNormal.sample(&mut self.random))
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.random.random_bool(probability)
    }

    /// A time step between a tenth of a second and three seconds.
    pub fn interval(&mut self) -> f64 {
        self.random.random_range(0.1..3.0)
    }

    /// Moves the object.
    pub fn step(&mut self, dt: f64) {
        let motion = self.problem.motion();
        let noise: SMatrix<f64, 4, 4> = motion.noise(&self.truth, dt);
        self.truth = motion.transition(&self.truth, dt) + positive::root(&noise) * self.normal::<4>();
    }

    pub fn position(&self) -> Vector2<f64> {
        Vector2::new(self.truth[0], self.truth[1])
    }
}

/// The measurement of a subject's filter.
pub(super) type Seen<const N: usize, S> = <<S as Subject<N>>::Filter as Filter<N>>::Measurement;

/// The belief of a subject's filter.
pub(super) type Held<const N: usize, S> = <<S as Subject<N>>::Filter as Filter<N>>::Belief;

/// What the subject's sensor says of the object now.
pub(super) fn look<const N: usize, S: Subject<N>>(subject: &S, world: &mut World) -> Seen<N, S> {
    let error = world.normal();
    subject.measurement(&world.problem, &world.position(), &error)
}

/// A filter and its belief about the object of a world after some steps of a second.
pub(super) fn tracked<const N: usize, S: Subject<N>>(
    subject: &S,
    seed: u64,
    steps: usize,
) -> (S::Filter, Held<N, S>, World) {
    let mut world = World::new(Problem::ORDINARY, seed);
    let filter = subject.filter(&Problem::ORDINARY);
    let mut belief = filter.birth(&look(subject, &mut world)).expect("a good measurement starts an object");
    for _ in 0..steps {
        world.step(1.0);
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, &look(subject, &mut world)).expect("a good measurement updates");
    }
    (filter, belief, world)
}

/// Every number that a filter gives of a belief, bit by bit.
pub(super) fn bits<const N: usize, F: Filter<N> + ?Sized>(filter: &F, belief: &F::Belief) -> Vec<u64> {
    let (state, estimate) = (filter.state(belief), filter.estimate(belief));
    let numbers = state.mean.iter().chain(state.covariance.iter());
    let told = estimate.mean.iter().chain(estimate.covariance.iter()).chain(&estimate.modes);
    numbers.chain(told).map(|number| number.to_bits()).collect()
}

/// Largest difference of two states in the standard deviations of the second.
pub(super) fn apart<const K: usize>(ours: &Gaussian<K>, theirs: &Gaussian<K>) -> f64 {
    let deviations = theirs.deviations();
    let mut worst: f64 = 0.0;
    for i in 0..K {
        worst = worst.max((ours.mean[i] - theirs.mean[i]).abs() / deviations[i]);
        for j in 0..K {
            let difference = (ours.covariance[(i, j)] - theirs.covariance[(i, j)]).abs();
            worst = worst.max(difference / (deviations[i] * deviations[j]));
        }
    }
    if worst.is_nan() { f64::INFINITY } else { worst }
}

/// Whether a covariance is finite, symmetric and positive definite.
pub(super) fn is_sound<const K: usize>(state: &Gaussian<K>) -> bool {
    let mut settled = *state;
    settled.settle().is_ok()
        && state.covariance == state.covariance.transpose()
        && crate::belief::Cholesky::new(&state.covariance, "covariance").is_ok()
}

/// Position and velocity of a state.
pub(super) fn moving<const N: usize>(state: &Gaussian<N>) -> Gaussian<4> {
    state.leading()
}
