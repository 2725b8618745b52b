//! Snapshots of scenes: small renders kept beside a scene, against which a later render of it is held.
//!
//! The scene `study.glint` keeps them in the folder `study.snap`, a pair of files a run: `EXPERIMENT/SENSOR.exr` holds every
//! frame and band exactly (channels `TIME.BAND`) and the material codes; `EXPERIMENT/SENSOR.json` says the same in means, a
//! line a frame and band, for people and for version control.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde_json::json;
use sunglint_dsl::Sources;

use crate::comparison::{BandComparison, Beside, Materials, before_after_picture, compare_images};
use crate::plan::{Options, Plan, Run};
use crate::products::{Image, ImageBand, Raster, RasterChannel, Samples, read_image, write_exr, write_whole};
use crate::{Files, Frames, Refused};

const UNIT: &str = "W m-2 sr-1 um-1";
/// Name of the band that holds material codes.
const CODES: &str = "material_code";
/// Deepest folder that is searched.
const DEEPEST: usize = 32;

/// Scenes and snapshots found beneath a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FoundScenes {
    /// Scenes with a `snapshot` statement of their own.
    pub scenes: Vec<PathBuf>,
    /// Scenes without one: libraries that others include, and scenes that are not to be tested.
    pub skipped: Vec<PathBuf>,
    /// Folders `NAME.snap` without a scene `NAME.glint` beside them.
    pub orphans: Vec<PathBuf>,
}

/// Finds the scenes beneath a folder, in order of their paths. Hidden folders, snapshots and links to folders are not
/// entered.
///
/// # Errors
/// A folder that cannot be read.
pub fn find_scenes(folder: &Path) -> io::Result<FoundScenes> {
    let mut found = FoundScenes::default();
    find_within(folder, 0, &mut found)?;
    Ok(found)
}

fn find_within(folder: &Path, depth: usize, found: &mut FoundScenes) -> io::Result<()> {
    let named = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", folder.display()));
    let mut entries: Vec<fs::DirEntry> =
        fs::read_dir(folder).map_err(named)?.collect::<io::Result<_>>().map_err(named)?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let (path, name) = (entry.path(), entry.file_name());
        let kind = entry.file_type().map_err(named)?;
        if name.as_encoded_bytes().starts_with(b".") {
            continue;
        }
        let ending = path.extension().and_then(OsStr::to_str);
        if kind.is_dir() && ending == Some("snap") {
            if !path.with_extension("glint").is_file() {
                found.orphans.push(path);
            }
        } else if kind.is_dir() && depth < DEEPEST {
            find_within(&path, depth + 1, found)?;
        } else if ending == Some("glint") && path.is_file() {
            let list = if states_snapshot(&path) { &mut found.scenes } else { &mut found.skipped };
            list.push(path);
        }
    }
    Ok(())
}

/// Whether a scene file has a `snapshot` statement of its own, not of a file that it includes.
fn states_snapshot(path: &Path) -> bool {
    let (mut files, mut sources) = (Files::default(), Sources::default());
    let ast = sunglint_dsl::parse(&path.to_string_lossy(), &mut files, &mut sources, &mut Vec::new());
    ast.statements.iter().any(|statement| statement.key.text == "snapshot" && statement.key.span.file.0 == 0)
}

