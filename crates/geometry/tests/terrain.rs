//! Grids from files, and the surface over them.

use std::io::Cursor;

use glam::{DAffine3, DVec2, DVec3};
use sunglint_geometry::{
    FacetId, Instance, MaterialId, Raster, RasterError, RasterFault, RasterKind, Ray, Terrain, TerrainError, World,
    read_raster,
};
use sunglint_radiometry::WorldDir;
use tiff::encoder::colortype::{ColorType, Gray32Float, Gray64Float, GrayI16, RGB8};
use tiff::encoder::{Compression, TiffEncoder, TiffValue};
use tiff::tags::{Predictor, Tag};

fn heights(text: &str) -> Raster {
    read_raster(text.as_bytes(), RasterKind::Heights).unwrap_or_else(|error| panic!("{error}: {error:?}"))
}

fn faults(bytes: &[u8], kind: RasterKind) -> Vec<RasterFault> {
    match read_raster(bytes, kind) {
        Err(RasterError::Malformed(faults)) => faults,
        other => panic!("{other:?}"),
    }
}

/// Lines and columns of the faults.
fn places(text: &str) -> Vec<(u64, u64)> {
    faults(text.as_bytes(), RasterKind::Heights)
        .iter()
        .map(|fault| (fault.line.unwrap_or(0), fault.column.unwrap_or(0)))
        .collect()
}

fn values(raster: &Raster) -> Vec<String> {
    raster.values.iter().map(|value| value.to_string()).collect()
}

#[test]
fn a_csv_grid_is_rows_from_north_to_south() {
    let raster = heights("\u{FEFF}# a hill\n1, 2,3\r\n\n4,,-6.5\n");
    assert_eq!((raster.columns, raster.rows, raster.place), (3, 2, None));
    assert_eq!(values(&raster), ["1", "2", "3", "4", "NaN", "-6.5"]);
    assert_eq!(values(&heights("1 2\n nan\t4e1\n")), ["1", "2", "NaN", "40"]);
}

#[test]
fn a_csv_of_points_is_a_grid_in_any_order() {
    let raster =
        heights("y_m,name,z_cm,x_km\n20,a,300,0.1\n10,b,100,0.1\n10,c,200,0.105\n20,d,nan,0.105\n20,e,5,0.11\n");
    assert_eq!((raster.columns, raster.rows), (3, 2));
    assert_eq!(values(&raster), ["3", "NaN", "0.05", "1", "2", "NaN"]);
    let place = raster.place.unwrap();
    assert!((place.south_west - DVec2::new(100.0, 10.0)).length() < 1e-12);
    assert!((place.spacing - DVec2::new(5.0, 10.0)).length() < 1e-12);
}

/// A cell of 10 m whose corner lies at 100 has its post at 105.
#[test]
fn an_esri_grid_is_registered_by_corner_or_by_centre() {
    let grid = |x: &str, y: &str| {
        format!("NCOLS 2\nnrows 2\n{x} 100\n{y} 200\ncellsize 10\nNODATA_value -9999\n1 2\n-9999 4\n")
    };
    let corner = heights(&grid("xllcorner", "YLLCORNER"));
    assert_eq!(values(&corner), ["1", "2", "NaN", "4"]);
    assert_eq!(corner.place.unwrap().south_west, DVec2::new(105.0, 205.0));
    assert_eq!(heights(&grid("xllcenter", "yllcenter")).place.unwrap().south_west, DVec2::new(100.0, 200.0));
    assert_eq!(heights(&grid("xllcenter", "yllcorner")).place.unwrap().south_west, DVec2::new(100.0, 205.0));
    let flowing = heights("ncols 3\nnrows 2\nxllcenter 0\nyllcenter 0\ncellsize 1\n1 2\n3 4 5\n6\n");
    assert_eq!(values(&flowing), ["1", "2", "3", "4", "5", "6"]);
    let oblong = heights("ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ndx 4\ndy 2\n1 2\n").place.unwrap();
    assert_eq!((oblong.spacing, oblong.south_west), (DVec2::new(4.0, 2.0), DVec2::new(2.0, 1.0)));
}

