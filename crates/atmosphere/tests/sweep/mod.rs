//! Random columns of the provider `layers`, and what no answer may be: no number, negative, or a transmittance above 1.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt::Write;

use sunglint_atmosphere::{BUILTIN, Column, Needs, Path, Sun};
use sunglint_plugin::{Args, FileArg, SpectralValue, Value};
use sunglint_radiometry::{SpectralGrid, WorldDir};

/// splitmix64.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Even in the logarithm.
    fn decades(&mut self, low: f64, high: f64) -> f64 {
        self.within(low.ln(), high.ln()).exp()
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())]
    }
}

/// Cosines (1 + x)/2 of the Gauss–Legendre nodes x of 2, 4 and 8 points: those of 4, 8 and 16 streams.
fn nodes() -> Vec<f64> {
    let mut all = Vec::new();
    for n in [2usize, 4, 8] {
        for i in 0..n {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            for _ in 0..20 {
                let (mut p0, mut p1) = (1.0, x);
                for l in 2..=n {
                    let l = l as f64;
                    (p0, p1) = (p1, ((2.0 * l - 1.0) * x * p1 - (l - 1.0) * p0) / l);
                }
                x -= p1 * (x * x - 1.0) / (n as f64 * (x * p1 - p0));
            }
            all.push(0.5 * (1.0 + x));
        }
    }
    all
}

/// The file of a column, the first that is drawn of its seed, and the heights of its bounds.
pub fn file(random: &mut Random) -> (String, Vec<f64>) {
    let mut text = "top_m,bottom_m,component,optical_depth,single_scattering_albedo,phase,asymmetry\n".to_string();
    let n = 1 + random.below(10);
    let total = random.decades(1e-3, 100.0);
    let mut heights = vec![0.0];
    for _ in 0..n {
        let thickness = random.decades(1.0, 2e4);
        heights.push(heights[heights.len() - 1] + thickness);
    }
    let shares: Vec<f64> = (0..n).map(|_| random.decades(1e-3, 1.0)).collect();
    let sum: f64 = shares.iter().sum();
    for layer in 0..n {
        let components = 1 + random.below(2);
        for component in 0..components {
            let depth = if random.below(12) == 0 { 0.0 } else { total * shares[layer] / sum / components as f64 };
            let albedo = match random.below(4) {
                0 => 1.0,
                1 => random.of(&[0.0, 1e-9, 0.5, 1.0 - 1e-6, 1.0 - 1e-12]),
                _ => random.within(0.0, 1.0),
            };
            let (phase, g) = match random.below(5) {
                0 => ("rayleigh", String::new()),
                1 => ("hg", random.of(&[-0.9, 0.0, 0.7, 0.85, 0.99]).to_string()),
                _ => ("hg", random.within(-0.9, 0.99).to_string()),
            };
            let (top, bottom) = (heights[layer + 1], heights[layer]);
            writeln!(text, "{top},{bottom},{component},{depth},{albedo},{phase},{g}").unwrap();
        }
    }
    (text, heights)
}

