//! A viewer on a graphics card: frames and a camera in, a picture in a texture out. The same for a window, a browser
//! tab and a run without either.
//!
//! ```text
//! frames ─► subscriber ─► store ─► visibility atlas ─► dirty rows ─┐
//! pose(time), camera ─► forward pass ──────────────────────────────┴─► picture
//! ```

mod anchors;
mod inspect;
mod light;
mod options;
mod paper;
mod received;
mod screen;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use dapple_gpu::{Gpu, wgpu};
use dapple_render::forward::{
    Forward, FrameInputs, GpuPoints, GpuScene, GpuSceneOptions, LookupId, Rect, Transparency, View, ViewKind,
};
use dapple_render::screen_space::{ScreenKind, ScreenPasses};
use dapple_render::shade::ShadeParams;
use dapple_scene::{Edits, Pose, PosedCamera, Scene};
use dapple_store::light_visibility::LightVisibility;
use dapple_store::points::PointStore;
use dapple_stream::{Applied, ReceiveError};

use crate::{Picked, pick};
use anchors::Anchors;
use light::Light;
pub use options::{
    DebugView, DrawOptions, LoadProgress, Method, ScreenOptions, ViewerConfig, ViewerError, ViewerStats,
};
use paper::PaperLookup;
use received::Received;
use screen::ScreenSpace;

/// One viewer's copy of the light on a graphics card, and the passes that draw with it.
pub struct Viewer {
    scene: Arc<Scene>,
    edits: Edits,
    config: ViewerConfig,
    light: Light,
    gpu_scene: GpuScene,
    forward: Forward,
    transparency: Transparency,
    paper: PaperLookup,
    screen: ScreenSpace,
    points: Option<PointsShown>,
    stats: ViewerStats,
    /// The caller's clock and the fade that was asked for when it last drew.
    now_s: f64,
    fade_s: Option<f32>,
}

/// What the points view needs, made when it is first shown.
struct PointsShown {
    anchors: Anchors,
    on_card: GpuPoints,
    /// Scene time and frames received when they were last placed.
    placed: Option<(f64, u64)>,
}

impl Viewer {
    /// Uploads the scene. Frames of another scene are refused.
    ///
    /// # Errors
    /// A scene that does not fit the device, or a number of samples other than 1 and 4.
    pub fn new(gpu: &Gpu, scene: Arc<Scene>, config: ViewerConfig) -> Result<Viewer, ViewerError> {
        let mut limits = config.limits;
        limits.max_sets = limits.max_sets.max(u32::try_from(scene.instances.len()).unwrap_or(u32::MAX));
        let received = Received::new(scene.hash().0, limits);
        let gpu_scene = GpuScene::new(gpu, scene.clone(), &GpuSceneOptions { mips: config.mips })?;
        let forward = Forward::new(
            gpu,
            config.format.remove_srgb_suffix(),
            config.samples,
            &[PaperLookup::lookup(gpu), ScreenPasses::lookup(gpu), ScreenPasses::lookup(gpu)],
        )?;
        Ok(Viewer {
            light: Light::new(scene.clone(), received),
            edits: Edits::new(&scene),
            scene,
            gpu_scene,
            forward,
            transparency: Transparency::Blend,
            paper: PaperLookup::default(),
            screen: ScreenSpace::new(),
            points: None,
            stats: ViewerStats::default(),
            now_s: 0.0,
            fade_s: DrawOptions::default().fade_s,
            config,
        })
    }

    /// How materials with blended alpha are drawn; cutouts are what the processor's pictures have.
    pub fn set_transparency(&mut self, transparency: Transparency) {
        self.transparency = transparency;
    }

    /// Shows the scene changed like this from the next picture on, as the server has it. The edits must be ones that
    /// [`Edits::check`] lets pass.
    pub fn set_edits(&mut self, edits: &Edits) {
        if self.edits != *edits {
            self.edits.clone_from(edits);
            // Points are to be placed anew even if time stands still.
            if let Some(points) = &mut self.points {
                points.placed = None;
            }
        }
    }

