//! Counts rays that leak through closed surfaces: `cargo run --release -p sunglint-geometry --example leaks [RAYS]`.

#[path = "leaks/scenes.rs"]
mod scenes;

fn main() {
    let count = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(10_000_000);
    let mut total = 0;
    for scene in scenes::all() {
        let world = scene.world();
        let mut leaks = 0_usize;
        scene.rays(count, |ray| leaks += usize::from(world.closest(ray).is_none()));
        println!("{:<44}{leaks:>8} of {count} rays", scene.name);
        total += leaks;
    }
    std::process::exit(i32::from(total > 0));
}
