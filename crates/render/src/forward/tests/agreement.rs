//! The lit picture against `rasterize`, `shade` and `compose`, feature by feature.

use dapple_scene::{AlphaMode, Filter, LightKind, Material, NormalTexture, PosedCamera, Projection};
use glam::{Affine3A, Vec2, Vec3, Vec4};

use super::harness::{Bench, assert_agrees, twin};
use crate::shade::ShadeParams;
use crate::testing::{Stage, checkerboard, cube, ground, matte, quad, sphere, turned};

const SIZE: (u32, u32) = (240, 160);

fn params() -> ShadeParams {
    ShadeParams { shadow_resolution: 512, ..ShadeParams::default() }
}

fn no_shadows() -> ShadeParams {
    ShadeParams { max_shadowed_lights: 0, ..params() }
}

fn camera() -> PosedCamera {
    PosedCamera::look_at(Vec3::new(3.5, 3.0, 5.0), Vec3::new(0.0, 0.6, 0.0), 0.8)
}

/// A sphere and a turned cube on a floor.
fn still_life() -> Stage {
    let mut stage = Stage::new();
    stage.add(ground(6.0), 0, Affine3A::IDENTITY);
    let red = stage.add_material(matte(Vec3::new(0.7, 0.15, 0.1)));
    stage.add(sphere(24, 48), red, Affine3A::from_translation(Vec3::new(-0.9, 1.0, 0.2)));
    let metal = stage.add_material(Material {
        base_color_factor: Vec4::new(0.9, 0.7, 0.3, 1.0),
        roughness_factor: 0.35,
        ..Material::default()
    });
    stage.add(cube(), metal, turned(0.7, Vec3::new(1.6, 1.3, -0.4)));
    stage
}

fn check(name: &str, stage: &Stage, camera: &PosedCamera, params: &ShadeParams) {
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let card = bench.beauty(SIZE, &stage.pose, camera, params);
    let (expected, gbuffer) = twin(&stage.scene, &stage.pose, camera, SIZE, params);
    assert_agrees(name, &card, &expected, &gbuffer);
}

#[test]
fn lights_without_shadows() {
    let spot = LightKind::Spot { inner_cone_angle: 0.3, outer_cone_angle: 0.6 };
    let down = Vec3::new(-0.4, -1.0, -0.3);
    for (name, kind, intensity) in [
        ("directional", LightKind::Directional, 3.0),
        ("point", LightKind::Point, 40.0),
        ("spot", spot, 60.0),
    ] {
        let mut stage = still_life();
        stage.add_light(kind, intensity, -4.0 * down, down);
        stage.scene.lights[0].range = (kind == LightKind::Point).then_some(9.0);
        check(name, &stage, &camera(), &no_shadows());
    }
    check("sun", &still_life(), &camera(), &no_shadows());
    let lambert = ShadeParams { specular: false, ..no_shadows() };
    check("lambert", &still_life(), &camera(), &lambert);
}

#[test]
fn shadows_of_every_kind_of_light() {
    let down = Vec3::new(-0.4, -1.0, -0.3);
    for (name, kind, intensity) in [
        ("shadow-directional", LightKind::Directional, 3.0),
        ("shadow-point", LightKind::Point, 40.0),
        ("shadow-spot", LightKind::Spot { inner_cone_angle: 0.3, outer_cone_angle: 0.6 }, 60.0),
        ("shadow-wide-spot", LightKind::Spot { inner_cone_angle: 0.3, outer_cone_angle: 1.4 }, 60.0),
    ] {
        let mut stage = still_life();
        stage.add_light(kind, intensity, -4.0 * down, down);
        // A second light, whose maps follow the first one's.
        stage.add_light(LightKind::Point, 15.0, Vec3::new(3.0, 3.0, -1.0), Vec3::NEG_Y);
        check(name, &stage, &camera(), &params());
    }
}

#[test]
fn parallel_cameras() {
    let projection = Projection::Orthographic { half_height: 2.2, near: 0.1, far: 30.0 };
    check("parallel", &still_life(), &PosedCamera { projection, ..camera() }, &params());
}

