//! A run at some of its times, under their solved light: what is rendered.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use sunglint_geometry::Ray;
use sunglint_tracer::{
    Accuracy, Illumination, Lights, Spent, Tile, TileResult, View, Worth, render_tile, render_tile_together,
};

use crate::clock::thread_seconds;
use crate::plan::Run;

/// A run at some of its times, under their light.
pub struct Lit<'a> {
    /// The run.
    pub run: &'a Run,
    /// Which of its times.
    pub times: Range<usize>,
    light: Arc<Light>,
}

/// The solved light of some times of a run.
pub(crate) struct Light {
    times: Vec<Lights>,
    /// What a sample is worth, under an error over the image; told when first asked for.
    worth: OnceLock<Option<Worth>>,
}

impl Light {
    /// As the channels of a run see it.
    pub fn new(run: &Run, times: Vec<Arc<Illumination>>) -> Self {
        let n = times.len();
        let of_time = |time: Arc<Illumination>| Lights::new(time, &run.traced, &run.nodes, n);
        Self { times: times.into_par_iter().map(of_time).collect(), worth: OnceLock::new() }
    }

    /// How many times there are at which nothing shines.
    pub fn dark(&self) -> usize {
        self.times.iter().filter(|time| time.illumination.is_dark()).count()
    }

    /// Of one of its times.
    pub fn of(&self, time: usize) -> &Arc<Illumination> {
        &self.times[time].illumination
    }
}

/// What is kept of a time's light once its tiles are rendered.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BandLight {
    /// E_s, band means \[W m⁻² µm⁻¹\].
    pub solar: Vec<f64>,
    /// Irradiance of the open level ground, direct and diffuse, band means \[W m⁻² µm⁻¹\].
    pub level: Vec<f64>,
    /// Nothing shines.
    pub is_dark: bool,
}

impl BandLight {
    fn new(run: &Run, light: &Illumination) -> Self {
        let means = |spectrum: &[f64]| {
            let mut means = vec![0.0; run.channels.len()];
            run.channels.fold(spectrum, &mut means);
            means
        };
        let cos = light.sun.map_or(0.0, |sun| sun.cos_zenith().max(0.0));
        let level: Vec<f64> =
            light.beam.iter().zip(&light.mean_sky).map(|(e_n, l_d)| e_n * cos + std::f64::consts::PI * l_d).collect();
        Self { solar: means(light.sky.solar_irradiance()), level: means(&level), is_dark: light.is_dark() }
    }
}

impl<'a> Lit<'a> {
    pub(crate) fn new(run: &'a Run, times: Range<usize>, light: Arc<Light>) -> Self {
        Self { run, times, light }
    }

    /// The light of one of its times, by its place among the run's.
    pub(crate) fn light(&self, time: usize) -> &Illumination {
        self.light.of(time - self.times.start)
    }

    /// The light of each time in bands.
    pub(crate) fn bands(&self) -> Vec<BandLight> {
        self.light.times.iter().map(|time| BandLight::new(self.run, &time.illumination)).collect()
    }

    /// Its share of the run's times.
    pub(crate) fn share(&self) -> f64 {
        self.times.len() as f64 / self.run.moments.len().max(1) as f64
    }

    /// Renders one tile at all times, with the run's accuracy.
    pub fn render_tile(&self, tile: Tile) -> TileResult {
        self.render_tile_as(tile, self.run.accuracy)
    }

    /// Renders one tile at all times, with an accuracy of the caller's.
    pub fn render_tile_as(&self, tile: Tile, accuracy: Accuracy) -> TileResult {
        self.with_view(|view| render_tile(&View { accuracy, worth: self.worth(accuracy), ..*view }, tile))
    }

    /// Renders one tile of this run and of others that [trace the same paths](Run::traces_as), with the processor time that each
    /// took.
    pub(crate) fn render_tile_with(
        &self,
        others: &[&Self],
        tile: Tile,
        accuracy: Accuracy,
    ) -> Vec<(TileResult, Spent)> {
        let sight = self.run.sight();
        let all = std::iter::once(self).chain(others.iter().copied());
        let views: Vec<View<'_>> =
            all.map(|lit| View { accuracy, worth: lit.worth(accuracy), ..lit.view(&sight) }).collect();
        render_tile_together(&views, tile, &thread_seconds)
    }

    /// What a sample is worth, where the run asks for an error over the image and is rendered so.
    pub(crate) fn worth(&self, accuracy: Accuracy) -> Option<&Worth> {
        let own = || self.with_view(Worth::of);
        if accuracy == self.run.accuracy { self.light.worth.get_or_init(own).as_ref() } else { None }
    }

    /// The run as the tracer sees it.
    pub fn with_view<T>(&self, act: impl FnOnce(&View<'_>) -> T) -> T {
        act(&self.view(&self.run.sight()))
    }

    fn view<'v>(&'v self, sight: &'v (dyn Fn(f64, f64) -> Ray + Sync)) -> View<'v> {
        self.run.view(sight, &self.light.times)
    }
}
