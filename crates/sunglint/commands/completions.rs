//! `completions SHELL`

use std::process::ExitCode;

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Cli, Outcome, print};

/// Print completions for a shell
#[derive(Args)]
#[command(after_help = "Example:\n  sunglint completions bash > ~/.local/share/bash-completion/completions/sunglint")]
pub struct Completions {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    pub fn run(&self) -> Outcome {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "sunglint", &mut text);
        print(String::from_utf8_lossy(&text));
        Ok(ExitCode::SUCCESS)
    }
}
