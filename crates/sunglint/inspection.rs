//! One quantity at a time, as numbers and as pictures: what the air does at a time, what a surface returns from one
//! direction into another, which materials there are.

mod air;
mod charts;
mod database;
mod goniometry;
mod loss;
mod specimen;

pub use air::{Air, AirBand, AirPath, AirSpectrum, air, air_plan, air_plan_of, sky_picture};
pub use charts::{
    air_chart, albedo_chart, brdf_chart, brdf_map, compared_chart, component_chart, material_chart, spectrum_chart,
};
pub use database::{MaterialEntry, database, materials_of};
pub use goniometry::{fit_chart, profile_chart, scan, split_chart};
pub use loss::{Compared, Loss, Side, WorstGeometry, compared};
pub use specimen::{Specimen, Surface};

use sunglint_dsl::nearest;

use crate::plan::Run;
use crate::{Refused, iso, parse_utc};

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum InspectionError {
    /// The scene does not hold, or its model does not bind.
    #[error(transparent)]
    Refused(Box<Refused>),
    /// A name or number that was asked for is not there.
    #[error("{0}")]
    Input(String),
}

impl From<Refused> for InspectionError {
    fn from(refused: Refused) -> Self {
        Self::Refused(Box::new(refused))
    }
}

/// That there is no `what` called `name`, with the nearest name or the list.
pub fn unknown_name(what: &str, name: &str, known: &[&str]) -> String {
    let list = || match known {
        [] => "there is none".to_string(),
        some if some.len() <= 40 => format!("there are: {}", some.join(", ")),
        some => format!("there are {}", some.len()),
    };
    match nearest(name, known.iter().copied()) {
        Some(near) => format!("there is no {what} `{name}`; did you mean `{near}`?"),
        None => format!("there is no {what} `{name}`; {}", list()),
    }
}

/// Index of a run's time, by the frame's name or its instant; without either the one with the highest sun.
///
/// # Errors
/// What times there are.
pub fn time_of(run: &Run, at: Option<&str>) -> Result<usize, String> {
    let Some(at) = at else {
        let height = |i: &usize| run.moments[*i].sun.as_ref().map_or(-1.0, |sun| sun.apparent.cos_zenith());
        return Ok((0..run.moments.len()).max_by(|a, b| height(a).total_cmp(&height(b))).unwrap_or(0));
    };
    if let Some(i) = run.moments.iter().position(|moment| moment.label == at) {
        return Ok(i);
    }
    let utc = parse_utc(at)?;
    let same = |known: sunglint_dsl::scene::Utc| (known.0 - utc.0).abs() < 0.5;
    run.moments.iter().position(|moment| moment.utc.is_some_and(same)).ok_or_else(|| {
        let known: Vec<String> = run.moments.iter().map(|m| m.utc.map_or_else(|| m.label.clone(), iso)).collect();
        format!("no frame is collected at {at}; there are: {}", known.join(", "))
    })
}
