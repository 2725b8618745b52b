//! Spectra and the database of materials that come with Sunglint; `data/README.md` has the source and licence of each.

/// The text of a shipped file by its path after `sunglint:`: a spectrum of reflectance
/// (`reflectance/asphalt_road_old.csv`, columns `wavelength_nm,reflectance`) or of the complex refractive index n + ik
/// (`optical_constants/aluminium.csv`, columns `wavelength_nm,n,k`), or a material
/// (`materials/asphalt_road_old.glint`).
pub fn shipped(path: &str) -> Option<&'static str> {
    let files = OPTICAL_CONSTANTS.iter().chain(REFLECTANCE).chain(MATERIALS);
    files.into_iter().find(|(known, _)| *known == path).map(|(_, text)| *text)
}

/// Paths of the spectra that [`shipped`] knows, in alphabetical order.
pub fn shipped_names() -> impl Iterator<Item = &'static str> {
    OPTICAL_CONSTANTS.iter().chain(REFLECTANCE).map(|(path, _)| *path)
}

/// The materials that come with Sunglint, each a name and a scene text of one `material NAME { … }`, in alphabetical
/// order. `material NAME` alone in a scene takes it.
pub fn shipped_materials() -> impl Iterator<Item = (&'static str, &'static str)> {
    MATERIALS.iter().map(|(path, text)| (&path["materials/".len()..path.len() - ".glint".len()], *text))
}

/// Files, each by its path below `data/`, with its text.
type Folder = &'static [(&'static str, &'static str)];

macro_rules! folder {
    ($folder:literal, $ending:literal: $($name:literal)*) => {
        &[$((
            concat!($folder, "/", $name, $ending),
            include_str!(concat!("../data/", $folder, "/", $name, $ending)),
        )),*]
    };
}

const OPTICAL_CONSTANTS: Folder = folder! { "optical_constants", ".csv":
    "aluminium"
    "chromium"
    "iron"
    "silicon"
    "water"
    "zinc"
};

