//! The layered, spherical column with multiple scattering solved.

use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Bin, Dimension, SpectralGrid};

use crate::column_sky::{self, ColumnAir, Settings};
use crate::ladder::Ladder;
use crate::none::HSRS;
use crate::radiance::streams;
use crate::strata::Site;
use crate::{Atmosphere, AtmosphereError, Column, Needs, SkyState, Sun, coverage, gas};

const MANUAL: &str = "\
A column of air in layers on a round Earth, its multiple scattering solved; 0.38 to 1.04 µm.

Light
  E_s   TSIS-1 HSRS, means of 1 nm [Coddington2023], over d² of the date
  τ₁ = Σ_g w_g exp(−∫ β ds)                        β extinction; along the refracted ray to the sun
  τ₂ = Σ_g w_g exp(−∫ β ds)                        from target to sensor
  L  = ∫ [J₁ + J] e^(−τ) dτ                        L_d from the ground up, L_u from sensor to target [Chandrasekhar1960]
  J₁ = Σ_c β_c P_c(Θ) E T_sun/(4π β)               light scattered once: every scatterer with its own phase function
  J  = (ω/4π) ∫ P L dω                             light scattered before, from the solution below
  L  = L₀ + L_g G,  E_d = E_d0 + L_g π S           over a Lambertian ground that shines with
  L_g = A (E_s τ₁ cos θ + E_d0)/(π (1 − A S))      A its albedo, S the sky's; the mean over the scene's ground

Multiple scattering, order by order of azimuth, plane-parallel
  Discrete ordinates on a double-Gauss quadrature [Stamnes1981]; reflection and transmission of a layer by the symmetric
  form of its eigenvalue problem [Nakajima1986], in which ω = 1 is no exception; layers joined by adding [Grant1969,
  Plass1973], so that one set of operators serves all suns of a day. Forward peaks are scaled by delta-M [Wiscombe1977],
  light scattered once is put right (TMS), and light scattered twice in the peak (IMS) at all angles [Nakajima1988].
  E_d counts what delta-M leaves in the beam.

Round Earth
  x = n r, x sin θ = p along a ray [Born1999]; x is a straight line in a shell, so lengths and angles are closed forms.
  Refraction by the column's own air, at 0.55 µm for all wavelengths. Along a line of sight the angles of view and sun
  change. The plane-parallel solution is driven by beams of spherical lengths [Dahlback1991], for a row of the sun's
  zenith angles, and read at the sun of each point [Spurr2002]. Beams and single scattering are those of spherical
  shells; light scattered more often is taken as if the shells were level where it is.
  Twilight: with the sun below the horizon τ₁ = 0 while the high air is still lit, down to a true zenith angle of 98°.

The air
  32 layers, closer near the ground, to 100 km; the edges of clouds are edges of layers. Every amount is integrated with
  exponentials between the levels of the profile, so that layers sum to columns.
  molecules  cross-section and depolarisation [Bodhaine1999]
  H₂O, O₂    LOWTRAN 7's band models as sums of exponentials, Σ_g w_g e^(−k_g W), within 0.002 of the band model's
             transmittance from nothing to 40 tropical columns [Pierluissi1986, Kneizys1988]: lines overlap at random;
             each term g is solved as a monochromatic wavelength is; the continuum of water
  O₃, NO₂, O₂–O₂     the Chappuis band [Kneizys1988], [Sander2006], [Greenblatt1990]
  aerosol    Shettle & Fenn's as in LOWTRAN 7, or `angstrom` (`sunglint models rural`, `sunglint models angstrom`)
  cloud      water drops of 10 µm effective radius, Mie's theory; level, homogeneous and without end

Weather: every field has its effect
  profile       pressure, temperature, water and ozone against height [Anderson1986]
  radiosonde    its levels take the profile's place up to its top; the profile's ozone holds
  observations  each field of the record, as if said here at that time
  visibility    aerosol extinction at the ground, β(0.55 µm) = 3.912/V − β_Rayleigh, and by LOWTRAN 7's vertical profile
                its column (23 km if nothing is said)
  aod           instead, the optical depth of that column at 0.55 µm
  aerosol       what scatters below 2 km above the site: extinction against wavelength, ω and P at the air's humidity
  pressure      all of the air, and with it Rayleigh scattering and O₂: p p_s/p(0)
  temperature   T at the ground, fading out to 2 km: absorption by gases, refraction, and what `humidity` means
  humidity      at the ground: the profile's water scaled, at most to saturation; the aerosol swells with it
  water, ozone, no2     the column, the profile scaled
  cloud         optical depth at 0.55 µm between two heights above the site

Parameters
  streams    directions of the quadrature: 4, 8, 16, 32 or 64 (a number between is raised to the next); auto is 16
  geometry   spherical, or plane: no curvature, no refraction, no twilight
  accuracy   azimuthal orders are added until what is left of the source, by their fall, is less than this share of it
  spectrum   adapted: fluxes and transmittances at every wavelength and term g, radiances for a ladder of columns over
             wavelength and, beside it, over the absorption of water and of oxygen; between its rungs ln L/E_d of the sky and
             ln of the path's source are interpolated, absorption of the sun's light left apart. full: radiances
             everywhere, for checks

Sky: L_d is known at 20 zenith angles by 15 azimuths from the sun's. Between them, in sin(θ/2) and in sin(Δφ/2), its ratio
to a shape runs straight that has the aureole and the brightening horizon in it.

