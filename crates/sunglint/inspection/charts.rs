//! Pictures of what the air does and of what surfaces return.

use super::{Air, Compared, InspectionError, Specimen};
use crate::plot::{Axis, ColourMap, Dome, DomeMark, Orientation, Picture, Plot, Polar, Projection, Series, Style};

/// E_s, what of it reaches the level directly and diffusely, and what the paths add, against wavelength.
pub fn air_chart(air: &Air) -> Picture {
    let s = &air.spectrum;
    let line = |values: &[f64]| s.wavelength.iter().copied().zip(values.iter().copied()).collect::<Vec<_>>();
    let beam: Vec<f64> =
        s.solar_irradiance.iter().zip(&s.sun_transmittance).map(|(e, t)| air.on_the_level(e * t)).collect();
    // π L has the unit of E: what a white panel under that radiance would return.
    let times_pi = |values: &[f64]| values.iter().map(|l| std::f64::consts::PI * l).collect::<Vec<_>>();
    let mut series = vec![
        Series::new("E_{s}, top of the atmosphere", gapped(line(&s.solar_irradiance)), Style::Line).coloured(6),
        Series::new("E_{s} τ₁ cos θ_{s}, direct", gapped(line(&beam)), Style::Line).coloured(4),
        Series::new("E_{d}, diffuse", gapped(line(&s.diffuse_irradiance)), Style::Line).coloured(0),
    ];
    for (i, sight) in air.paths.iter().enumerate() {
        let name = format!("π L_{{u}}, path to {}", sight.sensor);
        series.push(Series::new(name, gapped(line(&times_pi(&s.path[i].1))), Style::Dashed).coloured(1 + i));
    }
    let sun = match air.sun {
        Some(sun) => format!("sun {:.1}° from the zenith", sun.zenith().to_degrees()),
        None => "no sun".to_string(),
    };
    Plot {
        title: format!("{}, {}, atmosphere {}, {sun}", air.experiment, air.frame, air.atmosphere),
        x: wavelength_axis(),
        y: Axis::new("irradiance on the level", "W m⁻² µm⁻¹"),
        series,
        square: false,
    }
    .picture()
}

/// Transmittances and the like are not drawn across wavelengths between bands.
fn gapped(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut out: Vec<(f64, f64)> = Vec::with_capacity(points.len());
    for point in points {
        if let Some(last) = out.last()
            && point.0 - last.0 > 0.012
        {
            out.push((f64::NAN, f64::NAN));
        }
        out.push(point);
    }
    out
}

fn wavelength_axis() -> Axis {
    Axis::new("wavelength λ", "µm")
}

/// Total reflectance of several materials against wavelength.
///
/// # Errors
/// Where a model does not bind.
pub fn material_chart(specimens: &[Specimen]) -> Result<Picture, InspectionError> {
    let series = (specimens.iter())
        .map(|specimen| Ok(Series::new(specimen.name(), specimen.total_reflectance()?, Style::Line)))
        .collect::<Result<Vec<_>, InspectionError>>()?;
    let title = match specimens {
        [one] => format!("Total reflectance of {}", one.title().unwrap_or(one.name())),
        _ => "Total reflectance".to_string(),
    };
    let y = Axis::new("reflectance ρ", "1");
    let most = series.iter().flat_map(|s| &s.points).map(|p| p.1).fold(0.0, f64::max);
    let y = if most > 0.0 { y.within(0.0, (most * 11.0).ceil() / 10.0) } else { y.within(0.0, 1.0) };
    Ok(Plot { title, x: wavelength_axis(), y, series, square: false }.picture())
}

fn titled(what: &str, specimen: &Specimen) -> String {
    format!("{what} of {}, model {}", specimen.name(), specimen.model())
}

fn at(wavelength: f64) -> String {
    format!("{wavelength} µm")
}

/// R_d, ρ_s and R_s as stated, against view angle, for each wavelength.
///
/// # Errors
/// Where the model does not bind.
pub fn component_chart(specimen: &Specimen, wavelengths: &[f64]) -> Result<Picture, InspectionError> {
    let surface = specimen.bind(wavelengths)?;
    let angles: Vec<f64> = (0..=178).map(|i| 0.5 * f64::from(i)).collect();
    type Of<'s> = &'s dyn Fn(f64) -> Vec<f64>;
    let (diffuse, specular, printed) =
        (|a: f64| surface.diffuse(a), |a: f64| surface.specular(a), |a: f64| surface.printed(a));
    let curves: [(&str, Of, Style); 3] = [
        ("R_{d}", &diffuse, Style::Line),
        ("ρ_{s}", &specular, Style::Dashed),
        ("R_{s} as stated", &printed, Style::Line),
    ];
    let mut series = Vec::new();
    for (i, wavelength) in wavelengths.iter().enumerate() {
        for (k, (name, of, style)) in curves.iter().enumerate() {
            let points: Vec<(f64, f64)> = angles.iter().map(|a| (*a, of(a.to_radians())[i])).collect();
            let same = |j: usize| angles.iter().zip(&points).all(|(a, p)| curves[j].1(a.to_radians())[i] == p.1);
            let absent = k > 0 && points.iter().all(|p| p.1 == 0.0);
            if absent || (k == 2 && same(1)) {
                continue; // no such lobe, or one that the scene states as ρ_s
            }
            let name = if wavelengths.len() > 1 { format!("{name}, {}", at(*wavelength)) } else { name.to_string() };
            let colour = if wavelengths.len() > 1 { 14 * k.saturating_sub(1) + i } else { k };
            series.push(Series::new(name, points, *style).coloured(colour));
        }
    }
    let only = if let [one] = wavelengths { format!(", {}", at(*one)) } else { String::new() };
    Ok(Plot {
        title: format!("{}{only}", titled("Components", specimen)),
        x: Axis::new("view zenith angle θ_{v}", "°").within(0.0, 90.0),
        y: Axis::new("reflectance", "1"),
        series,
        square: false,
    }
    .picture())
}

