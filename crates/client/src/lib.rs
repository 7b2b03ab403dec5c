//! The client's half: stream + render. Frames in, pictures out; no socket, no window, no clock.
//!
//! ```text
//! frames ─► subscriber ─► store ─► visibility atlas (or point index) ─┐
//! pose(now), camera ─► g-buffer ──────────────────────────────────────┴─► visibility ─► compose ─► image
//! ```

pub mod clock;
pub mod controls;
pub mod pace;
#[cfg(feature = "paper")]
pub mod paper;
mod pick;
pub mod rate;
#[cfg(feature = "gpu")]
pub mod viewer;

use std::sync::{Arc, OnceLock};

use dapple_render::RenderError;
use dapple_render::area_lights::{AreaLightTable, shade_area_lights};
use dapple_render::compose::{compose, compose_with};
use dapple_render::gbuffer::{GBuffer, rasterize};
use dapple_render::image::LinearImage;
use dapple_render::psao::atlas::{AtlasParams, PointChange, VisibilityAtlas};
use dapple_render::psao::{Kernel, PointIndex, reconstruct};
use dapple_render::shade::{
    Gathering, Openings, ShadeParams, Shaded, render_shadow_maps, shade, shade_gathered, shading_points,
};
use dapple_scene::area_lights::AreaLights;
use dapple_scene::glam::Vec3;
use dapple_scene::{Edits, Pose, PosedCamera, Scene};
use dapple_store::charts::Cuts;
use dapple_store::light_visibility::SeenLight;
use dapple_store::points::PointStore;
use dapple_stream::{Applied, Limits, ReceiveError, Subscriber};

pub use pick::{Picked, pick};

/// One viewer's copy of the light, and the passes that draw with it.
pub struct Client {
    scene: Arc<Scene>,
    edits: Edits,
    subscriber: Subscriber,
    /// Made when they are first needed.
    index: OnceLock<PointIndex>,
    atlas: OnceLock<VisibilityAtlas>,
}

/// How values of points become the visibility of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Reconstruction {
    /// Through the visibility atlas: resolved once where values change, read by every picture.
    #[default]
    Atlas,
    /// At every sample anew, from the points around it.
    Direct(Kernel),
}

impl From<Kernel> for Reconstruction {
    fn from(kernel: Kernel) -> Self {
        Reconstruction::Direct(kernel)
    }
}

/// How a picture is made.
#[derive(Clone, Debug)]
pub struct PictureParams {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples a pixel along each axis, 1 … 8.
    pub supersample: u32,
    /// Lights and ambient.
    pub shade: ShadeParams,
}

/// A scene drawn without visibility: geometry, and light split into the part that visibility touches and the rest.
pub struct Drawn {
    /// Everything that moves, at the picture's time.
    pub pose: Pose,
    /// What each sample shows.
    pub gbuffer: GBuffer,
    /// Its light.
    pub shaded: Shaded,
}

impl Drawn {
    /// The picture, with one visibility a sample (all open for `None`).
    pub fn compose(&self, visibility: Option<&[f32]>) -> Result<LinearImage, RenderError> {
        compose(&self.shaded, &self.gbuffer, visibility)
    }

    /// The picture with other ambient radiance than is in `shaded`, one a sample ([`Client::ambient`]); with that where it is `None`.
    pub fn compose_with(
        &self,
        ambient: Option<&[Vec3]>,
        visibility: Option<&[f32]>,
    ) -> Result<LinearImage, RenderError> {
        compose_with(ambient.unwrap_or(&self.shaded.ambient), &self.shaded, &self.gbuffer, visibility)
    }
}

