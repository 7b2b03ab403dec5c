//! Selective tracing must give what full tracing gives, now or in time.

mod bent;
mod budget;
mod exact;
mod memory;
mod refine;
mod removal;
mod spawn;
mod timing;

use dapple_scene::glam::{Affine3A, Quat, Vec3};

use super::*;
use crate::psao::generate::{GenerateParams, generate_points};
use crate::test_support::{Random, cube, deform, quad, scene, soup, sphere};

/// No budget, everything is seen.
const FREE: StepInput<'_> = StepInput { ray_budget: None, interest: &[] };

fn start_at(scene: &Scene, pose: &Pose, params: UpdateParams, points_per_m2: f32) -> (Tracer, Updater) {
    let tracer = Tracer::new(scene, pose);
    let generate = GenerateParams { points_per_m2, ..Default::default() };
    let points = generate_points(scene, pose, &tracer, &generate, &|_| ()).unwrap();
    let updater = Updater::new(scene, pose, &tracer, points, params, &|_| ()).unwrap();
    (tracer, updater)
}

fn start(scene: &Scene, pose: &Pose, params: UpdateParams) -> (Tracer, Updater) {
    start_at(scene, pose, params, 200.0)
}

/// A floor, a wall and a ball that can be put anywhere.
fn stage() -> (Scene, Pose) {
    let floor =
        quad(Vec3::ZERO, Vec3::new(0.0, 0.0, 4.0), Vec3::new(4.0, 0.0, 4.0), Vec3::new(4.0, 0.0, 0.0));
    let wall = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.0, 1.5, 0.2),
        Quat::from_rotation_y(0.3),
        Vec3::new(2.0, 0.0, 2.0),
    );
    let ball = sphere(Vec3::ZERO, 0.25, 8, 16);
    scene(
        vec![floor, cube(), ball],
        &[(0, Affine3A::IDENTITY), (1, wall), (2, Affine3A::from_translation(Vec3::ONE))],
    )
}

/// The stage with more on it, close together: all but the floor can move. Number 6 does not cast.
fn crowd(seed: u32) -> (Scene, Pose) {
    let mut random = Random(seed);
    let (stage, pose) = stage();
    let mut meshes = stage.meshes;
    meshes.push(soup(&mut random, 20, 0.4));
    let mut placed: Vec<(u32, Affine3A)> =
        stage.instances.iter().zip(&pose.instances).map(|(i, p)| (i.mesh, p.world_from_mesh)).collect();
    for mesh in [2, 2, 3, 1, 3] {
        let scale = if mesh == 1 { 0.4 } else { 1.0 };
        let turn = Quat::from_axis_angle(random.direction(), 6.0 * random.next());
        let at = Vec3::new(2.0, 0.5, 2.0) + Vec3::new(1.0, 0.5, 1.0) * random.vector();
        placed.push((mesh, Affine3A::from_scale_rotation_translation(Vec3::splat(scale), turn, at)));
    }
    let (mut scene, pose) = scene(meshes, &placed);
    scene.instances[6].casts = false;
    (scene, pose)
}

/// One instance's next place.
#[derive(Clone, Debug)]
struct Move {
    instance: usize,
    place: Vec3,
    angle: f32,
    bend: bool,
}

impl Move {
    fn apply(&self, scene: &Scene, pose: &mut Pose) {
        let before = pose.instances[self.instance].world_from_mesh;
        let (scale, ..) = before.to_scale_rotation_translation();
        let turn = Quat::from_rotation_x(self.angle);
        pose.instances[self.instance].world_from_mesh =
            Affine3A::from_scale_rotation_translation(scale, turn, self.place);
        if self.bend {
            let mesh = &scene.meshes[scene.instances[self.instance].mesh as usize];
            let stretch = Vec3::new(1.3, 0.7, 1.0 + 0.1 * self.angle);
            deform(pose, self.instance, mesh.positions.iter().map(|p| *p * stretch).collect());
        }
    }
}

fn any_move() -> impl proptest::strategy::Strategy<Value = Move> {
    use proptest::prelude::*;
    (1..8_usize, prop::array::uniform3(0f32..1.0), 0f32..6.0, any::<bool>()).prop_map(
        |(instance, [x, y, z], angle, bend)| Move {
            instance,
            place: Vec3::new(1.0 + 2.0 * x, y, 1.0 + 2.0 * z),
            angle,
            bend,
        },
    )
}

#[test]
fn settings_out_of_range_are_refused() {
    let (scene, pose) = stage();
    let tracer = Tracer::new(&scene, &pose);
    let points = generate_points(&scene, &pose, &tracer, &GenerateParams::default(), &|_| ()).unwrap();
    let with = |params| Updater::new(&scene, &pose, &tracer, points.clone(), params, &|_| ()).unwrap_err();
    let default = UpdateParams::default();
    assert_eq!(with(UpdateParams { rays: 0, ..default }), UpdateError::BadRays(0));
    assert_eq!(with(UpdateParams { rays: 257, ..default }), UpdateError::BadRays(257));
    assert_eq!(with(UpdateParams { radius_m: 0.0, ..default }), UpdateError::BadRadius(0.0));
    for rays_still in [1, 63, 1025] {
        let error = with(UpdateParams { rays_still, ..default });
        assert_eq!(error, UpdateError::BadRaysStill { rays_still, rays: 64 });
        assert!(error.to_string().contains("64 to 1024"), "{error}");
    }
}
