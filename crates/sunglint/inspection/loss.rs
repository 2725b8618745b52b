//! What one description of a surface loses against another, over all geometries [Stark1993, sec. 4.5].

use std::f64::consts::{FRAC_PI_2, PI};

use super::{InspectionError, Specimen, Surface};

/// Step of the light's zenith angle \[deg\]; the middles of its cells are looked at.
const STEP: usize = 5;
/// View directions: rings about the mirror direction, each so much wider than the one within \[deg\], and sectors of half a
/// turn.
const FIRST_RING: f64 = 0.05;
const WIDER: f64 = 1.25;
const SECTORS: usize = 16;

/// One of two descriptions.
pub struct Side {
    /// Its name: a model, or the split of one.
    pub name: String,
    surface: Surface,
    /// Seen through its components.
    components: bool,
}

impl Side {
    /// BRF, π f, of the smooth lobes; zenith angles and relative azimuth \[rad\].
    pub fn brf(&self, incident: f64, view: f64, azimuth: f64) -> Vec<f64> {
        let f = match self.components {
            true => self.surface.split_brdf(incident, view, azimuth),
            false => self.surface.brdf(incident, view, azimuth),
        };
        f.into_iter().map(|f| PI * f).collect()
    }

    /// What a furnace of radiance 1 shows at a view angle \[rad\], all lobes.
    pub fn furnace(&self, view: f64) -> Vec<f64> {
        if self.components {
            return (self.surface.diffuse(view).into_iter().zip(self.surface.specular(view)))
                .map(|(d, s)| d + s)
                .collect();
        }
        if self.surface.is_reciprocal() {
            return self.surface.albedo(view);
        }
        let mut sum = self.surface.mirror(view);
        for (incident, azimuth, weight) in directions(view) {
            let f = self.surface.brdf(incident, view, azimuth);
            sum.iter_mut().zip(f).for_each(|(sum, f)| *sum += weight * f);
        }
        sum
    }

    /// Reflectance of the mirror lobe at a view angle \[rad\].
    pub fn mirror(&self, view: f64) -> Vec<f64> {
        if self.components && !self.surface.has_mirror() {
            return vec![0.0; self.surface.wavelengths().len()];
        }
        self.surface.mirror(view)
    }
}

/// Directions (θ, φ) above the surface in cells about the mirror direction of `theta`, finer towards it, with their projected
/// solid angles \[sr\], which sum to π; both half-spaces of azimuth together.
fn directions(theta: f64) -> Vec<(f64, f64, f64)> {
    let mut edges = vec![0.0];
    let mut edge = FIRST_RING.to_radians();
    while edge < PI {
        edges.push(edge);
        edge = (edge * WIDER).min(edge + 4f64.to_radians());
    }
    edges.push(PI);
    let (sin_t, cos_t) = theta.sin_cos();
    let mut cells = Vec::new();
    for ring in edges.windows(2) {
        let solid = (ring[0].cos() - ring[1].cos()) * 2.0 * PI / SECTORS as f64;
        let (sin_a, cos_a) = (0.5 * (ring[0] + ring[1])).sin_cos();
        for k in 0..SECTORS {
            let (sin_b, cos_b) = ((k as f64 + 0.5) / SECTORS as f64 * PI).sin_cos();
            // The mirror direction is (−sin θ, 0, cos θ); β = 0 leads down from it.
            let x = -(sin_t * cos_a + cos_t * sin_a * cos_b);
            let (y, z) = (sin_a * sin_b, cos_t * cos_a - sin_t * sin_a * cos_b);
            if z > 0.0 {
                cells.push((x.hypot(y).atan2(z), y.atan2(x), z * solid));
            }
        }
    }
    let sum: f64 = cells.iter().map(|cell| cell.2).sum();
    cells.iter_mut().for_each(|cell| cell.2 *= PI / sum);
    cells
}

/// A geometry at which the two differ most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorstGeometry {
    /// Zenith angle of the light \[rad\].
    pub incident: f64,
    /// View zenith angle \[rad\].
    pub view: f64,
    /// Relative azimuth \[rad\], 0 on the light's side.
    pub azimuth: f64,
    /// BRF of the first.
    pub first: f64,
    /// BRF of the second.
    pub second: f64,
}

/// What the first loses against the second, per wavelength.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// Mean BRF of the second over all geometries, weighted by both projected solid angles.
    pub mean: f64,
    /// Mean difference, first less second.
    pub bias: f64,
    /// Root mean square difference.
    pub rms: f64,
    /// Where they differ most.
    pub worst: WorstGeometry,
}

