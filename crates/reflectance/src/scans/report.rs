//! What is missing in scans, and what does not belong there.

use std::fmt;

use super::{ScanBand, Scans, index_of};
use crate::view_table::degrees;

/// Gaps that are told by their places.
const MOST_PLACES: usize = 20;

/// A place in a matrix of scans.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// What the scan is taken in.
    pub band: ScanBand,
    /// Angle of illumination \[rad\].
    pub illumination: f64,
    /// View angle with its sign \[rad\].
    pub view: f64,
    /// The value, where there is one.
    pub brf: Option<f64>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "illumination {} deg, view {} deg{}",
            degrees(self.illumination),
            degrees(self.view),
            self.band.of()
        )?;
        self.brf.iter().try_for_each(|brf| write!(f, ": {brf}"))
    }
}

/// Places of the matrix without a value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gaps {
    /// How many.
    pub count: usize,
    /// The first of them.
    pub first: Vec<Place>,
}

/// What is missing in scans, and what does not belong there.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Bands, angles of illumination, view angles.
    pub size: [usize; 3],
    /// Values in the matrix.
    pub count: usize,
    /// Places without a value. A missing value against the light (v = +i) is none: most instruments block it.
    pub gaps: Gaps,
    /// Values at 90°, which cannot be measured: ignored.
    pub impossible: Vec<Place>,
    /// Values against the light (v = +i), where most instruments shade their sample: used.
    pub retro: Vec<Place>,
    /// Bands and angles of illumination without a value in the mirror direction (v = −i): no R_s there.
    pub no_specular: Vec<Place>,
    /// Values below 0 by less than their noise: used.
    pub negative: Vec<Place>,
    /// Solid angle of the aperture \[sr\].
    pub solid_angle: Option<f64>,
}

impl Scans {
    /// What is missing, and what does not belong there.
    pub fn report(&self) -> Report {
        let place = |band: usize, illumination: usize, view: f64, brf: Option<f64>| Place {
            band: self.bands[band].clone(),
            illumination: self.illuminations[illumination],
            view,
            brf,
        };
        let of = |keep: &dyn Fn(&super::Reading) -> bool| -> Vec<Place> {
            (self.readings.iter().filter(|reading| keep(reading)))
                .map(|r| place(r.band, r.illumination, self.views[r.view], Some(r.brf)))
                .collect()
        };
        let mut gaps = Gaps::default();
        let mut no_specular = Vec::new();
        for band in 0..self.bands.len() {
            let of_band = self.of_band(band);
            for (i, illumination) in self.illuminations.iter().enumerate() {
                let from = of_band.partition_point(|reading| reading.illumination < i);
                let to = of_band.partition_point(|reading| reading.illumination <= i);
                let scan = &of_band[from..to];
                if self.specular_view(i).and_then(|view| self.at(band, i, view)).is_none() {
                    no_specular.push(place(band, i, -illumination, None));
                }
                let retro = index_of(&self.views, *illumination);
                let blocked = retro.is_some_and(|view| self.at(band, i, view).is_none());
                let missing = self.views.len() - scan.len() - usize::from(blocked);
                gaps.count += missing;
                if missing == 0 || gaps.first.len() >= MOST_PLACES {
                    continue;
                }
                let mut present = scan.iter().map(|reading| reading.view).peekable();
                let absent = (0..self.views.len()).filter(|view| present.next_if_eq(view).is_none());
                let told = absent.filter(|view| retro != Some(*view)).take(MOST_PLACES - gaps.first.len());
                gaps.first.extend(told.map(|view| place(band, i, self.views[view], None)));
            }
        }
        Report {
            size: [self.bands.len(), self.illuminations.len(), self.views.len()],
            count: self.readings.len(),
            gaps,
            impossible: (self.impossible.iter())
                .map(|m| Place { band: m.band.clone(), illumination: m.illumination, view: m.view, brf: Some(m.brf) })
                .collect(),
            retro: of(&|reading| self.is_retro(reading) && !self.is_specular(reading)),
            no_specular,
            negative: of(&|reading| reading.brf < 0.0),
            solid_angle: self.solid_angle,
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [bands, illuminations, views] = self.size;
        let plural = |n: usize| if n == 1 { "" } else { "s" };
        writeln!(
            f,
            "{} values: {bands} band{}, {illuminations} illumination{}, {views} view{}",
            self.count,
            plural(bands),
            plural(illuminations),
            plural(views)
        )?;
        let lists = [
            ("gap", self.gaps.count, &self.gaps.first, "no value there"),
            ("no specular value", self.no_specular.len(), &self.no_specular, "v = -i is missing: no R_s at that angle"),
            ("impossible", self.impossible.len(), &self.impossible, "nothing is seen along the surface: ignored"),
            ("against the light", self.retro.len(), &self.retro, "v = +i, where instruments shade the sample: used"),
            ("negative", self.negative.len(), &self.negative, "below 0 by less than 5 standard errors: used"),
        ];
        for (what, count, places, why) in lists {
            if count == 0 {
                continue;
            }
            writeln!(f, "{what} ({why}):")?;
            places.iter().take(MOST_PLACES).try_for_each(|place| writeln!(f, "  {place}"))?;
            if count > places.len().min(MOST_PLACES) {
                writeln!(f, "  and {} more", count - places.len().min(MOST_PLACES))?;
            }
        }
        Ok(())
    }
}
