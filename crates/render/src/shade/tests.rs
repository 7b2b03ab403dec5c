//! Lights, shadows and reflectance against closed forms and rays.

use std::f32::consts::PI;

use dapple_scene::{Filter, Light, LightKind, Material, PosedCamera, PosedLight};
use glam::{Affine3A, Vec3};

use super::*;
use crate::gbuffer::rasterize;
use crate::image::{LinearImage, ToneMap};
use crate::testing::{
    Stage, check_golden, checkerboard, color_ramp, cube, ground, matte, sphere, turned, with_threads,
};

const SUN: LightKind = LightKind::Directional;
const SPOT: LightKind = LightKind::Spot { inner_cone_angle: 0.5, outer_cone_angle: 0.8 };
const WIDE_SPOT: LightKind = LightKind::Spot { inner_cone_angle: 1.3, outer_cone_angle: 1.5 };

fn lambert_only() -> ShadeParams {
    ShadeParams { ambient: Ambient::Constant(Vec3::ZERO), specular: false, ..ShadeParams::default() }
}

fn draw(stage: &Stage, camera: &PosedCamera, side: u32, n: u32, params: &ShadeParams) -> (GBuffer, Shaded) {
    let gbuffer = rasterize(&stage.scene, &stage.pose, camera, side, side, n).unwrap();
    let shadow_maps = render_shadow_maps(&stage.scene, &stage.pose, params);
    let shaded = shade(&stage.scene, &stage.pose, camera, &gbuffer, &shadow_maps, params);
    (gbuffer, shaded)
}

fn picture(stage: &Stage, camera: &PosedCamera, side: u32, params: &ShadeParams) -> LinearImage {
    let (gbuffer, shaded) = draw(stage, camera, side, 2, params);
    crate::compose::compose(&shaded, &gbuffer, None).unwrap()
}

#[test]
fn a_point_light_over_a_plane_follows_the_closed_form() {
    let (intensity, h) = (7.0f32, 1.5f32);
    let mut stage = Stage::new();
    stage.add(ground(6.0), 0, Affine3A::IDENTITY);
    stage.add_light(LightKind::Point, intensity, Vec3::new(0.3, h, -0.2), Vec3::NEG_Y);
    let camera = PosedCamera::look_at(Vec3::new(0.0, 9.0, 4.0), Vec3::ZERO, 0.9);
    let (gbuffer, shaded) = draw(&stage, &camera, 96, 1, &lambert_only());
    let mut seen = 0;
    for i in 0..gbuffer.samples().len() {
        let Some(s) = gbuffer.surface(&stage.scene, &stage.pose, i) else { continue };
        let aside = Vec3::new(s.position_world.x - 0.3, 0.0, s.position_world.z + 0.2).length();
        let irradiance = intensity * h / (h * h + aside * aside).powf(1.5);
        // White Lambert: radiance is irradiance / π.
        let found = shaded.direct[i].x * PI;
        assert!((found / irradiance - 1.0).abs() < 0.01, "{found} for {irradiance} at {aside} m");
        let direct =
            light_irradiance(&stage.scene.lights[0], &stage.pose.lights[0], s.position_world, Vec3::Y);
        assert!((direct.y / irradiance - 1.0).abs() < 1e-4);
        seen += 1;
    }
    assert!(seen > 5000);
}

