//! Text to tree: the forms of the language, its examples, and texts that are broken in every way.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;

use sunglint_dsl::ast::{Ast, Item, Statement, Value};
use sunglint_dsl::{Diagnostic, LoadError, Loaded, Loader, Severity, Sources, Span, parse};

/// Files in memory.
struct Files(BTreeMap<String, Vec<u8>>);

impl Loader for Files {
    fn read(&mut self, path: &str, _from: &str) -> Result<Loaded, LoadError> {
        match self.0.get(path) {
            Some(bytes) => Ok(Loaded { path: path.to_string(), bytes: Arc::from(bytes.as_slice()) }),
            None => {
                let nearest = self.0.keys().find(|key| strsim_near(key, path)).cloned();
                Err(LoadError { message: format!("`{path}` is not there"), nearest })
            }
        }
    }
}

fn strsim_near(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).filter(|(a, b)| a != b).count() <= 2
}

fn read(files: &[(&str, &[u8])]) -> (Ast, Sources, Vec<Diagnostic>) {
    let mut loader = Files(files.iter().map(|(path, bytes)| (path.to_string(), bytes.to_vec())).collect());
    let (mut sources, mut diagnostics) = (Sources::default(), Vec::new());
    let ast = parse(files[0].0, &mut loader, &mut sources, &mut diagnostics);
    (ast, sources, diagnostics)
}

/// The tree of a text that stands below a version line, and what was found.
fn tree(text: &str) -> (String, Vec<String>) {
    let whole = format!("glint 1\n{text}");
    let (ast, sources, diagnostics) = read(&[("main.glint", whole.as_bytes())]);
    check_spans(&ast, &sources, &diagnostics);
    (show(&ast, &sources), found(&diagnostics, &sources))
}

fn found(diagnostics: &[Diagnostic], sources: &Sources) -> Vec<String> {
    let place = |span: Span| {
        let (line, column) = sources.line_column(span);
        format!("{line}:{column} {}", sources.text(span).replace('\n', "\\n"))
    };
    let show =
        |d: &Diagnostic| format!("{} {} | {} | {}", d.code, d.span.map(place).unwrap_or_default(), d.message, d.label);
    diagnostics.iter().map(show).collect()
}

fn codes(text: &str) -> Vec<&'static str> {
    let whole = format!("glint 1\n{text}");
    let (ast, sources, diagnostics) = read(&[("main.glint", whole.as_bytes())]);
    check_spans(&ast, &sources, &diagnostics);
    diagnostics.iter().map(|d| d.code).collect()
}

/// A tree that must be without fault.
fn clean(text: &str) -> String {
    let (tree, found) = tree(text);
    assert!(found.is_empty(), "{text}\n{found:#?}");
    tree.trim_end().to_string()
}

fn show(ast: &Ast, sources: &Sources) -> String {
    let mut out = String::new();
    lines(&ast.spelt_out(sources, &|_, _| false).statements, sources, 0, &mut out);
    out
}

fn lines(statements: &[Statement], sources: &Sources, depth: usize, out: &mut String) {
    for statement in statements {
        write!(out, "{:1$}{2}", "", 2 * depth, statement.key.text).unwrap();
        statement.items.iter().for_each(|item| write!(out, " {}", one(item, sources)).unwrap());
        match &statement.block {
            None => out.push('\n'),
            Some(block) => {
                out.push_str(" {\n");
                lines(&block.statements, sources, depth + 1, out);
                writeln!(out, "{:1$}}}", "", 2 * depth).unwrap();
            }
        }
    }
}

/// Units stand in `<…>`, so that it shows what was taken for one.
fn one(item: &Item, sources: &Sources) -> String {
    let with =
        |unit: &Option<sunglint_dsl::ast::Word>| unit.as_ref().map_or(String::new(), |unit| format!("<{}>", unit.text));
    match &item.value {
        Value::Word(word) => word.clone(),
        Value::Number { number, digits, unit } => {
            assert_eq!(digits.parse::<f64>().unwrap(), *number);
            format!("{digits}{}", with(unit))
        }
        Value::Range { low, high, unit } => format!("{low}..{high}{}", with(unit)),
        Value::Grid(m, n) => format!("grid({m},{n})"),
        Value::Points { points, unit } => {
            let points: Vec<String> = points.iter().map(|point| format!("{:?}", point.numbers())).collect();
            format!("points{}{}", points.concat(), with(unit))
        }
        Value::List { rows, unit } => {
            let rows: Vec<String> = rows
                .iter()
                .map(|row| row.iter().map(|item| one(item, sources)).collect::<Vec<_>>().join(" "))
                .collect();
            format!("list[{}]{}", rows.join(" | "), with(unit))
        }
        Value::Runs { runs, unit } => {
            let text = &sources.get(runs.file()).text;
            let rows: Vec<String> = (0..runs.len()).map(|i| one(&runs.item(i, text), sources)).collect();
            format!("list[{}]{}", rows.join(" | "), with(unit))
        }
        Value::Text(text) => format!("{text:?}"),
        Value::Moment { date, clock, offset } => {
            let parts =
                [date.map(|d| format!("{d:?}")), clock.map(|c| format!("{c:?}")), offset.map(|o| format!("{o:+}min"))];
            format!("moment{}", parts.into_iter().flatten().collect::<String>())
        }
    }
}

