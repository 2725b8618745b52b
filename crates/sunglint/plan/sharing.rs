//! What the times, bands and runs of a plan share, and what each further one adds.

use std::ops::RangeInclusive;
use std::sync::Arc;

use sunglint_tracer::Accuracy;

use super::{MOST_SAMPLES, Plan, Run};
use crate::lit::Lit;

/// Images, one a time and channel, of the runs that are traced together: 12 kB each in a tile.
const MOST_IMAGES: usize = 4096;

/// What a band adds to the work of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BandShare {
    /// Its name.
    pub name: String,
    /// Values that each path carries for it: a product of reflectances is formed at so many wavelengths.
    pub nodes: usize,
    /// Entries of the spectral grid at which its light is solved.
    pub grid_entries: usize,
}

/// What of a run is shared, and with which other runs of the plan (`experiment/sensor`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sharing {
    /// Rays from the sensor, for all times and bands together.
    pub camera_rays: RangeInclusive<u64>,
    /// Bytes that each time keeps in the finished tiles.
    pub bytes_per_time: u64,
    /// What each band adds.
    pub bands: Vec<BandShare>,
    /// Runs with the very geometry.
    pub geometry_with: Vec<String>,
    /// Runs whose materials reflect by the same bound models.
    pub surfaces_with: Vec<String>,
    /// Runs under the same air at all times.
    pub air_with: Vec<String>,
    /// Runs of the sensor that sample the same points of the same pixels: what differs between their images is no noise of
    /// what is seen.
    pub samples_with: Vec<String>,
    /// Those of them that differ in nothing but light: their paths are traced once for all.
    pub paths_with: Vec<String>,
    /// Runs of the sensor that do not sample the same points, and why.
    pub samples_apart: Vec<(String, &'static str)>,
}

impl Run {
    /// What each band adds to the work.
    pub fn band_shares(&self) -> Vec<BandShare> {
        let n = self.channels.len();
        (self.channels.channels().iter().enumerate())
            .map(|(band, channel)| {
                // Electrons of a band stand at the nodes of its radiance, if its detector sees as much of it.
                let mut own: Vec<usize> =
                    (band..self.traced.len()).step_by(n).flat_map(|c| self.nodes.of_channel(c)).collect();
                own.sort_unstable();
                own.dedup();
                let grid_entries = self.channels.runs(band).iter().map(std::ops::Range::len).sum();
                BandShare { name: channel.name.clone(), nodes: own.len(), grid_entries }
            })
            .collect()
    }

    /// Bytes of a pixel in a finished tile, for each time.
    pub(super) fn tile_bytes(&self) -> usize {
        let surface = usize::from(self.products.surface_radiance || self.products.reflectance_factor);
        size_of::<f32>() * (self.traced.len() * (2 + surface) + 1)
    }

    /// `experiment/sensor`.
    pub fn full_name(&self) -> String {
        format!("{}/{}", self.experiment, self.sensor)
    }

    /// Whether both trace the same paths, sample by sample, and only their light differs. Where the noise or the clock chooses the
    /// number of samples, each run chooses its own.
    pub fn traces_as(&self, other: &Self) -> bool {
        self.budget.is_none()
            && other.budget.is_none()
            && self.window == other.window
            && self.grid == other.grid
            && self.looks_as(other)
            && self.view(&self.sight(), &[]).traces_as(&other.view(&other.sight(), &[]))
    }

    /// Whether both look along the same lines of sight: told by corners and middle of the image.
    fn looks_as(&self, other: &Self) -> bool {
        let (w, h) = self.camera.pixels();
        let (w, h) = (f64::from(w), f64::from(h));
        let places = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h), (0.5 * w, 0.5 * h)];
        self.camera.pixels() == other.camera.pixels()
            && places.iter().all(|(x, y)| {
                let (own, other) = (self.camera.ray(*x, *y), other.camera.ray(*x, *y));
                (own.origin, own.direction.vec()) == (other.origin, other.direction.vec())
            })
    }
}

