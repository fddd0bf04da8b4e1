//! What a gate takes, the search for it finds.

#![allow(clippy::unwrap_used)]

use nalgebra::{SMatrix, SVector, Vector2, vector};
use proptest::prelude::*;
use tercel_core::association::{Gate, Search};
use tercel_core::belief::Gaussian;
use tercel_core::filter::{Extended, Filter, Imm, Kalman, Particle, Transition, Unscented};
use tercel_core::motion::{ConstantVelocity, Turn};
use tercel_core::sensor::{
    BearingOnly, ConvertedPolar, Measurement, Position, RangeBearing, RangeBearingRate, Sensor,
};

/// A belief and where it may be, as seen from a sensor at `(700, -300)`.
#[derive(Debug, Clone)]
struct Scene {
    mean: SVector<f64, 4>,
    covariance: SMatrix<f64, 4, 4>,
    range_deviation: f64,
    bearing_deviation: f64,
    /// Measurements by their distance from the expected reading, in deviations of the innovation.
    offsets: Vec<[f64; 3]>,
    ages: Vec<f64>,
    /// Factors by which own noises exceed the sensor's; one for none.
    own: Vec<f64>,
}

const SENSOR: Vector2<f64> = Vector2::new(700.0, -300.0);

prop_compose! {
    fn scene()(
        (ln_range, sight, heading, speed) in (1.0..11.0_f64, -4.0..4.0_f64, -4.0..4.0_f64, 0.0..300.0_f64),
        (long, wide, turn, unsure) in (-2.0..7.0_f64, -2.0..7.0_f64, -4.0..4.0_f64, -2.0..4.0_f64),
        (ln_range_deviation, ln_bearing_deviation) in (-1.0..6.0_f64, -7.0..-0.7_f64),
        offsets in prop::collection::vec(prop::array::uniform3(-4.0..4.0_f64), 20),
        (oldest, ages) in (prop::sample::select(vec![0.0, 0.0, 0.5, 4.0]), prop::collection::vec(0.0..1.0_f64, 20)),
        (largest, own) in (prop::sample::select(vec![1.0, 1.0, 10.0]), prop::collection::vec(0.0..1.0_f64, 20)),
    ) -> Scene {
        let range = ln_range.exp();
        let (sine, cosine) = sight.sin_cos();
        let velocity = vector![heading.cos(), heading.sin()] * speed;
        let place = SENSOR + vector![cosine, sine] * range;
        let frame = SMatrix::<f64, 2, 2>::new(turn.cos(), -turn.sin(), turn.sin(), turn.cos());
        let spread = frame * SMatrix::from_diagonal(&vector![long.exp(), wide.exp()]);
        let mut root = SMatrix::<f64, 4, 4>::zeros();
        root.fixed_view_mut::<2, 2>(0, 0).copy_from(&spread);
        root.fixed_view_mut::<2, 2>(2, 0).copy_from(&(spread * 0.1));
        root.fixed_view_mut::<2, 2>(2, 2).copy_from(&(SMatrix::<f64, 2, 2>::identity() * unsure.exp()));
        Scene {
            mean: vector![place.x, place.y, velocity.x, velocity.y],
            covariance: root * root.transpose(),
            range_deviation: ln_range_deviation.exp(),
            bearing_deviation: ln_bearing_deviation.exp(),
            offsets,
            ages: ages.into_iter().map(|share| share * oldest).collect(),
            own: own.into_iter().map(|share| 1.0 + share * (largest - 1.0)).collect(),
        }
    }
}

impl Scene {
    /// Checks that whatever the gate of a filter takes lies in its reach. Gives how many were taken.
    fn check<const M: usize, F>(
        &self,
        filter: &F,
        belief: &F::Belief,
        sensor: &impl Sensor<4, M>,
        deviations: [f64; M],
    ) -> Result<usize, TestCaseError>
    where
        F: Filter<4, Measurement = Measurement<M>>,
    {
        let gate = Gate::default();
        let mut plots = Vec::new();
        for ((offset, age), own) in self.offsets.iter().zip(&self.ages).zip(&self.own) {
            let start = self.reading(filter, belief, sensor.expected(&self.mean), *age);
            let value = SVector::<f64, M>::from_fn(|i, _| {
                // As wide as the gate, whether the belief or the sensor is the wider.
                let spread = self.width(sensor, i).hypot(deviations[i] * own);
                start[i] + offset[i] * spread
            });
            let plot = Measurement::from(value).with_age(*age);
            let noise = SMatrix::from_fn(|i, j| if i == j { (deviations[i] * own).powi(2) } else { 0.0 });
            plots.push(if *own > 1.0 { plot.with_noise(noise) } else { plot });
        }
        let mut search = Search::new(gate);
        plots.iter().for_each(|plot| filter.widen(&mut search, plot));
        let Some(region) = filter.reach(belief, &search) else { return Ok(plots.len()) };
        let mut taken = 0;
        for plot in &plots {
            let inside = filter.innovation(belief, plot).is_ok_and(|innovation| gate.contains(&innovation));
            let place = filter.place(plot).unwrap();
            prop_assert!(!inside || region.contains(&place), "{plot:?} at {place} is not in {region:?}");
            taken += usize::from(inside);
        }
        Ok(taken)
    }

