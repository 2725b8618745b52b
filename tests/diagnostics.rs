//! Every bad scene against the printed text of what it is told.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use serde_json::Value;
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

/// What every bad scene is told, found once for all tests.
type Findings = (Vec<Diagnostic>, Sources);

static FINDINGS: LazyLock<Vec<(PathBuf, Findings)>> =
    LazyLock::new(|| bad_scenes().into_iter().map(|scene| (scene.clone(), findings(&scene))).collect());

/// What the check finds, and where the scene reads well what binding it finds.
fn findings(scene: &Path) -> (Vec<Diagnostic>, Sources) {
    let checked = sunglint::check(scene);
    if checked.scene.is_none() || checked.diagnostics.iter().any(|d| d.severity == Severity::Error) {
        return (checked.diagnostics, checked.sources);
    }
    match Plan::new(checked, &Options { light_at_once: Some(0), ..Options::default() }) {
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
    for (scene, (diagnostics, sources)) in &*FINDINGS {
        let name = scene.file_stem().expect("a file has a name").to_string_lossy().into_owned();
        insta::assert_snapshot!(name, sunglint::render_diagnostics(diagnostics, sources, false));
    }
}

#[test]
fn every_bad_scene_gets_the_code_that_it_is_named_for() {
    for (scene, (diagnostics, _)) in &*FINDINGS {
        let code = code_of(scene);
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
    for (scene, (diagnostics, sources)) in &*FINDINGS {
        for diagnostic in diagnostics {
            assert!(!diagnostic.message.ends_with('.'), "{}: {}", scene.display(), diagnostic.message);
            if let Some(span) = diagnostic.span {
                let text = &sources.get(span.file).text;
                assert!(span.start <= span.end && span.end as usize <= text.len(), "{}", scene.display());
            }
        }
    }
}

/// The rules of JSON Schema that docs/diagnostics.schema.json uses.
fn hold(value: &Value, schema: &Value, root: &Value, at: &str) {
    if let Some(path) = schema["$ref"].as_str() {
        return hold(value, root.pointer(&path[1..]).expect("a definition"), root, at);
    }
    let kind = match value {
        Value::Null => "null",
        Value::String(_) => "string",
        Value::Number(n) if n.is_u64() => "integer",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
        _ => "another type",
    };
    let allowed = &schema["type"];
    assert!(allowed == kind || allowed.as_array().is_some_and(|all| all.iter().any(|one| one == kind)), "{at}: {kind}");
    if let Some(allowed) = schema["enum"].as_array() {
        assert!(allowed.contains(value), "{at}: {value}");
    }
    if let (Some(least), Some(number)) = (schema["minimum"].as_u64(), value.as_u64()) {
        assert!(number >= least, "{at}: {number}");
    }
    if let (Some(least), Some(text)) = (schema["minLength"].as_u64(), value.as_str()) {
        assert!(text.len() as u64 >= least, "{at} is empty");
    }
    for (i, item) in value.as_array().into_iter().flatten().enumerate() {
        hold(item, &schema["items"], root, &format!("{at}[{i}]"));
    }
    if let Some(object) = value.as_object() {
        let keys = |list: &mut dyn Iterator<Item = &str>| list.map(str::to_string).collect::<BTreeSet<_>>();
        let known = keys(&mut schema["properties"].as_object().expect("properties").keys().map(String::as_str));
        let required = keys(&mut schema["required"].as_array().expect("required").iter().filter_map(Value::as_str));
        assert_eq!(known, required, "all keys are always there");
        assert_eq!(keys(&mut object.keys().map(String::as_str)), known, "{at}");
        for (key, item) in object {
            hold(item, &schema["properties"][key], root, &format!("{at}.{key}"));
        }
    }
}

/// What `check --json` prints of every bad scene in one go is what its schema says, and names each scene.
#[test]
fn the_json_of_all_bad_scenes_has_exactly_the_keys_of_its_schema() {
    let schema = std::fs::read_to_string("docs/diagnostics.schema.json").expect("a schema");
    let schema: Value = serde_json::from_str(&schema).expect("JSON");
    let scenes = bad_scenes();
    let program = || std::process::Command::new(env!("CARGO_BIN_EXE_sunglint"));
    let output = program().args(["check", "--json"]).args(&scenes).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(2));
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    hold(&found, &schema, &schema, "$");
    for diagnostic in found.as_array().expect("an array") {
        assert!(is_code(diagnostic["code"].as_str().expect("a code")), "{diagnostic}");
    }
    let told: BTreeSet<&str> = found.as_array().expect("an array").iter().filter_map(|d| d["scene"].as_str()).collect();
    assert_eq!(told.len(), scenes.len(), "every scene is named");
}

/// `^[A-Z][0-9][0-9]$`
fn is_code(code: &str) -> bool {
    matches!(code.as_bytes(), [b'A'..=b'Z', b'0'..=b'9', b'0'..=b'9'])
}

/// Section 8 of the language, the table of docs/DIAGNOSTICS.md and the list that `--deny` takes hold the same codes.
#[test]
fn the_codes_of_the_documents_and_of_the_program_are_the_same() {
    let known: BTreeSet<&str> = sunglint::dsl::CODES.into_iter().collect();
    let language = std::fs::read_to_string("docs/LANGUAGE.md").expect("the language");
    let section = language.split("## 8.").nth(1).expect("section 8");
    let listed: BTreeSet<&str> = section.lines().filter_map(|l| l.get(..3)).filter(|c| is_code(c)).collect();
    assert_eq!(listed, known);
    let page = std::fs::read_to_string("docs/DIAGNOSTICS.md").expect("the page");
    let table = page.lines().filter_map(|line| line.strip_prefix("| ")?.get(..3));
    assert_eq!(table.filter(|c| is_code(c)).collect::<BTreeSet<_>>(), known);
}
