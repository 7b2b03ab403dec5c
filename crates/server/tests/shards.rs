//! Parts of a scene that several servers light, put together: the light of one server, to the bit.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use dapple_scene::{Edit, Edits, NoFiles, Placement, Scene, builtin};
use dapple_server::shards::{MergeError, Merger, Shard};
use dapple_server::{Server, ServerConfig, ServerError};
use dapple_stream::{Limits, Precision, PublisherConfig, Subscriber};
use dapple_trace::psao::generate::GenerateParams;
use dapple_trace::psao::update::UpdateParams;

fn scene() -> Arc<Scene> {
    let glb = builtin::glb("cornell", 0.2).unwrap();
    Arc::new(dapple_scene::load("cornell.glb", &glb, &NoFiles).unwrap())
}

fn config(shard: Option<Shard>) -> ServerConfig {
    let precision = Precision { tolerance: 0, step: 0 };
    ServerConfig {
        generate: GenerateParams { points_per_m2: 60.0, ..GenerateParams::default() },
        update: UpdateParams { bent_normals: true, ..UpdateParams::default() },
        publish: PublisherConfig { precision, ..PublisherConfig::default() },
        shard,
        ..ServerConfig::default()
    }
}

fn start(scene: &Arc<Scene>, shard: Option<Shard>) -> Server {
    Server::new(scene.clone(), &config(shard), &|_| ()).unwrap()
}

#[test]
fn parts_are_all_instances_and_about_equal() {
    let scene = scene();
    let params = config(None).generate;
    for of in [1, 2, 3, 7, 200] {
        let parts: Vec<Vec<u32>> =
            (0..of).map(|number| Shard { number, of }.instances(&scene, &params).unwrap()).collect();
        let mut all: Vec<u32> = parts.concat();
        all.sort_unstable();
        assert_eq!(all, (0..scene.instances.len() as u32).collect::<Vec<_>>(), "{of} parts");
    }
    let points = |of: u32, number: u32| start(&scene, Some(Shard { number, of })).store().layout().len();
    let (one, other) = (points(2, 0), points(2, 1));
    assert!(one.abs_diff(other) * 2 < one + other, "{one} and {other} points");
}

#[test]
fn parts_put_together_are_the_whole_to_the_bit() {
    let scene = scene();
    let mut whole = start(&scene, None);
    let of = 3;
    let mut parts: Vec<Server> = (0..of).map(|number| start(&scene, Some(Shard { number, of }))).collect();
    let mut merger = Merger::new(&scene, of, config(None).publish, None, Limits::default());
    merger.add_stream(Some(1_000_000));
    let mut viewer = Subscriber::new(Some(scene.hash().0), Limits::default());
    let mut edits = Edits::new(&scene);
    for step in 0..12 {
        let time_s = step as f64 * 0.3;
        if step == 4 {
            let placement =
                Placement { translation: [0.1, 0.5, 0.2], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] };
            edits.apply(&scene, &Edit::Place { node: scene.instances[1].node, placement }).unwrap();
        }
        whole.set_edits(edits.clone());
        whole.step(time_s).unwrap();
        for (number, part) in parts.iter_mut().enumerate() {
            // They come one after the other, and one of them breaks off and comes back.
            if step < number || (number == 1 && (5..8).contains(&step)) {
                continue;
            }
            part.set_edits(edits.clone());
            let frame = part.step(time_s).unwrap().frame;
            let joins = step == number || (number == 1 && step == 8);
            let frame = if joins { part.join().unwrap() } else { frame };
            if let Some(frame) = frame {
                merger.receive(number as u32, &frame.bytes).unwrap();
            }
        }
        for frame in merger.publish(time_s, &|_| true).into_iter().take(1).flatten() {
            viewer.receive(&frame.bytes).unwrap();
        }
        let held = viewer.store().unwrap();
        assert!(held.visibility() == merger.store().visibility(), "step {step}");
        assert!(held.bent().is_some() && held.bent() == merger.store().bent(), "step {step}: bent normals");
        if step >= 8 || (3..5).contains(&step) {
            assert!(held.layout() == whole.store().layout(), "step {step}: points");
            assert!(held.visibility() == whole.traced().visibility(), "step {step}: values");
            assert!(held.bent() == whole.traced().bent(), "step {step}: bent normals");
        }
    }
    // Who joins late gets the same.
    let mut late = Subscriber::new(Some(scene.hash().0), Limits::default());
    late.receive(&merger.join_stream(0).unwrap().bytes).unwrap();
    assert!(late.store() == viewer.store());
    assert!(late.cuts().unwrap().sets() == viewer.cuts().unwrap().sets());
    assert_eq!(viewer.cuts().unwrap().site_count(), {
        let mut alone = Subscriber::new(None, Limits::default());
        alone.receive(&whole.join().unwrap().unwrap().bytes).unwrap();
        alone.cuts().unwrap().site_count()
    });
}

#[test]
fn what_does_not_fit_leaves_the_whole_as_it_is() {
    let scene = scene();
    let mut merger = Merger::new(&scene, 2, config(None).publish, None, Limits::default());
    let mut first = start(&scene, Some(Shard { number: 0, of: 2 }));
    merger.receive(0, &first.join().unwrap().unwrap().bytes).unwrap();
    let before = merger.store().clone();
    // The same part again, and one of another density.
    let again = merger.receive(1, &first.join().unwrap().unwrap().bytes);
    assert!(matches!(again, Err(MergeError::Layout(_))), "{again:?}");
    let mut other = config(Some(Shard { number: 1, of: 2 }));
    other.generate.points_per_m2 = 30.0;
    let mut other = Server::new(scene.clone(), &other, &|_| ()).unwrap();
    let denser = merger.receive(1, &other.join().unwrap().unwrap().bytes);
    assert!(matches!(denser, Err(MergeError::Layout(_))), "{denser:?}");
    assert!(matches!(merger.receive(1, b"DP"), Err(MergeError::Receive(_))));
    assert!(*merger.store() == before);
    let mut second = start(&scene, Some(Shard { number: 1, of: 2 }));
    merger.receive(1, &second.join().unwrap().unwrap().bytes).unwrap();
    assert!(merger.store().layout().len() > before.layout().len());
}

#[test]
fn parts_that_cannot_be_are_refused() {
    let scene = scene();
    let refused = |config: ServerConfig| Server::new(scene.clone(), &config, &|_| ()).err().unwrap();
    let bad = config(Some(Shard { number: 2, of: 2 }));
    assert!(matches!(refused(bad), ServerError::BadShard { number: 2, of: 2 }));
    let capped = ServerConfig { max_resident_points: Some(100), ..config(Some(Shard { number: 0, of: 2 })) };
    assert!(matches!(refused(capped), ServerError::UnevenShard));
}