const REFLECTANCE: Folder = folder! { "reflectance", ".csv":
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

const MATERIALS: Folder = folder! { "materials", ".glint":
    "aluminium_rough"
    "asphalt_road_old"
    "brick_dark_red"
    "chromium_plated"
    "concrete_light_grey"
    "grass_dry_golden"
    "iron_rough"
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
    "silicon_polished"
    "snow_melting"
    "soil_dry_playa_mud"
    "water_calm"
    "water_turbid_high"
    "water_turbid_low"
    "wood_pine_new"
    "zinc_galvanised"
};

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_radiometry::Curve;

    /// The columns of a spectrum against wavelength [µm].
    fn columns(path: &str, header: &str) -> Vec<Curve> {
        let (first, rows) = shipped(path).unwrap().split_once('\n').unwrap();
        assert!(first.starts_with(header), "{path}");
        let cells = |line: &str| -> Vec<f64> { line.split(',').map(|cell| cell.parse().unwrap()).collect() };
        let rows: Vec<Vec<f64>> = rows.lines().map(cells).collect();
        let column = |at| rows.iter().map(|row| (row[0] * 1e-3, row[at])).collect::<Vec<_>>();
        (1..=header.matches(',').count()).map(|at| Curve::linear(&column(at)).unwrap()).collect()
    }

    /// Reflectance of a smooth face along its normal, [(n−1)² + k²]/[(n+1)² + k²].
    fn normal_reflectance(name: &str, wavelength: f64) -> f64 {
        let nk = columns(&format!("optical_constants/{name}.csv"), "wavelength_nm,n,k");
        let [n, k] = [0, 1].map(|at| nk[at].at(wavelength));
        ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)
    }

    #[test]
    fn every_shipped_reflectance_covers_the_visible_and_is_a_fraction() {
        assert_eq!(REFLECTANCE.len(), 22);
        for (path, _) in REFLECTANCE {
            let curve = &columns(path, "wavelength_nm,reflectance")[0];
            assert!(curve.covers(0.4, 1.0), "{path}");
            assert!(curve.range().0 >= 0.0 && curve.range().1 <= 1.0, "{path}: {:?}", curve.range());
        }
        assert_eq!(shipped("reflectance/nowhere.csv"), None);
    }

    /// n > 0 and k ≥ 0 from one point below 340 nm to one beyond 1120 nm, each with its reference and licence.
    #[test]
    fn every_shipped_refractive_index_covers_the_visible_and_says_its_source() {
        let provenance = include_str!("../data/README.md");
        assert_eq!(OPTICAL_CONSTANTS.len(), 6);
        for (path, _) in OPTICAL_CONSTANTS {
            let nk = columns(path, "wavelength_nm,n,k");
            assert!(nk[0].covers(0.34, 1.12), "{path}");
            assert!(nk[0].range().0 > 0.0 && nk[1].range().0 >= 0.0, "{path}");
            let name = path.trim_start_matches("optical_constants/").trim_end_matches(".csv");
            let row = provenance.lines().find(|line| line.starts_with(&format!("| {name} |"))).expect(path);
            assert!(row.contains("doi:"), "{path}: {row}");
        }
        assert!(shipped_names().is_sorted());
    }

    /// At 0.55 µm clean aluminium returns nine tenths, silicon a third, water a fiftieth: no columns are swapped.
    #[test]
    fn the_refractive_indices_return_the_known_share_of_light_along_the_normal() {
        let known = [
            ("aluminium", 0.92, 0.01),
            ("chromium", 0.55, 0.02),
            ("iron", 0.51, 0.02),
            ("silicon", 0.37, 0.01),
            ("water", 0.0204, 0.0001),
            ("zinc", 0.87, 0.02),
        ];
        for (name, reflectance, tolerance) in known {
            let found = normal_reflectance(name, 0.55);
            assert!((found - reflectance).abs() <= tolerance, "{name}: {found}");
        }
    }

    /// Whoever uses a material can say what it is, from where, and under which licence; its data is there.
    #[test]
    fn every_shipped_material_says_its_source_and_licence() {
        assert_eq!(MATERIALS.len(), 28);
        for (name, text) in shipped_materials() {
            assert_eq!(shipped(&format!("materials/{name}.glint")), Some(text));
            for said in ["title \"", "source \"", "licence \"", "ideal", &format!("material {name} {{")] {
                assert!(text.contains(said), "{name} lacks {said}");
            }
            let data: Vec<&str> = text.split("\"sunglint:").skip(1).filter_map(|rest| rest.split('"').next()).collect();
            assert!(!data.is_empty(), "{name}");
            for path in data {
                assert!(shipped(path).is_some(), "{name}: {path}");
            }
        }
        assert!(shipped_materials().is_sorted());
    }

    /// Where a material of n and k also states a reflectance, for models without them, it is that of n and k along the
    /// normal, to half a percent: what straight lines between a dozen rows leave.
    #[test]
    fn the_reflectance_of_a_material_of_n_and_k_is_fresnels() {
        for (name, text) in shipped_materials() {
            let Some((_, rest)) = text.split_once("\"sunglint:optical_constants/") else { continue };
            let list = ["  reflectance [", "  specular ["].iter().find_map(|key| text.split_once(key));
            let Some((_, list)) = list else { continue };
            let cells = |line: &str| -> Option<(f64, f64)> {
                let (wavelength_nm, value) = line.trim().split_once(" nm ")?;
                Some((wavelength_nm.parse::<f64>().ok()? * 1e-3, value.parse().ok()?))
            };
            let rows: Vec<(f64, f64)> = list.lines().skip(1).map_while(cells).collect();
            let (curve, substance) = (Curve::linear(&rows).unwrap(), rest.split_once(".csv").unwrap().0);
            for step in 1..156 {
                let wavelength = 0.34 + 0.005 * f64::from(step);
                let (stated, due) = (curve.at(wavelength), normal_reflectance(substance, wavelength));
                assert!((stated - due).abs() < 0.005, "{name} at {wavelength} µm: {stated}, not {due}");
            }
        }
    }
}
