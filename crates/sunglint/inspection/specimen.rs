//! A material with one of its models, bound to the wavelengths that are asked for.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;
use std::sync::Arc;

use sunglint_dsl::scene::{Material, ModelUse};
use sunglint_dsl::{Diagnostic, Scene, Severity, Sources};
use sunglint_plugin::{BindError, SpectralValue, TableKey, Value};
use sunglint_radiometry::{Bin, LocalDir, SpectralGrid};
use sunglint_reflectance::Bsdf;
use sunglint_sensor::Band;

use super::{InspectionError, database, unknown_name};
use crate::grid::corners;
use crate::{Checked, Refused, check, check_text, scenery};

/// Half the width of the bin that stands for a wavelength \[µm\].
const HALF_BIN: f64 = 1e-5;

/// A material with one of its models.
pub struct Specimen {
    material: Material,
    use_: ModelUse,
    bands: Vec<Band>,
    sources: Sources,
}

impl Specimen {
    /// A material of a scene with the model that an experiment gives it (the first where unsaid), or the model of a
    /// label or name. A material that nothing refers to is read all the same.
    ///
    /// # Errors
    /// Those of the scene; a name that is not there, with the nearest.
    pub fn of_scene(
        scene: &Path,
        material: &str,
        experiment: Option<&str>,
        model: Option<&str>,
    ) -> Result<Self, InspectionError> {
        let mut checked = check(scene);
        let named = |checked: &Checked| {
            checked.scene.iter().flat_map(|scene| &scene.materials).find(|known| known.name == material).cloned()
        };
        if let Some(found) = named(&checked)
            && !found.used
        {
            checked = using(scene, &[material]);
        }
        let (scene, sources) = whole(checked)?;
        Self::choose(&scene, sources, material, experiment, model)
    }

    /// A material of the database, a folder of the user's before the shipped one; the model is the first of `split`,
    /// `ideal` and its own first, or that of a label or name.
    ///
    /// # Errors
    /// As [`of_scene`](Self::of_scene).
    pub fn of_database(folder: Option<&Path>, material: &str, model: Option<&str>) -> Result<Self, InspectionError> {
        let entries = database(folder)?;
        let names: Vec<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
        let Some(entry) = entries.iter().find(|entry| entry.name == material) else {
            return Err(InspectionError::Input(unknown_name("material", material, &names)));
        };
        let (scene, sources) = whole(alone(&entry.path, material))?;
        Self::choose(&scene, sources, material, None, model)
    }

    pub(super) fn choose(
        scene: &Scene,
        sources: Sources,
        name: &str,
        experiment: Option<&str>,
        model: Option<&str>,
    ) -> Result<Self, InspectionError> {
        let input = |message| Err(InspectionError::Input(message));
        let Some(m) = scene.materials.iter().position(|known| known.name == name) else {
            let names: Vec<&str> = scene.materials.iter().map(|known| known.name.as_str()).collect();
            return input(unknown_name("material", name, &names));
        };
        let material = &scene.materials[m];
        let found = match experiment {
            Some(wanted) => scene.experiments.iter().find(|known| known.name == wanted),
            None => scene.experiments.first(),
        };
        let Some(found) = found else {
            let names: Vec<&str> = scene.experiments.iter().map(|known| known.name.as_str()).collect();
            return input(unknown_name("experiment", experiment.unwrap_or_default(), &names));
        };
        let chosen = match model {
            Some(wanted) => {
                let labelled = material.models.iter().position(|use_| use_.label.as_deref() == Some(wanted));
                let by_name = || material.models.iter().position(|use_| use_.name == wanted);
                let Some(i) = labelled.or_else(by_name) else {
                    let names: Vec<&str> =
                        material.models.iter().map(|use_| use_.label.as_deref().unwrap_or(&use_.name)).collect();
                    return input(unknown_name(&format!("model of {name} called"), wanted, &names));
                };
                Some(i)
            }
            None => found.models.get(m).copied().flatten(),
        };
        let Some(use_) = chosen.and_then(|i| material.models.get(i)) else {
            return input(format!("the material `{name}` has no model"));
        };
        // What is wrong with a band is the scene's to tell when it is planned.
        let bands = (found.sensors.iter()).flat_map(|s| scenery::bands(&scene.sensors[*s], &mut Vec::new())).collect();
        Ok(Self { material: material.clone(), use_: use_.clone(), bands, sources })
    }

