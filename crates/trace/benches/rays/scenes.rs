//! What is traced: built-in scenes, spheres made here, and scenes by others where they are at hand.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use dapple_scene::builtin::{self, BUILTINS};
use dapple_scene::glam::{Affine3A, Mat3, Vec3};
use dapple_scene::{Aabb, Files, Instance, Material, Mesh, NoFiles, Part, Pose, PosedInstance, Scene};
use dapple_trace::sampling::{hash, unit_interval};

const SPHERES: &str = "spheres";
/// Scenes by others, from the folder of shared scenes: name and file.
const SHARED: [(&str, &str); 2] =
    [("sponza", "sponza-dabrovic/sponza.obj"), ("bunny", "stanford-bunny/stanford-bunny.obj")];

/// One mesh in the world: all that any tracer gets.
pub(crate) struct Triangles {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) bounds: Aabb,
}

impl Triangles {
    fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Triangles {
        let corners = triangles.iter().flatten().map(|&i| positions[i as usize]);
        let bounds = Aabb::from_points(corners);
        Triangles { positions, triangles, bounds }
    }

    /// Everything of a scene that casts, at time 0, without its materials: all of it is opaque.
    fn flattened(scene: &Scene) -> Triangles {
        let pose = scene.pose(0.0);
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (i, instance) in scene.instances.iter().enumerate().filter(|(_, instance)| instance.casts) {
            let first = positions.len() as u32;
            let world_from_mesh = &pose.instances[i].world_from_mesh;
            let placed =
                scene.vertex_positions(&pose, i).iter().map(|p| world_from_mesh.transform_point3(*p));
            positions.extend(placed);
            let mesh = &scene.meshes[instance.mesh as usize];
            triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| first + v)));
        }
        Triangles::new(positions, triangles)
    }

    /// As a scene of one mesh and one instance, for our tracer.
    pub(crate) fn scene(&self) -> (Scene, Pose) {
        let count = self.triangles.len() as u32;
        let mesh = Mesh {
            positions: self.positions.clone(),
            normals: vec![Vec3::Y; self.positions.len()],
            triangles: self.triangles.clone(),
            parts: vec![Part { first_triangle: 0, triangle_count: count, material: 0 }],
            ..Mesh::default()
        };
        let instance = Instance {
            node: 0,
            mesh: 0,
            skin: None,
            casts: true,
            emitter: Default::default(),
            receives: true,
            rest_from_mesh: Mat3::IDENTITY,
            spare: false,
        };
        let posed = PosedInstance { world_from_mesh: Affine3A::IDENTITY, deformed: None };
        let scene = Scene {
            meshes: vec![mesh],
            materials: vec![Material::default()],
            instances: vec![instance],
            ..Scene::default()
        };
        (scene, Pose { instances: vec![posed], ..Pose::default() })
    }
}

/// The names of all scenes, in order.
pub(crate) fn names() -> Vec<&'static str> {
    let built_in = BUILTINS.iter().map(|b| b.name);
    built_in.chain([SPHERES]).chain(SHARED.map(|(name, _)| name)).collect()
}

/// The scene of that name; `None`, after saying so aloud, if its file is not at hand.
pub(crate) fn make(name: &str) -> Result<Option<Triangles>> {
    if name == SPHERES {
        return Ok(Some(spheres()));
    }
    let scene = match SHARED.iter().find(|(known, _)| *known == name) {
        Some((_, file)) => load_shared(file)?,
        None if names().contains(&name) => Some(load_builtin(name)?),
        None => bail!("there is no scene {name:?}; known are: {}", names().join(", ")),
    };
    Ok(scene.map(|scene| Triangles::flattened(&scene)))
}

/// A built-in scene in full detail.
pub(crate) fn load_builtin(name: &str) -> Result<Scene> {
    let glb = builtin::glb(name, 1.0)?;
    Ok(dapple_scene::load(&format!("{name}.glb"), &glb, &NoFiles)?)
}

/// The files beside a scene.
struct Folder(PathBuf);

impl Files for Folder {
    fn read(&self, uri: &str, _limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        std::fs::read(self.0.join(uri))
    }
}

/// A scene of the folder `shared/scenes`, which lies beside the checkout or above it.
pub(crate) fn load_shared(file: &str) -> Result<Option<Scene>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().skip(3);
    let Some(path) = root.map(|folder| folder.join("shared/scenes").join(file)).find(|path| path.exists())
    else {
        println!("skipped: {file}, there is no ../shared/scenes/{file} beside the checkout");
        return Ok(None);
    };
    let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let folder = Folder(path.parent().unwrap_or(Path::new("")).to_owned());
    let scene = dapple_scene::load(&name, &bytes, &folder);
    Ok(Some(scene.with_context(|| format!("cannot load {}", path.display()))?))
}

/// A million triangles: 5 × 4 × 5 bumpy spheres that nearly touch.
fn spheres() -> Triangles {
    const RINGS: u32 = 71;
    const SEGMENTS: u32 = 72;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for sphere in 0..100_u32 {
        let random = |sample| unit_interval(hash(2, u64::from(sphere), sample));
        let cell = Vec3::new((sphere % 5) as f32, (sphere / 5 % 4) as f32, (sphere / 20) as f32);
        let center = cell * 2.0 + Vec3::new(random(0), random(1), random(2)) * 0.4;
        let (radius, waves, phase) = (0.7 + 0.3 * random(3), 5.0 + 9.0 * random(4), 6.0 * random(5));
        let first = positions.len() as u32;
        for ring in 0..=RINGS {
            let theta = ring as f32 / RINGS as f32 * std::f32::consts::PI;
            for segment in 0..SEGMENTS {
                let phi = segment as f32 / SEGMENTS as f32 * std::f32::consts::TAU;
                let (sin, cos) = (libm::sinf(theta), libm::cosf(theta));
                let outward = Vec3::new(sin * libm::cosf(phi), cos, sin * libm::sinf(phi));
                let wave = |x: f32| libm::sinf(waves * x + phase);
                let bump = 1.0 + 0.12 * wave(outward.x) * wave(outward.y) * wave(outward.z);
                positions.push(center + outward * (radius * bump));
            }
        }
        for ring in 0..RINGS {
            for segment in 0..SEGMENTS {
                let at = |r: u32, s: u32| first + r * SEGMENTS + s % SEGMENTS;
                let (a, b) = (at(ring, segment), at(ring, segment + 1));
                let (c, d) = (at(ring + 1, segment), at(ring + 1, segment + 1));
                // At the poles one of the two has no area.
                if ring > 0 {
                    triangles.push([a, b, c]);
                }
                if ring + 1 < RINGS {
                    triangles.push([b, d, c]);
                }
            }
        }
    }
    Triangles::new(positions, triangles)
}
