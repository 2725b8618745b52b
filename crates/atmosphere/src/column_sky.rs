//! The sky over a solved column: what the providers `layered` and `layers` answer.
//!
//! Fluxes and transmittances are solved at every entry of the grid. Radiances are solved for the columns of a [`Ladder`] and
//! carried over as shares: a direction of the sky as L/E_d, a path as L_u over what scatters along it. A share changes slowly
//! with wavelength and with the absorption of gases.
//!
//! ```text
//! L = L₀ + L_g G,   L_g = A (E_b + E_d0)/(π (1 − A S))      ground albedo A, without solving again [Chandrasekhar1960, ch. XI]
//! E_d = E_d0 + L_g π S
//! E_d0 = F↓ + E cos θ (T′ − T)                              what delta-M leaves in the beam is diffuse light
//! L_u = L_u′ + (τ₂′ − τ₂) L_behind                          and so is what it leaves on the line of sight
//! ```

use std::collections::HashMap;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI, TAU};
use std::sync::{Arc, OnceLock};

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use sunglint_radiometry::{Irradiance, Radiance, Spectrum, Transmittance, WorldDir};

use crate::ladder::{Ladder, Rung};
use crate::medium::{Layer, Medium, Strata};
use crate::phase::Phase;
use crate::radiance::{
    Basket, Bundle, Crossed, Fan, FieldSuns, Gathered, LANES, Lanes, Lattice, Look, Optics, Projected, Sight,
    SunDepths, SunRays, Turn, Weighed, arriving_at, gather, gather_ground, mix_azimuths, project, solve_entry,
};
use crate::ray::Shells;
use crate::solver::{Cut, Field, Solution};
use crate::wide::{exp, wide_too};
use crate::{Needs, Path, SkyState, Sun};

/// How a column is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Settings {
    pub streams: usize,
    pub spherical: bool,
    /// Azimuthal orders are added until what is left of the source is a smaller share of it.
    pub accuracy: f64,
}

/// Makes the columns at which radiances are solved from those of the entries.
pub(crate) type LadderOf = Box<dyn Fn(&[Medium]) -> Ladder>;

/// A column at every entry of a grid.
pub(crate) struct ColumnAir {
    pub strata: Strata,
    pub media: Vec<Medium>,
    /// Where radiances are solved; asked for if they are.
    pub ladder: LadderOf,
    /// E_s at 1 au.
    pub solar: Vec<f64>,
    /// Ground albedo, of each ground that the sky is wanted over.
    pub albedos: Vec<Vec<f64>>,
    /// What a plan is told.
    pub notes: Vec<String>,
}

/// Streams that fluxes alone are solved with.
const FLUX_STREAMS: usize = 8;
/// And columns that only tell what a gas changes.
const STREAMS_BESIDE: usize = 8;
/// A sun lower than this leaves the air dark \[rad\]: at 98° the zenith has lost all but 1e-4 of its light.
const DARK: f64 = 98.0 * PI / 180.0;

/// Solves a column under many suns: the skies by ground and sun.
pub(crate) fn solve(air: ColumnAir, suns: &[Sun], needs: &Needs, settings: &Settings) -> Vec<Vec<Box<dyn SkyState>>> {
    let shells = Shells::new(&air.strata, settings.spherical);
    let n = air.media.len();
    let lit: Vec<bool> = suns.iter().map(|sun| sun.true_zenith < DARK).collect();
    let zeniths: Vec<f64> = suns.iter().zip(&lit).filter(|(_, lit)| **lit).map(|(sun, _)| sun.true_zenith).collect();
    let diffuse = (needs.diffuse_irradiance || needs.directional_sky || needs.path) && !zeniths.is_empty();
    let directional = needs.directional_sky && diffuse;
    let paths = needs.path && diffuse;

    let fluxes: Vec<Fluxes> = if diffuse { fluxes(&air.media, &shells, &zeniths, settings) } else { Vec::new() };
    let ladder = match directional || paths {
        true => (air.ladder)(&air.media),
        false => {
            Ladder { columns: Vec::new(), shares: Vec::new(), reference: air.media[0].clone(), densest: Vec::new() }
        }
    };
    // One lattice for all columns.
    let mut cuts = vec![Cut { parts: 1, middles: false }; air.strata.heights.len() - 1];
    for medium in &ladder.densest {
        let wanted = Optics::new(medium, &shells, settings.streams, false).cuts();
        cuts.iter_mut().zip(wanted).for_each(|(cut, wanted)| *cut = cut.and(wanted));
    }
    let mut lattices = Lattices::default();
    let optics: Vec<Optics> = (ladder.columns.par_iter())
        .map(|Rung { medium, beside }| {
            let streams = if *beside { settings.streams.min(STREAMS_BESIDE) } else { settings.streams };
            Optics::with_cuts(medium, &shells, streams, &cuts)
        })
        .collect();
    let places: Vec<usize> = optics.iter().map(|optics| lattices.of(&shells, optics, &zeniths)).collect();
    let nodes = Nodes::new();
    let rays = if directional { nodes.rays(&shells, &lattices, zeniths.len(), settings.streams) } else { Vec::new() };
    let scattering = Scattering::new(&nodes, if directional { &zeniths } else { &[] }, &optics);
    let keep = needs.path_heights.map_or(f64::INFINITY, |(_, high)| 1.1 * high.max(0.0) + 100.0);
    let bundles: Vec<Solved> = (Bundle::of(optics, &places).into_par_iter())
        .map_init(Workspace::default, |workspace, (place, bundle)| {
            let (lattice, fields) = (&lattices.lattices[place], &lattices.fields[place]);
            let depths: Vec<SunDepths> = lattices.rays[place].iter().map(|sun| sun.depths(&bundle)).collect();
            let (level, row) = lattice.starts_at(lattice.first_below(keep));
            let mut solved = Solved { bundle, lattice: place, skies: Vec::new(), lit: Vec::new(), grounds: Vec::new() };
            if paths {
                let of_sun = |depths: &SunDepths| (depths.below(level), Vec::with_capacity(LANES));
                solved.lit = depths.iter().map(of_sun).collect();
            }
            for (lane, optics) in solved.bundle.columns.iter().enumerate() {
                solve_entry(optics, fields, settings.accuracy, &mut workspace.solution);
                if directional {
                    solved.skies.push(nodes.draw(&rays[place], &lattices, place, (lane, optics), workspace));
                }
                if paths {
                    let Solution { beams, ground } = &workspace.solution;
                    for (i, ((_, lit), sun)) in solved.lit.iter_mut().zip(&zeniths).enumerate() {
                        lit.push(fields.field_of(beams, i, *sun, row));
                    }
                    solved.grounds.push(Field::mixed(std::slice::from_ref(ground), &[1.0], row));
                }
            }
            if directional {
                nodes.gather(&rays[place], &scattering, &solved.bundle, &depths, workspace, &mut solved.skies);
            }
            solved
        })
        .collect();
    let shapes: Vec<Shape> = match directional {
        true => Shape::of_suns(&ladder.reference, &shells, &zeniths, settings),
        false => Vec::new(),
    };
    let mut skies = Vec::new();
    let mut by_sun: Vec<Vec<LitBundle>> = vec![Vec::new(); zeniths.len()];
    let mut grounds = Vec::new();
    for solved in bundles {
        skies.extend(solved.skies);
        by_sun.iter_mut().zip(solved.lit).for_each(|(all, lit)| all.push(lit));
        if paths {
            grounds.push((solved.bundle, solved.lattice, solved.grounds));
        }
    }

    let per_metre = |of: fn(&Layer) -> f64| -> Vec<Vec<f64>> {
        let of_medium = |medium: &Medium| {
            let heights = air.strata.heights.windows(2);
            medium.layers.iter().zip(heights).map(|(layer, h)| of(layer) / (h[0] - h[1])).collect()
        };
        air.media.iter().map(of_medium).collect()
    };
    let shared = Arc::new(Shared {
        extinction: per_metre(Layer::extinction),
        scattering: per_metre(|layer| layer.scattering.iter().sum()),
        peak: fluxes.iter().map(|flux| flux.peak.clone()).collect(),
        shares: ladder.shares,
        lattices: lattices.lattices,
        grounds,
        streams: settings.streams,
        usual: ladder.reference.layers.iter().map(|layer| layer.scattering.iter().sum()).collect(),
        notes: air.notes,
        shells,
    });
    let by_sun: Vec<Arc<Vec<LitBundle>>> = by_sun.into_iter().map(Arc::new).collect();
    let mut next = 0..;
    let places: Vec<Option<usize>> = lit.iter().map(|lit| lit.then(|| next.next().unwrap_or(0))).collect();
    // By sun and ground.
    let states: Vec<Vec<ColumnSkyState>> = (suns.par_iter().zip(&places))
        .map(|(sun, place)| {
            let mut dark = ColumnSkyState::dark(&shared, &air.solar, sun, n);
            if sun.is_up()
                && let Some(lengths) = shared.shells.towards_apparent(0.0, sun.apparent.zenith())
            {
                let through = |extinction: &Vec<f64>| {
                    let depth: f64 = lengths.iter().zip(extinction).map(|(s, beta)| s * beta).sum();
                    (-depth).exp()
                };
                dark.transmittance = Spectrum::new(shared.extinction.iter().map(through).collect());
            }
            let mut states = vec![dark; air.albedos.len()];
            let Some(place) = place.filter(|_| diffuse) else { return states };
            for (state, albedo) in states.iter_mut().zip(&air.albedos) {
                state.put_fluxes(&fluxes, place, albedo);
                state.lit = Arc::clone(&by_sun[place]);
            }
            if directional {
                put_sky(&mut states, &nodes, &shapes[place], &skies, place, &fluxes);
            }
            states
        })
        .collect();
    let mut by_ground: Vec<Vec<Box<dyn SkyState>>> =
        air.albedos.iter().map(|_| Vec::with_capacity(suns.len())).collect();
    for states in states {
        by_ground.iter_mut().zip(states).for_each(|(of_ground, state)| of_ground.push(Box::new(state)));
    }
    by_ground
}

