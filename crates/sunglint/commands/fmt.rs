//! `fmt FILE…`: one layout for all scenes.

use std::fs;
use std::io::Read;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::{Failure, Outcome, note, print, report};

/// Lay scenes out: indentation, line breaks, commas and blanks, nothing else
#[derive(Args)]
#[command(after_help = "\
A file with a fault of shape is left as it is.

Examples:
  sunglint fmt meadow/meadow.glint
  sunglint fmt --check examples/truth/*.glint
  sunglint fmt - < draft.glint > scene.glint")]
pub struct Fmt {
    /// Scenes, changed in place; `-` reads the input stream and writes the output stream
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Change nothing: name the files that would change, and exit with 1 if there are any
    #[arg(long, conflicts_with = "stdout")]
    check: bool,
    /// Write to the output stream instead of the files
    #[arg(long)]
    stdout: bool,
}

impl Fmt {
    pub fn run(&self, quiet: bool) -> Outcome {
        let (mut refused, mut differs) = (false, false);
        for path in &self.files {
            let stream = path.as_os_str() == "-";
            let name = if stream { "<input>".to_string() } else { path.display().to_string() };
            let read = if stream {
                let mut bytes = Vec::new();
                std::io::stdin().read_to_end(&mut bytes).map(|_| bytes)
            } else {
                fs::read(path)
            };
            let bytes = match read {
                Ok(bytes) => bytes,
                Err(error) => {
                    note(&format!("error: `{name}` is not readable: {error}"));
                    refused = true;
                    continue;
                }
            };
            let text = match sunglint::format(&name, &bytes) {
                Ok(text) => text,
                Err(faults) => {
                    report(&faults.diagnostics, &faults.sources);
                    refused = true;
                    continue;
                }
            };
            let changed = text.as_bytes() != bytes;
            if self.check {
                differs |= changed;
                if changed {
                    print(format_args!("{name}\n"));
                }
            } else if stream || self.stdout {
                print(text);
            } else if changed {
                let failed = |error| Failure::Unfinished(format!("writing `{name}`: {error}"));
                sunglint::replace_file(path, text.as_bytes()).map_err(failed)?;
                if !quiet {
                    note(&format!("laid out {name}"));
                }
            }
        }
        Ok(match (refused, differs) {
            (true, _) => ExitCode::from(2),
            (_, true) => ExitCode::from(1),
            _ => ExitCode::SUCCESS,
        })
    }
}