/// Runs under light, by their places, by what is traced: those of one group [trace the same paths](Run::traces_as). A sweep of very
/// many is traced in several groups, so that the tiles of one stay few.
pub(crate) fn traced_together(lits: &[Lit<'_>]) -> Vec<Vec<usize>> {
    let images = |i: usize| lits[i].times.len() * lits[i].run.traced.len();
    let fits = |group: &[usize], i| group.iter().map(|own| images(*own)).sum::<usize>() + images(i) <= MOST_IMAGES;
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, lit) in lits.iter().enumerate() {
        match groups.iter_mut().find(|group| lits[group[0]].run.traces_as(lit.run) && fits(group, i)) {
            Some(group) => group.push(i),
            None => groups.push(vec![i]),
        }
    }
    groups
}

impl Plan {
    /// What a run shares.
    pub fn sharing(&self, run: &Run) -> Sharing {
        let others = || self.runs.iter().filter(|other| !std::ptr::eq(*other, run));
        let with = |same: &dyn Fn(&Run) -> bool| others().filter(|other| same(other)).map(Run::full_name).collect();
        let geometry = |other: &Run| Arc::ptr_eq(&run.scenery.world, &other.scenery.world);
        let surfaces = |other: &Run| {
            geometry(other)
                && run.bsdfs.len() == other.bsdfs.len()
                && run.bsdfs.iter().zip(&other.bsdfs).all(|pair| match pair {
                    (Some(own), Some(other)) => Arc::ptr_eq(own, other),
                    (own, other) => own.is_none() && other.is_none(),
                })
        };
        let air = |other: &Run| run.sky.is(&other.sky);
        let apart = |other: &Run| match () {
            () if !geometry(other) => Some("another geometry"),
            () if !run.looks_as(other) => Some("another view"),
            () if (run.seed, run.view_id) != (other.seed, other.view_id) => Some("another seed"),
            () => None,
        };
        let of_sensor = || others().filter(|other| other.sensor == run.sensor);
        let pixels = u64::from(run.pixels.0) * u64::from(run.pixels.1);
        // One more through the middle of each pixel, for the truth maps; all anew for each part of the times.
        let rays = |samples: u32| pixels * u64::from(samples.next_multiple_of(16) + 1) * run.parts().count() as u64;
        let camera_rays = match run.accuracy {
            Accuracy::Samples(n) if run.budget.is_none() => rays(n)..=rays(n),
            Accuracy::Samples(least) => rays(least)..=u64::MAX,
            Accuracy::Error { .. } => rays(16)..=rays(MOST_SAMPLES),
        };
        Sharing {
            camera_rays,
            bytes_per_time: pixels * run.tile_bytes() as u64,
            bands: run.band_shares(),
            geometry_with: with(&geometry),
            surfaces_with: with(&surfaces),
            air_with: with(&air),
            samples_with: of_sensor().filter(|other| apart(other).is_none()).map(Run::full_name).collect(),
            paths_with: with(&|other| run.traces_as(other)),
            samples_apart: of_sensor().filter_map(|other| Some((other.full_name(), apart(other)?))).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Options, Plan, check_text};

    /// Experiments that differ in algorithm, model, weather, seed, or in where a sensor stands and a box lies.
    #[test]
    fn runs_share_what_they_do_not_differ_in() {
        let checked = check_text(
            "scene.glint",
            "glint 1\nsite { latitude 43 deg, longitude -77 deg, elevation 100 m }\n\
             collect { at 1992-06-18 16:00 Z }\natmosphere spectrl2\ndefine aloft (0 0 20) m\ndefine aside (3 0 0) m\n\
             material grey { ideal { diffuse 0.5 }, phong { diffuse 0.4, specular 0.1, exponent 40 } }\n\
             ground grey\nbox grey size (1 1 1) m at aside\n\
             sensor nadir { position aloft, look_at (0 0 0) m, field_of_view 10 deg, pixels 8 x 4\n\
             band green 500..600 nm, band red 600..700 nm }\n\
             experiment base { samples 32 }\nexperiment exact { algorithm full, error 1 % }\n\
             experiment glossy { reflectance phong }\nexperiment haze { weather { visibility 5 km }, samples 32 }\n\
             experiment other { seed 7 }\nexperiment high { define aloft (0 0 40) m }\n\
             experiment moved { define aside (4 0 0) m }\n",
        );
        let plan = Plan::new(checked.sound().unwrap_or_else(|fault| panic!("{fault}")), &Options::default())
            .unwrap_or_else(|fault| panic!("{fault}"));
        let of = |name: &str| plan.sharing(plan.run(name, "nadir").expect("a run"));
        let base = of("base");
        let named = |names: &[&str]| names.iter().map(|name| format!("{name}/nadir")).collect::<Vec<_>>();
        assert_eq!(base.geometry_with, named(&["exact", "glossy", "haze", "other", "high"]));
        assert_eq!(base.surfaces_with, named(&["exact", "haze", "other", "high"]));
        assert_eq!(base.samples_with, named(&["exact", "glossy", "haze"]));
        assert_eq!(base.paths_with, named(&["haze"]));
        assert_eq!(super::traced_together(&plan.lit(&plan.parts()[0])).len(), plan.runs().len() - 1);
        let apart: Vec<(&str, &str)> = base.samples_apart.iter().map(|(name, why)| (name.as_str(), *why)).collect();
        assert_eq!(
            apart,
            [("other/nadir", "another seed"), ("high/nadir", "another view"), ("moved/nadir", "another geometry")]
        );
        // Another model is another ground, and another ground another sky.
        assert_eq!(base.air_with, named(&["exact", "other", "high", "moved"]));
        assert_eq!(base.camera_rays, 32 * 33..=32 * 33);
        assert_eq!(of("exact").camera_rays, 32 * 17..=32 * 4097);
        assert_eq!(base.bytes_per_time, 32 * 4 * 5);
        assert_eq!(
            base.bands.iter().map(|band| (band.name.as_str(), band.nodes)).collect::<Vec<_>>(),
            [("green", 1), ("red", 1)]
        );
    }

    /// Of an image of one block all pixels are measured, with the samples of the image itself: as many rays as it casts.
    #[test]
    fn a_forecast_of_all_pixels_is_what_they_take() {
        let checked = check_text(
            "scene.glint",
            "glint 1\ncollect { sun zenith 40 deg azimuth 180 deg }\ncollect { sun zenith 70 deg azimuth 90 deg }\n\
             atmosphere none { sky_radiance 50 W/m2/sr/um }\nmaterial grey { ideal { diffuse 0.5 } }\n\
             ground grey\nbox grey size (1 1 1) m\n\
             sensor nadir { position (0 0 20) m, look_at (0 0 0) m, field_of_view 10 deg, pixels 8 x 8, band b 500..600 nm }\n\
             experiment base { algorithm full, samples 32 }\n",
        );
        let plan = Plan::new(checked.sound().unwrap_or_else(|fault| panic!("{fault}")), &Options::default())
            .unwrap_or_else(|fault| panic!("{fault}"));
        let run = &plan.runs()[0];
        let (forecast, rays) = (run.forecast(), run.render().rays);
        assert_eq!((forecast.pixels, forecast.samples, run.moments.len()), (64, 32, 2));
        assert_eq!(
            (forecast.camera, forecast.hemisphere),
            ((rays.camera + rays.camera_proved) as f64, rays.hemisphere as f64)
        );
        assert_eq!(2.0 * forecast.sun_per_time, rays.sun as f64);
        let skipped = rays.sun_turned_away + rays.sun_proved_clear + rays.sun_proved_shaded;
        assert_eq!(2.0 * forecast.sun_skipped_per_time, skipped as f64);
        assert!(rays.sun > 0 && rays.sun_proved_clear > 0, "{rays:?}");
    }
}
