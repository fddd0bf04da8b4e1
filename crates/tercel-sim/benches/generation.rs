//! How fast flights are made and measured.

use divan::Bencher;
use divan::counter::ItemsCount;
use tercel_sim::air_traffic::AirTraffic;

fn main() {
    divan::main();
}

/// A thousand flights of 200 steps with their plots, on as many threads as divan is told (`--threads`).
#[divan::bench(threads = [1, 2])]
fn flights(bencher: Bencher) {
    let scenario = AirTraffic::test();
    bencher.counter(ItemsCount::new(1_000_u32)).bench(|| {
        (0..1_000)
            .map(|run| {
                let flight = scenario.flight(1, run);
                flight.observe(&flight.radar(), 1, run).len()
            })
            .sum::<usize>()
    });
}