/// Every place lies in its file, on character boundaries, and within the place of what holds it.
fn check_spans(ast: &Ast, sources: &Sources, diagnostics: &[Diagnostic]) {
    let check = |span: Span| {
        let text = &sources.get(span.file).text;
        assert!(span.start <= span.end && span.end as usize <= text.len(), "{span:?}");
        assert!(text.is_char_boundary(span.start as usize) && text.is_char_boundary(span.end as usize), "{span:?}");
    };
    let inside = |inner: Span, outer: Span| {
        check(inner);
        assert!(
            inner.file == outer.file && outer.start <= inner.start && inner.end <= outer.end,
            "{:?} in {:?}",
            sources.text(inner),
            sources.text(outer)
        );
    };
    fn walk(statements: &[Statement], sources: &Sources, inside: &dyn Fn(Span, Span)) {
        for statement in statements {
            inside(statement.key.span, statement.span);
            for item in &statement.items {
                inside(item.span, statement.span);
                match &item.value {
                    Value::Points { points, .. } => points.iter().for_each(|point| inside(point.span, item.span)),
                    Value::Runs { runs, .. } => {
                        let text = &sources.get(runs.file()).text;
                        for i in 0..runs.len() {
                            let row = runs.item(i, text);
                            inside(row.span, item.span);
                            let Value::Points { points, .. } = &row.value else { panic!() };
                            points.iter().for_each(|point| inside(point.span, row.span));
                        }
                    }
                    Value::List { rows, .. } => rows.iter().flatten().for_each(|cell| inside(cell.span, item.span)),
                    _ => {}
                }
            }
            if let Some(block) = &statement.block {
                block.statements.iter().for_each(|inner| inside(inner.span, block.span));
                walk(&block.statements, sources, inside);
            }
        }
    }
    walk(&ast.spelt_out(sources, &|_, _| false).statements, sources, &inside);
    for diagnostic in diagnostics {
        diagnostic.span.into_iter().for_each(check);
        diagnostic.notes.iter().for_each(|(span, _)| check(*span));
        assert!(!diagnostic.message.is_empty());
    }
}

const MINIMAL: &str = include_str!("language/minimal.glint");
const SITE: &str = include_str!("language/site.glint");
const STUDY: &str = include_str!("language/study.glint");
const PANELS: &str = include_str!("language/panels.glint");

fn example(name: &str) -> String {
    let all = [("minimal.glint", MINIMAL), ("site.glint", SITE), ("study.glint", STUDY), ("panels.glint", PANELS)];
    let mut files: Vec<(&str, &[u8])> = all.iter().map(|(path, text)| (*path, text.as_bytes())).collect();
    files.sort_by_key(|(path, _)| *path != name);
    let (ast, sources, diagnostics) = read(&files);
    assert!(diagnostics.is_empty(), "{:#?}", found(&diagnostics, &sources));
    check_spans(&ast, &sources, &diagnostics);
    assert_eq!(ast.version.unwrap().0, 1.0);
    show(&ast, &sources)
}

#[test]
fn the_minimal_example_parses_to_its_tree() {
    insta::assert_snapshot!(example("minimal.glint"));
}

#[test]
fn the_site_of_1993_parses_to_its_tree() {
    insta::assert_snapshot!(example("site.glint"));
}

#[test]
fn a_study_holds_the_statements_of_the_site_that_it_includes() {
    let study = example("study.glint");
    assert!(study.starts_with(&example("site.glint")));
    insta::assert_snapshot!(study[example("site.glint").len()..]);
}

/// Section 2 of the language, one statement of each form.
#[test]
fn every_statement_of_the_language_parses() {
    let text = r#"
scene "roof"
plugin "libhapke" as lab
database "materials"
define haze 5 km
define bands_used [red, nir]
site { latitude 43.084 deg, longitude -77.674 deg, elevation 168 m, crs "EPSG:32618", convergence 0.9 deg }
collect noon { at [1992-06-18 12:00 -04:00, 1992-06-18T16:00:00Z] }
collect day { on [1992-06-18, 1992-06-19] from sunrise to sunset -1 h every 30 min, zone -04:00, weather hazy }
collect lab { sun zenith 30 deg azimuth 120 deg }
collect dark { sun none }
weather hazy { aod 0.3, pressure 1013 hPa, temperature 20 degC, humidity 60 %, water 2 g/cm2, ozone 320 DU
  cloud { optical_depth 4, base 1 km, top 1.5 km } }
atmosphere lab.dense { streams 16 }
material lamp code 9 like glass { emission [400 nm 1.5, 700 nm 2] W/m2/sr/um, lab.hapke rough { w 0.3 } }
material alias like grass
facets grass [(0 0 0) (1 0 0) (1 1 0), (1 1 0) (0 1 0) (0 0 0)] m
disk grey radius 2 m facing (0 0 10) m at (0 5 1) m
box brick size (4 3 2.4) m at (0 1.51 0) m heading 30 deg
cylinder bark radius 10 cm height 3 m sides 8 at (1 1) m
mesh "truck.obj" unit cm up y at (9 14) m heading 65 deg { map "Glass" to mirror, map "*" to shed_dark }
place car as pickup at (1 2) m heading 65 deg pitch 1 deg roll 2 deg scale 2
place tree grid 3 x 4 spacing (1 2) m at (0 0) m
place tree from "trees.csv"
place tree at [(0 0), (1 2)] m
scatter tree count 12 within box size (1 1 1) m at (0 0 0) m spacing 2 m scale 0.8..1.2 orientation spherical seed 3
terrain "hill.asc" { origin (0 0) m, spacing 30 m, material grass, map 3 to rock }
ground grass height 0 m
periodic (10 0) (0 10) m
sensor roof like base {
  projection pushbroom, altitude 700 km, view_zenith 10 deg, speed 7 km/h, line_rate 2 kHz, pixels 640 x 480
  band red 600..750 nm, band nir centre 0.85 um fwhm 0.1 um, band b response "b.csv" column red
  bands sentinel2a only [B2, B3], bands 400..700 nm every 5 nm fwhm 5 nm
  ccd { gain 20 e-/DN, full_well 60000 e-, dark 2 e-/s, bits 8 }
}
experiment e like default {
  algorithm full { adjacency on, depth unlimited }
  reflectance sweep [ideal, split] else ideal for [mirror, glass]
  weather { visibility sweep [5, 10] km }
  error 0.5 % floor 0.01 W/m2/sr/um
  define haze 10 km
  time 30 s, seed 7, products [radiance, truth]
}
snapshot { pixels 64 x 48, tolerance 0.1 % }
"#;
    insta::assert_snapshot!(clean(text));
}

