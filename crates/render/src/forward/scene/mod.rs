//! A scene on the card: meshes, materials, deformation, charts, and where everything stands in a frame.

mod bounds;
mod deform;
mod material;
mod mesh;
mod pages;
mod texture;

use std::sync::Arc;

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{Pose, Scene};
use dapple_store::charts::{ChartSet, Placement};
use glam::Mat3;

use super::ForwardError;
use super::area::AreaLightTextures;
use super::atlas::{AtlasBand, AtlasTexture};
use super::layouts::{self, Growing};
use super::uniforms::{
    INSTANCE_BACK_PAGES_SHIFT, INSTANCE_MIRRORED, INSTANCE_PER_VERTEX, INSTANCE_REST_MIRRORED,
    INSTANCE_STORED_TANGENTS, InstanceRaw, RIGID, rows,
};
use crate::area_lights::AreaLightTable;
use crate::gbuffer::check_scene;
use crate::psao::atlas::LIGHTS_A_TEXEL;
pub(super) use bounds::{CasterBounds, is_outside};
use deform::Deformation;
pub(super) use material::GpuMaterial;
pub(super) use mesh::{CHARTS_SLOT, DETAIL_SLOT, GEOMETRY_SLOT, GpuMesh, INSTANCE_SLOT, vertex_layouts};
use pages::PageTable;

/// How a scene is put on the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GpuSceneOptions {
    /// Whether textures get smaller levels for surfaces far away (default). The twin has none.
    pub mips: bool,
}

impl Default for GpuSceneOptions {
    fn default() -> Self {
        GpuSceneOptions { mips: true }
    }
}

/// A scene on the card, and its atlas of visibility.
#[derive(Debug)]
pub struct GpuScene {
    scene: Arc<Scene>,
    /// One for each mesh of the scene, then one for each set of charts.
    pub(super) meshes: Vec<GpuMesh>,
    /// The sets of charts that the meshes after the scene's were split by.
    charted: Vec<Charted>,
    /// For each instance, which of the meshes it draws, and its bits that never change.
    instances: Vec<(usize, u32)>,
    pub(super) materials: Vec<GpuMaterial>,
    pub(super) deformation: Deformation,
    pages: PageTable,
    atlas: AtlasTexture,
    inspection: AtlasTexture,
    pub(super) area_lights: AreaLightTextures,
    sampler: wgpu::Sampler,
    layout: wgpu::BindGroupLayout,
    pub(super) group: wgpu::BindGroup,
    pub(super) instance_buffer: Growing,
    raw: Vec<InstanceRaw>,
    /// What the raw instances were the frame before.
    raw_before: Vec<InstanceRaw>,
    motion: Motion,
    pub(super) batches: Vec<Batch>,
    pub(super) bounds: CasterBounds,
}

/// A mesh that was split by charts.
#[derive(Debug)]
struct Charted {
    mesh: u32,
    charts: Arc<ChartSet>,
    /// Instances that draw it.
    users: usize,
}

/// When each instance was last seen elsewhere, or in another shape, than the time before.
#[derive(Debug, Default)]
struct Motion {
    /// Number of the pose.
    now: u64,
    /// For each instance the pose in which it last moved, and its place since then.
    last: Vec<(u64, [[f32; 4]; 3])>,
}

/// Instances in a row of the instance buffer that are drawn alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Batch {
    pub(super) mesh: usize,
    pub(super) mirrored: bool,
    pub(super) first: u32,
    pub(super) count: u32,
}

