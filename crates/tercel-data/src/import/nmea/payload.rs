//! Messages of AIS in letters of six bits (ITU-R M.1371, annex 8).

/// What a message says, as far as it is about positions.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Message {
    /// Number of the kind of message, 1 to 27.
    pub kind: u8,
    pub mmsi: u32,
    pub position: Option<Position>,
}

/// A position report.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Position {
    /// Degrees.
    pub latitude: f64,
    /// Degrees.
    pub longitude: f64,
    /// m; aircraft only.
    pub altitude: Option<f64>,
    /// Knots; 102.3 stands for an unknown one.
    pub speed: Option<f64>,
    /// Degrees; 360 stands for an unknown one.
    pub course: Option<f64>,
    /// Second of the minute at which the position was taken.
    pub second: Option<u8>,
}

/// Where the parts of a position report begin, in bits.
struct Fields {
    speed: usize,
    longitude: usize,
    latitude: usize,
    course: usize,
    second: usize,
}

const CLASS_A: Fields = Fields { speed: 50, longitude: 61, latitude: 89, course: 116, second: 137 };
const CLASS_B: Fields = Fields { speed: 46, longitude: 57, latitude: 85, course: 112, second: 133 };
const AIRCRAFT: Fields = Fields { speed: 50, longitude: 61, latitude: 89, course: 116, second: 128 };

impl Message {
    /// Decodes a payload; nothing when it holds other letters than those of AIS, or is too short for its kind.
    pub fn decode(payload: &str) -> Option<Message> {
        let bits = Bits::new(payload)?;
        let (kind, mmsi) = (bits.unsigned(0, 6)? as u8, bits.unsigned(8, 30)?);
        let position = match kind {
            1..=3 => report(&bits, &CLASS_A, 0.1)?,
            18 | 19 => report(&bits, &CLASS_B, 0.1)?,
            9 => aircraft(&bits)?,
            27 => from_afar(&bits)?,
            4 | 11 => place(&bits, (79, 28), (107, 27), MINUTES)?.map(|place| at(place, None)),
            21 => place(&bits, (164, 28), (192, 27), MINUTES)?.map(|place| at(place, None)),
            0 | 28.. => return None,
            _ => None,
        };
        Some(Message { kind, mmsi, position })
    }
}

/// Parts of a degree in which most messages measure: ten-thousandths of a minute.
const MINUTES: f64 = 600_000.0;

fn at((latitude, longitude): (f64, f64), second: Option<u8>) -> Position {
    Position { latitude, longitude, altitude: None, speed: None, course: None, second }
}

fn report(bits: &Bits, fields: &Fields, knots: f64) -> Option<Option<Position>> {
    let second = bits.unsigned(fields.second, 6)? as u8;
    let speed = f64::from(bits.unsigned(fields.speed, 10)?);
    let course = f64::from(bits.unsigned(fields.course, 12)?);
    let place = place(bits, (fields.longitude, 28), (fields.latitude, 27), MINUTES)?;
    Some(place.map(|place| Position {
        speed: (speed < 1023.0).then_some(speed * knots),
        course: Some(course * 0.1),
        // 60 and above stand for an unknown one.
        ..at(place, Some(second).filter(|second| *second < 60))
    }))
}

fn aircraft(bits: &Bits) -> Option<Option<Position>> {
    const UNKNOWN: u32 = 4095;
    let altitude = bits.unsigned(38, 12)?;
    let position = report(bits, &AIRCRAFT, 1.0)?;
    let altitude = (altitude != UNKNOWN).then_some(f64::from(altitude));
    Some(position.map(|position| Position { altitude, ..position }))
}

/// Message 27, which satellites hear: in tenths of a minute, knots and degrees.
fn from_afar(bits: &Bits) -> Option<Option<Position>> {
    let (speed, course) = (bits.unsigned(79, 6)?, bits.unsigned(85, 9)?);
    let place = place(bits, (44, 18), (62, 17), 600.0)?;
    Some(place.map(|place| Position {
        speed: (speed < 63).then_some(f64::from(speed)),
        course: (course < 360).then_some(f64::from(course)),
        ..at(place, None)
    }))
}

/// Latitude and longitude in degrees, if both are known. Fields are their first bit and their length.
fn place(
    bits: &Bits,
    longitude: (usize, usize),
    latitude: (usize, usize),
    parts: f64,
) -> Option<Option<(f64, f64)>> {
    let degrees = |(from, length)| bits.signed(from, length).map(|value| f64::from(value) / parts);
    let (latitude, longitude) = (degrees(latitude)?, degrees(longitude)?);
    Some((latitude.abs() <= 90.0 && longitude.abs() <= 180.0).then_some((latitude, longitude)))
}

/// The bits of a payload, six in each letter.
struct Bits(Vec<u8>);

