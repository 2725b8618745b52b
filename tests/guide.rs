//! The guide is true: every scene in it is written, every command run, every line of output that it shows looked for.
//!
//! In `docs/guide/*.md` a fenced block `glint NAME`, `csv NAME` or `text NAME` becomes the file NAME of the chapter's own
//! folder; `append NAME` behind the language adds to it. In a `console` block a line `$ sunglint …` is run there, and the lines
//! below it must be found in what it prints, in order; `…` stands for any text. `# exit 2` behind a command is the code it
//! must end with. A `python NAME` block is run by the interpreter that `SUNGLINT_PYTHON` names, where it names one.

use std::path::{Path, PathBuf};
use std::process::Command;

struct Block {
    info: String,
    text: String,
    line: usize,
}

fn blocks(chapter: &str) -> Vec<Block> {
    let mut found = Vec::new();
    let mut open: Option<Block> = None;
    for (number, line) in chapter.lines().enumerate() {
        match (&mut open, line.strip_prefix("```")) {
            (None, Some(info)) => {
                open = Some(Block { info: info.trim().to_string(), text: String::new(), line: number + 1 });
            }
            (Some(_), Some(_)) => found.extend(open.take()),
            (Some(block), None) => {
                block.text += line;
                block.text.push('\n');
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a block is never closed");
    found
}

/// Words of a command line; single and double quotes hold words together.
fn words(line: &str) -> Vec<String> {
    let (mut out, mut word, mut quote, mut any) = (Vec::new(), String::new(), None, false);
    for c in line.chars() {
        match quote {
            Some(q) if c == q => quote = None,
            Some(_) => word.push(c),
            None if c == '"' || c == '\'' => (quote, any) = (Some(c), true),
            None if c.is_whitespace() => {
                if any || !word.is_empty() {
                    out.push(std::mem::take(&mut word));
                }
                any = false;
            }
            None => word.push(c),
        }
    }
    if any || !word.is_empty() {
        out.push(word);
    }
    out
}

/// Whether the parts of `wanted` between `…` stand in `line` in order.
fn shows(line: &str, wanted: &str) -> bool {
    let mut rest = line;
    wanted.split('…').map(str::trim).filter(|part| !part.is_empty()).all(|part| match rest.find(part) {
        Some(at) => {
            rest = &rest[at + part.len()..];
            true
        }
        None => false,
    })
}

fn console(block: &Block, folder: &Path, at: &str) {
    let mut lines = block.text.lines().peekable();
    while let Some(line) = lines.next() {
        let Some(command) = line.strip_prefix("$ ") else {
            panic!("{at}: a console block begins with `$ `, not with `{line}`");
        };
        let (command, code) = match command.split_once("# exit ") {
            Some((command, code)) => (command, code.trim().parse().expect("a code")),
            None => (command, 0),
        };
        let words = words(command);
        assert_eq!(words[0], "sunglint", "{at}: the guide runs the program alone");
        let output = Command::new(env!("CARGO_BIN_EXE_sunglint"))
            .args(&words[1..])
            .current_dir(folder)
            .output()
            .expect("the program starts");
        let printed = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{at}: `{command}` printed\n{printed}");
        let mut rest = printed.lines();
        while let Some(wanted) = lines.next_if(|line| !line.starts_with("$ ")) {
            if wanted.trim().is_empty() || wanted.trim() == "…" {
                continue;
            }
            assert!(
                rest.any(|line| shows(line, wanted)),
                "{at}: `{command}` does not print `{wanted}`, but\n{printed}"
            );
        }
    }
}

fn python(block: &Block, name: &str, folder: &Path, at: &str) {
    let Some(interpreter) = std::env::var_os("SUNGLINT_PYTHON") else { return };
    std::fs::write(folder.join(name), &block.text).expect("a writable folder");
    let output = Command::new(interpreter).arg(name).current_dir(folder).output().expect("the interpreter starts");
    let printed = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{at}: {name} printed\n{printed}");
}

fn run(chapter: &Path) {
    let text = std::fs::read_to_string(chapter).expect("a readable chapter");
    let folder = tempfile::tempdir().expect("a temporary folder");
    for block in blocks(&text) {
        let at = format!("{}:{}", chapter.display(), block.line);
        let info: Vec<&str> = block.info.split_whitespace().collect();
        match info.as_slice() {
            ["console"] => console(&block, folder.path(), &at),
            ["python", name] => python(&block, name, folder.path(), &at),
            ["glint" | "csv" | "text", name] => {
                std::fs::write(folder.path().join(name), &block.text).expect("a writable folder");
            }
            ["glint" | "csv" | "text", "append", name] => {
                let path = folder.path().join(name);
                let before = std::fs::read_to_string(&path).expect("the file to add to");
                std::fs::write(path, before + &block.text).expect("a writable folder");
            }
            _ => panic!("{at}: a block `{}` is neither a file nor a console", block.info),
        }
    }
}

fn chapters() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/guide");
    let mut found: Vec<PathBuf> = (std::fs::read_dir(folder).expect("the guide"))
        .map(|entry| entry.expect("a readable entry").path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "md"))
        .collect();
    found.sort();
    found
}

#[test]
fn every_scene_and_command_of_the_guide_works() {
    let chapters = chapters();
    assert!(chapters.len() >= 7, "the guide has its chapters");
    chapters.iter().for_each(|chapter| run(chapter));
}

#[test]
fn the_guide_lists_its_chapters() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/guide");
    let index = std::fs::read_to_string(folder.join("README.md")).expect("the guide's first page");
    for chapter in chapters() {
        let name = chapter.file_name().and_then(|name| name.to_str()).expect("a plain name").to_string();
        assert!(name == "README.md" || index.contains(&format!("({name})")), "{name} is not listed");
    }
}