    /// The same material with the model of a label or name.
    ///
    /// # Errors
    /// A model that it does not have, with those it has.
    pub fn with_model(&self, wanted: &str) -> Result<Self, InspectionError> {
        let labelled = self.material.models.iter().find(|use_| use_.label.as_deref() == Some(wanted));
        let found = labelled.or_else(|| self.material.models.iter().find(|use_| use_.name == wanted));
        let Some(use_) = found else {
            let names: Vec<&str> = self.material.models.iter().map(shown).collect();
            let what = format!("model of {} called", self.name());
            return Err(InspectionError::Input(unknown_name(&what, wanted, &names)));
        };
        let (material, bands, sources) = (self.material.clone(), self.bands.clone(), self.sources.clone());
        Ok(Self { material, use_: use_.clone(), bands, sources })
    }

    /// Labels, else names, of the models that the material is said to have, each with its model's name.
    pub fn models(&self) -> Vec<(&str, &str)> {
        let said = self.material.models.iter().filter(|use_| use_.span.is_some());
        said.map(|use_| (shown(use_), use_.name.as_str())).collect()
    }

    /// Name of the material.
    pub fn name(&self) -> &str {
        &self.material.name
    }

    /// Title of the material.
    pub fn title(&self) -> Option<&str> {
        self.material.title.as_deref()
    }

    /// The model: its name, and its label where it has one.
    pub fn model(&self) -> String {
        match &self.use_.label {
            Some(label) => format!("{} {label}", self.use_.name),
            None => self.use_.name.clone(),
        }
    }

    /// The wavelengths \[µm\] that all its spectra cover; `None` where none is tied to wavelength.
    pub fn range(&self) -> Option<(f64, f64)> {
        self.covered([&self.use_])
    }

    /// The wavelengths \[µm\] that the spectra of all the models cover that the material is said to have.
    pub(super) fn whole_range(&self) -> Option<(f64, f64)> {
        self.covered(self.material.models.iter().filter(|use_| use_.span.is_some()))
    }

