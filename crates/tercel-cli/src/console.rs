//! What is said on standard error, and how.

use std::ffi::OsString;
use std::fmt::Display;
use std::io::IsTerminal;
use std::process::ExitCode;

use crate::failure::Failure;

/// When to use colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Color {
    /// On a terminal, unless NO_COLOR is set.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

impl Color {
    /// The choice as far as it can be told before the arguments are parsed, for the messages of the parser itself.
    pub fn from_arguments(arguments: impl Iterator<Item = OsString>) -> Color {
        let mut arguments = arguments.filter_map(|argument| argument.into_string().ok());
        let mut choice = Color::Auto;
        while let Some(argument) = arguments.next() {
            let value = match argument.strip_prefix("--color") {
                Some("") => arguments.next(),
                Some(value) => value.strip_prefix('=').map(str::to_owned),
                None if argument == "--" => break,
                None => None,
            };
            match value.as_deref() {
                Some("always") => choice = Color::Always,
                Some("never") => choice = Color::Never,
                _ => {}
            }
        }
        choice
    }
}

impl From<Color> for clap::ColorChoice {
    fn from(color: Color) -> Self {
        match color {
            Color::Auto => clap::ColorChoice::Auto,
            Color::Always => clap::ColorChoice::Always,
            Color::Never => clap::ColorChoice::Never,
        }
    }
}

/// Standard error, with the manners that the user chose.
#[derive(Debug, Clone, Copy)]
pub struct Console {
    quiet: bool,
    colored: bool,
    terminal: bool,
}

impl Console {
    /// Looks at the choices and at the terminal.
    pub fn new(color: Color, quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let set = |name| std::env::var_os(name).is_some_and(|value: OsString| !value.is_empty());
        let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        let colored = match color {
            Color::Auto => terminal && !set("NO_COLOR") && !dumb,
            Color::Always => true,
            Color::Never => false,
        };
        Console { quiet, colored, terminal }
    }

    /// Whether progress may be drawn.
    pub fn draws_progress(&self) -> bool {
        self.terminal && !self.quiet
    }

    /// Says what the user may want to know.
    pub fn note(&self, message: impl Display) {
        self.say("note", "36", message);
    }

    /// Says what the user should know.
    pub fn warn(&self, message: impl Display) {
        self.say("warning", "33", message);
    }

    /// Says in a line what those must know who asked for no notes; others have it from the notes and the summary.
    pub fn brief(&self, message: impl Display) {
        if self.quiet {
            eprintln!("{message}");
        }
    }

    /// Prints text as it is.
    pub fn text(&self, text: &str) {
        if !self.quiet {
            eprint!("{text}");
        }
    }

    /// Prints why the program ends, and gives its exit code.
    pub fn fail(&self, failure: &Failure) -> ExitCode {
        if let Some(report) = failure.report() {
            self.line("error", "31", &report.message);
            for cause in &report.causes {
                eprintln!("  caused by: {cause}");
            }
            if let Some(help) = &report.help {
                eprintln!("  {}: {help}", self.painted("help", "32"));
            }
        }
        failure.exit_code()
    }

    fn say(&self, label: &str, color: &str, message: impl Display) {
        if !self.quiet {
            self.line(label, color, message);
        }
    }

    fn line(&self, label: &str, color: &str, message: impl Display) {
        eprintln!("{}: {message}", self.painted(label, color));
    }

    fn painted(&self, text: &str, color: &str) -> String {
        if self.colored { format!("\x1b[1;{color}m{text}\x1b[0m") } else { text.to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choice(arguments: &[&str]) -> Color {
        Color::from_arguments(arguments.iter().map(OsString::from))
    }

    #[test]
    fn the_choice_is_found_wherever_it_stands_and_the_last_one_counts() {
        assert_eq!(choice(&["tercel", "track", "--color", "never"]), Color::Never);
        assert_eq!(choice(&["tercel", "--color=always", "track"]), Color::Always);
        assert_eq!(choice(&["tercel", "--color=always", "--color", "never"]), Color::Never);
    }

    #[test]
    fn what_is_no_choice_changes_nothing() {
        assert_eq!(choice(&["tercel", "--colors=never", "--color=blue"]), Color::Auto);
        assert_eq!(choice(&["tercel", "--", "--color=never"]), Color::Auto);
    }
}
