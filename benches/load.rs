//! Loading inline geometry: `cargo bench --bench load`. Elements are facets, bytes those of the scene's text.

use std::fmt::Write;
use std::hint::black_box;

use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main, measurement::WallTime};
use sunglint::dsl::{self, LoadError, Loaded, Loader, Sources};

const ROWS: usize = 100_000;

const HEAD: &str = "glint 1
site { latitude 43.084 deg, longitude -77.674 deg, elevation 168 m }
collect { at 1992-06-18 12:00 -04:00 }
material grey { ideal { diffuse 0.18 } }
sensor roof {
  position (0 -25 15) m
  look_at (0 3 0) m
  field_of_view 30 deg
  pixels 320 x 240
  band red 600..750 nm
}
";

/// Four corners of a small quadrilateral on a grid, in a plane, typed to the millimetre.
fn corners(i: usize) -> [String; 4] {
    let (x, y) = ((i % 1000) as f64 * 1.25, (i / 1000) as f64 * 1.75);
    let z = |x: f64, y: f64| 100.0 + 0.25 * x - 0.5 * y;
    [(x, y), (x + 1.0, y), (x + 1.0, y + 1.5), (x, y + 1.5)].map(|(x, y)| format!("({x:.3} {y:.3} {:.4})", z(x, y)))
}

/// Rows of three and four corners in one list.
fn rows() -> String {
    let mut text = format!("{HEAD}facets grey [\n");
    for i in 0..ROWS {
        let n = if i % 2 == 0 { 4 } else { 3 };
        writeln!(text, "  {}", corners(i)[..n].join(" ")).unwrap();
    }
    text + "] m\n"
}

/// One statement a facet.
fn statements() -> String {
    let facet = |i| format!("facet grey {} m\n", corners(i).join(" "));
    HEAD.to_string() + &(0..ROWS).map(facet).collect::<String>()
}

/// Materials with spectra, panels in braces and comments: an ordinary scene, of many parts.
fn ordinary() -> String {
    let mut text = HEAD.to_string();
    for i in 0..ROWS / 10 {
        write!(
            text,
            "material paint_{i} {{ # from the catalogue\n  title \"paint {i}\"\n  reflectance [400 nm 0.06, 560 nm 0.10, 1000 nm \
             0.{:03}]\n  ideal\n  split {{ category mostly_diffuse, solid_angle 5 msr }}\n}}\npanel paint_{i} size (1.2 1.2) m at \
             ({i} 2 0.75) m heading {} deg facing roof\n",
            100 + i % 800,
            i % 360
        )
        .unwrap();
    }
    text
}

/// One text, whatever is asked for.
struct Text(std::sync::Arc<[u8]>);

impl Loader for Text {
    fn read(&mut self, path: &str, _: &str) -> Result<Loaded, LoadError> {
        Ok(Loaded { path: path.to_string(), bytes: self.0.clone() })
    }
}

fn measure(group: &mut BenchmarkGroup<WallTime>, name: &str, text: &str, elements: usize) {
    let bytes: std::sync::Arc<[u8]> = text.as_bytes().into();
    let parse = |sources: &mut Sources| {
        let mut diagnostics = Vec::new();
        let ast = dsl::parse("scene.glint", &mut Text(bytes.clone()), sources, &mut diagnostics);
        assert!(diagnostics.is_empty(), "{diagnostics:?}");
        ast
    };
    let catalog = sunglint::catalog();
    for throughput in [Throughput::Elements(elements as u64), Throughput::Bytes(text.len() as u64)] {
        let by = if matches!(throughput, Throughput::Bytes(_)) { "bytes" } else { "elements" };
        group.throughput(throughput);
        group.bench_function(format!("parse/{name}/{by}"), |bencher| {
            bencher.iter(|| black_box(parse(&mut Sources::default())));
        });
        group.bench_function(format!("check/{name}/{by}"), |bencher| {
            let mut sources = Sources::default();
            let ast = parse(&mut sources);
            bencher.iter(|| {
                let mut diagnostics = Vec::new();
                let scene = dsl::check(&ast, &mut sources, &catalog, &mut Text(bytes.clone()), &mut diagnostics);
                assert!(scene.is_some(), "{diagnostics:?}");
                scene
            });
        });
        group.bench_function(format!("fmt/{name}/{by}"), |bencher| {
            bencher.iter(|| sunglint::format("scene.glint", &bytes).unwrap());
        });
    }
}

fn load(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("load");
    group.sample_size(10);
    measure(&mut group, "1e5_rows", &rows(), ROWS);
    measure(&mut group, "1e5_facet_lines", &statements(), ROWS);
    measure(&mut group, "1e4_materials_and_panels", &ordinary(), ROWS / 5);
    group.finish();
}

criterion_group!(benches, load);
criterion_main!(benches);
