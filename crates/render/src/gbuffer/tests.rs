//! Coverage, precision and robustness of the G-buffer.

use std::sync::Arc;

use dapple_scene::{AlphaMode, DeformedMesh, Filter, Mesh, PosedCamera, Projection};
use glam::{Affine3A, DMat4, DVec3, Vec3, Vec4};

use super::*;
use crate::image::{Rgb8Image, unorm8};
use crate::testing::{
    Stage, check_golden, checkerboard, cube, ground, matte, quad, sphere, turned, with_threads,
};

/// One world unit is one pixel; the picture's lower left corner is the origin, the camera looks along −Z.
fn pixel_camera(width: u32, height: u32) -> PosedCamera {
    PosedCamera {
        world_from_view: Affine3A::from_translation(Vec3::new(0.5 * width as f32, 0.5 * height as f32, 10.0)),
        projection: Projection::Orthographic { half_height: 0.5 * height as f32, near: 0.1, far: 20.0 },
    }
}

fn rectangle(min: [f32; 2], max: [f32; 2], z: f32) -> Mesh {
    let at = |x: f32, y: f32| Vec3::new(x, y, z);
    quad([at(min[0], min[1]), at(max[0], min[1]), at(max[0], max[1]), at(min[0], max[1])])
}

fn look(eye: Vec3, target: Vec3) -> PosedCamera {
    PosedCamera::look_at(eye, target, 0.9)
}

/// Counts how often each sample is drawn.
struct CountSink;

impl Sink for CountSink {
    type Pixel = u32;
    type State = ();

    fn begin(&self, _: &Triangle) {}

    fn sample(&self, _: &(), _: &Triangle, _: [u32; 2], _: f32, pixel: &mut u32) {
        *pixel += 1;
    }
}

fn count_coverage(stage: &Stage, camera: &PosedCamera, side: u32, cull: bool) -> Vec<u32> {
    let clip_from_world = projection::clip_from_world(camera, side, side).unwrap();
    let view = View { clip_from_world, columns: side, rows: side };
    let mut pixels = vec![0; (side * side) as usize];
    draw(&view, &stage.scene, &stage.pose, cull, |_| true, &CountSink, &mut pixels);
    pixels
}

#[test]
fn a_quad_covers_exactly_its_pixels() {
    // Edges between pixel centres: columns 2, 3, 4; rows from the top 16 − 7 … 16 − 4.
    let mut stage = Stage::new();
    stage.add(rectangle([2.0, 4.0], [5.0, 7.0], 0.0), 0, Affine3A::IDENTITY);
    let buffer = rasterize(&stage.scene, &stage.pose, &pixel_camera(16, 16), 16, 16, 1).unwrap();
    for (i, sample) in buffer.samples().iter().enumerate() {
        let (x, y) = (i % 16, i / 16);
        let inside = (2..5).contains(&x) && (9..12).contains(&y);
        assert_eq!(sample.is_covered(), inside, "pixel {x}, {y}");
    }
}

#[test]
fn edges_through_pixel_centers_belong_to_the_right_and_lower_side() {
    let mut stage = Stage::new();
    stage.add(rectangle([2.5, 4.5], [5.5, 7.5], 0.0), 0, Affine3A::IDENTITY);
    let buffer = rasterize(&stage.scene, &stage.pose, &pixel_camera(16, 16), 16, 16, 1).unwrap();
    for (i, sample) in buffer.samples().iter().enumerate() {
        let (x, y) = (i % 16, i / 16);
        // Left and top edges are in, right and bottom edges are out.
        let inside = (2..5).contains(&x) && (8..11).contains(&y);
        assert_eq!(sample.is_covered(), inside, "pixel {x}, {y}");
    }
}

