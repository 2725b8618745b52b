//! No atmosphere: the bare sun, and a sky of a given radiance or none.

use std::sync::{Arc, LazyLock};

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param, SpectralValue};
use sunglint_radiometry::{Curve, Dimension, Irradiance, Radiance, SpectralGrid, Spectrum, Transmittance, WorldDir};

use crate::{Atmosphere, AtmosphereError, Column, Needs, Path, SkyState, Sun, coverage, embedded};

const MANUAL: &str = "\
No air between sun, target and sensor.

  τ₁ = τ₂ = 1, L_u = 0          τ₁ = 0 with the sun below the horizon
  E_s = E₀(λ)/d²                E₀ the TSIS-1 Hybrid Solar Reference Spectrum, version 2, at 1 au [Coddington2023], means
                                over 1 nm from 0.3 to 1.2 µm; or `solar_irradiance`, also at 1 au
  L_d(θ, φ) = L₀                `sky isotropic`: E_d = π L₀
  L_d(θ, φ) = L₀ (1 + 2 cos θ)/3   `sky overcast` [Moon1942]: E_d = 7π/9 L₀, L₀ the radiance of the zenith

`sky_radiance` is L₀, 0 unless given; it does not depend on the sun. A uniform sky of radiance L over surfaces that reflect
all of it is the white furnace: every pixel is L.

Validity: exact, being a definition; the solar spectrum is good to 0.3 % (1.3 % below 0.46 µm). Its wavelengths are those
in vacuum, 0.03 % longer than in air. Nothing of the weather is used.

In a scene
  atmosphere none
  atmosphere none { solar_irradiance 0 W/m2/um, sky_radiance 100 W/m2/sr/um }
";

/// The bare sun.
pub const MODEL: Model<dyn Atmosphere> = Model {
    info: ModelInfo {
        name: "none",
        summary: "no air: the bare sun, and a sky of given radiance if one is wanted",
        manual: MANUAL,
        params: &[
            Param::spectrum(
                "solar_irradiance",
                Dimension::Irradiance,
                Default::Absent,
                "at 1 au, normal incidence; the TSIS-1 HSRS spectrum unless given",
            )
            .within(0.0, 1e12),
            Param::spectrum("sky_radiance", Dimension::Radiance, Default::Number(0.0), "of the sky, at the zenith")
                .within(0.0, 1e12),
            Param::word(
                "sky",
                &["isotropic", "overcast"],
                Default::Word("isotropic"),
                "distribution of the sky's radiance",
            ),
        ],
    },
    bind: |args: &Args, _grid: &SpectralGrid| -> Result<Arc<dyn Atmosphere>, BindError> {
        Ok(Arc::new(Bare {
            solar: args.spectral("solar_irradiance").cloned(),
            zenith: args.spectral("sky_radiance").cloned().unwrap_or(SpectralValue::Constant(0.0)),
            overcast: args.word("sky") == Some("overcast"),
        }))
    },
};

struct Bare {
    solar: Option<SpectralValue>,
    zenith: SpectralValue,
    overcast: bool,
}

/// E₀ at 1 au.
pub(crate) static HSRS: LazyLock<Curve> = LazyLock::new(|| {
    let rows = embedded::rows(include_str!("../data/etr_tsis1_hsrs_v2_1nm.csv"));
    let mut edges: Vec<f64> = rows.iter().map(|row| 1e-3 * (row[0] - 0.5)).collect();
    edges.extend(rows.last().map(|row| 1e-3 * (row[0] + 0.5)));
    Curve::steps(edges, rows.iter().map(|row| row[1]).collect()).expect("the solar table ascends")
});

impl Atmosphere for Bare {
    fn uses(&self) -> &'static [&'static str] {
        &[]
    }

    fn has_directional_sky(&self) -> bool {
        true // of either shape the radiance is known in every direction
    }

    fn solve(
        &self,
        _column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        _needs: &Needs,
    ) -> Result<Vec<Box<dyn SkyState>>, AtmosphereError> {
        let solar = match &self.solar {
            Some(given) => on_grid("solar_irradiance", given, grid)?,
            None => {
                coverage::check("the TSIS-1 solar spectrum", HSRS.domain(), grid)?;
                HSRS.on(grid)
            }
        };
        let zenith = on_grid("sky_radiance", &self.zenith, grid)?;
        let irradiance_per_zenith = std::f64::consts::PI * if self.overcast { 7.0 / 9.0 } else { 1.0 };
        let under = |sun: &Sun| -> Box<dyn SkyState> {
            Box::new(BareSky {
                solar: Spectrum::new(solar.iter().map(|e| e * sun.distance.powi(-2)).collect()),
                transmittance: Spectrum::constant(if sun.is_up() { 1.0 } else { 0.0 }, grid),
                diffuse: Spectrum::new(zenith.iter().map(|l| l * irradiance_per_zenith).collect()),
                zenith: [Spectrum::new(zenith.clone())],
                overcast: self.overcast,
            })
        };
        Ok(suns.iter().map(under).collect())
    }
}

pub(crate) fn on_grid(name: &str, value: &SpectralValue, grid: &SpectralGrid) -> Result<Vec<f64>, AtmosphereError> {
    if let SpectralValue::Curve(curve) = value
        && !grid.bins().iter().all(|bin| curve.covers(bin.lower, bin.upper))
    {
        coverage::check(&format!("`{name}`"), curve.domain(), grid)?;
    }
    value.on(grid).map_err(|missing| AtmosphereError { code: "M04", message: format!("`{name}` has {missing}") })
}

struct BareSky {
    solar: Spectrum<Irradiance>,
    transmittance: Spectrum<Transmittance>,
    diffuse: Spectrum<Irradiance>,
    zenith: [Spectrum<Radiance>; 1],
    overcast: bool,
}

impl SkyState for BareSky {
    fn solar_irradiance(&self) -> &Spectrum<Irradiance> {
        &self.solar
    }

    fn sun_transmittance(&self) -> &Spectrum<Transmittance> {
        &self.transmittance
    }

    fn diffuse_irradiance(&self) -> &Spectrum<Irradiance> {
        &self.diffuse
    }

    fn sky_terms(&self) -> &[Spectrum<Radiance>] {
        &self.zenith
    }

    fn sky_weights(&self, direction: WorldDir, weights: &mut Vec<(u32, f64)>) {
        weights.clear();
        let cos_zenith = direction.cos_zenith();
        if cos_zenith >= 0.0 {
            weights.push((0, if self.overcast { (1.0 + 2.0 * cos_zenith) / 3.0 } else { 1.0 }));
        }
    }

    fn path(&self, _path: &Path, transmittance: &mut [f64], radiance: &mut [f64]) {
        transmittance.fill(1.0);
        radiance.fill(0.0);
    }
}
