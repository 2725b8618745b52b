//! Every bad scene against the printed text of what it is told.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use sunglint::{Diagnostic, Options, Plan, Severity, Sources};

/// The codes of docs/LANGUAGE.md section 8 that this version can give.
const CODES: &[&str] = &[
    "S01", "S02", "S03", "S04", "S05", "S06", "U01", "U02", "U03", "U04", "U05", "N01", "N02", "N03", "N04", "N05",
    "T01", "T02", "T03", "A01", "A02", "A03", "M01", "M02", "M03", "M04", "M05", "G01", "G02", "G03", "G04", "G05",
    "V01", "V02", "V03", "X01", "X02", "X03", "F01", "F02", "L01",
];

fn bad_scenes() -> Vec<PathBuf> {
    let mut scenes: Vec<PathBuf> = std::fs::read_dir("tests/bad")
        .expect("tests run at the root of the package")
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "glint"))
        .collect();
    scenes.sort();
    scenes
}

/// What the check finds, and where the scene reads well what binding it finds.
fn findings(scene: &Path) -> (Vec<Diagnostic>, Sources) {
    let checked = sunglint::check(scene);
    if checked.scene.is_none() || checked.diagnostics.iter().any(|d| d.severity == Severity::Error) {
        return (checked.diagnostics, checked.sources);
    }
    match Plan::new(checked, &Options::default()) {
        Ok(plan) => (plan.warnings, plan.sources),
        Err(refused) => (refused.diagnostics, refused.sources),
    }
}

fn code_of(scene: &Path) -> String {
    let stem = scene.file_stem().expect("a file has a name").to_string_lossy();
    stem.split('_').next().unwrap_or_default().to_uppercase()
}

#[test]
fn every_bad_scene_is_told_what_is_wrong() {
    for scene in bad_scenes() {
        let (diagnostics, sources) = findings(&scene);
        let name = scene.file_stem().expect("a file has a name").to_string_lossy().into_owned();
        insta::assert_snapshot!(name, sunglint::render_diagnostics(&diagnostics, &sources, false));
    }
}

#[test]
fn every_bad_scene_gets_the_code_that_it_is_named_for() {
    for scene in bad_scenes() {
        let (diagnostics, _) = findings(&scene);
        let code = code_of(&scene);
        if code == "SEVERAL" {
            let codes: BTreeSet<&str> = diagnostics.iter().map(|d| d.code).collect();
            assert!(codes.len() >= 6, "{}: {codes:?}", scene.display());
            continue;
        }
        assert!(diagnostics.iter().any(|d| d.code == code), "{} lacks {code}: {diagnostics:?}", scene.display());
    }
}

#[test]
fn every_code_has_a_bad_scene() {
    let tested: BTreeSet<String> = bad_scenes().iter().map(|scene| code_of(scene)).collect();
    let missing: Vec<&&str> = CODES.iter().filter(|code| !tested.contains(**code)).collect();
    assert!(missing.is_empty(), "no bad scene for {missing:?}");
}

/// Messages are lower case without a final period, and every place is inside its file.
#[test]
fn diagnostics_are_written_in_one_style() {
    for scene in bad_scenes() {
        let (diagnostics, sources) = findings(&scene);
        for diagnostic in diagnostics {
            assert!(!diagnostic.message.ends_with('.'), "{}: {}", scene.display(), diagnostic.message);
            if let Some(span) = diagnostic.span {
                let text = &sources.get(span.file).text;
                assert!(span.start <= span.end && span.end as usize <= text.len(), "{}", scene.display());
            }
        }
    }
}
