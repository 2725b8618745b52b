//! What the atmosphere of an experiment tells at one time: E_s, τ₁, E_d, L_d, τ₂ and L_u, as spectra and as band means.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt::Write as _;
use std::path::Path as FilePath;

use serde_json::{Value, json};
use sunglint_atmosphere::{Path, SkyState};
use sunglint_dsl::scene::{Times, Utc};
use sunglint_geometry::Ray;
use sunglint_radiometry::WorldDir;

use super::{InspectionError, unknown_name};
use crate::plan::{Options, Plan, Run};
use crate::plot::{Axis, ColourMap, Dome, DomeMark, Orientation, Picture, Projection};
use crate::{Checked, check, iso, parse_utc};

/// What the air does at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Air {
    /// The experiment.
    pub experiment: String,
    /// Name of its atmosphere.
    pub atmosphere: String,
    /// The sensor whose grid the spectra are on.
    pub sensor: String,
    /// Name of the frame.
    pub frame: String,
    /// The instant, if the scene gives one.
    pub utc: Option<Utc>,
    /// Towards the refracted sun; `None` without one.
    pub sun: Option<WorldDir>,
    /// Zenith angles and azimuths of the sky that were asked for \[rad\].
    pub directions: Vec<(f64, f64)>,
    /// Lines of sight, one a sensor.
    pub paths: Vec<AirPath>,
    /// Spectra, wavelengths ascending.
    pub spectrum: AirSpectrum,
    /// Response-weighted means, sensor by sensor.
    pub bands: Vec<AirBand>,
}

/// The line of sight of a sensor's middle pixel, from what it meets.
#[derive(Clone, Debug, PartialEq)]
pub struct AirPath {
    /// The sensor.
    pub sensor: String,
    /// The line.
    pub path: Path,
    /// Between the azimuths of sun and sensor, seen from the target, 0..π \[rad\]: 0 on the same side.
    pub relative_azimuth: Option<f64>,
}

/// Quantities against wavelength.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AirSpectrum {
    /// Wavelengths \[µm\].
    pub wavelength: Vec<f64>,
    /// E_s \[W m⁻² µm⁻¹\].
    pub solar_irradiance: Vec<f64>,
    /// τ₁.
    pub sun_transmittance: Vec<f64>,
    /// E_d on the level \[W m⁻² µm⁻¹\].
    pub diffuse_irradiance: Vec<f64>,
    /// L_d in each direction \[W m⁻² sr⁻¹ µm⁻¹\].
    pub sky: Vec<Vec<f64>>,
    /// τ₂ and L_u \[W m⁻² sr⁻¹ µm⁻¹\] of each line of sight.
    pub path: Vec<(Vec<f64>, Vec<f64>)>,
}

/// The same quantities as response-weighted means; transmittances are ⟨E_s τ⟩/⟨E_s⟩.
#[derive(Clone, Debug, PartialEq)]
pub struct AirBand {
    /// The sensor.
    pub sensor: String,
    /// The band.
    pub name: String,
    /// Mean wavelength \[µm\].
    pub centre: f64,
    /// ⟨E_s⟩.
    pub solar_irradiance: f64,
    /// τ₁.
    pub sun_transmittance: f64,
    /// ⟨E_d⟩.
    pub diffuse_irradiance: f64,
    /// ⟨L_d⟩ in each direction.
    pub sky: Vec<f64>,
    /// τ₂ and ⟨L_u⟩ of each line of sight.
    pub path: Vec<(f64, f64)>,
}

/// Reads the air of the runs of one experiment at a frame of that name; the first run gives the spectral grid. Runs
/// without that frame are left out, and so are lines of sight that meet neither the scene nor z = 0. Plan with
/// [`Options::whole_sky`](crate::Options), or the provider may not have solved what is asked here.
pub fn air(runs: &[&Run], frame: &str, directions: &[(f64, f64)]) -> Option<Air> {
    let timed: Vec<(&Run, usize)> = (runs.iter())
        .filter_map(|run| Some((*run, run.moments.iter().position(|moment| moment.label == frame)?)))
        .collect();
    let &(first, time) = timed.first()?;
    let moment = &first.moments[time];
    let sun = moment.sun.as_ref().map(|sun| sun.apparent);
    let paths: Vec<AirPath> = timed.iter().filter_map(|(run, _)| sightline(run, sun)).collect();
    let towards: Vec<WorldDir> = directions.iter().map(|(z, a)| WorldDir::from_zenith_azimuth(*z, *a)).collect();
    let skies: Vec<Entries> =
        timed.iter().map(|(run, time)| entries(run.light(*time).sky.as_ref(), &towards, &paths)).collect();
    Some(Air {
        experiment: first.experiment.clone(),
        atmosphere: first.atmosphere_name.clone(),
        sensor: first.sensor.clone(),
        frame: frame.to_string(),
        utc: moment.utc,
        sun,
        directions: directions.to_vec(),
        spectrum: spectrum(first, &skies[0]),
        bands: timed.iter().zip(&skies).flat_map(|((run, _), sky)| bands(run, sky)).collect(),
        paths,
    })
}

