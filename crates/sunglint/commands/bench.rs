//! `bench SCENE`: what each treatment costs, and how wrong it is.

use std::fmt::Write as _;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sunglint::{
    Bench as Found, BenchError, BenchOptions, BenchProgress, BenchRuns, Errors, Part, Plan, ReferenceGoal, Setting,
};

use super::compare::parse_percent;
use super::{Deny, Failure, Only, Outcome, note, planned, print, print_json};

/// A reference's error where nothing is said.
const REFERENCE_ERROR: f64 = 1e-3;
/// Then it has at most this many times the samples of the finest setting, which leave it a quarter of that one's noise.
const REFERENCE_SHARE: u32 = 16;
/// Most samples a pixel of a reference under an error that was asked for.
const MOST_SAMPLES: u32 = 65_536;
/// Most samples a pixel of a reference that can be said.
const MOST_SAID: u32 = 1 << 20;

/// Run time against error: what each treatment costs, and how wrong it is
#[derive(Args)]
#[command(after_help = "\
Examples:
  sunglint bench examples/study/study.glint --only experiment=flight --only scale=0.5 -o out/bench
  sunglint bench site.glint --samples 16,256 --reference exact --reference-error 0.05%

Each experiment is rendered with each number of samples in place of its own accuracy, and held against a converged \
reference: the same models, air, sensor and times under the exact integral, with seeds of its own. Under --reference E all \
are held against the reference of experiment E, and differences of reflectance models count too.

Errors are those of radiance in per cent of the reference, or of 1 % of the band's mean where that is more. RMSE is the \
whole error, the noise of the image included and that of the reference taken off; its systematic part is what more samples \
leave (`<` where only a bound stands out of the noise). The percentile and the worst pixel (x,y of the whole view) hold the \
noise. Where the reference's standard error is not below a third of an error, that error is not judged. Cost is processor \
time of all threads to render all frames, the least of three where that is short; the air is solved before. `*` marks the Pareto front: nothing that costs less \
errs less.

References are kept in NAME.reference beside the scene under a hash of everything that they depend on, reused where they are \
good enough, and made better where more is asked. Without --reference-error or --reference-samples they go to 0.1 %, with at \
most 16 times the samples of the finest setting. -o writes bench.csv, bench.json, bench.svg and bench.png.

Exit codes: 0 done, also where something is not judged; 2 bad input; 3 could not write")]
pub struct Bench {
    /// The scene
    scene: PathBuf,
    #[command(flatten)]
    part: Only,
    /// Samples a pixel of the settings, in sixteens
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "16,64,256",
          value_parser = clap::value_parser!(u32).range(1..=65_536))]
    samples: Vec<u32>,
    /// Samples a pixel at which approximations are changed one by one [default: the most of --samples]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536))]
    single: Option<u32>,
    /// Do not change approximations one by one
    #[arg(long, conflicts_with = "single")]
    no_single: bool,
    /// Experiment whose reference judges all [default: each its own]
    #[arg(long, value_name = "EXPERIMENT")]
    reference: Option<String>,
    /// Standard error of references, in per cent of a pixel: 0.05%, with at most 65536 samples
    #[arg(long, value_name = "X%", value_parser = parse_error)]
    reference_error: Option<f64>,
    /// Samples a pixel of references
    #[arg(long, value_name = "N", conflicts_with = "reference_error",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SAID)))]
    reference_samples: Option<u32>,
    /// Folder in which references are kept [default: NAME.reference beside the scene]
    #[arg(long, value_name = "DIR")]
    references: Option<PathBuf>,
    /// Folder to write table and plots to
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// As JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    deny: Deny,
}

/// `0.05%`, above 0.
fn parse_error(text: &str) -> Result<f64, String> {
    parse_percent(text).and_then(|error| match error > 0.0 {
        true => Ok(error),
        false => Err("no image of samples has an error of 0; write for example 0.05%".into()),
    })
}