/// Two descriptions of one material, bound to wavelengths.
pub struct Compared {
    /// The wavelengths \[µm\].
    pub wavelengths: Vec<f64>,
    /// The first and the second.
    pub sides: [Side; 2],
    /// What the first loses, one for each wavelength.
    pub losses: Vec<Loss>,
}

/// Holds two descriptions of a material against each other over all geometries: light every 5° from 2.5 to 87.5°, and for each
/// some 600 view directions that gather towards its mirror direction, which is among them. A description is a model by label or name; `full`, the specimen's own
/// model, or where that is `ideal` or `split` the first that is neither; or `split`, where the material has no such model the
/// components of the other side's.
///
/// # Errors
/// A model that the material does not have, or nothing beyond `split` to be compared with.
pub fn compared(specimen: &Specimen, names: [&str; 2], wavelengths: &[f64]) -> Result<Compared, InspectionError> {
    let models = specimen.models();
    let has = |wanted: &str| models.iter().any(|(label, name)| *label == wanted || *name == wanted);
    let full = || -> Result<Specimen, InspectionError> {
        let simple = |name: &str| name == "ideal" || name == "split" || name == "total_diffuse";
        let own = specimen.model();
        if !simple(own.split(' ').next().unwrap_or_default()) {
            return specimen.with_model(own.split(' ').next_back().unwrap_or_default());
        }
        let Some((label, _)) = models.iter().find(|(_, name)| !simple(name)) else {
            let message = format!("`{}` has no model beyond {own} to be compared with", specimen.name());
            return Err(InspectionError::Input(message));
        };
        specimen.with_model(label)
    };
    let named = |name: &str| if name == "full" && !has("full") { full() } else { specimen.with_model(name) };
    let is_components = |name: &str| name == "split" && !has("split");
    let side = |k: usize| -> Result<Side, InspectionError> {
        let (name, other) = (names[k], names[1 - k]);
        let components = is_components(name);
        let chosen = match components {
            true if is_components(other) => full()?,
            true => named(other)?,
            false => named(name)?,
        };
        let name = if components { format!("split of {}", chosen.model()) } else { chosen.model() };
        let surface = chosen.bind(wavelengths)?;
        // Of these two models the components are all there is.
        let components = components || matches!(chosen.model().split(' ').next(), Some("ideal" | "split"));
        Ok(Side { name, surface, components })
    };
    let sides = [side(0)?, side(1)?];
    let n = wavelengths.len();
    let none = WorstGeometry { incident: 0.0, view: 0.0, azimuth: 0.0, first: 0.0, second: 0.0 };
    let mut losses = vec![Loss { mean: 0.0, bias: 0.0, rms: 0.0, worst: none }; n];
    let mut see = |incident: f64, view: f64, azimuth: f64, weight: f64| {
        let (first, second) = (sides[0].brf(incident, view, azimuth), sides[1].brf(incident, view, azimuth));
        for ((loss, first), second) in losses.iter_mut().zip(first).zip(second) {
            let off = first - second;
            loss.mean += weight * second;
            loss.bias += weight * off;
            loss.rms += weight * off * off;
            if off.abs() > (loss.worst.first - loss.worst.second).abs() {
                loss.worst = WorstGeometry { incident, view, azimuth, first, second };
            }
        }
    };
    let steps = 90 / STEP;
    for j in 0..steps {
        let incident = (j as f64 + 0.5) / steps as f64 * FRAC_PI_2;
        let edge = |k: usize| (k as f64 / steps as f64 * FRAC_PI_2).sin().powi(2);
        let ring = edge(j + 1) - edge(j);
        for (view, azimuth, weight) in directions(incident) {
            see(incident, view, azimuth, ring * weight / PI);
        }
        see(incident, incident, PI, 0.0);
    }
    losses.iter_mut().for_each(|loss| loss.rms = loss.rms.sqrt());
    Ok(Compared { wavelengths: wavelengths.to_vec(), sides, losses })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ cos θ dω = π and ∫ cos² θ dω = 2π/3 over the cells.
    #[test]
    fn cells_fill_the_hemisphere() {
        for theta in [0.0, 0.7, 1.4] {
            let cells = directions(theta);
            let sum: f64 = cells.iter().map(|cell| cell.2).sum();
            let second: f64 = cells.iter().map(|cell| cell.2 * cell.0.cos()).sum();
            assert!((sum - PI).abs() < 1e-12 && (second / (2.0 * PI / 3.0) - 1.0).abs() < 5e-3, "{theta}: {second}");
        }
    }
}
