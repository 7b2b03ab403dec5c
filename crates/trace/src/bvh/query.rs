//! The queries that the rest of the crate asks.

use std::ops::Range;

use dapple_scene::glam::Vec3;
use fearless_simd::{Simd, dispatch};

use super::alpha::AlphaMaterials;
use super::bundle::{BUNDLE, Bundle, Reach};
use super::stack::Stack;
use super::tracer::{Blockers, PlacedBvh, Top, Tracer};
use super::traverse::{Blocker, Boxes, Visitor, trace_bundle, traverse};
use super::tree::{CONSERVATIVE, Child, TINY, WIDTH};
use super::triangle::{MeshRay, TriangleHit};
use super::{BlockedMask, Hit, MAX_DIRECTIONS, Ray};

impl Tracer {
    /// Which of `directions_world` (unit length, the first [`MAX_DIRECTIONS`]) are blocked within `t_max` metres of
    /// `origin_world`, as [`Tracer::occluded`] would answer one by one.
    pub fn occlusion(&self, origin_world: Vec3, directions_world: &[Vec3], t_max: f32) -> BlockedMask {
        let all = [u64::MAX; MAX_DIRECTIONS / BUNDLE];
        self.occlusion_by(Blockers::All, origin_world, directions_world, t_max, &all)
    }

    /// As [`Tracer::occlusion`], asking only `blockers`, and only about directions whose bit is set in `open`: those
    /// of them that are blocked.
    pub fn occlusion_by(
        &self,
        blockers: Blockers,
        origin_world: Vec3,
        directions_world: &[Vec3],
        t_max: f32,
        open: &BlockedMask,
    ) -> BlockedMask {
        let tops = match blockers {
            Blockers::Still => [Some(&self.still), None],
            Blockers::Movers => [Some(&self.moving), None],
            Blockers::All => [Some(&self.still), Some(&self.moving)],
        };
        let directions_world = &directions_world[..directions_world.len().min(MAX_DIRECTIONS)];
        let mut blocked = BlockedMask::default();
        for ((word, directions), open) in blocked.iter_mut().zip(directions_world.chunks(BUNDLE)).zip(open) {
            let open = open & (u64::MAX >> (BUNDLE - directions.len()));
            if open != 0 {
                *word = dispatch!(self.level, simd => self.blocked(simd, &tops, origin_world, directions, t_max, open));
            }
        }
        blocked
    }

    /// Those of at most [`BUNDLE`] directions whose bit is set in `open` that something blocks.
    #[inline(always)]
    fn blocked<S: Simd>(
        &self,
        simd: S,
        tops: &[Option<&Top>; 2],
        origin_world: Vec3,
        directions_world: &[Vec3],
        t_max: f32,
        open: u64,
    ) -> u64 {
        let mut world = Bundle::new();
        world.fill(origin_world, directions_world, t_max);
        world.prepare(simd, open);
        let mut open = world.valid;
        let mut blocked = 0;
        let mut mesh = None;
        for top in tops.iter().flatten().filter(|top| !top.tree.nodes.is_empty()) {
            let (reach, t_far) = world.reach(simd, &top.bounds);
            let mut instances =
                Instances { tracer: self, top, world: &world, reach: &reach, t_far, mesh: &mut mesh };
            let hit = traverse(simd, &world, &reach, t_far, &top.tree, open, &mut instances);
            open &= !hit;
            blocked |= hit;
        }
        blocked
    }

    /// Whether anything blocks the ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        dispatch!(self.level, simd => {
            let mut any = AnyInstance { alpha: &self.alpha, ray, blocked: false };
            self.visit_instances(simd, ray, &mut any);
            any.blocked
        })
    }

    /// The nearest thing that the ray meets; of equally near ones that of the lowest instance, then triangle.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        dispatch!(self.level, simd => {
            let mut closest = ClosestInstance { alpha: &self.alpha, ray, best: None };
            self.visit_instances(simd, ray, &mut closest);
            closest.best
        })
    }

    /// Everything that the ray meets, by distance, then instance, then triangle. `hits` is cleared first.
    ///
    /// As many hits as there are triangles are possible; a ray through a shared edge meets both of its triangles.
    pub fn all_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        hits.clear();
        dispatch!(self.level, simd => {
            self.visit_instances(simd, ray, &mut AllInstances { alpha: &self.alpha, ray, hits })
        });
        let order = |a: &Hit, b: &Hit| {
            a.t.total_cmp(&b.t).then((a.instance, a.triangle).cmp(&(b.instance, b.triangle)))
        };
        hits.sort_unstable_by(order);
    }

    /// Shows the instances whose box the ray may touch to `visitor`, near ones first.
    #[inline(always)]
    fn visit_instances<S: Simd>(&self, simd: S, ray: &Ray, visitor: &mut impl InstanceVisitor<S>) {
        let Some(world) = MeshRay::new(ray.origin_world, ray.direction_world, ray.t_max) else { return };
        let mut t_max = ray.t_max;
        for top in [&self.still, &self.moving].into_iter().filter(|top| !top.tree.nodes.is_empty()) {
            // Leaves by their index beyond the nodes'.
            let nodes = top.tree.nodes.len() as u32;
            let mut stack: Stack<(f32, u32), 24> = Stack::new((0.0, 0));
            while let Some((enter, index)) = stack.pop() {
                if enter > t_max * CONSERVATIVE + TINY {
                    continue;
                }
                if index >= nodes {
                    let instance = top.tree.order[(index - nodes) as usize];
                    let Some(placed) = &self.instances[instance as usize] else { continue };
                    match visitor.visit(simd, placed, instance) {
                        Some(t) => t_max = t,
                        None => return,
                    }
                    continue;
                }
                let node = &top.tree.nodes[index as usize];
                let (mut slots, enter) = Boxes::new(simd, node, &world.origin).through(world.inverse, t_max);
                let enter = <[f32; WIDTH]>::from(enter);
                let mut met = [(0.0_f32, 0_u32); WIDTH];
                let mut count = 0;
                while slots != 0 {
                    let slot = slots.trailing_zeros() as usize;
                    slots &= slots - 1;
                    let child = match node.child(slot) {
                        Child::Inner(child) => child,
                        Child::Leaf(range) => nodes + range.start as u32,
                        Child::Empty => continue,
                    };
                    // Nearest on top.
                    let mut at = count;
                    while at > 0 && met[at - 1].0 < enter[slot] {
                        met[at] = met[at - 1];
                        at -= 1;
                    }
                    met[at] = (enter[slot], child);
                    count += 1;
                }
                for &item in &met[..count] {
                    stack.push(item);
                }
            }
        }
    }
}

