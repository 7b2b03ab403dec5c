//! The sending end: which patches may be seen, how many texels each gets, their visibility, the picture.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Result, bail};
use dapple_render::gbuffer::rasterize;
use dapple_scene::glam::{Mat3, Vec3};
use dapple_scene::{Aabb, Pose, PosedCamera, Projection, Scene};
use dapple_trace::Tracer;
use dapple_trace::inside::{Solids, find_inside};
use dapple_trace::rtao::{RtaoParams, Site, trace_visibility};

use super::atlas::{Atlas, Block, LEAST_SIDE, MOST_SIDE};
use super::patches::Patch;
use super::video::Sender;
use super::{Blocks, Numbers, SasFrame, SasStep};
use crate::bake::fill::Planes;

/// What a server depends on beside its scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::eval) struct SasParams {
    /// Pixels of a side that share a texel, B of `[Neff2023]`.
    pub(in crate::eval) bias: u32,
    /// Server steps a second.
    pub(in crate::eval) hz: f64,
    /// The picture that patches are measured in, pixels.
    pub(in crate::eval) size: (u32, u32),
    /// Rays a texel, their length in metres, and their seed.
    pub(in crate::eval) rays: RtaoParams,
}

/// How much wider the field of view of the server is on each side, radians (20°): as for the paper's own scheme.
const MARGIN: f32 = 0.349_066;
/// Half an angle of view that is not exceeded, radians (85°).
const WIDEST: f32 = 1.483_53;
/// Patches keep their texels for so long while they are not seen, seconds.
const KEPT_S: f64 = 2.0;
/// Texels that lie inside are filled ring by ring so far, then with coarse means.
const FILLED_RINGS: u32 = 2;
/// Longest side of the picture that says what is seen, pixels.
const MOST_PIXELS: u32 = 2048;
/// Samples of it along each axis of a pixel.
const SAMPLES: u32 = 2;
/// Nothing counts as nearer, metres.
const LEAST_DISTANCE_M: f32 = 1e-3;
/// The atlas has so many times the texels of the first picture.
const SPARE: f64 = 2.0;

/// Patches that are seen, by number: the most pixels that a metre of it takes.
type Seen = BTreeMap<u32, f32>;

/// A patch that has texels.
#[derive(Debug, Clone)]
struct Held {
    block: Block,
    /// Step in which it was last seen.
    seen: u64,
    /// Whether its texels are those of the present.
    current: bool,
    /// Which of them lie inside of bodies, found when they were first traced: as our points, they are judged once. `None` before.
    inside: Option<Box<[bool]>>,
}

pub(in crate::eval) struct SasServer {
    scene: Arc<Scene>,
    params: SasParams,
    numbers: Numbers,
    tracer: Tracer,
    solids: Solids,
    moving: Vec<bool>,
    /// Of casting movers in the step before, by instance.
    reach: Vec<Option<Aabb>>,
    atlas: Atlas,
    held: BTreeMap<u32, Held>,
    luma: Vec<u8>,
    /// As last sent.
    blocks: Blocks,
    sender: Sender,
    step: u64,
    /// Whether it was said that there is no room for all.
    warned: bool,
}

impl SasServer {
    /// One that has sent nothing; the first picture that `camera` takes at time 0 says how large the atlas is.
    pub(in crate::eval) fn new(
        scene: Arc<Scene>,
        tracer: Tracer,
        camera: &PosedCamera,
        params: SasParams,
    ) -> Result<SasServer> {
        if !(1..=1024).contains(&params.bias) {
            bail!("sas-{}: the bias must be 1 to 1024", params.bias);
        }
        let numbers = Numbers::new(&scene);
        let solids = Solids::new(&scene);
        let moving = scene.moving_instances();
        let reach = vec![None; scene.instances.len()];
        let mut server = SasServer {
            numbers,
            solids,
            moving,
            reach,
            tracer,
            atlas: Atlas::new(1),
            held: BTreeMap::new(),
            luma: Vec::new(),
            blocks: Blocks::default(),
            sender: Sender::new(LEAST_SIDE, LEAST_SIDE, params.hz)?,
            step: 0,
            warned: false,
            scene,
            params,
        };
        let pose = server.scene.pose(0.0);
        let seen = server.look(&pose, camera)?;
        let texels: u64 = (seen.iter())
            .map(|(&number, &pixels)| {
                server.wanted(&pose, number, pixels).map(u64::from).iter().product::<u64>()
            })
            .sum();
        server.atlas = Atlas::new((SPARE * texels as f64) as u64);
        let (width, height) = server.size();
        server.luma = vec![u8::MAX; (width * height) as usize];
        server.sender = Sender::new(width, height, params.hz)?;
        Ok(server)
    }

