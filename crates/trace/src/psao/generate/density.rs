//! Density that follows the gradient of visibility: where points are laid denser than the mean, and where thinner.
//!
//! Takes what points are laid on and [`GenerateParams`]; returns a [`Field`] with the relative density near *pilots*, places that
//! few rays are traced from. It is made before the first point is laid, on the server alone.

use dapple_scene::{Aabb, Scene};
use dapple_store::points::CellGrid;
use glam::Vec3;
use rayon::prelude::*;

use super::{GenerateParams, Ground, LaidInstance, LaidPoint, maximum_radius, spawn};
use crate::Tracer;
use crate::rtao::{RtaoParams, Site, trace_visibility};
use crate::sampling::orthonormal_basis;

/// Least relative density at `adaptive` = 1.
const LEAST_DENSE: f32 = 0.5;

/// Greatest relative density at `adaptive` = 1.
pub(super) const MOST_DENSE: f32 = 2.0;

/// Fewest pilots of an instance: a small thing on a floor has a gradient too.
const FEWEST_PILOTS: f64 = 24.0;

/// Rays of a pilot. There are as many pilots as points to be kept.
const PILOT_RAYS: u32 = 32;

/// How far pilots are looked for, in spacings of a uniform layout.
const REACH: f32 = 2.5;

/// Most pilots that are looked at around a place, so that many surfaces in one place cost no more than that.
const MOST_NEAR: usize = 256;

/// Relative density is proportional to (gradient + GROUND)^POWER between the bounds; gradients in visibility a spacing of points.
const POWER: f32 = 0.7;
const GROUND: f32 = 0.03;

/// In how many pieces an animation is cut to find where its movers come along, and how often they are looked at in each.
const MOTION_PIECES: usize = 8;
const LOOKS_A_PIECE: usize = 8;

/// Pilots that are tested against the boxes of movers together.
const TOGETHER: usize = 64;

/// Keeps the hashes of pilots apart from those of points.
const PILOT_SEED: u32 = 0x9110_7000;

/// The relative density over the surfaces of what stands still.
pub(super) struct Field {
    /// One an instance; `None` where density is uniform.
    pilots: Vec<Option<Pilots>>,
}

/// Places of one instance whose relative density is known.
pub(super) struct Pilots {
    reach_m: f32,
    grid: CellGrid,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// Visibility at first, then the length of its gradient a spacing, at last the relative density.
    values: Vec<f32>,
    /// Least relative density at `adaptive` = 1.
    least: Vec<f32>,
    /// Rest-space surface that each pilot stands for, m².
    share_m2: f64,
}

impl Field {
    /// Traces the pilots and distributes the points of a uniform layout among them.
    ///
    /// What moves keeps uniform density: what it comes near to changes, so the gradient at one time says little of it.
    pub(super) fn new(ground: &Ground<'_>, params: &GenerateParams) -> Field {
        let moving = &ground.sides.moving;
        let still = ground.tracer.only(|instance| !moving[instance]);
        let reached = moved_boxes(ground.scene, moving, params.radius_m);
        let trace = |instance: usize| {
            (!moving[instance]).then(|| Pilots::trace(ground, instance, &still, &reached, params))
        };
        let mut pilots: Vec<Option<Pilots>> = (0..ground.areas.len()).into_par_iter().map(trace).collect();
        let mut of_still: Vec<&mut Pilots> = pilots.iter_mut().flatten().collect();
        distribute(&mut of_still, params.adaptive);
        Field { pilots }
    }

    /// Those of an instance, or `None` where density is uniform.
    pub(super) fn pilots(&self, instance: usize) -> Option<&Pilots> {
        self.pilots[instance].as_ref()
    }
}

impl Pilots {
    fn trace(
        ground: &Ground<'_>,
        instance: usize,
        tracer: &Tracer,
        reached: &[Aabb],
        params: &GenerateParams,
    ) -> Pilots {
        let area = &ground.areas[instance];
        let kept = 0.5 * f64::from(params.points_per_m2);
        let spacing_m = 2.0 * maximum_radius(1.0, kept) as f32;
        let reach_m = REACH * spacing_m;
        let mut laid = LaidInstance { instance, points: Vec::new(), dropped: 0 };
        if area.total > 0.0 {
            let density = kept.max((FEWEST_PILOTS / area.total).min(2.0 * kept)) as f32;
            laid.points = spawn(ground.scene, instance, area, density, params.seed ^ PILOT_SEED, |_| true);
        }
        let share_m2 = area.total / laid.points.len().max(1) as f64;
        laid.drop_inside(ground.scene, ground.pose, ground.tracer, ground.sides, params);
        let sites: Vec<Site> = laid.points.iter().map(|p| site(ground, instance, p)).collect();
        let mut visibility = vec![1.0; sites.len()];
        let rtao = RtaoParams { rays: PILOT_RAYS, radius_m: params.radius_m, seed: u64::from(params.seed) };
        trace_visibility(tracer, &sites, &rtao, &mut visibility);
        let positions: Vec<Vec3> = laid.points.iter().map(|p| p.position_rest).collect();
        let normals: Vec<Vec3> = laid.points.iter().map(|p| p.normal_rest).collect();
        let least = least_densities(&sites, reached);
        let grid = CellGrid::new(&positions, reach_m);
        let mut pilots = Pilots { reach_m, grid, positions, normals, values: visibility, least, share_m2 };
        let gradients = (0..pilots.positions.len())
            .into_par_iter()
            .with_min_len(256)
            .map_init(|| Near::new(&pilots), |near, i| near.gradient(i) * spacing_m);
        pilots.values = gradients.collect();
        pilots
    }
}

