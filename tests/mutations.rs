//! Random damage to scenes and to their data files: no panic, no hang, no memory without bound, no radiance that is not a
//! number.
//!
//! `cargo test --release --test mutations -- --ignored` tries 10⁵ cases (`MUTATIONS=N` and `MUTATIONS_FROM=SEED` choose
//! others). Each case is a seed: `MUTATIONS=1 MUTATIONS_FROM=SEED` replays it, and `MUTATIONS_KEEP=FOLDER` keeps its files.

use std::io::{BufRead, BufReader};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use sunglint::dsl::scene::{Object, Shape};
use sunglint::{Options, Plan, Run};

/// Processor seconds that a case may take in the long test, and memory of the worker \[MB\]. In the short one, which runs beside
/// others on a busy machine, only a hang counts.
const MOST_SECONDS: f64 = 2.0;
const HANG_SECONDS: f64 = 20.0;
const MOST_MEMORY_MB: f64 = 1024.0;
/// Work beyond this is a large scene, not a hang: pixels × samples × times × grid entries of all runs.
const MOST_WORK: f64 = 3e6;
const MOST_PLACED: usize = 200_000;
const PIXELS: (u32, u32) = (6, 4);
const SAMPLES: u32 = 16;

struct Random(u64);

impl Random {
    fn of(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5eed_0f91_1a7e);
        for _ in 0..4 {
            random.below(2);
        }
        random
    }
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = self.0 ^ (self.0 >> 29);
        ((u128::from(x.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 1) * n as u128) >> 63) as usize
    }
    fn span(&mut self, len: usize, most: usize) -> Range<usize> {
        let start = self.below(len + 1);
        start..(start + self.below(most + 1)).min(len)
    }
}

/// What a slip of the hand would not write.
const WORDS: &[&str] = &[
    "1e308",
    "-1e308",
    "1e-308",
    "5e-324",
    "99999999999",
    "4294967296",
    "65536",
    "10000000",
    "-1",
    "0",
    "-0",
    "1e9",
    "1e15",
    "nan",
    "inf",
    "{",
    "}",
    "(",
    ")",
    "[",
    "]",
    "\"",
    "#",
    ",",
    "\\",
    "..",
    "x",
    "%",
    "deg",
    "nm",
    "km",
    "like",
    "for",
    "else",
    "sweep",
    "\r",
    "\n",
    "\0",
    "\u{b5}",
    "\u{feff}",
    "\u{1f600}",
    "grid 3000 x 3000 spacing (1 1) m",
    "scale 1e9",
    "f 1 2 3\n",
    "include \"truth.glint\"\n",
    "at (0 0 0) m",
    "every 1 s",
    "samples 1",
    "depth unlimited",
];

const SIGNS: &[u8] = b"0123456789-.+eE \n\t{}()[]\"#,_x";

fn damage(text: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Random) {
    for _ in 0..1 + random.below(4) {
        let at = random.below(text.len() + 1);
        match random.below(12) {
            0 if at < text.len() => text[at] ^= 1 << random.below(8),
            1 if at < text.len() => text[at] = random.below(256) as u8,
            2 => text.insert(at, SIGNS[random.below(SIGNS.len())]),
            3 => drop(text.drain(random.span(text.len(), 12))),
            4 => drop(text.drain(random.span(text.len(), 400))),
            5 => {
                let copy = text[random.span(text.len(), 200)].to_vec();
                (0..1 + random.below(3)).for_each(|_| drop(text.splice(at..at, copy.iter().copied())));
            }
            6 => {
                let mut lines: Vec<&[u8]> = text.split_inclusive(|&b| b == b'\n').collect();
                if !lines.is_empty() {
                    let (a, b) = (random.below(lines.len()), random.below(lines.len()));
                    lines.swap(a, b);
                    *text = lines.concat();
                }
            }
            7 => {
                let other = &others[random.below(others.len())];
                let piece = other[random.span(other.len(), 300)].to_vec();
                drop(text.splice(at..at, piece));
            }
            8 if random.below(4) == 0 => text.truncate(at),
            9 | 10 => {
                // a number becomes another
                let digit = |b: &u8| b.is_ascii_digit() || *b == b'.';
                let Some(start) = (at..text.len()).find(|&i| digit(&text[i])) else { continue };
                let end = (start..text.len()).find(|&i| !digit(&text[i])).unwrap_or(text.len());
                let number = match random.below(3) {
                    0 => WORDS[random.below(15)].to_string(),
                    1 => format!("{}", random.below(2000)),
                    _ => format!("{:e}", random.below(1000) as f64 * 10f64.powi(random.below(40) as i32 - 20)),
                };
                drop(text.splice(start..end, number.into_bytes()));
            }
            _ => drop(text.splice(at..at, WORDS[random.below(WORDS.len())].bytes())),
        }
    }
}