    /// What is shown changed; as at first ([`Edits::new`]) until [`Viewer::set_edits`].
    pub fn edits(&self) -> &Edits {
        &self.edits
    }

    /// What is under a place of the picture that [`Viewer::draw`] draws with the same camera, size and time: [`pick()`].
    pub fn pick(
        &self,
        camera: &PosedCamera,
        size: (u32, u32),
        at: (f32, f32),
        scene_time_s: f64,
    ) -> Option<Picked> {
        pick(&self.scene, &self.edits, camera, size, at, scene_time_s)
    }

    /// Takes one frame off the wire, which came at `now_s` (seconds on the caller's clock, as in [`Viewer::draw`]).
    /// On an error nothing has changed.
    pub fn receive(&mut self, bytes: &[u8], now_s: f64) -> Result<Applied, ReceiveError> {
        self.receive_part(None, bytes, now_s)
    }

    /// As [`Viewer::receive`], of light that comes in parts ([`dapple_stream::Parts`]), or (`None`) as one: whichever came last is shown.
    pub fn receive_part(
        &mut self,
        part: Option<u8>,
        bytes: &[u8],
        now_s: f64,
    ) -> Result<Applied, ReceiveError> {
        let applied = self.light.receive(part, bytes, now_s, self.fade_s)?;
        self.stats.bytes_received += bytes.len() as u64;
        self.stats.frames_received += 1;
        self.stats.last_frame_s = Some(now_s);
        self.stats.points = self.store().map_or(0, |store| store.layout().len() as u32);
        self.stats.changed = self.changed_by(&applied);
        match &applied {
            Applied::Changes(changes) => self.paper.apply(changes),
            Applied::NewLayout | Applied::Sets { .. } => {
                self.paper.forget();
                self.points = None;
            }
            Applied::Ignored(_) => {}
        }
        Ok(applied)
    }

    /// How many points a frame has changed that was just taken, by what [`Viewer::receive`] gave: all for a new layout, those that came for one
    /// of which sets stay.
    pub fn changed_by(&self, applied: &Applied) -> u32 {
        match applied {
            Applied::NewLayout => self.stats.points,
            Applied::Changes(changes) => changes.len() as u32,
            Applied::Sets { added, changes, .. } => {
                let layout = self.store().map(|store| store.layout());
                let sets = added.iter().filter_map(|instance| layout?.set_of_instance(*instance));
                (changes.len() + sets.map(|set| set.len()).sum::<usize>()) as u32
            }
            Applied::Ignored(_) => 0,
        }
    }

    /// Goes on with the work that a snapshot causes (charts, weights), about `texels` texels of it (some 100,000 a
    /// second on one core); call it between frames until it is done. Until then surfaces that are not ready are
    /// shown open; those that become ready fade in.
    pub fn work(&mut self, texels: usize) -> LoadProgress {
        let (done, total) = self.light.work(texels, self.now_s, self.fade_s);
        LoadProgress { done, total }
    }

