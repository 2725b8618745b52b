//! Bird & Riordan's simple spectral model, with a standard sky and closed forms for the path.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::{Arc, LazyLock};

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, Irradiance, Radiance, SpectralGrid, Spectrum, Transmittance, WorldDir};

use crate::haze::{DEFAULT_VISIBILITY, Haze, surface_extinction};
use crate::interpolation::OntoGrid;
use crate::profile::saturation_pressure;
use crate::sightline::{Air, Beam, Optics, Sightline, growth_mixed, growth_water, sightline};
use crate::sky_shape::{Distribution, SkyShape};
use crate::{Atmosphere, AtmosphereError, Column, Needs, Path, SkyState, Sun, coverage, embedded};

const MANUAL: &str = "\
SPECTRL2: a clear sky in closed form, 0.3 to 4.0 µm, straight lines between 122 wavelengths [Bird1986, Bird1984].

Direct beam, at normal incidence
  E_n = E_s T_R T_a T_w T_o T_u                    τ₁ = E_n / E_s;  E_s = H₀(λ)/d², the model's own solar table
  T_R = exp(−M′/[λ⁴ (115.6406 − 1.3366/λ²)])       M′ = M p / 1013 hPa,  λ in µm
  T_a = exp(−τ_a M)                                τ_a = τ_0.5 (λ/0.5)^(−α)
  T_w = exp(−0.2385 a_w W M/(1 + 20.07 a_w W M)^0.45)
  T_o = exp(−a_o O₃ M_o)                           M_o = (1 + h)/√(cos²Z + 2h),  h = 22/6370
  T_u = exp(−1.41 a_u M′/(1 + 118.3 a_u M′)^0.45)
  M   = 1/(cos Z + 0.15 (93.885° − Z)^−1.253)      [Kasten1966], Z the refracted zenith angle

Diffuse irradiance on the level
  E_d = (I_r + I_a + I_g) C_s                      C_s = (λ + 0.55)^1.8 up to 0.45 µm, 1 beyond
  I_r = ½ E_s cos Z T_o T_u T_w T_aa (1 − T_R^0.95)
  I_a = E_s cos Z T_o T_u T_w T_aa T_R^1.5 (1 − T_as) F_s
  I_g = (E_n cos Z + I_r + I_a) r_s A/(1 − r_s A)  A the ground's albedo at that wavelength
  T_as = exp(−ω τ_a M), T_aa = exp(−(1 − ω) τ_a M), ω = ω_0.4 exp(−ω′ ln²(λ/0.4))
  F_s = 1 − ½ exp[(A_f + B_f cos Z) cos Z], A_f and B_f of the asymmetry g
  r_s = T_u′ T_w′ T_aa′ [½ (1 − T_R′) + (1 − F_s′) T_R′ (1 − T_as′)], primes at M = 1.8
Constants follow NREL's program spectrl2_2.c, as pvlib does; report and program differ in three of them.

Sky: E_d is spread by a published distribution, the same at all wavelengths, scaled so that ∫ L cos θ dω = E_d.
  clear      CIE Standard General Sky type 12 [CIE2003, Darula2002]
  turbid     type 13, polluted air
  overcast   L = L₀ (1 + 2 cos θ)/3 [Moon1942]
  isotropic  L = E_d/π

State of the air
  aerosol    `visibility` V (23 km if nothing is said): β(0.55 µm) = 3.912/V − β_Rayleigh at the surface; the column by
             LOWTRAN 7's spring–summer profile with background stratosphere, below 6 km squeezed onto the site.
             Or `aod` at 0.55 µm; then the profile with that column. τ_0.5 follows by α.
  water      `water`, else the profile's column above the site; with `humidity` scaled so that the profile has that
             relative humidity over water at the surface, at `temperature` if said [WMO2018].
  ozone      `ozone`, else the profile's.   pressure   `pressure`, else the profile's at the site's elevation.
             With `radiosonde` its levels are the profile; `observations` count as if said here.

