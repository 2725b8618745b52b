//! Layout keeps meaning, comments and digits, and is its own fixed point.

use proptest::prelude::*;
use sunglint_dsl::ast::{Statement, Value};
use sunglint_dsl::{LoadError, Loaded, Loader, Sources, format, parse};

/// One text under every name, and includes that hold nothing.
struct Text<'a>(&'a str);

impl Loader for Text<'_> {
    fn read(&mut self, path: &str, from: &str) -> Result<Loaded, LoadError> {
        let text = if from.is_empty() { self.0 } else { "glint 1" };
        Ok(Loaded { path: path.to_string(), bytes: text.as_bytes().into() })
    }
}

/// The text laid out; `None` where it is refused.
fn laid_out(text: &str) -> Option<String> {
    format("scene.glint", text.as_bytes(), &mut Sources::default(), &mut Vec::new())
}

/// Layout of a text that is without fault, held against everything that layout promises.
fn sound(text: &str) -> String {
    let once = laid_out(text).unwrap_or_else(|| panic!("refused:\n{text}"));
    assert_eq!(meaning(&once), meaning(text), "the meaning of\n{text}\nis not that of\n{once}");
    assert_eq!(comments(&once), comments(text), "{text}\n{once}");
    assert_eq!(laid_out(&once).as_deref(), Some(once.as_str()), "laid out again:\n{text}");
    assert!(!once.contains('\r') && !once.contains("\n\n\n") && once.ends_with('\n') && !once.ends_with("\n\n"));
    assert!(once.lines().all(|line| line == line.trim_end()), "{once}");
    once
}

/// The tree without places, the version without doubt.
fn meaning(text: &str) -> String {
    let (mut sources, mut diagnostics) = (Sources::default(), Vec::new());
    let ast = parse("scene.glint", &mut Text(text), &mut sources, &mut diagnostics);
    let ast = ast.spelt_out(&sources, &|_, _| false);
    let mut out = format!("{:?}\n", ast.version.map_or(1.0, |version| version.0));
    write(&ast.statements, &sources, &mut out);
    without_places(&out)
}

fn write(statements: &[Statement], sources: &Sources, out: &mut String) {
    for statement in statements {
        out.push_str(&statement.key.text);
        for item in &statement.items {
            match &item.value {
                Value::Runs { runs, unit } => {
                    let text = &sources.get(runs.file()).text;
                    let rows: Vec<_> = (0..runs.len()).map(|i| runs.item(i, text)).collect();
                    out.push_str(&format!(" {rows:?} {unit:?}"));
                }
                value => out.push_str(&format!(" {value:?}")),
            }
        }
        if let Some(block) = &statement.block {
            out.push_str(" {\n");
            write(&block.statements, sources, out);
            out.push('}');
        }
        out.push('\n');
    }
}

fn without_places(text: &str) -> String {
    let mut parts = text.split("Span { file: FileId(");
    let first = parts.next().unwrap_or_default().to_string();
    parts.fold(first, |out, part| out + part.split_once('}').map_or("", |(_, rest)| rest))
}

/// The comments of a text, from `#` to the last character that shows.
fn comments(text: &str) -> Vec<&str> {
    let mut out = Vec::new();
    for line in text.lines() {
        let (mut quoted, mut escaped) = (false, false);
        for (i, c) in line.char_indices() {
            match c {
                '#' if !quoted => {
                    out.push(line[i..].trim_end());
                    break;
                }
                '"' if !escaped => quoted = !quoted,
                _ => {}
            }
            escaped = quoted && c == '\\' && !escaped;
        }
    }
    out
}

fn blank() -> impl Strategy<Value = String> {
    prop::sample::select(vec![" ", "  ", "\t", " \t "]).prop_map(str::to_string)
}

fn word() -> impl Strategy<Value = String> {
    let words = ["sensor", "a", "paint_2", "split", "x1", "prefix.name", "facing", "like", "grey", "Zone"];
    prop::sample::select(words.to_vec()).prop_map(str::to_string)
}

