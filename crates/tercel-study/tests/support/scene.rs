//! A made-up harbour: boats that cross, two sensors on a moving ship, clutter, and the tracks of an honest tracker.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use tercel_data::table::{Detection, Detections, Observation, Scan, Status, Track, Tracks, Truth, Truths};
use tercel_study::report::{Chart, Form, Picture, Report, ReportError, SensorNote, Summary};

/// How much there is of everything.
pub struct Size {
    /// True objects.
    pub boats: usize,
    /// Radar scans, 2.5 s apart.
    pub scans: usize,
    /// False detections in a scan of the radar.
    pub clutter: usize,
}

/// The tables of a scene.
pub struct Scene {
    pub detections: Detections,
    pub tracks: Tracks,
    pub truths: Truths,
}

/// Numbers that look random and are the same every time (a linear congruential generator).
struct Dice(u64);

impl Dice {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// A boat on a gentle curve.
struct Boat {
    name: Arc<str>,
    start: [f64; 2],
    speed: f64,
    course: f64,
    turn: f64,
    life: [f64; 2],
}

impl Boat {
    fn at(&self, time: f64) -> ([f64; 2], [f64; 2]) {
        let turned = self.turn * time;
        let course = self.course + turned;
        let chord = if turned.abs() < 1e-9 { 1.0 } else { (turned / 2.0).sin() / (turned / 2.0) };
        let way = self.speed * time * chord;
        let middle = self.course + turned / 2.0;
        let position = [self.start[0] + way * middle.cos(), self.start[1] + way * middle.sin()];
        (position, [self.speed * course.cos(), self.speed * course.sin()])
    }
}

fn boats(size: &Size, dice: &mut Dice) -> Vec<Boat> {
    let duration = size.scans as f64 * 2.5;
    let boat = |i: usize| {
        let direction = TAU * i as f64 / size.boats as f64 + 0.3 * dice.normal();
        let radius = 350.0 + 250.0 * dice.uniform();
        let speed = 1.7 * radius / duration * (0.7 + 0.6 * dice.uniform());
        let late = if i % 3 == 2 { 0.3 * duration * dice.uniform() } else { 0.0 };
        let early = if i % 4 == 3 { 0.35 * duration * dice.uniform() } else { 0.0 };
        Boat {
            name: format!("boat {}", i + 1).into(),
            start: [radius * direction.cos(), radius * direction.sin()],
            speed,
            course: direction + PI + 0.4 * dice.normal(),
            turn: 0.5 * dice.normal() / duration,
            life: [late, duration - early],
        }
    };
    (0..size.boats).map(boat).collect()
}

/// Own ship goes slowly north-east.
fn own_ship(time: f64) -> [f64; 2] {
    [-120.0 + 0.8 * time, -160.0 + 0.5 * time]
}

/// Makes the tables: the same for the same size.
pub fn scene(size: &Size) -> Scene {
    let mut dice = Dice(20_240_514);
    let boats = boats(size, &mut dice);
    let mut made = Making { dice, boats, next: 0, scene: empty() };
    for k in 0..size.scans {
        let time = k as f64 * 2.5;
        made.truth(time);
        made.radar(time, size.clutter);
        made.lidar(time + 0.9);
    }
    made.clutter_tracks(size);
    made.scene.tracks.rows.sort_by(|a, b| a.time.total_cmp(&b.time));
    made.scene
}

fn empty() -> Scene {
    let labels = ["x", "y", "vx", "vy"].map(String::from).to_vec();
    let modes = ["straight", "turn"].map(String::from).to_vec();
    Scene {
        detections: Detections::default(),
        tracks: Tracks { labels, modes, ..Tracks::default() },
        truths: Truths::default(),
    }
}

struct Making {
    dice: Dice,
    boats: Vec<Boat>,
    next: u64,
    scene: Scene,
}

impl Making {
    fn truth(&mut self, time: f64) {
        for boat in self.boats.iter().filter(|boat| (boat.life[0]..=boat.life[1]).contains(&time)) {
            let (position, velocity) = boat.at(time);
            let object = boat.name.clone();
            let row = Truth { time, object, position, z: None, velocity: Some(velocity), extent: None };
            self.scene.truths.rows.push(row);
        }
    }