#[test]
fn supersamples_lie_on_a_regular_grid() {
    let mut stage = Stage::new();
    // Covers x < 3.5: half of pixel 3's columns of samples.
    stage.add(rectangle([0.0, 0.0], [3.5, 8.0], 0.0), 0, Affine3A::IDENTITY);
    let buffer = rasterize(&stage.scene, &stage.pose, &pixel_camera(8, 8), 8, 8, 4).unwrap();
    assert_eq!(buffer.samples().len(), 32 * 32);
    assert_eq!(buffer.sample_position_px(33), [0.375, 0.375]);
    let covered = buffer.map_pixels(|samples| samples.filter(|&i| buffer.samples()[i].is_covered()).count());
    for (i, count) in covered.into_iter().enumerate() {
        assert_eq!(count, [16, 16, 16, 8, 0, 0, 0, 0][i % 8], "pixel {i}");
    }
}

#[test]
fn a_closed_sphere_covers_every_sample_twice_or_not_at_all() {
    const SIDE: u32 = 160;
    for step in 0..40 {
        let mut stage = Stage::new();
        let angle = 0.37 * step as f32;
        stage.add(sphere(24 + step, 37), 0, turned(angle, Vec3::new(0.3, -0.1, 0.2)));
        let eye = Vec3::new(2.5 * (0.7 * angle).cos(), 0.4 * angle - 2.0, 2.5 * (0.7 * angle).sin());
        let camera = if step % 2 == 0 {
            look(eye, Vec3::ZERO)
        } else {
            PosedCamera {
                projection: Projection::Orthographic { half_height: 1.6, near: 0.1, far: 20.0 },
                ..look(eye, Vec3::ZERO)
            }
        };
        let both = count_coverage(&stage, &camera, SIDE, false);
        let front = count_coverage(&stage, &camera, SIDE, true);
        let covered = front.iter().filter(|&&n| n == 1).count();
        assert!(covered > 2000, "only {covered} samples covered at step {step}");
        for (i, (&both, &front)) in both.iter().zip(&front).enumerate() {
            assert!(front <= 1, "sample {i} covered {front} times at step {step}");
            assert_eq!(both, 2 * front, "crack or overlap at sample {i}, step {step}");
        }
    }
}

#[test]
fn shared_edges_survive_clipping() {
    // Inside a tessellated sphere, with the near plane cutting it and parts far outside the guard band.
    for step in 0..12 {
        let mut stage = Stage::new();
        stage.scene.materials[0].double_sided = true;
        stage.add(sphere(9, 14), 0, turned(0.5 * step as f32, Vec3::ZERO));
        let direction = Vec3::new((step as f32).cos(), 0.3, (step as f32).sin());
        for eye in [direction * 0.2, direction * 0.9] {
            let counts = count_coverage(&stage, &look(eye, eye + direction), 96, true);
            assert!(counts.iter().all(|&n| n == 1), "step {step}");
        }
        let mut camera = look(direction * -0.3, Vec3::ZERO);
        camera.projection = Projection::Perspective { yfov: 2.2, near: 0.9 };
        let counts = count_coverage(&stage, &camera, 96, true);
        assert!(counts.iter().all(|&n| n <= 1), "step {step}");
        assert!(counts.contains(&1) && counts.contains(&0), "the near plane must cut at step {step}");
    }
}

#[test]
fn an_endless_ground_has_no_holes_below_the_horizon() {
    let mut stage = Stage::new();
    stage.add(ground(1e7), 0, Affine3A::IDENTITY);
    let camera = look(Vec3::new(0.0, 1.7, 0.0), Vec3::new(10.0, 1.7, 3.0));
    let counts = count_coverage(&stage, &camera, 200, true);
    for (i, n) in counts.into_iter().enumerate() {
        let row = i / 200;
        assert_eq!(n, u32::from(row >= 100), "sample {i}");
    }
}

