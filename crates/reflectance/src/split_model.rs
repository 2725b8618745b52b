#![doc = include_str!("split_model.md")]

use std::f64::consts::TAU;
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Column, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, SpectralGrid};

use crate::grazing::{Grazing, Peak, Row, down_to_normal, excesses, to_horizon};
use crate::spectral::{ROUNDING, reflectance_on};
use crate::two_component::TwoComponent;
use crate::view_table::{Profile, VIEW_ZENITH, degrees, on_grid, profiles};
use crate::{AngularSpectra, Bsdf, Category, SOLAR_DISK, Split};

const COLUMNS: &[Column] = &[
    VIEW_ZENITH,
    Column { name: "diffuse", dimension: Dimension::Fraction, range: (0.0, 1.0) },
    Column { name: "specular", dimension: Dimension::Fraction, range: (0.0, f64::INFINITY) },
];

/// The split model.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "split",
        summary: "a diffuse component and a specular lobe against view angle, measured or by category",
        manual: include_str!("split_model.md"),
        params: &[
            Param::table("table", COLUMNS, Default::Absent, "R_d and R_s against view angle")
                .excludes(&["category", "total"]),
            Param::word("specular", &["brf", "reflectance"], Default::Word("brf"), "what the table's `specular` is")
                .excludes(&["category", "total"]),
            Param::word("grazing", &["fresnel", "hold"], Default::Word("fresnel"), "the lobe beyond the last row")
                .excludes(&["category", "total"]),
            Param::quantity(
                "solid_angle",
                Dimension::SolidAngle,
                Default::Number(SOLAR_DISK),
                "of the lobe, or of the instrument's aperture",
            )
            .within(0.0, TAU),
            Param::word("category", Category::NAMES, Default::Absent, "curves for an unmeasured material")
                .excludes(&["table", "specular", "grazing"]),
            Param::spectrum(
                "total",
                Dimension::Fraction,
                Default::Absent,
                "total reflectance of a category; else the material's",
            )
            .within(0.0, 1.0)
            .excludes(&["table", "specular", "grazing"]),
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let solid_angle = args.number("solid_angle").unwrap_or(SOLAR_DISK);
    if !(0.0..=TAU * (1.0 + ROUNDING)).contains(&solid_angle) {
        let message = format!("the lobe's solid angle lies between 0 and 2 pi sr, not {solid_angle}");
        return Err(BindError::new("U05", "solid_angle", message));
    }
    let split = match (args.table("table"), args.word("category")) {
        (Some(_), Some(_)) => return Err(BindError::of_block("S05", "`table` and `category` exclude each other")),
        (Some(_), None) => scaled(measured(args, solid_angle, grid)?, args, grid)?,
        (None, Some(category)) => by_category(category, args, solid_angle, grid)?,
        (None, None) => {
            return Err(BindError::of_block("S05", "`split` needs a `table` or a `category`")
                .help("for an unmeasured material: `split { category mostly_diffuse }`"));
        }
    };
    Ok(Arc::new(TwoComponent::new(split)))
}

/// A split taken over from another material, scaled to the material's own reflectance [Stark1993, sec. 4.3].
fn scaled(split: Split, args: &Args, grid: &SpectralGrid) -> Result<Split, BindError> {
    let (Some(true), Some(total)) = (args.switch("scaled"), args.spectral("reflectance")) else { return Ok(split) };
    let total = reflectance_on("reflectance", total, grid)?;
    Ok(split.scaled_to(&total).unwrap_or(split))
}

fn by_category(name: &str, args: &Args, solid_angle: f64, grid: &SpectralGrid) -> Result<Split, BindError> {
    let category = Category::find(name).ok_or_else(|| {
        let message = format!("no category is called `{name}`");
        BindError::new("N01", "category", message).help(format!("one of {}", Category::NAMES.join(", ")))
    })?;
    let total = match (args.spectral("total"), args.spectral("reflectance")) {
        (Some(total), _) => reflectance_on("total", total, grid)?,
        (None, Some(reflectance)) => reflectance_on("reflectance", reflectance, grid)?,
        (None, None) => {
            return Err(BindError::of_block("S05", "a category needs a total reflectance to scale to")
                .help("write `total 0.09`, or give the material a `reflectance`"));
        }
    };
    Ok(category.split(&total, solid_angle))
}

