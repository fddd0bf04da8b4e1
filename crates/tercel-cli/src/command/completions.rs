//! `tercel completions`.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::arguments::Cli;
use crate::failure::Failure;
use crate::output::print;

/// Print the completions of a shell.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER)]
pub struct CompletionsArguments {
    /// The shell.
    shell: Shell,
}

const AFTER: &str = "\
Examples:
  tercel completions bash > ~/.local/share/bash-completion/completions/tercel
  tercel completions zsh > ~/.zfunc/_tercel
  tercel completions fish > ~/.config/fish/completions/tercel.fish";

impl CompletionsArguments {
    /// Prints the script.
    pub fn run(&self) -> Result<(), Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "tercel", &mut script);
        print(&String::from_utf8_lossy(&script))
    }
}
