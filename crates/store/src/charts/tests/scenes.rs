//! The invariants over real scenes.

use std::path::{Path, PathBuf};

use dapple_scene::{Files, Scene, load};

use super::super::*;
use super::invariants::{Figures, check};

struct Folder(PathBuf);

impl Files for Folder {
    fn read(&self, uri: &str, limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        let path = self.0.join(uri);
        if std::fs::metadata(&path)?.len() > limit_bytes {
            return Err(std::io::Error::other("file too large"));
        }
        std::fs::read(path)
    }
}

/// Scene files below a folder, in order of their names.
fn scene_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files.extend(scene_files(&path));
        } else if path.extension().is_some_and(|e| ["glb", "gltf", "obj"].iter().any(|known| e == *known)) {
            files.push(path);
        }
    }
    files
}

/// Mean area of a texel's share if the whole scene had about so many.
fn texel_for(scene: &Scene, texels: f64) -> f32 {
    let mut area = 0.0;
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh as usize];
        let key = InstanceKey { mesh: instance.mesh, rest_from_mesh: instance.rest_from_mesh, texel_m: 0.0 };
        let positions = key.positions_rest(&mesh.positions);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| positions[v as usize].as_dvec3());
            area += 0.5 * (b - a).cross(c - a).length();
        }
    }
    (area / texels).sqrt() as f32
}

#[test]
fn real_scenes_keep_the_promises() {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared");
    let folder = PathBuf::from(std::env::var("DAPPLE_SHARED").unwrap_or(default.to_owned())).join("scenes");
    if !folder.is_dir() {
        eprintln!("skipped: {} not found", folder.display());
        return;
    }
    eprintln!(
        "scene: sets, triangles, per vertex; charts, texels, in charts, sites; farthest, deepest; ms to make, sites"
    );
    for path in scene_files(&folder) {
        let bytes = std::fs::read(&path).unwrap();
        let files = Folder(path.parent().unwrap().to_owned());
        let name = path.file_name().unwrap().to_str().unwrap();
        let scene = load(name, &bytes, &files).unwrap();
        for texels in [20e3, 200e3] {
            check_scene(name, &scene, texels);
        }
    }
}

fn check_scene(name: &str, scene: &Scene, texels: f64) {
    let texel_m = texel_for(scene, texels);
    let plan = SceneCharts::plan(scene.instances.iter().map(|instance| {
        let (mesh, rest_from_mesh) = (instance.mesh, instance.rest_from_mesh);
        Some(InstanceKey { mesh, rest_from_mesh, texel_m })
    }));
    let mut sum = Figures::default();
    let (mut triangles, mut charts, mut texels, mut per_vertex) = (0, 0, 0, 0);
    let (mut made, mut sited) = (0.0, 0.0);
    let mut pages = Vec::new();
    for key in plan.sets() {
        let mesh = &scene.meshes[key.mesh as usize];
        let positions = key.positions_rest(&mesh.positions);
        let params = key.params(&ChartParams::for_spacing(1.0, false));
        let begin = std::time::Instant::now();
        let set = ChartSet::new(&positions, &mesh.triangles, &params).unwrap();
        made += begin.elapsed().as_secs_f64();
        let begin = std::time::Instant::now();
        assert!(set.sites(&positions, &mesh.triangles).len() <= set.texel_count() as usize);
        sited += begin.elapsed().as_secs_f64();
        let figures = check(&positions, &mesh.triangles, &params, &set);
        triangles += mesh.triangles.len();
        charts += set.chart_count();
        texels += set.texel_count();
        per_vertex += u32::from(set.is_per_vertex());
        sum.sites += figures.sites;
        sum.in_charts += figures.in_charts;
        sum.farthest = sum.farthest.max(figures.farthest);
        sum.deepest = sum.deepest.max(figures.deepest);
        pages.extend_from_slice(set.pages());
    }
    let atlas = Atlas::for_pages(&pages, 4096, 8);
    let percent = |part: f64| 100.0 * part / f64::from(texels.max(1));
    eprintln!(
        "{name}: {} sets, {triangles} triangles, {per_vertex} per vertex; {charts} charts, {texels} texels, \
         {:.0} % in charts, {:.0} % sites; {:.2}, {:.2}; {:.0} ms, {:.0} ms; atlas {}",
        plan.sets().len(),
        percent(sum.in_charts as f64),
        percent(sum.sites as f64),
        sum.farthest,
        sum.deepest,
        made * 1e3,
        sited * 1e3,
        atlas.side(),
    );
}
