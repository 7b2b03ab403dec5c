//! The traced truth of a picture, kept in files, since it takes most of the time of an evaluation.

use std::path::{Path, PathBuf};

use anyhow::Result;
use dapple_client::Drawn;
use dapple_scene::Scene;
use dapple_scene::glam::Vec3;
use dapple_trace::Tracer;
use dapple_trace::rtao::{RtaoParams, Site, trace_visibility, trace_visibility_with_progress};

use crate::picture::{sites, write_file};
use crate::source::read_limited;

/// Raised when the file's contents mean something else.
const VERSION: u32 = 1;
/// Places of a file that are traced again when it is read: were the tracer or its directions others now, they would differ.
const CHECKED: usize = 64;
/// The largest file that is read back.
const MAX_BYTES: u64 = 4 << 30;
/// One pixel in so many is traced a second time, with other directions, to learn how noisy the truth is.
const NOISE_STRIDE: u32 = 16;
/// Streams of random directions: the truth's own, and its second opinion.
const STREAM: u64 = 0;
const STREAM_AGAIN: u64 = 2;

/// Visibility of a picture's samples by rays.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Traced {
    /// One a sample, open where there is nothing.
    pub(super) visibility: Vec<f32>,
    /// Mean squared error, over pixels, that is the rays' own; 0 where no pixel shows anything.
    pub(super) noise_mse: f64,
}

/// A folder of traced pictures.
pub(super) struct Cache {
    folder: PathBuf,
}

/// What to trace, and how.
pub(super) struct Request<'a> {
    pub(super) scene: &'a Scene,
    pub(super) drawn: &'a Drawn,
    /// Rays a sample.
    pub(super) rays: u32,
    pub(super) radius_m: f32,
    pub(super) seed: u32,
}

impl Request<'_> {
    fn params(&self, stream: u64) -> RtaoParams {
        RtaoParams { rays: self.rays, radius_m: self.radius_m, seed: u64::from(self.seed) << 8 | stream }
    }
}

impl Cache {
    pub(super) fn new(folder: &Path) -> Cache {
        Cache { folder: folder.to_owned() }
    }

    /// From its file, or traced (`tracer` gives the scene's tracer in the picture's pose) and kept. A file that cannot be used, or
    /// that this program would not make, is made anew.
    pub(super) fn get<'t>(
        &self,
        request: &Request<'_>,
        tracer: impl FnOnce() -> std::cell::Ref<'t, Tracer>,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Traced> {
        let (indices, sites) = sites(request.scene, request.drawn);
        let again = second_opinion(request.drawn, &indices);
        let file = self.folder.join(format!("{}.truth", key(request, &sites)));
        let tracer = tracer();
        let counts = read(&file, sites.len() + again.len(), request.rays);
        let counts = counts.filter(|counts| {
            let same = still_so(&tracer, &sites, counts, request);
            if !same {
                tracing::warn!(
                    "{} was traced by another version of this program: traced anew",
                    file.display()
                );
            }
            same
        });
        let counts = match counts {
            Some(counts) => counts,
            None => {
                let again: Vec<Site> = again.iter().map(|&i| sites[i]).collect();
                let total = (sites.len() + again.len()).max(1) as f64;
                let mut visibility = vec![1.0; sites.len() + again.len()];
                let (first, second) = visibility.split_at_mut(sites.len());
                trace_visibility_with_progress(&tracer, &sites, &request.params(STREAM), first, &|done| {
                    progress(done as f64 / total);
                });
                trace_visibility_with_progress(
                    &tracer,
                    &again,
                    &request.params(STREAM_AGAIN),
                    second,
                    &|done| progress((sites.len() as f64 + done as f64) / total),
                );
                let counts: Vec<u32> = visibility.iter().map(|v| count(*v, request.rays)).collect();
                write_file(&file, &encode(&counts, request.rays)?)?;
                counts
            }
        };
        Ok(assemble(request, &indices, &again, &counts))
    }
}

/// Mean of the directions that are open over each sample, by the very rays of its visibility; zero where there is nothing. It is not kept.
pub(super) fn open_directions(request: &Request<'_>, tracer: &Tracer) -> Vec<Vec3> {
    let (indices, sites) = sites(request.scene, request.drawn);
    crate::picture::open_directions(request.drawn, tracer, (&indices, &sites), &request.params(STREAM))
}