/// BRDF in the principal plane at one wavelength, for light from several zenith angles \[rad\].
///
/// # Errors
/// Where the model does not bind.
pub fn brdf_chart(specimen: &Specimen, wavelength: f64, incident: &[f64]) -> Result<Picture, InspectionError> {
    let surface = specimen.bind(&[wavelength])?;
    let series = (incident.iter())
        .map(|theta| {
            let degrees = theta.to_degrees();
            let point = |angle: f64| {
                let (view, turn) = if angle < 0.0 { (-angle, 0.0) } else { (angle, std::f64::consts::PI) };
                (angle, surface.brdf(*theta, view.to_radians(), turn)[0])
            };
            Series::new(
                format!("θ_{{i}} = {}°", trimmed(degrees)),
                // Narrow lobes are sampled at their peak and close about it.
                plane_angles(degrees).map(point).collect(),
                Style::Line,
            )
        })
        .collect();
    let mirror = if surface.has_mirror() { ", without its mirror lobe" } else { "" };
    Ok(Polar {
        title: format!("{}, principal plane, {}{mirror}", titled("BRDF", specimen), at(wavelength)),
        radius: Axis::new("BRDF f", "sr⁻¹"),
        sides: ("← backward, φ = 0°".into(), "forward, φ = 180° →".into()),
        series,
        arrows: incident.iter().filter(|_| incident.len() == 1).map(|t| (-t.to_degrees(), "light".into())).collect(),
    }
    .picture())
}

/// Two descriptions of a material in the principal plane at its first wavelength, for light from several zenith angles
/// \[rad\]; values below a thousandth of the greatest are drawn there.
pub fn compared_chart(material: &str, compared: &Compared, incident: &[f64]) -> Picture {
    let mut series = Vec::new();
    for (k, theta) in incident.iter().enumerate() {
        for (side, style) in compared.sides.iter().zip([Style::Dashed, Style::Line]) {
            let point = |angle: f64| {
                let (view, turn) = if angle < 0.0 { (-angle, 0.0) } else { (angle, std::f64::consts::PI) };
                (angle, side.brf(*theta, view.to_radians(), turn)[0])
            };
            let name = format!("{}, θ_{{i}} = {}°", side.name, trimmed(theta.to_degrees()));
            series.push(Series::new(name, plane_angles(theta.to_degrees()).map(point).collect(), style).coloured(k));
        }
    }
    let most = series.iter().flat_map(|s| &s.points).map(|p| p.1).fold(0.0, f64::max);
    let y = Axis::new("BRF π f", "1");
    // Lobes stand orders above what they stand on.
    let least = series.iter().flat_map(|s| &s.points).map(|p| p.1).filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
    let y = if most > 30.0 * least {
        y.within(least.max(1e-3 * most), most).log()
    } else {
        y.within(0.0, 1.1 * most.max(1e-9))
    };
    let floor = least.max(1e-3 * most);
    if most > 30.0 * least {
        series.iter_mut().flat_map(|s| &mut s.points).for_each(|p| p.1 = p.1.max(floor));
    }
    Plot {
        title: format!(
            "{} and {} of {material}, principal plane, {}",
            compared.sides[0].name,
            compared.sides[1].name,
            at(compared.wavelengths[0])
        ),
        x: Axis::new("view angle, forward > 0", "°").within(-90.0, 90.0),
        y,
        series,
        square: false,
    }
    .picture()
}

/// View angles of a plane \[deg\], forward > 0, closer about the mirror direction of light at `degrees`.
fn plane_angles(degrees: f64) -> impl Iterator<Item = f64> {
    let close = (-40..=40).map(f64::from).map(move |i: f64| i.signum() * (i / 40.0).powi(2) * 8.0 + degrees);
    let mut angles: Vec<f64> = (-178..=178).map(|i| 0.5 * f64::from(i)).chain(close).collect();
    angles.retain(|angle| angle.abs() <= 89.0);
    angles.sort_by(f64::total_cmp);
    angles.into_iter()
}

