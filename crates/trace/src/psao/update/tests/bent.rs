//! Bent normals: where they point, and what they are independent of.

use super::*;
use dapple_store::points::BentNormal;

fn bent(rays: u32) -> UpdateParams {
    UpdateParams { rays, radius_m: 100.0, bent_normals: true, ..Default::default() }
}

/// The bent normals of an instance, each with the point's place at rest and its normal.
fn of_instance(updater: &Updater, instance: u32) -> Vec<(Vec3, Vec3, Vec3)> {
    let layout = updater.store().layout();
    let set = layout.set_of_instance(instance).unwrap();
    let point = |i: usize| {
        let bent = updater.store().bent_of(set.first as usize + i).unwrap();
        (set.position_rest(i, layout.quantum_m()), set.normal_rest(i), bent.unpack(set.normals[i]))
    };
    (0..set.len()).map(point).collect()
}

/// A floor 8 m wide and 40 m long, at its middle a wall across it, so high that the part above counts for nothing where it is asked for.
fn wall_beside_floor() -> (Scene, Pose) {
    let floor =
        quad(Vec3::ZERO, Vec3::new(0.0, 0.0, 40.0), Vec3::new(8.0, 0.0, 40.0), Vec3::new(8.0, 0.0, 0.0));
    let wall = Affine3A::from_scale_rotation_translation(
        Vec3::new(0.1, 1.0, 38.0),
        Quat::IDENTITY,
        Vec3::new(4.0, 0.0, 1.0),
    );
    scene(vec![floor, cube()], &[(0, Affine3A::IDENTITY), (1, wall)])
}

#[test]
fn an_open_floor_is_unbent() {
    let (mut scene, pose) = stage();
    scene.instances[1].casts = false;
    scene.instances[2].casts = false;
    let (_, updater) = start(&scene, &pose, bent(64));
    let floor = updater.store().layout().set_of_instance(0).unwrap().clone();
    let all = floor.first as usize..floor.first as usize + floor.len();
    assert!(all.clone().all(|point| updater.store().bent_of(point) == Some(BentNormal::UNBENT)));
    assert!(floor.len() > 1000);
}

/// A wall of height H at distance d leaves open all directions at an angle of more than φ = atan(H / d) to the floor on its side. Their mean,
/// weighted by cosine, is proportional to (−sin² φ / 2 across, (π − φ) / 2 + sin 2φ / 4 up).
#[test]
fn beside_a_wall_light_comes_from_the_other_side_by_the_closed_form() {
    let (scene, pose) = wall_beside_floor();
    let (_, updater) = start_at(&scene, &pose, bent(256), 20.0);
    let (mut squares, mut count, mut most) = (0.0, 0, 0.0f32);
    for (place, normal, bent) in of_instance(&updater, 0) {
        let d = 4.0 - place.x;
        // Far from the ends of the wall, and not below it.
        if !(0.1..3.0).contains(&d) || !(10.0..30.0).contains(&place.z) {
            continue;
        }
        let phi = libm::atan2f(1.0, d);
        let across = -libm::sinf(phi) * libm::sinf(phi) / 2.0;
        let up = (std::f32::consts::PI - phi) / 2.0 + libm::sinf(2.0 * phi) / 4.0;
        let off = bent.angle_between(Vec3::new(across, up, 0.0));
        (squares, count, most) = (squares + off * off, count + 1, most.max(bent.angle_between(normal)));
    }
    let off = (squares / count as f32).sqrt().to_degrees();
    assert!(count > 200 && off < 1.5, "{off}° off at {count} points");
    assert!(most.to_degrees() > 25.0, "{}°", most.to_degrees());
}