/// Whether some of the sites, traced again, give what the file says.
fn still_so(tracer: &Tracer, sites: &[Site], counts: &[u32], request: &Request<'_>) -> bool {
    let chosen: Vec<usize> = (0..sites.len()).step_by(sites.len().div_ceil(CHECKED).max(1)).collect();
    let some: Vec<Site> = chosen.iter().map(|&i| sites[i]).collect();
    let mut traced = vec![1.0; some.len()];
    trace_visibility(tracer, &some, &request.params(STREAM), &mut traced);
    chosen.iter().zip(traced).all(|(&i, visibility)| count(visibility, request.rays) == counts[i])
}

/// Visibility is a whole number of rays out of all of them.
fn count(visibility: f32, rays: u32) -> u32 {
    (visibility * rays as f32).round() as u32
}

/// Indices into the sites of one pixel in sixteen, along diagonals so that every column and row has some.
fn second_opinion(drawn: &Drawn, indices: &[usize]) -> Vec<usize> {
    let gbuffer = &drawn.gbuffer;
    let (n, row) = (gbuffer.samples_per_axis, gbuffer.width_samples());
    let chosen = |sample: usize| {
        let (x, y) = (sample as u32 % row / n, sample as u32 / row / n);
        (x + 5 * y).is_multiple_of(NOISE_STRIDE)
    };
    (0..indices.len()).filter(|&i| chosen(indices[i])).collect()
}

