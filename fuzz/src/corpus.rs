//! The seeds that fuzzing starts from: one of each thing that a stream or a scene file can carry. Written to `corpus/` by
//! `cargo run -p dapple-fuzz --example corpus`.

mod scenes;

use dapple_store::cells::CellChanges;
use dapple_store::light_visibility::{Lean, LightChange, LightVisibility};
use dapple_store::points::{BentChange, BentNormal, Change, PointStore};
use dapple_stream::cells::{CellCodec, CellPublisher};
use dapple_stream::{
    Frame, FrameHeader, FrameKind, Limits, Publisher, PublisherConfig, Recorder, RecordingHeader,
};

use crate::input::{Input, Random};

/// A camera path of each kind.
const TARGETS_JSON: &str = r#"{"version":1,"name":"a","loop":true,"keys":[
{"time_s":0,"eye":[1,2,0],"target":[0,1,0],"fov_degrees":50},{"time_s":1.5,"eye":[0,2,1],"target":[0,1,0],"near_m":0.1},
{"time_s":4,"eye":[1,2,0],"target":[0,1,0]}]}"#;
const ROTATIONS_JSON: &str = r#"{"version":1,"name":"b","interpolation":"linear","keys":[
{"time_s":0.5,"eye":[-3,1.25,2e1],"rotation":[0,0,0,1]},{"time_s":2,"eye":[0,1,1],"rotation":[0,0.6,0,0.8]}]}"#;

/// What viewers say, one of each, and what is wrong with some.
const VIEWER_LINES: &str = r#"{"type":"event","number":1,"event":{"event":"pause"}}
{"type":"event","number":2,"event":{"event":"seek","time_s":1.5}}
{"type":"event","number":3,"event":{"event":"edit","change":{"edit":"place","node":1,"placement":{"translation":[1,2,3],"rotation":[0,0,0,1],"scale":[1,1,1]}}}}
{"type":"event","number":4,"event":{"event":"edit","change":{"edit":"remove","instance":0}}}
{"type":"event","number":5,"event":{"event":"add","like":0,"placement":{"translation":[0,0,0],"rotation":[0,1,0,0],"scale":[2,1,0.5]}}}
{"type":"event","number":6,"event":{"event":"edit","change":{"edit":"light","light":0,"color":[1,0.5,0],"intensity":10}}}
{"type":"event","number":7,"event":{"event":"edit","change":{"edit":"reset-light","light":0}}}
{"type":"event","number":8,"event":{"event":"edit","change":{"edit":"release","node":1}}}
{"type":"event","number":9,"event":{"event":"play"}}
{"type":"event","number":10,"event":{"event":"edit","change":{"edit":"reset"}}}
{"type":"look","number":1,"camera":{"eye":[0,1,2],"forward":[0,0,-1],"up":[0,1,0],"yfov":0.9,"aspect":1.5},"held":{"group":1,"epoch":2},"state":3,"heard_us":4,"waited_us":5,"came":6,"lost":0}
{"type":"event","number":11,"event":{"event":"edit","change":{"edit":"remove","instance":99}}}
{"type":"look","number":3,"parts":[0,1]}
{"type":"bye"}
{"type":"hello","protocol":1,"wire":4,"scene":"00","token":"t","key":"k","bits_per_s":500000}"#;

/// What hosts say, one of each.
const HOST_LINES: &str = r#"{"type":"welcome","protocol":1,"viewer":1,"key":"","role":"view","hz":30.0,"heard":0,"goes_on":false,"bits_per_s":null,"events_per_s":60,"clock_us":1,"unix_us":2,"parts":[[[0,2]],[[3,1],[2,4294967295]],[]]}
{"type":"welcome","protocol":1,"viewer":1,"key":"k","role":"interact","hz":30.0,"heard":0,"goes_on":false,"bits_per_s":null,"events_per_s":60,"clock_us":1,"unix_us":2}
{"type":"state","version":1,"clock":{"playing":true,"time_us":0,"at_us":0},"edits":{"placed":[],"removed":[],"lights":[]}}
{"type":"changes","from":1,"to":2,"clock":{"playing":false,"time_us":5,"at_us":6},"edits":[{"edit":"remove","instance":0}]}
{"type":"heard","number":3}
{"type":"rejected","number":4,"message":"no"}
{"type":"status","viewers":2,"step_us":3,"queue_us":4,"round_trip_us":5,"ray_budget":6,"waiting":7}
{"type":"refused","reason":"closing","message":"later"}
{"protocol":1,"wire":4,"scene":"00","streams":[{},{"bits_per_s":500000}],"parts":3}"#;

