//! `compare A B`: images against images.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::plot::{Format, Picture};
use sunglint::{
    BandComparison, Beside, Comparison, Image, Materials, Samples, Statistics, compare_images, difference_picture,
    read_image, scatter_picture,
};

use super::{Failure, Outcome, note, print, print_json};

/// Most panels of a plot.
const MOST_PANELS: usize = 24;
/// Deepest folder that is searched.
const DEEPEST: usize = 32;

/// Compare images: bias, RMSE, worst pixel and regression per band and per material
#[derive(Args)]
#[command(after_help = "\
Examples:
  sunglint compare out/split out/phong --tolerance 1%
  sunglint compare mine/radiance.exr theirs.img --scatter scatter.svg --difference difference.png

A and B are images (OpenEXR; ENVI by .img or .hdr), folders of a frame, or whole output folders, whose images are paired \
by their paths; error, truth and lit maps are no images then, and an ENVI file beside an OpenEXR file of its name is left \
aside. Bands are paired by name, else by nearest wavelength, else by order. `error.exr` beside an image, and `truth.exr` \
beside or above it, are found by themselves.

The difference is B - A. The regression is ordinary least squares of B on A. Pixels without a number in A or B are left \
out and counted. Something differs where the RMSE of a band, or of a material within it, exceeds the tolerance times the \
mean of |A| there, or where a number or an image is missing on one side.

Exit codes: 0 within the tolerance, or none was given; 1 something differs; 2 bad input or sizes that differ")]
pub struct Compare {
    /// The reference: an image or a folder
    a: PathBuf,
    /// What is held against A
    b: PathBuf,
    /// Map of material codes: a truth.exr, or any image of one band
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Standard errors of A; said again, of B
    #[arg(long, value_name = "FILE")]
    error: Vec<PathBuf>,
    /// Bands of A to compare, separated by commas [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    band: Vec<String>,
    /// What is no difference, in per cent of the mean of |A|: 0.5%
    #[arg(long, value_name = "X%", value_parser = parse_percent)]
    tolerance: Option<f64>,
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Write the table, with every material, as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write a scatter plot with the unity line and the regression, .svg or .png
    #[arg(long, value_name = "FILE")]
    scatter: Option<PathBuf>,
    /// Write the difference as a picture, .svg or .png
    #[arg(long, value_name = "FILE")]
    difference: Option<PathBuf>,
}

/// `0.5%` or `0.5 %`, as a fraction.
pub(super) fn parse_percent(text: &str) -> Result<f64, String> {
    let number = text.trim().strip_suffix('%').and_then(|number| number.trim().parse::<f64>().ok());
    match number.filter(|number| number.is_finite() && *number >= 0.0) {
        Some(number) => Ok(number / 100.0),
        None => Err("write a number of per cent with its sign, for example 0.5%".to_string()),
    }
}

/// One pair of images, compared.
struct Compared {
    /// Path within the folders; empty where A and B are files.
    name: String,
    comparison: Comparison,
    notes: Vec<String>,
}