fn digits() -> impl Strategy<Value = String> {
    let known = ["0", "-0.50", "+3", "1e-3", "007", "23.0", "-1.5E+7", "1234567.125"];
    prop_oneof![prop::sample::select(known.to_vec()).prop_map(str::to_string), any::<i32>().prop_map(|n| n.to_string())]
}

fn unit() -> impl Strategy<Value = String> {
    prop::sample::select(vec!["m", "nm", "deg", "%", "W/m2/sr/um", "e-", "km"]).prop_map(str::to_string)
}

fn string() -> impl Strategy<Value = String> {
    let texts = [
        r#""a b""#,
        r#""""#,
        r##""# no comment, [no list] {""##,
        r#""\"\\""#,
        r#""Dächer µ …""#,
        r#""sunglint:a.csv""#,
    ];
    prop::sample::select(texts.to_vec()).prop_map(str::to_string)
}

fn vector() -> impl Strategy<Value = String> {
    let inside = prop_oneof![
        8 => blank(),
        1 => Just("\n".to_string()),
        1 => Just(" # within\n\n".to_string()),
    ];
    (prop::collection::vec((digits(), inside), 2..4), prop::option::of(blank())).prop_map(|(parts, lead)| {
        format!("({}{})", lead.unwrap_or_default(), parts.into_iter().map(|(d, i)| d + &i).collect::<String>())
    })
}

fn run() -> impl Strategy<Value = String> {
    (prop::collection::vec((vector(), prop_oneof![Just(String::new()), blank()]), 1..5), prop::option::of(unit()))
        .prop_map(|(points, unit)| {
            points.into_iter().map(|(p, b)| p + &b).collect::<String>() + &unit.unwrap_or_default()
        })
}

fn cell() -> impl Strategy<Value = String> {
    prop_oneof![
        3 => digits(),
        3 => (digits(), blank(), unit()).prop_map(|(d, b, u)| d + &b + &u),
        2 => word(),
        1 => string(),
    ]
}

fn list() -> impl Strategy<Value = String> {
    let apart =
        prop::sample::select(vec![",", ", ", " ,\t", "\n", ",\n\n\n", " # row\n", ", # row\r\n  # alone\n", ",,"]);
    let lead = prop::sample::select(vec!["", " ", "\n  ", " # open\n", "\n\n# first\n"]);
    let row = prop_oneof![
        prop::collection::vec((cell(), blank()), 1..4)
            .prop_map(|cells| cells.into_iter().map(|(c, b)| c + &b).collect::<String>()),
        run(),
    ];
    let table = prop::collection::vec((digits(), unit(), digits()).prop_map(|(a, u, b)| format!("{a}  {u} {b}")), 2..6);
    prop_oneof![
        (lead.clone(), prop::collection::vec((row, apart), 0..5), prop::option::of(unit())).prop_map(
            |(lead, rows, unit)| {
                let rows: String = rows.into_iter().map(|(row, apart)| row + apart).collect();
                format!("[{lead}{rows}] {}", unit.unwrap_or_default())
            }
        ),
        (lead, table).prop_map(|(lead, rows)| format!("[{lead}{}]", rows.join("\n"))),
    ]
}

fn value() -> impl Strategy<Value = String> {
    let moments =
        ["1992-06-18 12:00 -04:00", "1992-06-18T16:00:00Z", "09:30", "1992-06-18", "-04:00", "12:00:30.5   UTC"];
    let ranges = ["420..520 nm", "420 .. 520 nm", "1e-3 ..2", "640 x 480", "640   x  480"];
    prop_oneof![
        2 => cell(),
        1 => prop::sample::select(moments.to_vec()).prop_map(str::to_string),
        1 => prop::sample::select(ranges.to_vec()).prop_map(str::to_string),
        2 => run(),
        1 => list(),
    ]
}