impl Bits {
    fn new(payload: &str) -> Option<Self> {
        let letter = |byte: u8| match byte {
            48..=87 => Some(byte - 48),
            96..=119 => Some(byte - 56),
            _ => None,
        };
        payload.bytes().map(letter).collect::<Option<Vec<u8>>>().map(Bits)
    }

    fn unsigned(&self, from: usize, length: usize) -> Option<u32> {
        (from..from + length).try_fold(0, |number, bit| {
            let letter = self.0.get(bit / 6)?;
            Some(number << 1 | u32::from(letter >> (5 - bit % 6) & 1))
        })
    }

    fn signed(&self, from: usize, length: usize) -> Option<i32> {
        let unused = 32 - length;
        self.unsigned(from, length).map(|number| (number << unused) as i32 >> unused)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Letters of the fields of a message: values with their lengths in bits.
    fn payload(fields: &[(i64, usize)]) -> String {
        let mut bits: Vec<u8> = Vec::new();
        for (value, length) in fields {
            bits.extend((0..*length).rev().map(|bit| (value >> bit & 1) as u8));
        }
        bits.resize(bits.len().div_ceil(6) * 6, 0);
        let letter = |six: &[u8]| six.iter().fold(0, |letter, bit| letter << 1 | bit);
        bits.chunks(6).map(letter).map(|six| char::from(if six < 40 { six + 48 } else { six + 56 })).collect()
    }

    const NORTH: i64 = 33_660_000;
    const EAST: i64 = -6_720_000;

    #[test]
    fn a_published_message_of_class_a_is_decoded() {
        let message = Message::decode("13@ne9OP1p0kA@0P6LH1hP01P000").unwrap();
        assert_eq!((message.kind, message.mmsi), (1, 219_000_101));
        let position = message.position.unwrap();
        assert!((position.latitude - 56.1).abs() < 1e-5 && (position.longitude - 11.2).abs() < 1e-5);
        assert_eq!((position.speed, position.course, position.second), (Some(12.0), Some(45.0), Some(0)));
    }

    #[test]
    fn positions_of_every_kind_of_message_are_decoded() {
        let class_a = payload(&[
            (3, 6),
            (0, 2),
            (219_000_101, 30),
            (0, 4),
            (0, 8),
            (123, 10),
            (1, 1),
            (EAST, 28),
            (NORTH, 27),
            (905, 12),
            (511, 9),
            (42, 6),
            (0, 25),
        ]);
        let class_b = payload(&[
            (18, 6),
            (0, 2),
            (219_000_101, 30),
            (0, 8),
            (123, 10),
            (1, 1),
            (EAST, 28),
            (NORTH, 27),
            (905, 12),
            (511, 9),
            (42, 6),
            (0, 29),
        ]);
        let aircraft = payload(&[
            (9, 6),
            (0, 2),
            (219_000_101, 30),
            (303, 12),
            (123, 10),
            (1, 1),
            (EAST, 28),
            (NORTH, 27),
            (905, 12),
            (42, 6),
            (0, 34),
        ]);
        let afar = payload(&[
            (27, 6),
            (0, 2),
            (219_000_101, 30),
            (1, 1),
            (0, 1),
            (0, 4),
            (EAST / 1000, 18),
            (NORTH / 1000, 17),
            (12, 6),
            (90, 9),
            (0, 2),
        ]);
        for (payload, altitude, speed, course, second) in [
            (&class_a, None, 12.3, 90.5, Some(42)),
            (&class_b, None, 12.3, 90.5, Some(42)),
            (&aircraft, Some(303.0), 123.0, 90.5, Some(42)),
            (&afar, None, 12.0, 90.0, None),
        ] {
            let message = Message::decode(payload).unwrap();
            let position = message.position.unwrap();
            assert_eq!((message.mmsi, position.altitude, position.second), (219_000_101, altitude, second));
            assert!((position.latitude - 56.1).abs() < 1e-9 && (position.longitude + 11.2).abs() < 1e-9);
            assert!(
                (position.speed.unwrap() - speed).abs() < 1e-9
                    && (position.course.unwrap() - course).abs() < 1e-9
            );
        }
        // Of every message all but the spare bits at the end are needed.
        assert_eq!(Message::decode(&class_a[..20]), None);
    }

    #[test]
    fn an_unknown_position_is_none() {
        let unknown = payload(&[
            (1, 6),
            (0, 2),
            (219_000_101, 30),
            (0, 4),
            (0, 8),
            (1023, 10),
            (0, 1),
            (181 * 600_000, 28),
            (91 * 600_000, 27),
            (3600, 12),
            (511, 9),
            (60, 6),
            (0, 25),
        ]);
        assert_eq!(Message::decode(&unknown).unwrap().position, None);
        assert_eq!(Message::decode("a message"), None);
    }
}
