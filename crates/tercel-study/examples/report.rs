//! Writes a report of a made-up harbour: `cargo run -p tercel-study --example report -- report.html [--large]`.

#[path = "../tests/support/scene.rs"]
#[allow(missing_docs)]
mod scene;

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let path = arguments.iter().find(|argument| !argument.starts_with("--"));
    let path = path.map_or("report.html", String::as_str);
    let size = match arguments.iter().any(|argument| argument == "--large") {
        true => scene::Size { boats: 75, scans: 200, clutter: 40 },
        false => scene::Size { boats: 7, scans: 120, clutter: 12 },
    };
    scene::report("Harbour, crossing boats", &scene::scene(&size))?.write(path)?;
    println!("{path}");
    Ok(())
}
