//! The sky over a solved column: what the providers `layered` and `layers` answer.
//!
//! Fluxes and transmittances are solved at every entry of the grid. Radiances are solved at some of them and carried over
//! to the rest as shares: a node of the sky as L/E_d, a path as L_u over what scatters along it. A share changes slowly
//! with wavelength and with the absorption of gases; entries are solved where either has gone on by a stated step.
//!
//! ```text
//! L = L₀ + L_g G,   L_g = A (E_b + E_d0)/(π (1 − A S))      ground albedo A, without solving again [Chandrasekhar1960, ch. XI]
//! E_d = E_d0 + L_g π S
//! E_d0 = F↓ + E cos θ (T′ − T)                              what delta-M leaves in the beam is diffuse light
//! ```

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use rayon::prelude::*;
use sunglint_radiometry::{Irradiance, Radiance, Spectrum, Transmittance, WorldDir};

use crate::medium::{Layer, Medium, Strata};
use crate::radiance::{Gathered, Lattice, Lit, Look, Optics, Sight, SunRays, gather_ground, solve_entry};
use crate::ray::Shells;
use crate::solver::Field;
use crate::{Needs, Path, SkyState, Sun};

/// How a column is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Settings {
    pub streams: usize,
    pub spherical: bool,
    /// Azimuthal orders are added until two in a row change the source by less.
    pub accuracy: f64,
    /// Whether radiances are solved at every entry.
    pub every_entry: bool,
}

/// A column at every entry of a grid.
pub(crate) struct ColumnAir {
    pub strata: Strata,
    pub media: Vec<Medium>,
    /// \[µm\].
    pub wavelengths: Vec<f64>,
    /// E_s at 1 au.
    pub solar: Vec<f64>,
    /// Ground albedo.
    pub albedo: Vec<f64>,
    /// What a plan is told.
    pub notes: Vec<String>,
}

/// Streams that fluxes alone are solved with.
const FLUX_STREAMS: usize = 8;
/// A sun lower than this leaves the air dark \[rad\]: at 98° the zenith has lost all but 1e-4 of its light.
const DARK: f64 = 98.0 * PI / 180.0;

