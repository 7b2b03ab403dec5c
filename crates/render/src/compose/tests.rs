//! What visibility may touch, resolving, and the views.

use dapple_scene::{Material, PosedCamera, Projection};
use glam::{Affine3A, Vec3};

use super::*;
use crate::gbuffer::rasterize;
use crate::image::{Rgb8Image, ToneMap};
use crate::shade::{Ambient, ShadeParams, render_shadow_maps, shade};
use crate::testing::{Stage, check_golden, cube, ground, matte, sphere, turned};

const SIDE: u32 = 64;

fn camera() -> PosedCamera {
    PosedCamera::look_at(Vec3::new(0.5, 3.0, 5.0), Vec3::new(0.0, 0.4, 0.0), 0.8)
}

/// Ground (0), unlit sphere (1), emissive black box (2), white sphere (3).
fn stage() -> Stage {
    let mut stage = Stage::new();
    let unlit = stage.add_material(Material { unlit: true, ..matte(Vec3::new(0.2, 0.6, 0.3)) });
    let glow =
        stage.add_material(Material { emissive_factor: Vec3::new(0.9, 0.4, 0.1), ..matte(Vec3::ZERO) });
    stage.add(ground(2.5), 0, Affine3A::IDENTITY);
    stage.add(sphere(24, 32), unlit, Affine3A::from_translation(Vec3::new(-1.3, 1.0, 0.0)));
    let small = Affine3A::from_scale(Vec3::splat(0.5));
    stage.add(cube(), glow, turned(0.7, Vec3::new(0.5, 0.8, 1.0)) * small);
    stage.add(sphere(24, 32), 0, Affine3A::from_translation(Vec3::new(1.2, 1.0, -0.8)));
    stage
}

fn shaded(stage: &Stage, params: &ShadeParams, n: u32) -> (GBuffer, Shaded) {
    let gbuffer = rasterize(&stage.scene, &stage.pose, &camera(), SIDE, SIDE, n).unwrap();
    let shadow_maps = render_shadow_maps(&stage.scene, &stage.pose, params);
    let shaded = shade(&stage.scene, &stage.pose, &camera(), &gbuffer, &shadow_maps, params);
    (gbuffer, shaded)
}

#[test]
fn visibility_never_touches_light_that_is_not_ambient() {
    let stage = stage();
    let params = ShadeParams { shadow_resolution: 256, specular: false, ..ShadeParams::default() };
    let (gbuffer, full) = shaded(&stage, &params, 2);
    let closed = vec![0.0; gbuffer.samples().len()];
    let open = vec![1.0; gbuffer.samples().len()];
    let with = |shaded: &Shaded, v: &[f32]| compose(shaded, &gbuffer, Some(v)).unwrap();
    assert_eq!(with(&full, &open), compose(&full, &gbuffer, None).unwrap());
    // Unlit, emissive and background pixels are the same to the bit, others are not.
    let (dark, bright) = (with(&full, &closed), with(&full, &open));
    let instances = gbuffer.map_pixels(|samples| {
        let mut all: Vec<u32> = samples.map(|i| gbuffer.samples()[i].instance).collect();
        all.dedup();
        all
    });
    let mut seen = [0; 2];
    for (i, instances) in instances.iter().enumerate() {
        let touched = instances.iter().any(|&i| i == 0 || i == 3);
        let bits = |p: &Vec3| p.to_array().map(f32::to_bits);
        assert_eq!(bits(&dark.pixels[i]) == bits(&bright.pixels[i]), !touched, "pixel {i}: {instances:?}");
        seen[usize::from(touched)] += 1;
    }
    assert!(seen[0] > 500 && seen[1] > 500);
    // Without ambient light nothing changes at all: all of the lights' contribution is out of reach.
    let lights_only = ShadeParams { ambient: Ambient::Constant(Vec3::ZERO), ..params };
    let (_, lit) = shaded(&stage, &lights_only, 2);
    assert!(lit.direct.iter().any(|d| d.x > 0.3));
    let (dark, bright) = (with(&lit, &closed), with(&lit, &open));
    assert!(
        dark.pixels
            .iter()
            .zip(&bright.pixels)
            .all(|(a, b)| a.to_array().map(f32::to_bits) == b.to_array().map(f32::to_bits))
    );
}

#[test]
fn samples_resolve_by_their_mean() {
    let stage = stage();
    let (gbuffer, _) = shaded(&stage, &ShadeParams::default(), 2);
    let count = gbuffer.samples().len();
    let synthetic = Shaded {
        ambient: vec![Vec3::ZERO; count],
        direct: (0..count).map(|i| Vec3::splat((i % 7) as f32)).collect(),
    };
    let image = compose(&synthetic, &gbuffer, None).unwrap();
    let row = 2 * SIDE as usize;
    let first = 2 * 5 * row + 2 * 9;
    let want: f32 = [first, first + 1, first + row, first + row + 1].iter().map(|i| (i % 7) as f32).sum();
    assert_eq!(image.pixels[5 * SIDE as usize + 9].x, want / 4.0);

    let values: Vec<f32> =
        gbuffer.samples().iter().map(|s| if s.is_covered() { 0.25 } else { 9.0 }).collect();
    let resolved = resolve_plane(&gbuffer, &values, -1.0).unwrap();
    let mut partly = 0;
    for (&value, &coverage) in resolved.values.values.iter().zip(&resolved.coverage.values) {
        assert_eq!(value, if coverage == 0.0 { -1.0 } else { 0.25 });
        assert!((0.0..=1.0).contains(&coverage));
        partly += u32::from(coverage > 0.0 && coverage < 1.0);
    }
    assert!(partly > 20);
}