#[test]
fn positions_reproject_to_their_samples() {
    let mut stage = Stage::new();
    stage.add(sphere(30, 40), 0, turned(1.0, Vec3::ZERO));
    // Barycentrics are floats: a place in a triangle is known to 2^-24 of its size, so it must not be kilometres wide.
    stage.add(ground(50.0), 0, Affine3A::from_translation(Vec3::new(0.0, -1.0, 0.0)));
    for camera in [
        look(Vec3::new(1.0, 0.7, 3.0), Vec3::ZERO),
        PosedCamera {
            projection: Projection::Orthographic { half_height: 2.0, near: 0.0, far: 50.0 },
            ..look(Vec3::new(1.0, 2.7, 3.0), Vec3::ZERO)
        },
    ] {
        let buffer = rasterize(&stage.scene, &stage.pose, &camera, 200, 120, 2).unwrap();
        let clip_from_world = projection::clip_from_world(&camera, 200, 120).unwrap();
        let mut seen = 0;
        for i in 0..buffer.samples().len() {
            let Some(surface) = buffer.surface(&stage.scene, &stage.pose, i) else { continue };
            let clip = clip_from_world * surface.position_world.as_dvec3().extend(1.0);
            let px = [(0.5 + 0.5 * clip.x / clip.w) * 200.0, (0.5 - 0.5 * clip.y / clip.w) * 120.0];
            let want = buffer.sample_position_px(i);
            let off = (px[0] - f64::from(want[0])).abs().max((px[1] - f64::from(want[1])).abs());
            // At the horizon a float's step in the world is much of a pixel's height: leave out what is far.
            if surface.position_world.length() < 30.0 {
                assert!(off < 1e-3, "sample {i} is off by {off} px");
                let depth = (clip.z / clip.w) as f32;
                assert!((depth - buffer.samples()[i].depth).abs() < 1e-5 * depth.max(0.1));
                seen += 1;
            }
        }
        assert!(seen > 10_000);
    }
}

#[test]
fn texture_coordinates_are_perspective_correct() {
    let mut stage = Stage::new();
    stage.add(ground(4.0), 0, Affine3A::IDENTITY);
    let camera = look(Vec3::new(0.5, 0.8, 4.5), Vec3::new(-0.2, 0.0, 0.0));
    let buffer = rasterize(&stage.scene, &stage.pose, &camera, 96, 64, 1).unwrap();
    let world_from_clip: DMat4 = projection::clip_from_world(&camera, 96, 64).unwrap().inverse();
    let mut seen = 0;
    for i in 0..buffer.samples().len() {
        let Some(surface) = buffer.surface(&stage.scene, &stage.pose, i) else { continue };
        let [x, y] = buffer.sample_position_px(i).map(f64::from);
        let far = world_from_clip * DVec3::new(x / 48.0 - 1.0, 1.0 - y / 32.0, 0.5).extend(1.0);
        let eye = camera.eye_world().as_dvec3();
        let direction = far.truncate() / far.w - eye;
        let hit = eye - direction * (eye.y / direction.y);
        let uv = [(hit.x + 4.0) / 8.0, (hit.z + 4.0) / 8.0];
        assert!((f64::from(surface.uv[0].x) - uv[0]).abs() < 2e-5, "{:?} {uv:?}", surface.uv[0]);
        assert!((f64::from(surface.uv[0].y) - uv[1]).abs() < 2e-5, "{:?} {uv:?}", surface.uv[0]);
        assert_eq!(surface.normal_world, Vec3::Y);
        seen += 1;
    }
    assert!(seen > 1000);
}

