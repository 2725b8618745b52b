//! Every term of one pixel.

use serde_json::{Map, Value, json};
use sunglint_geometry::{FacetId, Hit, Ray};
use sunglint_radiometry::{STUDENT_T_95, WorldDir};
use sunglint_tracer::{Accuracy, Illumination, PixelTerms, Term, View, render_pixel_terms};

use crate::plan::Run;

/// What one pixel of one frame is made of.
pub struct Explanation {
    /// Label of the frame.
    pub frame: String,
    /// The pixel.
    pub pixel: (u32, u32),
    /// What its middle meets.
    pub hit: Option<ExplainedHit>,
    /// One entry a band.
    pub bands: Vec<ExplainedBand>,
    /// Samples taken.
    pub samples: u32,
}

/// What the middle of a pixel meets.
pub struct ExplainedHit {
    /// Material code.
    pub code: u16,
    /// Name of the material.
    pub material: String,
    /// Name of the object.
    pub object: String,
    /// The hit.
    pub hit: Hit,
    /// View zenith angle, target to sensor \[deg\].
    pub view_zenith_deg: f64,
}

/// The terms of one band.
pub struct ExplainedBand {
    /// Name of the band.
    pub name: String,
    /// Radiance at the sensor \[W m⁻² sr⁻¹ µm⁻¹\].
    pub radiance: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Quantities and parts by name: first those of the conventions, then the parts that add up to the radiance.
    pub terms: Vec<(&'static str, f64)>,
}

/// Samples of a pixel under `time`, whose image takes as many as fit.
const TIMED_SAMPLES: u32 = 256;

/// Explains a pixel at one of the run's times. The samples are those of the image, but for a run under `time`: 256.
pub fn explain(run: &Run, pixel: (u32, u32), time: usize, materials: &[String]) -> Explanation {
    let accuracy = if run.budget.is_some() { Accuracy::Samples(TIMED_SAMPLES) } else { run.accuracy };
    let lit = run.lit_about(time);
    let terms = lit.with_view(|view| {
        render_pixel_terms(&View { accuracy, worth: lit.worth(accuracy), ..*view }, pixel, time - lit.times.start)
    });
    let middle = run.camera.ray(f64::from(pixel.0) + 0.5, f64::from(pixel.1) + 0.5);
    let sight = Ray::new(middle.origin, middle.direction);
    let hit = run.scenery.world.closest(&sight);
    let light = lit.light(time);
    let of_band = |c: usize| band(run, light, &terms, hit.as_ref(), -middle.direction, c);
    let bands = (0..run.channels.len()).map(of_band).collect();
    let hit = hit.map(|hit| ExplainedHit {
        code: run.scenery.surface(hit.material).code,
        material: materials.get(hit.material.0 as usize).cloned().unwrap_or_default(),
        object: object_name(run, hit.instance),
        view_zenith_deg: (-middle.direction).zenith().to_degrees(),
        hit,
    });
    Explanation { frame: run.moments[time].label.clone(), pixel, hit, bands, samples: terms.samples }
}

fn object_name(run: &Run, id: u32) -> String {
    run.objects.iter().find_map(|objects| objects.name_of(id)).unwrap_or_else(|| "ground".to_string())
}

fn band(
    run: &Run,
    light: &Illumination,
    terms: &PixelTerms,
    hit: Option<&Hit>,
    outgoing: WorldDir,
    c: usize,
) -> ExplainedBand {
    let n = run.channels.len();
    let fold = |spectrum: &[f64]| {
        let mut means = vec![0.0; n];
        run.channels.fold(spectrum, &mut means);
        means[c]
    };
    let e_s = light.sky.solar_irradiance();
    let solar = fold(e_s);
    // A band's transmittance is that of the light it is for: ⟨E_s τ⟩ / ⟨E_s⟩.
    let transmittance = |tau: &[f64]| {
        let product: Vec<f64> = e_s.iter().zip(tau).map(|(e, t)| e * t).collect();
        if solar > 0.0 { fold(&product) / solar } else { fold(tau) }
    };
    let mut list = vec![
        ("solar_irradiance", solar),
        ("sun_transmittance", transmittance(light.sky.sun_transmittance())),
        ("mean_sky_radiance", fold(&light.mean_sky)),
    ];
    let (mut tau_2, mut l_u) = (vec![0.0; e_s.len()], vec![0.0; e_s.len()]);
    let mut path_transmittance = 0.0;
    for (sight, share) in &terms.sights {
        path_transmittance += share
            * match sight {
                Some(path) => {
                    light.sky.path(path, &mut tau_2, &mut l_u);
                    transmittance(&tau_2)
                }
                None => 1.0,
            };
    }
    list.push(("path_transmittance", path_transmittance));
    list.push(("path_radiance", terms.upwelled[c]));
    if let Some(hit) = hit {
        let split = &run.scenery.surface(hit.material).split;
        let theta = hit.normal.dot(outgoing.vec()).clamp(0.0, 1.0).acos();
        let of_nodes = |spectrum: &[f64]| run.nodes.mean(&run.traced, c, spectrum);
        let component = |table: &sunglint_reflectance::AngularSpectra| {
            let nodes = table.weights(theta);
            nodes.iter().map(|(node, weight)| weight * of_nodes(table.spectrum(*node))).sum::<f64>()
        };
        list.push(("sky_view_factor", terms.sky_view));
        list.push(("sun_visible", terms.lit));
        list.push(("diffuse", component(&split.diffuse)));
        list.push(("specular", component(&split.specular)));
        let (normal, out) = (hit.normal, outgoing.vec());
        let mirror = WorldDir::new(2.0 * normal.dot(out) * normal - out);
        let blocked = run.scenery.world.occluded(&hit.leave(mirror)) || mirror.cos_zenith() <= 0.0;
        list.push(("bounce_transmittance", if blocked { 0.0 } else { 1.0 }));
        let mut sky = vec![0.0; e_s.len()];
        light.sky.sky_radiance(mirror, &mut sky);
        list.push(("sky_radiance", fold(&sky)));
        if let Some(sun) = light.sun {
            list.push(("sun_incidence_deg", normal.dot(sun.vec()).clamp(-1.0, 1.0).acos().to_degrees()));
        }
        list.push(("surface_radiance", terms.surface[c].mean));
    }
    for term in Term::ALL {
        if let Some((_, values)) = terms.terms.iter().find(|(known, _)| *known == term) {
            list.push((term.name(), values[c]));
        }
    }
    let estimate = terms.radiance[c];
    ExplainedBand {
        name: run.channels.channels()[c].name.clone(),
        radiance: estimate.mean,
        standard_error: estimate.standard_error,
        terms: list,
    }
}

impl Explanation {
    /// As the JSON that other programs rely on.
    pub fn to_json(&self) -> Value {
        let bands: Vec<Value> = (self.bands.iter())
            .map(|band| {
                let terms: Map<String, Value> =
                    band.terms.iter().map(|(name, value)| ((*name).to_string(), json!(value))).collect();
                json!({
                    "name": band.name,
                    "radiance": band.radiance,
                    "standard_error": band.standard_error,
                    "terms": terms,
                })
            })
            .collect();
        let hit = self.hit.as_ref().map(|found| {
            let p = found.hit.point;
            json!({
                "material": found.material,
                "material_code": found.code,
                "object": found.object,
                "facet": facet(&found.hit),
                "x_m": p.x,
                "y_m": p.y,
                "z_m": p.z,
                "range_m": found.hit.t,
                "view_zenith_deg": found.view_zenith_deg,
                "tilt_deg": tilt(&found.hit).to_degrees(),
                "aspect_deg": aspect(&found.hit).to_degrees(),
            })
        });
        json!({
            "frame": self.frame,
            "pixel": [self.pixel.0, self.pixel.1],
            "samples": self.samples,
            "unit": "W m-2 sr-1 um-1",
            "bands": bands,
            "hit": hit,
        })
    }
}

/// Index of the facet that was met; the endless ground is none.
fn facet(hit: &Hit) -> Option<u32> {
    (hit.facet != FacetId::GROUND).then_some(hit.facet.0)
}

fn tilt(hit: &Hit) -> f64 {
    WorldDir::from_unit(hit.normal).zenith()
}

fn aspect(hit: &Hit) -> f64 {
    if tilt(hit).sin() < 1e-12 { 0.0 } else { WorldDir::from_unit(hit.normal).azimuth() }
}

impl std::fmt::Display for Explanation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "pixel {},{} at {}, {} samples", self.pixel.0, self.pixel.1, self.frame, self.samples)?;
        match &self.hit {
            Some(found) => {
                let p = found.hit.point;
                let facet = facet(&found.hit).map_or(String::new(), |facet| format!("facet {facet}, "));
                writeln!(
                    f,
                    "  meets {} (code {}) of {}, {facet}at ({:.3} {:.3} {:.3}) m, {:.3} m away",
                    found.material, found.code, found.object, p.x, p.y, p.z, found.hit.t
                )?;
                writeln!(
                    f,
                    "  facet tilt {:.2} deg, aspect {:.2} deg; view zenith {:.2} deg",
                    tilt(&found.hit).to_degrees(),
                    aspect(&found.hit).to_degrees(),
                    found.view_zenith_deg
                )?;
            }
            None => writeln!(f, "  meets nothing: the sky, or the black below a scene without ground")?,
        }
        let width =
            self.bands.iter().flat_map(|band| &band.terms).map(|(name, _)| name.len()).max().unwrap_or(0).max(16);
        write!(f, "  {:width$}", "W m-2 sr-1 um-1")?;
        self.bands.iter().try_for_each(|band| write!(f, " {:>12}", band.name))?;
        writeln!(f)?;
        write!(f, "  {:width$}", "radiance")?;
        self.bands.iter().try_for_each(|band| write!(f, " {:>12.5}", band.radiance))?;
        writeln!(f)?;
        write!(f, "  {:width$}", "± 95 %")?;
        self.bands.iter().try_for_each(|band| write!(f, " {:>12.5}", STUDENT_T_95 * band.standard_error))?;
        writeln!(f)?;
        let names: Vec<&str> =
            self.bands.first().map_or(Vec::new(), |band| band.terms.iter().map(|(name, _)| *name).collect());
        for name in names {
            write!(f, "  {name:width$}")?;
            for band in &self.bands {
                let value = band.terms.iter().find(|(known, _)| *known == name).map_or(0.0, |(_, value)| *value);
                write!(f, " {value:>12.5}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}