/// What hosts and workers say to each other, one of each.
const WORK_LINES: &str = r#"{"type":"hello","protocol":1,"wire":4,"scene":"00","shard":0,"of":2,"token":"t"}
{"type":"done","stamp_us":1,"rays":2,"changed":3,"waiting":4,"points":5}
{"type":"setup","points_per_m2":512.0,"seed":1,"rays":64,"rays_still":0,"radius_m":0.6,"cuts":true,"step_s":0.02,"ray_budget":null}
{"type":"step","stamp_us":1,"scene_us":2,"state":3,"edits":{"placed":[],"removed":[1],"lights":[]},"looks":[{"eye":[0,1,2],"forward":[0,0,-1],"up":[0,1,0],"yfov":0.9,"aspect":1.5}]}"#;

/// The store that seeds and targets have in common: regular enough that its sections compress.
pub(crate) fn sample() -> PointStore {
    let mut bytes = vec![2, 0];
    for set in 0..2u8 {
        bytes.extend([set, 3, 40, 0]);
        for i in 0..40u8 {
            bytes.extend([i % 8 * 4, i / 8 * 4, 7, 127, 1]);
        }
        bytes.push(9);
    }
    bytes.extend([32]);
    bytes.extend((0..80).map(|i| if i % 11 == 0 { 128 } else { 255 }));
    Input(&bytes).store()
}

/// The sample with bent normals, and two lights with leans.
pub(crate) fn bent_sample() -> PointStore {
    let plane = |step: u8| sample().visibility().iter().map(|v| (v >> 1) + step).collect();
    let sample = sample();
    let values = (0..2).flat_map(|light| sample.visibility().iter().map(move |v| v >> (3 + light)));
    let values: Vec<u8> = values.collect();
    let leans = values.iter().map(|value| Lean([(value % 9) as i8 - 4, 1]).of_value(*value)).collect();
    let lights = LightVisibility::new(sample.layout(), 2, values).expect("two a point");
    let lights = lights.with_leans(leans).expect("one a value");
    let bent = sample.clone().with_bent([plane(0), plane(64)]).expect("one a point");
    bent.with_lights(lights).expect("of the same points")
}