#[test]
fn lists_of_the_wrong_length_are_refused() {
    let stage = stage();
    let (gbuffer, shaded) = shaded(&stage, &ShadeParams::default(), 1);
    let error = compose(&shaded, &gbuffer, Some(&[1.0])).unwrap_err();
    assert!(error.to_string().contains("visibility has 1 values where 4096 are needed"), "{error}");
    assert!(resolve_plane(&gbuffer, &[], 0.0).is_err());
    let black = Rgb8Image { width: SIDE, height: SIDE, pixels: vec![[0; 3]; 4096] };
    let error = draw_points(&black, &gbuffer, &camera(), &[Vec3::ZERO], &[], &PointsView::default());
    assert!(error.is_err());
}

#[test]
fn error_colors_tell_sign_size_and_background() {
    let plane = |values: &[f32]| Plane { width: 6, height: 1, values: values.to_vec() };
    let reference = plane(&[0.5; 6]);
    let test = plane(&[0.5, 0.25, 0.75, 0.0, f32::NAN, 0.9]);
    let coverage = plane(&[1.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    let signed = view_error(&reference, &test, &coverage, ErrorKind::Signed).unwrap().pixels;
    assert_eq!(signed[0], [247; 3]);
    assert!(signed[1][2] > signed[1][0], "too dark is blue");
    assert!(signed[2][0] > signed[2][2], "too light is orange");
    assert_eq!(signed[3], signed[1], "clamped");
    assert_eq!(signed[5], BACKGROUND_RGB8);
    let absolute = view_error(&reference, &test, &coverage, ErrorKind::Absolute).unwrap().pixels;
    assert_eq!(absolute[1], absolute[2]);
    assert_eq!(absolute[1], [255, 233, 68]);
    assert_eq!(absolute[0], [8, 8, 12]);
}

#[test]
fn points_are_drawn_where_they_are_and_hidden_behind_things() {
    let stage = stage();
    let near_ground = Vec3::new(0.3, 0.0, 1.9);
    for projection in
        [camera().projection, Projection::Orthographic { half_height: 2.5, near: 0.1, far: 30.0 }]
    {
        let camera = PosedCamera { projection, ..camera() };
        let gbuffer = rasterize(&stage.scene, &stage.pose, &camera, SIDE, SIDE, 2).unwrap();
        let picture = Rgb8Image { width: SIDE, height: SIDE, pixels: vec![[100; 3]; 4096] };
        let draw =
            |p: Vec3| draw_points(&picture, &gbuffer, &camera, &[p], &[1.0], &PointsView::default()).unwrap();
        let yellow = [255, 233, 68];
        let shown = draw(near_ground);
        let lit: Vec<usize> = (0..4096).filter(|&i| shown.pixels[i] == yellow).collect();
        assert!((4..=12).contains(&lit.len()), "{lit:?}");
        assert!(shown.pixels.iter().all(|p| *p == yellow || *p == [40; 3]));
        let clip = crate::projection::clip_from_world(&camera, SIDE, SIDE).unwrap()
            * near_ground.as_dvec3().extend(1.0);
        let x = ((0.5 + 0.5 * clip.x / clip.w) * 64.0) as usize;
        let y = ((0.5 - 0.5 * clip.y / clip.w) * 64.0) as usize;
        assert!(lit.contains(&(y * 64 + x)));
        // Below the ground, and behind the camera.
        assert!(draw(Vec3::new(0.3, -1.0, -0.5)).pixels.iter().all(|p| *p == [40; 3]));
        assert!(draw(Vec3::new(0.7, 4.5, 8.0)).pixels.iter().all(|p| *p == [40; 3]));
        assert!(draw(Vec3::splat(f32::NAN)).pixels.iter().all(|p| *p == [40; 3]));
    }
}

#[test]
fn golden_views() {
    let stage = stage();
    let params = ShadeParams { shadow_resolution: 256, ..ShadeParams::default() };
    let (gbuffer, full) = shaded(&stage, &params, 2);
    for (name, space) in [("normals-world", NormalSpace::World), ("normals-rest", NormalSpace::Rest)] {
        check_golden("compose", name, &view_normals(&gbuffer, &stage.scene, &stage.pose, space));
    }
    // Made-up visibility: it falls towards the ground.
    let visibility = gbuffer.map_surfaces(&stage.scene, &stage.pose, |_, surface| {
        surface.map_or(1.0, |s| (0.3 + 0.4 * s.position_world.y).clamp(0.0, 1.0))
    });
    check_golden("compose", "visibility", &view_visibility(&gbuffer, &visibility).unwrap());
    let picture = compose(&full, &gbuffer, Some(&visibility)).unwrap().to_rgb8(&ToneMap::default());
    check_golden("compose", "composed", &picture);
    let reference = resolve_plane(&gbuffer, &visibility, 0.0).unwrap();
    let mut off = reference.values.clone();
    for (i, value) in off.values.iter_mut().enumerate() {
        *value += 0.3 * ((i % 64) as f32 / 32.0 - 1.0);
    }
    for (name, kind) in [("error-signed", ErrorKind::Signed), ("error-absolute", ErrorKind::Absolute)] {
        let view = view_error(&reference.values, &off, &reference.coverage, kind).unwrap();
        check_golden("compose", name, &view);
    }
    let points: Vec<Vec3> = (0..400)
        .map(|i| Vec3::new((i % 20) as f32 * 0.25 - 2.4, 0.0, (i / 20) as f32 * 0.25 - 2.4))
        .collect();
    let values: Vec<f32> = (0..400).map(|i| (i % 20) as f32 / 19.0).collect();
    let view = draw_points(&picture, &gbuffer, &camera(), &points, &values, &PointsView::default());
    check_golden("compose", "points", &view.unwrap());
}