#[test]
fn rest_positions_do_not_move_with_the_instance() {
    let mut stage = Stage::new();
    let scale = Affine3A::from_scale(Vec3::new(0.5, 0.7, 0.6));
    let sphere_mesh = sphere(40, 60);
    let instance = stage.add(sphere_mesh.clone(), 0, scale) as usize;
    let rest_from_mesh = stage.scene.instances[instance].rest_from_mesh;
    let camera = look(Vec3::new(0.0, 0.4, 3.0), Vec3::ZERO);
    let mut pose = stage.pose.clone();
    for step in 0..4 {
        // Move the instance and carry the camera with it: the same samples see the same rest positions.
        let motion = turned(0.8 * step as f32, Vec3::new(3.0 * step as f32, 0.0, -1.0));
        pose.instances[0].world_from_mesh = motion * scale;
        let moved = PosedCamera { world_from_view: motion * camera.world_from_view, ..camera };
        let still = rasterize(&stage.scene, &stage.pose, &camera, 64, 64, 1).unwrap();
        let buffer = rasterize(&stage.scene, &pose, &moved, 64, 64, 1).unwrap();
        let mut seen = 0;
        for i in 0..buffer.samples().len() {
            let a = still.surface(&stage.scene, &stage.pose, i);
            let b = buffer.surface(&stage.scene, &pose, i);
            let (Some(a), Some(b)) = (a, b) else { continue };
            assert!((a.position_rest - b.position_rest).length() < 1e-4, "step {step}");
            // And the world position is the rest position moved (here rest is the scaled mesh).
            let world = motion.transform_point3(b.position_rest);
            assert!((world - b.position_world).length() < 1e-4);
            let rest = buffer.surface_rest(&stage.scene, i).unwrap();
            assert_eq!((rest.position_rest, rest.normal_rest), (b.position_rest, b.normal_rest));
            assert!(b.normal_rest.dot(b.position_rest) > 0.0);
            seen += 1;
        }
        assert!(seen > 500);
    }
    // A deformed mesh keeps the undeformed rest positions: here the whole mesh is pushed aside by a metre.
    let deformed = DeformedMesh {
        positions: sphere_mesh.positions.iter().map(|p| rest_from_mesh * *p + Vec3::X).collect(),
        normals: sphere_mesh.normals.clone(),
    };
    let mut pushed = stage.pose.clone();
    pushed.instances[0].world_from_mesh = Affine3A::IDENTITY;
    pushed.instances[0].deformed = Some(Arc::new(deformed));
    let camera = look(Vec3::new(1.0, 0.4, 3.0), Vec3::X);
    let buffer = rasterize(&stage.scene, &pushed, &camera, 64, 64, 1).unwrap();
    let checked = buffer.map_surfaces(&stage.scene, &pushed, |_, surface| {
        surface.is_some_and(|s| {
            assert!((s.position_world - s.position_rest - Vec3::X).length() < 1e-5);
            true
        })
    });
    assert!(checked.into_iter().filter(|&c| c).count() > 500);
}

#[test]
fn normals_face_the_viewer_whatever_the_transform() {
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let squash = Affine3A::from_scale(Vec3::new(0.3, 1.2, 0.8));
    let camera = look(Vec3::new(1.0, 1.5, 3.0), Vec3::ZERO);
    for transform in [Affine3A::IDENTITY, mirror, turned(2.0, Vec3::ZERO) * mirror * squash] {
        for double_sided in [false, true] {
            let mut stage = Stage::new();
            stage.scene.materials[0].double_sided = double_sided;
            stage.add(sphere(40, 60), 0, transform);
            let buffer = rasterize(&stage.scene, &stage.pose, &camera, 64, 64, 1).unwrap();
            let mut seen = 0;
            for i in 0..buffer.samples().len() {
                let Some(s) = buffer.surface(&stage.scene, &stage.pose, i) else { continue };
                assert!(!buffer.samples()[i].is_back_face(), "outside of a closed mesh is its front");
                let to_eye = camera.eye_world() - s.position_world;
                assert!(s.normal_world.dot(to_eye) > 0.0);
                assert!(s.normal_world.dot(s.position_world) > 0.0, "normal points inwards");
                assert!(s.normal_shading_world.dot(s.normal_world) > 0.9);
                assert!(s.normal_rest.dot(s.position_rest) > 0.0);
                seen += 1;
            }
            assert!(seen > 200, "{transform:?} double sided {double_sided}: {seen}");
        }
    }
}

#[test]
fn back_faces_are_culled_or_turned() {
    let camera = look(Vec3::new(0.0, 0.0, 0.1), Vec3::NEG_Z);
    let mut stage = Stage::new();
    stage.add(sphere(20, 30), 0, Affine3A::IDENTITY);
    let buffer = rasterize(&stage.scene, &stage.pose, &camera, 16, 16, 1).unwrap();
    assert!(buffer.samples().iter().all(|s| !s.is_covered()));
    stage.scene.materials[0].double_sided = true;
    let buffer = rasterize(&stage.scene, &stage.pose, &camera, 16, 16, 1).unwrap();
    for i in 0..buffer.samples().len() {
        assert!(buffer.samples()[i].is_back_face());
        let s = buffer.surface(&stage.scene, &stage.pose, i).unwrap();
        assert!(s.normal_world.dot(s.position_world) < 0.0, "must point to the viewer inside");
        assert!(s.normal_shading_world.dot(s.normal_world) > 0.9);
        assert!(s.normal_rest.dot(s.position_rest) < 0.0);
    }
}

