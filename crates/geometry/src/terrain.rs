//! A surface over a grid of heights.
//!
//! Between four posts lie two triangles, parted along the diagonal whose ends differ less in height, the shorter of the
//! two, which makes the fatter triangles and does not depend on how the grid is turned. Where both are alike it runs from
//! south-west to north-east: four heights do not tell a ridge from a gully. A cell that lacks one post keeps the triangle
//! of the other three; one that lacks more is open, and rays pass.

use crate::{MaterialId, Mesh, Raster};
use glam::{DVec2, DVec3};

/// A surface over posts.
#[derive(Clone, Debug)]
pub struct Terrain {
    columns: usize,
    rows: usize,
    /// As in [`Raster::values`].
    heights: Vec<f64>,
    south_west: DVec2,
    spacing: DVec2,
}

/// Why a grid makes no surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TerrainError {
    /// Fewer than two posts one way.
    #[error("a terrain has two posts at least each way; this grid has {columns} x {rows}")]
    TooFewPosts {
        /// Posts from west to east.
        columns: usize,
        /// Posts from north to south.
        rows: usize,
    },
    /// A spacing that is not above zero, or coordinates beyond 10⁹ m.
    #[error("posts from ({} {}) m, ({} {}) m apart, make no surface", south_west.x, south_west.y, spacing.x, spacing.y)]
    NoPlace {
        /// The first post of the last row.
        south_west: DVec2,
        /// Between neighbours.
        spacing: DVec2,
    },
    /// No cell has three posts with heights.
    #[error("no cell of the grid has three posts with heights")]
    OnlyHoles,
}

/// A corner of a cell: 0 or 1 to the east, 0 or 1 to the north.
type Corner = [usize; 2];

impl Terrain {
    /// The surface over a grid whose first post of the last row stands at `south_west` \[m\], neighbours `spacing` apart.
    ///
    /// # Errors
    /// See [`TerrainError`].
    pub fn new(raster: Raster, south_west: DVec2, spacing: DVec2) -> Result<Self, TerrainError> {
        let Raster { columns, rows, values: heights, .. } = raster;
        if columns < 2 || rows < 2 {
            return Err(TerrainError::TooFewPosts { columns, rows });
        }
        let far = south_west + spacing * DVec2::new((columns - 1) as f64, (rows - 1) as f64);
        let reach = far.abs().max(south_west.abs()).max_element();
        if !(spacing.x > 0.0 && spacing.y > 0.0 && reach <= 1e9) {
            return Err(TerrainError::NoPlace { south_west, spacing });
        }
        let terrain = Self { columns, rows, heights, south_west, spacing };
        let any = (0..rows - 1).any(|j| (0..columns - 1).any(|i| terrain.triangles(i, j).next().is_some()));
        if any { Ok(terrain) } else { Err(TerrainError::OnlyHoles) }
    }

    /// Posts from west to east, and from south to north.
    pub fn posts(&self) -> (usize, usize) {
        (self.columns, self.rows)
    }
    /// The first post of the last row \[m\].
    pub fn south_west(&self) -> DVec2 {
        self.south_west
    }
    /// Between neighbours \[m\].
    pub fn spacing(&self) -> DVec2 {
        self.spacing
    }
    /// Heights as in [`Raster::values`].
    pub fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// Height of the surface \[m\], of the very triangles that [`Terrain::mesh`] gives; `None` beside it and in holes.
    pub fn height_at(&self, x: f64, y: f64) -> Option<f64> {
        let at = (DVec2::new(x, y) - self.south_west) / self.spacing;
        let (last_i, last_j) = (self.columns - 2, self.rows - 2);
        if !(at.x >= 0.0 && at.y >= 0.0 && at.x <= (last_i + 1) as f64 && at.y <= (last_j + 1) as f64) {
            return None;
        }
        let (i, j) = ((at.x as usize).min(last_i), (at.y as usize).min(last_j));
        // A place on the border of a cell belongs to its neighbour too, of which that cell may be a hole.
        let before = |whole: usize, at: f64| whole - usize::from(at == whole as f64 && whole > 0);
        for j in (before(j, at.y)..=j).rev() {
            for i in (before(i, at.x)..=i).rev() {
                let within = at - DVec2::new(i as f64, j as f64);
                for [right, ..] in self.triangles(i, j) {
                    let [east, north] = right;
                    let z = |corner: Corner| self.corner(i, j, corner);
                    let along = (within.x - east as f64).abs();
                    let up = (within.y - north as f64).abs();
                    if along + up <= 1.0 {
                        let z_0 = z(right);
                        return Some(z_0 + (z([1 - east, north]) - z_0) * along + (z([east, 1 - north]) - z_0) * up);
                    }
                }
            }
        }
        None
    }

