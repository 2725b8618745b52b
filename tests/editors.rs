//! The grammar for editors, held against the language by a small TextMate engine.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use regex::Regex;
use serde_json::Value as Json;
use sunglint::Sources;
use sunglint::dsl::ast::{Item, Statement, Value};
use sunglint::dsl::{self, Span};

enum Rule {
    Match { regex: Regex, name: Option<String>, captures: BTreeMap<usize, String> },
    Region { begin: Regex, end: Regex, name: Option<String>, inside: Vec<String> },
}

/// Rules by the place at which they stand in the file; an include is resolved to the places that it stands for.
struct Grammar {
    rules: BTreeMap<String, Rule>,
    top: Vec<String>,
}

impl Grammar {
    fn read() -> Self {
        let text = std::fs::read_to_string("editors/glint.tmLanguage.json").unwrap();
        let json: Json = serde_json::from_str(&text).unwrap();
        assert_eq!(json["scopeName"], "source.glint");
        let mut grammar = Self { rules: BTreeMap::new(), top: Vec::new() };
        grammar.top = grammar.patterns(&json, &json["patterns"], "");
        grammar
    }

    fn patterns(&mut self, json: &Json, patterns: &Json, path: &str) -> Vec<String> {
        let patterns = patterns.as_array().into_iter().flatten().enumerate();
        patterns.flat_map(|(i, pattern)| self.pattern(json, pattern, &format!("{path}/{i}"))).collect()
    }

    fn pattern(&mut self, json: &Json, pattern: &Json, path: &str) -> Vec<String> {
        if let Some(include) = pattern["include"].as_str() {
            let name = include.strip_prefix('#').unwrap();
            let target = &json["repository"][name];
            assert!(target.is_object(), "{include} is not in the repository");
            return self.pattern(json, target, &format!("#{name}"));
        }
        let regex =
            |key: &str| pattern[key].as_str().map(|text| Regex::new(text).unwrap_or_else(|e| panic!("{path}: {e}")));
        let name = pattern["name"].as_str().map(str::to_string);
        let (found, begin) = (regex("match"), regex("begin"));
        if found.is_none() && begin.is_none() {
            return self.patterns(json, &pattern["patterns"], path);
        }
        if !self.rules.contains_key(path) {
            let rule = match (found, begin) {
                (Some(regex), None) => {
                    let captures = pattern["captures"].as_object().into_iter().flatten();
                    let captures = captures.map(|(i, c)| (i.parse().unwrap(), c["name"].as_str().unwrap().to_string()));
                    Rule::Match { regex, name, captures: captures.collect() }
                }
                (None, Some(begin)) => {
                    let end = regex("end").unwrap();
                    // A list may hold lists: while its inside is read, the rule is known.
                    let known =
                        Rule::Region { begin: begin.clone(), end: end.clone(), name: name.clone(), inside: Vec::new() };
                    self.rules.insert(path.to_string(), known);
                    let inside = self.patterns(json, &pattern["patterns"], path);
                    Rule::Region { begin, end, name, inside }
                }
                _ => panic!("{path}"),
            };
            self.rules.insert(path.to_string(), rule);
        }
        vec![path.to_string()]
    }

    /// The scopes of each byte of a text.
    fn scopes(&self, text: &str) -> Vec<String> {
        let mut scopes = vec![String::new(); text.len()];
        let mut open: Vec<&Rule> = Vec::new();
        let mut start = 0;
        for line in text.split_inclusive('\n') {
            let shown = line.trim_end_matches(['\r', '\n']);
            let mut mark = |from: usize, to: usize, name: &Option<String>| {
                scopes[start + from..start + to]
                    .iter_mut()
                    .for_each(|s| *s = format!("{s} {}", name.as_deref().unwrap_or("")));
            };
            let mut at = 0;
            loop {
                let (inside, end) = match open.last() {
                    Some(Rule::Region { inside, end, .. }) => (inside, end.find_at(shown, at)),
                    _ => (&self.top, None),
                };
                let found = inside.iter().filter_map(|path| {
                    let rule = &self.rules[path];
                    let (Rule::Match { regex, .. } | Rule::Region { begin: regex, .. }) = rule;
                    regex.captures_at(shown, at).map(|c| (c.get(0).unwrap().range(), c, rule))
                });
                // the first of those that begin first; `min_by_key` keeps the first
                let found = found.min_by_key(|(range, ..)| range.start);
                let closes = end.filter(|end| found.as_ref().is_none_or(|(range, ..)| end.start() <= range.start));
                let (from, to) = match (&closes, &found) {
                    (Some(end), _) => (end.start(), end.end()),
                    (None, Some((range, ..))) => (range.start, range.end),
                    (None, None) => (shown.len(), shown.len()),
                };
                for rule in &open {
                    if let Rule::Region { name, .. } = rule {
                        mark(at, to, name);
                    }
                }
                if closes.is_some() {
                    open.pop();
                } else if let Some((range, groups, rule)) = found {
                    match rule {
                        Rule::Match { name, captures, .. } => {
                            mark(range.start, range.end, name);
                            for (i, name) in captures {
                                if let Some(group) = groups.get(*i) {
                                    mark(group.start(), group.end(), &Some(name.clone()));
                                }
                            }
                        }
                        Rule::Region { name, .. } => {
                            mark(range.start, range.end, name);
                            open.push(rule);
                        }
                    }
                } else {
                    break;
                }
                assert!(to > at || from == to, "no progress at {shown:?}");
                if to == at && closes.is_none() {
                    break;
                }
                at = to;
            }
            start += line.len();
        }
        scopes
    }