#[test]
fn a_statement_ends_at_its_line_a_comma_or_a_brace() {
    assert_eq!(clean("a 1, b 2\nc 3 { d 4 }"), "a 1\nb 2\nc 3 {\n  d 4\n}");
    assert_eq!(clean("a 1,\n, b 2,\n\n"), "a 1\nb 2");
    assert_eq!(clean("a\r\nb 1 # not \"this\r\nc \"# but this\" # {\r\n"), "a\nb 1\nc \"# but this\"");
    assert_eq!(clean("a { b { c 1 } }, d { }"), "a {\n  b {\n    c 1\n  }\n}\nd {\n}");
    assert_eq!(clean("\u{b}".trim()), "");
}

#[test]
fn a_line_that_begins_with_no_word_continues_the_one_above() {
    assert_eq!(clean("facet grass\n  (0 0 0)\n  # a comment\n\n  (1 0 0) (1 1 0) m\nb"), {
        "facet grass points[0.0, 0.0, 0.0][1.0, 0.0, 0.0][1.0, 1.0, 0.0]<m>\nb"
    });
    assert_eq!(clean("sensor roof\n{ a }"), "sensor roof {\n  a\n}");
    assert_eq!(clean("only\n[a,\nb\nc]"), "only list[a | b | c]");
    assert_eq!(clean("look_at\n(0 3 0) m"), "look_at points[0.0, 3.0, 0.0]<m>");
    assert_eq!(clean("visibility\n-23 km"), "visibility -23<km>");
}

#[test]
fn a_word_behind_a_bare_number_is_its_unit_where_nothing_else_fits() {
    for (text, tree) in [
        ("field_of_view 30 degrees", "field_of_view 30<degrees>"),
        ("field_of_view 30 foo", "field_of_view 30<foo>"),
        ("field_of_view 30 foo, a", "field_of_view 30<foo>\na"),
        ("position (0 0 1) metres at b", "position points[0.0, 0.0, 1.0]<metres> at b"),
        ("size (1 1) yards at (0 0) m", "size points[1.0, 1.0]<yards> at points[0.0, 0.0]<m>"),
        ("size (2 1) KM facing up", "size points[2.0, 1.0]<KM> facing up"),
        ("sun zenith 30 azimuth 120 deg", "sun zenith 30 azimuth 120<deg>"),
        ("material m code 5 like grey", "material m code 5 like grey"),
        ("material m code 5 { a }", "material m code 5 {\n  a\n}"),
        (
            "place car at (1 2) m heading 65 deg scale 2 seed 1",
            "place car at points[1.0, 2.0]<m> heading 65<deg> scale 2 seed 1",
        ),
        ("scatter t scale 0.8..1.2 heading 0..360 deg", "scatter t scale 0.8..1.2 heading 0..360<deg>"),
        ("scatter t scale 2 orientation spherical", "scatter t scale 2 orientation spherical"),
        ("scatter t count 12 within box size (1 1 1) m", "scatter t count 12 within box size points[1.0, 1.0, 1.0]<m>"),
        ("cylinder b sides 8 at (1 1) m", "cylinder b sides 8 at points[1.0, 1.0]<m>"),
        ("place t grid 3 x 4 spacing (1 2) m", "place t grid grid(3,4) spacing points[1.0, 2.0]<m>"),
        ("bands 400..700 every 5 fwhm 5 nm", "bands 400..700 every 5 fwhm 5<nm>"),
        (
            "reflectance [400 nm 0.1, 700 nm 0.2] extrapolate hold",
            "reflectance list[400<nm> 0.1 | 700<nm> 0.2] extrapolate hold",
        ),
        ("reflectance [blue 0.05, nir 5 %]", "reflectance list[blue 0.05 | nir 5<%>]"),
        ("emission 0.3 W/m2/sr/um", "emission 0.3<W/m2/sr/um>"),
        ("emission 0.3 W m-2 sr-1 um-1", "emission 0.3<W m-2 sr-1 um-1>"),
        ("gain 20 e-/DN", "gain 20<e-/DN>"),
        ("full_well 6e4 e-", "full_well 6e4<e->"),
        ("ozone 0.3 atm-cm", "ozone 0.3<atm-cm>"),
        ("extinction 0.2 /km", "extinction 0.2</km>"),
        ("visibility 23 km km", "visibility 23<km> km"),
        ("collect [roof, tower] only", "collect list[roof | tower] only"),
        ("t [0 deg 10 deg 0.3, 5 deg 10 deg 0.4]", "t list[0<deg> 10<deg> 0.3 | 5<deg> 10<deg> 0.4]"),
        ("visibility [5, 10, 23] kilometres", "visibility list[5 | 10 | 23]<kilometres>"),
        ("map 3 to rock", "map 3 to rock"),
        ("weights [a 0.3, b 0.7]", "weights list[a 0.3 | b 0.7]"),
    ] {
        assert_eq!(clean(text), tree);
    }
}