impl GpuScene {
    /// Uploads a scene. Nothing has charts yet: all surfaces are open to the atlas.
    ///
    /// # Errors
    /// A scene whose lists do not fit together, or that is too large for the device.
    pub fn new(gpu: &Gpu, scene: Arc<Scene>, options: &GpuSceneOptions) -> Result<GpuScene, ForwardError> {
        check_scene(&scene, &scene.pose_undeformed(0.0))?;
        check_sizes(gpu, &scene)?;
        let meshes = scene.meshes.iter().map(|mesh| GpuMesh::upload(gpu, mesh, None)).collect();
        let deformation = Deformation::new(gpu, &scene)?;
        let instances = scene.instances.iter().zip(&deformation.headers).map(|(instance, &header)| {
            let mesh = &scene.meshes[instance.mesh as usize];
            let mut bits = 0;
            // Stored tangents are those of the mesh at rest.
            if !mesh.tangents.is_empty() && header == RIGID {
                bits |= INSTANCE_STORED_TANGENTS;
            }
            if instance.rest_from_mesh.determinant() < 0.0 {
                bits |= INSTANCE_REST_MIRRORED;
            }
            (instance.mesh as usize, bits)
        });
        let instances = instances.collect();
        let pages = PageTable::new(gpu, scene.instances.len());
        let (atlas, inspection) = (AtlasTexture::new(gpu), AtlasTexture::new(gpu));
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("atlas"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let layout = layouts::surface(&gpu.device);
        let area_lights = AreaLightTextures::new(gpu);
        let group =
            surface_group(gpu, &layout, &deformation, &pages, &atlas, &sampler, &inspection, &area_lights);
        let size = (scene.instances.len().max(1) * size_of::<InstanceRaw>()) as u64;
        Ok(GpuScene {
            materials: material::upload_all(gpu, &scene, options.mips),
            instance_buffer: Growing::new(&gpu.device, "instances", size, wgpu::BufferUsages::VERTEX),
            bounds: CasterBounds::new(&scene),
            raw: Vec::new(),
            raw_before: Vec::new(),
            motion: Motion::default(),
            batches: Vec::new(),
            scene,
            meshes,
            charted: Vec::new(),
            instances,
            deformation,
            pages,
            atlas,
            inspection,
            area_lights,
            sampler,
            layout,
            group,
        })
    }

    /// The scene that was uploaded.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Gives an instance its charts: its vertices are split where charts meet. Instances that share mesh and charts (the
    /// same `Arc`) share their vertices. Then [`GpuScene::set_pages`] places its pages.
    ///
    /// # Errors
    /// An instance that is not there, and charts of another mesh.
    pub fn set_charts(
        &mut self,
        gpu: &Gpu,
        instance: u32,
        charts: &Arc<ChartSet>,
    ) -> Result<(), ForwardError> {
        let fail = |reason| Err(ForwardError::Charts { instance, reason });
        let Some(host) = self.scene.instances.get(instance as usize) else {
            return fail("the scene has no such instance");
        };
        let mesh_index = host.mesh;
        let mesh = &self.scene.meshes[mesh_index as usize];
        if charts.corners().len() != mesh.triangles.len() {
            return fail("the charts are of another mesh");
        }
        let same = |c: &Charted| c.mesh == mesh_index && c.users > 0 && Arc::ptr_eq(&c.charts, charts);
        let first_slot = self.scene.meshes.len();
        let found = self.charted.iter().position(same);
        let index = match found {
            Some(index) => index,
            None => {
                let gpu_mesh = GpuMesh::upload(gpu, mesh, Some(&charts.vertices(&mesh.triangles)));
                let charted = Charted { mesh: mesh_index, charts: charts.clone(), users: 0 };
                // What nobody draws with any more is replaced where it stands.
                match self.charted.iter().position(|c| c.users == 0) {
                    Some(index) => {
                        self.charted[index] = charted;
                        self.meshes[first_slot + index] = gpu_mesh;
                        index
                    }
                    None => {
                        self.charted.push(charted);
                        self.meshes.push(gpu_mesh);
                        self.charted.len() - 1
                    }
                }
            }
        };
        self.charted[index].users += 1;
        let (slot, bits) = &mut self.instances[instance as usize];
        if let Some(before) = slot.checked_sub(first_slot) {
            self.charted[before].users -= 1;
        }
        *slot = first_slot + index;
        *bits &= !INSTANCE_PER_VERTEX;
        if charts.is_per_vertex() {
            *bits |= INSTANCE_PER_VERTEX;
        }
        Ok(())
    }

    /// Places the pages of an instance in the atlas, in the order of [`ChartSet::pages`]. Pages without a place are open, as
    /// all of them are before this is called. Twice as many places as the instance's charts have pages are those of the
    /// front, then those of the back; otherwise the back shows what the front does.
    ///
    /// # Errors
    /// An instance that is not there.
    pub fn set_pages(&mut self, gpu: &Gpu, instance: u32, places: &[Placement]) -> Result<(), ForwardError> {
        if instance as usize >= self.instances.len() {
            return Err(ForwardError::Charts { instance, reason: "the scene has no such instance" });
        }
        let first_slot = self.scene.meshes.len();
        let (slot, bits) = &mut self.instances[instance as usize];
        let charted = slot.checked_sub(first_slot).and_then(|index| self.charted.get(index));
        let pages = charted.map_or(0, |charted| charted.charts.pages().len());
        *bits &= (1 << INSTANCE_BACK_PAGES_SHIFT) - 1;
        if pages > 0 && places.len() == 2 * pages && pages <= usize::from(u16::MAX) {
            *bits |= (pages as u32) << INSTANCE_BACK_PAGES_SHIFT;
        }
        if self.pages.set(gpu, instance as usize, places) {
            self.regroup(gpu);
        }
        Ok(())
    }

    /// Writes values of the atlas; see [`AtlasTexture::upload`].
    ///
    /// # Errors
    /// As [`AtlasTexture::upload`].
    pub fn upload_atlas(
        &mut self,
        gpu: &Gpu,
        side: u32,
        layers: &[&[[u8; 2]]],
        bands: &[AtlasBand],
    ) -> Result<(), ForwardError> {
        if self.atlas.upload(gpu, side, layers, bands)? {
            self.regroup(gpu);
        }
        Ok(())
    }

    /// Writes what the views `Weights` (number of points, weight of the heaviest × 255) and `Age` (0 new … 255 old, second
    /// number free) show, in an atlas of the same size.
    ///
    /// # Errors
    /// As [`AtlasTexture::upload`].
    pub fn upload_inspection(
        &mut self,
        gpu: &Gpu,
        side: u32,
        layers: &[&[[u8; 2]]],
        bands: &[AtlasBand],
    ) -> Result<(), ForwardError> {
        if self.inspection.upload(gpu, side, layers, bands)? {
            self.regroup(gpu);
        }
        Ok(())
    }

    /// Draws these area lights from now on, dimmed by what [`GpuScene::upload_lights`] was given; an empty table draws none, and costs nothing.
    /// To be called when lights or what they look like changed.
    pub fn set_area_lights(&mut self, gpu: &Gpu, table: &AreaLightTable) {
        if self.area_lights.set_table(gpu, table) {
            self.regroup(gpu);
        }
    }

    /// Writes how much of each light is seen, in an atlas of the same size as that of visibility: four lights a group, in the order of
    /// [`AreaLightTable::lights`], of each group all layers; with leans three planes a group
    /// ([`VisibilityAtlas::light_texels`](crate::psao::atlas::VisibilityAtlas::light_texels)). While there are fewer groups than the table has lights all
    /// lights are open.
    ///
    /// # Errors
    /// As [`AtlasTexture::upload`], for the layers of all groups together; groups that differ in length.
    pub fn upload_lights(
        &mut self,
        gpu: &Gpu,
        side: u32,
        planes: &[&[[u8; LIGHTS_A_TEXEL]]],
        has_leans: bool,
        bands: &[AtlasBand],
    ) -> Result<(), ForwardError> {
        if self.area_lights.upload(gpu, side, planes, has_leans, bands)? {
            self.regroup(gpu);
        }
        Ok(())
    }

    fn regroup(&mut self, gpu: &Gpu) {
        self.group = surface_group(
            gpu,
            &self.layout,
            &self.deformation,
            &self.pages,
            &self.atlas,
            &self.sampler,
            &self.inspection,
            &self.area_lights,
        );
    }

    /// Bytes of vertices, indices, atlas and area lights on the card; textures of materials not counted.
    pub fn bytes(&self) -> u64 {
        self.meshes.iter().map(GpuMesh::bytes).sum::<u64>()
            + self.atlas.bytes()
            + self.inspection.bytes()
            + self.area_lights.bytes()
    }

    /// Writes everything that moves, and sorts the instances into batches.
    pub(super) fn place(&mut self, gpu: &Gpu, pose: &Pose) {
        let mut order: Vec<(usize, bool, usize)> = self
            .instances
            .iter()
            .zip(&pose.instances)
            .enumerate()
            .map(|(i, (slot, posed))| {
                (slot.0, Mat3::from(posed.world_from_mesh.matrix3).determinant() < 0.0, i)
            })
            .collect();
        order.sort_unstable();
        std::mem::swap(&mut self.raw, &mut self.raw_before);
        self.raw.clear();
        self.batches.clear();
        for &(mesh, mirrored, i) in &order {
            let rest = rows(&glam::Affine3A::from_mat3(self.scene.instances[i].rest_from_mesh));
            let bits = self.instances[i].1 | if mirrored { INSTANCE_MIRRORED } else { 0 };
            let slot = self.raw.len() as u32;
            self.raw.push(InstanceRaw {
                world: rows(&pose.instances[i].world_from_mesh),
                rest,
                ids: [i as u32, self.pages.first(i), self.deformation.headers[i], bits],
            });
            match self.batches.last_mut() {
                Some(batch) if batch.mesh == mesh && batch.mirrored == mirrored => batch.count += 1,
                _ => self.batches.push(Batch { mesh, mirrored, first: slot, count: 1 }),
            }
        }
        let bytes: &[u8] = bytemuck::cast_slice(&self.raw);
        if bytes != bytemuck::cast_slice::<_, u8>(&self.raw_before) {
            self.instance_buffer.write(gpu, bytes);
        }
        self.pages.write(gpu);
        self.motion.now += 1;
        let now = self.motion.now;
        let last = &mut self.motion.last;
        last.resize(self.instances.len(), (now, [[0.0; 4]; 3]));
        for raw in &self.raw {
            let slot = &mut last[raw.ids[0] as usize];
            // As bytes, or what is no number would move for ever.
            if bytemuck::bytes_of(&slot.1) != bytemuck::bytes_of(&raw.world) {
                *slot = (now, raw.world);
            }
        }
        self.deformation.write_pose(gpu, &self.scene, pose, |instance| last[instance].0 = now);
        self.bounds.place(&self.scene, pose);
    }

    /// The number of the pose that is placed; each one is greater than those before.
    pub(super) fn now(&self) -> u64 {
        self.motion.now
    }

    /// The number of the pose in which an instance came to where, and got the shape that, it has now.
    pub(super) fn moved_at(&self, instance: usize) -> u64 {
        self.motion.last[instance].0
    }

    /// The instance that stands at a place of the instance buffer.
    pub(super) fn instance_at(&self, slot: u32) -> usize {
        self.raw[slot as usize].ids[0] as usize
    }
}

#[allow(clippy::too_many_arguments, reason = "a group has that many entries")]
fn surface_group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    deformation: &Deformation,
    pages: &PageTable,
    atlas: &AtlasTexture,
    sampler: &wgpu::Sampler,
    inspection: &AtlasTexture,
    area_lights: &AreaLightTextures,
) -> wgpu::BindGroup {
    use wgpu::BindingResource::{Sampler, TextureView};
    let resources = [
        TextureView(&deformation.pose_view),
        TextureView(&deformation.deform_view),
        TextureView(&pages.view),
        TextureView(atlas.view()),
        Sampler(sampler),
        TextureView(inspection.view()),
        TextureView(area_lights.atlas_view()),
        TextureView(area_lights.table_view()),
    ];
    layouts::group(&gpu.device, layout, &resources)
}

/// Whether every index is in range and every buffer fits the device.
fn check_sizes(gpu: &Gpu, scene: &Scene) -> Result<(), ForwardError> {
    let limit = gpu.device.limits().max_buffer_size;
    for (m, mesh) in scene.meshes.iter().enumerate() {
        // Split at every corner, a triangle has three vertices of its own, 32 bytes each in the largest buffer.
        let bytes = (mesh.positions.len() as u64).max(3 * mesh.triangles.len() as u64) * 32;
        if bytes > limit {
            return Err(ForwardError::MeshTooLarge { mesh: m, name: mesh.name.clone(), bytes, limit });
        }
        if mesh.triangles.iter().flatten().any(|&v| v as usize >= mesh.positions.len()) {
            let reason =
                format!("a triangle of mesh {m} ({:?}) refers to a vertex that is not there", mesh.name);
            return Err(crate::RenderError::Scene { reason }.into());
        }
    }
    Ok(())
}
