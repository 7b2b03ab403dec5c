//! What the server holds.

use super::*;

/// A floor of so many metres a side, and far above it a plate of that size.
fn covered_floor(size: f32) -> (Scene, Pose) {
    let corner = |i: u32, y: f32| Vec3::new((i & 1) as f32 * size, y, (i >> 1) as f32 * size);
    // Each shows the other its front: points that see backs count as lying inside something.
    let floor = quad(corner(0, 0.0), corner(2, 0.0), corner(3, 0.0), corner(1, 0.0));
    let plate = quad(corner(0, 2.0), corner(1, 2.0), corner(3, 2.0), corner(2, 2.0));
    scene(vec![floor, plate], &[(0, Affine3A::IDENTITY), (1, Affine3A::IDENTITY)])
}

#[test]
fn a_point_costs_at_most_64_bytes_with_all_that_is_remembered_of_it() {
    for rays_still in [0, 256] {
        let (scene, mut pose) = covered_floor(16.0);
        let params = UpdateParams { rays_still, ..Default::default() };
        let (mut tracer, mut updater) = start(&scene, &pose, params);
        let before = updater.bytes_per_point();
        pose.instances[1].world_from_mesh = Affine3A::from_translation(Vec3::Y * -1.7);
        tracer.update(&scene, &pose);
        updater.step(&scene, &pose, &mut tracer, &FREE);
        for _ in 0..70 {
            updater.step(&scene, &pose, &mut tracer, &FREE);
        }
        assert!(updater.clusters[0].instance == 0);
        assert!(updater.clusters.iter().filter(|c| c.instance == 0).all(|c| c.memory().is_some()));
        let after = updater.bytes_per_point();
        println!("{} points: {before:.1}, then {after:.1} bytes a point", updater.store().layout().len());
        assert!(after > before + 7.0 && after <= 64.0, "{before} and {after} bytes a point");
    }
}

#[test]
fn nothing_is_remembered_of_points_that_no_mover_reaches() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(0.5, 0.3, 0.5));
    tracer.update(&scene, &pose);
    updater.step(&scene, &pose, &mut tracer, &FREE);
    let positions = updater.positions_world(&scene, &pose);
    for cluster in &updater.clusters {
        let far = positions[cluster.range()].iter().all(|p| p.unwrap().distance(Vec3::splat(0.5)) > 2.0);
        assert!(!far || cluster.memory().is_none());
        assert!(!cluster.moving || cluster.memory().is_none(), "the ball itself");
    }
}