    fn covered<'u>(&self, uses: impl IntoIterator<Item = &'u ModelUse>) -> Option<(f64, f64)> {
        let mut range: Option<(f64, f64)> = None;
        let mut of = |value: &SpectralValue| {
            if let SpectralValue::Curve(curve) = value {
                let ((low, high), (a, b)) = (curve.domain(), range.unwrap_or((0.0, f64::INFINITY)));
                range = Some((a.max(low), b.min(high)));
            }
        };
        self.material.reflectance.iter().for_each(&mut of);
        for value in uses.into_iter().flat_map(|use_| use_.args.flattened()) {
            if let Value::Spectrum(value) = value {
                of(value);
            }
        }
        range.filter(|(a, b)| a < b)
    }

    /// Total reflectance against wavelength \[µm\], as the material states it, or as its model returns light from the
    /// normal, between 0.3 and 1.1 µm.
    ///
    /// # Errors
    /// Where the model does not bind.
    pub fn total_reflectance(&self) -> Result<Vec<(f64, f64)>, InspectionError> {
        let (low, high) = self.range().unwrap_or((0.4, 1.0));
        let (low, high) = (low.max(0.3), high.min(1.1));
        match &self.material.reflectance {
            Some(SpectralValue::Constant(value)) => Ok(vec![(low, *value), (high, *value)]),
            Some(SpectralValue::Curve(curve)) => {
                let inner = curve.nodes().iter().copied().filter(|l| *l > low && *l < high);
                Ok([low].into_iter().chain(inner).chain([high]).map(|l| (l, curve.at(l))).collect())
            }
            Some(SpectralValue::PerBand(values)) => Ok(self.per_band(values)),
            None => {
                let wavelengths = self.sampled();
                let surface = self.bind(&wavelengths)?;
                Ok(wavelengths.into_iter().zip(surface.albedo(0.0)).collect())
            }
        }
    }

    fn per_band(&self, values: &[(String, f64)]) -> Vec<(f64, f64)> {
        let mut points: Vec<(f64, f64)> = (self.bands.iter())
            .filter_map(|band| {
                let (_, value) = values.iter().find(|(name, _)| *name == band.name)?;
                Some((band.channel().centre.um(), *value))
            })
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    }

    /// Wavelengths every 5 nm of what its spectra cover between 0.4 and 1.0 µm; of per-band values, the bands' centres.
    pub fn sampled(&self) -> Vec<f64> {
        if self.is_per_band() {
            let mut centres: Vec<f64> = self.bands.iter().map(|band| band.channel().centre.um()).collect();
            centres.sort_by(f64::total_cmp);
            centres.dedup();
            return centres;
        }
        let (low, high) = self.range().unwrap_or((0.4, 1.0));
        (80..=200).map(|i| f64::from(i) * 0.005).filter(|l| (low..=high).contains(l)).collect()
    }

    pub(super) fn is_per_band(&self) -> bool {
        let per_band = |value: &SpectralValue| matches!(value, SpectralValue::PerBand(_));
        self.use_.args.flattened().into_iter().any(|value| match value {
            Value::Spectrum(value) => per_band(value),
            Value::Table(table) => matches!(table.key, TableKey::Band(_)),
            _ => false,
        })
    }

    /// Binds the model to wavelengths \[µm\].
    ///
    /// # Errors
    /// A wavelength out of 0.2..5 µm or more than 10 000 of them, one in no band where the model's values are per band;
    /// what the model refuses, with its place in the scene.
    pub fn bind(&self, wavelengths: &[f64]) -> Result<Surface, InspectionError> {
        if let Some(wrong) = wavelengths.iter().find(|l| !(0.2..=5.0).contains(*l)) {
            let message = format!("a wavelength of {wrong} um is none of light; write micrometres, for example 0.55");
            return Err(InspectionError::Input(message));
        }
        if wavelengths.is_empty() || wavelengths.len() > 10_000 {
            return Err(InspectionError::Input("1 to 10000 wavelengths are looked at in one go".into()));
        }
        let mut ascending = wavelengths.to_vec();
        ascending.sort_by(f64::total_cmp);
        ascending.dedup();
        let (low, high) = self.range().unwrap_or((0.0, f64::INFINITY));
        let mut names = Vec::new();
        let mut bins = Vec::new();
        for wavelength in &ascending {
            let band = if self.is_per_band() { Some(self.band_at(*wavelength, &mut names)?) } else { None };
            // At the end of a spectrum the bin keeps within it.
            let (mut lower, mut upper) = (wavelength - HALF_BIN, wavelength + HALF_BIN);
            if (low..=high).contains(wavelength) {
                (lower, upper) = (lower.max(low), upper.min(high));
            }
            bins.push(Bin { lower, upper, band });
        }
        let grid = SpectralGrid::new(bins, names);
        let bsdf = self.bind_on(&grid)?;
        let bin_of = |l: &f64| ascending.iter().position(|known| known == l).unwrap_or(0);
        Ok(Surface {
            bsdf,
            n: grid.len(),
            bins: wavelengths.iter().map(bin_of).collect(),
            wavelengths: wavelengths.to_vec(),
        })
    }

    /// Binds the model to a grid.
    pub(super) fn bind_on(&self, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, InspectionError> {
        let model = sunglint_reflectance::BUILTIN.iter().find(|model| model.info.name == self.use_.name);
        let Some(model) = model else {
            return Err(InspectionError::Input(format!("no reflectance model is called `{}`", self.use_.name)));
        };
        (model.bind)(&self.use_.args, grid).map_err(|error| self.refused(&error))
    }

    /// Bands of the sensors that the experiment looks through.
    pub(super) fn bands(&self) -> &[Band] {
        &self.bands
    }

    /// Corners \[µm\] of the tables against wavelength that the model reads.
    pub(super) fn corners(&self) -> Vec<Vec<f64>> {
        let of_args = self.use_.args.iter().map(|(_, value)| match value {
            Value::Spectrum(value) => corners(value),
            Value::Table(table) => match &table.key {
                TableKey::Wavelength(um) => um.clone(),
                TableKey::None | TableKey::Band(_) => Vec::new(),
            },
            _ => Vec::new(),
        });
        of_args.chain(self.material.reflectance.iter().map(corners)).collect()
    }

    fn band_at(&self, wavelength: f64, names: &mut Vec<String>) -> Result<u16, InspectionError> {
        let inside = |band: &&Band| (band.support().0..=band.support().1).contains(&wavelength);
        let Some(band) = self.bands.iter().find(inside) else {
            let bands: Vec<String> = (self.bands.iter())
                .map(|band| format!("{} {:.0}..{:.0} nm", band.name, band.support().0 * 1e3, band.support().1 * 1e3))
                .collect();
            let message = format!(
                "`{}` has values per band, and {wavelength} um lies in none of {}",
                self.material.name,
                bands.join(", ")
            );
            return Err(InspectionError::Input(message));
        };
        let known = names.iter().position(|name| *name == band.name);
        Ok(known.unwrap_or_else(|| {
            names.push(band.name.clone());
            names.len() - 1
        }) as u16)
    }

    fn refused(&self, error: &BindError) -> InspectionError {
        let place = error.param.and_then(|param| self.use_.param_spans.get(param).copied()).or(self.use_.span);
        let message = format!("`{}`: {}", self.use_.name, error.message);
        let mut diagnostic = match place {
            Some(place) => Diagnostic::error(error.code, place, message),
            None => Diagnostic::whole(error.code, message),
        };
        diagnostic.help = error.help.clone();
        Refused { sources: self.sources.clone(), diagnostics: vec![diagnostic] }.into()
    }
}

