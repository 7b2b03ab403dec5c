//! Parts of a scene that several servers light, put together: the light of one server, to the bit.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use dapple_scene::{Aabb, Edit, Edits, NoFiles, Placement, Scene, builtin};
use dapple_server::shards::{Merger, Shard};
use dapple_server::{Server, ServerConfig, ServerError};
use dapple_stream::{Applied, Limits, Parts, Precision, PublisherConfig, ReceiveError, Subscriber};
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
fn parts_are_all_instances() {
    let scene = scene();
    let params = config(None).generate;
    for of in [1, 2, 3, 7, 200] {
        let parts: Vec<Vec<u32>> =
            (0..of).map(|number| Shard { number, of }.instances(&scene, &params).unwrap()).collect();
        let mut all: Vec<u32> = parts.concat();
        all.sort_unstable();
        assert_eq!(all, (0..scene.instances.len() as u32).collect::<Vec<_>>(), "{of} parts");
    }
}

#[test]
fn parts_put_together_are_the_whole_to_the_bit() {
    let scene = scene();
    let mut whole = start(&scene, None);
    let of = 3;
    let mut parts: Vec<Server> = (0..of).map(|number| start(&scene, Some(Shard { number, of }))).collect();
    let mut merger = Merger::new(&scene, config(None).publish, None, Limits::default());
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
    let mut merger = Merger::new(&scene, config(None).publish, None, Limits::default());
    let mut first = start(&scene, Some(Shard { number: 0, of: 2 }));
    merger.receive(0, &first.join().unwrap().unwrap().bytes).unwrap();
    let before = merger.store().clone();
    // The same part again, and one of another density.
    let again = merger.receive(1, &first.join().unwrap().unwrap().bytes);
    assert!(matches!(again, Err(ReceiveError::Misfit(_))), "{again:?}");
    let mut other = config(Some(Shard { number: 1, of: 2 }));
    other.generate.points_per_m2 = 30.0;
    let mut other = Server::new(scene.clone(), &other, &|_| ()).unwrap();
    let denser = merger.receive(1, &other.join().unwrap().unwrap().bytes);
    assert!(matches!(denser, Err(ReceiveError::Misfit(_))), "{denser:?}");
    assert!(matches!(merger.receive(1, b"DP"), Err(ReceiveError::Decode(_))));
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

/// Who takes parts by themselves holds of them what who takes the whole holds.
#[test]
fn parts_taken_by_themselves_are_those_of_the_whole_to_the_bit() {
    let scene = scene();
    let of = 3;
    let mut parts: Vec<Server> = (0..of).map(|number| start(&scene, Some(Shard { number, of }))).collect();
    let mut merger = Merger::new(&scene, config(None).publish, None, Limits::default());
    merger.offer_parts(of);
    let mut whole = Subscriber::new(Some(scene.hash().0), Limits::default());
    let mut viewer = Parts::new(Some(scene.hash().0), Limits::default());
    let mut changes = (0, 0);
    for step in 0..14 {
        let time_s = step as f64 * 0.3;
        for (number, part) in parts.iter_mut().enumerate() {
            let joins = step == 0 || (number == 1 && step == 5);
            if number == 1 && step == 5 {
                // Another server takes the second part's place.
                *part = start(&scene, Some(Shard { number: 1, of }));
            }
            let frame = part.step(time_s).unwrap().frame;
            if joins {
                merger.begin(number as u32);
            }
            let frame = if joins { part.join().unwrap() } else { frame };
            if let Some(frame) = frame {
                merger.receive(number as u32, &frame.bytes).unwrap();
            }
        }
        // The first part, where things move, is out of sight for a while, and nobody else takes it.
        let is_seen = |number: usize| number > 0 || !(3..9).contains(&step);
        let wants = |stream: usize| stream == 0 || is_seen(stream - 1);
        let before = viewer.store().cloned();
        let mut came: Vec<(u32, u8, u8)> = Vec::new();
        let mut is_new = false;
        let frames = merger.publish(time_s, &wants);
        assert_eq!(frames.len(), 1 + of as usize);
        for (stream, frame) in frames.iter().enumerate() {
            let again = stream == 1 && step == 9;
            assert!(frame.is_none() || stream == 0 || is_seen(stream - 1));
            // Who comes back to a part begins with its snapshot.
            let joined = again.then(|| merger.join_stream(stream).unwrap());
            let Some(frame) = joined.as_ref().or(frame.as_ref()) else { continue };
            if stream == 0 {
                whole.receive(&frame.bytes).unwrap();
                continue;
            }
            match viewer.receive(stream as u32 - 1, &frame.bytes).unwrap() {
                Applied::Changes(changes) => came.extend(changes.iter().map(|c| (c.point, c.old, c.new))),
                // Nothing has changed since it was seen last.
                Applied::Ignored(_) if again => {}
                applied => {
                    assert!(step == 0, "{applied:?} in step {step}");
                    assert_eq!(
                        stream == 1,
                        matches!(applied, Applied::NewLayout),
                        "the first brings a layout"
                    );
                    is_new = true;
                }
            }
        }
        let (held, truth) = (viewer.store().unwrap(), whole.store().unwrap());
        assert!(held.layout() == truth.layout(), "step {step}");
        assert_eq!(viewer.cuts().sets(), whole.cuts().unwrap().sets());
        if let (Some(before), false) = (before, is_new) {
            // What it says has changed is what has.
            let told = before.visibility().iter().zip(held.visibility()).zip(0u32..);
            let told: Vec<_> = told.filter(|((a, b), _)| a != b).map(|((a, b), i)| (i, *a, *b)).collect();
            came.sort_unstable();
            assert!(came == told, "step {step}");
            changes.0 += told.len();
        }
        if (0..3).all(is_seen) {
            assert!(held.visibility() == truth.visibility(), "step {step}");
            assert!(held.bent().is_some() && held.bent() == truth.bent(), "step {step}");
        } else {
            changes.1 += usize::from(held.visibility() != truth.visibility());
        }
    }
    assert!(changes.0 > 0 && changes.1 > 0, "nothing happened: {changes:?}");
    // A part that is another scene's is refused, and what is held stays.
    let before = viewer.store().cloned();
    let other = viewer.receive(2, &merger.join_stream(1).unwrap().bytes);
    assert!(matches!(other, Err(ReceiveError::Misfit(_))), "{other:?}");
    assert!(viewer.store() == before.as_ref());
    viewer.receive(2, &merger.join_stream(3).unwrap().bytes).unwrap();
    assert!(viewer.store() == before.as_ref());
}

#[test]
fn parts_lie_together_and_are_about_equal() {
    let glb = builtin::glb("atrium", 0.1).unwrap();
    let scene = Arc::new(dapple_scene::load("atrium.glb", &glb, &NoFiles).unwrap());
    let params = GenerateParams { points_per_m2: 20.0, ..GenerateParams::default() };
    let pose = scene.pose(0.0);
    let size = |instances: &[u32]| {
        let bounds = instances.iter().map(|i| scene.instance_bounds_world(&pose, *i as usize));
        let centers = Aabb::from_points(bounds.filter(|b| !b.is_empty()).map(|b| b.center()));
        let edges = centers.max - centers.min;
        edges.x * edges.y.max(0.1) * edges.z
    };
    let all: Vec<u32> = (0..scene.instances.len() as u32).collect();
    let whole =
        Server::new(scene.clone(), &ServerConfig { generate: params, ..ServerConfig::default() }, &|_| ());
    let whole = whole.unwrap();
    let sets = whole.store().layout().sets();
    let points = |part: &[u32]| -> usize {
        sets.iter().filter(|set| part.contains(&set.instance)).map(|set| set.len()).sum()
    };
    let largest = sets.iter().map(|set| set.len()).max().unwrap();
    for of in [2, 3, 4, 8] {
        let parts = Shard::all(of, &scene, &params).unwrap();
        let most = parts.iter().map(|part| points(part)).max().unwrap();
        // No part can have less than the largest instance.
        let least = (whole.store().layout().len() / of as usize).max(largest);
        assert!(most * 4 <= least * 5, "{of} parts: {most} points instead of {least}");
        let volume: f32 = parts.iter().map(|part| size(part)).sum();
        assert!(volume <= 1.25 * size(&all), "{of} parts: {volume} of {}", size(&all));
    }
}
