//! Building, timed, and what it takes in memory.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result};
use dapple_trace::Tracer;
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::triangle::Triangle;
use parry3d::math::Vector;
use parry3d::shape::TriMesh;

use crate::clock::{Took, median, time_process};
use crate::embree::{self, Device, Embree, Geometry, Quality, SceneFlags};
use crate::scenes::Triangles;
use crate::tracers::{self, Candidate};

/// What building took and gave.
pub(crate) struct Built {
    pub(crate) name: &'static str,
    pub(crate) one_thread: Took,
    /// `None` where the builder has one thread only.
    pub(crate) all_threads: Option<Took>,
    /// What queries need; `None` where nobody counts it.
    pub(crate) bytes: Option<usize>,
    /// The most that building held.
    pub(crate) most_bytes: Option<usize>,
}

/// All tracers of one mesh.
pub(crate) struct Tracers {
    ours: Tracer,
    embree: Vec<(Quality, embree::Scene)>,
    obvhs: (CwBvh, Vec<Triangle>),
    parry: TriMesh,
}

impl Tracers {
    pub(crate) fn candidates(&self) -> Vec<Candidate<'_>> {
        let mut all: Vec<Candidate> = tracers::ours(&self.ours).into();
        all.extend(self.embree.iter().flat_map(|(quality, scene)| tracers::embree(scene, *quality)));
        all.push(tracers::obvhs(&self.obvhs.0, &self.obvhs.1));
        all.push(tracers::parry(&self.parry));
        all
    }
}

/// Builders that can use all threads.
const QUALITIES: [(Quality, &str); 2] = [(Quality::Medium, "Embree medium"), (Quality::High, "Embree high")];
const OURS: &str = "ours";

/// Builds everything on one thread, ours and Embree's `repetitions` times.
pub(crate) fn build(
    mesh: &Triangles,
    embree: Option<&Arc<Embree>>,
    flags: SceneFlags,
    repetitions: usize,
) -> Result<(Tracers, Vec<Built>)> {
    let mut table = Vec::new();
    let mut note = |name, one_thread, bytes, most_bytes| {
        table.push(Built { name, one_thread, all_threads: None, bytes, most_bytes });
    };
    let (ours, took) = build_ours(mesh, 1, repetitions)?;
    note(OURS, took, Some(ours.bytes()), None);

    let mut scenes = Vec::new();
    if let Some(embree) = embree {
        let geometry = Geometry::new(&mesh.positions, &mesh.triangles)?;
        for (quality, name) in QUALITIES {
            let (scene, took) = build_embree(embree, &geometry, quality, flags, 1, repetitions)?;
            let (bytes, most_bytes) = scene.memory();
            note(name, took, Some(bytes), Some(most_bytes));
            scenes.push((quality, scene));
        }
    }

    let triangles: Vec<Triangle> = mesh
        .triangles
        .iter()
        .map(|t| {
            let [v0, v1, v2] = t.map(|i| mesh.positions[i as usize].into());
            Triangle { v0, v1, v2 }
        })
        .collect();
    let (tree, took) = time_process(|| {
        build_cwbvh_from_tris(&triangles, BvhBuildParams::slow_build(), &mut Duration::default())
    });
    let bytes = size_of_val(&*tree.nodes) + size_of_val(&*tree.primitive_indices) + size_of_val(&*triangles);
    note("obvhs slow", took, Some(bytes), None);

    let vertices = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let (parry, took) = time_process(|| TriMesh::new(vertices, mesh.triangles.clone()));
    note("parry", took, None, None);
    let parry = parry.context("parry refuses the mesh")?;
    Ok((Tracers { ours, embree: scenes, obvhs: (tree, triangles), parry }, table))
}

/// Builds again, on all threads, what can, and notes what that took.
///
/// After everything else: Embree's other threads stay, and spin beside whatever is measured later.
pub(crate) fn build_on_all_threads(
    mesh: &Triangles,
    embree: Option<&Arc<Embree>>,
    flags: SceneFlags,
    repetitions: usize,
    table: &mut [Built],
) -> Result<()> {
    let mut note = |name, took| {
        table.iter_mut().filter(|built| built.name == name).for_each(|built| built.all_threads = Some(took));
    };
    note(OURS, build_ours(mesh, 0, repetitions)?.1);
    if let Some(embree) = embree {
        let geometry = Geometry::new(&mesh.positions, &mesh.triangles)?;
        for (quality, name) in QUALITIES {
            note(name, build_embree(embree, &geometry, quality, flags, 0, repetitions)?.1);
        }
    }
    Ok(())
}

fn build_ours(mesh: &Triangles, threads: usize, repetitions: usize) -> Result<(Tracer, Took)> {
    let (scene, pose) = mesh.scene();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    repeat(repetitions, || Ok(time_process(|| pool.install(|| Tracer::new(&scene, &pose)))))
}

fn build_embree(
    embree: &Arc<Embree>,
    geometry: &Arc<Geometry>,
    quality: Quality,
    flags: SceneFlags,
    threads: usize,
    repetitions: usize,
) -> Result<(embree::Scene, Took)> {
    repeat(repetitions, || {
        // A device for each, so that its memory is that of one scene; making it is not timed.
        let device = Device::new(embree, threads)?;
        let (scene, took) = time_process(|| embree::Scene::new(&device, geometry, quality, flags));
        Ok((scene?, took))
    })
}

/// What the last repetition made, and the medians of all.
fn repeat<T>(repetitions: usize, mut work: impl FnMut() -> Result<(T, Took)>) -> Result<(T, Took)> {
    let (mut made, took) = work()?;
    let mut all = vec![took];
    for _ in 1..repetitions {
        // The one before goes first: two at a time would take twice the memory.
        drop(made);
        let (next, took) = work()?;
        made = next;
        all.push(took);
    }
    let of = |pick: fn(&Took) -> f64| median(all.iter().map(pick));
    Ok((made, Took { wall_s: of(|t| t.wall_s), cpu_s: of(|t| t.cpu_s) }))
}