#[test]
fn lights_fade_as_the_extension_says() {
    let posed = PosedLight {
        light: 0,
        position_world: Vec3::Y * 2.0,
        direction_world: Vec3::NEG_Y,
        color: Vec3::ONE,
        intensity: 8.0,
    };
    let light = |kind, range| Light { name: String::new(), color: Vec3::ONE, intensity: 8.0, range, kind };
    let at = |light: &Light, x: f32| light_irradiance(light, &posed, Vec3::new(x, 0.0, 0.0), Vec3::Y).x;
    assert_eq!(at(&light(LightKind::Point, None), 0.0), 2.0);
    // Half of the range: 1 − 1/16.
    assert!((at(&light(LightKind::Point, Some(4.0)), 0.0) - 2.0 * 15.0 / 16.0).abs() < 1e-6);
    assert_eq!(at(&light(LightKind::Point, Some(2.0)), 0.0), 0.0);
    assert_eq!(at(&light(LightKind::Point, Some(1.0)), 0.0), 0.0);
    assert_eq!(at(&light(SUN, None), 5.0), 8.0);
    // What counts is what the pose says, not the scene.
    let edited = PosedLight { color: Vec3::new(0.5, 0.0, 1.0), intensity: 2.0, ..posed.clone() };
    let irradiance = light_irradiance(&light(SUN, None), &edited, Vec3::ZERO, Vec3::Y);
    assert_eq!(irradiance, Vec3::new(1.0, 0.0, 2.0));
    let spot = light(LightKind::Spot { inner_cone_angle: 0.2, outer_cone_angle: 0.6 }, None);
    let point = light(LightKind::Point, None);
    assert_eq!(at(&spot, 2.0 * 0.19f32.tan()), at(&point, 2.0 * 0.19f32.tan()));
    assert_eq!(at(&spot, 2.0 * 0.61f32.tan()), 0.0);
    let x = 2.0 * 0.4f32.tan();
    let fade = (0.4f32.cos() - 0.6f32.cos()) / (0.2f32.cos() - 0.6f32.cos());
    assert!((at(&spot, x) - at(&point, x) * fade * fade).abs() < 1e-5);
}

/// Whether the segment from `a` to `b` hits the box −1 … 1 of `world_from_box`.
fn segment_hits_box(a: Vec3, b: Vec3, world_from_box: &Affine3A) -> bool {
    let inverse = world_from_box.inverse();
    let (a, b) = (inverse.transform_point3(a), inverse.transform_point3(b));
    let d = b - a;
    let (mut near, mut far) = (1e-4f32, 1.0f32);
    for axis in 0..3 {
        let (t0, t1) = ((-1.0 - a[axis]) / d[axis], (1.0 - a[axis]) / d[axis]);
        near = near.max(t0.min(t1));
        far = far.min(t0.max(t1));
    }
    near <= far
}

#[test]
fn shadows_of_a_box_fall_where_rays_say() {
    // One box stands on the ground, one hovers turned.
    let standing = Affine3A::from_scale_rotation_translation(
        Vec3::new(0.5, 0.8, 0.4),
        glam::Quat::from_rotation_y(0.4),
        Vec3::new(-0.8, 0.8, 0.3),
    );
    let hovering = turned(0.9, Vec3::new(1.0, 1.6, -0.5)) * Affine3A::from_scale(Vec3::splat(0.4));
    let position = Vec3::new(2.0, 5.0, 2.5);
    let resolution = 512;
    for (kind, face_resolution) in
        [(SUN, 512.0), (SPOT, 512.0), (WIDE_SPOT, 256.0), (LightKind::Point, 256.0)]
    {
        let mut stage = Stage::new();
        stage.add(ground(3.0), 0, Affine3A::IDENTITY);
        stage.add(cube(), 0, standing);
        stage.add(cube(), 0, hovering);
        stage.add_light(kind, 30.0, position, -position);
        let bounds = stage.bounds();
        let params = ShadeParams { shadow_resolution: resolution, ..lambert_only() };
        let camera = PosedCamera::look_at(Vec3::new(-1.0, 9.0, 6.0), Vec3::ZERO, 0.75);
        let (gbuffer, shaded) = draw(&stage, &camera, 200, 1, &params);
        let towards = |p: Vec3| if kind == SUN { p + position.normalize() * 50.0 } else { position };
        let blocked = |p: Vec3| {
            segment_hits_box(p, towards(p), &standing) || segment_hits_box(p, towards(p), &hovering)
        };
        let (mut shadowed, mut lit, mut border) = (0, 0, 0);
        for i in 0..gbuffer.samples().len() {
            let Some(s) = gbuffer.surface(&stage.scene, &stage.pose, i) else { continue };
            if s.instance != 0 {
                continue;
            }
            let p = s.position_world;
            let distance = (position - p).length();
            let texel = match kind {
                SUN => bounds.diagonal() / face_resolution,
                SPOT => 2.0 * 0.8f32.tan() * distance / face_resolution,
                _ => 2.0 * distance / face_resolution,
            };
            let unshadowed =
                light_irradiance(&stage.scene.lights[0], &stage.pose.lights[0], p, Vec3::Y).x / PI;
            if unshadowed <= 0.0 {
                continue;
            }
            let fraction = shaded.direct[i].x / unshadowed;
            let truth = blocked(p);
            // A texel's width on the slanted ground.
            let cosine = (towards(p) - p).normalize().y;
            let near_border = |texels: f32| {
                let r = texels * texel / cosine;
                (0..24).any(|k| {
                    let (sin, cos) = (k as f32 * PI / 12.0).sin_cos();
                    blocked(p + Vec3::new(cos, 0.0, sin) * r) != truth
                        || blocked(p + Vec3::new(cos, 0.0, sin) * (0.5 * r)) != truth
                })
            };
            if !near_border(1.0) {
                assert_eq!(fraction < 0.5, truth, "{kind:?}: lit {fraction} at {p}");
            }
            if near_border(2.6) {
                border += 1;
            } else if truth {
                assert_eq!(fraction, 0.0, "{kind:?}: light leaks at {p}");
                shadowed += 1;
            } else {
                assert!((fraction - 1.0).abs() < 1e-3, "{kind:?}: lit {fraction} at {p}");
                lit += 1;
            }
        }
        assert!(shadowed > 400 && lit > 5000 && border < 2000, "{kind:?}: {shadowed} {lit} {border}");
    }
}

