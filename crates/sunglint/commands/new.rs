//! `new NAME`: a scene to start from.

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::{Failure, Outcome, note};

/// Make a scene to start from
#[derive(Args)]
#[command(after_help = "Example:\n  sunglint new meadow && sunglint render meadow/meadow.glint -o out")]
pub struct New {
    /// Folder to make; the scene in it has the same name
    name: PathBuf,
}

const SCENE: &str = include_str!("../../../examples/minimal/minimal.glint");

impl New {
    pub fn run(&self, quiet: bool) -> Outcome {
        let Some(name) = self.name.file_name().map(|name| name.to_string_lossy().into_owned()) else {
            return Err(Failure::BadInput(format!("`{}` names no folder", self.name.display())));
        };
        let scene = self.name.join(format!("{name}.glint"));
        if scene.exists() {
            return Err(Failure::BadInput(format!("`{}` exists; choose another name", scene.display())));
        }
        let failed = |error: std::io::Error| Failure::Unfinished(format!("writing `{}`: {error}", scene.display()));
        fs::create_dir_all(&self.name).map_err(failed)?;
        fs::write(&scene, SCENE).map_err(failed)?;
        if !quiet {
            note(&format!("made {}; next:\n  sunglint render {} -o out", scene.display(), scene.display()));
        }
        Ok(ExitCode::SUCCESS)
    }
}
