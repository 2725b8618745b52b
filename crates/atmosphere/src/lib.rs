//! Atmospheres behind one trait, one provider a file, and the position of the sun.

mod aerosol;
mod cloud;
mod column;
mod column_sky;
mod coverage;
mod embedded;
mod gas;
mod haze;
mod interpolation;
mod kdistribution;
mod ladder;
mod layered;
mod layers;
mod measured;
mod medium;
mod none;
mod phase;
mod profile;
mod radiance;
mod ray;
mod rayleigh;
mod sightline;
mod sky;
mod sky_shape;
mod solver;
mod sounding;
mod spectrl2;
mod strata;
mod sun;
mod table;
#[cfg(test)]
mod validation;
mod vertical;
mod wide;

pub use aerosol::{AEROSOLS, Aerosol, AerosolOptics};
pub use column::{Cloud, Column, Sun};
pub use profile::{Level, Profile};
pub use sky::{Needs, Path, SkyState};
pub use sounding::{Grafted, Moisture, SoundingLevel, graft};
pub use spectrl2::{Spectrl2Aerosol, Spectrl2Inputs, Spectrl2Point, relative_air_mass, spectrl2_at_table};
pub use sun::{Daylight, Place, SunError, SunEvents, SunPosition, sun_position, sunrise_sunset};

use sunglint_plugin::Model;
use sunglint_radiometry::{Bin, SpectralGrid};

/// The atmospheres this build knows.
pub const BUILTIN: &[Model<dyn Atmosphere>] =
    &[none::MODEL, table::MODEL, spectrl2::MODEL, measured::MODEL, layered::MODEL, layers::MODEL];

/// Why a provider gives no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct AtmosphereError {
    /// Diagnostic code of `docs/LANGUAGE.md`, `A01`…`A03` or `M04` (a table that does not cover a band).
    pub code: &'static str,
    /// What is wrong.
    pub message: String,
}

/// A provider of E_s, τ₁, τ₂, L_d and L_u.
pub trait Atmosphere: Send + Sync {
    /// Weights of the absorption quadrature points g that the provider wants in a bin; they sum to 1.
    fn g_weights(&self, bin: &Bin) -> Vec<f64> {
        let _ = bin;
        vec![1.0]
    }

    /// Wavelengths \[µm\] where the provider's own tables have corners, so that bin edges can fall on them.
    fn nodes(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Names of the fields of the weather block that the provider uses (`visibility`, `aod`, `pressure`, …).
    fn uses(&self) -> &'static [&'static str];

    /// Whether `sky_weights` depends on direction, so that an algorithm may ask for a directional sky.
    fn has_directional_sky(&self) -> bool;

    /// Lines for the plan and the manifest: what the provider estimates, how well, and what it approximates.
    fn report(&self) -> Vec<String> {
        Vec::new()
    }

    /// About how many bytes one solved sky keeps.
    fn sky_bytes(&self, grid: &SpectralGrid, needs: &Needs) -> usize {
        let _ = needs;
        64 * grid.len()
    }

    /// Finds all that [`Atmosphere::solve`] would refuse: what passes here is solved later without fail. Gives the notes of the
    /// skies, each once. A provider whose solution takes time says so without it.
    ///
    /// # Errors
    /// Those of `solve`.
    fn check(
        &self,
        column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        needs: &Needs,
    ) -> Result<Vec<String>, AtmosphereError> {
        /// Skies that are there at a time.
        const AT_ONCE: usize = 64;
        let mut notes = Vec::new();
        for suns in suns.chunks(AT_ONCE) {
            for note in self.solve(column, suns, grid, needs)?.iter().flat_map(|sky| sky.notes()) {
                if !notes.contains(&note) {
                    notes.push(note);
                }
            }
        }
        Ok(notes)
    }

    /// Solves one column for many suns at once, since most of the work does not depend on the sun; the answers are in
    /// the order of `suns`. A provider computes no more than `needs` says.
    fn solve(
        &self,
        column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        needs: &Needs,
    ) -> Result<Vec<Box<dyn SkyState>>, AtmosphereError>;

    /// The same over several grounds, whose albedos stand in place of the column's: the skies by ground and sun. Most of the
    /// work does not depend on the ground either.
    ///
    /// # Errors
    /// Those of `solve`.
    fn solve_over(
        &self,
        albedos: &[Vec<f64>],
        column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        needs: &Needs,
    ) -> Result<Vec<Vec<Box<dyn SkyState>>>, AtmosphereError> {
        let over = |albedo: &Vec<f64>| {
            let column = Column { ground_albedo: albedo.clone(), ..column.clone() };
            self.solve(&column, suns, grid, needs)
        };
        albedos.iter().map(over).collect()
    }
}