/// What a single ray does at an instance: how far it still goes, `None` to end.
trait InstanceVisitor<S: Simd> {
    fn visit(&mut self, simd: S, placed: &PlacedBvh, instance: u32) -> Option<f32>;
}

struct AnyInstance<'a> {
    alpha: &'a AlphaMaterials,
    ray: &'a Ray,
    blocked: bool,
}

impl<S: Simd> InstanceVisitor<S> for AnyInstance<'_> {
    #[inline(always)]
    fn visit(&mut self, simd: S, placed: &PlacedBvh, _: u32) -> Option<f32> {
        let ray = placed.placement.ray(self.ray);
        self.blocked =
            ray.is_some_and(|ray| placed.bvh.any_hit(simd, 0, &placed.bvh.quick(&ray), self.alpha));
        if self.blocked { None } else { Some(self.ray.t_max) }
    }
}

struct ClosestInstance<'a> {
    alpha: &'a AlphaMaterials,
    ray: &'a Ray,
    best: Option<Hit>,
}

impl<S: Simd> InstanceVisitor<S> for ClosestInstance<'_> {
    #[inline(always)]
    fn visit(&mut self, simd: S, placed: &PlacedBvh, instance: u32) -> Option<f32> {
        let t_best = self.best.map_or(self.ray.t_max, |b| b.t);
        if let Some(ray) = placed.placement.ray(self.ray)
            && let Some((triangle, hit)) = placed.bvh.closest_hit(simd, &ray, t_best, self.alpha)
            && self.best.is_none_or(|b| hit.t < b.t || instance < b.instance)
        {
            self.best = Some(hit_of(instance, triangle, &hit));
        }
        Some(self.best.map_or(self.ray.t_max, |b| b.t))
    }
}

struct AllInstances<'a> {
    alpha: &'a AlphaMaterials,
    ray: &'a Ray,
    hits: &'a mut Vec<Hit>,
}

impl<S: Simd> InstanceVisitor<S> for AllInstances<'_> {
    #[inline(always)]
    fn visit(&mut self, simd: S, placed: &PlacedBvh, instance: u32) -> Option<f32> {
        if let Some(ray) = placed.placement.ray(self.ray) {
            let found = |triangle, hit: TriangleHit| self.hits.push(hit_of(instance, triangle, &hit));
            placed.bvh.all_hits(simd, &ray, self.alpha, found);
        }
        Some(self.ray.t_max)
    }
}

/// Sends bundles through the instances of an upper tree.
struct Instances<'a> {
    tracer: &'a Tracer,
    top: &'a Top,
    world: &'a Bundle,
    reach: &'a Reach,
    t_far: f32,
    /// Made by the first instance that needs it.
    mesh: &'a mut Option<Bundle>,
}

impl<S: Simd> Visitor<S> for Instances<'_> {
    const IN_ORDER: bool = true;
    #[inline(always)]
    fn visit(&mut self, simd: S, range: Range<usize>, rays: u64) -> u64 {
        let instance = self.top.tree.order[range.start];
        let Some(placed) = &self.tracer.instances[instance as usize] else { return 0 };
        let blocker = Blocker { bvh: &placed.bvh, alpha: &self.tracer.alpha };
        if placed.placement.identity {
            return trace_bundle(simd, self.world, self.reach, self.t_far, blocker, rays);
        }
        let mesh = self.mesh.get_or_insert_with(Bundle::new);
        mesh.place(simd, self.world, &placed.placement, rays);
        mesh.prepare(simd, rays);
        let (reach, t_far) = mesh.reach(simd, &placed.bvh.bounds);
        trace_bundle(simd, mesh, &reach, t_far, blocker, rays)
    }
}

fn hit_of(instance: u32, triangle: u32, hit: &TriangleHit) -> Hit {
    let barycentrics = Vec3::from_array(hit.weights);
    Hit { t: hit.t, instance, triangle, barycentrics, back_face: hit.back_face }
}