/// A statement without block: values, the first perhaps on a line of its own.
fn plain() -> impl Strategy<Value = String> {
    let goes_on = prop_oneof![
        6 => blank(),
        1 => Just("\n    ".to_string()),
        1 => Just(" # goes on\n\n\t".to_string()),
    ];
    let bulk = prop_oneof![run(), list(), string(), digits()];
    prop_oneof![
        3 => (word(), prop::collection::vec((blank(), value()), 0..4))
            .prop_map(|(key, values)| values.into_iter().fold(key, |out, (b, v)| out + &b + &v)),
        1 => (word(), goes_on, bulk).prop_map(|(key, apart, value)| key + &apart + &value),
        1 => (word(), prop::collection::vec(run(), 2..5)).prop_map(|(name, runs)| {
            runs.into_iter().map(|run| format!("facet {name} {run}\n")).collect::<String>()
        }),
    ]
}

fn end() -> impl Strategy<Value = String> {
    let ends =
        ["\n", "\r\n", ", ", ",", "\n\n\n\n", " # behind\n", "\t\t# Dächer \r\n", "\n# alone\n\n# and more\n", " ,, "];
    prop::sample::select(ends.to_vec()).prop_map(str::to_string)
}

fn statement() -> impl Strategy<Value = String> {
    plain().prop_recursive(4, 24, 5, |inner| {
        let open = prop::sample::select(vec![" {", "{", "\n{", " # before\n# and\n {", " { # open\n"]);
        let close = prop::sample::select(vec!["}", " }", "\n}"]);
        let inside = prop::collection::vec((inner, end()), 0..5);
        (plain(), open, inside, close, prop::option::of(end())).prop_map(|(head, open, inside, close, lead)| {
            let inside: String = inside.into_iter().map(|(s, e)| s + &e).collect();
            format!("{}{open}{}{inside}{close}", head.trim_end(), lead.unwrap_or_default())
        })
    })
}

fn scene() -> impl Strategy<Value = String> {
    let head = prop::sample::select(vec!["glint 1\n", "", "# head\r\n\r\nglint 1,", "\n\n  glint   1 # first\n"]);
    (head, prop::collection::vec((statement(), end()), 0..8))
        .prop_map(|(head, parts)| head.to_string() + &parts.into_iter().map(|(s, e)| s + &e).collect::<String>())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, max_global_rejects: 30_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any scene without a fault: same tree, same comments in order, and laid out twice as once. A generated text may run
    /// words and values together into a fault; such a text is refused, and not counted.
    #[test]
    fn layout_keeps_meaning_and_comments_and_is_its_own_fixed_point(text in scene()) {
        prop_assume!(laid_out(&text).is_some());
        sound(&text);
    }

    /// Whatever the bytes are: no panic, and an answer that stands when it is asked again.
    #[test]
    fn any_text_is_laid_out_or_refused(text in "[a-z0-9 \\n#\",{}()\\[\\].\\\\-]{0,80}") {
        if let Some(once) = laid_out(&text) {
            prop_assert_eq!(laid_out(&once), Some(once.clone()), "{}", text);
            prop_assert_eq!(meaning(&once), meaning(&text), "{}", text);
        }
    }
}

/// The files of the language page and the examples that are shipped, which are laid out already.
#[test]
fn every_example_keeps_its_meaning_and_the_shipped_ones_stand_as_laid_out() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut seen = 0;
    let mut folders = vec![root.join("tests/language"), root.join("../../examples")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "glint") {
                let text = std::fs::read_to_string(&path).unwrap();
                let once = sound(&text);
                if path.starts_with(root.join("../../examples")) {
                    assert_eq!(once, text, "{}", path.display());
                }
                sound(&text.replace('\n', "\r\n"));
                sound(&text.replace("  ", " \t "));
                seen += 1;
            }
        }
    }
    assert!(seen >= 7, "{seen}");
}