#[test]
fn every_fault_of_a_text_grid_has_its_place() {
    assert_eq!(places("1,2,3\n4,5\n6,7,8,9\n"), [(2, 3), (3, 7)]);
    assert_eq!(places("1,2\nfar, inf\n3,99999\n"), [(2, 1), (2, 6), (3, 3)]);
    assert_eq!(places("x_m,y_m\n1,2\n"), [(1, 1)]);
    assert_eq!(places("x_m,y_m,z_m\n0,0,1\n1,0,1\n0,1,1\n0.3,1,1\n0,0,7\n"), [(5, 1), (6, 1)].map(|p| p));
    assert_eq!(places("1;2\n"), [(1, 2)]);
    assert_eq!(places(""), [(0, 0)]);
    assert_eq!(places("ncols 2\nnrows x\ncellsize -1\n1 2\n"), [(2, 7), (3, 1), (4, 1), (4, 1)]);
    assert_eq!(places("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3\n"), [(7, 1)]);
    assert_eq!(places("ncols 2\nrows 2\n"), [(2, 1)]);
    assert_eq!(faults(b"1,2\n\xff\xfe", RasterKind::Heights)[0].line, Some(2));
    assert!(faults(b"nan,nan\nnan,nan\n", RasterKind::Heights)[0].message.contains("no data"));
    assert!(faults(b"1,2.5\n-3,4\n", RasterKind::Classes).len() == 2);
    let many = "x\n".repeat(1000);
    assert_eq!(faults(format!("1\n{many}").as_bytes(), RasterKind::Heights).len(), 10);
}

/// Twelve zeros are asked for and nothing is allocated: the estimate comes first.
#[test]
fn a_grid_beyond_memory_is_refused_with_an_estimate() {
    let text = "ncols 1000000\nnrows 1000000\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n";
    let Err(error @ RasterError::TooLarge { bytes, .. }) = read_raster(text.as_bytes(), RasterKind::Heights) else {
        panic!("read")
    };
    assert!(bytes > 1e14 as u64 && error.to_string().contains("GB"), "{error}");
}

/// A TIFF of one band with tags.
fn tiff<C: ColorType>(
    (width, height): (u32, u32),
    data: &[C::Inner],
    (compression, predictor): (Compression, Predictor),
    tags: &[(Tag, &[f64])],
    keys: &[u16],
    hole: Option<&str>,
) -> Vec<u8>
where
    [C::Inner]: TiffValue,
{
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap().with_compression(compression).with_predictor(predictor);
    let mut image = encoder.new_image::<C>(width, height).unwrap();
    for (tag, values) in tags {
        image.encoder().write_tag(*tag, *values).unwrap();
    }
    if !keys.is_empty() {
        image.encoder().write_tag(Tag::GeoKeyDirectoryTag, keys).unwrap();
    }
    if let Some(hole) = hole {
        image.encoder().write_tag(Tag::GdalNodata, hole).unwrap();
    }
    image.write_data(data).unwrap();
    file.into_inner()
}

const PLAIN: (Compression, Predictor) = (Compression::Uncompressed, Predictor::None);
const SCALE: (Tag, &[f64]) = (Tag::ModelPixelScaleTag, &[10.0, 20.0, 0.0]);
const TIE: (Tag, &[f64]) = (Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, 500.0, 900.0, 0.0]);

/// Keys of a projected model with areas (1) or points (2) as pixels and units by EPSG code.
fn keys(raster_type: u16, horizontal: u16, vertical: u16) -> Vec<u16> {
    vec![1, 1, 0, 4, 1024, 0, 1, 1, 1025, 0, 1, raster_type, 3076, 0, 1, horizontal, 4099, 0, 1, vertical]
}

