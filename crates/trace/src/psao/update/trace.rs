//! Rays of the chosen points: against everything, against movers alone, or more of them.

use dapple_scene::{Pose, Scene};
use dapple_store::points::{BentChange, BentNormal, Change, PackedNormal, PointStore};
use glam::Vec3;

use super::clusters::{Cluster, Memory, bits};
use super::motion::{Cone, Near};
use super::patterns::Patterns;
use super::{StepCounts, UpdateParams};
use crate::psao::generate::{Anchor, PosedPoint};
use crate::{BlockedMask, Blockers, MAX_DIRECTIONS, Tracer, count_blocked, offset_origin};

/// What tracing needs to know.
pub(super) struct Context<'a> {
    pub(super) scene: &'a Scene,
    pub(super) pose: &'a Pose,
    pub(super) tracer: &'a Tracer,
    pub(super) anchors: &'a [Anchor],
    pub(super) patterns: &'a Patterns,
    pub(super) params: &'a UpdateParams,
    /// Where casting movers are.
    pub(super) movers: Vec<Near>,
    /// What is known of the points.
    pub(super) known: &'a PointStore,
}

/// What is traced of a point.
#[derive(Clone, Copy)]
pub(super) struct PointLight {
    /// 255 = open.
    pub(super) visibility: u8,
    /// Unbent if nobody wants it.
    pub(super) bent: BentNormal,
}

impl PointLight {
    /// What a store has of a point.
    pub(super) fn of(store: &PointStore, point: usize) -> PointLight {
        PointLight {
            visibility: store.visibility()[point],
            bent: store.bent_of(point).unwrap_or(BentNormal::UNBENT),
        }
    }

    /// Puts it into a store, with what that has room for.
    pub(super) fn put(self, store: &mut PointStore, point: u32) {
        let PointLight { visibility, bent: new } = self;
        store.apply(&[Change { point, visibility }]).expect("it is a point of the store");
        if let Some(old) = store.bent_of(point as usize) {
            store.apply_bent(&[BentChange { point, old, new }]).expect("it is a point of the store");
        }
    }
}

/// What became of one cluster's points.
#[derive(Default)]
pub(super) struct Traced {
    pub(super) changes: Vec<Change>,
    pub(super) bent_changes: Vec<BentChange>,
    pub(super) counts: StepCounts,
}

/// A point's surface, and room for its rays.
struct Surface<'a> {
    context: &'a Context<'a>,
    posed: PosedPoint,
    bitangent: Vec3,
    site: u32,
}

/// Reused from point to point.
#[derive(Default)]
pub(super) struct Scratch {
    local: Vec<Vec3>,
    world: Vec<Vec3>,
    cones: Vec<Cone>,
}

/// A collapsed triangle shows nothing; open is the neutral value.
pub(super) const NEUTRAL: PointLight = PointLight { visibility: 255, bent: BentNormal::UNBENT };

const ALL: BlockedMask = [u64::MAX; MAX_DIRECTIONS / 64];

impl<'a> Surface<'a> {
    fn new(context: &'a Context<'a>, anchor: &Anchor, instance: u32) -> Option<Surface<'a>> {
        let posed = anchor.pose(context.scene, context.pose, instance as usize)?;
        let bitangent = posed.normal.cross(posed.tangent);
        Some(Surface { context, posed, bitangent, site: anchor.site(instance) })
    }

    /// Which of the point's first directions are blocked, of those in `open`.
    fn blocked(&self, blockers: Blockers, open: &BlockedMask, scratch: &mut Scratch) -> BlockedMask {
        let local = self.context.patterns.of(self.site);
        self.ask(blockers, local, open, &mut scratch.world)
    }

    /// Of the first directions that are not `closed`, those in which a mover may be met; `None` if there are none.
    fn towards(&self, movers: &[&Near], closed: &BlockedMask, scratch: &mut Scratch) -> Option<BlockedMask> {
        let PosedPoint { position, normal, tangent } = self.posed;
        let origin_world = offset_origin(position, normal);
        let Scratch { cones, .. } = scratch;
        cones.clear();
        // To the point's own frame, instead of all directions to the world.
        let local = |axis: Vec3| Vec3::new(axis.dot(tangent), axis.dot(self.bitangent), axis.dot(normal));
        let reaching = movers.iter().filter(|near| near.reaches(position, 0.0));
        cones.extend(
            reaching
                .filter_map(|near| near.cone(origin_world, normal))
                .map(|cone| Cone { axis: local(cone.axis), ..cone }),
        );
        let mut ask = BlockedMask::default();
        if cones.is_empty() {
            return None;
        }
        let directions = self.context.patterns.of(self.site).chunks(64);
        for ((ask, closed), directions) in ask.iter_mut().zip(closed).zip(directions) {
            for cone in cones.iter() {
                let inside = |d: &Vec3| d.dot(cone.axis) >= cone.least_cosine;
                *ask |= directions.iter().rev().fold(0, |bits, d| bits << 1 | u64::from(inside(d)));
            }
            *ask &= !closed;
        }
        (ask != BlockedMask::default()).then_some(ask)
    }

    /// The bent normal, if it is wanted, with the point's first directions `blocked` like this.
    fn bent(&self, anchor: &Anchor, of: (u32, PackedNormal), blocked: &BlockedMask) -> BentNormal {
        match self.context.params.bent_normals {
            true => self.context.bent_normal(anchor, of, blocked, self.context.patterns.of(self.site)),
            false => BentNormal::UNBENT,
        }
    }

    /// How many of some of the point's directions are open.
    fn count_open(&self, blockers: Blockers, indices: std::ops::Range<u32>, scratch: &mut Scratch) -> u32 {
        let Scratch { local, world, .. } = scratch;
        local.clear();
        self.context.patterns.extend(self.site, indices, local);
        let open =
            |batch: &[Vec3]| batch.len() as u32 - count_blocked(&self.ask(blockers, batch, &ALL, world));
        local.chunks(MAX_DIRECTIONS).map(open).sum()
    }

    fn ask(
        &self,
        blockers: Blockers,
        local: &[Vec3],
        open: &BlockedMask,
        world: &mut Vec<Vec3>,
    ) -> BlockedMask {
        let PosedPoint { position, normal, tangent } = self.posed;
        world.clear();
        let to_world = |d: &Vec3| tangent * d.x + self.bitangent * d.y + normal * d.z;
        if *open == ALL {
            world.extend(local.iter().map(to_world));
        } else {
            // Those that are not asked about need not be turned; they must only be directions.
            world.resize(local.len(), normal);
            for (word, bits_set) in open.iter().enumerate() {
                for i in bits(*bits_set).map(|bit| 64 * word + bit).take_while(|i| *i < local.len()) {
                    world[i] = to_world(&local[i]);
                }
            }
        }
        let origin_world = offset_origin(position, normal);
        let Context { tracer, params, .. } = self.context;
        tracer.occlusion_by(blockers, origin_world, world, params.radius_m, open)
    }
}

