//! What a radiance algorithm is.

use sunglint_atmosphere::Needs;
use sunglint_geometry::Hit;
use sunglint_plugin::Model;

use crate::{Paths, Scenery, Sight, Stream};

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

/// Which of a pixel's samples one is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// Its replicate.
    pub replicate: u8,
    /// What its line of sight meets.
    pub hit: Option<Hit>,
    /// Weight of what rays over first surfaces find of sky and background: 1 where each traced sample looks, 0 where others of the
    /// pixel look for it, and so much more for those. An algorithm may look whatever it says, with a weight of 1.
    pub looks: f64,
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
    fn trace(&self, scenery: &Scenery, sight: &Sight<'_>, draw: &Draw, stream: &mut Stream, paths: &mut Paths);

    /// Whether it knows pixels of which one sample tells all.
    fn knows_even(&self) -> bool {
        false
    }

    /// Traces a sample through the middle of a pixel that sees one side of one plane facet, to stand for all of the pixel wherever
    /// the sun stands to the whole of it alike; false, with nothing appended, where samples might differ.
    fn trace_even(
        &self,
        _scenery: &Scenery,
        _sight: &Sight<'_>,
        _hit: &Hit,
        _stream: &mut Stream,
        _paths: &mut Paths,
    ) -> bool {
        false
    }

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
    ("indirect", "sampled"),
    ("spectral", "wavelength"),
    ("adjacency", "on"),
    ("caustics", "on"),
];

#[cfg(test)]
mod tests {
    use sunglint_plugin::{Args, Kind, Value};
    use sunglint_radiometry::SpectralGrid;

    use super::*;

    /// Runs of the same paths are told by what algorithms say of themselves: whatever a parameter changes is among it, or in how
    /// paths are lit, and what is only said of light is not.
    #[test]
    fn every_parameter_changes_what_is_traced_or_how_it_is_lit() {
        let grid = SpectralGrid::from_edges(&[0.5, 0.6]);
        for Model { info, bind } in BUILTIN {
            let bound = |given: Option<(&str, Value)>| {
                let given = given.map(|(name, value)| (name.to_string(), value));
                let algorithm = bind(&Args::new(info, given), &grid).unwrap_or_else(|_| panic!("{}", info.name));
                (algorithm.traced_by(), algorithm.lighting())
            };
            let (traced, lit) = bound(None);
            for param in info.params {
                let values: Vec<Value> = match param.kind {
                    Kind::Word(words) => words.iter().map(|word| Value::Word((*word).into())).collect(),
                    Kind::Switch => vec![Value::Switch(false), Value::Switch(true)],
                    Kind::Count(_) => vec![Value::Count(7)],
                    _ => panic!("{} {}", info.name, param.name),
                };
                let others: Vec<_> = values.into_iter().map(|value| bound(Some((param.name, value)))).collect();
                assert!(others.iter().any(|other| *other != (traced.clone(), lit)), "{} {}", info.name, param.name);
                let of_light = ["spectral", "adjacency", "limb_darkening"].contains(&param.name);
                assert!(!of_light || others.iter().all(|(own, _)| *own == traced), "{} {}", info.name, param.name);
            }
            assert!(BUILTIN.iter().filter(|other| other.info.name != info.name).all(|other| {
                (other.bind)(&Args::new(&other.info, None), &grid).is_ok_and(|other| other.traced_by() != traced)
            }));
        }
    }

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
