//! Where the pixels of an overhead image lie on the map.

use sunglint_dsl::scene::{Crs, Site};
use sunglint_sensor::GroundMap;

/// The map projection of an image: a coordinate reference system, and how image coordinates become easting and northing.
#[derive(Clone, Debug, PartialEq)]
pub struct MapProjection {
    /// Easting and northing \[m\] from image coordinates (x across, y down, in pixels from the upper left corner):
    /// E = g₀ + g₁ x + g₂ y, N = g₃ + g₄ x + g₅ y, as GDAL orders them.
    pub geotransform: [f64; 6],
    /// Well-known text; `None` where the scene has no site: easting and northing are its x and y.
    pub wkt: Option<String>,
    /// ENVI's name of the projection, and of a UTM zone number and hemisphere.
    projection: (&'static str, Option<(u8, bool)>),
}

const WGS_84: &str = "GEOGCS[\"GCS_WGS_1984\",DATUM[\"D_WGS_1984\",SPHEROID[\"WGS_1984\",6378137.0,298.257223563]],\
                      PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]]";

/// Transverse Mercator on WGS 84, in the spelling of ENVI and Esri; angles in degrees.
fn transverse_mercator(name: &str, [east, north, meridian, scale, latitude]: [f64; 5]) -> String {
    format!(
        "PROJCS[\"{name}\",{WGS_84},PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"False_Easting\",{east:?}],\
         PARAMETER[\"False_Northing\",{north:?}],PARAMETER[\"Central_Meridian\",{meridian:?}],\
         PARAMETER[\"Scale_Factor\",{scale:?}],PARAMETER[\"Latitude_Of_Origin\",{latitude:?}],UNIT[\"Meter\",1.0]]"
    )
}

impl MapProjection {
    /// Of a part of the image whose upper left corner has the image coordinates x, y.
    #[must_use]
    pub fn of_window(mut self, x: u32, y: u32) -> Self {
        let g = &mut self.geotransform;
        let (x, y) = (f64::from(x), f64::from(y));
        g[0] += g[1] * x + g[2] * y;
        g[3] += g[4] * x + g[5] * y;
        self
    }

    /// Of an image that is a map of the level. With a `crs` x and y are its easting and northing; without one they are
    /// turned by the site's convergence into a transverse Mercator projection about the site, of scale 1.
    pub fn new(ground: &GroundMap, site: Option<&Site>, crs: Option<&Crs>) -> Self {
        // +y points to the azimuth of grid north.
        let (sin, cos) = match (crs, site) {
            (None, Some(site)) => site.convergence.sin_cos(),
            _ => (0.0, 1.0),
        };
        let turned = |v: glam::DVec2| (v.x * cos + v.y * sin, v.y * cos - v.x * sin);
        let [(e, n), (e_x, n_x), (e_y, n_y)] = [ground.corner, ground.across, ground.down].map(turned);
        let (wkt, projection) = match (crs, site) {
            (Some(Crs::Utm { zone, south }), _) => {
                let name = format!("WGS_1984_UTM_Zone_{zone}{}", if *south { 'S' } else { 'N' });
                let false_northing = if *south { 1e7 } else { 0.0 };
                let meridian = f64::from(*zone) * 6.0 - 183.0;
                let wkt = transverse_mercator(&name, [5e5, false_northing, meridian, 0.9996, 0.0]);
                (Some(wkt), ("UTM", Some((*zone, *south))))
            }
            (Some(Crs::Wkt(text)), _) => (Some(text.clone()), ("User Defined", None)),
            (None, Some(site)) => {
                let degrees = |angle: f64| angle.to_degrees();
                let origin = [0.0, 0.0, degrees(site.longitude), 1.0, degrees(site.latitude)];
                (Some(transverse_mercator("Local_Transverse_Mercator", origin)), ("Transverse Mercator", None))
            }
            (None, None) => (None, ("Arbitrary", None)),
        };
        Self { geotransform: [e, e_x, e_y, n, n_x, n_y], wkt, projection }
    }

    /// Width and height of a pixel \[m\].
    pub fn pixel_size(&self) -> (f64, f64) {
        let [_, e_x, e_y, _, n_x, n_y] = self.geotransform;
        (e_x.hypot(n_x), e_y.hypot(n_y))
    }

    /// Azimuth of the image's top, clockwise from the map's north \[deg\].
    pub fn rotation_deg(&self) -> f64 {
        let [_, e_x, _, _, n_x, _] = self.geotransform;
        let turned = (-n_x).atan2(e_x).to_degrees();
        if turned.abs() < 1e-12 { 0.0 } else { turned }
    }

    /// ENVI's `map info`: its reference is the upper left corner of the image, which it counts as pixel (1, 1), and its
    /// rotation turns the image counter-clockwise.
    pub fn envi_map_info(&self) -> String {
        let [e, _, _, n, _, _] = self.geotransform;
        let (width, height) = self.pixel_size();
        let (name, zone) = &self.projection;
        let place = match zone {
            Some((zone, south)) => format!("{zone}, {}, WGS-84, ", if *south { "South" } else { "North" }),
            None if *name == "Transverse Mercator" => "WGS-84, ".to_string(),
            None => String::new(),
        };
        let rotation = match self.rotation_deg() {
            0.0 => String::new(),
            turned => format!(", rotation={}", -turned),
        };
        format!("{{{name}, 1, 1, {e}, {n}, {width}, {height}, {place}units=Meters{rotation}}}")
    }