#[test]
fn textures_masks_and_colors() {
    let mut stage = still_life();
    let dark = [20, 40, 90, 255];
    let map = stage.add_texture(8, Filter::Linear, checkerboard(8, dark, [230, 220, 180, 255]));
    stage.scene.materials[0].base_color_texture = Some(map);
    let holes =
        stage.add_texture(8, Filter::Nearest, checkerboard(8, [90, 200, 90, 255], [255, 255, 255, 40]));
    for (mode, x) in [(AlphaMode::Mask { cutoff: 0.3 }, -1.5), (AlphaMode::Blend, 1.0)] {
        let curtain = stage.add_material(Material {
            base_color_texture: Some(holes),
            alpha_mode: mode,
            double_sided: true,
            metallic_factor: 0.0,
            emissive_factor: Vec3::new(0.05, 0.0, 0.1),
            ..Material::default()
        });
        let mut mesh = quad([
            Vec3::new(x, 0.2, 1.5),
            Vec3::new(x + 1.4, 0.2, 1.8),
            Vec3::new(x + 1.4, 1.4, 1.8),
            Vec3::new(x, 1.4, 1.5),
        ]);
        crate::testing::color_ramp(&mut mesh);
        stage.add(mesh, curtain, Affine3A::IDENTITY);
    }
    let unlit =
        Material { unlit: true, base_color_factor: Vec4::new(0.2, 0.9, 0.9, 1.0), ..matte(Vec3::ONE) };
    let unlit = stage.add_material(unlit);
    stage.add(
        sphere(8, 16),
        unlit,
        Affine3A::from_scale_rotation_translation(
            Vec3::splat(0.3),
            glam::Quat::IDENTITY,
            Vec3::new(0.2, 0.4, 2.6),
        ),
    );
    check("textures", &stage, &camera(), &params());
}

/// A normal map of round bumps.
fn bumps(stage: &mut Stage) -> NormalTexture {
    let side = 64;
    let texels = (0..side * side).map(|i| {
        let at = |n: i32| (n % 16) as f32 / 7.5 - 1.0;
        let (x, y) = (at(i % side), at(i / side));
        let inside = x * x + y * y < 1.0;
        let n = if inside { Vec3::new(0.6 * x, -0.6 * y, 0.8) } else { Vec3::Z }.normalize();
        let code = |c: f32| (c * 127.5 + 127.5).round() as u8;
        [code(n.x), code(n.y), code(n.z), 255]
    });
    let texture = stage.add_texture(side as u32, Filter::Linear, texels.collect());
    NormalTexture { texture, scale: 0.8 }
}

#[test]
fn normal_maps_with_and_without_tangents_and_mirrors() {
    let mut stage = still_life();
    let map = bumps(&mut stage);
    let rough = stage.add_material(Material {
        normal_texture: Some(map),
        roughness_factor: 0.6,
        ..matte(Vec3::splat(0.6))
    });
    stage.scene.meshes[0].parts[0].material = rough;
    let wall = |flip: bool| {
        let mut mesh = quad([Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y].map(|p| p * 1.5));
        mesh.tangents = vec![Vec4::new(0.8, 0.6, 0.0, if flip { -1.0 } else { 1.0 }); 4];
        mesh
    };
    stage.add(wall(false), rough, Affine3A::from_translation(Vec3::new(-2.2, 0.3, 1.6)));
    stage.add(wall(true), rough, Affine3A::from_translation(Vec3::new(-0.5, 0.3, 1.9)));
    let mirror = Affine3A::from_scale_rotation_translation(
        Vec3::new(-1.0, 1.0, 1.0),
        glam::Quat::from_rotation_y(0.4),
        Vec3::new(2.7, 0.3, 2.0),
    );
    stage.add(wall(false), rough, mirror);
    let mut seen_from_behind = wall(false);
    seen_from_behind.uvs[1] = vec![Vec2::ZERO; 4];
    let both =
        stage.add_material(Material { double_sided: true, ..stage.scene.materials[rough as usize].clone() });
    let turned = Affine3A::from_scale_rotation_translation(
        Vec3::splat(0.7),
        glam::Quat::from_rotation_y(3.6),
        Vec3::new(0.6, 1.9, 1.9),
    );
    stage.add(seen_from_behind, both, turned);
    stage.add_light(LightKind::Point, 40.0, Vec3::new(-1.0, 4.0, 5.0), Vec3::NEG_Y);
    check("normal-maps", &stage, &camera(), &no_shadows());
}

#[test]
fn mirrored_instances_show_their_fronts() {
    let mut stage = still_life();
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    stage.pose.instances[2].world_from_mesh = mirror * stage.pose.instances[2].world_from_mesh;
    let squashed = Affine3A::from_scale_rotation_translation(
        Vec3::new(0.5, -1.0, 0.8),
        glam::Quat::IDENTITY,
        Vec3::new(1.5, 1.1, 0.5),
    );
    stage.pose.instances[1].world_from_mesh = squashed;
    check("mirrored", &stage, &camera(), &params());
}
