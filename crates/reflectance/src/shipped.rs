//! Reflectance spectra and the database of materials that come with Sunglint; `data/README.md` has the source and
//! licence of each.

/// The text of a shipped file by its path after `sunglint:`: a spectrum (`reflectance/asphalt_road_old.csv`, columns
/// `wavelength_nm,reflectance`) or a material (`materials/asphalt_road_old.glint`).
pub fn shipped(name: &str) -> Option<&'static str> {
    if let Some(material) = name.strip_prefix("materials/").and_then(|name| name.strip_suffix(".glint")) {
        return shipped_materials().find(|(known, _)| *known == material).map(|(_, text)| text);
    }
    SHIPPED.iter().find(|shipped| shipped.spectrum.0 == name).map(|shipped| shipped.spectrum.1)
}

/// Paths of the spectra that [`shipped`] knows, in alphabetical order.
pub fn shipped_names() -> impl Iterator<Item = &'static str> {
    SHIPPED.iter().map(|shipped| shipped.spectrum.0)
}

/// The materials that come with Sunglint, each a name and a scene text of one `material NAME { … }`, in alphabetical
/// order. `material NAME` alone in a scene takes it.
pub fn shipped_materials() -> impl Iterator<Item = (&'static str, &'static str)> {
    SHIPPED.iter().map(|shipped| shipped.material)
}

struct Shipped {
    /// Path and CSV text.
    spectrum: (&'static str, &'static str),
    /// Name and scene text.
    material: (&'static str, &'static str),
}

macro_rules! shipped {
    ($($name:literal)*) => {
        &[$(Shipped {
            spectrum: (
                concat!("reflectance/", $name, ".csv"),
                include_str!(concat!("../data/reflectance/", $name, ".csv")),
            ),
            material: ($name, include_str!(concat!("../data/materials/", $name, ".glint"))),
        }),*]
    };
}

const SHIPPED: &[Shipped] = shipped! {
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

    /// Whoever uses a material can say what it is, from where, and under which licence.
    #[test]
    fn every_shipped_material_says_its_source_and_licence() {
        assert_eq!(shipped_materials().count(), 22);
        for (name, text) in shipped_materials() {
            assert_eq!(shipped(&format!("materials/{name}.glint")), Some(text));
            for said in ["title \"", "source \"", "licence \"", "ideal", &format!("material {name} {{")] {
                assert!(text.contains(said), "{name} lacks {said}");
            }
            assert!(text.contains(&format!("\"sunglint:reflectance/{name}.csv\"")), "{name}");
        }
    }
}