/// About how many bytes one solved sky keeps at `n` entries: terms at the nodes, and for lines of sight the fields of the
/// columns, all entries' own where radiances are solved `everywhere`, and sources near the ground. With what the layers have at
/// each entry, since every time may have its own air.
pub(crate) fn sky_bytes(n: usize, everywhere: bool, needs: &Needs) -> usize {
    /// Spectra, those of the layers included.
    const SPECTRA: usize = 5 + 3 * 32;
    /// Columns of a ladder, values of a field with its depths to the sun up to a kilometre and further, and directions near the
    /// ground that a view asks for.
    const COLUMNS: usize = 64;
    const FIELD: [usize; 2] = [2048, 7168];
    const NEAR: usize = 64;
    let nodes = 2 * (1 + (ZENITHS.len() - 1) * AZIMUTHS.len());
    let sky = if needs.directional_sky { n * nodes } else { 0 };
    let near = (NEAR_ZENITHS + 1) * NEAR_AZIMUTHS * size_of::<OnceLock<Vec<Source>>>();
    let columns = if everywhere { n } else { COLUMNS };
    let is_high = needs.path_heights.is_none_or(|(_, high)| high > 1e3);
    let path = if needs.path { columns * FIELD[usize::from(is_high)] + 2 * n * NEAR } else { 0 };
    size_of::<f64>() * (n * SPECTRA + sky + path) + near
}

/// Where columns are solved one after another.
#[derive(Default)]
struct Workspace {
    solution: Solution,
    weighed: Vec<Weighed>,
    /// By ray and field.
    projected: Vec<Vec<Projected>>,
    /// By ray.
    crossed: Vec<Crossed>,
    /// By azimuth, and mixed for another.
    gathered: Basket,
    mixed: Gathered,
}

/// A bundle under one sun: depths towards it, and the field of each column.
type LitBundle = (SunDepths, Vec<Field>);

/// Columns of the ladder, solved.
struct Solved {
    bundle: Bundle,
    lattice: usize,
    /// By column; nothing where none is asked for.
    skies: Vec<NodeSky>,
    /// By sun, each by column, and over a ground that shines, as far up as paths reach; nothing where none are asked for.
    lit: Vec<LitBundle>,
    grounds: Vec<Field>,
}

/// Lattices, each once, with the rays to all suns.
#[derive(Default)]
struct Lattices {
    lattices: Vec<Arc<Lattice>>,
    rays: Vec<Vec<SunRays>>,
    fields: Vec<FieldSuns>,
}