/// Solves a column under many suns.
pub(crate) fn solve(air: ColumnAir, suns: &[Sun], needs: &Needs, settings: &Settings) -> Vec<Box<dyn SkyState>> {
    let shells = Shells::new(&air.strata, settings.spherical);
    let n = air.media.len();
    let diffuse = needs.diffuse_irradiance || needs.directional_sky || needs.path;
    let radiances = needs.directional_sky || needs.path;
    let lit: Vec<bool> = suns.iter().map(|sun| sun.true_zenith < DARK).collect();
    let zeniths: Vec<f64> = suns.iter().zip(&lit).filter(|(_, lit)| **lit).map(|(sun, _)| sun.true_zenith).collect();
    let sampling = match radiances && !zeniths.is_empty() {
        true => Sampling::new(&air, settings.every_entry),
        false => Sampling { solved: Vec::new(), shares: Vec::new() },
    };

    // Extinction of every entry, and its fluxes.
    let flux_streams = settings.streams.min(FLUX_STREAMS);
    let fluxes: Vec<Fluxes> = match diffuse && !zeniths.is_empty() {
        true => {
            let mut cache = Lattices::default();
            let optics: Vec<Optics> =
                air.media.par_iter().map(|medium| Optics::new(medium, &shells, flux_streams)).collect();
            let geometry: Vec<_> = optics.iter().map(|o| cache.of(&shells, o, &zeniths, settings.spherical)).collect();
            (optics.par_iter().zip(&geometry))
                .map(|(optics, (_, rays))| Fluxes::new(optics, rays, settings.accuracy))
                .collect()
        }
        false => Vec::new(),
    };
    let per_metre = |of: fn(&Layer) -> f64| -> Vec<Vec<f64>> {
        let of_medium = |medium: &Medium| {
            let heights = air.strata.heights.windows(2);
            medium.layers.iter().zip(heights).map(|(layer, h)| of(layer) / (h[0] - h[1])).collect()
        };
        air.media.iter().map(of_medium).collect()
    };
    let extinction = per_metre(Layer::extinction);
    let scattering = per_metre(|layer| layer.scattering.iter().sum());

    // Radiances at the entries that are sampled.
    let mut cache = Lattices::default();
    let optics: Vec<Optics> = (sampling.solved.par_iter())
        .map(|i| Optics::new(&air.media[*i], &shells, settings.streams))
        .collect();
    let geometry: Vec<_> = optics.iter().map(|o| cache.of(&shells, o, &zeniths, settings.spherical)).collect();
    let solved: Vec<(Vec<Lit>, Field)> = (optics.par_iter().zip(&geometry))
        .map(|(optics, (_, rays))| solve_entry(optics, rays, false, settings.accuracy))
        .collect();
    let nodes = match needs.directional_sky && !sampling.solved.is_empty() {
        true => Some(Nodes::new()),
        false => None,
    };
    // Rays of the sky's nodes, by lattice.
    let sights: Vec<Vec<Sight>> = match &nodes {
        Some(nodes) => (cache.lattices.par_iter())
            .map(|lattice| nodes.sights(&shells, lattice, settings.streams))
            .collect(),
        None => Vec::new(),
    };
    let ground_nodes: Vec<Vec<f64>> = match &nodes {
        Some(_) => (optics.par_iter().zip(&geometry).zip(&solved))
            .map(|((optics, (lattice, _)), (_, ground))| {
                sights[*lattice].iter().map(|sight| gather_ground(optics, ground, sight, Look::Up)).collect()
            })
            .collect(),
        None => Vec::new(),
    };

    let middle = sampling.solved.len() / 2;
    let paths = needs.path && !sampling.solved.is_empty();
    let keep = needs.path_heights.map_or(f64::INFINITY, |(_, high)| 1.1 * high.max(0.0) + 100.0);
    let shared = Arc::new(Shared {
        shells,
        extinction,
        scattering,
        sampling,
        lattices: cache.lattices.iter().map(Arc::clone).collect(),
        entries: match paths {
            true => (optics.iter().zip(&geometry).zip(&solved))
                .map(|((optics, (lattice, _)), (_, ground))| {
                    let mut ground = ground.clone();
                    ground.keep_below(cache.lattices[*lattice].first_below(keep));
                    (optics.clone(), *lattice, ground)
                })
                .collect(),
            false => Vec::new(),
        },
        streams: settings.streams,
        notes: air.notes,
    });
    let mut places = 0..;
    let places: Vec<Option<usize>> = lit.iter().map(|lit| lit.then(|| places.next().unwrap_or(0))).collect();
    (suns.par_iter().zip(places))
        .map(|(sun, place)| -> Box<dyn SkyState> {
            let mut state = ColumnSkyState::dark(&shared, &air.solar, sun, n);
            if sun.is_up()
                && let Some(lengths) = shared.shells.towards_apparent(0.0, sun.apparent.zenith())
            {
                let through = |extinction: &Vec<f64>| {
                    let depth: f64 = lengths.iter().zip(extinction).map(|(s, beta)| s * beta).sum();
                    (-depth).exp()
                };
                state.transmittance = Spectrum::new(shared.extinction.iter().map(through).collect());
            }
            let Some(place) = place.filter(|_| diffuse) else { return Box::new(state) };
            let cosine = sun.apparent.cos_zenith().max(0.0);
            let mut black = vec![0.0; n]; // E_d over a black ground, E_s = 1
            let mut diffuse = vec![0.0; n];
            for i in 0..n {
                let (down, scaled, returned) = (fluxes[i].down[place], fluxes[i].direct[place], fluxes[i].returned);
                let beam = cosine * state.transmittance[i];
                black[i] = (down + cosine * scaled - beam).max(0.0);
                let albedo = air.albedo[i];
                let shining = albedo * (beam + black[i]) / (PI * (1.0 - albedo * returned));
                let e = state.solar[i];
                state.shining[i] = e * shining;
                diffuse[i] = e * (black[i] + shining * PI * returned);
            }
            state.diffuse = Spectrum::new(diffuse);
            state.black.clone_from(&black);
            if let Some(nodes) = &nodes {
                let fields: Vec<_> = (optics.iter().zip(&geometry).zip(&solved))
                    .map(|((optics, (lattice, rays)), (lit, _))| {
                        nodes.radiances(optics, &sights[*lattice], &lit[place], rays[place].zenith)
                    })
                    .collect();
                let (o, (l, _)) = (&optics[middle], &geometry[middle]);
                let lattice = &shared.lattices[*l];
                let shape = Shape::new(o, &shared.shells, lattice, &solved[middle].0[place], sun.true_zenith, &nodes.zeniths);
                state.put_sky(nodes, shape, &fields, &ground_nodes, &fluxes);
            }
            if paths {
                state.lit = (geometry.iter().zip(&solved))
                    .map(|((lattice, _), (lit, _))| {
                        lit[place].centre(shared.lattices[*lattice].first_below(keep))
                    })
                    .collect();
            }
            Box::new(state)
        })
        .collect()
}

