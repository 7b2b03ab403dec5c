//! Wavefront OBJ: polygons with materials, normals computed where the file has none.
//!
//! The `tobj` crate reads statements, unrolls polygons and shares vertices; the text is checked before, as it must not
//! meet flaws. One mesh for each object (`o`), or for each group (`g`) in files without objects, with a part for each
//! material. Lines, points, curves and surfaces are left out. Materials are double-sided, because winding is unreliable
//! in these files. Texture coordinates are turned to have v point down.

mod check;
mod material;

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::{Vec2, Vec3, Vec4};
use tobj::LoadOptions;

use super::context::Context;
use super::finish::{self, Draft, Placement};
use super::{LoadError, normals};
use crate::{Mesh, Node, Part, Scene};

/// Reads an OBJ file; `stem` names its geometry where the file does not.
pub(super) fn load(context: &Context<'_>, bytes: &[u8], stem: &str) -> Result<Scene, LoadError> {
    let checked = check::check(context, bytes, stem)?;
    if checked.objects.is_empty() {
        return Err(
            context.invalid("the file", "it has no faces; check that it is an OBJ file with polygons")
        );
    }
    let known = RefCell::new(HashSet::new());
    let read_library = |path: &Path| match path.to_str() {
        Some(statement) if !statement.is_empty() => {
            let library = material::library(context, statement)?;
            known.borrow_mut().extend(library.1.keys().cloned());
            Ok(library)
        }
        _ => material::plain(context, &checked.materials, &known.borrow()),
    };
    let options = LoadOptions { triangulate: true, single_index: true, ..LoadOptions::default() };
    let refused = |error: tobj::LoadError| {
        context.invalid("the file", format!("the OBJ reader refuses it ({error}); export the file again"))
    };
    let (models, library) =
        tobj::load_obj_buf(&mut checked.text.as_bytes(), &options, read_library).map_err(refused)?;
    let library = library.map_err(refused)?;

    let mut draft = Draft::default();
    let by_name: HashMap<&str, &tobj::Material> = library.iter().map(|m| (m.name.as_str(), m)).collect();
    let unknown = tobj::Material::default();
    let mut images = material::Images::new();
    let mut numbers = HashMap::new();
    for (i, name) in checked.materials.iter().enumerate() {
        numbers.insert(name.as_str(), i as u32);
        let source = by_name.get(name.as_str()).copied().unwrap_or(&unknown);
        let material = material::convert(context, source, &mut images, &mut draft.scene);
        draft.scene.materials.push(material);
    }
    let mut pieces: Vec<Vec<(u32, &tobj::Mesh)>> = vec![Vec::new(); checked.objects.len()];
    for model in &models {
        let material = model.mesh.material_id.and_then(|id| numbers.get(library.get(id)?.name.as_str()));
        let object = model.name.parse::<usize>().ok().and_then(|object| pieces.get_mut(object));
        if let Some(object) = object {
            object.push((material.copied().unwrap_or(0), &model.mesh));
        }
    }
    for (object, mut pieces) in pieces.into_iter().enumerate() {
        let name = match checked.objects[object].as_str() {
            "" => format!("mesh {object}"),
            name => name.to_owned(),
        };
        // A stable sort: within a material the order of the file stays.
        pieces.sort_by_key(|(material, _)| *material);
        draft.scene.meshes.push(join(context, &pieces, name.clone()));
        draft.labels.push(format!("object \"{name}\""));
        draft.scene.nodes.push(Node { name, ..Node::default() });
        draft.children.push(Vec::new());
        let (node, mesh) = (object as u32, object as u32);
        draft.placements.push(Placement {
            node,
            mesh,
            skin: None,
            casts: true,
            emitter: Default::default(),
            receives: true,
        });
    }
    finish::finish(context, draft).map(|(scene, _)| scene)
}

/// Vectors out of a flat list.
fn vectors<const N: usize>(flat: &[f32]) -> impl Iterator<Item = [f32; N]> {
    flat.as_chunks::<N>().0.iter().copied()
}

/// One mesh of the pieces of an object, with normals for all corners.
fn join(context: &Context<'_>, pieces: &[(u32, &tobj::Mesh)], name: String) -> Mesh {
    let (mut positions, mut given_normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    let (mut uvs, mut colors) = (Vec::new(), Vec::new());
    let mut parts: Vec<Part> = Vec::new();
    let has = |list: fn(&tobj::Mesh) -> &Vec<f32>| pieces.iter().any(|(_, piece)| !list(piece).is_empty());
    let has_uvs = has(|piece| &piece.texcoords);
    let has_colors = has(|piece| &piece.vertex_color);
    for (material, piece) in pieces {
        let (base, first_triangle) = (positions.len() as u32, triangles.len() as u32);
        positions.extend(vectors(&piece.positions).map(Vec3::from));
        given_normals.extend(vectors(&piece.normals).map(|normal| Some(Vec3::from(normal))));
        given_normals.resize(positions.len(), None);
        if has_uvs {
            uvs.extend(vectors(&piece.texcoords).map(|[u, v]| Vec2::new(u, 1.0 - v)));
            uvs.resize(positions.len(), Vec2::ZERO);
        }
        if has_colors {
            let color = |rgb: [f32; 3]| Vec3::from(rgb).max(Vec3::ZERO).extend(1.0);
            colors.extend(vectors(&piece.vertex_color).map(color));
            colors.resize(positions.len(), Vec4::ONE);
        }
        triangles.extend(piece.indices.as_chunks::<3>().0.iter().map(|t| t.map(|v| base + v)));
        let triangle_count = triangles.len() as u32 - first_triangle;
        match parts.last_mut() {
            Some(part) if part.material == *material => part.triangle_count += triangle_count,
            _ => parts.push(Part { first_triangle, triangle_count, material: *material }),
        }
    }
    let lacks_normals = given_normals.iter().any(Option::is_none);
    let made = if lacks_normals { normals::creased(&positions, &triangles) } else { Vec::new() };
    let mut mesh = Mesh { name, parts, ..Mesh::default() };
    // Corners with the same vertex and normal stay together.
    let mut known: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
    for (t, triangle) in triangles.iter().enumerate() {
        mesh.triangles.push(std::array::from_fn(|k| {
            let v = triangle[k] as usize;
            let normal = given_normals[v].unwrap_or_else(|| made[t][k]);
            *known.entry((triangle[k], normal.to_array().map(f32::to_bits))).or_insert_with(|| {
                mesh.positions.push(positions[v]);
                mesh.normals.push(normal);
                mesh.uvs[0].extend(uvs.get(v));
                mesh.colors.extend(colors.get(v));
                mesh.positions.len() as u32 - 1
            })
        }));
    }
    let mended = normals::mend(&mut mesh);
    if mended > 0 {
        let at = &mesh.name;
        context.warn(format!("object \"{at}\": {mended} normals were zero; taken from the faces instead"));
    }
    mesh
}