    /// Draws the scene as it is at `scene_time_s` (its animation's time) into `target`, `width` × `height` pixels
    /// large. `now_s` is the caller's clock, which the fade runs on. A look-up that cannot show the points is left out,
    /// as if everything were open: [`Viewer::problem`].
    ///
    /// # Errors
    /// A camera or size that cannot be drawn, or a device that failed since the last picture.
    #[allow(clippy::too_many_arguments, reason = "a picture has that many sides")]
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        target: &wgpu::TextureView,
        size: (u32, u32),
        camera: &PosedCamera,
        scene_time_s: f64,
        now_s: f64,
        options: &DrawOptions,
    ) -> Result<(), ViewerError> {
        (self.now_s, self.fade_s) = (now_s, options.fade_s);
        self.light.upload(gpu, &mut self.gpu_scene, now_s);
        let methods = [Some(options.method), options.split.map(|(_, method)| method)];
        if methods.contains(&Some(Method::PsaoPaper)) {
            self.paper.prepare(gpu, &mut self.forward, self.light.received.store());
        }
        let wants_points = options.view == DebugView::Points;
        // Only where points are shown, or what deforms shines, must the processor know where deforming meshes are.
        let pose = if wants_points || options.area_lights && self.light.lights_deform() {
            self.scene.pose_edited(scene_time_s, &self.edits)
        } else {
            self.scene.pose_undeformed_edited(scene_time_s, &self.edits)
        };
        self.light.upload_lights(gpu, &mut self.gpu_scene, &pose, options.area_lights);
        if wants_points {
            self.place_points(gpu, &pose);
        }
        if let (Some(atlas), None) = (&self.light.atlas, self.light.problem()) {
            match options.view {
                DebugView::Weights => self.light.inspection.show_weights(gpu, &mut self.gpu_scene, atlas)?,
                DebugView::Age => self.light.inspection.show_ages(gpu, &mut self.gpu_scene, atlas, now_s)?,
                _ => {}
            }
        }
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let shown = methods.map(|method| method.map(|method| self.standing_in(method, options)));
        let on_screen: Vec<ScreenKind> = shown
            .into_iter()
            .filter_map(|method| match method {
                Some(Method::Screen(kind)) => Some(kind),
                _ => None,
            })
            .collect();
        let picture = screen::Picture { scene: &mut self.gpu_scene, pose: &pose, camera, size };
        self.screen.draw(gpu, &mut encoder, &mut self.forward, picture, &on_screen, &options.screen);
        // What a look-up cannot show is open.
        let lookup = |method| match self.standing_in(method, options) {
            Method::Screen(kind) => self.screen.lookup(kind),
            Method::Psao if self.light.problem().is_none() => LookupId::ATLAS,
            Method::PsaoPaper if self.paper.problem().is_none() => paper::ID,
            _ => LookupId::NONE,
        };
        let points = self.points.as_ref().map(|points| &points.on_card);
        let views = views(options, size, *camera, points, &lookup);
        // Where lights of the scene's own shine, none is made up.
        let shade = &self.config.shade;
        let shade =
            ShadeParams { sun_without_lights: shade.sun_without_lights && !self.light.is_lit(), ..*shade };
        let inputs = FrameInputs {
            pose: &pose,
            shade: &shade,
            tone_map: options.tone_map,
            transparency: self.transparency,
            fade: self.light.fade(now_s, options.fade_s),
            views: &views,
        };
        let drawn = self.forward.draw(gpu, &mut encoder, target, size, &mut self.gpu_scene, &inputs)?;
        self.stats.ignored_lights = drawn.ignored_lights;
        gpu.queue.submit([encoder.finish()]);
        gpu.take_fault().map_or(Ok(()), |fault| Err(fault.into()))
    }

    /// The method that is drawn where one is asked for.
    fn standing_in(&self, method: Method, options: &DrawOptions) -> Method {
        match (method, options.fallback) {
            (Method::Psao | Method::PsaoPaper, Some(kind)) if self.store().is_none() => Method::Screen(kind),
            _ => method,
        }
    }

    fn place_points(&mut self, gpu: &Gpu, pose: &Pose) {
        let Some(store) = self.light.received.store() else { return };
        let layout = store.layout();
        let shown = self.points.get_or_insert_with(|| PointsShown {
            anchors: Anchors::new(layout, &self.scene),
            on_card: GpuPoints::new(gpu),
            placed: None,
        });
        let now = Some((pose.time, self.stats.frames_received));
        if shown.placed != now {
            let positions = shown.anchors.positions_world(layout, &self.scene, pose);
            let values = store.visibility().iter().map(|&v| f32::from(v) / 255.0);
            // What is not there has no place.
            let placed = positions.into_iter().zip(values).filter(|(position, _)| position.is_finite());
            shown.on_card.upload(gpu, placed);
            shown.placed = now;
        }
    }

    /// Seconds that a fade takes now, drawn with `options`. After a change pictures differ for as long.
    pub fn fade_s(&self, options: &DrawOptions) -> f32 {
        self.light.fade_s(options.fade_s)
    }

    /// Why a look-up that was drawn with cannot show the points that there are: too many for the device or for the look-up's
    /// structure; or why the device cannot run a screen-space method. `None` if all is well.
    pub fn problem(&self) -> Option<&str> {
        let of_points = self.light.problem().or(self.paper.problem());
        of_points.or(self.screen.problem()).or(self.light.lights_problem())
    }

    /// Figures for an overlay. Looks at all that is held: a few times a second is enough.
    pub fn stats(&self) -> ViewerStats {
        let bent = self.store().and_then(PointStore::bent).map_or(0, |planes| planes.len() as u64);
        let lights = self.store().and_then(PointStore::lights);
        let store_bytes = self.stats.points as u64 * (BYTES_A_STORED_POINT + bent)
            + lights.map_or(0, |lights| lights.bytes() as u64);
        let stream_bytes = self.light.received.bytes() as u64;
        let (atlas_bytes, texels) =
            self.light.atlas.as_ref().map_or((0, 0), |a| (a.memory_bytes(), a.texel_count() as u32));
        ViewerStats {
            texels,
            area_lights: lights.map_or(0, LightVisibility::lights),
            memory_bytes: (store_bytes + stream_bytes + atlas_bytes, self.gpu_scene.bytes()),
            ..self.stats
        }
    }

    /// What this viewer holds; nothing before the first snapshot.
    pub fn store(&self) -> Option<&PointStore> {
        self.light.received.store()
    }

    /// What it holds is another stream's from now on: it stays to be seen until the next snapshot, of whatever group, replaces it.
    pub fn outdate(&mut self) {
        self.light.received.outdate();
    }

    /// Group and epoch of what it holds; nothing before the first snapshot, and where light comes in parts.
    pub fn held(&self) -> Option<(u64, u64)> {
        self.light.received.held()
    }

    /// The scene that it shows.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The format of the views it draws to.
    pub fn format(&self) -> wgpu::TextureFormat {
        self.forward.format()
    }
}