#[test]
fn dates_clocks_and_offsets_are_moments() {
    for (text, tree) in [
        ("at 1992-06-18 12:00 -04:00", "at moment(1992, 6, 18)(12, 0, 0.0)-240min"),
        ("at 1992-06-18T16:00:07.5Z", "at moment(1992, 6, 18)(16, 0, 7.5)+0min"),
        ("at 1992-06-18 16:00 Z", "at moment(1992, 6, 18)(16, 0, 0.0)+0min"),
        ("at 1992-06-18 16:00 UTC", "at moment(1992, 6, 18)(16, 0, 0.0)+0min"),
        ("at 1992-06-18 12:00", "at moment(1992, 6, 18)(12, 0, 0.0)"),
        (
            "on 1992-06-18 from 09:30 to 16:00 every 30 min",
            "on moment(1992, 6, 18) from moment(9, 30, 0.0) to moment(16, 0, 0.0) every 30<min>",
        ),
        (
            "on 1992-06-18 from sunrise to sunset -1 h every 30 min",
            "on moment(1992, 6, 18) from sunrise to sunset -1<h> every 30<min>",
        ),
        ("zone +05:30", "zone moment+330min"),
        ("zone UTC", "zone UTC"),
        (
            "on [1992-06-18, 1992-06-19] from 06:00",
            "on list[moment(1992, 6, 18) | moment(1992, 6, 19)] from moment(6, 0, 0.0)",
        ),
    ] {
        assert_eq!(clean(text), tree);
    }
}

