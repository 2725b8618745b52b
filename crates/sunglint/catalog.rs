//! The models of this build, as the language sees them.

use sunglint_plugin::{Catalog, Role};

/// Everything that a scene may name.
pub fn catalog() -> Catalog {
    let mut catalog = Catalog::default();
    sunglint_reflectance::BUILTIN.iter().for_each(|model| catalog.add(Role::Reflectance, model.info));
    sunglint_atmosphere::BUILTIN.iter().for_each(|model| catalog.add(Role::Atmosphere, model.info));
    sunglint_atmosphere::AEROSOLS.iter().for_each(|model| catalog.add(Role::Aerosol, model.info));
    sunglint_sensor::BUILTIN.iter().for_each(|model| catalog.add(Role::Detector, model.info));
    sunglint_tracer::BUILTIN.iter().for_each(|model| catalog.add(Role::Algorithm, model.info));
    catalog
}
