//! The program as a user runs it; each test takes what it needs of this.
#![allow(dead_code)]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

pub fn sunglint(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sunglint")).args(args).output().expect("the program starts")
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// What a command that succeeds prints.
pub fn stdout(args: &[&str]) -> String {
    let output = sunglint(args);
    assert!(output.status.success(), "{args:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).expect("text")
}

pub fn json(args: &[&str]) -> Value {
    serde_json::from_str(&stdout(args)).expect("the output is JSON")
}

/// What a command says that refuses its input.
pub fn refusal(args: &[&str]) -> String {
    let output = sunglint(args);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {}", stderr(&output));
    stderr(&output)
}

pub fn text(path: &Path) -> &str {
    path.to_str().expect("temporary paths are UTF-8")
}

pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}