/// Copies of the scenes and data of the project, to be damaged.
struct Corpus {
    folder: tempfile::TempDir,
    scenes: Vec<PathBuf>,
    /// Every file with its sound content.
    files: Vec<(PathBuf, Vec<u8>)>,
    texts: Vec<Vec<u8>>,
}

impl Corpus {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut files = Vec::new();
        for from in ["examples", "tests/scenes", "tests/bad"] {
            copy(Path::new(from), &folder.path().join(from), &mut files);
        }
        files.sort();
        let is = |path: &Path, kinds: &[&str]| path.extension().is_some_and(|e| kinds.iter().any(|kind| e == *kind));
        let scenes = files.iter().map(|f| f.0.clone()).filter(|path| is(path, &["glint"])).collect();
        let texts = files.iter().map(|f| f.1.clone()).collect();
        Self { folder, scenes, files, texts }
    }
    fn sound(&self, path: &Path) -> &[u8] {
        let at = self.files.binary_search_by(|f| f.0.as_path().cmp(path)).expect("a file of the corpus");
        &self.files[at].1
    }
}

fn copy(from: &Path, to: &Path, files: &mut Vec<(PathBuf, Vec<u8>)>) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("tests run at the root of the package") {
        let path = entry.expect("a readable folder").path();
        let target = to.join(path.file_name().expect("a name"));
        let text = ["glint", "inc", "csv", "obj", "txt", "asc", "prj"];
        if path.is_dir() {
            copy(&path, &target, files);
        } else if path.extension().is_some_and(|e| text.iter().any(|t| e == *t)) {
            let bytes = std::fs::read(&path).expect("a readable file");
            std::fs::write(&target, &bytes).expect("room");
            files.push((target, bytes));
        }
    }
}

/// Objects placed, those within objects counted each.
fn placements(shapes: &[Shape], objects: &[Object]) -> usize {
    let of = |shape: &Shape| match shape {
        Shape::Place { object, poses, .. } => {
            poses.len().saturating_mul(1 + placements(&objects[*object].shapes, objects))
        }
        Shape::Scatter(scatter) => {
            let members = usize::try_from(scatter.count).unwrap_or(usize::MAX);
            members.saturating_mul(1 + placements(&objects[scatter.object].shapes, objects))
        }
        _ => 0,
    };
    shapes.iter().map(of).fold(0, usize::saturating_add)
}

/// Grid entries × times × pixels × samples.
fn work(runs: &[Run]) -> f64 {
    let of = |run: &Run| run.grid.len() as f64 * run.moments.len() as f64 * f64::from(run.pixels.0 * run.pixels.1);
    runs.iter().map(of).sum::<f64>() * f64::from(SAMPLES)
}