    /// Of the atlas, texels.
    pub(in crate::eval) fn size(&self) -> (u32, u32) {
        (self.atlas.width, self.atlas.height)
    }

    pub(super) fn numbers(&self) -> &Numbers {
        &self.numbers
    }

    pub(in crate::eval) fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Texels that are in use.
    pub(in crate::eval) fn texels(&self) -> u64 {
        self.held.values().map(|h| u64::from(h.block.width) * u64::from(h.block.height)).sum()
    }

    /// The texels of each patch that the last step saw.
    #[cfg(test)]
    pub(super) fn texels_seen(&self) -> BTreeMap<u32, Vec<u8>> {
        let of = |block: Block| {
            let row = |y: u16| {
                let first = usize::from(y) * self.atlas.width as usize + usize::from(block.x);
                &self.luma[first..first + usize::from(block.width)]
            };
            (block.y..block.y + block.height).flat_map(row).copied().collect()
        };
        let seen = self.held.iter().filter(|(_, held)| held.seen == self.step);
        seen.map(|(&number, held)| (number, of(held.block))).collect()
    }

    /// Brings the scene to `now_s`, shades what `camera` may see soon, and encodes the atlas, if anything in it is another than in
    /// the step before.
    pub(in crate::eval) fn step(&mut self, now_s: f64, camera: &PosedCamera) -> Result<SasStep> {
        self.step += 1;
        let pose = self.scene.pose(now_s);
        self.tracer.update(&self.scene, &pose);
        self.expire(&pose);
        let seen = self.look(&pose, camera)?;
        self.place(&pose, &seen);
        let (rays, changed) = self.shade(&pose, &seen);
        let mut blocks = vec![None; self.numbers.count as usize];
        for (&number, held) in &self.held {
            blocks[number as usize] = Some(held.block);
        }
        if !changed && self.step > 1 && *self.blocks == blocks {
            return Ok(SasStep { frame: None, rays });
        }
        self.blocks = Blocks::new(blocks);
        let frame = SasFrame { video: self.sender.encode(&self.luma)?, blocks: self.blocks.clone() };
        Ok(SasStep { frame: Some(frame), rays })
    }

    /// Patches in the extended field of view.
    fn look(&self, pose: &Pose, camera: &PosedCamera) -> Result<Seen> {
        let (width, height) = self.params.size;
        let pixels_at_one_metre = match camera.projection {
            Projection::Perspective { yfov, .. } => 0.5 * height as f32 / libm::tanf(0.5 * yfov),
            Projection::Orthographic { half_height, .. } => 0.5 * height as f32 / half_height,
        };
        let is_perspective = matches!(camera.projection, Projection::Perspective { .. });
        let (camera, growth) = extended(camera, width as f32 / height as f32);
        let side = |pixels: u32, growth: f32| ((pixels as f32 * growth).ceil() as u32).clamp(1, MOST_PIXELS);
        // Other samples in each step, so that what lies between them is found in time.
        let shift = (5 * self.step % 8) as u32;
        let (width, height) = (side(width, growth[0]) + shift, side(height, growth[1]) + shift);
        let gbuffer = rasterize(&self.scene, pose, &camera, width, height, SAMPLES)?;
        let eye = camera.eye_world();
        let found = gbuffer.map_surfaces(&self.scene, pose, |index, surface| {
            let sample = gbuffer.samples()[index];
            let distance_m = surface?.position_world.distance(eye).max(LEAST_DISTANCE_M);
            let (instance, triangle) = (sample.instance, sample.triangle);
            let (number, _) =
                self.numbers.find(instance, triangle, sample.barycentrics, sample.is_back_face())?;
            Some((
                number,
                if is_perspective { pixels_at_one_metre / distance_m } else { pixels_at_one_metre },
            ))
        });
        let mut seen = Seen::new();
        for (number, pixels) in found.into_iter().flatten() {
            let most = seen.entry(number).or_insert(pixels);
            *most = most.max(pixels);
        }
        Ok(seen)
    }