impl Client {
    /// A client that accepts only frames made for this scene.
    /// Of `limits`, the number of sets is raised to the scene's instances, which is the most a server can send.
    pub fn new(scene: Arc<Scene>, mut limits: Limits) -> Client {
        limits.max_sets = limits.max_sets.max(u32::try_from(scene.instances.len()).unwrap_or(u32::MAX));
        let subscriber = Subscriber::new(Some(scene.hash().0), limits);
        let edits = Edits::new(&scene);
        Client { scene, edits, subscriber, index: OnceLock::new(), atlas: OnceLock::new() }
    }

    /// Takes one frame off the wire. On an error nothing has changed.
    pub fn receive(&mut self, bytes: &[u8]) -> Result<Applied, ReceiveError> {
        let applied = self.subscriber.receive(bytes)?;
        match (&applied, self.atlas.get_mut()) {
            (Applied::NewLayout, _) => (self.index, self.atlas) = (OnceLock::new(), OnceLock::new()),
            (Applied::Changes(changes), Some(atlas)) => {
                atlas.begin_update(1.0);
                atlas.apply(changes.iter().map(|c| PointChange { point: c.point, old: c.old, new: c.new }));
                atlas.apply_bent(self.subscriber.bent_changes());
                atlas.apply_lights(self.subscriber.light_changes());
            }
            (Applied::Sets { removed, changes, .. }, atlas) => {
                self.index = OnceLock::new();
                if let (Some(atlas), Some(store)) = (atlas, self.subscriber.store()) {
                    atlas.begin_update(1.0);
                    let cuts = self.subscriber.cuts();
                    atlas.change_sets(&self.scene, store.layout().clone(), cuts, removed);
                    atlas.apply(changes.iter().map(|c| PointChange {
                        point: c.point,
                        old: c.old,
                        new: c.new,
                    }));
                    atlas.apply_bent(self.subscriber.bent_changes());
                    atlas.apply_lights(self.subscriber.light_changes());
                    complete(atlas, &self.scene, store);
                }
            }
            _ => {}
        }
        Ok(applied)
    }

    /// Draws the scene changed like this from now on, as the server has it. The edits must be ones that [`Edits::check`] lets pass.
    pub fn set_edits(&mut self, edits: &Edits) {
        self.edits.clone_from(edits);
    }

    /// What this client holds; nothing before the first snapshot.
    pub fn store(&self) -> Option<&PointStore> {
        self.subscriber.store()
    }

    /// Which points do not count at which texels, as the server found.
    pub fn cuts(&self) -> Option<&Cuts> {
        self.subscriber.cuts()
    }

    /// Number of the update it holds.
    pub fn epoch(&self) -> Option<u64> {
        self.subscriber.epoch()
    }

    /// Draws the scene at `now_s` (seconds) without visibility.
    pub fn draw(
        &self,
        camera: &PosedCamera,
        now_s: f64,
        params: &PictureParams,
    ) -> Result<Drawn, RenderError> {
        draw_posed(&self.scene, self.scene.pose_edited(now_s, &self.edits), camera, params)
    }

    /// Visibility of each sample: all open before the first snapshot. The first call after a new layout takes
    /// longer: it makes the atlas, or the index of the points.
    pub fn visibility(&self, drawn: &Drawn, reconstruction: &Reconstruction) -> Vec<f32> {
        let Some(store) = self.subscriber.store() else {
            return vec![1.0; drawn.gbuffer.samples().len()];
        };
        match reconstruction {
            Reconstruction::Atlas => self.atlas_of(store).reconstruct(&drawn.gbuffer, 1.0),
            Reconstruction::Direct(kernel) => {
                let index = self.index.get_or_init(|| PointIndex::new(store.layout()));
                let fragments = drawn.gbuffer.map_surfaces_rest(&self.scene, |_, surface| surface.copied());
                reconstruct(index, store.visibility(), kernel, &fragments)
            }
        }
    }