impl Bench {
    pub fn run(&self, quiet: bool) -> Outcome {
        let how = self.how();
        let mut options = self.part.options()?;
        let mut checked = sunglint::open(&self.scene)?;
        let beside = BenchRuns::add(&mut checked, &mut options, &how).map_err(failure)?;
        let plan = planned(Plan::new(checked, &options), &self.deny, quiet)?;
        let found = sunglint::bench(&plan, &beside, &how, &Bar::new(quiet)).map_err(failure)?;
        if let Some(folder) = &self.out {
            let write = |name: &str, bytes: &[u8]| {
                sunglint::write_whole(&folder.join(name), |out| std::io::Write::write_all(out, bytes))
            };
            let picture = found.picture();
            write("bench.csv", found.to_csv().as_bytes())
                .and_then(|()| write("bench.json", format!("{:#}\n", found.to_json()).as_bytes()))
                .and_then(|()| picture.write(&folder.join("bench.svg")))
                .and_then(|()| picture.write(&folder.join("bench.png")))
                .map_err(|error| Failure::Unfinished(error.to_string()))?;
        }
        if self.json {
            print_json(&found.to_json());
        } else {
            print(text(&found));
        }
        if !quiet {
            advise(&found);
            if let Some(folder) = &self.out {
                note(&format!("wrote bench.csv, bench.json, bench.svg and bench.png to {}", folder.display()));
            }
        }
        Ok(ExitCode::SUCCESS)
    }

    fn how(&self) -> BenchOptions {
        let whole = |n: u32| n.next_multiple_of(16);
        let single = self.single.map(whole);
        let mut samples: Vec<u32> = self.samples.iter().map(|n| whole(*n)).chain(single).collect();
        samples.sort_unstable();
        samples.dedup();
        let most = samples.last().copied().unwrap_or(16);
        let goal = match (self.reference_samples, self.reference_error) {
            (Some(samples), _) => ReferenceGoal::Samples(samples),
            (None, Some(relative)) => ReferenceGoal::Error { relative, most: MOST_SAMPLES },
            (None, None) => ReferenceGoal::Error { relative: REFERENCE_ERROR, most: REFERENCE_SHARE * most },
        };
        let references = self.references.clone().unwrap_or_else(|| self.scene.with_extension("reference"));
        let single = (!self.no_single).then(|| single.unwrap_or(most));
        BenchOptions { samples, single, goal, against: self.reference.clone(), references }
    }
}

fn failure(error: BenchError) -> Failure {
    match error {
        BenchError::Input(message) => Failure::BadInput(message),
        error => Failure::Unfinished(error.to_string()),
    }
}

/// Says what references lack.
fn advise(found: &Found) {
    for (reference, samples) in found.due() {
        let of = format!("{}/{}", reference.experiment, reference.sensor);
        let has = reference.samples;
        if samples > u64::from(MOST_SAID) {
            note(&format!(
                "note: some errors are below what the reference of {of} can tell (±{} % with {has} samples a pixel)",
                percent(reference.error)
            ));
        } else {
            note(&format!(
                "note: to judge all errors, the reference of {of} needs {} more samples a pixel: --reference-samples {samples}",
                samples.saturating_sub(u64::from(has)),
            ));
        }
    }
}

/// Three significant digits of a fraction in per cent.
fn percent(fraction: f64) -> String {
    let value = 100.0 * fraction;
    let size = value.abs();
    if size < 1e-5 {
        return "0".into();
    }
    let decimals = (2 - size.log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.decimals$}")
}

fn signed(fraction: f64) -> String {
    let text = percent(fraction);
    if fraction > 0.0 && text != "0" { format!("+{text}") } else { text }
}

fn seconds(value: f64) -> String {
    let decimals = (2 - value.max(1e-3).log10().floor() as i32).clamp(0, 5) as usize;
    format!("{value:.decimals$}")
}