/// Plans a scene so that its air can be read: one experiment (the first where unsaid), the whole sky. An instant `at`
/// takes the place of the scene's times, be it among them or not; a frame's name leaves them.
///
/// # Errors
/// Those of the scene; an experiment that is not there; an instant where the scene has no site.
pub fn air_plan(scene: &FilePath, experiment: Option<&str>, at: Option<&str>) -> Result<Plan, InspectionError> {
    air_plan_of(check(scene), experiment, at)
}

/// [`air_plan`] of a scene that was checked.
///
/// # Errors
/// As [`air_plan`].
pub fn air_plan_of(checked: Checked, experiment: Option<&str>, at: Option<&str>) -> Result<Plan, InspectionError> {
    let mut checked = checked.sound()?;
    let mut experiments = Vec::new();
    if let Some(scene) = &mut checked.scene {
        let names: Vec<&str> = scene.experiments.iter().map(|known| known.name.as_str()).collect();
        let name = experiment.or(names.first().copied()).unwrap_or_default();
        if !names.contains(&name) {
            return Err(InspectionError::Input(unknown_name("experiment", name, &names)));
        }
        // A scene with one experiment is planned whole: then no field of its weather is without effect.
        if scene.runs().len() > 1 {
            experiments.push(name.to_string());
        }
        if let Some(utc) = at.and_then(|at| parse_utc(at).ok()) {
            if scene.site.is_none() {
                return Err(InspectionError::Input(
                    "the scene has no `site`, so an instant says nothing of the sun".into(),
                ));
            }
            scene.collects.iter_mut().for_each(|collect| collect.times = Times::At(vec![utc]));
        }
    }
    Ok(Plan::new(checked, &Options { experiments, whole_sky: true, ..Options::default() })?)
}

fn sightline(run: &Run, sun: Option<WorldDir>) -> Option<AirPath> {
    let (w, h) = run.pixels;
    let middle = run.camera.ray(0.5 * f64::from(w), 0.5 * f64::from(h));
    let towards_sensor = -middle.direction;
    let down = middle.direction.vec().z;
    let length = match run.scenery.world.closest(&Ray::new(middle.origin, middle.direction)) {
        Some(hit) => hit.t,
        None if down < 0.0 && middle.origin.z > 0.0 => -middle.origin.z / down,
        None => return None,
    };
    let target = middle.origin + length * middle.direction.vec();
    let between = |sun: WorldDir| {
        let turn = (sun.azimuth() - towards_sensor.azimuth()).rem_euclid(TAU);
        turn.min(TAU - turn)
    };
    Some(AirPath {
        sensor: run.sensor.clone(),
        path: Path { target_height: target.z, sensor_height: middle.origin.z, length, towards_sensor },
        relative_azimuth: sun.map(between),
    })
}

/// Everything per grid entry.
struct Entries {
    solar: Vec<f64>,
    sun_transmittance: Vec<f64>,
    diffuse: Vec<f64>,
    sky: Vec<Vec<f64>>,
    path: Vec<(Vec<f64>, Vec<f64>)>,
}

fn entries(sky: &dyn SkyState, towards: &[WorldDir], paths: &[AirPath]) -> Entries {
    let n = sky.solar_irradiance().len();
    Entries {
        solar: sky.solar_irradiance().to_vec(),
        sun_transmittance: sky.sun_transmittance().to_vec(),
        diffuse: sky.diffuse_irradiance().to_vec(),
        sky: towards
            .iter()
            .map(|direction| {
                let mut radiance = vec![0.0; n];
                sky.sky_radiance(*direction, &mut radiance);
                radiance
            })
            .collect(),
        path: paths
            .iter()
            .map(|sight| {
                let (mut transmittance, mut radiance) = (vec![0.0; n], vec![0.0; n]);
                sky.path(&sight.path, &mut transmittance, &mut radiance);
                (transmittance, radiance)
            })
            .collect(),
    }
}

