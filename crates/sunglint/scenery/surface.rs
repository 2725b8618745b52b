//! The terrain from its files, and the heights on which things stand.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use sunglint_dsl::scene::{self, SceneFile};
use sunglint_dsl::{Diagnostic, Scene, Span};
use sunglint_geometry::{MaterialId, Mesh, Raster, RasterError, RasterKind, Terrain, TerrainError, read_raster};

/// What `at (x y)` stands on: the terrain where it covers, else the ground, and z = 0 where the scene has neither.
pub struct Surface {
    /// The terrain.
    pub terrain: Option<Terrain>,
    ground: Option<f64>,
    /// Whether a terrain was said that could not be built; what would stand on it is not told of.
    broken: bool,
}

/// Value that stands for no data by custom; taken for a height where a file does not declare it.
const USUAL_HOLE: f64 = -9999.0;
/// The most classes that are told one by one.
const MOST_CLASSES: usize = 10;

impl Surface {
    /// Reads the terrain; its mesh stands in the world's own frame.
    pub fn read(scene: &Scene, diagnostics: &mut Vec<Diagnostic>) -> (Self, Option<Mesh>) {
        let said = scene.terrain.as_ref();
        let built = said.and_then(|said| build(said, scene, diagnostics));
        let broken = said.is_some() && built.is_none();
        let (terrain, mesh) = built.unzip();
        (Self { terrain, ground: scene.ground.map(|ground| ground.height), broken }, mesh)
    }

    /// Height \[m\]; `None` beside a terrain that no ground surrounds.
    pub fn height_at(&self, x: f64, y: f64) -> Option<f64> {
        let on_terrain = self.terrain.as_ref().and_then(|terrain| terrain.height_at(x, y));
        let level = (self.terrain.is_none() || self.broken).then_some(0.0);
        on_terrain.or(self.ground).or(level)
    }

    /// A pose with its height.
    pub fn on(&self, pose: &scene::Pose) -> Option<scene::Pose> {
        if !pose.on_surface {
            return Some(*pose);
        }
        let height = self.height_at(pose.at.x, pose.at.y)?;
        Some(scene::Pose { at: pose.at.with_z(pose.at.z + height), on_surface: false, ..*pose })
    }
}

/// What of a statement stands beside the terrain.
#[derive(Default)]
pub struct Off {
    count: usize,
    first: DVec3,
}

impl Off {
    /// Notes a place that may lie beside it.
    pub fn note(&mut self, off: bool, at: DVec3) {
        if off && self.count == 0 {
            self.first = at;
        }
        self.count += usize::from(off);
    }

    /// Tells of the places noted, of `n` in all.
    pub fn tell(self, span: Span, n: usize, surface: &Surface, diagnostics: &mut Vec<Diagnostic>) {
        let (Some(terrain), 1..) = (&surface.terrain, self.count) else { return };
        let at = format!("({} {}) m", short(self.first.x), short(self.first.y));
        let message = match n {
            1 => format!("{at} lies off the terrain, and there is no ground"),
            n => format!("{} of {n} places lie off the terrain, the first at {at}, and there is no ground", self.count),
        };
        let (low, high) = terrain.extent();
        let fault = Diagnostic::error("G04", span, message).label("(x y z)? or a `ground`?");
        diagnostics.push(fault.help(format!(
            "the terrain covers ({} {}) to ({} {}) m, without its holes",
            short(low.x),
            short(low.y),
            short(high.x),
            short(high.y)
        )));
    }
}

/// To the millimetre.
fn short(metres: f64) -> f64 {
    (metres * 1e3).round() / 1e3
}

