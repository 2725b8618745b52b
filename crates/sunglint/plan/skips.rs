//! What will not be computed, and why.

use sunglint_dsl::Scene;
use sunglint_geometry::{FacetId, World};
use sunglint_radiometry::SpectralGrid;
use sunglint_sensor::Band;
use sunglint_tracer::{Algorithm, Scenery};

use super::Skip;

pub(super) fn scene_skips(scene: &Scene, unopened: &[String], world: &World) -> Vec<Skip> {
    let mut skips = Vec::new();
    for material in scene.materials.iter().filter(|material| !material.used) {
        skips.push(Skip {
            what: format!("material `{}`", material.name),
            why: "no facet refers to it; its files were not opened".into(),
        });
    }
    for object in unopened {
        skips.push(Skip {
            what: format!("object `{object}`"),
            why: "nothing places it; its meshes were not opened".into(),
        });
    }
    for (i, weather) in scene.weathers.iter().enumerate().filter(|(_, weather)| !weather.spans.is_empty()) {
        let of_collect = |named: Option<usize>| named.unwrap_or(0) == i;
        if !scene.collects.iter().any(|collect| of_collect(collect.weather)) {
            skips.push(Skip {
                what: weather
                    .name
                    .as_ref()
                    .map_or("the weather without a name".into(), |name| format!("weather `{name}`")),
                why: "no collection set is under it".into(),
            });
        }
    }
    if world.ground().is_none() {
        skips.push(Skip {
            what: "lines of sight below the horizon that meet no facet".into(),
            why: "the scene has no `ground`: they find black".into(),
        });
    }
    skips
}

pub(super) fn run_skips(
    algorithm: &dyn Algorithm,
    scenery: &Scenery,
    bands: &[Band],
    grid: &SpectralGrid,
) -> Vec<Skip> {
    let mut skips: Vec<Skip> = (algorithm.skips(scenery).into_iter())
        .map(|line| match line.split_once(": ") {
            Some((what, why)) => Skip { what: what.into(), why: why.into() },
            None => Skip { what: line, why: String::new() },
        })
        .collect();
    let span = |f: fn(f64, f64) -> f64, start: f64, pick: fn(&Band) -> f64| bands.iter().map(pick).fold(start, f);
    let (lower, upper) = (span(f64::min, f64::INFINITY, |b| b.support().0), span(f64::max, 0.0, |b| b.support().1));
    let covered: f64 = grid.bins().iter().map(|bin| bin.width()).sum();
    skips.push(Skip {
        what: format!(
            "wavelengths below {:.0} nm, above {:.0} nm{}",
            lower * 1e3,
            upper * 1e3,
            if covered < upper - lower - 1e-9 { " and between the bands" } else { "" }
        ),
        why: format!("no band responds there; {} grid entries remain", grid.len()),
    });
    skips.push(Skip {
        what: "sun rays from surfaces that are turned away from the sun, or with nothing between them and it".into(),
        why: "proved per block of 8 x 8 pixels and facet; the manifest counts them".into(),
    });
    let black =
        scenery.surfaces.iter().flatten().filter(|surface| !surface.has_diffuse && !surface.has_specular).count();
    if black > 0 {
        skips.push(Skip {
            what: "light that black surfaces return".into(),
            why: format!("{black} materials reflect nothing"),
        });
    }
    let world = &scenery.world;
    let n = world.facet_count().min(100_000) as u32;
    let open = (0..n).filter(|id| world.is_open(FacetId(*id), true)).count();
    if open > 0 {
        skips.push(Skip {
            what: format!("view-factor rays on {open} of {} facets", world.facet_count()),
            why: "nothing but the ground rises above their plane: F = (1 + cos β)/2".into(),
        });
    }
    skips
}

/// Times of a run at which nothing shines.
pub(crate) fn dark_skip(dark: usize, n_times: usize) -> Option<Skip> {
    (dark > 0).then(|| Skip {
        what: format!("sun and sky at {dark} of {n_times} times"),
        why: "the sun is below the horizon".into(),
    })
}