fn shown(use_: &ModelUse) -> &str {
    use_.label.as_deref().unwrap_or(&use_.name)
}

/// A model bound to wavelengths: every answer has one value for each.
pub struct Surface {
    bsdf: Arc<dyn Bsdf>,
    n: usize,
    bins: Vec<usize>,
    wavelengths: Vec<f64>,
}

impl Surface {
    /// The wavelengths \[µm\].
    pub fn wavelengths(&self) -> &[f64] {
        &self.wavelengths
    }

    pub(super) fn bsdf(&self) -> &dyn Bsdf {
        &*self.bsdf
    }

    /// Number of grid entries.
    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// The two grid entries of each wavelength.
    pub(super) fn entries(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.bins.iter().map(|bin| [2 * bin, 2 * bin + 1])
    }

    /// Whether part of the light leaves as from a mirror, where no finite BRDF tells it.
    pub fn has_mirror(&self) -> bool {
        self.bsdf.lobes().mirror
    }

    /// Whether it answers the same with light and view exchanged.
    pub fn is_reciprocal(&self) -> bool {
        self.bsdf.claims().reciprocal
    }

    /// BRDF \[sr⁻¹\] of all but the mirror lobe, without the cosine; zenith angles and relative azimuth \[rad\], 0 on the
    /// source's side.
    pub fn brdf(&self, incident_zenith: f64, view_zenith: f64, relative_azimuth: f64) -> Vec<f64> {
        let incident = LocalDir::from_polar(incident_zenith, 0.0);
        let outgoing = LocalDir::from_polar(view_zenith, relative_azimuth);
        self.ask(|f| self.bsdf.eval(incident, outgoing, f))
    }

