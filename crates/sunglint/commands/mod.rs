//! The commands, one file each.

mod atmosphere;
mod bench;
mod check;
mod column;
mod compare;
mod completions;
mod explain;
mod fit;
mod fit_model;
mod fmt;
mod goniometer;
mod materials;
mod models;
mod new;
mod plan;
mod reflectance;
mod render;
mod sun;
mod test;

use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use sunglint::inspection::InspectionError;
use sunglint::plot::{Format, Picture};
use sunglint::plugin::Column;
use sunglint::radiometry::{Dimension, unit, units_of};
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
    Fmt(fmt::Fmt),
    Plan(plan::PlanScene),
    Render(render::Render),
    Explain(explain::Explain),
    Sun(sun::Sun),
    Atmosphere(Box<atmosphere::Atmosphere>),
    Reflectance(reflectance::Reflectance),
    Goniometer(goniometer::Goniometer),
    Fit(fit::Fit),
    Materials(materials::Materials),
    Test(test::Test),
    Compare(compare::Compare),
    Bench(bench::Bench),
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

impl From<InspectionError> for Failure {
    fn from(error: InspectionError) -> Self {
        match error {
            InspectionError::Refused(refused) => Self::Refused(refused),
            InspectionError::Input(message) => Self::BadInput(message),
        }
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
        Command::Fmt(command) => command.run(quiet),
        Command::Plan(command) => command.run(quiet),
        Command::Render(command) => command.run(quiet),
        Command::Explain(command) => command.run(quiet),
        Command::Sun(command) => command.run(),
        Command::Atmosphere(command) => command.run(quiet),
        Command::Reflectance(command) => command.run(quiet),
        Command::Goniometer(command) => command.run(quiet),
        Command::Fit(command) => command.run(quiet),
        Command::Materials(command) => command.run(quiet),
        Command::Test(command) => command.run(quiet),
        Command::Compare(command) => command.run(quiet),
        Command::Bench(command) => command.run(quiet),
        Command::Models(command) => command.run(),
        Command::Completions(command) => command.run(),
    };
    match outcome {
        Ok(code) => code,
        Err(Failure::Refused(refused)) => {
            report(&refused.diagnostics, &refused.sources);
            let errors = refused.diagnostics.iter().filter(|d| d.severity == Severity::Error).count();
            let first = refused.sources.iter().next();
            let of_flags = first.is_some_and(|main| main.path == column::COMMAND_LINE);
            let place = if of_flags { "on the command line" } else { "in the scene" };
            note(&format!("error: {errors} error{} {place}", if errors == 1 { "" } else { "s" }));
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
fn print(text: impl Display) {
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
    planned(sunglint::open(scene).and_then(|checked| Plan::new(checked, options)), deny, quiet)
}

/// A plan whose warnings are shown unless quiet, and end the command where they are denied.
fn planned(planned: Result<Plan, Refused>, deny: &Deny, quiet: bool) -> Result<Plan, Failure> {
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

/// Part of what a scene asks for.
#[derive(Args)]
struct Only {
    /// Part of it: experiment, sensor, time, band, crop=X,Y,WxH or scale=F; repeat for more
    #[arg(long, value_name = "KEY=VALUE")]
    only: Vec<String>,
    /// Pixels in place of every sensor's own: the same view, coarser or finer
    #[arg(long, value_name = "WxH", value_parser = parse_pixels)]
    pixels: Option<(u32, u32)>,
}

impl Only {
    /// Options that keep the named part.
    fn options(&self) -> Result<Options, Failure> {
        let mut options = Options { pixels: self.pixels, ..Options::default() };
        for text in &self.only {
            options.narrow(text).map_err(|message| Failure::BadInput(format!("--only {text}: {message}")))?;
        }
        if options.pixels.is_some() && options.scale.is_some() {
            return Err(Failure::BadInput("--pixels and --only scale=… both set the pixels; say one".into()));
        }
        Ok(options)
    }
}

/// The text of a table, of 64 MiB at most.
fn read_text(path: &Path) -> Result<String, Failure> {
    const LARGEST: u64 = 64 << 20;
    let bad = |message: String| Failure::BadInput(format!("{}: {message}", path.display()));
    let size = std::fs::metadata(path).map_err(|error| bad(error.to_string()))?.len();
    if size > LARGEST {
        return Err(bad(format!("{size} bytes; at most {LARGEST} are read")));
    }
    let bytes = std::fs::read(path).map_err(|error| bad(error.to_string()))?;
    String::from_utf8(bytes).map_err(|_| bad("this is no UTF-8 text".into()))
}

/// Rows of numbers from a CSV file, in canonical units.
fn read_rows(path: &Path, columns: &'static [Column]) -> Result<Vec<Vec<f64>>, Failure> {
    let text = read_text(path)?;
    let table = sunglint::dsl::table::read_table(&text, columns).map_err(|error| {
        let help = error.help.as_ref().map_or(String::new(), |help| format!("; {help}"));
        Failure::BadInput(format!("{}: {error}{help}", path.display()))
    })?;
    Ok(table.rows)
}

/// A number with its unit, in canonical units: `1.9 msr`, `1 %`. A fraction needs no unit, an angle without one is in
/// degrees.
fn parse_quantity(text: &str, of: Dimension) -> Result<f64, String> {
    let text = text.trim();
    let end = text.find(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c))).unwrap_or(text.len());
    let (number, name) = (&text[..end], text[end..].trim());
    let value: f64 = number.parse().ok().filter(|value: &f64| value.is_finite()).ok_or("this is no number")?;
    let units = || units_of(of).map(|unit| unit.name).collect::<Vec<_>>().join(", ");
    match (name, of) {
        ("", Dimension::Fraction) => Ok(value),
        ("", Dimension::Angle) => Ok(value.to_radians()),
        ("", _) => Err(format!("write the unit, one of {}", units())),
        (name, _) => match unit(name, of) {
            Some(unit) => Ok(value * unit.factor + unit.offset),
            None => Err(format!("`{name}` is no unit of {}; there are {}", of.noun(), units())),
        },
    }
}

/// Writes pictures, all of whose formats were looked at before.
fn write_pictures(pictures: &[(&Path, Picture)], quiet: bool) -> Result<(), Failure> {
    for (path, picture) in pictures {
        picture.write(path).map_err(|error| Failure::Unfinished(error.to_string()))?;
        if !quiet {
            note(&format!("wrote {}", path.display()));
        }
    }
    Ok(())
}

/// A file of a plot: `.svg` or `.png`.
fn parse_plot(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    Format::of(&path)?;
    Ok(path)
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