#[test]
fn lit_surfaces_do_not_shadow_themselves() {
    for kind in [SUN, SPOT, LightKind::Point] {
        for resolution in [64, 512, 2048] {
            let mut stage = Stage::new();
            stage.add(sphere(90, 120), 0, turned(0.4, Vec3::ZERO));
            let position = Vec3::new(3.0, 4.0, 2.0);
            stage.add_light(kind, 30.0, position, -position);
            let params = ShadeParams { shadow_resolution: resolution, ..lambert_only() };
            let camera = PosedCamera::look_at(position * 0.8 + Vec3::X, Vec3::ZERO, 0.6);
            let (gbuffer, shaded) = draw(&stage, &camera, 120, 1, &params);
            let mut seen = 0;
            for i in 0..gbuffer.samples().len() {
                let Some(s) = gbuffer.surface(&stage.scene, &stage.pose, i) else { continue };
                let to_light = if kind == SUN { position } else { position - s.position_world }.normalize();
                if s.normal_world.dot(to_light) < 0.15 {
                    continue;
                }
                let full = light_irradiance(
                    &stage.scene.lights[0],
                    &stage.pose.lights[0],
                    s.position_world,
                    s.normal_shading_world,
                )
                .x / PI;
                let fraction = shaded.direct[i].x / full;
                assert!(fraction > 0.999, "{kind:?} at {resolution}: lit {fraction} at {}", s.position_world);
                seen += 1;
            }
            assert!(seen > 2000, "{seen}");
        }
    }
}

#[test]
fn instances_that_do_not_cast_throw_no_shadow() {
    let mut stage = Stage::new();
    stage.add(ground(2.0), 0, Affine3A::IDENTITY);
    let roof = stage.add(ground(1.0), 0, Affine3A::from_translation(Vec3::Y)) as usize;
    stage.add_light(SUN, PI, Vec3::ZERO, Vec3::NEG_Y);
    // From below the roof, onto the ground.
    let camera = PosedCamera::look_at(Vec3::new(0.0, 0.4, 0.9), Vec3::new(0.0, 0.0, 0.3), 0.5);
    for casts in [true, false] {
        stage.scene.instances[roof].casts = casts;
        let (_, shaded) = draw(&stage, &camera, 16, 1, &lambert_only());
        let want = if casts { 0.0 } else { 1.0 };
        assert!((shaded.direct[16 * 8 + 8].x - want).abs() < 1e-5, "casts {casts}");
    }
}