    /// The measurement that a filter expects, of this age.
    fn reading<const M: usize, F>(
        &self,
        filter: &F,
        belief: &F::Belief,
        start: SVector<f64, M>,
        age: f64,
    ) -> SVector<f64, M>
    where
        F: Filter<4, Measurement = Measurement<M>>,
    {
        match filter.innovation(belief, &Measurement::from(start).with_age(age)) {
            Ok(innovation) => start - SVector::from_fn(|i, _| innovation.residual()[i]),
            Err(_) => start,
        }
    }

    /// Deviation of a component of the reading by the belief alone.
    fn width<const M: usize>(&self, sensor: &impl Sensor<4, M>, i: usize) -> f64 {
        let jacobian = sensor.jacobian(&self.mean);
        (jacobian * self.covariance * jacobian.transpose())[(i, i)].sqrt().min(1e6)
    }

    fn belief(&self) -> Gaussian<4> {
        Gaussian::new(self.mean, self.covariance).unwrap()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn linearised_filters_find_all_that_their_gate_takes(scene in scene()) {
        let (motion, belief) = (ConstantVelocity::new(1.0), scene.belief());
        let (range, bearing) = (scene.range_deviation, scene.bearing_deviation);
        let polar = RangeBearing::new(range, bearing).unwrap().at(SENSOR);
        scene.check(&Extended::new(motion, polar), &belief, &polar, [range, bearing])?;
        let doppler = RangeBearingRate::new(range, bearing, 2.0).unwrap().at(SENSOR, vector![3.0, 9.0]);
        let filter = Extended::<_, _, 3>::new(motion, doppler);
        scene.check(&filter, &belief, &doppler, [range, bearing, 2.0])?;
        let position = Position::<2>::new(range).unwrap();
        scene.check(&Kalman::new(motion, position), &belief, &position, [range; 2])?;
        let bearings = Extended::<_, _, 1>::new(motion, BearingOnly::new(bearing).unwrap().at(SENSOR));
        prop_assert!(Filter::<4>::reach(&bearings, &belief, &Search::default()).is_none());
    }

    #[test]
    fn sigma_points_find_all_that_their_gate_takes(scene in scene()) {
        let (motion, belief) = (ConstantVelocity::new(1.0), scene.belief());
        let (range, bearing) = (scene.range_deviation, scene.bearing_deviation);
        let polar = RangeBearing::new(range, bearing).unwrap().at(SENSOR);
        scene.check(&Unscented::new(motion, polar), &belief, &polar, [range, bearing])?;
    }

    #[test]
    fn converted_plots_are_found_wherever_the_gate_takes_them(scene in scene()) {
        let (range, bearing) = (scene.range_deviation, scene.bearing_deviation);
        let converted = ConvertedPolar::new(range, bearing).unwrap().at(SENSOR);
        let polar = RangeBearing::new(range, bearing).unwrap().at(SENSOR);
        let filter = Kalman::new(ConstantVelocity::new(1.0), converted);
        let mut search = Search::default();
        let plots: Vec<Measurement<2>> = scene.offsets.iter().zip(&scene.ages).map(|(offset, age)| {
            let expected = Sensor::<4, 2>::expected(&polar, &scene.mean);
            let wide = |i: usize| scene.width::<2>(&polar, i).min([1e6, 3.0][i]);
            let value = SVector::from_fn(|i, _| expected[i] + offset[i] * [range, bearing][i].hypot(wide(i)));
            let plot = Measurement::from(value).with_age(*age);
            Filter::<4>::widen(&filter, &mut search, &plot);
            plot
        }).collect();
        let region = filter.reach(&scene.belief(), &search).unwrap();
        for plot in &plots {
            let inside = filter.innovation(&scene.belief(), plot).is_ok_and(|found| Gate::default().contains(&found));
            prop_assert!(!inside || region.contains(&Filter::<4>::place(&filter, plot).unwrap()), "{plot:?} {region:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn mixtures_find_all_that_their_gate_takes(scene in scene()) {
        let (range, bearing) = (scene.range_deviation, scene.bearing_deviation);
        let polar = RangeBearing::new(range, bearing).unwrap().at(SENSOR);
        let modes = [0.0, 0.2, -0.2].map(|rate| Extended::new(Turn::new(rate, 0.5), polar));
        let imm = Imm::new(modes, Transition::sticky(0.9)).unwrap();
        let mut belief = imm.birth(&[1000.0, 0.0].into()).unwrap();
        imm.set_state(&mut belief, &scene.belief());
        imm.predict(&mut belief, 3.0);
        scene.check(&imm, &belief, &polar, [range, bearing])?;

        let cloud = Particle::new(ConstantVelocity::new(1.0), polar, 200, 1).unwrap();
        let mut belief = cloud.birth(&[1000.0, 0.0].into()).unwrap();
        cloud.set_state(&mut belief, &scene.belief());
        scene.check(&cloud, &belief, &polar, [range, bearing])?;
    }
}

#[test]
fn the_scenes_of_these_tests_hold_measurements_that_gates_take() {
    use proptest::strategy::{Strategy, ValueTree};
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let (mut taken, mut all) = (0, 0);
    for _ in 0..300 {
        let scene = scene().new_tree(&mut runner).unwrap().current();
        let polar = RangeBearing::new(scene.range_deviation, scene.bearing_deviation).unwrap().at(SENSOR);
        let filter = Extended::new(ConstantVelocity::new(1.0), polar);
        let deviations = [scene.range_deviation, scene.bearing_deviation];
        taken += scene.check(&filter, &scene.belief(), &polar, deviations).unwrap();
        all += scene.offsets.len();
    }
    assert!(taken > all / 5 && taken < all * 4 / 5, "{taken} of {all}");
}
