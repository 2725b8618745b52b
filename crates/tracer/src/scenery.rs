//! What rays meet: the world and its surfaces, bound to one grid.

use std::sync::Arc;

use sunglint_geometry::World;
use sunglint_reflectance::{AngularSpectra, Bsdf};

/// A material as an experiment uses it.
#[derive(Clone)]
pub struct Surface {
    /// Its model.
    pub bsdf: Arc<dyn Bsdf>,
    /// Radiance leaving the front, one value per grid entry \[W m⁻² sr⁻¹ µm⁻¹\]; `None` for none.
    pub emission: Option<Arc<[f64]>>,
    /// Code in truth maps.
    pub code: u16,
    /// Whether R_d is anywhere above 0.
    pub has_diffuse: bool,
    /// Whether ρ_s is anywhere above 0.
    pub has_specular: bool,
    /// Whether any component depends on view angle.
    pub is_angular: bool,
    /// Largest R_d + ρ_s over wavelength and view angle, for Russian roulette.
    pub brightest: f64,
    /// Means over the grid at the nodes of R_d and of ρ_s.
    means: [Vec<f64>; 2],
}

impl Surface {
    /// A material's model on a grid.
    pub fn new(bsdf: Arc<dyn Bsdf>, emission: Option<Arc<[f64]>>, code: u16) -> Self {
        let split = bsdf.split();
        let spectra = |table: &'_ AngularSpectra| -> Vec<Vec<f64>> {
            (0..table.angles().len()).map(|node| table.spectrum(node).to_vec()).collect()
        };
        let (diffuse, specular) = (spectra(&split.diffuse), spectra(&split.specular));
        let largest = |nodes: &[Vec<f64>]| nodes.iter().flatten().copied().fold(0.0, f64::max);
        let means = |nodes: &[Vec<f64>]| -> Vec<f64> {
            nodes.iter().map(|node| node.iter().sum::<f64>() / node.len().max(1) as f64).collect()
        };
        Self {
            has_diffuse: largest(&diffuse) > 0.0,
            has_specular: largest(&specular) > 0.0,
            is_angular: [&split.diffuse, &split.specular, &split.printed].iter().any(|table| table.angles().len() > 1),
            brightest: largest(&diffuse) + largest(&specular),
            means: [means(&diffuse), means(&specular)],
            bsdf,
            emission,
            code,
        }
    }

    /// Means of R_d and ρ_s over the grid at a view angle \[rad\].
    pub fn mean_components(&self, theta: f64) -> (f64, f64) {
        let split = self.bsdf.split();
        let at = |table: &AngularSpectra, means: &[f64]| -> f64 {
            table.weights(theta).iter().map(|(node, weight)| weight * means[*node]).sum()
        };
        (at(&split.diffuse, &self.means[0]), at(&split.specular, &self.means[1]))
    }

    /// Whether `ideal` takes the material as specular: its specular component is the larger one at the normal.
    pub fn is_specular(&self) -> bool {
        let (diffuse, specular) = self.mean_components(0.0);
        specular > diffuse
    }
}

/// The world and, for each of its materials, the surface that an experiment chose.
#[derive(Clone)]
pub struct Scenery {
    /// Geometry.
    pub world: Arc<World>,
    /// By material id; `None` for a material that no facet refers to.
    pub surfaces: Vec<Option<Surface>>,
}

impl Scenery {
    /// The surface of a material.
    ///
    /// # Panics
    /// Where a facet refers to a material that was not bound; the plan binds every one that is used.
    pub fn surface(&self, material: sunglint_geometry::MaterialId) -> &Surface {
        self.surfaces[material.0 as usize].as_ref().expect("the plan binds every material in use")
    }

    /// Whether any surface in use has a specular component.
    pub fn has_specular(&self) -> bool {
        self.surfaces.iter().flatten().any(|surface| surface.has_specular)
    }
}