fn spectrum(run: &Run, all: &Entries) -> AirSpectrum {
    // The absorption points g of one wavelength become their weighted mean.
    let mut nodes: Vec<(f64, Vec<(usize, f64)>)> = Vec::new();
    for (i, entry) in run.grid.entries().iter().enumerate() {
        let wavelength = entry.wavelength.um();
        match nodes.last_mut() {
            Some((known, members)) if *known == wavelength => members.push((i, entry.weight)),
            _ => nodes.push((wavelength, vec![(i, entry.weight)])),
        }
    }
    nodes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mean = |values: &[f64]| -> Vec<f64> {
        let of_node = |members: &[(usize, f64)]| {
            let (sum, weight) = members.iter().fold((0.0, 0.0), |(s, w), (i, g)| (s + g * values[*i], w + g));
            sum / weight
        };
        nodes.iter().map(|(_, members)| of_node(members)).collect()
    };
    AirSpectrum {
        wavelength: nodes.iter().map(|(wavelength, _)| *wavelength).collect(),
        solar_irradiance: mean(&all.solar),
        sun_transmittance: mean(&all.sun_transmittance),
        diffuse_irradiance: mean(&all.diffuse),
        sky: all.sky.iter().map(|radiance| mean(radiance)).collect(),
        path: all.path.iter().map(|(tau, radiance)| (mean(tau), mean(radiance))).collect(),
    }
}

fn bands(run: &Run, all: &Entries) -> Vec<AirBand> {
    let n = run.channels.len();
    let fold = |values: &[f64]| {
        let mut means = vec![0.0; n];
        run.channels.fold(values, &mut means);
        means
    };
    let solar = fold(&all.solar);
    let transmittance = |tau: &[f64]| -> Vec<f64> {
        let mut products = vec![0.0; n];
        run.channels.fold_product(&all.solar, tau, &mut products);
        let plain = fold(tau);
        (0..n).map(|c| if solar[c] > 0.0 { products[c] / solar[c] } else { plain[c] }).collect()
    };
    let (tau_1, diffuse) = (transmittance(&all.sun_transmittance), fold(&all.diffuse));
    let sky: Vec<Vec<f64>> = all.sky.iter().map(|radiance| fold(radiance)).collect();
    let path: Vec<_> = all.path.iter().map(|(tau, radiance)| (transmittance(tau), fold(radiance))).collect();
    (run.channels.channels().iter().enumerate())
        .map(|(c, channel)| AirBand {
            sensor: run.sensor.clone(),
            name: channel.name.clone(),
            centre: channel.centre.um(),
            solar_irradiance: solar[c],
            sun_transmittance: tau_1[c],
            diffuse_irradiance: diffuse[c],
            sky: sky.iter().map(|means| means[c]).collect(),
            path: path.iter().map(|(tau, radiance)| (tau[c], radiance[c])).collect(),
        })
        .collect()
}

impl Air {
    /// E_s τ₁ cos θ_s on the level for one E_s τ₁ \[W m⁻² µm⁻¹\].
    pub fn on_the_level(&self, beam: f64) -> f64 {
        self.sun.map_or(0.0, |sun| beam * sun.cos_zenith().max(0.0))
    }

    /// As the JSON that other programs rely on.
    pub fn to_json(&self) -> Value {
        let s = &self.spectrum;
        let mut value = quantities(self, |i| json!(s.sky[i]), |i| (json!(s.path[i].0), json!(s.path[i].1)));
        value["experiment"] = json!(self.experiment);
        value["atmosphere"] = json!(self.atmosphere);
        value["frame"] = json!(self.frame);
        value["time_utc"] = json!(self.utc.map(iso));
        value["sun_apparent_zenith_deg"] = json!(self.sun.map(|sun| sun.zenith().to_degrees()));
        value["sun_azimuth_deg"] = json!(self.sun.map(|sun| sun.azimuth().to_degrees()));
        value["wavelength_um"] = json!(s.wavelength);
        value["solar_irradiance_w_m2_um"] = json!(s.solar_irradiance);
        value["sun_transmittance"] = json!(s.sun_transmittance);
        value["diffuse_irradiance_w_m2_um"] = json!(s.diffuse_irradiance);
        let band = |band: &AirBand| {
            let mut value =
                quantities(self, |i| json!(band.sky[i]), |i| (json!(band.path[i].0), json!(band.path[i].1)));
            value["name"] = json!(band.name);
            value["sensor"] = json!(band.sensor);
            value["wavelength_um"] = json!(band.centre);
            value["solar_irradiance_w_m2_um"] = json!(band.solar_irradiance);
            value["sun_transmittance"] = json!(band.sun_transmittance);
            value["diffuse_irradiance_w_m2_um"] = json!(band.diffuse_irradiance);
            value
        };
        value["bands"] = self.bands.iter().map(band).collect();
        value
    }

