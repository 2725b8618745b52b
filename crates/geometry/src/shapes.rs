//! Boxes and panels as facets.

use crate::{Facet, MaterialId};
use glam::DVec3;

/// The six outward facets of a box of `size` (x, y, z) \[m\] that stands on the centre of its base at the origin:
/// west, east, south, north, bottom, top. A size of zero gives facets without area, which a mesh does not trace.
pub fn box_facets(material: MaterialId, size: DVec3) -> Vec<Facet> {
    let half = DVec3::new(0.5 * size.x, 0.5 * size.y, 0.5 * size.z);
    let centre = DVec3::new(0.0, 0.0, half.z);
    [DVec3::NEG_X, DVec3::X, DVec3::NEG_Y, DVec3::Y, DVec3::NEG_Z, DVec3::Z]
        .into_iter()
        .map(|normal| {
            let (right, up) = level_axes(normal);
            rectangle(
                material,
                centre + normal * half,
                right,
                up,
                2.0 * right.abs().dot(half),
                2.0 * up.abs().dot(half),
            )
        })
        .collect()
}

/// A rectangle `width` × `height` \[m\] about `centre`, its lower edge level, its front towards `facing` (any length;
/// zero counts as up). Facing straight up the lower edge is the southern one, facing straight down the northern.
pub fn panel_facets(material: MaterialId, width: f64, height: f64, facing: DVec3, centre: DVec3) -> Facet {
    let (right, up) = level_axes(facing.normalize_or(DVec3::Z));
    rectangle(material, centre, right, up, width, height)
}

/// The level axis to the right and the axis upwards, of a plane seen from its front. `right` × `up` = `normal`.
pub(crate) fn level_axes(normal: DVec3) -> (DVec3, DVec3) {
    let right = DVec3::new(-normal.y, normal.x, 0.0);
    let right = if right.length() < 1e-12 { DVec3::X } else { right.normalize() };
    (right, normal.cross(right))
}

fn rectangle(material: MaterialId, centre: DVec3, right: DVec3, up: DVec3, width: f64, height: f64) -> Facet {
    let (r, u) = (right * (0.5 * width), up * (0.5 * height));
    let corners = vec![centre - r - u, centre + r - u, centre + r + u, centre - r + u];
    Facet { corners, normal: right.cross(up), area: width * height, material }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outward normals, total area and volume (divergence theorem) of a 2 × 3 × 5 box on its base.
    #[test]
    fn a_box_is_closed_and_stands_on_its_base() {
        let faces = box_facets(MaterialId(0), DVec3::new(2.0, 3.0, 5.0));
        assert_eq!(faces.len(), 6);
        assert!((faces.iter().map(|f| f.area).sum::<f64>() - 62.0).abs() < 1e-12);
        let volume: f64 = faces.iter().map(|f| f.centre().dot(f.normal) * f.area / 3.0).sum();
        assert!((volume - 30.0).abs() < 1e-12);
        let corners = || faces.iter().flat_map(|f| &f.corners);
        assert!(corners().all(|c| c.z >= 0.0) && corners().any(|c| c.z == 5.0));
        for f in faces {
            let again = Facet::new(f.corners.clone(), f.material).unwrap();
            assert!((again.normal - f.normal).length() < 1e-15 && (again.area - f.area).abs() < 1e-12);
        }
    }

    #[test]
    fn a_panel_has_its_lower_edge_level_and_its_front_towards_the_sensor() {
        let sensor = DVec3::new(3.0, -40.0, 12.0);
        let panel = panel_facets(MaterialId(1), 2.0, 1.4, sensor, DVec3::new(0.0, 5.0, 0.7));
        assert!((panel.normal - sensor.normalize()).length() < 1e-15);
        assert!((panel.corners[0].z - panel.corners[1].z).abs() < 1e-15 && panel.corners[2].z > panel.corners[1].z);
        assert!((Facet::new(panel.corners.clone(), MaterialId(1)).unwrap().normal - panel.normal).length() < 1e-15);
        let flat = panel_facets(MaterialId(1), 2.0, 1.0, DVec3::Z, DVec3::ZERO);
        assert_eq!(flat.corners[0], DVec3::new(-1.0, -0.5, 0.0));
        assert_eq!(flat.corners[1], DVec3::new(1.0, -0.5, 0.0));
        let down = panel_facets(MaterialId(1), 2.0, 1.0, DVec3::NEG_Z, DVec3::ZERO);
        assert_eq!(down.normal, DVec3::NEG_Z);
    }
}
