//! The light that a viewer holds: store, atlas, and what of it lies on the card.

use std::collections::BTreeMap;
use std::sync::Arc;

use dapple_gpu::Gpu;
use dapple_render::area_lights::AreaLightTable;
use dapple_render::forward::{AtlasBand, ForwardError, GpuScene};
use dapple_render::psao::atlas::{AtlasParams, DirtyBand, PointChange, VisibilityAtlas};
use dapple_scene::area_lights::AreaLights;
use dapple_scene::glam::Affine3A;
use dapple_scene::{Pose, Scene};
use dapple_stream::{Applied, ReceiveError, ValueChange};

use super::inspect::Inspection;
use super::received::Received;
use crate::pace::Pace;

/// What comes off the wire, resolved into texels.
pub(super) struct Light {
    scene: Arc<Scene>,
    pub(super) received: Received,
    pub(super) atlas: Option<VisibilityAtlas>,
    pub(super) inspection: Inspection,
    /// Instances that are lights, and whether any of them is skinned or morphs.
    emitters: Vec<u32>,
    do_lights_deform: bool,
    /// Lights whose visibility the atlas has.
    lights: u32,
    /// Whether area lights lie on the card.
    is_lit: bool,
    /// What lies there, and where the emitters were.
    drawn_lights: Option<(Vec<Affine3A>, AreaLightTable)>,
    /// Whether what lies on the card is of another atlas.
    is_new: bool,
    /// When the running fade began, seconds; long ago if none runs.
    fade_start_s: f64,
    /// Of each part, or of light that comes as one: parts of one step come one after the other.
    paces: BTreeMap<Option<u8>, Pace>,
    /// Why this atlas cannot be shown.
    problem: Option<String>,
    /// Why its lights cannot.
    lights_problem: Option<String>,
}

impl Light {
    pub(super) fn new(scene: Arc<Scene>, received: Received) -> Light {
        let inspection = Inspection::default();
        let emitters: Vec<u32> = {
            let lights = AreaLights::new(&scene, &scene.pose_undeformed(0.0));
            (0..lights.len()).filter_map(|light| lights.instance(light)).collect()
        };
        let deforms = |instance: &u32| {
            let instance = &scene.instances[*instance as usize];
            instance.skin.is_some() || !scene.meshes[instance.mesh as usize].morph_targets.is_empty()
        };
        let do_lights_deform = emitters.iter().any(deforms);
        Light {
            emitters,
            do_lights_deform,
            drawn_lights: None,
            lights_problem: None,
            scene,
            received,
            atlas: None,
            inspection,
            lights: 0,
            is_lit: false,
            is_new: false,
            fade_start_s: f64::NEG_INFINITY,
            paces: BTreeMap::new(),
            problem: None,
        }
    }

    /// `fade_s` is how long fades take, as in [`Light::fade_s`].
    pub(super) fn receive(
        &mut self,
        part: Option<u8>,
        bytes: &[u8],
        now_s: f64,
        fade_s: Option<f32>,
    ) -> Result<Applied, ReceiveError> {
        let applied = self.received.receive(part, bytes)?;
        match &applied {
            Applied::NewLayout => {
                self.is_new = true;
                (self.problem, self.lights_problem) = (None, None);
                self.inspection.reset();
                let cuts = self.received.cuts();
                self.atlas = self.received.store().map(|store| {
                    VisibilityAtlas::new(store.layout().clone(), &self.scene, cuts, AtlasParams::default())
                });
            }
            Applied::Sets { removed, changes, .. } => {
                self.inspection.forget_shown();
                // There may be room now.
                (self.problem, self.lights_problem) = (None, None);
                if let (Some(atlas), Some(store)) = (&mut self.atlas, self.received.store()) {
                    let cuts = self.received.cuts();
                    atlas.change_sets(&self.scene, store.layout().clone(), cuts, removed);
                }
                self.apply(part, changes, now_s, fade_s);
            }
            Applied::Changes(changes) => self.apply(part, changes, now_s, fade_s),
            Applied::Ignored(_) => {}
        }
        self.take_lights(&applied);
        Ok(applied)
    }

