//! Facets, objects, instances, OBJ import, terrain, scatter and the acceleration structure. Lengths in m, angles in rad, world frame x east,
//! y north, z up. Coordinates are `f64` from the facet to the hit; `f32` lives inside the acceleration structure, where it
//! may only prove that a ray misses.

mod accel;
mod clearance;
mod facet;
mod horizon;
mod instance;
mod mesh;
mod obj;
mod raster;
mod ray;
mod scatter;
mod shadow;
mod shapes;
mod sole;
mod solids;
mod terrain;
mod world;

pub use facet::{Facet, FacetError, MaterialId, PLANARITY};
pub use horizon::{Horizon, Patch};
pub use instance::{Instance, Pose};
pub use mesh::{Mesh, MeshBuilder};
pub use obj::{ObjError, ObjFault, ObjKind, ObjMesh, ObjSkipped, Up, read_obj};
pub use raster::{MOST_POSTS, Raster, RasterError, RasterFault, RasterKind, RasterPlace, read_raster};
pub use ray::{FacetId, GROUND_OBJECT, Hit, Left, Ray};
pub use scatter::{Crowded, Leaves, Region, Scatter, scatter};
pub use shapes::{box_facets, panel_facets};
pub use sole::SoleFacet;
pub use solids::{cone_facets, cylinder_facets, disk_facet, sphere_facets};
pub use terrain::{Terrain, TerrainError};
pub use world::{Ground, LARGEST_COORDINATE, Occluder, World, WorldError};