impl Compare {
    pub fn run(&self, quiet: bool) -> Outcome {
        for plot in [&self.scatter, &self.difference].into_iter().flatten() {
            Format::of(plot).map_err(Failure::BadInput)?;
        }
        if self.error.len() > 2 {
            return Err(Failure::BadInput("--error is said at most twice, of A and of B".into()));
        }
        let (pairs, unpaired) = self.pairs()?;
        let plotted = self.scatter.is_some() || self.difference.is_some();
        let mut all: Vec<Compared> = Vec::new();
        let mut worst: Option<(f64, usize, Image, Image)> = None;
        for (name, a, b) in pairs {
            let (compared, a, b) = self.compare(name, &a, &b)?;
            if plotted {
                let far = |band: &BandComparison| band.statistics.relative_rmse().unwrap_or(0.0);
                let far = compared.comparison.bands.iter().map(far).fold(0.0, f64::max);
                if worst.as_ref().is_none_or(|(most, ..)| far > *most) {
                    worst = Some((far, all.len(), a, b));
                }
            }
            all.push(compared);
        }
        if let Some((_, i, a, b)) = &worst {
            self.draw(&all[*i], a, b)?;
            if all.len() > 1 && !quiet {
                note(&format!("the pictures show {}, which differs most", all[*i].name));
            }
        }
        if let Some(path) = &self.csv {
            let text = csv(&all);
            sunglint::write_whole(path, |out| std::io::Write::write_all(out, text.as_bytes()))
                .map_err(|error| Failure::Unfinished(error.to_string()))?;
        }
        let beyond = self.beyond(&all, &unpaired);
        if self.json {
            print_json(&self.to_json(&all, &unpaired, &beyond));
        } else {
            print(self.text(&all, &unpaired, &beyond));
        }
        Ok(if beyond.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
    }

    /// Pairs of images by name, and what has no partner.
    #[allow(clippy::type_complexity)]
    fn pairs(&self) -> Result<(Vec<(String, PathBuf, PathBuf)>, Vec<String>), Failure> {
        match (self.a.is_dir(), self.b.is_dir()) {
            (false, false) => return Ok((vec![(String::new(), self.a.clone(), self.b.clone())], Vec::new())),
            (true, true) => {}
            (folder, _) => {
                let (folder, other) = if folder { (&self.a, &self.b) } else { (&self.b, &self.a) };
                let (folder, other) = (folder.display(), other.display());
                return Err(Failure::BadInput(format!("`{folder}` is a folder and `{other}` is none")));
            }
        }
        let (mut of_a, mut of_b) = (BTreeMap::new(), BTreeMap::new());
        for (folder, found) in [(&self.a, &mut of_a), (&self.b, &mut of_b)] {
            list_images(folder, Path::new(""), 0, found)
                .map_err(|error| Failure::BadInput(format!("`{}` is not readable: {error}", folder.display())))?;
        }
        let names: BTreeSet<&String> = of_a.keys().chain(of_b.keys()).collect();
        let (mut pairs, mut unpaired) = (Vec::new(), Vec::new());
        for name in names {
            match (of_a.get(name), of_b.get(name)) {
                (Some(a), Some(b)) => pairs.push((name.clone(), a.clone(), b.clone())),
                (Some(_), None) => unpaired.push(format!("{name} is in A only")),
                _ => unpaired.push(format!("{name} is in B only")),
            }
        }
        if pairs.is_empty() {
            let (a, b) = (self.a.display(), self.b.display());
            let found = format!("`{a}` holds {} images, `{b}` {}", of_a.len(), of_b.len());
            return Err(Failure::BadInput(format!("{found}, and none has the same path in both")));
        }
        Ok((pairs, unpaired))
    }

    fn compare(&self, name: String, a_path: &Path, b_path: &Path) -> Result<(Compared, Image, Image), Failure> {
        let read = |path: &Path| read_image(path).map_err(|error| Failure::BadInput(error.to_string()));
        let (a, b) = (read(a_path)?, read(b_path)?);
        let mut notes: Vec<String> = Vec::new();
        notes.extend(a.notes.iter().map(|note| format!("A: {note}")));
        notes.extend(b.notes.iter().map(|note| format!("B: {note}")));
        let same_size = |image: &Image| (image.width, image.height) == (a.width, a.height);
        // What is found beside an image and does not fit it is left aside; what was named is held to.
        let beside = |named: Option<&PathBuf>, places: Vec<PathBuf>| -> Result<Option<(PathBuf, Image)>, Failure> {
            if let Some(path) = named {
                return Ok(Some((path.clone(), read(path)?)));
            }
            let found = places.into_iter().find(|path| path.is_file());
            Ok(found
                .and_then(|path| Some((path.clone(), read_image(&path).ok()?)))
                .filter(|(_, image)| same_size(image)))
        };
        let folder = |path: &Path| path.parent().unwrap_or(Path::new("")).to_path_buf();
        let errors_at = |path: &Path| match path.file_stem() == Some(OsStr::new("radiance")) {
            true => vec![folder(path).join("error.exr")],
            false => Vec::new(),
        };
        let error_a = beside(self.error.first(), errors_at(a_path))?;
        let error_b = beside(self.error.get(1), errors_at(b_path))?;
        let truth_at = a_path.ancestors().skip(1).take(2).map(|folder| folder.join("truth.exr")).collect();
        let truth = beside(self.truth.as_ref(), truth_at)?;
        let materials = match &truth {
            Some((path, image)) => Some(
                Materials::of(image).map_err(|error| Failure::BadInput(format!("`{}`: {error}", path.display())))?,
            ),
            None => None,
        };
        let used = |what: &str, found: &Option<(PathBuf, Image)>| {
            found.as_ref().map(|(path, _)| format!("{what} from {}", path.display()))
        };
        notes.extend(
            [used("errors of A", &error_a), used("errors of B", &error_b), used("materials", &truth)]
                .into_iter()
                .flatten(),
        );
        let map = |image: &Image| image.attributes.get("map info").cloned();
        if let (Some(of_a), Some(of_b)) = (map(&a), map(&b))
            && of_a != of_b
        {
            notes.push(format!("the images lie at different places: A {{{of_a}}}, B {{{of_b}}}"));
        }
        let known = Beside {
            error_a: error_a.as_ref().map(|(_, image)| image),
            error_b: error_b.as_ref().map(|(_, image)| image),
            materials: materials.as_ref(),
        };
        let comparison = compare_images(&a, &b, known, &self.band).map_err(|error| {
            let place = if name.is_empty() { String::new() } else { format!("{name}: ") };
            Failure::BadInput(format!("{place}{error}"))
        })?;
        let pairing = &comparison.pairing;
        for (which, single) in [("A", &pairing.single.0), ("B", &pairing.single.1)] {
            if !single.is_empty() {
                notes.push(format!("{which} alone has {}", sunglint::dsl::list(single.iter().map(String::as_str))));
            }
        }
        for band in &comparison.bands {
            if let (Some(of_a), Some(of_b)) = &band.units
                && of_a != of_b
            {
                notes.push(format!("{} is in {of_a}, {} in {of_b}", band.name_a, band.name_b));
            }
        }
        Ok((Compared { name, comparison, notes }, a, b))
    }

    fn draw(&self, compared: &Compared, a: &Image, b: &Image) -> Result<(), Failure> {
        let bands = &compared.comparison.bands;
        if bands.len() > MOST_PANELS {
            let n = bands.len();
            return Err(Failure::BadInput(format!("{n} bands make too large a picture; choose with --band")));
        }
        let write = |picture: Picture, path: &Path| {
            picture.write(path).map_err(|error| Failure::Unfinished(format!("writing a picture: {error}")))
        };
        if let Some(path) = &self.scatter {
            write(scatter_picture(bands), path)?;
        }
        if let Some(path) = &self.difference {
            let pairs = &compared.comparison.pairing.pairs;
            let panels: Vec<(&BandComparison, &Samples, &Samples)> = (bands.iter().zip(pairs))
                .map(|(band, (i, j))| (band, &a.bands[*i].samples, &b.bands[*j].samples))
                .collect();
            write(difference_picture(&panels, a.width), path)?;
        }
        Ok(())
    }

    /// What exceeds the tolerance, in words; nothing where none is given.
    fn beyond(&self, all: &[Compared], unpaired: &[String]) -> Vec<String> {
        let Some(tolerance) = self.tolerance else { return Vec::new() };
        let mut beyond = unpaired.to_vec();
        for compared in all {
            let place = if compared.name.is_empty() { String::new() } else { format!("{} ", compared.name) };
            let single = &compared.comparison.pairing.single;
            beyond.extend(single.0.iter().map(|band| format!("{place}{band} is in A only")));
            beyond.extend(single.1.iter().map(|band| format!("{place}{band} is in B only")));
            for band in &compared.comparison.bands {
                let mut tell = |of: &str, statistics: &Statistics| {
                    if statistics.exceeds(tolerance) {
                        beyond.push(format!("{place}{}{of}: {}", band.name_a, excess(statistics)));
                    }
                };
                tell("", &band.statistics);
                band.materials.iter().for_each(|of| tell(&format!(" on {}", of.name), &of.statistics));
            }
        }
        beyond
    }

    fn text(&self, all: &[Compared], unpaired: &[String], beyond: &[String]) -> String {
        let mut out = String::new();
        let several = all.len() > 1;
        let width = (all.iter())
            .flat_map(|compared| {
                let single = compared.comparison.bands.iter().flat_map(|band| {
                    band.materials.iter().map(|of| of.name.len() + 2).chain([band.name_a.len() + band.name_b.len() + 3])
                });
                single.collect::<Vec<_>>()
            })
            .max()
            .unwrap_or(0)
            .max(8);
        for compared in all {
            let by = compared.comparison.pairing.by.as_str();
            if several {
                let _ = writeln!(out, "{} (bands paired by {by})", compared.name);
            } else {
                let _ = writeln!(out, "A {}\nB {}\nbands paired by {by}", self.a.display(), self.b.display());
            }
            for note in &compared.notes {
                let _ = writeln!(out, "  {note}");
            }
            let unit = compared.comparison.bands.first().and_then(|band| band.units.0.clone());
            if let Some(unit) = unit {
                let _ = writeln!(out, "  in {unit}; difference B - A; regression of B on A");
            }
            let with_errors = compared.comparison.bands.iter().any(|band| band.statistics.within_two_sigma.is_some());
            let _ = writeln!(
                out,
                "  {:width$} {:>9} {:>11} {:>11} {:>11} {:>11} {:>8} {:>11} {:>11} {:>11} {:>9} {:>11} {:>8}{}",
                "",
                "pixels",
                "mean A",
                "mean B",
                "bias",
                "RMSE",
                "RMSE %",
                "99th pct",
                "worst",
                "at x,y",
                "slope",
                "offset",
                "R2",
                if with_errors { "  in 2 s.e." } else { "" },
            );
            for band in &compared.comparison.bands {
                let name = match band.name_a == band.name_b {
                    true => band.name_a.clone(),
                    false => format!("{} / {}", band.name_a, band.name_b),
                };
                let _ = writeln!(out, "  {name:width$} {}", row(&band.statistics, with_errors));
                for of in band.materials.iter().filter(|_| !several) {
                    let name = format!("  {}", of.name);
                    let _ = writeln!(out, "  {name:width$} {}", row(&of.statistics, with_errors));
                }
            }
            let excluded: u64 = compared.comparison.bands.iter().map(|band| band.statistics.excluded).sum();
            if excluded > 0 {
                let one: u64 = compared.comparison.bands.iter().map(|band| band.statistics.excluded_in_one).sum();
                let _ =
                    writeln!(out, "  {excluded} values left out for want of a number, {one} of them in one image only");
            }
        }
        unpaired.iter().for_each(|line| out += &format!("{line}\n"));
        if let Some(tolerance) = self.tolerance {
            let percent = tolerance * 100.0;
            if beyond.is_empty() {
                let _ = writeln!(out, "within {percent} %");
            } else {
                let _ = writeln!(out, "beyond {percent} %:");
                beyond.iter().for_each(|line| out += &format!("  {line}\n"));
            }
        }
        out
    }

    fn to_json(&self, all: &[Compared], unpaired: &[String], beyond: &[String]) -> Value {
        let images: Vec<Value> = (all.iter())
            .map(|compared| {
                let comparison = &compared.comparison;
                json!({
                    "image": compared.name,
                    "paired_by": comparison.pairing.by.as_str(),
                    "bands_in_a_only": comparison.pairing.single.0,
                    "bands_in_b_only": comparison.pairing.single.1,
                    "notes": compared.notes,
                    "bands": comparison.bands.iter().map(BandComparison::to_json).collect::<Vec<_>>(),
                })
            })
            .collect();
        json!({
            "a": self.a.display().to_string(),
            "b": self.b.display().to_string(),
            "tolerance": self.tolerance,
            "within_tolerance": self.tolerance.map(|_| beyond.is_empty()),
            "beyond": beyond,
            "unpaired": unpaired,
            "images": images,
        })
    }
}

/// Images beneath a folder by their path without ending.
fn list_images(
    folder: &Path,
    within: &Path,
    depth: usize,
    found: &mut BTreeMap<String, PathBuf>,
) -> std::io::Result<()> {
    let mut entries: Vec<fs::DirEntry> = fs::read_dir(folder)?.collect::<std::io::Result<_>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let (path, kind) = (entry.path(), entry.file_type()?);
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        if kind.is_dir() {
            if depth < DEEPEST {
                list_images(&path, &within.join(entry.file_name()), depth + 1, found)?;
            }
            continue;
        }
        let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
        let stem = path.file_stem().unwrap_or_default();
        let is_map = ["error", "truth", "lit"].iter().any(|map| stem == OsStr::new(map));
        let beside_exr = path.with_extension("exr").is_file();
        if !is_map && (ending == "exr" || ending == "hdr" && !beside_exr) {
            // `x.img.hdr` is the header of `x.img`.
            let stem = Path::new(stem);
            let stem = if ending == "hdr" { stem.with_extension("") } else { stem.to_path_buf() };
            found.insert(within.join(stem).to_string_lossy().into_owned(), path);
        }
    }
    Ok(())
}