/// Lattices, each once, with the rays to all suns.
#[derive(Default)]
struct Lattices {
    lattices: Vec<Arc<Lattice>>,
    rays: Vec<Vec<Arc<SunRays>>>,
}

impl Lattices {
    fn of(&mut self, shells: &Shells, optics: &Optics, zeniths: &[f64], spherical: bool) -> (usize, Vec<Arc<SunRays>>) {
        let known = self.lattices.iter().position(|lattice| lattice.serves(optics));
        let i = known.unwrap_or_else(|| {
            let lattice = Lattice::new(shells, optics);
            self.rays.push(
                (zeniths.par_iter())
                    .map(|zenith| Arc::new(SunRays::new(shells, &lattice, *zenith, spherical)))
                    .collect(),
            );
            self.lattices.push(Arc::new(lattice));
            self.lattices.len() - 1
        });
        (i, self.rays[i].clone())
    }
}

/// Fluxes of one entry at the ground, black, under suns of E_s = 1.
struct Fluxes {
    /// Diffuse, downwards, of each sun.
    down: Vec<f64>,
    /// T′ of each sun's scaled beam.
    direct: Vec<f64>,
    /// S: what a shining ground gets back.
    returned: f64,
}

impl Fluxes {
    fn new(optics: &Optics, suns: &[Arc<SunRays>], accuracy: f64) -> Self {
        let (lit, ground) = solve_entry(optics, suns, true, accuracy);
        let last = |field: &Field| field.down.last().copied().unwrap_or(0.0);
        Self {
            down: lit.iter().map(|lit| last(&lit.fields[0])).collect(),
            direct: lit.iter().map(Lit::direct).collect(),
            returned: last(&ground) / PI,
        }
    }
}

/// Which entries radiances are solved at, and how the rest draws on them.
struct Sampling {
    /// Indices of entries.
    solved: Vec<usize>,
    /// By entry: solved entries (by place) and their shares.
    shares: Vec<Vec<(usize, f64)>>,
}

/// Width of the windows in which entries of one absorption stand for each other \[µm\].
const WINDOW: f64 = 0.02;
/// Step in ln(1 + a/`SOFT`), a the absorption optical depth of the column.
const STEP: f64 = 0.5;
const SOFT: f64 = 0.05;