impl Context<'_> {
    /// A point's light from `rays` rays against everything; its bent normal is always that of the first ones.
    pub(super) fn light(
        &self,
        anchor: &Anchor,
        of: (u32, PackedNormal),
        rays: u32,
        scratch: &mut Scratch,
    ) -> PointLight {
        let Some(surface) = Surface::new(self, anchor, of.0) else { return NEUTRAL };
        let first = self.params.rays;
        if rays != first && !self.params.bent_normals {
            let open = surface.count_open(Blockers::All, 0..rays, scratch);
            return PointLight { visibility: quantize(open, rays), bent: BentNormal::UNBENT };
        }
        let blocked = surface.blocked(Blockers::All, &ALL, scratch);
        let mut open = first - count_blocked(&blocked);
        if rays > first {
            open += surface.count_open(Blockers::All, first..rays, scratch);
        }
        PointLight { visibility: quantize(open, rays), bent: surface.bent(anchor, of, &blocked) }
    }

    /// The packed normals of points from `first` on, which are of an instance.
    pub(super) fn normals(&self, instance: u32, first: u32) -> &[PackedNormal] {
        let set = self.known.layout().set_of_instance(instance);
        set.map_or(&[], |set| &set.normals[(first - set.first) as usize..])
    }
}

impl Cluster {
    /// Traces the points that were selected, and gives those that were chosen for it more rays.
    pub(super) fn trace(&mut self, context: &Context<'_>) -> Traced {
        let mut traced = Traced::default();
        let mut scratch = Scratch::default();
        if self.selected != 0 {
            self.last_change = 0;
            if self.moving {
                let normals = context.normals(self.instance, self.first);
                for bit in bits(self.selected) {
                    let anchor = &context.anchors[self.first as usize + bit];
                    let of = (self.instance, normals[bit]);
                    let light = context.light(anchor, of, context.params.rays, &mut scratch);
                    self.report(context, bit, light, &mut traced);
                    traced.counts.traced_full += 1;
                    traced.counts.rays_full += u64::from(context.params.rays);
                }
            } else {
                self.trace_resting(context, &mut traced, &mut scratch);
            }
            self.dirty &= !self.selected;
            self.waiting &= !self.selected;
            self.selected = 0;
        }
        if self.refining != 0 {
            self.refine(context, &mut traced, &mut scratch);
            self.refining = 0;
        }
        traced
    }