    /// The triangles as facets with their fronts up, made of what `material` says of a post: its column from the west and
    /// its row from the north. A triangle is made of what its right-angled corner is, the post nearest to its middle.
    pub fn mesh(&self, material: impl Fn(usize, usize) -> MaterialId) -> Mesh {
        let position = |at: usize| {
            let (i, j) = (at % self.columns, self.rows - 1 - at / self.columns);
            let xy = self.south_west + self.spacing * DVec2::new(i as f64, j as f64);
            xy.extend(self.heights[at])
        };
        let n = 2 * (self.columns - 1) * (self.rows - 1);
        let (mut triangles, mut materials) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for j in 0..self.rows - 1 {
            for i in 0..self.columns - 1 {
                for corners in self.triangles(i, j) {
                    triangles.push(corners.map(|corner| self.index(i, j, corner) as u32));
                    let [east, north] = corners[0];
                    materials.push(material(i + east, self.rows - 1 - j - north));
                }
            }
        }
        Mesh::from_triangles((0..self.heights.len()).map(position).collect(), triangles, |i| materials[i])
    }

    fn index(&self, i: usize, j: usize, [east, north]: Corner) -> usize {
        (self.rows - 1 - j - north) * self.columns + i + east
    }
    fn corner(&self, i: usize, j: usize, corner: Corner) -> f64 {
        self.heights[self.index(i, j, corner)]
    }

    /// The triangles of cell i from the west, j from the south: counter-clockwise from above, the right angle first.
    fn triangles(&self, i: usize, j: usize) -> impl Iterator<Item = [Corner; 3]> {
        const SOUTH_EAST: [Corner; 3] = [[1, 0], [1, 1], [0, 0]];
        const NORTH_WEST: [Corner; 3] = [[0, 1], [0, 0], [1, 1]];
        const SOUTH_WEST: [Corner; 3] = [[0, 0], [1, 0], [0, 1]];
        const NORTH_EAST: [Corner; 3] = [[1, 1], [0, 1], [1, 0]];
        let [sw, se, nw, ne] = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|corner| self.corner(i, j, corner));
        let pair = match [sw, se, nw, ne].map(f64::is_nan) {
            [false, false, false, false] if (ne - sw).abs() <= (nw - se).abs() => [Some(SOUTH_EAST), Some(NORTH_WEST)],
            [false, false, false, false] => [Some(SOUTH_WEST), Some(NORTH_EAST)],
            [true, false, false, false] => [Some(NORTH_EAST), None],
            [false, true, false, false] => [Some(NORTH_WEST), None],
            [false, false, true, false] => [Some(SOUTH_EAST), None],
            [false, false, false, true] => [Some(SOUTH_WEST), None],
            _ => [None, None],
        };
        pair.into_iter().flatten()
    }

    /// Lowest and highest post \[m\].
    pub fn extent(&self) -> (DVec3, DVec3) {
        let far = self.south_west + self.spacing * DVec2::new((self.columns - 1) as f64, (self.rows - 1) as f64);
        let known = self.heights.iter().filter(|z| !z.is_nan());
        let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(*z), h.max(*z)));
        (self.south_west.extend(low), far.extend(high))
    }
}