Path to the sensor: an approximation of this program, not part of SPECTRL2. The constituents are spread over height as
in the profiles; each is a straight exponential between levels, so the slant amount of any path is exact, from a
centimetre to space, upwards, downwards and level.
  τ₂  = e^(−X)
  L_u = E_s/(4π) [X_R P_R + ω X_a P_HG] e^(−y₀) φ(y₁ − y₀) + (X_R + ω X_a) φ(X) (E_d f + A E_g)/(2π)
        φ(x) = (1 − e^(−x))/x;  y: optical depth of sun and path by way of the sensor (0) and the target (1)
The first term is single scattering of the sun's beam, as if the exponent ran straight in optical depth along the
path; exact for one constituent seen from space, and Koschmieder's law on the level. The second treats the light of
sky and ground as isotropic from above and from below, f being the share of the scattering column above the path.
Light scattered more than once is in E_d alone; the ground seen by the air is the mean albedo A.

Validity: no clouds; Z below 80° best; published agreement with measured and rigorous spectra about 5 to 10 %, worse
in the absorption bands. Below the horizon τ₁ = E_d = L_u = 0. Path radiance is too low in thick haze (X above 1).

Cost: about 10 µs a path for 0.4 to 1.0 µm.

In a scene
  atmosphere spectrl2 { turbidity_exponent 1.3, sky clear }
";

/// SPECTRL2 \[Bird1986\].
pub const MODEL: Model<dyn Atmosphere> = Model {
    info: ModelInfo {
        name: "spectrl2",
        summary: "Bird & Riordan's clear sky in closed form, with a standard sky and a single-scattering path",
        manual: MANUAL,
        params: &[
            Param::quantity(
                "turbidity_exponent",
                Dimension::Fraction,
                Default::Number(1.14),
                "Ångström's exponent α of aerosol optical depth",
            )
            .within(-0.5, 4.0),
            Param::quantity(
                "single_scattering_albedo",
                Dimension::Fraction,
                Default::Number(0.945),
                "ω of the aerosol at 400 nm",
            )
            .within(0.0, 1.0),
            Param::quantity(
                "albedo_wavelength_factor",
                Dimension::Fraction,
                Default::Number(0.095),
                "ω′: how ω falls off with wavelength",
            )
            .within(0.0, 1.0),
            Param::quantity("asymmetry", Dimension::Fraction, Default::Number(0.65), "g of the aerosol")
                .within(0.0, 0.95),
            Param::word(
                "sky",
                &["clear", "turbid", "overcast", "isotropic"],
                Default::Word("clear"),
                "distribution of the diffuse light",
            ),
        ],
    },
    bind: |args: &Args, _grid: &SpectralGrid| -> Result<Arc<dyn Atmosphere>, BindError> {
        let standard = Spectrl2Aerosol::default();
        let or = |name, value| args.number(name).unwrap_or(value);
        Ok(Arc::new(Spectrl2 {
            aerosol: Spectrl2Aerosol {
                turbidity_exponent: or("turbidity_exponent", standard.turbidity_exponent),
                single_scattering_albedo: or("single_scattering_albedo", standard.single_scattering_albedo),
                albedo_wavelength_factor: or("albedo_wavelength_factor", standard.albedo_wavelength_factor),
                asymmetry: or("asymmetry", standard.asymmetry),
            },
            distribution: match args.word("sky") {
                Some("isotropic") => Distribution::Isotropic,
                Some("overcast") => Distribution::Overcast,
                Some("turbid") => Distribution::turbid(),
                _ => Distribution::clear(),
            },
        }))
    },
};

/// The aerosol of SPECTRL2; the default is the paper's rural one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrl2Aerosol {
    /// Ångström's exponent α.
    pub turbidity_exponent: f64,
    /// Single-scattering albedo ω at 0.4 µm.
    pub single_scattering_albedo: f64,
    /// ω′ of ω(λ) = ω exp(−ω′ ln²(λ/0.4)).
    pub albedo_wavelength_factor: f64,
    /// Asymmetry factor g.
    pub asymmetry: f64,
}

impl std::default::Default for Spectrl2Aerosol {
    fn default() -> Self {
        Self {
            turbidity_exponent: 1.14,
            single_scattering_albedo: 0.945,
            albedo_wavelength_factor: 0.095,
            asymmetry: 0.65,
        }
    }
}