#[test]
fn each_rule_of_layout_shows() {
    for (text, laid) in [
        ("", ""),
        ("a 1, b 2", "a 1\nb 2\n"),
        ("# head\na 1", "# head\na 1\n"),
        ("a 1\r\n\r\n\r\n\r\nb 2\r\n", "a 1\n\nb 2\n"),
        ("\n\n\na   30\tdeg", "\na 30 deg\n"),
        ("site{latitude 43 deg,longitude 2 deg}", "site { latitude 43 deg, longitude 2 deg }\n"),
        ("sensor roof\n{\na 1,b 2}", "sensor roof {\n  a 1\n  b 2\n}\n"),
        ("a { b { c 1 } # keep\n}", "a {\n  b { c 1 }   # keep\n}\n"),
        ("a {}\nb {\n\n}", "a { }\nb { }\n"),
        ("a {\n\n  b 1\n\n\n  c 2\n\n}", "a {\n  b 1\n\n  c 2\n}\n"),
        ("a (0  0 0)( 1 0\n0 )m", "a (0 0 0) (1 0 0) m\n"),
        ("a g (0 0 0)\n        (1 0 0)m", "a g (0 0 0)\n  (1 0 0) m\n"),
        ("a [1,2 ,3,]km", "a [1, 2, 3] km\n"),
        ("a 420 .. 520 nm", "a 420..520 nm\n"),
        ("t [ 400 nm 0.1\n1000 nm 12.25\n500 nm 1]", "t [\n   400 nm  0.1\n  1000 nm 12.25\n   500 nm  1\n]\n"),
        (
            "f g [(0 0 0) (1 0 0) (1 10 0),(0 0 0)\n(2 0 0)] m",
            "f g [\n  (0 0 0) (1 0 0) (1 10 0), (0 0 0)\n  (2 0 0)\n] m\n",
        ),
        (
            "a 1          # kept in its column\nlonger 2     # too",
            "a 1          # kept in its column\nlonger 2     # too\n",
        ),
        ("sensor roof   # why\n# more\n{ a 1 }", "sensor roof { # why\n  # more\n  a 1\n}\n"),
        ("a 1, # of a\nb 2 # of b", "a 1  # of a\nb 2 # of b\n"),
        ("a [ # rows\n1 2 # one\n\n# alone\n3 4]", "a [ # rows\n  1 2 # one\n\n  # alone\n  3 4\n]\n"),
        ("s \"a  #  b\"   c", "s \"a  #  b\" c\n"),
    ] {
        assert_eq!(sound(&format!("glint 1\n{text}")), format!("glint 1\n{laid}"), "{text}");
    }
}

/// A block of one line that does not fit in 100 columns is opened, and what is in it again where that does not fit.
#[test]
fn a_block_of_one_line_stays_up_to_a_hundred_columns() {
    let block = |n: usize| format!("glint 1\na {{ b {{ c \"{}\" }} }}\n", "é".repeat(n));
    let most = 100 - "a { b { c \"\" } }".len();
    assert_eq!(sound(&block(most)), block(most));
    let text = "é".repeat(most + 1);
    assert_eq!(sound(&block(most + 1)), format!("glint 1\na {{\n  b {{ c \"{text}\" }}\n}}\n"));
    let text = "é".repeat(100);
    assert_eq!(sound(&block(100)), format!("glint 1\na {{\n  b {{\n    c \"{text}\"\n  }}\n}}\n"));
}

#[test]
fn the_version_is_added_and_a_faulty_text_is_refused() {
    assert_eq!(laid_out("a 1").as_deref(), Some("glint 1\na 1\n"));
    assert_eq!(laid_out("").as_deref(), Some("glint 1\n"));
    assert_eq!(laid_out("\u{FEFF}# head\n a 1").as_deref(), Some("glint 1\n# head\na 1\n"));
    for text in ["a {", "a = 1", "a 30deg", "a (1 2", "a \"open", "a 5 µm", "// a", "a [1, [2]]", "1 2"] {
        assert_eq!(laid_out(text), None, "{text}");
    }
}

/// One wide row would make 10⁵ rows as wide: such a list is not aligned, and grows by no more than its indentation.
#[test]
fn a_long_table_with_one_wide_row_does_not_grow() {
    let rows: String = (0..100_000).map(|i| format!("{i} nm 0.5\n")).collect();
    let text = format!("glint 1\nt [\n{rows}{} nm 1\n]\n", "w".repeat(5000));
    let once = laid_out(&text).unwrap();
    assert!(once.len() < text.len() + 2 * 100_002, "{}", once.len());
    let deep = format!("glint 1\n{}{}", "a { ".repeat(32), "} ".repeat(32));
    sound(&deep);
}