fn systematic(errors: &Errors) -> String {
    errors.systematic().map_or_else(|| format!("<{}", percent(errors.systematic_below())), percent)
}

const ERRORS: &str = "  RMSE %  system. %  noise %    bias %     p99 %   worst %      at x,y";

/// The columns of errors.
fn columns(errors: &Errors) -> String {
    if errors.n == 0 {
        return "  dark: no pixel to judge".into();
    }
    if !errors.is_judged() {
        return format!("  not judged: reference ±{} %", percent(errors.reference_error));
    }
    let worst = errors.worst.map(|worst| (signed(worst.error), format!("{},{}", worst.x, worst.y)));
    let (worst, at) = worst.unwrap_or(("-".into(), "-".into()));
    format!(
        "{:>8} {:>10} {:>8} {:>9} {:>9} {:>9} {:>11}",
        percent(errors.rmse),
        systematic(errors),
        percent(errors.noise),
        signed(errors.bias),
        percent(errors.p99),
        worst,
        at
    )
}

/// Width of a column of names, its head among them.
fn width<'n>(names: impl Iterator<Item = &'n str>) -> usize {
    names.map(|name| name.chars().count()).max().unwrap_or(0)
}

fn text(found: &Found) -> String {
    let mut out = format!("references by {}\n", Found::exact());
    for reference in &found.references {
        let how = match reference.samples_rendered {
            0 => "kept from before".to_string(),
            n if n == reference.samples => "rendered now".to_string(),
            n => format!("{n} of them now"),
        };
        let _ = writeln!(
            out,
            "  {}/{}: {} samples a pixel, {how}; standard error {} % ({})",
            reference.experiment,
            reference.sensor,
            reference.samples,
            percent(reference.error),
            reference.file.display()
        );
    }
    for sensor in found.sensors() {
        let of: Vec<&Setting> = found.settings.iter().filter(|setting| setting.sensor == sensor).collect();
        let _ = write!(out, "\nsensor {sensor}\n{}{}{}", ladder(&of), materials(&of), changes(&of));
    }
    out
}

/// Every setting, over all bands and band by band.
fn ladder(of: &[&Setting]) -> String {
    let settings = || of.iter().filter(|setting| setting.change.is_none());
    let names = width(settings().map(|setting| setting.experiment.as_str()).chain(["experiment"]));
    let bands = settings().flat_map(|setting| setting.told()).filter_map(|part| part.band.as_deref());
    let bands = width(bands.chain(["band"]));
    let mut out =
        format!("{:names$}  samples     CPU s    10^6 rays  front  {:bands$}{ERRORS}\n", "experiment", "band");
    for setting in settings() {
        let parts: Vec<&Part> = setting.told().filter(|part| part.material.is_none()).collect();
        // One band is all bands.
        let shown = if parts.len() == 2 { &parts[1..] } else { &parts[..] };
        for (i, part) in shown.iter().enumerate() {
            let band = part.band.as_deref().unwrap_or("all");
            let head = match i {
                0 => format!(
                    "{:names$} {:>8} {:>9} {:>12.3}  {:^5}",
                    setting.experiment,
                    setting.samples,
                    seconds(setting.cpu_s),
                    setting.rays as f64 / 1e6,
                    if setting.on_front { "*" } else { "" }
                ),
                _ => " ".repeat(names + 39),
            };
            let _ = writeln!(out, "{head}  {band:bands$}{}", columns(&part.errors));
        }
    }
    out
}

