//! Keeps the visibility of lights at points up to date while a scene plays, within a budget of rays.

use std::sync::Arc;

use dapple_scene::area_lights::AreaLights;
use dapple_scene::glam::Vec3;
use dapple_scene::{Material, Part, Pose, Reflectance, Scene};
use dapple_store::light_visibility::{Lean, LightVisibility, LightVisibilityError, OPEN};
use dapple_store::points::{PointLayout, PointStore};
use rayon::prelude::*;

use super::{CHUNK, VisibilityCounts, VisibilityParams, Worker, is_usable, trace_visibility};
use crate::psao::generate::{Anchor, sites_world};
use crate::slc::{Changes, Moment};
use crate::{Tracer, rtao::Site};

/// How visibility of lights is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackerParams {
    /// Rays.
    pub visibility: VisibilityParams,
    /// Share of a point's irradiance below which an error is not seen, 0 … 1, default 0.1. What is off by less waits.
    pub tolerance: f32,
}

impl Default for TrackerParams {
    fn default() -> Self {
        TrackerParams { visibility: VisibilityParams::default(), tolerance: 0.1 }
    }
}

/// Index of a value, what it is and where what is seen lies (nothing where the light does not reach the point), and the rays that it took.
type Traced = (usize, Option<(u8, Lean)>, u64);

/// Irradiance that counts as black, as a share of that of the brightest hundredth of the points at first.
const BLACK: f32 = 0.02;

/// The visibility of all lights at all points, and what of it may be another than it says.
#[derive(Clone)]
pub struct LightTracker {
    params: TrackerParams,
    layout: Arc<PointLayout>,
    /// Of the points, at the moment of the last step.
    sites: Vec<Option<Site>>,
    /// Which points lie on something glossy; `None` where nothing of the scene is.
    glossy: Option<Vec<bool>>,
    values: LightVisibility,
    /// Which values are to be found again, one each.
    is_due: Vec<bool>,
    due: usize,
    /// What it took to find all of them at first.
    first: VisibilityCounts,
    /// Where the next step goes on.
    next: usize,
    /// The scene as it was at the last step.
    before: Pose,
    /// Irradiance (luminance, W/m²) that is added to a point's before the share of its tolerance is taken: what is small against it is as good as
    /// black.
    pub(super) black: f32,
}

impl LightTracker {
    /// Traces all of them at a pose, in parallel in the caller's rayon pool. Anchors are those of the points of `layout`, in its order.
    ///
    /// # Errors
    /// More points and lights than fit.
    pub fn new(
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        (layout, anchors): (&Arc<PointLayout>, &[Anchor]),
        params: TrackerParams,
    ) -> Result<LightTracker, LightVisibilityError> {
        let sites = sites_world(layout, anchors, scene, pose);
        let lights = AreaLights::new(scene, pose);
        let glossy = glossy(scene, layout, anchors);
        let (values, first) =
            trace_visibility(layout, (&sites, glossy.as_deref()), tracer, &lights, &params.visibility)?;
        let is_due = vec![false; values.values().len()];
        let mut tracker = LightTracker {
            params,
            layout: layout.clone(),
            sites,
            glossy,
            values,
            is_due,
            due: 0,
            first,
            next: 0,
            before: pose.clone(),
            black: 0.0,
        };
        let points = 0..layout.len();
        let mut bright: Vec<f32> =
            points.into_par_iter().map(|p| tracker.irradiance(&lights, p)).filter(|e| *e > 0.0).collect();
        bright.par_sort_unstable_by(f32::total_cmp);
        tracker.black = BLACK * bright.get(bright.len() * 99 / 100).copied().unwrap_or(0.0);
        Ok(tracker)
    }

    /// What is known: as good as traced, but for what is due.
    pub fn values(&self) -> &LightVisibility {
        &self.values
    }

    /// Most rays that a value takes.
    pub fn rays(&self) -> u32 {
        self.params.visibility.rays
    }

