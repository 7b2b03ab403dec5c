//! Joins pieces of geometry into one mesh and picks vertices out of one.

use crate::load::context::{Context, is_usable};
use crate::load::{LoadError, normals};
use crate::{Mesh, MorphTarget, Part, SkinInfluences};
use glam::{Vec2, Vec3, Vec4};

/// Appends `piece` to `mesh`; attributes that only one of them has get defaults in the other.
pub(super) fn append(
    context: &Context<'_>,
    at: &str,
    mesh: &mut Mesh,
    piece: Mesh,
    material: u32,
) -> Result<(), LoadError> {
    let (base, count) = (mesh.positions.len(), piece.positions.len());
    let first_triangle = mesh.triangles.len();
    let too_many = || context.invalid(at, "the mesh has more than 2^32 vertices or triangles; split it");
    let base_index = u32::try_from(base).map_err(|_| too_many())?;
    if u32::try_from(base + count).is_err() || u32::try_from(first_triangle + piece.triangles.len()).is_err()
    {
        return Err(too_many());
    }
    mesh.positions.extend(piece.positions);
    join(&mut mesh.tangents, piece.tangents, base, count, Vec4::ZERO);
    for (list, more) in mesh.uvs.iter_mut().zip(piece.uvs) {
        join(list, more, base, count, Vec2::ZERO);
    }
    join(&mut mesh.colors, piece.colors, base, count, Vec4::ONE);
    let sets = mesh.influences.len().max(piece.influences.len());
    mesh.influences.resize_with(sets, SkinInfluences::default);
    let mut more = piece.influences;
    more.resize_with(sets, SkinInfluences::default);
    for (set, (list, more)) in mesh.influences.iter_mut().zip(more).enumerate() {
        let first = if set == 0 { 1.0 } else { 0.0 };
        join(&mut list.joints, more.joints, base, count, [0; 4]);
        join(&mut list.weights, more.weights, base, count, [first, 0.0, 0.0, 0.0]);
    }
    let targets = mesh.morph_targets.len().max(piece.morph_targets.len());
    mesh.morph_targets.resize_with(targets, MorphTarget::default);
    let mut more = piece.morph_targets;
    more.resize_with(targets, MorphTarget::default);
    for (list, more) in mesh.morph_targets.iter_mut().zip(more) {
        join(&mut list.positions, more.positions, base, count, Vec3::ZERO);
        join(&mut list.normals, more.normals, base, count, Vec3::ZERO);
    }
    mesh.normals.extend(piece.normals);
    // Tangents that were made up must still be perpendicular to the normal.
    for (tangent, normal) in mesh.tangents.iter_mut().zip(&mesh.normals) {
        if *tangent == Vec4::ZERO {
            *tangent = normals::any_tangent(*normal);
        }
    }
    mesh.parts.push(Part {
        first_triangle: first_triangle as u32,
        triangle_count: piece.triangles.len() as u32,
        material,
    });
    mesh.triangles.extend(piece.triangles.iter().map(|t| t.map(|v| v + base_index)));
    Ok(())
}

fn join<T: Clone>(list: &mut Vec<T>, more: Vec<T>, base: usize, count: usize, default: T) {
    if !more.is_empty() {
        list.resize(base, default);
        list.extend(more);
    } else if !list.is_empty() {
        list.resize(base + count, default);
    }
}

/// Gives every triangle three vertices of its own. Normals and tangents are dropped.
pub(super) fn unshare(mesh: Mesh) -> Mesh {
    let corners: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    let triangles = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let pick_influences = |set: &SkinInfluences| SkinInfluences {
        joints: pick(&set.joints, &corners),
        weights: pick(&set.weights, &corners),
    };
    let pick_target = |target: &MorphTarget| MorphTarget {
        positions: pick(&target.positions, &corners),
        normals: Vec::new(),
    };
    Mesh {
        positions: pick(&mesh.positions, &corners),
        normals: Vec::new(),
        tangents: Vec::new(),
        uvs: [pick(&mesh.uvs[0], &corners), pick(&mesh.uvs[1], &corners)],
        colors: pick(&mesh.colors, &corners),
        influences: mesh.influences.iter().map(pick_influences).collect(),
        morph_targets: mesh.morph_targets.iter().map(pick_target).collect(),
        triangles,
        ..mesh
    }
}

fn pick<T: Copy>(list: &[T], indices: &[u32]) -> Vec<T> {
    if list.is_empty() { Vec::new() } else { indices.iter().map(|&i| list[i as usize]).collect() }
}

/// Makes the weights of each vertex sum to 1; returns how many vertices had none or negative ones.
pub(super) fn normalize_weights(influences: &mut [SkinInfluences]) -> usize {
    let vertices = influences.first().map_or(0, |set| set.weights.len());
    let mut mended = 0;
    for v in 0..vertices {
        let mut sum = 0.0;
        let mut flawed = false;
        for set in influences.iter_mut() {
            for weight in &mut set.weights[v] {
                if !(is_usable(*weight) && *weight >= 0.0) {
                    *weight = 0.0;
                    flawed = true;
                }
                sum += *weight;
            }
        }
        if sum > 0.0 {
            for set in influences.iter_mut() {
                set.weights[v] = set.weights[v].map(|weight| weight / sum);
            }
        } else {
            flawed = true;
            influences[0].weights[v] = [1.0, 0.0, 0.0, 0.0];
        }
        mended += usize::from(flawed);
    }
    mended
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;
    use crate::load::NoFiles;

    fn piece(uv: bool) -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            uvs: [if uv { vec![Vec2::ONE; 3] } else { Vec::new() }, Vec::new()],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        }
    }

    #[test]
    fn joined_lists_are_empty_or_full() {
        for order in [[false, true], [true, false]] {
            let context = Context::new("t", 0, &NoFiles);
            let mut mesh = Mesh::default();
            for (i, uv) in order.into_iter().enumerate() {
                append(&context, "t", &mut mesh, piece(uv), i as u32).unwrap();
            }
            assert_eq!(mesh.uvs[0].len(), 6);
            assert_eq!(mesh.uvs[0][if order[0] { 0 } else { 3 }], Vec2::ONE);
            assert_eq!(mesh.uvs[0][if order[0] { 3 } else { 0 }], Vec2::ZERO);
            assert!(mesh.uvs[1].is_empty());
            assert_eq!(mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
            assert_eq!(mesh.parts[1], Part { first_triangle: 1, triangle_count: 1, material: 1 });
        }
    }

    #[test]
    fn weights_sum_to_one() {
        let weights = vec![[2.0, 2.0, 0.0, 0.0], [0.0; 4], [-1.0, 1.0, 0.0, f32::NAN]];
        let mut sets = vec![SkinInfluences { joints: vec![[0; 4]; 3], weights }];
        assert_eq!(normalize_weights(&mut sets), 2);
        assert_eq!(sets[0].weights, [[0.5, 0.5, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]);
    }
}