impl Sampling {
    fn new(air: &ColumnAir, every: bool) -> Self {
        let n = air.media.len();
        if every || n < 8 {
            return Self { solved: (0..n).collect(), shares: (0..n).map(|i| vec![(i, 1.0)]).collect() };
        }
        let absorbed: Vec<f64> = (air.media.iter())
            .map(|medium| (1.0 + medium.layers.iter().map(|l| l.absorption).sum::<f64>() / SOFT).ln())
            .collect();
        let window = |i: usize| (air.wavelengths[i] / WINDOW) as i64;
        let mut members: Vec<usize> = (0..n).collect();
        members.sort_by(|a, b| air.wavelengths[*a].total_cmp(&air.wavelengths[*b]).then(a.cmp(b)));
        let mut solved = Vec::new();
        // By window: its middle, and its solved entries by rising absorption.
        let mut windows: Vec<(f64, Vec<(f64, usize)>)> = Vec::new();
        for group in members.chunk_by(|a, b| window(*a) == window(*b)) {
            let (first, last) = (air.wavelengths[group[0]], air.wavelengths[group[group.len() - 1]]);
            let middle = 0.5 * (first + last);
            let reach = |f: fn(f64, f64) -> f64, start: f64| group.iter().map(|i| absorbed[*i]).fold(start, f);
            let (low, high) = (reach(f64::min, f64::INFINITY), reach(f64::max, 0.0));
            let steps = ((high - low) / STEP).ceil() as usize;
            let mut chosen: Vec<(f64, usize)> = Vec::new();
            for k in 0..=steps {
                let wanted = low + (high - low) * k as f64 / steps.max(1) as f64;
                // The nearest in absorption, and of those alike the one nearest the middle.
                let worth = |i: usize| {
                    (absorbed[i] - wanted).abs() / STEP + 2.0 * (air.wavelengths[i] - middle).abs() / WINDOW * 0.2
                };
                let best = group.iter().copied().min_by(|a, b| worth(*a).total_cmp(&worth(*b)));
                if let Some(best) = best
                    && !chosen.iter().any(|(_, i)| *i == best)
                {
                    chosen.push((absorbed[best], best));
                }
            }
            chosen.sort_by(|a, b| a.0.total_cmp(&b.0));
            let chosen = chosen.into_iter().map(|(a, i)| (a, { solved.push(i); solved.len() - 1 })).collect();
            windows.push((middle, chosen));
        }
        let shares = (0..n)
            .map(|i| {
                if let Some(place) = solved.iter().position(|s| *s == i) {
                    return vec![(place, 1.0)];
                }
                let wavelength = air.wavelengths[i];
                let right = windows.partition_point(|w| w.0 <= wavelength).clamp(1, windows.len().max(2) - 1);
                let pair = if windows.len() == 1 { 0..1 } else { right - 1..right + 1 };
                let mut shares = Vec::new();
                for (k, w) in windows[pair.clone()].iter().enumerate() {
                    let t = match pair.len() {
                        1 => 0.0,
                        _ => {
                            let (a, b) = (windows[pair.start].0, windows[pair.start + 1].0);
                            ((wavelength - a) / (b - a)).clamp(0.0, 1.0)
                        }
                    };
                    let share = if k == 0 { 1.0 - t } else { t };
                    if share == 0.0 {
                        continue;
                    }
                    let list = &w.1;
                    let j = list.partition_point(|(a, _)| *a <= absorbed[i]);
                    match (j.checked_sub(1).map(|j| list[j]), list.get(j)) {
                        (Some((a, p)), Some((b, q))) => {
                            let u = (absorbed[i] - a) / (b - a);
                            shares.extend([(p, share * (1.0 - u)), (*q, share * u)]);
                        }
                        (Some((_, p)), None) => shares.push((p, share)),
                        (None, Some((_, q))) => shares.push((*q, share)),
                        (None, None) => {}
                    }
                }
                shares
            })
            .collect();
        Self { solved, shares }
    }
}

/// Directions at which the sky is known: zenith angles by azimuths from the sun's, 0 and π among them. The zenith has one.
#[derive(Clone, Debug)]
struct Nodes {
    zeniths: Vec<f64>,
    azimuths: Vec<f64>,
}