/// Why a scene is not tested.
#[derive(Debug, thiserror::Error)]
pub enum SnapshotError {
    /// It does not run.
    #[error("{0}")]
    Refused(Box<Refused>),
    /// A snapshot could not be written, or a stale picture not removed.
    #[error("writing `{path}`: {source}")]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// A scene held against its snapshots.
#[derive(Debug)]
pub struct TestedScene {
    /// The scene.
    pub scene: PathBuf,
    /// Where its snapshots are.
    pub folder: PathBuf,
    /// Largest relative difference that is no difference.
    pub tolerance: f64,
    /// Its runs, in order, those that the filter names.
    pub runs: Vec<TestedRun>,
    /// Files of the folder that belong to no run of the scene.
    pub orphans: Vec<PathBuf>,
}

/// A run held against its snapshot.
#[derive(Debug)]
pub struct TestedRun {
    /// Name of the experiment.
    pub experiment: String,
    /// Name of the sensor.
    pub sensor: String,
    /// What came of it.
    pub outcome: TestOutcome,
    /// Whether the snapshot was replaced by what is rendered now.
    pub accepted: bool,
    /// Before, after and difference, where the run moved.
    pub picture: Option<PathBuf>,
}

/// What came of a run.
#[derive(Debug)]
pub enum TestOutcome {
    /// Every frame, band and material is within the tolerance.
    Passed,
    /// There is no snapshot.
    New,
    /// Something moved.
    Moved {
        /// Frames and bands beyond the tolerance, named `TIME.BAND`, the largest relative RMSE first.
        bands: Vec<BandComparison>,
        /// What else: frames or bands that came or went, another size, pixels that show another material.
        notes: Vec<String>,
    },
}

/// Renders a scene small, as its `snapshot` statement says, and holds every run whose `SCENE EXPERIMENT/SENSOR` contains
/// `filter` against its snapshot. Each experiment's own accuracy holds at these pixels, so equal programs give equal bits.
/// With `accept` the snapshots of these runs become what is rendered now, all of them or none, and orphans go.
///
/// # Errors
/// A scene that does not run, or files that cannot be written.
pub fn test_scene(scene: &Path, filter: &str, accept: bool) -> Result<TestedScene, SnapshotError> {
    let refused = |refused| SnapshotError::Refused(Box::new(refused));
    let checked = crate::open(scene).map_err(refused)?;
    let said = checked.scene.as_ref().map(|scene| scene.snapshot.clone()).unwrap_or_default();
    let options = Options { pixels: Some(said.pixels), experiments: said.experiments, ..Options::default() };
    let plan = Plan::new(checked, &options).map_err(refused)?;
    let folder = scene.with_extension("snap");
    let mut tested = TestedScene {
        scene: scene.to_path_buf(),
        folder: folder.clone(),
        tolerance: said.tolerance,
        runs: Vec::new(),
        orphans: Vec::new(),
    };
    let mut fresh = Vec::new();
    for run in plan.runs() {
        let name = format!("{} {}", scene.display(), run.full_name());
        if !name.contains(filter) {
            continue;
        }
        let now = Now::of(run, &run.render());
        let at = folder.join(&run.experiment).join(format!("{}.exr", run.sensor));
        let (outcome, before) = compare(&at, &now, said.tolerance);
        let picture = picture_path(&at);
        let mut tested_run = TestedRun {
            experiment: run.experiment.clone(),
            sensor: run.sensor.clone(),
            accepted: accept && !matches!(outcome, TestOutcome::Passed),
            outcome,
            picture: None,
        };
        if let (TestOutcome::Moved { bands, .. }, false, Some(before)) = (&tested_run.outcome, accept, &before)
            && let Some(band) = bands.first()
        {
            draw(&picture, band, before, &now.image).map_err(write_error(&picture))?;
            tested_run.picture = Some(picture);
        } else if picture.exists() {
            fs::remove_file(&picture).map_err(write_error(&picture))?;
        }
        fresh.push((run, now, tested_run.accepted));
        tested.runs.push(tested_run);
    }
    tested.orphans = orphans(&folder, &plan);
    if fresh.iter().any(|(.., accepted)| *accepted) || (accept && !tested.orphans.is_empty()) {
        accept_all(scene, &folder, &plan, &fresh).map_err(write_error(&folder))?;
    }
    Ok(tested)
}

fn write_error(path: &Path) -> impl FnOnce(io::Error) -> SnapshotError + '_ {
    move |source| SnapshotError::Write { path: path.to_path_buf(), source }
}

fn picture_path(snapshot: &Path) -> PathBuf {
    snapshot.with_extension("moved.png")
}

/// What a run gives now.
struct Now {
    image: Image,
    materials: Materials,
}