/// What is wrong with the answers of the column of a seed.
pub fn violations(seed: u64) -> Vec<String> {
    let random = &mut Random::new(seed);
    let (text, heights) = file(random);
    let top = heights[heights.len() - 1];
    let streams = random.of(&[4, 8, 16]);
    let geometry = random.of(&["plane", "spherical"]);
    let albedo = random.of(&[0.0, 0.2, 1.0]);
    let nodes = nodes();
    let suns: Vec<Sun> = (0..1 + random.below(3))
        .map(|_| {
            let zenith = match random.below(4) {
                0 => random.of(&nodes).acos(),
                1 => random.of(&[0.0, 60.0, 89.999, 90.0, 90.5, 91.0f64]).to_radians(),
                _ => random.within(0.0, 91f64.to_radians()),
            };
            let mut sun = Sun::at(zenith, random.within(0.0, TAU));
            if zenith > 1.5 && random.below(2) == 0 {
                // Lifted by refraction, which the layers do not know of.
                sun.apparent = WorldDir::from_zenith_azimuth(zenith - 0.008, sun.apparent.azimuth());
            }
            sun
        })
        .collect();
    let grid = SpectralGrid::from_edges(&[0.5, 0.501]);
    let model = BUILTIN.iter().find(|model| model.info.name == "layers").unwrap();
    let given = [
        ("file", Value::File(FileArg { name: "layers.csv".to_string(), bytes: text.as_bytes().into() })),
        ("streams", Value::Count(streams)),
        ("geometry", Value::Word(geometry.to_string())),
        ("solar_irradiance", Value::Spectrum(SpectralValue::Constant(1.0))),
    ];
    let args = Args::new(&model.info, given.into_iter().map(|(name, value)| (name.to_string(), value)));
    let column = Column { ground_albedo: vec![albedo; grid.len()], ..Column::default() };
    let needs =
        Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None };
    let provider = match (model.bind)(&args, &grid) {
        Ok(provider) => provider,
        Err(error) => return vec![format!("seed {seed} refused: {error}")],
    };
    let states = match provider.solve(&column, &suns, &grid, &needs) {
        Ok(states) => states,
        Err(error) => return vec![format!("seed {seed} refused: {error}")],
    };
    let mut found = Vec::new();
    let mut see = |what: &dyn Fn() -> String, values: &[f64], most: f64| {
        if let Some(value) = values.iter().find(|value| !(0.0..=most).contains(*value)) {
            found.push(format!("{}: {value:e}", what()));
        }
    };
    for (sun, state) in suns.iter().zip(&states) {
        let zenith = sun.true_zenith.to_degrees();
        let place = |what: &str| format!("{what}, {geometry}, {streams} streams, albedo {albedo}, sun {zenith:.4}");
        see(&|| place("sun transmittance"), &state.sun_transmittance()[..], 1.0);
        see(&|| place("diffuse irradiance"), &state.diffuse_irradiance()[..], f64::MAX);
        let mut directions = vec![(sun.apparent.zenith(), sun.apparent.azimuth()), (0.0, 0.0), (FRAC_PI_2, 1.0)];
        directions.extend(nodes.iter().map(|mu| (mu.acos(), random.of(&[sun.apparent.azimuth(), 2.0]))));
        directions.extend((0..6).map(|_| (random.within(0.0, FRAC_PI_2), random.within(0.0, TAU))));
        let mut radiance = vec![0.0; grid.len()];
        for (zenith, azimuth) in directions {
            state.sky_radiance(WorldDir::from_zenith_azimuth(zenith, azimuth), &mut radiance);
            let turn = (azimuth - sun.apparent.azimuth()).to_degrees().rem_euclid(360.0);
            let (zenith, turn) = (zenith.to_degrees(), turn);
            see(&|| place(&format!("sky at zenith {zenith:.4}, azimuth from the sun {turn:.3}")), &radiance, f64::MAX);
        }
        let mut transmittance = vec![0.0; grid.len()];
        for _ in 0..12 {
            let from = match random.below(5) {
                0 => random.of(&heights),
                1 => random.within(-50.0, 120e3),
                2 => 0.0,
                3 => random.within(-50.0, 50.0),
                _ => random.within(0.0, top),
            };
            let zenith = match random.below(6) {
                0 => sun.true_zenith,
                1 => PI - sun.true_zenith,
                2 => random.of(&[0.0, FRAC_PI_2, PI]),
                3 => random.of(&nodes).acos(),
                _ => random.within(0.0, PI),
            };
            let azimuth = random.of(&[sun.apparent.azimuth(), sun.apparent.azimuth() + PI, 1.0]);
            let longest = match zenith.cos() {
                up if up > 1e-9 => ((120e3 - from) / up).max(0.0),
                down if down < -1e-9 => ((-50.0 - from) / down).max(0.0),
                _ => 1e6,
            };
            let length = random.decades(0.01, 1e6).min(longest);
            let path = Path {
                target_height: from,
                sensor_height: from + length * zenith.cos(),
                length,
                towards_sensor: WorldDir::from_zenith_azimuth(zenith, azimuth),
            };
            state.path(&path, &mut transmittance, &mut radiance);
            let turn = (azimuth - sun.apparent.azimuth()).to_degrees().rem_euclid(360.0);
            let (zenith, to) = (zenith.to_degrees(), path.sensor_height);
            let way = format!("from {from:.3} m to {to:.3} m, {length:.3} m at zenith {zenith:.4}, turn {turn:.3}");
            see(&|| place(&format!("transmittance {way}")), &transmittance, 1.0);
            see(&|| place(&format!("path radiance {way}")), &radiance, f64::MAX);
        }
    }
    found
}
