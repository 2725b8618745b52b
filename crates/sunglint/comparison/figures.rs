//! Pictures of a comparison.

use super::BandComparison;
use crate::plot::{Axis, ColourMap, Image as Map, Picture, Plot, Series, Style};
use crate::products::Samples;

/// Panels side by side before a new row begins.
const COLUMNS: usize = 3;

fn axis(name: String, unit: Option<&String>) -> Axis {
    Axis::new(name, unit.map_or("", |unit| if unit == "1" { "" } else { unit }))
}

fn title(band: &BandComparison) -> String {
    if band.name_a == band.name_b { band.name_a.clone() } else { format!("{} and {}", band.name_a, band.name_b) }
}

/// Scatter of B over A, a panel a band, with the unity line and the least-squares line of B on A.
pub fn scatter_picture(bands: &[BandComparison]) -> Picture {
    let panels = (bands.iter())
        .map(|band| {
            let points: Vec<(f64, f64)> = band.points.iter().map(|(a, b)| (f64::from(*a), f64::from(*b))).collect();
            let ends = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (a, _)| (l.min(*a), h.max(*a)));
            let mut series = vec![Series::new("pixels", points, Style::Points)];
            let statistics = &band.statistics;
            if let (Some(slope), Some(offset)) = (statistics.slope, statistics.offset) {
                let fit = match statistics.r_squared {
                    Some(r_squared) => format!("{slope:.4} A {offset:+.4}, R² {r_squared:.4}"),
                    None => format!("{slope:.4} A {offset:+.4}"),
                };
                let line = [ends.0, ends.1].map(|a| (a, slope * a + offset)).to_vec();
                series.push(Series::new(fit, line, Style::Line));
            }
            Plot {
                title: title(band),
                x: axis("A".into(), band.units.0.as_ref()),
                y: axis("B".into(), band.units.1.as_ref()),
                series,
                square: true,
            }
            .with_unity_line()
            .picture()
        })
        .collect();
    Picture::grid(panels, COLUMNS)
}

/// B − A over the image, blue below and red above 0, a panel a band. The colours reach to the 99th percentile of
/// |B − A|, or to the largest where that is 0, so that one pixel does not hide the others.
pub fn difference_picture(bands: &[(&BandComparison, &Samples, &Samples)], width: u32) -> Picture {
    let panels = (bands.iter())
        .map(|(band, a, b)| difference_map(band, &format!("{}: B − A", title(band)), a, b, width).picture())
        .collect();
    Picture::grid(panels, COLUMNS)
}

fn difference_map(band: &BandComparison, title: &str, a: &Samples, b: &Samples, width: u32) -> Map {
    let statistics = &band.statistics;
    let largest = statistics.worst.map_or(0.0, |worst| (worst.b - worst.a).abs());
    let reach = if statistics.p99 > 0.0 { statistics.p99 } else { largest };
    let reach = if reach > 0.0 && reach.is_finite() { reach } else { 1.0 };
    Map {
        title: title.to_string(),
        width: width as usize,
        values: a.iter().zip(b.iter()).map(|(a, b)| b - a).collect(),
        value: axis("B − A".into(), band.units.0.as_ref()).within(-reach, reach),
        map: ColourMap::Difference,
    }
}

/// What a band was, what it is, and the difference, side by side; the first two share their colours.
pub fn before_after_picture(band: &BandComparison, before: &Samples, after: &Samples, width: u32) -> Picture {
    let values = || before.iter().chain(after.iter()).filter(|value| value.is_finite());
    let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let image = |title: String, samples: &Samples| {
        let value = axis("radiance".into(), band.units.0.as_ref());
        Map {
            title,
            width: width as usize,
            values: samples.iter().collect(),
            value: if low < high { value.within(low, high) } else { value },
            map: ColourMap::default(),
        }
        .picture()
    };
    let name = match band.name_a.rsplit_once('.') {
        Some((frame, band)) => format!("{band} at {frame}"),
        None => band.name_a.clone(),
    };
    let mut difference = difference_map(band, &format!("{name}, after − before"), before, after, width);
    difference.value.label = "after − before".into();
    let panels =
        vec![image(format!("{name}, before"), before), image(format!("{name}, after"), after), difference.picture()];
    Picture::grid(panels, COLUMNS)
}
