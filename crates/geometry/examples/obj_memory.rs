//! Seconds and memory from the text of an OBJ file to a world:
//! `cargo run --release -p sunglint-geometry --example obj_memory -- [TRIANGLES | FILE]` (memory on Linux only).

use std::time::Instant;
use sunglint_geometry::{Instance, MaterialId, Up, World, read_obj};

#[path = "../benches/load_obj/heights.rs"]
mod heights;

/// Processor seconds of this process so far.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks = |field: usize| stat.rsplit(") ").next()?.split(' ').nth(field)?.parse::<f64>().ok();
    ticks(11).zip(ticks(12)).map_or(f64::NAN, |(user, system)| (user + system) / 100.0)
}

/// Resident now and at most so far \[MB\].
fn memory_mb() -> [f64; 2] {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let of = |key: &str| {
        let line = status.lines().find(|line| line.starts_with(key))?;
        line.split_whitespace().nth(1)?.parse::<f64>().ok()
    };
    ["VmRSS:", "VmHWM:"].map(|key| of(key).unwrap_or(f64::NAN) / 1024.0)
}

fn main() {
    let asked = std::env::args().nth(1).unwrap_or_else(|| "1000000".to_owned());
    let bytes = match asked.parse() {
        Ok(triangles) => heights::obj(triangles).into_bytes(),
        Err(_) => std::fs::read(&asked).expect("a number of triangles, or a file"),
    };
    let mut before = 0.0;
    let mut tell = |what: &str, seconds: f64| {
        let ([now, most], cpu) = (memory_mb(), cpu_s() - before);
        before += cpu;
        println!(
            "{what:<28} {seconds:6.3} s, {cpu:5.2} s of processor, {now:7.1} MB resident, {most:7.1} MB at most so far"
        );
    };
    tell(&format!("{:.1} MB of text", bytes.len() as f64 / 1e6), 0.0);
    let start = Instant::now();
    let read = read_obj(&bytes, 1.0, Up::Z, &mut |_| Some(MaterialId(0))).expect("a sound file");
    tell("text to mesh", start.elapsed().as_secs_f64());
    drop(bytes);
    let start = Instant::now();
    let one = Instance { mesh: 0, pose: glam::DAffine3::IDENTITY, name: "field".into(), id: 1 };
    let world = World::new(vec![read.mesh], vec![one], None).expect("a world");
    tell("mesh to world", start.elapsed().as_secs_f64());
    let (triangles, bytes) = (world.triangle_count(), world.memory_bytes());
    println!("{triangles} triangles, {bytes} bytes of world: {:.1} a triangle", bytes as f64 / triangles as f64);
}
