//! The state of the air over the site, and the sun.

use std::sync::Arc;

use sunglint_plugin::Args;
use sunglint_radiometry::WorldDir;

use crate::AtmosphereError;
use crate::profile::{NAMES, Profile};

/// A layer of cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cloud {
    /// Optical depth at 550 nm, vertically.
    pub optical_depth: f64,
    /// Height of its base above the site's elevation \[m\].
    pub base: f64,
    /// Height of its top above the site's elevation \[m\].
    pub top: f64,
}

/// The column that a provider solves: what the weather block says, and for the rest the named profile at the site's
/// elevation. `None` means that the scene says nothing and the provider takes the profile's value.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Named profile: `us_standard`, `tropical`, `midlatitude_summer`, …
    pub profile: String,
    /// Levels of a radiosonde grafted onto that profile, which they replace.
    pub sounding: Option<Arc<Profile>>,
    /// Layers of cloud, lowest first.
    pub clouds: Vec<Cloud>,
    /// Elevation of z = 0 above sea level \[m\].
    pub elevation: f64,
    /// Surface pressure \[hPa\].
    pub pressure: Option<f64>,
    /// Surface temperature \[K\].
    pub temperature: Option<f64>,
    /// Surface relative humidity, 0..1.
    pub humidity: Option<f64>,
    /// Column of precipitable water \[g cm⁻²\].
    pub water: Option<f64>,
    /// Column of ozone \[atm-cm\].
    pub ozone: Option<f64>,
    /// Column of nitrogen dioxide \[atm-cm\].
    pub no2: Option<f64>,
    /// Meteorological range \[m\] (Koschmieder, 2 % contrast).
    pub visibility: Option<f64>,
    /// Aerosol optical depth at 550 nm.
    pub aod: Option<f64>,
    /// Aerosol model and its arguments; `None` is `rural`.
    pub aerosol: Option<(String, Args)>,
    /// Albedo A of the ground that the atmosphere sees, one value per grid entry; 0 where `adjacency off`.
    pub ground_albedo: Vec<f64>,
}

impl Default for Column {
    /// The air of the profile `us_standard` over sea level and a black ground of no entries.
    fn default() -> Self {
        Self {
            profile: "us_standard".to_string(),
            sounding: None,
            clouds: Vec::new(),
            elevation: 0.0,
            pressure: None,
            temperature: None,
            humidity: None,
            water: None,
            ozone: None,
            no2: None,
            visibility: None,
            aod: None,
            aerosol: None,
            ground_albedo: Vec::new(),
        }
    }
}

impl Column {
    /// The levels of the air: the radiosonde's, or those of the named profile.
    ///
    /// # Errors
    /// `A01` where no profile has that name.
    pub fn levels(&self) -> Result<&Profile, AtmosphereError> {
        match &self.sounding {
            Some(sounding) => Ok(sounding),
            None => named(&self.profile),
        }
    }
}

/// The named profile.
pub(crate) fn named(name: &str) -> Result<&'static Profile, AtmosphereError> {
    Profile::named(name).ok_or_else(|| AtmosphereError {
        code: "A01",
        message: format!("no profile is named `{name}`; there are {}", NAMES.join(", ")),
    })
}

/// Where the sun is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Towards the refracted sun. Shadows, glint and τ₁ use this.
    pub apparent: WorldDir,
    /// Unrefracted zenith angle \[rad\].
    pub true_zenith: f64,
    /// Earth–Sun distance \[au\].
    pub distance: f64,
    /// Ordinal day of the year, 1 for the first of January; providers whose formulas take the day use it. 0 where the
    /// sun is given by angles.
    pub day_of_year: u16,
}