    /// The instance and the patch of a number.
    fn patch(&self, number: u32) -> (usize, &Patch, bool) {
        let instance = self.numbers.first.partition_point(|(first, _)| *first <= number) - 1;
        let (first, mesh) = self.numbers.first[instance];
        let patch = &self.numbers.patches[mesh as usize].patches[((number - first) / 2) as usize];
        (instance, patch, (number - first) % 2 == 1)
    }

    /// Where a vertex of an instance is.
    fn corner<'a>(&'a self, pose: &'a Pose, instance: usize) -> impl Fn(u32) -> Vec3 + use<'a> {
        let world_from_mesh = pose.instances[instance].world_from_mesh;
        let positions = self.scene.vertex_positions(pose, instance);
        move |v| world_from_mesh.transform_point3(positions[v as usize])
    }

    /// Texels along both sides: the pixels that they take over the bias, as powers of two.
    fn wanted(&self, pose: &Pose, number: u32, pixels_a_metre: f32) -> [u32; 2] {
        let (instance, patch, _) = self.patch(number);
        patch.sides(self.corner(pose, instance)).map(|metres| {
            let texels = metres * pixels_a_metre / self.params.bias as f32;
            // Not a number becomes the least.
            (texels.min(MOST_SIDE as f32).ceil() as u32).next_power_of_two().clamp(LEAST_SIDE, MOST_SIDE)
        })
    }

    /// Forgets patches that were not seen for long, and notes whose texels are no longer those of the present.
    fn expire(&mut self, pose: &Pose) {
        let kept = (KEPT_S * self.params.hz).ceil() as u64;
        let (step, atlas) = (self.step, &mut self.atlas);
        self.held.retain(|_, held| {
            let keeps = held.seen + kept >= step;
            if !keeps {
                atlas.give(held.block);
            }
            keeps
        });
        let scene = self.scene.clone();
        // Boxes of what moves, then and now, as wide as rays reach.
        let mut swept = Vec::new();
        for instance in (0..scene.instances.len()).filter(|&i| self.moving[i] && scene.instances[i].casts) {
            let now = scene.instance_bounds_world(pose, instance);
            let before = self.reach[instance].replace(now).unwrap_or(now);
            swept.push(before.union(now).inflated(self.params.rays.radius_m));
        }
        let stale: Vec<u32> = (self.held.iter())
            .filter(|(number, held)| held.current && self.is_touched(pose, **number, &swept))
            .map(|(number, _)| *number)
            .collect();
        for number in stale {
            if let Some(held) = self.held.get_mut(&number) {
                held.current = false;
            }
        }
    }

    /// Whether a patch moves, or something moves within reach of it.
    fn is_touched(&self, pose: &Pose, number: u32, swept: &[Aabb]) -> bool {
        let (instance, patch, _) = self.patch(number);
        if self.moving[instance] {
            return true;
        }
        let vertices = patch.corners.into_iter().chain(patch.opposite);
        let bounds = Aabb::from_points(vertices.map(self.corner(pose, instance)));
        swept.iter().any(|reach| reach.min.cmple(bounds.max).all() && reach.max.cmpge(bounds.min).all())
    }

    /// Gives texels to what is seen. Who has some keeps them until they are too few, or four times too many.
    fn place(&mut self, pose: &Pose, seen: &Seen) {
        let mut homeless = 0;
        for (&number, &pixels) in seen {
            let wanted = self.wanted(pose, number, pixels);
            if let Some(held) = self.held.get_mut(&number) {
                held.seen = self.step;
                let has = [held.block.width, held.block.height].map(u32::from);
                let fits = |axis: usize| (wanted[axis]..=4 * wanted[axis]).contains(&has[axis]);
                if fits(0) && fits(1) {
                    continue;
                }
                let old = held.block;
                self.held.remove(&number);
                self.atlas.give(old);
            }
            let [width, height] = wanted;
            let block = self.atlas.take(width, height).or_else(|| self.atlas.take(LEAST_SIDE, LEAST_SIDE));
            match block {
                Some(block) => {
                    self.held.insert(number, Held { block, seen: self.step, current: false, inside: None });
                }
                None => homeless += 1,
            }
        }
        if homeless > 0 && !std::mem::replace(&mut self.warned, true) {
            let (width, height) = self.size();
            let bias = self.params.bias;
            tracing::warn!(
                "sas-{bias}: an atlas of {width} x {height} is full, {homeless} of {} patches stay open: raise the bias",
                seen.len()
            );
        }
    }