    /// The radar turns slowly, sees far, and sees what is not there.
    fn radar(&mut self, time: f64, clutter: usize) {
        let own = own_ship(time);
        let mut seen = Vec::new();
        for i in 0..self.boats.len() {
            let life = self.boats[i].life;
            if !(life[0]..=life[1]).contains(&time) {
                continue;
            }
            let ([x, y], _) = self.boats[i].at(time);
            let used = (self.dice.uniform() < 0.9).then(|| {
                let range = (x - own[0]).hypot(y - own[1]) + 4.0 * self.dice.normal();
                let bearing = (y - own[1]).atan2(x - own[0]) + 0.012 * self.dice.normal();
                let observation = Observation::Polar {
                    range: Some(range),
                    bearing,
                    range_rate: Some(self.dice.normal()),
                    z: None,
                };
                seen.push(self.detection(observation, Some(i)));
                self.next - 1
            });
            self.track(time, i, used);
        }
        for _ in 0..clutter {
            let bearing = PI * (2.0 * self.dice.uniform() - 1.0);
            let range = 700.0 * self.dice.uniform().sqrt();
            seen.push(self.detection(
                Observation::Polar { range: Some(range), bearing, range_rate: None, z: None },
                None,
            ));
        }
        self.scan(time, "radar", own, seen);
    }

    /// The lidar sees sharply, but not far.
    fn lidar(&mut self, time: f64) {
        let own = own_ship(time);
        let mut seen = Vec::new();
        for i in 0..self.boats.len() {
            let ([x, y], _) = self.boats[i].at(time);
            let near = (x - own[0]).hypot(y - own[1]) < 260.0;
            if near && (self.boats[i].life[0]..=self.boats[i].life[1]).contains(&time) {
                let (x, y) = (x + self.dice.normal(), y + self.dice.normal());
                seen.push(self.detection(Observation::Position { x, y, z: None }, Some(i)));
            }
        }
        self.scan(time, "lidar", own, seen);
    }

    fn detection(&mut self, observation: Observation, boat: Option<usize>) -> Detection {
        self.next += 1;
        let truth = boat.map(|i| self.boats[i].name.clone());
        Detection { truth, ..Detection::new(self.next - 1, observation) }
    }

    fn scan(&mut self, time: f64, sensor: &str, own: [f64; 2], detections: Vec<Detection>) {
        let position = Some([own[0], own[1], 0.0]);
        self.scene.detections.scans.push(Scan { position, ..Scan::new(time, sensor, detections) });
    }

    /// A track that follows its boat with the errors of a fair filter.
    fn track(&mut self, time: f64, i: usize, detection: Option<u64>) {
        let age = time - self.boats[i].life[0];
        let ([x, y], [vx, vy]) = self.boats[i].at(time);
        let sigma = 3.0 + 9.0 * (-age / 12.0).exp() + if detection.is_none() { 3.0 } else { 0.0 };
        let status = match detection {
            _ if age < 6.0 => Status::Tentative,
            Some(_) => Status::Confirmed,
            None => Status::Coasted,
        };
        let (ex, ey) = (0.5 * sigma * self.dice.normal(), 0.5 * sigma * self.dice.normal());
        let turning = (self.boats[i].turn.abs() * 400.0).min(0.9);
        self.scene.tracks.rows.push(Track {
            time,
            sensor: "radar".into(),
            track: i as u64 + 1,
            status,
            existence: 1.0 - 0.6 * (-age / 8.0).exp(),
            state: vec![x + ex, y + ey, vx, vy],
            covariance: covariance(sigma, y.atan2(x)),
            modes: vec![1.0 - turning, turning],
            extent: None,
            altitude: None,
            identity: None,
            detection,
        });
    }

