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
The air in layers, on a round Earth.
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

    fn solve(
        &self,
        column: &Column,
        suns: &[Sun],
        grid: &SpectralGrid,
        needs: &Needs,
    ) -> Result<Vec<Box<dyn SkyState>>, AtmosphereError> {
        coverage::check("the TSIS-1 solar spectrum", HSRS.domain(), grid)?;
        if column.ground_albedo.len() != grid.len() {
            let (found, due) = (column.ground_albedo.len(), grid.len());
            return Err(AtmosphereError {
                code: "M04",
                message: format!("the ground albedo has {found} values where the spectral grid has {due}"),
            });
        }
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
            albedo: column.ground_albedo.clone(),
            notes: site.notes().to_vec(),
        };
        Ok(column_sky::solve(air, suns, needs, &self.settings))
    }
}