/// Two rows of 20 m from a corner at y = 900: posts at 890 and 870 where pixels are areas, at 900 and 880 where points.
#[test]
fn a_geotiff_lies_where_its_tags_say() {
    let data = [1.0_f32, 2.0, 3.0, 4.0, -9999.0, 6.0];
    let read = |bytes: Vec<u8>| read_raster(&bytes, RasterKind::Heights).unwrap();
    let area = read(tiff::<Gray32Float>((3, 2), &data, PLAIN, &[SCALE, TIE], &keys(1, 9001, 9001), Some("-9999")));
    assert_eq!(values(&area), ["1", "2", "3", "4", "NaN", "6"]);
    assert_eq!(area.place.unwrap().south_west, DVec2::new(505.0, 870.0));
    assert_eq!(area.place.unwrap().spacing, DVec2::new(10.0, 20.0));
    let point = read(tiff::<Gray32Float>((3, 2), &data, PLAIN, &[SCALE, TIE], &keys(2, 9001, 9001), None));
    assert_eq!(point.place.unwrap().south_west, DVec2::new(500.0, 880.0));
    let matrix: (Tag, &[f64]) = (
        Tag::ModelTransformationTag,
        &[10.0, 0.0, 0.0, 500.0, 0.0, -20.0, 0.0, 900.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    );
    let by_matrix = read(tiff::<Gray32Float>((3, 2), &data, PLAIN, &[matrix], &[], None));
    assert_eq!(by_matrix.place, area.place);
    let feet = read(tiff::<Gray32Float>((3, 2), &data, PLAIN, &[SCALE, TIE], &keys(1, 9002, 9003), Some("-9999")));
    assert!((feet.place.unwrap().spacing.x - 3.048).abs() < 1e-12);
    assert!((feet.values[2] - 3.0 * 1200.0 / 3937.0).abs() < 1e-12 && feet.values[4].is_nan());
    let degrees = [1, 1, 0, 1, 1024, 0, 1, 2];
    assert_eq!(read(tiff::<Gray32Float>((3, 2), &data, PLAIN, &[SCALE, TIE], &degrees, None)).place, None);
}

#[test]
fn a_geotiff_is_read_in_every_packing() {
    let size = (64, 50);
    let of = |i: u32| (f64::from(i % 64) * 3.0 - f64::from(i / 64)).round();
    let expected: Vec<f64> = (0..64 * 50).map(of).collect();
    let shorts: Vec<i16> = expected.iter().map(|z| *z as i16).collect();
    let singles: Vec<f32> = expected.iter().map(|z| *z as f32).collect();
    for compression in [Compression::Uncompressed, Compression::Lzw, Compression::Deflate(Default::default())] {
        for predictor in [Predictor::None, Predictor::Horizontal] {
            let bytes = tiff::<GrayI16>(size, &shorts, (compression, predictor), &[], &[], None);
            assert_eq!(read_raster(&bytes, RasterKind::Heights).unwrap().values, expected);
        }
        let plain = (compression, Predictor::None);
        let bytes = tiff::<Gray32Float>(size, &singles, plain, &[], &[], None);
        assert_eq!(read_raster(&bytes, RasterKind::Heights).unwrap().values, expected);
        let bytes = tiff::<Gray64Float>(size, &expected, plain, &[], &[], None);
        assert_eq!(read_raster(&bytes, RasterKind::Heights).unwrap().values, expected);
    }
}

/// Cut anywhere, and with bytes turned over anywhere: an answer or a fault, never a panic.
#[test]
fn a_broken_geotiff_is_refused() {
    let data: Vec<f32> = (0..600).map(|i| i as f32).collect();
    let packing = (Compression::Lzw, Predictor::None);
    let whole = tiff::<Gray32Float>((30, 20), &data, packing, &[SCALE, TIE], &keys(1, 9001, 9001), Some("-1"));
    for length in 0..whole.len() {
        assert!(read_raster(&whole[..length], RasterKind::Heights).is_err(), "{length} of {} bytes", whole.len());
    }
    let mut state = 1_u64;
    let mut random = move |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n
    };
    for _ in 0..20_000 {
        let mut bytes = whole.clone();
        for _ in 0..1 + random(4) {
            let at = random(bytes.len());
            bytes[at] = random(256) as u8;
        }
        let _ = read_raster(&bytes, RasterKind::Heights);
    }
    let turned: (Tag, &[f64]) = (
        Tag::ModelTransformationTag,
        &[10.0, 1.0, 0.0, 500.0, 1.0, -20.0, 0.0, 900.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    );
    let turned = tiff::<Gray32Float>((30, 20), &data, PLAIN, &[turned], &[], None);
    assert!(faults(&turned, RasterKind::Heights)[0].message.contains("turned"));
    let colour = tiff::<RGB8>((10, 20), &[7; 600], PLAIN, &[], &[], None);
    assert!(faults(&colour, RasterKind::Heights)[0].message.contains("one band"));
    let wild = tiff::<Gray32Float>((2, 1), &[1e30, f32::INFINITY], PLAIN, &[], &[], None);
    assert_eq!(faults(&wild, RasterKind::Heights).len(), 2);
}

// ---- the surface

fn raster(columns: usize, rows: usize, of: impl Fn(f64, f64) -> f64) -> Raster {
    let value = |at: usize| of((at % columns) as f64, (rows - 1 - at / columns) as f64);
    Raster { columns, rows, values: (0..columns * rows).map(value).collect(), place: None }
}

fn world(terrain: &Terrain) -> World {
    let mesh = terrain.mesh(|_, _| MaterialId(0));
    World::new(vec![mesh], vec![Instance { mesh: 0, pose: DAffine3::IDENTITY, name: "terrain".into(), id: 1 }], None)
        .unwrap()
}

/// Hills with a lake of no data, at UTM-like coordinates.
fn hills() -> Terrain {
    let raster = raster(60, 40, |x, y| {
        if (x - 30.0).hypot(y - 20.0) < 5.0 {
            f64::NAN
        } else {
            9.0 * (0.3 * x).sin() * (0.41 * y + 1.0).cos() + 0.2 * x
        }
    });
    Terrain::new(raster, DVec2::new(430_000.0, 5_100_000.0), DVec2::new(5.0, 3.0)).unwrap()
}

/// Looking straight down at posts, at the middles of edges and anywhere: where a ray hits there is a height, the same one,
/// and in the hole there is neither.
#[test]
fn a_height_is_that_of_the_triangle_that_a_ray_meets() {
    let (terrain, mut state) = (hills(), 5_u64);
    let world = world(&terrain);
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 * 2f64.powi(-53)
    };
    let (mut met, mut open) = (0, 0);
    for i in 0..20_000 {
        let whole = |u: f64, n: f64| (u * n).floor();
        let (u, v) = (random(), random());
        let cell = match i % 4 {
            0 => DVec2::new(whole(u, 60.0), whole(v, 40.0)),
            1 => DVec2::new(whole(u, 59.0) + 0.5, whole(v, 40.0)),
            2 => DVec2::new(59.0 * u, whole(v, 40.0)),
            _ => DVec2::new(59.0 * u, 39.0 * v),
        };
        let at = terrain.south_west() + terrain.spacing() * cell;
        let hit = world.closest(&Ray::new(at.extend(500.0), WorldDir::new(DVec3::NEG_Z)));
        match (terrain.height_at(at.x, at.y), hit) {
            (Some(z), Some(hit)) => {
                assert!((hit.point.z - z).abs() < 1e-9 + hit.error && hit.front, "{at}: {z} and {}", hit.point);
                met += 1;
            }
            (None, None) => open += 1,
            (z, hit) => panic!("at {at} (cell {cell}) the height is {z:?}, the hit {hit:?}"),
        }
    }
    assert!(met > 17_000 && open > 300, "{met} {open}");
    for beside in [DVec2::new(-0.01, 3.0), DVec2::new(59.01, 3.0), DVec2::new(2.0, 39.01), DVec2::NAN] {
        let at = terrain.south_west() + terrain.spacing() * beside;
        assert_eq!(terrain.height_at(at.x, at.y), None);
    }
}

