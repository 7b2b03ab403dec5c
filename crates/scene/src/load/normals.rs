//! Normals for geometry that has none or bad ones: flat, by creases, and mended.

use std::collections::HashMap;

use glam::{DVec3, Vec3, Vec4};

use crate::Mesh;

/// Cosine of the crease angle, 40°: faces that meet at less are smoothed.
const CREASE_COS: f64 = 0.766_044_443_118_978;
/// Around a vertex of more triangles than this nothing is smoothed: comparing all pairs would take too long.
const MAX_VALENCE: usize = 512;

/// Twice the area vector of a triangle, computed in double precision so that it neither over- nor underflows.
pub(super) fn area_vector(a: Vec3, b: Vec3, c: Vec3) -> DVec3 {
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    (b - a).cross(c - a)
}

/// Unit normal of a triangle, or zero if it has no area.
fn face_normal(corners: [Vec3; 3]) -> DVec3 {
    area_vector(corners[0], corners[1], corners[2]).normalize_or_zero()
}

/// A unit vector for a sum of normals; up if there is none.
fn unit_or_up(sum: DVec3) -> Vec3 {
    sum.try_normalize().map_or(Vec3::Y, |n| n.as_vec3())
}

/// Some tangent perpendicular to a unit normal.
pub(super) fn any_tangent(normal: Vec3) -> Vec4 {
    normal.any_orthonormal_vector().extend(1.0)
}

/// Face normals for a mesh whose triangles share no vertices; displaced normals for its morph targets.
pub(super) fn set_flat(mesh: &mut Mesh) {
    let normal_of =
        |t: &[u32; 3], at: &dyn Fn(usize) -> Vec3| unit_or_up(face_normal(t.map(|v| at(v as usize))));
    mesh.normals = mesh.triangles.iter().flat_map(|t| [normal_of(t, &|v| mesh.positions[v]); 3]).collect();
    for target in &mut mesh.morph_targets {
        if !target.positions.is_empty() {
            let moved = |v: usize| mesh.positions[v] + target.positions[v];
            let normals = mesh.triangles.iter().flat_map(|t| [normal_of(t, &moved); 3]);
            target.normals = normals.zip(&mesh.normals).map(|(moved, base)| moved - base).collect();
        }
    }
}

/// Makes all normals unit vectors; zero and infinite ones become the mean of the faces around. Returns their number.
pub(super) fn mend(mesh: &mut Mesh) -> usize {
    let mut bad = Vec::new();
    for (i, normal) in mesh.normals.iter_mut().enumerate() {
        match normal.try_normalize().filter(|n| n.is_finite()) {
            Some(unit) => *normal = unit,
            None => bad.push(i as u32),
        }
    }
    if bad.is_empty() {
        return 0;
    }
    let mut sums: HashMap<u32, DVec3> = bad.iter().map(|&v| (v, DVec3::ZERO)).collect();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        for v in t {
            if let Some(sum) = sums.get_mut(v) {
                *sum += area_vector(a, b, c);
            }
        }
    }
    for v in &bad {
        mesh.normals[*v as usize] = unit_or_up(sums[v]);
    }
    bad.len()
}