fn measured(args: &Args, solid_angle: f64, grid: &SpectralGrid) -> Result<Split, BindError> {
    let Some(table) = args.table("table") else {
        return Err(BindError::of_block("S05", "`split` needs a `table`"));
    };
    let brf = args.word("specular") != Some("reflectance");
    if brf && solid_angle < SOLAR_DISK * (1.0 - 1e-3) {
        let message = "a BRF peak is the mean over an aperture, never smaller than the sun's disk (68 usr)";
        return Err(BindError::new("U05", "solid_angle", message).help("or say `specular reflectance`"));
    }
    let grazing = if args.word("grazing") == Some("hold") { Grazing::Hold } else { Grazing::Fresnel };
    let peak = if brf { Peak::Brf(solid_angle) } else { Peak::Reflectance };
    let profiles: Vec<Profile> = (profiles("table", table, COLUMNS.len())?.into_iter())
        .map(|profile| components(profile, peak, grazing))
        .collect::<Result<_, _>>()?;
    let diffuse = on_grid("table", &profiles, DIFFUSE, grid)?;
    let specular = on_grid("table", &profiles, SPECULAR, grid)?;
    let printed = on_grid("table", &profiles, PRINTED, grid)?;
    let (diffuse, specular) = within_one(&diffuse, &specular);
    let solid_angle = vec![solid_angle; specular.angles().len()];
    Ok(Split { diffuse, specular, printed, solid_angle })
}

// Columns of a profile once its components are known.
const DIFFUSE: usize = 0;
const SPECULAR: usize = 1;
const PRINTED: usize = 2;

/// Turns rows (θ, R_d, R_s) into rows (θ, R_d, ρ_s, R_s) from 0 to 90° and holds them to the energy rules.
fn components(mut profile: Profile, peak: Peak, grazing: Grazing) -> Result<Profile, BindError> {
    let of = &profile.of;
    let mut rows = Vec::with_capacity(profile.rows.len());
    for (theta, values) in &profile.rows {
        let (theta, r_d, r_s) = (*theta, values[0], values[1]);
        let angle = degrees(theta);
        if !(0.0..=1.0 + ROUNDING).contains(&r_d) {
            let message = format!("the diffuse component lies between 0 and 1; at {angle} deg{of} it is {r_d}");
            return Err(BindError::new("M05", "table", message));
        }
        if r_s < 0.0 {
            let message = format!("the specular component is not negative; at {angle} deg{of} it is {r_s}");
            return Err(BindError::new("M05", "table", message));
        }
        rows.push(Row { theta, diffuse: r_d, specular: peak.reflectance(r_s, theta), printed: r_s });
    }
    down_to_normal(&mut rows);
    let known = rows.iter().filter(|row| peak.tells(row.theta)).count();
    if let Some(excess) = excesses(&rows).first() {
        let message = format!("returns more than it gets at {} deg{of}: {excess}", degrees(excess.theta));
        return Err(BindError::new("M05", "table", message)
            .help("`specular` may be a BRF with a smaller solid angle, or a reflectance"));
    }
    to_horizon(&mut rows, known, grazing, peak);
    profile.rows = rows.into_iter().map(|row| (row.theta, vec![row.diffuse, row.specular, row.printed])).collect();
    Ok(profile)
}

/// Takes off what a bin's straight line adds where it passes a table's own extremes: R_d + ρ_s ≤ 1 and
/// 2 ∫ R_d cos θ sin θ dθ + ρ_s ≤ 1 at every node and entry.
fn within_one(diffuse: &AngularSpectra, specular: &AngularSpectra) -> (AngularSpectra, AngularSpectra) {
    let angles = diffuse.angles().to_vec();
    let clamped = |of: &AngularSpectra, node: usize| -> Vec<f64> {
        of.spectrum(node).iter().map(|value| value.clamp(0.0, 1.0)).collect()
    };
    let r_d: Vec<Vec<f64>> = (0..angles.len()).map(|node| clamped(diffuse, node)).collect();
    let r_d = AngularSpectra::new(angles.clone(), r_d);
    let mean = r_d.hemispherical();
    let rho_s = (0..angles.len())
        .map(|node| {
            let mut rho_s = clamped(specular, node);
            for ((rho_s, r_d), mean) in rho_s.iter_mut().zip(r_d.spectrum(node)).zip(&mean) {
                *rho_s = rho_s.min((1.0 - r_d.max(*mean)).max(0.0));
            }
            rho_s
        })
        .collect();
    (r_d, AngularSpectra::new(angles, rho_s))
}