#[test]
fn what_turns_as_a_whole_keeps_its_bent_normals() {
    // A cross of two plates that shades itself, alone.
    let plates = |turn: Quat| {
        let plate = |axis: Vec3| Affine3A::from_rotation_translation(turn, turn * axis);
        let place = plate(Vec3::ZERO);
        let cross = crate::test_support::joined([
            quad(Vec3::ZERO, Vec3::Z, Vec3::new(1.0, 0.0, 1.0), Vec3::X),
            quad(Vec3::ZERO, Vec3::Y, Vec3::new(0.0, 1.0, 1.0), Vec3::Z),
        ]);
        let (scene, mut pose) = scene(vec![cross], &[(0, Affine3A::IDENTITY)]);
        pose.instances[0].world_from_mesh = place;
        (scene, pose)
    };
    let at = |turn| {
        let (scene, pose) = plates(turn);
        let (_, updater) = start(&scene, &pose, bent(64));
        updater.store().clone()
    };
    let rest = at(Quat::IDENTITY);
    let turned = at(Quat::from_rotation_z(1.1) * Quat::from_rotation_x(0.7));
    let planes = |store: &PointStore| store.bent().unwrap().clone();
    let same = planes(&rest)[0].iter().zip(&planes(&turned)[0]).filter(|(a, b)| a == b).count();
    // Rays that graze the edge of the other plate may tell otherwise once it is turned.
    assert!(same * 50 > rest.layout().len() * 49, "{same} of {}", rest.layout().len());
    let bends = planes(&rest)[0].iter().filter(|byte| byte.abs_diff(128) > 20).count();
    assert!(bends * 4 > rest.layout().len(), "{bends}");
}

/// In the mirror the same directions bend the same way, as seen by the body.
#[test]
fn a_mirrored_instance_bends_towards_where_it_is_open() {
    let (mut scene, mut pose) = wall_beside_floor();
    // The floor is laid as it is and shown mirrored, with the wall on the other side of it.
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    pose.instances[0].world_from_mesh = mirror;
    pose.instances[1].world_from_mesh = mirror * pose.instances[1].world_from_mesh;
    scene.materials[0].double_sided = false;
    let (_, updater) = start_at(&scene, &pose, bent(64), 20.0);
    let near = of_instance(&updater, 0);
    let near: Vec<_> = near.iter().filter(|(place, ..)| (0.1..1.0).contains(&(4.0 - place.x))).collect();
    assert!(near.len() > 50);
    for (place, _, bent) in near.iter().filter(|(place, ..)| (5.0..35.0).contains(&place.z)) {
        assert!(bent.x < -0.1 && bent.z.abs() < 0.3, "{bent} at {place}");
    }
}

#[test]
fn nobody_has_any_who_does_not_want_them_and_visibility_is_the_same() {
    let (scene, mut pose) = stage();
    let without = UpdateParams { rays_still: 128, ..UpdateParams::default() };
    let (mut tracer, mut plain) = start(&scene, &pose, without);
    let (mut tracer_bent, mut bent) = start(&scene, &pose, UpdateParams { bent_normals: true, ..without });
    assert_eq!((plain.store().bent(), plain.store().value_bytes()), (None, plain.store().layout().len()));
    for step in 0..4 {
        pose.instances[2].world_from_mesh =
            Affine3A::from_translation(Vec3::new(1.0, 0.3, 1.0 + 0.1 * step as f32));
        tracer.update(&scene, &pose);
        tracer_bent.update(&scene, &pose);
        let report = plain.step(&scene, &pose, &mut tracer, &FREE);
        assert_eq!(bent.step(&scene, &pose, &mut tracer_bent, &FREE), report);
        assert_eq!(bent.store().visibility(), plain.store().visibility());
    }
}

/// More rays at rest refine visibility alone.
#[test]
fn refinement_leaves_bent_normals_as_they_are() {
    let (scene, pose) = stage();
    let params = UpdateParams { rays: 64, rays_still: 256, bent_normals: true, ..UpdateParams::default() };
    let (mut tracer, mut updater) = start(&scene, &pose, params);
    let before = updater.store().bent().unwrap().clone();
    for _ in 0..4 {
        updater.step(&scene, &pose, &mut tracer, &FREE);
    }
    assert_eq!(updater.store().bent().unwrap(), &before);
    updater.step_all(&scene, &pose, &tracer);
    assert_eq!(updater.store().bent().unwrap(), &before);
    let (tracer, mut plain) = start(&scene, &pose, UpdateParams { bent_normals: false, ..params });
    plain.step_all(&scene, &pose, &tracer);
    assert_eq!(updater.store().visibility(), plain.store().visibility());
}
