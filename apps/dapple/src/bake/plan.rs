//! What of the file is baked: its meshes, their vertices as they stand in accessors, and which instances share a bake.

use anyhow::{Context, Result};
use dapple_scene::{Mesh, MeshOrigin, Origins};
use dapple_trace::sampling::hash;

use super::document::{Document, List};
use super::json::Object;
use super::surfaces::{Measured, Place, Surfaces};

/// A vertex buffer that is mostly unused by a mesh is not written anew for it, only what is used of it.
const LEAST_USED: f64 = 0.5;

/// Root mean square difference of visibility from which on two instances get bakes of their own.
const NOTICEABLE: f64 = 0.02;

/// Places at which instances are compared, and rays of each.
const COMPARED: std::ops::RangeInclusive<usize> = 64..=512;
const COMPARED_RAYS: u32 = 64;

/// Most instances that a shared bake is the mean of.
const MOST_MEMBERS: usize = 16;

/// A mesh of the file that is baked.
#[derive(Debug)]
pub(crate) struct MeshPlan {
    /// Index of the mesh, in the file as in the scene.
    pub(crate) mesh: usize,
    pub(crate) pools: Vec<Pool>,
    /// For each part of the mesh its pool.
    pub(crate) pool_of_part: Vec<usize>,
    pub(crate) copies: Vec<Copy>,
}

/// Instances that share one bake of their mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Copy {
    /// Indices into the scene's instances.
    pub(crate) instances: Vec<u32>,
    /// Those of them that are measured.
    pub(crate) members: Vec<u32>,
}

/// Primitives that have all their vertices in common.
#[derive(Debug)]
pub(crate) struct Pool {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) attributes: Object,
    /// For each vertex that will be written the element it is a copy of; `None` while vertices stay as they are.
    pub(crate) sources: Option<Vec<u32>>,
    /// Elements of the accessors.
    pub(crate) count: usize,
    /// Whether the file gives normals. Otherwise faces are flat, whatever vertices they share.
    pub(crate) has_normals: bool,
}

/// Triangles of a part.
pub(crate) fn triangles_of(mesh: &Mesh, part: usize) -> std::ops::Range<usize> {
    let part = &mesh.parts[part];
    part.first_triangle as usize..(part.first_triangle + part.triangle_count) as usize
}

/// Finds the meshes to bake, and the pools of their vertices; copies are not decided yet: all instances share one.
pub(crate) fn plan(document: &Document, origins: &Origins, surfaces: &Surfaces<'_>) -> Result<Vec<MeshPlan>> {
    let scene = surfaces.scene;
    let mut instances = vec![Vec::new(); scene.meshes.len()];
    for (index, instance) in (0u32..).zip(&scene.instances).filter(|(_, instance)| instance.receives) {
        instances[instance.mesh as usize].push(index);
    }
    let mut plans = Vec::new();
    for (mesh, instances) in instances.into_iter().enumerate().filter(|(_, list)| !list.is_empty()) {
        let (pools, pool_of_part) = pools(document, &scene.meshes[mesh], &origins.meshes[mesh], mesh)
            .with_context(|| format!("meshes[{mesh}]"))?;
        let copies = vec![Copy::new(instances)];
        plans.push(MeshPlan { mesh, pools, pool_of_part, copies });
    }
    Ok(plans)
}

fn pools(
    document: &Document,
    mesh: &Mesh,
    origin: &MeshOrigin,
    index: usize,
) -> Result<(Vec<Pool>, Vec<usize>)> {
    let primitives = document.object(List::Meshes, index)?.list("primitives")?;
    let mut pools: Vec<Pool> = Vec::new();
    let mut keys: Vec<String> = Vec::new();
    let mut pool_of_part = Vec::new();
    for (part, &primitive) in origin.primitives.iter().enumerate() {
        let primitive = Object::parse(primitives.get(primitive as usize).context("a primitive is gone")?)?;
        let attributes = primitive.object("attributes")?;
        let key = format!(
            "{} {}",
            attributes.to_raw()?,
            primitive.get("targets").map_or("", |targets| targets.get())
        );
        let pool = match keys.iter().position(|known| *known == key) {
            Some(pool) => pool,
            None => {
                let position = attributes.whole("POSITION")?.context("a primitive has no POSITION")?;
                let count = document.object(List::Accessors, position)?.whole("count")?.unwrap_or(0);
                let has_normals = attributes.has("NORMAL");
                pools.push(Pool { pieces: Vec::new(), attributes, sources: None, count, has_normals });
                keys.push(key);
                pools.len() - 1
            }
        };
        pools[pool].pieces.push(Piece { part, triangles: Vec::new(), page: 0 });
        pool_of_part.push(pool);
    }
    for pool in &mut pools {
        let element = |v: u32| origin.vertices[v as usize];
        let of = |piece: &Piece| &mesh.triangles[triangles_of(mesh, piece.part)];
        let mut used: Vec<u32> =
            pool.pieces.iter().flat_map(|piece| of(piece).as_flattened()).map(|&v| element(v)).collect();
        used.sort_unstable();
        used.dedup();
        if (used.len() as f64) < LEAST_USED * pool.count as f64 {
            for piece in &mut pool.pieces {
                let index = |v: u32| used.partition_point(|&e| e < element(v)) as u32;
                piece.triangles = of(piece).iter().map(|t| t.map(index)).collect();
            }
            pool.sources = Some(used);
        }
    }
    Ok((pools, pool_of_part))
}

