//! Ray-traced ambient occlusion: the visibility of sites, from many rays each. The truth for all other methods.
//!
//! - takes: a [`Tracer`], sites (position, normal, key), [`RtaoParams`]
//! - returns: for each site the part of its cosine-weighted hemisphere that is open within the radius, 0 … 1; if asked also
//!   the mean of the open directions, the bent normal

use std::sync::atomic::{AtomicU64, Ordering};

use dapple_scene::glam::Vec3;
use rayon::prelude::*;

use crate::bvh::{BlockedMask, MAX_DIRECTIONS, Tracer, count_blocked, offset_origin};
use crate::sampling::{extend_pattern, hash, orthonormal_basis};

#[cfg(test)]
mod tests;

/// Most rays a site.
pub const MAX_RAYS: u32 = 65_536;

/// Sites traced by one task, and the steps of progress.
const CHUNK: usize = 256;

/// What to trace at each site.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RtaoParams {
    /// Rays a site, 1 … [`MAX_RAYS`] (brought into that range), default 512. Powers of two are spread best.
    pub rays: u32,
    /// Length of the rays in metres, > 0, default 0.6; infinity is allowed. At 0 or below (or NaN) all is open.
    pub radius_m: f32,
    /// Seed of the directions, default 0.
    pub seed: u64,
}

impl Default for RtaoParams {
    fn default() -> Self {
        RtaoParams { rays: 512, radius_m: 0.6, seed: 0 }
    }
}

/// A place on a surface, seen from one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// On the surface; rays start a little above it ([`offset_origin`]).
    pub position_world: Vec3,
    /// Geometric unit normal, towards the side that is seen. Sites whose normal is not finite or zero are open.
    pub normal_world: Vec3,
    /// Chooses the site's directions, with the seed. The same site should keep its key, different ones differ.
    pub key: u64,
}

/// Writes the visibility of each site (1 open, 0 blocked), in parallel in the caller's rayon pool.
///
/// Each value depends on the scene, its site, and `params` alone: not on the other sites nor the number of threads.
///
/// # Panics
///
/// If `sites` and `visibility` differ in length.
pub fn trace_visibility(tracer: &Tracer, sites: &[Site], params: &RtaoParams, visibility: &mut [f32]) {
    trace_visibility_with_progress(tracer, sites, params, visibility, &|_| {});
}

/// [`trace_visibility`] that calls `progress` with the number of sites done so far, every few hundred sites.
///
/// Calls come from the pool's threads, and may arrive out of order; the largest number is the latest.
///
/// # Panics
///
/// If `sites` and `visibility` differ in length.
pub fn trace_visibility_with_progress(
    tracer: &Tracer,
    sites: &[Site],
    params: &RtaoParams,
    visibility: &mut [f32],
    progress: &(dyn Fn(u64) + Sync),
) {
    assert_eq!(sites.len(), visibility.len(), "one visibility for each site");
    trace_each(sites, visibility, progress, |site, directions| {
        let mut blocked = 0;
        let smooth = SmoothSite {
            site: *site,
            shading_normal_world: site.normal_world,
            first_ray: 0,
            axes_world: None,
        };
        let rays = trace_site(tracer, &smooth, params, directions, |_, mask| blocked += count_blocked(mask));
        if rays == 0 { 1.0 } else { (rays - blocked) as f32 / rays as f32 }
    });
}

/// A site on a surface that is drawn as if it were smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothSite {
    /// Where rays start; its normal is the face's own.
    pub site: Site,
    /// Unit normal that the surface is shaded with. It should be less than 90° from the face's.
    pub shading_normal_world: Vec3,
    /// Index of its first direction in the endless sequence of its key, default 0. Neighbours that are averaged do best to
    /// share a key and divide its sequence among them.
    pub first_ray: u32,
    /// Two unit vectors that are at right angles to the shading normal and to each other, along which the pattern of directions is
    /// laid; `None` for some that depend on the normal alone. Given along a body, equal bodies that stand turned or mirrored
    /// send equal rays.
    pub axes_world: Option<[Vec3; 2]>,
}

