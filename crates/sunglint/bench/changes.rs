//! Algorithms with every approximation lifted, and with one of them changed.

use sunglint_dsl::scene::ModelUse;
use sunglint_plugin::{Args, Default, Kind, ModelInfo, Param, Value};
use sunglint_tracer::{BUILTIN, EXACT};

/// The algorithm that references are rendered by, with whatever it approximates lifted.
const REFERENCE: &str = "full";
/// Surfaces of a path where a limit is imposed: target and background, as published.
const DEPTH: u64 = 2;

/// One parameter of an algorithm under another word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The parameter.
    pub parameter: String,
    /// Its word in the experiment.
    pub from: String,
    /// Its word instead.
    pub to: String,
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {} -> {}", self.parameter, self.from, self.to)
    }
}

fn info(name: &str) -> Option<&'static ModelInfo> {
    BUILTIN.iter().map(|model| &model.info).find(|info| info.name == name)
}

/// What the declared approximations of an algorithm are.
fn approximations(info: &ModelInfo) -> impl Iterator<Item = (&'static Param, &'static str)> {
    EXACT.iter().filter_map(|(name, word)| Some((info.param(name)?, *word)))
}

/// The algorithm of references.
pub(super) fn exact() -> ModelUse {
    let lifted = |info: &ModelInfo| {
        let words = approximations(info).map(|(param, word)| (param.name.to_string(), value(param, word)));
        Args::new(info, words.collect::<Vec<_>>())
    };
    ModelUse {
        name: REFERENCE.to_string(),
        label: None,
        args: info(REFERENCE).map(lifted).unwrap_or_default(),
        span: None,
        param_spans: std::collections::BTreeMap::new(),
    }
}

/// The algorithm of references as a scene would say it, what its defaults are left out.
pub(super) fn exact_in_words() -> String {
    let Some(info) = info(REFERENCE) else { return REFERENCE.to_string() };
    let own = |(param, word): &(&'static Param, &'static str)| default_word(param).as_deref() != Some(*word);
    let said: Vec<String> =
        approximations(info).filter(own).map(|(param, word)| format!("{} {word}", param.name)).collect();
    if said.is_empty() { REFERENCE.to_string() } else { format!("{REFERENCE} {{ {} }}", said.join(", ")) }
}

/// An experiment's algorithm with one approximation changed, for each: one that it makes is lifted; of an algorithm that
/// makes none by default, one that it does not make is imposed, in each of its words.
pub(super) fn changes(of: &ModelUse) -> Vec<(Change, ModelUse)> {
    info(&of.name).map_or_else(Vec::new, |info| changes_under(info, of))
}

fn changes_under(info: &ModelInfo, of: &ModelUse) -> Vec<(Change, ModelUse)> {
    let is_exact = approximations(info).all(|(param, word)| default_word(param).as_deref() == Some(word));
    let mut found = Vec::new();
    for (param, exact) in approximations(info) {
        let Some(now) = of.args.get(param.name).map(word_of) else { continue };
        let others = match now == exact {
            false => vec![exact.to_string()],
            true if is_exact => imposed(param, exact),
            true => Vec::new(),
        };
        for to in others {
            let mut changed = of.clone();
            changed.args.set(param.name, value(param, &to));
            found.push((Change { parameter: param.name.to_string(), from: now.clone(), to }, changed));
        }
    }
    found
}

/// Every word of a parameter but the exact one.
fn imposed(param: &Param, exact: &str) -> Vec<String> {
    let but_exact = |words: &[&str]| words.iter().filter(|word| **word != exact).map(ToString::to_string).collect();
    match param.kind {
        Kind::Word(words) => but_exact(words),
        Kind::Switch => but_exact(&["on", "off"]),
        Kind::Count(_) => vec![DEPTH.to_string()],
        _ => Vec::new(),
    }
}

fn value(param: &Param, word: &str) -> Value {
    match param.kind {
        Kind::Switch => Value::Switch(word == "on"),
        Kind::Count(_) => word.parse().map_or_else(|_| Value::Word(word.to_string()), Value::Count),
        _ => Value::Word(word.to_string()),
    }
}

fn word_of(value: &Value) -> String {
    match value {
        Value::Word(word) => word.clone(),
        Value::Switch(on) => if *on { "on" } else { "off" }.to_string(),
        Value::Count(count) => count.to_string(),
        other => format!("{other:?}"),
    }
}

fn default_word(param: &Param) -> Option<String> {
    match param.default {
        Default::Word(word) => Some(word.to_string()),
        Default::Switch(on) => Some(word_of(&Value::Switch(on))),
        Default::Count(count) => Some(count.to_string()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn use_of(name: &str, given: &[(&str, Value)]) -> ModelUse {
        let given = given.iter().map(|(name, value)| (name.to_string(), value.clone()));
        ModelUse { args: Args::new(info(name).expect("registered"), given), name: name.into(), ..exact() }
    }

    #[test]
    fn an_approximation_of_a_published_algorithm_is_lifted() {
        let said: Vec<String> = changes(&use_of("ideal", &[("sun", Value::Word("disk".into()))]))
            .iter()
            .map(|(change, _)| change.to_string())
            .collect();
        assert!(said.contains(&"sky isotropic -> directional".to_string()), "{said:?}");
        assert!(said.contains(&"depth 2 -> unlimited".to_string()), "{said:?}");
        assert!(said.contains(&"background_angle fixed -> actual".to_string()), "{said:?}");
        assert!(!said.iter().any(|change| change.starts_with("sun ") || change.starts_with("adjacency")), "{said:?}");
    }

    /// With one lifted, all others stay as they were.
    #[test]
    fn one_change_leaves_the_rest() {
        let own = use_of("split", &[]);
        for (change, changed) in changes(&own) {
            let differ = own.args.iter().filter(|(name, value)| changed.args.get(name) != Some(value)).count();
            assert_eq!(differ, 1, "{change}");
        }
    }

    #[test]
    fn the_reference_makes_no_declared_approximation() {
        let exact = exact();
        for (param, word) in approximations(info(REFERENCE).expect("registered")) {
            assert_eq!(exact.args.get(param.name).map(word_of).as_deref(), Some(word), "{}", param.name);
        }
    }

    /// An algorithm that is exact by default: every other word is imposed, and what a scene imposes is lifted.
    #[test]
    fn on_an_exact_algorithm_approximations_are_imposed() {
        const EXACT_ONE: ModelInfo = ModelInfo {
            name: "exact",
            summary: "",
            manual: "",
            params: &[
                Param::word("sky", &["directional", "isotropic"], Default::Word("directional"), ""),
                Param::word("sun", &["disk", "point"], Default::Word("disk"), ""),
                Param::switch("caustics", true, ""),
                Param::count("depth", &["unlimited"], Default::Word("unlimited"), ""),
                Param::count("rays", &[], Default::Count(1), ""),
            ],
        };
        let said = |given: &[(&str, Value)]| -> Vec<String> {
            let given = given.iter().map(|(name, value)| (name.to_string(), value.clone()));
            let own = ModelUse { args: Args::new(&EXACT_ONE, given), ..exact() };
            changes_under(&EXACT_ONE, &own).iter().map(|(change, _)| change.to_string()).collect()
        };
        let imposed =
            ["sky directional -> isotropic", "sun disk -> point", "depth unlimited -> 2", "caustics on -> off"];
        assert_eq!(said(&[]), imposed);
        let [first, _, rest @ ..] = imposed;
        let lifted = [[first, "sun point -> disk"].as_slice(), &rest].concat();
        assert_eq!(said(&[("sun", Value::Word("point".into()))]), lifted);
    }
}