impl Lattices {
    /// The place of the one that serves a column.
    fn of(&mut self, shells: &Shells, optics: &Optics, zeniths: &[f64]) -> usize {
        if let Some(known) = self.lattices.iter().position(|lattice| lattice.serves(optics)) {
            return known;
        }
        let lattice = Lattice::new(shells, optics);
        self.rays.push(zeniths.par_iter().map(|zenith| SunRays::new(shells, &lattice, *zenith)).collect());
        self.fields.push(FieldSuns::new(shells, &lattice, zeniths, false));
        self.lattices.push(Arc::new(lattice));
        self.lattices.len() - 1
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
    /// Extinction that delta-M takes for none \[m⁻¹\], by layer.
    peak: Vec<f64>,
}

fn fluxes(media: &[Medium], shells: &Shells, zeniths: &[f64], settings: &Settings) -> Vec<Fluxes> {
    let streams = settings.streams.max(FLUX_STREAMS);
    let first = Optics::new(&media[0], shells, streams, true);
    let lattice = Lattice::new(shells, &first);
    let suns = FieldSuns::new(shells, &lattice, zeniths, true);
    (media.par_iter())
        .map(|medium| {
            let optics = Optics::new(medium, shells, streams, true);
            let arriving = arriving_at(&optics, &suns);
            Fluxes {
                down: arriving.beams,
                direct: suns.to_ground(&optics),
                returned: arriving.ground / PI,
                peak: optics.extinction.iter().zip(&optics.scaled).map(|(all, scaled)| all - scaled).collect(),
            }
        })
        .collect()
}

/// Directions at which the sky is known: zenith angles by azimuths from the sun's, 0 and π among them. The zenith has one.
#[derive(Clone, Debug)]
pub(crate) struct Nodes {
    zeniths: Vec<f64>,
    azimuths: Vec<f64>,
    /// Both again, as [`of_zenith`] and [`of_azimuth`].
    by_zenith: Axis,
    by_azimuth: Axis,
}

/// √(1 − cos θ) of a zenith angle's cosine, 0 at the zenith and 1 at the horizon: in proportion to the angle near the zenith, and
/// told without a trigonometric function.
fn of_zenith(cos_zenith: f64) -> f64 {
    (1.0 - cos_zenith).max(0.0).sqrt()
}

/// sin(Δφ/2) of the cosine of an azimuth from the sun's: in proportion to the azimuth about the sun, whose peak is no parabola.
fn of_azimuth(cos_azimuth: f64) -> f64 {
    (0.5 * (1.0 - cos_azimuth)).max(0.0).sqrt()
}

/// Rising places from 0 to 1 between which values run straight.
#[derive(Clone, Debug)]
struct Axis {
    places: Vec<f64>,
    /// The last place at or before each of even steps from 0 to 1.
    starts: Vec<usize>,
}

impl Axis {
    const STEPS: usize = 256;

    fn new(places: Vec<f64>) -> Self {
        let last = places.len() - 2;
        let start = |i: usize| {
            let x = i as f64 / Self::STEPS as f64;
            places.partition_point(|place| *place <= x).saturating_sub(1).min(last)
        };
        Self { starts: (0..=Self::STEPS).map(start).collect(), places }
    }

    /// The place before x and the share of the next.
    #[inline]
    fn between(&self, x: f64) -> (usize, f64) {
        let mut i = self.starts[((x * Self::STEPS as f64) as usize).min(Self::STEPS)];
        while i + 2 < self.places.len() && self.places[i + 1] <= x {
            i += 1;
        }
        let (low, high) = (self.places[i], self.places[i + 1]);
        (i, ((x - low) / (high - low)).clamp(0.0, 1.0))
    }
}

/// Zenith angles \[deg\], denser where the air thickens.
const ZENITHS: [f64; 20] = [
    0.0, 7.0, 14.0, 21.0, 28.0, 35.0, 42.0, 49.0, 55.0, 61.0, 66.0, 70.0, 73.5, 77.0, 80.0, 82.6, 85.0, 87.0, 88.6,
    90.0,
];
/// Azimuths from the sun's \[deg\], denser about it.
const AZIMUTHS: [f64; 15] =
    [0.0, 4.0, 9.0, 16.0, 25.0, 36.0, 48.0, 62.0, 77.0, 93.0, 110.0, 127.0, 145.0, 162.0, 180.0];
/// Azimuths at which light is gathered; between them a polynomial in cos Δφ. The fewer serve the less a ray sees the sun
/// change along its way.
pub(crate) const GATHERED: [&[f64]; 4] =
    [&[0.0], &[0.0, PI], &[0.0, PI / 2.0, PI], &[0.0, PI / 4.0, PI / 2.0, 3.0 * PI / 4.0, PI]];

/// A node nearer to the sun counts as one this far from it \[rad\]: the tip of a peak tells little of what lies around it.
const TIP: f64 = 1.7 * PI / 180.0;

/// Share of the slowly varying light that the halo is counted against beside what the beam gives.
const BESIDE: f64 = 0.1;

/// Shares of gathered azimuths at another.
pub(crate) fn azimuth_shares(gathered: &[f64], azimuth: f64) -> Vec<f64> {
    let x = azimuth.cos();
    let share = |i: usize| -> f64 {
        let others = gathered.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, a)| (x - a.cos()) / (gathered[i].cos() - a.cos())).product()
    };
    (0..gathered.len()).map(share).collect()
}

impl Nodes {
    fn new() -> Self {
        Self {
            zeniths: ZENITHS.iter().map(|z| z.to_radians()).collect(),
            azimuths: AZIMUTHS.iter().map(|a| a.to_radians()).collect(),
            by_zenith: Axis::new(ZENITHS.iter().map(|z| of_zenith(z.to_radians().cos())).collect()),
            by_azimuth: Axis::new(AZIMUTHS.iter().map(|a| of_azimuth(a.to_radians().cos())).collect()),
        }
    }

    fn len(&self) -> usize {
        1 + (self.zeniths.len() - 1) * self.azimuths.len()
    }

    fn index(&self, zenith: usize, azimuth: usize) -> usize {
        if zenith == 0 { 0 } else { 1 + (zenith - 1) * self.azimuths.len() + azimuth }
    }

    /// Azimuths of a ring of nodes.
    fn ring(&self, zenith: usize) -> &[f64] {
        if zenith == 0 { &self.azimuths[..1] } else { &self.azimuths }
    }

    /// Which of [`GATHERED`] serve light from a zenith angle under a sun \[rad\]: on a flat Earth every azimuth has the same
    /// suns. Beyond 78° light is told apart by the place it comes from, and only the sun's own depths have to follow.
    pub(crate) fn gathered(round: bool, zenith: f64, sun: f64) -> usize {
        let (zenith, sun) = (zenith.to_degrees(), sun.to_degrees());
        let told_apart = zenith >= 80.0;
        if !round || zenith == 0.0 {
            0
        } else if sun <= 60.0 || told_apart && sun <= 80.0 {
            1
        } else if sun <= 75.0 || told_apart && sun <= 86.0 || zenith < 72.0 {
            2
        } else {
            3
        }
    }