/// Visibility of a site, and where from light comes to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BentVisibility {
    /// 1 open, 0 blocked.
    pub visibility: f32,
    /// Mean over all rays of the directions that are open (blocked ones count as zero), in the world. Its direction is the
    /// *bent normal*, weighted by cosine; its length is 2/3 where all is open about the face's own normal, and 0 where
    /// nothing is.
    pub open_world: Vec3,
}

/// Visibility and the mean of the open directions about *shading* normals, without those that lie behind the face: what varies
/// smoothly where the surface is drawn smooth, instead of jumping from face to face, and is still 1 where nothing is near.
/// Where the shading normal is the face's own and no axes are given, the visibility is to the bit that of [`trace_visibility`].
///
/// # Panics
///
/// If `sites` and `bent` differ in length.
pub fn trace_bent(tracer: &Tracer, sites: &[SmoothSite], params: &RtaoParams, bent: &mut [BentVisibility]) {
    assert_eq!(sites.len(), bent.len(), "one result for each site");
    trace_each(sites, bent, &|_| {}, |smooth, directions| {
        let (mut open, mut sum) = (0, Vec3::ZERO);
        let rays = trace_site(tracer, smooth, params, directions, |directions, mask| {
            open += directions.len() as u32 - count_blocked(mask);
            for (i, direction) in directions.iter().enumerate() {
                if mask[i / 64] >> (i % 64) & 1 == 0 {
                    sum += *direction;
                }
            }
        });
        match rays {
            0 => BentVisibility { visibility: 1.0, open_world: Vec3::ZERO },
            _ => BentVisibility { visibility: open as f32 / rays as f32, open_world: sum / rays as f32 },
        }
    });
}

/// Fills a list parallel to the sites, in parallel; each task has one buffer for directions.
fn trace_each<S: Sync, T: Send>(
    sites: &[S],
    results: &mut [T],
    progress: &(dyn Fn(u64) + Sync),
    trace: impl Fn(&S, &mut Vec<Vec3>) -> T + Sync,
) {
    let done = AtomicU64::new(0);
    sites.par_chunks(CHUNK).zip(results.par_chunks_mut(CHUNK)).for_each(|(sites, results)| {
        let mut directions = Vec::with_capacity(MAX_DIRECTIONS);
        for (site, result) in sites.iter().zip(results) {
            *result = trace(site, &mut directions);
        }
        let before = done.fetch_add(sites.len() as u64, Ordering::Relaxed);
        progress(before + sites.len() as u64);
    });
}

/// Traces the rays of a site about its shading normal in batches, each given to `batch` with what blocks it. Tells how many rays there
/// were: fewer where some lie behind the face, none for a site without a normal.
fn trace_site(
    tracer: &Tracer,
    smooth: &SmoothSite,
    params: &RtaoParams,
    directions: &mut Vec<Vec3>,
    mut batch: impl FnMut(&[Vec3], &BlockedMask),
) -> u32 {
    let SmoothSite { site, shading_normal_world: about, first_ray, axes_world } = *smooth;
    let normal = site.normal_world;
    let is_unit = |v: Vec3| v.is_finite() && v != Vec3::ZERO;
    if !is_unit(normal) || !is_unit(about) {
        return 0;
    }
    let rays = params.rays.clamp(1, MAX_RAYS);
    let origin = offset_origin(site.position_world, normal);
    let [tangent, bitangent] = axes_world.unwrap_or_else(|| orthonormal_basis(about).into());
    let site_hash = hash(params.seed, site.key, 0);
    let mut traced = 0;
    for first in (0..rays).step_by(MAX_DIRECTIONS) {
        directions.clear();
        let end = rays.min(first + MAX_DIRECTIONS as u32);
        extend_pattern(first_ray.saturating_add(first)..first_ray.saturating_add(end), site_hash, directions);
        for d in directions.iter_mut() {
            *d = tangent * d.x + bitangent * d.y + about * d.z;
        }
        if about != normal {
            directions.retain(|d| d.dot(normal) > 0.0);
        }
        traced += directions.len() as u32;
        batch(directions, &tracer.occlusion(origin, directions, params.radius_m));
    }
    traced
}