impl Now {
    fn of(run: &Run, frames: &Frames) -> Self {
        let mut bands = Vec::new();
        for frame in &frames.frames {
            for (channel, radiance) in frames.channels.iter().zip(&frame.radiance) {
                bands.push(ImageBand {
                    name: format!("{}.{}", frame.label, channel.name),
                    wavelength_um: Some(channel.centre.um()),
                    fwhm_um: Some(channel.fwhm),
                    unit: Some(UNIT.to_string()),
                    samples: Samples::F32(radiance.clone()),
                });
            }
        }
        let names: BTreeMap<u32, String> =
            run.materials.iter().map(|(code, name)| (u32::from(*code), name.clone())).collect();
        let (width, height) = (frames.width, frames.height);
        let codes = frames.truth.first().map_or_else(Vec::new, |codes| codes.iter().map(|code| *code as u32).collect());
        Self {
            image: Image { width, height, bands, attributes: BTreeMap::new(), notes: Vec::new() },
            materials: Materials { width, height, codes, names },
        }
    }
}

/// Holds what a run gives now against its snapshot; the snapshot comes back for the picture.
fn compare(at: &Path, now: &Now, tolerance: f64) -> (TestOutcome, Option<Image>) {
    if !at.exists() {
        return (TestOutcome::New, None);
    }
    let moved = |notes: Vec<String>| TestOutcome::Moved { bands: Vec::new(), notes };
    let before = match read_image(at) {
        Ok(image) => image,
        Err(error) => return (moved(vec![format!("the snapshot is not readable: {error}")]), None),
    };
    let size = (before.width, before.height);
    let (width, height) = (now.image.width, now.image.height);
    if size != (width, height) {
        let note = format!("the snapshot has {} x {} pixels, the scene asks for {width} x {height}", size.0, size.1);
        return (moved(vec![note]), None);
    }
    let mut notes = Vec::new();
    let materials = match before.band(CODES).map(|_| Materials::of(&before)) {
        Some(Ok(materials)) => materials,
        _ => now.materials.clone(),
    };
    let mut shared = Vec::new();
    for band in before.bands.iter().filter(|band| band.name != CODES) {
        match now.image.band(&band.name) {
            Some(_) => shared.push(band.name.clone()),
            None => notes.push(format!("{} is gone", band.name)),
        }
    }
    let is_new = |band: &&ImageBand| before.band(&band.name).is_none();
    notes.extend(now.image.bands.iter().filter(is_new).map(|band| format!("{} is new", band.name)));
    let mut bands = Vec::new();
    if !shared.is_empty() {
        let beside = Beside { materials: Some(&materials), ..Beside::default() };
        match compare_images(&before, &now.image, beside, &shared) {
            Ok(comparison) => bands = comparison.bands,
            Err(error) => notes.push(error.to_string()),
        }
    }
    bands.retain(|band| band.exceeds(tolerance));
    let far = |band: &BandComparison| band.statistics.relative_rmse().unwrap_or(f64::INFINITY);
    bands.sort_by(|a, b| far(b).total_cmp(&far(a)));
    if bands.is_empty() && notes.is_empty() {
        return (TestOutcome::Passed, Some(before));
    }
    let other = materials.codes.iter().zip(&now.materials.codes).filter(|(a, b)| a != b).count();
    if other > 0 {
        notes.push(format!("{other} pixels show another material"));
    }
    (TestOutcome::Moved { bands, notes }, Some(before))
}

/// Files of a snapshot folder that no run of the scene owns.
fn orphans(folder: &Path, plan: &Plan) -> Vec<PathBuf> {
    let mut owned = Vec::new();
    for run in plan.runs() {
        let at = folder.join(&run.experiment).join(&run.sensor);
        // A sensor's name holds no point, so endings may be set.
        owned.extend(["exr", "json", "moved.png"].map(|ending| at.with_extension(ending)));
    }
    let mut files = Vec::new();
    list_files(folder, 0, &mut files);
    files.retain(|file| !owned.contains(file));
    files
}

fn list_files(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() && !path.is_symlink() && depth < DEEPEST {
            list_files(&path, depth + 1, files);
        } else {
            files.push(path);
        }
    }
}