#[test]
fn reflectance_is_reciprocal_and_keeps_energy() {
    let scene = Scene::default();
    let direction = |polar: f32, azimuth: f32| {
        Vec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin())
    };
    for (metallic, roughness) in [(0.0, 0.3), (0.0, 1.0), (1.0, 0.4), (1.0, 1.0), (0.5, 0.6)] {
        let material =
            Material { metallic_factor: metallic, roughness_factor: roughness, ..Material::default() };
        let r = Reflectance::of(&scene, &material, &[glam::Vec2::ZERO; 2], Vec3::ONE, true);
        let (a, b) = (direction(0.4, 0.3), direction(1.1, 2.0));
        assert!((r.reflected(Vec3::Y, a, b) - r.reflected(Vec3::Y, b, a)).length() < 1e-6);
        for view in [0.1, 0.8, 1.3] {
            let viewer = direction(view, 0.0);
            let (steps, mut albedo) = (200, 0.0);
            for i in 0..steps {
                let polar = (i as f32 + 0.5) / steps as f32 * 0.5 * PI;
                for j in 0..steps {
                    let light = direction(polar, (j as f32 + 0.5) / steps as f32 * 2.0 * PI);
                    albedo += r.reflected(Vec3::Y, viewer, light).x * polar.cos() * polar.sin();
                }
            }
            albedo *= 0.5 * PI * 2.0 * PI / (steps * steps) as f32;
            // Single scattering loses energy on rough metal. glTF weighs diffuse light by the Fresnel term about the
            // half vector, which gives a white gloss seen edge-on more than arrives: its formula, not our mistake.
            let most = if view > 1.0 { 1.2 } else { 1.03 };
            assert!((0.3..most).contains(&albedo), "{metallic} {roughness} {view}: {albedo}");
            let furnace = reflected_ambient(&r, &Ambient::Constant(Vec3::ONE), Vec3::ONE, Vec3::Y, viewer);
            assert!(furnace.max_element() <= 1.0 + 1e-6 && furnace.min_element() > 0.5, "{furnace}");
        }
    }
    // Closed form: seen from straight above, metal of roughness 1 has D = 1/π, V = 1/(2 + 2μ), albedo 1 − ln 2.
    let r = Reflectance::of(&scene, &Material::default(), &[glam::Vec2::ZERO; 2], Vec3::ONE, true);
    let albedo: f32 = (0..1000)
        .map(|i| (i as f32 + 0.5) / 1000.0)
        .map(|mu| {
            r.reflected(Vec3::Y, Vec3::Y, Vec3::new((1.0 - mu * mu).sqrt(), mu, 0.0)).x * mu * 2.0 * PI
                / 1000.0
        })
        .sum();
    assert!((albedo - (1.0 - std::f32::consts::LN_2)).abs() < 2e-3, "{albedo}");
    // Closed form at normal incidence: (1 − F) / π + F / (4 π α²), F = 0.04.
    let material = Material { metallic_factor: 0.0, roughness_factor: 0.5, ..Material::default() };
    let r = Reflectance::of(&scene, &material, &[glam::Vec2::ZERO; 2], Vec3::ONE, true);
    let want = 0.96 / PI + 0.04 / (4.0 * PI * 0.0625);
    assert!((r.reflected(Vec3::Y, Vec3::Y, Vec3::Y).x - want).abs() < 1e-5);
}

#[test]
fn a_scene_without_lights_is_visible() {
    let mut stage = Stage::new();
    stage.add(sphere(30, 40), 0, Affine3A::IDENTITY);
    let camera = PosedCamera::look_at(Vec3::new(1.5, 2.0, 3.0), Vec3::ZERO, 0.6);
    let (gbuffer, shaded) = draw(&stage, &camera, 32, 1, &ShadeParams::default());
    let center = 32 * 16 + 16;
    assert!(shaded.direct[center].x > 0.2 && shaded.ambient[center].x > 0.2);
    assert_eq!((shaded.ambient[0], shaded.direct[0]), (Vec3::ZERO, ShadeParams::default().background));
    let dark = ShadeParams { sun_without_lights: false, ..ShadeParams::default() };
    let (_, shaded) = draw(&stage, &camera, 32, 1, &dark);
    assert_eq!(shaded.direct[center], Vec3::ZERO);
    // The pure Lambert ambient term is albedo times radiance about the normal.
    let params = ShadeParams { specular: false, ..dark };
    let (_, shaded) = draw(&stage, &camera, 32, 1, &params);
    let normal = gbuffer.surface(&stage.scene, &stage.pose, center).unwrap().normal_shading_world;
    assert_eq!(shaded.ambient[center], params.ambient.radiance(normal));
}