    /// Takes over what a frame changed of the visibility of lights; of instances that become ready [`Light::work`] takes it in.
    fn take_lights(&mut self, applied: &Applied) {
        let (Some(atlas), Some(store)) = (&mut self.atlas, self.received.store()) else { return };
        // Values of other lights than the scene's tell nothing, and could be of any number of them.
        let lights = store.lights().filter(|lights| lights.lights() as usize == self.emitters.len());
        let count = lights.map_or(0, |lights| lights.lights());
        if std::mem::replace(&mut self.lights, count) != count {
            // Others than before: what was taken in is of no use.
            atlas.forget_lights();
            let taken_in = lights.map_or(Ok(()), |lights| atlas.resolve_lights(lights));
            self.lights_problem = taken_in.err().map(lights_problem);
        } else if matches!(applied, Applied::Changes(_) | Applied::Sets { .. }) {
            atlas.apply_lights(self.received.light_changes());
            // There may be room now for what did not fit.
            if let (Applied::Sets { .. }, Some(lights)) = (applied, lights) {
                self.lights_problem = atlas.resolve_lights(lights).err().map(lights_problem);
            }
        }
    }

    fn apply(&mut self, part: Option<u8>, changes: &[ValueChange], now_s: f64, fade_s: Option<f32>) {
        // What changes nothing is no update: the fade goes on.
        if changes.is_empty() {
            return;
        }
        let progress = self.fade(now_s, fade_s);
        self.paces.entry(part).or_default().note(now_s);
        let Some(atlas) = &mut self.atlas else { return };
        atlas.begin_update(progress);
        atlas.apply(changes.iter().map(|c| PointChange { point: c.point, old: c.old, new: c.new }));
        self.fade_start_s = now_s;
    }

    /// Makes charts and weights, about `texels` of work; what becomes ready fades in from `now_s` on.
    pub(super) fn work(&mut self, texels: usize, now_s: f64, fade_s: Option<f32>) -> (u64, u64) {
        let fade_s = self.fade_s(fade_s);
        let (Some(atlas), Some(store)) = (&mut self.atlas, self.received.store()) else { return (0, 0) };
        if atlas.progress().is_complete() {
            let progress = atlas.progress();
            return (progress.done, progress.total);
        }
        let before = atlas.ready_count();
        let progress = atlas.work(&self.scene, store.visibility(), texels);
        if atlas.ready_count() > before {
            if let Some(lights) = store.lights().filter(|_| self.lights > 0)
                && let Err(error) = atlas.resolve_lights(lights)
            {
                self.lights_problem = Some(lights_problem(error));
            }
            // All texels share one fade: it begins anew, for the others from what they show.
            atlas.begin_update(fade_at(self.fade_start_s, now_s, fade_s));
            // An update that has come since shows nothing of its fade yet: they begin together.
            self.fade_start_s = self.fade_start_s.max(now_s);
        }
        (progress.done, progress.total)
    }

    /// Seconds that a fade takes: those that are wanted, or what the pace of updates asks for.
    pub(super) fn fade_s(&self, wanted_s: Option<f32>) -> f32 {
        // Where little changes, updates are rare.
        let known = || self.paces.values().filter_map(Pace::known_s);
        wanted_s.unwrap_or_else(|| known().reduce(f32::min).unwrap_or_else(|| Pace::default().fade_s()))
    }

    /// How far the fade is at `now_s`, 0 … 1.
    pub(super) fn fade(&self, now_s: f64, fade_s: Option<f32>) -> f32 {
        fade_at(self.fade_start_s, now_s, self.fade_s(fade_s))
    }

    /// Why the atlas cannot be shown, if so: until there is another one.
    pub(super) fn problem(&self) -> Option<&str> {
        self.problem.as_deref()
    }

    /// Why area lights cannot be shown, if so: until there are other points.
    pub(super) fn lights_problem(&self) -> Option<&str> {
        self.lights_problem.as_deref()
    }

    /// Brings onto the card what changed since the last call. What fails is not tried again before another layout comes.
    pub(super) fn upload(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene, now_s: f64) {
        if self.problem.is_none() {
            let uploaded = self.try_upload(gpu, gpu_scene, now_s);
            self.problem = uploaded.err().map(|error| error.to_string());
        }
    }