    /// Short tracks that clutter started and nothing confirmed.
    fn clutter_tracks(&mut self, size: &Size) {
        for i in 0..3 * size.boats {
            let first = (self.dice.uniform() * size.scans as f64) as usize;
            let place = [800.0 * self.dice.uniform() - 400.0, 800.0 * self.dice.uniform() - 400.0];
            for k in first..(first + 4).min(size.scans) {
                let status = if k == first + 3 { Status::Deleted } else { Status::Tentative };
                let state = vec![place[0] + 2.0 * k as f64, place[1], 0.8, 0.0];
                self.scene.tracks.rows.push(Track {
                    time: k as f64 * 2.5,
                    sensor: "radar".into(),
                    track: (size.boats + i) as u64 + 1,
                    status,
                    existence: 0.3,
                    state,
                    covariance: covariance(14.0, 0.0),
                    modes: vec![0.5, 0.5],
                    extent: None,
                    altitude: None,
                    identity: None,
                    detection: None,
                });
            }
        }
    }
}

/// Upper triangle for a position that is known better along `direction` than across it.
fn covariance(sigma: f64, direction: f64) -> Vec<f64> {
    let (sine, cosine) = direction.sin_cos();
    let (p, q) = (sigma * sigma, 4.0 * sigma * sigma);
    let xx = p * cosine * cosine + q * sine * sine;
    let yy = p * sine * sine + q * cosine * cosine;
    vec![xx, (p - q) * sine * cosine, 0.0, 0.0, yy, 0.0, 0.0, 1.0, 0.0, 1.0]
}

/// A report of a scene, with the parts of a GOSPA that looks like one.
pub fn report(title: &str, scene: &Scene) -> Result<Report, ReportError> {
    let time: Vec<f64> =
        scene.detections.scans.iter().filter(|scan| &*scan.sensor == "radar").map(|scan| scan.time).collect();
    let part = |height: f64, pace: f64| -> Vec<f64> {
        time.iter().map(|t| (height * (1.2 + (t / pace).sin() + 4.0 * (-t / 20.0).exp())).max(0.0)).collect()
    };
    let gospa = Chart::over_time("GOSPA", "m", time.clone())
        .with_form(Form::Stacked)
        .with_part("localisation", part(3.0, 17.0))
        .with_part("missed", part(4.0, 31.0))
        .with_part("false", part(1.5, 11.0));
    let sensors = ["radar", "lidar"].map(|name| SensorNote { sensor: name.into(), ..SensorNote::default() });
    let picture = Picture::new(&scene.detections, &scene.tracks, Some(&scene.truths), &sensors)?;
    let noise: Vec<f64> = (1..=10).map(f64::from).collect();
    let sweep = Chart::over("Position error over the noise", "m", "Noise of the sensor, m", noise.clone())
        .with_part("measurement", noise.clone())
        .with_part("Kalman", noise.iter().map(|n| n.powf(0.7)).collect())
        .with_part("IMM", noise.iter().map(|n| n.powf(0.6)).collect());
    let count: usize = scene.detections.scans.iter().map(|scan| scan.detections.len()).sum();
    let summary = Summary::new()
        .with("Scans", scene.detections.scans.len().to_string(), None)
        .with("Detections", count.to_string(), None)
        .with("GOSPA", "9.84 m", Some("mean over scans; cut-off 20 m, order 2"))
        .with("Localisation", "3.61 m", None)
        .with("Missed", "4.80 m", None)
        .with("False", "1.80 m", None)
        .with("Identity switches", "2", Some("a track that went from one object to another"))
        .with("Speed", "8 214 scans/s", None);
    Ok(Report::new(title)
        .with_subtitle("Simulated harbour; radar and lidar on a moving ship; GNN, constant velocity")
        .with(summary)
        .with(picture.with_chart(gospa))
        .with(sweep))
}