/// Everything that the counts depend on: occluders by the scene and its time, places and directions by the sites.
fn key(request: &Request<'_>, sites: &[Site]) -> String {
    let mut hasher = blake3::Hasher::new();
    let scene = request.scene;
    hasher.update(&VERSION.to_le_bytes());
    hasher.update(&scene.hash().0);
    hasher.update(&scene.active_animation.unwrap_or(u32::MAX).to_le_bytes());
    hasher.update(&request.drawn.pose.time.to_bits().to_le_bytes());
    hasher.update(&request.rays.to_le_bytes());
    hasher.update(&request.radius_m.to_bits().to_le_bytes());
    hasher.update(&request.seed.to_le_bytes());
    for site in sites {
        for number in [site.position_world.to_array(), site.normal_world.to_array()].as_flattened() {
            hasher.update(&number.to_bits().to_le_bytes());
        }
        hasher.update(&site.key.to_le_bytes());
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

fn assemble(request: &Request<'_>, indices: &[usize], again: &[usize], counts: &[u32]) -> Traced {
    let gbuffer = &request.drawn.gbuffer;
    let value = |count: u32| count as f32 / request.rays as f32;
    let (first, second) = counts.split_at(indices.len());
    let mut visibility = vec![1.0; gbuffer.samples().len()];
    for (&index, &count) in indices.iter().zip(first) {
        visibility[index] = value(count);
    }
    // Per pixel, as all errors are: samples of a pixel lie in consecutive rows, so pixels are told by number.
    let (n, row) = (gbuffer.samples_per_axis as usize, gbuffer.width_samples() as usize);
    let mut pixels: std::collections::BTreeMap<usize, (f64, f64)> = std::collections::BTreeMap::new();
    for (&site, &count) in again.iter().zip(second) {
        let sample = indices[site];
        let pixel = sample / row / n * (row / n) + sample % row / n;
        let entry = pixels.entry(pixel).or_default();
        entry.0 += f64::from(value(first[site])) - f64::from(value(count));
        entry.1 += 1.0;
    }
    let squares: f64 = pixels.values().map(|(sum, samples)| (sum / samples) * (sum / samples)).sum();
    // The difference of two independent estimates has twice the variance of one.
    let noise_mse = if pixels.is_empty() { 0.0 } else { 0.5 * squares / pixels.len() as f64 };
    Traced { visibility, noise_mse }
}

/// A header, the counts (one byte each where the rays allow it, compressed), and a hash of all that.
fn encode(counts: &[u32], rays: u32) -> std::io::Result<Vec<u8>> {
    let mut plain = Vec::with_capacity(counts.len() * width(rays));
    for count in counts {
        plain.extend(&count.to_le_bytes()[..width(rays)]);
    }
    let mut bytes = b"dapplet1".to_vec();
    bytes.extend((counts.len() as u64).to_le_bytes());
    bytes.extend(zstd::bulk::compress(&plain, 3)?);
    let hash = blake3::hash(&bytes);
    bytes.extend(hash.as_bytes());
    Ok(bytes)
}

/// Bytes a count.
fn width(rays: u32) -> usize {
    match rays {
        0..=0xff => 1,
        0x100..=0xffff => 2,
        _ => 4,
    }
}

/// The counts of a file, if it is whole and has as many as are needed.
fn read(file: &Path, wanted: usize, rays: u32) -> Option<Vec<u32>> {
    let bytes = read_limited(file, MAX_BYTES).ok()?;
    let (body, hash) = bytes.split_at_checked(bytes.len().checked_sub(32)?)?;
    let (magic, rest) = body.split_at_checked(8)?;
    let (count, rest) = rest.split_at_checked(8)?;
    let whole = magic == b"dapplet1"
        && count == (wanted as u64).to_le_bytes()
        && blake3::hash(body).as_bytes() == hash;
    let plain = zstd::bulk::decompress(rest, whole.then_some(wanted * width(rays))?).ok()?;
    let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |n, byte| n << 8 | u32::from(*byte));
    (plain.len() == wanted * width(rays)).then(|| plain.chunks(width(rays)).map(number).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_come_back_and_damage_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.truth");
        for (rays, counts) in [(64, vec![0, 1, 64, 33]), (512, vec![0, 512, 300]), (65536, vec![65536, 7])] {
            let bytes = encode(&counts, rays).unwrap();
            std::fs::write(&file, &bytes).unwrap();
            assert_eq!(read(&file, counts.len(), rays), Some(counts.clone()));
            assert_eq!(read(&file, counts.len() + 1, rays), None);
            for broken in [&bytes[..bytes.len() - 1], &bytes[..20], &[]] {
                std::fs::write(&file, broken).unwrap();
                assert_eq!(read(&file, counts.len(), rays), None);
            }
            let mut flipped = bytes.clone();
            flipped[17] ^= 1;
            std::fs::write(&file, &flipped).unwrap();
            assert_eq!(read(&file, counts.len(), rays), None);
        }
    }

    #[test]
    fn truth_that_this_program_would_not_trace_is_traced_anew() {
        let folder = tempfile::tempdir().unwrap();
        let glb = dapple_scene::builtin::glb("atrium", 0.02).unwrap();
        let scene = dapple_scene::load("atrium.glb", &glb, &dapple_scene::NoFiles).unwrap();
        let pose = scene.pose(1.0);
        let params =
            dapple_client::PictureParams { width: 24, height: 16, supersample: 1, shade: Default::default() };
        let camera = scene.camera_paths()[0].camera(&scene, &pose);
        let drawn = dapple_client::draw(&scene, &camera, 1.0, &params).unwrap();
        let request = Request { scene: &scene, drawn: &drawn, rays: 32, radius_m: 0.6, seed: 1 };
        let cache = Cache::new(folder.path());
        let tracer = std::cell::RefCell::new(Tracer::new(&scene, &drawn.pose));
        let parts = std::sync::atomic::AtomicUsize::new(0);
        let get = || {
            let traced = cache
                .get(&request, || tracer.borrow(), &|_| {
                    parts.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                })
                .unwrap();
            (traced, parts.swap(0, std::sync::atomic::Ordering::Relaxed) > 0)
        };
        let (truth, traced) = get();
        assert!(traced);
        assert_eq!(get(), (truth.clone(), false), "from its file");
        // A whole file, of a tracer that sees everything open.
        let file = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
        let bytes = std::fs::read(&file).unwrap();
        let count = u64::from_le_bytes(bytes[8..16].try_into().unwrap()) as usize;
        std::fs::write(&file, encode(&vec![32; count], 32).unwrap()).unwrap();
        assert_eq!(get(), (truth, true));
    }
}