    /// As fields of an ENVI header. None where pixels are not square and the image is turned: readers differ in what a
    /// `rotation` then means (GDAL turns before it scales).
    pub fn envi_fields(&self) -> Vec<(&'static str, String)> {
        let (width, height) = self.pixel_size();
        let turned = f64::to_radians(self.rotation_deg()).sin().abs() > 1e-12;
        if turned && (width / height - 1.0).abs() > 1e-9 {
            return Vec::new();
        }
        let mut fields = vec![("map info", self.envi_map_info())];
        fields.extend(self.wkt.iter().map(|wkt| ("coordinate system string", format!("{{{wkt}}}"))));
        fields
    }

    /// As text attributes.
    pub fn attributes(&self) -> Vec<(&'static str, String)> {
        let numbers: Vec<String> = self.geotransform.iter().map(f64::to_string).collect();
        let mut attributes =
            vec![("sunglint:map_info", self.envi_map_info()), ("sunglint:geotransform", numbers.join(", "))];
        attributes.extend(self.wkt.iter().map(|wkt| ("sunglint:coordinate_system", wkt.clone())));
        attributes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};
    use sunglint_sensor::{Camera, Extent, FramePose, Orthographic};

    /// What GDAL makes of a `map info` whose reference is pixel (1, 1).
    fn read_back(info: &str) -> [f64; 6] {
        let parts: Vec<&str> = info.trim_matches(['{', '}']).split(", ").collect();
        let number = |i: usize| parts[i].parse::<f64>().unwrap();
        assert_eq!((number(1), number(2)), (1.0, 1.0));
        let rotation = parts.iter().find_map(|part| part.strip_prefix("rotation=")).map_or(0.0, |r| r.parse().unwrap());
        let (sin, cos) = f64::to_radians(rotation).sin_cos();
        let (width, height) = (number(5), number(6));
        [number(3), cos * width, sin * height, number(4), sin * width, -cos * height]
    }

    fn site(convergence: f64) -> Site {
        let span = sunglint_dsl::Span { file: sunglint_dsl::FileId(0), start: 0, end: 0 };
        Site { latitude: 0.75, longitude: -1.35, elevation: 0.0, convergence, span }
    }

    fn ground(heading: f64) -> GroundMap {
        let position = DVec3::new(3e5, 4.7e6, 900.0);
        let pose = FramePose::Attitude { position, heading, depression: std::f64::consts::FRAC_PI_2, roll: 0.0 };
        Orthographic::new(pose, Extent::GroundSample(0.5), (40, 30)).unwrap().ground(0.0).unwrap()
    }

    /// The header's numbers, read as GDAL reads them, put every corner where the camera sees it.
    #[test]
    fn a_header_says_where_the_corners_are() {
        for heading in [0.0f64, 30.0, 200.0, -135.0, 90.0] {
            let ground = ground(heading.to_radians());
            let map = MapProjection::new(&ground, Some(&site(0.0)), Some(&Crs::Utm { zone: 18, south: false }));
            let g = read_back(&map.envi_map_info());
            for (x, y) in [(0.0, 0.0), (40.0, 0.0), (0.0, 30.0), (40.0, 30.0), (7.5, 3.5)] {
                let at = DVec2::new(g[0] + g[1] * x + g[2] * y, g[3] + g[4] * x + g[5] * y);
                assert!((at - ground.at(x, y)).length() < 1e-8, "{heading} {x} {y}");
            }
            assert_eq!(map.envi_map_info().contains("rotation"), heading != 0.0);
            assert!(
                map.envi_map_info().starts_with("{UTM, 1, 1, ") && map.envi_map_info().contains(", 18, North, WGS-84")
            );
        }
    }

    /// Where grid north lies 10° east of true north, a point at grid (0, 1) has an easting of sin 10°.
    #[test]
    fn convergence_turns_the_local_map() {
        let ground = GroundMap { corner: DVec2::Y, across: DVec2::X, down: DVec2::NEG_Y };
        let map = MapProjection::new(&ground, Some(&site(10f64.to_radians())), None);
        let (sin, cos) = 10f64.to_radians().sin_cos();
        assert!((map.geotransform[0] - sin).abs() < 1e-15 && (map.geotransform[3] - cos).abs() < 1e-15);
        assert!((map.rotation_deg() - 10.0).abs() < 1e-12);
        let wkt = map.wkt.unwrap();
        assert!(wkt.contains("PARAMETER[\"Latitude_Of_Origin\",42.9718") && wkt.contains("\"Scale_Factor\",1.0]"));
        let plain = MapProjection::new(&ground, None, None);
        let oblong =
            |across: DVec2, down| MapProjection::new(&GroundMap { corner: DVec2::ZERO, across, down }, None, None);
        assert_eq!(oblong(DVec2::X, -2.0 * DVec2::Y).envi_fields().len(), 1);
        assert!(oblong(DVec2::new(0.6, 0.8), DVec2::new(1.6, -1.2)).envi_fields().is_empty());
        assert_eq!(
            (plain.wkt.as_ref(), plain.envi_map_info().as_str()),
            (None, "{Arbitrary, 1, 1, 0, 1, 1, 1, units=Meters}")
        );
        assert_eq!(plain.attributes().len(), 2);
    }
}
