//! One pixel's radiance at one time, its error, and the terms that it is made of.

use sunglint_radiometry::{Estimate, REPLICATES, estimate};

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

/// One pixel's radiance at one time.
pub(crate) struct PixelRadiance {
    /// Per channel and replicate \[W m⁻² sr⁻¹ µm⁻¹\], channel-major.
    pub radiance: Vec<[f64; REPLICATES]>,
    /// The same before τ₂ and L_u; empty where not asked for.
    pub surface: Vec<[f64; REPLICATES]>,
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
    /// Samples that it is the mean of.
    pub samples: u32,
}

impl PixelRadiance {
    /// Mean and standard error of a channel: that of the replicates, and for what samples that agree may all have missed.
    pub fn estimate(&self, c: usize) -> Estimate {
        let own = estimate(&self.radiance[c]);
        let unseen = self.unseen[0][c].min(self.unseen[1][c]);
        let missed = missed(unseen, f64::from(self.samples)).sqrt();
        // Equal replicates keep an error of exactly zero where nothing can be missed, and any other its bits.
        let standard_error = if missed > 0.0 { own.standard_error.hypot(missed) } else { own.standard_error };
        Estimate { standard_error, ..own }
    }

    /// Joins first samples, one a replicate, with these means over `counts` more of each.
    pub fn join(&mut self, first: &Self, counts: &[u32; REPLICATES]) {
        self.samples += first.samples;
        for (own, first) in self.unseen.iter_mut().zip(&first.unseen) {
            own.iter_mut().zip(first).for_each(|(own, first)| *own = own.min(*first));
        }
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
