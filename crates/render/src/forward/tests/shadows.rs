//! Which faces of the shadow maps are drawn again, and that the picture is always the one of maps drawn afresh.

use dapple_scene::{LightKind, NoFiles, Pose, PosedCamera, PosedInstance};
use glam::{Affine3A, Vec3};

use super::super::Forward;
use super::harness::{Bench, FORMAT, assert_agrees, twin};
use super::motion::bent_and_swollen;
use crate::image::Rgb8Image;
use crate::shade::ShadeParams;
use crate::testing::{Stage, cube, ground};

const SIZE: (u32, u32) = (160, 100);

fn params() -> ShadeParams {
    ShadeParams { shadow_resolution: 128, ..ShadeParams::default() }
}

/// The picture of a pass that has kept nothing.
fn afresh(bench: &mut Bench, pose: &Pose, camera: &PosedCamera, params: &ShadeParams) -> Rgb8Image {
    let drawn = bench.drawn;
    let kept = std::mem::replace(&mut bench.forward, Forward::new(&bench.gpu, FORMAT, 1, &[]).unwrap());
    let picture = bench.beauty(SIZE, pose, camera, params);
    bench.forward = kept;
    bench.drawn = drawn;
    picture
}

/// A floor with a cube in each half, and a point light of short range above each cube.
fn two_rooms() -> Stage {
    let mut stage = Stage::new();
    stage.add(ground(12.0), 0, Affine3A::IDENTITY);
    for x in [-5.0, 5.0] {
        stage.add(cube(), 0, Affine3A::from_translation(Vec3::new(x, 0.6, 0.0)));
        stage.add_light(LightKind::Point, 20.0, Vec3::new(x + 0.3, 2.5, 0.2), Vec3::NEG_Y);
    }
    for light in &mut stage.scene.lights {
        light.range = Some(4.0);
    }
    stage
}

const ABOVE: Vec3 = Vec3::new(0.0, 9.0, 9.0);

#[test]
fn only_faces_that_see_what_moved_are_drawn_again() {
    let mut stage = two_rooms();
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let camera = PosedCamera::look_at(ABOVE, Vec3::ZERO, 1.0);
    let params = params();
    let first = bench.beauty(SIZE, &stage.pose, &camera, &params);
    // The lower half of what each light lights is in view, and the upper half of its sides too.
    assert!((10..=12).contains(&bench.drawn.shadow_faces), "{:?}", bench.drawn);
    let (expected, gbuffer) = twin(&stage.scene, &stage.pose, &camera, SIZE, &params);
    assert_agrees("two-rooms", &first, &expected, &gbuffer);

    assert_eq!(first, bench.beauty(SIZE, &stage.pose, &camera, &params));
    assert_eq!(bench.drawn.shadow_faces, 0, "nothing has moved");

    let mut before = first;
    for step in 1..4 {
        stage.pose.instances[1].world_from_mesh = Affine3A::from_rotation_y(0.2 * step as f32);
        stage.pose.instances[1].world_from_mesh.translation = Vec3::new(-5.0, 0.6, 0.1 * step as f32).into();
        let moved = bench.beauty(SIZE, &stage.pose, &camera, &params);
        // A cube below a light is seen by the face that looks down, and at most by the four beside it.
        assert!((1..=5).contains(&bench.drawn.shadow_faces), "{:?}", bench.drawn);
        assert_ne!(moved, before);
        assert_eq!(moved, afresh(&mut bench, &stage.pose, &camera, &params), "step {step}");
        before = moved;
    }

    // Out of one room and into the other: both lights' faces change, and no shadow stays behind.
    stage.pose.instances[1].world_from_mesh = Affine3A::from_translation(Vec3::new(5.0, 0.6, 2.0));
    let moved = bench.beauty(SIZE, &stage.pose, &camera, &params);
    assert!((2..=10).contains(&bench.drawn.shadow_faces), "{:?}", bench.drawn);
    assert_eq!(moved, afresh(&mut bench, &stage.pose, &camera, &params));

    // Where no light reaches, nobody sees it move.
    stage.pose.instances[1].world_from_mesh = Affine3A::from_translation(Vec3::new(0.0, 9.0, -30.0));
    bench.beauty(SIZE, &stage.pose, &camera, &params);
    stage.pose.instances[1].world_from_mesh = Affine3A::from_translation(Vec3::new(1.0, 9.0, -30.0));
    let moved = bench.beauty(SIZE, &stage.pose, &camera, &params);
    assert_eq!(bench.drawn.shadow_faces, 0);
    assert_eq!(moved, afresh(&mut bench, &stage.pose, &camera, &params));
}