    /// Rays to the nodes and their suns, by lattice and zenith angle.
    fn rays(&self, shells: &Shells, lattices: &Lattices, suns: usize, streams: usize) -> Vec<Vec<NodeRay>> {
        (lattices.lattices.par_iter().enumerate())
            .map(|(l, lattice)| {
                let all = (shells.top(), f64::INFINITY);
                (self.zeniths.iter().enumerate())
                    .map(|(j, zenith)| {
                        let sight = Sight::new(shells, lattice, Look::Up, (0.0, *zenith), all, streams, streams);
                        let fan = |sun: usize| {
                            let rays = &lattices.rays[l][sun];
                            let set = Self::gathered(shells.is_round(), *zenith, rays.zenith);
                            (Fan::new(&sight, rays, &lattices.fields[l], sun, GATHERED[set]), set)
                        };
                        let fans = (0..suns).map(fan).collect();
                        let mixes = GATHERED.map(|set| self.ring(j).iter().map(|a| azimuth_shares(set, *a)).collect());
                        NodeRay { sight, fans, mixes }
                    })
                    .collect()
            })
            .collect()
    }

    /// Draws light from the solved fields of the column in a lane, for [`Self::gather`]; gives its sky with what no sun has
    /// to be gathered for.
    fn draw(
        &self,
        rays: &[NodeRay],
        lattices: &Lattices,
        lattice: usize,
        (lane, optics): (usize, &Optics),
        Workspace { solution, weighed, projected, crossed, .. }: &mut Workspace,
    ) -> NodeSky {
        let (suns, fields) = (&lattices.rays[lattice], &lattices.fields[lattice]);
        weighed.resize_with(rays.len(), Weighed::default);
        crossed.resize_with(rays.len(), Crossed::default);
        let starts = solution.starts();
        for ((weighed, crossed), NodeRay { sight, .. }) in weighed.iter_mut().zip(crossed).zip(rays) {
            weighed.weigh(optics, sight, &starts, fields.draws_by_place(sight));
            crossed.take(weighed, lane);
        }
        project(weighed, &solution.beams, lane, projected);
        NodeSky {
            by_sun: vec![vec![[0.0; 2]; self.len()]; suns.len()],
            by_ground: weighed.iter().map(|weighed| gather_ground(weighed, &solution.ground)).collect(),
            black: (suns.iter().enumerate())
                .map(|(i, sun)| {
                    let direct = sun.to_ground(&optics.scaled) - sun.to_ground(&optics.extinction);
                    fields.ground_flux(&solution.beams, i, sun.zenith) + sun.zenith.cos().max(0.0) * direct
                })
                .collect(),
            returned: solution.ground.arrives / PI,
        }
    }

    /// Puts the light of the suns into the skies of columns at the nodes.
    fn gather(
        &self,
        rays: &[NodeRay],
        scattering: &Scattering,
        bundle: &Bundle,
        depths: &[SunDepths],
        Workspace { projected, crossed, gathered, mixed, .. }: &mut Workspace,
        skies: &mut [NodeSky],
    ) {
        let phases = scattering.values(bundle);
        for (j, (NodeRay { sight, fans, mixes }, crossed)) in rays.iter().zip(crossed).enumerate() {
            for (i, ((fan, set), depths)) in fans.iter().zip(depths).enumerate() {
                gather(bundle, sight, crossed, fan, depths, &projected[j], gathered);
                for (k, mix) in mixes[*set].iter().enumerate() {
                    let node = self.index(j, k);
                    let place = i * self.len() + node;
                    let one = if let [one] = gathered.all.as_slice() {
                        one
                    } else {
                        mix_azimuths(&gathered.all, mix, mixed);
                        &*mixed
                    };
                    let [smooth, peaked] = one.parts_of(bundle, |phase| phases[phase][place], &scattering.turns[place]);
                    for (lane, sky) in skies.iter_mut().enumerate() {
                        sky.by_sun[i][node] = [smooth[lane].max(0.0), peaked[lane].max(0.0)];
                    }
                }
            }
        }
    }
}

/// The scattering angles at the nodes, and the tables there of phase functions that many columns mix.
struct Scattering {
    /// By sun and node.
    turns: Vec<Turn>,
    /// By address.
    tables: HashMap<usize, Vec<f64>>,
}

impl Scattering {
    fn new(nodes: &Nodes, zeniths: &[f64], optics: &[Optics]) -> Self {
        let mut turns = Vec::with_capacity(zeniths.len() * nodes.len());
        for sun in zeniths {
            for (j, zenith) in nodes.zeniths.iter().enumerate() {
                let cosine = |azimuth: f64| cosine_between((*zenith, *sun), azimuth).min(TIP.cos());
                turns.extend(nodes.ring(j).iter().map(|azimuth| Turn::new(cosine(*azimuth), *azimuth)));
            }
        }
        let mut tables = HashMap::new();
        for (_, part) in optics.iter().flat_map(|optics| &optics.phases).flat_map(Phase::parts) {
            if part.is_table() {
                let values = || turns.iter().map(|turn| part.value(turn.cos_scattering)).collect();
                tables.entry(Arc::as_ptr(&part) as usize).or_insert_with(values);
            }
        }
        Self { turns, tables }
    }

    /// P of each phase function of the columns at every angle.
    fn values(&self, bundle: &Bundle) -> Vec<Vec<Lanes>> {
        let most = bundle.columns.iter().map(|column| column.phases.len()).max().unwrap_or(0);
        let mut values = vec![vec![[0.0; LANES]; self.turns.len()]; most];
        // What is in no table, by address.
        let mut computed: HashMap<usize, Vec<f64>> = HashMap::new();
        for (lane, column) in bundle.columns.iter().enumerate() {
            for (sums, phase) in values.iter_mut().zip(&column.phases) {
                // In the column's own order, whatever columns stand beside it.
                for (share, part) in phase.parts() {
                    let address = Arc::as_ptr(&part) as usize;
                    let known = self.tables.get(&address);
                    let at_turns = || self.turns.iter().map(|turn| part.value(turn.cos_scattering)).collect();
                    let table = known.unwrap_or_else(|| computed.entry(address).or_insert_with(at_turns));
                    sums.iter_mut().zip(table).for_each(|(sum, p)| sum[lane] += share * p);
                }
            }
        }
        values
    }
}

/// A ray to a ring of nodes: its suns, and what each node takes of the azimuths that are gathered.
struct NodeRay {
    sight: Sight,
    /// Each with the azimuths that are gathered.
    fans: Vec<(Fan, usize)>,
    mixes: [Vec<Vec<f64>>; GATHERED.len()],
}

/// Of the angle between two directions of these zenith angles, `azimuth` apart.
fn cosine_between((a, b): (f64, f64), azimuth: f64) -> f64 {
    a.cos() * b.cos() + a.sin() * b.sin() * azimuth.cos()
}

