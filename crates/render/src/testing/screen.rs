//! What every screen-space method must keep to, on scenes whose visibility is known.

use dapple_scene::{PosedCamera, Projection};
use glam::{Affine3A, Vec3};

use super::{Stage, check_golden, cube, ground, quad, sphere, turned, with_threads};
use crate::compose::view_visibility;
use crate::gbuffer::{GBuffer, Screen, rasterize};

/// A method with its parameters.
pub(crate) type Estimate<'a> = &'a (dyn Fn(&Screen) -> Vec<f32> + Sync);

/// A picture of a stage, for methods that draw it once more.
pub(crate) struct Shot<'a> {
    pub(crate) stage: &'a Stage,
    pub(crate) camera: &'a PosedCamera,
    pub(crate) gbuffer: &'a GBuffer,
    pub(crate) screen: &'a Screen,
}

/// A method that does.
pub(crate) type EstimateShot<'a> = &'a (dyn Fn(&Shot<'_>) -> Vec<f32> + Sync);

pub(crate) fn look(eye: Vec3, target: Vec3) -> PosedCamera {
    PosedCamera::look_at(eye, target, 0.8)
}

pub(crate) fn draw(stage: &Stage, camera: &PosedCamera, [width, height]: [u32; 2]) -> (GBuffer, Screen) {
    let gbuffer = rasterize(&stage.scene, &stage.pose, camera, width, height, 1).unwrap();
    let screen = gbuffer.screen(&stage.scene, &stage.pose, camera).unwrap();
    (gbuffer, screen)
}

/// An endless ground, and an endless wall of height 3 on it at x = 0 that faces +x.
pub(crate) fn corner() -> Stage {
    let mut stage = Stage::new();
    stage.add(ground(40.0), 0, Affine3A::IDENTITY);
    let at = |y: f32, z: f32| Vec3::new(0.0, y, z);
    stage.add(quad([at(0.0, 40.0), at(0.0, -40.0), at(3.0, -40.0), at(3.0, 40.0)]), 0, Affine3A::IDENTITY);
    stage
}

/// A sphere and a box in a corner.
pub(crate) fn still_life() -> Stage {
    let mut stage = corner();
    let ball = Affine3A::from_translation(Vec3::new(0.9, 0.5, 0.6)) * Affine3A::from_scale(Vec3::splat(0.5));
    stage.add(sphere(24, 32), 0, ball);
    stage.add(cube(), 0, turned(0.7, Vec3::new(1.0, 0.4, -0.7)) * Affine3A::from_scale(Vec3::splat(0.4)));
    stage
}

/// Visibility of the ground at distance `d` from an endless wall of height `h`, rays of length `r`: `ARCHITECTURE.md`.
pub(crate) fn beside_a_wall(d: f64, h: f64, r: f64) -> f64 {
    let s = |c: f64| if c >= 1.0 { 0.0 } else { libm::acos(c) - c * (1.0 - c * c).sqrt() };
    let (c, a) = (d / r, d / (d * d + h * h).sqrt());
    1.0 - (s(c) - a * s(c / a)) / std::f64::consts::PI
}

/// A plane seen at up to so many degrees from any side, through both lenses, before and behind a parallel camera's own place, is this open at least.
pub(crate) fn check_walls(estimate: Estimate<'_>, steepest: f64, least: f32) {
    check_walls_of(&|shot| estimate(shot.screen), steepest, least);
}

/// The same for methods that draw the stage once more.
pub(crate) fn check_walls_of(estimate: EstimateShot<'_>, steepest: f64, least: f32) {
    let mut stage = Stage::new();
    stage.add(ground(60.0), 0, Affine3A::IDENTITY);
    let angles = [0.0, 10.0, 45.0, 60.0, 75.0, 82.0f64];
    let cases = angles.into_iter().filter(|d| *d <= steepest).flat_map(|d| (0..4).map(move |turn| (d, turn)));
    for (degrees, turn) in cases {
        let angle = degrees.to_radians();
        let eye = Vec3::new(libm::sin(angle) as f32, libm::cos(angle) as f32, 0.1) * 6.0;
        let rolled = Affine3A::from_rotation_z(turn as f32 * std::f32::consts::FRAC_PI_2);
        for projection in [
            Projection::Perspective { yfov: 0.8, near: 0.02 },
            Projection::Orthographic { half_height: 1.5, near: 0.1, far: 90.0 },
            Projection::Orthographic { half_height: 1.5, near: -90.0, far: 90.0 },
        ] {
            let mut camera = PosedCamera { projection, ..look(eye, Vec3::ZERO) };
            if matches!(projection, Projection::Orthographic { near: -90.0, .. }) {
                // It stands behind what it sees.
                let back = Vec3::from(camera.world_from_view.matrix3.z_axis);
                camera.world_from_view.translation -= glam::Vec3A::from(back * 16.0);
            }
            camera.world_from_view *= rolled;
            let (gbuffer, screen) = draw(&stage, &camera, [97, 61]);
            let visibility =
                estimate(&Shot { stage: &stage, camera: &camera, gbuffer: &gbuffer, screen: &screen });
            let covered = gbuffer.samples().iter().filter(|s| s.is_covered()).count();
            assert!(covered > 3000, "{degrees}, {turn}: {covered}");
            let closed = visibility.iter().position(|v| *v < least || v.is_nan());
            let found = closed.map(|i| (i % 97, i / 97, visibility[i]));
            assert!(found.is_none(), "{degrees}, turned {turn} times, {projection:?}: {found:?}");
        }
    }
}

/// Means over strips of the ground beside the wall of [`corner`], a tenth of the radius wide, the nearest first: what is found, and the closed form.
pub(crate) fn corner_profile(estimate: Estimate<'_>, radius_m: f32) -> Vec<[f64; 2]> {
    corner_profile_of(&|shot| estimate(shot.screen), radius_m)
}

/// The same for methods that draw the stage once more.
pub(crate) fn corner_profile_of(estimate: EstimateShot<'_>, radius_m: f32) -> Vec<[f64; 2]> {
    let stage = corner();
    let camera = look(Vec3::new(3.0, 2.5, 0.0), Vec3::new(0.5, 0.0, 0.0));
    let (gbuffer, screen) = draw(&stage, &camera, [240, 240]);
    let visibility = estimate(&Shot { stage: &stage, camera: &camera, gbuffer: &gbuffer, screen: &screen });
    let mut strips = [(0.0f64, 0.0f64, 0u32); 12];
    for (i, &v) in visibility.iter().enumerate() {
        let surface = gbuffer.surface(&stage.scene, &stage.pose, i);
        let Some(surface) = surface.filter(|s| s.instance == 0) else { continue };
        let x = surface.position_world.x;
        if let Some(strip) = strips.get_mut((x / radius_m * 10.0) as usize).filter(|_| x > 0.0) {
            strip.0 += f64::from(v);
            strip.1 += beside_a_wall(f64::from(x), 3.0, f64::from(radius_m));
            strip.2 += 1;
        }
    }
    assert!(strips.iter().all(|strip| strip.2 > 200), "{strips:?}");
    let means = strips.map(|(v, truth, n)| [v, truth].map(|sum| sum / f64::from(n))).to_vec();
    println!("radius {radius_m}: {means:.2?}");
    means
}

/// A profile falls towards the edge as the truth does: by as much, up to `within`, and nowhere farther from it than that.
pub(crate) fn check_profile(means: &[[f64; 2]], within: f64) {
    let falls = |k: usize| means[10][k] - means[0][k];
    assert!((falls(0) - falls(1)).abs() < within, "{means:?}");
    for (i, pair) in means.windows(2).take(10).enumerate() {
        assert!(pair[0][0] <= pair[1][0] + 0.02, "strip {i}: {means:?}");
    }
    for (i, [found, truth]) in means.iter().enumerate() {
        assert!((found - truth).abs() < within, "strip {i}: {found}, the truth is {truth}");
    }
}

/// Pictures of any size, of any camera and of nothing have values 0 … 1, the background is open, and threads change nothing.
pub(crate) fn check_pictures(estimate: Estimate<'_>) {
    check_pictures_of(&|shot| estimate(shot.screen));
}

/// The same for methods that draw the stage once more.
pub(crate) fn check_pictures_of(estimate: EstimateShot<'_>) {
    let stage = still_life();
    let camera = look(Vec3::new(2.0, 2.5, 4.0), Vec3::ZERO);
    let from_below = look(Vec3::new(0.3, 0.1, 1.5), Vec3::new(0.2, 3.0, 0.0));
    // Its near plane lies behind its place, and things do, too.
    let parallel = PosedCamera {
        projection: Projection::Orthographic { half_height: 2.0, near: -3.0, far: 20.0 },
        ..look(Vec3::new(0.5, 0.7, 0.4), Vec3::ZERO)
    };
    for size in [[1, 1], [3, 7], [7, 3], [1, 40], [33, 1], [64, 48], [65, 47]] {
        for camera in [&camera, &from_below, &parallel] {
            let (gbuffer, screen) = draw(&stage, camera, size);
            let shot = Shot { stage: &stage, camera, gbuffer: &gbuffer, screen: &screen };
            let visibility = with_threads(1, || estimate(&shot));
            assert_eq!(visibility.len(), (size[0] * size[1]) as usize);
            for (value, sample) in visibility.iter().zip(gbuffer.samples()) {
                assert!((0.0..=1.0).contains(value), "{size:?}: {value}");
                assert!(sample.is_covered() || *value == 1.0, "{size:?}: background {value}");
            }
            assert_eq!(visibility, with_threads(3, || estimate(&shot)));
        }
    }
    let stage = Stage::new();
    let (gbuffer, screen) = draw(&stage, &camera, [5, 4]);
    let shot = Shot { stage: &stage, camera: &camera, gbuffer: &gbuffer, screen: &screen };
    assert_eq!(estimate(&shot), [1.0; 20]);
}

/// The still life as a method sees it is its golden picture.
pub(crate) fn check_golden_view(method: &str, name: &str, estimate: Estimate<'_>) {
    check_golden_view_of(method, name, &|shot| estimate(shot.screen));
}

/// The same for methods that draw the stage once more.
pub(crate) fn check_golden_view_of(method: &str, name: &str, estimate: EstimateShot<'_>) {
    let stage = still_life();
    let camera = look(Vec3::new(3.2, 2.4, 1.8), Vec3::new(0.5, 0.5, 0.0));
    let gbuffer = rasterize(&stage.scene, &stage.pose, &camera, 80, 60, 2).unwrap();
    let screen = gbuffer.screen(&stage.scene, &stage.pose, &camera).unwrap();
    let shot = Shot { stage: &stage, camera: &camera, gbuffer: &gbuffer, screen: &screen };
    check_golden(method, name, &view_visibility(&gbuffer, &estimate(&shot)).unwrap());
}

/// A far camera with a narrow lens sees what a parallel one does, up to `mean`.
pub(crate) fn check_lenses(estimate: Estimate<'_>, mean: f32) {
    check_lenses_of(&|shot| estimate(shot.screen), mean);
}

/// The same for methods that draw the stage once more.
pub(crate) fn check_lenses_of(estimate: EstimateShot<'_>, mean: f32) {
    let stage = still_life();
    let (direction, far_m, half_height) = (Vec3::new(0.5, 0.6, 1.0).normalize(), 2000.0, 2.0f64);
    let yfov = (2.0 * libm::atan(half_height / f64::from(far_m))) as f32;
    let perspective = PosedCamera {
        projection: Projection::Perspective { yfov, near: 1.0 },
        ..look(direction * far_m, Vec3::ZERO)
    };
    let parallel = PosedCamera {
        projection: Projection::Orthographic { half_height: half_height as f32, near: 0.0, far: 20.0 },
        ..look(direction * 10.0, Vec3::ZERO)
    };
    let [a, b] = [perspective, parallel].map(|camera| {
        let (gbuffer, screen) = draw(&stage, &camera, [120, 90]);
        estimate(&Shot { stage: &stage, camera: &camera, gbuffer: &gbuffer, screen: &screen })
    });
    let found = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32;
    assert!(found < mean, "{found}");
    assert!(b.iter().any(|&v| v < 0.9));
}