/// Where the error is: materials at the most samples of each experiment.
fn materials(of: &[&Setting]) -> String {
    let settings = || of.iter().filter(|setting| setting.change.is_none());
    let finest: Vec<&&Setting> = settings()
        .filter(|setting| !settings().any(|s| s.experiment == setting.experiment && s.samples > setting.samples))
        .collect();
    let rows: Vec<(&str, &str, &Errors)> = (finest.iter())
        .flat_map(|setting| {
            let mut rows: Vec<(&str, &str, &Errors)> = (setting.told())
                .filter_map(|part| {
                    Some((setting.experiment.as_str(), part.material.as_ref()?.1.as_str(), &part.errors))
                })
                .collect();
            rows.sort_by(|a, b| b.2.rmse.total_cmp(&a.2.rmse));
            rows
        })
        .collect();
    let names = width(rows.iter().map(|row| row.0).chain(["experiment"]));
    let materials = width(rows.iter().map(|row| row.1).chain(["material"]));
    let mut out =
        format!("\nby material, at the most samples\n{:names$}  {:materials$}{ERRORS}\n", "experiment", "material");
    let mut last = "";
    for (experiment, material, errors) in rows {
        let name = if experiment == last { "" } else { experiment };
        last = experiment;
        let _ = writeln!(out, "{name:names$}  {material:materials$}{}", columns(errors));
    }
    out
}

/// What single changes cost and buy.
fn changes(of: &[&Setting]) -> String {
    let changed: Vec<&&Setting> = of.iter().filter(|setting| setting.change.is_some()).collect();
    let Some(first) = changed.first() else { return String::new() };
    let said = |setting: &Setting| setting.change.as_ref().map_or("as it is".to_string(), ToString::to_string);
    let words: Vec<String> = changed.iter().map(|setting| said(setting)).collect();
    let names = width(changed.iter().map(|setting| setting.experiment.as_str()).chain(["experiment"]));
    let words = width(words.iter().map(String::as_str));
    let mut out = format!(
        "\none approximation changed, at {} samples\n{:names$}  {:words$}  RMSE %    change  system. %  noise %    bias %     CPU s    change\n",
        first.samples, "experiment", "change"
    );
    let own = |setting: &Setting| {
        of.iter()
            .find(|own| own.change.is_none() && own.experiment == setting.experiment && own.samples == setting.samples)
    };
    let row = |name: &str, setting: &Setting, base: Option<&Setting>| {
        let errors = setting.errors();
        let cost = match base {
            Some(base) if base.cpu_s > 0.0 => format!("{:+.0} %", 100.0 * (setting.cpu_s / base.cpu_s - 1.0)),
            _ => String::new(),
        };
        let what = match base {
            Some(_) if setting.same_image => format!("  {:>46}", "changes no pixel"),
            _ if errors.is_judged() => {
                let change = base.map_or(String::new(), |base| signed(errors.rmse - base.errors().rmse));
                let (rmse, bias) = (percent(errors.rmse), signed(errors.bias));
                let noise = percent(errors.noise);
                format!("{rmse:>8} {change:>9} {:>10} {noise:>8} {bias:>9}", systematic(errors))
            }
            _ => format!("{:<48}", columns(errors)),
        };
        format!("{name:names$}  {:words$}{what} {:>9} {cost:>9}\n", said(setting), seconds(setting.cpu_s))
    };
    let mut last = "";
    for setting in changed {
        let Some(base) = own(setting) else { continue };
        if setting.experiment != last {
            out += &row(&setting.experiment, base, None);
        }
        last = &setting.experiment;
        out += &row("", setting, Some(base));
    }
    out
}

/// A bar on a terminal, nothing elsewhere.
struct Bar(ProgressBar);

impl Bar {
    fn new(quiet: bool) -> Self {
        let shown = !quiet && std::io::stderr().is_terminal();
        let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:30} {percent:>3} % of {len} tiles, {eta} left") {
            bar.set_style(style);
        }
        Self(bar)
    }
}

impl BenchProgress for Bar {
    fn begin(&self, what: &str, tiles: usize) {
        self.0.reset();
        self.0.set_length(tiles as u64);
        self.0.set_position(0);
        self.0.set_prefix(what.to_string());
        self.0.enable_steady_tick(Duration::from_millis(200));
    }

    fn tile(&self) {
        self.0.inc(1);
    }

    fn end(&self) {
        self.0.disable_steady_tick();
        self.0.finish_and_clear();
    }
}
