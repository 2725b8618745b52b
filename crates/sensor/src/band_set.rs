//! Bands of known sensors, by name. `data/README.md` has the source and licence of each table.

use crate::Band;
use crate::response_file::rows;

/// Measured responses.
const MEASURED: [(&str, &str); 4] = [
    ("sentinel2a", include_str!("../data/srf_sentinel2a_msi.csv")),
    ("sentinel2b", include_str!("../data/srf_sentinel2b_msi.csv")),
    ("landsat8", include_str!("../data/srf_landsat8_oli.csv")),
    ("landsat9", include_str!("../data/srf_landsat9_oli.csv")),
];

/// Nominal edges: `sensor,band,lower_nm,upper_nm`.
const NOMINAL: &str = include_str!("../data/bands_nominal.csv");

/// The names that [`band_set`] knows.
pub fn band_sets() -> &'static [&'static str] {
    &["sentinel2a", "sentinel2b", "landsat8", "landsat9", "seed_1993", "worldview2_nominal"]
}

/// The bands of a sensor between 0.4 and 1.04 µm, in the order of its numbering.
pub fn band_set(name: &str) -> Option<Vec<Band>> {
    if let Some((_, text)) = MEASURED.iter().find(|(known, _)| *known == name) {
        let rows = rows(text).ok()?;
        // A band's rows stand together; noise below 0 is 0.
        return (rows.chunk_by(|a, b| a.band == b.band))
            .map(|rows| {
                let response: Vec<(f64, f64)> =
                    rows.iter().map(|row| (row.wavelength, row.response.max(0.0))).collect();
                Band::table(&rows[0].band, &response).ok()
            })
            .collect();
    }
    let cells = NOMINAL.lines().skip(1).map(|line| line.split(',').collect::<Vec<&str>>());
    let bands: Option<Vec<Band>> = cells
        .filter(|cells| cells[0] == name)
        .map(|cells| {
            let um = |text: &str| text.parse::<f64>().ok().map(|nm| nm / 1e3);
            Band::edges(cells[1], um(cells[2])?, um(cells[3])?).ok()
        })
        .collect();
    bands.filter(|bands| !bands.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels(set: &str) -> Vec<(String, f64, f64)> {
        let bands = band_set(set).unwrap();
        bands.iter().map(Band::channel).map(|c| (c.name, c.centre.nm(), c.fwhm * 1e3)).collect()
    }

    /// Central wavelengths and bandwidths as ESA publishes them with the responses (COPE-GSEG-EOPG-TN-15-0007 v3.0): one
    /// digit behind the point, and whole nanometres that its table rounds its own way.
    #[test]
    fn sentinel_2_bands_have_their_published_centres() {
        let a = [442.7, 492.4, 559.8, 664.6, 704.1, 740.5, 782.8, 832.8, 864.7, 945.1];
        let widths = [21.0, 66.0, 36.0, 31.0, 15.0, 15.0, 20.0, 106.0, 21.0, 20.0];
        let b = [442.2, 492.1, 559.0, 664.9, 703.8, 739.1, 779.7, 832.9, 864.0, 943.2];
        let names = ["B1", "B2", "B3", "B4", "B5", "B6", "B7", "B8", "B8A", "B9"];
        for ((name, centre, fwhm), ((expected, published), width)) in
            channels("sentinel2a").into_iter().zip(names.into_iter().zip(a).zip(widths))
        {
            assert!(name == expected && (centre - published).abs() < 0.1, "{name}: {centre}");
            assert!((fwhm - width).abs() < 2.0, "{name}: {fwhm}");
        }
        for ((name, centre, _), published) in channels("sentinel2b").into_iter().zip(b) {
            assert!((centre - published).abs() < 0.11, "{name}: {centre}");
        }
    }

    /// Half-maximum edges in whole nanometres, as the U.S. Geological Survey lists the bands of OLI.
    #[test]
    fn landsat_8_bands_have_their_published_widths() {
        let edges = [(435, 451), (452, 512), (533, 590), (636, 673), (851, 879), (503, 676)];
        for ((name, _, fwhm), (lower, upper)) in channels("landsat8").into_iter().zip(edges) {
            // Two rounded edges.
            assert!((fwhm - f64::from(upper - lower)).abs() <= 1.0, "{name}: {fwhm}");
        }
        for ((name, eight, _), (_, nine, _)) in channels("landsat8").into_iter().zip(channels("landsat9")) {
            assert!((eight - nine).abs() < 2.5, "{name}: the two were built to one specification");
        }
    }

    #[test]
    fn every_listed_set_has_bands_with_names_of_their_own() {
        for set in band_sets() {
            let mut names: Vec<String> = band_set(set).unwrap().into_iter().map(|band| band.name).collect();
            let n = names.len();
            names.sort();
            names.dedup();
            assert!(n >= 4 && names.len() == n, "{set}");
        }
        assert!(band_set("landsat").is_none() && band_set("sensor").is_none());
        assert_eq!(band_set("seed_1993").unwrap()[3].support(), (0.74, 1.0));
    }
}
