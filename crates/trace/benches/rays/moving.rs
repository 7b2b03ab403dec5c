//! What a frame of a moving scene costs before its first ray: skinning and refitting.

use anyhow::Result;
use dapple_scene::Scene;
use dapple_scene::builtin::BUILTINS;
use dapple_trace::Tracer;

use crate::clock::{median, time_process};
use crate::scenes::{load_builtin, load_shared};

const SHARED: [(&str, &str); 2] =
    [("CesiumMan", "anim-CesiumMan/CesiumMan.glb"), ("mannequiny", "anim-mannequiny/mannequiny.glb")];
const FRAMES_PER_SECOND: f64 = 30.0;

/// Medians over frames, on one thread.
pub(crate) struct Moving {
    pub(crate) name: String,
    pub(crate) triangles: usize,
    /// Those of instances with vertices of their own.
    pub(crate) deformed: usize,
    pub(crate) pose_ms: f64,
    pub(crate) update_ms: f64,
}

/// Everything here that moves: walkers by others, where they are at hand, and built-in scenes.
pub(crate) fn measure(frames: usize) -> Result<Vec<Moving>> {
    let mut all = Vec::new();
    for (name, file) in SHARED {
        if let Some(scene) = load_shared(file)? {
            all.push(measure_one(name, &scene, frames)?);
        }
    }
    for builtin in BUILTINS {
        all.push(measure_one(builtin.name, &load_builtin(builtin.name)?, frames)?);
    }
    Ok(all)
}

fn measure_one(name: &str, scene: &Scene, frames: usize) -> Result<Moving> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let first = scene.pose(0.0);
    let mut tracer = pool.install(|| Tracer::new(scene, &first));
    let (mut posing, mut updating) = (Vec::new(), Vec::new());
    for frame in 1..=frames {
        let (pose, took) = time_process(|| pool.install(|| scene.pose(frame as f64 / FRAMES_PER_SECOND)));
        posing.push(took.cpu_s * 1e3);
        let ((), took) = time_process(|| pool.install(|| tracer.update(scene, &pose)));
        updating.push(took.cpu_s * 1e3);
    }
    let moves = |i: &usize| first.instances[*i].deformed.is_some();
    let triangles = |i: usize| scene.meshes[scene.instances[i].mesh as usize].triangles.len();
    Ok(Moving {
        name: name.to_owned(),
        triangles: scene.triangle_count(),
        deformed: (0..scene.instances.len()).filter(moves).map(triangles).sum(),
        pose_ms: median(posing),
        update_ms: median(updating),
    })
}
