//! The commands, one file each.

mod check;
mod completions;
mod explain;
mod models;
mod new;
mod plan;
mod render;
mod sun;

use std::fmt;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use sunglint::{Diagnostic, Options, Plan, Refused, Severity, Sources};

/// Radiometrically correct synthetic images of outdoor scenes, 0.4–1.0 µm.
#[derive(Parser)]
#[command(
    name = "sunglint",
    version,
    about,
    after_help = "\
Example:
  sunglint new meadow && sunglint render meadow/meadow.glint -o out

Exit codes: 0 done, 1 something differs, 2 bad input, 3 could not finish"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Say nothing but errors and what was asked for
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Threads to use [default: all cores]
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
}

#[derive(Subcommand)]
enum Command {
    New(new::New),
    Check(check::Check),
    Plan(plan::PlanScene),
    Render(render::Render),
    Explain(explain::Explain),
    Sun(sun::Sun),
    Models(models::Models),
    Completions(completions::Completions),
}

/// Why a command ends without doing what was asked.
enum Failure {
    /// The scene does not run; the diagnostics say why.
    Refused(Box<Refused>),
    /// Other bad input.
    BadInput(String),
    /// Writing failed, or the user stopped.
    Unfinished(String),
}

impl From<Refused> for Failure {
    fn from(refused: Refused) -> Self {
        Self::Refused(Box::new(refused))
    }
}

type Outcome = Result<ExitCode, Failure>;

/// Parses the command line and runs the command.
pub fn run() -> ExitCode {
    let cli = Cli::parse();
    if let Some(threads) = cli.threads {
        // Only the first call can fail, and this is it.
        let _ = sunglint_threads(threads);
    }
    let quiet = cli.quiet;
    let outcome = match cli.command {
        Command::New(command) => command.run(quiet),
        Command::Check(command) => command.run(quiet),
        Command::Plan(command) => command.run(quiet),
        Command::Render(command) => command.run(quiet),
        Command::Explain(command) => command.run(quiet),
        Command::Sun(command) => command.run(),
        Command::Models(command) => command.run(),
        Command::Completions(command) => command.run(),
    };
    match outcome {
        Ok(code) => code,
        Err(Failure::Refused(refused)) => {
            report(&refused.diagnostics, &refused.sources);
            let errors = refused.diagnostics.iter().filter(|d| d.severity == Severity::Error).count();
            note(&format!("error: {errors} error{} in the scene", if errors == 1 { "" } else { "s" }));
            ExitCode::from(2)
        }
        Err(Failure::BadInput(message)) => {
            note(&format!("error: {message}"));
            ExitCode::from(2)
        }
        Err(Failure::Unfinished(message)) => {
            note(&format!("error: {message}"));
            ExitCode::from(3)
        }
    }
}

fn sunglint_threads(threads: usize) -> Result<(), rayon::ThreadPoolBuildError> {
    rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build_global()
}

/// A line on the error stream; a closed stream is no fault.
fn note(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Text on the output stream; a reader that has gone is no fault.
fn print(text: impl fmt::Display) {
    let _ = write!(std::io::stdout(), "{text}");
}

fn print_json(value: &serde_json::Value) {
    print(format_args!("{value:#}\n"));
}

fn report(diagnostics: &[Diagnostic], sources: &Sources) {
    let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let text = sunglint::render_diagnostics(diagnostics, sources, color);
    let _ = write!(std::io::stderr(), "{text}");
}

/// Which warnings end a command.
#[derive(Args, Default)]
struct Deny {
    /// Treat warnings of this code as errors, or all `warnings`; may be said more than once
    #[arg(long, value_name = "CODE|warnings", value_parser = parse_code)]
    deny: Vec<String>,
}

impl Deny {
    /// Makes errors of the warnings that are denied.
    fn raise(&self, diagnostics: &mut [Diagnostic]) {
        for diagnostic in diagnostics {
            if self.deny.iter().any(|code| code == "warnings" || code == diagnostic.code) {
                diagnostic.severity = Severity::Error;
            }
        }
    }
}

/// `T03`, `t03` or `warnings`
fn parse_code(text: &str) -> Result<String, String> {
    let code = text.to_ascii_uppercase();
    match text {
        "warnings" => Ok(text.to_string()),
        _ if sunglint::dsl::CODES.contains(&code.as_str()) => Ok(code),
        _ => Err("write `warnings`, or a code such as T03; docs/DIAGNOSTICS.md lists them".to_string()),
    }
}

/// Reads, checks and binds a scene; warnings are shown unless quiet, and end the command where they are denied.
fn plan_of(scene: &Path, options: &Options, deny: &Deny, quiet: bool) -> Result<Plan, Failure> {
    let planned = sunglint::open(scene).and_then(|checked| Plan::new(checked, options));
    let plan = match planned {
        Ok(mut plan) => {
            deny.raise(&mut plan.warnings);
            if plan.warnings.iter().any(|d| d.severity == Severity::Error) {
                return Err(Refused { sources: plan.sources, diagnostics: plan.warnings }.into());
            }
            plan
        }
        Err(mut refused) => {
            deny.raise(&mut refused.diagnostics);
            return Err(refused.into());
        }
    };
    if !quiet {
        report(&plan.warnings, &plan.sources);
    }
    Ok(plan)
}

/// `640x480`
fn parse_pixels(text: &str) -> Result<(u32, u32), String> {
    let parts =
        text.split_once(['x', 'X', ',']).and_then(|(w, h)| Some((w.trim().parse().ok()?, h.trim().parse().ok()?)));
    match parts {
        Some((w, h)) if (1..=65_536).contains(&w) && (1..=65_536).contains(&h) => Ok((w, h)),
        _ => Err("write WIDTHxHEIGHT, each 1 to 65536, for example 320x240".to_string()),
    }
}
