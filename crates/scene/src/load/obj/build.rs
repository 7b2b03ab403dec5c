//! Makes meshes of the faces of an OBJ file.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};

use super::parse::{Face, File, NONE};
use crate::load::context::Context;
use crate::load::finish::{Draft, Placement};
use crate::load::{LoadError, normals};
use crate::{Mesh, Node, Part};

/// One mesh, node and instance for each object that has faces.
pub(super) fn build(context: &Context<'_>, file: File, draft: &mut Draft) -> Result<(), LoadError> {
    let mut by_object: Vec<Vec<&Face>> = vec![Vec::new(); file.object_names.len()];
    for face in &file.faces {
        by_object[face.object as usize].push(face);
    }
    for (object, mut faces) in by_object.into_iter().enumerate() {
        let name = match file.object_names[object].as_str() {
            "" => format!("mesh {object}"),
            name => name.to_owned(),
        };
        // A stable sort: within a material the order of the file stays.
        faces.sort_by_key(|face| face.material);
        let mesh = build_mesh(context, &file, &faces, name.clone())?;
        draft.scene.meshes.push(mesh);
        draft.labels.push(format!("object \"{name}\""));
        draft.scene.nodes.push(Node { name, ..Node::default() });
        draft.children.push(Vec::new());
        let index = object as u32;
        draft.placements.push(Placement {
            node: index,
            mesh: index,
            skin: None,
            casts: true,
            receives: true,
        });
    }
    Ok(())
}

fn build_mesh(context: &Context<'_>, file: &File, faces: &[&Face], name: String) -> Result<Mesh, LoadError> {
    let at = format!("object \"{name}\"");
    let mut corners = Vec::new();
    let mut parts: Vec<Part> = Vec::new();
    for face in faces {
        context.charge(&at, u64::from(face.count), 160)?;
        let polygon = &file.corners[face.first as usize..(face.first + face.count) as usize];
        for pair in polygon[1..].windows(2) {
            let triangle = corners.len() as u32;
            corners.push([polygon[0], pair[0], pair[1]]);
            match parts.last_mut() {
                Some(part) if part.material == face.material => part.triangle_count += 1,
                _ => {
                    parts.push(Part { first_triangle: triangle, triangle_count: 1, material: face.material })
                }
            }
        }
    }
    let made = computed_normals(file, &corners);
    let has_uvs = corners.iter().flatten().any(|corner| corner[1] != NONE);
    let has_colors = !file.colors.is_empty();
    let mut mesh = Mesh { name, parts, ..Mesh::default() };
    // Corners with the same position, texture coordinate and normal share a vertex.
    let mut known: HashMap<([u32; 3], [u32; 3]), u32> = HashMap::new();
    for (t, triangle) in corners.iter().enumerate() {
        let mut vertices = [0; 3];
        for (k, corner) in triangle.iter().enumerate() {
            let normal = match corner[2] {
                NONE => made[t][k],
                n => file.normals[n as usize],
            };
            let key = (*corner, normal.to_array().map(f32::to_bits));
            vertices[k] = *known.entry(key).or_insert_with(|| {
                mesh.positions.push(file.positions[corner[0] as usize]);
                mesh.normals.push(normal);
                if has_uvs {
                    mesh.uvs[0].push(file.uvs.get(corner[1] as usize).copied().unwrap_or(Vec2::ZERO));
                }
                if has_colors {
                    mesh.colors.push(file.colors.get(corner[0] as usize).copied().unwrap_or(Vec4::ONE));
                }
                mesh.positions.len() as u32 - 1
            });
        }
        mesh.triangles.push(vertices);
    }
    let mended = normals::mend(&mut mesh);
    if mended > 0 {
        context.warn(format!("{at}: {mended} normals were zero; taken from the faces instead"));
    }
    Ok(mesh)
}

/// Normals for all corners if some have none, else nothing.
fn computed_normals(file: &File, corners: &[[[u32; 3]; 3]]) -> Vec<[Vec3; 3]> {
    if corners.iter().flatten().all(|corner| corner[2] != NONE) {
        return Vec::new();
    }
    // Numbered anew, so that an object costs what it has, not what the file has.
    let mut local: HashMap<u32, u32> = HashMap::new();
    let mut positions = Vec::new();
    let mut number = |corner: &[u32; 3]| {
        *local.entry(corner[0]).or_insert_with(|| {
            positions.push(file.positions[corner[0] as usize]);
            positions.len() as u32 - 1
        })
    };
    let triangles: Vec<[u32; 3]> =
        corners.iter().map(|[a, b, c]| [number(a), number(b), number(c)]).collect();
    normals::creased(&positions, &triangles)
}
