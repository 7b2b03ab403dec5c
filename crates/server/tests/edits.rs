//! A scene that is changed while it is lit: whatever the way there, the light is that of a scene that was always so.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::{Arc, LazyLock};

use dapple_scene::glam::{Quat, Vec3};
use dapple_scene::{Edit, Edits, NoFiles, Placement, Scene, Spare, builtin};
use dapple_server::{Server, ServerConfig};
use dapple_store::points::PointStore;
use dapple_stream::{Limits, Subscriber};
use dapple_trace::Tracer;
use dapple_trace::psao::generate::{GeneratedPoints, generate_points};
use dapple_trace::psao::update::{StepInput, Updater};
use proptest::prelude::*;

const SPARES: u32 = 2;

fn config() -> ServerConfig {
    let mut config = ServerConfig { cuts: false, ..ServerConfig::default() };
    config.generate.points_per_m2 = 60.0;
    config.update.rays = 24;
    config.publish.precision.tolerance = 0;
    config
}

/// The Cornell box and its stages, with spares of the first thing that moves.
struct Cornell {
    scene: Arc<Scene>,
    model: u32,
    server: Server,
    points: GeneratedPoints,
}

static CORNELL: LazyLock<Cornell> = LazyLock::new(|| {
    let glb = builtin::glb("cornell", 0.05).unwrap();
    let mut scene = dapple_scene::load("cornell.glb", &glb, &NoFiles).unwrap();
    let model = scene.moving_instances().iter().position(|moves| *moves).unwrap() as u32;
    scene.add_spares(&[Spare { instance: model, count: SPARES }]).unwrap();
    let scene = Arc::new(scene);
    let server = Server::new(scene.clone(), &config(), &|_| ()).unwrap();
    let pose = scene.pose(0.0);
    let tracer = Tracer::new(&scene, &pose);
    let points = generate_points(&scene, &pose, &tracer, &config().generate, &|_| ()).unwrap();
    Cornell { scene, model, server, points }
});

fn start() -> (Arc<Scene>, u32, Server) {
    (CORNELL.scene.clone(), CORNELL.model, CORNELL.server.clone())
}

/// Traced in a server that has never known the scene otherwise.
fn afresh(edits: &Edits, time_s: f64) -> PointStore {
    let Cornell { scene, points, .. } = &*CORNELL;
    let pose = scene.pose_edited(time_s, edits);
    let tracer = Tracer::new(scene, &pose);
    Updater::new(scene, &pose, &tracer, points.clone(), config().update, &|_| ()).unwrap().store().clone()
}

#[test]
fn what_is_gone_darkens_nothing_and_what_comes_back_is_as_before() {
    let (scene, model, mut server) = start();
    let mut viewer = Subscriber::new(Some(scene.hash().0), Limits::default());
    viewer.receive(&server.join().unwrap().unwrap().bytes).unwrap();
    let first = server.store().clone();
    let mut edits = Edits::new(&scene);
    let mut set = |server: &mut Server, edit| {
        edits.apply(&scene, &edit).unwrap();
        server.set_edits(edits.clone());
        let report = server.step(0.0).unwrap();
        viewer.receive(&report.frame.unwrap().bytes).unwrap();
        assert!(viewer.store().unwrap() == server.store());
        server.store().clone()
    };
    let without = set(&mut server, Edit::Remove { instance: model });
    let layout = first.layout();
    let (mut lighter, mut darker) = (0, 0);
    for set in layout.sets().iter().filter(|set| set.instance != model) {
        for point in set.first as usize..set.first as usize + set.len() {
            lighter += u32::from(without.visibility()[point] > first.visibility()[point]);
            darker += u32::from(without.visibility()[point] < first.visibility()[point]);
        }
    }
    assert!(lighter > 10, "what it stood on is open: {lighter}");
    assert_eq!(darker, 0);
    assert!(set(&mut server, Edit::Restore { instance: model }) == first);
    assert_eq!(server.edits(), &Edits::new(&scene));
}

