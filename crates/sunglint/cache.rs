//! Finished tiles on disk: the unit of resuming a render.

use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use sunglint_tracer::{RayCounts, TileResult};

use crate::products::write_whole;

const MAGIC: &[u8; 8] = b"SGTILE03";

/// The finished tiles of one run, in a folder named by the run's key.
pub struct TileStore {
    folder: PathBuf,
}

impl TileStore {
    /// The store of a run beneath an output folder.
    pub fn new(out: &Path, key: &str) -> Self {
        Self { folder: out.join(".sunglint").join(&key[..32]) }
    }

    fn path(&self, first: usize, tile: usize) -> PathBuf {
        self.folder.join(format!("tile_{first:06}_{tile:06}.bin"))
    }

    /// A tile that was finished before, if it is whole: of the times from `first` on that are rendered together.
    pub fn load(&self, first: usize, tile: usize) -> Option<TileResult> {
        let bytes = fs::read(self.path(first, tile)).ok()?;
        decode(&bytes)
    }

    /// Samples a pixel that a run under `time` was given when it began: all its tiles have as many.
    pub fn samples(&self) -> Option<u32> {
        fs::read_to_string(self.folder.join("samples")).ok()?.trim().parse().ok()
    }

    /// Keeps the samples a pixel of a run under `time`.
    pub fn save_samples(&self, samples: u32) -> io::Result<()> {
        write_whole(&self.folder.join("samples"), |file| writeln!(file, "{samples}"))
    }

    /// Keeps a finished tile.
    pub fn save(&self, first: usize, tile: usize, result: &TileResult) -> io::Result<()> {
        let bytes = encode(result);
        write_whole(&self.path(first, tile), |file| file.write_all(&bytes))
    }

    /// Forgets the tiles once the products are written.
    pub fn remove(&self) -> io::Result<()> {
        match fs::remove_dir_all(&self.folder) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        // The parent goes too when no other run uses it.
        if let Some(parent) = self.folder.parent() {
            let _ = fs::remove_dir(parent);
        }
        Ok(())
    }
}

/// All counts, in the order of the file.
fn counts(rays: &mut RayCounts) -> [&mut u64; 10] {
    [
        &mut rays.camera,
        &mut rays.hemisphere,
        &mut rays.mirror,
        &mut rays.sun,
        &mut rays.caustic,
        &mut rays.sun_turned_away,
        &mut rays.sun_proved_clear,
        &mut rays.hemisphere_open,
        &mut rays.camera_proved,
        &mut rays.sun_proved_shaded,
    ]
}

fn encode(result: &TileResult) -> Vec<u8> {
    let images = [&result.radiance, &result.error, &result.surface, &result.lit, &result.truth, &result.samples];
    let mut bytes = MAGIC.to_vec();
    for image in images {
        bytes.extend((image.len() as u64).to_le_bytes());
        image.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    counts(&mut result.rays.clone()).into_iter().for_each(|count| bytes.extend(count.to_le_bytes()));
    let hash = blake3::hash(&bytes);
    bytes.extend(hash.as_bytes());
    bytes
}

fn decode(bytes: &[u8]) -> Option<TileResult> {
    let body = bytes.len().checked_sub(blake3::OUT_LEN)?;
    if blake3::hash(&bytes[..body]).as_bytes() != &bytes[body..] || !bytes.starts_with(MAGIC) {
        return None;
    }
    let mut rest = &bytes[MAGIC.len()..body];
    let number = |rest: &mut &[u8]| -> Option<u64> {
        let mut word = [0; 8];
        rest.read_exact(&mut word).ok()?;
        Some(u64::from_le_bytes(word))
    };
    let mut images = Vec::new();
    for _ in 0..6 {
        let n = usize::try_from(number(&mut rest)?).ok()?;
        let (image, later) = rest.split_at_checked(n.checked_mul(4)?)?;
        rest = later;
        images.push(image.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect::<Vec<f32>>());
    }
    let mut rays = RayCounts::default();
    for count in counts(&mut rays) {
        *count = number(&mut rest)?;
    }
    let mut images = images.into_iter();
    let mut next = || images.next().unwrap_or_default();
    Some(TileResult {
        radiance: next(),
        error: next(),
        surface: next(),
        lit: next(),
        truth: next(),
        samples: next(),
        rays,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile() -> TileResult {
        TileResult {
            radiance: vec![1.0, f32::MIN_POSITIVE],
            error: vec![0.5, 0.25],
            surface: Vec::new(),
            lit: vec![1.0],
            truth: vec![3.0; 9],
            samples: vec![64.0],
            rays: RayCounts { camera: 7, sun: 9, ..RayCounts::default() },
        }
    }

    #[test]
    fn a_tile_comes_back_as_it_was() {
        assert_eq!(decode(&encode(&tile())), Some(tile()));
    }

    #[test]
    fn a_torn_or_altered_tile_is_no_tile() {
        let bytes = encode(&tile());
        for end in 0..bytes.len() {
            assert_eq!(decode(&bytes[..end]), None);
        }
        let mut altered = bytes;
        altered[20] ^= 1;
        assert_eq!(decode(&altered), None);
    }
}