/// One normal for each corner of each triangle: the mean, weighted by angle and area, of the faces around the position
/// that meet the corner's own face at less than the crease angle. Faces turned the other way count as if turned round,
/// as winding means nothing in many files.
pub(super) fn creased(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[Vec3; 3]> {
    // Files often repeat a position instead of sharing it.
    let mut first_at: HashMap<[u32; 3], u32> = HashMap::new();
    let welded: Vec<u32> = positions
        .iter()
        .enumerate()
        .map(|(i, p)| *first_at.entry((*p + 0.0).to_array().map(f32::to_bits)).or_insert(i as u32))
        .collect();
    let normals: Vec<DVec3> =
        triangles.iter().map(|t| face_normal(t.map(|v| positions[v as usize]))).collect();
    let (starts, around) = incidence(&welded, triangles);
    let weight = |corner: u32| {
        let t = triangles[corner as usize / 3];
        let k = corner as usize % 3;
        let p = |i: usize| positions[t[(k + i) % 3] as usize].as_dvec3();
        let (u, v) = (p(1) - p(0), p(2) - p(0));
        let area = u.cross(v).length();
        if area > 0.0 { area * u.angle_between(v) } else { 0.0 }
    };
    let weights: Vec<f64> = (0..3 * triangles.len() as u32).map(weight).collect();
    let corner_normal = |corner: usize| {
        let own = normals[corner / 3];
        let vertex = welded[triangles[corner / 3][corner % 3] as usize] as usize;
        let corners = &around[starts[vertex] as usize..starts[vertex + 1] as usize];
        if corners.len() > MAX_VALENCE {
            return unit_or_up(own);
        }
        let mut sum = DVec3::ZERO;
        for &other in corners {
            let normal = normals[other as usize / 3];
            let cos = own.dot(normal);
            if cos.abs() >= CREASE_COS || own == DVec3::ZERO {
                sum += normal * if cos < 0.0 { -weights[other as usize] } else { weights[other as usize] };
            }
        }
        unit_or_up(if sum == DVec3::ZERO { own } else { sum })
    };
    (0..triangles.len())
        .map(|t| [corner_normal(3 * t), corner_normal(3 * t + 1), corner_normal(3 * t + 2)])
        .collect()
}

/// For each vertex the corners (3 × triangle + k) around it, as one list with starts.
fn incidence(welded: &[u32], triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0_u32; welded.len() + 1];
    for v in triangles.iter().flatten() {
        starts[welded[*v as usize] as usize + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut next = starts.clone();
    let mut around = vec![0_u32; 3 * triangles.len()];
    for (corner, v) in triangles.iter().flatten().enumerate() {
        let slot = &mut next[welded[*v as usize] as usize];
        around[*slot as usize] = corner as u32;
        *slot += 1;
    }
    (starts, around)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two squares that meet along the z axis at the given angle (0 = flat).
    fn roof(angle: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let side = glam::Vec2::from_angle(angle);
        let far = Vec3::new(side.x, -side.y, 0.0);
        let z = Vec3::Z;
        (
            vec![Vec3::NEG_X, Vec3::NEG_X + z, Vec3::ZERO, z, far, far + z],
            vec![[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]],
        )
    }

    #[test]
    fn creases_split_and_curves_smooth() {
        let (positions, triangles) = roof(30_f32.to_radians());
        let smooth = creased(&positions, &triangles);
        assert!(smooth[0][2].abs_diff_eq(smooth[2][0], 1e-6));
        assert!((smooth[0][2].angle_between(Vec3::Y) - 15_f32.to_radians()).abs() < 1e-3);
        assert!(smooth[0][0].abs_diff_eq(Vec3::Y, 1e-6), "the far edge keeps its face's normal");
        let (positions, triangles) = roof(50_f32.to_radians());
        let sharp = creased(&positions, &triangles);
        assert!(sharp[0][2].abs_diff_eq(Vec3::Y, 1e-6));
        assert!(sharp[2][0].angle_between(sharp[0][2]) > 0.8);
    }

    #[test]
    fn reversed_neighbours_still_smooth() {
        let (positions, mut triangles) = roof(0.0);
        triangles[1].swap(0, 1);
        for (t, corners) in creased(&positions, &triangles).iter().enumerate() {
            let expected = if t == 1 { Vec3::NEG_Y } else { Vec3::Y };
            assert!(corners.iter().all(|n| n.abs_diff_eq(expected, 1e-6)), "triangle {t}: {corners:?}");
        }
    }

    #[test]
    fn equal_positions_count_as_one() {
        let (positions, triangles) = roof(30_f32.to_radians());
        let split: Vec<Vec3> = triangles.iter().flatten().map(|&v| positions[v as usize]).collect();
        let split_triangles: Vec<[u32; 3]> = (0..4).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        assert_eq!(creased(&positions, &triangles), creased(&split, &split_triangles));
    }

    #[test]
    fn bad_normals_are_mended() {
        let (positions, triangles) = roof(0.0);
        let normals = vec![Vec3::ZERO, Vec3::Y * 2.0, Vec3::NAN, Vec3::INFINITY, Vec3::Y, Vec3::X];
        let mut mesh = Mesh { positions, normals, triangles, ..Mesh::default() };
        assert_eq!(mend(&mut mesh), 3);
        assert_eq!(mesh.normals[..5], [Vec3::Y; 5]);
        assert_eq!(mesh.normals[5], Vec3::X);
    }

    #[test]
    fn triangles_without_area_get_a_unit_normal() {
        let mut mesh = Mesh { positions: vec![Vec3::ONE; 3], triangles: vec![[0, 1, 2]], ..Mesh::default() };
        set_flat(&mut mesh);
        assert!(mesh.normals.iter().all(|n| n.is_normalized()));
        assert!(creased(&mesh.positions, &mesh.triangles)[0].iter().all(|n| n.is_normalized()));
    }
}