fn build(said: &scene::Terrain, scene: &Scene, diagnostics: &mut Vec<Diagnostic>) -> Option<(Terrain, Mesh)> {
    let heights = read(&said.heights, RasterKind::Heights, diagnostics);
    let classes = said.classes.as_ref().map(|file| (file, read(file, RasterKind::Classes, diagnostics)));
    let heights = heights?;
    let (size, place) = ((heights.columns, heights.rows), heights.place);
    let path = &said.heights.path;
    let south_west = said.origin.or(place.map(|place| place.south_west));
    let spacing = said.spacing.map(DVec2::splat).or(place.map(|place| place.spacing));
    let (Some(south_west), Some(spacing)) = (south_west, spacing) else {
        let lacks: Vec<&str> = [("origin", south_west.is_none()), ("spacing", spacing.is_none())]
            .into_iter()
            .filter_map(|(word, lacks)| lacks.then_some(word))
            .collect();
        let message = format!("`{path}` does not say in metres where its posts stand");
        let fault = Diagnostic::error("S05", said.span, message).label(format!("`{}`?", lacks.join("`, `")));
        diagnostics.push(fault.help("`origin (x y) m` is the south-west post, `spacing LENGTH` the way to the next"));
        return None;
    };
    warn_of_heights(said, &heights, south_west, spacing, diagnostics);
    let materials = match classes {
        Some((file, raster)) => {
            let raster = raster?;
            if (raster.columns, raster.rows) != size {
                let message = format!(
                    "`{}` has {} x {} classes for {} x {} heights",
                    file.path, raster.columns, raster.rows, size.0, size.1
                );
                diagnostics.push(Diagnostic::error("F01", file.span, message).label("a class for each post"));
                return None;
            }
            if let (Some(own), Some(of_heights)) = (raster.place, place)
                && (own.south_west - of_heights.south_west).abs().max_element() > 0.5 * spacing.max_element()
            {
                let message = format!("`{}` and `{path}` say that they lie in different places", file.path);
                diagnostics
                    .push(Diagnostic::warning("F01", file.span, message).label("laid over each other all the same"));
            }
            Some(materials(said, file, &raster, diagnostics)?)
        }
        None => None,
    };
    let terrain = match Terrain::new(heights, south_west, spacing) {
        Ok(terrain) => terrain,
        Err(error) => {
            let code = if matches!(error, TerrainError::NoPlace { .. }) { "U05" } else { "F01" };
            diagnostics.push(Diagnostic::error(code, said.heights.span, format!("`{path}`: {error}")));
            return None;
        }
    };
    if let Some(ground) = scene.ground {
        let known = || terrain.heights().iter().filter(|z| !z.is_nan());
        let below = known().filter(|z| **z < ground.height).count();
        if below > 0 {
            let share = 100.0 * below as f64 / known().count() as f64;
            let message = format!(
                "{share:.0} % of the terrain's posts lie below the ground at {} m, which hides them",
                ground.height
            );
            let fault = Diagnostic::warning("G04", ground.span, message).label("a lower `height`?");
            diagnostics.push(fault.note(said.span, "the terrain"));
        }
    }
    let own = MaterialId(said.material as u32);
    let mesh = match &materials {
        Some(materials) => terrain.mesh(|column, row| materials[row * size.0 + column]),
        None => terrain.mesh(|_, _| own),
    };
    Some((terrain, mesh))
}

fn read(file: &SceneFile, kind: RasterKind, diagnostics: &mut Vec<Diagnostic>) -> Option<Raster> {
    match read_raster(&file.bytes, kind) {
        Ok(raster) => Some(raster),
        Err(RasterError::Malformed(faults)) => {
            for fault in faults {
                let mut place = file.path.clone();
                for number in [fault.line, fault.column].into_iter().flatten() {
                    place = format!("{place}:{number}");
                }
                let code = if fault.columns { "F02" } else { "F01" };
                let found = Diagnostic::error(code, file.span, format!("{place}: {}", fault.message));
                diagnostics.push(Diagnostic { help: fault.help, ..found });
            }
            None
        }
        Err(error @ RasterError::TooLarge { .. }) => {
            let fault = Diagnostic::error("G05", file.span, format!("{}: {error}", file.path));
            diagnostics.push(fault.label("a part of it, or every second post?"));
            None
        }
    }
}

