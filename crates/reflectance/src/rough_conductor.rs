#![doc = include_str!("rough_conductor.md")]

use sunglint_plugin::{Default, Model, ModelInfo, Param};

use crate::Bsdf;
use crate::fresnel::Interface;
use crate::ggx::{DIFFUSE, MULTIPLE, ROUGHNESS, bind_smith};
use crate::microfacet::Facets;

/// Facets of Gaussian slopes.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "rough_conductor",
        summary: "facets of Gaussian slopes (Beckmann) with Smith's shadowing and Fresnel reflectance from n and k",
        manual: include_str!("rough_conductor.md"),
        params: &[
            Interface::N,
            Interface::K,
            ROUGHNESS,
            Param::word(
                "shadowing",
                &["correlated", "separable", "walter"],
                Default::Word("correlated"),
                "Smith's shadowing and masking: together, each for itself, or each by Walter's rational form",
            ),
            MULTIPLE,
            DIFFUSE,
        ],
    },
    bind: |args, grid| bind_smith("rough_conductor", Facets::Beckmann, args, grid),
};