impl Spectrl2Aerosol {
    /// Optical depth at λ \[µm\] over that at 0.5 µm \[Bird1984, eq. 2-7\].
    fn spectral(&self, wavelength: f64) -> f64 {
        (wavelength / 0.5).powf(-self.turbidity_exponent)
    }

    /// ω(λ) \[Bird1984, eq. 3-16\].
    fn albedo(&self, wavelength: f64) -> f64 {
        let ln = (wavelength / 0.4).ln();
        self.single_scattering_albedo * (-self.albedo_wavelength_factor * ln * ln).exp()
    }

    /// F_s: share of scattered light that goes forward, for the sun at cos Z \[Bird1984, eqs. 3-11 to 3-15\].
    fn forward(&self, cos_zenith: f64) -> f64 {
        let alg = (1.0 - self.asymmetry).ln();
        let afs = alg * (1.459 + alg * (0.1595 + alg * 0.4129));
        let bfs = alg * (0.0783 + alg * (-0.3824 - alg * 0.5874));
        1.0 - 0.5 * ((afs + bfs * cos_zenith) * cos_zenith).exp()
    }
}

/// What SPECTRL2 is asked on the level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrl2Inputs {
    /// Zenith angle Z of the refracted sun \[rad\].
    pub apparent_zenith: f64,
    /// Relative air mass M ([`relative_air_mass`] is the paper's).
    pub relative_air_mass: f64,
    /// Surface pressure \[hPa\].
    pub pressure: f64,
    /// Precipitable water \[g cm⁻²\].
    pub water: f64,
    /// Ozone \[atm-cm\].
    pub ozone: f64,
    /// Aerosol optical depth at 0.5 µm.
    pub aod_500: f64,
    /// What multiplies the solar table for the Earth–Sun distance: 1/d².
    pub irradiance_factor: f64,
    /// Ground albedo A.
    pub ground_albedo: f64,
    /// The aerosol.
    pub aerosol: Spectrl2Aerosol,
}

/// SPECTRL2 at one wavelength of its table, W m⁻² µm⁻¹.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrl2Point {
    /// Wavelength \[µm\].
    pub wavelength: f64,
    /// Above the atmosphere, normal incidence.
    pub solar: f64,
    /// Direct, normal incidence.
    pub direct_normal: f64,
    /// Direct, on the level.
    pub direct_horizontal: f64,
    /// Diffuse, on the level.
    pub diffuse_horizontal: f64,
}

/// SPECTRL2 at the 122 wavelengths of its table. All irradiances on the ground are 0 with the sun at or below the
/// horizon.
pub fn spectrl2_at_table(inputs: &Spectrl2Inputs) -> Vec<Spectrl2Point> {
    let cos_zenith = inputs.apparent_zenith.cos().max(0.0);
    (TABLE.iter())
        .map(|row| {
            let terms = terms(row, inputs);
            let direct_normal = terms.solar * terms.transmittance;
            Spectrl2Point {
                wavelength: row.wavelength,
                solar: terms.solar,
                direct_normal,
                direct_horizontal: direct_normal * cos_zenith,
                diffuse_horizontal: terms.scattered + returned(terms.lit, terms.air_reflectance, inputs.ground_albedo),
            }
        })
        .collect()
}

/// Relative air mass of the refracted sun \[Kasten1966\]; at the horizon for a sun below it.
pub fn relative_air_mass(apparent_zenith: f64) -> f64 {
    let zenith = apparent_zenith.clamp(0.0, FRAC_PI_2);
    1.0 / (zenith.cos() + 0.15 * (93.885 - zenith.to_degrees()).powf(-1.253))
}

/// Air mass of ozone \[Bird1984, eq. 2-10\].
fn ozone_mass(apparent_zenith: f64) -> f64 {
    const H: f64 = 22.0 / 6370.0;
    (1.0 + H) / (apparent_zenith.clamp(0.0, FRAC_PI_2).cos().powi(2) + 2.0 * H).sqrt()
}

/// Rayleigh optical depth per unit of M′ \[Bird1984, eq. 2-4\].
fn rayleigh_depth(wavelength: f64) -> f64 {
    let l2 = wavelength * wavelength;
    1.0 / (l2 * l2 * (115.6406 - 1.3366 / l2))
}