fn warn_of_heights(
    said: &scene::Terrain,
    heights: &Raster,
    south_west: DVec2,
    spacing: DVec2,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let path = &said.heights.path;
    let n = heights.values.len();
    let holes = heights.values.iter().filter(|z| z.is_nan()).count();
    if holes > 0 {
        let message = format!("`{path}`: {holes} of {n} posts hold no data, the terrain is open there");
        diagnostics.push(Diagnostic::warning("F01", said.heights.span, message));
    }
    let usual = heights.values.iter().filter(|z| **z == USUAL_HOLE).count();
    if usual > 0 {
        let message = format!("`{path}`: {usual} of {n} posts lie at {USUAL_HOLE} m, which often stands for no data");
        let fault = Diagnostic::warning("F01", said.heights.span, message).label("taken as heights");
        diagnostics.push(fault.help("an ESRI grid says `nodata_value -9999`; in CSV leave the cell empty"));
    }
    // A hundredth of a degree is 1 km; a lawn of such posts is rarer than a map in degrees.
    if said.origin.is_none()
        && said.spacing.is_none()
        && spacing.max_element() < 0.02
        && (south_west.x.abs() > 1.0 || south_west.y.abs() > 1.0)
        && south_west.x.abs() <= 180.0
        && south_west.y.abs() <= 90.0
    {
        let message = format!(
            "`{path}`: posts {} m apart from ({} {}) m: are these degrees?",
            spacing.x, south_west.x, south_west.y
        );
        let fault = Diagnostic::warning("F01", said.heights.span, message).label("taken as metres");
        diagnostics.push(fault.help("project the grid to metres, or say `origin` and `spacing`"));
    }
}

/// A material for each post.
fn materials(
    said: &scene::Terrain,
    file: &SceneFile,
    classes: &Raster,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Vec<MaterialId>> {
    let mut used = vec![false; said.maps.len()];
    let mut unmapped: BTreeMap<u32, usize> = BTreeMap::new();
    let places: BTreeMap<u32, usize> = said.maps.iter().enumerate().map(|(i, (class, ..))| (*class, i)).collect();
    let mut last = None;
    let of_post = |class: &f64| {
        if class.is_nan() {
            return MaterialId(said.material as u32);
        }
        let class = *class as u32;
        let place = match last {
            Some((known, place)) if known == class => place,
            _ => places.get(&class).copied(),
        };
        last = Some((class, place));
        match place {
            Some(i) => {
                used[i] = true;
                MaterialId(said.maps[i].1 as u32)
            }
            None => {
                *unmapped.entry(class).or_default() += 1;
                MaterialId(said.material as u32)
            }
        }
    };
    let materials: Vec<MaterialId> = classes.values.iter().map(of_post).collect();
    for (class, posts) in unmapped.iter().take(MOST_CLASSES) {
        let plural = if *posts == 1 { "" } else { "s" };
        let message = format!("`{}`: class {class} ({posts} post{plural}) is mapped to no material", file.path);
        let fault = Diagnostic::error("G03", file.span, message).label(format!("`map {class} to MATERIAL`?"));
        diagnostics.push(fault);
    }
    if unmapped.len() > MOST_CLASSES {
        let message =
            format!("`{}`: {} classes more are mapped to no material", file.path, unmapped.len() - MOST_CLASSES);
        diagnostics.push(Diagnostic::error("G03", file.span, message).help("is this the file of classes?"));
    }
    for ((class, _, span), _) in said.maps.iter().zip(&used).filter(|(_, used)| !**used) {
        let message = format!("no post of `{}` is of class {class}", file.path);
        diagnostics.push(Diagnostic::warning("G03", *span, message).label("matches nothing"));
    }
    unmapped.is_empty().then_some(materials)
}
