//! Scenes made by hand for tests.

use std::sync::Arc;

use dapple_scene::glam::{Affine3A, Mat3, Vec3};
use dapple_scene::{DeformedMesh, Instance, Material, Mesh, Part, Pose, PosedInstance, Scene};

/// A mesh of one material (index 0) without attributes.
pub(crate) fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
    let parts = vec![Part { first_triangle: 0, triangle_count: triangles.len() as u32, material: 0 }];
    let normals = vec![Vec3::Y; positions.len()];
    Mesh { positions, normals, triangles, parts, ..Mesh::default() }
}

/// A scene of meshes and where they stand, each instance rigid.
pub(crate) fn scene(meshes: Vec<Mesh>, instances: &[(u32, Affine3A)]) -> (Scene, Pose) {
    let scene = Scene {
        meshes,
        materials: vec![Material::default()],
        instances: instances
            .iter()
            .map(|&(mesh, map)| Instance {
                node: 0,
                mesh,
                skin: None,
                casts: true,
                emitter: Default::default(),
                receives: true,
                rest_from_mesh: Mat3::from(map.matrix3),
                spare: false,
            })
            .collect(),
        ..Scene::default()
    };
    let posed = |&(_, map): &(u32, Affine3A)| PosedInstance { world_from_mesh: map, deformed: None };
    let pose = Pose { instances: instances.iter().map(posed).collect(), ..Pose::default() };
    (scene, pose)
}

/// One mesh at the origin.
pub(crate) fn scene_of(mesh: Mesh) -> (Scene, Pose) {
    scene(vec![mesh], &[(0, Affine3A::IDENTITY)])
}

/// Gives an instance vertices of its own.
pub(crate) fn deform(pose: &mut Pose, instance: usize, positions: Vec<Vec3>) {
    let normals = vec![Vec3::Y; positions.len()];
    pose.instances[instance].deformed = Some(Arc::new(DeformedMesh { positions, normals }));
}

/// Two triangles.
pub(crate) fn quad(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> Mesh {
    mesh(vec![a, b, c, d], vec![[0, 1, 2], [0, 2, 3]])
}

/// Parallel to the ground, counter-clockwise from above.
pub(crate) fn disc(center: Vec3, radius: f32, segments: u32) -> Mesh {
    let mut positions = vec![center];
    for i in 0..segments {
        let angle = f64::from(i) / f64::from(segments) * std::f64::consts::TAU;
        positions.push(center + radius * Vec3::new(libm::cos(angle) as f32, 0.0, -libm::sin(angle) as f32));
    }
    let triangles = (0..segments).map(|i| [0, 1 + i, 1 + (i + 1) % segments]).collect();
    mesh(positions, triangles)
}

/// The unit cube's faces, outward.
pub(crate) fn cube() -> Mesh {
    let positions = (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32)).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh(positions, triangles)
}

/// A closed sphere of `2 · rings · segments` triangles or a little less, outward.
pub(crate) fn sphere(center: Vec3, radius: f32, rings: u32, segments: u32) -> Mesh {
    let mut positions = vec![center + radius * Vec3::Y];
    for ring in 1..rings {
        let theta = f64::from(ring) / f64::from(rings) * std::f64::consts::PI;
        for segment in 0..segments {
            let phi = f64::from(segment) / f64::from(segments) * std::f64::consts::TAU;
            let (s, c) = (libm::sin(theta), libm::cos(theta));
            let p = Vec3::new((s * libm::cos(phi)) as f32, c as f32, (-s * libm::sin(phi)) as f32);
            positions.push(center + radius * p);
        }
    }
    let last = positions.len() as u32;
    positions.push(center - radius * Vec3::Y);
    let at = |ring: u32, segment: u32| match ring {
        0 => 0,
        r if r == rings => last,
        r => 1 + (r - 1) * segments + segment % segments,
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for segment in 0..segments {
            let (a, b) = (at(ring, segment), at(ring + 1, segment));
            let (c, d) = (at(ring + 1, segment + 1), at(ring, segment + 1));
            triangles.extend(
                [[a, b, c], [a, c, d]].iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]),
            );
        }
    }
    mesh(positions, triangles)
}

/// All meshes as one.
pub(crate) fn joined(meshes: impl IntoIterator<Item = Mesh>) -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for m in meshes {
        let base = positions.len() as u32;
        positions.extend(m.positions);
        triangles.extend(m.triangles.iter().map(|t| t.map(|i| i + base)));
    }
    mesh(positions, triangles)
}

/// Numbers in `[0, 1)`, the same every time.
pub(crate) struct Random(pub(crate) u32);

impl Random {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 += 1;
        crate::sampling::unit_interval(crate::sampling::hash(77, 3, self.0))
    }

    /// In `[-1, 1)³`.
    pub(crate) fn vector(&mut self) -> Vec3 {
        2.0 * Vec3::new(self.next(), self.next(), self.next()) - 1.0
    }

    pub(crate) fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vector();
            if v.length_squared() > 0.01 && v.length_squared() <= 1.0 {
                return v.normalize();
            }
        }
    }
}

/// Triangles of all sizes, some without area, some doubled.
pub(crate) fn soup(random: &mut Random, triangles: usize, size: f32) -> Mesh {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for i in 0..triangles {
        let base = positions.len() as u32;
        let center = random.vector();
        let s = size * (0.05 + random.next());
        positions.extend([0, 1, 2].map(|_| center + s * random.vector()));
        indices.push(match i % 17 {
            5 => [base, base, base + 1],
            11 => [0, 1, 2],
            _ => [base, base + 1, base + 2],
        });
    }
    mesh(positions, indices)
}