    /// What it took to find all of them at first.
    pub fn first_counts(&self) -> VisibilityCounts {
        self.first
    }

    /// How many values may be others than it says.
    pub fn due(&self) -> usize {
        self.due
    }

    /// Bytes held, by capacity.
    pub fn bytes(&self) -> usize {
        self.sites.capacity() * size_of::<Option<Site>>()
            + self.is_due.capacity()
            + self.glossy.as_ref().map_or(0, Vec::capacity)
            + self.values.bytes()
    }

    /// All values as all rays would find them now, at the pose of the last step: [`LightTracker::values`] where nothing is due.
    pub fn traced_afresh(
        &self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
    ) -> (LightVisibility, VisibilityCounts) {
        let lights = AreaLights::new(scene, pose);
        let mut values = self.values.clone();
        let params = &self.params.visibility;
        let (_, counts) = super::retrace_visibility(
            &mut values,
            (&self.sites, self.glossy.as_deref()),
            tracer,
            &lights,
            params,
        );
        (values, counts)
    }

    /// Follows points that came and went: those that stay keep their values, those that came are traced here and now.
    ///
    /// # Errors
    /// More points and lights than fit; nothing changes then.
    pub fn follow(
        &mut self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        (layout, anchors): (&Arc<PointLayout>, &[Anchor]),
    ) -> Result<VisibilityCounts, LightVisibilityError> {
        if Arc::ptr_eq(&self.layout, layout) {
            return Ok(VisibilityCounts::default());
        }
        let lights = AreaLights::new(scene, pose);
        // Refuses what is too much.
        let open = LightVisibility::open(layout, self.values.lights())?;
        let open = if self.values.has_leans() {
            let none = vec![Lean::NONE; open.values().len()];
            open.with_leans(none)?
        } else {
            open
        };
        let store = |layout: &Arc<PointLayout>, values| {
            PointStore::new(layout.clone(), vec![0; layout.len()]).and_then(|store| store.with_lights(values))
        };
        let was = store(&self.layout, self.values.clone());
        let carried = was.map(|was| was.carried(layout.clone(), &PointStore::default()));
        let values = carried.ok().and_then(|store| store.lights().cloned()).unwrap_or(open);
        let is_new = |instance| {
            let was = self.layout.set_of_instance(instance);
            was.zip(layout.set_of_instance(instance)).is_none_or(|(was, is)| was.len() != is.len())
        };
        let points = layout.len();
        let (mut is_due, mut came) = (vec![false; values.values().len()], Vec::new());
        for light in 0..values.lights() as usize {
            for set in layout.sets() {
                let at = light * points + set.first as usize..light * points + set.first as usize + set.len();
                match self.layout.set_of_instance(set.instance).filter(|_| !is_new(set.instance)) {
                    None => {
                        came.extend(at.clone());
                        is_due[at].fill(true);
                    }
                    Some(was) => {
                        let first = light * self.layout.len() + was.first as usize;
                        is_due[at].copy_from_slice(&self.is_due[first..first + was.len()]);
                    }
                }
            }
        }
        (self.sites, self.values) = (sites_world(layout, anchors, scene, pose), values);
        self.glossy = glossy(scene, layout, anchors);
        (self.layout, self.is_due, self.next) = (layout.clone(), is_due, 0);
        self.due = self.is_due.iter().filter(|due| **due).count();
        let mut counts = VisibilityCounts::default();
        self.take_in(&came, tracer, &lights, &mut counts);
        Ok(counts)
    }

    /// Goes on to a pose of the same points: finds what may have changed, and traces of that what `ray_budget` has rays for (`None`: all of it), each
    /// value in its turn.
    pub fn step(
        &mut self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        anchors: &[Anchor],
        ray_budget: Option<u64>,
    ) -> VisibilityCounts {
        let before = std::mem::replace(&mut self.before, pose.clone());
        let [then_lights, lights] = [&before, pose].map(|pose| AreaLights::new(scene, pose));
        let then = Moment { scene, pose: &before, lights: &then_lights };
        let changes = Changes::between(&then, &Moment { scene, pose, lights: &lights });
        if !changes.is_nothing() {
            self.observe(scene, pose, anchors, &changes);
        }
        self.trace(tracer, &lights, ray_budget)
    }

