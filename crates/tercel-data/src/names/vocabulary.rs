//! Names by which other programs call the columns of the tables.

/// How sure it is that a name means a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Rank {
    /// Said by the user.
    Said,
    /// The name in the table, or one that means the same. Two of them are one too many.
    Sure,
    /// Taken where nothing better is there; the first in the list goes before the others.
    Likely(usize),
}

/// A column with names that mean the same, and names that may mean it.
type Entry = (&'static str, &'static [&'static str], &'static [&'static str]);

/// Columns of detections.
const DETECTIONS: [Entry; 18] = [
    (
        "time",
        &[],
        &[
            "timestamp",
            "datetime",
            "date_time",
            "time_utc",
            "utc",
            "utc_time",
            "date_time_utc",
            "base_date_time",
            "unix_time",
            "unix",
            "t_unix",
            "epoch",
            "epoch_time",
            "time_stamp",
            "stamp",
            "gps_time",
            "time_of_day",
            "tod",
            "t",
            "ts",
            "date",
        ],
    ),
    (
        "sensor",
        &[],
        &["sensor_name", "sensor_id", "radar", "radar_id", "receiver", "station", "site", "source"],
    ),
    ("scan", &[], &["scan_number", "scan_id", "scan_no", "sweep", "sweep_id", "frame", "frame_number"]),
    ("x", &["pos_x", "x_pos", "position_x", "x_position", "east", "easting", "x_east", "east_x", "px"], &[]),
    (
        "y",
        &["pos_y", "y_pos", "position_y", "y_position", "north", "northing", "y_north", "north_y", "py"],
        &[],
    ),
    (
        "z",
        &["pos_z", "z_pos", "position_z", "z_position", "up", "pz"],
        &[
            "geo_altitude",
            "geoaltitude",
            "alt_geom",
            "altitude",
            "alt",
            "height",
            "baro_altitude",
            "baroaltitude",
            "alt_baro",
            "flight_level",
            "fl",
        ],
    ),
    ("latitude", &["lat", "latitude_wgs84"], &[]),
    ("longitude", &["lon", "long", "lng", "longitude_wgs84"], &[]),
    ("range", &["rng", "slant_range", "rho", "distance", "dist"], &["r"]),
    (
        "bearing",
        &[
            "azimuth",
            "az",
            "azi",
            "azm",
            "brg",
            "theta",
            "true_bearing",
            "bearing_true",
            "compass_bearing",
            "compass",
        ],
        &[],
    ),
    (
        "range_rate",
        &[
            "rangerate",
            "rdot",
            "r_dot",
            "rr",
            "radial_velocity",
            "radial_speed",
            "radial_vel",
            "doppler_velocity",
            "doppler_speed",
            "vr",
            "v_r",
        ],
        &["doppler"],
    ),
    ("sigma_x", &["std_x", "x_std", "sd_x", "x_sd", "x_sigma"], &[]),
    ("sigma_y", &["std_y", "y_std", "sd_y", "y_sd", "y_sigma"], &[]),
    ("sigma_range", &["std_range", "range_std", "range_sigma", "sigma_r"], &[]),
    (
        "sigma_bearing",
        &[
            "std_bearing",
            "bearing_std",
            "bearing_sigma",
            "sigma_azimuth",
            "azimuth_std",
            "sigma_az",
            "std_azimuth",
        ],
        &[],
    ),
    ("sigma_range_rate", &["range_rate_std", "std_range_rate", "sigma_doppler", "doppler_std"], &[]),
    (
        "identity",
        &[],
        &[
            "mmsi",
            "icao24",
            "icao",
            "icao_address",
            "hex",
            "mode_s",
            "target_address",
            "aircraft_address",
            "track_id",
            "track_number",
            "track_no",
            "target_id",
            "callsign",
            "call_sign",
            "flight",
            "squawk",
            "mode_3a",
            "mode3a",
        ],
    ),
    ("truth", &["truth_id", "true_id", "gt_id", "ground_truth_id"], &[]),
];

/// Columns of tracks and of the truth, besides those that are detections' as well.
const OBJECTS: [Entry; 4] = [
    ("track", &["track_id", "track_number", "track_no"], &["id", "object_id", "target_id"]),
    ("object", &["object_id", "target_id"], &["id", "mmsi", "icao24", "name", "track_id", "target", "truth"]),
    ("vx", &["v_x", "vel_x", "velocity_x", "x_vel", "v_east", "ve"], &[]),
    ("vy", &["v_y", "vel_y", "velocity_y", "y_vel", "v_north", "vn"], &[]),
];

/// Columns of detections that tracks and the truth share.
const SHARED: [&str; 5] = ["time", "sensor", "x", "y", "z"];

/// The columns that a name in its plain form may mean in this table, with how sure that is.
pub(super) fn meanings(table: &str, plain: &str) -> Vec<(&'static str, Rank)> {
    let detections = DETECTIONS.iter().filter(|entry| table == "detections" || SHARED.contains(&entry.0));
    let objects = OBJECTS.iter().filter(|entry| match table {
        "tracks" => entry.0 != "object",
        "truth" => entry.0 != "track",
        _ => false,
    });
    detections
        .chain(objects)
        .filter_map(|(column, sure, likely)| {
            let rank = if *column == plain || sure.contains(&plain) {
                Rank::Sure
            } else {
                Rank::Likely(likely.iter().position(|name| *name == plain)?)
            };
            Some((*column, rank))
        })
        .collect()
}