/// One case; what was wrong with its picture.
fn case(corpus: &Corpus, seed: u64) -> Result<(), String> {
    let mut random = Random::of(seed);
    // mostly the sound ones, which damage can bring further
    let sound: Vec<&PathBuf> =
        corpus.scenes.iter().filter(|path| !path.starts_with(corpus.folder.path().join("tests/bad"))).collect();
    let scene = match random.below(4) {
        0 => &corpus.scenes[random.below(corpus.scenes.len())],
        _ => sound[random.below(sound.len())],
    };
    let mut damaged = vec![scene.clone()];
    let text = String::from_utf8_lossy(corpus.sound(scene)).into_owned();
    // files that it names
    let folder = scene.parent().expect("a folder");
    let named = text.split('"').skip(1).step_by(2).map(|name| folder.join(name));
    let named: Vec<PathBuf> = named.filter(|path| corpus.files.iter().any(|f| f.0 == *path)).collect();
    if !named.is_empty() && random.below(3) > 0 {
        damaged.push(named[random.below(named.len())].clone());
        if random.below(2) == 0 {
            damaged.remove(0);
        }
    }
    for path in &damaged {
        let mut bytes = corpus.sound(path).to_vec();
        damage(&mut bytes, &corpus.texts, &mut random);
        std::fs::write(path, bytes).expect("room");
    }
    let outcome = try_scene(scene);
    if let Some(keep) = std::env::var_os("MUTATIONS_KEEP") {
        let mut kept = Vec::new();
        copy(corpus.folder.path(), Path::new(&keep), &mut kept);
        println!("kept {} files; the scene is {}", kept.len(), scene.display());
    }
    for path in &damaged {
        std::fs::write(path, corpus.sound(path)).expect("room");
    }
    outcome
}

fn try_scene(scene: &Path) -> Result<(), String> {
    let options = Options { pixels: Some(PIXELS), samples: Some(SAMPLES), ..Options::default() };
    let planned = sunglint::open(scene).and_then(|checked| {
        let large = checked.scene.as_ref().is_some_and(|s| placements(&s.world, &s.objects) > MOST_PLACED);
        if large { Ok(None) } else { Plan::new(checked, &options).map(Some) }
    });
    let plan = match planned {
        Ok(Some(plan)) => plan,
        Ok(None) => return Ok(()),
        Err(refused) => {
            let told = refused.to_string();
            return if told.contains("error[") { Ok(()) } else { Err("refused without an error".into()) };
        }
    };
    if work(plan.runs()) > MOST_WORK {
        return Ok(());
    }
    for run in plan.runs() {
        for frame in &run.render().frames {
            let wrong = frame.radiance.iter().flatten().find(|value| !(value.is_finite() && **value >= 0.0));
            if let Some(value) = wrong {
                return Err(format!("a radiance of {value}"));
            }
        }
    }
    Ok(())
}

/// Processor seconds of a process so far; 0 where that is not known.
fn cpu_seconds(process: &str) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    let ticks = |field: usize| stat.rsplit(") ").next()?.split(' ').nth(field)?.parse::<f64>().ok();
    ticks(11).zip(ticks(12)).map_or(0.0, |(user, system)| (user + system) / 100.0)
}

/// The most memory that this process has held \[MB\]; 0 where that is not known.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM:"));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok()).map_or(0.0, |kb| kb / 1024.0)
}

static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

/// Tries seeds one by one: a line before each, and a line for each fault.
fn try_all(seeds: Range<u64>, mut tell: impl FnMut(String)) {
    std::panic::set_hook(Box::new(|info| {
        if let Ok(mut last) = LAST_PANIC.lock() {
            *last = info.to_string().replace('\n', " ");
        }
    }));
    let corpus = Corpus::new();
    let most_seconds = if std::env::var_os("MUTATIONS_TIMED").is_some() { MOST_SECONDS } else { HANG_SECONDS };
    for seed in seeds {
        tell(format!("seed {seed}"));
        let start = cpu_seconds("self");
        let outcome = catch_unwind(AssertUnwindSafe(|| case(&corpus, seed)));
        let (seconds, memory) = (cpu_seconds("self") - start, peak_mb());
        match outcome {
            Err(_) => tell(format!("fault {seed}: panic: {}", LAST_PANIC.lock().expect("no panic in the hook"))),
            Ok(Err(fault)) => tell(format!("fault {seed}: {fault}")),
            Ok(Ok(())) if seconds > most_seconds => tell(format!("fault {seed}: {seconds:.1} s")),
            Ok(Ok(())) => {}
        }
        if memory > MOST_MEMORY_MB {
            tell(format!("fault {seed}: {memory:.0} MB"));
            tell("full".into());
            break;
        }
    }
    let _ = std::panic::take_hook();
}

