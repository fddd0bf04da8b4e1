use std::f64::consts::{PI, TAU};

use nalgebra::vector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// A polygon of 256 corners with the area of the ellipse.
fn polygon(ellipse: &Ellipse) -> Vec<Vector2<f64>> {
    const CORNERS: usize = 256;
    let step = TAU / CORNERS as f64;
    let grow = (step / step.sin()).sqrt();
    let (sine, cosine) = ellipse.angle.sin_cos();
    let corner = |number: usize| {
        let (y, x) = (number as f64 * step).sin_cos();
        let (x, y) = (grow * ellipse.axes.x * x, grow * ellipse.axes.y * y);
        ellipse.center + vector![cosine * x - sine * y, sine * x + cosine * y]
    };
    (0..CORNERS).map(corner).collect()
}

fn cross(a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
    a.x * b.y - a.y * b.x
}

fn area(polygon: &[Vector2<f64>]) -> f64 {
    let Some(first) = polygon.first() else { return 0.0 };
    let pairs = polygon.iter().zip(polygon.iter().cycle().skip(1));
    0.5 * pairs.map(|(a, b)| cross(&(a - first), &(b - first))).sum::<f64>()
}

/// The clip of Sutherland and Hodgman (1974).
fn clipped(subject: Vec<Vector2<f64>>, clip: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let mut kept = subject;
    for (a, b) in clip.iter().zip(clip.iter().cycle().skip(1)) {
        let side = |point: &Vector2<f64>| cross(&(b - a), &(point - a));
        let mut next = Vec::with_capacity(kept.len() + 1);
        for (point, after) in kept.iter().zip(kept.iter().cycle().skip(1)) {
            let (here, there) = (side(point), side(after));
            if here >= 0.0 {
                next.push(*point);
            }
            if (here >= 0.0) != (there >= 0.0) {
                next.push(point + (after - point) * (here / (here - there)));
            }
        }
        kept = next;
    }
    kept
}

fn clip(first: &Ellipse, second: &Ellipse) -> f64 {
    let shared = area(&clipped(polygon(first), &polygon(second)));
    shared / (first.area() + second.area() - shared)
}

fn ellipse(x: f64, y: f64, a: f64, b: f64, angle: f64) -> Ellipse {
    Ellipse::new(vector![x, y], vector![a, b], angle).unwrap()
}

fn drawn(random: &mut ChaCha8Rng, kind: usize) -> (Ellipse, Ellipse) {
    let mut uniform = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let thin = if kind == 4 { 1e-3 } else { 0.1 };
    let first = ellipse(
        uniform(-9.0, 9.0),
        uniform(-9.0, 9.0),
        uniform(0.5, 9.0),
        uniform(thin, 5.0),
        uniform(-4.0, 4.0),
    );
    let (angle, b) = (uniform(-4.0, 4.0), uniform(thin, 5.0));
    let heading = vector![angle.cos(), angle.sin()];
    let second = match kind {
        // Anywhere, so apart at times.
        0 => ellipse(uniform(-9.0, 9.0), uniform(-9.0, 9.0), uniform(0.5, 9.0), b, angle),
        // Nested.
        1 => Ellipse { axes: first.axes * uniform(0.05, 0.99), ..first },
        // Touching from outside or inside, along the axis.
        2 => {
            let (sine, cosine) = first.angle.sin_cos();
            let a = uniform(0.5, 3.0);
            let reach = if uniform(0.0, 1.0) < 0.5 { first.axes.x + a } else { first.axes.x - a };
            let center = first.center + vector![cosine, sine] * reach;
            Ellipse { center, axes: vector![a, b], angle: first.angle }
        }
        // Nearly the same.
        3 => Ellipse {
            center: first.center + heading * uniform(0.0, 1.0) * 10_f64.powf(uniform(-12.0, 0.0)),
            axes: first.axes * (1.0 + uniform(-0.1, 0.1) * 10_f64.powf(uniform(-12.0, 0.0))),
            angle: first.angle + uniform(-0.1, 0.1) * 10_f64.powf(uniform(-12.0, 0.0)),
        },
        // Needles that cross near the centre of the first.
        _ => {
            let center = first.center + heading * uniform(0.0, 1.0);
            Ellipse { center, axes: vector![uniform(0.5, 9.0), uniform(1e-3, 0.1)], angle }
        }
    };
    (first, second)
}

#[test]
fn it_is_the_clip_of_polygons_for_100_000_pairs() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    // The clip takes a hundred times as long as the formula, so debug builds try fewer.
    let pairs = if cfg!(debug_assertions) { 10_000 } else { 100_000 };
    for number in 0..pairs {
        let (first, second) = drawn(&mut random, number % 5);
        let exact = intersection_over_union(&first, &second);
        let near = clip(&first, &second);
        assert!((exact - near).abs() < 2e-4, "{exact} instead of {near} for {first:?} and {second:?}");
        let swapped = intersection_over_union(&second, &first);
        assert!((exact - swapped).abs() < 1e-9, "{exact} and {swapped} for {first:?} and {second:?}");
        assert!((0.0..=1.0).contains(&exact));
        assert!((intersection_over_union(&first, &first) - 1.0).abs() < 1e-12, "{first:?} against itself");
    }
}

#[test]
fn needles_at_right_angles_share_their_crossing() {
    for thin in [1e-2, 1e-4, 1e-6] {
        let (a, b) = (ellipse(3.0, 1.0, 1.0, thin, 0.4), ellipse(3.0, 1.0, 1.0, thin, 0.4 + PI / 2.0));
        // Two ellipses of one shape at right angles share 4 a b atan(b/a).
        let shared = 4.0 * thin * thin.atan();
        let expected = shared / (2.0 * PI * thin - shared);
        let found = intersection_over_union(&a, &b);
        assert!((found / expected - 1.0).abs() < 1e-6, "{thin}: {found} instead of {expected}");
    }
}

#[test]
fn circles_share_their_lens() {
    for distance in [0.0_f64, 0.3, 1.0, 1.9, 2.0, 2.1] {
        let lens: f64 = if distance < 2.0 {
            2.0 * (0.5 * distance).acos() - 0.5 * distance * (4.0 - distance * distance).sqrt()
        } else {
            0.0
        };
        let found = intersection_over_union(
            &ellipse(0.0, 0.0, 1.0, 1.0, 0.0),
            &ellipse(distance, 0.0, 1.0, 1.0, 1.0),
        );
        assert!((found - lens / (2.0 * PI - lens)).abs() < 1e-9, "{distance}: {found}");
    }
}

#[test]
fn what_has_no_area_overlaps_with_nothing() {
    let line = ellipse(0.0, 0.0, 2.0, 0.0, 0.0);
    let circle = ellipse(0.0, 0.0, 1.0, 1.0, 0.0);
    assert_eq!(intersection_over_union(&line, &circle), 0.0);
    assert_eq!(intersection_over_union(&circle, &line), 0.0);
    assert_eq!(intersection_over_union(&line, &line), 0.0);
    let far = ellipse(1e200, 0.0, 1.0, 1.0, 0.0);
    assert_eq!(intersection_over_union(&circle, &far), 0.0);
}