/// A small still life: every kind of material under a given kind of light.
fn still_life(kind: Option<LightKind>) -> (Stage, PosedCamera) {
    let mut stage = Stage::new();
    let board = checkerboard(8, [225, 220, 205, 255], [110, 105, 120, 255]);
    let board = stage.add_texture(8, Filter::Nearest, board);
    let holes = checkerboard(8, [240, 150, 60, 255], [240, 150, 60, 0]);
    let holes = stage.add_texture(8, Filter::Nearest, holes);
    let floor = stage.add_material(Material { base_color_texture: Some(board), ..matte(Vec3::splat(0.8)) });
    let red = stage.add_material(Material { roughness_factor: 0.35, ..matte(Vec3::new(0.7, 0.12, 0.1)) });
    let gold = stage.add_material(Material {
        base_color_factor: glam::Vec4::new(1.0, 0.78, 0.34, 1.0),
        roughness_factor: 0.4,
        ..Material::default()
    });
    let glow =
        stage.add_material(Material { emissive_factor: Vec3::new(0.1, 0.5, 1.2), ..matte(Vec3::ZERO) });
    let fence = stage.add_material(Material {
        base_color_texture: Some(holes),
        alpha_mode: dapple_scene::AlphaMode::Mask { cutoff: 0.5 },
        double_sided: true,
        ..matte(Vec3::ONE)
    });
    let ramp = stage.add_material(matte(Vec3::ONE));
    stage.add(ground(3.0), floor, Affine3A::IDENTITY);
    stage.add(sphere(48, 64), red, Affine3A::from_translation(Vec3::new(-1.2, 1.0, 0.0)));
    let half = Affine3A::from_scale(Vec3::splat(0.6));
    stage.add(sphere(48, 64), gold, Affine3A::from_translation(Vec3::new(0.3, 0.6, 1.2)) * half);
    let box_place = Affine3A::from_scale_rotation_translation(
        Vec3::new(0.5, 0.7, 0.5),
        glam::Quat::from_rotation_y(0.5),
        Vec3::new(1.0, 0.7, -0.6),
    );
    let mut painted = cube();
    color_ramp(&mut painted);
    stage.add(painted, ramp, box_place);
    let small = Affine3A::from_scale(Vec3::splat(0.2));
    stage.add(cube(), glow, Affine3A::from_translation(Vec3::new(-0.6, 0.2, 1.7)) * small);
    let wall = Affine3A::from_scale_rotation_translation(
        Vec3::splat(0.7),
        glam::Quat::from_rotation_x(1.4),
        Vec3::new(2.0, 0.9, 0.9),
    );
    stage.add(ground(1.0), fence, wall);
    if let Some(kind) = kind {
        let position = Vec3::new(2.5, 4.5, 3.0);
        stage.add_light(kind, if kind == SUN { 2.5 } else { 70.0 }, position, -position);
    }
    (stage, PosedCamera::look_at(Vec3::new(0.7, 3.6, 6.5), Vec3::new(0.1, 0.4, 0.0), 0.75))
}

#[test]
fn golden_still_lifes() {
    let params = ShadeParams { shadow_resolution: 512, ..ShadeParams::default() };
    for (name, kind) in
        [("sun", Some(SUN)), ("spot", Some(SPOT)), ("point", Some(LightKind::Point)), ("no-lights", None)]
    {
        let (stage, camera) = still_life(kind);
        let picture = picture(&stage, &camera, 72, &params).to_rgb8(&ToneMap::default());
        check_golden("shade", name, &picture);
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let (stage, camera) = still_life(Some(LightKind::Point));
    let params = ShadeParams { shadow_resolution: 256, ..ShadeParams::default() };
    let render = || draw(&stage, &camera, 64, 2, &params);
    let (one, two) = (with_threads(1, render), with_threads(2, render));
    assert!(one == two);
}