fn site(ground: &Ground<'_>, instance: usize, point: &LaidPoint) -> Site {
    let key = u64::from(point.anchor.site(instance as u32));
    match point.anchor.pose(ground.scene, ground.pose, instance) {
        Some(posed) => Site { position_world: posed.position, normal_world: posed.normal, key },
        None => Site { position_world: point.position_rest, normal_world: Vec3::ZERO, key },
    }
}

/// Turns gradients into relative densities whose mean over the surface is 1.
fn distribute(pilots: &mut [&mut Pilots], adaptive: f32) {
    for p in pilots.iter_mut() {
        for value in &mut p.values {
            *value = libm::powf(*value + GROUND, POWER);
        }
    }
    let surface_m2: f64 = pilots.iter().map(|p| p.values.len() as f64 * p.share_m2).sum();
    let dense = |value: f32, least: f32, factor: f32| (value * factor).clamp(least, MOST_DENSE);
    let points = |factor: f32| -> f64 {
        let of = |p: &&mut Pilots| {
            let densities =
                p.values.iter().zip(&p.least).map(|(v, least)| f64::from(dense(*v, *least, factor)));
            densities.sum::<f64>() * p.share_m2
        };
        pilots.iter().map(of).sum()
    };
    // The number of points grows with the factor; halving the interval of its logarithm finds that of a uniform layout.
    let (mut low, mut high) = (-20.0f32, 20.0f32);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        match points(libm::exp2f(middle)) < surface_m2 {
            true => low = middle,
            false => high = middle,
        }
    }
    let factor = libm::exp2f(low);
    for p in pilots.iter_mut() {
        for (value, least) in p.values.iter_mut().zip(&p.least) {
            *value = 1.0 + adaptive * (dense(*value, *least, factor) - 1.0);
        }
    }
}

/// Where movers come along in their animation, with the radius around.
fn moved_boxes(scene: &Scene, moving: &[bool], radius_m: f32) -> Vec<Aabb> {
    let animation = scene.active_animation.and_then(|i| scene.animations.get(i as usize));
    let movers: Vec<usize> = (0..moving.len()).filter(|&i| moving[i] && scene.instances[i].casts).collect();
    let Some(animation) = animation.filter(|_| !movers.is_empty()) else { return Vec::new() };
    let looks = MOTION_PIECES * LOOKS_A_PIECE;
    let seconds = f64::from(animation.duration()) / looks as f64;
    let at = |look: usize| -> Vec<Aabb> {
        let pose = scene.pose(seconds * look as f64);
        movers.iter().map(|&i| scene.instance_bounds_world(&pose, i).inflated(radius_m)).collect()
    };
    let boxes: Vec<Vec<Aabb>> = (0..looks).into_par_iter().map(at).collect();
    // A piece ends where the next begins, so that no way between two looks is left out.
    let pieces = (0..MOTION_PIECES).flat_map(|piece| {
        let looks_of = piece * LOOKS_A_PIECE..=(piece + 1) * LOOKS_A_PIECE;
        let joined = (0..movers.len()).map({
            let boxes = &boxes;
            move |mover| {
                let of = looks_of.clone().map(|look| boxes[look % looks][mover]);
                of.fold(Aabb::EMPTY, Aabb::union)
            }
        });
        joined.collect::<Vec<Aabb>>()
    });
    pieces.collect()
}

/// The least density of each site: that of a uniform layout where movers come along, whose shadows no pilot has seen.
fn least_densities(sites: &[Site], reached: &[Aabb]) -> Vec<f32> {
    let mut least = Vec::with_capacity(sites.len());
    let mut near: Vec<Aabb> = Vec::new();
    for together in sites.chunks(TOGETHER) {
        let bounds = Aabb::from_points(together.iter().map(|site| site.position_world));
        near.clear();
        near.extend(reached.iter().copied().filter(|b| b.intersects(&bounds)));
        least.extend(together.iter().map(|site| {
            let comes = near.iter().any(|b| b.distance_squared(site.position_world) <= 0.0);
            if comes { 1.0 } else { LEAST_DENSE }
        }));
    }
    least
}