/// The pressure to which M′ refers \[hPa\].
const REFERENCE_PRESSURE: f64 = 1013.0;

struct Row {
    /// λ \[µm\].
    wavelength: f64,
    /// H₀ \[W m⁻² µm⁻¹\].
    solar: f64,
    water: f64,
    ozone: f64,
    mixed: f64,
}

static TABLE: LazyLock<Vec<Row>> = LazyLock::new(|| {
    (embedded::rows(include_str!("../data/spectrl2_122.csv")).iter())
        .map(|r| Row { wavelength: 1e-3 * r[0], solar: 1e3 * r[1], water: r[2], ozone: r[3], mixed: r[4] })
        .collect()
});

/// The parts of SPECTRL2 that do not depend on the ground.
struct Terms {
    /// E_s.
    solar: f64,
    /// τ₁.
    transmittance: f64,
    /// (I_r + I_a) C_s.
    scattered: f64,
    /// (E_n cos Z + I_r + I_a) C_s, what the ground is lit by before it answers.
    lit: f64,
    /// r_s.
    air_reflectance: f64,
}

/// I_g C_s \[Bird1984, eq. 3-7\].
fn returned(lit: f64, air_reflectance: f64, ground_albedo: f64) -> f64 {
    let both = air_reflectance * ground_albedo;
    lit * both / (1.0 - both).max(1e-9)
}

fn terms(row: &Row, x: &Spectrl2Inputs) -> Terms {
    let cos_z = x.apparent_zenith.cos();
    let haze = x.aod_500 * x.aerosol.spectral(row.wavelength);
    let albedo = x.aerosol.albedo(row.wavelength);
    let per_pressure = x.pressure / REFERENCE_PRESSURE;
    // T_R, T_w, T_u, T_as, T_aa at an air mass.
    let at = |mass: f64| {
        (
            (-rayleigh_depth(row.wavelength) * mass * per_pressure).exp(),
            (-growth_water(row.water * x.water * mass)).exp(),
            (-growth_mixed(row.mixed * mass * per_pressure)).exp(),
            (-albedo * haze * mass).exp(),
            (-(1.0 - albedo) * haze * mass).exp(),
        )
    };
    let (t_r, t_w, t_u, t_as, t_aa) = at(x.relative_air_mass);
    let t_o = (-row.ozone * x.ozone * ozone_mass(x.apparent_zenith)).exp();
    let solar = row.solar * x.irradiance_factor;

    const MEAN_MASS: f64 = 1.8;
    let (p_r, p_w, p_u, p_as, p_aa) = at(MEAN_MASS);
    let p_f = x.aerosol.forward(1.0 / MEAN_MASS);
    let air_reflectance = p_u * p_w * p_aa * (0.5 * (1.0 - p_r) + (1.0 - p_f) * p_r * (1.0 - p_as));
    if cos_z <= 0.0 {
        return Terms { solar, transmittance: 0.0, scattered: 0.0, lit: 0.0, air_reflectance };
    }
    let transmittance = t_r * t_as * t_aa * t_w * t_o * t_u;
    let common = solar * cos_z * t_o * t_u * t_w * t_aa;
    let by_air = common * (1.0 - t_r.powf(0.95)) * 0.5;
    let by_haze = common * t_r.powf(1.5) * (1.0 - t_as) * x.aerosol.forward(cos_z);
    let cs = if row.wavelength <= 0.45 + 1e-9 { (row.wavelength + 0.55).powf(1.8) } else { 1.0 };
    Terms {
        solar,
        transmittance,
        scattered: (by_air + by_haze) * cs,
        lit: (solar * transmittance * cos_z + by_air + by_haze) * cs,
        air_reflectance,
    }
}

struct Spectrl2 {
    aerosol: Spectrl2Aerosol,
    distribution: Distribution,
}

impl Atmosphere for Spectrl2 {
    fn nodes(&self) -> Vec<f64> {
        TABLE.iter().map(|row| row.wavelength).collect()
    }