/// Through a terrain without holes no ray passes that is steeper than its slopes (of 29° at most).
#[test]
fn no_ray_passes_between_the_triangles_of_a_terrain() {
    let of = |x: f64, y: f64| 0.4 * (0.7 * x).sin() + 0.3 * (0.9 * y).cos();
    let terrain = Terrain::new(raster(81, 81, of), DVec2::new(-40.0, -40.0), DVec2::ONE).unwrap();
    let world = world(&terrain);
    for i in 0..60_000_u32 {
        let target = DVec2::new(f64::from(i % 61) - 30.0, f64::from(i / 61 % 61) - 30.0);
        let target = target + [DVec2::ZERO, DVec2::new(0.5, 0.0), DVec2::new(0.5, 0.5)][i as usize % 3];
        let on = target.extend(terrain.height_at(target.x, target.y).unwrap());
        let away = WorldDir::from_zenith_azimuth(f64::from(i % 55).to_radians(), f64::from(i) * 0.37);
        let from = on + away.vec() * 30.0;
        assert!(world.closest(&Ray::new(from, WorldDir::new(on - from))).is_some(), "{target} from {from}");
    }
}

#[test]
fn a_plane_of_posts_is_a_plane() {
    let of = |x: f64, y: f64| 0.25 * (2.0 * x) - 0.5 * (3.0 * y) + 7.0;
    let terrain = Terrain::new(raster(9, 7, of), DVec2::new(1.0, -2.0), DVec2::new(2.0, 3.0)).unwrap();
    let mesh = terrain.mesh(|_, _| MaterialId(3));
    assert_eq!(mesh.facet_count(), 2 * 8 * 6);
    let normal = DVec3::new(-0.25, 0.5, 1.0).normalize();
    assert!(mesh.facets().all(|facet| (facet.normal - normal).length() < 1e-14 && facet.material == MaterialId(3)));
    let area: f64 = mesh.facets().map(|facet| facet.area).sum();
    assert!((area * normal.z - 16.0 * 18.0).abs() < 1e-10);
    let (x, y) = (4.4, 3.3);
    assert!((terrain.height_at(x, y).unwrap() - (0.25 * (x - 1.0) - 0.5 * (y + 2.0) + 7.0)).abs() < 1e-12);
}