    fn try_upload(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene, now_s: f64) -> Result<(), ForwardError> {
        let Some(atlas) = &mut self.atlas else { return Ok(()) };
        if std::mem::take(&mut self.is_new) {
            for instance in 0..self.scene.instances.len() as u32 {
                gpu_scene.set_pages(gpu, instance, &[])?;
            }
        }
        for instance in atlas.take_gone() {
            gpu_scene.set_pages(gpu, instance, &[])?;
        }
        for instance in atlas.take_ready() {
            let Some(charts) = atlas.charts(instance) else { continue };
            gpu_scene.set_charts(gpu, instance, charts)?;
            gpu_scene.set_pages(gpu, instance, atlas.placements(instance))?;
        }
        let bands = bands_of(atlas.take_dirty());
        if !bands.is_empty() {
            let layers: Vec<&[[u8; 2]]> = (0..atlas.layers()).map(|layer| atlas.texels(layer)).collect();
            gpu_scene.upload_atlas(gpu, atlas.side(), &layers, &bands)?;
            self.inspection.note(atlas, &bands, now_s);
        }
        Ok(())
    }

    /// Whether lights whose visibility is held change their shape.
    pub(super) fn lights_deform(&self) -> bool {
        self.lights > 0 && self.do_lights_deform
    }

    /// Whether area lights are drawn, by what [`Light::upload_lights`] did last.
    pub(super) fn is_lit(&self) -> bool {
        self.is_lit
    }

    /// Brings the area lights of a pose onto the card, and what changed of how much is seen of them; takes them off it if they are not
    /// `wanted`, or the stream says nothing of them. What fails is not tried again before another layout comes.
    pub(super) fn upload_lights(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene, pose: &Pose, wanted: bool) {
        let is_fine = self.problem.is_none() && self.lights_problem.is_none();
        let is_lit = wanted && self.lights > 0 && is_fine;
        if !is_lit && self.is_lit {
            gpu_scene.set_area_lights(gpu, &AreaLightTable::default());
            self.drawn_lights = None;
        }
        self.is_lit = is_lit;
        let Some(atlas) = self.atlas.as_mut().filter(|_| is_lit) else { return };
        let placed = |instance: &u32| pose.instances[*instance as usize].world_from_mesh;
        let places: Vec<Affine3A> = self.emitters.iter().map(placed).collect();
        let stand_still = |(before, _): &(Vec<Affine3A>, _)| !self.do_lights_deform && *before == places;
        if !self.drawn_lights.as_ref().is_some_and(stand_still) {
            let table = AreaLightTable::new(&AreaLights::new(&self.scene, pose));
            gpu_scene.set_area_lights(gpu, &table);
            self.drawn_lights = Some((places, table));
        }
        let shown = self.drawn_lights.as_ref().map_or(&[][..], |(_, table)| table.lights());
        atlas.show_lights(shown);
        let bands = bands_of(atlas.take_dirty_lights());
        if !bands.is_empty() {
            let planes: Vec<_> = atlas.light_texels().iter().map(Vec::as_slice).collect();
            let uploaded = gpu_scene.upload_lights(gpu, atlas.side(), &planes, atlas.shows_leans(), &bands);
            self.lights_problem = uploaded.err().map(lights_problem);
        }
    }
}

fn lights_problem(error: impl std::fmt::Display) -> String {
    format!("area lights: {error}")
}

fn bands_of(dirty: Vec<DirtyBand>) -> Vec<AtlasBand> {
    let band =
        |band: DirtyBand| AtlasBand { layer: band.layer, first_row: band.y.start, end_row: band.y.end };
    dirty.into_iter().map(band).collect()
}

/// How far a fade is at `now_s` that began at `start_s` and takes `fade_s`.
fn fade_at(start_s: f64, now_s: f64, fade_s: f32) -> f32 {
    if fade_s > 0.0 { ((now_s - start_s) / f64::from(fade_s)).clamp(0.0, 1.0) as f32 } else { 1.0 }
}