#[test]
fn a_flat_normal_map_changes_nothing_and_green_points_up() {
    let mut stage = Stage::new();
    let flat = stage.add_texture(1, Filter::Nearest, vec![[128, 128, 255, 255]]);
    let up = stage.add_texture(1, Filter::Nearest, vec![[128, 255, 128, 255]]);
    let material = |texture| dapple_scene::Material {
        normal_texture: Some(dapple_scene::NormalTexture { texture, scale: 1.0 }),
        ..matte(Vec3::ONE)
    };
    let (flat, up) = (stage.add_material(material(flat)), stage.add_material(material(up)));
    let facing = || rectangle([0.0, 0.0], [8.0, 8.0], 0.0);
    let camera = pixel_camera(8, 8);
    for (material, mirrored, want) in
        [(flat, false, Vec3::Z), (flat, true, Vec3::Z), (up, false, Vec3::Y), (up, true, Vec3::Y)]
    {
        for stored in [false, true] {
            let mut mesh = facing();
            if stored {
                mesh.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4];
            }
            let mut transform = Affine3A::IDENTITY;
            if mirrored {
                transform = Affine3A::from_translation(Vec3::new(8.0, 0.0, 0.0))
                    * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
            }
            let mut stage = Stage { scene: stage.scene.clone(), pose: stage.pose.clone() };
            stage.add(mesh, material, transform);
            let buffer = rasterize(&stage.scene, &stage.pose, &camera, 8, 8, 1).unwrap();
            let s = buffer.surface(&stage.scene, &stage.pose, 20).unwrap();
            let n = s.normal_shading_world;
            assert!(n.dot(want) > 0.99, "stored {stored}, mirrored {mirrored}: {n} is not {want}");
            assert_eq!(s.normal_world, Vec3::Z);
        }
    }
}

#[test]
fn masks_cut_holes_where_alpha_is_low() {
    let mut stage = Stage::new();
    let board = checkerboard(4, [255, 255, 255, 255], [255, 255, 255, 0]);
    let texture = stage.add_texture(4, Filter::Nearest, board);
    for alpha_mode in [AlphaMode::Mask { cutoff: 0.3 }, AlphaMode::Blend, AlphaMode::Opaque] {
        let mut stage = Stage { scene: stage.scene.clone(), pose: stage.pose.clone() };
        let material = stage.add_material(dapple_scene::Material {
            base_color_texture: Some(texture),
            alpha_mode,
            ..matte(Vec3::ONE)
        });
        stage.add(rectangle([0.0, 0.0], [8.0, 8.0], 0.0), material, Affine3A::IDENTITY);
        stage.add(rectangle([0.0, 0.0], [8.0, 8.0], -5.0), 0, Affine3A::IDENTITY);
        let buffer = rasterize(&stage.scene, &stage.pose, &pixel_camera(8, 8), 8, 8, 1).unwrap();
        for (i, sample) in buffer.samples().iter().enumerate() {
            let (x, y) = (i % 8, i / 8);
            let solid = (x / 2 + y / 2) % 2 == 0 || alpha_mode == AlphaMode::Opaque;
            assert_eq!(sample.instance, u32::from(!solid), "{alpha_mode:?} at {x}, {y}");
        }
    }
}

#[test]
fn the_nearest_wins_and_ties_go_to_the_lower_instance() {
    let mut stage = Stage::new();
    for z in [0.0, 1.0, 1.0, -3.0] {
        stage.add(rectangle([0.0, 0.0], [8.0, 8.0], z), 0, Affine3A::IDENTITY);
    }
    let buffer = rasterize(&stage.scene, &stage.pose, &pixel_camera(8, 8), 8, 8, 1).unwrap();
    assert!(buffer.samples().iter().all(|s| s.instance == 1));
}