Validity
  Scalar: polarisation is left out. Where molecules scatter most, in blue without haze, radiances err by up to 10 %, too
  bright (8 % at 0.4 µm) at 90° from the sun and too dark (5 %) back towards it; irradiance errs far less, haze and a
  bright ground take from both [Mishchenko1994, Lacis1998, Emde2018].
  No Raman scattering (it fills Fraunhofer lines), no fluorescence, no airglow, moon or stars.
  Gases by band models of 20 cm⁻¹: a band narrower than that sees no lines.
  Air, ground albedo and clouds are the same everywhere: no adjacency of single fields, no shadows of clouds.
  Scene coordinates are flat: a path of length s within the scene misses the Earth's curvature by s²/2R, 8 m at 10 km.
  Directions below the horizon have no sky. P of aerosols is coarse within 2° of the sun.
  Sun lower than 5°: light scattered more than once is approximate, and most of it in twilight.

Accuracy, measured (docs/VALIDATION.md)
  CDISORT, 40 plane-parallel problems, 20° or more from the beam   radiance, 16 streams   6e-4
  CDISORT, 15 columns of this model                               E_d and sky            0.06 %, 0.34 %
  SASKTRAN2, spherical shells, light scattered once               radiance               1 % to 85°, 2 % at 89°
  LOWTRAN 7, four profiles                                        gases, 5 nm means      0.003, 0.008 to air mass 9
  MODTRAN, windows, one flight                                    L_u, A + B, S          5 %, 1 %, 4 %
  Between rungs of the ladder: 0.1 to 0.7 % (root mean square), 3 % in black bands under a low sun. Between the directions of
  the sky: 1.5 % beyond 20° from the sun (3 % at a sun of 85°), 13 % within 5° of it.

Cost (docs/BENCHMARKS.md): a third to half of a second for one time in four bands from 0.42 to 1.0 µm, less than three times as much
for a day of thirty, on one core.

In a scene
  atmosphere layered
  atmosphere layered { streams 32, spectrum full }
  weather { profile midlatitude_summer, aod 0.15, aerosol rural, water 2.1 g/cm2, ozone 320 DU,
            cloud { optical_depth 0.3, base 8 km, top 9 km } }
";

/// The layered column.
pub const MODEL: Model<dyn Atmosphere> = Model {
    info: ModelInfo {
        name: "layered",
        summary: "a layered, spherical column with multiple scattering solved",
        manual: MANUAL,
        params: &[
            Param::count("streams", &["auto"], Default::Word("auto"), "directions of the discrete-ordinate solution")
                .within(4.0, 64.0),
            Param::word("geometry", &["spherical", "plane"], Default::Word("spherical"), "shape of the Earth"),
            Param::quantity(
                "accuracy",
                Dimension::Fraction,
                Default::Number(1e-3),
                "azimuthal orders that change the source by less are left out",
            )
            .within(1e-9, 0.1),
            Param::word("spectrum", &["adapted", "full"], Default::Word("adapted"), "where radiances are solved"),
        ],
    },
    bind: |args: &Args, _grid: &SpectralGrid| -> Result<Arc<dyn Atmosphere>, BindError> {
        Ok(Arc::new(Layered {
            settings: Settings {
                streams: args.count("streams").map_or(AUTOMATIC, streams),
                spherical: args.word("geometry") != Some("plane"),
                accuracy: args.number("accuracy").unwrap_or(1e-3),
            },
            full: args.word("spectrum") == Some("full"),
        }))
    },
};

/// Streams where none are asked for.
const AUTOMATIC: usize = 16;

struct Layered {
    settings: Settings,
    /// Whether radiances are solved at every entry.
    full: bool,
}

impl Atmosphere for Layered {
    fn g_weights(&self, bin: &Bin) -> Vec<f64> {
        gas::g_weights(bin)
    }

    fn uses(&self) -> &'static [&'static str] {
        &[
            "profile",
            "radiosonde",
            "observations",
            "visibility",
            "aod",
            "aerosol",
            "pressure",
            "temperature",
            "humidity",
            "water",
            "ozone",
            "no2",
            "cloud",
        ]
    }

    fn has_directional_sky(&self) -> bool {
        true
    }

    fn sky_bytes(&self, grid: &SpectralGrid, needs: &Needs) -> usize {
        column_sky::sky_bytes(grid.len(), self.full, needs)
    }

    fn check(
        &self,
        column: &Column,
        _: &[Sun],
        grid: &SpectralGrid,
        _: &Needs,
    ) -> Result<Vec<String>, AtmosphereError> {
        coverage::check("the TSIS-1 solar spectrum", HSRS.domain(), grid)?;
        coverage::albedos(std::slice::from_ref(&column.ground_albedo), grid)?;
        let site = Site::new(column)?;
        site.check(grid)?;
        Ok(site.notes().to_vec())
    }

    fn solve(
        &self,
        column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        needs: &Needs,
    ) -> Result<Vec<Box<dyn SkyState>>, AtmosphereError> {
        let albedos = std::slice::from_ref(&column.ground_albedo);
        Ok(self.solve_over(albedos, column, suns, grid, needs)?.remove(0))
    }

    fn solve_over(
        &self,
        albedos: &[Vec<f64>],
        column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        needs: &Needs,
    ) -> Result<Vec<Vec<Box<dyn SkyState>>>, AtmosphereError> {
        coverage::check("the TSIS-1 solar spectrum", HSRS.domain(), grid)?;
        coverage::albedos(albedos, grid)?;
        let site = Site::new(column)?;
        let (full, own, own_grid) = (self.full, site.clone(), grid.clone());
        let air = ColumnAir {
            strata: site.strata(),
            media: site.media(grid)?,
            ladder: Box::new(move |media| {
                let ladder = Ladder::new(&own, &own_grid);
                if full { Ladder::of_every(media, ladder.reference) } else { ladder }
            }),
            solar: HSRS.on(grid),
            albedos: albedos.to_vec(),
            notes: site.notes().to_vec(),
        };
        Ok(column_sky::solve(air, suns, needs, &self.settings))
    }
}