#[test]
fn a_spare_has_the_points_of_what_it_is_like_and_is_lit_where_it_is_put() {
    let (scene, model, mut server) = start();
    let points = |instance| server.store().layout().set_of_instance(instance).map_or(0, |set| set.len());
    let mut edits = Edits::new(&scene);
    let spare = edits.free_like(&scene, model).unwrap();
    assert!(points(model) > 0 && points(spare).abs_diff(points(model)) * 10 <= points(model));
    let node = scene.instances[spare as usize].node;
    let mut placement = scene.placement(node, 0.0, &edits).unwrap();
    placement.translation[1] += 0.02;
    for edit in [Edit::Place { node, placement }, Edit::Restore { instance: spare }] {
        edits.apply(&scene, &edit).unwrap();
    }
    server.set_edits(edits.clone());
    assert!(server.step(0.0).unwrap().changed > 0);
    assert!(server.store() == &afresh(&edits, 0.0));
}

#[test]
fn under_a_cap_a_spare_gets_its_points_when_it_comes() {
    let (scene, model, _) = start();
    let config = ServerConfig { max_resident_points: Some(200_000), ..config() };
    let mut server = Server::new(scene.clone(), &config, &|_| ()).unwrap();
    let mut edits = Edits::new(&scene);
    let spare = edits.free_like(&scene, model).unwrap();
    let has_points = |server: &Server| server.store().layout().set_of_instance(spare).is_some();
    server.step(0.0).unwrap();
    assert!(!has_points(&server));
    edits.apply(&scene, &Edit::Restore { instance: spare }).unwrap();
    server.set_edits(edits.clone());
    for _ in 0..3 {
        server.step(0.0).unwrap();
    }
    assert!(has_points(&server));
    let everything = afresh(&edits, 0.0);
    for set in server.store().layout().sets() {
        let all = everything.layout().set_of_instance(set.instance).unwrap();
        let values = |store: &PointStore, first: u32| {
            store.visibility()[first as usize..first as usize + set.len()].to_vec()
        };
        assert_eq!(values(server.store(), set.first), values(&everything, all.first));
    }
}

fn any_edit() -> impl Strategy<Value = (u8, prop::sample::Index, [f32; 3], f32)> {
    (0u8..10, any::<prop::sample::Index>(), prop::array::uniform3(-0.5f32..0.5), 0.0f32..6.0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn the_light_is_that_of_the_present_whatever_the_way_to_it(
        steps in prop::collection::vec((prop::collection::vec(any_edit(), 0..4), 0.0f64..3.0), 1..6),
    ) {
        let (scene, model, mut server) = start();
        let mut edits = Edits::new(&scene);
        let spares = scene.instances.len() as u32 - SPARES..scene.instances.len() as u32;
        let movable: Vec<u32> = std::iter::once(model).chain(spares).collect();
        for (changes, time_s) in steps {
            for (kind, index, by, angle) in changes {
                // What moves, its spares, and now and then anything else.
                let instance = match kind % 2 {
                    0 => index.index(scene.instances.len()) as u32,
                    _ => *index.get(&movable),
                };
                let node = scene.instances[instance as usize].node;
                let edit = match kind {
                    0..=4 => {
                        let before = scene.placement(node, time_s, &edits).unwrap();
                        let to = Vec3::from_array(before.translation) + Vec3::from_array(by);
                        let turn = Quat::from_rotation_y(angle) * Quat::from_array(before.rotation);
                        let placement =
                            Placement { translation: to.into(), rotation: turn.into(), ..before };
                        Edit::Place { node, placement }
                    }
                    5 => Edit::Release { node },
                    6 => Edit::Remove { instance },
                    7 | 8 => Edit::Restore { instance: edits.free_like(&scene, model).unwrap_or(instance) },
                    _ => Edit::Reset,
                };
                // Some nodes have scales out of range, or places that are none: those edits are refused.
                let _ = edits.apply(&scene, &edit);
            }
            server.set_edits(edits.clone());
            server.step_with(time_s, &StepInput::default()).unwrap();
            let expected = afresh(&edits, time_s);
            prop_assert!(server.store() == &expected);
        }
    }
}