    /// The spectra as CSV: a row a wavelength, headers that end in their unit.
    pub fn to_csv(&self) -> String {
        let s = &self.spectrum;
        let mut text =
            "wavelength_um,solar_irradiance_w_m2_um,sun_transmittance,diffuse_irradiance_w_m2_um".to_string();
        for (zenith, azimuth) in &self.directions {
            let (z, a) = (short(zenith.to_degrees()), short(azimuth.to_degrees()));
            let _ = write!(text, ",sky_radiance_zenith_{z}_azimuth_{a}_w_m2_sr_um");
        }
        for sight in &self.paths {
            let name = &sight.sensor;
            let _ = write!(text, ",path_transmittance_{name},path_radiance_{name}_w_m2_sr_um");
        }
        for i in 0..s.wavelength.len() {
            let _ = write!(
                text,
                "\n{},{},{},{}",
                s.wavelength[i], s.solar_irradiance[i], s.sun_transmittance[i], s.diffuse_irradiance[i]
            );
            s.sky.iter().for_each(|radiance| text.push_str(&format!(",{}", radiance[i])));
            s.path.iter().for_each(|(tau, radiance)| text.push_str(&format!(",{},{}", tau[i], radiance[i])));
        }
        text.push('\n');
        text
    }
}

/// A number with no more digits than it needs, to 10⁻⁶.
fn short(x: f64) -> String {
    let text = format!("{x:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

fn quantities(air: &Air, sky: impl Fn(usize) -> Value, path: impl Fn(usize) -> (Value, Value)) -> Value {
    let degrees = |x: f64| (x.to_degrees() * 1e9).round() / 1e9;
    let sky: Vec<Value> = (air.directions.iter().enumerate())
        .map(|(i, (zenith, azimuth))| {
            json!({"zenith_deg": degrees(*zenith), "azimuth_deg": degrees(*azimuth), "radiance_w_m2_sr_um": sky(i)})
        })
        .collect();
    let path: Vec<Value> = (air.paths.iter().enumerate())
        .map(|(i, sight)| {
            let (transmittance, radiance) = path(i);
            json!({
                "sensor": sight.sensor,
                "view_zenith_deg": sight.path.towards_sensor.zenith().to_degrees(),
                "relative_azimuth_deg": sight.relative_azimuth.map(f64::to_degrees),
                "range_m": sight.path.length,
                "target_height_m": sight.path.target_height,
                "sensor_height_m": sight.path.sensor_height,
                "transmittance": transmittance,
                "radiance_w_m2_sr_um": radiance,
            })
        })
        .collect();
    json!({"sky": sky, "path": path})
}

impl std::fmt::Display for Air {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} at {}, atmosphere {}", self.experiment, self.frame, self.atmosphere)?;
        match self.sun {
            Some(sun) => writeln!(
                f,
                "; sun at apparent zenith {:.3} deg, azimuth {:.3} deg",
                sun.zenith().to_degrees(),
                sun.azimuth().to_degrees()
            )?,
            None => writeln!(f, "; no sun")?,
        }
        for sight in &self.paths {
            let beside = sight
                .relative_azimuth
                .map_or(String::new(), |turn| format!(", relative azimuth {:.2} deg", turn.to_degrees()));
            let path = &sight.path;
            writeln!(
                f,
                "  sight of {}: {:.1} m long, view zenith {:.2} deg{beside}, from height {:.1} m up to {:.1} m",
                sight.sensor,
                path.length,
                path.towards_sensor.zenith().to_degrees(),
                path.target_height,
                path.sensor_height
            )?;
        }
        let wide = |text: fn(&AirBand) -> &str| self.bands.iter().map(|band| text(band).len()).max().unwrap_or(0);
        let (sensors, names) = (wide(|band| &band.sensor).max(6), wide(|band| &band.name).max(4));
        writeln!(
            f,
            "  E_s top of the atmosphere, E_b = E_s τ₁ cos θ_s and E_d on the level [W m⁻² µm⁻¹]; L_u [W m⁻² sr⁻¹ µm⁻¹]\n"
        )?;
        writeln!(
            f,
            "  {:sensors$} {:names$} {:>8} {:>10} {:>9} {:>10} {:>10} {:>9} {:>10}",
            "sensor", "band", "um", "E_s", "tau_1", "E_b", "E_d", "tau_2", "L_u"
        )?;
        for band in &self.bands {
            let own = self.paths.iter().position(|sight| sight.sensor == band.sensor);
            let (tau_2, radiance) = own.map_or((f64::NAN, f64::NAN), |i| band.path[i]);
            let or_dash = |x: f64, text: String| if x.is_nan() { "-".to_string() } else { text };
            writeln!(
                f,
                "  {:sensors$} {:names$} {:>8.4} {:>10.3} {:>9.5} {:>10.3} {:>10.3} {:>9} {:>10}",
                band.sensor,
                band.name,
                band.centre,
                band.solar_irradiance,
                band.sun_transmittance,
                self.on_the_level(band.solar_irradiance * band.sun_transmittance),
                band.diffuse_irradiance,
                or_dash(tau_2, format!("{tau_2:.5}")),
                or_dash(radiance, format!("{radiance:.4}")),
            )?;
        }
        if self.directions.is_empty() {
            return Ok(());
        }
        writeln!(f, "\n  sky radiance [W m⁻² sr⁻¹ µm⁻¹]")?;
        writeln!(
            f,
            "  {:sensors$} {:names$} {:>10} {:>11} {:>12}",
            "sensor", "band", "zenith_deg", "azimuth_deg", "L_d"
        )?;
        for band in &self.bands {
            for ((zenith, azimuth), radiance) in self.directions.iter().zip(&band.sky) {
                let (zenith, azimuth) = (zenith.to_degrees(), azimuth.to_degrees());
                writeln!(
                    f,
                    "  {:sensors$} {:names$} {zenith:>10.3} {azimuth:>11.3} {radiance:>12.4}",
                    band.sensor, band.name
                )?;
            }
        }
        Ok(())
    }
}

