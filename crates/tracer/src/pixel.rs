//! One pixel's radiance at one time, its error, and the terms that it is made of.

use sunglint_radiometry::{Estimate, REPLICATES, estimate};

use crate::paths::Record;
use crate::unseen::{Unseen, missed};

/// Where a part of a pixel's radiance comes from, as `explain` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Term {
    /// Sun, diffusely reflected by the target.
    DiffuseSun,
    /// Sky, diffusely reflected by the target.
    DiffuseSky,
    /// Surfaces around, diffusely reflected by the target.
    DiffuseBackground,
    /// Sun in the target's specular lobe.
    SpecularSun,
    /// Sky in the mirror direction.
    SpecularSky,
    /// A surface in the mirror direction.
    SpecularBackground,
    /// Emitted by the target.
    Emission,
    /// Sun by way of one or two planar mirrors.
    Caustic,
    /// Sky or sun looked at directly.
    SkyDirect,
}

impl Term {
    /// All terms, in order of output.
    pub const ALL: [Term; 9] = [
        Term::DiffuseSun,
        Term::DiffuseSky,
        Term::DiffuseBackground,
        Term::SpecularSun,
        Term::SpecularSky,
        Term::SpecularBackground,
        Term::Emission,
        Term::Caustic,
        Term::SkyDirect,
    ];

    /// Name in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DiffuseSun => "diffuse_sun",
            Self::DiffuseSky => "diffuse_sky",
            Self::DiffuseBackground => "diffuse_background",
            Self::SpecularSun => "specular_sun",
            Self::SpecularSky => "specular_sky",
            Self::SpecularBackground => "specular_background",
            Self::Emission => "emission",
            Self::Caustic => "caustic",
            Self::SkyDirect => "sky_direct",
        }
    }
}

/// Which parts of a pixel's radiance are kept apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Parts {
    /// None.
    Whole,
    /// What rays over first surfaces found of sky and background, by replicate.
    Looked,
    /// All terms, as means.
    Terms,
}

impl Parts {
    /// What rays found, as [`Looked`](Self::Looked) keeps it.
    pub const LOOKED: Term = Term::DiffuseSky;

    /// The term that a record is kept under.
    pub fn of(self, record: &Record) -> Term {
        match self {
            Self::Terms => record.term,
            Self::Looked if record.looked => Self::LOOKED,
            _ => Term::DiffuseSun,
        }
    }
}

/// One pixel's radiance at one time.
pub(crate) struct PixelRadiance {
    /// Per channel and replicate \[W m⁻² sr⁻¹ µm⁻¹\], channel-major.
    pub radiance: Vec<[f64; REPLICATES]>,
    /// The same before τ₂ and L_u; empty where not asked for.
    pub surface: Vec<[f64; REPLICATES]>,
    /// What of the radiance rays over first surfaces found of sky and background; empty where not asked for.
    pub looked: Vec<[f64; REPLICATES]>,
    /// Mean per term and channel at the sensor; empty where not asked for.
    pub terms: Vec<(Term, Vec<f64>)>,
    /// L_u per channel.
    pub upwelled: Vec<f64>,
    /// I_t per replicate: the share of its samples whose first surface the sun lights.
    pub lit: [f64; REPLICATES],
    /// What of `radiance` is noise of points that many pixels share, by channel and replicate; empty where there are none.
    pub cache_noise: Vec<[f64; REPLICATES]>,
    /// What its samples may all have missed.
    pub unseen: Unseen,
    /// Samples that were traced for it, and those of them that looked at sky and background.
    pub samples: u32,
    pub looks: u32,
}

impl PixelRadiance {
    /// Mean and standard error of a channel: that of the replicates, and for what samples that agree may all have missed.
    pub fn estimate(&self, c: usize) -> Estimate {
        let own = estimate(&self.radiance[c]);
        let counts = [self.samples, self.looks].map(f64::from);
        let of_half = |half: &[[f64; 2]]| half[c].iter().zip(counts).map(|(unseen, n)| missed(*unseen, n)).sum::<f64>();
        let missed = of_half(&self.unseen[0]).min(of_half(&self.unseen[1])).sqrt();
        // Equal replicates keep an error of exactly zero where nothing can be missed, and any other its bits.
        let standard_error = if missed > 0.0 { own.standard_error.hypot(missed) } else { own.standard_error };
        Estimate { standard_error, ..own }
    }

    /// Lets the first replicate, which alone has a sample, speak for all.
    pub fn spread(&mut self) {
        for values in self.radiance.iter_mut().chain(&mut self.surface).chain(&mut self.looked) {
            *values = [values[0]; REPLICATES];
        }
        self.lit = [self.lit[0]; REPLICATES];
        let means = self.terms.iter_mut().map(|(_, means)| means).chain([&mut self.upwelled]);
        means.flatten().for_each(|mean| *mean *= REPLICATES as f64);
        (self.samples, self.looks) = (1, 1);
    }

    /// Joins first samples, one a replicate, with these means over `counts` more of each.
    pub fn join(&mut self, first: &Self, counts: &[u32; REPLICATES]) {
        for (own, first) in self.unseen.iter_mut().zip(&first.unseen) {
            for (own, first) in own.iter_mut().zip(first) {
                let sky = if self.looks > 0 { own[1].min(first[1]) } else { first[1] };
                *own = [own[0].min(first[0]), sky];
            }
        }
        self.samples += first.samples;
        self.looks += first.looks;
        let sets = [(&mut self.radiance, &first.radiance), (&mut self.surface, &first.surface)];
        for (own, first) in sets.into_iter().flat_map(|(own, first)| own.iter_mut().zip(first)) {
            for ((own, first), count) in own.iter_mut().zip(first).zip(counts) {
                let n = f64::from(*count);
                *own = (*first + n * *own) / (1.0 + n);
            }
        }
        for ((own, first), count) in self.lit.iter_mut().zip(&first.lit).zip(counts) {
            *own = (*first + f64::from(*count) * *own) / (1.0 + f64::from(*count));
        }
    }

    /// Mean I_t.
    pub fn lit_fraction(&self) -> f64 {
        self.lit.iter().sum::<f64>() / REPLICATES as f64
    }
}