    /// The estimator of `README.md`: what still instances leave open, times the share that movers leave of it.
    fn trace_resting(&mut self, context: &Context<'_>, traced: &mut Traced, scratch: &mut Scratch) {
        let rays = context.params.rays;
        let bounds = *self.bounds_world();
        let movers: Vec<&Near> = context.movers.iter().filter(|near| near.touches(&bounds)).collect();
        let normals = context.normals(self.instance, self.first);
        let Some(mut memory) = self.memory.take() else { return };
        memory.make_room(context.params.mask_words(), context.params.refines());
        for bit in bits(self.selected) {
            let anchor = &context.anchors[self.first as usize + bit];
            let Some(surface) = Surface::new(context, anchor, self.instance) else {
                self.report(context, bit, NEUTRAL, traced);
                continue;
            };
            let known = memory.valid >> bit & 1 != 0;
            if !known {
                memory.learn(bit, &surface, scratch);
            }
            let still = memory.mask(bit, context.params);
            let open = rays - count_blocked(&still);
            let (mut blocked, mut left) = (still, open);
            if let Some(ask) = surface.towards(&movers, &still, scratch) {
                let by_movers = surface.blocked(Blockers::Movers, &ask, scratch);
                left -= count_blocked(&by_movers);
                blocked.iter_mut().zip(by_movers).for_each(|(all, movers)| *all |= movers);
            }
            let [rays_still, open_still] = memory.refined_of(bit, [rays, open]);
            let visibility = estimate(open_still, rays_still, left, open);
            let bent = surface.bent(anchor, (self.instance, normals[bit]), &blocked);
            self.report(context, bit, PointLight { visibility, bent }, traced);
            if known {
                traced.counts.traced_movers += 1;
                traced.counts.rays_movers += u64::from(open);
            } else {
                traced.counts.traced_full += 1;
                traced.counts.rays_full += u64::from(rays);
            }
        }
        self.memory = Some(memory);
    }

    /// Doubles the rays of points that no mover can reach.
    fn refine(&mut self, context: &Context<'_>, traced: &mut Traced, scratch: &mut Scratch) {
        let UpdateParams { rays, rays_still, .. } = *context.params;
        let Some(mut memory) = self.memory.take() else { return };
        memory.make_room(context.params.mask_words(), context.params.refines());
        for bit in bits(self.refining) {
            let anchor = &context.anchors[self.first as usize + bit];
            let Some(surface) = Surface::new(context, anchor, self.instance) else { continue };
            if memory.valid >> bit & 1 == 0 {
                memory.learn(bit, &surface, scratch);
                traced.counts.rays_refined += u64::from(rays);
            }
            let [before, open] = memory.refined_of(bit, [rays, 0]);
            let after = (2 * before).min(rays_still);
            let open = open + surface.count_open(Blockers::Still, before..after, scratch);
            memory.refined[bit] = [after as u16, open as u16];
            memory.settled |= u64::from(after == rays_still) << bit;
            // More rays say more of how much is open, not of where: those are counted and forgotten.
            self.report_visibility(context, bit, quantize(open, after), traced);
            traced.counts.refined += 1;
            traced.counts.rays_refined += u64::from(after - before);
        }
        self.memory = Some(memory);
    }

    fn report(&mut self, context: &Context<'_>, bit: usize, light: PointLight, traced: &mut Traced) {
        self.report_visibility(context, bit, light.visibility, traced);
        let point = self.first + bit as u32;
        if let Some(old) = context.known.bent_of(point as usize).filter(|old| *old != light.bent) {
            traced.bent_changes.push(BentChange { point, old, new: light.bent });
        }
    }

    fn report_visibility(&mut self, context: &Context<'_>, bit: usize, visibility: u8, traced: &mut Traced) {
        let point = self.first + bit as u32;
        let difference = visibility.abs_diff(context.known.visibility()[point as usize]);
        self.last_change = self.last_change.max(difference);
        if difference > 0 {
            traced.changes.push(Change { point, visibility });
        }
    }
}

impl Memory {
    /// Traces a point against still instances.
    fn learn(&mut self, bit: usize, surface: &Surface<'_>, scratch: &mut Scratch) {
        let params = surface.context.params;
        let words = params.mask_words();
        let blocked = surface.blocked(Blockers::Still, &ALL, scratch);
        self.masks[bit * words..(bit + 1) * words].copy_from_slice(&blocked[..words]);
        self.valid |= 1 << bit;
        self.settled &= !(1 << bit);
        if let Some(refined) = self.refined.get_mut(bit) {
            *refined = [params.rays as u16, (params.rays - count_blocked(&blocked)) as u16];
        }
    }

    /// Directions that still instances block.
    pub(super) fn mask(&self, bit: usize, params: &UpdateParams) -> BlockedMask {
        let words = params.mask_words();
        let mut mask = BlockedMask::default();
        if let Some(stored) = self.masks.get(bit * words..(bit + 1) * words) {
            mask[..words].copy_from_slice(stored);
        }
        mask
    }

    /// Rays against still instances and how many are open; `otherwise` if points are not refined.
    fn refined_of(&self, bit: usize, otherwise: [u32; 2]) -> [u32; 2] {
        self.refined.get(bit).map_or(otherwise, |refined| refined.map(u32::from))
    }
}

/// The share of open rays as 0 … 255, rounded.
pub(super) fn quantize(open: u32, rays: u32) -> u8 {
    ((open * 255 + rays / 2) / rays) as u8
}

/// `open_still` of `rays_still` rays pass what is still, and of `open` of these movers leave `left`. Where `open` is 0
/// nothing is known of movers.
pub(super) fn estimate(open_still: u32, rays_still: u32, left: u32, open: u32) -> u8 {
    if open == 0 || left == open {
        return quantize(open_still, rays_still);
    }
    quantize(open_still * left, rays_still * open)
}