/// Zenith angles \[deg\], denser where the air thickens.
const ZENITHS: [f64; 17] =
    [0.0, 8.0, 16.0, 24.0, 32.0, 40.0, 48.0, 55.0, 62.0, 68.0, 73.0, 77.5, 81.5, 85.0, 87.5, 89.2, 90.0];
const AZIMUTHS: usize = 13;
/// Azimuths at which light is gathered; between them a polynomial in cos Δφ.
const GATHERED: [f64; 5] = [0.0, PI / 4.0, PI / 2.0, 3.0 * PI / 4.0, PI];

impl Nodes {
    fn new() -> Self {
        Self {
            zeniths: ZENITHS.iter().map(|z| z.to_radians()).collect(),
            azimuths: (0..AZIMUTHS).map(|i| PI * i as f64 / (AZIMUTHS - 1) as f64).collect(),
        }
    }

    fn len(&self) -> usize {
        1 + (self.zeniths.len() - 1) * self.azimuths.len()
    }

    fn index(&self, zenith: usize, azimuth: usize) -> usize {
        if zenith == 0 { 0 } else { 1 + (zenith - 1) * self.azimuths.len() + azimuth }
    }

    fn sights(&self, shells: &Shells, lattice: &Lattice, streams: usize) -> Vec<Sight> {
        (self.zeniths.iter())
            .map(|z| Sight::new(shells, lattice, (0.0, *z), (shells.top(), f64::INFINITY), streams, streams))
            .collect()
    }

    /// L at every node, over a black ground and E_s = 1.
    fn radiances(&self, optics: &Optics, sights: &[Sight], lit: &Lit, sun: f64) -> Vec<f64> {
        let mut out = vec![0.0; self.len()];
        for (j, (zenith, sight)) in self.zeniths.iter().zip(sights).enumerate() {
            let gathered: Vec<Gathered> = (GATHERED.iter())
                .map(|azimuth| lit.gather(optics, sight, Look::Up, sun, *azimuth))
                .collect();
            for (k, azimuth) in self.azimuths.iter().enumerate().take(if j == 0 { 1 } else { AZIMUTHS }) {
                let mixed = Gathered::between(&gathered, &GATHERED, *azimuth);
                let cos = zenith.cos() * sun.cos() + zenith.sin() * sun.sin() * azimuth.cos();
                out[self.index(j, k)] = mixed.radiance(optics, cos, *azimuth);
            }
        }
        out
    }
}

/// What the sky looks like on the whole: single scattering by the column's mean phase function at one entry, with a constant
/// for the rest. What the nodes carry is the sky over this, which is smooth even at the sun and at the horizon.
#[derive(Clone, Debug)]
struct Shape {
    sun: WorldDir,
    /// Mean P + a constant, at scattering angles π (i/n)².
    halo: Vec<f64>,
    /// ln of what single scattering gathers, at zenith angles of even steps.
    thickness: Vec<f64>,
}

impl Shape {
    const HALO: usize = 240;
    const THICKNESS: usize = 90;

    fn new(optics: &Optics, shells: &Shells, lattice: &Lattice, lit: &Lit, sun: f64, zeniths: &[f64]) -> Self {
        let gather = |zenith: f64, orders: usize, azimuth: f64| {
            let sight =
                Sight::new(shells, lattice, (0.0, zenith), (shells.top(), f64::INFINITY), optics.streams(), orders);
            lit.gather(optics, &sight, Look::Up, sun, azimuth)
        };
        let thickness = (0..=Self::THICKNESS)
            .map(|i| {
                let zenith = FRAC_PI_2 * i as f64 / Self::THICKNESS as f64;
                let once: f64 = gather(zenith, 0, FRAC_PI_2).once.iter().sum();
                once.max(1e-300).ln()
            })
            .collect();
        // Light scattered more than once, against what is gathered of light scattered once, at a middle zenith angle.
        let typical = gather(zeniths[zeniths.len() / 2], 1, FRAC_PI_2);
        let once: f64 = typical.once.iter().sum();
        let more = if once > 0.0 { (typical.orders[0] / once).clamp(0.02, 50.0) } else { 1.0 };
        let halo = (0..=Self::HALO)
            .map(|i| {
                let cos = (PI * (i as f64 / Self::HALO as f64).powi(2)).cos();
                let once_here: f64 =
                    typical.once.iter().zip(&optics.phases).map(|(k, phase)| k * phase.value(cos)).sum();
                if once > 0.0 { once_here / once + more } else { 1.0 }
            })
            .collect();
        Self { sun: WorldDir::from_zenith_azimuth(sun, 0.0), halo, thickness }
    }

