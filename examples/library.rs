//! Sunglint as a library: load a scene, choose an experiment, render to arrays, keep a digest in a snapshot.
//!
//! `cargo run --release --example library` prints the digest; `cargo test --example library` holds it against the
//! snapshot beside it (`INSTA_UPDATE=always` accepts a new one).

use sunglint::{Frames, Options, Plan, Refused};

fn render_small() -> Result<Frames, Refused> {
    let checked = sunglint::open("examples/minimal/minimal.glint")?;
    let options = Options { pixels: Some((48, 36)), samples: Some(32), ..Options::default() };
    let plan = Plan::new(checked, &options)?;
    let run = plan.run("default", "roof").expect("the scene has one sensor, `roof`, and no experiment of its own");
    Ok(run.render())
}

fn main() -> Result<(), Refused> {
    let frames = render_small()?;
    let frame = &frames.frames[0];
    let panel = frames.truth[0].iter().zip(&frame.radiance[0]).filter(|(code, _)| **code == 1001.0);
    let (n, sum) = panel.fold((0, 0.0), |(n, sum), (_, radiance)| (n + 1, sum + f64::from(*radiance)));
    println!("{}: the grey panel fills {n} pixels, mean {:.2} W m-2 sr-1 um-1", frame.label, sum / f64::from(n));
    print!("{}", frames.digest());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grey_panel_looks_as_it_did() {
        let frames = render_small().unwrap_or_else(|refused| panic!("{refused}"));
        insta::assert_snapshot!(frames.digest());
    }
}