/// Writes a whole new folder beside the old and puts it into its place: what was rendered and accepted, and as they stand
/// the snapshots of the other runs.
fn accept_all(scene: &Path, folder: &Path, plan: &Plan, fresh: &[(&Run, Now, bool)]) -> io::Result<()> {
    let beside = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let work = tempfile::Builder::new().prefix(".sunglint-").tempdir_in(beside)?;
    let (new, old) = (work.path().join("new"), work.path().join("old"));
    fs::create_dir(&new)?;
    for run in plan.runs() {
        let at = Path::new(&run.experiment).join(&run.sensor);
        match fresh.iter().find(|(other, _, accepted)| std::ptr::eq(*other, run) && *accepted) {
            Some((_, now, _)) => write_snapshot(scene, &new.join(&at), run, now)?,
            None => {
                for ending in ["exr", "json"] {
                    let file = at.with_extension(ending);
                    if folder.join(&file).is_file() {
                        fs::create_dir_all(new.join(&file).parent().unwrap_or(&new))?;
                        fs::copy(folder.join(&file), new.join(&file))?;
                    }
                }
            }
        }
    }
    let existed = folder.exists();
    if existed {
        fs::rename(folder, &old)?;
    }
    fs::rename(&new, folder).inspect_err(|_| {
        if existed {
            let _ = fs::rename(&old, folder); // the former snapshots come back
        }
    })
}

fn write_snapshot(scene: &Path, at: &Path, run: &Run, now: &Now) -> io::Result<()> {
    let codes: Vec<f32> = now.materials.codes.iter().map(|code| *code as f32).collect();
    let mut channels: Vec<RasterChannel> = Vec::new();
    for band in &now.image.bands {
        let Samples::F32(data) = &band.samples else { continue };
        channels.push(RasterChannel {
            name: band.name.clone(),
            unit: UNIT,
            centre_nm: band.wavelength_um.map(|um| um * 1e3),
            fwhm_nm: band.fwhm_um.map(|um| um * 1e3),
            data,
        });
    }
    channels.push(RasterChannel { name: CODES.into(), unit: "1", centre_nm: None, fwhm_nm: None, data: &codes });
    let raster = Raster { width: now.image.width, height: now.image.height, channels, ..Raster::default() };
    let names: Vec<String> = now.materials.names.iter().map(|(code, name)| format!("{code} {name}")).collect();
    let attributes =
        [("experiment", run.experiment.clone()), ("sensor", run.sensor.clone()), ("materials", names.join("; "))];
    write_exr(&at.with_extension("exr"), &raster, &attributes)?;
    let text = summary(scene, run, now);
    write_whole(&at.with_extension("json"), |file| file.write_all(text.as_bytes()))
}

/// Means for people: a line a frame and band, five digits.
fn summary(scene: &Path, run: &Run, now: &Now) -> String {
    let digits = |value: f64| format!("{value:.4e}").parse().unwrap_or(value);
    let rows: Vec<String> = (now.image.bands.iter())
        .map(|band| {
            let (frame, name) = band.name.rsplit_once('.').unwrap_or(("", &band.name));
            let mut least = f64::INFINITY;
            let mut most = f64::NEG_INFINITY;
            let mut of: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
            let mut all = (0.0, 0_u32);
            for (value, code) in band.samples.iter().zip(&now.materials.codes) {
                (least, most) = (least.min(value), most.max(value));
                let sum = of.entry(*code).or_default();
                *sum = (sum.0 + value, sum.1 + 1);
                all = (all.0 + value, all.1 + 1);
            }
            let mean = |(sum, n): (f64, u32)| digits(sum / f64::from(n.max(1)));
            let materials: BTreeMap<String, f64> =
                of.into_iter().map(|(code, sum)| (now.materials.name(code), mean(sum))).collect();
            let row = json!({"frame": frame, "band": name, "mean": mean(all), "least": digits(least),
                "most": digits(most), "materials": materials});
            format!("    {row}")
        })
        .collect();
    let name = scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    format!(
        "{{\n  \"scene\": {},\n  \"experiment\": {},\n  \"sensor\": {},\n  \"pixels\": [{}, {}],\n  \"unit\": {},\n  \"rows\": [\n{}\n  ]\n}}\n",
        json!(name),
        json!(run.experiment),
        json!(run.sensor),
        now.image.width,
        now.image.height,
        json!(UNIT),
        rows.join(",\n")
    )
}

/// Before, after and difference of a band.
fn draw(path: &Path, band: &BandComparison, before: &Image, now: &Image) -> io::Result<()> {
    match (before.band(&band.name_a), now.band(&band.name_b)) {
        (Some(a), Some(b)) => before_after_picture(band, &a.samples, &b.samples, now.width).write(path),
        _ => Ok(()),
    }
}