#[test]
fn degenerate_input_is_harmless() {
    let strange = [
        Vec3::ZERO,
        Vec3::splat(f32::MAX),
        Vec3::splat(-f32::MAX),
        Vec3::new(f32::NAN, 0.0, 0.0),
        Vec3::new(0.0, f32::INFINITY, 1.0),
        Vec3::new(1e-30, 1e-38, -1e-30),
        Vec3::new(1e20, -1e19, -1e20),
        Vec3::new(0.1, 0.2, 0.3),
        Vec3::new(0.3, -0.2, -5.0),
    ];
    let n = strange.len() as u32;
    let mut mesh = Mesh { positions: strange.to_vec(), normals: vec![Vec3::ZERO; 9], ..Mesh::default() };
    for a in 0..n {
        for b in 0..n {
            for c in 0..n {
                mesh.triangles.push([a, b, c]);
            }
        }
    }
    mesh.triangles.push([0, 1, 99]);
    let mut stage = Stage::new();
    stage.scene.materials[0].double_sided = true;
    stage.add(mesh, 0, Affine3A::IDENTITY);
    stage.add(Mesh::default(), 0, Affine3A::IDENTITY);
    stage.add(cube(), 0, Affine3A::from_scale(Vec3::ZERO));
    stage.add(cube(), 0, Affine3A::from_scale(Vec3::new(0.2, 0.0, 0.2)));
    let camera = look(Vec3::new(0.4, 0.6, 2.0), Vec3::ZERO);
    for (width, height, n) in [(1, 1, 1), (1, 1, 8), (3, 200, 1), (64, 64, 2), (16384, 1, 1)] {
        let buffer = rasterize(&stage.scene, &stage.pose, &camera, width, height, n).unwrap();
        for (i, sample) in buffer.samples().iter().enumerate() {
            let [b1, b2] = sample.barycentrics;
            assert!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0, "{sample:?}");
            assert!((0.0..=1.0).contains(&sample.depth), "{sample:?}");
            if let Some(s) = buffer.surface(&stage.scene, &stage.pose, i) {
                assert!(s.position_world.is_finite() && s.normal_world.is_finite(), "{s:?}");
                assert!(s.normal_shading_world.is_finite() && s.normal_rest.is_finite(), "{s:?}");
            }
        }
    }
}

#[test]
fn the_largest_grids_are_drawn_exactly() {
    // The narrowest subdivision (12 bits) with the widest row: 131,072 samples.
    let mut stage = Stage::new();
    stage.add(sphere(16, 24), 0, Affine3A::from_scale(Vec3::new(6e4, 1.0, 1.0)));
    let mut camera = pixel_camera(16384, 1);
    camera.world_from_view.translation.x = 0.0;
    camera.projection = Projection::Orthographic { half_height: 0.5, near: 0.1, far: 20.0 };
    let buffer = rasterize(&stage.scene, &stage.pose, &camera, 16384, 1, 8).unwrap();
    assert_eq!(buffer.samples().len(), 131_072 * 8);
    let uncovered = buffer.samples().iter().filter(|s| !s.is_covered()).count();
    assert!(buffer.samples()[3 * 131_072 + 65_536].is_covered());
    assert!(uncovered == 0, "{uncovered} holes");
}