    /// BRDF \[sr⁻¹\] that its components R_d and ρ_s stand for; angles as of [`brdf`](Self::brdf).
    pub fn split_brdf(&self, incident_zenith: f64, view_zenith: f64, relative_azimuth: f64) -> Vec<f64> {
        let incident = LocalDir::from_polar(incident_zenith, 0.0);
        let outgoing = LocalDir::from_polar(view_zenith, relative_azimuth);
        self.ask(|f| self.bsdf.split().brdf(incident, outgoing, f))
    }

    /// Reflectance of the mirror lobe at a view angle \[rad\]; 0 without one.
    pub fn mirror(&self, view_zenith: f64) -> Vec<f64> {
        self.ask(|rho| self.bsdf.mirror(LocalDir::from_polar(view_zenith, 0.0), rho))
    }

    /// R_d at a view angle \[rad\].
    pub fn diffuse(&self, view_zenith: f64) -> Vec<f64> {
        self.ask(|r| self.bsdf.split().diffuse.fill(view_zenith, r))
    }

    /// ρ_s at a view angle \[rad\]: the reflectance of the specular lobe, a mirror's too.
    pub fn specular(&self, view_zenith: f64) -> Vec<f64> {
        self.ask(|r| self.bsdf.split().specular.fill(view_zenith, r))
    }

    /// R_s at a view angle \[rad\] as the scene or its table states it.
    pub fn printed(&self, view_zenith: f64) -> Vec<f64> {
        self.ask(|r| self.bsdf.split().printed.fill(view_zenith, r))
    }

    /// Directional-hemispherical reflectance at an incident zenith angle \[rad\], all lobes.
    pub fn albedo(&self, incident_zenith: f64) -> Vec<f64> {
        let incident = LocalDir::from_polar(incident_zenith.min(FRAC_PI_2), 0.0);
        self.ask(|rho| self.bsdf.albedo(incident, rho))
    }

    /// The mean of the two nodes of each wavelength's bin.
    fn ask(&self, fill: impl FnOnce(&mut [f64])) -> Vec<f64> {
        let mut entries = vec![0.0; self.n];
        fill(&mut entries);
        self.bins.iter().map(|bin| 0.5 * (entries[2 * bin] + entries[2 * bin + 1])).collect()
    }
}

/// The scene of a check, where it holds.
pub(super) fn whole(checked: Checked) -> Result<(Scene, Sources), InspectionError> {
    let Checked { scene, sources, diagnostics, .. } = checked;
    match scene {
        Some(scene) if !diagnostics.iter().any(|d| d.severity == Severity::Error) => Ok((scene, sources)),
        _ => Err(Refused { sources, diagnostics }.into()),
    }
}

fn facets(materials: &[&str]) -> String {
    materials.iter().map(|material| format!("facet {material} (0 0 0) (1 0 0) (0 1 0) m\n")).collect()
}

fn quoted(path: &str) -> String {
    format!("\"{}\"", path.replace('\\', "\\\\").replace('"', "\\\""))
}

/// A scene with facets of the materials, so that their models are read.
pub(super) fn using(scene: &Path, materials: &[&str]) -> Checked {
    let file = scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let beside = scene.with_file_name("(materials of the scene)");
    check_text(&beside.to_string_lossy(), format!("glint 1\ninclude {}\n{}", quoted(&file), facets(materials)))
}

/// A scene of nothing but the material of a file.
pub(super) fn alone(file: &str, material: &str) -> Checked {
    let text = format!(
        "glint 1\ninclude {}\ncollect {{ sun none }}\n{}\
         sensor eye {{ position (0 0 1) m, look_at (0 0 0) m, field_of_view 1 deg, pixels 1 x 1, band all 0.4..1 um }}\n",
        quoted(file),
        facets(&[material])
    );
    check_text("(a material alone)", text)
}