/// The sky of one channel of a run as seen from below: north up, east left, the sun marked.
pub fn sky_picture(run: &Run, time: usize, channel: usize, projection: Projection) -> Picture {
    let light = run.light(time);
    let n = run.channels.len();
    // One number a sky term is all that a band needs.
    let terms: Vec<f64> = (light.sky.sky_terms().iter())
        .map(|term| {
            let mut means = vec![0.0; n];
            run.channels.fold(term, &mut means);
            means[channel]
        })
        .collect();
    let field = |zenith: f64, azimuth: f64| {
        let mut weights = Vec::new();
        light.sky.sky_weights(WorldDir::from_zenith_azimuth(zenith, azimuth), &mut weights);
        weights.iter().map(|(k, s)| s * terms[*k as usize]).sum::<f64>()
    };
    let band = &run.channels.channels()[channel].name;
    let sun = run.moments[time].sun.as_ref().map(|sun| sun.apparent).filter(|sun| sun.zenith() < FRAC_PI_2);
    let marks: Vec<DomeMark> = (sun.iter())
        .map(|sun| DomeMark { zenith: sun.zenith(), azimuth: sun.azimuth(), label: "sun".into() })
        .collect();
    let layout = match projection {
        Projection::Equidistant => "equidistant",
        Projection::EqualArea => "equal-area",
    };
    // Beside a low sun the sky may be brighter than elsewhere by orders of magnitude: then its logarithm is shown.
    let samples: Vec<f64> = (0..2000)
        .map(|i| {
            let (u, golden) = ((f64::from(i) + 0.5) / 2000.0, PI * (3.0 - 5f64.sqrt()));
            field((1.0 - u).acos(), (f64::from(i) * golden).rem_euclid(TAU))
        })
        .collect();
    let peak = marks.iter().map(|mark| field(mark.zenith, mark.azimuth));
    let most = samples.iter().copied().chain(peak).fold(0.0, f64::max);
    let least = samples.iter().copied().fold(f64::INFINITY, f64::min);
    let axis = Axis::new("sky radiance L_{d}", "W m⁻² sr⁻¹ µm⁻¹");
    let value = if least > 0.0 && most > 20.0 * least { axis.within(least, most).log() } else { axis };
    Dome {
        title: format!(
            "Sky in band {band}, {}, {}, atmosphere {}",
            run.experiment, run.moments[time].label, run.atmosphere_name
        ),
        value,
        map: ColourMap::Viridis,
        projection,
        orientation: Orientation::FromBelow,
        compass: true,
        marks,
        note: format!("{layout}, as seen from below: north up, east left; without the sun’s disk"),
        field: &field,
    }
    .picture()
}
