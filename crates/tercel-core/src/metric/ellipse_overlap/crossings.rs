//! Where an ellipse crosses the unit circle.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::Vector2;

/// Parameters of the crossings, in rising order from `-π/4`.
pub(super) struct Crossings {
    /// The parameters; the first `count` are valid.
    pub angles: [f64; 8],
    /// How many there are.
    pub count: usize,
}

/// Half the width of a chart in `t = tan(s/2)`: `tan(π/8)`.
const EDGE: f64 = 0.414_213_562_373_095_03;

/// Relative accuracy of turning points, which only have to part the roots.
const COARSE: f64 = 1e-7;

/// Relative accuracy of roots before they are polished.
const FINE: f64 = 1e-9;

/// The crossings of the ellipse with this centre and these semi-axes along `x` and `y`.
///
/// Each quarter of the ellipse has a chart of its own, centred at a vertex: near a vertex of a needle `t` is
/// small, and its digits are all there.
pub(super) fn crossings(centre: &Vector2<f64>, axes: &Vector2<f64>) -> Crossings {
    let mut found = Crossings { angles: [0.0; 8], count: 0 };
    let (x, y) = ((centre.x, axes.x), (centre.y, axes.y));
    // A quarter turn of the parameter: (cos, sin) becomes (-sin, cos).
    let quarters = [(x, y), (y, (x.0, -x.1)), ((x.0, -x.1), (y.0, -y.1)), ((y.0, -y.1), x)];
    for (quarter, ((c, p), (d, q))) in quarters.into_iter().enumerate() {
        // With (1+t²) cos s = 1-t², (1+t²) sin s = 2t:  (c(1+t²) + p(1-t²))² + (d(1+t²) + 2qt)² - (1+t²)²
        let (near, far) = (c + p, c - p);
        let polynomial = [
            near * near + d * d - 1.0,
            4.0 * d * q,
            2.0 * near * far + 2.0 * d * d + 4.0 * q * q - 2.0,
            4.0 * d * q,
            far * far + d * d - 1.0,
        ];
        let mut roots = Roots::default();
        roots.of_quartic(&polynomial);
        for t in &roots.values[..roots.count] {
            let s = quarter as f64 * FRAC_PI_2 + 2.0 * t.atan();
            found.add(polished(s, centre, axes));
        }
    }
    if found.count > 1 && found.angles[found.count - 1] - found.angles[0] >= TAU {
        found.count -= 1;
    }
    found
}

impl Crossings {
    fn add(&mut self, s: f64) {
        // The edge of a chart is that of the next.
        let again = self.count > 0 && s <= self.angles[self.count - 1];
        if !again && self.count < self.angles.len() {
            self.angles[self.count] = s;
            self.count += 1;
        }
    }
}

/// The crossing after two steps of Newton in the exact equation, which does not expand its squares.
fn polished(s: f64, centre: &Vector2<f64>, axes: &Vector2<f64>) -> f64 {
    stepped(stepped(s, centre, axes), centre, axes)
}

fn stepped(s: f64, centre: &Vector2<f64>, axes: &Vector2<f64>) -> f64 {
    let (sine, cosine) = s.sin_cos();
    let (x, y) = (centre.x + axes.x * cosine, centre.y + axes.y * sine);
    let slope = 2.0 * (y * axes.y * cosine - x * axes.x * sine);
    let step = (x * x + y * y - 1.0) / slope;
    if step.abs() < 1e-5 { s - step } else { s }
}

/// Real roots in the chart, in rising order.
#[derive(Default)]
struct Roots {
    values: [f64; 4],
    count: usize,
}

impl Roots {
    fn of_quartic(&mut self, c: &[f64; 5]) {
        let rest: f64 = (1..5).map(|k| c[k].abs() * EDGE.powi(k as i32)).sum();
        if c[0].abs() > rest {
            return;
        }
        let cubic = [c[1], 2.0 * c[2], 3.0 * c[3], 4.0 * c[4]];
        let quadratic = [2.0 * c[2], 6.0 * c[3], 12.0 * c[4]];
        let mut turning = Roots::default();
        let mut bends = Roots::default();
        bends.of_quadratic(&quadratic);
        turning.between(&bends, &cubic, COARSE);
        self.between(&turning, c, FINE);
    }

    /// The roots of a polynomial with those of its derivative.
    fn between<const D: usize>(&mut self, turning: &Roots, c: &[f64; D], tolerance: f64) {
        let mut low = -EDGE;
        let mut at_low = value(c, low);
        for place in 0..=turning.count {
            let high = if place < turning.count { turning.values[place] } else { EDGE };
            let at_high = value(c, high);
            // A root at the end of a piece belongs to the piece before it.
            if at_high == 0.0 || (at_low < 0.0) != (at_high < 0.0) && at_low != 0.0 {
                self.push(bracketed(c, (low, high), at_low, tolerance));
            }
            (low, at_low) = (high, at_high);
        }
    }

    fn of_quadratic(&mut self, c: &[f64; 3]) {
        let discriminant = c[1] * c[1] - 4.0 * c[0] * c[2];
        if discriminant < 0.0 {
            return;
        }
        let half = -0.5 * (c[1] + discriminant.sqrt().copysign(c[1]));
        let (mut a, mut b) = (half / c[2], c[0] / half);
        if a > b {
            (a, b) = (b, a);
        }
        for root in [a, b] {
            if root.abs() < EDGE {
                self.push(root);
            }
        }
    }

    fn push(&mut self, root: f64) {
        if self.count < self.values.len() {
            self.values[self.count] = root;
            self.count += 1;
        }
    }
}

fn value<const D: usize>(c: &[f64; D], t: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient)
}

/// The root between two points of different sign, by Newton's steps that stay in the bracket.
fn bracketed<const D: usize>(
    c: &[f64; D],
    (mut low, mut high): (f64, f64),
    at_low: f64,
    tolerance: f64,
) -> f64 {
    let rising = at_low < 0.0;
    let mut t = 0.5 * (low + high);
    for _ in 0..60 {
        let (mut f, mut slope) = (0.0, 0.0);
        for coefficient in c.iter().rev() {
            slope = slope * t + f;
            f = f * t + coefficient;
        }
        if (f < 0.0) == rising {
            low = t
        } else {
            high = t
        }
        let newton = t - f / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - t).abs() <= tolerance * t.abs() + f64::EPSILON * EDGE {
            return next;
        }
        t = next;
    }
    t
}