/// The sky of one column at the nodes, E_s = 1.
struct NodeSky {
    /// L over a black ground, by sun and node: what varies slowly, and what peaked scatterers make of the beam.
    by_sun: Vec<Vec<[f64; 2]>>,
    /// L of a ground of radiance 1, by zenith angle.
    by_ground: Vec<f64>,
    /// E_d over a black ground, by sun.
    black: Vec<f64>,
    /// S.
    returned: f64,
}

/// What the sky looks like on the whole, by the column of reference: the light that varies slowly over it, and the light of
/// the beam that peaked scatterers turn, whose phase function is taken apart. What the nodes carry is either part over this,
/// which varies little even at the sun and at the horizon.
#[derive(Clone, Debug)]
struct Shape {
    sun: WorldDir,
    /// What peaked scatterers make of the beam, by scattering angle Θ: where sin(Θ/2) = (i/n)²; empty where there are none.
    halo: Vec<f64>,
    /// ln of either part (the peaked one without its P), by azimuth 0, π/2, π and in even steps of [`of_zenith`].
    parts: [[Vec<f64>; 3]; 2],
}

impl Shape {
    const AZIMUTHS: [f64; 3] = [0.0, FRAC_PI_2, PI];
    const HALO: usize = 360;
    const STEPS: usize = 112;

    /// Of each sun, from one column.
    fn of_suns(medium: &Medium, shells: &Shells, zeniths: &[f64], settings: &Settings) -> Vec<Self> {
        let optics = Optics::new(medium, shells, settings.streams, false);
        let mut lattices = Lattices::default();
        lattices.of(shells, &optics, zeniths);
        let (lattice, fields) = (&lattices.lattices[0], &lattices.fields[0]);
        let mut solution = Solution::default();
        solve_entry(&optics, fields, settings.accuracy, &mut solution);
        let (all, starts) = ((shells.top(), f64::INFINITY), solution.starts());
        let rays: Vec<(f64, Sight, Crossed, Vec<Projected>)> = (0..=Self::STEPS)
            .into_par_iter()
            .map(|i| {
                // The inverse of `of_zenith`.
                let zenith = (2.0 * (i as f64 / Self::STEPS as f64 * FRAC_1_SQRT_2).asin()).min(FRAC_PI_2);
                let streams = settings.streams;
                let sight = Sight::new(shells, lattice, Look::Up, (0.0, zenith), all, streams, streams);
                let weighed = [Weighed::new(&optics, &sight, &starts, fields.draws_by_place(&sight))];
                let (mut projected, mut crossed) = (Vec::new(), Crossed::default());
                project(&weighed, &solution.beams, 0, &mut projected);
                crossed.take(&weighed[0], 0);
                (zenith, sight, crossed, projected.remove(0))
            })
            .collect();
        let bundle = Bundle::new(vec![optics]);
        (zeniths.par_iter().enumerate())
            .map(|(s, sun)| {
                let own = &lattices.rays[0][s];
                let depths = own.depths(&bundle);
                let mut parts: [[Vec<f64>; 3]; 2] = Default::default();
                let (mut halo, mut basket, mut mixed) = (Vec::new(), Basket::default(), Gathered::default());
                for (zenith, sight, crossed, projected) in &rays {
                    // Three serve a shape whatever the sun.
                    let set = GATHERED[Nodes::gathered(shells.is_round(), *zenith, *sun).min(2)];
                    let fan = Fan::new(sight, own, fields, s, set);
                    gather(&bundle, sight, crossed, &fan, &depths, projected, &mut basket);
                    let all = &basket.all;
                    for (a, azimuth) in Self::AZIMUTHS.into_iter().enumerate() {
                        mix_azimuths(all, &azimuth_shares(set, azimuth), &mut mixed);
                        let gathered = &mixed;
                        let cos = cosine_between((*zenith, *sun), azimuth);
                        let [smooth, _] = gathered.parts(&bundle, cos, azimuth).map(|lanes| lanes[0]);
                        let peaked: f64 = gathered.of_peaked(&bundle).map(|(k, _)| k).sum();
                        parts[0][a].push(smooth.max(1e-300).ln());
                        // Where the beam is all but gone at this wavelength it need not be at others.
                        parts[1][a].push((peaked + BESIDE * smooth.max(0.0)).max(1e-300).ln());
                    }
                    // At the height of the sun, where the halo counts.
                    let has_halo = all[0].of_peaked(&bundle).any(|(k, _)| k > 0.0);
                    if halo.is_empty() && has_halo && *zenith >= sun.min(88f64.to_radians()) {
                        let at = |i: usize| 1.0 - 2.0 * (i as f64 / Self::HALO as f64).powi(4);
                        halo = (0..=Self::HALO).map(|i| all[0].halo(&bundle, at(i))).collect();
                    }
                }
                Self { sun: WorldDir::from_zenith_azimuth(*sun, 0.0), halo, parts }
            })
            .collect()
    }

    /// Both parts at a zenith angle and an azimuth from the sun's, the angle from the sun being no less than `least` \[rad\];
    /// the second is nothing without peaked scatterers.
    fn outside(&self, zenith: f64, azimuth: f64, least: f64) -> [f64; 2] {
        let from_sun = WorldDir::from_zenith_azimuth(zenith, azimuth).vec() - self.sun.vec();
        let chord = from_sun.length().max(2.0 * (0.5 * least).sin());
        self.towards(of_zenith(zenith.cos()), azimuth.cos(), chord)
    }

    /// The same at a place among zenith angles, a cosine of the azimuth from the sun's, and a chord 2 sin(Θ/2) from the sun.
    fn towards(&self, zenith: f64, c: f64, chord: f64) -> [f64; 2] {
        let x = zenith * Self::STEPS as f64;
        // Through cos Δφ = 1, 0, −1.
        let shares = [0.5 * c * (c + 1.0), 1.0 - c * c, 0.5 * c * (c - 1.0)];
        let part = |part: &[Vec<f64>; 3]| -> f64 {
            part.iter().zip(shares).map(|(values, share)| share * line(values, x)).sum::<f64>().exp()
        };
        if self.halo.is_empty() {
            return [part(&self.parts[0]), 0.0];
        }
        let halo = line(&self.halo, (0.5 * chord).sqrt() * Self::HALO as f64);
        [part(&self.parts[0]), halo * part(&self.parts[1])]
    }
}

/// What a column gives at the nodes, and its logarithms: columns are mixed as Π valueˢʰᵃʳᵉ, as a sum where a value is not
/// positive.
struct Shares {
    values: Vec<f64>,
    /// NaN where a value is not positive; none where no columns are mixed.
    logs: Vec<f64>,
}