    /// At a zenith angle and an azimuth from the sun's.
    fn at(&self, zenith: f64, azimuth: f64) -> f64 {
        let angle = WorldDir::from_zenith_azimuth(zenith, azimuth).angle_to(self.sun);
        let halo = line(&self.halo, (angle / PI).max(0.0).sqrt() * Self::HALO as f64);
        halo * line(&self.thickness, zenith / FRAC_PI_2 * Self::THICKNESS as f64).exp()
    }
}

/// A broken line through values at whole numbers.
fn line(values: &[f64], x: f64) -> f64 {
    let i = (x.max(0.0) as usize).min(values.len() - 2);
    values[i] + (values[i + 1] - values[i]) * (x - i as f64).clamp(0.0, 1.0)
}

/// Cubic through four nodes about x: index of the first and shares.
fn cubic(nodes: &[f64], x: f64) -> (usize, [f64; 4]) {
    let i = nodes.partition_point(|node| *node <= x).clamp(2, nodes.len() - 2) - 2;
    let around: [f64; 4] = std::array::from_fn(|k| nodes[i + k]);
    let share = |k: usize| -> f64 {
        (0..4).filter(|j| *j != k).map(|j| (x - around[j]) / (around[k] - around[j])).product()
    };
    (i, std::array::from_fn(share))
}

/// What all suns share.
struct Shared {
    shells: Shells,
    /// Extinction and scattering \[m⁻¹\], by entry and layer.
    extinction: Vec<Vec<f64>>,
    scattering: Vec<Vec<f64>>,
    sampling: Sampling,
    lattices: Vec<Arc<Lattice>>,
    /// Solved entries: optics, lattice, and the field over a shining ground.
    entries: Vec<(Optics, usize, Field)>,
    streams: usize,
    notes: Vec<String>,
}

struct ColumnSkyState {
    shared: Arc<Shared>,
    sun: Sun,
    solar: Spectrum<Irradiance>,
    transmittance: Spectrum<Transmittance>,
    diffuse: Spectrum<Irradiance>,
    /// E_d over a black ground, E_s = 1.
    black: Vec<f64>,
    /// L_g.
    shining: Vec<f64>,
    terms: Vec<Spectrum<Radiance>>,
    sky: Option<(Nodes, Shape)>,
    /// Of the solved entries.
    lit: Vec<Lit>,
}

impl ColumnSkyState {
    fn dark(shared: &Arc<Shared>, solar: &[f64], sun: &Sun, n: usize) -> Self {
        Self {
            shared: Arc::clone(shared),
            sun: *sun,
            solar: Spectrum::new(solar.iter().map(|e| e * sun.distance.powi(-2)).collect()),
            transmittance: Spectrum::new(vec![0.0; n]),
            diffuse: Spectrum::new(vec![0.0; n]),
            black: vec![0.0; n],
            shining: vec![0.0; n],
            terms: Vec::new(),
            sky: None,
            lit: Vec::new(),
        }
    }

