//! The Gaussian of the state, in blocks.

use tercel_core::extended::{Points, Scattering};

use super::number::{Number, Symmetric};

/// A Gaussian over `x, y, vx, vy`, in blocks of position and velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics<T> {
    /// Mean of the position, m.
    pub place: [T; 2],
    /// Mean of the velocity, m/s.
    pub velocity: [T; 2],
    /// Covariance of the position, m².
    pub place_covariance: Symmetric<T>,
    /// Covariance of position and velocity, `[position][velocity]`, m²/s.
    pub cross: [[T; 2]; 2],
    /// Covariance of the velocity, m²/s².
    pub velocity_covariance: Symmetric<T>,
}

/// Numbers of a Gaussian in a row.
pub(super) const NUMBERS: usize = 14;

impl<T: Number> Kinematics<T> {
    /// The numbers in a row: means, then the covariances of position, of both, and of velocity.
    pub fn numbers(&self) -> [T; NUMBERS] {
        let Kinematics { place, velocity, place_covariance: pp, cross: c, velocity_covariance: vv } = *self;
        [
            place[0],
            place[1],
            velocity[0],
            velocity[1],
            pp.xx,
            pp.xy,
            pp.yy,
            c[0][0],
            c[0][1],
            c[1][0],
            c[1][1],
            vv.xx,
            vv.xy,
            vv.yy,
        ]
    }

    /// The Gaussian of such a row.
    ///
    /// # Panics
    /// When the row is shorter.
    pub fn of(row: &[T]) -> Self {
        Kinematics {
            place: [row[0], row[1]],
            velocity: [row[2], row[3]],
            place_covariance: Symmetric { xx: row[4], xy: row[5], yy: row[6] },
            cross: [[row[7], row[8]], [row[9], row[10]]],
            velocity_covariance: Symmetric { xx: row[11], xy: row[12], yy: row[13] },
        }
    }

    /// The columns of the covariance of position and velocity.
    fn columns(&self) -> [[T; 2]; 2] {
        let c = &self.cross;
        [[c[0][0], c[1][0]], [c[0][1], c[1][1]]]
    }

    /// The covariance of the velocity where the position is known.
    pub fn velocity_given_place(&self) -> Symmetric<T> {
        let (columns, vv) = (self.columns(), self.velocity_covariance);
        let inverse = self.place_covariance.inverse();
        Symmetric {
            xx: vv.xx - inverse.form(columns[0], columns[0]),
            xy: vv.xy - inverse.form(columns[0], columns[1]),
            yy: vv.yy - inverse.form(columns[1], columns[1]),
        }
    }

    /// The mean of the velocity where the position is known to be off by this.
    pub fn velocity_shift(&self, place: [T; 2]) -> [T; 2] {
        let weighed = self.place_covariance.inverse().times(place);
        self.columns().map(|column| column[0] * weighed[0] + column[1] * weighed[1])
    }

    /// Conditions on a position that is off by `residual`, with this covariance.
    pub(super) fn see_place(&mut self, residual: [T; 2], noise: &Symmetric<T>) {
        let (pp, vv, columns) = (self.place_covariance, self.velocity_covariance, self.columns());
        let inverse = pp.plus(noise).inverse();
        let weighed = inverse.times(residual);
        let moved = pp.times(weighed);
        let along = |column: [T; 2], v: [T; 2]| column[0] * v[0] + column[1] * v[1];
        for i in 0..2 {
            self.place[i] = self.place[i] + moved[i];
            self.velocity[i] = self.velocity[i] + along(columns[i], weighed);
        }
        // P - P S⁻¹ P = R - R S⁻¹ R, which stays positive however small R is.
        let own = |i: usize| if i == 0 { [noise.xx, noise.xy] } else { [noise.xy, noise.yy] };
        self.place_covariance = Symmetric {
            xx: noise.xx - inverse.form(own(0), own(0)),
            xy: noise.xy - inverse.form(own(0), own(1)),
            yy: noise.yy - inverse.form(own(1), own(1)),
        };
        // P - P S⁻¹ P_pv = R S⁻¹ P_pv.
        self.cross = std::array::from_fn(|i| std::array::from_fn(|j| inverse.form(own(i), columns[j])));
        self.velocity_covariance = Symmetric {
            xx: vv.xx - inverse.form(columns[0], columns[0]),
            xy: vv.xy - inverse.form(columns[0], columns[1]),
            yy: vv.yy - inverse.form(columns[1], columns[1]),
        };
    }

    /// Conditions on a velocity of zero in the direction of `normal`, with this variance.
    pub(super) fn see_across(&mut self, normal: [T; 2], noise: T) {
        let (v, cross) = (self.velocity, self.cross);
        let of_place: [T; 2] = std::array::from_fn(|i| cross[i][0] * normal[0] + cross[i][1] * normal[1]);
        let of_velocity = self.velocity_covariance.times(normal);
        let square = normal[0] * of_velocity[0] + normal[1] * of_velocity[1] + noise;
        let scale = T::of(1.0) / square;
        let missed = -(normal[0] * v[0] + normal[1] * v[1]) * scale;
        for i in 0..2 {
            self.place[i] = self.place[i] + of_place[i] * missed;
            self.velocity[i] = v[i] + of_velocity[i] * missed;
        }
        let less = |matrix: &Symmetric<T>, u: [T; 2]| Symmetric {
            xx: matrix.xx - u[0] * u[0] * scale,
            xy: matrix.xy - u[0] * u[1] * scale,
            yy: matrix.yy - u[1] * u[1] * scale,
        };
        self.place_covariance = less(&self.place_covariance, of_place);
        self.velocity_covariance = less(&self.velocity_covariance, of_velocity);
        self.cross = std::array::from_fn(|i| {
            std::array::from_fn(|j| cross[i][j] - of_place[i] * of_velocity[j] * scale)
        });
    }
}

/// The state of a new object with these semi-axes (m) at the mean of a scan, whose velocity is not known but for its deviation
/// (m/s), and the direction in which its points lie, rad.
pub fn begin(points: &Points, scattering: &Scattering, axes: [f64; 2], speed: f64) -> (Kinematics<f64>, f64) {
    let squares = axes.map(|axis| axis * axis);
    let scatter = points.scatter();
    let angle = 0.5 * (2.0 * scatter.m12).atan2(scatter.m11 - scatter.m22);
    let extent = Symmetric { xx: squares[0], xy: 0.0, yy: squares[1] }.turned([angle.cos(), angle.sin()]);
    let (scale, noise, count) = (scattering.scale(), scattering.noise(), points.count().max(1) as f64);
    let place_covariance = Symmetric {
        xx: (scale * extent.xx + noise.m11) / count,
        xy: (scale * extent.xy + noise.m12) / count,
        yy: (scale * extent.yy + noise.m22) / count,
    };
    let square = speed * speed;
    let motion = Kinematics {
        place: [points.mean().x, points.mean().y],
        velocity: [0.0; 2],
        place_covariance,
        cross: [[0.0; 2]; 2],
        velocity_covariance: Symmetric { xx: square, xy: 0.0, yy: square },
    };
    (motion, angle)
}