impl Shares {
    fn new(values: impl Iterator<Item = f64>, mixed: bool) -> Self {
        let values: Vec<f64> = values.collect();
        let log = |value: &f64| if *value > 1e-290 { value.ln() } else { f64::NAN };
        Self { logs: if mixed { values.iter().map(log).collect() } else { Vec::new() }, values }
    }
}

wide_too! {
    /// Columns mixed by shares that add up to 1.
    fn mix(columns: &[Shares], shares: &[(usize, f64)], out: &mut Vec<f64>) {
        out.clear();
        if let [(column, _)] = shares {
            out.extend(&columns[*column].values);
            return;
        }
        out.resize(columns[0].logs.len(), 0.0);
        for (c, share) in shares {
            out.iter_mut().zip(&columns[*c].logs).for_each(|(sum, log)| *sum += share * log);
        }
        let mut all_positive = true;
        for value in &mut *out {
            all_positive &= !value.is_nan();
            *value = exp(*value);
        }
        if all_positive {
            return;
        }
        for (node, value) in out.iter_mut().enumerate().filter(|(_, value)| value.is_nan()) {
            *value = shares.iter().map(|(c, share)| share * columns[*c].values[node]).sum();
        }
    }
}

/// A broken line through values at whole numbers.
fn line(values: &[f64], x: f64) -> f64 {
    let i = (x.max(0.0) as usize).min(values.len() - 2);
    values[i] + (values[i + 1] - values[i]) * (x - i as f64).clamp(0.0, 1.0)
}

/// What all suns share.
struct Shared {
    shells: Shells,
    /// Extinction and scattering \[m⁻¹\], by entry and layer.
    extinction: Vec<Vec<f64>>,
    scattering: Vec<Vec<f64>>,
    /// Of that, what delta-M leaves in its direction.
    peak: Vec<Vec<f64>>,
    /// By entry: columns and their shares.
    shares: Vec<Vec<(usize, f64)>>,
    lattices: Vec<Arc<Lattice>>,
    /// Of the columns, bundle by bundle: optics, lattice, and the fields over a shining ground.
    grounds: Vec<(Bundle, usize, Vec<Field>)>,
    streams: usize,
    /// Scattering optical depth of each layer at the wavelength of reference.
    usual: Vec<f64>,
    notes: Vec<String>,
}

#[derive(Clone)]
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
    /// Of the columns, bundle by bundle.
    lit: Arc<Vec<LitBundle>>,
    /// What the air at the ground sends into directions, as far as they were asked for, at every entry.
    near: Vec<OnceLock<Vec<Source>>>,
}

/// Short paths near the ground take their light from directions so far apart, of zenith angle and azimuth.
const NEAR_ZENITHS: usize = 72;
const NEAR_AZIMUTHS: usize = 72;
/// A path is short and near the ground up to this height and length \[m\], and this optical depth at any entry's
/// scattering.
const NEAR_HEIGHT: f64 = 60.0;
const NEAR_LENGTH: f64 = 600.0;
const NEAR_DEPTH: f64 = 0.1;

/// Entries whose nodes are put together.
const TOGETHER: usize = 8;

