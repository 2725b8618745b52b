//! Run time against error.

use super::{Bench, Setting};
use crate::plot::{Axis, Picture, Plot, Series, Style};

/// Panels side by side before a new row begins.
const COLUMNS: usize = 2;
/// Bands of a sensor that have panels of their own, at most.
const MOST_BANDS: usize = 12;

impl Bench {
    /// RMSE over processor time, both logarithmic: a panel a sensor over all its bands, then one for each band. A series an
    /// experiment, the Pareto front, and as lines the noise of the references. What is not judged is left out.
    pub fn picture(&self) -> Picture {
        let mut panels = Vec::new();
        for sensor in self.sensors() {
            panels.push(self.panel(sensor, None).picture());
            let mut bands: Vec<&str> = Vec::new();
            for setting in self.settings.iter().filter(|setting| setting.sensor == sensor) {
                for band in setting.parts.iter().filter_map(|part| part.band.as_deref()) {
                    if !bands.contains(&band) {
                        bands.push(band);
                    }
                }
            }
            if (2..=MOST_BANDS).contains(&bands.len()) {
                panels.extend(bands.iter().map(|band| self.panel(sensor, Some(band)).picture()));
            }
        }
        Picture::grid(panels, COLUMNS)
    }

    fn panel(&self, sensor: &str, band: Option<&str>) -> Plot {
        let of: Vec<&Setting> =
            (self.settings.iter()).filter(|setting| setting.sensor == sensor && setting.change.is_none()).collect();
        let point = |setting: &Setting| -> Option<(f64, f64)> {
            let errors = setting.part(None, band, None)?.errors;
            errors.is_judged().then_some((setting.cpu_s, 100.0 * errors.rmse))
        };
        let mut experiments: Vec<&str> = of.iter().map(|setting| setting.experiment.as_str()).collect();
        experiments.dedup();
        let series: Vec<Series> = (experiments.iter())
            .map(|name| {
                let points =
                    of.iter().filter(|setting| setting.experiment == *name).filter_map(|setting| point(setting));
                Series::new(*name, points.collect(), Style::Marked)
            })
            .collect();
        let mut front: Vec<(f64, f64)> = of.iter().filter_map(|setting| point(setting)).collect();
        let on = super::front(&front);
        front = front.into_iter().zip(on).filter(|(_, on)| *on).map(|(point, _)| point).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut noise: Vec<(usize, f64)> = (of.iter())
            .filter_map(|setting| {
                Some((setting.reference, 100.0 * setting.part(None, band, None)?.errors.reference_error))
            })
            .collect();
        noise.sort_by_key(|(reference, _)| *reference);
        noise.dedup_by_key(|(reference, _)| *reference);
        let times = || of.iter().map(|setting| setting.cpu_s).filter(|time| *time > 0.0);
        let ends = (times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max));
        let mut lines: Vec<Series> = (noise.iter().filter(|(_, noise)| *noise > 0.0).enumerate())
            .map(|(i, (_, noise))| {
                let name = if i == 0 { "noise of the reference" } else { "" };
                Series::new(name, vec![(0.1 * ends.0, *noise), (10.0 * ends.1, *noise)], Style::Reference)
            })
            .collect();
        let heights = series.iter().flat_map(|s| &s.points).chain(lines.iter().flat_map(|s| &s.points)).map(|p| p.1);
        let (low, high) =
            heights.filter(|v| *v > 0.0).fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), v| (l.min(v), h.max(v)));
        let mut y = Axis::new("RMSE", "%").log();
        if low <= high {
            // Room for the lines, which do not widen an axis by themselves.
            let decade = |v: f64| 10f64.powf(v);
            y = y.within(decade((low.log10() - 0.1).floor()), decade((high.log10() + 0.1).ceil()));
        }
        lines.extend(series);
        lines.push(Series::new("Pareto front", front, Style::Dashed).coloured(6));
        let title = match band {
            Some(band) => format!("{sensor}, {band}"),
            None => format!("{sensor}, all bands"),
        };
        Plot { title, x: Axis::new("processor time", "s").log(), y, series: lines, square: false }
    }
}