/// Three coordinates, a normal and a value.
const BYTES_A_STORED_POINT: u64 = 15;

/// The whole picture, and what lies right of the split over it.
fn views<'a>(
    options: &DrawOptions,
    size: (u32, u32),
    camera: PosedCamera,
    points: Option<&'a GpuPoints>,
    lookup: &dyn Fn(Method) -> LookupId,
) -> Vec<View<'a>> {
    let other = options.split.map_or(Method::None, |(_, method)| method);
    let kind = match options.view {
        DebugView::Beauty => ViewKind::Beauty,
        DebugView::Visibility => ViewKind::Visibility,
        DebugView::Normal => ViewKind::Normal,
        DebugView::Points => ViewKind::Points,
        DebugView::Texels => ViewKind::Texels,
        DebugView::Weights => ViewKind::Weights,
        DebugView::Age => ViewKind::Age,
        DebugView::Error => ViewKind::Error { other: lookup(other) },
    };
    let view =
        |method, scissor| View { camera, viewport: None, scissor, kind, lookup: lookup(method), points };
    let rect = |x: u32, width: u32| Some(Rect { x, y: 0, width, height: size.1 });
    match options.split {
        Some((at, method)) if options.view != DebugView::Error => {
            let column = (f64::from(at.clamp(0.0, 1.0)) * f64::from(size.0)).round() as u32;
            let left = (column > 0).then(|| view(options.method, rect(0, column)));
            let right = (column < size.0).then(|| view(method, rect(column, size.0 - column)));
            left.into_iter().chain(right).collect()
        }
        _ => vec![view(options.method, None)],
    }
}