/// Not a test of its own: the body of the worker processes.
#[test]
#[ignore = "the worker of the other tests"]
fn worker() {
    let Some(seeds) = std::env::var("MUTATIONS_WORKER").ok() else { return };
    let (from, to) = seeds.split_once("..").expect("a range");
    try_all(from.parse().expect("a seed")..to.parse().expect("a seed"), |line| println!("@{line}"));
}

/// A worker with a bound on its memory where the system has `ulimit`.
fn start(seeds: &Range<u64>, timed: bool) -> Child {
    let program = std::env::current_exe().expect("this test");
    let mut command = if cfg!(unix) {
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -v 6000000; exec \"$0\" \"$@\""]).arg(program);
        shell
    } else {
        Command::new(program)
    };
    if timed {
        command.env("MUTATIONS_TIMED", "1");
    }
    command
        .args(["--exact", "worker", "--ignored", "--nocapture", "--test-threads=1"])
        .env("MUTATIONS_WORKER", format!("{}..{}", seeds.start, seeds.end))
        .env("RAYON_NUM_THREADS", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("a worker starts")
}

/// Faults of a range of seeds, tried in workers that may hang or die.
fn faults(mut seeds: Range<u64>, timed: bool) -> Vec<String> {
    let mut found = Vec::new();
    while !seeds.is_empty() {
        let mut child = start(&seeds, timed);
        let id = child.id().to_string();
        let output = child.stdout.take().expect("its output");
        let (sender, lines) = channel();
        let reader = std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if let Some(at) = line.find('@')
                    && sender.send(line[at + 1..].to_string()).is_err()
                {
                    break;
                }
            }
        });
        let (mut at, mut since, mut ended) = (seeds.start, 0.0, None);
        let mut fault = |text: String| {
            eprintln!("{text}");
            found.push(text);
        };
        loop {
            match lines.recv_timeout(Duration::from_millis(500)) {
                Ok(line) if line.starts_with("seed ") => {
                    at = line[5..].parse().expect("a seed");
                    since = cpu_seconds(&id);
                    if at % 5000 == 0 {
                        eprintln!("{line}");
                    }
                }
                Ok(line) if line == "full" => ended = Some("full"),
                Ok(line) => fault(line),
                Err(RecvTimeoutError::Timeout) if cpu_seconds(&id) - since > HANG_SECONDS => {
                    fault(format!("fault {at}: hangs"));
                    let _ = child.kill();
                    ended = Some("killed");
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        let status = child.wait().expect("it ends");
        let _ = reader.join();
        if ended.is_none() && at + 1 == seeds.end && status.success() {
            break;
        }
        if ended.is_none() {
            fault(format!("fault {at}: the process dies ({status})"));
        }
        seeds.start = at + 1;
    }
    found
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

#[test]
fn damaged_scenes_and_data_are_told_what_is_wrong_or_rendered() {
    let found = faults(0..250, false);
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
#[ignore = "minutes to hours: MUTATIONS=N cases from MUTATIONS_FROM on"]
fn many_damaged_scenes() {
    let from = number("MUTATIONS_FROM", 1000);
    let found = faults(from..from + number("MUTATIONS", 100_000), true);
    assert!(found.is_empty(), "{} faults: {found:#?}", found.len());
}