    fn uses(&self) -> &'static [&'static str] {
        &[
            "visibility",
            "aod",
            "profile",
            "radiosonde",
            "observations",
            "pressure",
            "temperature",
            "humidity",
            "water",
            "ozone",
        ]
    }

    fn has_directional_sky(&self) -> bool {
        self.distribution != Distribution::Isotropic
    }

    fn solve(
        &self,
        column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        _needs: &Needs, // what a plan does without is found when first asked for, or costs less than asking
    ) -> Result<Vec<Box<dyn SkyState>>, AtmosphereError> {
        let nodes = self.nodes();
        coverage::check("the table of spectrl2", (nodes[0], nodes[nodes.len() - 1]), grid)?;
        if column.ground_albedo.len() != grid.len() {
            let (found, due) = (column.ground_albedo.len(), grid.len());
            return Err(AtmosphereError {
                code: "M04",
                message: format!("the ground albedo has {found} values where the spectral grid has {due}"),
            });
        }
        let onto = OntoGrid::new(&nodes, grid);
        let site = Arc::new(Site::new(column, &self.aerosol, onto)?);
        Ok(suns.iter().map(|sun| self.under(&site, column, sun)).collect())
    }
}

/// What all suns share.
struct Site {
    onto: OntoGrid,
    air: Air,
    pressure: f64,
    water: f64,
    ozone: f64,
    aod_500: f64,
    /// At the nodes that the grid uses; the sun at 1 au.
    optics: Vec<Optics>,
}

impl Site {
    fn new(column: &Column, aerosol: &Spectrl2Aerosol, onto: OntoGrid) -> Result<Self, AtmosphereError> {
        let profile = column.levels()?;
        let elevation = column.elevation;
        let pressure = column.pressure.unwrap_or_else(|| profile.pressure(elevation)).max(0.0);
        let (air, _) = profile.air(elevation);
        let (water_spread, water_column) = profile.water(elevation);
        let (ozone_spread, ozone_column) = profile.ozone(elevation);
        let temperature = column.temperature.unwrap_or_else(|| profile.temperature(elevation));
        let water = column.water.unwrap_or_else(|| {
            let wetter = column.humidity.map_or(1.0, |humidity| {
                humidity * saturation_pressure(temperature) / profile.vapour_pressure(elevation)
            });
            water_column * wetter
        });
        let haze = match column.aod {
            Some(aod) => Haze::from_optical_depth(aod.max(0.0), elevation),
            None => {
                let rayleigh = rayleigh_depth(0.55) * pressure / REFERENCE_PRESSURE * air.mean(0.0, 0.0);
                let visibility = column.visibility.unwrap_or(DEFAULT_VISIBILITY);
                Haze::from_extinction(surface_extinction(visibility, rayleigh), elevation)
            }
        };
        let (water, ozone) = (water.max(0.0), column.ozone.unwrap_or(ozone_column).max(0.0));
        let aod_500 = haze.optical_depth * aerosol.spectral(0.55).recip();
        let optics = (TABLE[onto.nodes()].iter())
            .map(|row| {
                let depth = aod_500 * aerosol.spectral(row.wavelength);
                Optics {
                    rayleigh: rayleigh_depth(row.wavelength) * pressure / REFERENCE_PRESSURE,
                    haze: depth,
                    haze_scattering: depth * aerosol.albedo(row.wavelength),
                    water: row.water * water,
                    ozone: row.ozone * ozone,
                    mixed: row.mixed * pressure / REFERENCE_PRESSURE,
                    solar: row.solar,
                }
            })
            .collect();
        let air = Air { air, haze: haze.vertical, water: water_spread, ozone: ozone_spread };
        Ok(Self { onto, air, pressure, water, ozone, aod_500, optics })
    }
}

