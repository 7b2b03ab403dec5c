//! Where points are now: a viewer knows them at rest only, and their instance's pose carries them along.

use dapple_scene::glam::{Affine3A, Vec3};
use dapple_scene::{Pose, Scene};
use dapple_store::points::{CellGrid, PointLayout, PointSet};

/// A place on a mesh.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    triangle: u32,
    barycentrics: [f32; 2],
}

/// For the points of deforming instances the triangles that carry them, found by their rest positions.
#[derive(Clone, Debug, Default)]
pub(super) struct Anchors {
    /// Parallel to the layout's sets; empty for those that do not deform.
    sets: Vec<Vec<Anchor>>,
}

impl Anchors {
    pub(super) fn new(layout: &PointLayout, scene: &Scene) -> Anchors {
        let sets = layout.sets().iter().map(|set| {
            let mesh = scene.instances.get(set.instance as usize).map(|i| &scene.meshes[i.mesh as usize]);
            if mesh.is_some_and(|mesh| mesh.is_deformable()) {
                anchor(layout, set, scene)
            } else {
                Vec::new()
            }
        });
        Anchors { sets: sets.collect() }
    }

    /// World positions of all points, in the store's order; not numbers for those of instances that are not there.
    pub(super) fn positions_world(&self, layout: &PointLayout, scene: &Scene, pose: &Pose) -> Vec<Vec3> {
        let mut positions = Vec::with_capacity(layout.len());
        for (set, anchors) in layout.sets().iter().zip(&self.sets) {
            let index = set.instance as usize;
            let (Some(instance), Some(posed)) = (scene.instances.get(index), pose.instances.get(index))
            else {
                positions.extend((0..set.len()).map(|_| Vec3::NAN));
                continue;
            };
            if !posed.is_there() {
                positions.extend((0..set.len()).map(|_| Vec3::NAN));
                continue;
            }
            let mesh = &scene.meshes[instance.mesh as usize];
            match &posed.deformed {
                Some(deformed) if !anchors.is_empty() => positions.extend(anchors.iter().map(|anchor| {
                    let [a, b, c] =
                        mesh.triangles[anchor.triangle as usize].map(|v| deformed.positions[v as usize]);
                    let [u, v] = anchor.barycentrics;
                    posed.world_from_mesh.transform_point3(a + (b - a) * u + (c - a) * v)
                })),
                _ => {
                    let world_from_rest =
                        posed.world_from_mesh * Affine3A::from_mat3(instance.rest_from_mesh.inverse());
                    let rest = (0..set.len()).map(|i| set.position_rest(i, layout.quantum_m()));
                    positions.extend(rest.map(|p| world_from_rest.transform_point3(p)));
                }
            }
        }
        positions
    }
}

/// The nearest place on the mesh, among the triangles about the vertices near each point.
fn anchor(layout: &PointLayout, set: &PointSet, scene: &Scene) -> Vec<Anchor> {
    let instance = &scene.instances[set.instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let rest: Vec<Vec3> = mesh.positions.iter().map(|&p| instance.rest_from_mesh * p).collect();
    let corners = |t: usize| mesh.triangles[t].map(|v| rest[v as usize]);
    let centers: Vec<Vec3> = (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = corners(t);
            (a + b + c) / 3.0
        })
        .collect();
    // A triangle's centre is never further from its points than its longest side: cells of that size find all.
    let longest = (0..mesh.triangles.len()).fold(0.0f32, |longest, t| {
        let [a, b, c] = corners(t);
        longest.max(a.distance(b)).max(b.distance(c)).max(c.distance(a))
    });
    let grid = CellGrid::new(&centers, longest.max(layout.spacing_m()).max(f32::MIN_POSITIVE));
    let mut near = Vec::new();
    (0..set.len())
        .map(|i| {
            let point = set.position_rest(i, layout.quantum_m());
            near.clear();
            grid.gather(grid.cell_of(point), 1, &mut near);
            let places = near.iter().map(|&t| {
                let (barycentrics, distance) = nearest_on_triangle(point, corners(t as usize));
                (distance, Anchor { triangle: t, barycentrics })
            });
            let best = places.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.triangle.cmp(&b.1.triangle)));
            best.map_or(Anchor { triangle: 0, barycentrics: [0.0; 2] }, |(_, anchor)| anchor)
        })
        .collect()
}

/// Barycentrics (weights of corners 1 and 2) of the plane's nearest place, brought into the triangle, and its squared
/// distance.
fn nearest_on_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> ([f32; 2], f32) {
    let (e1, e2, d) = (b - a, c - a, p - a);
    let (d11, d12, d22) = (e1.dot(e1), e1.dot(e2), e2.dot(e2));
    let (d1, d2) = (e1.dot(d), e2.dot(d));
    let determinant = d11 * d22 - d12 * d12;
    let [mut u, mut v] = if determinant > 0.0 {
        [(d22 * d1 - d12 * d2) / determinant, (d11 * d2 - d12 * d1) / determinant]
    } else {
        [0.0; 2]
    };
    (u, v) = (u.clamp(0.0, 1.0), v.clamp(0.0, 1.0));
    let sum = u + v;
    if sum > 1.0 {
        (u, v) = (u / sum, v / sum);
    }
    ([u, v], (a + e1 * u + e2 * v).distance_squared(p))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_on_a_triangle_are_found() {
        let triangle = [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0];
        let (barycentrics, distance) = nearest_on_triangle(Vec3::new(0.5, 1.0, 0.25), triangle);
        assert_eq!(barycentrics, [0.25, 0.5]);
        assert!((distance - 0.0625).abs() < 1e-6);
        let (barycentrics, _) = nearest_on_triangle(Vec3::splat(9.0), triangle);
        assert!(barycentrics[0] + barycentrics[1] <= 1.0 + 1e-6);
        let (_, distance) = nearest_on_triangle(Vec3::X, [Vec3::ZERO; 3]);
        assert_eq!(distance, 1.0);
    }
}