    /// What each sample reflects from the surroundings, gathered from about the bent normals of the points around it instead of the sample's
    /// own normal; `None` where no bent normals are held. Through the atlas, whatever `visibility` (one a sample) is reconstructed by. `camera`
    /// and `shade` are those that it was drawn with.
    pub fn ambient(
        &self,
        drawn: &Drawn,
        camera: &PosedCamera,
        shade: &ShadeParams,
        visibility: &[f32],
    ) -> Option<Vec<Vec3>> {
        let store = self.subscriber.store().filter(|store| store.bent().is_some())?;
        let (scene, Drawn { pose, gbuffer, .. }) = (&self.scene, drawn);
        let bent = self.atlas_of(store).reconstruct_bent(scene, pose, gbuffer);
        let gathering = Gathering { visibility, openings: Openings::Bent(&bent) };
        Some(shade_gathered(scene, pose, camera, gbuffer, shade, gathering))
    }

    /// What each sample reflects of the scene's area lights, each dimmed by how much of it is seen from the points around the sample; of all of
    /// it where that is not known, as before the first snapshot, and in a stream without lights. What samples emit is not in it. `camera` and
    /// `shade` are those that it was drawn with.
    pub fn area_light(&self, drawn: &Drawn, camera: &PosedCamera, shade: &ShadeParams) -> Vec<Vec3> {
        let (scene, Drawn { pose, gbuffer, .. }) = (&self.scene, drawn);
        let table = AreaLightTable::new(&AreaLights::new(scene, pose));
        let points = shading_points(scene, pose, camera, gbuffer, shade.specular);
        let store = self.subscriber.store().filter(|store| store.lights().is_some());
        let atlas = store.map(|store| self.atlas_of(store));
        shade_area_lights(&points, &table, |sample, seen| match atlas {
            Some(atlas) => atlas.look_up_lights(&gbuffer.samples()[sample], table.lights(), seen),
            None => seen.fill(SeenLight::ALL),
        })
    }

    /// The atlas, complete; nothing before the first snapshot.
    pub fn atlas(&self) -> Option<&VisibilityAtlas> {
        self.subscriber.store().map(|store| self.atlas_of(store))
    }

    fn atlas_of(&self, store: &PointStore) -> &VisibilityAtlas {
        self.atlas.get_or_init(|| {
            let layout = store.layout().clone();
            let mut atlas =
                VisibilityAtlas::new(layout, &self.scene, self.subscriber.cuts(), AtlasParams::default());
            complete(&mut atlas, &self.scene, store);
            atlas
        })
    }
}

/// Makes all of an atlas that is not made yet.
fn complete(atlas: &mut VisibilityAtlas, scene: &Scene, store: &PointStore) {
    while !atlas.work(scene, store.visibility(), usize::MAX).is_complete() {}
    if let Some(bent) = store.bent() {
        atlas.resolve_bent(bent);
    }
    // Values of other lights than the scene's tell nothing, and could be of any number of them.
    if let Some(lights) = store.lights()
        && lights.lights() as usize == AreaLights::new(scene, &scene.pose_undeformed(0.0)).len()
    {
        // Of more than fit nothing is known, as before the first snapshot.
        if atlas.resolve_lights(lights).is_err() {
            atlas.forget_lights();
        }
    }
}

/// Draws a scene as it was loaded at `now_s` (seconds) without visibility.
pub fn draw(
    scene: &Scene,
    camera: &PosedCamera,
    now_s: f64,
    params: &PictureParams,
) -> Result<Drawn, RenderError> {
    draw_posed(scene, scene.pose(now_s), camera, params)
}

fn draw_posed(
    scene: &Scene,
    pose: Pose,
    camera: &PosedCamera,
    params: &PictureParams,
) -> Result<Drawn, RenderError> {
    let gbuffer = rasterize(scene, &pose, camera, params.width, params.height, params.supersample)?;
    let shadow_maps = render_shadow_maps(scene, &pose, &params.shade);
    let shaded = shade(scene, &pose, camera, &gbuffer, &shadow_maps, &params.shade);
    Ok(Drawn { pose, gbuffer, shaded })
}
