//! Writes meshes anew: with new attributes, vertices split where they must be, and copies for instances that differ.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result};
use dapple_scene::Origins;
use serde_json::json;

use super::accessor::Attribute;
use super::document::{Document, ELEMENT_ARRAY_BUFFER, List};
use super::json::{Object, Raw};
use super::plan::{MeshPlan, Pool};

/// Extensions of primitives whose own copy of the vertices would no longer be that of the accessors.
const COMPRESSED_PRIMITIVES: [&str; 1] = ["KHR_draco_mesh_compression"];

/// What one copy of a mesh gets.
#[derive(Clone, Debug, Default)]
pub(crate) struct CopyEdit {
    /// For each pool its new attributes.
    pub(crate) attributes: Vec<Vec<Attribute>>,
    /// For each pool, for each piece what replaces its material; the material stays where there is none.
    pub(crate) materials: Vec<Vec<Option<Dressed>>>,
}

/// Materials of a piece.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Dressed {
    pub(crate) material: usize,
    /// The piece's extensions, where they name materials too.
    pub(crate) extensions: Option<String>,
}

/// Writes the copies of a mesh; gives the index of each. The first takes the place of the mesh unless that is to be kept for
/// others. `users` tells how often accessors are named: those that only this mesh names are replaced.
pub(crate) fn write_mesh(
    document: &mut Document,
    plan: &MeshPlan,
    origins: &Origins,
    edits: &[CopyEdit],
    keep: bool,
    users: Option<&[u32]>,
) -> Result<Vec<usize>> {
    let origin = &origins.meshes[plan.mesh];
    let mesh = document.object(List::Meshes, plan.mesh)?;
    let primitives = mesh.list("primitives")?;
    // What all copies share is written once.
    let mut shared = Vec::new();
    for (index, pool) in plan.pools.iter().enumerate() {
        let gets_any =
            edits.iter().any(|edit| edit.attributes.get(index).is_some_and(|list| !list.is_empty()));
        let of_part = |part: usize| Object::parse(&primitives[origin.primitives[part] as usize]);
        let own: Vec<Object> = pool.parts().into_iter().map(of_part).collect::<Result<_>>()?;
        let users = users.filter(|_| !keep);
        // What all copies get anew need not be copied first.
        let is_new = |name: &str| {
            edits.iter().all(|edit| {
                edit.attributes.get(index).is_some_and(|list| list.iter().any(|a| a.name == name))
            })
        };
        shared.push(if gets_any { Some(Shared::write(document, pool, &own, users, &is_new)?) } else { None });
    }
    let mut indices = Vec::new();
    for (number, edit) in edits.iter().enumerate() {
        let mut pieces: BTreeMap<usize, Vec<Raw>> = BTreeMap::new();
        for (index, pool) in plan.pools.iter().enumerate() {
            let mut attributes = match &shared[index] {
                Some(shared) => shared.attributes.clone(),
                None => pool.attributes.clone(),
            };
            for attribute in edit.attributes.get(index).into_iter().flatten() {
                let accessor = document.push_attribute(attribute)?;
                attributes.set(&attribute.name, &accessor)?;
            }
            for (number, piece) in pool.pieces.iter().enumerate() {
                let place = origin.primitives[piece.part] as usize;
                let mut primitive = Object::parse(&primitives[place])?;
                if let Some(shared) = &shared[index] {
                    primitive.set("attributes", &attributes)?;
                    shared.dress(&mut primitive, number)?;
                    drop_compression(&mut primitive, plan.mesh, place)?;
                }
                if let Some(dressed) = edit.materials.get(index).and_then(|list| list[number].as_ref()) {
                    primitive.set("material", &dressed.material)?;
                    if let Some(extensions) = &dressed.extensions {
                        primitive.set("extensions", &serde_json::from_str::<Raw>(extensions)?)?;
                    }
                }
                pieces.entry(place).or_default().push(primitive.to_raw()?);
            }
        }
        let written: Vec<Raw> = (0..primitives.len())
            .flat_map(|place| pieces.remove(&place).unwrap_or_else(|| vec![primitives[place].clone()]))
            .collect();
        let mut copy = mesh.clone();
        copy.set("primitives", &written)?;
        if number == 0 && !keep {
            document.put(List::Meshes, plan.mesh, &copy)?;
            indices.push(plan.mesh);
        } else {
            indices.push(document.push(List::Meshes, &copy)?);
        }
    }
    Ok(indices)
}

/// Points the nodes of baked instances at their copies.
pub(crate) fn place_copies(
    document: &mut Document,
    plan: &MeshPlan,
    origins: &Origins,
    scene: &dapple_scene::Scene,
    indices: &[usize],
) -> Result<()> {
    for (copy, &mesh) in plan.copies.iter().zip(indices).filter(|(_, mesh)| **mesh != plan.mesh) {
        for &instance in &copy.instances {
            let node = origins.nodes[scene.instances[instance as usize].node as usize] as usize;
            let mut object = document.object(List::Nodes, node)?;
            object.set("mesh", &mesh)?;
            document.put(List::Nodes, node, &object)?;
        }
    }
    Ok(())
}