    /// Traces texels of what is seen that are not those of the present. How many rays it took, and whether any texel changed.
    fn shade(&mut self, pose: &Pose, seen: &Seen) -> (u64, bool) {
        let mut sites = Vec::new();
        let mut numbers = Vec::new();
        for &number in seen.keys() {
            let Some(held) = self.held.get(&number).filter(|held| !held.current) else { continue };
            let (instance, patch, is_back) = self.patch(number);
            let corner = self.corner(pose, instance);
            let flip = Mat3::from(pose.instances[instance].world_from_mesh.matrix3).determinant() < 0.0;
            let Block { width, height, .. } = held.block;
            let at = |i: u16, side: u16| (f32::from(i) + 0.5) / f32::from(side);
            for (j, i) in (0..height).flat_map(|j| (0..width).map(move |i| (j, i))) {
                let (place, normal) = patch.surface([at(i, width), at(j, height)], &corner);
                let normal_world = if is_back != flip { -normal } else { normal };
                // Keyed by the place in the patch, so that a texel that is traced again gets the same rays.
                let key = u64::from(number) << 16 | u64::from(j) << 8 | u64::from(i);
                sites.push(Site { position_world: place, normal_world, key });
            }
            numbers.push(number);
        }
        let mut visibility = vec![1.0; sites.len()];
        trace_visibility(&self.tracer, &sites, &self.params.rays, &mut visibility);
        let (mut changed, mut first) = (false, 0);
        for number in numbers {
            let Some(held) = self.held.get_mut(&number) else { continue };
            let block = held.block;
            let (width, height) = (usize::from(block.width), usize::from(block.height));
            let of = first..first + width * height;
            first = of.end;
            let inside = held.inside.get_or_insert_with(|| {
                let mut inside = vec![false; of.len()];
                find_inside(&self.scene, &self.tracer, &self.solids, &sites[of.clone()], &mut inside);
                inside.into()
            });
            let values = without_inside(&visibility[of], inside, (width, height));
            for (row, values) in values.chunks(width).enumerate() {
                let start = (usize::from(block.y) + row) * self.atlas.width as usize + usize::from(block.x);
                for (texel, visibility) in self.luma[start..start + width].iter_mut().zip(values) {
                    let value = (255.0 * visibility).round() as u8;
                    changed |= std::mem::replace(texel, value) != value;
                }
            }
        }
        for number in seen.keys() {
            if let Some(held) = self.held.get_mut(number) {
                held.current = true;
            }
        }
        (sites.len() as u64 * u64::from(self.params.rays.rays), changed)
    }
}

/// The texels of a patch, those inside of bodies by their neighbours: nobody sees them, and their darkness must not be
/// interpolated to where somebody does. Where all are inside they stay.
fn without_inside<'a>(
    visibility: &'a [f32],
    inside: &[bool],
    (width, height): (usize, usize),
) -> Cow<'a, [f32]> {
    if !inside.contains(&true) || !inside.contains(&false) {
        return Cow::Borrowed(visibility);
    }
    let known = inside.iter().map(|inside| !inside).collect();
    // What is not known must not count.
    let values = visibility.iter().zip(inside).map(|(v, inside)| if *inside { 0.0 } else { *v }).collect();
    let mut planes = Planes { width, height, channels: vec![values], known };
    planes.fill(FILLED_RINGS, &[1.0]);
    Cow::Owned(planes.channels.swap_remove(0))
}

/// A camera that sees further on all sides, and how much larger its picture is.
fn extended(camera: &PosedCamera, aspect: f32) -> (PosedCamera, [f32; 2]) {
    match camera.projection {
        Projection::Perspective { yfov, near } => {
            let tangent = |angle: f32| libm::tanf(angle.min(WIDEST));
            let half = [libm::atanf(aspect * tangent(0.5 * yfov)), 0.5 * yfov];
            // One lens has one aspect: both sides grow as the one that grows more.
            let growth = half.map(|h| tangent(h + MARGIN) / tangent(h)).into_iter().fold(1.0, f32::max);
            let yfov = 2.0 * libm::atanf(growth * tangent(half[1]));
            let projection = Projection::Perspective { yfov, near };
            (PosedCamera { projection, ..*camera }, [growth; 2])
        }
        Projection::Orthographic { half_height, near, far } => {
            let growth = 1.0 + libm::tanf(MARGIN);
            let projection = Projection::Orthographic { half_height: growth * half_height, near, far };
            (PosedCamera { projection, ..*camera }, [growth; 2])
        }
    }
}