/// Target, name and content of every seed.
pub fn seeds() -> Vec<(&'static str, String, Vec<u8>)> {
    let mut seeds = Vec::new();
    let mut frame = |name: &str, frame: &Frame| {
        seeds.push(("decode_frame", format!("{name}-frame"), frame.bytes.to_vec()));
        let header = FrameHeader::parse(&frame.bytes, &Limits::default()).expect("a sound frame");
        let payload = &frame.bytes[header.header_bytes..][..header.payload_bytes];
        let kind = match frame.kind {
            FrameKind::Snapshot => 0,
            FrameKind::Delta => 1,
            FrameKind::Sets => 2u8,
        };
        seeds.push(("decode_frame", format!("{name}-payload"), [&[kind], payload].concat()));
    };
    let publish = |publisher: &mut Publisher, store: &PointStore| publisher.publish(store).expect("a change");
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    let mut store = sample();
    let snapshot = publish(&mut publisher, &store);
    frame("snapshot", &snapshot);
    store.apply(&[Change { point: 17, visibility: 3 }]).expect("it exists");
    let delta = publish(&mut publisher, &store);
    frame("delta-of-one", &delta);
    let mut sets = Publisher::new([0; 32], PublisherConfig::default());
    publish(&mut sets, &sample());
    let first = sample().layout().sets()[0].instance;
    let less = sample().with_sets(&[first], &PointStore::default()).expect("it is there");
    frame("sets-go", &publish(&mut sets, &less));
    let mut other = Publisher::new([0; 32], PublisherConfig::default());
    publish(&mut other, &less);
    let mut back = sample();
    back.apply(&[Change { point: 70, visibility: 3 }]).expect("it exists");
    frame("sets-come", &publish(&mut other, &back));

    let mut all = Publisher::new([0; 32], PublisherConfig::default());
    publish(&mut all, &sample());
    let inverse = sample().visibility().iter().map(|v| v ^ 0x55).collect();
    frame(
        "delta-of-all",
        &publish(&mut all, &PointStore::new(sample().layout().clone(), inverse).expect("as many")),
    );
    let mut empty = Publisher::new([0; 32], PublisherConfig::default());
    frame("empty", &publish(&mut empty, &Input(&[]).store()));

    let mut bent = Publisher::new([0; 32], PublisherConfig::default());
    frame("bent", &publish(&mut bent, &bent_sample()));
    let mut turned = bent_sample();
    let old = turned.bent_of(30).expect("it has some");
    let turn = |point| BentChange { point, old, new: BentNormal([90, 160]) };
    turned.apply_bent(&[turn(30), turn(31)]).expect("they exist");
    turned.apply(&[Change { point: 31, visibility: 3 }]).expect("it exists");
    let new_lean = Lean([-3, 2]);
    let dim = |index| LightChange { index, new: 9, new_lean, ..LightChange::default() };
    turned.apply_lights(&[dim(3), dim(4), dim(5)]).expect("they exist");
    frame("bent-delta", &publish(&mut bent, &turned));
    let less = turned.with_sets(&[first], &PointStore::default()).expect("it is there");
    frame("bent-sets-go", &publish(&mut bent, &less));
    frame("bent-sets-come", &publish(&mut bent, &bent_sample()));

    cells(&mut seeds);

    // Soups of any numbers, of small ones and of very few different ones; mutations do the rest.
    for (coarse, name) in ["any-bits", "small", "few"].into_iter().enumerate() {
        let mut random = Random(coarse as u64);
        let mut bytes = vec![coarse as u8, 40, 0];
        // Exponents near 1 make triangles that meet.
        let number = |random: &mut Random| match coarse {
            0 => ((random.below(4000) as f32 - 2000.0) / 700.0).to_le_bytes().to_vec(),
            1 => vec![random.bits() as u8],
            _ => vec![random.below(5) as u8, 0],
        };
        for _ in 0..41 * 9 {
            bytes.extend(number(&mut random));
        }
        bytes.extend([0, 0, 2, 3, 0]);
        while bytes.len() < 2600 {
            bytes.extend(number(&mut random));
            bytes.extend(number(&mut random));
            bytes.extend(number(&mut random));
            bytes.extend([255, 66, 0]);
        }
        seeds.push(("triangle_soup", name.to_owned(), bytes));
    }

    // A store of one set of two points, then calls: random ones, and every one once.
    let start = [5, 2, 4, 0, 1, 0, 0, 0, 2, 0, 1, 2, 3, 9, 1, 4, 5, 6, 9, 1, 0, 32, 100, 200];
    for seed in 0..6 {
        let mut random = Random(seed);
        let calls: Vec<u8> = (0..100 + 60 * seed).map(|_| random.bits() as u8).collect();
        seeds.push(("session_ops", format!("random-{seed}"), [&start[..], &calls].concat()));
    }
    // The same with bent normals, for each number of random calls again.
    let bent_start = [&start[..21], &[33, 100, 200, 128, 90, 128, 160]].concat();
    assert_eq!(start[21], 32);
    for seed in 6..9 {
        let mut random = Random(seed);
        let calls: Vec<u8> = (0..60 * seed - 200).map(|_| random.bits() as u8).collect();
        seeds.push(("session_ops", format!("bent-{seed}"), [&bent_start[..], &calls].concat()));
    }
    let mut calls = start.to_vec();
    calls.extend([5, 0, 0, 0, 0, 0, 2, 0, 0, 0, 7, 1, 0, 9, 6, 0, 0, 0, 0, 3, 0, 1, 2, 4, 7, 0, 0]);
    calls.extend([1, 1, 0, 1, 0, 77, 3, 0, 0, 64, 8, 1, 0, 5, 1, 0, 1, 0]);
    // Sets go, and two of one point come.
    calls.extend([
        7, 0, 1, 0, 9, 0, 1, 0, 1, 2, 3, 9, 1, 4, 32, 50, 7, 1, 1, 0, 19, 0, 1, 0, 7, 7, 7, 9, 1, 4, 32, 51,
    ]);
    seeds.push(("session_ops", "each-call".to_owned(), calls));

    for (name, frames) in [
        ("empty", &[][..]),
        ("group", &[(0, &snapshot), (500_000, &delta)][..]),
        ("two-groups", &[(0, &snapshot), (500_000, &delta), (1_250_000, &snapshot), (2_000_000, &delta)][..]),
    ] {
        seeds.push(("read_recording", name.to_owned(), recording(name, frames)));
    }

    for (name, lines) in [("viewer", VIEWER_LINES), ("host", HOST_LINES), ("work", WORK_LINES)] {
        seeds.push(("live_session", name.to_owned(), lines.as_bytes().to_vec()));
    }
    let mut light = dapple_session::LightHead { made_us: 7, ..Default::default() }.messages(&[1, 2, 3]);
    seeds.push(("live_session", "light".to_owned(), light.swap_remove(0).to_vec()));
    let head = dapple_session::LightHead { part: Some(1), made_us: 7, ..Default::default() };
    seeds.push(("live_session", "part".to_owned(), head.messages(&[1, 2, 3]).swap_remove(0).to_vec()));

    for (name, json) in [("targets", TARGETS_JSON), ("rotations", ROTATIONS_JSON)] {
        seeds.push(("read_camera_path", name.to_owned(), json.as_bytes().to_vec()));
    }

    let scenes = [("scene.glb", scenes::glb()), ("scene.gltf", scenes::gltf()), ("scene.obj", scenes::obj())];
    seeds.push(("read_weights", "table".to_owned(), crate::weights::table().into_bytes()));
    seeds.push(("read_environment", "sky".to_owned(), crate::environment::sky()));
    seeds.extend(scenes.map(|(name, bytes)| ("load_scene", name.to_owned(), bytes)));
    seeds
}