/// Five significant digits, as short as they go.
fn short(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".into()
    } else if (1e-3..1e6).contains(&size) {
        let decimals = (4 - size.log10().floor() as i32).clamp(0, 8) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.3e}")
    }
}

fn or_dash(value: Option<f64>) -> String {
    value.map_or("-".into(), short)
}

fn row(of: &Statistics, with_errors: bool) -> String {
    let worst = of.worst.map(|worst| (short(worst.b - worst.a), format!("{},{}", worst.x, worst.y)));
    let (worst, at) = worst.unwrap_or(("-".into(), "-".into()));
    let relative = of.relative_rmse().map_or("-".into(), |relative| format!("{:.3}", relative * 100.0));
    let mut line = format!(
        "{:>9} {:>11} {:>11} {:>11} {:>11} {:>8} {:>11} {:>11} {:>11} {:>9} {:>11} {:>8}",
        of.n,
        short(of.mean_a),
        short(of.mean_b),
        short(of.bias),
        short(of.rmse),
        relative,
        short(of.p99),
        worst,
        at,
        of.slope.map_or("-".into(), |slope| format!("{slope:.5}")),
        or_dash(of.offset),
        of.r_squared.map_or("-".into(), |r_squared| format!("{r_squared:.5}")),
    );
    if with_errors {
        let share = of.within_two_sigma.map_or("-".into(), |share| format!("{:.1} %", share * 100.0));
        let _ = write!(line, " {share:>11}");
    }
    line
}