#[test]
fn strings_keep_what_is_not_ascii_and_two_escapes() {
    assert_eq!(clean(r#"scene "Dächer \"1993\" \\ µm°""#), r#"scene "Dächer \"1993\" \\ µm°""#);
}

#[test]
fn places_are_exact() {
    let text = "glint 1\nsensor roof { # Dächer\n  field_of_view 30 deg, position (0 -25 15)\n    (1 2 3) m }\n";
    let (ast, sources, _) = read(&[("main.glint", text.as_bytes())]);
    let sensor = &ast.statements[0];
    assert_eq!(sources.text(sensor.span), "sensor roof");
    let block = sensor.block.as_ref().unwrap();
    assert!(sources.text(block.span).starts_with("{ #") && sources.text(block.span).ends_with("m }"));
    let [view, position] = &block.statements[..] else { panic!() };
    assert_eq!(sources.text(view.items[0].span), "30 deg");
    assert_eq!(sources.line_column(view.items[0].span), (3, 17));
    let Value::Number { unit: Some(unit), .. } = &view.items[0].value else { panic!() };
    assert_eq!(sources.text(unit.span), "deg");
    assert_eq!(sources.text(position.items[0].span), "(0 -25 15)\n    (1 2 3) m");
    let Value::Points { points, .. } = &position.items[0].value else { panic!() };
    assert_eq!(sources.text(points[1].span), "(1 2 3)");
}

#[test]
fn each_fault_of_shape_costs_one_message() {
    let mut wrong = Vec::new();
    for (text, code, place, label) in [
        ("a 30 = 4", "S02", "=", "leave it out"),
        ("visibility = 23 km", "S02", "=", "leave it out"),
        ("visibility: 23 km", "S02", ":", "leave it out"),
        ("map \"Glass\" -> mirror", "S02", "->", "`to`?"),
        ("map * to mirror", "S02", "*", "`\"*\"`?"),
        ("a 1; b 2", "S02", ";", "`,`?"),
        ("// a comment\na 1", "S02", "//", "`#`?"),
        ("a 1 // two", "S02", "//", "`#`?"),
        ("include \"x.glint", "S02", "\"x.glint", "`\"` at its end"),
        ("mesh \"a\\b.obj\"", "S02", "\"a\\b.obj\"", "`\\\\`, or `/` in a path"),
        ("material shed-white", "S02", "shed-white", "`shed_white`?"),
        ("a 2 * 3", "S02", "*", "`\"*\"`?"),
        ("= 3\nb 1", "S02", "=", "a statement is a word, then its values"),
        ("a [[1, 2], [3, 4]] m", "S02", "[", "leave this `[` and its `]` out?"),
        ("facet g (0 0 0), (1 0 0), (1 1 0) m", "S02", ",", "leave it out"),
        ("at (1, 2, 3) m", "S02", ",", "leave it out"),
        ("a { b } c 1", "S03", "c", "a comma or a line break before it?"),
        ("position (0 0 1) m\n(0 3 0) m", "S03", "(0 3 0)", "which key is it for?"),
        ("visibility 23 km\n30 deg", "S03", "30", "which key is it for?"),
        ("sensor s {\n  30 deg\n}", "S03", "30", "which key is it for?"),
        ("pixels 640, 480, 3", "S03", "480", "which key is it for?"),
        ("a { b }\n{ c }", "S02", "{", "a word is missing before `{`"),
        ("a 5 µm", "S04", "µ", "`u`?"),
        ("a 30°", "S04", "°", "`deg`?"),
        ("a –5 m", "S04", "–", "`-`?"),
        ("a (–5 0 1) m", "S04", "–", "`-`?"),
        ("scene “roof, 1993”", "S04", "“", "`\"`, and at its end"),
        ("a 1\u{a0}km", "S04", "\u{a0}", "a plain space?"),
        ("pixels 640 × 480", "S04", "×", "`x`?"),
        ("diffuse .5", "U04", ".5", "`0.5`?"),
        ("diffuse 5.", "U04", "5.", "`5`?"),
        ("diffuse 8A", "U04", "8A", "`8`?"),
        ("diffuse 1e999", "U04", "1e999", "at most about 1.8e308"),
        ("diffuse 1_000", "U04", "1_000", "`1000`?"),
        ("visibility 23km", "U04", "23km", "`23 km`?"),
        ("humidity 60%", "U04", "60%", "`60 %`?"),
        ("full_well 60000e-", "U04", "60000e-", "`60000 e-`?"),
        ("pixels 640x480", "U04", "640x480", "`640 x 480`?"),
        ("pixels 640.5 x 480", "U04", "640.5 x 480", "such as `640 x 480`"),
        ("band a 420-520 nm", "U04", "420-520", "`420..520`?"),
        ("band a 420..520nm", "U04", "420..520nm", "`420..520 nm`?"),
        ("band a 420.. nm", "U04", "420..", "a range has two numbers: `420..520 nm`"),
        ("band a 420 nm..520 nm", "U04", "..", "`420..520`, then the unit"),
        ("at (1) m", "U04", "(1)", "`(x y z)` or `(x y)`"),
        ("at (1 2 3 4) m", "U04", "(1 2 3 4)", "`(x y z)` or `(x y)`"),
        ("at (1 2 3 m)", "U04", "m", "`(x y z) m`"),
        ("at (1 2 .5) m", "U04", ".5", "`0.5`?"),
        ("at (1 wide 2) m", "U04", "wide", "a number"),
        ("at 1992-6-18 12:00", "T01", "1992-6-18", "`1992-06-18`?"),
        ("from 9:30", "T01", "9:30", "`09:30`?"),
        ("on 18/6/1992", "T01", "18/6/1992", "`1992-06-18`?"),
        ("zone -04:75", "T01", "-04:75", "hours and minutes, such as `-04:00`"),
        ("a [1, 2", "S01", "[", "`[` without `]`"),
        ("a (1 2 3 m", "S01", "(", "`(` without `)`"),
        ("a 1)", "S01", ")", "leave it out?"),
        ("a { b 1", "S01", "{", "`{` without `}`"),
        ("a { b 1 } }", "S01", "}", "leave it out?"),
        ("glint 1", "S05", "glint 1", "leave it out"),
        ("include panels", "S02", "include panels", "`include \"panels\"`?"),
    ] {
        let whole = format!("glint 1\n{text}");
        let (ast, sources, diagnostics) = read(&[("main.glint", whole.as_bytes())]);
        check_spans(&ast, &sources, &diagnostics);
        let first: Vec<_> = (diagnostics.iter().filter(|d| d.code != "F01"))
            .map(|d| (d.code, d.span.map_or("", |span| sources.text(span)), d.label.as_str()))
            .collect();
        if first != [(code, place, label)] {
            wrong.push(format!("{text}: {first:?}, not {:?}", (code, place, label)));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn reading_goes_on_behind_a_bad_line() {
    let (tree, found) = tree("a 1\nvisibility = 23 km\nb 8A\nfield_of_view 30°\nc 2\n- item\nd 3");
    assert_eq!(tree, "a 1\nvisibility 23<km>\nb 8\nfield_of_view 30<deg>\nc 2\nd 3\n");
    assert_eq!(found.iter().map(|line| &line[..3]).collect::<Vec<_>>(), ["S02", "U04", "S04", "S02"]);
}

#[test]
fn a_forgotten_brace_costs_one_message_at_its_place() {
    let text = "sensor roof {\n  pixels 3 x 4\n  ccd {\n    bits 8\n\nexperiment e { seed 1 }\n\
                material m {\n  ideal {\n    diffuse 0.1\n}\nground m\n";
    let (tree, found) = tree(text);
    assert_eq!(found.len(), 3, "{found:#?}");
    assert!(found.iter().all(|line| line.starts_with("S01")));
    let top: Vec<&str> = tree.lines().filter(|line| line.starts_with(|c: char| c.is_alphabetic())).collect();
    assert_eq!(top, ["sensor roof {", "experiment e {", "material m {", "ground m"]);
}

#[test]
fn an_open_list_or_string_ends_with_its_line() {
    let (tree, found) = tree("sensor a {\n  only [red, nir\n  collect [x]\n  band \"b {\n    c 1\n  }\n}\nb 2");
    assert_eq!(tree, "sensor a {\n  only list[red | nir]\n  collect list[x]\n  band \"b\" {\n    c 1\n  }\n}\nb 2\n");
    assert_eq!(found.len(), 2, "{found:#?}");
}

#[test]
fn nesting_is_bounded() {
    for (open, close) in [("a { ", "}"), ("a [", "]"), ("a (", ")"), ("[", "]"), ("(", ")"), ("{", "}")] {
        for n in [31, 33, 100_000] {
            codes(&open.repeat(n));
            codes(&close.repeat(n));
            codes(&(open.repeat(n) + &close.repeat(n)));
        }
    }
    assert!(codes(&("a {\n".repeat(32) + &"}\n".repeat(32))).is_empty());
    assert_eq!(codes(&("a {\n".repeat(33) + &"}\n".repeat(33))), ["S01"]);
}

#[test]
fn findings_in_a_file_of_rubbish_are_counted_not_listed() {
    let (_, _, diagnostics) = read(&[("main.glint", "= 1\n".repeat(100_000).as_bytes())]);
    assert!(diagnostics.len() < 1100, "{}", diagnostics.len());
}

#[test]
fn a_list_of_a_hundred_thousand_rows_is_one_value() {
    let rows: String = (0..100_000).map(|i| format!("  ({i} 0 0) ({i} 1 0) (0 1 0.5),\n")).collect();
    let text = format!("glint 1\nfacets grass [\n{rows}] m\nspectrum [{}]", "400 nm 0.1, ".repeat(100_000));
    let (ast, sources, diagnostics) = read(&[("main.glint", text.as_bytes())]);
    assert!(diagnostics.is_empty());
    check_spans(&ast, &sources, &diagnostics);
    let Value::Runs { runs, unit } = &ast.statements[0].items[1].value else { panic!() };
    assert_eq!((runs.len(), unit.as_ref().unwrap().text.as_str()), (100_000, "m"));
    assert_eq!(runs.row(99_999).numbers, [99_999.0, 0.0, 0.0, 99_999.0, 1.0, 0.0, 0.0, 1.0, 0.5]);
    let Value::List { rows, .. } = &ast.statements[1].items[0].value else { panic!() };
    assert_eq!((rows.len(), rows[5].len()), (100_000, 2));
}

/// Rows are read by hand where they are plain and by the grammar where not: a string forces the grammar on a row.
#[test]
fn rows_read_by_hand_and_by_the_grammar_are_the_same() {
    for row in [
        "400 nm 0.1",
        "blue 0.05",
        "a b c",
        "1 2 3",
        "-1e-3 foo",
        "3 W/m2/sr/um 4 e-",
        "5 m (1 2) (3 4 5) m",
        "1 +2 c_d",
        "2 foo-bar",
        "7 to x9",
    ] {
        let (quick, faults) = tree(&format!("k [{row}]"));
        let (slow, same) = tree(&format!("k [\"\" {row}]"));
        assert_eq!(quick, slow.replace("[\"\" ", "["), "{faults:?} {same:?}");
    }
}

/// The same of statements: a key with a `.` forces the grammar on its line.
#[test]
fn statements_read_by_hand_and_by_the_grammar_are_the_same() {
    for rest in [
        " 400 nm 0.1",
        " blue, k 0.05",
        " a b c",
        " 1 2 3",
        " -1e-3 foo",
        " 3 W/m2/sr/um 4 e-",
        " 5 m (1 2) (3 4 5) m",
        " (0 0 0)\n  (1 0 0) # goes on\n  (1 1 0) m at (2 2) m",
        " 30 degrees at (0 0) m",
        " 1 +2 c_d # end",
        " 2 foo-bar",
        " 7 to x9",
        " \"a # b\" 5 km",
        " \"é\" to mirror",
        " [1, 2 3] km only [a, b]",
        " [(0 0 0) (1 0 0), (1 1 1) m] m { k 1 }",
        " x 5 x",
        " 640 x 480",
        " 420..520 nm",
        " 1992-06-18 12:00 -04:00",
        "(1 2 3)m{ k }",
        " name\n# comment\n{ k 1 }",
        " 30deg",
        " .5 m",
        " 5 µm",
        " a = 4; k",
        " [1, [2]] )",
    ] {
        let (quick, faults) = tree(&format!("k{rest}"));
        let (slow, same) = tree(&format!("p.k{rest}"));
        assert_eq!(quick, slow.replace("p.k", "k"));
        let places = |faults: &[String]| -> Vec<String> {
            faults.iter().map(|fault| fault.split_once(' ').map_or("", |(code, _)| code).to_string()).collect()
        };
        assert_eq!(places(&faults), places(&same), "{rest}");
    }
}

/// Statements that differ in their run alone are one in the tree, and each stands for itself once it is spelt out; what
/// looks like one and is not stays apart.
#[test]
fn statements_that_differ_in_their_run_are_packed_and_spelt_out() {
    let lines = [
        "facet grey (0 0 0) (1 0 0) (1 1 0) m",
        "facet grey (0 0 0) (1 0 0) (1 1 0)",
        "  facet   grey(0 0 1.5e3) (1 0 0)\t(1 1 0) cm # why",
        "facet grey (0 0\n 0) (1 0 0) m, facet grey (1 2 3) m",
        "facet grey (0 0) (1 0) m",
        "facet grey_2 (0 0 0) m",
        "facet grey_2 (0 0 0) m at (1 1 1) m",
        "facet grey_2 (0 0 0) metres",
        "facet grey_2 (0 0 0)\n  (1 0 0) m",
        "facet grey_2 (0 0 0) m { a 1 }",
        "facet grey_2 (0 0 0)",
        "facet grey_2 (0 0 0) foo",
        "facets grey_2 (0 0 0) m",
    ];
    let together = lines.map(|line| format!("{line}\n")).concat();
    let apart: String = lines.iter().map(|line| tree(line).0).collect();
    assert_eq!(tree(&together).0, apart);
    let facets = "facet grey (0 0 0) (1 0 0) (1 1 0) m\n".repeat(1000);
    let (ast, sources, _) = read(&[("main.glint", format!("glint 1\n{facets}").as_bytes())]);
    assert_eq!(ast.statements.len(), 1);
    let spelt = ast.spelt_out(&sources, &|_, _| false);
    assert_eq!(spelt.statements.len(), 1000);
    let last = &spelt.statements[999];
    assert_eq!(sources.line_column(last.span), (1001, 1));
    assert_eq!((sources.text(last.key.span), sources.text(last.items[0].span)), ("facet", "grey"));
    assert_eq!(sources.text(last.items[1].span), "(0 0 0) (1 0 0) (1 1 0) m");
}

/// Digits at the limits of `f64`, in a vector, a row and a statement: the number is that of `str::parse`, to the bit.
#[test]
fn packed_numbers_are_those_of_the_standard_library() {
    let mut digits: Vec<String> = [
        "0",
        "-0",
        "+0.0",
        "-0.000",
        "1",
        "9007199254740992",
        "9007199254740993",
        "9007199254740993.0",
        "90071992547409.93",
        "0.1",
        "0.30000000000000004",
        "123456789.123456789",
        "1234567890.1234567890",
        "18446744073709551615",
        "18446744073709551616",
        "99999999999999999999",
        "0.00000000000000000000001",
        "0.0000000000000000000001",
        "1e22",
        "1e23",
        "-1E-22",
        "8.5e-45",
        "4.9e-324",
        "2.4703282292062327e-324",
        "2.4703282292062328e-324",
        "2.2250738585072011e-308",
        "1.7976931348623157e308",
        "1.7976931348623158e308",
        "9007199254740991.5",
        "0.000000000000000000000000000000000000000000000000000000000000000000000000000001",
        "000000000000000000000000123.5",
        "179769313486231580793728971405301199e273",
        "0.500000000000000166533453693773481063544750213623046875",
    ]
    .map(str::to_string)
    .into();
    let mut state = 0x1234_5678_9ABC_DEF1_u64;
    for i in 0..20_000u32 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let all = format!("{state:020}");
        let (whole, part) = all[..1 + (i % 19) as usize].split_at(1 + (i % 7) as usize % (1 + (i % 19) as usize));
        digits.push(if part.is_empty() { whole.to_string() } else { format!("-{whole}.{part}") });
    }
    let rows: String = digits.iter().map(|d| format!("({d} {d}),\n")).collect();
    let text = format!("glint 1\nk [{rows}] m\n");
    let (ast, _, found) = read(&[("main.glint", text.as_bytes())]);
    assert!(found.is_empty(), "{found:?}");
    let Value::Runs { runs, .. } = &ast.statements[0].items[0].value else { panic!() };
    for (i, digits) in digits.iter().enumerate() {
        let bits = digits.parse::<f64>().unwrap().to_bits();
        assert!(runs.row(i).numbers.iter().all(|number| number.to_bits() == bits), "{digits}");
    }
    for digits in ["1e309", "-1e400", "1.8e308"] {
        assert_eq!(codes(&format!("k [(0 0) m, ({digits} 0) m]")), ["U04"], "{digits}");
    }
}

/// A fault in row 60,000 of a list is told at its token; the rows about it stand.
#[test]
fn a_fault_within_a_bulk_list_is_told_at_its_token() {
    for (wrong, code, place, rest) in [
        ("(1 0 0) (1 8A 0) (1 1 0)", "U04", "8A", true),
        ("(1 0 0) (1, 1 0) (1 1 0)", "S02", ",", true),
        ("(1 0 0) (1 1 1e999) (1 1 0)", "U04", "1e999", true),
        ("(1 0 0) (1 1 0 4) (1 1 0)", "U04", "(1 1 0 4)", true),
        ("(1 0 0) (1 1 0 (1 1 0)", "S01", "(", true),
        ("(1 0 0) ° (1 1 0)", "S04", "°", false),
        ("(1 0 0) = (1 1 0)", "S02", "=", false),
    ] {
        let row = "  (0 0 0) (1 0 0) (1 1 0)\n";
        let text = format!("glint 1\nfacets grey [\n{}  {wrong}\n{}] m\nlast 1", row.repeat(60_000), row.repeat(1000));
        let (ast, sources, faults) = read(&[("main.glint", text.as_bytes())]);
        assert_eq!(faults.iter().map(|d| d.code).collect::<Vec<_>>(), [code], "{wrong}");
        let span = faults[0].span.unwrap();
        let column = 3 + wrong.find(place).unwrap();
        let column = if code == "S01" { 3 + wrong.find("(1 1 0 (").unwrap() } else { column };
        assert_eq!((sources.text(span), sources.line_column(span)), (place, (60_003, column)), "{wrong}");
        assert_eq!(ast.statements.len(), 2);
        let rows = match &ast.statements[0].items[1].value {
            Value::Runs { runs, .. } => runs.len(),
            Value::List { rows, .. } => rows.len(),
            other => panic!("{other:?}"),
        };
        assert!(if rest { rows == 61_001 } else { (61_000..61_010).contains(&rows) }, "{wrong}: {rows}");
    }
}

#[test]
fn an_include_stands_for_its_statements_once() {
    let main = b"glint 1\ninclude \"b.glint\"\ninclude \"./b.glint\"\nlast".as_slice();
    let (ast, sources, found) = read(&[
        ("main.glint", main),
        ("b.glint", b"glint 1\nscene \"not this\"\nfirst\nsnapshot { pixels 1 x 1 }"),
        ("./b.glint", b"glint 1\nnot_again"),
    ]);
    assert_eq!((show(&ast, &sources).as_str(), found.len()), ("first\nlast\n", 0));
}

#[test]
fn a_cycle_of_includes_shows_its_path() {
    let (_, sources, diagnostics) = read(&[
        ("a.glint", b"glint 1\ninclude \"b.glint\"".as_slice()),
        ("b.glint", b"glint 1\ninclude \"c.glint\""),
        ("c.glint", b"glint 1\ninclude \"a.glint\""),
    ]);
    assert_eq!(
        found(&diagnostics, &sources),
        ["N04 2:9 \"a.glint\" | a file includes itself: `a.glint` → `b.glint` → `c.glint` → `a.glint` | \
          this closes the circle"]
    );
    assert_eq!(diagnostics[0].notes.len(), 2);
}

#[test]
fn an_include_that_is_missing_offers_the_nearest() {
    let (ast, sources, diagnostics) =
        read(&[("a.glint", b"glint 1\ninclude \"panel5.glint\"\nb".as_slice()), ("panels.glint", b"")]);
    assert_eq!((diagnostics[0].code, diagnostics[0].label.as_str()), ("F01", "`\"panels.glint\"`?"));
    assert_eq!(show(&ast, &sources), "b\n");
    let mut sources = Sources::default();
    let mut diagnostics = Vec::new();
    parse("none.glint", &mut Files(BTreeMap::new()), &mut sources, &mut diagnostics);
    assert_eq!(
        (diagnostics.len(), diagnostics[0].code, diagnostics[0].span, sources.iter().count()),
        (1, "F01", None, 1)
    );
}

#[test]
fn versions_are_stated_first_and_known() {
    let version = |text: &str| {
        let (ast, _, d) = read(&[("a.glint", text.as_bytes())]);
        (ast.version.map(|v| v.0), d.iter().map(|d| (d.code, d.severity == Severity::Error)).collect::<Vec<_>>())
    };
    assert_eq!(version("glint 1\na"), (Some(1.0), vec![]));
    assert_eq!(version("\u{FEFF}# c\nglint 1, a"), (Some(1.0), vec![]));
    assert_eq!(version("a"), (None, vec![("S06", false)]));
    assert_eq!(version(""), (None, vec![("S06", false)]));
    assert_eq!(version("glint 2\na"), (Some(2.0), vec![("S06", true)]));
    assert_eq!(version("glint 0\na"), (Some(0.0), vec![("S06", true)]));
    assert_eq!(version("glint 1.5\na"), (Some(1.5), vec![("S06", true)]));
    assert_eq!(version("glint one\na"), (None, vec![("S06", true)]));
    assert_eq!(version("a\nglint 1"), (Some(1.0), vec![("S06", false)]));
}

#[test]
fn what_is_not_utf8_text_is_named() {
    for (bytes, label, place) in [
        (b"glint 1\na 5 \xB5m\n".as_slice(), "byte B5 is `µ` in Latin-1", (2, 5)),
        (b"g\0l\0i\0", "this looks like UTF-16, or like no text", (1, 2)),
        (b"\xFF\xFEg\0", "this looks like UTF-16, or like no text", (1, 1)),
    ] {
        let (ast, sources, d) = read(&[("a.glint", bytes)]);
        check_spans(&ast, &sources, &d);
        assert_eq!((d.len(), d[0].code, d[0].label.as_str()), (1, "F01", label));
        assert_eq!(sources.line_column(d[0].span.unwrap()), place);
    }
}

/// Bytes of the examples changed, dropped, doubled and swapped: every text gives a tree whose places are sound, with no
/// more statements than words and no more findings than a few a line.
#[test]
fn no_change_of_bytes_breaks_the_parser() {
    let mut state = 0x9E37_79B9_7F4A_7C15u64;
    let mut random = |n: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as usize % n.max(1)
    };
    let pieces: [&[u8]; 28] = [
        b"{",
        b"}",
        b"[",
        b"]",
        b"(",
        b")",
        b"\"",
        b"#",
        b",",
        b"\n",
        b";",
        b"=",
        b"->",
        b"..",
        b".",
        b"-",
        b" x ",
        b"\\",
        b"//",
        "µ".as_bytes(),
        "“".as_bytes(),
        "°".as_bytes(),
        b"\xFF",
        b"\0",
        b"1e999",
        b"include \"main.glint\"",
        b"\r",
        b"%",
    ];
    for round in 0..20_000 {
        let text = [MINIMAL, SITE, STUDY][round % 3];
        let mut bytes = text.as_bytes().to_vec();
        for _ in 0..1 + random(6) {
            let at = random(bytes.len());
            match random(5) {
                0 => drop(bytes.remove(at)),
                1 => bytes[at] = (random(256)) as u8,
                2 => drop(bytes.splice(at..at, pieces[random(pieces.len())].iter().copied())),
                3 => {
                    let end = (at + random(40)).min(bytes.len());
                    let cut: Vec<u8> = bytes.drain(at..end).collect();
                    let to = random(bytes.len());
                    bytes.splice(to..to, cut);
                }
                _ => bytes.truncate(at.max(1)),
            }
            if bytes.is_empty() {
                break;
            }
        }
        if round % 2 == 0 {
            bytes = String::from_utf8_lossy(&bytes).into_owned().into_bytes();
        }
        let (ast, sources, diagnostics) =
            read(&[("main.glint", &bytes), ("panels.glint", PANELS.as_bytes()), ("site.glint", SITE.as_bytes())]);
        check_spans(&ast, &sources, &diagnostics);
        let lines = bytes.iter().filter(|byte| **byte == b'\n').count();
        assert!(diagnostics.len() <= 3 * lines + 20, "{}", String::from_utf8_lossy(&bytes));
    }
}