impl Spectrl2 {
    fn under(&self, site: &Arc<Site>, column: &Column, sun: &Sun) -> Box<dyn SkyState> {
        let apparent_zenith = sun.apparent.zenith();
        let inputs = Spectrl2Inputs {
            apparent_zenith,
            relative_air_mass: relative_air_mass(apparent_zenith),
            pressure: site.pressure,
            water: site.water,
            ozone: site.ozone,
            aod_500: site.aod_500,
            irradiance_factor: sun.distance.powi(-2),
            ground_albedo: 0.0,
            aerosol: self.aerosol,
        };
        let at_nodes: Vec<Terms> = TABLE[site.onto.nodes()].iter().map(|row| terms(row, &inputs)).collect();
        let on_grid = |of: fn(&Terms) -> f64| -> Vec<f64> {
            let at_nodes: Vec<f64> = at_nodes.iter().map(of).collect();
            site.onto.apply(&at_nodes)
        };
        let solar = on_grid(|t| t.solar);
        let transmittance: Vec<f64> = on_grid(|t| t.transmittance).into_iter().map(|t| t.min(1.0)).collect();
        let (lit, air_reflectance) = (on_grid(|t| t.lit), on_grid(|t| t.air_reflectance));
        let mut diffuse = on_grid(|t| t.scattered);
        let mut from_ground = Vec::with_capacity(diffuse.len());
        let cos_zenith = apparent_zenith.cos().max(0.0);
        for (i, diffuse) in diffuse.iter_mut().enumerate() {
            let albedo = column.ground_albedo[i];
            *diffuse += returned(lit[i], air_reflectance[i], albedo);
            from_ground.push(albedo * (solar[i] * transmittance[i] * cos_zenith + *diffuse));
        }
        let mean_sky = diffuse.iter().map(|e| e / PI).collect();
        Box::new(Spectrl2Sky {
            solar: Spectrum::new(solar),
            transmittance: Spectrum::new(transmittance),
            diffuse: Spectrum::new(diffuse),
            mean_sky: [Spectrum::new(mean_sky)],
            shape: SkyShape::new(self.distribution, sun.apparent),
            sun: *sun,
            asymmetry: self.aerosol.asymmetry,
            from_ground,
            site: Arc::clone(site),
        })
    }
}

struct Spectrl2Sky {
    solar: Spectrum<Irradiance>,
    transmittance: Spectrum<Transmittance>,
    diffuse: Spectrum<Irradiance>,
    mean_sky: [Spectrum<Radiance>; 1],
    shape: SkyShape,
    sun: Sun,
    asymmetry: f64,
    /// A E_g.
    from_ground: Vec<f64>,
    site: Arc<Site>,
}

