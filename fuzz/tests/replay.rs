//! Replays the committed corpus of every fuzz target, and mutations of it from fixed seeds.
//!
//! `DAPPLE_FUZZ_MUTATIONS` sets how many mutations each input gets (default 300).

use std::path::Path;

use dapple_fuzz::{Random, TARGETS};

/// The corpus of a target, in order of file name.
fn corpus(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    let mut inputs: Vec<(String, Vec<u8>)> = std::fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| {
            let path = entry.expect("a readable folder").path();
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            (name, std::fs::read(&path).expect("a readable file"))
        })
        .collect();
    inputs.sort();
    inputs
}

/// Changes a few places of `bytes`; now and then takes a piece from `other`.
fn mutate(bytes: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..1 + random.below(4) {
        let at = random.below(out.len() + 1);
        let end = at + random.below((out.len() - at).min(16) + 1);
        match random.below(6) {
            0 | 1 if at < out.len() => out[at] ^= 1 << random.below(8),
            2 if at < out.len() => out[at] = [0, 1, 0x7f, 0x80, 0xff, random.bits() as u8][random.below(6)],
            3 => drop(out.drain(at..end)),
            4 => {
                let piece = out[at..end].to_vec();
                out.splice(at..at, piece);
            }
            5 if !other.is_empty() => {
                let from = random.below(other.len());
                let piece = &other[from..(from + random.below(32)).min(other.len())];
                let end = end.min(out.len());
                out.splice(at..end, piece.iter().copied());
            }
            _ => out.insert(at, random.bits() as u8),
        }
    }
    out
}

/// Runs a target; where it panics, says with which bytes.
fn run(target: fn(&[u8]), name: &str, bytes: &[u8]) {
    if std::panic::catch_unwind(|| target(bytes)).is_err() {
        let hex: String = bytes.iter().map(|b| format!("{b:02x}")).collect();
        panic!("{name} panicked on {hex}");
    }
}

#[test]
fn corpus_and_its_mutations_keep_every_promise() {
    let mutations = std::env::var("DAPPLE_FUZZ_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(300);
    for (target, body) in TARGETS {
        let inputs = corpus(target);
        assert!(!inputs.is_empty(), "{target} has no corpus");
        for (index, (name, bytes)) in inputs.iter().enumerate() {
            run(body, &format!("{target}/{name}"), bytes);
            let mut random = Random(index as u64);
            for number in 0..mutations {
                let other = &inputs[random.below(inputs.len())].1;
                run(body, &format!("{target}/{name}, mutation {number}"), &mutate(bytes, other, &mut random));
            }
        }
    }
}

/// The seeds in the folder are those that the generator makes, so that it stays true how they came about.
/// Compressed ones may differ with the compressor's release; renew them with the example `corpus`.
#[test]
fn corpus_holds_the_generated_seeds() {
    for (target, name, bytes) in dapple_fuzz::corpus::seeds() {
        let found = corpus(target).into_iter().find(|(other, _)| *other == name);
        assert!(found.is_some_and(|(_, found)| found == bytes), "{target}/{name}: run the example `corpus`");
    }
}

/// The seeds of scene files load, or their mutations would hardly get anywhere.
#[test]
fn scene_seeds_load_with_everything_in_them() {
    for (_, name, bytes) in dapple_fuzz::corpus::seeds().into_iter().filter(|seed| seed.0 == "load_scene") {
        let scene = dapple_scene::load(&name, &bytes, &dapple_scene::NoFiles).expect("a sound file");
        let warnings: Vec<&str> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
        if name.ends_with(".obj") {
            assert_eq!(scene.triangle_count(), 5, "{warnings:?}");
            continue;
        }
        assert_eq!(warnings, Vec::<&str>::new(), "{name}");
        let counts = [scene.meshes.len(), scene.instances.len(), scene.skins.len(), scene.materials.len()];
        assert_eq!(counts, [2, 3, 1, 3], "{name}");
        let counts = [scene.images.len(), scene.lights.len(), scene.cameras.len(), scene.animations.len()];
        assert_eq!(counts, [1, 3, 2, 1], "{name}");
    }
}