#[test]
fn what_is_removed_leaves_neither_picture_nor_shadow() {
    let mut stage = two_rooms();
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let camera = PosedCamera::look_at(ABOVE, Vec3::ZERO, 1.0);
    let params = params();
    let first = bench.beauty(SIZE, &stage.pose, &camera, &params);
    let home = std::mem::replace(&mut stage.pose.instances[1], PosedInstance::REMOVED);
    let gone = bench.beauty(SIZE, &stage.pose, &camera, &params);
    assert!((1..=5).contains(&bench.drawn.shadow_faces), "{:?}", bench.drawn);
    let (expected, gbuffer) = twin(&stage.scene, &stage.pose, &camera, SIZE, &params);
    assert!(gbuffer.samples().iter().all(|sample| sample.instance != 1));
    assert_agrees("removed", &gone, &expected, &gbuffer);
    assert_eq!(gone, afresh(&mut bench, &stage.pose, &camera, &params));
    stage.pose.instances[1] = home;
    assert_eq!(first, bench.beauty(SIZE, &stage.pose, &camera, &params));
    // Nothing at all is a picture too.
    stage.pose.instances.fill(PosedInstance::REMOVED);
    let nothing = bench.beauty(SIZE, &stage.pose, &camera, &params);
    assert!(nothing.pixels.iter().all(|pixel| *pixel == nothing.pixels[0]));
}

#[test]
fn faces_wait_until_what_they_darken_comes_into_view() {
    let mut stage = two_rooms();
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let params = params();
    let [left, right] =
        [-5.0, 5.0].map(|x| PosedCamera::look_at(Vec3::new(x, 1.5, 3.5), Vec3::new(x, 0.5, 0.0), 0.8));
    bench.beauty(SIZE, &stage.pose, &left, &params);
    assert!((1..=6).contains(&bench.drawn.shadow_faces), "{:?}", bench.drawn);
    // While nobody looks, a cube moves twice; then it is where it is.
    for z in [0.8, -0.3] {
        stage.pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(5.0, 0.6, z));
        bench.beauty(SIZE, &stage.pose, &left, &params);
        assert_eq!(bench.drawn.shadow_faces, 0);
    }
    for camera in [right, left, right] {
        let picture = bench.beauty(SIZE, &stage.pose, &camera, &params);
        let (expected, gbuffer) = twin(&stage.scene, &stage.pose, &camera, SIZE, &params);
        assert_agrees("one-room", &picture, &expected, &gbuffer);
        assert_eq!(picture, afresh(&mut bench, &stage.pose, &camera, &params));
    }
    assert_eq!(bench.drawn.shadow_faces, 0, "both rooms are known by now");
}

#[test]
fn the_atrium_keeps_the_shadows_of_what_stands_still() {
    let glb = dapple_scene::builtin::glb("atrium", 0.02).unwrap();
    let scene = dapple_scene::load("atrium.glb", &glb, &NoFiles).unwrap();
    let Some(mut bench) = Bench::new(&scene, 1, &[]) else { return };
    let params = params();
    let mut faces = Vec::new();
    for (time, eye) in [
        (2.0, Vec3::new(3.0, 1.7, 4.0)),
        (2.1, Vec3::new(3.0, 1.7, 4.0)),
        (2.2, Vec3::new(-3.0, 1.0, -3.0)),
        (9.0, Vec3::new(3.0, 1.7, 4.0)),
    ] {
        let pose = scene.pose_undeformed(time);
        let camera = PosedCamera::look_at(eye, Vec3::new(-0.5, 1.6, -0.8), 1.0);
        let picture = bench.beauty(SIZE, &pose, &camera, &params);
        faces.push(bench.drawn.shadow_faces);
        assert_eq!(picture, afresh(&mut bench, &pose, &camera, &params), "{time}");
    }
    eprintln!("faces drawn: {faces:?}");
    // Boulders roll all over the floor, and the lanterns hang low: most faces see one of them. Those that look up do not.
    assert!(0 < faces[1] && 4 * faces[1] <= 3 * faces[0], "{faces:?}");
}

#[test]
fn deforming_casters_and_other_sizes_redraw_their_faces() {
    let scene = bent_and_swollen();
    let Some(mut bench) = Bench::new(&scene, 1, &[]) else { return };
    let camera = PosedCamera::look_at(Vec3::new(1.5, 3.0, 5.5), Vec3::new(0.0, 0.9, 0.0), 0.8);
    let params = ShadeParams { shadow_resolution: 512, ..ShadeParams::default() };
    let first = bench.beauty(SIZE, &scene.pose(0.0), &camera, &params);
    assert_eq!(first, bench.beauty(SIZE, &scene.pose(0.0), &camera, &params));
    assert_eq!(bench.drawn.shadow_faces, 0);
    // Without the vertices the maps are fitted to the same boxes at both times or not; what deforms is drawn anyway.
    let pose = scene.pose(0.6);
    let moved = bench.beauty(SIZE, &pose, &camera, &params);
    assert_eq!(bench.drawn.shadow_faces, 1);
    assert_eq!(moved, afresh(&mut bench, &pose, &camera, &params), "no shadow of the pose before is left");
    let smaller = ShadeParams { shadow_resolution: 128, ..params };
    assert_ne!(moved, bench.beauty(SIZE, &pose, &camera, &smaller));
    assert_eq!(moved, bench.beauty(SIZE, &pose, &camera, &params));
}
