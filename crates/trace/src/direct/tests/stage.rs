//! Scenes of lights, and pictures of them.

use std::f32::consts::FRAC_PI_2;

use dapple_scene::glam::{Affine3A, Mat3, Vec2, Vec3};
use dapple_scene::{
    EmitterShape, Instance, Material, Mesh, Part, Pose, PosedInstance, Reflectance, Scene, ShadingPoint,
};

use crate::bvh::{Ray, Tracer};
use crate::test_support::{quad, sphere};

/// Instances with a material each.
#[derive(Default)]
pub(super) struct Stage {
    pub(super) scene: Scene,
    pub(super) pose: Pose,
}

impl Stage {
    /// Adds a body; black is not a light.
    pub(super) fn add(
        &mut self,
        mesh: Mesh,
        emitter: EmitterShape,
        radiance: Vec3,
        world: Affine3A,
    ) -> &mut Self {
        let scene = &mut self.scene;
        let material = scene.materials.len() as u32;
        scene.materials.push(Material { emissive_factor: radiance, ..Material::default() });
        let parts = vec![Part { first_triangle: 0, triangle_count: mesh.triangles.len() as u32, material }];
        scene.meshes.push(Mesh { parts, ..mesh });
        scene.instances.push(Instance {
            node: 0,
            mesh: scene.meshes.len() as u32 - 1,
            skin: None,
            casts: true,
            emitter,
            receives: true,
            rest_from_mesh: Mat3::IDENTITY,
            spare: false,
        });
        self.pose.instances.push(PosedInstance { world_from_mesh: world, deformed: None });
        self
    }

    /// Adds something dark.
    pub(super) fn wall(&mut self, mesh: Mesh) -> &mut Self {
        self.add(mesh, EmitterShape::Triangles, Vec3::ZERO, Affine3A::IDENTITY)
    }

    pub(super) fn ball(&mut self, center: Vec3, radius: f32, radiance: f32) -> &mut Self {
        let mesh = sphere(Vec3::ZERO, 1.0, 8, 16);
        let world = Affine3A::from_translation(center) * Affine3A::from_scale(Vec3::splat(radius));
        self.add(mesh, EmitterShape::Sphere, Vec3::splat(radiance), world)
    }

    /// A flat light at a height that shines down.
    pub(super) fn flat(
        &mut self,
        emitter: EmitterShape,
        center: Vec3,
        half: Vec2,
        radiance: f32,
    ) -> &mut Self {
        let mesh = if emitter == EmitterShape::Disc {
            // A disc's mesh reaches as far as its farthest vertex.
            crate::test_support::disc(Vec3::ZERO, 1.0, 24)
        } else {
            quad(
                Vec3::new(-1.0, 0.0, 1.0),
                Vec3::new(1.0, 0.0, 1.0),
                Vec3::new(1.0, 0.0, -1.0),
                Vec3::new(-1.0, 0.0, -1.0),
            )
        };
        let world = Affine3A::from_translation(center)
            * Affine3A::from_rotation_x(2.0 * FRAC_PI_2)
            * Affine3A::from_scale(Vec3::new(half.x, 1.0, half.y));
        self.add(mesh, emitter, Vec3::splat(radiance), world)
    }

    pub(super) fn tracer(&self) -> Tracer {
        Tracer::new(&self.scene, &self.pose)
    }
}

/// Lambert's, of albedo 1.
pub(super) fn white() -> Reflectance {
    Reflectance { diffuse: Vec3::ONE, f0: Vec3::ZERO, alpha: 1.0, specular: false }
}

/// A white point at the origin that looks along a unit normal.
pub(super) fn point(normal: Vec3) -> ShadingPoint {
    ShadingPoint {
        instance: 0,
        position_world: Vec3::ZERO,
        normal_world: normal,
        normal_shading_world: normal,
        to_viewer_world: normal,
        reflectance: white(),
        emitted: Vec3::ZERO,
    }
}

/// What an eye sees through a picture of that size, 90° wide, of bodies that are all one material.
pub(super) fn picture(
    stage: &Stage,
    tracer: &Tracer,
    [eye, target]: [Vec3; 2],
    [width, height]: [usize; 2],
    reflectance: Reflectance,
) -> Vec<Option<ShadingPoint>> {
    let forward = (target - eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let of_pixel = |i: usize| {
        let x = (2.0 * (i % width) as f32 + 1.0) / width as f32 - 1.0;
        let y = (2.0 * (i / width) as f32 + 1.0 - height as f32) / width as f32;
        let direction = (forward + right * x - up * y).normalize();
        let hit = tracer.closest_hit(&Ray {
            origin_world: eye,
            direction_world: direction,
            t_max: f32::INFINITY,
        })?;
        let index = hit.instance as usize;
        let mesh = &stage.scene.meshes[stage.scene.instances[index].mesh as usize];
        let map = stage.pose.instances[index].world_from_mesh;
        let [a, b, c] =
            mesh.triangles[hit.triangle as usize].map(|v| map.transform_point3(mesh.positions[v as usize]));
        let front = (b - a).cross(c - a).normalize();
        let normal = if front.dot(direction) > 0.0 { -front } else { front };
        let material = mesh.parts[0].material as usize;
        Some(ShadingPoint {
            instance: hit.instance,
            position_world: a * hit.barycentrics.x + b * hit.barycentrics.y + c * hit.barycentrics.z,
            normal_world: normal,
            normal_shading_world: normal,
            to_viewer_world: -direction,
            reflectance,
            emitted: stage.scene.materials[material].emissive_factor,
        })
    };
    (0..width * height).map(of_pixel).collect()
}