/// Brings the radiances of the columns to every entry, under one sun over several grounds.
fn put_sky(
    states: &mut [ColumnSkyState],
    nodes: &Nodes,
    shape: &Shape,
    skies: &[NodeSky],
    place: usize,
    fluxes: &[Fluxes],
) {
    let Some(first) = states.first() else { return };
    let shared = Arc::clone(&first.shared);
    let parts = if shape.halo.is_empty() { 1 } else { 2 };
    let per = |x: f64| if x > 1e-200 { 1.0 / x } else { 0.0 };
    // L/E_d and L_g-light/S of the columns: by the sun at every node, part by part; by the ground at every zenith angle.
    let mixed = shared.shares.iter().any(|shares| shares.len() > 1);
    let by_sun: Vec<Shares> = (skies.iter())
        .map(|sky| Shares::new(sky.by_sun[place].iter().flatten().map(|l| l * per(sky.black[place])), mixed))
        .collect();
    let by_ground: Vec<Shares> =
        skies.iter().map(|sky| Shares::new(sky.by_ground.iter().map(|l| l * per(sky.returned)), mixed)).collect();
    // Over the whole, by node and part.
    let mut scales = vec![0.0; parts * nodes.len()];
    for (j, zenith) in nodes.zeniths.iter().enumerate() {
        for (k, azimuth) in nodes.ring(j).iter().enumerate() {
            let outside = shape.outside(*zenith, *azimuth, TIP);
            (0..parts).for_each(|part| scales[part * nodes.len() + nodes.index(j, k)] = per(outside[part]));
        }
    }
    let mut terms: Vec<Vec<Vec<f64>>> = states.iter().map(|_| vec![vec![0.0; fluxes.len()]; scales.len()]).collect();
    let mut together = vec![(Vec::new(), Vec::new()); TOGETHER];
    for (chunk, some) in shared.shares.chunks(TOGETHER).enumerate() {
        for ((of_sun, of_ground), shares) in together.iter_mut().zip(some) {
            mix(&by_sun, shares, of_sun);
            mix(&by_ground, shares, of_ground);
        }
        for (state, terms) in states.iter().zip(&mut terms) {
            let amounts: [_; TOGETHER] = std::array::from_fn(|e| {
                let i = (chunk * TOGETHER + e).min(fluxes.len() - 1);
                (state.solar[i] * state.black[i], state.shining[i] * fluxes[i].returned)
            });
            for j in 0..nodes.zeniths.len() {
                for k in 0..nodes.ring(j).len() {
                    let node = nodes.index(j, k);
                    for part in 0..parts {
                        let place = part * nodes.len() + node;
                        let entries = &mut terms[place][chunk * TOGETHER..][..some.len()];
                        for (e, term) in entries.iter_mut().enumerate() {
                            let (of_sun, of_ground) = &together[e];
                            let from_ground = if part == 0 { amounts[e].1 * of_ground[j] } else { 0.0 };
                            *term = (amounts[e].0 * of_sun[2 * node + part] + from_ground) * scales[place];
                        }
                    }
                }
            }
        }
    }
    for (state, terms) in states.iter_mut().zip(terms) {
        state.terms = terms.into_iter().map(Spectrum::new).collect();
        state.sky = Some((nodes.clone(), shape.clone()));
    }
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
            lit: Arc::default(),
            near: (0..(NEAR_ZENITHS + 1) * NEAR_AZIMUTHS).map(|_| OnceLock::new()).collect(),
        }
    }

    fn put_fluxes(&mut self, fluxes: &[Fluxes], place: usize, albedo: &[f64]) {
        let cosine = self.sun.apparent.cos_zenith().max(0.0);
        for (i, flux) in fluxes.iter().enumerate() {
            let beam = cosine * self.transmittance[i];
            self.black[i] = (flux.down[place] + (cosine * flux.direct[place] - beam).max(0.0)).max(0.0);
            let shining = albedo[i] * (beam + self.black[i]) / (PI * (1.0 - albedo[i] * flux.returned));
            self.shining[i] = self.solar[i] * shining;
            self.diffuse[i] = self.solar[i] * (self.black[i] + shining * PI * flux.returned);
        }
    }

    /// What every column gives along a path that rises from `low` towards `towards`.
    fn along(
        &self,
        looks_down: bool,
        towards: WorldDir,
        (low, high): (f64, f64),
        (end, length): (f64, f64),
        crossed_layers: &[(usize, f64)],
    ) -> Along {
        let shared = &*self.shared;
        let zenith = towards.zenith().min(FRAC_PI_2);
        let look = if looks_down { Look::Down } else { Look::Up };
        let turn = towards.azimuth() - self.sun.apparent.azimuth();
        // Between the directions in which light and beam travel.
        let between = if looks_down { turn + PI } else { turn };
        let sun = self.sun.true_zenith;
        let cos_sun = cosine_between((zenith, sun), turn);
        let cos_scattering = if looks_down { -cos_sun } else { cos_sun };
        let orders = self.lit.iter().flat_map(|(_, fields)| fields).map(Field::orders).max().unwrap_or(1);
        let ray = |lattice: &Arc<Lattice>, from: f64, until: (f64, f64)| {
            let sight = Sight::new(&shared.shells, lattice, look, (from, zenith), until, shared.streams, orders);
            let fan = Fan::alone(&sight, sun, &self.lit[0].0, turn);
            (sight, fan)
        };
        let rays: Vec<(Sight, Fan)> = shared.lattices.iter().map(|l| ray(l, low, (end, length))).collect();
        // What stands behind the far end along the same line: the air down to the ground, or up to space.
        let (from, to) = if looks_down { (0.0, low) } else { (high, shared.shells.top()) };
        let behind: Vec<Option<(Sight, Fan)>> =
            shared.lattices.iter().map(|l| (to > from).then(|| ray(l, from, (to, f64::INFINITY)))).collect();
        let Workspace { mut weighed, mut projected, mut gathered, .. } = Workspace::default();
        weighed.resize_with(1, Weighed::default);
        let mut crossed = Crossed::default();
        // By the sun, by a ground of radiance 1, and what comes through.
        let mut seen = |(sight, fan): &(Sight, Fan), bundle: &Bundle, grounds: &[Field], lit: &LitBundle| {
            let mut lanes = [[0.0; LANES]; 3];
            for (lane, optics) in bundle.columns.iter().enumerate() {
                let (field, ground) = (&lit.1[lane], &grounds[lane]);
                weighed[0].weigh(optics, sight, &field.starts(), false);
                crossed.take(&weighed[0], lane);
                project(&weighed, std::slice::from_ref(field), lane, &mut projected);
                (lanes[1][lane], lanes[2][lane]) = (gather_ground(&weighed[0], ground), weighed[0].transmittance());
            }
            gather(bundle, sight, &crossed, fan, &lit.0, &projected[0], &mut gathered);
            lanes[0] = gathered.all[0].radiance(bundle, cos_scattering, between);
            lanes
        };
        let to_sun = self.to_sun(crossed_layers, (low, high));
        let mut columns = Vec::new();
        for ((bundle, lattice, grounds), lit) in shared.grounds.iter().zip(self.lit.iter()) {
            let [by_sun, by_ground, _] = seen(&rays[*lattice], bundle, grounds, lit);
            let [sun_behind, ground_behind, through_behind] = match &behind[*lattice] {
                Some(ray) => seen(ray, bundle, grounds, lit),
                None => [[0.0; LANES], [0.0; LANES], [1.0; LANES]],
            };
            for (lane, optics) in bundle.columns.iter().enumerate() {
                let through =
                    |of: &dyn Fn(usize) -> f64| crossed_layers.iter().map(|(layer, s)| of(*layer) * s).sum::<f64>();
                let scattered = through(&|layer| optics.scattered(layer));
                let gathers = scattered * mean_passed(through(&|layer| optics.extinction[layer]));
                let absorbed = |(layer, s): &(usize, f64)| (optics.extinction[*layer] - optics.scattered(*layer)) * s;
                let lit_ground = if looks_down { through_behind[lane] } else { 0.0 };
                let per = if gathers > 1e-200 { 1.0 / gathers } else { 0.0 };
                let own = [by_sun[lane] * per, by_ground[lane] * per];
                let behind = [sun_behind[lane], ground_behind[lane] + lit_ground];
                let mut logs = [own[0], own[1], behind[0], behind[1]].map(|value| value.clamp(1e-300, 1e200).ln());
                logs[0] += to_sun.iter().map(absorbed).sum::<f64>();
                columns.push(logs);
            }
        }
        Along { columns, to_sun }
    }

    /// Layers and lengths \[m\] from the middle of a path's scattering to the sun; none where the Earth is in the way.
    fn to_sun(&self, crossed: &[(usize, f64)], (low, high): (f64, f64)) -> Vec<(usize, f64)> {
        let shared = &*self.shared;
        let heights = &shared.shells.heights;
        let scatters = |(layer, s): &(usize, f64)| shared.usual[*layer] / (heights[*layer] - heights[*layer + 1]) * s;
        let half = 0.5 * crossed.iter().map(scatters).sum::<f64>();
        let (mut below, mut middle) = (0.0, low);
        for place in crossed.iter().rev() {
            let own = scatters(place);
            if below + own >= half && own > 0.0 {
                let (bottom, top) = (heights[place.0 + 1].max(low), heights[place.0].min(high));
                middle = bottom + (top - bottom) * (half - below) / own;
                break;
            }
            below += own;
        }
        let lengths = shared.shells.towards_sun(middle.max(low).min(high.max(low)), self.sun.true_zenith);
        lengths.into_iter().flatten().enumerate().filter(|(_, s)| *s > 0.0).collect()
    }

    /// What an entry takes from the columns.
    fn source(&self, entry: usize, along: &Along) -> Source {
        let shared = &*self.shared;
        let mut sums = [0.0; 4];
        for (place, share) in &shared.shares[entry] {
            sums.iter_mut().zip(along.columns[*place]).for_each(|(sum, log)| *sum += share * log);
        }
        let (extinction, scattering) = (&shared.extinction[entry], &shared.scattering[entry]);
        sums[0] -= along.to_sun.iter().map(|(layer, s)| (extinction[*layer] - scattering[*layer]) * s).sum::<f64>();
        let [by_sun, by_ground, sun_behind, ground_behind] = sums.map(f64::exp);
        Source {
            own: self.solar[entry] * by_sun + self.shining[entry] * by_ground,
            behind: self.solar[entry] * sun_behind + self.shining[entry] * ground_behind,
        }
    }

    /// The nodes about a direction of light near the ground, and their shares.
    fn near(&self, towards_sensor: WorldDir) -> Vec<(&Vec<Source>, f64)> {
        let x = towards_sensor.zenith() / PI * NEAR_ZENITHS as f64;
        let y = (towards_sensor.azimuth() - self.sun.apparent.azimuth()).rem_euclid(TAU) / TAU * NEAR_AZIMUTHS as f64;
        let (i, j) = ((x as usize).min(NEAR_ZENITHS - 1), y as usize % NEAR_AZIMUTHS);
        let (t, u) = (x - i as f64, y - y.floor());
        let next = (j + 1) % NEAR_AZIMUTHS;
        [(i, j, (1.0 - t) * (1.0 - u)), (i + 1, j, t * (1.0 - u)), (i, next, (1.0 - t) * u), (i + 1, next, t * u)]
            .into_iter()
            .filter(|(.., share)| *share > 0.0)
            .map(|(i, j, share)| (self.near[i * NEAR_AZIMUTHS + j].get_or_init(|| self.near_at(i, j)), share))
            .collect()
    }

    fn near_at(&self, i: usize, j: usize) -> Vec<Source> {
        let shared = &*self.shared;
        let zenith = PI * i as f64 / NEAR_ZENITHS as f64;
        let azimuth = self.sun.apparent.azimuth() + TAU * j as f64 / NEAR_AZIMUTHS as f64;
        let travels = WorldDir::from_zenith_azimuth(zenith, azimuth);
        let looks_down = zenith <= FRAC_PI_2;
        let towards = if looks_down { travels } else { -travels };
        // A metre of the lowest layer.
        let crossed = [(shared.shells.heights.len() - 2, 1.0)];
        let of_columns = self.along(looks_down, towards, (0.0, 0.0), (f64::INFINITY, 1.0), &crossed);
        (0..self.black.len()).map(|entry| self.source(entry, &of_columns)).collect()
    }

    /// L_u along a path, from its source: what it crosses of each layer \[m\], and its transmittance.
    fn gathered(&self, entry: usize, crossed: &[(usize, f64)], transmittance: f64, source: &Source) -> f64 {
        let through = |of: &[Vec<f64>]| crossed.iter().map(|(layer, s)| of[entry][*layer] * s).sum::<f64>();
        let shared = &*self.shared;
        let whole = through(&shared.extinction);
        // Delta-M leaves in its direction what the peak turns a little: light from behind that τ₂ counts as lost.
        let peak = ((through(&shared.peak) - whole).min(0.0).exp() - transmittance).max(0.0);
        through(&shared.scattering) * mean_passed(whole) * source.own + peak * source.behind
    }
}