/// A primitive that will be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    /// Part of the mesh that it is made of.
    pub(crate) part: usize,
    /// Its triangles, once vertices do not stay as they are.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Page of the atlas that it reads.
    pub(crate) page: u32,
}

impl Pool {
    /// The parts that its pieces are made of, ascending.
    pub(crate) fn parts(&self) -> Vec<usize> {
        let mut parts: Vec<usize> = self.pieces.iter().map(|piece| piece.part).collect();
        parts.dedup();
        parts
    }

    /// Whether a part is written in several pieces, as its triangles lie on several images.
    pub(crate) fn spans_pages(&self) -> bool {
        self.pieces.windows(2).any(|pair| pair[0].part == pair[1].part)
    }
}

impl Copy {
    fn new(instances: Vec<u32>) -> Copy {
        let step = instances.len().div_ceil(MOST_MEMBERS).max(1);
        let members = instances.iter().copied().step_by(step).collect();
        Copy { instances, members }
    }
}

/// Gives instances of a mesh that are lit differently copies of their own. `done` is told of each instance that was compared.
///
/// All instances are measured at the same places of the mesh with the same rays about its own axes ([`Surfaces::measure`]): random
/// errors are common to them, and only what differs is left.
pub(crate) fn split_instances(plans: &mut [MeshPlan], surfaces: &Surfaces<'_>, done: &dyn Fn()) {
    for plan in plans.iter_mut().filter(|plan| plan.copies[0].instances.len() > 1) {
        let instances = std::mem::take(&mut plan.copies[0].instances);
        let places = comparison_places(surfaces, instances[0]);
        // The first instance of each copy speaks for it.
        let mut copies: Vec<(Vec<Measured>, Vec<u32>)> = Vec::new();
        for &instance in &instances {
            let moved: Vec<Place> = places.iter().map(|place| Place { instance, ..*place }).collect();
            let values = surfaces.measure(&moved, COMPARED_RAYS);
            match copies.iter_mut().find(|(known, _)| difference(known, &values) <= NOTICEABLE) {
                Some((_, members)) => members.push(instance),
                None => copies.push((values, vec![instance])),
            }
            done();
        }
        plan.copies = copies.into_iter().map(|(_, instances)| Copy::new(instances)).collect();
    }
}

/// Root mean square difference of visibility over the places that can be seen on one of both at least.
fn difference(a: &[Measured], b: &[Measured]) -> f64 {
    let seen = a.iter().zip(b).filter(|(a, b)| !(a.hidden && b.hidden));
    let (squares, count) = seen.fold((0.0, 0), |(squares, count), (a, b)| {
        let difference = f64::from(a.visibility - b.visibility);
        (squares + difference * difference, count + 1)
    });
    (squares / f64::from(count.max(1))).sqrt()
}

/// Places on an instance, even by area.
fn comparison_places(surfaces: &Surfaces<'_>, instance: u32) -> Vec<Place> {
    let triangles = surfaces.mesh_of(instance as usize).triangles.len();
    let mut sum = 0.0;
    let cumulative: Vec<f64> = (0..triangles)
        .map(|t| {
            sum += surfaces.area_m2(instance as usize, t);
            sum
        })
        .collect();
    let count = (triangles / 2).clamp(*COMPARED.start(), *COMPARED.end());
    (0..count as u32)
        .map(|i| {
            let at = (f64::from(i) + 0.5) / count as f64 * sum;
            let triangle = cumulative.partition_point(|&c| c <= at).min(triangles - 1) as u32;
            Place {
                instance,
                triangle,
                weights: place_in_triangle(u64::from(i), 0),
                key: u64::from(i),
                turn: 0,
            }
        })
        .collect()
}

/// Place `index` of an endless sequence that covers a triangle evenly, shifted by `seed`: weights of the second and third
/// corner. The steps are those of M. Roberts' R2 sequence, 1 / g and 1 / g² with g³ = g + 1.
pub(crate) fn place_in_triangle(seed: u64, index: u32) -> [f32; 2] {
    const STEPS: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];
    let unit = |k: usize| {
        let shift = f64::from(hash(seed, 0x7ab1e, k as u32)) / 4_294_967_296.0;
        (shift + STEPS[k] * f64::from(index + 1)).fract() as f32
    };
    let (u, v) = (unit(0), unit(1));
    // Folded over the diagonal; never quite on a border.
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    let inwards = |x: f32| 1e-3 / 3.0 + 0.999 * x;
    [inwards(u), inwards(v)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_hidden_on_both_does_not_tell_instances_apart() {
        let at = |visibility: f32, hidden: bool| Measured { visibility, hidden, ..Measured::default() };
        let open = [at(1.0, false), at(0.5, false), at(0.0, true), at(0.0, true)];
        assert_eq!(difference(&open, &open), 0.0);
        let inside = [at(1.0, false), at(0.5, false), at(1.0, true), at(0.7, true)];
        assert_eq!(difference(&open, &inside), 0.0);
        // Seen on one of them it counts: three places, one of which differs by 1.
        let out = [at(1.0, false), at(0.5, false), at(1.0, false), at(0.0, true)];
        assert!((difference(&open, &out) - (1.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(difference(&[at(0.0, true)], &[at(1.0, true)]), 0.0);
    }
}
