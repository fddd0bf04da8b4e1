use std::ops::AddAssign;

use super::*;

/// The probabilities of the whole chain: where each mode alone leads.
fn over(chain: &Chain, dt: f64) -> DMatrix<f64> {
    let mut whole = DMatrix::identity(chain.modes, chain.modes);
    chain.leap(dt, &mut Vec::new(), |leap| {
        let mut next = DMatrix::zeros(chain.modes, chain.modes);
        for group in leap.groups(chain.modes) {
            for (i, j) in (0..leap.modes).flat_map(|i| (0..leap.modes).map(move |j| (i, j))) {
                let probability = leap.probabilities[i * leap.modes + j];
                if let Some([stay, change]) = leap.even {
                    assert!((probability - if i == j { stay } else { change }).abs() < 1e-14);
                }
                let (from, to) = (group + i * leap.stride, group + j * leap.stride);
                let flow = whole.column(from) * probability;
                next.column_mut(to).add_assign(&flow);
            }
        }
        whole = next;
    });
    whole
}

#[test]
fn an_interval_gives_the_stated_probabilities_back_and_scales_between() {
    let chain = Transition::from_rows(ROWS).unwrap().per(3.0).chain(3).unwrap();
    let stated = matrix(ROWS);
    assert_eq!(over(&chain, 3.0), stated);
    assert!((over(&chain, 1.5) * over(&chain, 1.5) - &stated).amax() < 1e-14);
    assert!((over(&chain, 6.0) - &stated * &stated).amax() < 1e-14);
    assert!((over(&chain, 1.3) * over(&chain, 1.7) - &stated).amax() < 1e-14);
    assert_eq!(over(&chain, 0.0), DMatrix::identity(3, 3));
}

#[test]
fn rates_of_two_modes_agree_with_the_closed_form() {
    let (out, back) = (0.02, 0.3);
    let chain = Transition::from_rates([[0.0, out], [back, 0.0]]).unwrap().chain(2).unwrap();
    for dt in [1e-3, 1.0, 7.0, 1e3, 1e9] {
        let change = out / (out + back) * -f64::exp_m1(-(out + back) * dt);
        assert!((over(&chain, dt)[(0, 1)] - change).abs() < 1e-14, "{dt}");
    }
}

#[test]
fn a_step_is_a_step_however_long() {
    let chain = Transition::sticky(0.9).chain(3).unwrap();
    assert_eq!(over(&chain, 0.1), over(&chain, 10.0));
    assert!((over(&chain, 1.0)[(0, 1)] - 0.05).abs() < 1e-16);
}

#[test]
fn what_is_not_a_transition_is_refused() {
    assert!(Transition::from_rows([[0.9, 0.2], [0.1, 0.9]]).is_err());
    assert!(Transition::from_rows([[1.1, -0.1], [0.1, 0.9]]).is_err());
    assert!(Transition::from_rows([vec![1.0], vec![0.5, 0.5]]).is_err());
    assert!(Transition::from_rows(Vec::<Vec<f64>>::new()).is_err());
    assert!(Transition::from_rates([[0.0, -1.0], [1.0, 0.0]]).is_err());
    assert!(Transition::sticky(1.2).chain(2).is_err());
    assert!(Transition::sticky(0.4).per(1.0).chain(2).is_err());
    assert!(Transition::from_rows([[0.9, 0.1], [0.1, 0.9]]).unwrap().chain(3).is_err());
    // A cycle that only turns one way skips a mode faster than any process in continuous time could.
    let cycle = [[0.8, 0.2, 0.0], [0.0, 0.8, 0.2], [0.2, 0.0, 0.8]];
    assert!(Transition::from_rows(cycle).unwrap().per(1.0).chain(3).is_err());
}

const ROWS: [[f64; 3]; 3] = [[0.9, 0.08, 0.02], [0.05, 0.9, 0.05], [0.01, 0.04, 0.95]];

fn matrix(rows: [[f64; 3]; 3]) -> DMatrix<f64> {
    DMatrix::from_fn(3, 3, |i, j| rows[i][j])
}

#[test]
fn independent_chains_have_the_kronecker_product_of_their_matrices() {
    let parts = [(Transition::from_rows(ROWS).unwrap(), 3), (Transition::sticky(0.7), 2)];
    let joint = Transition::joint(parts.clone()).chain(6).unwrap();
    let expected = matrix(ROWS).kronecker(&sticky(0.7, 2));
    assert!((over(&joint, 5.0) - &expected).amax() < 1e-15);
    let deep = Transition::joint([(Transition::joint(parts), 6), (Transition::sticky(1.0), 2)]);
    let expected = expected.kronecker(&DMatrix::identity(2, 2));
    assert!((over(&deep.chain(12).unwrap(), 5.0) - expected).amax() < 1e-15);
    assert_eq!(over(&Transition::joint([]).chain(1).unwrap(), 1.0), DMatrix::identity(1, 1));
}

#[test]
fn rates_of_independent_chains_add_up() {
    let rates = [[0.0, 0.02], [0.3, 0.0]];
    let parts =
        [(Transition::from_rates(rates).unwrap(), 2), (Transition::from_rows(ROWS).unwrap().per(3.0), 3)];
    let chain = Transition::joint(parts).chain(6).unwrap();
    let own = DMatrix::from_row_slice(2, 2, &[-0.02, 0.02, 0.3, -0.3]);
    let other = generator(&matrix(ROWS)).unwrap() / 3.0;
    let one = |n: usize| DMatrix::<f64>::identity(n, n);
    let sum = own.kronecker(&one(3)) + one(2).kronecker(&other);
    for dt in [0.1, 3.0, 40.0] {
        assert!((over(&chain, dt) - (&sum * dt).exp()).amax() < 1e-13, "{dt}");
    }
}

#[test]
fn an_interval_of_a_joint_transition_is_that_of_every_part_in_probabilities() {
    let rates = Transition::from_rates([[0.0, 0.1], [0.1, 0.0]]).unwrap();
    let parts = [(Transition::sticky(0.9), 3), (rates.clone(), 2), (Transition::sticky(0.8).per(1.0), 2)];
    let chain = Transition::joint(parts).per(4.0).chain(12).unwrap();
    let rates = over(&rates.chain(2).unwrap(), 4.0);
    let expected = sticky(0.9, 3).kronecker(&rates).kronecker(&sticky(0.8, 2));
    assert!((over(&chain, 4.0) - &expected).amax() < 1e-14);
    assert!((over(&chain, 8.0) - &expected * &expected).amax() < 1e-14);
}

#[test]
fn parts_and_modes_that_do_not_fit_are_refused() {
    let two = || Transition::from_rows([[0.9, 0.1], [0.1, 0.9]]).unwrap();
    assert!(Transition::joint([(two(), 2), (two(), 2)]).chain(5).is_err());
    assert!(Transition::joint([(two(), 3), (two(), 2)]).chain(6).is_err());
    assert!(Transition::joint([(Transition::sticky(0.9), 0)]).chain(1).is_err());
    assert!(Transition::joint([(Transition::sticky(1.9), 2)]).chain(2).is_err());
    assert!(Transition::joint([(two(), 2)]).per(-1.0).chain(2).is_err());
    // 2⁷⁰ modes: their number does not wrap around to one that fits.
    assert!(Transition::joint(vec![(two(), 2); 70]).chain(1).is_err());
}