/// A scene file with one of each thing.
pub(crate) fn small_scene() -> Vec<u8> {
    scenes::glb()
}

/// Frames, payloads and a body of the paper's cells.
fn cells(seeds: &mut Vec<(&'static str, String, Vec<u8>)>) {
    let table = crate::cells::sample();
    let changes = CellChanges { buckets: vec![1, 4], cells: vec![0, 3] };
    for (codec, name) in [(CellCodec::Zstd, "zstd"), (CellCodec::Lz4, "lz4")] {
        let mut publisher = CellPublisher::new([0; 32], codec, 0.5);
        let join = publisher.join(&table).expect("memory suffices");
        let delta = publisher.publish(&table, &changes, 1.0).expect("memory suffices").expect("a change");
        for (frame, kind) in [(join, "snapshot"), (delta, "delta")] {
            let header = FrameHeader::parse(&frame.bytes, &Limits::default()).expect("a sound frame");
            let payload = &frame.bytes[header.header_bytes..][..header.payload_bytes];
            let first = u8::from(frame.kind == FrameKind::Delta);
            seeds.push(("decode_cells", format!("{name}-{kind}-payload"), [&[first], payload].concat()));
            seeds.push(("decode_cells", format!("{name}-{kind}-frame"), frame.bytes));
        }
    }
    // One grid of 2 × 2 × 2 cells and one bucket; one entry, one cell.
    let mut body = vec![128];
    body.extend([0; 32]);
    body.extend([0.1f32, 0.2].iter().flat_map(|f| f.to_le_bytes()));
    body.extend([1, 7]);
    body.extend([0; 12]);
    body.extend([2, 2, 2, 1]);
    let contents = |body: &mut Vec<u8>| {
        body.extend([1, 0, 1, 0, 3, 0, 0, 0, 1, 0, 0, 0]);
        body.extend([0; 56]);
        body.extend([9, 0x77, 0x11, 0x84]);
        body.extend([0; 24]);
    };
    contents(&mut body);
    seeds.push(("decode_cells", "snapshot-body".to_owned(), body));
    let mut body = vec![129];
    contents(&mut body);
    seeds.push(("decode_cells", "delta-body".to_owned(), body));
}

/// A recording of two seconds of frames at their times.
fn recording(name: &str, frames: &[(u64, &Frame)]) -> Vec<u8> {
    let header = RecordingHeader { scene_hash: [0; 32], name: name.to_owned(), duration_us: 2_000_000 };
    let (mut recorder, mut bytes) = Recorder::new(&header).expect("it is short");
    for (time_us, frame) in frames {
        bytes.extend(recorder.frame(*time_us, &frame.bytes).expect("frames are in order"));
    }
    bytes.extend(recorder.finish());
    bytes
}