/// `bias +0.52 (+1.30 %), RMSE 0.83 (2.07 %), worst 40.1 to 44.0 at 12,30`
pub fn excess(of: &Statistics) -> String {
    let percent =
        |relative: Option<f64>| relative.map_or(String::new(), |relative| format!(" ({:.2} %)", relative * 100.0));
    let mut line = format!(
        "bias {}{}, RMSE {}{}",
        short(of.bias),
        percent(of.relative_bias()),
        short(of.rmse),
        percent(of.relative_rmse())
    );
    if let Some(worst) = of.worst {
        let _ = write!(line, ", worst {} to {} at {},{}", short(worst.a), short(worst.b), worst.x, worst.y);
    }
    if of.excluded_in_one > 0 {
        let _ = write!(line, ", {} pixels without a number in one image only", of.excluded_in_one);
    }
    line
}

fn csv(all: &[Compared]) -> String {
    let mut out =
        "image,band_a,band_b,unit,material_code,material,pixels,excluded,mean_a,mean_b,bias,rmse,relative_bias,\
                   relative_rmse,percentile_99,worst_x_px,worst_y_px,worst_a,worst_b,slope,offset,r_squared,\
                   within_two_sigma,chi_square_per_pixel\n"
            .to_string();
    let quoted = |text: &str| match text.contains([',', '"', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_string(),
    };
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    for compared in all {
        for band in &compared.comparison.bands {
            let whole = std::iter::once((String::new(), String::new(), &band.statistics));
            let materials = band.materials.iter().map(|of| (of.code.to_string(), of.name.clone(), &of.statistics));
            for (code, material, of) in whole.chain(materials) {
                let place = |pick: fn(&sunglint::Worst) -> f64| number(of.worst.as_ref().map(pick));
                let row = [
                    quoted(&compared.name),
                    quoted(&band.name_a),
                    quoted(&band.name_b),
                    quoted(band.units.0.as_deref().unwrap_or_default()),
                    code,
                    quoted(&material),
                    of.n.to_string(),
                    of.excluded.to_string(),
                    of.mean_a.to_string(),
                    of.mean_b.to_string(),
                    of.bias.to_string(),
                    of.rmse.to_string(),
                    number(of.relative_bias()),
                    number(of.relative_rmse()),
                    of.p99.to_string(),
                    place(|worst| f64::from(worst.x)),
                    place(|worst| f64::from(worst.y)),
                    place(|worst| worst.a),
                    place(|worst| worst.b),
                    number(of.slope),
                    number(of.offset),
                    number(of.r_squared),
                    number(of.within_two_sigma),
                    number(of.chi_square),
                ];
                out += &row.join(",");
                out.push('\n');
            }
        }
    }
    out
}
