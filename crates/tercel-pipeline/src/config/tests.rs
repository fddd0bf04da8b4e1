use super::*;
use serde_json::Value;

const SMALL: &str = "
[motion]
constant_velocity = { acceleration_density = 1.0 }
[sensors.radar]
measures = { position = { deviation = 5.0 } }
clutter = { uniform = { density = 1e-6 } }
";

fn refusal(text: &str) -> String {
    Config::parse(text).unwrap_err().to_string()
}

#[test]
fn every_preset_is_a_configuration() {
    for name in presets::names() {
        let config = Config::parse(presets::get(name).unwrap());
        assert!(config.is_ok(), "{name}: {}", config.unwrap_err());
        assert!(crate::Pipeline::new(&config.unwrap()).is_ok(), "{name}");
    }
}

#[test]
fn a_configuration_survives_being_written() {
    for name in presets::names() {
        let config = Config::parse(presets::get(name).unwrap()).unwrap();
        assert_eq!(Config::parse(&config.to_toml()).unwrap(), config, "{name}");
    }
}

#[test]
fn an_unknown_key_is_named_with_its_line() {
    let message = refusal(&SMALL.replace("deviation", "deviaton"));
    assert!(message.contains("unknown field `deviaton`") && message.contains("line 5"), "{message}");
}

#[test]
fn none_or_two_motions_are_refused_in_plain_words() {
    let two = SMALL.replace("[sensors.radar]", "random_walk = { density = 1.0 }\n[sensors.radar]");
    let message = refusal(&two);
    assert!(
        message.contains("exactly one") && message.contains("constant_velocity, random_walk"),
        "{message}"
    );
    let none = SMALL.replace("constant_velocity = { acceleration_density = 1.0 }", "");
    assert!(refusal(&none).contains("it is empty"));
}

#[test]
fn a_value_out_of_range_is_named_with_its_range() {
    let message = refusal(&format!("{SMALL}detection = 1.5"));
    assert!(message.contains("probability"), "{message}");
    let message = refusal(&SMALL.replace("5.0", "-5.0"));
    assert!(message.contains("-5 is out of range: expected a finite number above 0"), "{message}");
    let message = refusal(&SMALL.replace("5.0", "nan"));
    assert!(message.contains("out of range"), "{message}");
}

#[test]
fn parts_that_do_not_fit_are_named_by_their_key() {
    let polar = "measures = { polar = { range_deviation = 5.0, bearing_deviation = 0.01 } }";
    let text = SMALL.replace("measures = { position = { deviation = 5.0 } }", polar);
    let message = refusal(&format!("{text}[filter]\nestimator = \"kalman\""));
    assert!(message.contains("`filter.estimator`") && message.contains("radar"), "{message}");
    let modes = "switching = { stay = 0.9, modes = [{ coordinated_turn = { acceleration_density = 1, rate_density = 1 } }, \
                 { singer = { time = 10, acceleration = 1 } }] }";
    let message = refusal(&SMALL.replace("constant_velocity = { acceleration_density = 1.0 }", modes));
    assert!(message.contains("`motion.switching.modes[0]`"), "{message}");
    let table = format!("{SMALL}detection = [[10.0, 0.9], [5.0, 0.1]]");
    assert!(refusal(&table).contains("must rise"));
    assert!(refusal("[motion]\nrandom_walk = { density = 1 }\n[sensors]").contains("`sensors`"));
}

/// Walks a schema and collects the properties that hold numbers, with the path to them.
fn numbers(schema: &Value, root: &Value, path: &str, found: &mut Vec<(String, Value)>) {
    let target = match schema.get("$ref").and_then(Value::as_str) {
        Some(reference) => root.pointer(&reference[1..]).unwrap_or(&Value::Null),
        None => schema,
    };
    if path.split('.').count() > 12 {
        return;
    }
    for list in ["oneOf", "anyOf", "allOf"] {
        for part in target.get(list).and_then(Value::as_array).into_iter().flatten() {
            numbers(part, root, path, found);
        }
    }
    if let Some(part) = target.get("additionalProperties").filter(|part| part.is_object()) {
        numbers(part, root, &format!("{path}.*"), found);
    }
    for (name, property) in target.get("properties").and_then(Value::as_object).into_iter().flatten() {
        let path = format!("{path}.{name}");
        let kinds = property.get("type").map(ToString::to_string).unwrap_or_default();
        if kinds.contains("number") || kinds.contains("integer") {
            let mut property = property.clone();
            // The sentence of a variant that is a single number stands at the variant.
            if let (None, Some(sentence)) = (property.get("description"), target.get("description")) {
                property["description"] = sentence.clone();
            }
            found.push((path.clone(), property));
        }
        // Modes hold motions, which hold modes: once is enough.
        if !path.ends_with(".modes") {
            numbers(property, root, &path, found);
        }
    }
}