impl SkyState for Spectrl2Sky {
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
        &self.mean_sky
    }

    fn sky_weights(&self, direction: WorldDir, weights: &mut Vec<(u32, f64)>) {
        weights.clear();
        weights.extend(self.shape.relative(direction).filter(|s| *s != 0.0).map(|s| (0, s)));
    }

    fn path(&self, path: &Path, transmittance: &mut [f64], radiance: &mut [f64]) {
        let zenith = self.sun.apparent.zenith();
        let beam = self.sun.is_up().then(|| Beam {
            air_mass: relative_air_mass(zenith),
            ozone_mass: ozone_mass(zenith),
            cos_scattering: -self.sun.apparent.dot(path.towards_sensor),
        });
        let site = &*self.site;
        let seen: Vec<Sightline> = sightline(&site.air, path, beam, self.asymmetry, site.optics.iter()).collect();
        let per_distance = self.sun.distance.powi(-2);
        for (i, (transmittance, radiance)) in transmittance.iter_mut().zip(radiance).enumerate() {
            let mut sum = Sightline::default();
            for (node, weight) in site.onto.entry(i) {
                let seen = &seen[*node];
                sum.transmittance += weight * seen.transmittance;
                sum.beam += weight * seen.beam;
                sum.per_ground += weight * seen.per_ground;
                sum.per_sky += weight * seen.per_sky;
            }
            *transmittance = sum.transmittance.clamp(0.0, 1.0);
            *radiance = per_distance * sum.beam.max(0.0)
                + sum.per_sky.max(0.0) * self.diffuse[i]
                + sum.per_ground.max(0.0) * self.from_ground[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::Profile;

    fn grid() -> SpectralGrid {
        let edges: Vec<f64> = TABLE.iter().map(|row| row.wavelength).filter(|l| (0.4..=1.0).contains(l)).collect();
        SpectralGrid::from_edges(&edges)
    }

    fn column(albedo: f64, grid: &SpectralGrid) -> Column {
        Column { elevation: 168.0, ground_albedo: vec![albedo; grid.len()], ..Column::default() }
    }

    fn provider(sky: Distribution) -> Spectrl2 {
        Spectrl2 { aerosol: Spectrl2Aerosol::default(), distribution: sky }
    }

    fn all() -> Needs {
        Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None }
    }

    fn one(column: &Column, sun: Sun, grid: &SpectralGrid) -> Box<dyn SkyState> {
        provider(Distribution::clear()).solve(column, &[sun], grid, &all()).unwrap().remove(0)
    }

    /// Between nodes the provider's spectra are straight lines: two Gauss points of a bin, continued to the bin's edges,
    /// are the table's points.
    #[test]
    fn the_provider_on_a_grid_is_the_table_between_its_nodes() {
        let grid = grid();
        let (sun, column) = (Sun::at(0.9, 1.0), column(0.0, &grid));
        let sky = one(&column, sun, &grid);
        let site = Site::new(
            &column,
            &Spectrl2Aerosol::default(),
            OntoGrid::new(&provider(Distribution::Isotropic).nodes(), &grid),
        )
        .unwrap();
        let table = spectrl2_at_table(&Spectrl2Inputs {
            apparent_zenith: 0.9,
            relative_air_mass: relative_air_mass(0.9),
            pressure: site.pressure,
            water: site.water,
            ozone: site.ozone,
            aod_500: site.aod_500,
            irradiance_factor: 1.0,
            ground_albedo: 0.0,
            aerosol: Spectrl2Aerosol::default(),
        });
        let lower_edge = |values: &[f64], bin: usize| {
            let (a, b) = (values[2 * bin], values[2 * bin + 1]);
            0.5 * (a + b) - 0.5 * (b - a) * 3f64.sqrt()
        };
        for (i, bin) in grid.bins().iter().enumerate() {
            let point = table.iter().find(|point| (point.wavelength - bin.lower).abs() < 1e-9).unwrap();
            assert!((lower_edge(sky.solar_irradiance(), i) / point.solar - 1.0).abs() < 1e-9);
            let tau = lower_edge(sky.sun_transmittance(), i);
            assert!((tau - point.direct_normal / point.solar).abs() < 1e-9);
            assert!((lower_edge(sky.diffuse_irradiance(), i) / point.diffuse_horizontal - 1.0).abs() < 1e-9);
        }
    }

    /// A vertical path from the ground to space holds one column of everything: τ₂ is τ₁ of a sun with air mass 1 (for ozone
    /// 1 + 6e-6 at the zenith, which is 2e-7 of transmittance).
    #[test]
    fn the_vertical_way_out_is_as_clear_as_the_way_in() {
        let grid = grid();
        let site = column(0.1, &grid);
        let sky = one(&site, Sun::at(0.5, 0.0), &grid);
        let onto = OntoGrid::new(&provider(Distribution::Isotropic).nodes(), &grid);
        let state = Site::new(&site, &Spectrl2Aerosol::default(), onto).unwrap();
        let inputs = Spectrl2Inputs {
            apparent_zenith: 0.0,
            relative_air_mass: 1.0,
            pressure: state.pressure,
            water: state.water,
            ozone: state.ozone,
            aod_500: state.aod_500,
            irradiance_factor: 1.0,
            ground_albedo: 0.0,
            aerosol: Spectrl2Aerosol::default(),
        };
        let expected: Vec<f64> =
            TABLE[state.onto.nodes()].iter().map(|row| terms(row, &inputs).transmittance).collect();
        let (mut tau, mut radiance) = (vec![0.0; grid.len()], vec![0.0; grid.len()]);
        let up = Path { target_height: 0.0, sensor_height: 7e5, length: 7e5, towards_sensor: WorldDir::UP };
        sky.path(&up, &mut tau, &mut radiance);
        for (t, e) in tau.iter().zip(state.onto.apply(&expected)) {
            assert!((t - e).abs() < 5e-7, "{t} {e}");
        }
    }

    /// Where no band model is at work (no water, no mixed gas) Beer's law holds along a path: τ(a→c) = τ(a→b) τ(b→c) at
    /// the table's nodes. Curves of growth make gases more transparent than that, never less.
    #[test]
    fn transmittances_of_consecutive_paths_multiply() {
        let at_node = SpectralGrid::from_edges(&[0.4999999, 0.5000001]);
        let dry = Column { water: Some(0.0), ..column(0.1, &at_node) };
        let in_water = SpectralGrid::from_edges(&[0.9299999, 0.9300001]);
        let sun = Sun::at(0.5, 0.0);
        for (lower, middle, upper) in [(0.0, 1500.0, 7e5), (-50.0, 0.01, 300.0), (2.0, 2.0, 9000.0)] {
            let slope = 0.4_f64;
            let piece = |from: f64, to: f64| Path {
                target_height: from,
                sensor_height: to,
                length: (to - from) / slope.cos(),
                towards_sensor: WorldDir::from_zenith_azimuth(slope, 0.0),
            };
            let tau = |site: &Column, grid: &SpectralGrid, path: &Path| {
                let (mut t, mut l) = (vec![0.0; grid.len()], vec![0.0; grid.len()]);
                one(site, sun, grid).path(path, &mut t, &mut l);
                t[0]
            };
            let whole = tau(&dry, &at_node, &piece(lower, upper));
            let parts = tau(&dry, &at_node, &piece(lower, middle)) * tau(&dry, &at_node, &piece(middle, upper));
            assert!((whole / parts - 1.0).abs() < 1e-6, "{lower} {middle} {upper}: {whole} {parts}");
            let wet = column(0.1, &in_water);
            let whole = tau(&wet, &in_water, &piece(lower, upper));
            let parts = tau(&wet, &in_water, &piece(lower, middle)) * tau(&wet, &in_water, &piece(middle, upper));
            assert!(whole >= parts * (1.0 - 1e-12));
        }
    }

    #[test]
    fn humidity_is_the_profile_s_own_where_it_is_given_as_such() {
        let grid = grid();
        let onto = || OntoGrid::new(&provider(Distribution::Isotropic).nodes(), &grid);
        let aerosol = Spectrl2Aerosol::default();
        let plain = Site::new(&column(0.1, &grid), &aerosol, onto()).unwrap();
        let profile = Profile::named("us_standard").unwrap();
        let own = profile.vapour_pressure(168.0) / saturation_pressure(profile.temperature(168.0));
        assert!((0.40..0.50).contains(&own), "US standard air is at 46 % at the ground: {own}");
        let said = Column { humidity: Some(own), ..column(0.1, &grid) };
        assert!((Site::new(&said, &aerosol, onto()).unwrap().water / plain.water - 1.0).abs() < 1e-12);
        let warm = Column { temperature: Some(300.0), ..said };
        assert!(Site::new(&warm, &aerosol, onto()).unwrap().water > 1.5 * plain.water);
    }

    /// AOD at 0.55 µm and visibility name the same state; 0.5 µm follows by the exponent.
    #[test]
    fn optical_depth_at_500_nm_follows_from_550_nm() {
        let grid = grid();
        let onto = OntoGrid::new(&provider(Distribution::Isotropic).nodes(), &grid);
        let said = Column { aod: Some(0.2), ..column(0.1, &grid) };
        let site = Site::new(&said, &Spectrl2Aerosol::default(), onto).unwrap();
        assert!((site.aod_500 - 0.2 * 1.1f64.powf(1.14)).abs() < 1e-12);
    }

    #[test]
    fn a_wrong_profile_and_a_grid_beyond_the_table_are_errors() {
        let fine = grid();
        let unknown = Column { profile: "mars".to_string(), ..column(0.1, &fine) };
        let sky = provider(Distribution::clear());
        let error = |column: &Column, grid: &SpectralGrid| {
            sky.solve(column, &[Sun::at(0.5, 0.0)], grid, &all()).err().map(|error| error.code)
        };
        assert_eq!(error(&unknown, &fine), Some("A01"));
        let wide = SpectralGrid::from_edges(&[0.28, 0.31, 0.4]);
        assert_eq!(error(&column(0.1, &wide), &wide), Some("M04"));
        assert_eq!(error(&column(0.1, &wide), &fine), Some("M04"));
    }
}
