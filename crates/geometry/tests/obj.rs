//! The OBJ reader against an independent one.
#![allow(missing_docs)]

use glam::DVec3;
use std::fmt::Write as _;
use sunglint_geometry::{MaterialId, Up, read_obj};

struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n
    }
    fn number(&mut self) -> f64 {
        (self.below(1 << 30) as f64 / f64::from(1 << 29) - 1.0) * 10f64.powi(self.below(12) as i32 - 4)
    }
}

/// A sound file of triangles anywhere and of level polygons, in the spellings that exporters use.
fn sound_file(random: &mut Random) -> String {
    let (mut text, mut vertices) = (String::from("mtllib materials.mtl\n"), 0_usize);
    let end = ["\n", "\r\n", " \n"][random.below(3)];
    for _ in 0..1 + random.below(30) {
        match random.below(8) {
            0 => _ = write!(text, "usemtl {}{end}", ["roof", "Old Brick.001", "wall#2"][random.below(3)]),
            1 => {
                _ = write!(
                    text,
                    "{}{end}",
                    ["g walls roof", "o house", "s off", "# f 1 2 3", "", "vn 0 0 1", "vt 0 .5"][random.below(7)]
                )
            }
            _ => {}
        }
        let n = if random.below(2) == 0 { 3 } else { 3 + random.below(6) };
        let (centre, radius) =
            (DVec3::new(random.number(), random.number(), random.number()), 1.0 + random.number().abs());
        for i in 0..n {
            let (s, c) = (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
            let p = centre + radius * DVec3::new(c, s, 0.0);
            let p = if n == 3 { DVec3::new(random.number(), random.number(), random.number()) } else { p };
            let number = |x: f64, form: usize| match form {
                0 => format!("{x}"),
                1 => format!("{x:e}"),
                _ => format!("{x:.17e}"),
            };
            let form = random.below(3);
            let _ = write!(text, "v {}  {}\t{}{end}", number(p.x, form), number(p.y, form), number(p.z, form));
        }
        vertices += n;
        text.push('f');
        let back = random.below(2) == 0;
        for i in 0..n {
            let index = if back { (n - i).to_string() } else { (vertices - n + 1 + i).to_string() };
            let _ = write!(text, " {}{index}", if back { "-" } else { "" });
        }
        text.push_str(end);
    }
    text
}

/// Corners to the last bit, their order round each face, and the material's name, of 400 files of random sound text.
#[test]
fn the_reader_agrees_with_tobj_to_the_last_bit() {
    let mut random = Random(7);
    for _ in 0..400 {
        let text = sound_file(&mut random);
        let mut names = Vec::new();
        let ours = read_obj(text.as_bytes(), 1.0, Up::Z, &mut |name| {
            names.push(name.to_owned());
            Some(MaterialId(names.len() as u32 - 1))
        })
        .expect("a sound file");
        assert_eq!((ours.dropped_zero_area, ours.split_not_planar, ours.skipped.len()), (0, 0, 0));
        let library = |_: &std::path::Path| {
            let materials = ["roof", "Old Brick.001", "wall#2"]
                .map(|name| tobj::Material { name: name.to_owned(), ..Default::default() })
                .to_vec();
            let index = materials.iter().enumerate().map(|(i, m)| (m.name.clone(), i)).collect();
            Ok((materials, index))
        };
        let options = tobj::LoadOptions { single_index: false, ..Default::default() };
        let (models, materials) = tobj::load_obj_buf(&mut text.as_bytes(), &options, library).expect("sound too");
        let materials = materials.expect("a library");
        let mut facets = ours.mesh.facets();
        for mesh in models.iter().map(|m| &m.mesh) {
            let mut rest = &mesh.indices[..];
            let arities =
                if mesh.face_arities.is_empty() { vec![3; rest.len() / 3] } else { mesh.face_arities.clone() };
            for n in arities.into_iter().map(|n| n as usize) {
                let corner = |i: u32| DVec3::from_slice(&mesh.positions[3 * i as usize..]);
                let want: Vec<DVec3> = rest[..n].iter().map(|&i| corner(i)).collect();
                rest = &rest[n..];
                let got = facets.next().expect("as many facets");
                let turn = got.corners.iter().position(|c| *c == want[0]).expect("the same corners");
                assert!((0..n).all(|k| got.corners[(turn + k) % n] == want[k]), "{text}");
                let name = mesh.material_id.map_or("", |i| &materials[i].name);
                assert_eq!(names[got.material.0 as usize], name, "{text}");
            }
        }
        assert!(facets.next().is_none());
    }
}