/// What the columns of the ladder give along a path.
struct Along {
    /// By column, logarithms of the source of light by the sun and by a shining ground, and of the light behind the path by
    /// either. Logarithms, for what absorbs more gathers less by orders of magnitude.
    columns: Vec<[f64; 4]>,
    /// From the middle of the path to the sun. What gases absorb there the source does not count: the entries have their own.
    to_sun: Vec<(usize, f64)>,
}

/// Where the light of a path comes from.
#[derive(Clone)]
struct Source {
    /// L_u over what scatters along it, each part by the mean of what passes.
    own: f64,
    /// Light from behind it.
    behind: f64,
}

/// ∫₀¹ e^(−τ u) du.
fn mean_passed(depth: f64) -> f64 {
    if depth > 1e-6 { -(-depth).exp_m1() / depth } else { 1.0 }
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
        let (of_sun, v) = (self.sun.apparent.vec().truncate(), direction.vec());
        let to_sun = of_sun.try_normalize().unwrap_or(DVec2::Y);
        let (along, across) = (to_sun.dot(v.truncate()), to_sun.perp_dot(v.truncate()).abs());
        let level = (along * along + across * across).sqrt();
        let cos_azimuth = if level > 0.0 { along / level } else { 1.0 };
        let chord = (DVec3::new(across, along, v.z) - shape.sun.vec()).length();
        let zenith = of_zenith(v.z);
        let [smooth, peaked] = shape.towards(zenith, cos_azimuth, chord);
        let (j, across) = nodes.by_zenith.between(zenith);
        let (k, along) = nodes.by_azimuth.between(of_azimuth(cos_azimuth));
        for (row, of_row) in [(j, 1.0 - across), (j + 1, across)] {
            if row == 0 {
                weights.push((0, of_row));
                continue;
            }
            weights.push((nodes.index(row, k) as u32, of_row * (1.0 - along)));
            weights.push((nodes.index(row, k + 1) as u32, of_row * along));
        }
        if !shape.halo.is_empty() {
            let n = nodes.len() as u32;
            for i in 0..weights.len() {
                weights.push((n + weights[i].0, peaked * weights[i].1));
            }
            weights.iter_mut().filter(|(node, _)| *node < n).for_each(|(_, w)| *w *= smooth);
        } else {
            weights.iter_mut().for_each(|(_, w)| *w *= smooth);
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
        let depth = |i: usize| crossed.iter().map(|(layer, s)| shared.scattering[i][*layer] * s).sum::<f64>();
        let near = low > -NEAR_HEIGHT && high < NEAR_HEIGHT && length < NEAR_LENGTH;
        if near && (0..radiance.len()).all(|i| depth(i) < NEAR_DEPTH) {
            let nodes = self.near(path.towards_sensor);
            for (i, l) in radiance.iter_mut().enumerate() {
                let mean = |of: fn(&Source) -> f64| nodes.iter().map(|(node, share)| share * of(&node[i])).sum::<f64>();
                let source = Source { own: mean(|source| source.own), behind: mean(|source| source.behind) };
                *l = self.gathered(i, &crossed, transmittance[i], &source);
            }
            return;
        }
        let of_columns = self.along(looks_down, towards, (low, high), (end, length), &crossed);
        for (i, l) in radiance.iter_mut().enumerate() {
            *l = self.gathered(i, &crossed, transmittance[i], &self.source(i, &of_columns));
        }
    }
}
