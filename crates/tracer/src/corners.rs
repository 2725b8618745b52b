//! Lines of sight through the corners of a block's pixels: what they meet proves of many that they see one facet alone.

use std::rc::Rc;

use sunglint_geometry::{Hit, Ray, SoleFacet, World};

use crate::paths::Paths;
use crate::render::{Tile, View};
use crate::sightline::CLUSTER_RATIO;

/// Of all pixels of a block.
pub(crate) struct Corners {
    /// Row by row from the block's first corner on.
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    across: usize,
    /// Place of the block's first pixel within its tile.
    first: (u32, u32),
}

impl Corners {
    /// Casts them, for the pixels of a block of a tile.
    pub fn of_block(view: &View<'_>, (tile, block): (Tile, &[(u32, u32)]), paths: &Paths) -> Self {
        let (x, y) = block.iter().fold((u32::MAX, u32::MAX), |(x, y), (i, j)| (x.min(*i), y.min(*j)));
        let (right, below) = block.iter().fold((x, y), |(x, y), (i, j)| (x.max(*i), y.max(*j)));
        let across = (right - x) as usize + 2;
        let rays: Vec<Ray> = (y..=below + 1)
            .flat_map(|j| (x..=right + 1).map(move |i| (f64::from(tile.x + i), f64::from(tile.y + j))))
            .map(|(x, y)| (view.sight)(x, y))
            .collect();
        // As those that tell what a block sees, they are no samples and are not counted.
        let world = &view.scenery.world;
        let seen = |ray: &Ray| paths.sole.as_ref().and_then(|sole| sole.meet(ray)).or_else(|| world.closest(ray));
        let hits = rays.iter().map(seen).collect();
        Self { rays, hits, across, first: (x, y) }
    }

    fn at(&self, (i, j): (u32, u32)) -> [usize; 4] {
        let first = (j - self.first.1) as usize * self.across + (i - self.first.0) as usize;
        [first, first + 1, first + self.across + 1, first + self.across]
    }

    /// What those of a pixel meet, where all lie on one side of one plane facet at about one range.
    pub fn met(&self, pixel: (u32, u32)) -> Option<[Hit; 4]> {
        let hits = self.at(pixel).map(|corner| self.hits[corner]);
        let first = hits[0]?;
        let own = hits.map(|hit| {
            hit.filter(|hit| (hit.facet, hit.front, hit.normal) == (first.facet, first.front, first.normal))
        });
        let [Some(a), Some(b), Some(c), Some(d)] = own else { return None };
        let ranges = own.iter().flatten().map(|hit| hit.t);
        let (near, far) = ranges.fold((f64::INFINITY, 0.0), |(near, far): (f64, f64), t| (near.min(t), far.max(t)));
        (far <= near * CLUSTER_RATIO).then_some([a, b, c, d])
    }

    /// The facet that a pixel is proved to see alone, `of_block` being that of the block where it is one.
    pub fn sole(
        &self,
        world: &World,
        pixel: (u32, u32),
        met: &[Hit; 4],
        of_block: Option<&Rc<SoleFacet>>,
    ) -> Option<Rc<SoleFacet>> {
        let rays = self.at(pixel).map(|corner| self.rays[corner]);
        match of_block.filter(|sole| rays.iter().all(|ray| sole.meet(ray).is_some())) {
            Some(sole) => Some(sole.clone()),
            None => SoleFacet::of_hits(world, &rays, met).map(Rc::new),
        }
    }
}