    /// Brings the radiances of the solved entries to every entry.
    fn put_sky(&mut self, nodes: &Nodes, shape: Shape, solved: &[Vec<f64>], ground: &[Vec<f64>], fluxes: &[Fluxes]) {
        let per_flux: Vec<f64> = (self.shared.sampling.solved.iter())
            .map(|i| if self.black[*i] > 0.0 { 1.0 / self.black[*i] } else { 0.0 })
            .collect();
        let per_return: Vec<f64> = (self.shared.sampling.solved.iter())
            .map(|i| if fluxes[*i].returned > 0.0 { 1.0 / fluxes[*i].returned } else { 0.0 })
            .collect();
        let mut terms = vec![Vec::with_capacity(self.black.len()); nodes.len()];
        for (i, shares) in self.shared.sampling.shares.iter().enumerate() {
            let (by_sun, by_ground) =
                (self.solar[i] * self.black[i], self.shining[i] * fluxes[i].returned);
            for j in 0..nodes.zeniths.len() {
                let from_ground: f64 =
                    shares.iter().map(|(p, share)| share * ground[*p][j] * per_return[*p]).sum::<f64>() * by_ground;
                for k in 0..if j == 0 { 1 } else { AZIMUTHS } {
                    let node = nodes.index(j, k);
                    let own: f64 = shares.iter().map(|(p, share)| share * solved[*p][node] * per_flux[*p]).sum();
                    terms[node].push(by_sun * own + from_ground);
                }
            }
        }
        for (j, zenith) in nodes.zeniths.iter().enumerate() {
            for (k, azimuth) in nodes.azimuths.iter().enumerate().take(if j == 0 { 1 } else { AZIMUTHS }) {
                let scale = 1.0 / shape.at(*zenith, *azimuth);
                terms[nodes.index(j, k)].iter_mut().for_each(|l| *l *= scale);
            }
        }
        self.terms = terms.into_iter().map(Spectrum::new).collect();
        self.sky = Some((nodes.clone(), shape));
    }
}

impl SkyState for ColumnSkyState {
    fn solar_irradiance(&self) -> &Spectrum<Irradiance> {
        &self.solar
    }

    fn sun_transmittance(&self) -> &Spectrum<Transmittance> {
        &self.transmittance
    }

    fn diffuse_irradiance(&self) -> &Spectrum<Irradiance> {
        &self.diffuse
    }

    fn sky_terms(&self) -> &[Spectrum<Radiance>] {
        &self.terms
    }

