//! Cuts appear where something stands between, only there, and do not depend on threads.

use dapple_scene::glam::{Affine3A, Quat, Vec3};
use dapple_scene::{Instance, Material, Mesh, Node, Part, Scene};

use super::*;
use crate::psao::generate::{GenerateParams, generate_points};

fn quad(corners: [Vec3; 4]) -> Mesh {
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
    Mesh {
        positions: corners.to_vec(),
        normals: vec![normal; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![Part { first_triangle: 0, triangle_count: 2, material: 0 }],
        ..Mesh::default()
    }
}

/// A ground of 2 m, and a thin wall across it that stands on it where `walled`.
fn scene(walled: bool, wall_casts: bool) -> Scene {
    let [x, z] = [Vec3::X, Vec3::Z];
    let ground = quad([z - x, z + x, x - z, -x - z]);
    let wall = quad([z * 1.2, z * -1.2, z * -1.2 + Vec3::Y, z * 1.2 + Vec3::Y]);
    let mut scene = Scene { materials: vec![Material::default()], ..Scene::default() };
    for (mesh, casts) in [(ground, true), (wall, wall_casts)] {
        scene.meshes.push(mesh);
        scene.nodes.push(Node::default());
        let index = scene.meshes.len() as u32 - 1;
        scene.instances.push(Instance {
            node: index,
            mesh: index,
            skin: None,
            casts,
            emitter: Default::default(),
            receives: index == 0,
            rest_from_mesh: dapple_scene::glam::Mat3::IDENTITY,
            spare: false,
        });
    }
    if !walled {
        scene.instances.truncate(1);
    }
    // Far from the origin and turned: rest space is not the world.
    let turn = Quat::from_rotation_y(0.3);
    for node in &mut scene.nodes {
        node.local = dapple_scene::LocalTransform::Trs {
            translation: Vec3::new(30.0, 4.0, -7.0),
            rotation: turn,
            scale: Vec3::ONE,
        };
    }
    for instance in &mut scene.instances {
        instance.rest_from_mesh = dapple_scene::glam::Mat3::from_quat(turn);
    }
    scene
}

fn lay(scene: &Scene) -> (Pose, Tracer, Arc<PointLayout>) {
    let pose = scene.pose(0.0);
    assert!(pose.instances.iter().all(|i| i.world_from_mesh != Affine3A::IDENTITY));
    let tracer = Tracer::new(scene, &pose);
    let params = GenerateParams { points_per_m2: 400.0, ..GenerateParams::default() };
    let layout = generate_points(scene, &pose, &tracer, &params, &|_| ()).unwrap().layout;
    (pose, tracer, layout)
}

fn cuts(scene: &Scene) -> (Arc<PointLayout>, Cuts) {
    let (pose, tracer, layout) = lay(scene);
    let cuts = find_cuts(scene, &pose, &tracer, &layout, &|_| ());
    (layout, cuts)
}

#[test]
fn a_wall_cuts_exactly_what_lies_beyond_it() {
    let scene = scene(true, true);
    let (layout, cuts) = cuts(&scene);
    let set = &layout.sets()[0];
    let placed = &scene.instances[0];
    let positions: Vec<Vec3> = scene.meshes[0].positions.iter().map(|&p| placed.rest_from_mesh * p).collect();
    let params = ChartParams::for_spacing(layout.spacing_m(), false);
    let charts = ChartSet::new(&positions, &scene.meshes[0].triangles, &params).unwrap();
    let sites = charts.sites(&positions, &scene.meshes[0].triangles);
    let own = cuts.for_sites(0, &sites, &WeightParams::default().kernel).expect("made for these sites");
    assert!(own.cuts.len() > 20);
    let neighbours = PointNeighbours::new(&layout, set, &WeightParams::default());
    let mut weigher = neighbours.weigher(set);
    // The wall stands on x = 0 of the mesh.
    let across = scene.instances[0].rest_from_mesh.x_axis;
    let mut crossing = 0;
    for (i, site) in sites.iter().enumerate() {
        let mask = own.mask(i as u32);
        let side = site.position_rest.dot(across);
        let candidates = weigher.candidates(site);
        let weight = |beyond: bool| {
            let of = candidates.iter().filter(|c| (c.position_rest.dot(across) * side < 0.0) == beyond);
            of.map(|c| c.weight()).sum::<f32>()
        };
        let part_left = weight(false) / (weight(true) + weight(false));
        let spared = !(LEAST_LEFT..=MOST_LEFT).contains(&part_left);
        for (bit, candidate) in candidates.iter().enumerate() {
            let beyond = candidate.position_rest.dot(across) * side < 0.0 && !spared;
            // The wall is as thin as a plane: a site on it is on either side.
            if side.abs() > 1e-3 {
                assert_eq!(mask >> bit & 1 == 1, beyond, "site {:?}, {:?}", site, candidate);
            }
            crossing += u32::from(beyond);
        }
    }
    assert!(crossing > 100);
}

#[test]
fn without_something_solid_nothing_is_cut() {
    assert_eq!(cuts(&scene(false, true)).1.site_count(), 0);
    assert_eq!(cuts(&scene(true, false)).1.site_count(), 0, "what does not cast does not cut");
}

#[test]
fn cuts_do_not_depend_on_threads() {
    let scene = scene(true, true);
    let (pose, tracer, layout) = lay(&scene);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| find_cuts(&scene, &pose, &tracer, &layout, &|_| ()))
    };
    assert_eq!(with(1), with(3));
}
