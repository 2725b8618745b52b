//! Reflectance spectra that come with Sunglint; `data/reflectance/README.md` has the source and licence of each.

/// The CSV text (`wavelength_nm,reflectance`) of a shipped spectrum, by its path after `sunglint:`
/// (`reflectance/asphalt_road_old.csv`).
pub fn shipped(name: &str) -> Option<&'static str> {
    SPECTRA.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Names that [`shipped`] knows, in alphabetical order.
pub fn shipped_names() -> impl Iterator<Item = &'static str> {
    SPECTRA.iter().map(|(name, _)| *name)
}

macro_rules! spectra {
    ($($name:literal)*) => {
        &[$((concat!("reflectance/", $name, ".csv"), include_str!(concat!("../data/reflectance/", $name, ".csv")))),*]
    };
}

const SPECTRA: &[(&str, &str)] = spectra! {
    "asphalt_road_old"
    "brick_dark_red"
    "concrete_light_grey"
    "grass_dry_golden"
    "leaf_maple"
    "needles_pine"
    "needles_spruce"
    "painted_aluminium_light"
    "panel_pvc_black"
    "panel_pvc_grey"
    "panel_pvc_red"
    "panel_pvc_white"
    "panel_spectralon_06"
    "panel_spectralon_50"
    "panel_spectralon_90"
    "rangeland_30shrub_24grass"
    "roof_shingle_dark_grey"
    "snow_melting"
    "soil_dry_playa_mud"
    "water_turbid_high"
    "water_turbid_low"
    "wood_pine_new"
};

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_radiometry::Curve;

    #[test]
    fn every_shipped_spectrum_is_a_reflectance_over_the_visible() {
        assert_eq!(shipped_names().count(), 22);
        for name in shipped_names() {
            let mut lines = shipped(name).unwrap().lines();
            assert!(lines.next().unwrap().starts_with("wavelength_nm,reflectance"), "{name}");
            let rows: Vec<(f64, f64)> = lines
                .map(|line| {
                    let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
                    (cells[0] * 1e-3, cells[1])
                })
                .collect();
            let curve = Curve::linear(&rows).unwrap();
            assert!(curve.covers(0.4, 1.0), "{name}");
            assert!(curve.range().0 >= 0.0 && curve.range().1 <= 1.0, "{name}: {:?}", curve.range());
        }
        assert_eq!(shipped("reflectance/nowhere.csv"), None);
    }
}