    /// Finds which values may be others now.
    fn observe(&mut self, scene: &Scene, pose: &Pose, anchors: &[Anchor], changes: &Changes<'_>) {
        let LightTracker { layout, sites, is_due, .. } = self;
        let mut has_moved = vec![false; layout.len()];
        for set in layout.sets().iter().filter(|set| changes.has_moved(set.instance)) {
            let points = set.first as usize..set.first as usize + set.len();
            has_moved[points.clone()].fill(true);
            let places = sites[points.clone()].par_iter_mut().zip(&anchors[points]);
            places.for_each(|(site, anchor)| *site = anchor.site_world(scene, pose, set.instance));
        }
        let points = layout.len().max(1);
        for (light, is_due) in is_due.chunks_mut(points).enumerate() {
            let all = is_due.par_iter_mut().zip(&*sites).zip(&has_moved).with_min_len(CHUNK);
            all.for_each(|((is_due, site), has_moved)| {
                let Some(site) = site.as_ref().filter(|site| is_usable(site)) else { return };
                *is_due |= *has_moved || changes.may_show(light, site.position_world, site.normal_world);
            });
        }
        self.due = self.is_due.par_iter().filter(|due| **due).count();
    }

    /// Traces what is due, from where the last call ended on.
    fn trace(
        &mut self,
        tracer: &Tracer,
        lights: &AreaLights<'_>,
        ray_budget: Option<u64>,
    ) -> VisibilityCounts {
        let mut counts = VisibilityCounts::default();
        let total = self.is_due.len();
        let mut left = total;
        while self.due > 0 && left > 0 && ray_budget.is_none_or(|budget| counts.rays < budget) {
            // As much at a time as may fit, so that a budget is not passed by far; of all that is due if there is none.
            let room = ray_budget.map_or(u64::MAX, |budget| budget - counts.rays);
            let pairs = (room / u64::from(self.params.visibility.rays.max(1))).clamp(64, 1 << 16) as usize;
            let (mut list, mut at) = (Vec::with_capacity(pairs.min(self.due)), self.next);
            while list.len() < pairs && left > 0 {
                if self.is_due[at] {
                    list.push(at);
                }
                at = if at + 1 == total { 0 } else { at + 1 };
                left -= 1;
            }
            self.next = at;
            self.take_in(&list, tracer, lights, &mut counts);
        }
        counts
    }

    /// Traces values that are due, in parallel in the caller's rayon pool.
    fn take_in(
        &mut self,
        list: &[usize],
        tracer: &Tracer,
        lights: &AreaLights<'_>,
        counts: &mut VisibilityCounts,
    ) {
        for (index, value, rays) in self.find(list, tracer, lights) {
            (self.is_due[index], self.due) = (false, self.due - 1);
            counts.rays += rays;
            let Some((new, lean)) = value else { continue };
            counts.traced += 1;
            counts.changed += u64::from(self.values.set(index, new, lean));
        }
    }

    /// Values at these indices, with what each took; none where the light does not reach the point.
    fn find(&self, list: &[usize], tracer: &Tracer, lights: &AreaLights<'_>) -> Vec<Traced> {
        let points = self.layout.len();
        let chunk = |list: &[usize]| {
            let mut worker = Worker::default();
            let one = |&index: &usize| {
                let (light, mut rays) = (index / points, 0);
                let site = self.sites[index % points].as_ref().filter(|site| is_usable(site));
                let site = site.filter(|s| lights.arriving(light, s.position_world, s.normal_world) > 0.0);
                let wants_lean = self.glossy.as_ref().is_some_and(|glossy| glossy[index % points]);
                let params = &self.params.visibility;
                let value = site.and_then(|site| {
                    worker.value(tracer, (light, lights), (site, wants_lean), params, &mut rays)
                });
                (index, value, rays)
            };
            list.iter().map(one).collect::<Vec<_>>()
        };
        list.par_chunks(CHUNK).flat_map_iter(chunk).collect()
    }