#[test]
fn wrong_requests_are_refused_with_a_reason() {
    let mut stage = Stage::new();
    stage.add(cube(), 0, Affine3A::IDENTITY);
    let camera = look(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO);
    let size = |w, h, n| rasterize(&stage.scene, &stage.pose, &camera, w, h, n).unwrap_err();
    for error in [size(0, 4, 1), size(4, 16385, 1), size(4, 4, 0), size(4, 4, 9), size(16384, 16384, 2)] {
        assert!(matches!(error, RenderError::Size { .. }), "{error}");
        assert!(error.to_string().contains("16384"), "{error}");
    }
    for projection in [
        Projection::Perspective { yfov: 0.0, near: 0.1 },
        Projection::Perspective { yfov: f32::NAN, near: 0.1 },
        Projection::Perspective { yfov: 1.0, near: 0.0 },
        Projection::Orthographic { half_height: 1.0, near: 2.0, far: 1.0 },
        Projection::Orthographic { half_height: -1.0, near: 0.0, far: 1.0 },
    ] {
        let camera = PosedCamera { projection, ..camera };
        let error = rasterize(&stage.scene, &stage.pose, &camera, 4, 4, 1).unwrap_err();
        assert!(matches!(error, RenderError::Camera { .. }), "{projection:?}: {error}");
    }
    let mut pose = stage.pose.clone();
    pose.instances.clear();
    let error = rasterize(&stage.scene, &pose, &camera, 4, 4, 1).unwrap_err();
    assert!(error.to_string().contains("the pose has 0 instances and the scene 1"), "{error}");
    let mut scene = stage.scene.clone();
    scene.meshes[0].parts[0].material = 7;
    let error = rasterize(&scene, &stage.pose, &camera, 4, 4, 1).unwrap_err();
    assert!(matches!(error, RenderError::Scene { .. }), "{error}");
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let mut stage = Stage::new();
    for i in 0..6 {
        let place = turned(i as f32, Vec3::new(0.6 * i as f32 - 1.5, 0.2 * i as f32, 0.0));
        stage.add(sphere(30 + i, 50), 0, place);
    }
    let camera = look(Vec3::new(0.5, 1.0, 4.0), Vec3::ZERO);
    let render = || rasterize(&stage.scene, &stage.pose, &camera, 160, 90, 2).unwrap();
    let one = with_threads(1, render);
    assert!(one.samples().iter().filter(|s| s.is_covered()).count() > 10_000);
    assert_eq!(one, with_threads(2, render));
    assert_eq!(one, with_threads(5, render));
}

#[test]
fn the_projection_is_the_cameras() {
    for projection in [
        Projection::Perspective { yfov: 0.9, near: 0.02 },
        Projection::Orthographic { half_height: 3.0, near: 0.5, far: 90.0 },
    ] {
        let camera = PosedCamera { projection, ..look(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO) };
        let ours = projection::clip_from_view(&projection, 1.5).as_mat4();
        let theirs = camera.clip_from_view(1.5);
        assert!(ours.abs_diff_eq(theirs, 1e-5), "{ours} {theirs}");
        for distance in [0.7f32, 3.0, 42.0] {
            let clip = ours * Vec4::new(0.0, 0.0, -distance, 1.0);
            let back = projection::view_distance(&projection, clip.z / clip.w);
            assert!((back - distance).abs() < 1e-3 * distance, "{back} {distance}");
        }
    }
}

#[test]
fn golden_barycentrics() {
    let mut stage = Stage::new();
    stage.scene.materials[0].double_sided = true;
    stage.add(sphere(7, 9), 0, turned(0.6, Vec3::new(-0.7, 0.9, 0.0)));
    stage.add(cube(), 0, turned(2.1, Vec3::new(1.2, 0.7, 0.4)) * Affine3A::from_scale(Vec3::splat(0.6)));
    stage.add(ground(40.0), 0, Affine3A::IDENTITY);
    let camera = look(Vec3::new(0.4, 1.6, 4.0), Vec3::new(0.0, 0.8, 0.0));
    let buffer = rasterize(&stage.scene, &stage.pose, &camera, 96, 96, 1).unwrap();
    let color = |s: &Sample| match s.is_covered() {
        true => [
            unorm8(s.barycentrics[0]),
            unorm8(s.barycentrics[1]),
            (60 * (s.instance + 1) + s.triangle % 16) as u8,
        ],
        false => [0; 3],
    };
    let picture = Rgb8Image { width: 96, height: 96, pixels: buffer.samples().iter().map(color).collect() };
    check_golden("gbuffer", "barycentrics", &picture);
}