#[test]
fn every_default_is_that_of_the_library() {
    use tercel_core::multi;
    // Of equal gates the limits may differ in the last digits, since a constant holds those of the default.
    macro_rules! same {
        ($name:ident) => {
            let (mut built, library) = ($name::default().build().unwrap(), multi::$name::default());
            assert_eq!(built.gate.probability(), library.gate.probability());
            built.gate = library.gate;
            assert_eq!(built, library);
        };
    }
    same!(NearestNeighbourConfig);
    same!(JpdaConfig);
    same!(PhdConfig);
    same!(MultiBernoulliConfig);
    same!(PmbmConfig);
}

#[test]
fn a_table_that_is_not_complete_is_filled_from_its_own_tracker() {
    for tracker in ["nearest_neighbour", "jpda", "phd", "multi_bernoulli", "pmbm"] {
        let whole = Config::parse(&format!("{SMALL}[tracker.{tracker}]\n")).unwrap();
        let mut part =
            Config::parse(&format!("{SMALL}[tracker.{tracker}.management]\nmax_misses = 77\n")).unwrap();
        assert_eq!(part.tracker.management().max_misses, 77);
        let misses = whole.tracker.management().max_misses;
        let text = part.to_toml().replace("max_misses = 77", &format!("max_misses = {misses}"));
        part = Config::parse(&text).unwrap();
        assert_eq!(part, whole, "{tracker}");
    }
}

#[test]
fn the_schema_tells_the_default_of_each_tracker() {
    let schema = Config::schema();
    let default = |tracker: &str, key: &str| {
        schema
            .pointer(&format!("/$defs/{tracker}/properties/management/default/{key}"))
            .and_then(Value::as_f64)
    };
    assert_eq!(default("PmbmConfig", "min_existence"), Some(1e-4));
    assert_eq!(default("PhdConfig", "max_misses"), Some(2.0));
    assert_eq!(default("PhdConfig", "confirm/hits/scans"), Some(4.0));
    assert_eq!(default("JpdaConfig", "confirm/existence"), Some(0.95));
}

#[test]
fn keys_without_an_effect_are_refused() {
    let cases = [
        ("[input]\ndelay = 2.0", "input.delay"),
        ("[filter]\nseed = 3", "filter.seed"),
        ("[filter]\nparticles = 300", "filter.particles"),
        ("[tracker.jpda]\nbirth = 0.01", "tracker.jpda.management.min_existence"),
        ("[tracker.multi_bernoulli]\nprune = 0.1", "tracker.multi_bernoulli.prune"),
        ("[tracker.phd.management]\nconfirm = { hits = { hits = 4, scans = 3 } }", "confirm.hits"),
        ("[tracker.phd.management]\nconfirm = { hits = { hits = 4, scans = 70 } }", "confirm.hits"),
    ];
    for (text, key) in cases {
        let message = refusal(&format!("{SMALL}{text}\n"));
        assert!(message.contains(key), "{text}: {message}");
    }
    let bearing = "{ bearing = { deviation = 0.01, start_range_deviation = 5.0 } }";
    let message = refusal(&SMALL.replace("{ position = { deviation = 5.0 } }", bearing));
    assert!(message.contains("start_range_deviation") && message.contains("needs start_range"), "{message}");
}

#[test]
fn every_number_has_a_unit_a_range_and_a_sentence() {
    let schema = Config::schema();
    let mut found = Vec::new();
    numbers(&schema, &schema, "", &mut found);
    assert!(found.len() > 40, "{}", found.len());
    for (path, property) in found {
        let has = |key: &str| property.get(key).is_some();
        let described = property.get("description").and_then(Value::as_str).unwrap_or_default();
        assert!(described.ends_with('.') || described.ends_with(')'), "{path} has no sentence: {described}");
        assert!(has("x-unit"), "{path} has no unit");
        // A turn rate may be any number; its description says so.
        let ranged = has("minimum") || has("exclusiveMinimum") || described.contains("Any finite number");
        assert!(ranged, "{path} has no range");
    }
}