    /// By how many steps values may be off, of those that differ from what is `held` elsewhere of the same points, or lean elsewhere: index and steps, ascending.
    /// `pose` is that of the last step.
    pub fn tolerances(&self, held: &LightVisibility, scene: &Scene, pose: &Pose) -> Vec<(u32, u8)> {
        let lights = AreaLights::new(scene, pose);
        let values = &self.values;
        let all = (0..held.values().len().min(values.values().len())).into_par_iter();
        let differ = all.filter(|&index| {
            held.values()[index] != values.values()[index] || held.lean(index).is_far_from(values.lean(index))
        });
        differ.map(|index| (index as u32, self.tolerance(index, &lights))).collect()
    }

    /// By how many steps a value may be off; 255 where its light does not matter.
    fn tolerance(&self, index: usize, lights: &AreaLights<'_>) -> u8 {
        let (light, point) = (index / self.layout.len(), index % self.layout.len());
        let may = f32::from(OPEN) * self.params.tolerance * (self.irradiance(lights, point) + self.black);
        let arriving = self.arriving(lights, light, point);
        if arriving > 0.0 { (may / arriving).clamp(0.0, 255.0) as u8 } else { 255 }
    }

    fn arriving(&self, lights: &AreaLights<'_>, light: usize, point: usize) -> f32 {
        let site = self.sites[point].as_ref().filter(|site| is_usable(site));
        site.map_or(0.0, |site| lights.arriving(light, site.position_world, site.normal_world))
    }

    fn irradiance(&self, lights: &AreaLights<'_>, point: usize) -> f32 {
        let of = |light: usize| {
            let value = self.values.get(point, light as u32).unwrap_or(OPEN);
            self.arriving(lights, light, point) * f32::from(value) / f32::from(OPEN)
        };
        (0..self.values.lights() as usize).map(of).sum()
    }
}

/// Roughness up to which a surface mirrors enough of a light for one to see which part of it is hidden. On rougher ones leans cost bits, and nothing is
/// seen of them (`README.md`).
const GLOSSY_ROUGHNESS: f32 = 0.3;

/// Which points lie on something glossy; `None` if nothing of the scene may be, whichever points there are.
fn glossy(scene: &Scene, layout: &PointLayout, anchors: &[Anchor]) -> Option<Vec<bool>> {
    let may_be =
        |m: &Material| m.roughness_factor <= GLOSSY_ROUGHNESS || m.metallic_roughness_texture.is_some();
    let mut parts = scene.instances.iter().flat_map(|instance| &scene.meshes[instance.mesh as usize].parts);
    if !parts.any(|part| may_be(&scene.materials[part.material as usize])) {
        return None;
    }
    let mut found = Vec::with_capacity(layout.len());
    for set in layout.sets() {
        let mesh = &scene.meshes[scene.instances[set.instance as usize].mesh as usize];
        let is_glossy = |anchor: &Anchor| {
            let triangle = anchor.triangle();
            let holds = |part: &&Part| {
                (part.first_triangle..part.first_triangle + part.triangle_count).contains(&triangle)
            };
            let Some(part) = mesh.parts.iter().find(holds) else { return false };
            let uv = [0, 1].map(|set| mesh.uv(set, triangle, anchor.barycentrics()));
            let material = &scene.materials[part.material as usize];
            let reflectance = Reflectance::of(scene, material, &uv, Vec3::ONE, true);
            reflectance.alpha <= GLOSSY_ROUGHNESS * GLOSSY_ROUGHNESS
        };
        found.extend(anchors[set.first as usize..][..set.len()].iter().map(is_glossy));
    }
    Some(found)
}