fn trimmed(degrees: f64) -> String {
    let text = format!("{degrees:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// BRDF over all view directions at one wavelength, for light from one zenith angle \[rad\].
///
/// # Errors
/// Where the model does not bind.
pub fn brdf_map(specimen: &Specimen, wavelength: f64, incident: f64) -> Result<Picture, InspectionError> {
    let surface = specimen.bind(&[wavelength])?;
    let field = |zenith: f64, azimuth: f64| surface.brdf(incident, zenith, azimuth)[0];
    let mirror = if surface.has_mirror() { "; the mirror lobe has no finite value and is left out" } else { "" };
    let axis = Axis::new("BRDF f", "sr⁻¹");
    let samples = || (0..=88).flat_map(|z| (0..=36).map(move |a| (f64::from(z), f64::from(a) * 5.0)));
    let values =
        || samples().map(|(z, a)| field(z.to_radians(), a.to_radians())).chain([field(incident, std::f64::consts::PI)]);
    let (least, most) = values().fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
    // Beside a narrow lobe there is next to nothing.
    let least = least.max(1e-4 * most);
    let value = match () {
        () if least > 0.0 && most > 30.0 * least => axis.within(least, most).log(),
        // An even surface has one colour, not the noise of rounding.
        () if most - least <= 1e-9 * most => axis.within(0.0, if most > 0.0 { 2.0 * most } else { 1.0 }),
        () => axis,
    };
    Ok(Dome {
        title: format!(
            "{}, {}, light from θ_{{i}} = {}°",
            titled("BRDF", specimen),
            at(wavelength),
            trimmed(incident.to_degrees())
        ),
        value,
        map: ColourMap::Viridis,
        projection: Projection::Equidistant,
        orientation: Orientation::FromAbove,
        compass: false,
        marks: vec![DomeMark { zenith: incident, azimuth: 0.0, label: "light".into() }],
        note: format!("view directions, equidistant; relative azimuth 0° on the light’s side{mirror}"),
        field: &field,
    }
    .picture())
}

/// Directional-hemispherical reflectance against incident angle, for each wavelength.
///
/// # Errors
/// Where the model does not bind.
pub fn albedo_chart(specimen: &Specimen, wavelengths: &[f64]) -> Result<Picture, InspectionError> {
    let surface = specimen.bind(wavelengths)?;
    let curves: Vec<(f64, Vec<f64>)> =
        (0..=89).map(f64::from).map(|angle| (angle, surface.albedo(angle.to_radians()))).collect();
    let series = (wavelengths.iter().enumerate())
        .map(|(i, l)| Series::new(at(*l), curves.iter().map(|(a, rho)| (*a, rho[i])).collect(), Style::Line))
        .collect();
    let most = curves.iter().flat_map(|(_, rho)| rho).copied().fold(0.0, f64::max);
    Ok(Plot {
        title: titled("Directional-hemispherical reflectance", specimen),
        x: Axis::new("incident zenith angle θ_{i}", "°").within(0.0, 90.0),
        y: Axis::new("reflectance ρ(θ_{i}; 2π)", "1").within(0.0, (most * 11.0).ceil().max(1.0) / 10.0),
        series,
        square: false,
    }
    .picture())
}

/// View angle \[deg\] beside 0 at which spectra are shown.
const OBLIQUE: f64 = 60.0;

/// Total reflectance, R_d and ρ_s against wavelength at view angles of 0° and 60°.
///
/// # Errors
/// Where the model does not bind.
pub fn spectrum_chart(specimen: &Specimen) -> Result<Picture, InspectionError> {
    let wavelengths = specimen.sampled();
    let surface = specimen.bind(&wavelengths)?;
    let line = |values: Vec<f64>| wavelengths.iter().copied().zip(values).collect::<Vec<_>>();
    let style = if wavelengths.len() < 12 { Style::Marked } else { Style::Line };
    let mut series = vec![Series::new("ρ(0°; 2π), all", line(surface.albedo(0.0)), style).coloured(6)];
    let dashed = if style == Style::Marked { style } else { Style::Dashed };
    let components = [
        ("R_{d}", surface.diffuse(0.0), surface.diffuse(OBLIQUE.to_radians()), style),
        ("ρ_{s}", surface.specular(0.0), surface.specular(OBLIQUE.to_radians()), dashed),
    ];
    for (k, (name, normal, oblique, style)) in components.into_iter().enumerate() {
        if normal.iter().chain(&oblique).all(|value| *value == 0.0) {
            continue; // no such lobe
        }
        if normal == oblique {
            series.push(Series::new(format!("{name}, any angle"), line(normal), style).coloured(k));
            continue;
        }
        series.push(Series::new(format!("{name}(0°)"), line(normal), style).coloured(k));
        series.push(Series::new(format!("{name}({OBLIQUE}°)"), line(oblique), style).coloured(k + 2));
    }
    Ok(Plot {
        title: titled("Reflectance spectra", specimen),
        x: wavelength_axis(),
        y: Axis::new("reflectance", "1"),
        series,
        square: false,
    }
    .picture())
}
