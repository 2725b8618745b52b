//! What rays meet: the world and its surfaces, at the nodes of a set of channels.

use std::sync::Arc;

use sunglint_geometry::World;
use sunglint_radiometry::{Channels, LocalDir};
use sunglint_reflectance::{AngularSpectra, Bsdf, Split};

use crate::Nodes;
use crate::mirrors::Mirrors;

/// A material as an experiment uses it.
#[derive(Clone)]
pub struct Surface {
    /// Its model, bound to the grid entries of the nodes.
    pub bsdf: Arc<dyn Bsdf>,
    /// R_d, ρ_s and Ω_s at the nodes.
    pub split: Split,
    /// Radiance leaving the front at the nodes \[W m⁻² sr⁻¹ µm⁻¹\]; `None` for none.
    pub emission: Option<Arc<[f64]>>,
    /// Code in truth maps.
    pub code: u16,
    /// Whether R_d is anywhere above 0.
    pub has_diffuse: bool,
    /// Whether ρ_s is anywhere above 0.
    pub has_specular: bool,
    /// Whether any component depends on view angle.
    pub is_angular: bool,
    /// Largest R_d + ρ_s over nodes and view angle, for Russian roulette.
    pub brightest: f64,
    /// Means over the nodes, at the view angles of R_d and of ρ_s.
    means: [Vec<f64>; 2],
}

impl Surface {
    /// A material whose model is bound to the nodes' grid entries, with its components and emission there.
    pub fn new(bsdf: Arc<dyn Bsdf>, split: Split, emission: Option<Arc<[f64]>>, code: u16) -> Self {
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
            split,
            emission,
            code,
        }
    }

    /// Means of R_d and ρ_s over the nodes at a view angle \[rad\].
    pub fn mean_components(&self, theta: f64) -> (f64, f64) {
        let at = |table: &AngularSpectra, means: &[f64]| -> f64 {
            table.weights(theta).iter().map(|(node, weight)| weight * means[*node]).sum()
        };
        (at(&self.split.diffuse, &self.means[0]), at(&self.split.specular, &self.means[1]))
    }

    /// Whether `ideal` takes the material as specular: its specular component is the larger one at the normal.
    pub fn is_specular(&self) -> bool {
        let (diffuse, specular) = self.mean_components(0.0);
        specular > diffuse
    }
}

/// Spectra that a model shows, on its own grid: f in and out of the mirror direction and the mirror's reflectance, all over
/// the view angles. [`Nodes`] are chosen for them.
pub fn spectra_of(bsdf: &dyn Bsdf, n_entries: usize) -> Vec<Vec<f64>> {
    const STEPS: usize = 18;
    let lobes = bsdf.lobes();
    let mut spectra = Vec::new();
    let mut add = |fill: &dyn Fn(&mut [f64])| {
        let mut spectrum = vec![0.0; n_entries];
        fill(&mut spectrum);
        if spectrum.iter().any(|value| *value != 0.0) && spectrum.iter().all(|value| value.is_finite()) {
            spectra.push(spectrum);
        }
    };
    for step in 0..STEPS {
        let theta = (5.0 * step as f64).to_radians();
        let outgoing = LocalDir::from_polar(theta, 0.0);
        let elsewhere = LocalDir::from_polar((80.0 - 4.0 * step as f64).to_radians(), 0.6 * step as f64);
        if lobes.mirror {
            add(&|rho| bsdf.mirror(outgoing, rho));
        }
        if lobes.diffuse || lobes.glossy {
            add(&|f| bsdf.eval(outgoing.mirrored(), outgoing, f));
            add(&|f| bsdf.eval(elsewhere, outgoing, f));
        }
        if lobes.transmission {
            let below = LocalDir::from_unit(-elsewhere.vec());
            add(&|f| bsdf.eval(below, outgoing, f));
        }
    }
    spectra
}

/// The components of a model at the nodes: their values there, or where nodes hold band means, their means.
pub fn split_at(nodes: &Nodes, channels: &Channels, of_grid: &Split) -> Split {
    let at = |table: &AngularSpectra| {
        let spectra = (0..table.angles().len()).map(|node| nodes.of(channels, table.spectrum(node))).collect();
        AngularSpectra::new(table.angles().to_vec(), spectra)
    };
    Split {
        diffuse: at(&of_grid.diffuse),
        specular: at(&of_grid.specular),
        printed: at(&of_grid.printed),
        solid_angle: of_grid.solid_angle.clone(),
    }
}

/// The world and, for each of its materials, the surface that an experiment chose.
#[derive(Clone)]
pub struct Scenery {
    /// Geometry.
    pub world: Arc<World>,
    /// By material id; `None` for a material that no facet refers to.
    pub surfaces: Vec<Option<Surface>>,
    /// Planar mirrors.
    pub(crate) mirrors: Arc<Mirrors>,
}

impl Scenery {
    /// Binds surfaces to a world.
    pub fn new(world: Arc<World>, surfaces: Vec<Option<Surface>>) -> Self {
        let is_mirror = |material: sunglint_geometry::MaterialId| {
            surfaces[material.0 as usize].as_ref().is_some_and(|surface| surface.bsdf.lobes().mirror)
        };
        let mirrors = Arc::new(Mirrors::new(&world, is_mirror));
        Self { world, surfaces, mirrors }
    }

    /// Whether it is another: one world, and the same models bound to the same materials.
    pub(crate) fn is(&self, other: &Self) -> bool {
        let same = |pair: (&Option<Surface>, &Option<Surface>)| match pair {
            (Some(own), Some(other)) => {
                Arc::ptr_eq(&own.bsdf, &other.bsdf) && own.emission == other.emission && own.code == other.code
            }
            (own, other) => own.is_none() && other.is_none(),
        };
        Arc::ptr_eq(&self.world, &other.world)
            && self.surfaces.len() == other.surfaces.len()
            && self.surfaces.iter().zip(&other.surfaces).all(same)
    }

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

    /// Planar facets with a mirror lobe, and their distinct normals.
    pub fn mirror_counts(&self) -> (usize, usize) {
        self.mirrors.counts()
    }
}