/// Finds the pilots around a place; remembers the last cell.
struct Near<'a> {
    pilots: &'a Pilots,
    cell: Option<[i32; 3]>,
    indices: Vec<u32>,
}

impl<'a> Near<'a> {
    fn new(pilots: &'a Pilots) -> Near<'a> {
        Near { pilots, cell: None, indices: Vec::new() }
    }

    /// Pilots on the place's side within reach, and how much each counts.
    fn around(&mut self, position: Vec3, normal: Vec3) -> impl Iterator<Item = (usize, f32)> {
        let pilots = self.pilots;
        let cell = pilots.grid.cell_of(position);
        if self.cell != Some(cell) {
            self.cell = Some(cell);
            self.indices.clear();
            pilots.grid.gather(cell, 1, &mut self.indices);
            self.indices.truncate(MOST_NEAR);
        }
        self.indices.iter().filter_map(move |&j| {
            let j = j as usize;
            let d = (pilots.positions[j] - position) / pilots.reach_m;
            let (tent, side) = (1.0 - d.length_squared(), pilots.normals[j].dot(normal));
            (tent > 0.0 && side > 0.5).then_some((j, tent * tent * side))
        })
    }

    /// Length of the gradient of the pilots' values at one of them, a metre: that of the plane that fits the values around best.
    fn gradient(&mut self, i: usize) -> f32 {
        let pilots = self.pilots;
        let (position, normal) = (pilots.positions[i], pilots.normals[i]);
        let (tangent, bitangent) = orthonormal_basis(normal);
        let reach_m = pilots.reach_m;
        // Weighted moments: 1, x, y, v; xx, xy, yy; xv, yv. Lengths in units of the reach.
        let mut m = [0.0f32; 9];
        for (j, w) in self.around(position, normal) {
            let d = (pilots.positions[j] - position) / reach_m;
            let (x, y, v) = (d.dot(tangent), d.dot(bitangent), pilots.values[j]);
            let terms = [1.0, x, y, v, x * x, x * y, y * y, x * v, y * v];
            for (m, term) in m.iter_mut().zip(terms) {
                *m += w * term;
            }
        }
        let [w, x, y, v, xx, xy, yy, xv, yv] = m;
        if w <= 0.0 {
            return 0.0;
        }
        let (x, y, v) = (x / w, y / w, v / w);
        // Pilots in a line or too few must not make up a slope.
        let ridge = 0.02;
        let (xx, xy, yy) = (xx / w - x * x + ridge, xy / w - x * y, yy / w - y * y + ridge);
        let (xv, yv) = (xv / w - x * v, yv / w - y * v);
        let determinant = xx * yy - xy * xy;
        if determinant <= 0.0 {
            return 0.0;
        }
        let (gx, gy) = ((yy * xv - xy * yv) / determinant, (xx * yv - xy * xv) / determinant);
        let length = (gx * gx + gy * gy).sqrt() / reach_m;
        if length.is_finite() { length } else { 0.0 }
    }

    /// Mean of the pilots' values around; 1 where there are none.
    fn mean(&mut self, position: Vec3, normal: Vec3) -> f32 {
        let pilots = self.pilots;
        let (mut sum, mut weights) = (0.0f32, 0.0f32);
        for (j, w) in self.around(position, normal) {
            sum += w * pilots.values[j];
            weights += w;
        }
        if weights > 0.0 { sum / weights } else { 1.0 }
    }
}

/// Takes of places, laid as densely as can be, the share that the density at each asks for.
pub(super) struct Share<'a> {
    near: Near<'a>,
    /// What density asked for and was not taken yet. Carried on from place to place, so that no chance makes gaps.
    owed: f32,
    /// Of the places that were taken.
    scales: Vec<f32>,
}

impl<'a> Share<'a> {
    pub(super) fn new(pilots: &'a Pilots) -> Share<'a> {
        // The first place is always taken: even the smallest thing gets a point.
        Share { near: Near::new(pilots), owed: 1.0, scales: Vec::new() }
    }

    pub(super) fn takes(&mut self, place: &LaidPoint) -> bool {
        let density = self.near.mean(place.position_rest, place.normal_rest);
        if self.scales.is_empty() {
            self.owed = 1.0;
        } else {
            self.owed += density / MOST_DENSE;
        }
        let takes = self.owed >= 1.0;
        if takes {
            self.owed -= 1.0;
            self.scales.push(1.0 / density.sqrt());
        }
        takes
    }

    /// Of each place that was taken the distance it should keep, relative to that of a uniform layout.
    pub(super) fn into_scales(self) -> Vec<f32> {
        self.scales
    }
}