/// Ends at 0 and 0 against ends at 5 and 1: the middle lies at 0, on the shorter diagonal, in every turn of the cell.
#[test]
fn a_cell_is_parted_along_its_shorter_diagonal() {
    for (level, values) in [("south-west", [1.0, 0.0, 0.0, 5.0]), ("south-east", [0.0, 5.0, 1.0, 0.0])] {
        let cell = Raster { columns: 2, rows: 2, values: values.to_vec(), place: None };
        let terrain = Terrain::new(cell, DVec2::ZERO, DVec2::ONE).unwrap();
        assert_eq!(terrain.height_at(0.5, 0.5), Some(0.0), "level from {level}");
    }
    let saddle = Raster { columns: 2, rows: 2, values: vec![1.0, 0.0, 0.0, 1.0], place: None };
    assert_eq!(Terrain::new(saddle, DVec2::ZERO, DVec2::ONE).unwrap().height_at(0.5, 0.5), Some(0.0));
}

/// A triangle is made of what the post at its right angle is; a post of its own kind within others shows as four of them
/// around it, or as the two of a cell's half.
#[test]
fn a_triangle_is_made_of_its_nearest_post() {
    let terrain = Terrain::new(raster(4, 4, |_, _| 0.0), DVec2::ZERO, DVec2::ONE).unwrap();
    // second post from the west in the second row from the north: (1, 2)
    let mesh = terrain.mesh(|column, row| MaterialId(u32::from((column, row) == (1, 1))));
    let own: Vec<DVec3> = mesh.facets().filter(|f| f.material == MaterialId(1)).map(|f| f.centre()).collect();
    assert_eq!(own.len(), 2, "level ground is parted from south-west to north-east");
    assert!(own.iter().all(|centre| centre.distance(DVec3::new(1.0, 2.0, 0.0)) < 0.5), "{own:?}");
}

#[test]
fn what_makes_no_surface_is_refused() {
    let new = |raster, spacing| Terrain::new(raster, DVec2::ZERO, DVec2::splat(spacing)).unwrap_err();
    assert!(matches!(new(raster(1, 5, |_, _| 0.0), 1.0), TerrainError::TooFewPosts { .. }));
    assert!(matches!(new(raster(5, 5, |_, _| 0.0), 1e9), TerrainError::NoPlace { .. }));
    assert!(matches!(new(raster(5, 5, |x, _| if x == 2.0 { 1.0 } else { f64::NAN }), 1.0), TerrainError::OnlyHoles));
    // three of four posts are half a cell
    let half = Terrain::new(raster(2, 2, |x, y| if x + y == 2.0 { f64::NAN } else { 1.0 }), DVec2::ZERO, DVec2::ONE);
    let half = half.unwrap();
    assert_eq!((half.height_at(0.4, 0.4), half.height_at(0.6, 0.6)), (Some(1.0), None));
    assert_eq!(world(&half).facet(FacetId(0)).area, 0.5);
}
