#![doc = include_str!("ggx.md")]

use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, SpectralGrid};

use crate::Bsdf;
use crate::composite::{Composite, Energy};
use crate::facet_lobe::{FacetLobe, Law, Leftover, Leftovers};
use crate::fresnel::Interface;
use crate::microfacet::{Facets, Shadowing};
use crate::spectral::{fraction_or_zero, required, spectrum_within};

/// The model of Walter et al.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "ggx",
        summary: "facets of the long-tailed distribution of Trowbridge and Reitz, with Fresnel reflectance from n and k",
        manual: include_str!("ggx.md"),
        params: &[
            Interface::N,
            Interface::K,
            ROUGHNESS,
            Param::word(
                "shadowing",
                &["correlated", "separable"],
                Default::Word("correlated"),
                "Smith's shadowing and masking of light and view together, or each for itself",
            ),
            MULTIPLE,
            DIFFUSE,
        ],
    },
    bind: |args, grid| bind_smith("ggx", Facets::Ggx, args, grid),
};

/// The parameter `roughness` of facets.
pub(crate) const ROUGHNESS: Param =
    Param::spectrum("roughness", Dimension::Fraction, Default::Required, "α, √2 × the rms slope; 0 is a mirror")
        .within(0.0, 2.0);

/// The parameter `multiple`.
pub(crate) const MULTIPLE: Param = Param::switch("multiple", false, "add the light that facets reflect more than once");

/// The parameter `diffuse` of what lies beneath an interface.
pub(crate) const DIFFUSE: Param = Param::spectrum(
    "diffuse",
    Dimension::Fraction,
    Default::Number(0.0),
    "albedo of a diffuse base beneath the interface",
)
.within(0.0, 1.0);

/// Binds a facet model with Smith's shadowing.
pub(crate) fn bind_smith(
    name: &str,
    facets: Facets,
    args: &Args,
    grid: &SpectralGrid,
) -> Result<Arc<dyn Bsdf>, BindError> {
    let n = grid.len();
    let interface = Interface::bind(name, args, grid)?;
    let roughness = spectrum_within(&ROUGHNESS, required(name, args, "roughness")?, grid)?;
    let diffuse = fraction_or_zero(args, "diffuse", grid)?;
    let shadowing = match args.word("shadowing") {
        Some("separable") => Shadowing::Separable,
        Some("walter") => Shadowing::Walter,
        _ => Shadowing::Correlated,
    };
    let law = Law::Smith(facets, shadowing);
    let mut bodies = Vec::new();
    let mut taken = None;
    if args.switch("multiple") == Some(true) {
        let loss_free = FacetLobe::new(law, roughness.clone(), None, vec![1.0; n]).reflectance(n);
        // E_avg of facets that lose nothing, F_avg of one reflection [Kulla2017, p. 18].
        let e_avg = loss_free.hemispherical();
        let share = (e_avg.iter().enumerate())
            .map(|(entry, e)| {
                let f = interface.mean(entry);
                f * f * e / (1.0 - f * (1.0 - e))
            })
            .collect();
        let multiple = Leftover::new(share, &loss_free);
        taken = Some(multiple.reflectance());
        bodies.push(multiple);
    }
    let lobe = FacetLobe::new(law, roughness, Some(interface), vec![1.0; n]);
    if diffuse.iter().any(|d| *d > 0.0) {
        let mut reflectance = lobe.reflectance(n);
        if let Some(multiple) = taken {
            reflectance = reflectance.plus(&multiple);
        }
        bodies.push(Leftover::new(diffuse, &reflectance));
    }
    Ok(Arc::new(Composite::new(Leftovers(bodies), lobe, n, true, Energy::Conserved)))
}