    fn sky_weights(&self, direction: WorldDir, weights: &mut Vec<(u32, f64)>) {
        weights.clear();
        let Some((nodes, shape)) = &self.sky else { return };
        if direction.cos_zenith() < 0.0 {
            return;
        }
        let zenith = direction.zenith();
        let turn = (direction.azimuth() - self.sun.apparent.azimuth()).rem_euclid(TAU);
        let azimuth = turn.min(TAU - turn);
        let scale = shape.at(zenith, azimuth);
        let (j, across) = cubic(&nodes.zeniths, zenith);
        // The sky is even about the sun's vertical plane.
        let step = PI / (AZIMUTHS - 1) as f64;
        let k = ((azimuth / step) as i64).min(AZIMUTHS as i64 - 2);
        let t = azimuth / step - k as f64;
        let along = [
            -t * (t - 1.0) * (t - 2.0) / 6.0,
            (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
            -(t + 1.0) * t * (t - 2.0) / 2.0,
            (t + 1.0) * t * (t - 1.0) / 6.0,
        ];
        let last = AZIMUTHS as i64 - 1;
        for (a, u) in across.into_iter().enumerate() {
            for (b, v) in along.into_iter().enumerate() {
                let mut place = (k - 1 + b as i64).abs();
                if place > last {
                    place = 2 * last - place;
                }
                let node = nodes.index(j + a, place as usize) as u32;
                let weight = scale * u * v;
                match weights.iter_mut().find(|(known, _)| *known == node) {
                    Some((_, sum)) => *sum += weight,
                    None => weights.push((node, weight)),
                }
            }
        }
    }

    fn notes(&self) -> Vec<String> {
        self.shared.notes.clone()
    }

    fn path(&self, path: &Path, transmittance: &mut [f64], radiance: &mut [f64]) {
        let shared = &*self.shared;
        let (low, high) = match path.target_height <= path.sensor_height {
            true => (path.target_height, path.sensor_height),
            false => (path.sensor_height, path.target_height),
        };
        let looks_down = path.target_height <= path.sensor_height;
        let towards = if looks_down { path.towards_sensor } else { -path.towards_sensor };
        let zenith = towards.zenith().min(FRAC_PI_2);
        // A path on the level rises with the Earth's curvature alone, and ends by its length.
        let end = if high - low > 1e-3 * path.length { high } else { f64::INFINITY };
        let length = if path.length > 0.0 { path.length } else { 0.0 };
        let sight_on = |lattice: &Lattice, orders: usize| {
            Sight::new(&shared.shells, lattice, (low, zenith), (end, length), shared.streams, orders)
        };
        radiance.fill(0.0);
        let bare = shared.shells.rising(low, zenith, end);
        let mut lengths = vec![0.0; shared.shells.heights.len() - 1];
        let mut rest = length;
        for stretch in &bare {
            let own = shared.shells.length(stretch, stretch.high).min(rest);
            lengths[stretch.layer] += own;
            rest -= own;
            if rest <= 0.0 {
                break;
            }
        }
        let crossed: Vec<(usize, f64)> = lengths.iter().copied().enumerate().filter(|(_, l)| *l > 0.0).collect();
        for (t, beta) in transmittance.iter_mut().zip(&shared.extinction) {
            *t = (-crossed.iter().map(|(layer, s)| beta[*layer] * s).sum::<f64>()).exp();
        }
        if self.lit.is_empty() {
            return;
        }
        let look = if looks_down { Look::Down } else { Look::Up };
        let turn = towards.azimuth() - self.sun.apparent.azimuth();
        // Between the directions in which light and beam travel.
        let between = if looks_down { turn + PI } else { turn };
        let sun = self.sun.true_zenith;
        let cos_sun = zenith.cos() * sun.cos() + zenith.sin() * sun.sin() * turn.cos();
        let cos_scattering = if looks_down { -cos_sun } else { cos_sun };
        let sights: Vec<Sight> = shared.lattices.iter().map(|lattice| sight_on(lattice, shared.streams)).collect();
        // L_u over the scattering optical depth of the path, for the sun and for a shining ground.
        let per_scattering: Vec<(f64, f64)> = (shared.entries.iter().zip(&self.lit))
            .map(|((optics, lattice, ground), lit)| {
                let sight = &sights[*lattice];
                let scattering: f64 = crossed.iter().map(|(layer, s)| optics.scattered(*layer) * s).sum();
                if scattering <= 0.0 {
                    return (0.0, 0.0);
                }
                let by_sun = lit.gather(optics, sight, look, sun, turn).radiance(optics, cos_scattering, between);
                (by_sun / scattering, gather_ground(optics, ground, sight, look).max(0.0) / scattering)
            })
            .collect();
        // Shares of logarithms: what absorbs more gathers less by orders of magnitude.
        let logs: Vec<(f64, f64)> =
            per_scattering.into_iter().map(|(a, b)| (a.max(1e-300).ln(), b.max(1e-300).ln())).collect();
        for (i, l) in radiance.iter_mut().enumerate() {
            let scattering: f64 = crossed.iter().map(|(layer, s)| shared.scattering[i][*layer] * s).sum();
            let (mut by_sun, mut by_ground) = (0.0, 0.0);
            for (place, share) in &shared.sampling.shares[i] {
                by_sun += share * logs[*place].0;
                by_ground += share * logs[*place].1;
            }
            *l = scattering * (self.solar[i] * by_sun.exp() + self.shining[i] * by_ground.exp());
        }
    }
}