    /// The scopes of the first byte of a text.
    fn first(&self, text: &str) -> String {
        self.scopes(text).into_iter().next().unwrap()
    }
}

#[test]
fn every_word_and_unit_of_the_language_is_in_the_grammar() {
    let grammar = Grammar::read();
    let is_known = |word: &&str| {
        let scope = grammar.first(word);
        scope.contains("keyword.") || scope.contains("constant.language")
    };
    let unknown: Vec<&str> = dsl::keywords().into_iter().filter(|word| !is_known(word)).collect();
    assert!(unknown.is_empty(), "{unknown:?}");
    for unit in sunglint::radiometry::UNITS {
        let text = format!("1 {}", unit.name);
        let scopes = grammar.scopes(&text);
        assert!(scopes[2..].iter().all(|scope| scope.contains("keyword.other.unit")), "{}: {scopes:?}", unit.name);
    }
    for name in ["grey_05", "m1", "km_2", "sensors", "x"] {
        let scopes = grammar.scopes(name);
        assert!(scopes.iter().all(|scope| scope.contains("variable.other")), "{name}: {scopes:?}");
    }
}

fn scenes(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            scenes(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "glint") {
            found.push(path);
        }
    }
}

#[test]
fn the_values_of_the_examples_have_their_scopes() {
    let grammar = Grammar::read();
    let mut paths = Vec::new();
    scenes(Path::new("examples"), &mut paths);
    scenes(Path::new("crates/dsl/tests/language"), &mut paths);
    let mut counts = BTreeMap::new();
    for path in paths {
        let mut sources = Sources::default();
        let ast = dsl::parse(path.to_str().unwrap(), &mut sunglint::Files::default(), &mut sources, &mut Vec::new());
        let ast = ast.spelt_out(&sources, &|_, _| false);
        let scopes: Vec<Vec<String>> = sources.iter().map(|source| grammar.scopes(&source.text)).collect();
        let mut hold = |span: Span, scope: &'static str| {
            *counts.entry(scope).or_insert(0) += 1;
            let place = sources.line_column(span);
            let found = &scopes[span.file.0 as usize][span.start as usize];
            assert!(found.contains(scope), "{} {place:?} `{}`: {found}", path.display(), sources.text(span));
        };
        let mut blocks = vec![&ast.statements];
        while let Some(statements) = blocks.pop() {
            for statement in statements {
                key(statement, &mut hold);
                statement.items.iter().for_each(|item| scope_of(item, &sources, &mut hold));
                blocks.extend(statement.block.iter().map(|block| &block.statements));
            }
        }
        for (source, scopes) in sources.iter().zip(&scopes) {
            let mut start = 0;
            for line in source.text.split_inclusive('\n') {
                let quotes = |end: usize| line[..end].matches('"').count() % 2;
                if let Some(i) = line.find('#').filter(|i| quotes(*i) == 0) {
                    assert!(scopes[start + i].contains("comment.line"), "{line}");
                }
                start += line.len();
            }
        }
    }
    for scope in
        ["keyword.", "constant.numeric", "keyword.other.unit", "string.quoted", "constant.other.instant", "meta.vector"]
    {
        assert!(counts.get(scope).is_some_and(|n| *n > 5), "{scope}: {counts:?}");
    }
}

/// A key of the language, but where it stands as the name of something.
fn key(statement: &Statement, hold: &mut impl FnMut(Span, &'static str)) {
    if dsl::keywords().contains(statement.key.text.as_str()) {
        hold(statement.key.span, "keyword.");
    }
}

fn scope_of(item: &Item, sources: &Sources, hold: &mut impl FnMut(Span, &'static str)) {
    match &item.value {
        Value::Number { unit, .. } | Value::Range { unit, .. } => {
            hold(item.span, "constant.numeric");
            unit.iter().for_each(|unit| hold(unit.span, "keyword.other.unit"));
        }
        Value::Grid(..) => hold(item.span, "constant.numeric"),
        Value::Points { points, unit } => {
            points.iter().for_each(|point| hold(point.span, "meta.vector"));
            unit.iter().for_each(|unit| hold(unit.span, "keyword.other.unit"));
        }
        Value::Text(_) => hold(item.span, "string.quoted"),
        Value::Moment { .. } => hold(item.span, "constant.other.instant"),
        Value::List { rows, unit } => {
            rows.iter().flatten().for_each(|item| scope_of(item, sources, hold));
            unit.iter().for_each(|unit| hold(unit.span, "keyword.other.unit"));
        }
        Value::Runs { runs, .. } => {
            let text = &sources.get(runs.file()).text;
            (0..runs.len()).for_each(|i| scope_of(&runs.item(i, text), sources, hold));
        }
        Value::Word(_) => {}
    }
}
