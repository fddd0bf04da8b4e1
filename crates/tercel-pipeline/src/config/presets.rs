//! Configurations to start from.

/// Name and text of each preset.
const PRESETS: [(&str, &str); 9] = [
    ("default", include_str!("../../presets/default.toml")),
    ("harbour", include_str!("../../presets/harbour.toml")),
    ("harbour-phd", include_str!("../../presets/harbour_phd.toml")),
    ("harbour-pmbm", include_str!("../../presets/harbour_pmbm.toml")),
    ("harbour-learned", include_str!("../../presets/harbour_learned.toml")),
    ("air-surveillance", include_str!("../../presets/air_surveillance.toml")),
    ("air-traffic", include_str!("../../presets/air_traffic.toml")),
    ("adsb", include_str!("../../presets/adsb.toml")),
    ("ais", include_str!("../../presets/ais.toml")),
];

/// Names of the presets, the default one first.
pub fn names() -> impl Iterator<Item = &'static str> {
    PRESETS.iter().map(|preset| preset.0)
}

/// The text of a preset, with comments.
///
/// ```
/// use tercel_pipeline::{Config, config::presets};
///
/// let text = presets::get("harbour").expect("a preset of that name");
/// assert!(Config::parse(text).is_ok());
/// ```
pub fn get(name: &str) -> Option<&'static str> {
    PRESETS.iter().find(|preset| preset.0 == name).map(|preset| preset.1)
}
