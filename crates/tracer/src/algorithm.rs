//! What a radiance algorithm is.

use sunglint_atmosphere::Needs;
use sunglint_geometry::Ray;
use sunglint_plugin::Model;

use crate::{Paths, Scenery, Stream};

/// How an algorithm wants its paths lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lighting {
    /// The sun is a disk (else a point).
    pub sun_disk: bool,
    /// The disk darkens towards its limb.
    pub limb_darkening: bool,
    /// Quantities are averaged over each band before they are multiplied (else products are formed per grid entry and
    /// averaged once, last).
    pub band_means: bool,
    /// The ground's albedo brightens the sky.
    pub adjacency: bool,
}

/// A radiance algorithm: traces samples of a pixel into paths that do not depend on time or wavelength.
pub trait Algorithm: Send + Sync {
    /// What it wants of the atmosphere over this scenery.
    fn needs(&self, scenery: &Scenery) -> Needs;

    /// How its paths are lit.
    fn lighting(&self) -> Lighting;

    /// All on which its paths depend beside the scenery: where two algorithms answer alike, they trace the same.
    fn traced_by(&self) -> String;

    /// Traces one sample along `sight` and appends it to `paths`.
    fn trace(&self, scenery: &Scenery, sight: &Ray, replicate: u8, stream: &mut Stream, paths: &mut Paths);

    /// What it will not compute for this scenery and why, one line each, for the plan.
    fn skips(&self, scenery: &Scenery) -> Vec<String>;

    /// The estimators it uses, one line each, for the plan.
    fn estimators(&self) -> Vec<String>;
}

/// The algorithms of this build.
pub const BUILTIN: &[Model<dyn Algorithm>] = &[crate::published::IDEAL, crate::published::SPLIT, crate::full::FULL];

/// Parameters by which algorithms declare what they approximate, with the word under which nothing is.
pub const EXACT: &[(&str, &str)] = &[
    ("reading", "corrected"),
    ("sky", "directional"),
    ("sky_view", "rays"),
    ("background", "average"),
    ("background_sky", "own"),
    ("background_angle", "actual"),
    ("background_lobes", "all"),
    ("glint", "conserving"),
    ("sun", "disk"),
    ("depth", "unlimited"),
    ("spectral", "wavelength"),
    ("adjacency", "on"),
    ("caustics", "on"),
];

#[cfg(test)]
mod tests {
    use sunglint_plugin::Kind;

    use super::*;

    /// A word that no parameter has would lift nothing.
    #[test]
    fn every_exact_word_is_one_of_its_parameter() {
        for model in BUILTIN {
            for (name, word) in EXACT {
                let Some(param) = model.info.param(name) else { continue };
                let known = match param.kind {
                    Kind::Word(words) | Kind::Count(words) => words.contains(word),
                    Kind::Switch => ["on", "off"].contains(word),
                    _ => false,
                };
                assert!(known, "{} {name} {word}", model.info.name);
            }
        }
    }
}