/// Meshes that are also used by nodes which are not baked: those of other scenes, or ones that receive nothing.
pub(crate) fn used_elsewhere(
    document: &Document,
    plans: &[MeshPlan],
    origins: &Origins,
    scene: &dapple_scene::Scene,
) -> Result<BTreeSet<usize>> {
    let baked: BTreeSet<u32> = plans
        .iter()
        .flat_map(|plan| &plan.copies)
        .flat_map(|copy| &copy.instances)
        .map(|&instance| origins.nodes[scene.instances[instance as usize].node as usize])
        .collect();
    let mut elsewhere = BTreeSet::new();
    for node in 0..document.len(List::Nodes) {
        if !baked.contains(&(node as u32)) {
            elsewhere.extend(document.object(List::Nodes, node)?.whole("mesh")?);
        }
    }
    Ok(elsewhere)
}

/// What the copies of a pool have in common.
struct Shared {
    attributes: Object,
    targets: Option<Vec<Object>>,
    /// For each piece the accessor of its indices; empty where vertices stay as they are.
    indices: Vec<usize>,
}

impl Shared {
    /// `own` are the primitives of the pool's parts.
    fn write(
        document: &mut Document,
        pool: &Pool,
        own: &[Object],
        users: Option<&[u32]>,
        is_new: &dyn Fn(&str) -> bool,
    ) -> Result<Shared> {
        let mut shared = Shared { attributes: pool.attributes.clone(), targets: None, indices: Vec::new() };
        let Some(sources) = &pool.sources else { return Ok(shared) };
        let targets: Vec<Object> =
            own[0].list("targets")?.iter().map(|target| Object::parse(target)).collect::<Result<_>>()?;
        // How often each primitive of the pool names an accessor.
        let mut named: BTreeMap<usize, u32> = BTreeMap::new();
        for attributes in std::iter::once(&pool.attributes).chain(&targets) {
            for key in attributes.keys() {
                *named.entry(attributes.whole(key)?.unwrap_or(usize::MAX)).or_default() += 1;
            }
        }
        let is_ours = |accessor: usize, times: u32| {
            users.and_then(|users| users.get(accessor)).is_some_and(|users| *users == times)
        };
        let mut written: BTreeMap<usize, usize> = BTreeMap::new();
        let mut pick =
            |document: &mut Document, of: &Object, skips: &dyn Fn(&str) -> bool| -> Result<Object> {
                let mut picked = of.clone();
                let keys: Vec<String> = of.keys().map(str::to_owned).collect();
                for key in keys.into_iter().filter(|key| !skips(key)) {
                    let old = of.whole(&key)?.with_context(|| format!("the attribute {key}"))?;
                    let new = match written.get(&old) {
                        Some(new) => *new,
                        None => {
                            let times = named.get(&old).copied().unwrap_or(0) * own.len() as u32;
                            let picked = document.pick(old, sources, is_ours(old, times));
                            picked.with_context(|| format!("the attribute {key}"))?
                        }
                    };
                    written.insert(old, new);
                    picked.set(&key, &new)?;
                }
                Ok(picked)
            };
        shared.attributes = pick(document, &pool.attributes, is_new)?;
        if own[0].has("targets") {
            shared.targets =
                Some(targets.iter().map(|target| pick(document, target, &|_| false)).collect::<Result<_>>()?);
        }
        let parts = pool.parts();
        for (number, piece) in pool.pieces.iter().enumerate() {
            let is_first = number == 0 || pool.pieces[number - 1].part != piece.part;
            let own = &own[parts.partition_point(|part| *part < piece.part)];
            let place = own.whole("indices")?.filter(|&old| is_first && is_ours(old, 1));
            shared.indices.push(write_indices(document, &piece.triangles, sources.len(), place)?);
        }
        Ok(shared)
    }

    fn dress(&self, primitive: &mut Object, piece: usize) -> Result<()> {
        let Some(indices) = self.indices.get(piece) else { return Ok(()) };
        primitive.set("indices", indices)?;
        // Strips and fans were unrolled.
        primitive.remove("mode");
        if let Some(targets) = &self.targets {
            primitive.set("targets", targets)?;
        }
        Ok(())
    }
}

/// Writes indices to that accessor, or a new one; gives it.
fn write_indices(
    document: &mut Document,
    triangles: &[[u32; 3]],
    vertices: usize,
    place: Option<usize>,
) -> Result<usize> {
    let corners = triangles.as_flattened();
    // The largest 16-bit index is the restart of strips.
    let is_short = vertices <= 65535;
    let bytes: Vec<u8> = match is_short {
        true => corners.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect(),
        false => corners.iter().flat_map(|&i| i.to_le_bytes()).collect(),
    };
    let view = document.push_view(&bytes, Some(ELEMENT_ARRAY_BUFFER))?;
    let component = if is_short { 5123 } else { 5125 };
    let accessor = json!({
        "bufferView": view, "componentType": component, "count": corners.len(), "type": "SCALAR",
    });
    let accessor = document.push_value(List::Accessors, &accessor)?;
    let Some(place) = place else { return Ok(accessor) };
    document.swap_remove(List::Accessors, place);
    Ok(place)
}

fn drop_compression(primitive: &mut Object, mesh: usize, place: usize) -> Result<()> {
    let mut extensions = primitive.object("extensions")?;
    for key in COMPRESSED_PRIMITIVES.into_iter().filter(|key| extensions.has(key)).collect::<Vec<_>>() {
        tracing::warn!(
            "meshes[{mesh}].primitives[{place}]: {key} is left out, as it cannot hold what was baked; compress the file again"
        );
        extensions.remove(key);
        match extensions.is_empty() {
            true => primitive.remove("extensions"),
            false => primitive.set("extensions", &extensions)?,
        }
    }
    Ok(())
}
